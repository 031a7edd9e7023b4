//! Two convex primitives that overlap at the start, told from a few points between them.
//!
//! The middle of what they share along the way between the centres is mostly deep in both. Where it is not, as corners that
//! just reach into each other miss it, the shortest way below the tangent planes of both bodies leads on from there
//! (J. E. Kelley's cutting planes, J. SIAM 8(4), 1960, the two that are met at a time). Where that does not arrive, a common
//! point of the two cores, mostly where an edge of the one pierces a face of the other, begins a line: the shortest
//! combination of the normals around it leads away from all of them at once. F = max(f_A, f_B) is convex where both bodies
//! are: along a line it falls to one lowest stretch and rises again; where both are equally deep is found by false position.
//! A point that is 2 delta deep in both is the proof of an overlap; without one, others decide.
//!
//! The direction is the one of three along which the bodies overlap least: the normals of the two faces that the point is
//! nearest to, and the way between the centres.

use super::super::asked::Asked;
use super::super::outcome::{Outcome, Status};
use super::super::pair::most_raised;
use super::Pair;
use super::gjk::{self, Meeting};
use super::support::{Body, Slope};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// Steps of false position.
const STEPS: usize = 4;
/// Steps below tangent planes, the first one as deep as this part of what overlaps along the line between the centres.
const DESCENTS: usize = 6;
const WANTED: f64 = 0.25;
/// Planes whose normals have this square of the sine between them are one.
const PARALLEL: f64 = 1e-4;
/// Halves of the pair's scale that are tried as the length of a way.
const HALVES: usize = 30;
/// How near to a point, in scales of the pair, the faces pass that a way has to lead away from.
const NEAR: f64 = 1e-6;

/// What the first look at a pair found.
pub enum Look {
    /// They overlap.
    Overlap(Common),
    /// Apart, along a direction.
    Apart(DVec3),
    /// Neither was found.
    Open,
}

/// A point of both bodies.
pub struct Common {
    /// Seen from A's centre.
    pub x: DVec3,
    /// How deep it lies in each.
    slopes: [Slope; 2],
    /// How far the bodies overlap along the way between their centres, times its length.
    shared: f64,
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
        // (Arrays of two are written out where they are hot: a map over them stays a call.)
        let frames = [pair.frame(0, &axes[0]), pair.frame(1, &axes[1])];
        let body = |k: usize, origin: DVec3| Body::new(&pair.primitives[k].shape, frames[k], origin);
        let bodies = [body(0, DVec3::ZERO)?, body(1, pair.way)?];
        Some(Self { pair, axes, frames, bodies, centers: [bodies[0].center(), bodies[1].center()] })
    }

    /// Looks for a common point of both bodies that is deeper than 2 delta, however the search may raise that, or else for a
    /// direction that separates them.
    pub fn look(&self, count: &mut u64) -> Look {
        let way = self.centers[1] - self.centers[0];
        let (far, near) = (self.bodies[0].reach(way), -self.bodies[1].reach(-way));
        if near > far {
            return Look::Apart(way);
        }
        let least = 2.0 * most_raised(self.pair.delta, self.pair.rounding) + self.pair.rounding;
        // The middle of what they share along the way, between the centres.
        let square = way.length_squared();
        let middle = ((0.5 * (near + far) - way.dot(self.centers[0])) / square).clamp(0.0, 1.0);
        let middle = if middle.is_nan() { self.centers[0] } else { self.centers[0] + way * middle };
        let (mut x, mut slopes) = self.descend(middle, (far - near) / square.sqrt(), least);
        if depth(&slopes) < least {
            *count += 1;
            x = match gjk::meeting(&self.bodies[0], &self.bodies[1], way, gjk::GOOD) {
                // Cores that are apart, in balls that are not: halfway between the nearest points.
                Meeting::Apart(found) if found.distance < -2.0 * least => {
                    self.inwards(0.5 * (found.a + found.b), least)
                }
                Meeting::Apart(found) => return Look::Apart(found.normal),
                Meeting::Common(p) => self.inwards(p, least),
                Meeting::Open => return Look::Open,
            };
            slopes = self.slopes(x);
        }
        if depth(&slopes) < least { Look::Open } else { Look::Overlap(Common { x, slopes, shared: far - near }) }
    }

    /// Tells an overlap as it was found.
    pub fn tell(&self, common: &Common, asked: Asked, out: &mut Outcome) {
        let pair = self.pair;
        out.status = Status::Overlap;
        out.touching = true;
        (out.time_lower, out.time, out.time_upper) = (0.0, 0.0, 0.0);
        if !asked.point() {
            return;
        }
        out.counters.contacts += 1;
        let Common { x, slopes: [of_a, of_b], shared } = common;
        let way = self.centers[1] - self.centers[0];
        let length = way.length();
        let mut normal = (if length > 0.0 { -shared / length } else { f64::NEG_INFINITY }, way);
        for n in [of_a.normal, -of_b.normal] {
            let gap = self.gap(n);
            if gap > normal.0 {
                normal = (gap, n);
            }
        }
        out.point = pair.point(pair.offsets[0], *x, 0.0);
        out.normal = normal.1.normalize();
        out.separation = -2.0 * depth(&common.slopes);
        // From the centres of rotation.
        let arms = [pair.offsets[0] + x, pair.offsets[1] + (x - pair.way)];
        let swing = |k: usize| pair.bodies[k].placed.motion.spin.cross(arms[k]);
        let (a, b) = (swing(0), swing(1));
        out.normal_speed = (pair.velocity + a - b).dot(out.normal);
        let [p, q] = pair.primitives;
        (out.faces_a[0], out.faces_b[0]) = (p.first_face + of_a.face, q.first_face + of_b.face);
    }

    /// The gap along a direction, times its length; negative: how far they overlap along it.
    pub fn gap(&self, n: DVec3) -> f64 {
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
        let of = |k: usize| self.bodies[k].value(x).unwrap_or_else(|| of_faces(k));
        [of(0), of(1)]
    }

    /// How deep a point lies in both bodies.
    #[inline]
    fn slopes(&self, x: DVec3) -> [Slope; 2] {
        let of = |k: usize| self.bodies[k].slope(x).unwrap_or_else(|| self.slope_of_faces(k, x));
        [of(0), of(1)]
    }

    /// The same in one, by all of its faces.
    #[cold]
    fn slope_of_faces(&self, k: usize, x: DVec3) -> Slope {
        let (own, p) = (self.own(k, x), self.pair.primitives[k]);
        let values = p.faces.iter().map(|face| face.value(own));
        let first = (0, f64::NEG_INFINITY);
        let (face, f) = values.enumerate().fold(first, |best, (i, f)| if f > best.1 { (i, f) } else { best });
        Slope { f, normal: self.axes[k] * p.faces[face].at(own).normal, face: face as u32 }
    }

    /// The first of some points that is `least` deep in both bodies, or the last: each is the nearest to the one before that
    /// lies below the planes of both there.
    /// `along` is how much they overlap along some direction.
    fn descend(&self, from: DVec3, along: f64, least: f64) -> (DVec3, [Slope; 2]) {
        let mut x = from;
        let mut wanted = if along.is_finite() { (WANTED * along).max(2.0 * least) } else { 2.0 * least };
        let mut best = (x, self.slopes(x));
        for _ in 0..DESCENTS {
            if depth(&best.1) >= least {
                break;
            }
            let [Slope { f: a, normal: m, .. }, Slope { f: b, normal: n, .. }] = best.1;
            let (a, b, cosine) = (a + wanted, b + wanted, m.dot(n));
            let square = 1.0 - cosine * cosine;
            let (of_m, of_n) = (a - cosine * b, b - cosine * a);
            x -= if of_m <= 0.0 {
                n * b.max(0.0)
            } else if of_n <= 0.0 {
                m * a
            } else if square > PARALLEL {
                (m * of_m + n * of_n) / square
            } else {
                break;
            };
            wanted *= 0.5;
            best = (x, self.slopes(x));
        }
        best
    }

    /// A common point, or where it lies on a surface the deepest of some points on ways that lead inwards from it.
    fn inwards(&self, p: DVec3, least: f64) -> DVec3 {
        let [of_a, of_b] = self.values(p);
        let mut best = (p, -of_a.max(of_b));
        if best.1 >= least {
            return p;
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
        if best.1 >= least { best.0 } else { self.deepest(p, self.centers[usize::from(of_b > of_a)]) }
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

    /// The deepest of some points of a line.
    fn deepest(&self, from: DVec3, to: DVec3) -> DVec3 {
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
        best.0
    }
}

/// How deep a point lies in both bodies, negative outside.
fn depth([a, b]: &[Slope; 2]) -> f64 {
    -a.f.max(b.f)
}
