//! Pairs with a right answer in closed form, each through the whole search.

use contactd::contact::{
    ContactKind, Extent, Outcome, PairQuery, PlacedModel, QueryOptions, Scratch, Stage, Status, Strategies,
    default_resolution, earliest_contact,
};
use contactd::math::halt::{Halt, heeding};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::Shape;
use contactd::solid::primitive::{Cone, Cuboid, Cylinder, Sphere};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use contactd_tests::engine::SEARCH_ALONE;
use contactd_tests::models::{pierced, simple};
use glam::DVec3;
use std::sync::Arc;

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

fn rest() -> Motion {
    Motion::resting(Pose::IDENTITY)
}

fn slide(from: DVec3, way: DVec3) -> Motion {
    Motion { start: Pose::at(from), velocity: way, spin: DVec3::ZERO }
}

fn turn(pose: Pose, way: DVec3, spin: DVec3) -> Motion {
    Motion { start: pose, velocity: way, spin }
}

fn tilt(v: DVec3) -> glam::DQuat {
    quat_of_rotation_vector(v)
}

/// The answer of the search alone; a whole-primitive answer in front of it must say the same.
fn ask(name: &str, a: &Model, ma: Motion, b: &Model, mb: Motion) -> Outcome {
    let o = ask_with(name, a, ma, b, mb, SEARCH_ALONE);
    let fronted = ask_with(name, a, ma, b, mb, Strategies::default());
    assert_eq!(o.status(), fronted.status(), "{name}");
    if o.status() != Status::Overlap {
        assert_eq!(o.point().map(|p| (p.kind, p.extent)), fronted.point().map(|p| (p.kind, p.extent)), "{name}");
    }
    assert!((o.time() - fronted.time()).abs() < 1e-12, "{name}: {} and {}", o.time(), fronted.time());
    assert!(
        (o.penetration().map_or(0.0, |p| p.depth) - fronted.penetration().map_or(0.0, |p| p.depth)).abs() < 1e-12,
        "{name}: {} and {}",
        o.penetration().map_or(0.0, |p| p.depth),
        fronted.penetration().map_or(0.0, |p| p.depth)
    );
    assert!(fronted.time_lower() <= fronted.time() && fronted.time() <= fronted.time_upper(), "{name}");
    // Of an overlap any direction out of one body is a normal; the shortest is asked for.
    let of = |o: &Outcome| {
        let normal = o.point().copied().unwrap_or_default().normal;
        o.penetration().map_or(normal, |p| p.direction)
    };
    assert!((of(&o) - of(&fronted)).length() < 1e-6, "{name}: {} and {}", of(&o), of(&fronted));
    o
}

fn ask_with(name: &str, a: &Model, ma: Motion, b: &Model, mb: Motion, strategies: Strategies) -> Outcome {
    let place = Pose::IDENTITY;
    let q = PairQuery {
        a: PlacedModel { model: a, placed: Placed { place, motion: ma } },
        b: PlacedModel { model: b, placed: Placed { place, motion: mb } },
        resolution: default_resolution(a, b),
        cell_limit: 300_000,
        strategies,
        query_options: QueryOptions::DEPTH,
    };
    let began = std::time::Instant::now();
    let o = earliest_contact(&q, &mut Scratch::default());
    println!(
        "{name:36} {:?} {:.12} [{:.1e} {:.1e}] {:?} cells {} clauses {} newton {} {:?}",
        o.status(),
        o.time(),
        o.time() - o.time_lower(),
        o.time_upper() - o.time(),
        o.point(),
        o.counters.cells,
        o.counters.clauses,
        o.counters.newton,
        began.elapsed()
    );
    o
}

fn hits(name: &str, a: &Model, ma: Motion, b: &Model, mb: Motion, time: f64) -> Outcome {
    let o = ask(name, a, ma, b, mb);
    assert_eq!(o.status(), Status::Contact, "{name}");
    assert!((o.time() - time).abs() < 1e-9, "{name}: {} for {time}", o.time());
    assert!(o.time_lower() <= o.time() && o.time() <= o.time_upper(), "{name}");
    assert!(o.time() - o.time_lower() < 1e-8, "{name}");
    o
}

fn clear(name: &str, a: &Model, ma: Motion, b: &Model, mb: Motion) {
    assert_eq!(ask(name, a, ma, b, mb).status(), Status::Clear, "{name}");
}

fn plate(hole: f64) -> Model {
    pierced(
        Cuboid { half: v(0.5, 0.5, 0.1) },
        vec![(Cylinder { radius: hole, half_height: 0.3 }.into(), Pose::IDENTITY)],
    )
}

fn peg(r: f64) -> Model {
    simple(Cylinder { radius: r, half_height: 0.5 })
}

#[test]
fn spheres_and_boxes() {
    let ball = simple(Sphere { radius: 0.5 });
    let cube = simple(Cuboid { half: DVec3::splat(0.5) });
    hits("sphere on box face", &ball, slide(v(0.1, 0.2, 2.0), v(0., 0., -2.)), &cube, rest(), 0.5);
    hits("sphere on sphere", &ball, slide(v(-2.0, 0., 0.), v(2., 0., 0.)), &ball, rest(), 0.5);
    let o = hits("faces closing parallel", &cube, slide(v(0.1, 0.2, 2.0), v(0., 0., -2.)), &cube, rest(), 0.5);
    assert_eq!(o.point().map(|p| (p.kind, p.extent)), Some((ContactKind::FaceFace, Extent::Patch)));
    clear("box sliding on box", &cube, slide(v(0.1, 0.2, 1.0), v(0.5, 0.1, 0.)), &cube, rest());
    clear(
        "box spinning at rest on box",
        &cube,
        turn(Pose::at(v(0.1, 0.2, 1.0)), DVec3::ZERO, v(0., 0., 2.0)),
        &cube,
        rest(),
    );
    let lying = Pose::new(v(0., 0., 2.0), tilt(v(std::f64::consts::FRAC_PI_2, 0., 0.)));
    let o = hits(
        "cylinder lying down on a face",
        &peg(0.25),
        turn(lying, v(0., 0., -2.), DVec3::ZERO),
        &cube,
        rest(),
        0.625,
    );
    assert_eq!(o.point().unwrap().extent, Extent::Line);
    let o = hits(
        "edge on edge",
        &cube,
        turn(Pose::new(v(0., 0., 2.0), tilt(v(std::f64::consts::FRAC_PI_4, 0., 0.))), v(0., 0., -2.), DVec3::ZERO),
        &cube,
        turn(Pose::new(v(0., 0., 0.), tilt(v(0., std::f64::consts::FRAC_PI_4, 0.))), DVec3::ZERO, DVec3::ZERO),
        (2.0 - 2f64.sqrt()) / 2.0,
    );
    assert_eq!(o.point().unwrap().kind, ContactKind::EdgeEdge);
    let falling = turn(Pose::at(v(0., 0., 0.6)), DVec3::ZERO, v(std::f64::consts::FRAC_PI_2, 0., 0.));
    let floor = simple(Cuboid { half: v(5., 5., 1.) });
    let angle = (0.6 / 0.5f64.sqrt()).asin() - std::f64::consts::FRAC_PI_4;
    hits(
        "cube turning above a floor",
        &cube,
        falling,
        &floor,
        slide(v(0., 0., -1.), DVec3::ZERO),
        angle / std::f64::consts::FRAC_PI_2,
    );
}

/// A peg r .24 tilted by 3 degrees, the centre of its lower disc on the hole's axis: its side meets the upper rim (.25 from
/// the axis, .1 up) where the rim's distance from the peg's axis is .24.
fn tilted_peg() -> f64 {
    let (s, c) = 3f64.to_radians().sin_cos();
    let below = (0.25 * c - 0.24) / s;
    (1.0 - 0.5 * c) - (0.1 - below)
}

#[test]
fn pegs_and_holes() {
    let down = |x, z: f64, w: f64| slide(v(x, 0., z), v(0., 0., -w));
    clear("peg .24 straight through hole .25", &plate(0.25), rest(), &peg(0.24), down(0., 1.0, 1.0));
    clear("peg .25 into hole .25", &plate(0.25), rest(), &peg(0.25), down(0., 1.0, 1.0));
    clear(
        "peg .25 spinning in hole .25",
        &plate(0.25),
        rest(),
        &peg(0.25),
        turn(Pose::IDENTITY, DVec3::ZERO, v(0., 0., 3.)),
    );
    hits("peg moving sideways in its hole", &plate(0.25), rest(), &peg(0.24), slide(DVec3::ZERO, v(0.1, 0., 0.)), 0.1);
    hits("off-axis peg on the rim", &plate(0.25), rest(), &peg(0.24), down(0.05, 1.0, 1.0), 0.4);
    hits("peg .26 on hole .25", &plate(0.25), rest(), &peg(0.26), down(0., 1.0, 1.0), 0.4);
    let aside = -0.5 * 3f64.to_radians().sin();
    let tilted = turn(Pose::new(v(0., aside, 1.0), tilt(v(3f64.to_radians(), 0., 0.))), v(0., 0., -1.), DVec3::ZERO);
    hits("tilted peg into the hole", &plate(0.25), rest(), &peg(0.24), tilted, tilted_peg());
    // Nearer to one rim than to the other: both meet at one time otherwise, and either may be told.
    let tilting = turn(Pose::at(v(0., 0.001, 0.)), DVec3::ZERO, v(0.5, 0., 0.));
    ask("peg tilting in its hole", &plate(0.25), rest(), &peg(0.24), tilting);
}

#[test]
fn cones_and_sockets() {
    let cone = simple(Cone { bottom: 0.5, top: 0.0, half_height: 0.5 });
    let flipped = tilt(v(std::f64::consts::PI, 0., 0.));
    let cube = simple(Cuboid { half: DVec3::splat(0.5) });
    let ball = simple(Sphere { radius: 0.5 });
    let down = |q| turn(Pose::new(v(0.1, 0.05, 2.0), q), v(0., 0., -2.), DVec3::ZERO);
    hits("cone apex on face", &cone, down(flipped), &cube, rest(), 0.5);
    let t = tilt(v(0.3, 0.2, 0.)) * flipped;
    let reach = (t * v(0., 0., 0.5)).z;
    hits("tilted cone apex on face", &cone, down(t), &cube, rest(), (1.5 + reach) / 2.0);
    let apex_on_ball = turn(Pose::new(v(0., 0., 2.0), flipped), v(0., 0., -2.), DVec3::ZERO);
    hits("cone apex on sphere", &cone, apex_on_ball, &ball, rest(), 0.5);
    hits("cone apex on apex", &cone, apex_on_ball, &cone, rest(), 0.5);
    let needle = simple(Cone { bottom: 0.01, top: 0.0, half_height: 0.5 });
    hits("needle on face", &needle, down(flipped), &cube, rest(), 0.5);
    let socket = pierced(
        Cuboid { half: DVec3::splat(0.7) },
        vec![(Cone { bottom: 0.5, top: 0.0, half_height: 0.5 }.into(), Pose::new(v(0., 0., 0.2), flipped))],
    );
    hits(
        "cone into an equal cone hole",
        &socket,
        rest(),
        &cone,
        turn(Pose::new(v(0., 0., 1.2), flipped), v(0., 0., -2.), DVec3::ZERO),
        0.5,
    );
    let bowl =
        pierced(Cuboid { half: v(0.7, 0.7, 0.5) }, vec![(Sphere { radius: 0.5 }.into(), Pose::at(v(0., 0., 0.5)))]);
    let drop = slide(v(0., 0., 1.4), v(0., 0., -1.0));
    hits("ball .5 into socket .5", &bowl, rest(), &ball, drop, 0.9);
    hits("ball .499 into socket .5", &bowl, rest(), &simple(Sphere { radius: 0.499 }), drop, 0.901);
    let z = 0.5 + (0.501f64 * 0.501 - 0.25).sqrt();
    hits("ball .501 on the socket's rim", &bowl, rest(), &simple(Sphere { radius: 0.501 }), drop, 1.4 - z);
}

#[test]
fn overlaps_and_cavities() {
    let cube = simple(Cuboid { half: DVec3::splat(0.5) });
    let small = simple(Cuboid { half: DVec3::splat(0.1) });
    let o = ask("small inside large", &cube, rest(), &small, rest());
    assert_eq!(o.status(), Status::Overlap);
    let o = ask("large around small", &small, rest(), &cube, rest());
    assert_eq!(o.status(), Status::Overlap);
    let o = ask("pressed by a tenth", &cube, rest(), &cube, slide(v(0.0, 0.0, 0.9), v(0., 0., 1.)));
    assert_eq!(o.status(), Status::Overlap);
    assert!(
        (o.penetration().map_or(0.0, |p| p.depth) - 0.1).abs() < 1e-9
            && (o.penetration().unwrap().direction - DVec3::Z).length() < 1e-9,
        "{o:?}"
    );
    let shell = pierced(Sphere { radius: 1.1 }, vec![(Sphere { radius: 1.0 }.into(), Pose::IDENTITY)]);
    let ball = simple(Sphere { radius: 0.2 });
    let o = hits("ball meets the cavity's wall", &shell, rest(), &ball, slide(v(0.1, 0., 0.), v(1., 0., 0.)), 0.7);
    assert!((o.point().unwrap().normal + DVec3::X).length() < 1e-6, "{:?}", o.point().unwrap().normal);
    let rod = simple(Cylinder { radius: 0.01, half_height: 2.0 });
    let spin = turn(Pose::new(DVec3::ZERO, tilt(v(0., std::f64::consts::FRAC_PI_2, 0.))), DVec3::ZERO, v(0., 0., 50.0));
    let at = v(0.5f64.cos(), 0.5f64.sin(), 0.) * 1.5;
    let o = ask("spinning rod", &rod, spin, &simple(Sphere { radius: 0.05 }), slide(at, DVec3::ZERO));
    assert!((o.time() - 0.00919978651).abs() < 1e-10, "{}", o.time());
}

#[test]
fn a_clock_tells_the_stages_that_worked_and_changes_no_bit() {
    let hole = (Shape::from(Cylinder { radius: 0.2, half_height: 1.0 }), Pose::IDENTITY);
    let (plate, block) =
        (pierced(Cuboid { half: v(1.0, 1.0, 0.2) }, vec![hole]), simple(Cuboid { half: v(0.3, 0.2, 0.4) }));
    let down = turn(Pose::new(v(0.1, 0.05, 2.0), tilt(v(0.3, 0.2, 0.1))), v(0.0, 0.0, -2.5), v(0.2, 0.1, 0.3));
    let ask = |a: &Model, motion: Motion, strategies: Strategies, scratch: &mut Scratch| {
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        let query = PairQuery {
            a: PlacedModel { model: a, placed: placed(rest()) },
            b: PlacedModel { model: &block, placed: placed(motion) },
            resolution: default_resolution(a, &block),
            cell_limit: 300_000,
            strategies,
            query_options: QueryOptions::DEPTH,
        };
        earliest_contact(&query, scratch)
    };
    let search = SEARCH_ALONE;
    let mut timed = Scratch::timed();
    let own = ask(&plate, down, search, &mut Scratch::default());
    assert!(own.status() == Status::Contact && own.counters.cells > 0, "{own:?}");
    assert_eq!(ask(&plate, down, search, &mut timed), own);
    let clock = timed.take_clock().expect("a clock");
    assert!([Stage::Region, Stage::Walk, Stage::Cells].iter().all(|s| !clock.of(*s).is_zero()), "{clock:?}");
    assert_eq!(clock.last(), Stage::Cells);
    assert_eq!(clock.total(), Stage::ALL.iter().map(|s| clock.of(*s)).sum());
    // Convex bodies are told in front; what was told before is not in it.
    let ball = simple(Sphere { radius: 0.5 });
    let met = ask(&ball, down, Strategies::default(), &mut timed);
    let clock = timed.take_clock().expect("a clock");
    assert!(met.counters.cells == 0 && clock.last() == Stage::Front && !clock.total().is_zero(), "{met:?} {clock:?}");
    assert!(Scratch::default().take_clock().is_none());
}

/// A fork over a plate of 25 holes: cells of many clauses, each of many literals.
fn fork_and_plate() -> (Model, Model) {
    let hole = |i: i32| {
        let at = Pose::at(v(f64::from(i / 5 - 2) * 0.25, f64::from(i % 5 - 2) * 0.25, 0.0));
        (Shape::from(Cylinder { radius: 0.08, half_height: 0.3 }), at)
    };
    let plate = pierced(Cuboid { half: v(0.7, 0.7, 0.1) }, (0..25).map(hole).collect());
    let slot = |y: f64| (Shape::from(Cuboid { half: v(1.0, 0.12, 0.4) }), Pose::at(v(0., y, -0.3)));
    (pierced(Cuboid { half: v(0.1, 0.6, 0.5) }, vec![slot(-0.25), slot(0.25)]), plate)
}

/// A limit cuts the same bits again.
#[test]
fn a_limit_of_cells_cuts_the_same_bits() {
    let (fork, plate) = fork_and_plate();
    const LIMIT: u64 = 4;
    let mut cut = 0;
    for k in 0..60 {
        let r = |a: f64| (f64::from(k) * a).fract() * 2.0 - 1.0;
        let falling =
            turn(Pose::new(v(r(0.31), r(0.47), 0.9), tilt(v(0.2, 0.1, r(0.7)))), v(0.1, 0.2, -1.2), v(0.3, 0.0, 0.4));
        let place = Pose::IDENTITY;
        let query = PairQuery {
            a: PlacedModel { model: &fork, placed: Placed { place, motion: falling } },
            b: PlacedModel { model: &plate, placed: Placed { place, motion: rest() } },
            resolution: default_resolution(&fork, &plate),
            cell_limit: LIMIT,
            strategies: SEARCH_ALONE,
            query_options: QueryOptions::CONTACT,
        };
        let o = earliest_contact(&query, &mut Scratch::default());
        assert_eq!(o, earliest_contact(&query, &mut Scratch::default()));
        assert!(o.counters.cells <= LIMIT && (o.counters.cells == 0) == (o.counters.evaluations == 0), "{o:?}");
        if o.status() == Status::Undecided {
            assert!(o.counters.spent(LIMIT) >= LIMIT, "{o:?}");
            cut += 1;
        }
        // Ended from outside before the first cell: nothing is known but that.
        let halt = Arc::new(Halt::default());
        halt.set();
        let ended = heeding(Some(&halt), || earliest_contact(&query, &mut Scratch::default())).expect("its own end");
        assert!(ended.counters.cells == 0 && matches!(ended.status(), Status::Undecided | Status::Clear), "{ended:?}");
        assert!(ended.time_lower() <= o.time_upper());
    }
    assert!(cut > 3, "{cut} of 60 were cut");
}

/// A box on its corner falls on a block, the corner above a point of the block's edge.
#[test]
fn a_corner_that_falls_on_an_edge_meets_the_edge() {
    let (block, on_corner) = (v(1.0, 1.0, 0.5), DVec3::splat(0.3));
    let turned = tilt(v(0.5, 0.7, 0.0));
    let corners = (0..8).map(|k| on_corner * DVec3::from_array([0, 1, 2].map(|i| f64::from(k >> i & 1) * 2.0 - 1.0)));
    let lowest = corners.map(|c| turned * c).min_by(|p, q| p.z.total_cmp(&q.z)).expect("eight corners");
    let (block, cube) = (simple(Cuboid { half: block }), simple(Cuboid { half: on_corner }));
    let at = v(1.0, 0.3, 1.0) - lowest;
    let o = hits("corner on an edge", &block, rest(), &cube, turn(Pose::new(at, turned), -DVec3::Z, DVec3::ZERO), 0.5);
    assert_eq!(o.point().map(|p| p.kind), Some(ContactKind::VertexEdge), "{o:?}");
    assert!((o.time() - 0.5).abs() <= 1e-12, "{o:?}");
}
