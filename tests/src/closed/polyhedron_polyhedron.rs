//! Polyhedron against polyhedron.
//!
//! Configurations: facet against whatever reaches farthest towards it; edge against edge along their cross product;
//! vertex against edge and vertex against vertex along the connecting perpendicular (they only matter while the bodies
//! are apart). An edge's candidates count only among its own normals, the arcs of the Gauss map.
//! Source: Cyrus and Beck's clipping in the paper, restated as separating directions; the arcs after Gottschalk.

use super::directions::ruled_point;
use super::{Best, Poly};
use glam::DVec3;

/// Direction from a to b of the largest separation.
pub(super) fn direction(a: &Poly, b: &Poly, best: &mut Best) -> DVec3 {
    a.planes.iter().for_each(|(n, _)| best.offer(*n));
    b.planes.iter().for_each(|(n, _)| best.offer(-*n));

    for e in &a.edges {
        for f in &b.edges {
            let Some(n) = e.way.cross(f.way).try_normalize() else { continue };
            for n in [n, -n] {
                if e.shows(n) && f.shows(-n) && n.dot(f.ends[0] - e.ends[0]) > best.value {
                    best.offer(n);
                }
            }
        }
    }
    if best.value <= 0.0 {
        return best.normal;
    }

    let mut list = Vec::with_capacity(4);
    let edges = a.edges.iter().map(|e| (e, 1.0, &b.vertices)).chain(b.edges.iter().map(|f| (f, -1.0, &a.vertices)));
    for (e, flip, vertices) in edges {
        for v in vertices {
            ruled_point(&e.ruled(), *v, &mut list);
            for m in list.drain(..) {
                if e.shows(m) && m.dot(*v - e.ends[0]) > best.value {
                    best.offer(m * flip);
                }
            }
        }
    }
    for p in &a.vertices {
        for q in &b.vertices {
            let o = *q - *p;
            if o.length() > best.value && best.a_reaches(o, *p) && best.b_reaches(-o, *q) {
                best.offer(o.normalize());
            }
        }
    }
    best.normal
}
