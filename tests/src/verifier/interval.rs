//! Intervals with outward rounding, and second-order jets of them in four variables (x, y, z, t).
//!
//! Every operation is right to half a unit in the last place, so its neighbours enclose it; only +, −, ×, / and sqrt of
//! the hardware are used (`norm` has its powers, with room of its own). A jet holds enclosures of a function's value,
//! gradient and Hessian over a box.
//!
//! Certificates cost as much as this arithmetic does: it is written in loops, and inlined, so that it is fast as the tests are
//! compiled.

use glam::DVec3;
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
#[inline]
pub fn point(v: f64) -> Interval {
    Interval { lo: v, hi: v }
}

/// Zero.
pub const ZERO: Interval = Interval { lo: 0.0, hi: 0.0 };

impl Interval {
    /// From bounds in order.
    #[inline]
    pub fn new(lo: f64, hi: f64) -> Self {
        Self { lo, hi }
    }
    /// Largest absolute value.
    #[inline]
    pub fn mag(self) -> f64 {
        self.lo.abs().max(self.hi.abs())
    }
    /// The smallest interval around both.
    #[inline]
    pub fn hull(self, o: Self) -> Self {
        Self { lo: self.lo.min(o.lo), hi: self.hi.max(o.hi) }
    }
    /// Square: never negative.
    #[inline]
    pub fn square(self) -> Self {
        let (a, b) = (self.lo * self.lo, self.hi * self.hi);
        let lo = if self.lo <= 0.0 && self.hi >= 0.0 { 0.0 } else { a.min(b).next_down().max(0.0) };
        Self { lo, hi: a.max(b).next_up() }
    }
    /// Square root; what is negative counts as zero.
    #[inline]
    pub fn sqrt(self) -> Self {
        Self { lo: self.lo.max(0.0).sqrt().next_down().max(0.0), hi: self.hi.max(0.0).sqrt().next_up() }
    }
    /// 1/x; everything when x may be zero.
    #[inline]
    pub fn recip(self) -> Self {
        if self.lo <= 0.0 && self.hi >= 0.0 {
            return Self { lo: f64::NEG_INFINITY, hi: f64::INFINITY };
        }
        Self { lo: (1.0 / self.hi).next_down(), hi: (1.0 / self.lo).next_up() }
    }
}

impl Add for Interval {
    type Output = Self;
    #[inline]
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
    #[inline]
    fn neg(self) -> Self {
        Self { lo: -self.hi, hi: -self.lo }
    }
}
impl Sub for Interval {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        self + -o
    }
}
impl Mul for Interval {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        if self == ZERO || o == ZERO {
            return ZERO;
        }
        let [a, b, c, d] = [self.lo * o.lo, self.lo * o.hi, self.hi * o.lo, self.hi * o.hi];
        if a.is_nan() || b.is_nan() || c.is_nan() || d.is_nan() {
            return Self { lo: f64::NEG_INFINITY, hi: f64::INFINITY };
        }
        Self { lo: a.min(b).min(c.min(d)).next_down(), hi: a.max(b).max(c.max(d)).next_up() }
    }
}

/// Three intervals.
pub type Vector = [Interval; 3];
/// Rows of three intervals.
pub type Matrix = [Vector; 3];

/// A vector of numbers.
#[inline]
pub fn vector([x, y, z]: [f64; 3]) -> Vector {
    [point(x), point(y), point(z)]
}
/// a + b.
#[inline]
pub fn plus(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
/// a − b.
#[inline]
pub fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
/// s·a.
#[inline]
pub fn times(s: Interval, a: Vector) -> Vector {
    [s * a[0], s * a[1], s * a[2]]
}
/// a·b.
#[inline]
pub fn dot(a: Vector, b: Vector) -> Interval {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
/// a × b.
#[inline]
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
/// M·v.
#[inline]
pub fn apply(m: &Matrix, v: Vector) -> Vector {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}
/// Mᵀ.
#[inline]
pub fn transpose(m: &Matrix) -> Matrix {
    let column = |k: usize| [m[0][k], m[1][k], m[2][k]];
    [column(0), column(1), column(2)]
}
/// M·N.
#[inline]
pub fn product(m: &Matrix, n: &Matrix) -> Matrix {
    let n = transpose(n);
    let row = |k: usize| [dot(m[k], n[0]), dot(m[k], n[1]), dot(m[k], n[2])];
    [row(0), row(1), row(2)]
}
/// a/|a|.
#[inline]
pub fn unit(a: Vector) -> Vector {
    times((a[0].square() + a[1].square() + a[2].square()).sqrt().recip(), a)
}

/// Place of H_ij in a jet.
#[inline]
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
    #[inline]
    pub fn constant(v: Interval) -> Self {
        Self { v, g: [ZERO; 4], h: [ZERO; 10] }
    }
    /// s·f.
    #[inline]
    pub fn scaled(&self, s: Interval) -> Self {
        let mut f = *self;
        f.v = s * f.v;
        for x in &mut f.g {
            *x = s * *x;
        }
        for x in &mut f.h {
            *x = s * *x;
        }
        f
    }
    /// f + c.
    #[inline]
    pub fn plus(&self, c: Interval) -> Self {
        Self { v: self.v + c, ..*self }
    }
    /// φ(f) from φ, φ' and φ'' over the values of f.
    #[inline]
    fn chain(&self, v: Interval, first: Interval, second: Interval) -> Self {
        let mut f = self.scaled(first);
        for i in 0..4 {
            for j in i..4 {
                let square = if i == j { self.g[i].square() } else { self.g[i] * self.g[j] };
                f.h[place(i, j)] = f.h[place(i, j)] + second * square;
            }
        }
        Self { v, ..f }
    }
    /// f².
    #[inline]
    pub fn square(&self) -> Self {
        self.chain(self.v.square(), point(2.0) * self.v, point(2.0))
    }
    /// sqrt(f).
    #[inline]
    pub fn sqrt(&self) -> Self {
        let root = self.v.sqrt();
        let half = point(0.5) * root.recip();
        self.chain(root, half, -(half * (point(2.0) * self.v).recip()))
    }
}

impl Add for Jet {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        let mut f = self;
        f.v = f.v + o.v;
        for i in 0..4 {
            f.g[i] = f.g[i] + o.g[i];
        }
        for i in 0..10 {
            f.h[i] = f.h[i] + o.h[i];
        }
        f
    }
}
impl Sub for Jet {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        self + o.scaled(point(-1.0))
    }
}

/// The length of a vector.
#[inline]
pub fn length(v: Vector) -> Interval {
    (v[0].square() + v[1].square() + v[2].square()).sqrt()
}

/// A point as it is seen from `o`.
#[inline]
pub fn offsets(y: &[Jet; 3], o: DVec3) -> [Jet; 3] {
    let of = |i: usize| y[i].plus(point(-o[i]));
    [of(0), of(1), of(2)]
}

/// n·y.
pub fn linear(n: Vector, y: &[Jet; 3]) -> Jet {
    let sum = |[a, b, c]: [Interval; 3]| n[0] * a + n[1] * b + n[2] * c;
    let mut f = Jet::constant(sum([y[0].v, y[1].v, y[2].v]));
    for (k, g) in f.g.iter_mut().enumerate() {
        *g = sum([y[0].g[k], y[1].g[k], y[2].g[k]]);
    }
    for (k, h) in f.h.iter_mut().enumerate() {
        *h = sum([y[0].h[k], y[1].h[k], y[2].h[k]]);
    }
    f
}

/// What of y is across an axis.
pub fn across(y: &[Jet; 3], axis: Vector) -> [Jet; 3] {
    let along = linear(axis, y);
    let of = |i: usize| y[i] - along.scaled(axis[i]);
    [of(0), of(1), of(2)]
}

/// |y|².
pub fn square_length(y: &[Jet; 3]) -> Jet {
    y[0].square() + y[1].square() + y[2].square()
}

/// What holds both.
#[inline]
pub fn hull(p: &Jet, q: &Jet) -> Jet {
    Jet {
        v: p.v.hull(q.v),
        g: std::array::from_fn(|k| p.g[k].hull(q.g[k])),
        h: std::array::from_fn(|k| p.h[k].hull(q.h[k])),
    }
}

/// A unit vector made a little shorter than 1 for certain.
#[inline]
pub fn short(v: DVec3) -> Vector {
    times(point(1.0 - 1e-15), vector(v.normalize_or_zero().to_array()))
}
