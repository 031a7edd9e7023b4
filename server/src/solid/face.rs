//! Faces: the convex, 1-Lipschitz functions psi whose common negative part is a primitive.
//!
//! | face | psi |
//! |---|---|
//! | plane | n·x − d |
//! | sphere | \|x − o\| − r |
//! | cylinder | ρ − r, ρ the distance from the axis |
//! | cone | ρ cos α − z sin α, z along the axis from the apex into the cone, α the half angle |
//!
//! The cone's function is exact in sign everywhere (the mirror nappe has z < 0, hence psi > 0); inside, −psi is the exact
//! distance to the lateral surface; outside it is the distance where ρ sin α + z cos α >= 0 and a lower bound elsewhere.
//!
//! On an axis the radial direction is undefined: closer than `ON_AXIS` any exact perpendicular stands in, elsewhere the
//! direction is re-orthogonalised against the axis. Where it stands in, the tangent plane lies above the face by up to the
//! distance from the axis, so `ON_AXIS` is rounding and no more.

use crate::math::{any_perpendicular, tolerance::ON_AXIS};
use contactd_proto::Pose;
use glam::DVec3;

/// One face of a primitive. Normals and axes are unit vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Face {
    /// Half-space n·x <= d.
    Plane {
        /// Outward unit normal n.
        normal: DVec3,
        /// Offset d along the normal.
        offset: f64,
    },
    /// Ball around `center`.
    Sphere {
        /// Centre o.
        center: DVec3,
        /// Radius r.
        radius: f64,
    },
    /// Infinite cylinder.
    Cylinder {
        /// A point of the axis.
        origin: DVec3,
        /// Unit axis.
        axis: DVec3,
        /// Radius r.
        radius: f64,
    },
    /// Infinite single-napped cone.
    Cone {
        /// Apex.
        apex: DVec3,
        /// Unit axis from the apex into the cone.
        axis: DVec3,
        /// sin α of the half angle.
        sin: f64,
        /// cos α of the half angle.
        cos: f64,
    },
}

/// A face at a point: psi, its gradient, and how it curves there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceAt {
    /// psi(x): signed distance-like value, length.
    pub value: f64,
    /// Gradient of psi, a unit vector.
    pub normal: DVec3,
    /// Curvature factor k: 0 plane, 1 sphere and cylinder, cos α cone.
    pub k: f64,
    /// Distance from the centre or axis (infinite for a plane, where k is 0).
    pub rho: f64,
}

/// Radial part of `x − origin` against `axis`: (distance from the axis, unit radial direction).
fn radial(offset: DVec3, axis: DVec3) -> (f64, DVec3) {
    let z = offset.dot(axis);
    let p = offset - axis * z;
    let rho = p.length();
    if rho <= ON_AXIS * offset.length() || rho == 0.0 {
        let u = any_perpendicular(axis);
        // Of its two signs the one towards the point: half as far off.
        return (rho, if u.dot(p) < 0.0 { -u } else { u });
    }
    let u = p / rho;
    let u = u - axis * u.dot(axis);
    (rho, u.normalize())
}

impl Face {
    /// Size of the numbers that psi is computed from, beside those of the point: |d|, |o| + r, |apex|. A length.
    pub fn reach(&self) -> f64 {
        match *self {
            Face::Plane { offset, .. } => offset.abs(),
            Face::Sphere { center: o, radius } | Face::Cylinder { origin: o, radius, .. } => o.length() + radius,
            Face::Cone { apex, .. } => apex.length(),
        }
    }

    /// psi at `x`.
    pub fn value(&self, x: DVec3) -> f64 {
        match *self {
            Face::Plane { normal, offset } => normal.dot(x) - offset,
            Face::Sphere { center, radius } => (x - center).length() - radius,
            Face::Cylinder { origin, axis, radius } => {
                let o = x - origin;
                (o - axis * o.dot(axis)).length() - radius
            }
            Face::Cone { apex, axis, sin, cos } => {
                let o = x - apex;
                let z = o.dot(axis);
                (o - axis * z).length() * cos - z * sin
            }
        }
    }

    /// psi at `x` with gradient and curvature.
    pub fn at(&self, x: DVec3) -> FaceAt {
        match *self {
            Face::Plane { normal, offset } => {
                FaceAt { value: normal.dot(x) - offset, normal, k: 0.0, rho: f64::INFINITY }
            }
            Face::Sphere { center, radius } => {
                let o = x - center;
                let rho = o.length();
                let normal = if rho > 0.0 { o / rho } else { DVec3::X };
                FaceAt { value: rho - radius, normal, k: 1.0, rho }
            }
            Face::Cylinder { origin, axis, radius } => {
                let (rho, u) = radial(x - origin, axis);
                FaceAt { value: rho - radius, normal: u, k: 1.0, rho }
            }
            Face::Cone { apex, axis, sin, cos } => {
                let o = x - apex;
                let (rho, u) = radial(o, axis);
                FaceAt { value: rho * cos - o.dot(axis) * sin, normal: u * cos - axis * sin, k: cos, rho }
            }
        }
    }

    /// The same face seen from the parent of `frame`.
    pub fn placed(&self, frame: &Pose) -> Self {
        match *self {
            Face::Plane { normal, offset } => {
                let normal = frame.vector(normal).normalize();
                Face::Plane { normal, offset: offset + normal.dot(frame.position) }
            }
            Face::Sphere { center, radius } => Face::Sphere { center: frame.point(center), radius },
            Face::Cylinder { origin, axis, radius } => {
                Face::Cylinder { origin: frame.point(origin), axis: frame.vector(axis).normalize(), radius }
            }
            Face::Cone { apex, axis, sin, cos } => {
                Face::Cone { apex: frame.point(apex), axis: frame.vector(axis).normalize(), sin, cos }
            }
        }
    }
}
