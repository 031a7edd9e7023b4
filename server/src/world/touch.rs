//! Where the told pairs of a step touch, for the rules that ask: a margin, or patches.
//!
//! First it is decided whether a pair touches at the start, since a clear pair that does is told. The regions are found
//! last, of the told pairs alone and in their order, so that the work that the batch's limit left is spent on the earliest.

use super::body::Body;
use super::coherence::Told;
use super::record;
use super::search::{self, PairJob};
use super::step::{StepOptions, StepOutcome};
use crate::contact::clearance;
use crate::contact::separation::Within;
use crate::contact::{Outcome, PairQuery, Status, region};
use contactd_proto::Report;

/// True when regions are told of a pair. A step that asks for its first contact has no use for clear pairs.
fn is_asked(job: &PairJob, options: &StepOptions, outcome: &Outcome) -> bool {
    let asked = job.plan.margin > 0.0 || job.plan.report >= Report::Patch;
    job.near && asked && (outcome.status == Status::Contact || !options.first)
}

/// What may be spent on a pair beside its search.
fn query<'a>(bodies: &'a [Body], job: &PairJob, options: &StepOptions, outcome: &Outcome, left: u64) -> PairQuery<'a> {
    let mut query = search::query(bodies, job, options);
    let spent = outcome.counters.cells + outcome.counters.instant_cells;
    query.cell_limit = query.cell_limit.saturating_sub(spent).min(left);
    query
}

/// Decides whether a pair touches at the start, where its rule asks. False when the work ran out before that was known:
/// such a pair is told as touching, which a loop that solves resting contacts is safe to believe.
pub(super) fn decide(
    bodies: &[Body],
    job: &mut PairJob,
    options: &StepOptions,
    left: &mut u64,
    outcome: &mut Outcome,
) -> bool {
    // The flag stands beside every contact, whether regions are asked or not.
    let is_told = outcome.status == Status::Contact || is_asked(job, options, outcome);
    if outcome.touching || job.found.apart || !is_told {
        return true;
    }
    if outcome.status == Status::Contact && outcome.time == 0.0 {
        outcome.touching = true;
        return true;
    }
    if let Some(told) = told(job) {
        outcome.touching = told.outcome.touching;
        return true;
    }
    let query = query(bodies, job, options, outcome, *left);
    let (within, cells) = clearance::touching(&query, region::threshold(outcome.resolution, job.plan.margin));
    outcome.touching = within != Within::Apart;
    outcome.counters.instant_cells += cells;
    *left = left.saturating_sub(cells);
    if within == Within::Apart && outcome.status == Status::Clear {
        job.knowledge.tell(Told { outcome: *outcome, regions: Vec::new() });
    }
    within != Within::Open
}

/// What an earlier step told of the same answer.
fn told(job: &PairJob) -> Option<&Told> {
    job.knowledge.told().filter(|_| job.found.known && !job.found.apart)
}

/// Finds the regions of the told pairs and gives each its slots.
pub(super) fn find_regions(
    bodies: &[Body],
    jobs: &mut [PairJob],
    options: &StepOptions,
    mut left: u64,
    out: &mut StepOutcome,
) {
    let mut slots = 0;
    for p in &mut out.pairs {
        let job = &mut jobs[p.job as usize];
        p.regions = (out.regions.len() as u32, 0);
        if !is_asked(job, options, &p.outcome) {
            // Nothing more is told.
        } else if let Some(told) = told(job) {
            p.outcome = Outcome { counters: p.outcome.counters, ..told.outcome };
            p.regions.1 = told.regions.len() as u32;
            out.regions.extend_from_slice(&told.regions);
        } else {
            let query = query(bodies, job, options, &p.outcome, left);
            let threshold = region::threshold(p.outcome.resolution, job.plan.margin);
            let found = region::complete(&query, &mut p.outcome, threshold);
            out.counters.instant_cells += found.cells;
            left = left.saturating_sub(found.cells);
            p.regions_complete &= found.complete;
            p.regions.1 = found.regions.len() as u32;
            out.regions.extend_from_slice(&found.regions);
            if p.regions_complete {
                job.knowledge.tell(Told { outcome: p.outcome, regions: found.regions });
            }
        }
        let own = record::patch_slots(&out.regions[p.regions.0 as usize..]);
        let fits = options.max_patch_slots == 0 || slots + own <= options.max_patch_slots;
        out.truncated |= !fits;
        p.patch_slots = (slots, if fits { own } else { 0 });
        slots += p.patch_slots.1;
    }
}
