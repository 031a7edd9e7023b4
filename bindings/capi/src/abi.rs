//! The plain structures of this interface beside the wire records of `proto`, which are exported as they are.

use contactd_client::transport::Opened as Session;
use contactd_proto::control::WirePose;
use contactd_proto::rule::RuleNumbers;
use contactd_proto::{ContactRecord, ErrorCode, StepReply};
use std::ffi::c_char;

/// A rigid placement: `parent = rotation * local + position`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Pose {
    /// Position x, y, z.
    pub position: [f64; 3],
    /// Unit quaternion x, y, z, w.
    pub rotation: [f64; 4],
}

impl Pose {
    /// The frame that coincides with its parent.
    pub const IDENTITY: Self = Self { position: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };

    /// The pose, if its numbers are finite and its quaternion is of unit length.
    pub(crate) fn checked(&self) -> Result<contactd_proto::Pose, ErrorCode> {
        WirePose { position: self.position, rotation: self.rotation }.checked()
    }
}

/// What the server said when it opened the session.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Opened {
    /// Session id.
    pub session: u64,
    /// Epoch of the server; changes with its every start.
    pub epoch: u64,
    /// Most records in a batch.
    pub max_batch: u32,
    /// Zero.
    pub reserved: u32,
}

impl From<Session> for Opened {
    fn from(o: Session) -> Self {
        Self { session: o.session, epoch: o.epoch, max_batch: o.max_batch, reserved: 0 }
    }
}

/// A value of a joint.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct JointValue {
    /// The joint's name.
    pub name: *const c_char,
    /// Radians of what turns, metres of what slides.
    pub value: f64,
}

/// How a scene is loaded. contactd_scene_options_new sets the defaults.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct SceneOptions {
    /// Where a robot's joints stand; of others what the file says. NULL for none.
    pub joints: *const JointValue,
    /// Number of them.
    pub joint_count: usize,
    /// The keyframe that joints begin at, of MJCF; NULL for none.
    pub key: *const c_char,
    /// Folders in which packages are looked for (package://NAME/…, model://NAME/…), before the file's own and those above it.
    pub packages: *const *const c_char,
    /// Number of them.
    pub package_count: usize,
    /// An SRDF file with pairs that are not to be tested; NULL for none.
    pub srdf: *const c_char,
    /// The folder that texts may import files from; NULL: each from its own.
    pub import_root: *const c_char,
    /// 1: meshes are taken as their convex hulls, as MuJoCo does anyway.
    pub hulls: u32,
    /// 1: the session's rules and resolution stay as they are.
    pub keeps_rules: u32,
}

/// What a loaded scene has in it. Strings are valid until the scene is freed.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct SceneInfo {
    /// The unit of length; may be empty.
    pub unit: *const c_char,
    /// Duration of the step in seconds that a scene file says; 0 for none.
    pub dt: f64,
    /// Number of its objects.
    pub object_count: usize,
    /// Number of its joints that have values of their own.
    pub joint_count: usize,
    /// Number of its notes.
    pub note_count: usize,
}

/// An object of a loaded scene.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct LoadedObject {
    /// Its name, valid until the scene is freed.
    pub name: *const c_char,
    /// Its id in the session.
    pub object: u32,
    /// The id of its model.
    pub model: u32,
}

/// A joint of a robot that has a value of its own.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Joint {
    /// Its name, valid until the scene is freed.
    pub name: *const c_char,
    /// 1: it turns, and its value is an angle in radians; 0: it slides, metres.
    pub turns: u32,
    /// Zero.
    pub reserved: u32,
    /// Its lower limit; infinite where it has none.
    pub low: f64,
    /// Its upper limit.
    pub high: f64,
    /// Where it stands.
    pub value: f64,
}

/// What was recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Recording {
    /// Steps that stand in the file, or are on their way to it.
    pub steps: u64,
    /// Steps that were left out because the recorder could not keep up.
    pub dropped: u64,
    /// Steps that stand in it without a picture, for the same reason.
    pub without_picture: u64,
    /// Bytes written.
    pub bytes: u64,
}

/// A face of a model. Its strings are valid until the session is closed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Face {
    /// Index of its primitive in file order.
    pub primitive: u32,
    /// 1: the primitive is subtracted.
    pub subtracted: u32,
    /// The primitive's name in the format: "sphere", "cylinder" …
    pub name: *const c_char,
    /// The face's name: "side", "top" …
    pub face: *const c_char,
}

/// Volume, centre of mass and inertia of a solid of even density. Every true value lies within its error of the one given.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Mass {
    /// Volume, length³.
    pub volume: f64,
    /// Bound of its error, length³.
    pub volume_error: f64,
    /// Centre of mass.
    pub center: [f64; 3],
    /// Bounds of its error, a length along each axis.
    pub center_error: [f64; 3],
    /// Mass per volume; 1 unless contactd_mass_with_density changed it.
    pub density: f64,
    /// Inertia tensor about the centre of mass: xx, yy, zz, xy, xz, yz (xx = ∫ y² + z² dm, xy = −∫ x y dm), density · length⁵.
    pub inertia: [f64; 6],
    /// Bounds of its error, in the same order and unit.
    pub inertia_error: [f64; 6],
    /// Boxes that were looked at; 0 where a closed formula answers.
    pub boxes: u64,
}

/// What is asked of points; contactd_point_query_new sets the defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct PointQuery {
    /// Points no farther from the surface than this are on it, a length >= 0; 1e-9.
    pub surface: f64,
    /// How far apart the bounds may be, a length; infinite: the side is enough; 1e-6.
    pub tolerance: f64,
    /// Most parts of a solid that may be looked at for a point; 200,000.
    pub limit: u64,
    /// Ids of the objects that are asked, NULL for all.
    pub objects: *const u32,
    /// How many.
    pub object_count: usize,
}

/// What is asked of rays; contactd_ray_query_new sets the defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct RayQuery {
    /// A ray that comes no deeper than this into a solid passes it: a length >= 0; 0, which is raised to what rounding needs.
    pub depth: f64,
    /// Most stretches that may be looked at for a ray and an object; 200,000.
    pub limit: u64,
    /// Ids of the objects that are asked, NULL for all.
    pub objects: *const u32,
    /// How many.
    pub object_count: usize,
}

/// How far apart two objects are.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Distance {
    /// Proven: no two points of them are nearer to each other.
    pub lower: f64,
    /// Proven: two points of them are no farther apart; 0 where they share one, infinite where none were found.
    pub upper: f64,
    /// A point of the first object, as far from that of the second one as `upper` but for rounding; NaN where none was found.
    pub point_a: [f64; 3],
    /// A point of the second object.
    pub point_b: [f64; 3],
    /// Pairs of parts that were looked at.
    pub cells: u64,
    /// 1 when the bounds are as near to each other as was asked, or as rounding lets them be.
    pub settled: u32,
    /// Zero.
    pub reserved: u32,
}

/// Two names.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Names {
    /// The first one.
    pub a: *const c_char,
    /// The second one.
    pub b: *const c_char,
}

/// An object to be added: a model, where it stands, and what is declared of it. contactd_object_new sets the defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Object {
    /// Its name, for the exceptions of rules.
    pub name: *const c_char,
    /// Its group, for rules.
    pub group: *const c_char,
    /// Its model's id.
    pub model: u32,
    /// 1: it never moves.
    pub is_static: u32,
    /// 0: it never turns; a motion that turns it will be refused.
    pub rotates: u32,
    /// Zero.
    pub reserved: u32,
    /// No point of it is ever faster than this, length per second; steps then need `dt`. Infinite: nothing is declared.
    pub max_speed: f64,
    /// Where the model sits in the object's frame.
    pub place: Pose,
    /// Where the object stands.
    pub pose: Pose,
}

/// What happens between two groups of objects. contactd_rule_new sets the defaults.
///
/// cbindgen:ignore
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Rule {
    /// The two groups; both may be the same.
    pub between: Names,
    /// Single pairs, by object name, that this rule leaves out; NULL when there are none.
    pub except: *const Names,
    /// Number of them.
    pub except_count: usize,
    /// What it asks for. In the header its fields stand here one by one: tests/header.rs makes that structure of the table of rules.
    pub effects: RuleNumbers,
}

/// What is asked of the steps to come. Stays as it is set, but for `advance`, which each accepted step puts back to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Options {
    /// Fraction 0..1 of its previous step at which every object stands before the next one.
    pub advance: f64,
    /// Duration of a step in seconds, for objects with a declared largest speed; 0: unknown.
    pub dt: f64,
    /// 1: only the pairs whose bracket meets the scene's earliest contact.
    pub first: u32,
    /// 1: a detail slot with each record (contactd_get_detail).
    pub details: u32,
    /// 1: records of clear pairs too.
    pub clear: u32,
    /// 1: this client polls while it waits; the server then need not wake it.
    pub polling: u32,
    /// Most records, the earliest first; 0: all.
    pub max_records: u32,
    /// Most cells that one pair's search may refine; 0: the server's default.
    pub cell_limit: u32,
    /// Most cells that all searches of a step may refine together; 0: the server's default. Pairs that would need more stay
    /// undecided, the latest first.
    pub batch_limit: u32,
    /// Zero.
    pub reserved: u32,
}

/// The answer to a step. The header is a copy; records and slots are read in place and valid until the session's next
/// contactd_begin_step, contactd_resend, contactd_reconnect or contactd_close.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Reply {
    /// Status, safe time, effects, work.
    pub header: StepReply,
    /// The contact records in the order (time, a, b).
    pub records: *const ContactRecord,
    /// Number of them.
    pub record_count: usize,
    /// All slots as they lie in memory: the records, then their further slots.
    pub slots: *const ContactRecord,
    /// Number of them.
    pub slot_count: usize,
}

impl Reply {
    /// What a session has received.
    pub(crate) fn of(reply: &contactd_client::Reply<'_>) -> Self {
        let (records, slots) = (reply.records(), reply.slots());
        Self {
            header: *reply.header(),
            records: records.as_ptr(),
            record_count: records.len(),
            slots: slots.as_ptr(),
            slot_count: slots.len(),
        }
    }
}
