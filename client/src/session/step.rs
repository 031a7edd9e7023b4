//! Steps of a session: a batch is loaned, sent and answered.

use super::Session;
use super::stage::Stage;
use crate::{Error, Reply, Transport};
use contactd_proto::names::PROTOCOL_VERSION;
use contactd_proto::step::{ASK_CLEAR, ASK_DETAILS, ASK_FIRST, ASK_POLLING, NO_INDEX, STEP_REFUSED};
use contactd_proto::{ErrorCode, PoseRecord, StepRequest};
use std::time::Duration;

impl<T: Transport> Session<T> {
    /// Slots for `n` poses, to be filled in place. A batch that was begun and not sent is dropped.
    ///
    /// # Errors
    /// `Refused` (`TooMany`), `Misuse` while a step is in flight, `ServerLost`, `System`.
    pub fn begin_step(&mut self, n: usize) -> Result<&mut [PoseRecord], Error> {
        self.check_idle()?;
        self.loan(n)
    }

    /// Slots for `n` records of the caller, with room behind them for what is attached.
    fn loan(&mut self, n: usize) -> Result<&mut [PoseRecord], Error> {
        self.settle()?;
        let all = n + self.company.slots();
        self.check_count(all)?;
        self.stage = Stage::Idle;
        let slots = self.transport.loan(all)?;
        (self.stage, self.own_slots) = (Stage::Loaned, n);
        Ok(&mut slots[..n])
    }

    /// True from when a batch is sent until its answer was taken.
    pub fn is_in_flight(&self) -> bool {
        self.stage == Stage::Sent
    }

    /// Batches that were sent so far: who keeps what an earlier answer told sees by it whether there was another.
    pub fn steps(&self) -> u64 {
        self.step
    }

    /// Whether something else may begin.
    pub(super) fn check_idle(&self) -> Result<(), Error> {
        match self.stage {
            Stage::Sent => Err(Error::Misuse("a step is in flight: finish it first")),
            Stage::Lost => Err(Error::ServerLost),
            Stage::Idle | Stage::Loaned => Ok(()),
        }
    }

    fn check_count(&self, n: usize) -> Result<(), Error> {
        if n <= self.opened.max_batch as usize {
            return Ok(());
        }
        let detail = format!("{n} records, the limit is {}", self.opened.max_batch);
        Err(Error::Refused { code: ErrorCode::TooMany, index: None, detail })
    }

    /// Sends the batch without waiting; `finish` does it too.
    ///
    /// # Errors
    /// `Misuse` when no step was begun, or a record names a part that is attached; `ServerLost`, `System`.
    pub fn send(&mut self) -> Result<(), Error> {
        match self.stage {
            Stage::Loaned => {}
            Stage::Lost => return Err(Error::ServerLost),
            Stage::Idle | Stage::Sent => return Err(Error::Misuse("no step was begun")),
        }
        self.check_advance()?;
        let records = match self.company.slots() {
            0 => self.own_slots,
            _ => {
                let slots = self.transport.loaned_mut();
                if slots.len() < self.own_slots + self.company.slots() {
                    return Err(Error::Misuse("a part was attached after the batch was begun: begin it again"));
                }
                if slots.iter().take(self.own_slots).any(|record| self.company.is_attached(record.object)) {
                    let what = "a record names a part that is attached, which moves with its carrier: detach it first";
                    return Err(Error::Misuse(what));
                }
                self.company.fill(slots, self.own_slots)
            }
        };
        let o = &self.options;
        let asked = [(o.first, ASK_FIRST), (o.details, ASK_DETAILS), (o.clear, ASK_CLEAR), (o.polling, ASK_POLLING)];
        let request = StepRequest {
            version: PROTOCOL_VERSION,
            asked: asked.iter().map(|(on, bit)| if *on { *bit } else { 0 }).sum(),
            session: self.opened.session,
            epoch: self.opened.epoch,
            step: self.step + 1,
            advance: o.advance,
            dt: o.dt,
            cell_limit: o.cell_limit,
            batch_limit: o.batch_limit,
            max_records: o.max_records,
            records: records as u32,
        };
        match self.transport.send(request) {
            Ok(()) => {
                self.step += 1;
                self.stage = Stage::Sent;
                if self.transport.may_lose_server() {
                    // While the server works on it.
                    self.journal.sent(&self.transport.loaned()[..records], o.advance);
                }
                Ok(())
            }
            Err(e) => Err(self.failed(e)),
        }
    }

    /// Sends the batch if it was not yet, and waits for its answer, which is read in place.
    ///
    /// # Errors
    /// `Refused` with the index of the offending record (nothing has changed); `Timeout` (the step stays in flight:
    /// call again); `ServerLost`, `ReplyLost` and `Refused` because the session is gone (see `reconnect` and `resend`);
    /// `Misuse`; `System`.
    pub fn finish(&mut self, timeout: Duration) -> Result<Reply<'_>, Error> {
        if self.stage == Stage::Loaned {
            self.send()?;
        }
        match self.stage {
            Stage::Sent => {}
            Stage::Lost => return Err(Error::ServerLost),
            _ => return Err(Error::Misuse("no step was begun")),
        }
        match self.transport.receive(timeout) {
            Ok(()) => {}
            Err(Error::Timeout) => return Err(Error::Timeout),
            Err(e) => return Err(self.failed(e)),
        }
        let absent = || Error::System("a reply was announced that is not there".into());
        let Some((header, _)) = self.transport.reply() else { return Err(self.failed(absent())) };
        // Branched on once, so copied once.
        let (status, error, index) = (header.status, header.error, header.index);
        if status == STEP_REFUSED || error != 0 {
            let code = ErrorCode::of_number(error).unwrap_or(ErrorCode::Internal);
            let (index, detail) = self.refused_at((index != NO_INDEX).then_some(index));
            return Err(self.failed(Error::Refused { code, index, detail }));
        }
        (self.stage, self.unanswered) = (Stage::Idle, None);
        if self.transport.may_lose_server() {
            self.journal.accepted();
        }
        self.options.advance = 1.0;
        self.advanced();
        match self.transport.reply() {
            Some((header, slots)) => Ok(Reply::of(*header, slots)),
            None => Err(absent()),
        }
    }

    /// The caller's record that a refused one is, or that it was made of, and what it is about.
    fn refused_at(&self, index: Option<u32>) -> (Option<u32>, String) {
        let slots = self.transport.loaned();
        let Some(record) = index.and_then(|i| slots.get(i as usize)) else { return (index, String::new()) };
        let object = record.object;
        if index.is_none_or(|i| (i as usize) < self.own_slots) {
            return (index, format!("object id {object}"));
        }
        // What a part does is what its carrier does: its records are the carrier's, in their order.
        let root = self.company.root_of(object);
        let of = |id: u32| move |(i, r): (usize, &PoseRecord)| (r.object == id).then_some(i);
        let before = index.map_or(0, |i| i as usize);
        let nth = slots[..before].iter().enumerate().skip(self.own_slots).filter_map(of(object)).count();
        let own = slots.iter().enumerate().take(self.own_slots).filter_map(of(root)).nth(nth);
        (own.map(|i| i as u32), format!("object id {object}, which object id {root} carries"))
    }

    /// After `reconnect`: the batch that was in flight when the server was lost, loaned again with the same poses. It can be had
    /// until a batch is accepted.
    ///
    /// # Errors
    /// `Misuse` when there is none; otherwise as `begin_step`.
    pub fn resend(&mut self) -> Result<&mut [PoseRecord], Error> {
        self.check_idle()?;
        let Some(n) = self.unanswered.as_ref().map(Vec::len) else {
            return Err(Error::Misuse("no step was in flight when the server was lost"));
        };
        self.loan(n)?;
        let slots = &mut self.transport.loaned_mut()[..n];
        if let Some(batch) = &self.unanswered {
            slots.copy_from_slice(batch);
        }
        Ok(slots)
    }

    /// Notes why a step or a command failed.
    pub(super) fn failed(&mut self, error: Error) -> Error {
        // Where the reply is lost the server did what was asked, or refused it: the journal cannot tell, so the server can no
        // longer be trusted to stand where the journal does. A replay settles it.
        let lost = matches!(error, Error::ServerLost | Error::ReplyLost);
        if lost || matches!(error.code(), Some(ErrorCode::SessionGone | ErrorCode::SessionEnded)) {
            self.lose();
        } else if matches!(self.stage, Stage::Sent) {
            self.stage = Stage::Idle;
        }
        error
    }

    /// The session is no longer what the server has. The journal stands before a batch that has no answer: it is kept. One that
    /// was kept before still has none, unless another is under way.
    pub(super) fn lose(&mut self) {
        if matches!(self.stage, Stage::Loaned | Stage::Sent) {
            let loaned = self.transport.loaned();
            self.unanswered = Some(loaned[..self.own_slots.min(loaned.len())].to_vec());
        }
        self.stage = Stage::Lost;
    }
}
