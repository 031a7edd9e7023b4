//! The engine's side of a race: models built beforehand, one scratch for all queries.

use contactd::contact::{
    DEFAULT_CELL_LIMIT, Outcome, PairQuery, PlacedModel, QueryOptions, Scratch, Strategies, default_resolution,
    earliest_contact,
};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd_proto::{Motion, Pose};

/// A prepared question: cold, as nothing of an earlier answer is kept.
#[derive(Clone, Copy)]
pub struct Question<'a>(PairQuery<'a>);

impl<'a> Question<'a> {
    /// Two moving models, at the default resolution of 1e-9 of the larger radius.
    pub fn new((a, motion_a): (&'a Model, Motion), (b, motion_b): (&'a Model, Motion), strategies: Strategies) -> Self {
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        Self(PairQuery {
            a: PlacedModel { model: a, placed: placed(motion_a) },
            b: PlacedModel { model: b, placed: placed(motion_b) },
            resolution: default_resolution(a, b),
            cell_limit: DEFAULT_CELL_LIMIT,
            strategies,
            query_options: QueryOptions::DEPTH,
        })
    }

    /// The certified answer.
    pub fn ask(&self, scratch: &mut Scratch) -> Outcome {
        earliest_contact(&self.0, scratch)
    }
}
