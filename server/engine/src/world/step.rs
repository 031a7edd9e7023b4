//! One step of the world: check the batch, take it, sweep, search, order.
//!
//! The batch is checked to its last record before anything changes. Then the objects that moved in the step before are
//! put at `advance` of it, the named ones get their new motions, everything else rests. Outcomes are ordered by (time,
//! a, b); nothing in them depends on the order of records or of searches.

use super::body::Body;
use super::heed::Heed;
use super::options::{StepError, StepOptions};
use super::outcome::{PairOutcome, StepOutcome};
use super::pairs::{self, Sieve};
use super::plan::PairPlan;
use super::roster::{Head, Roster};
use super::scene::World;
use super::search::{self, PairJob};
use super::state::StepState;
use super::touch;
use crate::contact::{Outcome, Status};
use contactd_proto::pose_record::{END, START};
use contactd_proto::{Detect, EffectCounters, ErrorCode, MotionState, Pose, PoseRecord, Report};
use std::collections::HashMap;

impl World {
    /// One step: `records` name the objects that move (or are put somewhere), all others stay.
    ///
    /// # Errors
    /// What is wrong with the batch, and the index of the record; the world has not changed.
    pub fn step(&mut self, records: &[PoseRecord], options: &StepOptions) -> Result<&StepOutcome, StepError> {
        self.step_heeding(records, options, None)
    }

    /// The same step, which heeds what is said to it while it runs.
    ///
    /// # Errors
    /// As `step`.
    pub fn step_heeding(
        &mut self,
        records: &[PoseRecord],
        options: &StepOptions,
        heed: Option<&Heed>,
    ) -> Result<&StepOutcome, StepError> {
        self.check(records, options)?;
        self.take(options);
        pairs::find(&self.roster, &mut self.state, options);
        self.search(options, heed);
        Ok(&self.state.outcome)
    }

    /// The answer of the last accepted step.
    pub fn outcome(&self) -> &StepOutcome {
        &self.state.outcome
    }

    /// Decodes the records and checks each against the world.
    fn check(&mut self, records: &[PoseRecord], options: &StepOptions) -> Result<(), StepError> {
        let refuse = |code| Err(StepError { code, index: None });
        if records.len() > self.state.max_batch {
            return refuse(ErrorCode::TooMany);
        }
        let fits = (0.0..=1.0).contains(&options.advance) && options.dt.is_finite() && options.dt >= 0.0;
        if !fits {
            return refuse(ErrorCode::BadNumber);
        }
        let Self { roster: Roster { heads, by_id, is_astray, .. }, state, .. } = self;
        let StepState { commands, put, named, serial, .. } = state;
        *serial += 1;
        commands.clear();
        put.clear();
        *named = 0;
        // Whether no motion can break what `stage` holds it to.
        let mut is_sure = !*is_astray;
        let mut expected = 0usize;
        for (i, record) in records.iter().enumerate() {
            // One copy: another process may write to the slot while it is read.
            let mut record = *record;
            let refuse = |code| StepError { code, index: Some(i as u32) };
            // Batches mostly name the objects in their order.
            let index = match heads.get(expected) {
                Some(head) if head.id == record.object => expected,
                _ => find(heads, by_id, expected, record.object).ok_or(refuse(ErrorCode::UnknownObject))?,
            };
            expected = index + 1;
            record.check().map_err(refuse)?;
            let head = &mut heads[index];
            if head.is_static {
                return Err(refuse(ErrorCode::StaticObject));
            }
            let slot = usize::from(!record.is_start());
            if head.named[slot] == *serial {
                return Err(refuse(ErrorCode::DuplicateObject));
            }
            *named += usize::from(head.is_moving && head.named[1 - slot] != *serial);
            head.named[slot] = *serial;
            if record.is_start() {
                put.push((index as u32, record.pose()));
            } else {
                is_sure &= !head.is_declared;
            }
            record.object = index as u32;
            commands.push(record);
        }
        put.sort_unstable_by_key(|(index, _)| *index);
        if is_sure { Ok(()) } else { self.stage(options) }
    }

    /// Checks the motions of the named objects, from where they start.
    #[cold]
    fn stage(&self, options: &StepOptions) -> Result<(), StepError> {
        let (bodies, state) = (&self.roster.bodies, &self.state);
        let mut next = 0;
        for (i, record) in state.commands.iter().enumerate().filter(|(_, record)| !record.is_start()) {
            let body = &bodies[record.object as usize];
            let start = place_of(&state.put, &mut next, record.object);
            let start = start.unwrap_or_else(|| body.motion_state.at(options.advance));
            let refuse = |code| Err(StepError { code, index: Some(i as u32) });
            if !(record.position() - start.position).length_squared().is_finite() {
                return refuse(ErrorCode::NotFinite);
            }
            // Of most bodies nothing is declared, and their motion is worked out once.
            if body.is_declared() {
                let mut state = MotionState::resting(start);
                order(&mut state, start, record);
                if !body.keeps(&state.motion, options.dt) {
                    return refuse(ErrorCode::Declaration);
                }
            }
        }
        Ok(())
    }

    /// Takes the batch: from here on nothing is refused.
    fn take(&mut self, options: &StepOptions) {
        let Self { roster: Roster { bodies, heads, .. }, state, .. } = self;
        let StepState { neighbours, moving, named, commands, put, serial, swept_shapes, .. } = state;
        state.clock += options.advance;
        neighbours.count(bodies.len());
        swept_shapes.begin(*serial, bodies.len());
        // What moved and is not named comes to rest.
        if *named < moving.len() {
            for index in moving.iter() {
                let (body, head) = (&mut bodies[*index as usize], &mut heads[*index as usize]);
                if head.named.contains(serial) {
                    continue;
                }
                head.is_moving = false;
                if !body.motion_state.is_rest() {
                    let was = body.motion_state.at(options.advance);
                    neighbours.taken(*index, body, options.advance, &was);
                    body.motion_state.put(was);
                }
            }
        }
        moving.clear();
        let mut next = 0;
        for record in commands.iter() {
            let index = record.object;
            let (body, head) = (&mut bodies[index as usize], &mut heads[index as usize]);
            if record.is_start() && head.named[1] == *serial {
                // Its motion begins there.
                continue;
            }
            let was = body.motion_state.at(options.advance);
            if !body.motion_state.is_rest() {
                neighbours.taken(index, body, options.advance, &was);
            }
            let start = if head.named[0] == *serial { place_of(put, &mut next, index) } else { None };
            order(&mut body.motion_state, start.unwrap_or(was), record);
            let jump = start.map_or(0.0, |start| if was == start { 0.0 } else { body.displacement(&was, &start) });
            neighbours.moved(index, jump, body.travel(1.0));
            head.is_moving = true;
            moving.push(index);
            swept_shapes.moved(index as usize, body);
        }
    }

    /// Searches the jobs and orders what they found.
    fn search(&mut self, options: &StepOptions, heed: Option<&Heed>) {
        let Self { roster, state, .. } = self;
        let bodies = &roster.bodies;
        search::run(bodies, &mut state.jobs, options, state.clock, &mut state.searches, heed);
        state.outcome.clear();
        let out = &mut state.outcome;
        (out.searched, out.known) = (state.glanced, state.glanced);
        (out.box_tests, out.busiest_cells) = (state.neighbours.box_tests, state.searches.busiest());
        // What is told of touching has a budget of its own, so that it does not depend on what searches have cost.
        let mut left = search::batch_limit(options);
        decide(roster, state, options, &mut left, heed);
        report(state, options);
        if roster.plans.measures() {
            touch::measure(bodies, &state.jobs, options, (&mut state.distances, &mut state.outcome), heed);
        }
        let budget = (left, &mut state.scratch);
        touch::find_regions(bodies, &mut state.jobs, options, budget, &mut state.outcome, heed);
        learn(bodies, state, options);
    }
}

/// Decides what is told of each job, sums up, and notes the keys of those that are told.
fn decide(roster: &Roster, state: &mut StepState, options: &StepOptions, left: &mut u64, heed: Option<&Heed>) {
    let StepState { jobs, outcome: out, reported, scratch, neighbours, boxes, swept_shapes, notes, .. } = state;
    let bodies = &roster.bodies;
    let mut sieve = Sieve { roster, neighbours, boxes, swept_shapes, notes: notes.as_deref_mut(), glanced: 0 };
    reported.clear();
    let mut earliest = f64::INFINITY;
    let mut before = 0;
    for jobs in jobs.chunk_by_mut(|p, q| p.plan_index == q.plan_index) {
        let plan = jobs[0].plan;
        let discrete = plan.detect == Detect::Discrete;
        for (i, job) in (before..).zip(jobs.iter_mut()) {
            let is_over = heed.is_some_and(Heed::is_over);
            if is_over {
                *left = 0;
            }
            let effects = &mut out.effect_counters;
            if job.found.outcome.status() == Status::Undecided && !is_over {
                sieve.sees_apart(job, options);
            }
            let complete = touch::decide(bodies, job, options, left, effects, (scratch, heed))
                || !is_over && sieve.sees_apart(job, options);
            count_effects(job, bodies, effects);
            let outcome = &job.found.outcome;
            out.counters += outcome.counters;
            out.searched += u32::from(job.near);
            out.known += u32::from(job.near && job.found.known);
            out.safe_time = out.safe_time.min(outcome.time_lower());
            if discrete && job.near && outcome.status() == Status::Clear && passes(job, bodies) {
                out.may_have_passed += 1;
            }
            if outcome.meets() {
                out.contact = true;
                // A sensor stops nothing, and of a mere hit nobody knows when it comes.
                if !plan.sensor && plan.report >= Report::Time {
                    earliest = earliest.min(outcome.time());
                }
            }
            if is_reported(&plan, outcome, options) {
                let (a, b) = (bodies[job.a as usize].id, bodies[job.b as usize].id);
                reported.push((key_of(&plan, outcome), a, b, i, complete));
            }
        }
        before += jobs.len() as u32;
    }
    out.undecided = jobs.iter().any(|job| is_undecided_before(&job.found.outcome, earliest));
}

/// Writes the told pairs in their order, as many as are asked for.
fn report(state: &mut StepState, options: &StepOptions) {
    let StepState { jobs, outcome: out, reported, .. } = state;
    // Outcomes are large: their keys are sorted, and each that is told is moved once. Which are the scene's first they tell themselves.
    reported.sort_unstable();
    let most = if options.max_records == 0 { usize::MAX } else { options.max_records as usize };
    let told = if options.first { &reported[..] } else { &reported[..reported.len().min(most)] };
    out.truncated = told.len() < reported.len();
    let beyond = reported[told.len()..].iter().filter(|told| jobs[told.3 as usize].plan.sensor).count();
    out.pairs.extend(told.iter().map(|&(_, a, b, i, regions_complete)| {
        let PairJob { plan, found, resolution, .. } = &jobs[i as usize];
        let (outcome, coarser) = (found.outcome, found.outcome.resolution > *resolution);
        let (regions, patch_slots) = ((0, 0), (0, 0));
        let clearance = None;
        PairOutcome { a, b, plan: *plan, outcome, coarser, job: i, regions_complete, regions, patch_slots, clearance }
    }));
    if options.first {
        keep_first(&mut out.pairs);
    }
    out.effect_counters.sensors = (beyond + out.pairs.iter().filter(|p| p.plan.sensor).count()) as u64;
    if out.pairs.len() > most {
        out.pairs.truncate(most);
        out.truncated = true;
    }
}

/// Gives the list of neighbours back what is known of each pair, and what this step has added.
fn learn(bodies: &[Body], state: &mut StepState, options: &StepOptions) {
    let StepState { jobs, neighbours, notes, .. } = state;
    for job in jobs {
        if let Some(pair) = job.pair {
            let clearance = if job.plan.detect == Detect::Discrete { 0.0 } else { job.found.clearance };
            if let Some(notes) = notes {
                notes.measured(job, bodies, options);
            }
            // What meets now will mostly do so in the next step: no look is worth its while.
            let met = job.found.outcome.status() != Status::Clear;
            neighbours.learned(pair, job.pair_cache.take(), clearance, met);
        }
    }
}

/// Index of the body of an id that is not where it was expected: of the one before where a batch names its start and then its
/// motion.
#[inline(never)]
fn find(heads: &[Head], by_id: &HashMap<u32, u32>, expected: usize, id: u32) -> Option<usize> {
    let before = expected.checked_sub(1).filter(|index| heads.get(*index).is_some_and(|head| head.id == id));
    before.or_else(|| by_id.get(&id).map(|index| *index as usize))
}

/// A body's track in the step, by a checked record that names it, where it stands at `start`; in place, since it is large.
#[inline]
fn order(state: &mut MotionState, start: Pose, record: &PoseRecord) {
    match record.flags {
        END => state.go(start, record.pose()),
        START => state.put(record.pose()),
        _ => state.turn(start, record.position(), record.rotation_vector()),
    }
}

/// Where a body is put at the start of the step. Those that are stand in the order of bodies, and mostly are asked for in it: `next`
/// is the place of the one that is asked for next.
#[inline]
fn place_of(put: &[(u32, Pose)], next: &mut usize, index: u32) -> Option<Pose> {
    if put.is_empty() {
        return None;
    }
    let place = match put.get(*next) {
        Some((k, _)) if *k == index => *next,
        _ => put.binary_search_by_key(&index, |(k, _)| *k).ok()?,
    };
    *next = place + 1;
    Some(put[place].1)
}

/// Counts what was worked out for a pair in this step; what was known of it costs nothing.
fn count_effects(job: &PairJob, bodies: &[Body], counters: &mut EffectCounters) {
    if job.near && !job.found.known {
        let motion_states = [job.a, job.b].map(|i| &bodies[i as usize].motion_state);
        if job.plan.detect == Detect::Discrete {
            counters.discrete += 1;
        } else if motion_states.iter().any(|t| !t.is_rest()) {
            counters.continuous += 1;
            counters.turning += u64::from(motion_states.iter().any(|t| t.motion.spin != glam::DVec3::ZERO));
        }
    }
    let c = &job.found.outcome.counters;
    counters.times += c.times;
    counters.contacts += c.contacts;
    counters.penetrations += c.penetrations;
    counters.past_overlaps += c.past_overlaps;
}

/// True when a discrete pair moved by more than the smaller body's smallest dimension.
fn passes(job: &PairJob, bodies: &[Body]) -> bool {
    let (a, b) = (&bodies[job.a as usize], &bodies[job.b as usize]);
    a.speed(&a.motion_state.motion) + b.speed(&b.motion_state.motion) > a.part.smallest.min(b.part.smallest)
}

fn is_reported(plan: &PairPlan, o: &Outcome, options: &StepOptions) -> bool {
    match o.status() {
        Status::Contact | Status::Overlap | Status::Undecided => true,
        Status::Clear => {
            let near = o.touching && plan.reports_nearness();
            options.clear || near || o.margin_time < 1.0 || plan.reports_clearance()
        }
    }
}

fn is_undecided_before(o: &Outcome, earliest: f64) -> bool {
    o.status() == Status::Undecided && o.time_lower() < earliest
}

/// The time that is told of a pair, ordered as `f64::total_cmp` does.
fn key_of(plan: &PairPlan, o: &Outcome) -> i64 {
    // A mere hit has no time that is told: its field is 0.
    let is_reported = plan.report >= Report::Time || o.status() == Status::Clear;
    let bits = if is_reported { o.time().to_bits() as i64 } else { 0 };
    bits ^ (((bits >> 63) as u64) >> 1) as i64
}

/// Keeps the pairs whose bracket meets that of the earliest contact; sensors stop nothing.
fn keep_first(pairs: &mut Vec<PairOutcome>) {
    let stops = |p: &&PairOutcome| !p.plan.sensor && p.outcome.meets();
    let Some(first) = pairs.iter().filter(stops).map(|p| &p.outcome).min_by(|p, q| p.time().total_cmp(&q.time()))
    else {
        return;
    };
    let until = first.time_upper();
    pairs.retain(|p| p.outcome.status() != Status::Clear && p.outcome.time_lower() <= until);
}
