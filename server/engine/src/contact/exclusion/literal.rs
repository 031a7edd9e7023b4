//! A cell at an instant, and the linear lower bounds of its literals.
//!
//! The cell is a box fixed in A. For x in it, a literal is at least a + n·(x − c) − R:
//! * +psi: where psi is convex a tangent plane bounds it everywhere: R = 0; where it is not (`Surface::under`), it bends away from
//!   its tangent as a subtracted cone does, and R is that of the next line;
//! * −psi (ρ and D those of B(x − o) and B y where a face is the affine image of another): concave; R is the supremum
//!   of k·(ρ(x) − ρ − u·(x−c)): k·D²/(2ρ) over |x−c| <= D across the face's axis (exact where D <= 2ρ, an upper bound
//!   beyond), or k·T²/(2(ρ−S)) where the cell reaches S along the radial direction u and T along the curving tangents
//!   (sqrt((ρ+s)² + τ²) − (ρ+s) falls with s). Where D > 2ρ the radial direction means nothing over the cell: it is
//!   left out and R = k·D.
//!
//! A contact at depth delta needs every literal of a clause <= −delta, so `bound` carries a + delta − R and "excluded" is
//! bound > 0 for a convex combination. Guards (the planes of an octree voxel) need <= 0 and carry no delta.
//! B's literals move: `rate` is d(value)/dt at the centre, `s` and `q` what the concave remainder adds per unit and per
//! half squared unit of time (D grows at most with the speed bound V).

use super::rounding;
use crate::motion::{Bounds, Instant};
use crate::solid::local::{LiteralId, Truth, truth_of};
use crate::solid::surface::{FaceAt, Stretch, Under};
use crate::solid::{Face, Sense, Solid};
use glam::DVec3;

/// Least distance from the axis, relative to the centre's, for the slab bound: nearer, its denominator spoils it.
const SLAB: f64 = 0.05;

/// What an extent is taken for that comes from rows with some roundings more than a unit vector's.
const MORE: f64 = 1.0 + 1e-12;

/// The body a literal belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Side {
    /// The body that carries the cells.
    A,
    /// The other one.
    B,
}

/// The faces of one body: those of its solid, then the search's clip planes.
#[derive(Clone, Copy, Debug)]
pub struct Faces<'a> {
    /// The solid.
    pub solid: &'a Solid,
    /// Planes of octree voxels, in the solid's frame; id = number of the solid's faces + index.
    pub clip_planes: &'a [Face],
}

impl Faces<'_> {
    /// The face of an id.
    pub fn get(&self, id: u32) -> &Face {
        let own = self.solid.faces.len();
        match self.solid.faces.get(id as usize) {
            Some(f) => f,
            None => &self.clip_planes[id as usize - own],
        }
    }
    /// True for a voxel's plane.
    pub fn is_guard(&self, id: u32) -> bool {
        id as usize >= self.solid.faces.len()
    }
}

/// A literal's linear lower bound over a cell; A's model axes.
#[derive(Clone, Copy, Debug)]
pub struct Linear {
    /// Body of the literal.
    pub side: Side,
    /// Which literal.
    pub id: LiteralId,
    /// The other literal of a same-shape fit (`fit`).
    pub other: Option<(Side, LiteralId)>,
    /// Weights of the two quadrics that such a fit is made of (`fit`).
    pub weights: Option<[f64; 2]>,
    /// Where a convex face is touched, in the frame of its body; of a fit its convex part, in A's frame.
    pub point: DVec3,
    /// n, with the literal's sign.
    pub normal: DVec3,
    /// a + delta − R at the centre.
    pub bound: f64,
    /// d(value)/dt at the centre.
    pub rate: f64,
    /// Gradient of that rate over the cell.
    pub turn: DVec3,
    /// Growth of the remainder, first order.
    pub s: f64,
    /// Growth of the remainder, second order.
    pub q: f64,
    /// The normal is fixed in B: the second derivative of its motion is bounded with those of its clause.
    pub rigid: bool,
    /// What each half extent of the cell costs the bound.
    pub cost: DVec3,
}

impl Linear {
    /// The bound at the centre, `dt` ahead.
    pub fn ahead(&self, dt: f64) -> f64 {
        self.bound + dt * (self.rate - self.s) - 0.5 * dt * dt * self.q
    }

    /// The normal, `dt` ahead, to first order.
    pub fn normal_ahead(&self, dt: f64) -> DVec3 {
        self.normal + self.turn * dt
    }
}

/// What bends as k·ρ(x) does, ρ the distance from an axis or, without one, from a point, or |B(x − o)|; A's axes.
struct Round {
    k: f64,
    /// ρ at the cell's centre.
    rho: f64,
    axis: Option<DVec3>,
    /// B, of the affine image of a face.
    stretch: Option<Stretch>,
    /// Instead of all these the gradient of ρ, and what it bends along (`Surface::split`).
    split: Option<[DVec3; 3]>,
    /// The face's gradient there, or any that leans against the axis on the same side.
    normal: DVec3,
}

/// How far that rises above its tangent over a cell, and how much more in time: first order, and half the second.
struct Remainder {
    most: f64,
    s: f64,
    q: f64,
    /// What each half extent costs.
    cost: DVec3,
    /// The cell is so large that the direction away from the axis means nothing: `most` is above a function without that slope.
    far: bool,
}

/// A box cell of A at an instant, with bounds on its motion against B over [t, t + h].
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// A's faces.
    pub a: Faces<'a>,
    /// B's faces.
    pub b: Faces<'a>,
    /// The instant.
    pub at: &'a Instant,
    /// Motion bounds over the span.
    pub motion: Bounds,
    /// Centre (A's model frame).
    pub center: DVec3,
    /// Half extents along A's model axes.
    pub half: DVec3,
    /// |half|.
    pub radius: f64,
    /// Centre in B's model frame.
    pub center_b: DVec3,
    /// v(c): velocity of the centre against B.
    pub velocity: DVec3,
    /// Depth of the contact that is searched.
    pub delta: f64,
    /// Depth by which a wall of one body is told to be too thin for a contact: `delta`, or a little more where that leaves room.
    pub wall: f64,
    /// What rounding may do to a literal's plane over the cell: E, a length (`rounding::of_literals`).
    pub rounding: f64,
    /// Same-shape fits are used.
    pub fits: bool,
    /// Several literals hold a bound together; otherwise the best of them does, alone.
    pub multipliers: bool,
    /// Those too that stay curved: of cones, and with quadrics weighed as steep as each other. Dearer to check by intervals.
    pub curved: bool,
}

impl View<'_> {
    /// The faces of a body.
    pub fn faces(&self, side: Side) -> &Faces<'_> {
        match side {
            Side::A => &self.a,
            Side::B => &self.b,
        }
    }

    /// The face of a literal, or a simpler one that is the same all over the cell for the whole span.
    pub fn face(&self, side: Side, id: LiteralId) -> Face {
        let face = self.faces(side).get(id.face());
        self.near(side, face).unwrap_or(*face)
    }

    /// The simpler one alone.
    #[inline]
    fn near(&self, side: Side, face: &Face) -> Option<Face> {
        let (center, way) = match side {
            Side::A => (self.center, 0.0),
            Side::B => (self.center_b, self.motion.speed * self.motion.h),
        };
        face.near(center, self.radius + way + self.rounding)
    }

    /// The face at the point `center + y`, its normal along A's axes.
    fn face_at(&self, side: Side, face: &Face, y: DVec3) -> FaceAt {
        match side {
            Side::A => face.at(self.center + y),
            Side::B => {
                let mut f = face.at(self.center_b + self.at.b_from_a * y);
                f.normal = self.at.a_vector(f.normal);
                f
            }
        }
    }

    /// A direction of a body along A's axes.
    fn turned(&self, side: Side, direction: DVec3) -> DVec3 {
        if side == Side::A { direction } else { self.at.a_vector(direction) }
    }

    /// Extents of the cell at a curved face: (across the axis or all around, along the normal, along the curving
    /// tangents), each the largest distance from the centre. `normal` is the face's there, both along A's axes.
    fn extents(&self, round: &Round) -> (f64, f64, f64) {
        let (along, normal) = (|n: DVec3| n.abs().dot(self.half), round.normal);
        if let Some(split) = round.split {
            return self.split(split);
        }
        if let Some(b) = &round.stretch {
            return self.stretched(b, normal);
        }
        match round.axis {
            Some(axis) => {
                let t = axis.cross(normal).normalize_or_zero();
                let u = t.cross(axis);
                (along(u).hypot(along(t)).min(self.radius), along(u), along(t))
            }
            None => {
                let u = crate::math::any_perpendicular(normal);
                let t = along(u).hypot(along(normal.cross(u))).min(self.radius);
                (self.radius, along(normal), t)
            }
        }
    }

    /// The same of B y instead of y: |B y|, its part along B(x − o) at the centre, and what is across that.
    #[cold]
    fn stretched(&self, b: &Stretch, normal: DVec3) -> (f64, f64, f64) {
        let reach = |v: DVec3| v.abs().dot(self.half) * MORE;
        let all = DVec3::from_array(b.rows.map(reach)).length().min(self.radius);
        let along = b.along(normal);
        let [s, t] = b.beside(along).map(|t| reach(b.back(t)));
        (all, reach(b.back(along)), s.hypot(t).min(all))
    }

    /// The same of P y, given by what it has along P(x − o) at the centre and across that.
    #[cold]
    fn split(&self, split: [DVec3; 3]) -> (f64, f64, f64) {
        let [radial, one, other] = split.map(|v| v.abs().dot(self.half) * MORE);
        if other == 0.0 {
            return (radial.hypot(one).min(self.radius), radial, one.min(self.radius));
        }
        (self.radius, radial, one.hypot(other))
    }

    /// By how much more than the cell itself what is along the curving tangents grows with it.
    fn stretch_across(round: &Round) -> f64 {
        match round.split {
            Some([_, one, other]) if other != DVec3::ZERO => one.length().hypot(other.length()).max(1.0) * MORE,
            Some(_) | None => 1.0,
        }
    }

    /// How far a function that bends as k·ρ(x) does rises above its tangent over the cell.
    fn remainder(&self, side: Side, round: &Round) -> Remainder {
        // Extents and distance from the axis are each known to the rounding; R must not come out too small.
        let (d, radial, tangential) = self.extents(round);
        let more = Self::stretch_across(round);
        let (d, tangential) = (d + self.rounding, tangential + more * self.rounding);
        let rho = (round.rho - self.rounding).max(0.0);
        let way = if side == Side::B { self.motion.speed * self.motion.h } else { 0.0 };
        let closest = rho - radial - way;
        // The smaller of two suprema: over the ball |x − c| <= d, or over the slab |x − c|·u <= radial.
        let slab = closest > 0.0 && closest >= SLAB * rho && tangential * tangential * rho < d * d * closest;
        let across = match (&round.stretch, round.axis, round.split) {
            (_, _, Some(rows)) => rows.iter().map(|row| *row * *row).sum(),
            (Some(b), ..) => b.rows.iter().map(|row| *row * *row).sum(),
            (None, Some(axis), None) => DVec3::ONE - axis * axis,
            (None, None, None) => DVec3::ONE,
        };
        let k = round.k;
        let cost = if slab {
            let steepness = k * (tangential / closest) * (tangential / closest) * 0.5;
            self.bulge(round) * (round.rho.max(self.radius) / closest) + round.normal.abs() * self.half * steepness
        } else {
            across * self.half * self.half * (k / (2.0 * round.rho.max(0.5 * d)))
        };
        // Beyond, 1-Lipschitz says more.
        if slab || d * k.max(1.0) <= 2.0 * rho {
            let (d, rho) = if slab { (tangential, closest) } else { (d, rho) };
            let speed = if slab { self.motion.speed * more } else { self.motion.speed };
            let (s, q) = (k * speed * d / rho, k * speed * speed / rho);
            return Remainder { most: k * d * d / (2.0 * rho), s, q, cost, far: false };
        }
        let k = k.min(1.0);
        Remainder { most: k * d, s: k * self.motion.speed, q: 0.0, cost, far: true }
    }

    /// What is known of a literal over the cell, for B over the whole span.
    pub fn truth(&self, side: Side, id: LiteralId) -> Truth {
        let faces = self.faces(side);
        let face = faces.get(id.face());
        let f = self.face_at(side, face, DVec3::ZERO);
        let tilt = f.normal.abs().dot(self.half);
        let r = self.radius;
        let (mut lo, mut hi) = (f.value - tilt, f.value + tilt);
        if f.k > 0.0 {
            let bulge = if f.rho > 0.0 { f.k * r * r / (2.0 * f.rho) } else { f64::INFINITY };
            hi = f.value + (tilt + bulge).min(r);
        }
        let mut dip = 0.0;
        if !face.is_convex() {
            let center = if side == Side::A { self.center } else { self.center_b };
            let way = if side == Side::B { self.motion.speed * self.motion.h } else { 0.0 };
            dip = face.under(center, center).map_or(0.0, |u| Under::dip(u.k, u.rho, r + way));
            lo = f.value - (tilt + dip).min(r);
        }
        if side == Side::B {
            // Lipschitz in space: no point moves further than V·h. A plane (and the tangent of a convex face) also has a
            // rate of its own, with the second-order bound for a single normal.
            let h = self.motion.h;
            let way = self.motion.speed * h;
            let rate = f.normal.dot(self.velocity) * h;
            let pull = self.motion.curvature(self.at, f.normal) + self.motion.bend;
            let slack = (f.normal.cross(self.at.omega).length() * r + self.motion.slip) * h + 0.5 * pull * h * h;
            let moved = if dip > 0.0 { f.value - tilt - dip } else { lo };
            lo = (lo - way).max(moved + rate.min(0.0) - slack);
            hi = if f.k == 0.0 { (hi + way).min(hi + rate.max(0.0) + slack) } else { hi + way };
        }
        truth_of(id.sense(), (lo, hi), if faces.is_guard(id.face()) { 0.0 } else { self.delta }, self.rounding)
    }

    /// The literal's linear bound, convex faces touched at `center + y`.
    pub fn linear(&self, side: Side, id: LiteralId, y: DVec3) -> Linear {
        let faces = self.faces(side);
        let face = faces.get(id.face());
        let delta = if faces.is_guard(id.face()) { 0.0 } else { self.delta };
        if id.sense() == Sense::Positive {
            let point = match side {
                Side::A => self.center + y,
                Side::B => self.center_b + self.at.b_from_a * y,
            };
            if !face.is_convex()
                && let Some(l) = self.over(side, id, point)
            {
                return l;
            }
            let f = self.face_at(side, face, y);
            let mut l = self.plane(side, id, f.normal, f.value - f.normal.dot(y) + delta);
            l.cost = self.bulge(&self.round(side, face, (point, &f)));
            l.point = point;
            return l;
        }
        let near = self.near(side, face);
        let face = near.as_ref().unwrap_or(face);
        let f = self.face_at(side, face, DVec3::ZERO);
        if f.k == 0.0 {
            return self.plane(side, id, -f.normal, -f.value + delta);
        }
        let center = if side == Side::A { self.center } else { self.center_b };
        let rest = self.remainder(side, &self.round(side, face, (center, &f)));
        let normal = match face.apex() {
            _ if !rest.far => -f.normal,
            // −psi >= −psi(c) [+ sin α axis·(x−c) for a cone] − k·D.
            Some(c) => c.sin * self.turned(side, c.axis),
            None => face.steady(center).map_or(DVec3::ZERO, |steady| -self.turned(side, steady)),
        };
        let mut l = self.plane(side, id, normal, -f.value - rest.most + delta);
        l.cost = rest.cost;
        if side == Side::A { l } else { Linear { s: rest.s, q: rest.q, ..l } }
    }

    /// The bound of a face that is not convex, with the gradient that it has at a point of its own body's frame; `None` where its
    /// tangent there is one.
    fn over(&self, side: Side, id: LiteralId, point: DVec3) -> Option<Linear> {
        let face = self.faces(side).get(id.face());
        let center = if side == Side::A { self.center } else { self.center_b };
        let under = face.under(point, center)?;
        let [axis, normal] = [under.axis, under.out].map(|v| self.turned(side, v));
        let split = under.beside.map(|beside| [normal, self.turned(side, beside), DVec3::ZERO]);
        let axis = if split.is_some() { None } else { Some(axis) };
        let rest = self.remainder(side, &Round { k: under.k, rho: under.rho, axis, stretch: None, split, normal });
        let normal = self.turned(side, if rest.far { under.far } else { under.normal });
        let l = self.plane(side, id, normal, under.value - rest.most + self.delta);
        let l = Linear { point, cost: rest.cost, ..l };
        Some(if side == Side::A { l } else { Linear { s: rest.s, q: rest.q, ..l } })
    }

    /// The tangent plane of a convex face at a point of its own body's frame, wherever that is; what bounds another one with the
    /// gradient that it has there.
    pub fn tangent(&self, side: Side, id: LiteralId, point: DVec3) -> Linear {
        let face = self.faces(side).get(id.face());
        if !face.is_convex()
            && let Some(l) = self.over(side, id, point)
        {
            return l;
        }
        let mut f = face.at(point);
        let center = if side == Side::A { self.center } else { self.center_b };
        let value = f.value + f.normal.dot(center - point);
        if side == Side::B {
            f.normal = self.at.a_vector(f.normal);
        }
        let bound = value + self.delta - rounding::of_distance((center - point).length());
        Linear {
            point,
            cost: self.bulge(&self.round(side, face, (point, &f))),
            ..self.plane(side, id, f.normal, bound)
        }
    }

    /// A bound by a plane that is fixed in its body.
    pub(super) fn plane(&self, side: Side, id: LiteralId, normal: DVec3, bound: f64) -> Linear {
        let (rate, turn) = match side {
            Side::A => (0.0, DVec3::ZERO),
            Side::B => (normal.dot(self.velocity), normal.cross(self.at.omega)),
        };
        Linear {
            side,
            id,
            other: None,
            weights: None,
            point: DVec3::ZERO,
            normal,
            bound,
            rate,
            turn,
            s: 0.0,
            q: 0.0,
            rigid: side == Side::B,
            cost: DVec3::ZERO,
        }
    }

    /// How a face bends at `x`, a point of its own body's frame, where `f` was taken.
    #[inline]
    fn round(&self, side: Side, face: &Face, (x, f): (DVec3, &FaceAt)) -> Round {
        let axis = face.developable().map(|axis| self.turned(side, axis));
        let turned = |b: Stretch| Stretch {
            rows: b.rows.map(|row| self.turned(side, row)),
            fall: self.turned(side, b.fall),
            ..b
        };
        let split = face.split(x).map(|split| split.map(|v| self.turned(side, v)));
        Round { k: f.k, rho: f.rho, axis, stretch: face.stretch().map(turned), split, normal: f.normal }
    }

    /// How much each half extent weighs in how far a face bends away from its tangent: k·(tangent component)²·e²/(2ρ).
    fn bulge(&self, round: &Round) -> DVec3 {
        if round.k == 0.0 {
            return DVec3::ZERO;
        }
        let across = match (&round.stretch, round.axis, round.split) {
            (_, _, Some([_, one, other])) => one * one + other * other,
            (Some(b), ..) => {
                let [s, t] = b.beside(b.along(round.normal)).map(|t| b.back(t));
                s * s + t * t
            }
            (None, Some(axis), None) => {
                let t = axis.cross(round.normal);
                t * t
            }
            (None, None, None) => DVec3::ONE - round.normal * round.normal,
        };
        across * self.half * self.half * (round.k / (2.0 * round.rho.max(self.radius)))
    }

    /// True where a tangent at another point can tighten the literal's bound.
    pub fn is_curved_convex(&self, side: Side, id: LiteralId) -> bool {
        id.sense() == Sense::Positive && !self.faces(side).get(id.face()).is_flat()
    }
}
