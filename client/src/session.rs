//! A session: models, objects, rules, steps. The same calls over shared memory and over an embedded engine.
//!
//! Ids are given here, counting up, so that they stay the same when the session is replayed on another server.

use crate::journal::Journal;
use crate::transport::{Opened, Transport};
use crate::{Error, SharedMemory};
use contactd_proto::contact_record::{ContactRecord, DetailSlot, PatchSlot, RegionSlot};
use contactd_proto::control::{Answer, Command, FaceName, Facets, ObjectSpec, WireRule};
use contactd_proto::names::{Address, PROTOCOL_VERSION};
use contactd_proto::step::{ASK_CLEAR, ASK_DETAILS, ASK_FIRST, ASK_POLLING, NO_INDEX, STEP_REFUSED};
use contactd_proto::{ErrorCode, MassOptions, MassProperties, Pose, PoseRecord, Rule, StepReply, StepRequest};
use std::time::{Duration, Instant};

/// What is asked of the steps to come. Stays as it is set, but for `advance`, which each accepted step puts back to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepOptions {
    /// Fraction 0..1 of its previous step at which every object stands before the next one.
    pub advance: f64,
    /// Duration of a step in seconds, for objects with a declared largest speed; 0: unknown.
    pub dt: f64,
    /// Only the pairs whose bracket meets the scene's earliest contact.
    pub first: bool,
    /// A detail slot with each record: upper end of the bracket, point in a's frame, penetration.
    pub details: bool,
    /// Records of clear pairs too.
    pub clear: bool,
    /// This client polls while it waits; the server then need not wake it.
    pub polling: bool,
    /// Most records, the earliest first; 0: all.
    pub max_records: u32,
    /// Most cells that one pair's search may refine; 0: the server's default.
    pub cell_limit: u32,
    /// Most cells that all searches of a step may refine together; 0: the server's default. Pairs that would need more stay
    /// undecided, the latest first.
    pub batch_limit: u32,
}

impl Default for StepOptions {
    fn default() -> Self {
        Self {
            advance: 1.0,
            dt: 0.0,
            first: false,
            details: false,
            clear: false,
            polling: false,
            max_records: 0,
            cell_limit: 0,
            batch_limit: 0,
        }
    }
}

/// A model that was loaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelInfo {
    /// Its id.
    pub id: u32,
    /// Its faces by face id.
    pub faces: Vec<FaceName>,
    /// What the import snapped or dropped.
    pub warnings: Vec<String>,
}

/// An object to be added: a model, where it stands, and what is declared of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    spec: ObjectSpec,
}

impl Object {
    /// A moving object of group "default" at the origin.
    pub fn new(name: &str, model: u32) -> Self {
        let spec = ObjectSpec {
            id: 0,
            model,
            name: name.into(),
            group: "default".into(),
            is_static: false,
            rotates: true,
            max_speed: f64::INFINITY,
            place: Pose::IDENTITY.into(),
            pose: Pose::IDENTITY.into(),
        };
        Self { spec }
    }

    /// Its group, for rules.
    pub fn group(mut self, group: &str) -> Self {
        self.spec.group = group.into();
        self
    }

    /// It never moves.
    pub fn fixed(mut self) -> Self {
        self.spec.is_static = true;
        self
    }

    /// It never turns: a motion that turns it will be refused.
    pub fn without_rotation(mut self) -> Self {
        self.spec.rotates = false;
        self
    }

    /// No point of it is ever faster than this, length per second; steps then need `dt`.
    pub fn max_speed(mut self, speed: f64) -> Self {
        self.spec.max_speed = speed;
        self
    }

    /// Where the model sits in the object's frame.
    pub fn place(mut self, place: Pose) -> Self {
        self.spec.place = place.into();
        self
    }

    /// Where the object stands.
    pub fn at(mut self, pose: Pose) -> Self {
        self.spec.pose = pose.into();
        self
    }
}

/// Where the step under way is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Idle,
    Loaned,
    Sent {
        advance: f64,
    },
    /// The server died: reconnect first. Says whether a batch can be sent again.
    Lost,
}

/// One client's scene on a server. One thread at a time. Dropped without [`close`](Self::close) it still says goodbye, and waits a
/// fifth of a second at most until that was heard; a server that does not hear it ends the session with this process.
#[derive(Debug)]
pub struct Session<T: Transport> {
    transport: T,
    opened: Opened,
    journal: Journal,
    /// What is asked of the steps to come.
    pub options: StepOptions,
    stage: Stage,
    step: u64,
    last_model: u32,
    last_object: u32,
    lost_batch: Option<Vec<PoseRecord>>,
    /// The server was told of the end, and said so.
    is_over: bool,
    /// How long a command may take (imports of large models included).
    pub command_timeout: Duration,
}

impl Session<SharedMemory> {
    /// A session on the server called `name` of this user.
    ///
    /// # Errors
    /// `NoServer`, `Address`, `Version`, `Refused` (too many sessions), `System`.
    pub fn connect(name: &str) -> Result<Self, Error> {
        Self::connect_to(Address::of(name)?)
    }

    /// A session on the server at `address`.
    ///
    /// # Errors
    /// As `connect`.
    pub fn connect_to(address: Address) -> Result<Self, Error> {
        Self::new(SharedMemory::new(address))
    }
}

impl<T: Transport> Session<T> {
    /// A session over `transport`.
    ///
    /// # Errors
    /// Those of [`Transport::open`].
    pub fn new(mut transport: T) -> Result<Self, Error> {
        let opened = transport.open()?;
        Ok(Self {
            transport,
            opened,
            journal: Journal::default(),
            options: StepOptions::default(),
            stage: Stage::Idle,
            step: 0,
            last_model: 0,
            last_object: 0,
            lost_batch: None,
            is_over: false,
            command_timeout: Duration::from_secs(600),
        })
    }

    /// The session's id and its server's epoch and limits.
    pub fn opened(&self) -> Opened {
        self.opened
    }

    /// Loads a model from OpenSCAD CSG text; `name` stands in error sentences.
    ///
    /// # Errors
    /// `Refused` with line and column of what is not supported; `ServerLost`, `Timeout`, `System`.
    pub fn load_model(&mut self, name: &str, text: &str) -> Result<ModelInfo, Error> {
        self.load_model_with(name, text, Facets::Auto)
    }

    /// The same, saying how curved primitives are taken.
    ///
    /// # Errors
    /// As `load_model`.
    pub fn load_model_with(&mut self, name: &str, text: &str, facets: Facets) -> Result<ModelInfo, Error> {
        let model = self.last_model + 1;
        let command = Command::LoadModel { model, name: name.into(), text: text.into(), facets };
        match self.command(command)? {
            Answer::Loaded { faces, warnings } => {
                self.last_model = model;
                if self.transport.may_lose_server() {
                    self.journal.model(model, name, text, facets);
                }
                Ok(ModelInfo { id: model, faces, warnings })
            }
            other => Err(unexpected(&other)),
        }
    }

    /// Volume, centre of mass and inertia of a model, in the model's own frame and unit, density 1, each with a proven
    /// bound of its error. [`MassProperties::placed`] takes them to an object's frame, [`MassProperties::with_density`]
    /// to a material. Closed forms answer at once; other trees may take seconds, in which other sessions go on.
    ///
    /// # Errors
    /// `Refused`: unknown model (`UnknownModel`), an option out of its range (`BadNumber`), a model that reaches to infinity
    /// (`Unbounded`); `ServerLost`, `Timeout`, `System`. Boxes that do not suffice are no error: the bounds tell.
    pub fn mass_properties(&mut self, model: u32, options: &MassOptions) -> Result<MassProperties, Error> {
        let MassOptions { tolerance, boxes } = *options;
        match self.command(Command::MassProperties { model, tolerance, boxes })? {
            Answer::Mass(mass) => Ok(MassProperties::from(&mass)),
            other => Err(unexpected(&other)),
        }
    }

    /// Adds an object; returns its id.
    ///
    /// # Errors
    /// `Refused`: unknown model, bad pose or speed, too many objects, resolution; `ServerLost`, `Timeout`, `System`.
    pub fn add_object(&mut self, object: Object) -> Result<u32, Error> {
        let id = self.last_object + 1;
        let spec = ObjectSpec { id, ..object.spec };
        self.done(Command::AddObject(spec.clone()))?;
        self.last_object = id;
        if self.transport.may_lose_server() {
            self.journal.object(spec);
        }
        Ok(id)
    }

    /// Removes an object; its id is not used again.
    ///
    /// # Errors
    /// `Refused`: unknown object; `ServerLost`, `Timeout`, `System`.
    pub fn remove_object(&mut self, object: u32) -> Result<(), Error> {
        self.done(Command::RemoveObject(object))?;
        self.journal.removed(object);
        Ok(())
    }

    /// Replaces the session's rules.
    ///
    /// # Errors
    /// `Refused` at the index of a bad rule; `ServerLost`, `Timeout`, `System`.
    pub fn set_rules(&mut self, rules: &[Rule]) -> Result<(), Error> {
        self.done(Command::SetRules(rules.iter().map(WireRule::from).collect()))?;
        self.journal.rules(rules);
        Ok(())
    }

    /// Sets the resolution of every pair; `None`: each its default.
    ///
    /// # Errors
    /// `Refused`: not a positive length well below the primitives' size; `ServerLost`, `Timeout`, `System`.
    pub fn set_resolution(&mut self, resolution: Option<f64>) -> Result<(), Error> {
        self.done(Command::SetResolution(resolution))?;
        self.journal.resolution(resolution);
        Ok(())
    }

    /// Slots for `n` poses, to be filled in place. A batch that was begun and not sent is dropped.
    ///
    /// # Errors
    /// `Refused` (`TooMany`), `Misuse` while a step is in flight, `ServerLost`, `System`.
    pub fn begin_step(&mut self, n: usize) -> Result<&mut [PoseRecord], Error> {
        match self.stage {
            Stage::Sent { .. } => return Err(Error::Misuse("a step is in flight: finish it first")),
            Stage::Lost => return Err(Error::ServerLost),
            Stage::Idle | Stage::Loaned => {}
        }
        if n > self.opened.max_batch as usize {
            let detail = format!("{n} records, the limit is {}", self.opened.max_batch);
            return Err(Error::Refused { code: ErrorCode::TooMany, index: None, detail });
        }
        self.stage = Stage::Idle;
        let slots = self.transport.loan(n)?;
        self.stage = Stage::Loaned;
        Ok(slots)
    }

    /// Sends the batch without waiting; `finish` does it too.
    ///
    /// # Errors
    /// `Misuse` when no step was begun, `ServerLost`, `System`.
    pub fn send(&mut self) -> Result<(), Error> {
        match self.stage {
            Stage::Loaned => {}
            Stage::Lost => return Err(Error::ServerLost),
            Stage::Idle | Stage::Sent { .. } => return Err(Error::Misuse("no step was begun")),
        }
        let o = &self.options;
        let asked = [(o.first, ASK_FIRST), (o.details, ASK_DETAILS), (o.clear, ASK_CLEAR), (o.polling, ASK_POLLING)];
        let request = StepRequest {
            version: PROTOCOL_VERSION,
            asked: asked.iter().map(|(on, bit)| if *on { *bit } else { 0 }).sum(),
            session: self.opened.session,
            epoch: self.opened.epoch,
            step: self.step + 1,
            advance: o.advance,
            dt: o.dt,
            cell_limit: o.cell_limit,
            batch_limit: o.batch_limit,
            max_records: o.max_records,
            records: self.transport.loaned().len() as u32,
        };
        match self.transport.send(request) {
            Ok(()) => {
                self.step += 1;
                self.stage = Stage::Sent { advance: o.advance };
                Ok(())
            }
            Err(e) => Err(self.failed(e)),
        }
    }

    /// Sends the batch if it was not yet, and waits for its answer, which is read in place.
    ///
    /// # Errors
    /// `Refused` with the index of the offending record (nothing has changed); `Timeout` (the step stays in flight:
    /// call again); `ServerLost` (see `reconnect` and `resend`); `ReplyLost`; `Misuse`; `System`.
    pub fn finish(&mut self, timeout: Duration) -> Result<Reply<'_>, Error> {
        if self.stage == Stage::Loaned {
            self.send()?;
        }
        let advance = match self.stage {
            Stage::Sent { advance } => advance,
            Stage::Lost => return Err(Error::ServerLost),
            _ => return Err(Error::Misuse("no step was begun")),
        };
        match self.transport.receive(timeout) {
            Ok(()) => {}
            Err(Error::Timeout) => return Err(Error::Timeout),
            Err(Error::ReplyLost) => {
                // The step was taken, or it was refused: the journal cannot tell, the server can no longer be trusted
                // to stand where the journal does. A replay settles it.
                self.stage = Stage::Lost;
                return Err(Error::ReplyLost);
            }
            Err(e) => return Err(self.failed(e)),
        }
        self.stage = Stage::Idle;
        let Some((header, _)) = self.transport.reply() else {
            return Err(Error::System("a reply was announced that is not there".into()));
        };
        // Branched on once, so copied once.
        let (status, error, index) = (header.status, header.error, header.index);
        if status == STEP_REFUSED || error != 0 {
            let code = ErrorCode::of_number(error).unwrap_or(ErrorCode::Internal);
            let index = (index != NO_INDEX).then_some(index);
            let record = index.and_then(|i| self.transport.loaned().get(i as usize));
            let detail = record.map_or_else(String::new, |r| format!("object id {}", r.object));
            if code == ErrorCode::SessionGone {
                self.stage = Stage::Lost;
            }
            return Err(Error::Refused { code, index, detail });
        }
        if self.transport.may_lose_server() {
            self.journal.accepted(self.transport.loaned(), advance);
        }
        self.options.advance = 1.0;
        match self.transport.reply() {
            Some((header, slots)) => Ok(Reply { header: *header, slots }),
            None => Err(Error::ReplyLost),
        }
    }

    /// After `ServerLost`, `ReplyLost` or a session that is gone: waits until a server of the same name runs, opens a
    /// session there and replays models, objects, rules and last poses. Ids stay the same.
    ///
    /// # Errors
    /// `NoServer` when none came up within `timeout`; `Misuse`, and nothing has changed, where there is no server that could be
    /// lost; otherwise what the replay met.
    pub fn reconnect(&mut self, timeout: Duration) -> Result<(), Error> {
        if !self.transport.may_lose_server() {
            return Err(Error::Misuse("an embedded session has no server that could be lost"));
        }
        let until = Instant::now() + timeout;
        self.stage = Stage::Lost;
        loop {
            match self.replay() {
                Err(Error::NoServer(_) | Error::ServerLost | Error::Timeout) if Instant::now() < until => {
                    std::thread::sleep(Duration::from_millis(5));
                }
                other => return other,
            }
        }
    }

    /// After `reconnect`: the batch that was in flight when the server died, loaned again with the same poses.
    ///
    /// # Errors
    /// `Misuse` when there was none; otherwise as `begin_step`.
    pub fn resend(&mut self) -> Result<&mut [PoseRecord], Error> {
        let Some(batch) = self.lost_batch.take() else {
            return Err(Error::Misuse("no step was in flight when the server died"));
        };
        let slots = self.begin_step(batch.len())?;
        slots.copy_from_slice(&batch);
        Ok(slots)
    }

    /// Ends the session.
    ///
    /// # Errors
    /// `ServerLost`, `Timeout`, `System`; the session is over in any case.
    pub fn close(mut self) -> Result<(), Error> {
        self.done(Command::Close)?;
        self.is_over = true;
        Ok(())
    }

    /// The transport, for what a session does not offer.
    pub fn transport_mut(&mut self) -> &mut T {
        &mut self.transport
    }

    fn replay(&mut self) -> Result<(), Error> {
        self.opened = self.transport.open()?;
        for command in self.journal.replay() {
            match self.transport.command(command, self.command_timeout)? {
                Answer::Refused { code, index, detail } => return Err(refused(code, index, detail)),
                Answer::Opened { .. } | Answer::Loaded { .. } | Answer::Done | Answer::Mass(_) => {}
            }
        }
        self.stage = Stage::Idle;
        Ok(())
    }

    fn command(&mut self, command: Command) -> Result<Answer, Error> {
        match self.stage {
            Stage::Lost => return Err(Error::ServerLost),
            Stage::Sent { .. } => return Err(Error::Misuse("a step is in flight: finish it first")),
            Stage::Idle | Stage::Loaned => {}
        }
        match self.transport.command(command, self.command_timeout) {
            Ok(Answer::Refused { code, index, detail }) => {
                let error = refused(code, index, detail);
                if error.code() == Some(ErrorCode::SessionGone) {
                    self.stage = Stage::Lost;
                }
                Err(error)
            }
            Ok(answer) => Ok(answer),
            Err(e) => Err(self.failed(e)),
        }
    }

    fn done(&mut self, command: Command) -> Result<(), Error> {
        match self.command(command)? {
            Answer::Done => Ok(()),
            other => Err(unexpected(&other)),
        }
    }

    /// Notes a failure of the transport; keeps the batch when the server is lost.
    fn failed(&mut self, error: Error) -> Error {
        if error == Error::ServerLost {
            if matches!(self.stage, Stage::Loaned | Stage::Sent { .. }) {
                self.lost_batch = Some(self.transport.loaned().to_vec());
            }
            self.stage = Stage::Lost;
        } else if matches!(self.stage, Stage::Sent { .. }) {
            self.stage = Stage::Idle;
        }
        error
    }
}

impl<T: Transport> Drop for Session<T> {
    fn drop(&mut self) {
        if !self.is_over {
            self.transport.leave();
        }
    }
}

fn refused(code: u32, index: u32, detail: String) -> Error {
    let code = ErrorCode::of_number(code).unwrap_or(ErrorCode::Internal);
    Error::Refused { code, index: (index != NO_INDEX).then_some(index), detail }
}

fn unexpected(answer: &Answer) -> Error {
    Error::System(format!("the server gave an answer that does not belong to the command: {answer:?}"))
}

/// The answer to a step, in place: valid until the session's next call.
#[derive(Clone, Copy, Debug)]
pub struct Reply<'s> {
    header: StepReply,
    slots: &'s [ContactRecord],
}

impl<'s> Reply<'s> {
    /// A reply of slots and their header that were kept, or came by another way than [`Session::finish`].
    pub fn of(header: StepReply, slots: &'s [ContactRecord]) -> Self {
        Self { header, slots }
    }

    /// The header: status, safe time, effects, work.
    pub fn header(&self) -> &StepReply {
        &self.header
    }

    /// Smallest time_lower over all pairs: safe to advance to.
    pub fn safe_time(&self) -> f64 {
        self.header.safe_time
    }

    /// True when `max_records` left records out.
    pub fn truncated(&self) -> bool {
        self.header.truncated != 0
    }

    /// The contact records in the order (time, a, b).
    pub fn records(&self) -> &'s [ContactRecord] {
        &self.slots[..(self.header.records as usize).min(self.slots.len())]
    }

    /// All slots as they lie in memory: the records, then their further slots.
    pub fn slots(&self) -> &'s [ContactRecord] {
        let n = (self.header.records as usize).saturating_add(self.header.slots as usize);
        &self.slots[..n.min(self.slots.len())]
    }

    /// The detail slot of a record, when details were asked for.
    pub fn detail(&self, record: &ContactRecord) -> Option<&'s DetailSlot> {
        self.further(record).find_map(ContactRecord::as_detail)
    }

    /// The patch slots of a record, when its rule reports patches.
    pub fn patches(&self, record: &ContactRecord) -> impl Iterator<Item = &'s PatchSlot> + use<'s> {
        self.further(record).filter_map(ContactRecord::as_patch)
    }

    /// The contact regions of a record in order, each with the slots of the points that bound it, when its rule reports
    /// patches or has a margin.
    pub fn regions(
        &self,
        record: &ContactRecord,
    ) -> impl Iterator<Item = (&'s RegionSlot, impl Iterator<Item = &'s PatchSlot> + use<'s>)> + use<'s> {
        let reply = *self;
        let record = *record;
        self.further(&record).filter_map(ContactRecord::as_region).map(move |region| {
            let number = region.region;
            (region, reply.patches(&record).filter(move |slot| slot.region[0] == number))
        })
    }

    fn further(&self, record: &ContactRecord) -> impl Iterator<Item = &'s ContactRecord> + use<'s> {
        self.slots.iter().skip(record.slot as usize).take(record.slots as usize)
    }
}
