//! Capsules against closed forms, against the search alone, and against every other kind.
//!
//! A capsule is all points within a radius of a segment, so how far it is from another one, from a ball or from a plane is told by
//! segments and points. What whole primitives are answered by in front of the search is held against the search alone. Pairs with the
//! other kinds have no closed form: their certificates are checked by the independent verifier.
//! `CONTACTD_PAIRS=10000 cargo test --release -p contactd-tests --test answers capsules:: -- --nocapture` sets the number of
//! pairs, and of trees.

use super::kinds::{Scene, alone, at_rest, compare, pairs, past, placed, speed, turning, values_and_volumes};
use contactd::contact::{Extent, Status};
use contactd::import::{Facets, Limits, import_csg};
use contactd::octree::Model;
use contactd::octree::mass::mass_properties;
use contactd::solid::Shape;
use contactd::solid::primitive::{Capsule, Cone, Cuboid, Cylinder, Polyhedron, Sphere};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{MassOptions, Motion, Pose};
use contactd_tests::certified::{certify_all, certify_trees};
use contactd_tests::engine::{SEARCH_ALONE, ask_with, differences};
use contactd_tests::random_solids::{Random, capsule, shape, shape_or_capsule};
use contactd_tests::scenes::Recipe;
use glam::{DVec3, dvec3};
use std::f64::consts::PI;

/// Resolutions of a gap at which a pair may count as touching.
const NEAR: f64 = 4.0;

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
    // From where A's line is next to B's: w + t v − s u square to both. Of all but parallel ones, where that is hardly known, any point
    // of A's is as near.
    let s = (u.dot(w) - u.dot(v) * v.dot(w)) / u.cross(v).length_squared();
    let x = a.point(DVec3::Z * s.clamp(-half_a, half_a));
    if x.is_finite() { least.min(from_segment(half_b, b.inverse().point(x))) } else { least }
}

#[test]
fn capsules_meet_each_other_balls_and_planes_when_closed_forms_say_so() {
    let count = pairs(60);
    compare("two capsules", (count, 1, NEAR), |r| {
        let (p, q) = (capsule(r, 1.0), capsule(r, 1.0));
        let motions = [turning(r), past(r, 2.8)];
        let speed = speed(&motions, 4.5);
        let (half_p, half_q, least) = (p.half, q.half, p.radius + q.radius);
        let gap = Box::new(move |a: &Pose, b: &Pose| between((a, half_p), (b, half_q)) - least);
        Scene { a: Recipe::of(p), b: Recipe::of(q), motions, gap, speed }
    });
    compare("capsule and a ball", (count, 2, NEAR), |r| {
        let (p, ball) = (capsule(r, 1.0), r.within(0.05, 0.6));
        let motions = [turning(r), past(r, 2.5)];
        let speed = speed(&motions, 4.0);
        let (half, least) = (p.half, p.radius + ball);
        let gap = Box::new(move |a: &Pose, b: &Pose| from_segment(half, a.inverse().point(b.position)) - least);
        Scene { a: Recipe::of(p), b: Recipe::sphere(ball), motions, gap, speed }
    });
    compare("capsule on a plane", (count, 3, NEAR), |r| {
        let p = capsule(r, 1.0);
        let floor = Recipe::cuboid(9.0, 9.0, 1.0).at(0.0, 0.0, -1.0);
        let motions = [past(r, 2.5), Motion::resting(Pose::new(r.vector(0.2), r.rotation()))];
        let (half, radius, speed) = (p.half, p.radius, speed(&motions, 2.0));
        let gap = Box::new(move |a: &Pose, b: &Pose| {
            let n = b.rotation * DVec3::Z;
            n.dot(a.position - b.position) - half * n.dot(a.rotation * DVec3::Z).abs() - radius
        });
        Scene { a: Recipe::of(p), b: floor, motions, gap, speed }.above_plane()
    });
    compare("ball in a hollow capsule", (count, 4, NEAR), |r| {
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

/// One of each kind that is answered in front of the search.
fn of_kind(r: &mut Random, kind: usize) -> Shape {
    let (a, b) = (r.within(0.2, 0.8), r.within(0.2, 0.8));
    match kind {
        0 => Sphere { radius: a }.into(),
        1 => Cylinder { radius: a, half_height: b }.into(),
        2 => Cone { bottom: a, top: [0.0, 0.4 * a][r.below(2)], half_height: b }.into(),
        3 => Cuboid { half: dvec3(a, b, r.within(0.2, 0.8)) }.into(),
        4 => Polyhedron::platonic([4, 6, 8, 12, 20][r.below(5)], a + 0.2).expect("a platonic count").into(),
        _ => capsule(r, 0.8).into(),
    }
}

#[test]
fn capsules_are_answered_in_front_of_the_search_as_by_it() {
    let count = pairs(30);
    for (kind, name) in ["ball", "cylinder", "cone", "box", "polyhedron", "capsule", "hole"].into_iter().enumerate() {
        let mut r = Random::new(70 + kind as u64);
        let in_hole = name == "hole";
        let (mut told, mut left, mut deeper, mut looser) = ([0; 4], 0, 0, 0);
        let (mut evaluations, mut differ) = (0, vec![]);
        for i in 0..count {
            let p = capsule(&mut r, 0.8);
            let (b, mut motions) = if in_hole {
                // Of any tilt that the hole allows, and on its way to the wall.
                let hole = Recipe::cylinder(p.radius * r.within(1.05, 2.0), 3.0);
                let still = Motion::resting(Pose::new(DVec3::ZERO, quat_of_rotation_vector(r.vector(0.05))));
                let b = Motion { velocity: r.vector(1.0), spin: r.vector(0.5), ..Motion::resting(Pose::IDENTITY) };
                (Model::new(Recipe::cuboid(2.0, 2.0, 1.0).minus(hole).build()), [still, b])
            } else {
                (alone(of_kind(&mut r, kind)), [turning(&mut r), past(&mut r, 2.2)])
            };
            let a = alone(p);
            // Every third only moves along.
            if i % 3 == 0 {
                motions.iter_mut().for_each(|m| m.spin = DVec3::ZERO);
            }
            let [of_a, of_b] = motions.map(placed);
            let by = |strategies| ask_with((&a, of_a), (&b, of_b), None, strategies);
            let (o, p) = (by(SEARCH_ALONE), by(contactd::contact::Strategies::default()));
            told[p.status() as usize] += 1;
            left += usize::from(p.counters.cells > 0 && p.status() != Status::Overlap);
            evaluations += p.counters.closed_forms;
            // What the search answers at another depth is another answer.
            if o.resolution != p.resolution {
                deeper += 1;
                continue;
            }
            // Of an overlap any point will do.
            if o.status() != Status::Overlap || p.status() != Status::Overlap {
                let mut all = differences(&o, &p, a.radius.max(b.radius));
                // Seldom a witness is found later than another one, a wider bracket of the same time, or the normal of nearly parallel
                // axes is a millionth off.
                let before = all.len();
                all.retain(|d| !d.starts_with("time_upper") && !d.starts_with("normal"));
                looser += usize::from(all.len() < before);
                differ.extend(all.into_iter().map(|d| format!("{i}: {d}")));
            }
        }
        let contacts = told[Status::Contact as usize];
        println!("{name}: {contacts} contacts of {count}, {left} left to the search, {evaluations} evaluations");
        assert!(differ.is_empty(), "{name}: {} differences\n{}", differ.len(), differ.join("\n"));
        assert!(contacts * 5 > count && left * 20 <= count, "{name}: {told:?}, {left} left to the search");
        assert!((deeper + looser) * 1000 <= count, "{name}: {deeper} at another depth, {looser} looser");
    }
}

#[test]
fn certificates_of_capsules_against_every_kind_and_of_trees_with_them_hold() {
    let count = pairs(20);
    certify_all("kinds", (count, 0xca_9501), |r| {
        let other = if r.chance(0.3) { capsule(r, 0.8).into() } else { shape(r, 0.8) };
        [(alone(capsule(r, 0.8)), placed(turning(r))), (alone(other), placed(past(r, 2.4)))]
    });
    certify_trees((count, 0xca_9501), shape_or_capsule);
}

#[test]
fn trees_with_capsules_have_the_values_and_the_volumes_of_an_independent_evaluation() {
    values_and_volumes(shape_or_capsule, (pairs(60).div_ceil(30).min(24), 3, pairs(60) * 10), [64, 41]);
}

#[test]
fn moments_of_capsules_are_those_of_their_formulas_and_of_their_halves() {
    let whole = |recipe: &Recipe, tolerance: f64| {
        mass_properties(&Model::new(recipe.build()), &MassOptions { tolerance, boxes: 300_000 }).expect("bounded")
    };
    let (c, exact) = (Recipe::capsule(1.0, 0.5), 0.5 * PI + PI / 6.0);
    let m = whole(&c, 1e-6);
    assert!(m.boxes == 0 && (m.volume - exact).abs() <= m.volume_error, "{m:?}");
    // About z: ½ m r² of the tube and ⅖ m r² of the caps. Across: ¼ m r² + ⅓ m h² of the tube; of each cap (2/5 − 9/64) m r² about
    // its own centre, which is h + ⅜ r off.
    let (tube, caps) = (0.5 * PI, PI / 6.0);
    let about = tube * 0.125 + caps * 0.1;
    let across = tube * (0.0625 + 1.0 / 3.0) + caps * ((0.4 - 9.0 / 64.0) * 0.25 + 1.1875 * 1.1875);
    for (k, i) in [(0, across), (1, across), (2, about)] {
        assert!((m.inertia[k] - i).abs() < 1e-12, "{m:?} {i}");
    }
    // Of the half above z = 0, half.
    let cut = c.minus(Recipe::cuboid(3.0, 3.0, 3.0).at(0.0, 0.0, -3.0));
    for tolerance in [0.1, 1e-2, 1e-3] {
        let half = whole(&cut, tolerance);
        assert!(half.boxes > 0 && (half.volume - 0.5 * exact).abs() <= half.volume_error, "{half:?}");
        assert!(half.volume_error <= tolerance * exact, "{half:?}");
    }
}

#[test]
fn a_capsule_touches_along_lines_and_circles_and_at_points() {
    let floor = || Recipe::cuboid(5.0, 5.0, 1.0).at(0.0, 0.0, -1.0);
    let rod = || Recipe::capsule(1.5, 0.5);
    // Its z axis lies along −y.
    let on_side = quat_of_rotation_vector(DVec3::X * (0.5 * PI));
    let lying = |y: f64| Pose::new(dvec3(0.0, y, 0.5), on_side);
    let line = |name: &str, a: Recipe, pose: Pose, [x, z]: [f64; 2], mut ends: [f64; 2]| {
        let found = at_rest(a, rod(), pose);
        assert!(found.len() == 1 && found[0].extent == Extent::Line && found[0].points.len() == 2, "{name}: {found:?}");
        let mut at = [found[0].points[0].point, found[0].points[1].point];
        at.sort_by(|p, q| p.y.total_cmp(&q.y));
        ends.sort_by(f64::total_cmp);
        for (p, y) in at.into_iter().zip(ends) {
            assert!((p - dvec3(x, y, z)).length() < 1e-9, "{name}: {found:?}");
        }
    };
    line("on a floor", floor(), lying(0.0), [0.0, 0.0], [-1.5, 1.5]);
    line("over the floor's edge", floor(), lying(4.0), [0.0, 0.0], [2.5, 5.0]);
    // Beside another one of twice its radius, 3-4-5: the line is a third of the way between the axes.
    let other = || Recipe::capsule(1.0, 1.0).moved(&Pose::new(DVec3::ZERO, on_side));
    let beside = Pose::new(dvec3(0.9, 0.3, 1.2), on_side);
    line("beside another", other(), beside, [0.6, 0.8], [-1.0, 1.0]);
    // In a slot of the same shape but longer it lies along the bottom.
    let slot = Recipe::cuboid(5.0, 5.0, 3.0).minus(Recipe::capsule(2.5, 0.75).moved(&Pose::new(DVec3::ZERO, on_side)));
    line("in a wider slot", slot, Pose::new(dvec3(0.0, 0.2, -0.25), on_side), [0.0, -0.75], [-1.3, 1.7]);
    // In a hole of its own shape: on the half of it that the block goes up to.
    let socket = floor().minus(Recipe::capsule(1.5, 0.5).moved(&Pose::new(DVec3::ZERO, on_side)));
    let found = at_rest(socket, rod(), Pose::new(DVec3::ZERO, on_side));
    assert!(found.len() == 1 && found[0].extent == Extent::Patch && found[0].points.len() == 8, "{found:?}");
    let rim = |x: DVec3, radius: f64| (x - dvec3(0.0, x.y.clamp(-1.5, 1.5), 0.0)).length() - radius;
    assert!(found[0].points.iter().all(|p| p.point.z.abs() < 1e-9 && rim(p.point, 0.5).abs() < 1e-9), "{found:?}");
    // A ball at the end of a trough lies on half a circle and leaves the straight rims there.
    let trough = floor().minus(Recipe::capsule(1.5, 0.3).moved(&Pose::new(DVec3::ZERO, on_side)));
    let found = at_rest(trough, Recipe::sphere(0.5), Pose::at(dvec3(0.0, 1.5, 0.4)));
    assert!(found.len() == 1 && found[0].extent == Extent::Line && found[0].points.len() >= 5, "{found:?}");
    assert!(found[0].points.iter().all(|p| p.point.y > 1.5 - 1e-9 && rim(p.point, 0.3).abs() < 1e-9), "{found:?}");
    // Upright in the rim of a hole, on its lower end: 3-4-5.
    let hole = floor().minus(Recipe::cylinder(0.4, 3.0));
    let found = at_rest(hole, rod(), Pose::at(dvec3(0.0, 0.0, 1.8)));
    assert!(found.len() == 1 && found[0].extent == Extent::Line, "{found:?}");
    assert!(found[0].points.iter().all(|p| (p.point.truncate().length() - 0.4).abs() < 1e-9), "{found:?}");
    // On its end, leaning.
    let leaning = quat_of_rotation_vector(DVec3::X * 0.3);
    let found = at_rest(floor(), rod(), Pose::new(leaning * DVec3::Z * 1.5 + DVec3::Z * 0.5, leaning));
    assert!(found.len() == 1 && found[0].extent == Extent::Point, "{found:?}");
    assert!(found[0].points[0].point.length() < 1e-9, "{found:?}");
    assert!((found[0].normal - DVec3::Z).length() < 1e-9, "{found:?}");
}

#[test]
fn hulls_of_two_balls_of_one_size_are_capsules() {
    let import = |text: &str| import_csg("a.csg", text, Facets::Auto, &Limits::default()).expect("a valid text").solid;
    let ball = |at: DVec3, radius: f64| {
        let [x, y, z] = at.to_array();
        format!("multmatrix([[1,0,0,{x:?}],[0,1,0,{y:?}],[0,0,1,{z:?}],[0,0,0,1]]) {{ sphere(r = {radius:?}); }}")
    };
    let mut r = Random::new(8);
    for i in 0..pairs(30) {
        // Nearly along an axis, too: nothing is lost there.
        let way = if i % 2 == 0 { r.vector(2.0) } else { DVec3::AXES[i % 3] * 2.0 + r.vector(1.0) * 1e-8 };
        let (from, radius) = (r.vector(1.0), r.within(0.1, 1.0));
        let solid = import(&format!("hull() {{ {} {} }}", ball(from, radius), ball(from + way, radius)));
        let [p] = &solid.primitives[..] else { panic!("{:?}", solid.primitives) };
        assert!(matches!(p.shape, Shape::Capsule(Capsule { .. })), "{p:?}");
        for _ in 0..100 {
            let x = from + r.vector(3.0);
            let along = ((x - from).dot(way) / way.length_squared()).clamp(0.0, 1.0);
            let exact = x.distance(from + way * along) - radius;
            assert!((solid.value(x) - exact).abs() < 4e-15, "{i} at {x}: {} {exact}", solid.value(x));
        }
    }
    // An upright one is cut in a circle.
    let upright = format!("hull() {{ {} {} }}", ball(-DVec3::Z, 0.5), ball(DVec3::Z, 0.5));
    let cut = format!("linear_extrude(height = 1) {{ projection(cut = true) {{ {upright} }} }}");
    let cut = import_csg("a.csg", &cut, Facets::Auto, &Limits::default()).expect("a valid text");
    assert!(cut.notes.iter().all(|n| !n.text.contains("faceted")), "{:?}", cut.notes);
    assert!(cut.solid.primitives.iter().any(|p| matches!(p.shape, Shape::Cylinder(_))), "{:?}", cut.solid.primitives);
    // Of more balls, or of balls of two sizes, it is no capsule.
    let scaled = |k: f64| format!("multmatrix([[{k},0,0,3],[0,{k},0,0],[0,0,{k},1],[0,0,0,1]]) {{ sphere(r = 0.5); }}");
    let two = import(&format!("hull() {{ sphere(r = 0.5); {} }}", scaled(2.0)));
    assert!(two.primitives.iter().all(|p| !matches!(p.shape, Shape::Capsule(_))), "{:?}", two.primitives);
    let rounded = import("minkowski() { cube([2, 3, 1]); sphere(r = 0.25); }");
    assert!(rounded.primitives.iter().all(|p| !matches!(p.shape, Shape::Capsule(_))), "{:?}", rounded.primitives);
}
