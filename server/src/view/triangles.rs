//! Triangles of solids: a mesh's own, and of any other solid those of dual contouring, whose edges and corners are kept.
//!
//! Idea (T. Ju, F. Losasso, S. Schaefer, J. Warren, "Dual contouring of Hermite data", 2002): where the edges of a grid of cubes cross
//! the surface is found on f, with the normals there. Each cube that is crossed gets the point that lies best on all tangent planes,
//! and each crossed edge a quad between the points of the four cubes around it. f is 1-Lipschitz, so cubes that are farther from
//! the surface than they are large are skipped unseen.

use crate::math::Aabb;
use crate::solid::surface::Face;
use crate::solid::{Sense, Solid};
use glam::{DMat3, DVec3};
use std::collections::HashMap;

/// Cubes along the longest side: 2 to this power.
const LEVELS: u32 = 6;

/// Triangles in the model's frame, counter-clockwise from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangles {
    /// The corners of each.
    pub corners: Vec<[DVec3; 3]>,
    /// The id of the face of each within the solid; `u32::MAX` where it has none.
    pub faces: Vec<u32>,
    /// The side of the cubes that they were made in, a length; 0 of a mesh's own.
    pub off: f64,
}

/// A mesh's own triangles, of a solid that is nothing but a mesh.
pub fn of_mesh(solid: &Solid) -> Option<Triangles> {
    let primitive = solid.whole()?;
    let facets = primitive.shape.geometry().facets()?;
    let corner = |v: &u32| primitive.frame.point(facets.vertices[*v as usize]);
    let face = |i: usize| facets.face_of(i as u32).map_or(u32::MAX, |f| primitive.first_face + f);
    Some(Triangles {
        corners: facets.triangles.iter().map(|t| [corner(&t[0]), corner(&t[1]), corner(&t[2])]).collect(),
        faces: (0..facets.triangles.len()).map(face).collect(),
        off: 0.0,
    })
}

/// The triangles of any solid within a finite box.
pub fn of_solid(solid: &Solid, around: &Aabb) -> Triangles {
    let whole = around.half().max_element().max(1e-9) * 1.02;
    let step = 2.0 * whole / f64::from(1u32 << LEVELS);
    // Off the middle by a little, so that flat sides of a design do not lie in the grid.
    let origin = around.center() - whole - step * DVec3::new(0.0137, 0.0219, 0.0171);
    let mut grid = Grid { solid, origin, step, values: HashMap::new(), points: HashMap::new(), sum: HashMap::new() };
    let mut crossed = Vec::new();
    grid.descend([0; 3], LEVELS, &mut crossed);
    grid.triangles(&crossed)
}

/// A corner of the grid, or the cube above it.
type Corner = [i32; 3];

/// A corner so many steps on along an axis.
fn along(mut corner: Corner, axis: usize, by: i32) -> Corner {
    corner[axis] += by;
    corner
}

struct Grid<'a> {
    solid: &'a Solid,
    origin: DVec3,
    step: f64,
    values: HashMap<Corner, f64>,
    /// The point of each crossed cube.
    points: HashMap<Corner, DVec3>,
    /// What meets in a cube: the tangent planes' forms, right sides, the points, their number.
    sum: HashMap<Corner, (DMat3, DVec3, DVec3, f64)>,
}

impl Grid<'_> {
    fn at(&self, corner: Corner) -> DVec3 {
        self.origin + DVec3::from_array(corner.map(f64::from)) * self.step
    }

    fn value(&mut self, corner: Corner) -> f64 {
        let x = self.at(corner);
        *self.values.entry(corner).or_insert_with(|| self.solid.value(x))
    }

    /// Finds the crossed edges (corner, axis) of a block of 2^level cubes.
    fn descend(&mut self, from: Corner, level: u32, crossed: &mut Vec<(Corner, usize)>) {
        let side = 1i32 << level;
        let half = 0.5 * self.step * f64::from(side);
        if self.solid.value(self.at(from) + half).abs() > 1.75 * half {
            return;
        }
        if level > 0 {
            for i in 0..8 {
                let at = [0, 1, 2].map(|k| from[k] + (i >> k & 1) * (side / 2));
                self.descend(at, level - 1, crossed);
            }
            return;
        }
        for axis in 0..3 {
            if (self.value(from) < 0.0) != (self.value(along(from, axis, 1)) < 0.0) {
                crossed.push((from, axis));
            }
        }
    }

    /// Where an edge crosses the surface.
    fn crossing(&mut self, (from, axis): (Corner, usize)) -> DVec3 {
        let (mut a, mut b) = (self.at(from), self.at(along(from, axis, 1)));
        if self.value(from) >= 0.0 {
            std::mem::swap(&mut a, &mut b);
        }
        for _ in 0..30 {
            let middle = 0.5 * (a + b);
            if self.solid.value(middle) < 0.0 { a = middle } else { b = middle }
        }
        0.5 * (a + b)
    }

    fn triangles(&mut self, crossed: &[(Corner, usize)]) -> Triangles {
        for edge in crossed {
            let x = self.crossing(*edge);
            let n = normal(self.solid, x).1;
            let form = DMat3::from_cols(n * n.x, n * n.y, n * n.z);
            for cube in cubes(*edge) {
                let sum = self.sum.entry(cube).or_insert((DMat3::ZERO, DVec3::ZERO, DVec3::ZERO, 0.0));
                *sum = (sum.0 + form, sum.1 + n * n.dot(x), sum.2 + x, sum.3 + 1.0);
            }
        }
        for (cube, (form, right, points, count)) in &self.sum {
            let mean = *points / *count;
            // Where the planes leave a direction open the mean decides.
            let pull = DMat3::from_diagonal(DVec3::splat(0.02));
            let best = mean + (*form + pull).inverse() * (*right - *form * mean);
            let low = self.origin + DVec3::from_array(cube.map(f64::from)) * self.step;
            self.points.insert(*cube, best.clamp(low, low + self.step));
        }
        let mut made = Triangles { off: self.step, ..Triangles::default() };
        for edge in crossed {
            let inward = self.value(edge.0) < 0.0;
            let [a, b, c, d] = cubes(*edge).map(|cube| self.points[&cube]);
            let quad = if inward { [a, b, c, d] } else { [d, c, b, a] };
            for corners in [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]] {
                let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
                if corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0] {
                    made.faces.push(normal(self.solid, middle).0);
                    made.corners.push(corners);
                }
            }
        }
        made
    }
}

/// The four cubes around an edge, counter-clockwise as seen from its far end.
fn cubes((from, axis): (Corner, usize)) -> [Corner; 4] {
    let before = |u: i32, v: i32| along(along(from, (axis + 1) % 3, -u), (axis + 2) % 3, -v);
    [before(1, 1), before(0, 1), from, before(1, 0)]
}

/// The face that decides at a point, and the solid's outward normal there.
pub fn normal(solid: &Solid, x: DVec3) -> (u32, DVec3) {
    let (_, literal) = solid.deciding(x);
    let face: &Face = &solid.faces[literal.face() as usize];
    let n = face.unit_normal(x);
    (literal.face(), if literal.sense() == Sense::Negative { -n } else { n })
}
