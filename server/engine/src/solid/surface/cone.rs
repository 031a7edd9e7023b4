//! Cone: psi = ρ cos α − z sin α, z along the axis from the apex into the cone, α the half angle.
//!
//! The function is exact in sign everywhere (the mirror nappe has z < 0, hence psi > 0); inside, −psi is the exact
//! distance to the lateral surface; outside it is the distance where ρ sin α + z cos α >= 0 and a lower bound elsewhere.

use super::roots::between_roots_of_nappe;
use super::{
    Analytic, Axis, Bend, Curvature, FaceAt, Law, NUMBERS, Quadric, Row, SKEW, Section, Stretches, Surface, Symmetry,
    Terms, around, largest_corner, radial, tangent,
};
use crate::math::any_perpendicular;
use glam::DVec3;

/// Infinite single-napped cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Apex.
    pub apex: DVec3,
    /// Unit axis from the apex into the cone.
    pub axis: DVec3,
    /// sin α of the half angle.
    pub sin: f64,
    /// cos α of the half angle.
    pub cos: f64,
}

/// A cone by its apex: all of the face is that cone, psi = |B(x − apex)| − sin α axis·(x − apex), B = cos α (I − axis axisᵀ) of a circular one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apex {
    /// The apex itself; the face's own frame.
    pub point: DVec3,
    /// Unit axis from the apex into the cone. The normals there are those within the right angle less α of −axis.
    pub axis: DVec3,
    /// sin α of the half angle.
    pub sin: f64,
    /// cos α of the half angle.
    pub cos: f64,
    /// B's rows, of one that is not circular.
    pub rows: Option<[DVec3; 2]>,
}

impl Apex {
    /// True for a vector that is a normal there, to within `slack` (a sine): one that leads down no ray of the cone. `down` is its
    /// part against the axis; it has the length 1, or of one that is not circular any.
    #[inline]
    pub fn holds(&self, n: DVec3, down: f64, slack: f64) -> bool {
        let Some(rows) = self.rows else { return down >= self.sin - slack };
        let across = rows.map(|row| row.dot(n) / row.length_squared());
        down + slack >= self.sin * across[0].hypot(across[1])
    }

    /// Three directions square to each other: the axis and two perpendiculars.
    #[inline]
    pub fn directions(&self) -> [DVec3; 3] {
        let u = any_perpendicular(self.axis);
        [self.axis, u, self.axis.cross(u)]
    }
}

/// tan α of a cone up to which it is taken as a quadric: a flatter one loses digits in its square.
const STEEPEST: f64 = 4.0;

impl Surface for Cone {
    #[inline]
    fn reach(&self) -> f64 {
        self.apex.length()
    }

    #[inline]
    fn magnitude(&self) -> f64 {
        self.apex.abs().max_element()
    }

    #[inline]
    fn value(&self, x: DVec3) -> f64 {
        let o = x - self.apex;
        let z = o.dot(self.axis);
        (o - self.axis * z).length() * self.cos - z * self.sin
    }

    #[inline]
    fn at(&self, x: DVec3) -> FaceAt {
        let o = x - self.apex;
        let (rho, u) = radial(o, self.axis);
        let value = rho * self.cos - o.dot(self.axis) * self.sin;
        FaceAt { value, normal: u * self.cos - self.axis * self.sin, slope: 1.0, k: self.cos, rho }
    }

    #[inline]
    fn curvature(&self, _: DVec3, at: &FaceAt) -> Curvature {
        around(self.axis, at)
    }

    /// Below, the larger of the tangent and the axis (ρ >= 0); above, the largest value of a corner, exact.
    #[inline]
    fn span(&self, center: DVec3, half: DVec3) -> (f64, f64) {
        // rho cos − z sin >= −z sin, and z is largest at a corner.
        let z = (center - self.apex).dot(self.axis) + self.axis.abs().dot(half);
        (tangent(self, center, half).max(-z * self.sin), largest_corner(self, center, half))
    }

    #[inline]
    fn bend(&self, _: DVec3, at: &FaceAt) -> Bend {
        let radial = (at.normal + self.axis * self.sin) / self.cos;
        let tangents = [self.axis.cross(radial), DVec3::ZERO];
        Bend { law: Law::Conical { cos: self.cos }, radial: (at.rho, radial), tangents, core: f64::INFINITY }
    }

    #[inline]
    fn moved(&self, point: impl Fn(DVec3) -> DVec3, vector: impl Fn(DVec3) -> DVec3) -> Self {
        Self { apex: point(self.apex), axis: vector(self.axis).normalize(), sin: self.sin, cos: self.cos }
    }

    #[inline]
    fn symmetry(&self) -> Symmetry {
        Symmetry::Axis(Axis { origin: self.apex, direction: self.axis })
    }

    #[inline]
    fn developable(&self) -> Option<DVec3> {
        Some(self.axis)
    }

    #[inline]
    fn apex(&self) -> Option<Apex> {
        Some(Apex { point: self.apex, axis: self.axis, sin: self.sin, cos: self.cos, rows: None })
    }

    #[inline]
    fn quadric(&self, inset: f64) -> Option<Quadric> {
        let Self { apex, axis, sin, cos } = *self;
        (sin <= STEEPEST * cos).then(|| Quadric {
            origin: apex + axis * (inset / sin),
            axis: Some(axis),
            radius: 0.0,
            slope: sin / cos,
        })
    }

    #[inline]
    fn section(&self, y: DVec3) -> Option<Section> {
        let radius = (y - self.apex).dot(self.axis).max(0.0) * self.sin / self.cos;
        Some(Section { origin: self.apex, axis: Some(self.axis), radius })
    }

    #[inline]
    fn foot(&self, point: DVec3, normal: DVec3, size: f64) -> DVec3 {
        let Self { apex, axis, sin, cos } = *self;
        // Any point on the side of the axis to which the normal leans.
        let far = (point - apex).length().max(size);
        apex + axis * (far * cos) + (normal + axis * sin) / cos * (far * sin)
    }

    /// sin α Δ·a − cos α |Δ − (Δ·a)a| − |x − o_q| (|a_p − a_q|(sin α + cos α) + |α_p − α_q|), a and α those of p,
    /// Δ = o_p − o_q between the apexes.
    #[inline]
    fn above(&self, q: &Self, c: DVec3, r: f64) -> (f64, f64) {
        let Self { apex: o, axis: a, sin, cos } = *self;
        let Self { apex: u, axis: b, sin: sin_q, cos: cos_q } = *q;
        // |α_p − α_q| <= π/2·|sin(α_p − α_q)|, both between 0 and π/2.
        let angle = (sin * cos_q - cos * sin_q).abs() * std::f64::consts::FRAC_PI_2;
        let lean = (a - b).length() * (sin + cos) + angle;
        let far = (c - u).length() + r;
        let delta = o - u;
        let along = delta.dot(a);
        let tilt = if lean == 0.0 { 0.0 } else { lean * far };
        (sin * along - cos * (delta - a * along).length() - tilt, o.length() + u.length() + 2.0 * far)
    }

    #[inline]
    fn deviation(&self, other: &Self, size: f64) -> f64 {
        let (Self { apex: o, axis: a, sin: r, .. }, Self { apex: p, axis: b, sin: s, .. }) = (*self, *other);
        if a.dot(b) > 0.0 {
            a.cross(b).length() * size + (o - p).length() + (r - s).abs() * size
        } else {
            f64::INFINITY
        }
    }

    #[inline]
    fn difference(&self, other: &Self, size: f64) -> f64 {
        let (Self { apex: o, axis: a, sin: r, .. }, Self { apex: c, axis: b, sin: s, .. }) = (*self, *other);
        (a - b).length() * size + (o - c).length() + (r - s).abs() * size
    }

    #[inline]
    fn key(&self, _: DVec3, r: f64) -> f64 {
        self.apex.dot(SKEW) + r * (self.axis.dot(SKEW) + self.sin)
    }

    #[inline]
    fn numbers(&self) -> [f64; NUMBERS] {
        let (o, a) = (self.apex, self.axis);
        [o.x, o.y, o.z, a.x, a.y, a.z, self.sin, self.cos, 0.0, 0.0, 0.0]
    }

    #[inline]
    fn analytic(&self) -> Option<Analytic> {
        Some(Analytic::Cone(*self))
    }

    fn terms(&self) -> Option<Terms> {
        let (across, _) = Row::of_axis(self.apex, self.axis);
        let rows = across.map(|row| row.slope * self.cos);
        Some(Terms::around(self.apex, &rows, self.axis * self.sin, 0.0))
    }

    fn inside(&self, origin: DVec3, d: DVec3) -> Stretches {
        self.stretch(origin, d).into_iter().collect()
    }
}

impl Cone {
    fn stretch(&self, origin: DVec3, d: DVec3) -> Option<(f64, f64)> {
        let (o, axis) = (origin - self.apex, self.axis);
        let (z, dz) = (o.dot(axis), d.dot(axis));
        let (p, e) = (o - axis * z, d - axis * dz);
        let (cc, ss) = (self.cos * self.cos, self.sin * self.sin);
        let a = cc * e.length_squared() - ss * dz * dz;
        let b = cc * p.dot(e) - ss * z * dz;
        let c = cc * p.length_squared() - ss * z * z;
        between_roots_of_nappe([a, b, c], 1e-14, (z, dz))
    }
}
