//! Numbers from a fixed seed.

use glam::{DQuat, DVec3};

/// An LCG of 64 bits, its upper half.
pub struct Numbers(u64);

impl Numbers {
    pub fn new(seed: u64) -> Self {
        let mut numbers = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d);
        numbers.below(1);
        numbers
    }

    pub fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }

    /// In a cube from -1 to 1.
    pub fn vector(&mut self) -> DVec3 {
        DVec3::from([(); 3].map(|()| self.below(1 << 20) as f64 / f64::from(1 << 19) - 1.0))
    }

    pub fn rotation(&mut self) -> DQuat {
        contactd_client::proto::motion::quat_of_rotation_vector(self.vector() * 2.0)
    }
}
