//! A witness where the bounds have come to, when the search does not end by itself.
//!
//! As a rule the bounds of a cell point to the contact. In a tight fit they point nowhere in particular: what holds the cells
//! back are two like faces, and where between them the bodies first come delta deep is open. Then the deepest common point is
//! climbed to (`depth`), at times ever later than what is proven, until one is deep enough; from there Newton finds the
//! contact as from any other guess. Where it has none to find, the point itself is the witness: the earliest time at which
//! the climb ends that deep is found by halving, and so is the time at which the same climb ends on both surfaces.
//!
//! Either way the whole trees confirm the point, and everything before the goal must still be proven. A search that cannot
//! do that in `LAST` cells ends with what it has: the time proven and the witness bracket the contact.

use super::cell::Cell;
use super::propose::has_both_sides;
use super::search::Search;
use crate::contact::exclusion::fit;
use crate::contact::exclusion::literal::Side;
use crate::contact::instant::depth;
use crate::contact::instant::separation;
use crate::contact::instant::within::{Within, within};
use crate::contact::instant::work::Work;
use crate::contact::query::task::{Task, witness_level};
use crate::contact::witness::found::Ending;
use crate::contact::witness::found::Found;
use crate::contact::witness::newton::{Constraint, HELD, MAX_ACTIVE, SETTLED, Solution};
use crate::motion::Instant;
use crate::solid::local::{self, LiteralId};
use crate::solid::{Face, Sense, Solid};
use glam::DVec3;

/// Cells after which a witness and what is proven by then are the answer.
const LAST: u64 = 16_000;

/// A bracket this wide, a fraction of the step, is told where no coarser resolution has a narrower one.
const WIDE: f64 = 1e-3;

/// Cells' worth of work to prove that nothing is deep at the start.
const START: u64 = 20_000;

/// The first look ahead, a fraction of what is left of the step; how much further each of the next ones goes.
const NEAREST: f64 = 1e-14;
const FURTHER: f64 = 8.0;

/// Halvings of the time at which the climb ends deep enough: to 1e-6 of the look that found it, and where Newton finds nothing.
const COARSE: usize = 20;
const FINE: usize = 40;

/// A climb's end that is this many roundings deep lies on both surfaces.
const ON_SURFACE: f64 = 4.0;

/// How far from either surface the end of a climb may lie that is told as a touch, relative to the bodies. Where none lies so near the
/// witness alone is told (`Outcome::not_continued`).
const TOUCHES: f64 = 1e-11;

impl Search<'_> {
    /// Looks for a witness soon after a cell's time; an ending where nothing more is to be gained by further cells.
    pub(super) fn look_for_witness(&mut self, cell: &Cell) -> Option<Ending> {
        // Depths that are no depths, and what starts inside, are asked otherwise.
        if !self.task.continues() {
            return None;
        }
        self.probe(cell.t, cell.center);
        (self.counters.cells >= LAST).then(|| self.bracket_or_long(cell.t)).flatten()
    }

    /// The ending of a search whose patience is at its end: a witness not long after a cell's time, or none.
    pub(super) fn impatient(&mut self, cell: &Cell) -> Ending {
        let long = Ending::Long(cell.t, None);
        if !self.task.continues() {
            return long;
        }
        self.probe(cell.t, cell.center);
        self.bracket_or_long(cell.t).unwrap_or(long)
    }

    /// As `bracket`; where a coarser resolution may be tried, and may tell more, that is said.
    fn bracket_or_long(&mut self, proven: f64) -> Option<Ending> {
        match self.bracket(proven)? {
            Ending::Contact(found) if found.upper - proven > WIDE && self.patience < u64::MAX => {
                Some(Ending::Long(proven, Some(found)))
            }
            ending => Some(ending),
        }
    }

    /// The answer of a search that rounding has stopped: a witness behind what is proven.
    pub(in crate::contact) fn rescue(&mut self) -> Option<Ending> {
        let (t, x) = self.stuck.filter(|_| self.task.continues())?;
        self.probe(t, x);
        self.bracket(t)
    }

    /// The contact that is known, with nothing before `proven`; `None` without one, and where the start is not known to be
    /// free.
    fn bracket(&mut self, proven: f64) -> Option<Ending> {
        self.found.as_ref()?;
        if proven <= 0.0 {
            let at = self.task.relative.at(0.0);
            let work = Work::new(START);
            let free = within(&self.task, &at, -self.task.delta, &work);
            self.counters.cells += work.cells();
            match free {
                Within::Apart => {}
                Within::Witness(x) => return Some(Ending::Deep(x)),
                Within::Open => return None,
            }
        }
        let found = self.found.take()?;
        Some(Ending::Contact(Found { goal: proven.min(found.goal), ..found }))
    }

    /// Looks for a point of depth delta from `t0` on, near `x0` at first (A's frame); keeps it where it comes before what is
    /// known.
    fn probe(&mut self, t0: f64, x0: DVec3) {
        let end = self.goal().min(1.0);
        let enough = witness_level(self.task.delta, self.task.rounding);
        let work = Work::new(u64::MAX);
        let task = self.task;
        let fits = alike(&task);
        let climb = |enough: f64, t: f64, x: DVec3| {
            let at = task.relative.at(t);
            // Between two like faces the way along them is long and hardly leads down: where they part is told outright.
            let guesses = fits.iter().flat_map(|fit| fit.guesses(&task, &at, x));
            let value = |x: DVec3| separation::value(&task, &at, x);
            let (mut best, mut least) = (x, value(x));
            for guess in guesses {
                work.look(task.a.faces.len() + task.b.faces.len());
                let v = value(guess);
                if v < least {
                    (best, least) = (guess, v);
                }
            }
            depth::climb_to(enough, &task, &at, best, &work)
        };
        let (mut before, mut x, mut part) = (t0, x0, NEAREST);
        let mut hit = loop {
            let t = t0 + (end - t0) * part.min(1.0);
            if t > before {
                let (y, depth, support) = climb(f64::INFINITY, t, x);
                x = y;
                if depth >= enough {
                    break Some((t, y, support));
                }
                before = t;
            }
            if part >= 1.0 {
                break None;
            }
            part *= FURTHER;
        };
        let mut rounds = 0;
        while let Some((t, y, _)) = hit.as_ref().filter(|_| rounds < FINE) {
            let middle = 0.5 * (before + t);
            if middle <= before || middle >= *t {
                break;
            }
            let (z, depth, support) = climb(f64::INFINITY, middle, *y);
            if depth >= enough {
                hit = Some((middle, z, support));
            } else {
                before = middle;
            }
            rounds += 1;
            if rounds == COARSE
                && let Some((t, y, support)) = &hit
                && self.solve_for(*t, *y, support)
            {
                hit = None;
            }
        }
        if let Some((t, x, support)) = hit {
            self.keep(t, x, &support, &climb);
        }
        self.counters.cells += work.cells();
    }

    /// Newton from the literals that hold a deep point; true when it found a contact with settled multipliers.
    fn solve_for(&mut self, t: f64, x: DVec3, support: &[(Side, LiteralId, f64)]) -> bool {
        let (active, lambda): (Vec<_>, Vec<_>) = held(support).unzip();
        if !has_both_sides(&active) {
            return false;
        }
        // The trees name what decides: stage 2 is not asked.
        let all = std::mem::replace(&mut self.handed.all, true);
        let solved = self.polish_for(true, active, x, t, lambda);
        self.handed.all = all;
        solved
    }

    /// Keeps a deep point as the witness, and where the climb from it ends on both surfaces as the touch.
    fn keep(
        &mut self,
        t: f64,
        x: DVec3,
        support: &[(Side, LiteralId, f64)],
        climb: &impl Fn(f64, f64, DVec3) -> depth::Held,
    ) {
        let at = self.task.relative.at(t);
        if t >= self.goal() || !self.task.is_deep(x, &at, 0.0) {
            return;
        }
        let solution = |t: f64, x: DVec3, support: &[(Side, LiteralId, f64)]| {
            let (active, lambda) = held(support).unzip();
            Solution { x, t, active, lambda, stationarity: 0.5 * SETTLED }
        };
        let least = ON_SURFACE * self.task.rounding;
        // Back in ever longer ways until the bodies are apart, then to where they part.
        let (mut meets, mut apart, mut way) = ((t, x, support.to_vec()), None, 1e-12 + f64::EPSILON * t);
        while meets.0 > 0.0 && apart.is_none() {
            let earlier = (t - way).max(0.0);
            let (y, depth, support) = climb(least, earlier, meets.1);
            if depth >= least {
                meets = (earlier, y, support)
            } else {
                apart = Some(earlier)
            }
            way *= FURTHER;
        }
        if let Some(mut apart) = apart {
            for _ in 0..FINE {
                let middle = 0.5 * (apart + meets.0);
                if middle <= apart || middle >= meets.0 {
                    break;
                }
                let (y, depth, support) = climb(least, middle, meets.1);
                if depth >= least { meets = (middle, y, support) } else { apart = middle }
            }
        }
        let on_both = support.iter().any(|s| s.0 == Side::A) && support.iter().any(|s| s.0 == Side::B);
        let touch = solution(meets.0, meets.1, if on_both { support } else { &meets.2 });
        let goal = (0.5 * (touch.t + t)).max(f64::MIN_POSITIVE);
        // The climb may end elsewhere a moment before: then it has come to no touch.
        let at = self.task.relative.at(touch.t);
        let values = [self.task.model_a.value(touch.x), self.task.model_b.value(at.b_point(touch.x))];
        let off = values[0].abs().max(values[1].abs());
        let touch = Some(touch).filter(|s| s.t == 0.0 || off <= TOUCHES * self.task.scale + 4.0 * least);
        self.found = Some(Found { deep: solution(t, x, support), touch, goal, upper: t, witness: x });
    }
}

/// A positive round face and a subtracted one of the other body.
struct Fit<'a> {
    side: Side,
    positive: &'a Face,
    negative: &'a Face,
}

/// Pairs of like faces that are looked at.
const FITS: usize = 16;

/// Heights on a positive face at which it may meet first, in radii of its body.
const HEIGHTS: [f64; 7] = [0.0, -1.0, -0.5, -0.25, 0.25, 0.5, 1.0];

impl Fit<'_> {
    /// Where the positive face is on the wall of the other one first, on several heights of both, beside `x`.
    fn guesses(&self, task: &Task, at: &Instant, x: DVec3) -> impl Iterator<Item = DVec3> {
        let axis = self.positive.axis().map_or(DVec3::ZERO, |axis| axis.direction);
        let (axis, radius) = match self.side {
            Side::A => (axis, task.model_a.radius),
            Side::B => (at.a_vector(axis), task.model_b.radius),
        };
        let heights = if axis == DVec3::ZERO { 1 } else { HEIGHTS.len() };
        HEIGHTS[..heights].iter().filter_map(move |h| {
            fit::first_off_axis(at, (self.side, self.positive), self.negative, x + axis * (h * radius))
        })
    }
}

/// The pairs of faces that may fit into each other.
fn alike<'a>(task: &Task<'a>) -> Vec<Fit<'a>> {
    let round = |solid: &'a Solid, sense: Sense| -> Vec<&'a Face> {
        let mut ids: Vec<LiteralId> = local::literals(&solid.normal_form).filter(|id| id.sense() == sense).collect();
        ids.sort_unstable();
        ids.dedup();
        let faces = ids.into_iter().map(|id| &solid.faces[id.face() as usize]);
        faces.filter(|face| !face.is_flat()).take(FITS).collect()
    };
    let mut fits = Vec::new();
    for (side, own, other) in [(Side::A, task.a, task.b), (Side::B, task.b, task.a)] {
        let negative = round(other, Sense::Negative);
        for positive in round(own, Sense::Positive) {
            fits.extend(negative.iter().map(|negative| Fit { side, positive, negative }));
        }
    }
    fits.truncate(FITS);
    fits
}

/// The constraints of some literals with their weights, no more than a system may hold.
fn held(support: &[(Side, LiteralId, f64)]) -> impl Iterator<Item = (Constraint, f64)> {
    let total: f64 = support.iter().map(|s| s.2).sum();
    support.iter().take(MAX_ACTIVE.min(HELD)).map(move |s| (Constraint::Literal(s.0, s.1), s.2 / total))
}
