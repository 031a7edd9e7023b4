//! The search: one queue ordered by the earliest time at which an item could hold a contact.
//!
//! Items are slices of time (`slices`) and cells: boxes fixed in the reference body A with what is left there of both trees. The
//! earliest is popped, bounded (`clause`) and put back at the time it is proven free until, or refined: a slice into
//! smaller ones or into cells, a cell into its halves. Where a cell's bounds point to a contact, one is proposed and
//! confirmed (`propose`). When the earliest item lies beyond the verified contact, all that was
//! queued is the proof that nothing came before.
//!
//! A cell inside one body may be dropped only at t > 0: once the start is known to be free of overlap and containment,
//! the first contact lies on both surfaces (f_A = f_B = −delta). Were x deeper in A and just at −delta in B, the same point of B
//! was there before, still deeper in A: nothing of this asks for the sign of delta, so it holds for clearances, too. At t = 0 such cells are refined like any other, and a
//! witness found there restarts the search at 2 delta, then means overlap.

use super::cell::{Cell, Range, Source};
use super::clock::{Clock, Stage};
use super::handed::Handed;
use crate::contact::exclusion::clause::{self, Advance, Hint};
use crate::contact::exclusion::literal::{Side, View};
use crate::contact::query::outcome::{Counters, DEFAULT_CELL_LIMIT};
use crate::contact::query::task::Task;
use crate::contact::witness::found::Ending;
use crate::contact::witness::found::Found;
use crate::math::halt::Halt;
use crate::motion::Instant;
use crate::solid::Face;
use crate::solid::local::{self, LiteralId, Token, Truth};
use glam::DVec3;
use std::collections::BinaryHeap;
use std::sync::Arc;

/// Cells after which a witness is looked for; again whenever as many more were refined.
pub(super) const FIRST_PROBE: u64 = 2_000;

/// Cells beyond the goal that are asked whether another contact touches earlier.
const MAX_RIVALS: u32 = 16;

/// Time, fraction of the step, below which an advance is no progress: at a contact a bound runs out in ever smaller ones.
const LEAST_ADVANCE: f64 = 1e-15;

/// The same as a way, in roundings of a bound.
const LEAST_STEP: f64 = 1e-2;

/// Cells after which a contact that is known, and comes soon, is told as it is.
const LONG: u64 = 20_000;

/// A part of the step within which a contact comes soon.
const SOON: f64 = 1e-6;

/// Share of a bound's rounding down to which the cells at a thin wall's edge are halved.
const SHARP: f64 = 0.05;

/// Of so many cells at a thin wall one looks for a witness by another way.
const DEEPEN_EVERY: u64 = 1000;
/// Cells for each look at the clock, where there is a deadline.
const CELLS_PER_LOOK: u64 = 16;

/// A point this many roundings short of delta can be neither excluded nor confirmed by much.
const NEARLY: f64 = 8.0;

/// Memory of a search, kept from one to the next.
#[derive(Default, Debug)]
pub struct Scratch {
    heap: BinaryHeap<Cell>,
    pub(super) pool: Vec<Token>,
    pub(super) clip_planes_b: Vec<Face>,
    pub(super) clause: clause::Scratch,
    pub(super) hints: Vec<Hint>,
    pub(super) tried: Vec<(Vec<(Side, LiteralId)>, i32)>,
    clock: Option<Clock>,
    /// Ends searches like their limit, from outside.
    pub halt: Option<Arc<Halt>>,
}

impl Scratch {
    /// With a clock: `take_clock` tells afterwards where the time went.
    pub fn timed() -> Self {
        Self { clock: Some(Clock::default()), ..Self::default() }
    }

    /// Memory whose searches end from outside.
    pub fn heeding(halt: Option<Arc<Halt>>) -> Self {
        Self { halt, ..Self::default() }
    }

    /// What the clock says, which starts anew.
    pub fn take_clock(&mut self) -> Option<Clock> {
        self.clock.as_mut().map(std::mem::take)
    }

    /// What follows is work of a stage.
    pub(in crate::contact) fn enter(&mut self, stage: impl Into<Option<Stage>>) {
        if let Some(clock) = &mut self.clock {
            clock.enter(stage.into());
        }
    }
}

/// A search in progress.
pub struct Search<'a> {
    pub(in crate::contact) task: Task<'a>,
    pub(super) scratch: Scratch,
    pub(super) handed: Handed,
    serial: u64,
    pub(in crate::contact) found: Option<Found>,
    /// Cells beyond the goal that were asked for a rival.
    rivals: u32,
    instant: Instant,
    /// Cells after which a witness is looked for where the search has come to.
    probe: u64,
    /// Cells' worth of work after which the search ends as `Ending::Long`.
    pub(in crate::contact) patience: u64,
    /// Where the search came to its end without an answer: time and place.
    pub(super) stuck: Option<(f64, DVec3)>,
    /// Work done so far.
    pub counters: Counters,
}

impl<'a> Search<'a> {
    /// A search with an empty queue; see `start`.
    pub fn new(task: Task<'a>, mut scratch: Scratch) -> Self {
        scratch.heap.clear();
        scratch.pool.clear();
        scratch.clip_planes_b.clear();
        scratch.tried.clear();
        scratch.hints.clear();
        (scratch.clause.clauses, scratch.clause.evaluations) = (0, 0);
        let instant = task.relative.at(0.0);
        Self {
            task,
            scratch,
            handed: Handed::default(),
            serial: 0,
            found: None,
            rivals: 0,
            instant,
            probe: FIRST_PROBE,
            patience: u64::MAX,
            stuck: None,
            counters: Counters::default(),
        }
    }

    /// Ends the search and gives its memory back.
    pub fn into_scratch(self) -> Scratch {
        self.scratch
    }

    pub(super) fn store(&mut self, tokens: &[Token]) -> Range {
        let start = self.scratch.pool.len() as u32;
        self.scratch.pool.extend_from_slice(tokens);
        (start, self.scratch.pool.len() as u32)
    }

    pub(super) fn push(&mut self, mut cell: Cell) {
        cell.serial = self.serial;
        self.serial += 1;
        self.scratch.heap.push(cell);
    }

    /// Takes the earliest item off the queue.
    #[cfg(test)]
    pub(super) fn pop(&mut self) -> Option<Cell> {
        self.scratch.heap.pop()
    }

    /// Time before which nothing can happen in what is queued; infinite when nothing is.
    pub fn earliest(&self) -> f64 {
        self.scratch.heap.peek().map_or(f64::INFINITY, |c| c.t)
    }

    /// The ending of a search that asks for a hit alone, once a contact is known; nothing is met before `proven`. Only where
    /// the start is known to be free.
    pub(in crate::contact) fn hit(&mut self, proven: f64) -> Option<Ending> {
        if self.task.query_options.time() {
            return None;
        }
        let found = self.found.take()?;
        Some(Ending::Contact(Found { goal: proven.max(found.goal), ..found }))
    }

    /// Time of the item that was taken off the queue last: nothing happens before it.
    pub(super) fn now(&self) -> f64 {
        self.instant.t
    }

    pub(in crate::contact) fn goal(&self) -> f64 {
        self.found.as_ref().map_or(f64::INFINITY, |f| f.goal - self.task.proof_slack)
    }

    /// Time until which a rival of the contact found may come; the goal or later.
    fn horizon(&self) -> f64 {
        self.found.as_ref().map_or(f64::INFINITY, |f| f.latest_rival().max(f.goal))
    }

    /// Runs to the end, or until nothing before `until` is left: then `None`.
    pub fn run(&mut self, until: f64) -> Option<Ending> {
        self.scratch.enter(Stage::Cells);
        loop {
            let Some(cell) = self.scratch.heap.peek().copied() else {
                return Some(self.found.take().map_or(Ending::Clear, Ending::Contact));
            };
            if cell.t >= self.goal() {
                // Proven. What lies just behind may touch earlier all the same: a few cells are asked once more.
                let asks = cell.source == Source::Cell && cell.t < self.horizon() && self.rivals < MAX_RIVALS;
                if asks && self.counters.spent(self.task.asked_limit) < self.task.limit {
                    self.scratch.heap.pop();
                    self.rivals += 1;
                    self.refine(cell);
                    continue;
                }
                return Some(self.found.take().map_or(Ending::Clear, Ending::Contact));
            }
            if cell.t > until {
                return None;
            }
            if self.counters.cells >= LONG
                && let Some(ending) = self.settle_for(cell.t)
            {
                return Some(ending);
            }
            // Slices of time are few, and cost no cells.
            if cell.source == Source::Cell
                && (self.counters.spent(self.task.asked_limit) >= self.task.limit || self.is_halted())
            {
                return Some(Ending::Limit(cell.t));
            }
            // Counted as the default limit counts, so that no other limit changes an answer that it does not cut.
            if cell.source == Source::Cell && self.counters.spent(DEFAULT_CELL_LIMIT) >= self.patience {
                return Some(self.impatient(&cell));
            }
            if cell.source == Source::Cell && self.counters.cells >= self.probe {
                self.probe = 2 * self.counters.cells;
                if let Some(ending) = self.look_for_witness(&cell) {
                    return Some(ending);
                }
                continue;
            }
            self.scratch.heap.pop();
            let ending = self.refine(cell);
            self.counters.clauses = self.scratch.clause.clauses;
            self.counters.evaluations = self.scratch.clause.evaluations;
            if ending.is_some() {
                return ending;
            }
        }
    }

    /// The ending with the contact that is known, where it comes so soon after `proven` that what is left is the sharpness of an
    /// edge: nothing is met before, and the bracket says what is open.
    fn settle_for(&mut self, proven: f64) -> Option<Ending> {
        let known = self.found.as_ref()?;
        if proven <= 0.0 || known.upper - proven > SOON {
            return None;
        }
        let found = self.found.take()?;
        Some(Ending::Contact(Found { goal: proven.min(found.goal), ..found }))
    }

    /// True once the search is to end from outside. The clock is looked at once for some cells.
    fn is_halted(&self) -> bool {
        let looks = self.counters.cells.is_multiple_of(CELLS_PER_LOOK);
        self.scratch.halt.as_ref().is_some_and(|halt| if looks { halt.is_over() } else { halt.is_set() })
    }

    /// Refines one cell. A point deeper than delta in both bodies at t = 0 ends the search, and so does one that rounding
    /// keeps from being told.
    fn refine(&mut self, mut cell: Cell) -> Option<Ending> {
        if self.instant.t != cell.t {
            self.instant = self.task.relative.at(cell.t);
        }
        let at = self.instant;
        let start = cell.t == 0.0;
        let beyond = cell.t >= self.goal();
        match cell.source {
            Source::Cell => self.counters.cells += 1,
            Source::Slice => {
                self.scratch.enter(Stage::Region);
                self.locate(&cell);
                self.scratch.enter(Stage::Cells);
                return None;
            }
        }
        if cell.a.0 == cell.a.1 && !start {
            return None;
        }
        let radius = cell.half.length();
        let x_max = (cell.center - at.center_a).length() + radius;
        let end = self.horizon().min(cell.until) - cell.t;
        // Speed bounds need a span, the span a speed: take the whole rest first, then cut.
        let whole = self.task.relative.bounds(cell.t, end, x_max);
        let h = if whole.speed * end > cell.reach * radius { cell.reach * radius / whole.speed } else { end };
        let motion = if h < end { self.task.relative.bounds(cell.t, h, x_max) } else { whole };

        let scratch = &mut self.scratch;
        let (clause_scratch, pool) = (&mut scratch.clause, &mut scratch.pool);
        let hints: &[Hint] = if self.task.strategies.hints { &scratch.hints } else { &[] };
        let view = self.task.view((cell.center, cell.half), &at, motion, &scratch.clip_planes_b);
        let source = if cell.t + h <= cell.b_until { cell.b } else { cell.b_always };
        let b_truth = prune_in_pool(pool, source, &mut |id| view.truth(Side::B, id));
        let b = match b_truth {
            (Truth::Open, range) => {
                cell.b = range;
                cell.b_until = cell.t + h;
                range
            }
            (Truth::True, _) => (0, 0),
            (Truth::False, _) => {
                self.again(cell, h, end, true);
                return None;
            }
        };
        let b_full = b.0 == b.1;
        if b_full && !start {
            self.again(cell, h, end, true);
            return None;
        }
        let one_sided = b_full || cell.a.0 == cell.a.1;
        let found = if b_full && cell.a.0 == cell.a.1 {
            Advance { dt: f64::NEG_INFINITY, support: Vec::new(), y: DVec3::ZERO, cost: DVec3::ZERO, now: 0.0 }
        } else {
            let pair = clause::Expressions { pool, a: cell.a, b };
            clause::advance(&view, &pair, hints, self.task.rounding, 0.0, clause_scratch)
        };
        let still = self.task.relative.bounds(cell.t, 0.0, x_max);
        // Where the bounds are lowest at the start itself: two faces a few resolutions inside each other leave a layer that
        // the lowest point of a later time misses.
        let now = if start && found.dt < 0.0 && h > 0.0 && !found.support.is_empty() {
            let view = View { motion: still, ..view };
            let pair = clause::Expressions { pool, a: cell.a, b };
            clause::advance(&view, &pair, hints, self.task.rounding, 0.0, clause_scratch).y
        } else {
            found.y
        };
        if one_sided {
            // At the start only: exclusion now suffices. Inside A nothing first happens later; inside B not before h.
            if found.dt >= 0.0 {
                if b_full && cell.a.0 != cell.a.1 {
                    self.again(cell, h, end, true);
                }
                return None;
            }
        } else if found.dt >= h {
            self.again(cell, h, end, true);
            return None;
        } else if found.dt > LEAST_ADVANCE.max(LEAST_STEP * self.task.rounding / motion.speed) && !beyond {
            // What splitting could gain is what the cell's extents cost the bound.
            let gain = found.cost.element_sum().min(radius);
            let proven = cell.t + found.dt >= self.goal();
            let far = found.dt * motion.speed >= 0.25 * gain && found.now >= 0.25 * gain;
            if far || found.dt >= self.worthwhile() * end || proven {
                self.again(cell, found.dt, end, false);
                return None;
            }
        }
        if start {
            for x in [cell.center, cell.center + found.y, cell.center + now] {
                if self.task.is_deep_at_start(x, &at) {
                    return Some(Ending::Deep(x));
                }
            }
        }
        // Bodies that stand still to each other meet at the start or never.
        if !one_sided && motion.speed > 0.0 {
            self.attempt(&cell, &found, &at);
            if cell.t >= self.goal() {
                return None;
            }
            let walls = self.task.has_walls();
            // At the edge of a crescent its two faces part slower than a bound's rounding: fits know better.
            let fine = if walls { SHARP * self.task.rounding } else { self.task.rounding };
            if walls && self.found.is_none() && self.counters.cells.is_multiple_of(DEEPEN_EVERY) {
                self.deepen(cell.center + found.y, cell.t, &found.support);
            }
            if found.cost.element_sum() <= fine {
                // The bound is as good as rounding lets it be, and its faces may be those of a later time: what of now?
                let view = self.task.view((cell.center, cell.half), &at, still, &self.scratch.clip_planes_b);
                let pair = clause::Expressions { pool: &self.scratch.pool, a: cell.a, b };
                let now = clause::advance(&view, &pair, &[], self.task.rounding, 0.0, &mut self.scratch.clause);
                self.attempt(&cell, &now, &at);
                if cell.t >= self.goal() {
                    return None;
                }
                if self.task.is_deep(cell.center + now.y, &at, -NEARLY * self.task.rounding) {
                    if walls && self.found.is_none() {
                        self.deepen(cell.center + now.y, cell.t, &found.support);
                    }
                    if walls && let Some(ending) = self.settle_for(cell.t) {
                        return Some(ending);
                    }
                    self.stuck = Some((cell.t, cell.center + now.y));
                    return Some(Ending::Rounding(cell.t));
                }
            }
        }
        self.split(cell, found.cost);
        None
    }

    /// The part of the time left that is worth taking as it is. A slow pair hardly moves in it, and smaller cells would hardly
    /// get further: the more of them there are, the less they must ask for.
    fn worthwhile(&self) -> f64 {
        match self.counters.cells {
            0..1_000 => 0.25,
            1_000..4_000 => 1.0 / 16.0,
            _ => 1.0 / 64.0,
        }
    }

    /// True unless B is proven out of a cell's reach for the whole of its slice.
    pub(super) fn may_meet(&self, cell: &Cell) -> bool {
        let at = self.task.relative.at(cell.t);
        let x_max = (cell.center - at.center_a).length() + cell.half.length();
        let motion = self.task.relative.bounds(cell.t, cell.until - cell.t, x_max);
        let view = self.task.view((cell.center, cell.half), &at, motion, &self.scratch.clip_planes_b);
        let tokens = &self.scratch.pool[cell.b.0 as usize..cell.b.1 as usize];
        tokens.is_empty() || local::prune(tokens, &mut Vec::new(), &mut |id| view.truth(Side::B, id)) != Truth::False
    }

    /// Puts a cell back that is free for `dt`, unless that is all the time there is.
    fn again(&mut self, mut cell: Cell, dt: f64, end: f64, capped: bool) {
        // Beyond the goal a cell is asked once.
        if dt >= end || cell.t >= self.goal() {
            return;
        }
        let mut t = cell.t + dt;
        if rounded_off(cell.t, dt, t) < 0.0 {
            // Not beyond what is proven.
            t = t.next_down();
        }
        if t <= cell.t {
            // Time no longer advances in floating point: only a smaller cell can.
            self.split(cell, DVec3::ZERO);
            return;
        }
        cell.t = t;
        cell.reach = if capped { cell.reach * 2.0 } else { (cell.reach * 0.5).max(0.5) };
        self.push(cell);
    }

    /// Halves a cell along the axis that costs its bound most (`cost`), the longest one where none does.
    fn split(&mut self, cell: Cell, cost: DVec3) {
        let k = clause::axis_to_halve(cost, cell.half);
        let mut half = cell.half;
        half[k] *= 0.5;
        for sign in [-1.0, 1.0] {
            let mut child = Cell { half, ..cell };
            child.center[k] += sign * half[k];
            let off = rounded_off(cell.center[k], sign * half[k], child.center[k]);
            if off != 0.0 {
                // The child must still reach from the parent's wall to its middle.
                child.half[k] = (half[k] + off.abs()).next_up();
            }
            if cell.a.0 < cell.a.1 {
                let (faces, delta, rounding) = (&self.task.a.faces, self.task.delta, self.task.rounding);
                let mut classify = |id: LiteralId| {
                    let span = local::face_span(&faces[id.face() as usize], child.center, child.half);
                    local::truth_of(id.sense(), span, delta, rounding)
                };
                match prune_in_pool(&mut self.scratch.pool, cell.a, &mut classify) {
                    (Truth::False, _) => continue,
                    (Truth::True, _) => child.a = (0, 0),
                    (Truth::Open, range) => child.a = range,
                }
            }
            self.push(child);
        }
    }
}

/// What a + b lost when it was rounded to `sum`, exactly (Knuth's two-sum).
fn rounded_off(a: f64, b: f64, sum: f64) -> f64 {
    let from_b = sum - a;
    (a - (sum - from_b)) + (b - from_b)
}

/// Prunes an expression of the pool, the result behind everything else in it.
fn prune_in_pool(
    pool: &mut Vec<Token>,
    source: Range,
    classify: &mut impl FnMut(LiteralId) -> Truth,
) -> (Truth, Range) {
    if source.0 == source.1 {
        return (Truth::True, (0, 0));
    }
    // The source stays put while the result grows behind it: copy it out of the way of the borrow.
    let tokens: smallvec::SmallVec<[Token; 64]> = pool[source.0 as usize..source.1 as usize].into();
    let start = pool.len() as u32;
    let truth = local::prune(&tokens, pool, classify);
    let end = pool.len() as u32;
    if truth == Truth::Open && end - start == source.1 - source.0 {
        // Nothing folded: keep the old one.
        pool.truncate(start as usize);
        return (Truth::Open, source);
    }
    (truth, (start, end))
}
