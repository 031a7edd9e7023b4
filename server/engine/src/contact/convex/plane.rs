//! A body and a half-space in front of the search: how high the body stands above the plane is known in closed form at
//! every time.
//!
//! With u the plane's outward unit normal, o a point that moves with it and h the body's support, the height of the
//! body is
//!
//! ```text
//! φ(t) = min over x of z(x),    z = u·(x − o),    φ = u·(c − o) − h(−u)
//! z'   = u'·(x − o) + u·(x − o)'
//! |z''| <= Q = w ω_P D + 2 w (|v₀| + ω ρ) + p,    w = |ω_P × u|,   D = max |x − o|,
//! p = ω² ρ, where w = 0: |ω × u| ω ρ
//! ```
//!
//! since |u'| = w and |u''| = w ω_P. φ is a minimum of such z, so between two times it lies above the line between its
//! values by no less than −½ Q s(1−s) h² (`proof`): the direction that proves a pair apart turns with the plane and is
//! never looked for. A body that spins about the plane's normal, or a plane that does, costs nothing: w = 0 and
//! ω × u = 0.
//!
//! Nothing is asked of the body but its support: of a torus that of its hull serves, which meets a plane where the
//! torus does. A contact of depth delta needs φ <= −2 delta, as between convex bodies. Newton on φ finds the time, the
//! faces that hold the farthest points are the contact's, and both bodies confirm it (`touch`).
//!
//! What starts near, or overlaps, is left to the search, which is spared all that stays free from there on
//! (`stays_free`).

use super::part::{Active, ConvexPart};
use super::proof::{Gap, Pace};
use super::touch::{Stand, Touch};
use super::turns::Turns;
use super::whole::{APART, PrimitivePair, excluded};
use crate::contact::exclusion::literal::Side;
use crate::contact::query::options::QueryOptions;
use crate::contact::query::outcome::Outcome;
use crate::contact::query::question::PlacedModel;
use crate::contact::query::task::Task;
use crate::contact::witness::extent::INCIDENT;
use crate::contact::witness::faces::{all_faces_at, faces_at};
use crate::contact::witness::newton::MAX_ACTIVE;
use crate::solid::Primitive;
use crate::solid::primitive::{Convex, Farthest};
use glam::{DMat3, DVec3};

/// Heights, with the tries of a contact, before a pair is left to others. A body that nearly touches the plane on its way takes the
/// more of them the nearer it comes, as the logarithm of how near, and the less its height bends there against what it might.
const ROUNDS: usize = 192;
/// Newton steps.
const STEPS: usize = 24;
/// A body's edge or face lies as flat as this on the plane (radians) where all of it is told to meet.
const FLAT: f64 = 1e-13;
/// How near a face passes to the farthest points, relative to the body, where it holds them.
const ACTIVE: f64 = 1e-9;
/// How far beyond the step a time is looked for.
const ASTRAY: f64 = 0.5;

/// A body and a half-space.
pub struct PlanePair<'a> {
    pair: &'a PrimitivePair<'a>,
    turns: Turns,
    /// World from model at the start.
    models: [DMat3; 2],
    pace: Pace,
    /// The plane keeps its normal.
    keeps_normal: bool,
}

/// How high the body is at a time, and how fast it rises.
struct Height {
    t: f64,
    /// φ.
    phi: f64,
    /// φ', length per step.
    rate: f64,
    /// The farthest points' middle, along the world's axes from the body's centre.
    middle: DVec3,
    /// The plane's normal.
    up: DVec3,
}

/// True for a primitive that is a half-space.
pub fn is_half_space(p: &Primitive) -> bool {
    matches!(p.shape.convex(), Convex::HalfSpace)
}

impl<'a> PlanePair<'a> {
    /// A pair whose second primitive is a half-space; `None` for another one, and for a body whose farthest points are
    /// not known.
    pub fn new(pair: &'a PrimitivePair<'a>) -> Option<Self> {
        let [body, plane] = pair.primitives;
        if !is_half_space(plane) {
            return None;
        }
        farthest(body, DVec3::Z)?;
        let models = [pair.axes(0), pair.axes(1)];
        let axes = [pair.frame(0, &models[0]), pair.frame(1, &models[1])];
        let spins = pair.spins();
        let turns = Turns::new(pair, axes, spins);
        let [spin, of_plane] = spins;
        let from = body.ball.center - body.frame.position;
        let arm = if from == DVec3::ZERO { pair.offsets[0] } else { pair.offsets[0] + models[0] * from };
        let rho = arm.length() + body.ball.radius;
        let up = axes[1].z_axis;
        let w = of_plane.cross(up).length();
        let apart = turns.pivots.length().max((turns.pivots - pair.velocity).length());
        let speed = pair.velocity.length() + turns.rates[0] * rho;
        let tilts = if w == 0.0 { spin.cross(up).length() } else { turns.rates[0] };
        let pull = w * turns.rates[1] * (apart + rho) + 2.0 * w * speed + tilts * turns.rates[0] * rho;
        let least = excluded(pair.delta, pair.rounding);
        Some(Self { pair, turns, models, pace: Pace { speed, pull, least }, keeps_normal: w == 0.0 })
    }

    /// The height at a time.
    fn height(&self, t: f64) -> Option<Height> {
        let m = self.turns.at(t);
        let up = m.axes[1].z_axis;
        let Farthest { reach, middle } = farthest(self.pair.primitives[0], m.axes[0].transpose() * -up)?;
        let middle = m.axes[0] * middle;
        let phi = -up.dot(m.way) - reach;
        let [spin, of_plane] = self.turns.spins;
        let arm = m.offsets[0] + middle;
        // From the plane's centre of rotation.
        let from = arm - (self.turns.pivots - self.pair.velocity * t);
        let rate = of_plane.cross(up).dot(from) + up.dot(self.pair.velocity + spin.cross(arm));
        phi.is_finite().then_some(Height { t, phi, rate, middle, up })
    }

    /// The same as a gap along the direction that turns with the plane, which counts as one that stays.
    fn gap(&self, t: f64) -> Gap {
        Gap { t, n: DVec3::Z, phi: self.height(t).map_or(f64::NEG_INFINITY, |h| h.phi) }
    }

    /// Fills in the earliest contact, or leaves `out` clear; `None` leaves the pair to others.
    pub fn meet(&self, query_options: QueryOptions, out: &mut Outcome) -> Option<()> {
        let (first, end) = (self.gap(0.0), self.gap(1.0));
        if first.phi <= APART * self.pair.delta {
            return None;
        }
        let mut here = first;
        for _ in 0..ROUNDS {
            if self.pace.proven(&here, &end) >= 1.0 {
                return Some(());
            }
            out.counters.closed_forms += 1;
            if let Some(touch) = self.settle(here.t).and_then(|height| self.confirm(&height, out)) {
                if !query_options.time() {
                    touch.report_hit(here.t.max(f64::MIN_POSITIVE), out);
                    return Some(());
                }
                let goal = self.gap(touch.t);
                let closed = goal.phi > self.pace.least && goal.phi.abs() <= INCIDENT * self.pair.rounding;
                if closed && self.pace.prove(here, goal, |t, _| self.gap(t)) >= goal.t {
                    touch.report(self.pair, query_options, out);
                    out.apart = first.phi;
                    return Some(());
                }
            }
            here = self.gap(self.farther(&here, &end)?);
            if here.phi <= self.pace.least {
                return None;
            }
        }
        None
    }

    /// True when the body, however near it starts, is proven not to meet the plane over the whole step.
    fn stays_free(&self) -> bool {
        let (mut here, end) = (self.gap(0.0), self.gap(1.0));
        for _ in 0..ROUNDS {
            if here.phi <= self.pace.least {
                return false;
            }
            if self.pace.proven(&here, &end) >= 1.0 {
                return true;
            }
            let Some(t) = self.farther(&here, &end) else { return false };
            here = self.gap(t);
        }
        false
    }

    /// A time up to which nothing is met after a height, given that at the end: a nearer end tightens the bound.
    fn farther(&self, here: &Gap, end: &Gap) -> Option<f64> {
        let (mut until, mut end) = (here.t, *end);
        // As far as the bound reaches where the height stays as it is: ½ Q h² / 4 = φ − least.
        let mut level = (8.0 * (here.phi - self.pace.least) / self.pace.pull).sqrt();
        for _ in 0..6 {
            let proven = self.pace.proven(here, &end);
            until = until.max(proven);
            let nearer = here.t + (2.0 * (proven - here.t)).max(level);
            if proven >= end.t || proven - here.t > 0.25 * (end.t - here.t) || nearer <= here.t || nearer >= end.t {
                break;
            }
            end = self.gap(nearer);
            level = 0.0;
        }
        (until > here.t).then_some(until)
    }

    /// When the body comes down to the plane, after a time.
    fn settle(&self, from: f64) -> Option<Height> {
        let mut height = self.height(from)?;
        for _ in 0..STEPS {
            let step = -height.phi / height.rate;
            let t = height.t + step.clamp(-ASTRAY, ASTRAY);
            if height.rate >= 0.0 || !(from - ASTRAY..=1.0 + ASTRAY).contains(&t) {
                return None;
            }
            let settled = (t - height.t).abs() <= f64::EPSILON;
            height = self.height(t)?;
            if settled {
                break;
            }
        }
        (height.t > from && height.t <= 1.0).then_some(height)
    }

    /// The contact at a time, if both bodies confirm it.
    fn confirm(&self, height: &Height, out: &mut Outcome) -> Option<Touch> {
        out.counters.newton += 1;
        let [body, plane] = self.pair.primitives;
        let m = self.turns.at(height.t);
        let n = -height.up;
        let parts = [ConvexPart::plain(body, m.axes[0]), ConvexPart::plain(plane, m.axes[1])];
        let mut stand = Stand::new(self.pair, parts, self.models, Some(&self.turns));
        let tol = ACTIVE * body.ball.radius;
        // Near an edge's normal a corner's third face takes hardly part, and yet holds the point.
        for faces_of_body in [faces_at, all_faces_at] {
            stand.to(height.t);
            let mut active = Active::new();
            faces_of_body(Side::A, body, stand.own(0, height.middle), stand.own_vector(0, n), tol, &mut active);
            let of_a = active.len();
            let own = stand.own(1, height.middle);
            faces_at(Side::B, plane, own, stand.own_vector(1, -n), tol, &mut active);
            let holds = of_a > 0 && active.len() > of_a && active.len() <= MAX_ACTIVE;
            let touch = holds.then(|| stand.confirm_at(height.middle, n, (&active, of_a), true)).flatten();
            if touch.is_some() {
                return touch;
            }
        }
        None
    }
}

/// The farthest points of a primitive along a unit direction of its own frame.
fn farthest(body: &Primitive, m: DVec3) -> Option<Farthest> {
    body.shape.geometry().farthest(m, FLAT)
}

/// Two bodies of a task of which the second is a half-space that keeps its normal, to be asked how high the first one
/// stands above it.
pub struct Floor<'a> {
    bodies: [PlacedModel<'a>; 2],
    primitives: [&'a Primitive; 2],
    delta: f64,
}

impl<'a> Floor<'a> {
    /// `None` for other bodies, and where the plane tilts.
    pub fn new(task: &Task<'a>) -> Option<Self> {
        let floor = Self::of_any(task)?;
        floor.with(|pair| pair.keeps_normal)?.then_some(floor)
    }

    fn of_any(task: &Task<'a>) -> Option<Self> {
        let (a, b) = (task.a.whole()?, task.b.whole()?);
        let (placed_a, placed_b) = task.relative.placed();
        let body = |model, placed| PlacedModel { model, placed };
        let bodies = [body(task.model_a, placed_a), body(task.model_b, placed_b)];
        let floor = Self { bodies, primitives: [a, b], delta: task.delta };
        is_half_space(b).then_some(floor)
    }

    fn with<R>(&self, look: impl FnOnce(&PlanePair) -> R) -> Option<R> {
        let [a, b] = &self.bodies;
        // The resolution is the task's, which has been raised as it must be.
        let mut pair = PrimitivePair::new([a, b], self.primitives, f64::INFINITY)?;
        pair.delta = self.delta;
        PlanePair::new(&pair).map(|plane| look(&plane))
    }

    /// The gap at a time along the plane's normal, from the body to the half-space; world axes.
    pub fn gap(&self, t: f64) -> Option<Gap> {
        self.with(|plane| plane.height(t).map(|h| Gap { t, n: -h.up, phi: h.phi }))?
    }

    /// Up to where between two gaps the height is proven to stay above `least`.
    pub fn proven(&self, from: &Gap, to: &Gap, least: f64) -> Option<f64> {
        let same = |g: &Gap| Gap { n: DVec3::Z, ..*g };
        self.with(|plane| Pace { least, ..plane.pace }.proven(&same(from), &same(to)))
    }
}

/// A point of A's frame halfway between a half-space, the task's second body, and the middle of those points of the first one that
/// are nearest to it at the start, or that middle where it lies in the half-space; `None` for other bodies. f being 1-Lipschitz,
/// it is no more than half the height in either body.
pub fn between(task: &Task) -> Option<DVec3> {
    let (body, plane) = (task.a.whole()?, task.b.whole()?);
    if !is_half_space(plane) {
        return None;
    }
    let at = task.relative.at(0.0);
    let up = at.a_vector(plane.frame.rotation * DVec3::Z).normalize();
    let Farthest { middle, .. } = farthest(body, body.frame.rotation.inverse() * -up)?;
    let lowest = body.frame.point(middle);
    let height = up.dot(lowest - at.a_point(plane.frame.position));
    Some(lowest - up * (0.5 * height.max(0.0)))
}

/// True for a body and a half-space, in a task, that are proven not to meet over the whole step, however near they
/// start.
pub fn stays_free(task: &Task) -> bool {
    Floor::of_any(task).and_then(|floor| floor.with(|pair| pair.stays_free())).unwrap_or(false)
}
