//! Outlines and their extrusion: circle, square and polygon between two heights.
//!
//! What it makes of them where its walls are straight: `straight`; where they bend: `twist`.
//!
//! An extrusion without twist distributes over set operations: each of its cross-sections is the same outline, moved
//! and scaled by a bijection. So `linear_extrude` of a difference is the difference of linear_extrudes, and the lowering
//! walks through 2D operations as through solid ones. What is subtracted in 2D is extruded beyond both ends
//! (`overshoot`), so that no cap of a hole coincides with a cap of the part.

use super::arguments::{Arguments, finite};
use super::flat::{Flat, Outline};
use super::slices::{Curve, slices};
use super::syntax::{Call, ValueKind};
use super::{Place, Problem};
use crate::math::tolerance::ROUNDING;
use glam::{DAffine3, DMat3, DVec2, DVec3};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// A `linear_extrude`: outlines at z = `low`, scaled by `scale` at z = `low + height`.
#[derive(Clone, Copy, Debug)]
pub struct Extrusion {
    /// z of its lower end.
    pub low: f64,
    /// How high it is.
    pub height: f64,
    /// Of the outline at the upper end.
    pub scale: DVec2,
    /// Degrees by which that is turned, clockwise.
    pub twist: f64,
    /// Slices that the text asks for.
    slices: Option<f64>,
    curve: Curve,
    /// Columns of the outer transform: a slanted extrusion is a sheared straight one.
    slant: DMat3,
}

impl Extrusion {
    /// Its arguments by name. With straight walls, `slices` and `segments` cut flat walls into flat pieces: they change nothing.
    pub fn arguments(call: &Call) -> Result<Arguments<'_>> {
        const OWN: [&str; 7] = ["height", "center", "twist", "slices", "scale", "segments", "v"];
        if call.children.is_empty() {
            return Arguments::new(call, &[&OWN[..], &["file", "layer", "origin", "timestamp"]].concat());
        }
        Arguments::new(call, &OWN)
    }

    /// Reads the arguments of `linear_extrude`.
    ///
    /// `None` for a height of zero or less.
    pub fn new(call: &Call) -> Result<Option<Self>> {
        let arguments = Self::arguments(call)?;
        let Some(mut height) = arguments.finite_size("height")? else { return Ok(None) };
        let twist = arguments.number_or("twist", 0.0)?;
        if !twist.is_finite() {
            return Err((call.at, Problem::syntax("a finite number as twist of linear_extrude", twist.to_string())));
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
        let mut extrusion = Self { low, height, scale, twist, slices: None, curve: Curve::default(), slant };
        if twist != 0.0 || scale.x != scale.y {
            // Where they count; elsewhere they may be anything.
            extrusion.slices = Some(arguments.number_or("slices", 0.0)?.floor()).filter(|n| *n >= 1.0);
            extrusion.curve = Curve::of(&arguments)?;
        }
        Ok(Some(extrusion))
    }

    /// True where the walls of some flat shapes are no planes, cylinders or cones.
    pub fn bends<'f>(&self, mut flats: impl Iterator<Item = &'f Flat>) -> bool {
        let straight = |flat: &Flat| match flat.outline {
            Outline::Circle(_) => false,
            Outline::Square { .. } | Outline::Paths(_) => flat.paths().iter().all(|path| {
                (0..path.len()).all(|i| {
                    let t = path[(i + 1) % path.len()] - path[i];
                    t.perp_dot(t * self.scale).abs() <= ROUNDING * t.length_squared()
                })
            }),
        };
        self.twist != 0.0 || self.scale.x != self.scale.y && !flats.all(straight)
    }

    /// True where walls may bend.
    pub fn may_bend(&self) -> bool {
        self.twist != 0.0 || self.scale.x != self.scale.y
    }

    /// Slices that OpenSCAD cuts it into, of an outline with some corners.
    pub fn slices(&self, corners: &[DVec2]) -> usize {
        if !self.may_bend() {
            return 1;
        }
        let own = || slices(corners, self.height, self.twist, self.scale, &self.curve);
        self.slices.unwrap_or_else(own).min(f64::from(u32::MAX)) as usize
    }

    /// `outer` with the slant.
    pub fn slanted(&self, outer: &DAffine3) -> DAffine3 {
        DAffine3 { matrix3: outer.matrix3 * self.slant, translation: outer.translation }
    }

    /// Low and high end; `overshoot` heights further out on both sides where the cross-section stays the same.
    pub fn span(&self, overshoot: u32) -> (f64, f64) {
        let more = if self.scale == DVec2::ONE { f64::from(overshoot) * self.height } else { 0.0 };
        (self.low - more, self.low + self.height + more)
    }

    /// The same between these.
    pub fn spanned(&self, overshoot: u32) -> Self {
        let (low, high) = self.span(overshoot);
        Self { low, height: high - low, ..*self }
    }
}
