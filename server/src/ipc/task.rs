//! A step on its way: the call, the scene that it is taken on, and what comes of it.

use super::jobs::Finished;
use super::port::{Bell, Port, StepCall, Wake};
use super::scene::Scene;
use crate::world::Heed;
use contactd_proto::control::RecordingStatus;
use contactd_proto::step::ASK_POLLING;
use contactd_proto::{EffectCounters, StepRequest};
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

/// The leader's mailbox and its bell: how other threads report to it.
pub struct Mailbox<P: Port> {
    /// Reports, by session.
    pub reports: Sender<(u64, Report<P>)>,
    /// Wakes the leader.
    pub bell: P::Bell,
}

impl<P: Port> Mailbox<P> {
    /// Reports to the leader.
    pub fn report(&self, session: u64, report: Report<P>) {
        if self.reports.send((session, report)).is_ok() {
            self.bell.ring();
        }
    }
}

/// What they report.
pub enum Report<P: Port> {
    /// A job is done.
    Job(Finished),
    /// A recording has ended; of no session.
    Recorded(u64, RecordingStatus),
    /// A step is done, or as good as.
    Stepped {
        /// The scene comes back.
        scene: Box<Scene>,
        /// What was worked out.
        did: Did,
        /// How long it took, from its request to its reply.
        took: Duration,
        /// A thread that its session has got for its steps.
        thread: Option<Sender<Task<P>>>,
    },
}

/// A step of a session, with all that it takes.
pub struct Task<P: Port> {
    /// The session.
    pub session: u64,
    /// Its scene, back with it once the step is done.
    pub scene: Box<Scene>,
    /// What the step heeds.
    pub heed: Arc<Heed>,
    /// A copy of the request's header.
    pub request: StepRequest,
    /// When it was taken up.
    pub began: Instant,
    /// The call.
    pub call: P::Step,
    /// Wakes the client.
    pub wake: Arc<P::Wake>,
    /// Where a thread that is not the leader's reports.
    pub mailbox: Arc<Mailbox<P>>,
}

/// What a step has done, as it is counted.
#[derive(Clone, Copy)]
pub struct Did {
    /// What it worked out.
    pub effects: EffectCounters,
    /// The reply's status.
    pub status: u32,
}

/// What a step has done, and its reply: written, not yet sent.
pub type Ran<P> = (Did, Option<<<P as Port>::Step as StepCall>::Reply>);

impl<P: Port> Task<P> {
    /// Runs it; the reply is written and not yet sent.
    pub fn run(&mut self) -> Ran<P> {
        let Self { scene, heed, request, call, .. } = self;
        scene.step(request, call.records(), Some(heed), |n, reply, slot| {
            (Did { effects: reply.effect_counters, status: reply.status }, call.write(n, reply, slot))
        })
    }

    /// Answers, on the leader's thread: gives the scene back.
    pub fn answer(self, ran: Ran<P>) -> Box<Scene> {
        send::<P>(self.call, ran, &self.request, &self.wake);
        self.scene
    }

    /// Answers, on another thread. The scene is back before the client can ask again.
    pub fn answer_from_afar(self, ran: Ran<P>, thread: Option<Sender<Self>>) {
        let Self { session, scene, request, began, call, wake, mailbox, .. } = self;
        let took = began.elapsed();
        mailbox.report(session, Report::Stepped { scene, did: ran.0, took, thread });
        send::<P>(call, ran, &request, &wake);
    }
}

/// Sends a reply that was written.
fn send<P: Port>(call: P::Step, (_, reply): Ran<P>, request: &StepRequest, wake: &P::Wake) {
    // The end of the call before the wake-up: a client that wakes up without a reply then knows that none comes.
    call.send(reply);
    if request.asked & ASK_POLLING == 0 {
        wake.notify();
    }
}
