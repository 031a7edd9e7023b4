//! Superellipsoid: psi = s (N(x) − 1), N the norm whose unit ball it is, s its inscribed radius.
//!
//! With y from the centre along the principal axes, a, b, c the semi-axes, p = 2/e₁ and q = 2/e₂:
//!
//! N = ((|y₁/a|^q + |y₂/b|^q)^(p/q) + |y₃/c|^p)^(1/p)
//!
//! (A. Barr, Superquadrics and angle-preserving transformations, IEEE CG&A 1(1), 1981; e₁ shapes it north to south, e₂
//! east to west.) With both exponents 1 it is an ellipsoid, towards 0 a box (both), or a cylinder (e₁ alone). N is a
//! norm wherever p, q >= 1, and psi is convex. For p, q >= 2 it is nowhere larger than the ellipsoid's, so that the
//! nearest points of the surface are those of the shortest semi-axis: s = min(a, b, c), and psi is 1-Lipschitz, a lower
//! bound of the distance that is at most (a² + b² + c²)^½/s times too small.
//!
//! From above: for p, q >= 2 N is 2-uniformly smooth with the constant k = max(p, q) − 1 (K. Ball, E. Carlen, E. Lieb, Sharp uniform
//! convexity and smoothness inequalities for trace norms, 1994; of a norm of norms by the same Hessians). With the gradient g of sN at
//! c, a = g·(x − c) and τ what is left of x − c without its part along the ray through c, for which g·τ = 0,
//!
//! sN(x) <= √((sN(c) + a)² + k |Bτ|²),   B = diag(s/a, s/b, s/c),
//!
//! which is how the length of a vector of three bends: `split` has its rows. It holds far from c, and across the planes in which the
//! curvature vanishes or jumps.
//!
//! For exponents above 1 (p or q below 2) the curvature is infinite all along a plane of symmetry, and no such bound is there: those are
//! refused, and so is what is below `EXPONENTS`, where k exceeds 19: that is a box to within 6 % of its size.
//!
//! Rounding: both norms are taken as m (1 + t^p)^(1/p), t <= 1 the smaller part over the larger one m, so that an error
//! of t or of the power counts in N by no more than it is, whatever p is. The gradient is that of a t that is off by as
//! much.

use super::elliptic::{Stretch, WHOLE, axes_of, moved_turn, turn_of};
use super::{
    Axis, Bend, Curvature, FaceAt, Law, NUMBERS, Section, Stretches, Surface, Symmetry, largest_corner, tangent,
};
use crate::math::any_perpendicular;
use crate::math::halt;
use glam::{DMat3, DVec2, DVec3};

/// Least and largest exponent.
pub const EXPONENTS: [f64; 2] = [0.1, 1.0];

/// Steps of the search for the ends of a stretch of a ray.
const STEPS: usize = 80;

/// The unit ball of a norm, scaled along three axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Superellipsoid {
    /// Centre.
    pub origin: DVec3,
    /// The rotation to its principal axes, as an elliptic face's.
    pub turn: DVec3,
    /// Semi-axes along these, lengths.
    pub semi: DVec3,
    /// e₁ (north to south, along the third axis) and e₂ (east to west).
    pub exponents: DVec2,
}

/// Two lengths under a norm: (a^p + b^p)^(1/p), and its derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Joined {
    /// The norm.
    pub length: f64,
    /// Both over it, 0 to 1; 1 and 0 where both are 0.
    pub parts: [f64; 2],
    /// Its derivatives by them, the parts to the power p − 1.
    pub weights: [f64; 2],
}

impl Joined {
    /// Of two numbers that are not negative, p > 1.
    #[inline]
    pub fn new([a, b]: [f64; 2], p: f64) -> Self {
        if p == 2.0 {
            let length = (a * a + b * b).sqrt();
            let parts = if length > 0.0 { [a / length, b / length] } else { [1.0, 0.0] };
            return Self { length, parts, weights: parts };
        }
        let (large, small) = if a >= b { (a, b) } else { (b, a) };
        if large == 0.0 {
            return Self { length: 0.0, parts: [1.0, 0.0], weights: [1.0, 0.0] };
        }
        // Two powers take as long as many a face.
        halt::work(8);
        let t = small / large;
        let power = libm::pow(t, p);
        let whole = 1.0 + power;
        let more = if whole == 1.0 { 1.0 } else { libm::pow(whole, 1.0 / p) };
        // ((t^p)/t) (1 + t^p)^(1/p − 1), and the same of 1.
        let weight = more / whole;
        let other = if t > 0.0 { power / t * weight } else { 0.0 };
        let (parts, weights) = ([1.0 / more, t / more], [weight, other]);
        let swap = |[x, y]: [f64; 2]| if a >= b { [x, y] } else { [y, x] };
        Self { length: large * more, parts: swap(parts), weights: swap(weights) }
    }

    /// The part of an index to the power p − 2.
    #[inline]
    fn steep(&self, k: usize, p: f64) -> f64 {
        if self.parts[k] > 0.0 {
            self.weights[k] / self.parts[k]
        } else if p == 2.0 {
            1.0
        } else {
            0.0
        }
    }
}

/// What of a superellipsoid around the origin is farthest along m, of any length but 0: how far m·x reaches, and the point. The norm dual to N, with
/// 1/p + 1/p' = 1, and its gradient.
pub fn farthest(semi: DVec3, exponents: DVec2, m: DVec3) -> (f64, DVec3) {
    let [p, q] = exponents.to_array().map(|e| 2.0 / (2.0 - e));
    let v = semi * m.abs();
    let inner = Joined::new([v.x, v.y], q);
    let outer = Joined::new([inner.length, v.z], p);
    let g = DVec3::new(inner.weights[0] * outer.weights[0], inner.weights[1] * outer.weights[0], outer.weights[1]);
    (outer.length, (semi * g) * DVec3::ONE.copysign(m))
}

/// Where a point stands: B y along the principal axes, and both norms of it.
struct Seen {
    rows: [DVec3; 3],
    signs: DVec3,
    inner: Joined,
    outer: Joined,
    powers: [f64; 2],
}

impl Seen {
    /// sN.
    fn length(&self) -> f64 {
        self.outer.length
    }

    /// k.
    fn bends(&self) -> f64 {
        self.powers[0].max(self.powers[1]) - 1.0
    }

    /// Bᵀv.
    fn back(&self, v: DVec3) -> DVec3 {
        self.rows[0] * v.x + self.rows[1] * v.y + self.rows[2] * v.z
    }

    /// The gradient of the norm by B y.
    fn gradient(&self) -> DVec3 {
        let ([a, b], [c, d]) = (self.inner.weights, self.outer.weights);
        DVec3::new(a * c, b * c, d) * self.signs
    }

    /// B y over its norm.
    fn unit(&self) -> DVec3 {
        let ([a, b], [c, d]) = (self.inner.parts, self.outer.parts);
        DVec3::new(a * c, b * c, d) * self.signs
    }

    /// The gradient of sN, and what its square root bends along but for √k: the rows of B for two unit vectors square to the gradient, each without what
    /// it has along the ray.
    fn split(&self) -> [DVec3; 3] {
        let (g, unit) = (self.gradient(), self.unit());
        let n = g.normalize();
        let t = any_perpendicular(n);
        let [one, other] = [t, n.cross(t)].map(|t| self.back(t - g * t.dot(unit)));
        [self.back(g), one, other]
    }

    /// Of a norm of two (u, z) the second derivative is (p − 1) u^(p−2) z^(p−2) N^(1−2p) along (z, −u): two of those.
    fn curvature(&self) -> Curvature {
        let [p, q] = self.powers;
        let (inner, outer, s) = (&self.inner, &self.outer, self.signs);
        let [a, b] = inner.weights;
        let round = outer.steep(0, p) / self.length();
        let up = outer.parts[1] * s.z;
        let along = self.back(DVec3::new(up * a * s.x, up * b * s.y, -outer.parts[0]));
        let beside = self.back(DVec3::new(inner.parts[1] * s.y, -inner.parts[0] * s.x, 0.0));
        let (first, second) = ((p - 1.0) * outer.steep(1, p), (q - 1.0) * inner.steep(0, q) * inner.steep(1, q));
        Curvature {
            each: 0.0,
            factor: round * first * along.length_squared(),
            along: along.normalize_or_zero(),
            other: round * second * beside.length_squared(),
            beside: beside.normalize_or_zero(),
        }
    }
}

impl Superellipsoid {
    /// Around `origin`, with the semi-axes `semi` (lengths) along the columns of a rotation.
    pub fn new(origin: DVec3, axes: DMat3, semi: DVec3, exponents: DVec2) -> Self {
        Self { origin, turn: turn_of(axes.x_axis, axes.y_axis), semi, exponents }
    }

    /// Its principal axes: the rotation that `turn` tells.
    #[inline]
    pub fn axes(&self) -> DMat3 {
        axes_of(self.turn)
    }

    /// The rows of B, and s: a hair smaller than the shortest semi-axis.
    #[inline]
    pub fn parts(&self) -> Stretch {
        let (axes, radius) = (self.axes(), self.semi.min_element() * WHOLE);
        let [x, y, z] = (radius / self.semi).to_array();
        Stretch { rows: [axes.x_axis * x, axes.y_axis * y, axes.z_axis * z], fall: DVec3::ZERO, radius }
    }

    /// p and q.
    #[inline]
    pub fn powers(&self) -> [f64; 2] {
        self.exponents.to_array().map(|e| 2.0 / e)
    }

    /// Of a vector B y.
    fn norms(powers: [f64; 2], v: DVec3) -> [Joined; 2] {
        let v = v.abs();
        let inner = Joined::new([v.x, v.y], powers[1]);
        [inner, Joined::new([inner.length, v.z], powers[0])]
    }

    fn seen(&self, x: DVec3) -> Seen {
        let (parts, powers) = (self.parts(), self.powers());
        let v = parts.of(x - self.origin);
        let [inner, outer] = Self::norms(powers, v);
        Seen { rows: parts.rows, signs: DVec3::ONE.copysign(v), inner, outer, powers }
    }
}

impl Surface for Superellipsoid {
    #[inline]
    fn reach(&self) -> f64 {
        self.origin.length() + self.semi.min_element()
    }

    #[inline]
    fn magnitude(&self) -> f64 {
        self.origin.abs().max_element() + self.semi.min_element()
    }

    fn value(&self, x: DVec3) -> f64 {
        let parts = self.parts();
        let [_, outer] = Self::norms(self.powers(), parts.of(x - self.origin));
        outer.length - parts.radius
    }

    fn at(&self, x: DVec3) -> FaceAt {
        let seen = self.seen(x);
        let normal = seen.back(seen.gradient());
        let value = seen.length() - self.semi.min_element() * WHOLE;
        FaceAt { value, normal, slope: normal.length(), k: seen.bends(), rho: seen.length() }
    }

    fn curvature(&self, x: DVec3, _: &FaceAt) -> Curvature {
        self.seen(x).curvature()
    }

    #[inline]
    fn split(&self, x: DVec3) -> Option<[DVec3; 3]> {
        Some(self.seen(x).split())
    }

    /// Below, the larger of the tangent and of what the coordinates along the axes leave of N, which grows with each; above, the largest value of a corner.
    fn span(&self, center: DVec3, half: DVec3) -> (f64, f64) {
        let (parts, powers) = (self.parts(), self.powers());
        let v = parts.of(center - self.origin).abs();
        let extent = DVec3::from_array(parts.rows.map(|row| row.abs().dot(half)));
        let norm = |v: DVec3| Self::norms(powers, v)[1].length - parts.radius;
        let least = tangent(self, center, half).max(norm((v - extent).max(DVec3::ZERO)));
        let most = norm(v + extent);
        // Along the axes of the box the two are one.
        (least, if self.turn == DVec3::ZERO { most } else { most.min(largest_corner(self, center, half)) })
    }

    /// As `split` has it: of √((sN + a)² + k τ²) nothing lies more than k τ²/(2 (sN + a)) above the tangent.
    fn bend(&self, x: DVec3, _: &FaceAt) -> Bend {
        let seen = self.seen(x);
        let [radial, one, other] = seen.split();
        let by = seen.bends().sqrt();
        Bend {
            law: Law::Saddle { rho: f64::INFINITY, radial: DVec3::ZERO },
            radial: (seen.length(), radial),
            tangents: [one * by, other * by],
            core: f64::INFINITY,
        }
    }

    fn moved(&self, point: impl Fn(DVec3) -> DVec3, vector: impl Fn(DVec3) -> DVec3) -> Self {
        Self { origin: point(self.origin), turn: moved_turn(self.axes(), vector), ..*self }
    }

    #[inline]
    fn symmetry(&self) -> Symmetry {
        Symmetry::None
    }

    /// The diameter to where the plane touches it.
    fn skewer(&self, normal: DVec3) -> Option<Axis> {
        let axes = self.axes();
        let (_, touched) = farthest(self.semi, self.exponents, axes.transpose() * normal);
        Some(Axis { origin: self.origin, direction: (axes * touched).try_normalize()? })
    }

    #[inline]
    fn section(&self, _: DVec3) -> Option<Section> {
        None
    }

    /// On the ray from the centre through the point: all along it the gradient is the same.
    fn foot(&self, point: DVec3, _: DVec3, _: f64) -> DVec3 {
        let far = self.semi.min_element() * WHOLE / self.seen(point).length();
        if far.is_finite() { self.origin + (point - self.origin) * far } else { point }
    }

    /// As an ellipsoid's, which a norm of these exponents is nowhere above.
    fn above(&self, q: &Self, c: DVec3, r: f64) -> (f64, f64) {
        if self.exponents != q.exponents {
            return (f64::NEG_INFINITY, 0.0);
        }
        self.parts().above(self.origin, (&q.parts(), q.origin), c, r)
    }

    /// What psi is off there, as a distance where it is flattest.
    fn deviation(&self, other: &Self, size: f64) -> f64 {
        let (least, _) = self.above(other, self.origin, size);
        let (most, _) = other.above(self, self.origin, size);
        (-least).max(-most).max(0.0) * self.semi.length() / self.semi.min_element()
    }

    /// What psi is in the middle of the ball.
    #[inline]
    fn key(&self, c: DVec3, _: f64) -> f64 {
        self.value(c)
    }

    #[inline]
    fn numbers(&self) -> [f64; NUMBERS] {
        let (o, t, s, e) = (self.origin, self.turn, self.semi, self.exponents);
        [o.x, o.y, o.z, t.x, t.y, t.z, s.x, s.y, s.z, e.x, e.y]
    }

    /// psi is convex along the ray, and positive where a coordinate exceeds its semi-axis.
    fn inside(&self, origin: DVec3, d: DVec3) -> Stretches {
        let (parts, powers) = (self.parts(), self.powers());
        let (o, d) = (parts.of(origin - self.origin), parts.of(d));
        let level = |t: f64| Self::norms(powers, o + d * t)[1].length - parts.radius;
        let slope = |t: f64| {
            let v = o + d * t;
            let [inner, outer] = Self::norms(powers, v);
            Seen { rows: parts.rows, signs: DVec3::ONE.copysign(v), inner, outer, powers }.gradient().dot(d)
        };
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for k in 0..3 {
            let ends = [-1.0, 1.0].map(|side| (side * parts.radius - o[k]) / d[k]);
            if d[k] == 0.0 && o[k].abs() > parts.radius {
                return Stretches::new();
            }
            if d[k] != 0.0 {
                (low, high) = (low.max(ends[0].min(ends[1])), high.min(ends[0].max(ends[1])));
            }
        }
        let Some(inside) = lowest([low, high], level, slope) else { return Stretches::new() };
        let end = |outside: f64| {
            let (mut out, mut within) = (outside, inside);
            for _ in 0..STEPS {
                // Newton's step from outside never passes the end of what is convex.
                let step = out - level(out) / slope(out);
                let middle = 0.5 * (out + within);
                let closer = (step - within).abs() < (out - within).abs() && (step - within) * (out - within) > 0.0;
                let next = if closer { step } else { out };
                if level(middle) < 0.0 {
                    within = middle
                } else {
                    out = middle
                }
                if (next - within).abs() < (out - within).abs() && (next - within) * (out - within) > 0.0 {
                    out = next;
                }
            }
            0.5 * (out + within)
        };
        std::iter::once((end(low), end(high))).collect()
    }
}

/// A point between two at which a convex function is negative, if its slope leads to one.
fn lowest([mut low, mut high]: [f64; 2], level: impl Fn(f64) -> f64, slope: impl Fn(f64) -> f64) -> Option<f64> {
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        if middle.is_nan() || middle <= low || middle >= high {
            return None;
        }
        let (value, rises) = (level(middle), slope(middle));
        if value < 0.0 {
            return Some(middle);
        }
        // Its tangent stays above 0 all the way down.
        let way = if rises > 0.0 { middle - low } else { high - middle };
        if value > rises.abs() * way {
            return None;
        }
        if rises > 0.0 { high = middle } else { low = middle }
    }
    None
}
