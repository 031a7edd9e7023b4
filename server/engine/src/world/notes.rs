//! What a world that is asked for certificates notes in its steps.

use super::body::Body;
use super::options::StepOptions;
use super::search::{self, PairJob};
use crate::contact::{SeparatingAxisTest, margin};
use crate::math::Aabb;
use contactd_proto::Pose;
use glam::DVec3;
use std::collections::HashMap;

/// How a pair was excluded before any job was made of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Decided {
    /// Its path lengths do not show its clearance.
    Clearance,
    /// Directions at both ends of the step.
    Directions([DVec3; 2]),
}

impl Decided {
    /// Two boxes that hold the bodies over the step share no point: the axis along which they are farthest apart.
    pub fn boxes(a: Aabb, b: Aabb) -> Self {
        Self::Directions([axis_between(&a, &b); 2])
    }
}

/// The axis along which two boxes are farthest apart, from a to b.
pub(super) fn axis_between(a: &Aabb, b: &Aabb) -> DVec3 {
    let (up, down) = (b.min - a.max, a.min - b.max);
    let k = up.max(down).max_position();
    let mut axis = DVec3::ZERO;
    axis[k] = if up[k] >= down[k] { 1.0 } else { -1.0 };
    axis
}

/// A distance at one moment: where the bodies stood, and the direction along which they were apart by that much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// The poses of both objects then.
    pub poses: [Pose; 2],
    /// Unit, world axes, from a to b.
    pub along: DVec3,
    /// How much farther than their touching distance they were apart, a length.
    pub clearance: f64,
}

/// What is noted in the steps of a world that is asked for certificates.
#[derive(Debug, Default)]
pub(super) struct Notes {
    pub(super) options: StepOptions,
    /// By ids: those stay when bodies go.
    pub(super) clearances: HashMap<(u32, u32), Clearance>,
    /// By indices, of the last step.
    pub(super) decided: HashMap<(u32, u32), Decided>,
}

impl Notes {
    /// A step begins.
    pub fn begin(&mut self, options: StepOptions) {
        self.options = options;
        self.decided.clear();
    }

    /// A pair is excluded in this step.
    pub fn decided(&mut self, pair: (u32, u32), how: Decided) {
        self.decided.insert(pair, how);
    }

    /// A separating-axis test has measured a pair at the start of the step.
    pub fn glanced(&mut self, pair: (u32, u32), bodies: &[Body], axis_test: &SeparatingAxisTest) {
        if axis_test.clearance > 0.0 {
            self.note(pair, bodies, axis_test.along, axis_test.clearance);
        }
    }

    /// Boxes that hold two bodies over the step have told their clearance.
    pub fn apart_by(&mut self, pair: (u32, u32), bodies: &[Body], clearance: f64, boxes: [Aabb; 2]) {
        if clearance > 0.0 {
            self.note(pair, bodies, axis_between(&boxes[0], &boxes[1]), clearance);
        }
    }

    /// The distance of two convex bodies where they are asked about has told their clearance: at the start of the step, and at its end
    /// of a discrete pair.
    pub fn measured(&mut self, job: &PairJob, bodies: &[Body], options: &StepOptions) {
        let query = search::query(bodies, job, options);
        if let (Some(along), true) = (margin::direction_of_clearance(&query), job.found.clearance > 0.0) {
            let poses = [&query.a, &query.b].map(|body| body.placed.motion.start);
            let ids = [job.a, job.b].map(|i| bodies[i as usize].id);
            self.clearances.insert(ids.into(), Clearance { poses, along, clearance: job.found.clearance });
        }
    }

    fn note(&mut self, (i, j): (u32, u32), bodies: &[Body], along: DVec3, clearance: f64) {
        let (a, b) = (&bodies[i as usize], &bodies[j as usize]);
        let poses = [a, b].map(|body| body.motion_state.motion.start);
        self.clearances.insert((a.id, b.id), Clearance { poses, along, clearance });
    }
}
