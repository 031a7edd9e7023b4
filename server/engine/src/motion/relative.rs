//! The motion of a body B as a body A sees it, through time.
//!
//! Everything a cell needs is expressed along A's model axes at the instant t, where A's faces stand still. The two
//! origins enter only by their difference d = p_A − p_B, so an offset common to both bodies costs no digits.
//!
//! Letters (docs/algorithm/queue.md): u = x − p_A; omega = spin_A − spin_B; v0 = v_A − v_B. A point fixed in A moves against B
//! with v(x) = v0 − spin_B×d + omega×u, and its acceleration seen from B is
//! omega×(omega×u) + (omega×spin_B)×u + spin_B×(spin_B×d) − 2 spin_B×v0 (both spins are constant in the world): v̇ − spin_B×v with
//! u̇ = spin_A×u and ḋ = v0 is omega×(spin_A×u) − spin_B×(omega×u) + spin_B×(spin_B×d) − 2 spin_B×v0, where spin_A = omega + spin_B,
//! and a×(b×u) − b×(a×u) = (a×b)×u (Jacobi).

use super::rounding::{NORM, Rounding};
use contactd_proto::{Motion, Pose};
use glam::{DMat3, DVec3};

/// A model in motion: where it stands in its object's frame, and how that frame moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// object_from_model.
    pub place: Pose,
    /// Motion of the object's frame over the step.
    pub motion: Motion,
}

/// The relative motion of a pair over a step.
#[derive(Clone, Copy, Debug)]
pub struct Relative {
    a: Placed,
    b: Placed,
    a_axes: DMat3,
    b_axes: DMat3,
    d0: DVec3,
    v0: DVec3,
    /// spin_A − spin_B, world axes.
    omega: DVec3,
    /// A's centre of rotation in A's model frame.
    center_a: DVec3,
    /// B's place, position taken to B's model axes.
    offset_b: DVec3,
    /// World from model at the start, of a body that does not turn: it stays so.
    still: [Option<DMat3>; 2],
    rounding: Rounding,
}

/// The relative motion at one instant, along A's model axes.
#[derive(Clone, Copy, Debug)]
pub struct Instant {
    /// Time of the instant, fraction of the step.
    pub t: f64,
    /// B's model axes from A's model axes.
    pub b_from_a: DMat3,
    /// A's centre of rotation (model frame of A).
    pub center_a: DVec3,
    offset_b: DVec3,
    /// p_A − p_B.
    pub d: DVec3,
    /// v_A − v_B.
    pub v0: DVec3,
    /// spin_A − spin_B.
    pub omega: DVec3,
    /// spin_B.
    pub spin_b: DVec3,
    /// World from A's model axes.
    pub world_from_a: DMat3,
}

impl Relative {
    /// The relative motion of two placed models.
    pub fn new(a: Placed, b: Placed) -> Self {
        let (a_axes, b_axes) = (a.place.matrix(), b.place.matrix());
        let mut this = Self {
            a,
            b,
            a_axes,
            b_axes,
            d0: a.motion.start.position - b.motion.start.position,
            v0: a.motion.velocity - b.motion.velocity,
            omega: a.motion.spin - b.motion.spin,
            center_a: -(a_axes.transpose() * a.place.position),
            offset_b: b_axes.transpose() * b.place.position,
            still: [(a, a_axes), (b, b_axes)]
                .map(|(p, axes)| (p.motion.spin == DVec3::ZERO).then(|| p.motion.matrix_at(0.0) * axes)),
            rounding: Rounding { matrix: 0.0, origin: 0.0, arm: 0.0, rate: 0.0 },
        };
        this.rounding = Rounding::of(&this);
        this
    }

    /// The two placed models.
    pub fn placed(&self) -> (Placed, Placed) {
        (self.a, self.b)
    }

    /// p_A − p_B at `t`, world axes.
    pub fn difference(&self, t: f64) -> DVec3 {
        self.d0 + self.v0 * t
    }

    /// Largest distance of the two centres of rotation over the step.
    pub fn apart(&self) -> f64 {
        self.difference(0.0).length().max(self.difference(1.0).length())
    }

    /// What rounding may do to everything computed from this motion.
    pub fn rounding(&self) -> Rounding {
        self.rounding
    }

    /// True when one of the two bodies turns.
    pub fn turns(&self) -> bool {
        self.still.iter().any(Option::is_none)
    }

    /// A's centre of rotation in A's model frame.
    pub fn center_a(&self) -> DVec3 {
        self.center_a
    }

    /// The relative motion at `t`.
    pub fn at(&self, t: f64) -> Instant {
        let wa = self.still[0].unwrap_or_else(|| self.a.motion.matrix_at(t) * self.a_axes);
        let wb = self.still[1].unwrap_or_else(|| self.b.motion.matrix_at(t) * self.b_axes);
        let aw = wa.transpose();
        Instant {
            t,
            b_from_a: wb.transpose() * wa,
            center_a: self.center_a,
            offset_b: self.offset_b,
            d: aw * self.difference(t),
            v0: aw * self.v0,
            omega: aw * self.omega,
            spin_b: aw * self.b.motion.spin,
            world_from_a: wa,
        }
    }

    /// A point of A's model frame in the world at the instant `at`.
    pub fn world_point(&self, at: &Instant, x: DVec3) -> DVec3 {
        self.a.motion.start.position + self.a.motion.velocity * at.t + at.world_from_a * (x - self.center_a)
    }

    /// A point of the world in A's model frame at the instant `at`.
    pub fn model_point(&self, at: &Instant, x: DVec3) -> DVec3 {
        let center = self.a.motion.start.position + self.a.motion.velocity * at.t;
        self.center_a + at.world_from_a.transpose() * (x - center)
    }

    /// Bounds that hold at all times of [t, t + h] for points fixed in A within `x_max` of A's centre of rotation,
    /// rounding included.
    pub fn bounds(&self, t: f64, h: f64, x_max: f64) -> Bounds {
        let (d, e) = (self.difference(t), self.difference(t + h));
        let wb = self.b.motion.spin;
        let drift = |d: DVec3| (self.v0 - wb.cross(d)).length();
        let swing = |d: DVec3| (wb.cross(d) - 2.0 * self.v0).length();
        // The terms of a velocity and of an acceleration, without what they take from each other.
        let (omega, spin_b, v0) = (self.omega.length(), wb.length(), self.v0.length());
        let carried = spin_b * d.length().max(e.length());
        let speeds = v0 + carried + omega * x_max;
        let pulls = (omega + (1.0 + h) * spin_b) * omega * x_max + spin_b * (carried + 2.0 * v0);
        let outward = |v: f64, terms: f64| v + NORM * terms;
        Bounds {
            speed: outward(drift(d).max(drift(e)) + omega * x_max, speeds),
            swing: outward(swing(d).max(swing(e)), carried + 2.0 * v0),
            omega: outward(omega, omega),
            cross: outward(self.omega.cross(wb).length(), omega * spin_b),
            x_max: outward(x_max, x_max),
            h,
            slip: self.rounding.rate * speeds,
            bend: self.rounding.rate * pulls,
            rounding: self.rounding,
        }
    }
}

/// Constants of the second-order bound over a span of time; see `Relative::bounds`.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// V: no point moves faster against B.
    pub speed: f64,
    /// max |spin_B×d − 2 v0| over the span (d is affine in time, so the ends suffice).
    pub swing: f64,
    /// |omega|.
    pub omega: f64,
    /// |omega × spin_B|, constant.
    pub cross: f64,
    /// X.
    pub x_max: f64,
    /// Length of the span.
    pub h: f64,
    /// Rounding of a rate n·v(x), |n| = 1, x within `x_max`: length per step.
    pub slip: f64,
    /// Rounding of `curvature`, |w| = 1.
    pub bend: f64,
    /// The motion's rounding as such.
    pub rounding: Rounding,
}

impl Bounds {
    /// q: bound of |w·acceleration| over the span, w = sum of multiplied normals fixed in B, at the span's start.
    /// |w×spin_B| is constant in B; |w×omega| grows at most |w×spin_B||omega| per unit time. Exact but for `bend`.
    pub fn curvature(&self, at: &Instant, w: DVec3) -> f64 {
        let w_omega = w.cross(at.omega).length();
        let w_spin = w.cross(at.spin_b).length();
        (w_omega + self.h * w_spin * self.omega) * self.omega * self.x_max
            + w.length() * self.cross * self.x_max
            + w_spin * self.swing
    }
}

impl Instant {
    /// A point of A's model frame in B's model frame.
    pub fn b_point(&self, x: DVec3) -> DVec3 {
        self.b_from_a * (x - self.center_a + self.d) - self.offset_b
    }

    /// A point of B's model frame in A's model frame.
    pub fn a_point(&self, y: DVec3) -> DVec3 {
        self.b_from_a.transpose() * (y + self.offset_b) - self.d + self.center_a
    }

    /// A direction of B's model frame along A's model axes.
    pub fn a_vector(&self, n: DVec3) -> DVec3 {
        self.b_from_a.transpose() * n
    }

    /// v(x): velocity against B of the point of A at `x`, length per step.
    pub fn velocity(&self, x: DVec3) -> DVec3 {
        self.v0 - self.spin_b.cross(self.d) + self.omega.cross(x - self.center_a)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contactd_proto::motion::quat_of_rotation_vector;

    fn sample() -> Relative {
        let q = |x, y, z| quat_of_rotation_vector(DVec3::new(x, y, z));
        let a = Placed {
            place: Pose::new(DVec3::new(0.3, -0.2, 0.5), q(0.2, 1.0, -0.4)),
            motion: Motion::turning(
                Pose::new(DVec3::new(1e3, 2.0, -3.0), q(1.0, 0.1, 0.3)),
                DVec3::new(1e3 + 0.5, 1.0, -2.0),
                DVec3::new(0.4, -2.0, 1.0),
            ),
        };
        let b = Placed {
            place: Pose::new(DVec3::new(-0.1, 0.7, 0.2), q(-0.3, 0.4, 0.9)),
            motion: Motion::turning(
                Pose::new(DVec3::new(1e3 - 1.0, 2.5, -1.0), q(0.1, -0.7, 0.2)),
                DVec3::new(1e3, 1.5, -2.5),
                DVec3::new(-1.4, 0.3, 0.8),
            ),
        };
        Relative::new(a, b)
    }

    #[test]
    fn the_two_frames_agree_with_the_world() {
        let r = sample();
        for t in [0.0, 0.3, 1.0] {
            let (at, x) = (r.at(t), DVec3::new(0.4, -0.8, 0.6));
            let world = r.a.motion.at(t).point(r.a.place.point(x));
            let y = r.b.place.inverse().point(r.b.motion.at(t).inverse().point(world));
            assert!((at.b_point(x) - y).length() < 1e-12);
            assert!((at.a_point(y) - x).length() < 1e-12);
            assert!((r.world_point(&at, x) - world).length() < 1e-12);
        }
    }

    #[test]
    fn velocity_is_the_derivative_and_the_bounds_hold() {
        let r = sample();
        let x = DVec3::new(0.4, -0.8, 0.6);
        let (t, h) = (0.2, 0.5);
        let b = r.bounds(t, h, (x - r.center_a).length());
        let normal = DVec3::new(0.36, 0.48, 0.8);
        let along = |t: f64| normal.dot(r.at(t).b_point(x));
        for i in 0..=10 {
            let s = t + h * i as f64 / 10.0;
            let e = 1e-5;
            let at = r.at(s);
            let rate = (r.at(s + e).b_point(x) - r.at(s - e).b_point(x)) / (2.0 * e);
            assert!((at.a_vector(rate) - at.velocity(x)).length() < 1e-8);
            assert!(at.velocity(x).length() <= b.speed);
            let second = (along(s + 1e-4) - 2.0 * along(s) + along(s - 1e-4)) / 1e-8;
            assert!(second.abs() <= b.curvature(&r.at(t), r.at(t).a_vector(normal)) + 1e-4, "{second}");
        }
    }

    #[test]
    fn a_pure_turn_pulls_inwards_by_radius_times_speed_of_turning_squared() {
        let turning = Motion::turning(Pose::IDENTITY, DVec3::ZERO, DVec3::Z * 3.0);
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        let r = Relative::new(placed(turning), placed(Motion::resting(Pose::IDENTITY)));
        let (x, at) = (DVec3::X * 5.0, r.at(0.25));
        let bound = r.bounds(0.25, 0.1, 5.0).curvature(&at, DVec3::X);
        let along = |t: f64| at.b_from_a.x_axis.dot(r.at(t).b_point(x));
        let pull = (along(0.25 + 1e-4) - 2.0 * along(0.25) + along(0.25 - 1e-4)) / 1e-8;
        assert!((pull + 45.0).abs() < 1e-3 && bound >= 45.0 * (1.0 - 1e-12), "pulled by {pull}, bound {bound}");
    }
}
