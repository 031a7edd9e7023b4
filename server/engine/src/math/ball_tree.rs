//! A tree of balls over many balls that do not move: which of them are near a point.
//!
//! Balls are split at the median of their centres along the longest axis, down to leaves of a few, each half again within
//! a ball. Every level halves every range, so the nodes lie in an array as in a heap: those below node i are 2i + 1 and 2i + 2,
//! and ranges follow from the way down.
//! Source: S. M. Omohundro, "Five balltree construction algorithms", ICSI TR-89-063, 1989.

use super::{Aabb, Ball, tolerance::OUTWARD};
use glam::DVec3;

/// Balls of a leaf at most.
const LEAF: usize = 8;

/// Balls, sorted into a tree.
#[derive(Clone, Debug)]
pub struct BallTree {
    /// Indices of the balls, by leaves.
    order: Vec<u32>,
    /// The nodes' balls; those of the lowest level are leaves.
    nodes: Vec<Ball>,
}

impl BallTree {
    /// The tree of some balls, which are known by their indices.
    pub fn new(balls: &[Ball]) -> Self {
        let levels = balls.len().div_ceil(LEAF).next_power_of_two().ilog2();
        let mut order: Vec<u32> = (0..balls.len() as u32).collect();
        let mut nodes = vec![Ball::EMPTY; (2 << levels) - 1];
        sort(balls, &mut order, 0, &mut nodes);
        Self { order, nodes }
    }

    /// Calls `look` with the index of every ball that holds `point` once it is grown by the reach, and with others near it, the
    /// nearer nodes first. The reach is what `look` returned last, before that infinite.
    pub fn visit(&self, point: DVec3, look: &mut impl FnMut(u32) -> f64) {
        let mut reach = f64::INFINITY;
        self.visit_below(0, &self.order, point, &mut reach, look);
    }

    fn visit_below(
        &self,
        node: usize,
        range: &[u32],
        point: DVec3,
        reach: &mut f64,
        look: &mut impl FnMut(u32) -> f64,
    ) {
        let ball = &self.nodes[node];
        let within = (ball.radius + *reach) * (1.0 + OUTWARD);
        if (point - ball.center).length_squared() > within * within {
            return;
        }
        let below = 2 * node + 1;
        if below >= self.nodes.len() {
            range.iter().for_each(|i| *reach = look(*i));
            return;
        }
        let (low, high) = range.split_at(range.len() / 2);
        let gap = |child: usize| (point - self.nodes[child].center).length() - self.nodes[child].radius;
        let mut halves = [(below, low), (below + 1, high)];
        if gap(below + 1) < gap(below) {
            halves.reverse();
        }
        for (child, range) in halves {
            self.visit_below(child, range, point, reach, look);
        }
    }
}

/// Sorts a range into the nodes below `node`.
fn sort(balls: &[Ball], range: &mut [u32], node: usize, nodes: &mut [Ball]) {
    let center = |i: &u32| balls[*i as usize].center;
    let around = Aabb::of_points(range.iter().map(center));
    // One ball about the middle of the centres holds them all.
    let middle = if around.is_empty() { DVec3::ZERO } else { around.center() };
    let reach = |i: &u32| (center(i) - middle).length() + balls[*i as usize].radius;
    nodes[node] =
        Ball::new(middle, range.iter().map(reach).fold(-1.0, f64::max) + middle.abs().max_element() * OUTWARD);
    let below = 2 * node + 1;
    if below >= nodes.len() {
        return;
    }
    let k = around.half().max_position();
    let half = range.len() / 2;
    range.select_nth_unstable_by(half, |i, j| center(i)[k].total_cmp(&center(j)[k]).then(i.cmp(j)));
    let (low, high) = range.split_at_mut(half);
    sort(balls, low, below, nodes);
    sort(balls, high, below + 1, nodes);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn every_ball_within_reach_is_visited_and_few_others() {
        let mut r = Random(7);
        for count in [1, 8, 9, 33, 1000, 4096] {
            let size = (count as f64).cbrt();
            let balls: Vec<Ball> = (0..count).map(|_| Ball::new(r.vector(size), r.within(0.0, 0.5))).collect();
            let tree = BallTree::new(&balls);
            for _ in 0..200 {
                let (point, reach) = (r.vector(1.5 * size), r.within(0.0, 0.5));
                let mut seen = vec![0; count];
                tree.visit(point, &mut |i| {
                    seen[i as usize] += 1;
                    reach
                });
                for (ball, seen) in balls.iter().zip(&seen) {
                    assert!(*seen == 1 || *seen == 0 && (point - ball.center).length() >= ball.radius + reach);
                }
                assert!(seen.iter().sum::<i32>() <= 300, "{count}");
            }
        }
    }

    #[test]
    fn the_nearest_ball_of_thousands_takes_a_few_looks() {
        let mut r = Random(8);
        let balls: Vec<Ball> = (0..10_000).map(|_| Ball::new(r.vector(50.0).with_z(0.0), 0.1)).collect();
        let tree = BallTree::new(&balls);
        let mut looks = 0;
        for _ in 0..1000 {
            let point = r.vector(50.0).with_z(1.0);
            let mut best = f64::INFINITY;
            tree.visit(point, &mut |i| {
                looks += 1;
                best = best.min((point - balls[i as usize].center).length() - 0.1);
                best
            });
            let nearest = balls.iter().map(|b| (point - b.center).length() - 0.1).fold(f64::INFINITY, f64::min);
            assert_eq!(best, nearest);
        }
        assert!(looks < 40 * 1000, "{looks}");
    }
}
