//! Support of one primitive where it stands: how far it reaches along a direction, and with which point.
//!
//! Static dispatch on the shape, nothing allocated: this is the innermost loop of the advance.
//! A ball is its centre and a margin: then the distance of two balls is that of two points, found at once.

use crate::solid::Shape;
use crate::solid::primitive::Form;
use glam::{DMat3, DVec3};

/// How deep a point is.
#[derive(Clone, Copy, Debug)]
pub struct Slope {
    /// f, the largest of the faces' values; negative inside.
    pub f: f64,
    /// The unit normal of the face that tells it, outwards; f lies nowhere below the plane that they make.
    pub normal: DVec3,
    /// Which face that is, of those of the primitive.
    pub face: u32,
}

/// A bounded convex primitive in a frame.
#[derive(Clone, Copy, Debug)]
pub struct ConvexBody<'s> {
    form: Form<'s>,
    axes: DMat3,
    origin: DVec3,
    /// What the primitive is thicker than its core: a ball's radius, else 0.
    pub margin: f64,
}

impl<'s> ConvexBody<'s> {
    /// A primitive's shape with its own frame; `None` for one without bounds.
    pub fn new(shape: &'s Shape, axes: DMat3, origin: DVec3) -> Option<Self> {
        let form = shape.form();
        let margin = match form {
            Form::Other => return None,
            Form::Ball(radius) => radius,
            Form::Cuboid(_) | Form::Round { .. } | Form::Corners(_) => 0.0,
        };
        Some(Self { form, axes, origin, margin })
    }

    /// The same body in a frame that sees its own by `axes` and `origin`.
    pub fn seen(&self, axes: &DMat3, origin: DVec3) -> Self {
        Self { axes: *axes * self.axes, origin: *axes * self.origin + origin, ..*self }
    }

    /// The centre of its frame, a point inside.
    pub fn center(&self) -> DVec3 {
        match self.form {
            Form::Corners(_) => self.origin + self.axes * self.form.middle(),
            Form::Ball(_) | Form::Cuboid(_) | Form::Round { .. } | Form::Other => self.origin,
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
        let local = match self.form {
            Form::Ball(_) | Form::Other => return self.origin,
            Form::Round { bottom, top, half } => round(bottom, top, half),
            Form::Cuboid(half) => DVec3::new(half.x.copysign(m.x), half.y.copysign(m.y), half.z.copysign(m.z)),
            Form::Corners(corners) => {
                let mut best = (f64::NEG_INFINITY, corners[0]);
                for v in corners {
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
        let own = if let Form::Ball(radius) = self.form {
            radius * n.length()
        } else {
            self.form.extent([self.axes.x_axis.dot(n), self.axes.y_axis.dot(n), self.axes.z_axis.dot(n)])
        };
        n.dot(self.origin) + own
    }

    /// How deep a point is in the body by f, the largest of its faces' values: the same as `Primitive::value` but for rounding,
    /// in a fraction of the time. `None` for a polyhedron.
    #[inline]
    pub fn slope(&self, x: DVec3) -> Option<Slope> {
        let from = x - self.origin;
        let own = || DVec3::new(self.axes.x_axis.dot(from), self.axes.y_axis.dot(from), self.axes.z_axis.dot(from));
        let across = |l: DVec3| (l.x * l.x + l.y * l.y).sqrt();
        // Away from the axis of revolution; on it any direction will do.
        let radial = |l: DVec3, rho: f64| {
            if rho > 0.0 { self.axes.x_axis * (l.x / rho) + self.axes.y_axis * (l.y / rho) } else { self.axes.x_axis }
        };
        let reported = |f, normal, face: usize| Slope { f, normal, face: face as u32 };
        Some(match self.form {
            Form::Ball(radius) => {
                let length = from.length();
                reported(length - radius, if length > 0.0 { from / length } else { DVec3::X }, 0)
            }
            Form::Cuboid(half) => {
                let l = own();
                let beyond = l.abs() - half;
                let axis = beyond.max_position();
                let below = l[axis].is_sign_negative();
                let normal = self.axes.col(axis);
                reported(beyond[axis], if below { -normal } else { normal }, 2 * axis + usize::from(below))
            }
            Form::Round { bottom, top, half } if bottom == top => {
                let l = own();
                let rho = across(l);
                let (side, end) = (rho - bottom, l.z.abs() - half);
                let below = l.z.is_sign_negative();
                if side >= end {
                    reported(side, radial(l, rho), 0)
                } else {
                    reported(end, if below { -self.axes.z_axis } else { self.axes.z_axis }, 1 + usize::from(below))
                }
            }
            Form::Round { bottom, top, half } => {
                let l = own();
                let rho = across(l);
                let (at_bottom, at_top) = (bottom, top);
                let slope = (at_bottom - at_top) / (2.0 * half);
                let tilt = (1.0 + slope * slope).sqrt();
                let side = (rho - 0.5 * (at_bottom + at_top) + slope * l.z) / tilt;
                // An end without a disc has no face there.
                let disc = |radius: f64, beyond: f64| if radius > 0.0 { beyond } else { f64::NEG_INFINITY };
                let (top, bottom) = (disc(at_top, l.z - half), disc(at_bottom, -l.z - half));
                if side >= top.max(bottom) {
                    reported(side, (radial(l, rho) + self.axes.z_axis * slope) / tilt, 0)
                } else if top > bottom {
                    reported(top, self.axes.z_axis, 1)
                } else {
                    reported(bottom, -self.axes.z_axis, 1 + usize::from(at_top > 0.0))
                }
            }
            Form::Corners(_) | Form::Other => return None,
        })
    }

    /// How many faces it takes to hold what a polyhedron shows along the unit direction n: 3 for a corner, 2 for an edge, 1
    /// for a face. 0 for round bodies.
    pub fn corner(&self, n: DVec3) -> usize {
        const FLAT: f64 = 1e-6;
        let m = self.axes.transpose() * n;
        match self.form {
            Form::Cuboid(_) => m.to_array().iter().filter(|c| c.abs() > FLAT).count(),
            Form::Corners(corners) => {
                let reach = corners.iter().fold(f64::NEG_INFINITY, |d, v| d.max(m.dot(*v)));
                let slack = FLAT * corners[0].distance(corners[1]);
                match corners.iter().filter(|v| m.dot(**v) > reach - slack).count() {
                    1 => 3,
                    2 => 2,
                    _ => 1,
                }
            }
            Form::Ball(_) | Form::Round { .. } | Form::Other => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use crate::solid::primitive::{Cone, Cuboid, Cylinder, Sphere};
    use crate::solid::{Label, Primitive};
    use contactd_proto::Pose;
    use contactd_proto::motion::quat_of_rotation_vector;

    #[test]
    fn the_value_of_a_body_is_the_largest_of_its_faces() {
        let shapes: [Shape; 6] = [
            Sphere { radius: 0.7 }.into(),
            Cuboid { half: DVec3::new(0.5, 0.9, 0.2) }.into(),
            Cylinder { radius: 0.4, half_height: 0.8 }.into(),
            Cone { bottom: 0.6, top: 0.0, half_height: 0.5 }.into(),
            Cone { bottom: 0.0, top: 0.3, half_height: 0.9 }.into(),
            Cone { bottom: 0.2, top: 0.8, half_height: 0.3 }.into(),
        ];
        let mut numbers = Random(11);
        let mut v = |size: f64| {
            let mut n = || numbers.within(-size, size);
            DVec3::new(n(), n(), n())
        };
        for shape in &shapes {
            let frame = Pose::new(v(2.0), quat_of_rotation_vector(v(3.0)));
            let primitive = Primitive::new(shape.clone(), frame, Label::default(), 0);
            let body = ConvexBody::new(shape, frame.matrix(), frame.position).expect("bounded");
            let mut inside = 0;
            for _ in 0..20_000 {
                let x = frame.position + v(1.2);
                let (faces, own) = (primitive.value(x), body.slope(x).expect("no polyhedron").f);
                assert!((faces - own).abs() <= 1e-14, "{shape:?} at {x}: {faces}, {own}");
                // The plane of its face lies below f everywhere.
                let Slope { normal, face, .. } = body.slope(x).expect("no polyhedron");
                assert!(
                    (primitive.faces[face as usize].value(x) - own).abs() <= 1e-14,
                    "{shape:?} at {x}: face {face}"
                );
                let other = frame.position + v(1.2);
                let plane = own + normal.dot(other - x);
                let f = body.slope(other).expect("no polyhedron").f;
                assert!((normal.length() - 1.0).abs() < 1e-15 && plane <= f + 1e-14, "{shape:?} at {x}, {other}");
                inside += u32::from(own < 0.0);
            }
            assert!(inside > 200, "{shape:?}: {inside}");
        }
    }
}
