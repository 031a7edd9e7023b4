//! One client's session as the loop sees it: its scene, its client's life, its step under way.

use super::port::{Port, Wake};
use super::scene::Scene;
use super::tally::millis;
use super::task::Task;
use crate::world::{Crew, Heed};
use contactd_client::shm::watch::ProcessWatch;
use contactd_proto::control::SessionStatus;
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

/// A session that has asked within it is active.
const LATELY: Duration = Duration::from_millis(200);
/// How long after the opening of its session a client may come to listen. Only one that could not take the answer needs longer.
const ARRIVAL: Duration = Duration::from_secs(5);

/// One client's session.
pub struct Session<P: Port> {
    /// Its scene; `None` while another thread runs a step on it.
    pub scene: Option<Box<Scene>>,
    pub wake: Arc<P::Wake>,
    /// Its client's process.
    pub process: u32,
    opened: Instant,
    /// Its client was seen to listen, or has asked something, before which it listens.
    arrived: bool,
    /// `None`: the client's process is not visible from here.
    life: Option<ProcessWatch>,
    last_request: Instant,
    /// Its client polled for the reply to its last step.
    pub polls: bool,
    /// A job of its is under way.
    pub waiting: bool,
    /// What its step under way heeds, or its next.
    pub heed: Arc<Heed>,
    /// Its own thread, since its steps take long; and how many short ones in a row it has run.
    pub thread: Option<Sender<Task<P>>>,
    pub calm: u32,
    /// Its objects and models, as of its last command: the scene may be elsewhere.
    pub counts: (u32, u32),
    /// Steps that were taken, and those of them that left a pair undecided.
    pub steps: u64,
    pub undecided: u64,
}

/// Why a session is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Over {
    /// Its client's process has ended.
    Died,
    /// Its client has asked nothing for long, and cannot be watched.
    Idle,
    /// Its client no longer listens, or never did.
    Left,
}

impl<P: Port> Session<P> {
    /// A new one, of a client's process (its id and when it started), on so many cores.
    pub fn new(scene: Scene, wake: P::Wake, process: (u32, u64), cores: usize) -> Self {
        Self {
            scene: Some(Box::new(scene)),
            wake: Arc::new(wake),
            process: process.0,
            opened: Instant::now(),
            arrived: false,
            life: ProcessWatch::of(process.0, process.1),
            last_request: Instant::now(),
            polls: false,
            waiting: false,
            heed: fresh_heed(cores),
            thread: None,
            calm: 0,
            counts: (0, 0),
            steps: 0,
            undecided: 0,
        }
    }

    /// Its client has asked something.
    pub fn has_asked(&mut self) {
        (self.last_request, self.arrived) = (Instant::now(), true);
    }

    /// A step was taken.
    pub fn count(&mut self, is_undecided: bool) {
        self.steps += 1;
        self.undecided += u64::from(is_undecided);
    }

    /// What is told of it.
    pub fn status(&self, id: u64) -> SessionStatus {
        SessionStatus {
            id,
            process: self.process,
            open_ms: millis(self.opened.elapsed()),
            idle_ms: millis(self.last_request.elapsed()),
            objects: self.counts.0,
            models: self.counts.1,
            steps: self.steps,
            undecided: self.undecided,
            is_busy: self.waiting || self.scene.is_none(),
        }
    }

    /// Why it is over, if it is: its client died, has long asked nothing where it cannot be watched, or left and was not heard: its
    /// goodbye dies with its ports, so that it may miss a server that is busy with a step.
    pub fn is_over(&mut self, idle: Duration) -> Option<Over> {
        let gone = match &self.life {
            Some(life) => life.is_dead().then_some(Over::Died),
            None => (self.scene.is_some() && self.last_request.elapsed() >= idle).then_some(Over::Idle),
        };
        let is_heard = self.wake.is_heard();
        self.arrived |= is_heard;
        let has_left = !is_heard && (self.arrived || self.opened.elapsed() >= ARRIVAL);
        gone.or(has_left.then_some(Over::Left))
    }

    /// Its client may be polling, or will soon ask.
    pub fn is_active(&self) -> bool {
        // While a long step is under way a client that does not poll has gone to sleep.
        self.last_request.elapsed() < LATELY && (self.polls || self.thread.is_none())
    }
}

impl<P: Port> Drop for Session<P> {
    fn drop(&mut self) {
        // Nobody waits for what is under way.
        self.heed.halt();
    }
}

/// What the steps of a session heed that are short so far.
pub fn fresh_heed(cores: usize) -> Arc<Heed> {
    Arc::new(Heed::new(None, Arc::new(Crew::new(cores))))
}
