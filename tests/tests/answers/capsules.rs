//! Capsules against closed forms, and against every other kind.
//!
//! A capsule is all points within a radius of a segment, so how far it is from another one, from a ball or from a plane is told by
//! segments and points. Pairs with the other kinds have no closed form: their certificates are checked by the independent verifier.
//! `CONTACTD_PAIRS=10000 cargo test --release -p contactd-tests --test answers capsules:: -- --nocapture` sets the number.

use super::elliptics::{Scene, compare, pairs, past, speed, turning};
use contactd::contact::region::{regions, threshold};
use contactd::contact::{Extent, QueryOptions};
use contactd::import::{Facets, Limits, import_csg};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::octree::mass::mass_properties;
use contactd::solid::Shape;
use contactd_proto::{MassOptions, Motion, Pose};
use contactd_tests::certified::{certify_all, certify_trees};
use contactd_tests::engine::question;
use contactd_tests::random_solids::{Random, capsule, shape, shape_or_capsule, solid_of};
use contactd_tests::reference::field::Field;
use contactd_tests::scenes::Recipe;
use glam::{DVec3, dvec3};
use std::f64::consts::PI;

/// Distance of a point from the segment of the half length `half` along z.
fn from_segment(half: f64, x: DVec3) -> f64 {
    (x - DVec3::Z * x.z.clamp(-half, half)).length()
}

/// Distance of two segments along z of their poses: inside of both where that is the least, else from an end.
fn between((a, half_a): (&Pose, f64), (b, half_b): (&Pose, f64)) -> f64 {
    let (u, v, w) = (a.rotation * DVec3::Z, b.rotation * DVec3::Z, b.position - a.position);
    let ends = |p: &Pose, half: f64| [half, -half].map(|z| p.point(DVec3::Z * z));
    let of_b = ends(b, half_b).map(|x| from_segment(half_a, a.inverse().point(x)));
    let of_a = ends(a, half_a).map(|x| from_segment(half_b, b.inverse().point(x)));
    let least = of_a.into_iter().chain(of_b).fold(f64::INFINITY, f64::min);
    // The lines' own nearest points: (w + t v − s u) square to both.
    let (uv, across) = (u.dot(v), u.cross(v));
    let square = across.length_squared();
    let (s, t) = ((u.dot(w) - uv * v.dot(w)) / square, (uv * u.dot(w) - v.dot(w)) / square);
    if s.abs() <= half_a && t.abs() <= half_b { least.min(w.dot(across).abs() / square.sqrt()) } else { least }
}

#[test]
fn capsules_meet_each_other_balls_and_planes_when_closed_forms_say_so() {
    let count = pairs(100);
    compare("two capsules", count, 1, |r| {
        let (p, q) = (capsule(r, 1.0), capsule(r, 1.0));
        let motions = [turning(r), past(r, 2.8)];
        let speed = speed(&motions, 4.5);
        let (half_p, half_q, least) = (p.half, q.half, p.radius + q.radius);
        let gap = Box::new(move |a: &Pose, b: &Pose| between((a, half_p), (b, half_q)) - least);
        Scene { a: Recipe::of(p), b: Recipe::of(q), motions, gap, speed }
    });
    compare("capsule on a plane", count, 2, |r| {
        let p = capsule(r, 1.0);
        let floor = Recipe::cuboid(9.0, 9.0, 1.0).at(0.0, 0.0, -1.0);
        let aim = past(r, 2.5);
        let up = DVec3::Z * aim.start.position.z.abs().max(1.6);
        let start = Pose::new(aim.start.position.with_z(0.0) + up, aim.start.rotation);
        let a = Motion { start, velocity: -up * r.within(0.5, 1.5) + r.vector(0.3), ..aim };
        let motions = [a, Motion::resting(Pose::IDENTITY)];
        let (half, radius) = (p.half, p.radius);
        let gap = Box::new(move |a: &Pose, _: &Pose| a.position.z - half * (a.rotation * DVec3::Z).z.abs() - radius);
        Scene { a: Recipe::of(p), b: floor, motions, gap, speed: speed(&motions, 1.5) }
    });
    compare("ball in a hollow capsule", count, 3, |r| {
        let p = capsule(r, 1.0);
        let ball = p.radius * r.within(0.1, 0.9);
        let block = Recipe::cuboid(3.0, 3.0, 3.0).minus(Recipe::of(p.clone()));
        let (half, room) = (p.half, p.radius - ball);
        let a = turning(r);
        let at =
            a.start.point(DVec3::Z * (half * r.within(-1.0, 1.0)) + r.direction() * (0.8 * room * r.within(0.0, 1.0)));
        let b =
            Motion { start: Pose::new(at, r.rotation()), velocity: a.velocity + r.vector(1.0), spin: r.vector(1.0) };
        let motions = [a, b];
        let gap = Box::new(move |a: &Pose, b: &Pose| room - from_segment(half, a.inverse().point(b.position)));
        Scene { a: block, b: Recipe::sphere(ball), motions, gap, speed: speed(&motions, 4.0) }
    });
}

#[test]
fn certificates_of_capsules_against_every_kind_and_of_trees_with_them_hold() {
    let count = pairs(120);
    let alone = |shape: Shape| Model::new(Recipe::of(shape).build());
    certify_all("kinds", (count, 0xca_9501), |r| {
        let other = if r.chance(0.3) { capsule(r, 0.8).into() } else { shape(r, 0.8) };
        let place = |motion| Placed { place: Pose::IDENTITY, motion };
        [(alone(capsule(r, 0.8).into()), place(turning(r))), (alone(other), place(past(r, 2.4)))]
    });
    certify_trees((count, 0xca_9501), shape_or_capsule);
}

#[test]
fn trees_with_capsules_have_the_values_of_an_independent_evaluation_and_volumes_of_formulas() {
    let mut r = Random::new(31);
    for i in 0..4 {
        let solid = solid_of(&mut r, 1 + i % 3, shape_or_capsule);
        let (around, field) = (solid.aabb(), Field::new(&solid, &Pose::IDENTITY));
        for _ in 0..pairs(100) * 10 {
            let x = r.point_in(&around);
            let (f, other) = (solid.value(x), field.value(x));
            assert!((f - other).abs() < 1e-13, "solid {i} at {x}: {f} {other}");
        }
    }
    let whole = |recipe: &Recipe, tolerance: f64| {
        mass_properties(&Model::new(recipe.build()), &MassOptions { tolerance, boxes: 300_000 }).expect("bounded")
    };
    let (c, exact) = (Recipe::capsule(1.0, 0.5), 0.5 * PI + PI / 6.0);
    let m = whole(&c, 1e-6);
    assert!(m.boxes == 0 && (m.volume - exact).abs() <= m.volume_error, "{m:?}");
    // Of the half above z = 0, half; measured by boxes, its moments are those of the formula, too.
    let cut = c.clone().minus(Recipe::cuboid(3.0, 3.0, 3.0).at(0.0, 0.0, -3.0));
    for tolerance in [0.1, 1e-2, 1e-3] {
        let half = whole(&cut, tolerance);
        assert!(half.boxes > 0 && (half.volume - 0.5 * exact).abs() <= half.volume_error, "{half:?}");
        assert!(half.volume_error <= tolerance * exact, "{half:?}");
    }
    // ∫ x² + y² of both caps 2·(2/5) m r², of the tube ½ m r².
    let about_z = 0.5 * PI * 0.125 + PI / 6.0 * 0.4 * 0.25;
    assert!(m.inertia.iter().any(|i| (i - about_z).abs() < 1e-12), "{m:?} {about_z}");
}

#[test]
fn a_capsule_lies_along_a_line_and_hulls_of_equal_balls_are_capsules() {
    let (a, b) = (
        Model::new(Recipe::cuboid(5.0, 5.0, 1.0).at(0.0, 0.0, -1.0).build()),
        Model::new(Recipe::capsule(1.5, 0.5).build()),
    );
    let place = |pose| Placed { place: Pose::IDENTITY, motion: Motion::resting(pose) };
    let on_side = contactd_proto::motion::quat_of_rotation_vector(DVec3::X * (0.5 * PI));
    let pose = Pose::new(dvec3(0.0, 0.0, 0.5), on_side);
    let query = question((&a, place(Pose::IDENTITY)), (&b, place(pose)), QueryOptions::DEPTH);
    let found = regions(&query, 0.0, threshold(query.resolution, 0.0)).regions;
    assert!(found.len() == 1 && found[0].extent == Extent::Line && found[0].points.len() == 2, "{found:?}");
    for p in &found[0].points {
        assert!(p.point.x.abs() < 1e-9 && (p.point.y.abs() - 1.5).abs() < 1e-9 && p.point.z.abs() < 1e-9, "{found:?}");
    }
    let import = |text: &str| import_csg("a.csg", text, Facets::Auto, &Limits::default()).expect("a valid text").solid;
    let two = "multmatrix([[1,0,0,3],[0,1,0,0],[0,0,1,1],[0,0,0,1]]) { sphere(r = 0.5); }";
    let solid = import(&format!("hull() {{ sphere(r = 0.5); {two} }}"));
    assert!(matches!(&solid.primitives[..], [p] if matches!(p.shape, Shape::Capsule(_))), "{:?}", solid.primitives);
    // A rounded box: twelve capsules and what is between them.
    let rounded = import("minkowski() { cube([2, 3, 1]); sphere(r = 0.25); }");
    assert_eq!(rounded.primitives.len(), 13);
    let volume = 6.0 + 2.0 * (6.0 + 3.0 + 2.0) * 0.25 + 6.0 * PI * 0.0625 + 4.0 / 3.0 * PI * 0.015625;
    let m = mass_properties(&Model::new(rounded), &MassOptions { tolerance: 1e-3, boxes: 300_000 }).expect("bounded");
    assert!((m.volume - volume).abs() <= m.volume_error, "{} not {volume}", m.volume);
}
