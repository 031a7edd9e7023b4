//! Corners of a polyhedron, and which of them are outermost along a direction.
//!
//! Of many corners few can be outermost along directions that differ by little. Directions are sorted into cells on the six sides of a
//! cube; of each cell those corners are listed that may be outermost anywhere in it: with w the outermost along its middle c, another
//! corner v is not, if (w − v)·c > |w − v| |d − c| for every unit direction d in the cell. The lists are made when a primitive is placed,
//! so that no step waits for them.

use glam::DVec3;
use std::ops::Deref;
use std::sync::{Arc, OnceLock};

/// Corners up to which all are looked at.
const FEW: usize = 32;
/// Cells along an edge of the cube; and larger ones, of which each has some of them.
const CELLS: usize = 8;
const COARSE: usize = 2;
/// What rounding may do to a place in a cell and to a difference of heights, relative.
const SLACK: f64 = 1e-12;

/// Corners in their order.
#[derive(Clone, Debug, Default)]
pub struct Corners {
    all: Vec<DVec3>,
    outermost: OnceLock<Arc<Outermost>>,
}

/// Corners that may be outermost, by cells of directions.
#[derive(Debug)]
struct Outermost {
    /// Where each cell's list ends.
    ends: Vec<u32>,
    lists: Vec<u32>,
}

impl From<Vec<DVec3>> for Corners {
    fn from(all: Vec<DVec3>) -> Self {
        Self { all, outermost: OnceLock::new() }
    }
}

impl Deref for Corners {
    type Target = [DVec3];

    fn deref(&self) -> &[DVec3] {
        &self.all
    }
}

/// What follows from them is no part of them.
impl PartialEq for Corners {
    fn eq(&self, other: &Self) -> bool {
        self.all == other.all
    }
}

impl Corners {
    /// The numbers of those that may be outermost along a direction of any length, in order; `None` for all of them.
    #[inline]
    pub fn foremost(&self, along: DVec3) -> Option<&[u32]> {
        if self.all.len() <= FEW {
            return None;
        }
        let cell = cell(along)?;
        let outermost = self.lists();
        let from = if cell == 0 { 0 } else { outermost.ends[cell - 1] };
        Some(&outermost.lists[from as usize..outermost.ends[cell] as usize])
    }

    fn lists(&self) -> &Outermost {
        self.outermost.get_or_init(|| Arc::new(Outermost::of(&self.all)))
    }

    /// Makes the lists, if there are any.
    pub fn prepare(&self) {
        if self.all.len() > FEW {
            self.lists();
        }
    }

    /// The outermost along a direction of any length, the first of equals, and its height.
    #[inline]
    pub fn farthest(&self, along: DVec3) -> (f64, DVec3) {
        // Of the best its place alone is kept: its corner is read once.
        let (mut highest, mut best) = (f64::NEG_INFINITY, 0);
        let mut look = |place: usize| {
            let height = along.dot(self.all[place]);
            if height > highest {
                (highest, best) = (height, place);
            }
        };
        match self.foremost(along) {
            Some(some) => some.iter().for_each(|i| look(*i as usize)),
            None => (0..self.all.len()).for_each(look),
        }
        (highest, self.all[best])
    }
}

/// The cell of a direction; `None` of none.
#[inline]
fn cell(along: DVec3) -> Option<usize> {
    let size = along.abs();
    let axis = size.max_position();
    if !(size[axis] > 0.0 && size[axis].is_finite()) {
        return None;
    }
    let place = |k: usize| {
        let at = (along[k] / size[axis] + 1.0) * (0.5 * CELLS as f64);
        (at as usize).min(CELLS - 1)
    };
    let side = 2 * axis + usize::from(along[axis] < 0.0);
    Some((side * CELLS + place((axis + 1) % 3)) * CELLS + place((axis + 2) % 3))
}

/// The middle of a cell of so many along an edge, and how far any of its directions is from it.
fn middle(cells: usize, cell: usize) -> (DVec3, f64) {
    let (side, i, j) = (cell / (cells * cells), cell / cells % cells, cell % cells);
    let axis = side / 2;
    let direction = |u: f64, v: f64| {
        let mut d = DVec3::ZERO;
        d[axis] = if side % 2 == 0 { 1.0 } else { -1.0 };
        d[(axis + 1) % 3] = (2.0 * (i as f64 + u)) / cells as f64 - 1.0;
        d[(axis + 2) % 3] = (2.0 * (j as f64 + v)) / cells as f64 - 1.0;
        d.normalize()
    };
    let middle = direction(0.5, 0.5);
    // A cell is a convex polygon on the sphere: none of its directions is farther from the middle than its corners.
    let corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)].map(|(u, v)| direction(u, v));
    (middle, corners.iter().map(|d| d.distance(middle)).fold(0.0, f64::max) + SLACK)
}

/// Appends those of some corners that may be outermost in a cell.
fn outermost(all: &[DVec3], some: &[u32], (middle, off): (DVec3, f64), out: &mut Vec<u32>) {
    let farther = |best: (f64, DVec3), i: &u32| {
        let v = all[*i as usize];
        let height = middle.dot(v);
        if height > best.0 { (height, v) } else { best }
    };
    let (height, first) = some.iter().fold((f64::NEG_INFINITY, DVec3::ZERO), farther);
    let may_be = |i: &&u32| {
        let v = all[**i as usize];
        let short = height - middle.dot(v) - SLACK * v.length();
        short <= 0.0 || short * short <= first.distance_squared(v) * off * off
    };
    out.extend(some.iter().filter(may_be));
}

impl Outermost {
    fn of(all: &[DVec3]) -> Self {
        let every: Vec<u32> = (0..all.len() as u32).collect();
        // Those of larger cells first: the smaller ones in them have no others.
        let larger = |cell: usize| {
            let mut some = Vec::new();
            outermost(all, &every, middle(COARSE, cell), &mut some);
            some
        };
        let larger: Vec<Vec<u32>> = (0..6 * COARSE * COARSE).map(larger).collect();
        let (mut ends, mut lists) = (Vec::with_capacity(6 * CELLS * CELLS), Vec::new());
        for cell in 0..6 * CELLS * CELLS {
            let (side, i, j) = (cell / (CELLS * CELLS), cell / CELLS % CELLS, cell % CELLS);
            let within = (side * COARSE + i * COARSE / CELLS) * COARSE + j * COARSE / CELLS;
            outermost(all, &larger[within], middle(CELLS, cell), &mut lists);
            ends.push(lists.len() as u32);
        }
        Self { ends, lists }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    /// Of corners on spheres, of slabs and of grids, in any place, the list has the one that a look at all of them finds: along random
    /// directions, along axes, across edges, where several are as far.
    #[test]
    fn the_outermost_corner_is_the_one_of_all() {
        let mut r = Random(11);
        let (mut listed, mut asked) = (0, 0);
        for k in 0..60 {
            let count = 33 + (r.unit() * 400.0) as usize;
            let at = r.vector(1.0) * if k % 3 == 0 { 0.0 } else { 50.0 };
            let squash = DVec3::new(1.0, 1.0, if k % 2 == 0 { 1.0 } else { 1e-3 });
            let corner = |r: &mut Random| match k % 4 {
                // A grid: many are as far along its axes.
                0 => (r.vector(1.0) * 3.0).round(),
                _ => r.vector(1.0).normalize() * squash,
            };
            let all: Vec<DVec3> = (0..count).map(|_| at + corner(&mut r)).collect();
            let corners = Corners::from(all.clone());
            for n in 0..400 {
                let along = match n % 4 {
                    0 => DVec3::AXES[n / 4 % 3] * if n % 8 == 0 { 1.0 } else { -1.0 },
                    1 => (all[n % count] - all[(n + 1) % count]).cross(r.vector(1.0)),
                    2 => (r.vector(1.0) * 4.0).round(),
                    _ => r.vector(1.0) * 1e-7,
                };
                let first = (f64::NEG_INFINITY, all[0]);
                let whole =
                    all.iter().fold(first, |best, v| if along.dot(*v) > best.0 { (along.dot(*v), *v) } else { best });
                assert_eq!(corners.farthest(along), whole, "{k} {n}: {along}");
                listed += corners.foremost(along).map_or(count, <[u32]>::len);
                asked += count;
            }
        }
        // Of corners that are one sphere's a tenth, and more of a grid.
        assert!(listed * 3 < asked, "{listed} of {asked}");
    }
}
