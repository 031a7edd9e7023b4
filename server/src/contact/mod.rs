//! Stage 3 and the queue that orders all three stages: earliest contact of one pair over one step.
//!
//! Floor 6: imports `octree`, `bound`, `motion`, `solid`, `math`, `proto`.

mod cavity;
mod cell;
pub mod certificate;
pub mod clause;
pub mod clearance;
pub mod clock;
mod convex;
mod depth;
mod extent;
mod features;
pub mod fit;
mod found;
mod handed;
pub mod literal;
pub mod lp;
pub mod newton;
pub mod outcome;
pub mod pair;
mod propose;
pub mod query;
pub mod query_options;
pub mod region;
mod rescue;
pub mod roots;
pub mod rounding;
pub mod search;
pub mod separation;
mod stage2;
mod task;
#[cfg(test)]
mod tests;
mod unbounded;
pub mod within;
mod work;

pub use clock::{Clock, Stage};
pub(crate) use convex::{Glancing, Hull, SeparatingAxisTest, SweptShape};
pub use outcome::{Counters, DEFAULT_CELL_LIMIT, Extent, Kind, Outcome, Status};
pub use pair::{PairSearch, earliest_contact, find_earliest, resolution_of};
pub use query::{Body, PairQuery, Strategies, default_resolution};
pub use query_options::QueryOptions;
pub use region::{Region, RegionPoint, Regions};
pub use search::Scratch;
