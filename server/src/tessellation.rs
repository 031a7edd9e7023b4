//! Triangles of solids, for viewers and no part of any answer: a mesh's own, and of any other solid those of dual contouring, which
//! keeps edges and corners.
//!
//! Source: T. Ju, F. Losasso, S. Schaefer, J. Warren, "Dual contouring of Hermite data" (2002). Where the edges of a grid cross the
//! surface is found on f, with the normals there. Each cell that is crossed gets the point that lies best on all tangent planes, and
//! each crossed edge a quad between the points of the four cells around it. f is 1-Lipschitz, so blocks that are farther from the
//! surface than they are large are skipped unseen. What is smaller than a cell may be lost.

use crate::math::Aabb;
use crate::solid::surface::Face;
use crate::solid::{Sense, Solid};
use glam::{DMat3, DVec3};
use std::collections::HashMap;

/// Triangles in the model's frame, counter-clockwise from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangles {
    /// The corners.
    pub points: Vec<DVec3>,
    /// Three of them a triangle.
    pub indices: Vec<[u32; 3]>,
    /// The id of each triangle's face within the solid; `u32::MAX` where it has none.
    pub faces: Vec<u32>,
    /// The longest side of the cells that they were made in, a length; 0 of a mesh's own.
    pub off: f64,
}

impl Triangles {
    /// The corners of each.
    pub fn corners(&self) -> impl Iterator<Item = [DVec3; 3]> {
        self.indices.iter().map(|t| t.map(|i| self.points[i as usize]))
    }
}

/// A mesh's own triangles, of a solid that is nothing but a mesh.
pub fn of_mesh(solid: &Solid) -> Option<Triangles> {
    let primitive = solid.whole()?;
    let facets = primitive.shape.geometry().facets()?;
    let face = |i: usize| facets.face_of(i as u32).map_or(u32::MAX, |f| primitive.first_face + f);
    Some(Triangles {
        points: facets.vertices.iter().map(|x| primitive.frame.point(*x)).collect(),
        indices: facets.triangles.to_vec(),
        faces: (0..facets.triangles.len()).map(face).collect(),
        off: 0.0,
    })
}

/// The triangles of any solid within a finite box, from 2 to the power `levels` cells along each of its sides.
pub fn of_solid(solid: &Solid, around: &Aabb, levels: u32) -> Triangles {
    let half = around.half() * 1.02;
    let half = half.max(DVec3::splat(1e-9 * half.max_element())).max(DVec3::splat(f64::MIN_POSITIVE));
    let step = 2.0 * half / f64::from(1u32 << levels);
    // Off the middle by a little, so that flat sides of a design do not lie in the grid.
    let origin = around.center() - half - step * DVec3::new(0.0137, 0.0219, 0.0171);
    let mut grid = Grid { solid, origin, step, values: HashMap::new() };
    let mut crossed = Vec::new();
    grid.descend([0; 3], levels, &mut crossed);
    grid.triangles(&crossed)
}

/// A corner of the grid, or the cell above it.
type Corner = [i32; 3];

/// A corner so many steps on along an axis.
fn along(mut corner: Corner, axis: usize, by: i32) -> Corner {
    corner[axis] += by;
    corner
}

struct Grid<'a> {
    solid: &'a Solid,
    origin: DVec3,
    /// The sides of a cell.
    step: DVec3,
    values: HashMap<Corner, f64>,
}

/// What meets in a cell: the sums of the tangent planes' forms, of their right sides, of the crossings, and their number.
struct Crossings {
    form: DMat3,
    right: DVec3,
    points: DVec3,
    count: f64,
}

impl Crossings {
    const NONE: Self = Self { form: DMat3::ZERO, right: DVec3::ZERO, points: DVec3::ZERO, count: 0.0 };

    fn add(&mut self, x: DVec3, n: DVec3) {
        self.form += DMat3::from_cols(n * n.x, n * n.y, n * n.z);
        self.right += n * n.dot(x);
        self.points += x;
        self.count += 1.0;
    }

    /// The point that lies best on all planes; where they leave a direction open the mean of the crossings decides.
    fn point(&self) -> DVec3 {
        let mean = self.points / self.count;
        let pull = DMat3::from_diagonal(DVec3::splat(0.02));
        mean + (self.form + pull).inverse() * (self.right - self.form * mean)
    }
}

impl Grid<'_> {
    fn at(&self, corner: Corner) -> DVec3 {
        self.origin + DVec3::from_array(corner.map(f64::from)) * self.step
    }

    fn value(&mut self, corner: Corner) -> f64 {
        let x = self.at(corner);
        *self.values.entry(corner).or_insert_with(|| self.solid.value(x))
    }

    /// Finds the crossed edges (corner, axis) of a block of 2^level cells a side.
    fn descend(&mut self, from: Corner, level: u32, crossed: &mut Vec<(Corner, usize)>) {
        let side = 1i32 << level;
        let half = 0.5 * self.step * f64::from(side);
        if self.solid.value(self.at(from) + half).abs() > 1.01 * half.length() {
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
        let mut made = Triangles { off: self.step.max_element(), ..Triangles::default() };
        let mut place = HashMap::new();
        let mut met: Vec<(Corner, Crossings)> = Vec::new();
        for edge in crossed {
            let x = self.crossing(*edge);
            let n = normal(self.solid, x).1;
            for cell in cells(*edge) {
                let at = *place.entry(cell).or_insert_with(|| {
                    met.push((cell, Crossings::NONE));
                    met.len() - 1
                });
                met[at].1.add(x, n);
            }
        }
        made.points.extend(met.iter().map(|(cell, crossings)| {
            let low = self.at(*cell);
            crossings.point().clamp(low, low + self.step)
        }));
        for edge in crossed {
            let inward = self.value(edge.0) < 0.0;
            let [a, b, c, d] = cells(*edge).map(|cell| place[&cell] as u32);
            let quad = if inward { [a, b, c, d] } else { [d, c, b, a] };
            for corners in [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]] {
                let [a, b, c] = corners.map(|i| made.points[i as usize]);
                made.faces.push(normal(self.solid, (a + b + c) / 3.0).0);
                made.indices.push(corners);
            }
        }
        made
    }
}

/// The four cells around an edge, counter-clockwise as seen from its far end.
fn cells((from, axis): (Corner, usize)) -> [Corner; 4] {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{Facets, Limits, import_csg};

    fn of(text: &str) -> Triangles {
        let solid = import_csg("t.csg", text, Facets::Auto, &Limits::default()).expect("a model").solid;
        of_mesh(&solid).unwrap_or_else(|| of_solid(&solid, &solid.aabb(), 5))
    }

    /// Volume within: positive where all triangles look outward. Source: Gauss's theorem.
    fn volume(t: &Triangles) -> f64 {
        t.corners().map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn surfaces_are_closed_look_outward_and_hold_about_the_volume() {
        let table = [
            ("sphere(r = 3);", 36.0 * std::f64::consts::PI),
            ("cube([10, 6, 1]);", 60.0),
            ("cube([300, 200, 0.1]);", 6000.0),
            ("difference() { cube([8, 8, 3], center = true); cylinder(r = 2, h = 9, center = true); }", 192.0 - 37.7),
            (
                "polyhedron(points = [[0,0,0],[2,0,0],[0,2,0],[0,0,2]], faces = [[0,1,2],[0,3,1],[0,2,3],[1,3,2]]);",
                4.0 / 3.0,
            ),
        ];
        for (text, expected) in table {
            let t = of(text);
            assert!((volume(&t) / expected - 1.0).abs() < 0.02, "{text}: {} of {expected}", volume(&t));
            assert_eq!(t.faces.len(), t.indices.len());
            let mut edges = HashMap::new();
            for [a, b, c] in &t.indices {
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    *edges.entry((from, to)).or_insert(0) += 1;
                    *edges.entry((to, from)).or_insert(0) -= 1;
                }
            }
            assert!(edges.values().all(|n| *n == 0), "{text}: open");
        }
    }
}
