//! Plane: psi = n·x − d.

use super::roots::half_line;
use super::{Analytic, Bend, Curvature, FaceAt, Law, NUMBERS, SKEW, Section, Stretches, Surface, Symmetry, Terms};
use contactd_proto::Pose;
use glam::DVec3;

/// Half-space n·x <= d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Outward unit normal n.
    pub normal: DVec3,
    /// Offset d along the normal.
    pub offset: f64,
}

impl Surface for Plane {
    #[inline]
    fn reach(&self) -> f64 {
        self.offset.abs()
    }

    #[inline]
    fn magnitude(&self) -> f64 {
        self.offset.abs()
    }

    #[inline]
    fn value(&self, x: DVec3) -> f64 {
        self.normal.dot(x) - self.offset
    }

    #[inline]
    fn at(&self, x: DVec3) -> FaceAt {
        FaceAt { value: self.normal.dot(x) - self.offset, normal: self.normal, slope: 1.0, k: 0.0, rho: f64::INFINITY }
    }

    #[inline]
    fn curvature(&self, _: DVec3, _: &FaceAt) -> Curvature {
        Curvature::NONE
    }

    /// Exact: v ± Σ e_k|n_k|.
    #[inline]
    fn span(&self, center: DVec3, half: DVec3) -> (f64, f64) {
        let (v, tilt) = (self.value(center), self.normal.abs().dot(half));
        (v - tilt, v + tilt)
    }

    #[inline]
    fn bend(&self, _: DVec3, _: &FaceAt) -> Bend {
        Bend {
            law: Law::Straight,
            radial: (f64::INFINITY, DVec3::ZERO),
            tangents: [DVec3::ZERO; 2],
            core: f64::INFINITY,
        }
    }

    #[inline]
    fn moved(&self, point: impl Fn(DVec3) -> DVec3, vector: impl Fn(DVec3) -> DVec3) -> Self {
        let normal = vector(self.normal).normalize();
        Self { normal, offset: normal.dot(point(self.normal * self.offset)) }
    }

    /// The offset grows by the way along the normal: no point of the plane is needed.
    #[inline]
    fn placed(&self, frame: &Pose) -> Self {
        let normal = frame.vector(self.normal).normalize();
        Self { normal, offset: self.offset + normal.dot(frame.position) }
    }

    #[inline]
    fn symmetry(&self) -> Symmetry {
        Symmetry::Normal(self.normal)
    }

    #[inline]
    fn flat(&self) -> Option<(DVec3, f64)> {
        Some((self.normal, self.offset))
    }

    #[inline]
    fn slides_along(&self, d: DVec3, tolerance: f64) -> bool {
        self.normal.dot(d).abs() < tolerance
    }

    #[inline]
    fn section(&self, _: DVec3) -> Option<Section> {
        None
    }

    #[inline]
    fn foot(&self, point: DVec3, _: DVec3, _: f64) -> DVec3 {
        point
    }

    /// psi_p(c) − psi_q(c) − |n_p − n_q| R.
    #[inline]
    fn above(&self, q: &Self, c: DVec3, r: f64) -> (f64, f64) {
        let (Self { normal: n, offset: d }, Self { normal: m, offset: e }) = (*self, *q);
        let lean = (n - m).length();
        let lean = if lean == 0.0 { 0.0 } else { lean * r };
        ((n - m).dot(c) - (d - e) - lean, d.abs() + e.abs())
    }

    /// By normal and offset, both taken at the origin.
    #[inline]
    fn deviation(&self, other: &Self, size: f64) -> f64 {
        (self.normal - other.normal).length() * size + (self.offset - other.offset).abs()
    }

    #[inline]
    fn key(&self, c: DVec3, r: f64) -> f64 {
        self.normal.dot(c) - self.offset + r * self.normal.dot(SKEW)
    }

    #[inline]
    fn numbers(&self) -> [f64; NUMBERS] {
        let n = self.normal;
        [n.x, n.y, n.z, self.offset, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    }

    fn terms(&self) -> Option<Terms> {
        Some(Terms::around(DVec3::ZERO, &[], -self.normal, self.offset))
    }

    #[inline]
    fn analytic(&self) -> Option<Analytic> {
        Some(Analytic::Plane(*self))
    }

    #[inline]
    fn inside(&self, origin: DVec3, direction: DVec3) -> Stretches {
        half_line(self.normal.dot(direction), self.normal.dot(origin) - self.offset).into_iter().collect()
    }
}
