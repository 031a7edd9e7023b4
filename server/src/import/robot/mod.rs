//! Robots and worlds: links, joints and what of them collides, from URDF, SDFormat and MJCF; and as a scene where they stand.
//!
//! A file becomes a `Robot`: a tree of links, each with its degrees of freedom towards its parent, and its collision geometry as a
//! flattened OpenSCAD text in its own frame. Joint values make it a `Scene`: an object a link, and one rule with the pairs that are
//! not to be tested. Lengths are metres and angles radians, as all three formats have them unless they say otherwise.
//!
//! A step leads from joint values to others at constant rates. What a link does then is told exactly, or refused: links of which one
//! hinge moves, and slides before it, and slides along its axis after it, go straight and turn at a constant rate.

mod frames;
mod kinematics;
mod mjcf;
mod mjcf_couplings;
mod mjcf_files;
mod reader;
mod scene;
mod sdf;
mod sdf_elements;
mod shape;
mod urdf;

pub use kinematics::{Dof, DofKind, Link, Robot, Values};
pub use reader::Ask;
pub use scene::{LinkPath, paths_of, read_robot, scene_of};

use std::path::Path;

/// True for the name of a file that these formats have.
pub fn is_robot(path: &Path) -> bool {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    ["urdf", "sdf", "world", "xml", "mjcf"].contains(&ending.as_str())
}
