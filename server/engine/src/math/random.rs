//! Reproducible numbers for the tests of every floor, those of the packages above included; no answer depends on them.

use glam::{DVec3, dvec3};

/// Pseudo-random numbers (splitmix64), the same ones for the same seed.
pub struct Random(pub u64);

impl Random {
    /// A number of [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A number of [lo, hi).
    pub fn within(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.unit()
    }

    /// A point of the cube of half side `size` around the origin.
    pub fn vector(&mut self, size: f64) -> DVec3 {
        dvec3(self.within(-size, size), self.within(-size, size), self.within(-size, size))
    }
}
