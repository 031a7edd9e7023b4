//! From a guess to a confirmed contact.
//!
//! Newton solves for the contact that some faces point to (`newton`), the set of faces is mended by what the trees say, and
//! nothing counts before both whole trees confirm it at depth delta. From there it is continued back to where the surfaces
//! touch (`touch`). Of several the earliest is kept, and of those in one bracket the one that touches first.
//! Kernels and search ask for contacts and use their time; they never believe one that is not confirmed here.

use super::found::{Ending, Found, SAME_POINT, SAME_TIME};
use super::known::Known;
use super::newton::{Actives, Constraint, Problem, SETTLED, Solution, Weights};
use super::sides::{deciding, has_both_sides};
use super::touch::Touch;
use crate::bound::CollisionRegion;
use crate::contact::exclusion::clause::Hint;
use crate::contact::exclusion::literal::Side;
use crate::contact::query::outcome::Counters;
use crate::contact::query::task::{Task, witness_level};
use crate::solid::Sense;
use glam::DVec3;
use smallvec::SmallVec;
use std::sync::Arc;

/// Points kept at which curved faces are touched.
const MAX_HINTS: usize = 8;

/// Roundings before a crossing that are left unproven. Those of a bound are nearly as many: with fewer left than it takes, each cell
/// along a rim or a line that is touched at once would have to become as small as rounding lets its bounds be.
const RESERVE: f64 = 8.0;

/// Where Newton starts: faces with their multipliers, a point of A's frame, a time.
#[derive(Clone, Debug)]
pub struct Guess {
    /// The faces that hold the contact.
    pub active: Vec<Constraint>,
    /// Near the contact.
    pub x: DVec3,
    /// About when, a fraction of the step.
    pub t: f64,
    /// One each for `active`.
    pub lambda: Vec<f64>,
}

/// From where Newton has been started without a contact: from there it comes to none again, so long as none is found elsewhere. Faces
/// that enter and leave in turn lead there, and so do guesses of one cell.
#[derive(Debug, Default)]
pub struct Visited(Vec<(Actives, Weights, DVec3, f64)>);

impl Visited {
    /// Adds a start; true when it was there.
    fn has(&mut self, active: &[Constraint], lambda: &[f64], x: DVec3, t: f64) -> bool {
        let is_there = self.0.iter().any(|v| (&v.0[..], &v.1[..], v.2, v.3) == (active, lambda, x, t));
        if !is_there {
            self.0.push((active.into(), lambda.into(), x, t));
        }
        is_there
    }
}

/// The contacts of a task that were confirmed so far, of which the one to report is kept.
pub struct Contacts<'a> {
    /// What is searched.
    pub task: Task<'a>,
    /// The contact to report, as far as is known.
    pub found: Option<Found>,
    /// Where the curved convex faces of contacts are touched.
    pub hints: SmallVec<[Hint; MAX_HINTS]>,
    /// Nothing happens before it: how far a search has come.
    pub now: f64,
    /// The last guess has led to the contact that is known already.
    pub again: bool,
    /// Work done so far.
    pub counters: Counters,
    /// The collision region of the whole step, once it was asked for; within: `None` where nothing can meet.
    region: Option<Option<Arc<CollisionRegion>>>,
}

impl<'a> Contacts<'a> {
    /// None so far.
    pub fn new(task: Task<'a>) -> Self {
        let counters = Counters::default();
        Self { task, found: None, hints: SmallVec::new(), now: 0.0, again: false, counters, region: None }
    }

    /// What of both bodies can take part over [t0, t1], by stage 1; `None` where nothing can meet. That of the whole step is located
    /// once, whoever asks.
    pub fn region(&mut self, t0: f64, t1: f64) -> Option<Arc<CollisionRegion>> {
        if (t0, t1) == (0.0, 1.0) {
            return self.region.get_or_insert_with(|| self.task.region(t0, t1)).clone();
        }
        self.task.region(t0, t1)
    }

    /// Time until which everything must be proven free; infinite without a contact.
    pub fn goal(&self) -> f64 {
        self.found.as_ref().map_or(f64::INFINITY, |f| f.goal - self.task.proof_slack)
    }

    /// Time until which a rival of the contact found may come; the goal or later.
    pub fn horizon(&self) -> f64 {
        self.found.as_ref().map_or(f64::INFINITY, |f| f.latest_rival().max(f.goal))
    }

    /// When the witness of another contact must have come to count: that of a rival, which may touch first, comes a little later.
    fn latest(&self) -> f64 {
        match &self.found {
            Some(found) if found.deep.stationarity < SETTLED => found.latest_rival(),
            _ => self.goal(),
        }
    }

    /// The end: with the contact that is known, or without.
    pub fn end(&mut self) -> Ending {
        self.found.take().map_or(Ending::Clear, Ending::Contact)
    }

    /// The end with the contact that is known, where nothing is met before `proven`, which may leave a wider bracket than the goal.
    pub fn end_from(&mut self, proven: f64) -> Option<Ending> {
        let found = self.found.take()?;
        Some(Ending::Contact(Found { goal: proven.min(found.goal), ..found }))
    }

    /// The end of a question that asks for a hit alone, once a contact is known; nothing is met before `proven`. Only where
    /// the start is known to be free.
    pub fn hit(&mut self, proven: f64) -> Option<Ending> {
        if self.task.query_options.time() {
            return None;
        }
        let found = self.found.take()?;
        Some(Ending::Contact(Found { goal: proven.max(found.goal), ..found }))
    }

    /// Newton from a guess of a kernel in front of the search, which needs no stage 2: true when a contact was confirmed. With
    /// `mend` an active set that does not hold is mended as the search does it, which costs many times more. A guess that leads
    /// nowhere is given up early: the kernel's next one is from nearer.
    pub(in crate::contact) fn confirm(
        &mut self,
        active: Actives,
        x: DVec3,
        t: f64,
        lambda: Weights,
        mend: bool,
    ) -> bool {
        if !has_both_sides(&active) {
            return false;
        }
        self.counters.newton += 1;
        match Problem::of(&self.task).refine(
            &active,
            x,
            t,
            lambda.clone(),
            witness_level(self.task.delta, self.task.rounding),
        ) {
            Ok(s) if !(0.0..=1.0).contains(&s.t) || s.t >= self.latest() => false,
            Ok(s) if self.is_found(&s) => true,
            Ok(s) => {
                let at = self.task.relative.at(s.t);
                let holds = |(c, l): (&Constraint, &f64)| matches!(c, Constraint::Apex(..)) || *l >= -1e-9;
                if s.active.iter().zip(&s.lambda).all(holds) && self.task.is_deep(s.x, &at, self.task.rounding) {
                    Problem::of(&self.task).holds_at_apexes(&s, &at) && self.accept(Known::All, s)
                } else {
                    mend && self.mend(active, s.x, s.t, s.lambda)
                }
            }
            // A line or patch of contacts leaves x open: where the guess' multipliers hold, the surfaces alone tell the rest.
            Err(true) => match Problem::of(&self.task).along(
                &active,
                x,
                t,
                lambda.clone(),
                witness_level(self.task.delta, self.task.rounding),
            ) {
                Some(s) if (0.0..=1.0).contains(&s.t) && s.t < self.latest() && s.stationarity < SETTLED => {
                    let at = self.task.relative.at(s.t);
                    if self.task.is_deep(s.x, &at, self.task.rounding) {
                        Problem::of(&self.task).holds_at_apexes(&s, &at) && self.accept(Known::All, s)
                    } else {
                        mend && self.mend(active, x, t, lambda)
                    }
                }
                // What turns into a line of contact has other multipliers there.
                _ => (mend || self.task.relative.turns()) && self.mend(active, x, t, lambda),
            },
            Err(false) => false,
        }
    }

    /// Newton from a kernel's guess whose faces do not hold.
    fn mend(&mut self, active: Actives, x: DVec3, t: f64, lambda: Weights) -> bool {
        self.polish(Known::All, false, Guess { active: active.into_vec(), x, t, lambda: lambda.into_vec() })
    }

    /// The unit normal of a solution, from A, along A's axes.
    pub(in crate::contact) fn normal(&self, s: &Solution) -> Option<DVec3> {
        let at = self.task.relative.at(s.t);
        let problem = Problem::of(&self.task);
        let mut sum = DVec3::ZERO;
        for (c, l) in s.active.iter().zip(&s.lambda) {
            let (Constraint::Literal(side, _) | Constraint::Apex(side, _, _)) = *c;
            let sign = if side == Side::A { *l } else { -*l };
            sum += problem.row(c, s.x, &at, 0.0).gradient * sign;
        }
        sum.try_normalize()
    }

    /// Newton from a guess, patient or not, with the active set mended by what the trees say; true when a contact with settled
    /// multipliers was confirmed.
    pub fn polish(&mut self, known: Known, patient: bool, guess: Guess) -> bool {
        self.polish_beside(&mut Visited::default(), known, patient, guess)
    }

    /// The same for one of several guesses that are no less patient, after those that `visited` has seen come to nothing.
    pub fn polish_beside(&mut self, visited: &mut Visited, known: Known, patient: bool, guess: Guess) -> bool {
        let Guess { mut active, x, t, mut lambda } = guess;
        self.again = false;
        let level = witness_level(self.task.delta, self.task.rounding);
        for _ in 0..7 {
            debug_assert!(
                active.iter().all(|c| known.holds(&self.task, c)),
                "stage 3 asks for a primitive that stage 2 has not handed over: {active:?}"
            );
            if visited.has(&active, &lambda, x, t) {
                return false;
            }
            self.counters.newton += 1;
            let Some(s) = Problem::of(&self.task).solve(&active, x, t, &lambda, level, patient) else { return false };
            // Where only an unsettled witness is known, a settled one of the same time is still worth having.
            let settled = self.found.as_ref().is_none_or(|f| f.deep.stationarity < SETTLED);
            let latest = match &self.found {
                Some(f) if settled => f.latest_rival(),
                _ => self.goal() + SAME_TIME,
            };
            self.again = self.is_found(&s);
            if s.t < 0.0 || s.t > 1.0 || s.t >= latest || self.again {
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
            if self.task.is_deep(s.x, &at, self.task.rounding) {
                return Problem::of(&self.task).holds_at_apexes(&s, &at) && self.accept(known, s);
            }
            // Something else decides there: it enters, the smallest multiplier leaves. A primitive that the walk has not
            // handed over is not asked.
            let entering = deciding(&self.task, s.x, &at);
            if active.contains(&entering) || !known.holds(&self.task, &entering) {
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

    /// True for the contact that is known already.
    fn is_found(&self, s: &Solution) -> bool {
        self.found.as_ref().is_some_and(|f| {
            f.deep.stationarity < SETTLED
                && (f.deep.t - s.t).abs() <= SAME_TIME
                && (f.deep.x - s.x).length() <= SAME_POINT * self.task.scale
        })
    }

    /// Remembers where the curved convex faces of a solution are touched.
    fn hint(&mut self, s: &Solution) {
        let at = self.task.relative.at(s.t);
        for c in &s.active {
            let Some((side, id)) = c.literal() else { continue };
            let (solid, point) = if side == Side::A { (self.task.a, s.x) } else { (self.task.b, at.b_point(s.x)) };
            if id.sense() == Sense::Negative || solid.faces[id.face() as usize].is_flat() {
                continue;
            }
            if self.hints.len() == MAX_HINTS {
                self.hints.remove(0);
            }
            self.hints.push(Hint { side, id, point });
        }
    }

    /// Keeps a confirmed witness if it is the earliest; continues it back to the touch.
    pub(super) fn accept(&mut self, known: Known, deep: Solution) -> bool {
        self.hint(&deep);
        if !self.task.query_options.time() {
            // A witness is all of a hit, once the start is known to be free: what is left to refine is what lies there.
            let goal = self.now.max(f64::MIN_POSITIVE);
            self.found = Some(Found { upper: deep.t, witness: deep.x, deep, touch: None, goal, seen: None });
            return true;
        }
        let settled = deep.stationarity < SETTLED;
        if !settled {
            // A witness, but an earlier one lies beside it: everything before it is still searched, and so is the start.
            let goal = deep.t.max(f64::MIN_POSITIVE);
            if goal < self.goal() {
                self.found = Some(Found { upper: deep.t, witness: deep.x, deep, touch: None, goal, seen: None });
            }
            return false;
        }
        let problem = Problem::of(&self.task);
        let back = Touch::new(&self.task, known);
        let touch = back.of(&deep);
        let seen = back.seen();
        let at = self.task.relative.at(deep.t);
        let rates = deep.active.iter().zip(&deep.lambda).map(|(c, l)| l * problem.row(c, deep.x, &at, 0.0).rate);
        let speed = rates.sum::<f64>().abs().max(f64::MIN_POSITIVE);
        // The depth delta itself is reached a little before the witness, which a slow pair takes its time for.
        let crossing = deep.t - (witness_level(self.task.delta, self.task.rounding) - self.task.delta) / speed;
        // Rounding forbids to prove what is nearer to the crossing.
        let reserve = RESERVE * self.task.rounding / speed;
        let goal = match &touch {
            Some(s) if s.t > 0.0 => 0.5 * (s.t + deep.t),
            // Touching at the start: nothing but the start needs a proof.
            Some(_) => (0.5 * crossing).min(crossing - reserve),
            None => crossing - (0.25 * self.task.delta / speed).clamp(1e-15, 1e-9).max(reserve),
        };
        let goal = goal.max(f64::MIN_POSITIVE);
        let new = Found { upper: deep.t, witness: deep.x, deep, touch, goal, seen };
        self.found = Some(match self.found.take() {
            // One that has not settled is only a bound on the time.
            Some(old) if old.deep.stationarity >= SETTLED => {
                let (upper, witness) = new.earlier_witness(&old);
                Found { upper, witness, goal: new.goal.min(old.goal), ..new }
            }
            Some(old) => old.or(new),
            None => new,
        });
        true
    }
}
