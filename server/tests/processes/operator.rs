//! What an operator sees and does: servers and their sessions as they are, a session that is ended, lines on standard error.

#[path = "metrics.rs"]
mod metrics;
#[path = "service.rs"]
mod service;

use super::harness::scene::{build, fill, spheres};
use super::harness::{PATIENCE, ServerProcess, runtime_folder, serve_command};
use contactd_client::proto::step::STEP_UNDECIDED;
use contactd_client::proto::{ErrorCode, Pose, PoseRecord};
use contactd_client::{Error, Object, Session, SharedMemory, Transport};
use glam::DVec3;
use serde_json::Value;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

fn contactd(runtime: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_contactd"));
    command.args(arguments).env("XDG_RUNTIME_DIR", runtime).output().expect("the program")
}

/// What a command prints that does well, in 80 columns.
fn printed(runtime: &Path, arguments: &[&str]) -> String {
    let out = contactd(runtime, arguments);
    assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
    let text = String::from_utf8(out.stdout).expect("UTF-8");
    let is_text = !arguments.contains(&"--json");
    assert!(!is_text || text.lines().all(|line| line.chars().count() <= 80), "{text}");
    text
}

/// What a command says that is refused: one line.
fn refused(runtime: &Path, arguments: &[&str]) -> String {
    let out = contactd(runtime, arguments);
    let text = String::from_utf8(out.stderr).expect("UTF-8");
    assert_eq!((out.status.code(), text.lines().count(), out.stdout.len()), (Some(2), 1, 0), "{text}");
    text
}

fn status(server: &ServerProcess) -> Value {
    let text = printed(server.runtime(), &["status", "--json", "--name", server.address.name()]);
    let mut all: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(all["servers"].as_array().map(Vec::len), Some(1), "{all}");
    all["servers"][0].take()
}

fn connect(server: &ServerProcess) -> Session<SharedMemory> {
    Session::connect_to(server.address.clone()).unwrap()
}

/// Steps of a scene, `cut` of them with work for next to nothing; how many left a pair undecided.
fn play<T: Transport>(session: &mut Session<T>, ids: &[u32], steps: u64, cut: u64) -> u64 {
    let is_undecided = |k: &u64| {
        session.options.batch_limit = u32::from(*k < cut);
        fill(session.begin_step(ids.len()).unwrap(), ids, *k, 5);
        session.finish(PATIENCE).unwrap().header().status == STEP_UNDECIDED
    };
    (0..steps).filter(is_undecided).count() as u64
}

/// A client process of its own: it makes a few steps, says so, and stays until its input ends.
fn client(server: &ServerProcess) -> Child {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "operator::a_client_that_stays", "--nocapture", "--test-threads=1"])
        .env("CONTACTD_TEST_STAYS", server.address.name())
        .env("XDG_RUNTIME_DIR", server.runtime())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let said = lines.map_while(Result::ok).find(|line| line.contains("it stays"));
    assert!(said.is_some(), "the client ended");
    child
}

/// The body of that process; without its variable it is nothing.
#[test]
fn a_client_that_stays() {
    let Ok(name) = std::env::var("CONTACTD_TEST_STAYS") else { return };
    let mut session = Session::connect(&name).unwrap();
    let ids = build(&mut session, 2);
    play(&mut session, &ids, 5, 0);
    println!("it stays");
    let _ = std::io::stdin().read(&mut [0]);
}

#[test]
fn a_server_with_two_clients_tells_what_they_have_done() {
    let mut server = ServerProcess::start("two", "");
    let mut session = connect(&server);
    let ids = build(&mut session, 3);
    let undecided = play(&mut session, &ids, 40, 30);
    assert!(undecided > 1, "{undecided} steps were cut");
    // What is refused is no step.
    session.begin_step(1).unwrap()[0] = PoseRecord::end(77, &Pose::IDENTITY);
    assert_eq!(session.finish(PATIENCE).map(|_| ()).unwrap_err().code(), Some(ErrorCode::UnknownObject));
    let mut child = client(&server);
    let told = status(&server);
    let pid = server.pid().as_raw_nonzero().get();
    assert_eq!((&told["state"], &told["pid"]), (&"running".into(), &pid.into()), "{told}");
    let sessions = told["sessions"].as_array().expect("sessions");
    let each = |key: &str| sessions.iter().map(|s| s[key].as_u64().expect("a number")).collect::<Vec<_>>();
    assert_eq!(each("id"), [session.opened().session, session.opened().session + 1]);
    assert_eq!(each("pid"), [u64::from(std::process::id()), u64::from(child.id())]);
    assert_eq!((each("objects"), each("models")), (vec![4, 3], vec![2, 2]));
    assert_eq!((each("steps"), each("undecided")), (vec![40, 5], vec![undecided, 0]));
    assert_eq!((&told["objects"], &told["models"]), (&7.into(), &2.into()), "a model is counted once");
    assert_eq!((&told["steps"], &told["undecided"]), (&45.into(), &undecided.into()));
    let minute = &told["last_minute"];
    assert_eq!(minute["steps"], 45, "{minute}");
    let times = ["p50_ms", "p99_ms", "p999_ms", "largest_ms"].map(|key| minute[key].as_f64().expect("a time"));
    assert!(times[0] > 0.0 && times.is_sorted(), "{times:?}");
    let per_second = told["steps_per_second"].as_f64().expect("a rate");
    assert!((per_second * minute["seconds"].as_f64().expect("seconds") - 45.0).abs() < 1e-6, "{told}");
    assert!(told["memory_bytes"].as_u64().expect("bytes") > 1 << 20, "{told}");
    let text = printed(server.runtime(), &["status"]);
    for words in
        [&format!("two: process {pid}, up "), "2 sessions, 7 objects, 2 models", "45 steps since its start", "p99.9"]
    {
        assert!(text.contains(words), "{words} in {text}");
    }
    assert!(text.contains(&format!(" {} ", child.id())), "{text}");
    // Another client has gone: so has its session, and what it did is still counted.
    child.kill().unwrap();
    child.wait().unwrap();
    server.wait_for(|s| s.sessions == 1);
    session.remove_object(ids[0]).unwrap();
    let told = status(&server);
    assert_eq!((&told["sessions"][0]["objects"], &told["objects"], &told["steps"]), (&3.into(), &3.into(), &45.into()));
    drop(session);
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new(), "who asks leaves nothing behind");
}

#[test]
fn no_server_and_one_that_was_killed_are_told_as_such() {
    let runtime = runtime_folder();
    assert_eq!(printed(runtime.path(), &["status", "--json"]), "{\"servers\":[]}\n");
    assert!(printed(runtime.path(), &["status"]).starts_with("no server is running: start one with"));
    assert!(refused(runtime.path(), &["status", "--name", "gone"]).contains("contactd serve --name gone"));
    assert!(refused(runtime.path(), &["status", "--name", "No"]).contains("a-z, 0-9"));
    assert!(
        refused(runtime.path(), &["sessions", "end", "1", "--name", "gone"]).contains("contactd serve --name gone")
    );
    let mut server = ServerProcess::start("gone", "");
    let pid = server.pid().as_raw_nonzero().get();
    // Another one of the same user.
    let mut command = serve_command(server.runtime(), "other");
    let mut other = command.stdout(Stdio::piped()).spawn().unwrap();
    BufReader::new(other.stdout.take().unwrap()).read_line(&mut String::new()).unwrap();
    server.kill();
    let all: Value = serde_json::from_str(&printed(server.runtime(), &["status", "--json"])).expect("JSON");
    let told: Vec<(&str, &str)> = all["servers"]
        .as_array()
        .expect("servers")
        .iter()
        .map(|s| (s["name"].as_str().unwrap(), s["state"].as_str().unwrap()))
        .collect();
    assert_eq!(told, [("gone", "left behind"), ("other", "running")]);
    assert_eq!(all["servers"][0]["pid"], pid);
    let text = printed(server.runtime(), &["status"]);
    assert!(text.contains(&format!("gone: not running; process {pid} has gone and left its folder")), "{text}");
    assert!(text.contains("other: process ") && text.contains("no step"), "{text}");
    other.kill().unwrap();
    other.wait().unwrap();
    server.restart();
    assert_eq!(status(&server)["state"], "running");
    assert!(server.stop().success());
}

#[test]
fn a_session_that_is_ended_hears_why_and_others_go_on() {
    let mut server = ServerProcess::start("ends", "");
    let (mut session, mut other) = (connect(&server), connect(&server));
    let (ids, other_ids) = (build(&mut session, 2), build(&mut other, 2));
    play(&mut session, &ids, 2, 0);
    let end = |id: u64| printed(server.runtime(), &["sessions", "end", &id.to_string(), "--name", "ends"]);
    let id = session.opened().session;
    assert_eq!(end(id), format!("session {id} of \"ends\" is ended\n"));
    assert_eq!(status(&server)["sessions"].as_array().map(Vec::len), Some(1));
    // A step, and a command of another session that was ended.
    fill(session.begin_step(ids.len()).unwrap(), &ids, 2, 5);
    let told = session.finish(PATIENCE).map(|_| ()).unwrap_err();
    assert_eq!(told, Error::refused(ErrorCode::SessionEnded));
    assert_eq!(told.to_string(), "the session was ended on its server, with `contactd sessions end`");
    // It may come back, as after any loss.
    session.reconnect(PATIENCE).unwrap();
    session.resend().unwrap();
    session.finish(PATIENCE).unwrap();
    assert!(session.opened().session > other.opened().session);
    end(session.opened().session);
    assert_eq!(session.remove_object(ids[0]).unwrap_err().code(), Some(ErrorCode::SessionEnded));
    // An import that it waits for.
    let (address, (send, opened)) = (server.address.clone(), std::sync::mpsc::channel());
    let loading = std::thread::spawn(move || {
        let mut waits = Session::connect_to(address).unwrap();
        send.send(waits.opened().session).unwrap();
        waits.load_model("large.csg", &spheres(10_000)).map(|m| m.id)
    });
    let third = opened.recv().unwrap();
    let until = Instant::now() + PATIENCE;
    let is_busy =
        || status(&server)["sessions"].as_array().unwrap().iter().any(|s| s["id"] == third && s["busy"] == true);
    while !is_busy() && !loading.is_finished() {
        assert!(Instant::now() < until, "the import never began");
    }
    if !loading.is_finished() {
        end(third);
    }
    let loaded = loading.join().unwrap();
    assert!(loaded == Ok(1) || loaded.as_ref().is_err_and(|e| e.code() == Some(ErrorCode::SessionEnded)), "{loaded:?}");
    // The one beside it was not touched.
    play(&mut other, &other_ids, 3, 0);
    let sentence = refused(server.runtime(), &["sessions", "end", "99", "--name", "ends"]);
    assert!(sentence.starts_with("there is no session 99 on \"ends\": `contactd status --name ends`"), "{sentence}");
    assert!(server.stop().success());
}

#[test]
fn a_step_that_is_under_way_does_not_keep_its_session_from_being_ended() {
    let mut server = ServerProcess::start("long", "");
    let mut session = connect(&server);
    // Every two of them overlap, and each pair is told: some 180,000.
    let ball = session.load_model("ball.csg", "sphere(r = 1);").unwrap().id;
    let ids: Vec<u32> = (0..600).map(|i| session.add_object(Object::new(&format!("o{i}"), ball)).unwrap()).collect();
    session.begin_step(1).unwrap()[0] = PoseRecord::end(ids[0], &Pose::at(DVec3::X * 0.01));
    session.send().unwrap();
    let id = session.opened().session.to_string();
    printed(server.runtime(), &["sessions", "end", &id, "--name", "long"]);
    assert_eq!(status(&server)["sessions"], Value::Array(vec![]));
    // It was answered before, or it ends; either way the next one is told.
    let first = session.finish(PATIENCE).map(|_| ());
    if first.is_ok() {
        session.begin_step(0).unwrap();
        assert_eq!(session.finish(PATIENCE).map(|_| ()), Err(Error::refused(ErrorCode::SessionEnded)));
    }
    assert!(first.is_ok() || first == Err(Error::refused(ErrorCode::SessionEnded)), "{first:?}");
    assert!(server.stop().success());
}

/// Lines that a server tells while a session comes, is refused another beside it, and goes.
fn told(arguments: &[&str], variable: Option<&str>, config: &str) -> (u64, Vec<String>) {
    let file = tempfile::NamedTempFile::new().unwrap();
    let mut server = ServerProcess::start_as("tells", &format!("sessions = 1\n{config}"), |command| {
        command.args(arguments).stderr(file.reopen().unwrap()).env_remove("CONTACTD_LOG");
        command.envs(variable.map(|word| ("CONTACTD_LOG", word)));
    });
    let mut session = connect(&server);
    assert!(Session::connect_to(server.address.clone()).is_err());
    build(&mut session, 1);
    assert!(session.remove_object(99).is_err());
    session.close().unwrap();
    let ended = connect(&server);
    printed(server.runtime(), &["sessions", "end", &ended.opened().session.to_string(), "--name", "tells"]);
    drop(ended);
    let last = connect(&server);
    assert!(server.stop().success());
    drop(last);
    let text = std::fs::read_to_string(file.path()).unwrap();
    (std::process::id().into(), text.lines().map(String::from).collect())
}

#[test]
fn each_session_is_a_line_when_it_is_opened_refused_and_ended() {
    let (pid, lines) = told(&[], None, "");
    let expected = [
        format!("session 1 is opened by process {pid} (1 of 1 are open)"),
        format!(
            "a session for process {pid} was refused: the server has as many sessions as it allows: the limit is 1"
        ),
        format!("session 1 of process {pid} is ended after 0 steps: its client closed it"),
        format!("session 2 is opened by process {pid} (1 of 1 are open)"),
        format!("session 2 of process {pid} is ended after 0 steps: `contactd sessions end` asked for it"),
        format!("session 3 is opened by process {pid} (1 of 1 are open)"),
        format!("session 3 of process {pid} is ended after 0 steps: the server stops"),
    ];
    assert_eq!(lines, expected.map(|line| format!("contactd: {line}")));
    // The command line stands before the environment, that before the file.
    for (arguments, variable, config) in [
        (&["-q"][..], None, ""),
        (&["--quiet"], Some("debug"), ""),
        (&[], Some("warn"), "log = \"debug\"\n"),
        (&[], None, "log = \"warn\"\n"),
    ] {
        assert_eq!(told(arguments, variable, config).1, Vec::<String>::new(), "{arguments:?} {variable:?} {config:?}");
    }
    for (arguments, variable) in [(&["-v"][..], Some("warn")), (&[], Some("debug"))] {
        let lines = told(arguments, variable, "").1;
        assert_eq!(lines.len(), expected_debug(), "{lines:#?}");
        let has = |words: &str| lines.iter().any(|line| line.contains(words));
        assert!(has("session 1: a command is refused: there is no object of this id in the session"), "{lines:#?}");
        assert!(has("bytes were read as model 2, of "), "{lines:#?}");
    }
    let runtime = runtime_folder();
    let loud = serve_command(runtime.path(), "loud").env("CONTACTD_LOG", "loud").output().unwrap();
    assert_eq!(loud.status.code(), Some(2));
    let sentence = String::from_utf8_lossy(&loud.stderr);
    assert_eq!(sentence, "CONTACTD_LOG: expected warn, info or debug, found \"loud\"\n");
    assert_eq!(contactd(runtime.path(), &["serve", "-v", "-q"]).status.code(), Some(2));
}

/// Seven lines as always, two models and a refusal.
fn expected_debug() -> usize {
    7 + 2 + 1
}

#[test]
fn a_log_that_nobody_reads_keeps_nobody_waiting() {
    let mut server = ServerProcess::start_as("unread", "", |command| {
        command.arg("-v").stderr(Stdio::piped());
    });
    let mut session = connect(&server);
    // A pipe has room for some hundred lines, and the server for a thousand.
    const LINES: usize = 5000;
    for _ in 0..LINES {
        assert_eq!(session.remove_object(99).unwrap_err().code(), Some(ErrorCode::UnknownObject));
    }
    let told = status(&server);
    assert_eq!(told["sessions"].as_array().map(Vec::len), Some(1));
    let mut lines = BufReader::new(server.stderr()).lines().map_while(Result::ok);
    let first = lines.next().expect("a line");
    assert!(first.starts_with("contactd: session 1 is opened"), "{first}");
    // Once somebody reads, what was left out is told as a number.
    let (send, left_out) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let mut read = 1;
        for line in lines {
            read += 1;
            if let Some(n) =
                line.strip_prefix("contactd: ").and_then(|l| l.strip_suffix(" lines were left out: nobody read them"))
            {
                let _ = send.send((read, n.parse::<usize>().expect("a number")));
            }
        }
    });
    let until = Instant::now() + PATIENCE;
    let (read, lost) = loop {
        let _ = session.remove_object(99);
        if let Ok(found) = left_out.recv_timeout(Duration::from_millis(10)) {
            break found;
        }
        assert!(Instant::now() < until, "nothing was told of what was left out");
    };
    assert!(lost > 0 && read + lost > LINES, "{read} read, {lost} left out");
    session.close().unwrap();
    assert!(server.stop().success());
    std::io::stdout().flush().unwrap();
}
