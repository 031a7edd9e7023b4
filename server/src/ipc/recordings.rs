//! The recordings of a server: who asked for them, which sessions they take, and how they end.
//!
//! A recording is the server's own (its settings), an operator's (of one session or of all) or a session's. A session is recorded by
//! one at a time. A scene learns that it is recorded when its next step or command comes: by a number that changes with every
//! recording that begins or ends.

use super::config::ServerConfig;
use super::port::{Bell, Port};
use super::task::{Mailbox, Report};
use crate::recording::{About, Recorder, Tap};
use crate::world::Refusal;
use contactd_client::shm::watch::ProcessWatch;
use contactd_proto::ErrorCode;
use contactd_proto::control::{RecordingOrder, RecordingStatus};
use std::collections::BTreeMap;
use std::sync::{Arc, Weak};

/// Who has asked for a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Owner {
    /// The server's settings.
    Server,
    /// An operator.
    Operator,
    /// A session.
    Session(u64),
}

/// A recording under way.
struct Running {
    recorder: Arc<Recorder>,
    /// The session that it takes; `None`: all.
    only: Option<u64>,
    /// The life of the process that asked for it.
    life: Option<ProcessWatch>,
    serial: u64,
}

/// The recordings of a server.
pub struct Recordings<P: Port> {
    running: BTreeMap<Owner, Running>,
    /// Those that end, and who waits for that.
    ending: BTreeMap<u64, Option<(Option<u64>, P::Command)>>,
    /// Those that were stopped without a word, and how they ended: their owner is told when it asks.
    ended: BTreeMap<Owner, RecordingStatus>,
    owners: BTreeMap<u64, Owner>,
    serial: u64,
    /// Changes when a recording begins or ends.
    number: u64,
}

impl<P: Port> Default for Recordings<P> {
    fn default() -> Self {
        Self {
            running: BTreeMap::new(),
            ending: BTreeMap::new(),
            ended: BTreeMap::new(),
            owners: BTreeMap::new(),
            serial: 0,
            number: 0,
        }
    }
}

/// Why nothing is recorded.
pub fn refusal(sentence: impl Into<String>) -> Refusal {
    Refusal::new(ErrorCode::Recording, sentence)
}

/// What recordings say of an engine of these settings.
///
/// # Errors
/// `Recording` with a deadline: answers then depend on time.
pub fn about(config: &ServerConfig) -> Result<About, Refusal> {
    if config.deadline_ms > 0 {
        return Err(refusal(
            "the server has a deadline, with which answers depend on time: none of them could be repeated",
        ));
    }
    Ok(About {
        version: env!("CARGO_PKG_VERSION").into(),
        objects: config.objects,
        batch: config.batch,
        records: config.records,
        text: config.text,
        nodes: config.nodes,
        depth: config.depth,
        faces: config.faces,
        models_mb: config.models_mb,
    })
}

impl<P: Port> Recordings<P> {
    /// Begins a recording.
    ///
    /// # Errors
    /// `Recording`, with its sentence.
    pub fn begin(
        &mut self,
        owner: Owner,
        order: &RecordingOrder,
        config: &ServerConfig,
        mailbox: &Arc<Mailbox<P>>,
    ) -> Result<(), Refusal> {
        let about = about(config)?;
        let only = match owner {
            Owner::Session(id) => Some(id),
            Owner::Server | Owner::Operator => order.session,
        };
        // Two recordings that take one session, or that one owner would not tell apart.
        let meets = |(other, running): &(&Owner, &Running)| {
            **other == owner || only.is_none() || running.only.is_none() || running.only == only
        };
        if let Some((_, running)) = self.running.iter().find(meets) {
            return Err(refusal(format!("a recording runs already, into {}", running.recorder.status().path)));
        }
        let serial = self.serial + 1;
        // The bell must not outlive its service.
        let mailbox: Weak<Mailbox<P>> = Arc::downgrade(mailbox);
        let ended = move |status| {
            if let Some(mailbox) = mailbox.upgrade()
                && mailbox.reports.send((0, Report::Recorded(serial, status))).is_ok()
            {
                mailbox.bell.ring();
            }
        };
        let recorder = Recorder::start(&order.path, &about, ended).map_err(refusal)?;
        let life = (order.process.0 != 0).then(|| ProcessWatch::of(order.process.0, order.process.1)).flatten();
        self.running.insert(owner, Running { recorder: Arc::new(recorder), only, life, serial });
        (self.serial, self.number) = (serial, self.number + 1);
        self.owners.insert(serial, owner);
        self.ended.remove(&owner);
        Ok(())
    }

    /// Which recordings there are, as a number.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// A session's way to its recorder, if it is recorded.
    pub fn tap(&self, session: u64) -> Option<Tap> {
        let mut all = self.running.values();
        let running = all.find(|running| running.only.is_none_or(|only| only == session))?;
        Some(Tap::new(session, running.recorder.clone()))
    }

    /// What was recorded so far.
    ///
    /// # Errors
    /// `Recording` where nothing is.
    pub fn status(&self, owner: Owner) -> Result<RecordingStatus, Refusal> {
        let running = self.running.get(&owner).map(|running| running.recorder.status());
        running.or_else(|| self.ended.get(&owner).cloned()).ok_or_else(|| refusal("nothing is being recorded"))
    }

    /// Ends a recording; `call` is answered once its file is complete, of `session` if it is one's. Gives the call back with what it
    /// is to be answered now.
    pub fn stop(
        &mut self,
        owner: Owner,
        session: Option<u64>,
        call: P::Command,
    ) -> Option<(P::Command, Result<RecordingStatus, Refusal>)> {
        match self.running.remove(&owner) {
            Some(running) => {
                self.end(running, Some((session, call)));
                None
            }
            None => Some((call, self.ended.remove(&owner).ok_or_else(|| refusal("nothing is being recorded")))),
        }
    }

    fn end(&mut self, running: Running, call: Option<(Option<u64>, P::Command)>) {
        running.recorder.stop();
        self.number += 1;
        self.ending.insert(running.serial, call);
    }

    /// A recording's file is complete, or has failed: who waits for that, and the owner where nobody does.
    pub fn ended(
        &mut self,
        serial: u64,
        status: &RecordingStatus,
    ) -> (Option<(Option<u64>, P::Command)>, Option<Owner>) {
        let owner = self.owners.remove(&serial);
        if let Some(call) = self.ending.remove(&serial) {
            return (call, owner);
        }
        // It has ended by itself: what its sink refused is why.
        if let Some(owner) = owner {
            self.running.remove(&owner);
            self.number += 1;
            self.ended.insert(owner, status.clone());
        }
        (None, owner)
    }

    /// A session is over, and so is its own recording.
    pub fn session_is_over(&mut self, id: u64) {
        self.ended.remove(&Owner::Session(id));
        if let Some(running) = self.running.remove(&Owner::Session(id)) {
            self.end(running, None);
        }
    }

    /// Ends the recordings whose process has gone; their files.
    pub fn bury(&mut self) -> Vec<String> {
        let dead: Vec<Owner> = self
            .running
            .iter()
            .filter(|(_, running)| running.life.as_ref().is_some_and(ProcessWatch::is_dead))
            .map(|(owner, _)| *owner)
            .collect();
        let mut files = Vec::new();
        for owner in dead {
            if let Some(running) = self.running.remove(&owner) {
                files.push(running.recorder.status().path);
                self.end(running, None);
            }
        }
        files
    }

    /// Ends all; how many are not complete yet.
    pub fn end_all(&mut self) -> usize {
        while let Some((_, running)) = self.running.pop_first() {
            self.end(running, None);
        }
        self.ending.len()
    }
}
