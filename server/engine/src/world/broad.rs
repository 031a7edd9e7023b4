//! Broad phase: which boxes meet. A tree of boxes, halved at the median of their centres, walked against itself.
//!
//! Built anew it costs n log n and finds k pairs in about n + k tests whatever the boxes' spread; pairs of static boxes are
//! not looked for, down to whole branches of them. Boxes without end are in no tree and meet all others. Boxes that have moved
//! a little keep their places in the tree and only its boxes are fitted anew, until that takes noticeably more tests.
//! Source: S. Gottschalk, M. C. Lin, D. Manocha, OBBTree (1996), section 4, with axis-aligned boxes; one tree for all.
//! Invariant: every pair of boxes with a common point that are not both static is reported once. It does not promise an
//! order.

use crate::math::Aabb;
use glam::DVec3;

/// Boxes in a leaf.
const LEAF: usize = 6;
/// A tree is kept until its tests, with those that the pairs found need in any case, are more than this part of what they were
/// when it was built.
const WORN: f64 = 1.25;

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
    centers: Vec<DVec3>,
    keys: Vec<(f64, u32)>,
    /// How many boxes there were, and the tests a pair found, when the tree was built; 0: build it anew.
    boxes: usize,
    fresh: f64,
    /// Pairs of boxes compared in the last run, those of branches included.
    pub tests: u64,
}

impl BroadPhase {
    /// Calls `pair(i, j)` for every two boxes that share a point and are not both static.
    pub fn run(&mut self, boxes: &[Aabb], is_static: impl Fn(usize) -> bool, mut pair: impl FnMut(u32, u32)) {
        let is_new = !self.refit(boxes, &is_static);
        if is_new {
            self.build(boxes, &is_static);
        }
        let mut found = 0u64;
        self.walk(boxes, is_static, |i, j| {
            found += 1;
            pair(i, j);
        });
        let cost = self.tests as f64 / (found + boxes.len() as u64) as f64;
        if is_new {
            self.fresh = cost;
        } else if cost > WORN * self.fresh {
            self.boxes = 0;
        }
    }

    /// A tree of boxes that are asked about one by one.
    pub fn of(boxes: &[Aabb]) -> Self {
        let mut tree = Self::default();
        tree.build(boxes, &|_| false);
        tree
    }

    /// Calls `found(i)` for the boxes below the branches whose box `meets` says yes to, and for those without end.
    pub fn each(&self, meets: impl Fn(&Aabb) -> bool, mut found: impl FnMut(u32)) {
        self.endless.iter().for_each(|i| found(*i));
        let mut open = if self.order.is_empty() { Vec::new() } else { vec![0u32] };
        while let Some(at) = open.pop() {
            let branch = &self.branches[at as usize];
            if !meets(&branch.aabb) {
                continue;
            }
            if branch.second == 0 {
                self.order[branch.start as usize..branch.end as usize].iter().for_each(|i| found(*i));
            } else {
                open.extend([at + 1, branch.second]);
            }
        }
    }

    /// A new tree.
    fn build(&mut self, boxes: &[Aabb], is_static: &impl Fn(usize) -> bool) {
        let Self { order, branches, endless, centers, keys, .. } = self;
        branches.clear();
        order.clear();
        endless.clear();
        for (i, b) in boxes.iter().enumerate().filter(|(_, b)| !b.is_empty()) {
            if is_in_tree(b) { order.push(i as u32) } else { endless.push(i as u32) }
        }
        centers.clear();
        centers.extend(boxes.iter().map(Aabb::center));
        keys.resize(order.len(), (0.0, 0));
        if !order.is_empty() {
            grow(branches, order, keys, 0, centers);
        }
        self.fit(boxes, is_static);
        self.boxes = boxes.len();
    }

    /// Fits the tree to where its boxes are now; false when it has to be built anew.
    fn refit(&mut self, boxes: &[Aabb], is_static: &impl Fn(usize) -> bool) -> bool {
        let Self { order, endless, .. } = self;
        let same = self.boxes == boxes.len()
            && order.iter().all(|i| is_in_tree(&boxes[*i as usize]))
            && endless.iter().all(|i| !(boxes[*i as usize].is_empty() || is_in_tree(&boxes[*i as usize])))
            && order.len() + endless.len() == boxes.iter().filter(|b| !b.is_empty()).count();
        if same {
            self.fit(boxes, is_static);
        }
        same
    }

    /// The boxes around the branches, and whether they move.
    fn fit(&mut self, boxes: &[Aabb], is_static: &impl Fn(usize) -> bool) {
        let Self { order, branches, .. } = self;
        // Children stand behind their branch.
        for at in (0..branches.len()).rev() {
            let Branch { start, end, second, .. } = branches[at];
            let (aabb, moves) = if second == 0 {
                around(&order[start as usize..end as usize], boxes, is_static)
            } else {
                let (first, second) = (&branches[at + 1], &branches[second as usize]);
                (first.aabb.union(&second.aabb), first.moves || second.moves)
            };
            (branches[at].aabb, branches[at].moves) = (aabb, moves);
        }
    }

    /// Walks the tree against itself.
    fn walk(&mut self, boxes: &[Aabb], is_static: impl Fn(usize) -> bool, mut pair: impl FnMut(u32, u32)) {
        let Self { order, branches, stack, endless, tests, .. } = self;
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

/// Boxes without end or without a point are not.
fn is_in_tree(b: &Aabb) -> bool {
    b.is_finite() && !b.is_empty()
}

/// The box around some boxes, and whether any of them moves.
fn around(order: &[u32], boxes: &[Aabb], is_static: &impl Fn(usize) -> bool) -> (Aabb, bool) {
    let each = order.iter().map(|i| (&boxes[*i as usize], !is_static(*i as usize)));
    each.fold((Aabb::EMPTY, false), |(aabb, moves), (b, moving)| (aabb.union(b), moves || moving))
}

/// Appends the branch of `order`, which begins at `start` of the whole order. `keys` is memory of the same length.
fn grow(branches: &mut Vec<Branch>, order: &mut [u32], keys: &mut [(f64, u32)], start: u32, centers: &[DVec3]) {
    let at = branches.len();
    branches.push(Branch { aabb: Aabb::EMPTY, start, end: start + order.len() as u32, second: 0, moves: false });
    if order.len() <= LEAF {
        return;
    }
    let around = Aabb::of_points(order.iter().map(|i| centers[*i as usize]));
    let axis = (around.max - around.min).max_position();
    keys.iter_mut().zip(&*order).for_each(|(key, i)| *key = (centers[*i as usize][axis], *i));
    let middle = order.len() / 2;
    keys.select_nth_unstable_by(middle, |p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
    order.iter_mut().zip(&*keys).for_each(|(i, key)| *i = key.1);
    let ((first, second), (keys_first, keys_second)) = (order.split_at_mut(middle), keys.split_at_mut(middle));
    grow(branches, first, keys_first, start, centers);
    branches[at].second = branches.len() as u32;
    grow(branches, second, keys_second, start + middle as u32, centers);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

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
    fn a_tree_that_is_kept_while_its_boxes_move_finds_what_a_new_one_finds() {
        let mut numbers = Random(7);
        let mut n = || numbers.unit();
        let mut boxes: Vec<Aabb> =
            (0..300).map(|_| Aabb::around(DVec3::new(n(), n(), n()) * 8.0, DVec3::splat(0.5))).collect();
        let mut kept = BroadPhase::default();
        let (mut runs, mut refits) = (0, 0);
        let found = |broad: &mut BroadPhase, boxes: &[Aabb]| {
            let mut found = Vec::new();
            broad.run(boxes, |i| i % 4 == 0, |i, j| found.push((i.min(j), i.max(j))));
            found.sort_unstable();
            found
        };
        for step in 0..60 {
            for (i, b) in boxes.iter_mut().enumerate() {
                *b = match (step, i) {
                    // Now and then a box without end, an empty one, one more than before.
                    (20, 9) => Aabb::ALL,
                    (30, 9) => Aabb::EMPTY,
                    (40, 9) => Aabb::around(DVec3::ONE, DVec3::ONE),
                    _ if b.is_finite() && !b.is_empty() => {
                        Aabb::around(b.center() + (DVec3::new(n(), n(), n()) - 0.5) * 0.3, b.half())
                    }
                    _ => *b,
                };
            }
            if step == 50 {
                boxes.push(Aabb::around(DVec3::splat(4.0), DVec3::ONE));
            }
            let before = kept.order.clone();
            assert_eq!(found(&mut kept, &boxes), found(&mut BroadPhase::default(), &boxes), "step {step}");
            (runs, refits) = (runs + 1, refits + u32::from(kept.order == before));
        }
        assert!(refits > 30 && refits < runs, "{refits} of {runs}");
    }

    #[test]
    fn a_tree_whose_boxes_have_dispersed_is_built_anew() {
        let mut numbers = Random(2);
        let mut scatter =
            || -> Vec<Aabb> { (0..2000).map(|_| Aabb::around(numbers.vector(6.0) + 6.0, DVec3::splat(0.5))).collect() };
        let mut broad = BroadPhase::default();
        broad.run(&scatter(), |_| false, |_, _| {});
        let fresh = broad.tests;
        let boxes = scatter();
        // The order of before holds no longer: all branches are everywhere.
        broad.run(&boxes, |_| false, |_, _| {});
        let worn = broad.tests;
        broad.run(&boxes, |_| false, |_, _| {});
        assert!(worn > 5 * fresh && broad.tests < fresh + fresh / 4, "{fresh}, {worn}, {} tests", broad.tests);
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
