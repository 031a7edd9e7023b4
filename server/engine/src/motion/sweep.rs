//! Where a moving box or ball can be, seen from another moving body, over a span of time.
//!
//! A point fixed in the mover, at distance X or less from the mover's centre of rotation, moves against the observer with
//! speed at most V and acceleration at most Acc (`Relative::bounds`):
//!
//! ```text
//! V   = max over the span's ends of |v0 − spin_o×d| + |omega|·X
//! Acc = (|omega|² + |omega×spin_o|)·X + |spin_o|·max over the ends of |spin_o×d − 2 v0|
//! ```
//!
//! On a piece of length h the point stays within min(V·h/2, Acc·h²/8) of the chord between its places at the piece's
//! ends; the chord lies in the box of both places. A box is the hull of its corners, so the swept box is the union over
//! the pieces of (box at the one end ∪ box at the other), grown by that much. Two more bounds hold at once, whatever the
//! spins (whole turns included), and are intersected: the path of the mover's centre of rotation grown by X, and the
//! ball of radius max |d| + X around the observer's centre of rotation.
//!
//! Not promised: the smallest box. The number of pieces is bounded, so many whole turns of the observer leave the ball.

use super::{Placed, Relative};
use crate::math::{Aabb, Ball, Oriented, tolerance::CARRIED, tolerance::OUTWARD};
use glam::DVec3;

/// A piece turns by no more than this angle (radians) unless `MAX_PIECES` says otherwise: the growth Acc·h²/8 is then
/// below 1% of X.
const PIECE_ANGLE: f64 = 0.25;

/// Pieces at most: two whole turns at `PIECE_ANGLE`.
const MAX_PIECES: f64 = 48.0;

/// The motion of a mover's model as an observer's model frame sees it.
#[derive(Clone, Copy, Debug)]
pub struct Sweep {
    relative: Relative,
    /// The mover's centre of rotation, mover's model frame.
    mover_center: DVec3,
    /// The observer's centre of rotation, observer's model frame.
    observer_center: DVec3,
    spin: f64,
    observer_spin: f64,
}

impl Sweep {
    /// The motion of `mover` in the model frame of `observer`.
    pub fn new(mover: Placed, observer: Placed) -> Self {
        let relative = Relative::new(mover, observer);
        Self {
            relative,
            mover_center: relative.center_a(),
            observer_center: Relative::new(observer, mover).center_a(),
            spin: (mover.motion.spin - observer.motion.spin).length(),
            observer_spin: observer.motion.spin.length(),
        }
    }

    /// A box around a box of the mover's model frame over [t0, t1], in the observer's model frame.
    pub fn of_box(&self, b: &Aabb, t0: f64, t1: f64) -> Aabb {
        if b.is_empty() {
            return Aabb::EMPTY;
        }
        if !b.is_finite() {
            return Aabb::ALL;
        }
        let (c, e) = (b.center(), b.half());
        // Farthest corner from the centre of rotation.
        let x = ((c - self.mover_center).abs() + e).length();
        let swept = self.pieces(x, t0, t1, |at| {
            let m = at.b_from_a;
            let half = m.x_axis.abs() * e.x + m.y_axis.abs() * e.y + m.z_axis.abs() * e.z;
            Aabb::around(at.b_point(c), half)
        });
        let center = self.pieces(0.0, t0, t1, |at| Aabb::of_points([at.b_point(self.mover_center)])).grown(x);
        self.finished(swept.intersection(&center), x, t0, t1)
    }

    /// A box around a ball of the mover's model frame over [t0, t1], in the observer's model frame.
    pub fn of_ball(&self, ball: &Ball, t0: f64, t1: f64) -> Aabb {
        if ball.is_empty() {
            return Aabb::EMPTY;
        }
        if !ball.radius.is_finite() {
            return Aabb::ALL;
        }
        let x = (ball.center - self.mover_center).length();
        let path = self.pieces(x, t0, t1, |at| Aabb::of_points([at.b_point(ball.center)])).grown(ball.radius);
        let center = self.pieces(0.0, t0, t1, |at| Aabb::of_points([at.b_point(self.mover_center)]));
        // A path is as thin as a point, and may lie on the very face of the other bound: rounding must not part them.
        let slack = self.rounding(x + ball.radius, t0, t1);
        self.finished(path.intersection(&center.grown(x + ball.radius + slack)), x + ball.radius, t0, t1)
    }

    /// A ball around a ball of the mover's model frame over [t0, t1], in the observer's model frame.
    pub fn around_ball(&self, ball: &Ball, t0: f64, t1: f64) -> Ball {
        if ball.is_empty() || !ball.radius.is_finite() {
            return *ball;
        }
        let path = Ball::of_box(&self.of_ball(&Ball { radius: 0.0, ..*ball }, t0, t1));
        Ball { radius: (path.radius + ball.radius) * (1.0 + OUTWARD), ..path }
    }

    /// A box along the mover's axes in the middle of [t0, t1] around a finite box of its model frame, in the observer's model
    /// frame. About that instant, with c the middle, e the half extents, ω and v as the mover's axes see them, a point goes
    /// |v_k(c)| + (|ω| × e)_k per unit of time along axis k (the products all positive), but for ½ Acc·dt².
    pub fn along_mover(&self, b: &Aabb, t0: f64, t1: f64) -> Oriented {
        let (c, e, h) = (b.center(), b.half(), t1 - t0);
        let at = self.relative.at(t0 + 0.5 * h);
        let x = ((c - self.mover_center).abs() + e).length();
        let bounds = self.relative.bounds(t0, h, x);
        let acceleration = (bounds.omega * bounds.omega + bounds.cross) * x + self.observer_spin * bounds.swing;
        let w = at.omega.abs();
        let turned = DVec3::new(w.y * e.z + w.z * e.y, w.z * e.x + w.x * e.z, w.x * e.y + w.y * e.x);
        let first = (at.velocity(c).abs() + turned + bounds.slip) * (0.5 * h) + 0.125 * acceleration * h * h;
        let way = first.min(DVec3::splat(0.5 * bounds.speed * h));
        let half = (e + way) * (1.0 + OUTWARD) + self.rounding(x, t0, t1);
        Oriented { center: at.b_point(c), axes: at.b_from_a, half }
    }

    /// The union over the pieces of [t0, t1] of the boxes at both ends, grown by what lies between; `x` bounds the
    /// distance of the swept points from the mover's centre of rotation.
    fn pieces(&self, x: f64, t0: f64, t1: f64, box_at: impl Fn(&super::Instant) -> Aabb) -> Aabb {
        let turn = (if x > 0.0 { self.spin } else { 0.0 } + self.observer_spin) * (t1 - t0);
        let count = (turn / PIECE_ANGLE).ceil().clamp(1.0, MAX_PIECES);
        let h = (t1 - t0) / count;
        let mut before = box_at(&self.relative.at(t0));
        let mut swept = Aabb::EMPTY;
        for i in 0..count as usize {
            let (s, e) = (t0 + h * i as f64, if i + 1 == count as usize { t1 } else { t0 + h * (i + 1) as f64 });
            let after = box_at(&self.relative.at(e));
            let b = self.relative.bounds(s, e - s, x);
            let acceleration = (b.omega * b.omega + b.cross) * x + self.observer_spin * b.swing;
            let grow = (0.5 * b.speed * (e - s)).min(0.125 * acceleration * (e - s) * (e - s));
            swept = swept.union(&before.union(&after).grown(grow));
            before = after;
        }
        swept
    }

    /// Clipped by the ball around the observer's centre of rotation, and grown by the rounding of carried points.
    fn finished(&self, swept: Aabb, x: f64, t0: f64, t1: f64) -> Aabb {
        let ball = Aabb::around(self.observer_center, DVec3::splat(self.farthest(t0, t1) + x));
        swept.intersection(&ball).grown(self.rounding(x, t0, t1))
    }

    /// Greatest distance of the two centres of rotation.
    fn farthest(&self, t0: f64, t1: f64) -> f64 {
        self.relative.difference(t0).length().max(self.relative.difference(t1).length())
    }

    /// Rounding of carried points at distances up to `x` from the mover's centre (angles round in proportion to themselves).
    fn rounding(&self, x: f64, t0: f64, t1: f64) -> f64 {
        let scale = self.farthest(t0, t1) + x + self.mover_center.length() + self.observer_center.length();
        scale * (1.0 + self.spin + self.observer_spin) * CARRIED
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contactd_proto::{Motion, Pose};
    use glam::DQuat;

    /// A ball around a point off the centre of rotation, turned by quarters (rounded as callers round them): its path is a
    /// point on the face of the cube around the centre.
    #[test]
    fn a_swept_ball_holds_its_ball_however_it_is_turned() {
        let quarter = std::f64::consts::FRAC_1_SQRT_2;
        let turns = [
            0.0,
            1.0,
            quarter,
            -quarter,
            f64::from_bits(quarter.to_bits() + 1),
            -f64::from_bits(quarter.to_bits() - 1),
        ];
        let at_rest = Placed { place: Pose::IDENTITY, motion: Motion::resting(Pose::IDENTITY) };
        let mut cases = 0;
        for i in 0..6u32.pow(4) {
            let digit = |k: u32| turns[(i / 6u32.pow(k) % 6) as usize];
            let q = DQuat::from_xyzw(digit(0), digit(1), digit(2), digit(3));
            if (q.length_squared() - 1.0).abs() > 1e-9 {
                continue;
            }
            let start = Pose::new(DVec3::new(-3.3219316049759318, 17.168436174577245, 11.360089680668677), q);
            let mover = Placed { place: Pose::IDENTITY, motion: Motion::resting(start) };
            for (center, radius) in [(-3.1185695185063014, 13.464216446241402), (-3.1185695185063014, 0.0), (0.1, 1.0)]
            {
                let swept = Sweep::new(mover, at_rest).of_ball(&Ball { center: DVec3::Z * center, radius }, 0.0, 1.0);
                let x = start.point(DVec3::Z * center);
                assert!(swept.contains(x - radius) && swept.contains(x + radius), "{q}: {swept:?} without {x}");
                cases += 1;
            }
        }
        assert!(cases > 100, "{cases}");
    }
}
