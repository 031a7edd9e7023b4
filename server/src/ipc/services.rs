//! The services of an incarnation, all created here: clients only open them, so a client that is killed while it comes
//! can leave none half-made.
//!
//! Limits are set at creation, by the creator. Overflow is off everywhere: a request that does not fit is refused to its
//! sender, a reply that cannot be delivered is dropped and its client told so, and nobody waits for anybody.

use super::config::ServerConfig;
use super::port::{Bell, CommandCall, Port, StepCall, Wake};
use contactd_client::Error;
use contactd_client::shm::link::{self, ControlServer, Shared, StepServer, system};
use contactd_client::shm::pages::{self, Pages};
use contactd_proto::control::ControlHeader;
use contactd_proto::names::{self, Address, PROTOCOL_VERSION};
use contactd_proto::status::StatusRecord;
use contactd_proto::{ContactRecord, PoseRecord, StepReply, StepRequest};
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::writer::{EntryHandleMut, Writer};
use iceoryx2::prelude::*;
use iceoryx2::response_mut::ResponseMut;
use iceoryx2::response_mut_uninit::ResponseMutUninit;
use iceoryx2::service::port_factory::event::PortFactory as EventService;
use std::mem::MaybeUninit;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// The way to wake the client of a session.
pub struct ClientWake {
    notifier: Notifier<Shared>,
    service: EventService<Shared>,
}

impl Wake for ClientWake {
    fn notify(&self) {
        // A client that cannot be woken is dead, gone or full of wake-ups: either shows elsewhere.
        let _ = self.notifier.notify();
    }

    fn is_heard(&self) -> bool {
        self.service.dynamic_config().number_of_listeners() > 0
    }
}

impl Bell for Notifier<Shared> {
    fn ring(&self) {
        let _ = self.notify();
    }
}

type StepRequestInPlace = ActiveRequest<Shared, [PoseRecord], StepRequest, [ContactRecord], StepReply>;
type CommandInPlace = ActiveRequest<Shared, [u8], ControlHeader, [u8], ControlHeader>;

/// The memory that replies of one port are written to.
#[derive(Default)]
struct Replies {
    pages: Pages,
    /// Why a reply was lost, until it is asked for.
    trouble: Mutex<Option<String>>,
}

impl Replies {
    /// What was lent, where it can be written to.
    fn keep<T>(&self, lent: Result<T, Error>) -> Option<T> {
        lent.map_err(|e| *self.trouble.lock().unwrap_or_else(PoisonError::into_inner) = Some(e.to_string())).ok()
    }

    fn trouble(&self) -> Option<String> {
        self.trouble.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// A request for a step, in place.
pub struct StepInPlace {
    request: StepRequestInPlace,
    replies: Arc<Replies>,
}

impl StepInPlace {
    fn lend(&self, n: usize) -> Result<ResponseMutUninit<Shared, [MaybeUninit<ContactRecord>], StepReply>, Error> {
        self.replies.pages.before(n * size_of::<ContactRecord>())?;
        let loan = self.request.loan_slice_uninit(n).map_err(|e| system("no memory for records", e))?;
        self.replies.pages.claim(loan.payload())?;
        Ok(loan)
    }
}

impl StepCall for StepInPlace {
    type Reply = ResponseMut<Shared, [ContactRecord], StepReply>;

    fn request(&self) -> StepRequest {
        *self.request.user_header()
    }

    fn records(&self) -> &[PoseRecord] {
        self.request.payload()
    }

    /// Writes the reply once, into slots of shared memory.
    fn write(&self, n: usize, reply: StepReply, slot: &dyn Fn(usize) -> ContactRecord) -> Option<Self::Reply> {
        // iceoryx2 knows no empty slices: the header says how many slots count.
        let loan = self.replies.keep(self.lend(n.max(1)))?;
        let reported = (reply.records + reply.slots) as usize;
        let mut response = loan.write_from_fn(|i| if i < reported { slot(i) } else { ContactRecord::default() });
        *response.user_header_mut() = reply;
        Some(response)
    }

    fn send(self, reply: Option<Self::Reply>) {
        // A reply that cannot be delivered is dropped; the end of the call tells the client.
        let _ = reply.map(ResponseMut::send);
    }
}

/// A request with a command, in place.
pub struct CommandCallInPlace {
    request: CommandInPlace,
    replies: Arc<Replies>,
}

impl CommandCallInPlace {
    fn lend(&self, n: usize) -> Result<ResponseMutUninit<Shared, [MaybeUninit<u8>], ControlHeader>, Error> {
        self.replies.pages.before(n)?;
        let loan = self.request.loan_slice_uninit(n).map_err(|e| system("no memory for an answer", e))?;
        self.replies.pages.claim(loan.payload())?;
        Ok(loan)
    }
}

impl CommandCall for CommandCallInPlace {
    fn version(&self) -> u32 {
        self.request.user_header().version
    }

    fn bytes(&self) -> &[u8] {
        self.request.payload()
    }

    fn send(self, bytes: &[u8]) {
        let Some(loan) = self.replies.keep(self.lend(bytes.len())) else { return };
        let mut response = loan.write_from_slice(bytes);
        *response.user_header_mut() = ControlHeader { version: PROTOCOL_VERSION, reserved: 0 };
        let _ = response.send();
    }
}

/// How often what the system refuses is tried again, and after how long.
const AGAIN: usize = 3;
const PAUSE: Duration = Duration::from_millis(50);

/// A machine that is short of something for a moment keeps nobody from being served: what fails is tried again.
fn patiently<T>(make: impl Fn() -> Result<T, Error>) -> Result<T, Error> {
    for _ in 0..AGAIN {
        if let Ok(made) = make() {
            return Ok(made);
        }
        std::thread::sleep(PAUSE);
    }
    make()
}

/// The server's ports. Dropped in this order.
pub struct Services {
    steps: StepServer,
    control: ControlServer,
    /// Of steps, and of commands.
    replies: [Arc<Replies>; 2],
    /// Woken by clients, and by the bell.
    wake: Listener<Shared>,
    status: EntryHandleMut<Shared, u32, StatusRecord>,
    _writer: Writer<Shared, u32>,
    node: Node<Shared>,
}

impl Services {
    /// Creates them; and a bell that wakes the server itself: what other threads have done is to be taken.
    ///
    /// # Errors
    /// `System`.
    pub fn create(
        address: &Address,
        epoch: u64,
        config: &ServerConfig,
        status: StatusRecord,
    ) -> Result<(Self, Notifier<Shared>), Error> {
        patiently(|| Self::create_once(address, epoch, config, status))
    }

    fn create_once(
        address: &Address,
        epoch: u64,
        config: &ServerConfig,
        status: StatusRecord,
    ) -> Result<(Self, Notifier<Shared>), Error> {
        pages::room(0)?;
        let node = link::node_of::<Shared>(&link::config(address, epoch)?)?;
        // A few more than sessions: clients that are just coming or going, and those that only look at the status.
        let clients = config.sessions + 8;
        let (steps, control) = (step_port(&node, clients)?, control_port(&node, clients)?);
        let wakes = node
            .service_builder(&link::service_name(names::WAKE_SERVICE)?)
            .event()
            .max_notifiers(clients + 1)
            .max_listeners(1)
            .max_nodes(clients + 1)
            .create()
            .map_err(|e| system(names::WAKE_SERVICE, e))?;
        let wake = wakes.listener_builder().create().map_err(|e| system("wake port", e))?;
        let bell = wakes.notifier_builder().create().map_err(|e| system("bell port", e))?;
        let writer = node
            .service_builder(&link::service_name(names::STATUS_SERVICE)?)
            .blackboard_creator::<u32>()
            .max_readers(clients)
            .max_nodes(clients + 1)
            .add::<StatusRecord>(link::STATUS_KEY, status)
            .create()
            .map_err(|e| system(names::STATUS_SERVICE, e))?
            .writer_builder()
            .create()
            .map_err(|e| system("status writer", e))?;
        let status = writer.entry::<StatusRecord>(&link::STATUS_KEY).map_err(|e| system("status entry", e))?;
        let services = Self { steps, control, replies: Default::default(), wake, status, _writer: writer, node };
        Ok((services, bell))
    }
}

/// The service of steps, for so many clients.
fn step_port(node: &Node<Shared>, clients: usize) -> Result<StepServer, Error> {
    node.service_builder(&link::service_name(names::STEP_SERVICE)?)
        .request_response::<[PoseRecord], [ContactRecord]>()
        .request_user_header::<StepRequest>()
        .response_user_header::<StepReply>()
        .max_clients(clients)
        .max_nodes(clients + 1)
        .max_servers(1)
        .max_active_requests_per_client(2)
        .max_loaned_requests(2)
        .max_response_buffer_size(2)
        .max_borrowed_responses_per_pending_response(2)
        .enable_safe_overflow_for_requests(false)
        .enable_safe_overflow_for_responses(false)
        .enable_fire_and_forget_requests(false)
        .create()
        .map_err(|e| system(names::STEP_SERVICE, e))?
        .server_builder()
        .initial_max_slice_len(64)
        .allocation_strategy(AllocationStrategy::PowerOfTwo)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .max_loaned_responses_per_request(1)
        // Each client holds one reply and may be getting the next: the worst case of every buffer full cannot occur.
        .override_response_preallocation(move |n| n.min(3 * clients))
        .create()
        .map_err(|e| system("step port", e))
}

/// The service of commands, for so many clients.
fn control_port(node: &Node<Shared>, clients: usize) -> Result<ControlServer, Error> {
    node.service_builder(&link::service_name(names::CONTROL_SERVICE)?)
        .request_response::<[u8], [u8]>()
        .request_user_header::<ControlHeader>()
        .response_user_header::<ControlHeader>()
        .max_clients(clients)
        .max_nodes(clients + 1)
        .max_servers(1)
        .max_active_requests_per_client(2)
        .max_loaned_requests(2)
        .max_response_buffer_size(2)
        .max_borrowed_responses_per_pending_response(2)
        .enable_safe_overflow_for_requests(false)
        .enable_safe_overflow_for_responses(false)
        .enable_fire_and_forget_requests(false)
        .create()
        .map_err(|e| system(names::CONTROL_SERVICE, e))?
        .server_builder()
        .initial_max_slice_len(4096)
        .allocation_strategy(AllocationStrategy::PowerOfTwo)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .max_loaned_responses_per_request(1)
        .override_response_preallocation(move |n| n.min(3 * clients))
        .create()
        .map_err(|e| system("control port", e))
}

impl Port for Services {
    type Step = StepInPlace;
    type Command = CommandCallInPlace;
    type Wake = ClientWake;
    type Bell = Notifier<Shared>;

    fn next_step(&mut self) -> Option<Self::Step> {
        // A failed receive concerns one client's connection; the others go on.
        let request = self.steps.receive().ok().flatten()?;
        Some(StepInPlace { request, replies: self.replies[0].clone() })
    }

    fn next_command(&mut self) -> Option<Self::Command> {
        let request = self.control.receive().ok().flatten()?;
        Some(CommandCallInPlace { request, replies: self.replies[1].clone() })
    }

    fn wait(&self, longest: Duration) -> bool {
        self.wake.timed_wait(|_| {}, longest).is_ok()
    }

    /// Its service is created here.
    fn wake_of(&self, session: u64) -> Result<ClientWake, Error> {
        pages::room(0)?;
        patiently(|| {
            let service = self
                .node
                .service_builder(&link::service_name(&names::wake_service_of(session))?)
                .event()
                .max_notifiers(1)
                .max_listeners(1)
                .max_nodes(2)
                .create()
                .map_err(|e| system("a session's wake service", e))?;
            let notifier = service.notifier_builder().create().map_err(|e| system("a session's wake port", e))?;
            Ok(ClientWake { notifier, service })
        })
    }

    fn trouble(&self) -> Option<String> {
        self.replies.iter().find_map(|replies| replies.trouble())
    }

    fn show(&mut self, status: StatusRecord) {
        self.status.update_with_copy(status);
    }

    fn sweep_dead(&self) {
        self.node.try_cleanup_dead_nodes();
    }
}
