//! Nothing undecided that has an answer: what is tiny, sharp or nearly as large as its hole.
//!
//! Random scenes of bodies 1e-2 to 1e-5 of their partner with apexes of 2 to 170 degrees, pegs on the rim of their holes, and
//! bodies in pockets of their own shape with clearances of 1e-12 to 1e-2 of the size, also negative, that tilt, slide, spin and
//! screw, at the default and at coarse resolutions. Every one must be decided within a bounded number of cells, and what is
//! told is held against a descent on max(f_A, f_B) of the test's own: no point deep before `time_lower`, one at
//! `time_upper`, none in a clear pair. The long form: `CONTACTD_TIGHT_SCENES=20000`, `CONTACTD_TIGHT_SEED=7`.

use contactd::contact::{
    Contact, Outcome, PairQuery, PlacedModel, QueryOptions, Scratch, Status, Strategies, Verdict, default_resolution,
    earliest_contact,
};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::local;
use contactd::solid::primitive::Polyhedron;
use contactd::solid::{Sense, Solid};
use contactd_proto::{Motion, Pose};
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::{self, Recipe, Scene};
use contactd_tests::sweep::sized;
use glam::{DMat3, DQuat, DVec3, dvec3};
use std::f64::consts::{PI, TAU};

/// The dearest scene may cost so many cells; a tenth of the default limit.
const CEILING: u64 = 100_000;

/// How far from a deep point the descent must be before it counts, and by how much it may fall short of one.
const ROOM: f64 = 0.05;

/// 10 to a power between `lo` and `hi`.
pub(super) fn decades(rng: &mut Random, lo: f64, hi: f64) -> f64 {
    10f64.powf(rng.within(lo, hi))
}

pub(super) fn prism(sides: usize, radius: f64, half: f64) -> Recipe {
    let corner = |k: usize, z: f64| {
        let (sin, cos) = (TAU * k as f64 / sides as f64).sin_cos();
        dvec3(radius * cos, radius * sin, z)
    };
    let vertices: Vec<_> = (0..sides).flat_map(|k| [corner(k, -half), corner(k, half)]).collect();
    let side = |k: usize| {
        let (sin, cos) = (TAU * (k as f64 + 0.5) / sides as f64).sin_cos();
        (dvec3(cos, sin, 0.0), radius * (PI / sides as f64).cos())
    };
    let planes = (0..sides).map(side).chain([(DVec3::Z, half), (DVec3::NEG_Z, half)]).collect();
    Recipe::of(Polyhedron { vertices: vertices.into(), planes })
}

/// A resolution: mostly the default, else up to 1e-5 of the given size.
fn resolution(rng: &mut Random, size: f64) -> Option<f64> {
    rng.chance(0.25).then(|| size * decades(rng, -9.0, -5.0))
}

/// Something small that comes down on a large body.
fn small(rng: &mut Random) -> Scene {
    let large = match rng.below(4) {
        0 => Recipe::cuboid(1.0, 1.0, 1.0).union(Recipe::sphere(0.3).at(0.5, 0.0, 0.0)),
        1 => Recipe::sphere(1.0).union(Recipe::cylinder(0.3, 1.2)),
        2 => Recipe::cuboid(1.0, 0.8, 0.6).minus(Recipe::cylinder(0.3, 2.0)),
        _ => {
            let leaves = 2 + rng.below(4);
            scenes::tree(rng, leaves)
        }
    };
    let size = decades(rng, -5.0, -2.0);
    let angle = rng.within(1.0, 85.0).to_radians();
    let little = match rng.below(6) {
        0..=2 => Recipe::cone(size * angle.tan().min(1.0), 0.0, 0.5 * size * (1.0 / angle.tan()).min(1.0)),
        3 => Recipe::cuboid(size, size * decades(rng, -2.0, 0.0), size * decades(rng, -2.0, 0.0)),
        4 => Recipe::cylinder(size * decades(rng, -2.0, 0.0), size),
        _ => Recipe::platonic([4, 6, 8, 12, 20][rng.below(5)], size),
    };
    let solid = large.build();
    let (x, n) = surface(rng, &solid);
    let start = Pose::new(x + n * size * 2.2, rng.rotation());
    let end = x - n * size * rng.within(-0.2, 1.0) + rng.vector(size);
    let spin = if rng.chance(0.7) { rng.vector(1.5) } else { DVec3::ZERO };
    let (a, b) = (Motion::resting(Pose::IDENTITY), Motion::turning(start, end, spin));
    let mut scene = Scene::new("small", large, a, little, b);
    scene.resolution = resolution(rng, 0.1 * size);
    if rng.chance(0.5) { scene.swapped() } else { scene }
}

/// A point of a solid's surface and the way out there, by walking in from far away.
fn surface(rng: &mut Random, solid: &Solid) -> (DVec3, DVec3) {
    loop {
        let out = rng.direction();
        let (from, to) = (out * 3.0, rng.vector(0.4));
        let way = (to - from).normalize();
        let mut s = 0.0;
        while s < 6.0 {
            let f = solid.value(from + way * s);
            if f < 1e-12 {
                let x = from + way * s;
                let e = 1e-7;
                let d = |v: DVec3| solid.value(x + v * e) - solid.value(x - v * e);
                return (x, dvec3(d(DVec3::X), d(DVec3::Y), d(DVec3::Z)).normalize_or(-way));
            }
            s += f;
        }
    }
}

/// A peg that is set on the rim of its hole, leaning a little.
fn rim(rng: &mut Random) -> Scene {
    let r = rng.within(0.1, 0.5);
    let hole = Recipe::cylinder(r, 2.0);
    let plate = Recipe::cuboid(3.0, 3.0, 0.6).minus(hole).at(0.0, 0.0, -0.6);
    let peg = r * (1.0 - decades(rng, -4.0, -1.5));
    let half = rng.within(0.2, 0.6);
    let body = if rng.chance(0.7) { Recipe::cylinder(peg, half) } else { Recipe::cone(peg, peg * 1.3, half) };
    let lean = DQuat::from_scaled_axis(rng.vector(0.02));
    let off = rng.vector(2.0 * (r - peg));
    let start = Pose::new(dvec3(off.x, off.y, half + 0.3), lean);
    let spin = if rng.chance(0.5) { DVec3::ZERO } else { rng.vector(0.01) };
    let b = Motion::turning(start, start.position - DVec3::Z * rng.within(0.4, 0.8), spin);
    let mut scene = Scene::new("rim", plate, Motion::resting(Pose::IDENTITY), body, b);
    scene.resolution = resolution(rng, r);
    scene
}

/// A body in a pocket of its own shape.
fn pocket(rng: &mut Random) -> Scene {
    let clearance = decades(rng, -12.0, -2.0) * if rng.chance(0.3) { -1.0 } else { 1.0 };
    let r = 0.5;
    let (grown, kind) = (r + clearance, rng.below(6));
    let block = Recipe::cuboid(1.5, 1.5, 0.5);
    let half = rng.within(0.2, 0.7);
    let (block, body) = match kind {
        0 => (block.minus(Recipe::sphere(grown).at(0.0, 0.0, 0.5)), Recipe::sphere(r).at(0.0, 0.0, 0.5)),
        1 => {
            let top = rng.within(0.3, 1.2);
            (block.minus(Recipe::cone(0.3 + clearance, top + clearance, half)), Recipe::cone(0.3, top, half))
        }
        2 => (block.minus(Recipe::cone(0.0, 0.8, half + clearance)), Recipe::cone(0.0, 0.8, half)),
        3 => (block.minus(Recipe::cylinder(grown, 2.0)), Recipe::cylinder(r, half)),
        4 => {
            let (y, z) = (rng.within(0.2, 0.6), half);
            let wider = Recipe::cuboid(grown, y + clearance, z + clearance);
            (block.minus(wider), Recipe::cuboid(r, y, z))
        }
        _ => {
            let sides = 3 + rng.below(8);
            (block.minus(Recipe::cylinder(grown, 2.0)), prism(sides, r, half))
        }
    };
    // Both go together; the body turns and slides a little against its block, or spins in it.
    let common = rng.chance(0.6);
    let pose = if common { scenes::pose(rng, 10.0) } else { Pose::IDENTITY };
    let way = if common { rng.vector(1.0) } else { DVec3::ZERO };
    let turn = if common { rng.vector(3.0) } else { DVec3::ZERO };
    let small = decades(rng, -8.0, -1.0);
    let along = pose.rotation * DVec3::Z;
    let (slide, tilt) = match rng.below(4) {
        0 => (DVec3::ZERO, rng.vector(small)),
        1 => (rng.vector(small), DVec3::ZERO),
        2 => (DVec3::ZERO, along * rng.within(-20.0, 20.0)),
        _ => (rng.vector(small), rng.vector(small) + along * rng.within(-2.0, 2.0)),
    };
    let a = Motion::turning(pose, pose.position + way, turn);
    let b = Motion::turning(pose, pose.position + way + slide, turn + tilt);
    let mut scene = Scene::new("pocket", block, a, body, b);
    scene.resolution = resolution(rng, r);
    if rng.chance(0.5) { scene.swapped() } else { scene }
}

/// A prism or a cylinder that screws itself into a round hole.
fn screw(rng: &mut Random) -> Scene {
    let r = rng.within(0.1, 0.4);
    // Prisms with less clearance than 3e-3 that screw themselves in by random ways may still cost all cells there are.
    let is_round = rng.chance(0.4);
    let clearance = r * decades(rng, if is_round { -7.0 } else { -2.5 }, -1.5);
    let at = rng.vector(0.1);
    let sink = Recipe::cone(r, r + 0.15, 0.075).at(at.x, at.y, 0.2);
    let plate = Recipe::cuboid(1.0, 1.0, 0.25).minus(Recipe::cylinder(r, 1.0).at(at.x, at.y, 0.0));
    let plate = if rng.chance(0.5) { plate.minus(sink) } else { plate };
    let body = if is_round {
        Recipe::cylinder(r - clearance, 0.5)
    } else {
        let sides = 3 + rng.below(10);
        prism(sides, r - clearance, 0.5)
    };
    let pose = scenes::pose(rng, 1.0);
    let (along, lean) = (pose.rotation * DVec3::Z, rng.vector(0.3 * clearance));
    let off = pose.rotation * (dvec3(at.x, at.y, 0.0) + rng.vector(0.5 * clearance));
    let start = Pose::new(pose.position + off + along * rng.within(0.7, 1.2), pose.rotation);
    let end = pose.position + off + along * rng.within(-0.2, 0.5) + rng.vector(0.5 * clearance);
    let spin = along * rng.within(-20.0, 20.0) + if rng.chance(0.5) { lean } else { DVec3::ZERO };
    let way = rng.vector(0.5);
    let a = Motion::turning(pose, pose.position + way, DVec3::ZERO);
    let b = Motion::turning(start, end + way, spin);
    let mut scene = Scene::new("screw", plate, a, body, b);
    scene.resolution = resolution(rng, r);
    scene
}

/// The two bodies of a scene with how they move.
pub(super) struct Pair<'a> {
    pub(super) models: [&'a Model; 2],
    pub(super) motions: [Motion; 2],
}

impl Pair<'_> {
    /// max(f_A, f_B) at a point of the world.
    fn value(&self, t: f64, x: DVec3) -> f64 {
        let of = |k: usize| {
            let pose = self.motions[k].at(t);
            self.models[k].solid.value(pose.rotation.conjugate() * (x - pose.position))
        };
        of(0).max(of(1))
    }

    /// The gradient of what decides max(f_A, f_B) at a point of the world.
    fn gradient(&self, t: f64, x: DVec3) -> DVec3 {
        let mut worst = (f64::NEG_INFINITY, DVec3::ZERO);
        for k in 0..2 {
            let (pose, solid) = (self.motions[k].at(t), &self.models[k].solid);
            let y = pose.rotation.conjugate() * (x - pose.position);
            let (value, id) = local::deciding(&solid.normal_form, &mut |f| solid.faces[f as usize].value(y));
            if value > worst.0 {
                let n = solid.faces[id.face() as usize].at(y).normal;
                worst = (value, pose.rotation * if id.sense() == Sense::Positive { n } else { -n });
            }
        }
        worst.1
    }

    /// A descent from `x` that stretches space along the differences of gradients, across a valley's floor (N. Z. Shor,
    /// "Minimization Methods for Non-Differentiable Functions", 1985).
    pub(super) fn descend(&self, t: f64, x: DVec3, step: f64) -> (DVec3, f64) {
        let (mut x, mut step, mut space) = (x, step, DMat3::IDENTITY);
        let mut best = (x, self.value(t, x));
        let mut g = self.gradient(t, x);
        for _ in 0..150 {
            let way = space * (space.transpose() * g).normalize_or_zero();
            if way == DVec3::ZERO || step < 1e-15 {
                break;
            }
            let (mut last, mut steps, mut next) = (self.value(t, x), 0, g);
            // On along the way until it leads up again.
            while steps < 40 {
                x -= way * step;
                steps += 1;
                next = self.gradient(t, x);
                let value = self.value(t, x);
                if value < best.1 {
                    best = (x, value);
                }
                if steps % 3 == 0 {
                    step *= 1.5;
                }
                if value >= last || next.dot(way) <= 0.0 {
                    break;
                }
                last = value;
            }
            if steps == 1 {
                step *= 0.8;
            }
            let r = (space.transpose() * (next - g)).normalize_or_zero();
            space *= DMat3::IDENTITY - DMat3::from_cols(r * r.x, r * r.y, r * r.z) * 0.6;
            g = next;
        }
        best
    }
}

/// What is wrong with an answer; nothing where it is right.
pub(super) fn judge(rng: &mut Random, scene: &Scene, o: &Outcome, pair: &Pair) -> Option<String> {
    let depth = o.depth;
    let radius = pair.models.iter().map(|m| m.radius).fold(f64::INFINITY, f64::min);
    let small = if pair.models[0].radius <= pair.models[1].radius { 0 } else { 1 };
    let anywhere = |rng: &mut Random, t: f64| {
        let b = pair.models[small].solid.aabb();
        let pose = pair.motions[small].at(t);
        let share = dvec3(rng.within(0.0, 1.0), rng.within(0.0, 1.0), rng.within(0.0, 1.0));
        pose.position + pose.rotation * (b.min + (b.max - b.min) * share)
    };
    let deepest = |rng: &mut Random, t: f64, near: Option<DVec3>| {
        let mut best = f64::INFINITY;
        for k in 0..12 {
            let (x, step) = match near {
                Some(x) if k < 6 => (x, radius * 1e-3 * 0.1f64.powi(k)),
                _ => (anywhere(rng, t), 0.3 * radius),
            };
            best = best.min(pair.descend(t, x, step).1);
        }
        best
    };
    match o.status() {
        Status::Undecided => return Some("undecided".into()),
        Status::Overlap => {
            // Deeper than 2 delta: how deep is told by a point.
            let value = deepest(rng, 0.0, Some(o.at().point));
            return (value > -1.9 * o.resolution).then(|| format!("overlap, but {value:e} at the start"));
        }
        Status::Contact | Status::Clear => {}
    }
    if !(0.0 <= o.time_lower() && o.time_lower() <= o.time() && o.time() <= o.time_upper() && o.time_upper() <= 1.0) {
        return Some("times out of order".into());
    }
    let near = (o.status() == Status::Contact).then_some(o.at().point);
    let travel = |k: usize| pair.motions[k].at(o.time_lower()).position - pair.motions[k].at(0.0).position;
    for part in [1.0 - 1e-12, 0.999, 0.9, 0.5, rng.within(0.0, 1.0)] {
        let t = o.time_lower() * part;
        let near = near.map(|x| x + travel(small) * (part - 1.0));
        let value = deepest(rng, t, near);
        if value < -(1.0 + ROOM) * depth {
            return Some(format!("{value:e} at {t}, before time_lower"));
        }
    }
    if o.status() == Status::Contact {
        let mut value = deepest(rng, o.time_upper(), near);
        // Along a crescent between like faces a descent creeps: the point that is told to lie so deep is asked, too.
        if let Verdict::Contact(Contact { witness: Some(x), .. }) = o.verdict {
            value = value.min(pair.value(o.time_upper(), pair.motions[0].at(o.time_upper()).point(x)));
        }
        if value > -(1.0 - ROOM) * depth {
            let (a, b) = (scene.a.build(), scene.b.build());
            let moving = |solid, motion| contactd_tests::reference::Moving { solid, place: Pose::IDENTITY, motion };
            let (a, b) = (moving(&a, scene.motion_a), moving(&b, scene.motion_b));
            value = value.min(contactd_tests::reference::deepest(a, b, o.time_upper()).1);
        }
        if value > -(1.0 - ROOM) * depth {
            return Some(format!("{value:e} at time_upper, depth {depth:e}"));
        }
    }
    None
}

pub(super) fn ask(scene: &Scene, models: [&Model; 2]) -> Outcome {
    ask_with(scene, models, Strategies::default())
}

fn ask_with(scene: &Scene, models: [&Model; 2], strategies: Strategies) -> Outcome {
    let placed = |motion| Placed { place: Pose::IDENTITY, motion };
    let query = PairQuery {
        a: PlacedModel { model: models[0], placed: placed(scene.motion_a) },
        b: PlacedModel { model: models[1], placed: placed(scene.motion_b) },
        resolution: scene.resolution.unwrap_or_else(|| default_resolution(models[0], models[1])),
        cell_limit: contactd::contact::DEFAULT_CELL_LIMIT,
        strategies,
        query_options: QueryOptions::CONTACT,
    };
    earliest_contact(&query, &mut Scratch::default())
}

/// Scenes of a kind that is drawn at random: twenty in the command, sixty in the long form.
fn scenes_of_a_kind() -> usize {
    sized("CONTACTD_TIGHT_SCENES", 20).min(60)
}

fn still() -> Motion {
    Motion::resting(Pose::IDENTITY)
}

/// The answer of a scene that was undecided once; at most `cells`.
#[track_caller]
fn decided(name: &str, scene: &Scene, cells: u64) -> Outcome {
    decided_with(name, scene, cells, Strategies::default())
}

#[track_caller]
fn decided_with(name: &str, scene: &Scene, cells: u64, strategies: Strategies) -> Outcome {
    let models = [&Model::new(scene.a.build()), &Model::new(scene.b.build())];
    let o = ask_with(scene, models, strategies);
    let pair = Pair { models, motions: [scene.motion_a, scene.motion_b] };
    assert_eq!(judge(&mut Random::new(1), scene, &o, &pair), None, "{name}: {o:?}");
    assert!(o.counters.cells <= cells, "{name}: {} cells", o.counters.cells);
    o
}

/// The first time at which `f` falls to 0, from `lo` where it is positive to `hi` where it is not.
fn root(mut lo: f64, mut hi: f64, f: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..200 {
        let middle = 0.5 * (lo + hi);
        if f(middle) > 0.0 { lo = middle } else { hi = middle }
    }
    hi
}

/// A cone of 1e-3 of its partner turns as it comes down with its apex first. The damped steps of Newton once ended beside the
/// solution: its column of time is as small as the cone.
#[test]
fn a_small_apex_on_a_large_body() {
    let large = || Recipe::cuboid(1.0, 1.0, 1.0).union(Recipe::sphere(0.3).at(0.7, 0.0, 0.0));
    for size in [1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5] {
        let cone = Recipe::cone(0.4 * size, 0.0, 0.5 * size);
        let turn = DQuat::from_rotation_y(2.9);
        let start = Pose::new(dvec3(0.13, -0.21, 1.0 + size), turn);
        let end = dvec3(0.13 + 0.3 * size, -0.21, 1.0);
        let motion = Motion::turning(start, end, dvec3(0.9, 0.45, -1.1));
        let apex = |t: f64| {
            let pose = motion.at(t);
            (pose.position + pose.rotation * dvec3(0.0, 0.0, 0.5 * size)).z - 1.0
        };
        let o = decided("apex", &Scene::new("apex", large(), still(), cone, motion), 100);
        assert_eq!(o.status(), Status::Contact, "{o:?}");
        let time = root(0.0, 1.0, apex);
        assert!((o.time() - time).abs() * size <= 1e-12 && !o.not_continued(), "{size}: {time}, {o:?}");
    }
}

/// A leaning peg set on the rim of its hole: rim against rim, two pairs of nearly opposite faces.
#[test]
fn a_leaning_peg_on_the_rim_of_its_hole() {
    let (wide, narrow, half) = (0.36, 0.3575, 0.4);
    let plate = Recipe::cuboid(3.0, 3.0, 0.6).minus(Recipe::cylinder(wide, 2.0)).at(0.0, 0.0, -0.6);
    let mut met = 0;
    for (lean, x, y) in [(0.0091, 0.0007, -0.0015), (0.004, 0.0027, 0.0), (0.015, -0.0028, 0.0003)] {
        let turn = DQuat::from_rotation_x(lean);
        let (axis, from) = (turn * DVec3::Z, dvec3(x, y, 0.83));
        let motion = Motion::turning(Pose::new(from, turn), from - DVec3::Z * 0.7, DVec3::ZERO);
        // When the peg's bottom comes to a point of the rim, and how far that is from the peg's side then.
        let bottom = |angle: f64| {
            let p = dvec3(wide * angle.cos(), wide * angle.sin(), 0.0);
            let t = root(0.0, 1.0, |t| -half - (p - motion.at(t).position).dot(axis));
            let d = p - motion.at(t).position;
            (t, (d - axis * d.dot(axis)).length() - narrow)
        };
        let first = |lo: f64, hi: f64| bottom(root(lo, hi, |angle| bottom(angle).1)).0;
        let n = 4000;
        let mut time = 1.0f64;
        for k in 0..n {
            let [lo, hi] = [k, k + 1].map(|k| TAU * k as f64 / n as f64);
            time = match (bottom(lo).1 > 0.0, bottom(hi).1 > 0.0) {
                (true, true) => time,
                (true, false) => time.min(first(lo, hi)),
                (false, true) => time.min(first(hi, lo)),
                (false, false) => time.min(bottom(lo).0),
            };
        }
        let o =
            decided("rim", &Scene::new("rim", plate.clone(), still(), Recipe::cylinder(narrow, half), motion), 1_000);
        assert_eq!(o.status(), if time < 1.0 { Status::Contact } else { Status::Clear }, "{o:?}");
        assert!((o.time() - time).abs() <= 1e-7 && o.time() <= time + 1e-10, "{time}, {o:?}");
        met += u32::from(time < 1.0);
    }
    assert!(met >= 2);
}

/// A frustum turns in a pocket of its own size, a ball in a socket that is too tight by a few resolutions: no face tells where
/// they meet first, the climb does.
/// A ball comes down into the rim of a hole, 1e-8 to 1e-4 beside its axis: it touches first on that side. All along the rim it nearly
/// touches; where it does first is solved for in a few steps, and few cells are left to look at.
#[test]
fn a_ball_that_comes_down_beside_the_axis_of_a_rim_touches_on_that_side() {
    let mut rng = Random::new(0x0062_616c_6c31);
    let (mut cells, mut solved) = (0, 0);
    let count = scenes_of_a_kind() as u64;
    for i in 0..count {
        let (hole, radius) = (rng.within(0.3, 0.7), rng.within(0.8, 1.5));
        let plate = Recipe::cuboid(1.0, 1.0, 0.5).minus(Recipe::cylinder(hole, 1.0));
        let (angle, beside) = (rng.within(0.0, TAU), decades(&mut rng, -8.0, -4.0));
        let way = dvec3(angle.cos(), angle.sin(), 0.0);
        // The centre's height over the rim at the touch.
        let touch = (radius * radius - (hole - beside) * (hole - beside)).sqrt();
        let (above, fall) = (1e-5 * rng.within(0.1, 0.9), 1e-5);
        let start = Pose::at(way * beside + DVec3::Z * (0.5 + touch + above));
        let motion = Motion { start, velocity: DVec3::NEG_Z * fall, spin: rng.vector(0.1) };
        let scene = Scene {
            class: "rims",
            a: plate,
            b: Recipe::sphere(radius),
            motion_a: still(),
            motion_b: motion,
            resolution: None,
        };
        let alone = Strategies { cavities: false, ..Strategies::default() };
        for (name, strategies) in [("in front", Strategies::default()), ("search", alone)] {
            let o = decided_with(&format!("rim {i}, {name}"), &scene, 400, strategies);
            assert!((o.time() * fall - above).abs() < 1e-12 && o.time_lower() <= o.time(), "{i}, {name}: {o:?}");
            let p = o.point().expect("a point").point;
            let expected = way * hole + DVec3::Z * 0.5;
            let off = (p - expected).length();
            assert!(off < 1e-12 / beside + 1e-9, "{i}, {name}, {beside:e} beside: {p} and not {expected}");
            cells += o.counters.cells;
            solved += o.counters.newton;
        }
    }
    println!("{cells} cells, {solved} solutions tried");
    assert!(3 * cells < 20 * count, "{cells} cells");
}

#[test]
fn bodies_in_pockets_of_their_own_size_that_turn() {
    let block = || Recipe::cuboid(1.5, 1.5, 0.5);
    let common = dvec3(0.4, -2.9, -1.1);
    let pose = Pose::new(dvec3(-7.0, 5.0, 3.0), DQuat::from_rotation_y(0.7));
    let frustum = Recipe::cone(0.3, 0.7, 0.5).at(0.0, 0.0, 0.1);
    let a = Motion::turning(pose, pose.position, common);
    let b = Motion::turning(pose, pose.position, common + dvec3(0.3, 0.0, -1.2));
    let o = decided("frustum", &Scene::new("frustum", block().minus(frustum.clone()), a, frustum, b), 40_000);
    assert_eq!(o.status(), Status::Contact, "{o:?}");
    let (ball, socket) = (Recipe::sphere(0.5).at(0.0, 0.0, 0.5), Recipe::sphere(0.5 - 2.2e-9).at(0.0, 0.0, 0.5));
    let b = Motion::turning(pose, pose.position + dvec3(0.01, -0.02, -0.015), common);
    let o = decided("ball", &Scene::new("ball", block().minus(socket), a, ball, b), 80_000);
    assert_eq!(o.status(), Status::Contact, "{o:?}");
}

/// A cone in a pocket that is deeper but no wider sticks in its upper half, by a thousand resolutions. A witness at the very start
/// whose multipliers do not settle once ended the search as a contact at 0.
#[test]
fn like_cones_that_overlap_at_the_start() {
    let (body, pocket) = (Recipe::cone(0.0, 0.8, 0.6737087989791588), Recipe::cone(0.0, 0.8, 0.6737926032673738));
    let at = Pose::at(dvec3(-6.961295198915849, 8.302142455350754, 4.032823985193229));
    let end = at.position + dvec3(0.21096826460692153, -0.995196010081866, -0.03226332731746773);
    let spin = dvec3(-0.18001398034328364, 0.4466088531743173, 17.38351166026269);
    let (a, b) = (Motion::turning(at, end, spin), Motion::turning(at, end, DVec3 { z: 2.041897399739378, ..spin }));
    let mut scene = Scene::new("cones", body, a, Recipe::cuboid(1.5, 1.5, 0.5).minus(pocket), b);
    scene.resolution = Some(5.9385943291392684e-9);
    assert_eq!(decided("cones", &scene, 1_000).status(), Status::Overlap);
}

/// A peg that spins in a hole with a gap below the resolution, and slides by a little. A climb that leaves the layer between the
/// like faces is led back to its middle: else twice as many cells do not find the witness.
#[test]
fn a_peg_with_hardly_any_gap_meets_its_hole_as_it_spins() {
    let scene = pocket(&mut Random::new(165));
    assert_eq!(decided("peg", &scene, 5_000).status(), Status::Contact);
}

/// A prism spins while it slides into a round hole with a clearance of 1e-4 to 1e-7 of its size: the hole's wall is the same from
/// all sides, a plane that touches it is not.
#[test]
fn a_prism_spins_into_a_round_hole() {
    let (wide, sink) = (0.21, Recipe::cone(0.21, 0.36, 0.075).at(0.0, 0.0, 0.2));
    let plate = || Recipe::cuboid(1.0, 1.0, 0.25).minus(Recipe::cylinder(wide, 1.0)).minus(sink.clone());
    for (sides, clearance) in [(8, 1.3e-5), (11, 1e-5), (3, 1e-6), (6, 1e-7)] {
        let start = Pose::at(dvec3(0.3 * clearance, -0.2 * clearance, 1.0));
        let motion = Motion::turning(start, start.position - DVec3::Z, dvec3(0.0, 0.0, 19.0));
        let body = prism(sides, wide - clearance, 0.5);
        let o = decided("prism", &Scene::new("prism", plate(), still(), body, motion), 20_000);
        assert_eq!(o.status(), Status::Clear, "{sides} {clearance}: {o:?}");
    }
}

/// A round peg slides and turns in a hole with 3 to 8 flat walls that its side touches, or nearly, about an axis that leans by less than
/// its clearance and some resolutions: seen from the hole it all but stands, however fast it turns.
fn turning_peg(rng: &mut Random, turns: f64) -> Option<(Scene, String)> {
    let (sides, radius) = (3 + rng.below(6), rng.within(0.2, 1.5));
    let clearance = if rng.chance(0.3) { 0.0 } else { radius * decades(rng, -12.0, -7.0) };
    let wide = (radius + clearance) / (PI / sides as f64).cos();
    let hole = Recipe::cuboid(2.0 * radius, 2.0 * radius, 2.0 * radius).minus(prism(sides, wide, 4.0 * radius));
    let a = if wide < 1.9 * radius { hole } else { return None };
    let half = radius * rng.within(0.3, 1.0);
    // No point of the peg strays farther than the clearance and a third of the resolution, 1e-9 of the block's radius.
    let stray = clearance + radius * 0.3e-9;
    let lean = DVec3::Z.cross(rng.direction()) * stray / (4.0 * (radius + half));
    let start = Pose::new(dvec3(0.0, 0.0, rng.within(-0.2, 0.2) * radius), DQuat::from_scaled_axis(lean));
    let axis = DQuat::from_scaled_axis(-lean * rng.within(-1.0, 1.0)) * DVec3::Z;
    let motion = Motion {
        start,
        velocity: DVec3::Z * rng.within(-0.3, 0.3) * radius,
        spin: axis * rng.within(0.2, 1.0) * turns * if rng.chance(0.5) { 1.0 } else { -1.0 },
    };
    let scene = Scene::new("turning peg", a, still(), Recipe::cylinder(radius, half), motion);
    let scene = if rng.chance(0.5) { scene.swapped() } else { scene };
    Some((scene, format!("{sides} walls, clearance {clearance:e}")))
}

#[test]
fn a_round_peg_turns_in_a_hole_with_flat_walls() {
    let rng = &mut Random::new(4_711);
    for k in 0..scenes_of_a_kind() {
        let Some((scene, what)) = turning_peg(rng, 1.0) else { continue };
        // By the search alone.
        let o = decided_with(&format!("peg {k}"), &scene, 400, Strategies { cavities: false, ..Strategies::default() });
        assert_eq!(o.status(), Status::Clear, "{k}: {what}");
    }
}

/// The same, up to five times in a step: a disc that spins about its own axis stays where it is, so the proof of a pair with a hole
/// ends with what it began with.
#[test]
fn a_round_peg_turns_many_times_in_a_hole_with_flat_walls() {
    let rng = &mut Random::new(4_712);
    for k in 0..scenes_of_a_kind() {
        let Some((scene, what)) = turning_peg(rng, 5.0 * TAU) else { continue };
        let o = decided(&format!("peg {k}"), &scene, 0);
        assert_eq!(o.status(), Status::Clear, "{k}: {what}");
    }
}

/// A round peg that leans by more than its clearance comes to touch as it turns: its axis goes round, up to four times in a step.
#[test]
fn a_leaning_peg_that_turns_many_times_comes_to_the_walls_of_its_hole() {
    let rng = &mut Random::new(5);
    let (mut met, mut clear, mut searched) = (0, 0, 0);
    let count = sized("CONTACTD_TIGHT_SCENES", 24).min(60);
    for k in 0..count {
        let (sides, radius) = (3 + rng.below(6), rng.within(0.2, 1.5));
        let clearance = radius * decades(rng, -6.0, -3.0);
        let wide = (radius + clearance) / (PI / sides as f64).cos();
        let hole = Recipe::cuboid(2.0 * radius, 2.0 * radius, 2.0 * radius).minus(prism(sides, wide, 4.0 * radius));
        if wide >= 1.9 * radius {
            continue;
        }
        let half = radius * rng.within(0.3, 1.0);
        let lean = DVec3::Z.cross(rng.direction()) * clearance / half * rng.within(0.1, 0.9);
        let spin = DQuat::from_scaled_axis(lean * rng.within(-1.0, 1.0)) * DVec3::Z * rng.within(1.0, 4.0) * TAU;
        let start = Pose::new(DVec3::ZERO, DQuat::from_scaled_axis(lean));
        let velocity = rng.direction() * clearance * rng.within(0.0, 0.5);
        let scene =
            Scene::new("leaning peg", hole, still(), Recipe::cylinder(radius, half), Motion { start, velocity, spin });
        let o = decided(&format!("leaning peg {k}"), &scene, CEILING);
        met += usize::from(o.status() == Status::Contact);
        clear += usize::from(o.status() == Status::Clear);
        searched += usize::from(o.counters.cells > 0);
    }
    println!("{met} met, {clear} clear, {searched} of them searched");
    assert!(8 * met >= count && 6 * clear >= count && 4 * searched <= met + clear, "of {count}");
}

#[test]
fn tight_and_tiny_scenes_are_decided() {
    let (scenes, seed) = (sized("CONTACTD_TIGHT_SCENES", 4_u64), sized("CONTACTD_TIGHT_SEED", 1_u64));
    let kinds: [(&str, fn(&mut Random) -> Scene); 4] =
        [("small", small), ("rim", rim), ("pocket", pocket), ("screw", screw)];
    let mut bad = Vec::new();
    for (k, (name, kind)) in kinds.iter().enumerate() {
        let (mut status, mut dearest, mut raised, mut cells) = ([0; 4], 0, 0, Vec::new());
        for i in 0..scenes {
            // Each scene has a seed of its own, which can be asked for alone.
            let own = (seed * 4 + k as u64) * 1_000_003 + i;
            if let Ok(only) = std::env::var("CONTACTD_TIGHT_ONLY")
                && only != own.to_string()
            {
                continue;
            }
            let scene = kind(&mut Random::new(own));
            let models = [&Model::new(scene.a.build()), &Model::new(scene.b.build())];
            let o = ask(&scene, models);
            let pair = Pair { models, motions: [scene.motion_a, scene.motion_b] };
            status[match o.status() {
                Status::Contact => 0,
                Status::Clear => 1,
                Status::Overlap => 2,
                Status::Undecided => 3,
            }] += 1;
            let own_resolution = scene.resolution.unwrap_or_else(|| default_resolution(models[0], models[1]));
            raised += u64::from(o.resolution > 1.5 * own_resolution);
            dearest = dearest.max(o.counters.cells);
            cells.push(o.counters.cells);
            let wrong = judge(&mut Random::new(own), &scene, &o, &pair)
                .or_else(|| (o.counters.cells > CEILING).then(|| format!("{} cells", o.counters.cells)));
            if let Some(wrong) = wrong {
                bad.push(format!("{name} {own}: {wrong}"));
                eprintln!(
                    "{name} {own}: {wrong}; {:?} {} {} {} delta {:e} cells {}",
                    o.status(),
                    o.time_lower(),
                    o.time(),
                    o.time_upper(),
                    o.resolution,
                    o.counters.cells
                );
                if std::env::var_os("CONTACTD_TIGHT_SHOW").is_some() {
                    eprintln!("{scene:#?}");
                }
            }
        }
        cells.sort_unstable();
        let [contact, clear, overlap, undecided] = status;
        println!(
            "{name}: {contact} contact, {clear} clear, {overlap} overlap, {undecided} undecided; resolution raised {raised}; \
             cells p99 {}, most {dearest}",
            cells.get(cells.len() * 99 / 100).unwrap_or(&0)
        );
    }
    assert!(bad.is_empty(), "{} wrong: {bad:#?}", bad.len());
}
