//! What an operator sees: the servers of this user, their sessions and steps, as text of 80 columns or as JSON.
//!
//! A server tells what it counts anyway; memory is read from the system by who asks.
//!
//! Floor 10: imports `terminal`.

use crate::metrics::memory;
use crate::terminal::{Paint, Role, number, sentence};
use contactd_client::Error;
use contactd_client::shm::operator;
use contactd_proto::control::{LatestSteps, RecordingStatus, ServerStatus, SessionStatus};
use contactd_proto::names::Address;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How long a server may take to answer: its loop answers within milliseconds.
const PATIENCE: Duration = Duration::from_secs(5);

/// What is known of servers; `--json` prints it.
#[derive(Debug, Serialize)]
pub struct Servers {
    /// One for each.
    pub servers: Vec<Server>,
}

/// A server that has a folder.
#[derive(Debug, Serialize)]
#[allow(missing_docs)]
pub struct Server {
    pub name: String,
    /// "running"; "starting"; "left behind", where its process has gone and its folder has not; "silent", with the reason.
    pub state: &'static str,
    /// Why it says nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Its process, or the one that left its folder.
    pub pid: Option<u32>,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub running: Option<Running>,
}

/// What a running server says.
#[derive(Debug, Serialize)]
#[allow(missing_docs)]
pub struct Running {
    pub uptime_s: f64,
    pub sessions: Vec<Session>,
    pub objects: u64,
    pub models: u32,
    pub steps: u64,
    pub undecided: u64,
    pub steps_per_second: f64,
    pub last_minute: LastMinute,
    /// Bytes of its processes' pages in memory, shared ones too; null where its process is not visible.
    pub memory_bytes: Option<u64>,
}

/// The steps of the last minute. Times are null without a step.
#[derive(Debug, Serialize)]
#[allow(missing_docs)]
pub struct LastMinute {
    pub seconds: f64,
    pub steps: u64,
    pub p50_ms: Option<f64>,
    pub p99_ms: Option<f64>,
    pub p999_ms: Option<f64>,
    pub largest_ms: Option<f64>,
}

/// A session.
#[derive(Debug, Serialize)]
#[allow(missing_docs)]
pub struct Session {
    pub id: u64,
    /// Its client's process.
    pub pid: u32,
    pub open_s: f64,
    pub idle_s: f64,
    pub objects: u32,
    pub models: u32,
    pub steps: u64,
    pub undecided: u64,
    pub busy: bool,
}

/// All servers of this user, or the one that has a name.
///
/// # Errors
/// The name or the runtime folder is not usable; no server of the name runs or has left its folder.
pub fn servers(name: Option<&str>) -> Result<Servers, Error> {
    let some = Address::of(name.unwrap_or(contactd_proto::names::DEFAULT_NAME)).map_err(Error::Address)?;
    let addresses = match name {
        Some(_) if some.folder().is_dir() => vec![some],
        Some(name) => return Err(Error::NoServer(name.into())),
        None => some.beside(),
    };
    let found: Vec<Server> = std::thread::scope(|scope| {
        // One that does not answer keeps none of the others waiting.
        let asked: Vec<_> = addresses.iter().map(|address| scope.spawn(|| look(address))).collect();
        asked.into_iter().filter_map(|thread| thread.join().ok()).collect()
    });
    Ok(Servers { servers: found })
}

/// Ends a session of the server of that name.
///
/// # Errors
/// There is no such server or session; it does not answer.
pub fn end_session(name: &str, session: u64) -> Result<(), Error> {
    operator::end_session(&Address::of(name).map_err(Error::Address)?, session, PATIENCE)
}

/// A recording that a server makes for this process, until it ends.
#[derive(Debug)]
pub struct Recording {
    address: Address,
    path: String,
    stop: Arc<AtomicBool>,
}

/// How often a recording is looked at.
const LOOK: Duration = Duration::from_millis(100);

impl Recording {
    /// Has the server of that name record into a new file, from one session or from all. From here on SIGINT and SIGTERM end it.
    ///
    /// # Errors
    /// There is no such server or session; it records already, or refuses to.
    pub fn start(name: &str, file: &Path, session: Option<u64>) -> Result<Self, Error> {
        let stop = Arc::new(AtomicBool::new(false));
        for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
            signal_hook::flag::register(signal, stop.clone())
                .map_err(|e| Error::System(format!("signal handler: {e}")))?;
        }
        Ok(Self { stop, ..Self::begin(name, file, session)? })
    }

    /// The same without a word about signals: it ends with this process, however that ends.
    ///
    /// # Errors
    /// As `start`.
    pub fn begin(name: &str, file: &Path, session: Option<u64>) -> Result<Self, Error> {
        let address = Address::of(name).map_err(Error::Address)?;
        let path = std::path::absolute(file).map_err(|e| Error::System(format!("{}: {e}", file.display())))?;
        let path = path.display().to_string();
        operator::record(&address, &path, session, PATIENCE)?;
        Ok(Self { address, path, stop: Arc::default() })
    }

    /// Whether it still goes on.
    ///
    /// # Errors
    /// The server has gone, or the recording has failed.
    pub fn look(&self) -> Result<(), Error> {
        let status = self.asked(false)?;
        if status.failure.is_empty() { Ok(()) } else { Err(Error::System(status.failure)) }
    }

    /// Ends it.
    ///
    /// # Errors
    /// The server has gone.
    pub fn end(&self) -> Result<(), Error> {
        self.asked(true).map(|_| ())
    }

    /// Waits until it is stopped, for so long, or until it cannot go on; what was recorded, as a line.
    ///
    /// # Errors
    /// The server has gone, or the recording has failed.
    pub fn run(self, longest: Option<Duration>) -> Result<String, Error> {
        let began = Instant::now();
        let is_over = || self.stop.load(Ordering::Relaxed) || longest.is_some_and(|longest| began.elapsed() >= longest);
        let mut looked = Instant::now();
        while !is_over() {
            std::thread::sleep(LOOK.min(Duration::from_millis(10)));
            if looked.elapsed() < LOOK {
                continue;
            }
            looked = Instant::now();
            let status = self.asked(false)?;
            if !status.failure.is_empty() {
                break;
            }
        }
        let RecordingStatus { steps, dropped, without_picture, bytes, failure, .. } = self.asked(true)?;
        if !failure.is_empty() {
            return Err(Error::System(format!("{failure}; it can be read up to there")));
        }
        let mut out = format!("{}: {steps} steps, {dropped} left out, {bytes} bytes\n", self.path);
        if without_picture > 0 {
            let _ = writeln!(out, "{without_picture} of them without a picture");
        }
        Ok(out)
    }

    fn asked(&self, stop: bool) -> Result<RecordingStatus, Error> {
        operator::recording(&self.address, stop, STOPPED).map_err(|e| match e {
            Error::ServerLost | Error::NoServer(_) => {
                Error::System(format!("the server has ended; {} can be read up to there", self.path))
            }
            other => other,
        })
    }
}

/// How long a file may take to be complete.
const STOPPED: Duration = Duration::from_secs(60);

fn look(address: &Address) -> Server {
    let name = address.name().to_owned();
    let pid = address.current().map(|now| now.pid);
    let bare = |state, reason| Server { name: name.clone(), state, reason, pid, running: None };
    match operator::status(address, PATIENCE) {
        Ok(status) => Server { pid: Some(status.pid), running: Some(Running::of(&status)), ..bare("running", None) },
        Err(Error::NoServer(_) | Error::ServerLost) if operator::is_held(address) => bare("starting", None),
        Err(Error::NoServer(_) | Error::ServerLost) => bare("left behind", None),
        Err(Error::Timeout) => bare("silent", Some(format!("it has not answered within {} s", PATIENCE.as_secs()))),
        Err(e) => bare("silent", Some(e.to_string())),
    }
}

fn seconds(ms: u64) -> f64 {
    ms as f64 / 1e3
}

impl Running {
    fn of(status: &ServerStatus) -> Self {
        let latest = &status.latest;
        // A server that has just begun has no rate yet.
        let rate = if latest.window_ms > 0 { latest.steps as f64 / seconds(latest.window_ms) } else { 0.0 };
        Self {
            uptime_s: seconds(status.uptime_ms),
            sessions: status.sessions.iter().map(Session::of).collect(),
            objects: status.sessions.iter().map(|s| u64::from(s.objects)).sum(),
            models: status.models,
            steps: status.steps,
            undecided: status.undecided,
            steps_per_second: rate,
            last_minute: LastMinute::of(latest),
            memory_bytes: memory(status.pid),
        }
    }
}

impl LastMinute {
    fn of(latest: &LatestSteps) -> Self {
        let ms = |ns: u64| (latest.steps > 0).then_some(ns as f64 / 1e6);
        Self {
            seconds: seconds(latest.window_ms),
            steps: latest.steps,
            p50_ms: ms(latest.p50_ns),
            p99_ms: ms(latest.p99_ns),
            p999_ms: ms(latest.p999_ns),
            largest_ms: ms(latest.largest_ns),
        }
    }
}

impl Session {
    fn of(s: &SessionStatus) -> Self {
        Self {
            id: s.id,
            pid: s.process,
            open_s: seconds(s.open_ms),
            idle_s: seconds(s.idle_ms),
            objects: s.objects,
            models: s.models,
            steps: s.steps,
            undecided: s.undecided,
            busy: s.is_busy,
        }
    }
}

impl Servers {
    /// One line of JSON.
    ///
    /// # Errors
    /// None: all numbers are finite.
    pub fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string(self)
    }

    /// A block for each server.
    pub fn text(&self, paint: Paint) -> String {
        if self.servers.is_empty() {
            return "no server is running: start one with `contactd serve`\n".into();
        }
        self.servers.iter().map(|server| server.text(paint)).collect::<Vec<_>>().join("\n")
    }
}

impl Server {
    fn text(&self, paint: Paint) -> String {
        // What is folded is not coloured: an escape has no columns.
        let plain = self.name.as_str();
        let name = paint.mark(Role::Heading, plain);
        let process = self.pid.map_or_else(|| "an unknown process".into(), |pid| format!("process {pid}"));
        match (&self.running, &self.reason) {
            (Some(running), _) => running.text(&format!("{name}: {process}"), paint),
            (None, Some(reason)) => sentence(&format!("{plain}: "), &format!("{process} says nothing: {reason}")),
            (None, None) if self.state == "starting" => format!("{name}: is starting or stopping\n"),
            (None, None) => {
                let gone = format!("{process} has gone and left its folder, which");
                sentence(
                    &format!("{plain}: "),
                    &format!("not running; {gone} `contactd serve --name {plain}` takes over"),
                )
            }
        }
    }
}

/// "1 session", "2 sessions".
fn many(n: u64, one: &str) -> String {
    format!("{n} {one}{}", if n == 1 { "" } else { "s" })
}

impl Running {
    fn text(&self, head: &str, paint: Paint) -> String {
        let memory = self.memory_bytes.map(|b| format!("; {} MB of memory", number(b as f64 / 1e6, 0.1, 6)));
        let mut out = format!("{head}, up {}\n", duration(self.uptime_s));
        let _ = writeln!(
            out,
            "    {}, {}, {}{}",
            many(self.sessions.len() as u64, "session"),
            many(self.objects, "object"),
            many(self.models.into(), "model"),
            memory.unwrap_or_default()
        );
        let mut undecided = format!("{} undecided", self.undecided);
        if self.undecided > 0 {
            undecided = paint.mark(Role::Undecided, &undecided);
        }
        let _ = writeln!(out, "    {} since its start, {undecided}", many(self.steps, "step"));
        let m = &self.last_minute;
        let ms = |x: f64| number(x, 1e-4, 3);
        let _ = match (m.p50_ms, m.p99_ms, m.p999_ms, m.largest_ms) {
            (Some(p50), Some(p99), Some(p999), Some(largest)) => writeln!(
                out,
                "    last {}: {} steps a second\n    p50 {} ms, p99 {} ms, p99.9 {} ms, largest {} ms",
                duration(m.seconds),
                number(self.steps_per_second, 0.01, 4),
                ms(p50),
                ms(p99),
                ms(p999),
                ms(largest)
            ),
            _ => writeln!(out, "    last {}: no step", duration(m.seconds)),
        };
        if !self.sessions.is_empty() {
            let head = format!(
                "    {:>7} {:>8} {:>9} {:>9} {:>7} {:>6} {:>9} {:>9}",
                "session", "client", "open", "idle", "objects", "models", "steps", "undecided"
            );
            let _ = writeln!(out, "{}", paint.mark(Role::Faint, &head));
        }
        for s in &self.sessions {
            let idle = if s.busy { "busy".into() } else { duration(s.idle_s) };
            let _ = writeln!(
                out,
                "    {:>7} {:>8} {:>9} {idle:>9} {:>7} {:>6} {:>9} {:>9}",
                s.id,
                s.pid,
                duration(s.open_s),
                s.objects,
                s.models,
                s.steps,
                s.undecided
            );
        }
        out
    }
}

/// A time in the unit that suits it: at most nine characters.
fn duration(seconds: f64) -> String {
    let whole = seconds as u64;
    match whole {
        0..60 => format!("{} s", number(seconds, 0.1, 3)),
        60..3600 => format!("{} min", whole / 60),
        3600..86400 => format!("{}h {}min", whole / 3600, whole / 60 % 60),
        _ => format!("{}d {}h", whole / 86400, whole / 3600 % 24),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn times_are_told_in_the_unit_that_suits_them() {
        for (seconds, text) in
            [(0.0, "0 s"), (0.25, "0.2 s"), (12.0, "12 s"), (61.0, "1 min"), (7300.0, "2h 1min"), (200_000.0, "2d 7h")]
        {
            assert_eq!(duration(seconds), text);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn what_a_server_says_fits_80_columns(
            (steps, uptime_ms, ns) in (0u64..1_000_000_000, 0u64..100_000_000_000, 1u64..100_000_000_000),
            sessions in proptest::collection::vec((0u64..100_000, 0u32..4_194_304, 0u32..1_048_577, 0u32..10_000), 0..4),
            name in "[a-z0-9_-]{1,32}",
        ) {
            let session = |(id, process, objects, models)| {
                SessionStatus { id, process, objects, models, steps, undecided: steps, open_ms: uptime_ms, ..SessionStatus::default() }
            };
            let latest = LatestSteps { window_ms: uptime_ms.min(60_000), steps, p50_ns: ns, p99_ns: ns, p999_ns: ns, largest_ns: ns };
            let sessions = sessions.into_iter().map(session).collect();
            let status = ServerStatus { pid: 4_194_303, uptime_ms, sessions, models: 9, steps, undecided: steps, latest };
            let server = |state, running| Server { name: name.clone(), state, reason: None, pid: Some(4_194_303), running };
            let servers = vec![server("running", Some(Running::of(&status))), server("left behind", None), server("starting", None)];
            let text = Servers { servers }.text(Paint::default());
            for line in text.lines() {
                prop_assert!(line.chars().count() <= 80, "{} columns: {line}", line.chars().count());
            }
        }
    }
}
