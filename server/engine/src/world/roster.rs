//! What a step reads and never changes but for its motions: the bodies, the plans of their pairs, the resolution.

use super::body::Body;
use super::plan::{PairPlan, Plans};
use crate::math::tolerance;
use contactd_proto::Detect;
use std::collections::HashMap;

/// The bodies of a world and what is asked of their pairs.
#[derive(Debug, Default)]
pub struct Roster {
    /// In the order of their ids.
    pub(super) bodies: Vec<Body>,
    pub(super) by_id: HashMap<u32, u32>,
    pub(super) plans: Plans,
    /// Of every pair; `None`: each pair its default.
    pub(super) resolution: Option<f64>,
}

impl Roster {
    /// How the pair of two bodies is searched, by index and in full, and its resolution: `None` when rules or two static bodies
    /// rule it out.
    pub fn pair(&self, i: u32, j: u32) -> Option<(u32, PairPlan, f64)> {
        let (a, b) = (&self.bodies[i as usize], &self.bodies[j as usize]);
        if a.is_static && b.is_static {
            return None;
        }
        let index = self.plans.of([a.group, b.group], [&a.name, &b.name])?;
        let plan = *self.plans.plan(index);
        debug_assert!(plan.detect != Detect::Off);
        Some((index, plan, self.resolution_of(a, b)))
    }

    /// The resolution of a pair.
    fn resolution_of(&self, a: &Body, b: &Body) -> f64 {
        let own = a.part.resolution.max(b.part.resolution);
        self.resolution.unwrap_or(if own > 0.0 { own } else { tolerance::DEFAULT_RESOLUTION })
    }

    /// What a body's box grows by, so that boxes of bodies within their touching distance meet. A pair's margin counts for
    /// that pair alone.
    #[inline]
    pub fn touch(&self, body: &Body) -> f64 {
        // Touching is told within twice the resolution, of which this body answers for its share.
        2.0 * self.resolution.unwrap_or(body.part.resolution)
    }

    /// The same, and how far the largest margin of its group reaches while it goes as far as `way`: how far its neighbours do.
    pub fn reach(&self, body: &Body, way: f64) -> f64 {
        self.touch(body) + body.room(self.plans.margin_of(body.group), way)
    }
}
