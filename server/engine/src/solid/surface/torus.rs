//! Torus: psi = hypot(ρ − R, z) − r, the exact distance from a circle less r.
//!
//! It is not convex. With q the point of the circle next to a point c, psi(y) <= |y − q| − r everywhere, a ball's. From below,
//! hypot(ρ − R, z) >= n_ρ (ρ − R) + n_z z for every unit (n_ρ, n_z): with that of c a plane's or a cone's where n_ρ >= 0, which
//! is convex; on the side towards the axis −|n_ρ| ρ bends away as a subtracted cone does, by at most |n_ρ| T²/(2ρ). So each bound
//! is one that holds of a sphere or of a cone, from either side. (Second derivatives: 0 along the normal, 1/s along the
//! meridian, (ρ − R)/(ρ s) around the axis, s = hypot(ρ − R, z); M. do Carmo, Differential Geometry of Curves and Surfaces, 3-3.)
//!
//! With r > R the tube meets itself: psi <= 0 is then all that either side of it holds, without an inner surface.

use super::tube::Tube;
use super::{
    Analytic, Axis, Bend, Curvature, FaceAt, Law, NUMBERS, Row, SKEW, Section, Spine, Stretches, Surface, Symmetry,
    Terms, Under, largest_corner, radial,
};
use crate::math::any_perpendicular;
use crate::solid::surface::Sphere;
use glam::DVec3;
use smallvec::SmallVec;

/// Torus: all points within r of a circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Torus {
    /// Centre of the circle.
    pub origin: DVec3,
    /// Unit normal of its plane.
    pub axis: DVec3,
    /// Radius R of the circle.
    pub major: f64,
    /// Radius r of the tube.
    pub minor: f64,
}

/// Where a point stands in its half-plane through the axis.
struct Meridian {
    /// Distance from the axis.
    rho: f64,
    /// Unit direction away from the axis.
    out: DVec3,
    /// Along the axis.
    z: f64,
    /// Distance from the circle.
    s: f64,
}

impl Meridian {
    /// Components of the unit normal away from and along the axis; away from it on the circle.
    fn normal(&self, major: f64) -> (f64, f64) {
        if self.s > 0.0 { ((self.rho - major) / self.s, self.z / self.s) } else { (1.0, 0.0) }
    }
}

impl Torus {
    fn meridian(&self, x: DVec3) -> Meridian {
        let o = x - self.origin;
        let ((rho, out), z) = (radial(o, self.axis), o.dot(self.axis));
        let d = rho - self.major;
        Meridian { rho, out, z, s: (d * d + z * z).sqrt() }
    }

    /// The ball of the tube around the point of the circle next to a point: psi is nowhere above the ball's.
    fn bead(&self, at: &Meridian) -> Sphere {
        Sphere { center: self.origin + at.out * self.major, radius: self.minor }
    }

    /// How far psi falls below its tangent at the centre of a box of the diagonal 2·`reach` around it, a length.
    fn dip(&self, at: &Meridian, reach: f64) -> f64 {
        let (lean, _) = at.normal(self.major);
        if lean >= 0.0 { 0.0 } else { Under::dip(-lean, at.rho, reach) }
    }

    /// The tube that it is.
    #[inline]
    fn tube(&self) -> Tube {
        Tube { origin: self.origin, axis: self.axis, extent: self.major, radius: self.minor }
    }
}

impl Surface for Torus {
    #[inline]
    fn reach(&self) -> f64 {
        self.origin.length() + self.major + self.minor
    }

    #[inline]
    fn magnitude(&self) -> f64 {
        self.origin.abs().max_element() + self.major + self.minor
    }

    #[inline]
    fn is_convex(&self) -> bool {
        false
    }

    fn value(&self, x: DVec3) -> f64 {
        let o = x - self.origin;
        let z = o.dot(self.axis);
        let d = (o - self.axis * z).length() - self.major;
        (d * d + z * z).sqrt() - self.minor
    }

    fn at(&self, x: DVec3) -> FaceAt {
        let at = self.meridian(x);
        let (lean, up) = at.normal(self.major);
        FaceAt { value: at.s - self.minor, normal: at.out * lean + self.axis * up, slope: 1.0, k: 1.0, rho: at.s }
    }

    fn curvature(&self, x: DVec3, at: &FaceAt) -> Curvature {
        let m = self.meridian(x);
        let each = 1.0 / at.rho;
        let (lean, _) = m.normal(self.major);
        // On the axis there is no curvature around it.
        let around = if m.rho > 0.0 { lean / m.rho - each } else { 0.0 };
        Curvature { each, factor: -each, along: at.normal, other: around, beside: self.axis.cross(m.out) }
    }

    fn under(&self, touched: DVec3, center: DVec3) -> Option<Under> {
        let at = self.meridian(touched);
        let (lean, up) = at.normal(self.major);
        if lean >= 0.0 {
            return None;
        }
        let c = self.meridian(center);
        Some(Under {
            value: lean * (c.rho - self.major) + up * c.z - self.minor,
            normal: c.out * lean + self.axis * up,
            far: self.axis * up,
            k: -lean,
            rho: c.rho,
            axis: self.axis,
            out: c.out,
            beside: None,
        })
    }

    fn turn(&self, x: DVec3, at: &FaceAt, reach: f64) -> f64 {
        let nearest = at.rho.min(self.meridian(x).rho);
        if nearest > reach { reach / (nearest - reach) } else { 2.0 }
    }

    /// Below, the larger of the tangent less what it dips, and the ranges of ρ and z; above, the smaller of these and of the
    /// ball around the nearest point of the circle.
    fn span(&self, center: DVec3, half: DVec3) -> (f64, f64) {
        let at = self.meridian(center);
        let (lean, up) = at.normal(self.major);
        let normal = at.out * lean + self.axis * up;
        let reach = half.length();
        let low = at.s - self.minor - normal.abs().dot(half) - self.dip(&at, reach);
        // ρ and z over the box: ρ changes by no more than a point's way across the axis.
        let along = self.axis.abs().dot(half);
        let across = half.dot((DVec3::ONE - self.axis * self.axis).max(DVec3::ZERO).map(f64::sqrt)).min(reach);
        let gap = ((at.rho - self.major).abs() - across).max(0.0).hypot((at.z.abs() - along).max(0.0));
        let most = ((at.rho - self.major).abs() + across).hypot(at.z.abs() + along);
        let bead = largest_corner(&self.bead(&at), center, half);
        (low.max(gap - self.minor), bead.min(most - self.minor))
    }

    fn bend(&self, x: DVec3, at: &FaceAt) -> Bend {
        let m = self.meridian(x);
        let (lean, _) = m.normal(self.major);
        let t = any_perpendicular(at.normal);
        Bend {
            law: Law::Ring { radius: self.minor, lean: (-lean).max(0.0) },
            radial: (m.rho, m.out),
            tangents: [t, at.normal.cross(t)],
            core: at.rho,
        }
    }

    #[inline]
    fn moved(&self, point: impl Fn(DVec3) -> DVec3, vector: impl Fn(DVec3) -> DVec3) -> Self {
        Self { origin: point(self.origin), axis: vector(self.axis).normalize(), ..*self }
    }

    /// The arc of the circle that is next to the points, by its ends and where its tangents there meet; of an arc that reaches farther than
    /// 63 degrees to a side the square around the circle.
    fn spine(&self, hull: &[DVec3]) -> Option<Spine> {
        let across = |x: &DVec3| (*x - self.origin) - self.axis * (*x - self.origin).dot(self.axis);
        let middle = hull.iter().map(across).sum::<DVec3>().try_normalize();
        let side = middle.map(|m| self.axis.cross(m));
        let arc = middle.zip(side).and_then(|(m, s)| {
            let mut span = (f64::INFINITY, f64::NEG_INFINITY);
            for p in hull.iter().map(across) {
                let (along, beside) = (p.dot(m), p.dot(s));
                if along <= 0.5 * beside.abs() {
                    return None;
                }
                let slope = beside / along;
                span = (span.0.min(slope), span.1.max(slope));
            }
            let at = |slope: f64| (m + s * slope).normalize();
            let (from, to) = (at(span.0), at(span.1));
            let tip = (from + to) / (1.0 + from.dot(to));
            Some([from, to, tip].into_iter().collect::<SmallVec<[DVec3; 4]>>())
        });
        let around = || {
            let u = any_perpendicular(self.axis);
            let v = self.axis.cross(u);
            [u + v, u - v, v - u, -u - v].into_iter().collect()
        };
        let mut points = arc.unwrap_or_else(around);
        points.iter_mut().for_each(|p| *p = self.origin + *p * self.major);
        Some(Spine { points, radius: self.minor })
    }

    #[inline]
    fn symmetry(&self) -> Symmetry {
        Symmetry::Axis(Axis { origin: self.origin, direction: self.axis })
    }

    #[inline]
    fn section(&self, _: DVec3) -> Option<Section> {
        None
    }

    #[inline]
    fn foot(&self, point: DVec3, normal: DVec3, _: f64) -> DVec3 {
        self.bead(&self.meridian(point)).center + normal * self.minor
    }

    #[inline]
    fn above(&self, q: &Self, _: DVec3, _: f64) -> (f64, f64) {
        self.tube().above(&q.tube())
    }

    #[inline]
    fn deviation(&self, other: &Self, _: f64) -> f64 {
        self.tube().deviation(&other.tube())
    }

    #[inline]
    fn key(&self, _: DVec3, _: f64) -> f64 {
        self.origin.dot(SKEW) + self.major + self.minor
    }

    #[inline]
    fn numbers(&self) -> [f64; NUMBERS] {
        let (o, a) = (self.origin, self.axis);
        [o.x, o.y, o.z, a.x, a.y, a.z, self.major, self.minor, 0.0, 0.0, 0.0]
    }

    #[inline]
    fn analytic(&self) -> Option<Analytic> {
        Some(Analytic::Torus(*self))
    }

    /// With t from the ray's point next to the centre and w = |x|² + R² − r²: w² = 4 R² ρ², of degree four.
    fn terms(&self) -> Option<Terms> {
        let (across, along) = Row::of_axis(self.origin, self.axis);
        Some(Terms::Circle { across, along, radius: self.major, tube: self.minor })
    }

    fn inside(&self, origin: DVec3, d: DVec3) -> Stretches {
        let o = origin - self.origin;
        let near = -o.dot(d);
        let p = o + d * near;
        let (z, up, square, r) = (p.dot(self.axis), d.dot(self.axis), p.length_squared(), self.major);
        let w = square + r * r - self.minor * self.minor;
        let four = 4.0 * r * r;
        let coefficients =
            [w * w - four * (square - z * z), 2.0 * four * z * up, 2.0 * w - four * (1.0 - up * up), 0.0, 1.0];
        let end = 1.01 * (self.major + self.minor);
        let mut stops = Stops::new();
        stops.push(-end);
        roots(&coefficients, end, &mut stops);
        stops.push(end);
        let mut found = Stretches::new();
        for w in stops.windows(2) {
            // Between two roots psi keeps its sign, and of a tube that meets itself some are none of its surface.
            if self.value(self.origin + p + d * (0.5 * (w[0] + w[1]))) >= 0.0 {
                continue;
            }
            match found.last_mut() {
                Some(last) if last.1 == w[0] + near => last.1 = w[1] + near,
                _ => found.push((w[0] + near, w[1] + near)),
            }
        }
        found
    }
}

type Stops = smallvec::SmallVec<[f64; 6]>;

/// Appends the roots between −end and end of a polynomial (coefficients from the lowest), ascending; between those of its
/// derivative it has one at most.
fn roots(coefficients: &[f64], end: f64, out: &mut Stops) {
    let value = |t: f64| coefficients.iter().rev().fold(0.0, |v, c| v * t + c);
    let mut stops = Stops::new();
    stops.push(-end);
    if coefficients.len() > 2 {
        let derivative: Stops = coefficients.iter().enumerate().skip(1).map(|(k, c)| c * k as f64).collect();
        roots(&derivative, end, &mut stops);
    }
    stops.push(end);
    for w in stops.windows(2) {
        let (mut low, mut high) = (w[0], w[1]);
        let rises = value(low) < 0.0;
        if rises == (value(high) < 0.0) {
            continue;
        }
        for _ in 0..64 {
            let middle = 0.5 * (low + high);
            if (value(middle) < 0.0) == rises { low = middle } else { high = middle }
        }
        out.push(0.5 * (low + high));
    }
}
