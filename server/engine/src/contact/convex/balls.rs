//! Two balls that only move along: one quadratic.
//!
//! With c the way from A's centre to B's at the start, v the velocity of A against B and R the distance of the centres that is
//! asked for, |c − vt| = R has the earlier root
//!
//! ```text
//! t = (|c|² − R²) / (c·v + √(v²R² − |c×v|²))
//! ```
//!
//! which cancels nothing for an approaching pair outside R; for a smaller R it is later by the difference of the squares of both
//! over the sum of their square roots. The distance is convex in time, so over a span that ends before the closest approach it
//! is least at the end: one evaluation there is the proof.
//!
//! Balls in the origins of their objects, the common case, need nothing else of a pair (`quick`).

use super::whole::{APART, PrimitivePair, excluded};
use crate::contact::exclusion::rounding;
use crate::contact::query::options::QueryOptions;
use crate::contact::query::outcome::{Contact, ContactPoint, Counters, NO_FACE, Outcome, Verdict};
use crate::contact::query::question::{self, PairQuery};
use crate::contact::query::task::witness_level;
use crate::contact::witness::extent::INCIDENT;
use crate::math::tolerance;
use crate::motion::Rounding;
use glam::DVec3;

/// Two balls, the first of which carries; world axes.
struct Balls {
    radii: [f64; 2],
    /// Their faces' ids.
    faces: [u32; 2],
    /// A's centre at the start, and its velocity.
    center: DVec3,
    own: DVec3,
    /// From A's centre to B's at the start.
    way: DVec3,
    /// Of A against B, length per step.
    velocity: DVec3,
    /// Depth at which a contact is decided.
    delta: f64,
    /// What rounding may do to one bound.
    rounding: f64,
}

/// What becomes of two balls.
pub struct Passage {
    /// Their contact; `None` where they miss each other.
    met: Option<Met>,
    swapped: bool,
}

/// A contact of two balls.
struct Met {
    touch: f64,
    deep: f64,
    point: DVec3,
    normal: DVec3,
    speed: f64,
    faces: [u32; 2],
    /// Separation at the start.
    apart: f64,
}

impl Passage {
    /// The answer. In one piece: one that is filled in by and by is copied once more, which costs as much as two balls do.
    #[inline(always)]
    pub fn outcome(self, query: &PairQuery) -> Outcome {
        let (resolution, query_options) = (query.resolution, query.query_options);
        let counters = Counters { primitives: 2, ..Counters::default() };
        let Some(met) = self.met else {
            return Outcome { counters, ..Outcome::clear(resolution) };
        };
        let (first, second) = if self.swapped { (1, 0) } else { (0, 1) };
        let sign = if self.swapped { -1.0 } else { 1.0 };
        Outcome {
            verdict: Verdict::Contact(Contact {
                point: query_options.point().then(|| met.point([first, second], sign)),
                ..Contact::at(met.touch, met.deep)
            }),
            apart: met.apart,
            counters: met.counters(query_options, counters),
            ..Outcome::clear(resolution)
        }
    }
}

impl Met {
    /// Where the balls meet, with a's face and b's in this order; `sign` is that of the normal.
    #[inline(always)]
    fn point(&self, order: [usize; 2], sign: f64) -> ContactPoint {
        ContactPoint {
            point: self.point,
            normal: self.normal * sign,
            normal_speed: self.speed,
            faces_a: [self.faces[order[0]], NO_FACE, NO_FACE],
            faces_b: [self.faces[order[1]], NO_FACE, NO_FACE],
            ..ContactPoint::default()
        }
    }

    fn counters(&self, query_options: QueryOptions, counters: Counters) -> Counters {
        Counters {
            closed_forms: counters.closed_forms + 1,
            times: u64::from(query_options.time()),
            contacts: u64::from(query_options.point()),
            ..counters
        }
    }
}

/// The answer for two balls about the origins of objects that do not turn; `None` leaves them to others.
#[inline(always)]
pub fn quick(query: &PairQuery) -> Option<Passage> {
    let swapped = query.b.model.radius < query.a.model.radius;
    let (a, b) = if swapped { (&query.b, &query.a) } else { (&query.a, &query.b) };
    let (radius_a, face_a) = centered(a)?;
    let (radius_b, face_b) = centered(b)?;
    let (from, to) = (&a.placed.motion, &b.placed.motion);
    let way = to.start.position - from.start.position;
    let velocity = from.velocity - to.velocity;
    let apart = larger(no_shorter(way), no_shorter(way - velocity));
    let rounding = rounding::of_motion(a.model, b.model, [0.0; 2], apart, &Rounding::with(0.0, apart, 0.0));
    let extent = 2.0 * b.model.radius + apart;
    let least = (tolerance::LEAST_RESOLUTION * extent).max(tolerance::LEAST_ROUNDINGS * rounding);
    // Also false for what is not a number.
    if !(query.strategies.convex && query.resolution >= least) {
        return None;
    }
    let balls = Balls {
        radii: [radius_a, radius_b],
        faces: [face_a, face_b],
        center: from.start.position,
        own: from.velocity,
        way,
        velocity,
        delta: query.resolution,
        rounding,
    };
    Some(Passage { met: balls.meet()?, swapped })
}

/// The larger number, in one instruction.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// A length that is no less than the vector's and by a sixth more at most, without a root, for which the answer would wait:
/// with the other two components as large as the largest or 0 it is no less, and a length is convex in them.
#[inline(always)]
fn no_shorter(v: DVec3) -> f64 {
    const EACH: f64 = std::f64::consts::SQRT_2 - 1.0 + 1e-12;
    let v = v.abs();
    EACH * (v.x + v.y + v.z) + (1.0 - EACH + 1e-12) * larger(larger(v.x, v.y), v.z)
}

/// The radius and the face of a body that is a ball about its object's origin and does not turn.
#[inline(always)] // Its answer passes through memory otherwise: a quarter of the time that two balls take.
fn centered(body: &question::PlacedModel) -> Option<(f64, u32)> {
    let placed = &body.placed;
    // Zeros of either sign: one comparison for six numbers.
    let bits = |v: DVec3| v.x.to_bits() | v.y.to_bits() | v.z.to_bits();
    let stays = (bits(placed.motion.spin) | bits(placed.place.position)) << 1 == 0;
    body.model.ball.filter(|_| stays)
}

/// Fills in the contact of two balls that do not turn, or leaves `out` clear where they miss each other; `None` leaves
/// them to others: they start too near or come within rounding of depth delta.
pub fn meet(pair: &PrimitivePair, radii: [f64; 2], query_options: QueryOptions, out: &mut Outcome) -> Option<()> {
    let motion = &pair.bodies[0].placed.motion;
    let balls = Balls {
        radii,
        faces: [pair.primitives[0].first_face, pair.primitives[1].first_face],
        center: motion.start.position + pair.offsets[0],
        own: motion.velocity,
        way: pair.way,
        velocity: pair.velocity,
        delta: pair.delta,
        rounding: pair.rounding,
    };
    if let Some(met) = balls.meet()? {
        let point = query_options.point().then(|| met.point([0, 1], 1.0));
        out.verdict = Verdict::Contact(Contact { point, ..Contact::at(met.touch, met.deep) });
        out.apart = met.apart;
        out.counters = met.counters(query_options, out.counters);
    }
    Some(())
}

impl Balls {
    /// The contact, `Some(None)` where they miss each other.
    #[inline(always)]
    fn meet(&self) -> Option<Option<Met>> {
        let (c, v) = (self.way, self.velocity);
        let (sum, least) = (self.radii[0] + self.radii[1], excluded(self.delta, self.rounding));
        let apart = c.length_squared();
        let touching = sum + APART * self.delta;
        let (miss, level) = (sum + least, witness_level(self.delta, self.rounding));
        let deepest = sum - level - self.delta - self.rounding;
        if apart <= touching * touching || deepest <= 0.0 || miss <= 0.0 {
            return None;
        }
        let (square, along) = (v.length_squared(), c.dot(v));
        // They come closest at the start, at the end, or in between, where v is across the way.
        if along <= 0.0 {
            return Some(None);
        }
        let beside = c.cross(v).length_squared();
        let within = along < square;
        if if within { beside > miss * miss * square } else { (c - v).length_squared() > miss * miss } {
            return Some(None);
        }
        let left = (square * sum * sum - beside).max(0.0);
        let root = left.sqrt();
        let touch = (apart - sum * sum) / (along + root);
        // From there on, at R less 2 levels: the touch, and what follows from it, need not wait for what rounding does.
        let less = 4.0 * level * (sum - level);
        let deep = touch + less / (root + (left - square * less).max(0.0).sqrt());
        let way = c - v * touch;
        // |way| = sum·√(1 + 2e) with e of the size of rounding: its square is less than that.
        let each = 1.0 / sum;
        let e = 0.5 * (way.length_squared() * (each * each) - 1.0);
        // A's point at `level` is that deep in B, too.
        let is_deep = (c - v * deep).length_squared() <= deepest * deepest;
        let ordered = 0.0 <= touch && touch <= deep && deep <= 1.0 && deep * square <= along;
        let gap = e * sum;
        if !(ordered && is_deep && gap.abs() <= INCIDENT * self.rounding && gap > least) {
            return None;
        }
        let n = way * (each - e * each);
        Some(Some(Met {
            touch,
            deep,
            point: self.center + self.own * touch + n * self.radii[0],
            normal: n,
            speed: n.dot(v),
            faces: self.faces,
            apart: apart.sqrt() - sum,
        }))
    }
}
