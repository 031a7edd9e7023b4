//! What the loop is asked and told of recordings.

use super::super::port::{Port, Wake};
use super::super::recordings::Owner;
use super::super::scene::refused;
use super::{Lead, answer, gone};
use crate::world::Refusal;
use contactd_proto::control::{Answer, RecordingOrder, RecordingStatus};

impl<P: Port> Lead<P> {
    /// Begins a recording that a session asks for, or (0) an operator.
    pub(super) fn record(&mut self, id: u64, order: &RecordingOrder) -> Result<(), Refusal> {
        for session in [id, order.session.unwrap_or(0)] {
            if session != 0 && !self.sessions.contains_key(&session) {
                return Err(Refusal::new(gone(&self.ended, session, true), format!("session {session}")));
            }
        }
        let owner = owner_of(id);
        self.recordings.begin(owner, order, &self.config, &self.mailbox)?;
        self.log.info(|| format!("steps are recorded into {}: {} asked for it", order.path, named(owner)));
        Ok(())
    }

    /// Records all steps because the settings say so.
    ///
    /// # Errors
    /// `Recording`, with its sentence.
    pub fn record_all(&mut self, path: String) -> Result<(), Refusal> {
        let order = RecordingOrder { path, session: None, process: (0, 0) };
        self.recordings.begin(Owner::Server, &order, &self.config, &self.mailbox)
    }

    /// Tells what was recorded; ends it where that is asked for, and answers when it has ended.
    pub(super) fn tell_of_recording(&mut self, id: u64, stop: bool, call: P::Command) {
        let owner = owner_of(id);
        let (call, told) = match stop {
            false => (call, self.recordings.status(owner)),
            true => match self.recordings.stop(owner, (id != 0).then_some(id), call) {
                Some(now) => now,
                None => return,
            },
        };
        answer(call, &told.map_or_else(refused, Answer::Recorded));
        if let Some(session) = self.sessions.get(&id) {
            session.wake.notify();
        }
    }

    /// A recording has ended.
    pub(super) fn recorded(&mut self, serial: u64, status: RecordingStatus) {
        let RecordingStatus { path, steps, dropped, failure, .. } = &status;
        match failure.is_empty() {
            true => self.log.info(|| format!("{path}: {steps} steps are recorded, {dropped} were left out")),
            false => self.log.warn(&format!("the recording has failed, {path} can be read up to there: {failure}")),
        }
        let (waits, _) = self.recordings.ended(serial, &status);
        let Some((session, call)) = waits else { return };
        answer(call, &Answer::Recorded(status));
        if let Some(session) = session.and_then(|id| self.sessions.get(&id)) {
            session.wake.notify();
        }
    }
}

/// Who asks for a recording in the name of a session, or of none.
fn owner_of(session: u64) -> Owner {
    if session == 0 { Owner::Operator } else { Owner::Session(session) }
}

/// The same, for people.
fn named(owner: Owner) -> String {
    match owner {
        Owner::Server => "the settings".into(),
        Owner::Operator => "`contactd record`".into(),
        Owner::Session(id) => format!("session {id}"),
    }
}
