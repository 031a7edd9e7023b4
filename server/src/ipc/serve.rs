//! The server's loop: steps first, then commands, then what other threads have done; spin, then block.
//!
//! One thread leads: it takes requests as they come and runs steps itself. A step that takes long keeps its thread and loses
//! the lead (`relay`); from then on the session has a thread of its own for its steps, of low priority, until they are
//! short again. Imports and mass properties are jobs on threads of their own (`jobs`). So a session whose steps or models
//! take long delays nobody but itself, and what nobody waits for any more is ended. Clients that died are noticed by their
//! pidfd, those that left unheard by the port that they no longer have; both lose their sessions, and what they held in
//! shared memory is freed.

use super::config::ServerConfig;
use super::jobs::{Finished, Job, Work};
use super::models::{Models, warn};
use super::relay::Relay;
use super::root::{Root, RootError};
use super::scene::{Outcome, Scene, refusal, refused};
use super::services::{Services, Wake};
use crate::world::{Crew, Heed, Refusal, yield_to_others};
use contactd_client::Error;
use contactd_client::shm::link::Shared;
use contactd_client::shm::watch::ProcessWatch;
use contactd_proto::control::{Answer, Command, ControlHeader, Envelope, decode, encode};
use contactd_proto::names::{Address, PROTOCOL_VERSION};
use contactd_proto::status::StatusRecord;
use contactd_proto::step::ASK_POLLING;
use contactd_proto::{ContactRecord, EffectCounters, ErrorCode, PoseRecord, StepReply, StepRequest};
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::response_mut::ResponseMut;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::Weak;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{Builder, Scope};
use std::time::{Duration, Instant};

type StepCall = ActiveRequest<Shared, [PoseRecord], StepRequest, [ContactRecord], StepReply>;
type StepResponse = ResponseMut<Shared, [ContactRecord], StepReply>;
type ControlCall = ActiveRequest<Shared, [u8], ControlHeader, [u8], ControlHeader>;

/// Time between two looks at the clients' lives, and the longest wait.
const BEAT: Duration = Duration::from_millis(50);
/// A session that has asked within it is active.
const LATELY: Duration = Duration::from_millis(200);
/// Looks for a step for each look at all else, while it polls.
const LOOKS: usize = 8;
/// A step on a thread of its session's own is short below this; after so many of them in a row the session has none any more.
const SHORT: Duration = Duration::from_millis(1);
const CALM: u32 = 16;
/// How long the end of a server waits for what it has cancelled.
const CANCELLED: Duration = Duration::from_secs(2);
/// The part of a deadline that is left to the reply.
const REPLY_PART: u32 = 10;

/// How long after the opening of its session a client may come to listen. Only one that could not take the answer needs longer.
const ARRIVAL: Duration = Duration::from_secs(5);

/// Why a server does not run.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// It has no place.
    #[error(transparent)]
    Root(#[from] RootError),
    /// A thread cannot be started.
    #[error("expected to start threads, found: {0}")]
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
    /// Its scene; `None` while another thread runs a step on it.
    scene: Option<Box<Scene>>,
    wake: Arc<Wake>,
    opened: Instant,
    /// Its client was seen to listen, or has asked something, before which it listens.
    arrived: bool,
    /// `None`: the client's process is not visible from here.
    life: Option<ProcessWatch>,
    last_request: Instant,
    /// Its client polled for the reply to its last step.
    polls: bool,
    /// A job of its is under way.
    waiting: bool,
    /// What its step under way heeds, or its next.
    heed: Arc<Heed>,
    /// Its own thread, since its steps take long; and how many short ones in a row it has run.
    thread: Option<Sender<Task>>,
    calm: u32,
}

impl Session {
    fn hear(&mut self) {
        (self.last_request, self.arrived) = (Instant::now(), true);
    }

    /// True when its client died, has long asked nothing where it cannot be watched, or left and was not heard: its goodbye dies with
    /// its ports, so that it may miss a server that is busy with a step.
    fn is_over(&mut self, idle: Duration) -> bool {
        let is_gone = match &self.life {
            Some(life) => life.is_dead(),
            None => self.scene.is_some() && self.last_request.elapsed() >= idle,
        };
        let is_heard = self.wake.is_heard();
        self.arrived |= is_heard;
        is_gone || !is_heard && (self.arrived || self.opened.elapsed() >= ARRIVAL)
    }

    /// Its client may be polling, or will soon ask.
    fn is_active(&self) -> bool {
        // While a long step is under way a client that does not poll has gone to sleep.
        self.last_request.elapsed() < LATELY && (self.polls || self.thread.is_none())
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // Nobody waits for what is under way.
        self.heed.halt();
    }
}

/// What other threads tell the leader, and its bell.
struct Desk {
    reported: Sender<(u64, Told)>,
    bell: Notifier<Shared>,
}

impl Desk {
    fn report(&self, session: u64, reported: Told) {
        if self.reported.send((session, reported)).is_ok() {
            // Where the bell does not ring the next beat finds it.
            let _ = self.bell.notify();
        }
    }
}

/// What they tell.
enum Told {
    /// A job is done.
    Job(Finished),
    /// A step is done, or as good as.
    Stepped { scene: Box<Scene>, effects: EffectCounters, short: bool, thread: Option<Sender<Task>> },
}

/// A step of a session, with all that it takes.
struct Task {
    session: u64,
    scene: Box<Scene>,
    heed: Arc<Heed>,
    request: StepRequest,
    call: StepCall,
    wake: Arc<Wake>,
    desk: Arc<Desk>,
}

impl Task {
    /// Runs it; the reply is written and not yet sent.
    fn run(&mut self) -> (EffectCounters, Option<StepResponse>) {
        let Self { scene, heed, request, call, .. } = self;
        scene.step(request, call.payload(), Some(heed), |n, reply, slot| {
            (reply.effect_counters, write_step(call, n, reply, slot))
        })
    }

    /// Answers, on the leader's thread: gives the scene back.
    fn answer(self, response: Option<StepResponse>) -> Box<Scene> {
        send_step(response, self.call, &self.request, &self.wake);
        self.scene
    }

    /// Answers, on another thread. The scene is back before the client can ask again.
    fn answer_from_afar(
        self,
        (effects, response): (EffectCounters, Option<StepResponse>),
        short: bool,
        thread: Option<Sender<Task>>,
    ) {
        let Self { session, scene, request, call, wake, desk, .. } = self;
        desk.report(session, Told::Stepped { scene, effects, short, thread });
        send_step(response, call, &request, &wake);
    }
}

/// Sends a reply that was written.
fn send_step(response: Option<StepResponse>, call: StepCall, request: &StepRequest, wake: &Wake) {
    // A reply that cannot be delivered is dropped; the end of the call tells the client.
    let _ = response.map(StepResponse::send);
    // The end of the call before the wake-up: a client that wakes up without a reply then knows that none comes.
    drop(call);
    if request.asked & ASK_POLLING == 0 {
        wake.notify();
    }
}

/// What the leader holds. Dropped in the order of its fields, the place last.
struct Lead {
    pending: BTreeMap<u64, (ControlCall, Job)>,
    sessions: BTreeMap<u64, Session>,
    reported: Receiver<(u64, Told)>,
    desk: Arc<Desk>,
    services: Services,
    models: Arc<Models>,
    config: ServerConfig,
    last_session: u64,
    steps: u64,
    /// What they worked out.
    effects: EffectCounters,
    beats: u64,
    last_work: Instant,
    last_beat: Instant,
    /// Sessions that have asked something lately, as of the last beat; new ones count.
    active: usize,
    cores: usize,
    /// A thread watches, to take the lead; and that none could be started was told.
    watched: bool,
    alone: bool,
    hangup: Arc<AtomicBool>,
    root: Root,
}

/// A server that holds its place and has created its services.
pub struct Server {
    lead: Option<Box<Lead>>,
}

impl Server {
    /// Takes the place, creates the services, and tells clients.
    ///
    /// # Errors
    /// Another server of the name runs; folders are not private; shared memory fails; no threads can be started.
    pub fn start(address: &Address, config: ServerConfig) -> Result<Self, ServeError> {
        let root = Root::take(address)?;
        ready_threads().map_err(ServeError::Threads)?;
        let (services, bell) = Services::create(address, root.epoch(), &config, status(&root, &config, 0, 0))?;
        let (reported, hears) = channel();
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        root.publish()?;
        let lead = Lead {
            pending: BTreeMap::new(),
            sessions: BTreeMap::new(),
            reported: hears,
            desk: Arc::new(Desk { reported, bell }),
            services,
            models: Arc::new(Models::new(&config)),
            config,
            last_session: 0,
            steps: 0,
            effects: EffectCounters::default(),
            beats: 0,
            last_work: Instant::now(),
            last_beat: Instant::now(),
            active: 0,
            cores,
            watched: false,
            alone: false,
            hangup: Arc::default(),
            root,
        };
        Ok(Self { lead: Some(Box::new(lead)) })
    }

    /// Tells, in a line on standard error, when `hangup` was set.
    fn hears(&mut self, hangup: Arc<AtomicBool>) {
        if let Some(lead) = &mut self.lead {
            lead.hangup = hangup;
        }
    }

    /// Serves until `stop` is set.
    pub fn run(&mut self, stop: &AtomicBool) {
        let Some(lead) = self.lead.take() else { return };
        let relay = Relay::new(lead);
        std::thread::scope(|scope| {
            // On a thread of its own: a long step keeps the thread on which it began, and its priority is not the caller's.
            let leads = || follow(scope, &relay, relay.take_back(), stop);
            if Builder::new().name("contactd-loop".into()).spawn_scoped(scope, leads).is_err() {
                follow(scope, &relay, relay.take_back(), stop);
            }
        });
        self.lead = relay.into_lead();
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

/// What becomes of a thread that leads: it serves to the end, or runs the steps of the session that kept it.
fn follow<'scope, 'env>(
    scope: &'scope Scope<'scope, 'env>,
    relay: &'scope Relay<Box<Lead>>,
    lead: Option<Box<Lead>>,
    stop: &'scope AtomicBool,
) {
    let Some(lead) = lead else { return };
    let own = rustix::thread::gettid();
    if let Some((task, ran)) = lead_on(scope, relay, lead, stop, own) {
        yield_to_others();
        let (to, tasks) = channel();
        task.answer_from_afar(ran, false, Some(to));
        // Until the session has no use for it.
        while !relay.is_over() {
            match tasks.recv_timeout(BEAT) {
                Ok(task) => run_from_afar(task),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }
}

fn run_from_afar(mut task: Task) {
    let began = Instant::now();
    let ran = task.run();
    task.answer_from_afar(ran, began.elapsed() < SHORT, None);
}

/// Serves until `stop` is set, or until a step has taken so long that another thread leads: then that step, done.
fn lead_on<'scope, 'env>(
    scope: &'scope Scope<'scope, 'env>,
    relay: &'scope Relay<Box<Lead>>,
    mut lead: Box<Lead>,
    stop: &'scope AtomicBool,
    own: rustix::process::Pid,
) -> Option<(Task, (EffectCounters, Option<StepResponse>))> {
    lead.watched = false;
    while !stop.load(Ordering::Relaxed) {
        if !lead.watched {
            let watch = move || follow(scope, relay, relay.watch(), stop);
            lead.watched = Builder::new().name("contactd-watch".into()).spawn_scoped(scope, watch).is_ok();
            lead.is_alone();
        }
        let mut worked = false;
        let spins = lead.last_work.elapsed() < lead.spin();
        // Steps first: while it polls it looks for them several times for each look at all else.
        for _ in 0..if spins { LOOKS } else { 1 } {
            // A failed receive concerns one client's connection; the others go on.
            while let Ok(Some(call)) = lead.services.steps.receive() {
                worked = true;
                let Some(mut task) = lead.begin(call) else { continue };
                let id = task.session;
                relay.lend(lead, task.heed.clone(), own);
                let ran = task.run();
                match relay.take_back() {
                    Some(back) => lead = back,
                    None => return Some((task, ran)),
                }
                lead.effects += ran.0;
                let scene = task.answer(ran.1);
                lead.put_back(id, scene);
            }
            std::hint::spin_loop();
        }
        while let Ok(Some(call)) = lead.services.control.receive() {
            lead.command(call);
            worked = true;
        }
        worked |= lead.hear();
        if lead.last_beat.elapsed() >= BEAT {
            lead.beat();
            lead.last_beat = Instant::now();
        }
        if worked {
            lead.last_work = Instant::now();
        } else if !spins && lead.services.wake.timed_wait(|_| {}, BEAT).is_err() {
            // An interrupted wait ends early, a failing one must not become a busy loop.
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    lead.end();
    relay.end(lead);
    None
}

impl Lead {
    /// How long to poll before blocking: not at all when the clients that poll need the cores. Who has asked nothing of late
    /// polls no more.
    fn spin(&self) -> Duration {
        let spinners = 1 + self.active;
        Duration::from_micros(if spinners <= self.cores { self.config.spin_us } else { 0 })
    }

    /// Takes what other threads tell; true when there was something.
    fn hear(&mut self) -> bool {
        let mut heard = false;
        while let Ok((session, reported)) = self.reported.try_recv() {
            heard = true;
            match reported {
                Told::Job(finished) => self.finished(session, finished),
                Told::Stepped { scene, effects, short, thread } => {
                    self.effects += effects;
                    self.stepped(session, short, thread);
                    self.put_back(session, scene);
                }
            }
        }
        heard
    }

    /// A session's step is done on another thread.
    fn stepped(&mut self, id: u64, short: bool, thread: Option<Sender<Task>>) {
        let Some(session) = self.sessions.get_mut(&id) else { return };
        session.calm = if short { session.calm + 1 } else { 0 };
        if thread.is_some() {
            session.thread = thread;
        } else if session.calm >= CALM {
            // Its steps are short again: they are the loop's, and its threads end.
            session.thread = None;
            session.heed = fresh_heed(self.cores);
        }
    }

    /// A scene comes back to its session.
    fn put_back(&mut self, id: u64, scene: Box<Scene>) {
        match self.sessions.get_mut(&id) {
            Some(session) => session.scene = Some(scene),
            None => discard(scene),
        }
    }

    /// A step that is to be run by the caller; `None` where it is answered, or runs elsewhere.
    fn begin(&mut self, call: StepCall) -> Option<Task> {
        // One copy: the client could write to it while it is read.
        let request = *call.user_header();
        let refuse = |call: &StepCall, code| {
            let _ = write_step(call, 0, refusal(&request, code, None), &|_| ContactRecord::default())
                .map(StepResponse::send);
        };
        let is_mine = request.epoch == self.root.epoch();
        if is_mine && self.sessions.get(&request.session).is_some_and(|session| session.scene.is_none()) {
            // Its reply was sent: what is left of its last step is on its way.
            self.hear();
        }
        let session = if is_mine { self.sessions.get_mut(&request.session) } else { None };
        let Some(session) = session else {
            let code = if request.version == PROTOCOL_VERSION { ErrorCode::SessionGone } else { ErrorCode::Version };
            refuse(&call, code);
            return None;
        };
        session.hear();
        session.polls = request.asked & ASK_POLLING != 0;
        self.steps += 1;
        let scene = if session.waiting { None } else { session.scene.take() };
        let Some(scene) = scene else {
            refuse(&call, ErrorCode::Busy);
            drop(call);
            if !session.polls {
                session.wake.notify();
            }
            return None;
        };
        if self.config.deadline_ms > 0 {
            let has_left = session.thread.is_some();
            session.heed = session.heed.next(Some(deadline(&self.config)));
            if has_left {
                session.heed.leave();
            }
        }
        let (heed, wake, desk) = (session.heed.clone(), session.wake.clone(), self.desk.clone());
        let task = Task { session: request.session, scene, heed, request, call, wake, desk };
        let Some(thread) = &session.thread else { return Some(task) };
        match thread.send(task) {
            Ok(()) => None,
            // Its thread has gone: the loop is what is left.
            Err(e) => {
                session.thread = None;
                Some(e.0)
            }
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
        self.hear();
        let session = if envelope.epoch == self.root.epoch() { self.sessions.get_mut(&id) } else { None };
        let Some(session) = session else {
            return answer(&call, &refused(Refusal::new(ErrorCode::SessionGone, format!("session {id}"))));
        };
        session.hear();
        // Whatever is under way: what comes of it has nobody to go to.
        if envelope.command == Command::Close {
            self.remove(id);
            self.show();
            return answer(&call, &Answer::Done);
        }
        let scene = if session.waiting { None } else { session.scene.as_mut() };
        let Some(scene) = scene else {
            let detail = if session.waiting { "a model is being imported or integrated over" } else { "a step runs" };
            return answer(&call, &refused(Refusal::new(ErrorCode::Busy, detail)));
        };
        let work = match scene.command(envelope.command) {
            Outcome::Answered(a) => {
                answer(&call, &a);
                drop(call);
                session.wake.notify();
                return;
            }
            Outcome::Import(import) => Work::Import(import),
            Outcome::Integrate(integration) => Work::Integrate(integration),
        };
        // A core is left to the loop; the others are shared between the jobs by the system.
        let threads = self.cores.saturating_sub(1) / (self.pending.len() + 1);
        // The bell must not outlive its service: a job that is still to be told of that has ended is told to nobody.
        let desk: Weak<Desk> = Arc::downgrade(&self.desk);
        let done = move |finished| {
            if let Some(desk) = desk.upgrade() {
                desk.report(id, Told::Job(finished));
            }
        };
        match Job::start(work, threads, self.models.clone(), done) {
            Ok(job) => {
                session.waiting = true;
                self.pending.insert(id, (call, job));
            }
            Err(refusal) => answer(&call, &refused(refusal)),
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
            scene: Some(Box::new(Scene::new(&self.config))),
            wake: Arc::new(wake),
            opened: Instant::now(),
            arrived: false,
            life: ProcessWatch::of(process.0, process.1),
            last_request: Instant::now(),
            polls: false,
            waiting: false,
            heed: fresh_heed(self.cores),
            thread: None,
            calm: 0,
        };
        self.sessions.insert(id, session);
        self.active += 1;
        self.show();
        // The client polls beside the server: only where both have a core.
        let spin = if self.cores > 1 { self.config.spin_us } else { 0 };
        Ok(Answer::Opened { session: id, max_batch: self.config.batch as u32, spin_ns: spin * 1000 })
    }

    /// A job is done, or was refused.
    fn finished(&mut self, id: u64, finished: Finished) {
        // A session that ended meanwhile has nobody to answer.
        let Some((call, _job)) = self.pending.remove(&id) else { return };
        let Some(session) = self.sessions.get_mut(&id) else { return };
        session.waiting = false;
        let said = match (finished, session.scene.as_mut()) {
            (Finished::Imported(model, text, loaded), Some(scene)) => scene.loaded(model, text, loaded),
            (Finished::Imported(..), None) => refused(Refusal::new(ErrorCode::Busy, "a step runs")),
            (Finished::Integrated(said), _) => said,
        };
        answer(&call, &said);
        drop(call);
        session.wake.notify();
    }

    /// Ends a session: what runs for it is cancelled, and its scene freed on another thread.
    fn remove(&mut self, id: u64) {
        self.pending.remove(&id);
        if let Some(mut session) = self.sessions.remove(&id)
            && let Some(scene) = session.scene.take()
        {
            discard(scene);
        }
    }

    /// Ends the sessions that are over.
    fn end_sessions(&mut self) {
        let idle = Duration::from_secs(self.config.idle_s);
        let over: Vec<u64> =
            self.sessions.iter_mut().filter_map(|(id, session)| session.is_over(idle).then_some(*id)).collect();
        for id in &over {
            self.remove(*id);
        }
        if !over.is_empty() {
            self.services.sweep_dead();
        }
    }

    fn beat(&mut self) {
        self.end_sessions();
        self.active = self.sessions.values().filter(|s| s.is_active()).count();
        self.beats += 1;
        // A client may also die without a session: rarely looked for, since the look costs milliseconds.
        if self.beats.is_multiple_of(200) {
            self.services.sweep_dead();
        }
        if self.hangup.swap(false, Ordering::Relaxed) {
            warn("SIGHUP: there is nothing to read again, the server goes on");
        }
        self.show();
    }

    /// Tells, once, that nobody watches.
    fn is_alone(&mut self) {
        if !self.watched && !self.alone {
            warn("no thread can be started: a step that takes long delays all sessions");
        }
        self.alone = !self.watched;
    }

    /// Ends what runs for its sessions, and waits for it.
    fn end(&mut self) {
        let until = Instant::now() + CANCELLED;
        for session in self.sessions.values_mut() {
            session.heed.halt();
            session.thread = None;
        }
        let mut left: usize = self.pending.len();
        self.pending.clear();
        while left > 0
            && let Ok((_, reported)) = self.reported.recv_timeout(until.saturating_duration_since(Instant::now()))
        {
            left -= usize::from(matches!(reported, Told::Job(_)));
        }
    }

    fn show(&mut self) {
        let status = status(&self.root, &self.config, self.sessions.len(), self.steps);
        self.services.show(StatusRecord { effects: self.effects, ..status });
    }
}

/// What the steps of a session heed that are short so far.
fn fresh_heed(cores: usize) -> Arc<Heed> {
    Arc::new(Heed::new(None, Arc::new(Crew::new(cores))))
}

/// When a step that begins now must have been searched.
fn deadline(config: &ServerConfig) -> Instant {
    let whole = Duration::from_millis(config.deadline_ms);
    Instant::now() + (whole - whole / REPLY_PART)
}

/// Frees a scene on another thread: a large one takes longer than a step may wait.
fn discard(scene: Box<Scene>) {
    // Where no thread can be started it is freed here.
    let _ = Builder::new().name("contactd-free".into()).spawn(move || drop(scene));
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

/// Writes a reply once into slots of shared memory; `None` where there is no room for it: the end of the call says that it was
/// lost.
fn write_step(
    call: &StepCall,
    n: usize,
    reply: StepReply,
    slot: &dyn Fn(usize) -> ContactRecord,
) -> Option<StepResponse> {
    // iceoryx2 knows no empty slices: the header says how many slots count.
    let (loan, reply) = match call.loan_slice_uninit(n.max(1)) {
        Ok(loan) => (loan, reply),
        // The step was taken, its records cannot be told: the client learns that they are cut off.
        Err(_) => (call.loan_slice_uninit(1).ok()?, StepReply { records: 0, slots: 0, truncated: 1, ..reply }),
    };
    let reported = (reply.records + reply.slots) as usize;
    let mut response = loan.write_from_fn(|i| if i < reported { slot(i) } else { ContactRecord::default() });
    *response.user_header_mut() = reply;
    Some(response)
}

/// Sends the answer to a command.
fn answer(call: &ControlCall, answer: &Answer) {
    let Ok(bytes) = encode(answer) else { return };
    let Ok(loan) = call.loan_slice_uninit(bytes.len()) else { return };
    let mut response = loan.write_from_slice(&bytes);
    *response.user_header_mut() = ControlHeader { version: PROTOCOL_VERSION, reserved: 0 };
    let _ = response.send();
}

/// Serves until SIGINT or SIGTERM; calls `ready` once clients can connect. SIGHUP, which a terminal sends that is closed, is a
/// line on standard error.
///
/// # Errors
/// As `Server::start`.
pub fn serve(address: &Address, config: ServerConfig, ready: impl FnOnce()) -> Result<(), ServeError> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, stop.clone())
            .map_err(|e| ServeError::System(Error::System(format!("signal handler: {e}"))))?;
    }
    let hangup = Arc::new(AtomicBool::new(false));
    signal_hook::flag::register(signal_hook::consts::SIGHUP, hangup.clone())
        .map_err(|e| ServeError::System(Error::System(format!("signal handler: {e}"))))?;
    let mut server = Server::start(address, config)?;
    server.hears(hangup);
    ready();
    server.run(&stop);
    Ok(())
}
