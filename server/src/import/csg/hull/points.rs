//! Hull of points in space.
//!
//! Source: C. B. Barber, D. P. Dobkin, H. Huhdanpaa, "The Quickhull algorithm for convex hulls", ACM Transactions on Mathematical
//! Software 22, 1996, with Shewchuk's exact predicate in place of tolerances.

use glam::DVec3;
use robust::{Coord3D, orient3d};
use std::collections::HashMap;

struct Facet {
    corners: [usize; 3],
    /// Facets across the sides from corner i to i + 1.
    across: [usize; 3],
    /// Points above it that are above no earlier one.
    outside: Vec<usize>,
    alive: bool,
}

/// Triangles of the convex hull, counter-clockwise as seen from outside, as indices of the points; `None` where these lie on one
/// plane.
pub fn point_hull(points: &[DVec3]) -> Option<Vec<[usize; 3]>> {
    let mut facets = tetrahedron(points)?;
    let all: Vec<usize> = (0..points.len()).collect();
    hand_out(points, &all, &mut facets, 0);
    let mut work: Vec<usize> = (0..4).collect();
    while let Some(f) = work.pop() {
        if !facets[f].alive || facets[f].outside.is_empty() {
            continue;
        }
        let apex = farthest(points, &facets[f]);
        let (visible, horizon) = seen(points, &facets, f, apex);
        let mut left: Vec<usize> = Vec::new();
        for v in visible {
            facets[v].alive = false;
            left.append(&mut facets[v].outside);
        }
        let first = facets.len();
        let by_start: HashMap<usize, usize> = horizon.iter().enumerate().map(|(k, h)| (h.0, first + k)).collect();
        let by_end: HashMap<usize, usize> = horizon.iter().enumerate().map(|(k, h)| (h.1, first + k)).collect();
        for (k, &(a, b, beyond, side)) in horizon.iter().enumerate() {
            facets[beyond].across[side] = first + k;
            let across = [beyond, by_start[&b], by_end[&a]];
            facets.push(Facet { corners: [a, b, apex], across, outside: Vec::new(), alive: true });
        }
        hand_out(points, &left, &mut facets, first);
        work.extend(first..facets.len());
    }
    Some(facets.into_iter().filter(|f| f.alive).map(|f| f.corners).collect())
}

/// The corners of the hull of points; all of them where they span no volume.
pub fn corners_of(points: Vec<DVec3>) -> Vec<DVec3> {
    let Some(faces) = point_hull(&points) else { return points };
    let mut used: Vec<usize> = faces.into_iter().flatten().collect();
    used.sort_unstable();
    used.dedup();
    used.into_iter().map(|i| points[i]).collect()
}

/// Above the plane of a triangle, on the side from which it runs counter-clockwise; exact.
fn above(points: &[DVec3], [a, b, c]: [usize; 3], p: usize) -> bool {
    let at = |i: usize| Coord3D { x: points[i].x, y: points[i].y, z: points[i].z };
    orient3d(at(a), at(b), at(c), at(p)) < 0.0
}

fn normal(points: &[DVec3], [a, b, c]: [usize; 3]) -> DVec3 {
    (points[b] - points[a]).cross(points[c] - points[a])
}

/// Four points that span a volume, as far from each other as a look at each tells.
fn tetrahedron(points: &[DVec3]) -> Option<Vec<Facet>> {
    let most = |measure: &dyn Fn(usize) -> f64| (0..points.len()).max_by(|i, j| measure(*i).total_cmp(&measure(*j)));
    let a = most(&|i| -points[i].x)?;
    let b = most(&|i| (points[i] - points[a]).length_squared())?;
    let c = most(&|i| (points[i] - points[a]).cross(points[b] - points[a]).length_squared())?;
    let n = normal(points, [a, b, c]);
    let d = most(&|i| n.dot(points[i] - points[a]).abs())?;
    let flat = |c: [usize; 3], p: usize| !above(points, c, p) && !above(points, [c[0], c[2], c[1]], p);
    if flat([a, b, c], d) {
        return None;
    }
    let (b, c) = if above(points, [a, b, c], d) { (c, b) } else { (b, c) };
    let facet = |corners, across| Facet { corners, across, outside: Vec::new(), alive: true };
    Some(vec![
        facet([a, b, c], [1, 2, 3]),
        facet([b, a, d], [0, 3, 2]),
        facet([c, b, d], [0, 1, 3]),
        facet([a, c, d], [0, 2, 1]),
    ])
}

/// Gives each point to the first facet from `first` on that it is above.
fn hand_out(points: &[DVec3], some: &[usize], facets: &mut [Facet], first: usize) {
    for &p in some {
        if let Some(f) = facets[first..].iter_mut().find(|f| above(points, f.corners, p)) {
            f.outside.push(p);
        }
    }
}

fn farthest(points: &[DVec3], facet: &Facet) -> usize {
    let (n, from) = (normal(points, facet.corners), points[facet.corners[0]]);
    let height = |p: usize| n.dot(points[p] - from);
    facet.outside.iter().copied().max_by(|a, b| height(*a).total_cmp(&height(*b))).unwrap_or(facet.corners[0])
}

/// The facets that a point sees, and the sides around them: from, to, the facet beyond and which of its sides it is.
fn seen(
    points: &[DVec3],
    facets: &[Facet],
    start: usize,
    apex: usize,
) -> (Vec<usize>, Vec<(usize, usize, usize, usize)>) {
    let mut state: HashMap<usize, bool> = HashMap::from([(start, true)]);
    let (mut visible, mut horizon, mut next) = (vec![start], Vec::new(), 0);
    while next < visible.len() {
        let f = visible[next];
        next += 1;
        for side in 0..3 {
            let beyond = facets[f].across[side];
            let sees = *state.entry(beyond).or_insert_with(|| {
                let sees = above(points, facets[beyond].corners, apex);
                if sees {
                    visible.push(beyond);
                }
                sees
            });
            if !sees {
                let (a, b) = (facets[f].corners[side], facets[f].corners[(side + 1) % 3]);
                let back = (0..3).find(|k| facets[beyond].corners[*k] == b).unwrap_or(0);
                horizon.push((a, b, beyond, back));
            }
        }
    }
    (visible, horizon)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn hulls_hold_all_points_and_are_closed() {
        let mut r = Random(5);
        for round in 0..200 {
            let n = 4 + (r.unit() * 60.0) as usize;
            let points: Vec<DVec3> = (0..n)
                .map(|_| {
                    let p = r.vector(2.0);
                    // Many on common planes and lines.
                    if round % 2 == 0 { p.round() } else { p }
                })
                .collect();
            let Some(faces) = point_hull(&points) else { continue };
            let mut sides: HashMap<(usize, usize), i32> = HashMap::new();
            for [a, b, c] in &faces {
                for s in [(*a, *b), (*b, *c), (*c, *a)] {
                    *sides.entry(s).or_default() += 1;
                }
                assert!((0..n).all(|p| !above(&points, [*a, *b, *c], p)), "{points:?}");
            }
            assert!(sides.iter().all(|((a, b), count)| *count == 1 && sides.contains_key(&(*b, *a))));
            // Euler: a closed surface of triangles.
            let mut used: Vec<usize> = faces.iter().flatten().copied().collect();
            used.sort_unstable();
            used.dedup();
            assert_eq!(faces.len(), 2 * used.len() - 4);
        }
        assert!(point_hull(&[DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(3.0, 4.0, 0.0)]).is_none());
        assert!(point_hull(&[DVec3::ZERO, DVec3::X]).is_none() && point_hull(&[]).is_none());
    }
}
