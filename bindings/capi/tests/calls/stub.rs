//! A transport that fails as it is told, for what a healthy server never does.

use crate::support::Open;
use contactd_capi::hand_over;
use contactd_client::Error;
use contactd_client::transport::{Opened, Transport};
use contactd_proto::control::{Answer, Command};
use contactd_proto::{ContactRecord, PoseRecord, StepReply, StepRequest};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::Duration;

/// What the next calls of `receive` do; an empty list: they succeed.
pub type Script = Rc<RefCell<VecDeque<Box<dyn FnOnce() -> Result<(), Error>>>>>;

struct Stub {
    script: Script,
    records: Vec<PoseRecord>,
    reply: Option<StepReply>,
}

/// A session whose server's `receive` follows a script.
pub fn scripted(script: &Script) -> Open {
    let stub = Stub { script: script.clone(), records: Vec::new(), reply: None };
    Open(hand_over(Box::new(stub)).expect("a session"))
}

impl Transport for Stub {
    fn may_lose_server(&self) -> bool {
        true
    }

    fn open(&mut self) -> Result<Opened, Error> {
        Ok(Opened { session: 9, epoch: 7, max_batch: 4 })
    }

    fn command(&mut self, _: Command, _: Duration) -> Result<Answer, Error> {
        Ok(Answer::Done)
    }

    fn loan(&mut self, records: usize) -> Result<&mut [PoseRecord], Error> {
        self.records = vec![PoseRecord::default(); records];
        Ok(&mut self.records)
    }

    fn loaned(&self) -> &[PoseRecord] {
        &self.records
    }

    fn loaned_mut(&mut self) -> &mut [PoseRecord] {
        &mut self.records
    }

    fn send(&mut self, request: StepRequest) -> Result<(), Error> {
        self.reply = Some(StepReply { step: request.step, epoch: request.epoch, status: 1, ..StepReply::default() });
        Ok(())
    }

    fn receive(&mut self, _: Duration) -> Result<(), Error> {
        let next = self.script.borrow_mut().pop_front();
        next.map_or(Ok(()), |step| step())
    }

    fn reply(&self) -> Option<(&StepReply, &[ContactRecord])> {
        self.reply.as_ref().map(|reply| (reply, [].as_slice()))
    }
}
