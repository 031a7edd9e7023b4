//! Right circular cone or frustum along z.

use super::{Geometry, cylinder::disc_half_extents};
use crate::math::{Aabb, Ball};
use crate::solid::Face;
use contactd_proto::Pose;
use glam::DVec3;

/// A right circular cone or frustum, axis z, centred at the origin of its frame. The two radii differ; one may be 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Cone {
    /// Radius at z = −half_height.
    pub bottom: f64,
    /// Radius at z = +half_height.
    pub top: f64,
    /// Half the height.
    pub half_height: f64,
}

impl Cone {
    /// Face order: lateral surface, then the discs that exist (top before bottom).
    fn has_top(&self) -> bool {
        self.top > 0.0
    }
}

impl Geometry for Cone {
    fn faces(&self) -> Vec<Face> {
        let (h, drop) = (2.0 * self.half_height, (self.bottom - self.top).abs());
        let slant = h.hypot(drop);
        let larger = self.bottom.max(self.top);
        // The apex lies on the side of the smaller disc: h·larger/drop away from the larger one.
        let to_apex = h * larger / drop;
        let (apex, axis) = if self.bottom > self.top {
            (DVec3::new(0.0, 0.0, -self.half_height + to_apex), -DVec3::Z)
        } else {
            (DVec3::new(0.0, 0.0, self.half_height - to_apex), DVec3::Z)
        };
        let mut faces = vec![Face::Cone { apex, axis, sin: drop / slant, cos: h / slant }];
        if self.has_top() {
            faces.push(Face::Plane { normal: DVec3::Z, offset: self.half_height });
        }
        if self.bottom > 0.0 {
            faces.push(Face::Plane { normal: -DVec3::Z, offset: self.half_height });
        }
        faces
    }
    fn face_name(&self, index: usize) -> String {
        match (index, self.has_top()) {
            (0, _) => "side",
            (1, true) => "top",
            _ => "bottom",
        }
        .into()
    }
    fn aabb(&self, frame: &Pose) -> Aabb {
        let axis = frame.vector(DVec3::Z);
        let (lo, hi) = (frame.position - axis * self.half_height, frame.position + axis * self.half_height);
        Aabb::around(lo, disc_half_extents(axis, self.bottom))
            .union(&Aabb::around(hi, disc_half_extents(axis, self.top)))
    }
    fn ball(&self) -> Ball {
        // Centre on the axis at equal distance from both rims, kept within the height.
        let h = self.half_height;
        let z = ((self.top * self.top - self.bottom * self.bottom) / (4.0 * h)).clamp(-h, h);
        Ball::new(DVec3::new(0.0, 0.0, z), (z + h).hypot(self.bottom).max((h - z).hypot(self.top)))
    }
    fn smallest_dimension(&self) -> f64 {
        2.0 * self.half_height.min(self.bottom.max(self.top))
    }
    fn interior_point(&self) -> DVec3 {
        let z = if self.bottom > self.top { -0.5 } else { 0.5 };
        DVec3::new(0.0, 0.0, z * self.half_height)
    }
}
