//! Harnesses shared by the integration tests.

pub mod openscad;
pub mod random_solids;
