//! Solid within a closed mesh of triangles, convex or not.
//!
//! Its faces are the planes of its facets, neighbours in one plane being one face, then planes that bound nothing (`cells`). What it
//! is of them a formula tells (`local`), not their intersection: written out for few facets (`cells`), a tree whose parts are
//! written out when they are looked at for many (`division`).

use super::{Checked, Convex, Facets, Geometry, Shape, Sink, Source, read_vector, write_vector};
use crate::math::{Aabb, Ball, Moments, tolerance::ROUNDING};
use crate::solid::faces::Planes;
use crate::solid::surface::{Plane, Surface as _};
use crate::solid::{Face, formula::Formula};
use contactd_proto::Pose;
use glam::DVec3;

mod apart;
mod cells;
mod division;
mod edges;
mod growth;
mod local;
mod moments;
mod outward;
mod piece;
mod planes;
mod polygons;
mod shell;
mod side;
mod surface;
#[cfg(test)]
mod tests;
mod tree;

use cells::Cells;
use division::Divided;
use local::Expr;
pub use shell::{Repair, WELD};
use std::sync::{Arc, OnceLock};
use surface::Surface;
pub use tree::{Below, FacetTree};

/// Triangles up to which the formula of a mesh is written out when it is made.
const FEW_TRIANGLES: usize = 1000;

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
    /// Two facets that meet elsewhere than where they join: near which place, and the corners of both.
    #[error("one that crosses itself near {near}, where {} meets {} (part them, or make it a union of closed parts)",
        named(&facets[0]), named(&facets[1]))]
    Through {
        /// A place near to where they do.
        near: DVec3,
        /// Both, counter-clockwise from outside.
        facets: Box<[[DVec3; 3]; 2]>,
    },
    /// More facets at a corner, or nearer to each other, than a formula is made for.
    #[error("one that is too intricate near {0}: too many facets in too little room")]
    Intricate(DVec3),
}

/// A facet in words.
fn named([a, b, c]: &[DVec3; 3]) -> String {
    format!("the triangle {a}, {b}, {c}")
}

/// A closed surface of which a mesh is to be made, and what was repaired in it.
pub struct Closed {
    shell: shell::Shell,
    repair: Repair,
}

/// Closed triangles that are not the surface of a solid.
#[derive(Debug)]
pub struct Crossed {
    /// Why not.
    pub fault: MeshFault,
    /// Their corners.
    pub vertices: Vec<DVec3>,
    /// The triangles, every edge run along as often one way as the other.
    pub triangles: Vec<[u32; 3]>,
    /// What was repaired in them.
    pub repair: Repair,
}

/// Why triangles are not the surface of a solid, their corners, and the triangles.
type Unfit = (MeshFault, Vec<DVec3>, Vec<[u32; 3]>);

/// All points within a closed mesh of triangles.
#[derive(Clone, Debug)]
pub struct TriangleMesh {
    surface: Arc<Surface>,
    /// Planes that bound nothing, behind those of the surface's faces; of a divided one they are the division's.
    cuts: Vec<(DVec3, f64)>,
    formula: Formula,
    division: Option<Arc<Divided>>,
}

/// All else follows from the triangles.
impl PartialEq for TriangleMesh {
    fn eq(&self, other: &Self) -> bool {
        (self.vertices(), self.triangles()) == (other.vertices(), other.triangles())
    }
}

impl TriangleMesh {
    /// The solid within a mesh; `triangles` hold indices of `points`, counter-clockwise from outside.
    ///
    /// # Errors
    /// What is wrong with the mesh, and where.
    pub fn new(points: &[DVec3], triangles: &[[u32; 3]]) -> Result<(Self, Repair), MeshFault> {
        Self::divided_from(FEW_TRIANGLES, points, triangles)
    }

    /// The same with a formula that is divided beyond `few` triangles: for comparison, all that is inside is the same.
    ///
    /// # Errors
    /// What is wrong with the mesh, and where.
    pub fn divided_from(few: usize, points: &[DVec3], triangles: &[[u32; 3]]) -> Result<(Self, Repair), MeshFault> {
        let (shell, repair) = shell::Shell::of(points, triangles)?;
        Ok((Self::of_shell(shell, few).map_err(|unfit| unfit.0)?, repair))
    }

    /// The same of polygons, each a list of indices of points that runs counter-clockwise as seen from outside. Those that are not
    /// flat are folded where they are cut into triangles: `Repair::bent`.
    ///
    /// # Errors
    /// What is wrong with the mesh, and where.
    pub fn of_polygons<'f>(
        points: &[DVec3],
        faces: impl IntoIterator<Item = &'f [u32]>,
    ) -> Result<(Self, Repair), MeshFault> {
        Self::of_closed(Self::closed(points, faces)?)
    }

    /// The first half of `of_polygons`, which looks at all of them: beyond it they are not needed.
    ///
    /// # Errors
    /// Where they are not closed.
    pub fn closed<'f>(points: &[DVec3], faces: impl IntoIterator<Item = &'f [u32]>) -> Result<Closed, MeshFault> {
        let mut bent = 0.0_f64;
        let faces = faces.into_iter();
        let mut triangles = Vec::with_capacity(faces.size_hint().0);
        for face in faces {
            if let [a, b, c] = *face {
                triangles.push([a, b, c]);
                continue;
            }
            let corners: Vec<DVec3> = face.iter().map(|i| points[*i as usize]).collect();
            let (cut, off) = polygons::triangles(&corners);
            bent = bent.max(off);
            triangles.extend(cut.into_iter().map(|t| t.map(|i| face[i])));
        }
        let (shell, repair) = shell::Shell::of(points, &triangles)?;
        let size = Aabb::of_points(shell.vertices.iter().copied()).half().length();
        let bent = if bent > ROUNDING * size { bent } else { 0.0 };
        Ok(Closed { shell, repair: Repair { bent, ..repair } })
    }

    /// Its second half.
    ///
    /// # Errors
    /// What is wrong with the mesh, and where.
    pub fn of_closed(closed: Closed) -> Result<(Self, Repair), MeshFault> {
        Self::of_closed_or(closed).map_err(|crossed| crossed.fault)
    }

    /// The same, with the triangles back where they are not the surface of a solid.
    ///
    /// # Errors
    /// What is wrong with the mesh, and its triangles.
    pub fn of_closed_or(closed: Closed) -> Result<(Self, Repair), Box<Crossed>> {
        let Closed { shell, repair } = closed;
        match Self::of_shell(shell, FEW_TRIANGLES) {
            Ok(mesh) => Ok((mesh, repair)),
            Err((fault, vertices, triangles)) => Err(Box::new(Crossed { fault, vertices, triangles, repair })),
        }
    }

    fn of_shell(shell: shell::Shell, few: usize) -> Result<Self, Unfit> {
        let shell::Shell { vertices, triangles, edges, is_flat } = shell;
        if is_flat {
            return Err((MeshFault::Flat, vertices, triangles));
        }
        let around = Aabb::of_points(vertices.iter().copied());
        let tolerance = tolerance(&around);
        let opposite = edges.opposite(&triangles);
        let crowded = edges.crowded();
        drop(edges);
        let (mut planes, face_of) = planes::of(&vertices, &triangles, &opposite, tolerance);
        planes.shrink_to_fit();
        let mut surface = Surface { vertices, triangles, planes, face_of, around, tolerance, tree: OnceLock::new() };
        let count = surface.triangles.len();
        // A third of what the neighbours take, which nothing else asks for.
        let leaders = edges::leaders(&opposite, &surface.triangles, &crowded);
        drop(opposite);
        if count > few {
            let surface = Arc::new(surface);
            let division = match Divided::new(surface.clone(), &leaders) {
                Ok(division) => Arc::new(division),
                Err(fault) => {
                    let (vertices, triangles) = match Arc::try_unwrap(surface) {
                        Ok(surface) => (surface.vertices, surface.triangles),
                        Err(shared) => (shared.vertices.clone(), shared.triangles.clone()),
                    };
                    return Err((fault, vertices, triangles));
                }
            };
            let formula = Formula::Divided(division.clone());
            return Ok(Self {
                surface: division.surface().clone(),
                cuts: Vec::new(),
                formula,
                division: Some(division),
            });
        }
        let pieces = surface.pieces(0..count as u32);
        let faces = surface.planes.len();
        let formula = Cells::formula(std::mem::take(&mut surface.planes), pieces, around, tolerance);
        // Of few facets the pair is looked for where their formula has told that something is wrong.
        let named = |fault| match fault {
            MeshFault::Crossing(_) | MeshFault::Intricate(_) => apart::first_through(&surface).unwrap_or(fault),
            MeshFault::Flat | MeshFault::Open(..) | MeshFault::Mixed(..) | MeshFault::Through { .. } => fault,
        };
        let (expr, mut planes) = match formula.map_err(named) {
            Ok(formula) => formula,
            Err(fault) => return Err((fault, surface.vertices, surface.triangles)),
        };
        let Expr::Open(tokens) = expr else {
            return Err((MeshFault::Flat, surface.vertices, surface.triangles));
        };
        // The formula of a cell that a part alone reaches knows nothing of what is around that part.
        let whole = apart::clearly_through(&surface).map_or_else(|| outward::are_outward(&surface, &leaders), Err);
        if let Err(fault) = whole {
            return Err((fault, surface.vertices, surface.triangles));
        }
        let cuts = planes.split_off(faces);
        surface.planes = planes;
        Ok(Self { surface: Arc::new(surface), cuts, formula: Formula::new(tokens), division: None })
    }

    /// Its corners.
    pub fn vertices(&self) -> &[DVec3] {
        &self.surface.vertices
    }

    /// Its triangles as indices of its corners, counter-clockwise from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.surface.triangles
    }

    /// Number of faces that bound it; its further faces bound nothing.
    pub fn bounding_faces(&self) -> usize {
        self.surface.planes.len()
    }

    /// Its moments, and how far the volume may be off. A plane may lie a few tolerances off its corners.
    fn measured(&self) -> (Moments, f64) {
        let s = &*self.surface;
        let middle = s.around.center();
        let (moments, doubt) = moments::of(&s.vertices, &s.triangles, middle, 8.0 * s.tolerance);
        (moments.moved(middle), doubt)
    }

    /// Moments about `middle` of what a closed surface of signed triangles encloses, and a bound of the volume's error where corners
    /// are known to `off` (a length); times the extents it bounds that of the others. Triangles may lie on each other: their
    /// volumes with `middle`, positive where they run counter-clockwise from outside, are summed.
    pub fn moments_within(vertices: &[DVec3], triangles: &[[u32; 3]], middle: DVec3, off: f64) -> (Moments, f64) {
        moments::of(vertices, triangles, middle, off)
    }

    /// Plane of a face.
    fn plane(&self, face: usize) -> Plane {
        if let Some(division) = &self.division {
            return division.plane(face);
        }
        let faces = self.bounding_faces();
        let (normal, offset) = if face < faces { self.surface.planes[face] } else { self.cuts[face - faces] };
        Plane { normal, offset }
    }

    /// Value of its formula at a point, its frame.
    fn value(&self, x: DVec3) -> f64 {
        self.formula.value(&mut |f| self.plane(f as usize).value(x))
    }
}

/// How near a plane a point of a mesh in a box is on it, a length.
fn tolerance(around: &Aabb) -> f64 {
    let reach = around.min.abs().max(around.max.abs()).max_element();
    ON_PLANE * around.half().length() + 16.0 * f64::EPSILON * reach
}

impl Geometry for TriangleMesh {
    fn faces(&self) -> Vec<Face> {
        let count = self.division.as_ref().map_or(self.bounding_faces() + self.cuts.len(), |d| d.count());
        (0..count).map(|face| self.plane(face).into()).collect()
    }
    fn face_count(&self) -> usize {
        // The planes of a division take what a number takes.
        self.bounding_faces() + self.cuts.len()
    }
    fn many_faces(&self) -> Option<Arc<dyn Planes>> {
        self.division.clone().map(|d| d as Arc<dyn Planes>)
    }
    fn formula(&self) -> Option<&Formula> {
        Some(&self.formula)
    }
    fn domain(&self) -> Option<Aabb> {
        Some(cells::domain(&self.surface.around))
    }
    fn facets(&self) -> Option<Facets<'_>> {
        let surface = &*self.surface;
        Some(Facets { vertices: &surface.vertices, triangles: &surface.triangles, faces: &surface.face_of })
    }
    fn facet_tree(&self) -> Option<&FacetTree> {
        let surface = &*self.surface;
        let made = || FacetTree::of(&surface.vertices, &surface.triangles, &surface.around);
        surface.tree.get_or_init(made).as_ref()
    }
    fn facet_tolerance(&self) -> f64 {
        8.0 * self.surface.tolerance
    }
    fn face_name(&self, index: usize) -> String {
        let faces = self.bounding_faces();
        if index < faces { format!("face {index}") } else { format!("cut {}", index - faces) }
    }
    fn aabb(&self, frame: &Pose) -> Aabb {
        Aabb::of_points(self.vertices().iter().map(|v| frame.point(*v)))
    }
    fn ball(&self) -> Ball {
        Ball::of_points(self.vertices())
    }
    fn smallest_dimension(&self) -> f64 {
        2.0 * self.surface.around.half().min_element()
    }
    fn interior_point(&self) -> DVec3 {
        // Inwards from the middle of the largest facet, halving until it is inside.
        let corners = self.triangles().iter().map(|t| t.map(|v| self.vertices()[v as usize]));
        let largest = corners.max_by(|[a, b, c], [p, q, r]| {
            planes::area(*a, *b, *c).length_squared().total_cmp(&planes::area(*p, *q, *r).length_squared())
        });
        let [p, q, r] = largest.unwrap_or_default();
        let (middle, inward) = ((p + q + r) / 3.0, -planes::area(p, q, r).normalize_or_zero());
        let size = self.surface.around.half().length();
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
        format!("{} triangles, {} faces", self.triangles().len(), self.bounding_faces())
    }
    fn write(&self, out: &mut dyn Sink) {
        out.word(self.vertices().len());
        out.word(self.triangles().len());
        self.vertices().iter().for_each(|v| write_vector(out, *v));
        self.triangles().iter().flatten().for_each(|i| out.word(*i as usize));
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
