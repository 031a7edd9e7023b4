//! Points and rays with a right answer in closed form.

use contactd::contact::probe::{
    DEFAULT_LIMIT, PointAnswer, PointOptions, PosedModel, Ray, RayAnswer, RayOptions, RayOutcome, Side, points, rays,
};
use contactd::math::random::Random;
use contactd::octree::Model;
use contactd::solid::primitive::*;
use contactd::solid::{Label, Op, SolidBuilder};
use contactd_proto::Pose;
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_tests::models::{pierced, simple};
use glam::DVec3;

const RAYS: RayOptions = RayOptions { depth: 0.0, limit: DEFAULT_LIMIT };

fn points_to(tolerance: f64) -> PointOptions {
    PointOptions { surface: 1e-9, tolerance, limit: DEFAULT_LIMIT }
}

fn frame(r: &mut Random) -> Pose {
    Pose::new(r.vector(1.0), quat_of_rotation_vector(r.vector(2.0)))
}

fn ask(model: &Model, pose: Pose, x: DVec3) -> PointAnswer {
    points(&PosedModel { model, pose }, &[pose.point(x)], &points_to(1e-10))[0]
}

/// A signed distance is bracketed, settled, and told with its point.
fn expect(name: &str, a: &PointAnswer, truth: f64, most: u64) {
    println!("{name}: {} cells, {truth}: {} {}", a.cells, a.lower - truth, a.upper - truth);
    assert!(a.lower <= truth + 1e-13 && truth <= a.upper + 1e-13, "{name}: {a:?}, {truth}");
    assert!(a.is_settled && a.upper - a.lower <= 1e-10, "{name}: {a:?}, {truth}");
    assert_eq!(a.side, if truth > 0.0 { Side::Outside } else { Side::Inside }, "{name}");
    assert!(a.cells <= most, "{name}: {} cells", a.cells);
}

fn cast(model: &Model, pose: Pose, (origin, direction): (DVec3, DVec3), length: f64) -> RayAnswer {
    let ray = Ray { origin: pose.point(origin), direction: pose.vector(direction).normalize(), length };
    rays(&PosedModel { model, pose }, &[ray], &RAYS)[0]
}

/// A hit is where it is known to be, and bracketed.
fn expect_hit(name: &str, a: &RayAnswer, truth: f64, is_leaving: bool) {
    println!("{name}: {} cells, {truth}: {:?}", a.cells, a.outcome);
    let RayOutcome::Hit(hit) = a.outcome else { panic!("{name}: {a:?}, {truth}") };
    assert!((hit.t - truth).abs() < 1e-11 && hit.lower <= hit.t && hit.t <= hit.upper, "{name}: {a:?}, {truth}");
    assert!(hit.upper - hit.lower < 1e-8 && hit.is_leaving == is_leaving, "{name}: {a:?}");
}

#[test]
fn signed_distances_of_primitives_are_those_of_closed_forms() {
    let mut r = Random(31);
    let half = DVec3::new(0.3, 0.5, 0.8);
    let hole = pierced(
        Cuboid { half: DVec3::new(5.0, 5.0, 1.0) },
        vec![(Cylinder { radius: 2.0, half_height: 2.0 }.into(), Pose::IDENTITY)],
    );
    for i in 0..40 {
        let (pose, x) = (frame(&mut r), r.vector(1.4));
        expect(&format!("ball {i}"), &ask(&simple(Sphere { radius: 0.9 }), pose, x), x.length() - 0.9, 100);
        let q = x.abs() - half;
        let truth = q.max(DVec3::ZERO).length() + q.max_element().min(0.0);
        expect(&format!("box {i}"), &ask(&simple(Cuboid { half }), pose, x), truth, 40);
        let truth = (x.truncate().length() - 1.0).hypot(x.z) - 0.3;
        expect(&format!("torus {i}"), &ask(&simple(Torus { major: 1.0, minor: 0.3 }), pose, x), truth, 1000);
        let x = x * DVec3::new(1.0, 1.0, 0.6);
        expect(&format!("hole {i}"), &ask(&hole, pose, x), 2.0 - x.truncate().length(), 100);
    }
}

#[test]
fn a_point_on_a_seam_within_is_inside_and_rays_do_not_see_it() {
    let mut b = SolidBuilder::new();
    let halves =
        [-1.0, 1.0].map(|x| b.primitive(Cuboid { half: DVec3::ONE }, Pose::at(DVec3::X * x), Label::default()));
    let root = b.operation(Op::Union, &halves);
    let two = Model::new(b.finish(root));
    let a = ask(&two, Pose::IDENTITY, DVec3::new(0.0, 0.25, 0.1));
    expect("seam", &a, -0.75, 400);
    for (from, truth) in [(-1.5, 3.5), (0.0, 2.0)] {
        let a = cast(&two, Pose::IDENTITY, (DVec3::new(from, 0.25, 0.1), DVec3::X), 10.0);
        expect_hit("through the seam", &a, truth, true);
    }
}

#[test]
fn rays_through_a_hole_pass_and_others_meet_its_wall() {
    let mut r = Random(32);
    let plate = pierced(
        Cuboid { half: DVec3::new(5.0, 5.0, 1.0) },
        vec![(Cylinder { radius: 2.0, half_height: 2.0 }.into(), Pose::IDENTITY)],
    );
    let mut through = 0;
    for i in 0..200 {
        let (pose, x) = (frame(&mut r), DVec3::new(r.within(-1.2, 1.2), r.within(-1.2, 1.2), 3.0));
        let d = (r.vector(0.7) - DVec3::Z).normalize();
        let a = cast(&plate, pose, (x, d), 20.0);
        // The wall at z in −1..1, or the top.
        let top = (1.0 - x.z) / d.z;
        let (p, q) = (x.truncate(), d.truncate());
        let (qq, pq, pp) = (q.dot(q), p.dot(q), p.dot(p) - 4.0);
        let wall = (-pq + (pq * pq - qq * pp).sqrt()) / qq;
        let truth = if (p + q * top).length() > 2.0 { top } else { wall };
        if (x + d * truth).z < -1.0 {
            through += 1;
            assert_eq!(a.outcome, RayOutcome::Miss { is_inside: false }, "{i}");
        } else {
            expect_hit(&format!("{i}"), &a, truth, false);
        }
    }
    assert!(through > 20, "{through}");
}

/// Along a side, at a hair beside it and within it: touching is passing, and what is deeper than the depth asked for is hit.
#[test]
fn a_ray_along_a_side_passes() {
    let cube = simple(Cuboid { half: DVec3::ONE });
    let ball = simple(Sphere { radius: 1.0 });
    for model in [&cube, &ball] {
        for depth in [0.0, 1e-6] {
            for (off, is_hit) in [(0.0, false), (1e-9, false), (-1e-5, true), (-1e-9, depth == 0.0)] {
                let ray = Ray { origin: DVec3::new(-3.0, 0.0, 1.0 + off), direction: DVec3::X, length: 10.0 };
                let solid = PosedModel { model, pose: Pose::IDENTITY };
                let a = rays(&solid, &[ray], &RayOptions { depth, limit: 10_000 })[0];
                assert_eq!(matches!(a.outcome, RayOutcome::Hit(_)), is_hit, "{off} {depth}: {a:?}");
                assert!(!matches!(a.outcome, RayOutcome::Undecided { .. }), "{off} {depth}: {a:?}");
            }
        }
    }
}

#[test]
fn half_spaces_and_limits_are_told() {
    let below = simple(HalfSpace);
    let a = ask(&below, Pose::IDENTITY, DVec3::new(3.0, 1.0, 2.5));
    expect("above a half-space", &a, 2.5, 40);
    expect("in a half-space", &ask(&below, Pose::IDENTITY, DVec3::new(3.0, 1.0, -70.0)), -70.0, 40);
    expect_hit("down", &cast(&below, Pose::IDENTITY, (DVec3::Z, -DVec3::Z), 10.0), 1.0, false);
    expect_hit("up", &cast(&below, Pose::IDENTITY, (-DVec3::Z, DVec3::Z), 10.0), 1.0, true);
    let short = cast(&below, Pose::IDENTITY, (-DVec3::Z, DVec3::Z), 0.9);
    assert_eq!(short.outcome, RayOutcome::Miss { is_inside: true });
    let solid = PosedModel { model: &below, pose: Pose::IDENTITY };
    let ray = Ray { origin: DVec3::Z, direction: -DVec3::Z, length: 10.0 };
    let a = rays(&solid, &[ray], &RayOptions { depth: 0.0, limit: 1 })[0];
    assert!(matches!(a.outcome, RayOutcome::Undecided { until } if (0.0..=1.0).contains(&until)), "{a:?}");
}

/// An ellipsoid's psi is flatter than the distance, and its tangent at the foot tells the distance all the same.
#[test]
fn points_around_ellipsoids_take_few_parts() {
    let mut r = Random(33);
    for i in 0..60 {
        let semi = DVec3::new(r.within(0.1, 1.0), r.within(0.1, 1.0), r.within(0.1, 1.0));
        let (model, x) = (simple(Ellipsoid { semi }), r.vector(1.4));
        let a = ask(&model, Pose::IDENTITY, x);
        assert!(a.is_settled && a.upper - a.lower <= 1e-10 && a.cells < 4000, "{i} {semi} {x}: {a:?}");
        // Along the normal, which is the gradient of Σ y²/s².
        let n = (a.nearest / (semi * semi)).normalize();
        assert!((x - a.nearest).cross(n).length() < 1e-5, "{i} {semi} {x}: {a:?}");
    }
}
