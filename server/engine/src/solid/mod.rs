//! Solids as they were designed: a tree of set operations over exact primitives.
//!
//! A primitive is an intersection of convex faces psi <= 0 (`surface`), or an and/or of faces (`formula`); a solid is a tree of
//! them (`tree`), and `f`
//! (`classify`) is the tree's min/max: union = min, intersection = max, difference A - B = max(f_A, -f_B). f < 0 inside,
//! > 0 outside, 1-Lipschitz.
//!
//! Of a whole solid: which of its faces lie on each other (`alike`), about what it may be symmetric (`revolution`), and its parts
//! where it is a union of convex primitives less others (`parts`).
//!
//! Floor 2: imports `math` and `proto`.

pub mod alike;
pub mod classify;
pub mod faces;
pub mod formula;
pub mod local;
pub mod parts;
pub mod primitive;
pub mod revolution;
pub mod sense;
pub mod surface;
pub mod tree;

pub use faces::Faces;
pub use parts::Parts;
pub use primitive::{Primitive, Shape};
pub use sense::Sense;
pub use surface::Face;
pub use tree::{Label, Measured, Node, NodeId, Op, Solid, SolidBuilder, write_node, write_tree};
