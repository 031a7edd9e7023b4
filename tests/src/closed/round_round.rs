//! What cylinders, cones and frusta have in common against each other: caps, sides, rims, apices.
//!
//! The pair files treat their simple configurations and come here for the rest. The configurations in order: cap
//! against anything; side against side (the two directions that are normals of both); apex against side, rim and apex;
//! rim against side (one angle); rim against rim (Newton on the sphere).

use super::directions::{Rim, rim_point, rim_rim, ruled_point, ruled_rim, ruled_ruled};
use super::{Best, Convex, Round};
use contactd::math::any_perpendicular;
use glam::DVec3;
use std::f64::consts::TAU;

/// Separations of round bodies below this fraction of their heights are asked again by projection: Newton's climb may
/// have stopped short of the summit.
const NEARLY_TOUCHING: f64 = 1e-9;

/// Offers every configuration of a pair in general position.
pub fn general(a: &Round, b: &Round, best: &mut Best) {
    let mut list = vec![a.axis, -a.axis, b.axis, -b.axis];
    best.offer_all(&mut list);

    let (sa, sb) = (a.side(), b.side().far());
    ruled_ruled(&sa, &sb, &mut list);

    if let Some(p) = a.apex() {
        ruled_point(&sb, p, &mut list);
        b.rims().for_each(|r| rim_point(&r, p, -1.0, &mut list));
    }
    if let Some(q) = b.apex() {
        ruled_point(&sa, q, &mut list);
        a.rims().for_each(|r| rim_point(&r, q, 1.0, &mut list));
    }
    if let (Some(p), Some(q)) = (a.apex(), b.apex()) {
        list.push(q - p);
    }

    b.rims().for_each(|r| ruled_rim(&sa, &r, 1.0, &mut list));
    a.rims().for_each(|r| ruled_rim(&b.side(), &r, -1.0, &mut list));
    best.offer_all(&mut list);

    // From a separating direction Newton climbs a concave function; without one there may be other summits, so the
    // nearest points by alternating projections are asked first.
    if best.value <= NEARLY_TOUCHING * (a.half() + b.half()) {
        let (d, x, y) = super::alternate(best.a, best.b, DVec3::ZERO, b.centers[0], 0.0);
        list.extend((d > 0.0).then(|| y - x));
        best.offer_all(&mut list);
    }
    for ra in a.rims() {
        for rb in b.rims() {
            let starts = [Some(best.normal), (rb.center - ra.center).try_normalize()];
            list.extend(starts.into_iter().flatten().map(|n| rim_rim(&ra, &rb, n)));
            best.offer_all(&mut list);
        }
    }

    // Newton may stop at a kink, where a rim's plane is square to n. The nearest point of one rim to the other body is a
    // question in one angle, with the exact distance of a point.
    if best.value <= NEAR_A_KINK * (a.half() + b.half()) {
        for (own, other, sign) in [(a, best.b, -1.0), (b, best.a, 1.0)] {
            for rim in own.rims() {
                let start = nearest_of_rim(&rim, other) * sign;
                best.offer(start);
                let rims = if sign < 0.0 { b.rims() } else { a.rims() };
                let from: Vec<DVec3> = rims
                    .map(|r| if sign < 0.0 { rim_rim(&rim, &r, start) } else { rim_rim(&r, &rim, start) })
                    .collect();
                list.extend(from);
                best.offer_all(&mut list);
            }
        }
    }
}

/// Separations below this fraction of the heights are asked along the rims too.
const NEAR_A_KINK: f64 = 1e-2;

/// Unit gradient of the distance to a body at the point of a rim that is nearest to it: samples, then a golden section.
fn nearest_of_rim(rim: &Rim, body: &Convex) -> DVec3 {
    const STEPS: usize = 64;
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let e = any_perpendicular(rim.axis);
    let f = rim.axis.cross(e);
    let at = |angle: f64| {
        let (s, c) = angle.sin_cos();
        body.distance(rim.center + (e * c + f * s) * rim.radius)
    };
    let step = TAU / STEPS as f64;
    let nearest = (0..STEPS).map(|k| (at(k as f64 * step).0, k)).min_by(|x, y| x.0.total_cmp(&y.0));
    let middle = nearest.map_or(0.0, |n| n.1 as f64 * step);
    let (mut lo, mut hi) = (middle - step, middle + step);
    while hi - lo > 1e-9 {
        let (p, q) = (hi - GOLDEN * (hi - lo), lo + GOLDEN * (hi - lo));
        if at(p).0 < at(q).0 { hi = q } else { lo = p }
    }
    at(0.5 * (lo + hi)).1
}
