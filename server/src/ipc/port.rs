//! What the server's loop needs of whatever carries requests to it and answers back: shared memory (`services`), or a test.
//!
//! A call is a request that waits for its answer. It ends when it is answered or dropped; a client whose call ended without an
//! answer knows that none comes.

use contactd_client::Error;
use contactd_proto::status::StatusRecord;
use contactd_proto::{ContactRecord, PoseRecord, StepReply, StepRequest};
use std::time::Duration;

/// The place at which requests arrive.
pub trait Port: Send + 'static {
    /// A request for a step.
    type Step: StepCall;
    /// A request with a command.
    type Command: CommandCall;
    /// The way to wake one session's client.
    type Wake: Wake;
    /// The way for the server's other threads to wake its loop.
    type Bell: Bell;

    /// The next step that is asked for, if there is one. What a client's broken connection spoils concerns that client alone.
    fn next_step(&mut self) -> Option<Self::Step>;

    /// The next command, if there is one.
    fn next_command(&mut self) -> Option<Self::Command>;

    /// Waits for a request or the bell, at most so long. False where it cannot wait at all.
    fn wait(&self, longest: Duration) -> bool;

    /// The way to wake the client of a new session.
    ///
    /// # Errors
    /// `System`.
    fn wake_of(&self, session: u64) -> Result<Self::Wake, Error>;

    /// Why the last reply that could not be written was lost: a sentence, once.
    fn trouble(&self) -> Option<String>;

    /// Shows the server's state.
    fn show(&mut self, status: StatusRecord);

    /// Frees what processes that have died still hold.
    fn sweep_dead(&self);
}

/// A request for a step.
pub trait StepCall: Send + 'static {
    /// A reply that is written and not yet sent.
    type Reply;

    /// A copy of its header: the client could write to it while it is read.
    fn request(&self) -> StepRequest;

    /// The poses that came with it.
    fn records(&self) -> &[PoseRecord];

    /// Writes a reply of `n` slots, made one by one; `None` where there is no room for them.
    fn write(&self, n: usize, reply: StepReply, slot: &dyn Fn(usize) -> ContactRecord) -> Option<Self::Reply>;

    /// Sends a reply, if there is one, and ends the call. One that cannot be delivered is dropped.
    fn send(self, reply: Option<Self::Reply>);
}

/// A request with a command.
pub trait CommandCall: Send + 'static {
    /// The version of the protocol that its client speaks.
    fn version(&self) -> u32;

    /// The command's bytes.
    fn bytes(&self) -> &[u8];

    /// Sends the answer's bytes and ends the call.
    fn send(self, bytes: &[u8]);
}

/// The way to wake the client of a session.
pub trait Wake: Send + Sync + 'static {
    /// Wakes it.
    fn notify(&self);

    /// True while the client listens: from soon after the session was opened until the client leaves it.
    fn is_heard(&self) -> bool;
}

/// The way to wake the server's loop.
pub trait Bell: Send + Sync + 'static {
    /// Rings it. Where it does not ring the loop looks by itself before long.
    fn ring(&self);
}
