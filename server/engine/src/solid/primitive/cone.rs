//! Right circular cone or frustum along z.

use super::{Checked, Convex, Geometry, Shape, Sink, Source, cylinder::disc_half_extents};
use crate::math::{Aabb, Ball, Moments};
use crate::solid::Face;
use crate::solid::surface::{self, Plane};
use contactd_proto::Pose;
use glam::DVec3;
use std::f64::consts::PI;

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
        let mut faces: Vec<Face> = vec![surface::Cone { apex, axis, sin: drop / slant, cos: h / slant }.into()];
        if self.has_top() {
            faces.push(Plane { normal: DVec3::Z, offset: self.half_height }.into());
        }
        if self.bottom > 0.0 {
            faces.push(Plane { normal: -DVec3::Z, offset: self.half_height }.into());
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
    #[inline]
    fn convex(&self) -> Convex<'_> {
        Convex::Round { bottom: self.bottom, top: self.top, half: self.half_height }
    }
    fn moments(&self) -> Option<Moments> {
        let (a, b, h) = (self.bottom, self.top, 2.0 * self.half_height);
        let volume = PI * h * (a * a + a * b + b * b) / 3.0;
        let across = PI * h * (a.powi(4) + a.powi(3) * b + a * a * b * b + a * b.powi(3) + b.powi(4)) / 20.0;
        let along = PI * h.powi(3) * (a * a + 3.0 * a * b + 6.0 * b * b) / 30.0;
        let first = PI * h * h * (a * a + 2.0 * a * b + 3.0 * b * b) / 12.0;
        let on_bottom = Moments::diagonal(volume, first, DVec3::new(across, across, along));
        Some(on_bottom.moved(DVec3::new(0.0, 0.0, -self.half_height)))
    }
    fn grown(&self, _: f64) -> Option<Shape> {
        // Its rims are sharper than a right angle, and so is an apex.
        None
    }
    fn kind(&self) -> &'static str {
        if self.bottom > 0.0 && self.top > 0.0 { "frustum" } else { "cone" }
    }
    fn dimensions(&self) -> String {
        format!("r {} to {}, h {}", self.bottom, self.top, 2.0 * self.half_height)
    }
    fn write(&self, out: &mut dyn Sink) {
        out.number(self.bottom);
        out.number(self.top);
        out.number(self.half_height);
    }
    fn read(from: &mut dyn Source) -> Checked<Self> {
        Ok(Self { bottom: from.finite()?, top: from.finite()?, half_height: from.finite()? })
    }
}
