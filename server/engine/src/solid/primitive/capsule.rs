//! Capsule around z.

use super::{Checked, Convex, Geometry, Shape, Sink, Source};
use crate::math::{Aabb, Ball, Moments};
use crate::solid::Face;
use crate::solid::surface;
use contactd_proto::Pose;
use glam::DVec3;
use std::f64::consts::PI;

/// All points within `radius` of a segment along z, whose middle is the origin of its frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Capsule {
    /// Half the length of the segment.
    pub half: f64,
    /// Radius.
    pub radius: f64,
}

impl Geometry for Capsule {
    fn faces(&self) -> Vec<Face> {
        let Self { half, radius } = *self;
        vec![surface::Capsule { origin: DVec3::ZERO, axis: DVec3::Z, half, radius }.into()]
    }
    fn face_name(&self, _: usize) -> String {
        "surface".into()
    }
    fn aabb(&self, frame: &Pose) -> Aabb {
        Aabb::around(frame.position, frame.vector(DVec3::Z).abs() * self.half + DVec3::splat(self.radius))
    }
    fn ball(&self) -> Ball {
        Ball::new(DVec3::ZERO, self.half + self.radius)
    }
    fn smallest_dimension(&self) -> f64 {
        2.0 * self.radius
    }
    fn interior_point(&self) -> DVec3 {
        DVec3::ZERO
    }
    #[inline]
    fn convex(&self) -> Convex<'_> {
        Convex::Capsule { half: self.half, radius: self.radius }
    }
    /// A cylinder's and a ball's, whose halves have their centres 3r/8 off its own.
    fn moments(&self) -> Option<Moments> {
        let (h, r) = (self.half, self.radius);
        let (tube, ball) = (2.0 * PI * r * r * h, 4.0 / 3.0 * PI * r * r * r);
        let across = tube * r * r / 4.0 + ball * r * r / 5.0;
        let along = tube * h * h / 3.0 + ball * (h * h + 0.75 * h * r + r * r / 5.0);
        Some(Moments::diagonal(tube + ball, 0.0, DVec3::new(across, across, along)))
    }
    fn grown(&self, margin: f64) -> Option<Shape> {
        Some(Self { half: self.half, radius: self.radius + margin }.into())
    }
    fn kind(&self) -> &'static str {
        "capsule"
    }
    fn dimensions(&self) -> String {
        format!("r {}, length {}", self.radius, 2.0 * self.half)
    }
    fn write(&self, out: &mut dyn Sink) {
        out.number(self.half);
        out.number(self.radius);
    }
    fn read(from: &mut dyn Source) -> Checked<Self> {
        Ok(Self { half: from.finite()?, radius: from.finite()? })
    }
}
