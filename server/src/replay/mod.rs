//! A recording, repeated step by step on an embedded engine, and compared to the bit; and one of its steps as a scene.
//!
//! Each opening begins a session anew; what was recorded behind it is asked again in the same order. Answers are the same bits but for
//! the counts of work: the first that differs is named. Where bodies stand follows from the batches alone, so a step that is only to
//! be written as a scene needs no search.
//!
//! Floor 11: imports `ipc`, `recording` and below.

mod compare;

use crate::ipc::{Embedded, ServerConfig};
use crate::recording::{
    About, Change, Content, Entry, FileError, Key, Opening, Recording, SceneFolder, Standing, StepMessage,
};
use contactd_client::{Error, Transport};
use contactd_proto::control::{Answer, Command, ObjectSpec, WirePose};
use contactd_proto::step::{NO_INDEX, STEP_REFUSED};
use contactd_proto::{ErrorCode, MotionState, Rule, Tracks};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

pub use compare::first_difference;

/// Why a recording cannot be repeated.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// Its file.
    #[error(transparent)]
    File(#[from] FileError),
    /// What stands in it; the file's name, the entry's place.
    #[error("{0}: {1}")]
    Content(String, String),
}

/// The first answer that is not the recorded one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The step's number in the recording, from 1.
    pub step: u64,
    /// Its session.
    pub session: u64,
    /// Its number in that session.
    pub own: u64,
    /// What differs, recorded and repeated.
    pub what: String,
}

/// What came of a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Replayed {
    /// Steps that were repeated.
    pub steps: u64,
    /// Sessions that they are of.
    pub sessions: u64,
    /// Steps that were left out when it was recorded, as far as the file tells.
    pub dropped: u64,
    /// The file was cut: it has no end.
    pub is_cut: bool,
    /// Version of contactd that has recorded it.
    pub version: String,
    /// The first difference, if there is one.
    pub difference: Option<Difference>,
}

impl Replayed {
    /// A few lines.
    pub fn text(&self) -> String {
        let many = |n: u64, one: &str| format!("{n} {one}{}", if n == 1 { "" } else { "s" });
        let mut out = match &self.difference {
            None if self.steps == 0 => "no step is in the file: nothing was repeated\n".to_owned(),
            None => {
                format!("{} of {} repeated, all bits equal\n", many(self.steps, "step"), many(self.sessions, "session"))
            }
            Some(d) => {
                let Difference { step, session, own, what } = d;
                format!(
                    "step {step} differs (step {own} of session {session}): {what}\n{} before it are equal\n",
                    step - 1
                )
            }
        };
        if self.version != env!("CARGO_PKG_VERSION") {
            out += &format!("contactd {} has recorded, this is {}\n", self.version, env!("CARGO_PKG_VERSION"));
        }
        if self.dropped > 0 {
            out += &format!("{} were left out when it was recorded\n", many(self.dropped, "step"));
        }
        if self.is_cut {
            out += "the file has no end: it was cut, and read up to there\n";
        }
        out
    }
}

/// Repeats a recording up to its end, to where it was cut, or to the first difference. `told` is called with every step's number.
///
/// # Errors
/// A file that is no recording or is damaged; one that tells what no session has done.
pub fn replay(path: &Path, mut told: impl FnMut(u64)) -> Result<Replayed, ReplayError> {
    let mut recording = Recording::open(path)?;
    let name = path.display().to_string();
    let mut out = Replayed { version: recording.about.version.clone(), ..Replayed::default() };
    let root = Embedded::new(&config(&recording.about));
    let mut sessions: BTreeMap<u64, Embedded> = BTreeMap::new();
    while let Some(entry) = recording.next_entry()? {
        let refused = |what: String| ReplayError::Content(name.clone(), what);
        match entry {
            Entry::Opening(session, opening) => {
                out.dropped += opening.dropped;
                let engine = open(&root, &recording, &opening);
                // The one before it has its models: those that are the same are not imported again.
                sessions.insert(
                    session,
                    engine.map_err(|e| refused(format!("the opening after step {}: {e}", out.steps)))?,
                );
            }
            Entry::Change(session, change) => {
                let engine = of(&mut sessions, session).map_err(refused)?;
                alter(engine, &recording, change)
                    .map_err(|e| refused(format!("a change after step {}: {e}", out.steps)))?;
            }
            Entry::Step(step) => {
                out.steps += 1;
                told(out.steps);
                let engine = of(&mut sessions, step.session).map_err(refused)?;
                let what = again(engine, &step).map_err(|e| refused(format!("step {}: {e}", out.steps)))?;
                if let Some(what) = what {
                    let (session, own) = (step.session, step.request.step);
                    out.difference = Some(Difference { step: out.steps, session, own, what });
                    break;
                }
            }
        }
    }
    out.sessions = sessions.len() as u64;
    out.is_cut = recording.is_cut;
    let said = |what: &str| recording.end.as_ref().and_then(|end| end.get(what)).and_then(|n| n.parse::<u64>().ok());
    out.dropped = said("dropped").unwrap_or(out.dropped);
    // What a reader of MCAP takes for a record that it does not know is passed over: so steps can be lost.
    let counted = said("steps").filter(|steps| *steps != out.steps && out.difference.is_none());
    match counted {
        Some(steps) => Err(ReplayError::Content(
            name,
            format!("expected {steps} steps, as it says at its end, found {}: the file is damaged", out.steps),
        )),
        None => Ok(out),
    }
}

/// The settings of the engine that was recorded.
fn config(about: &About) -> ServerConfig {
    let About { objects, batch, records, text, nodes, depth, faces, models_mb, .. } = *about;
    ServerConfig { objects, batch, records, text, nodes, depth, faces, models_mb, ..ServerConfig::default() }
}

fn of(sessions: &mut BTreeMap<u64, Embedded>, session: u64) -> Result<&mut Embedded, String> {
    sessions.get_mut(&session).ok_or_else(|| format!("session {session} has no opening"))
}

/// A session as it stood.
fn open(root: &Embedded, recording: &Recording, opening: &Opening) -> Result<Embedded, String> {
    let mut engine = root.beside();
    for (id, key) in &opening.models {
        load(&mut engine, recording, *id, key)?;
    }
    // The resolution first: objects were taken under it.
    ask(&mut engine, Command::SetResolution(opening.resolution))?;
    for object in &opening.objects {
        ask(&mut engine, Command::AddObject(object.clone()))?;
    }
    ask(&mut engine, Command::SetRules(opening.rules.clone()))?;
    ask(&mut engine, Command::Restore(opening.tracks.clone()))?;
    Ok(engine)
}

fn load(engine: &mut Embedded, recording: &Recording, id: u32, key: &Key) -> Result<(), String> {
    let content = recording.content(key).ok_or_else(|| format!("model {id} is not in the file"))?;
    match engine.load_content(id, content) {
        Answer::Loaded { .. } => Ok(()),
        other => Err(format!("model {id}: {}", sentence(other))),
    }
}

fn alter(engine: &mut Embedded, recording: &Recording, change: Change) -> Result<(), String> {
    match change {
        Change::Model(id, key) => load(engine, recording, id, &key),
        Change::Command(command) => ask(engine, command),
    }
}

fn ask(engine: &mut Embedded, command: Command) -> Result<(), String> {
    match engine.command(command, Duration::MAX).map_err(|e| e.to_string())? {
        Answer::Done => Ok(()),
        other => Err(sentence(other)),
    }
}

fn sentence(answer: Answer) -> String {
    match answer {
        Answer::Refused { code, index, detail } => {
            let code = ErrorCode::of_number(code).unwrap_or(ErrorCode::Internal);
            let index = (index != NO_INDEX).then_some(index);
            format!("it was accepted, and is refused now: {}", Error::Refused { code, index, detail })
        }
        other => format!("an answer that does not belong to it: {other:?}"),
    }
}

/// Repeats a step; what differs first, if anything does.
fn again(engine: &mut Embedded, step: &StepMessage) -> Result<Option<String>, String> {
    let slots = engine.loan(step.records.len()).map_err(|e| e.to_string())?;
    slots.copy_from_slice(&step.records);
    engine.send(step.request).map_err(|e| e.to_string())?;
    let (reply, slots) = engine.reply().ok_or("there is no reply")?;
    Ok(first_difference((&step.reply, &step.slots), (reply, slots)))
}

/// A session whose steps are followed without a search.
#[derive(Default)]
struct Followed {
    models: BTreeMap<u32, Key>,
    objects: BTreeMap<u32, ObjectSpec>,
    tracks: Tracks,
    rules: Vec<Rule>,
    resolution: Option<f64>,
}

/// Steps of a session, one after the other, with the same objects of the same models.
#[derive(Clone, Debug)]
pub struct Run {
    /// The session.
    pub session: u64,
    /// The number of the first one in the recording, from 1.
    pub first: u64,
    /// What the models of the scenes were made of, in order.
    pub contents: Vec<Arc<Content>>,
    /// The steps as texts of scene files. Steps that were refused moved nothing, and are none.
    pub scenes: Vec<String>,
}

/// A step of a recording as a scene.
#[derive(Clone, Debug)]
pub struct Told {
    /// Its session.
    pub session: u64,
    /// Its number in the recording, from 1.
    pub number: u64,
    /// Its objects or models are not those of the session's step before it, where they stand and their frames left out.
    pub is_fresh: bool,
    /// What the models of the scene were made of, in order; of a step that is fresh.
    pub contents: Vec<Arc<Content>>,
    /// The objects of the scene, in order, without where they stand and their frames; of a step that is fresh.
    pub objects: Vec<ObjectSpec>,
    /// The text of a scene file.
    pub scene: String,
}

/// The steps of a recording as scenes, one after the other; also of one that is still written.
pub struct Following {
    recording: Recording,
    name: String,
    sessions: BTreeMap<u64, Followed>,
    /// Models and objects of a session's last step.
    told: BTreeMap<u64, (Vec<Arc<Content>>, Vec<ObjectSpec>)>,
    /// Sessions in which nothing has changed since their last step.
    settled: BTreeSet<u64>,
    steps: u64,
}

impl Following {
    /// A recording that is complete, or was cut.
    ///
    /// # Errors
    /// A file that is no recording.
    pub fn open(path: &Path) -> Result<Self, ReplayError> {
        Ok(Self::of(path, Recording::open(path)?))
    }

    /// A recording that a server has begun to write: `None` until it says what it is.
    pub fn growing(path: &Path) -> Option<Self> {
        Recording::open(path).ok().map(|recording| Self::of(path, recording.followed()))
    }

    fn of(path: &Path, recording: Recording) -> Self {
        let name = path.display().to_string();
        let (sessions, told, settled) = (BTreeMap::new(), BTreeMap::new(), BTreeSet::new());
        Self { recording, name, sessions, told, settled, steps: 0 }
    }

    /// Bytes of the file that were read, and those that were written since.
    pub fn bytes(&self) -> (u64, u64) {
        self.recording.bytes()
    }

    /// The next step that was taken; steps that were refused moved nothing, and are left out. `None` at the end, or where a recording
    /// that is still written has no more yet.
    ///
    /// # Errors
    /// As `replay`.
    pub fn next_step(&mut self) -> Result<Option<Told>, ReplayError> {
        let refused = |name: &str, what: String| ReplayError::Content(name.to_owned(), what);
        while let Some(entry) = self.recording.next_entry()? {
            let (steps, name) = (self.steps, self.name.as_str());
            match entry {
                Entry::Opening(session, opening) => {
                    let followed = Followed::open(opening)
                        .map_err(|e| refused(name, format!("the opening after step {steps}: {e}")))?;
                    self.sessions.insert(session, followed);
                    self.settled.remove(&session);
                }
                Entry::Change(session, change) => {
                    let followed = self.sessions.get_mut(&session);
                    let followed =
                        followed.ok_or_else(|| refused(name, format!("session {session} has no opening")))?;
                    followed.alter(change).map_err(|e| refused(name, format!("a change after step {steps}: {e}")))?;
                    self.settled.remove(&session);
                }
                Entry::Step(step) => {
                    self.steps += 1;
                    let (session, number) = (step.session, self.steps);
                    let followed = self.sessions.get_mut(&session);
                    let followed =
                        followed.ok_or_else(|| refused(name, format!("session {session} has no opening")))?;
                    if step.reply.status == STEP_REFUSED {
                        continue;
                    }
                    followed.tracks.take(&step.records, step.request.advance);
                    let wrong = |e: String| refused(name, format!("step {number}: {e}"));
                    let folder = followed.scene(&self.recording, number, &step).map_err(wrong)?;
                    let nowhere = WirePose { position: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };
                    let anywhere = |spec: &ObjectSpec| ObjectSpec { place: nowhere, pose: nowhere, ..spec.clone() };
                    let (mut contents, mut objects, mut is_fresh) = (Vec::new(), Vec::new(), false);
                    if self.settled.insert(session) {
                        let now = (folder.contents(), folder.objects.iter().map(|o| anywhere(&o.spec)).collect());
                        is_fresh = self.told.get(&session) != Some(&now);
                        if is_fresh {
                            (contents, objects) = now.clone();
                            self.told.insert(session, now);
                        }
                    }
                    let scene = folder.text().map_err(|e| wrong(e.to_string()))?;
                    return Ok(Some(Told { session, number, is_fresh, contents, objects, scene }));
                }
            }
        }
        Ok(None)
    }
}

/// The steps of a recording as scenes, the first `most` of them; and whether there are more.
///
/// # Errors
/// As `replay`.
pub fn runs(path: &Path, most: usize) -> Result<(Vec<Run>, bool), ReplayError> {
    let mut following = Following::open(path)?;
    let mut runs: Vec<Run> = Vec::new();
    // Of each session the run that its next step belongs to.
    let mut current: BTreeMap<u64, usize> = BTreeMap::new();
    let mut kept = 0;
    while let Some(Told { session, number, is_fresh, contents, scene, .. }) = following.next_step()? {
        if kept == most {
            return Ok((runs, true));
        }
        kept += 1;
        if is_fresh {
            current.insert(session, runs.len());
            runs.push(Run { session, first: number, contents, scenes: Vec::new() });
        }
        if let Some(run) = current.get(&session).and_then(|at| runs.get_mut(*at)) {
            run.scenes.push(scene);
        }
    }
    Ok((runs, false))
}

/// Step `number` (from 1) of a recording as a scene folder.
///
/// # Errors
/// As `replay`; there is no such step, or it was refused and moved nothing.
pub fn scene_of(path: &Path, number: u64) -> Result<SceneFolder, ReplayError> {
    let mut recording = Recording::open(path)?;
    let refused = |what: String| ReplayError::Content(path.display().to_string(), what);
    let mut sessions: BTreeMap<u64, Followed> = BTreeMap::new();
    let mut steps = 0;
    while let Some(entry) = recording.next_entry()? {
        match entry {
            Entry::Opening(session, opening) => {
                let followed =
                    Followed::open(opening).map_err(|e| refused(format!("the opening after step {steps}: {e}")))?;
                sessions.insert(session, followed);
            }
            Entry::Change(session, change) => {
                let followed =
                    sessions.get_mut(&session).ok_or_else(|| refused(format!("session {session} has no opening")))?;
                followed.alter(change).map_err(|e| refused(format!("a change after step {steps}: {e}")))?;
            }
            Entry::Step(step) => {
                steps += 1;
                let session = step.session;
                let followed =
                    sessions.get_mut(&session).ok_or_else(|| refused(format!("session {session} has no opening")))?;
                if step.reply.status != STEP_REFUSED {
                    followed.tracks.take(&step.records, step.request.advance);
                }
                if steps == number {
                    return followed
                        .scene(&recording, number, &step)
                        .map_err(|e| refused(format!("step {number}: {e}")));
                }
            }
        }
    }
    Err(refused(format!("expected a step from 1 to {steps}, found {number}")))
}

impl Followed {
    fn open(opening: Opening) -> Result<Self, ErrorCode> {
        let mut tracks = Tracks::default();
        for track in &opening.tracks {
            tracks.put(track.object, track.checked()?);
        }
        Ok(Self {
            models: opening.models.into_iter().collect(),
            objects: opening.objects.into_iter().map(|o| (o.id, o)).collect(),
            tracks,
            rules: opening.rules.into_iter().map(|rule| rule.checked()).collect::<Result<_, _>>()?,
            resolution: opening.resolution,
        })
    }

    fn alter(&mut self, change: Change) -> Result<(), ErrorCode> {
        match change {
            Change::Model(id, key) => {
                self.models.insert(id, key);
            }
            Change::Command(Command::AddObject(spec)) => {
                self.tracks.put(spec.id, MotionState::resting(spec.pose.checked()?));
                self.objects.insert(spec.id, spec);
            }
            Change::Command(Command::RemoveObject(id)) => {
                self.objects.remove(&id);
                self.tracks.removed(id);
            }
            Change::Command(Command::SetRules(rules)) => {
                self.rules = rules.into_iter().map(|rule| rule.checked()).collect::<Result<_, _>>()?;
            }
            Change::Command(Command::SetResolution(resolution)) => self.resolution = resolution,
            Change::Command(Command::Restore(tracks)) => {
                for track in tracks {
                    self.tracks.put(track.object, track.checked()?);
                }
            }
            Change::Command(Command::Reframe(frames)) => {
                for frame in frames {
                    let (place, pose) = frame.checked()?;
                    if let Some(spec) = self.objects.get_mut(&frame.object) {
                        spec.place = place.into();
                        self.tracks.put(frame.object, MotionState::resting(pose));
                    }
                }
            }
            Change::Command(_) => return Err(ErrorCode::BadCommand),
        }
        Ok(())
    }

    fn scene(&self, recording: &Recording, number: u64, step: &StepMessage) -> Result<SceneFolder, String> {
        if step.reply.status == STEP_REFUSED {
            let code = ErrorCode::of_number(step.reply.error).unwrap_or(ErrorCode::Internal);
            return Err(format!("it was refused, and moved nothing: {code}"));
        }
        let content = |(id, key): (&u32, &Key)| {
            let content = recording.content(key).ok_or_else(|| format!("model {id} is not in the file"))?;
            Ok((*id, content.clone()))
        };
        let standing = |(id, motion_state): (u32, &MotionState)| {
            let spec = self.objects.get(&id)?.clone();
            Some(Standing { spec, motion_state: *motion_state })
        };
        Ok(SceneFolder {
            title: format!("Step {number} of a recording: step {} of session {}.", step.request.step, step.session),
            models: self.models.iter().map(content).collect::<Result<_, String>>()?,
            objects: self.tracks.iter().filter_map(standing).collect(),
            rules: self.rules.clone(),
            resolution: self.resolution,
            dt: step.request.dt,
        })
    }
}
