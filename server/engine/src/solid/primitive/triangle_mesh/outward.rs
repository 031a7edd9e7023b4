//! Whether the inside of every part of a surface is on its inner side.
//!
//! Parts are what edges of two facets connect; no two of them run through each other. In front of a part a line along +x has to
//! cross an even number of facets, behind it an odd one (`side`). Then an outermost part winds around what is in it once, the next
//! one takes that away, and so on: winding numbers are 0 and 1 alone, and 1 is where the formula is inside. A part that is inside
//! out, or within another one that runs the same way, has it the other way round. One facet tells it of all of its part.

use super::MeshFault;
use super::edges::NONE;
use super::planes::area;
use super::side::crosses;
use super::surface::Surface;
use glam::DVec3;
use std::collections::HashMap;

/// The largest facet with a plane of each part, in order; `leaders` names of each triangle the first one of its part.
pub fn largest(surface: &Surface, leaders: &[u32]) -> Vec<u32> {
    let size = |i: u32| {
        let [a, b, c] = surface.corners(i);
        (b - a).cross(c - a).length_squared()
    };
    let mut largest: HashMap<u32, (u32, f64)> = HashMap::new();
    for (i, leader) in leaders.iter().enumerate().filter(|(i, _)| surface.face_of[*i] != NONE) {
        let one = largest.entry(*leader).or_insert((NONE, -1.0));
        let own = size(i as u32);
        if own > one.1 {
            *one = (i as u32, own);
        }
    }
    let mut largest: Vec<u32> = largest.into_values().map(|one| one.0).collect();
    largest.sort_unstable();
    largest
}

/// Looks on both sides of a facet; `is_inside` tells whether a line from a point along +x crosses an odd number of facets.
///
/// # Errors
/// Where its inside is not on its inner side.
pub fn is_outward(surface: &Surface, facet: u32, is_inside: impl Fn(DVec3) -> bool) -> Result<(), MeshFault> {
    let step = 1e2 * surface.tolerance;
    let [a, b, c] = surface.corners(facet);
    let (middle, n) = ((a + b + c) / 3.0, area(a, b, c).normalize_or_zero());
    if is_inside(middle - n * step) && !is_inside(middle + n * step) {
        Ok(())
    } else {
        Err(MeshFault::Crossing(middle))
    }
}

/// The same of every part of a surface of few facets.
///
/// # Errors
/// The first one that is not.
pub fn are_outward(surface: &Surface, leaders: &[u32]) -> Result<(), MeshFault> {
    let all = || (0..surface.triangles.len() as u32).map(|i| surface.corners(i));
    let is_inside = |p: DVec3| all().filter(|t| crosses(p, *t)).count() % 2 == 1;
    largest(surface, leaders).into_iter().try_for_each(|i| is_outward(surface, i, is_inside))
}
