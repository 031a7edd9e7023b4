//! The slots of a step, and the ways of filling them that must not cost more than the copy.
//!
//! `contactd.view.Slots` inherits from [`Slots`] and adds what views know of numpy. Here is what every step does: slots are made,
//! a batch is written over them as a whole or field by field from arrays of the field's own type. Whatever else is assigned goes
//! through numpy, which says what is wrong with it.

use crate::lease::{Lease, What};
use contactd_proto::{ContactRecord, PoseRecord};
use pyo3::exceptions::PyValueError;
use pyo3::ffi;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyInt, PySlice, PyString};
use std::mem::offset_of;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Classes and types of Python that are looked up once.
pub struct Known {
    /// `contactd.view.Slots`.
    slots: Py<PyAny>,
    /// `contactd.reply.Reply`.
    pub reply: Py<PyAny>,
    ndarray: Py<PyAny>,
    float: Py<PyAny>,
    word: Py<PyAny>,
    pose: Py<PyAny>,
    contact: Py<PyAny>,
}

/// What Python calls the things that are needed of it.
pub fn known(py: Python<'_>) -> PyResult<&Known> {
    static KNOWN: PyOnceLock<Known> = PyOnceLock::new();
    KNOWN.get_or_try_init(py, || {
        let of = |module: &str, name: &str| py.import(module)?.getattr(name).map(Bound::unbind);
        let dtype = |code: &str| py.import("numpy")?.getattr("dtype")?.call1((code,)).map(Bound::unbind);
        Ok(Known {
            slots: of("contactd.view", "Slots")?,
            reply: of("contactd.reply", "Reply")?,
            ndarray: of("numpy", "ndarray")?,
            float: dtype("<f8")?,
            word: dtype("<u4")?,
            pose: of("contactd.records", "POSE")?,
            contact: of("contactd.records", "CONTACT")?,
        })
    })
}

/// The first slots of a lease.
#[pyclass(subclass, frozen, mapping, module = "contactd._native")]
pub struct Slots {
    lease: Py<Lease>,
    count: AtomicUsize,
    /// Made when it is asked for: a batch that is assigned needs none, nor does an empty reply.
    array: PyOnceLock<Py<PyAny>>,
}

impl Slots {
    /// The first `count` slots of a lease, as a `contactd.view.Slots`.
    pub fn of(py: Python<'_>, lease: &Py<Lease>, count: usize) -> PyResult<Py<Self>> {
        Ok(known(py)?.slots.bind(py).call1((lease, count))?.cast_into::<Self>()?.unbind())
    }

    /// Those of poses.
    pub fn of_poses(py: Python<'_>, lease: Lease) -> PyResult<Py<Self>> {
        let count = lease.len() / size_of::<PoseRecord>();
        Self::of(py, &Py::new(py, lease)?, count)
    }

    /// The lease.
    pub fn lease(&self) -> &Py<Lease> {
        &self.lease
    }

    /// How many references to the lease these slots hold, if nobody but the one that asks refers to them, or to anything made of them
    /// alone: then nobody would see that they become those of another step.
    pub fn alone(py: Python<'_>, slots: &Py<Self>) -> Option<usize> {
        if references(py, slots) != 1 {
            return None;
        }
        match slots.get().array.get(py) {
            None => Some(1),
            // The array holds the lease as its memory.
            Some(array) => (references(py, array) == 1).then_some(2),
        }
    }

    /// Makes them the first `count` slots of a lease that is about to be renewed for memory from `start` on; false when they cannot be:
    /// their array is that of other memory.
    pub fn renew(&self, py: Python<'_>, start: *const u8, count: usize) -> bool {
        let same = start == self.lease.get().start().cast_const() && count == self.count.load(Relaxed);
        if same || self.array.get(py).is_none() {
            self.count.store(count, Relaxed);
            return true;
        }
        false
    }

    fn count(&self) -> usize {
        self.count.load(Relaxed)
    }

    fn array<'py>(&self, py: Python<'py>) -> PyResult<&Bound<'py, PyAny>> {
        let made = self.array.get_or_try_init(py, || {
            let known = known(py)?;
            let dtype = if self.lease.get().what() == What::Poses { &known.pose } else { &known.contact };
            known.ndarray.bind(py).call1(((self.count(),), dtype, &self.lease)).map(Bound::unbind)
        });
        made.map(|array| array.bind(py))
    }

    /// The slots' records, while the step is not over. Whatever runs Python's code may end it (an index, a conversion): asked for
    /// right before each copy, and nothing of Python's runs between.
    fn records(&self, py: Python<'_>) -> PyResult<Records> {
        let lease = self.lease.get();
        lease.check(py)?;
        // SAFETY: of the lease's memory, which may be written while its step is not over, as was checked, and which begins with
        // `count` pose records: `new` and `renew` have counted them.
        Ok(unsafe { Records::new(lease.start(), self.count()) })
    }

    /// Writes `value` over all slots, or over one field of all; false when it is none of the values that can be copied as they are.
    fn copied(&self, key: &Bound<'_, PyAny>, value: &Bound<'_, PyAny>) -> PyResult<bool> {
        let py = key.py();
        if self.lease.get().what() != What::Poses {
            return Ok(false);
        }
        let known = known(py)?;
        if let Ok(key) = key.cast_exact::<PyString>() {
            let Some(field) = Field::of(key)? else { return Ok(false) };
            if let (Type::Word, Ok(number)) = (field.of, value.cast::<PyInt>()) {
                let Ok(number) = number.extract::<u32>() else { return Ok(false) };
                self.records(py)?.set(field, number);
                return Ok(true);
            }
            let dtype = if field.of == Type::Word { &known.word } else { &known.float };
            let Some(array) = Held::array(known, value, |found| Ok(found.is(dtype)))? else { return Ok(false) };
            let records = self.records(py)?;
            let fits = match (array.shape(), field.numbers) {
                (&[n], 1) => n == records.count as isize,
                (&[n, m], k) => n == records.count as isize && m == k as isize && k > 1,
                _ => false,
            };
            return Ok(fits && records.copy_field(field, &array));
        }
        if !key.cast_exact::<PySlice>().is_ok_and(|slice| is_all(slice, self.count())) {
            return Ok(false);
        }
        let Some(array) = Held::poses(known, value)? else { return Ok(false) };
        let records = self.records(py)?;
        Ok(array.shape() == [records.count as isize] && records.copy(&array))
    }
}

#[pymethods]
impl Slots {
    #[new]
    fn new(lease: Py<Lease>, count: usize) -> PyResult<Self> {
        let size = match lease.get().what() {
            What::Poses => size_of::<PoseRecord>(),
            What::Reply => size_of::<ContactRecord>(),
        };
        let there = lease.get().len() / size;
        if count > there {
            return Err(PyValueError::new_err(format!("expected at most {there} slots, found {count}")));
        }
        Ok(Self { lease, count: AtomicUsize::new(count), array: PyOnceLock::new() })
    }

    #[getter]
    fn _lease(&self, py: Python<'_>) -> Py<Lease> {
        self.lease.clone_ref(py)
    }

    /// The plain array over the slots, which nobody may see but after `check`.
    #[getter]
    fn _array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py).cloned()
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.lease.get().check(py)?;
        Ok(self.count())
    }

    fn __setitem__(slf: &Bound<'_, Self>, key: &Bound<'_, PyAny>, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let py = slf.py();
        slf.get().lease.get().check(py)?;
        if !slf.get().copied(key, value)? {
            slf.call_method1(intern!(py, "_assign"), (key, value))?;
        }
        Ok(())
    }
}

/// How many references there are to an object: a mortal one's, by their low 32 bits, since from 3.14 on flags lie above them.
pub fn references<T>(_: Python<'_>, object: &Py<T>) -> usize {
    // SAFETY: a live object, and the interpreter's lock is held.
    unsafe { ffi::Py_REFCNT(object.as_ptr()) as u32 as usize }
}

/// True for `[:]` and all that means the same of `n` elements.
fn is_all(slice: &Bound<'_, PySlice>, n: usize) -> bool {
    slice.indices(n as isize).is_ok_and(|i| i.start == 0 && i.step == 1 && i.slicelength == n)
}

/// What a field's numbers are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Type {
    Word,
    Float,
}

/// A field of a pose record.
#[derive(Clone, Copy, Debug)]
struct Field {
    at: usize,
    of: Type,
    numbers: usize,
}

impl Field {
    fn of(name: &Bound<'_, PyString>) -> PyResult<Option<Self>> {
        let field = |at, of, numbers| Some(Self { at, of, numbers });
        Ok(match name.to_cow()?.as_ref() {
            "object" => field(offset_of!(PoseRecord, object), Type::Word, 1),
            "flags" => field(offset_of!(PoseRecord, flags), Type::Word, 1),
            "position" => field(offset_of!(PoseRecord, position), Type::Float, 3),
            "rotation" => field(offset_of!(PoseRecord, rotation), Type::Float, 4),
            _ => None,
        })
    }
}

/// Pose records in a lease's memory, to which numpy's arrays may point too: they are reached by pointer alone.
struct Records {
    start: *mut u8,
    count: usize,
}

impl Records {
    const SIZE: usize = size_of::<PoseRecord>();

    /// # Safety
    /// There are `count` records from `start` on, which may be written for as long as this lives.
    unsafe fn new(start: *mut u8, count: usize) -> Self {
        Self { start, count }
    }

    /// All of them from as many bytes; false, and nothing is done, when there are others.
    fn copy(&self, from: &Held) -> bool {
        if from.len() != self.count * Self::SIZE {
            return false;
        }
        // SAFETY: as long as the records, as was compared; the two may overlap.
        unsafe { std::ptr::copy(from.start(), self.start, from.len()) }
        true
    }

    fn set(&self, field: Field, number: u32) {
        for i in 0..self.count {
            // SAFETY: a word of one of the records, aligned as they are.
            unsafe { self.start.add(i * Self::SIZE + field.at).cast::<u32>().write(number) }
        }
    }

    /// One field of all, from its bytes without gaps; false, and nothing is done, when they are not as many, or lie among the
    /// records themselves.
    fn copy_field(&self, field: Field, from: &Held) -> bool {
        match (field.of, field.numbers) {
            (Type::Word, _) => self.copy_each::<4>(field.at, from),
            (Type::Float, 3) => self.copy_each::<24>(field.at, from),
            (Type::Float, _) => self.copy_each::<32>(field.at, from),
        }
    }

    fn copy_each<const N: usize>(&self, at: usize, from: &Held) -> bool {
        let (own, theirs) = (self.start as usize, from.start() as usize);
        let apart = theirs + from.len() <= own || own + self.count * Self::SIZE <= theirs;
        if from.len() != self.count * N || !apart {
            return false;
        }
        for i in 0..self.count {
            // SAFETY: `N` bytes of a field of one of the records, from the `N` of as many that are its own; apart from each other, as
            // was compared.
            unsafe { std::ptr::copy_nonoverlapping(from.start().add(i * N), self.start.add(i * Self::SIZE + at), N) }
        }
        true
    }
}

/// A buffer of Python's without gaps, held. It stays where it was filled in: its shape may point into it.
pub struct Held(Box<ffi::Py_buffer>);

impl Held {
    /// That of an array; `None` for other things, for types that `dtype` says no to, for arrays with gaps.
    fn array(
        known: &Known,
        value: &Bound<'_, PyAny>,
        dtype: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<bool>,
    ) -> PyResult<Option<Self>> {
        let py = value.py();
        // A class of the user's own may mean something else by assignment.
        if !value.get_type().is(&known.ndarray) || !dtype(&value.getattr(intern!(py, "dtype"))?)? {
            return Ok(None);
        }
        Ok(Self::of(value).ok())
    }

    /// That of an array of pose records.
    fn poses(known: &Known, value: &Bound<'_, PyAny>) -> PyResult<Option<Self>> {
        let pose = |found: &Bound<'_, PyAny>| if found.is(&known.pose) { Ok(true) } else { found.eq(&known.pose) };
        Self::array(known, value, pose)
    }

    /// That of anything that has one without gaps.
    pub fn of(value: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut buffer = Box::<ffi::Py_buffer>::new_uninit();
        // SAFETY: `buffer` may be written; it is read and released only where the call says that it was filled in.
        if unsafe { ffi::PyObject_GetBuffer(value.as_ptr(), buffer.as_mut_ptr(), ffi::PyBUF_ND) } != 0 {
            return Err(PyErr::fetch(value.py()));
        }
        // SAFETY: filled in, as the call said.
        Ok(Self(unsafe { buffer.assume_init() }))
    }

    fn shape(&self) -> &[isize] {
        if self.0.shape.is_null() || self.0.ndim <= 0 {
            return &[];
        }
        // SAFETY: PyBUF_ND asks for the numbers of elements along each of the `ndim` axes.
        unsafe { std::slice::from_raw_parts(self.0.shape, self.0.ndim as usize) }
    }

    /// Where its bytes lie.
    pub fn start(&self) -> *const u8 {
        self.0.buf.cast_const().cast()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        usize::try_from(self.0.len).unwrap_or(0)
    }
}

/// An array of pose records along one axis.
pub struct Batch(Held);

impl Batch {
    /// Of an array; `None` for what is none, or has gaps.
    pub fn of(py: Python<'_>, value: &Bound<'_, PyAny>) -> PyResult<Option<Self>> {
        let held = Held::poses(known(py)?, value)?;
        Ok(held
            .filter(|h| h.shape().len() == 1 && h.len() == h.shape()[0] as usize * size_of::<PoseRecord>())
            .map(Self))
    }

    /// How many records there are.
    pub fn len(&self) -> usize {
        self.0.len() / size_of::<PoseRecord>()
    }

    /// Copies them into as many slots.
    pub fn copy_to(&self, slots: &mut [PoseRecord]) {
        assert_eq!(slots.len(), self.len());
        // SAFETY: as long as the slots; the two may overlap. Every pattern of bits is a record.
        unsafe { std::ptr::copy(self.0.start(), slots.as_mut_ptr().cast::<u8>(), self.0.len()) }
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        // SAFETY: filled in by `of` and released once, under the interpreter's lock: it is never kept beyond a call.
        unsafe { ffi::PyBuffer_Release(&mut *self.0) }
    }
}
