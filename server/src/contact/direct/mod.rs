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
mod form;
mod gjk;
mod overlap;
mod part;
mod proof;
mod slabs;
mod stance;
mod steer;
mod straight;
mod support;
#[cfg(test)]
mod tests;
mod touch;
mod turning;

use super::outcome::{Outcome, Status};
use super::pair::{self, PairQuery};
use super::task::witness_level;
use crate::math::tolerance;
use crate::motion::Rounding;
use crate::solid::{Primitive, Shape};
pub(super) use advance::{Convex, answer, faces_at};
pub(super) use balls::quick as balls;
use glam::{DMat3, DQuat, DVec3};
use overlap::{Look, Start};
pub use stance::{Glance, Glancing, Hull, Stance};
use straight::Straight;
use support::Body;
use turning::Turning;

/// Resolutions that the bodies must be apart at the start: what is nearer may be touching, which the search tells.
const APART: f64 = 4.0;

/// Two whole primitives at the start and as they move along; world axes.
struct Pair<'a> {
    bodies: [&'a pair::Body<'a>; 2],
    primitives: [&'a Primitive; 2],
    /// From an object's origin to its primitive's centre.
    offsets: [DVec3; 2],
    /// From A's centre to B's at the start.
    way: DVec3,
    /// Of A against B, length per step.
    velocity: DVec3,
    /// Depth at which a contact is decided.
    delta: f64,
    /// What rounding may do to one bound.
    rounding: f64,
    /// Length scale of the pair.
    scale: f64,
}

impl<'a> Pair<'a> {
    /// The pair of two bodies, the first of which carries; `None` if the resolution needs raising.
    fn new(bodies: [&'a pair::Body<'a>; 2], primitives: [&'a Primitive; 2], resolution: f64) -> Option<Self> {
        let [a, b] = bodies;
        let (from, to) = (&a.placed.motion, &b.placed.motion);
        let difference = from.start.position - to.start.position;
        let velocity = from.velocity - to.velocity;
        let apart = difference.length_squared().max((difference + velocity).length_squared()).sqrt();
        let length = |v: DVec3| if v == DVec3::ZERO { 0.0 } else { v.length() };
        let places = [length(a.placed.place.position), length(b.placed.place.position)];
        let turns = [length(from.spin), length(to.spin)];
        let motion = Rounding::with(turns[0] + turns[1], apart, places[0] + places[1]);
        let rounding = super::rounding::of_motion(a.model, b.model, places, apart, &motion);
        let scale = a.model.radius.max(b.model.radius);
        // Sums of components: no less than lengths, and no roots.
        let center = |body: &pair::Body| body.model.bounds.root().ball.center.abs().element_sum();
        let centers = [center(a), center(b)];
        let extent = centers[0] + centers[1] + 2.0 * scale + places[0] + apart;
        let least = (tolerance::LEAST_RESOLUTION * extent).max(tolerance::LEAST_ROUNDINGS * rounding);
        if resolution.is_nan() || resolution < least {
            return None;
        }
        let offset = |body: &pair::Body, primitive: &Primitive| {
            let (place, frame) = (&body.placed.place, primitive.frame.position);
            if place.position == DVec3::ZERO && frame == DVec3::ZERO {
                DVec3::ZERO
            } else {
                body.placed.motion.start.rotation * place.point(frame)
            }
        };
        let offsets = [offset(a, primitives[0]), offset(b, primitives[1])];
        let way = offsets[1] - offsets[0] - difference;
        Some(Self { bodies, primitives, offsets, way, velocity, delta: resolution, rounding, scale })
    }

    /// How they turn, spins about their own axes left out.
    fn spins(&self) -> [DVec3; 2] {
        let spin = |body: &pair::Body| {
            let spin = body.placed.motion.spin;
            if spin == DVec3::ZERO { spin } else { pair::without_own_spin(body).motion.spin }
        };
        [spin(self.bodies[0]), spin(self.bodies[1])]
    }

    /// World from model: the rotation.
    fn axes(&self, k: usize) -> DMat3 {
        let placed = &self.bodies[k].placed;
        let (start, place) = (placed.motion.start.rotation, placed.place.rotation);
        DMat3::from_quat(if place == DQuat::IDENTITY { start } else { start * place })
    }

    /// World from primitive: the rotation, from that of the model.
    fn frame(&self, k: usize, axes: &DMat3) -> DMat3 {
        let frame = self.primitives[k].frame.rotation;
        if frame == DQuat::IDENTITY { *axes } else { *axes * DMat3::from_quat(frame) }
    }

    /// From A's centre to B's at a time.
    fn at(&self, t: f64) -> DVec3 {
        self.way - self.velocity * t
    }

    /// A point seen from A's centre, which is `offset` from its centre of rotation by then, in the world.
    fn point(&self, offset: DVec3, x: DVec3, t: f64) -> DVec3 {
        let motion = &self.bodies[0].placed.motion;
        motion.start.position + motion.velocity * t + (offset + x)
    }

    fn witness_level(&self) -> f64 {
        witness_level(self.delta, self.rounding)
    }
}

/// What is known of a pair of whole primitives from its start and from moving along.
pub(super) enum Quick {
    /// The answer.
    Told,
    /// They overlap at the start, as is told, and more is asked: a point of both, in the frame of the body that carries.
    Overlap(DVec3),
    /// Not the answer; perhaps a direction (world axes) that separates them at the start.
    Open(Option<DVec3>),
}

/// Fills in the answer for two whole primitives, from the stack alone; `outcome` is clear before.
pub(super) fn quick(query: &PairQuery, outcome: &mut Outcome) -> Quick {
    let nothing = Quick::Open(None);
    let (Some(a), Some(b)) = (query.a.model.solid.whole(), query.b.model.solid.whole()) else { return nothing };
    if !query.ideas.direct {
        return nothing;
    }
    // As `PairQuery::is_swapped` has it for bodies without cavities.
    let swapped = query.b.model.radius < query.a.model.radius;
    let (bodies, primitives) = if swapped { ([&query.b, &query.a], [b, a]) } else { ([&query.a, &query.b], [a, b]) };
    let Some(pair) = Pair::new(bodies, primitives, query.resolution) else { return nothing };
    let turns = |spins: &[DVec3; 2]| *spins != [DVec3::ZERO; 2];
    let moves_along = || bodies.iter().all(|body| body.placed.motion.spin == DVec3::ZERO);
    let balls = matches!([&a.shape, &b.shape], [Shape::Sphere(_), Shape::Sphere(_)]);
    let met = match (&primitives[0].shape, &primitives[1].shape) {
        (Shape::Sphere(p), Shape::Sphere(q)) if !turns(&pair.spins()) => {
            balls::meet(&pair, [p.radius, q.radius], query.asked, outcome)
        }
        (Shape::Cuboid(p), Shape::Cuboid(q)) if moves_along() => {
            boxes::meet(&pair, [p.half, q.half], query.asked, outcome)
        }
        _ => None,
    };
    if met.is_none() {
        let Some(start) = Start::new(&pair) else { return nothing };
        match start.look(&mut outcome.counters.closed_forms) {
            Look::Overlap(common) => {
                start.tell(&common, query.asked, outcome);
                if query.asked.penetration || query.asked.past_overlap {
                    if swapped {
                        outcome.swap_sides();
                    }
                    return Quick::Overlap(start.own(0, common.x));
                }
            }
            Look::Apart(n) => {
                let spins = pair.spins();
                let told = if turns(&spins) {
                    Turning::new(&start, spins).and_then(|turning| turning.meet(n, query.asked, outcome))
                } else if !balls {
                    Straight::new(&start).and_then(|straight| straight.meet(query.asked, outcome))
                } else {
                    None
                };
                if told.is_none() {
                    return Quick::Open(Some(n));
                }
                if outcome.status == Status::Contact {
                    outcome.apart = start.gap(n) / n.length();
                }
            }
            Look::Open => return nothing,
        }
    }
    if swapped && outcome.status != Status::Clear {
        outcome.swap_sides();
    }
    Quick::Told
}

/// φ above this excludes a contact of depth delta, rounding included.
fn excluded(delta: f64, rounding: f64) -> f64 {
    -2.0 * delta + 4.0 * rounding
}

fn body_of(p: &Primitive) -> Option<Body<'_>> {
    Body::new(&p.shape, p.frame.matrix(), p.frame.position)
}
