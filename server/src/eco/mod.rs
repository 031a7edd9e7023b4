//! Extended CSG octrees: where a solid is full, empty, or bounded by which primitives.
//!
//! Floor 5: imports `bound`, `solid`, `math`.

use crate::bound::SBounds;
use crate::math::tolerance::MODEL_MARGIN;
use crate::solid::Solid;

/// A solid with what was preprocessed for it. Shared by all objects that use it.
#[derive(Debug)]
pub struct Model {
    /// The solid.
    pub solid: Solid,
    /// Its S-bounds, with a margin of `MODEL_MARGIN` times the radius.
    pub bounds: SBounds,
    /// Bounding radius: that of the ball around the solid. 0 for an empty solid, infinite for an unbounded one.
    pub radius: f64,
}

impl Model {
    /// Preprocesses a solid.
    pub fn new(solid: Solid) -> Self {
        let radius = SBounds::new(&solid, 0.0).root().ball.radius.max(0.0);
        let margin = if radius.is_finite() { MODEL_MARGIN * radius } else { 0.0 };
        let bounds = SBounds::new(&solid, margin);
        Self { solid, bounds, radius }
    }
}
