//! Right circular cylinder along z.

use super::{Checked, Convex, Geometry, Shape, Sink, Source};
use crate::math::{Aabb, Ball, Moments};
use crate::solid::Face;
use crate::solid::surface::{self, Plane};
use contactd_proto::Pose;
use glam::DVec3;
use std::f64::consts::PI;

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
            surface::Cylinder { origin: DVec3::ZERO, axis: DVec3::Z, radius: self.radius }.into(),
            Plane { normal: DVec3::Z, offset: self.half_height }.into(),
            Plane { normal: -DVec3::Z, offset: self.half_height }.into(),
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
    #[inline]
    fn convex(&self) -> Convex<'_> {
        Convex::Round { bottom: self.radius, top: self.radius, half: self.half_height }
    }
    fn moments(&self) -> Option<Moments> {
        let (rr, h) = (self.radius * self.radius, 2.0 * self.half_height);
        let volume = PI * rr * h;
        Some(Moments::diagonal(volume, 0.0, DVec3::new(rr / 4.0, rr / 4.0, h * h / 12.0) * volume))
    }
    fn grown(&self, margin: f64) -> Option<Shape> {
        Some(Self { radius: self.radius + margin, half_height: self.half_height + margin }.into())
    }
    fn kind(&self) -> &'static str {
        "cylinder"
    }
    fn dimensions(&self) -> String {
        format!("r {}, h {}", self.radius, 2.0 * self.half_height)
    }
    fn write(&self, out: &mut dyn Sink) {
        out.number(self.radius);
        out.number(self.half_height);
    }
    fn read(from: &mut dyn Source) -> Checked<Self> {
        Ok(Self { radius: from.finite()?, half_height: from.finite()? })
    }
}
