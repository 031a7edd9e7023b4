//! Contacts that are asked for where something has moved, and carried along where nothing has: for loops that want the contacts
//! of all bodies at every step, most of which rest.
//!
//! ```
//! # use contactd_client::manifold::cache::ContactCache;
//! # use contactd_client::{Error, Session, Transport, proto::Pose};
//! # use std::time::Duration;
//! # fn step<T: Transport>(session: &mut Session<T>, cache: &mut ContactCache, poses: &[Pose]) -> Result<(), Error> {
//! let asked = cache.begin(poses).len();                  // 0: everything rests
//! if asked > 0 {
//!     session.begin_step(asked)?.copy_from_slice(cache.records());
//!     cache.answer(&session.finish(Duration::MAX)?);
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
//! Of a pair in overlap the reply tells the regions of the face by which the bodies met, with what they overlap there; of one that
//! does not come apart by the depth that is known, the deepest point.

use super::{Manifold, Manifolds, Point};
use crate::Reply;
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
    is_fixed: bool,
    /// It touches something by less than three points of one direction: where, depends on how it stands.
    rolls: bool,
    /// It is told anew.
    is_asked: bool,
}

/// Of the slack, how far a body that rolls may go.
const ROLLING: f64 = 1e-6;

/// What was counted since the beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// Requests.
    pub requests: u64,
    /// Bodies told in them.
    pub bodies: u64,
}

/// The contacts of some bodies of a session, from step to step. Rules have to ask for patches and the penetration, the step for
/// details (see [`Manifolds`]).
#[derive(Clone, Debug)]
pub struct ContactCache {
    slack: f64,
    /// By object.
    bodies: Vec<Followed>,
    manifolds: Manifolds,
    records: Vec<PoseRecord>,
    /// A reply is awaited.
    is_asking: bool,
    asked: Asked,
}

impl ContactCache {
    /// Without bodies. `slack`: a length.
    pub fn new(slack: f64) -> Self {
        let (bodies, manifolds, records) = Default::default();
        Self { slack, bodies, manifolds, records, is_asking: false, asked: Asked::default() }
    }

    /// Follows an object that stands where it stands. Objects are added in the order of their ids.
    pub fn add_fixed(&mut self, object: u32, pose: Pose) {
        self.add(Followed {
            object,
            reach: 0.0,
            now: pose,
            told: Some(pose),
            is_fixed: true,
            rolls: false,
            is_asked: false,
        });
    }

    /// Follows an object that moves; `reach`: how far its points are from its origin, infinite for one without bounds.
    pub fn add_moving(&mut self, object: u32, reach: f64) {
        let (now, told) = (Pose::IDENTITY, None);
        self.add(Followed { object, reach, now, told, is_fixed: false, rolls: false, is_asked: false });
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
        for (body, pose) in self.bodies.iter_mut().filter(|body| !body.is_fixed).zip(poses) {
            body.now = *pose;
            // What is no number has gone, too: the engine says so.
            let slack = if body.rolls { ROLLING * self.slack } else { self.slack };
            let rests = body.told.is_some_and(|told| displacement(&told, pose, body.reach) <= slack);
            body.is_asked = !rests;
            if body.is_asked {
                self.records.push(PoseRecord::start(body.object, pose));
            }
        }
        self.is_asking = !self.records.is_empty();
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

    /// Takes the reply to the records.
    pub fn answer(&mut self, reply: &Reply) {
        if !std::mem::take(&mut self.is_asking) {
            return;
        }
        self.asked.requests += 1;
        self.asked.bodies += self.records.len() as u64;
        self.records.clear();
        for body in self.bodies.iter_mut().filter(|body| body.is_asked) {
            body.told = Some(body.now);
        }
        self.manifolds.start();
        let bodies = &self.bodies;
        let told = |object: u32| bodies[index(bodies, object)?].told;
        for record in reply.records().iter().filter(|record| is_asked(bodies, record.a, record.b)) {
            if let (Some(a), Some(b)) = (told(record.a), told(record.b)) {
                self.manifolds.add(reply, record, &a, &b);
            }
        }
        self.manifolds.keep(|a, b| !is_asked(bodies, a, b));
        self.manifolds.finish();
    }

    /// A request has failed, or others have moved the session's objects: where the engine has them is unknown. Points stay those of
    /// the last step; all bodies are told at the next.
    pub fn forget(&mut self) {
        self.is_asking = false;
        self.bodies.iter_mut().filter(|body| !body.is_fixed).for_each(|body| body.told = None);
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
