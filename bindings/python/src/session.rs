//! The session. Everything that may take time runs with the interpreter's lock released.

use crate::confined::{Confined, Thread, check_thread, detached};
use crate::errors;
use crate::lease::{Lease, What};
use crate::mass::MassProperties;
use crate::options::Options;
use crate::pose::{PoseFields, pose};
use crate::queries;
use crate::reply::Reply;
use crate::rules;
use crate::slots::{Batch, Slots, references};
use contactd::ipc::{Embedded, ServerConfig};
use contactd_client::proto::control::{Facets, ModelFile};
use contactd_client::transport::Opened;
use contactd_client::{Error, Frame, MassOptions, Object, Reply as Answer, SharedMemory, StepOptions, Transport};
use contactd_proto::names::Address;
use contactd_proto::query::{PointOptions, PointRecord, RayOptions, RayRecord};
use contactd_proto::{ContactRecord, PoseRecord, StepReply};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PySlice};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

type Inner = contactd_client::Session<Box<dyn Transport>>;

/// A model: id, faces (primitive, name, face, subtracted), warnings.
type Loaded = (u32, Vec<(u32, String, String, bool)>, Vec<String>);

/// Bounds of a distance, the points, settled, cells.
type Apart = (f64, f64, [[f64; 3]; 2], bool, u64);

/// What was recorded: file, steps, left out, without a picture, bytes, why it failed.
type Recorded = (String, u64, u64, u64, u64, String);

/// Longest wait between two looks for signals (Ctrl-C).
const SLICE: Duration = Duration::from_millis(100);

/// One client's scene; `contactd.Session` inherits from it.
#[pyclass(subclass, module = "contactd._native")]
pub struct Session {
    /// Held by all leases too: memory stays while anyone can point to it. Locked by calls alone, one at a time.
    inner: Arc<Mutex<Confined<Option<Inner>>>>,
    thread: Thread,
    options: Py<Options>,
    /// Those whose memory may be looked at.
    poses: Option<Py<Lease>>,
    reply: Option<Py<Lease>>,
    /// What the last two steps were handed out in. A loop holds those of one step until it has those of the next: then the ones before
    /// are nobody's, and become the next one's. Making them anew takes several times as long.
    spare_poses: [Option<Py<Slots>>; 2],
    spare_replies: [Option<Py<Reply>>; 2],
}

fn open(py: Python<'_>, make: impl FnOnce() -> Result<Box<dyn Transport>, Error> + Send) -> PyResult<Session> {
    let opened = py.detach(|| make().and_then(Inner::new).map(|inner| Confined::new(Some(inner))));
    let inner = opened.map_err(|e| errors::of(py, &e))?;
    let thread = inner.thread();
    Ok(Session {
        inner: Arc::new(Mutex::new(inner)),
        thread,
        options: Py::new(py, Options::default())?,
        poses: None,
        reply: None,
        spare_poses: [None, None],
        spare_replies: [None, None],
    })
}

impl Session {
    /// The session for one call, which no other thread may be in the middle of.
    fn enter<'py>(slf: &Bound<'py, Self>) -> PyResult<PyRefMut<'py, Self>> {
        slf.try_borrow_mut().map_err(|_| errors::misuse(slf.py(), "the session is in use by another call"))
    }

    fn opened(slf: &Bound<'_, Self>) -> PyResult<Opened> {
        let py = slf.py();
        Self::enter(slf)?.with(py, |s| s.opened())
    }

    /// Runs `work` on what is behind the session, closed or not.
    fn with_any<R>(&self, py: Python<'_>, work: impl FnOnce(&mut Option<Inner>) -> R) -> PyResult<R> {
        // A panic of the engine leaves the session as it is: it must still be possible to close it.
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(work(inner.get_mut(py)?))
    }

    /// Runs `work` on the session while it is open.
    pub fn with<R>(&self, py: Python<'_>, work: impl FnOnce(&mut Inner) -> R) -> PyResult<R> {
        match self.with_any(py, |inner| inner.as_mut().map(work))? {
            Some(result) => Ok(result),
            None => Err(errors::misuse(py, "the session is closed")),
        }
    }

    /// The same with the interpreter's lock released, of work that may fail.
    fn detached<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Inner) -> Result<R, Error> + Send,
    ) -> PyResult<R> {
        self.with(py, |s| detached(py, s, work))?.map_err(|e| errors::of(py, &e))
    }

    /// A call of the session with the interpreter's lock released, with the options that the next step has.
    fn call<R: Send>(slf: &Bound<'_, Self>, work: impl FnOnce(&mut Inner) -> Result<R, Error> + Send) -> PyResult<R> {
        Self::whole(slf, work)?.map_err(|e| errors::of(slf.py(), &e))
    }

    /// The same of work with failures of its own.
    pub fn whole<R: Send>(slf: &Bound<'_, Self>, work: impl FnOnce(&mut Inner) -> R + Send) -> PyResult<R> {
        let py = slf.py();
        let this = Self::enter(slf)?;
        let options = StepOptions::from(&*this.options.try_borrow(py)?);
        this.with(py, |s| {
            s.options = options;
            detached(py, s, work)
        })
    }

    /// Takes the memory of poses and reply back.
    fn revoke(&mut self, py: Python<'_>) -> PyResult<()> {
        let leases = [&mut self.poses, &mut self.reply];
        leases.iter().filter_map(|l| l.as_ref()).try_for_each(|l| l.get().check_unexported(py))?;
        leases.into_iter().filter_map(Option::take).for_each(|l| l.get().end());
        Ok(())
    }

    /// The open session for a new step: the views of the step before are over.
    pub fn fresh<'py>(slf: &Bound<'py, Self>) -> PyResult<PyRefMut<'py, Self>> {
        let mut this = Self::enter(slf)?;
        this.with(slf.py(), |_| ())?;
        this.revoke(slf.py())?;
        Ok(this)
    }

    /// Slots for poses from `loan`.
    fn loan(
        slf: &Bound<'_, Self>,
        loan: impl FnOnce(&mut Inner) -> Result<&mut [PoseRecord], Error>,
    ) -> PyResult<Py<Slots>> {
        let py = slf.py();
        let mut this = Self::fresh(slf)?;
        let options = StepOptions::from(&*this.options.try_borrow(py)?);
        this.with(py, |s| s.options = options)?;
        let loaned = this.with(py, |s| loan(s).map(|slots| (slots.as_mut_ptr().cast_const(), slots.len())))?;
        let (start, n) = loaned.map_err(|e| errors::of(py, &e))?;
        let spare = this.spare_poses.iter().flatten().find(|slots| {
            let lease = slots.get().lease();
            Slots::alone(py, slots) == Some(references(py, lease)) && slots.get().renew(py, start.cast(), n)
        });
        let slots = match spare {
            Some(slots) => {
                slots.get().lease().get().renew(start, n);
                slots.clone_ref(py)
            }
            None => {
                let slots = Slots::of_poses(py, Lease::new(What::Poses, start, n, this.thread, this.inner.clone()))?;
                this.spare_poses.rotate_right(1);
                this.spare_poses[0] = Some(slots.clone_ref(py));
                slots
            }
        };
        this.poses = Some(slots.get().lease().clone_ref(py));
        Ok(slots)
    }

    /// The reply whose slots lie in memory from `start` on.
    fn reply(
        &mut self,
        py: Python<'_>,
        header: &StepReply,
        start: *const ContactRecord,
        slots: usize,
    ) -> PyResult<Py<Reply>> {
        let spare = self.spare_replies.iter().flatten().find(|r| Reply::renew(py, r, start, slots, header));
        let reply = match spare {
            Some(reply) => reply.clone_ref(py),
            None => {
                let lease = Lease::new(What::Reply, start, slots, self.thread, self.inner.clone());
                let reply = Reply::of(py, lease, *header)?;
                self.spare_replies.rotate_right(1);
                self.spare_replies[0] = Some(reply.clone_ref(py));
                reply
            }
        };
        self.reply = Some(reply.bind(py).try_borrow()?.lease().clone_ref(py));
        Ok(reply)
    }

    /// Sends the poses if they were not yet: their memory is the server's from now on.
    fn send_loaned(&mut self, py: Python<'_>) -> PyResult<()> {
        self.with(py, |_| ())?;
        if let Some(lease) = &self.poses {
            lease.get().check_unexported(py)?;
            lease.get().end();
            self.poses = None;
            let options = StepOptions::from(&*self.options.try_borrow(py)?);
            self.with(py, |s| s.options = options)?;
        }
        Ok(())
    }
}

impl Session {
    /// Waits for the answer under way, with the interpreter's lock released and an ear for signals; what `read` makes of it.
    fn wait<R: Send>(
        &self,
        py: Python<'_>,
        timeout: Duration,
        mut read: impl FnMut(&Answer<'_>) -> R + Send,
    ) -> PyResult<R> {
        let mut left = timeout;
        loop {
            let wait = left.min(SLICE);
            match self.with(py, |s| detached(py, s, |s| s.finish(wait).map(|r| read(&r))))? {
                Ok(answer) => return Ok(answer),
                Err(Error::Timeout) if left > wait => {
                    py.check_signals()?;
                    left -= wait;
                }
                Err(e) => return Err(errors::of(py, &e)),
            }
        }
    }

    /// A whole step of records, for code of this package; `is_sent` is true from when they are sent until there is an answer, or none
    /// will come.
    pub fn ask<R: Send>(
        slf: &Bound<'_, Self>,
        records: &[PoseRecord],
        is_sent: &mut bool,
        read: impl FnMut(&Answer<'_>) -> R + Send,
    ) -> PyResult<R> {
        let py = slf.py();
        let this = Self::fresh(slf)?;
        let options = StepOptions::from(&*this.options.try_borrow(py)?);
        let begun = this.with(py, |s| {
            s.options = options;
            s.begin_step(records.len()).map(|slots| slots.copy_from_slice(records))
        })?;
        begun.map_err(|e| errors::of(py, &e))?;
        let answer = this.wait(py, Duration::MAX, read);
        *is_sent = this.with(py, |s| s.is_in_flight())?;
        if answer.is_ok() {
            this.options.try_borrow_mut(py)?.advance = 1.0;
        }
        answer
    }

    /// Waits for an answer that is still under way, if one is, and drops it.
    pub fn drain(slf: &Bound<'_, Self>) -> PyResult<()> {
        let this = Self::enter(slf)?;
        if this.with(slf.py(), |s| s.is_in_flight())? {
            let dropped = this.wait(slf.py(), Duration::MAX, |_| ());
            // Where it failed it is over all the same.
            if this.with(slf.py(), |s| s.is_in_flight())? {
                return dropped;
            }
        }
        Ok(())
    }

    /// Steps that were sent so far.
    pub fn steps(slf: &Bound<'_, Self>) -> PyResult<u64> {
        Self::enter(slf)?.with(slf.py(), |s| s.steps())
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
    /// On the server called `server` of this user; without one, on an engine in this process, whose configuration file (a server's) may
    /// be given.
    #[new]
    #[pyo3(signature = (server = None, config = None))]
    fn new(py: Python<'_>, server: Option<&str>, config: Option<PathBuf>) -> PyResult<Self> {
        if let (Some(name), Some(path)) = (server, &config) {
            let sentence = format!("{} is for an engine in this process, not for the server {name:?}", path.display());
            return Err(PyValueError::new_err(sentence));
        }
        if let Some(name) = server {
            return open(py, || Ok(Box::new(SharedMemory::new(Address::of(name)?))));
        }
        let config = config.map_or_else(|| Ok(ServerConfig::default()), |path| ServerConfig::read(&path));
        let config = config.map_err(PyValueError::new_err)?;
        open(py, move || Ok(Box::new(Embedded::new(&config))))
    }

    /// What is asked of the steps to come.
    #[getter]
    fn options(slf: &Bound<'_, Self>) -> PyResult<Py<Options>> {
        let py = slf.py();
        let this = Self::enter(slf)?;
        check_thread(py, this.thread)?;
        Ok(this.options.clone_ref(py))
    }

    /// The session's id on its server.
    #[getter]
    fn id(slf: &Bound<'_, Self>) -> PyResult<u64> {
        Self::opened(slf).map(|opened| opened.session)
    }

    /// Changes with every start of the server.
    #[getter]
    fn epoch(slf: &Bound<'_, Self>) -> PyResult<u64> {
        Self::opened(slf).map(|opened| opened.epoch)
    }

    /// Most records of a batch.
    #[getter]
    fn max_batch(slf: &Bound<'_, Self>) -> PyResult<u32> {
        Self::opened(slf).map(|opened| opened.max_batch)
    }

    /// True after `close`.
    #[getter]
    fn closed(slf: &Bound<'_, Self>) -> PyResult<bool> {
        Self::enter(slf)?.with_any(slf.py(), |inner| inner.is_none())
    }

    fn _load_model(
        slf: &Bound<'_, Self>,
        name: String,
        format: String,
        bytes: Vec<u8>,
        facets: &str,
    ) -> PyResult<Loaded> {
        let facets = match facets {
            "auto" => Facets::Auto,
            "exact" => Facets::Exact,
            "as-written" => Facets::AsWritten,
            other => {
                let sentence = format!("facets = {other:?} is none of auto, exact, as-written");
                return Err(PyValueError::new_err(sentence));
            }
        };
        let file = ModelFile::new(name, format, bytes);
        let info = Self::call(slf, move |s| s.load_model_file(file, facets))?;
        let faces = info.faces.into_iter().map(|f| (f.primitive, f.name, f.face, f.subtracted)).collect();
        Ok((info.id, faces, info.warnings))
    }

    fn _mass_properties(slf: &Bound<'_, Self>, model: u32, tolerance: f64, boxes: u64) -> PyResult<MassProperties> {
        let options = MassOptions { tolerance, boxes };
        Self::call(slf, move |s| s.mass_properties(model, &options)).map(MassProperties)
    }

    fn _add_object(
        slf: &Bound<'_, Self>,
        name: &str,
        model: u32,
        group: &str,
        moves: (bool, bool, f64),
        poses: (PoseFields, PoseFields),
    ) -> PyResult<u32> {
        let ((fixed, rotates, max_speed), (place, at)) = (moves, poses);
        let mut object = Object::new(name, model).group(group).max_speed(max_speed);
        object = object.place(pose(place.0, place.1)).at(pose(at.0, at.1));
        object = if fixed { object.fixed() } else { object };
        object = if rotates { object } else { object.without_rotation() };
        Self::call(slf, move |s| s.add_object(object))
    }

    /// Removes an object; its id is not used again. What it carried is detached before.
    fn remove_object(slf: &Bound<'_, Self>, object: u32) -> PyResult<()> {
        Self::call(slf, move |s| s.remove_object(object))
    }

    /// From now on ``part`` moves with ``carrier`` as it stands to it, and is not tested against it nor against the objects in ``touching``.
    #[pyo3(signature = (part, carrier, touching = Vec::new()))]
    fn attach(slf: &Bound<'_, Self>, part: u32, carrier: u32, touching: Vec<u32>) -> PyResult<()> {
        Self::call(slf, move |s| s.attach(part, carrier, &touching))
    }

    /// The part stays where it is, in the frame that it had of its own, with what is attached to it, and is tested as the rules say.
    fn detach(slf: &Bound<'_, Self>, part: u32) -> PyResult<()> {
        Self::call(slf, move |s| s.detach(part))
    }

    /// The object at the end of a part's chain, whose records it gets; None where it is not attached.
    fn carrier(slf: &Bound<'_, Self>, part: u32) -> PyResult<Option<u32>> {
        Self::enter(slf)?.with(slf.py(), |s| s.carrier(part))
    }

    /// Pairs of objects that may meet and are not tested, whatever the rules say; ``allowed=False``: no longer.
    #[pyo3(signature = (pairs, allowed = true))]
    fn allow(slf: &Bound<'_, Self>, pairs: Vec<[u32; 2]>, allowed: bool) -> PyResult<()> {
        Self::call(slf, move |s| s.allow(&pairs, allowed))
    }

    fn _reframe(slf: &Bound<'_, Self>, object: u32, place: PoseFields, at: PoseFields) -> PyResult<()> {
        let frame = Frame { object, place: pose(place.0, place.1), pose: pose(at.0, at.1) };
        Self::call(slf, move |s| s.reframe(&[frame]))
    }

    /// Bounds of the distance of two objects, a point of each, whether they are settled, parts that were looked at.
    fn _distance(slf: &Bound<'_, Self>, a: u32, b: u32, tolerance: f64) -> PyResult<Apart> {
        let d = Self::call(slf, move |s| s.distance(a, b, tolerance))?;
        Ok((d.lower, d.upper, d.points, d.is_settled, d.cells))
    }

    /// Records of dtype ``POINT`` about points, three doubles each.
    fn _points<'py>(
        slf: &Bound<'py, Self>,
        points: &[u8],
        options: (f64, f64, u64),
        objects: Option<Vec<u32>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let (points, (surface, tolerance, limit)) = (queries::points(points), options);
        let options = PointOptions { surface, tolerance, limit };
        let told = Self::call(slf, move |s| s.points(&points, &options, objects.as_deref()))?;
        Ok(queries::records::<_, PointRecord>(slf.py(), &told))
    }

    /// Records of dtype ``RAY`` about rays, seven doubles each.
    fn _rays<'py>(
        slf: &Bound<'py, Self>,
        rays: &[u8],
        options: (f64, u64),
        objects: Option<Vec<u32>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let (rays, (depth, limit)) = (queries::rays(rays), options);
        let options = RayOptions { depth, limit };
        let told = Self::call(slf, move |s| s.rays(&rays, &options, objects.as_deref()))?;
        Ok(queries::records::<_, RayRecord>(slf.py(), &told))
    }

    /// Records the session's steps from now on into a new MCAP file, until ``stop_recording`` or the end of the session.
    fn record(slf: &Bound<'_, Self>, path: PathBuf) -> PyResult<()> {
        Self::call(slf, move |s| s.record(path))
    }

    fn _recorded(slf: &Bound<'_, Self>, stop: bool) -> PyResult<Recorded> {
        let status = Self::call(slf, move |s| if stop { s.stop_recording() } else { s.recording() })?;
        Ok((status.path, status.steps, status.dropped, status.without_picture, status.bytes, status.failure))
    }

    /// Writes the last step as a scene in a new folder, for ``contactd check``; returns the scene's path.
    fn save_step(slf: &Bound<'_, Self>, folder: PathBuf) -> PyResult<PathBuf> {
        Self::call(slf, move |s| s.save_step(folder))
    }

    fn _set_rules(slf: &Bound<'_, Self>, rules: Vec<Bound<'_, PyAny>>) -> PyResult<()> {
        let rules = rules.iter().enumerate().map(|(i, r)| rules::rule(r, i)).collect::<PyResult<Vec<_>>>()?;
        Self::call(slf, move |s| s.set_rules(&rules))
    }

    /// Sets the resolution of every pair, a length; None: each pair its default.
    #[pyo3(signature = (resolution))]
    fn set_resolution(slf: &Bound<'_, Self>, resolution: Option<f64>) -> PyResult<()> {
        Self::call(slf, move |s| s.set_resolution(resolution))
    }

    /// Slots for `n` poses (dtype ``POSE``), all zero, to be filled in place until the step is sent.
    ///
    /// A batch that was begun and not sent is dropped. The views of the step before are over.
    fn begin_step(slf: &Bound<'_, Self>, n: usize) -> PyResult<Py<Slots>> {
        Self::loan(slf, |s| s.begin_step(n))
    }

    /// After ``reconnect``: the batch that was in flight when the server died, loaned again with the same poses.
    fn resend(slf: &Bound<'_, Self>) -> PyResult<Py<Slots>> {
        Self::loan(slf, |s| s.resend())
    }

    /// A whole step in one call: ``begin_step``, every slot set from ``poses``, ``finish``.
    ///
    /// ``poses``: an array of dtype ``POSE`` along one axis and without gaps, which costs one copy, or whatever else
    /// ``begin_step(len(poses))[:]`` takes. Errors are those of the three.
    #[pyo3(signature = (poses, timeout = None))]
    fn step(slf: &Bound<'_, Self>, poses: &Bound<'_, PyAny>, timeout: Option<f64>) -> PyResult<Py<Reply>> {
        let py = slf.py();
        duration(timeout)?;
        if let Some(batch) = Batch::of(py, poses)? {
            let this = Self::fresh(slf)?;
            let options = StepOptions::from(&*this.options.try_borrow(py)?);
            let begun = this.with(py, |s| {
                s.options = options;
                s.begin_step(batch.len()).map(|slots| batch.copy_to(slots))
            })?;
            begun.map_err(|e| errors::of(py, &e))?;
        } else {
            let slots = Self::begin_step(slf, poses.len()?)?;
            slots.bind(py).as_any().set_item(PySlice::full(py), poses)?;
        }
        Self::finish(slf, timeout)
    }

    /// Sends the batch without waiting; ``finish`` does it too.
    fn send(slf: &Bound<'_, Self>) -> PyResult<()> {
        let py = slf.py();
        let mut this = Self::enter(slf)?;
        this.send_loaned(py)?;
        this.detached(py, |s| s.send())
    }

    /// Sends the batch if it was not yet, and waits for its answer, which is read in place.
    ///
    /// ``timeout`` in seconds; None waits for as long as the server lives. Other threads run meanwhile, and Ctrl-C ends the wait
    /// for a server. ``Refused`` has the index of the offending record, and nothing has changed; after ``Timeout`` the step is
    /// still in flight: call again; after ``ServerLost`` see ``reconnect`` and ``resend``.
    #[pyo3(signature = (timeout = None))]
    fn finish(slf: &Bound<'_, Self>, timeout: Option<f64>) -> PyResult<Py<Reply>> {
        let py = slf.py();
        let timeout = duration(timeout)?;
        let mut this = Self::enter(slf)?;
        this.send_loaned(py)?;
        let read = |r: &Answer<'_>| (*r.header(), r.slots().as_ptr() as usize, r.slots().len());
        let (header, address, slots) = this.wait(py, timeout, read)?;
        this.options.try_borrow_mut(py)?.advance = 1.0;
        this.reply(py, &header, address as *const ContactRecord, slots)
    }

    /// After ``ServerLost`` or ``ReplyLost``: waits until a server of the same name runs, opens a session there and replays
    /// models, objects, rules and last poses. Ids stay the same. An embedded session has nothing to find again: ``Misuse``.
    #[pyo3(signature = (timeout = 10.0))]
    fn reconnect(slf: &Bound<'_, Self>, timeout: f64) -> PyResult<()> {
        let (py, timeout) = (slf.py(), duration(Some(timeout))?);
        let mut this = Self::enter(slf)?;
        if this.with(py, |s| s.transport_mut().may_lose_server())? {
            this.revoke(py)?;
        }
        let start = Instant::now();
        loop {
            let wait = timeout.saturating_sub(start.elapsed()).min(SLICE);
            match this.with(py, |s| detached(py, s, |s| s.reconnect(wait)))? {
                Err(Error::NoServer(_) | Error::ServerLost | Error::Timeout) if start.elapsed() < timeout => {
                    py.check_signals()?
                }
                answer => return answer.map_err(|e| errors::of(py, &e)),
            }
        }
    }

    /// Ends the session. Again does nothing; a server that is gone has ended it already.
    fn close(slf: &Bound<'_, Self>) -> PyResult<()> {
        let py = slf.py();
        let mut this = Self::enter(slf)?;
        if this.with_any(py, |inner| inner.is_none())? {
            return Ok(());
        }
        this.revoke(py)?;
        match this.with_any(py, |inner| detached(py, inner, |s| s.take().map_or(Ok(()), Inner::close)))? {
            Ok(()) | Err(Error::ServerLost | Error::Misuse(_)) => Ok(()),
            Err(e) => Err(errors::of(py, &e)),
        }
    }
}
