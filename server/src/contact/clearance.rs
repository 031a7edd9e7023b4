//! How far apart a pair is, and until when it stays so: what coherence over steps rests on.
//!
//! The search decides whether a point comes `delta` deep into both bodies. With a negative depth −g it decides whether
//! max(f_A, f_B) <= g anywhere: what it then proves free stays free when the bodies leave the motion it was proven for. A
//! body that is displaced by at most d (every point that matters) changes its f by no more than d, f being 1-Lipschitz;
//! so bodies displaced by d_A and d_B do not meet while d_A + d_B < 2g: a common point x would lie within (d_A + d_B)/2 of
//! both undisplaced bodies, halfway between where x lies in the one and in the other.

use super::direct::Convex;
use super::literal::Side;
use super::outcome::Counters;
use super::pair::{PairQuery, PairSearch};
use super::search::{Ending, Scratch, Search};
use super::task::Task;
use crate::math::tolerance::WIDE_MARGIN;
use crate::solid::{Face, Sense};

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

/// A lower bound of the distance of two whole convex primitives at the start of the motion, less their touching
/// distance (`margin`, at least 2 delta); `None` for anything else. A length; negative when they may touch.
pub fn room(query: &PairQuery, margin: f64) -> Option<f64> {
    let (task, _) = PairSearch::task(query);
    Some(Convex::new(task)?.distance() - touch(&task, margin) - 8.0 * task.rounding)
}

/// Until when a pair keeps its surfaces a distance apart that leaves `room` (a length) for displacements, or as much of it
/// as the models' bounds can tell. The query's limit bounds the work; what was proven when it ran out counts. What comes within `lead` (fraction of the motion) of the end of that time need not be told exactly.
pub fn keep(query: &PairQuery, margin: f64, room: f64, lead: f64, scratch: &mut Scratch) -> Kept {
    let (mut task, _) = PairSearch::task(query);
    if let Some(pair) = Convex::new(task) {
        let (until, count) = pair.keeps(room + touch(&task, margin) + 8.0 * task.rounding);
        return Kept { until, room, counters: Counters { closed_forms: count, ..Counters::default() } };
    }
    // Half of the distance on either side, with more than rounding to spare. Trees of many primitives need their octrees,
    // which know less of what is far from a surface.
    let (a, b) = (task.model_a, task.model_b);
    let most = if a.solid.primitives.len() + b.solid.primitives.len() > MANY {
        a.margin().min(b.margin())
    } else {
        a.radius.min(b.radius) * WIDE_MARGIN
    };
    let wanted = 0.5 * (room + touch(&task, margin)) * (1.0 + 1e-9) + 8.0 * task.rounding;
    let level = wanted.min(0.99 * most);
    let room = room.min(2.0 * (level - 8.0 * task.rounding) * (1.0 - 2e-9) - touch(&task, margin));
    if !(room > 0.0 && level.is_finite()) {
        return Kept { until: 0.0, room, counters: Counters::default() };
    }
    task.delta = -level;
    task.lead = lead;
    task.ideas.fits &= level < smallest_radius(&task);
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

/// Half the smallest radius of a subtracted round face: a fit of two round faces holds for clearances below it.
fn smallest_radius(task: &Task) -> f64 {
    let of = |side: Side| {
        let solid = if side == Side::A { task.a } else { task.b };
        let faces = solid.faces.iter().zip(&solid.face_owner);
        let hollow = faces.filter(|(_, owner)| solid.senses[**owner as usize] == Sense::Negative);
        hollow
            .map(|(f, _)| match *f {
                Face::Sphere { radius, .. } | Face::Cylinder { radius, .. } => radius,
                Face::Plane { .. } | Face::Cone { .. } => f64::INFINITY,
            })
            .fold(f64::INFINITY, f64::min)
    };
    0.5 * of(Side::A).min(of(Side::B))
}
