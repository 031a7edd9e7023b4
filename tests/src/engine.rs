//! The library's own answer to a scene, all stages on.

use crate::scenes::Scene;
use contactd::contact::{Body, Ideas, Outcome, PairQuery, Scratch, default_resolution, earliest_contact};
use contactd::eco::Model;
use contactd::motion::Placed;
use contactd::solid::Solid;
use contactd_proto::Pose;

/// Cells that a test may spend on a pair, far below the default: what needs more should be told so.
pub const CELL_LIMIT: u64 = 30_000;

/// Asks about two placed solids; `None` is the default resolution.
pub fn ask_solids(a: (Solid, Placed), b: (Solid, Placed), resolution: Option<f64>) -> Outcome {
    ask_models((&Model::new(a.0), a.1), (&Model::new(b.0), b.1), resolution)
}

/// Asks about two placed models.
pub fn ask_models(a: (&Model, Placed), b: (&Model, Placed), resolution: Option<f64>) -> Outcome {
    ask_with(a, b, resolution, Ideas::default())
}

/// Asks about two placed models with some ideas of the search switched off.
pub fn ask_with(a: (&Model, Placed), b: (&Model, Placed), resolution: Option<f64>, ideas: Ideas) -> Outcome {
    let query = PairQuery {
        a: Body { model: a.0, placed: a.1 },
        b: Body { model: b.0, placed: b.1 },
        resolution: resolution.unwrap_or_else(|| default_resolution(a.0, b.0)),
        cell_limit: CELL_LIMIT,
        ideas,
    };
    earliest_contact(&query, &mut Scratch::default())
}

/// Asks about a scene.
pub fn ask(scene: &Scene) -> Outcome {
    let placed = |motion| Placed { place: Pose::IDENTITY, motion };
    ask_solids((scene.a.build(), placed(scene.motion_a)), (scene.b.build(), placed(scene.motion_b)), scene.resolution)
}
