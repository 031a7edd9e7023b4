//! Who leads: one thread at a time runs the server's loop, and passes it on while it is held up by a step.
//!
//! The leader runs steps itself: nothing is faster. While it does so the loop lies here, and a second thread watches: a
//! step that is still running after its patience, a number of periods (`PERIOD`), keeps the thread that runs it, which
//! from then on yields to all others, and the watcher leads on. So no step stalls the loop for longer than one period
//! more than that, whatever it is that takes it so long; and nothing of a step has to be interruptible for that.
//!
//! Invariant: `lead` is in one place: with the leader, or here while the leader runs a step.

use crate::world::{Heed, LONG_PRIORITY};
use rustix::process::Pid;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Between two looks at a step that runs.
pub const PERIOD: Duration = Duration::from_millis(1);
/// Looks without a step after which the watcher sleeps until there is one.
const IDLE: u32 = 200;

/// The place where the loop is passed on; `T` is the loop's state.
pub struct Relay<T> {
    slot: Mutex<Slot<T>>,
    wake: Condvar,
}

struct Slot<T> {
    lead: Option<T>,
    /// Steps that have begun.
    serial: u64,
    /// What the step that runs heeds, and the thread that it runs on.
    current: Option<(Arc<Heed>, Pid)>,
    /// Whole periods for which it may hold up the loop.
    patience: u32,
    asleep: bool,
    over: bool,
}

impl<T> Relay<T> {
    /// A relay whose first leader is to take the lead.
    pub fn new(lead: T) -> Self {
        let slot = Slot { lead: Some(lead), serial: 0, current: None, patience: 1, asleep: false, over: false };
        Self { slot: Mutex::new(slot), wake: Condvar::new() }
    }

    fn slot(&self) -> MutexGuard<'_, Slot<T>> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The leader, on thread `own`, begins a step that may hold up the loop for so many periods, and for one more at most.
    pub fn lend(&self, lead: T, (heed, own): (Arc<Heed>, Pid), patience: u32) {
        let mut slot = self.slot();
        slot.lead = Some(lead);
        slot.serial += 1;
        slot.current = Some((heed, own));
        slot.patience = patience;
        if slot.asleep {
            slot.asleep = false;
            self.wake.notify_one();
        }
    }

    /// The step is done: the lead, unless another thread has taken it.
    pub fn take_back(&self) -> Option<T> {
        let mut slot = self.slot();
        let lead = slot.lead.take();
        if lead.is_some() {
            slot.current = None;
        }
        lead
    }

    /// Waits until a step takes too long, and takes the lead; `None` when it is over.
    pub fn watch(&self) -> Option<T> {
        let (mut seen, mut idle) = (u64::MAX, 0);
        let mut slot = self.slot();
        loop {
            if slot.over {
                return None;
            }
            // Looks at the same step, or at none, without one in between.
            idle = if slot.serial == seen { idle + 1 } else { 0 };
            if idle >= slot.patience && slot.lead.is_some() {
                if let Some((heed, thread)) = slot.current.take() {
                    heed.leave();
                    // Where the system refuses, it competes like any other.
                    let _ = rustix::process::setpriority_process(Some(thread), LONG_PRIORITY);
                }
                return slot.lead.take();
            }
            seen = slot.serial;
            if idle >= IDLE {
                slot.asleep = true;
                while slot.asleep && !slot.over {
                    slot = self.wake.wait(slot).unwrap_or_else(PoisonError::into_inner);
                }
                (slot.asleep, idle) = (false, 0);
                // Two looks from now on: it has just begun.
                seen = u64::MAX;
            } else {
                slot = self.wake.wait_timeout(slot, PERIOD).unwrap_or_else(PoisonError::into_inner).0;
            }
        }
    }

    /// The last leader leaves its lead here, and nobody takes it any more.
    pub fn end(&self, lead: T) {
        let mut slot = self.slot();
        (slot.lead, slot.over) = (Some(lead), true);
        self.wake.notify_all();
    }

    /// True once it is over.
    pub fn is_over(&self) -> bool {
        self.slot().over
    }

    /// What the last leader has left.
    pub fn into_lead(self) -> Option<T> {
        self.slot.into_inner().unwrap_or_else(PoisonError::into_inner).lead
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::Crew;
    use std::time::Instant;

    #[test]
    fn a_step_that_takes_long_loses_the_lead_and_leaves_the_shared_threads() {
        let relay = Relay::new(5);
        let heed = || Arc::new(Heed::new(None, Arc::new(Crew::new(1))));
        // A thread that has ended long ago: it has no priority to lose.
        let own = Pid::from_raw(i32::MAX).unwrap();
        std::thread::scope(|scope| {
            // Nobody watches: it is as good as short.
            relay.lend(relay.take_back().unwrap(), (heed(), own), 1);
            let lead = relay.take_back().expect("nobody took it");
            let watcher = scope.spawn(|| relay.watch());
            let long = heed();
            relay.lend(lead, (long.clone(), own), 1);
            assert_eq!(watcher.join().unwrap(), Some(5));
            assert!(relay.take_back().is_none() && long.has_left() && !long.is_over());
            // The next watcher, until the end.
            let watcher = scope.spawn(|| relay.watch());
            relay.end(6);
            assert_eq!(watcher.join().unwrap(), None);
        });
        assert!(relay.is_over());
        assert_eq!(relay.into_lead(), Some(6));
    }

    /// What a step that delays nobody is allowed, it gets; what is done within keeps the lead.
    #[test]
    fn a_step_keeps_the_lead_for_its_patience() {
        let relay = Relay::new(5);
        let heed = || Arc::new(Heed::new(None, Arc::new(Crew::new(1))));
        let own = Pid::from_raw(i32::MAX).unwrap();
        std::thread::scope(|scope| {
            let mut lead = relay.take_back().expect("nobody watches");
            let watcher = scope.spawn(|| relay.watch());
            let patience = 100;
            // Many steps, whose times do not add up.
            for _ in 0..75 {
                let short = heed();
                relay.lend(lead, (short.clone(), own), patience);
                std::thread::sleep(2 * PERIOD);
                lead = relay.take_back().expect("it was not patient");
                assert!(!short.has_left());
            }
            let (long, from) = (heed(), Instant::now());
            relay.lend(lead, (long.clone(), own), patience);
            assert_eq!(watcher.join().unwrap(), Some(5));
            assert!(long.has_left() && from.elapsed() >= (patience - 1) * PERIOD);
            relay.end(6);
        });
    }
}
