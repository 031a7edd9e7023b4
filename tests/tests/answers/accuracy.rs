//! What docs/accuracy.md promises beside the rounding budget: far from the origin, brackets, ties, bounded work.

use super::kinds::pairs;
use contactd::cache::prepare_scene;
use contactd::check::Check;
use contactd::contact::{
    Outcome, PairQuery, PlacedModel, QueryOptions, Scratch, Status, Strategies, default_resolution, earliest_contact,
};
use contactd::import::{self, Limits};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::world::{MeasuredModel, ObjectSpec, StepOptions, StepOutcome, World};
use contactd_proto::{Motion, Pose, PoseRecord};
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::engine::{CELL_LIMIT, ask};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::{self, Recipe, Scene};
use glam::{DQuat, DVec3, dvec3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::path::Path;
use std::sync::Arc;

const DOWN: DVec3 = DVec3::NEG_Z;

fn falling_turned(a: Recipe, b: Recipe, start: DVec3, turn: DQuat, velocity: DVec3, spin: DVec3) -> Scene {
    Scene::new("known", a, Motion::resting(Pose::IDENTITY), b, Motion { start: Pose::new(start, turn), velocity, spin })
}

fn plate(hole: f64) -> Recipe {
    Recipe::cuboid(0.5, 0.5, 0.1).minus(Recipe::cylinder(hole, 0.5))
}

fn cube() -> Recipe {
    Recipe::cuboid(0.5, 0.5, 0.5)
}

/// A cone whose apex points down, at the origin.
fn tip_down(r: f64, height: f64) -> Recipe {
    let turned = Pose::new(dvec3(0.0, 0.0, 0.5 * height), DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0));
    Recipe::cone(r, 0.0, 0.5 * height).moved(&turned)
}

/// Known cases: name, scene, time of contact, and by how many resolutions the two surfaces together must go on along the
/// normal until a point is a resolution deep in both: 1 for a face, 1/sin of the half angle for an edge or apex.
fn known() -> Vec<(&'static str, Scene, f64, f64)> {
    let straight = |a, b, start, velocity| Scene::falling(a, b, start, velocity);
    let lying = DQuat::from_rotation_x(FRAC_PI_2);
    let slant = |r: f64, h: f64| r.hypot(h) / r;
    vec![
        ("ball on a box", straight(cube(), Recipe::sphere(0.5), dvec3(0.1, 0.2, 1.5), DOWN), 0.5, 2.0),
        ("ball on a ball", straight(Recipe::sphere(0.5), Recipe::sphere(0.25), dvec3(0.0, 0.0, 1.25), DOWN), 0.5, 2.0),
        ("box on a box", straight(cube(), cube(), dvec3(0.2, 0.1, 1.5), DOWN), 0.5, 2.0),
        (
            "lying cylinder",
            falling_turned(cube(), Recipe::cylinder(0.25, 0.5), DVec3::Z * 1.25, lying, DOWN, DVec3::ZERO),
            0.5,
            2.0,
        ),
        ("peg sideways", straight(plate(0.25), Recipe::cylinder(0.24, 0.5), DVec3::ZERO, DVec3::X * 0.125), 0.08, 2.0),
        ("fast ball", straight(cube(), Recipe::sphere(0.5), DVec3::Z * 51.0, DOWN * 100.0), 0.5, 2.0),
        (
            "edge on a face",
            falling_turned(cube(), cube(), DVec3::Z * 2.0, DQuat::from_rotation_x(FRAC_PI_4), DOWN, DVec3::ZERO),
            1.5 - 0.5f64.sqrt(),
            1.0 + 2f64.sqrt(),
        ),
        ("apex on a face", straight(cube(), tip_down(0.3, 1.0), DVec3::Z, DOWN), 0.5, 1.0 + slant(0.3, 1.0)),
        ("needle on a face", straight(cube(), tip_down(0.01, 1.0), DVec3::Z, DOWN), 0.5, 1.0 + slant(0.01, 1.0)),
        (
            "cone in a cone",
            {
                let block = Recipe::cuboid(1.0, 1.0, 0.75).at(0.0, 0.0, 0.25).minus(tip_down(0.5, 1.0));
                straight(block, tip_down(0.5, 1.0), DVec3::Z, DOWN * 1.5)
            },
            2.0 / 3.0,
            2.0 * slant(0.5, 1.0),
        ),
    ]
}

#[test]
fn a_bracket_is_as_wide_as_the_resolution_over_the_closing_speed() {
    for (name, scene, time, lag) in known() {
        let o = ask(&scene);
        assert_eq!(o.status(), Status::Contact, "{name}: {o:?}");
        assert!((o.time() - time).abs() <= 1e-12, "{name}: {} and not {time}", o.time());
        let speed = (scene.motion_b.velocity - scene.motion_a.velocity).length();
        let width = (o.time_upper() - o.time_lower()) * speed / o.resolution;
        println!("{name}: bracket {:.2e}, {width:.3} resolutions of travel", o.time_upper() - o.time_lower());
        // Some thousandths for the witness' own reserve.
        assert!(width <= 1.01 * lag, "{name}: {width} resolutions, expected {lag}");
        assert!(o.time_lower() <= time + 1e-12 && time <= o.time_upper(), "{name}: {o:?}");
    }
}

#[test]
fn brackets_of_random_scenes_hold_their_time_and_are_a_few_resolutions_wide() {
    let mut r = Random::new(41);
    let (mut widths, mut retreats) = (Vec::new(), 0);
    let count = pairs(60);
    for _ in 0..count {
        let o = ask(&scenes::any(&mut r));
        if o.status() != Status::Contact || o.at().normal_speed <= 0.0 {
            continue;
        }
        assert!(o.time_lower() <= o.time() && o.time() <= o.time_upper(), "{o:?}");
        let width = (o.time_upper() - o.time_lower()) * o.at().normal_speed / o.resolution;
        retreats += usize::from(width > 2.01);
        widths.push(width);
    }
    widths.sort_by(f64::total_cmp);
    let n = widths.len();
    assert!(5 * n >= 2 * count, "{n} contacts");
    println!(
        "{n} contacts, width in resolutions of travel: median {:.2}, 95% {:.2}, worst {:.2}; {retreats} above 2.01",
        widths[n / 2],
        widths[n * 95 / 100],
        widths[n - 1]
    );
    assert!(widths[n / 2] <= 3.0 && widths[n - 1] <= 60.0, "{:?}", &widths[n - 5..]);
}

/// The scene with positions on a grid of 2⁻²⁰, so that an offset of 1e7 can be added to them exactly.
fn on_a_grid(scene: &Scene) -> Scene {
    let snap = |m: Motion| {
        let p = (m.start.position * 1048576.0).round() / 1048576.0;
        Motion { start: Pose::new(p, m.start.rotation), ..m }
    };
    Scene { motion_a: snap(scene.motion_a), motion_b: snap(scene.motion_b), ..scene.clone() }
}

fn shifted(scene: &Scene, by: DVec3) -> Scene {
    let shift = |m: Motion| Motion { start: Pose::new(m.start.position + by, m.start.rotation), ..m };
    Scene { motion_a: shift(scene.motion_a), motion_b: shift(scene.motion_b), ..scene.clone() }
}

fn same(near: &Outcome, far: &Outcome, what: &str) {
    let times = |o: &Outcome| [o.time_lower(), o.time(), o.time_upper()].map(f64::to_bits);
    assert_eq!((near.status(), times(near)), (far.status(), times(far)), "{what}: {near:?} and {far:?}");
    assert_eq!(
        (near.at().kind, near.at().extent, near.at().faces_a, near.at().faces_b),
        (far.at().kind, far.at().extent, far.at().faces_a, far.at().faces_b)
    );
    assert_eq!(near.at().normal.to_array().map(f64::to_bits), far.at().normal.to_array().map(f64::to_bits), "{what}");
}

#[test]
fn ten_million_sizes_from_the_origin_the_same_bits_come_out() {
    let far = dvec3(1e7, -1e7, 0.9e7);
    for (name, scene, ..) in known() {
        let scene = on_a_grid(&scene);
        same(&ask(&scene), &ask(&shifted(&scene, far)), name);
    }
    let mut r = Random::new(42);
    let mut met = 0;
    for i in 0..60 {
        let scene = on_a_grid(&scenes::any(&mut r));
        let near = ask(&scene);
        met += usize::from(near.status() == Status::Contact);
        same(&near, &ask(&shifted(&scene, far)), &format!("{} {i}", scene.class));
    }
    assert!(met >= 20, "{met} contacts");
}

#[test]
fn positions_that_cannot_hold_the_offset_cost_what_they_lost_over_the_closing_speed() {
    let far = dvec3(1e7, -1e7, 0.9e7);
    let mut r = Random::new(43);
    let (mut met, mut worst) = (0, 0.0f64);
    for i in 0..60 {
        let scene = scenes::any(&mut r);
        let (near, away) = (ask(&scene), ask(&shifted(&scene, far)));
        if near.status() != Status::Contact || near.at().normal_speed < 0.05 || near.time() == 0.0 {
            continue;
        }
        met += 1;
        assert_eq!(away.status(), Status::Contact, "{i}: {near:?} and {away:?}");
        // Each position loses half a unit in the last place of 1e7, on three axes, for two bodies.
        let lost = 2.0 * 3f64.sqrt() * 0.5 * (1e7f64.next_up() - 1e7);
        let allowed = (lost + 1e-12) / near.at().normal_speed;
        worst = worst.max((near.time() - away.time()).abs() / allowed);
        assert!((near.time() - away.time()).abs() <= 8.0 * allowed, "{i}: {near:?} and {away:?}");
    }
    println!("{met} contacts, worst {worst:.2} of what the positions lost");
    assert!(met >= 15, "{met} contacts");
}

#[test]
fn of_two_contacts_within_one_bracket_the_one_that_touches_first_is_reported() {
    // A ball, and beside it an edge of 90° that reaches lower by less than a resolution: the ball is deep first.
    let wedge = Recipe::cuboid(0.2, 0.2, 0.2).moved(&Pose::new(DVec3::ZERO, DQuat::from_rotation_x(FRAC_PI_4)));
    let down = 0.08f64.sqrt();
    for (lower, kind) in [(0.2, "edge-face"), (0.6, "edge-face"), (-0.2, "face-face"), (-0.6, "face-face")] {
        let floor = Recipe::cuboid(2.0, 2.0, 0.5).at(0.0, 0.0, -0.5);
        let delta = 1e-7;
        let pair = wedge.at(0.7, 0.0, down - lower * delta).union(Recipe::sphere(0.25).at(-0.7, 0.0, 0.25));
        let mut scene = Scene::falling(floor, pair, DVec3::Z * 0.5, DOWN);
        scene.resolution = Some(delta);
        let o = ask(&scene);
        assert_eq!(o.status(), Status::Contact, "{o:?}");
        let time = 0.5 - f64::max(lower, 0.0) * delta;
        assert!((o.time() - time).abs() <= 1e-12, "lower by {lower}: {} and not {time}: {o:?}", o.time());
        assert_eq!(o.at().kind.name(), kind, "{o:?}");
        assert!(o.time_lower() <= o.time() && o.time() <= o.time_upper(), "{o:?}");
    }
}

#[test]
fn the_parts_of_the_assembly_meet_at_the_same_times_at_a_thousandth_of_the_resolution() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../server/models/assembly.toml");
    let scene = import::scene::read_scene(&path).expect("the scene");
    let outcome = |resolution: Option<f64>| {
        let models = prepare_scene(None, &scene, import::Facets::Exact, &Limits::default()).expect("its models");
        let models: Vec<_> = models.into_iter().map(|p| p.model).collect();
        let mut check = Check::new(&scene, &models, resolution).expect("a world");
        check.step(false).expect("a step").clone()
    };
    let (coarse, fine) = (outcome(None), outcome(Some(8e-11)));
    let mut met = 0;
    for p in coarse.pairs.iter().filter(|p| p.outcome.status() == Status::Contact) {
        let q = fine.pairs.iter().find(|q| (q.a, q.b) == (p.a, p.b)).expect("the same pairs");
        assert_eq!((q.outcome.status(), q.outcome.at().kind), (p.outcome.status(), p.outcome.at().kind), "{p:?} {q:?}");
        assert!((p.outcome.time() - q.outcome.time()).abs() <= 1e-12, "{p:?} {q:?}");
        met += 1;
    }
    assert_eq!(met, 7);
}

// Bounded work.

/// The peg is made by an intersection: nothing in front of the search answers for it.
fn tilted_peg() -> (Recipe, Recipe, Motion) {
    let start = Pose::new(DVec3::Z, DQuat::from_rotation_y(3f64.to_radians()));
    let peg = Recipe::cylinder(0.24, 1.0).intersection(Recipe::cuboid(1.0, 1.0, 0.5));
    (plate(0.25), peg, Motion { start, velocity: DOWN, spin: DVec3::ZERO })
}

#[test]
fn a_pair_stops_at_its_limit_with_what_is_proven_by_then() {
    let (a, b, motion) = tilted_peg();
    let models = [Model::new(a.build()), Model::new(b.build())];
    let with = |limit: u64| {
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        let query = PairQuery {
            a: PlacedModel { model: &models[0], placed: placed(Motion::resting(Pose::IDENTITY)) },
            b: PlacedModel { model: &models[1], placed: placed(motion) },
            resolution: default_resolution(&models[0], &models[1]),
            cell_limit: limit,
            // With cells as they are: smaller ones are too few to be cut in many ways.
            strategies: Strategies { tighten: false, ..Strategies::default() },
            query_options: QueryOptions::DEPTH,
        };
        earliest_contact(&query, &mut Scratch::default())
    };
    let whole = with(CELL_LIMIT);
    assert!(whole.status() == Status::Contact && whole.counters.cells > 20, "{whole:?}");
    let mut before = 0.0;
    for limit in [0, 1, 2, 3, 5, 10, 20, whole.counters.cells / 2] {
        let o = with(limit);
        assert_eq!(o.status(), Status::Undecided, "limit {limit}: {o:?}");
        assert_eq!((o.time(), o.time_upper(), o.counters.cells), (1.0, 1.0, limit), "{o:?}");
        println!("limit {limit}: free until {}", o.time_lower());
        assert!(before <= o.time_lower() && o.time_lower() <= whole.time_upper(), "limit {limit}, {before}: {o:?}");
        before = o.time_lower();
    }
    // What is found with exactly the cells that it takes is the answer, to the bit.
    assert_eq!(with(whole.counters.cells), whole);
    // Stages 1 and 2 need no cells: what they prove clear is clear without any.
    let away = Scene::falling(plate(0.25), Recipe::cylinder(0.24, 0.5), DVec3::Z * 5.0, DVec3::Z);
    let mut o = ask(&away);
    assert_eq!((o.status(), o.counters.cells), (Status::Clear, 0), "{o:?}");
    // Both levels of a search count together: a body pressed on where it rests.
    o = ask(&Scene::falling(cube(), cube(), DVec3::Z * (1.0 - 2.5e-9), DOWN));
    assert!(o.status() == Status::Contact && o.touching, "{o:?}");
}

/// Four plates in a row and a tilted peg above each; peg i falls i + 2 lengths a step, so that the last meets first.
fn pegs() -> (World, Vec<PoseRecord>) {
    let (plate, peg, motion) = tilted_peg();
    let part = |r: &Recipe| Arc::new(MeasuredModel::new(Arc::new(Model::new(r.build()))));
    let (plate, peg) = (part(&plate), part(&peg));
    let mut world = World::new(16, 16);
    let mut records = Vec::new();
    for i in 0..4u32 {
        let x = DVec3::X * 4.0 * f64::from(i);
        let mut add = |id: u32, part: &Arc<MeasuredModel>, is_static: bool, pose: Pose| {
            let spec = ObjectSpec { is_static, ..ObjectSpec::new(id, part, pose) };
            world.add_object(spec).expect("an object");
        };
        add(2 * i, &plate, true, Pose::at(x));
        let start = Pose::new(motion.start.position + x, motion.start.rotation);
        add(2 * i + 1, &peg, false, start);
        let end = Pose::new(start.position + DOWN * f64::from(i + 1), start.rotation);
        records.push(PoseRecord::end(2 * i + 1, &end));
    }
    (world, records)
}

fn stepped(options: &StepOptions) -> StepOutcome {
    let (mut world, records) = pegs();
    world.step(&records, options).expect("a step").clone()
}

#[test]
fn a_batch_spends_its_limit_on_what_meets_first() {
    let whole = stepped(&StepOptions::default());
    let cells = whole.counters.cells;
    assert_eq!(whole.pairs.iter().filter(|p| p.outcome.status() == Status::Contact).count(), 4);
    assert!(cells >= 20, "{cells} cells");
    let mut decided_before = 0;
    for share in [0.0, 0.05, 0.3, 0.55, 0.8] {
        let limit = (share * cells as f64) as u64 + 1;
        let options = StepOptions { batch_limit: limit, ..StepOptions::default() };
        let out = stepped(&options);
        assert!(out.counters.cells <= limit, "{} cells of {limit}", out.counters.cells);
        assert_eq!(out.pairs.len(), 4, "every pair is reported");
        let decided = out.pairs.iter().filter(|p| p.outcome.status() == Status::Contact).count();
        // The earliest are decided, with the answers that they have without a limit; the latest are given up.
        for (i, p) in whole.pairs.iter().enumerate() {
            let q = out.pairs.iter().find(|q| (q.a, q.b) == (p.a, p.b)).expect("the pair");
            if i < decided {
                // But for the cells behind the contact that are asked whether another one touches first.
                let counters = p.outcome.counters;
                assert_eq!(Outcome { counters, ..q.outcome }, p.outcome, "limit {limit}");
            } else {
                assert_eq!(q.outcome.status(), Status::Undecided, "limit {limit}");
                assert!(q.outcome.time_lower() <= p.outcome.time() && q.outcome.time() == 1.0, "{q:?}");
            }
        }
        assert!(out.safe_time <= whole.safe_time);
        assert!(decided >= decided_before, "limit {limit}: {decided} decided, {decided_before} with less");
        decided_before = decided;
        // The same again, to the last bit.
        assert_eq!(stepped(&options).pairs, out.pairs);
    }
    assert!((1..4).contains(&decided_before), "{decided_before}");
    // With just enough nothing is lost.
    let enough = stepped(&StepOptions { batch_limit: cells, ..StepOptions::default() });
    assert_eq!(enough.pairs, whole.pairs);
}

#[test]
fn a_limit_on_the_first_contact_leaves_the_scene_undecided_and_never_late() {
    let first = |batch_limit| stepped(&StepOptions { first: true, batch_limit, ..StepOptions::default() });
    let whole = first(0);
    assert!(whole.contact && !whole.undecided && whole.pairs.len() == 1);
    let short = first(3);
    assert!(short.undecided && !short.contact && short.counters.cells <= 3, "{short:?}");
    assert!(short.safe_time <= whole.safe_time, "{} and {}", short.safe_time, whole.safe_time);
}
