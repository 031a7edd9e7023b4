//! Lines, and where they cross faces.

use crate::math::Aabb;
use glam::DVec3;

/// A line with unit direction; positions are lengths along it.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where it starts.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}

impl Ray {
    /// The point at length `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }

    /// Entry and exit of a box, if the line meets it.
    pub fn through(&self, b: &Aabb) -> Option<(f64, f64)> {
        let inv = self.direction.recip();
        let (p, q) = ((b.min - self.origin) * inv, (b.max - self.origin) * inv);
        // 0 · infinity: the ray lies in a side's plane; NaN compares as "no limit" in `max` and `min` of f64.
        let enter = p.x.min(q.x).max(p.y.min(q.y)).max(p.z.min(q.z));
        let leave = p.x.max(q.x).min(p.y.max(q.y)).min(p.z.max(q.z));
        (enter <= leave).then_some((enter, leave))
    }
}

/// The end of a span: position along the ray, and the face there. `outward` is false where the solid lies outside the
/// face's primitive (a subtracted one): the solid's normal is then the negated face normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Length along the ray.
    pub at: f64,
    /// Face id within the solid.
    pub face: u32,
    /// The solid lies on the face's inner side.
    pub outward: bool,
}

/// A stretch of the ray inside a solid.
pub type Span = (Crossing, Crossing);

/// Spans shorter than this fraction of their distance along the ray are skins of coincident faces.
pub(super) const THIN: f64 = 1e-9;
