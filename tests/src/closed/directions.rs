//! Directions in which two features of convex bodies can separate them: the closed forms all pairs are made of.
//!
//! Idea: the signed separation of two convex bodies is the maximum over unit n of
//! s(n) = min over B of n·y − max over A of n·x. Every n gives a proven lower bound, so a superfluous candidate does no
//! harm; the maximiser lies in the normal sets of one feature on each side:
//!
//! | feature | its normals |
//! |---|---|
//! | cap, facet | one |
//! | side (cylinder, cone), straight edge | a circle n·a = c on the sphere of directions |
//! | vertex, centre of a ball | all, support p·n |
//! | rim | all, support c·n + r\|n − a(a·n)\| |
//!
//! Two normal circles meet in two directions: side against side, edge against edge, cone against cone need no search.
//! A circle against a point is a perpendicular. A circle against a rim is one angle, a rim against a rim is Newton on
//! the sphere, where s is concave wherever it is positive.
//! Source: support functions after Schneider, Convex Bodies, 1.7. These common normals are the critical points that
//! Miller (1987) evaluates after substituting one cone's parametric form into the other's implicit form; stated in
//! directions they stay well conditioned when the bodies touch, where the difference of the witnesses vanishes.
//! Does not promise: to find the global maximum for bodies that overlap deeply.

use contactd::math::any_perpendicular;
use glam::DVec3;
use std::f64::consts::TAU;

/// A ruled feature: normals n·axis = lean, support n·point + radius for these.
#[derive(Clone, Copy, Debug)]
pub struct Ruled {
    /// A point of the line, or the foot from which the support is measured.
    pub point: DVec3,
    /// Unit direction.
    pub axis: DVec3,
    /// Component of the outward normals along the axis.
    pub lean: f64,
    /// Offset of the support.
    pub radius: f64,
}

impl Ruled {
    /// The same feature with its normals turned round: as the far body shows it along n from a to b.
    pub fn far(&self) -> Self {
        Self { lean: -self.lean, ..*self }
    }
}

/// A rim.
#[derive(Clone, Copy, Debug)]
pub struct Rim {
    /// Centre.
    pub center: DVec3,
    /// Unit normal of its plane.
    pub axis: DVec3,
    /// Radius.
    pub radius: f64,
}

impl Rim {
    /// The point of the rim that lies farthest along n; any where all do.
    pub fn farthest(&self, n: DVec3) -> DVec3 {
        let u = (n - self.axis * n.dot(self.axis)).try_normalize().unwrap_or_else(|| any_perpendicular(self.axis));
        // A short n across the axis is rounding mostly: made square to it once more.
        let u = (u - self.axis * u.dot(self.axis)).normalize();
        self.center + u * self.radius
    }
}

/// Normals that two circles of directions have in common: none, or two; the perpendicular of the lines' difference
/// where the axes are parallel. `b` as seen by `Ruled::far`.
pub fn ruled_ruled(a: &Ruled, b: &Ruled, out: &mut Vec<DVec3>) {
    let w = a.axis.cross(b.axis);
    let sin2 = w.length_squared();
    if sin2 > 1e-24 {
        let cos = a.axis.dot(b.axis);
        // In the plane of the axes, then out of it both ways.
        let flat = (a.axis * (a.lean - b.lean * cos) + b.axis * (b.lean - a.lean * cos)) / sin2;
        let rest = 1.0 - flat.length_squared();
        if rest >= -1e-12 {
            let up = w * (rest.max(0.0) / sin2).sqrt();
            out.extend([(flat + up).normalize_or_zero(), (flat - up).normalize_or_zero()]);
        }
    }
    if sin2 < 1e-8 {
        ruled_point(a, b.point, out);
    }
}

/// The two normals of a ruled feature whose plane holds `p`.
pub fn ruled_point(a: &Ruled, p: DVec3, out: &mut Vec<DVec3>) {
    let o = p - a.point;
    let u = (o - a.axis * o.dot(a.axis)).try_normalize().unwrap_or_else(|| any_perpendicular(a.axis));
    let cos = (1.0 - a.lean * a.lean).sqrt();
    out.extend([a.axis * a.lean + u * cos, a.axis * a.lean - u * cos]);
}

/// Directions between a point and a rim: through its nearest and its farthest point. `flip` −1 if the rim is the far
/// body's own, +1 if the point is.
pub fn rim_point(rim: &Rim, p: DVec3, flip: f64, out: &mut Vec<DVec3>) {
    let o = p - rim.center;
    let z = o.dot(rim.axis);
    let u = (o - rim.axis * z).try_normalize().unwrap_or_else(|| any_perpendicular(rim.axis));
    for s in [1.0, -1.0] {
        out.extend(((o - u * (rim.radius * s)) * flip).try_normalize());
    }
}

/// Normals of a ruled feature at which it separates best from a rim of the other body: the maxima over the one angle
/// of the normal circle. `sign` +1: the ruled feature is a's, −1: it is b's (then n runs the other way).
pub fn ruled_rim(a: &Ruled, rim: &Rim, sign: f64, out: &mut Vec<DVec3>) {
    let e = any_perpendicular(a.axis);
    let f = a.axis.cross(e);
    let cos = (1.0 - a.lean * a.lean).sqrt();
    let normal = |phi: f64| {
        let (s, c) = phi.sin_cos();
        (a.axis * a.lean + (e * c + f * s) * cos, (f * c - e * s) * cos)
    };
    // With m the ruled feature's own outward normal: s = m·(center − point) − radii, whichever body it belongs to.
    let d = rim.center - a.point;
    let slope = |phi: f64| {
        let (n, dn) = normal(phi);
        let p = n - rim.axis * n.dot(rim.axis);
        d.dot(dn) - rim.radius * p.dot(dn) / p.length().max(f64::MIN_POSITIVE)
    };
    const STEPS: usize = 48;
    let at = |k: usize| TAU * (k as f64 + 0.37) / STEPS as f64;
    let mut before = slope(at(0));
    for k in 0..STEPS {
        let (mut lo, mut hi) = (at(k), at(k + 1));
        let after = slope(hi);
        if before > 0.0 && after <= 0.0 {
            for _ in 0..50 {
                let mid = 0.5 * (lo + hi);
                if slope(mid) > 0.0 { lo = mid } else { hi = mid }
            }
            out.push(normal(0.5 * (lo + hi)).0 * sign);
        }
        before = after;
    }
}

/// Direction from a's rim to b's at which they separate best, by Newton's method on the sphere from `start`.
pub fn rim_rim(a: &Rim, b: &Rim, start: DVec3) -> DVec3 {
    let d = b.center - a.center;
    let value = |n: DVec3| {
        let pa = n - a.axis * n.dot(a.axis);
        let pb = n - b.axis * n.dot(b.axis);
        d.dot(n) - a.radius * pa.length() - b.radius * pb.length()
    };
    let mut n = start;
    let mut s = value(n);
    for _ in 0..60 {
        let mut gradient = d;
        let e = any_perpendicular(n);
        let f = n.cross(e);
        let (mut ee, mut ef, mut ff) = (-s, 0.0, -s);
        for rim in [a, b] {
            let p = n - rim.axis * n.dot(rim.axis);
            let len = p.length().max(1e-300);
            gradient -= p * (rim.radius / len);
            let t = rim.axis.cross(p / len);
            let k = rim.radius / len;
            let (te, tf) = (t.dot(e), t.dot(f));
            ee -= k * te * te;
            ef -= k * te * tf;
            ff -= k * tf * tf;
        }
        let (ge, gf) = (gradient.dot(e), gradient.dot(f));
        // Shifted until it is negative definite: then the step climbs.
        let mean = 0.5 * (ee + ff);
        let top = mean + (0.5 * (ee - ff)).hypot(ef);
        let size = a.radius + b.radius;
        let shift = (top + 1e-9 * size).max(0.0);
        let (ee, ff) = (ee - shift, ff - shift);
        let det = ee * ff - ef * ef;
        let (mut x, mut y) = (-(ff * ge - ef * gf) / det, -(ee * gf - ef * ge) / det);
        let len = x.hypot(y);
        if !len.is_finite() || len < 1e-15 {
            break;
        }
        if len > 0.5 {
            (x, y) = (x * 0.5 / len, y * 0.5 / len);
        }
        let mut better = None;
        for _ in 0..30 {
            let m = (n + e * x + f * y).normalize();
            let v = value(m);
            if v > s {
                better = Some((m, v));
                break;
            }
            (x, y) = (0.5 * x, 0.5 * y);
        }
        let Some((m, v)) = better else { break };
        (n, s) = (m, v);
    }
    n
}
