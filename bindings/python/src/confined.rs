//! A value that belongs to the thread that made it, inside an object that Python may hand to any thread.

use crate::errors;
use pyo3::prelude::*;
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// A thread's number in this process, never given twice. The standard library's id takes ten times as long to ask for, and every
/// call asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Thread(u64);

/// The calling thread.
fn here() -> Thread {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    thread_local!(static HERE: Thread = Thread(NEXT.fetch_add(1, Relaxed)));
    HERE.with(|thread| *thread)
}

/// A value of one thread: others get an exception, and cannot drop it.
#[derive(Debug)]
pub struct Confined<T> {
    value: ManuallyDrop<T>,
    thread: Thread,
}

// SAFETY: the value is reached through `get` and `get_mut` alone, which compare the threads, and dropped on its own thread or not
// at all; so no other thread ever touches it.
unsafe impl<T> Send for Confined<T> {}
// SAFETY: as above.
unsafe impl<T> Sync for Confined<T> {}

impl<T> Confined<T> {
    /// A value of this thread.
    pub fn new(value: T) -> Self {
        Self { value: ManuallyDrop::new(value), thread: here() }
    }

    /// The thread it belongs to.
    pub fn thread(&self) -> Thread {
        self.thread
    }

    /// The value.
    ///
    /// # Errors
    /// `Misuse` on another thread.
    pub fn get_mut(&mut self, py: Python<'_>) -> PyResult<&mut T> {
        check_thread(py, self.thread)?;
        Ok(&mut self.value)
    }
}

impl<T> Drop for Confined<T> {
    fn drop(&mut self) {
        if here() == self.thread {
            // SAFETY: `drop` runs once, and nothing uses the value afterwards.
            unsafe { ManuallyDrop::drop(&mut self.value) }
        }
    }
}

/// # Errors
/// `Misuse` when this is not `thread`.
pub fn check_thread(py: Python<'_>, thread: Thread) -> PyResult<()> {
    if here() == thread {
        return Ok(());
    }
    Err(errors::misuse(py, "a session and its views belong to the thread that opened it; this is another one"))
}

/// Runs `work` on `value` with the interpreter's lock released, so that other Python threads go on meanwhile.
pub fn detached<T, R: Send>(py: Python<'_>, value: &mut T, work: impl FnOnce(&mut T) -> R + Send) -> R {
    struct SameThread<T>(*mut T);
    // SAFETY: `detach` runs its closure on the calling thread, before it returns; the pointer never reaches another one.
    unsafe impl<T> Send for SameThread<T> {}
    impl<T> SameThread<T> {
        fn pointer(&self) -> *mut T {
            self.0
        }
    }
    let pointer = SameThread(value as *mut T);
    // SAFETY: `value` is borrowed exclusively for as long as the closure runs.
    py.detach(move || work(unsafe { &mut *pointer.pointer() }))
}
