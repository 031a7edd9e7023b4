//! The pairs of a step: asked what is known of them, then searched.
//!
//! A job reads two bodies and writes its own outcome: jobs may run in any order and on any thread without changing a bit.
//!
//! Work is bounded by counted cells, for each pair and for the batch. The jobs are searched each by itself, on all
//! threads, as long as the batch's limit holds; if their sum, which does not depend on their order, goes beyond it,
//! everything is searched anew under one queue, the pair that may meet earliest first. So the limit is spent on what
//! comes first, and the latest pairs stay undecided, each with the time up to which it is proven free.

use super::body::Body;
use super::coherence::{Finding, PairCache, Question};
use super::heed::Heed;
use super::options::StepOptions;
use super::plan::PairPlan;
use crate::contact::{self, Counters, Outcome, PairQuery, PairSearch, QueryOptions, Scratch, Status, Verdict};
use crate::math::halt::{self, Halt};
use crate::math::tolerance;
use crate::motion::Placed;
use contactd_proto::{Detect, Motion, Report};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};

/// With fewer pairs to ask about than this one thread is done before others wake up …
const WORTH_SHARING: usize = 8;
/// … and where the last step's have taken less work than this, in evaluations of a literal: a third of a millisecond.
const WORTH_WAKING: u64 = 16_384;
/// So many of them is what a cell costs beside its own, what a closed form does, and what a pair does that is asked about.
const BESIDE: [u64; 3] = [256, 64, 128];

/// A pair of the step: indices of its bodies, the one with the smaller id first.
#[derive(Debug)]
pub struct PairJob {
    /// Index of the body with the smaller id.
    pub a: u32,
    /// Index of the other one.
    pub b: u32,
    /// How it is searched.
    pub plan: PairPlan,
    /// The same as an index: jobs are in its order, so those of one plan stand together.
    pub plan_index: u32,
    /// Its resolution.
    pub resolution: f64,
    /// The swept boxes meet; otherwise they prove the pair clear.
    pub near: bool,
    /// Its place in the list of neighbours; `None`: proven clear without being asked about.
    pub pair: Option<usize>,
    /// What earlier steps have proven, of a pair with a place; lent by the list of neighbours.
    pub pair_cache: Option<Box<PairCache>>,
    /// Nothing is known that could answer it.
    is_blank: bool,
    /// Its answer was found, but for what a queue over all pairs adds.
    is_done: bool,
    /// The queue has left it, searched no further than to prove it free until after the scene's first contact.
    pub(super) is_left: bool,
    /// The answer.
    pub found: Finding,
}

impl PairJob {
    /// A pair that is clear unless it is asked about and turns out otherwise.
    pub fn new(
        (a, b): (u32, u32),
        (plan_index, plan): (u32, PairPlan),
        resolution: f64,
        near: bool,
        pair: Option<(usize, Box<PairCache>)>,
    ) -> Self {
        let known = pair.is_none();
        let found = Finding { outcome: Outcome::clear(resolution), clearance: 0.0, known, apart: known };
        let (pair, pair_cache): (_, Option<Box<PairCache>>) = pair.unzip();
        // Looked up here, where many jobs are made in a row and the memory can answer several at a time.
        let is_blank = pair_cache.as_deref().is_none_or(PairCache::is_blank);
        let (is_done, is_left) = (false, false);
        Self { a, b, plan, plan_index, resolution, near, pair, pair_cache, is_blank, is_done, is_left, found }
    }

    /// It is proven clear by what is no search.
    pub(super) fn take_for_apart(&mut self) {
        let counters = self.found.outcome.counters;
        let outcome = Outcome { counters, ..Outcome::clear(self.resolution) };
        self.found = Finding { outcome, clearance: 0.0, known: false, apart: true };
    }

    pub(super) fn question<'a>(&self, bodies: &'a [Body], options: &StepOptions, clock: f64) -> Question<'a> {
        let query = query(bodies, self, options);
        let pair = [self.a, self.b].map(|i| &bodies[i as usize]);
        Question { bodies: pair, query, margin: self.plan.reach(), clock }
    }

    /// Takes the outcome of a search that was allowed so much work, which has been written into `found`.
    fn take(&mut self, q: &Question, limit: u64) {
        let found = &mut self.found;
        if let Some(pair_cache) = &mut self.pair_cache {
            pair_cache.learn(q, limit, &found.outcome);
        }
        (found.clearance, found.known, found.apart) = (0.0, false, false);
        finish(&self.plan, &mut found.outcome);
    }

    /// What was told in a step whose time was up may be less than what there is to tell: it answers no other question.
    fn forget_answer(&mut self) {
        if let Some(pair_cache) = &mut self.pair_cache {
            pair_cache.forget_answer();
        }
    }
}

/// Memory of the searches, kept from step to step.
#[derive(Debug, Default)]
pub struct Memory {
    /// One for each thread.
    thread_scratches: Vec<Mutex<ThreadScratch>>,
    /// Work of the last step (`WORTH_WAKING`), at least half of what stood here before it; `None` before the first one.
    last: Option<u64>,
}

/// A thread's scratch, and what it has done in this step: cells that it has refined, and all of its work (`WORTH_WAKING`).
#[derive(Debug, Default)]
struct ThreadScratch {
    scratch: Scratch,
    cells: u64,
    work: u64,
}

impl ThreadScratch {
    /// Takes note of what a pair has cost.
    fn count(&mut self, counters: &Counters) {
        self.cells += counters.cells;
        let [cell, closed_form, pair] = BESIDE;
        self.work += counters.evaluations + cell * counters.cells + closed_form * counters.closed_forms + pair;
    }
}

impl Memory {
    /// The calling thread's scratch.
    fn with<T>(&self, work: impl FnOnce(&mut ThreadScratch) -> T) -> T {
        let own = rayon::current_thread_index().map_or(0, |i| i + 1);
        let mut thread_scratch = self.thread_scratches[own].lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        work(&mut thread_scratch)
    }

    /// A step begins: nobody has done anything.
    fn begin(&mut self) {
        let mut last = 0;
        for thread_scratch in &mut self.thread_scratches {
            let thread_scratch = thread_scratch.get_mut().unwrap_or_else(|poisoned| poisoned.into_inner());
            last += std::mem::take(&mut thread_scratch.work);
            thread_scratch.cells = 0;
        }
        let before = self.last.map_or(0, |before| before / 2);
        self.last = (!self.thread_scratches.is_empty()).then_some(last.max(before));
    }

    /// True when so many pairs are to be shared among the threads. An answer does not depend on it, only when it is there: what a step
    /// costs is mostly what the one before it did.
    fn is_worth_sharing(&self, pairs: usize) -> bool {
        rayon::current_num_threads() > 1 && pairs >= WORTH_SHARING && self.last.is_none_or(|work| work >= WORTH_WAKING)
    }

    /// Makes a scratch for each thread.
    fn ready(&mut self) {
        let threads = rayon::current_num_threads();
        if self.thread_scratches.len() <= threads {
            self.thread_scratches.resize_with(threads + 1, Mutex::default);
        }
    }

    /// Cells that the busiest thread has refined in the last step.
    pub fn busiest(&mut self) -> u64 {
        let cells = |thread_scratch: &mut Mutex<ThreadScratch>| {
            thread_scratch.get_mut().unwrap_or_else(|poisoned| poisoned.into_inner()).cells
        };
        self.thread_scratches.iter_mut().map(cells).max().unwrap_or(0)
    }
}

/// Searches every pair to its end; when only the first contact is asked for, none further than that needs.
///
/// Work that is to leave the shared threads (`Heed`) leaves the pairs that it has not answered as they were; they are searched
/// from the beginning on the step's own. Once the step is to end what is not answered is undecided.
pub fn run(
    bodies: &[Body],
    jobs: &mut [PairJob],
    options: &StepOptions,
    clock: f64,
    memory: &mut Memory,
    heed: Option<&Heed>,
) {
    memory.begin();
    let first = options.first && !options.clear;
    let (most, spent, beyond) = (batch_limit(options), AtomicU64::new(0), AtomicBool::new(false));
    let searches = Searches { bodies, options, clock, heed, first, most, spent, beyond };
    match heed {
        None => searches.share(jobs, memory, None),
        Some(heed) => {
            searches.share(jobs, memory, Some(&heed.leave));
            if heed.has_left() && !searches.beyond.load(Relaxed) {
                heed.elsewhere(|| searches.share(jobs, memory, Some(&heed.halt)));
            }
        }
    }
    if searches.is_over() {
        // Nothing is proven of pairs that were not come to.
        for job in jobs.iter_mut().filter(|job| job.pair.is_some() && (!job.is_done || first && !job.found.known)) {
            (job.found.known, job.found.apart) = (false, false);
            job.found.outcome.verdict = Verdict::Undecided { time_lower: 0.0 };
        }
    } else if first || searches.beyond.into_inner() {
        run_queue(bodies, jobs, options, first, clock, heed);
    }
    let is_told = |job: &PairJob| options.clear || job.plan.reports_clearance();
    if options.clear || jobs.iter().any(is_told) {
        // A line for each pair, the same whether it was searched or known.
        for job in jobs.iter_mut().filter(|job| job.near && job.found.known && is_told(job)) {
            job.found.outcome.resolution = contact::resolution_of(&query(bodies, job, options));
        }
    }
}

/// The searches of a step, each pair by itself, on all threads.
struct Searches<'a> {
    bodies: &'a [Body],
    options: &'a StepOptions,
    clock: f64,
    heed: Option<&'a Heed>,
    /// Only the first contact is asked for: here what is known answers, the rest is the queue's.
    first: bool,
    /// Cells that all of them may spend together, and those that they have spent.
    most: u64,
    spent: AtomicU64,
    /// They need more than that.
    beyond: AtomicBool,
}

impl Searches<'_> {
    fn is_over(&self) -> bool {
        self.heed.is_some_and(Heed::is_over)
    }

    /// Answers the jobs that are not done, until `halt`.
    fn share(&self, jobs: &mut [PairJob], memory: &mut Memory, halt: Option<&Arc<Halt>>) {
        memory.ready();
        let memory = &*memory;
        if memory.is_worth_sharing(jobs.len()) {
            jobs.par_iter_mut().for_each(|job| self.answer(job, memory, halt));
        } else {
            jobs.iter_mut().for_each(|job| self.answer(job, memory, halt));
        }
    }

    /// Answers a job by what is known, or by a search.
    fn answer(&self, job: &mut PairJob, memory: &Memory, halt: Option<&Arc<Halt>>) {
        if job.pair.is_none() || job.is_done || self.beyond.load(Relaxed) || halt.is_some_and(|halt| halt.is_over()) {
            return;
        }
        let q = job.question(self.bodies, self.options, self.clock);
        let told = halt::heeding(halt, || {
            memory.with(|thread_scratch| {
                let mut counters = Counters::default();
                let pair_cache = job.pair_cache.as_mut().filter(|_| !job.is_blank);
                if let Some(finding) = pair_cache.and_then(|k| k.ask(&q, &mut thread_scratch.scratch, &mut counters)) {
                    job.found = finding;
                    finish(&job.plan, &mut job.found.outcome);
                    thread_scratch.count(&job.found.outcome.counters);
                    job.is_done = true;
                    return 0;
                }
                job.found.known = false;
                if self.first {
                    job.is_done = true;
                    return 0;
                }
                self.search(job, q, counters, thread_scratch)
            })
        });
        let cells = told.unwrap_or_else(|| {
            // Nothing is known of it: it is searched elsewhere, or undecided at last.
            job.found.outcome = Outcome::clear(job.resolution);
            (job.found.clearance, job.found.known, job.found.apart) = (0.0, false, false);
            0
        });
        if self.spent.fetch_add(cells, Relaxed) + cells > self.most {
            self.beyond.store(true, Relaxed);
        }
    }

    /// Searches a pair; `asked` is what it has cost to ask what is known. Returns the cells that count for the batch.
    fn search(&self, job: &mut PairJob, mut q: Question, asked: Counters, thread_scratch: &mut ThreadScratch) -> u64 {
        let cut = q.query.cell_limit > self.most;
        q.query.cell_limit = q.query.cell_limit.min(self.most);
        // Outcomes are large: it is written where it is to be.
        let outcome = &mut job.found.outcome;
        contact::find_earliest(&q.query, &mut thread_scratch.scratch, outcome);
        if halt::is_up() {
            if !self.is_over() {
                // Cut short, perhaps, to be searched elsewhere: it counts for nothing.
                job.found.outcome = Outcome::clear(job.resolution);
                return 0;
            }
            outcome.counters += asked;
            job.take(&q, q.query.cell_limit);
            job.forget_answer();
            job.is_done = true;
            return 0;
        }
        let cells = outcome.counters.spent(q.query.cell_limit);
        if cut && outcome.status() == Status::Undecided {
            self.beyond.store(true, Relaxed);
        }
        outcome.counters += asked;
        thread_scratch.count(&outcome.counters);
        job.take(&q, q.query.cell_limit);
        job.is_done = true;
        cells
    }
}

/// Cells that the searches of a step may refine together.
pub(super) fn batch_limit(options: &StepOptions) -> u64 {
    if options.batch_limit == 0 { DEFAULT_BATCH_LIMIT } else { options.batch_limit }
}

/// One queue over all pairs, ordered by the time before which a pair cannot meet. The pair in front is searched until
/// another is in front. Where only the first contact is asked for, the one found bounds how far any other needs to be
/// searched; a pair that is left unfinished is clear until later than that, which is all that is said of it. Once the
/// batch's cells are spent every pair that needs more of them is undecided.
fn run_queue(
    bodies: &[Body],
    jobs: &mut [PairJob],
    options: &StepOptions,
    first: bool,
    clock: f64,
    heed: Option<&Heed>,
) {
    let mut open: Vec<&mut PairJob> = jobs.iter_mut().filter(|job| job.pair.is_some() && !job.found.known).collect();
    let mut questions: Vec<Question> = open.iter().map(|job| job.question(bodies, options, clock)).collect();
    for q in &mut questions {
        q.query.cell_limit = q.query.cell_limit.min(batch_limit(options));
    }
    let halt = heed.map(|heed| &heed.halt);
    let searches = questions.iter().map(|q| PairSearch::new(&q.query, Scratch::default()));
    let mut searches: Vec<PairSearch> = searches.collect();
    // All times are >= 0, so their bits order as they do; ties go to the smaller pair.
    let mut queue: BinaryHeap<Reverse<(u64, usize)>> = (0..open.len()).map(|i| Reverse((0, i))).collect();
    let mut horizon = f64::INFINITY;
    let mut left = batch_limit(options);
    while let Some(Reverse((key, i))) = queue.pop() {
        let time = f64::from_bits(key);
        let search = &mut searches[i];
        if time > horizon {
            let verdict = Verdict::Clear { until: time.min(1.0), rest: None };
            let (resolution, depth) = (search.resolution(), search.depth());
            let (past, counters) = (search.is_past(), search.counters());
            open[i].found.outcome = Outcome { verdict, resolution, depth, past, counters, ..open[i].found.outcome };
            open[i].is_left = true;
            continue;
        }
        let next = queue.peek().map_or(f64::INFINITY, |Reverse((next, _))| f64::from_bits(*next));
        let before = search.spent();
        let allowed = before.saturating_add(left);
        let until = next.max(time).min(horizon);
        let undecided = undecided(search, time);
        // Where there is no time left nothing is proven but what the queue says.
        let ended = halt::heeding(halt, || (search.run_within(until, left), halt::is_up()));
        let (ended, is_up) = ended.unwrap_or((Some(undecided), true));
        left = left.saturating_sub(search.spent() - before);
        match ended {
            None => queue.push(Reverse((search.earliest().max(time).to_bits(), i))),
            Some(outcome) => {
                open[i].found.outcome = outcome;
                open[i].take(&questions[i], questions[i].query.cell_limit.min(allowed));
                if is_up {
                    open[i].forget_answer();
                }
                if first && !open[i].plan.sensor && outcome.meets() {
                    horizon = horizon.min(open[i].found.outcome.time_upper() + tolerance::FIRST_SLACK);
                }
            }
        }
    }
}

/// The answer of a search that is not run on, where nothing is met before `time`.
fn undecided(search: &PairSearch, time: f64) -> Outcome {
    let verdict = Verdict::Undecided { time_lower: time.min(1.0) };
    let (resolution, depth, past) = (search.resolution(), search.depth(), search.is_past());
    Outcome { verdict, resolution, depth, past, counters: search.counters(), ..Outcome::clear(resolution) }
}

/// Cells' worth of work that all pairs of a step together may cost by default: two pairs at their own limit.
pub const DEFAULT_BATCH_LIMIT: u64 = 2 * contact::DEFAULT_CELL_LIMIT;

pub(super) fn query<'a>(bodies: &'a [Body], job: &PairJob, options: &StepOptions) -> PairQuery<'a> {
    let side = |index: u32| {
        let body = &bodies[index as usize];
        let discrete = job.plan.detect == Detect::Discrete;
        let motion = if discrete { Motion::resting(body.motion_state.end) } else { body.motion_state.motion };
        contact::PlacedModel { model: &body.part.model, placed: Placed { place: body.place, motion } }
    };
    PairQuery {
        a: side(job.a),
        b: side(job.b),
        resolution: job.resolution,
        cell_limit: if options.cell_limit == 0 { contact::DEFAULT_CELL_LIMIT } else { options.cell_limit },
        strategies: contact::Strategies::default(),
        query_options: query_options(&job.plan, options),
    }
}

/// What is asked of a search. The scene's first contact is the earliest: a mere hit needs its time, too.
fn query_options(plan: &PairPlan, options: &StepOptions) -> QueryOptions {
    let query_options = plan.query_options();
    let report = if options.first { query_options.report.max(Report::Time) } else { query_options.report };
    QueryOptions { report, ..query_options }
}

/// A discrete pair's answer is about the end of the step.
fn finish(plan: &PairPlan, outcome: &mut Outcome) {
    if plan.detect != Detect::Discrete {
        return;
    }
    match &mut outcome.verdict {
        Verdict::Contact(contact) => (contact.time_lower, contact.time, contact.time_upper) = (1.0, 1.0, 1.0),
        Verdict::Overlap(overlap) => overlap.time = 1.0,
        Verdict::Clear { .. } | Verdict::Undecided { .. } => {}
    }
}
