//! What the server and its clients agree on: poses, motions, wire records, service names and error codes.
//!
//! Conventions: lengths in the models' unit, time within a step as a fraction 0..1, right-handed axes, `f64`
//! everywhere, quaternions `x y z w`, rotations active (`world = pose.point(local)`).
//!
//! ```
//! use contactd_proto::glam::{DQuat, DVec3};
//! use contactd_proto::{Motion, Pose, PoseRecord};
//!
//! // A quarter turn about z while it goes one along x; half way it has done half of either.
//! let end = Pose::new(DVec3::X, DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2));
//! let motion = Motion::between(Pose::IDENTITY, end);
//! let tip = motion.at(0.5).point(DVec3::new(2.0, 0.0, 0.0));
//! assert!((tip - DVec3::new(0.5 + 2f64.sqrt(), 2f64.sqrt(), 0.0)).length() < 1e-12);
//! // What a client writes into shared memory for it: 64 bytes.
//! assert_eq!(size_of_val(&PoseRecord::end(1, &end)), 64);
//! ```
//!
//! Everything that lies in shared memory is `repr(C)`, free of padding, enums and booleans, with its size asserted at
//! compile time. Every field is written and read by its owner once; a reader copies what it branches on.
#![forbid(unsafe_code)]

pub mod contact_record;
pub mod control;
pub mod effects;
pub mod error;
pub mod mass;
pub mod motion;
pub mod motion_state;
pub mod names;
pub mod pose;
pub mod pose_record;
pub mod query;
pub mod rule;
pub mod status;
pub mod step;

pub use contact_record::{ClearanceSlot, ContactRecord, DetailSlot, PatchSlot, RegionSlot};
pub use effects::EffectCounters;
pub use error::ErrorCode;
pub use glam;
pub use mass::{MassOptions, MassProperties};
pub use motion::Motion;
pub use motion_state::{MotionState, Tracks};
pub use pose::Pose;
pub use pose_record::PoseRecord;
pub use rule::{Detect, Effects, InitialOverlap, Report, Rule};
pub use step::{StepReply, StepRequest};
