//! Stage 1: where can a collision be at all? A bounding ball *and* an axis-aligned box at every node of a CSG tree.
//!
//! S. Cameron, "Efficient bounds in constructive solid geometry", IEEE CG&A 11(3), 1991; S. Cameron and C. K. Yap, ACM
//! TOG 11(1), 1992. Balls do not change under rotation, boxes are usually tighter; each tightens the other (`rules`).
//! `SBounds` holds them for a model (`tree`), `CollisionRegion` is what a pair leaves over its motion (`pair`). Balls alone, boxes
//! alone and boxes along other axes (`Volumes`) are there to be compared; the default costs nothing for it.
//!
//! Floor 3: imports `solid`, `motion`, `math`.

pub mod pair;
pub mod rules;
pub mod tree;

pub use pair::{CollisionRegion, Pruned, Side, locate};
pub use rules::{Bound, Volumes};
pub use tree::SBounds;
