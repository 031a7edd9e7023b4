//! How far apart a pair is, and until when it stays so: when a margin is first reached, and what coherence over steps rests on.
//!
//! The search decides whether a point comes `delta` deep into both bodies. With a negative depth −g it decides whether
//! max(f_A, f_B) <= g anywhere: what it then proves free stays free when the bodies leave the motion it was proven for. A
//! body that is displaced by at most d (every point that matters) changes its f by no more than d, f being 1-Lipschitz;
//! so bodies displaced by d_A and d_B do not meet while d_A + d_B < 2g: a common point x would lie within (d_A + d_B)/2 of
//! both undisplaced bodies, halfway between where x lies in the one and in the other.

use crate::bound::{Bound, Volumes};
use crate::contact::ball;
use crate::contact::cavity;
use crate::contact::certificate::{self, Certificate};
use crate::contact::convex::ConvexPair;
use crate::contact::instant::depth;
use crate::contact::instant::within::{Within, glimpse, within};
use crate::contact::instant::work::Work;
use crate::contact::query::options::QueryOptions;
use crate::contact::query::outcome::Counters;
use crate::contact::query::question::{PairQuery, PlacedModel};
use crate::contact::query::task::Task;
use crate::contact::queue::scratch::Scratch;
use crate::contact::queue::search::Search;
use crate::contact::region;
use crate::contact::witness::contacts::Contacts;
use crate::contact::witness::found::Ending;
use crate::math::tolerance::WIDE_MARGIN;
use crate::motion::Placed;
use crate::solid::Solid;
use contactd_proto::Motion;
use glam::DVec3;

/// A proof that a pair keeps a distance over a motion.
#[derive(Clone, Copy, Debug)]
pub struct Kept {
    /// Time, fraction of the motion, until which it does; 0 when nothing was proven.
    pub until: f64,
    /// By how much the bodies may be displaced together until then before they can be within `touch` of each other.
    pub clearance: f64,
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

/// The search for a point with f <= `level` in both bodies, which is one for a contact of that negative depth: it holds every point
/// within `level` of both, and at sharp features more. Fits hold while a subtracted face that has shrunk by it is left; the
/// shortcuts in front of the search, made for depths, are not asked.
fn nearing(mut task: Task, level: f64, scratch: &mut Scratch) -> (Option<Ending>, Counters) {
    task.delta = -level;
    task.strategies.fits &= level < task.fits_below();
    let is_empty = task.a.is_empty() || task.b.is_empty();
    let mut search = Search::new(Contacts::new(task), std::mem::take(scratch));
    if !is_empty {
        search.start(0.0);
    }
    let ending = search.run(f64::INFINITY);
    let counters = *search.counters();
    *scratch = search.into_scratch();
    (ending, counters)
}

/// How many levels far {f <= level} reaches out of a solid's box (`Solid::aabb`) along an axis, at most: one where faces lie along
/// the axes, more at sharp edges and apexes. Boxes of primitives grow in proportion to the level, and what operations put together of
/// them no faster.
pub fn sharpness(solid: &Solid) -> f64 {
    let mut most: f64 = 1.0;
    for p in solid.primitives.iter().filter(|p| p.aabb.is_finite()) {
        let level = p.shape.geometry().smallest_dimension();
        let [own, grown] = [0.0, level].map(|level| Bound::of_primitive(p, level, Volumes::Boxes).aabb);
        let over = (grown.max - own.max).max(own.min - grown.min).max_element() / level;
        most = if over.is_nan() { f64::INFINITY } else { most.max(over) };
    }
    most * (1.0 + 1e-9)
}

/// A lower bound of the distance of two whole convex primitives at the start of the motion, less their touching
/// distance (`margin`, at least 2 delta); `None` for anything else. A length; negative when they may touch.
pub fn at_start(query: &PairQuery, margin: f64) -> Option<f64> {
    let (task, _) = Task::of(query);
    Some(ConvexPair::new(task)?.distance() - touch(&task, margin) - 8.0 * task.rounding)
}

/// The direction that proves `clearance`: unit, world axes, from the query's first body to its second.
pub fn direction_of_clearance(query: &PairQuery) -> Option<DVec3> {
    let (task, swapped) = Task::of(query);
    let n = ConvexPair::new(task)?.direction().normalize();
    Some(if swapped { -n } else { n })
}

/// What proves that a pair keeps a distance over a motion, as `keep` has found out.
pub enum KeptProof {
    /// Of two convex primitives: directions, from a to b in world axes, each from its time (fraction of the motion) on.
    Directions(Vec<(f64, DVec3)>),
    /// Of others cells at a negative depth.
    Cells(Certificate),
}

/// The proof that a pair keeps a distance until `until` over the query's motion: one in which bodies displaced together by `way`
/// are farther than their touching distance apart, where `keep` has proven as much for `clearance`, which is more. `None` where it
/// takes more cells than the query allows, or the two are too near each other to leave a checker clearance.
pub fn certify_kept(query: &PairQuery, margin: f64, (way, clearance): (f64, f64), until: f64) -> Option<KeptProof> {
    let (task, swapped) = Task::of(query);
    let touch = touch(&task, margin);
    if let Some(pair) = ConvexPair::new(task) {
        let sign = if swapped { -1.0 } else { 1.0 };
        let all = pair.directions(clearance + touch + 8.0 * task.rounding);
        return Some(KeptProof::Directions(all.into_iter().map(|(t, n)| (t, n * sign)).collect()));
    }
    let [needed, proven] = [way, clearance].map(|d| 0.5 * (d + touch));
    let spare = proven - needed;
    certificate::certify_level(query, needed + 0.1 * spare, needed + 0.9 * spare, until).map(KeptProof::Cells)
}

/// Until when a pair keeps its surfaces a distance apart that leaves `clearance` (a length) for displacements, or as much of it
/// as the models' bounds can tell. The query's limit and that of evaluations bound the work; what was proven when it ran out counts.
/// What comes within `proof_slack` (fraction of the motion) of the end of that time need not be told exactly.
pub fn keep(
    query: &PairQuery,
    margin: f64,
    clearance: f64,
    (proof_slack, most_evaluations): (f64, u64),
    scratch: &mut Scratch,
) -> Kept {
    let (mut task, _) = Task::of(query);
    task.query_options = QueryOptions::CONTACT;
    if let Some(pair) = ConvexPair::new(task) {
        let (until, count) = pair.keeps(clearance + touch(&task, margin) + 8.0 * task.rounding);
        return Kept { until, clearance, counters: Counters { closed_forms: count, ..Counters::default() } };
    }
    if ConvexPair::are_two(&task) {
        // No direction separates them: there is no distance to keep.
        return Kept { until: 0.0, clearance, counters: Counters { closed_forms: 1, ..Counters::default() } };
    }
    // Half of the distance on either side, with more than rounding to spare.
    let wanted = 0.5 * (clearance + touch(&task, margin)) * (1.0 + 1e-9) + 8.0 * task.rounding;
    let level = wanted.min(0.99 * reach(&task));
    let clearance = clearance.min(2.0 * (level - 8.0 * task.rounding) * (1.0 - 2e-9) - touch(&task, margin));
    if !(clearance > 0.0 && level.is_finite()) {
        return Kept { until: 0.0, clearance, counters: Counters::default() };
    }
    (task.proof_slack, task.most_evaluations) = (proof_slack, most_evaluations);
    let (ending, counters) = nearing(task, level, scratch);
    let until = match ending {
        Some(Ending::Clear) | None => 1.0,
        Some(Ending::Contact(found)) => (found.goal - proof_slack).max(0.0),
        Some(Ending::Limit(t) | Ending::Long(t, _) | Ending::Rounding(t)) => t,
        Some(Ending::Deep(_)) => 0.0,
    };
    Kept { until, clearance, counters }
}

/// Until when the bodies of a question are proven to stay farther apart than `distance` (a length), 1 when they do so over
/// the whole step; and whether they come within 1 + `MARGIN_SLACK` of it then. Never late; where the work runs out it is
/// early, and it is not known whether they do. Within the models' reach it is the search for a contact
/// of that negative depth; farther, the whole trees tell how near the bodies are, and their speed how long that lasts.
pub fn apart_until(query: &PairQuery, distance: f64, scratch: &mut Scratch) -> (f64, bool, Counters) {
    let (mut task, _) = Task::of(query);
    task.query_options = QueryOptions::CONTACT;
    if task.a.is_empty() || task.b.is_empty() {
        return (1.0, true, Counters::default());
    }
    if let Some(pair) = ConvexPair::new(task) {
        let (until, nearest, count) = pair.nears(distance + 8.0 * task.rounding);
        let counters = Counters { closed_forms: count, ..Counters::default() };
        return (until, until >= 1.0 || nearest <= distance * (1.0 + MARGIN_SLACK), counters);
    }
    let level = 0.5 * distance + 8.0 * task.rounding;
    if level > 0.99 * reach(&task) {
        let work = Work::new(task.limit);
        let (until, known) = advance(&task, level, &work);
        return (until, known, Counters { instant_cells: work.cells(), ..Counters::default() });
    }
    let (ending, counters) = nearing(task, level, scratch);
    let (until, known) = match ending {
        Some(Ending::Clear) | None => (1.0, true),
        Some(Ending::Contact(found)) => (found.goal.min(1.0), true),
        Some(Ending::Rounding(t)) => (t, true),
        Some(Ending::Limit(t) | Ending::Long(t, _)) => (t, false),
        Some(Ending::Deep(_)) => (0.0, true),
    };
    (until, known, counters)
}

/// Moments at which bodies far apart are looked at.
const LOOKS: usize = 512;

/// A pair that comes nearer than this much more than its margin, in parts of it, may be told as within; what proves a pair
/// to stay away from it proves that.
pub const MARGIN_SLACK: f64 = 1e-4;

/// Conservative advancement (B. Mirtich, PhD thesis, Berkeley 1996) on F = max(f_A, f_B). A point x that is within `level` of
/// both bodies at t + dt lies in A's box grown by that; let no point fixed there in A be faster than v against B. What of B is
/// at x then is at x − u at t, |u| <= v·dt, so half way between the two F <= level + v·dt/2 at t. Where F is larger
/// everywhere, there is no such x.
fn advance(task: &Task, level: f64, work: &Work) -> (f64, bool) {
    let part = task.model_a.bounds.root().aabb.grown(level);
    let far = part.corners().iter().map(|c| (*c - task.relative.center_a()).length()).fold(0.0, f64::max);
    let mut t = 0.0;
    for _ in 0..LOOKS {
        let rest = 1.0 - t;
        let speed = task.relative.bounds(t, rest, far).speed;
        let reach = level + 0.5 * speed * rest;
        if !reach.is_finite() {
            return (t, false);
        }
        let lowest = match depth::nearest(task, &task.relative.at(t), 2.0 * reach, depth::FINE, work) {
            (None, true) => return (1.0, true),
            (Some((_, _, depth, _)), true) => -depth - depth::slack(task, depth, depth::FINE),
            (_, false) => return (t, false),
        };
        let left = lowest - level;
        if left <= 0.5 * MARGIN_SLACK * level {
            return (t, true);
        }
        t += 2.0 * left / speed;
        if t >= 1.0 {
            return (1.0, true);
        }
    }
    (t, false)
}

/// A body that stays where its motion starts.
fn standing(body: PlacedModel<'_>) -> PlacedModel<'_> {
    let motion = Motion::resting(body.placed.motion.start);
    PlacedModel { placed: Placed { motion, ..body.placed }, ..body }
}

/// How many times farther apart than the touching distance bodies are whom their parts show to be apart. What is nearer is searched,
/// which asks for f: at sharp edges that falls below the distance.
const FAR: f64 = 4.0;

/// Whether the bodies of a question are within `distance` (a length) of each other at the start, proven or witnessed, and
/// the cells' worth of work that it took. Within the models' reach it is the search for a contact of that negative depth, of
/// bodies that stand still there; farther it covers the whole trees.
pub fn touching(query: &PairQuery, distance: f64, scratch: &mut Scratch) -> (Within, u64) {
    let still = PairQuery { a: standing(query.a), b: standing(query.b), ..*query };
    let (mut task, _) = Task::of(&still);
    if task.a.is_empty() || task.b.is_empty() {
        return (Within::Apart, 0);
    }
    // Of two convex primitives the nearest points tell, where they are apart.
    if ConvexPair::new(task).is_some_and(|c| c.distance() > distance + 8.0 * task.rounding) {
        return (Within::Apart, 0);
    }
    let known = task.model_a.margin().min(task.model_b.margin());
    let asks_parts = task.strategies.cavities && FAR * distance <= known;
    if asks_parts && cavity::keeps_apart(&task, FAR * distance) {
        return (Within::Apart, 0);
    }
    let level = 0.5 * distance;
    if task.strategies.balls
        && let Some(within) = ball::within(&task, level)
    {
        return (within, 0);
    }
    task.limit = task.limit.min(region::MOST_CELLS);
    if level > 0.99 * reach(&task) {
        let work = Work::new(task.limit);
        let within = within(&task, &task.relative.at(0.0), level, &work);
        return (within, work.cells());
    }
    let work = Work::new(task.limit);
    // Of two convex primitives a point between the nearest, or a common one, mostly is as near as that.
    let between = || ConvexPair::between(task);
    if let Some(x) = glimpse(&task, &task.relative.at(0.0), level, between, &work) {
        return (Within::Witness(x), work.cells());
    }
    let (ending, counters) = nearing(task, level, scratch);
    let within = match ending {
        Some(Ending::Clear) | None => Within::Apart,
        Some(Ending::Deep(x)) => Within::Witness(x),
        Some(Ending::Contact(_) | Ending::Limit(_) | Ending::Long(..) | Ending::Rounding(_)) => Within::Open,
    };
    (within, work.cells() + counters.cells)
}
