//! A witness where the bounds have come to, when a search does not end by itself.
//!
//! As a rule the bounds of a cell point to the contact. In a tight fit they point nowhere in particular: what holds the
//! cells back are two like faces, and where between them the bodies first come delta deep is open. Then the deepest
//! common point is climbed to (`depth`), at times ever later than what is proven, until one is deep enough; from there
//! Newton finds the contact as from any other guess. Where it has none to find, the point itself is the witness: the
//! earliest time at which the climb ends that deep is found by halving, and climbs lead back from there to where the
//! surfaces touch (`retreat`).
//!
//! Either way the whole trees confirm the point, and everything before the goal must still be proven. A search that takes
//! too long for that ends with what it has: the time proven and the witness bracket the contact.

use super::contacts::{Contacts, Guess};
use super::found::{Ending, Found};
use super::known::Known;
use super::newton::{Actives, Constraint, MAX_ACTIVE, SETTLED, Solution, Weights};
use super::retreat::{Climber, held};
use super::sides::has_both_sides;
use super::touch::Touch;
use crate::contact::exclusion::literal::Side;
use crate::contact::instant::within::{Within, within};
use crate::contact::instant::work::Work;
use crate::contact::instant::{depth, separation};
use crate::contact::query::task::witness_level;
use crate::solid::local::LiteralId;
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
    let task = contacts.task;
    // No more than the search itself has cost so far.
    let climber = Climber::new(&task, contacts.counters.cells.max(LEAST_WORK));
    let climb = |t: f64, x: DVec3| climber.deepest(t, x);
    let (mut before, mut x, mut part) = (t0, x0, NEAREST);
    let mut hit = loop {
        let t = t0 + (end - t0) * part.min(1.0);
        if t > before {
            let (y, depth, support) = climb(t, x);
            x = y;
            if depth >= enough {
                break Some((t, y, support));
            }
            before = t;
        }
        if part >= 1.0 || climber.is_spent() {
            break None;
        }
        part *= FURTHER;
    };
    let mut rounds = 0;
    while let Some((t, y, _)) = hit.as_ref().filter(|_| rounds < FINE && !climber.is_spent()) {
        let middle = 0.5 * (before + t);
        if middle <= before || middle >= *t {
            break;
        }
        let (z, depth, support) = climb(middle, *y);
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
        keep(contacts, (t, x, &support), &climber);
    }
    contacts.counters.cells += climber.cells();
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

/// Keeps a deep point as the witness, with the touch that it comes from.
fn keep(contacts: &mut Contacts, (t, x, support): (f64, DVec3, &[(Side, LiteralId, f64)]), climber: &Climber) {
    let at = contacts.task.relative.at(t);
    if t >= contacts.goal() || !contacts.task.is_deep(x, &at, 0.0) {
        return;
    }
    let (active, lambda) = held(support).unzip();
    let deep = Solution { x, t, active, lambda, stationarity: 0.5 * SETTLED };
    let touch = Touch::new(&contacts.task, Known::All).back(&deep, climber);
    let goal = (0.5 * (touch.as_ref().map_or(t, |s| s.t) + t)).max(f64::MIN_POSITIVE);
    contacts.found = Some(Found { deep, touch, goal, upper: t, witness: x, seen: None });
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
