//! Superellipsoids from their numbers: psi is s (N(x) − 1), N a norm of a norm. Value, gradient and Hessian over a box.
//!
//! With the parts a = |v₁|/u, b = |v₂|/u, c = u/N, d = |v₃|/N, all between 0 and 1, u the inner norm: the gradient is
//! (a^(q−1) c^(p−1), b^(q−1) c^(p−1), d^(p−1)) with the signs of v, the Hessian
//!
//! ```text
//! ((p − 1) c^(p−2) d^(p−2) m mᵀ + (q − 1) c^(p−2) a^(q−2) b^(q−2) k kᵀ)/N,   m = (d a^(q−1), d b^(q−1), −c),   k = (b, −a, 0)
//! ```
//!
//! Each part grows with its own number and falls with the other, so that its range over a box is that of two corners.

use super::form::{Rows, columns};
use super::interval::{Interval, Jet, Vector, ZERO, linear, offsets, place, point, times};
use contactd::solid::surface;
use glam::DVec3;

/// What powers of numbers up to 1 are off at most: a library's, of an exponent that is off by half a unit in the last place.
const POWER: f64 = 1e-14;

/// Rows of B and s.
pub fn rows(face: &surface::Superellipsoid) -> Rows {
    let axes = columns(face.turn);
    let size = point(face.semi.min_element()) * point(1.0 - 1.0 / (1u64 << 47) as f64);
    (std::array::from_fn(|k| times(size * point(face.semi[k]).recip(), axes[k])), [ZERO; 3], size)
}

fn powers(face: &surface::Superellipsoid) -> [f64; 2] {
    face.exponents.to_array().map(|e| 2.0 / e)
}

/// (x^p + y^p)^(1/p) of two numbers that are not negative, right to `POWER` of itself.
fn joined(x: f64, y: f64, p: f64) -> f64 {
    let (large, small) = (x.max(y), x.min(y));
    if large > 0.0 { large * (1.0 + (small / large).powf(p)).powf(1.0 / p) } else { 0.0 }
}

/// All numbers between two, a little more, from 0 up to 1.
fn within(lo: f64, hi: f64) -> Interval {
    Interval::new((lo - POWER).max(0.0), (hi + POWER).min(1.0))
}

/// A number from 0 to 1 to some power.
fn raised(x: Interval, p: f64) -> Interval {
    if p == 0.0 { point(1.0) } else { within(x.lo.powf(p), x.hi.powf(p)) }
}

/// A number's size.
fn size(x: Interval) -> Interval {
    let crosses = x.lo <= 0.0 && x.hi >= 0.0;
    Interval::new(if crosses { 0.0 } else { x.lo.abs().min(x.hi.abs()) }, x.mag())
}

/// What is not negative with the sign of another number.
fn signed(x: Interval, of: Interval) -> Interval {
    if of.lo >= 0.0 {
        x
    } else if of.hi <= 0.0 {
        -x
    } else {
        Interval::new(-x.hi, x.hi)
    }
}

/// The norm of two sizes, and their parts of it.
fn norm(x: Interval, y: Interval, p: f64) -> (Interval, [Interval; 2]) {
    let length = Interval::new(joined(x.lo, y.lo, p) * (1.0 - POWER), joined(x.hi, y.hi, p) * (1.0 + POWER));
    let part = |own: f64, other: f64, nothing: f64| {
        let length = joined(own, other, p);
        if length > 0.0 { own / length } else { nothing }
    };
    let of = |x: Interval, y: Interval| within(part(x.lo, y.hi, 0.0), part(x.hi, y.lo, 1.0));
    (length, [of(x, y), of(y, x)])
}

/// psi.
pub fn psi(face: &surface::Superellipsoid, y: &[Jet; 3]) -> Jet {
    let ((rows, _, radius), [p, q]) = (rows(face), powers(face));
    let o = offsets(y, face.origin);
    let v = rows.map(|row| linear(row, &o));
    let of = v.map(|v| v.v);
    let (inner, [a, b]) = norm(size(of[0]), size(of[1]), q);
    let (length, [c, d]) = norm(inner, size(of[2]), p);
    let round = raised(c, p - 1.0);
    let [own_a, own_b] = [signed(raised(a, q - 1.0), of[0]), signed(raised(b, q - 1.0), of[1])];
    let gradient = [own_a * round, own_b * round, signed(raised(d, p - 1.0), of[2])];
    let per = length.recip() * raised(c, p - 2.0);
    let up = signed(d, of[2]);
    let m = [up * own_a, up * own_b, -c];
    let k = [signed(b, of[1]), -signed(a, of[0]), ZERO];
    let first = per * point(p - 1.0) * raised(d, p - 2.0);
    let second = per * point(q - 1.0) * raised(a, q - 2.0) * raised(b, q - 2.0);
    let product = |w: &Vector, i: usize, j: usize| if i == j { w[i].square() } else { w[i] * w[j] };
    let bends = |i: usize, j: usize| first * product(&m, i, j) + second * product(&k, i, j);
    let mut jet = Jet::constant(length - radius);
    for i in 0..4 {
        jet.g[i] = (0..3).fold(ZERO, |sum, n| sum + gradient[n] * v[n].g[i]);
        for j in i..4 {
            let mut h = (0..3).fold(ZERO, |sum, n| sum + gradient[n] * v[n].h[place(i, j)]);
            for n in 0..3 {
                for l in 0..3 {
                    let both = if n == l && i == j { v[n].g[i].square() } else { v[n].g[i] * v[l].g[j] };
                    h = h + bends(n, l) * both;
                }
            }
            jet.h[place(i, j)] = h;
        }
    }
    jet
}

/// A plane below psi: N(v) >= g·v for every g of a dual norm up to 1, here the gradient at a place.
pub fn touched(face: &surface::Superellipsoid, at: DVec3, y: &[Jet; 3]) -> Jet {
    let ((rows, _, radius), [p, q]) = (rows(face), powers(face));
    let middle = |row: Vector| DVec3::from_array(row.map(|x| 0.5 * (x.lo + x.hi))).dot(at - face.origin);
    let v = DVec3::from_array(rows.map(middle));
    let inner = joined(v.x.abs(), v.y.abs(), q);
    let length = joined(inner, v.z.abs(), p);
    let part = |x: f64, of: f64, p: f64| if of > 0.0 { (x.abs() / of).powf(p - 1.0) } else { 0.0 };
    let round = part(inner, length, p);
    // In the centre all of these are gradients: the one that is told there is that along the first axis.
    let g = if length > 0.0 {
        DVec3::new(part(v.x, inner, q) * round, part(v.y, inner, q) * round, part(v.z, length, p))
    } else {
        DVec3::X
    };
    let g = g * DVec3::ONE.copysign(v) / (dual(face, g) * (1.0 + 1e-13)).max(1.0 + 1e-13);
    let o = offsets(y, face.origin);
    let along: [Jet; 3] = std::array::from_fn(|k| linear(rows[k], &o).scaled(point(g[k])));
    (along[0] + along[1] + along[2]).plus(-radius)
}

/// The dual norm of a vector, with the exponents that 1/p + 1/p' = 1 gives.
fn dual(face: &surface::Superellipsoid, g: DVec3) -> f64 {
    let [p, q] = face.exponents.to_array().map(|e| 2.0 / (2.0 - e));
    joined(joined(g.x.abs(), g.y.abs(), q), g.z.abs(), p)
}

/// How far a superellipsoid around the origin reaches along n, from above.
pub fn reach(semi: DVec3, exponents: glam::DVec2, n: Vector) -> Interval {
    let face = surface::Superellipsoid { origin: DVec3::ZERO, turn: DVec3::ZERO, semi, exponents };
    let most = DVec3::from_array(n.map(Interval::mag)) * semi;
    point(dual(&face, most) * (1.0 + 1e-12))
}
