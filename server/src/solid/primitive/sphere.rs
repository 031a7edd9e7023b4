//! Ball of radius r around the origin.

use super::Geometry;
use crate::math::{Aabb, Ball};
use crate::solid::Face;
use contactd_proto::Pose;
use glam::DVec3;

/// A ball around the origin of its frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Sphere {
    /// Radius.
    pub radius: f64,
}

impl Geometry for Sphere {
    fn faces(&self) -> Vec<Face> {
        vec![Face::Sphere { center: DVec3::ZERO, radius: self.radius }]
    }
    fn face_name(&self, _: usize) -> String {
        "surface".into()
    }
    fn aabb(&self, frame: &Pose) -> Aabb {
        Aabb::around(frame.position, DVec3::splat(self.radius))
    }
    fn ball(&self) -> Ball {
        Ball::new(DVec3::ZERO, self.radius)
    }
    fn smallest_dimension(&self) -> f64 {
        2.0 * self.radius
    }
    fn interior_point(&self) -> DVec3 {
        DVec3::ZERO
    }
}
