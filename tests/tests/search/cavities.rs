//! What is told of bodies in holes in front of the search, and the search without it: the same answers on random placements of pegs,
//! balls and boxes in cavities.

use contactd::contact::{
    Outcome, PairQuery, PlacedModel, QueryOptions, Scratch, Status, Strategies, default_resolution, earliest_contact,
};
use contactd::math::random::Random;
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::primitive::{Cone, Cuboid, Cylinder, Sphere};
use contactd::solid::{Label, Op, Shape, SolidBuilder};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use contactd_tests::models::{pierced, simple};
use contactd_tests::sweep::sized;
use glam::{DVec3, dvec3};

/// A vector of length `size` across the cavity.
fn across(n: &mut Random, size: f64) -> DVec3 {
    let angle = n.within(0.0, std::f64::consts::TAU);
    dvec3(angle.cos(), angle.sin(), 0.0) * size
}

pub(super) fn ask(a: (&Model, Motion), b: (&Model, Motion), strategies: Strategies) -> Outcome {
    let placed = |motion| Placed { place: Pose::IDENTITY, motion };
    let query = PairQuery {
        a: PlacedModel { model: a.0, placed: placed(a.1) },
        b: PlacedModel { model: b.0, placed: placed(b.1) },
        resolution: default_resolution(a.0, b.0),
        cell_limit: 100_000,
        strategies,
        query_options: QueryOptions::DEPTH,
    };
    earliest_contact(&query, &mut Scratch::default())
}

/// What became of some scenes.
#[derive(Debug, Default)]
pub(super) struct Sum {
    scenes: usize,
    pub(super) reported: usize,
    pub(super) met: usize,
    looks: u64,
    newton: u64,
}

/// Asks both ways; in which scenes the shortcut answered.
pub(super) fn compare(
    name: &str,
    count: u64,
    mut draw: impl FnMut(&mut Random) -> (Motion, Motion),
    a: &Model,
    b: &Model,
) -> Sum {
    let mut sum = Sum::default();
    let mut r = Random(0x0048_6f6c_6500 + name.len() as u64);
    for i in 0..count {
        let (ma, mb) = draw(&mut r);
        // Either body first, and either as the reference body of the cells.
        let (x, y) = if i % 2 == 0 { ((a, ma), (b, mb)) } else { ((b, mb), (a, ma)) };
        let fronted = ask(x, y, Strategies::default());
        sum.scenes += 1;
        if fronted.counters.cells > 0 || fronted.counters.closed_forms == 0 {
            continue;
        }
        sum.reported += 1;
        sum.looks += fronted.counters.closed_forms;
        sum.newton += fronted.counters.newton;
        let alone = ask(x, y, Strategies { convex: false, cavities: false, balls: false, ..Strategies::default() });
        if alone.status() == Status::Undecided {
            continue;
        }
        assert_eq!(fronted.status(), alone.status(), "{name} {i}: {fronted:?} {alone:?}");
        assert!(
            fronted.time_lower() <= fronted.time() && fronted.time() <= fronted.time_upper(),
            "{name} {i}: {fronted:?}"
        );
        if fronted.status() != Status::Contact {
            continue;
        }
        sum.met += 1;
        let speed = fronted.point().unwrap().normal_speed.abs().max(alone.point().unwrap().normal_speed.abs());
        // Two contacts at about one time may be told either way.
        let off = (fronted.time() - alone.time()).abs() * speed;
        assert!(off < 2e-9, "{name} {i}: {off:e}: {fronted:?} {alone:?}");
        assert!(fronted.time_lower() <= alone.time_upper() && alone.time_lower() <= fronted.time_upper(), "{name} {i}");
        if (fronted.point().unwrap().point - alone.point().unwrap().point).length() < 1e-6 {
            assert!(
                (fronted.point().unwrap().normal - alone.point().unwrap().normal).length() < 1e-5,
                "{name} {i}: {fronted:?} {alone:?}"
            );
            assert_eq!(
                fronted.point().map(|p| (p.kind, p.extent)),
                alone.point().map(|p| (p.kind, p.extent)),
                "{name} {i}: {fronted:?} {alone:?}"
            );
        }
    }
    println!("{name}: {sum:?}");
    sum
}

pub(super) fn rest() -> Motion {
    Motion::resting(Pose::IDENTITY)
}

pub(super) fn moving(at: DVec3, tilt: DVec3, by: DVec3, spin: DVec3) -> Motion {
    Motion::turning(Pose::new(at, quat_of_rotation_vector(tilt)), at + by, spin)
}

fn plate() -> Model {
    pierced(
        Cuboid { half: dvec3(0.5, 0.5, 0.1) },
        vec![(Cylinder { radius: 0.25, half_height: 0.5 }.into(), Pose::IDENTITY)],
    )
}

fn peg() -> Model {
    simple(Cylinder { radius: 0.24, half_height: 0.5 })
}

#[test]
fn pegs_that_fall_are_reported() {
    let (plate, peg) = (plate(), peg());
    let tilted = |turns: f64| {
        move |r: &mut Random| {
            let (at, tilt) = (across(r, 0.005) + DVec3::Z, r.within(0.03, 0.12));
            let tilt = across(r, tilt);
            let by = DVec3::Z * -r.within(0.8, 1.0);
            (rest(), moving(at, tilt, by, r.vector(turns)))
        }
    };
    let straight = compare("tilted", 40, tilted(0.0), &plate, &peg);
    assert!(straight.reported >= 38 && straight.met >= 38, "{straight:?}");
    let turning = compare("tilted, turning", 40, tilted(0.1), &plate, &peg);
    assert!(turning.reported >= 36, "{turning:?}");
    let rim = compare(
        "on the rim",
        40,
        |r| {
            let at = r.within(0.02, 0.3);
            (rest(), moving(across(r, at) + DVec3::Z, DVec3::ZERO, DVec3::Z * -0.9, DVec3::ZERO))
        },
        &plate,
        &peg,
    );
    assert!(rim.reported >= 38, "{rim:?}");
}

#[test]
fn a_peg_that_grazes_its_hole_is_reported() {
    // Tilted by .031, off by .005 towards the tilt: it just fits through. The search took 62,174 cells for it.
    let (plate, peg) = (plate(), peg());
    let at = dvec3(-0.002715196629327541, -0.004198536324016783, 1.0);
    let tilt = dvec3(0.026286416733871252, -0.016413599220984947, 0.0);
    let o = ask((&plate, rest()), (&peg, moving(at, tilt, DVec3::Z * -0.9, DVec3::ZERO)), Strategies::default());
    println!("{o:?}");
    assert!(o.counters.cells == 0 && o.counters.closed_forms > 0, "{o:?}");
    assert!(matches!(o.status(), Status::Contact | Status::Clear), "{o:?}");
}

#[test]
fn pegs_that_press_sideways_are_reported() {
    let (plate, peg) = (plate(), peg());
    for turns in [0.0, 0.05] {
        let sum = compare(
            "sideways",
            40,
            |r| {
                let (at, way) = (across(r, 0.003), r.within(0.02, 0.1));
                (rest(), moving(at, DVec3::ZERO, across(r, way), r.vector(turns)))
            },
            &plate,
            &peg,
        );
        assert!(sum.reported >= 38, "{turns}: {sum:?}");
    }
}

#[test]
fn balls_in_pipes_are_reported() {
    let pipe = pierced(
        Cylinder { radius: 0.35, half_height: 1.0 },
        vec![(Cylinder { radius: 0.25, half_height: 1.5 }.into(), Pose::IDENTITY)],
    );
    let ball = simple(Sphere { radius: 0.2 });
    let sum = compare(
        "ball in pipe",
        60,
        |r| {
            let (at, by) = (r.within(0.0, 0.03), r.within(0.0, 0.2));
            let at = across(r, at) + DVec3::Z * r.within(-0.4, 1.4);
            let spin = r.vector(1.0);
            (
                moving(r.vector(0.01), DVec3::ZERO, r.vector(0.05), DVec3::Z * r.within(0.0, 2.0)),
                moving(at, DVec3::ZERO, across(r, by) + DVec3::Z * r.within(-0.5, 0.3), spin),
            )
        },
        &pipe,
        &ball,
    );
    assert!(sum.reported >= 40, "{sum:?}");
}

#[test]
fn other_bodies_and_holes_are_reported() {
    // A blind round cavity from above, and a square one through.
    let blind = pierced(
        Cuboid { half: dvec3(0.6, 0.6, 0.3) },
        vec![(Cylinder { radius: 0.25, half_height: 0.3 }.into(), Pose::at(DVec3::Z * 0.2))],
    );
    let square = pierced(
        Cuboid { half: dvec3(0.6, 0.6, 0.3) },
        vec![(Cuboid { half: dvec3(0.25, 0.25, 0.5) }.into(), Pose::IDENTITY)],
    );
    let bodies = [
        simple(Cylinder { radius: 0.22, half_height: 0.4 }),
        simple(Sphere { radius: 0.22 }),
        simple(Cone { bottom: 0.1, top: 0.24, half_height: 0.4 }),
        simple(Cuboid { half: dvec3(0.15, 0.14, 0.4) }),
    ];
    let mut reported = 0;
    for (i, cavity) in [&blind, &square].into_iter().enumerate() {
        for (j, body) in bodies.iter().enumerate() {
            let sum = compare(
                &format!("body {j} in cavity {i}"),
                24,
                |r| {
                    let (at, tilt, turn) = (r.within(0.0, 0.02), r.within(0.0, 0.1), r.within(0.0, 0.3));
                    let at = across(r, at) + DVec3::Z * r.within(0.75, 0.9);
                    let by = across(r, 0.02) - DVec3::Z * r.within(0.3, 1.0);
                    let turn = if turn < 0.1 { DVec3::ZERO } else { r.vector(turn) };
                    (
                        moving(r.vector(0.02), r.vector(0.02), DVec3::ZERO, turn),
                        moving(at, across(r, tilt), by, DVec3::ZERO),
                    )
                },
                cavity,
                body,
            );
            reported += sum.reported;
        }
    }
    println!("reported: {reported} of 192");
    assert!(reported >= 96, "{reported}");
}

#[test]
fn combs_of_pegs_are_reported() {
    // 36 pegs on a bar over 36 cavities, from nearly straight, where many pegs come close together, to clearly tilted.
    let grid = || (0..36).map(|i| dvec3(f64::from(i % 6) - 2.5, f64::from(i / 6) - 2.5, 0.0));
    let cavities = grid().map(|at| (Cylinder { radius: 0.25, half_height: 0.5 }.into(), Pose::at(at)));
    let plate = pierced(Cuboid { half: dvec3(3.25, 3.25, 0.2) }, cavities.collect());
    let mut b = SolidBuilder::new();
    let mut all =
        vec![b.primitive(Cuboid { half: dvec3(3.25, 3.25, 0.2) }, Pose::at(DVec3::Z * 0.6), Label::default())];
    all.extend(
        grid().map(|at| b.primitive(Cylinder { radius: 0.24, half_height: 0.5 }, Pose::at(at), Label::default())),
    );
    let n = b.operation(Op::Union, &all);
    let comb = Model::new(b.finish(n));
    let mut r = Random(36);
    let (mut reported, count) = (0, 40);
    for i in 0..count {
        let (off, angle) = (r.within(0.0, 0.008), 10f64.powf(r.within(-3.0, -1.0)));
        let (at, tilt) = (across(&mut r, off), r.vector(1.0).normalize() * angle);
        let motion = moving(at + DVec3::Z * (1.0 + 3.5 * angle), tilt, DVec3::Z * -0.7, DVec3::ZERO);
        let o = ask((&plate, rest()), (&comb, motion), Strategies::default());
        assert_ne!(o.status(), Status::Undecided, "{i}: {o:?}");
        reported += u32::from(o.counters.cells == 0);
        if i % 8 == 0 {
            let alone = ask(
                (&plate, rest()),
                (&comb, motion),
                Strategies { convex: false, cavities: false, balls: false, ..Strategies::default() },
            );
            assert_eq!(o.status(), alone.status(), "{i}: {o:?} {alone:?}");
            assert!((o.time() - alone.time()).abs() < 1e-8, "{i}: {o:?} {alone:?}");
        }
    }
    println!("comb: {reported} of {count}");
    assert!(reported * 5 >= count * 4, "{reported} of {count}");
}

/// A block with pegs on it and, beside them, a groove with a ridge in it, which is no union of parts: but where a lid is that lowers
/// its holes over the pegs nothing of the groove is.
fn block_and_lid(r: &mut Random) -> [Model; 2] {
    let leaf = |b: &mut SolidBuilder, shape: Shape, at: DVec3| b.primitive(shape, Pose::at(at), Label::default());
    let cylinder = |radius: f64, half_height: f64| Cylinder { radius, half_height }.into();
    let cuboid = |x: f64, y: f64, z: f64| Cuboid { half: dvec3(x, y, z) }.into();
    let places: Vec<DVec3> =
        (0..1 + r.within(0.0, 4.0) as usize).map(|i| dvec3(i as f64 - 1.5, r.within(-0.4, 0.4), 0.0)).collect();
    let (capped, counterbored) = (r.within(0.0, 1.0) < 0.5, r.within(0.0, 1.0) < 0.5);
    let mut b = SolidBuilder::new();
    let mut body = vec![leaf(&mut b, cuboid(2.5, 1.0, 0.4), DVec3::Z * -0.4)];
    for at in &places {
        body.push(leaf(&mut b, cylinder(0.24, 0.5), *at + DVec3::Z * 0.4));
        if capped {
            // An edge of its own that is none of the peg's.
            body.push(leaf(&mut b, cylinder(0.24, 0.1), *at + DVec3::Z));
        }
    }
    let groove = [(0.2, 0.9, 0.1), (0.1, 0.8, 0.2)];
    let groove = groove.map(|(x, y, z)| leaf(&mut b, cuboid(x, y, z), DVec3::X * 2.2));
    let body = b.operation(Op::Union, &body);
    let groove = b.operation(Op::Difference, &groove);
    let block = b.operation(Op::Difference, &[body, groove]);
    let block = Model::new(b.finish(block));

    let mut b = SolidBuilder::new();
    // Ribs on top: with them there are more pairs of parts than are looked at.
    let mut body = vec![leaf(&mut b, cuboid(2.5, 1.0, 0.2), DVec3::ZERO)];
    let rib = |i: i32| DVec3::new(f64::from(i) * 0.06 - 2.1, 0.0, 3.0);
    body.extend((0..70).map(|i| leaf(&mut b, cuboid(0.02, 0.9, 0.1), rib(i))));
    let mut lid = vec![b.operation(Op::Union, &body)];
    for at in &places {
        lid.push(leaf(&mut b, cylinder(0.25, 0.5), *at));
        if counterbored {
            lid.push(leaf(&mut b, cylinder(0.35, 0.3), *at + DVec3::Z * 0.4));
        }
    }
    let lid = b.operation(Op::Difference, &lid);
    [block, Model::new(b.finish(lid))]
}

/// Also the long form: `CONTACTD_CAVITY_SCENES=2000 cargo test --release -p contactd-tests --test search cavities:: -- --nocapture`.
#[test]
fn parts_within_the_region_are_reported() {
    let lids = sized("CONTACTD_CAVITY_SCENES", 24_u64);
    let (mut reported, mut met) = (0, 0);
    for seed in 0..lids {
        let mut own = Random(0x6c69_6400 + seed);
        let [block, lid] = block_and_lid(&mut own);
        let draw = |_: &mut Random| {
            let r = &mut own;
            let at = across(r, 0.004) + DVec3::Z * r.within(0.35, 1.6);
            let tilt = if r.within(0.0, 1.0) < 0.5 { DVec3::ZERO } else { r.vector(0.002) };
            let turn = if r.within(0.0, 1.0) < 0.5 { DVec3::ZERO } else { r.vector(0.02) };
            let by = across(r, 0.1) + DVec3::Z * r.within(-0.2, 0.1);
            (rest(), moving(at, tilt, by, turn))
        };
        let sum = compare(&format!("lid {seed}"), 4, draw, &block, &lid);
        (reported, met) = (reported + sum.reported as u64, met + sum.met as u64);
    }
    println!("reported: {reported} of {}, {met} with a contact", 4 * lids);
    assert!(reported >= 2 * lids && met >= lids, "{reported}, {met} of {}", 4 * lids);
}
