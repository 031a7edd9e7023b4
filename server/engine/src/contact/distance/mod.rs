//! How far apart two bodies are: certified bounds of the least distance at an instant or over a step, its time, both points.
//!
//! Branch and bound over pairs of parts (`part`) and spans of time, the lowest bound first (A. Land, A. Doig,
//! Econometrica 28(3), 1960). From below a pair of parts is bounded by directions and faces (`search`): every point of
//! the parts is within the hull of some points, thickened by a radius. From above two points are made nearest
//! (`polish`), proven inside of their bodies. docs/algorithm/clearance.md has the formulas.
//!
//! f of a tree is at most the distance and less at sharp features; these bounds are of the distance itself.

pub(in crate::contact) mod active_set;
mod common;
mod convex;
mod facets;
pub(in crate::contact) mod part;
pub(in crate::contact) mod polish;
pub(in crate::contact) mod polytope;
mod search;
mod span;

use crate::contact::exclusion::rounding;
use crate::contact::query::outcome::NO_FACE;
use crate::contact::query::question::{PlacedModel, without_own_spin};
use crate::math::halt::Halt;
use crate::motion::Relative;
use crate::octree::Model;
use glam::DVec3;

/// A question: two bodies, and how exactly it is asked.
#[derive(Clone, Copy, Debug)]
pub struct DistanceQuery<'a> {
    /// The first body.
    pub a: PlacedModel<'a>,
    /// The second one.
    pub b: PlacedModel<'a>,
    /// How far apart the bounds may be: a length, raised to what rounding allows.
    pub tolerance: f64,
    /// Pairs of parts that may be looked at: then the bounds stay as far apart as they are.
    pub limit: u64,
}

/// Bounds come as near to each other as this many times what rounding may take from one of them: points are moved inwards by some of it.
const LEAST: f64 = 8.0;

/// Pairs of parts that a distance may cost by default.
pub const DEFAULT_LIMIT: u64 = 200_000;

/// A point of a body next to another body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearPoint {
    /// Where it is, world frame, at the time of the least distance.
    pub point: DVec3,
    /// Faces of the body there, by face id within its model; `NO_FACE` fills.
    pub faces: [u32; 3],
}

impl NearPoint {
    /// No point.
    const NONE: Self = Self { point: DVec3::NAN, faces: [NO_FACE; 3] };
}

/// How far apart two bodies are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// Proven: no two points of the bodies are nearer to each other. A length; infinite where a body has no points.
    pub lower: f64,
    /// Proven: two points of them are no farther apart, `a` and `b` but for rounding. 0 where a point is known that they share; infinite
    /// where no points were found.
    pub upper: f64,
    /// When these are so near, fraction of the step.
    pub time: f64,
    /// The point of the first body; NaN where none was found.
    pub a: NearPoint,
    /// The point of the second body.
    pub b: NearPoint,
    /// True when the bounds are as near to each other as was asked, or as rounding lets them be.
    pub is_settled: bool,
    /// What rounding may take from a bound, a length: bodies that are no farther apart touch, for all that numbers tell.
    pub rounding: f64,
    /// Pairs of parts that were looked at.
    pub cells: u64,
}

/// The distance of two bodies at a time of their motion, fraction of the step.
pub fn at_instant(query: &DistanceQuery, time: f64) -> Distance {
    between(query, time, time, None)
}

/// The least distance of two bodies over their motion.
pub fn over_step(query: &DistanceQuery) -> Distance {
    between(query, 0.0, 1.0, None)
}

/// The same, where `halt` ends the search as its limit does.
pub fn over_step_heeding(query: &DistanceQuery, halt: &Halt) -> Distance {
    between(query, 0.0, 1.0, Some(halt))
}

/// What is known of a least distance that there was no time to look for.
pub fn unknown() -> Distance {
    let [a, b] = [NearPoint::NONE; 2];
    Distance { lower: 0.0, upper: f64::INFINITY, time: 0.0, a, b, is_settled: false, rounding: 0.0, cells: 0 }
}

/// The least distance between two times of the motion.
fn between(query: &DistanceQuery, from: f64, to: f64, halt: Option<&Halt>) -> Distance {
    let (a, b) = (without_own_spin(&query.a), without_own_spin(&query.b));
    let (model_a, model_b) = (query.a.model, query.b.model);
    if model_a.solid.is_empty() || model_b.solid.is_empty() {
        let (lower, upper) = (f64::INFINITY, f64::INFINITY);
        return Distance {
            lower,
            upper,
            time: from,
            a: NearPoint::NONE,
            b: NearPoint::NONE,
            is_settled: true,
            rounding: 0.0,
            cells: 0,
        };
    }
    let relative = Relative::new(a, b);
    let rounding = rounding::of_both(model_a, model_b, &relative);
    if from == to
        && let Some(answer) = convex::at_instant([model_a, model_b], &relative, rounding, query.tolerance, from)
    {
        return answer;
    }
    let both = [relative, Relative::new(b, a)];
    let Some(mut front) = facets::Search::new(query, &both, rounding, halt) else {
        return search::Search::new(query, both, rounding, halt).run(from, to);
    };
    if let Some(answer) = front.run(from, to) {
        return answer;
    }
    // What it has cost and proven counts.
    let (cells, lower) = front.left();
    let rest = DistanceQuery { limit: query.limit.saturating_sub(cells), ..*query };
    let found = search::Search::new(&rest, both, rounding, halt).run(from, to);
    Distance { lower: found.lower.max(lower.min(found.upper)), cells: found.cells + cells, ..found }
}

/// What rounding may take from a bound, a length: of faces and poses, of hulls and supports.
fn slack(models: [&Model; 2], relative: &Relative, rounding: f64) -> f64 {
    let scale = models[0].size().max(models[1].size());
    let reaches = models.iter().map(|m| m.extents[0]).filter(|e| e.is_finite());
    let extent = relative.apart() + reaches.fold(scale, |s, e| s + 2.0 * e);
    4.0 * rounding + 256.0 * f64::EPSILON * extent
}
