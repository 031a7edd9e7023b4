//! Ellipsoid around the origin.

use super::{Checked, Convex, Cuboid, Geometry, Shape, Sink, Source, read_vector, write_vector};
use crate::math::{Aabb, Ball, Moments};
use crate::solid::Face;
use crate::solid::surface::Elliptic;
use contactd_proto::Pose;
use glam::{DMat3, DVec3};
use std::f64::consts::PI;

/// An ellipsoid around the origin of its frame, along its axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Semi-axes along x, y and z, lengths.
    pub semi: DVec3,
}

impl Geometry for Ellipsoid {
    fn faces(&self) -> Vec<Face> {
        vec![Elliptic::ellipsoid(DVec3::ZERO, DMat3::IDENTITY, self.semi).into()]
    }
    fn face_name(&self, _: usize) -> String {
        "surface".into()
    }
    /// Largest coordinate k: |(a_i R_ki)_i|.
    fn aabb(&self, frame: &Pose) -> Aabb {
        let turn = frame.matrix();
        let rows = [0, 1, 2].map(|k| (turn.row(k) * self.semi).length());
        Aabb::around(frame.position, DVec3::from_array(rows))
    }
    fn ball(&self) -> Ball {
        Ball::new(DVec3::ZERO, self.semi.max_element())
    }
    fn smallest_dimension(&self) -> f64 {
        2.0 * self.semi.min_element()
    }
    fn interior_point(&self) -> DVec3 {
        DVec3::ZERO
    }
    #[inline]
    fn convex(&self) -> Convex<'_> {
        Convex::Ellipsoid(self.semi)
    }
    fn moments(&self) -> Option<Moments> {
        let volume = 4.0 / 3.0 * PI * self.semi.x * self.semi.y * self.semi.z;
        Some(Moments::diagonal(volume, 0.0, self.semi * self.semi * (volume / 5.0)))
    }
    /// A box around it: of use to those who compute with convex bodies. psi <= margin where |B x| <= r + margin.
    fn grown(&self, margin: f64) -> Option<Shape> {
        let by = (1.0 + margin / self.semi.min_element()) * (1.0 + 1e-14);
        Some(Cuboid { half: self.semi * by }.into())
    }
    fn kind(&self) -> &'static str {
        "ellipsoid"
    }
    fn dimensions(&self) -> String {
        format!("semi-axes {}, {}, {}", self.semi.x, self.semi.y, self.semi.z)
    }
    fn write(&self, out: &mut dyn Sink) {
        write_vector(out, self.semi);
    }
    fn read(from: &mut dyn Source) -> Checked<Self> {
        let semi = read_vector(from)?;
        if semi.min_element() > 0.0 { Ok(Self { semi }) } else { Err("semi-axes above 0") }
    }
}
