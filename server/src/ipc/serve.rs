//! A server: its place, its services over shared memory, its loop (`lead`), and the signals that end it.

use super::config::ServerConfig;
use super::lead::{self, Lead};
use super::root::{Root, RootError};
use super::services::Services;
use crate::http::Listening;
use crate::metrics;
use contactd_client::Error;
use contactd_proto::names::Address;
use std::fmt;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Why a server does not run. `Debug` prints the sentence, too: it is what a `main` that returns one ends with.
#[derive(thiserror::Error)]
pub enum ServeError {
    /// It has no place.
    #[error(transparent)]
    Root(#[from] RootError),
    /// A thread cannot be started.
    #[error("expected to start threads, found: {0}")]
    Threads(String),
    /// Its steps cannot be recorded, as its settings ask for.
    #[error("{0}")]
    Recording(crate::world::Refusal),
    /// Its metrics cannot be told where its settings say.
    #[error("metrics: {0}")]
    Metrics(String),
    /// Shared memory failed.
    #[error("{0}")]
    System(Error),
}

impl fmt::Debug for ServeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl From<Error> for ServeError {
    fn from(e: Error) -> Self {
        Self::System(e)
    }
}

/// A server that holds its place and has created its services.
pub struct Server {
    lead: Option<Box<Lead<Services>>>,
    metrics: Option<SocketAddr>,
    /// Its place, given back last.
    _root: Root,
}

impl Server {
    /// Takes the place, creates the services, and tells clients.
    ///
    /// # Errors
    /// Another server of the name runs; folders are not private; shared memory fails; no threads can be started; its steps cannot be
    /// recorded or its metrics told, as its settings ask for.
    pub fn start(address: &Address, config: ServerConfig) -> Result<Self, ServeError> {
        let root = Root::take(address)?;
        let metrics = config.metrics.map(Listening::on).transpose().map_err(ServeError::Metrics)?;
        let file = |folder: &std::path::PathBuf| folder.join(format!("{}-{:016x}.mcap", address.name(), root.epoch()));
        let recording = config.record.as_ref().map(file);
        ready_threads().map_err(ServeError::Threads)?;
        let (services, bell) =
            Services::create(address, root.epoch(), &config, lead::status(root.epoch(), &config, 0, 0))?;
        let mut lead = Lead::new(config, root.epoch(), services, bell);
        if let Some(path) = recording {
            lead.record_all(path.display().to_string()).map_err(ServeError::Recording)?;
        }
        root.publish()?;
        let told = metrics.as_ref().map(Listening::address);
        if let Some(listening) = metrics {
            metrics::tell(address, listening);
        }
        Ok(Self { lead: Some(Box::new(lead)), metrics: told, _root: root })
    }

    /// Where its metrics are told, if its settings ask for them.
    pub fn metrics(&self) -> Option<SocketAddr> {
        self.metrics
    }

    /// Tells, in a line on standard error, when `hangup` was set.
    fn hears(&mut self, hangup: Arc<AtomicBool>) {
        if let Some(lead) = &mut self.lead {
            lead.hangup = hangup;
        }
    }

    /// Tells the service manager that started this process, if one did, that clients can connect; and then of the loop.
    fn tells_manager(&mut self) {
        if let Some(lead) = &mut self.lead {
            lead.tells_manager();
        }
    }

    /// Serves until `stop` is set, and the steps that were asked for before are answered.
    pub fn run(&mut self, stop: &AtomicBool) {
        if let Some(lead) = self.lead.take() {
            self.lead = lead::run(lead, stop);
        }
    }
}

/// Starts the threads that steps share, unless the program has started them.
///
/// # Errors
/// Why they cannot be started.
pub fn ready_threads() -> Result<(), String> {
    use std::error::Error as _;
    match rayon::ThreadPoolBuilder::new().build_global() {
        // Without a cause it is that there are some already.
        Err(e) if e.source().is_some() => Err(e.to_string()),
        _ => Ok(()),
    }
}

/// Serves until SIGINT or SIGTERM; calls `ready` once clients can connect. Steps that were asked for before the signal are
/// answered. SIGHUP, which a terminal sends that is closed, is a line on standard error.
///
/// A service manager that speaks systemd's protocol (`NOTIFY_SOCKET`, `WATCHDOG_USEC`) is told when clients can connect, that the
/// loop goes round, and that the server stops.
///
/// # Errors
/// As `Server::start`.
pub fn serve(address: &Address, config: ServerConfig, ready: impl FnOnce(&Server)) -> Result<(), ServeError> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, stop.clone())
            .map_err(|e| ServeError::System(Error::System(format!("signal handler: {e}"))))?;
    }
    let hangup = Arc::new(AtomicBool::new(false));
    signal_hook::flag::register(signal_hook::consts::SIGHUP, hangup.clone())
        .map_err(|e| ServeError::System(Error::System(format!("signal handler: {e}"))))?;
    // A file that may not become larger (`ulimit -f`) would end the process by SIGXFSZ; heard and left at that, the write fails instead.
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default())
        .map_err(|e| ServeError::System(Error::System(format!("signal handler: {e}"))))?;
    let mut server = Server::start(address, config)?;
    server.hears(hangup);
    ready(&server);
    server.tells_manager();
    server.run(&stop);
    Ok(())
}
