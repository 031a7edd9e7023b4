//! The server's loop: steps first, then commands, then finished jobs; spin, then block.
//!
//! One thread answers all sessions in the order in which their requests are found. Imports and mass properties are jobs for
//! a thread of their own, so that a large model delays only its own session. Clients that died are noticed by their pidfd,
//! those that left unheard by the port that they no longer have; both lose their sessions, and what they held in shared
//! memory is freed.

use super::config::ServerConfig;
use super::models::{Loaded, Models};
use super::root::{Root, RootError};
use super::scene::{Import, Integration, Outcome, Scene, refusal, refused};
use super::services::{Services, Wake};
use crate::world::Refusal;
use contactd_client::Error;
use contactd_client::shm::link::Variant;
use contactd_client::shm::watch::ProcessWatch;
use contactd_proto::control::{Answer, Command, ControlHeader, Envelope, decode, encode};
use contactd_proto::names::{Address, PROTOCOL_VERSION};
use contactd_proto::status::StatusRecord;
use contactd_proto::step::ASK_POLLING;
use contactd_proto::{ContactRecord, EffectCounters, ErrorCode, PoseRecord, StepReply, StepRequest};
use iceoryx2::active_request::ActiveRequest;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

type StepCall = ActiveRequest<Variant, [PoseRecord], StepRequest, [ContactRecord], StepReply>;
type ControlCall = ActiveRequest<Variant, [u8], ControlHeader, [u8], ControlHeader>;

/// Time between two looks at the clients' lives, and the longest wait.
const BEAT: Duration = Duration::from_millis(50);
/// A session that has asked within it is active.
const LATELY: Duration = Duration::from_millis(200);
/// Looks for a step for each look at all else, while it polls.
const LOOKS: usize = 8;
/// The longest wait while a job runs: its end wakes nobody.
const JOB_BEAT: Duration = Duration::from_millis(1);

/// How long after the opening of its session a client may come to listen. Only one that could not take the answer needs longer.
const ARRIVAL: Duration = Duration::from_secs(5);

/// Why a server does not run.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// It has no place.
    #[error(transparent)]
    Root(#[from] RootError),
    /// There are no threads for jobs.
    #[error("expected threads for imports, found {0}")]
    Threads(String),
    /// Shared memory failed.
    #[error("{0}")]
    System(Error),
}

impl From<Error> for ServeError {
    fn from(e: Error) -> Self {
        Self::System(e)
    }
}

/// One client's session.
struct Session {
    scene: Scene,
    wake: Wake,
    opened: Instant,
    /// Its client was seen to listen, or has asked something, before which it listens.
    arrived: bool,
    /// `None`: the client's process is not visible from here.
    life: Option<ProcessWatch>,
    last_request: Instant,
    /// A job of its is under way.
    waiting: bool,
}

impl Session {
    fn asked(&mut self) {
        (self.last_request, self.arrived) = (Instant::now(), true);
    }

    /// True when its client died, has long asked nothing where it cannot be watched, or left and was not heard: its goodbye dies with
    /// its ports, so that it may miss a server that is busy with a step.
    fn is_over(&mut self, idle: Duration) -> bool {
        let is_gone = match &self.life {
            Some(life) => life.is_dead(),
            None => self.last_request.elapsed() >= idle,
        };
        let is_heard = self.wake.is_heard();
        self.arrived |= is_heard;
        is_gone || !is_heard && (self.arrived || self.opened.elapsed() >= ARRIVAL)
    }
}

/// What takes too long for the loop.
enum Job {
    Import(Import),
    Integrate(Integration),
}

/// What came of it.
enum Finished {
    Imported(u32, Result<Arc<Loaded>, Refusal>),
    Integrated(Answer),
}

impl Job {
    fn run(self, models: &Models) -> Finished {
        match self {
            Job::Import(i) => Finished::Imported(i.model, models.load(&i.name, &i.text, i.facets)),
            Job::Integrate(integration) => Finished::Integrated(integration.answer()),
        }
    }
}

/// A server that holds its place and has created its services. Dropped in the order of its fields, the place last.
pub struct Server {
    pending: Vec<(u64, ControlCall)>,
    sessions: BTreeMap<u64, Session>,
    services: Services,
    jobs: Sender<(u64, Job)>,
    finished: Receiver<(u64, Finished)>,
    config: ServerConfig,
    last_session: u64,
    steps: u64,
    /// What they worked out.
    effects: EffectCounters,
    beats: u64,
    /// Sessions that have asked something lately, as of the last beat; new ones count.
    active: usize,
    cores: usize,
    root: Root,
}

impl Server {
    /// Takes the place, creates the services, and tells clients.
    ///
    /// # Errors
    /// Another server of the name runs; folders are not private; shared memory fails.
    pub fn start(address: &Address, config: ServerConfig) -> Result<Self, ServeError> {
        let root = Root::take(address)?;
        let services = Services::create(address, root.epoch(), &config, status(&root, &config, 0, 0))?;
        let (jobs, work) = channel::<(u64, Job)>();
        let (done, finished) = channel();
        let models = Models::new(&config);
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        // Threads of their own: in those that steps are searched on, a step would wait for what is being built. The loop
        // keeps a core.
        let threads = rayon::ThreadPoolBuilder::new().num_threads(cores.saturating_sub(1).max(1)).build();
        let threads = threads.map_err(|e| ServeError::Threads(e.to_string()))?;
        // Ends when the server drops its sender.
        std::thread::spawn(move || {
            for (session, job) in work {
                let result = threads.install(|| job.run(&models));
                if done.send((session, result)).is_err() {
                    break;
                }
            }
        });
        root.publish()?;
        Ok(Self {
            pending: Vec::new(),
            sessions: BTreeMap::new(),
            services,
            jobs,
            finished,
            config,
            last_session: 0,
            steps: 0,
            effects: EffectCounters::default(),
            beats: 0,
            active: 0,
            cores,
            root,
        })
    }

    /// Serves until `stop` is set.
    pub fn run(&mut self, stop: &AtomicBool) {
        let mut last_work = Instant::now();
        let mut last_beat = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            let mut worked = false;
            let spins = last_work.elapsed() < self.spin();
            // Steps first: while it polls it looks for them several times for each look at all else.
            for _ in 0..if spins { LOOKS } else { 1 } {
                // A failed receive concerns one client's connection; the others go on.
                while let Ok(Some(call)) = self.services.steps.receive() {
                    self.step(call);
                    worked = true;
                }
                std::hint::spin_loop();
            }
            while let Ok(Some(call)) = self.services.control.receive() {
                self.command(call);
                worked = true;
            }
            while let Ok((session, result)) = self.finished.try_recv() {
                self.finished(session, result);
                worked = true;
            }
            if last_beat.elapsed() >= BEAT {
                self.beat();
                last_beat = Instant::now();
            }
            if worked {
                last_work = Instant::now();
            } else if !spins {
                let wait = if self.pending.is_empty() { BEAT } else { JOB_BEAT };
                // An interrupted wait ends early, a failing one must not become a busy loop.
                if self.services.wake.timed_wait(|_| {}, wait).is_err() {
                    std::thread::sleep(JOB_BEAT);
                }
            }
        }
    }

    /// How long to poll before blocking: not at all when the clients that poll need the cores. Who has asked nothing of late
    /// polls no more.
    fn spin(&self) -> Duration {
        let spinners = 1 + self.active;
        Duration::from_micros(if spinners <= self.cores { self.config.spin_us } else { 0 })
    }

    fn step(&mut self, call: StepCall) {
        // One copy: the client could write to it while it is read.
        let request = *call.user_header();
        let session = if request.epoch == self.root.epoch() { self.sessions.get_mut(&request.session) } else { None };
        let Some(session) = session else {
            let code = if request.version == PROTOCOL_VERSION { ErrorCode::SessionGone } else { ErrorCode::Version };
            send_step(&call, 0, refusal(&request, code, None), &|_| ContactRecord::default());
            return;
        };
        session.asked();
        self.steps += 1;
        if session.waiting {
            send_step(&call, 0, refusal(&request, ErrorCode::Busy, None), &|_| ContactRecord::default());
        } else {
            let effects = &mut self.effects;
            session.scene.step(&request, call.payload(), |n, reply, slot| {
                *effects += reply.effect_counters;
                send_step(&call, n, reply, slot);
            });
        }
        // The end of the call before the wake-up: a client that wakes up without a reply then knows that none comes.
        drop(call);
        if request.asked & ASK_POLLING == 0 {
            session.wake.notify();
        }
    }

    fn command(&mut self, call: ControlCall) {
        let version = call.user_header().version;
        if version != PROTOCOL_VERSION {
            return answer(&call, &refused(Refusal::new(ErrorCode::Version, format!("the client speaks {version}"))));
        }
        if call.payload().len() > self.config.text + (1 << 20) {
            return answer(&call, &refused(Refusal::new(ErrorCode::LimitText, "")));
        }
        // One copy, then decoding: what is decoded can no longer change.
        let bytes = call.payload().to_vec();
        let envelope: Envelope = match decode(&bytes) {
            Ok(envelope) => envelope,
            Err(code) => return answer(&call, &refused(Refusal::new(code, ""))),
        };
        if let Command::Open { version, process } = envelope.command {
            let opened = self.open(version, process).unwrap_or_else(refused);
            return answer(&call, &opened);
        }
        let id = envelope.session;
        let session = if envelope.epoch == self.root.epoch() { self.sessions.get_mut(&id) } else { None };
        let Some(session) = session else {
            return answer(&call, &refused(Refusal::new(ErrorCode::SessionGone, format!("session {id}"))));
        };
        session.asked();
        // Whatever is under way: what comes of a job has nobody to go to.
        if envelope.command == Command::Close {
            self.sessions.remove(&id);
            self.show();
            return answer(&call, &Answer::Done);
        }
        if session.waiting {
            return answer(
                &call,
                &refused(Refusal::new(ErrorCode::Busy, "a model is being imported or integrated over")),
            );
        }
        let job = match session.scene.command(envelope.command) {
            Outcome::Answered(a) => {
                answer(&call, &a);
                drop(call);
                session.wake.notify();
                return;
            }
            Outcome::Import(import) => Job::Import(import),
            Outcome::Integrate(integration) => Job::Integrate(integration),
        };
        session.waiting = true;
        if self.jobs.send((id, job)).is_ok() {
            self.pending.push((id, call));
        } else {
            session.waiting = false;
            answer(&call, &refused(Refusal::new(ErrorCode::Internal, "imports have stopped")));
        }
    }

    fn open(&mut self, version: u32, process: (u32, u64)) -> Result<Answer, Refusal> {
        if version != PROTOCOL_VERSION {
            return Err(Refusal::new(ErrorCode::Version, format!("the client speaks {version}")));
        }
        if self.sessions.len() >= self.config.sessions {
            self.end_sessions();
        }
        if self.sessions.len() >= self.config.sessions {
            let detail = format!("the limit is {}", self.config.sessions);
            return Err(Refusal::new(ErrorCode::LimitSessions, detail));
        }
        let id = self.last_session + 1;
        let wake = self.services.wake_of(id).map_err(|e| Refusal::new(ErrorCode::Internal, e.to_string()))?;
        self.last_session = id;
        let session = Session {
            scene: Scene::new(&self.config),
            wake,
            opened: Instant::now(),
            arrived: false,
            life: ProcessWatch::of(process.0, process.1),
            last_request: Instant::now(),
            waiting: false,
        };
        self.sessions.insert(id, session);
        self.active += 1;
        self.show();
        // The client polls beside the server: only where both have a core.
        let spin = if self.cores > 1 { self.config.spin_us } else { 0 };
        Ok(Answer::Opened { session: id, max_batch: self.config.batch as u32, spin_ns: spin * 1000 })
    }

    /// A job is done, or was refused.
    fn finished(&mut self, id: u64, result: Finished) {
        let Some(at) = self.pending.iter().position(|(session, _)| *session == id) else { return };
        let (_, call) = self.pending.swap_remove(at);
        // A session that ended meanwhile has nobody to answer.
        let Some(session) = self.sessions.get_mut(&id) else { return };
        session.waiting = false;
        let said = match result {
            Finished::Imported(model, loaded) => session.scene.loaded(model, loaded),
            Finished::Integrated(said) => said,
        };
        answer(&call, &said);
        drop(call);
        session.wake.notify();
    }

    /// Ends the sessions that are over.
    fn end_sessions(&mut self) {
        let idle = Duration::from_secs(self.config.idle_s);
        let before = self.sessions.len();
        self.sessions.retain(|_, session| !session.is_over(idle));
        if self.sessions.len() < before {
            self.services.sweep_dead();
        }
    }

    fn beat(&mut self) {
        self.end_sessions();
        self.active = self.sessions.values().filter(|s| s.last_request.elapsed() < LATELY).count();
        self.beats += 1;
        // A client may also die without a session: rarely looked for, since the look costs milliseconds.
        if self.beats.is_multiple_of(200) {
            self.services.sweep_dead();
        }
        self.show();
    }

    fn show(&mut self) {
        let status = status(&self.root, &self.config, self.sessions.len(), self.steps);
        self.services.show(StatusRecord { effects: self.effects, ..status });
    }
}

fn status(root: &Root, config: &ServerConfig, sessions: usize, steps: u64) -> StatusRecord {
    StatusRecord {
        version_min: PROTOCOL_VERSION,
        version_max: PROTOCOL_VERSION,
        iceoryx2: [0, 10, 0],
        pid: std::process::id(),
        epoch: root.epoch(),
        sessions: sessions as u64,
        steps,
        limit_text: config.text as u64,
        limit_batch: config.batch as u64,
        limit_objects: config.objects as u64,
        limit_sessions: config.sessions as u64,
        ..StatusRecord::default()
    }
}

/// Writes a reply once into slots of shared memory and sends it.
fn send_step(call: &StepCall, n: usize, reply: StepReply, slot: &dyn Fn(usize) -> ContactRecord) {
    // iceoryx2 knows no empty slices: the header says how many slots count.
    let (loan, reply) = match call.loan_slice_uninit(n.max(1)) {
        Ok(loan) => (loan, reply),
        Err(_) => match call.loan_slice_uninit(1) {
            // The step was taken, its records cannot be told: the client learns that they are cut off.
            Ok(loan) => (loan, StepReply { records: 0, slots: 0, truncated: 1, ..reply }),
            // Without a reply the end of the call says that it was lost.
            Err(_) => return,
        },
    };
    let told = (reply.records + reply.slots) as usize;
    let mut response = loan.write_from_fn(|i| if i < told { slot(i) } else { ContactRecord::default() });
    *response.user_header_mut() = reply;
    // A reply that cannot be delivered is dropped; the end of the call tells the client.
    let _ = response.send();
}

/// Sends the answer to a command.
fn answer(call: &ControlCall, answer: &Answer) {
    let Ok(bytes) = encode(answer) else { return };
    let Ok(loan) = call.loan_slice_uninit(bytes.len()) else { return };
    let mut response = loan.write_from_slice(&bytes);
    *response.user_header_mut() = ControlHeader { version: PROTOCOL_VERSION, reserved: 0 };
    let _ = response.send();
}

/// Serves until SIGINT or SIGTERM; calls `ready` once clients can connect.
///
/// # Errors
/// As `Server::start`.
pub fn serve(address: &Address, config: ServerConfig, ready: impl FnOnce()) -> Result<(), ServeError> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, stop.clone())
            .map_err(|e| ServeError::System(Error::System(format!("signal handler: {e}"))))?;
    }
    let mut server = Server::start(address, config)?;
    ready();
    server.run(&stop);
    Ok(())
}
