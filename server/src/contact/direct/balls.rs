//! Two balls that only move along: one quadratic.
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

use super::super::outcome::{Outcome, Status};
use super::super::pair::INCIDENT;
use super::{APART, Pair, excluded};

/// Fills in the contact of two balls, or leaves `out` clear where they miss each other; `None` leaves them to others: they
/// start too near or come within rounding of depth delta.
pub fn meet(pair: &Pair, radii: [f64; 2], out: &mut Outcome) -> Option<()> {
    let (c, v) = (pair.way, pair.velocity);
    let (sum, least) = (radii[0] + radii[1], excluded(pair.delta, pair.rounding));
    let apart = c.length_squared();
    let touching = sum + APART * pair.delta;
    if apart <= touching * touching {
        return None;
    }
    let (square, along) = (v.length_squared(), c.dot(v));
    let closest = if along > 0.0 { (along / square).min(1.0) } else { 0.0 };
    let (reach, miss) = ((c - v * closest).length_squared(), sum + least);
    if reach > miss * miss {
        return Some(());
    }
    let beside = c.cross(v).length_squared();
    let root = |reach: f64| {
        let root = square * reach * reach - beside;
        (apart - reach * reach) / (along + root.max(0.0).sqrt())
    };
    let level = pair.witness_level();
    let (touch, deep) = (root(sum), root(sum - 2.0 * level));
    let way = c - v * touch;
    let distance = way.length();
    // A's point at `level` is that deep in B, too.
    let is_deep = (c - v * deep).length() <= sum - level - pair.delta - pair.rounding;
    let ordered = 0.0 <= touch && touch <= deep && deep <= closest;
    let gap = distance - sum;
    if !(ordered && is_deep && gap.abs() <= INCIDENT * pair.rounding && gap > least) {
        return None;
    }
    let n = way / distance;
    out.counters.closed_forms += 1;
    out.status = Status::Contact;
    (out.time_lower, out.time, out.time_upper) = (touch, touch, deep);
    out.point = pair.point(n * radii[0], touch);
    out.normal = n;
    out.normal_speed = n.dot(v);
    out.faces_a[0] = pair.primitives[0].first_face;
    out.faces_b[0] = pair.primitives[1].first_face;
    Some(())
}
