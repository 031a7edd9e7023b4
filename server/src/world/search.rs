//! The pairs of a step, searched one by one.
//!
//! A job reads two bodies and writes its own outcome: jobs may run in any order and on any thread without changing a bit.
//!
//! Work is bounded by counted cells, for each pair and for the batch. The jobs are searched one by one as long as the
//! batch's limit holds; if their sum, which does not depend on their order, goes beyond it, everything is searched anew
//! under one queue, the pair that may meet earliest first. So the limit is spent on what comes first, and the latest pairs
//! stay undecided, each with the time up to which it is proven free.

use super::body::Body;
use super::plan::PairPlan;
use super::step::StepOptions;
use crate::contact::{self, Outcome, PairQuery, PairSearch, Scratch, Status};
use crate::math::tolerance;
use crate::motion::Placed;
use contactd_proto::{Detect, Motion};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

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
    /// Cells that the batch's limit left.
    left: u64,
}

impl Memory {
    /// Outcomes of the last run, in the order of its jobs.
    pub fn outcomes(&self) -> &[Outcome] {
        &self.outcomes
    }

    /// Cells that the last run left of the batch's limit.
    pub fn left(&self) -> u64 {
        self.left
    }
}

/// Searches every job to its end; when only the first contact is asked for, none further than that needs.
pub fn run(bodies: &[Body], jobs: &[PairJob], options: &StepOptions, memory: &mut Memory) {
    memory.outcomes.clear();
    if options.first && !options.clear {
        return run_queue(bodies, jobs, options, true, memory);
    }
    let mut left = batch_limit(options);
    for job in jobs {
        let outcome = if job.near {
            let mut query = query(bodies, job, options);
            let beyond = query.cell_limit > left;
            query.cell_limit = query.cell_limit.min(left);
            let outcome = contact::earliest_contact(&query, &mut memory.scratch);
            if beyond && outcome.status == Status::Undecided {
                memory.outcomes.clear();
                return run_queue(bodies, jobs, options, false, memory);
            }
            left = left.saturating_sub(outcome.counters.cells);
            finished(job, outcome)
        } else {
            Outcome::clear(job.resolution)
        };
        memory.outcomes.push(outcome);
    }
    memory.left = left;
}

fn batch_limit(options: &StepOptions) -> u64 {
    if options.batch_limit == 0 { DEFAULT_BATCH_LIMIT } else { options.batch_limit }
}

/// One queue over all pairs, ordered by the time before which a pair cannot meet. The pair in front is searched until
/// another is in front. Where only the first contact is asked for, the one found bounds how far any other needs to be
/// searched; a pair that is left unfinished is clear until later than that, which is all that is said of it. Once the
/// batch's cells are spent every pair that needs more of them is undecided.
fn run_queue(bodies: &[Body], jobs: &[PairJob], options: &StepOptions, first: bool, memory: &mut Memory) {
    let searches = jobs.iter().map(|job| PairSearch::new(&query(bodies, job, options), Scratch::default()));
    let mut searches: Vec<PairSearch> = searches.collect();
    memory.outcomes.extend(jobs.iter().map(|job| Outcome::clear(job.resolution)));
    // All times are >= 0, so their bits order as they do; ties go to the smaller pair.
    let near = (0..jobs.len()).filter(|i| jobs[*i].near);
    let mut queue: BinaryHeap<Reverse<(u64, usize)>> = near.map(|i| Reverse((0, i))).collect();
    let mut horizon = f64::INFINITY;
    let mut left = batch_limit(options);
    while let Some(Reverse((key, i))) = queue.pop() {
        let time = f64::from_bits(key);
        let search = &mut searches[i];
        if time > horizon {
            memory.outcomes[i].time_lower = time.min(1.0);
            memory.outcomes[i].counters = search.counters();
            continue;
        }
        let next = queue.peek().map_or(f64::INFINITY, |Reverse((next, _))| f64::from_bits(*next));
        let before = search.counters().cells;
        let ended = search.run_within(next.max(time).min(horizon), left);
        left = left.saturating_sub(search.counters().cells - before);
        match ended {
            None => queue.push(Reverse((search.earliest().max(time).to_bits(), i))),
            Some(outcome) => {
                let outcome = finished(&jobs[i], outcome);
                if first && !jobs[i].plan.sensor && matches!(outcome.status, Status::Contact | Status::Overlap) {
                    horizon = horizon.min(outcome.time_upper + tolerance::FIRST_SLACK);
                }
                memory.outcomes[i] = outcome;
            }
        }
    }
    memory.left = left;
}

/// Cells that all pairs of a step together may cost by default: sixteen pairs at their own limit.
pub const DEFAULT_BATCH_LIMIT: u64 = 16 * contact::DEFAULT_CELL_LIMIT;

pub(super) fn query<'a>(bodies: &'a [Body], job: &PairJob, options: &StepOptions) -> PairQuery<'a> {
    let side = |index: u32| {
        let body = &bodies[index as usize];
        let discrete = job.plan.detect == Detect::Discrete;
        let motion = if discrete { Motion::resting(body.track.end) } else { body.track.motion };
        contact::Body { model: &body.part.model, placed: Placed { place: body.place, motion } }
    };
    PairQuery {
        a: side(job.a),
        b: side(job.b),
        resolution: job.resolution,
        cell_limit: if options.cell_limit == 0 { contact::DEFAULT_CELL_LIMIT } else { options.cell_limit },
        ideas: contact::Ideas::default(),
    }
}

/// A discrete pair's answer is about the end of the step.
fn finished(job: &PairJob, mut outcome: Outcome) -> Outcome {
    if job.plan.detect == Detect::Discrete && outcome.status != Status::Undecided {
        (outcome.time_lower, outcome.time, outcome.time_upper) = (1.0, 1.0, 1.0);
    }
    outcome
}
