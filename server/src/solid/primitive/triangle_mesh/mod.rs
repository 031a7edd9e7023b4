//! Solid within a closed mesh of triangles, convex or not.
//!
//! Its faces are the planes of its facets, neighbours in one plane being one face, then planes that bound nothing (`cells`). What it
//! is of them a formula tells (`local`), not their intersection.

use super::{Checked, Convex, Geometry, Shape, Sink, Source, read_vector, write_vector};
use crate::math::{Aabb, Ball, Moments, tolerance::ROUNDING};
use crate::solid::surface::Plane;
use crate::solid::{Face, formula::Formula};
use contactd_proto::Pose;
use glam::DVec3;

mod cells;
mod local;
mod moments;
mod piece;
mod planes;
mod polygons;
mod shell;
#[cfg(test)]
mod tests;

use cells::Cells;
use local::Expr;
use piece::{CUT, Corner, Piece};
pub use shell::{Repair, WELD};
use std::collections::HashMap;

/// Where points lie on a plane: this, relative to the size of a mesh and its coordinates.
const ON_PLANE: f64 = 1e-13;

/// Why a mesh is not the surface of a solid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshFault {
    /// No volume at all.
    #[error("a mesh without volume")]
    Flat,
    /// An edge at the rim of a hole.
    #[error("an open one: the edge from {0} to {1} belongs to one triangle only")]
    Open(DVec3, DVec3),
    /// Neighbours that disagree about what is outside.
    #[error("mixed orientation: not as many triangles run along the edge from {0} to {1} one way as the other")]
    Mixed(DVec3, DVec3),
    /// Facets that cross or lie on each other.
    #[error("one that crosses itself, lies on itself or is inside out near {0}")]
    Crossing(DVec3),
    /// More facets at a corner, or nearer to each other, than a formula is made for.
    #[error("one that is too intricate near {0}: too many facets in too little room")]
    Intricate(DVec3),
}

/// All points within a closed mesh of triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh {
    vertices: Vec<DVec3>,
    /// Counter-clockwise from outside.
    triangles: Vec<[u32; 3]>,
    /// Planes of faces, then planes that bound nothing.
    planes: Vec<(DVec3, f64)>,
    /// How many of them are faces.
    faces: usize,
    formula: Formula,
}

impl TriangleMesh {
    /// The solid within a mesh; `triangles` hold indices of `points`, counter-clockwise from outside.
    ///
    /// # Errors
    /// What is wrong with the mesh, and where.
    pub fn new(points: &[DVec3], triangles: &[[u32; 3]]) -> Result<(Self, Repair), MeshFault> {
        let (shell, repair) = shell::Shell::of(points, triangles)?;
        Ok((Self::of_shell(shell)?, repair))
    }

    /// The same of polygons, each a list of indices of points that runs counter-clockwise as seen from outside. Those that are not
    /// flat are folded where they are cut into triangles: `Repair::bent`.
    ///
    /// # Errors
    /// What is wrong with the mesh, and where.
    pub fn of_polygons(points: &[DVec3], faces: &[Vec<u32>]) -> Result<(Self, Repair), MeshFault> {
        let mut bent = 0.0_f64;
        let mut triangles = Vec::with_capacity(2 * faces.len());
        for face in faces {
            let corners: Vec<DVec3> = face.iter().map(|i| points[*i as usize]).collect();
            let (cut, off) = polygons::triangles(&corners);
            bent = bent.max(off);
            triangles.extend(cut.into_iter().map(|t| t.map(|i| face[i])));
        }
        let (mesh, repair) = Self::new(points, &triangles)?;
        let size = Aabb::of_points(mesh.vertices.iter().copied()).half().length();
        let bent = if bent > ROUNDING * size { bent } else { 0.0 };
        Ok((mesh, Repair { bent, ..repair }))
    }

    fn of_shell(shell: shell::Shell) -> Result<Self, MeshFault> {
        let shell::Shell { vertices, triangles } = shell;
        let around = Aabb::of_points(vertices.iter().copied());
        let tolerance = tolerance(&around);
        let (planes, face_of) = planes::of(&vertices, &triangles, tolerance);
        let (faces, pieces) = (planes.len(), pieces(&vertices, &triangles, &face_of));
        let (expr, planes) = Cells::formula(planes, pieces, around, tolerance)?;
        let Expr::Open(tokens) = expr else { return Err(MeshFault::Flat) };
        Ok(Self { vertices, triangles, planes, faces, formula: Formula::new(tokens) })
    }

    /// Its corners.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Its triangles as indices of its corners, counter-clockwise from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Number of faces that bound it; its further faces bound nothing.
    pub fn bounding_faces(&self) -> usize {
        self.faces
    }

    /// Its moments, and how far the volume may be off. A plane may lie a few tolerances off its corners.
    fn measured(&self) -> (Moments, f64) {
        let around = Aabb::of_points(self.vertices.iter().copied());
        moments::of(&self.vertices, &self.triangles, around.center(), 8.0 * tolerance(&around))
    }

    /// Value of its formula at a point, its frame.
    fn value(&self, x: DVec3) -> f64 {
        self.formula.value(&mut |f| {
            let (n, d) = self.planes[f as usize];
            n.dot(x) - d
        })
    }
}

/// How near a plane a point of a mesh in a box is on it, a length.
fn tolerance(around: &Aabb) -> f64 {
    let reach = around.min.abs().max(around.max.abs()).max_element();
    ON_PLANE * around.half().length() + 16.0 * f64::EPSILON * reach
}

/// The facets as pieces, with their edges by number. The three edges of a facet that is too thin to have a plane are one: its
/// neighbours meet along them.
fn pieces(vertices: &[DVec3], triangles: &[[u32; 3]], face_of: &[u32]) -> Vec<Piece> {
    let mut ids: HashMap<(u32, u32), u32> = HashMap::with_capacity(3 * triangles.len() / 2);
    let mut id = |a: u32, b: u32| {
        let next = ids.len() as u32;
        *ids.entry((a.min(b), a.max(b))).or_insert(next)
    };
    let edges: Vec<[u32; 3]> = triangles.iter().map(|t| [id(t[0], t[1]), id(t[1], t[2]), id(t[2], t[0])]).collect();
    let mut same: Vec<u32> = (0..ids.len() as u32).collect();
    fn find(same: &[u32], mut e: u32) -> u32 {
        while same[e as usize] != e {
            e = same[e as usize];
        }
        e
    }
    for (e, _) in edges.iter().zip(face_of).filter(|(_, f)| **f == planes::NONE) {
        let all = e.map(|e| find(&same, e));
        let least = all.into_iter().min().unwrap_or(CUT);
        all.iter().for_each(|e| same[*e as usize] = least);
    }
    let kept = (0..triangles.len()).filter(|i| face_of[*i] != planes::NONE);
    kept.map(|i| {
        let corner = |k: usize| Corner { at: vertices[triangles[i][k] as usize], edge: find(&same, edges[i][k]) };
        Piece { plane: face_of[i], corners: [corner(0), corner(1), corner(2)].into_iter().collect() }
    })
    .collect()
}

impl Geometry for TriangleMesh {
    fn faces(&self) -> Vec<Face> {
        self.planes.iter().map(|&(normal, offset)| Plane { normal, offset }.into()).collect()
    }
    fn formula(&self) -> Option<&Formula> {
        Some(&self.formula)
    }
    fn domain(&self) -> Option<Aabb> {
        Some(cells::domain(&Aabb::of_points(self.vertices.iter().copied())))
    }
    fn face_name(&self, index: usize) -> String {
        if index < self.faces { format!("face {index}") } else { format!("cut {}", index - self.faces) }
    }
    fn aabb(&self, frame: &Pose) -> Aabb {
        Aabb::of_points(self.vertices.iter().map(|v| frame.point(*v)))
    }
    fn ball(&self) -> Ball {
        Ball::of_points(&self.vertices)
    }
    fn smallest_dimension(&self) -> f64 {
        2.0 * Aabb::of_points(self.vertices.iter().copied()).half().min_element()
    }
    fn interior_point(&self) -> DVec3 {
        // Inwards from the middle of the largest facet, halving until it is inside.
        let corners = self.triangles.iter().map(|t| t.map(|v| self.vertices[v as usize]));
        let largest = corners.max_by(|[a, b, c], [p, q, r]| {
            planes::area(*a, *b, *c).length_squared().total_cmp(&planes::area(*p, *q, *r).length_squared())
        });
        let [p, q, r] = largest.unwrap_or_default();
        let (middle, inward) = ((p + q + r) / 3.0, -planes::area(p, q, r).normalize_or_zero());
        let size = Aabb::of_points(self.vertices.iter().copied()).half().length();
        let tries = (1..40).map(|k| middle + inward * (size * 0.5f64.powi(k)));
        tries.into_iter().find(|x| self.value(*x) < 0.0).unwrap_or(middle)
    }
    #[inline]
    fn convex(&self) -> Convex<'_> {
        Convex::Other
    }
    fn moments(&self) -> Option<Moments> {
        Some(self.measured().0)
    }
    fn moments_doubt(&self) -> f64 {
        self.measured().1
    }
    fn grown(&self, _: f64) -> Option<Shape> {
        None
    }
    fn kind(&self) -> &'static str {
        "mesh"
    }
    fn dimensions(&self) -> String {
        format!("{} triangles, {} faces", self.triangles.len(), self.faces)
    }
    fn write(&self, out: &mut dyn Sink) {
        out.word(self.vertices.len());
        out.word(self.triangles.len());
        self.vertices.iter().for_each(|v| write_vector(out, *v));
        self.triangles.iter().flatten().for_each(|i| out.word(*i as usize));
    }
    fn read(from: &mut dyn Source) -> Checked<Self> {
        let (corners, count) = (from.word()? as usize, from.word()? as usize);
        // As many numbers must follow, so the memory is no more than what the bytes take.
        if corners.saturating_mul(3) > from.left() {
            return Err("more numbers");
        }
        let vertices: Vec<DVec3> = (0..corners).map(|_| read_vector(from)).collect::<Checked<_>>()?;
        let mut corner =
            || from.word().and_then(|i| if (i as usize) < corners { Ok(i) } else { Err("a corner of the mesh") });
        let triangles: Vec<[u32; 3]> =
            (0..count).map(|_| Ok([corner()?, corner()?, corner()?])).collect::<Checked<_>>()?;
        // Checked as a file's: nothing is taken on trust. What was kept has nothing left to repair.
        let (mesh, _) = Self::new(&vertices, &triangles).map_err(|_| "a closed mesh")?;
        Ok(mesh)
    }
}
