//! Time of contact of two convex primitives from their separation alone.
//!
//! Idea: let n separate the bodies by s at t. A point x of A, seen from B where n stands still, moves along n by at most
//! τ n·v(x) + q τ²/2, and n·v(x) is affine in x. So after τ they are still apart by at least
//! s(τ) = min over B of n·y − max over A of (n·x + τ n·v(x)) − q τ²/2, where the maximum is one support of A along
//! n + τ n×omega. s is concave in τ; as long as it is positive nothing touches. The step to its root is conservative
//! and, since first order is exact, nearly all of the separation is used up in each step.
//! Source: conservative advancement (Mirtich 1996) with the support taken after the motion; q from `motion::relative`.
//! Invariant: before `lower` the bodies are disjoint (rounding aside); at `upper` they share a point inside both.
//! Does not promise: `upper` for a touch that never goes deeper.

use super::miller::{Side, critical_generators};
use super::{Convex, Separation, Stand, clearance, separation, separation_only};
use contactd::motion::{Instant, Relative};
use contactd::solid::Primitive;
use glam::DVec3;

/// When two bodies meet, fractions of the step.
#[derive(Clone, Copy, Debug)]
pub struct Bracket {
    /// Disjoint before it.
    pub lower: f64,
    /// Root of the separation.
    pub time: f64,
    /// A common interior point exists then; infinite if none was found.
    pub upper: f64,
    /// Normal from a to b, a's model axes.
    pub normal: DVec3,
    /// Contact point in a's model frame.
    pub point: DVec3,
    /// Closing speed along the normal, length per step.
    pub speed: f64,
}

/// What becomes of a pair of primitives over a step.
#[derive(Clone, Copy, Debug)]
pub enum Meeting {
    /// They meet.
    Contact(Bracket),
    /// They stay apart over the whole step.
    Clear,
    /// They overlap at the start, by this depth at most.
    Overlap(f64),
    /// The round limit ran out; disjoint until then.
    Undecided(f64),
}

/// Rounds of advancement: each leaves a sixteenth where nothing curves, grazing passes take more.
const ROUNDS: usize = 2000;

/// Fraction of a separation that a step leaves in place.
const KEPT: f64 = 1.0 / 16.0;

/// When A and B first meet over the step. `None` if one of them is no bounded convex primitive.
pub fn time_of_contact(a: &Primitive, b: &Primitive, motion: &Relative) -> Option<Meeting> {
    let stand = |p: &Primitive| Stand { origin: p.frame.position, axes: p.frame.matrix() };
    let body_a = Convex::of(&a.shape)?.placed(&stand(a));
    let body_b = Convex::of(&b.shape)?.placed(&stand(b));
    Some(Advance::new(body_a, body_b, motion).run(a, b))
}

/// Rounds of advancement in a cavity: each uses up the clearance at the largest speed of any point, so a body that slides
/// along the wall takes as many as its speed is larger than the part of it towards the wall.
const ROUNDS_INSIDE: usize = 200_000;

/// When A, inside the cavity B at the start, first touches its wall. `None` if one of them is no bounded convex
/// primitive; `Overlap` if A sticks out of B at the start.
///
/// The clearance is the smallest distance of A's points from the wall, so it falls no faster than the fastest of them
/// moves against B: conservative advancement (Mirtich 1996), and one Newton step from where only rounding is left.
pub fn time_of_leaving(a: &Primitive, b: &Primitive, motion: &Relative) -> Option<Meeting> {
    let stand = |p: &Primitive| Stand { origin: p.frame.position, axes: p.frame.matrix() };
    let body_a = Convex::of(&a.shape)?.placed(&stand(a));
    let body_b = Convex::of(&b.shape)?.placed(&stand(b));
    let advance = Advance::new(body_a, body_b, motion);
    let noise = 4.0 * f64::EPSILON * (advance.b.ball().1 + advance.x_max);
    let mut t = 0.0;
    for _ in 0..ROUNDS_INSIDE {
        let at = motion.at(t);
        let c = clearance(&advance.a, &advance.b_at(&at));
        if t == 0.0 && c.value <= noise {
            return Some(Meeting::Overlap(-c.value));
        }
        let speed = motion.bounds(t, 1.0 - t, advance.x_max).speed;
        let step = c.value.max(0.0) / speed;
        if c.value > noise && t + step > t {
            t += step;
            if t >= 1.0 {
                return Some(Meeting::Clear);
            }
            continue;
        }
        let speed = c.normal.dot(at.velocity(c.point));
        let time = if speed > 0.0 { (t + c.value / speed).clamp(t, 1.0) } else { t };
        // The first later moment at which A certainly sticks out.
        let mut ahead = (noise / speed.abs().max(noise)).max(f64::EPSILON);
        let mut upper = f64::INFINITY;
        while upper.is_infinite() && time + ahead <= 1.0 {
            if clearance(&advance.a, &advance.b_at(&motion.at(time + ahead))).value < -noise {
                upper = time + ahead;
            }
            ahead *= 2.0;
        }
        return Some(Meeting::Contact(Bracket { lower: t, time, upper, normal: c.normal, point: c.point, speed }));
    }
    Some(Meeting::Undecided(t))
}

struct Advance<'m> {
    a: Convex,
    b: Convex,
    motion: &'m Relative,
    /// Farthest point of A from its centre of rotation.
    x_max: f64,
    size: f64,
}

impl<'m> Advance<'m> {
    fn new(a: Convex, b: Convex, motion: &'m Relative) -> Self {
        let ((ca, ra), (_, rb)) = (a.ball(), b.ball());
        let x_max = (ca - motion.center_a()).length() + ra;
        Self { a, b, motion, x_max, size: ra.max(rb) }
    }

    /// B where it stands in A's model frame.
    fn b_at(&self, at: &Instant) -> Convex {
        self.b.placed(&Stand { origin: at.a_point(DVec3::ZERO), axes: at.b_from_a.transpose() })
    }

    /// How far ahead the slab along n proves the bodies disjoint, at most `span`.
    fn ahead(&self, at: &Instant, b: &Convex, n: DVec3, span: f64) -> f64 {
        let floor = -b.reach(-n);
        // n·v(x) = rate + turn·x.
        let turn = n.cross(at.omega);
        let rate = n.dot(at.v0 - at.spin_b.cross(at.d)) - turn.dot(at.center_a);
        // The slab keeps a little of its width: from a direction that still separates, the next search climbs a
        // concave function.
        let keep = KEPT * (floor - self.a.reach(n)).max(0.0);
        let mut h = span;
        let mut safe: f64 = 0.0;
        // The curvature bound tightens with the span it holds over.
        for _ in 0..4 {
            let q = self.motion.bounds(at.t, h, self.x_max).curvature(at, n);
            let left = |tau: f64| floor - self.a.reach(n + turn * tau) - rate * tau - 0.5 * q * tau * tau - keep;
            if left(h) > 0.0 {
                return safe.max(h);
            }
            let (mut lo, mut hi) = (0.0, h);
            for _ in 0..60 {
                let mid = 0.5 * (lo + hi);
                if left(mid) > 0.0 { lo = mid } else { hi = mid }
            }
            let gained = lo > 1.01 * safe;
            safe = safe.max(lo);
            h = (2.0 * safe).min(h);
            if !gained || h == 0.0 {
                break;
            }
        }
        safe
    }

    fn run(&self, a: &Primitive, b: &Primitive) -> Meeting {
        // Rounding of a separation: a few operations on coordinates of the bodies and their distance.
        let noise = |at: &Instant| 4.0 * f64::EPSILON * (self.size + self.x_max + at.d.length());
        let mut t = 0.0;
        // The last separating direction, along B's axes where the slab stands still.
        let mut hint: Option<DVec3> = None;
        for _ in 0..ROUNDS {
            let at = self.motion.at(t);
            let body_b = self.b_at(&at);
            let (s, n) = separation_only(&self.a, &body_b, hint.map(|n| at.a_vector(n)));
            hint = Some(at.b_from_a * n);
            if s <= noise(&at) {
                if t == 0.0 {
                    return Meeting::Overlap(-s);
                }
                return self.finish(a, b, t, at.b_from_a * n);
            }
            let step = self.ahead(&at, &body_b, n, 1.0 - t);
            if t + step >= 1.0 {
                return Meeting::Clear;
            }
            if t + step <= t {
                return self.finish(a, b, t, at.b_from_a * n);
            }
            t += step;
        }
        Meeting::Undecided(t)
    }

    /// From the last time proven disjoint: the root by one Newton step, then a common point as soon after as there is.
    fn finish(&self, a: &Primitive, b: &Primitive, lower: f64, hint: DVec3) -> Meeting {
        let at = self.motion.at(lower);
        let s = separation(&self.a, &self.b_at(&at), Some(at.a_vector(hint)));
        let point = 0.5 * (s.points[0] + s.points[1]);
        let speed = s.normal.dot(at.velocity(point));
        let time = if speed > 0.0 { (lower + s.value.max(0.0) / speed).min(1.0) } else { lower };
        let mut upper = f64::INFINITY;
        let mut ahead = (f64::EPSILON * self.size / speed.abs().max(f64::EPSILON)).max(f64::EPSILON);
        while time + ahead <= 1.0 && upper.is_infinite() {
            let at = self.motion.at(time + ahead);
            let s = separation(&self.a, &self.b_at(&at), Some(at.a_vector(hint)));
            if self.common_point(a, b, &at, &s) {
                upper = time + ahead;
            }
            ahead *= 2.0;
        }
        Meeting::Contact(Bracket { lower, time, upper, normal: s.normal, point, speed })
    }

    /// Whether a point near the witnesses lies inside both. A corner's inward directions may lie far off the normal, so
    /// the witnesses are pulled towards the middles of the bodies by fractions of the depth.
    fn common_point(&self, a: &Primitive, b: &Primitive, at: &Instant, s: &Separation) -> bool {
        const PULLS: [f64; 5] = [0.0, 0.25, 0.5, 1.0, 2.0];
        let middles = [self.a.ball().0, self.b_at(at).ball().0];
        let [p, q] = s.points;
        // Where the sides of two cones cross, what one cuts out of the other's generators lies inside it.
        let mut chords: Vec<DVec3> = Vec::new();
        if let (Convex::Cone(p), Convex::Cone(q)) = (&self.a, &self.b_at(at))
            && let Some((p, q)) = Side::of(p).zip(Side::of(q))
        {
            chords.extend(critical_generators(&p, &q).iter().map(|g| g.point));
        }
        [0.5 * (p + q), p, q].into_iter().chain(chords).any(|x| {
            let [to_a, to_b] = middles.map(|m| (m - x).normalize_or_zero() * s.value.abs());
            PULLS.iter().any(|f| {
                PULLS.iter().any(|g| {
                    let x = x + to_a * *f + to_b * *g;
                    a.value(x) <= 0.0 && b.value(at.b_point(x)) <= 0.0
                })
            })
        })
    }
}
