//! What cylinders, cones and frusta have in common against each other: caps, sides, rims, apices.
//!
//! The pair files treat their simple configurations and come here for the rest. The configurations in order: cap
//! against anything; side against side (the two directions that are normals of both); apex against side, rim and apex;
//! rim against side (one angle); rim against rim (Newton on the sphere).

use super::directions::{rim_point, rim_rim, ruled_point, ruled_rim, ruled_ruled};
use super::{Best, Round};
use crate::math::tolerance::NEARLY_TOUCHING;
use glam::DVec3;

/// Offers every configuration of a pair in general position.
pub(super) fn general(a: &Round, b: &Round, best: &mut Best) {
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
}
