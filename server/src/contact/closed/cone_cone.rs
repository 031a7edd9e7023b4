//! Cone or frustum against cone or frustum.
//!
//! Simple configurations first: apex against apex, apex against side, cap against anything, and parallel axes, where
//! two sides share a normal only if they lean oppositely by the same angle (then along a whole generator). In general
//! position side meets side in one of two directions n with n·a = lean_a, n·b = −lean_b: the critical points that
//! Miller (1987) reaches by putting one cone's parametric curve into the other's implicit form. Then rim against
//! side, rim against rim. Source: Zeiller 1993, stage 3; Miller 1987; `directions` for the common normals.

use super::{Best, Round, round_round};
use glam::DVec3;

/// Direction from a to b of the largest separation.
pub(super) fn direction(a: &Round, b: &Round, best: &mut Best) -> DVec3 {
    round_round::general(a, b, best);
    best.normal
}
