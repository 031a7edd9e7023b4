//! Contact manifolds for solvers: at most four well-chosen points for each direction of contact, with ids that stay.
//!
//! The engine tells each region by all the points that bound it. A solver wants few of them, and the same ones from step to
//! step, so that each starts from the force it had (warm start).
//!
//! ```
//! # use contactd_client::manifold::Manifolds;
//! # use contactd_client::{Reply, proto::Pose};
//! # fn step(reply: &Reply, poses: &[Pose]) {
//! let mut manifolds = Manifolds::default();          // once; then after each step:
//! manifolds.update(reply, |object, _time| poses[object as usize]);
//! for manifold in manifolds.pairs() {                // in the order (a, b)
//!     for p in manifold.points {
//!         println!("{} {} #{}: {} {} {}", manifold.a, manifold.b, p.id, p.position, p.normal, p.separation);
//!     }
//! }
//! # }
//! ```
//!
//! The rule of a pair needs `report = "patch"`; with a margin it tells points before they touch. Pairs of sensors are not solved and
//! have none. Of an overlap the points are those of the face that the bodies came through, with the depth there, where the rule asks for
//! the penetration, too; where they do not come apart the deepest one, where the step asks for details, else what the record proves.
//!
//! # Which points
//! Regions of one normal are reduced together, as one group: a body that leans by a millionth is told by lines and points where it
//! was told by a patch, and forces along one normal add up the same wherever their points lie along it. Of a group all points,
//! if there are no more than four; else the largest quadrilateral seen along the normal ([`span`]), at least 2/π of the group's hull;
//! and always one that is no farther than the nearest but for a thousandth of the group's length. Points that were
//! chosen stay so while they span 9/10 of what the best choice would: a body at rest never changes points by rounding. What is
//! told of a point is true at this step: kept is the choice, never a place.
//!
//! # Which ids
//! A point of this step is one of the step before when it is where that one would be had it moved with b, with a, or (where
//! its group has as many points before and after) with the middle of its group: so a corner keeps its id on a sliding
//! box, a mark of a rim on a turning cylinder, and the one point of a rolling ball. It must be nearer to there than a
//! quarter of the distance to the next kept point of the pair; alone, than half of the smaller distance to the bodies'
//! origins, which also bounds how far it may go with its group in a step. Ids count up within a pair and are never used twice in its
//! life, which ends at the first update that tells no point of it.
//!
//! The same sequence of replies makes the same points; when the buffers have grown, an update allocates nothing.

pub mod cache;
pub mod span;

use crate::Reply;
use crate::convention::Contact;
use contactd_proto::contact_record::{CONTACT, OVERLAP, REGIONS_INCOMPLETE, SENSOR, VALID_NORMAL, VALID_POINT};
use contactd_proto::{ContactRecord, Pose};
use glam::DVec3;
use span::{KEPT, Span};

/// Share of the best choice's span with which points stay chosen.
const SHARE: f64 = 0.9;
/// Cosine of .01: regions whose normals are no farther apart are reduced as one.
const SAME_NORMAL: f64 = 0.99995;
/// Normals of the same point from step to step are no farther apart than 45°, seen from a.
const SAME_SIDE: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// How far a point may be from where it was expected, in distances to the next kept one …
const REACH: f64 = 0.25;
/// … or, alone in its pair, in distances to the nearer origin.
const REACH_ALONE: f64 = 0.5;
/// Decides, in reaches, between expectations that are as good: b's first.
const PREFERENCE: f64 = 1e-6;

/// A contact point of a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Names the point within its pair, for as long as it lasts.
    pub id: u32,
    /// Which of the pair's groups of one normal it belongs to, from 0.
    pub group: u32,
    /// Half way between the surfaces, world frame.
    pub position: DVec3,
    /// Unit normal from a to b, world frame; the region's.
    pub normal: DVec3,
    /// Distance of the surfaces along the normal: positive apart, negative in penetration.
    pub separation: f64,
    /// The point on a's surface, in a's object frame.
    pub on_a: DVec3,
    /// The point on b's surface, in b's object frame.
    pub on_b: DVec3,
}

impl Point {
    /// The point without its id, for [`crate::convention`]'s converters.
    pub fn contact(&self) -> Contact {
        Contact { point: self.position, normal: self.normal, separation: self.separation }
    }

    /// The point where its bodies stand: its place on each is carried along, the separation is that along its normal, which stays.
    pub fn carried(&self, a: &Pose, b: &Pose) -> Self {
        let (on_a, on_b) = (a.point(self.on_a), b.point(self.on_b));
        Self { position: 0.5 * (on_a + on_b), separation: (on_b - on_a).dot(self.normal), ..*self }
    }
}

/// The points of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Manifold<'m> {
    /// The object with the smaller id.
    pub a: u32,
    /// The other one.
    pub b: u32,
    /// The record's status: contact, clear or overlap.
    pub status: u8,
    /// False when the work limit cut the search for regions: there may be more points.
    pub is_complete: bool,
    /// Groups in the order in which the engine tells their first regions, the points of each by id.
    pub points: &'m [Point],
}

/// The points of all pairs, from step to step.
#[derive(Clone, Debug, Default)]
pub struct Manifolds {
    now: Reported,
    before: Reported,
    candidates: Vec<Candidate>,
    matches: Vec<Match>,
    taken: Vec<bool>,
    span: Span,
}

/// What one step told.
#[derive(Clone, Debug, Default)]
struct Reported {
    pairs: Vec<PairPoints>,
    groups: Vec<Group>,
    points: Vec<Point>,
}

#[derive(Clone, Copy, Debug, Default)]
struct PairPoints {
    objects: [u32; 2],
    status: u8,
    is_complete: bool,
    groups: [usize; 2],
    points: [usize; 2],
    next_id: u32,
}

/// A group of points with one normal, as it was told.
#[derive(Clone, Copy, Debug, Default)]
struct Group {
    /// Normal of its first region, a's frame.
    normal: DVec3,
    /// How many points the engine told of it.
    count: usize,
    /// Mean of these on a, a's frame.
    middle: DVec3,
}

#[derive(Clone, Copy, Debug, Default)]
struct Candidate {
    point: Point,
    /// Index of the kept point that it is, among its pair's.
    known: Option<usize>,
}

/// A candidate that may be a kept point, and how far it is from where that was expected, in reaches.
#[derive(Clone, Copy, Debug)]
struct Match {
    cost: f64,
    kept: usize,
    candidate: usize,
}

impl Manifolds {
    /// Takes the answer to a step. `pose(object, time)`: where an object stood at that fraction of the step, static ones
    /// too: 0, its start, for pairs told where they begin; the time of contact for those that meet. (For the pairs of
    /// `detect = "discrete"`, which are told at their end, answer 0 with that; steps of `START` records have one pose.)
    pub fn update(&mut self, reply: &Reply, pose: impl Fn(u32, f64) -> Pose) {
        self.start();
        for record in reply.records() {
            let time = reported_at(record);
            self.add(reply, record, &pose(record.a, time), &pose(record.b, time));
        }
        self.finish();
    }

    /// Begins an update that is made record by record: then `add` for each, then `finish`.
    pub fn start(&mut self) {
        std::mem::swap(&mut self.now, &mut self.before);
        self.now.pairs.clear();
        self.now.groups.clear();
        self.now.points.clear();
    }

    /// Takes one record of a reply, whose bodies stood at these poses at the moment that it tells of. A pair that is added again
    /// in the same update gets the points of the last time that told any; between the two lies a `finish`, or none.
    pub fn add(&mut self, reply: &Reply, record: &ContactRecord, pose_a: &Pose, pose_b: &Pose) {
        if record.flags & SENSOR != 0 {
            return;
        }
        let groups = self.now.groups.len();
        self.read(reply, record, [pose_a, pose_b]);
        if self.candidates.is_empty() {
            return;
        }
        let objects = [record.a, record.b];
        let before = self.before.find(objects);
        let mut pair = PairPoints {
            objects,
            status: record.status,
            is_complete: record.flags & REGIONS_INCOMPLETE == 0,
            groups: [groups, self.now.groups.len()],
            points: [self.now.points.len(); 2],
            next_id: before.map_or(0, |p| p.next_id),
        };
        if let Some(before) = before {
            self.recognise(&before, &pair);
        }
        for group in 0..(pair.groups[1] - pair.groups[0]) as u32 {
            self.choose(group, &mut pair);
        }
        pair.points[1] = self.now.points.len();
        self.now.pairs.push(pair);
    }

    /// Of the pairs of the update before those that `of` (objects, the smaller id first) admits keep their points as they were told.
    /// Between `start` and `finish`, of pairs that are not added.
    pub fn keep(&mut self, of: impl Fn(u32, u32) -> bool) {
        for was in self.before.pairs.iter().filter(|p| of(p.objects[0], p.objects[1])) {
            let (groups, points) = (self.now.groups.len(), self.now.points.len());
            self.now.groups.extend_from_slice(&self.before.groups[was.groups[0]..was.groups[1]]);
            self.now.points.extend_from_slice(&self.before.points[was.points[0]..was.points[1]]);
            let (groups, points) = ([groups, self.now.groups.len()], [points, self.now.points.len()]);
            self.now.pairs.push(PairPoints { groups, points, ..*was });
        }
    }

    /// Ends an update: pairs that were not added are forgotten.
    pub fn finish(&mut self) {
        self.now.pairs.sort_unstable_by_key(|p| (p.objects, p.points[0]));
        self.now.pairs.dedup_by(|later, kept| {
            let again = later.objects == kept.objects;
            if again {
                *kept = *later;
            }
            again
        });
    }

    /// All pairs that have points, in the order (a, b).
    pub fn pairs(&self) -> impl ExactSizeIterator<Item = Manifold<'_>> {
        self.now.pairs.iter().map(|p| self.now.manifold(p))
    }

    /// The points of a pair of objects, the smaller id first, if it has any.
    pub fn pair(&self, a: u32, b: u32) -> Option<Manifold<'_>> {
        let at = self.now.pairs.binary_search_by_key(&[a, b], |p| p.objects).ok()?;
        Some(self.now.manifold(&self.now.pairs[at]))
    }

    /// All that a record tells, as candidates.
    fn read(&mut self, reply: &Reply, record: &ContactRecord, poses: [&Pose; 2]) {
        let inverse = poses.map(Pose::inverse);
        let first = self.now.groups.len();
        let (candidates, groups) = (&mut self.candidates, &mut self.now.groups);
        candidates.clear();
        let mut put = |position: DVec3, normal: DVec3, separation: f64| {
            let on = |half: f64, frame: &Pose| frame.point(position + normal * (half * separation));
            let (on_a, on_b) = (on(-0.5, &inverse[0]), on(0.5, &inverse[1]));
            let local = inverse[0].vector(normal);
            let known = groups[first..].iter().position(|g| g.normal.dot(local) > SAME_NORMAL);
            let group = known.unwrap_or(groups.len() - first);
            if known.is_none() {
                groups.push(Group { normal: local, ..Group::default() });
            }
            let entry = &mut groups[first + group];
            entry.count += 1;
            entry.middle += on_a;
            let point = Point { id: 0, group: group as u32, position, normal, separation, on_a, on_b };
            candidates.push(Candidate { point, known: None });
        };
        let mut any = false;
        for (region, slots) in reply.regions(record) {
            let normal = DVec3::from_array(region.normal);
            for slot in slots {
                for k in 0..(slot.count as usize).min(slot.points.len()) {
                    put(DVec3::from_array(slot.points[k]), normal, f64::from(slot.separations[k]));
                    any = true;
                }
            }
        }
        let needed = VALID_POINT | VALID_NORMAL;
        if !any && record.valid & needed == needed {
            match reply.detail(record).filter(|d| record.status == OVERLAP && d.penetration > 0.0) {
                Some(detail) => {
                    let deepest = poses[0].point(DVec3::from_array(detail.point_a));
                    put(deepest, DVec3::from_array(detail.direction), -detail.penetration);
                }
                None => put(DVec3::from_array(record.point), DVec3::from_array(record.normal), record.separation),
            }
        }
        groups[first..].iter_mut().for_each(|g| g.middle /= g.count as f64);
    }

    /// Says of each candidate which kept point of the step before it is, one to one, the surest first.
    fn recognise(&mut self, before: &PairPoints, pair: &PairPoints) {
        let old = &self.before.points[before.points[0]..before.points[1]];
        let old_groups = &self.before.groups[before.groups[0]..before.groups[1]];
        let new_groups = &self.now.groups[pair.groups[0]..pair.groups[1]];
        self.matches.clear();
        for (kept, was) in old.iter().enumerate() {
            let others = old.iter().enumerate().filter(|(k, _)| *k != kept);
            let next = others.map(|(_, p)| p.on_a.distance(was.on_a)).fold(f64::INFINITY, f64::min);
            let alone = REACH_ALONE * was.on_a.length().min(was.on_b.length());
            let reach = if next.is_finite() { REACH * next } else { alone };
            let group_was = &old_groups[was.group as usize];
            for (candidate, is) in self.candidates.iter().enumerate() {
                let group_is = &new_groups[is.point.group as usize];
                if group_is.normal.dot(group_was.normal) < SAME_SIDE {
                    continue;
                }
                let (d_a, d_b) = (is.point.on_a - was.on_a, is.point.on_b - was.on_b);
                let mut away = d_b.length().min(d_a.length() + PREFERENCE * reach);
                if group_is.count == group_was.count && away <= alone {
                    let d_m = d_a - (group_is.middle - group_was.middle);
                    away = away.min(d_m.length() + 2.0 * PREFERENCE * reach);
                }
                if away <= reach {
                    let cost = if reach > 0.0 { away / reach } else { 0.0 };
                    self.matches.push(Match { cost, kept, candidate });
                }
            }
        }
        self.matches.sort_unstable_by(|p, q| {
            p.cost.total_cmp(&q.cost).then(p.kept.cmp(&q.kept)).then(p.candidate.cmp(&q.candidate))
        });
        self.taken.clear();
        self.taken.resize(old.len(), false);
        for m in &self.matches {
            let known = &mut self.candidates[m.candidate].known;
            if known.is_none() && !self.taken[m.kept] {
                *known = Some(m.kept);
                self.taken[m.kept] = true;
            }
        }
        // From here on by its id.
        for c in &mut self.candidates {
            if let Some(kept) = c.known {
                c.point.id = old[kept].id;
            }
        }
    }

    /// Chooses a group's points and gives the new ones their ids.
    fn choose(&mut self, group: u32, pair: &mut PairPoints) {
        let candidates = &mut self.candidates;
        // The group's to the front, in the order in which they were told.
        let mut count = 0;
        for i in 0..candidates.len() {
            if candidates[i].point.group == group {
                candidates[count..=i].rotate_right(1);
                count += 1;
            }
        }
        let candidates = &candidates[..count];
        let Some(first) = candidates.first() else { return };
        self.span.set(first.point.normal, candidates.iter().map(|c| (c.point.position, c.point.separation)));
        let mut chosen = self.span.best(|_| true);
        if count > KEPT {
            let best = chosen;
            chosen = self.span.best(|i| candidates[i].known.is_some());
            if !chosen.indices().is_empty() {
                self.span.fill(&mut chosen);
            }
            if !self.span.suffices(&chosen, &best, SHARE) {
                chosen = best;
            }
        }
        let from = self.now.points.len();
        for i in chosen.indices() {
            let mut point = candidates[*i].point;
            if candidates[*i].known.is_none() {
                point.id = pair.next_id;
                pair.next_id = pair.next_id.wrapping_add(1);
            }
            self.now.points.push(point);
        }
        self.now.points[from..].sort_unstable_by_key(|p| p.id);
    }
}

impl Reported {
    fn find(&self, objects: [u32; 2]) -> Option<PairPoints> {
        self.pairs.binary_search_by_key(&objects, |p| p.objects).ok().map(|at| self.pairs[at])
    }

    fn manifold(&self, pair: &PairPoints) -> Manifold<'_> {
        let PairPoints { objects: [a, b], status, is_complete, points: [from, to], .. } = *pair;
        Manifold { a, b, status, is_complete, points: &self.points[from..to] }
    }
}

/// The fraction of the step that a record tells of: its time where the bodies meet, else the start.
pub fn reported_at(record: &ContactRecord) -> f64 {
    if matches!(record.status, CONTACT | OVERLAP) { record.time } else { 0.0 }
}
