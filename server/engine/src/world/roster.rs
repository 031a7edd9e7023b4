//! What a step reads and never changes but for its motions: the bodies, the plans of their pairs, the resolution.

use super::body::Body;
use super::plan::{PairPlan, Plans};
use crate::math::tolerance;
use contactd_proto::Detect;
use contactd_proto::MotionState;
use contactd_proto::pose::FARTHEST;
use std::collections::HashMap;

/// What the check of a batch reads and notes of a body: little, so that of many bodies it stays near.
#[derive(Clone, Copy, Debug)]
pub struct Head {
    /// Its id.
    pub(super) id: u32,
    pub(super) is_static: bool,
    /// Something is declared of its motions.
    pub(super) is_declared: bool,
    /// It is in the list of those that moved in the last step.
    pub(super) is_moving: bool,
    /// Step in which a record named it with a start, and with a motion.
    pub(super) named: [u64; 2],
}

impl Head {
    /// That of a body which no step has named.
    pub fn of(body: &Body) -> Self {
        let is_declared = body.is_declared();
        Self { id: body.id, is_static: body.is_static, is_declared, is_moving: false, named: [0; 2] }
    }
}

/// The bodies of a world and what is asked of their pairs.
#[derive(Debug, Default)]
pub struct Roster {
    /// In the order of their ids.
    pub(super) bodies: Vec<Body>,
    /// One for each of them.
    pub(super) heads: Vec<Head>,
    /// Some body was put on a track that may lead farther than records lead one.
    pub(super) is_astray: bool,
    pub(super) by_id: HashMap<u32, u32>,
    pub(super) plans: Plans,
    /// Of every pair; `None`: each pair its default.
    pub(super) resolution: Option<f64>,
}

/// True for a track that stays within the distances that records keep, all along. Records start and end within `FARTHEST` of the
/// origin; so do the poses of a track that is restored, and of its velocity this asks no more than that of theirs. Then no body
/// ever stands beyond three times `FARTHEST`, and the square of every way is a number.
pub fn is_within(motion_state: &MotionState) -> bool {
    motion_state.motion.velocity.length_squared() <= 4.1 * FARTHEST * FARTHEST
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
