//! What stands in a recording, message by message, and its bytes.
//!
//! Openings, changes and models are in bincode's standard configuration, as commands are on the wire. Steps are the wire's own
//! records, one after the other: what is copied once in a step is written as it is.

use super::content::{Content, Key};
use bincode::{Decode, Encode, config};
use contactd_proto::control::{Command, ObjectSpec, WireRule, WireTrack};
use contactd_proto::{ContactRecord, PoseRecord, StepReply, StepRequest};
use std::collections::BTreeMap;

/// The version of the format that is written and read.
pub const FORMAT: u32 = 1;

/// Topics of the channels.
#[allow(missing_docs)]
pub mod topic {
    pub const MODEL: &str = "/contactd/model";
    pub const OPENING: &str = "/contactd/opening";
    pub const CHANGE: &str = "/contactd/change";
    pub const STEP: &str = "/contactd/step";
    pub const SCENE: &str = "/scene";
    pub const TRANSFORMS: &str = "/tf";
}

/// Encodings of the messages.
pub mod encoding {
    /// bincode, standard configuration.
    pub const BINCODE: &str = "x-bincode";
    /// The wire's records.
    pub const STEP: &str = "x-contactd-step";
    /// JSON.
    pub const JSON: &str = "json";
}

/// The name of the metadata at the head of a file, and of those at its end.
pub const ABOUT: &str = "contactd";
/// The same at its end.
pub const END: &str = "contactd.end";

/// What the engine was that was recorded: its limits decide what it refuses and cuts off.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct About {
    /// Version of contactd.
    pub version: String,
    /// Objects of a session.
    pub objects: usize,
    /// Records of a batch.
    pub batch: usize,
    /// Slots of a reply.
    pub records: usize,
    /// Bytes of a model's file.
    pub text: usize,
    /// Nodes of a model's tree.
    pub nodes: usize,
    /// Depth of a model's tree.
    pub depth: usize,
    /// Faces of a model.
    pub faces: usize,
    /// Megabytes of a session's models.
    pub models_mb: u64,
}

impl About {
    /// As words.
    pub fn words(&self) -> BTreeMap<String, String> {
        let numbers = [
            ("format", u64::from(FORMAT)),
            ("objects", self.objects as u64),
            ("batch", self.batch as u64),
            ("records", self.records as u64),
            ("text", self.text as u64),
            ("nodes", self.nodes as u64),
            ("depth", self.depth as u64),
            ("faces", self.faces as u64),
            ("models_mb", self.models_mb),
        ];
        let words = numbers.map(|(name, number)| (name.to_owned(), number.to_string()));
        words.into_iter().chain([("version".to_owned(), self.version.clone())]).collect()
    }

    /// From words.
    ///
    /// # Errors
    /// Another format, or a word that is missing, in one sentence.
    pub fn of_words(words: &BTreeMap<String, String>) -> Result<Self, String> {
        let word =
            |name: &str| words.get(name).ok_or_else(|| format!("expected {name} in what the file says of itself"));
        let number = |name: &str| -> Result<u64, String> {
            let word = word(name)?;
            word.parse()
                .map_err(|_| format!("expected a number as {name} in what the file says of itself, found {word:?}"))
        };
        let size = |name: &str| number(name).map(|n| usize::try_from(n).unwrap_or(usize::MAX));
        let (format, version) = (number("format")?, word("version")?.clone());
        if format != u64::from(FORMAT) {
            return Err(format!(
                "expected a recording of format {FORMAT}, found format {format}, which contactd {version} has written: replay it with that"
            ));
        }
        Ok(Self {
            version,
            objects: size("objects")?,
            batch: size("batch")?,
            records: size("records")?,
            text: size("text")?,
            nodes: size("nodes")?,
            depth: size("depth")?,
            faces: size("faces")?,
            models_mb: number("models_mb")?,
        })
    }
}

/// A session as it stands before a step, from which it can be repeated without what came before.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode)]
pub struct Opening {
    /// Steps of the session that were left out right before.
    pub dropped: u64,
    /// Its models by id.
    pub models: Vec<(u32, Key)>,
    /// Its objects by id, as they were added.
    pub objects: Vec<ObjectSpec>,
    /// Their last motions.
    pub tracks: Vec<WireTrack>,
    /// Its rules.
    pub rules: Vec<WireRule>,
    /// Its resolution.
    pub resolution: Option<f64>,
}

/// What an accepted command has changed.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Change {
    /// A model was loaded.
    Model(u32, Key),
    /// Anything else.
    Command(Command),
}

/// A step: what was asked and what was told.
#[derive(Clone, Debug, Default)]
pub struct StepMessage {
    /// The session.
    pub session: u64,
    /// When it was answered, nanoseconds since 1970.
    pub time: u64,
    /// The request's header.
    pub request: StepRequest,
    /// The reply's header.
    pub reply: StepReply,
    /// The poses.
    pub records: Vec<PoseRecord>,
    /// The reply's slots.
    pub slots: Vec<ContactRecord>,
}

/// Bytes before a step's records.
const HEAD: usize = 16 + size_of::<StepRequest>() + size_of::<StepReply>();

impl StepMessage {
    /// How many bytes it takes.
    pub fn size(&self) -> usize {
        HEAD + size_of_val(self.records.as_slice()) + size_of_val(self.slots.as_slice())
    }

    /// Takes the reply: `n` slots, made one by one.
    pub fn answer(&mut self, reply: &StepReply, n: usize, slot: &dyn Fn(usize) -> ContactRecord) {
        self.reply = *reply;
        self.slots.clear();
        self.slots.extend((0..n).map(slot));
    }

    /// Its bytes: session (u64), number of records and of slots (u32), request, reply, records, slots; little endian.
    pub fn write(&self, out: &mut Vec<u8>) {
        out.clear();
        out.reserve(self.size());
        out.extend_from_slice(&self.session.to_le_bytes());
        out.extend_from_slice(&(self.records.len() as u32).to_le_bytes());
        out.extend_from_slice(&(self.slots.len() as u32).to_le_bytes());
        out.extend_from_slice(bytemuck::bytes_of(&self.request));
        out.extend_from_slice(bytemuck::bytes_of(&self.reply));
        out.extend_from_slice(bytemuck::cast_slice(&self.records));
        out.extend_from_slice(bytemuck::cast_slice(&self.slots));
    }

    /// From its bytes; `None` for bytes that are none.
    pub fn read(bytes: &[u8], time: u64) -> Option<Self> {
        let (head, rest) = bytes.split_at_checked(HEAD)?;
        let word = |at: usize| Some(u32::from_le_bytes(head[at..at + 4].try_into().ok()?) as usize);
        let (records, slots) =
            (word(8)?.checked_mul(size_of::<PoseRecord>())?, word(12)?.checked_mul(size_of::<ContactRecord>())?);
        let (request, reply) = head[16..].split_at(size_of::<StepRequest>());
        if records.checked_add(slots)? != rest.len() {
            return None;
        }
        Some(Self {
            session: u64::from_le_bytes(head[..8].try_into().ok()?),
            time,
            request: bytemuck::pod_read_unaligned(request),
            reply: bytemuck::pod_read_unaligned(reply),
            records: rest[..records].chunks_exact(size_of::<PoseRecord>()).map(bytemuck::pod_read_unaligned).collect(),
            slots: rest[records..].chunks_exact(size_of::<ContactRecord>()).map(bytemuck::pod_read_unaligned).collect(),
        })
    }
}

/// Most bytes that a message of bincode may have: as many as a command, and the files that a model names beside it.
const DECODE_LIMIT: usize = 1 << 30;

/// Bytes of a value.
pub fn encode<T: Encode>(value: &T) -> Vec<u8> {
    bincode::encode_to_vec(value, config::standard()).expect("bytes in memory take any value")
}

/// A value from all of its bytes; `None` where they are none.
fn decode<T: Decode<()>>(bytes: &[u8]) -> Option<T> {
    let limited = config::standard().with_limit::<DECODE_LIMIT>();
    bincode::decode_from_slice(bytes, limited).ok().filter(|(_, used)| *used == bytes.len()).map(|(value, _)| value)
}

/// An opening with its session.
pub fn read_opening(bytes: &[u8]) -> Option<(u64, Opening)> {
    decode(bytes)
}

/// A change with its session.
pub fn read_change(bytes: &[u8]) -> Option<(u64, Change)> {
    decode(bytes)
}

/// A model's content.
pub fn read_content(bytes: &[u8]) -> Option<Content> {
    decode(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_comes_back_and_bytes_that_are_none_are_told_apart() {
        let step = StepMessage {
            session: 7,
            time: 9,
            request: StepRequest { step: 3, advance: 0.25, ..StepRequest::default() },
            reply: StepReply { safe_time: 0.5, ..StepReply::default() },
            records: vec![PoseRecord::end(4, &contactd_proto::Pose::IDENTITY); 3],
            slots: vec![ContactRecord { a: 1, b: 2, time: 0.125, ..ContactRecord::default() }; 2],
        };
        let mut bytes = Vec::new();
        step.write(&mut bytes);
        assert_eq!(bytes.len(), step.size());
        let back = StepMessage::read(&bytes, 9).expect("a step");
        assert_eq!((back.session, back.time, back.request, back.reply), (7, 9, step.request, step.reply));
        assert_eq!((&back.records, &back.slots), (&step.records, &step.slots));
        for cut in 0..bytes.len() {
            assert!(StepMessage::read(&bytes[..cut], 9).is_none(), "cut at {cut}");
        }
        let mut forged = bytes.clone();
        forged[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(StepMessage::read(&forged, 9).is_none());
        bytes.push(0);
        assert!(StepMessage::read(&bytes, 9).is_none());
    }

    #[test]
    fn what_a_file_says_of_itself_comes_back_and_other_formats_are_refused() {
        let about = About {
            version: "0.1.0".into(),
            objects: 1,
            batch: 2,
            records: 3,
            text: 4,
            nodes: 5,
            depth: 6,
            faces: 7,
            models_mb: 8,
        };
        let mut words = about.words();
        assert_eq!(About::of_words(&words), Ok(about));
        words.insert("format".into(), "2".into());
        let sentence = About::of_words(&words).unwrap_err();
        assert!(sentence.contains("found format 2, which contactd 0.1.0 has written"), "{sentence}");
        words.remove("version");
        assert!(About::of_words(&words).unwrap_err().contains("expected version"));
    }
}
