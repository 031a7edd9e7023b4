//! Contacts that are asked for where something has moved, and carried along where nothing has: for loops that want the contacts
//! of all bodies at every step, most of which rest.
//!
//! ```
//! # use contactd_client::manifold::cache::ContactCache;
//! # use contactd_client::{Error, Session, Transport, proto::Pose};
//! # use std::time::Duration;
//! # fn step<T: Transport>(session: &mut Session<T>, cache: &mut ContactCache, poses: &[Pose]) -> Result<(), Error> {
//! let mut asked = cache.begin(poses).len();              // 0: everything rests
//! while asked > 0 {
//!     session.begin_step(asked)?.copy_from_slice(cache.records());
//!     asked = cache.answer(&session.finish(Duration::MAX)?).len();
//! }
//! for (pair, p) in cache.contacts() {
//!     println!("{} {} #{}: {} {} {}", pair.a, pair.b, p.id, p.position, p.normal, p.separation);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! A body is told to the engine once any of its points may have gone farther than the *slack* from where it was told last;
//! until then the engine has it there. So a pair of which neither body was told keeps its points. Each is carried: its place on
//! a with a, that on b with b ([`Point::carried`]). The separation along the normal is then exact where a face is flat; where
//! both are round, with radii R, it is off by (2 slack)²/R at most. Places that come within the margin meanwhile are found at
//! most twice the slack late. A slack of 0 asks whenever a bit has changed. A body that touches another by fewer than three points
//! of each direction, as a ball or a lying cylinder does, is told after a millionth of the slack: its points do not go along with
//! it.
//!
//! Bodies that overlap touch nowhere, so a pair that is told in overlap is asked about once more, moved apart along its
//! direction until half of the given gap is between its bodies: its points are those of the face it came through, carried
//! back. All such pairs are moved apart in one request, each with what stands on it. Pairs that cannot be apart together, as
//! those of a body between two walls, and pairs that overlap even there, as an edge in a face by more than the ball within it,
//! are asked about again, these as far out as the depth has fallen on the way so far lets expect, up to eight times in all; of
//! what is left then the depth is kept, one point. What was moved apart is put back with the next request.

use super::{Manifold, Manifolds, Point};
use crate::Reply;
use contactd_proto::contact_record::OVERLAP;
use contactd_proto::{Pose, PoseRecord};
use glam::DVec3;

/// A body whose contacts are followed.
#[derive(Clone, Copy, Debug)]
struct Followed {
    object: u32,
    /// How far its farthest point is from its origin.
    reach: f64,
    /// Where it stands.
    now: Pose,
    /// Where it was told last to stand.
    told: Option<Pose>,
    /// Where the engine has it for a pair that was moved apart.
    apart: Option<Pose>,
    is_fixed: bool,
    /// It touches something by less than three points of one direction: where, depends on how it stands.
    rolls: bool,
    /// It is told anew.
    is_asked: bool,
}

/// Of the slack, how far a body that rolls may go.
const ROLLING: f64 = 1e-6;

/// A pair in overlap.
#[derive(Clone, Copy, Debug)]
struct Overlap {
    /// Its objects.
    pair: [u32; 2],
    /// Places of their bodies; the second is the one that is moved, being the farther one from what is fixed.
    bodies: [usize; 2],
    /// How the second is to be moved against the first, for the face by which they met to be in sight.
    way: DVec3,
    /// How deep it was before it was moved by that, and after how much of a way.
    depth: f64,
    moved: f64,
    /// Pairs between it and what is fixed.
    level: usize,
}

/// Requests of a step that move pairs apart.
const MOST_ROUNDS: usize = 8;
/// How much of a way the depth falls by, at least, where it is followed to its end: of a needle's point it is less.
const LEAST_FALL: f64 = 0.05;
/// Of the gap, how far a pair that is moved by others may be from where it would be moved itself.
const ASIDE: f64 = 0.01;

/// Which of its requests a step waits for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Idle,
    First,
    Again,
}

/// What was counted since the beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// Requests, the second ones of a step among them.
    pub requests: u64,
    /// Bodies told in them.
    pub bodies: u64,
    /// Second requests, for pairs in overlap.
    pub retracted: u64,
}

/// The contacts of some bodies of a session, from step to step. Rules have to ask for patches and the penetration, the step for
/// details (see [`Manifolds`]).
#[derive(Clone, Debug)]
pub struct ContactCache {
    slack: f64,
    gap: f64,
    /// By object.
    bodies: Vec<Followed>,
    manifolds: Manifolds,
    records: Vec<PoseRecord>,
    /// Pairs in overlap that are asked about again.
    deep: Vec<Overlap>,
    /// Pairs in overlap that no request has moved apart yet.
    left: Vec<Overlap>,
    /// Requests of the step that move pairs apart, so far.
    rounds: usize,
    phase: Phase,
    asked: Asked,
}

impl ContactCache {
    /// Without bodies. `slack`: a length; `gap`: that to which pairs in overlap are moved apart, half of it.
    pub fn new(slack: f64, gap: f64) -> Self {
        let (manifolds, phase, asked) = (Manifolds::default(), Phase::Idle, Asked::default());
        let (bodies, records, deep, left) = Default::default();
        Self { slack, gap, bodies, manifolds, records, deep, left, rounds: 0, phase, asked }
    }

    /// Follows an object that stands where it stands. Objects are added in the order of their ids.
    pub fn add_fixed(&mut self, object: u32, pose: Pose) {
        self.add(Followed {
            object,
            reach: 0.0,
            now: pose,
            told: Some(pose),
            apart: None,
            is_fixed: true,
            rolls: false,
            is_asked: false,
        });
    }

    /// Follows an object that moves; `reach`: how far its points are from its origin, infinite for one without bounds.
    pub fn add_moving(&mut self, object: u32, reach: f64) {
        let (now, told, apart) = (Pose::IDENTITY, None, None);
        self.add(Followed { object, reach, now, told, apart, is_fixed: false, rolls: false, is_asked: false });
    }

    fn add(&mut self, body: Followed) {
        debug_assert!(self.bodies.last().is_none_or(|last| last.object < body.object), "in the order of their ids");
        self.bodies.push(body);
    }

    /// A step begins, with the moving objects at these poses, in the order in which they were added. The records to be sent
    /// to the engine, whose reply `answer` takes; none where everything rests.
    pub fn begin(&mut self, poses: &[Pose]) -> &[PoseRecord] {
        self.records.clear();
        self.mark_what_rolls();
        let mut any = false;
        for (body, pose) in self.bodies.iter_mut().filter(|body| !body.is_fixed).zip(poses) {
            body.now = *pose;
            // What is no number has gone, too: the engine says so.
            let slack = if body.rolls { ROLLING * self.slack } else { self.slack };
            let rests = body.told.is_some_and(|told| displacement(&told, pose, body.reach) <= slack);
            body.is_asked = !rests;
            any |= body.is_asked;
        }
        if !any {
            self.phase = Phase::Idle;
            return &self.records;
        }
        for body in &self.bodies {
            let pose = if body.is_asked { Some(body.now) } else { body.told.filter(|_| body.apart.is_some()) };
            self.records.extend(pose.map(|pose| PoseRecord::start(body.object, &pose)));
        }
        self.phase = Phase::First;
        &self.records
    }

    /// A ball's point that is carried along stays behind when it rolls: what presses there drives it on.
    fn mark_what_rolls(&mut self) {
        self.bodies.iter_mut().for_each(|body| body.rolls = false);
        for pair in self.manifolds.pairs() {
            let of = |group: u32| pair.points.iter().filter(|p| p.group == group).count();
            if !pair.points.iter().any(|p| of(p.group) >= 3) {
                for object in [pair.a, pair.b] {
                    if let Some(i) = index(&self.bodies, object) {
                        self.bodies[i].rolls = true;
                    }
                }
            }
        }
    }

    /// The records that are to be sent.
    pub fn records(&self) -> &[PoseRecord] {
        &self.records
    }

    /// Takes the reply to the records. Returns those of the step's second request; none where it needs none.
    pub fn answer(&mut self, reply: &Reply) -> &[PoseRecord] {
        self.asked.requests += 1;
        self.asked.bodies += self.records.len() as u64;
        self.records.clear();
        match std::mem::take(&mut self.phase) {
            Phase::Idle => {}
            Phase::First => self.first(reply),
            Phase::Again => self.again(reply),
        }
        &self.records
    }

    /// A request has failed, or others have moved the session's objects: where the engine has them is unknown. Points stay those of
    /// the last step; all bodies are told at the next.
    pub fn forget(&mut self) {
        self.phase = Phase::Idle;
        for body in self.bodies.iter_mut().filter(|body| !body.is_fixed) {
            (body.told, body.apart) = (None, None);
        }
    }

    /// All points in the order (a, b), where the bodies stand.
    pub fn contacts(&self) -> impl Iterator<Item = (Manifold<'_>, Point)> {
        self.manifolds.pairs().flat_map(|pair| {
            let [a, b] = [pair.a, pair.b]
                .map(|object| index(&self.bodies, object).map_or(Pose::IDENTITY, |i| self.bodies[i].now));
            pair.points.iter().map(move |p| (pair, p.carried(&a, &b)))
        })
    }

    /// What was asked of the engine.
    pub fn asked(&self) -> Asked {
        self.asked
    }

    /// Where the engine has an object.
    fn there(&self, object: u32) -> Option<Pose> {
        let body = &self.bodies[index(&self.bodies, object)?];
        body.apart.or(body.told)
    }

    fn first(&mut self, reply: &Reply) {
        for body in self.bodies.iter_mut().filter(|body| !body.is_fixed) {
            body.apart = None;
            if body.is_asked {
                body.told = Some(body.now);
            }
        }
        self.manifolds.start();
        self.take(reply, |cache, a, b, _| is_asked(&cache.bodies, a, b));
        let bodies = &self.bodies;
        self.manifolds.keep(|a, b| !is_asked(bodies, a, b));
        self.manifolds.finish();
        self.move_apart();
    }

    /// Takes the records of the pairs that `of` (objects, status) admits.
    fn take(&mut self, reply: &Reply, of: impl Fn(&Self, u32, u32, u8) -> bool) {
        for record in reply.records() {
            if !of(self, record.a, record.b, record.status) {
                continue;
            }
            if let (Some(a), Some(b)) = (self.there(record.a), self.there(record.b)) {
                self.manifolds.add(reply, record, &a, &b);
            }
        }
    }

    /// Plans the request that moves apart what is in overlap.
    fn move_apart(&mut self) {
        // Of a step whose request failed something may be left.
        self.deep.clear();
        self.left.clear();
        self.rounds = 0;
        for pair in self.manifolds.pairs().filter(|pair| pair.status == OVERLAP) {
            let (Some(p), true) = (pair.points.first(), is_asked(&self.bodies, pair.a, pair.b)) else { continue };
            let (Some(a), Some(b)) = (index(&self.bodies, pair.a), index(&self.bodies, pair.b)) else { continue };
            let depth = -p.separation;
            let way = p.normal * (0.5 * self.gap + depth);
            self.left.push(Overlap { pair: [pair.a, pair.b], bodies: [a, b], way, depth, moved: 0.0, level: 0 });
        }
        if !self.left.is_empty() {
            self.asked.retracted += 1;
            self.sort_from_the_ground();
            self.next_round();
        }
    }

    /// Pairs next to what is fixed first, then those beside these, and so on.
    fn sort_from_the_ground(&mut self) {
        const FAR: usize = usize::MAX;
        let mut above: Vec<usize> = self.bodies.iter().map(|body| if body.is_fixed { 0 } else { FAR }).collect();
        for level in 1.. {
            let mut found = false;
            for pair in &self.left {
                let [a, b] = pair.bodies;
                for (below, over) in [(a, b), (b, a)] {
                    if above[below] == level - 1 && above[over] == FAR {
                        (above[over], found) = (level, true);
                    }
                }
            }
            if found {
                continue;
            }
            // What hangs together with nothing fixed begins at its first body.
            let Some(pair) = self.left.iter().find(|pair| pair.bodies.iter().all(|i| above[*i] == FAR)) else { break };
            above[pair.bodies[0]] = level;
        }
        for pair in &mut self.left {
            let [a, b] = pair.bodies;
            if above[a] > above[b] {
                (pair.bodies, pair.way) = ([b, a], -pair.way);
            }
            let [a, b] = pair.bodies.map(|i| above[i]);
            // Two of one height: once both are placed.
            pair.level = 2 * b + usize::from(a == b);
        }
        self.left.sort_by_key(|pair| pair.level);
    }

    /// The request for as many of the pairs that are left as can be apart together, each by its own way: a round body that others had
    /// moved aside would touch elsewhere.
    fn next_round(&mut self) {
        let still = |body: &Followed| body.is_fixed.then_some(DVec3::ZERO);
        let mut ways: Vec<Option<DVec3>> = self.bodies.iter().map(still).collect();
        let near = ASIDE * self.gap;
        let mut later = Vec::new();
        for pair in std::mem::take(&mut self.left) {
            let [a, b] = pair.bodies;
            let wanted = *ways[a].get_or_insert(DVec3::ZERO) + pair.way;
            if ways[b].get_or_insert(wanted).distance(wanted) <= near {
                self.deep.push(pair);
            } else {
                later.push(pair);
            }
        }
        self.left = later;
        for (body, way) in self.bodies.iter_mut().zip(ways).filter(|(body, _)| !body.is_fixed) {
            let way = way.unwrap_or_default();
            let apart = body.told.filter(|_| way != DVec3::ZERO);
            let apart = apart.map(|told| Pose { position: told.position + way, ..told });
            // What an earlier request has moved is put back.
            let told = apart.or(body.told.filter(|_| body.apart.is_some()));
            body.apart = apart;
            self.records.extend(told.map(|pose| PoseRecord::start(body.object, &pose)));
        }
        self.rounds += 1;
        self.phase = Phase::Again;
    }

    /// Takes the pairs that are apart now. The depth that was told may be less than the way out, as of an edge in a face: what is in
    /// overlap still goes on from there.
    fn again(&mut self, reply: &Reply) {
        let deep = std::mem::take(&mut self.deep);
        self.take(reply, |_, a, b, status| status != OVERLAP && deep.iter().any(|pair| pair.pair == [a, b]));
        self.manifolds.finish();
        let moved = |i: usize| {
            let body = &self.bodies[i];
            body.apart.zip(body.told).map_or(DVec3::ZERO, |(apart, told)| apart.position - told.position)
        };
        for record in reply.records().iter().filter(|record| record.status == OVERLAP) {
            let Some(pair) = deep.iter().find(|pair| pair.pair == [record.a, record.b]) else { continue };
            let Some(detail) = reply.detail(record).filter(|detail| detail.penetration > 0.0) else { continue };
            let [a, b] = pair.bodies;
            // The direction is from the record's first object to its second.
            let direction = DVec3::from_array(detail.direction);
            let direction = if self.bodies[b].object == record.b { direction } else { -direction };
            let (way, depth) = (moved(b) - moved(a), detail.penetration);
            let went = way.length();
            // The ball within an edge or a corner that sticks in is in proportion to how deep that is: it falls evenly on the way out.
            let falls = (pair.depth - depth) / (went - pair.moved);
            let rest = if falls > LEAST_FALL { (depth / falls).max(depth) } else { depth };
            let way = way + direction * (0.5 * self.gap + rest);
            self.left.push(Overlap { way, depth, moved: went, ..*pair });
        }
        self.left.sort_by_key(|pair| pair.level);
        if !self.left.is_empty() && self.rounds < MOST_ROUNDS {
            self.next_round();
        }
    }
}

/// Place of an object's body.
fn index(bodies: &[Followed], object: u32) -> Option<usize> {
    bodies.binary_search_by_key(&object, |body| body.object).ok()
}

/// True when one of two objects was told anew.
fn is_asked(bodies: &[Followed], a: u32, b: u32) -> bool {
    [a, b].iter().any(|object| index(bodies, *object).is_some_and(|i| bodies[i].is_asked))
}

/// How far a body's points are from where they were at another pose, at most: the way of its origin, and the chord of the turn.
fn displacement(from: &Pose, to: &Pose, reach: f64) -> f64 {
    let way = (to.position - from.position).length();
    if to.rotation == from.rotation {
        return way;
    }
    let turn = to.rotation * from.rotation.conjugate();
    way + 2.0 * DVec3::new(turn.x, turn.y, turn.z).length() * reach
}
