//! A server process with a runtime folder of its own; whatever becomes of the test, nothing of it stays.

pub mod scene;

use contactd_client::SharedMemory;
use contactd_client::proto::names::Address;
use contactd_client::proto::status::StatusRecord;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Far beyond what anything here takes: a limit against hanging, not a measure.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// A running server.
pub struct ServerProcess {
    pub address: Address,
    runtime: TempDir,
    config: String,
    child: Child,
}

impl ServerProcess {
    /// Starts one and waits until it is ready.
    pub fn start(name: &str, config: &str) -> Self {
        Self::start_as(name, config, |_| {})
    }

    /// The same, with more to its command.
    pub fn start_as(name: &str, config: &str, more: impl FnOnce(&mut Command)) -> Self {
        let runtime = runtime_folder();
        let address = Address::under(&runtime.path().join("contactd"), name).expect("an address");
        let mut command = serve_command(runtime.path(), name);
        more(&mut command);
        let child = spawn(runtime.path(), command, config);
        Self { address, runtime, config: config.into(), child }
    }

    /// The server's standard error, where it is a pipe.
    pub fn stderr(&mut self) -> std::process::ChildStderr {
        self.child.stderr.take().expect("a pipe")
    }

    /// The runtime folder.
    pub fn runtime(&self) -> &Path {
        self.runtime.path()
    }

    /// Waits until the server shows something of itself; what it shows follows its beat.
    pub fn wait_for(&self, what: impl Fn(&StatusRecord) -> bool) {
        let until = Instant::now() + PATIENCE;
        while !what(&SharedMemory::status(&self.address).unwrap()) {
            assert!(Instant::now() < until, "the status never came to what it should be");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// The server's process id.
    pub fn pid(&self) -> rustix::process::Pid {
        rustix::process::Pid::from_child(&self.child)
    }

    /// SIGSTOP, and waits until every thread of the server has stopped: the signal alone leaves it time for an answer.
    pub fn freeze(&self) {
        rustix::process::kill_process(self.pid(), rustix::process::Signal::STOP).unwrap();
        let tasks = format!("/proc/{}/task", self.child.id());
        // The state stands behind the name, which ends with the last parenthesis.
        let stopped = |task: std::io::Result<std::fs::DirEntry>| {
            let stat = task.and_then(|t| std::fs::read_to_string(t.path().join("stat"))).unwrap_or_default();
            stat.rsplit_once(") ").is_none_or(|(_, rest)| rest.starts_with('T'))
        };
        let until = Instant::now() + PATIENCE;
        while !std::fs::read_dir(&tasks).unwrap().all(stopped) {
            assert!(Instant::now() < until, "the server does not stop");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// SIGKILL: nothing is cleaned up.
    pub fn kill(&mut self) {
        self.child.kill().expect("a running server");
        self.child.wait().expect("a killed server");
    }

    /// Starts it again, after `kill`.
    pub fn restart(&mut self) {
        let command = serve_command(self.runtime.path(), self.address.name());
        self.child = spawn(self.runtime.path(), command, &self.config);
    }

    /// SIGTERM, and the end.
    pub fn stop(&mut self) -> ExitStatus {
        let _ = rustix::process::kill_process(self.pid(), rustix::process::Signal::TERM);
        let until = Instant::now() + PATIENCE;
        loop {
            if let Some(status) = self.child.try_wait().expect("a child") {
                return status;
            }
            assert!(Instant::now() < until, "the server does not stop");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// What is left of it in shared memory and under its folder.
    pub fn remains(&self) -> Vec<String> {
        let mut left = shared_memory_of(&self.address);
        let folder = std::fs::read_dir(self.address.base()).into_iter().flatten().flatten();
        left.extend(folder.map(|e| e.path().display().to_string()));
        left
    }
}

impl Drop for ServerProcess {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        for name in shared_memory_of(&self.address) {
            let _ = std::fs::remove_file(Path::new("/dev/shm").join(name));
        }
    }
}

fn shared_memory_of(address: &Address) -> Vec<String> {
    let names = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    let names = names.map(|e| e.file_name().to_string_lossy().into_owned());
    names.filter(|name| name.starts_with(&address.prefix())).collect()
}

/// `contactd serve` in a runtime folder.
pub fn serve_command(runtime: &Path, name: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_contactd"));
    command.args(["serve", "--name", name]).env("XDG_RUNTIME_DIR", runtime).stdin(Stdio::null());
    // What a test does to sessions is no news.
    command.env("CONTACTD_LOG", "warn");
    command
}

fn spawn(runtime: &Path, mut command: Command, config: &str) -> Child {
    let file = runtime.join("server.toml");
    std::fs::write(&file, config).expect("a settings file");
    let mut child = command.arg("--config").arg(file).stdout(Stdio::piped()).spawn().expect("the server's program");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("its output")).read_line(&mut line).expect("its output");
    assert!(line.contains("ready"), "the server says: {line:?}");
    child
}

/// A folder for servers: in memory, as a user's runtime folder is, where that can be had.
pub fn runtime_folder() -> TempDir {
    tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).expect("a temporary folder")
}
