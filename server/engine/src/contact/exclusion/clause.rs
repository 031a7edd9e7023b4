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

use super::course::Course;
use super::fit::{self, fit, spun};
use super::literal::{Linear, Side, View};
use super::lp::{self, Solution};
use crate::solid::Sense;
use crate::solid::alike::{Ball, above};
use crate::solid::local::{LiteralId, Token};
use glam::DVec3;

/// Weight of a concave literal's own cost in the choice of the axis to split, whether it holds the bound or not.
const IDLE_COST: f64 = 0.25;
/// The same of a convex one that curves.
const IDLE_CONVEX: f64 = 1e-3;
/// The same where a fit stands for the literal, which costs more of what matters.
const FITTED_COST: f64 = 0.02;
/// Comparisons of two literals that cost as much as one evaluation of a literal.
const COMPARED: u64 = 16;
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
    normals: Vec<DVec3>,
    b: Vec<f64>,
    /// Of each of `lits`, the lists of alternatives that it rests on.
    pub(super) uses: Vec<Lists>,
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
    pub fn push(&mut self, bounds: impl IntoIterator<Item = Linear>, uses: Lists) {
        self.scratch.lits.extend(bounds);
        self.scratch.uses.resize(self.scratch.lits.len(), uses);
    }

    /// The bound of the literal at a place of its body's expression, touched at the cell's centre; an index of `made`.
    pub fn made(&mut self, side: Side, id: LiteralId, at: u32) -> usize {
        let (a, b) = (self.pair.a, self.pair.b);
        let place = if side == Side::A { at - a.0 } else { at - b.0 + (a.1 - a.0) } as usize;
        if self.scratch.places[place] == UNMADE {
            self.scratch.places[place] = self.scratch.made.len() as u32;
            self.scratch.made.push(self.view.linear(side, id, DVec3::ZERO));
        }
        self.scratch.places[place] as usize
    }

    /// Adds a literal's bound, with the tangents and fits it brings along.
    pub fn add(&mut self, side: Side, id: LiteralId, at: u32, list: Lists) {
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

    /// Bounds the clause of all literals taken so far, in at most so many rounds, until that is `enough`. Tangents that were added stay for its
    /// completions.
    pub fn clause(&mut self, rounds: usize, enough: f64) -> Bounded {
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
    pub fn touched(&self, l: &Linear, low: &LowPoint) -> Option<Linear> {
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
pub(super) fn idle_cost(l: &Linear) -> f64 {
    match l.id.sense() {
        Sense::Positive => IDLE_CONVEX,
        Sense::Negative => IDLE_COST,
    }
}

/// The earliest time ahead at which bounds were seen to fail.
struct Gone {
    look: f64,
    course: Course,
    lowest: Solution,
}

/// How long a clause is proven free, and by which multipliers: from the first to the last, linearly over that time.
#[derive(Clone, Copy, Debug)]
struct Reach {
    dt: f64,
    path: [Solution; 2],
    /// What more than this is worth nothing.
    enough: f64,
}
