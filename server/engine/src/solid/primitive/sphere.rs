//! Ball of radius r around the origin.

use super::{Checked, Convex, Geometry, Shape, Sink, Source};
use crate::math::{Aabb, Ball, Moments};
use crate::solid::{Face, surface};
use contactd_proto::Pose;
use glam::DVec3;
use std::f64::consts::PI;

/// A ball around the origin of its frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Sphere {
    /// Radius.
    pub radius: f64,
}

impl Geometry for Sphere {
    fn faces(&self) -> Vec<Face> {
        vec![surface::Sphere { center: DVec3::ZERO, radius: self.radius }.into()]
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
    #[inline]
    fn convex(&self) -> Convex<'_> {
        Convex::Ball(self.radius)
    }
    fn moments(&self) -> Option<Moments> {
        let volume = 4.0 / 3.0 * PI * self.radius.powi(3);
        Some(Moments::diagonal(volume, 0.0, DVec3::splat(0.2 * volume * self.radius * self.radius)))
    }
    fn grown(&self, margin: f64) -> Option<Shape> {
        Some(Self { radius: self.radius + margin }.into())
    }
    fn kind(&self) -> &'static str {
        "sphere"
    }
    fn dimensions(&self) -> String {
        format!("r {}", self.radius)
    }
    fn write(&self, out: &mut dyn Sink) {
        out.number(self.radius);
    }
    fn read(from: &mut dyn Source) -> Checked<Self> {
        Ok(Self { radius: from.finite()? })
    }
}
