//! The queue of pairs of places, and what proves them apart.
//!
//! Of a convex body P and a facet a direction n with the gap φ along it: no point of the facet is deeper in P than −φ. Let E be P
//! eroded by δ, the points at which a ball of radius δ about them lies in P; it holds all points with f_P <= −δ, and is convex. While
//! φ > −δ for some direction of every facet, E meets no facet. It does not at the start, and a point of it lies outside of the mesh:
//! so all of E lies outside until then, and no point with f_P <= −δ is in the mesh. What is proven here is φ > 0 less a few roundings,
//! so that of two contacts the one that touches first is found; φ > −δ only of what grazes.
//!
//! Of two meshes surfaces that do not meet are proven not to: φ > 0 by a few roundings, until as much before the contact.
//!
//! For directions fixed in the world φ falls below the line between two of its values by no more than ½ Q s(1−s) h², Q = ω_A² ρ_A +
//! ω_B² ρ_B with ρ the farthest point of a cover from the centre of rotation (`convex`): small covers near the centre cost less.

use super::Front;
use super::body::{ALL, Body, Cover, Moment, Place};
use super::touch::{ACTIVE, holding};
use crate::contact::convex::{APART, Gap, Nearest, Pace, excluded, nearest};
use crate::contact::query::task::Task;
use crate::contact::witness::contacts::{Contacts, Guess};
use crate::contact::witness::found::Ending;
use crate::contact::witness::known::Known;
use crate::math::gjk::GOOD;
use crate::math::halt;
use glam::DVec3;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Pairs of places that are looked at before a pair is left to the search.
const MOST: u64 = 400_000;
/// What a pair costs, in looks at a face.
const ITEM: usize = 64;
/// Advances of one pair of facets.
const ROUNDS: u8 = 48;
/// Moments that are kept.
const KEPT: usize = 16;
/// Gaps, relative to the pair's scale, from which on a contact is looked for, again and again.
const NEAR: [f64; 4] = [1e-2, 1e-4, 1e-7, 1e-10];
/// The first gap from which on faces that do not hold the contact are mended one by one.
const MEND: u8 = 2;
/// Parts of the surface of a mesh beyond which their places at the start are left to the search.
const MOST_SHELLS: usize = 64;
/// Roundings that surfaces of two meshes are kept apart by, and by how much more they are at the contact's own horizon.
const CLEAR: f64 = 4.0;
const HORIZON: f64 = 4.0;

/// A pair of places, proven apart until `t` along `n`.
#[derive(Clone, Copy)]
struct Item {
    t: f64,
    places: [Place; 2],
    /// From A to B, world axes.
    n: DVec3,
    /// How often it was advanced.
    rounds: u8,
    /// How many of `NEAR` were tried.
    tries: u8,
    /// It grazes: proven to come no deeper than is asked for.
    grazes: bool,
}

impl PartialEq for Item {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Item {}
impl PartialOrd for Item {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Item {
    /// The earliest is the greatest.
    fn cmp(&self, other: &Self) -> Ordering {
        other.t.total_cmp(&self.t).then_with(|| other.places.cmp(&self.places))
    }
}

/// What became of an item.
// One at a time, on the stack.
#[allow(clippy::large_enum_variant)]
enum Step {
    /// Nothing of it is left.
    Done,
    /// Neither proven nor a contact from here on.
    Stuck,
    /// The answer.
    Ended(Ending),
    /// A contact was found, or an earlier one.
    Found,
}

/// The advance of two bodies.
pub(super) struct Advance<'s, 'a> {
    task: &'s Task<'a>,
    bodies: &'s [Body<'s>; 2],
    moments: Vec<Moment>,
    next: usize,
    heap: BinaryHeap<Item>,
    /// The time up to which everything is to be proven.
    end: f64,
    /// φ above the one keeps surfaces apart, above the other keeps them from a depth.
    least: f64,
    least_grazing: Option<f64>,
    /// They start within a few resolutions of each other.
    near: bool,
    /// The normal of the contact that is known, world axes.
    normal: Option<DVec3>,
}

impl<'s, 'a> Advance<'s, 'a> {
    /// `None` where one may lie within the other at the start.
    pub fn new(task: &'s Task<'a>, bodies: &'s [Body<'s>; 2]) -> Option<Self> {
        let slack = CLEAR * task.rounding + bodies[0].tolerance + bodies[1].tolerance;
        let are_meshes = bodies.iter().all(|b| b.mesh().is_some());
        let least_grazing = (!are_meshes).then(|| 0.5 * excluded(task.delta, 2.0 * task.rounding));
        let this = Self {
            task,
            bodies,
            moments: Vec::with_capacity(KEPT),
            next: 0,
            heap: BinaryHeap::new(),
            end: 1.0,
            least: if are_meshes { slack } else { -slack },
            least_grazing,
            near: false,
            normal: None,
        };
        (are_meshes || this.least > 0.5 * excluded(task.delta, 2.0 * task.rounding)).then_some(this)
    }

    /// Runs to the end.
    pub fn run(mut self, contacts: &mut Contacts) -> Front {
        let start = self.moment(0.0);
        let covers = [0, 1].map(|k| self.bodies[k].cover(ALL));
        let way = self.way(start, &covers);
        let first = Item { t: 0.0, places: [ALL; 2], n: way, rounds: 0, tries: 0, grazes: false };
        self.moment(self.end);
        let (until, n) = self.apart(&first, &covers);
        if until >= self.end {
            return Front::Ended(contacts.end());
        }
        // What a direction keeps apart at the start does not lie within the other.
        if until <= 0.0 && !self.is_outside() {
            return Front::Open;
        }
        self.heap.push(Item { t: until, n, ..first });
        let mut count = 0;
        while let Some(item) = self.heap.pop() {
            if item.t >= self.end {
                break;
            }
            count += 1;
            halt::work(ITEM);
            let is_leaf = (0..2).all(|k| self.bodies[k].is_leaf(item.places[k]));
            let step = match () {
                () if count > MOST || halt::is_up() => Step::Stuck,
                () if is_leaf => self.advance(contacts, item),
                () => {
                    self.divide(&item);
                    Step::Done
                }
            };
            match step {
                Step::Done | Step::Found => {}
                Step::Ended(ending) => return Front::Ended(ending),
                Step::Stuck if item.t > 0.0 && !self.near => return Front::Free(item.t),
                Step::Stuck => return Front::Open,
            }
        }
        match &contacts.found {
            None => Front::Ended(Ending::Clear),
            Some(_) => contacts.end_from(self.end).map_or(Front::Open, Front::Ended),
        }
    }

    /// The index of a moment.
    fn moment(&mut self, t: f64) -> usize {
        if let Some(i) = self.moments.iter().position(|m| m.at.t == t) {
            return i;
        }
        let moment = Moment::new(&self.task.relative, self.bodies, t);
        if self.moments.len() < KEPT {
            self.moments.push(moment);
            return self.moments.len() - 1;
        }
        // The start and the end of the step stay.
        self.next = if self.next + 1 < KEPT { (self.next + 1).max(2) } else { 2 };
        self.moments[self.next] = moment;
        self.next
    }

    /// From the middle of one cover to that of the other, unit, world axes.
    fn way(&self, moment: usize, covers: &[Cover; 2]) -> DVec3 {
        self.moments[moment].way([0, 1].map(|k| covers[k].middle())).normalize_or(DVec3::X)
    }

    /// True where neither body lies within the other at the start, if their surfaces do not meet then.
    fn is_outside(&self) -> bool {
        let m = &self.moments[0];
        let solids = [self.task.a, self.task.b];
        (0..2).all(|k| {
            let Some(_) = self.bodies[1 - k].mesh() else { return true };
            let (body, other) = (&self.bodies[k], solids[1 - k]);
            let of_shells = body.mesh().map(|(tree, _)| tree.shells());
            let middle = body.convex().map(|c| c.center());
            let corners = of_shells.unwrap_or(middle.as_slice());
            corners.len() <= MOST_SHELLS
                && corners.iter().all(|y| {
                    let x = body.in_model(*y);
                    let x = if k == 0 { m.at.b_point(x) } else { m.at.a_point(x) };
                    other.value(x) > 0.0
                })
        })
    }

    /// The gap of a pair along a direction of the world, at a moment.
    #[inline]
    fn gap(&self, moment: usize, covers: &[Cover; 2], n: DVec3) -> Gap {
        let m = &self.moments[moment];
        Gap { t: m.at.t, n, phi: m.gap(covers, n) }
    }

    fn pace(&self, covers: &[Cover; 2], least: f64) -> Pace {
        Pace { speed: 0.0, pull: self.bodies[0].pull(&covers[0]) + self.bodies[1].pull(&covers[1]), least }
    }

    fn least_of(&self, item: &Item) -> f64 {
        if item.grazes { self.least_grazing.unwrap_or(self.least) } else { self.least }
    }

    /// Until when a pair is apart along the direction that it has, or the best of a few others, and along which.
    fn apart(&mut self, item: &Item, covers: &[Cover; 2]) -> (f64, DVec3) {
        let pace = self.pace(covers, self.least_of(item));
        // Whichever of them is made anew, both are kept.
        self.moment(self.end);
        let (here, last) = (self.moment(item.t), self.moment(self.end));
        let mut best = (item.t, item.n);
        let mut offer = |this: &Self, n: DVec3| {
            let gap = this.gap(here, covers, n);
            if gap.phi > pace.least {
                let until = pace.proven(&gap, &this.gap(last, covers, n));
                if until > best.0 {
                    best = (until, n);
                }
            }
            best.0 >= this.end
        };
        if offer(self, item.n) {
            return best;
        }
        let m = &self.moments[here];
        let way = self.way(here, covers);
        if offer(self, way) {
            return best;
        }
        for k in 0..2 {
            let own = m.own(k, if k == 0 { way } else { -way });
            for side in covers[k].sides(own) {
                let along = side.dot(own);
                if side == DVec3::ZERO || along == 0.0 {
                    continue;
                }
                let outward = if (along > 0.0) == (k == 0) { side } else { -side };
                if offer(self, m.world(k, outward)) {
                    return best;
                }
            }
        }
        best
    }

    /// Replaces the larger place of a pair that can be by what is in it.
    fn divide(&mut self, item: &Item) {
        let bodies = self.bodies;
        let leaf = [0, 1].map(|k| bodies[k].is_leaf(item.places[k]));
        let size = |k: usize| bodies[k].cover(item.places[k]).size();
        let k = match leaf {
            [true, _] => 1,
            [_, true] => 0,
            [false, false] => usize::from(size(1) > size(0)),
        };
        for place in bodies[k].below(item.places[k]) {
            let mut places = item.places;
            places[k] = place;
            let covers = [0, 1].map(|k| bodies[k].cover(places[k]));
            let (until, n) = self.apart(&Item { places, ..*item }, &covers);
            if until < self.end {
                self.heap.push(Item { t: until, places, n, ..*item });
            }
        }
    }

    /// Advances a pair of facets, or of a facet and a convex body, along the line of its nearest points.
    fn advance(&mut self, contacts: &mut Contacts, mut item: Item) -> Step {
        let bodies = self.bodies;
        let covers = [0, 1].map(|k| bodies[k].cover(item.places[k]));
        let here = self.moment(item.t);
        item.rounds += 1;
        if item.rounds > ROUNDS {
            return Step::Stuck;
        }
        // What is beside the contact that is known meets there along its normal.
        if let Some(n) = self.normal
            && self.along(&item, &covers, n) >= self.end
        {
            return Step::Done;
        }
        contacts.counters.closed_forms += 1;
        let m = &self.moments[here];
        let first = m.at.world_from_a.transpose() * item.n;
        let found = nearest(&m.seen(0, &covers[0]), &m.seen(1, &covers[1]), first, GOOD);
        // As near as rounding nearest points tell no direction: then the one that led here is better.
        let (last, mut gap) = (item.n, self.gap(here, &covers, item.n));
        if let Some(found) = &found {
            let n = (m.at.world_from_a * found.normal).normalize();
            let nearest = self.gap(here, &covers, n);
            if nearest.phi > gap.phi {
                (item.n, gap) = (n, nearest);
            }
        }
        if item.t == 0.0 && gap.phi <= APART * self.task.delta {
            self.near = true;
        }
        if gap.phi <= self.least_of(&item) {
            return self.turn(item, &covers);
        }
        if let Some(found) = &found
            && !self.near
            && !item.grazes
            && self.attempt(contacts, here, &mut item, found)
        {
            if let Some(hit) = (item.t > 0.0).then(|| contacts.hit(item.t)).flatten() {
                return Step::Ended(hit);
            }
            let Some((end, normal)) = self.horizon(contacts) else { return Step::Stuck };
            (self.end, self.normal) = (end, Some(normal));
            if item.t < end {
                self.heap.push(item);
            }
            return Step::Found;
        }
        let mut until = self.until(&gap, &covers, self.least_of(&item));
        if until < self.end && last != item.n {
            let other = self.along(&item, &covers, last);
            if other > until {
                (until, item.n) = (other, last);
            }
        }
        if until >= self.end {
            return Step::Done;
        }
        if until <= item.t {
            return self.turn(item, &covers);
        }
        self.heap.push(Item { t: until, ..item });
        Step::Done
    }

    /// Until when a direction keeps a pair apart.
    fn along(&mut self, item: &Item, covers: &[Cover; 2], n: DVec3) -> f64 {
        let here = self.moment(item.t);
        let (gap, least) = (self.gap(here, covers, n), self.least_of(item));
        if gap.phi > least { self.until(&gap, covers, least) } else { item.t }
    }

    /// What the directions of nearest points do not keep apart any more those of the sides may: flat on each other facets are apart
    /// along these alone.
    fn turn(&mut self, item: Item, covers: &[Cover; 2]) -> Step {
        let (until, n) = self.apart(&item, covers);
        if until >= self.end {
            return Step::Done;
        }
        if until <= item.t {
            return self.graze(item);
        }
        self.heap.push(Item { t: until, n, ..item });
        Step::Done
    }

    /// What comes as near as is proven for what touches, and may still come no deeper than is asked for.
    fn graze(&mut self, item: Item) -> Step {
        if item.grazes || self.least_grazing.is_none() {
            return Step::Stuck;
        }
        self.heap.push(Item { grazes: true, ..item });
        Step::Done
    }

    /// Until when the direction of a gap keeps a pair apart; a nearer end tightens the bound.
    fn until(&mut self, here: &Gap, covers: &[Cover; 2], least: f64) -> f64 {
        let pace = self.pace(covers, least);
        let (mut end, mut until) = (self.end, here.t);
        for _ in 0..6 {
            let there = self.moment(end);
            let proven = pace.proven(here, &self.gap(there, covers, here.n));
            until = until.max(proven);
            if proven >= end || proven - here.t > 0.25 * (end - here.t) {
                break;
            }
            end = (here.t + 2.0 * (proven - here.t)).min(end);
            if end <= here.t {
                break;
            }
        }
        until
    }

    /// Solves for the contact that the nearest points of a pair lead to, where they are near enough for the next try; true where one
    /// was found, or an earlier one.
    fn attempt(&self, contacts: &mut Contacts, moment: usize, item: &mut Item, found: &Nearest) -> bool {
        let m = &self.moments[moment];
        let scale = self.task.scale;
        let tried = NEAR.iter().filter(|near| found.distance <= *near * scale).count() as u8;
        let closing = found.normal.dot(m.at.velocity(found.a));
        if tried <= item.tries || closing <= 0.0 {
            return false;
        }
        item.tries = tried;
        let guess = item.t + found.distance.max(0.0) / closing;
        // What turns speeds up, but not by much in so short a way.
        if guess > self.end.min(1.0) + 0.25 * (guess - item.t) {
            return false;
        }
        let x = 0.5 * (found.a + found.b);
        let mut tried_before = None;
        for tolerance in ACTIVE {
            let tol = tolerance * scale + found.distance.abs() * 1e-3;
            let Some((active, lambda)) = holding(self.task, self.bodies, m, found, tol) else { continue };
            if tried_before.as_ref() == Some(&active) {
                break;
            }
            tried_before = Some(active.clone());
            let is_found = if contacts.found.is_none() {
                contacts.confirm(active, x, guess.min(1.0), lambda, item.tries >= MEND)
            } else {
                // A rival that touches first may come to the depth later.
                let guess = Guess { active: active.into_vec(), x, t: guess, lambda: lambda.into_vec() };
                contacts.polish(Known::All, false, guess)
            };
            if is_found {
                return true;
            }
        }
        false
    }

    /// Until when everything is to be proven, given the contact that is known, and its normal; `None` where it is not known when its
    /// surfaces meet.
    fn horizon(&self, contacts: &Contacts) -> Option<(f64, DVec3)> {
        let touch = contacts.found.as_ref()?.touch.as_ref().filter(|s| s.t >= 0.0)?;
        let normal = contacts.normal(touch)?;
        let at = self.task.relative.at(touch.t);
        let along = (at.world_from_a * normal).normalize();
        if self.least_grazing.is_some() {
            return Some((touch.t, along));
        }
        let closing = normal.dot(at.velocity(touch.x));
        let before = HORIZON * self.least / closing;
        (closing > 0.0 && before < touch.t).then_some((touch.t - before, along))
    }
}
