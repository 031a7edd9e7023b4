//! Sphere against sphere: one configuration, the line of centres.
//!
//! separation = |c_b − c_a| − r_a − r_b. Source: Zeiller 1993, stage 3. Concentric: any direction attains −r_a − r_b.

use super::{Ball, Best};
use glam::DVec3;

/// Direction from a to b of the largest separation.
pub(super) fn direction(a: &Ball, b: &Ball, _: &mut Best) -> DVec3 {
    (b.center - a.center).try_normalize().unwrap_or(DVec3::X)
}
