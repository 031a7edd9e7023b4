//! Least distances over a step against closed forms: bodies that slide, and bodies that turn.
//!
//! `CONTACTD_DISTANCES=1000` sets the number of pairs of each family (12 by default).

use contactd::contact::PlacedModel;
use contactd::contact::distance::{DEFAULT_LIMIT, Distance, DistanceQuery, over_step};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd_proto::{Motion, Pose};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3};

use crate::forms::{Tally, point_box, point_segment};

/// A pair and its least distance over a step.
#[derive(Clone)]
struct Known {
    a: (Recipe, Motion),
    b: (Recipe, Motion),
    distance: f64,
}

type Family = fn(&mut Random) -> Known;

fn ask(known: &Known) -> Distance {
    let models = [&known.a, &known.b].map(|(recipe, _)| Model::new(recipe.build()));
    let placed = |motion| Placed { place: Pose::IDENTITY, motion };
    let query = DistanceQuery {
        a: PlacedModel { model: &models[0], placed: placed(known.a.1) },
        b: PlacedModel { model: &models[1], placed: placed(known.b.1) },
        tolerance: 1e-9,
        limit: DEFAULT_LIMIT,
    };
    over_step(&query)
}

fn moving(start: Pose, velocity: DVec3, spin: DVec3) -> Motion {
    Motion { start, velocity, spin }
}

fn rest(at: Pose) -> Motion {
    Motion::resting(at)
}

/// Two balls that slide past each other, one of them spinning.
fn sliding_balls(r: &mut Random) -> Known {
    let (p, q) = (r.within(0.1, 0.6), r.within(0.1, 0.6));
    let (start, way) = (r.direction() * r.within(2.0, 4.0), r.vector(2.0));
    let distance = (point_segment(DVec3::ZERO, start, start + way) - p - q).max(0.0);
    let other = r.vector(0.5);
    let a = moving(Pose::IDENTITY, other, r.vector(2.0));
    let b = moving(Pose::at(start), other + way, DVec3::ZERO);
    Known { a: (Recipe::sphere(p), a), b: (Recipe::sphere(q), b), distance }
}

/// A ball off a centre that turns by an angle about z, against a ball that rests: the distance of a point from an arc.
fn arc_and_ball(r: &mut Random) -> Known {
    let (p, q, arm) = (r.within(0.1, 0.3), r.within(0.1, 0.3), r.within(0.5, 1.5));
    let (angle, x) = (r.within(0.3, 5.5), r.direction() * r.within(2.2, 3.5));
    let to = x.y.atan2(x.x).rem_euclid(std::f64::consts::TAU);
    let at = |t: f64| (x - DVec3::new(arm * t.cos(), arm * t.sin(), 0.0)).length();
    let least = if to <= angle { at(to) } else { at(0.0).min(at(angle)) };
    let frame = Pose::new(r.vector(1.0), r.rotation());
    let a = moving(frame, DVec3::ZERO, frame.vector(DVec3::Z * angle));
    Known {
        a: (Recipe::sphere(p).at(arm, 0.0, 0.0), a),
        b: (Recipe::sphere(q), rest(Pose::at(frame.point(x)))),
        distance: least - p - q,
    }
}

/// A rod that turns about its end, against a ball in the plane of its turn or off it.
fn rod_and_ball(r: &mut Random) -> Known {
    let (p, q, long) = (r.within(0.05, 0.1), r.within(0.1, 0.3), r.within(0.5, 1.5));
    let angle = r.within(0.3, 3.0);
    let x = DVec3::new(r.within(-2.0, 2.0), r.within(-2.0, 2.0), r.within(0.5, 1.0));
    let rod = Recipe::capsule(0.5 * long, p)
        .moved(&Pose::new(DVec3::X * 0.5 * long, DQuat::from_rotation_y(0.5 * std::f64::consts::PI)));
    // The rod's points make a sector of a disc: what is nearest is above it, or on its rim.
    let to = x.y.atan2(x.x).rem_euclid(std::f64::consts::TAU);
    let rod_at = |t: f64| point_segment(x, DVec3::ZERO, DVec3::new(long * t.cos(), long * t.sin(), 0.0));
    let least = if to <= angle { rod_at(to) } else { rod_at(0.0).min(rod_at(angle)) };
    let a = moving(Pose::IDENTITY, DVec3::ZERO, DVec3::Z * angle);
    Known { a: (rod, a), b: (Recipe::sphere(q), rest(Pose::at(x))), distance: (least - p - q).max(0.0) }
}

/// A box that slides past a ball: the distance of a segment from a box is the least over the way.
fn box_past_a_ball(r: &mut Random) -> Known {
    let (half, q) = (r.vector(0.6).abs() + 0.2, r.within(0.1, 0.3));
    let (start, way) = (r.direction() * r.within(2.0, 3.0), r.vector(2.5));
    // Convex along the way: ternary search.
    let at = |t: f64| point_box(start + way * t, half);
    let (mut lo, mut hi) = (0.0, 1.0);
    for _ in 0..200 {
        let (p, q) = (lo + (hi - lo) / 3.0, hi - (hi - lo) / 3.0);
        if at(p) < at(q) { hi = q } else { lo = p }
    }
    let distance = (at(0.5 * (lo + hi)).min(at(0.0)).min(at(1.0)) - q).max(0.0);
    let b = moving(Pose::at(start), way, DVec3::ZERO);
    Known { a: (Recipe::cuboid(half.x, half.y, half.z), rest(Pose::IDENTITY)), b: (Recipe::sphere(q), b), distance }
}

/// A pin that turns and slides along the axis of its hole: as near to the wall all the time.
fn pin_that_turns(r: &mut Random) -> Known {
    let (hole, gap) = (r.within(0.5, 1.0), r.within(0.01, 0.1));
    let plate = Recipe::cuboid(2.0, 2.0, 1.0).minus(Recipe::cylinder(hole, 1.5));
    let off = r.within(0.0, 0.9) * gap;
    let b = moving(Pose::at(DVec3::X * off), DVec3::Z * 0.3, DVec3::Z * r.within(0.5, 3.0));
    Known { a: (plate, rest(Pose::IDENTITY)), b: (Recipe::cylinder(hole - gap, 0.5), b), distance: gap - off }
}

const FAMILIES: &[(&str, Family)] = &[
    ("sliding balls", sliding_balls),
    ("arc and ball", arc_and_ball),
    ("rod and ball", rod_and_ball),
    ("box past a ball", box_past_a_ball),
    ("pin that turns", pin_that_turns),
];

#[test]
fn least_distances_over_a_step_are_those_of_closed_forms() {
    let count = sized("CONTACTD_DISTANCES", 12usize);
    let mut failures = Vec::new();
    for (name, family) in FAMILIES {
        let mut tally = Tally::new(name);
        for i in 0..count {
            let known = family(&mut Random::new(500 + i as u64));
            let truth = known.distance;
            // The way of one body seen from the other is bent for the one that turns and not for the other: asked both ways.
            let turned = Known { a: known.b.clone(), b: known.a.clone(), distance: truth };
            for known in [known, turned] {
                let d = ask(&known);
                tally.take(i, truth, 1e-8, &d, (0.0..=1.0).contains(&d.time));
            }
        }
        tally.tell(&mut failures);
    }
    assert!(failures.is_empty(), "{} wrong, such as {:#?}", failures.len(), &failures[..failures.len().min(6)]);
}
