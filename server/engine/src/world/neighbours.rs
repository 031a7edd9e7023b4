//! The pairs of bodies near enough to be asked about, kept from step to step.
//!
//! A body stays within its box at the start of a step, grown by a distance, as long as the farthest of its points is no further
//! from where it was than that: the way it has gone since tells, or where that is longer the two poses. Bodies whose grown
//! boxes share no point need not be looked at while both stay within theirs: the broad phase runs again only when one leaves.
//! The pairs it lets through are a list; what is known of each stays with it.
//!
//! Path lengths count how far the farthest point of a body may have gone; each sum is rounded up. A pair that was `clearance`
//! apart when its path lengths stood at p and q cannot meet before they show p' + q' > p + q + clearance: the one comparison
//! that such a pair costs a step.
//! Invariant: the list holds every pair that may come within its touching distance in this step, in the order of ids.

use super::body::Body;
use super::broad::BroadPhase;
use super::coherence::PairCache;
use super::plan::PairPlan;
use crate::contact::{Hull, SeparatingAxisTest};
use crate::math::Aabb;
use contactd_proto::{Detect, Pose};
use glam::DVec3;

/// A body's box grows by the way of this many steps like the last one …
const STEPS: f64 = 8.0;
/// … but by no more than this part of its radius beyond the step's own way …
const MOST: f64 = 0.5;
/// … and by at least this part of it.
const LEAST: f64 = 0.02;
/// The part of it that is used: the rest is far more than what rounding does to sums of ways.
const SAFE: f64 = 0.999_999;

/// Two bodies, the smaller index first, and the sum of path lengths up to which they are known to stay apart.
#[derive(Clone, Copy, Debug)]
struct Near {
    a: u32,
    b: u32,
    limit: f64,
}

/// What a separating-axis test at a pair needs of it. There are many pairs of which no more is ever asked.
#[derive(Clone, Copy, Debug)]
pub struct PairHint {
    /// A direction along which its bodies were apart; 0 where none is known.
    pub along: DVec3,
    /// Up to this distance they may touch, or matter to each other otherwise.
    pub touch: f64,
    /// Its bodies are looked at where they stand at the end of the step alone.
    pub discrete: bool,
    /// They met when they were last asked about.
    pub met: bool,
    plan_index: u32,
    /// How much of a distance between their boxes, or along an axis, path lengths may not use up: where it is told of clear
    /// pairs that they are near, f tells, and {f <= level} reaches out of boxes.
    room: f64,
}

/// What else belongs to a pair.
#[derive(Debug)]
struct Entry {
    resolution: f64,
    /// What earlier steps have proven, if it has been asked about at all.
    pair_cache: Option<Box<PairCache>>,
}

/// How far a body may have gone: before the step, and with it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathLength {
    /// At the start of the step.
    pub start: f64,
    /// At its end.
    pub end: f64,
}

/// The list, and the path lengths that keep it true.
#[derive(Debug, Default)]
pub struct Neighbours {
    pairs: Vec<Near>,
    /// One for each of them.
    sights: Vec<PairHint>,
    /// One for each of them.
    entries: Vec<Entry>,
    old_pairs: Vec<Near>,
    old_sights: Vec<PairHint>,
    old_entries: Vec<Entry>,
    /// The memory of pairs that have left the list, empty.
    #[expect(clippy::vec_box, reason = "it is handed on as it is")]
    spare: Vec<Box<PairCache>>,
    path_lengths: Vec<PathLength>,
    /// Odometer up to which a body stays in its grown box.
    fences: Vec<f64>,
    /// Where a body stood when its box was taken, and by how much it was grown for the body's motion.
    homes: Vec<(Pose, f64)>,
    boxes: Vec<Aabb>,
    broad: BroadPhase,
    found: Vec<(u32, u32)>,
    sorted: Vec<(u32, u32)>,
    counts: Vec<u32>,
    stale: bool,
    /// Bodies that move in this step and whose path lengths do not tell that they stay in their grown boxes, in the order in which
    /// they were moved.
    beyond: Vec<u32>,
    /// Pairs of boxes compared in this step.
    pub box_tests: u64,
}

/// The sum, rounded up.
#[inline]
fn up(x: f64, y: f64) -> f64 {
    if y == 0.0 { x } else { (x + y).next_up() }
}

/// Room that a pair needs beside the distance of its boxes, which may stand `plan.reach()` apart without a look. Two convex
/// primitives are near by their distance, others by f.
fn room(bodies: [&Body; 2], plan: &PairPlan, touch: f64) -> f64 {
    let is_whole = |body: &Body| body.hull.as_ref().is_some_and(Hull::is_whole);
    if !plan.reports_nearness() || bodies.iter().all(|body| is_whole(body)) {
        return 0.0;
    }
    bodies.iter().map(|body| body.room(touch, f64::INFINITY)).sum::<f64>() - plan.reach()
}

/// Sorts pairs of numbers below `count`: by the first one through counting, and each of these few by the second.
fn by_ids(pairs: &mut Vec<(u32, u32)>, sorted: &mut Vec<(u32, u32)>, counts: &mut Vec<u32>, count: usize) {
    counts.clear();
    counts.resize(count + 1, 0);
    for (a, _) in pairs.iter() {
        counts[*a as usize + 1] += 1;
    }
    for a in 0..count {
        counts[a + 1] += counts[a];
    }
    sorted.clear();
    sorted.resize(pairs.len(), (0, 0));
    for pair in pairs.iter() {
        let place = &mut counts[pair.0 as usize];
        sorted[*place as usize] = *pair;
        *place += 1;
    }
    sorted.chunk_by_mut(|p, q| p.0 == q.0).for_each(|of_one| of_one.sort_unstable_by_key(|p| p.1));
    std::mem::swap(pairs, sorted);
}

impl Neighbours {
    /// Forgets the list and what is known of its pairs: bodies or rules have changed. Path lengths begin anew: nothing refers to them,
    /// and a body may have another one's place.
    pub fn forget(&mut self) {
        self.path_lengths.clear();
        self.pairs.clear();
        self.sights.clear();
        self.entries.clear();
        self.stale = true;
    }

    /// Takes the list anew at the next step, keeping what is known: there are more bodies.
    pub fn extend(&mut self) {
        self.stale = true;
    }

    /// A body was displaced by as much between two steps, and goes as far in this one.
    #[inline]
    pub fn moved(&mut self, body: u32, before: f64, now: f64) {
        let o = &mut self.path_lengths[body as usize];
        o.start = up(o.start, before);
        o.end = up(o.start, now);
        // Where the boxes are to be taken anew there may be none of this body: then nobody asks.
        let fence = self.fences.get(body as usize).copied().unwrap_or(f64::NEG_INFINITY);
        if !(o.end.is_finite() && o.end <= fence) {
            self.beyond.push(body);
        }
    }

    /// A part of a body's last motion is taken: it stands at `taken`.
    #[inline]
    pub fn taken(&mut self, index: u32, body: &Body, part: f64, taken: &Pose) {
        let o = &mut self.path_lengths[index as usize];
        let way = if part == 1.0 {
            // All of it, which the path length shows already.
            o.start = o.end;
            body.rounding_at(part, taken)
        } else {
            body.travel(part) + body.rounding_at(part, taken)
        };
        o.start = up(o.start, way);
        o.end = o.start;
    }

    /// Readies the path lengths for as many bodies.
    pub fn count(&mut self, bodies: usize) {
        self.beyond.clear();
        self.path_lengths.resize(bodies, PathLength::default());
        self.box_tests = 0;
    }

    /// Looks whether all of the bodies that move are still in their grown boxes; if not, the list is taken anew.
    /// `plan` says how a pair is searched, if at all, and with which resolution.
    pub fn update(
        &mut self,
        bodies: &[Body],
        reach: impl Fn(&Body, f64) -> f64,
        plan: impl Fn(u32, u32) -> Option<(u32, PairPlan, f64)>,
    ) {
        if !self.stale && self.all_stay(bodies) {
            return;
        }
        self.stale = false;
        let anew = self.grow(bodies, reach);
        let (found, boxes) = (&mut self.found, &self.boxes);
        found.clear();
        self.broad.run(boxes, |i| bodies[i].is_static, |i, j| found.push((i.min(j), i.max(j))));
        self.box_tests += self.broad.tests;
        by_ids(found, &mut self.sorted, &mut self.counts, bodies.len());
        // The old list beside the new one.
        std::mem::swap(&mut self.pairs, &mut self.old_pairs);
        std::mem::swap(&mut self.sights, &mut self.old_sights);
        std::mem::swap(&mut self.entries, &mut self.old_entries);
        self.pairs.clear();
        self.sights.clear();
        let spare = &mut self.spare;
        let mut leaves = |entry: Entry| {
            if let Some(mut pair_cache) = entry.pair_cache {
                pair_cache.empty();
                spare.push(pair_cache);
            }
        };
        let of_bodies = self.old_pairs.iter().zip(&self.old_sights);
        let mut old = of_bodies.zip(self.old_entries.drain(..)).peekable();
        for &(a, b) in found.iter() {
            while let Some((_, entry)) = old.next_if(|((n, _), _)| (n.a, n.b) < (a, b)) {
                leaves(entry);
            }
            if let Some(((near, pair_hint), entry)) = old.next_if(|((n, _), _)| (n.a, n.b) == (a, b)) {
                let limit = if anew.iter().any(|i| *i == a || *i == b) { f64::NEG_INFINITY } else { near.limit };
                self.pairs.push(Near { limit, ..*near });
                self.sights.push(*pair_hint);
                self.entries.push(entry);
                continue;
            }
            let Some((plan_index, plan, resolution)) = plan(a, b) else { continue };
            self.pairs.push(Near { a, b, limit: f64::NEG_INFINITY });
            let touch = plan.reach().max(2.0 * resolution);
            self.sights.push(PairHint {
                along: DVec3::ZERO,
                touch,
                discrete: plan.detect == Detect::Discrete,
                met: false,
                plan_index,
                room: room([a, b].map(|i| &bodies[i as usize]), &plan, touch),
            });
            self.entries.push(Entry { resolution, pair_cache: None });
        }
        old.for_each(|(_, entry)| leaves(entry));
    }

    /// Grows a box around each body in which it is to stay for some steps. Tells whose path lengths had to begin anew.
    fn grow(&mut self, bodies: &[Body], reach: impl Fn(&Body, f64) -> f64) -> Vec<u32> {
        // A path length that has gone beyond all numbers begins anew, and what was noted by it is forgotten.
        let mut anew = Vec::new();
        for (i, (body, path_length)) in bodies.iter().zip(&mut self.path_lengths).enumerate() {
            if !path_length.end.is_finite() && body.reach().is_finite() {
                *path_length = PathLength { start: 0.0, end: body.travel(1.0) };
                anew.push(i as u32);
            }
        }
        self.boxes.clear();
        self.fences.clear();
        self.homes.clear();
        for (body, path_length) in bodies.iter().zip(&self.path_lengths) {
            let way = path_length.end - path_length.start;
            let more =
                if body.is_static { 0.0 } else { (STEPS * way).min(MOST * body.reach()).max(LEAST * body.reach()) };
            // What turns without bounds has no way that could be told.
            let clearance = if way.is_finite() { way + more } else { 0.0 };
            self.boxes.push(if way.is_finite() {
                body.still().grown(clearance + reach(body, clearance))
            } else {
                Aabb::ALL
            });
            self.fences.push(path_length.start + SAFE * clearance);
            self.homes.push((body.motion_state.motion.start, clearance));
        }
        anew
    }

    /// True when all bodies stay in their grown boxes over this step.
    fn all_stay(&mut self, bodies: &[Body]) -> bool {
        let beyond = std::mem::take(&mut self.beyond);
        let stay = beyond.iter().all(|i| self.stays(*i as usize, &bodies[*i as usize]));
        self.beyond = beyond;
        stay
    }

    /// True when a body stays in its grown box over this step: as its path length tells, or because it has come back.
    fn stays(&mut self, index: usize, body: &Body) -> bool {
        let path_length = self.path_lengths[index];
        if !path_length.end.is_finite() {
            // Only a body without bounds is everywhere.
            return body.reach().is_infinite();
        }
        if path_length.end <= self.fences[index] {
            return true;
        }
        let (home, clearance) = &self.homes[index];
        let start = &body.motion_state.motion.start;
        let fence = path_length.start + (SAFE * clearance - body.displacement(home, start));
        if path_length.end <= fence {
            self.fences[index] = fence;
        }
        path_length.end <= fence
    }

    /// The two bodies of a pair.
    pub fn bodies(&self, pair: usize) -> (u32, u32) {
        (self.pairs[pair].a, self.pairs[pair].b)
    }

    /// Place of a pair in the list.
    pub fn find(&self, a: u32, b: u32) -> Option<usize> {
        self.pairs.binary_search_by_key(&(a, b), |n| (n.a, n.b)).ok()
    }

    /// What a separating-axis test needs of a pair.
    pub fn pair_hint(&self, pair: usize) -> &PairHint {
        &self.sights[pair]
    }

    /// What is known of a pair.
    pub fn pair_cache(&self, pair: usize) -> Option<&PairCache> {
        self.entries[pair].pair_cache.as_deref()
    }

    /// Where a body stood when the list was taken last, its box there grown for the time since, and by how much.
    pub fn home(&self, body: u32) -> (&Pose, &Aabb) {
        (&self.homes[body as usize].0, &self.boxes[body as usize])
    }

    /// Index of the plan of a pair.
    pub fn plan(&self, pair: usize) -> u32 {
        self.sights[pair].plan_index
    }

    /// Notes what was seen of a pair at the start of this step.
    #[inline]
    pub fn noticed(&mut self, pair: usize, axis_test: &SeparatingAxisTest) {
        self.sights[pair].along = axis_test.along;
        if axis_test.clearance > 0.0 {
            self.note(pair, axis_test.clearance);
        }
    }

    /// The resolution of a pair; and gives what is known of it away, until `learned`.
    pub fn lend(&mut self, pair: usize) -> (f64, Box<PairCache>) {
        let entry = &mut self.entries[pair];
        (entry.resolution, entry.pair_cache.take().or_else(|| self.spare.pop()).unwrap_or_default())
    }

    /// Takes it back; with the clearance found at the start of this step, if it is positive, and whether the bodies met.
    pub fn learned(&mut self, pair: usize, pair_cache: Option<Box<PairCache>>, clearance: f64, met: bool) {
        self.entries[pair].pair_cache = pair_cache;
        self.sights[pair].met = met;
        if clearance > 0.0 {
            self.note(pair, clearance);
        }
    }

    /// Calls `ask` for every pair that its path lengths don't prove apart over this step.
    pub fn each_near(&self, mut ask: impl FnMut(usize)) {
        for (i, near) in self.pairs.iter().enumerate() {
            if !self.apart(near) {
                ask(i);
            }
        }
    }

    /// True when the path lengths prove a pair apart over this step.
    pub fn is_apart(&self, pair: usize) -> bool {
        self.apart(&self.pairs[pair])
    }

    fn apart(&self, near: &Near) -> bool {
        self.path_lengths[near.a as usize].end + self.path_lengths[near.b as usize].end <= near.limit
    }

    /// Notes that a pair is `clearance` farther apart than its touching distance at the start of this step.
    #[inline]
    pub fn note(&mut self, pair: usize, clearance: f64) {
        let clearance = clearance - self.sights[pair].room;
        let near = &mut self.pairs[pair];
        let sum = self.path_lengths[near.a as usize].start + self.path_lengths[near.b as usize].start;
        // More than the roundings of both sums, of this product and of the sum that it is compared with.
        let limit = (sum + clearance) * (1.0 - 4.0 * f64::EPSILON);
        near.limit = if limit.is_finite() { limit } else { f64::NEG_INFINITY };
    }
}
