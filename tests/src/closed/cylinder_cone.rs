//! Cylinder against cone or frustum.
//!
//! Simple configurations first. Parallel axes, a common one included: the two meridian trapezia (`meridian`). Then cap
//! against anything; side against side (two common normals in closed form); apex against side, cap and rim; rim against
//! side; rim against rim (`round_round`).
//! Source: Zeiller 1993, stage 3; `directions` for the common normals.

use super::{Best, Round, meridian, round_round};
use glam::DVec3;

/// Direction from a to b of the largest separation.
pub(super) fn direction(a: &Round, b: &Round, best: &mut Best) -> DVec3 {
    if !meridian::parallel(a, b, best) {
        round_round::general(a, b, best);
    }
    best.normal
}
