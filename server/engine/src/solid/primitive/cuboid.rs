//! Rectangular box.

use super::{Checked, Convex, Geometry, Shape, Sink, Source, read_vector, write_vector};
use crate::math::{Aabb, Ball, Moments};
use crate::solid::Face;
use crate::solid::surface::Plane;
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
            .map(|(normal, offset)| Plane { normal, offset }.into())
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
    #[inline]
    fn convex(&self) -> Convex<'_> {
        Convex::Cuboid(self.half)
    }
    fn moments(&self) -> Option<Moments> {
        Some(Moments::of_box(self.half))
    }
    fn grown(&self, margin: f64) -> Option<Shape> {
        Some(Self { half: self.half + margin }.into())
    }
    fn mirrored_face(&self, index: usize) -> usize {
        if index < 2 { 1 - index } else { index }
    }
    fn kind(&self) -> &'static str {
        "box"
    }
    fn dimensions(&self) -> String {
        format!("{} x {} x {}", 2.0 * self.half.x, 2.0 * self.half.y, 2.0 * self.half.z)
    }
    fn write(&self, out: &mut dyn Sink) {
        write_vector(out, self.half);
    }
    fn read(from: &mut dyn Source) -> Checked<Self> {
        Ok(Self { half: read_vector(from)? })
    }
}
