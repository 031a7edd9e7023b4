//! How far apart a pair is, and until when it stays so: what coherence over steps rests on.
//!
//! The search decides whether a point comes `delta` deep into both bodies. With a negative depth −g it decides whether
//! max(f_A, f_B) <= g anywhere: what it then proves free stays free when the bodies leave the motion it was proven for. A
//! body that is displaced by at most d (every point that matters) changes its f by no more than d, f being 1-Lipschitz;
//! so bodies displaced by d_A and d_B do not meet while d_A + d_B < 2g: a common point x would lie within (d_A + d_B)/2 of
//! both undisplaced bodies, halfway between where x lies in the one and in the other.

use super::direct::Convex;
use super::outcome::Counters;
use super::pair::{Body, PairQuery, PairSearch};
use super::region;
use super::search::{Ending, Scratch, Search};
use super::separation::{self, Within};
use super::task::Task;
use super::work::Work;
use crate::math::tolerance::WIDE_MARGIN;
use crate::motion::Placed;
use contactd_proto::Motion;

/// A proof that a pair keeps a distance over a motion.
#[derive(Clone, Copy, Debug)]
pub struct Kept {
    /// Time, fraction of the motion, until which it does; 0 when nothing was proven.
    pub until: f64,
    /// By how much the bodies may be displaced together until then before they can be within `touch` of each other.
    pub room: f64,
    /// Work done.
    pub counters: Counters,
}

/// Primitives of both trees from which on a pair is searched by its octrees.
const MANY: usize = 12;

/// The touching distance of a pair: 2 delta, or the margin that is asked for.
fn touch(task: &Task, margin: f64) -> f64 {
    margin.max(2.0 * task.delta)
}

/// Up to which distance from their surfaces a search knows of both bodies. Trees of many primitives need their octrees,
/// which know less of what is far from a surface.
fn reach(task: &Task) -> f64 {
    let (a, b) = (task.model_a, task.model_b);
    if a.solid.primitives.len() + b.solid.primitives.len() > MANY {
        a.margin().min(b.margin())
    } else {
        a.radius.min(b.radius) * WIDE_MARGIN
    }
}

/// A lower bound of the distance of two whole convex primitives at the start of the motion, less their touching
/// distance (`margin`, at least 2 delta); `None` for anything else. A length; negative when they may touch.
pub fn room(query: &PairQuery, margin: f64) -> Option<f64> {
    let (task, _) = PairSearch::task(query);
    Some(Convex::new(task)?.distance() - touch(&task, margin) - 8.0 * task.rounding)
}

/// Until when a pair keeps its surfaces a distance apart that leaves `room` (a length) for displacements, or as much of it
/// as the models' bounds can tell. The query's limit bounds the work; what was proven when it ran out counts. What comes
/// within `lead` (fraction of the motion) of the end of that time need not be told exactly.
pub fn keep(query: &PairQuery, margin: f64, room: f64, lead: f64, scratch: &mut Scratch) -> Kept {
    let (mut task, _) = PairSearch::task(query);
    if let Some(pair) = Convex::new(task) {
        let (until, count) = pair.keeps(room + touch(&task, margin) + 8.0 * task.rounding);
        return Kept { until, room, counters: Counters { closed_forms: count, ..Counters::default() } };
    }
    // Half of the distance on either side, with more than rounding to spare.
    let wanted = 0.5 * (room + touch(&task, margin)) * (1.0 + 1e-9) + 8.0 * task.rounding;
    let level = wanted.min(0.99 * reach(&task));
    let room = room.min(2.0 * (level - 8.0 * task.rounding) * (1.0 - 2e-9) - touch(&task, margin));
    if !(room > 0.0 && level.is_finite()) {
        return Kept { until: 0.0, room, counters: Counters::default() };
    }
    task.delta = -level;
    task.lead = lead;
    task.ideas.fits &= level < task.fits_below();
    let (a, b) = (task.a, task.b);
    let mut search = Search::new(task, std::mem::take(scratch));
    if !a.is_empty() && !b.is_empty() {
        search.start();
    }
    let until = match search.run(f64::INFINITY) {
        Some(Ending::Clear) | None => 1.0,
        Some(Ending::Contact(found)) => (found.goal - lead).max(0.0),
        Some(Ending::Limit(t) | Ending::Rounding(t)) => t,
        Some(Ending::Deep(_)) => 0.0,
    };
    let counters = search.counters;
    *scratch = search.into_scratch();
    Kept { until, room, counters }
}

/// A body that stays where its motion starts.
fn standing(body: Body<'_>) -> Body<'_> {
    let motion = Motion::resting(body.placed.motion.start);
    Body { placed: Placed { motion, ..body.placed }, ..body }
}

/// Whether the bodies of a question are within `distance` (a length) of each other at the start, proven or witnessed, and
/// the cells' worth of work that it took. Within the models' reach it is the search for a contact of that negative depth, of
/// bodies that stand still there; farther it covers the whole trees.
pub fn touching(query: &PairQuery, distance: f64) -> (Within, u64) {
    let still = PairQuery { a: standing(query.a), b: standing(query.b), ..*query };
    let (mut task, _) = PairSearch::task(&still);
    if task.a.is_empty() || task.b.is_empty() {
        return (Within::Apart, 0);
    }
    // Of two convex primitives the nearest points tell, where they are apart.
    if Convex::new(task).is_some_and(|c| c.distance() > distance + 8.0 * task.rounding) {
        return (Within::Apart, 0);
    }
    let level = 0.5 * distance;
    task.limit = task.limit.min(region::MOST_CELLS);
    if level > 0.99 * reach(&task) {
        let work = Work::new(task.limit);
        let within = separation::within(&task, &task.relative.at(0.0), level, &work);
        return (within, work.cells());
    }
    task.delta = -level;
    task.ideas.fits &= level < task.fits_below();
    let mut search = Search::new(task, Scratch::default());
    search.start();
    let within = match search.run(f64::INFINITY) {
        Some(Ending::Clear) | None => Within::Apart,
        Some(Ending::Deep(x)) => Within::Witness(x),
        Some(Ending::Contact(_) | Ending::Limit(_) | Ending::Rounding(_)) => Within::Open,
    };
    (within, search.counters.cells)
}
