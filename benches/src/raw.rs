//! A peer of the step service: request and response of the same records and headers over iceoryx2, and no engine.
//!
//! The services are set up as contactd sets up its own. It does what the least code does: no session, no check, no watch
//! on the other side's life.

use contactd_client::Error;
use contactd_client::shm::link::{self, StepClient, Variant, system};
use contactd_proto::names::Address;
use contactd_proto::{ContactRecord, PoseRecord, StepReply, StepRequest};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Clients at a time.
pub const CLIENTS: usize = 4;
/// Any number will do: the address is this peer's alone.
const EPOCH: u64 = 1 << 20;

/// How both sides wait.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waiting {
    /// Poll for so long, then block.
    pub spin: Duration,
    /// Nobody wakes anybody: an idle side looks every millisecond.
    pub polled: bool,
}

impl Waiting {
    /// One turn of waiting since `from`; `block` blocks for at most the given time.
    pub fn turn(&self, from: Instant, block: impl FnOnce(Duration)) {
        if from.elapsed() < self.spin {
            std::hint::spin_loop();
        } else if self.polled {
            std::thread::sleep(Duration::from_millis(1));
        } else {
            block(Duration::from_millis(50));
        }
    }
}

/// The answering side.
pub struct RawServer {
    steps: Server<Variant, [PoseRecord], StepRequest, [ContactRecord], StepReply>,
    wake: Listener<Variant>,
    back: Vec<Notifier<Variant>>,
    _node: Node<Variant>,
}

impl RawServer {
    /// Creates the services.
    ///
    /// # Errors
    /// Shared memory fails.
    pub fn new(address: &Address) -> Result<Self, Error> {
        let node = link::node(&link::config(address, EPOCH)?)?;
        let steps = node
            .service_builder(&link::service_name("raw/step")?)
            .request_response::<[PoseRecord], [ContactRecord]>()
            .request_user_header::<StepRequest>()
            .response_user_header::<StepReply>()
            .max_clients(CLIENTS)
            .max_nodes(CLIENTS + 1)
            .max_servers(1)
            .max_active_requests_per_client(2)
            .max_loaned_requests(2)
            .max_response_buffer_size(2)
            .max_borrowed_responses_per_pending_response(2)
            .enable_safe_overflow_for_requests(false)
            .enable_safe_overflow_for_responses(false)
            .enable_fire_and_forget_requests(false)
            .create()
            .map_err(|e| system("raw/step", e))?
            .server_builder()
            .initial_max_slice_len(64)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .max_loaned_responses_per_request(1)
            .override_response_preallocation(|n| n.min(3 * CLIENTS))
            .create()
            .map_err(|e| system("raw port", e))?;
        let event = |name: &str| {
            let name = link::service_name(name)?;
            let builder = node.service_builder(&name).event().max_nodes(CLIENTS + 1).max_notifiers(CLIENTS);
            builder.create().map_err(|e| system("a raw event", e))
        };
        let wake = event("raw/wake")?.listener_builder().create().map_err(|e| system("raw wake", e))?;
        let back = (0..CLIENTS).map(|k| {
            let service = event(&format!("raw/back/{k}"))?;
            service.notifier_builder().create().map_err(|e| system("raw back", e))
        });
        let back = back.collect::<Result<_, _>>()?;
        Ok(Self { steps, wake, back, _node: node })
    }

    /// Answers until `stop` is set.
    pub fn run(&self, waiting: Waiting, stop: &AtomicBool) {
        let mut last = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            match self.steps.receive() {
                Ok(Some(call)) => {
                    let request = *call.user_header();
                    if let Ok(loan) = call.loan_slice_uninit(1) {
                        let mut response = loan.write_from_fn(|_| ContactRecord::default());
                        *response.user_header_mut() = StepReply { step: request.step, ..StepReply::default() };
                        let _ = response.send();
                    }
                    drop(call);
                    if let (false, Some(back)) = (waiting.polled, self.back.get(request.session as usize)) {
                        let _ = back.notify();
                    }
                    last = Instant::now();
                }
                _ => waiting.turn(last, |most| {
                    let _ = self.wake.timed_wait(|_| {}, most);
                }),
            }
        }
    }
}

/// The asking side.
pub struct RawClient {
    steps: StepClient,
    server: Notifier<Variant>,
    wake: Listener<Variant>,
    waiting: Waiting,
    number: u64,
    step: u64,
    _node: Node<Variant>,
}

impl RawClient {
    /// Client `number`, below [`CLIENTS`].
    ///
    /// # Errors
    /// Shared memory fails.
    pub fn new(address: &Address, number: usize, waiting: Waiting) -> Result<Self, Error> {
        let node = link::node(&link::config(address, EPOCH)?)?;
        let steps = node
            .service_builder(&link::service_name("raw/step")?)
            .request_response::<[PoseRecord], [ContactRecord]>()
            .request_user_header::<StepRequest>()
            .response_user_header::<StepReply>()
            .open()
            .map_err(|e| system("raw/step", e))?
            .client_builder()
            .initial_max_slice_len(64)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| system("raw port", e))?;
        let event = |name: &str| {
            let name = link::service_name(name)?;
            node.service_builder(&name).event().open().map_err(|e| system("a raw event", e))
        };
        let server = event("raw/wake")?.notifier_builder().create().map_err(|e| system("raw wake", e))?;
        let wake = event(&format!("raw/back/{number}"))?;
        let wake = wake.listener_builder().create().map_err(|e| system("raw back", e))?;
        Ok(Self { steps, server, wake, waiting, number: number as u64, step: 0, _node: node })
    }

    /// Sends the records and waits for the reply.
    ///
    /// # Errors
    /// Shared memory fails, or no reply comes within ten seconds.
    pub fn step(&mut self, poses: &[PoseRecord]) -> Result<(), Error> {
        self.step += 1;
        let loan = self.steps.loan_slice(poses.len().max(1)).map_err(|e| system("raw loan", e))?;
        let mut loan = loan;
        loan.payload_mut()[..poses.len()].copy_from_slice(poses);
        *loan.user_header_mut() = StepRequest { step: self.step, session: self.number, ..StepRequest::default() };
        let pending = loan.send().map_err(|e| system("raw send", e))?;
        if !self.waiting.polled {
            let _ = self.server.notify();
        }
        let from = Instant::now();
        loop {
            if let Some(reply) = pending.receive().map_err(|e| system("raw receive", e))? {
                assert_eq!(reply.user_header().step, self.step, "the reply is of this request");
                return Ok(());
            }
            if from.elapsed() > Duration::from_secs(10) {
                return Err(Error::Timeout);
            }
            if self.waiting.polled {
                std::hint::spin_loop();
            } else {
                self.waiting.turn(from, |most| {
                    let _ = self.wake.timed_wait(|_| {}, most);
                });
            }
        }
    }
}
