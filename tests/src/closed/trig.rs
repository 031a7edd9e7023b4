//! Trigonometric polynomials in one angle, up to degree 4, and all their real roots.
//!
//! Idea: what happens along a rim or around a cone's generators is Σ a_k cos kθ + b_k sin kθ. With u = tan θ/2 it is a
//! polynomial of twice the degree; two charts u ∈ [−1, 1], one of them half a turn on, hold every angle. Roots are
//! bracketed by the roots of the derivative, down to a line: none with a change of sign can be missed.
//! Source: e^{iθ} = (1 + iu)²/(1 + u²). Root isolation by the chain of derivatives is Rolle's theorem.
//! Does not promise: a double root, where the sign does not change; rounding may show it as two or none.

use std::f64::consts::PI;

/// Largest degree.
const DEGREE: usize = 4;

/// Coefficients of a polynomial in u, lowest first.
type Poly = [f64; 2 * DEGREE + 1];

/// `Σ cos[k]·cos kθ + sin[k]·sin kθ`; `sin[0]` is unused.
#[derive(Clone, Copy, Debug, Default)]
pub struct Trig {
    /// Coefficients of the cosines.
    pub cos: [f64; DEGREE + 1],
    /// Coefficients of the sines.
    pub sin: [f64; DEGREE + 1],
}

impl Trig {
    /// c + x cos θ + y sin θ.
    pub fn linear(c: f64, x: f64, y: f64) -> Self {
        let mut t = Self::default();
        (t.cos[0], t.cos[1], t.sin[1]) = (c, x, y);
        t
    }

    /// The value at an angle.
    pub fn at(&self, angle: f64) -> f64 {
        let (s1, c1) = angle.sin_cos();
        let (mut s, mut c, mut sum) = (0.0, 1.0, 0.0);
        for k in 0..=DEGREE {
            sum += self.cos[k] * c + self.sin[k] * s;
            (s, c) = (s * c1 + c * s1, c * c1 - s * s1);
        }
        sum
    }

    /// The derivative by the angle.
    pub fn slope(&self) -> Self {
        let mut t = Self::default();
        for k in 1..=DEGREE {
            t.cos[k] = k as f64 * self.sin[k];
            t.sin[k] = -(k as f64) * self.cos[k];
        }
        t
    }

    /// self + factor·other.
    pub fn plus(&self, factor: f64, other: &Self) -> Self {
        let mut t = *self;
        for k in 0..=DEGREE {
            t.cos[k] += factor * other.cos[k];
            t.sin[k] += factor * other.sin[k];
        }
        t
    }

    /// self·other; the degrees must sum to 4 at most.
    pub fn times(&self, other: &Self) -> Self {
        let mut t = Self::default();
        for i in 0..=DEGREE {
            for j in 0..=DEGREE {
                let (ci, si, cj, sj) = (self.cos[i], self.sin[i], other.cos[j], other.sin[j]);
                if (ci == 0.0 && si == 0.0) || (cj == 0.0 && sj == 0.0) {
                    continue;
                }
                let (sum, gap, sign) = (i + j, i.abs_diff(j), if i >= j { 1.0 } else { -1.0 });
                debug_assert!(sum <= DEGREE);
                t.cos[sum] += 0.5 * (ci * cj - si * sj);
                t.cos[gap] += 0.5 * (ci * cj + si * sj);
                t.sin[sum] += 0.5 * (si * cj + ci * sj);
                t.sin[gap] += 0.5 * sign * (si * cj - ci * sj);
            }
        }
        t.sin[0] = 0.0;
        t
    }

    /// Calls `take` with every angle in [−π/2, 3π/2] at which the sign changes.
    pub fn roots(&self, mut take: impl FnMut(f64)) {
        for turn in [0.0, PI] {
            let p = self.in_tangent(turn != 0.0);
            roots_in_chart(&p, &mut |u| {
                // Newton in the angle itself: the polynomial in u loses a few digits.
                let mut angle = 2.0 * u.atan() + turn;
                let slope = self.slope();
                for _ in 0..2 {
                    let step = self.at(angle) / slope.at(angle);
                    if step.abs() < 1e-6 {
                        angle -= step;
                    }
                }
                take(angle);
            });
        }
    }

    /// (1 + u²)⁴ times the value at θ = 2 atan u, a half turn later if `turned`.
    fn in_tangent(&self, turned: bool) -> Poly {
        let mut p = [0.0; 2 * DEGREE + 1];
        for k in 0..=DEGREE {
            // (1 + iu)^2k (1 + u²)^(4−k), real and imaginary parts.
            let sign = if turned && k % 2 == 1 { -1.0 } else { 1.0 };
            let (mut re, mut im) = ([0.0; 2 * DEGREE + 1], [0.0; 2 * DEGREE + 1]);
            re[0] = 1.0;
            for _ in 0..2 * k {
                for i in (0..=2 * DEGREE).rev() {
                    let below = |v: &Poly| if i > 0 { v[i - 1] } else { 0.0 };
                    let (r, m) = (re[i] - below(&im), im[i] + below(&re));
                    (re[i], im[i]) = (r, m);
                }
            }
            for _ in k..DEGREE {
                for i in (2..=2 * DEGREE).rev() {
                    re[i] += re[i - 2];
                    im[i] += im[i - 2];
                }
            }
            for i in 0..=2 * DEGREE {
                p[i] += sign * (self.cos[k] * re[i] + self.sin[k] * im[i]);
            }
        }
        p
    }
}

fn value(p: &[f64], u: f64) -> f64 {
    p.iter().rev().fold(0.0, |s, c| s * u + c)
}

/// Changes of sign of a polynomial in [−1, 1].
fn roots_in_chart(p: &Poly, take: &mut impl FnMut(f64)) {
    const N: usize = 2 * DEGREE;
    // derivatives[d] is the d-th one, of degree N − d.
    let mut derivatives = [*p; N + 1];
    for d in 1..=N {
        derivatives[d] = [0.0; N + 1];
        for i in 0..=N - d {
            derivatives[d][i] = derivatives[d - 1][i + 1] * (i + 1) as f64;
        }
    }
    // Ends of the pieces on which the polynomial at hand is monotone.
    let mut ends = [-1.0; N + 2];
    let mut count = 2;
    ends[1] = 1.0;
    for d in (0..N).rev() {
        let q = &derivatives[d];
        let (mut found, mut n) = ([-1.0; N + 2], 1);
        for w in 0..count - 1 {
            let (mut lo, mut hi) = (ends[w], ends[w + 1]);
            let (below, above) = (value(q, lo), value(q, hi));
            if (below > 0.0) == (above > 0.0) {
                continue;
            }
            while hi - lo > f64::EPSILON {
                let mid = 0.5 * (lo + hi);
                if mid <= lo || mid >= hi {
                    break;
                }
                if (value(q, mid) > 0.0) == (below > 0.0) { lo = mid } else { hi = mid }
            }
            if n <= N {
                found[n] = 0.5 * (lo + hi);
                n += 1;
            }
        }
        if d == 0 {
            found[1..n].iter().for_each(|u| take(*u));
            return;
        }
        found[n] = 1.0;
        (ends, count) = (found, n + 1);
    }
}
