//! Where an object stands between steps: its last accepted motion and the pose that motion ended at.
//!
//! The server and the client's journal run the same arithmetic on it, so a replayed session continues bit for bit.
//! The end is kept as it was given: it is not recomputed from the motion, so that nothing creeps over many steps.

use crate::motion::spin_between;
use crate::pose_record::PoseCommand;
use crate::{Motion, Pose, PoseRecord};
use glam::DVec3;
use std::collections::BTreeMap;

/// An object's last accepted motion and where it ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionState {
    /// Motion over the last accepted step.
    pub motion: Motion,
    /// Pose at its end.
    pub end: Pose,
}

impl MotionState {
    /// An object that was put at `pose`.
    #[inline]
    pub fn resting(pose: Pose) -> Self {
        Self { motion: Motion::resting(pose), end: pose }
    }

    /// The pose from which the next step starts when `advance` (0..1) of the last one is taken.
    #[inline]
    pub fn at(&self, advance: f64) -> Pose {
        if advance == 1.0 { self.end } else { self.motion.at(advance) }
    }

    /// The track of the next step, of an object that stands at `start`.
    pub fn ordered(start: Pose, command: PoseCommand) -> Self {
        let mut state = Self::resting(start);
        match command {
            PoseCommand::Start(pose) => state.put(pose),
            PoseCommand::End(end) => state.go(start, end),
            PoseCommand::Turn(position, vector) => state.turn(start, position, vector),
        }
        state
    }

    /// In place: the object rests at `pose`.
    #[inline]
    pub fn put(&mut self, pose: Pose) {
        (self.motion.start, self.end) = (pose, pose);
        (self.motion.velocity, self.motion.spin) = (DVec3::ZERO, DVec3::ZERO);
    }

    /// In place: the object goes from `start` to `end` the shortest way.
    #[inline]
    pub fn go(&mut self, start: Pose, end: Pose) {
        (self.motion.start, self.end) = (start, end);
        self.motion.velocity = end.position - start.position;
        // Equal rotations mean no rotation, whatever the last bit of their product says.
        let turns = end.rotation != start.rotation;
        self.motion.spin = if turns { spin_between(start.rotation, end.rotation) } else { DVec3::ZERO };
    }

    /// In place: the object's origin goes from `start` to `position` while it turns by a rotation vector.
    pub fn turn(&mut self, start: Pose, position: DVec3, vector: DVec3) {
        self.motion = Motion::turning(start, position, vector);
        self.end = Pose::new(position, self.motion.at(1.0).rotation);
    }

    /// True when the object did not move, not even by a last bit of its pose: what did comes to rest at its end.
    #[inline]
    pub fn is_rest(&self) -> bool {
        self.motion.is_rest() && same_bits(&self.motion.start, &self.end)
    }
}

/// Where the objects of a session stand, followed from accepted step to accepted step by whoever does not search them.
#[derive(Clone, Debug, Default)]
pub struct Tracks {
    objects: BTreeMap<u32, MotionState>,
    /// Objects that are not at rest; may name removed ones.
    moving: Vec<u32>,
}

impl Tracks {
    /// An object that came, or that was put on another track.
    pub fn put(&mut self, id: u32, motion_state: MotionState) {
        if !motion_state.is_rest() {
            self.moving.push(id);
        }
        self.objects.insert(id, motion_state);
    }

    /// An object that went.
    pub fn removed(&mut self, id: u32) {
        self.objects.remove(&id);
    }

    /// An object's last motion.
    pub fn get(&self, id: u32) -> Option<&MotionState> {
        self.objects.get(&id)
    }

    /// All objects by their ids.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &MotionState)> {
        self.objects.iter().map(|(id, motion_state)| (*id, motion_state))
    }

    /// Takes an accepted batch, `advance` of the step before it.
    pub fn take(&mut self, records: &[PoseRecord], advance: f64) {
        for id in self.moving.drain(..) {
            if let Some(motion_state) = self.objects.get_mut(&id) {
                *motion_state = MotionState::resting(motion_state.at(advance));
            }
        }
        // Starts come before motions, wherever they stand in the batch.
        for starts in [true, false] {
            for record in records {
                let (Ok(command), Some(motion_state)) = (record.decode(), self.objects.get_mut(&record.object)) else {
                    continue;
                };
                if matches!(command, PoseCommand::Start(_)) == starts {
                    *motion_state = MotionState::ordered(motion_state.end, command);
                    if !motion_state.is_rest() {
                        self.moving.push(record.object);
                    }
                }
            }
        }
    }
}

/// True for poses that are one to the bit; zeros of either sign are two.
#[inline]
fn same_bits(a: &Pose, b: &Pose) -> bool {
    let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
    same(&a.position.to_array(), &b.position.to_array()) && same(&a.rotation.to_array(), &b.rotation.to_array())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::quat_of_rotation_vector;

    #[test]
    fn an_end_is_kept_to_the_last_bit() {
        let start = Pose::new(DVec3::new(0.1, 0.7, 1e3), quat_of_rotation_vector(DVec3::new(0.1, 0.2, 0.3)));
        let end = Pose::new(DVec3::new(1.0 / 3.0, 1e-9, 7.0), quat_of_rotation_vector(DVec3::new(2.0, -0.2, 0.3)));
        assert_eq!(MotionState::ordered(start, PoseCommand::End(end)).at(1.0), end);
        assert_eq!(MotionState::ordered(start, PoseCommand::End(end)).at(0.0).position, start.position);
    }

    #[test]
    fn an_end_that_is_another_pose_by_a_bit_alone_is_no_rest() {
        let q = quat_of_rotation_vector(DVec3::new(0.4, -1.1, 2.0));
        let start = Pose::new(DVec3::new(1.0, 0.0, -2.0), q);
        assert!(MotionState::ordered(start, PoseCommand::End(start)).is_rest());
        let other = glam::DQuat::from_xyzw(f64::from_bits(q.x.to_bits() + 1), q.y, q.z, q.w);
        for end in
            [Pose::new(start.position, other), Pose::new(DVec3::new(1.0, -0.0, -2.0), q), Pose::new(start.position, -q)]
        {
            let motion_state = MotionState::ordered(start, PoseCommand::End(end));
            assert!(!motion_state.is_rest(), "{end:?}");
            let next = motion_state.at(1.0);
            assert_eq!(next.rotation.to_array().map(f64::to_bits), end.rotation.to_array().map(f64::to_bits));
            assert_eq!(next.position.to_array().map(f64::to_bits), end.position.to_array().map(f64::to_bits));
        }
    }

    #[test]
    fn what_does_not_turn_keeps_its_rotation_at_any_part_of_a_step() {
        let q = quat_of_rotation_vector(DVec3::new(0.4, -1.1, 2.0));
        let off = glam::DQuat::from_xyzw(f64::from_bits(q.x.to_bits() + 2), q.y, q.z, q.w);
        for q in [q, off] {
            assert_eq!(MotionState::resting(Pose::new(DVec3::X, q)).at(0.3).rotation, q);
        }
    }

    #[test]
    fn equal_rotations_do_not_turn() {
        let q = quat_of_rotation_vector(DVec3::new(0.4, -1.1, 2.0));
        let motion_state = MotionState::ordered(Pose::new(DVec3::ZERO, q), PoseCommand::End(Pose::new(DVec3::X, q)));
        assert_eq!(motion_state.motion.spin, DVec3::ZERO);
        assert!(!motion_state.is_rest());
    }
}
