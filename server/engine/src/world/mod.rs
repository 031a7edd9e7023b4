//! A session's scene and one step of it: bodies, rules, broad phase, pairs in canonical order, outcomes.
//!
//! A step checks its whole batch first and then takes it whole: a refused batch changes nothing. Every pair that rules
//! allow and that the broad phase lets through is searched by itself, the smaller object id first, so the answer depends
//! neither on the order of the batch nor on the order in which pairs are searched. What two swept boxes exclude is
//! proven clear: the broad phase is part of the certificate, not a filter by taste. What earlier steps have proven of a
//! pair (`neighbours`, `coherence`) spares its search and changes no answer.
//!
//! Invariant: ids are never used again; pairs of two static bodies never exist; buffers are kept from step to step.
//! It does not know files, sockets or wire layouts other than the two record types.
//!
//! Floor 6: imports `contact`, `octree`, `motion`, `solid`, `math`, `proto`.

pub mod ask;
pub mod body;
mod boxes;
pub mod broad;
mod coherence;
mod distances;
pub mod heed;
pub mod memory;
mod neighbours;
mod notes;
pub mod options;
pub mod outcome;
mod pairs;
pub mod plan;
pub mod record;
mod roster;
pub mod scene;
mod search;
mod state;
pub mod step;
mod swept_shapes;
mod touch;

pub use ask::{BodyPoint, BodyRay, Standing};
pub use body::{MeasuredModel, ObjectSpec};
pub use heed::{Crew, Heed, LONG_PRIORITY, yield_to_others};
pub use options::{StepError, StepOptions};
pub use outcome::{PairOutcome, StepOutcome};
pub use plan::{PairPlan, Plans};
pub use scene::{Refusal, World};
