//! The bounded convex polyhedron of some half-spaces: a large cube, cut by one plane after the other.
//!
//! Every cut keeps the parts of the faces on the inner side and closes the gap with a new face whose corners are sorted
//! around its middle. A cut edge's new corner is always computed from its inner end, so the two faces that share the
//! edge get the same bits. Quadratic in the number of faces, by a comparison for each two of them.

use super::Polyhedron;
use crate::math::{Aabb, any_perpendicular, tolerance::ROUNDING};
use glam::DVec3;
use std::collections::HashMap;

/// A face under construction: the plane it lies on (`None` for a side of the starting cube) and its corners in order.
struct Facet {
    plane: Option<usize>,
    corners: Vec<DVec3>,
}

impl Polyhedron {
    /// The points with n·x <= d for all `planes`, which must lie within `around`. Planes that carry no face are left
    /// out, the others keep their order. `None` when nothing is left, or when it reaches beyond `around`.
    pub fn from_planes(planes: &[(DVec3, f64)], around: &Aabb) -> Option<Self> {
        let size = around.half().length();
        let eps = ROUNDING * size;
        let mut facets = cube(&around.grown(size));
        for (k, &(n, d)) in planes.iter().enumerate() {
            let above = |p: DVec3| {
                let s = n.dot(p) - d;
                if s.abs() <= eps { 0.0 } else { s }
            };
            let mut rim: Vec<DVec3> = Vec::new();
            let mut lies_on_face = false;
            for f in &mut facets {
                // Most faces lie below the plane and stay as they are.
                if f.corners.iter().all(|p| n.dot(*p) - d < -eps) {
                    continue;
                }
                let heights: Vec<f64> = f.corners.iter().map(|p| above(*p)).collect();
                if heights.iter().all(|s| *s == 0.0) {
                    lies_on_face = true;
                    continue;
                }
                let mut kept = Vec::with_capacity(f.corners.len() + 1);
                for i in 0..f.corners.len() {
                    let j = (i + 1) % f.corners.len();
                    let (p, q, s, t) = (f.corners[i], f.corners[j], heights[i], heights[j]);
                    if s <= 0.0 {
                        kept.push(p);
                        if s == 0.0 {
                            rim.push(p);
                        }
                    }
                    if (s < 0.0 && t > 0.0) || (s > 0.0 && t < 0.0) {
                        let (p, q, s, t) = if s < 0.0 { (p, q, s, t) } else { (q, p, t, s) };
                        let cut = p + (q - p) * (s / (s - t));
                        kept.push(cut);
                        rim.push(cut);
                    }
                }
                // What is left of a face that only touches the plane is an edge or a corner.
                f.corners = if kept.len() >= 3 && heights.iter().any(|s| *s < 0.0) { kept } else { Vec::new() };
            }
            facets.retain(|f| !f.corners.is_empty());
            if facets.is_empty() {
                return None;
            }
            if !lies_on_face {
                let corners = around_middle(rim, n, eps);
                if corners.len() >= 3 {
                    facets.push(Facet { plane: Some(k), corners });
                }
            }
        }
        if facets.len() < 4 || facets.iter().any(|f| f.plane.is_none()) {
            return None;
        }
        let mut used: Vec<usize> = facets.iter().filter_map(|f| f.plane).collect();
        used.sort_unstable();
        let vertices = apart(facets.iter().flat_map(|f| f.corners.iter()), eps);
        Some(Self { vertices: vertices.into(), planes: used.into_iter().map(|k| planes[k]).collect() })
    }
}

/// The points that are farther than `eps` from all before them that are kept.
fn apart<'a>(points: impl Iterator<Item = &'a DVec3>, eps: f64) -> Vec<DVec3> {
    let mut kept: Vec<DVec3> = Vec::new();
    // What is near lies in the same cube of this side, or in one of its neighbours.
    let mut cubes: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    for p in points {
        let at = (*p / (2.0 * eps)).floor().to_array().map(|c| c as i64);
        let near = |k: i64| [at[0] + k % 3 - 1, at[1] + k / 3 % 3 - 1, at[2] + k / 9 - 1];
        let beside = (0..27).filter_map(|k| cubes.get(&near(k))).flatten();
        if !beside.into_iter().any(|i| (kept[*i as usize] - *p).length() <= eps) {
            cubes.entry(at).or_default().push(kept.len() as u32);
            kept.push(*p);
        }
    }
    kept
}

fn cube(b: &Aabb) -> Vec<Facet> {
    let c = b.corners();
    [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
        .into_iter()
        .map(|f| Facet { plane: None, corners: f.iter().map(|i| c[*i]).collect() })
        .collect()
}

/// The distinct points of `rim`, by angle around their middle in the plane with normal `n`.
fn around_middle(rim: Vec<DVec3>, n: DVec3, eps: f64) -> Vec<DVec3> {
    let mut points: Vec<DVec3> = Vec::with_capacity(rim.len());
    for p in rim {
        if !points.iter().any(|q| (*q - p).length() <= eps) {
            points.push(p);
        }
    }
    let middle = points.iter().copied().sum::<DVec3>() / points.len().max(1) as f64;
    let u = any_perpendicular(n);
    let v = n.cross(u);
    let angle = |p: &DVec3| libm::atan2((*p - middle).dot(v), (*p - middle).dot(u));
    points.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planes_of_cube(half: f64) -> Vec<(DVec3, f64)> {
        [DVec3::X, DVec3::Y, DVec3::Z].iter().flat_map(|n| [(*n, half), (-*n, half)]).collect()
    }

    #[test]
    fn six_planes_make_a_cube_and_a_seventh_cuts_its_corner() {
        let around = Aabb::around(DVec3::ZERO, DVec3::splat(2.0));
        let mut planes = planes_of_cube(1.0);
        let cube = Polyhedron::from_planes(&planes, &around).expect("bounded");
        assert_eq!((cube.vertices.len(), cube.planes.len()), (8, 6));
        planes.push((DVec3::ONE.normalize(), 2.0 / 3f64.sqrt()));
        let cut = Polyhedron::from_planes(&planes, &around).expect("bounded");
        assert_eq!((cut.vertices.len(), cut.planes.len()), (10, 7));
    }

    #[test]
    fn planes_without_a_face_are_left_out() {
        let around = Aabb::around(DVec3::ZERO, DVec3::splat(2.0));
        let mut planes = planes_of_cube(1.0);
        planes.insert(2, (DVec3::X, 1.5));
        planes.push((DVec3::Y, 1.0));
        let cube = Polyhedron::from_planes(&planes, &around).expect("bounded");
        assert_eq!(cube.planes, planes_of_cube(1.0));
    }

    #[test]
    fn open_and_empty_sets_of_planes_have_no_polyhedron() {
        let around = Aabb::around(DVec3::ZERO, DVec3::splat(2.0));
        assert_eq!(Polyhedron::from_planes(&planes_of_cube(1.0)[..5], &around), None);
        let mut planes = planes_of_cube(1.0);
        planes.push((DVec3::X, -1.5));
        assert_eq!(Polyhedron::from_planes(&planes, &around), None);
    }
}
