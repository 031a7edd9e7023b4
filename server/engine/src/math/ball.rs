//! Closed balls as bounds: unlike boxes they do not change under rotation.
//!
//! Every rule is conservative in floating point: radii are rounded outwards by `tolerance::OUTWARD` relative to the
//! lengths that entered, so a rule's result holds what it bounds although its own arithmetic rounds.

use super::{Aabb, tolerance::OUTWARD};
use glam::DVec3;

/// A closed ball; empty when `radius` is negative, unbounded when it is infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre.
    pub center: DVec3,
    /// Radius; negative means empty.
    pub radius: f64,
}

impl Ball {
    /// The ball without points.
    pub const EMPTY: Self = Self { center: DVec3::ZERO, radius: -1.0 };
    /// The ball of all points.
    pub const ALL: Self = Self { center: DVec3::ZERO, radius: f64::INFINITY };

    /// A ball from centre and radius.
    pub fn new(center: DVec3, radius: f64) -> Self {
        Self { center, radius }
    }

    /// A ball around points, about the middle of their box; at least one is needed.
    pub fn of_points(points: &[DVec3]) -> Self {
        let center = Aabb::of_points(points.iter().copied()).center();
        Self::new(center, points.iter().fold(0.0, |r: f64, p| r.max((*p - center).length())))
    }

    /// True when it holds no point.
    pub fn is_empty(&self) -> bool {
        self.radius < 0.0
    }

    /// The smallest ball around a box; unbounded for an unbounded box.
    pub fn of_box(b: &Aabb) -> Self {
        if b.is_empty() {
            return Self::EMPTY;
        }
        if !b.is_finite() {
            return Self::ALL;
        }
        let center = b.center();
        // The centre rounds too: the farther side of each axis counts.
        let reach = (b.max - center).max(center - b.min);
        Self { center, radius: reach.length() * (1.0 + OUTWARD) }
    }

    /// The box around the ball.
    pub fn aabb(&self) -> Aabb {
        if self.is_empty() {
            return Aabb::EMPTY;
        }
        if !self.radius.is_finite() {
            return Aabb::ALL;
        }
        let pad = (self.center.abs() + self.radius) * OUTWARD;
        Aabb::around(self.center, pad + self.radius)
    }

    /// The smallest ball around two balls.
    pub fn union(&self, other: &Self) -> Self {
        if self.is_empty() || other.radius == f64::INFINITY {
            return *other;
        }
        if other.is_empty() || self.radius == f64::INFINITY {
            return *self;
        }
        let (big, small) = if self.radius >= other.radius { (self, other) } else { (other, self) };
        let axis = small.center - big.center;
        let d = axis.length();
        if d + small.radius <= big.radius {
            // Inside up to rounding: let the radius cover what the comparison rounded away.
            return Self { center: big.center, radius: big.radius.max((d + small.radius) * (1.0 + OUTWARD)) };
        }
        let radius = 0.5 * (d + big.radius + small.radius);
        let center = big.center + axis * ((radius - big.radius) / d);
        Self { center, radius: radius * (1.0 + OUTWARD) + center.abs().max_element() * OUTWARD }
    }

    /// A ball around what two balls have in common: the ball around the lens' rim when the lens is less than half of
    /// both, otherwise the smaller of the two.
    pub fn intersection(&self, other: &Self) -> Self {
        if self.is_empty() || other.is_empty() {
            return Self::EMPTY;
        }
        let (small, big) = if self.radius <= other.radius { (self, other) } else { (other, self) };
        if big.radius == f64::INFINITY {
            return *small;
        }
        let (r, s) = (small.radius, big.radius);
        let axis = big.center - small.center;
        let d = axis.length();
        if d * (1.0 - OUTWARD) > r + s {
            return Self::EMPTY;
        }
        // x: distance of the rim's plane from the smaller ball's centre, towards the other one.
        let sum = d * d + r * r + s * s;
        let x = (d * d + (r - s) * (r + s)) / (2.0 * d);
        if !(x > 0.0 && x < d) {
            return *small;
        }
        let x_error = sum / d * OUTWARD;
        let rim2 = ((r - x) * (r + x)).max(0.0) + 2.0 * r * x_error + sum * OUTWARD;
        let center = small.center + axis * (x / d);
        let radius = rim2.sqrt() + x_error + center.abs().max_element() * OUTWARD;
        if radius < r { Self { center, radius } } else { *small }
    }

    /// True when ball and box share no point, rounding considered.
    pub fn misses(&self, b: &Aabb) -> bool {
        if self.is_empty() || b.is_empty() {
            return true;
        }
        let gap = (b.min - self.center).max(self.center - b.max).max(DVec3::ZERO);
        gap.length() * (1.0 - OUTWARD) > self.radius
    }
}
