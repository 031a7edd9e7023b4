//! The planes of a mesh's facets: neighbours in one plane are one face.

use super::mix::Mixed;
use glam::DVec3;
use rayon::prelude::*;

/// The plane of no face: facets too thin to have one.
pub const NONE: u32 = u32::MAX;

/// a·b − c·d, right to a rounding and a half (W. Kahan).
fn difference_of_products(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let cd = c * d;
    let error = (-c).mul_add(d, cd);
    a.mul_add(b, -cd) + error
}

/// a − b and what the difference leaves to rounding.
fn two_difference(a: DVec3, b: DVec3) -> (DVec3, DVec3) {
    let x = a - b;
    let virtual_b = a - x;
    let virtual_a = x + virtual_b;
    (x, (a - virtual_a) + (virtual_b - b))
}

fn cross(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(
        difference_of_products(a.y, b.z, a.z, b.y),
        difference_of_products(a.z, b.x, a.x, b.z),
        difference_of_products(a.x, b.y, a.y, b.x),
    )
}

/// Twice the area of a triangle times its normal, right to a few roundings however thin it is.
pub fn area(p: DVec3, q: DVec3, r: DVec3) -> DVec3 {
    let ((a, da), (b, db)) = (two_difference(q, p), two_difference(r, p));
    cross(a, b) + (cross(a, db) + cross(da, b))
}

/// A plane n·x <= d through three points, halfway between their heights.
fn plane_of(n: DVec3, corners: [DVec3; 3]) -> (DVec3, f64) {
    let heights = corners.map(|c| n.dot(c));
    let (low, high) = heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    (n, if low == high { low } else { 0.5 * (low + high) })
}

/// The planes of the faces, and for each triangle its face or `NONE`; `opposite` are the neighbours of each along its sides.
///
/// The largest triangles gather first; a neighbour is of the same face where all its corners lie within `tolerance` (a length) of
/// that plane and it faces the same way. Faces with the same plane to the bit are one, whether they touch or not.
pub fn of(
    vertices: &[DVec3],
    triangles: &[[u32; 3]],
    opposite: &[[u32; 3]],
    tolerance: f64,
) -> (Vec<(DVec3, f64)>, Vec<u32>) {
    let corners = |t: &[u32; 3]| t.map(|v| vertices[v as usize]);
    let areas: Vec<DVec3> = triangles.par_iter().map(&corners).map(|[p, q, r]| area(p, q, r)).collect();
    let thin = |i: usize| {
        let [p, q, r] = corners(&triangles[i]);
        let longest = p.distance(q).max(q.distance(r)).max(r.distance(p));
        areas[i].length() <= tolerance * longest
    };
    let mut order: Vec<(f64, u32)> = (0..triangles.len() as u32)
        .into_par_iter()
        .filter(|i| !thin(*i as usize))
        .map(|i| (areas[i as usize].length_squared(), i))
        .collect();
    order.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut group = vec![NONE; triangles.len()];
    let mut planes: Vec<(DVec3, f64)> = Vec::new();
    let mut same: Mixed<[u64; 4], u32> = Mixed::with_capacity_and_hasher(order.len(), Default::default());
    let mut next = Vec::new();
    for (_, seed) in order {
        let seed = seed as usize;
        if group[seed] != NONE {
            continue;
        }
        let (n, d) = plane_of(areas[seed].normalize(), corners(&triangles[seed]));
        let bits = [n.x, n.y, n.z, d].map(|v| (v + 0.0).to_bits());
        let id = *same.entry(bits).or_insert_with(|| {
            planes.push((n, d));
            planes.len() as u32 - 1
        });
        group[seed] = id;
        next.push(seed);
        while let Some(i) = next.pop() {
            for j in opposite[i] {
                if j == NONE || group[j as usize] != NONE {
                    continue;
                }
                let j = j as usize;
                let fits = || {
                    areas[j].dot(n) > 0.0 && corners(&triangles[j]).iter().all(|c| (n.dot(*c) - d).abs() <= tolerance)
                };
                if !thin(j) && fits() {
                    group[j] = id;
                    next.push(j);
                }
            }
        }
    }
    in_file_order(planes, group)
}

/// Faces in the order of their first triangles.
fn in_file_order(planes: Vec<(DVec3, f64)>, mut group: Vec<u32>) -> (Vec<(DVec3, f64)>, Vec<u32>) {
    let mut place = vec![NONE; planes.len()];
    let mut ordered = Vec::with_capacity(planes.len());
    for g in group.iter_mut().filter(|g| **g != NONE) {
        let old = *g as usize;
        if place[old] == NONE {
            place[old] = ordered.len() as u32;
            ordered.push(planes[old]);
        }
        *g = place[old];
    }
    (ordered, group)
}
