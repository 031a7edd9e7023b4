//! How far apart two covers are at an instant: a direction that proves it, and their points.

use super::body::{Cover, Seen};
use super::triangles;
use crate::math::gjk::{Cores, of_supports};
use glam::DVec3;

/// Relative gap to which the distance of covers is found: of boxes, which bound alone, and of what is not divided.
const ROUGH: f64 = 1e-3;
const EXACT: f64 = 1e-15;
/// Bounds from both sides this near to each other, in rounding's lengths, need no further directions.
const PROVEN: f64 = 4.0;

/// What was found of two covers.
#[derive(Clone, Copy)]
pub struct Near {
    /// From the one to the other, a unit vector; `None` where nothing keeps them apart.
    pub way: Option<DVec3>,
    /// What lies between them along the way, negative where that is in both.
    pub gap: f64,
    /// Points of both, as near to each other as was found; of boxes nothing.
    pub points: [DVec3; 2],
    /// Their distance; infinite where no points were found.
    pub distance: f64,
}

/// What lies between two covers along a unit direction: of a half-space along its normal.
#[inline]
pub fn gap(seen: &[Seen; 2], covers: &[Cover; 2], n: DVec3) -> f64 {
    -seen[1].reach(&covers[1], -n) - seen[0].reach(&covers[0], n)
}

/// The one direction along which a half-space is told, from A to B.
pub fn only(seen: &[Seen; 2], covers: &[Cover; 2]) -> Option<DVec3> {
    match covers {
        [Cover::Below, _] => Some(seen[0].up()),
        [_, Cover::Below] => Some(-seen[1].up()),
        [_, _] => None,
    }
}

/// A direction from the middle of one cover to that of the other.
pub fn between(seen: &[Seen; 2], covers: &[Cover; 2]) -> DVec3 {
    let middles = seen[1].middle(&covers[1]) - seen[0].middle(&covers[0]);
    only(seen, covers).unwrap_or_else(|| middles.normalize_or(DVec3::X))
}

/// Looks for the nearest points of two covers from a direction; `rounding` is what rounding may do to a length.
pub fn nearest(seen: &[Seen; 2], covers: &[Cover; 2], start: DVec3, rounding: f64) -> Near {
    if let Some(n) = only(seen, covers) {
        return of_half_space(seen, covers, n);
    }
    let is_rough = covers.iter().any(|c| matches!(c, Cover::Box(..)));
    let good = if is_rough { ROUGH } else { EXACT };
    let (a, b) = (|v| seen[0].support(&covers[0], v), |v| seen[1].support(&covers[1], v));
    let mut near = match of_supports(a, b, start, good) {
        Cores::Apart { v, a, b } => match v.try_normalize() {
            Some(way) => {
                let margins = [covers[0].margin(), covers[1].margin()];
                let apart = (b - a).length() - margins[0] - margins[1];
                let points = [a + way * margins[0], b - way * margins[1]];
                let points = if apart > 0.0 { points } else { [0.5 * (points[0] + points[1]); 2] };
                Near { way: Some(way), gap: gap(seen, covers, way), points, distance: apart.max(0.0) }
            }
            None => Near { way: None, gap: 0.0, points: [a; 2], distance: 0.0 },
        },
        Cores::Common(x) => Near { way: None, gap: 0.0, points: [x; 2], distance: 0.0 },
        Cores::Open => Near { way: None, gap: 0.0, points: [DVec3::NAN; 2], distance: f64::INFINITY },
    };
    match covers {
        [Cover::Facet(p), Cover::Facet(q)]
            if !(near.distance - near.gap <= PROVEN * rounding && near.way.is_some()) =>
        {
            let (p, q) = (seen[0].triangle(p), seen[1].triangle(q));
            let points = triangles::nearest(&p, &q);
            let way = points[1] - points[0];
            let distance = way.length();
            let way = way.normalize_or_zero();
            near = Near { way: None, gap: 0.0, points, distance };
            let mut offer = |n: DVec3| {
                let gap = gap(seen, covers, n);
                if gap > near.gap {
                    (near.way, near.gap) = (Some(n), gap);
                }
            };
            if way != DVec3::ZERO {
                offer(way);
            }
            if way == DVec3::ZERO || distance - gap(seen, covers, way) > PROVEN * rounding {
                triangles::directions(&p, &q, way, offer);
            }
        }
        [Cover::Facet(t), Cover::Whole(_)] if near.way.is_none() => on_facet(&mut near, seen[0].triangle(t), 0),
        [Cover::Whole(_), Cover::Facet(t)] if near.way.is_none() => on_facet(&mut near, seen[1].triangle(t), 1),
        [_, _] => {}
    }
    near
}

/// The point of a facet beside a point that was found to be of both.
fn on_facet(near: &mut Near, t: triangles::Triangle, k: usize) {
    if near.points[k].is_finite() {
        near.points = [triangles::of_point(near.points[k], &t); 2];
    }
}

/// A cover and a half-space.
fn of_half_space(seen: &[Seen; 2], covers: &[Cover; 2], n: DVec3) -> Near {
    let gap = gap(seen, covers, n);
    let points = match covers {
        [Cover::Below, other] => {
            let y = seen[1].support(other, -n);
            [y - n * gap.max(0.0), y]
        }
        [other, _] => {
            let x = seen[0].support(other, n);
            [x, x + n * gap.max(0.0)]
        }
    };
    Near { way: Some(n), gap, points, distance: gap.max(0.0) }
}
