//! Right circular cylinder along z.

use super::Geometry;
use crate::math::{Aabb, Ball};
use crate::solid::Face;
use contactd_proto::Pose;
use glam::DVec3;

/// A right circular cylinder, axis z, centred at the origin of its frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Cylinder {
    /// Radius.
    pub radius: f64,
    /// Half the height: z runs from −half_height to half_height.
    pub half_height: f64,
}

/// Half extents of a disc of radius `r` with unit normal `axis`.
pub(super) fn disc_half_extents(axis: DVec3, r: f64) -> DVec3 {
    // e_k·(disc) reaches r·sqrt(1 − a_k²); the difference of squares keeps small tilts exact.
    let a = axis.normalize();
    DVec3::new(
        r * (a.y * a.y + a.z * a.z).sqrt(),
        r * (a.x * a.x + a.z * a.z).sqrt(),
        r * (a.x * a.x + a.y * a.y).sqrt(),
    )
}

impl Geometry for Cylinder {
    fn faces(&self) -> Vec<Face> {
        vec![
            Face::Cylinder { origin: DVec3::ZERO, axis: DVec3::Z, radius: self.radius },
            Face::Plane { normal: DVec3::Z, offset: self.half_height },
            Face::Plane { normal: -DVec3::Z, offset: self.half_height },
        ]
    }
    fn face_name(&self, index: usize) -> String {
        ["side", "top", "bottom"][index].into()
    }
    fn aabb(&self, frame: &Pose) -> Aabb {
        let axis = frame.vector(DVec3::Z);
        Aabb::around(frame.position, disc_half_extents(axis, self.radius) + axis.abs() * self.half_height)
    }
    fn ball(&self) -> Ball {
        Ball::new(DVec3::ZERO, self.radius.hypot(self.half_height))
    }
    fn smallest_dimension(&self) -> f64 {
        2.0 * self.radius.min(self.half_height)
    }
    fn interior_point(&self) -> DVec3 {
        DVec3::ZERO
    }
}
