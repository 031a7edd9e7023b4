//! Extended CSG octrees: where a solid is full, empty, or bounded by which primitives.
//!
//! Floor 5: imports `bound`, `solid`, `math`.

use crate::solid::Solid;

/// A solid with what was preprocessed for it. Shared by all objects that use it.
#[derive(Debug)]
pub struct Model {
    /// The solid.
    pub solid: Solid,
}

impl Model {
    /// Preprocesses a solid.
    pub fn new(solid: Solid) -> Self {
        Self { solid }
    }
}
