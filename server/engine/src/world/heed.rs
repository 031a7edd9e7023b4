//! What a step heeds from outside while it runs: its end, and that it is to leave the threads that others need.
//!
//! Neither changes a bit of what is answered, but for a deadline: then what is not known by that time is undecided.

use crate::math::halt::Halt;
use rayon::ThreadPool;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// What a step heeds; one for each step.
#[derive(Debug)]
pub struct Heed {
    /// Ends it: what is proven by then is told.
    pub(super) halt: Arc<Halt>,
    /// Ends what runs on shared threads: it begins again elsewhere.
    pub(super) leave: Arc<Halt>,
    crew: Arc<Crew>,
}

impl Heed {
    /// A step that ends at a time, if at any, and goes on with a crew where it takes long.
    pub fn new(deadline: Option<Instant>, crew: Arc<Crew>) -> Self {
        Self { halt: Arc::new(Halt::at(deadline)), leave: Arc::new(Halt::at(deadline)), crew }
    }

    /// A step that ends when its work has looked so often whether it is to (`Halt::after`), on one thread.
    pub fn after(looks: u64) -> Self {
        let leave = Arc::new(Halt::default());
        leave.set();
        Self { halt: Arc::new(Halt::after(looks)), leave, crew: Arc::new(Crew::new(1)) }
    }

    /// Work that was done since the step was seen to be over (`math::halt`).
    pub fn overrun(&self) -> u64 {
        self.halt.overrun()
    }

    /// For the next step, of the same session: another deadline, the same crew.
    pub fn next(&self, deadline: Option<Instant>) -> Arc<Self> {
        Arc::new(Self::new(deadline, self.crew.clone()))
    }

    /// Ends the step.
    pub fn halt(&self) {
        self.halt.set();
        self.leave.set();
    }

    /// From now on the step uses the threads of its crew alone.
    pub fn leave(&self) {
        self.leave.set();
    }

    /// True once the step is to end.
    pub fn is_over(&self) -> bool {
        self.halt.is_over()
    }

    /// True once it is to use none but its own threads.
    pub fn has_left(&self) -> bool {
        self.leave.is_set()
    }

    /// Runs work on the crew, here where it has no threads.
    pub(super) fn elsewhere(&self, work: impl FnOnce() + Send) {
        match self.crew.threads() {
            Some(threads) => threads.install(work),
            None => work(),
        }
    }
}

/// The threads of one session, for its long steps: started when first needed, yielding to all others.
#[derive(Debug)]
pub struct Crew {
    count: usize,
    threads: OnceLock<Option<ThreadPool>>,
    missed: AtomicBool,
}

impl Crew {
    /// A crew of so many threads, once they are needed.
    pub fn new(count: usize) -> Self {
        Self { count, threads: OnceLock::new(), missed: AtomicBool::new(false) }
    }

    /// Its threads; `None` where one is enough, or where no more can be started.
    fn threads(&self) -> Option<&ThreadPool> {
        if self.count < 2 {
            return None;
        }
        let start = || {
            let threads = rayon::ThreadPoolBuilder::new().num_threads(self.count).start_handler(|_| yield_to_others());
            threads.build().inspect_err(|_| self.missed.store(true, Relaxed)).ok()
        };
        self.threads.get_or_init(start).as_ref()
    }

    /// True when its threads could not be started: its steps run on one.
    pub fn missed(&self) -> bool {
        self.missed.load(Relaxed)
    }
}

/// From now on the calling thread leaves the core to others that want it, but for a tenth.
pub fn yield_to_others() {
    // Where the system refuses, it competes like any other.
    let _ = rustix::process::setpriority_process(None, LONG_PRIORITY);
}

/// The priority of long work ("nice"): a tenth of the weight of what answers others. The lowest would starve beside whatever else
/// the machine does.
pub const LONG_PRIORITY: i32 = 10;
