//! The 64-byte record by which a client moves one object over a step.
//!
//! Invariant: a record that decodes holds finite numbers and a unit quaternion. It does not promise that the object
//! exists: that is the session's to know.

use crate::pose::check_position;
use crate::{ErrorCode, Pose};
use glam::{DQuat, DVec3};
use iceoryx2::prelude::ZeroCopySend;

/// Position and rotation are the pose at the end of the step, reached the shortest way.
pub const END: u32 = 1;
/// Position is where the origin ends, rotation[0..3] the rotation vector over the step (world axes, radians).
pub const TURN: u32 = 2;
/// The pose is set before the step starts, without motion. May stand beside an END or TURN of the same object.
pub const START: u32 = 4;

/// How far the squared norm of a quaternion may be off 1; such are normalised, others refused.
pub const QUATERNION_TOLERANCE: f64 = 1e-3;

/// A quaternion whose squared norm, as it is computed, is this near to 1 is unit and kept as it is: its norm is right to four units
/// in the last place (3, and one for the sum of squares). What normalising leaves is less, so that a quaternion is normalised
/// once at most, however many hands it goes through.
pub const UNIT_TOLERANCE: f64 = 6.0 * f64::EPSILON;

/// One object's motion, as it lies in shared memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct PoseRecord {
    /// Object id of the session.
    pub object: u32,
    /// Exactly one of [`END`], [`TURN`], [`START`].
    pub flags: u32,
    /// Position x, y, z of the object's origin in the world.
    pub position: [f64; 3],
    /// Quaternion x, y, z, w; for [`TURN`] the rotation vector and a zero.
    pub rotation: [f64; 4],
}

const _: () = assert!(size_of::<PoseRecord>() == 64 && align_of::<PoseRecord>() == 8);
const _: () = assert!(std::mem::offset_of!(PoseRecord, position) == 8);
const _: () = assert!(std::mem::offset_of!(PoseRecord, rotation) == 32);

/// What a valid record asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PoseCommand {
    /// Set the pose before the step.
    Start(Pose),
    /// Move to this pose the shortest way.
    End(Pose),
    /// Move the origin there, turning by a rotation vector.
    Turn(DVec3, DVec3),
}

impl PoseRecord {
    /// The object moves to `pose` the shortest way.
    pub fn end(object: u32, pose: &Pose) -> Self {
        Self::of_pose(object, END, pose)
    }

    /// True for a record that says where its object moves to, the shortest way.
    pub fn is_end(&self) -> bool {
        self.flags == END
    }

    /// The object is put at `pose` before the step.
    pub fn start(object: u32, pose: &Pose) -> Self {
        Self::of_pose(object, START, pose)
    }

    /// The object's origin moves to `position` while it turns by `rotation_vector` (world axes, radians).
    pub fn turn(object: u32, position: DVec3, rotation_vector: DVec3) -> Self {
        let [x, y, z] = rotation_vector.to_array();
        Self { object, flags: TURN, position: position.to_array(), rotation: [x, y, z, 0.0] }
    }

    fn of_pose(object: u32, flags: u32, pose: &Pose) -> Self {
        Self { object, flags, position: pose.position.to_array(), rotation: pose.rotation.to_array() }
    }

    /// True for a record that puts its object somewhere before the step.
    #[inline]
    pub fn is_start(&self) -> bool {
        self.flags == START
    }

    /// Its position.
    #[inline]
    pub fn position(&self) -> DVec3 {
        DVec3::from_array(self.position)
    }

    /// Its pose; of a [`TURN`] no pose.
    #[inline]
    pub fn pose(&self) -> Pose {
        Pose::new(self.position(), DQuat::from_array(self.rotation))
    }

    /// The rotation vector of a [`TURN`].
    #[inline]
    pub fn rotation_vector(&self) -> DVec3 {
        let [x, y, z, _] = self.rotation;
        DVec3::new(x, y, z)
    }

    /// Checks the numbers of a record, a copy where it lies in shared memory, and makes its quaternion unit.
    ///
    /// # Errors
    /// As `decode`; the record is as it was.
    #[inline]
    pub fn check(&mut self) -> Result<(), ErrorCode> {
        // Most records, checked once: numbers whose squares add up to 1 are finite, and such a quaternion is kept as it is.
        let pose = self.pose();
        let is_kept = is_unit(pose.rotation, UNIT_TOLERANCE) && check_position(pose.position).is_ok();
        if is_kept && (self.flags == END || self.flags == START) { Ok(()) } else { self.check_any() }
    }

    /// Checks any record, in the order in which its errors are told.
    #[inline(never)]
    fn check_any(&mut self) -> Result<(), ErrorCode> {
        check_position(self.position())?;
        if self.rotation.iter().any(|c| !c.is_finite()) {
            return Err(ErrorCode::NotFinite);
        }
        match self.flags {
            TURN => {
                if !self.rotation_vector().length_squared().is_finite() {
                    return Err(ErrorCode::NotFinite);
                }
                // A quaternion by mistake: its w would be dropped in silence.
                if self.rotation[3] != 0.0 {
                    return Err(ErrorCode::BadCount);
                }
            }
            END | START => self.rotation = unit_quaternion(self.rotation)?.to_array(),
            _ => return Err(ErrorCode::BadCount),
        }
        Ok(())
    }

    /// What a record asks for (pass a copy when it lies in shared memory), once its numbers are checked.
    ///
    /// # Errors
    /// `BadCount` for flags out of the protocol and for a [`TURN`] whose last number is not 0, `NotFinite` (of a
    /// position also beyond [`FARTHEST`](crate::pose::FARTHEST)), `BadQuaternion`.
    pub fn decode(&self) -> Result<PoseCommand, ErrorCode> {
        let mut checked = *self;
        checked.check()?;
        Ok(match self.flags {
            END => PoseCommand::End(checked.pose()),
            START => PoseCommand::Start(checked.pose()),
            _ => PoseCommand::Turn(checked.position(), checked.rotation_vector()),
        })
    }
}

/// True when the squared norm of a quaternion is this near to 1; false for what is not finite.
#[inline]
fn is_unit(q: DQuat, tolerance: f64) -> bool {
    (q.length_squared() - 1.0).abs() <= tolerance
}

/// A quaternion x, y, z, w normalised, if its squared norm is within [`QUATERNION_TOLERANCE`] of 1; to the bit as it is, if that
/// is within [`UNIT_TOLERANCE`] of 1. What it returns it returns again.
///
/// # Errors
/// `NotFinite`, `BadQuaternion`.
pub fn unit_quaternion(q: [f64; 4]) -> Result<DQuat, ErrorCode> {
    let q = DQuat::from_array(q);
    if !q.is_finite() {
        return Err(ErrorCode::NotFinite);
    }
    if !is_unit(q, QUATERNION_TOLERANCE) {
        return Err(ErrorCode::BadQuaternion);
    }
    if is_unit(q, UNIT_TOLERANCE) {
        return Ok(q);
    }
    let unit = q.normalize();
    // Rounding at its very worst may leave a little more.
    Ok(if is_unit(unit, UNIT_TOLERANCE) { unit } else { unit.normalize() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_numbers_are_refused_by_name() {
        let good = PoseRecord::end(1, &Pose::at(DVec3::X));
        assert!(good.decode().is_ok());
        let table = [
            (PoseRecord { position: [f64::NAN, 0.0, 0.0], ..good }, ErrorCode::NotFinite),
            (PoseRecord { position: [0.0, f64::INFINITY, 0.0], ..good }, ErrorCode::NotFinite),
            (PoseRecord { position: [0.0, 0.0, -2e150], ..good }, ErrorCode::NotFinite),
            (PoseRecord { flags: START, position: [1e200, 0.0, 0.0], ..good }, ErrorCode::NotFinite),
            (PoseRecord { rotation: [f64::NAN, 0.0, 0.0, 1.0], ..good }, ErrorCode::NotFinite),
            (PoseRecord { rotation: [0.0; 4], ..good }, ErrorCode::BadQuaternion),
            (PoseRecord { rotation: [0.0, 0.0, 0.0, 1.001], ..good }, ErrorCode::BadQuaternion),
            (PoseRecord { flags: 0, ..good }, ErrorCode::BadCount),
            (PoseRecord { flags: END | START, ..good }, ErrorCode::BadCount),
            (PoseRecord { flags: TURN, rotation: [1e200; 4], ..good }, ErrorCode::NotFinite),
            (PoseRecord { flags: TURN, ..good }, ErrorCode::BadCount),
        ];
        for (record, code) in table {
            assert_eq!(record.decode(), Err(code), "{record:?}");
        }
    }

    #[test]
    fn a_quaternion_is_normalised_once() {
        let mut state = 1u64;
        let mut number = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let mut changed = 0;
        for _ in 0..20_000 {
            let q = DQuat::from_xyzw(number(), number(), number(), number()).normalize();
            let rough = q * (1.0 + 4e-4 * number());
            for given in [q, rough] {
                let once = unit_quaternion(given.to_array()).unwrap();
                let bits = |q: DQuat| q.to_array().map(f64::to_bits);
                assert_eq!(bits(unit_quaternion(once.to_array()).unwrap()), bits(once), "{given}");
                assert!((once.length() - 1.0).abs() <= 4.0 * f64::EPSILON);
                changed += usize::from(bits(once) != bits(given));
            }
            // What is unit already is kept.
            assert_eq!(unit_quaternion(q.to_array()), Ok(q));
        }
        assert!(changed > 19_000);
    }

    #[test]
    fn a_rough_quaternion_is_normalised() {
        let rough = PoseRecord { rotation: [0.0, 0.0, 0.0, 1.0004], ..PoseRecord::end(1, &Pose::IDENTITY) };
        assert_eq!(rough.decode(), Ok(PoseCommand::End(Pose::IDENTITY)));
    }
}
