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
//! A cell's expression is an and/or-tree; its bound is the smallest over its clauses, enumerated depth first. The
//! literals that all clauses of a subtree share bound all of them, so a subtree is left as soon as they suffice, and
//! running out of the enumeration's allowance only weakens the bound.

use super::fit::{self, fit};
use super::literal::{Linear, Side, View};
use super::lp::{self, Solution};
use crate::solid::Sense;
use crate::solid::local::{self, Expression, LiteralId, Token};
use glam::DVec3;

/// Clauses bounded per cell before the remaining ones share their common literals' bound.
const MAX_CLAUSES: u32 = 96;
/// Rounds of looking ahead and re-touching curved faces.
const ROUNDS: usize = 5;
/// Weight of a concave literal's own cost in the choice of the axis to split, whether it holds the bound or not.
const IDLE_COST: f64 = 0.25;
/// How far beyond the end of its reach a clause is looked at, in cell radii of relative motion.
const LOOK_BEYOND: f64 = 0.02;

/// What the weakest clause of a cell proved.
#[derive(Clone, Debug)]
pub struct Advance {
    /// The cell is free of contact for this long from the view's instant (inclusive); negative: nothing proven.
    pub dt: f64,
    /// Literals with positive multipliers in the weakest clause, guards left out.
    pub support: Vec<(Side, LiteralId, f64)>,
    /// Where the linear bounds of that clause are lowest: offset from the cell's centre.
    pub y: DVec3,
    /// What each axis of the cell costs that bound: the one to split is the largest.
    pub cost: DVec3,
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
    ors: Vec<(Side, u32, u32)>,
    /// Clauses bounded so far, over the whole query.
    pub clauses: u64,
    /// When present, every combination of literals that excluded something is written here.
    pub record: Option<Vec<Proof>>,
}

impl Scratch {
    /// Memory that keeps a record.
    pub fn recording() -> Self {
        Self { record: Some(Vec::new()), ..Self::default() }
    }
}

/// A combination of literals that cannot hold together anywhere in the cell for a while.
#[derive(Clone, Debug)]
pub struct Proof {
    /// For how long.
    pub dt: f64,
    /// The literals with their multipliers.
    pub terms: Vec<Term>,
}

/// One literal of a `Proof`, or the fit of two.
#[derive(Clone, Copy, Debug)]
pub struct Term {
    /// The literal; the positive one of a fit.
    pub literal: (Side, LiteralId),
    /// The negative literal of a fit.
    pub other: Option<(Side, LiteralId)>,
    /// Its multiplier.
    pub lambda: f64,
    /// Where a convex face is touched, in the frame of its body.
    pub point: DVec3,
}

/// The expressions of both bodies over a cell, as ranges of one token pool.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'p> {
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
    pair: &Pair,
    hints: &[Hint],
    rounding: f64,
    useless: f64,
    scratch: &mut Scratch,
) -> Advance {
    scratch.lits.clear();
    scratch.ors.clear();
    let mut run = Run { view, pool: pair.pool, hints, rounding, useless, left: MAX_CLAUSES, scratch };
    for (side, range) in [(Side::A, pair.a), (Side::B, pair.b)] {
        if range.0 < range.1 {
            run.take(side, range);
        }
    }
    run.bound(0)
}

struct Run<'a, 'p> {
    view: &'a View<'a>,
    pool: &'p [Token],
    hints: &'a [Hint],
    rounding: f64,
    useless: f64,
    left: u32,
    scratch: &'a mut Scratch,
}

impl Run<'_, '_> {
    /// Adds an expression that must hold: its literals at once, its alternatives to the open list.
    fn take(&mut self, side: Side, (start, end): (u32, u32)) {
        let mut at = start as usize;
        while at < end as usize {
            let (e, n) = local::first(&self.pool[at..]);
            match e {
                Expression::Literal(id) => self.add(side, id),
                Expression::And(_) => self.take(side, (at as u32 + 1, (at + n) as u32)),
                Expression::Or(_) => self.scratch.ors.push((side, at as u32 + 1, (at + n) as u32)),
            }
            at += n;
        }
    }

    /// Adds a literal's bound, with the tangents and fits it brings along.
    fn add(&mut self, side: Side, id: LiteralId) {
        for h in self.hints {
            if (h.side, h.id) == (side, id) {
                self.scratch.lits.push(self.view.tangent(side, id, h.point));
            }
        }
        let before = if self.view.fits { self.scratch.lits.len() } else { 0 };
        self.scratch.lits.push(self.view.linear(side, id, DVec3::ZERO));
        for i in 0..before {
            let l = &self.scratch.lits[i];
            if l.side == side || l.id.sense() == id.sense() || l.other.is_some() {
                continue;
            }
            let (p, q) =
                if id.sense() == Sense::Positive { ((side, id), (l.side, l.id)) } else { ((l.side, l.id), (side, id)) };
            if let Some(g) = fit(self.view, p, q) {
                self.scratch.lits.push(g);
            }
        }
    }

    /// The weakest clause that completes the literals taken so far with one alternative of each open list from
    /// `from` on.
    fn bound(&mut self, from: usize) -> Advance {
        let mut own = Advance { dt: f64::NEG_INFINITY, support: Vec::new(), y: DVec3::ZERO, cost: DVec3::ZERO };
        if !self.scratch.lits.is_empty() {
            self.left = self.left.saturating_sub(1);
            self.scratch.clauses += 1;
            own = self.clause();
        }
        let (lits, ors) = (self.scratch.lits.len(), self.scratch.ors.len());
        if own.dt >= self.view.motion.h || from == ors || self.left == 0 {
            return own;
        }
        // The list with the fewest alternatives first.
        let size = |s: &Self, i: usize| {
            let (_, a, b) = s.scratch.ors[i];
            local::operands(&s.pool[a as usize..b as usize]).count()
        };
        let pick = (from..ors).min_by_key(|i| size(self, *i)).unwrap_or(from);
        self.scratch.ors.swap(from, pick);
        let (side, mut at, end) = self.scratch.ors[from];
        let mut weakest: Option<Advance> = None;
        while at < end {
            let n = local::first(&self.pool[at as usize..]).1 as u32;
            self.take(side, (at, at + n));
            let found = self.bound(from + 1);
            self.scratch.lits.truncate(lits);
            self.scratch.ors.truncate(ors);
            let weaker = weakest.as_ref().is_none_or(|w| found.dt < w.dt);
            if weaker {
                let stop = found.dt.max(own.dt) < self.useless;
                weakest = Some(found);
                if stop {
                    break;
                }
            }
            at += n;
        }
        self.scratch.ors.swap(from, pick);
        let mut result = weakest.unwrap_or_else(|| own.clone());
        result.dt = result.dt.max(own.dt);
        result
    }

    /// Bounds the clause of all literals taken so far. Tangents that were added stay for its completions.
    fn clause(&mut self) -> Advance {
        let h = self.view.motion.h;
        let mut best = (f64::NEG_INFINITY, self.solve(h));
        best.0 = self.reach(&best.1);
        if best.0 >= h {
            self.note(best);
            return self.result(best);
        }
        // Where the bound gives out is where it must get better: look ahead to just that time, and a little beyond it
        // (at the very time a cell's own wall may hold the bound alone); touch the curved faces at the lowest point
        // there, and see how much further that reaches.
        let beyond = LOOK_BEYOND * self.view.radius / self.view.motion.speed.max(f64::MIN_POSITIVE);
        let mut lowest = best.1;
        for _ in 0..ROUNDS {
            let before = best.0;
            let mut touched = false;
            for extra in [0.0, beyond] {
                let look = (best.0.max(0.0) + extra).min(h);
                lowest = self.solve(look);
                let reach = self.reach(&lowest);
                if reach > best.0 {
                    best = (reach, lowest);
                    if reach >= h {
                        self.note(best);
                        return self.result(best);
                    }
                }
                touched |= self.touch(&lowest, look);
            }
            if !touched && best.0 <= before + 0.02 * before.abs() {
                break;
            }
        }
        self.note(best);
        self.result((best.0, lowest))
    }

    /// Writes down what excluded something, where that is asked for.
    fn note(&mut self, (dt, s): (f64, Solution)) {
        let Some(record) = &mut self.scratch.record else { return };
        if dt < 0.0 {
            return;
        }
        let term = |&(i, lambda): &(u32, f64)| {
            let l = &self.scratch.lits[i as usize];
            Term { literal: (l.side, l.id), other: l.other, lambda, point: l.point }
        };
        record.push(Proof { dt, terms: s.support[..s.count].iter().map(term).collect() });
    }

    /// Adds tangents of the curved convex faces that rise above a solution's lowest point there; false when none does.
    fn touch(&mut self, s: &Solution, look: f64) -> bool {
        let v = self.view;
        let mut added = false;
        for i in 0..self.scratch.lits.len() {
            let l = self.scratch.lits[i];
            let again = self.scratch.lits[..i].iter().any(|o| (o.side, o.id, o.other) == (l.side, l.id, l.other));
            if again {
                continue;
            }
            if l.other.is_some() {
                if let Some(t) = fit::touch(v, &l, s.y)
                    && t.bound + look * (t.rate - t.s) - 0.5 * look * look * t.q + t.normal.dot(s.y)
                        > s.z + 1e-3 * v.delta
                {
                    self.scratch.lits.push(t);
                    added = true;
                }
                continue;
            }
            if !v.is_curved_convex(l.side, l.id) {
                continue;
            }
            let point = match l.side {
                Side::A => v.center + s.y,
                Side::B => v.center_b + v.at.b_from_a * (s.y + v.velocity * look),
            };
            let t = v.tangent(l.side, l.id, point);
            if t.bound + look * t.rate + t.normal.dot(s.y) > s.z + 1e-3 * v.delta {
                self.scratch.lits.push(t);
                added = true;
            }
        }
        added
    }

    /// The linear program with bounds looked ahead to `look`.
    fn solve(&mut self, look: f64) -> Solution {
        let s = &mut *self.scratch;
        s.b.clear();
        s.normals.clear();
        for l in &s.lits {
            s.b.push(l.bound + look * (l.rate - l.s) - 0.5 * look * look * l.q);
            s.normals.push(l.normal);
        }
        lp::min_max(&s.normals, &s.b, self.view.half)
    }

    /// dt of the multipliers of `s`; negative infinity when they exclude nothing now.
    fn reach(&self, s: &Solution) -> f64 {
        let v = self.view;
        let (mut value, mut total, mut rate, mut second) = (0.0, 0.0, 0.0, 0.0);
        let (mut w, mut w_b, mut turn) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for &(i, lambda) in &s.support[..s.count] {
            let l = &self.scratch.lits[i as usize];
            total += lambda;
            value += lambda * l.bound;
            w += lambda * l.normal;
            rate += lambda * (l.rate - l.s);
            turn += lambda * l.turn;
            second += lambda * l.q;
            if l.rigid {
                w_b += lambda * l.normal;
            }
        }
        let lb = value - w.abs().dot(v.half) - self.rounding * total;
        if lb.is_nan() || lb <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let s = turn.abs().dot(v.half) - rate;
        let q = v.motion.curvature(v.at, w_b) + second;
        span(lb, s, q).min(v.motion.h)
    }

    fn result(&self, (dt, s): (f64, Solution)) -> Advance {
        let mut a = Advance { dt, support: Vec::new(), y: s.y, cost: DVec3::ZERO };
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
        // A concave literal that stands aside may do so only because the cell is too large for it.
        for l in &self.scratch.lits {
            if l.id.sense() == Sense::Negative {
                a.cost += l.cost * IDLE_COST;
            }
        }
        a.cost += (w.abs() + turn.abs() * dt.max(0.0)) * self.view.half;
        a
    }
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
