//! The search: one queue ordered by the earliest time at which an item could hold a contact.
//!
//! Items are slices of time (`stage2`) and cells: boxes fixed in the carrier A with what is left there of both trees. The
//! earliest is popped, bounded (`clause`) and put back at the time it is proven free until, or refined: a slice into
//! smaller ones or into cells, a cell into its halves. Where a cell's bounds point to a contact, Newton proposes one
//! and both whole trees confirm it (`newton`). When the earliest item lies beyond the verified contact, all that was
//! queued is the proof that nothing came before.
//!
//! A cell inside one body may be dropped only at t > 0: once the start is known to be free of overlap and containment,
//! the first contact lies on both surfaces (f_A = f_B = −delta). At t = 0 such cells are refined like any other, and a
//! witness found there restarts the search at 2 delta, then means overlap.

use super::clause::{self, Advance, Hint};
use super::fit;
use super::literal::{Faces, Side, View};
use super::newton::{Actives, Constraint, Problem, Solution, Weights};
use super::outcome::Counters;
use super::pair::Ideas;
use super::stage2::Stage2;
use crate::eco::Model;
use crate::math::Aabb;
use crate::motion::{Bounds, Instant, Relative};
use crate::solid::local::{self, LiteralId, Token, Truth};
use crate::solid::{Face, Sense, Solid};
use glam::DVec3;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// An expression in the token pool; `start == end` means true everywhere.
pub(super) type Range = (u32, u32);

/// What an item of the queue is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// A cell of stage 3.
    Cell,
    /// A slice of time for stages 1 and 2.
    Slice,
}

/// An item: a box fixed in A with what is left there of both trees, or what such boxes come from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    /// Proven free of contact before this time.
    pub t: f64,
    /// End of the slice of time that it stands for.
    pub until: f64,
    /// Order of creation: ties in time are popped in this order.
    pub serial: u64,
    pub center: DVec3,
    pub half: DVec3,
    pub a: Range,
    /// B's expression at all times.
    pub b_always: Range,
    /// B's expression until `b_until`.
    pub b: Range,
    pub b_until: f64,
    /// Length of a look ahead in units of radius / speed.
    pub reach: f64,
    /// What it is; only cells have a box and expressions.
    pub source: Source,
}

impl Cell {
    pub(super) fn new((t, until): (f64, f64), region: &Aabb, a: Range, b: Range) -> Self {
        let (center, half) = (region.center(), region.half());
        Self {
            t,
            until,
            serial: 0,
            center,
            // Centre and half are rounded; the box they make must hold the region.
            half: half + (center.abs() + half) * f64::EPSILON,
            a,
            b_always: b,
            b,
            b_until: f64::INFINITY,
            reach: 2.0,
            source: Source::Cell,
        }
    }

    pub(super) fn source(t: f64, until: f64, source: Source) -> Self {
        Self { source, ..Self::new((t, until), &Aabb::around(DVec3::ZERO, DVec3::ZERO), (0, 0), (0, 0)) }
    }
}

impl PartialEq for Cell {
    fn eq(&self, o: &Self) -> bool {
        self.cmp(o) == Ordering::Equal
    }
}
impl Eq for Cell {}
impl PartialOrd for Cell {
    fn partial_cmp(&self, o: &Self) -> Option<Ordering> {
        Some(self.cmp(o))
    }
}
impl Ord for Cell {
    // The heap's greatest is the earliest.
    fn cmp(&self, o: &Self) -> Ordering {
        o.t.total_cmp(&self.t).then(o.serial.cmp(&self.serial))
    }
}

/// A confirmed contact.
#[derive(Clone, Debug)]
pub struct Found {
    /// The witness of depth delta.
    pub deep: Solution,
    /// The same contact where the surfaces meet, when it could be continued back.
    pub touch: Option<Solution>,
    /// Time until which everything must be proven free.
    pub goal: f64,
    /// Earliest time of a witness of depth delta, this contact's or a rival's.
    pub upper: f64,
}

impl Found {
    /// Latest time at which a contact that touches earlier than this one may reach delta and still be preferred to it: its
    /// witness comes later by no more than this one's own lag behind its touch.
    fn latest_rival(&self) -> f64 {
        self.touch.as_ref().map_or(self.goal, |touch| 2.0 * self.deep.t - touch.t.max(0.0))
    }

    /// The contact to report of two: of those that reach delta at about the same time the one that touches first.
    fn or(self, other: Self) -> Self {
        let (goal, upper) = (self.goal.min(other.goal), self.upper.min(other.upper));
        let (first, second) = if other.goal < self.goal { (other, self) } else { (self, other) };
        let earlier = match (&first.touch, &second.touch) {
            (Some(a), Some(b)) => b.t < a.t - SAME_TIME && second.deep.t <= first.latest_rival(),
            _ => false,
        };
        Self { goal, upper, ..if earlier { second } else { first } }
    }
}

/// How a search ended.
// The contact is kept in place: one a query, and nothing allocated.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug)]
pub enum Ending {
    /// No contact within the step.
    Clear,
    /// The earliest contact.
    Contact(Found),
    /// A point of this depth exists at t = 0 (A's frame).
    Deep(DVec3),
    /// The work limit ran out; free before this time.
    Limit(f64),
}

/// What to search: two solids, their motion, a depth, a limit.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The carrier of the cells.
    pub a: &'a Solid,
    /// The other solid.
    pub b: &'a Solid,
    /// A's octree and bounds.
    pub model_a: &'a Model,
    /// B's octree and bounds.
    pub model_b: &'a Model,
    /// Ideas of the search that are switched on.
    pub ideas: Ideas,
    /// Of an overlap the deepest point is looked for.
    pub penetration: bool,
    /// Motion of the pair.
    pub relative: Relative,
    /// Depth at which a contact is decided.
    pub delta: f64,
    /// What rounding may do to one bound: E of docs/accuracy.md, a length.
    pub rounding: f64,
    /// What is this near to delta at the start counts as that deep: rounding, where a second search follows; else 0.
    pub nearly: f64,
    /// Length scale of the pair.
    pub scale: f64,
    /// Search only the instant t = 0.
    pub still: bool,
    /// Everything is proven up to this long before the contact, a fraction of the step: 0 for an answer.
    pub lead: f64,
    /// Cells that may be refined.
    pub limit: u64,
}

/// |Σ λ g| below which multipliers have settled.
const SETTLED: f64 = 1e-6;

/// Steps in which the slowest motion that is told from rest passes the scale of a pair.
const SLOWEST: f64 = 1e12;

/// Witnesses this close in time are of one contact; touches this close are at the same time.
const SAME_TIME: f64 = 1e-12;

/// Cells beyond the goal that are asked whether another contact touches earlier.
const MAX_RIVALS: u32 = 16;

/// Witnesses this close, in scales of the pair, are one point.
const SAME_POINT: f64 = 1e-6;

/// Time, fraction of the step, below which an advance is no progress: at a contact a bound runs out in ever smaller ones.
const LEAST_ADVANCE: f64 = 1e-15;

/// A cell thinner than this part of the pair's scale may be held by one body alone.
const THIN: f64 = 1e-6;

/// Points kept at which curved faces are touched.
const MAX_HINTS: usize = 8;

impl<'a> Task<'a> {
    /// A cell at an instant of its own time.
    fn view<'v>(&self, cell: &Cell, at: &'v Instant, motion: Bounds, guards_b: &'v [Face]) -> View<'v>
    where
        'a: 'v,
    {
        View {
            a: Faces { solid: self.a, guards: &[] },
            b: Faces { solid: self.b, guards: guards_b },
            at,
            motion,
            center: cell.center,
            half: cell.half,
            radius: cell.half.length(),
            center_b: at.b_point(cell.center),
            velocity: at.velocity(cell.center),
            delta: self.delta,
            rounding: self.rounding,
            fits: self.ideas.fits,
            curved: true,
        }
    }
}

/// Memory of a search, kept from one to the next.
#[derive(Default, Debug)]
pub struct Scratch {
    heap: BinaryHeap<Cell>,
    pub(super) pool: Vec<Token>,
    pub(super) guards_b: Vec<Face>,
    pub(super) clause: clause::Scratch,
    hints: Vec<Hint>,
    tried: Vec<(Vec<(Side, LiteralId)>, i32)>,
}

/// A search in progress.
pub struct Search<'a> {
    pub(super) task: Task<'a>,
    pub(super) scratch: Scratch,
    pub(super) stage2: Stage2,
    serial: u64,
    pub(super) found: Option<Found>,
    /// Cells beyond the goal that were asked for a rival.
    rivals: u32,
    instant: Instant,
    /// Work done so far.
    pub counters: Counters,
}

impl<'a> Search<'a> {
    /// A search with an empty queue; see `start`.
    pub fn new(task: Task<'a>, mut scratch: Scratch) -> Self {
        scratch.heap.clear();
        scratch.pool.clear();
        scratch.guards_b.clear();
        scratch.tried.clear();
        scratch.hints.clear();
        scratch.clause.clauses = 0;
        let instant = task.relative.at(0.0);
        Self {
            task,
            scratch,
            stage2: Stage2::default(),
            serial: 0,
            found: None,
            rivals: 0,
            instant,
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

    fn goal(&self) -> f64 {
        self.found.as_ref().map_or(f64::INFINITY, |f| f.goal - self.task.lead)
    }

    /// Time until which a rival of the contact found may come; the goal or later.
    fn horizon(&self) -> f64 {
        self.found.as_ref().map_or(f64::INFINITY, |f| f.latest_rival().max(f.goal))
    }

    /// Runs to the end, or until nothing before `until` is left: then `None`.
    pub fn run(&mut self, until: f64) -> Option<Ending> {
        loop {
            let Some(cell) = self.scratch.heap.peek().copied() else {
                return Some(self.found.take().map_or(Ending::Clear, Ending::Contact));
            };
            if cell.t >= self.goal() {
                // Proven. What lies just behind may touch earlier all the same: a few cells are asked once more.
                let asks = cell.source == Source::Cell && cell.t < self.horizon() && self.rivals < MAX_RIVALS;
                if asks && self.counters.cells < self.task.limit {
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
            // Slices of time are few, and cost no cells.
            if cell.source == Source::Cell && self.counters.cells >= self.task.limit {
                return Some(Ending::Limit(cell.t));
            }
            self.scratch.heap.pop();
            let deep = self.refine(cell);
            self.counters.clauses = self.scratch.clause.clauses;
            if let Some(x) = deep {
                return Some(Ending::Deep(x));
            }
        }
    }

    /// Refines one cell; a point deeper than delta in both bodies at t = 0 ends the search.
    fn refine(&mut self, mut cell: Cell) -> Option<DVec3> {
        if self.instant.t != cell.t {
            self.instant = self.task.relative.at(cell.t);
        }
        let at = self.instant;
        let start = cell.t == 0.0;
        let beyond = cell.t >= self.goal();
        match cell.source {
            Source::Cell => self.counters.cells += 1,
            Source::Slice => {
                self.locate(&cell);
                return None;
            }
        }
        if cell.a.0 == cell.a.1 && !start {
            return None;
        }
        let radius = cell.half.length();
        let x_max = (cell.center - at.center_a).length() + radius;
        let end = if self.task.still { 0.0 } else { self.horizon().min(cell.until) - cell.t };
        // Speed bounds need a span, the span a speed: take the whole rest first, then cut.
        let whole = self.task.relative.bounds(cell.t, end, x_max);
        let h = if whole.speed * end > cell.reach * radius { cell.reach * radius / whole.speed } else { end };
        let motion = if h < end { self.task.relative.bounds(cell.t, h, x_max) } else { whole };

        let scratch = &mut self.scratch;
        let (clause_scratch, pool) = (&mut scratch.clause, &mut scratch.pool);
        let hints: &[Hint] = if self.task.ideas.hints { &scratch.hints } else { &[] };
        let view = self.task.view(&cell, &at, motion, &scratch.guards_b);
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
            Advance { dt: f64::NEG_INFINITY, support: Vec::new(), y: DVec3::ZERO, cost: DVec3::ZERO }
        } else {
            let pair = clause::Pair { pool, a: cell.a, b };
            clause::advance(&view, &pair, hints, self.task.rounding, 0.0, clause_scratch)
        };
        // Where the bounds are lowest at the start itself: two faces a few resolutions inside each other leave a layer that
        // the lowest point of a later time misses.
        let now = if start && found.dt < 0.0 && h > 0.0 && !found.support.is_empty() {
            let still = View { motion: self.task.relative.bounds(0.0, 0.0, x_max), ..view };
            let pair = clause::Pair { pool, a: cell.a, b };
            clause::advance(&still, &pair, hints, self.task.rounding, 0.0, clause_scratch).y
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
        } else if found.dt > LEAST_ADVANCE && !beyond {
            // What splitting could gain is what the cell's extents cost the bound.
            let gain = found.cost.element_sum().min(radius);
            let proven = cell.t + found.dt >= self.goal();
            if found.dt * motion.speed >= 0.25 * gain || found.dt >= 0.25 * end || proven {
                self.again(cell, found.dt, end, false);
                return None;
            }
        }
        if start {
            for x in [cell.center, cell.center + found.y, cell.center + now] {
                if self.is_deep_at_start(x, &at) {
                    return Some(x);
                }
            }
        }
        if !one_sided && !self.task.still {
            self.attempt(&cell, &found, &at);
            if cell.t >= self.goal() {
                return None;
            }
        }
        self.split(cell, found.cost);
        None
    }

    /// True unless B is proven out of a cell's reach for the whole of its slice.
    pub(super) fn may_meet(&self, cell: &Cell) -> bool {
        let at = self.task.relative.at(cell.t);
        let x_max = (cell.center - at.center_a).length() + cell.half.length();
        let motion = self.task.relative.bounds(cell.t, cell.until - cell.t, x_max);
        let view = self.task.view(cell, &at, motion, &self.scratch.guards_b);
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
        let cost = cost + cell.half * 1e-6;
        let k = if cost.x >= cost.y && cost.x >= cost.z {
            0
        } else if cost.y >= cost.z {
            1
        } else {
            2
        };
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

    /// True when x (A's frame) is at least delta deep in both whole solids at the instant, by `more` as computed.
    fn is_deep(&self, x: DVec3, at: &Instant, more: f64) -> bool {
        let level = -self.task.delta - more;
        self.task.a.value(x) <= level && self.task.b.value(at.b_point(x)) <= level
    }

    /// True when x is deep at the start, or so nearly that rounding forbids to prove the contrary: what the first search
    /// takes for deep is searched again at twice the depth.
    fn is_deep_at_start(&self, x: DVec3, at: &Instant) -> bool {
        let level = self.task.delta - (8.0 * self.task.nearly).min(0.5 * self.task.delta);
        self.task.a.value(x) <= -level && self.task.b.value(at.b_point(x)) <= -level
    }

    fn problem(&self) -> Problem<'_> {
        let speed = self.task.relative.bounds(0.0, 1.0, self.task.scale).speed;
        Problem {
            a: Faces { solid: self.task.a, guards: &[] },
            b: Faces { solid: self.task.b, guards: &[] },
            relative: &self.task.relative,
            scale: self.task.scale,
            // However slow the pair: else equations that only time can meet look as if they had no solution.
            time_scale: (self.task.scale / speed.max(f64::MIN_POSITIVE)).min(SLOWEST),
            tolerance: 0.5 * self.task.rounding,
        }
    }

    /// Tries to find the contact that a cell's weakest clause points to.
    fn attempt(&mut self, cell: &Cell, advance: &Advance, at: &Instant) {
        let level = advance.cost.element_sum().log2().floor() as i32;
        let x = cell.center + advance.y;
        let mut support = advance.support.clone();
        // A thin cell is held by one body alone: what decides of the other there stands beside it.
        let bodies = [
            (Side::A, Faces { solid: self.task.a, guards: &[] }, cell.a, x),
            (Side::B, Faces { solid: self.task.b, guards: &self.scratch.guards_b }, cell.b, at.b_point(x)),
        ];
        for (side, faces, range, y) in bodies {
            if support.iter().all(|l| l.0 != side) {
                if cell.half.min_element() > THIN * self.task.scale {
                    return;
                }
                let tokens = &self.scratch.pool[range.0 as usize..range.1 as usize];
                if tokens.is_empty() {
                    return;
                }
                let (_, id) = local::deciding(tokens, &mut |f| faces.get(f).value(y));
                if faces.is_guard(id.face()) {
                    return;
                }
                support.push((side, id, 1.0));
            }
        }
        let mut key: Vec<_> = support.iter().map(|l| (l.0, l.1)).collect();
        key.sort_unstable();
        if self.scratch.tried.iter().any(|(k, l)| *l == level && *k == key) {
            return;
        }
        self.scratch.tried.push((key, level));
        let t = cell.t + advance.dt.max(0.0);
        let active: Vec<_> = support.iter().map(|l| Constraint::Literal(l.0, l.1)).collect();
        // A fit weighs both of its literals: together they are 1 again.
        let total: f64 = support.iter().map(|l| l.2).sum();
        let lambda: Vec<_> = support.iter().map(|l| l.2 / total).collect();
        if self.polish(active.clone(), x, t, lambda.clone()) {
            return;
        }
        // Two like faces in a fit: their bound leaves open in which direction they meet.
        if let [p, q] = advance.support[..] {
            let (p, q) = if p.1.sense() == Sense::Positive { (p, q) } else { (q, p) };
            let face = |l: &(Side, LiteralId, f64)| {
                let solid = if l.0 == Side::A { self.task.a } else { self.task.b };
                &solid.faces[l.1.face() as usize]
            };
            let later = self.task.relative.at(t);
            if q.1.sense() == Sense::Negative
                && p.0 != q.0
                && let Some(x) = fit::first_off_axis(&later, (p.0, face(&p)), face(&q), x)
                && self.polish(active.clone(), x, t, lambda.clone())
            {
                return;
            }
        }
        // A surface that touches there too with next to no weight (a rim that lies almost in a face) is not in the
        // support, but without it the system has its solution elsewhere.
        if active.len() < super::newton::MAX_ACTIVE {
            for close in self.closest_others(cell, &active, x, &self.task.relative.at(t)).into_iter().flatten() {
                let more = active.iter().copied().chain([close]).collect();
                if self.polish(more, x, t, lambda.iter().copied().chain([0.0]).collect()) {
                    return;
                }
            }
        }
        // A cone whose apex is near: the apex is a vertex of its own.
        let apex_of = |l: &(Side, LiteralId, f64)| {
            let solid = if l.0 == Side::A { self.task.a } else { self.task.b };
            let Face::Cone { apex, .. } = solid.faces[l.1.face() as usize] else { return None };
            let apex = if l.0 == Side::A { apex } else { at.a_point(apex) };
            let near = (apex - cell.center).length() <= 4.0 * cell.half.length();
            (l.1.sense() == Sense::Positive && near).then_some(apex)
        };
        let apexes: Vec<_> = support.iter().filter_map(|l| Some((*l, apex_of(l)?))).collect();
        let vertex = |l: &(Side, LiteralId, f64)| {
            let (side, id, weight) = *l;
            (0..3).map(move |k| (Constraint::Apex(side, id, k), if k == 0 { -weight } else { 0.0 }))
        };
        for (l, apex) in &apexes {
            let others = support.iter().filter(|o| o.0 != l.0);
            let others = others.map(|o| (Constraint::Literal(o.0, o.1), o.2));
            let (active, lambda) = vertex(l).chain(others).take(super::newton::MAX_ACTIVE).unzip();
            if self.polish(active, *apex, t, lambda) {
                return;
            }
        }
        if let [(l, apex), (m, _)] = apexes[..]
            && l.0 != m.0
        {
            let (active, lambda) = vertex(&l).chain(vertex(&m)).unzip();
            self.polish(active, apex, t, lambda);
        }
    }

    /// The two literals of a cell, other than `active`, whose surfaces are nearest to x: no farther than the cell is large.
    fn closest_others(&self, cell: &Cell, active: &[Constraint], x: DVec3, at: &Instant) -> [Option<Constraint>; 2] {
        let mut nearest = [(2.0 * cell.half.length(), None); 2];
        for (side, solid, range, y) in
            [(Side::A, self.task.a, cell.a, x), (Side::B, self.task.b, cell.b, at.b_point(x))]
        {
            for id in local::literals(&self.scratch.pool[range.0 as usize..range.1 as usize]) {
                let constraint = Constraint::Literal(side, id);
                let Some(face) = solid.faces.get(id.face() as usize) else { continue };
                if active.contains(&constraint) || nearest.iter().any(|n| n.1 == Some(constraint)) {
                    continue;
                }
                let distance = face.value(y).abs();
                if distance < nearest[0].0 {
                    nearest = [(distance, Some(constraint)), nearest[0]];
                } else if distance < nearest[1].0 {
                    nearest[1] = (distance, Some(constraint));
                }
            }
        }
        [nearest[0].1, nearest[1].1]
    }

    /// True when the multiplied normals of every apex in a solution lie in its normal cone: within the right angle less
    /// the half angle of the direction away from the cone.
    fn holds_at_apexes(&self, s: &Solution, at: &Instant) -> bool {
        let problem = self.problem();
        s.active.iter().all(|c| {
            let Constraint::Apex(side, id, 0) = *c else { return true };
            let solid = if side == Side::A { self.task.a } else { self.task.b };
            let Face::Cone { axis, sin, .. } = solid.faces[id.face() as usize] else { return false };
            let axis = if side == Side::A { axis } else { at.a_vector(axis) };
            let same = s
                .active
                .iter()
                .zip(&s.lambda)
                .filter(|(o, _)| matches!(**o, Constraint::Apex(os, oid, _) if (os, oid) == (side, id)));
            let sum: DVec3 = same.map(|(o, l)| problem.row(o, s.x, at, 0.0).gradient * *l).sum();
            -sum.dot(axis) >= sum.length() * (sin - 1e-6)
        })
    }

    /// Newton from a guess of a whole-primitive shortcut, which needs no stage 2: true when a contact was confirmed. With
    /// `mend` an active set that does not hold is mended as the search does it, which costs many times more.
    pub(super) fn confirm(&mut self, active: Actives, x: DVec3, t: f64, lambda: Weights, mend: bool) -> bool {
        if !has_both_sides(&active) {
            return false;
        }
        self.counters.newton += 1;
        self.stage2.all = true;
        let confirmed = match self.problem().refine(
            &active,
            x,
            t,
            lambda.clone(),
            witness_level(self.task.delta, self.task.rounding),
        ) {
            Ok(s) if !(0.0..=1.0).contains(&s.t) || s.t >= self.goal() => false,
            Ok(s) => {
                let at = self.task.relative.at(s.t);
                let holds = |(c, l): (&Constraint, &f64)| matches!(c, Constraint::Apex(..)) || *l >= -1e-9;
                if s.active.iter().zip(&s.lambda).all(holds) && self.is_deep(s.x, &at, self.task.rounding) {
                    self.holds_at_apexes(&s, &at) && self.accept(s)
                } else {
                    mend && self.polish(active.into_vec(), s.x, s.t, s.lambda.into_vec())
                }
            }
            // A line or patch of contacts leaves x open: where the guess' multipliers hold, the surfaces alone tell the rest.
            Err(true) => match self.problem().along(
                &active,
                x,
                t,
                lambda.clone(),
                witness_level(self.task.delta, self.task.rounding),
            ) {
                Some(s) if (0.0..=1.0).contains(&s.t) && s.t < self.goal() && s.stationarity < SETTLED => {
                    let at = self.task.relative.at(s.t);
                    if self.is_deep(s.x, &at, self.task.rounding) {
                        self.holds_at_apexes(&s, &at) && self.accept(s)
                    } else {
                        mend && self.polish(active.into_vec(), x, t, lambda.into_vec())
                    }
                }
                // What turns into a line of contact has other multipliers there.
                _ => (mend || self.task.relative.turns()) && self.polish(active.into_vec(), x, t, lambda.into_vec()),
            },
            Err(false) => false,
        };
        self.stage2.all = false;
        confirmed
    }

    /// The unit normal of a solution, from A, along A's axes.
    pub(super) fn normal(&self, s: &Solution) -> Option<DVec3> {
        let at = self.task.relative.at(s.t);
        let problem = self.problem();
        let mut sum = DVec3::ZERO;
        for (c, l) in s.active.iter().zip(&s.lambda) {
            let (Constraint::Literal(side, _) | Constraint::Apex(side, _, _)) = *c;
            let sign = if side == Side::A { *l } else { -*l };
            sum += problem.row(c, s.x, &at, 0.0).gradient * sign;
        }
        sum.try_normalize()
    }

    /// Newton from a guess, with the active set mended by what the trees say; true when a contact with settled
    /// multipliers was confirmed.
    fn polish(&mut self, mut active: Vec<Constraint>, x: DVec3, t: f64, mut lambda: Vec<f64>) -> bool {
        let level = witness_level(self.task.delta, self.task.rounding);
        for _ in 0..7 {
            debug_assert!(
                active.iter().all(|c| self.stage2.knows(&self.task, c)),
                "stage 3 asks for a primitive that stage 2 has not handed over: {active:?}"
            );
            self.counters.newton += 1;
            // A whole-primitive guess that leads nowhere is given up early: the next one is from nearer.
            let patient = !self.stage2.all;
            let Some(s) = self.problem().solve(&active, x, t, &lambda, level, patient) else { return false };
            // Where only an unsettled witness is known, a settled one of the same time is still worth having.
            let settled = self.found.as_ref().is_none_or(|f| f.deep.stationarity < SETTLED);
            let latest = match &self.found {
                Some(f) if settled => f.latest_rival(),
                _ => self.goal() + SAME_TIME,
            };
            if s.t < 0.0 || s.t > 1.0 || s.t >= latest || self.is_found(&s) {
                return false;
            }
            // A negative multiplier: that literal holds nothing back.
            let worst = (0..active.len())
                .filter(|i| matches!(active[*i], Constraint::Literal(..)))
                .min_by(|i, j| s.lambda[*i].total_cmp(&s.lambda[*j]));
            if let Some(i) = worst.filter(|i| s.lambda[*i] < -1e-9 && s.stationarity < SETTLED) {
                if active.len() <= 2 {
                    return false;
                }
                active.remove(i);
                lambda.remove(i);
                if !has_both_sides(&active) {
                    return false;
                }
                continue;
            }
            let at = self.task.relative.at(s.t);
            // Whatever rounding did: a witness of depth delta.
            if self.is_deep(s.x, &at, self.task.rounding) {
                return self.holds_at_apexes(&s, &at) && self.accept(s);
            }
            // Something else decides there: it enters, the smallest multiplier leaves. A primitive that the walk has not
            // handed over is not asked.
            let entering = self.deciding(s.x, &at);
            if active.contains(&entering) || !self.stage2.knows(&self.task, &entering) {
                return false;
            }
            if active.len() >= 4 {
                let weakest = (0..active.len())
                    .filter(|i| matches!(active[*i], Constraint::Literal(..)))
                    .min_by(|i, j| s.lambda[*i].total_cmp(&s.lambda[*j]));
                let Some(i) = weakest else { return false };
                active.remove(i);
                lambda.remove(i);
            }
            active.push(entering);
            lambda.push(0.25);
            if !has_both_sides(&active) {
                return false;
            }
        }
        false
    }

    /// The literal that keeps x from being deep in both bodies.
    fn deciding(&self, x: DVec3, at: &Instant) -> Constraint {
        let mut worst: Option<(f64, Constraint)> = None;
        for (side, solid, y) in [(Side::A, self.task.a, x), (Side::B, self.task.b, at.b_point(x))] {
            let (v, id) = local::deciding(&solid.normal_form, &mut |f| solid.faces[f as usize].value(y));
            if worst.as_ref().is_none_or(|w| v > w.0) {
                worst = Some((v, Constraint::Literal(side, id)));
            }
        }
        worst.expect("two bodies").1
    }

    /// Remembers where the curved convex faces of a solution are touched.
    fn hint(&mut self, s: &Solution) {
        let at = self.task.relative.at(s.t);
        for c in &s.active {
            let Constraint::Literal(side, id) = *c else { continue };
            let (solid, point) = if side == Side::A { (self.task.a, s.x) } else { (self.task.b, at.b_point(s.x)) };
            if id.sense() == Sense::Negative || matches!(solid.faces[id.face() as usize], Face::Plane { .. }) {
                continue;
            }
            if self.scratch.hints.len() == MAX_HINTS {
                self.scratch.hints.remove(0);
            }
            self.scratch.hints.push(Hint { side, id, point });
        }
    }

    /// True for the contact that is known already.
    fn is_found(&self, s: &Solution) -> bool {
        self.found.as_ref().is_some_and(|f| {
            f.deep.stationarity < SETTLED
                && (f.deep.t - s.t).abs() <= SAME_TIME
                && (f.deep.x - s.x).length() <= SAME_POINT * self.task.scale
        })
    }

    /// Keeps a confirmed witness if it is the earliest; continues it back to the touch.
    fn accept(&mut self, deep: Solution) -> bool {
        self.hint(&deep);
        let settled = deep.stationarity < SETTLED;
        if !settled {
            // A witness, but an earlier one lies beside it: everything before it is still searched.
            let goal = deep.t;
            if goal < self.goal() {
                self.found = Some(Found { upper: goal, deep, touch: None, goal });
            }
            return false;
        }
        let problem = self.problem();
        // A whole primitive's contact is regular as a rule: a plain step or two.
        let plain = self.stage2.all.then(|| problem.refine(&deep.active, deep.x, deep.t, deep.lambda.clone(), 0.0));
        let touch = match plain {
            Some(Ok(s)) if (s.x - deep.x).length() <= SAME_POINT * self.task.scale => Some(s),
            Some(Err(true)) => problem.along(&deep.active, deep.x, deep.t, deep.lambda.clone(), 0.0),
            _ => None,
        };
        let touch = touch
            .filter(|s| s.stationarity < SETTLED)
            .or_else(|| problem.solve(&deep.active, deep.x, deep.t, &deep.lambda, 0.0, true));
        let touch = touch.and_then(|s| if self.is_touch(&s, deep.t) { Some(s) } else { self.touch_beside(s, deep.t) });
        let at = self.task.relative.at(deep.t);
        let rates = deep.active.iter().zip(&deep.lambda).map(|(c, l)| l * problem.row(c, deep.x, &at, 0.0).rate);
        let speed = rates.sum::<f64>().abs().max(f64::MIN_POSITIVE);
        // The depth delta itself is reached a little before the witness, which a slow pair takes its time for.
        let crossing = deep.t - (witness_level(self.task.delta, self.task.rounding) - self.task.delta) / speed;
        let goal = match &touch {
            Some(s) if s.t > 0.0 => 0.5 * (s.t + deep.t),
            // Touching at the start: nothing but the start needs a proof.
            Some(_) => 0.5 * crossing,
            // Rounding forbids to prove what is nearer to the crossing.
            None => {
                crossing - (0.25 * self.task.delta / speed).clamp(1e-15, 1e-9).max(4.0 * self.task.rounding / speed)
            }
        };
        let goal = if goal > 0.0 { goal } else { 0.5 * crossing.max(f64::MIN_POSITIVE) };
        let new = Found { upper: deep.t, deep, touch, goal };
        self.found = Some(match self.found.take() {
            // One that has not settled is only a bound on the time.
            Some(old) if old.deep.stationarity >= SETTLED => {
                Found { upper: new.upper.min(old.upper), goal: new.goal.min(old.goal), ..new }
            }
            Some(old) => old.or(new),
            None => new,
        });
        true
    }

    /// True when the surfaces meet in a solution, as both whole trees say, no later than the witness.
    fn is_touch(&self, s: &Solution, latest: f64) -> bool {
        let at = self.task.relative.at(s.t);
        let tol = 16.0 * self.task.rounding;
        s.t <= latest && self.task.a.value(s.x).abs() <= tol && self.task.b.value(at.b_point(s.x)).abs() <= tol
    }

    /// A touch along a line or over a patch, at a point that the faces beside it have left meanwhile: moved to their edge.
    fn touch_beside(&self, s: Solution, latest: f64) -> Option<Solution> {
        let beside = self.deciding(s.x, &self.task.relative.at(s.t));
        let full = s.active.len() == super::newton::MAX_ACTIVE;
        if full || s.active.contains(&beside) || !self.stage2.knows(&self.task, &beside) {
            return None;
        }
        let active: Vec<_> = s.active.iter().copied().chain([beside]).collect();
        let lambda: Vec<_> = s.lambda.iter().copied().chain([0.0]).collect();
        self.problem().solve(&active, s.x, s.t, &lambda, 0.0, true).filter(|s| self.is_touch(s, latest))
    }
}

/// The depth at which witnesses are sought: delta and what rounding may take from it.
pub(super) fn witness_level(delta: f64, rounding: f64) -> f64 {
    // Deep enough to be so after all rounding, with what Newton may leave.
    delta + 1e-6 * delta.abs() + 1.5 * rounding
}

/// What a + b lost when it was rounded to `sum`, exactly (Knuth's two-sum).
fn rounded_off(a: f64, b: f64, sum: f64) -> f64 {
    let from_b = sum - a;
    (a - (sum - from_b)) + (b - from_b)
}

fn has_both_sides(active: &[Constraint]) -> bool {
    let side = |c: &Constraint| match c {
        Constraint::Literal(s, _) | Constraint::Apex(s, _, _) => *s,
    };
    active.iter().any(|c| side(c) == Side::A) && active.iter().any(|c| side(c) == Side::B)
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
