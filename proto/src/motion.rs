//! Motion over one step: the position moves linearly, the rotation turns at constant angular velocity about an axis
//! fixed in the world (Rodrigues' formula, with sine and cosine from `libm`, so that results do not depend on the
//! platform's own library).

use crate::Pose;
use glam::{DMat3, DQuat, DVec3};

/// The motion of an object's frame over a step, t = 0..1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Pose at t = 0.
    pub start: Pose,
    /// Displacement of the origin over the whole step.
    pub velocity: DVec3,
    /// Rotation vector over the whole step, world axes: direction = axis, length = angle in radians (may exceed 2π).
    pub spin: DVec3,
}

impl Motion {
    /// An object that stays where it is.
    #[inline]
    pub fn resting(pose: Pose) -> Self {
        Self { start: pose, velocity: DVec3::ZERO, spin: DVec3::ZERO }
    }

    /// The shortest way from `start` to `end`. At exactly 180° the axis is the one the relative quaternion
    /// `end · start⁻¹` carries; of its two signs the one whose first non-zero component is positive.
    pub fn between(start: Pose, end: Pose) -> Self {
        let spin = spin_between(start.rotation, end.rotation);
        Self { start, velocity: end.position - start.position, spin }
    }

    /// From `start` to `end_position`, turning by `rotation_vector` (world axes, radians over the step).
    #[inline]
    pub fn turning(start: Pose, end_position: DVec3, rotation_vector: DVec3) -> Self {
        Self { start, velocity: end_position - start.position, spin: rotation_vector }
    }

    /// The pose at time `t` (fraction of the step).
    #[inline]
    pub fn at(&self, t: f64) -> Pose {
        let turn = self.spin * t;
        // What does not turn keeps its rotation to the bit: a product with the identity is normalised once more.
        let rotation = if turn == DVec3::ZERO {
            self.start.rotation
        } else {
            (quat_of_rotation_vector(turn) * self.start.rotation).normalize()
        };
        Pose { position: self.start.position + self.velocity * t, rotation }
    }

    /// The rotation at time `t` as a matrix (columns: the frame's axes in the world).
    pub fn matrix_at(&self, t: f64) -> DMat3 {
        if self.spin == DVec3::ZERO {
            return self.start.matrix();
        }
        DMat3::from_quat((quat_of_rotation_vector(self.spin * t) * self.start.rotation).normalize())
    }

    /// True when neither position nor rotation changes over the step.
    #[inline]
    pub fn is_rest(&self) -> bool {
        self.velocity == DVec3::ZERO && self.spin == DVec3::ZERO
    }
}

/// Unit quaternion of the rotation about `v/|v|` by the angle `|v|`.
pub fn quat_of_rotation_vector(v: DVec3) -> DQuat {
    let angle = length(v);
    if angle == 0.0 {
        return DQuat::IDENTITY;
    }
    let (s, c) = libm::sincos(0.5 * angle);
    // sin(a/2)/a without cancellation: s/angle is smooth down to the smallest normal angle.
    let k = s / angle;
    DQuat::from_xyzw(v.x * k, v.y * k, v.z * k, c)
}

/// The rotation vector of the shortest way between two rotations, world axes.
pub(crate) fn spin_between(start: DQuat, end: DQuat) -> DVec3 {
    rotation_vector(end * start.conjugate())
}

/// The rotation vector of `q` with an angle in [0, π]; `q` need not be exactly unit.
pub fn rotation_vector(q: DQuat) -> DVec3 {
    let mut v = DVec3::new(q.x, q.y, q.z);
    let mut w = q.w;
    let first = if v.x != 0.0 {
        v.x
    } else if v.y != 0.0 {
        v.y
    } else {
        v.z
    };
    if w < 0.0 || (w == 0.0 && first < 0.0) {
        v = -v;
        w = -w;
    }
    let s = length(v);
    if s == 0.0 {
        return DVec3::ZERO;
    }
    let angle = 2.0 * libm::atan2(s, w);
    v * (angle / s)
}

/// Euclidean length that neither under- nor overflows where the plain formula would.
fn length(v: DVec3) -> f64 {
    let m = v.abs().max_element();
    if m == 0.0 || !m.is_finite() {
        return m;
    }
    if (1e-140..1e140).contains(&m) {
        return v.length();
    }
    let u = v / m;
    u.length() * m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_between_two_poses_ends_at_the_second() {
        let start = Pose::new(DVec3::new(1.0, 2.0, 3.0), quat_of_rotation_vector(DVec3::new(0.3, -0.2, 0.9)));
        let end = Pose::new(DVec3::new(-1.0, 0.5, 7.0), quat_of_rotation_vector(DVec3::new(-1.3, 1.2, 0.1)));
        let at = Motion::between(start, end).at(1.0);
        assert!((at.position - end.position).length() < 1e-15);
        assert!(at.rotation.dot(end.rotation).abs() > 1.0 - 1e-15);
    }

    #[test]
    fn a_half_turn_takes_the_documented_axis() {
        let v = rotation_vector(DQuat::from_xyzw(0.0, -1.0, 0.0, 0.0));
        assert!((v - DVec3::new(0.0, std::f64::consts::PI, 0.0)).length() < 1e-15);
    }

    #[test]
    fn whole_turns_are_kept() {
        let spin = DVec3::new(0.0, 0.0, 81.0 * std::f64::consts::TAU);
        let m = Motion::turning(Pose::IDENTITY, DVec3::ZERO, spin);
        assert!((m.at(0.5 / 81.0).point(DVec3::X) + DVec3::X).length() < 1e-12);
    }

    #[test]
    fn the_smallest_motions_stay_finite() {
        let m = Motion::turning(Pose::IDENTITY, DVec3::splat(1e-300), DVec3::splat(1e-39));
        let p = m.at(0.5);
        assert!(p.position.is_finite() && p.rotation.is_finite());
        assert!(quat_of_rotation_vector(DVec3::splat(1e-200)).is_normalized());
    }
}
