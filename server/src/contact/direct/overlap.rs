//! Two convex primitives that overlap at the start, told from one line between them.
//!
//! F = max(f_A, f_B) is convex where both bodies are: along a line it falls to one lowest stretch and rises again. The line
//! between the centres starts deep inside the one and ends deep inside the other, so its lowest point is where both are
//! equally deep, found by false position. Where it misses, as corners that just reach into each other are missed, a common
//! point of the two cores, mostly where an edge of the one pierces a face of the other, begins another line: the shortest
//! combination of the normals around it leads away from all of them at once. A point that is 2 delta deep in both is the
//! proof of an overlap; without one, others decide.
//!
//! The direction is the one of three along which the bodies overlap least: the normals of the two faces that the point is
//! nearest to, and the way between the centres.

use super::super::asked::Asked;
use super::super::outcome::{Outcome, Status};
use super::super::pair::most_raised;
use super::Pair;
use super::gjk::{self, Meeting};
use super::support::Body;
use crate::solid::Primitive;
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// Steps of false position.
const STEPS: usize = 4;
/// Halves of the pair's scale that are tried as the length of a way.
const HALVES: usize = 30;
/// How near to a point, in scales of the pair, the faces pass that a way has to lead away from.
const NEAR: f64 = 1e-6;

/// What the first look at a pair found.
pub enum Look {
    /// A point of both bodies that is deeper than 2 delta, seen from A's centre, and how deep it is.
    Overlap(DVec3, f64),
    /// Apart, along a direction.
    Apart(DVec3),
    /// Neither was found.
    Open,
}

/// Two bodies at the start, along the world's axes and seen from A's centre.
pub struct Start<'a> {
    pub pair: &'a Pair<'a>,
    /// World from model.
    pub axes: [DMat3; 2],
    /// World from primitive.
    pub frames: [DMat3; 2],
    /// The primitives.
    pub bodies: [Body<'a>; 2],
    centers: [DVec3; 2],
}

impl<'a> Start<'a> {
    /// The start of a pair; `None` for bodies without bounds.
    pub fn new(pair: &'a Pair<'a>) -> Option<Self> {
        let axes = [pair.axes(0), pair.axes(1)];
        let frames = [pair.frame(0, &axes[0]), pair.frame(1, &axes[1])];
        let body = |k: usize, origin: DVec3| Body::new(&pair.primitives[k].shape, frames[k], origin);
        let bodies = [body(0, DVec3::ZERO)?, body(1, pair.way)?];
        Some(Self { pair, axes, frames, bodies, centers: [bodies[0].center(), bodies[1].center()] })
    }

    /// Looks for a common point of both bodies that is deeper than 2 delta, however the search may raise that, or else for a
    /// direction that separates them.
    pub fn look(&self, count: &mut u64) -> Look {
        let way = self.centers[1] - self.centers[0];
        if self.gap(way) > 0.0 {
            return Look::Apart(way);
        }
        let least = 2.0 * most_raised(self.pair.delta, self.pair.rounding) + self.pair.rounding;
        let (mut x, mut depth) = self.deepest(self.centers[0], self.centers[1]);
        if depth < least {
            *count += 1;
            (x, depth) = match gjk::meeting(&self.bodies[0], &self.bodies[1], way, gjk::GOOD) {
                // Cores that are apart, in balls that are not: halfway between the nearest points.
                Meeting::Apart(found) if found.distance < -2.0 * least => {
                    self.inwards(0.5 * (found.a + found.b), least)
                }
                Meeting::Apart(found) => return Look::Apart(found.normal),
                Meeting::Common(p) => self.inwards(p, least),
                Meeting::Open => return Look::Open,
            };
        }
        if depth < least { Look::Open } else { Look::Overlap(x, depth) }
    }

    /// Tells an overlap by a point of both.
    pub fn tell(&self, x: DVec3, depth: f64, asked: Asked, out: &mut Outcome) {
        let pair = self.pair;
        out.status = Status::Overlap;
        out.touching = true;
        (out.time_lower, out.time, out.time_upper) = (0.0, 0.0, 0.0);
        if !asked.point() {
            return;
        }
        out.counters.contacts += 1;
        let faces = [0, 1].map(|k| nearest_face(pair.primitives[k], self.own(k, x)));
        let way = (self.centers[1] - self.centers[0]).try_normalize();
        let of_faces = [self.axes[0] * faces[0].1, -(self.axes[1] * faces[1].1)];
        let mut normal = (f64::NEG_INFINITY, of_faces[0]);
        for n in of_faces.into_iter().chain(way) {
            let gap = self.gap(n);
            if gap > normal.0 {
                normal = (gap, n);
            }
        }
        out.point = pair.point(pair.offsets[0], x, 0.0);
        out.normal = normal.1.normalize();
        out.separation = -2.0 * depth;
        // From the centres of rotation.
        let arms = [pair.offsets[0] + x, pair.offsets[1] + (x - pair.way)];
        let [a, b] = [0, 1].map(|k| pair.bodies[k].placed.motion.spin.cross(arms[k]));
        out.normal_speed = (pair.velocity + a - b).dot(out.normal);
        (out.faces_a[0], out.faces_b[0]) = (faces[0].0, faces[1].0);
    }

    /// The gap along a direction, times its length; negative: how far they overlap along it.
    fn gap(&self, n: DVec3) -> f64 {
        -self.bodies[1].reach(-n) - self.bodies[0].reach(n)
    }

    /// A point in a body's own model.
    #[inline]
    pub fn own(&self, k: usize, x: DVec3) -> DVec3 {
        let x = if k == 0 { x } else { x - self.pair.way };
        self.axes[k].transpose() * x + self.pair.primitives[k].frame.position
    }

    /// f of both bodies.
    fn values(&self, x: DVec3) -> [f64; 2] {
        let of_faces = |k: usize| self.pair.primitives[k].value(self.own(k, x));
        [0, 1].map(|k| self.bodies[k].value(x).unwrap_or_else(|| of_faces(k)))
    }

    /// A common point, or where it lies on a surface the deepest of some points on ways that lead inwards from it; and how
    /// deep that lies in both.
    fn inwards(&self, p: DVec3, least: f64) -> (DVec3, f64) {
        let [of_a, of_b] = self.values(p);
        let mut best = (p, -of_a.max(of_b));
        if best.1 >= least {
            return best;
        }
        if let Some(way) = self.way_inwards(p) {
            let mut step = 0.5 * self.pair.scale;
            for _ in 0..HALVES {
                let x = p + way * step;
                let [a, b] = self.values(x);
                let depth = -a.max(b);
                if depth > best.1 {
                    best = (x, depth);
                } else if best.1 >= least {
                    break;
                }
                step *= 0.5;
            }
        }
        if best.1 >= least { best } else { self.deepest(p, self.centers[usize::from(of_b > of_a)]) }
    }

    /// A unit direction that leads away from all faces around a point of both bodies, if there is one.
    fn way_inwards(&self, p: DVec3) -> Option<DVec3> {
        let near = NEAR * self.pair.scale;
        let mut outward: SmallVec<[DVec3; 8]> = SmallVec::new();
        for k in 0..2 {
            let own = self.own(k, p);
            let faces = self.pair.primitives[k].faces.iter().filter(|f| f.value(own) > -near);
            outward.extend(faces.map(|f| self.axes[k] * f.at(own).normal));
        }
        Some(-gjk::least_of(&outward)?.try_normalize()?)
    }

    /// The deepest of some points of a line, and how deep it lies in both.
    fn deepest(&self, from: DVec3, to: DVec3) -> (DVec3, f64) {
        let mut best = (from, f64::NEG_INFINITY);
        let mut excess = |s: f64| {
            let x = from + (to - from) * s;
            let [a, b] = self.values(x);
            let depth = -a.max(b);
            if depth > best.1 {
                best = (x, depth);
            }
            a - b
        };
        // How much deeper in B than in A, at both ends of what is left of the line.
        let (mut low, mut high) = ((0.0, excess(0.0)), (1.0, excess(1.0)));
        for _ in 0..STEPS {
            if low.1 * high.1 >= 0.0 {
                break;
            }
            let s = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
            let value = excess(s);
            if value * high.1 < 0.0 {
                low = high;
            } else {
                // The end that stays counts half, lest it stay for ever (the Illinois rule).
                low.1 *= 0.5;
            }
            high = (s, value);
        }
        best
    }
}

/// The face that a point inside is nearest to, by its id, and its normal there; the primitive's model frame.
fn nearest_face(p: &Primitive, x: DVec3) -> (u32, DVec3) {
    let mut best = (f64::NEG_INFINITY, 0);
    for (i, face) in p.faces.iter().enumerate() {
        let value = face.value(x);
        if value > best.0 {
            best = (value, i);
        }
    }
    (p.first_face + best.1 as u32, p.faces[best.1].at(x).normal)
}
