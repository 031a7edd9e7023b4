//! Support of one primitive where it stands: how far it reaches along a direction, and with which point.
//!
//! Static dispatch on the shape, nothing allocated: this is the innermost loop of the advance.
//! A ball is its centre and a margin: then the distance of two balls is that of two points, found at once.

use crate::solid::Shape;
use crate::solid::primitive::Geometry;
use glam::{DMat3, DVec3};

/// A bounded convex primitive in a frame.
#[derive(Clone, Copy, Debug)]
pub struct Body<'s> {
    shape: &'s Shape,
    axes: DMat3,
    origin: DVec3,
    /// What the primitive is thicker than its core: a ball's radius, else 0.
    pub margin: f64,
}

impl<'s> Body<'s> {
    /// A primitive's shape with its own frame; `None` for one without bounds.
    pub fn new(shape: &'s Shape, axes: DMat3, origin: DVec3) -> Option<Self> {
        let margin = match shape {
            Shape::HalfSpace(_) => return None,
            Shape::Sphere(s) => s.radius,
            _ => 0.0,
        };
        Some(Self { shape, axes, origin, margin })
    }

    /// The same body in a frame that sees its own by `axes` and `origin`.
    pub fn seen(&self, axes: &DMat3, origin: DVec3) -> Self {
        Self { axes: *axes * self.axes, origin: *axes * self.origin + origin, ..*self }
    }

    /// The centre of its frame, a point inside.
    pub fn center(&self) -> DVec3 {
        match self.shape {
            Shape::Polyhedron(p) => self.origin + self.axes * p.interior_point(),
            _ => self.origin,
        }
    }

    /// The core's farthest point along n, which may have any length.
    #[inline]
    pub fn support(&self, n: DVec3) -> DVec3 {
        let m = DVec3::new(self.axes.x_axis.dot(n), self.axes.y_axis.dot(n), self.axes.z_axis.dot(n));
        let round = |bottom: f64, top: f64, half: f64| {
            let len = (m.x * m.x + m.y * m.y).sqrt();
            let above = top * len + half * m.z >= bottom * len - half * m.z;
            let (r, z) = if above { (top, half) } else { (bottom, -half) };
            let k = if len > 0.0 { r / len } else { 0.0 };
            DVec3::new(k * m.x, k * m.y, z)
        };
        let local = match self.shape {
            Shape::Sphere(_) | Shape::HalfSpace(_) => return self.origin,
            Shape::Cylinder(c) => round(c.radius, c.radius, c.half_height),
            Shape::Cone(c) => round(c.bottom, c.top, c.half_height),
            Shape::Cuboid(c) => DVec3::new(c.half.x.copysign(m.x), c.half.y.copysign(m.y), c.half.z.copysign(m.z)),
            Shape::Polyhedron(p) => {
                let mut best = (f64::NEG_INFINITY, p.vertices[0]);
                for v in &p.vertices {
                    let d = m.dot(*v);
                    if d > best.0 {
                        best = (d, *v);
                    }
                }
                best.1
            }
        };
        self.origin + self.axes * local
    }

    /// Largest n·x over the body.
    #[inline]
    pub fn reach(&self, n: DVec3) -> f64 {
        let margin = if self.margin > 0.0 { self.margin * n.length() } else { 0.0 };
        n.dot(self.support(n)) + margin
    }

    /// How many faces it takes to hold what a polyhedron shows along the unit direction n: 3 for a corner, 2 for an edge, 1
    /// for a face. 0 for round bodies.
    pub fn corner(&self, n: DVec3) -> usize {
        const FLAT: f64 = 1e-6;
        let m = self.axes.transpose() * n;
        match self.shape {
            Shape::Cuboid(_) => m.to_array().iter().filter(|c| c.abs() > FLAT).count(),
            Shape::Polyhedron(p) => {
                let reach = p.vertices.iter().fold(f64::NEG_INFINITY, |d, v| d.max(m.dot(*v)));
                let slack = FLAT * p.vertices[0].distance(p.vertices[1]);
                match p.vertices.iter().filter(|v| m.dot(**v) > reach - slack).count() {
                    1 => 3,
                    2 => 2,
                    _ => 1,
                }
            }
            _ => 0,
        }
    }
}
