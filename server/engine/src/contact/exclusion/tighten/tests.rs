//! Where a cell is cut off there is no contact: the trees' own values say so, which know nothing of planes.

use crate::contact::exclusion::clause::{self, Expressions};
use crate::contact::exclusion::enumeration::advance_or_tighten;
use crate::contact::query::task::Task;
use crate::contact::testing::random_query;
use crate::math::Aabb;
use crate::math::random::Random;
use crate::octree::testing::random_tree;
use glam::DVec3;

#[test]
fn what_is_cut_off_holds_no_contact() {
    let mut r = Random(23);
    let (mut beyond, mut beyond_always, mut none, mut later) = (0, 0, 0, 0);
    for _ in 0..150 {
        let (a, b) = (random_tree(&mut r, 2), random_tree(&mut r, 2));
        let query = random_query(&a, &b, &mut r);
        let (task, _) = Task::of(&query);
        if task.a.is_void() || task.b.is_void() {
            continue;
        }
        let mut scratch = clause::Scratch::default();
        for _ in 0..30 {
            let (center, half) = (r.vector(0.8), DVec3::new(r.unit(), r.unit(), r.unit()) * 0.4);
            let (t, h) = (0.5 * r.unit(), 0.5 * r.unit() * r.unit());
            let at = task.relative.at(t);
            let motion = task.relative.bounds(t, h, (center - at.center_a).length() + half.length());
            let view = task.view((center, half), &at, motion, &[]);
            let (of_a, of_b) = (task.a.literal_form(), task.b.literal_form());
            let split = of_a.len() as u32;
            let pool = [of_a, of_b].concat();
            let pair = Expressions { pool: &pool, a: (0, split), b: (split, pool.len() as u32) };
            // All of it is worth it.
            let Err(left) = advance_or_tighten(&view, &pair, &[], task.rounding, 1.0, &mut scratch) else { continue };
            let whole = Aabb::new(-half, half);
            assert!(left.always.is_empty() || whole.intersection(&left.always) == left.always);
            none += u32::from(left.span.is_empty());
            for _ in 0..30 {
                let y = DVec3::new(r.within(-1.0, 1.0), r.within(-1.0, 1.0), r.within(-1.0, 1.0)) * half;
                if left.span.contains(y) {
                    continue;
                }
                beyond += 1;
                for part in [0.0, r.unit(), 1.0] {
                    let then = task.relative.at(t + part * h);
                    let values = [task.a.value(center + y), task.b.value(then.b_point(center + y))];
                    assert!(values[0].max(values[1]) > -task.delta, "{values:?} at {y}, {part} of {h}");
                    later += u32::from(part > 0.0 && values[0] <= -task.delta);
                }
                if !left.always.contains(y) {
                    beyond_always += 1;
                    assert!(task.a.value(center + y) > -task.delta);
                }
            }
        }
    }
    // Enough of each: cut off by A alone, by B while it moves, and altogether.
    assert!(
        beyond > 18_000 && beyond_always > 7_000 && later > 3_500 && none > 350,
        "{beyond} {beyond_always} {later} {none}"
    );
}
