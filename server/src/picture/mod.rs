//! Pictures that the program draws of its own data: placed solids with their contacts, trees with bounds, octree slices.
//!
//! `ray` traces trees exactly, `view` turns that into an image, `drawing` adds lines and text and writes SVG or PNG.
//! Deterministic: the same scene gives the same file. Nothing here is used by the search.
//!
//! Floor 9, beside the reports: imports everything down to `math`; nothing below imports it.

pub mod camera;
pub mod contacts;
pub mod drawing;
mod line;
mod mesh;
pub mod ray;
pub mod scene;
pub mod slice;
pub mod tree;
pub mod view;

use crate::octree::Model;
use drawing::Drawing;

/// All about one model: its tree with S-bounds, and slices of its octree.
pub fn model(name: &str, model: &Model) -> Drawing {
    slice::slice(name, model).below(tree::tree(name, &model.solid, &model.bounds))
}
