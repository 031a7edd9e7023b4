//! Distances at an instant against closed forms: both bounds to 1e-9 of the size, both points where they say.
//!
//! `CONTACTD_DISTANCES=1000 cargo test --release -p contactd-tests --test distances closed:: -- --nocapture` sets the number of pairs of
//! each of the families (12 by default).

use crate::forms::{Box3, Tally, boxes, point_box, point_cylinder, point_turned, segments};
use contactd::contact::PlacedModel;
use contactd::contact::distance::{DEFAULT_LIMIT, Distance, DistanceQuery, at_instant};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::primitive::HalfSpace;
use contactd_proto::{Motion, Pose};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use contactd_tests::sweep::sized;
use glam::{DAffine3, DVec3};

/// A pair whose distance is known.
struct Known {
    a: Recipe,
    at_a: Pose,
    b: Recipe,
    at_b: Pose,
    distance: f64,
}

fn is_inside(recipe: &Recipe, x: DVec3, slack: f64) -> bool {
    recipe.clone().build().value(x) <= slack
}

fn ask(known: &Known) -> Distance {
    let models = [&known.a, &known.b].map(|r| Model::new(r.clone().build()));
    let placed = |at: Pose| Placed { place: Pose::IDENTITY, motion: Motion::resting(at) };
    let query = DistanceQuery {
        a: PlacedModel { model: &models[0], placed: placed(known.at_a) },
        b: PlacedModel { model: &models[1], placed: placed(known.at_b) },
        tolerance: 1e-10,
        limit: DEFAULT_LIMIT,
    };
    at_instant(&query, 0.0)
}

/// Both bodies turned and moved together: the distance stays.
fn moved(known: Known, r: &mut Random) -> Known {
    let frame = Pose::new(r.vector(2.0), r.rotation());
    let put = |p: Pose| Pose::new(frame.point(p.position), frame.rotation * p.rotation);
    Known { at_a: put(known.at_a), at_b: put(known.at_b), ..known }
}

type Family = fn(&mut Random) -> Known;

fn at(x: DVec3, r: &mut Random) -> Pose {
    Pose::new(x, r.rotation())
}

fn away(r: &mut Random) -> DVec3 {
    r.direction() * r.within(2.5, 4.0)
}

fn balls(r: &mut Random) -> Known {
    let (p, q, x) = (r.within(0.1, 1.0), r.within(0.1, 1.0), away(r));
    let (a, b) = (Recipe::sphere(p), Recipe::sphere(q));
    Known { a, at_a: at(DVec3::ZERO, r), b, at_b: at(x, r), distance: x.length() - p - q }
}

fn ball_box(r: &mut Random) -> Known {
    let (p, half, x) = (r.within(0.1, 1.0), r.vector(0.8).abs() + 0.1, away(r));
    let (a, b) = (Recipe::cuboid(half.x, half.y, half.z), Recipe::sphere(p));
    Known { a, at_a: Pose::IDENTITY, b, at_b: at(x, r), distance: point_box(x, half) - p }
}

fn ball_cylinder(r: &mut Random) -> Known {
    let (p, radius, half, x) = (r.within(0.1, 0.6), r.within(0.2, 1.2), r.within(0.2, 1.2), away(r));
    let (a, b) = (Recipe::sphere(p), Recipe::cylinder(radius, half));
    Known { a, at_a: at(x, r), b, at_b: Pose::IDENTITY, distance: point_cylinder(x, radius, half) - p }
}

fn ball_cone(r: &mut Random) -> Known {
    let (p, low, half, x) = (r.within(0.1, 0.6), r.within(0.2, 1.2), r.within(0.2, 1.2), away(r));
    let top = if r.chance(0.5) { 0.0 } else { r.within(0.1, 0.9) * low };
    let (a, b) = (Recipe::cone(low, top, half), Recipe::sphere(p));
    let outline = [(0.0, -half), (low, -half), (top, half), (0.0, half)];
    Known { a, at_a: Pose::IDENTITY, b, at_b: at(x, r), distance: point_turned(x, &outline) - p }
}

fn capsules(r: &mut Random) -> Known {
    let mut one = |x: DVec3| {
        let pose = if r.chance(0.2) { Pose::new(x, glam::DQuat::IDENTITY) } else { at(x, r) };
        let (half, radius) = (r.within(0.2, 1.0), r.within(0.1, 0.4));
        (half, radius, pose, [-half, half].map(|z| pose.point(DVec3::Z * z)))
    };
    let (p, q) = (one(DVec3::ZERO), one(DVec3::new(0.3, 0.4, 3.1)));
    let distance = segments(p.3, q.3) - p.1 - q.1;
    Known { a: Recipe::capsule(p.0, p.1), at_a: p.2, b: Recipe::capsule(q.0, q.1), at_b: q.2, distance }
}

fn two_boxes(r: &mut Random) -> Known {
    let mut one = |x: DVec3| {
        let pose = if r.chance(0.2) { Pose::new(x, glam::DQuat::IDENTITY) } else { at(x, r) };
        let half = r.vector(0.7).abs() + 0.1;
        (pose, Box3 { half, at: DAffine3::from_rotation_translation(pose.rotation, pose.position) })
    };
    let far = DVec3::new(2.5, 1.0, 1.2);
    let (p, q) = (one(DVec3::ZERO), one(far));
    let of = |b: &Box3| Recipe::cuboid(b.half.x, b.half.y, b.half.z);
    Known { a: of(&p.1), at_a: p.0, b: of(&q.1), at_b: q.0, distance: boxes(&p.1, &q.1) }
}

/// A ball in a hole of a plate, between its faces.
fn ball_in_a_hole(r: &mut Random) -> Known {
    let (hole, p) = (r.within(0.5, 2.0), r.within(0.05, 0.4));
    let off = r.direction().truncate().normalize() * if r.chance(0.2) { 0.0 } else { r.within(0.0, 0.99 * (hole - p)) };
    let plate = Recipe::cuboid(3.0, 3.0, 1.0).minus(Recipe::cylinder(hole, 1.5));
    let x = off.extend(r.within(-0.95, 0.95));
    Known { a: plate, at_a: Pose::IDENTITY, b: Recipe::sphere(p), at_b: at(x, r), distance: hole - p - off.length() }
}

/// A ball above the rim of a hole.
fn ball_above_a_rim(r: &mut Random) -> Known {
    let (hole, p) = (r.within(0.8, 1.5), r.within(0.05, 0.4));
    let plate = Recipe::cuboid(3.0, 3.0, 1.0).minus(Recipe::cylinder(hole, 1.5));
    let (rho, z) = (r.within(0.1, 0.9) * hole, 1.0 + p + r.within(0.01, 1.0));
    let x = (r.direction().truncate().normalize() * rho).extend(z);
    let distance = (hole - rho).hypot(z - 1.0) - p;
    Known { a: Recipe::sphere(p), at_a: at(x, r), b: plate, at_b: Pose::IDENTITY, distance }
}

/// A pin in a hole, leaning: its rims are nearest to the wall.
fn pin_in_a_hole(r: &mut Random) -> Known {
    let (hole, half) = (r.within(0.8, 1.2), r.within(0.2, 0.4));
    let (radius, lean) = (hole * r.within(0.5, 0.7), if r.chance(0.3) { 0.0 } else { r.within(0.0, 0.15) });
    let plate = Recipe::cuboid(3.0, 3.0, 1.0).minus(Recipe::cylinder(hole, 1.5));
    let off = r.within(0.0, 0.05);
    // Leaning in the plane of x and z, off along x: points of a rim are farthest from the hole's axis in that plane, or beside it.
    let (s, c) = f64::sin_cos(lean);
    let farthest = |end: f64| {
        // A rim's point at the angle t: (off + end·half·s + radius·cos t·c, radius·sin t); its distance from the axis is convex in cos t.
        let m = off + end * half * s;
        let at = |cos: f64| (m + radius * cos * c).powi(2) + radius * radius * (1.0 - cos * cos);
        let inner = m * c / (radius * s * s);
        let best = if s > 0.0 { inner.clamp(-1.0, 1.0) } else { 1.0_f64.copysign(m) };
        [-1.0, 1.0, best].into_iter().map(at).fold(0.0, f64::max).sqrt()
    };
    let distance = hole - farthest(-1.0).max(farthest(1.0));
    let pose = Pose::new(DVec3::X * off, glam::DQuat::from_rotation_y(lean));
    Known { a: plate, at_a: Pose::IDENTITY, b: Recipe::cylinder(radius, half), at_b: pose, distance }
}

/// A ball in a ball-shaped cavity.
fn ball_in_a_cavity(r: &mut Random) -> Known {
    let (hole, p) = (r.within(0.5, 1.2), r.within(0.05, 0.4));
    let x = r.direction() * if r.chance(0.2) { 0.0 } else { r.within(0.0, 0.99 * (hole - p)) };
    let block = Recipe::cuboid(2.0, 2.0, 2.0).minus(Recipe::sphere(hole));
    Known { a: Recipe::sphere(p), at_a: at(x, r), b: block, at_b: Pose::IDENTITY, distance: hole - p - x.length() }
}

fn ball_torus(r: &mut Random) -> Known {
    let (major, minor, p) = (r.within(0.7, 1.2), r.within(0.1, 0.4), r.within(0.05, 0.2));
    let x = loop {
        let x = r.vector(2.0);
        if (x.truncate().length() - major).hypot(x.z) > minor + p + 0.01 {
            break x;
        }
    };
    let distance = (x.truncate().length() - major).hypot(x.z) - minor - p;
    Known { a: Recipe::torus(major, minor), at_a: Pose::IDENTITY, b: Recipe::sphere(p), at_b: at(x, r), distance }
}

/// Something above z <= 0: its lowest point tells.
fn above_ground(r: &mut Random) -> Known {
    let height = r.within(2.0, 4.0);
    let pose = at(DVec3::new(r.within(-3.0, 3.0), r.within(-3.0, 3.0), height), r);
    let n = pose.rotation.conjugate() * DVec3::Z;
    let (p, q) = (r.within(0.1, 0.8), r.within(0.1, 0.8));
    let across = n.truncate().length();
    let (body, reach) = match r.below(5) {
        0 => (Recipe::sphere(p), p),
        1 => (Recipe::capsule(p, q), p * n.z.abs() + q),
        2 => (Recipe::cylinder(p, q), p * across + q * n.z.abs()),
        3 => (Recipe::torus(1.0, 0.3), across + 0.3),
        _ => (Recipe::cuboid(p, q, 0.4), p * n.x.abs() + q * n.y.abs() + 0.4 * n.z.abs()),
    };
    let distance = height - reach;
    Known { a: Recipe::of(HalfSpace), at_a: Pose::IDENTITY, b: body, at_b: pose, distance }
}

/// A union against a union: the least of four distances.
fn unions(r: &mut Random) -> Known {
    let centers: Vec<(DVec3, f64)> =
        (0..4).map(|i| (r.vector(0.6) + DVec3::X * (2.6 * (i / 2) as f64), r.within(0.1, 0.6))).collect();
    let of = |k: usize| {
        let leaf = |i: usize| Recipe::sphere(centers[i].1).moved(&Pose::at(centers[i].0));
        leaf(2 * k).union(leaf(2 * k + 1))
    };
    let mut distance = f64::INFINITY;
    for i in 0..2 {
        for j in 2..4 {
            distance = distance.min((centers[i].0 - centers[j].0).length() - centers[i].1 - centers[j].1);
        }
    }
    Known { a: of(0), at_a: Pose::IDENTITY, b: of(1), at_b: Pose::IDENTITY, distance: distance.max(0.0) }
}

const FAMILIES: &[(&str, Family)] = &[
    ("ball, ball", balls),
    ("box, ball", ball_box),
    ("ball, cylinder", ball_cylinder),
    ("cone, ball", ball_cone),
    ("capsule, capsule", capsules),
    ("box, box", two_boxes),
    ("ball in a hole", ball_in_a_hole),
    ("ball above a rim", ball_above_a_rim),
    ("pin in a hole", pin_in_a_hole),
    ("ball in a cavity", ball_in_a_cavity),
    ("torus, ball", ball_torus),
    ("above ground", above_ground),
    ("unions of balls", unions),
];

#[test]
fn distances_are_those_of_closed_forms() {
    let count = sized("CONTACTD_DISTANCES", 12usize);
    let mut failures = Vec::new();
    for (name, family) in FAMILIES {
        let mut tally = Tally::new(name);
        for i in 0..count {
            let mut r = Random::new(i as u64 + 1);
            let family_case = family(&mut r);
            let known = moved(family_case, &mut r);
            let d = ask(&known);
            let inside = |recipe: &Recipe, pose: Pose, x: DVec3| is_inside(recipe, pose.inverse().point(x), 1e-12);
            let in_both = inside(&known.a, known.at_a, d.a.point) && inside(&known.b, known.at_b, d.b.point);
            tally.take(i, known.distance, 1e-9, &d, in_both);
        }
        tally.tell(&mut failures);
    }
    assert!(failures.is_empty(), "{} wrong, such as {:#?}", failures.len(), &failures[..failures.len().min(6)]);
}
