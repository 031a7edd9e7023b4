//! Cylinder: psi = ρ − r, ρ the distance from the axis.

use super::roots::between_roots;
use super::{
    Analytic, Axis, Bend, Curvature, FaceAt, Law, NUMBERS, Quadric, Row, SKEW, Section, Spine, Stretches, Surface,
    Symmetry, Terms, around, heights, largest_corner, radial, tangent,
};
use glam::DVec3;

/// Infinite cylinder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// A point of the axis.
    pub origin: DVec3,
    /// Unit axis.
    pub axis: DVec3,
    /// Radius r.
    pub radius: f64,
}

impl Surface for Cylinder {
    #[inline]
    fn reach(&self) -> f64 {
        self.origin.length() + self.radius
    }

    #[inline]
    fn magnitude(&self) -> f64 {
        self.origin.abs().max_element() + self.radius
    }

    #[inline]
    fn value(&self, x: DVec3) -> f64 {
        let o = x - self.origin;
        (o - self.axis * o.dot(self.axis)).length() - self.radius
    }

    #[inline]
    fn at(&self, x: DVec3) -> FaceAt {
        let (rho, u) = radial(x - self.origin, self.axis);
        FaceAt { value: rho - self.radius, normal: u, slope: 1.0, k: 1.0, rho }
    }

    #[inline]
    fn curvature(&self, _: DVec3, at: &FaceAt) -> Curvature {
        around(self.axis, at)
    }

    /// Below, the larger of the tangent and the axis (ρ >= 0); above, the largest value of a corner, exact.
    #[inline]
    fn span(&self, center: DVec3, half: DVec3) -> (f64, f64) {
        (tangent(self, center, half).max(-self.radius), largest_corner(self, center, half))
    }

    #[inline]
    fn bend(&self, _: DVec3, at: &FaceAt) -> Bend {
        let tangents = [self.axis.cross(at.normal), DVec3::ZERO];
        let law = Law::Round { radius: self.radius };
        Bend { law, radial: (at.rho, at.normal), tangents, core: f64::INFINITY }
    }

    #[inline]
    fn moved(&self, point: impl Fn(DVec3) -> DVec3, vector: impl Fn(DVec3) -> DVec3) -> Self {
        Self { origin: point(self.origin), axis: vector(self.axis).normalize(), radius: self.radius }
    }

    #[inline]
    fn symmetry(&self) -> Symmetry {
        Symmetry::Axis(Axis { origin: self.origin, direction: self.axis })
    }

    #[inline]
    fn radius(&self) -> Option<f64> {
        Some(self.radius)
    }

    #[inline]
    fn developable(&self) -> Option<DVec3> {
        Some(self.axis)
    }

    fn spine(&self, hull: &[DVec3]) -> Option<Spine> {
        let (lo, hi) = heights(hull, self.origin, self.axis);
        let points = [lo, hi].map(|z| self.origin + self.axis * z);
        Some(Spine { points: points.into_iter().collect(), radius: self.radius })
    }

    #[inline]
    fn slides_along(&self, d: DVec3, tolerance: f64) -> bool {
        d.cross(self.axis).length() < tolerance
    }

    #[inline]
    fn quadric(&self, inset: f64) -> Option<Quadric> {
        Some(Quadric { origin: self.origin, axis: Some(self.axis), radius: self.radius - inset, slope: 0.0 })
    }

    #[inline]
    fn section(&self, _: DVec3) -> Option<Section> {
        Some(Section { origin: self.origin, axis: Some(self.axis), radius: self.radius })
    }

    #[inline]
    fn foot(&self, point: DVec3, normal: DVec3, _: f64) -> DVec3 {
        self.origin + self.axis * (point - self.origin).dot(self.axis) + normal * self.radius
    }

    /// r_q − r_p − |Δ| − |a_p − a_q| R, Δ between the points of the axes next to c, a_q turned so that it points the way
    /// of a_p.
    #[inline]
    fn above(&self, q: &Self, c: DVec3, r: f64) -> (f64, f64) {
        let (Self { origin: o, axis: a, radius: s }, Self { origin: u, axis: b, radius: t }) = (*self, *q);
        let b = if a.dot(b) < 0.0 { -b } else { b };
        let (o, u) = (o + a * (c - o).dot(a), u + b * (c - u).dot(b));
        let lean = (a - b).length();
        let lean = if lean == 0.0 { 0.0 } else { lean * r };
        (t - s - (o - u).length() - lean, o.length() + u.length() + s + t + 2.0 * c.length())
    }

    #[inline]
    fn deviation(&self, other: &Self, size: f64) -> f64 {
        let lean = self.axis.cross(other.axis).length() * size;
        lean + (self.origin - other.origin).cross(self.axis).length() + (self.radius - other.radius).abs()
    }

    #[inline]
    fn key(&self, c: DVec3, r: f64) -> f64 {
        let foot = self.origin + self.axis * (c - self.origin).dot(self.axis);
        foot.dot(SKEW) + self.radius + 0.5 * r * self.axis.dot(SKEW) * self.axis.dot(SKEW)
    }

    #[inline]
    fn numbers(&self) -> [f64; NUMBERS] {
        let (o, a) = (self.origin, self.axis);
        [o.x, o.y, o.z, a.x, a.y, a.z, self.radius, 0.0, 0.0, 0.0, 0.0]
    }

    #[inline]
    fn analytic(&self) -> Option<Analytic> {
        Some(Analytic::Cylinder(*self))
    }

    fn terms(&self) -> Option<Terms> {
        let (across, _) = Row::of_axis(self.origin, self.axis);
        Some(Terms::around(self.origin, &across.map(|row| row.slope), DVec3::ZERO, self.radius))
    }

    fn inside(&self, origin: DVec3, d: DVec3) -> Stretches {
        self.stretch(origin, d).into_iter().collect()
    }
}

impl Cylinder {
    fn stretch(&self, origin: DVec3, d: DVec3) -> Option<(f64, f64)> {
        let (o, axis) = (origin - self.origin, self.axis);
        let (p, e) = (o - axis * o.dot(axis), d - axis * d.dot(axis));
        let c = p.length_squared() - self.radius * self.radius;
        if e.length_squared() < 1e-24 {
            return (c <= 0.0).then_some((f64::NEG_INFINITY, f64::INFINITY));
        }
        between_roots(e.length_squared(), p.dot(e), c)
    }
}
