//! Commands and answers of the control service. The only file that names bincode.
//!
//! Both sides bound what they decode by [`DECODE_LIMIT`], so a forged length cannot make them allocate.

use crate::query::{Query, QueryAnswer};
use crate::rule::{Effects, Setting};
use crate::{ErrorCode, MassProperties, Motion, MotionState, Pose, Rule};
use bincode::{Decode, Encode, config};
use glam::DVec3;
use iceoryx2::prelude::ZeroCopySend;

/// Most bytes that an encoded command or answer may have.
pub const DECODE_LIMIT: usize = 80 << 20;

/// A rule in bytes: its settings in the order of their table.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct WireRule {
    between: [String; 2],
    except: Vec<[String; 2]>,
    settings: Vec<WireSetting>,
}

/// What a field of a rule holds; a word by its code.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
enum WireSetting {
    Word(u32),
    Flag(bool),
    Length(f64),
}

impl From<&Rule> for WireRule {
    fn from(r: &Rule) -> Self {
        let effects = r.effects();
        let settings = Effects::FIELDS.iter().map(|field| match field.get(&effects) {
            Setting::Word(code) => WireSetting::Word(code),
            Setting::Flag(on) => WireSetting::Flag(on),
            Setting::Length(length) => WireSetting::Length(length),
        });
        Self { between: r.between.clone(), except: r.except.clone(), settings: settings.collect() }
    }
}

impl WireRule {
    /// The rule.
    ///
    /// # Errors
    /// `BadRule` for settings that are not those of the table, in its order.
    pub fn checked(self) -> Result<Rule, ErrorCode> {
        if self.settings.len() != Effects::FIELDS.len() {
            return Err(ErrorCode::BadRule);
        }
        let mut effects = Effects::DEFAULT;
        for (field, setting) in Effects::FIELDS.iter().zip(self.settings) {
            let setting = match setting {
                WireSetting::Word(code) => Setting::Word(code),
                WireSetting::Flag(on) => Setting::Flag(on),
                WireSetting::Length(length) => Setting::Length(length),
            };
            if !field.set(&mut effects, setting) {
                return Err(ErrorCode::BadRule);
            }
        }
        Ok(Rule { except: self.except, ..Rule::asking(self.between, effects) })
    }
}

/// How curved primitives of a model are taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Encode, Decode)]
pub enum Facets {
    /// Exact when `$fn` is 0 or at least 9, as written below that.
    #[default]
    Auto,
    /// Always exact.
    Exact,
    /// Always the prism or polyhedron that `$fn` asks for.
    AsWritten,
}

/// An object to be added to a session. Rotations are unit quaternions x, y, z, w.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct ObjectSpec {
    /// Its id, larger than every id the session has seen.
    pub id: u32,
    /// Its model's id.
    pub model: u32,
    /// Its name, for the exceptions of rules.
    pub name: String,
    /// Its group, for rules.
    pub group: String,
    /// It never moves.
    pub is_static: bool,
    /// It may turn.
    pub rotates: bool,
    /// Largest speed of any of its points, length per second; infinite when nothing is declared.
    pub max_speed: f64,
    /// The model in the object's frame.
    pub place: WirePose,
    /// The object's pose before its first step.
    pub pose: WirePose,
}

/// A pose in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct WirePose {
    /// Position x, y, z.
    pub position: [f64; 3],
    /// Quaternion x, y, z, w.
    pub rotation: [f64; 4],
}

impl From<Pose> for WirePose {
    fn from(p: Pose) -> Self {
        Self { position: p.position.to_array(), rotation: p.rotation.to_array() }
    }
}

impl WirePose {
    /// The pose, its quaternion as in a [`PoseRecord`](crate::PoseRecord): to the bit as it is where it is unit, normalised where it
    /// is nearly so. A pose that was accepted once comes back with the same bits.
    ///
    /// # Errors
    /// `NotFinite`, `BadQuaternion`.
    pub fn checked(&self) -> Result<Pose, ErrorCode> {
        let position = DVec3::from_array(self.position);
        crate::pose::check_position(position)?;
        Ok(Pose::new(position, crate::pose_record::unit_quaternion(self.rotation)?))
    }
}

/// Another frame of an object, and where that stands. A motion is one of the frame: its origin goes straight while it turns, so
/// that an object which is to turn about an axis needs a frame on that axis.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct WireFrame {
    /// Object id.
    pub object: u32,
    /// The model in the frame.
    pub place: WirePose,
    /// The frame in the world, where the object rests.
    pub pose: WirePose,
}

/// An object's track in bytes, for the replay after a restart of the server.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct WireTrack {
    /// Object id.
    pub object: u32,
    /// Pose before its last accepted step.
    pub start: WirePose,
    /// Displacement over that step.
    pub velocity: [f64; 3],
    /// Rotation vector over that step.
    pub spin: [f64; 3],
    /// Pose after it.
    pub end: WirePose,
}

impl WireFrame {
    /// The model in the frame, and the frame.
    ///
    /// # Errors
    /// `NotFinite`, `BadQuaternion`.
    pub fn checked(&self) -> Result<(Pose, Pose), ErrorCode> {
        Ok((self.place.checked()?, self.pose.checked()?))
    }
}

impl WireTrack {
    /// Packs a track.
    pub fn of(object: u32, motion_state: &MotionState) -> Self {
        Self {
            object,
            start: motion_state.motion.start.into(),
            velocity: motion_state.motion.velocity.to_array(),
            spin: motion_state.motion.spin.to_array(),
            end: motion_state.end.into(),
        }
    }

    /// Unpacks a track.
    ///
    /// # Errors
    /// `NotFinite`, `BadQuaternion`.
    pub fn checked(&self) -> Result<MotionState, ErrorCode> {
        let velocity = DVec3::from_array(self.velocity);
        let spin = DVec3::from_array(self.spin);
        if !velocity.is_finite() || !spin.length_squared().is_finite() {
            return Err(ErrorCode::NotFinite);
        }
        let motion = Motion { start: self.start.checked()?, velocity, spin };
        Ok(MotionState { motion, end: self.end.checked()? })
    }
}

/// Mass properties in bytes, of density 1.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct WireMass {
    volume: [f64; 2],
    center: [[f64; 3]; 2],
    inertia: [[f64; 6]; 2],
    boxes: u64,
}

impl From<&MassProperties> for WireMass {
    fn from(m: &MassProperties) -> Self {
        Self {
            volume: [m.volume, m.volume_error],
            center: [m.center.to_array(), m.center_error.to_array()],
            inertia: [m.inertia, m.inertia_error],
            boxes: m.boxes,
        }
    }
}

impl From<&WireMass> for MassProperties {
    fn from(m: &WireMass) -> Self {
        let [center, center_error] = m.center.map(DVec3::from_array);
        let ([volume, volume_error], [inertia, inertia_error]) = (m.volume, m.inertia);
        Self { volume, volume_error, center, center_error, density: 1.0, inertia, inertia_error, boxes: m.boxes }
    }
}

/// A model as a file has it.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct ModelFile {
    /// Its name, for error sentences.
    pub name: String,
    /// What the bytes are: the name of a format that the server reads, such as "csg"; empty: as the name ends, "csg" where that says nothing.
    pub format: String,
    /// What the file has in it.
    pub bytes: Vec<u8>,
    /// The files that it names, sent with it; `None`: it may name those of the server's import root alone.
    pub attached: Option<Vec<Attachment>>,
}

impl ModelFile {
    /// A file that names no others of its own.
    pub fn new(name: impl Into<String>, format: impl Into<String>, bytes: impl Into<Vec<u8>>) -> Self {
        Self { name: name.into(), format: format.into(), bytes: bytes.into(), attached: None }
    }

    /// Its bytes and those of the files that are sent with it.
    pub fn size(&self) -> usize {
        let attached = self.attached.iter().flatten().filter_map(|a| a.bytes.as_ref().ok());
        self.bytes.len() + attached.map(Vec::len).sum::<usize>()
    }
}

/// A file that another one names, in memory.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Encode, Decode)]
pub struct Attachment {
    /// As the other one names it; of a font `font:` and the pattern that asks for it.
    pub name: String,
    /// What it has in it, or why it was not read.
    pub bytes: Result<Vec<u8>, String>,
}

impl Attachment {
    /// The name of what OpenSCAD warned of when it flattened the text: a line each.
    pub const WARNINGS: &'static str = "openscad:";
}

/// What a client asks of the server beside steps.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Command {
    /// Opens a session.
    Open {
        /// Protocol version of the client.
        version: u32,
        /// The client's process id, and when that process started (clock ticks since boot).
        process: (u32, u64),
    },
    /// Ends it.
    Close,
    /// Imports a model; other steps go on meanwhile.
    LoadModel {
        /// Its id, larger than every model id the session has seen.
        model: u32,
        /// What it is made of.
        file: ModelFile,
        /// How curved primitives are taken.
        facets: Facets,
    },
    /// Adds an object.
    AddObject(ObjectSpec),
    /// Removes an object; its id is not used again.
    RemoveObject(u32),
    /// Replaces the session's rules.
    SetRules(Vec<WireRule>),
    /// The resolution of every pair; `None`: each pair its default.
    SetResolution(Option<f64>),
    /// Puts objects on the tracks they had (replay).
    Restore(Vec<WireTrack>),
    /// Computes a model's mass properties; other sessions' steps go on meanwhile.
    MassProperties {
        /// The model's id.
        model: u32,
        /// As in [`MassOptions`](crate::MassOptions).
        tolerance: f64,
        /// As in [`MassOptions`](crate::MassOptions).
        boxes: u64,
    },
    /// What the server's sessions are and how its steps do; asked of no session.
    Status,
    /// Ends the session of this id, whoever's it is; asked of no session.
    EndSession(u64),
    /// Records steps into a new file: those of the session that asks; asked of no session, those that it names.
    Record(RecordingOrder),
    /// What was recorded by what [`Record`](Self::Record) began that was asked in the same way; and that it is to end.
    Recording {
        /// Ends it: the answer comes when the file is complete.
        stop: bool,
    },
    /// Writes the session's last step as a scene folder for `contactd check`. The folder is made; it does not exist before.
    SaveStep(String),
    /// Asks about objects where the last step has left them; other sessions' steps go on meanwhile.
    Ask(Query),
    /// Gives objects other frames: all of them, or none.
    Reframe(Vec<WireFrame>),
    /// Gives an object the frame of another one, where it stands: a motion of that frame then moves both as one body.
    Carry {
        /// The object that gets the frame.
        object: u32,
        /// The object whose frame it is.
        carrier: u32,
        /// The part of the last step, 0..1, that leaves both where they stand.
        advance: f64,
    },
}

/// What is to be recorded.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct RecordingOrder {
    /// The file, by its whole path; it does not exist before.
    pub path: String,
    /// Of no session: the session to be recorded, or all of them, those to come too.
    pub session: Option<u64>,
    /// Of no session: the process that asks, as in [`Command::Open`]. The recording ends with it.
    pub process: (u32, u64),
}

/// What was recorded so far.
#[derive(Clone, Debug, Default, PartialEq, Eq, Encode, Decode)]
pub struct RecordingStatus {
    /// The file.
    pub path: String,
    /// Steps that stand in it, or are on their way to it.
    pub steps: u64,
    /// Steps that were left out because the recorder could not keep up.
    pub dropped: u64,
    /// Steps that stand in it without a picture, for the same reason.
    pub without_picture: u64,
    /// Bytes written.
    pub bytes: u64,
    /// Why it has ended before its time; empty: it has not.
    pub failure: String,
}

/// One session as its server counts it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Encode, Decode)]
pub struct SessionStatus {
    /// Its id.
    pub id: u64,
    /// Its client's process id, as the client said it.
    pub process: u32,
    /// Milliseconds since it was opened.
    pub open_ms: u64,
    /// Milliseconds since its client asked something.
    pub idle_ms: u64,
    /// Its objects.
    pub objects: u32,
    /// Its models.
    pub models: u32,
    /// Its steps that were taken.
    pub steps: u64,
    /// Those of them that left a pair undecided.
    pub undecided: u64,
    /// A step, an import or an integral of it is under way.
    pub is_busy: bool,
}

/// The steps of about the last minute: from when the server takes a request to its reply.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Encode, Decode)]
pub struct LatestSteps {
    /// How many milliseconds these are: fewer than a minute's soon after the start.
    pub window_ms: u64,
    /// Steps taken within them.
    pub steps: u64,
    /// The time, in nanoseconds, within which half of them were answered, to 1 %.
    pub p50_ns: u64,
    /// The same for 99 of 100.
    pub p99_ns: u64,
    /// The same for 999 of 1000.
    pub p999_ns: u64,
    /// The longest.
    pub largest_ns: u64,
}

/// What a server says of itself when it is asked.
#[derive(Clone, Debug, Default, PartialEq, Eq, Encode, Decode)]
pub struct ServerStatus {
    /// Its process id.
    pub pid: u32,
    /// Milliseconds since its start.
    pub uptime_ms: u64,
    /// Its sessions, by id.
    pub sessions: Vec<SessionStatus>,
    /// Models in use, each counted once however many sessions have it.
    pub models: u32,
    /// Steps that were taken since the start.
    pub steps: u64,
    /// Those of them that left a pair undecided.
    pub undecided: u64,
    /// The steps of the last minute.
    pub latest: LatestSteps,
}

/// A face of a model, as the client may name it.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct FaceName {
    /// Index of its primitive in file order.
    pub primitive: u32,
    /// The primitive's name in the format: "sphere", "cylinder" …
    pub name: String,
    /// The face's name: "side", "top" …
    pub face: String,
    /// The primitive is subtracted.
    pub subtracted: bool,
}

/// The server's answer to a command.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Answer {
    /// A session is open.
    Opened {
        /// Its id.
        session: u64,
        /// Most records in a batch.
        max_batch: u32,
        /// How long its client should poll for a reply before it blocks, in nanoseconds.
        spin_ns: u64,
    },
    /// A model is loaded; its faces by id, and what the import had to say.
    Loaded {
        /// Face id → name.
        faces: Vec<FaceName>,
        /// What was snapped or dropped.
        warnings: Vec<String>,
    },
    /// Done.
    Done,
    /// Refused; nothing changed.
    Refused {
        /// Number of an error code.
        code: u32,
        /// Offending index within the command, or `u32::MAX`.
        index: u32,
        /// What exactly was wrong, when there is more to say than the code's sentence.
        detail: String,
    },
    /// A model's mass properties.
    Mass(WireMass),
    /// What the server says of itself.
    Status(ServerStatus),
    /// What was recorded.
    Recorded(RecordingStatus),
    /// What was asked.
    Told(QueryAnswer),
    /// The frame that an object was given.
    Reframed(WireFrame),
}

/// A command with its session (0 for `Open`).
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Envelope {
    /// Epoch of the server that opened the session; 0 for `Open`.
    pub epoch: u64,
    /// The session.
    pub session: u64,
    /// The command.
    pub command: Command,
}

/// Header of a control request and of its answer: the command's bytes follow as the payload.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct ControlHeader {
    /// Protocol version.
    pub version: u32,
    /// Zero.
    pub reserved: u32,
}

/// Bytes of a command or an answer.
///
/// # Errors
/// `LimitText` when they would be more than [`DECODE_LIMIT`].
pub fn encode<T: Encode>(value: &T) -> Result<Vec<u8>, ErrorCode> {
    let bytes = bincode::encode_to_vec(value, config::standard()).map_err(|_| ErrorCode::Internal)?;
    if bytes.len() > DECODE_LIMIT { Err(ErrorCode::LimitText) } else { Ok(bytes) }
}

/// A command or an answer from its bytes, all of them.
///
/// # Errors
/// `BadCommand` for anything that is not one.
pub fn decode<T: Decode<()>>(bytes: &[u8]) -> Result<T, ErrorCode> {
    let limited = config::standard().with_limit::<DECODE_LIMIT>();
    match bincode::decode_from_slice(bytes, limited) {
        Ok((value, used)) if used == bytes.len() => Ok(value),
        _ => Err(ErrorCode::BadCommand),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_come_back_and_damage_is_refused() {
        let rule = Rule { except: vec![["a".into(), "b".into()]], margin: 0.5, ..Rule::new(["x".into(), "y".into()]) };
        assert_eq!(WireRule::from(&rule).checked(), Ok(rule.clone()));
        let settings = WireRule::from(&rule).settings;
        let word = settings.iter().position(|s| matches!(s, WireSetting::Word(_))).unwrap();
        let spoilt = |change: &dyn Fn(&mut Vec<WireSetting>)| {
            let mut wire = WireRule::from(&rule);
            change(&mut wire.settings);
            wire.checked()
        };
        assert_eq!(spoilt(&|s| s.truncate(1)), Err(ErrorCode::BadRule));
        assert_eq!(spoilt(&|s| s[word] = WireSetting::Word(99)), Err(ErrorCode::BadRule));
        assert_eq!(spoilt(&|s| s[word] = WireSetting::Flag(true)), Err(ErrorCode::BadRule));
        let command = Envelope { epoch: 9, session: 3, command: Command::SetRules(vec![WireRule::from(&rule)]) };
        let bytes = encode(&command).unwrap();
        assert_eq!(decode::<Envelope>(&bytes), Ok(command));
        for cut in 0..bytes.len() {
            assert_eq!(decode::<Envelope>(&bytes[..cut]), Err(ErrorCode::BadCommand), "cut at {cut}");
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert_eq!(decode::<Envelope>(&longer), Err(ErrorCode::BadCommand));
    }

    #[test]
    fn a_forged_length_does_not_allocate() {
        // Envelope { 0, 0, LoadModel { 0, name: 2^60 bytes … } }
        let mut bytes = vec![0, 0, 2, 0, 253];
        bytes.extend((1u64 << 60).to_le_bytes());
        assert_eq!(decode::<Envelope>(&bytes), Err(ErrorCode::BadCommand));
    }
}
