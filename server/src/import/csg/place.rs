//! Primitives under affine transforms: which shape they become and where it stands.
//!
//! Similarities (rotation, mirror, uniform scale) keep every kind. A transform that scales along a primitive's own axes
//! keeps a box a box, a superellipsoid one, and a cylinder a cylinder when it scales its cross-section evenly. Any other regular transform
//! keeps polyhedra (a sheared box becomes one) and half-spaces, makes an ellipsoid of a sphere and a frustum over an ellipse of a
//! cylinder or cone, and is refused by name on a torus and a superellipsoid.
//!
//! Files print six digits: a linear part within `SIMILARITY` of scale × orthogonal is replaced by that product
//! (`snapped`), with the orthogonal polar factor from Newton's iteration Q ← (Q + Q⁻ᵀ)/2 (Higham 1986).

use super::Problem;
use crate::import::arrangement::{self, Done};
use crate::import::mesh::Polygons;
use crate::math::tolerance::{ROUNDING, SAME_RADIUS, SIMILARITY};
use crate::solid::primitive::{
    Capsule, Closed, Cone, Cuboid, Cylinder, Ellipsoid, EllipticFrustum, Fit, Geometry as _, HalfSpace, MeshFault,
    Polyhedron, Repair, Shape, Sphere, Superellipsoid, Torus, TriangleMesh,
};
use crate::solid::surface::elliptic::squared;
use contactd_proto::Pose;
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};

/// A shape, its frame in the model, and what had to be snapped for it.
pub struct PlacedShape {
    /// The shape in its own frame.
    pub shape: Shape,
    /// That frame in the model.
    pub frame: Pose,
    /// x of the frame runs against the x that the source means.
    pub mirrored: bool,
    /// What was snapped, as sentences, and by how much.
    pub notes: Vec<(String, Option<f64>)>,
}

impl PlacedShape {
    fn new(shape: impl Into<Shape>, frame: Pose) -> Self {
        Self { shape: shape.into(), frame, mirrored: false, notes: Vec::new() }
    }

    /// Tells that the transform was not quite what the shape needs: `off` of its scale.
    fn off(mut self, off: f64, kind: &str) -> Self {
        if off > ROUNDING {
            let text = format!("a transform that would bend a {kind} a little: taken as one that does not");
            self.notes.push((text, Some(off)));
        }
        self
    }
}

/// scale × orthogonal, the latter with determinant ±1.
struct Similarity {
    scale: f64,
    orthogonal: DMat3,
    /// Largest difference from the matrix it stands for, relative to the scale.
    off: f64,
}

/// The similarity nearest to a regular matrix.
fn similarity(m: DMat3) -> Option<Similarity> {
    let size = m.to_cols_array().iter().fold(0.0, |s: f64, x| s.max(x.abs()));
    if !(size > 0.0 && size.is_finite()) {
        return None;
    }
    let mut q = m * (1.0 / size);
    if q.determinant().abs() < 1e-9 {
        return None;
    }
    // Quadratic convergence; a matrix far from orthogonal needs some halvings first.
    for _ in 0..40 {
        let next = (q + q.inverse().transpose()) * 0.5;
        let change = (next - q).to_cols_array().iter().fold(0.0, |s: f64, x| s.max(x.abs()));
        q = next;
        if change <= f64::EPSILON {
            break;
        }
    }
    let product = q.transpose() * m;
    let scale = (product.x_axis.x + product.y_axis.y + product.z_axis.z) / 3.0;
    let off = (m - q * scale).to_cols_array().iter().fold(0.0, |s: f64, x| s.max(x.abs())) / scale;
    Some(Similarity { scale, orthogonal: q, off })
}

/// True when `m` cannot be inverted to any accuracy.
pub fn is_flat(m: DMat3) -> bool {
    let product = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    let volume = m.determinant().abs();
    volume.is_nan() || volume <= ROUNDING * product
}

/// The linear part to use for `m`, and how far it was moved when that is more than rounding. A rough matrix whose scale
/// is within `SIMILARITY` of 1 was a plain rotation.
pub fn snapped(m: DMat3) -> (DMat3, Option<f64>) {
    match similarity(m) {
        Some(s) if s.off > ROUNDING && s.off <= SIMILARITY => {
            let scale = if (s.scale - 1.0).abs() <= SIMILARITY { 1.0 } else { s.scale };
            (s.orthogonal * scale, Some(s.off.max((s.scale - scale).abs())))
        }
        _ => (m, None),
    }
}

/// A ball of radius `radius` around the origin.
pub fn sphere(a: &DAffine3, radius: f64) -> Result<PlacedShape, Problem> {
    let Some(s) = similarity(a.matrix3).filter(|s| s.off <= SIMILARITY) else {
        return Ok(ellipsoid(a, radius));
    };
    Ok(PlacedShape::new(Sphere { radius: radius * s.scale }, Pose::at(a.translation)).off(s.off, "sphere"))
}

/// All points within a radius of the way between two points.
pub fn capsule(from: DVec3, to: DVec3, radius: f64) -> PlacedShape {
    let way = to - from;
    // Either way along it is the same; on this one the turn from z is a quarter at most, and right to the last digits.
    let d = if way.z < 0.0 { -way } else { way }.normalize();
    let turn = DQuat::from_xyzw(-d.y, d.x, 0.0, 1.0 + d.z).normalize();
    PlacedShape::new(Capsule { half: 0.5 * way.length(), radius }, Pose::new(0.5 * (from + to), turn))
}

/// The image of a ball around the origin: semi-axes are the matrix' singular values, by turns in the planes of two columns until all are
/// square to each other (M. Hestenes, Inversion of matrices by biorthogonalization, 1958).
fn ellipsoid(a: &DAffine3, radius: f64) -> PlacedShape {
    let mut c = [a.matrix3.x_axis, a.matrix3.y_axis, a.matrix3.z_axis];
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            [c[p], c[q]] = squared([c[p], c[q]]);
        }
    }
    let semi = DVec3::from_array(c.map(DVec3::length)) * radius;
    let [x, y, z] = c.map(DVec3::normalize);
    let rotation = proper(DMat3::from_cols(x, y, if x.cross(y).dot(z) < 0.0 { -z } else { z })).0;
    let mut placed = PlacedShape::new(Ellipsoid { semi }, Pose::new(a.translation, rotation));
    placed.notes.push((format!("{} on a sphere: an ellipsoid, exact", bending(a.matrix3)), None));
    placed
}

/// The image of a cylinder, cone or frustum: upright where the ends' planes stay square to the axis.
fn elliptic_frustum(a: &DAffine3, center: DVec3, bottom: f64, top: f64, height: f64) -> PlacedShape {
    let m = a.matrix3;
    // The ends' normal, towards the top.
    let normal = m.x_axis.cross(m.y_axis).normalize();
    let normal = if normal.dot(m.z_axis) < 0.0 { -normal } else { normal };
    let [u, v] = squared([m.x_axis, m.y_axis]);
    let x = (u - normal * u.dot(normal)).normalize();
    let y = normal.cross(x);
    let up = m.z_axis.dot(normal);
    let aside = DVec2::new(m.z_axis.dot(x), m.z_axis.dot(y));
    let upright = aside.length() <= ROUNDING * up;
    let larger = bottom.max(top);
    let alike = (bottom - top).abs() <= SAME_RADIUS * larger;
    let shape = EllipticFrustum {
        semi: DVec2::new(u.length(), v.length()) * larger,
        bottom: if alike { 1.0 } else { bottom / larger },
        top: if alike { 1.0 } else { top / larger },
        half_height: 0.5 * height * up,
        lean: if upright { DVec2::ZERO } else { aside / up },
    };
    let kind = if alike { "cylinder" } else { "cone" };
    let text = format!(
        "{} on a {kind}: {} {}, exact",
        bending(m),
        if shape.kind().starts_with('e') || shape.kind().starts_with('o') { "an" } else { "a" },
        shape.kind()
    );
    let frame = Pose::new(a.transform_point3(center), proper(DMat3::from_cols(x, y, normal)).0);
    let mut placed = PlacedShape::new(shape, frame);
    placed.notes.push((text, None));
    placed
}

/// All points within `minor` of a circle of radius `major` about z, around the origin.
pub fn torus(a: &DAffine3, major: f64, minor: f64) -> Result<PlacedShape, Problem> {
    let s = similarity(a.matrix3).filter(|s| s.off <= SIMILARITY).ok_or_else(|| refusal(a.matrix3, "torus"))?;
    let frame = Pose::new(a.translation, proper(s.orthogonal).0);
    Ok(PlacedShape::new(Torus { major: major * s.scale, minor: minor * s.scale }, frame).off(s.off, "torus"))
}

/// A superellipsoid around the origin, with semi-axes along x, y and z.
pub fn superellipsoid(a: &DAffine3, semi: DVec3, exponents: DVec2) -> Result<PlacedShape, Problem> {
    let (lengths, turn, off) = along_axes(a.matrix3).ok_or_else(|| refusal(a.matrix3, "superellipsoid"))?;
    let shape = Superellipsoid { semi: semi * lengths, exponents };
    Ok(PlacedShape::new(shape, Pose::new(a.translation, turn)).off(off, "superellipsoid"))
}

/// A cylinder, cone or frustum around `center`, along z, with radii `bottom` (low z) and `top`.
pub fn cylinder(a: &DAffine3, center: DVec3, bottom: f64, top: f64, height: f64) -> Result<PlacedShape, Problem> {
    let kind = if bottom == top { "cylinder" } else { "cone" };
    let uneven = |l: &DVec3| (l.x - l.y).abs() / l.x;
    let Some((lengths, rotation, off)) = along_axes(a.matrix3).filter(|(l, ..)| uneven(l) <= SIMILARITY) else {
        return Ok(elliptic_frustum(a, center, bottom, top, height));
    };
    let off = off.max(uneven(&lengths));
    // Even in x and y within rounding: their mean; the half sum is exact when they are equal.
    let across = 0.5 * (lengths.x + lengths.y);
    let half_height = 0.5 * height * lengths.z;
    let frame = Pose::new(a.transform_point3(center), rotation);
    let larger = bottom.max(top);
    if (bottom - top).abs() <= SAME_RADIUS * larger {
        let mut placed = PlacedShape::new(Cylinder { radius: larger * across, half_height }, frame);
        if bottom != top {
            placed.notes.push(("radii that differ by less than 1e-9 of themselves: taken as a cylinder".into(), None));
        }
        return Ok(placed.off(off, kind));
    }
    Ok(PlacedShape::new(Cone { bottom: bottom * across, top: top * across, half_height }, frame).off(off, kind))
}

/// A box around `center` with half extents `half`.
pub fn cuboid(a: &DAffine3, center: DVec3, half: DVec3) -> Result<PlacedShape, Problem> {
    if let Some((lengths, frame, off)) = along_axes(a.matrix3) {
        let frame = Pose::new(a.transform_point3(center), frame);
        let mirrored = a.matrix3.determinant() < 0.0;
        let placed = PlacedShape { mirrored, ..PlacedShape::new(Cuboid { half: half * lengths }, frame) };
        return Ok(placed.off(off, "box"));
    }
    // Corner i has the signs of i's bits; faces clockwise from outside.
    let corners: Vec<DVec3> = (0..8)
        .map(|i| {
            let s = |bit: u32| if i & bit == 0 { -1.0 } else { 1.0 };
            center + half * DVec3::new(s(1), s(2), s(4))
        })
        .collect();
    let faces = [[5, 7, 3, 1], [2, 6, 4, 0], [3, 7, 6, 2], [4, 5, 1, 0], [6, 7, 5, 4], [1, 3, 2, 0]];
    let mut placed = polyhedron(a, &corners, &faces.map(|f| f.to_vec()))?.0;
    placed.notes.push(("a sheared box: taken as a polyhedron".into(), None));
    Ok(placed)
}

/// The polyhedron of a mesh, faces clockwise from outside; the frame follows similarities, other transforms are applied
/// to the points.
pub fn polyhedron(a: &DAffine3, points: &[DVec3], faces: &[Vec<u32>]) -> Result<(PlacedShape, Fit), Problem> {
    let (points, frame, off): (Vec<DVec3>, Pose, f64) = match similarity(a.matrix3) {
        Some(s) if s.off <= SIMILARITY => {
            let (rotation, mirrored) = proper(s.orthogonal);
            let flip = DVec3::new(if mirrored { -s.scale } else { s.scale }, s.scale, s.scale);
            (points.iter().map(|p| *p * flip).collect(), Pose::new(a.translation, rotation), s.off)
        }
        _ => (points.iter().map(|p| a.matrix3 * *p).collect(), Pose::at(a.translation), 0.0),
    };
    let (shape, fit) = if a.matrix3.determinant() < 0.0 {
        let reversed: Vec<Vec<u32>> = faces.iter().map(|f| f.iter().rev().copied().collect()).collect();
        Polyhedron::from_faces(&points, &reversed)?
    } else {
        Polyhedron::from_faces(&points, faces)?
    };
    Ok((PlacedShape::new(shape, frame).off(off, "polyhedron"), fit))
}

/// The solid within a mesh, faces clockwise from outside, its corners where the transform puts them.
pub fn mesh(a: &DAffine3, points: &[DVec3], faces: &[Vec<u32>]) -> Result<(PlacedShape, Repair), Problem> {
    let (shape, repair) = TriangleMesh::of_closed(closed(a, points, faces)?)?;
    Ok((PlacedShape::new(shape, Pose::IDENTITY), repair))
}

/// The same of a mesh that may cross itself: what it winds around, and what was done to it.
pub fn wound(a: &DAffine3, points: &[DVec3], faces: &[Vec<u32>]) -> Result<(PlacedShape, Done), Problem> {
    let (shape, done) = match arrangement::mesh(closed(a, points, faces)?) {
        Ok(made) => made,
        Err(fault) => where_it_stands(a, || closed(&DAffine3::IDENTITY, points, faces)).ok_or(fault)?,
    };
    Ok((PlacedShape::new(shape, Pose::IDENTITY), done))
}

/// What a mesh winds around whose corners' roundings cross once they are moved: that of the mesh where it stands, moved. `None` where
/// that has no solid either.
fn where_it_stands(a: &DAffine3, closed: impl FnOnce() -> Result<Closed, MeshFault>) -> Option<(TriangleMesh, Done)> {
    if *a == DAffine3::IDENTITY {
        return None;
    }
    let (own, done) = arrangement::mesh(closed().ok()?).ok()?;
    let points: Vec<DVec3> = own.vertices().iter().map(|p| a.transform_point3(*p)).collect();
    let mirrored = a.matrix3.determinant() < 0.0;
    let turned = |&[p, q, r]: &[u32; 3]| if mirrored { [p, r, q] } else { [p, q, r] };
    let triangles: Vec<[u32; 3]> = own.triangles().iter().map(turned).collect();
    let moved = TriangleMesh::closed(&points, triangles.iter().map(|t| &t[..])).ok()?;
    // Roundings alone cross there: what was done is what was done before.
    let (shape, _) = arrangement::mesh(moved).ok()?;
    Some((shape, done))
}

/// The closed surface of faces clockwise from outside, its corners where the transform puts them.
fn closed(a: &DAffine3, points: &[DVec3], faces: &[Vec<u32>]) -> Result<Closed, MeshFault> {
    let points: Vec<DVec3> = points.iter().map(|p| a.transform_point3(*p)).collect();
    let mirrored = a.matrix3.determinant() < 0.0;
    let turned = |f: &Vec<u32>| if mirrored { f.clone() } else { f.iter().rev().copied().collect() };
    TriangleMesh::closed(&points, faces.iter().map(turned).collect::<Vec<_>>().iter().map(Vec::as_slice))
}

/// Triangles up to which a mesh whose roundings cross is tried once more.
const AGAIN: usize = 200_000;

/// What polygons wind around that run counter-clockwise as seen from outside, their corners where the transform puts them; and what
/// was done to them.
pub fn polygons(a: &DAffine3, polygons: Polygons) -> Result<(PlacedShape, Done), Problem> {
    // Of many triangles they take as much as all the rest.
    let again = (polygons.triangles() <= AGAIN).then(|| polygons.clone());
    let closed = {
        let placed = polygons.placed(a);
        TriangleMesh::closed(&placed.points, placed.faces())?
    };
    let (shape, done) = match arrangement::mesh(closed) {
        Ok(made) => made,
        Err(fault) => {
            again.and_then(|own| where_it_stands(a, || TriangleMesh::closed(&own.points, own.faces()))).ok_or(fault)?
        }
    };
    Ok((PlacedShape::new(shape, Pose::IDENTITY), done))
}

/// The half-space n·x <= d.
pub fn half_space(a: &DAffine3, n: DVec3, d: f64) -> PlacedShape {
    let normal = (a.matrix3.inverse().transpose() * n).normalize();
    let point = a.transform_point3(n * (d / n.length_squared()));
    PlacedShape::new(HalfSpace, Pose::new(point, DQuat::from_rotation_arc(DVec3::Z, normal)))
}

/// The half-space with an outward normal (of any length) through a point.
pub fn half_space_at(a: &DAffine3, n: DVec3, point: DVec3) -> PlacedShape {
    let normal = (a.matrix3.inverse().transpose() * n).normalize();
    PlacedShape::new(HalfSpace, Pose::new(a.transform_point3(point), DQuat::from_rotation_arc(DVec3::Z, normal)))
}

/// How many times longer `m` makes a vector, at most: by sums of rows of m·mᵀ and of mᵀ·m, exact where axes stay square to each other.
pub fn stretch(m: DMat3) -> f64 {
    let bound = |s: DMat3| (0..3).map(|k| s.row(k).abs().element_sum()).fold(0.0, f64::max).sqrt();
    bound(m * m.transpose()).min(bound(m.transpose() * m))
}

/// Why a curved primitive cannot follow `m`.
fn refusal(m: DMat3, kind: &str) -> Problem {
    Problem::unsupported(format!("{} on a {kind}", bending(m)))
}

/// What `m` does beside turning and scaling.
fn bending(m: DMat3) -> &'static str {
    if columns_are_perpendicular(m) { "non-uniform scale" } else { "shear" }
}

fn columns_are_perpendicular(m: DMat3) -> bool {
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    let across = |a: DVec3, b: DVec3| a.dot(b).abs() <= SIMILARITY * a.length() * b.length();
    across(x, y) && across(x, z) && across(y, z)
}

/// `m` as scaling along x, y, z, then a rotation (a mirror goes into x, of which boxes and cylinders notice no more than the
/// names of two faces: `PlacedShape::mirrored`), and how far its axes are off a right angle.
fn along_axes(m: DMat3) -> Option<(DVec3, DQuat, f64)> {
    if !columns_are_perpendicular(m) {
        return None;
    }
    let lengths = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
    let s = similarity(DMat3::from_cols(m.x_axis / lengths.x, m.y_axis / lengths.y, m.z_axis / lengths.z))?;
    Some((lengths, proper(s.orthogonal).0, s.off))
}

/// The rotation of an orthogonal matrix, after a mirror in x if it has one.
fn proper(orthogonal: DMat3) -> (DQuat, bool) {
    let mirrored = orthogonal.determinant() < 0.0;
    let m =
        if mirrored { DMat3::from_cols(-orthogonal.x_axis, orthogonal.y_axis, orthogonal.z_axis) } else { orthogonal };
    (DQuat::from_mat3(&m).normalize(), mirrored)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two cubes, one in a corner of the other, as one mesh: what is resolved where it stands and moved is what is moved and resolved.
    #[test]
    fn a_mesh_that_crosses_itself_is_the_same_moved_before_and_after() {
        let corner = |i: u32, at: f64| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) + at;
        let points: Vec<DVec3> = (0..16).map(|i| corner(i % 8, if i < 8 { 0.0 } else { 0.5 })).collect();
        let faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
        let faces: Vec<Vec<u32>> = [0, 8].iter().flat_map(|k| faces.map(|f| f.map(|i| i + k).to_vec())).collect();
        let turned = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.3, -0.4, 1.1)));
        for linear in [turned, DMat3::from_diagonal(DVec3::new(-1.0, 2.0, 1.0)) * turned] {
            let a = DAffine3::from_mat3_translation(linear, DVec3::new(3.0, 0.1, -7.0));
            let (own, _) = where_it_stands(&a, || closed(&DAffine3::IDENTITY, &points, &faces)).expect("a solid");
            let (moved, _) = wound(&a, &points, &faces).unwrap_or_else(|_| panic!("a solid"));
            let volume = own.moments().expect("bounded").volume();
            let Shape::TriangleMesh(moved) = &moved.shape else { panic!("a mesh") };
            assert!((volume - moved.moments().expect("bounded").volume()).abs() < 1e-12);
            assert!((volume - 1.875 * linear.determinant().abs()).abs() < 1e-12, "{volume}");
        }
    }
}
