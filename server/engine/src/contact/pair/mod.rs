//! One pair over one step: the proofs in front of the queue, then the queue; and the answer's fields.

mod front;
pub mod overlap;
mod report;
pub mod search;
pub mod unbounded;

pub use search::{PairSearch, earliest_contact, find_earliest, resolution_of};
