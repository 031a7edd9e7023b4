//! What can go wrong, each with one sentence.

use crate::solid::BuildError;
use contactd_proto::ErrorCode;
use contactd_proto::names::AddressError;
use std::fmt;

/// Why a call of a session failed. `Debug` prints the sentence, too: a `main` that returns one ends with what a user can read.
#[derive(Clone, PartialEq)]
pub enum Error {
    /// The server refused; nothing has changed there.
    Refused {
        /// The stable code.
        code: ErrorCode,
        /// Index of the offending record, rule or track.
        index: Option<u32>,
        /// What exactly was wrong, when there is more to say than the code's sentence.
        detail: String,
    },
    /// No server of this name is running.
    NoServer(String),
    /// The server died or was stopped, or the session on it was lost. `reconnect` finds a server and replays the session.
    ServerLost,
    /// The server could not deliver its reply, since this client did not take earlier ones. What was asked was done, or refused:
    /// `reconnect` goes back to before it, then it is to be sent again (`resend`, for a step).
    ReplyLost,
    /// The time ran out. A step stays in flight: `finish` may be called again. What a command asked for may be done yet: `reconnect`
    /// goes back to before it.
    Timeout,
    /// The name or the runtime folder is not usable.
    Address(AddressError),
    /// The server speaks other protocol versions than this client.
    Version {
        /// Oldest version that the server speaks.
        min: u32,
        /// Newest version that the server speaks.
        max: u32,
    },
    /// A solid that was built makes no sense.
    Build(BuildError),
    /// Calls came in an order that makes no sense.
    Misuse(&'static str),
    /// The system or the shared memory layer failed.
    System(String),
}

impl Error {
    /// A refusal without index or detail.
    pub fn refused(code: ErrorCode) -> Self {
        Self::Refused { code, index: None, detail: String::new() }
    }

    /// The stable code of a refusal.
    pub fn code(&self) -> Option<ErrorCode> {
        match self {
            Self::Refused { code, .. } => Some(*code),
            Self::Version { .. } => Some(ErrorCode::Version),
            _ => None,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused { code, index, detail } => {
                if let Some(index) = index {
                    write!(f, "index {index}: ")?;
                }
                write!(f, "{code}")?;
                if detail.is_empty() { Ok(()) } else { write!(f, ": {detail}") }
            }
            Self::NoServer(name) => {
                write!(f, "no server called \"{name}\" is running: start it with `contactd serve --name {name}`")
            }
            Self::ServerLost => f.write_str("the server is gone, or the session on it; reconnect to replay it"),
            Self::ReplyLost => {
                f.write_str("the server could not deliver its reply; reconnect, and send the step or command again")
            }
            Self::Timeout => f.write_str("the server has not answered in time; the request is still in flight"),
            Self::Address(e) => write!(f, "{e}"),
            Self::Version { min, max } => write!(
                f,
                "the server speaks protocol versions {min} to {max}, this client version {}",
                contactd_proto::names::PROTOCOL_VERSION
            ),
            Self::Build(e) => write!(f, "{e}"),
            Self::Misuse(what) => f.write_str(what),
            Self::System(what) => f.write_str(what),
        }
    }
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Error {}

impl From<BuildError> for Error {
    fn from(e: BuildError) -> Self {
        Self::Build(e)
    }
}

impl From<AddressError> for Error {
    fn from(e: AddressError) -> Self {
        Self::Address(e)
    }
}
