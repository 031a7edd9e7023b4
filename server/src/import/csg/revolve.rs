//! Revolved outlines: every edge of a meridian outline is a half-plane aρ + bz <= c, which about the axis is a cone, a cylinder or a
//! plane where a > 0 or a = 0, and what is outside of one where a < 0; the outline's formula stays as it is.
//!
//! A cone is taken between two heights beyond the outline's own, or from its apex on: the discs there decide nothing, for
//! the outline's hull ends before them. What is always true on the outline's side of the axis is left out.

use super::arguments::Arguments;
use super::facets::{direction, prism, ring};
use super::parts::{Part, PartId, Parts, Signed};
use super::place;
use super::polygon::{Edge, Island, MOST_LEVELS, Region};
use super::syntax::Call;
use super::{Place, Problem};
use crate::math::tolerance::ROUNDING;
use crate::solid::Op;
use glam::{DAffine3, DVec2, DVec3};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// a of a half-plane, as a part of its normal, up to which it is a plane across the axis.
const SQUARE: f64 = 1e-12;
/// How far cones go beyond an outline, in its heights.
const BEYOND: f64 = 0.25;

/// Which part of a turn, in degrees from +x counter-clockwise.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    /// Where it begins.
    pub start: f64,
    /// How far it goes: (0, 360].
    pub angle: f64,
}

impl Turn {
    /// Its arguments by name; `origin` and `scale` belong to drawings of other files, and are written without one, too.
    pub fn arguments(call: &Call) -> Result<Arguments<'_>> {
        const OWN: [&str; 6] = ["angle", "start", "origin", "scale", "layer", "timestamp"];
        if call.children.is_empty() {
            return Arguments::new(call, &[&OWN[..], &["file"]].concat());
        }
        Arguments::new(call, &OWN)
    }

    /// Reads the arguments of `rotate_extrude`; `None` for no turn at all.
    pub fn new(call: &Call) -> Result<Option<Self>> {
        let arguments = Self::arguments(call)?;
        let angle = arguments.number_or("angle", 360.0)?;
        if !(-360.0..=360.0).contains(&angle) || angle == 360.0 || angle == -360.0 {
            return Ok(Some(Self { start: 180.0, angle: 360.0 }));
        }
        let start = arguments.number_or("start", 0.0)?;
        if !start.is_finite() {
            return Err((call.at, Problem::syntax("a finite number as start of rotate_extrude", start.to_string())));
        }
        let start = if angle < 0.0 { start + angle } else { start };
        Ok((angle != 0.0).then_some(Self { start, angle: angle.abs() }))
    }

    /// The half-spaces beside the axis that cut a part of a turn out of a whole one; `None` for a whole one.
    pub fn wedge(&self, parts: &mut Parts<'_>, at: Place, outer: &DAffine3) -> Result<Option<PartId>> {
        if self.angle >= 360.0 {
            return Ok(None);
        }
        let (from, to) = (direction(self.start), direction(self.start + self.angle));
        let mut sides = Vec::new();
        for normal in [-from.perp(), to.perp()] {
            let placed = place::half_space_at(outer, normal.extend(0.0), DVec3::ZERO);
            let leaf = parts.leaf("rotate_extrude end", at, Ok(placed))?;
            sides.push(parts.push(leaf));
        }
        let op = if self.angle <= 180.0 { Op::Intersection } else { Op::Union };
        Ok(Some(parts.op(op, at, sides)))
    }
}

/// What a revolved outline is made into.
pub struct Lathe<'t> {
    /// The name for its faces.
    pub name: &'t str,
    /// Where the call stands.
    pub at: Place,
    /// From the outline's plane (x away from the axis, y along it, which is z) to the model.
    pub outer: &'t DAffine3,
    /// The normals of the flat sides in place of a round one, over the cosine of half an angle between them; empty: round.
    pub sides: Vec<DVec2>,
}

impl Lathe<'_> {
    /// Flat sides as OpenSCAD has them: `count` over the turn.
    pub fn flat_sides(turn: &Turn, count: u32) -> Vec<DVec2> {
        let step = turn.angle / f64::from(count);
        let wide = 1.0 / libm::cos((0.5 * step).to_radians());
        (0..count).map(|k| direction(turn.start + (f64::from(k) + 0.5) * step) * wide).collect()
    }

    /// All of a region about the axis.
    pub fn region(&self, parts: &mut Parts<'_>, region: &Region) -> Result<Part> {
        if region.intricate {
            let expected = format!(
                "an outline whose formula has at most {MOST_LEVELS} levels (divide it into parts that overlap)"
            );
            return Err((self.at, Problem::syntax(expected, "one that is deeper, such as a spiral")));
        }
        let mut made = Vec::new();
        for island in &region.islands {
            if let Some(part) = self.island(parts, region, island)? {
                made.push(part);
            }
        }
        Ok(Part::Op(Op::Union, self.at, made))
    }

    fn island(&self, parts: &mut Parts<'_>, region: &Region, island: &Island) -> Result<Option<PartId>> {
        let hull = &island.hull;
        let heights = hull.iter().map(|p| p.y);
        let (low, high) = (heights.clone().fold(f64::INFINITY, f64::min), heights.fold(f64::NEG_INFINITY, f64::max));
        if hull.iter().all(|p| p.x <= 0.0) {
            return Ok(None);
        }
        let sides: Vec<Edge> = (0..hull.len()).map(|i| [hull[i], hull[(i + 1) % hull.len()]]).collect();
        if let Some(one) = self.round(&sides, (low, high)).filter(|_| island.cuts.is_empty()) {
            let leaf = parts.leaf(self.name, self.at, one)?;
            return Ok(Some(parts.push(leaf)));
        }
        let mut all = Vec::new();
        if !self.sides.is_empty() {
            all.push(self.around(parts, hull, (low, high))?);
        }
        for side in &sides {
            all.push(self.edge(parts, *side, (low, high))?);
        }
        for cut in &island.cuts {
            let mut edge = |parts: &mut Parts<'_>, e: usize| self.edge(parts, region.edges[e], (low, high));
            all.push(parts.formula(self.at, cut, &mut edge)?);
        }
        match parts.many(true, self.at, all) {
            Signed::In(part) => Ok(Some(part)),
            Signed::Out(_) | Signed::Known(_) => Ok(None),
        }
    }

    /// An outline with one side, between two heights or to an apex, is one cylinder or cone.
    fn round(&self, sides: &[Edge], heights: (f64, f64)) -> Option<std::result::Result<place::PlacedShape, Problem>> {
        if !self.sides.is_empty() {
            return None;
        }
        let mut wall = None;
        for side in sides {
            let (a, known) = half_plane(*side, heights);
            if known.is_some() || a.abs() <= SQUARE {
                continue;
            }
            if a < 0.0 || wall.is_some() {
                return None;
            }
            wall = Some(*side);
        }
        // Its ends are the outline's.
        let [p, q] = wall.filter(|[p, q]| p.y == heights.0 && q.y == heights.1 && p.x >= 0.0 && q.x >= 0.0)?;
        let middle = DVec3::new(0.0, 0.0, 0.5 * (p.y + q.y));
        Some(place::cylinder(self.outer, middle, p.x, q.x, q.y - p.y))
    }

    /// A box around an outline with flat sides, for these have no bounds.
    fn around(&self, parts: &mut Parts<'_>, hull: &[DVec2], (low, high): (f64, f64)) -> Result<Signed> {
        let far = hull.iter().map(|p| p.x).fold(0.0, f64::max);
        let wide = self.sides.iter().map(|s| s.length()).fold(1.0, f64::max);
        let more = BEYOND * (high - low);
        let square = ring(1.5 * far * wide, 4);
        let (corners, faces) = prism(&square, &square, low - more, high + more);
        let leaf = parts.leaf(self.name, self.at, place::polyhedron(self.outer, &corners, &faces).map(|p| p.0))?;
        Ok(Signed::In(parts.push(leaf)))
    }

    /// What the half-plane of an edge is about the axis.
    fn edge(&self, parts: &mut Parts<'_>, edge: Edge, heights: (f64, f64)) -> Result<Signed> {
        let (a, known) = half_plane(edge, heights);
        if let Some(known) = known {
            return Ok(Signed::Known(known));
        }
        let [p, q] = edge;
        if a.abs() <= SQUARE {
            let normal = DVec3::Z * if q.x > p.x { -1.0 } else { 1.0 };
            let placed = place::half_space_at(self.outer, normal, DVec3::Z * p.y);
            let leaf = parts.leaf(self.name, self.at, Ok(placed))?;
            return Ok(Signed::In(parts.push(leaf)));
        }
        if !self.sides.is_empty() {
            return self.flat(parts, edge, a > 0.0);
        }
        // The radius along the axis, about the end that is farther out: there it is told best.
        let from = if p.x > q.x { p } else { q };
        let slope = (q.x - p.x) / (q.y - p.y);
        let radius = |z: f64| from.x + (z - from.y) * slope;
        // Those that are taken away go on where the others have ended.
        let more = if a > 0.0 { BEYOND } else { 2.0 * BEYOND } * (heights.1 - heights.0);
        let (mut low, mut high) = (heights.0 - more, heights.1 + more);
        let (mut bottom, mut top) = (radius(low), radius(high));
        let apex = from.y - from.x / slope;
        if bottom < 0.0 {
            (low, bottom) = (apex, 0.0);
        }
        if top < 0.0 {
            (high, top) = (apex, 0.0);
        }
        let middle = DVec3::new(0.0, 0.0, 0.5 * (low + high));
        let placed = place::cylinder(self.outer, middle, bottom, top, high - low);
        let leaf = parts.leaf(self.name, self.at, placed)?;
        let part = parts.push(leaf);
        Ok(if a > 0.0 { Signed::In(part) } else { Signed::Out(part) })
    }

    /// The half-plane of an edge with flat sides: on all of them, or on one.
    fn flat(&self, parts: &mut Parts<'_>, [p, q]: Edge, all: bool) -> Result<Signed> {
        let t = (q - p).normalize();
        let mut planes = Vec::with_capacity(self.sides.len());
        for side in &self.sides {
            let point = (*side / side.length_squared() * p.x).extend(p.y);
            let placed = place::half_space_at(self.outer, (*side * t.y).extend(-t.x), point);
            let leaf = parts.leaf(self.name, self.at, Ok(placed))?;
            planes.push(Signed::In(parts.push(leaf)));
        }
        Ok(parts.many(all, self.at, planes))
    }
}

/// a of an edge's half-plane aρ + bz <= c, and whether that holds everywhere or nowhere at these heights.
fn half_plane([p, q]: Edge, (low, high): (f64, f64)) -> (f64, Option<bool>) {
    let t = (q - p).normalize();
    let (a, b) = (t.y, -t.x);
    // On the axis, where what is left of the axis matters.
    let on_axis = [low, high].map(|z| b * (z - p.y) - a * p.x);
    // On the axis exactly where a corner lies there, but for rounding.
    let lost = ROUNDING * (high - low + p.x.abs());
    let known = if a < -SQUARE && on_axis[0].max(on_axis[1]) <= lost {
        Some(true)
    } else if a > SQUARE && on_axis[0].min(on_axis[1]) >= 0.0 {
        Some(false)
    } else {
        None
    };
    (a, known)
}
