//! Tubes about a circle (a torus) or a segment (a capsule), and how two of a kind compare.

use glam::DVec3;

/// All points within a radius of a circle or a segment, its core.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tube {
    /// Middle of the core.
    pub origin: DVec3,
    /// Unit direction of a circle's axis, or of a segment.
    pub axis: DVec3,
    /// Radius of a circle, half the length of a segment.
    pub extent: f64,
    /// Radius of the tube.
    pub radius: f64,
}

impl Tube {
    /// r_q − r_p − |Δ| − |R_p − R_q| − |a_p − a_q| R_q: so far apart are the cores, a_q turned so that it points the way of a_p; and
    /// the size that rounding depends on.
    #[inline]
    pub fn above(&self, q: &Self) -> (f64, f64) {
        let b = if self.axis.dot(q.axis) < 0.0 { -q.axis } else { q.axis };
        let apart = (self.origin - q.origin).length() + (self.extent - q.extent).abs();
        let lean = (self.axis - b).length() * q.extent;
        let size = self.origin.length() + q.origin.length() + self.extent + q.extent + self.radius + q.radius;
        (q.radius - self.radius - apart - lean, size)
    }

    /// How far two tubes differ at most.
    #[inline]
    pub fn deviation(&self, other: &Self) -> f64 {
        let lean = self.axis.cross(other.axis).length() * self.extent.max(other.extent);
        let apart = (self.origin - other.origin).length() + (self.extent - other.extent).abs();
        lean + apart + (self.radius - other.radius).abs()
    }
}
