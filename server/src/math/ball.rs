//! Closed balls as bounds: unlike boxes they do not change under rotation.

use glam::DVec3;

/// A closed ball; empty when `radius` is negative, unbounded when it is infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre.
    pub center: DVec3,
    /// Radius; negative means empty.
    pub radius: f64,
}

impl Ball {
    /// The ball without points.
    pub const EMPTY: Self = Self { center: DVec3::ZERO, radius: -1.0 };
    /// The ball of all points.
    pub const ALL: Self = Self { center: DVec3::ZERO, radius: f64::INFINITY };

    /// A ball from centre and radius.
    pub fn new(center: DVec3, radius: f64) -> Self {
        Self { center, radius }
    }

    /// True when it holds no point.
    pub fn is_empty(&self) -> bool {
        self.radius < 0.0
    }
}
