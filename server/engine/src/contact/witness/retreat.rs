//! From a witness back to where its bodies come to touch, where no equations lead there.
//!
//! The deepest common point is climbed to (`depth`) at the witness' time, and held in one of the bodies while time is
//! taken back, until it leaves the other one. Until then both have it in common, so from there the next climb starts.
//! So time goes back as long as the bodies have any depth in common there, whichever faces decide on the way, and along
//! a crescent between two like faces, whose equations are singular. Where no depth is left the surfaces touch, or the
//! step starts.

use super::features::Features;
use super::newton::{Constraint, HELD, MAX_ACTIVE};
use crate::contact::exclusion::fit;
use crate::contact::exclusion::literal::Side;
use crate::contact::instant::work::Work;
use crate::contact::instant::{depth, separation};
use crate::contact::query::task::Task;
use crate::motion::Instant;
use crate::solid::local::{self, LiteralId};
use crate::solid::{Face, Sense, Solid};
use glam::DVec3;

/// Climbs on the way back. Where the depth vanishes with its rate, each halves what is left of the time.
const RETREATS: usize = 64;

/// Cells' worth of work that the way back to a touch may take.
pub(in crate::contact) const BACK: u64 = 20_000;

/// On the way back a point counts as the deepest if none beside it is deeper by more than this part: the way leads back from any.
const ON_THE_WAY: f64 = 0.05;

/// How far a climb looks first, in depths, where bodies are thin.
const BESIDE: f64 = 64.0;

/// How much further each look back goes.
const FURTHER: f64 = 4.0;

/// The first step along a wall, a part of the pair's scale; corrections of a step where the wall is curved; how much deeper a step
/// of its length must lead, and how near to the middle of the wall it must end, in parts of the wall's depth.
const AHEAD: f64 = 0.1;
const BENDS: usize = 3;
const DEEPER: f64 = 1e-3;
const MIDDLE: f64 = 0.9;

/// The faces of a wall pass a point in its middle by no more than this many times its depth, and their normals miss each other by no
/// more than this.
const THICK: f64 = 1.0 + 1e-3;
const OPPOSITE: f64 = 1e-6;

/// Halvings of the time at which a held point leaves.
const HALVINGS: usize = 12;

/// A climb's end that is this many roundings deep lies on both surfaces.
pub(in crate::contact) const ON_SURFACE: f64 = 4.0;

/// A positive round face and a subtracted one of the other body.
struct Fit<'a> {
    side: Side,
    positive: &'a Face,
    negative: &'a Face,
}

/// Pairs of like faces that are looked at.
const FITS: usize = 16;

/// Heights on a positive face at which it may meet first, in radii of its body.
const HEIGHTS: [f64; 7] = [0.0, -1.0, -0.5, -0.25, 0.25, 0.5, 1.0];

impl Fit<'_> {
    /// Where the positive face is on the wall of the other one first, on several heights of both, beside `x`.
    fn guesses(&self, task: &Task, at: &Instant, x: DVec3) -> impl Iterator<Item = DVec3> {
        let axis = self.positive.axis().map_or(DVec3::ZERO, |axis| axis.direction);
        let (axis, radius) = match self.side {
            Side::A => (axis, task.model_a.radius),
            Side::B => (at.a_vector(axis), task.model_b.radius),
        };
        let heights = if axis == DVec3::ZERO { 1 } else { HEIGHTS.len() };
        HEIGHTS[..heights].iter().filter_map(move |h| {
            fit::first_off_axis(at, (self.side, self.positive), self.negative, x + axis * (h * radius))
        })
    }
}

/// The pairs of faces that may fit into each other.
fn alike<'a>(task: &Task<'a>) -> Vec<Fit<'a>> {
    let round = |solid: &'a Solid, sense: Sense| -> Vec<&'a Face> {
        if solid.has_parts {
            // Of a large mesh all faces are flat: what is curved is no part of it.
            let own = |i: usize| solid.senses[solid.face_owner[i] as usize] == sense;
            let curved = solid.faces.kept().filter(|(i, face)| own(*i) && !face.is_flat());
            return curved.map(|(_, face)| face).take(FITS).collect();
        }
        let mut ids: Vec<LiteralId> = local::literals(&solid.normal_form).filter(|id| id.sense() == sense).collect();
        ids.sort_unstable();
        ids.dedup();
        let faces = ids.into_iter().map(|id| &solid.faces[id.face() as usize]);
        faces.filter(|face| !face.is_flat()).take(FITS).collect()
    };
    let mut fits = Vec::new();
    for (side, own, other) in [(Side::A, task.a, task.b), (Side::B, task.b, task.a)] {
        let negative = round(other, Sense::Negative);
        for positive in round(own, Sense::Positive) {
            fits.extend(negative.iter().map(|negative| Fit { side, positive, negative }));
        }
    }
    fits.truncate(FITS);
    fits
}

/// The constraints of some literals with their weights, no more than a system may hold.
pub(in crate::contact) fn held(support: &[(Side, LiteralId, f64)]) -> impl Iterator<Item = (Constraint, f64)> {
    let total: f64 = support.iter().map(|s| s.2).sum();
    support.iter().take(MAX_ACTIVE.min(HELD)).map(move |s| (Constraint::Literal(s.0, s.1), s.2 / total))
}

/// Climbs to deepest common points at any time, and from there back to where a common depth begins.
pub(in crate::contact) struct Climber<'t, 'a> {
    task: &'t Task<'a>,
    fits: Vec<Fit<'a>>,
    work: Work,
}

impl<'t, 'a> Climber<'t, 'a> {
    /// For a pair, with a limit of work in cells, after which no way back begins another climb.
    pub(in crate::contact) fn new(task: &'t Task<'a>, cells: u64) -> Self {
        Self { task, fits: alike(task), work: Work::new(cells) }
    }

    /// True when no more may be done.
    pub(in crate::contact) fn is_spent(&self) -> bool {
        self.work.is_spent()
    }

    /// Cells' worth of work done.
    pub(in crate::contact) fn cells(&self) -> u64 {
        self.work.cells()
    }

    fn value(&self, at: &Instant, x: DVec3) -> f64 {
        self.work.look(self.task.a.faces.len() + self.task.b.faces.len());
        separation::value(self.task, at, x)
    }

    /// The deepest common point beside x at a time, what holds it and how deep it is.
    pub(in crate::contact) fn deepest(&self, t: f64, x: DVec3) -> depth::Held {
        self.deepest_by(t, x, 0.0)
    }

    /// The same but for a part of the depth.
    fn deepest_by(&self, t: f64, x: DVec3, part: f64) -> depth::Held {
        let at = self.task.relative.at(t);
        // Between two like faces the way along them is long and hardly leads down: where they part is told outright.
        let guesses = self.fits.iter().flat_map(|fit| fit.guesses(self.task, &at, x));
        let (mut best, mut least) = (x, separation::value(self.task, &at, x));
        for guess in guesses {
            // What is not common is not deeper than what is.
            if least <= 0.0 && !self.is_common(&at, guess) {
                continue;
            }
            let v = self.value(&at, guess);
            if v < least {
                (best, least) = (guess, v);
            }
        }
        depth::climb_within((None, part), self.task, &at, best, &self.work)
    }

    /// True for a point of both bodies.
    fn is_common(&self, at: &Instant, x: DVec3) -> bool {
        self.work.look(self.task.a.faces.len() + self.task.b.faces.len());
        let (model_a, model_b) = (self.task.model_a, self.task.model_b);
        model_a.value_within(x, 0.0) <= 0.0 && model_b.value_within(at.b_point(x), 0.0) <= 0.0
    }

    /// The same, not far from x. Elsewhere a thin wall may be deeper, but no part of what both bodies have in common
    /// there.
    fn deepest_beside(&self, t: f64, x: DVec3, depth: f64) -> depth::Held {
        if !self.fits.is_empty() && !self.task.has_walls() {
            return self.deepest_by(t, x, ON_THE_WAY);
        }
        let reach = (BESIDE * depth).min(0.5 * self.task.scale);
        depth::climb_within((Some(reach), ON_THE_WAY), self.task, &self.task.relative.at(t), x, &self.work)
    }

    /// Back to where the common depth of x begins. At each time on the way `solve` may name the touch; else it is where
    /// no depth is left, or what is held at the start. `None` where the way back ends before.
    pub(in crate::contact) fn back<T>(
        &self,
        (mut t, mut x, mut depth): (f64, DVec3, f64),
        solve: impl Fn(f64, &depth::Held) -> Option<T>,
    ) -> Option<Result<T, (f64, depth::Held)>> {
        let least = ON_SURFACE * self.task.rounding;
        let mut last = None;
        for _ in 0..RETREATS {
            let found = self.deepest_beside(t, x, depth);
            let found = self.wall_of(t, &found).map_or_else(|| found.clone(), |wall| self.along(t, wall, &found));
            if let Some(solved) = solve(t, &found) {
                return Some(Ok(solved));
            }
            if t == 0.0 || found.1 <= least {
                // The end of the way is told itself: as deep as it is.
                let at = self.task.relative.at(t);
                let found = depth::climb_within((Some(found.1.abs()), 0.0), self.task, &at, found.0, &self.work);
                return match solve(t, &found) {
                    Some(solved) => Some(Ok(solved)),
                    None => (found.1 >= -least).then_some(Err((t, found))),
                };
            }
            // How it moves in the frames of both.
            let in_b = self.task.relative.at(t).b_point(found.0);
            let drift = last.map_or([DVec3::ZERO; 2], |(later, there): (f64, [DVec3; 2])| {
                [there[0] - found.0, there[1] - in_b].map(|way| way / (later - t))
            });
            last = Some((t, [found.0, in_b]));
            let (since, there) = self.common_since((t, found.0), found.1, drift);
            if since >= t || self.is_spent() {
                return None;
            }
            (t, x, depth) = (since, there, found.1);
        }
        None
    }

    /// The side that has a wall about a point: two faces that oppose each other, each no farther than the point is deep.
    fn wall_of(&self, t: f64, (x, depth, _): &depth::Held) -> Option<Side> {
        let at = self.task.relative.at(t);
        let features = Features::at(self.task, *x, &at, (*depth > 0.0).then_some(depth * THICK));
        [Side::A, Side::B].into_iter().find(|side| {
            let normals: Vec<DVec3> =
                features.active[*side as usize].iter().map(|id| features.gradient(*side, *id)).collect();
            normals.iter().enumerate().any(|(k, n)| normals[..k].iter().any(|m| (*m + *n).length() <= OPPOSITE))
        })
    }

    /// From a point of a wall of one body to one that is deeper in the other, along the middle of the wall: down the other's
    /// gradient or between the last two faces of it, by steps that are doubled where they lead on and halved where they do
    /// not. Beside the rim of what is pierced the way back would be as short as the wall is thin.
    fn along(&self, t: f64, wall: Side, (x, depth, support): &depth::Held) -> depth::Held {
        let at = self.task.relative.at(t);
        let deciding = |side: Side, x: DVec3| {
            let (model, y) = if side == Side::A { (self.task.model_a, x) } else { (self.task.model_b, at.b_point(x)) };
            let (value, id) = model.deciding(y);
            let n = model.solid.faces[id.face() as usize].unit_normal(y);
            let n = if id.sense() == Sense::Positive { n } else { -n };
            (value, if side == Side::A { n } else { at.a_vector(n) })
        };
        let other = if wall == Side::A { Side::B } else { Side::A };
        let (mut x, mut way) = (*x, AHEAD * self.task.scale);
        let (mut value, mut down) = deciding(other, x);
        let mut beside = down;
        while way > *depth && !self.is_spent() {
            self.work.look(self.task.a.faces.len() + self.task.b.faces.len());
            let across = deciding(wall, x).1;
            let [p, q] = [down, beside].map(|n| n - across * n.dot(across));
            // The shortest vector between both leads down along their edge.
            let part = (p.dot(p - q) / (p - q).length_squared()).clamp(0.0, 1.0);
            let Some(along) = (if part > 0.0 { p.lerp(q, part) } else { p }).try_normalize() else { break };
            let mut next = x - along * way;
            // A wall may be curved.
            for _ in 0..BENDS {
                let (v, n) = deciding(wall, next);
                next -= n * (v + depth);
            }
            let (v, n) = deciding(other, next);
            if v < value - DEEPER * way && deciding(wall, next).0 <= -MIDDLE * depth {
                (x, value, down, way) = (next, v, n, (2.0 * way).min(self.task.scale));
            } else {
                // Another face is ahead there.
                (beside, way) = (n, 0.5 * way);
            }
        }
        (x, -separation::value(self.task, &at, x), support.clone())
    }

    /// Since when a common point of some depth is common to both, as far as a look back goes, and where it was then:
    /// held in either body, or drifting there as the deepest point did, which along a wall or between like faces goes far.
    fn common_since(&self, (t, x): (f64, DVec3), depth: f64, drift: [DVec3; 2]) -> (f64, DVec3) {
        let relative = &self.task.relative;
        let in_b = relative.at(t).b_point(x);
        let speed = relative.bounds(0.0, t, x.length()).speed;
        let first = (0.5 * depth / speed.max(f64::MIN_POSITIVE)).max(f64::EPSILON * t);
        let ways: [&dyn Fn(f64, &Instant) -> DVec3; 4] =
            [&|_, _| x, &|_, at| at.a_point(in_b), &|s, _| x + drift[0] * (s - t), &|s, at| {
                at.a_point(in_b + drift[1] * (s - t))
            }];
        let mut earliest = (t, x);
        for way_of in ways {
            // Where it is at a time, if that is in both.
            let common = |s: f64| {
                let at = relative.at(s);
                let x = way_of(s, &at);
                self.is_common(&at, x).then_some((s, x))
            };
            let (mut since, mut way, mut apart) = ((t, x), first, None);
            while since.0 > 0.0 && apart.is_none() {
                let earlier = (since.0 - way).max(0.0);
                let middle = 0.5 * (earlier + since.0);
                match common(middle).and_then(|_| common(earlier)) {
                    Some(place) => since = place,
                    None => apart = Some(earlier),
                }
                way *= FURTHER;
            }
            for _ in 0..if apart.is_some() { HALVINGS } else { 0 } {
                let middle = 0.5 * (apart.unwrap_or(0.0) + since.0);
                match common(middle) {
                    Some(place) => since = place,
                    None => apart = Some(middle),
                }
            }
            if since.0 < earliest.0 {
                earliest = since;
            }
        }
        earliest
    }
}
