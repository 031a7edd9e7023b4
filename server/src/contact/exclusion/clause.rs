//! How long a cell stays free of contact: clauses, multipliers, and time advanced without cutting it.
//!
//! For multipliers λ >= 0 over the linear bounds of a clause, with w = Σ λ n, w_B its part from B,
//!
//! ```text
//! LB = Σ λ b − Σ_k e_k |w|_k > 0            excludes the whole cell now, and
//! LB − s·dt − ½·q·dt² >= 0                  keeps it excluded until t + dt,
//! s = −w_B·v(c) + Σ_k e_k |w_B × omega|_k + Σ λ s_i,   q = curvature(w_B) + Σ λ q_i.
//! ```
//!
//! λ is chosen for the longest dt, not for the largest LB: the linear program is solved with the literals' bounds looked
//! ahead to h, then to the best dt found so far, where the bound gives out. Curved convex literals are re-touched at the
//! program's minimiser there (the cutting planes of Kelley 1960), which replaces one tangent plane by the face's shape.
//!
//! A cell's expression is an and/or-tree; its bound is the smallest over its clauses, enumerated depth first. Four things keep
//! that from growing as the product of the tree's alternatives:
//! * The literals that all clauses of a subtree share bound all of them, so a subtree is left as soon as they suffice: for the
//!   whole span, or for as long as a sibling that is known to be weaker (the smallest counts).
//! * Only lists of alternatives are opened that help: where the bound gives out, at the program's lowest point y, each
//!   alternative must lie above it. Where one does not, y stays as low in the clause with that alternative.
//! * A proof that uses no literal of the alternative it was found under holds for all its siblings (backjumping, as in Prosser
//!   1993, "Hybrid algorithms for the constraint satisfaction problem").
//! * A clause's programs start where those of the clause before it ended.
//!
//! Running out of the enumeration's allowance only weakens the bound.

use super::fit::{self, fit, spun};
use super::literal::{Linear, Side, View};
use super::lp::{self, Solution};
use crate::solid::Sense;
use crate::solid::alike::{Ball, above};
use crate::solid::local::{self, Expression, LiteralId, Token};
use glam::DVec3;
use smallvec::SmallVec;

/// Clauses bounded per cell before the remaining ones share their common literals' bound.
const MAX_CLAUSES: u32 = 96;
/// Rounds of looking ahead and re-touching curved faces: of a clause that is complete, and of one that lists may still complete,
/// whose bound is better served by their alternatives.
const ROUNDS: usize = 5;
const ROUNDS_BEFORE_LISTS: usize = 1;
/// Weight of a concave literal's own cost in the choice of the axis to split, whether it holds the bound or not.
const IDLE_COST: f64 = 0.25;
/// The same of a convex one that curves.
const IDLE_CONVEX: f64 = 1e-3;
/// The same where a fit stands for the literal, which costs more of what matters.
const FITTED_COST: f64 = 0.02;
/// Comparisons of two literals that cost as much as one evaluation of a literal.
const COMPARED: u64 = 16;
/// Looks at a literal's bound at one point that cost as much.
const CHECKED: u64 = 8;
/// Planes that a pivot of the linear program costs beside those that it looks at; and looks of it at a plane that cost as
/// much as one evaluation of a literal.
const PIVOT: u64 = 12;
const SIMPLEX: u64 = 4;
/// Part of what may be used up where multipliers change that a certificate's do: a checker, whose bounds are others, would look
/// for ever at a bound that all but vanishes.
const RECORDED: f64 = 0.9;
/// How far beyond the end of its reach a clause is looked at, in cell radii of relative motion.
const LOOK_BEYOND: f64 = 0.02;

/// What the weakest clause of a cell proved.
#[derive(Clone, Debug)]
pub struct Advance {
    /// The cell is free of contact for this long from the view's instant (inclusive); negative: nothing proven.
    pub dt: f64,
    /// Literals with positive multipliers in the weakest clause, clip planes left out.
    pub support: Vec<(Side, LiteralId, f64)>,
    /// Where the linear bounds of that clause are lowest: offset from the cell's centre.
    pub y: DVec3,
    /// What each axis of the cell costs that bound: the one to split is the largest.
    pub cost: DVec3,
    /// The bound at the view's instant, where a face spins about its own axis: then the speed of the bodies says nothing of how
    /// fast it is lost. Infinite elsewhere.
    pub now: f64,
}

/// A point at which a curved convex face is worth touching: where a contact was found.
#[derive(Clone, Copy, Debug)]
pub struct Hint {
    /// The literal.
    pub side: Side,
    /// The literal.
    pub id: LiteralId,
    /// Point in the frame of its body.
    pub point: DVec3,
}

/// Working memory of the clause bounds; cleared by each use.
#[derive(Default, Debug)]
pub struct Scratch {
    lits: Vec<Linear>,
    normals: Vec<DVec3>,
    b: Vec<f64>,
    /// Of each of `lits`, the lists of alternatives that it rests on.
    uses: Vec<Lists>,
    /// Where the clause's last program ended.
    warm: lp::Warm,
    ors: Vec<List>,
    /// Two literals of one body that contradict each other.
    clash: Option<Clash>,
    /// Bounds of the literals by their places in the expressions, made once a cell.
    made: Vec<Linear>,
    /// Literals looked at where a clause gives out that are not in `evaluations` yet.
    checked: u64,
    /// For each place in A's expression, then in B's, its index in `made`.
    places: Vec<u32>,
    /// Clauses bounded so far, over the whole query.
    pub clauses: u64,
    /// Work of these so far, in literals evaluated; see `Counters::evaluations`.
    pub evaluations: u64,
    /// When present, every combination of literals that excluded something is written here.
    pub record: Option<Vec<Proof>>,
}

impl Scratch {
    /// Memory that keeps a record.
    pub fn recording() -> Self {
        Self { record: Some(Vec::new()), ..Self::default() }
    }
}

/// Lists of alternatives by their depth in the enumeration, a bit each; those from `DEEPEST` on share one.
type Lists = u64;
/// The last bit of `Lists`.
const DEEPEST: u32 = 63;
/// An open list of alternatives: from, and to where in the expression of its body, and the lists of whose alternatives it is part.
#[derive(Clone, Copy, Debug)]
struct List {
    side: Side,
    start: u32,
    end: u32,
    within: Lists,
}

/// No bound made yet.
const UNMADE: u32 = u32::MAX;

/// Two literals of one body that contradict each other.
#[derive(Clone, Copy, Debug)]
struct Clash {
    /// How many bounds there were before.
    before: usize,
    side: Side,
    /// The positive and the negative one.
    literals: [LiteralId; 2],
    uses: Lists,
}

/// A bound, the lists of alternatives that it rests on, and where it gives out.
struct Bounded {
    advance: Advance,
    uses: Lists,
    gives_out: Option<LowPoint>,
}

impl Bounded {
    fn nothing() -> Self {
        let advance =
            Advance { dt: f64::NEG_INFINITY, support: Vec::new(), y: DVec3::ZERO, cost: DVec3::ZERO, now: 0.0 };
        Self { advance, uses: Lists::MAX, gives_out: None }
    }
}

/// The lowest point of a clause's linear bounds, some time ahead.
#[derive(Clone, Copy, Debug)]
struct LowPoint {
    /// How far ahead.
    look: f64,
    y: DVec3,
    /// The bounds' value there.
    z: f64,
}

/// A combination of literals that cannot hold together anywhere in the cell for a while.
#[derive(Clone, Debug)]
pub struct Proof {
    /// For how long.
    pub dt: f64,
    /// The literals with their multipliers.
    pub terms: Vec<Term>,
}

impl Proof {
    /// The same proof for a part of its time from the start.
    pub fn until(&self, dt: f64) -> Vec<Term> {
        let part = if self.dt > 0.0 { (dt / self.dt).min(1.0) } else { 0.0 };
        let cut = |t: &Term| Term { lambda: [t.lambda[0], t.lambda[0] + (t.lambda[1] - t.lambda[0]) * part], ..*t };
        self.terms.iter().map(cut).collect()
    }
}

/// One literal of a `Proof`, or the fit of two.
#[derive(Clone, Copy, Debug)]
pub struct Term {
    /// The literal; the positive one of a fit.
    pub literal: (Side, LiteralId),
    /// The negative literal of a fit; of quadrics, one with even weights.
    pub other: Option<(Side, LiteralId)>,
    /// Its multiplier at the start and at the end of the time; linear between.
    pub lambda: [f64; 2],
    /// Where a convex face is touched, in the frame of its body; of a fit its convex part, in A's frame.
    pub point: DVec3,
}

/// The expressions of both bodies over a cell, as ranges of one token pool.
#[derive(Clone, Copy, Debug)]
pub struct Expressions<'p> {
    /// The pool.
    pub pool: &'p [Token],
    /// A's expression: start and end; empty when it is true everywhere.
    pub a: (u32, u32),
    /// B's.
    pub b: (u32, u32),
}

/// Bounds the cell over all clauses of `pair`; stops early once `dt` falls below `useless`.
pub fn advance(
    view: &View,
    pair: &Expressions,
    hints: &[Hint],
    rounding: f64,
    useless: f64,
    scratch: &mut Scratch,
) -> Advance {
    scratch.lits.clear();
    scratch.uses.clear();
    scratch.ors.clear();
    scratch.made.clear();
    scratch.places.clear();
    scratch.places.resize((pair.a.1 - pair.a.0 + pair.b.1 - pair.b.0) as usize, UNMADE);
    scratch.clash = None;
    scratch.warm = lp::Warm::default();
    let mut run = Run { view, pair, hints, rounding, useless, left: MAX_CLAUSES, scratch };
    for (side, range) in [(Side::A, pair.a), (Side::B, pair.b)] {
        if range.0 < range.1 {
            run.take(side, range, 0);
        }
    }
    let mut found = run.bound(0, 0, view.motion.h).advance;
    run.scratch.evaluations += std::mem::take(&mut run.scratch.checked).div_ceil(CHECKED);
    if run.left == 0 {
        // Clauses are missing: what the last one cost says nothing about the cell, its longest axis is halved.
        found.cost = view.half;
    }
    found
}

/// The axis across which halving a cell helps its bound most; the longest one where none costs anything.
pub fn axis_to_halve(cost: DVec3, half: DVec3) -> usize {
    // Of equal costs the longer. How long an axis is counts for no more than that: one along a line of contact costs
    // nothing, however thin the cell must become across it.
    let most = cost.max_element();
    let tie = if most > 0.0 { 1e-6 * most / half.max_element() } else { 1.0 };
    (cost + half * tie).max_position()
}

struct Run<'a, 'p> {
    view: &'a View<'a>,
    pair: &'a Expressions<'p>,
    hints: &'a [Hint],
    rounding: f64,
    useless: f64,
    left: u32,
    scratch: &'a mut Scratch,
}

impl Run<'_, '_> {
    /// Adds an expression that must hold: its literals at once, its alternatives to the open list. `list` are the
    /// lists of whose alternatives it is part.
    fn take(&mut self, side: Side, (start, end): (u32, u32), list: Lists) {
        let mut at = start as usize;
        while at < end as usize {
            let (e, n) = local::first(&self.pair.pool[at..]);
            match e {
                Expression::Literal(id) => self.add(side, id, at as u32, list),
                Expression::And(_) => self.take(side, (at as u32 + 1, (at + n) as u32), list),
                Expression::Or(_) => {
                    self.scratch.ors.push(List { side, start: at as u32 + 1, end: (at + n) as u32, within: list })
                }
            }
            at += n;
        }
    }

    /// Takes back what was added beyond so many bounds and lists.
    fn take_back(&mut self, lits: usize, ors: usize) {
        self.scratch.lits.truncate(lits);
        self.scratch.uses.truncate(lits);
        self.scratch.ors.truncate(ors);
        self.scratch.clash = self.scratch.clash.filter(|clash| clash.before < lits);
    }

    fn push(&mut self, bounds: impl IntoIterator<Item = Linear>, uses: Lists) {
        self.scratch.lits.extend(bounds);
        self.scratch.uses.resize(self.scratch.lits.len(), uses);
    }

    /// The bound of the literal at a place of its body's expression, touched at the cell's centre; an index of `made`.
    fn made(&mut self, side: Side, id: LiteralId, at: u32) -> usize {
        let (a, b) = (self.pair.a, self.pair.b);
        let place = if side == Side::A { at - a.0 } else { at - b.0 + (a.1 - a.0) } as usize;
        if self.scratch.places[place] == UNMADE {
            self.scratch.places[place] = self.scratch.made.len() as u32;
            self.scratch.made.push(self.view.linear(side, id, DVec3::ZERO));
        }
        self.scratch.places[place] as usize
    }

    /// Adds a literal's bound, with the tangents and fits it brings along.
    fn add(&mut self, side: Side, id: LiteralId, at: u32, list: Lists) {
        for h in self.hints {
            if (h.side, h.id) == (side, id) {
                self.push(Some(self.view.tangent(side, id, h.point)), list);
            }
        }
        let before = self.scratch.lits.len();
        let made = self.made(side, id, at);
        self.scratch.lits.push(self.scratch.made[made]);
        self.scratch.uses.push(list);
        if self.view.faces(side).solid.alike.has_walls(self.view.wall) {
            self.against_own(side, id, before, list);
        }
        for i in 0..if self.view.fits { before } else { 0 } {
            let l = &self.scratch.lits[i];
            if l.side == side || l.id.sense() == id.sense() || l.other.is_some() {
                continue;
            }
            let (p, q) =
                if id.sense() == Sense::Positive { ((side, id), (l.side, l.id)) } else { ((l.side, l.id), (side, id)) };
            self.push(fit(self.view, p, q), list | self.scratch.uses[i]);
        }
        if side == Side::B && self.view.fits && self.view.curved && !self.view.b.is_guard(id.face()) {
            self.push(spun(self.view, id), list);
        }
        self.against_walls(side, id, before, list);
    }

    /// Touches faces that spin about their own axes where they look against flat walls of the other body.
    fn against_walls(&mut self, side: Side, id: LiteralId, before: usize, list: Lists) {
        let is_wall = |v: &View, l: &Linear| {
            l.side == Side::A && l.id.sense() == Sense::Negative && v.a.get(l.id.face()).is_flat()
        };
        let is_spun = |l: &Linear| l.weights.is_some() && l.other.is_none();
        let end = self.scratch.lits.len();
        if side == Side::A {
            let wall = self.scratch.lits[before];
            let spun = self.scratch.lits[..before].iter().position(is_spun);
            if let Some(i) = spun.filter(|_| wall.id == id && is_wall(self.view, &wall)) {
                let touched = fit::touch_spun_against(self.view, &self.scratch.lits[i], wall.normal);
                self.push(touched, list | self.scratch.uses[i]);
            }
        } else if let Some(spun) = self.scratch.lits[before..end].iter().find(|l| is_spun(l)).copied() {
            for i in 0..before {
                let wall = self.scratch.lits[i];
                if is_wall(self.view, &wall) {
                    let touched = fit::touch_spun_against(self.view, &spun, wall.normal);
                    self.push(touched, list | self.scratch.uses[i]);
                }
            }
        }
    }

    /// Compares a literal with those of its own body: the two sides of a wall thinner than twice the depth never hold together,
    /// whatever moves, and those of a thin one fit each other.
    fn against_own(&mut self, side: Side, id: LiteralId, before: usize, list: Lists) {
        let faces = self.view.faces(side);
        for i in 0..before {
            let l = &self.scratch.lits[i];
            if l.side != side || l.id.sense() == id.sense() || l.other.is_some() {
                continue;
            }
            let (p, q) = if id.sense() == Sense::Positive { (id, l.id) } else { (l.id, id) };
            let solid = faces.solid;
            let Some(wall) = solid.alike.wall(&solid.faces, p.face(), q.face(), self.view.wall) else { continue };
            // Near a tip, where fits know nothing, cones part by less than elsewhere.
            let here = || {
                let (one, other) = (faces.get(p.face()), faces.get(q.face()));
                let v = self.view;
                let (center, way) = match side {
                    Side::A => (v.center, 0.0),
                    Side::B => (v.center_b, v.motion.speed * v.motion.h + v.rounding),
                };
                let ball = Ball { center, radius: v.radius + way };
                one.apex().is_some()
                    && above(one, other, &ball).is_some_and(|least| least > -2.0 * v.wall + 2.0 * v.rounding)
            };
            if wall > -2.0 * self.view.wall || here() {
                let uses = list | self.scratch.uses[i];
                self.scratch.clash.get_or_insert(Clash { before, side, literals: [p, q], uses });
                return;
            }
            if self.view.fits {
                self.push(fit::within(self.view, side, p, q), list | self.scratch.uses[i]);
            }
        }
    }

    /// The weakest clause that completes the literals taken so far with one alternative of each open list from `from` on, as
    /// far as that is less than `enough`. `depth` counts the alternatives taken.
    fn bound(&mut self, from: usize, depth: u32, enough: f64) -> Bounded {
        if let Some(clash) = self.scratch.clash {
            return self.clashed(&clash);
        }
        let mut own = Bounded::nothing();
        if !self.scratch.lits.is_empty() {
            self.left = self.left.saturating_sub(1);
            self.scratch.clauses += 1;
            let rounds = if from < self.scratch.ors.len() { ROUNDS_BEFORE_LISTS } else { ROUNDS };
            own = self.clause(rounds, enough);
        }
        if own.advance.dt >= enough || from == self.scratch.ors.len() || self.left == 0 {
            return own;
        }
        let Some((pick, alternatives)) = self.choose(from, &mut own) else { return own };
        self.scratch.ors.swap(from, pick);
        let found = self.alternatives(&alternatives, from, depth, &own, enough);
        self.scratch.ors.swap(from, pick);
        found
    }

    /// What two literals prove that contradict each other.
    fn clashed(&mut self, clash: &Clash) -> Bounded {
        let dt = self.view.motion.h;
        if let Some(record) = &mut self.scratch.record {
            let [p, q] = clash.literals;
            let (literal, other, lambda) = ((clash.side, p), Some((clash.side, q)), [1.0; 2]);
            record.push(Proof { dt, terms: vec![Term { literal, other, lambda, point: DVec3::ZERO }] });
        }
        let nothing = Bounded::nothing();
        Bounded { advance: Advance { dt, ..nothing.advance }, uses: clash.uses, gives_out: None }
    }

    /// The weakest of the alternatives of the open list `from`, given as their places in the expressions.
    fn alternatives(
        &mut self,
        alternatives: &[(u32, u32)],
        from: usize,
        depth: u32,
        own: &Bounded,
        enough: f64,
    ) -> Bounded {
        let List { side, within, .. } = self.scratch.ors[from];
        let list = 1 << depth.min(DEEPEST);
        let (lits, ors) = (self.scratch.lits.len(), self.scratch.ors.len());
        let warm = self.scratch.warm;
        let mut weakest: Option<Bounded> = None;
        let mut uses = 0;
        for range in alternatives {
            let enough = weakest.as_ref().map_or(enough, |w| enough.min(w.advance.dt));
            self.scratch.warm = warm;
            self.take(side, *range, list | within);
            let found = self.bound(from + 1, depth + 1, enough);
            self.take_back(lits, ors);
            if found.uses & list == 0 && found.advance.dt > own.advance.dt {
                // What it rests on holds with every alternative.
                return found;
            }
            uses |= found.uses;
            let dt = found.advance.dt;
            if weakest.as_ref().is_none_or(|w| dt < w.advance.dt) {
                weakest = Some(found);
                // No better than without the list: what the others are worth changes nothing.
                if dt.max(own.advance.dt) < self.useless || dt <= own.advance.dt {
                    break;
                }
            }
        }
        let Some(mut found) = weakest else { return Bounded::nothing() };
        found.uses = uses & !list;
        if found.advance.dt <= own.advance.dt {
            found.advance.dt = own.advance.dt;
            found.uses = own.uses;
        }
        found
    }

    /// The open list to go on with, and its alternatives, the lowest first: of those whose every alternative lies above the
    /// point at which the clause so far gives out, the one with the fewest. Where there is none, what the lists' curved faces
    /// cost is added to the clause's own costs.
    fn choose(&mut self, from: usize, own: &mut Bounded) -> Option<(usize, Alternatives)> {
        let mut best: Option<(usize, Alternatives, f64)> = None;
        let mut idle = DVec3::ZERO;
        for i in from..self.scratch.ors.len() {
            let List { side, start, end, .. } = self.scratch.ors[i];
            let mut alternatives = Alternatives::new();
            let mut heights = SmallVec::<[f64; 16]>::new();
            let mut at = start;
            while at < end {
                let range = (at, at + local::first(&self.pair.pool[at as usize..]).1 as u32);
                let height = match &own.gives_out {
                    Some(low) => match self.height_above(side, range, low) {
                        Ok(height) => height,
                        Err(cost) => {
                            idle += cost;
                            break;
                        }
                    },
                    None => 0.0,
                };
                let place = heights.iter().position(|h| height < *h).unwrap_or(heights.len());
                heights.insert(place, height);
                alternatives.insert(place, range);
                at = range.1;
            }
            if at < end {
                continue;
            }
            let better = best
                .as_ref()
                .is_none_or(|(_, others, height)| (alternatives.len(), -heights[0]) < (others.len(), -*height));
            if better {
                best = Some((i, alternatives, heights[0]));
            }
        }
        if best.is_none() {
            own.advance.cost += idle;
        }
        best.map(|(i, alternatives, _)| (i, alternatives))
    }

    /// How high an expression's bounds are at a low point, where they are above it; else what the cell's extents cost them.
    fn height_above(&mut self, side: Side, range: (u32, u32), low: &LowPoint) -> Result<f64, DVec3> {
        let cost = match self.alone_above(side, range, low) {
            Ok(height) => return Ok(height),
            Err(cost) => cost,
        };
        if !self.view.fits && !self.view.faces(side).solid.alike.has_walls(self.view.wall) {
            return Err(cost);
        }
        // With the fits that it brings along.
        let (lits, ors) = (self.scratch.lits.len(), self.scratch.ors.len());
        self.take(side, range, 0);
        let mut height = if self.scratch.clash.is_some() { f64::INFINITY } else { f64::NEG_INFINITY };
        for i in lits..self.scratch.lits.len() {
            let l = &self.scratch.lits[i];
            if l.other.is_some() || l.weights.is_some() {
                height = height.max(self.value_at(l, low));
            }
        }
        self.scratch.evaluations += (self.scratch.lits.len() - lits) as u64;
        self.take_back(lits, ors);
        if height > low.z { Ok(height) } else { Err(cost) }
    }

    /// The same by its literals alone.
    fn alone_above(&mut self, side: Side, (start, end): (u32, u32), low: &LowPoint) -> Result<f64, DVec3> {
        let mut idle = DVec3::ZERO;
        let mut at = start;
        while at < end {
            let (e, n) = local::first(&self.pair.pool[at as usize..]);
            let next = at + n as u32;
            let held = match e {
                Expression::Literal(id) => {
                    let i = self.made(side, id, at);
                    let l = &self.scratch.made[i];
                    let height = self.value_at(l, low);
                    self.scratch.checked += 1;
                    if height > low.z { Ok(height) } else { Err(l.cost * idle_cost(l)) }
                }
                Expression::And(_) => self.alone_above(side, (at + 1, next), low),
                Expression::Or(_) => self.all_above(side, (at + 1, next), low),
            };
            match held {
                Ok(height) => return Ok(height),
                Err(cost) => idle += cost,
            }
            at = next;
        }
        Err(idle)
    }

    /// The same of a list of alternatives: each is above.
    fn all_above(&mut self, side: Side, (start, end): (u32, u32), low: &LowPoint) -> Result<f64, DVec3> {
        let (mut lowest, mut at) = (f64::INFINITY, start);
        while at < end {
            let next = at + local::first(&self.pair.pool[at as usize..]).1 as u32;
            lowest = lowest.min(self.alone_above(side, (at, next), low)?);
            at = next;
        }
        Ok(lowest)
    }

    /// A bound at a low point, touched there if that is higher.
    fn value_at(&self, l: &Linear, low: &LowPoint) -> f64 {
        let value = |l: &Linear| l.ahead(low.look) + l.normal_ahead(low.look).dot(low.y);
        let own = value(l);
        if own > low.z {
            return own;
        }
        self.touched(l, low).map_or(own, |t| own.max(value(&t)))
    }

    /// Bounds the clause of all literals taken so far, in at most so many rounds, until that is `enough`. Tangents that were added stay for its
    /// completions.
    fn clause(&mut self, rounds: usize, enough: f64) -> Bounded {
        let h = self.view.motion.h;
        let last = self.solve(h);
        let mut best = Reach { dt: f64::NEG_INFINITY, path: [last; 2], enough };
        let mut gone = Gone { look: h, course: self.course(&last), lowest: last };
        if self.improve(&mut best, None, &last, h) {
            return self.finish(&best, &last, &gone);
        }
        let mut first = self.solve(0.0);
        if self.improve(&mut best, None, &first, 0.0) || self.improve(&mut best, Some(&first), &last, h) {
            return self.finish(&best, &first, &gone);
        }
        // Where the bound gives out is where it must get better: look ahead to just that time; touch the curved faces at
        // the lowest point there, and see how much further that reaches. Beyond it look where the best bound seems to
        // vanish, at least a little further (at the very time a cell's own wall may hold the bound alone): where the
        // multipliers of a later time, at which nothing holds any more, begin to fail, or at half way.
        let half = self.view.half;
        let beyond = LOOK_BEYOND * self.view.radius / self.view.motion.speed.max(f64::MIN_POSITIVE);
        let mut lowest = first;
        for round in 0..rounds {
            let (before, gone_before) = (best.dt, gone.look);
            let mut touched = false;
            for ahead in [false, true] {
                let mut look = best.dt.max(0.0);
                if ahead {
                    look = (look + beyond).min(h);
                    if best.dt > 0.0 && gone.look > look {
                        let fails = if round % 2 == 0 {
                            gone.course.back(gone.look, half)
                        } else {
                            0.5 * (best.dt + gone.look)
                        };
                        look = look.max(fails);
                    }
                }
                if look == 0.0 && round == 0 {
                    // Solved already.
                    lowest = first;
                } else {
                    lowest = self.solve(look);
                    if look == 0.0 {
                        first = lowest;
                    }
                    if self.improve(&mut best, None, &lowest, look)
                        || self.improve(&mut best, Some(&first), &lowest, look)
                    {
                        return self.finish(&best, &lowest, &gone);
                    }
                }
                touched |= self.touch(&lowest, look);
                let course = self.course(&lowest);
                if look < gone.look && course.at(look, half) < 0.0 {
                    gone = Gone { look, course, lowest };
                }
            }
            let nearer = gone.look < gone_before - 0.02 * (gone_before - best.dt.max(0.0));
            if !touched && !nearer && best.dt <= before + 0.02 * before.abs() {
                break;
            }
            if touched && best.dt > 0.0 {
                first = self.solve(0.0);
            }
        }
        self.finish(&best, &lowest, &gone)
    }

    /// Tries the multipliers of `s`, the best at `look`, alone or as the end of a path from those of `from`; true when
    /// as much is proven free as is enough.
    fn improve(&self, best: &mut Reach, from: Option<&Solution>, s: &Solution, look: f64) -> bool {
        let h = self.view.motion.h;
        let end = self.course(s);
        match from {
            None => {
                let dt = end.from(0.0, self.view.half).min(h);
                if dt > best.dt {
                    *best = Reach { dt, path: [*s; 2], ..*best };
                }
            }
            Some(first) => {
                let start = self.course(first);
                if start.at(0.0, self.view.half) > 0.0 && end.at(look, self.view.half) > 0.0 {
                    let far = end.from(look, self.view.half).min(h);
                    let part = if self.scratch.record.is_some() { RECORDED } else { 1.0 - 1e-12 };
                    for dt in [far, 0.5 * (look + far), look] {
                        if dt > best.dt && start.leads_to(&end, dt, self.view.half, part) {
                            *best = Reach { dt, path: [*first, *s], ..*best };
                            break;
                        }
                    }
                }
            }
        }
        best.dt >= best.enough
    }

    /// Writes down what excluded something, where that is asked for.
    fn note(&mut self, best: &Reach) {
        let Some(record) = &mut self.scratch.record else { return };
        if best.dt < 0.0 {
            return;
        }
        let mut terms: Vec<Term> = Vec::new();
        let mut seen: Vec<u32> = Vec::new();
        for (k, s) in best.path.iter().enumerate() {
            for &(i, lambda) in &s.support[..s.count] {
                let at = seen.iter().position(|o| *o == i).unwrap_or_else(|| {
                    let l = &self.scratch.lits[i as usize];
                    seen.push(i);
                    terms.push(Term { literal: (l.side, l.id), other: l.other, lambda: [0.0; 2], point: l.point });
                    terms.len() - 1
                });
                terms[at].lambda[k] = lambda;
            }
        }
        record.push(Proof { dt: best.dt, terms });
    }

    /// Adds tangents of the curved convex faces that rise above a solution's lowest point there; false when none does.
    fn touch(&mut self, s: &Solution, look: f64) -> bool {
        let low = LowPoint { look, y: s.y, z: s.z };
        let mut added = false;
        // Each literal is compared with those before it.
        let count = self.scratch.lits.len() as u64;
        self.scratch.evaluations += count + count * count / COMPARED;
        for i in 0..self.scratch.lits.len() {
            let l = &self.scratch.lits[i];
            if l.other.is_none() && l.weights.is_none() && !self.view.is_curved_convex(l.side, l.id) {
                continue;
            }
            let again = self.scratch.lits[..i]
                .iter()
                .any(|o| (o.side, o.id, o.other, o.weights) == (l.side, l.id, l.other, l.weights));
            if again {
                continue;
            }
            if let Some(t) = self.touched(l, &low)
                && t.ahead(look) + t.normal_ahead(look).dot(s.y) > s.z + 1e-3 * self.view.delta
            {
                self.push(Some(t), self.scratch.uses[i]);
                added = true;
            }
        }
        added
    }

    /// A bound touched at a low point instead, where another point of touch makes another bound.
    fn touched(&self, l: &Linear, low: &LowPoint) -> Option<Linear> {
        let v = self.view;
        if l.other.is_some() {
            return fit::touch(v, l, low.y);
        }
        if l.weights.is_some() {
            return fit::touch_spun(v, l, low.y);
        }
        if !v.is_curved_convex(l.side, l.id) {
            return None;
        }
        let point = match l.side {
            Side::A => v.center + low.y,
            Side::B => v.center_b + v.at.b_from_a * (low.y + v.velocity * low.look),
        };
        Some(v.tangent(l.side, l.id, point))
    }

    /// The linear program with bounds looked ahead to `look`.
    fn solve(&mut self, look: f64) -> Solution {
        let s = &mut *self.scratch;
        s.b.clear();
        s.normals.clear();
        for l in &s.lits {
            s.b.push(l.ahead(look));
            s.normals.push(l.normal_ahead(look));
        }
        s.evaluations += s.lits.len() as u64;
        if !self.view.multipliers {
            return lp::best_alone(&s.normals, &s.b, self.view.half);
        }
        let solution = lp::min_max(&s.normals, &s.b, self.view.half, &mut s.warm);
        s.evaluations += s.warm.pivots * (s.lits.len() as u64 + PIVOT) / SIMPLEX;
        solution
    }

    /// The bound that the multipliers of `s` give, through time.
    fn course(&self, s: &Solution) -> Course {
        let v = self.view;
        let mut c = Course::default();
        let mut w_b = DVec3::ZERO;
        for &(i, lambda) in &s.support[..s.count] {
            let l = &self.scratch.lits[i as usize];
            c.value += lambda * (l.bound - self.rounding);
            c.w += lambda * l.normal;
            c.rate += lambda * (l.rate - l.s - v.motion.slip);
            c.turn += lambda * l.turn;
            c.q += lambda * (l.q + v.motion.bend);
            if l.rigid {
                w_b += lambda * l.normal;
            }
        }
        c.q += v.motion.curvature(v.at, w_b);
        c
    }

    fn finish(&mut self, best: &Reach, s: &Solution, gone: &Gone) -> Bounded {
        self.note(best);
        let dt = best.dt;
        let is_spun = self.scratch.lits.iter().any(|l| l.weights.is_some() && l.other.is_none());
        let now = if is_spun { self.course(&best.path[0]).at(0.0, self.view.half) } else { f64::INFINITY };
        let mut a = Advance { dt, support: Vec::new(), y: s.y, cost: DVec3::ZERO, now };
        let (mut w, mut turn) = (DVec3::ZERO, DVec3::ZERO);
        for &(i, lambda) in &s.support[..s.count] {
            let l = &self.scratch.lits[i as usize];
            w += l.normal * lambda;
            turn += l.turn * lambda;
            a.cost += l.cost * lambda;
            let faces = if l.side == Side::A { &self.view.a } else { &self.view.b };
            if faces.is_guard(l.id.face()) {
                continue;
            }
            for key in [Some((l.side, l.id)), l.other].into_iter().flatten() {
                match a.support.iter_mut().find(|(side, id, _)| (*side, *id) == key) {
                    Some(same) => same.2 += lambda,
                    None => a.support.push((key.0, key.1, lambda)),
                }
            }
        }
        // A curved literal that stands aside may do so only because the cell is too large for it.
        for l in &self.scratch.lits {
            let key = Some((l.side, l.id));
            let fitted = l.id.sense() == Sense::Negative && self.scratch.lits.iter().any(|o| o.other == key);
            a.cost += l.cost * if fitted { FITTED_COST } else { idle_cost(l) };
        }
        a.cost += (w.abs() + turn.abs() * dt.max(0.0)) * self.view.half;
        let rests_on =
            |s: &Solution| s.support[..s.count].iter().fold(0, |uses, (i, _)| uses | self.scratch.uses[*i as usize]);
        let uses = if dt < 0.0 { Lists::MAX } else { rests_on(&best.path[0]) | rests_on(&best.path[1]) };
        let low = LowPoint { look: gone.look, y: gone.lowest.y, z: gone.lowest.z };
        Bounded { advance: a, uses, gives_out: Some(low) }
    }
}

/// What a curved literal's own cost weighs in the choice of the axis to split where it stands aside.
fn idle_cost(l: &Linear) -> f64 {
    match l.id.sense() {
        Sense::Positive => IDLE_CONVEX,
        Sense::Negative => IDLE_COST,
    }
}

/// Alternatives of a list, as places in the expressions.
type Alternatives = SmallVec<[(u32, u32); 16]>;

/// The earliest time ahead at which bounds were seen to fail.
struct Gone {
    look: f64,
    course: Course,
    lowest: Solution,
}

/// What fixed multipliers prove through time: for x = c + y,
/// Σ λ literal >= value + w·y + (rate + turn·y) t − ½ q t².
#[derive(Clone, Copy, Debug, Default)]
struct Course {
    value: f64,
    w: DVec3,
    rate: f64,
    turn: DVec3,
    q: f64,
}

impl Course {
    /// The bound over the whole cell, dt after the view's instant.
    fn at(&self, dt: f64, half: DVec3) -> f64 {
        self.value + self.rate * dt - (self.w + self.turn * dt).abs().dot(half) - 0.5 * self.q * dt * dt
    }

    /// Until when the bound stays positive, which it must be at `dt` (it is concave in time); else negative infinity.
    fn from(&self, dt: f64, half: DVec3) -> f64 {
        let mut end = dt;
        let s = self.turn.abs().dot(half) - self.rate;
        for round in 0..3 {
            let lb = self.at(end, half);
            if lb.is_nan() || lb <= 0.0 {
                return if round == 0 { f64::NEG_INFINITY } else { end };
            }
            end += span(lb, s + self.q * end, self.q);
        }
        end
    }

    /// Shortly before the bound began to fail that fails at `dt` (Newton, from above as it is concave); zero if it never held.
    fn back(&self, dt: f64, half: DVec3) -> f64 {
        let mut at = dt;
        for _ in 0..3 {
            let w = self.w + self.turn * at;
            let rate = self.rate - (w.signum() * self.turn).dot(half) - self.q * at;
            if rate >= 0.0 {
                return 0.0;
            }
            at -= self.at(at, half) / rate;
            if at <= 0.0 {
                return 0.0;
            }
        }
        at - 0.02 * (dt - at)
    }

    /// Multipliers that go from these to those of `end` linearly over [0, dt] prove all of it. With s = t/dt their bound is
    ///
    /// ```text
    /// (1−s) F0(t) + s F1(t) >= (1−s) F0(0) + s F1(dt) − s(1−s) M,
    /// M = dt·(rate1 − rate0 + Σ_k e_k |turn1 − turn0|_k) − dt²·min(½ q1, q1 − ½ q0),
    /// ```
    ///
    /// which is positive for all s where M <= (√F0(0) + √F1(dt))²; M may be `part` of that.
    fn leads_to(&self, end: &Course, dt: f64, half: DVec3, part: f64) -> bool {
        let (f0, f1) = (self.at(0.0, half), end.at(dt, half));
        if !(f0 > 0.0 && f1 >= 0.0) {
            return false;
        }
        let m = dt * (end.rate - self.rate + (end.turn - self.turn).abs().dot(half))
            - dt * dt * (0.5 * end.q).min(end.q - 0.5 * self.q);
        let root = f0.sqrt() + f1.sqrt();
        m <= root * root * part
    }
}

/// How long a clause is proven free, and by which multipliers: from the first to the last, linearly over that time.
#[derive(Clone, Copy, Debug)]
struct Reach {
    dt: f64,
    path: [Solution; 2],
    /// What more than this is worth nothing.
    enough: f64,
}

/// The largest dt with lb − s·dt − ½·q·dt² >= 0 (lb > 0, q >= 0), a little less for rounding; infinite if always.
fn span(lb: f64, s: f64, q: f64) -> f64 {
    let root = (s * s + 2.0 * q * lb).sqrt();
    let dt = if s > 0.0 {
        2.0 * lb / (s + root)
    } else if q > 0.0 {
        (root - s) / q
    } else {
        return f64::INFINITY;
    };
    dt * (1.0 - 1e-12)
}

#[cfg(test)]
mod tests {
    use super::span;

    #[test]
    fn the_span_is_the_first_root() {
        for (lb, s, q) in [(1.0, 2.0, 3.0), (1.0, -2.0, 3.0), (1e-9, 1e3, 0.0), (1e-9, 0.0, 5.0), (1.0, -1e-3, 1e-6)] {
            let t = span(lb, s, q);
            let left = lb - s * t - 0.5 * q * t * t;
            assert!(left >= 0.0 && left <= 1e-10 * (lb + (s * t).abs()), "{left}");
        }
        assert_eq!(span(1.0, -1.0, 0.0), f64::INFINITY);
    }
}
