//! Sphere: psi = |x − o| − r.

use super::roots::between_roots;
use super::{
    Analytic, Bend, Curvature, FaceAt, Law, NUMBERS, Quadric, SKEW, Section, Spine, Stretches, Surface, Symmetry,
    Terms, largest_corner,
};
use crate::math::any_perpendicular;
use glam::DVec3;

/// Ball around `center`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre o.
    pub center: DVec3,
    /// Radius r.
    pub radius: f64,
}

impl Surface for Sphere {
    #[inline]
    fn reach(&self) -> f64 {
        self.center.length() + self.radius
    }

    #[inline]
    fn magnitude(&self) -> f64 {
        self.center.abs().max_element() + self.radius
    }

    #[inline]
    fn value(&self, x: DVec3) -> f64 {
        (x - self.center).length() - self.radius
    }

    #[inline]
    fn at(&self, x: DVec3) -> FaceAt {
        let o = x - self.center;
        let rho = o.length();
        let normal = if rho > 0.0 { o / rho } else { DVec3::X };
        FaceAt { value: rho - self.radius, normal, slope: 1.0, k: 1.0, rho }
    }

    #[inline]
    fn curvature(&self, _: DVec3, at: &FaceAt) -> Curvature {
        let each = 1.0 / at.rho;
        Curvature { each, factor: -each, along: at.normal, ..Curvature::NONE }
    }

    /// Exact: the distance of box and centre − r, and the largest value of a corner.
    #[inline]
    fn span(&self, center: DVec3, half: DVec3) -> (f64, f64) {
        let gap = ((center - self.center).abs() - half).max(DVec3::ZERO);
        (gap.length() - self.radius, largest_corner(self, center, half))
    }

    #[inline]
    fn bend(&self, _: DVec3, at: &FaceAt) -> Bend {
        let t = any_perpendicular(at.normal);
        let tangents = [t, at.normal.cross(t)];
        let law = Law::Round { radius: self.radius };
        Bend { law, radial: (at.rho, at.normal), tangents, core: f64::INFINITY }
    }

    #[inline]
    fn moved(&self, point: impl Fn(DVec3) -> DVec3, _: impl Fn(DVec3) -> DVec3) -> Self {
        Self { center: point(self.center), radius: self.radius }
    }

    #[inline]
    fn symmetry(&self) -> Symmetry {
        Symmetry::Center(self.center)
    }

    fn spine(&self, _: &[DVec3]) -> Option<Spine> {
        Some(Spine { points: [self.center].into_iter().collect(), radius: self.radius })
    }

    #[inline]
    fn ball(&self) -> Option<(DVec3, f64)> {
        Some((self.center, self.radius))
    }

    #[inline]
    fn radius(&self) -> Option<f64> {
        Some(self.radius)
    }

    #[inline]
    fn quadric(&self, inset: f64) -> Option<Quadric> {
        Some(Quadric { origin: self.center, axis: None, radius: self.radius - inset, slope: 0.0 })
    }

    #[inline]
    fn section(&self, _: DVec3) -> Option<Section> {
        Some(Section { origin: self.center, axis: None, radius: self.radius })
    }

    #[inline]
    fn foot(&self, _: DVec3, normal: DVec3, _: f64) -> DVec3 {
        self.center + normal * self.radius
    }

    /// r_q − r_p − |Δ|.
    #[inline]
    fn above(&self, q: &Self, _: DVec3, _: f64) -> (f64, f64) {
        let (Self { center: o, radius: s }, Self { center: u, radius: t }) = (*self, *q);
        (t - s - (o - u).length(), o.length() + u.length() + s + t)
    }

    #[inline]
    fn deviation(&self, other: &Self, _: f64) -> f64 {
        (self.center - other.center).length() + (self.radius - other.radius).abs()
    }

    #[inline]
    fn key(&self, _: DVec3, _: f64) -> f64 {
        self.center.dot(SKEW) + self.radius
    }

    #[inline]
    fn numbers(&self) -> [f64; NUMBERS] {
        let o = self.center;
        [o.x, o.y, o.z, self.radius, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    }

    #[inline]
    fn analytic(&self) -> Option<Analytic> {
        Some(Analytic::Sphere(*self))
    }

    fn terms(&self) -> Option<Terms> {
        Some(Terms::around(self.center, &DVec3::AXES, DVec3::ZERO, self.radius))
    }

    fn inside(&self, origin: DVec3, direction: DVec3) -> Stretches {
        let o = origin - self.center;
        let found = between_roots(1.0, o.dot(direction), o.length_squared() - self.radius * self.radius);
        found.into_iter().collect()
    }
}
