//! From a session to the thread that writes: a bounded queue that nobody waits for.
//!
//! A push is a copy of the batch and of the reply's slots into memory that the writer gives back, and one exchange of a pointer. It
//! wakes nobody: the writer looks every two milliseconds. The queue is bounded by its bytes and by its length. What does not fit is
//! left out as a whole; then nothing is taken of the session until half of the queue is free again, and the first thing taken is an
//! opening.

use super::content::Part;
use super::message::{Change, Opening, StepMessage};
use contactd_proto::control::RecordingStatus;
use contactd_proto::{PoseRecord, StepRequest};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// Most bytes on their way.
pub const LIMIT: usize = 64 << 20;
/// Most items on their way: the steps of some seconds, for which the writer is at the pictures of an opening.
pub const LENGTH: usize = 1 << 14;
/// Messages of a session that are kept to be used again.
const SPARE: usize = 64;
/// What an object takes in an opening, about.
const OBJECT_BYTES: usize = 400;

/// What goes to the writer.
pub enum Item {
    /// A session as it stands, its models, and where its messages go back.
    Opening(Box<(u64, Opening, Vec<(u32, Part)>, SyncSender<Box<StepMessage>>)>),
    /// A change of a session, with the model that it names.
    Change(Box<(u64, Change, Option<Part>)>),
    /// A step.
    Step(Box<StepMessage>),
    /// A session is no longer recorded.
    Over(u64),
}

impl Item {
    /// About how many bytes of memory it holds that are its own.
    pub fn size(&self) -> usize {
        match self {
            Self::Opening(opening) => 1000 + OBJECT_BYTES * opening.1.objects.len(),
            Self::Change(_) | Self::Over(_) => 1000,
            Self::Step(step) => step.size(),
        }
    }
}

/// What both ends of the queue know.
#[derive(Debug, Default)]
pub struct Load {
    pub bytes: AtomicUsize,
    pub items: AtomicUsize,
    pub steps: AtomicU64,
    pub dropped: AtomicU64,
    pub without_picture: AtomicU64,
    pub written: AtomicU64,
    pub stop: AtomicBool,
    /// Nothing is taken any more.
    pub over: AtomicBool,
    pub failure: Mutex<String>,
}

impl Load {
    /// An item is on its way.
    fn sent(&self, size: usize) {
        self.bytes.fetch_add(size, Relaxed);
        self.items.fetch_add(1, Relaxed);
    }

    /// It is no longer.
    pub fn taken(&self, size: usize) {
        self.bytes.fetch_sub(size, Relaxed);
        self.items.fetch_sub(1, Relaxed);
    }

    /// Steps that were taken do not come to stand in the file: they are left out as well.
    pub fn lost(&self, steps: u64) {
        self.steps.fetch_sub(steps, Relaxed);
        self.dropped.fetch_add(steps, Relaxed);
    }

    /// True when more than one part of so many is on its way.
    pub fn is_beyond(&self, part: usize) -> bool {
        self.bytes.load(Relaxed) > LIMIT / part || self.items.load(Relaxed) > LENGTH / part
    }

    /// As it is told.
    pub fn status(&self, path: &str) -> RecordingStatus {
        RecordingStatus {
            path: path.to_owned(),
            steps: self.steps.load(Relaxed),
            dropped: self.dropped.load(Relaxed),
            without_picture: self.without_picture.load(Relaxed),
            bytes: self.written.load(Relaxed),
            failure: self.failure.lock().unwrap_or_else(PoisonError::into_inner).clone(),
        }
    }
}

/// A recording under way: the near end of its queue. It ends when it is told to, or when nobody has it any more.
#[derive(Debug)]
pub struct Recorder {
    to: SyncSender<Item>,
    load: Arc<Load>,
    path: String,
}

impl Recorder {
    /// A queue, and its far end.
    pub fn new(path: &str, load: Arc<Load>) -> (Self, Receiver<Item>) {
        let (to, from) = sync_channel(LENGTH);
        (Self { to, load, path: path.to_owned() }, from)
    }

    /// What was recorded so far.
    pub fn status(&self) -> RecordingStatus {
        self.load.status(&self.path)
    }

    /// Ends it: what is on its way is still written.
    pub fn stop(&self) {
        self.load.stop.store(true, Relaxed);
    }

    /// Takes an item, or leaves it.
    fn push(&self, item: Item) -> Result<(), Item> {
        let size = item.size();
        if self.load.over.load(Relaxed) || self.load.bytes.load(Relaxed) + size > LIMIT {
            return Err(item);
        }
        self.load.sent(size);
        self.to.try_send(item).map_err(|e| {
            self.load.taken(size);
            match e {
                std::sync::mpsc::TrySendError::Full(item) | std::sync::mpsc::TrySendError::Disconnected(item) => item,
            }
        })
    }
}

/// A session's way to its recorder.
#[derive(Debug)]
pub struct Tap {
    session: u64,
    recorder: Arc<Recorder>,
    /// The recorder has all that it takes to repeat what comes next.
    is_open: bool,
    /// Steps left out since.
    dropped: u64,
    back: SyncSender<Box<StepMessage>>,
    spare: Receiver<Box<StepMessage>>,
    /// The message of the step under way.
    message: Box<StepMessage>,
}

impl Tap {
    /// A session's; it begins with an opening.
    pub fn new(session: u64, recorder: Arc<Recorder>) -> Self {
        let (back, spare) = sync_channel(SPARE);
        Self { session, recorder, is_open: false, dropped: 0, back, spare, message: Box::default() }
    }

    /// True when an opening is needed, and there is room for it: half of the queue is free.
    pub fn wants_opening(&self) -> bool {
        !self.is_open && !self.recorder.load.is_beyond(2)
    }

    /// Takes an opening; true when it was taken.
    pub fn open(&mut self, opening: Opening, parts: Vec<(u32, Part)>) -> bool {
        let opening = Opening { dropped: self.dropped, ..opening };
        let item = Item::Opening(Box::new((self.session, opening, parts, self.back.clone())));
        self.is_open = self.recorder.push(item).is_ok();
        if self.is_open {
            self.dropped = 0;
        }
        self.is_open
    }

    /// True when what changes is to be told.
    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// Tells of a change.
    pub fn change(&mut self, change: Change, part: Option<Part>) {
        // What is left out stands in the next opening.
        self.is_open = self.is_open && self.recorder.push(Item::Change(Box::new((self.session, change, part)))).is_ok();
    }

    /// Copies a batch: what is searched is what is recorded, whoever writes to the slots meanwhile.
    pub fn batch(&mut self, request: &StepRequest, records: &[PoseRecord]) -> Box<StepMessage> {
        let mut message = std::mem::take(&mut self.message);
        (message.session, message.request) = (self.session, *request);
        message.records.clear();
        // Slots behind those that count are nobody's.
        message.records.extend_from_slice(&records[..records.len().min(request.records as usize)]);
        message
    }

    /// Takes a step that was answered.
    pub fn answered(&mut self, mut message: Box<StepMessage>) {
        if !self.is_open {
            self.left_out(message);
            return;
        }
        message.time = now();
        let steps = &self.recorder.load.steps;
        steps.fetch_add(1, Relaxed);
        match self.recorder.push(Item::Step(message)) {
            Ok(()) => {
                self.message = self.spare.try_recv().unwrap_or_default();
            }
            Err(Item::Step(message)) => {
                steps.fetch_sub(1, Relaxed);
                self.is_open = false;
                self.left_out(message);
            }
            Err(Item::Opening(_) | Item::Change(_) | Item::Over(_)) => {}
        }
    }

    fn left_out(&mut self, message: Box<StepMessage>) {
        self.dropped += 1;
        self.recorder.load.dropped.fetch_add(1, Relaxed);
        self.message = message;
    }

    /// A step that was cut short from outside: its answer went to nobody, and nothing repeats it.
    pub fn cut_short(&mut self, message: Box<StepMessage>) {
        (self.is_open, self.message) = (false, message);
    }
}

impl Drop for Tap {
    fn drop(&mut self) {
        // Where there is no room for it the writer follows a session that is no more.
        let _ = self.recorder.push(Item::Over(self.session));
    }
}

/// Nanoseconds since 1970.
pub fn now() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}
