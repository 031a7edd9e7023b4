//! Distances with a right answer in closed form.

use contactd::contact::PlacedModel;
use contactd::contact::distance::{DEFAULT_LIMIT, Distance, DistanceQuery, at_instant, over_step};
use contactd::import::{Facets, Limits, import_csg};
use contactd::math::random::Random;
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::primitive::*;
use contactd::solid::{Label, Op, SolidBuilder};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use contactd_tests::models::{pierced, simple};
use glam::{DQuat, DVec3};

fn placed(model: &Model, motion: Motion) -> PlacedModel<'_> {
    PlacedModel { model, placed: Placed { place: Pose::IDENTITY, motion } }
}

fn ask(a: &Model, pa: Pose, b: &Model, pb: Pose) -> Distance {
    let query = DistanceQuery {
        a: placed(a, Motion::resting(pa)),
        b: placed(b, Motion::resting(pb)),
        tolerance: 1e-10,
        limit: DEFAULT_LIMIT,
    };
    at_instant(&query, 0.0)
}

/// A distance is bracketed, settled, and its points are as far apart as its upper bound says.
fn expect(name: &str, d: &Distance, truth: f64, most: u64) {
    println!("{name}: {} cells, [{}, {}], {truth}: {} {}", d.cells, d.lower, d.upper, d.lower - truth, d.upper - truth);
    assert!(d.lower <= truth + 1e-13 && truth <= d.upper + 1e-13, "{name}: {d:?}, {truth}");
    assert!(d.is_settled && d.upper - d.lower <= 1e-10, "{name}: {d:?}, {truth}");
    assert!(((d.a.point - d.b.point).length() - d.upper).abs() < 1e-11, "{name}: {d:?}");
    assert!(d.cells <= most, "{name}: {} cells", d.cells);
}

fn turned(r: &mut Random) -> DQuat {
    quat_of_rotation_vector(r.vector(2.0))
}

#[test]
fn distances_of_primitives_are_those_of_closed_forms() {
    let mut r = Random(3);
    for i in 0..20 {
        let (p, q) = (r.within(0.2, 1.0), r.within(0.2, 1.0));
        let away = r.vector(1.0).normalize() * r.within(2.2, 4.0);
        let (frame, at) = (Pose::new(r.vector(1.0), turned(&mut r)), turned(&mut r));
        let pose = |x: DVec3| Pose::new(frame.point(x), at);
        let (ball, other) = (simple(Sphere { radius: p }), simple(Sphere { radius: q }));
        expect(&format!("balls {i}"), &ask(&ball, frame, &other, pose(away)), away.length() - p - q, 20);
        let half = DVec3::new(0.3, 0.5, 0.8);
        let cube = simple(Cuboid { half });
        let truth = (away - away.clamp(-half, half)).length() - p;
        expect(&format!("box and ball {i}"), &ask(&cube, frame, &ball, pose(away)), truth, 40);
        let torus = simple(Torus { major: 1.0, minor: 0.3 });
        let rho = away.truncate().length();
        let truth = (rho - 1.0).hypot(away.z) - 0.3 - p;
        if truth > 0.0 {
            expect(&format!("torus and ball {i}"), &ask(&torus, frame, &ball, pose(away)), truth, 400);
        }
        let hole = pierced(
            Cuboid { half: DVec3::new(5.0, 5.0, 1.0) },
            vec![(Cylinder { radius: 2.0, half_height: 2.0 }.into(), Pose::IDENTITY)],
        );
        let small = simple(Sphere { radius: 0.3 });
        let x = DVec3::new(r.within(-0.9, 0.9), r.within(-0.9, 0.9), r.within(-0.9, 0.9));
        let truth = 2.0 - 0.3 - x.truncate().length();
        expect(&format!("ball in a hole {i}"), &ask(&hole, frame, &small, pose(x)), truth, 400);
    }
}

/// The rim of a hole curves away from its tangents: only parts of it bound the distance.
#[test]
fn a_ball_above_a_rim_is_as_far_as_the_rim() {
    let mut r = Random(4);
    for i in 0..10 {
        let (hole, p) = (r.within(0.8, 1.5), r.within(0.05, 0.4));
        let plate = pierced(
            Cuboid { half: DVec3::new(3.0, 3.0, 1.0) },
            vec![(Cylinder { radius: hole, half_height: 1.5 }.into(), Pose::IDENTITY)],
        );
        let (rho, z, angle) = (r.within(0.2, 0.9) * hole, 1.0 + p + r.within(0.01, 1.0), r.within(0.0, 6.0));
        let x = DVec3::new(rho * angle.cos(), rho * angle.sin(), z);
        let frame = Pose::new(r.vector(1.0), turned(&mut r));
        let d = ask(&simple(Sphere { radius: p }), Pose::at(frame.point(x)), &plate, frame);
        expect(&format!("rim {i}"), &d, (hole - rho).hypot(z - 1.0) - p, 4000);
        let on_plate = frame.inverse().point(d.b.point);
        assert!(plate.solid.value(on_plate) <= 0.0, "rim {i}: {on_plate}");
    }
}

/// Both balls of a dumb-bell count, whichever is next.
#[test]
fn of_a_union_the_nearest_part_tells() {
    let mut r = Random(5);
    for i in 0..10 {
        let mut b = SolidBuilder::new();
        let ends = [-1.0, 1.0].map(|z| b.primitive(Sphere { radius: 0.4 }, Pose::at(DVec3::Z * z), Label::default()));
        let root = b.operation(Op::Union, &ends);
        let bell = Model::new(b.finish(root));
        let x = r.vector(1.0).normalize() * r.within(2.0, 3.0);
        let least = (x - DVec3::Z).length().min((x + DVec3::Z).length()) - 0.9;
        let d = ask(&bell, Pose::IDENTITY, &simple(Sphere { radius: 0.5 }), Pose::at(x));
        expect(&format!("dumb-bell {i}"), &d, least, 400);
    }
}

/// A ball on an arm that turns, and one that rests: the distance of a point from an arc.
#[test]
fn the_least_distance_of_an_arm_that_turns_is_that_of_its_arc() {
    let mut r = Random(6);
    for i in 0..10 {
        let (arm, angle) = (r.within(0.5, 1.5), r.within(0.3, 5.5));
        let x = r.vector(1.0).normalize() * r.within(2.2, 3.5);
        let to = x.y.atan2(x.x).rem_euclid(std::f64::consts::TAU);
        let at = |t: f64| (x - DVec3::new(arm * t.cos(), arm * t.sin(), 0.0)).length();
        let truth = if to <= angle { at(to) } else { at(0.0).min(at(angle)) } - 0.5;
        let mut b = SolidBuilder::new();
        let root = b.primitive(Sphere { radius: 0.2 }, Pose::at(DVec3::X * arm), Label::default());
        let (turning, ball) = (Model::new(b.finish(root)), simple(Sphere { radius: 0.3 }));
        let motion = Motion { start: Pose::IDENTITY, velocity: DVec3::ZERO, spin: DVec3::Z * angle };
        let query = DistanceQuery {
            a: placed(&turning, motion),
            b: placed(&ball, Motion::resting(Pose::at(x))),
            tolerance: 1e-10,
            limit: DEFAULT_LIMIT,
        };
        let d = over_step(&query);
        expect(&format!("arm {i}"), &d, truth, 4000);
        let when = if to <= angle {
            to / angle
        } else if at(0.0) < at(angle) {
            0.0
        } else {
            1.0
        };
        assert!((d.time - when).abs() < 1e-4, "arm {i}: at {} and not {when}", d.time);
    }
}

#[test]
fn a_body_of_which_tangents_leave_nothing_is_told_without_a_distance() {
    // What three bodies would have in common, and have not; some of its boxes are left until tangents of the torus have cut them.
    let corners = [
        [-0.4108565553180219, 0.5484856647027183, -0.605273495002701],
        [-0.6856009666145957, -0.22620963969177432, 0.8083186030892711],
        [0.10147838809928682, 0.49703993943793634, 0.7828774965398873],
        [-0.9100879481183057, 0.2921121787249461, -0.20219700410856722],
        [0.5119312952149153, -0.5587359894017971, -0.18837416457793776],
    ];
    let faces = [[0, 2, 3], [0, 4, 2], [0, 3, 4], [1, 3, 2], [1, 2, 4], [1, 4, 3]];
    let disc = "cylinder(h = 1, r1 = 0.41351124261854755, r2 = 0.41351124261854755);";
    let slot = format!("hull() {{ {disc} multmatrix([[1,0,0,0.4],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) {disc} }}");
    let circle = "circle(r = 0.17021011110165443);";
    let ring = format!(
        "rotate_extrude(angle = 360) multmatrix([[1,0,0,0.9566577766569939],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) {circle}"
    );
    let turned = "[[0.4973635570263346,0.38343296252729553,-0.7782086194521706,-0.264],\
        [-0.07667493218242058,-0.8740881103749272,-0.4796779441208546,0.227],\
        [-0.8641472368276907,0.29824342163529793,-0.40533987533221594,-0.678],[0,0,0,1]]";
    let s = 0.07846079903790039;
    let text = format!(
        "multmatrix([[{s},0,0,0],[0,{s},0,0],[0,0,{s},0],[0,0,0,1]]) intersection() {{ \
         polyhedron(points = {corners:?}, faces = {faces:?}); \
         multmatrix([[1,0,0,-0.106],[0,1,0,0.316],[0,0,-1,0.115],[0,0,0,1]]) {slot} multmatrix({turned}) {ring} }}"
    );
    let nothing = import_csg("nothing.csg", &text, Facets::Auto, &Limits::default()).expect("a text").solid;
    let (nothing, ball) = (Model::new(nothing), simple(Sphere { radius: 0.4 * s }));
    let turned = DQuat::from_xyzw(0.3742207833586022, 0.3372355598882748, -0.8228468348560202, -0.2629716121879803);
    let [from, to] = [DVec3::ZERO, DVec3::new(-0.012594168414471753, 0.020037593123204092, 0.008688152258787404)];
    let a = Motion { start: Pose::new(from, turned), velocity: to - from, spin: DVec3::ZERO };
    let [from, to] = [DVec3::new(-0.11, -0.0061, 0.036), DVec3::new(-0.031, -0.012, 0.069)];
    let b = Motion { start: Pose::at(from), velocity: to - from, spin: DVec3::ZERO };
    let query = DistanceQuery { a: placed(&nothing, a), b: placed(&ball, b), tolerance: 1e-4, limit: DEFAULT_LIMIT };
    let d = over_step(&query);
    assert!(d.upper == f64::INFINITY, "{d:?}");
}
