//! Rectangular box.

use super::Geometry;
use crate::math::{Aabb, Ball};
use crate::solid::Face;
use contactd_proto::Pose;
use glam::DVec3;

/// A rectangular box centred at the origin of its frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Cuboid {
    /// Half extents along x, y, z.
    pub half: DVec3,
}

impl Geometry for Cuboid {
    fn faces(&self) -> Vec<Face> {
        let h = self.half;
        [(DVec3::X, h.x), (-DVec3::X, h.x), (DVec3::Y, h.y), (-DVec3::Y, h.y), (DVec3::Z, h.z), (-DVec3::Z, h.z)]
            .into_iter()
            .map(|(normal, offset)| Face::Plane { normal, offset })
            .collect()
    }
    fn face_name(&self, index: usize) -> String {
        ["+x", "-x", "+y", "-y", "+z", "-z"][index].into()
    }
    fn aabb(&self, frame: &Pose) -> Aabb {
        let m = frame.matrix();
        let half = m.x_axis.abs() * self.half.x + m.y_axis.abs() * self.half.y + m.z_axis.abs() * self.half.z;
        Aabb::around(frame.position, half)
    }
    fn ball(&self) -> Ball {
        Ball::new(DVec3::ZERO, self.half.length())
    }
    fn smallest_dimension(&self) -> f64 {
        2.0 * self.half.min_element()
    }
    fn interior_point(&self) -> DVec3 {
        DVec3::ZERO
    }
}
