//! What a cell's bound says is what its recorded proofs say: every clause of the expressions is closed by one of them.

use super::*;
use crate::contact::query::options::QueryOptions;
use crate::contact::query::question::{PlacedModel, Strategies, default_resolution};
use crate::math::random::Random;
use crate::motion::Placed;
use crate::octree::testing::random_tree;
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};

#[test]
fn every_clause_is_closed_by_a_recorded_proof() {
    let mut r = Random(11);
    let (mut open, mut closings, mut joint) = (0, 0, 0);
    for _ in 0..300 {
        let (a, b) = (random_tree(&mut r, 3), random_tree(&mut r, 3));
        let motion = |r: &mut Random| Motion {
            start: Pose::new(r.vector(0.8), quat_of_rotation_vector(r.vector(2.0))),
            velocity: r.vector(0.5),
            spin: r.vector(0.5),
        };
        let (of_a, of_b) = (motion(&mut r), motion(&mut r));
        let query = PairQuery {
            a: PlacedModel { model: &a, placed: Placed { place: Pose::IDENTITY, motion: of_a } },
            b: PlacedModel { model: &b, placed: Placed { place: Pose::IDENTITY, motion: of_b } },
            resolution: default_resolution(&a, &b),
            cell_limit: 1000,
            strategies: Strategies::default(),
            query_options: QueryOptions::CONTACT,
        };
        let (task, _) = Task::of(&query);
        if task.a.is_void() || task.b.is_void() {
            continue;
        }
        let mut scratch = clause::Scratch::recording();
        for _ in 0..20 {
            let size = 0.3 * r.unit() * r.unit();
            let region = Aabb::around(r.vector(0.8), DVec3::splat(size));
            let cell = Open {
                region,
                t: r.unit(),
                started: true,
                a: task.a.literal_form(),
                b: task.b.literal_form(),
                reach: 1.0,
            };
            let mut maker = Maker { task: &task, end: 1.0, left: 0.0, hints: &[], scratch: &mut scratch };
            let (_, close, ..) = maker.span(&cell, 1.0 - cell.t, region.center(), region.half());
            match close {
                Some(close) if !close.is_empty() => {
                    assert!(closed(&close, &cell.a, &cell.b), "{close:?}");
                    closings += 1;
                    joint += u32::from(close.len() > 2);
                }
                _ => open += 1,
            }
        }
    }
    assert!(open > 200 && closings > 1500 && joint > 300, "{open} open, {closings} closed, {joint} by several");
}
