//! The clauses of a cell's expressions, bounded without going through them all.
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

use super::clause::{
    Advance, Bounded, Clash, Expressions, Hint, List, Lists, LowPoint, Proof, Run, Scratch, Term, UNMADE, idle_cost,
};
use super::literal::{Linear, Side, View};
use super::lp;
use super::tighten::Left;
use crate::math::halt;
use crate::solid::local::{self, Expression};
use glam::DVec3;
use smallvec::SmallVec;

/// Rounds of looking ahead and re-touching curved faces: of a clause that is complete, and of one that lists may still complete,
/// whose bound is better served by their alternatives.
const ROUNDS: usize = 5;
const ROUNDS_BEFORE_LISTS: usize = 1;
/// Looks at a literal's bound at one point that cost as much as one evaluation of a literal.
const CHECKED: u64 = 8;
/// Clauses bounded per cell before the remaining ones share their common literals' bound.
const MAX_CLAUSES: u32 = 96;
/// The last bit of `Lists`.
const DEEPEST: u32 = 63;

/// Alternatives of a list, as places in the expressions.
type Alternatives = SmallVec<[(u32, u32); 16]>;

/// Bounds the cell over all clauses of `pair`; stops early once `dt` falls below `useless`.
pub fn advance(
    view: &View,
    pair: &Expressions,
    hints: &[Hint],
    rounding: f64,
    useless: f64,
    scratch: &mut Scratch,
) -> Advance {
    begin(Run { view, pair, hints, rounding, useless, left: MAX_CLAUSES, scratch }).weakest()
}

/// The same, unless no more than `worth` of the cell is left by what all clauses share: then that, and nothing is bounded.
pub fn advance_or_tighten(
    view: &View,
    pair: &Expressions,
    hints: &[Hint],
    rounding: f64,
    worth: f64,
    scratch: &mut Scratch,
) -> Result<Advance, Left> {
    let mut run = begin(Run { view, pair, hints, rounding, useless: 0.0, left: MAX_CLAUSES, scratch });
    if run.scratch.clash.is_none() {
        let left = run.left();
        if Left::part(&left.span, view.half) <= worth {
            run.scratch.evaluations += std::mem::take(&mut run.scratch.checked).div_ceil(CHECKED);
            return Err(left);
        }
    }
    Ok(run.weakest())
}

/// What all clauses of `pair` leave of the cell, where that is no more than `worth` of it; nothing is bounded.
pub fn left(view: &View, pair: &Expressions, rounding: f64, worth: f64, scratch: &mut Scratch) -> Option<Left> {
    let mut run = begin(Run { view, pair, hints: &[], rounding, useless: 0.0, left: MAX_CLAUSES, scratch });
    if run.scratch.clash.is_some() {
        return None;
    }
    let left = run.left();
    run.scratch.evaluations += std::mem::take(&mut run.scratch.checked).div_ceil(CHECKED);
    (Left::part(&left.span, view.half) <= worth).then_some(left)
}

/// Takes the literals that all clauses share.
fn begin<'a, 'p>(run: Run<'a, 'p>) -> Run<'a, 'p> {
    let mut run = run;
    let pair = run.pair;
    halt::work((pair.a.1 - pair.a.0 + pair.b.1 - pair.b.0) as usize);
    let scratch = &mut *run.scratch;
    scratch.lits.clear();
    scratch.notes.clear();
    scratch.taken.clear();
    scratch.fitted_at.clear();
    scratch.fitted.clear();
    scratch.touchables.clear();
    scratch.ors.clear();
    scratch.made.clear();
    scratch.places.clear();
    scratch.places.resize((pair.a.1 - pair.a.0 + pair.b.1 - pair.b.0) as usize, UNMADE);
    scratch.clash = None;
    scratch.warm = lp::Warm::default();
    for (side, range) in [(Side::A, pair.a), (Side::B, pair.b)] {
        if range.0 < range.1 {
            run.take(side, range, 0);
        }
    }
    run
}

impl Run<'_, '_> {
    /// The weakest clause of the cell.
    fn weakest(mut self) -> Advance {
        let mut found = self.bound(0, 0, self.view.motion.h).advance;
        self.scratch.evaluations += std::mem::take(&mut self.scratch.checked).div_ceil(CHECKED);
        if self.left == 0 {
            // Clauses are missing: what the last one cost says nothing about the cell, its longest axis is halved.
            found.cost = self.view.half;
        }
        found
    }

    /// Adds an expression that must hold: its literals at once, its alternatives to the open list. `list` are the
    /// lists of whose alternatives it is part.
    fn take(&mut self, side: Side, (start, end): (u32, u32), list: Lists) {
        let mut at = start as usize;
        while at < end as usize {
            let (e, n) = local::first(&self.pair.pool[at..]);
            match e {
                Expression::Literal(id) => self.add(side, id, at as u32, list),
                // What it says is not known yet: without it the bound is weaker.
                Expression::Part(_) => {}
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
        self.scratch.notes.truncate(lits);
        let taken = self.scratch.taken.iter().rposition(|t| (t.lit as usize) < lits).map_or(0, |last| last + 1);
        self.scratch.taken.truncate(taken);
        self.scratch.ors.truncate(ors);
        self.scratch.clash = self.scratch.clash.filter(|clash| clash.before < lits);
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
                height = height.max(self.value_at(l, low, || self.touched(i, low)));
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
                    let curved = self.view.is_curved_convex(side, id);
                    let height = self.value_at(l, low, || curved.then(|| self.tangent(l, low)));
                    let held = if height > low.z { Ok(height) } else { Err(l.cost * idle_cost(l)) };
                    self.scratch.checked += 1;
                    held
                }
                Expression::Part(_) => Err(DVec3::ZERO),
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
    fn value_at(&self, l: &Linear, low: &LowPoint, touched: impl FnOnce() -> Option<Linear>) -> f64 {
        let value = |l: &Linear| l.ahead(low.look) + l.normal_ahead(low.look).dot(low.y);
        let own = value(l);
        if own > low.z {
            return own;
        }
        touched().map_or(own, |t| own.max(value(&t)))
    }
}
