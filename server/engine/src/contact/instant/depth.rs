//! The deepest common point at the start, for pairs that overlap there (the paper's point of greatest interpenetration).
//!
//! From a common point, sequential linear programming on the tree's own linear bounds: linearise every literal that can
//! matter within a trust box, find the box's lowest point of the weakest alternative, move there if max(f_A, f_B) falls,
//! shrink the box otherwise. That ends in a local optimum, so branch and bound goes on from there: boxes in which a point
//! deeper by more than `BETTER` may lie are halved, and each deeper point found is climbed from. With all boxes dropped
//! the point is the deepest of all up to that tolerance; should `MOST_CELLS` run out, it is the deepest found.
//! Two convex bodies are one convex program (`program`) in place of all that.
//! Either way its depth g is a proven lower bound: a ball of radius g is common to both bodies, so no translation
//! shorter than 2g takes them apart.

use super::near::Near;
use super::program::{Lowest, Program, ROUNDINGS};
use super::separation::{self, Cover};
use super::work::Work;
use crate::contact::exclusion::clause::{self, Expressions};
use crate::contact::exclusion::enumeration;
use crate::contact::exclusion::literal::{Side, View};
use crate::contact::query::task::Task;
use crate::motion::Instant;
use crate::solid::Sense;
use crate::solid::local::{LiteralId, Token, Truth};
use glam::DVec3;

/// Trust boxes tried before the climb ends.
const ROUNDS: usize = 200;

/// The same where the deepest point is not asked for.
const GLIMPSE: usize = 2;

/// A point this much deeper, relative to the depth, is worth another climb.
pub const BETTER: f64 = 1e-3;

/// The same where the depth itself is what is asked for.
pub const FINE: f64 = 1e-6;

/// Cells' worth of work that the search for the deepest point may cost, should the pair's limit allow more.
pub const MOST_CELLS: u64 = 4_000;

/// Point in A's frame, unit normal from a to b along A's axes, depth, deciding literals.
pub type Deepest = (DVec3, DVec3, f64, Vec<(Side, LiteralId)>);

/// The deepest common point: no other is deeper by more than the tolerance, unless the work runs out.
pub fn deepest(task: &Task, at: &Instant, start: DVec3, work: &Work) -> Deepest {
    if let Some(found) = of_program(task, at, 0.0, BETTER, work) {
        return found;
    }
    let mut best = climb(task, at, start, work);
    deepen(task, at, work, BETTER, &mut best);
    best
}

/// Looks for common points that are deeper than `best` by more than a part of its depth, until there is none: then true.
fn deepen(task: &Task, at: &Instant, work: &Work, part: f64, best: &mut Deepest) -> bool {
    lower(task, at, f64::NEG_INFINITY, work, |x| {
        if let Some(x) = x {
            let other = climb(task, at, x, work);
            if other.2 > best.2 {
                *best = other;
            }
        }
        -better(task, best.2, part)
    })
}

/// A depth that no common point exceeds, and hardly more than the deepest has; `None` when the work allows no proof of it.
pub fn at_most(task: &Task, at: &Instant, start: DVec3, work: &Work) -> Option<f64> {
    if let Some((_, _, depth, _)) = of_program(task, at, 0.0, FINE, work) {
        return Some(better(task, depth, FINE));
    }
    let mut best = climb(task, at, start, work);
    deepen(task, at, work, FINE, &mut best).then(|| better(task, best.2, FINE))
}

/// Where two bodies that have nothing in common are nearest to it: F at its lowest, if no more than half of `reach` as far as that is
/// known; no other point is nearer by more than `part` of that, once proven.
pub fn nearest(task: &Task, at: &Instant, reach: f64, part: f64, work: &Work) -> (Option<Deepest>, bool) {
    if let Some(found) = of_program(task, at, 0.5 * reach, part, work) {
        let lowest = -found.2 - slack(task, found.2, part) - ROUNDINGS * task.rounding;
        return ((lowest <= 0.5 * reach).then_some(found), true);
    }
    let mut best: Option<Deepest> = None;
    let proven = lower(task, at, 0.5 * reach, work, |x| {
        if let Some(x) = x {
            let other = climb(task, at, x, work);
            if best.as_ref().is_none_or(|b| other.2 > b.2) {
                best = Some(other);
            }
        }
        best.as_ref().map_or(0.5 * reach, |b| -better(task, b.2, part))
    });
    (best, proven)
}

/// The deepest common point of two convex bodies, or where they are nearest to have one: no other is deeper by more than the
/// slack that `part` of its depth gives. `None` for other bodies, and where the program's multipliers do not prove it.
fn of_program(task: &Task, at: &Instant, reach: f64, part: f64, work: &Work) -> Option<Deepest> {
    let found = lowest(task, at, reach, work)?;
    let depth = -separation::value(task, at, found.x);
    let proven = found.bound - ROUNDINGS * task.rounding >= -depth - slack(task, depth, part);
    let literals = || found.support.iter().map(|s| (s.0, s.1)).collect();
    proven.then(|| (found.x, normal(task, at, found.x, &found.support), depth, literals()))
}

/// Where F of two convex bodies is lowest within some reach of both.
fn lowest(task: &Task, at: &Instant, reach: f64, work: &Work) -> Option<Lowest> {
    let within = separation::common(task, at, reach);
    if !within.is_finite() || within.is_empty() {
        return None;
    }
    Some(Program::of(task, at)?.lowest(&within, |value, bound| value - bound <= task.rounding, work))
}

/// The least depth that is worth another climb.
fn better(task: &Task, depth: f64, part: f64) -> f64 {
    depth + slack(task, depth, part)
}

/// How much deeper another point may be than the one that is told.
pub fn slack(task: &Task, depth: f64, part: f64) -> f64 {
    (part * depth.abs()).max(task.delta)
}

/// Branch and bound: hands out points with F no more than the level that `found` gives (at first for no point), until none
/// is left: then true.
fn lower(task: &Task, at: &Instant, far: f64, work: &Work, mut found: impl FnMut(Option<DVec3>) -> f64) -> bool {
    let mut cover = Cover::new(task, at, f64::INFINITY, far, work);
    let mut level = found(None);
    while let Some(place) = cover.next(level) {
        for x in [place.lowest, place.center] {
            work.look(task.a.faces.len() + task.b.faces.len());
            if separation::value(task, at, x) <= level {
                level = found(Some(x));
            }
        }
        cover.split(place, |_| true);
    }
    cover.is_done()
}

/// A common point near `start` with a direction and a depth that is proven for it: enough to say that two bodies overlap.
pub fn some(task: &Task, at: &Instant, start: DVec3, work: &Work) -> Deepest {
    climb_for(GLIMPSE, task, at, start, work)
}

/// Climbs from `start` to a locally deepest point; negative depth: the nearest to common.
pub fn climb(task: &Task, at: &Instant, start: DVec3, work: &Work) -> Deepest {
    climb_for(ROUNDS, task, at, start, work)
}

fn climb_for(rounds: usize, task: &Task, at: &Instant, start: DVec3, work: &Work) -> Deepest {
    let (x, depth, support) = ascend((rounds, WIDE * task.scale, 0.0), false, task, at, start, work);
    (x, normal(task, at, x, &support), depth, support.iter().map(|s| (s.0, s.1)).collect())
}

/// A locally deepest point near `start`, its depth and the literals that hold it with their weights. The first trust
/// box reaches as far as `reach` (a length), by default half the pair's scale; the climb ends once no point of its box is deeper
/// by more than `part` of the depth.
pub(in crate::contact) fn climb_within(
    (reach, part): (Option<f64>, f64),
    task: &Task,
    at: &Instant,
    start: DVec3,
    work: &Work,
) -> Held {
    ascend((ROUNDS, reach.unwrap_or(WIDE * task.scale), part), true, task, at, start, work)
}

/// A point, its depth, what holds it there.
pub(in crate::contact) type Held = (DVec3, f64, Vec<(Side, LiteralId, f64)>);

/// Half the sides of the first trust box, in scales of the pair.
const WIDE: f64 = 0.5;

/// Steps from a point towards where it is as deep in the one body as in the other.
const LEVELLINGS: usize = 2;

/// A point beside x that is as deep in the one body as in the other, along what its deciding faces differ by. Between
/// like round faces a step along them leaves the thin layer that both bodies have in common by its square over their
/// radius, on one side or the other: this leads back to the middle of the layer (a second-order correction, as in
/// sequential quadratic programming).
fn levelled(near: &Near, task: &Task, at: &Instant, mut x: DVec3) -> DVec3 {
    for _ in 0..LEVELLINGS {
        let decide = |side: Side| {
            let (solid, y) = if side == Side::A { (task.a, x) } else { (task.b, at.b_point(x)) };
            let (value, id) = near.deciding(side, x);
            let f = solid.faces[id.face() as usize].at(y);
            let n = if id.sense() == Sense::Positive { f.normal } else { -f.normal };
            (value, if side == Side::A { n } else { at.a_vector(n) }, f.slope)
        };
        let ((in_a, up_a, steep_a), (in_b, up_b, steep_b)) = (decide(Side::A), decide(Side::B));
        let apart = up_a - up_b;
        let square = apart.length_squared();
        if square < OPPOSED * steep_a * steep_b {
            break;
        }
        x -= apart * ((in_a - in_b) / square);
    }
    x
}

/// |g_A − g_B|² below which two gradients do not oppose each other, over their lengths.
const OPPOSED: f64 = 1.0;

fn ascend(
    (rounds, reach, part): (usize, f64, f64),
    bends: bool,
    task: &Task,
    at: &Instant,
    start: DVec3,
    work: &Work,
) -> Held {
    let mut near = Near::new(task, at);
    let (mut x, mut best) = (start, near.value(start));
    let mut size = reach;
    let mut scratch = clause::Scratch::default();
    let mut support: Vec<(Side, LiteralId, f64)> = Vec::new();
    for _ in 0..rounds {
        // F is no lower by more than the box's radius, anywhere in it.
        if size < 1e-13 * task.scale || size * 3f64.sqrt() < part * -best {
            break;
        }
        work.bound();
        near.come_to(x, size, best);
        // Literals decided against the present depth over the trust box fold away.
        let view = View {
            radius: size * 3f64.sqrt(),
            velocity: DVec3::ZERO,
            delta: -best,
            wall: f64::NEG_INFINITY,
            rounding: 0.0,
            fits: false,
            multipliers: true,
            curved: false,
            ..task.view((x, DVec3::splat(size)), at, task.relative.bounds(0.0, 0.0, 0.0), &[])
        };
        let mut pool: Vec<Token> = Vec::new();
        let truth_a = near.prune(Side::A, &view, &mut pool);
        let middle = pool.len() as u32;
        let truth_b = near.prune(Side::B, &view, &mut pool);
        let end = pool.len() as u32;
        if truth_a == Truth::False || truth_b == Truth::False || end == 0 {
            size *= 0.5;
            continue;
        }
        let pair = Expressions { pool: &pool, a: (0, middle), b: (middle, end) };
        let step = enumeration::advance(&view, &pair, &[], 0.0, f64::INFINITY, &mut scratch);
        if !step.support.is_empty() {
            support = step.support.clone();
        }
        if step.dt >= 0.0 {
            // The whole box is proven no deeper.
            size *= 0.5;
            continue;
        }
        let enough = best - 1e-3 * task.rounding;
        let mut next = x + step.y;
        let mut value = near.value(next);
        if value >= enough && bends {
            next = levelled(&near, task, at, next);
            value = near.value(next);
        }
        if value < enough {
            (x, best) = (next, value);
        } else {
            size *= 0.5;
        }
    }
    (x, -best, support)
}

/// Direction from a to b: the multiplied normals of a, else of b, else the deciding face's.
fn normal(task: &Task, at: &Instant, x: DVec3, support: &[(Side, LiteralId, f64)]) -> DVec3 {
    let gradient = |side: Side, id: LiteralId| {
        let n = match side {
            Side::A => task.a.faces[id.face() as usize].at(x).normal,
            Side::B => at.a_vector(task.b.faces[id.face() as usize].at(at.b_point(x)).normal),
        };
        if id.sense() == Sense::Positive { n } else { -n }
    };
    let sum = |side: Side| support.iter().filter(|s| s.0 == side).map(|s| gradient(s.0, s.1) * s.2).sum::<DVec3>();
    let from_a = task.a.deciding(x).1;
    (sum(Side::A) - sum(Side::B)).try_normalize().unwrap_or_else(|| {
        let n = task.a.faces[from_a.face() as usize].unit_normal(x);
        if from_a.sense() == Sense::Positive { n } else { -n }
    })
}
