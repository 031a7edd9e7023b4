//! What the server and its clients agree on: poses, motions, wire records, service names and error codes.
//!
//! Conventions: lengths in the models' unit, time within a step as a fraction 0..1, right-handed axes, `f64`
//! everywhere, quaternions `x y z w`, rotations active (`world = pose.point(local)`).
#![forbid(unsafe_code)]

pub mod motion;
pub mod pose;
pub mod rule;

pub use motion::Motion;
pub use pose::Pose;
pub use rule::{Detect, InitialOverlap, Report, Rule};
