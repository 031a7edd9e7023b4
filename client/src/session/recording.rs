//! Steps that are kept in files: what a session records, and its last step as a scene.

use super::{Session, unexpected};
use crate::{Error, Transport};
use contactd_proto::control::{Answer, Command, RecordingOrder, RecordingStatus};
use std::path::{Path, PathBuf};

impl<T: Transport> Session<T> {
    /// Records the session's steps from now on into a new MCAP file (docs/record.md), until `stop_recording` or the end of the
    /// session. `contactd replay` repeats it, bit for bit. A recorder that cannot keep up leaves out whole steps and counts them: no
    /// step waits for it. The file is written by the process that runs the engine; a server that is lost takes the recording along,
    /// and what was written can be read.
    ///
    /// # Errors
    /// `Refused` (`Recording`): the session is being recorded already, the server has a deadline, with which answers depend on time, the
    /// file exists or cannot be made; `ServerLost`, `ReplyLost`, `Timeout`, `System`.
    pub fn record(&mut self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = whole(path.as_ref())?;
        self.done(Command::Record(RecordingOrder { path, session: None, process: (0, 0) }))
    }

    /// What was recorded so far.
    ///
    /// # Errors
    /// `Refused` (`Recording`) where `record` was not called, or the recording was stopped; `ServerLost`, `ReplyLost`, `Timeout`,
    /// `System`.
    pub fn recording(&mut self) -> Result<RecordingStatus, Error> {
        self.recorded(false)
    }

    /// Ends the recording: the file is complete when this returns.
    ///
    /// # Errors
    /// As `recording`. A recording that failed is no error: its `failure` says why.
    pub fn stop_recording(&mut self) -> Result<RecordingStatus, Error> {
        self.recorded(true)
    }

    /// Writes the last step as a scene in a new folder, for `contactd check FOLDER/scene.toml`: models, objects with their motions,
    /// rules, resolution. Returns the path of the scene.
    ///
    /// # Errors
    /// `Refused` (`Recording`): the folder exists or cannot be written, or what a scene cannot say; `ServerLost`, `ReplyLost`,
    /// `Timeout`, `System`.
    pub fn save_step(&mut self, folder: impl AsRef<Path>) -> Result<PathBuf, Error> {
        let folder = whole(folder.as_ref())?;
        self.done(Command::SaveStep(folder.clone()))?;
        Ok(Path::new(&folder).join("scene.toml"))
    }

    fn recorded(&mut self, stop: bool) -> Result<RecordingStatus, Error> {
        match self.command(Command::Recording { stop })? {
            Answer::Recorded(status) => Ok(status),
            other => Err(unexpected(&other)),
        }
    }
}

/// A path as another process understands it.
fn whole(path: &Path) -> Result<String, Error> {
    let found =
        |what: &dyn std::fmt::Display| Error::System(format!("expected a path, found {}: {what}", path.display()));
    let whole = std::path::absolute(path).map_err(|e| found(&e))?;
    whole.into_os_string().into_string().map_err(|_| found(&"it is not in UTF-8"))
}
