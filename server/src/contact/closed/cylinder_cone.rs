//! Cylinder against cone or frustum.
//!
//! Configurations: cap against anything; side against side (two common normals in closed form; for parallel axes none,
//! a cone's normal is never square to its axis); apex against side, cap and rim; rim against side; rim against rim. On
//! a common axis a rim's normals all lie in one meridian plane, which the same candidates cover.
//! Source: Zeiller 1993, stage 3; `directions` for the common normals.

use super::{Best, Round, round_round};
use glam::DVec3;

/// Direction from a to b of the largest separation.
pub(super) fn direction(a: &Round, b: &Round, best: &mut Best) -> DVec3 {
    round_round::general(a, b, best);
    best.normal
}
