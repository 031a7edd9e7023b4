//! In front of the search: a ball against any solid, advanced by how far the solid is from its centre.
//!
//! Idea: f of a solid changes no faster than the distance. So a point x that is δ deep in a ball of centre c and radius r, and as deep in a
//! solid, has f(c) <= f(x) + |x − c| <= −δ + (r − δ): while f(c) > r − 2δ there is none. The centre moves by V in a step at most, and
//! turns aside by less than A h in a time h. So what a face says of the centre falls in h by no more than (s + V τ(V h) + A h) h, where
//! s is how fast it falls now and τ how far its gradient turns within reach (none where ψ is convex and the solid lies below it). That
//! tells for each face how long it stays above r − 2δ; for an intersection of solids the longest of these times holds, for a union the
//! shortest. Where the centre comes towards a face, each advance doubles the digits.
//!
//! Where the foot of the centre lies on the one face that decides there, ball and solid touch when f(c) = r, before what is proven
//! ends: the faces are solved for that contact as the search does it, and both trees confirm it or it is none. Beside an edge f(c) is less
//! than the distance: that is left to the search.
//!
//! Source: sphere tracing (J. C. Hart, The Visual Computer 12, 1996) of the centre; conservative advancement (B. Mirtich, PhD thesis,
//! Berkeley 1996).

use super::convex::{APART, excluded};
use super::exclusion::literal::Side;
use super::query::task::Task;
use super::witness::contacts::Contacts;
use super::witness::found::Ending;
use super::witness::newton::{Actives, Constraint, Weights};
use crate::motion::Instant;
use crate::octree::Model;
use crate::solid::local::{self, LiteralId};
use crate::solid::{Sense, Solid};
use glam::DVec3;

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

/// The answer for a pair of which one is a ball; `None` leaves it to the search, as it was.
pub(super) fn answer(contacts: &mut Contacts) -> Option<Ending> {
    at_depth(contacts, false)
}

/// The same for a pair that is known to touch at the start, at the depth that is searched for by now.
pub(super) fn answer_of_touching(contacts: &mut Contacts) -> Option<Ending> {
    at_depth(contacts, true)
}

fn at_depth(contacts: &mut Contacts, touches: bool) -> Option<Ending> {
    let task = contacts.task;
    if task.delta <= 0.0 || task.ignored_depth > 0.0 {
        return None;
    }
    let advance = Advance::of(&task)?;
    let before = (contacts.found.clone(), contacts.hints.clone());
    let ending = advance.run(contacts, touches);
    if ending.is_none() {
        // What touches beside it first was not proven. What others have confirmed stays.
        (contacts.found, contacts.hints) = before;
    }
    ending
}

/// The centre and the radius of a solid that is a ball, in its own frame, and its face.
fn ball(solid: &Solid) -> Option<(DVec3, f64, LiteralId)> {
    // Its number is not 0 where the tree once had more than is left of it.
    let whole = solid.whole()?;
    let [face] = whole.faces.listed() else { return None };
    let (center, radius) = face.ball()?;
    Some((center, radius, LiteralId::new(whole.first_face, Sense::Positive)))
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
        let of = |side, solid, other| ball(solid).map(|ball| (side, ball, other));
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

    /// Runs to the end; a start at which the bodies touch is left to the search, unless that is known of them or deep.
    fn run(&self, contacts: &mut Contacts, touches: bool) -> Option<Ending> {
        let (mut t, mut tries) = (0.0, 0);
        for _ in 0..ROUNDS {
            let at = self.task.relative.at(t);
            let gap = self.gap(&at);
            contacts.counters.closed_forms += 1;
            if t == 0.0 && gap <= APART * self.task.delta {
                if let Some(x) = self.deep(&at, gap) {
                    return Some(Ending::Deep(x));
                }
                if !touches {
                    break;
                }
            }
            if gap <= self.least || gap.is_nan() {
                break;
            }
            let close = NEAR.iter().filter(|near| gap <= *near * self.task.scale).count();
            if contacts.found.is_none() && close > tries {
                tries = close;
                if self.attempt(contacts, &at, gap)
                    && let Some(hit) = (t > 0.0).then(|| contacts.hit(t)).flatten()
                {
                    return Some(hit);
                }
            }
            let end = contacts.goal().min(1.0);
            let proven = t + SURE * self.span(&at, 1.0 - t);
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
        let solid = &self.other.solid;
        let (x, y) = self.center(at);
        let against = at.velocity(x);
        let velocity = if self.side == Side::A { at.b_from_a * against } else { -against };
        local::value_of_literals(&solid.normal_form, &mut |id| {
            let face = &solid.faces[id.face() as usize];
            let here = face.at(y);
            let is_positive = id.sense() == Sense::Positive;
            let sign = if is_positive { 1.0 } else { -1.0 };
            let above = sign * here.value - self.radius - self.least;
            let falls = -sign * here.normal.dot(velocity);
            if above <= 0.0 || above.is_nan() || falls.is_nan() {
                return 0.0;
            }
            let falls = falls.max(0.0);
            let bends = !(is_positive && face.is_convex());
            // The first is too long a time, maybe: the rate over it bounds that over all shorter ones.
            let rate = |h: f64| {
                let reach = self.speed * h;
                falls + self.turning * h + if bends { self.speed * face.turn(y, &here, reach) } else { 0.0 }
            };
            let first = (above / falls).min(4.0 * most);
            (above / rate(first)).min(first).max(above / self.speed)
        })
    }

    /// The centre along A's axes and in the frame of the other body.
    fn center(&self, at: &Instant) -> (DVec3, DVec3) {
        match self.side {
            Side::A => (self.center, at.b_point(self.center)),
            Side::B => (at.a_point(self.center), at.a_point(self.center)),
        }
    }

    /// f(c) − r: no more than the distance of the bodies.
    fn gap(&self, at: &Instant) -> f64 {
        self.other.value(self.center(at).1) - self.radius
    }

    /// A point that is deep in both bodies at the start, where the ball reaches little into the other one: in the middle between its
    /// surface and that of the face that decides at its centre.
    fn deep(&self, at: &Instant, gap: f64) -> Option<DVec3> {
        if -gap > SHALLOW * self.radius {
            return None;
        }
        let (x, _, normal) = self.facing(at);
        let middle = x - normal * (self.radius + 0.5 * gap);
        self.task.is_deep_at_start(middle, at).then_some(middle)
    }

    /// The centre along A's axes, the face that decides there, and its direction from the solid to the centre.
    fn facing(&self, at: &Instant) -> (DVec3, LiteralId, DVec3) {
        let (x, y) = self.center(at);
        let (_, id) = self.other.deciding(y);
        let normal = self.other.solid.faces[id.face() as usize].unit_normal(y);
        let normal = if id.sense() == Sense::Positive { normal } else { -normal };
        (x, id, if self.side == Side::A { at.a_vector(normal) } else { normal })
    }

    /// Solves for the contact with the face that decides at the centre, from when the gap is used up along its normal; true when it was
    /// confirmed.
    fn attempt(&self, contacts: &mut Contacts, at: &Instant, gap: f64) -> bool {
        let relative = &self.task.relative;
        // How fast the centre comes down against it.
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
        let (x, id, normal) = self.facing(&relative.at(when));
        let others = if self.side == Side::A { Side::B } else { Side::A };
        let mut active = Actives::new();
        active.push(Constraint::Literal(self.side, self.face));
        active.push(Constraint::Literal(others, id));
        let mut lambda = Weights::new();
        lambda.push(0.5);
        lambda.push(0.5);
        contacts.confirm(active, x - normal * self.radius, when, lambda, false)
    }
}
