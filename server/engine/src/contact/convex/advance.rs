//! Two convex primitives by an advance: as far as the direction of their nearest points proves, and again from there.
//!
//! See `convex`; source: conservative advancement (B. Mirtich, PhD thesis, Berkeley 1996).

use super::gjk::{Meeting, Nearest, meeting, nearest};
use super::plane::{self, Floor, is_half_space};
use super::proof::{Gap, Pace};
use super::support::ConvexBody;
use super::whole::{APART, body_of, excluded};
use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::Task;
use crate::contact::witness::contacts::Contacts;
use crate::contact::witness::faces::faces_at;
use crate::contact::witness::found::{Ending, Found};
use crate::contact::witness::newton::{Actives, Constraint, MAX_ACTIVE, Weights};
use crate::math::gjk::GOOD;
use crate::motion::Instant;
use crate::solid::Primitive;
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// Distance evaluations before a pair is left to the contacts.
const ROUNDS: usize = 24;
/// Distance evaluations that a proof of a kept distance may take.
const KEPT: u64 = 6;
/// The same for the time at which a distance is reached.
const NEARED: u64 = 200;
/// The shortest time that another one is worth.
const SHORT: f64 = 1.0 / 32.0;
/// Resolutions by which bodies that lie in each other are set apart to find what separates them.
const OFF: f64 = 64.0;
/// Gap, relative to the pair's scale, below which a contact is looked for.
const NEAR: f64 = 0.3;
/// A contact that the closing speed puts later than this is not looked for: speeds grow, but not by that much.
const LATEST: f64 = 1.25;
/// Imbalance of the multiplied unit normals that rounding leaves at a contact.
const BALANCED: f64 = 1e-12;
/// Gap, relative to the pair's scale, or rounds, from which faces that do not hold the contact are mended one by one:
/// farther off the next round's faces are the cheaper try.
const MEND: (f64, usize) = (0.01, 4);
/// How far the bodies may go between a touch and its witness, relative to the pair's scale, before a nearer witness is looked for.
const LAG: f64 = 1e-3;
/// How near to a witness, relative to the pair's scale, a face passes that is active there: first and second try.
const ACTIVE: [f64; 2] = [1e-7, 1e-3];

/// The answer for two solids that are one convex primitive each; `None` leaves them to the contacts. The distance at the
/// start is looked for along a direction of the world first, if one is given.
pub fn answer(contacts: &mut Contacts, along: Option<DVec3>) -> Option<Ending> {
    let task = contacts.task;
    let (a, b) = (task.a.whole()?, task.b.whole()?);
    if is_half_space(b) {
        return plane::stays_free(&task).then_some(Ending::Clear);
    }
    let (body_a, body_b) = (body_of(a)?, body_of(b)?);
    let advance = Advance::new(task, (a, body_a), (b, body_b));
    if advance.never_near() { Some(Ending::Clear) } else { advance.run(contacts, along) }
}

/// Two solids that are one convex primitive each, to be asked how far apart they are.
pub struct ConvexPair<'a> {
    bodies: Bodies<'a>,
    /// The distance at the start, in its direction.
    start: Gap,
}

/// What is asked how far apart it is.
#[expect(
    clippy::large_enum_variant,
    reason = "one a question, on the stack: a box would be an allocation in a warm step"
)]
enum Bodies<'a> {
    /// Two bounded bodies.
    Two(Advance<'a>),
    /// A body and a half-space that keeps its normal, along which everything is told; the body need not be convex.
    Floor(Floor<'a>),
}

impl Bodies<'_> {
    /// φ along a direction of the world at a time; above a floor along its normal, which is the only one.
    fn gap(&self, t: f64, n: DVec3) -> Option<Gap> {
        match self {
            Self::Two(advance) => Some(advance.gap(&advance.moment(t), n)),
            Self::Floor(floor) => floor.gap(t),
        }
    }

    /// The gap at a time along the line of nearest points, looked for from a direction of the world.
    fn widest(&self, t: f64, n: DVec3) -> Option<Gap> {
        match self {
            Self::Two(advance) => {
                let m = advance.moment(t);
                advance.widest(&m, m.at.world_from_a.transpose() * n)
            }
            Self::Floor(floor) => floor.gap(t),
        }
    }

    /// Up to where a gap is proven to stay above `least`, given another one in its direction.
    fn proven(&self, from: &Gap, to: &Gap, least: f64) -> Option<f64> {
        match self {
            Self::Two(advance) => Some(Pace { least, ..advance.pace }.proven(from, to)),
            Self::Floor(floor) => floor.proven(from, to, least),
        }
    }
}

impl<'a> ConvexPair<'a> {
    /// `None` for other solids, and where no direction is found that separates them. A body above a half-space need not
    /// be convex.
    pub fn new(task: Task<'a>) -> Option<Self> {
        let (a, b) = (task.a.whole()?, task.b.whole()?);
        if is_half_space(b) {
            let floor = Floor::new(&task)?;
            let start = floor.gap(0.0)?;
            return Some(Self { bodies: Bodies::Floor(floor), start });
        }
        let advance = Advance::new(task, (a, body_of(a)?), (b, body_of(b)?));
        let m = advance.moment(0.0);
        let start = advance.widest(&m, m.b.support(DVec3::ZERO) - a.ball.center)?;
        Some(Self { bodies: Bodies::Two(advance), start })
    }

    /// A point of A's frame that is as near to both of two convex primitives at the start as any, or common to both, but for rounding;
    /// `None` for other solids and where none is found. The second one may be a half-space.
    pub fn between(task: Task<'a>) -> Option<DVec3> {
        if let Some(x) = plane::between(&task) {
            return Some(x);
        }
        let (a, b) = (task.a.whole()?, task.b.whole()?);
        let advance = Advance::new(task, (a, body_of(a)?), (b, body_of(b)?));
        let m = advance.moment(0.0);
        match meeting(&advance.a.1, &m.b, m.b.support(DVec3::ZERO) - a.ball.center, GOOD) {
            Meeting::Apart(found) => Some(0.5 * (found.a + found.b)),
            Meeting::Common(x) => Some(x),
            Meeting::Open => None,
        }
    }

    /// True for two solids that are one convex primitive each, whether a direction separates them or not.
    pub fn are_two(task: &Task) -> bool {
        [task.a, task.b].iter().all(|solid| solid.whole().is_some_and(|p| body_of(p).is_some()))
    }

    /// A lower bound of the distance at the start, but for rounding.
    pub fn distance(&self) -> f64 {
        self.start.phi
    }

    /// Time until which the distance stays above `least` (a length), at least; of how many evaluations it took.
    pub fn keeps(self, least: f64) -> (f64, u64) {
        let (until, _, count) = self.advance_to(least, KEPT, SHORT, &mut |_| {});
        (until, count)
    }

    /// The direction, from the reference body and in the world's axes, that proves the distance at the start.
    pub fn direction(&self) -> DVec3 {
        self.start.n
    }

    /// The directions by which the distance was found to stay above `least`, each from its time on: what `keeps` proves.
    pub fn directions(self, least: f64) -> Vec<(f64, DVec3)> {
        let mut all = Vec::new();
        self.advance_to(least, KEPT, SHORT, &mut |gap| all.push((gap.t, gap.n)));
        all
    }

    /// The same to the end: where it stops short of 1 the distance then, a lower bound, is hardly above `least`, or what may
    /// be spent has run out.
    pub fn nears(self, least: f64) -> (f64, f64, u64) {
        self.advance_to(least, NEARED, 0.0, &mut |_| {})
    }

    fn advance_to(self, least: f64, most: u64, shortest: f64, step: &mut impl FnMut(&Gap)) -> (f64, f64, u64) {
        let (mut here, mut count) = (self.start, 1);
        while here.phi > least && count < most {
            step(&here);
            let end = self.bodies.gap(1.0, here.n);
            let Some(until) = end.and_then(|end| self.bodies.proven(&here, &end, least)) else { break };
            if until >= 1.0 {
                return (1.0, here.phi, count);
            }
            // From where this direction gives out another one.
            let Some(next) = self.bodies.widest(until, here.n) else { break };
            count += 1;
            let short = next.t - here.t <= shortest;
            here = next;
            if short {
                break;
            }
        }
        (here.t, here.phi, count)
    }
}

/// How two convex parts are seen at the start of a step.
pub enum Sight {
    /// The line between their middles keeps them apart over the whole step.
    Free,
    /// Apart, but for a few resolutions.
    Apart(AtStart),
    /// They have points in common.
    Common,
}

/// Two convex parts that are apart at the start of a step, or were one of them a few resolutions off.
#[derive(Clone, Copy)]
pub struct AtStart {
    /// About when they meet along the direction in which they are apart, a fraction of the step; infinite where they part.
    pub t: f64,
    found: Nearest,
    here: Gap,
    /// They may touch.
    near: bool,
}

/// A convex part of each of two solids, which are unions of such.
pub struct ConvexParts<'a>(Advance<'a>);

impl<'a> ConvexParts<'a> {
    /// The parts by their primitives; `None` where one has no bounds, or is not convex.
    pub fn new(task: Task<'a>, a: &'a Primitive, b: &'a Primitive) -> Option<Self> {
        Some(Self(Advance::new(task, (a, body_of(a)?), (b, body_of(b)?))))
    }

    /// How both are seen at the start.
    pub fn sight(&self) -> Sight {
        let (m, end) = (self.0.moment(0.0), self.0.moment(1.0));
        if self.0.never_near() || self.0.frees_all(&m, &end) {
            return Sight::Free;
        }
        let way = m.b.support(DVec3::ZERO) - self.0.a.0.ball.center;
        let seen = self.0.seen(&m, &m.b, way);
        let off = seen.is_none();
        let Some((found, here)) = seen.or_else(|| self.0.seen(&m, &self.0.set_off(&m), way)) else {
            return Sight::Common;
        };
        let near = off || found.distance <= APART * self.0.task.delta;
        let there = self.0.gap(&end, here.n).phi;
        let t = match () {
            () if off => 0.0,
            () if there < here.phi => here.phi / (here.phi - there),
            () => f64::INFINITY,
        };
        Sight::Apart(AtStart { t, found, here, near })
    }

    /// Looks for the contact of both parts, which counts where both whole trees confirm it; true when nothing is deep in both before the
    /// goal that the contacts have then. What more it is told than that is one of them.
    ///
    /// `at_start` is how they are seen at the start. Parts that are `filled` have cavities left out here: what they seem to meet first may be
    /// one.
    pub fn meet(&self, contacts: &mut Contacts, at_start: &AtStart, filled: bool) -> bool {
        self.0.frees_to_goal(contacts, at_start, filled)
    }

    /// True when they stay farther apart than `least` (a length) over the whole step.
    pub fn stay_apart(self, least: f64) -> bool {
        let (m, end) = (self.0.moment(0.0), self.0.moment(1.0));
        if self.0.stays(&m, &end, least, Pace { least, ..self.0.pace }) {
            return true;
        }
        let start = self.0.widest(&m, m.b.support(DVec3::ZERO) - self.0.a.0.ball.center);
        start.is_some_and(|start| ConvexPair { bodies: Bodies::Two(self.0), start }.keeps(least).0 >= 1.0)
    }
}

/// An instant with B as A sees it.
struct Moment<'a> {
    at: Instant,
    b: ConvexBody<'a>,
}

struct Advance<'a> {
    task: Task<'a>,
    a: (&'a Primitive, ConvexBody<'a>),
    b: (&'a Primitive, ConvexBody<'a>),
    pace: Pace,
    /// ρ_A + ρ_B.
    reach: f64,
}

impl<'a> Advance<'a> {
    fn new(task: Task<'a>, a: (&'a Primitive, ConvexBody<'a>), b: (&'a Primitive, ConvexBody<'a>)) -> Self {
        let (pa, pb) = task.relative.placed();
        let far = |p: &Primitive, center: DVec3| (p.ball.center - center).length() + p.ball.radius;
        let rho_a = far(a.0, task.relative.center_a());
        let rho_b = far(b.0, pb.place.inverse().position);
        let (wa, wb) = (pa.motion.spin.length(), pb.motion.spin.length());
        let v0 = (pa.motion.velocity - pb.motion.velocity).length();
        Self {
            task,
            a,
            b,
            pace: Pace {
                speed: v0 + wa * rho_a + wb * rho_b,
                pull: wa * wa * rho_a + wb * wb * rho_b,
                least: excluded(task.delta, task.rounding),
            },
            reach: rho_a + rho_b,
        }
    }

    /// True when the balls about the two centres of rotation that hold the bodies stay apart: these centres move straight.
    fn never_near(&self) -> bool {
        let d = self.task.relative.difference(0.0);
        let v = self.task.relative.difference(1.0) - d;
        let square = v.length_squared();
        let s = if square > 0.0 { (-d.dot(v) / square).clamp(0.0, 1.0) } else { 0.0 };
        (d + v * s).length() > self.reach + APART * self.task.delta
    }

    fn moment(&self, t: f64) -> Moment<'a> {
        let at = self.task.relative.at(t);
        let axes = at.b_from_a.transpose();
        Moment { at, b: self.b.1.seen(&axes, at.a_point(DVec3::ZERO)) }
    }

    /// B a few resolutions off: of bodies that lie in each other by less a direction is found that separates them, but for
    /// that much.
    fn set_off(&self, m: &Moment<'a>) -> ConvexBody<'a> {
        let way = m.b.support(DVec3::ZERO) - self.a.0.ball.center;
        m.b.seen(&DMat3::IDENTITY, way.normalize_or(DVec3::X) * (OFF * self.task.delta))
    }

    /// The gap along the line of nearest points, looked for from a direction along A's axes.
    fn widest(&self, m: &Moment, first: DVec3) -> Option<Gap> {
        let found = nearest(&self.a.1, &m.b, first, GOOD)?;
        Some(self.gap(m, (m.at.world_from_a * found.normal).normalize()))
    }

    /// φ along a world direction.
    fn gap(&self, m: &Moment, n: DVec3) -> Gap {
        let along = m.at.world_from_a.transpose() * n;
        Gap { t: m.at.t, n, phi: -m.b.reach(-along) - self.a.1.reach(along) }
    }

    /// True when the way between the centres, without a distance, keeps the bodies apart for the whole step.
    fn frees_all(&self, m: &Moment, end: &Moment) -> bool {
        self.stays(m, end, APART * self.task.delta, self.pace)
    }

    /// True when along the way between the centres the gap is above `start` at first and above what `pace` asks for the whole step.
    fn stays(&self, m: &Moment, end: &Moment, start: f64, pace: Pace) -> bool {
        let way = m.at.world_from_a * (m.b.center() - self.a.1.center());
        let Some(n) = way.try_normalize() else { return false };
        let here = self.gap(m, n);
        here.phi > start && pace.proven(&here, &self.gap(end, n)) >= 1.0
    }

    fn run(&self, contacts: &mut Contacts, along: Option<DVec3>) -> Option<Ending> {
        let scale = self.task.scale;
        let mut t = 0.0;
        let mut near = false;
        let mut contact: Option<Gap> = None;
        let end_of_step = self.moment(1.0);
        let mut along = along;
        for round in 0..ROUNDS {
            let m = self.moment(t);
            if round == 0 && self.frees_all(&m, &end_of_step) {
                return Some(Ending::Clear);
            }
            let first = along
                .map_or(m.b.support(DVec3::ZERO) - self.a.0.ball.center, |n: DVec3| m.at.world_from_a.transpose() * n);
            contacts.counters.closed_forms += 1;
            let (found, here) = match self.seen(&m, &m.b, first) {
                Some(seen) => seen,
                None if round == 0 || near => {
                    near = true;
                    self.seen(&m, &self.set_off(&m), first)?
                }
                None => return None,
            };
            // What may be touching is told by the search; that nothing comes of it, here.
            near |= round == 0 && found.distance <= APART * self.task.delta;
            let n = here.n;
            along = Some(n);
            let last = self.gap(&end_of_step, n);
            if contact.is_none() && self.pace.proven(&here, &last) >= 1.0 {
                return Some(Ending::Clear);
            }
            let closing = found.normal.dot(m.at.velocity(found.a));
            let guess = t + found.distance.max(0.0) / closing;
            if contact.is_none() && !near && closing > 0.0 && found.distance <= NEAR * scale && guess <= LATEST {
                let mend = found.distance <= MEND.0 * scale || round >= MEND.1;
                contact = self.contact(contacts, &m, &found, guess.min(1.0), mend);
                if let Some(hit) = contacts.hit(t) {
                    return Some(hit);
                }
            }
            let goal = contact.map_or(1.0, |c| c.t);
            if let Some(c) = contact {
                // With the contact's own normal: of what does not turn it proves all there is, at once.
                let fixed = self.gap(&m, c.n);
                let proven =
                    fixed.phi > self.pace.least && c.phi > self.pace.least && self.pace.proven(&fixed, &c) >= c.t;
                if proven || self.pace.prove(here, c, |t, n| self.gap(&self.moment(t), n)) >= c.t {
                    return contacts.found.take().map(Ending::Contact);
                }
            }
            let until = self.until(&self.pace, &here, &last, goal);
            if until >= 1.0 {
                return if contact.is_none() { Some(Ending::Clear) } else { None };
            }
            if until <= t {
                return None;
            }
            t = until;
        }
        None
    }

    /// `run` for two parts of larger bodies: a contact of others ends it as well as their own.
    fn frees_to_goal(&self, contacts: &mut Contacts, at_start: &AtStart, filled: bool) -> bool {
        let (end_of_step, mut t) = (self.moment(1.0), 0.0);
        let size = self.task.scale.min(self.a.0.ball.radius + self.b.0.ball.radius);
        let (mut along, mut own) = (at_start.here.n, None::<DVec3>);
        for round in 0..ROUNDS {
            let m = self.moment(t);
            contacts.counters.closed_forms += 1;
            let first = m.at.world_from_a.transpose() * along;
            let seen = if round == 0 {
                Some((at_start.found, at_start.here))
            } else {
                let beside = || at_start.near.then(|| self.seen(&m, &self.set_off(&m), first)).flatten();
                self.seen(&m, &m.b, first).or_else(beside)
            };
            let Some((found, here)) = seen else { return false };
            along = here.n;
            let last = self.gap(&end_of_step, here.n);
            let goal = contacts.goal().min(1.0);
            // What does not even touch before the goal is no rival of the contact that is known.
            let touch = Pace { least: 0.0, ..self.pace };
            if t >= goal || self.until(&touch, &here, &last, goal) >= goal {
                return true;
            }
            let closing = found.normal.dot(m.at.velocity(found.a));
            let guess = t + found.distance.max(0.0) / closing;
            if own.is_none()
                && !at_start.near
                && closing > 0.0
                && found.distance <= NEAR * size
                && guess <= LATEST * goal
            {
                let mend = found.distance <= MEND.0 * size || round >= MEND.1;
                own = self.contact(contacts, &m, &found, guess.min(1.0), mend).map(|c| c.n);
                if own.is_none() && filled && guess <= contacts.goal() {
                    return false;
                }
            }
            let goal = contacts.goal().min(1.0);
            if let Some(n) = own {
                let met = self.gap(&self.moment(goal), n);
                let fixed = self.gap(&m, n);
                let is_free = |from: &Gap| from.phi > self.pace.least && met.phi > self.pace.least;
                if is_free(&fixed) && self.pace.proven(&fixed, &met) >= goal
                    || is_free(&here) && self.pace.prove(here, met, |t, n| self.gap(&self.moment(t), n)) >= goal
                {
                    return true;
                }
            }
            let until = self.until(&self.pace, &here, &last, goal);
            if until >= goal {
                return true;
            }
            if until <= t {
                return false;
            }
            t = until;
        }
        false
    }

    /// The nearest points of A and of B as it is told, with the gap between both along them; `None` where B is not proven apart.
    fn seen(&self, m: &Moment<'a>, b: &ConvexBody<'a>, first: DVec3) -> Option<(Nearest, Gap)> {
        let found = nearest(&self.a.1, b, first, GOOD)?;
        let n = (m.at.world_from_a * found.normal).normalize();
        Some((found, self.gap(m, n))).filter(|(_, gap)| gap.phi > self.pace.least)
    }

    /// Until when the direction of a gap keeps the bodies apart, as far as `goal`; `last` is its gap at the end of the step. A
    /// nearer end tightens the bound.
    fn until(&self, pace: &Pace, here: &Gap, last: &Gap, goal: f64) -> f64 {
        let t = here.t;
        let (mut end, mut until) = (goal, t);
        for _ in 0..6 {
            let there = if end == 1.0 { *last } else { self.gap(&self.moment(end), here.n) };
            let proven = pace.proven(here, &there);
            until = until.max(proven);
            if proven >= end || proven - t > 0.25 * (end - t) {
                break;
            }
            end = (t + 2.0 * (proven - t)).min(end);
            if end <= t {
                break;
            }
        }
        until
    }

    /// True for a witness that is far from the touch that it was continued back to: Newton has gone over the one next to it.
    fn lags(&self, found: &Found) -> bool {
        found.touch.as_ref().is_some_and(|touch| (found.deep.t - touch.t) * self.pace.speed > LAG * self.task.scale)
    }

    /// Looks for a witness beside the touch of the contact found.
    fn catch_up(&self, contacts: &mut Contacts) {
        let Some(touch) = contacts.found.as_ref().and_then(|f| f.touch.clone()) else { return };
        contacts.confirm(touch.active, touch.x, touch.t, touch.lambda, false);
    }

    /// Solves for the contact that the witnesses point to, near the time `guess`; its time and normal when both trees
    /// confirm it.
    fn contact(&self, contacts: &mut Contacts, m: &Moment, found: &Nearest, guess: f64, mend: bool) -> Option<Gap> {
        let b = m.at.b_point(found.b);
        let normal_b = m.at.b_from_a * -found.normal;
        let x = 0.5 * (found.a + found.b);
        let mut tried = Actives::new();
        for tolerance in ACTIVE {
            let tol = tolerance * self.task.scale + found.distance.abs() * 1e-3;
            let mut active: SmallVec<[(Constraint, f64); 8]> = SmallVec::new();
            faces_at(Side::A, self.a.0, found.a, found.normal, tol, &mut active);
            let of_a = active.len();
            faces_at(Side::B, self.b.0, b, normal_b, tol, &mut active);
            let of_b = active.len() - of_a;
            // A corner that two faces hold against n, as two opposite ones of four may: they alone leave a line open.
            let loose = of_a < self.a.1.corner(found.normal) || of_b < self.b.1.corner(normal_b);
            if loose || active.len() > MAX_ACTIVE {
                continue;
            }
            let (constraints, lambda): (Actives, Weights) = active.iter().map(|(c, l)| (*c, 0.5 * l)).unzip();
            if constraints == tried {
                break;
            }
            tried.clone_from(&constraints);
            let before = contacts.found.clone();
            if contacts.confirm(constraints, x, guess, lambda, mend) {
                if contacts.found.as_ref().is_some_and(|f| f.deep.stationarity > BALANCED) {
                    // Balanced but for a slight tilt: which end of the line comes first is not told.
                    contacts.found = before;
                    continue;
                }
                if contacts.found.as_ref().is_some_and(|f| self.lags(f)) {
                    self.catch_up(contacts);
                }
                let f = contacts.found.as_ref()?;
                let s = f.touch.as_ref().filter(|s| s.t >= 0.0)?;
                let normal = contacts.normal(s)?;
                let at = self.task.relative.at(s.t);
                let n = (at.world_from_a * normal).normalize();
                return Some(self.gap(&self.moment(s.t), n));
            }
        }
        None
    }
}
