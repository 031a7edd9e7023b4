//! What an operator asks of servers: what they are doing, and to end a session.

use super::control::{self, Control};
use crate::Error;
use contactd_proto::ErrorCode;
use contactd_proto::control::{Answer, Command, RecordingOrder, RecordingStatus, ServerStatus};
use contactd_proto::names::{Address, start_of_process};
use std::time::Duration;

/// What the server at `address` says of its sessions and steps. It answers from what it has counted: no step waits for it.
///
/// # Errors
/// `NoServer`, `Address`, `Version`, `Refused` (an older server), `ServerLost`, `Timeout`, `System`.
pub fn status(address: &Address, timeout: Duration) -> Result<ServerStatus, Error> {
    match ask(address, Command::Status, timeout)? {
        Answer::Status(status) => Ok(status),
        other => Err(unexpected(other)),
    }
}

/// Ends a session of the server at `address`, whoever's it is. Its client is told when it asks next, or by the answer that it waits
/// for.
///
/// # Errors
/// As `status`; `Refused` with `SessionGone` where there is no such session.
pub fn end_session(address: &Address, session: u64, timeout: Duration) -> Result<(), Error> {
    match ask(address, Command::EndSession(session), timeout)? {
        Answer::Done => Ok(()),
        other => Err(unexpected(other)),
    }
}

/// Has the server at `address` record steps into a new file (its whole path), of one session or of all, until this process ends or
/// `recording` stops it.
///
/// # Errors
/// As `status`; `Refused`: there is no such session (`SessionGone`); it records already, has a deadline, the file exists or cannot be
/// made (`Recording`).
pub fn record(address: &Address, path: &str, session: Option<u64>, timeout: Duration) -> Result<(), Error> {
    let pid = std::process::id();
    let process = (pid, start_of_process(pid).unwrap_or(0));
    match ask(address, Command::Record(RecordingOrder { path: path.into(), session, process }), timeout)? {
        Answer::Done => Ok(()),
        other => Err(unexpected(other)),
    }
}

/// What was recorded by what `record` began; with `stop` it ends, and its file is complete.
///
/// # Errors
/// As `status`; `Refused` with `Recording` where nothing is recorded.
pub fn recording(address: &Address, stop: bool, timeout: Duration) -> Result<RecordingStatus, Error> {
    match ask(address, Command::Recording { stop }, timeout)? {
        Answer::Recorded(status) => Ok(status),
        other => Err(unexpected(other)),
    }
}

/// True when a process holds the place of the server at `address`: it serves, or is about to.
pub fn is_held(address: &Address) -> bool {
    control::is_locked(address)
}

fn ask(address: &Address, command: Command, timeout: Duration) -> Result<Answer, Error> {
    // A wake-up is the client's of a session; who has none looks again and again.
    let wait = |time: Duration| std::thread::sleep(time.min(Duration::from_millis(1)));
    Control::with(address, Ok)?.command(0, command, timeout, wait)
}

fn unexpected(answer: Answer) -> Error {
    match answer {
        Answer::Refused { code, detail, .. } => {
            let code = ErrorCode::of_number(code).unwrap_or(ErrorCode::Internal);
            Error::Refused { code, index: None, detail }
        }
        other => Error::System(format!("the server gave an answer that does not belong to the command: {other:?}")),
    }
}
