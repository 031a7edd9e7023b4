//! Shapes in a plane, as they stand inside of an extrusion: circles, rectangles, paths.

use super::Place;
use super::facets::ring;
use super::hull::Disc;
use crate::math::tolerance::SIMILARITY;
use glam::{DAffine3, DVec2};

/// A shape in the plane of an extrusion.
#[derive(Clone, Debug)]
pub struct Flat {
    /// What it is, in its own coordinates.
    pub outline: Outline,
    /// From these to the plane's; z is not looked at.
    pub inner: DAffine3,
    /// How many times it is subtracted from what stands beside it: so many heights it goes beyond both ends of an extrusion.
    pub overshoot: u32,
    /// The call that made it, and where that stands.
    pub name: String,
    /// Where.
    pub at: Place,
    /// Of a circle: into how many sides OpenSCAD cuts it.
    pub pieces: u32,
}

/// The plane of an extrusion, seen from a call inside of it.
#[derive(Clone, Copy)]
pub struct Plane {
    /// From the call's coordinates to the plane's.
    pub inner: DAffine3,
    /// How often the call is subtracted.
    pub overshoot: u32,
}

/// The kinds of flat shapes.
#[derive(Clone, Debug, PartialEq)]
pub enum Outline {
    /// A circle around the origin, by its radius.
    Circle(f64),
    /// A rectangle by its lowest corner and its sides.
    Square {
        /// Corner.
        corner: DVec2,
        /// Sides.
        size: DVec2,
    },
    /// What closed paths enclose by the even-odd rule.
    Paths(Vec<Vec<DVec2>>),
}

impl Flat {
    /// Another shape from the same call.
    pub fn with(&self, outline: Outline, inner: DAffine3) -> Self {
        Self { outline, inner, ..self.clone() }
    }

    /// A point of it in the plane.
    pub fn point(&self, p: DVec2) -> DVec2 {
        self.inner.transform_point3(p.extend(0.0)).truncate()
    }

    /// The circle, where it is one in the plane, too.
    pub fn disc(&self) -> Option<Disc> {
        let Outline::Circle(radius) = self.outline else { return None };
        let (x, y) = (self.inner.matrix3.x_axis.truncate(), self.inner.matrix3.y_axis.truncate());
        let (long, wide) = (x.length(), y.length());
        let even = (long - wide).abs() <= SIMILARITY * long && x.dot(y).abs() <= SIMILARITY * long * wide;
        even.then(|| Disc { center: self.inner.translation.truncate(), radius: radius * 0.5 * (long + wide) })
    }

    /// Its paths in the plane; of a circle the polygon that OpenSCAD makes of it.
    pub fn paths(&self) -> Vec<Vec<DVec2>> {
        let all = |path: &[DVec2]| path.iter().map(|p| self.point(*p)).collect();
        match &self.outline {
            Outline::Circle(radius) => vec![all(&ring(*radius, self.pieces))],
            Outline::Square { corner, size } => {
                let at = |x: f64, y: f64| *corner + *size * DVec2::new(x, y);
                vec![all(&[at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)])]
            }
            Outline::Paths(paths) => paths.iter().map(|p| all(p)).collect(),
        }
    }

    /// How far a circle's polygon lies inside of it at most; 0 for what has none.
    pub fn deviation(&self) -> f64 {
        let Outline::Circle(radius) = self.outline else { return 0.0 };
        let m = self.inner.matrix3;
        let size = m.x_axis.length().max(m.y_axis.length());
        radius * size * (1.0 - libm::cos(std::f64::consts::PI / f64::from(self.pieces)))
    }
}
