//! The search: one queue ordered by the earliest time at which an item could hold a contact.
//!
//! Items are slices of time (`slices`) and cells: boxes fixed in the reference body A with what is left there of both
//! trees. The earliest is popped, bounded (`clause`) and put back at the time it is proven free until, or refined: a
//! slice into smaller ones or into cells, a cell into its halves. Before a cell is bounded it is cut down to what its
//! clauses leave (`exclusion::tighten`). Where a cell's bounds point to a contact, one is proposed and confirmed
//! (`propose`). When the earliest item lies beyond the verified contact, all that was queued is the proof that nothing
//! came before.
//!
//! In the order in which they are called: `run` pops the earliest item. `refine` takes a slice apart, or goes on with a
//! cell: `bound` bounds it, and makes it smaller first where that is worth it (`bound_or_tighten`, `tighten`);
//! `is_free` puts back what is free for a while; `propose` makes a guess of a contact; `look_closer` looks where
//! rounding or a thin wall leaves the bound no room; `split` queues both halves.
//!
//! A cell inside one body may be dropped only at t > 0: once the start is known to be free of overlap and containment,
//! the first contact lies on both surfaces (f_A = f_B = −delta). Were x deeper in A and just at −delta in B, the same
//! point of B was there before, still deeper in A: nothing of this asks for the sign of delta, so it holds for
//! distances that are kept, too. At t = 0 such cells are refined like any other. A witness found there restarts the
//! search at 2 delta, unless it is as deep as that already: then it means overlap. Where a small overlap leaves next to no
//! room, its faces lead to one (`deep_balance`).

use super::cell::{Cell, Range, Source};
use super::clock::Stage;
use super::items::{Items, prune_in_pool};
use super::propose::Proposals;
use super::scratch::Scratch;
use super::slices::Slices;
use crate::contact::exclusion::clause::{self, Advance, Hint};
use crate::contact::exclusion::enumeration;
use crate::contact::exclusion::literal::{Side, View};
use crate::contact::exclusion::tighten::{Left, TIGHTENINGS, WORTH};
use crate::contact::instant::separation;
use crate::contact::query::outcome::Counters;
use crate::contact::witness::balance::{self, MOST_BALANCED};
use crate::contact::witness::climb;
use crate::contact::witness::contacts::{Contacts, Visited};
use crate::contact::witness::found::Ending;
use crate::contact::witness::known::Known;
use crate::contact::witness::newton::Constraint;
use crate::math::halt;
use crate::motion::{Bounds, Instant};
use crate::solid::Solid;
use crate::solid::local::{self, LiteralId, Truth};
use glam::DVec3;
use smallvec::SmallVec;
use std::ops::ControlFlow;

/// Cells after which a witness is looked for; again whenever as many more were refined.
const FIRST_PROBE: u64 = 2_000;

/// Cells beyond the goal that are asked whether another contact touches earlier.
const MAX_RIVALS: u32 = 16;

/// Time, fraction of the step, below which an advance is no progress: at a contact a bound runs out in ever smaller ones.
const LEAST_ADVANCE: f64 = 1e-15;

/// The same as a way, in roundings of a bound.
const LEAST_STEP: f64 = 1e-2;

/// Cells after which no guess of a contact is given up early: what took as many is no easy one.
const FEW: u64 = 24;

/// Cells after which a contact that is known, and comes soon, is told as it is.
const LONG: u64 = 20_000;

/// A part of the step within which a contact comes soon.
const SOON: f64 = 1e-6;

/// Share of a bound's rounding down to which the cells at a thin wall's edge are halved.
const SHARP: f64 = 0.05;

/// Of so many cells at a thin wall one looks for a witness by another way.
const DEEPEN_EVERY: u64 = 1000;

/// A point this many roundings short of delta can be neither excluded nor confirmed by much.
const NEARLY: f64 = 8.0;

/// Cells after which a witness and what is proven by then are the answer.
const LAST: u64 = 16_000;

/// A bracket this wide, a fraction of the step, is told where no coarser resolution has a narrower one.
const WIDE: f64 = 1e-3;

/// Depths searched for within which a start is hardly deeper.
const SHALLOW: f64 = 4.0;

/// Sets of faces that are asked where they are deepest in each other at the start.
const MOST_ASKED: usize = 8;

/// Faces of both bodies, in order.
type BalancedLits = SmallVec<[(Side, LiteralId); MOST_BALANCED]>;

/// How far a cell's bounds look ahead: not beyond `h` of the `end` that is left of its time, within which a point of the cell, at
/// most `x_max` from A's centre, moves like `motion`.
#[derive(Clone, Copy)]
struct Span {
    x_max: f64,
    end: f64,
    h: f64,
    motion: Bounds,
}

/// What a cell's bounds say.
struct Bounded {
    /// What is left of b in it.
    b: Range,
    /// Its weakest clause, from its own time on.
    found: Advance,
    /// Where the bounds are lowest at the start itself: offset from the cell's centre.
    now: DVec3,
}

impl Bounded {
    /// True where the cell lies in one of the bodies.
    fn is_one_sided(&self, cell: &Cell) -> bool {
        self.b.0 == self.b.1 || cell.a.0 == cell.a.1
    }
}

/// A search in progress.
pub struct Search<'a> {
    contacts: Contacts<'a>,
    items: Items,
    /// Cells beyond the goal that were asked for a rival.
    rivals: u32,
    instant: Instant,
    /// Cells after which a witness is looked for where the search has come to.
    probe: u64,
    /// Effort (`Counters::effort`) after which the search ends as `Ending::Long`.
    pub(in crate::contact) patience: u64,
    /// Where the search came to its end without an answer: time and place.
    stuck: Option<(f64, DVec3)>,
    /// Nothing happens before, as far as the item in hand shows.
    proven: f64,
    /// Faces that were asked where they are deepest in each other at the start.
    balanced: SmallVec<[BalancedLits; 2]>,
    /// The faces of a contact that comes at once were asked so, too.
    asked_soon: bool,
}

impl<'a> Search<'a> {
    /// A search with an empty queue (see `start`), after kernels that may have found contacts, but did not settle the task.
    pub fn new(contacts: Contacts<'a>, scratch: Scratch) -> Self {
        let instant = contacts.task.relative.at(0.0);
        Self {
            contacts,
            items: Items::new(scratch),
            rivals: 0,
            instant,
            probe: FIRST_PROBE,
            patience: u64::MAX,
            stuck: None,
            proven: 0.0,
            balanced: SmallVec::new(),
            asked_soon: false,
        }
    }

    /// Queues the step from a time on before which it is proven that no contact comes.
    pub fn start(&mut self, from: f64) {
        self.items.push(Cell::source(from, 1.0, Source::Slice));
    }

    /// Work done so far.
    pub fn counters(&self) -> &Counters {
        &self.contacts.counters
    }

    /// The work done so far, which is counted anew.
    pub fn take_counters(&mut self) -> Counters {
        std::mem::take(&mut self.contacts.counters)
    }

    /// Lets the search do so many cells' worth of work in all.
    pub fn limit_to(&mut self, cells: u64) {
        self.contacts.task.limit = cells;
    }

    /// Ends the search and gives its memory back.
    pub fn into_scratch(self) -> Scratch {
        self.items.scratch
    }

    /// Time before which nothing can happen in what is queued; infinite when nothing is.
    pub fn earliest(&self) -> f64 {
        self.items.earliest()
    }

    /// Runs to the end, or until nothing before `until` is left: then `None`. Where the time of the step ends amid an item, nothing is
    /// proven but what was before it.
    pub fn run(&mut self, until: f64) -> Option<Ending> {
        self.items.scratch.enter(Stage::Cells);
        halt::attempt(|| self.pop_until(until)).unwrap_or_else(|| {
            let is_proven = self.proven >= self.contacts.goal();
            Some(if is_proven { self.contacts.end() } else { Ending::Limit(self.proven) })
        })
    }

    fn pop_until(&mut self, until: f64) -> Option<Ending> {
        loop {
            let Some(cell) = self.items.scratch.heap.peek().copied() else {
                return Some(self.contacts.end());
            };
            self.proven = cell.t.min(self.contacts.goal());
            if cell.t >= self.contacts.goal() {
                // Proven. What lies just behind may touch earlier all the same: a few cells are asked once more.
                let asks = cell.source == Source::Cell && cell.t < self.contacts.horizon() && self.rivals < MAX_RIVALS;
                if asks && self.contacts.counters.spent(self.contacts.task.asked_limit) < self.contacts.task.limit {
                    self.items.scratch.heap.pop();
                    self.rivals += 1;
                    self.refine(cell);
                    continue;
                }
                return Some(self.contacts.end());
            }
            if cell.t > until {
                return None;
            }
            if self.contacts.counters.cells >= LONG
                && let Some(ending) = self.settle_for(cell.t)
            {
                return Some(ending);
            }
            // Slices of time are few, and cost no cells.
            if cell.source == Source::Cell
                && (self.contacts.counters.spent(self.contacts.task.asked_limit) >= self.contacts.task.limit
                    || self.contacts.counters.evaluations >= self.contacts.task.most_evaluations
                    || halt::is_up())
            {
                return Some(Ending::Limit(cell.t));
            }
            // Counted the same whatever the limit is, so that none changes an answer that it does not cut.
            if cell.source == Source::Cell && self.contacts.counters.effort() >= self.patience {
                return Some(self.impatient(&cell));
            }
            if cell.source == Source::Cell && self.contacts.counters.cells >= self.probe {
                let ending = self.look_for_witness(&cell);
                if ending.is_some() {
                    return ending;
                }
                // The look counts too: as much is searched before the next one.
                self.probe = 2 * self.contacts.counters.cells;
                continue;
            }
            self.items.scratch.heap.pop();
            let ending = self.refine(cell);
            self.contacts.counters.clauses = self.items.scratch.clause.clauses;
            self.contacts.counters.evaluations = self.items.scratch.clause.evaluations;
            if ending.is_some() {
                return ending;
            }
        }
    }

    /// The ending with the contact that is known, where it comes so soon after `proven` that what is left is the sharpness of an
    /// edge: nothing is met before, and the bracket says what is open.
    fn settle_for(&mut self, proven: f64) -> Option<Ending> {
        let known = self.contacts.found.as_ref()?;
        if proven <= 0.0 || known.upper - proven > SOON {
            return None;
        }
        self.contacts.end_from(proven)
    }

    /// Refines one cell. A point deeper than delta in both bodies at t = 0 ends the search, and so does one that rounding
    /// keeps from being told.
    fn refine(&mut self, mut cell: Cell) -> Option<Ending> {
        if self.instant.t != cell.t {
            self.instant = self.contacts.task.relative.at(cell.t);
            self.contacts.now = self.instant.t;
        }
        let at = self.instant;
        match cell.source {
            Source::Cell => self.contacts.counters.cells += 1,
            Source::Slice => {
                self.items.scratch.enter(Stage::Region);
                let located = self.contacts.task.strategies.region.then(|| self.contacts.region(cell.t, cell.until));
                if !matches!(located, Some(None)) {
                    let counters = &mut self.contacts.counters;
                    Slices { task: &self.contacts.task, items: &mut self.items, counters }
                        .decompose(&cell, located.flatten());
                }
                self.items.scratch.enter(Stage::Cells);
                return None;
            }
        }
        if cell.a.0 == cell.a.1 && cell.t != 0.0 {
            return None;
        }
        let mut span = self.span(&cell, &at);
        let bounded = self.bound(&mut cell, &mut span, &at)?;
        if self.is_free(&cell, &span, &bounded) {
            return None;
        }
        if cell.t == 0.0 {
            for x in [cell.center, cell.center + bounded.found.y, cell.center + bounded.now] {
                if self.contacts.task.is_deep_at_start(x, &at) {
                    return Some(Ending::Deep(self.deeper(x, &bounded.found, &at)));
                }
            }
        }
        if self.has_parts(&cell, &bounded) {
            // What they hold is not looked at yet: it is in smaller cells, whatever the bound is short of.
            self.split(cell, DVec3::ZERO);
            return None;
        }
        // Bodies that stand still to each other meet at the start or never.
        let may_meet = !bounded.is_one_sided(&cell) && span.motion.speed > 0.0;
        if may_meet {
            self.propose(&cell, &bounded.found, &at, false);
            if cell.t >= self.contacts.goal() {
                return None;
            }
        }
        if cell.t == 0.0
            && let Some(x) = self.deep_balance(&cell, &bounded.found, &at)
        {
            return Some(Ending::Deep(x));
        }
        if may_meet && let ControlFlow::Break(ending) = self.look_closer(&cell, &span, &bounded, &at) {
            return ending;
        }
        self.split(cell, bounded.found.cost);
        None
    }

    /// A point deep in both bodies at the start, where the faces that hold a cell are deepest in each other. What a small overlap
    /// leaves in common is thin: cells that find it by halving must become as small. A contact that comes so soon that rounding
    /// forbids to prove the start free leads to one by its own faces.
    fn deep_balance(&mut self, cell: &Cell, found: &Advance, at: &Instant) -> Option<DVec3> {
        let task = &self.contacts.task;
        let (lits, x): (BalancedLits, DVec3) = match &self.contacts.found {
            None => {
                let mut lits: BalancedLits = found.support.iter().map(|l| (l.0, l.1)).collect();
                lits.sort_unstable();
                if self.balanced.len() >= MOST_ASKED || self.balanced.contains(&lits) {
                    return None;
                }
                self.balanced.push(lits.clone());
                (lits, cell.center + found.y)
            }
            Some(soon) if soon.goal <= f64::MIN_POSITIVE && task.query_options.time() && !self.asked_soon => {
                self.asked_soon = true;
                (soon.deep.active.iter().filter_map(Constraint::literal).collect(), soon.deep.x)
            }
            Some(_) => return None,
        };
        let balance = balance::of_literals(task, at, &lits, x);
        balance.map(|((x, ..), _)| x).filter(|x| task.is_deep_at_start(*x, at))
    }

    /// A point that is deep at the start, or where the faces that hold its cell are deepest in each other, if that is deeper. Asked of
    /// bodies that are hardly deeper than is searched: how deep they are tells which depth is worth a search.
    fn deeper(&self, x: DVec3, found: &Advance, at: &Instant) -> DVec3 {
        let task = &self.contacts.task;
        let value = |x: DVec3| separation::value(task, at, x);
        let here = value(x);
        if -here > SHALLOW * task.delta {
            return x;
        }
        let lits: BalancedLits = found.support.iter().map(|l| (l.0, l.1)).collect();
        let balance = balance::of_literals(task, at, &lits, x).map(|((x, ..), _)| x);
        balance.filter(|other| value(*other) < here).unwrap_or(x)
    }

    /// How far a cell's bounds are to look ahead.
    fn span(&self, cell: &Cell, at: &Instant) -> Span {
        let relative = &self.contacts.task.relative;
        let radius = cell.half.length();
        let x_max = (cell.center - at.center_a).length() + radius;
        let end = self.contacts.horizon().min(cell.until) - cell.t;
        // Speed bounds need a span, the span a speed: take the whole rest first, then cut.
        let whole = relative.bounds(cell.t, end, x_max);
        let h = if whole.speed * end > cell.reach * radius { cell.reach * radius / whole.speed } else { end };
        let motion = if h < end { relative.bounds(cell.t, h, x_max) } else { whole };
        Span { x_max, end, h, motion }
    }

    /// Bounds a cell's clauses, of b's those that may hold something in it. Where much of the cell is cut off by what all clauses
    /// share, what is left is bounded in its stead. `None` where nothing is left to be bounded.
    fn bound(&mut self, cell: &mut Cell, span: &mut Span, at: &Instant) -> Option<Bounded> {
        for round in 0..=TIGHTENINGS {
            let b = self.prune_b(cell, span, at)?;
            if cell.a.0 == cell.a.1 && cell.t != 0.0 {
                return None;
            }
            let worth = if round < TIGHTENINGS && self.contacts.task.strategies.tighten { WORTH } else { -1.0 };
            match self.bound_or_tighten(cell, span, at, b, worth) {
                Ok(bounded) => return Some(bounded),
                Err(left) => {
                    if !self.tighten(cell, &left, span) {
                        return None;
                    }
                }
            }
        }
        unreachable!("the last round tightens nothing")
    }

    /// What is left of b in a cell. `None` where b alone keeps it free.
    fn prune_b(&mut self, cell: &mut Cell, span: &Span, at: &Instant) -> Option<Range> {
        let h = span.h;
        let scratch = &mut self.items.scratch;
        let view = self.contacts.task.view((cell.center, cell.half), at, span.motion, &scratch.clip_planes_b);
        let source = if cell.t + h <= cell.b_until { cell.b } else { cell.b_always };
        let classify = &mut |id| view.truth(Side::B, id);
        match prune_in_pool(self.contacts.task.b, &mut scratch.pool, source, classify) {
            (Truth::Open, range) => {
                cell.b = range;
                cell.b_until = cell.t + h;
                return Some(range);
            }
            (Truth::True, _) if cell.t == 0.0 => return Some((0, 0)),
            (Truth::True | Truth::False, _) => {}
        }
        self.again(*cell, h, span.end, true);
        None
    }

    /// Bounds the clauses of a cell, or tells what is left of it where that is no more than the part `worth`.
    fn bound_or_tighten(
        &mut self,
        cell: &Cell,
        span: &Span,
        at: &Instant,
        b: Range,
        worth: f64,
    ) -> Result<Bounded, Left> {
        let scratch = &mut self.items.scratch;
        let (clause_scratch, pool, rounding) = (&mut scratch.clause, &scratch.pool, self.contacts.task.rounding);
        let hints: &[Hint] = if self.contacts.task.strategies.hints { &self.contacts.hints } else { &[] };
        let view = self.contacts.task.view((cell.center, cell.half), at, span.motion, &scratch.clip_planes_b);
        let pair = clause::Expressions { pool, a: cell.a, b };
        let found = if b.0 == b.1 && cell.a.0 == cell.a.1 {
            Advance { dt: f64::NEG_INFINITY, support: Vec::new(), y: DVec3::ZERO, cost: DVec3::ZERO, now: 0.0 }
        } else {
            enumeration::advance_or_tighten(&view, &pair, hints, rounding, worth, clause_scratch)?
        };
        // Where the bounds are lowest at the start itself: two faces a few resolutions inside each other leave a layer that
        // the lowest point of a later time misses.
        let now = if cell.t == 0.0 && found.dt < 0.0 && span.h > 0.0 && !found.support.is_empty() {
            let view = View { motion: self.contacts.task.relative.bounds(cell.t, 0.0, span.x_max), ..view };
            enumeration::advance(&view, &pair, hints, rounding, 0.0, clause_scratch).y
        } else {
            found.y
        };
        Ok(Bounded { b, found, now })
    }

    /// Makes a cell what is left of it. What is left over the span alone ends with it; behind it the cell goes on. False where nothing
    /// is left for now.
    fn tighten(&mut self, cell: &mut Cell, left: &Left, span: &mut Span) -> bool {
        if left.span.is_empty() {
            self.again(*cell, span.h, span.end, true);
            return false;
        }
        let lasts = span.h >= span.end;
        if lasts || Left::part(&left.always, cell.half) > WORTH {
            if !lasts {
                let mut rest = *cell;
                rest.shrink(&left.always);
                self.again(rest, span.h, span.end, true);
                (cell.until, span.end) = (cell.t + span.h, span.h);
            }
            cell.shrink(&left.span);
        } else {
            cell.shrink(&left.always);
        }
        self.prune_a(cell)
    }

    /// Leaves of a's expression what may hold something in a cell; false where a is nowhere in it.
    fn prune_a(&mut self, cell: &mut Cell) -> bool {
        if cell.a.0 == cell.a.1 {
            return true;
        }
        let (faces, delta, rounding) =
            (&self.contacts.task.a.faces, self.contacts.task.delta, self.contacts.task.rounding);
        let mut classify = |id: LiteralId| {
            let span = local::face_span(&faces[id.face() as usize], cell.center, cell.half);
            local::truth_of(id.sense(), span, delta, rounding)
        };
        match prune_in_pool(self.contacts.task.a, &mut self.items.scratch.pool, cell.a, &mut classify) {
            (Truth::False, _) => return false,
            (Truth::True, _) => cell.a = (0, 0),
            (Truth::Open, range) => cell.a = range,
        }
        true
    }

    /// True where parts of large meshes are left in a cell, too many to be written out.
    fn has_parts(&self, cell: &Cell, bounded: &Bounded) -> bool {
        let Contacts { task, .. } = &self.contacts;
        let has = |solid: &Solid, range: Range| {
            solid.has_parts
                && self.items.scratch.pool[range.0 as usize..range.1 as usize].iter().any(|t| local::is_part(*t))
        };
        has(task.a, cell.a) || has(task.b, bounded.b)
    }

    /// True where a cell's bounds keep it free for good, or for as long as makes it worth to be put back as it is.
    fn is_free(&mut self, cell: &Cell, span: &Span, bounded: &Bounded) -> bool {
        let (Bounded { b, found, .. }, Span { end, h, motion, .. }) = (bounded, *span);
        let b_full = b.0 == b.1;
        if bounded.is_one_sided(cell) {
            // At the start only: exclusion now suffices. Inside A nothing first happens later; inside B not before h.
            let free = found.dt >= 0.0;
            if free && b_full && cell.a.0 != cell.a.1 {
                self.again(*cell, h, end, true);
            }
            return free;
        }
        if found.dt >= h {
            self.again(*cell, h, end, true);
            return true;
        }
        let beyond = cell.t >= self.contacts.goal();
        if found.dt > LEAST_ADVANCE.max(LEAST_STEP * self.contacts.task.rounding / motion.speed) && !beyond {
            // What splitting could gain is what the cell's extents cost the bound.
            let gain = found.cost.element_sum().min(cell.half.length());
            let proven = cell.t + found.dt >= self.contacts.goal();
            let far = found.dt * motion.speed >= 0.25 * gain && found.now >= 0.25 * gain;
            if far || found.dt >= self.worthwhile() * end || proven {
                self.again(*cell, found.dt, end, false);
                return true;
            }
        }
        false
    }

    /// Looks for a contact where a cell's bound is as good as rounding lets it be, and at thin walls. Breaks off where nothing is
    /// left to halve the cell for: with the ending, where rounding keeps a point there from being told.
    fn look_closer(
        &mut self,
        cell: &Cell,
        span: &Span,
        bounded: &Bounded,
        at: &Instant,
    ) -> ControlFlow<Option<Ending>> {
        let found = &bounded.found;
        let rounding = self.contacts.task.rounding;
        let walls = self.contacts.task.has_walls();
        // At the edge of a crescent its two faces part slower than a bound's rounding: fits know better.
        let fine = if walls { SHARP * rounding } else { rounding };
        if walls && self.contacts.found.is_none() && self.contacts.counters.cells.is_multiple_of(DEEPEN_EVERY) {
            self.deepen(cell.center + found.y, cell.t, &found.support);
        }
        let as_good = found.cost.element_sum() <= fine;
        if !as_good {
            return ControlFlow::Continue(());
        }
        // The bound is as good as rounding lets it be, and its faces may be those of a later time: what of now?
        let still = self.contacts.task.relative.bounds(cell.t, 0.0, span.x_max);
        let view = self.contacts.task.view((cell.center, cell.half), at, still, &self.items.scratch.clip_planes_b);
        let pair = clause::Expressions { pool: &self.items.scratch.pool, a: cell.a, b: bounded.b };
        let now = enumeration::advance(&view, &pair, &[], rounding, 0.0, &mut self.items.scratch.clause);
        self.propose(cell, &now, at, true);
        if cell.t >= self.contacts.goal() {
            return ControlFlow::Break(None);
        }
        if !self.contacts.task.is_deep(cell.center + now.y, at, -NEARLY * rounding) {
            return ControlFlow::Continue(());
        }
        if walls && self.contacts.found.is_none() {
            self.deepen(cell.center + now.y, cell.t, &found.support);
        }
        let settled = if walls { self.settle_for(cell.t) } else { None };
        if settled.is_none() {
            self.stuck = Some((cell.t, cell.center + now.y));
        }
        ControlFlow::Break(settled.or(Some(Ending::Rounding(cell.t))))
    }

    /// Tries to find the contact that a cell's weakest clause points to. Guesses that do not converge steadily are given up while
    /// cells are few, unless one is to be `patient`: a smaller cell's are better.
    fn propose(&mut self, cell: &Cell, advance: &Advance, at: &Instant, patient: bool) {
        let patient = patient || self.contacts.counters.cells >= FEW;
        let visited = Visited::default();
        Proposals { items: &mut self.items, contacts: &mut self.contacts, patient, visited }.attempt(cell, advance, at);
    }

    /// Looks for a witness at a thin wall, beside x.
    fn deepen(&mut self, x: DVec3, t: f64, support: &[(Side, LiteralId, f64)]) {
        climb::deepen(&mut self.contacts, Known::Handed(&self.items.handed), x, t, support);
    }

    /// Looks for a witness soon after a cell's time; an ending where nothing more is to be gained by further cells.
    fn look_for_witness(&mut self, cell: &Cell) -> Option<Ending> {
        // Depths that are no depths, and what starts inside, are asked otherwise.
        if !self.contacts.task.continues() {
            return None;
        }
        // One that is known and comes soon is as good as any other: what is left to do is the proof.
        let known = self.contacts.found.as_ref().is_some_and(|found| found.upper - cell.t <= WIDE);
        if !known {
            climb::probe(&mut self.contacts, cell.t, cell.center);
        }
        (self.contacts.counters.cells >= LAST).then(|| self.bracket_or_long(cell.t)).flatten()
    }

    /// The ending of a search whose patience is at its end: a witness not long after a cell's time, or none.
    fn impatient(&mut self, cell: &Cell) -> Ending {
        let long = Ending::Long(cell.t, None);
        if !self.contacts.task.continues() {
            return long;
        }
        climb::probe(&mut self.contacts, cell.t, cell.center);
        self.bracket_or_long(cell.t).unwrap_or(long)
    }

    /// As `bracket`; where a coarser resolution may be tried, and may tell more, that is said.
    fn bracket_or_long(&mut self, proven: f64) -> Option<Ending> {
        match climb::bracket(&mut self.contacts, proven)? {
            Ending::Contact(found) if found.upper - proven > WIDE && self.patience < u64::MAX => {
                Some(Ending::Long(proven, Some(found)))
            }
            ending => Some(ending),
        }
    }

    /// The answer of a search that rounding has stopped: a witness behind what is proven.
    pub(in crate::contact) fn rescue(&mut self) -> Option<Ending> {
        let (t, x) = self.stuck.filter(|_| self.contacts.task.continues())?;
        climb::probe(&mut self.contacts, t, x);
        climb::bracket(&mut self.contacts, t)
    }

    /// The part of the time left that is worth taking as it is. A slow pair hardly moves in it, and smaller cells would hardly
    /// get further: the more of them there are, the less they must ask for.
    fn worthwhile(&self) -> f64 {
        match self.contacts.counters.cells {
            0..1_000 => 0.25,
            1_000..4_000 => 1.0 / 16.0,
            _ => 1.0 / 64.0,
        }
    }

    /// Puts a cell back that is free for `dt`, unless that is all the time there is.
    fn again(&mut self, mut cell: Cell, dt: f64, end: f64, capped: bool) {
        // Beyond the goal a cell is asked once.
        if dt >= end || cell.t >= self.contacts.goal() {
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
        self.items.push(cell);
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
            if !self.prune_a(&mut child) {
                continue;
            }
            self.items.push(child);
        }
    }
}

/// What a + b lost when it was rounded to `sum`, exactly (Knuth's two-sum).
fn rounded_off(a: f64, b: f64, sum: f64) -> f64 {
    let from_b = sum - a;
    (a - (sum - from_b)) + (b - from_b)
}
