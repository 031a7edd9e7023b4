//! The answer to a step: its header, and the slots that are read in place.

use crate::lease::Lease;
use crate::slots::{Slots, known, references};
use contactd_client::Reply as Answer;
use contactd_proto::{ContactRecord, StepReply};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{IntoPyDict, PyDict};

/// The answer to a step; `contactd.Reply` inherits from it.
#[pyclass(subclass, module = "contactd._native")]
pub struct Reply {
    header: StepReply,
    lease: Py<Lease>,
    records: PyOnceLock<Py<Slots>>,
    slots: PyOnceLock<Py<Slots>>,
}

impl Reply {
    /// A `contactd.Reply` of slots and their header.
    pub fn of(py: Python<'_>, lease: Lease, header: StepReply) -> PyResult<Py<Self>> {
        let reply = known(py)?.reply.bind(py).call1((Py::new(py, lease)?,))?.cast_into::<Self>()?;
        reply.try_borrow_mut()?.header = header;
        Ok(reply.unbind())
    }

    /// Makes a reply that nobody but the one that asks refers to, nor to anything of it, that of another step; false when somebody does.
    pub fn renew(
        py: Python<'_>,
        reply: &Py<Self>,
        start: *const ContactRecord,
        slots: usize,
        header: &StepReply,
    ) -> bool {
        if references(py, reply) != 1 {
            return false;
        }
        let Ok(mut this) = reply.bind(py).try_borrow_mut() else { return false };
        let mut held = 1;
        for made in [&this.records, &this.slots].into_iter().filter_map(|made| made.get(py)) {
            match Slots::alone(py, made) {
                Some(references) => held += references,
                None => return false,
            }
        }
        if references(py, &this.lease) != held {
            return false;
        }
        let counts = [(&this.records, records(header, slots)), (&this.slots, slots)];
        let renewed = |(made, count): (&PyOnceLock<Py<Slots>>, usize)| {
            made.get(py).is_none_or(|made| made.get().renew(py, start.cast(), count))
        };
        if !counts.into_iter().all(renewed) {
            return false;
        }
        this.lease.get().renew(start, slots);
        this.header = *header;
        true
    }

    /// Runs `work` on what Rust would read, while the step is not over.
    pub fn read<R>(reply: &Bound<'_, Self>, work: impl FnOnce(&Answer<'_>) -> R) -> PyResult<R> {
        let this = reply.try_borrow()?;
        let lease = this.lease.get();
        lease.check(reply.py())?;
        // SAFETY: so many slots lie there until the step is over, which it is not; nobody writes to them, and `work` runs none of
        // Python's code, which could end the step.
        let slots = unsafe { std::slice::from_raw_parts(lease.start().cast::<ContactRecord>(), this.all()) };
        Ok(work(&Answer::of(this.header, slots)))
    }

    /// Its lease.
    pub fn lease(&self) -> &Py<Lease> {
        &self.lease
    }

    fn count(&self) -> usize {
        records(&self.header, self.all())
    }

    fn all(&self) -> usize {
        self.lease.get().len() / size_of::<ContactRecord>()
    }

    fn slots_of(&self, py: Python<'_>, place: &PyOnceLock<Py<Slots>>, count: usize) -> PyResult<Py<Slots>> {
        self.lease.get().check(py)?;
        place.get_or_try_init(py, || Slots::of(py, &self.lease, count)).map(|slots| slots.clone_ref(py))
    }
}

/// How many of the slots are contact records. Shared memory: what lies there bounds nothing.
fn records(header: &StepReply, slots: usize) -> usize {
    (header.records as usize).min(slots)
}

#[pymethods]
impl Reply {
    #[new]
    fn new(lease: Py<Lease>) -> Self {
        Self { header: StepReply::default(), lease, records: PyOnceLock::new(), slots: PyOnceLock::new() }
    }

    /// The contact records (dtype ``CONTACT``) in the order (time, a, b).
    #[getter]
    fn records(&self, py: Python<'_>) -> PyResult<Py<Slots>> {
        self.slots_of(py, &self.records, self.count())
    }

    /// All slots as they lie in memory: the records, then their further slots.
    #[getter]
    fn slots(&self, py: Python<'_>) -> PyResult<Py<Slots>> {
        self.slots_of(py, &self.slots, self.all())
    }

    fn __len__(&self) -> usize {
        self.count()
    }

    /// The slots' memory.
    #[getter]
    fn _lease(&self, py: Python<'_>) -> Py<Lease> {
        self.lease.clone_ref(py)
    }

    /// The step's number.
    #[getter]
    fn step(&self) -> u64 {
        self.header.step
    }

    #[getter]
    fn _status(&self) -> u32 {
        self.header.status
    }

    /// Smallest time_lower over all pairs: safe to advance to.
    #[getter]
    fn safe_time(&self) -> f64 {
        self.header.safe_time
    }

    /// True when ``max_records`` left records out.
    #[getter]
    fn truncated(&self) -> bool {
        self.header.truncated != 0
    }

    #[getter]
    fn _effects(&self) -> u32 {
        self.header.effects
    }

    /// Pairs that the broad phase let through.
    #[getter]
    fn pairs(&self) -> u32 {
        self.header.pairs
    }

    /// Counted work by name; no part of the answer's bits.
    #[getter]
    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.header.counters.each().into_py_dict(py)
    }

    /// How often each effect was worked out, by its word.
    #[getter]
    fn effect_counters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.header.effect_counters.each().into_py_dict(py)
    }
}
