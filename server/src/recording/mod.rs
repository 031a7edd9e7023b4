//! Recordings: a session's steps in an MCAP file, with all that it takes to repeat them (docs/record.md).
//!
//! A session has a `Tap`, which hands each accepted command and each step on to a `Recorder`: a bounded queue and a thread that
//! writes. The tap never waits. Where the queue is full whole steps are left out and counted, and the next one that is taken
//! begins with an `Opening`: the session as it stands, from which it can be repeated without what came before. `file` reads a
//! recording up to its end, or to where it was cut. `scene` writes one step as a scene folder, `view` follows a session and makes what
//! viewers draw of it, in the messages of `foxglove`.
//!
//! Floor 9: imports `import`, `world` and below.

mod content;
mod file;
mod foxglove;
mod message;
mod queue;
mod scene;
mod view;
mod writer;

pub use content::{Content, Key, Part};
pub use file::{Entry, FileError, Recording};
pub use foxglove::schemas;
pub use message::{About, Change, FORMAT, Opening, StepMessage, topic};
pub use queue::{LIMIT, Recorder, Tap};
pub use scene::{SceneFolder, Standing};

/// An error of the library's in one sentence: of a disk that is full its cause says what it is, and the causes of records that do not
/// fit their kind are pictures of several lines.
fn with_cause(error: &mcap::McapError) -> String {
    if let mcap::McapError::Io(cause) = error {
        return cause.to_string();
    }
    match std::error::Error::source(error).map(ToString::to_string) {
        Some(cause) if !cause.trim().contains('\n') => format!("{error}: {}", cause.trim()),
        _ => error.to_string().lines().next().unwrap_or_default().to_owned(),
    }
}
