//! Meshes that cross themselves, by what they wind around.
//!
//! Of a closed mesh of triangles every point beside it has a winding number: how often the mesh goes around it. What is kept is the
//! boundary of all points whose number is not 0, so that parts which overlap are their union, and a part that is inside out is a part
//! as the others are. All of it is decided in whole numbers, without a tolerance (Q. Zhou, E. Grinspun, D. Zorin, A. Jacobson, "Mesh
//! arrangements for solid geometry", ACM Transactions on Graphics 35(4), 2016):
//!
//! 1. `facets`: corners are put on a grid of 2⁵³ steps, and triangles that meet elsewhere than where they join are found;
//! 2. `pieces`: each of these is cut into convex parts along the planes of the others (`exact`);
//! 3. `joints`: corners that lie on the sides of others are put there, so that sides meet from end to end;
//! 4. `winding`: the winding numbers on both sides of what hangs together without a crossing, by a ray;
//! 5. `outcome`: parts between a number of 0 and another one are kept, those of a triangle joined again, rounded (`snap`) and cut into
//!    triangles (`ears`).
//!
//! What comes out is a mesh like any other one, and is checked like it.

mod boxes;
mod ears;
mod exact;
mod facets;
mod joints;
mod outcome;
mod pieces;
mod snap;
#[cfg(test)]
mod tests;
mod winding;

use crate::solid::primitive::{Closed, Crossed, MeshFault, Repair, TriangleMesh};
use facets::{DIGITS, Facets};
use glam::DVec3;
use pieces::Pieces;

/// Digits of the grid, and steps of it that are taken as none, tried one after the other until a mesh comes of it that does not cross
/// itself: what lies on each other but for roundings does so exactly on a coarser grid (2⁻⁴⁵ and 2⁻³⁸ of the largest coordinate).
const TRIES: [(i32, &[f64]); 3] = [(DIGITS, &[0.0, 8.0]), (45, &[0.0, 2.0]), (38, &[0.0, 2.0])];

/// The boundary of what a closed mesh of triangles winds around.
struct Resolved {
    facets: Facets,
    pieces: Pieces,
    /// By the numbers of the points of `pieces`.
    faces: Vec<Vec<u32>>,
}

impl Resolved {
    /// That of a mesh on a grid. `None` where no two triangles meet elsewhere than where they join, where more do than are looked at,
    /// and where nothing is left.
    fn of(vertices: &[DVec3], triangles: &[[u32; 3]], digits: i32) -> Option<Self> {
        let facets = Facets::of(vertices, triangles, digits)?;
        let pieces = Pieces::of(&facets)?;
        let faces = outcome::kept(&facets, &pieces)?;
        Some(Self { facets, pieces, faces })
    }

    /// The solid within. `None` where doubles cannot tell it.
    fn mesh(&self, steps: &[f64]) -> Option<TriangleMesh> {
        steps.iter().find_map(|reach| {
            let (points, faces) = outcome::rounded(&self.facets, &self.pieces, &self.faces, *reach);
            TriangleMesh::of_polygons(&points, faces.iter().map(Vec::as_slice)).ok().map(|made| made.0)
        })
    }
}

/// The solid that a closed mesh of triangles winds around, and what was done for it.
fn resolved(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Option<(TriangleMesh, Crossing)> {
    for (digits, steps) in TRIES {
        let resolved = Resolved::of(vertices, triangles, digits)?;
        if let Some(mesh) = resolved.mesh(steps) {
            let Pieces { pairs, cut, .. } = resolved.pieces;
            return Some((mesh, Crossing { pairs, cut }));
        }
    }
    None
}

/// How a mesh crossed itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Crossing {
    /// Pairs of its triangles that met elsewhere than where they join.
    pairs: usize,
    /// Triangles that were cut.
    cut: usize,
}

/// What was done to a mesh.
#[derive(Clone, Copy, Debug)]
pub struct Done {
    repair: Repair,
    crossing: Option<Crossing>,
}

impl Done {
    /// All of it, done to `what`, such as "a mesh": as sentences, and by how much where that is a length.
    pub fn notes(&self, what: &str) -> Vec<(String, Option<f64>)> {
        let crossing = self.crossing(what).map(|text| (text, None));
        self.repair.notes(what).into_iter().chain(crossing).collect()
    }

    /// What was done where it crossed itself, as a sentence.
    pub fn crossing(&self, what: &str) -> Option<String> {
        self.crossing.map(|Crossing { pairs, cut }| {
            let pairs = if pairs == 1 {
                "1 pair of its facets meets".into()
            } else {
                format!("{pairs} pairs of its facets meet")
            };
            format!("{what} that crosses itself ({pairs}, {cut} were cut): taken as what it winds around")
        })
    }
}

/// The solid within a closed mesh, what it winds around if it crosses itself; and what was done to it.
///
/// # Errors
/// What is wrong with the mesh, and where.
pub fn mesh(closed: Closed) -> Result<(TriangleMesh, Done), MeshFault> {
    let crossed = match TriangleMesh::of_closed_or(closed) {
        Ok((mesh, repair)) => return Ok((mesh, Done { repair, crossing: None })),
        Err(crossed) => crossed,
    };
    let Crossed { fault, vertices, triangles, repair } = *crossed;
    let made = match fault {
        MeshFault::Crossing(_) | MeshFault::Through { .. } | MeshFault::Intricate(_) => resolved(&vertices, &triangles),
        MeshFault::Flat | MeshFault::Open(..) | MeshFault::Mixed(..) => None,
    };
    let (mesh, crossing) = made.ok_or(fault)?;
    Ok((mesh, Done { repair, crossing: Some(crossing) }))
}
