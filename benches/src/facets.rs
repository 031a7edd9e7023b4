//! Convex decompositions and meshes of drilled solids for peers that know no holes: N wedges, or N facets, a circle.
//!
//! Every circle becomes the regular N-gon with its corners on the circle, as OpenSCAD and the usual CAD exporters write
//! it. A curved surface is then off by up to r(1 − cos π/N) ~ 5 r/N²: a hole is too narrow, a shaft too thin.

use contactd::octree::Model;
use glam::{DVec2, DVec3};
use parry3d_f64::math::{Pose, Vec3};
use parry3d_f64::shape::{SharedShape, TriMesh};
use std::collections::HashMap;
use std::f64::consts::TAU;

/// What a drilled prism is bounded by outside.
#[derive(Clone, Copy, Debug)]
pub enum Outline {
    /// A rectangle with these half extents.
    Rectangle(DVec2),
    /// A circle of this radius, as a polygon too.
    Circle(f64),
}

/// A prism along z with one hole along its axis.
#[derive(Clone, Copy, Debug)]
pub struct Drilled {
    /// Centre of the hole, of the outline and of the height.
    pub center: DVec3,
    /// The outer boundary.
    pub outline: Outline,
    /// Radius of the hole.
    pub hole: f64,
    /// Half the height.
    pub half_height: f64,
}

impl Drilled {
    /// Points of the hole's polygon and, on the same rays, of the outline; the outline's corners are added as rays, so
    /// that between two neighbouring rays both are straight.
    fn rays(&self, n: usize) -> Vec<(DVec2, DVec2)> {
        let mut angles: Vec<f64> = (0..n).map(|k| TAU * k as f64 / n as f64).collect();
        if let Outline::Rectangle(h) = self.outline {
            let corner = h.y.atan2(h.x);
            for c in [corner, TAU / 2.0 - corner, TAU / 2.0 + corner, TAU - corner] {
                if angles.iter().all(|a| (a - c).abs() > 1e-9) {
                    angles.push(c);
                }
            }
            angles.sort_by(f64::total_cmp);
        }
        let step = TAU / n as f64;
        let on = |angle: f64| {
            let u = DVec2::from_angle(angle);
            // The polygon's edge between the corners on either side of this ray.
            let within = angle - step * (angle / step + 1e-9).floor();
            let inner = self.hole * (step / 2.0).cos() / (within - step / 2.0).cos();
            let outer = match self.outline {
                Outline::Rectangle(h) => (h.x / u.x.abs()).min(h.y / u.y.abs()),
                Outline::Circle(r) => r,
            };
            (u * inner, u * outer)
        };
        angles.into_iter().map(on).collect()
    }

    fn lift(&self, p: DVec2, up: bool) -> Vec3 {
        let z = if up { self.half_height } else { -self.half_height };
        Vec3::new(self.center.x + p.x, self.center.y + p.y, self.center.z + z)
    }

    /// N convex wedges (and up to four more where the outline has a corner).
    pub fn wedges(&self, n: usize, into: &mut Vec<(Pose, SharedShape)>) {
        let rays = self.rays(n);
        for k in 0..rays.len() {
            let (a, b) = (rays[k], rays[(k + 1) % rays.len()]);
            let corners = [a.0, a.1, b.1, b.0].into_iter().flat_map(|p| [self.lift(p, false), self.lift(p, true)]);
            let wedge = SharedShape::convex_hull(&corners.collect::<Vec<_>>()).expect("a wedge has a volume");
            into.push((Pose::IDENTITY, wedge));
        }
    }

    /// Its surface: floor, ceiling, hole and outside. Several of them that abut leave walls between them, which lie
    /// within the union and are met by nothing before its surface is.
    pub fn surface(&self, n: usize, mesh: &mut Mesh) {
        let rays = self.rays(n);
        for k in 0..rays.len() {
            let (a, b) = (rays[k], rays[(k + 1) % rays.len()]);
            mesh.quad([self.lift(a.0, true), self.lift(a.1, true), self.lift(b.1, true), self.lift(b.0, true)]);
            mesh.quad([self.lift(b.0, false), self.lift(b.1, false), self.lift(a.1, false), self.lift(a.0, false)]);
            mesh.quad([self.lift(a.0, false), self.lift(a.0, true), self.lift(b.0, true), self.lift(b.0, false)]);
            mesh.quad([self.lift(b.1, false), self.lift(b.1, true), self.lift(a.1, true), self.lift(a.1, false)]);
        }
    }
}

/// A compound of the wedges of some drilled prisms.
pub fn compound(parts: &[Drilled], n: usize) -> SharedShape {
    let mut wedges = Vec::new();
    parts.iter().for_each(|p| p.wedges(n, &mut wedges));
    SharedShape::compound(wedges)
}

/// The mesh of some drilled prisms.
pub fn mesh(parts: &[Drilled], n: usize) -> SharedShape {
    let mut mesh = Mesh::default();
    parts.iter().for_each(|p| p.surface(n, &mut mesh));
    mesh.build()
}

/// A triangle mesh under construction.
#[derive(Default)]
pub struct Mesh {
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    fn quad(&mut self, corners: [Vec3; 4]) {
        let i = self.points.len() as u32;
        self.points.extend(corners);
        self.triangles.extend([[i, i + 1, i + 2], [i, i + 2, i + 3]]);
    }

    /// parry's mesh of it.
    pub fn build(self) -> SharedShape {
        SharedShape::new(TriMesh::new(self.points, self.triangles).expect("a mesh has triangles"))
    }
}

/// A solid of any tree, as what a mesher makes of its exact field: its surface as triangles, and the layer under its
/// surface as convex pieces. Tetrahedra of a grid of cells with edge `step` are cut where the field along their edges
/// vanishes; smooth faces are off by step²/(8r), sharp edges are cut off by up to a cell.
pub fn sampled(model: &Model, step: f64) -> (SharedShape, SharedShape) {
    let solid = &model.solid;
    let bounds = solid.aabb();
    // Off the round numbers that models are made of, so that no corner lies on a face.
    let origin = bounds.min - step * DVec3::new(0.513, 0.557, 0.531);
    let cells = ((bounds.max - origin) / step).ceil() + 1.0;
    let [nx, ny, nz] = [cells.x as usize + 1, cells.y as usize + 1, cells.z as usize + 1];
    let corner = |i: usize, j: usize, k: usize| origin + step * DVec3::new(i as f64, j as f64, k as f64);
    let index = |i: usize, j: usize, k: usize| (i * ny + j) * nz + k;
    let mut values = vec![0.0; nx * ny * nz];
    for i in 0..nx {
        for j in 0..ny {
            for k in 0..nz {
                values[index(i, j, k)] = solid.value(corner(i, j, k));
            }
        }
    }
    let mut mesh = Mesh::default();
    let mut pieces = Vec::new();
    let mut roots: HashMap<(usize, usize), (u32, Vec3)> = HashMap::new();
    // The six tetrahedra around a cell's diagonal fit those of its neighbours.
    const PATHS: [[usize; 4]; 6] = [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];
    for i in 0..nx - 1 {
        for j in 0..ny - 1 {
            for k in 0..nz - 1 {
                let at = |c: usize| (i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1));
                let id = |c: usize| index(at(c).0, at(c).1, at(c).2);
                let place = |c: usize| corner(at(c).0, at(c).1, at(c).2);
                let inside = |c: usize| values[id(c)] < 0.0;
                if (0..8).all(inside) || !(0..8).any(inside) {
                    continue;
                }
                for path in PATHS {
                    let (within, without): (Vec<usize>, Vec<usize>) = path.into_iter().partition(|c| inside(*c));
                    if within.is_empty() || without.is_empty() {
                        continue;
                    }
                    let mut root = |a: usize, b: usize| {
                        let key = (id(a).min(id(b)), id(a).max(id(b)));
                        *roots.entry(key).or_insert_with(|| {
                            let x = crossing(|x| solid.value(x), place(a), place(b));
                            mesh.points.push(crate::peer::vector(x));
                            (mesh.points.len() as u32 - 1, crate::peer::vector(x))
                        })
                    };
                    let cut: Vec<(u32, Vec3)> = match (within.as_slice(), without.as_slice()) {
                        (&[a, b], &[c, d]) => vec![root(a, c), root(a, d), root(b, d), root(b, c)],
                        (ins, outs) => {
                            ins.iter().flat_map(|a| outs.iter().map(|b| (*a, *b))).map(|(a, b)| root(a, b)).collect()
                        }
                    };
                    mesh.triangles.push([cut[0].0, cut[1].0, cut[2].0]);
                    if cut.len() == 4 {
                        mesh.triangles.push([cut[0].0, cut[2].0, cut[3].0]);
                    }
                    let mut hull: Vec<Vec3> = cut.iter().map(|c| c.1).collect();
                    hull.extend(within.iter().map(|c| crate::peer::vector(place(*c))));
                    // A sliver without a volume of its own adds nothing that its neighbours do not have.
                    pieces.extend(SharedShape::convex_hull(&hull).map(|s| (Pose::IDENTITY, s)));
                }
            }
        }
    }
    (SharedShape::compound(pieces), mesh.build())
}

/// Where the field vanishes between a point inside and one outside, by bisection.
fn crossing(f: impl Fn(DVec3) -> f64, mut inside: DVec3, mut outside: DVec3) -> DVec3 {
    for _ in 0..40 {
        let middle = 0.5 * (inside + outside);
        if f(middle) < 0.0 {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}
