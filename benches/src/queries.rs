//! The engine's side of a race: models built beforehand, one scratch for all queries.

use contactd::contact::{
    Body, DEFAULT_CELL_LIMIT, Ideas, Outcome, PairQuery, Scratch, default_resolution, earliest_contact,
};
use contactd::eco::Model;
use contactd::motion::Placed;
use contactd_proto::{Motion, Pose};

/// A prepared question: cold, as nothing of an earlier answer is kept.
#[derive(Clone, Copy)]
pub struct Question<'a> {
    /// First model.
    pub a: &'a Model,
    /// Its motion.
    pub motion_a: Motion,
    /// Second model.
    pub b: &'a Model,
    /// Its motion.
    pub motion_b: Motion,
}

impl Question<'_> {
    /// The certified answer at the default resolution, 1e-9 of the larger radius.
    pub fn ask(&self, ideas: Ideas, scratch: &mut Scratch) -> Outcome {
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        let query = PairQuery {
            a: Body { model: self.a, placed: placed(self.motion_a) },
            b: Body { model: self.b, placed: placed(self.motion_b) },
            resolution: default_resolution(self.a, self.b),
            cell_limit: DEFAULT_CELL_LIMIT,
            ideas,
            penetration: true,
        };
        earliest_contact(&query, scratch)
    }
}
