//! Half-space z <= 0: a floor or a wall of its own, or an operand that something bounded cuts down.

use super::{Checked, Convex, Geometry, Shape, Sink, Source};
use crate::math::{Aabb, Ball, Moments};
use crate::solid::Face;
use crate::solid::surface::Plane;
use contactd_proto::Pose;
use glam::DVec3;

/// The half-space z <= 0 of its frame.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfSpace;

impl Geometry for HalfSpace {
    fn faces(&self) -> Vec<Face> {
        vec![Plane { normal: DVec3::Z, offset: 0.0 }.into()]
    }
    fn face_name(&self, _: usize) -> String {
        "plane".into()
    }
    fn aabb(&self, frame: &Pose) -> Aabb {
        // Bounded only against an axis that the plane faces squarely.
        let n = frame.vector(DVec3::Z).normalize();
        let mut b = Aabb::ALL;
        for k in 0..3 {
            if n[k].abs() == 1.0 {
                let at = frame.position[k];
                if n[k] > 0.0 { b.max[k] = at } else { b.min[k] = at }
            }
        }
        b
    }
    fn ball(&self) -> Ball {
        Ball::ALL
    }
    fn smallest_dimension(&self) -> f64 {
        f64::INFINITY
    }
    fn interior_point(&self) -> DVec3 {
        -DVec3::Z
    }
    #[inline]
    fn convex(&self) -> Convex<'_> {
        Convex::HalfSpace
    }
    fn moments(&self) -> Option<Moments> {
        None
    }
    fn grown(&self, _: f64) -> Option<Shape> {
        None
    }
    fn kind(&self) -> &'static str {
        "half-space"
    }
    fn dimensions(&self) -> String {
        String::new()
    }
    fn write(&self, _: &mut dyn Sink) {}
    fn read(_: &mut dyn Source) -> Checked<Self> {
        Ok(Self)
    }
}
