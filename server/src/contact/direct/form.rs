//! How far a convex shape reaches along a direction, in the few numbers that tell it.

use crate::math::Lanes;
use crate::solid::Shape;
use glam::{DMat3, DVec3};

/// How far a shape reaches from its centre: the few numbers that tell it, or its corners.
#[derive(Clone, Copy, Debug)]
pub enum Form<'a> {
    /// Radius; infinite for what has no bounds.
    Ball(f64),
    /// Half sizes.
    Cuboid(DVec3),
    /// Radii of the ends, and the half height.
    Round { bottom: f64, top: f64, half: f64 },
    /// The corners.
    Corners(&'a [DVec3]),
}

impl<'a> Form<'a> {
    /// Of a shape.
    #[inline]
    pub fn of(shape: &'a Shape) -> Self {
        match shape {
            Shape::Sphere(s) => Form::Ball(s.radius),
            Shape::Cuboid(c) => Form::Cuboid(c.half),
            Shape::Cylinder(c) => Form::Round { bottom: c.radius, top: c.radius, half: c.half_height },
            Shape::Cone(c) => Form::Round { bottom: c.bottom, top: c.top, half: c.half_height },
            Shape::Polyhedron(p) => Form::Corners(&p.vertices),
            Shape::HalfSpace(_) => Form::Ball(f64::INFINITY),
        }
    }

    /// The same, to be kept, where few numbers tell it.
    pub fn of_few(self) -> Option<Form<'static>> {
        match self {
            Form::Ball(radius) => Some(Form::Ball(radius)),
            Form::Cuboid(half) => Some(Form::Cuboid(half)),
            Form::Round { bottom, top, half } => Some(Form::Round { bottom, top, half }),
            Form::Corners(_) => None,
        }
    }

    /// Largest m·x over the shape, in its own frame; m is a unit vector, or two of them. Of any length but for a ball.
    #[inline]
    pub fn extent<T: Lanes>(&self, m: [T; 3]) -> T {
        match self {
            Form::Ball(radius) => T::all(*radius),
            Form::Cuboid(half) => m[0].abs() * half.x + m[1].abs() * half.y + m[2].abs() * half.z,
            Form::Round { bottom, top, half } => {
                let (across, up) = ((m[0] * m[0] + m[1] * m[1]).sqrt(), m[2] * *half);
                (across * *top + up).max(across * *bottom - up)
            }
            Form::Corners(corners) => {
                corners.iter().fold(T::all(f64::NEG_INFINITY), |far, v| far.max(m[0] * v.x + m[1] * v.y + m[2] * v.z))
            }
        }
    }

    /// Largest n·x over the shape where it stands with these axes; n is a unit vector.
    #[inline]
    pub fn reach(&self, axes: &DMat3, n: DVec3) -> f64 {
        if let Form::Ball(radius) = self {
            return *radius;
        }
        self.extent([axes.x_axis.dot(n), axes.y_axis.dot(n), axes.z_axis.dot(n)])
    }
}
