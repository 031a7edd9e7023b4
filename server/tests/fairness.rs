//! Sessions that take long beside others: no step, import or integral of one keeps another from being answered. Counts and the
//! order of answers, never times.

#[allow(dead_code, reason = "other tests use the rest of it")]
mod harness;

use contactd::ipc::ServerConfig;
use contactd_client::proto::contact_record::UNDECIDED;
use contactd_client::proto::names::Address;
use contactd_client::proto::{Detect, ErrorCode, Pose, PoseRecord, Rule};
use contactd_client::{Error, MassOptions, Object, Session, SharedMemory, Transport};
use glam::DVec3;
use harness::scene::{bits, build, fill, set_options, spheres};
use harness::{PATIENCE, ServerProcess};
use std::process::{Command as Process, Stdio};
use std::time::Duration;

/// The same for what yields to whatever else the machine does.
const LONG: Duration = Duration::from_secs(600);

/// Steps of a small scene that are asked for beside a long one. If they waited for it, one would be answered after it; so few that
/// no slow machine needs as long for them as for a hundred thousand pairs.
const BESIDE: u32 = 12;

/// Objects at one point: every two of them overlap.
fn crowd<T: Transport>(session: &mut Session<T>, model: &str, count: u32, rules: &[Rule]) -> Vec<u32> {
    let model = session.load_model("crowd.csg", model).unwrap().id;
    let mut add = |i: u32| session.add_object(Object::new(&format!("o{i}"), model).group("crowd")).unwrap();
    let ids = (0..count).map(&mut add).collect();
    session.set_rules(rules).unwrap();
    ids
}

/// Begins a step in which the first object moves.
fn begin<T: Transport>(session: &mut Session<T>, ids: &[u32], k: u32) {
    session.begin_step(1).unwrap()[0] = PoseRecord::end(ids[0], &Pose::at(DVec3::X * (0.01 * f64::from(k))));
}

/// True while the reply to the step in flight has not come.
fn is_under_way(session: &mut Session<SharedMemory>) -> bool {
    match session.transport_mut().receive(Duration::ZERO) {
        Err(Error::Timeout) => true,
        Ok(()) => false,
        Err(e) => panic!("{e}"),
    }
}

const BALL: &str = "sphere(r = 1);";
/// Lumps whose deepest common point takes thousands of cells to find.
const LUMP: &str = "union() {
    cube(size = [4, 3, 2], center = true);
    multmatrix([[1, 0, 0, 1.3], [0, 0.8, -0.6, 0.7], [0, 0.6, 0.8, 0.2], [0, 0, 0, 1]]) { cylinder($fn = 0, h = 5, r1 = 1.4, r2 = 0.3, center = true); }
    difference() { sphere($fn = 0, r = 2.2); cylinder($fn = 0, h = 9, r1 = 0.9, r2 = 0.9, center = true); }
}";

/// Many steps of one session are answered while one step of another is under way; what that one says is what it says
/// alone.
fn a_long_step_is_passed(name: &str, model: &str, count: u32, rules: &[Rule]) {
    let mut server = ServerProcess::start(name, "");
    let mut light = Session::connect_to(server.address.clone()).unwrap();
    // Two balls far from each other: what is asked for is the way there and back.
    let light_ids = crowd(&mut light, BALL, 2, &[]);
    let place = |k: u32| Pose::at(DVec3::new(10.0 + f64::from(k % 7), 0.0, 0.0));
    let mut hard = Session::connect_to(server.address.clone()).unwrap();
    let ids = crowd(&mut hard, model, count, rules);
    let mut own = contactd::embedded(&ServerConfig::default()).unwrap();
    let own_ids = crowd(&mut own, model, count, rules);
    let mut k = 0;
    // The first one is found to be long while it runs; the second runs on its session's own thread from the beginning.
    for round in 1..3 {
        begin(&mut hard, &ids, round);
        hard.send().unwrap();
        for _ in 0..BESIDE {
            light.begin_step(1).unwrap()[0] = PoseRecord::start(light_ids[0], &place(k));
            assert_eq!(light.finish(PATIENCE).unwrap().header().records, 0);
            k += 1;
        }
        assert!(is_under_way(&mut hard), "{BESIDE} small steps took longer than one step of {count} objects");
        let answer = hard.finish(LONG).map(|r| bits(&r)).unwrap();
        begin(&mut own, &own_ids, round);
        assert!(answer == own.finish(PATIENCE).map(|r| bits(&r)).unwrap(), "round {round}");
        assert!(answer.1 > count, "{} records", answer.1);
    }
    // Short again: many small steps in a row, as many as it takes to come back to the loop and more.
    hard.set_rules(&[Rule { detect: Detect::Off, ..Rule::new(["crowd".into(), "crowd".into()]) }]).unwrap();
    for round in 0..200 {
        begin(&mut hard, &ids, round);
        assert_eq!(hard.finish(PATIENCE).map(|r| r.header().records).unwrap(), 0);
    }
    // A server that is told to stop waits for a step, but not for long.
    hard.set_rules(rules).unwrap();
    begin(&mut hard, &ids, 3);
    hard.send().unwrap();
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new());
}

/// More than a hundred thousand pairs: not one of them is hard, what lasts is the list, the order and the reply.
#[test]
fn a_step_of_a_hundred_thousand_pairs_delays_no_other_session() {
    a_long_step_is_passed("crowd", BALL, 500, &[]);
}

/// Every pair is searched, each to thousands of cells.
#[test]
fn a_step_whose_every_pair_is_hard_delays_no_other_session() {
    let rule = Rule { penetration: true, ..Rule::new(["crowd".into(), "crowd".into()]) };
    a_long_step_is_passed("hard", LUMP, 60, &[rule]);
}

#[test]
fn a_client_that_leaves_during_a_long_step_takes_its_session_along() {
    let mut server = ServerProcess::start("leaves", "");
    let mut hard = Session::connect_to(server.address.clone()).unwrap();
    let ids = crowd(&mut hard, BALL, 700, &[]);
    begin(&mut hard, &ids, 1);
    hard.send().unwrap();
    drop(hard);
    server.wait_for(|s| s.sessions == 0);
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new());
}

#[test]
fn a_deadline_leaves_undecided_what_is_not_known_by_then() {
    let count = 300;
    let answers = ["", "deadline_ms = 5\n"].map(|config| {
        let mut server = ServerProcess::start("deadline", config);
        let mut session = Session::connect_to(server.address.clone()).unwrap();
        let ids = crowd(&mut session, BALL, count, &[]);
        begin(&mut session, &ids, 1);
        let (undecided, reported) = {
            let reply = session.finish(LONG).unwrap();
            (reply.records().iter().filter(|r| r.status == UNDECIDED).count(), reply.records().len())
        };
        // The step after it is a step like any other.
        begin(&mut session, &ids, 2);
        session.finish(LONG).unwrap();
        session.close().unwrap();
        assert!(server.stop().success());
        (undecided, reported)
    });
    let pairs = count as usize * (count as usize - 1) / 2;
    assert_eq!(answers.map(|(_, reported)| reported), [pairs; 2], "each pair is reported, decided or not");
    assert!(answers[0].0 == 0 && answers[1].0 > 0, "{answers:?}");
}

/// The same key is a setting of an engine in one's own process.
#[test]
fn an_embedded_engine_keeps_its_deadline() {
    let undecided = [0, 1].map(|deadline_ms| {
        let mut session = contactd::embedded(&ServerConfig { deadline_ms, ..ServerConfig::default() }).unwrap();
        let ids = crowd(&mut session, BALL, 300, &[]);
        begin(&mut session, &ids, 1);
        let reply = session.finish(LONG).unwrap();
        reply.records().iter().filter(|r| r.status == UNDECIDED).count()
    });
    assert!(undecided[0] == 0 && undecided[1] > 0, "{undecided:?}");
}

/// Asks until the server is seen to be at it: true, or to have done it. A request that is given up at once may never be heard.
fn is_at_work<T>(mut ask: impl FnMut() -> Result<T, Error>) -> bool {
    loop {
        match ask() {
            Err(Error::Timeout) => {}
            Err(e) if e.code() == Some(ErrorCode::Busy) => return true,
            Err(e) => panic!("{e}"),
            Ok(_) => return false,
        }
    }
}

/// A session whose import is under way.
fn importing(address: &Address, n: u32) -> Session<SharedMemory> {
    let mut session = Session::connect_to(address.clone()).unwrap();
    let text = spheres(n);
    // Long enough to be heard, much shorter than the import: a command that was not answered in time loses the session.
    session.command_timeout = Duration::from_millis(100);
    match session.load_model("large.csg", &text) {
        Ok(_) | Err(Error::Timeout) => {}
        Err(e) => panic!("{e}"),
    }
    session
}

#[test]
fn imports_of_some_keep_no_other_from_its_small_model() {
    let mut server = ServerProcess::start("imports", "");
    let mut small = Session::connect_to(server.address.clone()).unwrap();
    // Each its own text: equal ones would be one model.
    let _staying: Vec<_> = (0..4).map(|i| importing(&server.address, 15_000 + i)).collect();
    (0..6).for_each(|i| drop(importing(&server.address, 14_000 + i)));
    for n in 1..4 {
        small.load_model("small.csg", &format!("sphere(r = {n});")).unwrap();
    }
    let ids = build(&mut small, 1);
    for k in 0..20 {
        set_options(&mut small, k);
        fill(small.begin_step(1).unwrap(), &ids, k, 4);
        small.finish(PATIENCE).unwrap();
    }
    // Those that left are gone with what they asked for.
    server.wait_for(|s| s.sessions == 5);
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new());
}

#[test]
fn an_integral_without_end_delays_no_import() {
    let mut server = ServerProcess::start("integral", "");
    let mut weighs = Session::connect_to(server.address.clone()).unwrap();
    let lump = weighs.load_model("lump.csg", LUMP).unwrap().id;
    weighs.command_timeout = Duration::from_millis(20);
    let endless = MassOptions { tolerance: 1e-15, boxes: MassOptions::MOST_BOXES };
    assert!(is_at_work(|| weighs.mass_properties(lump, &endless)));
    let mut other = Session::connect_to(server.address.clone()).unwrap();
    for n in 1..4 {
        let model = other.load_model("small.csg", &format!("sphere(r = {n});")).unwrap().id;
        assert!(other.mass_properties(model, &MassOptions::default()).unwrap().volume > 4.0);
    }
    // Its own commands wait for it.
    weighs.command_timeout = PATIENCE;
    assert_eq!(
        weighs.set_resolution(None).unwrap_err().code(),
        Some(ErrorCode::Busy),
        "the integral is still under way"
    );
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new());
}

#[test]
fn a_hangup_is_a_line_and_nothing_else() {
    let mut server = ServerProcess::start("hangup", "");
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let ids = build(&mut session, 2);
    for k in 0..20 {
        rustix::process::kill_process(server.pid(), rustix::process::Signal::HUP).unwrap();
        set_options(&mut session, k);
        fill(session.begin_step(2).unwrap(), &ids, k, 4);
        session.finish(PATIENCE).unwrap();
    }
    session.close().unwrap();
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new());
}

/// Where the system starts no thread the program says so, in one sentence.
#[test]
fn a_thread_that_cannot_be_started_is_an_error_and_no_panic() {
    use std::fs::Permissions;
    use std::os::unix::fs::PermissionsExt as _;
    use std::os::unix::process::CommandExt as _;
    let folder = tempfile::tempdir().unwrap();
    std::fs::set_permissions(folder.path(), Permissions::from_mode(0o777)).unwrap();
    let program = folder.path().join("program");
    std::fs::copy(env!("CARGO_BIN_EXE_contactd"), &program).unwrap();
    let model = folder.path().join("ball.csg");
    std::fs::write(&model, BALL).unwrap();
    let limited = |arguments: &str| {
        let mut shell = Process::new("bash");
        let script = format!("ulimit -u 1; exec {} {arguments}", program.display());
        shell.args(["-c", &script]).env("XDG_RUNTIME_DIR", folder.path()).stdin(Stdio::null());
        if rustix::process::geteuid().is_root() {
            // The limit is not root's: somebody else.
            shell.uid(65_534).gid(65_534);
        }
        shell.output().unwrap()
    };
    for arguments in ["serve --name threadless".into(), format!("inspect {}", model.display())] {
        let output = limited(&arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {said}");
        assert!(said.contains("expected to start threads") && !said.contains("panicked"), "{arguments}: {said}");
        assert_eq!(said.trim().lines().count(), 1, "{arguments}: {said}");
    }
}

/// What a session keeps is limited, whatever it is made of: long texts, and short ones of many faces; and so is what it is told.
#[test]
fn a_session_has_a_share_of_memory_and_of_slots() {
    let config = ServerConfig { models_mb: 1, records: 5, ..ServerConfig::default() };
    let mut session = contactd::embedded(&config).unwrap();
    let long = format!("sphere(r = 1);{}", " ".repeat(600_000));
    session.load_model("long.csg", &long).unwrap();
    let full = |loaded: Result<_, Error>| matches!(loaded, Err(e) if e.code() == Some(ErrorCode::LimitMemory));
    assert!(full(session.load_model("again.csg", &long).map(|m| m.id)));
    // Their text alone would find room.
    let many = spheres(2_000);
    assert!(many.len() < 400_000 && full(session.load_model("many.csg", &many).map(|m| m.id)));
    let ids = crowd(&mut session, BALL, 5, &[]);
    begin(&mut session, &ids, 1);
    let reply = session.finish(PATIENCE).unwrap();
    assert!(reply.truncated() && reply.records().len() == 5, "{} records", reply.records().len());
}
