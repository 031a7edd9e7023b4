//! What two boxes are told by their slabs, against the ways that know nothing of slabs.

use super::*;
use crate::contact::query::question::{self, default_resolution};
use crate::contact::{ContactKind, DEFAULT_CELL_LIMIT, Extent, QueryOptions, Status, Strategies};
use crate::math::random::Random;
use crate::motion::Placed;
use crate::octree::Model;
use crate::solid::primitive::Cuboid;
use crate::solid::{Label, Shape, SolidBuilder};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use glam::DQuat;
use std::f64::consts::FRAC_PI_2;

/// Two models of one primitive each, and how they move.
pub struct Bodies {
    models: [Model; 2],
    placed: [Placed; 2],
}

impl Bodies {
    /// Of two shapes, each in a frame of its model.
    pub fn new(shapes: [Shape; 2], frames: [Pose; 2], motions: [Motion; 2]) -> Self {
        let [s, t] = shapes;
        let models = [(s, frames[0]), (t, frames[1])].map(|(shape, frame)| {
            let mut b = SolidBuilder::new();
            let root = b.primitive(shape, frame, Label::default());
            Model::new(b.finish(root))
        });
        Self { models, placed: motions.map(|motion| Placed { place: Pose::IDENTITY, motion }) }
    }

    fn query(&self) -> PairQuery<'_> {
        let [a, b] = [0, 1].map(|k| question::PlacedModel { model: &self.models[k], placed: self.placed[k] });
        PairQuery {
            a,
            b,
            resolution: default_resolution(a.model, b.model),
            cell_limit: DEFAULT_CELL_LIMIT,
            strategies: Strategies::default(),
            query_options: QueryOptions::CONTACT,
        }
    }

    /// The pair in the order given, and what is looked at.
    pub fn with<R>(&self, look: impl FnOnce(&PrimitivePair) -> R) -> R {
        let query = self.query();
        let primitives = [0, 1].map(|k| self.models[k].solid.whole().expect("one primitive"));
        look(&PrimitivePair::new([&query.a, &query.b], primitives, query.resolution).expect("a sensible resolution"))
    }
}

/// A pose within `size`.
pub fn pose(numbers: &mut Random, size: f64) -> Pose {
    Pose::new(numbers.vector(size), quat_of_rotation_vector(numbers.vector(3.0)))
}

fn by_slabs(pair: &PrimitivePair) -> Option<Outcome> {
    let half = pair.primitives.map(|p| match &p.shape {
        Shape::Cuboid(c) => c.half,
        other => panic!("{other:?} is no box"),
    });
    let mut out = Outcome::clear(pair.delta);
    boxes::meet(pair, half, QueryOptions::CONTACT, &mut out).map(|()| out)
}

#[test]
fn slabs_tell_of_boxes_what_cutting_planes_tell() {
    let mut numbers = Random(21);
    let (mut hits, mut misses, mut left, mut left_aligned) = (0, 0, 0, 0);
    for i in 0..4000 {
        let shapes = [0, 1].map(|_| Cuboid { half: numbers.vector(0.4).abs() + 0.1 }.into());
        let frames = [0, 1].map(|_| if i % 2 == 0 { Pose::IDENTITY } else { pose(&mut numbers, 0.5) });
        // A third along each other or nearly so; of these some that move along an axis, or not at all against each other.
        let aligned = i % 3 == 0;
        let below = |count: usize, numbers: &mut Random| (numbers.unit() * count as f64) as usize;
        let base = numbers.vector(1.0);
        let motions = [0, 1].map(|k| {
            let mut start = pose(&mut numbers, 1.5);
            let mut velocity = numbers.vector(0.6) - start.position;
            if aligned {
                let quarters = DQuat::from_rotation_z(FRAC_PI_2 * below(4, &mut numbers) as f64);
                let tilt = [0.0, 1e-9, 1e-7, 1e-5, 1e-3, 1e-1][below(6, &mut numbers)] * numbers.vector(1.0);
                start.rotation = quat_of_rotation_vector(tilt) * quarters;
                velocity = match below(4, &mut numbers) {
                    0 => DVec3::X * numbers.within(-3.0, 3.0),
                    1 => DVec3::new(0.0, 1.0, -1.0) * numbers.within(-2.0, 2.0),
                    2 => base,
                    _ => velocity,
                };
                // A side of the one in the plane of a side of the other.
                if k == 1 && below(4, &mut numbers) == 0 {
                    start.position = DVec3::new(1.0, 0.5, 0.0);
                }
            }
            Motion::turning(start, start.position + velocity, DVec3::ZERO)
        });
        Bodies::new(shapes, frames, motions).with(|pair| {
            let start = Start::new(pair).expect("bounded");
            let Look::Apart(_) = start.look(&mut 0) else { return };
            let mut expected = Outcome::clear(pair.delta);
            let general = Straight::new(&start).expect("boxes").meet(QueryOptions::CONTACT, &mut expected);
            let reported = by_slabs(pair);
            left += u32::from(reported.is_none());
            left_aligned += u32::from(reported.is_none() && aligned);
            let (Some(reported), Some(())) = (reported, general) else { return };
            assert_eq!(reported.status(), expected.status(), "{i}: {reported:?}, {expected:?}");
            if reported.status() == Status::Clear {
                misses += 1;
                return;
            }
            hits += 1;
            // A grazing contact knows its place well and its time badly.
            let near = |t: f64, u: f64| (t - u).abs() * reported.point().unwrap().normal_speed <= 1e-13;
            let times = [(reported.time_lower(), expected.time()), (reported.time_upper(), expected.time_upper())];
            assert!(times.iter().all(|(t, u)| near(*t, *u)), "{i}: {reported:?}, {expected:?}");
            assert!(
                reported.point().unwrap().normal.distance(expected.point().unwrap().normal) <= 1e-13,
                "{i}: {reported:?}, {expected:?}"
            );
            assert!(
                reported.point().unwrap().point.distance(expected.point().unwrap().point) <= 1e-11,
                "{i}: {reported:?}, {expected:?}"
            );
            let features = |o: &Outcome| o.point().map(|p| (p.kind, p.extent, p.faces_a, p.faces_b));
            assert_eq!(features(&reported), features(&expected), "{i}");
        });
    }
    println!("{hits} hits, {misses} misses, {left} left to others; {} of them aligned", left_aligned);
    assert!(
        hits > 600 && misses > 600 && left - left_aligned < 20,
        "{hits} hits, {misses} misses, {left} left to others"
    );
}

/// A box on its corner falls on a block, the corner above a point of the block's edge or this far inside of it.
fn dropped(inside: f64) -> Bodies {
    let (block, on_corner) = (DVec3::new(1.0, 1.0, 0.5), DVec3::splat(0.3));
    let turned = Pose::new(DVec3::ZERO, quat_of_rotation_vector(DVec3::new(0.5, 0.7, 0.0)));
    let corners = (0..8).map(|k| on_corner * DVec3::from_array([0, 1, 2].map(|i| f64::from(k >> i & 1) * 2.0 - 1.0)));
    let lowest = corners.map(|c| turned.rotation * c).min_by(|p, q| p.z.total_cmp(&q.z)).expect("eight corners");
    let at = DVec3::new(1.0 - inside, 0.3, 1.0) - lowest;
    let motions =
        [Motion::resting(Pose::IDENTITY), Motion::turning(Pose::new(at, turned.rotation), at - DVec3::Z, DVec3::ZERO)];
    Bodies::new([block, on_corner].map(|half| Cuboid { half }.into()), [Pose::IDENTITY; 2], motions)
}

#[test]
fn a_corner_that_falls_on_an_edge_is_not_told_as_one_on_a_face() {
    let inside = dropped(1e-6).with(by_slabs).expect("a corner on a face");
    assert_eq!(inside.point().map(|p| (p.kind, p.extent)), Some((ContactKind::VertexFace, Extent::Point)));
    assert!((inside.time() - 0.5).abs() <= 1e-15 && inside.time_lower() <= inside.time());
    // What the answer is then: tests/tests/answers/by_hand.rs.
    assert!(dropped(0.0).with(by_slabs).is_none());
}
