//! `contactd demo`: a server process and this one as its client, on real parts.
//!
//! The server is this same program, started as `serve` under a name of its own; every step goes through shared memory and
//! back. Without a program the same script runs on an engine in this process, with the same bits. Whatever ends the demo,
//! the server is stopped and waited for, so that nothing stays behind.
//!
//! Floor 12, below the command line only: may import everything else.

mod play;
pub mod scene;
pub mod script;
mod show;
mod table;

pub use play::{Row, Run, play};
pub use show::show;
pub use table::{chosen, csv};

use crate::ipc::{CacheFolder, ServerConfig};
use crate::report::TableStyle;
use contactd_client::Session;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::ffi::OsString;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// How long the server may take to start, and to stop.
const PATIENCE: Duration = Duration::from_secs(20);

/// How a program that is `contactd` is started again.
#[derive(Clone, Debug)]
pub struct Program {
    /// What is executed.
    pub path: PathBuf,
    /// What stands before the command's own arguments.
    pub arguments: Vec<OsString>,
}

/// Runs the demo and returns what it prints; contacts in full go to `csv_file` when there is one. Its models are kept in
/// `cache`. `server`: what is started as the server; `None` for the engine in this process.
///
/// # Errors
/// One sentence.
pub fn run(
    server: Option<&Program>,
    csv_file: Option<&Path>,
    cache: &CacheFolder,
    style: &TableStyle,
) -> Result<(String, Run), String> {
    let acts = script::acts();
    let total: usize = acts.iter().map(|a| a.steps).sum();
    let bar = ProgressBar::with_draw_target(Some(total as u64), ProgressDrawTarget::stderr_with_hz(10));
    let template = "{msg:24} [{bar:24}] {pos}/{len} steps, {elapsed}";
    bar.set_style(ProgressStyle::with_template(template).map_err(|e| e.to_string())?.progress_chars("=> "));
    let progress = |act: &script::Act, step: usize| {
        bar.set_message(act.title);
        bar.set_position(step as u64);
    };
    let failed = |e: contactd_client::Error| format!("demo: {e}");
    let (run, way) = match server {
        None => {
            let config = ServerConfig { cache: cache.clone(), ..ServerConfig::default() };
            let mut session = crate::ipc::embedded(&config).map_err(failed)?;
            (play(&mut session, progress).map_err(failed)?, "in this process")
        }
        Some(program) => {
            let name = format!("demo-{}", std::process::id());
            let mut server = ServerProcess::start(program, &name, cache)?;
            let mut session = Session::connect(&name).map_err(failed)?;
            let run = play(&mut session, progress).map_err(failed)?;
            session.close().map_err(failed)?;
            server.stop()?;
            (run, "through shared memory and back")
        }
    };
    bar.finish_and_clear();
    if let Some(path) = csv_file {
        std::fs::write(path, csv(&run)).map_err(|e| format!("{}: expected to write, found {e}", path.display()))?;
    }
    let text = table::summary(&run, way, style.paint) + &table::contacts(&run, style);
    Ok((text, run))
}

/// The server as a child process; killed when dropped.
struct ServerProcess {
    child: Child,
}

impl ServerProcess {
    fn start(program: &Program, name: &str, cache: &CacheFolder) -> Result<Self, String> {
        let mut command = Command::new(&program.path);
        command
            .args(&program.arguments)
            .args(["serve", "--quiet", "--name", name])
            .stdin(Stdio::null())
            .stdout(Stdio::piped());
        if let Some(folder) = cache.folder() {
            command.arg("--cache").arg(folder);
        }
        let child = command.spawn().map_err(|e| format!("expected to start a server, found {e}"))?;
        let mut server = Self { child };
        let mut line = String::new();
        if let Some(out) = server.child.stdout.take() {
            // The server says one line when it is ready, and closes its output when it cannot be.
            BufReader::new(out).read_line(&mut line).map_err(|e| format!("expected the server's word, found {e}"))?;
        }
        if line.contains("ready") {
            return Ok(server);
        }
        Err("expected the server to become ready, found that it ended (see its message above)".into())
    }

    /// Asks it to end and waits for it.
    fn stop(&mut self) -> Result<(), String> {
        let pid = rustix::process::Pid::from_child(&self.child);
        rustix::process::kill_process(pid, rustix::process::Signal::TERM).map_err(|e| format!("demo: {e}"))?;
        let until = Instant::now() + PATIENCE;
        while Instant::now() < until {
            match self.child.try_wait().map_err(|e| format!("demo: {e}"))? {
                Some(status) if status.success() => return Ok(()),
                Some(status) => return Err(format!("expected the server to end well, found {status}")),
                None => std::thread::sleep(Duration::from_millis(2)),
            }
        }
        Err("expected the server to end when asked to, found it running".into())
    }
}

impl Drop for ServerProcess {
    fn drop(&mut self) {
        // Without effect on a child that was waited for already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
