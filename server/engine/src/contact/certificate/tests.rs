//! What a cell's bound says is what its recorded proofs say: every clause of the expressions is closed by one of them.

use super::*;
use crate::contact::testing::random_query;
use crate::math::random::Random;
use crate::octree::testing::random_tree;

#[test]
fn every_clause_is_closed_by_a_recorded_proof() {
    let mut r = Random(11);
    let (mut open, mut closings, mut joint) = (0, 0, 0);
    for _ in 0..120 {
        let (a, b) = (random_tree(&mut r, 3), random_tree(&mut r, 3));
        let query = random_query(&a, &b, &mut r);
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
            let mut maker =
                Maker { task: &task, end: 1.0, left: 0.0, compact: false, hints: &[], scratch: &mut scratch };
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
    assert!(open > 80 && closings > 600 && joint > 120, "{open} open, {closings} closed, {joint} by several");
}
