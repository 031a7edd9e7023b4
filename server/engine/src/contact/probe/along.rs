//! Bounds of a face along a stretch of a ray.
//!
//! On [a, b] a convex psi is at most the larger of its ends. From below: where it falls all along, or rises, its lower end; else where the
//! tangents at both ends meet. Of a face that is not convex, with v and s its value and slope at the middle and h half the length:
//! v ± min(|s| h + ½ k h²/ρ, h), the dip of `Under` in place of the curvature from below.

use crate::math::Aabb;
use crate::solid::Face;
use crate::solid::local::Span;
use crate::solid::surface::Under;
use glam::DVec3;

/// A ray in the model's frame.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// At parameter 0.
    pub origin: DVec3,
    /// A unit vector.
    pub direction: DVec3,
}

impl Line {
    /// The point at a parameter.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }

    /// Bounds of psi between two parameters, rounding left out.
    pub fn span(&self, face: &Face, a: f64, b: f64) -> Span {
        if let Some((normal, offset)) = face.flat() {
            let ends = [a, b].map(|t| normal.dot(self.at(t)) - offset);
            return (ends[0].min(ends[1]), ends[0].max(ends[1]));
        }
        if face.is_convex() { self.of_convex(face, a, b) } else { self.of_other(face, a, b) }
    }

    fn of_convex(&self, face: &Face, a: f64, b: f64) -> Span {
        let (p, q) = (face.at(self.at(a)), face.at(self.at(b)));
        let (s, r) = (p.normal.dot(self.direction), q.normal.dot(self.direction));
        let lower = if s >= 0.0 {
            p.value
        } else if r <= 0.0 {
            q.value
        } else {
            // Where p + s x = q − r (h − x): between the ends but for rounding.
            let h = b - a;
            let x = ((q.value - p.value - r * h) / (s - r)).clamp(0.0, h);
            (p.value + s * x).min(q.value - r * (h - x))
        };
        (lower, p.value.max(q.value))
    }

    fn of_other(&self, face: &Face, a: f64, b: f64) -> Span {
        let (x, h) = (self.at(0.5 * (a + b)), 0.5 * (b - a));
        let at = face.at(x);
        let tilt = at.normal.dot(self.direction).abs() * h;
        let bulge = if at.rho > 0.0 { at.k * h * h / (2.0 * at.rho) } else { f64::INFINITY };
        let lower = match face.under(x, x) {
            Some(u) => u.value - (u.normal.dot(self.direction).abs() * h + Under::dip(u.k, u.rho, h)),
            None => at.value - tilt,
        };
        let around = Aabb::of_points([self.at(a), self.at(b)]);
        let (low, high) = face.span(around.center(), around.half());
        (lower.max(at.value - h).max(low), (at.value + (tilt + bulge).min(h)).min(high))
    }

    /// Where the ray crosses psi = 0 strictly between two parameters, as far as rounding tells: a guess, ascending.
    pub fn crossings(&self, face: &Face, a: f64, b: f64, out: &mut Vec<(f64, f64)>) {
        for (from, to) in face.inside(self.origin, self.direction) {
            for t in [from, to] {
                if t > a && t < b {
                    out.push((t, face.at(self.at(t)).normal.dot(self.direction).abs()));
                }
            }
        }
    }
}
