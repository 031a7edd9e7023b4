//! A rigid motion in intervals: the coordinates in B of a point fixed in A, as jets over a box and a span of time.
//!
//! With u = R_A x' the point from A's centre of rotation, d = p_A − p_B and Ω = spin_A − spin_B (world axes), a point of A
//! has in B's object frame the coordinates y' = R_Bᵀ(d + u), hence
//!
//! ```text
//! ẏ' = R_Bᵀ(v0 − spin_B×d + Ω×u),
//! ÿ' = R_Bᵀ(Ω×(Ω×u) + (Ω×spin_B)×u + spin_B×(spin_B×d) − 2 spin_B×v0),
//! ```
//!
//! by differentiating once more and Jacobi's identity. Rotations are Rodrigues' formula with the alternating series of
//! sin and cos for angles up to 1; larger ones are squared.

use super::interval::{Interval, Jet, Matrix, Vector, ZERO, apply, cross, minus, place, plus, point, product};
use super::interval::{times, transpose, vector};
use contactd::motion::Placed;
use contactd_proto::Pose;
use std::cell::RefCell;
use std::sync::LazyLock;

/// The matrix of a quaternion of about unit length.
pub(super) fn rotation(pose: &Pose) -> Matrix {
    let q = pose.rotation;
    let [x, y, z, w] = [q.x, q.y, q.z, q.w].map(point);
    let s = point(2.0) * (x.square() + y.square() + z.square() + w.square()).recip();
    let one = point(1.0);
    [
        [one - s * (y.square() + z.square()), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), one - s * (x.square() + z.square()), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), one - s * (x.square() + y.square())],
    ]
}

/// 1/((n + 1)(n + 2)) for n = `first` + 2k: what the terms of sin θ/θ (of 1) and 2(1 − cos θ)/θ² (of 2) have before the one ahead.
fn terms(first: f64) -> [Interval; 10] {
    std::array::from_fn(|k| {
        let n = first + 2.0 * k as f64;
        (point(n + 1.0) * point(n + 2.0)).recip()
    })
}

/// Both, worked out once: divisions are most of what a rotation costs.
static TERMS: LazyLock<[[Interval; 10]; 2]> = LazyLock::new(|| [terms(1.0), terms(2.0)]);

/// exp(t·[spin]×).
pub(super) fn turned(spin: Vector, t: Interval) -> Matrix {
    let zero = ZERO;
    if spin == [zero; 3] || t == zero {
        return std::array::from_fn(|i| std::array::from_fn(|j| point(f64::from(u8::from(i == j)))));
    }
    let square = spin[0].square() + spin[1].square() + spin[2].square();
    let (mut t, mut doublings) = (t, 0);
    while square.hi * t.mag() * t.mag() > 1.0 {
        t = Interval::new(t.lo * 0.5, t.hi * 0.5);
        doublings += 1;
    }
    // z = (|spin| t)²; sin θ/θ = Σ (−z)^k/(2k+1)!, (1 − cos θ)/θ² = Σ (−z)^k/(2k+2)!; the rest is less than 1/21!.
    let z = square * t.square();
    let series = |terms: &[Interval; 10]| {
        // What follows the last term taken lies between 0 and 1, as all tails of an alternating series do.
        let mut sum = Interval::new(0.0, 1.0);
        for term in terms.iter().rev() {
            // Horner: s = 1 − z/((n+1)(n+2))·s of the later terms.
            sum = point(1.0) - z * *term * sum;
        }
        sum
    };
    let (sinc, versine) = (series(&TERMS[0]), point(0.5) * series(&TERMS[1]));
    let k: Matrix = [[zero, -spin[2], spin[1]], [spin[2], zero, -spin[0]], [-spin[1], spin[0], zero]];
    let kk = product(&k, &k);
    let (s, c) = (sinc * t, versine * t.square());
    let mut r: Matrix = std::array::from_fn(|i| {
        std::array::from_fn(|j| point(f64::from(u8::from(i == j))) + s * k[i][j] + c * kk[i][j])
    });
    for _ in 0..doublings {
        r = product(&r, &r);
    }
    r
}

/// Rotations over a span of time, and what they make of A's axes and of where A is.
struct Instant {
    t: Interval,
    r_a: Matrix,
    n: Matrix,
    along: Matrix,
    turning: Matrix,
    d: Vector,
}

/// The motion of a pair; A carries the cells.
pub struct Motions {
    a: Matrix,
    b: Matrix,
    place_a: (Matrix, Vector),
    place_b: (Matrix, Vector),
    d: Vector,
    v0: Vector,
    spin_a: Vector,
    spin_b: Vector,
    omega: Vector,
    /// The last span and the last single time.
    kept: RefCell<[Option<Instant>; 2]>,
}

impl Motions {
    /// Of two placed solids.
    pub fn new(a: &Placed, b: &Placed) -> Self {
        let v = |v: glam::DVec3| vector(v.to_array());
        let (spin_a, spin_b) = (v(a.motion.spin), v(b.motion.spin));
        Self {
            a: rotation(&a.motion.start),
            b: rotation(&b.motion.start),
            place_a: (rotation(&a.place), v(a.place.position)),
            place_b: (rotation(&b.place), v(b.place.position)),
            d: minus(v(a.motion.start.position), v(b.motion.start.position)),
            v0: minus(v(a.motion.velocity), v(b.motion.velocity)),
            omega: minus(spin_a, spin_b),
            spin_a,
            spin_b,
            kept: RefCell::default(),
        }
    }

    /// A direction of B's solid along A's axes.
    pub fn b_direction(&self, v: Vector, t: Interval) -> Vector {
        let a = product(&product(&turned(self.spin_a, t), &self.a), &self.place_a.0);
        let b = product(&turned(self.spin_b, t), &self.b);
        apply(&transpose(&a), apply(&b, apply(&self.place_b.0, v)))
    }

    /// A point of B's solid in A's coordinates.
    pub fn b_point(&self, o: Vector, t: Interval) -> Vector {
        let b = product(&turned(self.spin_b, t), &self.b);
        let arm = apply(&b, plus(apply(&self.place_b.0, o), self.place_b.1));
        let d = plus(self.d, times(t, self.v0));
        let a = product(&turned(self.spin_a, t), &self.a);
        let x = minus(apply(&transpose(&a), minus(arm, d)), self.place_a.1);
        apply(&transpose(&self.place_a.0), x)
    }

    /// What depends on the time alone.
    fn at(&self, t: Interval) -> Instant {
        let r_a = product(&turned(self.spin_a, t), &self.a);
        let n = transpose(&product(&product(&turned(self.spin_b, t), &self.b), &self.place_b.0));
        let columns = transpose(&product(&r_a, &self.place_a.0));
        let [x, y, z] = &columns;
        let along = [apply(&n, *x), apply(&n, *y), apply(&n, *z)];
        let o = self.omega;
        let turning = [apply(&n, cross(o, *x)), apply(&n, cross(o, *y)), apply(&n, cross(o, *z))];
        Instant { t, r_a, n, along, turning, d: plus(self.d, times(t, self.v0)) }
    }

    /// Coordinates in B's solid of the points `x` of A's over the times `t`.
    pub fn in_b(&self, x: Vector, t: Interval) -> [Jet; 3] {
        // Regions are divided in space more often than in time, and each is asked for in its middle, too.
        let mut kept = self.kept.borrow_mut();
        let kept = &mut kept[usize::from(t.lo == t.hi)];
        if kept.as_ref().is_none_or(|k| k.t != t) {
            *kept = Some(self.at(t));
        }
        let Some(Instant { r_a, n, along, turning, d, .. }) = kept else { unreachable!("made above") };
        let u = apply(r_a, plus(apply(&self.place_a.0, x), self.place_a.1));
        let (o, s, d) = (self.omega, self.spin_b, *d);
        let back = apply(&transpose(&self.place_b.0), self.place_b.1);
        let y = minus(apply(n, plus(d, u)), back);
        let rate = apply(n, plus(minus(self.v0, cross(s, d)), cross(o, u)));
        let pull = plus(
            plus(cross(o, cross(o, u)), cross(cross(o, s), u)),
            minus(cross(s, cross(s, d)), times(point(2.0), cross(s, self.v0))),
        );
        let pull = apply(n, pull);
        let jet = |i: usize| {
            let mut h = [ZERO; 10];
            for k in 0..3 {
                h[place(k, 3)] = turning[k][i];
            }
            h[place(3, 3)] = pull[i];
            Jet { v: y[i], g: [along[0][i], along[1][i], along[2][i], rate[i]], h }
        };
        [jet(0), jet(1), jet(2)]
    }
}

/// A's own coordinates.
pub fn in_a(x: Vector) -> [Jet; 3] {
    let jet = |i: usize| {
        let mut jet = Jet::constant(x[i]);
        jet.g[i] = point(1.0);
        jet
    };
    [jet(0), jet(1), jet(2)]
}
