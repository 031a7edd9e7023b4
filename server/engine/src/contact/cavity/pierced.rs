//! A convex body against a body with a cavity that it is in: its clearances, and the contact that they point to.

use super::body::{Best, Bound, CavityBody, Moment, Plane};
use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::Task;
use crate::contact::witness::contacts::Contacts;
use crate::contact::witness::faces::faces_at;
use crate::contact::witness::newton::{self, Constraint};
use crate::math::any_perpendicular;
use crate::motion::Relative;
use crate::solid::local::LiteralId;
use crate::solid::surface::Axis;
use crate::solid::{Face, Primitive, Sense};
use glam::DVec3;
use smallvec::SmallVec;
use std::f64::consts::FRAC_1_SQRT_2;

/// Resolutions that the bodies must be apart at the start: what is nearer may be touching, which the search tells.
const APART: f64 = 4.0;
/// Moments at which the first contact is looked for.
const ROUNDS: usize = 16;
/// A clearance below this part of the wall's radius, or of the body's size, is small: the equations take over.
const ARRIVED: f64 = 0.02;
/// Clearance in eight directions, in the same measure, above which none is used up between them: what reaches R in one
/// direction reaches R cos(π/8) in the next, so 1 − cos(π/8) = .077 would do.
const BETWEEN: f64 = 0.1;
/// Way, in the same measure, that a look goes farther than the clearance lasts.
const HASTY: f64 = 0.04;
/// How near to its point, relative to the pair's scale, a face passes that is active there.
const ACTIVE: f64 = 1e-9;
/// A clearance, in the same measure, from which the equations are sure to find the contact, and steps that it may take.
const SETTLED: f64 = 1e-4;
const SETTLING: u32 = 4;
/// tan α of a cone's half angle up to which it is taken for a wall: a flatter one is hardly entered.
const STEEPEST: f64 = 4.0;

/// One direction of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Wall {
    /// The round wall in a direction from its axis.
    Round(DVec3),
    /// One of the flat walls.
    Flat(usize),
}

impl Wall {
    /// The direction of a round one.
    pub(super) fn direction(self) -> Option<DVec3> {
        if let Self::Round(u) = self { Some(u) } else { None }
    }
}

/// A round wall, of a cylinder or a cone: the middle of its widest section, the axis, the radius there, and its face.
#[derive(Clone, Copy, Debug)]
pub(super) struct Round {
    pub(super) origin: DVec3,
    pub(super) axis: DVec3,
    pub(super) radius: f64,
    /// A cone's planes that touch it lean: the one in direction u across the axis is (u + lean)·(x − origin) = radius.
    pub(super) lean: DVec3,
    pub(super) literal: LiteralId,
}

impl Round {
    /// The round wall that a face of a cavity is, if it is one.
    fn of(cavity: &Primitive, face: &Face, literal: LiteralId) -> Option<Self> {
        let Axis { origin, direction: axis } = face.axis().filter(|_| face.developable().is_some())?;
        if let Some(radius) = face.radius() {
            return Some(Self { origin, axis, radius, lean: DVec3::ZERO, literal });
        }
        let apex = face.apex().filter(|apex| apex.rows.is_none() && apex.sin <= STEEPEST * apex.cos)?;
        let discs = cavity.shape.convex().discs()?;
        let (center, radius) = discs.into_iter().max_by(|d, e| d.1.total_cmp(&e.1))?;
        let lean = apex.axis * (-apex.sin / apex.cos);
        Some(Self { origin: cavity.frame.point(center), axis: apex.axis, radius, lean, literal })
    }

    /// The direction across the axis that a bound's plane is of.
    pub(super) fn across(&self, bound: &Bound) -> DVec3 {
        bound.u - self.lean
    }

    /// The largest radius at which a point may be `delta` beyond the wall's widest section.
    pub(super) fn widest(&self, delta: f64) -> f64 {
        self.radius + self.lean.length() * delta
    }
}

/// A convex body against a body with a cavity that it is in; everything in the frame of the cavity.
#[derive(Clone)]
pub(super) struct CavityPair<'a> {
    pub(super) body: CavityBody,
    pub(super) primitive: &'a Primitive,
    pub(super) cavity: &'a Primitive,
    /// The side of the body with the cavity.
    pub(super) side: Side,
    pub(super) planes: SmallVec<[Plane; 6]>,
    pub(super) round: Option<Round>,
    /// Eight directions across its axis.
    pub(super) directions: [DVec3; 8],
    pub(super) flats: SmallVec<[Plane; 6]>,
    /// Motion of the convex body as the other sees it.
    pub(super) relative: &'a Relative,
    /// Its farthest point from its centre of rotation.
    pub(super) reach: f64,
    /// The pierced body's farthest point from the origin of its frame, or what is farther.
    pub(super) extent: f64,
    pub(super) delta: f64,
    pub(super) rounding: f64,
    pub(super) scale: f64,
}

/// Where a contact is looked for.
pub(super) struct Guess {
    pub(super) t: f64,
    pub(super) best: Best,
    pub(super) wall: Wall,
}

/// What the first look says.
pub(super) enum First {
    /// The bodies may touch at the start.
    Near,
    /// Nothing within the time that was asked for.
    Never,
    Guess(Guess),
}

impl<'a> CavityPair<'a> {
    /// The pair of a body and a primitive that is pierced by a cavity, on `side`; `None` if they are not of that kind.
    pub(super) fn new(
        task: &Task,
        primitive: &'a Primitive,
        (main, cavity): (&Primitive, &'a Primitive),
        side: Side,
        relative: &'a Relative,
    ) -> Option<Self> {
        let body = CavityBody::of(primitive)?;
        let planes = |p: &Primitive, sense: Sense| -> SmallVec<[Plane; 6]> {
            let faces = p.faces.listed().iter().enumerate();
            faces
                .filter_map(|(i, face)| {
                    let (normal, offset) = face.flat()?;
                    Some(Plane { normal, offset, literal: LiteralId::new(p.first_face + i as u32, sense) })
                })
                .collect()
        };
        let (mut round, mut directions) = (None, [DVec3::ZERO; 8]);
        for (i, face) in cavity.faces.listed().iter().enumerate() {
            if face.is_flat() {
                continue;
            }
            // Of round walls those alone that are straight along an axis, and one.
            if round.is_some() {
                return None;
            }
            let literal = LiteralId::new(cavity.first_face + i as u32, Sense::Negative);
            let wall = Round::of(cavity, face, literal)?;
            round = Some(wall);
            let e = any_perpendicular(wall.axis);
            let f = wall.axis.cross(e);
            let (g, h) = ((e + f) * FRAC_1_SQRT_2, (f - e) * FRAC_1_SQRT_2);
            directions = [e, g, f, h, -e, -g, -f, -h];
        }
        let (middle, half) = (main.aabb.center(), main.aabb.half());
        // A wall that the pierced body does not reach is none. One without bounds has no middle, and reaches all.
        let reach = |p: &Plane| p.normal.dot(middle) + p.normal.abs().dot(half);
        let is_wall = |p: &Plane| reach(p).is_nan() || reach(p) > p.offset;
        let flats = planes(cavity, Sense::Negative).into_iter().filter(is_wall).collect();
        let far = (primitive.ball.center - relative.center_a()).length() + primitive.ball.radius;
        Some(Self {
            body,
            primitive,
            cavity,
            side,
            planes: planes(main, Sense::Positive),
            round,
            directions,
            flats,
            relative,
            reach: far,
            extent: middle.length() + half.length(),
            delta: task.delta,
            rounding: task.rounding,
            scale: task.scale,
        })
    }

    pub(super) fn moment(&self, t: f64) -> Moment {
        Moment::new(&self.body, self.relative.at(t), &self.planes)
    }

    /// The largest radius at which the round wall may be met.
    pub(super) fn radius(&self) -> f64 {
        self.round.map_or(0.0, |r| r.widest(self.delta))
    }

    pub(super) fn best(&self, m: &Moment, wall: Wall) -> Best {
        match (wall, &self.round) {
            (Wall::Round(u), Some(round)) => {
                let u = u + round.lean;
                m.best(u, round.radius + round.origin.dot(u), &self.planes)
            }
            (Wall::Flat(j), _) => m.best(self.flats[j].normal, self.flats[j].offset, &self.planes),
            (Wall::Round(_), None) => unreachable!("a round wall is asked for where there is one"),
        }
    }

    /// Its flat walls, and a few directions of its round one.
    pub(super) fn walls(&self) -> impl Iterator<Item = Wall> {
        let around = if self.round.is_some() { &self.directions[..] } else { &[] };
        (0..self.flats.len()).map(Wall::Flat).chain(around.iter().copied().map(Wall::Round))
    }

    /// How fast φ grows with the angle of a round wall's direction about its axis.
    pub(super) fn slope(&self, best: &Best) -> f64 {
        self.round.map_or(0.0, |r| -r.axis.cross(best.bound.u).dot(best.x - r.origin))
    }

    /// When the clearance of a bound is used up if it goes on falling as it does.
    pub(super) fn when(&self, m: &Moment, best: &Best) -> f64 {
        let velocity = m.at.b_from_a * m.at.velocity(m.at.a_point(best.x));
        let closing = best.bound.w().dot(velocity);
        if closing > 0.0 {
            m.at.t + best.phi / closing
        } else if best.phi > 0.0 {
            f64::INFINITY
        } else {
            m.at.t
        }
    }

    /// The lowest direction within an eighth of a turn of the one that `here` is of.
    pub(super) fn lowest_beside(&self, m: &Moment, here: Best, rounds: usize) -> (DVec3, Best) {
        let Some(round) = &self.round else { return (here.bound.u, here) };
        let (u, falls) = (round.across(&here.bound), self.slope(&here) < 0.0);
        let turned = (u + round.axis.cross(u) * if falls { 1.0 } else { -1.0 }) * FRAC_1_SQRT_2;
        let there = self.best(m, Wall::Round(turned));
        let ends = if falls { [here, there] } else { [there, here] };
        self.lowest(m, ends, rounds)
    }

    /// The size that clearances are measured by.
    pub(super) fn size(&self) -> f64 {
        self.round.map_or(self.primitive.ball.radius, |r| r.radius)
    }

    /// Looks for a contact before `until`: time goes on to where the first of a few directions runs out, until that is near.
    pub(super) fn first(&self, until: f64, looks: &mut u64) -> First {
        let (mut t, mut floor) = (0.0, 0.0);
        for round in 0..ROUNDS {
            let m = self.moment(t);
            *looks += 1;
            let mut soonest: Option<(f64, Wall, Best)> = None;
            let mut least: Option<(Wall, Best)> = None;
            for wall in self.walls() {
                let best = self.best(&m, wall);
                let when = self.when(&m, &best);
                if soonest.as_ref().is_none_or(|s| when < s.0) {
                    soonest = Some((when, wall, best));
                }
                if least.as_ref().is_none_or(|l| best.phi < l.1.phi) {
                    least = Some((wall, best));
                }
            }
            let (Some((mut when, mut wall, mut best)), Some((mut nearest, mut low))) = (soonest, least) else {
                return First::Near;
            };
            if let (Wall::Round(_), true) = (nearest, low.phi <= BETWEEN * self.size()) {
                let (u, best) = self.lowest_beside(&m, low, 3);
                (nearest, low) = (Wall::Round(u), best);
            }
            let beside = self.when(&m, &low);
            if beside < when {
                (when, wall, best) = (beside, nearest, low);
            }
            if round == 0 && low.phi <= APART * self.delta * low.bound.weight() {
                return First::Near;
            }
            if low.phi > 0.0 {
                floor = t;
            }
            if when > until {
                return First::Never;
            }
            if when <= floor && floor < t {
                // The lines of what is behind the wall lead too far back.
                when = 0.5 * (floor + t);
            }
            if best.lands() && best.beyond() > 0.0 {
                let m = self.moment(when);
                return First::Guess(Guess { t: when, best: self.best(&m, wall), wall });
            }
            if low.phi.abs() <= ARRIVED * self.size() || round + 1 == ROUNDS {
                return First::Guess(self.settle(when, wall, floor, looks));
            }
            // The clearance falls ever slower once the body has entered: a little farther, which cannot miss much.
            let speed = self.relative.bounds(t, 1.0 - t, self.reach).speed;
            let ahead = if low.phi > 0.0 { (when - t).min(HASTY * self.size() / speed) } else { 0.0 };
            t = (when + ahead).clamp(0.0, 1.0);
        }
        First::Never
    }

    /// From a time and a direction near a contact to those at which the clearance is used up.
    pub(super) fn settle(&self, mut t: f64, mut wall: Wall, floor: f64, looks: &mut u64) -> Guess {
        for round in 0.. {
            let m = self.moment(t);
            *looks += 1;
            let mut best = self.best(&m, wall);
            if let Wall::Round(_) = wall {
                let (u, lowest) = self.lowest_beside(&m, best, 5);
                (wall, best) = (Wall::Round(u), lowest);
            }
            if round == SETTLING || best.phi.abs() <= SETTLED * self.size() {
                return Guess { t, best, wall };
            }
            let when = self.when(&m, &best);
            t = if when <= floor { 0.5 * (floor + t) } else { when.min(1.0) };
        }
        unreachable!("the last round returns")
    }

    /// Solves for the contact that a guess points to; true when both trees confirm it.
    pub(super) fn solve(&self, contacts: &mut Contacts, guess: &Guess) -> bool {
        let at = self.relative.at(guess.t);
        let other = if self.side == Side::A { Side::B } else { Side::A };
        let best = &guess.best;
        let mut active: SmallVec<[(Constraint, f64); 8]> = SmallVec::new();
        let tol = ACTIVE * self.scale;
        let mut x = best.x;
        let plane = best.plane.map(|(k, lambda)| (&self.planes[k], lambda));
        if let (true, Some((plane, _))) = (best.lands(), plane) {
            // Half way between the wall and the farthest point of what lands, if that is flat.
            let w = at.a_vector(-plane.normal);
            for part in [0.5, 0.0] {
                x = best.x - best.bound.u * (part * best.beyond() / best.bound.u.length_squared());
                faces_at(other, self.primitive, at.a_point(x), w, 1e2 * tol, &mut active);
                if !active.is_empty() {
                    break;
                }
            }
            if active.is_empty() {
                return false;
            }
            active.push((Constraint::Literal(self.side, plane.literal), 1.0));
        } else {
            let wall = match guess.wall {
                Wall::Round(_) => self.round.map(|r| r.literal),
                Wall::Flat(j) => Some(self.flats[j].literal),
            };
            let Some(wall) = wall else { return false };
            let w = best.bound.w();
            let length = w.length();
            faces_at(other, self.primitive, at.a_point(x), at.a_vector(w / length), tol, &mut active);
            if active.is_empty() {
                return false;
            }
            active.iter_mut().for_each(|(_, weight)| *weight *= length);
            active.push((Constraint::Literal(self.side, wall), 1.0));
            if let Some((plane, lambda)) = plane {
                active.push((Constraint::Literal(self.side, plane.literal), lambda));
            }
        }
        if active.len() > newton::MAX_ACTIVE {
            return false;
        }
        let total: f64 = active.iter().map(|(c, l)| if matches!(c, Constraint::Apex(..)) { 0.0 } else { *l }).sum();
        let (constraints, lambda) = active.iter().map(|(c, l)| (*c, l / total)).unzip();
        let x = if self.side == Side::A { x } else { at.a_point(x) };
        contacts.confirm(constraints, x, guess.t, lambda, true)
    }
}
