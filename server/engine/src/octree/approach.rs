//! When could two moving cubes meet? A proven lower bound of the first such time.
//!
//! Conservative advancement on separating planes: at time t the direction n, among both cubes' axes and the line of
//! centres, leaves the widest gap g between the cubes. With n held fixed in B's frame, the gap at t + dt is at least
//!
//! ```text
//! g − s·dt − ½·q·dt²,   s = −n·v(c) + |n×Omega|·r   (c, r: centre and radius of A's cube; v(c): its velocity against B)
//! ```
//!
//! with q from `motion::Bounds::curvature`; so nothing meets before its first zero, and the search goes on there. A cube
//! that recedes or slides along a plane is done in one step, however long.
//!
//! Not promised: the time itself. After `MAX_STEPS` steps, or where no direction leaves a gap, the time reached is
//! returned; cubes that pass each other closely are then taken to meet.

use crate::math::tolerance::CARRIED;
use crate::motion::{Instant, Placed, Relative};
use glam::DVec3;

/// Steps at most; a pair that needs more is better decomposed.
const MAX_STEPS: usize = 12;

/// A step below this fraction of the span is no progress worth another one.
const LEAST_STEP: f64 = 1e-3;

/// The approach of two models over a step.
#[derive(Clone, Copy, Debug)]
pub struct Approach {
    relative: Relative,
    margin: f64,
    /// Largest of the coordinates that every carried point comes with.
    offset: f64,
}

/// A cube of a model's frame: centre and half side.
pub type Cube = (DVec3, f64);

impl Approach {
    /// The approach of `b` to `a`; cubes closer than `margin` (a length) count as meeting.
    pub fn new(a: Placed, b: Placed, margin: f64) -> Self {
        let relative = Relative::new(a, b);
        let d = relative.difference(0.0).length().max(relative.difference(1.0).length());
        let turn = 1.0 + a.motion.spin.length() + b.motion.spin.length();
        Self { relative, margin, offset: (d + a.place.position.length() + b.place.position.length()) * turn }
    }

    /// The motion behind it.
    pub fn relative(&self) -> &Relative {
        &self.relative
    }

    /// A lower bound, at least `t`, of the first time in [t, end] at which a cube of A's frame and one of B's frame meet;
    /// `None` when they don't.
    pub fn earliest(&self, a: Cube, b: Cube, t: f64, end: f64) -> Option<f64> {
        self.earliest_from(a, b, &self.relative.at(t), end)
    }

    /// The same from an instant on that many pairs of cubes begin with.
    pub fn earliest_from(&self, a: Cube, b: Cube, start: &Instant, end: f64) -> Option<f64> {
        let mut t = start.t;
        if !(a.1.is_finite() && b.1.is_finite()) {
            return Some(t);
        }
        let r = a.1 * 3f64.sqrt();
        let x_max = (a.0 - self.relative.center_a()).length() + r;
        let rounding = (self.offset + x_max + b.0.length() + b.1) * CARRIED;
        let span = end - t;
        let mut at = *start;
        for round in 0..MAX_STEPS {
            if round > 0 {
                at = self.relative.at(t);
            }
            let (gap, n) = widest_gap(&at, a, b);
            let gap = gap - self.margin - rounding;
            if gap <= 0.0 {
                return Some(t);
            }
            let h = end - t;
            let bounds = self.relative.bounds(t, h, x_max);
            let s = -n.dot(at.velocity(a.0)) + n.cross(at.omega).length() * r + bounds.slip;
            let q = bounds.curvature(&at, n) + bounds.bend;
            let step = first_zero(gap, s, q).max(gap / bounds.speed);
            if step > h {
                return None;
            }
            t += step;
            if step < LEAST_STEP * span {
                return Some(t);
            }
        }
        Some(t)
    }
}

/// The widest gap between the cubes over the directions tried, and its direction along A's model axes, from B to A.
fn widest_gap(at: &Instant, a: Cube, b: Cube) -> (f64, DVec3) {
    // d: from B's centre to A's, in A's axes; columns of `m`: A's axes in B; of its transpose: B's axes in A.
    let d = a.0 - at.a_point(b.0);
    let m = at.b_from_a;
    let axes_b = m.transpose();
    let reach = |n: DVec3| a.1 * l1(n) + b.1 * l1(m * n);
    let mut best = (f64::NEG_INFINITY, DVec3::X);
    let mut offer = |n: DVec3| {
        let along = n.dot(d);
        let n = if along < 0.0 { -n } else { n };
        let gap = along.abs() - reach(n);
        if gap > best.0 {
            best = (gap, n);
        }
    };
    for axis in [DVec3::X, DVec3::Y, DVec3::Z, axes_b.x_axis, axes_b.y_axis, axes_b.z_axis] {
        offer(axis);
    }
    if let Some(n) = d.try_normalize() {
        offer(n);
    }
    best
}

fn l1(n: DVec3) -> f64 {
    n.abs().element_sum()
}

/// First positive zero of g − s·dt − ½·q·dt² for g > 0, q >= 0; infinite when there is none.
fn first_zero(g: f64, s: f64, q: f64) -> f64 {
    let root = (s * s + 2.0 * q * g).sqrt();
    // The stable form of the quadratic's root: no cancellation whichever sign s has.
    if s + root > 0.0 { 2.0 * g / (s + root) } else { f64::INFINITY }
}
