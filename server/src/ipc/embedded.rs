//! A session in the caller's own process: the same calls and the same bits as over shared memory, without a server.

use super::config::ServerConfig;
use super::models::Models;
use super::scene::{CommandOutcome, Import, Scene, refused};
use crate::world::Refusal;
use contactd_client::transport::{Opened, Transport};
use contactd_client::{Error, Session};
use contactd_proto::control::{Answer, Command};
use contactd_proto::{ContactRecord, ErrorCode, PoseRecord, StepReply, StepRequest};
use std::sync::Arc;
use std::time::Duration;

/// The engine in the caller's process, as a session's transport.
#[derive(Debug)]
pub struct Embedded {
    models: Arc<Models>,
    scene: Scene,
    max_batch: u32,
    records: Vec<PoseRecord>,
    slots: Vec<ContactRecord>,
    reply: Option<StepReply>,
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
        Self {
            models: Arc::new(Models::new(config)),
            scene: Scene::new(config),
            max_batch: config.batch as u32,
            records: Vec::new(),
            slots: Vec::new(),
            reply: None,
        }
    }

    fn import(&mut self, import: Import) -> Answer {
        let loaded = self.models.load(&import.file, import.facets);
        self.scene.loaded(import.model, import.file.bytes.len(), loaded)
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
            Command::Open { .. } => refused(Refusal::new(ErrorCode::BadCommand, "an embedded session is open")),
            command => match self.scene.command(command) {
                CommandOutcome::Answered(answer) => answer,
                CommandOutcome::Import(import) => self.import(import),
                CommandOutcome::Integrate(integration) => integration.answer(),
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

    fn send(&mut self, request: StepRequest) -> Result<(), Error> {
        let Self { scene, records, slots, .. } = self;
        let reply = scene.step(&request, records, None, |n, reply, slot| {
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
