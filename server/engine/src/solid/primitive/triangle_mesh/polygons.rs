//! Faces of more than three corners cut into triangles.

use super::planes::area;
use glam::{DVec2, DVec3};
use robust::{Coord, orient2d};

/// The triangles of a polygon in space, as places in its list of corners, running round as it does; and how far its corners lie
/// from one plane, a length. Of a polygon that crosses itself some triangles that its corners make.
pub fn triangles(corners: &[DVec3]) -> (Vec<[usize; 3]>, f64) {
    let count = corners.len();
    if count <= 3 {
        return (if count == 3 { vec![[0, 1, 2]] } else { Vec::new() }, 0.0);
    }
    // Twice the area times the normal (Newell).
    let normal = (1..count - 1).map(|i| area(corners[0], corners[i], corners[i + 1])).sum::<DVec3>();
    let Some(n) = normal.try_normalize() else {
        return ((1..count - 1).map(|i| [0, i, i + 1]).collect(), 0.0);
    };
    let heights = corners.iter().map(|c| n.dot(*c));
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    // Seen against the normal's largest part: what lies on a line stays on it.
    let flat: Vec<DVec2> = corners.iter().map(|c| seen(*c, n)).collect();
    (ears(&flat), 0.5 * (high - low))
}

/// A point seen along the axis that a normal points along most, so that a polygon around it runs counter-clockwise.
fn seen(p: DVec3, n: DVec3) -> DVec2 {
    let m = n.abs();
    let (u, v, w) = if m.x >= m.y && m.x >= m.z {
        (p.y, p.z, n.x)
    } else if m.y >= m.z {
        (p.z, p.x, n.y)
    } else {
        (p.x, p.y, n.z)
    };
    if w > 0.0 { DVec2::new(u, v) } else { DVec2::new(v, u) }
}

/// Twice the signed area, its sign exact.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let of = |p: DVec2| Coord { x: p.x, y: p.y };
    orient2d(of(a), of(b), of(c))
}

/// Ears one after the other, those with the widest least angle first; where none is left, whatever corner comes next.
fn ears(points: &[DVec2]) -> Vec<[usize; 3]> {
    let mut left: Vec<usize> = (0..points.len()).collect();
    let mut out = Vec::with_capacity(points.len());
    while left.len() > 3 {
        let count = left.len();
        let around = |k: usize| [left[(k + count - 1) % count], left[k], left[(k + 1) % count]];
        let is_ear = |k: usize| {
            let [a, b, c] = around(k).map(|i| points[i]);
            let inside = |p: DVec2| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
            turn(a, b, c) > 0.0
                && !left
                    .iter()
                    .any(|i| !around(k).contains(i) && ![a, b, c].contains(&points[*i]) && inside(points[*i]))
        };
        let quality = |k: usize| {
            let [a, b, c] = around(k).map(|i| points[i]);
            let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
            turn(a, b, c) / longest
        };
        let best = (0..count).filter(|k| is_ear(*k)).max_by(|a, b| quality(*a).total_cmp(&quality(*b)).then(b.cmp(a)));
        // A corner on a line cuts nothing off.
        let straight =
            || (0..count).find(|k| turn(points[around(*k)[0]], points[around(*k)[1]], points[around(*k)[2]]) == 0.0);
        let k = best.or_else(straight).unwrap_or(0);
        out.push(around(k));
        left.remove(k);
    }
    out.push([left[0], left[1], left[2]]);
    out
}
