//! The server's loop: steps first, then commands, then what other threads have done; spin, then block.
//!
//! One thread leads: it takes requests as they come and runs steps itself. A step that takes long keeps its thread and loses
//! the lead (`relay`); from then on the session has a thread of its own for its steps, of low priority, until they are
//! short again. How long is long depends on whom it holds up: while no other session is there, commands alone. Imports and
//! mass properties are jobs on threads of their own (`jobs`). So a session whose steps or models take long delays nobody but
//! itself, and what nobody waits for any more is ended. Clients that died are noticed by their
//! pidfd, those that left unheard by the port that they no longer have; both lose their sessions, and what they held in
//! shared memory is freed.
//!
//! Where requests come from is behind a port (`port`): the loop knows no shared memory.

use super::config::ServerConfig;
use super::jobs::{Finished, Job, JobKind};
use super::log::Log;
use super::manager::Manager;
use super::models::Models;
use super::port::{CommandCall, Port, StepCall, Wake};
use super::recordings::Recordings;
use super::relay::{PERIOD, Relay};
use super::scene::{CommandOutcome, Scene, refusal, refused};
use super::session::{Over, Session, fresh_heed};
use super::tally::{Tally, millis};
use super::task::{Did, Mailbox, Ran, Report, Task};
use crate::world::{Refusal, yield_to_others};
use contactd_proto::control::{Answer, Command, Envelope, ServerStatus, decode, encode};
use contactd_proto::names::PROTOCOL_VERSION;
use contactd_proto::status::StatusRecord;
use contactd_proto::step::{ASK_POLLING, STEP_REFUSED, STEP_UNDECIDED};
use contactd_proto::{ContactRecord, EffectCounters, ErrorCode};
use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Weak};
use std::thread::{Builder, Scope};
use std::time::{Duration, Instant};

/// Time between two looks at the clients' lives, and the longest wait.
const BEAT: Duration = Duration::from_millis(50);
/// Looks for a step for each look at all else, while it polls.
const LOOKS: usize = 8;
/// For how many periods a step may hold up the loop: beside other sessions, and where none is there. A step on a thread of its
/// session's own is short that takes no longer; after so many of them in a row the session has none any more.
const PATIENCE: u32 = 1;
const PATIENCE_ALONE: u32 = 20;
const CALM: u32 = 16;
/// How long the end of a server waits for the steps that were asked for before it was to end.
const DRAINED: Duration = Duration::from_secs(3);
/// How long it waits for what it has cancelled.
const CANCELLED: Duration = Duration::from_secs(2);
/// How long it waits for the files of its recordings, which a thread completes that yields to all others.
const COMPLETED: Duration = Duration::from_secs(20);
/// How many sessions that were ended from outside are remembered.
const REMEMBERED: usize = 1000;

/// Serves until `stop` is set and the steps that were asked for before are answered; gives back what the last leader held, to be dropped by the caller.
pub fn run<P: Port>(lead: Box<Lead<P>>, stop: &AtomicBool) -> Option<Box<Lead<P>>> {
    let relay = Relay::new(lead);
    std::thread::scope(|scope| {
        // On a thread of its own: a long step keeps the thread on which it began, and its priority is not the caller's.
        let leads = || follow(scope, &relay, relay.take_back(), stop);
        if Builder::new().name("contactd-loop".into()).spawn_scoped(scope, leads).is_err() {
            follow(scope, &relay, relay.take_back(), stop);
        }
    });
    relay.into_lead()
}

/// What the leader holds. Dropped in the order of its fields.
pub struct Lead<P: Port> {
    pending: BTreeMap<u64, (P::Command, Job)>,
    sessions: BTreeMap<u64, Session<P>>,
    reports: Receiver<(u64, Report<P>)>,
    mailbox: Arc<Mailbox<P>>,
    port: P,
    models: Arc<Models>,
    config: ServerConfig,
    recordings: Recordings<P>,
    last_session: u64,
    steps: u64,
    tally: Tally,
    log: Log,
    /// Sessions that were ended from outside, the latest: their clients are told so.
    ended: VecDeque<u64>,
    /// What they worked out.
    effects: EffectCounters,
    /// Goes on with every beat.
    beats: Arc<AtomicU64>,
    last_work: Instant,
    last_beat: Instant,
    /// Sessions that have asked something lately, as of the last beat; new ones count.
    active: usize,
    /// Scenes that steps have taken along. The leader itself runs none when it asks.
    away: usize,
    cores: usize,
    /// A thread watches, to take the lead; and that none could be started was told.
    watched: bool,
    alone: bool,
    /// Set when the process was sent a hangup.
    pub hangup: Arc<AtomicBool>,
    /// Who started the server as a service.
    manager: Manager,
    /// The server is to end: until when steps are waited for, and how many that have arrived are yet to be taken.
    closing: Option<(Instant, usize)>,
    /// The server's incarnation.
    epoch: u64,
}

/// What becomes of a thread that leads: it serves to the end, or runs the steps of the session that kept it.
fn follow<'scope, 'env, P: Port>(
    scope: &'scope Scope<'scope, 'env>,
    relay: &'scope Relay<Box<Lead<P>>>,
    lead: Option<Box<Lead<P>>>,
    stop: &'scope AtomicBool,
) {
    let Some(lead) = lead else { return };
    let own = rustix::thread::gettid();
    if let Some((task, ran)) = lead_on(scope, relay, lead, stop, own) {
        yield_to_others();
        let (to, tasks) = channel();
        task.answer_from_afar(ran, Some(to));
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

fn run_from_afar<P: Port>(mut task: Task<P>) {
    let ran = task.run();
    task.answer_from_afar(ran, None);
}

/// Serves until `stop` is set, or until a step has taken so long that another thread leads: then that step, done.
fn lead_on<'scope, 'env, P: Port>(
    scope: &'scope Scope<'scope, 'env>,
    relay: &'scope Relay<Box<Lead<P>>>,
    mut lead: Box<Lead<P>>,
    stop: &'scope AtomicBool,
    own: rustix::process::Pid,
) -> Option<(Task<P>, Ran<P>)> {
    lead.watched = false;
    while !lead.is_over(stop) {
        if !lead.watched {
            let watch = move || follow(scope, relay, relay.watch(), stop);
            lead.watched = Builder::new().name("contactd-watch".into()).spawn_scoped(scope, watch).is_ok();
            lead.is_alone();
        }
        let mut worked = false;
        let spins = lead.last_work.elapsed() < lead.spin();
        // Steps first: while it polls it looks for them several times for each look at all else.
        for _ in 0..if spins { LOOKS } else { 1 } {
            while let Some(call) = lead.next_step() {
                worked = true;
                let Some(mut task) = lead.begin(call) else { continue };
                let id = task.session;
                let patience = lead.patience();
                relay.lend(lead, (task.heed.clone(), own), patience);
                let ran = task.run();
                match relay.take_back() {
                    Some(back) => lead = back,
                    None => return Some((task, ran)),
                }
                lead.count(id, &ran.0, task.began.elapsed());
                let scene = task.answer(ran);
                lead.put_back(id, scene);
            }
            std::hint::spin_loop();
        }
        while lead.closing.is_none()
            && let Some(call) = lead.port.next_command()
        {
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
        } else if !spins && !lead.is_over(stop) && !lead.port.wait(BEAT) {
            // An interrupted wait ends early, a failing one must not become a busy loop.
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    lead.end();
    relay.end(lead);
    None
}

impl<P: Port> Lead<P> {
    /// A loop that has served nobody yet, of the server's incarnation `epoch`; `bell` wakes it.
    pub fn new(config: ServerConfig, epoch: u64, port: P, bell: P::Bell) -> Self {
        let (to, reports) = channel();
        Self {
            pending: BTreeMap::new(),
            sessions: BTreeMap::new(),
            reports,
            mailbox: Arc::new(Mailbox { reports: to, bell }),
            port,
            models: Arc::new(Models::new(&config)),
            log: Log::new(config.log),
            config,
            recordings: Recordings::default(),
            last_session: 0,
            steps: 0,
            tally: Tally::new(Instant::now()),
            ended: VecDeque::new(),
            effects: EffectCounters::default(),
            beats: Arc::default(),
            last_work: Instant::now(),
            last_beat: Instant::now(),
            active: 0,
            away: 0,
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            watched: false,
            alone: false,
            hangup: Arc::default(),
            manager: Manager::default(),
            closing: None,
            epoch,
        }
    }

    /// Tells the service manager that started this process, if one did, that the server is ready.
    pub fn tells_manager(&mut self) {
        match Manager::ready(self.beats.clone()) {
            Ok(manager) => self.manager = manager,
            Err(e) => self.log.warn(&format!("the service manager was not told that the server is ready: {e}")),
        }
    }

    /// Whether the server is to end and has answered the steps that were asked for before, as far as it waits for them.
    fn is_over(&mut self, stop: &AtomicBool) -> bool {
        if !stop.load(Ordering::Relaxed) {
            return false;
        }
        let Some((until, waiting)) = self.closing else {
            self.manager.stopping();
            // One a session: a client that goes on asking keeps no server from ending.
            self.closing = Some((Instant::now() + DRAINED, self.sessions.len()));
            return false;
        };
        let is_idle = waiting == 0 && self.sessions.values().all(|session| session.scene.is_some());
        is_idle || Instant::now() >= until
    }

    /// A step that has arrived; those that arrive while the server ends are not taken.
    fn next_step(&mut self) -> Option<P::Step> {
        let Some((_, waiting)) = &mut self.closing else { return self.port.next_step() };
        let call = if *waiting > 0 { self.port.next_step() } else { None };
        *waiting = if call.is_some() { *waiting - 1 } else { 0 };
        call
    }

    /// For how many periods a step may hold up the loop.
    fn patience(&self) -> u32 {
        if self.sessions.len() > 1 { PATIENCE } else { PATIENCE_ALONE }
    }

    /// How long to poll before blocking: not at all when the clients that poll need the cores, or steps on threads of their
    /// own. Who has asked nothing of late polls no more.
    fn spin(&self) -> Duration {
        let spinners = 1 + self.active + self.away;
        Duration::from_micros(if spinners <= self.cores { self.config.spin_us } else { 0 })
    }

    /// Takes what other threads tell; true when there was something.
    fn hear(&mut self) -> bool {
        let mut heard = false;
        while let Ok((session, report)) = self.reports.try_recv() {
            heard = true;
            match report {
                Report::Job(finished) => self.finished(session, finished),
                Report::Recorded(serial, status) => self.recorded(serial, status),
                Report::Stepped { scene, did, took, thread } => {
                    self.count(session, &did, took);
                    self.stepped(session, took, thread);
                    self.put_back(session, scene);
                }
            }
        }
        heard
    }

    /// A step is done; one that was refused is no step.
    fn count(&mut self, id: u64, did: &Did, took: Duration) {
        self.effects += did.effects;
        if did.status == STEP_REFUSED {
            return;
        }
        let is_undecided = did.status == STEP_UNDECIDED;
        self.tally.count(took, is_undecided);
        if let Some(session) = self.sessions.get_mut(&id) {
            session.count(is_undecided);
        }
    }

    /// A session's step is done on another thread.
    fn stepped(&mut self, id: u64, took: Duration, thread: Option<Sender<Task<P>>>) {
        let is_short = thread.is_none() && took < self.patience() * PERIOD;
        let Some(session) = self.sessions.get_mut(&id) else { return };
        session.calm = if is_short { session.calm + 1 } else { 0 };
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
        self.away -= 1;
        match self.sessions.get_mut(&id) {
            Some(session) => session.scene = Some(scene),
            None => discard(scene),
        }
    }

    /// A step that is to be run by the caller; `None` where it is answered, or runs elsewhere.
    fn begin(&mut self, call: P::Step) -> Option<Task<P>> {
        let request = call.request();
        let refuse = |call: P::Step, code| {
            let reply = call.write(0, refusal(&request, code, None), &|_| ContactRecord::default());
            call.send(reply);
        };
        let is_mine = request.epoch == self.epoch;
        if is_mine && self.sessions.get(&request.session).is_some_and(|session| session.scene.is_none()) {
            // Its reply was sent: what is left of its last step is on its way.
            self.hear();
        }
        let session = if is_mine { self.sessions.get_mut(&request.session) } else { None };
        let Some(session) = session else {
            let gone = gone(&self.ended, request.session, is_mine);
            let code = if request.version == PROTOCOL_VERSION { gone } else { ErrorCode::Version };
            refuse(call, code);
            return None;
        };
        session.has_asked();
        session.polls = request.asked & ASK_POLLING != 0;
        self.steps += 1;
        let scene = if session.waiting { None } else { session.scene.take() };
        let Some(scene) = scene else {
            refuse(call, ErrorCode::Busy);
            if !session.polls {
                session.wake.notify();
            }
            return None;
        };
        self.away += 1;
        let mut scene = scene;
        scene.record(self.recordings.number(), || self.recordings.tap(request.session));
        if self.config.deadline_ms > 0 {
            let has_left = session.thread.is_some();
            session.heed = session.heed.next(self.config.deadline());
            if has_left {
                session.heed.leave();
            }
        }
        let (heed, wake, mailbox) = (session.heed.clone(), session.wake.clone(), self.mailbox.clone());
        let began = Instant::now();
        let task = Task { session: request.session, scene, heed, request, began, call, wake, mailbox };
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

    fn command(&mut self, call: P::Command) {
        let version = call.version();
        if version != PROTOCOL_VERSION {
            return answer(call, &refused(Refusal::new(ErrorCode::Version, format!("the client speaks {version}"))));
        }
        if call.bytes().len() > self.config.text + (1 << 20) {
            return answer(call, &refused(Refusal::new(ErrorCode::LimitText, "")));
        }
        // One copy, then decoding: what is decoded can no longer change.
        let bytes = call.bytes().to_vec();
        let envelope: Envelope = match decode(&bytes) {
            Ok(envelope) => envelope,
            Err(code) => return answer(call, &refused(Refusal::new(code, ""))),
        };
        if let Command::Open { version, process } = envelope.command {
            let opened = self.open(version, process).unwrap_or_else(|refusal| {
                let why = sentence(&refusal);
                self.log.info(|| format!("a session for process {} was refused: {why}", process.0));
                refused(refusal)
            });
            return answer(call, &opened);
        }
        let id = envelope.session;
        self.hear();
        let is_mine = envelope.epoch == self.epoch;
        match envelope.command {
            Command::Status if is_mine => return answer(call, &Answer::Status(self.status())),
            Command::EndSession(which) if is_mine => return answer(call, &self.end_from_outside(which)),
            Command::Record(order) if is_mine => {
                let begun = self.record(id, &order);
                return answer(call, &begun.map_or_else(refused, |()| Answer::Done));
            }
            Command::Recording { stop } if is_mine => return self.tell_of_recording(id, stop, call),
            _ => {}
        }
        let session = if is_mine { self.sessions.get_mut(&id) } else { None };
        let Some(session) = session else {
            let code = gone(&self.ended, id, is_mine);
            return answer(call, &refused(Refusal::new(code, format!("session {id}"))));
        };
        session.has_asked();
        // Whatever is under way: what comes of it has nobody to go to.
        if envelope.command == Command::Close {
            self.remove(id, "its client closed it");
            self.show();
            return answer(call, &Answer::Done);
        }
        let scene = if session.waiting { None } else { session.scene.as_mut() };
        let Some(scene) = scene else {
            let detail = if session.waiting {
                "a model is being imported or integrated over, or a query answered"
            } else {
                "a step runs"
            };
            return answer(call, &refused(Refusal::new(ErrorCode::Busy, detail)));
        };
        scene.record(self.recordings.number(), || self.recordings.tap(id));
        let outcome = scene.command(envelope.command);
        session.counts = scene.counts();
        let work = match outcome {
            CommandOutcome::Answered(a) => {
                debug_refusal(&mut self.log, id, &a);
                answer(call, &a);
                session.wake.notify();
                return;
            }
            CommandOutcome::Import(import) => JobKind::Import(import),
            CommandOutcome::Integrate(integration) => JobKind::Integrate(integration),
            CommandOutcome::Save(save) => JobKind::Save(save),
            CommandOutcome::Ask(inquiry) => JobKind::Ask(inquiry),
        };
        // A core is left to the loop; the others are shared between the jobs by the system.
        let threads = self.cores.saturating_sub(1) / (self.pending.len() + 1);
        // The bell must not outlive its service: a job that is still to be told of that has ended is told to nobody.
        let mailbox: Weak<Mailbox<P>> = Arc::downgrade(&self.mailbox);
        let done = move |finished| {
            if let Some(mailbox) = mailbox.upgrade() {
                mailbox.report(id, Report::Job(finished));
            }
        };
        match Job::start(work, threads, self.models.clone(), done) {
            Ok(job) => {
                session.waiting = true;
                self.pending.insert(id, (call, job));
            }
            Err(refusal) => answer(call, &refused(refusal)),
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
        let wake = self.port.wake_of(id).map_err(|e| Refusal::new(ErrorCode::Internal, e.to_string()))?;
        self.last_session = id;
        let session = Session::new(Scene::new(&self.config), wake, process, self.cores);
        self.sessions.insert(id, session);
        let (open, most) = (self.sessions.len(), self.config.sessions);
        self.log.info(|| format!("session {id} is opened by process {} ({open} of {most} are open)", process.0));
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
            (Finished::Imported(model, text, loaded), Some(scene)) => {
                let said = scene.loaded(model, text, loaded);
                session.counts = scene.counts();
                if let Answer::Loaded { faces, .. } = &said {
                    let faces = faces.len();
                    self.log
                        .debug(|| format!("session {id}: {text} bytes were read as model {model}, of {faces} faces"));
                }
                said
            }
            (Finished::Imported(..), None) => refused(Refusal::new(ErrorCode::Busy, "a step runs")),
            (Finished::Answered(said), _) => said,
        };
        debug_refusal(&mut self.log, id, &said);
        answer(call, &said);
        session.wake.notify();
    }

    /// Ends a session: what runs for it is cancelled, and its scene freed on another thread.
    fn remove(&mut self, id: u64, why: &str) {
        self.pending.remove(&id);
        self.recordings.session_is_over(id);
        let Some(mut session) = self.sessions.remove(&id) else { return };
        let (process, steps) = (session.process, session.steps);
        self.log.info(|| format!("session {id} of process {process} is ended after {steps} steps: {why}"));
        if let Some(scene) = session.scene.take() {
            discard(scene);
        }
    }

    /// Ends a session because somebody else than its client asks for it.
    fn end_from_outside(&mut self, id: u64) -> Answer {
        let Some(session) = self.sessions.get(&id) else {
            return refused(Refusal::new(ErrorCode::SessionGone, format!("session {id}")));
        };
        let wake = session.wake.clone();
        // A client that waits for a model hears of it by this answer, another one by the next.
        if let Some((call, _job)) = self.pending.remove(&id) {
            answer(call, &refused(Refusal::new(ErrorCode::SessionEnded, format!("session {id}"))));
        }
        self.ended.push_back(id);
        if self.ended.len() > REMEMBERED {
            self.ended.pop_front();
        }
        self.remove(id, "`contactd sessions end` asked for it");
        wake.notify();
        self.show();
        Answer::Done
    }

    /// What the server says of itself, from what is counted anyway.
    fn status(&mut self) -> ServerStatus {
        let now = Instant::now();
        ServerStatus {
            pid: std::process::id(),
            uptime_ms: millis(self.tally.age(now)),
            sessions: self.sessions.iter().map(|(id, session)| session.status(*id)).collect(),
            models: u32::try_from(self.models.count()).unwrap_or(u32::MAX),
            steps: self.tally.steps,
            undecided: self.tally.undecided,
            latest: self.tally.latest(now),
        }
    }

    /// Ends the sessions that are over.
    fn end_sessions(&mut self) {
        let idle = Duration::from_secs(self.config.idle_s);
        let over: Vec<(u64, Over)> =
            self.sessions.iter_mut().filter_map(|(id, session)| Some((*id, session.is_over(idle)?))).collect();
        for (id, why) in &over {
            match why {
                Over::Died => self.remove(*id, "its client's process has ended"),
                Over::Left => self.remove(*id, "its client has left without a word"),
                Over::Idle => self.remove(*id, &format!("its client asked nothing for {} s", idle.as_secs())),
            }
        }
        if !over.is_empty() {
            self.port.sweep_dead();
        }
    }

    fn beat(&mut self) {
        self.end_sessions();
        self.active = self.sessions.values().filter(|s| s.is_active()).count();
        let beats = self.beats.fetch_add(1, Ordering::Relaxed) + 1;
        // A client may also die without a session: rarely looked for, since the look costs milliseconds.
        if beats.is_multiple_of(200) {
            self.port.sweep_dead();
        }
        self.tally.turn(Instant::now());
        for file in self.recordings.bury() {
            self.log.info(|| format!("{file}: the process that asked for the recording has ended"));
        }
        if let Some(why) = self.port.trouble() {
            self.log.warn(&format!("a reply is lost: {why}"));
        }
        if self.hangup.swap(false, Ordering::Relaxed) {
            self.log.warn("SIGHUP: there is nothing to read again, the server goes on");
        }
        self.show();
    }

    /// Tells, once, that nobody watches.
    fn is_alone(&mut self) {
        if !self.watched && !self.alone {
            self.log.warn("no thread can be started: a step that takes long delays all sessions");
        }
        self.alone = !self.watched;
    }

    /// Ends what runs for its sessions, and waits for it.
    fn end(&mut self) {
        let recordings = self.recordings.end_all();
        let until = Instant::now() + if recordings > 0 { COMPLETED } else { CANCELLED };
        for (id, session) in &mut self.sessions {
            session.heed.halt();
            session.thread = None;
            let (process, steps) = (session.process, session.steps);
            self.log
                .info(|| format!("session {id} of process {process} is ended after {steps} steps: the server stops"));
        }
        let mut left: usize = self.pending.len() + recordings;
        self.pending.clear();
        while left > 0
            && let Ok((_, report)) = self.reports.recv_timeout(until.saturating_duration_since(Instant::now()))
        {
            match report {
                Report::Job(_) => left -= 1,
                Report::Recorded(serial, status) => {
                    left -= 1;
                    self.recorded(serial, status);
                }
                // Its scene is freed here.
                Report::Stepped { .. } => {}
            }
        }
    }

    fn show(&mut self) {
        let status = status(self.epoch, &self.config, self.sessions.len(), self.steps);
        self.port.show(StatusRecord { effects: self.effects, ..status });
    }
}

/// Why there is no session of this id: it was ended from outside, or is not there for another reason.
fn gone(ended: &VecDeque<u64>, id: u64, is_mine: bool) -> ErrorCode {
    if is_mine && ended.contains(&id) { ErrorCode::SessionEnded } else { ErrorCode::SessionGone }
}

/// Tells, to who wants to know, that a command was refused.
fn debug_refusal(log: &mut Log, id: u64, said: &Answer) {
    if let Answer::Refused { code, detail, .. } = said {
        let code = ErrorCode::of_number(*code).unwrap_or(ErrorCode::Internal);
        log.debug(|| format!("session {id}: a command is refused: {}", sentence(&Refusal::new(code, detail.as_str()))));
    }
}

/// A refusal as a sentence.
fn sentence(refusal: &Refusal) -> String {
    let detail = if refusal.detail.is_empty() { String::new() } else { format!(": {}", refusal.detail) };
    format!("{}{detail}", refusal.code)
}

/// Frees a scene on another thread: a large one takes longer than a step may wait.
fn discard(scene: Box<Scene>) {
    // Where no thread can be started it is freed here.
    let _ = Builder::new().name("contactd-free".into()).spawn(move || drop(scene));
}

/// What a server shows of itself before it has counted anything.
pub fn status(epoch: u64, config: &ServerConfig, sessions: usize, steps: u64) -> StatusRecord {
    StatusRecord {
        version_min: PROTOCOL_VERSION,
        version_max: PROTOCOL_VERSION,
        iceoryx2: [0, 10, 0],
        pid: std::process::id(),
        epoch,
        sessions: sessions as u64,
        steps,
        limit_text: config.text as u64,
        limit_batch: config.batch as u64,
        limit_objects: config.objects as u64,
        limit_sessions: config.sessions as u64,
        ..StatusRecord::default()
    }
}

/// Sends the answer to a command.
fn answer(call: impl CommandCall, answer: &Answer) {
    // An answer that is too long ends the call without one.
    if let Ok(bytes) = encode(answer) {
        call.send(&bytes);
    }
}

mod recorded;
#[cfg(test)]
mod tests;
