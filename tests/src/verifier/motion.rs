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

/// exp(t·[spin]×).
pub(super) fn turned(spin: Vector, t: Interval) -> Matrix {
    let square = spin[0].square() + spin[1].square() + spin[2].square();
    let (mut t, mut doublings) = (t, 0);
    while square.hi * t.mag() * t.mag() > 1.0 {
        t = Interval::new(t.lo * 0.5, t.hi * 0.5);
        doublings += 1;
    }
    // z = (|spin| t)²; sin θ/θ = Σ (−z)^k/(2k+1)!, (1 − cos θ)/θ² = Σ (−z)^k/(2k+2)!; the rest is less than 1/21!.
    let z = square * t.square();
    let series = |first: f64| {
        // What follows the last term taken lies between 0 and 1, as all tails of an alternating series do.
        let mut sum = Interval::new(0.0, 1.0);
        for k in (0..10).rev() {
            let n = first + 2.0 * f64::from(k);
            // Horner: s = 1 − z/((n+1)(n+2))·s of the later terms.
            sum = point(1.0) - z * (point(n + 1.0) * point(n + 2.0)).recip() * sum;
        }
        sum
    };
    let (sinc, versine) = (series(1.0), point(0.5) * series(2.0));
    let zero = ZERO;
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

    /// Coordinates in B's solid of the points `x` of A's over the times `t`.
    pub fn in_b(&self, x: Vector, t: Interval) -> [Jet; 3] {
        let r_a = product(&turned(self.spin_a, t), &self.a);
        let n = transpose(&product(&product(&turned(self.spin_b, t), &self.b), &self.place_b.0));
        let u = apply(&r_a, plus(apply(&self.place_a.0, x), self.place_a.1));
        let axes = product(&r_a, &self.place_a.0);
        let d = plus(self.d, times(t, self.v0));
        let (o, s) = (self.omega, self.spin_b);
        let back = apply(&transpose(&self.place_b.0), self.place_b.1);
        let y = minus(apply(&n, plus(d, u)), back);
        let rate = apply(&n, plus(minus(self.v0, cross(s, d)), cross(o, u)));
        let pull = plus(
            plus(cross(o, cross(o, u)), cross(cross(o, s), u)),
            minus(cross(s, cross(s, d)), times(point(2.0), cross(s, self.v0))),
        );
        let pull = apply(&n, pull);
        let columns = transpose(&axes);
        let along: [Vector; 3] = columns.map(|c| apply(&n, c));
        let turning: [Vector; 3] = columns.map(|c| apply(&n, cross(o, c)));
        std::array::from_fn(|i| {
            let mut h = [ZERO; 10];
            for k in 0..3 {
                h[place(k, 3)] = turning[k][i];
            }
            h[place(3, 3)] = pull[i];
            Jet { v: y[i], g: [along[0][i], along[1][i], along[2][i], rate[i]], h }
        })
    }
}

/// A's own coordinates.
pub fn in_a(x: Vector) -> [Jet; 3] {
    std::array::from_fn(|i| {
        let mut jet = Jet::constant(x[i]);
        jet.g[i] = point(1.0);
        jet
    })
}
