//! What a convex primitive is to those who compute with it: the few numbers that tell it, and how far it reaches along a direction.

use super::polyhedron::middle;
use crate::math::Lanes;
use glam::{DMat3, DVec3};

/// A convex shape in its own frame, centred there but for corners: the few numbers that tell it, or its corners. Two kinds of
/// primitives may be of one form; a cylinder is round with equal radii, which a frustum never has.
#[derive(Clone, Copy, Debug)]
pub enum Form<'a> {
    /// Radius.
    Ball(f64),
    /// Half sizes.
    Cuboid(DVec3),
    /// A solid of revolution about z between two discs.
    Round {
        /// Radius at z = −half.
        bottom: f64,
        /// Radius at z = +half.
        top: f64,
        /// Half the height.
        half: f64,
    },
    /// The corners.
    Corners(&'a [DVec3]),
    /// None of these: without bounds, or of a kind that those who compute with forms do not know. They leave it to the search.
    Other,
}

impl Form<'_> {
    /// A point inside a bounded one.
    pub fn middle(&self) -> DVec3 {
        match self {
            Form::Corners(corners) => middle(corners),
            Form::Ball(_) | Form::Cuboid(_) | Form::Round { .. } | Form::Other => DVec3::ZERO,
        }
    }

    /// The same, to be kept, where few numbers tell it.
    pub fn of_few(self) -> Option<Form<'static>> {
        match self {
            Form::Ball(radius) => Some(Form::Ball(radius)),
            Form::Cuboid(half) => Some(Form::Cuboid(half)),
            Form::Round { bottom, top, half } => Some(Form::Round { bottom, top, half }),
            Form::Other => Some(Form::Other),
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
            Form::Other => T::all(f64::INFINITY),
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
