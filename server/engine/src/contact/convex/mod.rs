//! In front of the search: two whole convex primitives, answered by a proven advance.
//!
//! Idea: a direction that separates two convex bodies proves them apart not only now. With h their supports and n fixed in
//! the world or turning linearly, n(τ) = n₀ + ντ of any length,
//!
//! ```text
//! φ(t) = −h_B(−n) − h_A(n)                                             the gap along n at t
//! Q    = 2|ν|(|v₀| + ω_A ρ_A + ω_B ρ_B) + |n|(ω_A² ρ_A + ω_B² ρ_B)     ρ: farthest point from the centre of rotation
//! φ    ≥ (1−s) φ₁ + s φ₂ − ½ Q s(1−s) (t₂−t₁)²                         on [t₁, t₂], s = (t−t₁)/(t₂−t₁)
//! ```
//!
//! since φ is a minimum over pairs of points of functions whose second derivative is at most Q. A body eroded by delta
//! leaves room for a ball of that radius, so its support is less by delta: a contact of depth delta needs φ ≤ −2 delta, and
//! φ > −2 delta excludes it. So: (1) nearest points at t by `gjk` give n; (2) the features that meet along it are solved for
//! a contact (`turning`; where that fails, the faces at the witnesses as the search does it, `advance`), and both trees
//! confirm it or it is none; (3) the time up to it is proven with its normal; (4) otherwise the time that n proves is taken,
//! and again from there. No contact by the end: clear. What only moves along needs no advance (`straight`, `boxes`, `balls`).
//! What overlaps, does not settle, or meets after it has started nearer than a few resolutions is left to the search;
//! nothing is guessed.
//! Source: conservative advancement (B. Mirtich, PhD thesis, Berkeley 1996) with the second-order bound above.

mod advance;
mod balls;
mod boxes;
mod gjk;
mod overlap;
mod part;
mod plane;
mod proof;
mod slabs;
mod steer;
mod straight;
mod support;
mod swept_shape;
#[cfg(test)]
mod tests;
mod touch;
mod turning;
mod turns;
mod whole;

use crate::contact::query::outcome::Outcome;
use crate::contact::query::question::PairQuery;
use crate::solid::primitive::Convex;
pub(super) use advance::{AtStart, ConvexPair, ConvexParts, Sight, answer};
pub(super) use balls::quick as balls;
pub(super) use gjk::{Nearest, SupportMapping, nearest};
use glam::DVec3;
use overlap::{Look, Start};
use plane::PlanePair;
pub(super) use proof::{Gap, Pace};
use straight::Straight;
pub(super) use support::ConvexBody;
pub use swept_shape::{AxisSearch, Hull, SeparatingAxisTest, SweptShape};
use turning::Turning;
use whole::PrimitivePair;
pub(super) use whole::{APART, body_of, excluded};

/// What is known of a pair of whole primitives from its start and from moving along.
pub(super) enum Quick {
    /// The answer.
    Reported,
    /// They overlap at the start, as is told, and more is asked: a point of both, in the frame of the body that carries.
    Overlap(DVec3),
    /// Not the answer; perhaps a direction (world axes) that separates them at the start.
    Open(Option<DVec3>),
}

/// Fills in the answer for two whole primitives, from the stack alone; `outcome` is clear before.
pub(super) fn quick(query: &PairQuery, outcome: &mut Outcome) -> Quick {
    let nothing = Quick::Open(None);
    let (Some(a), Some(b)) = (query.a.model.solid.whole(), query.b.model.solid.whole()) else { return nothing };
    if !query.strategies.convex {
        return nothing;
    }
    // As `PairQuery::is_swapped` has it for bodies without cavities.
    let swapped = query.b.model.radius < query.a.model.radius;
    let (bodies, primitives) = if swapped { ([&query.b, &query.a], [b, a]) } else { ([&query.a, &query.b], [a, b]) };
    // What is made here is looked at where it stands: a name of its own would be a copy.
    let pair = PrimitivePair::new(bodies, primitives, query.resolution);
    let Some(pair) = &pair else { return nothing };
    let turns = |spins: &[DVec3; 2]| *spins != [DVec3::ZERO; 2];
    let moves_along = || bodies.iter().all(|body| body.placed.motion.spin == DVec3::ZERO);
    let forms = [primitives[0].shape.convex(), primitives[1].shape.convex()];
    let balls = matches!(forms, [Convex::Ball(_), Convex::Ball(_)]);
    let met = match forms {
        [Convex::Ball(p), Convex::Ball(q)] if !turns(&pair.spins()) => {
            balls::meet(pair, [p, q], query.query_options, outcome)
        }
        [Convex::Cuboid(p), Convex::Cuboid(q)] if moves_along() => {
            boxes::meet(pair, [p, q], query.query_options, outcome)
        }
        // Of another body than a half-space, which the first one never is: there is one bounded body at least.
        [_, Convex::HalfSpace] => {
            return match PlanePair::new(pair).and_then(|plane| plane.meet(query.query_options, outcome)) {
                Some(()) => reported(outcome, swapped),
                None => nothing,
            };
        }
        // Every other pair is open here, of whatever forms.
        [_, _] => None,
    };
    if met.is_none() {
        let start = Start::new(pair);
        let Some(start) = &start else { return nothing };
        match start.look(&mut outcome.counters.closed_forms) {
            Look::Overlap(common) => {
                start.report(&common, query.query_options, outcome);
                if query.query_options.penetration || query.query_options.past_overlap {
                    if swapped {
                        outcome.swap_sides();
                    }
                    return Quick::Overlap(start.own(0, common.x));
                }
            }
            Look::Apart(n) => {
                let spins = pair.spins();
                let reported = if turns(&spins) {
                    let turning = Turning::new(start, spins);
                    turning.as_ref().and_then(|turning| turning.meet(n, query.query_options, outcome))
                } else if !balls {
                    let straight = Straight::new(start);
                    straight.as_ref().and_then(|straight| straight.meet(query.query_options, outcome))
                } else {
                    None
                };
                if reported.is_none() {
                    return Quick::Open(Some(n));
                }
                if outcome.contact().is_some() {
                    outcome.apart = start.gap(n) / n.length();
                }
            }
            Look::Open => return nothing,
        }
    }
    reported(outcome, swapped)
}

/// An answer with the bodies in the order of the question.
fn reported(outcome: &mut Outcome, swapped: bool) -> Quick {
    if swapped && outcome.meets() {
        outcome.swap_sides();
    }
    Quick::Reported
}
