//! In front of the search: convex primitives against solids with holes, answered by a proven advance.
//!
//! Idea: a body P meets K − H only where it meets K, and there only where it leaves H. While P cut by the faces of K lies
//! inside H, nothing is met, whatever else P does above and below. How far the cut body reaches in a direction across the
//! hole is told by its support and one multiplier (`body`); a sector of directions over a span of time is excluded by its
//! four corners (`proof`). So: (1) from the start, the lines along which the clearance falls say when and in which
//! direction it is used up first; (2) the faces that hold the body there are solved for a contact, as the search does
//! it, and both trees confirm it or it is none; (3) the time up to it is proven; what the proof meets instead is
//! solved in turn. No contact by the end: clear.
//!
//! Both solids may be unions; holes are cylinders or have flat faces; of several holes of one body the nearest one is asked.
//! P's own holes are left out, which only makes more of it. What starts nearer than a few resolutions, overlaps, or does not
//! settle is left to the search; nothing is guessed.
//! Source: conservative advancement (B. Mirtich, PhD thesis, Berkeley 1996) on a bound by duality; derivation in `proof`.

mod body;
mod proof;

use super::direct::faces_at;
use super::literal::Side;
use super::newton::Constraint;
use super::search::{Ending, Search};
use super::task::Task;
use crate::math::any_perpendicular;
use crate::motion::Relative;
use crate::solid::local::LiteralId;
use crate::solid::parts::Part;
use crate::solid::{Face, Primitive, Sense};
use body::{Best, Body, Moment, Plane};
use glam::DVec3;
use proof::{Verdict, Wall};
use smallvec::SmallVec;
use std::f64::consts::FRAC_1_SQRT_2;

/// Pairs of parts beyond which the search does better.
const MOST_PAIRS: usize = 256;
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
/// Contacts that are solved for before a pair is left to the search.
const MOST_CONTACTS: usize = 6;

/// A round wall: a point of its axis, the axis, its radius and face.
#[derive(Clone, Copy, Debug)]
struct Round {
    origin: DVec3,
    axis: DVec3,
    radius: f64,
    face: u32,
}

/// A convex body against a body with a hole that it is in; everything in the frame of the hole.
struct Pair<'a> {
    body: Body,
    primitive: &'a Primitive,
    /// The side of the body with the hole.
    side: Side,
    planes: SmallVec<[Plane; 6]>,
    round: Option<Round>,
    /// Eight directions across its axis.
    directions: [DVec3; 8],
    flats: SmallVec<[Plane; 6]>,
    /// Motion of the convex body as the other sees it.
    relative: &'a Relative,
    /// Its farthest point from its centre of rotation.
    reach: f64,
    delta: f64,
    rounding: f64,
    scale: f64,
}

/// Where a contact is looked for.
struct Guess {
    t: f64,
    best: Best,
    wall: Wall,
}

/// What the first look says.
enum First {
    /// The bodies may touch at the start.
    Near,
    /// Nothing within the time that was asked for.
    Never,
    Guess(Guess),
}

impl<'a> Pair<'a> {
    /// The pair of a body and a part with a hole near it, on `side`; `None` if they are not of that kind.
    fn new(task: &Task, primitive: &'a Primitive, part: Part, side: Side, relative: &'a Relative) -> Option<Self> {
        let model = if side == Side::A { task.model_a } else { task.model_b };
        let body = Body::of(primitive)?;
        let planes = |p: &Primitive| -> SmallVec<[Plane; 6]> {
            let faces = p.faces.iter().enumerate();
            faces
                .filter_map(|(i, face)| match *face {
                    Face::Plane { normal, offset } => Some(Plane { normal, offset, face: p.first_face + i as u32 }),
                    _ => None,
                })
                .collect()
        };
        // The hole that the body is deepest in, half way of the step.
        let center = relative.at(0.5).b_point(primitive.ball.center);
        let hole = model.parts.as_ref()?.deepest(&model.solid, part, center)?;
        let (mut round, mut directions) = (None, [DVec3::ZERO; 8]);
        for (i, face) in hole.faces.iter().enumerate() {
            match *face {
                Face::Cylinder { origin, axis, radius } => {
                    round = Some(Round { origin, axis, radius, face: hole.first_face + i as u32 });
                    let e = any_perpendicular(axis);
                    let f = axis.cross(e);
                    let (g, h) = ((e + f) * FRAC_1_SQRT_2, (f - e) * FRAC_1_SQRT_2);
                    directions = [e, g, f, h, -e, -g, -f, -h];
                }
                Face::Plane { .. } => {}
                Face::Sphere { .. } | Face::Cone { .. } => return None,
            }
        }
        let main = &model.solid.primitives[part.main as usize];
        let (middle, half) = (main.aabb.center(), main.aabb.half());
        // A wall that the pierced body does not reach is none.
        let is_wall = |p: &Plane| p.normal.dot(middle) + p.normal.abs().dot(half) > p.offset;
        let flats = planes(hole).into_iter().filter(is_wall).collect();
        let far = (primitive.ball.center - relative.center_a()).length() + primitive.ball.radius;
        Some(Self {
            body,
            primitive,
            side,
            planes: planes(main),
            round,
            directions,
            flats,
            relative,
            reach: far,
            delta: task.delta,
            rounding: task.rounding,
            scale: task.scale,
        })
    }

    fn moment(&self, t: f64) -> Moment {
        Moment::new(&self.body, self.relative.at(t), &self.planes)
    }

    fn radius(&self) -> f64 {
        self.round.map_or(0.0, |r| r.radius)
    }

    fn best(&self, m: &Moment, wall: Wall) -> Best {
        match (wall, &self.round) {
            (Wall::Round(u), Some(round)) => m.best(u, round.radius + round.origin.dot(u), &self.planes),
            (Wall::Flat(j), _) => m.best(self.flats[j].normal, self.flats[j].offset, &self.planes),
            (Wall::Round(_), None) => unreachable!("a round wall is asked for where there is one"),
        }
    }

    /// How fast φ grows with the angle of a round wall's direction about its axis.
    fn slope(&self, best: &Best) -> f64 {
        self.round.map_or(0.0, |r| -r.axis.cross(best.bound.u).dot(best.x - r.origin))
    }

    /// When the clearance of a bound is used up if it goes on falling as it does.
    fn when(&self, m: &Moment, best: &Best) -> f64 {
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
    fn lowest_beside(&self, m: &Moment, here: Best, rounds: usize) -> (DVec3, Best) {
        let u = here.bound.u;
        let falls = self.slope(&here) < 0.0;
        let Some(round) = &self.round else { return (u, here) };
        let turned = (u + round.axis.cross(u) * if falls { 1.0 } else { -1.0 }) * FRAC_1_SQRT_2;
        let there = self.best(m, Wall::Round(turned));
        let ends = if falls { [here, there] } else { [there, here] };
        self.lowest(m, ends, rounds)
    }

    /// The size that clearances are measured by.
    fn size(&self) -> f64 {
        self.round.map_or(self.primitive.ball.radius, |r| r.radius)
    }

    /// Looks for a contact before `until`: time goes on to where the first of a few directions runs out, until that is near.
    fn first(&self, until: f64, looks: &mut u64) -> First {
        let (mut t, mut floor) = (0.0, 0.0);
        for round in 0..ROUNDS {
            let m = self.moment(t);
            *looks += 1;
            let mut walls: SmallVec<[Wall; 16]> = (0..self.flats.len()).map(Wall::Flat).collect();
            if self.round.is_some() {
                walls.extend(self.directions.map(Wall::Round));
            }
            let mut soonest: Option<(f64, Wall, Best)> = None;
            let mut least: Option<(Wall, Best)> = None;
            for wall in walls {
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
    fn settle(&self, mut t: f64, mut wall: Wall, floor: f64, looks: &mut u64) -> Guess {
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
    fn solve(&self, search: &mut Search, guess: &Guess) -> bool {
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
                x = best.x - best.bound.u * (part * best.beyond());
                faces_at(other, self.primitive, at.a_point(x), w, 1e2 * tol, &mut active);
                if !active.is_empty() {
                    break;
                }
            }
            if active.is_empty() {
                return false;
            }
            active.push((Constraint::Literal(self.side, LiteralId::new(plane.face, Sense::Positive)), 1.0));
        } else {
            let face = match guess.wall {
                Wall::Round(_) => self.round.map(|r| r.face),
                Wall::Flat(j) => Some(self.flats[j].face),
            };
            let Some(face) = face else { return false };
            let w = best.bound.w();
            let length = w.length();
            faces_at(other, self.primitive, at.a_point(x), at.a_vector(w / length), tol, &mut active);
            if active.is_empty() {
                return false;
            }
            active.iter_mut().for_each(|(_, weight)| *weight *= length);
            active.push((Constraint::Literal(self.side, LiteralId::new(face, Sense::Negative)), 1.0));
            if let Some((plane, lambda)) = plane {
                active.push((Constraint::Literal(self.side, LiteralId::new(plane.face, Sense::Positive)), lambda));
            }
        }
        if active.len() > super::newton::MAX_ACTIVE {
            return false;
        }
        let total: f64 = active.iter().map(|(c, l)| if matches!(c, Constraint::Apex(..)) { 0.0 } else { *l }).sum();
        let (constraints, lambda) = active.iter().map(|(c, l)| (*c, l / total)).unzip();
        let x = if self.side == Side::A { x } else { at.a_point(x) };
        search.confirm(constraints, x, guess.t, lambda, true)
    }
}

/// The answer for two unions of convex primitives, of which one or both have holes; `None` leaves them to the search.
pub(super) fn answer(search: &mut Search) -> Option<Ending> {
    let task = search.task;
    let (of_a, of_b) = (task.model_a.parts.as_ref()?, task.model_b.parts.as_ref()?);
    let pierced = of_a.are_pierced() || of_b.are_pierced();
    if !pierced || of_a.all().len() * of_b.all().len() > MOST_PAIRS {
        return None;
    }
    let (placed_a, placed_b) = task.relative.placed();
    let seen_from_a = Relative::new(placed_b, placed_a);
    let mut pairs: SmallVec<[(Pair, Option<DVec3>); 1]> = SmallVec::new();
    let mut guess: Option<(usize, Guess)> = None;
    for a in of_a.all() {
        for b in of_b.all() {
            let (main_a, main_b) = (&task.a.primitives[a.main as usize], &task.b.primitives[b.main as usize]);
            let of_b = || Pair::new(&task, main_a, *b, Side::B, &task.relative);
            let of_a = || Pair::new(&task, main_b, *a, Side::A, &seen_from_a);
            let pair = if b.is_pierced() { of_b().or_else(of_a) } else { of_a() }?;
            // Later ones than what is known are not looked for to their end.
            let until = guess.as_ref().map_or(1.0, |(_, g)| g.t);
            match pair.first(until, &mut search.counters.closed_forms) {
                First::Near => return None,
                First::Never => pairs.push((pair, None)),
                First::Guess(g) => {
                    pairs.push((pair, if let Wall::Round(u) = g.wall { Some(u) } else { None }));
                    if guess.as_ref().is_none_or(|(_, other)| g.t < other.t) {
                        guess = Some((pairs.len() - 1, g));
                    }
                }
            }
        }
    }
    let mut solved = 0;
    if let Some((i, g)) = &guess {
        solved += 1;
        if !pairs[*i].0.solve(search, g) {
            return None;
        }
    }
    for (pair, toward) in &pairs {
        loop {
            let end = search.goal().min(1.0);
            let (verdict, looks) = pair.prove(end, *toward);
            search.counters.closed_forms += looks;
            match verdict {
                Verdict::Proven => break,
                Verdict::Open => return None,
                Verdict::Met(t, wall) => {
                    solved += 1;
                    let goal = search.goal();
                    let guess = pair.settle(t, wall, 0.0, &mut search.counters.closed_forms);
                    let found = solved <= MOST_CONTACTS && pair.solve(search, &guess);
                    if !(found && search.goal() < goal) {
                        return None;
                    }
                }
            }
        }
    }
    Some(search.found.take().map_or(Ending::Clear, Ending::Contact))
}

#[cfg(test)]
mod tests;
