//! A value that belongs to the thread that made it, inside an object that Python may hand to any thread.

use crate::errors;
use pyo3::prelude::*;
use std::mem::ManuallyDrop;
use std::thread::ThreadId;

/// A value of one thread: others get an exception, and cannot drop it.
#[derive(Debug)]
pub struct Confined<T> {
    value: ManuallyDrop<T>,
    thread: ThreadId,
}

// SAFETY: the value is reached through `get` and `get_mut` alone, which compare the threads, and dropped on its own thread or not
// at all; so no other thread ever touches it.
unsafe impl<T> Send for Confined<T> {}
// SAFETY: as above.
unsafe impl<T> Sync for Confined<T> {}

impl<T> Confined<T> {
    /// A value of this thread.
    pub fn new(value: T) -> Self {
        Self { value: ManuallyDrop::new(value), thread: std::thread::current().id() }
    }

    /// The thread it belongs to.
    pub fn thread(&self) -> ThreadId {
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
        if std::thread::current().id() == self.thread {
            // SAFETY: `drop` runs once, and nothing uses the value afterwards.
            unsafe { ManuallyDrop::drop(&mut self.value) }
        }
    }
}

/// # Errors
/// `Misuse` when this is not `thread`.
pub fn check_thread(py: Python<'_>, thread: ThreadId) -> PyResult<()> {
    if std::thread::current().id() == thread {
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
