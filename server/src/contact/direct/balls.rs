//! Two balls that do not turn: one quadratic.
//!
//! With c the way from A's centre to B's at the start, v the velocity of A against B and R the distance of the centres that is
//! asked for, |c − vt| = R has the earlier root
//!
//! ```text
//! t = (|c|² − R²) / (c·v + √(v²R² − |c×v|²))
//! ```
//!
//! which cancels nothing for an approaching pair outside R. The distance is convex in time, so over a span that ends before
//! the closest approach it is least at the end: one evaluation there is the proof.

use super::super::literal::Side;
use super::super::newton::{Actives, Constraint, Solution, Weights};
use super::super::search::{Found, Task};
use super::{APART, Advance};
use crate::solid::local::LiteralId;
use crate::solid::{Face, Primitive, Sense};
use glam::DVec3;

/// The answer for two balls that only move along, `Some(None)` where they miss each other; `None` leaves them to others:
/// they turn, start too near, or come within rounding of depth delta. `level` is the depth of a witness.
pub fn meet(task: &Task, a: &Primitive, b: &Primitive, level: f64) -> Option<Option<Found>> {
    let ([Face::Sphere { center: on_a, radius: ra }], [Face::Sphere { center: on_b, radius: rb }]) =
        (a.faces.as_slice(), b.faces.as_slice())
    else {
        return None;
    };
    let (pa, pb) = task.relative.placed();
    if pa.motion.spin != DVec3::ZERO || pb.motion.spin != DVec3::ZERO {
        return None;
    }
    let start = task.relative.at(0.0);
    let c = start.a_point(*on_b) - *on_a;
    let v = start.velocity(*on_a);
    let (sum, least) = (ra + rb, Advance::least(task));
    if c.length() - sum <= APART * task.delta {
        return None;
    }
    let (square, along) = (v.length_squared(), c.dot(v));
    let closest = if along > 0.0 { (along / square).min(1.0) } else { 0.0 };
    let gap = |t: f64| (c - v * t).length() - sum;
    if gap(closest) > least {
        return Some(None);
    }
    let solution = |level: f64| {
        let reach = sum - 2.0 * level;
        let root = square * reach * reach - c.cross(v).length_squared();
        let t = (c.length_squared() - reach * reach) / (along + root.max(0.0).sqrt());
        let n = (c - v * t).normalize();
        let literal = |side, p: &Primitive| Constraint::Literal(side, LiteralId::new(p.first_face, Sense::Positive));
        Solution {
            x: *on_a + n * (ra - level),
            t,
            active: Actives::from_iter([literal(Side::A, a), literal(Side::B, b)]),
            lambda: Weights::from_iter([0.5, 0.5]),
            stationarity: 0.0,
        }
    };
    let (deep, touch) = (solution(level), solution(0.0));
    let goal = 0.5 * (touch.t + deep.t);
    let ordered = 0.0 <= touch.t && touch.t <= deep.t && deep.t <= closest;
    // Both computed, as the trees see them.
    let depth = |s: &Solution| {
        let y = task.relative.at(s.t).b_point(s.x);
        [task.a.value(s.x), task.b.value(y)]
    };
    let is_deep = depth(&deep).iter().all(|f| *f <= -task.delta - task.rounding);
    let touches = depth(&touch).iter().all(|f| f.abs() <= 16.0 * task.rounding);
    if !(ordered && is_deep && touches && gap(goal) > least) {
        return None;
    }
    let upper = deep.t;
    Some(Some(Found { deep, touch: Some(touch), goal, upper }))
}
