//! The nearest points of a facet and a curved convex body: from what GJK leaves to rounding, by Newton's method.
//!
//! A point of the facet goes along its plane, along an edge or nowhere: which of these it is, the bound along the direction between the
//! points proves.

use super::body::{Body, Cover, Seen, both_seen};
use super::near::{Near, gap};
use super::triangles::Triangle;
use crate::contact::distance::active_set::Clause;
use crate::contact::distance::convex::{NEAR, STEPS};
use crate::contact::distance::polish::{Held, Polish, Side, Steps};
use crate::motion::Instant;
use glam::DVec3;
use smallvec::SmallVec;

/// A weight of a corner in a point from which on the corner counts as holding it, at first.
const HOLDS: f64 = 1e-3;

/// How far outside of the body its point may be, in rounding's lengths.
const OFF: f64 = 4.0;

/// How near and how exact.
#[derive(Clone, Copy)]
pub struct Sizes {
    /// The pair's size, a length.
    pub scale: f64,
    /// What rounding may do to f, a length.
    pub rounding: f64,
    /// Bounds from both sides that are as near to each other are exact enough, a length.
    pub enough: f64,
}

/// The nearest points of two covers with what was found of them; the same where that is exact, or they are not of these kinds.
pub fn exact(bodies: &[Body; 2], at: &Instant, covers: &[Cover; 2], near: Near, sizes: &Sizes) -> Near {
    let (k, facet) = match covers {
        [Cover::Facet(t), Cover::Whole(_)] => (0, t),
        [Cover::Whole(_), Cover::Facet(t)] => (1, t),
        [_, _] => return near,
    };
    let is_exact = near.distance - near.gap <= sizes.enough || near.way.is_none() || near.distance <= 0.0;
    let Some(convex) = bodies[1 - k].convex().filter(|c| !is_exact && !c.has_corners_alone()) else { return near };
    let seen = both_seen(bodies, at);
    let t = seen[k].triangle(facet);
    let sides = [0, 1].map(|k| Side { model: bodies[k].model, tokens: &bodies[k].model.solid.normal_form });
    let polish = |steps| Polish { sides, at, scale: sizes.scale, rounding: sizes.rounding, steps };
    let own = [near.points[0], at.b_point(near.points[1])];
    let mut clauses = [Clause::new(), Clause::new()];
    clauses[1 - k] = convex.clause(own[1 - k], NEAR * sizes.scale);
    let mut best = near;
    let tried = features(&t, near.points[k]).flat_map(|corners| [STEPS, Steps::ALL].map(|steps| (corners, steps)));
    for (corners, steps) in tried {
        let mut start = near.points;
        start[k] = onto(&t, corners, near.points[k]);
        let along = ways(&t, corners);
        let held = Held { side: k, along: &along };
        let (x, y, _) = polish(steps).solve(&clauses, (start[0], at.b_point(start[1])), Some(held));
        let is_on = convex.value([x, y][1 - k]) <= OFF * sizes.rounding;
        if let Some(found) = told(&seen, covers, [x, at.a_point(y)], (&t, k)).filter(|_| is_on)
            && found.distance - found.gap < best.distance - best.gap
        {
            best = found;
        }
        if best.distance - best.gap <= sizes.enough {
            break;
        }
    }
    best
}

/// The points with what lies between the covers along the line between them; `None` where the facet's is beside it.
fn told(seen: &[Seen; 2], covers: &[Cover; 2], points: [DVec3; 2], (t, k): (&Triangle, usize)) -> Option<Near> {
    let way = (points[1] - points[0]).try_normalize()?;
    let on = super::triangles::of_point(points[k], t);
    let mut points = points;
    points[k] = on;
    let distance = points[1].distance(points[0]);
    Some(Near { way: Some(way), gap: gap(seen, covers, way), points, distance })
}

/// The corners of the features of a triangle, as bits, the one first on which a point seems to be.
fn features(t: &Triangle, x: DVec3) -> impl Iterator<Item = u8> {
    let weights = weights(t, x);
    let first = (0..3).filter(|k| weights[*k] > HOLDS).fold(0u8, |all, k| all | 1 << k);
    std::iter::once(first).chain([7, 3, 6, 5, 1, 2, 4].into_iter().filter(move |f| *f != first)).filter(|f| *f != 0)
}

fn weights([a, b, c]: &Triangle, x: DVec3) -> [f64; 3] {
    let n = (*b - *a).cross(*c - *a);
    let square = n.length_squared();
    let of = |p: DVec3, q: DVec3| (q - p).cross(x - p).dot(n) / square;
    [of(*b, *c), of(*c, *a), of(*a, *b)]
}

/// A point taken to a feature.
fn onto(t: &Triangle, corners: u8, x: DVec3) -> DVec3 {
    let held: SmallVec<[DVec3; 3]> = (0..3).filter(|k| corners >> k & 1 == 1).map(|k| t[k]).collect();
    match held[..] {
        [p] => p,
        [p, q] => p + (q - p) * ((x - p).dot(q - p) / (q - p).length_squared()).clamp(0.0, 1.0),
        _ => x,
    }
}

/// The directions of a feature.
fn ways(t: &Triangle, corners: u8) -> SmallVec<[DVec3; 2]> {
    let held: SmallVec<[DVec3; 3]> = (0..3).filter(|k| corners >> k & 1 == 1).map(|k| t[k]).collect();
    match held[..] {
        [p, q] => (q - p).try_normalize().into_iter().collect(),
        [p, q, r] => {
            let n = (q - p).cross(r - p).normalize_or(DVec3::Z);
            let (u, v) = n.any_orthonormal_pair();
            SmallVec::from_slice(&[u, v])
        }
        _ => SmallVec::new(),
    }
}
