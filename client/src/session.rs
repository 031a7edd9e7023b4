//! A session: models, objects, rules, steps. The same calls over shared memory and over an embedded engine.
//!
//! Ids are given here, counting up, so that they stay the same when the session is replayed on another server.

mod attach;
mod options;
mod query;
mod recording;
mod stage;
mod step;

pub use attach::Frame;
pub use options::StepOptions;

use crate::journal::Journal;
use crate::solid::ModelText;
use crate::transport::{Opened, Transport};
use crate::{Error, ModelInfo, SharedMemory};
use contactd_proto::control::{Answer, Command, Facets, ModelFile};
use contactd_proto::names::Address;
use contactd_proto::step::NO_INDEX;
use contactd_proto::{ErrorCode, MassOptions, MassProperties, PoseRecord};
use stage::Stage;
use std::time::{Duration, Instant};

/// How long closing waits for a step in flight.
const PATIENCE: Duration = Duration::from_secs(1);

/// One client's scene on a server. One thread at a time. Dropped without [`close`](Self::close) it still says goodbye, and waits a
/// fifth of a second at most until that was heard; a server that does not hear it ends the session when it finds that nobody listens.
#[derive(Debug)]
pub struct Session<T: Transport> {
    transport: T,
    opened: Opened,
    journal: Journal,
    /// What is asked of the steps to come.
    pub options: StepOptions,
    stage: Stage,
    company: attach::Company,
    /// Slots of the batch in hand that are the caller's; behind them stand those of what is attached.
    own_slots: usize,
    step: u64,
    last_model: u32,
    last_object: u32,
    /// The batch that was under way when the server was lost, until the next one is accepted.
    unanswered: Option<Vec<PoseRecord>>,
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
            company: attach::Company::default(),
            own_slots: 0,
            step: 0,
            last_model: 0,
            last_object: 0,
            unanswered: None,
            is_over: false,
            command_timeout: Duration::from_secs(600),
        })
    }

    /// The session's id and its server's epoch and limits.
    pub fn opened(&self) -> Opened {
        self.opened
    }

    /// Loads a model from OpenSCAD CSG text or from a solid that was built ([`crate::solid`]); `name` stands in error sentences.
    ///
    /// # Errors
    /// `Refused` with line and column of what is not supported; `Build` for a solid that makes no sense; `ServerLost`, `ReplyLost`,
    /// `Timeout`, `System`.
    pub fn load_model(&mut self, name: &str, model: &(impl ModelText + ?Sized)) -> Result<ModelInfo, Error> {
        self.load_model_with(name, model, Facets::Auto)
    }

    /// The same, saying how curved primitives are taken.
    ///
    /// # Errors
    /// As `load_model`.
    pub fn load_model_with(
        &mut self,
        name: &str,
        model: &(impl ModelText + ?Sized),
        facets: Facets,
    ) -> Result<ModelInfo, Error> {
        let bytes = model.model_text()?.into_owned().into_bytes();
        self.load_model_file(ModelFile::new(name, "csg", bytes), facets)
    }

    /// Loads a model from a file's bytes, in any format that the server reads.
    ///
    /// # Errors
    /// As `load_model`; a format that is not read is refused by its name.
    pub fn load_model_file(&mut self, file: ModelFile, facets: Facets) -> Result<ModelInfo, Error> {
        let model = self.last_model + 1;
        match self.command(Command::LoadModel { model, file: file.clone(), facets })? {
            Answer::Loaded { faces, warnings } => {
                self.last_model = model;
                if self.transport.may_lose_server() {
                    self.journal.model(model, file, facets);
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
    /// (`Unbounded`); `ServerLost`, `ReplyLost`, `Timeout`, `System`. Boxes that do not suffice are no error: the bounds tell.
    pub fn mass_properties(&mut self, model: u32, options: &MassOptions) -> Result<MassProperties, Error> {
        let MassOptions { tolerance, boxes } = *options;
        match self.command(Command::MassProperties { model, tolerance, boxes })? {
            Answer::Mass(mass) => Ok(MassProperties::from(&mass)),
            other => Err(unexpected(&other)),
        }
    }

    /// Sets the resolution of every pair; `None`: each its default.
    ///
    /// # Errors
    /// `Refused`: not a positive length well below the primitives' size; `ServerLost`, `ReplyLost`, `Timeout`, `System`.
    pub fn set_resolution(&mut self, resolution: Option<f64>) -> Result<(), Error> {
        self.done(Command::SetResolution(resolution))?;
        self.journal.resolution(resolution);
        Ok(())
    }

    /// After `ServerLost`, `ReplyLost` or a session that is gone: waits until a server of the same name runs, opens a
    /// session there and replays models, objects, rules and last poses. Ids stay the same. A step that has no answer is kept for
    /// `resend`.
    ///
    /// # Errors
    /// `NoServer` when none came up within `timeout`; `Misuse`, and nothing has changed, where there is no server that could be
    /// lost; otherwise what the replay met.
    pub fn reconnect(&mut self, timeout: Duration) -> Result<(), Error> {
        if !self.transport.may_lose_server() {
            return Err(Error::Misuse("an embedded session has no server that could be lost"));
        }
        let start = Instant::now();
        self.lose();
        loop {
            match self.replay() {
                Err(Error::NoServer(_) | Error::ServerLost | Error::Timeout) if start.elapsed() < timeout => {
                    std::thread::sleep(Duration::from_millis(5));
                }
                other => break other?,
            }
        }
        self.settle()
    }

    /// Ends the session; a step in flight is waited for, a second at most.
    ///
    /// # Errors
    /// `ServerLost`, `ReplyLost`, `Timeout`, `System`; the session is over in any case.
    pub fn close(mut self) -> Result<(), Error> {
        // Commands wait for steps. A server that does not answer its step has gone, or ends the session when it is done with it.
        let is_in_flight = matches!(self.stage, Stage::Sent);
        if is_in_flight && matches!(self.finish(PATIENCE), Err(Error::Timeout | Error::ServerLost | Error::ReplyLost)) {
            return Ok(());
        }
        // Also where the session is lost to this client: the server may have it yet.
        match self.transport.command(Command::Close, self.command_timeout)? {
            Answer::Done => {
                self.is_over = true;
                Ok(())
            }
            Answer::Refused { code, index, detail } => Err(refused(code, index, detail)),
            other => Err(unexpected(&other)),
        }
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
                Answer::Opened { .. }
                | Answer::Loaded { .. }
                | Answer::Done
                | Answer::Mass(_)
                | Answer::Status(_)
                | Answer::Recorded(_)
                | Answer::Told(_)
                | Answer::Reframed(_) => {}
            }
        }
        self.stage = Stage::Idle;
        Ok(())
    }

    fn command(&mut self, command: Command) -> Result<Answer, Error> {
        self.check_idle()?;
        let only_asks = matches!(command, Command::MassProperties { .. } | Command::Ask(_));
        match self.transport.command(command, self.command_timeout) {
            Ok(Answer::Refused { code, index, detail }) => Err(self.failed(refused(code, index, detail))),
            Ok(answer) => Ok(answer),
            // It may be done yet, with an id that would be given again: the journal cannot tell.
            Err(Error::Timeout) if !only_asks => {
                self.lose();
                Err(Error::Timeout)
            }
            Err(e) => Err(self.failed(e)),
        }
    }

    fn done(&mut self, command: Command) -> Result<(), Error> {
        match self.command(command)? {
            Answer::Done => Ok(()),
            other => Err(unexpected(&other)),
        }
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
