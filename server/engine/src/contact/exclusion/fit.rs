//! Same-shape fits: one more linear bound where a curved face meets a subtracted one that curves alike.
//!
//! Every round face is a quadric: with s = x − o, z = s·a and u = s − z a (a sphere has no axis: u = s),
//!
//! ```text
//! Q = |u|² − ρ²,   ρ = R for a sphere or cylinder, ρ = z tan α for a cone with its apex in o.
//! ```
//!
//! A contact of +psi_p against −psi_q at depth delta needs Q_p <= 0 with R_p − delta, or the apex moved inwards by delta/sin α,
//! and Q_q >= 0 with R_q + delta, or the apex moved outwards (where z_q >= 0, which is asked of the whole cell), hence
//!
//! ```text
//! G = μ_p Q_p − μ_q Q_q <= 0 for any μ > 0; here both 1/2(ρ_p + ρ_q), or cos α_p/4ρ_p and cos α_q/4ρ_q.
//! ```
//!
//! Even weights let what is round about a common axis cancel wholly; with the others the two gradients cancel where the
//! faces touch off the axis. Of second order in y = x − c remains yᵀMy, M = (μ_p − μ_q) I + μ_q b_q b_qᵀ − μ_p b_p b_pᵀ, b = a/cos α (0 for a sphere). That is
//! convex but for how the axes lean: its convex part is touched like a convex face, what pulls down is bounded over the cell
//! as a product of two extents, one of them small with the lean, or along the one direction of a negative eigenvalue. A peg
//! in its own hole has G = delta everywhere: one test excludes it.
//!
//! In time only the face on B moves (σ = +1 if that is p). Seen from A, with o the point of its axis nearest to the
//! cell's centre, s = x − o, w the velocity of A against B at o, b = omega×a, z = s·a (0 at the centre), z_o the height of o
//! over the apex and ζ = z_o + z:
//!
//! ```text
//! d/dt ½|u|² = u·w + z u·b,
//! d²/dt² ½|u|² = |Pw + zb|² + 2(w·a)(u·b) − (u·b)² + u·s̈ − z u·ä,
//! d/dt ½ζ² = ζ ζ̇,   ζ̇ = w·a − u·b,   ζ̈ = s̈·a − 2w·b + s·ä,
//! ```
//!
//! with |s̈| <= C + |spin_A×w|, C = |spin_A×v0| + |omega||spin_B×(o − p_B)|, |w| growing at most C per unit time, and
//! |ä| <= |omega||b| + |spin_A×spin_B|. A spin about the face's own axis enters none of these.

use super::literal::{Linear, Side, View};
use crate::motion::Instant;
use crate::solid::local::LiteralId;
use crate::solid::surface::{Apex, Quadric, Section, Symmetry};
use crate::solid::{Face, Sense};
use glam::{DMat3, DVec3};

/// The quadric of a round face of a contact at depth delta; the body's own frame.
fn quadric(face: &Face, sense: Sense, delta: f64) -> Option<Quadric> {
    // What a contact needs: positive faces shrink, subtracted ones grow.
    face.quadric(if sense == Sense::Positive { delta } else { -delta })
}

/// A round face about a cell, along A's axes.
#[derive(Clone, Copy, Debug)]
struct Around {
    u: DVec3,
    axis: Option<DVec3>,
    z: f64,
    /// Distance of the face's own point.
    arm: f64,
    rho: f64,
    slope: f64,
    /// b: the quadric's second-order part is |y|² − (y·b)².
    bend: DVec3,
}

impl Around {
    /// A quadric round a cell, along A's axes: u at the cell's centre, the axis, the height of the centre, ρ there.
    fn of(q: &Quadric, view: &View, side: Side) -> Self {
        let (mut u, mut axis) = match side {
            Side::A => (view.center - q.origin, q.axis),
            Side::B => (view.at.a_vector(view.center_b - q.origin), q.axis.map(|a| view.at.a_vector(a))),
        };
        let (mut z, arm) = (0.0, u.length());
        if let Some(a) = &mut axis {
            *a = a.normalize();
            z = u.dot(*a);
            u -= *a * z;
        }
        let bend = axis.map_or(DVec3::ZERO, |a| a * (1.0 + q.slope * q.slope).sqrt());
        Self { u, axis, z, arm, rho: q.radius + q.slope * z, slope: q.slope, bend }
    }

    /// Q at the cell's centre.
    fn value(&self) -> f64 {
        self.u.length_squared() - self.rho * self.rho
    }

    /// Half its gradient there.
    fn slope_of(&self) -> DVec3 {
        self.u - self.axis.map_or(DVec3::ZERO, |a| a * (self.slope * self.rho))
    }
}

/// What all fits of one literal have in common.
#[derive(Clone, Copy, Debug)]
pub struct Fitted {
    side: Side,
    id: LiteralId,
    /// The literal's face, or a simpler one that is the same all over the cell for the whole span.
    face: Face,
    /// Its quadric about the cell; `None` of a cone that is fitted by its tip alone.
    around: Option<Around>,
    /// How a point of the quadric's axis travels, of a face of B.
    travel: Option<Travel>,
}

impl Fitted {
    /// `None` for a literal that fits nothing.
    pub fn of(view: &View, side: Side, id: LiteralId) -> Option<Self> {
        if view.faces(side).get(id.face()).is_flat() {
            return None;
        }
        let face = view.face(side, id);
        let around = quadric(&face, id.sense(), view.delta)
            .filter(|q| view.curved || q.slope == 0.0)
            .map(|q| Around::of(&q, view, side));
        if around.is_none() && face.apex().is_none() {
            return None;
        }
        let travel = around.filter(|_| side == Side::B).map(|f| Travel::of(view, view.center - f.u));
        Some(Self { side, id, face, around, travel })
    }

    fn key(&self) -> (Side, LiteralId) {
        (self.side, self.id)
    }
}

/// Difference of two cones' axes, or angles in radians, up to which a bound by their tips is worth it.
const SIMILAR: f64 = 0.25;

/// Share of a literal's rounding that the fit of two faces of one body does not have.
const SPARED: f64 = 0.9;

/// Sine of the angle between two axes up to which a fit is worth a bound.
const LEAN: f64 = 0.5;

/// The second-order part yᵀMy of a fit: a convex part C, and how far the rest pulls down over the cell.
struct Bend {
    convex: DMat3,
    remainder: f64,
    /// What each half extent costs.
    cost: DVec3,
}

impl Bend {
    fn of(p: &Around, q: &Around, [mu_p, mu_q]: [f64; 2], half: DVec3, curved: bool) -> Self {
        let extent = |v: DVec3| v.abs().dot(half);
        let outer = |v: DVec3, k: f64| DMat3::from_cols(v * (v.x * k), v * (v.y * k), v * (v.z * k));
        let spare = mu_p - mu_q;
        // (y·c_q)² − (y·c_p)² = (y·l)(y·m), what is spare of |y|² kept across p's axis.
        let across = DMat3::IDENTITY * spare - p.axis.map_or(DMat3::ZERO, |a| outer(a, spare));
        let c_p = p.axis.map_or(DVec3::ZERO, |a| a * (mu_p * p.bend.length_squared() - spare).max(0.0).sqrt());
        let c_q = q.bend * mu_q.sqrt();
        let flip = if c_p.dot(c_q) < 0.0 { -1.0 } else { 1.0 };
        let (l, m) = (c_q - c_p * flip, c_q + c_p * flip);
        let kappa = if m == DVec3::ZERO { 0.0 } else { l.dot(m) / m.length_squared() };
        let rest = l - m * kappa;
        let mut best = if kappa >= 0.0 {
            let cost = (rest.abs() * extent(m) + m.abs() * extent(rest)) * half;
            Self { convex: across + outer(m, kappa), remainder: extent(rest) * extent(m), cost }
        } else {
            let remainder = (extent(l) * extent(m)).min(extent(rest) * extent(m) - kappa * extent(m) * extent(m));
            Self { convex: across, remainder, cost: (l.abs() * extent(m) + m.abs() * extent(l)) * half }
        };
        if let (Some(a_p), Some(a_q), true) = (p.axis, q.axis, curved)
            && let Some(f) = a_q.cross(a_p.cross(a_q)).try_normalize()
        {
            // By cross products: of axes that lean by 1e-8 a difference keeps half its digits, and the lean is lost in what it has
            // along `a_q`.
            // In the plane of both axes M has at most one negative eigenvalue; across it, it is `spare`.
            let (along, aside) = (p.bend.dot(a_q), p.bend.length() * a_p.cross(a_q).length());
            let m11 = spare + mu_q * q.bend.length_squared() - mu_p * along * along;
            let (m12, m22) = (-mu_p * along * aside, spare - mu_p * aside * aside);
            let (mean, root) = (0.5 * (m11 + m22), (0.25 * (m11 - m22) * (m11 - m22) + m12 * m12).sqrt());
            let least = mean - root;
            let e = if (m11 - least).abs() > (m22 - least).abs() {
                a_q * m12 - f * (m11 - least)
            } else {
                f * m12 - a_q * (m22 - least)
            };
            let e = e.normalize_or_zero();
            let pull = (-least).max(0.0);
            let lost = 16.0 * f64::EPSILON * (mu_p * p.bend.length_squared() + mu_q * q.bend.length_squared());
            let remainder = pull * extent(e) * extent(e) + lost * half.length_squared();
            if remainder < best.remainder {
                let whole = DMat3::IDENTITY * spare + outer(q.bend, mu_q) - outer(p.bend, mu_p);
                best =
                    Self { convex: whole + outer(e, pull), remainder, cost: e.abs() * half * (2.0 * pull * extent(e)) };
            }
        }
        let diagonal = DVec3::new(best.convex.x_axis.x, best.convex.y_axis.y, best.convex.z_axis.z);
        best.cost += diagonal.max(DVec3::ZERO) * half * half;
        best
    }
}

/// The weights of the two quadrics: even, so that what is round about a common axis cancels wholly, or as steep as each
/// other (|∇Q| = 2ρ/cos α), so that a contact off the axis is the lowest point of G.
fn weights(p: &Around, q: &Around, even: bool) -> [f64; 2] {
    if even {
        return [0.5 / (p.rho.max(0.0) + q.rho); 2];
    }
    let [of_p, of_q] = [p, q].map(|f| 0.25 / (f.rho * (1.0 + f.slope * f.slope).sqrt()));
    [if p.rho > 0.0 { of_p.clamp(of_q, 4.0 * of_q) } else { of_q }, of_q]
}

/// The convex part of a fit's second order, for tangents at other points.
#[derive(Clone, Copy, Debug)]
pub struct Touchable {
    convex: DMat3,
    /// How steep the two quadrics are at most, weighed.
    steep: f64,
}

impl Touchable {
    /// Where a·y + yᵀCy is lowest over a cell, about: the lowest point of all, or what the axes lead to from there one after the
    /// other.
    pub fn lowest(&self, a: DVec3, half: DVec3) -> DVec3 {
        let c = &self.convex;
        let free = c.inverse() * a * -0.5;
        let mut y = if free.is_finite() { free.clamp(-half, half) } else { DVec3::ZERO };
        if y == free {
            return y;
        }
        for _ in 0..SWEEPS {
            for k in 0..3 {
                let bends = 2.0 * c.col(k)[k];
                let slope = a[k] + 2.0 * c.row(k).dot(y) - bends * y[k];
                let lowest = if bends > 0.0 { -slope / bends } else { -slope.signum() * half[k] };
                y[k] = lowest.clamp(-half[k], half[k]);
            }
        }
        y
    }
}

/// Sweeps over the axes in search of where a fit is lowest.
const SWEEPS: usize = 4;

/// A fit's bound, and what it is touched by at other points; `None` for cones taken by their tips, and within one body.
pub type Fit = (Linear, Option<Touchable>);

/// The bounds G of a positive literal `p` against a negative literal `q` of the other body, where both are round alike.
pub fn fit(view: &View, p: &Fitted, q: &Fitted) -> impl Iterator<Item = Fit> {
    debug_assert!(p.side != q.side && p.id.sense() == Sense::Positive && q.id.sense() == Sense::Negative);
    let even = quadrics(view, p, q, true);
    // Radii alike to a hundredth bend alike: one bound will do.
    let steep = even
        .filter(|_| view.curved)
        .and_then(|_| quadrics(view, p, q, false))
        .filter(|(l, _)| l.weights.is_some_and(|[p, q]| p > 1.01 * q));
    let tips = if even.is_none() { cones(view, (p.side, p.id, &p.face), (q.side, q.id, &q.face)) } else { None };
    [even, steep, tips.map(|l| (l, None))].into_iter().flatten()
}

/// The bound G of a positive and a negative literal of one body, where both are round alike and near each other: two sides of
/// a thin wall, or of a crescent. With even weights it is next to linear, and moves with its body as a plane does.
pub fn within(view: &View, side: Side, p: LiteralId, q: LiteralId) -> Option<Linear> {
    let (face_p, face_q) = (view.face(side, p), view.face(side, q));
    let (round_p, round_q) =
        (quadric(&face_p, Sense::Positive, view.delta)?, quadric(&face_q, Sense::Negative, view.delta)?);
    if !view.curved && (round_p.slope > 0.0 || round_q.slope > 0.0) {
        return None;
    }
    let (at_p, at_q) = (Around::of(&round_p, view, side), Around::of(&round_q, view, side));
    let way = if side == Side::B { view.motion.speed * view.motion.h } else { 0.0 };
    if !fits(view, &at_p, &at_q, way) {
        return None;
    }
    let mu = weights(&at_p, &at_q, true);
    // What stays curved moves with the cell over a body of its own: bounded wherever that takes it in the span.
    let bend = Bend::of(&at_p, &at_q, mu, view.half + DVec3::splat(way), view.curved);
    let off = view.rounding + view.motion.rounding.matrix * (at_p.arm + at_q.arm + view.radius);
    let normal = 2.0 * (at_p.slope_of() * mu[0] - at_q.slope_of() * mu[1]);
    // Where the body is shifts both alike: what stays is what rounding does to each offset, and to the squares. The
    // clause takes a literal's whole rounding off, of which only the sums' share is this one's.
    let each = |f: &Around, mu: f64| {
        let arm = f.arm + f.u.length() + view.radius;
        mu * f64::EPSILON * (32.0 * (1.0 + f.slope) * (f.u.length() + f.slope * f.rho.abs()) * arm + 8.0 * arm * arm)
    };
    let reach = (round_p.origin.length() + round_q.origin.length()) * 2.0 * f64::EPSILON;
    let lost = each(&at_p, mu[0]) + each(&at_q, mu[1]) + reach + 2.0 * off * normal.length() - SPARED * view.rounding;
    let bound = at_p.value() * mu[0] - at_q.value() * mu[1] - bend.remainder - lost;
    let plane = view.plane(side, p, normal, bound);
    let fit = Linear { other: Some((side, q)), weights: Some(mu), point: view.center, cost: bend.cost, ..plane };
    Some(fit).filter(|l| l.normal.length() <= 1.0)
}

/// True where two round faces may have a fit; `way` is how far a subtracted one may move in the span.
fn fits(view: &View, p: &Around, q: &Around, way: f64) -> bool {
    // Where coordinates near the end of the numbers have no differences left there is no fit; nor round nothing.
    if !(p.rho.is_finite() && q.rho.is_finite() && q.rho > 0.0) {
        return false;
    }
    if q.slope > 0.0 && q.z <= view.radius + way {
        return false;
    }
    !matches!((p.axis, q.axis), (Some(a), Some(b)) if a.cross(b).length() > LEAN)
}

fn quadrics(view: &View, p: &Fitted, q: &Fitted, even: bool) -> Option<Fit> {
    let (at_p, at_q) = (p.around.as_ref()?, q.around.as_ref()?);
    let way = if q.side == Side::B { view.motion.speed * view.motion.h } else { 0.0 };
    if !fits(view, at_p, at_q, way) {
        return None;
    }
    let mu = weights(at_p, at_q, even);
    let bend = Bend::of(at_p, at_q, mu, view.half, view.curved);
    let (sigma, mu_b, moved) = if p.side == Side::B { (1.0, mu[0], p) } else { (-1.0, mu[1], q) };
    // What rounding may do to u and z and, times the arm, to an axis; and through them to G over the cell.
    let off = view.rounding + view.motion.rounding.matrix * (at_p.arm + at_q.arm + view.radius);
    let gradient = |f: &Around| (1.0 + f.slope * f.slope) * (f.u.length() + f.rho.abs() + 2.0 * view.radius);
    let lost = off * (1.0 + 4.0 * (mu[0] * gradient(at_p) + mu[1] * gradient(at_q)));
    let normal = 2.0 * (at_p.slope_of() * mu[0] - at_q.slope_of() * mu[1]);
    let m = moving(view, sigma, (moved.around.as_ref()?, moved.travel.as_ref()?), off)?;
    let twice = 2.0 * mu_b;
    let fit = Linear {
        side: p.side,
        id: p.id,
        other: Some(q.key()),
        weights: Some(mu),
        point: view.center,
        normal,
        bound: at_p.value() * mu[0] - at_q.value() * mu[1] - bend.remainder - lost,
        rate: m.rate * twice,
        turn: m.turn * twice,
        s: m.s * twice,
        q: m.second * twice,
        rigid: false,
        cost: bend.cost,
    };
    let steep = (1.0 + at_p.slope * at_p.slope) * mu[0] + (1.0 + at_q.slope * at_q.slope) * mu[1];
    let touchable = (view.curved || p.face.ball().is_some()).then_some(Touchable { convex: bend.convex, steep });
    Some((fit, touchable))
}

/// How much faster than everything else a round face must spin about its own axis for a bound of its own.
const SPINS: f64 = 8.0;

/// The quadric of one round face of B, where that spins about its own axis more than it moves: with μ_p = 0 or μ_q = 0 what is
/// left of G needs Q_p <= 0 or −Q_q <= 0 at a contact. A plane that is fixed in B turns away with the spin; the quadric
/// does not know of it.
pub fn spun(view: &View, id: LiteralId) -> Option<Linear> {
    let face = &view.face(Side::B, id);
    let around_axis = match face.symmetry() {
        Symmetry::Normal(_) | Symmetry::None => return None,
        Symmetry::Center(_) => view.at.omega.length(),
        Symmetry::Axis(axis) => view.at.omega.dot(view.at.a_vector(axis.direction)).abs(),
    };
    if around_axis == 0.0 {
        return None;
    }
    let f = Around::of(&quadric(face, id.sense(), view.delta)?, view, Side::B);
    let w = view.at.velocity(view.center - f.u);
    let (slides, leans) = match f.axis {
        None => (w.length(), 0.0),
        Some(a) => ((w - a * w.dot(a)).length(), view.at.omega.cross(a).length()),
    };
    if around_axis * (f.u.length() + view.radius) <= SPINS * (slides + leans * view.radius) {
        return None;
    }
    let way = view.motion.speed * view.motion.h;
    if !(f.rho.is_finite() && f.rho > 0.0) || (f.slope > 0.0 && f.z <= view.radius + way) {
        return None;
    }
    let mu = 0.5 / f.rho;
    let (sigma, remainder, cost) = if id.sense() == Sense::Positive {
        if f.slope > 0.0 {
            // Not convex.
            return None;
        }
        (1.0, 0.0, DVec3::ZERO)
    } else {
        // |y|² − (y·b)² is at most what is across the axis.
        let across = f.axis.map_or(DVec3::ONE, |a| DVec3::ONE - a * a);
        let extent = |v: DVec3| v.abs().dot(view.half);
        let d = f.axis.map_or(view.radius, |a| {
            let u = crate::math::any_perpendicular(a);
            extent(u).hypot(extent(a.cross(u))).min(view.radius)
        });
        (-1.0, mu * d * d, across * view.half * view.half * mu)
    };
    let off = view.rounding + view.motion.rounding.matrix * (f.arm + view.radius);
    let steep = (1.0 + f.slope * f.slope) * (f.u.length() + f.rho + 2.0 * view.radius);
    let lost = off * (1.0 + 4.0 * mu * steep);
    let m = moving(view, sigma, (&f, &Travel::of(view, view.center - f.u)), off)?;
    let gradient = f.u - f.axis.map_or(DVec3::ZERO, |a| a * (f.slope * f.rho));
    let twice = 2.0 * mu;
    Some(Linear {
        side: Side::B,
        id,
        other: None,
        weights: Some([mu; 2]),
        point: view.center,
        normal: gradient * (sigma * twice),
        bound: sigma * mu * (f.u.length_squared() - f.rho * f.rho) - remainder - lost,
        rate: m.rate * twice,
        turn: m.turn * twice,
        s: m.s * twice,
        q: m.second * twice,
        rigid: false,
        cost,
    })
}

/// The quadric of a positive face that spins (`spun`), touched at another point `y` of the cell: its second-order part
/// μ(|y|² − (y·a)²) is convex, and how the quadric changes with time does not depend on where it is touched. `None` for others.
pub fn touch_spun(view: &View, spun: &Linear, y: DVec3) -> Option<Linear> {
    let mu = spun.weights?[0];
    if spun.other.is_some() || spun.id.sense() != Sense::Positive {
        return None;
    }
    let f = Around::of(&quadric(&view.face(Side::B, spun.id), Sense::Positive, view.delta)?, view, Side::B);
    let pull = (y - f.axis.map_or(DVec3::ZERO, |a| a * a.dot(y))) * mu;
    // |∇Q| has grown: its rounding, and that of the axis.
    let lost = view.rounding * (2.0 * pull.length() + 8.0 * mu * view.radius);
    let bound = spun.bound - y.dot(pull) - lost;
    Some(Linear { point: view.center + y, normal: spun.normal + 2.0 * pull, bound, ..*spun })
}

/// The same, touched where its surface looks against a plane's bound of that normal (A's axes): both together bound the cell as far
/// as the plane reaches.
pub fn touch_spun_against(view: &View, spun: &Linear, normal: DVec3) -> Option<Linear> {
    if spun.weights.is_none() || spun.other.is_some() || spun.id.sense() != Sense::Positive {
        return None;
    }
    let f = Around::of(&quadric(&view.face(Side::B, spun.id), Sense::Positive, view.delta)?, view, Side::B);
    let across = f.axis.map_or(normal, |a| normal - a * a.dot(normal));
    touch_spun(view, spun, -across.try_normalize()? * f.rho - f.u)
}

/// Where two like faces meet first when their axes or centres drift apart: on `p` in the direction in which it is off
/// `q`'s axis (or moves off it) at the height of `x`. In A's frame; a start for Newton where the bounds leave the direction
/// open. `None` for a plane.
pub fn first_off_axis(at: &Instant, (side_p, p): (Side, &Face), q: &Face, x: DVec3) -> Option<DVec3> {
    let on_axis = |side: Side, face: &Face| {
        let y = if side == Side::A { x } else { at.b_point(x) };
        let Section { origin: o, axis, radius } = face.section(y)?;
        let o = axis.map_or(o, |a| o + a * (y - o).dot(a));
        Some(if side == Side::A { (o, axis, radius) } else { (at.a_point(o), axis.map(|a| at.a_vector(a)), radius) })
    };
    let side_q = if side_p == Side::A { Side::B } else { Side::A };
    let ((o_p, axis, radius), (o_q, axis_q, _)) = (on_axis(side_p, p)?, on_axis(side_q, q)?);
    // A ball in a round hole is off the hole's axis, at whatever height x is.
    let axis = axis.or(axis_q);
    let off = |v: DVec3| axis.map_or(v, |a| v - a * v.dot(a));
    let (apart, way) = (off(o_p - o_q), off(at.velocity(x)) * if side_p == Side::A { 1.0 } else { -1.0 });
    let direction = if apart.length() > 1e-6 * radius { apart } else { way };
    Some(o_p + direction.try_normalize()? * radius)
}

/// The bound of a fit, its convex part yᵀCy touched at another point `y` of the cell.
pub fn touch(view: &View, fit: &Linear, touchable: &Touchable, y: DVec3) -> Linear {
    let pull = touchable.convex * y;
    // |∇G| has grown: its rounding, and that of C.
    let lost = view.rounding * (2.0 * pull.length() + 8.0 * touchable.steep * view.radius);
    let bound = fit.bound - y.dot(pull) - lost;
    Linear { point: view.center + y, normal: fit.normal + 2.0 * pull, bound, ..*fit }
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
    let Apex { point: o_a, axis: a, sin, cos, rows: None } = on_a.apex()? else { return None };
    let Apex { point: apex, axis, sin: sin_b, cos: cos_b, rows: None } = on_b.apex()? else { return None };
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
        weights: None,
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
#[derive(Clone, Copy, Debug)]
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

/// Of a face of B, and of how the point of its axis next to the cell's centre travels.
fn moving(view: &View, sigma: f64, (f, travel): (&Around, &Travel), off: f64) -> Option<Moving> {
    let (at, h, r, u) = (view.at, view.motion.h, view.radius, f.u);
    let (omega, spin_b) = (at.omega, at.spin_b);
    let spin_a = omega + spin_b;
    let Travel { w, speed, growth: c, pull, slip } = *travel;
    let lost = (u.length() + r) * slip + off * speed;
    let Some(a) = f.axis else {
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
    let extent = |v: DVec3| v.abs().dot(view.half);
    let s = extent(a) * extent(b) + lost + r * r * rate * omega.length();
    let mut m = Moving { rate: sigma * u.dot(w), turn: sigma * (across + a * u.dot(b)), s, second };
    if f.slope > 0.0 {
        // −½ tan²α ζ².
        let (steep, sign) = (f.slope * f.slope, -sigma * f.slope * f.slope);
        let climb = w.dot(a) - u.dot(b);
        m.rate += sign * f.z * climb;
        m.turn += sign * (climb * a - f.z * b);
        let slips = slip + rate * omega.length() * (u.length() + r);
        m.s +=
            steep * (extent(a) * extent(b) + (f.z.abs() + 2.0 * r) * slips + off * (speed + b_max * (u.length() + r)));
        let twist = pull + 2.0 * speed * b_max + (reach + z) * a_max;
        let climb_max = climb.abs() + slips + r * b_max + h * twist;
        let height = f.z.abs() + r + h * climb_max;
        m.second += steep * (height * twist + if sigma > 0.0 { climb_max * climb_max } else { 0.0 });
    }
    Some(m)
}
