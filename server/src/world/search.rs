//! The pairs of a step, searched one by one.
//!
//! A job reads two bodies and writes its own outcome: jobs may run in any order and on any thread without changing a bit.

use super::body::Body;
use super::plan::PairPlan;
use super::step::StepOptions;
use crate::contact::{self, Outcome, PairQuery, Scratch, Status};
use crate::motion::Placed;
use contactd_proto::{Detect, Motion};

pub(super) use crate::contact::default_resolution;

/// A pair to search: indices of its bodies, the one with the smaller id first.
#[derive(Clone, Copy, Debug)]
pub struct PairJob {
    /// Index of the body with the smaller id.
    pub a: u32,
    /// Index of the other one.
    pub b: u32,
    /// How it is searched.
    pub plan: PairPlan,
    /// Its resolution.
    pub resolution: f64,
    /// The swept boxes meet; otherwise they prove the pair clear.
    pub near: bool,
}

/// Memory of the searches, kept from step to step.
#[derive(Debug, Default)]
pub struct Memory {
    outcomes: Vec<Outcome>,
    scratch: Scratch,
}

impl Memory {
    /// Outcomes of the last run, in the order of its jobs.
    pub fn outcomes(&self) -> &[Outcome] {
        &self.outcomes
    }
}

/// Searches every job.
pub fn run(bodies: &[Body], jobs: &[PairJob], options: &StepOptions, memory: &mut Memory) {
    memory.outcomes.clear();
    for job in jobs {
        let outcome = if job.near {
            search_pair(bodies, job, options, &mut memory.scratch)
        } else {
            Outcome::clear(job.resolution)
        };
        memory.outcomes.push(outcome);
    }
}

fn search_pair(bodies: &[Body], job: &PairJob, options: &StepOptions, scratch: &mut Scratch) -> Outcome {
    let discrete = job.plan.detect == Detect::Discrete;
    let side = |index: u32| {
        let body = &bodies[index as usize];
        let motion = if discrete { Motion::resting(body.track.end) } else { body.track.motion };
        contact::Body { model: &body.part.model, placed: Placed { place: body.place, motion } }
    };
    let limit = if options.cell_limit == 0 { contact::DEFAULT_CELL_LIMIT } else { options.cell_limit };
    let query = PairQuery {
        a: side(job.a),
        b: side(job.b),
        resolution: job.resolution,
        cell_limit: limit,
        ideas: crate::contact::Ideas::default(),
    };
    let mut outcome = contact::earliest_contact(&query, scratch);
    if discrete && outcome.status != Status::Undecided {
        (outcome.time_lower, outcome.time, outcome.time_upper) = (1.0, 1.0, 1.0);
    }
    outcome
}
