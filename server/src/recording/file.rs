//! Reads a recording, entry by entry, from its beginning to its end or to where it was cut.

use super::content::{Content, Key};
use super::message::{ABOUT, About, Change, END, Opening, StepMessage, read_change, read_content, read_opening, topic};
use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::Read as _;
use std::path::Path;
use std::sync::Arc;

/// Longest record of a file, bytes: what claims to be longer is damage.
const LONGEST: usize = 1 << 30;

/// What stands in a recording.
#[derive(Debug)]
pub enum Entry {
    /// A session as it stands from here on.
    Opening(u64, Opening),
    /// A change of a session.
    Change(u64, Change),
    /// A step.
    Step(Box<StepMessage>),
}

/// Why a file is no recording, or no longer one.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// It cannot be read.
    #[error("{0}: expected a readable file, found {1}")]
    Read(String, std::io::Error),
    /// It is no MCAP file, or is none from some place on.
    #[error("{0}: expected an MCAP file, found damage after {1} entries: {cause}", cause = super::with_cause(.2))]
    Damaged(String, u64, McapError),
    /// It holds no recording of contactd.
    #[error("{0}: expected a recording of contactd, found {1}")]
    Foreign(String, String),
}

/// A recording that is read.
pub struct Recording {
    name: String,
    file: File,
    reader: LinearReader,
    /// What it says of the engine.
    pub about: About,
    channels: BTreeMap<u16, String>,
    contents: HashMap<Key, Arc<Content>>,
    entries: u64,
    /// It says at its end how it went: by name.
    pub end: Option<BTreeMap<String, String>>,
    is_over: bool,
    /// It was cut: it has no end.
    pub is_cut: bool,
    /// It is still written: where it ends now more may come.
    is_followed: bool,
    /// Bytes that were read.
    read: u64,
}

/// One record of the file that matters.
enum Found {
    Metadata(String, BTreeMap<String, String>),
    Message(u16, u64, Vec<u8>),
    Nothing,
}

impl Recording {
    /// Opens a file, and reads what it says of itself.
    ///
    /// # Errors
    /// What `FileError` says.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let name = path.display().to_string();
        let file = File::open(path).map_err(|e| FileError::Read(name.clone(), e))?;
        let options = LinearReaderOptions::default().with_validate_chunk_crcs(true).with_record_length_limit(LONGEST);
        let none = About {
            version: String::new(),
            objects: 0,
            batch: 0,
            records: 0,
            text: 0,
            nodes: 0,
            depth: 0,
            faces: 0,
            models_mb: 0,
        };
        let mut recording = Self {
            name,
            file,
            reader: LinearReader::new_with_options(options),
            about: none,
            channels: BTreeMap::new(),
            contents: HashMap::new(),
            entries: 0,
            end: None,
            is_over: false,
            is_cut: false,
            is_followed: false,
            read: 0,
        };
        loop {
            match recording.record()? {
                Some(Found::Metadata(name, words)) if name == ABOUT => {
                    recording.about = About::of_words(&words).map_err(|e| recording.foreign(e))?;
                    return Ok(recording);
                }
                Some(Found::Nothing) => {}
                Some(Found::Metadata(name, _)) => return Err(recording.foreign(format!("metadata called {name:?}"))),
                Some(Found::Message(..)) => {
                    return Err(recording.foreign("a message before what it says of itself".into()));
                }
                None if recording.is_cut => return Err(recording.foreign("its first bytes alone".into())),
                None => return Err(recording.foreign("nothing that it says of itself".into())),
            }
        }
    }

    /// The same of a file that is still written: `next_entry` gives `None` where there is no more yet, and what has come since when it
    /// is asked again.
    #[must_use]
    pub fn followed(self) -> Self {
        Self { is_followed: true, ..self }
    }

    /// Bytes that were read, and those that were written since.
    pub fn bytes(&self) -> (u64, u64) {
        (self.read, self.file.metadata().map_or(0, |m| m.len()).saturating_sub(self.read))
    }

    /// A model's content, which stood in the file before it is named.
    pub fn content(&self, key: &Key) -> Option<&Arc<Content>> {
        self.contents.get(key)
    }

    /// The next entry; `None` at the end, or where the file was cut.
    ///
    /// # Errors
    /// What `FileError` says.
    pub fn next_entry(&mut self) -> Result<Option<Entry>, FileError> {
        loop {
            let Some(found) = self.record()? else { return Ok(None) };
            match found {
                Found::Nothing => {}
                Found::Metadata(name, words) if name == END => self.end = Some(words),
                Found::Metadata(..) => {}
                Found::Message(channel, time, bytes) => {
                    if let Some(entry) = self.entry(channel, time, &bytes)? {
                        self.entries += 1;
                        return Ok(Some(entry));
                    }
                }
            }
        }
    }

    fn foreign(&self, found: String) -> FileError {
        FileError::Foreign(self.name.clone(), found)
    }

    /// What a message says; `None` for one that is none of this file's.
    fn entry(&mut self, channel: u16, time: u64, bytes: &[u8]) -> Result<Option<Entry>, FileError> {
        let none = |what: &str| {
            FileError::Foreign(self.name.clone(), format!("{what} that cannot be read, after {} entries", self.entries))
        };
        Ok(match self.channels.get(&channel).map(String::as_str) {
            Some(topic::MODEL) => {
                let content = Arc::new(read_content(bytes).ok_or_else(|| none("a model"))?);
                self.contents.insert(content.key(), content);
                None
            }
            Some(topic::OPENING) => {
                let (session, opening) = read_opening(bytes).ok_or_else(|| none("an opening"))?;
                Some(Entry::Opening(session, opening))
            }
            Some(topic::CHANGE) => {
                let (session, change) = read_change(bytes).ok_or_else(|| none("a change"))?;
                Some(Entry::Change(session, change))
            }
            Some(topic::STEP) => {
                Some(Entry::Step(Box::new(StepMessage::read(bytes, time).ok_or_else(|| none("a step"))?)))
            }
            // Pictures, and what others have added.
            _ => None,
        })
    }

    /// The next record of the file; `None` at its end, or where it was cut.
    fn record(&mut self) -> Result<Option<Found>, FileError> {
        if self.is_over {
            return Ok(None);
        }
        let Self { name, file, reader, channels, entries, is_followed, read: total, .. } = self;
        let damaged = |e| FileError::Damaged(name.clone(), *entries, e);
        loop {
            let event = match reader.next_event() {
                None => {
                    self.is_over = true;
                    return Ok(None);
                }
                Some(Err(McapError::UnexpectedEof)) => {
                    (self.is_over, self.is_cut) = (true, true);
                    return Ok(None);
                }
                Some(event) => event.map_err(damaged)?,
            };
            match event {
                LinearReadEvent::ReadRequest(n) => {
                    let read = file.read(reader.insert(n)).map_err(|e| FileError::Read(name.clone(), e))?;
                    // A reader that is told of 0 bytes takes them for the end.
                    if read == 0 && *is_followed {
                        return Ok(None);
                    }
                    *total += read as u64;
                    reader.notify_read(read);
                }
                LinearReadEvent::Record { opcode, data } => {
                    return Ok(Some(match mcap::parse_record(opcode, data).map_err(damaged)? {
                        Record::Channel(channel) => {
                            channels.insert(channel.id, channel.topic);
                            Found::Nothing
                        }
                        Record::Metadata(m) => Found::Metadata(m.name, m.metadata),
                        Record::Message { header, data } => {
                            Found::Message(header.channel_id, header.log_time, data.into_owned())
                        }
                        _ => Found::Nothing,
                    }));
                }
            }
        }
    }
}
