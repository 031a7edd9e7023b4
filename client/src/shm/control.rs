//! The way to a server beside its steps: where it is, whether it lives, and what commands ask of it.

use super::link::{self, ControlClient, Variant, system};
use super::pages::{self, Pages};
use super::watch::ProcessWatch;
use crate::Error;
use contactd_proto::control::{Answer, Command, ControlHeader, Envelope, decode, encode};
use contactd_proto::names::{self, Address, Incarnation, PROTOCOL_VERSION};
use contactd_proto::status::StatusRecord;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::*;
use rustix::fs::{FlockOperation, flock};
use std::time::{Duration, Instant};

/// Longest wait between two looks at whether the server lives.
pub const SLICE: Duration = Duration::from_millis(50);

/// The ports for commands to one incarnation. Fields are dropped in this order.
pub struct Control {
    server: Notifier<Variant>,
    control: ControlClient,
    pages: Pages,
    /// Its life.
    pub life: Life,
    /// The incarnation.
    pub epoch: u64,
    /// What the ports belong to.
    pub node: Node<Variant>,
}

/// How the server's life is watched.
pub enum Life {
    /// By its process.
    Process(ProcessWatch),
    /// By its lock: its process is not visible from here.
    Lock(Address, u64),
}

impl Life {
    /// True once it is over.
    pub fn is_over(&self) -> bool {
        match self {
            Self::Process(watch) => watch.is_dead(),
            Self::Lock(address, epoch) => {
                !is_locked(address) || address.current().is_none_or(|now| now.epoch != *epoch)
            }
        }
    }
}

/// True when a server holds its lock.
pub fn is_locked(address: &Address) -> bool {
    let Ok(file) = std::fs::File::open(address.lock_file()) else { return false };
    flock(&file, FlockOperation::NonBlockingLockShared).is_err()
}

/// What the server at `address` shows of itself, whatever version it speaks.
///
/// # Errors
/// `NoServer`, `Address`, `System`.
pub fn shown(address: &Address) -> Result<StatusRecord, Error> {
    let (incarnation, _) = find(address)?;
    let node = link::node(&link::config(address, incarnation.epoch)?)?;
    read_status(&node)
}

/// The serving incarnation and a watch on its life.
fn find(address: &Address) -> Result<(Incarnation, Life), Error> {
    let none = || Error::NoServer(address.name().into());
    if !address.folder().exists() {
        return Err(none());
    }
    address.check_private()?;
    let now = address.current().ok_or_else(none)?;
    let life = match ProcessWatch::of(now.pid, now.start) {
        Some(watch) => Life::Process(watch),
        None => Life::Lock(address.clone(), now.epoch),
    };
    // Read again after the watch stands: what it watches is the incarnation that serves.
    if address.current() != Some(now) || life.is_over() || !is_locked(address) {
        return Err(none());
    }
    Ok((now, life))
}

fn read_status(node: &Node<Variant>) -> Result<StatusRecord, Error> {
    let name = link::service_name(names::STATUS_SERVICE)?;
    let service = node.service_builder(&name).blackboard_opener::<u32>().open();
    let service = service.map_err(|e| system(names::STATUS_SERVICE, e))?;
    let reader = service.reader_builder().create().map_err(|e| system("status reader", e))?;
    let entry = reader.entry::<StatusRecord>(&link::STATUS_KEY).map_err(|e| system("status entry", e))?;
    Ok(*entry.get())
}

impl Control {
    /// Opens the ports, and makes of them what is wanted.
    ///
    /// # Errors
    /// `NoServer`, `Address`, `Version`, `System`.
    pub fn with<T>(address: &Address, make: impl FnOnce(Self) -> Result<T, Error>) -> Result<T, Error> {
        let (incarnation, life) = find(address)?;
        let config = link::config(address, incarnation.epoch)?;
        pages::room(0)?;
        let opened = link::node(&config).and_then(|node| Self::on(node, life, incarnation.epoch));
        match opened.and_then(make) {
            // What cannot be opened because its server is just going is no fault of the system.
            Err(Error::System(_)) if !is_locked(address) || address.current() != Some(incarnation) => {
                Err(Error::NoServer(address.name().into()))
            }
            other => other,
        }
    }

    fn on(node: Node<Variant>, life: Life, epoch: u64) -> Result<Self, Error> {
        let status = read_status(&node)?;
        if !(status.version_min..=status.version_max).contains(&PROTOCOL_VERSION) {
            return Err(Error::Version { min: status.version_min, max: status.version_max });
        }
        let control = node
            .service_builder(&link::service_name(names::CONTROL_SERVICE)?)
            .request_response::<[u8], [u8]>()
            .request_user_header::<ControlHeader>()
            .response_user_header::<ControlHeader>()
            .open()
            .map_err(|e| system(names::CONTROL_SERVICE, e))?
            .client_builder()
            .initial_max_slice_len(4096)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| system("control port", e))?;
        let server = node
            .service_builder(&link::service_name(names::WAKE_SERVICE)?)
            .event()
            .open()
            .map_err(|e| system(names::WAKE_SERVICE, e))?
            .notifier_builder()
            .create()
            .map_err(|e| system("wake port", e))?;
        Ok(Self { server, control, pages: Pages::default(), life, epoch, node })
    }

    /// Asks something of a session (0: of none), and waits for the answer by `wait`.
    ///
    /// # Errors
    /// `ServerLost`, `ReplyLost`, `Timeout`, `System`; a refusal is an answer, not an error.
    pub fn command(
        &self,
        session: u64,
        command: Command,
        timeout: Duration,
        wait: impl Fn(Duration),
    ) -> Result<Answer, Error> {
        let bytes = encode(&Envelope { epoch: self.epoch, session, command }).map_err(Error::refused)?;
        self.pages.before(bytes.len())?;
        let loan = self.control.loan_slice_uninit(bytes.len()).map_err(|e| system("no memory for a command", e))?;
        self.pages.claim(loan.payload())?;
        let mut request = loan.write_from_slice(&bytes);
        *request.user_header_mut() = ControlHeader { version: PROTOCOL_VERSION, reserved: 0 };
        let pending = request.send().map_err(|e| system("a command cannot be sent", e))?;
        self.wake_server();
        let start = Instant::now();
        loop {
            let connected = pending.is_connected();
            match pending.receive() {
                Ok(Some(answer)) => {
                    // One copy: what is decoded can no longer change.
                    let bytes = answer.payload().to_vec();
                    return decode(&bytes).map_err(Error::refused);
                }
                Ok(None) if self.life.is_over() => return Err(Error::ServerLost),
                Ok(None) if !connected => return Err(Error::ReplyLost),
                Ok(None) => {}
                Err(e) => return Err(system("an answer cannot be received", e)),
            }
            if start.elapsed() > timeout {
                return Err(Error::Timeout);
            }
            // The waits grow with what has been waited: a load of seconds is not polled by microseconds.
            wait((start.elapsed() / 4).clamp(Duration::from_micros(100), SLICE));
        }
    }

    /// Wakes the server.
    pub fn wake_server(&self) {
        // A server that cannot be woken is dead or full of wake-ups: either shows elsewhere.
        let _ = self.server.notify();
    }
}
