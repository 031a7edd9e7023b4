//! Broad phase: which swept boxes meet. Sort and sweep along the axis on which the boxes spread most.
//!
//! Static boxes meet moving ones first, then moving ones each other; static boxes are never compared with each other.
//! Source: D. Baraff, Dynamic Simulation of Non-Penetrating Rigid Bodies (1992), section 2.4, in its sorting form.
//! Invariant: every pair of boxes with a common point is reported once. It does not promise an order.

use crate::math::Aabb;

/// A box in the sweep.
#[derive(Clone, Copy, Debug)]
struct Entry {
    low: f64,
    high: f64,
    index: u32,
}

/// The sweep and its memory.
#[derive(Clone, Debug, Default)]
pub struct BroadPhase {
    moving: Vec<Entry>,
    fixed: Vec<Entry>,
    /// Pairs of boxes compared in the last run.
    pub tests: u64,
}

impl BroadPhase {
    /// Calls `pair(i, j)` for every two boxes that share a point and are not both static.
    pub fn run(&mut self, boxes: &[Aabb], is_static: impl Fn(usize) -> bool, mut pair: impl FnMut(u32, u32)) {
        self.moving.clear();
        self.fixed.clear();
        self.tests = 0;
        let axis = widest_axis(boxes);
        for (i, b) in boxes.iter().enumerate() {
            if !b.is_empty() {
                let entry = Entry { low: b.min[axis], high: b.max[axis], index: i as u32 };
                if is_static(i) { self.fixed.push(entry) } else { self.moving.push(entry) }
            }
        }
        for list in [&mut self.moving, &mut self.fixed] {
            list.sort_unstable_by(|p, q| p.low.total_cmp(&q.low).then(p.index.cmp(&q.index)));
        }
        let tests = &mut self.tests;
        let mut test = |i: u32, j: u32| {
            *tests += 1;
            if boxes[i as usize].meets(&boxes[j as usize]) {
                pair(i, j);
            }
        };
        // Of two that overlap on the axis one starts within the other: found from whichever starts first.
        start_within(&self.fixed, &self.moving, true, &mut test);
        start_within(&self.moving, &self.fixed, false, &mut test);
        for (k, e) in self.moving.iter().enumerate() {
            for f in self.moving[k + 1..].iter().take_while(|f| f.low <= e.high) {
                test(e.index, f.index);
            }
        }
    }
}

/// For each of `hosts` the `guests` that start within it; with `ties`, also those that start exactly where it does.
fn start_within(hosts: &[Entry], guests: &[Entry], ties: bool, test: &mut impl FnMut(u32, u32)) {
    let mut from = 0;
    for h in hosts {
        let before = |g: &Entry| if ties { g.low < h.low } else { g.low <= h.low };
        while guests.get(from).is_some_and(before) {
            from += 1;
        }
        for g in guests[from..].iter().take_while(|g| g.low <= h.high) {
            test(h.index, g.index);
        }
    }
}

/// The axis on which the centres of the bounded boxes vary most.
fn widest_axis(boxes: &[Aabb]) -> usize {
    let (mut n, mut sum, mut square) = (0.0, glam::DVec3::ZERO, glam::DVec3::ZERO);
    for b in boxes.iter().filter(|b| b.is_finite()) {
        let c = b.center();
        n += 1.0;
        sum += c;
        square += c * c;
    }
    let spread = square - sum * sum / f64::max(n, 1.0);
    if spread.x >= spread.y && spread.x >= spread.z {
        0
    } else if spread.y >= spread.z {
        1
    } else {
        2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// Reproducible numbers in 0..1.
    fn numbers(seed: u64) -> impl FnMut() -> f64 {
        let mut s = seed;
        move || {
            s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (s >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    #[test]
    fn it_finds_what_comparing_all_finds() {
        for seed in 0..40 {
            let mut n = numbers(seed);
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
    fn a_thousand_scattered_boxes_cost_far_less_than_all_pairs() {
        let mut n = numbers(1);
        let boxes: Vec<Aabb> =
            (0..1000).map(|_| Aabb::around(DVec3::new(n(), n(), n()) * 20.0, DVec3::splat(0.5))).collect();
        let mut broad = BroadPhase::default();
        let mut found = 0;
        broad.run(&boxes, |_| false, |_, _| found += 1);
        assert!(found > 20 && broad.tests < 499_500 / 8, "{found} pairs, {} tests", broad.tests);
    }
}
