//! Outlines and their extrusion: circle, square and convex polygon between two heights.
//!
//! An extrusion without twist distributes over set operations: each of its cross-sections is the same outline, moved
//! and scaled by a bijection. So `linear_extrude` of a difference is the difference of linear_extrudes, and the lowering
//! walks through 2D operations as through solid ones. What is subtracted in 2D is extruded beyond both ends
//! (`overshoot`), so that no cap of a hole coincides with a cap of the part.

use super::arguments::{Arguments, finite};
use super::place::{self, Placed};
use super::syntax::{Call, ValueKind};
use super::{Place, Problem};
use crate::math::tolerance::ROUNDING;
use crate::solid::primitive::MeshError;
use glam::{DAffine3, DMat3, DVec2, DVec3};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// A `linear_extrude`: outlines at z = `low`, scaled by `scale` at z = `low + height`.
#[derive(Clone, Copy, Debug)]
pub struct Extrusion {
    low: f64,
    height: f64,
    scale: DVec2,
    /// Columns of the outer transform: a slanted extrusion is a sheared straight one.
    slant: DMat3,
}

impl Extrusion {
    /// Its arguments by name. Without twist, `slices` and `segments` cut flat walls into flat pieces: they change nothing.
    pub fn arguments(call: &Call) -> Result<Arguments<'_>> {
        Arguments::new(call, &["height", "center", "twist", "slices", "scale", "segments", "v"])
    }

    /// Reads the arguments of `linear_extrude`.
    pub fn new(call: &Call) -> Result<Self> {
        let arguments = Self::arguments(call)?;
        let mut height = arguments.finite_positive("height")?;
        if arguments.number_or("twist", 0.0)? != 0.0 {
            return Err((call.at, Problem::unsupported("twist of linear_extrude")));
        }
        let scale = arguments.pair_or("scale", DVec2::ONE)?;
        if scale.min_element() < 0.0 {
            let found = format!("[{}, {}]", scale.x, scale.y);
            return Err((call.at, Problem::syntax("scale of linear_extrude that is not negative", found)));
        }
        let mut slant = DMat3::IDENTITY;
        if let Some(v) = arguments.get("v") {
            let along = match &v.kind {
                ValueKind::List(l) if l.len() == 3 => DVec3::new(finite(&l[0])?, finite(&l[1])?, finite(&l[2])?),
                _ => return Err((v.at, Problem::syntax("three numbers as v of linear_extrude", v.found()))),
            };
            let Some(along) = along.try_normalize().filter(|a| a.z > ROUNDING) else {
                return Err((v.at, Problem::syntax("v of linear_extrude with a positive z", v.found())));
            };
            height *= along.z;
            slant.z_axis = along / along.z;
        }
        let low = if arguments.bool_or("center", false)? { -0.5 * height } else { 0.0 };
        Ok(Self { low, height, scale, slant })
    }

    /// `outer` with the slant.
    pub fn slanted(&self, outer: &DAffine3) -> DAffine3 {
        DAffine3 { matrix3: outer.matrix3 * self.slant, translation: outer.translation }
    }

    /// Low and high end; `overshoot` heights further out on both sides where the cross-section stays the same.
    fn span(&self, overshoot: u32) -> (f64, f64) {
        let more = if self.scale == DVec2::ONE { f64::from(overshoot) * self.height } else { 0.0 };
        (self.low - more, self.low + self.height + more)
    }

    /// A circle of radius `radius` around the origin of `inner`.
    pub fn circle(
        &self,
        outer: &DAffine3,
        inner: &DAffine3,
        radius: f64,
        overshoot: u32,
    ) -> std::result::Result<Placed, Problem> {
        let (low, high) = self.span(overshoot);
        let center = DVec3::new(0.0, 0.0, 0.5 * (low + high));
        if self.scale.x != self.scale.y {
            return Err(Problem::unsupported("non-uniform scale of linear_extrude on a circle"));
        }
        let off_center = inner.translation.truncate().length();
        if self.scale.x != 1.0 && off_center > ROUNDING * radius * inner.matrix3.x_axis.length() {
            return Err(Problem::unsupported("scale of linear_extrude on a circle that is not around the origin"));
        }
        place::cylinder(&(*outer * *inner), center, radius, radius * self.scale.x, high - low)
    }

    /// A rectangle from `corner`, with sides `size`.
    pub fn square(
        &self,
        outer: &DAffine3,
        inner: &DAffine3,
        corner: DVec2,
        size: DVec2,
        overshoot: u32,
    ) -> std::result::Result<Placed, Problem> {
        if self.scale == DVec2::ONE {
            let (low, high) = self.span(overshoot);
            let center = (corner + size * 0.5).extend(0.5 * (low + high));
            return place::cuboid(&(*outer * *inner), center, (size * 0.5).extend(0.5 * (high - low)));
        }
        let c = |x: f64, y: f64| corner + size * DVec2::new(x, y);
        self.polygon(outer, inner, &[c(0.0, 0.0), c(1.0, 0.0), c(1.0, 1.0), c(0.0, 1.0)], overshoot)
    }

    /// A convex polygon, either way round.
    pub fn polygon(
        &self,
        outer: &DAffine3,
        inner: &DAffine3,
        outline: &[DVec2],
        overshoot: u32,
    ) -> std::result::Result<Placed, Problem> {
        let (low, high) = self.span(overshoot);
        let bottom: Vec<DVec2> = outline.iter().map(|p| inner.transform_point3(p.extend(0.0)).truncate()).collect();
        let top: Vec<DVec2> = bottom.iter().map(|p| *p * self.scale).collect();
        let (points, faces) = prism(&bottom, &top, low, high);
        match place::polyhedron(outer, &points, &faces) {
            // Either way round is the same outline, and so is one with corners on its sides.
            Ok((mut placed, fit)) => {
                if fit.moved > 0.0 {
                    let text = "a polygon that is not quite convex: taken as the hull of its sides";
                    placed.notes.push((text.into(), Some(fit.moved)));
                }
                Ok(placed)
            }
            Err(Problem::Mesh(MeshError::Flat)) => Err(Problem::syntax("a polygon with an area", "none")),
            Err(Problem::Mesh(_)) if self.scale.x != self.scale.y => {
                Err(Problem::unsupported("non-uniform scale of linear_extrude on a polygon"))
            }
            Err(Problem::Mesh(_)) => Err(Problem::unsupported("a polygon that is not convex")),
            Err(other) => Err(other),
        }
    }
}

/// The mesh between two outlines with equally many corners, counter-clockwise; an outline may shrink to one point.
pub fn prism(bottom: &[DVec2], top: &[DVec2], low: f64, high: f64) -> (Vec<DVec3>, Vec<Vec<u32>>) {
    let n = bottom.len() as u32;
    let points = bottom.iter().map(|p| p.extend(low)).chain(top.iter().map(|p| p.extend(high))).collect();
    let mut faces: Vec<Vec<u32>> = (0..n).map(|i| vec![i, n + i, n + (i + 1) % n, (i + 1) % n]).collect();
    faces.push((n..2 * n).rev().collect());
    faces.push((0..n).collect());
    (points, faces)
}

/// The corners that OpenSCAD gives a circle of `fragments` sides: the first on +x, counter-clockwise. Multiples of 30°
/// are exact, as they are in OpenSCAD.
pub fn ring(radius: f64, fragments: u32) -> Vec<DVec2> {
    (0..fragments).map(|i| turn(i, fragments) * radius).collect()
}

/// Cosine and sine of the `i`-th of `n` parts of a full turn.
pub fn turn(i: u32, n: u32) -> DVec2 {
    let h = 0.5 * 3f64.sqrt();
    let twelfths: [[f64; 2]; 12] = [
        [1.0, 0.0],
        [h, 0.5],
        [0.5, h],
        [0.0, 1.0],
        [-0.5, h],
        [-h, 0.5],
        [-1.0, 0.0],
        [-h, -0.5],
        [-0.5, -h],
        [0.0, -1.0],
        [0.5, -h],
        [h, -0.5],
    ];
    let (i, n) = (u64::from(i), u64::from(n));
    if (12 * i).is_multiple_of(n) {
        return DVec2::from_array(twelfths[(12 * i / n % 12) as usize]);
    }
    let (sin, cos) = libm::sincos(std::f64::consts::TAU * i as f64 / n as f64);
    DVec2::new(cos, sin)
}
