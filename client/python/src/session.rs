//! The session, and the reply of a step. Everything that may take time runs with the interpreter's lock released.

use crate::confined::{Confined, detached};
use crate::errors;
use crate::lease::{Lease, Span};
use crate::mass::MassProperties;
use crate::options::Options;
use crate::rules::RuleFields;
use contactd::ipc::{Embedded, ServerConfig};
use contactd_client::proto::control::Facets;
use contactd_client::{Error, MassOptions, Object, SharedMemory, StepOptions, Transport};
use contactd_proto::names::Address;
use contactd_proto::{ContactRecord, Pose, PoseRecord, StepReply};
use glam::{DQuat, DVec3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::sync::Arc;
use std::time::{Duration, Instant};

type Inner = contactd_client::Session<Box<dyn Transport>>;

/// A model: id, faces (primitive, name, face, subtracted), warnings.
type Loaded = (u32, Vec<(u32, String, String, bool)>, Vec<String>);

/// Longest wait between two looks for signals (Ctrl-C).
const SLICE: Duration = Duration::from_millis(100);

/// A pose from its numbers. The rotation must be a unit quaternion x, y, z, w; the server says when it is not.
pub fn pose(position: [f64; 3], rotation: [f64; 4]) -> Pose {
    Pose::new(DVec3::from_array(position), DQuat::from_array(rotation))
}

/// One client's scene.
#[pyclass(module = "contactd._native")]
pub struct Session {
    inner: Confined<Option<Inner>>,
    options: Py<Options>,
    poses: Option<Arc<Span>>,
    reply: Option<Arc<Span>>,
}

/// A session on the server called `name` of this user.
#[pyfunction]
pub fn connect(py: Python<'_>, name: &str) -> PyResult<Session> {
    open(py, || Ok(Box::new(SharedMemory::new(Address::of(name)?))))
}

/// A session on an engine in this process; `config` is a server's configuration file.
#[pyfunction]
#[pyo3(signature = (config = None))]
pub fn embedded(py: Python<'_>, config: Option<std::path::PathBuf>) -> PyResult<Session> {
    let config = config.map_or_else(|| Ok(ServerConfig::default()), |path| ServerConfig::read(&path));
    let config = config.map_err(PyValueError::new_err)?;
    open(py, move || Ok(Box::new(Embedded::new(&config))))
}

fn open(py: Python<'_>, make: impl FnOnce() -> Result<Box<dyn Transport>, Error> + Send) -> PyResult<Session> {
    let opened = py.detach(|| make().and_then(Inner::new).map(|inner| Confined::new(Some(inner))));
    let inner = opened.map_err(|e| errors::of(py, &e))?;
    Ok(Session { inner, options: Py::new(py, Options::default())?, poses: None, reply: None })
}

impl Session {
    /// The session for one call, which no other thread may be in the middle of.
    fn enter<'py>(slf: &Bound<'py, Self>) -> PyResult<PyRefMut<'py, Self>> {
        slf.try_borrow_mut().map_err(|_| errors::misuse(slf.py(), "the session is in use by another call"))
    }

    fn open_inner(&mut self, py: Python<'_>) -> PyResult<&mut Inner> {
        self.inner.get_mut(py)?.as_mut().ok_or_else(|| errors::misuse(py, "the session is closed"))
    }

    /// Runs a call of the session with the interpreter's lock released.
    fn call<R: Send>(slf: &Bound<'_, Self>, work: impl FnOnce(&mut Inner) -> Result<R, Error> + Send) -> PyResult<R> {
        let py = slf.py();
        let mut this = Self::enter(slf)?;
        detached(py, this.open_inner(py)?, work).map_err(|e| errors::of(py, &e))
    }

    /// Takes the memory of poses and reply back.
    fn revoke(&mut self, py: Python<'_>) -> PyResult<()> {
        let spans = [&mut self.poses, &mut self.reply];
        spans.iter().filter_map(|s| s.as_ref()).try_for_each(|s| s.check_unexported(py))?;
        spans.into_iter().filter_map(Option::take).for_each(|s| s.end());
        Ok(())
    }

    /// Slots for poses from `loan`, as a lease.
    fn loan(
        slf: &Bound<'_, Self>,
        loan: impl FnOnce(&mut Inner) -> Result<&mut [PoseRecord], Error>,
    ) -> PyResult<Lease> {
        let py = slf.py();
        let mut this = Self::enter(slf)?;
        this.open_inner(py)?;
        this.revoke(py)?;
        let slots = loan(this.open_inner(py)?).map_err(|e| errors::of(py, &e))?;
        let (start, n) = (slots.as_mut_ptr(), slots.len());
        let span = Span::new("poses", this.inner.thread());
        this.poses = Some(span.clone());
        Ok(Lease::new(span, start, n, true, slf.clone().unbind()))
    }

    /// Sends the poses if they were not yet: their memory is the server's from now on.
    fn send_loaned(&mut self, py: Python<'_>) -> PyResult<()> {
        self.open_inner(py)?;
        if let Some(span) = &self.poses {
            span.check_unexported(py)?;
            span.end();
            self.poses = None;
            let options = StepOptions::from(&*self.options.try_borrow(py)?);
            self.open_inner(py)?.options = options;
        }
        Ok(())
    }
}

/// Seconds as a duration; `None` for ever.
fn duration(seconds: Option<f64>) -> PyResult<Duration> {
    match seconds {
        None => Ok(Duration::MAX),
        Some(s) if s >= 0.0 => Ok(Duration::try_from_secs_f64(s).unwrap_or(Duration::MAX)),
        Some(s) => Err(PyValueError::new_err(format!("expected a timeout of 0 seconds or more, found {s}"))),
    }
}

#[pymethods]
impl Session {
    /// What is asked of the steps to come.
    #[getter]
    fn options(&self, py: Python<'_>) -> Py<Options> {
        self.options.clone_ref(py)
    }

    /// The session's id, its server's epoch, most records of a batch.
    fn opened(slf: &Bound<'_, Self>) -> PyResult<(u64, u64, u32)> {
        let mut this = Self::enter(slf)?;
        let opened = this.open_inner(slf.py())?.opened();
        Ok((opened.session, opened.epoch, opened.max_batch))
    }

    /// True after `close`.
    #[getter]
    fn closed(slf: &Bound<'_, Self>) -> PyResult<bool> {
        Ok(Self::enter(slf)?.inner.get_mut(slf.py())?.is_none())
    }

    fn load_model(slf: &Bound<'_, Self>, name: String, text: String, facets: &str) -> PyResult<Loaded> {
        let facets = match facets {
            "auto" => Facets::Auto,
            "exact" => Facets::Exact,
            "as-written" => Facets::AsWritten,
            other => {
                let sentence = format!("facets = {other:?} is none of auto, exact, as-written");
                return Err(PyValueError::new_err(sentence));
            }
        };
        let info = Self::call(slf, move |s| s.load_model_with(&name, &text, facets))?;
        let faces = info.faces.into_iter().map(|f| (f.primitive, f.name, f.face, f.subtracted)).collect();
        Ok((info.id, faces, info.warnings))
    }

    fn mass_properties(slf: &Bound<'_, Self>, model: u32, tolerance: f64, boxes: u64) -> PyResult<MassProperties> {
        let options = MassOptions { tolerance, boxes };
        Self::call(slf, move |s| s.mass_properties(model, &options)).map(MassProperties)
    }

    fn add_object(
        slf: &Bound<'_, Self>,
        name: &str,
        model: u32,
        group: &str,
        fixed: bool,
        rotates: bool,
        max_speed: f64,
        place: ([f64; 3], [f64; 4]),
        at: ([f64; 3], [f64; 4]),
    ) -> PyResult<u32> {
        let mut object = Object::new(name, model).group(group).max_speed(max_speed);
        object = object.place(pose(place.0, place.1)).at(pose(at.0, at.1));
        object = if fixed { object.fixed() } else { object };
        object = if rotates { object } else { object.without_rotation() };
        Self::call(slf, move |s| s.add_object(object))
    }

    fn remove_object(slf: &Bound<'_, Self>, object: u32) -> PyResult<()> {
        Self::call(slf, move |s| s.remove_object(object))
    }

    fn set_rules(slf: &Bound<'_, Self>, rules: Vec<RuleFields>) -> PyResult<()> {
        let rules = rules.into_iter().enumerate().map(|(i, r)| r.rule(slf.py(), i)).collect::<PyResult<Vec<_>>>()?;
        Self::call(slf, move |s| s.set_rules(&rules))
    }

    fn set_resolution(slf: &Bound<'_, Self>, resolution: Option<f64>) -> PyResult<()> {
        Self::call(slf, move |s| s.set_resolution(resolution))
    }

    /// Slots for `n` poses.
    fn begin_step(slf: &Bound<'_, Self>, n: usize) -> PyResult<Lease> {
        Self::loan(slf, |s| s.begin_step(n))
    }

    /// The batch that was in flight when the server died, loaned again.
    fn resend(slf: &Bound<'_, Self>) -> PyResult<Lease> {
        Self::loan(slf, |s| s.resend())
    }

    fn send(slf: &Bound<'_, Self>) -> PyResult<()> {
        let py = slf.py();
        let mut this = Self::enter(slf)?;
        this.send_loaned(py)?;
        detached(py, this.open_inner(py)?, |s| s.send()).map_err(|e| errors::of(py, &e))
    }

    #[pyo3(signature = (timeout = None))]
    fn finish(slf: &Bound<'_, Self>, timeout: Option<f64>) -> PyResult<Reply> {
        let py = slf.py();
        let timeout = duration(timeout)?;
        let mut this = Self::enter(slf)?;
        this.send_loaned(py)?;
        let start = Instant::now();
        let (header, address, slots) = loop {
            let left = timeout.saturating_sub(start.elapsed());
            let answer = detached(py, this.open_inner(py)?, |s| {
                s.finish(left.min(SLICE)).map(|r| (*r.header(), r.slots().as_ptr() as usize, r.slots().len()))
            });
            match answer {
                Ok(answer) => break answer,
                Err(Error::Timeout) if left > SLICE => py.check_signals()?,
                Err(e) => return Err(errors::of(py, &e)),
            }
        };
        this.options.try_borrow_mut(py)?.advance = 1.0;
        let span = Span::new("reply", this.inner.thread());
        this.reply = Some(span.clone());
        let start = address as *const ContactRecord;
        Ok(Reply { header, lease: Py::new(py, Lease::new(span, start, slots, false, slf.clone().unbind()))? })
    }

    fn reconnect(slf: &Bound<'_, Self>, timeout: f64) -> PyResult<()> {
        let timeout = duration(Some(timeout))?;
        let mut this = Self::enter(slf)?;
        this.open_inner(slf.py())?;
        this.revoke(slf.py())?;
        detached(slf.py(), this.open_inner(slf.py())?, |s| s.reconnect(timeout)).map_err(|e| errors::of(slf.py(), &e))
    }

    /// Ends the session. One whose server is gone has ended already.
    fn close(slf: &Bound<'_, Self>) -> PyResult<()> {
        let py = slf.py();
        let mut this = Self::enter(slf)?;
        if this.inner.get_mut(py)?.is_none() {
            return Ok(());
        }
        this.revoke(py)?;
        match detached(py, this.inner.get_mut(py)?, |s| s.take().map_or(Ok(()), Inner::close)) {
            Ok(()) | Err(Error::ServerLost | Error::Misuse(_)) => Ok(()),
            Err(e) => Err(errors::of(py, &e)),
        }
    }

    /// Nanoseconds of each of `steps` steps made by Rust alone, with the batches of pose records in `batches` taking turns: what
    /// Python's own steps are compared with.
    fn _steps_in_rust(slf: &Bound<'_, Self>, batches: Vec<Vec<u8>>, steps: usize) -> PyResult<Vec<u64>> {
        let size = size_of::<PoseRecord>();
        if batches.is_empty() || batches.iter().any(|b| b.len() % size != 0) {
            return Err(PyValueError::new_err("expected batches of whole pose records"));
        }
        let batches: Vec<Vec<PoseRecord>> =
            batches.iter().map(|b| b.chunks_exact(size).map(record).collect()).collect();
        Self::enter(slf)?.revoke(slf.py())?;
        Self::call(slf, move |s| {
            let mut times = Vec::with_capacity(steps);
            for k in 0..steps {
                let batch = &batches[k % batches.len()];
                let start = Instant::now();
                s.begin_step(batch.len())?.copy_from_slice(batch);
                s.finish(Duration::from_secs(60))?;
                times.push(start.elapsed().as_nanos() as u64);
            }
            Ok(times)
        })
    }
}

/// A pose record from its 64 bytes.
fn record(bytes: &[u8]) -> PoseRecord {
    let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
    let float = |at: usize| f64::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
    PoseRecord {
        object: word(0),
        flags: word(4),
        position: std::array::from_fn(|i| float(8 + 8 * i)),
        rotation: std::array::from_fn(|i| float(32 + 8 * i)),
    }
}

/// The answer to a step: its header, and the lease of its slots.
#[pyclass(frozen, module = "contactd._native")]
#[derive(Debug)]
pub struct Reply {
    header: StepReply,
    lease: Py<Lease>,
}

#[pymethods]
impl Reply {
    /// The slots' memory.
    #[getter]
    fn lease(&self, py: Python<'_>) -> Py<Lease> {
        self.lease.clone_ref(py)
    }

    /// The step's number.
    #[getter]
    fn step(&self) -> u64 {
        self.header.step
    }

    /// `STEP_…`.
    #[getter]
    fn status(&self) -> u32 {
        self.header.status
    }

    /// Contact records.
    #[getter]
    fn n_records(&self) -> u32 {
        self.header.records
    }

    /// Smallest time_lower over all pairs.
    #[getter]
    fn safe_time(&self) -> f64 {
        self.header.safe_time
    }

    /// Records were left out.
    #[getter]
    fn truncated(&self) -> bool {
        self.header.truncated != 0
    }

    /// Bits of the effects that ran.
    #[getter]
    fn effects(&self) -> u32 {
        self.header.effects
    }

    /// Pairs that the broad phase let through.
    #[getter]
    fn pairs(&self) -> u32 {
        self.header.pairs
    }

    /// Counted work by name.
    #[getter]
    fn counters(&self) -> Vec<(&'static str, u64)> {
        let c = &self.header.counters;
        vec![
            ("box_tests", c.box_tests),
            ("primitives", c.primitives),
            ("after_stage1", c.after_stage1),
            ("node_pairs", c.node_pairs),
            ("candidates", c.candidates),
            ("cells", c.cells),
            ("clauses", c.clauses),
            ("newton", c.newton),
            ("closed_forms", c.closed_forms),
            ("may_have_passed", c.may_have_passed),
            ("instant_cells", c.instant_cells),
        ]
    }

    /// How often each effect was worked out, by its word.
    #[getter]
    fn effect_counters(&self) -> Vec<(&'static str, u64)> {
        self.header.effect_counters.each().collect()
    }
}
