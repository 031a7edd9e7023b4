//! Questions for the tests of this floor.

use super::{PairQuery, PlacedModel, QueryOptions, Strategies, default_resolution};
use crate::math::random::Random;
use crate::motion::Placed;
use crate::octree::Model;
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};

/// A question about two models near each other that move and turn at random.
pub fn random_query<'m>(a: &'m Model, b: &'m Model, r: &mut Random) -> PairQuery<'m> {
    let mut placed = || Placed {
        place: Pose::IDENTITY,
        motion: Motion {
            start: Pose::new(r.vector(0.8), quat_of_rotation_vector(r.vector(2.0))),
            velocity: r.vector(0.5),
            spin: r.vector(0.5),
        },
    };
    PairQuery {
        a: PlacedModel { model: a, placed: placed() },
        b: PlacedModel { model: b, placed: placed() },
        resolution: default_resolution(a, b),
        cell_limit: 1000,
        strategies: Strategies::default(),
        query_options: QueryOptions::CONTACT,
    }
}
