//! Sphere against polyhedron: vertices, edges, faces, the nearest to the centre; a centre inside takes the nearest plane.
//!
//! Exact in all configurations. Source: Zeiller 1993, stage 3 (quadric against polyhedron in this order).

use super::{Ball, Best, Poly};
use glam::DVec3;

/// Direction from a to b of the largest separation.
pub(super) fn direction(a: &Ball, b: &Poly, _: &mut Best) -> DVec3 {
    -b.distance(a.center).1
}
