//! What a step tells of its pairs beside their search, for the rules that ask: where they touch (a margin, or patches),
//! and their least distance over the step (`measure`).
//!
//! First it is decided whether a pair touches at the start, since a clear pair that does is told. The regions are found
//! last, of the told pairs alone and in their order, so that the work that the batch's limit left is spent on the earliest.

use super::body::Body;
use super::coherence::Reported;
use super::distances::Distances;
use super::heed::Heed;
use super::options::StepOptions;
use super::outcome::StepOutcome;
use super::record;
use super::search::{self, PairJob};
use crate::contact::distance::{self, DistanceQuery};
use crate::contact::margin;
use crate::contact::pair::overlap;
use crate::contact::within::Within;
use crate::contact::{Counters, Outcome, PairQuery, Scratch, Status, region};
use crate::math::halt;
use contactd_proto::{Detect, EffectCounters, Report};

/// True when regions are told of a pair. A step that asks for its first contact has no use for clear pairs.
fn is_asked(job: &PairJob, options: &StepOptions, outcome: &Outcome) -> bool {
    job.near && job.plan.reports_regions() && !outcome.past && (outcome.status() == Status::Contact || !options.first)
}

/// A question about a pair beside its search, and what may be spent on it: the pair's limit once more, whatever its search has
/// cost, so that what is told does not depend on what was remembered.
fn query<'a>(bodies: &'a [Body], job: &PairJob, options: &StepOptions, left: u64) -> PairQuery<'a> {
    let mut query = search::query(bodies, job, options);
    query.cell_limit = query.cell_limit.min(left);
    query
}

/// Decides whether a pair touches at the start, where its rule asks, and when a clear one comes within its margin. False when
/// the work ran out before that was known: such a pair is told as touching, which a loop that solves resting contacts is safe
/// to believe.
pub(super) fn decide(
    bodies: &[Body],
    job: &mut PairJob,
    options: &StepOptions,
    left: &mut u64,
    effects: &mut EffectCounters,
    (scratch, heed): (&mut Scratch, Option<&Heed>),
) -> bool {
    // The flag stands beside every pair whose time is told, whether regions are asked or not; clear pairs are told where
    // their rule or the step asks for them.
    let margin = job.near && job.plan.margin > 0.0;
    let outcome = &mut job.found.outcome;
    let (status, resolution) = (outcome.status(), outcome.resolution);
    let clear = status == Status::Clear;
    if outcome.touching && margin && clear {
        outcome.margin_time = 0.0;
    }
    if outcome.touching || job.found.apart || job.plan.report < Report::Time && !margin {
        return true;
    }
    let is_reported = match status {
        Status::Contact | Status::Undecided => true,
        _ => options.clear && !options.first,
    };
    if !(is_reported || margin || is_asked(job, options, &job.found.outcome)) {
        return true;
    }
    let outcome = &mut job.found.outcome;
    if status == Status::Contact && outcome.time() == 0.0 {
        outcome.touching = true;
        return true;
    }
    if let Some((touching, margin_time)) =
        reported(job).map(|reported| (reported.outcome.touching, reported.outcome.margin_time))
    {
        (job.found.outcome.touching, job.found.outcome.margin_time) = (touching, margin_time);
        return true;
    }
    effects.margins += u64::from(margin);
    let halt = heed.map(|heed| &heed.halt);
    let threshold = region::threshold(resolution, job.plan.margin);
    let (within, cells) = if job.found.outcome.apart > threshold + resolution {
        (Within::Apart, 0)
    } else {
        let query = query(bodies, job, options, *left);
        halt::heeding(halt, || margin::touching(&query, threshold, scratch)).unwrap_or((Within::Open, 0))
    };
    let outcome = &mut job.found.outcome;
    outcome.touching = within != Within::Apart;
    if outcome.touching && margin && clear {
        outcome.margin_time = 0.0;
    }
    outcome.counters.instant_cells += cells;
    *left = left.saturating_sub(cells);
    if margin && within == Within::Apart && clear && job.plan.detect != Detect::Discrete {
        let mut query = query(bodies, job, options, *left);
        query.cell_limit = query.cell_limit.min(region::MOST_CELLS);
        let told = halt::heeding(halt, || margin::apart_until(&query, threshold, scratch));
        let (until, known, work) = told.unwrap_or((0.0, false, Counters::default()));
        let cells = work.cells + work.instant_cells;
        let outcome = &mut job.found.outcome;
        outcome.margin_time = until;
        outcome.counters.instant_cells += cells;
        *left = left.saturating_sub(cells);
        if !known {
            return false;
        }
    }
    if within == Within::Apart
        && clear
        && let Some(pair_cache) = &mut job.pair_cache
    {
        pair_cache.report(Reported { outcome: job.found.outcome, regions: Vec::new() });
    }
    within != Within::Open
}

/// What an earlier step told of the same answer.
fn reported(job: &PairJob) -> Option<&Reported> {
    job.pair_cache.as_ref()?.reported().filter(|_| job.found.known && !job.found.apart)
}

/// Works out the least distances over the step of the told pairs whose rules ask, but for those that the last step knows. The work has a
/// limit of its own, of which a known answer takes what it has cost: what is told does not depend on what else was asked or known.
pub(super) fn measure(
    bodies: &[Body],
    jobs: &[PairJob],
    options: &StepOptions,
    (known, out): (&mut Distances, &mut StepOutcome),
    heed: Option<&Heed>,
) {
    let mut left = search::batch_limit(options);
    for p in out.pairs.iter_mut().filter(|p| p.plan.reports_clearance()) {
        if heed.is_some_and(Heed::is_over) {
            left = 0;
        }
        let job = &jobs[p.job as usize];
        let PairQuery { a, b, cell_limit, .. } = search::query(bodies, job, options);
        let limit = distance::DEFAULT_LIMIT.min(cell_limit).min(left);
        let query = DistanceQuery { a, b, tolerance: p.plan.clearance, limit };
        let pair = (bodies[job.a as usize].id, bodies[job.b as usize].id);
        let found = known.recall(pair, &query).unwrap_or_else(|| {
            let found = match heed.map(|heed| &heed.halt) {
                Some(halt) => halt::heeding(Some(halt), || distance::over_step_heeding(&query, halt)),
                None => Some(distance::over_step(&query)),
            };
            let found = found.unwrap_or_else(distance::unknown);
            out.effect_counters.clearances += 1;
            out.counters.instant_cells += found.cells;
            found
        });
        known.keep(pair, &query, &found);
        left = left.saturating_sub(found.cells);
        p.clearance = Some(out.clearances.len() as u32);
        out.clearances.push(found);
    }
    known.turn();
}

/// Finds the regions of the told pairs and gives each its slots.
pub(super) fn find_regions(
    bodies: &[Body],
    jobs: &mut [PairJob],
    options: &StepOptions,
    (mut left, scratch): (u64, &mut Scratch),
    out: &mut StepOutcome,
    heed: Option<&Heed>,
) {
    let mut slots = 0;
    for p in &mut out.pairs {
        let job = &mut jobs[p.job as usize];
        p.regions = (out.regions.len() as u32, 0);
        if !is_asked(job, options, &p.outcome) {
            // Nothing more is told.
        } else if let Some(reported) = reported(job) {
            p.outcome = Outcome { counters: p.outcome.counters, ..reported.outcome };
            p.regions.1 = reported.regions.len() as u32;
            out.regions.extend_from_slice(&reported.regions);
        } else {
            if heed.is_some_and(Heed::is_over) {
                left = 0;
            }
            let query = query(bodies, job, options, left);
            let threshold = region::threshold(p.outcome.resolution, job.plan.margin);
            // The surfaces of bodies in each other cut. They are told where the bodies come apart, as far as their depth is asked for.
            let told = halt::heeding(heed.map(|heed| &heed.halt), || match p.outcome.penetration() {
                Some(penetration) => overlap::regions(&query, penetration, threshold, scratch),
                None => region::complete(&query, &mut p.outcome, threshold),
            });
            let found = told.unwrap_or_else(|| region::cut_short(&p.outcome));
            let looked = match p.outcome.status() {
                Status::Contact => true,
                Status::Clear => p.outcome.touching,
                Status::Overlap => p.outcome.penetration().is_some(),
                Status::Undecided => false,
            };
            out.effect_counters.patches += u64::from(looked);
            out.counters.instant_cells += found.cells;
            left = left.saturating_sub(found.cells);
            p.regions_complete &= found.complete;
            p.regions.1 = found.regions.len() as u32;
            out.regions.extend_from_slice(&found.regions);
            // What a session keeps it can prove: where bodies would come apart is worked out anew.
            let is_kept = p.regions_complete && p.outcome.penetration().is_none();
            if let Some(pair_cache) = job.pair_cache.as_mut().filter(|_| is_kept) {
                pair_cache.report(Reported { outcome: p.outcome, regions: found.regions });
            }
        }
        let own = record::patch_slots(&out.regions[p.regions.0 as usize..]) + u32::from(p.clearance.is_some());
        let fits = options.max_patch_slots == 0 || slots + own <= options.max_patch_slots;
        out.truncated |= !fits;
        p.patch_slots = (slots, if fits { own } else { 0 });
        p.clearance = p.clearance.filter(|_| fits);
        slots += p.patch_slots.1;
    }
}
