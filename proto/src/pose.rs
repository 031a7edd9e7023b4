//! A rigid placement: rotation first, then translation.

use crate::ErrorCode;
use glam::{DMat3, DQuat, DVec3};

/// A rigid placement of a frame in its parent: `parent = rotation · local + position`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Origin of the frame, in the parent's coordinates and unit.
    pub position: DVec3,
    /// Unit quaternion (x, y, z, w).
    pub rotation: DQuat,
}

/// Farthest from the origin that anything may stand, in any unit: squares and sums of lengths stay numbers.
pub const FARTHEST: f64 = 1e150;

/// Checks where something is to stand.
///
/// # Errors
/// `NotFinite` for what is no finite number, or farther from the origin than [`FARTHEST`].
#[inline]
pub fn check_position(position: DVec3) -> Result<(), ErrorCode> {
    // Also false for what is not a number.
    let within = position.length_squared() <= FARTHEST * FARTHEST;
    if within { Ok(()) } else { Err(ErrorCode::NotFinite) }
}

impl Pose {
    /// The frame that coincides with its parent.
    pub const IDENTITY: Self = Self { position: DVec3::ZERO, rotation: DQuat::IDENTITY };

    /// A placement from its two parts; `rotation` must be a unit quaternion.
    #[inline]
    pub fn new(position: DVec3, rotation: DQuat) -> Self {
        Self { position, rotation }
    }

    /// A placement without rotation.
    pub fn at(position: DVec3) -> Self {
        Self { position, rotation: DQuat::IDENTITY }
    }

    /// The rotation as a matrix whose columns are the frame's axes in the parent.
    pub fn matrix(&self) -> DMat3 {
        DMat3::from_quat(self.rotation)
    }

    /// A point of the frame in the parent's coordinates.
    #[inline]
    pub fn point(&self, local: DVec3) -> DVec3 {
        self.rotation * local + self.position
    }

    /// A direction of the frame in the parent's coordinates.
    #[inline]
    pub fn vector(&self, local: DVec3) -> DVec3 {
        self.rotation * local
    }

    /// `self` after `inner`: `(self * inner).point(x) = self.point(inner.point(x))`.
    pub fn compose(&self, inner: &Self) -> Self {
        Self { position: self.point(inner.position), rotation: (self.rotation * inner.rotation).normalize() }
    }

    /// The parent's placement in this frame.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.conjugate();
        Self { position: -(rotation * self.position), rotation }
    }
}
