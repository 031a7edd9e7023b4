//! Poses as Python gives them.

use contactd_proto::Pose;
use glam::{DQuat, DVec3};

/// The numbers of a pose: position, and rotation as x, y, z, w.
pub type PoseFields = ([f64; 3], [f64; 4]);

/// A pose from its numbers. The rotation must be a unit quaternion x, y, z, w; the server says when it is not.
pub fn pose(position: [f64; 3], rotation: [f64; 4]) -> Pose {
    Pose::new(DVec3::from_array(position), DQuat::from_array(rotation))
}
