//! Work that is ended from outside: because its time is up, because it is to go on elsewhere, or because nobody waits for it.
//!
//! Searches count their work (`work`), in looks at one face of a solid or what costs as much, wherever a loop is as long as what it is
//! given. Each thread that works under a `Halt` (`heeding`) looks at the clock once for some thousand of them. What has a half result that
//! is worth telling asks whether the time is up (`is_up`) and ends as if its limit were reached: what it has proven by then is told. What
//! has not ended by itself when a little more work was done is unwound, up to the innermost `attempt` or to `heeding`, whose caller tells
//! what holds without it. So no loop is left out that counts, whoever wrote what is above it.
//!
//! Preprocessing and mass properties have no use for a half result: they look at their thread's own `Halt` (`heed`, `point`) and unwind,
//! with a payload that `catch` tells from a fault.
//!
//! What is unwound has changed nothing that others see: what searches make for later ones stands behind a `OnceLock`, which stays empty,
//! or is finished first (`to_the_end`), so that it is made once at last, however short the time of a step is.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Work between two looks at the clock: some tens of microseconds.
const LOOK: u64 = 2_048;

/// What ends work once it is set; it cannot be taken back.
#[derive(Debug, Default)]
pub struct Halt {
    set: AtomicBool,
    deadline: Option<Instant>,
    /// Looks after which it sets itself.
    looks: Option<AtomicU64>,
    /// Work that was done since it was seen to be over, and when that was, where there is a deadline.
    overrun: AtomicU64,
    seen: OnceLock<Instant>,
}

impl Halt {
    /// Work within which what heeds it may end by itself, all threads together …
    pub const GRACE: u64 = 16 * LOOK;
    /// … and how long that may take where there is a deadline: faces differ.
    const GRACE_TIME: Duration = Duration::from_micros(500);

    /// One that sets itself at a time; at none where there is no such time.
    pub fn at(deadline: Option<Instant>) -> Self {
        Self { deadline, ..Self::default() }
    }

    /// One that sets itself when it has been looked at so often: the same moment whatever the machine, on one thread.
    pub fn after(looks: u64) -> Self {
        Self { looks: Some(AtomicU64::new(looks)), ..Self::default() }
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
        let is_last = |looks: &AtomicU64| looks.fetch_update(Relaxed, Relaxed, |left| left.checked_sub(1)).is_err();
        if !self.is_set()
            && (self.deadline.is_some_and(|at| Instant::now() >= at) || self.looks.as_ref().is_some_and(is_last))
        {
            self.set();
        }
        if !self.is_set() {
            return false;
        }
        if self.deadline.is_some() {
            self.seen.get_or_init(Instant::now);
        }
        true
    }

    /// Work that was done under it since it was seen to be over (`work`).
    pub fn overrun(&self) -> u64 {
        self.overrun.load(Relaxed)
    }

    /// True once what heeds it is unwound.
    pub fn is_spent(&self) -> bool {
        self.overrun() >= Self::GRACE || self.seen.get().is_some_and(|seen| seen.elapsed() >= Self::GRACE_TIME)
    }

    /// The time at which it sets itself.
    pub fn deadline(&self) -> Option<Instant> {
        self.deadline
    }
}

/// The payload of an unwinding that `work` began.
#[derive(Debug)]
struct Unwound;

thread_local! {
    /// Work that is left until the next look.
    static LEFT: Cell<u64> = const { Cell::new(u64::MAX) };
    /// What this thread's work heeds is over, as it has seen.
    static IS_UP: Cell<bool> = const { Cell::new(false) };
    static HALT: RefCell<Option<Arc<Halt>>> = const { RefCell::new(None) };
}

/// Counts work that is done next, in looks at a face. Unwinds where what the thread heeds has been over for a while.
#[inline]
pub fn work(amount: usize) {
    LEFT.with(|left| match left.get().checked_sub(amount as u64) {
        Some(rest) => left.set(rest),
        None => look(amount as u64),
    });
}

/// True once the thread's work is to end by itself. It does not look at the clock.
#[inline]
pub fn is_up() -> bool {
    IS_UP.get()
}

#[cold]
fn look(amount: u64) {
    let is_spent = HALT.with_borrow(|halt| {
        let Some(halt) = halt else {
            LEFT.set(u64::MAX);
            return false;
        };
        if IS_UP.get() {
            halt.overrun.fetch_add(LOOK + amount, Relaxed);
        }
        IS_UP.set(halt.is_over());
        // A program that aborts where it would unwind waits for what does not end by itself.
        let is_spent = cfg!(panic = "unwind") && IS_UP.get() && halt.is_spent();
        // Whatever is still done after that is unwound at its first step.
        LEFT.set(if is_spent { 0 } else { LOOK });
        is_spent
    });
    if is_spent {
        resume_unwind(Box::new(Unwound));
    }
}

/// What a thread heeds, put back at the end of a scope however it ends.
struct Scope(u64, bool, Option<Arc<Halt>>);

impl Scope {
    fn of(halt: Option<Arc<Halt>>) -> Self {
        let is_up = halt.as_ref().is_some_and(|halt| halt.is_set());
        let left = if halt.is_some() { LOOK } else { u64::MAX };
        Self(LEFT.replace(left), IS_UP.replace(is_up), HALT.replace(halt))
    }
}

impl Drop for Scope {
    fn drop(&mut self) {
        LEFT.set(self.0);
        IS_UP.set(self.1);
        HALT.set(self.2.take());
    }
}

/// The result of work that heeds `halt`, if any; `None` where it was unwound, or not begun since there is no time left.
pub fn heeding<T>(halt: Option<&Arc<Halt>>, work: impl FnOnce() -> T) -> Option<T> {
    let Some(halt) = halt else { return Some(work()) };
    if halt.is_spent() {
        return None;
    }
    let _scope = Scope::of(Some(halt.clone()));
    attempt(work)
}

/// The result of a part of the thread's work; `None` where it was unwound.
pub fn attempt<T>(work: impl FnOnce() -> T) -> Option<T> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(result) => Some(result),
        Err(payload) if payload.is::<Unwound>() => None,
        Err(payload) => resume_unwind(payload),
    }
}

/// The result of work that is made once for all that comes later: it does not end before.
pub fn to_the_end<T>(work: impl FnOnce() -> T) -> T {
    let _scope = Scope::of(None);
    work()
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
    /// So much work, in pieces, and how much of it was done.
    fn worked(halt: &Arc<Halt>, pieces: usize, amount: usize) -> (Option<usize>, usize) {
        let done = Cell::new(0);
        let result = heeding(Some(halt), || {
            for _ in 0..pieces {
                work(amount);
                done.set(done.get() + amount);
            }
            done.get()
        });
        (result, done.get())
    }

    #[test]
    fn work_that_does_not_end_by_itself_is_unwound() {
        // What is small ends by itself, and so does all that heeds nothing.
        let halt = Arc::new(Halt::default());
        assert_eq!(worked(&halt, 1_000, 100), (Some(100_000), 100_000));
        assert_eq!(halt.overrun(), 0);
        for amount in [1, 100, 5_000] {
            let halt = Arc::new(Halt::after(3));
            let (result, done) = worked(&halt, 1_000_000, amount);
            let (least, most) = (3 * LOOK as usize, 8 * LOOK as usize + Halt::GRACE as usize + 4 * amount);
            assert!(result.is_none() && done > least && done < most, "{amount}: {done}");
            // Then nothing begins.
            assert_eq!(worked(&halt, 1, 1), (None, 0));
            assert!(!is_up() && attempt(|| work(1 << 40)).is_some(), "outside of it nothing is heeded");
        }
    }

    #[test]
    fn what_ends_by_itself_or_is_made_once_is_not_unwound() {
        let halt = Arc::new(Halt::default());
        halt.set();
        let made = heeding(Some(&halt), || {
            let made = to_the_end(|| {
                work(1 << 40);
                !is_up()
            });
            let inner = attempt(|| {
                (0..1 << 20).for_each(|_| work(1));
                0
            });
            (made, is_up(), inner)
        });
        assert_eq!(made, Some((true, true, None)));
    }
}
