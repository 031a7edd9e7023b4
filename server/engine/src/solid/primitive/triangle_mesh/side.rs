//! Which side of a closed surface a point is on: by the facets that a line from it along +x crosses, an odd number inside.
//!
//! Exact: a point that is seen to lie on an edge counts as lying beside it, on the side that is left of the edge as it runs up, for all
//! facets of that edge alike.

use glam::DVec3;
use robust::{Coord, Coord3D, orient2d, orient3d};

/// True where the line from `p` along +x crosses the triangle.
pub fn crosses(p: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    if a.x.max(b.x).max(c.x) < p.x
        || a.y.min(b.y).min(c.y) > p.y
        || a.y.max(b.y).max(c.y) < p.y
        || a.z.min(b.z).min(c.z) > p.z
        || a.z.max(b.z).max(c.z) < p.z
    {
        return false;
    }
    let flat = |p: DVec3| Coord { x: p.y, y: p.z };
    let passes = |a: DVec3, b: DVec3| {
        if (a.z > p.z) == (b.z > p.z) {
            return false;
        }
        let (low, high) = if a.z < b.z { (a, b) } else { (b, a) };
        orient2d(flat(low), flat(high), flat(p)) >= 0.0
    };
    if !(passes(a, b) ^ passes(b, c) ^ passes(c, a)) {
        return false;
    }
    // Beyond the point: on the side of the facet's plane on which −x is.
    let of = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    let turn = orient2d(flat(a), flat(b), flat(c));
    // Seen from +x the projection runs as turn says; orient3d is positive below the plane.
    let below = orient3d(of(a), of(b), of(c), of(p));
    turn > 0.0 && below > 0.0 || turn < 0.0 && below < 0.0
}
