//! Hull of discs in a plane, by wrapping a tangent around them. Points are discs of radius 0.
//!
//! The hull is the discs on it and the polygon of all tangent points: what lies beyond a side of the polygon that is no tangent
//! is cut off a disc by a chord.

use crate::import::csg::polygon::convex_hull;
use glam::DVec2;
use std::f64::consts::TAU;

/// A disc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Its centre.
    pub center: DVec2,
    /// Its radius; 0 for a point.
    pub radius: f64,
}

/// What is on a hull.
#[derive(Clone, Debug, Default)]
pub struct DiscHull {
    /// Tangent points and points, counter-clockwise; fewer than three where one disc holds all others.
    pub corners: Vec<DVec2>,
    /// The discs with a radius that are on it, each once.
    pub discs: Vec<Disc>,
}

/// Angles that differ by less are one.
const SAME_ANGLE: f64 = 1e-9;

/// The hull of some discs.
pub fn disc_hull(discs: &[Disc]) -> DiscHull {
    let all = outermost(discs);
    let mut hull = DiscHull::default();
    // The lowest, of those alike the leftmost: the tangent below them turns away from it at once.
    let low = |d: &Disc| d.center.y - d.radius;
    let lowest = all.iter().map(low).fold(f64::INFINITY, f64::min);
    let size = all.iter().map(|d| d.center.abs().max_element() + d.radius).fold(0.0, f64::max);
    let candidates = (0..all.len()).filter(|i| low(&all[*i]) <= lowest + 1e-12 * size);
    let Some(mut at) = candidates.min_by(|a, b| all[*a].center.x.total_cmp(&all[*b].center.x)) else {
        return hull;
    };
    let mut used = vec![false; all.len()];
    used[at] = true;
    // The angle of the normal, from straight down on.
    let (mut angle, mut turned) = (-0.25 * TAU, 0.0);
    for _ in 0..4 * all.len() + 8 {
        let Some((next, normal, by)) = next_tangent(&all, at, angle) else { break };
        if turned + by >= TAU - SAME_ANGLE {
            break;
        }
        for k in [at, next] {
            let corner = all[k].center + normal * all[k].radius;
            if hull.corners.last() != Some(&corner) {
                hull.corners.push(corner);
            }
        }
        (turned, angle, at) = (turned + by, angle + by, next);
        used[at] = true;
    }
    if hull.corners.len() > 1 && hull.corners.first() == hull.corners.last() {
        hull.corners.pop();
    }
    if all.len() == 1 && all[0].radius == 0.0 {
        hull.corners.push(all[0].center);
    }
    hull.discs = all.iter().zip(used).filter(|(d, used)| *used && d.radius > 0.0).map(|(d, _)| *d).collect();
    hull
}

/// The disc that a tangent at disc `at`, its normal at `angle`, meets next as it turns counter-clockwise: with the normal there and
/// the angle in between. Of those met at once the farthest.
fn next_tangent(all: &[Disc], at: usize, angle: f64) -> Option<(usize, DVec2, f64)> {
    let from = all[at];
    let mut best: Option<(usize, DVec2, f64, f64)> = None;
    for (j, to) in all.iter().enumerate().filter(|(j, _)| *j != at) {
        let along = to.center - from.center;
        let apart = along.length();
        let e = along / apart;
        let k = ((from.radius - to.radius) / apart).clamp(-1.0, 1.0);
        let normal = e * k - e.perp() * ((1.0 - k) * (1.0 + k)).sqrt();
        let mut by = (libm::atan2(normal.y, normal.x) - angle).rem_euclid(TAU);
        if by > TAU - SAME_ANGLE {
            by = 0.0;
        }
        let reach = normal.perp().dot(along);
        let better = best.is_none_or(|b| by < b.2 - SAME_ANGLE || by <= b.2 + SAME_ANGLE && reach > b.3);
        if better {
            best = Some((j, normal, by, reach));
        }
    }
    best.map(|(j, normal, by, _)| (j, normal, by))
}

/// Discs without those that others hold, and without points inside of the points' own hull.
fn outermost(discs: &[Disc]) -> Vec<Disc> {
    let points: Vec<DVec2> = discs.iter().filter(|d| d.radius == 0.0).map(|d| d.center + DVec2::ZERO).collect();
    let points = convex_hull(&points).into_iter().map(|center| Disc { center, radius: 0.0 });
    let mut all: Vec<Disc> = discs.iter().filter(|d| d.radius > 0.0).copied().chain(points).collect();
    all.sort_by(|a, b| b.radius.total_cmp(&a.radius));
    let mut kept: Vec<Disc> = Vec::with_capacity(all.len());
    for d in all {
        let held = |o: &Disc| o.center.distance(d.center) <= (o.radius - d.radius) + 1e-14 * o.radius;
        if !kept.iter().take_while(|o| o.radius > 0.0).any(held) {
            kept.push(d);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::csg::polygon::turn;
    use crate::math::random::Random;

    #[test]
    fn hulls_of_discs_reach_as_far_as_the_discs_in_every_direction() {
        let mut r = Random(3);
        // Long: CONTACTD_OUTLINES=240.
        let rounds = std::env::var("CONTACTD_OUTLINES").ok().and_then(|n| n.parse().ok()).unwrap_or(80);
        for round in 0..rounds {
            let n = 1 + (r.unit() * 12.0) as usize;
            let discs: Vec<Disc> = (0..n)
                .map(|_| {
                    // On a grid now and then: tangents that meet several at once.
                    let mut center = DVec2::new(r.within(-2.0, 2.0), r.within(-2.0, 2.0));
                    let mut radius = if r.unit() < 0.4 { 0.0 } else { r.within(0.0, 1.0) };
                    if round % 2 == 0 {
                        center = center.round();
                        radius = (2.0 * radius).round() * 0.5;
                    }
                    Disc { center, radius }
                })
                .collect();
            let hull = disc_hull(&discs);
            let corners = &hull.corners;
            for k in 0..64 {
                let (s, c) = libm::sincos(TAU * (f64::from(k) + 0.3) / 64.0);
                let m = DVec2::new(c, s);
                let far = |d: &Disc| m.dot(d.center) + d.radius;
                let wanted = discs.iter().map(far).fold(f64::NEG_INFINITY, f64::max);
                let round = hull.discs.iter().map(far).fold(f64::NEG_INFINITY, f64::max);
                let found = corners.iter().map(|p| m.dot(*p)).fold(round, f64::max);
                assert!((found - wanted).abs() < 1e-9, "{found} for {wanted} of {discs:?}");
            }
            let within = |p: DVec2| {
                let n = corners.len();
                n >= 3 && (0..n).all(|i| turn(corners[i], corners[(i + 1) % n], p) > 0.0)
                    || hull.discs.iter().any(|d| d.center.distance(p) < d.radius)
            };
            for _ in 0..40 {
                let p = DVec2::new(r.within(-3.0, 3.0), r.within(-3.0, 3.0));
                let deep = (0..1200).all(|k| {
                    let (s, c) = libm::sincos(TAU * f64::from(k) / 1200.0);
                    let m = DVec2::new(c, s);
                    let far = discs.iter().map(|d| m.dot(d.center) + d.radius).fold(f64::NEG_INFINITY, f64::max);
                    m.dot(p) < far - 0.01
                });
                assert!(!deep || within(p), "{p} of {discs:?}");
            }
            let count = corners.len();
            for i in 0..count {
                let t = turn(corners[i], corners[(i + 1) % count], corners[(i + 2) % count]);
                assert!(count < 3 || t > -1e-12, "{corners:?} of {discs:?}");
            }
        }
    }
}
