//! Capsule: psi = |x − q| − r, q the point of a segment next to x: the exact distance.
//!
//! The distance from a convex set is convex, and that from one of its points is nowhere less. So psi lies above its tangents and below
//! the ball of radius r around the point next to where they are taken: each bound of a sphere holds of it from that side.

use super::roots::between_roots;
use super::tube::Tube;
use super::{
    Analytic, Axis, Bend, Curvature, Cylinder, Face, FaceAt, Law, NUMBERS, Row, Section, Sphere, Spine, Stretches,
    Surface, Symmetry, Terms, around, heights, largest_corner, radial, tangent,
};
use crate::math::any_perpendicular;
use glam::DVec3;

/// All points within a radius of a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// Middle of the segment.
    pub origin: DVec3,
    /// Unit direction of the segment.
    pub axis: DVec3,
    /// Half its length.
    pub half: f64,
    /// Radius r.
    pub radius: f64,
}

/// How far beyond the segment, in sizes of the face, it still counts as straight: what lies on a plane touches it there, too, and where
/// its ends are is known to rounding.
const SEAM: f64 = 1e-9;

impl Capsule {
    /// True where it is straight, at this height.
    #[inline]
    fn is_straight(&self, z: f64) -> bool {
        z.abs() <= self.half + SEAM * (self.half + self.radius)
    }

    /// The end of the segment beyond which a point at this height lies; `None` beside the segment.
    #[inline]
    fn end(&self, z: f64) -> Option<DVec3> {
        (z.abs() > self.half).then(|| self.axis * self.half.copysign(z))
    }

    /// The tube that it is.
    #[inline]
    fn tube(&self) -> Tube {
        Tube { origin: self.origin, axis: self.axis, extent: self.half, radius: self.radius }
    }
}

/// The length of an offset from a segment's end, and its direction; of none a direction across the segment.
#[inline]
fn away(d: DVec3, axis: DVec3) -> (f64, DVec3) {
    let rho = d.length();
    (rho, if rho > 0.0 { d / rho } else { any_perpendicular(axis) })
}

impl Surface for Capsule {
    #[inline]
    fn reach(&self) -> f64 {
        self.origin.length() + self.half + self.radius
    }

    #[inline]
    fn magnitude(&self) -> f64 {
        self.origin.abs().max_element() + self.half + self.radius
    }

    #[inline]
    fn value(&self, x: DVec3) -> f64 {
        let o = x - self.origin;
        let z = o.dot(self.axis);
        match self.end(z) {
            Some(end) => (o - end).length() - self.radius,
            None => (o - self.axis * z).length() - self.radius,
        }
    }

    #[inline]
    fn at(&self, x: DVec3) -> FaceAt {
        let o = x - self.origin;
        let (rho, normal) = match self.end(o.dot(self.axis)) {
            Some(end) => {
                let d = o - end;
                // Beyond an end the gradient never leads back along the segment. Beside the end's own rounding d may.
                if d.dot(end) < 0.0 { radial(d, self.axis) } else { away(d, self.axis) }
            }
            None => radial(o, self.axis),
        };
        FaceAt { value: rho - self.radius, normal, slope: 1.0, k: 1.0, rho }
    }

    #[inline]
    fn curvature(&self, x: DVec3, at: &FaceAt) -> Curvature {
        if self.is_straight((x - self.origin).dot(self.axis)) {
            return around(self.axis, at);
        }
        let each = 1.0 / at.rho;
        Curvature { each, factor: -each, along: at.normal, ..Curvature::NONE }
    }

    /// The cylinder beside the segment, the ball beyond an end of it.
    #[inline]
    fn near(&self, center: DVec3, reach: f64) -> Option<Face> {
        let Self { origin, axis, half, radius } = *self;
        let z = (center - origin).dot(axis);
        if z.abs() + reach <= half {
            return Some(Cylinder { origin, axis, radius }.into());
        }
        let end = self.end(z)?;
        (z.abs() - reach >= half).then(|| Sphere { center: origin + end, radius }.into())
    }

    /// Below, the larger of the tangent and the segment; above, the largest value of a corner.
    #[inline]
    fn span(&self, center: DVec3, half: DVec3) -> (f64, f64) {
        (tangent(self, center, half).max(-self.radius), largest_corner(self, center, half))
    }

    /// Above as of the ball at the point next to x, below as of a plane.
    #[inline]
    fn bend(&self, _: DVec3, at: &FaceAt) -> Bend {
        let t = any_perpendicular(at.normal);
        Bend {
            law: Law::Ring { radius: self.radius, lean: 0.0 },
            radial: (at.rho, at.normal),
            tangents: [t, at.normal.cross(t)],
            core: at.rho,
        }
    }

    #[inline]
    fn moved(&self, point: impl Fn(DVec3) -> DVec3, vector: impl Fn(DVec3) -> DVec3) -> Self {
        Self { origin: point(self.origin), axis: vector(self.axis).normalize(), ..*self }
    }

    fn spine(&self, hull: &[DVec3]) -> Option<Spine> {
        let (lo, hi) = heights(hull, self.origin, self.axis);
        let points = [lo, hi].map(|z| self.origin + self.axis * z.clamp(-self.half, self.half));
        Some(Spine { points: points.into_iter().collect(), radius: self.radius })
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
    fn straight_at(&self, x: DVec3) -> Option<DVec3> {
        self.is_straight((x - self.origin).dot(self.axis)).then_some(self.axis)
    }

    /// Through the middle, between the points that are farthest along the normal and against it.
    #[inline]
    fn skewer(&self, normal: DVec3) -> Option<Axis> {
        let lean = normal.dot(self.axis);
        let along = if lean.abs() > 1e-9 { self.half.copysign(lean) } else { 0.0 };
        Some(Axis { origin: self.origin, direction: (normal * self.radius + self.axis * along).normalize() })
    }

    #[inline]
    fn ends(&self) -> [Option<DVec3>; 2] {
        [self.half, -self.half].map(|z| Some(self.origin + self.axis * z))
    }

    /// Of the cylinder beside the segment, of the ball beyond an end.
    #[inline]
    fn section(&self, y: DVec3) -> Option<Section> {
        let Self { origin, axis, radius, .. } = *self;
        Some(match self.end((y - origin).dot(axis)) {
            Some(end) => Section { origin: origin + end, axis: None, radius },
            None => Section { origin, axis: Some(axis), radius },
        })
    }

    #[inline]
    fn foot(&self, point: DVec3, normal: DVec3, _: f64) -> DVec3 {
        let z = (point - self.origin).dot(self.axis).clamp(-self.half, self.half);
        self.origin + self.axis * z + normal * self.radius
    }

    #[inline]
    fn above(&self, q: &Self, _: DVec3, _: f64) -> (f64, f64) {
        self.tube().above(&q.tube())
    }

    #[inline]
    fn deviation(&self, other: &Self, _: f64) -> f64 {
        self.tube().deviation(&other.tube())
    }

    #[inline]
    fn key(&self, _: DVec3, _: f64) -> f64 {
        self.origin.dot(super::SKEW) + self.half + self.radius
    }

    #[inline]
    fn numbers(&self) -> [f64; NUMBERS] {
        let (o, a) = (self.origin, self.axis);
        [o.x, o.y, o.z, a.x, a.y, a.z, self.half, self.radius, 0.0, 0.0, 0.0]
    }

    #[inline]
    fn analytic(&self) -> Option<Analytic> {
        Some(Analytic::Capsule(*self))
    }

    /// From the first to the last of the ball at either end and of the cylinder between them.
    fn terms(&self) -> Option<Terms> {
        let (across, along) = Row::of_axis(self.origin, self.axis);
        Some(Terms::Segment { across, along, half: self.half, tube: self.radius })
    }

    fn inside(&self, origin: DVec3, d: DVec3) -> Stretches {
        let (o, axis) = (origin - self.origin, self.axis);
        let square = self.radius * self.radius;
        let ball = |end: DVec3| between_roots(1.0, (o - end).dot(d), (o - end).length_squared() - square);
        let (z, dz) = (o.dot(axis), d.dot(axis));
        let (p, e) = (o - axis * z, d - axis * dz);
        let across = e.length_squared();
        let tube = if across < 1e-24 { None } else { between_roots(across, p.dot(e), p.length_squared() - square) };
        // Of the cylinder what lies between the ends.
        let tube = tube.and_then(|(from, to)| {
            let (low, high) = match dz {
                0.0 if z.abs() <= self.half => (f64::NEG_INFINITY, f64::INFINITY),
                0.0 => return None,
                _ => {
                    let (s, t) = ((-self.half - z) / dz, (self.half - z) / dz);
                    (s.min(t), s.max(t))
                }
            };
            let (from, to) = (from.max(low), to.min(high));
            (from <= to).then_some((from, to))
        });
        let all = [tube, ball(axis * self.half), ball(axis * -self.half)].into_iter().flatten();
        all.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).into_iter().collect()
    }
}
