//! Torus around z.

use super::cylinder::disc_half_extents;
use super::{Checked, Convex, Cylinder, Farthest, Geometry, Shape, Sink, Source};
use crate::math::{Aabb, Ball, Moments};
use crate::solid::Face;
use crate::solid::surface;
use contactd_proto::Pose;
use glam::DVec3;
use std::f64::consts::PI;

/// All points within `minor` of a circle of the radius `major` about z, centred at the origin of its frame. Where `minor` is the
/// larger one there is no hole.
#[derive(Clone, Debug, PartialEq)]
pub struct Torus {
    /// Radius of the circle.
    pub major: f64,
    /// Radius of the tube.
    pub minor: f64,
}

impl Geometry for Torus {
    fn faces(&self) -> Vec<Face> {
        let Self { major, minor } = *self;
        vec![surface::Torus { origin: DVec3::ZERO, axis: DVec3::Z, major, minor }.into()]
    }
    fn face_name(&self, _: usize) -> String {
        "surface".into()
    }
    fn aabb(&self, frame: &Pose) -> Aabb {
        Aabb::around(frame.position, disc_half_extents(frame.vector(DVec3::Z), self.major) + DVec3::splat(self.minor))
    }
    fn ball(&self) -> Ball {
        Ball::new(DVec3::ZERO, self.major + self.minor)
    }
    fn smallest_dimension(&self) -> f64 {
        2.0 * self.minor
    }
    fn interior_point(&self) -> DVec3 {
        DVec3::X * self.major
    }
    #[inline]
    fn convex(&self) -> Convex<'_> {
        Convex::Other
    }
    /// Where it lies flat a whole circle is farthest: a point of that.
    fn farthest(&self, m: DVec3, flat: f64) -> Option<Farthest> {
        let across = DVec3::new(m.x, m.y, 0.0);
        let length = across.length();
        let out = if length <= flat { DVec3::X } else { across / length };
        Some(Farthest { reach: self.major * length + self.minor, middle: out * self.major + m * self.minor })
    }
    /// Pappus: 2π²Rr², and moments over the disc that is revolved. Of a tube that meets itself there is no such formula.
    fn moments(&self) -> Option<Moments> {
        let (rr, ss) = (self.major * self.major, self.minor * self.minor);
        let volume = 2.0 * PI * PI * self.major * ss;
        let across = 0.5 * rr + 0.375 * ss;
        (self.minor <= self.major)
            .then(|| Moments::diagonal(volume, 0.0, DVec3::new(across, across, 0.25 * ss) * volume))
    }
    /// A cylinder around it: convex, and so of use to those who compute with such.
    fn grown(&self, margin: f64) -> Option<Shape> {
        let half_height = self.minor + margin;
        Some(Cylinder { radius: self.major + half_height, half_height }.into())
    }
    fn kind(&self) -> &'static str {
        "torus"
    }
    fn dimensions(&self) -> String {
        format!("R {}, r {}", self.major, self.minor)
    }
    fn write(&self, out: &mut dyn Sink) {
        out.number(self.major);
        out.number(self.minor);
    }
    fn read(from: &mut dyn Source) -> Checked<Self> {
        Ok(Self { major: from.finite()?, minor: from.finite()? })
    }
}
