//! Stage 3 and the queue that orders all three stages: earliest contact of one pair over one step.
//!
//! Floor 6: imports `eco`, `bound`, `motion`, `solid`, `math`, `proto`.

pub mod outcome;

pub use outcome::{Counters, Extent, Kind, Outcome, Status};
