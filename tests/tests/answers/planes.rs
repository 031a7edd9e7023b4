//! Half-spaces as bodies of their own, floors and walls, still or moving, against bodies of every kind.
//!
//! How high a body stands above a plane is its support along the plane's normal, which has a formula for every kind: so
//! every first contact is the first root of one function of time (`kinds`). Trees and meshes are told by the search,
//! the rest in front of it, without a cell. `CONTACTD_PAIRS=10000 cargo test --release -p contactd-tests --test answers
//! planes:: -- --nocapture` sets the number of pairs.

use super::kinds::{Scene, Told, alone, at_rest, compare, compare_told, pairs, past, placed, speed, turning};
use contactd::contact::region::{regions, threshold};
use contactd::contact::within::Within;
use contactd::contact::{ContactKind, Extent, Outcome, QueryOptions, Scratch, Status, earliest_contact, margin};
use contactd::octree::Model;
use contactd::solid::primitive::{Capsule, Cone, Cuboid, Cylinder, HalfSpace, Polyhedron, Shape, Sphere};
use contactd_proto::{Motion, Pose};
use contactd_tests::certified::certify_all;
use contactd_tests::engine::{ReportedPoint as _, question};
use contactd_tests::random_solids::{Random, capsule, elliptic, shape, shape_or_torus, solid_of, torus};
use contactd_tests::scenes::Recipe;
use glam::{DQuat, DVec2, DVec3, dvec3};

/// How far a superellipsoid reaches along a direction: the norm of the exponents 2/(2 − e) of its semi-axes' parts.
pub fn reach_of_superellipsoid(semi: DVec3, exponents: DVec2, m: DVec3) -> f64 {
    let [x, y, z] = (semi * m).abs().to_array();
    let [p, q] = [2.0 / (2.0 - exponents.x), 2.0 / (2.0 - exponents.y)];
    ((x.powf(q) + y.powf(q)).powf(p / q) + z.powf(p)).powf(1.0 / p)
}

/// How far a shape reaches along a direction of its frame.
fn reach(shape: &Shape, m: DVec3) -> f64 {
    let across = m.x.hypot(m.y);
    match shape {
        Shape::Sphere(s) => s.radius,
        Shape::Cuboid(c) => c.half.dot(m.abs()),
        Shape::Cylinder(c) => c.radius * across + c.half_height * m.z.abs(),
        Shape::Cone(c) => (c.top * across + c.half_height * m.z).max(c.bottom * across - c.half_height * m.z),
        Shape::Capsule(c) => c.half * m.z.abs() + c.radius,
        Shape::Torus(t) => t.major * across + t.minor,
        Shape::Ellipsoid(e) => (e.semi * m).length(),
        Shape::Superellipsoid(s) => reach_of_superellipsoid(s.semi, s.exponents, m),
        Shape::EllipticFrustum(f) => {
            let rim = (f.semi.x * m.x).hypot(f.semi.y * m.y);
            let up = f.half_height * (m.z + f.lean.x * m.x + f.lean.y * m.y);
            (f.top * rim + up).max(f.bottom * rim - up)
        }
        Shape::Polyhedron(p) => p.vertices.iter().map(|v| v.dot(m)).fold(f64::NEG_INFINITY, f64::max),
        Shape::TriangleMesh(t) => t.vertices().iter().map(|v| v.dot(m)).fold(f64::NEG_INFINITY, f64::max),
        Shape::HalfSpace(_) => f64::INFINITY,
        Shape::Quadric(_) => unreachable!("none is drawn here: `quadrics` has its own heights above planes"),
    }
}

/// A body that comes down on a plane through about the origin; both turn where `tilts` says so.
fn falling(r: &mut Random, shapes: Vec<(Shape, Pose)>, tilts: bool) -> Scene {
    let floor = if tilts { turning(r) } else { Motion::resting(Pose::new(r.vector(0.2), r.rotation())) };
    let motions = [past(r, 2.5), floor];
    let body = |(shape, frame): &(Shape, Pose)| Recipe::Leaf(shape.clone(), *frame);
    let a = shapes[1..].iter().fold(body(&shapes[0]), |all, more| all.union(body(more)));
    let gap = Box::new(move |a: &Pose, b: &Pose| {
        let n = b.rotation * DVec3::Z;
        let own = a.rotation.conjugate() * -n;
        let height =
            |(shape, frame): &(Shape, Pose)| -own.dot(frame.position) - reach(shape, frame.rotation.conjugate() * own);
        n.dot(a.position - b.position) + shapes.iter().map(height).fold(f64::INFINITY, f64::min)
    });
    // The body may be mirrored in the plane, and its velocity.
    let speed = speed(&motions, 5.0) + 2.0 * motions[1].velocity.length();
    Scene { a, b: Recipe::of(HalfSpace), motions, gap, speed }.above_plane()
}

/// Draws a shape of one kind.
type Draw = fn(&mut Random) -> Shape;

/// The kinds that are told in front of the search.
const KINDS: [(&str, Draw); 9] = [
    ("ball", |r| Sphere { radius: r.within(0.1, 0.9) }.into()),
    ("box", |r| Cuboid { half: dvec3(r.within(0.1, 0.8), r.within(0.1, 0.8), r.within(0.1, 0.8)) }.into()),
    ("cylinder", |r| Cylinder { radius: r.within(0.1, 0.8), half_height: r.within(0.1, 0.8) }.into()),
    ("cone", |r| Cone { bottom: r.within(0.1, 0.8), top: 0.0, half_height: r.within(0.1, 0.8) }.into()),
    ("frustum", |r| {
        Cone { bottom: r.within(0.1, 0.4), top: r.within(0.5, 0.8), half_height: r.within(0.1, 0.8) }.into()
    }),
    ("capsule", |r| capsule(r, 0.9).into()),
    ("torus", |r| torus(r, 0.9).into()),
    ("polyhedron", |r| {
        let corners = 4 + r.below(9);
        let drawn = (0..corners).map(|_| r.vector(0.8)).collect();
        Polyhedron::hull(drawn).map_or_else(|| Sphere { radius: 0.5 }.into(), Shape::from)
    }),
    ("platonic", |r| {
        let faces = [4, 6, 8, 12, 20][r.below(5)];
        Polyhedron::platonic(faces, r.within(0.3, 0.9)).expect("a platonic solid").into()
    }),
];

#[test]
fn bodies_meet_planes_when_their_supports_say_so_without_a_cell() {
    let count = pairs(45);
    for (tilts, word) in [(false, "floor"), (true, "turning plane")] {
        for (seed, (name, draw)) in (0..).zip(KINDS) {
            let scene = |r: &mut Random| {
                let shape = draw(r);
                falling(r, vec![(shape, Pose::IDENTITY)], tilts)
            };
            let (worst, cells) = compare(&format!("{name}, {word}"), (count, seed, 4.0), scene);
            // Corners of a random hull lie off its planes by up to a billionth: such a one is searched now and then.
            let most = if name == "polyhedron" { 5 * count as u64 } else { 0 };
            assert!(worst < 5e-14 && cells <= most, "{name}, {word}: {worst:e}, {cells} cells");
        }
    }
}

#[test]
fn whether_a_body_is_within_a_distance_of_a_plane_is_told_by_its_lowest_points_alone() {
    for (seed, (name, draw)) in (0..).zip(KINDS) {
        let mut r = Random::new(300 + seed);
        for i in 0..pairs(40) {
            let shape = draw(&mut r);
            let s = falling(&mut r, vec![(shape, Pose::IDENTITY)], true);
            let distance = 10f64.powf(r.within(-6.0, -3.0));
            // In each other, too, and lying flat where the frames' axes agree.
            let share = r.within(-2.0, 2.0);
            let [mut a, b] = s.motions;
            if r.chance(0.3) {
                a.start.rotation = b.start.rotation;
            }
            let s = Scene { motions: [a, b], ..s };
            a.start.position += b.start.rotation * DVec3::Z * (distance * share - s.at(0.0));
            let (body, plane) = (Model::new(s.a.build()), Model::new(s.b.build()));
            for swapped in [false, true] {
                let mut both = [(&body, placed(a)), (&plane, placed(b))];
                if swapped {
                    both.reverse();
                }
                let query = question(both[0], both[1], QueryOptions::CONTACT);
                let (within, cells) = margin::touching(&query, distance, &mut Scratch::default());
                let says = format!("{name} {i}, {share} of {distance:e}: {within:?} for {cells} cells");
                match within {
                    Within::Witness(_) => assert!(share < 1.0 + 1e-6, "{says}"),
                    _ => assert!(within == Within::Apart && share > 1.0 - 1e-6, "{says}"),
                }
                // The two points that are looked at count as a part of one.
                assert!(cells <= u64::from(share < 1.0 + 1e-6), "{says}");
            }
        }
    }
}

/// The same scene with its plane set so that the lowest of the heights before the body comes down for good is `least`; `None`
/// where the body does not come near, rise and come down again.
fn nearly_touching(s: Scene, least: f64) -> Option<Scene> {
    const STEPS: usize = 400;
    let at = |k: usize| k as f64 / STEPS as f64;
    let heights: Vec<f64> = (0..=STEPS).map(|k| s.at(at(k))).collect();
    let lows = (1..STEPS).filter(|k| heights[*k] < heights[k - 1] && heights[*k] <= heights[k + 1]);
    let k = lows.min_by(|k, l| heights[*k].total_cmp(&heights[*l]))?;
    let (mut from, mut to) = (at(k - 1), at(k + 1));
    for _ in 0..60 {
        let (p, q) = (to - 0.618 * (to - from), from + 0.618 * (to - from));
        if s.at(p) <= s.at(q) { to = q } else { from = p }
    }
    let lowest = s.at(0.5 * (from + to));
    // Apart before, as far as the step goes: the lowest of all that comes before the plane is met.
    if heights[..k].iter().any(|h| *h < lowest) || heights[0] < lowest + 0.02 {
        return None;
    }
    let [mut a, b] = s.motions;
    a.start.position += b.start.rotation * DVec3::Z * (least - lowest);
    Some(Scene { motions: [a, b], ..s })
}

#[test]
fn bodies_that_nearly_touch_a_plane_before_they_meet_it_are_told_without_a_cell() {
    // A ball comes near but once; corners of a random hull lie off its planes.
    let kinds = (0..).zip(KINDS).filter(|(_, (name, _))| !["ball", "polyhedron"].contains(name));
    for (seed, (name, draw)) in kinds {
        let scene = |r: &mut Random| loop {
            let shape = draw(r);
            let mut s = falling(r, vec![(shape, Pose::IDENTITY)], false);
            // Off-centre, as a body of a robot's link goes around: it comes near, goes and comes again.
            let spin = r.direction() * r.within(1.0, 5.0);
            s.motions[0] = Motion { velocity: s.motions[0].velocity * 0.3, spin, ..s.motions[0] };
            s.speed = speed(&s.motions, 5.0);
            let least = 10f64.powf(r.within(-7.0, -2.0));
            if let Some(s) = nearly_touching(s, least) {
                return s;
            }
        };
        let count = pairs(40);
        let (mut r, mut contacts, mut most) = (Random::new(100 + seed), 0, 0);
        for i in 0..count {
            let s = scene(&mut r);
            let (a, b) = (Model::new(s.a.build()), Model::new(s.b.build()));
            let query = question((&a, placed(s.motions[0])), (&b, placed(s.motions[1])), QueryOptions::DEPTH);
            if s.at(0.0) <= 4.0 * query.resolution {
                continue;
            }
            let o = earliest_contact(&query, &mut Scratch::default());
            let met = (0..=2000).any(|k| s.at(f64::from(k) / 2000.0) < 0.0);
            assert!(!met || o.status() == Status::Contact, "{name} {i}: {o:?}");
            if o.status() == Status::Contact {
                contacts += 1;
                let off = s.at(o.time()).abs();
                assert!(off < 5e-14 * (1.0 + s.speed), "{name} {i}: {off:e} off: {o:?}");
                let before = (0..2000).map(|k| s.at(o.time() * f64::from(k) / 2000.0)).fold(f64::INFINITY, f64::min);
                assert!(before > 0.0, "{name} {i}: met before: {before:e}: {o:?}");
            }
            most = most.max(o.counters.cells);
            assert!(o.counters.cells == 0, "{name} {i}: {o:?}");
        }
        println!("{name}: {contacts} of {count} meet a plane after they nearly touched it, at most {most} cells");
    }
}

#[test]
fn a_corner_next_to_the_normal_of_its_edge_is_told_without_a_cell() {
    let mut r = Random::new(0xc0_12e2);
    let cube = || Shape::from(Polyhedron::platonic(6, 3f64.sqrt()).expect("a platonic solid"));
    for i in 0..pairs(300) {
        // The third face of the corner takes part by this much.
        let part = 10f64.powf(r.within(-8.0, -4.0));
        let turn = r.within(0.3, 1.2);
        let down = dvec3(part, turn.sin(), turn.cos()).normalize();
        let rotation = DQuat::from_rotation_arc(down, DVec3::NEG_Z);
        let (body, floor) = (alone(cube()), alone(HalfSpace));
        let fall = dvec3(r.within(-0.5, 0.5), r.within(-0.5, 0.5), -r.within(3.0, 5.0));
        let motion = Motion { start: Pose::new(dvec3(0.0, 0.0, 3.0), rotation), velocity: fall, spin: DVec3::ZERO };
        let still = Motion::resting(Pose::IDENTITY);
        let query = question((&body, placed(motion)), (&floor, placed(still)), QueryOptions::DEPTH);
        let o = earliest_contact(&query, &mut Scratch::default());
        let exact = (3.0 - down.element_sum()) / -fall.z;
        assert!(o.status() == Status::Contact && o.counters.cells == 0, "{i}, {part:e}: {o:?}");
        assert!((o.time() - exact).abs() < 1e-14, "{i}: {exact}, {o:?}");
    }
}

#[test]
fn trees_meshes_and_elliptic_bodies_meet_planes_when_their_supports_say_so() {
    let count = pairs(90);
    for (tilts, word) in [(false, "floor"), (true, "turning plane")] {
        let one = |shape: Shape| vec![(shape, Pose::IDENTITY)];
        compare(&format!("elliptic, {word}"), (count, 1, 4.0), |r| {
            let shape = elliptic(r, 0.9);
            falling(r, one(shape), tilts)
        });
        compare_told(&format!("mesh, {word}"), (count.div_ceil(4), 2, 4.0), Told::Plane, |r| {
            let mesh = contactd_tests::meshes::solid(&contactd_tests::meshes::random(r, 0.8));
            falling(r, one(mesh.into()), tilts)
        });
        compare(&format!("union of two, {word}"), (count, 3, 4.0), |r| {
            let [p, q] = [0, 1].map(|_| (shape_or_torus(r, 0.7), Pose::new(r.vector(0.4), r.rotation())));
            falling(r, vec![p, q], tilts)
        });
    }
}

#[test]
fn certificates_of_planes_against_every_kind_and_of_trees_hold() {
    certify_all("planes", (pairs(120), 0x91_A7E5), |r| {
        let body = match r.below(6) {
            0 => alone(torus(r, 0.8)),
            1 => alone(elliptic(r, 0.8)),
            2 => alone(capsule(r, 0.8)),
            3 => Model::new(solid_of(r, 1, shape_or_torus)),
            _ => alone(shape(r, 0.8)),
        };
        let tilts = r.chance(0.4);
        let scene = falling(r, vec![(Sphere { radius: 1.0 }.into(), Pose::IDENTITY)], tilts);
        let [fall, floor] = scene.motions.map(placed);
        let sides = [(body, fall), (alone(HalfSpace), floor)];
        // The plane first, every other time.
        if r.chance(0.5) {
            sides
        } else {
            let [a, b] = sides;
            [b, a]
        }
    });
}

/// Asks about a body at rest or moving above the floor z <= 0.
fn above(body: &Model, motion: Motion) -> Outcome {
    let floor = alone(HalfSpace);
    let query =
        question((&floor, placed(Motion::resting(Pose::IDENTITY))), (body, placed(motion)), QueryOptions::DEPTH);
    earliest_contact(&query, &mut Scratch::default())
}

/// Bodies that stand on z = 0 as their origin is at this height.
fn standing() -> Vec<(&'static str, Recipe, f64, Extent)> {
    let corners = |k: usize| Polyhedron::platonic(k, 1.0).expect("a platonic solid");
    let on_its_side = DQuat::from_rotation_x(0.5 * std::f64::consts::PI);
    vec![
        ("ball", Recipe::sphere(0.5), 0.5, Extent::Point),
        ("box", Recipe::cuboid(0.3, 0.4, 0.25), 0.25, Extent::Patch),
        ("cylinder", Recipe::cylinder(0.3, 0.5), 0.5, Extent::Patch),
        (
            "cylinder on its side",
            Recipe::cylinder(0.25, 0.5).moved(&Pose::new(DVec3::ZERO, on_its_side)),
            0.25,
            Extent::Line,
        ),
        ("capsule", Recipe::of(Capsule { half: 0.5, radius: 0.25 }), 0.75, Extent::Point),
        ("torus", Recipe::torus(0.6, 0.25), 0.25, Extent::Line),
        ("cube of planes", Recipe::of(corners(6)), 1.0 / 3f64.sqrt(), Extent::Patch),
        ("table", table(), 0.5, Extent::Patch),
    ]
}

/// A plate on two rails.
fn table() -> Recipe {
    let rail = |x: f64| Recipe::cuboid(0.1, 0.5, 0.25).at(x, 0.0, -0.25);
    Recipe::cuboid(0.6, 0.5, 0.125).at(0.0, 0.0, 0.125).union(rail(0.5)).union(rail(-0.5))
}

#[test]
fn what_rests_slides_or_recedes_on_a_floor_is_clear_and_what_presses_meets_at_once() {
    for (name, body, height, _) in standing() {
        let body = Model::new(body.build());
        for off in [0.0, 1e-16, -1e-16] {
            let at = Pose::at(dvec3(0.1, -0.2, height + off));
            let moves = |velocity, spin| above(&body, Motion { start: at, velocity, spin });
            for (what, velocity, spin) in [
                ("rests", DVec3::ZERO, DVec3::ZERO),
                ("slides", dvec3(3.0, 1.0, 0.0), DVec3::ZERO),
                ("recedes", dvec3(0.0, 1.0, 0.5), DVec3::ZERO),
                ("spins", dvec3(0.5, 0.0, 0.0), DVec3::Z * 2.0),
            ] {
                let o = moves(velocity, spin);
                assert_eq!(o.status(), Status::Clear, "{name} {what}: {o:?}");
                assert!(o.counters.cells == 0 || name == "table", "{name} {what}: {} cells", o.counters.cells);
            }
            let o = moves(dvec3(0.3, 0.0, -0.7), DVec3::ZERO);
            assert_eq!(o.status(), Status::Contact, "{name} presses: {o:?}");
            assert!(
                o.time_lower() <= o.time() && o.time() <= 1e-15 && (o.at().normal - DVec3::Z).length() < 1e-12,
                "{name} presses: {o:?}"
            );
        }
        // Some of it below the floor.
        for sunk in [1e-3, 0.02, 0.1] {
            let o = above(&body, Motion::resting(Pose::at(dvec3(0.4, 0.0, height - sunk))));
            let depth = o.penetration().map_or(0.0, |p| p.depth);
            assert_eq!(o.status(), Status::Overlap, "{name}: {o:?}");
            assert!(depth > 0.95 * sunk && depth <= sunk * (1.0 + 1e-9), "{name}: {depth} of {sunk}");
        }
    }
}

#[test]
fn what_stands_on_a_floor_touches_it_with_points_lines_and_patches() {
    for (name, body, height, extent) in standing() {
        let found = at_rest(Recipe::of(HalfSpace), body, Pose::at(dvec3(0.3, 0.1, height)));
        assert_eq!(found.len(), if name == "table" { 2 } else { 1 }, "{name}: {found:?}");
        for region in &found {
            assert_eq!(region.extent, extent, "{name}: {region:?}");
            assert!((region.normal - DVec3::Z).length() < 1e-9, "{name}: {region:?}");
            assert!(region.points.iter().all(|p| p.point.z.abs() < 1e-9), "{name}: {region:?}");
        }
    }
    // A floor with a round hole under a box that covers it: the patch goes around.
    let holed = Recipe::of(HalfSpace).minus(Recipe::cylinder(0.3, 1.0));
    let found = at_rest(holed, Recipe::cuboid(0.5, 0.5, 0.5), Pose::at(DVec3::Z * 0.5));
    assert!(found.len() == 1 && found[0].extent == Extent::Patch, "{found:?}");
}

#[test]
fn margins_above_planes_end_when_supports_say_so() {
    let mut r = Random::new(11);
    let (mut within, mut beyond, mut worst) = (0, 0, 0.0f64);
    for i in 0..pairs(150) * 2 {
        let (_, draw) = KINDS[i % KINDS.len()];
        let shape = draw(&mut r);
        let tilts = r.chance(0.3);
        let s = falling(&mut r, vec![(shape, Pose::IDENTITY)], tilts);
        let (a, b) = (Model::new(s.a.build()), Model::new(s.b.build()));
        let query = question((&a, placed(s.motions[0])), (&b, placed(s.motions[1])), QueryOptions::CONTACT);
        let margin = r.within(1e-4, 0.3);
        if s.at(0.0) <= margin {
            continue;
        }
        let (until, known, counters) = margin::apart_until(&query, margin, &mut Scratch::default());
        assert!(known && (tilts || counters.cells == 0), "{i}: {counters:?}");
        let mut t = 0.0;
        while t < 1.0 && s.at(t) > margin * (1.0 + 1e-13) {
            t = (t + (s.at(t) - margin) / s.speed).max(t.next_up()).min(1.0);
        }
        // Never late; early by the slack that a margin has.
        assert!(until <= t + 1e-12, "{i}: {until}, not {t}");
        let slack = if until < 1.0 { s.at(until) / margin - 1.0 } else { 0.0 };
        assert!(slack <= margin::MARGIN_SLACK * 1.01 || tilts, "{i}: {until}, not {t}: {slack:e}");
        worst = worst.max(slack);
        *if until < 1.0 { &mut within } else { &mut beyond } += 1;
    }
    println!("{within} come within their margin, {beyond} do not; at most {worst:.1e} early");
    assert!(within > 30 && beyond > 10);
}

#[test]
fn a_floor_with_a_pit_takes_a_peg_that_fits() {
    // A hole of .25 to a depth of 1, a peg of .24 and as long as 1.2: it goes down to the bottom, or meets the rim
    // beside it.
    let floor = Model::new(Recipe::of(HalfSpace).minus(Recipe::cylinder(0.25, 1.0)).build());
    let peg = Model::new(Recipe::cylinder(0.24, 0.6).build());
    let down = |x: f64| {
        let motion = Motion { start: Pose::at(dvec3(x, 0.0, 1.6)), velocity: DVec3::Z * -2.5, spin: DVec3::ZERO };
        let still = placed(Motion::resting(Pose::IDENTITY));
        let query = question((&peg, placed(motion)), (&floor, still), QueryOptions::CONTACT);
        earliest_contact(&query, &mut Scratch::default())
    };
    let o = down(0.0);
    assert!(o.status() == Status::Contact && (o.time() - 2.0 / 2.5).abs() < 1e-12, "{o:?}");
    assert!((o.at().point.z + 1.0).abs() < 1e-9 && o.at().extent == Extent::Patch, "{o:?}");
    let o = down(0.3);
    assert!(o.status() == Status::Contact && (o.time() - 1.0 / 2.5).abs() < 1e-12, "{o:?}");
    assert_eq!((o.at().kind, o.at().point.z.abs() < 1e-9), (ContactKind::FaceFace, true), "{o:?}");
}

#[test]
fn regions_on_a_moving_plane_are_those_on_a_floor() {
    let (plane, cube) = (alone(HalfSpace), Model::new(Recipe::cuboid(0.5, 0.4, 0.3).build()));
    let mut r = Random::new(8);
    for _ in 0..20 {
        let at = Pose::new(r.vector(50.0), r.rotation());
        let motion = |start| Motion { start, velocity: dvec3(0.0, 1.0, 0.0), spin: DVec3::ZERO };
        let on = Pose::new(at.point(dvec3(0.2, 0.1, 0.3)), at.rotation);
        let query = question((&plane, placed(motion(at))), (&cube, placed(motion(on))), QueryOptions::CONTACT);
        let o = earliest_contact(&query, &mut Scratch::default());
        assert_eq!(o.status(), Status::Clear, "{o:?}");
        let found = regions(&query, 0.0, threshold(query.resolution, 0.0));
        assert!(found.complete && found.regions.len() == 1, "{found:?}");
        let region = &found.regions[0];
        assert!(region.extent == Extent::Patch && region.points.len() == 4, "{region:?}");
        for p in &region.points {
            let own = at.inverse().point(p.point) - dvec3(0.2, 0.1, 0.0);
            let off = (own.abs() - dvec3(0.5, 0.4, 0.0)).length();
            assert!(off < 1e-9, "{own}");
        }
    }
}
