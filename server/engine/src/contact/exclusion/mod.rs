//! What proves that a box of A holds no contact over a span of time.
//!
//! | file | |
//! |---|---|
//! | `literal` | a cell at an instant, and the planes that bound its literals from below |
//! | `lp` | the multipliers of a clause: a linear program over the cell |
//! | `clause` | how long a clause keeps the cell free, by which multipliers |
//! | `course` | what multipliers that stay the same prove through time |
//! | `enumeration` | the clauses of a cell, bounded without going through them all |
//! | `fit` | like faces, one in the other: a bound of both together |
//! | `tighten` | what the clauses leave of the cell |
//! | `rounding` | what rounding may take from each bound |

pub mod clause;
mod course;
pub mod enumeration;
pub mod fit;
pub mod literal;
pub mod lp;
pub mod rounding;
pub mod tighten;
