//! A solid's surface as triangles, for viewers: coarse, and no part of any answer.
//!
//! Source: surface nets (S. Gibson, "Constrained elastic surface nets", 1998), without the relaxation: a vertex in each cell of a
//! grid that the surface crosses, in the mean of its crossings, then pulled onto the surface along f's gradient. What is smaller than
//! a cell is lost. A solid that is one mesh is taken as it is.

use crate::math::Aabb;
use crate::octree::Model;
use glam::DVec3;

/// Cells along the longest side …
const MOST: f64 = 28.0;
/// … and along any side, at least.
const LEAST: f64 = 6.0;
/// Facets of a mesh that is taken as it is, at most.
const FACETS: usize = 20_000;

/// Triangles in the model's frame.
#[derive(Clone, Debug, Default)]
pub struct Surface {
    /// The corners.
    pub points: Vec<DVec3>,
    /// Three of them a triangle, counter-clockwise from outside.
    pub indices: Vec<u32>,
}

/// The surface of a model; what reaches to infinity is cut off at `reach`.
pub fn surface(model: &Model, reach: f64) -> Surface {
    if let Some(surface) = mesh(model) {
        return surface;
    }
    let aabb = model.solid.aabb();
    let aabb = Aabb { min: aabb.min.max(DVec3::splat(-reach)), max: aabb.max.min(DVec3::splat(reach)) };
    let size = aabb.max - aabb.min;
    if model.solid.is_empty() || size.is_nan() || size.min_element() <= 0.0 {
        return Surface::default();
    }
    Grid::new(model, &aabb).surface()
}

/// A solid that is one primitive with facets.
fn mesh(model: &Model) -> Option<Surface> {
    let primitive = model.solid.whole()?;
    let facets = primitive.shape.geometry().facets().filter(|facets| facets.triangles.len() <= FACETS)?;
    let points = facets.vertices.iter().map(|x| primitive.frame.point(*x)).collect();
    Some(Surface { points, indices: facets.triangles.iter().flatten().copied().collect() })
}

/// f at the points of a grid.
struct Grid<'a> {
    model: &'a Model,
    low: DVec3,
    step: DVec3,
    /// Points along each axis.
    count: [usize; 3],
    values: Vec<f64>,
}

impl<'a> Grid<'a> {
    /// A grid over a box and one cell around it.
    fn new(model: &'a Model, aabb: &Aabb) -> Self {
        let size = aabb.max - aabb.min;
        let cells = (size * (MOST / size.max_element())).ceil().max(DVec3::splat(LEAST));
        let step = size / cells;
        let count = [cells.x, cells.y, cells.z].map(|n| n as usize + 3);
        // Off by a part of a cell: flat faces do not run through points.
        let mut grid = Self { model, low: aabb.min - 0.93 * step, step, count, values: Vec::new() };
        let points = (0..count.iter().product()).map(|i| grid.point(grid.place(i)));
        grid.values = points.map(|x| model.solid.value(x)).collect();
        grid
    }

    fn place(&self, i: usize) -> [usize; 3] {
        let [x, y, _] = self.count;
        [i % x, i / x % y, i / (x * y)]
    }

    fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.count[0] * (j + self.count[1] * k)
    }

    fn point(&self, place: [usize; 3]) -> DVec3 {
        self.low + self.step * DVec3::from(place.map(|n| n as f64))
    }

    fn surface(&self) -> Surface {
        let mut vertex = vec![u32::MAX; self.values.len()];
        let mut surface = Surface::default();
        for (i, vertex) in vertex.iter_mut().enumerate() {
            if let Some(x) = self.vertex(self.place(i)) {
                *vertex = surface.points.len() as u32;
                surface.points.push(x);
            }
        }
        for i in 0..self.values.len() {
            let place = self.place(i);
            for axis in 0..3 {
                self.quad((place, axis), &vertex, &mut surface.indices);
            }
        }
        surface
    }

    /// The vertex of the cell whose lowest corner stands at a place.
    fn vertex(&self, place: [usize; 3]) -> Option<DVec3> {
        if (0..3).any(|k| place[k] + 1 >= self.count[k]) {
            return None;
        }
        let corner = |bits: usize| [place[0] + (bits & 1), place[1] + (bits >> 1 & 1), place[2] + (bits >> 2)];
        let (mut sum, mut crossings) = (DVec3::ZERO, 0);
        for from in 0..8usize {
            for to in [1, 2, 4].map(|bit| from | bit).into_iter().filter(|to| *to != from) {
                let [f, g] = [from, to].map(|bits| self.values[self.index(corner(bits))]);
                if (f < 0.0) != (g < 0.0) {
                    let part = (f / (f - g)).clamp(0.0, 1.0);
                    sum +=
                        self.point(corner(from)).lerp(self.point(corner(to)), if part.is_nan() { 0.5 } else { part });
                    crossings += 1;
                }
            }
        }
        (crossings > 0).then(|| self.pulled(sum / f64::from(crossings)))
    }

    /// A point pulled onto the surface, by less than a cell.
    fn pulled(&self, from: DVec3) -> DVec3 {
        let mut x = from;
        for _ in 0..3 {
            let f = self.model.solid.value(x);
            let slope = |axis: DVec3| {
                let h = axis * self.step * 1e-3;
                (self.model.solid.value(x + h) - self.model.solid.value(x - h)) / (2.0 * h.length())
            };
            let gradient = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
            let next = x - gradient * (f / gradient.length_squared());
            if !next.is_finite() || ((next - from).abs() - 0.75 * self.step).max_element() > 0.0 {
                break;
            }
            x = next;
        }
        x
    }

    /// The two triangles across an edge of the grid that the surface crosses.
    fn quad(&self, (place, axis): ([usize; 3], usize), vertex: &[u32], indices: &mut Vec<u32>) {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        if place[axis] + 1 >= self.count[axis] || place[u] == 0 || place[v] == 0 {
            return;
        }
        let mut end = place;
        end[axis] += 1;
        let [f, g] = [place, end].map(|p| self.values[self.index(p)]);
        if (f < 0.0) == (g < 0.0) {
            return;
        }
        let around = [(1, 1), (0, 1), (0, 0), (1, 0)].map(|(du, dv)| {
            let mut cell = place;
            (cell[u], cell[v]) = (cell[u] - du, cell[v] - dv);
            vertex[self.index(cell)]
        });
        if around.contains(&u32::MAX) {
            return;
        }
        // Outward is where f grows.
        let [a, b, c, d] = if f < 0.0 { around } else { [around[3], around[2], around[1], around[0]] };
        indices.extend([a, b, c, a, c, d]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{Facets, Limits, import_csg};

    fn of(text: &str) -> Surface {
        let solid = import_csg("t.csg", text, Facets::Auto, &Limits::default()).expect("a model").solid;
        surface(&Model::new(solid), 10.0)
    }

    /// Volume within: positive where all triangles look outward. Source: Gauss's theorem.
    fn volume(s: &Surface) -> f64 {
        let corner = |i: &u32| s.points[*i as usize];
        let cone = |t: &[u32]| corner(&t[0]).dot(corner(&t[1]).cross(corner(&t[2]))) / 6.0;
        s.indices.chunks(3).map(cone).sum()
    }

    #[test]
    fn surfaces_are_closed_look_outward_and_hold_about_the_volume() {
        let table = [
            ("sphere(r = 3);", 36.0 * std::f64::consts::PI),
            ("cube([10, 6, 1]);", 60.0),
            ("difference() { cube([8, 8, 3], center = true); cylinder(r = 2, h = 9, center = true); }", 192.0 - 37.7),
            (
                "polyhedron(points = [[0,0,0],[2,0,0],[0,2,0],[0,0,2]], faces = [[0,1,2],[0,3,1],[0,2,3],[1,3,2]]);",
                4.0 / 3.0,
            ),
        ];
        for (text, expected) in table {
            let s = of(text);
            assert!((volume(&s) / expected - 1.0).abs() < 0.05, "{text}: {} of {expected}", volume(&s));
            let mut edges = std::collections::HashMap::new();
            for t in s.indices.chunks(3) {
                for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                    *edges.entry((a, b)).or_insert(0) += 1;
                    *edges.entry((b, a)).or_insert(0) -= 1;
                }
            }
            assert!(edges.values().all(|n| *n == 0), "{text}: open");
        }
        assert!(of("cube([0, 0, 0]);").indices.is_empty());
    }
}
