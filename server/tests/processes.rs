//! A server and its clients as processes of their own: the same bits as embedded, death on either side, bad input. `operator.rs` looks at
//! what an operator sees and does, `metrics.rs` at numbers, `service.rs` at a service manager.

#[allow(dead_code, reason = "other tests use the rest of it")]
mod harness;
#[path = "processes/memory.rs"]
mod memory;
#[path = "processes/operator.rs"]
mod operator;

use contactd::ipc::ServerConfig;
use contactd_client::proto::control::{Answer, Command, encode};
use contactd_client::proto::motion::quat_of_rotation_vector;
use contactd_client::proto::names::{self, Address};
use contactd_client::proto::query::{ObjectRay, PointOptions, QueryAnswer, RayOptions, RayOutcome, Side};
use contactd_client::proto::status::StatusRecord;
use contactd_client::proto::step::{ASK_ALL, STEP_REFUSED};
use contactd_client::proto::{Detect, ErrorCode, InitialOverlap, Pose, PoseRecord, Report, Rule, StepRequest};
use contactd_client::{Error, Frame, MassOptions, Object, Session, SharedMemory, Transport};
use glam::DVec3;
use harness::scene::{Bits, bits, build, fill, numbers, set_options, spheres};
use harness::{PATIENCE, ServerProcess, serve_command};
use std::os::unix::fs::MetadataExt as _;
use std::process::{Child, Command as Process, Stdio};
use std::time::{Duration, Instant};

const PEGS: u32 = 3;

/// One step of the scene.
fn step<T: Transport>(session: &mut Session<T>, ids: &[u32], k: u64, seed: u64) -> Result<Bits, Error> {
    set_options(session, k);
    fill(session.begin_step(ids.len())?, ids, k, seed);
    session.finish(PATIENCE).map(|reply| bits(&reply))
}

/// Runs this very program as a client process: only the test called `a_client_process`, with its arguments in variables.
fn client(server: &ServerProcess, steps: u64, seed: u64) -> Child {
    Process::new(std::env::current_exe().unwrap())
        .args(["--exact", "a_client_process", "--nocapture", "--test-threads=1"])
        .env("CONTACTD_TEST_CLIENT", format!("{} {steps} {seed}", server.address.name()))
        .env("XDG_RUNTIME_DIR", server.runtime())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap()
}

/// The body of a client process; without its variable it is a test that an absent server is told as such.
#[test]
fn a_client_process() {
    let Ok(arguments) = std::env::var("CONTACTD_TEST_CLIENT") else {
        let dir = harness::runtime_folder();
        let error = Session::connect_to(Address::under(dir.path(), "nobody").unwrap()).unwrap_err();
        assert_eq!(error, Error::NoServer("nobody".into()));
        assert!(error.to_string().contains("contactd serve --name nobody"), "{error}");
        return;
    };
    let words: Vec<&str> = arguments.split(' ').collect();
    let (steps, seed): (u64, u64) = (words[1].parse().unwrap(), words[2].parse().unwrap());
    let mut session = Session::connect(words[0]).unwrap();
    let mut own = contactd::embedded(&ServerConfig::default()).unwrap();
    let (ids, own_ids) = (build(&mut session, PEGS), build(&mut own, PEGS));
    assert_eq!(ids, own_ids);
    let (mut contacts, mut records) = (0, 0);
    for k in 0..steps {
        let answer = step(&mut session, &ids, k, seed).unwrap();
        assert_eq!(answer, step(&mut own, &ids, k, seed).unwrap(), "step {k}");
        contacts += u64::from(answer.0 == 2);
        records += u64::from(answer.1);
    }
    session.close().unwrap();
    println!("client done: {steps} steps, {contacts} with contact, {records} records");
}

fn output(child: Child) -> String {
    let output = child.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{text}");
    text
}

#[test]
fn two_clients_get_the_embedded_bits_for_a_thousand_steps_and_nothing_is_left() {
    let mut server = ServerProcess::start("twins", "");
    let clients = [client(&server, 1000, 1), client(&server, 1000, 2)];
    for text in clients.map(output) {
        let (_, line) = text.split_once("client done: ").expect("a client that is done");
        let contacts: u64 = line.split(' ').nth(2).unwrap().parse().unwrap();
        assert!(line.contains("1000 steps") && contacts > 200, "{line}");
    }
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new());
}

#[test]
fn a_killed_server_is_noticed_and_its_successor_continues_bit_for_bit() {
    let mut server = ServerProcess::start("phoenix", "");
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let mut own = contactd::embedded(&ServerConfig::default()).unwrap();
    let ids = build(&mut session, PEGS);
    build(&mut own, PEGS);
    let mut fastest = Duration::MAX;
    for k in 0..90 {
        if k % 30 == 19 {
            // Stopped first, so that the step is in flight when it dies.
            server.freeze();
            set_options(&mut session, k);
            fill(session.begin_step(ids.len()).unwrap(), &ids, k, 7);
            session.send().unwrap();
            let killed = Instant::now();
            server.kill();
            assert_eq!(session.finish(PATIENCE).map(|r| bits(&r)), Err(Error::ServerLost));
            fastest = fastest.min(killed.elapsed());
            assert_eq!(session.begin_step(1).map(|_| ()), Err(Error::ServerLost));
            assert!(matches!(session.reconnect(Duration::ZERO), Err(Error::NoServer(_))));
            server.restart();
            session.reconnect(PATIENCE).unwrap();
            session.resend().unwrap();
            let answer = session.finish(PATIENCE).map(|r| bits(&r)).unwrap();
            assert_eq!(answer, step(&mut own, &ids, k, 7).unwrap(), "the step in flight, sent again");
            continue;
        }
        assert_eq!(step(&mut session, &ids, k, 7).unwrap(), step(&mut own, &ids, k, 7).unwrap(), "step {k}");
    }
    // The contract's second, by the fastest of three: the machine may be busy with other things.
    assert!(fastest < Duration::from_secs(1), "noticed after {fastest:?}");
    drop(session);
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new());
}

/// Objects get other frames, a part goes with another body and is put down again, some pair is allowed: after each the server may die,
/// and its successor goes on as if it had not.
#[test]
fn a_successor_knows_frames_parts_and_allowed_pairs() {
    let mut server = ServerProcess::start("frames", "");
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let mut own = contactd::embedded(&ServerConfig::default()).unwrap();
    let texts = [
        "cube(size = [4, 4, 0.2], center = true);",
        "cube(size = [1, 0.4, 0.3], center = true);",
        "sphere($fn = 0, r = 0.3);",
    ];
    fn scene<T: Transport>(session: &mut Session<T>, texts: [&str; 3]) -> Vec<u32> {
        let places = [("plate", DVec3::ZERO), ("bar", DVec3::Z * 1.5), ("ball", DVec3::new(0.9, 0.0, 1.5))];
        let add = |(text, (name, place)): (&str, (&str, DVec3))| {
            let model = session.load_model("thing.csg", text).unwrap().id;
            session.add_object(Object::new(name, model).at(Pose::at(place))).unwrap()
        };
        texts.into_iter().zip(places).map(add).collect()
    }
    let ids = scene(&mut session, texts);
    assert_eq!(ids, scene(&mut own, texts));
    let mut n = numbers(5);
    let mut vector = move || DVec3::new(n() * 2.0 - 1.0, n() * 2.0 - 1.0, n() * 2.0 - 1.0);
    let (mut met, mut answers) = (0, 0);
    let mut frame = Frame { object: ids[1], place: Pose::IDENTITY, pose: Pose::IDENTITY };
    for round in 0..24 {
        if round % 4 == 0 {
            let place = Pose::new(vector(), quat_of_rotation_vector(vector() * 2.0));
            let at = Pose::new(DVec3::Z * 1.2 + vector() * 0.2, quat_of_rotation_vector(vector()));
            frame = Frame { place, pose: at.compose(&place.inverse()), ..frame };
        }
        // Put down where it was taken along to.
        fn change<T: Transport>(session: &mut Session<T>, ids: &[u32], frame: Frame, round: u32) {
            match round % 4 {
                0 => session.reframe(&[frame]).unwrap(),
                1 => session.attach(ids[2], ids[1], &[]).unwrap(),
                2 => session.allow(&[[ids[0], ids[1]]], round % 8 == 2).unwrap(),
                _ => session.detach(ids[2]).unwrap(),
            }
        }
        change(&mut session, &ids, frame, round);
        change(&mut own, &ids, frame, round);
        if round % 3 < 2 {
            server.kill();
            server.restart();
            session.reconnect(PATIENCE).unwrap();
        }
        let (to, turn) = (frame.pose.position + DVec3::Z * -1.5 + vector() * 0.2, vector());
        let record = PoseRecord::turn(ids[1], to, turn);
        let back = PoseRecord::start(ids[1], &frame.pose);
        for record in [record, back] {
            let ask = |slots: &mut [PoseRecord]| slots[0] = record;
            ask(session.begin_step(1).unwrap());
            ask(own.begin_step(1).unwrap());
            let answer = session.finish(PATIENCE).map(|reply| (bits(&reply), reply.records().len())).unwrap();
            assert_eq!(answer.0, own.finish(PATIENCE).map(|reply| bits(&reply)).unwrap(), "round {round}");
            met += usize::from(answer.1 > 0);
            answers += 1;
        }
    }
    assert!(10 * met > answers, "{met} of {answers} steps meet");
    drop(session);
    assert!(server.stop().success());
}

#[test]
fn a_killed_client_loses_its_session_and_a_stopped_server_is_reported() {
    let mut server = ServerProcess::start("widow", "");
    let mut survivor = Session::connect_to(server.address.clone()).unwrap();
    let ids = build(&mut survivor, 1);
    let mut victim = client(&server, 1_000_000, 3);
    // What the server shows of itself follows its beat.
    let shows = |what: &dyn Fn(&StatusRecord) -> bool| {
        let until = Instant::now() + PATIENCE;
        while !what(&SharedMemory::status(&server.address).unwrap()) {
            assert!(Instant::now() < until, "the status never came to what it should be");
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    let sessions = |n: u64| shows(&|s| s.sessions == n);
    sessions(2);
    // Sessions that are dropped and never closed: idle, with poses begun, with a step in flight, with a reply.
    for stage in 0..4 {
        let mut dropped = Session::connect_to(server.address.clone()).unwrap();
        let ids = build(&mut dropped, 1);
        sessions(3);
        if stage > 0 {
            dropped.begin_step(1).unwrap()[0] = PoseRecord::end(ids[0], &Pose::IDENTITY);
        }
        match stage {
            2 => dropped.send().unwrap(),
            3 => drop(dropped.finish(PATIENCE).unwrap()),
            _ => {}
        }
        drop(dropped);
        sessions(2);
    }
    victim.kill().unwrap();
    victim.wait().unwrap();
    sessions(1);
    for k in 1..12 {
        step(&mut survivor, &ids, k, 1).unwrap();
    }
    let status = SharedMemory::status(&server.address).unwrap();
    assert_eq!(
        (status.version_min, status.version_max, status.iceoryx2),
        (names::PROTOCOL_VERSION, names::PROTOCOL_VERSION, [0, 10, 0])
    );
    shows(&|s| s.steps > 0 && s.effects.continuous > 0);
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new(), "a client that still lives holds nothing by name");
    assert_eq!(step(&mut survivor, &ids, 2, 1), Err(Error::ServerLost));
}

#[test]
fn a_session_that_reconnects_to_a_server_that_lives_takes_no_second_place() {
    let mut server = ServerProcess::start("again", "sessions = 2\n");
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let _other = Session::connect_to(server.address.clone()).unwrap();
    let ids = build(&mut session, 1);
    for k in 0..4 {
        step(&mut session, &ids, k, 1).unwrap();
        session.reconnect(PATIENCE).unwrap();
        assert_eq!(SharedMemory::status(&server.address).unwrap().sessions, 2);
    }
    // With a step in flight on a server that is busy: the goodbye is not heard, and its place is found to be free.
    for k in 4..7 {
        server.freeze();
        set_options(&mut session, k);
        fill(session.begin_step(ids.len()).unwrap(), &ids, k, 1);
        session.send().unwrap();
        let pid = server.pid();
        let goes_on = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(400));
            rustix::process::kill_process(pid, rustix::process::Signal::CONT).unwrap();
        });
        session.reconnect(PATIENCE).unwrap();
        goes_on.join().unwrap();
        assert_eq!(SharedMemory::status(&server.address).unwrap().sessions, 2);
        session.resend().unwrap();
        session.finish(PATIENCE).unwrap();
    }
    assert!(server.stop().success());
}

#[test]
fn a_session_that_is_closed_ends_whatever_is_under_way() {
    let mut server = ServerProcess::start("closing", "");
    let connect = || Session::connect_to(server.address.clone()).unwrap();
    let begun = || {
        let mut session = connect();
        let ids = build(&mut session, 1);
        session.begin_step(1).unwrap()[0] = PoseRecord::end(ids[0], &Pose::IDENTITY);
        session.send().unwrap();
        session
    };
    // A step in flight: waited for.
    begun().close().unwrap();
    server.wait_for(|s| s.sessions == 0);
    // One that takes longer than anybody waits: the server finds that nobody listens, whether the session was closed or dropped.
    for closes in [true, false] {
        let mut session = connect();
        server.freeze();
        session.begin_step(0).unwrap();
        session.send().unwrap();
        if closes {
            session.close().unwrap();
        } else {
            drop(session);
        }
        rustix::process::kill_process(server.pid(), rustix::process::Signal::CONT).unwrap();
        server.wait_for(|s| s.sessions == 0);
    }
    // An import that nobody waits for any more.
    let mut session = connect();
    // No import is answered at once, however quick the machine and whether its cache has the model or not.
    session.command_timeout = Duration::ZERO;
    assert_eq!(session.load_model("large.csg", &spheres(500)).map(|m| m.id), Err(Error::Timeout));
    session.command_timeout = PATIENCE;
    session.close().unwrap();
    assert_eq!(SharedMemory::status(&server.address).unwrap().sessions, 0);
    // A session whose client never came, as one that gave up waiting for the answer.
    let mut session = connect();
    let process = (std::process::id(), names::start_of_process(std::process::id()).unwrap());
    let open = Command::Open { version: names::PROTOCOL_VERSION, process };
    assert!(matches!(session.transport_mut().command(open, PATIENCE), Ok(Answer::Opened { .. })));
    assert_eq!(SharedMemory::status(&server.address).unwrap().sessions, 2);
    server.wait_for(|s| s.sessions == 1);
    session.set_resolution(None).unwrap();
    drop(session);
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new());
}

/// What each effect adds to records, slots and header comes through shared memory as it is.
#[test]
fn every_effect_has_the_embedded_bits() {
    let mut server = ServerProcess::start("effects", "");
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let mut own = contactd::embedded(&ServerConfig::default()).unwrap();
    let ids = build(&mut session, PEGS);
    build(&mut own, PEGS);
    let between = |a: &str, b: &str| Rule::new([a.into(), b.into()]);
    for (n, report) in [Report::Hit, Report::Time, Report::Contact, Report::Patch].into_iter().enumerate() {
        let past = [InitialOverlap::Report, InitialOverlap::IgnoreIfSeparating][n % 2];
        let rules = [
            Rule { report, penetration: n > 1, margin: 0.25, initial_overlap: past, ..between("cell", "pegs") },
            Rule { sensor: true, detect: Detect::Discrete, ..between("pegs", "pegs") },
        ];
        session.set_rules(&rules).unwrap();
        own.set_rules(&rules).unwrap();
        for k in 0..12 {
            assert_eq!(step(&mut session, &ids, k, 9).unwrap(), step(&mut own, &ids, k, 9).unwrap(), "{report:?} {k}");
        }
    }
    assert!(server.stop().success());
}

/// A batch that runs out of its cells: the same pairs stay undecided through shared memory.
#[test]
fn a_batch_limit_cuts_the_same_bits() {
    let mut server = ServerProcess::start("short", "");
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let mut own = contactd::embedded(&ServerConfig::default()).unwrap();
    let ids = build(&mut session, PEGS);
    build(&mut own, PEGS);
    let mut cut = 0;
    for k in 0..40 {
        for limit in [&mut session.options.batch_limit, &mut own.options.batch_limit] {
            *limit = 1 + (k as u32 % 4) * 5;
        }
        let answer = step(&mut session, &ids, k, 5).unwrap();
        cut += u32::from(answer.0 == contactd_client::proto::step::STEP_UNDECIDED);
        assert_eq!(answer, step(&mut own, &ids, k, 5).unwrap(), "step {k}");
    }
    assert!(cut > 3, "{cut} of 40 steps were cut");
    assert!(server.stop().success());
}

#[test]
fn a_second_server_of_the_name_is_refused_with_a_sentence() {
    let server = ServerProcess::start("only", "");
    let second = serve_command(server.runtime(), "only").output().unwrap();
    assert_eq!(second.status.code(), Some(2));
    let sentence = String::from_utf8_lossy(&second.stderr);
    assert!(sentence.contains("\"only\" is running already"), "{sentence}");
    let bad = serve_command(server.runtime(), "No Name").output().unwrap();
    assert_eq!(bad.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&bad.stderr).contains("a-z, 0-9"));
}

/// The error that bad input meets, with its sentence.
fn refused<T>(result: Result<T, Error>, code: ErrorCode, words: &[&str]) {
    let Err(error) = result else { panic!("{code:?} was expected, but it was taken") };
    assert_eq!(error.code(), Some(code), "{error}");
    let sentence = error.to_string();
    assert!(sentence.contains(code.sentence()), "{sentence}");
    for word in words {
        assert!(sentence.contains(word), "\"{word}\" is missing: {sentence}");
    }
}

#[test]
fn bad_input_is_refused_each_with_its_sentence() {
    let mut server = ServerProcess::start("strict", "batch = 8\nobjects = 3\nsessions = 2\ntext = 5000\n");
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let ids = build(&mut session, 2);
    let good = step(&mut session, &ids, 1, 5).unwrap();
    let end = PoseRecord::end(ids[0], &Pose::at(DVec3::new(8.0, 0.0, 20.0)));
    let nan = PoseRecord { position: [f64::NAN, 0.0, 0.0], ..end };
    let infinite = PoseRecord { rotation: [0.0, f64::INFINITY, 0.0, 1.0], ..end };
    let zero = PoseRecord { rotation: [0.0; 4], ..end };
    let unknown = PoseRecord { object: 77, ..end };
    let fixed = PoseRecord { object: 1, ..end };
    let table: [(&[PoseRecord], ErrorCode, &[&str]); 7] = [
        (&[nan], ErrorCode::NotFinite, &["index 0", "object id 2"]),
        (&[infinite], ErrorCode::NotFinite, &["index 0", "object id 2"]),
        (&[zero], ErrorCode::BadQuaternion, &["index 0", "object id 2", "0.001"]),
        (&[end, unknown], ErrorCode::UnknownObject, &["index 1", "object id 77"]),
        (&[fixed], ErrorCode::StaticObject, &["index 0", "object id 1"]),
        (&[end, end], ErrorCode::DuplicateObject, &["index 1", "object id 2"]),
        (&[PoseRecord { flags: 0, ..end }], ErrorCode::BadCount, &["index 0"]),
    ];
    for (batch, code, words) in table {
        session.options = Default::default();
        session.begin_step(batch.len()).unwrap().copy_from_slice(batch);
        refused(session.finish(PATIENCE), code, words);
    }
    refused(session.begin_step(9).map(|_| ()), ErrorCode::TooMany, &["9 records", "8"]);
    session.begin_step(0).unwrap();
    session.options.advance = 2.0;
    refused(session.finish(PATIENCE), ErrorCode::BadNumber, &[]);
    session.options = Default::default();

    // Past the client's own checks, as a peer that has none would send it.
    let opened = session.opened();
    let plain = StepRequest {
        version: names::PROTOCOL_VERSION,
        session: opened.session,
        epoch: opened.epoch,
        advance: 1.0,
        ..Default::default()
    };
    for (request, code) in [
        (StepRequest { version: names::PROTOCOL_VERSION + 1, ..plain }, ErrorCode::Version),
        (StepRequest { records: 9, ..plain }, ErrorCode::TooMany),
        (StepRequest { records: 10, ..plain }, ErrorCode::BadCount),
        (StepRequest { asked: ASK_ALL + 1, ..plain }, ErrorCode::BadNumber),
        (StepRequest { session: opened.session + 5, ..plain }, ErrorCode::SessionGone),
        (StepRequest { epoch: opened.epoch + 1, ..plain }, ErrorCode::SessionGone),
    ] {
        let raw = session.transport_mut();
        raw.loan(9).unwrap().fill(end);
        raw.send(request).unwrap();
        raw.receive(PATIENCE).unwrap();
        let (reply, _) = raw.reply().unwrap();
        assert_eq!((reply.status, reply.error), (STEP_REFUSED, code.number()), "{code:?}");
    }
    let raw = session.transport_mut();
    let answer = raw.command(Command::Open { version: 9, process: (1, 1) }, PATIENCE).unwrap();
    assert!(matches!(answer, Answer::Refused { code, .. } if code == ErrorCode::Version.number()), "{answer:?}");

    refused(session.load_model("broken.csg", "cube(size = [1, 1, 1);"), ErrorCode::Model, &["broken.csg:1:"]);
    refused(session.load_model("roof.csg", "roof();"), ErrorCode::Model, &["roof.csg:1:1", "roof"]);
    let long = format!("cube(size = 1);{}", " ".repeat(6000));
    refused(session.load_model("long.csg", &long), ErrorCode::LimitText, &["long.csg"]);
    refused(session.add_object(Object::new("ghost", 99)), ErrorCode::UnknownModel, &["ghost", "99"]);
    refused(session.add_object(Object::new("fourth", 1)), ErrorCode::LimitObjects, &["3"]);
    refused(session.remove_object(99), ErrorCode::UnknownObject, &["99"]);
    refused(session.set_resolution(Some(-1.0)), ErrorCode::Resolution, &["-1"]);

    let second = Session::connect_to(server.address.clone()).unwrap();
    refused(Session::connect_to(server.address.clone()).map(|_| ()), ErrorCode::LimitSessions, &["2"]);
    second.close().unwrap();

    // None of it has changed a bit of the scene.
    let mut own = contactd::embedded(&ServerConfig::default()).unwrap();
    build(&mut own, 2);
    assert_eq!(step(&mut own, &ids, 1, 5).unwrap(), good);
    assert_eq!(step(&mut session, &ids, 2, 5).unwrap(), step(&mut own, &ids, 2, 5).unwrap());

    // A session that is gone: the batch is refused, and a reconnect brings it back.
    session.transport_mut().command(Command::Close, PATIENCE).unwrap();
    set_options(&mut session, 3);
    fill(session.begin_step(ids.len()).unwrap(), &ids, 3, 5);
    refused(session.finish(PATIENCE), ErrorCode::SessionGone, &[]);
    session.reconnect(PATIENCE).unwrap();
    session.resend().unwrap();
    assert_eq!(session.finish(PATIENCE).map(|r| bits(&r)).unwrap(), step(&mut own, &ids, 3, 5).unwrap());
    assert!(server.stop().success());
}

#[test]
fn batches_and_replies_grow_far_beyond_their_first_size() {
    let mut server = ServerProcess::start("growth", "");
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let mut own = contactd::embedded(&ServerConfig::default()).unwrap();
    let ids = build(&mut session, 60);
    build(&mut own, 60);
    // 61 objects, all pairs told with their details: 3,660 slots, from a first size of 64.
    let mut all = |k: u64| {
        let mut answers = Vec::new();
        session.options = contactd_client::StepOptions { clear: true, details: true, ..Default::default() };
        own.options = session.options;
        fill(session.begin_step(60).unwrap(), &ids, k, 9);
        fill(own.begin_step(60).unwrap(), &ids, k, 9);
        answers.push(session.finish(PATIENCE).map(|r| (r.records().len(), r.slots().len(), bits(&r))).unwrap());
        answers.push(own.finish(PATIENCE).map(|r| (r.records().len(), r.slots().len(), bits(&r))).unwrap());
        assert_eq!(answers[0], answers[1]);
        answers[0].1
    };
    assert_eq!(all(1), 2 * (61 * 60 / 2));
    for n in [1, 100, 5_000, 100_000] {
        // Records of no object: what is tried is their way.
        session.begin_step(n).unwrap()[n - 1].object = 777;
        refused(session.finish(PATIENCE), ErrorCode::UnknownObject, &["index 0"]);
    }
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new());
}

#[test]
fn two_servers_share_a_cache_and_a_third_begins_with_it() {
    let folder = harness::runtime_folder();
    let kept = || -> Vec<(String, u64)> {
        let files = std::fs::read_dir(folder.path()).unwrap().flatten();
        let mut files: Vec<_> =
            files.map(|f| (f.file_name().to_string_lossy().into_owned(), f.metadata().unwrap().ino())).collect();
        files.sort();
        files
    };
    let config = format!("cache = {:?}", folder.path());
    let mut own = contactd::embedded(&ServerConfig::default()).unwrap();
    let ids = build(&mut own, PEGS);
    let expected = step(&mut own, &ids, 1, 8).unwrap();
    let answer = |server: &ServerProcess| {
        let mut session = Session::connect_to(server.address.clone()).unwrap();
        let ids = build(&mut session, PEGS);
        step(&mut session, &ids, 1, 8).unwrap()
    };
    let servers = [0, 1].map(|i| ServerProcess::start(&format!("cache-{i}"), &config));
    let answers = std::thread::scope(|scope| {
        let each = servers.each_ref().map(|s| scope.spawn(|| answer(s)));
        each.map(|thread| thread.join().unwrap())
    });
    assert!(answers.iter().all(|a| *a == expected));
    let first = kept();
    assert_eq!(first.len(), 2, "a plate and a peg: {first:?}");
    // Read and not written again: a new file would be another one.
    let third = ServerProcess::start("cache-2", &config);
    assert_eq!(answer(&third), expected);
    assert_eq!(kept(), first);
    // A folder that is no folder: the server serves.
    let none = ServerProcess::start("cache-3", &format!("cache = {:?}", folder.path().join(&first[0].0)));
    assert_eq!(answer(&none), expected);
}

#[test]
fn a_large_model_delays_only_the_session_that_loads_it() {
    let server = ServerProcess::start("beside", "");
    let address = server.address.clone();
    let mut session = Session::connect_to(address.clone()).unwrap();
    let ids = build(&mut session, 1);
    let loading = std::thread::spawn(move || {
        let mut other = Session::connect_to(address).unwrap();
        other.load_model("large.csg", &spheres(8_000)).map(|m| m.faces.len())
    });
    let mut steps = 0;
    while !loading.is_finished() {
        step(&mut session, &ids, steps, 2).unwrap();
        steps += 1;
    }
    assert_eq!(loading.join().unwrap(), Ok(8_000));
    assert!(steps > 3, "only {steps} steps while a model was loaded");
}

#[test]
fn mass_properties_are_the_embedded_bits_and_other_sessions_step_meanwhile() {
    let mut server = ServerProcess::start("scales", "");
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let mut own = contactd::embedded(&ServerConfig::default()).unwrap();
    // A ball less a bore: no closed form.
    let text = "difference() { sphere(r = 2); cylinder(h = 9, r1 = 1, r2 = 1, center = true); }";
    let ring = session.load_model("ring.csg", text).unwrap().id;
    assert_eq!(own.load_model("ring.csg", text).unwrap().id, ring);
    let options = MassOptions { tolerance: 1e-5, ..Default::default() };
    let other = server.address.clone();
    // Another client steps while the answer is computed, and is never told that the server is busy.
    let (go, stop) = std::sync::mpsc::channel::<()>();
    let stepping = std::thread::spawn(move || {
        let mut session = Session::connect_to(other).unwrap();
        let ids = build(&mut session, PEGS);
        let mut steps = 0u64;
        while stop.try_recv() == Err(std::sync::mpsc::TryRecvError::Empty) {
            step(&mut session, &ids, steps, 3).unwrap();
            steps += 1;
        }
        session.close().unwrap();
        steps
    });
    let answers: Vec<_> = (0..3).map(|_| session.mass_properties(ring, &options).unwrap()).collect();
    drop(go);
    assert!(stepping.join().unwrap() > 0);
    let expected = own.mass_properties(ring, &options).unwrap();
    assert!(expected.volume_error <= 1e-5 * expected.volume && expected.boxes > 100, "{expected:?}");
    assert!(answers.iter().all(|m| *m == expected), "{answers:?} {expected:?}");
    for (model, options, code) in [
        (ring + 1, options, ErrorCode::UnknownModel),
        (ring, MassOptions { tolerance: 2.0, ..options }, ErrorCode::BadNumber),
        (ring, MassOptions { boxes: 0, ..options }, ErrorCode::BadNumber),
    ] {
        assert_eq!(session.mass_properties(model, &options).unwrap_err().code(), Some(code));
    }
    session.close().unwrap();
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new());
}

/// Everything that can be asked of objects, as bytes: NaN is what it is.
fn asked<T: Transport>(session: &mut Session<T>, ids: &[u32]) -> Vec<u8> {
    let mut seed = 5u64;
    let mut number = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    };
    let points: Vec<[f64; 3]> = (0..200).map(|_| [30.0 * number(), 15.0 * number(), 15.0 * number()]).collect();
    let rays: Vec<ObjectRay> = points
        .iter()
        .map(|origin| ObjectRay { origin: *origin, direction: [number(), number(), number()], length: 60.0 })
        .collect();
    let told = session.points(&points, &PointOptions::default(), None).unwrap();
    assert!(told.iter().all(|t| t.is_settled && t.lower <= t.upper), "{told:?}");
    assert!(told.iter().any(|t| t.side == Side::Inside) && told.iter().any(|t| t.side == Side::Outside));
    let hit = session.rays(&rays, &RayOptions::default(), Some(ids)).unwrap();
    assert!(hit.iter().any(|h| matches!(h.outcome, RayOutcome::Hit(_))), "{hit:?}");
    let apart = session.distance(ids[0], ids[1], 1e-6).unwrap();
    let answers = [QueryAnswer::Points(told), QueryAnswer::Rays(hit), QueryAnswer::Distance(apart)];
    answers.iter().flat_map(|a| encode(a).unwrap()).collect()
}

#[test]
fn queries_have_the_embedded_bits_and_follow_the_objects_also_to_a_successor() {
    let mut server = ServerProcess::start("asked", "");
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let mut own = contactd::embedded(&ServerConfig::default()).unwrap();
    let ids = build(&mut session, PEGS);
    assert_eq!(build(&mut own, PEGS), ids);
    let mut before = Vec::new();
    for k in 0..3 {
        step(&mut session, &ids, k, 3).unwrap();
        step(&mut own, &ids, k, 3).unwrap();
        let told = asked(&mut session, &ids);
        assert!(told == asked(&mut own, &ids), "step {k}");
        assert_ne!(told, before, "step {k}: they have moved");
        before = told;
    }
    server.kill();
    server.restart();
    assert!(matches!(session.distance(ids[0], ids[1], 1e-6), Err(Error::ServerLost)));
    session.reconnect(PATIENCE).unwrap();
    assert!(asked(&mut session, &ids) == before, "asked of the successor");
    let nan = session.points(&[[0.0; 3], [f64::NAN, 0.0, 0.0]], &PointOptions::default(), None).unwrap_err();
    assert!(matches!(nan, Error::Refused { code: ErrorCode::NotFinite, index: Some(1), .. }), "{nan:?}");
    // More than one command carries: each answer is the one that its point has alone, and an index counts from the first on.
    let mut many: Vec<[f64; 3]> = (0..70_000).map(|i| [f64::from(i) * 1e-3, 0.0, 0.0]).collect();
    let told = session.points(&many, &PointOptions::default(), Some(&ids[..1])).unwrap();
    let last = session.points(&many[69_999..], &PointOptions::default(), Some(&ids[..1])).unwrap();
    assert!(told.len() == 70_000 && told[69_999] == last[0] && told[69_998] != last[0], "{last:?}");
    many[69_000][1] = f64::INFINITY;
    let infinite = session.points(&many, &PointOptions::default(), Some(&ids[..1])).unwrap_err();
    assert!(matches!(infinite, Error::Refused { code: ErrorCode::NotFinite, index: Some(69_000), .. }), "{infinite:?}");
    for (objects, tolerance, code) in
        [([ids[0], 77], 1e-6, ErrorCode::UnknownObject), ([ids[0], ids[1]], -1.0, ErrorCode::BadNumber)]
    {
        assert_eq!(session.distance(objects[0], objects[1], tolerance).unwrap_err().code(), Some(code));
    }
    // A step that is in flight is finished first.
    session.begin_step(1).unwrap()[0] = PoseRecord::end(ids[0], &Pose::IDENTITY);
    session.send().unwrap();
    assert!(matches!(session.distance(ids[0], ids[1], 1e-6), Err(Error::Misuse(_))));
    session.finish(PATIENCE).unwrap();
    session.close().unwrap();
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new());
}
