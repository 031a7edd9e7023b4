//! How often a mesh winds around the places in front of and behind a part of it.
//!
//! A ray along an axis from a point inside of the part counts the triangles that it leaves through less those that it enters
//! through: above the last one it is 0. All of it in whole numbers; a ray that meets a side or a corner is none, and another point
//! is taken.

use super::exact::Point;
use super::facets::{Facets, normal};
use crate::math::Aabb;
use crate::math::halt;
use dashu_int::IBig;
use glam::DVec3;
use std::cmp::Ordering;

/// Points that are tried.
const TRIES: u64 = 64;

/// What is known of a part's two sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Winding {
    /// The winding number where its triangle's normal points to …
    pub front: i32,
    /// … and on the other side.
    pub behind: i32,
    /// The first triangle of those that lie on each other there.
    pub owner: u32,
}

/// A point inside of a part of a triangle.
struct Inner {
    /// Along the axes behind the triangle's own, times `weight`.
    at: [IBig; 2],
    weight: IBig,
    near: DVec3,
}

impl Inner {
    /// Some mean of three points that are not in a line.
    fn of(corners: [&Point; 3], axis: usize, shares: [u64; 3]) -> Self {
        let [a, b, c] = corners.map(|p| &p.weight);
        let shares_of = [b * c * shares[0], a * c * shares[1], a * b * shares[2]];
        let sum = |k: usize| {
            let part = |m: usize| &corners[m].at[(axis + k) % 3] * &shares_of[m];
            part(0) + part(1) + part(2)
        };
        let all: u64 = shares.iter().sum();
        let near = (0..3).map(|m| corners[m].near * shares[m] as f64).sum::<DVec3>() / all as f64;
        Self { at: [sum(1), sum(2)], weight: a * b * c * all, near }
    }
}

impl Winding {
    /// Of a part of a triangle that holds three corners which are not in a line. `None` where no ray told.
    pub fn of(facets: &Facets, facet: u32, corners: [&Point; 3]) -> Option<Self> {
        let axis = facets.all[facet as usize].axis;
        (0..TRIES).find_map(|k| {
            halt::point();
            let shares = [0, 1, 2].map(|m| 1 + (k * (7 + 4 * m) + 3 * m * k * k) % 101);
            seen(facets, facet, &Inner::of(corners, axis, shares))
        })
    }
}

/// What a ray from a point tells; `None` where it meets a side.
fn seen(facets: &Facets, facet: u32, from: &Inner) -> Option<Winding> {
    let own = &facets.all[facet as usize];
    let [i, j] = [(own.axis + 1) % 3, (own.axis + 2) % 3];
    let near = |b: &Aabb| {
        let beside = |k: usize| b.min[k] <= from.near[k] + 4.0 && from.near[k] - 4.0 <= b.max[k];
        beside(i) && beside(j) && b.max[own.axis] >= from.near[own.axis] - 8.0
    };
    let mut met = Vec::new();
    facets.tree.visit(near, |f| {
        if near(&facets.boxes[f as usize]) {
            met.push(f);
        }
    });
    let (mut above, mut within, mut owner) = (0, 0, facet);
    for f in met {
        let Some(up) = crossed(facets, f, own.axis, from)? else { continue };
        let turn = if up { 1 } else { -1 };
        match height(facets, [f, facet], own.axis, from) {
            Ordering::Greater => above += turn,
            Ordering::Less => {}
            // One that only cuts it here tells nothing.
            Ordering::Equal if !facets.are_coplanar(facet, f) => return None,
            Ordering::Equal => {
                within += turn;
                owner = owner.min(f);
            }
        }
    }
    let (front, behind) = if own.up { (above, above + within) } else { (above + within, above) };
    Some(Winding { front, behind, owner })
}

/// Whether the line along an axis through a point runs through a triangle, and whether it leaves there on its way up; `None` where
/// it meets a side.
fn crossed(facets: &Facets, facet: u32, axis: usize, at: &Inner) -> Option<Option<bool>> {
    let corners = facets.corners(facet);
    let turn = normal(corners)[axis].signum();
    let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
    let sides = [0, 1, 2].map(|m| {
        let (p, q) = (corners[m], corners[(m + 1) % 3]);
        let away = |k: usize, of: usize| &at.at[of] - &at.weight * p[k];
        let value = away(j, 1) * (q[i] - p[i]) - away(i, 0) * (q[j] - p[j]);
        value.cmp(&IBig::ZERO)
    });
    let within = if turn > 0 { Ordering::Greater } else { Ordering::Less };
    if turn == 0 {
        // Seen from its side it is a segment.
        return if sides == [Ordering::Equal; 3] { None } else { Some(None) };
    }
    if sides.contains(&within.reverse()) {
        return Some(None);
    }
    if sides.contains(&Ordering::Equal) { None } else { Some(Some(turn > 0)) }
}

/// Which of two planes a line along an axis meets higher up.
fn height(facets: &Facets, of: [u32; 2], axis: usize, at: &Inner) -> Ordering {
    let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
    // Where n_axis z = d - n_i u - n_j v, as a fraction with a denominator above 0.
    let [(z, below), (w, under)] = of.map(|f| {
        let corners = facets.corners(f);
        let n = normal(corners).map(IBig::from);
        let offset = &n[0] * corners[0][0] + &n[1] * corners[0][1] + &n[2] * corners[0][2];
        let z = offset * &at.weight - &n[i] * &at.at[0] - &n[j] * &at.at[1];
        if n[axis] < IBig::ZERO { (-z, -n[axis].clone()) } else { (z, n[axis].clone()) }
    });
    (z * under).cmp(&(w * below))
}
