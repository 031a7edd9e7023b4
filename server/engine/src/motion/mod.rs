//! A step's motion, seen from one body of a pair: relative positions, velocities and bounds on both.
//!
//! Floor 1: imports `math` and `proto`.

pub mod relative;
pub mod rounding;
pub mod sweep;

pub use relative::{Bounds, Instant, Placed, Relative};
pub use rounding::Rounding;
pub use sweep::Sweep;
