//! Numbers drawn by lot, the same ones for the same seed on every platform that rounds as IEEE 754 says.

use glam::{DQuat, DVec3, dvec3};

/// A stream of numbers (PCG-XSH-RR with 64 bits of state, O'Neill 2014).
#[derive(Clone, Debug)]
pub struct Draw(u64);

impl Draw {
    /// The stream of one scene: another one for each seed, family and index.
    pub fn new(seed: u64, family: u64, index: u64) -> Self {
        let mut draw =
            Draw(seed ^ family.wrapping_mul(0xD134_2543_DE82_EF95) ^ index.wrapping_mul(0xA24B_AED4_963E_E407));
        for _ in 0..4 {
            draw.word();
        }
        draw
    }

    fn word(&mut self) -> u32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((((old >> 18) ^ old) >> 27) as u32).rotate_right((old >> 59) as u32)
    }

    /// A number of [0, 1).
    pub fn unit(&mut self) -> f64 {
        let high = u64::from(self.word());
        ((high << 21) ^ u64::from(self.word() >> 11)) as f64 / (1u64 << 53) as f64
    }

    /// A number of [low, high).
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Ten to a power of [low, high).
    pub fn power(&mut self, low: f64, high: f64) -> f64 {
        power_of_ten(self.within(low, high))
    }

    /// About a normal number: the sum of twelve, less six.
    pub fn normal(&mut self) -> f64 {
        (0..6).map(|_| self.unit() - self.unit()).sum()
    }

    /// A number of 0..n.
    pub fn below(&mut self, n: usize) -> usize {
        ((self.unit() * n as f64) as usize).min(n.saturating_sub(1))
    }

    /// True with this probability.
    pub fn chance(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    /// One of them.
    pub fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }

    /// 1 or −1.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// A unit vector.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = dvec3(self.within(-1.0, 1.0), self.within(-1.0, 1.0), self.within(-1.0, 1.0));
            if (1e-3..=1.0).contains(&v.length()) {
                return v.normalize();
            }
        }
    }

    /// A point of the unit ball.
    pub fn in_ball(&mut self) -> DVec3 {
        loop {
            let v = dvec3(self.within(-1.0, 1.0), self.within(-1.0, 1.0), self.within(-1.0, 1.0));
            if v.length() <= 1.0 {
                return v;
            }
        }
    }

    /// A rotation, all alike.
    pub fn rotation(&mut self) -> DQuat {
        loop {
            let [x, y, z, w] = [0; 4].map(|_| self.within(-1.0, 1.0));
            let q = DQuat::from_xyzw(x, y, z, w);
            if (0.1..=1.0).contains(&q.length()) {
                return q.normalize();
            }
        }
    }
}

/// 10^x, the same bits everywhere.
fn power_of_ten(x: f64) -> f64 {
    let whole = x.floor();
    let mut rest = x - whole;
    let whole = whole as i32;
    let factor = if whole < 0 { 0.1 } else { 10.0 };
    let mut out = (0..whole.unsigned_abs()).fold(1.0, |m, _| m * factor);
    // 10^(1/2), 10^(1/4), …: square roots round alike everywhere.
    let mut root = 10.0f64;
    for _ in 0..30 {
        root = root.sqrt();
        rest *= 2.0;
        if rest >= 1.0 {
            rest -= 1.0;
            out *= root;
        }
    }
    out
}
