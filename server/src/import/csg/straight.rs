//! Extrusions with straight walls: of circles, squares and polygons.
//!
//! A polygon that is not convex is the prism of its convex hull, cut down by the half-spaces of the edges of its pockets and holes
//! (`polygon`). Where the hull has too many sides to be one shape, or sides that nearly lie in one plane, half-spaces tell all of the
//! ring. Where no formula tells it, the prism is a mesh.

use super::element::Element;
use super::extrude::Extrusion;
use super::facets::prism;
use super::flat::{Flat, Outline};
use super::measured::Walls;
use super::outlines::crossing;
use super::parts::{Part, PartId, Parts, Signed};
use super::place::{self, PlacedShape};
use super::polygon::{Edge, Island, Region};
use super::{Place, Problem, twist};
use crate::math::tolerance::ROUNDING;
use crate::solid::Op;
use crate::solid::primitive::MeshError;
use glam::{DAffine3, DVec2, DVec3};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// Sides of an island from which on its surface is kept, too: cutting that out of half-spaces one by one takes long.
const MANY_SIDES: usize = 1000;

/// A rectangle beyond all corners by a little: its sides bound nothing.
fn around(corners: &[DVec2]) -> Vec<DVec2> {
    let low = corners.iter().fold(DVec2::INFINITY, |m, p| m.min(*p));
    let high = corners.iter().fold(DVec2::NEG_INFINITY, |m, p| m.max(*p));
    let more = (high - low) / 1024.0;
    let (low, high) = (low - more, high + more);
    vec![low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
}

impl Extrusion {
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
                if let [one] = paths.as_slice()
                    && one.len() <= parts.most_sides()
                {
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
        parts.extrudable(at, paths.iter().map(Vec::len).sum())?;
        let mut region = Region::with_hulls(paths, parts.most_sides());
        // Sides of a hull that nearly lie in one plane would be one: those of a pocket, which the formula tells, would not go along.
        let moves = |island: &Island| {
            let hull = || self.prism(outer, &DAffine3::IDENTITY, &island.hull, flat.overshoot);
            !island.wide && !island.cuts.is_empty() && matches!(hull(), Ok((_, moved)) if moved > 0.0)
        };
        if region.islands.iter().any(moves) {
            region = Region::with_hulls(paths, 0);
        }
        if region.open {
            return Err((at, crossing()));
        }
        if region.crossed {
            let text = "a polygon whose sides cross: filled by the even-odd rule, as OpenSCAD does";
            parts.note(at, text, None);
        }
        if region.intricate {
            return twist::of_region(parts, at, outer, &self.spanned(flat.overshoot), &region);
        }
        if region.islands.is_empty() {
            parts.note(at, format!("a {} without area: left out, as OpenSCAD does", flat.name), None);
            return Ok(Part::Empty);
        }
        let spanned = self.spanned(flat.overshoot);
        let heights = [spanned.low, spanned.low + spanned.height];
        let many = region.rings.iter().map(Vec::len).sum::<usize>() > MANY_SIDES;
        let mut walls = many.then(|| Walls::new(outer, heights, self.scale, &region.rings));
        let mut made = Vec::with_capacity(region.islands.len());
        for island in &region.islands {
            made.extend(self.island(parts, (outer, flat), (&region, island), &mut walls)?);
        }
        let whole = Part::Op(Op::Union, at, made);
        let known = walls.map(|walls| walls.measured(&region.rings));
        // Of walls that the transform leaves hardly apart nothing is known.
        let Some(known) = known.filter(|known| known.doubt < known.moments.volume()) else { return Ok(whole) };
        let whole = parts.push(whole);
        parts.measured.insert(whole, known);
        Ok(Part::Op(Op::Union, at, vec![whole]))
    }

    /// An island of a region; its walls are counted, and given up where they are not what its corners say.
    fn island(
        &self,
        parts: &mut Parts<'_>,
        (outer, flat): (&DAffine3, &Flat),
        (region, island): (&Region, &Island),
        walls: &mut Option<Walls>,
    ) -> Result<Option<PartId>> {
        let at = flat.at;
        let around = if island.wide { around(&island.hull) } else { island.hull.clone() };
        let base = match self.polygon(outer, &DAffine3::IDENTITY, &around, flat.overshoot) {
            Err(Problem::Mesh(MeshError::Flat)) => {
                parts.note(at, format!("a sliver of a {}: left out", flat.name), None);
                *walls = None;
                return Ok(None);
            }
            Err(Problem::Mesh(_)) => return Err((at, self.bent())),
            placed => {
                if placed.as_ref().is_ok_and(|placed| !placed.notes.is_empty()) {
                    *walls = None;
                }
                parts.leaf(&flat.name, at, placed)?
            }
        };
        let base = parts.push(base);
        let mut all = vec![Signed::In(base)];
        for cut in &island.cuts {
            let mut edge =
                |parts: &mut Parts<'_>, e: usize| self.edge(parts, outer, flat, (region.edges[e], walls.as_mut()));
            all.push(parts.formula(at, cut, &mut edge)?);
        }
        let Signed::In(part) = parts.many(true, at, all) else {
            *walls = None;
            return Ok(None);
        };
        // Pockets and holes take no corner away.
        if island.wide {
            let hull = parts.push(Part::Empty);
            let corners = self.corners(outer, &island.hull, flat.overshoot).into_iter().map(Element::point);
            parts.points.insert(hull, corners.collect());
            parts.hulls.insert(part, hull);
        } else if part != base {
            parts.hulls.insert(part, base);
        }
        let rings = &region.rings[island.rings.clone()];
        if rings.iter().map(Vec::len).sum::<usize>() > MANY_SIDES {
            let (outer, spanned, rings) = (*outer, self.spanned(flat.overshoot), rings.to_vec());
            parts.prisms.insert(part, Box::new(move || twist::surface(&outer, &spanned, &rings)));
        }
        Ok(Some(part))
    }

    /// Corners of both ends over an outline.
    fn corners(&self, outer: &DAffine3, outline: &[DVec2], overshoot: u32) -> Vec<DVec3> {
        let (low, high) = self.span(overshoot);
        let ends = |p: &DVec2| [p.extend(low), (*p * self.scale).extend(high)];
        outline.iter().flat_map(ends).map(|p| outer.transform_point3(p)).collect()
    }

    /// The half-space of an edge with the inside on its left: vertical, or towards where the scale has it at the top. It is counted
    /// among the walls.
    fn edge(
        &self,
        parts: &mut Parts<'_>,
        outer: &DAffine3,
        flat: &Flat,
        ([p, q], walls): (Edge, Option<&mut Walls>),
    ) -> Result<Signed> {
        let t = q - p;
        let (low, high) = self.span(flat.overshoot);
        let up = (p * self.scale - p).extend(high - low);
        let bend = t.perp_dot(t * self.scale).abs();
        if bend > ROUNDING * t.length_squared() {
            return Err((flat.at, self.bent()));
        }
        let normal = t.extend(0.0).cross(up);
        let placed = place::half_space_at(outer, normal, p.extend(low));
        if let Some(walls) = walls {
            walls.add([p, q], &placed.frame);
        }
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
        let (mut placed, moved) = self.prism(outer, inner, outline, overshoot)?;
        if moved > 0.0 {
            let text = "a polygon that is not quite convex: taken as the hull of its sides";
            placed.notes.push((text.into(), Some(moved)));
        }
        Ok(placed)
    }

    /// The same, and how far it was moved to be convex. Either way round is the same outline, and so is one with corners on its sides.
    fn prism(
        &self,
        outer: &DAffine3,
        inner: &DAffine3,
        outline: &[DVec2],
        overshoot: u32,
    ) -> std::result::Result<(PlacedShape, f64), Problem> {
        let (low, high) = self.span(overshoot);
        let bottom: Vec<DVec2> = outline.iter().map(|p| inner.transform_point3(p.extend(0.0)).truncate()).collect();
        let top: Vec<DVec2> = bottom.iter().map(|p| *p * self.scale).collect();
        let (points, faces) = prism(&bottom, &top, low, high);
        place::polyhedron(outer, &points, &faces).map(|(placed, fit)| (placed, fit.moved))
    }
}
