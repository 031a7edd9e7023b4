//! A step's memory as Python sees it, and who may still look at it.
//!
//! A lease is the loaned poses or the reply of one step. Views (`contactd/view.py`) ask it before each use whether its step is
//! over: they never keep a session from going on, they raise. An array that left the package's hands (`numpy.asarray(view)`)
//! cannot be asked; it holds an [`Export`], and while one lives the session refuses to give the memory away. So neither can
//! ever see memory that is unmapped or of another step.

use crate::confined::{Thread, check_thread};
use crate::errors;
use crate::session::Session;
use pyo3::exceptions::PyBufferError;
use pyo3::ffi;
use pyo3::prelude::*;
use std::ffi::c_int;
use std::mem::MaybeUninit;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};

/// What a session and its leases know of one piece of memory.
#[derive(Debug)]
pub struct Span {
    what: &'static str,
    alive: AtomicBool,
    exports: AtomicUsize,
    thread: Thread,
}

impl Span {
    /// Memory of `what` ("poses", "reply"), which may be looked at.
    pub fn new(what: &'static str, thread: Thread) -> Arc<Self> {
        Arc::new(Self { what, alive: AtomicBool::new(true), exports: AtomicUsize::new(0), thread })
    }

    /// # Errors
    /// `StillExported` while arrays into it live outside of the package.
    pub fn check_unexported(&self, py: Python<'_>) -> PyResult<()> {
        match self.exports.load(Relaxed) {
            0 => Ok(()),
            n => {
                let what = self.what;
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

    fn check(&self, py: Python<'_>) -> PyResult<()> {
        check_thread(py, self.thread)?;
        if self.alive.load(Relaxed) {
            return Ok(());
        }
        let sentence = match self.what {
            "poses" => "the poses of this view were sent: their step is over (copy() before keeps values)",
            _ => "the reply of this view is gone: its session went on to another step (copy() before keeps values)",
        };
        Err(errors::stale(py, sentence))
    }
}

/// The memory of one step's poses or reply.
#[pyclass(frozen, module = "contactd._native")]
#[derive(Debug)]
pub struct Lease {
    span: Arc<Span>,
    address: usize,
    bytes: usize,
    writable: bool,
    /// The memory is the session's: it stays while anyone can point to it.
    _session: Py<Session>,
}

impl Lease {
    /// `records` in the memory of `session`.
    pub fn new<T>(span: Arc<Span>, start: *const T, records: usize, writable: bool, session: Py<Session>) -> Self {
        let bytes = records * size_of::<T>();
        Self { span, address: start as usize, bytes, writable, _session: session }
    }
}

#[pymethods]
impl Lease {
    /// Raises when the step is over, or on another thread.
    fn check(&self, py: Python<'_>) -> PyResult<()> {
        self.span.check(py)
    }

    /// False when the step is over.
    #[getter]
    fn alive(&self) -> bool {
        self.span.alive.load(Relaxed)
    }

    /// Where it lies.
    #[getter]
    fn address(&self) -> usize {
        self.address
    }

    /// How many bytes lie there.
    #[getter]
    fn bytes(&self) -> usize {
        self.bytes
    }

    /// A buffer that is counted for as long as it lives.
    fn export(slf: &Bound<'_, Self>) -> PyResult<Export> {
        let lease = slf.get();
        lease.span.check(slf.py())?;
        lease.span.exports.fetch_add(1, Relaxed);
        Ok(Export { lease: slf.clone().unbind() })
    }

    /// Copies the bytes of `value` over all of the memory, if it has as many in one piece; says whether it had. numpy copies records
    /// field by field, which takes longer than a small step.
    fn write(&self, value: &Bound<'_, PyAny>) -> PyResult<bool> {
        let py = value.py();
        self.span.check(py)?;
        let mut buffer = MaybeUninit::<ffi::Py_buffer>::uninit();
        // SAFETY: `buffer` may be written; it is read and released only where the call says that it was filled in.
        if unsafe { ffi::PyObject_GetBuffer(value.as_ptr(), buffer.as_mut_ptr(), ffi::PyBUF_SIMPLE) } != 0 {
            let _ = PyErr::take(py);
            return Ok(false);
        }
        // SAFETY: filled in, as the call said.
        let buffer = unsafe { buffer.assume_init_mut() };
        let fits = self.writable && buffer.len == self.bytes as ffi::Py_ssize_t;
        if fits {
            // SAFETY: `buf` holds `len` bytes until the buffer is released; the lease's memory is as long, its step is not over
            // and it may be written. The two may overlap.
            unsafe { std::ptr::copy(buffer.buf as *const u8, self.address as *mut u8, self.bytes) }
        }
        // SAFETY: filled in above and released once.
        unsafe { ffi::PyBuffer_Release(buffer) }
        Ok(fits)
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
#[derive(Debug)]
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
        self.lease.get().span.exports.fetch_sub(1, Relaxed);
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
    let (start, bytes) = (lease.address as *mut std::ffi::c_void, lease.bytes as ffi::Py_ssize_t);
    // SAFETY: `view` may be written. The memory is `bytes` long, belongs to the session that the lease holds, and stays until the
    // session has seen that no export is left; where it is not writable the buffer says so.
    match unsafe { ffi::PyBuffer_FillInfo(view, owner.as_ptr(), start, bytes, c_int::from(!lease.writable), flags) } {
        0 => Ok(()),
        _ => Err(PyErr::fetch(owner.py())),
    }
}
