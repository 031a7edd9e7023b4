//! Two numbers that take the same way: what is worked out for both ends of a step is worked out at once, in one register.

use std::array::from_fn;
use std::ops::{Add, Mul, Sub};

/// What a formula without branches needs of its numbers, one or two of them.
pub trait Lanes: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Mul<f64, Output = Self> {
    /// The same number in each.
    fn all(x: f64) -> Self;
    /// Square roots.
    fn sqrt(self) -> Self;
    /// Sizes.
    fn abs(self) -> Self;
    /// The larger ones.
    fn max(self, other: Self) -> Self;
    /// What a function makes of three, one after the other.
    fn each(of: [Self; 3], f: impl Fn([f64; 3]) -> f64) -> Self;
}

impl Lanes for f64 {
    #[inline]
    fn all(x: f64) -> Self {
        x
    }
    #[inline]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline]
    fn abs(self) -> Self {
        self.abs()
    }
    #[inline]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline]
    fn each(of: [Self; 3], f: impl Fn([f64; 3]) -> f64) -> Self {
        f(of)
    }
}

/// A number at the start and at the end of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(16))]
pub struct F64x2(pub [f64; 2]);

impl Add for F64x2 {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self(from_fn(|i| self.0[i] + o.0[i]))
    }
}

impl Sub for F64x2 {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self(from_fn(|i| self.0[i] - o.0[i]))
    }
}

impl Mul for F64x2 {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        Self(from_fn(|i| self.0[i] * o.0[i]))
    }
}

impl Mul<f64> for F64x2 {
    type Output = Self;
    #[inline]
    fn mul(self, o: f64) -> Self {
        Self(self.0.map(|x| x * o))
    }
}

impl Lanes for F64x2 {
    #[inline]
    fn all(x: f64) -> Self {
        Self([x; 2])
    }
    #[inline]
    fn sqrt(self) -> Self {
        Self(self.0.map(f64::sqrt))
    }
    #[inline]
    fn abs(self) -> Self {
        Self(self.0.map(f64::abs))
    }
    #[inline]
    fn max(self, o: Self) -> Self {
        Self(from_fn(|i| Lanes::max(self.0[i], o.0[i])))
    }
    #[inline]
    fn each(of: [Self; 3], f: impl Fn([f64; 3]) -> f64) -> Self {
        Self(from_fn(|i| f(of.map(|x| x.0[i]))))
    }
}
