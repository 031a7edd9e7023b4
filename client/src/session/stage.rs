//! Where a session's step is.

/// Where the step under way is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stage {
    /// None is under way.
    Idle,
    /// Its slots are lent to the caller.
    Loaned,
    /// It was sent, and its answer was not received yet.
    Sent,
    /// The server is gone, or does not have the session that this client knows: reconnect first.
    Lost,
}
