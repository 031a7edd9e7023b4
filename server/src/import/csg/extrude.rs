//! Outlines and their extrusion: circle, square and polygon between two heights.
//!
//! A polygon that is not convex is the prism of its convex hull, cut down by the half-spaces of the edges of its pockets and holes
//! (`polygon`).
//!
//! An extrusion without twist distributes over set operations: each of its cross-sections is the same outline, moved
//! and scaled by a bijection. So `linear_extrude` of a difference is the difference of linear_extrudes, and the lowering
//! walks through 2D operations as through solid ones. What is subtracted in 2D is extruded beyond both ends
//! (`overshoot`), so that no cap of a hole coincides with a cap of the part.

use super::arguments::{Arguments, finite};
use super::facets::prism;
use super::flat::{Flat, Outline};
use super::outlines::crossing;
use super::parts::{Part, PartId, Parts, Signed};
use super::place::{self, PlacedShape};
use super::polygon::{Edge, Region};
use super::slices::{Curve, slices};
use super::syntax::{Call, ValueKind};
use super::{Place, Problem};
use crate::math::tolerance::ROUNDING;
use crate::solid::Op;
use crate::solid::primitive::MeshError;
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
    fn span(&self, overshoot: u32) -> (f64, f64) {
        let more = if self.scale == DVec2::ONE { f64::from(overshoot) * self.height } else { 0.0 };
        (self.low - more, self.low + self.height + more)
    }

    /// What a flat shape becomes.
    pub fn part(&self, parts: &mut Parts<'_>, outer: &DAffine3, flat: &Flat) -> Result<Part> {
        let leaf = |parts: &mut Parts<'_>, placed| parts.leaf(&flat.name, flat.at, placed);
        match &flat.outline {
            Outline::Circle(radius) => match self.circle(outer, &flat.inner, *radius, flat.overshoot) {
                Err(Problem::Unsupported { construct, .. }) => {
                    let part = self.paths(parts, outer, flat, &flat.paths())?;
                    parts.faceted(flat.at, &construct, flat.pieces as usize + 2, flat.deviation());
                    Ok(part)
                }
                placed => leaf(parts, placed),
            },
            Outline::Square { corner, size } => {
                leaf(parts, self.square(outer, &flat.inner, *corner, *size, flat.overshoot))
            }
            Outline::Paths(paths) => {
                if let [one] = paths.as_slice() {
                    parts.affordable(flat.at, one.len() + 2)?;
                    match self.polygon(outer, &flat.inner, one, flat.overshoot) {
                        Err(Problem::Mesh(_)) => {}
                        placed => return leaf(parts, placed),
                    }
                }
                self.paths(parts, outer, flat, &flat.paths())
            }
        }
    }

    /// Any paths, in the plane.
    fn paths(&self, parts: &mut Parts<'_>, outer: &DAffine3, flat: &Flat, paths: &[Vec<DVec2>]) -> Result<Part> {
        let at = flat.at;
        parts.affordable(at, paths.iter().map(Vec::len).sum::<usize>() + 2)?;
        let region = Region::of_paths(paths);
        if region.open {
            return Err((at, crossing()));
        }
        if region.crossed {
            let text = "a polygon whose sides cross: filled by the even-odd rule, as OpenSCAD does";
            parts.note(at, text, None);
        }
        if region.islands.is_empty() {
            parts.note(at, format!("a {} without area: left out, as OpenSCAD does", flat.name), None);
            return Ok(Part::Empty);
        }
        let mut made = Vec::with_capacity(region.islands.len());
        for island in &region.islands {
            let hull = match self.polygon(outer, &DAffine3::IDENTITY, &island.hull, flat.overshoot) {
                Err(Problem::Mesh(MeshError::Flat)) => {
                    parts.note(at, format!("a sliver of a {}: left out", flat.name), None);
                    continue;
                }
                Err(Problem::Mesh(_)) => return Err((at, self.bent())),
                placed => parts.leaf(&flat.name, at, placed)?,
            };
            let hull = parts.push(hull);
            let mut all = vec![Signed::In(hull)];
            for cut in &island.cuts {
                let mut edge = |parts: &mut Parts<'_>, e: usize| self.edge(parts, outer, flat, region.edges[e]);
                all.push(parts.formula(at, cut, &mut edge)?);
            }
            if let Signed::In(part) = parts.many(true, at, all) {
                // Pockets and holes take no corner away.
                if part != hull {
                    parts.hulls.insert(part, hull);
                }
                made.push(part);
            }
        }
        Ok(Part::Op(Op::Union, at, made))
    }

    /// The half-space of an edge with the inside on its left: vertical, or towards where the scale has it at the top.
    fn edge(&self, parts: &mut Parts<'_>, outer: &DAffine3, flat: &Flat, [p, q]: Edge) -> Result<Signed> {
        let t = q - p;
        let (low, high) = self.span(flat.overshoot);
        let up = (p * self.scale - p).extend(high - low);
        let bend = t.perp_dot(t * self.scale).abs();
        if bend > ROUNDING * t.length_squared() {
            return Err((flat.at, self.bent()));
        }
        let normal = t.extend(0.0).cross(up);
        let placed = place::half_space_at(outer, normal, p.extend(low));
        let leaf = parts.leaf(&format!("{} edge", flat.name), flat.at, Ok(placed))?;
        let part: PartId = parts.push(leaf);
        Ok(Signed::In(part))
    }

    fn bent(&self) -> Problem {
        let hint = " (scale both axes alike, or build the shape of convex polyhedra)";
        Problem::Unsupported { construct: "non-uniform scale of linear_extrude on a polygon".into(), hint }
    }

    /// A circle of radius `radius` around the origin of `inner`.
    fn circle(
        &self,
        outer: &DAffine3,
        inner: &DAffine3,
        radius: f64,
        overshoot: u32,
    ) -> std::result::Result<PlacedShape, Problem> {
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
    fn square(
        &self,
        outer: &DAffine3,
        inner: &DAffine3,
        corner: DVec2,
        size: DVec2,
        overshoot: u32,
    ) -> std::result::Result<PlacedShape, Problem> {
        if self.scale == DVec2::ONE {
            let (low, high) = self.span(overshoot);
            let center = (corner + size * 0.5).extend(0.5 * (low + high));
            return place::cuboid(&(*outer * *inner), center, (size * 0.5).extend(0.5 * (high - low)));
        }
        let c = |x: f64, y: f64| corner + size * DVec2::new(x, y);
        self.polygon(outer, inner, &[c(0.0, 0.0), c(1.0, 0.0), c(1.0, 1.0), c(0.0, 1.0)], overshoot)
    }

    /// A convex polygon, either way round; another one is an error of its mesh.
    fn polygon(
        &self,
        outer: &DAffine3,
        inner: &DAffine3,
        outline: &[DVec2],
        overshoot: u32,
    ) -> std::result::Result<PlacedShape, Problem> {
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
            Err(other) => Err(other),
        }
    }
}
