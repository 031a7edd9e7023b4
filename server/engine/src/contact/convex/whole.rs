//! Two whole primitives as they stand at the start and move along: what every way of answering them begins with.

use super::support::ConvexBody;
use crate::contact::exclusion::rounding;
use crate::contact::query::question;
use crate::contact::query::task::witness_level;
use crate::math::tolerance;
use crate::motion::Rounding;
use crate::solid::Primitive;
use glam::{DMat3, DQuat, DVec3};

/// Resolutions that the bodies must be apart at the start: what is nearer may be touching, which the search tells.
pub const APART: f64 = 4.0;

/// Two whole primitives at the start and as they move along; world axes.
pub(super) struct PrimitivePair<'a> {
    pub(super) bodies: [&'a question::PlacedModel<'a>; 2],
    pub(super) primitives: [&'a Primitive; 2],
    /// From an object's origin to its primitive's centre.
    pub(super) offsets: [DVec3; 2],
    /// From A's centre to B's at the start.
    pub(super) way: DVec3,
    /// Of A against B, length per step.
    pub(super) velocity: DVec3,
    /// Depth at which a contact is decided.
    pub(super) delta: f64,
    /// What rounding may do to one bound.
    pub(super) rounding: f64,
    /// Length scale of the pair.
    pub(super) scale: f64,
}

impl<'a> PrimitivePair<'a> {
    /// The pair of two bodies, the first of which carries; `None` if the resolution needs raising.
    pub(super) fn new(
        bodies: [&'a question::PlacedModel<'a>; 2],
        primitives: [&'a Primitive; 2],
        resolution: f64,
    ) -> Option<Self> {
        let [a, b] = bodies;
        let (from, to) = (&a.placed.motion, &b.placed.motion);
        let difference = from.start.position - to.start.position;
        let velocity = from.velocity - to.velocity;
        let apart = difference.length_squared().max((difference + velocity).length_squared()).sqrt();
        let length = |v: DVec3| if v == DVec3::ZERO { 0.0 } else { v.length() };
        let places = [length(a.placed.place.position), length(b.placed.place.position)];
        let turns = [length(from.spin), length(to.spin)];
        let motion = Rounding::with(turns[0] + turns[1], apart, places[0] + places[1]);
        let rounding = rounding::of_motion(a.model, b.model, places, apart, &motion);
        let scale = a.model.size().max(b.model.size());
        // Sums of components: no less than lengths, and no roots.
        let center = |body: &question::PlacedModel| body.model.bounds.root().ball.center.abs().element_sum();
        let centers = [center(a), center(b)];
        let extent = centers[0] + centers[1] + 2.0 * scale + places[0] + apart;
        let least = (tolerance::LEAST_RESOLUTION * extent).max(tolerance::LEAST_ROUNDINGS * rounding);
        if resolution.is_nan() || resolution < least {
            return None;
        }
        let offset = |body: &question::PlacedModel, primitive: &Primitive| {
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
    pub(super) fn spins(&self) -> [DVec3; 2] {
        let spin = |body: &question::PlacedModel| {
            if question::spins_in_itself(body) { DVec3::ZERO } else { body.placed.motion.spin }
        };
        [spin(self.bodies[0]), spin(self.bodies[1])]
    }

    /// World from model: the rotation.
    #[inline]
    pub(super) fn axes(&self, k: usize) -> DMat3 {
        let placed = &self.bodies[k].placed;
        let (start, place) = (placed.motion.start.rotation, placed.place.rotation);
        DMat3::from_quat(if place == DQuat::IDENTITY { start } else { start * place })
    }

    /// World from primitive: the rotation, from that of the model.
    #[inline(always)] // Mostly a copy.
    pub(super) fn frame(&self, k: usize, axes: &DMat3) -> DMat3 {
        let frame = self.primitives[k].frame.rotation;
        if frame == DQuat::IDENTITY { *axes } else { *axes * DMat3::from_quat(frame) }
    }

    /// From A's centre to B's at a time.
    pub(super) fn at(&self, t: f64) -> DVec3 {
        self.way - self.velocity * t
    }

    /// A point seen from A's centre, which is `offset` from its centre of rotation by then, in the world.
    pub(super) fn point(&self, offset: DVec3, x: DVec3, t: f64) -> DVec3 {
        let motion = &self.bodies[0].placed.motion;
        motion.start.position + motion.velocity * t + (offset + x)
    }

    pub(super) fn witness_level(&self) -> f64 {
        witness_level(self.delta, self.rounding)
    }
}

/// φ above this excludes a contact of depth delta, rounding included.
pub fn excluded(delta: f64, rounding: f64) -> f64 {
    -2.0 * delta + 4.0 * rounding
}

pub fn body_of(p: &Primitive) -> Option<ConvexBody<'_>> {
    ConvexBody::new(&p.shape, p.frame.matrix(), p.frame.position)
}
