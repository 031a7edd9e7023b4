//! Hull of balls of any radii; points are balls of radius 0.
//!
//! It is the union of the balls, of the frustum tangent to each pair that the hull rolls over, and of the polyhedron of the
//! tangent points of all planes that touch three. A pair's tangent planes turn about its axis; each other ball forbids an arc of
//! them, and the ends of what is left are the planes that touch a third one.

use crate::math::any_perpendicular;
use glam::DVec3;
use std::f64::consts::TAU;

/// Arcs of tangent planes shorter than this carry no piece of a cone that a double could tell (its height is this squared).
const LEAST_ARC: f64 = 1e-7;

/// What is on a hull.
#[derive(Clone, Debug, Default)]
pub struct BallHull {
    /// Balls on it, as indices; points left out.
    pub balls: Vec<usize>,
    /// Pairs whose tangent frustum is.
    pub edges: Vec<(usize, usize)>,
    /// Tangent points of planes that touch three balls or more.
    pub corners: Vec<DVec3>,
}

/// The hull of balls, centre and radius each, none of them within another.
pub fn ball_hull(balls: &[(DVec3, f64)]) -> BallHull {
    let mut hull = BallHull::default();
    let mut used = vec![balls.len() == 1; balls.len()];
    for i in 0..balls.len() {
        for j in i + 1..balls.len() {
            let (a, b) = (balls[i], balls[j]);
            let apart = b.0.distance(a.0);
            let e = (b.0 - a.0) / apart;
            let k = (a.1 - b.1) / apart;
            let s = ((1.0 - k) * (1.0 + k)).max(0.0).sqrt();
            let u = any_perpendicular(e);
            let v = e.cross(u);
            let others = (0..balls.len()).filter(|m| *m != i && *m != j).map(|m| balls[m]);
            let Some(free) = free_arcs(others, a, (e, k), (u * s, v * s)) else { continue };
            if free.is_empty() {
                continue;
            }
            (used[i], used[j]) = (true, true);
            if a.1 > 0.0 || b.1 > 0.0 {
                hull.edges.push((i, j));
            }
            for angle in free.into_iter().flatten().filter(|x| x.is_finite()) {
                let (sin, cos) = libm::sincos(angle);
                let n = e * k + (u * cos + v * sin) * s;
                hull.corners.extend([a.0 + n * a.1, b.0 + n * b.1]);
            }
        }
    }
    hull.balls = (0..balls.len()).filter(|i| used[*i] && balls[*i].1 > 0.0).collect();
    hull
}

/// The arcs of angles at which a pair's tangent plane has all other balls below it; infinite ends for all the way round. `None`
/// where another ball forbids all.
fn free_arcs(
    others: impl Iterator<Item = (DVec3, f64)>,
    a: (DVec3, f64),
    (e, k): (DVec3, f64),
    (u, v): (DVec3, DVec3),
) -> Option<Vec<[f64; 2]>> {
    let mut forbidden: Vec<[f64; 2]> = Vec::new();
    for (center, radius) in others {
        let o = center - a.0;
        let (x, y, c) = (o.dot(u), o.dot(v), a.1 - radius - k * o.dot(e));
        let reach = x.hypot(y);
        let rounding = 1e-13 * (o.length() + a.1 + radius);
        if c >= reach - rounding {
            continue;
        }
        if c <= -reach {
            return None;
        }
        let (middle, half) = (libm::atan2(y, x), libm::acos(c / reach));
        let from = (middle - half).rem_euclid(TAU);
        forbidden.push([from, from + 2.0 * half]);
    }
    if forbidden.is_empty() {
        return Some(vec![[f64::NEG_INFINITY, f64::INFINITY]]);
    }
    forbidden.sort_by(|p, q| p[0].total_cmp(&q[0]));
    // What the arcs leave free between them, once around from the start of the first.
    let start = forbidden[0][0];
    let mut end = forbidden.iter().map(|f| f[1] - TAU).fold(start, f64::max);
    let mut free = Vec::new();
    for f in &forbidden {
        if f[0] - end > LEAST_ARC {
            free.push([end, f[0]]);
        }
        end = end.max(f[1]);
    }
    if start + TAU - end > LEAST_ARC {
        free.push([end, start + TAU]);
    }
    Some(free)
}
