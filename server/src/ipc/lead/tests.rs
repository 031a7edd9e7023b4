//! The loop driven by a port of channels: no shared memory, no second process.

use super::super::port::Bell;
use super::*;
use contactd_client::Error;
use contactd_proto::control::{Facets, ModelFile, ObjectSpec};
use contactd_proto::step::{STEP_CONTACT, STEP_REFUSED};
use contactd_proto::{Pose, PoseRecord, StepReply, StepRequest};
use glam::DVec3;
use std::sync::Mutex;

const EPOCH: u64 = 7;
/// Nothing here takes nearly as long.
const LONG: Duration = Duration::from_secs(60);

struct Step {
    request: StepRequest,
    records: Vec<PoseRecord>,
    to: Sender<(StepReply, Vec<ContactRecord>)>,
}

impl StepCall for Step {
    type Reply = (StepReply, Vec<ContactRecord>);

    fn request(&self) -> StepRequest {
        self.request
    }

    fn records(&self) -> &[PoseRecord] {
        &self.records
    }

    fn write(&self, n: usize, reply: StepReply, slot: &dyn Fn(usize) -> ContactRecord) -> Option<Self::Reply> {
        Some((reply, (0..n).map(slot).collect()))
    }

    fn send(self, reply: Option<Self::Reply>) {
        if let Some(reply) = reply {
            let _ = self.to.send(reply);
        }
    }
}

struct Order {
    bytes: Vec<u8>,
    to: Sender<Vec<u8>>,
}

impl CommandCall for Order {
    fn version(&self) -> u32 {
        PROTOCOL_VERSION
    }

    fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn send(self, bytes: &[u8]) {
        let _ = self.to.send(bytes.to_vec());
    }
}

/// What the clients of all sessions and the loop see of each other.
#[derive(Default)]
struct Seen {
    heard: AtomicBool,
    status: Mutex<StatusRecord>,
}

struct Listens(Arc<Seen>);

impl Wake for Listens {
    fn notify(&self) {}

    fn is_heard(&self) -> bool {
        self.0.heard.load(Ordering::Relaxed)
    }
}

impl Bell for Sender<()> {
    fn ring(&self) {
        let _ = self.send(());
    }
}

struct Channels {
    steps: Receiver<Step>,
    commands: Receiver<Order>,
    rings: Receiver<()>,
    seen: Arc<Seen>,
}

impl Port for Channels {
    type Step = Step;
    type Command = Order;
    type Wake = Listens;
    type Bell = Sender<()>;

    fn next_step(&mut self) -> Option<Step> {
        self.steps.try_recv().ok()
    }

    fn next_command(&mut self) -> Option<Order> {
        self.commands.try_recv().ok()
    }

    fn wait(&self, longest: Duration) -> bool {
        self.rings.recv_timeout(longest) != Err(RecvTimeoutError::Disconnected)
    }

    fn wake_of(&self, _: u64) -> Result<Listens, Error> {
        Ok(Listens(self.seen.clone()))
    }

    fn trouble(&self) -> Option<String> {
        None
    }

    fn show(&mut self, status: StatusRecord) {
        *self.seen.status.lock().unwrap() = status;
    }

    fn sweep_dead(&self) {}
}

/// The clients' end of the channels.
struct Clients {
    steps: Sender<Step>,
    commands: Sender<Order>,
    bell: Sender<()>,
    seen: Arc<Seen>,
}

impl Clients {
    fn send(&self, session: u64, command: Command) -> Receiver<Vec<u8>> {
        let epoch = if session == 0 { 0 } else { EPOCH };
        let (to, from) = channel();
        self.commands.send(Order { bytes: encode(&Envelope { epoch, session, command }).unwrap(), to }).unwrap();
        self.bell.ring();
        from
    }

    fn command(&self, session: u64, command: Command) -> Answer {
        decode(&self.send(session, command).recv_timeout(LONG).expect("an answer")).unwrap()
    }

    fn open(&self) -> u64 {
        match self.command(0, Command::Open { version: PROTOCOL_VERSION, process: (0, 0) }) {
            Answer::Opened { session, .. } => session,
            other => panic!("{other:?}"),
        }
    }

    fn load(&self, session: u64, text: String) -> Receiver<Vec<u8>> {
        let file = ModelFile::new("m.csg", "", text);
        self.send(session, Command::LoadModel { model: 1, file, facets: Facets::Auto })
    }

    fn step(&self, session: u64, epoch: u64, records: Vec<PoseRecord>) -> (StepReply, Vec<ContactRecord>) {
        let (version, advance, n) = (PROTOCOL_VERSION, 1.0, records.len() as u32);
        let request = StepRequest { version, session, epoch, step: 3, advance, records: n, ..StepRequest::default() };
        let (to, from) = channel();
        self.steps.send(Step { request, records, to }).unwrap();
        self.bell.ring();
        from.recv_timeout(LONG).expect("a reply")
    }

    /// Two balls of radius 1, four apart; the second one moves.
    fn balls(&self) -> u64 {
        let session = self.open();
        let loaded = self.load(session, "sphere($fn = 0, r = 1);".into()).recv_timeout(LONG).expect("an answer");
        assert!(matches!(decode(&loaded), Ok(Answer::Loaded { .. })));
        for (id, x) in [(1, 0.0), (2, 4.0)] {
            let spec = ObjectSpec {
                id,
                model: 1,
                name: id.to_string(),
                group: "default".into(),
                is_static: id == 1,
                rotates: true,
                max_speed: f64::INFINITY,
                place: Pose::IDENTITY.into(),
                pose: Pose::at(DVec3::X * x).into(),
            };
            assert_eq!(self.command(session, Command::AddObject(spec)), Answer::Done);
        }
        session
    }
}

/// A server for as long as `clients` takes.
fn serve(clients: impl FnOnce(&Clients)) {
    let ((steps, at_steps), (commands, at_commands), (bell, rings)) = (channel(), channel(), channel());
    let seen = Arc::new(Seen { heard: true.into(), ..Seen::default() });
    let port = Channels { steps: at_steps, commands: at_commands, rings, seen: seen.clone() };
    let lead = Box::new(Lead::new(ServerConfig::default(), EPOCH, port, bell.clone()));
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let server = scope.spawn(|| run(lead, &stop));
        // Set whatever the clients find, so that a failed assertion does not wait for the server for ever.
        struct Stop<'a>(&'a AtomicBool);
        impl Drop for Stop<'_> {
            fn drop(&mut self) {
                self.0.store(true, Ordering::Relaxed);
            }
        }
        let end = Stop(&stop);
        clients(&Clients { steps, commands, bell, seen });
        drop(end);
        let lead = server.join().unwrap().expect("the last leader leaves what it holds");
        assert_eq!(lead.away, 0, "scenes that no step has");
    });
}

#[test]
fn a_session_is_served_by_a_port_that_is_no_shared_memory() {
    serve(|clients| {
        let session = clients.balls();
        let to = |x| vec![PoseRecord::end(2, &Pose::at(DVec3::X * x))];
        let (reply, slots) = clients.step(session, EPOCH, to(0.0));
        assert_eq!((reply.status, reply.records, reply.step, reply.epoch), (STEP_CONTACT, 1, 3, EPOCH));
        // 4 - 4 t = 2, within a billionth of the radius.
        assert!((slots[0].time - 0.5).abs() < 1e-8, "{}", slots[0].time);
        for (session, epoch) in [(session + 1, EPOCH), (session, EPOCH - 1)] {
            let (reply, slots) = clients.step(session, epoch, to(1.0));
            assert_eq!((reply.status, reply.error), (STEP_REFUSED, ErrorCode::SessionGone.number()));
            assert!(slots.is_empty());
        }
        let shown = || clients.seen.status.lock().unwrap().sessions;
        assert_eq!(shown(), 1);
        // A client that no longer listens has left.
        clients.seen.heard.store(false, Ordering::Relaxed);
        let until = Instant::now() + LONG;
        while shown() > 0 {
            assert!(Instant::now() < until, "a session outlives its client");
            std::thread::sleep(BEAT);
        }
        assert_eq!(clients.step(session, EPOCH, to(1.0)).0.error, ErrorCode::SessionGone.number());
    });
}

#[test]
fn a_session_whose_model_is_being_imported_is_busy_and_no_other_is() {
    serve(|clients| {
        let (other, session) = (clients.balls(), clients.open());
        let sphere = |i: u32| {
            let (x, y) = (i % 150, i / 150);
            format!("multmatrix([[1,0,0,{x}],[0,1,0,{y}],[0,0,1,0],[0,0,0,1]]) {{ sphere($fn = 0, r = 0.7); }}\n")
        };
        let many: String = (0..20_000).map(sphere).collect();
        let _answer_nobody_waits_for = clients.load(session, format!("union() {{ {many} }}"));
        match clients.command(session, Command::RemoveObject(1)) {
            Answer::Refused { code, .. } => assert_eq!(code, ErrorCode::Busy.number()),
            other => panic!("{other:?}"),
        }
        assert_eq!(clients.step(session, EPOCH, vec![]).0.error, ErrorCode::Busy.number());
        let (reply, _) = clients.step(other, EPOCH, vec![PoseRecord::end(2, &Pose::at(DVec3::X * 3.0))]);
        assert_eq!((reply.error, reply.records), (0, 0));
    });
}

/// A step delays other sessions for a period or two at most, commands for some more; and where a core is wanted by a client or by a
/// step that has lost the lead, the loop does not poll on it.
#[test]
fn who_else_is_there_decides_how_long_the_loop_is_held_up_and_polls() {
    let ((_steps, at_steps), (_commands, at_commands), (bell, rings)) = (channel(), channel(), channel());
    let port = Channels { steps: at_steps, commands: at_commands, rings, seen: Arc::default() };
    let mut lead = Lead::new(ServerConfig::default(), EPOCH, port, bell);
    lead.cores = 3;
    let polls = Duration::from_micros(lead.config.spin_us);
    assert_eq!((lead.patience(), lead.spin()), (PATIENCE_ALONE, polls));
    let open = |lead: &mut Lead<Channels>| lead.open(PROTOCOL_VERSION, (0, 0)).expect("a session");
    open(&mut lead);
    assert_eq!((lead.patience(), lead.spin()), (PATIENCE_ALONE, polls));
    open(&mut lead);
    assert_eq!((lead.patience(), lead.spin()), (PATIENCE, polls));
    lead.away = 1;
    assert_eq!(lead.spin(), Duration::ZERO);
    lead.cores = 4;
    assert_eq!(lead.spin(), polls);
}
