//! Axis-aligned boxes, possibly empty or unbounded.

use glam::DVec3;

/// A closed axis-aligned box. Empty when `min > max` on some axis; sides may be infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest corner.
    pub min: DVec3,
    /// Largest corner.
    pub max: DVec3,
}

impl Aabb {
    /// Between which parameters a line is in the box, to rounding; `None` where it passes by.
    pub fn along(&self, origin: DVec3, direction: DVec3) -> Option<(f64, f64)> {
        let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
        for k in 0..3 {
            let (o, d) = (origin[k], direction[k]);
            if d == 0.0 {
                if o < self.min[k] || o > self.max[k] {
                    return None;
                }
                continue;
            }
            let (p, q) = ((self.min[k] - o) / d, (self.max[k] - o) / d);
            (from, to) = (from.max(p.min(q)), to.min(p.max(q)));
        }
        Some((from, to))
    }

    /// The box without points.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };
    /// The box of all points.
    pub const ALL: Self = Self { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };

    /// The box of given corners; empty when they are out of order.
    pub fn new(min: DVec3, max: DVec3) -> Self {
        Self { min, max }
    }

    /// The box around `center` with half extents `half`.
    pub fn around(center: DVec3, half: DVec3) -> Self {
        Self { min: center - half, max: center + half }
    }

    /// The smallest box of some points.
    pub fn of_points(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| Self { min: b.min.min(p), max: b.max.max(p) })
    }

    /// True when no point lies in the box.
    pub fn is_empty(&self) -> bool {
        !(self.min.cmple(self.max).all())
    }

    /// True when every side is finite (and the box not empty).
    pub fn is_finite(&self) -> bool {
        !self.is_empty() && self.min.is_finite() && self.max.is_finite()
    }

    /// Middle of a finite box.
    pub fn center(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// Half extents of a finite box.
    pub fn half(&self) -> DVec3 {
        (self.max - self.min) * 0.5
    }

    /// Smallest box around both.
    pub fn union(&self, other: &Self) -> Self {
        if self.is_empty() {
            return *other;
        }
        if other.is_empty() {
            return *self;
        }
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// What both have in common.
    pub fn intersection(&self, other: &Self) -> Self {
        let b = Self { min: self.min.max(other.min), max: self.max.min(other.max) };
        if b.is_empty() { Self::EMPTY } else { b }
    }

    /// True when the two share a point.
    pub fn meets(&self, other: &Self) -> bool {
        !self.intersection(other).is_empty()
    }

    /// Largest of the gaps along the three axes: by how much either has to grow on every side until they share a point. 0 where
    /// they do, infinite from an empty one.
    pub fn gap(&self, other: &Self) -> f64 {
        (self.min - other.max).max(other.min - self.max).max_element().max(0.0)
    }

    /// The box moved outwards by `margin` on every side.
    pub fn grown(&self, margin: f64) -> Self {
        if self.is_empty() {
            return *self;
        }
        Self { min: self.min - DVec3::splat(margin), max: self.max + DVec3::splat(margin) }
    }

    /// True when `p` lies in the closed box.
    pub fn contains(&self, p: DVec3) -> bool {
        self.min.cmple(p).all() && p.cmple(self.max).all()
    }

    /// The eight corners of a finite box.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            DVec3::new(
                if i & 1 == 0 { self.min.x } else { self.max.x },
                if i & 2 == 0 { self.min.y } else { self.max.y },
                if i & 4 == 0 { self.min.z } else { self.max.z },
            )
        })
    }
}
