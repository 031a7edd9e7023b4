//! A witness where the bounds have come to, when a search does not end by itself.
//!
//! As a rule the bounds of a cell point to the contact. In a tight fit they point nowhere in particular: what holds the cells
//! back are two like faces, and where between them the bodies first come delta deep is open. Then the deepest common point is
//! climbed to (`depth`), at times ever later than what is proven, until one is deep enough; from there Newton finds the
//! contact as from any other guess. Where it has none to find, the point itself is the witness: the earliest time at which
//! the climb ends that deep is found by halving, and so is the time at which the same climb ends on both surfaces.
//!
//! Either way the whole trees confirm the point, and everything before the goal must still be proven. A search that takes
//! too long for that ends with what it has: the time proven and the witness bracket the contact.

use super::contacts::{Contacts, Guess};
use super::found::{Ending, Found};
use super::known::Known;
use super::newton::{Actives, Constraint, HELD, MAX_ACTIVE, SETTLED, Solution, Weights};
use super::sides::has_both_sides;
use crate::contact::exclusion::fit;
use crate::contact::exclusion::literal::Side;
use crate::contact::instant::within::{Within, within};
use crate::contact::instant::work::Work;
use crate::contact::instant::{depth, separation};
use crate::contact::query::task::{Task, witness_level};
use crate::motion::Instant;
use crate::solid::local::{self, LiteralId};
use crate::solid::{Face, Sense, Solid};
use glam::DVec3;

/// Cells' worth of work to prove that nothing is deep at the start.
const START: u64 = 20_000;

/// Cells' worth of work that any look for a witness may take.
const LEAST_WORK: u64 = 2_000;

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

/// When a witness is first looked for beside a point, a part of the step; ten times later each time after …
const FIRST_WAIT: f64 = 1e-12;
/// … as often.
const LATER: i32 = 11;

/// The contact that is known, with nothing before `proven`; `None` without one, and where the start is not known to be
/// free.
pub fn bracket(contacts: &mut Contacts, proven: f64) -> Option<Ending> {
    contacts.found.as_ref()?;
    if proven <= 0.0 {
        let at = contacts.task.relative.at(0.0);
        let work = Work::new(START);
        let free = within(&contacts.task, &at, -contacts.task.delta, &work);
        contacts.counters.cells += work.cells();
        match free {
            Within::Apart => {}
            Within::Witness(x) => return Some(Ending::Deep(x)),
            Within::Open => return None,
        }
    }
    contacts.end_from(proven)
}

/// Looks for a point of depth delta from `t0` on, near `x0` at first (A's frame); keeps it where it comes before what is
/// known.
pub fn probe(contacts: &mut Contacts, t0: f64, x0: DVec3) {
    let end = contacts.goal().min(1.0);
    let enough = witness_level(contacts.task.delta, contacts.task.rounding);
    // No more than the search itself has cost so far.
    let work = Work::new(contacts.counters.cells.max(LEAST_WORK));
    let task = contacts.task;
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
        if part >= 1.0 || work.is_spent() {
            break None;
        }
        part *= FURTHER;
    };
    let mut rounds = 0;
    while let Some((t, y, _)) = hit.as_ref().filter(|_| rounds < FINE && !work.is_spent()) {
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
            && solve_for(contacts, *t, *y, support)
        {
            hit = None;
        }
    }
    if let Some((t, x, support)) = hit {
        keep(contacts, t, x, &support, &climb);
    }
    contacts.counters.cells += work.cells();
}

/// Newton from the literals that hold a deep point; true when it found a contact with settled multipliers.
fn solve_for(contacts: &mut Contacts, t: f64, x: DVec3, support: &[(Side, LiteralId, f64)]) -> bool {
    let (active, lambda): (Vec<_>, Vec<_>) = held(support).unzip();
    if !has_both_sides(&active) {
        return false;
    }
    // The trees name what decides: stage 2 is not asked.
    contacts.polish(Known::All, true, Guess { active, x, t, lambda })
}

/// Keeps a deep point as the witness, and where the climb from it ends on both surfaces as the touch.
fn keep(
    contacts: &mut Contacts,
    t: f64,
    x: DVec3,
    support: &[(Side, LiteralId, f64)],
    climb: &impl Fn(f64, f64, DVec3) -> depth::Held,
) {
    let at = contacts.task.relative.at(t);
    if t >= contacts.goal() || !contacts.task.is_deep(x, &at, 0.0) {
        return;
    }
    let solution = |t: f64, x: DVec3, support: &[(Side, LiteralId, f64)]| {
        let (active, lambda) = held(support).unzip();
        Solution { x, t, active, lambda, stationarity: 0.5 * SETTLED }
    };
    let least = ON_SURFACE * contacts.task.rounding;
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
    let at = contacts.task.relative.at(touch.t);
    let values = [contacts.task.model_a.value(touch.x), contacts.task.model_b.value(at.b_point(touch.x))];
    let off = values[0].abs().max(values[1].abs());
    let touch = Some(touch).filter(|s| s.t == 0.0 || off <= TOUCHES * contacts.task.scale + 4.0 * least);
    contacts.found = Some(Found { deep: solution(t, x, support), touch, goal, upper: t, witness: x });
}
/// Looks for a witness where the equations of a contact are too ill-conditioned to be solved, at the edge of a crescent: the
/// deepest common point beside x, a little later than `t`. What it tells is a bound on the time and no more: everything
/// before is still searched.
pub fn deepen(contacts: &mut Contacts, known: Known, x: DVec3, t: f64, support: &[(Side, LiteralId, f64)]) {
    let level = witness_level(contacts.task.delta, contacts.task.rounding) + contacts.task.rounding;
    let climbed = |later: f64| {
        let at = contacts.task.relative.at(later);
        let (x, ..) = depth::climb(&contacts.task, &at, x, &Work::new(u64::MAX));
        (separation::value(&contacts.task, &at, x) <= -level).then_some(x)
    };
    let (mut before, mut after) = (0.0, None);
    for k in 0..LATER {
        let wait = FIRST_WAIT * 10f64.powi(k);
        if t + wait > 1.0 {
            break;
        }
        if let Some(x) = climbed(t + wait) {
            after = Some((wait, x));
            break;
        }
        before = wait;
    }
    let Some((mut wait, mut deepest)) = after else { return };
    while wait > 1.1 * before + 1e-2 * FIRST_WAIT {
        let middle = 0.5 * (before + wait);
        match climbed(t + middle) {
            Some(x) => (wait, deepest) = (middle, x),
            None => before = middle,
        }
    }
    let total: f64 = support.iter().map(|l| l.2).sum();
    let active: Actives = support.iter().take(MAX_ACTIVE).map(|l| Constraint::Literal(l.0, l.1)).collect();
    let lambda: Weights = support.iter().take(MAX_ACTIVE).map(|l| l.2 / total).collect();
    // From so near the equations may still be solved.
    if has_both_sides(&active)
        && contacts.polish(
            known,
            true,
            Guess { active: active.to_vec(), x: deepest, t: t + wait, lambda: lambda.to_vec() },
        )
    {
        return;
    }
    let witness = Solution { x: deepest, t: t + wait, active, lambda, stationarity: f64::INFINITY };
    if contacts.task.is_deep(deepest, &contacts.task.relative.at(t + wait), contacts.task.rounding)
        && witness.t < contacts.goal()
    {
        contacts.accept(known, witness);
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
