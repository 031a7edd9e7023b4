//! What a cell's literals leave of its box: bounds tightening, as branch and bound knows it (feasibility-based: Belotti, Lee, Liberti,
//! Margot and Wächter 2009, "Branching and bounds tightening techniques for non-convex MINLP", section 3).
//!
//! In a contact every literal of a clause is at most −delta, so where the linear bound of one that all clauses share is
//! positive there is none. With b + n·y <= 0 and the box's extents for all axes but k,
//!
//! ```text
//! n_k y_k <= −b − Σ_{j≠k} min(n_j y_j).
//! ```
//!
//! Of a list of alternatives the hull of what each leaves is left. A's literals stand still: what they leave is right at all
//! times. With those of B, whose bounds are concave in time, a point is left that either end of the span leaves.

use super::clause::{List, Run};
use super::literal::{Linear, Side};
use crate::math::Aabb;
use crate::solid::local::{self, Expression};
use glam::DVec3;

/// Slope along an axis below which a plane says nothing of it.
const LEAST_SLOPE: f64 = 1e-6;

/// What is left of a cell; offsets from its centre, rounding included. Empty where nothing is.
#[derive(Clone, Copy, Debug)]
pub struct Left {
    /// At all times, by the literals of A alone.
    pub always: Aabb,
    /// Over the view's span.
    pub span: Aabb,
}

impl Left {
    fn union(&self, other: &Self) -> Self {
        Self { always: self.always.union(&other.always), span: self.span.union(&other.span) }
    }

    /// The largest part of a half extent that is left on each axis, multiplied.
    pub fn part(of: &Aabb, half: DVec3) -> f64 {
        if of.is_empty() {
            return 0.0;
        }
        let left = of.half();
        (0..3).map(|k| if half[k] > 0.0 { (left[k] / half[k]).min(1.0) } else { 1.0 }).product()
    }
}

/// Part of a box that may be left at most where that is bounded in its stead.
pub const WORTH: f64 = 0.7;

/// How often a box is made smaller before it is bounded as it is.
pub const TIGHTENINGS: u32 = 4;

/// Makes a box what is left of it (offsets from its centre), where that is less.
pub fn shrink(center: &mut DVec3, half: &mut DVec3, left: &Aabb) {
    let (offset, rest) = (left.center(), left.half());
    let rounding = (center.abs() + offset.abs() + *half) * f64::EPSILON;
    for k in 0..3 {
        if left.min[k] > -half[k] || left.max[k] < half[k] {
            center[k] += offset[k];
            half[k] = rest[k] + rounding[k];
        }
    }
}

impl Run<'_, '_> {
    /// What the literals taken so far and the open lists leave of the cell.
    pub(super) fn left(&mut self) -> Left {
        let whole = Aabb::new(-self.view.half, self.view.half);
        let mut left = Left { always: whole, span: whole };
        for l in &self.scratch.lits {
            self.cut(&mut left, l);
        }
        self.scratch.checked += self.scratch.lits.len() as u64;
        for i in 0..self.scratch.ors.len() {
            if left.span.is_empty() {
                break;
            }
            let List { side, start, end, .. } = self.scratch.ors[i];
            left = self.left_by_any(side, (start, end), left);
        }
        left
    }

    /// What one alternative or another leaves.
    fn left_by_any(&mut self, side: Side, (start, end): (u32, u32), of: Left) -> Left {
        let mut hull = Left { always: Aabb::EMPTY, span: Aabb::EMPTY };
        let mut at = start;
        while at < end && (hull.always != of.always || hull.span != of.span) {
            let next = at + local::first(&self.pair.pool[at as usize..]).1 as u32;
            hull = hull.union(&self.left_by_all(side, (at, next), of));
            at = next;
        }
        hull
    }

    /// What expressions leave that all must hold.
    fn left_by_all(&mut self, side: Side, (start, end): (u32, u32), of: Left) -> Left {
        let (mut left, mut at) = (of, start);
        while at < end {
            let (e, n) = local::first(&self.pair.pool[at as usize..]);
            let next = at + n as u32;
            match e {
                Expression::Literal(id) => {
                    let made = self.made(side, id, at);
                    self.scratch.checked += 1;
                    self.cut(&mut left, &self.scratch.made[made]);
                }
                Expression::Part(_) => {}
                Expression::And(_) => left = self.left_by_all(side, (at + 1, next), left),
                Expression::Or(_) => left = self.left_by_any(side, (at + 1, next), left),
            }
            at = next;
        }
        left
    }

    /// Cuts off where a literal's bound stays positive.
    fn cut(&self, left: &mut Left, l: &Linear) {
        let motion = &self.view.motion;
        // Once for the bound, and once for what is worked out of it.
        let now = (l.bound - 2.0 * self.rounding, l.normal);
        if l.side == Side::A && l.other.is_none() {
            left.always = clipped(&left.always, now);
            left.span = clipped(&left.span, now);
            return;
        }
        let h = motion.h;
        let pull = l.q + motion.bend + if l.rigid { motion.curvature(self.view.at, l.normal) } else { 0.0 };
        let later = (now.0 + h * (l.rate - l.s - motion.slip) - 0.5 * h * h * pull, l.normal_ahead(h));
        left.span = clipped(&left.span, now).union(&clipped(&left.span, later));
    }
}

/// The box of what b + n·y <= 0 leaves of a box.
fn clipped(of: &Aabb, (b, n): (f64, DVec3)) -> Aabb {
    if of.is_empty() || b.is_nan() {
        return *of;
    }
    let least = (n * of.min).min(n * of.max);
    let total = b + least.element_sum();
    if total > 0.0 {
        return Aabb::EMPTY;
    }
    let mut left = *of;
    for k in 0..3 {
        if n[k].abs() < LEAST_SLOPE {
            continue;
        }
        let end = (least[k] - total) / n[k];
        if n[k] > 0.0 {
            left.max[k] = left.max[k].min(end);
        } else {
            left.min[k] = left.min[k].max(end);
        }
    }
    left
}

#[cfg(test)]
mod tests;
