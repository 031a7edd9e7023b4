//! From a witness back to where its bodies come to touch, where no equations lead there.
//!
//! The deepest common point is climbed to (`depth`) at the witness' time, and held in one of the bodies while time is
//! taken back, until it leaves the other one. Until then both have it in common, so from there the next climb starts.
//! So time goes back as long as the bodies have any depth in common there, whichever faces decide on the way, and along
//! a crescent between two like faces, whose equations are singular. Where no depth is left the surfaces touch, or the
//! step starts.

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

/// How far a climb looks first, in depths, where bodies are thin.
const BESIDE: f64 = 64.0;

/// How much further each look back goes.
const FURTHER: f64 = 4.0;

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
        let at = self.task.relative.at(t);
        // Between two like faces the way along them is long and hardly leads down: where they part is told outright.
        let guesses = self.fits.iter().flat_map(|fit| fit.guesses(self.task, &at, x));
        let (mut best, mut least) = (x, separation::value(self.task, &at, x));
        for guess in guesses {
            let v = self.value(&at, guess);
            if v < least {
                (best, least) = (guess, v);
            }
        }
        depth::climb_within(None, self.task, &at, best, &self.work)
    }

    /// The same, not far from x. Elsewhere a thin wall may be deeper, but no part of what both bodies have in common
    /// there.
    fn deepest_beside(&self, t: f64, x: DVec3, depth: f64) -> depth::Held {
        if !self.fits.is_empty() && !self.task.has_walls() {
            return self.deepest(t, x);
        }
        let reach = (BESIDE * depth).min(0.5 * self.task.scale);
        depth::climb_within(Some(reach), self.task, &self.task.relative.at(t), x, &self.work)
    }

    /// Back to where the common depth of x begins. At each time on the way `solve` may name the touch; else it is where
    /// no depth is left, or what is held at the start. `None` where the way back ends before.
    pub(in crate::contact) fn back<T>(
        &self,
        (mut t, mut x, mut depth): (f64, DVec3, f64),
        solve: impl Fn(f64, &depth::Held) -> Option<T>,
    ) -> Option<Result<T, (f64, depth::Held)>> {
        let least = ON_SURFACE * self.task.rounding;
        let mut last: Option<(f64, DVec3)> = None;
        for _ in 0..RETREATS {
            let found = self.deepest_beside(t, x, depth);
            if let Some(solved) = solve(t, &found) {
                return Some(Ok(solved));
            }
            if t == 0.0 || found.1 <= least {
                return (found.1 >= -least).then_some(Err((t, found)));
            }
            let drift = last.map_or(DVec3::ZERO, |(later, there)| (there - found.0) / (later - t));
            last = Some((t, found.0));
            let (since, there) = self.common_since((t, found.0), found.1, drift);
            if since >= t || self.is_spent() {
                return None;
            }
            (t, x, depth) = (since, there, found.1);
        }
        None
    }

    /// Since when a common point of some depth is common to both, as far as a look back goes, and where it was then:
    /// held in either body, or drifting as the deepest point did, which along a wall or between like faces goes far.
    fn common_since(&self, (t, x): (f64, DVec3), depth: f64, drift: DVec3) -> (f64, DVec3) {
        let relative = &self.task.relative;
        let in_b = relative.at(t).b_point(x);
        let speed = relative.bounds(0.0, t, x.length()).speed;
        let first = (0.5 * depth / speed.max(f64::MIN_POSITIVE)).max(f64::EPSILON * t);
        let ways: [&dyn Fn(f64, &Instant) -> DVec3; 3] =
            [&|_, _| x, &|_, at| at.a_point(in_b), &|s, _| x + drift * (s - t)];
        let mut earliest = (t, x);
        for way_of in ways {
            // Where it is at a time, if that is in both.
            let common = |s: f64| {
                let at = relative.at(s);
                let x = way_of(s, &at);
                (self.value(&at, x) <= 0.0).then_some((s, x))
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
