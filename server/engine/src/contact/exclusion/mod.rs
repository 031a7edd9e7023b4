//! What proves that a box of A holds no contact over a span of time: literals bounded, clauses of them, like faces that fit, and what
//! rounding may take from each.

pub mod clause;
mod course;
pub mod enumeration;
pub mod fit;
pub mod literal;
pub mod lp;
pub mod rounding;
pub mod tighten;
