//! The thread that writes: what comes out of the queue, as an MCAP file.
//!
//! Messages stand in chunks that are written whole and without a seek, several times a second: what is in the file when the process
//! is killed can be read up to the cut. A model's content is written once. Pictures for viewers are made here, and left out first
//! where the queue grows.

use super::content::{Content, Key, Part};
use super::foxglove::schemas;
use super::message::{ABOUT, About, Change, END, Opening, StepMessage, encode, encoding, topic};
use super::queue::{Item, Load, Recorder, now};
use super::view::Stage;
use crate::world::yield_to_others;
use contactd_proto::control::RecordingStatus;
use mcap::records::MessageHeader;
use mcap::write::{Metadata, NoSeek};
use mcap::{McapResult, WriteOptions, Writer};
use std::collections::{BTreeMap, HashMap};
use std::io::ErrorKind::{QuotaExceeded, StorageFull};
use std::io::{BufWriter, Write};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError};
use std::thread::Builder;
use std::time::{Duration, Instant};

/// How often it looks at its queue.
const LOOK: Duration = Duration::from_millis(2);
/// How often what is written is made sure to be readable.
const FLUSH: Duration = Duration::from_millis(200);
/// For how long a disk without room is asked again: somebody may make room, or a file system give back what it holds in reserve.
const ROOM: Duration = Duration::from_secs(3);
/// How often it is asked.
const RETRY: Duration = Duration::from_millis(20);
/// Bytes of a chunk, about.
const CHUNK: u64 = 1 << 20;
/// Steps get no picture while more than one of so many parts of the queue is taken.
const BUSY: usize = 4;

impl Recorder {
    /// Records into a new file at `path`; `ended` is told what was recorded, once the file is complete.
    ///
    /// # Errors
    /// The file exists, or cannot be made; no thread can be started. One sentence.
    pub fn start(
        path: &str,
        about: &About,
        ended: impl FnOnce(RecordingStatus) + Send + 'static,
    ) -> Result<Self, String> {
        let file = std::fs::OpenOptions::new().write(true).create_new(true).open(path);
        let file = file.map_err(|e| format!("{path}: expected to make a new file, found {e}"))?;
        Self::over(path, Box::new(file), about, ended)
    }

    /// Records into something else than a file.
    ///
    /// # Errors
    /// No thread can be started.
    pub fn over(
        path: &str,
        sink: Box<dyn Write + Send>,
        about: &About,
        ended: impl FnOnce(RecordingStatus) + Send + 'static,
    ) -> Result<Self, String> {
        let load = Arc::new(Load::default());
        let (recorder, from) = Self::new(path, load.clone());
        let (path, words) = (path.to_owned(), about.words());
        let write = move || {
            yield_to_others();
            let sink = Counted { sink, load: load.clone() };
            let mut pending = 0;
            let written = write(sink, &from, &load, words, &mut pending);
            // What was sent while it ended nobody reads.
            load.over.store(true, Relaxed);
            let left = from.try_iter().filter(|item| matches!(item, Item::Step(_))).count() as u64;
            load.lost(left + if written.is_err() { pending } else { 0 });
            if let Err(e) = written {
                *load.failure.lock().unwrap_or_else(std::sync::PoisonError::into_inner) =
                    format!("{path}: {}", super::with_cause(&e));
            }
            ended(load.status(&path));
        };
        Builder::new()
            .name("contactd-record".into())
            .spawn(write)
            .map_err(|e| format!("no thread can be started: {e}"))?;
        Ok(recorder)
    }
}

/// A sink that counts, and that asks a disk without room again for a while: meanwhile steps wait in the queue.
struct Counted {
    sink: Box<dyn Write + Send>,
    load: Arc<Load>,
}

impl Counted {
    fn insist(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let begun = Instant::now();
        loop {
            match self.sink.write(bytes) {
                Err(e) if matches!(e.kind(), StorageFull | QuotaExceeded) && begun.elapsed() < ROOM => {
                    std::thread::sleep(RETRY);
                }
                done => return done,
            }
        }
    }
}

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let n = self.insist(bytes)?;
        self.load.written.fetch_add(n as u64, Relaxed);
        Ok(n)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.sink.flush()
    }
}

/// Writes what comes out of a queue, to its end; `pending`: the steps that were taken and can not be read yet.
fn write(
    sink: Counted,
    from: &Receiver<Item>,
    load: &Load,
    about: BTreeMap<String, String>,
    pending: &mut u64,
) -> McapResult<()> {
    let options = WriteOptions::new()
        .compression(None)
        .profile("")
        .library(concat!("contactd ", env!("CARGO_PKG_VERSION")))
        .chunk_size(Some(CHUNK))
        .disable_seeking(true);
    let mut file = File::new(options.create(NoSeek::new(BufWriter::new(sink)))?, about)?;
    // From the beginning it says what it is.
    file.writer.flush()?;
    let mut flushed = Instant::now();
    let mut is_fresh = false;
    loop {
        match from.try_recv() {
            Ok(item) => {
                let (size, busy) = (item.size(), load.is_beyond(BUSY));
                *pending += u64::from(matches!(item, Item::Step(_)));
                let written = file.item(item, busy.then_some(load));
                load.taken(size);
                written?;
                if !busy {
                    file.draw()?;
                }
                is_fresh = true;
            }
            Err(TryRecvError::Empty) if file.draw()? => is_fresh = true,
            Err(TryRecvError::Empty) if load.stop.load(Relaxed) => break,
            Err(TryRecvError::Empty) => std::thread::sleep(LOOK),
            Err(TryRecvError::Disconnected) => break,
        }
        if is_fresh && flushed.elapsed() >= FLUSH {
            file.writer.flush()?;
            (flushed, is_fresh) = (Instant::now(), false);
            *pending = 0;
        }
    }
    file.end(load)
}

/// A session as the writer follows it.
struct Followed {
    stage: Stage,
    back: SyncSender<Box<StepMessage>>,
}

struct File {
    writer: Writer<NoSeek<BufWriter<Counted>>>,
    /// Ids of the channels by topic, and how many messages each has.
    channels: BTreeMap<&'static str, (u16, u32)>,
    /// Keys of the contents that stand in the file, by where they lie in memory; held, so that nothing else comes to lie there.
    written: HashMap<usize, (Key, Arc<Content>)>,
    sessions: BTreeMap<u64, Followed>,
    /// Steps that were written.
    steps: u64,
    bytes: Vec<u8>,
}

impl File {
    fn new(mut writer: Writer<NoSeek<BufWriter<Counted>>>, about: BTreeMap<String, String>) -> McapResult<Self> {
        writer.write_metadata(&Metadata { name: ABOUT.into(), metadata: about })?;
        let mut channels = BTreeMap::new();
        let raw = [
            (topic::MODEL, encoding::BINCODE),
            (topic::OPENING, encoding::BINCODE),
            (topic::CHANGE, encoding::BINCODE),
            (topic::STEP, encoding::STEP),
        ];
        for (topic, encoding) in raw {
            channels.insert(topic, (writer.add_channel(0, topic, encoding, &BTreeMap::new())?, 0));
        }
        for (topic, (name, schema)) in [topic::SCENE, topic::TRANSFORMS].into_iter().zip(schemas()) {
            let schema = writer.add_schema(name, "jsonschema", schema.as_bytes())?;
            channels.insert(topic, (writer.add_channel(schema, topic, encoding::JSON, &BTreeMap::new())?, 0));
        }
        Ok(Self { writer, channels, written: HashMap::new(), sessions: BTreeMap::new(), steps: 0, bytes: Vec::new() })
    }

    fn message(&mut self, topic: &'static str, time: u64, bytes: &[u8]) -> McapResult<()> {
        let Some((channel_id, sequence)) = self.channels.get_mut(topic) else { return Ok(()) };
        let header = MessageHeader { channel_id: *channel_id, sequence: *sequence, log_time: time, publish_time: time };
        *sequence = sequence.wrapping_add(1);
        self.writer.write_to_known_channel(&header, bytes)
    }

    /// Writes an item; its picture too, unless the queue is `busy`.
    fn item(&mut self, item: Item, busy: Option<&Load>) -> McapResult<()> {
        match item {
            Item::Opening(opening) => {
                let (session, opening, parts, back) = *opening;
                self.opening(session, opening, parts, back)
            }
            Item::Change(change) => {
                let (session, change, part) = *change;
                self.change(session, change, part)
            }
            Item::Step(step) => self.step(step, busy),
            Item::Over(session) => match self.sessions.remove(&session) {
                Some(followed) => {
                    let time = now();
                    self.message(topic::SCENE, time, &followed.stage.strike(time))
                }
                None => Ok(()),
            },
        }
    }

    /// The key of a content, which stands in the file from now on.
    fn content(&mut self, content: &Arc<Content>, time: u64) -> McapResult<Key> {
        let place = Arc::as_ptr(content) as usize;
        if let Some((key, _)) = self.written.get(&place) {
            return Ok(*key);
        }
        let key = content.key();
        let is_new = self.written.values().all(|(known, _)| *known != key);
        self.written.insert(place, (key, content.clone()));
        if is_new {
            self.message(topic::MODEL, time, &encode(&**content))?;
        }
        Ok(key)
    }

    fn opening(
        &mut self,
        session: u64,
        mut opening: Opening,
        parts: Vec<(u32, Part)>,
        back: SyncSender<Box<StepMessage>>,
    ) -> McapResult<()> {
        let time = now();
        for (id, part) in &parts {
            let key = self.content(&part.content, time)?;
            opening.models.push((*id, key));
        }
        self.message(topic::OPENING, time, &encode(&(session, &opening)))?;
        let before = self.sessions.remove(&session).map(|followed| followed.stage);
        let stage = Stage::open(session, &opening, parts, before);
        self.sessions.insert(session, Followed { stage, back });
        Ok(())
    }

    fn change(&mut self, session: u64, mut change: Change, part: Option<Part>) -> McapResult<()> {
        let time = now();
        if let (Change::Model(_, key), Some(part)) = (&mut change, &part) {
            *key = self.content(&part.content, time)?;
        }
        self.message(topic::CHANGE, time, &encode(&(session, &change)))?;
        let Some(followed) = self.sessions.get_mut(&session) else { return Ok(()) };
        match (&change, part) {
            (Change::Model(id, _), Some(part)) => followed.stage.model(*id, part),
            (Change::Command(command), _) => followed.stage.command(command),
            (Change::Model(..), None) => {}
        }
        Ok(())
    }

    /// Draws some of what is not drawn as it is; true when there was something.
    fn draw(&mut self) -> McapResult<bool> {
        let time = now();
        let mut stages = self.sessions.values_mut().map(|followed| &mut followed.stage);
        let next = stages.find_map(|stage| {
            let next = (stage.draw(time), stage.transforms(time));
            (next.0.is_some() || next.1.is_some()).then_some(next)
        });
        let Some((scene, transforms)) = next else { return Ok(false) };
        if let Some(scene) = scene {
            self.message(topic::SCENE, time, &scene)?;
        }
        if let Some(transforms) = transforms {
            self.message(topic::TRANSFORMS, time, &transforms)?;
        }
        Ok(true)
    }

    fn step(&mut self, step: Box<StepMessage>, busy: Option<&Load>) -> McapResult<()> {
        let mut bytes = std::mem::take(&mut self.bytes);
        step.write(&mut bytes);
        self.message(topic::STEP, step.time, &bytes)?;
        self.steps += 1;
        self.bytes = bytes;
        let time = step.time;
        let Some(followed) = self.sessions.get_mut(&step.session) else { return Ok(()) };
        followed.stage.take(&step);
        let picture = match busy {
            None => Some((followed.stage.contacts(&step), followed.stage.transforms(time))),
            Some(load) => {
                load.without_picture.fetch_add(1, Relaxed);
                None
            }
        };
        // Where it goes nobody waits for it.
        let _ = followed.back.try_send(step);
        if let Some((contacts, transforms)) = picture {
            if let Some(contacts) = contacts {
                self.message(topic::SCENE, time, &contacts)?;
            }
            if let Some(transforms) = transforms {
                self.message(topic::TRANSFORMS, time, &transforms)?;
            }
        }
        Ok(())
    }

    /// Says how it went, and completes the file.
    fn end(mut self, load: &Load) -> McapResult<()> {
        let numbers = [
            ("steps", self.steps),
            ("dropped", load.dropped.load(Relaxed)),
            ("without_picture", load.without_picture.load(Relaxed)),
        ];
        let metadata = numbers.map(|(name, n)| (name.to_owned(), n.to_string())).into();
        self.writer.write_metadata(&Metadata { name: END.into(), metadata })?;
        self.writer.finish()?;
        self.writer.into_inner().into_inner().flush()?;
        Ok(())
    }
}
