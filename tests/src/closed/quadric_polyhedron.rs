//! Cylinder, cone or frustum against polyhedron, in the paper's order: vertices, edges, faces.
//!
//! Configurations: vertex against side, apex and rim; edge against side (two common normals), apex and rim (one angle);
//! facet against whatever reaches farthest towards it, cap against the nearest vertex.
//! Source: Zeiller 1993, stage 3; `directions` for the common normals. An edge's candidates outside of its own normals
//! are dropped before they cost a support.

use super::directions::{rim_point, ruled_point, ruled_rim, ruled_ruled};
use super::{Best, Poly, Round};
use glam::DVec3;

/// Direction from a to b of the largest separation.
pub(super) fn direction(a: &Round, b: &Poly, best: &mut Best) -> DVec3 {
    let side = a.side();
    let mut list = Vec::with_capacity(64);

    for &v in &b.vertices {
        ruled_point(&side, v, &mut list);
        a.rims().for_each(|r| rim_point(&r, v, 1.0, &mut list));
        list.extend(a.apex().map(|p| v - p));
    }
    best.offer_all(&mut list);

    for e in &b.edges {
        let line = e.ruled();
        ruled_ruled(&side, &line, &mut list);
        if let Some(p) = a.apex() {
            ruled_point(&line, p, &mut list);
        }
        a.rims().for_each(|r| ruled_rim(&line, &r, -1.0, &mut list));
        list.retain(|n| e.shows(-*n));
        best.offer_all(&mut list);
    }

    list.extend(b.planes.iter().map(|(n, _)| -*n));
    list.extend([a.axis, -a.axis]);
    best.offer_all(&mut list);
    best.normal
}
