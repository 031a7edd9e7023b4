//! In front of the search: a ball against any solid, advanced by how far the solid is from its centre.
//!
//! Idea: f of a solid changes no faster than the distance. So a point x that is δ deep in a ball of centre c and radius r, and as deep in a
//! solid, has f(c) <= f(x) + |x − c| <= −δ + (r − δ): while f(c) > r − 2δ there is none. The centre moves by V in a step at most, and
//! turns aside by less than A h in a time h. So what a face says of the centre falls in h by no more than (s + V τ(V h) + A h) h, where
//! s is how fast it falls now and τ how far its gradient turns within reach (none where ψ is convex and the solid lies below it). That
//! tells for each face how long it stays above r − 2δ; for an intersection of solids the longest of these times holds, for a union the
//! shortest. Where the centre comes towards a face, each advance doubles the digits. Beside an edge f(c) is less than the distance.
//! Where its faces are at right angles, as a hole's rim is, the distance itself is told (`edges`), and for how long it stays.
//!
//! Where the foot of the centre lies on the faces that decide there, ball and solid touch when the distance is r, before what is
//! proven ends: the faces are solved for that contact as the search does it, and both trees confirm it or it is none. Beside other edges
//! the advance stops short: they are left to the search.
//!
//! Source: sphere tracing (J. C. Hart, The Visual Computer 12, 1996) of the centre; conservative advancement (B. Mirtich, PhD thesis,
//! Berkeley 1996).

mod edges;

use self::edges::{MOST, Measure};
use super::convex::excluded;
use super::exclusion::literal::Side;
use super::instant::separation;
use super::instant::within::Within;
use super::query::task::Task;
use super::witness::contacts::Contacts;
use super::witness::found::Ending;
use super::witness::newton::{Actives, Constraint, Weights};
use crate::motion::Instant;
use crate::octree::Model;
use crate::solid::local::LiteralId;
use crate::solid::surface::FaceAt;
use crate::solid::{Sense, Solid};
use glam::DVec3;
use smallvec::SmallVec;

/// Times the centre is advanced before the pair is left to the search.
const ROUNDS: usize = 16;
/// Gaps, relative to the pair's scale, from which on a contact is looked for, again and again.
const NEAR: [f64; 4] = [1e-2, 1e-4, 1e-7, 1e-10];
/// Faces of a solid beyond which its f is not asked for at a point.
const MOST_FACES: usize = 256;
/// Radii of the ball up to which it may reach into the other body at the start.
const SHALLOW: f64 = 1e-3;
/// How much of a span is taken for proven: its quotient is rounded.
const SURE: f64 = 1.0 - 1e-14;
/// How much of a distance to an edge is taken for proven: its faces are at right angles up to rounding.
const EDGE: f64 = 1.0 - 4.0 * f64::EPSILON;

/// The answer for a pair of which one is a ball; `None` leaves it to the search, as it was.
pub(super) fn answer(contacts: &mut Contacts) -> Option<Ending> {
    let task = contacts.task;
    if task.delta <= 0.0 || task.ignored_depth > 0.0 {
        return None;
    }
    let advance = Advance::of(&task)?;
    let before = (contacts.found.clone(), contacts.hints.clone());
    let ending = advance.run(contacts);
    if ending.is_none() {
        // What touches beside it first was not proven. What others have confirmed stays.
        (contacts.found, contacts.hints) = before;
    }
    ending
}

/// Whether a point is within a level (a length) of a ball and of another solid at the start, as far as f at the centre and the faces that
/// decide there tell; for the pairs that a ball is one of.
pub(super) fn within(task: &Task, level: f64) -> Option<Within> {
    let advance = Advance::of(task)?;
    let at = task.relative.at(0.0);
    if advance.other.value(advance.center(&at).1) - advance.radius > 2.0 * (level + 2.0 * task.rounding) {
        return Some(Within::Apart);
    }
    let x = advance.between(&at, advance.gap(&at));
    (separation::value(task, &at, x) <= level).then_some(Within::Witness(x))
}

/// A ball that moves against a solid.
struct Advance<'t, 'a> {
    task: &'t Task<'a>,
    /// The ball's side.
    side: Side,
    /// In the ball's own frame.
    center: DVec3,
    radius: f64,
    face: LiteralId,
    /// The other body.
    other: &'t Model,
    /// V: the centre moves no faster against the other body, length per step.
    speed: f64,
    /// A: nor does its velocity change faster, length per step and step.
    turning: f64,
    /// f(c) − r above this excludes a contact of the depth that is asked for, rounding included: negative.
    least: f64,
}

impl<'t, 'a> Advance<'t, 'a> {
    /// `None` for other pairs, and where rounding is not far below the depth that is asked for.
    fn of(task: &'t Task<'a>) -> Option<Self> {
        let of = |side, solid: &Solid, other| solid.as_ball().map(|ball| (side, ball, other));
        let (side, (center, radius, face), other): (_, _, &Model) =
            of(Side::A, task.a, task.model_b).or_else(|| of(Side::B, task.b, task.model_a))?;
        if other.solid.faces.len() > MOST_FACES || other.solid.has_parts {
            return None;
        }
        let (a, b) = task.relative.placed();
        let (own, against) = if side == Side::A { (a, b) } else { (b, a) };
        // u = d0 + v0 t + R q from the other body's centre of rotation to the ball's centre, seen from the other body, which turns too.
        let arm = own.place.point(center).length();
        let (spin, of_other) = (own.motion.spin.length(), against.motion.spin.length());
        let (far, fast) = (task.relative.apart() + arm, (a.motion.velocity - b.motion.velocity).length() + spin * arm);
        let outward = 1.0 + 1e-12;
        let (speed, turning) = (
            (fast + of_other * far) * outward,
            (spin * spin * arm + of_other * (2.0 * fast + of_other * far)) * outward,
        );
        let least = excluded(task.delta, 2.0 * task.rounding);
        let is_sound = least < -4.0 * task.rounding && speed.is_finite() && turning.is_finite();
        is_sound.then_some(Self { task, side, center, radius, face, other, speed, turning, least })
    }

    /// Runs to the end.
    fn run(&self, contacts: &mut Contacts) -> Option<Ending> {
        let (mut t, mut tries) = (0.0, 0);
        for _ in 0..ROUNDS {
            let at = self.task.relative.at(t);
            let gap = self.gap(&at);
            contacts.counters.closed_forms += 1;
            if t == 0.0
                && gap <= 0.0
                && let Some(x) = self.deep(&at, gap)
            {
                return Some(Ending::Deep(x));
            }
            let span = self.span(&at, 1.0 - t);
            if gap.is_nan() || span <= 0.0 {
                break;
            }
            let close = NEAR.iter().filter(|near| gap <= *near * self.task.scale).count();
            if contacts.found.is_none() && close > tries {
                tries = close;
                // Who asks for a hit alone need not know more than that nothing was met until now.
                let is_enough = !self.task.query_options.time() && t > 0.0 && gap > 0.0;
                if self.attempt(contacts, &at, gap)
                    && is_enough
                    && let Some(hit) = contacts.end_from(t)
                {
                    return Some(hit);
                }
            }
            let end = contacts.goal().min(1.0);
            let proven = t + SURE * span;
            if proven >= end {
                return Some(contacts.end());
            }
            if proven <= t {
                break;
            }
            t = proven;
        }
        None
    }

    /// For how long from an instant on nothing is met, `most` or longer.
    fn span(&self, at: &Instant, most: f64) -> f64 {
        let (x, y) = self.center(at);
        let against = at.velocity(x);
        let velocity = if self.side == Side::A { at.b_from_a * against } else { -against };
        edges::of_solid(self.other, &Spans { advance: self, y, velocity, most })
    }

    /// The centre along A's axes and in the frame of the other body.
    fn center(&self, at: &Instant) -> (DVec3, DVec3) {
        match self.side {
            Side::A => (self.center, at.b_point(self.center)),
            Side::B => (at.a_point(self.center), at.a_point(self.center)),
        }
    }

    /// What is least as far from the centre as the other body is, by its faces and their edges, less r.
    fn gap(&self, at: &Instant) -> f64 {
        self.nearest(self.center(at).1).distance - self.radius
    }

    /// What decides at a point of the other body's frame how far that is from it.
    fn nearest(&self, y: DVec3) -> Nearest {
        edges::of_solid(self.other, &Distances { solid: &self.other.solid, y })
    }

    /// A point that is deep in both bodies at the start, where the ball reaches little into the other one.
    fn deep(&self, at: &Instant, gap: f64) -> Option<DVec3> {
        if -gap > SHALLOW * self.radius {
            return None;
        }
        let deep = self.between(at, gap);
        self.task.is_deep_at_start(deep, at).then_some(deep)
    }

    /// The point where the ball is as near, or as deep, as the faces that decide at its centre: it is gap / (1 + Σ cos), with their
    /// cosines to the direction to the centre. Before one face that is the middle.
    fn between(&self, at: &Instant, gap: f64) -> DVec3 {
        let (x, nearest, normal) = self.facing(at);
        let (mut whole, mut outward) = (1.0, DVec3::ZERO);
        for (id, part) in nearest.parts() {
            (whole, outward) = (whole + part, outward + self.outward(id, at));
        }
        x - normal * (self.radius + gap) + outward * (gap / whole)
    }

    /// The centre along A's axes, the faces that decide there, and the direction from the solid to the centre.
    fn facing(&self, at: &Instant) -> (DVec3, Nearest, DVec3) {
        let (x, y) = self.center(at);
        let nearest = self.nearest(y);
        let normal: DVec3 = nearest.parts().map(|(id, part)| self.outward(id, at) * part).sum();
        (x, nearest, normal)
    }

    /// The normal of a literal of the other body at the centre, along A's axes.
    fn outward(&self, id: LiteralId, at: &Instant) -> DVec3 {
        let normal = self.other.solid.faces[id.face() as usize].unit_normal(self.center(at).1);
        let normal = signed(id, normal);
        if self.side == Side::A { at.a_vector(normal) } else { normal }
    }

    /// Solves for the contact with the faces that decide at the centre, from when the gap is used up along their normal; true when it
    /// was confirmed.
    fn attempt(&self, contacts: &mut Contacts, at: &Instant, gap: f64) -> bool {
        let relative = &self.task.relative;
        // How fast the centre comes down against them.
        let against = if self.side == Side::A { -1.0 } else { 1.0 };
        let falls = {
            let (x, _, normal) = self.facing(at);
            against * normal.dot(at.velocity(x))
        };
        let when = at.t + gap.max(0.0) / falls;
        if !(falls > 0.0 && when <= 1.0 + 0.25 * (when - at.t)) {
            return false;
        }
        let when = when.min(1.0);
        let (x, nearest, normal) = self.facing(&relative.at(when));
        let others = if self.side == Side::A { Side::B } else { Side::A };
        let (mut active, mut lambda) = (Actives::new(), Weights::new());
        // The ball's normal is weighed against theirs; together the weights are 1.
        let whole: f64 = 1.0 + nearest.parts().map(|(_, part)| part).sum::<f64>();
        active.push(Constraint::Literal(self.side, self.face));
        lambda.push(1.0 / whole);
        for (id, part) in nearest.parts() {
            active.push(Constraint::Literal(others, id));
            lambda.push(part / whole);
        }
        contacts.confirm(active, x - normal * self.radius, when, lambda, false)
    }
}

/// A number or a vector of a face as the literal has it.
fn signed<T: std::ops::Neg<Output = T>>(id: LiteralId, of_face: T) -> T {
    if id.sense() == Sense::Positive { of_face } else { -of_face }
}

/// How far a solid is from a point at least, and by which literals: those of a face, an edge or a corner.
#[derive(Clone, Copy)]
struct Nearest {
    distance: f64,
    /// Each with the cosine of its normal to the direction from the solid to the point.
    literals: [(LiteralId, f64); MOST],
    count: usize,
}

impl Nearest {
    fn parts(&self) -> impl Iterator<Item = (LiteralId, f64)> + '_ {
        self.literals[..self.count].iter().copied()
    }
}

/// The distance from a point of the solid's frame.
struct Distances<'s> {
    solid: &'s Solid,
    y: DVec3,
}

impl Measure for Distances<'_> {
    /// The literal and its value.
    type Looked = (LiteralId, f64);
    type Told = Nearest;

    fn look(&self, id: LiteralId) -> Self::Looked {
        (id, signed(id, self.solid.faces[id.face() as usize].value(self.y)))
    }

    fn is_ahead(&self, looked: &Self::Looked) -> bool {
        looked.1 > 0.0
    }

    fn together(&self, looked: &[Self::Looked]) -> Nearest {
        let mut told = Self::constant(f64::NEG_INFINITY);
        for one in looked.iter().filter(|one| self.is_ahead(one)) {
            told.literals[told.count] = *one;
            told.count += 1;
        }
        if told.count < 2 {
            // The foremost, even where the point lies within what all of them allow.
            let foremost = looked.iter().max_by(|p, q| p.1.total_cmp(&q.1));
            if let Some(&(id, value)) = foremost {
                told = Nearest { distance: value, count: 1, ..told };
                told.literals[0] = (id, 1.0);
            }
            return told;
        }
        let whole = told.parts().map(|(_, value)| value * value).sum::<f64>().sqrt();
        told.literals[..told.count].iter_mut().for_each(|part| part.1 /= whole);
        told.distance = EDGE * whole;
        told
    }

    fn constant(value: f64) -> Nearest {
        Nearest { distance: value, literals: [(LiteralId::new(0, Sense::Positive), 0.0); MOST], count: 0 }
    }

    fn number(told: &Nearest) -> f64 {
        told.distance
    }
}

/// For how long the centre stays as far as excludes a contact.
struct Spans<'m, 't, 'a> {
    advance: &'m Advance<'t, 'a>,
    /// The centre in the other body's frame, and its velocity there.
    y: DVec3,
    velocity: DVec3,
    /// Longer is of no use.
    most: f64,
}

/// A literal that the centre comes towards.
#[derive(Clone, Copy)]
struct Falling {
    id: LiteralId,
    at: FaceAt,
    /// How far the centre is from what is as deep as is asked for.
    above: f64,
    /// How fast that falls now.
    falls: f64,
}

impl Spans<'_, '_, '_> {
    /// A bound on how fast a literal falls within a time h.
    fn rate(&self, l: &Falling, h: f64) -> f64 {
        let (advance, face) = (self.advance, &self.advance.other.solid.faces[l.id.face() as usize]);
        let bends = !(l.id.sense() == Sense::Positive && face.is_convex());
        let reach = advance.speed * h;
        l.falls + advance.turning * h + if bends { advance.speed * face.turn(self.y, &l.at, reach) } else { 0.0 }
    }

    /// How near the centre of a ball may come to what is as deep as is asked for.
    fn nearest(&self) -> f64 {
        self.advance.radius + 0.5 * self.advance.least
    }

    /// The time of one literal.
    fn single(&self, l: &Falling) -> f64 {
        let above = l.above - self.nearest();
        if above <= 0.0 || above.is_nan() || l.falls.is_nan() {
            return 0.0;
        }
        // The first is too long a time, maybe: the rate over it bounds that over all shorter ones.
        let first = (above / l.falls).min(4.0 * self.most);
        (above / self.rate(l, first)).min(first).max(above / self.advance.speed)
    }

    /// The time of an edge or a corner: while Σ (aᵢ − sᵢ h)² > ρ², with what is left above each face and how fast it falls.
    fn crossing(&self, edge: &[Falling]) -> f64 {
        let nearest = self.nearest();
        let square: f64 = edge.iter().map(|l| l.above * l.above).sum();
        let above = EDGE * square.sqrt() - nearest;
        if !(above > 0.0 && nearest > 0.0) || edge.iter().any(|l| l.falls.is_nan()) {
            return 0.0;
        }
        let time = |rates: &[f64]| {
            let (mut a, mut b, mut most) = (0.0, 0.0, f64::INFINITY);
            for (l, rate) in edge.iter().zip(rates) {
                (a, b, most) = (a + rate * rate, b + l.above * rate, most.min(l.above / rate));
            }
            let c = above * (EDGE * square.sqrt() + nearest);
            let root = b * b - a * c;
            // Each face is counted as long as the centre is ahead of it.
            if root >= 0.0 { (c / (b + root.sqrt())).min(most) } else { most }
        };
        let rates = |h: Option<f64>| -> SmallVec<[f64; MOST]> {
            edge.iter().map(|l| h.map_or(l.falls, |h| self.rate(l, h))).collect()
        };
        let first = time(&rates(None)).min(4.0 * self.most);
        time(&rates(Some(first))).min(first).max(above / self.advance.speed)
    }
}

impl Measure for Spans<'_, '_, '_> {
    type Looked = Falling;
    type Told = f64;

    fn look(&self, id: LiteralId) -> Falling {
        let at = self.advance.other.solid.faces[id.face() as usize].at(self.y);
        let falls = -signed(id, at.normal.dot(self.velocity));
        let falls = if falls.is_nan() { falls } else { falls.max(0.0) };
        Falling { id, at, above: signed(id, at.value) - 0.5 * self.advance.least, falls }
    }

    fn is_ahead(&self, looked: &Falling) -> bool {
        looked.above > 0.0
    }

    fn together(&self, looked: &[Falling]) -> f64 {
        let ahead: SmallVec<[Falling; MOST]> = looked.iter().filter(|l| self.is_ahead(l)).copied().collect();
        let alone = ahead.iter().map(|l| self.single(l)).fold(0.0, f64::max);
        if ahead.len() < 2 { alone } else { alone.max(self.crossing(&ahead)) }
    }

    fn constant(value: f64) -> f64 {
        value.max(0.0)
    }

    fn number(told: &f64) -> f64 {
        *told
    }
}
