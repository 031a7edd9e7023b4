//! Broad phase: which boxes meet. A tree of boxes, halved at the median of their centres, walked against itself.
//!
//! Built anew for each run, it costs n log n and finds k pairs in about n + k tests whatever the boxes' spread; pairs of
//! static boxes are not looked for, down to whole branches of them. Boxes without end are in no tree and meet all others.
//! Source: S. Gottschalk, M. C. Lin, D. Manocha, OBBTree (1996), section 4, with axis-aligned boxes; one tree for all.
//! Invariant: every pair of boxes with a common point that are not both static is reported once. It does not promise an
//! order.

use crate::math::Aabb;

/// Boxes in a leaf.
const LEAF: usize = 6;

/// A branch: the boxes `start..end` of the order, with the box around them; children follow, the first right behind.
#[derive(Clone, Copy, Debug)]
struct Branch {
    aabb: Aabb,
    start: u32,
    end: u32,
    /// Index of the second child; 0 in a leaf.
    second: u32,
    /// Some of its boxes move.
    moves: bool,
}

/// The tree and its memory.
#[derive(Clone, Debug, Default)]
pub struct BroadPhase {
    order: Vec<u32>,
    branches: Vec<Branch>,
    stack: Vec<(u32, u32)>,
    endless: Vec<u32>,
    /// Pairs of boxes compared in the last run, those of branches included.
    pub tests: u64,
}

impl BroadPhase {
    /// Calls `pair(i, j)` for every two boxes that share a point and are not both static.
    pub fn run(&mut self, boxes: &[Aabb], is_static: impl Fn(usize) -> bool, mut pair: impl FnMut(u32, u32)) {
        let Self { order, branches, stack, endless, tests } = self;
        branches.clear();
        order.clear();
        endless.clear();
        for (i, b) in boxes.iter().enumerate().filter(|(_, b)| !b.is_empty()) {
            if b.is_finite() { order.push(i as u32) } else { endless.push(i as u32) }
        }
        *tests = 0;
        let mut test = |i: u32, j: u32| {
            if is_static(i as usize) && is_static(j as usize) {
                return;
            }
            *tests += 1;
            if boxes[i as usize].meets(&boxes[j as usize]) {
                pair(i, j);
            }
        };
        for (k, i) in endless.iter().enumerate() {
            order.iter().chain(&endless[k + 1..]).for_each(|j| test(*i, *j));
        }
        if order.is_empty() {
            return;
        }
        grow(branches, order, 0, boxes, &is_static);
        stack.push((0, 0));
        let mut crossed = 0;
        while let Some((p, q)) = stack.pop() {
            let (a, b) = (branches[p as usize], branches[q as usize]);
            if !(a.moves || b.moves) {
                continue;
            }
            if p == q {
                if a.second == 0 {
                    for k in a.start..a.end {
                        (k + 1..a.end).for_each(|l| test(order[k as usize], order[l as usize]));
                    }
                } else {
                    stack.extend([(p + 1, p + 1), (a.second, a.second), (p + 1, a.second)]);
                }
                continue;
            }
            crossed += 1;
            if !a.aabb.meets(&b.aabb) {
                continue;
            }
            match (a.second, b.second) {
                (0, 0) => {
                    for k in a.start..a.end {
                        (b.start..b.end).for_each(|l| test(order[k as usize], order[l as usize]));
                    }
                }
                (second, other) if other == 0 || second != 0 && a.end - a.start >= b.end - b.start => {
                    stack.extend([(p + 1, q), (second, q)]);
                }
                (_, second) => stack.extend([(p, q + 1), (p, second)]),
            }
        }
        *tests += crossed;
    }
}

/// Appends the branch of `order`, which begins at `start` of the whole order.
fn grow(branches: &mut Vec<Branch>, order: &mut [u32], start: u32, boxes: &[Aabb], is_static: &impl Fn(usize) -> bool) {
    let at = branches.len();
    let mut aabb = Aabb::EMPTY;
    let mut centers = Aabb::EMPTY;
    let mut moves = false;
    for i in order.iter() {
        let b = &boxes[*i as usize];
        let c = b.center();
        aabb = aabb.union(b);
        centers = centers.union(&Aabb::new(c, c));
        moves |= !is_static(*i as usize);
    }
    branches.push(Branch { aabb, start, end: start + order.len() as u32, second: 0, moves });
    if order.len() <= LEAF {
        return;
    }
    let spread = centers.max - centers.min;
    let axis = spread.max_position();
    let middle = order.len() / 2;
    let along = |i: &u32| boxes[*i as usize].center()[axis];
    order.select_nth_unstable_by(middle, |i, j| along(i).total_cmp(&along(j)).then(i.cmp(j)));
    let (first, second) = order.split_at_mut(middle);
    grow(branches, first, start, boxes, is_static);
    branches[at].second = branches.len() as u32;
    grow(branches, second, start + middle as u32, boxes, is_static);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use glam::DVec3;

    #[test]
    fn it_finds_what_comparing_all_finds() {
        for seed in 0..40 {
            let mut numbers = Random(seed);
            let mut n = || numbers.unit();
            let mut boxes: Vec<Aabb> = (0..120)
                .map(|_| {
                    // Coordinates on a coarse grid, so that sides coincide often.
                    let c = DVec3::new(n(), n(), n()) * 12.0;
                    Aabb::around(c.round(), (DVec3::new(n(), n(), n()) * 2.0).round())
                })
                .collect();
            boxes[3] = Aabb::ALL;
            boxes[5] = Aabb::EMPTY;
            let is_static = |i: usize| i.is_multiple_of(3);
            let mut found = Vec::new();
            BroadPhase::default().run(&boxes, is_static, |i, j| found.push((i.min(j) as usize, i.max(j) as usize)));
            found.sort_unstable();
            let mut all = Vec::new();
            for i in 0..boxes.len() {
                for j in i + 1..boxes.len() {
                    if boxes[i].meets(&boxes[j]) && !(is_static(i) && is_static(j)) {
                        all.push((i, j));
                    }
                }
            }
            assert_eq!(found, all, "seed {seed}");
            assert!(all.len() > 50);
        }
    }

    #[test]
    fn tests_a_pair_hardly_grow_with_the_number_of_boxes() {
        let tests = |count: usize| {
            let mut numbers = Random(count as u64);
            let mut n = || numbers.unit();
            let side = (count as f64).cbrt();
            let mut at = || DVec3::new(n(), n(), n()) * side;
            let boxes: Vec<Aabb> = (0..count).map(|_| Aabb::around(at(), DVec3::splat(0.5))).collect();
            let mut broad = BroadPhase::default();
            let mut found = 0u32;
            broad.run(&boxes, |_| false, |_, _| found += 1);
            assert!(found as usize > count, "{found} pairs of {count}");
            broad.tests as f64 / f64::from(found)
        };
        let (few, many) = (tests(5_000), tests(100_000));
        println!("{few:.1} tests a pair found, {many:.1} among twenty times as many boxes");
        assert!(many < 1.3 * few, "{few} tests a pair found, {many} among twenty times as many boxes");
    }

    #[test]
    fn a_thousand_scattered_boxes_cost_far_less_than_all_pairs() {
        let mut numbers = Random(1);
        let mut n = || numbers.unit();
        let boxes: Vec<Aabb> =
            (0..1000).map(|_| Aabb::around(DVec3::new(n(), n(), n()) * 20.0, DVec3::splat(0.5))).collect();
        let mut broad = BroadPhase::default();
        let mut found = 0;
        broad.run(&boxes, |_| false, |_, _| found += 1);
        assert!(found > 20 && broad.tests < 499_500 / 8, "{found} pairs, {} tests", broad.tests);
    }
}
