//! The curve in which the sides of two cones meet, after Miller, and its critical points.
//!
//! Idea: a point of cone A's side is p + s g(θ), g the unit generators. Put into B's implicit form
//! Q(x) = cos²β |x − q|² − (b·(x − q))² it is c2(θ) s² + 2 c1(θ) s + c0 = 0: two points on each generator where the
//! discriminant D = c1² − c2 c0 is positive, one where it is 0 and the generator touches B. c1 and c2 have degree 1 and 2
//! in θ, so D and its derivative have at most four roots each, and so has Q along a rim. The curve's critical points are
//!
//! | where | what |
//! |---|---|
//! | D′ = 0 | the generators that reach deepest into B, or pass it nearest |
//! | D = 0 | where the curve turns back |
//! | Q = 0 on a rim of A, or of B with the parts exchanged | where it leaves a frustum |
//!
//! The sides meet if and only if one of these lies on both frusta: a curve without an end runs around A, and then over the
//! generators with D′ = 0 too. When two sides touch, D's largest value is 0, and the generator there holds the touching
//! point: no difference of nearly equal witnesses is taken.
//! Source: J. R. Miller, Geometric approaches to nonplanar quadric surface intersection curves, ACM TOG 6(4), 1987.
//! Does not promise: to see a curve shorter than rounding.

use super::Round;
use super::trig::Trig;
use contactd::math::any_perpendicular;
use contactd::math::tolerance::CARRIED;
use glam::DVec3;

/// A cone's side, from its apex.
#[derive(Clone, Copy, Debug)]
pub struct Side {
    /// Apex of the whole cone.
    pub apex: DVec3,
    /// Unit axis into the cone.
    pub axis: DVec3,
    /// Sine and cosine of the half angle.
    pub sin: f64,
    /// Cosine of the half angle.
    pub cos: f64,
    /// The frustum's part: distances from the apex along a generator.
    pub slant: [f64; 2],
    e: DVec3,
    f: DVec3,
}

/// A generator of A that is critical for the curve.
#[derive(Clone, Copy, Debug)]
pub struct Generator {
    /// Angle around A's axis.
    pub angle: f64,
    /// Discriminant over the square of the size: negative where it misses B's cone, mirror nappe included.
    pub discriminant: f64,
    /// Its point nearest to B's side, or the middle of what B cuts out of it.
    pub point: DVec3,
    /// True if that point lies on both frusta.
    pub on_both: bool,
}

impl Side {
    /// The side of a cone or frustum; `None` for a cylinder.
    pub fn of(r: &Round) -> Option<Self> {
        if r.lean == 0.0 {
            return None;
        }
        // From the larger disc to where the radius would be 0.
        let (large, small) = if r.lean > 0.0 { (0, 1) } else { (1, 0) };
        let sin = r.lean.abs();
        let cos = (1.0 - sin * sin).sqrt();
        let axis = if r.lean > 0.0 { -r.axis } else { r.axis };
        let apex = r.centers[large] - axis * (r.radii[large] * cos / sin);
        let e = any_perpendicular(axis);
        Some(Self { apex, axis, sin, cos, slant: [r.radii[small] / sin, r.radii[large] / sin], e, f: axis.cross(e) })
    }

    fn generator(&self, angle: f64) -> DVec3 {
        let (s, c) = angle.sin_cos();
        self.axis * self.cos + (self.e * c + self.f * s) * self.sin
    }

    /// Unit normal, out of the cone, along the generator at an angle.
    pub fn normal(&self, angle: f64) -> DVec3 {
        let (s, c) = angle.sin_cos();
        (self.e * c + self.f * s) * self.cos - self.axis * self.sin
    }

    /// n·(unit generator) as a function of the angle.
    fn along(&self, n: DVec3) -> Trig {
        Trig::linear(n.dot(self.axis) * self.cos, n.dot(self.e) * self.sin, n.dot(self.f) * self.sin)
    }

    /// Whether the foot of a point on the side lies on the frustum, give or take `tol`.
    fn spans(&self, x: DVec3, tol: f64) -> bool {
        let z = (x - self.apex).dot(self.axis) / self.cos;
        self.slant[0] - tol <= z && z <= self.slant[1] + tol
    }

    /// The coefficients c2, c1, c0 of Q along the generators.
    fn against(&self, b: &Side) -> (Trig, Trig, f64) {
        let d = self.apex - b.apex;
        let (cos2, h) = (b.cos * b.cos, b.axis.dot(d));
        let g = self.along(b.axis);
        let c2 = Trig::linear(cos2, 0.0, 0.0).plus(-1.0, &g.times(&g));
        let c1 = self.along(d * cos2).plus(-h, &g);
        (c2, c1, cos2 * d.length_squared() - h * h)
    }
}

/// The generators of A that are critical for the curve in which its side meets that of B.
pub fn critical_generators(a: &Side, b: &Side) -> Vec<Generator> {
    let (c2, c1, c0) = a.against(b);
    let discriminant = c1.times(&c1).plus(-c0, &c2);
    let size = a.slant[1].max(b.slant[1]);
    let tol = CARRIED * (size + (a.apex - b.apex).length());
    let mut out = Vec::new();
    let mut take = |angle: f64, least: f64| {
        let value = discriminant.at(angle);
        let s = -c1.at(angle) / c2.at(angle);
        let g = a.generator(angle);
        let mut offer = |s: f64, least: f64| {
            let point = a.apex + g * s;
            let on_both = value >= least && (a.slant[0] - tol..=a.slant[1] + tol).contains(&s) && b.spans(point, tol);
            out.push(Generator { angle, discriminant: value / (size * size), point, on_both });
        };
        if s.is_finite() {
            // Between two crossings the generator is inside B only if it leads out of B's double cone.
            offer(s, if c2.at(angle) > 0.0 || least < 0.0 { least } else { f64::INFINITY });
        }
        if value > 0.0 {
            let root = value.sqrt();
            [-root, root]
                .map(|r| (r - c1.at(angle)) / c2.at(angle))
                .into_iter()
                .filter(|s| s.is_finite())
                .for_each(|s| offer(s, least));
        }
    };
    discriminant.slope().roots(|angle| take(angle, 0.0));
    // There the value is rounding, whatever its sign.
    discriminant.roots(|angle| take(angle, f64::NEG_INFINITY));
    out
}

/// The points in which a rim of A crosses the side of B.
fn on_rims(a: &Side, b: &Side, out: &mut Vec<DVec3>) {
    let (c2, c1, c0) = a.against(b);
    let tol = CARRIED * (a.slant[1] + b.slant[1] + (a.apex - b.apex).length());
    for s in a.slant {
        let q = Trig::linear(c0, 0.0, 0.0).plus(2.0 * s, &c1).plus(s * s, &c2);
        q.roots(|angle| {
            let x = a.apex + a.generator(angle) * s;
            if b.spans(x, tol) {
                out.push(x);
            }
        });
    }
}

/// Critical points of the curve in which two sides meet; none means that the sides do not meet.
pub fn curve(a: &Side, b: &Side) -> Vec<DVec3> {
    let on_curve = |g: &Generator| g.on_both;
    let mut out: Vec<DVec3> = critical_generators(a, b).iter().filter(|g| on_curve(g)).map(|g| g.point).collect();
    on_rims(a, b, &mut out);
    on_rims(b, a, &mut out);
    out
}
