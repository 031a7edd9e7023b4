//! Two convex primitives that overlap at the start, told from a few points between them.
//!
//! The middle of what they share along the way between the centres is mostly deep in both. Where it is not, as corners that
//! just reach into each other miss it, the shortest way below the tangent planes of both bodies leads on from there
//! (J. E. Kelley's cutting planes, J. SIAM 8(4), 1960, the two that are met at a time). Where that does not arrive, a common
//! point of the two cores, mostly where an edge of the one pierces a face of the other, begins a line: the shortest
//! combination of the normals around it leads away from all of them at once. A point that is 2 delta deep in both is the proof
//! of an overlap; without one, others decide.
//!
//! The direction is the one of three along which the bodies overlap least: the normals of the two faces that the point is
//! nearest to, and the way between the centres.

use super::gjk::{self, Meeting};
use super::support::ConvexBody;
use super::whole::PrimitivePair;
use crate::contact::query::options::QueryOptions;
use crate::contact::query::outcome::{ContactPoint, NO_FACE, Outcome, Overlap, Verdict};
use crate::contact::query::task::most_raised;
use crate::math::gjk::{GOOD, least_of};
use crate::solid::primitive::Slope;
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// Steps below tangent planes, the first one as deep as this part of what overlaps along the line between the centres.
const DESCENTS: usize = 6;
const WANTED: f64 = 0.25;
/// Planes whose normals have this square of the sine between them are one.
const PARALLEL: f64 = 1e-4;
/// Halves of the pair's scale that are tried as the length of a way.
const HALVES: usize = 30;
/// Relative gap between the distance and its lower bound from which a direction separates as well as any, and from which the
/// point halfway between balls that reach into each other is looked for again.
const ROUGH: f64 = 1e-2;
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
    pub pair: &'a PrimitivePair<'a>,
    /// World from model.
    pub axes: [DMat3; 2],
    /// World from primitive.
    pub frames: [DMat3; 2],
    /// The primitives.
    pub bodies: [ConvexBody<'a>; 2],
    centers: [DVec3; 2],
}

impl<'a> Start<'a> {
    /// The start of a pair; `None` for bodies without bounds.
    pub fn new(pair: &'a PrimitivePair<'a>) -> Option<Self> {
        let axes = [pair.axes(0), pair.axes(1)];
        // (Arrays of two are written out where they are hot: a map over them stays a call.)
        let frames = [pair.frame(0, &axes[0]), pair.frame(1, &axes[1])];
        let body = |k: usize, origin: DVec3| ConvexBody::new(&pair.primitives[k].shape, frames[k], origin);
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
            for good in [ROUGH, GOOD] {
                let p = match gjk::meeting(&self.bodies[0], &self.bodies[1], way, good) {
                    // Cores that are apart, in balls that are not: halfway between the nearest points.
                    Meeting::Apart(found) if found.distance < -2.0 * least => 0.5 * (found.a + found.b),
                    // Nearly the direction of nearest points does not separate balls that are near.
                    Meeting::Apart(found) if good == ROUGH && self.gap(found.normal) <= 0.0 => continue,
                    Meeting::Apart(found) => return Look::Apart(found.normal),
                    Meeting::Common(p) => p,
                    Meeting::Open => return Look::Open,
                };
                (x, slopes) = self.inwards(p, least);
                if depth(&slopes) >= least {
                    break;
                }
            }
        }
        if depth(&slopes) < least { Look::Open } else { Look::Overlap(Common { x, slopes, shared: far - near }) }
    }

    /// Tells an overlap as it was found.
    pub fn report(&self, common: &Common, query_options: QueryOptions, out: &mut Outcome) {
        let pair = self.pair;
        out.verdict = Verdict::OVERLAP;
        out.touching = true;
        if !query_options.point() {
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
        let normal = normal.1.normalize();
        // From the centres of rotation.
        let arms = [pair.offsets[0] + x, pair.offsets[1] + (x - pair.way)];
        let swing = |k: usize| pair.bodies[k].placed.motion.spin.cross(arms[k]);
        let (a, b) = (swing(0), swing(1));
        let [p, q] = pair.primitives;
        let point = ContactPoint {
            point: pair.point(pair.offsets[0], *x, 0.0),
            normal,
            separation: -2.0 * depth(&common.slopes),
            normal_speed: (pair.velocity + a - b).dot(normal),
            faces_a: [p.first_face + of_a.face, NO_FACE, NO_FACE],
            faces_b: [q.first_face + of_b.face, NO_FACE, NO_FACE],
            ..ContactPoint::default()
        };
        out.verdict = Verdict::Overlap(Overlap { time: 0.0, point: Some(point), penetration: None });
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
        let (face, f) = p.highest(own);
        Slope { f, normal: self.axes[k] * p.faces[face].at(own).unit(), face: face as u32 }
    }

    /// The first of some points that is `least` deep in both bodies, or the last: each is the nearest to the one before that
    /// lies below the planes of both there.
    /// `along` is how much they overlap along some direction.
    fn descend(&self, from: DVec3, along: f64, least: f64) -> (DVec3, [Slope; 2]) {
        let mut x = from;
        let mut wanted = if along.is_finite() { (WANTED * along).max(2.0 * least) } else { 2.0 * least };
        let mut slopes = self.slopes(x);
        for _ in 0..DESCENTS {
            if depth(&slopes) >= least {
                break;
            }
            let [Slope { f: a, normal: m, .. }, Slope { f: b, normal: n, .. }] = slopes;
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
            wanted = (0.5 * wanted).max(2.0 * least);
            slopes = self.slopes(x);
        }
        (x, slopes)
    }

    /// A common point, or where it lies on a surface the deepest of some points on a way that leads inwards from it: away from
    /// all faces there, or, as from the apex of a cone, to the centre.
    fn inwards(&self, p: DVec3, least: f64) -> (DVec3, [Slope; 2]) {
        let mut best = (p, self.slopes(p));
        if depth(&best.1) >= least {
            return best;
        }
        let outer = usize::from(best.1[1].f > best.1[0].f);
        let to_center = || (self.centers[outer] - p).try_normalize();
        for way in [&|| self.way_inwards(p), &to_center as &dyn Fn() -> Option<DVec3>] {
            let Some(way) = way() else { continue };
            let mut step = 0.5 * self.pair.scale;
            for _ in 0..HALVES {
                let x = p + way * step;
                let slopes = self.slopes(x);
                if depth(&slopes) > depth(&best.1) {
                    best = (x, slopes);
                } else if depth(&best.1) >= least {
                    break;
                }
                step *= 0.5;
            }
            if depth(&best.1) >= least {
                break;
            }
        }
        best
    }

    /// A unit direction that leads away from all faces around a point of both bodies, if there is one.
    fn way_inwards(&self, p: DVec3) -> Option<DVec3> {
        let near = NEAR * self.pair.scale;
        let mut outward: SmallVec<[DVec3; 8]> = SmallVec::new();
        for k in 0..2 {
            let own = self.own(k, p);
            let faces = self.pair.primitives[k].faces.listed().iter().filter(|f| f.value(own) > -near);
            outward.extend(faces.map(|f| self.axes[k] * f.at(own).unit()));
        }
        Some(-least_of(&outward)?.try_normalize()?)
    }
}

/// How deep a point lies in both bodies, negative outside.
fn depth([a, b]: &[Slope; 2]) -> f64 {
    -a.f.max(b.f)
}
