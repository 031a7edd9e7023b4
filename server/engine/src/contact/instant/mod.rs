//! A pair at one instant: a cover of what lies near both bodies, the deepest point, whether they come within a distance, and the work
//! that this may cost.

pub mod depth;
mod near;
pub(in crate::contact) mod program;
pub mod separation;
pub mod within;
pub mod work;
