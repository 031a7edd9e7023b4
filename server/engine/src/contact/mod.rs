//! Earliest contact of one pair over one step: proofs in front that need no cells, and the queue of the three stages.
//!
//! Floor 5: imports `octree`, `bound`, `motion`, `solid`, `math`, `proto`. Its folders stand on floors of their own
//! (docs/architecture.md): each holds one idea and imports only from those below it, by their own paths.

mod ball;
mod cavity;
pub mod certificate;
mod convex;
pub mod distance;
pub mod exclusion;
mod facets;
pub mod instant;
pub mod margin;
pub mod pair;
pub mod probe;
pub mod query;
pub mod queue;
pub mod region;
#[cfg(test)]
mod testing;
pub mod witness;

pub(crate) use convex::{AxisSearch, Hull, SeparatingAxisTest, SweptShape};
pub use instant::within;
pub use pair::{PairSearch, earliest_contact, find_earliest, resolution_of};
pub use query::options::QueryOptions;
pub use query::outcome::{
    Contact, ContactKind, ContactPoint, Counters, DEFAULT_CELL_LIMIT, Extent, Outcome, Overlap, Penetration, Status,
    Verdict,
};
pub use query::question::{PairQuery, PlacedModel, Strategies, default_resolution};
pub use queue::clock::{Clock, Stage};
pub use queue::scratch::Scratch;
pub use region::{Region, RegionPoint, Regions};
