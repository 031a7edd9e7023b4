//! A session in the caller's own process: the same calls and the same bits as over shared memory, without a server.

use super::config::ServerConfig;
use super::models::Models;
use super::recordings;
use super::scene::{CommandOutcome, Import, Scene, refused};
use crate::recording::{Content, Recorder, Tap};
use crate::world::{Crew, Heed, Refusal};
use contactd_client::transport::{Opened, Transport};
use contactd_client::{Error, Session};
use contactd_proto::control::{Answer, Command, RecordingOrder, RecordingStatus};
use contactd_proto::{ContactRecord, ErrorCode, PoseRecord, StepReply, StepRequest};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// The engine in the caller's process, as a session's transport.
#[derive(Debug)]
pub struct Embedded {
    models: Arc<Models>,
    config: ServerConfig,
    /// Before the scene, whose tap holds on to the recorder.
    recording: Option<OwnRecording>,
    /// How many recordings have begun or ended.
    recordings: u64,
    scene: Scene,
    max_batch: u32,
    records: Vec<PoseRecord>,
    slots: Vec<ContactRecord>,
    reply: Option<StepReply>,
    /// The threads of steps that have a deadline.
    crew: Arc<Crew>,
}

/// A recording in the caller's process.
#[derive(Debug)]
struct OwnRecording {
    recorder: Arc<Recorder>,
    ended: Receiver<RecordingStatus>,
}

/// How long the end of a session waits for its recording.
const COMPLETED: Duration = Duration::from_secs(20);

impl Drop for OwnRecording {
    /// A session that ends completes its file: the process may end next.
    fn drop(&mut self) {
        self.recorder.stop();
        let _ = self.ended.recv_timeout(COMPLETED);
    }
}

/// A session on an engine of its own, in this process.
///
/// # Errors
/// None today; the signature is that of every session.
pub fn embedded(config: &ServerConfig) -> Result<Session<Embedded>, Error> {
    Session::new(Embedded::new(config))
}

impl Embedded {
    /// An engine without a session; for callers that choose the transport at run time.
    pub fn new(config: &ServerConfig) -> Self {
        Self::with_models(config, Arc::new(Models::new(config)))
    }

    /// Another one, of a session of its own, that shares its models with this one.
    pub fn beside(&self) -> Self {
        Self::with_models(&self.config, self.models.clone())
    }

    fn with_models(config: &ServerConfig, models: Arc<Models>) -> Self {
        Self {
            models,
            config: config.clone(),
            recording: None,
            recordings: 0,
            scene: Scene::new(config),
            max_batch: config.batch as u32,
            records: Vec::new(),
            slots: Vec::new(),
            reply: None,
            crew: Arc::new(Crew::new(std::thread::available_parallelism().map_or(1, usize::from))),
        }
    }

    /// Loads a model from its content, as a recording has it.
    pub fn load_content(&mut self, model: u32, content: &Arc<Content>) -> Answer {
        let loaded = self.models.of_content(content.clone());
        self.scene.loaded(model, content.bytes.len(), loaded)
    }

    /// Records from now on into something else than a file.
    ///
    /// # Errors
    /// `Recording`: it is recorded already, or cannot be.
    pub fn record_over(&mut self, path: &str, sink: Box<dyn std::io::Write + Send>) -> Result<(), Refusal> {
        self.record_with(|about, ended| Recorder::over(path, sink, about, ended))
    }

    fn record(&mut self, order: &RecordingOrder) -> Result<(), Refusal> {
        self.record_with(|about, ended| Recorder::start(&order.path, about, ended))
    }

    fn record_with(
        &mut self,
        start: impl FnOnce(&crate::recording::About, Box<dyn FnOnce(RecordingStatus) + Send>) -> Result<Recorder, String>,
    ) -> Result<(), Refusal> {
        if let Some(recording) = &self.recording {
            let path = recording.recorder.status().path;
            return Err(recordings::refusal(format!("a recording runs already, into {path}")));
        }
        let about = recordings::about(&self.config)?;
        let (to, ended) = channel();
        let tell = move |status| {
            // Where the session is gone nobody asks.
            let _ = to.send(status);
        };
        let recorder = Arc::new(start(&about, Box::new(tell)).map_err(recordings::refusal)?);
        self.recording = Some(OwnRecording { recorder: recorder.clone(), ended });
        self.recordings += 1;
        self.scene.record(self.recordings, || Some(Tap::new(1, recorder)));
        Ok(())
    }

    /// What was recorded; with `stop` once the file is complete.
    fn recorded(&mut self, stop: bool) -> Result<RecordingStatus, Refusal> {
        let none = || recordings::refusal("nothing is being recorded");
        if !stop {
            return self.recording.as_ref().map(|recording| recording.recorder.status()).ok_or_else(none);
        }
        let recording = self.recording.take().ok_or_else(none)?;
        self.recordings += 1;
        self.scene.record(self.recordings, || None);
        recording.recorder.stop();
        let ended = recording.ended.recv();
        // After a failure steps have gone on being left out.
        ended.map(|_| recording.recorder.status()).map_err(|_| recordings::refusal("the recorder has failed"))
    }

    fn import(&mut self, import: Import) -> Answer {
        let loaded = self.models.load(&import.file, import.facets);
        self.scene.loaded(import.model, import.file.size(), loaded)
    }
}

impl Transport for Embedded {
    fn may_lose_server(&self) -> bool {
        false
    }

    fn open(&mut self) -> Result<Opened, Error> {
        Ok(Opened { session: 1, epoch: 0, max_batch: self.max_batch })
    }

    fn command(&mut self, command: Command, _: Duration) -> Result<Answer, Error> {
        Ok(match command {
            Command::Close => Answer::Done,
            Command::Record(order) => self.record(&order).map_or_else(refused, |()| Answer::Done),
            Command::Recording { stop } => self.recorded(stop).map_or_else(refused, Answer::Recorded),
            Command::Open { .. } => refused(Refusal::new(ErrorCode::BadCommand, "an embedded session is open")),
            command => match self.scene.command(command) {
                CommandOutcome::Answered(answer) => answer,
                CommandOutcome::Import(import) => self.import(import),
                CommandOutcome::Integrate(integration) => integration.answer(),
                CommandOutcome::Save(save) => save.answer(),
                CommandOutcome::Ask(inquiry) => inquiry.answer().map_or_else(refused, Answer::Told),
            },
        })
    }

    fn loan(&mut self, records: usize) -> Result<&mut [PoseRecord], Error> {
        self.reply = None;
        self.records.clear();
        self.records.resize(records, PoseRecord::default());
        Ok(&mut self.records)
    }

    fn loaned(&self) -> &[PoseRecord] {
        &self.records
    }

    fn loaned_mut(&mut self) -> &mut [PoseRecord] {
        &mut self.records
    }

    fn send(&mut self, request: StepRequest) -> Result<(), Error> {
        let heed = self.config.deadline().map(|deadline| Heed::new(Some(deadline), self.crew.clone()));
        let Self { scene, records, slots, .. } = self;
        let reply = scene.step(&request, records, heed.as_ref(), |n, reply, slot| {
            slots.clear();
            slots.extend((0..n).map(slot));
            reply
        });
        self.reply = Some(reply);
        Ok(())
    }

    fn receive(&mut self, _: Duration) -> Result<(), Error> {
        if self.reply.is_some() { Ok(()) } else { Err(Error::Misuse("no step is in flight")) }
    }

    fn reply(&self) -> Option<(&StepReply, &[ContactRecord])> {
        self.reply.as_ref().map(|reply| (reply, self.slots.as_slice()))
    }
}
