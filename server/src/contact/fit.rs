//! Same-shape fits: one more linear bound where a curved face meets a subtracted one that curves alike.
//!
//! A contact of +psi_p against −psi_q needs |u_p| <= R_p − delta and |u_q| >= R_q + delta, with u = P(x − o), P = I for a
//! sphere and I − aaᵀ for a cylinder, hence, with 2R̄ = R_p + R_q,
//!
//! ```text
//! G = [ |u_p|² − |u_q|² + (R_q + delta)² − (R_p − delta)² ] / (4R̄) <= 0.
//! ```
//!
//! The curvatures cancel in it: ∇G = (u_p − u_q)/(2R̄); what is left of second order in y = x − c is, over 4R̄, nothing or
//! more for a sphere in a sphere or cylinder, −(y·a_p)² for a cylinder in a sphere, (y·a_q)² − (y·a_p)² for cylinders,
//! a product of two extents, one of them small with the axes' angle. A peg in its own hole has G = delta everywhere: one
//! test excludes it.
//!
//! In time only the face on B moves (σ = +1 if that is p). Seen from A, with o the point of its axis nearest to the
//! cell's centre, s = x − o, w the velocity of A against B at o, b = omega×a, z = s·a (0 at the centre):
//!
//! ```text
//! d/dt ½|u|² = u·w + z u·b,
//! d²/dt² ½|u|² = |Pw + zb|² + 2(w·a)(u·b) − (u·b)² + u·s̈ − z u·ä,
//! ```
//!
//! with |s̈| <= C + |spin_A×w|, C = |spin_A×v0| + |omega||spin_B×(o − p_B)|, |w| growing at most C per unit time, and
//! |ä| <= |omega||b| + |spin_A×spin_B|. A spin about the face's own axis enters none of these.

use super::literal::{Linear, Side, View};
use crate::motion::Instant;
use crate::solid::local::LiteralId;
use crate::solid::{Face, Sense};
use glam::DVec3;

/// A round face: centre or point of the axis, axis if it has one, radius; the body's own frame.
fn round(face: &Face) -> Option<(DVec3, Option<DVec3>, f64)> {
    match *face {
        Face::Sphere { center, radius } => Some((center, None, radius)),
        Face::Cylinder { origin, axis, radius } => Some((origin, Some(axis), radius)),
        Face::Plane { .. } | Face::Cone { .. } => None,
    }
}

/// How far radii may differ, relative to their mean, for a fit to be worth a bound.
const SIMILAR: f64 = 0.25;

/// The bound G of a positive literal `p` against a negative literal `q` of the other body, where both are round alike.
pub fn fit(view: &View, (side_p, p): (Side, LiteralId), (side_q, q): (Side, LiteralId)) -> Option<Linear> {
    debug_assert!(side_p != side_q && p.sense() == Sense::Positive && q.sense() == Sense::Negative);
    let (face_p, face_q) = (view.faces(side_p).get(p.face()), view.faces(side_q).get(q.face()));
    if let (Face::Cone { .. }, Face::Cone { .. }) = (face_p, face_q) {
        return cones(view, (side_p, p, face_p), (side_q, q, face_q));
    }
    let (o_p, a_p, r_p) = round(view.faces(side_p).get(p.face()))?;
    let (o_q, a_q, r_q) = round(view.faces(side_q).get(q.face()))?;
    let twice_mean = r_p + r_q;
    if a_p.is_some() && (r_p - r_q).abs() > 0.5 * SIMILAR * twice_mean {
        return None;
    }
    // Along A's axes: offset of the centre from the face's centre or axis, and the axis; how far off the face's own point is.
    let place = |side: Side, o: DVec3, a: Option<DVec3>| {
        let (mut s, mut axis) = match side {
            Side::A => (view.center - o, a),
            Side::B => (view.at.a_vector(view.center_b - o), a.map(|a| view.at.a_vector(a))),
        };
        let arm = s.length();
        if let Some(a) = &mut axis {
            *a = a.normalize();
            s -= *a * s.dot(*a);
        }
        (s, axis, arm)
    };
    let (u_p, a_p, arm_p) = place(side_p, o_p, a_p);
    let (u_q, a_q, arm_q) = place(side_q, o_q, a_q);
    // What rounding may do to u and, times the arm, to an axis; and through them to G over the cell.
    let off = view.rounding + view.motion.rounding.matrix * (arm_p + arm_q + view.radius);
    let lost = off * (1.0 + (u_p.length() + u_q.length() + 2.0 * view.radius) / twice_mean);
    // The quadratic part of |u_p|² − |u_q|² over the cell: (y·a_q)² − (y·a_p)² = (y·(a_q−a_p))(y·(a_q+a_p)).
    let (lean, sum) = match (a_p, a_q) {
        (None, _) => (DVec3::ZERO, DVec3::ZERO),
        (Some(p), Some(q)) if p.dot(q) >= 0.0 => (q - p, q + p),
        (Some(p), Some(q)) => (q + p, q - p),
        (Some(p), None) => (p, p),
    };
    if lean.length() > 2.0 * SIMILAR && a_q.is_some() {
        return None;
    }
    let (delta, e) = (view.delta, view.half);
    let extent = |v: DVec3| v.abs().dot(e);
    let difference = u_p - u_q;
    let g = difference.dot(u_p + u_q) / (2.0 * twice_mean) + 0.5 * (r_q - r_p) + delta;
    let bound = g - extent(lean) * extent(sum) / (2.0 * twice_mean) - lost;
    let cost = (lean.abs() * extent(sum) + sum.abs() * extent(lean)) * e / (2.0 * twice_mean);
    let normal = difference / twice_mean;
    let (sigma, u, axis) = if side_p == Side::B { (1.0, u_p, a_p) } else { (-1.0, u_q, a_q) };
    let m = moving(view, sigma, u, axis, off)?;
    Some(Linear {
        side: side_p,
        id: p,
        other: Some((side_q, q)),
        point: view.center,
        normal,
        bound,
        rate: m.rate / twice_mean,
        turn: m.turn / twice_mean,
        s: m.s / twice_mean,
        q: m.second / twice_mean,
        rigid: false,
        cost,
    })
}

/// Where two like faces meet first when their axes or centres drift apart: on `p` in the direction in which it is off
/// `q`'s axis (or moves off it) at the height of `x`. In A's frame; a start for Newton where the bounds leave the direction
/// open. `None` for a plane.
pub fn first_off_axis(at: &Instant, (side_p, p): (Side, &Face), q: &Face, x: DVec3) -> Option<DVec3> {
    let on_axis = |side: Side, face: &Face| {
        let y = if side == Side::A { x } else { at.b_point(x) };
        let (o, axis, radius) = match *face {
            Face::Sphere { center, radius } => (center, None, radius),
            Face::Cylinder { origin, axis, radius } => (origin, Some(axis), radius),
            Face::Cone { apex, axis, sin, cos } => (apex, Some(axis), (y - apex).dot(axis).max(0.0) * sin / cos),
            Face::Plane { .. } => return None,
        };
        let o = axis.map_or(o, |a| o + a * (y - o).dot(a));
        Some(if side == Side::A { (o, axis, radius) } else { (at.a_point(o), axis.map(|a| at.a_vector(a)), radius) })
    };
    let side_q = if side_p == Side::A { Side::B } else { Side::A };
    let ((o_p, axis, radius), (o_q, ..)) = (on_axis(side_p, p)?, on_axis(side_q, q)?);
    let off = |v: DVec3| axis.map_or(v, |a| v - a * v.dot(a));
    let (apart, way) = (off(o_p - o_q), off(at.velocity(x)) * if side_p == Side::A { 1.0 } else { -1.0 });
    let direction = if apart.length() > 1e-6 * radius { apart } else { way };
    Some(o_p + direction.try_normalize()? * radius)
}

/// The bound of a sphere in a cylinder, its convex part (y·a_q)²/(4R̄) touched at another point `y` of the cell.
pub fn touch(view: &View, fit: &Linear, y: DVec3) -> Option<Linear> {
    let (side_q, q) = fit.other?;
    let (p, q) = (view.faces(fit.side).get(fit.id.face()), view.faces(side_q).get(q.face()));
    let (Face::Sphere { radius: r_p, .. }, Face::Cylinder { axis, radius: r_q, .. }) = (*p, *q) else { return None };
    let axis = if side_q == Side::A { axis } else { view.at.a_vector(axis) };
    let (twice_mean, z) = (r_p + r_q, y.dot(axis));
    let normal = fit.normal + axis * (z / twice_mean);
    // |∇G| is no longer 1 or less: its rounding, and that of z.
    let lost = view.rounding * (z.abs() + 2.0 * view.radius) / twice_mean;
    let bound = fit.bound - z * z / (2.0 * twice_mean) - lost;
    Some(Linear { point: view.center + y, normal, bound, ..*fit })
}

/// The bound of a cone in a cone hole of (nearly) the same angle and direction. With common axis a and angle α,
///
/// ```text
/// ½(psi_p − psi_q) + delta >= ½[ sin α Δ·a − cos α |PΔ| ] + delta,   Δ = o_p − o_q,
/// ```
///
/// at every point; another axis or angle on one of them costs at most |x − o|·(|a' − a|(sin α + cos α) + |α' − α|).
/// a is the axis of A's cone, which stands still; Δ moves with B's apex.
fn cones(
    view: &View,
    (side_p, p, face_p): (Side, LiteralId, &Face),
    (side_q, q, face_q): (Side, LiteralId, &Face),
) -> Option<Linear> {
    let (on_a, on_b) = if side_p == Side::A { (face_p, face_q) } else { (face_q, face_p) };
    let (Face::Cone { apex: o_a, axis: a, sin, cos }, Face::Cone { apex, axis, sin: sin_b, cos: cos_b }) =
        (*on_a, *on_b)
    else {
        return None;
    };
    let o_b = view.center - view.at.a_vector(view.center_b - apex);
    let axis_b = view.at.a_vector(axis);
    let angle = (sin * cos_b - cos * sin_b).abs() * std::f64::consts::FRAC_PI_2; // |α' − α| <= π/2·|sin(α' − α)|
    let lean = (axis_b - a).length();
    if lean > SIMILAR || angle > SIMILAR {
        return None;
    }
    let h = view.motion.h;
    let apex_motion = Travel::of(view, o_b);
    let far = (view.center - o_b).length() + view.radius + h * apex_motion.speed;
    let spin = view.at.omega.length() * lean + view.at.omega.cross(axis_b).length();
    let spin_max = spin + h * view.at.omega.length() * view.at.spin_b.cross(axis_b).length();
    let sign = if side_p == Side::B { 1.0 } else { -1.0 };
    let delta = (o_b - o_a) * sign;
    let across = |v: DVec3| (v - a * v.dot(a)).length();
    let tilt = 0.5 * far * (sin + cos);
    let lost = view.rounding + view.motion.rounding.matrix * 2.0 * far;
    Some(Linear {
        side: side_p,
        id: p,
        other: Some((side_q, q)),
        point: DVec3::ZERO,
        normal: DVec3::ZERO,
        bound: 0.5 * (sin * delta.dot(a) - cos * across(delta)) + view.delta - tilt * lean - 0.5 * far * angle - lost,
        rate: -0.5 * sign * sin * apex_motion.w.dot(a),
        turn: DVec3::ZERO,
        s: 0.5 * cos * across(apex_motion.w) + tilt * spin_max + apex_motion.slip,
        q: 0.5 * (sin + cos) * apex_motion.pull,
        rigid: false,
        cost: view.half * (lean + angle),
    })
}

/// How a point o of B travels as A sees it over the span.
struct Travel {
    /// Velocity of A against B at o.
    w: DVec3,
    /// |w| over the span.
    speed: f64,
    /// C: how fast |w| may grow.
    growth: f64,
    /// |s̈| over the span.
    pull: f64,
    /// What rounding may do to w.
    slip: f64,
}

impl Travel {
    fn of(view: &View, o: DVec3) -> Self {
        let (at, h) = (view.at, view.motion.h);
        let spin_a = at.omega + at.spin_b;
        let arm = o - at.center_a + at.d; // o − p_B
        let w = at.velocity(o);
        let (rate, omega, spin_b) = (view.motion.rounding.rate, at.omega.length(), at.spin_b.length());
        let slip = rate * (at.v0.length() + spin_b * at.d.length() + omega * (o - at.center_a).length());
        let off = rate * spin_a.length() * at.v0.length() + omega * (rate * spin_b * arm.length());
        let growth = spin_a.cross(at.v0).length() + at.omega.length() * at.spin_b.cross(arm).length() + off;
        let pull = growth + spin_a.cross(w).length() + spin_a.length() * (slip + h * growth);
        Self { w, speed: w.length() + slip + h * growth, growth, pull, slip }
    }
}

struct Moving {
    /// d/dt ½σ|u|² at the centre, and its gradient over the cell.
    rate: f64,
    turn: DVec3,
    /// How far the rate's quadratic part over the cell pulls down.
    s: f64,
    /// Bound on how far the second derivative of ½σ|u|² pulls down.
    second: f64,
}

/// `off`: what rounding may do to u.
fn moving(view: &View, sigma: f64, u: DVec3, axis: Option<DVec3>, off: f64) -> Option<Moving> {
    let (at, h, r) = (view.at, view.motion.h, view.radius);
    let (omega, spin_b) = (at.omega, at.spin_b);
    let spin_a = omega + spin_b;
    let Travel { w, speed, growth: c, pull, slip } = Travel::of(view, view.center - u);
    let lost = (u.length() + r) * slip + off * speed;
    let Some(a) = axis else {
        let reach = u.length() + r + h * speed;
        let second = if sigma > 0.0 { reach * pull } else { speed * speed + reach * pull };
        return Some(Moving { rate: sigma * u.dot(w), turn: sigma * w, s: lost, second });
    };
    let b = omega.cross(a);
    let rate = view.motion.rounding.rate;
    let b_max = b.length() + h * omega.length() * spin_b.cross(a).length() + rate * omega.length();
    if h * b_max > 0.5 {
        return None;
    }
    let a_max = omega.length() * b_max + spin_a.cross(spin_b).length() + rate * spin_a.length() * spin_b.length();
    let across = w - a * w.dot(a);
    let across_max =
        across.length() + slip + h * (c + spin_b.cross(a).length() * speed + rate * spin_b.length() * speed);
    // |u| and |z| over cell and span; each feeds the other through the tilt, h·|b| <= 1/2.
    let z = (r + h * (speed + (u.length() + r + h * across_max) * b_max)) * 4.0 / 3.0;
    let reach = u.length() + r + h * (across_max + z * b_max);
    let common = reach * (2.0 * speed * b_max + pull + z * a_max);
    let second = if sigma > 0.0 {
        common + reach * reach * b_max * b_max
    } else {
        common + (across_max + z * b_max) * (across_max + z * b_max)
    };
    let s = a.abs().dot(view.half) * b.abs().dot(view.half) + lost + r * r * rate * omega.length();
    Some(Moving { rate: sigma * u.dot(w), turn: sigma * (across + a * u.dot(b)), s, second })
}
