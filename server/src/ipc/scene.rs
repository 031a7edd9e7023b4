//! One session's side of the protocol: commands and steps on its world, wherever they came from.

use super::config::ServerConfig;
use super::models::Loaded;
use super::queries::Inquiry;
use crate::math::halt;
use crate::octree::mass::mass_properties;
use crate::recording::{Change, Opening, SceneFolder, Standing, Tap};
use crate::world::{Heed, ObjectSpec, Refusal, StepOptions, World, record};
use contactd_proto::control::{
    Answer, Command, Facets, ModelFile, ObjectSpec as WireObject, WireFrame, WireMass, WireRule, WireTrack,
};
use contactd_proto::names::PROTOCOL_VERSION;
use contactd_proto::step::{ASK_ALL, ASK_CLEAR, ASK_DETAILS, ASK_FIRST, NO_INDEX, STEP_REFUSED};
use contactd_proto::{ContactRecord, ErrorCode, MassOptions, PoseRecord, StepReply, StepRequest};
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;

/// A session's world and models.
#[derive(Debug)]
pub struct Scene {
    world: World,
    models: HashMap<u32, Arc<Loaded>>,
    last_model: u32,
    /// Bytes that its models count as, and the most that they may.
    taken: u64,
    most: u64,
    max_records: usize,
    /// Set for good when the engine failed within a step: its world can no longer be trusted.
    broken: bool,
    /// Duration of its last step, seconds.
    dt: f64,
    /// Where its steps are recorded, if anywhere; and what made it so, by its number.
    tap: Option<Box<Tap>>,
    tapped: u64,
}

/// What becomes of a command.
#[derive(Debug)]
pub enum CommandOutcome {
    /// It is answered.
    Answered(Answer),
    /// A model has to be imported first; `Scene::loaded` makes the answer.
    Import(Import),
    /// A model has to be integrated over; `Integration::answer` is the answer.
    Integrate(Integration),
    /// A step has to be written; `Save::answer` is the answer.
    Save(Save),
    /// Objects are asked about; `Inquiry::answer` is the answer.
    Ask(Inquiry),
}

/// A step that is to be written as a scene folder.
#[derive(Debug)]
pub struct Save {
    folder: PathBuf,
    scene: SceneFolder,
}

impl Save {
    /// Writes it, and makes the answer.
    pub fn answer(&self) -> Answer {
        match self.scene.write(&self.folder) {
            Ok(()) => Answer::Done,
            Err(sentence) => refused(Refusal::new(ErrorCode::Recording, sentence)),
        }
    }
}

/// A model whose mass properties are asked for.
#[derive(Debug)]
pub struct Integration {
    model: Arc<Loaded>,
    options: MassOptions,
}

impl Integration {
    /// Computes the answer; may take seconds.
    pub fn answer(&self) -> Answer {
        let computed = halt::catch(|| mass_properties(&self.model.part.model, &self.options));
        match computed {
            Ok(Ok(mass)) => Answer::Mass(WireMass::from(&mass)),
            Ok(Err(e)) => refused(Refusal::new(e.code(), e.to_string())),
            Err(_) => refused(Refusal::new(ErrorCode::Internal, "the integration failed")),
        }
    }
}

/// What a face of a model counts as, in bytes: the face, its name, its part of the tree and its bounds. A short text may have a million
/// of them.
const FACE_BYTES: u64 = 200;

/// A model to be imported.
#[derive(Debug)]
pub struct Import {
    /// Its id.
    pub model: u32,
    /// What it is made of.
    pub file: ModelFile,
    /// How curved primitives are taken.
    pub facets: Facets,
}

impl Scene {
    /// An empty one.
    pub fn new(config: &ServerConfig) -> Self {
        Self {
            world: World::new(config.objects, config.batch),
            models: HashMap::new(),
            last_model: 0,
            taken: 0,
            most: config.models_mb << 20,
            max_records: config.records,
            broken: false,
            dt: 0.0,
            tap: None,
            tapped: 0,
        }
    }

    /// Records its steps from now on, or no longer; nothing where `number` says what was said before.
    pub fn record(&mut self, number: u64, tap: impl FnOnce() -> Option<Tap>) {
        if self.tapped != number {
            (self.tapped, self.tap) = (number, tap().map(Box::new));
        }
    }

    /// How many objects and models there are.
    pub fn counts(&self) -> (u32, u32) {
        let count = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        (count(self.world.bodies().len()), count(self.models.len()))
    }

    /// The world, to be asked.
    ///
    /// # Errors
    /// `Internal` where the engine has failed within a step.
    fn world(&self) -> Result<&World, Refusal> {
        if self.broken {
            return Err(Refusal::new(ErrorCode::Internal, "the engine failed in an earlier step of this session"));
        }
        Ok(&self.world)
    }

    /// Obeys a command that is not the server's own.
    pub fn command(&mut self, command: Command) -> CommandOutcome {
        let recorded = self.tap.as_ref().filter(|tap| tap.is_open() && changes(&command)).map(|_| command.clone());
        let outcome = self.obey(command).unwrap_or_else(|refusal| CommandOutcome::Answered(refused(refusal)));
        if let (Some(tap), Some(command), CommandOutcome::Answered(Answer::Done)) = (&mut self.tap, recorded, &outcome)
        {
            tap.change(Change::Command(command), None);
        }
        outcome
    }

    /// Takes an imported model, of a text of so many bytes.
    pub fn loaded(&mut self, model: u32, text: usize, loaded: Result<Arc<Loaded>, Refusal>) -> Answer {
        match loaded {
            Ok(loaded) => {
                let more = text as u64 + FACE_BYTES * loaded.faces.len() as u64;
                if let Err(refusal) = self.fits(more, &format!("model id {model}")) {
                    return refused(refusal);
                }
                let answer = Answer::Loaded { faces: loaded.faces.clone(), warnings: loaded.warnings.clone() };
                self.last_model = self.last_model.max(model);
                self.taken += more;
                if let Some(tap) = &mut self.tap {
                    tap.change(Change::Model(model, [0; 32]), Some(loaded.part()));
                }
                self.models.insert(model, loaded);
                answer
            }
            Err(refusal) => refused(refusal),
        }
    }

    /// Refuses a model that would take so much more.
    fn fits(&self, more: u64, name: &str) -> Result<(), Refusal> {
        let after = self.taken + more;
        if after <= self.most {
            return Ok(());
        }
        let detail = format!("{name}: {after} bytes of models, the limit is {}", self.most);
        Err(Refusal::new(ErrorCode::LimitMemory, detail))
    }

    fn obey(&mut self, command: Command) -> Result<CommandOutcome, Refusal> {
        match command {
            Command::Open { .. }
            | Command::Close
            | Command::Status
            | Command::EndSession(_)
            | Command::Record(_)
            | Command::Recording { .. } => {
                return Err(Refusal::new(ErrorCode::BadCommand, "the command is the server's own"));
            }
            Command::LoadModel { model, file, facets } => {
                if model <= self.last_model {
                    let detail = format!("model id {model} was used before");
                    return Err(Refusal::new(ErrorCode::BadCommand, detail));
                }
                self.fits(file.size() as u64, &file.name)?;
                return Ok(CommandOutcome::Import(Import { model, file, facets }));
            }
            Command::AddObject(spec) => {
                let spec = self.object(spec)?;
                self.world.add_object(spec)?;
            }
            Command::RemoveObject(id) => self.world.remove_object(id)?,
            Command::SetRules(rules) => {
                let each = rules.into_iter().enumerate();
                let rules = each.map(|(i, r)| r.checked().map_err(|code| Refusal::new(code, "").at(i)));
                self.world.set_rules(rules.collect::<Result<_, _>>()?)?;
            }
            Command::SetResolution(resolution) => self.world.set_resolution(resolution)?,
            Command::Restore(motion_states) => {
                let each = motion_states.iter().enumerate();
                let motion_states =
                    each.map(|(i, t)| Ok((t.object, t.checked().map_err(|code| Refusal::new(code, "").at(i))?)));
                self.world.restore(&motion_states.collect::<Result<Vec<_>, Refusal>>()?)?;
            }
            Command::MassProperties { model, tolerance, boxes } => {
                let Some(loaded) = self.models.get(&model) else {
                    return Err(Refusal::new(ErrorCode::UnknownModel, format!("model id {model}")));
                };
                let options = MassOptions { tolerance, boxes }.checked();
                let options = options.map_err(|sentence| Refusal::new(ErrorCode::BadNumber, sentence))?;
                return Ok(CommandOutcome::Integrate(Integration { model: loaded.clone(), options }));
            }
            Command::Reframe(frames) => {
                let each = frames.iter().enumerate().map(|(i, frame)| {
                    let (place, pose) = frame.checked().map_err(|code| Refusal::new(code, "").at(i))?;
                    Ok((frame.object, place, pose))
                });
                self.world.reframe(&each.collect::<Result<Vec<_>, Refusal>>()?)?;
            }
            Command::Carry { object, carrier, advance } => {
                return self.carry(object, carrier, advance).map(CommandOutcome::Answered);
            }
            Command::Ask(query) => return Ok(CommandOutcome::Ask(Inquiry::new(self.world()?, query))),
            Command::SaveStep(folder) => {
                return Ok(CommandOutcome::Save(Save { folder: folder.into(), scene: self.last_step() }));
            }
        }
        Ok(CommandOutcome::Answered(Answer::Done))
    }

    fn object(&self, spec: WireObject) -> Result<ObjectSpec, Refusal> {
        let Some(loaded) = self.models.get(&spec.model) else {
            return Err(Refusal::new(
                ErrorCode::UnknownModel,
                format!("object \"{}\": model id {}", spec.name, spec.model),
            ));
        };
        let bad = |which: &str, code| Refusal::new(code, format!("object \"{}\": {which}", spec.name));
        Ok(ObjectSpec {
            id: spec.id,
            part: loaded.part.clone(),
            is_static: spec.is_static,
            rotates: spec.rotates,
            max_speed: spec.max_speed,
            place: spec.place.checked().map_err(|code| bad("place", code))?,
            pose: spec.pose.checked().map_err(|code| bad("pose", code))?,
            name: spec.name,
            group: spec.group,
        })
    }

    /// Gives an object the frame of another one, and tells which that is. Whoever follows the session is told of the frame alone.
    fn carry(&mut self, object: u32, carrier: u32, advance: f64) -> Result<Answer, Refusal> {
        let (place, pose) = self.world.frame_of(object, carrier, advance)?;
        self.world.reframe(&[(object, place, pose)]).map_err(|e| Refusal { index: None, ..e })?;
        let frame = WireFrame { object, place: place.into(), pose: pose.into() };
        if let Some(tap) = self.tap.as_mut().filter(|tap| tap.is_open()) {
            tap.change(Change::Command(Command::Reframe(vec![frame])), None);
        }
        Ok(Answer::Reframed(frame))
    }

    /// The ids of its models, by where what was made of them lies in memory.
    fn ids_of_models(&self) -> HashMap<usize, u32> {
        self.models.iter().map(|(id, loaded)| (Arc::as_ptr(&loaded.part) as usize, *id)).collect()
    }

    /// Its objects as they were added, but for their poses: those are where their last motion began.
    fn objects(&self) -> impl Iterator<Item = WireObject> {
        let ids = self.ids_of_models();
        self.world.bodies().iter().map(move |body| WireObject {
            id: body.id,
            // Models that are one have several ids: any of them says which.
            model: ids.get(&(Arc::as_ptr(&body.part) as usize)).copied().unwrap_or_default(),
            name: body.name.clone(),
            group: self.world.group_of(body).to_owned(),
            is_static: body.is_static,
            rotates: body.rotates,
            max_speed: body.max_speed,
            place: body.place.into(),
            pose: body.motion_state.motion.start.into(),
        })
    }

    /// The session as it stands.
    fn opening(&self) -> Opening {
        let tracks = self.world.bodies().iter().map(|body| WireTrack::of(body.id, &body.motion_state));
        Opening {
            objects: self.objects().collect(),
            tracks: tracks.collect(),
            rules: self.world.rules().iter().map(WireRule::from).collect(),
            resolution: self.world.resolution(),
            ..Opening::default()
        }
    }

    /// Its last step as a scene.
    fn last_step(&self) -> SceneFolder {
        let motion_states = self.world.bodies().iter().map(|body| body.motion_state);
        let objects = self.objects().zip(motion_states).map(|(spec, motion_state)| Standing { spec, motion_state });
        SceneFolder {
            title: "The last step of a session.".into(),
            models: self.models.iter().map(|(id, loaded)| (*id, loaded.content.clone())).collect(),
            objects: objects.collect(),
            rules: self.world.rules().to_vec(),
            resolution: self.world.resolution(),
            dt: self.dt,
        }
    }

    /// One step, which heeds what is said to it meanwhile. `request` is a copy of the header; `write` is called once with the number of slots (0 for a refusal),
    /// the header of the reply and the slots by index, and passes them on.
    pub fn step<R>(
        &mut self,
        request: &StepRequest,
        records: &[PoseRecord],
        heed: Option<&Heed>,
        write: impl FnOnce(usize, StepReply, &dyn Fn(usize) -> ContactRecord) -> R,
    ) -> R {
        match self.tap.take() {
            None => self.take_step(request, records, heed, write),
            Some(tap) => self.record_step(tap, (request, records), heed, write),
        }
    }

    /// The same, recorded.
    fn record_step<R>(
        &mut self,
        mut tap: Box<Tap>,
        (request, records): (&StepRequest, &[PoseRecord]),
        heed: Option<&Heed>,
        write: impl FnOnce(usize, StepReply, &dyn Fn(usize) -> ContactRecord) -> R,
    ) -> R {
        if tap.wants_opening() {
            let parts = self.models.iter().map(|(id, loaded)| (*id, loaded.part())).collect();
            if tap.open(self.opening(), parts) {
                // What a limit of work leaves open depends on what is remembered: whoever repeats it remembers nothing.
                self.world.renew();
            }
        }
        let mut message = tap.batch(request, records);
        let batch = std::mem::take(&mut message.records);
        let told = self.take_step(request, &batch, heed, |n, reply, slot| {
            message.answer(&reply, n, slot);
            write(n, reply, &|i| message.slots[i])
        });
        message.records = batch;
        match heed.is_some_and(Heed::is_over) {
            true => tap.cut_short(message),
            false => tap.answered(message),
        }
        self.tap = Some(tap);
        told
    }

    fn take_step<R>(
        &mut self,
        request: &StepRequest,
        records: &[PoseRecord],
        heed: Option<&Heed>,
        write: impl FnOnce(usize, StepReply, &dyn Fn(usize) -> ContactRecord) -> R,
    ) -> R {
        let refuse = |code: ErrorCode, index: Option<u32>| refusal(request, code, index);
        let none = |_| ContactRecord::default();
        let n = request.records as usize;
        if self.broken {
            return write(0, refuse(ErrorCode::Internal, None), &none);
        }
        if request.version != PROTOCOL_VERSION {
            return write(0, refuse(ErrorCode::Version, None), &none);
        }
        if request.asked & !ASK_ALL != 0 {
            return write(0, refuse(ErrorCode::BadNumber, None), &none);
        }
        if n > records.len() {
            return write(0, refuse(ErrorCode::BadCount, None), &none);
        }
        let details = request.asked & ASK_DETAILS != 0;
        // Room for the records and, where asked for, a detail slot each.
        let room = self.max_records / if details { 2 } else { 1 };
        let cap = if request.max_records == 0 { room } else { room.min(request.max_records as usize) };
        let options = StepOptions {
            advance: request.advance,
            dt: request.dt,
            first: request.asked & ASK_FIRST != 0,
            clear: request.asked & ASK_CLEAR != 0,
            max_records: cap.max(1) as u32,
            max_patch_slots: u32::try_from(self.max_records).unwrap_or(u32::MAX),
            cell_limit: request.cell_limit.into(),
            batch_limit: request.batch_limit.into(),
        };
        self.dt = request.dt;
        let world = &mut self.world;
        let stepped = catch_unwind(AssertUnwindSafe(|| world.step_heeding(&records[..n], &options, heed).map(|_| ())));
        match stepped {
            Err(_) => {
                self.broken = true;
                write(0, refuse(ErrorCode::Internal, None), &none)
            }
            Ok(Err(e)) => write(0, refuse(e.code, e.index), &none),
            Ok(Ok(())) => {
                let out = self.world.outcome();
                let reply = StepReply { step: request.step, epoch: request.epoch, ..record::reply(out, details) };
                let slot = |i| record::slot(&self.world, out, details, i);
                write(record::slots_of(out, details), reply, &slot)
            }
        }
    }
}

/// True for a command that changes what steps answer.
fn changes(command: &Command) -> bool {
    matches!(
        command,
        Command::AddObject(_)
            | Command::RemoveObject(_)
            | Command::SetRules(_)
            | Command::SetResolution(_)
            | Command::Restore(_)
            | Command::Reframe(_)
    )
}

/// The reply to a step that was refused.
pub fn refusal(request: &StepRequest, code: ErrorCode, index: Option<u32>) -> StepReply {
    StepReply {
        step: request.step,
        epoch: request.epoch,
        status: STEP_REFUSED,
        error: code.number(),
        index: index.unwrap_or(NO_INDEX),
        ..StepReply::default()
    }
}

/// The answer to a command that was refused.
pub fn refused(refusal: Refusal) -> Answer {
    Answer::Refused { code: refusal.code.number(), index: refusal.index.unwrap_or(NO_INDEX), detail: refusal.detail }
}
