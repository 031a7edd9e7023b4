//! Cone or frustum against cone or frustum.
//!
//! Simple configurations first. Parallel axes, a common one included: the two meridian trapezia (`meridian`). Then cap
//! against anything, apex against apex, side and rim, rim against side and rim (`round_round`). Side against side: a
//! touching point is a critical point of the curve in which the sides meet (`miller`); its normal on A is offered, and
//! B's in the same point. Two sides that are apart have no such curve; their common normals, n·a = lean_a and
//! n·b = −lean_b, are in `directions`.
//! Source: Zeiller 1993, stage 3; Miller 1987.

use super::miller::{self, Side};
use super::{Best, Round, meridian, round_round};
use glam::DVec3;

/// Direction from a to b of the largest separation.
pub(super) fn direction(a: &Round, b: &Round, best: &mut Best) -> DVec3 {
    if meridian::parallel(a, b, best) {
        return best.normal;
    }
    round_round::general(a, b, best);
    if let (Some(p), Some(q)) = (Side::of(a), Side::of(b)) {
        let mut list = Vec::new();
        for g in miller::critical_generators(&p, &q).iter().filter(|g| g.on_both) {
            list.extend([p.normal(g.angle), -b.distance(g.point).1]);
        }
        best.offer_all(&mut list);
    }
    best.normal
}
