//! What is searched: two solids, their motion, a depth, a limit; and a cell of it as its bounds see it.

use super::options::QueryOptions;
use super::question::{PairQuery, Strategies, without_own_spin};
use crate::bound::CollisionRegion;
use crate::bound::pair::{Side as Operand, locate};
use crate::contact::exclusion::literal::{Faces, View};
use crate::contact::exclusion::rounding;
use crate::math::tolerance;
use crate::motion::{Bounds, Instant, Relative};
use crate::octree::Model;
use crate::solid::{Face, Solid};
use glam::DVec3;
use std::sync::Arc;

/// What to search: two solids, their motion, a depth, a limit.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The reference body of the cells.
    pub a: &'a Solid,
    /// The other solid.
    pub b: &'a Solid,
    /// A's octree and bounds.
    pub model_a: &'a Model,
    /// B's octree and bounds.
    pub model_b: &'a Model,
    /// Ideas of the search that are switched on.
    pub strategies: Strategies,
    /// What is told of what is found.
    pub query_options: QueryOptions,
    /// Motion of the pair.
    pub relative: Relative,
    /// Depth at which a contact is decided.
    pub delta: f64,
    /// Depth of an overlap at the start that the search goes on past; 0 otherwise.
    pub ignored_depth: f64,
    /// What rounding may do to one bound: E of docs/accuracy.md, a length.
    pub rounding: f64,
    /// What is this near to delta at the start counts as that deep: rounding, where a second search follows; else 0.
    pub start_tolerance: f64,
    /// Length scale of the pair.
    pub scale: f64,
    /// Everything is proven up to this long before the contact, a fraction of the step: 0 for an answer.
    pub proof_slack: f64,
    /// Cells' worth of work that may be done (`Counters::spent`).
    pub limit: u64,
    /// The limit that the question gives; `limit` may be lowered for a part of the search.
    pub asked_limit: u64,
    /// Evaluations of literals that may be spent, whatever the limit of cells allows: of what is only meant to save work.
    pub most_evaluations: u64,
}

impl<'a> Task<'a> {
    /// What is searched for a question, and whether its second body carries the cells.
    pub(in crate::contact) fn of(query: &PairQuery<'a>) -> (Task<'a>, bool) {
        let swapped = query.is_swapped();
        let (reference, other) = if swapped { (query.b, query.a) } else { (query.a, query.b) };
        let (model_a, model_b) = (reference.model, other.model);
        let (a, b) = (&model_a.solid, &model_b.solid);
        let relative = Relative::new(without_own_spin(&reference), without_own_spin(&other));
        let (ball_a, ball_b) = (model_a.bounds.root().ball, model_b.bounds.root().ball);
        let scale = model_a.size().max(model_b.size());
        let extent = ball_a.center.length()
            + ball_b.center.length()
            + 2.0 * scale
            + relative.center_a().length()
            + relative.difference(0.0).length().max(relative.difference(1.0).length());
        let rounding = rounding::of_literals(model_a, model_b, &relative);
        let least = (tolerance::LEAST_RESOLUTION * extent).max(tolerance::LEAST_ROUNDINGS * rounding);
        let resolution = clear_of_walls(query.resolution.max(least), rounding, [model_a, model_b]);
        let task = Task {
            a,
            b,
            model_a,
            model_b,
            strategies: query.strategies,
            query_options: query.query_options,
            relative,
            delta: resolution,
            ignored_depth: 0.0,
            rounding,
            start_tolerance: rounding,
            scale,
            proof_slack: 0.0,
            limit: query.cell_limit,
            asked_limit: query.cell_limit,
            most_evaluations: u64::MAX,
        };
        (task, swapped)
    }

    /// The smallest dimension of both bodies' primitives.
    pub(in crate::contact) fn thinnest(&self) -> f64 {
        self.a.thinnest().min(self.b.thinnest())
    }

    /// A cell, by its centre and half extents, at an instant of its own time.
    pub(in crate::contact) fn view<'v>(
        &self,
        (center, half): (DVec3, DVec3),
        at: &'v Instant,
        motion: Bounds,
        clip_planes_b: &'v [Face],
    ) -> View<'v>
    where
        'a: 'v,
    {
        View {
            a: Faces { solid: self.a, clip_planes: &[] },
            b: Faces { solid: self.b, clip_planes: clip_planes_b },
            at,
            motion,
            center,
            half,
            radius: half.length(),
            center_b: at.b_point(center),
            velocity: at.velocity(center),
            delta: self.delta,
            wall: self.delta,
            rounding: self.rounding,
            fits: self.strategies.fits,
            multipliers: self.strategies.multipliers,
            curved: true,
        }
    }

    /// True where a body has a thin curved wall, or a crescent.
    pub(in crate::contact) fn has_walls(&self) -> bool {
        self.a.alike.any_near() || self.b.alike.any_near()
    }

    /// True when a witness is to be continued back to where the surfaces meet: they did so before the start if it was an
    /// overlap, and do so later than bodies are near each other.
    pub(in crate::contact) fn continues(&self) -> bool {
        self.query_options.time() && self.ignored_depth == 0.0 && self.delta > 0.0
    }

    /// The margin of S-bounds, octree and walk that holds {f <= −delta}: they keep f clamped to it. A clearance is a negative depth;
    /// at −g what is left of f reaches g beyond the surface, at corners further.
    pub fn level(&self) -> f64 {
        self.delta.abs()
    }

    /// Stage 1 over [t0, t1]: what of both bodies can take part; `None` where nothing can meet.
    pub fn region(&self, t0: f64, t1: f64) -> Option<Arc<CollisionRegion>> {
        let (placed_a, placed_b) = self.relative.placed();
        let a = Operand { solid: self.a, bounds: self.model_a.bounds_for(self.level()), placed: placed_a };
        let b = Operand { solid: self.b, bounds: self.model_b.bounds_for(self.level()), placed: placed_b };
        locate(&a, &b, t0, t1, self.level()).map(Arc::new)
    }

    /// The largest f that a point searched for may have in a body: 0 at depths, the distance at a clearance.
    pub(in crate::contact) fn highest(&self) -> f64 {
        (-self.delta).max(0.0)
    }

    /// Same-shape fits hold for distances of both bodies below this: half the smallest radius of a subtracted round face,
    /// which grown bodies take from it.
    pub(in crate::contact) fn fits_below(&self) -> f64 {
        0.5 * self.model_a.narrowest.min(self.model_b.narrowest)
    }

    /// True when x (A's frame) is at least delta deep in both whole solids at the instant, by `more` as computed.
    pub(in crate::contact) fn is_deep(&self, x: DVec3, at: &Instant, more: f64) -> bool {
        let level = -self.delta - more;
        self.model_a.value_within(x, level) <= level && self.model_b.value_within(at.b_point(x), level) <= level
    }

    /// True when x is deep at the start, or so nearly that rounding forbids to prove the contrary: what the first search
    /// takes for deep is searched again at twice the depth.
    /// At a negative depth −g that is a point hardly farther than g: what keeps a distance is told to be nearer, never the contrary.
    pub(in crate::contact) fn is_deep_at_start(&self, x: DVec3, at: &Instant) -> bool {
        let level = (NEARLY_DEEP * self.start_tolerance).min(0.5 * self.delta.abs()) - self.delta;
        self.model_a.value_within(x, level) <= level && self.model_b.value_within(at.b_point(x), level) <= level
    }
}

/// The depth at which witnesses are sought: delta and what rounding may take from it.
pub(in crate::contact) fn witness_level(delta: f64, rounding: f64) -> f64 {
    // Deep enough to be so after all rounding, with what Newton may leave.
    delta + 1e-6 * delta.abs() + 1.5 * rounding
}

/// By how many roundings of a bound the resolution is raised, one after the other, where a motion comes to just its depth.
pub(in crate::contact) const RAISES: [f64; 6] = [16.0, 64.0, 256.0, 64.0, 64.0, 64.0];

/// How many of these a motion may ask for, and what a start may be deeper by; the others are for a start that is just as deep as they
/// leave it.
pub(in crate::contact) const SUNK: usize = 3;

/// The resolution after a raise.
pub(in crate::contact) fn raised(resolution: f64, more: f64, rounding: f64) -> f64 {
    resolution + 2e-6 * resolution + more * rounding
}

/// The resolution, raised where a wall of a body is as thick as twice a depth that is searched: a point in its middle could
/// neither be excluded nor confirmed.
pub(in crate::contact) fn clear_of_walls(mut resolution: f64, rounding: f64, models: [&Model; 2]) -> f64 {
    let at_depth = |wall: f64, depth: f64| {
        (2.0 * depth..=2.0 * (witness_level(depth, rounding) + NEARLY_DEEP * rounding)).contains(&wall)
    };
    for _ in 0..SUNK {
        let mut walls = models.iter().flat_map(|m| m.solid.alike.walls()).map(|above| -above);
        if !walls.any(|wall| at_depth(wall, resolution) || at_depth(wall, 2.0 * resolution)) {
            break;
        }
        resolution = raised(resolution, RAISES[0], rounding);
    }
    resolution
}

/// Roundings beyond a witness' depth up to which a wall counts as just that thick; roundings about a depth within which a start
/// counts as just that deep.
pub(in crate::contact) const NEARLY_DEEP: f64 = 8.0;

/// The largest that a motion raises a resolution to: a body that sank so deep in one step may start the next one there.
pub(in crate::contact) fn most_raised(resolution: f64, rounding: f64) -> f64 {
    RAISES[..SUNK].iter().fold(resolution, |r, more| raised(r, *more, rounding))
}
