//! Where an object stands between steps: its last accepted motion and the pose that motion ended at.
//!
//! The server and the client's journal run the same arithmetic on it, so a replayed session continues bit for bit.
//! The end is kept as it was given: it is not recomputed from the motion, so that nothing creeps over many steps.

use crate::pose_record::Order;
use crate::{Motion, Pose};

/// An object's last accepted motion and where it ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Track {
    /// Motion over the last accepted step.
    pub motion: Motion,
    /// Pose at its end.
    pub end: Pose,
}

impl Track {
    /// An object that was put at `pose`.
    pub fn resting(pose: Pose) -> Self {
        Self { motion: Motion::resting(pose), end: pose }
    }

    /// The pose from which the next step starts when `advance` (0..1) of the last one is taken.
    pub fn at(&self, advance: f64) -> Pose {
        if advance == 1.0 { self.end } else { self.motion.at(advance) }
    }

    /// The track of the next step, of an object that stands at `start`.
    pub fn ordered(start: Pose, order: Order) -> Self {
        match order {
            Order::Start(pose) => Self::resting(pose),
            // Equal rotations mean no rotation, whatever the last bit of their product says.
            Order::End(end) if end.rotation == start.rotation => {
                Self { motion: Motion::turning(start, end.position, glam::DVec3::ZERO), end }
            }
            Order::End(end) => Self { motion: Motion::between(start, end), end },
            Order::Turn(position, vector) => {
                let motion = Motion::turning(start, position, vector);
                Self { motion, end: Pose::new(position, motion.at(1.0).rotation) }
            }
        }
    }

    /// True when the object did not move.
    pub fn is_rest(&self) -> bool {
        self.motion.is_rest()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::quat_of_rotation_vector;
    use glam::DVec3;

    #[test]
    fn an_end_is_kept_to_the_last_bit() {
        let start = Pose::new(DVec3::new(0.1, 0.7, 1e3), quat_of_rotation_vector(DVec3::new(0.1, 0.2, 0.3)));
        let end = Pose::new(DVec3::new(1.0 / 3.0, 1e-9, 7.0), quat_of_rotation_vector(DVec3::new(2.0, -0.2, 0.3)));
        assert_eq!(Track::ordered(start, Order::End(end)).at(1.0), end);
        assert_eq!(Track::ordered(start, Order::End(end)).at(0.0).position, start.position);
    }

    #[test]
    fn equal_rotations_do_not_turn() {
        let q = quat_of_rotation_vector(DVec3::new(0.4, -1.1, 2.0));
        let track = Track::ordered(Pose::new(DVec3::ZERO, q), Order::End(Pose::new(DVec3::X, q)));
        assert_eq!(track.motion.spin, DVec3::ZERO);
        assert!(!track.is_rest());
    }
}
