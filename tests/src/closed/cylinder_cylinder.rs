//! Cylinder against cylinder.
//!
//! Simple configurations first. Parallel axes: the radial gap g = distance of the axes − r_a − r_b and the axial gap h
//! decide alone: hypot(g, h) if both are positive (rim against rim), the larger one otherwise (side against side along
//! a generator, cap against cap). Then crossing axes: side against side along the common perpendicular, cap, rim
//! against side, rim against rim (`round_round`). Source: Zeiller 1993, stage 3 (centres, axes and radii).

use super::{Best, Round, round_round};
use contactd::math::{any_perpendicular, tolerance::PARALLEL};
use glam::DVec3;

/// Direction from a to b of the largest separation.
pub(super) fn direction(a: &Round, b: &Round, best: &mut Best) -> DVec3 {
    if let Some(n) = parallel(a, b) {
        return n;
    }
    round_round::general(a, b, best);
    best.normal
}

/// Parallel axes, exactly so: the direction in closed form.
pub(super) fn parallel(a: &Round, b: &Round) -> Option<DVec3> {
    if a.axis.cross(b.axis).length_squared() > PARALLEL * PARALLEL {
        return None;
    }
    let middle = |r: &Round| 0.5 * (r.centers[0] + r.centers[1]);
    let o = middle(b) - middle(a);
    let z = o.dot(a.axis);
    let p = o - a.axis * z;
    let rho = p.length();
    let u = if rho > 0.0 { p / rho } else { any_perpendicular(a.axis) };
    let u = (u - a.axis * u.dot(a.axis)).try_normalize().unwrap_or_else(|| any_perpendicular(a.axis));
    let g = rho - a.radii[0] - b.radii[0];
    let h = z.abs() - a.half() - b.half();
    let up = a.axis * z.signum();
    Some(if g > 0.0 && h > 0.0 {
        (u * g + up * h).normalize()
    } else if g >= h {
        u
    } else {
        up
    })
}
