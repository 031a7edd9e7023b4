//! Solids as meshes, for what no face can tell: the hull of what something has cut, sums of what is not convex, shadows, bounds.
//!
//! Primitives are taken in OpenSCAD's pieces, and set operations are those of Manifold (manifold-rust), which OpenSCAD uses, too. What
//! has flat faces alone is exact but for rounding; of anything else it is told how far the pieces lie off at most.

use super::convex::elements;
use super::element::Element;
use super::facets::ring;
use super::parts::{Part, PartId, Parts};
use super::place;
use super::{Place, Problem};
use crate::math::{Aabb, any_perpendicular, halt};
use crate::solid::primitive::{Geometry as _, MeshFault};
use crate::solid::{Op, Shape};
use contactd_proto::Pose;
use glam::{DAffine3, DVec2, DVec3};
use manifold_rust::linalg::Vec3;
use manifold_rust::manifold::Manifold;
use manifold_rust::types::{Error, MeshGL64, OpType};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// How far half-spaces reach, in sizes of what they cut.
const FAR: f64 = 4.0;
/// Pairs of triangles and corners of a sum that is not convex, beyond which it is refused.
const MOST_PAIRS: usize = 2_000_000;

/// A solid as a mesh.
pub struct Meshed {
    solid: Manifold,
    /// How far its pieces of curves lie off at most.
    pub off: f64,
}

impl Meshed {
    /// The mesh of a part.
    ///
    /// # Errors
    /// What has no bounds; a limit; a mesh that the operations do not take.
    pub fn of(parts: &Parts<'_>, at: Place, root: PartId) -> Result<Self> {
        let mut maker = Maker { parts, at, around: Aabb::EMPTY, off: 0.0 };
        maker.around = maker.bounds(root);
        if maker.around.is_empty() {
            return Ok(Self { solid: Manifold::empty(), off: 0.0 });
        }
        let solid = guarded(at, || maker.part(root))??;
        let off = maker.off;
        Self::checked(at, solid, off)
    }

    fn checked(at: Place, solid: Manifold, off: f64) -> Result<Self> {
        if solid.status() != Error::NoError {
            let found = format!("one that set operations on meshes do not take ({:?})", solid.status());
            return Err((at, Problem::syntax("a solid", found)));
        }
        Ok(Self { solid, off })
    }

    /// True for nothing at all.
    pub fn is_empty(&self) -> bool {
        self.solid.is_empty()
    }

    /// Its triangles.
    pub fn triangles(&self) -> usize {
        self.solid.num_tri()
    }

    /// What it is the hull of, where it is convex.
    pub fn convex(&self) -> Option<Vec<Element>> {
        self.solid.as_impl().is_convex().then(|| self.elements())
    }

    /// Its corners, of which its hull is the hull.
    pub fn elements(&self) -> Vec<Element> {
        self.corners().into_iter().map(Element::point).collect()
    }

    fn corners(&self) -> Vec<DVec3> {
        let mesh = self.solid.get_mesh_gl64(-1);
        (0..mesh.num_vert()).map(|i| DVec3::from_array(mesh.get_vert_pos(i))).collect()
    }

    /// A point of it; of a convex one well inside.
    fn inner(&self) -> DVec3 {
        let corners = self.corners();
        if self.solid.as_impl().is_convex() {
            return corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
        }
        corners.first().copied().unwrap_or_default()
    }

    /// Its box.
    pub fn bounds(&self) -> Aabb {
        Aabb::of_points(self.corners())
    }

    /// The sum with another one, about the origin that both were moved by.
    ///
    /// # Errors
    /// Too many pairs of facets; a mesh that the operations do not take.
    pub fn plus(&self, other: &Self, at: Place, origin: DVec3) -> Result<Self> {
        let flat = |m: &Self| m.solid.as_impl().is_convex();
        let pairs = match (flat(self), flat(other)) {
            (_, true) => self.triangles() * other.solid.num_vert(),
            (true, false) => other.triangles() * self.solid.num_vert(),
            (false, false) => 20 * self.triangles() * other.triangles(),
        };
        if pairs > MOST_PAIRS {
            return Err((at, Problem::Limit { what: "pairs of facets and corners of a sum", limit: MOST_PAIRS }));
        }
        // The union of what Manifold sums holds the operands, too, as if a point of each were the origin: so it is made to be.
        let (a, b) = (self.inner(), other.inner());
        let moved = |solid: &Manifold, by: DVec3| solid.translate(Vec3::new(by.x, by.y, by.z));
        let sum = guarded(at, || {
            let (left, right) = (moved(&self.solid, -a), moved(&other.solid, -b));
            let sum = left.minkowski_sum(&right);
            // Surfaces alone are summed where neither is convex: not the one all of which is within the other.
            let whole = if flat(self) || flat(other) { sum } else { sum.union(&left).union(&right) };
            moved(&whole, a + b - origin)
        })?;
        Self::checked(at, sum, self.off + other.off)
    }

    /// Its shadow on the plane z = 0, as closed paths.
    ///
    /// # Errors
    /// A mesh that the operation does not take.
    pub fn shadow(&self, at: Place) -> Result<Vec<Vec<DVec2>>> {
        let paths = guarded(at, || self.solid.project().to_polygons())?;
        Ok(paths.into_iter().map(|p| p.into_iter().map(|v| DVec2::new(v.x, v.y)).collect()).collect())
    }

    /// Where the plane z = 0 cuts it, as closed paths, faces in that plane with it, whichever side the solid is on.
    ///
    /// # Errors
    /// A mesh that the operation does not take.
    pub fn section(&self, at: Place) -> Result<Vec<Vec<DVec2>>> {
        let paths = guarded(at, || {
            let mesh = self.solid.get_mesh_gl64(-1);
            let in_plane = |t: &[u64]| t.iter().all(|v| mesh.get_vert_pos(*v as usize)[2] == 0.0);
            // A slice has what lies above the plane.
            let above = self.solid.slice(0.0);
            if mesh.tri_verts.chunks_exact(3).any(in_plane) {
                above.union(&self.solid.mirror(Vec3::new(0.0, 0.0, 1.0)).slice(0.0)).to_polygons()
            } else {
                above.to_polygons()
            }
        })?;
        Ok(paths.into_iter().map(|p| p.into_iter().map(|v| DVec2::new(v.x, v.y)).collect()).collect())
    }

    /// The solid again, as one primitive.
    ///
    /// # Errors
    /// More triangles than the limit says; a mesh that no formula tells.
    pub fn part(&self, parts: &mut Parts<'_>, at: Place, name: &str) -> Result<Part> {
        if self.is_empty() {
            return Ok(Part::Empty);
        }
        parts.meshable(at, self.triangles())?;
        let mesh = self.solid.get_mesh_gl64(-1);
        let points: Vec<DVec3> = (0..mesh.num_vert()).map(|i| DVec3::from_array(mesh.get_vert_pos(i))).collect();
        let clockwise = |t: &[u64]| vec![t[2] as u32, t[1] as u32, t[0] as u32];
        let faces: Vec<Vec<u32>> = mesh.tri_verts.chunks_exact(3).map(clockwise).collect();
        let placed = match place::wound(&DAffine3::IDENTITY, &points, &faces) {
            Err(Problem::Surface(MeshFault::Flat)) => return Ok(Part::Empty),
            placed => placed,
        };
        if let Some(text) = placed.as_ref().ok().and_then(|(_, done)| done.crossing(&format!("a {name}"))) {
            parts.note(at, text, None);
        }
        parts.leaf(name, at, placed.map(|p| p.0))
    }
}

/// What an operation on meshes answers; whatever it may fail by within, a model's text is read or refused. A load that is to end
/// ends.
///
/// # Errors
/// A sentence where it failed.
pub fn guarded<T>(at: Place, operation: impl FnOnce() -> T) -> Result<T> {
    halt::catch(operation).map_err(|ended| {
        if matches!(ended, halt::Ended::Cancelled) {
            halt::point();
        }
        (at, Problem::syntax("a solid", "one that set operations on meshes do not take"))
    })
}

/// A mesh in the making.
struct Maker<'p, 'l> {
    parts: &'p Parts<'l>,
    at: Place,
    /// The box of all that has bounds.
    around: Aabb,
    off: f64,
}

impl Maker<'_, '_> {
    fn bounds(&self, root: PartId) -> Aabb {
        let (mut all, mut stack) = (Aabb::EMPTY, vec![root]);
        while let Some(p) = stack.pop() {
            match &self.parts.list[p] {
                Part::Leaf(shape, frame, _) => {
                    let b = shape.geometry().aabb(frame);
                    if b.is_finite() {
                        all = all.union(&b);
                    }
                }
                Part::Op(_, _, of) => stack.extend(of),
                Part::Empty | Part::Flat(_) | Part::Stray(..) => {}
            }
        }
        all
    }

    fn part(&mut self, p: PartId) -> Result<Manifold> {
        if let Some(surface) = self.parts.prisms.get(&p) {
            let (corners, triangles) = surface();
            let prism = of_triangles(&corners, &triangles);
            // Where rings touch it is none.
            if prism.status() == Error::NoError {
                return Ok(prism);
            }
        }
        match &self.parts.list[p] {
            Part::Empty | Part::Flat(_) | Part::Stray(..) => Ok(Manifold::empty()),
            Part::Leaf(shape, frame, _) => {
                if let Some((corners, off)) = self.parts.bent.get(&p) {
                    self.off = self.off.max(*off);
                    return Ok(hull(corners));
                }
                let pieces = self.parts.pieces.get(&p).copied();
                self.leaf(shape, frame, pieces.unwrap_or(super::convex::PIECES))
            }
            Part::Op(op, _, of) => {
                let each = of.iter().map(|p| self.part(*p)).collect::<Result<Vec<_>>>()?;
                Ok(match (op, each.split_first()) {
                    (_, None) => Manifold::empty(),
                    (Op::Union, _) => Manifold::batch_boolean(&each, OpType::Add),
                    (Op::Intersection, _) if each.iter().any(Manifold::is_empty) => Manifold::empty(),
                    (Op::Intersection, _) => Manifold::batch_boolean(&each, OpType::Intersect),
                    (Op::Difference, Some((first, []))) => first.clone(),
                    (Op::Difference, Some((first, rest))) => {
                        first.difference(&Manifold::batch_boolean(rest, OpType::Add))
                    }
                })
            }
        }
    }

    fn leaf(&mut self, shape: &Shape, frame: &Pose, pieces: u32) -> Result<Manifold> {
        match shape {
            Shape::TriangleMesh(m) => {
                let corners: Vec<DVec3> = m.vertices().iter().map(|v| frame.point(*v)).collect();
                Ok(of_triangles(&corners, m.triangles()))
            }
            Shape::HalfSpace(_) => Ok(self.half_space(frame)),
            Shape::Torus(t) => {
                let turn = pieces.max(3);
                self.off = self.off.max((t.major + t.minor) * sagitta(turn) + t.minor * sagitta(turn));
                let (points, triangles) = torus(t.major, t.minor, turn);
                let points: Vec<DVec3> = points.into_iter().map(|p| frame.point(p)).collect();
                Ok(of_triangles(&points, &triangles))
            }
            Shape::Quadric(q) => {
                let hint =
                    " (hull, minkowski, projection and what else needs facets take no quadric that is cut by planes)";
                Err((self.at, Problem::Unsupported { construct: format!("facets of a {}", q.kind()), hint }))
            }
            Shape::Sphere(_)
            | Shape::Capsule(_)
            | Shape::Cylinder(_)
            | Shape::Cone(_)
            | Shape::Cuboid(_)
            | Shape::Polyhedron(_)
            | Shape::Ellipsoid(_)
            | Shape::EllipticFrustum(_)
            | Shape::Superellipsoid(_) => {
                let all = elements(shape, frame, pieces).unwrap_or_default();
                self.off = all.iter().map(Element::deviation).fold(self.off, f64::max);
                let points: Vec<DVec3> = all.iter().flat_map(Element::facets).collect();
                self.parts.meshable(self.at, 2 * points.len())?;
                Ok(hull(&points))
            }
        }
    }

    /// A box that reaches far beyond all else, its upper side in the plane.
    fn half_space(&self, frame: &Pose) -> Manifold {
        let n = frame.vector(DVec3::Z);
        let size = FAR * self.around.half().length().max(f64::MIN_POSITIVE);
        // Below the middle of all.
        let middle = self.around.center();
        let foot = middle - n * n.dot(middle - frame.position);
        let deep = size + (middle - frame.position).dot(n).abs();
        let x = any_perpendicular(n);
        let y = n.cross(x);
        let corner = |k: u32| {
            let s = |bit: u32| if k & bit == 0 { -size } else { size };
            let p = foot + x * s(1) + y * s(2) - n * if k & 4 == 0 { deep } else { 0.0 };
            Vec3::new(p.x, p.y, p.z)
        };
        Manifold::hull(&(0..8).map(corner).collect::<Vec<_>>())
    }
}

fn hull(points: &[DVec3]) -> Manifold {
    Manifold::hull(&points.iter().map(|p| Vec3::new(p.x, p.y, p.z)).collect::<Vec<_>>())
}

fn sagitta(pieces: u32) -> f64 {
    1.0 - libm::cos(std::f64::consts::PI / f64::from(pieces))
}

fn of_triangles(points: &[DVec3], triangles: &[[u32; 3]]) -> Manifold {
    let mesh = MeshGL64 {
        num_prop: 3,
        vert_properties: points.iter().flat_map(|p| p.to_array()).collect(),
        tri_verts: triangles.iter().flatten().map(|i| u64::from(*i)).collect(),
        ..MeshGL64::default()
    };
    Manifold::from_mesh_gl64(&mesh)
}

fn torus(major: f64, minor: f64, pieces: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let tube = ring(minor, pieces);
    let mut points = Vec::new();
    for x in ring(1.0, pieces) {
        points.extend(tube.iter().map(|p| (x * (major + p.x)).extend(p.y)));
    }
    let n = pieces;
    let at = |i: u32, k: u32| (i % n) * n + k % n;
    let mut triangles = Vec::new();
    for i in 0..n {
        for k in 0..n {
            let [a, b, c, d] = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    (points, triangles)
}
