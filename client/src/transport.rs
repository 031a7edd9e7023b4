//! What a session needs of whatever carries its requests: shared memory, or an engine in the same process.

use crate::Error;
use contactd_proto::control::{Answer, Command};
use contactd_proto::{ContactRecord, PoseRecord, StepReply, StepRequest};
use std::time::Duration;

/// What the server said when it opened the session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Opened {
    /// Session id.
    pub session: u64,
    /// Epoch of the server.
    pub epoch: u64,
    /// Most records in a batch.
    pub max_batch: u32,
}

/// A way to a server. One request is under way at a time.
pub trait Transport {
    /// True when the other side can die while this one lives: then the session keeps a journal for its replay.
    fn may_lose_server(&self) -> bool;

    /// Opens a session, on the server of now.
    ///
    /// # Errors
    /// `NoServer`, `Version`, `Refused`, `System`.
    fn open(&mut self) -> Result<Opened, Error>;

    /// Sends a command and waits for its answer.
    ///
    /// # Errors
    /// `ServerLost`, `ReplyLost`, `Timeout`, `System`; a refusal is an answer, not an error.
    fn command(&mut self, command: Command, timeout: Duration) -> Result<Answer, Error>;

    /// Slots for the poses of the next step, all zero.
    ///
    /// # Errors
    /// `System` when memory runs out.
    fn loan(&mut self, records: usize) -> Result<&mut [PoseRecord], Error>;

    /// The slots of the last `loan` until its reply has been received and the next is loaned.
    fn loaned(&self) -> &[PoseRecord];

    /// The same, to be written until they are sent.
    fn loaned_mut(&mut self) -> &mut [PoseRecord];

    /// Sends the loaned slots.
    ///
    /// # Errors
    /// `ServerLost`, `System`, `Misuse` when nothing was loaned.
    fn send(&mut self, request: StepRequest) -> Result<(), Error>;

    /// Waits for the reply.
    ///
    /// # Errors
    /// `Timeout` (the step stays in flight), `ServerLost`, `ReplyLost`, `System`.
    fn receive(&mut self, timeout: Duration) -> Result<(), Error>;

    /// The reply that was received, in place: header and slots.
    fn reply(&self) -> Option<(&StepReply, &[ContactRecord])>;

    /// The session is over without having been closed: tells the other side, if there is one, without waiting long.
    fn leave(&mut self) {}
}

/// Whatever carries a session chosen at run time: one type of session for callers that cannot be generic (C, Python).
impl<T: Transport + ?Sized> Transport for Box<T> {
    fn may_lose_server(&self) -> bool {
        (**self).may_lose_server()
    }

    fn open(&mut self) -> Result<Opened, Error> {
        (**self).open()
    }

    fn command(&mut self, command: Command, timeout: Duration) -> Result<Answer, Error> {
        (**self).command(command, timeout)
    }

    fn loan(&mut self, records: usize) -> Result<&mut [PoseRecord], Error> {
        (**self).loan(records)
    }

    fn loaned(&self) -> &[PoseRecord] {
        (**self).loaned()
    }

    fn loaned_mut(&mut self) -> &mut [PoseRecord] {
        (**self).loaned_mut()
    }

    fn send(&mut self, request: StepRequest) -> Result<(), Error> {
        (**self).send(request)
    }

    fn receive(&mut self, timeout: Duration) -> Result<(), Error> {
        (**self).receive(timeout)
    }

    fn reply(&self) -> Option<(&StepReply, &[ContactRecord])> {
        (**self).reply()
    }

    fn leave(&mut self) {
        (**self).leave();
    }
}
