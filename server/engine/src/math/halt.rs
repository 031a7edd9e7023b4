//! Work that is ended from outside: because its time is up, because it is to go on elsewhere, or because nobody waits for it.
//!
//! Two ways. A search looks at the `Halt` that its question names and ends as if its limit were reached: what it has proven by
//! then is told. Preprocessing and mass properties have no use for a half result: they look at their thread's own `Halt`
//! (`heed`, `point`) and unwind, with a payload that `catch` tells from a fault.

use std::any::Any;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Instant;

/// What ends work once it is set; it cannot be taken back.
#[derive(Debug, Default)]
pub struct Halt {
    set: AtomicBool,
    deadline: Option<Instant>,
}

impl Halt {
    /// One that sets itself at a time; at none where there is no such time.
    pub fn at(deadline: Option<Instant>) -> Self {
        Self { set: AtomicBool::new(false), deadline }
    }

    /// Ends the work.
    pub fn set(&self) {
        self.set.store(true, Relaxed);
    }

    /// True once it is set; it does not look at the clock.
    #[inline]
    pub fn is_set(&self) -> bool {
        self.set.load(Relaxed)
    }

    /// True once it is set or its time has come, by which it is set.
    pub fn is_over(&self) -> bool {
        if !self.is_set() && self.deadline.is_some_and(|at| Instant::now() >= at) {
            self.set();
        }
        self.is_set()
    }

    /// The time at which it sets itself.
    pub fn deadline(&self) -> Option<Instant> {
        self.deadline
    }
}

/// The payload of an unwinding that `point` began.
#[derive(Debug)]
struct Cancelled;

/// Why work ended without a result.
pub enum Ended {
    /// It was cancelled.
    Cancelled,
    /// It panicked, with this payload.
    Panicked(Box<dyn Any + Send>),
}

thread_local! {
    static HEEDED: RefCell<Option<Arc<Halt>>> = const { RefCell::new(None) };
}

/// From now on the calling thread's `point`s end its work once `halt` is set.
pub fn heed(halt: Option<Arc<Halt>>) {
    HEEDED.with(|heeded| *heeded.borrow_mut() = halt);
}

/// A point at which work may end: unwinds out of it when the thread's `Halt` is set. Costs next to nothing otherwise.
#[inline]
pub fn point() {
    if HEEDED.with(|heeded| heeded.borrow().as_ref().is_some_and(|halt| halt.is_set())) {
        // No panic: no hook runs, nothing is printed.
        resume_unwind(Box::new(Cancelled));
    }
}

/// The result of work that may be cancelled.
///
/// # Errors
/// How it ended without one.
pub fn catch<T>(work: impl FnOnce() -> T) -> Result<T, Ended> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|payload| match payload.downcast::<Cancelled>() {
        Ok(_) => Ended::Cancelled,
        Err(payload) => Ended::Panicked(payload),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_heeds_a_halt_leaves_its_work_at_the_next_point() {
        let halt = Arc::new(Halt::default());
        let own = halt.clone();
        let count = std::thread::spawn(move || {
            heed(Some(own.clone()));
            let mut count = 0;
            let ended = catch(|| {
                loop {
                    count += 1;
                    if count == 5 {
                        own.set();
                    }
                    point();
                }
            });
            assert!(matches!(ended, Err(Ended::Cancelled)));
            heed(None);
            point();
            count
        });
        assert_eq!(count.join().unwrap(), 5);
        // Of another thread nothing ends, and a panic stays one.
        point();
        assert!(matches!(catch(|| 7), Ok(7)) && halt.is_set());
        assert!(matches!(catch(|| resume_unwind(Box::new(1))), Err(Ended::Panicked(_))));
        let past = Halt::at(Some(Instant::now()));
        assert!(!past.is_set() && past.is_over() && past.is_set());
    }
}
