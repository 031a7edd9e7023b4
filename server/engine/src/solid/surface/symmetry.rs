//! About what a face may be turned without a change.

use glam::DVec3;

/// An axis: a point of it and its unit direction, model frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// A point of the axis.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}

/// Directions this close are one: a few units in the last place of a unit vector.
const SAME: f64 = 8.0 * f64::EPSILON;

impl Axis {
    /// True when the axis passes through `point`, to a few units in the last place of `extent` (a length).
    pub fn passes(&self, point: DVec3, extent: f64) -> bool {
        (point - self.origin).cross(self.direction).length() <= SAME * extent
    }

    /// True when `v` (any length) is parallel to the axis.
    pub fn is_along(&self, v: DVec3) -> bool {
        v.cross(self.direction).length() <= SAME * v.length()
    }
}

/// The rotations that leave a face what it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Symmetry {
    /// About one axis alone.
    Axis(Axis),
    /// About every axis through a centre, model frame.
    Center(DVec3),
    /// About every axis along a unit normal, model frame.
    Normal(DVec3),
    /// About none that is told.
    None,
}
