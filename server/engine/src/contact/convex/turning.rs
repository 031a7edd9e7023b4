//! Two convex bodies of which one turns at least: an advance on the stack, and Newton on the direction and the time at once.
//!
//! φ(n, t) = n·c(t) − h_A(n; t) − h_B(−n; t) is the gap along a unit direction n of the world. At the first contact it is 0
//! and largest over all n. With d the way between the points that are shown along n, d' its derivative in time at the same n,
//! and H the second derivatives of both supports, a step (δ, τ) of direction and time solves
//!
//! ```text
//! d + (−H − φ) δ + d' τ = 0  across n,     φ + d·δ + (∂φ/∂t) τ = 0
//! ```
//!
//! On a circle of directions n·a = lean that a feature holds (`part`) the first equation is left along the circle alone, with
//! the multiplier μ of the circle, and the circle's own equation, which turns with its body, takes the place of the other.
//! So two or three unknowns are left of the six to ten of the search's equations. Both trees confirm the contact (`touch`);
//! what came before it is proven as everywhere (`proof`), mostly by the contact's own normal.
//!
//! What starts near, does not settle, or meets in more than its faces tell is left to the advance.

use super::gjk::nearest;
use super::overlap::Start;
use super::part::ConvexPart;
use super::proof::{Gap, Pace};
use super::steer::steer;
use super::support::ConvexBody;
use super::touch::{Stand, Touch};
use super::turns::{Posed, Turns};
use super::whole::{APART, PrimitivePair, excluded};
use crate::contact::query::options::QueryOptions;
use crate::contact::query::outcome::Outcome;
use crate::solid::primitive::Shown;
use glam::{DMat3, DVec3};

/// Distance evaluations before a pair is left to others.
const ROUNDS: usize = 12;
/// How near to the distance the direction of nearest points is looked for, and how near to a circle of directions one is
/// held by it: first and second try.
const TRIES: [(f64, f64); 2] = [(5e-2, 0.1), (1e-7, 1e-3)];
/// Newton steps.
const STEPS: usize = 10;
/// A step this small (radians) leaves an error of its square.
const SETTLED: f64 = 1e-8;
/// A flat face lies this flat on another (radians).
const FLAT: f64 = 1e-9;
/// How far before or after what is left of the step a time is looked for.
const ASTRAY: f64 = 0.5;
/// Gap, in sizes of the pair, below which features are looked at closely.
const NEAR: f64 = 0.01;
/// Gap that the direction may leave at the time of contact, in sizes of the pair.
const CLOSED: f64 = 1e-13;

/// A pair of which one body turns at least.
pub struct Turning<'a> {
    pair: &'a PrimitivePair<'a>,
    turns: Turns,
    /// As they stand at the start.
    parts: [ConvexPart<'a>; 2],
    /// World from model at the start.
    models: [DMat3; 2],
    pace: Pace,
    /// Farthest points from the centres of rotation, together.
    reach: f64,
}

impl<'a> Turning<'a> {
    /// The pair, where it is one for this, by how its bodies turn.
    pub fn new(start: &'a Start<'a>, spins: [DVec3; 2]) -> Option<Self> {
        let Start { pair, axes: models, frames: axes, .. } = *start;
        let parts = [ConvexPart::new(pair.primitives[0], axes[0])?, ConvexPart::new(pair.primitives[1], axes[1])?];
        let turns = Turns::new(pair, axes, spins);
        let rho = |k: usize| {
            let p = pair.primitives[k];
            let from = p.ball.center - p.frame.position;
            let center = if from == DVec3::ZERO { pair.offsets[k] } else { pair.offsets[k] + models[k] * from };
            center.length() + p.ball.radius
        };
        let (rho, [wa, wb]) = ([rho(0), rho(1)], turns.rates);
        let pace = Pace {
            speed: pair.velocity.length() + wa * rho[0] + wb * rho[1],
            pull: wa * wa * rho[0] + wb * wb * rho[1],
            least: excluded(pair.delta, pair.rounding),
        };
        Some(Self { pair, turns, parts, models, pace, reach: rho[0] + rho[1] })
    }

    fn size(&self) -> f64 {
        self.parts[0].primitive.ball.radius + self.parts[1].primitive.ball.radius
    }

    /// φ along a unit direction.
    fn gap(&self, m: &Posed, n: DVec3) -> Gap {
        let shape = |k: usize| self.parts[k].primitive.shape.convex();
        let (a, b) = (shape(0), shape(1));
        Gap { t: m.t, n, phi: n.dot(m.way) - a.reach(&m.axes[0], n) - b.reach(&m.axes[1], -n) }
    }

    /// When the line from `way` on, passed at `velocity`, is nearest.
    fn nearest_time(&self, way: DVec3) -> f64 {
        let v = self.pair.velocity;
        let square = v.length_squared();
        if square > 0.0 { (way.dot(v) / square).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// True when the balls about the two centres of rotation that hold the bodies stay apart: these centres move straight.
    fn never_near(&self) -> bool {
        let way = self.turns.pivots;
        let nearest = way - self.pair.velocity * self.nearest_time(way);
        nearest.length() > self.reach + APART * self.pair.delta
    }

    /// The direction of nearest points at a time, and the gap along it.
    fn nearest(&self, m: &Posed, first: DVec3, good: f64) -> Option<Gap> {
        let [a, b] = [0, 1].map(|k| &self.parts[k].primitive.shape);
        let a = ConvexBody::new(a, m.axes[0], DVec3::ZERO)?;
        let b = ConvexBody::new(b, m.axes[1], m.way)?;
        Some(self.gap(m, nearest(&a, &b, first, good)?.normal))
    }

    /// Fills in the earliest contact, or leaves `out` clear; `None` leaves the pair to others. `first` separates the bodies at
    /// the start.
    pub fn meet(&self, first: DVec3, query_options: QueryOptions, out: &mut Outcome) -> Option<()> {
        if self.never_near() {
            return Some(());
        }
        let (start, end) = (self.turns.at(0.0), self.turns.at(1.0));
        let mut here = self.gap(&start, first.normalize());
        if here.phi.is_nan() || here.phi <= APART * self.pair.delta {
            return None;
        }
        let last = self.gap(&end, here.n);
        if self.pace.proven(&here, &last) >= 1.0 {
            return Some(());
        }
        if self.passes(&start, &end, out) {
            return Some(());
        }
        let mut t = self.advance(&here, &last);
        let mut contact: Option<(Touch, Gap)> = None;
        for round in 0..ROUNDS {
            if t <= here.t && round > 0 {
                return None;
            }
            let m = self.turns.at(t);
            out.counters.closed_forms += 1;
            here = self.nearest(&m, here.n, TRIES[0].0)?;
            if here.phi <= self.pace.least {
                return None;
            }
            let last = self.gap(&end, here.n);
            if contact.is_none() && self.pace.proven(&here, &last) >= 1.0 {
                return Some(());
            }
            if contact.is_none() {
                let tried = self.contact(&m, here.n, TRIES[0].1, out);
                contact = tried.0;
                // Features that only seem to meet from so far: what is shown along the exact direction?
                if contact.is_none() && (tried.1 || here.phi <= NEAR * self.size()) {
                    out.counters.closed_forms += 1;
                    if let Some(exact) = self.nearest(&m, here.n, TRIES[1].0) {
                        contact = self.contact(&m, exact.n, TRIES[1].1, out).0;
                    }
                }
            }
            let Some((touch, goal)) = &contact else {
                t = self.advance(&here, &last);
                continue;
            };
            if !query_options.time() {
                touch.report_hit(t.max(f64::MIN_POSITIVE), out);
                return Some(());
            }
            // With the contact's own normal, which needs one gap more.
            let fixed = self.gap(&m, goal.n);
            let proven = fixed.phi > self.pace.least && self.pace.proven(&fixed, goal) >= goal.t;
            if proven || self.pace.prove(here, *goal, |t, n| self.gap(&self.turns.at(t), n)) >= goal.t {
                touch.report(self.pair, query_options, out);
                return Some(());
            }
            t = self.advance(&here, &last);
        }
        None
    }

    /// True when a direction at the time at which the centres are nearest keeps the bodies apart over the whole step.
    fn passes(&self, start: &Posed, end: &Posed, out: &mut Outcome) -> bool {
        let m = self.turns.at(self.nearest_time(start.way));
        let Some(way) = m.way.try_normalize() else { return false };
        let frees = |here: &Gap| {
            let (first, last) = (self.gap(start, here.n), self.gap(end, here.n));
            let free = here.phi.min(first.phi) > self.pace.least;
            free && self.pace.proven(&first, here) >= m.t && self.pace.proven(here, &last) >= 1.0
        };
        let here = self.gap(&m, way);
        if here.phi <= self.pace.least {
            return false;
        }
        if frees(&here) {
            return true;
        }
        out.counters.closed_forms += 1;
        self.nearest(&m, way, TRIES[0].0).is_some_and(|exact| frees(&exact))
    }

    /// Up to where a direction proves the bodies apart, given its gaps at two times: a nearer end tightens the bound.
    fn advance(&self, here: &Gap, last: &Gap) -> f64 {
        let mut until = here.t;
        let mut end = *last;
        for _ in 0..6 {
            let proven = self.pace.proven(here, &end);
            until = until.max(proven);
            if proven >= end.t || proven - here.t > 0.25 * (end.t - here.t) {
                break;
            }
            let nearer = here.t + 2.0 * (proven - here.t);
            if nearer <= here.t {
                break;
            }
            end = self.gap(&self.turns.at(nearer), here.n);
        }
        until
    }

    /// A contact after a time, from a direction then, and the gap at it; beside it, whether there was one to be confirmed.
    fn contact(&self, m: &Posed, n: DVec3, tol: f64, out: &mut Outcome) -> (Option<(Touch, Gap)>, bool) {
        out.counters.newton += 1;
        let Some((n, t, shown)) = self.settle(m, n, tol).filter(|found| m.t < found.1 && found.1 <= 1.0) else {
            return (None, false);
        };
        let confirmed = Stand::new(self.pair, self.parts, self.models, Some(&self.turns)).confirm(n, t, &shown);
        let found = confirmed.and_then(|touch| {
            let goal = self.gap(&self.turns.at(touch.t), n);
            let closed = goal.phi > self.pace.least && goal.phi.abs() <= CLOSED * self.size();
            closed.then_some((touch, goal))
        });
        (found, true)
    }

    /// The direction and the time of a contact near those at hand, with the features that meet; a unit vector.
    fn settle(&self, m: &Posed, mut n: DVec3, tol: f64) -> Option<(DVec3, f64, [Shown; 2])> {
        let from = m.t;
        let mut m = *m;
        let mut parts = self.parts;
        (parts[0].axes, parts[1].axes) = (m.axes[0], m.axes[1]);
        let [spin_a, spin_b] = self.turns.spins;
        let mut held = [parts[0].held(n, tol), parts[1].held(-n, tol)];
        let flat = held.iter().position(|h| h.1).map(|k| {
            let l = parts[k].axes.transpose() * n;
            let axis = l.abs().max_position();
            (k, axis, l[axis].signum())
        });
        let size = self.size();
        let mut settled = false;
        for _ in 0..STEPS {
            if let Some((k, axis, sign)) = flat {
                n = (parts[k].axes.col(axis) * sign).normalize();
                held[1 - k] = parts[1 - k].held(if k == 0 { -n } else { n }, FLAT);
            }
            let shown = [parts[0].shown(n, held[0]), parts[1].shown(-n, held[1])];
            if settled {
                return Some((n, m.t, shown));
            }
            let d = m.way + shown[1].ends[0] - shown[0].ends[0];
            let phi = n.dot(d);
            // Of the points that are shown, and of which points these are.
            let arms = [m.offsets[0] + shown[0].ends[0], m.offsets[1] + shown[1].ends[0]];
            let moves = spin_b.cross(arms[1]) - spin_a.cross(arms[0]) - self.pair.velocity;
            let drift = n.dot(moves);
            // Direction as a function of the time's step τ: first + second τ.
            let (first, second) = match flat {
                Some((k, ..)) => (DVec3::ZERO, self.turns.spins[k].cross(n)),
                None => steer(&parts, &held, &shown, n, (d, phi), moves, self.turns.spins)?,
            };
            let closing = drift + d.dot(second);
            let tau = -(phi + d.dot(first)) / closing;
            // Steps that lead far are cut; where the gap widens there is nothing to meet.
            let tau = tau.clamp(-ASTRAY, ASTRAY);
            if closing >= 0.0 || tau.is_nan() {
                return None;
            }
            let step = first + second * tau;
            let long = step.length();
            if !long.is_finite() {
                return None;
            }
            let step = if long > 0.5 { step * (0.5 / long) } else { step };
            n = (n + step).normalize();
            let t = m.t + tau;
            if !(from - ASTRAY..=1.0 + ASTRAY).contains(&t) {
                return None;
            }
            m = self.turns.at(t);
            (parts[0].axes, parts[1].axes) = (m.axes[0], m.axes[1]);
            settled = long <= SETTLED && tau.abs() * self.pace.speed <= SETTLED * size;
        }
        None
    }
}

#[cfg(test)]
mod tests;
