//! The planes of a mesh's facets: neighbours in one plane are one face.

use crate::math::mix::Mixed;
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::hash::BuildHasher;

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
    let count = triangles.len();
    let corners = |i: usize| triangles[i].map(|v| vertices[v as usize]);
    let areas: Vec<DVec3> = (0..count).into_par_iter().map(&corners).map(|[p, q, r]| area(p, q, r)).collect();
    // The plane of each by itself; of one that is too thin to have one there is no normal.
    let own = |i: usize| {
        let [p, q, r] = corners(i);
        let longest = p.distance(q).max(q.distance(r)).max(r.distance(p));
        if areas[i].length() <= tolerance * longest {
            (DVec3::NAN, 0.0)
        } else {
            plane_of(areas[i].normalize(), [p, q, r])
        }
    };
    let own: Vec<(DVec3, f64)> = (0..count).into_par_iter().map(own).collect();
    let thin = |i: usize| own[i].0.is_nan();
    let fits = |(n, d): (DVec3, f64), j: usize| {
        areas[j].dot(n) > 0.0 && corners(j).iter().all(|c| (n.dot(*c) - d).abs() <= tolerance) && !thin(j)
    };
    let gathers = |i: &u32| {
        let i = *i as usize;
        !thin(i) && opposite[i].iter().any(|j| *j != NONE && fits(own[i], *j as usize))
    };
    let size = |i: u32| areas[i as usize].length_squared();
    let before = |a: u32, b: u32| size(b).total_cmp(&size(a)).then(a.cmp(&b));
    // Those that gather no neighbour are faces of their own unless one that comes before them takes them.
    let mut seeds: Vec<u32> = (0..count as u32).into_par_iter().filter(gathers).collect();
    seeds.par_sort_unstable_by(|a, b| before(*a, *b));
    let mut group = vec![NONE; count];
    let mut faces = Alike::new(&own);
    let mut next = Vec::new();
    for seed in seeds {
        if group[seed as usize] != NONE {
            continue;
        }
        let id = faces.of(seed, before);
        group[seed as usize] = id;
        next.push(seed as usize);
        while let Some(i) = next.pop() {
            for j in opposite[i] {
                if j != NONE
                    && group[j as usize] == NONE
                    && fits(own[seed as usize], j as usize)
                    && before(seed, j).is_lt()
                {
                    group[j as usize] = id;
                    next.push(j as usize);
                }
            }
        }
    }
    for i in 0..count as u32 {
        if group[i as usize] == NONE && !thin(i as usize) {
            group[i as usize] = faces.of(i, before);
        }
    }
    // Of a large mesh each of these takes as much as the planes do.
    let Alike { first, table, .. } = faces;
    drop((areas, table));
    let first = in_file_order(first, &mut group);
    (first.into_iter().map(|seed| own[seed as usize]).collect(), group)
}

/// Faces by their planes' bits.
struct Alike<'p> {
    planes: &'p [(DVec3, f64)],
    /// Of each face the triangle whose plane it has.
    first: Vec<u32>,
    /// Faces, each at its hash or the first free place behind it.
    table: Vec<u32>,
}

impl<'p> Alike<'p> {
    /// None yet of so many planes.
    fn new(planes: &'p [(DVec3, f64)]) -> Self {
        Self { planes, first: Vec::new(), table: vec![NONE; (2 * planes.len()).next_power_of_two()] }
    }

    /// The face of a triangle's plane: it has the bits of the first that is named in the order `before`.
    fn of(&mut self, triangle: u32, before: impl Fn(u32, u32) -> Ordering) -> u32 {
        // Adding 0 turns -0 into 0.
        let bits = |i: u32| {
            let (n, d) = self.planes[i as usize];
            [n.x, n.y, n.z, d].map(|v| (v + 0.0).to_bits())
        };
        let own = bits(triangle);
        let mut at = Mixed::<(), ()>::default().hasher().hash_one(own) as usize & (self.table.len() - 1);
        loop {
            match self.table[at] {
                NONE => {
                    self.table[at] = self.first.len() as u32;
                    self.first.push(triangle);
                    return self.table[at];
                }
                face if bits(self.first[face as usize]) == own => {
                    let first = &mut self.first[face as usize];
                    if before(triangle, *first).is_lt() {
                        *first = triangle;
                    }
                    return face;
                }
                _ => at = (at + 1) & (self.table.len() - 1),
            }
        }
    }
}

/// What is said of faces in the order of their first triangles; of each triangle its face is named by that order.
fn in_file_order(said: Vec<u32>, group: &mut [u32]) -> Vec<u32> {
    let mut place = vec![NONE; said.len()];
    let mut ordered = Vec::with_capacity(said.len());
    for g in group.iter_mut().filter(|g| **g != NONE) {
        let old = *g as usize;
        if place[old] == NONE {
            place[old] = ordered.len() as u32;
            ordered.push(said[old]);
        }
        *g = place[old];
    }
    ordered
}
