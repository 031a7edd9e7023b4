//! Two convex bodies that only move along: the time of contact is a maximum over directions.
//!
//! With w the velocity of A against B, c the way from A's centre to B's and h the supports, a direction n keeps the bodies
//! apart while n·c − h_A(n) − h_B(−n) − t n·w > 0. So
//!
//! ```text
//! t = max over n·w > 0 of φ(n) / n·w,    φ(n) = n·c − h_A(n) − h_B(−n)
//! ```
//!
//! and every n is the proof of a lower bound: no time is cut. φ is concave, and linear along rays. Two parts find the maximum:
//!
//! 1. Cutting planes. φ is the least n·d over the points d of the difference B − A; of these three are kept whose triangle
//!    the ray t w pierces, as a simplex step of the linear programme would (J. E. Kelley 1960; seen from the points it is
//!    portal refinement, G. Snethen, Game Programming Gems 7, 2.5). Its normal is the next direction. A direction that is
//!    free until the end of the step is the answer "clear".
//! 2. Newton. Near the maximum the features that meet are known: a body that shows an edge or a side along n holds n to
//!    a circle of directions, two circles hold it altogether, else φ is smooth on what is left. Steps on the unit sphere
//!    converge quadratically; with H the second derivative of φ, along a circle n·a = lean with multiplier μ it is H + μ lean.
//!
//! What does not settle, starts near, or meets in more than its faces tell (`touch`) is left to the advance.

use super::overlap::Start;
use super::part::ConvexPart;
use super::steer::steer;
use super::touch::Stand;
use super::whole::{APART, PrimitivePair, excluded};
use crate::contact::query::options::QueryOptions;
use crate::contact::query::outcome::Outcome;
use crate::math::any_perpendicular;
use crate::solid::primitive::Shown;
use glam::{DVec2, DVec3};

/// Cutting planes at most.
const CUTS: usize = 32;
/// Gap between the bounds of the time, in lengths of the pair's size, from which features are asked, and how near to a
/// circle of directions one is held by it.
const TRIES: [(f64, f64); 4] = [(3e-2, 0.1), (1e-3, 0.03), (1e-5, 3e-3), (1e-8, 1e-4)];
/// Newton steps of one try.
const STEPS: usize = 10;
/// A step this small (radians) leaves an error of its square.
const SETTLED: f64 = 1e-8;

/// Gap that the proof may leave at the time of contact, in sizes of the pair.
const CLOSED: f64 = 1e-14;
/// A flat face lies this flat on another (radians).
const FLAT: f64 = 1e-9;

/// Extent of the artificial triangle to start from, in sizes of the pair, and its height in extents: the larger, the nearer a
/// miss is told.
const START: [f64; 2] = [4.0, 1e4];

/// A point of the difference of the bodies: across the motion, and along it.
#[derive(Clone, Copy)]
struct Cut {
    across: DVec2,
    along: f64,
}

/// The pair along the world's axes, seen from A's centre.
pub struct Straight<'a> {
    pair: &'a PrimitivePair<'a>,
    start: &'a Start<'a>,
    parts: [ConvexPart<'a>; 2],
}

impl<'a> Straight<'a> {
    /// The pair, where it is one for this.
    #[inline]
    pub fn new(start: &'a Start<'a>) -> Option<Self> {
        let Start { pair, frames, .. } = start;
        let parts = [ConvexPart::new(pair.primitives[0], frames[0])?, ConvexPart::new(pair.primitives[1], frames[1])?];
        Some(Self { pair, start, parts })
    }

    /// Fills in the earliest contact, or leaves `out` clear; `None` leaves the pair to others. Tries are counted.
    pub fn meet(&self, query_options: QueryOptions, out: &mut Outcome) -> Option<()> {
        let (c, w) = (self.pair.way, self.pair.velocity);
        let [a, b] = &self.start.bodies;
        let phi = |n: DVec3| -b.reach(-n) - a.reach(n);
        let speed = w.length();
        // Along the centres: most pairs that stay apart are told at once.
        let first = phi(c);
        let rate = c.dot(w);
        if first.min(first - rate) > 0.0 {
            return Some(());
        }
        if speed <= f64::MIN_POSITIVE {
            return None;
        }
        let size = self.size();
        let way = w / speed;
        let e = any_perpendicular(way);
        let f = way.cross(e);
        let margin = a.margin + b.margin;
        let far = START[0] * size;
        let corner = |x: f64, y: f64| Cut { across: DVec2::new(x, y) * far, along: far * START[1] };
        let mut cuts = [corner(1.0, 0.0), corner(-0.5, 0.75), corner(-0.5, -0.75)];
        let mut next = 0;
        for _ in 0..CUTS {
            let [p, q, r] = cuts;
            let (pq, pr) = (q.across - p.across, r.across - p.across);
            let area = pq.perp_dot(pr);
            let (hq, hr) = (q.along - p.along, r.along - p.along);
            // along + slope·across is the same at the three.
            let slope = DVec2::new(hr * pq.y - hq * pr.y, hq * pr.x - hr * pq.x) / area;
            if !slope.is_finite() {
                return None;
            }
            let above = p.along + slope.dot(p.across);
            let n = way + e * slope.x + f * slope.y;
            let length = n.length();
            let d = b.support(-n) - a.support(n) - n * (margin / length);
            let below = n.dot(d);
            // Free from the start to the end.
            if below.min(below - speed) > 0.0 {
                return Some(());
            }
            if next < TRIES.len() && above - below <= TRIES[next].0 * size {
                while next < TRIES.len() && above - below <= TRIES[next].0 * size {
                    next += 1;
                }
                out.counters.closed_forms += 1;
                if let Some((n, shown)) = self.settle(n / length, TRIES[next - 1].1)
                    && self.contact(n, &shown, query_options, out).is_some()
                {
                    return Some(());
                }
                if next == TRIES.len() {
                    return None;
                }
            }
            let cut = Cut { across: DVec2::new(d.dot(e), d.dot(f)), along: d.dot(way) };
            // Weights of the three that make 0, and of those that make the new point: the first one to vanish leaves.
            let weights = |y: DVec2| {
                let u = (y - p.across).perp_dot(pr) / area;
                let v = pq.perp_dot(y - p.across) / area;
                [1.0 - u - v, u, v]
            };
            let (have, want) = (weights(DVec2::ZERO), weights(cut.across));
            let mut leaving = (f64::INFINITY, 3);
            for k in 0..3 {
                if want[k] > 1e-14 && have[k].max(0.0) < leaving.0 * want[k] {
                    leaving = (have[k].max(0.0) / want[k], k);
                }
            }
            if leaving.1 == 3 {
                return None;
            }
            cuts[leaving.1] = cut;
        }
        None
    }

    /// The direction of the maximum near n, with the features that meet; a unit vector.
    fn settle(&self, mut n: DVec3, tol: f64) -> Option<(DVec3, [Shown; 2])> {
        let (c, w) = (self.pair.way, self.pair.velocity);
        // Which circles hold it is told once.
        let mut held = [self.parts[0].held(n, tol), self.parts[1].held(-n, tol)];
        if held[0].1 || held[1].1 {
            let k = usize::from(!held[0].1);
            let sign = if k == 0 { 1.0 } else { -1.0 };
            let l = self.parts[k].axes.transpose() * (n * sign);
            let axis = l.abs().max_position();
            n = (self.parts[k].axes.col(axis) * (l[axis].signum() * sign)).normalize();
            held[1 - k] = self.parts[1 - k].held(-n * sign, FLAT);
            return Some((n, [self.parts[0].shown(n, held[0]), self.parts[1].shown(-n, held[1])]));
        }
        let mut shown = [self.parts[0].shown(n, held[0]), self.parts[1].shown(-n, held[1])];
        for _ in 0..STEPS {
            let d = c + shown[1].ends[0] - shown[0].ends[0];
            let s = n.dot(w);
            if s <= 0.0 {
                return None;
            }
            let g = d - w * (n.dot(d) / s);
            let none = DVec3::ZERO;
            let (step, _) = steer(&self.parts, &held, &shown, n, (g, 0.0), none, [none; 2])?;
            let long = step.length();
            if !long.is_finite() {
                return None;
            }
            let step = if long > 0.5 { step * (0.5 / long) } else { step };
            n = (n + step).normalize();
            shown = [self.parts[0].shown(n, held[0]), self.parts[1].shown(-n, held[1])];
            if long <= SETTLED {
                return Some((n, shown));
            }
        }
        None
    }

    /// Tells the contact along n if both trees confirm it, or leaves `out` clear if it comes after the step.
    fn contact(&self, n: DVec3, shown: &[Shown; 2], query_options: QueryOptions, out: &mut Outcome) -> Option<()> {
        let pair = self.pair;
        let [a, b] = &self.start.bodies;
        let phi = -b.reach(-n) - a.reach(n);
        let speed = n.dot(pair.velocity);
        let least = excluded(pair.delta, pair.rounding);
        if phi <= APART * pair.delta || speed <= 0.0 {
            return None;
        }
        if phi - speed > 0.0 {
            return Some(());
        }
        let touch = Stand::new(pair, self.parts, self.start.axes, None).confirm(n, phi / speed, shown);
        let touch = touch.as_ref()?;
        // The proof and the point are of one time.
        let left = phi - touch.t * speed;
        if !(left > least && left.abs() <= CLOSED * self.size()) {
            return None;
        }
        touch.report(pair, query_options, out);
        Some(())
    }

    fn size(&self) -> f64 {
        self.parts[0].primitive.ball.radius + self.parts[1].primitive.ball.radius
    }
}
