//! The client's ports and the one request that may be under way.

use super::control::{self, Control, SLICE};
use super::link::{self, StepClient, Variant, system};
use super::pages::Pages;
use crate::Error;
use crate::transport::{Opened, Transport};
use contactd_proto::control::{Answer, Command};
use contactd_proto::names::{self, Address, PROTOCOL_VERSION};
use contactd_proto::status::StatusRecord;
use contactd_proto::step::ASK_POLLING;
use contactd_proto::{ContactRecord, ErrorCode, PoseRecord, StepReply, StepRequest};
use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::*;
use iceoryx2::request_mut::RequestMut;
use iceoryx2::response::Response;
use std::fmt;
use std::time::{Duration, Instant};

type Loan = RequestMut<Variant, [PoseRecord], StepRequest, [ContactRecord], StepReply>;
type Pending = PendingResponse<Variant, [PoseRecord], StepRequest, [ContactRecord], StepReply>;
type Arrived = Response<Variant, [ContactRecord], StepReply>;

/// Longest wait between two looks at whether the server lives, for a client that polls. Nor is a server looked after whose last answer is no older: that is a system call.
const POLLED: Duration = Duration::from_millis(1);
/// Looks for a reply for each look at the clock.
const LOOKS: u64 = 8;
/// How long a session that is dropped waits until its server has heard of it: a request dies with the port that sent it.
const GOODBYE: Duration = Duration::from_millis(200);

/// The way to a server through shared memory.
pub struct SharedMemory {
    address: Address,
    link: Option<Link>,
}

impl fmt::Debug for SharedMemory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SharedMemory").field("address", &self.address).finish_non_exhaustive()
    }
}

/// Everything that belongs to one session on one incarnation. Fields are dropped in this order.
struct Link {
    reply: Option<Arrived>,
    pending: Option<Pending>,
    loan: Option<Loan>,
    wake: Option<Listener<Variant>>,
    steps: StepClient,
    pages: Pages,
    control: Control,
    session: u64,
    spin: Duration,
    /// The request under way asked the server not to wake this client.
    polling: bool,
    /// When the server was last known to live.
    alive: Instant,
}

impl SharedMemory {
    /// A way to the server at `address`; nothing happens before `open`.
    pub fn new(address: Address) -> Self {
        Self { address, link: None }
    }

    /// What the server at `address` says of itself, whatever version it speaks.
    ///
    /// # Errors
    /// `NoServer`, `Address`, `System`.
    pub fn status(address: &Address) -> Result<StatusRecord, Error> {
        control::shown(address)
    }

    fn link(&mut self) -> Result<&mut Link, Error> {
        self.link.as_mut().ok_or(Error::ServerLost)
    }
}

impl Link {
    fn new(address: &Address) -> Result<Self, Error> {
        Control::with(address, Self::on)
    }

    fn on(control: Control) -> Result<Self, Error> {
        let steps = control
            .node
            .service_builder(&link::service_name(names::STEP_SERVICE)?)
            .request_response::<[PoseRecord], [ContactRecord]>()
            .request_user_header::<StepRequest>()
            .response_user_header::<StepReply>()
            .open()
            .map_err(|e| system(names::STEP_SERVICE, e))?
            .client_builder()
            .initial_max_slice_len(64)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| system("step port", e))?;
        Ok(Self {
            reply: None,
            pending: None,
            loan: None,
            wake: None,
            steps,
            pages: Pages::default(),
            control,
            session: 0,
            spin: Duration::ZERO,
            polling: false,
            alive: Instant::now(),
        })
    }

    fn command(&mut self, command: Command, timeout: Duration) -> Result<Answer, Error> {
        self.control.command(self.session, command, timeout, |time| self.wait(time))
    }

    /// Makes the port on which the server wakes this session's client.
    fn listen(&mut self) -> Result<(), Error> {
        let service = self
            .control
            .node
            .service_builder(&link::service_name(&names::wake_service_of(self.session))?)
            .event()
            .open()
            .map_err(|e| system("the session's wake service", e))?;
        self.wake = Some(service.listener_builder().create().map_err(|e| system("the session's wake port", e))?);
        Ok(())
    }

    /// Blocks until the server calls or the time is over.
    fn wait(&self, time: Duration) {
        let waited = match &self.wake {
            Some(wake) => wake.timed_wait(|_| {}, time).map_err(|_| ()),
            None => Err(()),
        };
        // A wait that failed (a signal may interrupt it) must not become a busy loop.
        if waited.is_err() {
            std::thread::sleep(time.min(Duration::from_millis(1)));
        }
    }
}

impl Transport for SharedMemory {
    fn may_lose_server(&self) -> bool {
        true
    }

    fn open(&mut self) -> Result<Opened, Error> {
        // A server that still lives is told that the old session is over: it counts against the server's limit. Then its link goes
        // before the next one comes: it may hold segments of a predecessor.
        self.leave();
        self.link = None;
        let mut link = Link::new(&self.address)?;
        let pid = std::process::id();
        let process = (pid, names::start_of_process(pid).unwrap_or(0));
        let answer = link.command(Command::Open { version: PROTOCOL_VERSION, process }, Duration::from_secs(10))?;
        let (session, max_batch, spin_ns) = match answer {
            Answer::Opened { session, max_batch, spin_ns } => (session, max_batch, spin_ns),
            Answer::Refused { code, detail, .. } => {
                let code = ErrorCode::of_number(code).unwrap_or(ErrorCode::Internal);
                return Err(Error::Refused { code, index: None, detail });
            }
            other => return Err(Error::System(format!("an unexpected answer to open: {other:?}"))),
        };
        link.session = session;
        link.spin = Duration::from_nanos(spin_ns);
        let epoch = link.control.epoch;
        let listens = link.listen();
        self.link = Some(link);
        if let Err(e) = listens {
            self.leave();
            return Err(e);
        }
        Ok(Opened { session, epoch, max_batch })
    }

    fn command(&mut self, command: Command, timeout: Duration) -> Result<Answer, Error> {
        self.link()?.command(command, timeout)
    }

    fn loan(&mut self, records: usize) -> Result<&mut [PoseRecord], Error> {
        let link = self.link()?;
        (link.reply, link.pending, link.loan) = (None, None, None);
        // iceoryx2 knows no empty slices: the header says how many records count.
        let n = records.max(1);
        link.pages.before(n * size_of::<PoseRecord>())?;
        let slice = link.steps.loan_slice_uninit(n).map_err(|e| system("no memory for a batch", e))?;
        link.pages.claim(slice.payload())?;
        link.loan = Some(slice.write_from_fn(|_| PoseRecord::default()));
        match &mut link.loan {
            Some(slice) => {
                slice.user_header_mut().records = records as u32;
                Ok(&mut slice.payload_mut()[..records])
            }
            None => Ok(&mut []),
        }
    }

    fn loaned(&self) -> &[PoseRecord] {
        let Some(link) = &self.link else { return &[] };
        let (records, header) = match (&link.loan, &link.pending) {
            (Some(loan), _) => (loan.payload(), loan.user_header()),
            (_, Some(pending)) => (pending.payload(), pending.user_header()),
            _ => return &[],
        };
        &records[..(header.records as usize).min(records.len())]
    }

    fn loaned_mut(&mut self) -> &mut [PoseRecord] {
        let Some(loan) = self.link.as_mut().and_then(|link| link.loan.as_mut()) else { return &mut [] };
        let n = loan.user_header().records as usize;
        let records = loan.payload_mut();
        let n = n.min(records.len());
        &mut records[..n]
    }

    fn send(&mut self, request: StepRequest) -> Result<(), Error> {
        let link = self.link()?;
        if link.alive.elapsed() > POLLED && link.control.life.is_over() {
            return Err(Error::ServerLost);
        }
        let Some(mut loan) = link.loan.take() else {
            return Err(Error::Misuse("no step was begun"));
        };
        *loan.user_header_mut() = request;
        link.polling = request.asked & ASK_POLLING != 0;
        link.pending = Some(loan.send().map_err(|e| system("a batch cannot be sent", e))?);
        link.control.wake_server();
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<(), Error> {
        let link = self.link()?;
        let Some(pending) = &link.pending else {
            return Err(Error::Misuse("no step is in flight"));
        };
        let start = Instant::now();
        let mut looked = start;
        let polls = link.polling || !link.spin.is_zero();
        let mut looks = 0_u64;
        loop {
            looks += 1;
            // Looked at before receiving: a reply that came before the end of the connection is then not missed.
            let connected = pending.is_connected();
            match pending.receive() {
                Ok(Some(reply)) => {
                    link.reply = Some(reply);
                    link.alive = looked;
                    return Ok(());
                }
                Ok(None) => {}
                Err(e) => return Err(system("a reply cannot be received", e)),
            }
            if connected && polls && !looks.is_multiple_of(LOOKS) {
                std::hint::spin_loop();
                continue;
            }
            let waited = start.elapsed();
            let spins = waited < link.spin || (link.polling && looked.elapsed() < POLLED && waited < timeout);
            if connected && spins {
                std::hint::spin_loop();
                continue;
            }
            looked = Instant::now();
            if link.control.life.is_over() {
                return Err(Error::ServerLost);
            }
            if !connected {
                return Err(Error::ReplyLost);
            }
            if waited >= timeout {
                return Err(Error::Timeout);
            }
            if !link.polling {
                link.wait((timeout - waited).min(SLICE));
            }
        }
    }

    fn reply(&self) -> Option<(&StepReply, &[ContactRecord])> {
        let reply = self.link.as_ref()?.reply.as_ref()?;
        Some((reply.user_header(), reply.payload()))
    }

    fn leave(&mut self) {
        // Where it does not arrive the server finds that nobody listens.
        if let Some(link) = self.link.as_mut().filter(|link| !link.control.life.is_over()) {
            let _ = link.command(Command::Close, GOODBYE);
        }
    }
}
