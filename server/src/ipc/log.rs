//! What a server tells its operator: lines on standard error, by level, written on a thread of their own.
//!
//! A terminal that is stopped, or a pipe that nobody reads, holds up the thread and not the loop: lines that find no room are left
//! out, and their number is told once there is room again.

use serde::Deserialize;
use std::io::Write as _;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, channel, sync_channel};
use std::thread::Builder;
use std::time::Duration;

/// Lines that may wait to be written.
const ROOM: usize = 1024;
/// How long the end of a server waits for them.
const LAST: Duration = Duration::from_millis(200);

/// How much is told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// What is wrong with the server or its machine.
    Warn,
    /// Each session too: opened, ended, refused, and why.
    #[default]
    Info,
    /// Models and refused commands too.
    Debug,
}

impl Level {
    /// The level of a word.
    ///
    /// # Errors
    /// The words that there are.
    pub fn of_name(word: &str) -> Result<Self, String> {
        match word {
            "warn" => Ok(Self::Warn),
            "info" => Ok(Self::Info),
            "debug" => Ok(Self::Debug),
            _ => Err(format!("expected warn, info or debug, found {word:?}")),
        }
    }
}

/// A server's log.
#[derive(Debug)]
pub struct Log {
    level: Level,
    /// `None`: no thread could be started, or it has gone; lines are written by who tells them.
    to: Option<SyncSender<String>>,
    done: Option<Receiver<()>>,
    /// Lines that found no room.
    lost: u64,
}

impl Log {
    /// A log that tells what is of this level or above it.
    pub fn new(level: Level) -> Self {
        let (to, lines) = sync_channel::<String>(ROOM);
        let (end, done) = channel();
        let write = move || {
            lines.iter().for_each(|line| line_out(&line));
            let _ = end.send(());
        };
        match Builder::new().name("contactd-log".into()).spawn(write) {
            Ok(_) => Self { level, to: Some(to), done: Some(done), lost: 0 },
            Err(_) => Self { level, to: None, done: None, lost: 0 },
        }
    }

    /// Something is wrong.
    pub fn warn(&mut self, sentence: &str) {
        self.tell(Level::Warn, || sentence.to_owned());
    }

    /// Something happened to a session.
    pub fn info(&mut self, sentence: impl FnOnce() -> String) {
        self.tell(Level::Info, sentence);
    }

    /// Something that explains more.
    pub fn debug(&mut self, sentence: impl FnOnce() -> String) {
        self.tell(Level::Debug, sentence);
    }

    fn tell(&mut self, level: Level, sentence: impl FnOnce() -> String) {
        if level > self.level {
            return;
        }
        let Some(to) = &self.to else { return line_out(&sentence()) };
        if self.lost > 0 && to.try_send(format!("{} lines were left out: nobody read them", self.lost)).is_ok() {
            self.lost = 0;
        }
        match to.try_send(sentence()) {
            Ok(()) => {}
            Err(TrySendError::Full(_)) => self.lost += 1,
            Err(TrySendError::Disconnected(line)) => {
                self.to = None;
                line_out(&line);
            }
        }
    }
}

impl Drop for Log {
    fn drop(&mut self) {
        self.to = None;
        if let Some(done) = &self.done {
            let _ = done.recv_timeout(LAST);
        }
    }
}

/// A line on standard error, if anybody reads it: a terminal that is gone is no reason to end. What would break it is replaced.
fn line_out(sentence: &str) {
    let sentence: String =
        sentence.chars().map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).collect();
    let _ = writeln!(std::io::stderr(), "contactd: {sentence}");
}
