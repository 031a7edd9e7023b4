//! Intervals with outward rounding, and second-order jets of them in four variables (x, y, z, t).
//!
//! Every operation is right to half a unit in the last place, so its neighbours enclose it; only +, −, ×, / and sqrt of
//! the hardware are used. A jet holds enclosures of a function's value, gradient and Hessian over a box.

use std::ops::{Add, Mul, Neg, Sub};

/// All numbers from `lo` to `hi`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Smallest.
    pub lo: f64,
    /// Largest.
    pub hi: f64,
}

/// The interval of one number.
pub fn point(v: f64) -> Interval {
    Interval { lo: v, hi: v }
}

/// Zero.
pub const ZERO: Interval = Interval { lo: 0.0, hi: 0.0 };

impl Interval {
    /// From bounds in order.
    pub fn new(lo: f64, hi: f64) -> Self {
        Self { lo, hi }
    }
    /// Largest absolute value.
    pub fn mag(self) -> f64 {
        self.lo.abs().max(self.hi.abs())
    }
    /// The smallest interval around both.
    pub fn hull(self, o: Self) -> Self {
        Self { lo: self.lo.min(o.lo), hi: self.hi.max(o.hi) }
    }
    /// Square: never negative.
    pub fn square(self) -> Self {
        let (a, b) = (self.lo * self.lo, self.hi * self.hi);
        let lo = if self.lo <= 0.0 && self.hi >= 0.0 { 0.0 } else { a.min(b).next_down().max(0.0) };
        Self { lo, hi: a.max(b).next_up() }
    }
    /// Square root; what is negative counts as zero.
    pub fn sqrt(self) -> Self {
        Self { lo: self.lo.max(0.0).sqrt().next_down().max(0.0), hi: self.hi.max(0.0).sqrt().next_up() }
    }
    /// 1/x; everything when x may be zero.
    pub fn recip(self) -> Self {
        if self.lo <= 0.0 && self.hi >= 0.0 {
            return Self { lo: f64::NEG_INFINITY, hi: f64::INFINITY };
        }
        Self { lo: (1.0 / self.hi).next_down(), hi: (1.0 / self.lo).next_up() }
    }
}

impl Add for Interval {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        // A sum with zero is exact.
        if o == ZERO {
            return self;
        }
        if self == ZERO {
            return o;
        }
        Self { lo: (self.lo + o.lo).next_down(), hi: (self.hi + o.hi).next_up() }
    }
}
impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self { lo: -self.hi, hi: -self.lo }
    }
}
impl Sub for Interval {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + -o
    }
}
impl Mul for Interval {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        if self == ZERO || o == ZERO {
            return ZERO;
        }
        let p = [self.lo * o.lo, self.lo * o.hi, self.hi * o.lo, self.hi * o.hi];
        if p.iter().any(|v| v.is_nan()) {
            return Self { lo: f64::NEG_INFINITY, hi: f64::INFINITY };
        }
        let lo = p.iter().fold(f64::INFINITY, |a, b| a.min(*b));
        let hi = p.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
        Self { lo: lo.next_down(), hi: hi.next_up() }
    }
}

/// Three intervals.
pub type Vector = [Interval; 3];
/// Rows of three intervals.
pub type Matrix = [Vector; 3];

/// A vector of numbers.
pub fn vector(v: [f64; 3]) -> Vector {
    v.map(point)
}
/// a + b.
pub fn plus(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| a[i] + b[i])
}
/// a − b.
pub fn minus(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| a[i] - b[i])
}
/// s·a.
pub fn times(s: Interval, a: Vector) -> Vector {
    a.map(|v| s * v)
}
/// a·b.
pub fn dot(a: Vector, b: Vector) -> Interval {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
/// a × b.
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
/// M·v.
pub fn apply(m: &Matrix, v: Vector) -> Vector {
    m.map(|row| dot(row, v))
}
/// Mᵀ.
pub fn transpose(m: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}
/// M·N.
pub fn product(m: &Matrix, n: &Matrix) -> Matrix {
    let n = transpose(n);
    std::array::from_fn(|i| std::array::from_fn(|j| dot(m[i], n[j])))
}
/// a/|a|.
pub fn unit(a: Vector) -> Vector {
    times((a[0].square() + a[1].square() + a[2].square()).sqrt().recip(), a)
}

/// Place of H_ij in a jet.
pub fn place(i: usize, j: usize) -> usize {
    let (i, j) = if i < j { (i, j) } else { (j, i) };
    i * 4 - i * (i + 1) / 2 + j
}

/// Value, gradient and Hessian.
#[derive(Clone, Copy, Debug)]
pub struct Jet {
    /// Value.
    pub v: Interval,
    /// Gradient.
    pub g: [Interval; 4],
    /// Upper triangle of the Hessian, see `place`.
    pub h: [Interval; 10],
}

impl Jet {
    /// A function that does not change.
    pub fn constant(v: Interval) -> Self {
        Self { v, g: [ZERO; 4], h: [ZERO; 10] }
    }
    /// s·f.
    pub fn scaled(&self, s: Interval) -> Self {
        Self { v: s * self.v, g: self.g.map(|x| s * x), h: self.h.map(|x| s * x) }
    }
    /// f + c.
    pub fn plus(&self, c: Interval) -> Self {
        Self { v: self.v + c, ..*self }
    }
    /// φ(f) from φ, φ' and φ'' over the values of f.
    fn chain(&self, v: Interval, first: Interval, second: Interval) -> Self {
        let mut h = self.h.map(|x| first * x);
        for i in 0..4 {
            for j in i..4 {
                let square = if i == j { self.g[i].square() } else { self.g[i] * self.g[j] };
                h[place(i, j)] = h[place(i, j)] + second * square;
            }
        }
        Self { v, g: self.g.map(|x| first * x), h }
    }
    /// f².
    pub fn square(&self) -> Self {
        self.chain(self.v.square(), point(2.0) * self.v, point(2.0))
    }
    /// sqrt(f).
    pub fn sqrt(&self) -> Self {
        let root = self.v.sqrt();
        let half = point(0.5) * root.recip();
        self.chain(root, half, -(half * (point(2.0) * self.v).recip()))
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self {
            v: self.v + o.v,
            g: std::array::from_fn(|i| self.g[i] + o.g[i]),
            h: std::array::from_fn(|i| self.h[i] + o.h[i]),
        }
    }
}
impl Sub for Jet {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + o.scaled(point(-1.0))
    }
}
