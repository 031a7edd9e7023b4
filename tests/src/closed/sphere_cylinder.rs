//! Sphere against cylinder: where the centre stands in the meridian plane of the cylinder decides.
//!
//! Configurations: cap, side, rim nearest to the centre; a centre inside takes the nearest of the faces. The signed distance of
//! the centre minus the radius is exact in all of them. Source: Zeiller 1993, stage 3; the planar distance to a trapezium.

use super::{Ball, Best, Round};
use glam::DVec3;

/// Direction from a to b of the largest separation.
pub(super) fn direction(a: &Ball, b: &Round, _: &mut Best) -> DVec3 {
    -b.distance(a.center).1
}
