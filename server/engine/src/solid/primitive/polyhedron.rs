//! Convex polyhedron: vertices, and the supporting planes of its faces.
//!
//! The tetrahedron, octahedron, dodecahedron and icosahedron of the paper are of this kind.

use super::{Checked, Convex, Geometry, Shape, Sink, Source, read_vector, write_vector};
use crate::math::{Aabb, Ball, Moments};
use crate::solid::Face;
use crate::solid::surface::Plane;
use contactd_proto::Pose;
use glam::DVec3;

mod clip;
mod corners;
mod mesh;

pub use corners::Corners;
pub use mesh::{Fit, MeshError};

/// A bounded convex polyhedron with an interior.
#[derive(Clone, Debug, PartialEq)]
pub struct Polyhedron {
    /// Corners, each on three planes or more.
    pub vertices: Corners,
    /// Outward unit normals and offsets n·x <= d, one per face, no two the same.
    pub planes: Vec<(DVec3, f64)>,
}

impl Polyhedron {
    /// The regular tetrahedron, octahedron, dodecahedron or icosahedron (`faces` 4, 8, 12, 20) or cube (6) with
    /// circumradius `radius` around the origin; `None` for any other count.
    pub fn platonic(faces: usize, radius: f64) -> Option<Self> {
        let phi = 0.5 * (1.0 + 5f64.sqrt());
        let signs = [-1.0, 1.0];
        let mut v = Vec::new();
        let cyclic = |v: &mut Vec<DVec3>, a: f64, b: f64| {
            for s in signs {
                for t in signs {
                    v.push(DVec3::new(0.0, s * a, t * b));
                    v.push(DVec3::new(s * a, t * b, 0.0));
                    v.push(DVec3::new(t * b, 0.0, s * a));
                }
            }
        };
        let cube = |v: &mut Vec<DVec3>| v.extend(Aabb::around(DVec3::ZERO, DVec3::ONE).corners());
        match faces {
            4 => v.extend([[1., 1., 1.], [1., -1., -1.], [-1., 1., -1.], [-1., -1., 1.]].map(DVec3::from_array)),
            6 => cube(&mut v),
            8 => v.extend([DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z]),
            12 => {
                cube(&mut v);
                cyclic(&mut v, 1.0 / phi, phi);
            }
            20 => cyclic(&mut v, 1.0, phi),
            _ => return None,
        }
        let v: Vec<DVec3> = v.into_iter().map(|p| p.normalize() * radius).collect();
        Self::hull(v)
    }

    /// Convex hull of some points by its supporting planes: every triple whose plane has all points on one side.
    /// For small sets of points (the cost grows with the fourth power). `None` when they span no volume.
    pub fn hull(points: Vec<DVec3>) -> Option<Self> {
        let size = Aabb::of_points(points.iter().copied()).half().length();
        let tol = 1e-12 * size;
        let center = points.iter().copied().sum::<DVec3>() / points.len().max(1) as f64;
        let mut planes: Vec<(DVec3, f64)> = Vec::new();
        for i in 0..points.len() {
            for j in i + 1..points.len() {
                for k in j + 1..points.len() {
                    let n = (points[j] - points[i]).cross(points[k] - points[i]);
                    let Some(mut n) = n.try_normalize() else { continue };
                    let mut d = n.dot(points[i]);
                    if n.dot(center) > d {
                        (n, d) = (-n, -d);
                    }
                    if points.iter().any(|p| n.dot(*p) > d + tol) || (d - n.dot(center)) <= tol {
                        continue;
                    }
                    if !planes.iter().any(|(m, e)| (*m - n).length() < 1e-9 && (e - d).abs() < 1e-9 * size) {
                        planes.push((n, d));
                    }
                }
            }
        }
        let vertices: Vec<DVec3> = points
            .into_iter()
            .filter(|p| planes.iter().filter(|(n, d)| (n.dot(*p) - d).abs() <= 1e-9 * size).count() >= 3)
            .collect();
        (planes.len() >= 4 && vertices.len() >= 4).then_some(Self { vertices: vertices.into(), planes })
    }
}

/// The mean of some corners.
pub(super) fn middle(vertices: &[DVec3]) -> DVec3 {
    vertices.iter().copied().sum::<DVec3>() / vertices.len() as f64
}

impl Geometry for Polyhedron {
    fn faces(&self) -> Vec<Face> {
        self.planes.iter().map(|&(normal, offset)| Plane { normal, offset }.into()).collect()
    }
    fn planes(&self) -> Option<&[(DVec3, f64)]> {
        Some(&self.planes)
    }
    fn face_name(&self, index: usize) -> String {
        format!("face {index}")
    }
    fn aabb(&self, frame: &Pose) -> Aabb {
        Aabb::of_points(self.vertices.iter().map(|v| frame.point(*v)))
    }
    fn ball(&self) -> Ball {
        Ball::of_points(&self.vertices)
    }
    fn smallest_dimension(&self) -> f64 {
        // Width across each face; the smallest width of a polytope is attained at a face or at a pair of edges, and
        // the latter is at least 1/sqrt(3) of the former's scale: good enough for a plausibility bound.
        self.planes
            .iter()
            .map(|(n, d)| self.vertices.iter().fold(0.0, |w: f64, v| w.max(d - n.dot(*v))))
            .fold(f64::INFINITY, f64::min)
    }
    fn interior_point(&self) -> DVec3 {
        middle(&self.vertices)
    }
    #[inline]
    fn convex(&self) -> Convex<'_> {
        Convex::Corners(&self.vertices)
    }
    fn moments(&self) -> Option<Moments> {
        None
    }
    fn grown(&self, _: f64) -> Option<Shape> {
        // Sharp edges reach out farther.
        None
    }
    fn kind(&self) -> &'static str {
        "polyhedron"
    }
    fn dimensions(&self) -> String {
        format!("{} faces", self.planes.len())
    }
    fn write(&self, out: &mut dyn Sink) {
        out.word(self.vertices.len());
        out.word(self.planes.len());
        self.vertices.iter().for_each(|v| write_vector(out, *v));
        for (n, d) in &self.planes {
            write_vector(out, *n);
            out.number(*d);
        }
    }
    fn read(from: &mut dyn Source) -> Checked<Self> {
        let (corners, faces) = (from.word()? as usize, from.word()? as usize);
        // As many numbers must follow, so the memory is no more than what the bytes take.
        if corners.saturating_mul(3).saturating_add(faces.saturating_mul(4)) > from.left() {
            return Err("more numbers");
        }
        let vertices = (0..corners).map(|_| read_vector(from)).collect::<Checked<_>>()?;
        let planes = (0..faces).map(|_| Ok((read_vector(from)?, from.finite()?))).collect::<Checked<_>>()?;
        Ok(Self { vertices: Vec::into(vertices), planes })
    }
}
