//! Tori against closed forms, and against every other kind: first contacts, membership, regions, mass.
//!
//! A point's distance from a torus is that from its circle less r, so first contacts with balls, planes and spherical walls are
//! roots of one function of time (`kinds`). Pairs with the other kinds have no closed form: their certificates are checked by the
//! independent verifier.
//! `CONTACTD_PAIRS=10000 cargo test --release -p contactd-tests --test answers tori:: -- --nocapture` sets the number of
//! pairs, and of trees.

use super::kinds::{Scene, alone, at_rest, compare, pairs, past, placed, speed, turning, values_and_volumes};
use contactd::contact::Extent;
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::octree::mass::mass_properties;
use contactd_proto::{MassOptions, Motion, Pose};
use contactd_tests::certified::{certify_all, certify_trees, stay_small};
use contactd_tests::random_solids::{Random, shape, shape_or_torus, torus};
use contactd_tests::scenes::Recipe;
use glam::{DVec3, dvec3};
use std::f64::consts::PI;

/// Of the pairs whose certificates are checked.
const KINDS_SEED: u64 = 0x70_7105;

/// Distance from the circle of a torus about the z axis of a pose.
fn from_circle(pose: &Pose, major: f64, x: DVec3) -> f64 {
    let o = pose.inverse().point(x);
    (o.x.hypot(o.y) - major).hypot(o.z)
}

#[test]
fn a_torus_meets_a_ball_and_a_plane_and_leaves_round_walls_when_closed_forms_say_so() {
    let count = pairs(15);
    compare("ball", (count, 1, 4.0), |r| {
        let (t, ball) = (torus(r, 1.0), r.within(0.05, 0.6));
        let motions = [turning(r), past(r, 2.0)];
        let (major, least) = (t.major, t.minor + ball);
        let speed = speed(&motions, 4.0);
        let gap = Box::new(move |a: &Pose, b: &Pose| from_circle(a, major, b.position) - least);
        Scene { a: Recipe::of(t), b: Recipe::sphere(ball), motions, gap, speed }
    });
    compare("plane", (count, 2, 4.0), |r| {
        let t = torus(r, 1.0);
        let floor = Recipe::cuboid(8.0, 8.0, 1.0).at(0.0, 0.0, -1.0);
        let motions = [past(r, 2.5), Motion::resting(Pose::new(r.vector(0.2), r.rotation()))];
        let (major, minor) = (t.major, t.minor);
        let speed = speed(&motions, 2.0);
        let gap = Box::new(move |a: &Pose, b: &Pose| {
            let n = b.rotation * DVec3::Z;
            let lean = (a.rotation * DVec3::Z).cross(n).length();
            n.dot(a.position - b.position) - major * lean - minor
        });
        Scene { a: Recipe::of(t), b: floor, motions, gap, speed }.above_plane()
    });
    compare("ball in a round groove", (count, 3, 4.0), |r| {
        let mut t = torus(r, 1.0);
        t.major = t.minor * r.within(1.2, 3.0);
        let ball = t.minor * r.within(0.1, 0.95);
        let block = Recipe::cuboid(3.0, 3.0, 1.0).minus(Recipe::of(t.clone()));
        let inside = (t.minor - ball) * 0.8;
        let a = turning(r);
        let at = a.start.point(DVec3::X * t.major + r.direction() * (inside * r.within(0.0, 1.0)));
        let b =
            Motion { start: Pose::new(at, r.rotation()), velocity: a.velocity + r.vector(0.5), spin: r.vector(1.0) };
        let motions = [a, b];
        let speed = speed(&motions, 4.0);
        let (major, room) = (t.major, t.minor - ball);
        let gap = Box::new(move |a: &Pose, b: &Pose| room - from_circle(a, major, b.position));
        Scene { a: block, b: Recipe::sphere(ball), motions, gap, speed }
    });
    compare("torus in a hollow ball", (count, 4, 4.0), |r| {
        let t = torus(r, 0.6);
        let hollow = t.major + t.minor + r.within(0.05, 0.4);
        let block = Recipe::cuboid(3.0, 3.0, 3.0).minus(Recipe::sphere(hollow));
        let motions = [turning(r), Motion::turning(Pose::new(DVec3::ZERO, r.rotation()), r.vector(1.0), r.vector(1.5))];
        let speed = speed(&motions, 4.0);
        let (major, minor) = (t.major, t.minor);
        let gap = Box::new(move |a: &Pose, b: &Pose| {
            let o = b.inverse().point(a.position);
            hollow - minor - (o.x.hypot(o.y) + major).hypot(o.z)
        });
        Scene { a: block, b: Recipe::of(t), motions, gap, speed }
    });
}

/// A torus, and one of the other kinds or another torus that goes past it.
fn passing(r: &mut Random) -> [(Model, Placed); 2] {
    let other = if r.chance(0.3) { torus(r, 0.8).into() } else { shape(r, 0.8) };
    [(alone(torus(r, 0.8)), placed(turning(r))), (alone(other), placed(past(r, 2.2)))]
}

#[test]
fn certificates_of_tori_against_every_kind_and_of_trees_with_them_hold() {
    let count = pairs(8);
    certify_all("kinds", (count, KINDS_SEED), passing);
    certify_trees((count, KINDS_SEED), shape_or_torus);
}

/// Of a thousand of the pairs above those of which thin cells take tens of thousands, along what bends away from its tangents.
#[test]
fn certificates_along_tori_stay_small() {
    stay_small("tori", KINDS_SEED, &[597, 606, 680, 685, 727, 783, 810], passing);
}

#[test]
fn trees_with_tori_have_the_values_and_the_volumes_of_an_independent_evaluation() {
    // A volume by rays takes a second: a twelfth of them in the command.
    values_and_volumes(shape_or_torus, (pairs(60).div_ceil(30).min(24), 3, pairs(60) * 10), [64, 41]);
}

#[test]
fn half_a_torus_has_half_its_volume() {
    let exact = 2.0 * PI * PI * 2.0 * 0.25;
    let whole =
        mass_properties(&Model::new(Recipe::torus(2.0, 0.5).build()), &MassOptions { tolerance: 1e-6, boxes: 10 });
    let whole = whole.expect("bounded");
    assert!(whole.boxes == 0 && (whole.volume - exact).abs() <= whole.volume_error);
    // Pappus: I_z = m (R² + ¾ r²), I_x = m (½ R² + ⅝ r²).
    for (k, i) in [(0, 2.0 + 0.15625), (1, 2.0 + 0.15625), (2, 4.0 + 0.1875)] {
        assert!((whole.inertia[k] - exact * i).abs() <= 1e-12 * exact, "{whole:?}");
    }
    let cut = Recipe::torus(2.0, 0.5).minus(Recipe::cuboid(4.0, 4.0, 1.0).at(0.0, 4.0, 0.0));
    for tolerance in [0.1, 1e-2, 1e-3] {
        let half =
            mass_properties(&Model::new(cut.build()), &MassOptions { tolerance, boxes: 300_000 }).expect("bounded");
        assert!(half.boxes > 0 && (half.volume - 0.5 * exact).abs() <= half.volume_error, "{half:?}");
        assert!(half.volume_error <= tolerance * exact, "{half:?}");
        println!("{tolerance}: {} boxes", half.boxes);
    }
}

#[test]
fn a_torus_touches_along_circles_and_at_points() {
    let floor = || Recipe::cuboid(5.0, 5.0, 1.0).at(0.0, 0.0, -1.0);
    let ring = || Recipe::torus(2.0, 0.5);
    let circle = |name: &str, a: Recipe, b: Recipe, pose: Pose, radius: f64, z: f64| {
        let found = at_rest(a, b, pose);
        assert!(found.len() == 1 && found[0].extent == Extent::Line, "{name}: {found:?}");
        assert_eq!(found[0].points.len(), 8, "{name}: {found:?}");
        for p in &found[0].points {
            let x = p.point;
            assert!((x.x.hypot(x.y) - radius).abs() < 1e-9 && (x.z - z).abs() < 1e-9, "{name}: {x}");
        }
    };
    let up = |z: f64| Pose::at(dvec3(0.0, 0.0, z));
    circle("on a floor", floor(), ring(), up(0.5), 2.0, 0.0);
    circle("a ring on a rod", Recipe::cylinder(1.5, 3.0), ring(), up(0.0), 1.5, 0.0);
    circle("a ring in a pipe", Recipe::cylinder(4.0, 3.0).minus(Recipe::cylinder(2.5, 4.0)), ring(), up(0.0), 2.5, 0.0);
    // 3-4-5: a ball of 2 on a ring of 2 and ½ has its centre 1.5 above the plane of the circle.
    circle("a ball in a ring", ring(), Recipe::sphere(2.0), up(1.5), 2.0 - 0.5 * 0.8, 0.3);
    // A slot cut by a plane across: the ring stands on its edge.
    let on_edge =
        Pose::new(dvec3(0.0, 0.0, 2.5), contactd_proto::motion::quat_of_rotation_vector(DVec3::X * (0.5 * PI)));
    let found = at_rest(floor(), ring(), on_edge);
    assert!(found.len() == 1 && found[0].extent == Extent::Point, "{found:?}");
    assert!(found[0].points[0].point.length() < 1e-9 && (found[0].normal - DVec3::Z).length() < 1e-9, "{found:?}");
}
