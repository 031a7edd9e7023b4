//! A step's memory as Python sees it, and who may still look at it.
//!
//! A lease is the loaned poses or the reply of one step. Views (`contactd/view.py`) ask it before each use whether its step is
//! over: they never keep a session from going on, they raise. An array that left the package's hands (`numpy.asarray(view)`)
//! cannot be asked; it holds an [`Export`], and while one lives the session refuses to give the memory away. So neither can
//! ever see memory that is unmapped or of another step.

use crate::confined::{Thread, check_thread};
use crate::errors;
use pyo3::exceptions::PyBufferError;
use pyo3::ffi;
use pyo3::prelude::*;
use std::any::Any;
use std::ffi::c_int;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};

/// What lies in a lease's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// Loaned poses, which are written.
    Poses,
    /// A reply: contact records and their further slots, which are read.
    Reply,
}

/// The memory of one step's poses or reply.
#[pyclass(frozen, module = "contactd._native")]
pub struct Lease {
    what: What,
    alive: AtomicBool,
    exports: AtomicUsize,
    thread: Thread,
    address: AtomicUsize,
    bytes: AtomicUsize,
    /// The memory is the session's: it stays while anyone can point to it.
    _owner: Arc<dyn Any + Send + Sync>,
}

impl Lease {
    /// `records` in memory that stays for as long as `owner`.
    pub fn new<T>(
        what: What,
        start: *const T,
        records: usize,
        thread: Thread,
        owner: Arc<dyn Any + Send + Sync>,
    ) -> Self {
        let (address, bytes) = (AtomicUsize::new(start as usize), AtomicUsize::new(records * size_of::<T>()));
        let (alive, exports) = (AtomicBool::new(true), AtomicUsize::new(0));
        Self { what, alive, exports, thread, address, bytes, _owner: owner }
    }

    /// The same lease for the memory of another step, of the same owner. Its step is over, and nobody but those who renew it refers
    /// to it.
    pub fn renew<T>(&self, start: *const T, records: usize) {
        self.address.store(start as usize, Relaxed);
        self.bytes.store(records * size_of::<T>(), Relaxed);
        self.alive.store(true, Relaxed);
    }

    /// # Errors
    /// `StillExported` while arrays into it live outside of the package.
    pub fn check_unexported(&self, py: Python<'_>) -> PyResult<()> {
        match self.exports.load(Relaxed) {
            0 => Ok(()),
            n => {
                let what = if self.what == What::Poses { "poses" } else { "reply" };
                let sentence = format!(
                    "{n} array(s) taken of the step's {what} are still held: drop or copy what numpy.asarray made of the \
                     view before the session goes on"
                );
                Err(errors::exported(py, &sentence))
            }
        }
    }

    /// From now on whoever looks gets an exception.
    pub fn end(&self) {
        self.alive.store(false, Relaxed);
    }

    /// # Errors
    /// `Stale` when the step is over, `Misuse` on another thread.
    pub fn check(&self, py: Python<'_>) -> PyResult<()> {
        check_thread(py, self.thread)?;
        if self.alive.load(Relaxed) {
            return Ok(());
        }
        let sentence = match self.what {
            What::Poses => "the poses of this view were sent: their step is over (copy() before keeps values)",
            What::Reply => {
                "the reply of this view is gone: its session went on to another step (copy() before keeps values)"
            }
        };
        Err(errors::stale(py, sentence))
    }

    /// What lies there.
    pub fn what(&self) -> What {
        self.what
    }

    /// Where it lies.
    pub fn start(&self) -> *mut u8 {
        self.address.load(Relaxed) as *mut u8
    }

    /// How many bytes lie there.
    pub fn len(&self) -> usize {
        self.bytes.load(Relaxed)
    }
}

#[pymethods]
impl Lease {
    /// Raises when the step is over, or on another thread.
    #[pyo3(name = "check")]
    fn checked(&self, py: Python<'_>) -> PyResult<()> {
        self.check(py)
    }

    /// False when the step is over.
    #[getter]
    fn alive(&self) -> bool {
        self.alive.load(Relaxed)
    }

    /// Where it lies.
    #[getter]
    fn address(&self) -> usize {
        self.start() as usize
    }

    /// How many bytes lie there.
    #[getter]
    fn bytes(&self) -> usize {
        self.len()
    }

    /// A buffer that is counted for as long as it lives.
    fn export(slf: &Bound<'_, Self>) -> PyResult<Export> {
        let lease = slf.get();
        lease.check(slf.py())?;
        lease.exports.fetch_add(1, Relaxed);
        Ok(Export { lease: slf.clone().unbind() })
    }

    /// For the array inside of a view: that array is never touched without `check`.
    ///
    /// # Safety
    /// Called by the interpreter with a valid `view`.
    unsafe fn __getbuffer__(slf: Bound<'_, Self>, view: *mut ffi::Py_buffer, flags: c_int) -> PyResult<()> {
        // SAFETY: as promised by the interpreter.
        unsafe { fill(slf.as_any(), slf.get(), view, flags) }
    }
}

/// A counted way to a lease's memory, for arrays that leave the package's hands.
#[pyclass(frozen, module = "contactd._native")]
pub struct Export {
    lease: Py<Lease>,
}

#[pymethods]
impl Export {
    /// # Safety
    /// Called by the interpreter with a valid `view`.
    unsafe fn __getbuffer__(slf: Bound<'_, Self>, view: *mut ffi::Py_buffer, flags: c_int) -> PyResult<()> {
        // SAFETY: as promised by the interpreter.
        unsafe { fill(slf.as_any(), slf.get().lease.get(), view, flags) }
    }
}

impl Drop for Export {
    fn drop(&mut self) {
        self.lease.get().exports.fetch_sub(1, Relaxed);
    }
}

/// Describes a lease's bytes as the buffer of `owner`.
///
/// # Safety
/// `view` is null or points to a `Py_buffer` that may be written.
unsafe fn fill(owner: &Bound<'_, PyAny>, lease: &Lease, view: *mut ffi::Py_buffer, flags: c_int) -> PyResult<()> {
    if view.is_null() {
        return Err(PyBufferError::new_err("no buffer to fill in"));
    }
    // An export lives only while its lease's step does, for the session waits for it; a view checks before it makes its array.
    let (start, bytes) = (lease.start().cast(), lease.len() as ffi::Py_ssize_t);
    // SAFETY: `view` may be written. The memory is `bytes` long, belongs to the owner that the lease holds, and stays until the
    // session has seen that no export is left; where it is not writable the buffer says so.
    match unsafe {
        ffi::PyBuffer_FillInfo(view, owner.as_ptr(), start, bytes, c_int::from(lease.what != What::Poses), flags)
    } {
        0 => Ok(()),
        _ => Err(PyErr::fetch(owner.py())),
    }
}
