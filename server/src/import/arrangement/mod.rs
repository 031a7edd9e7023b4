//! Meshes that cross themselves, or whose parts do not run round as those of a solid, by what they wind around.
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
mod soups;
#[cfg(test)]
mod tests;
mod winding;

use crate::math::Aabb;
use crate::solid::primitive::{Closed, Crossed, Geometry as _, MeshFault, Repair, TriangleMesh};
use facets::{DIGITS, Facets};
use glam::DVec3;
use outcome::Kept;
use pieces::Pieces;

/// Digits of the grid, and steps of it that are taken as none, tried one after the other until a mesh comes of it that does not cross
/// itself: what lies on each other but for roundings does so exactly on a coarser grid (2⁻⁴⁵, 2⁻³⁸ and 2⁻³⁰ of the largest
/// coordinate; files in single precision have 24 digits).
const TRIES: [(i32, &[f64]); 4] = [(DIGITS, &[0.0, 8.0]), (45, &[0.0, 2.0]), (38, &[0.0, 2.0]), (30, &[0.0, 2.0])];

/// The boundary of what a closed mesh of triangles winds around.
struct Resolved {
    facets: Facets,
    pieces: Pieces,
    /// By the numbers of the points of `pieces`.
    kept: Kept,
}

impl Resolved {
    /// That of a mesh on a grid. `None` where it is the mesh as it is, where more triangles meet than are looked at, and where nothing is
    /// left. On a coarse grid corners moved: a mesh of which nothing meets there is another one.
    #[cfg(test)]
    fn of(vertices: &[DVec3], triangles: &[[u32; 3]], digits: i32) -> Option<Self> {
        let (facets, pieces) = cut(vertices, triangles, digits)?;
        Self::kept(facets, pieces, digits)
    }

    /// That of a mesh that was cut.
    fn kept(facets: Facets, pieces: Pieces, digits: i32) -> Option<Self> {
        let kept = outcome::kept(&facets, &pieces)?;
        let is_other = digits < DIGITS || pieces.pairs + kept.turned + kept.left_out > 0;
        is_other.then_some(Self { facets, pieces, kept })
    }

    /// The solid within. `None` where doubles cannot tell it.
    fn mesh(&self, steps: &[f64]) -> Option<TriangleMesh> {
        steps.iter().find_map(|reach| {
            let (points, faces) = outcome::rounded(&self.facets, &self.pieces, &self.kept.faces, *reach);
            TriangleMesh::of_polygons(&points, faces.iter().map(Vec::as_slice)).ok().map(|made| made.0)
        })
    }
}

/// The triangles of a mesh on a grid, cut where they meet. `None` of one without size, and where more of them meet than are
/// looked at.
fn cut(vertices: &[DVec3], triangles: &[[u32; 3]], digits: i32) -> Option<(Facets, Pieces)> {
    let facets = Facets::of(vertices, triangles, digits)?;
    let pieces = Pieces::of(&facets)?;
    Some((facets, pieces))
}

/// The solid that a closed mesh of triangles winds around, and what was done for it.
fn resolved(vertices: &[DVec3], triangles: &[[u32; 3]], tries: &[(i32, &[f64])]) -> Option<(TriangleMesh, Crossing)> {
    for &(digits, steps) in tries {
        let (facets, pieces) = cut(vertices, triangles, digits)?;
        // What crosses in roundings alone is left as it is on the finest grid, and is another mesh on the next.
        let Some(resolved) = Resolved::kept(facets, pieces, digits) else { continue };
        if let Some(mesh) = resolved.mesh(steps) {
            let Resolved { pieces: Pieces { pairs, cut, .. }, kept: Kept { turned, others, left_out, .. }, .. } =
                resolved;
            return Some((mesh, Crossing { pairs, cut, turned, others, left_out }));
        }
    }
    None
}

/// How a mesh crossed itself, or ran round its parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Crossing {
    /// Pairs of its triangles that met elsewhere than where they join.
    pairs: usize,
    /// Triangles that were cut.
    cut: usize,
    /// Parts of triangles that were turned …
    turned: usize,
    /// … that were kept as they ran …
    others: usize,
    /// … and that have the same on both sides.
    left_out: usize,
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

    /// What was done where it crossed itself, or where its parts did not run round as those of a solid, as a sentence.
    pub fn crossing(&self, what: &str) -> Option<String> {
        self.crossing.map(|Crossing { pairs, cut, turned, left_out, .. }| {
            if pairs + turned + left_out == 0 {
                return format!(
                    "{what} of which facets nearly lie on each other: its corners were put on a grid on which none cross"
                );
            }
            // Where none was cut they do no more than touch.
            if cut == 0 && turned + left_out > 0 {
                return format!(
                    "{what} with parts inside out, or within others that run the same way ({turned} facets were turned, \
                     {left_out} left out): taken as what it winds around"
                );
            }
            let pairs = if pairs == 1 {
                "1 pair of its facets meets".into()
            } else {
                format!("{pairs} pairs of its facets meet")
            };
            format!("{what} that crosses itself ({pairs}, {cut} were cut): taken as what it winds around")
        })
    }
}

/// Volume of a solid that is no sheet, as a part of the cube of its size.
const THICK: f64 = 1e-9;

/// True for a solid that roundings cannot have made.
fn is_thick(mesh: &TriangleMesh) -> bool {
    let size = 2.0 * Aabb::of_points(mesh.vertices().iter().copied()).half().length();
    mesh.moments().is_some_and(|m| m.volume() > THICK * size * size * size)
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
    let Crossed { fault, vertices, triangles, mut repair } = *crossed;
    let made = match fault {
        MeshFault::Crossing(_) | MeshFault::Through { .. } | MeshFault::Intricate(_) => {
            resolved(&vertices, &triangles, &TRIES)
        }
        // What encloses as much one way round as the other; no sheet, and nothing that roundings have left: the coarsest grid makes
        // solids of sheets.
        MeshFault::Flat => resolved(&vertices, &triangles, &TRIES[..3]).filter(|(mesh, _)| is_thick(mesh)),
        MeshFault::Open(..) | MeshFault::Mixed(..) => None,
    };
    let (mesh, mut crossing) = made.ok_or(fault)?;
    if repair.flipped && crossing.turned > 0 {
        // Some of it ran as it should, some did not: told by what was turned in the end.
        repair.flipped = false;
        crossing.turned = crossing.others;
    }
    Ok((mesh, Done { repair, crossing: Some(crossing) }))
}
