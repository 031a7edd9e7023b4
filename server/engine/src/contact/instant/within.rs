//! Whether two bodies come within a distance of each other at an instant: proven, witnessed or open.

use super::depth;
use super::program::{Program, ROUNDINGS};
use super::separation::{Cover, common, value};
use super::work::Work;
use crate::contact::query::task::Task;
use crate::motion::Instant;
use glam::DVec3;

/// Whether two bodies are within a threshold of each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Within {
    /// A point with F <= level, A's frame.
    Witness(DVec3),
    /// Proven: no point is within `level` of both, and the bodies' distance exceeds twice that.
    Apart,
    /// The limit ran out before either was found.
    Open,
}

/// Whether F <= level in a point of A's frame.
fn is_within(task: &Task, at: &Instant, level: f64, x: DVec3, work: &Work) -> bool {
    work.look(task.a.faces.len() + task.b.faces.len());
    value(task, at, x) <= level
}

/// A point with F <= level that is found at once: in the middle of what both bodies' bounds have in common, one that `other` knows, or
/// a few steps downhill from that middle; `None`: there may be one all the same.
pub(in crate::contact) fn glimpse(
    task: &Task,
    at: &Instant,
    level: f64,
    other: impl FnOnce() -> Option<DVec3>,
    work: &Work,
) -> Option<DVec3> {
    let region = common(task, at, level);
    if !region.is_finite() {
        return None;
    }
    let middle = region.center();
    if is_within(task, at, level, middle, work) {
        return Some(middle);
    }
    if let Some(x) = other().filter(|x| is_within(task, at, level, *x, work)) {
        return Some(x);
    }
    let (x, _, depth, _) = depth::some(task, at, middle, work);
    (-depth <= level).then_some(x)
}

/// Decides whether a point with F <= level exists.
pub(in crate::contact) fn within(task: &Task, at: &Instant, level: f64, work: &Work) -> Within {
    if let Some(decided) = of_program(task, at, level, work) {
        return decided;
    }
    let mut cover = Cover::new(task, at, 2.0 * level, 2.0 * level, work);
    let smallest = task.scale * f64::EPSILON;
    let mut boxes = 0u64;
    while let Some(place) = cover.next(level) {
        for x in [place.lowest, place.center] {
            if value(task, at, x) <= level {
                return Within::Witness(x);
            }
        }
        // A curved valley is followed down; each box deserves one climb while boxes are few.
        boxes += 1;
        if boxes.is_power_of_two() {
            let (x, _, depth, _) = depth::climb(task, at, place.lowest, work);
            if -depth <= level {
                return Within::Witness(x);
            }
        }
        if place.half.max_element() <= smallest {
            return Within::Open;
        }
        cover.split(place, |_| true);
    }
    if cover.is_done() { Within::Apart } else { Within::Open }
}

/// Decides whether two convex bodies have a point with F <= level; `None` for other bodies, and for what is nearer to the
/// level than rounding.
fn of_program(task: &Task, at: &Instant, level: f64, work: &Work) -> Option<Within> {
    let region = common(task, at, 2.0 * level);
    if !region.is_finite() || region.is_empty() {
        return None;
    }
    let apart = level + ROUNDINGS * task.rounding;
    let found = Program::of(task, at)?.lowest(&region, |value, bound| value <= level || bound > apart, work);
    if value(task, at, found.x) <= level {
        return Some(Within::Witness(found.x));
    }
    (found.bound > apart).then_some(Within::Apart)
}
