//! Bytes as decisions: every input means something, and a changed byte changes one decision.

use contactd_proto::Pose;
use contactd_proto::motion::quat_of_rotation_vector;
use glam::{DQuat, DVec3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Reads decisions off bytes; zeros follow when they run out.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    /// A reader of an input.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }
    /// True when all bytes are read.
    pub fn is_done(&self) -> bool {
        self.bytes.is_empty()
    }
    /// The next byte.
    pub fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.bytes.split_first() else { return 0 };
        self.bytes = rest;
        *first
    }
    /// A whole number below `n`, `n` at most 256.
    pub fn below(&mut self, n: usize) -> usize {
        self.byte() as usize % n
    }
    /// One of some values.
    pub fn one_of<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(values.len())]
    }
    /// Eight bytes.
    pub fn bits(&mut self) -> u64 {
        u64::from_le_bytes(std::array::from_fn(|_| self.byte()))
    }
    /// Any double: a round one, a rough one, an extreme one, or whatever eight bytes say.
    pub fn number(&mut self) -> f64 {
        const EXTREME: [f64; 16] = [
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            -0.0,
            f64::MIN_POSITIVE,
            5e-324,
            1e-300,
            1e-39,
            1e-12,
            1.0 + f64::EPSILON,
            1e9,
            -1e17,
            1e150,
            1e160,
            1e300,
            f64::MAX,
        ];
        match self.below(8) {
            0..=3 => f64::from(self.byte() as i8) / 16.0,
            4 => self.rough(),
            5 | 6 => self.one_of(&EXTREME),
            _ => f64::from_bits(self.bits()),
        }
    }
    /// A number in [−1, 1] without special digits.
    pub fn rough(&mut self) -> f64 {
        let n = u32::from_le_bytes(std::array::from_fn(|_| self.byte()));
        f64::from(n as i32) / f64::from(i32::MAX)
    }
    /// A vector of rough numbers.
    pub fn rough_vector(&mut self) -> DVec3 {
        DVec3::new(self.rough(), self.rough(), self.rough())
    }
    /// A multiple of an eighth within [−2, 2].
    pub fn round(&mut self) -> f64 {
        (self.below(33) as f64 - 16.0) / 8.0
    }
    /// A vector of few or no round components.
    pub fn round_vector(&mut self) -> DVec3 {
        match self.below(4) {
            0 => DVec3::ZERO,
            1 => self.one_of(&[DVec3::X, DVec3::Y, DVec3::Z]) * self.round(),
            _ => DVec3::new(self.round(), self.round(), self.round()),
        }
    }
    /// A rotation vector: none, quarter turns, the tiniest, several whole turns, any.
    pub fn turn(&mut self) -> DVec3 {
        let axis = self.one_of(&[DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.6, 0.0, 0.8)]);
        let angle = match self.below(8) {
            0..=2 => 0.0,
            3 => FRAC_PI_2 * (self.below(5) as f64 - 2.0),
            4 => self.one_of(&[1e-39, 1e-300, 1e-16, -1e-9, PI, -PI, 10.0 * TAU, 100.0]),
            5 => return self.rough_vector() * PI,
            _ => self.rough(),
        };
        axis * angle
    }
    /// A rotation.
    pub fn rotation(&mut self) -> DQuat {
        quat_of_rotation_vector(self.turn())
    }
    /// A pose in units of `size`.
    pub fn pose(&mut self, size: f64) -> Pose {
        let at = if self.below(3) == 0 { self.rough_vector() } else { self.round_vector() };
        Pose::new(at * size, self.rotation())
    }
}
