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
//! λ is chosen for the longest dt, not for the largest LB: where the bound is positive now, the linear program is solved
//! with the literals' bounds looked ahead to h, then to the best dt found so far, where the bound gives out. Curved convex
//! literals are re-touched at the program's minimiser there (the cutting planes of Kelley 1960), which replaces one tangent
//! plane by the face's shape.

use super::course::Course;
use super::fit::{self, Fitted, Touchable, fit, spun};
use super::literal::{Linear, Side, View};
use super::lp::{self, Planes, Solution};
use crate::math::halt;
use crate::solid::Sense;
use crate::solid::alike::{Ball, above};
use crate::solid::local::{LiteralId, Token};
use glam::DVec3;
use smallvec::SmallVec;

/// What a literal that is added costs, in looks at a face.
const ADDED: usize = 16;
/// Weight of a concave literal's own cost in the choice of the axis to split, whether it holds the bound or not.
const IDLE_COST: f64 = 0.25;
/// The same of a convex one that curves.
const IDLE_CONVEX: f64 = 1e-3;
/// The same where a fit stands for the literal, which costs more of what matters.
const FITTED_COST: f64 = 0.02;
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
    pub(super) lits: Vec<Linear>,
    planes: Planes,
    /// Of each of `lits`, what it rests on and what touches it elsewhere.
    pub(super) notes: Vec<Note>,
    /// The literals among `lits` that were taken from the expressions, without tangents and fits.
    pub(super) taken: Vec<Taken>,
    /// By the places of `made`, the index in `fitted`; `UNMADE` before it was asked for, `UNFIT` where there is none.
    pub(super) fitted_at: Vec<u32>,
    pub(super) fitted: Vec<Fitted>,
    pub(super) touchables: Vec<Touchable>,
    /// Where the clause's last program ended.
    pub(super) warm: lp::Warm,
    pub(super) ors: Vec<List>,
    /// Two literals of one body that contradict each other.
    pub(super) clash: Option<Clash>,
    /// Bounds of the literals by their places in the expressions, made once a cell.
    pub(super) made: Vec<Linear>,
    /// Literals looked at where a clause gives out that are not in `evaluations` yet.
    pub(super) checked: u64,
    /// For each place in A's expression, then in B's, its index in `made`.
    pub(super) places: Vec<u32>,
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
pub(super) type Lists = u64;
/// An open list of alternatives: from, and to where in the expression of its body, and the lists of whose alternatives it is part.
#[derive(Clone, Copy, Debug)]
pub(super) struct List {
    pub side: Side,
    pub start: u32,
    pub end: u32,
    pub within: Lists,
}

/// No bound made yet.
pub(super) const UNMADE: u32 = u32::MAX;
/// A literal that fits nothing.
const UNFIT: u32 = u32::MAX - 1;

/// What stands beside a bound.
#[derive(Clone, Copy, Debug)]
pub(super) struct Note {
    /// The lists of alternatives that it rests on.
    pub uses: Lists,
    /// What it becomes where it is touched at another point.
    touch: Touch,
}

/// How a bound may be had at other points of touch; of several of one literal the first one alone says so.
#[derive(Clone, Copy, Debug)]
enum Touch {
    /// Not at all.
    Never,
    /// As a tangent of its face.
    Face,
    /// As a fit, by its index in `Scratch::touchables`.
    Fit(u32),
    /// As a quadric that spins.
    Spun,
}

/// A literal of the clause in hand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taken {
    /// Its index among the bounds.
    pub lit: u32,
    side: Side,
    id: LiteralId,
    /// Its index in `Scratch::made`.
    made: u32,
    /// The last in order of those of A, and of B, up to it: what comes after them all is new.
    last: [Option<LiteralId>; 2],
}

/// Two literals of one body that contradict each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clash {
    /// How many bounds there were before.
    pub before: usize,
    pub side: Side,
    /// The positive and the negative one.
    pub literals: [LiteralId; 2],
    pub uses: Lists,
}

/// A bound, the lists of alternatives that it rests on, and where it gives out.
pub(super) struct Bounded {
    pub advance: Advance,
    pub uses: Lists,
    pub gives_out: Option<LowPoint>,
}

impl Bounded {
    pub fn nothing() -> Self {
        let advance =
            Advance { dt: f64::NEG_INFINITY, support: Vec::new(), y: DVec3::ZERO, cost: DVec3::ZERO, now: 0.0 };
        Self { advance, uses: Lists::MAX, gives_out: None }
    }
}

/// The lowest point of a clause's linear bounds, some time ahead.
#[derive(Clone, Copy, Debug)]
pub(super) struct LowPoint {
    /// How far ahead.
    pub look: f64,
    pub y: DVec3,
    /// The bounds' value there.
    pub z: f64,
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

/// The axis across which halving a cell helps its bound most; the longest one where none costs anything.
pub fn axis_to_halve(cost: DVec3, half: DVec3) -> usize {
    // Of equal costs the longer. How long an axis is counts for no more than that: one along a line of contact costs
    // nothing, however thin the cell must become across it.
    let most = cost.max_element();
    let tie = if most > 0.0 { 1e-6 * most / half.max_element() } else { 1.0 };
    (cost + half * tie).max_position()
}

pub(super) struct Run<'a, 'p> {
    pub view: &'a View<'a>,
    pub pair: &'a Expressions<'p>,
    pub hints: &'a [Hint],
    pub rounding: f64,
    pub useless: f64,
    pub left: u32,
    pub scratch: &'a mut Scratch,
}

impl Run<'_, '_> {
    fn push(&mut self, bounds: impl IntoIterator<Item = Linear>, uses: Lists, touch: Touch) {
        self.scratch.lits.extend(bounds);
        self.scratch.notes.resize(self.scratch.lits.len(), Note { uses, touch });
    }

    /// The bound of the literal at a place of its body's expression, touched at the cell's centre; an index of `made`.
    pub fn made(&mut self, side: Side, id: LiteralId, at: u32) -> usize {
        let (a, b) = (self.pair.a, self.pair.b);
        let place = if side == Side::A { at - a.0 } else { at - b.0 + (a.1 - a.0) } as usize;
        if self.scratch.places[place] == UNMADE {
            self.scratch.places[place] = self.scratch.made.len() as u32;
            self.scratch.made.push(self.view.linear(side, id, DVec3::ZERO));
            self.scratch.fitted_at.push(UNMADE);
        }
        self.scratch.places[place] as usize
    }

    /// What the fits of a literal have in common, by its index in `made`: an index of `fitted`.
    fn fitted(&mut self, side: Side, id: LiteralId, made: u32) -> Option<usize> {
        let scratch = &mut *self.scratch;
        let at = &mut scratch.fitted_at[made as usize];
        if *at == UNMADE {
            *at = UNFIT;
            if let Some(fitted) = Fitted::of(self.view, side, id) {
                *at = scratch.fitted.len() as u32;
                scratch.fitted.push(fitted);
            }
        }
        (*at != UNFIT).then_some(*at as usize)
    }

    /// Adds a literal's bound, with the tangents and fits it brings along.
    pub fn add(&mut self, side: Side, id: LiteralId, at: u32, list: Lists) {
        halt::work(ADDED);
        // What stands twice in a clause brings along nothing new. (Hulls have thousands of literals, mostly in order.)
        let mut last = self.scratch.taken.last().map_or([None; 2], |t| t.last);
        let own = &mut last[usize::from(side == Side::B)];
        let again = *own >= Some(id) && self.scratch.taken.iter().any(|t| (t.side, t.id) == (side, id));
        *own = (*own).max(Some(id));
        let mut touch = if !again && self.view.is_curved_convex(side, id) { Touch::Face } else { Touch::Never };
        for h in self.hints {
            if (h.side, h.id) == (side, id) {
                self.push(Some(self.view.tangent(side, id, h.point)), list, touch);
                touch = Touch::Never;
            }
        }
        let before = self.scratch.lits.len();
        let made = self.made(side, id, at);
        self.push(Some(self.scratch.made[made]), list, touch);
        if self.view.faces(side).solid.alike.has_walls(self.view.wall) {
            self.against_own(side, id, before, list);
        }
        if self.view.fits && !again {
            self.fit_with_others(side, id, made as u32, list);
        }
        self.scratch.taken.push(Taken { lit: before as u32, side, id, made: made as u32, last });
        if side == Side::B && self.view.fits && self.view.curved && !again && !self.view.b.is_guard(id.face()) {
            let touch = if id.sense() == Sense::Positive { Touch::Spun } else { Touch::Never };
            self.push(spun(self.view, id), list, touch);
        }
        self.against_walls(side, id, before, list);
    }

    /// Adds the fits of a literal with those of the other body that were taken before.
    fn fit_with_others(&mut self, side: Side, id: LiteralId, made: u32, list: Lists) {
        if self.view.faces(side).get(id.face()).is_flat() {
            return;
        }
        for i in 0..self.scratch.taken.len() {
            let Taken { lit, side: other_side, id: other, made: other_made, .. } = self.scratch.taken[i];
            if other_side == side || other.sense() == id.sense() {
                continue;
            }
            let Some(theirs) = self.fitted(other_side, other, other_made) else { continue };
            let Some(own) = self.fitted(side, id, made) else { return };
            let uses = list | self.scratch.notes[lit as usize].uses;
            let (own, theirs) = (&self.scratch.fitted[own], &self.scratch.fitted[theirs]);
            let (p, q) = if id.sense() == Sense::Positive { (own, theirs) } else { (theirs, own) };
            let fits: SmallVec<[fit::Fit; 2]> = fit(self.view, p, q).collect();
            for (bound, touchable) in fits {
                let touch = touchable.map_or(Touch::Never, |touchable| {
                    self.scratch.touchables.push(touchable);
                    Touch::Fit(self.scratch.touchables.len() as u32 - 1)
                });
                self.push(Some(bound), uses, touch);
            }
        }
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
            let is_wall = wall.id == id && is_wall(self.view, &wall);
            let spun = || self.scratch.lits[..before].iter().position(is_spun);
            if let Some(i) = if is_wall { spun() } else { None } {
                let touched = fit::touch_spun_against(self.view, &self.scratch.lits[i], wall.normal);
                self.push(touched, list | self.scratch.notes[i].uses, Touch::Never);
            }
        } else if let Some(spun) = self.scratch.lits[before..end].iter().find(|l| is_spun(l)).copied() {
            for i in 0..before {
                let wall = self.scratch.lits[i];
                if is_wall(self.view, &wall) {
                    let touched = fit::touch_spun_against(self.view, &spun, wall.normal);
                    self.push(touched, list | self.scratch.notes[i].uses, Touch::Never);
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
                let uses = list | self.scratch.notes[i].uses;
                self.scratch.clash.get_or_insert(Clash { before, side, literals: [p, q], uses });
                return;
            }
            if self.view.fits {
                self.push(fit::within(self.view, side, p, q), list | self.scratch.notes[i].uses, Touch::Never);
            }
        }
    }

    /// Bounds the clause of all literals taken so far, in at most so many rounds, until that is `enough`. Tangents that were added stay for its
    /// completions.
    pub fn clause(&mut self, rounds: usize, enough: f64) -> Bounded {
        let h = self.view.motion.h;
        let mut first = self.solve(0.0);
        let mut best = Reach { dt: f64::NEG_INFINITY, path: [first.solution; 2], enough };
        let mut gone = Gone { look: h, lowest: first };
        if self.improve(&mut best, None, &first, 0.0) {
            return self.finish(&best, &first, &gone);
        }
        // What no multipliers hold now they do not hold for any time: no later program is asked.
        if best.dt >= 0.0 {
            gone.lowest = self.solve(h);
            let last = gone.lowest;
            if self.improve(&mut best, None, &last, h) || self.improve(&mut best, Some(&first), &last, h) {
                return self.finish(&best, &last, &gone);
            }
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
                            gone.lowest.course.back(gone.look, half)
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
                touched |= self.touch(&lowest.solution, look);
                if look < gone.look && lowest.course.at(look, half) < 0.0 {
                    gone = Gone { look, lowest };
                }
            }
            let nearer = best.dt >= 0.0 && gone.look < gone_before - 0.02 * (gone_before - best.dt);
            let stands = !touched && !nearer && best.dt <= before + 0.02 * before.abs();
            if stands {
                break;
            }
        }
        self.finish(&best, &lowest, &gone)
    }

    /// Tries the multipliers of `s`, the best at `look`, alone or as the end of a path from those of `from`; true when
    /// as much is proven free as is enough.
    fn improve(&self, best: &mut Reach, from: Option<&Solved>, s: &Solved, look: f64) -> bool {
        let (h, half) = (self.view.motion.h, self.view.half);
        match from {
            None => {
                let dt = s.course.from(0.0, half).min(h);
                if dt > best.dt {
                    *best = Reach { dt, path: [s.solution; 2], ..*best };
                }
            }
            Some(first) => {
                if first.course.at(0.0, half) > 0.0 && s.course.at(look, half) > 0.0 {
                    let far = s.course.from(look, half).min(h);
                    let part = if self.scratch.record.is_some() { RECORDED } else { 1.0 - 1e-12 };
                    for dt in [far, 0.5 * (look + far), look] {
                        if dt > best.dt && first.course.leads_to(&s.course, dt, half, part) {
                            *best = Reach { dt, path: [first.solution, s.solution], ..*best };
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
                // A program that ended by rounding may have one plane twice.
                terms[at].lambda[k] += lambda;
            }
        }
        record.push(Proof { dt: best.dt, terms });
    }

    /// Adds tangents of the curved convex faces that rise above a solution's lowest point there; false when none does.
    fn touch(&mut self, s: &Solution, look: f64) -> bool {
        let low = LowPoint { look, y: s.y, z: s.z };
        let mut added = false;
        self.scratch.evaluations += self.scratch.lits.len() as u64;
        for i in 0..self.scratch.lits.len() {
            let rises = |t: &Linear| t.ahead(look) + t.normal_ahead(look).dot(s.y) > s.z + 1e-3 * self.view.delta;
            if let Some(t) = self.balanced(i, s, look).filter(rises) {
                self.push(Some(t), self.scratch.notes[i].uses, Touch::Never);
                added = true;
            } else if let Some(t) = self.touched(i, &low)
                && t.ahead(look) + t.normal_ahead(look).dot(s.y) > s.z + 1e-3 * self.view.delta
            {
                self.push(Some(t), self.scratch.notes[i].uses, Touch::Never);
                added = true;
            }
        }
        added
    }

    /// A fit that weighs in a solution, touched where it is lowest against the others of that: as its curvature says, where the program's
    /// own lowest point is a corner of what tangents leave (a step of sequential quadratic programming). `None` for others.
    fn balanced(&self, i: usize, s: &Solution, look: f64) -> Option<Linear> {
        let Touch::Fit(at) = self.scratch.notes[i].touch else { return None };
        let fit = &self.scratch.lits[i];
        let (mut weight, mut others) = (0.0, DVec3::ZERO);
        for &(k, lambda) in &s.support[..s.count] {
            let l = &self.scratch.lits[k as usize];
            if (l.side, l.id, l.other, l.weights) == (fit.side, fit.id, fit.other, fit.weights) {
                weight += lambda;
            } else {
                others += lambda * l.normal_ahead(look);
            }
        }
        let touchable = &self.scratch.touchables[at as usize];
        let y = touchable.lowest(fit.normal_ahead(look) + others / weight, self.view.half);
        (weight > 0.0).then(|| fit::touch(self.view, fit, touchable, y))
    }

    /// A bound touched at a low point instead, where another point of touch makes another bound.
    pub fn touched(&self, i: usize, low: &LowPoint) -> Option<Linear> {
        let (v, l) = (self.view, &self.scratch.lits[i]);
        match self.scratch.notes[i].touch {
            Touch::Never => None,
            Touch::Face => Some(self.tangent(l, low)),
            Touch::Fit(at) => Some(fit::touch(v, l, &self.scratch.touchables[at as usize], low.y)),
            Touch::Spun => fit::touch_spun(v, l, low.y),
        }
    }

    /// The tangent of a literal's face beside a low point.
    pub fn tangent(&self, l: &Linear, low: &LowPoint) -> Linear {
        let v = self.view;
        let point = match l.side {
            Side::A => v.center + low.y,
            Side::B => v.center_b + v.at.b_from_a * (low.y + v.velocity * low.look),
        };
        v.tangent(l.side, l.id, point)
    }

    /// The linear program with bounds looked ahead to `look`, and what its multipliers give through time.
    fn solve(&mut self, look: f64) -> Solved {
        let s = &mut *self.scratch;
        halt::work(4 * s.lits.len());
        s.planes.set(s.lits.iter().map(|l| (l.normal_ahead(look), l.ahead(look))));
        s.evaluations += s.lits.len() as u64;
        let solution = if self.view.multipliers {
            let solution = lp::min_max(&mut s.planes, self.view.half, &mut s.warm);
            s.evaluations += s.warm.pivots * (s.lits.len() as u64 + PIVOT) / SIMPLEX;
            solution
        } else {
            lp::best_alone(&s.planes, self.view.half)
        };
        Solved { solution, course: self.course(&solution) }
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

    fn finish(&mut self, best: &Reach, lowest: &Solved, gone: &Gone) -> Bounded {
        self.note(best);
        let s = &lowest.solution;
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
        let others: SmallVec<[_; 8]> = self.scratch.lits.iter().filter_map(|l| l.other).collect();
        for l in &self.scratch.lits {
            let fitted = l.id.sense() == Sense::Negative && others.contains(&(l.side, l.id));
            a.cost += l.cost * if fitted { FITTED_COST } else { idle_cost(l) };
        }
        a.cost += (w.abs() + turn.abs() * dt.max(0.0)) * self.view.half;
        let rests_on = |s: &Solution| {
            s.support[..s.count].iter().fold(0, |uses, (i, _)| uses | self.scratch.notes[*i as usize].uses)
        };
        let uses = if dt < 0.0 { Lists::MAX } else { rests_on(&best.path[0]) | rests_on(&best.path[1]) };
        let lowest = &gone.lowest.solution;
        let low = LowPoint { look: gone.look, y: lowest.y, z: lowest.z };
        Bounded { advance: a, uses, gives_out: Some(low) }
    }
}

/// What a curved literal's own cost weighs in the choice of the axis to split where it stands aside.
pub(super) fn idle_cost(l: &Linear) -> f64 {
    match l.id.sense() {
        Sense::Positive => IDLE_CONVEX,
        Sense::Negative => IDLE_COST,
    }
}

/// A program's solution, and what its multipliers prove through time.
#[derive(Clone, Copy, Debug)]
struct Solved {
    solution: Solution,
    course: Course,
}

/// The earliest time ahead at which bounds were seen to fail.
struct Gone {
    look: f64,
    lowest: Solved,
}

/// How long a clause is proven free, and by which multipliers: from the first to the last, linearly over that time.
#[derive(Clone, Copy, Debug)]
struct Reach {
    dt: f64,
    path: [Solution; 2],
    /// What more than this is worth nothing.
    enough: f64,
}
