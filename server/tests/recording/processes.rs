//! Recordings of a server: by an operator, by a session, by its settings; and deaths on either side.

use super::harness::scene::{build, fill};
use super::harness::{PATIENCE, ServerProcess, runtime_folder};
use contactd::replay::{Replayed, replay};
use contactd_client::proto::ErrorCode;
use contactd_client::{Session, SharedMemory};
use rustix::process::{Pid, Signal, kill_process};
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

fn command(runtime: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_contactd"));
    command.args(arguments).env("XDG_RUNTIME_DIR", runtime);
    command
}

fn run(runtime: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let Output { status, stdout, stderr } = command(runtime, arguments).output().expect("the program");
    (status.code(), String::from_utf8_lossy(&stdout).into_owned() + &String::from_utf8_lossy(&stderr))
}

/// `contactd record`, once it records.
fn recorder(server: &ServerProcess, file: &Path) -> (Child, BufReader<std::process::ChildStdout>) {
    let arguments = ["record", server.address.name(), "-o", file.to_str().unwrap()];
    let mut child = command(server.runtime(), &arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program");
    let mut out = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    out.read_line(&mut line).unwrap();
    assert!(line.contains("are recorded until SIGINT"), "{line:?}");
    (child, out)
}

fn play(session: &mut Session<SharedMemory>, ids: &[u32], steps: std::ops::Range<u64>) {
    for k in steps {
        fill(session.begin_step(ids.len()).unwrap(), ids, k, 3);
        session.finish(PATIENCE).unwrap();
    }
}

fn repeated(file: &Path) -> Replayed {
    let replayed = replay(file, |_| {}).unwrap();
    assert_eq!(replayed.difference, None, "{}", replayed.text());
    replayed
}

/// Waits until a file can be read to its end.
fn completed(file: &Path) -> Replayed {
    let until = std::time::Instant::now() + PATIENCE;
    loop {
        match replay(file, |_| {}) {
            Ok(replayed) if !replayed.is_cut => return replayed,
            _ => assert!(std::time::Instant::now() < until, "it is never complete"),
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
}

#[test]
fn an_operator_records_a_server_and_replays_what_came_of_it() {
    let mut server = ServerProcess::start("taped", "");
    let folder = runtime_folder();
    let file = folder.path().join("run.mcap");
    let mut early = Session::connect_to(server.address.clone()).unwrap();
    let ids = build(&mut early, 3);
    play(&mut early, &ids, 0..10);
    let (mut child, mut out) = recorder(&server, &file);
    // A second one, and one of a session that is recorded already.
    let (code, said) =
        run(server.runtime(), &["record", "taped", "-o", folder.path().join("b.mcap").to_str().unwrap()]);
    assert!(code == Some(2) && said.contains("a recording runs already, into") && said.lines().count() == 1, "{said}");
    let said = early.record(folder.path().join("c.mcap")).unwrap_err();
    assert_eq!(said.code(), Some(ErrorCode::Recording));
    play(&mut early, &ids, 10..40);
    let mut late = Session::connect_to(server.address.clone()).unwrap();
    let late_ids = build(&mut late, 2);
    play(&mut late, &late_ids, 0..25);
    early.remove_object(ids[0]).unwrap();
    play(&mut early, &ids[1..], 40..50);
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
    let mut said = String::new();
    out.read_to_string(&mut said).unwrap();
    assert!(said.contains("65 steps, 0 left out"), "{said}");
    // No longer recorded, and it can be recorded again.
    play(&mut early, &ids[1..], 50..55);
    let own = folder.path().join("own.mcap");
    early.record(&own).unwrap();
    play(&mut early, &ids[1..], 55..60);
    let saved = early.save_step(folder.path().join("saved")).unwrap();
    assert_eq!(early.stop_recording().unwrap().steps, 5);
    assert_eq!(repeated(&own).steps, 5);
    let (code, said) = run(server.runtime(), &["check", saved.to_str().unwrap()]);
    assert!(matches!(code, Some(0 | 3)), "{said}");
    let (code, said) = run(server.runtime(), &["replay", file.to_str().unwrap()]);
    assert_eq!((code, said.as_str()), (Some(0), "65 steps of 2 sessions repeated, all bits equal\n"));
    let scene = folder.path().join("step-7");
    let (code, said) =
        run(server.runtime(), &["replay", file.to_str().unwrap(), "--step", "7", "--scene", scene.to_str().unwrap()]);
    assert!(code == Some(0) && said.trim_end().ends_with("step-7/scene.toml"), "{said}");
    let mut bytes = std::fs::read(&file).unwrap();
    let mut recording = contactd::recording::Recording::open(&file).unwrap();
    let step = std::iter::from_fn(|| recording.next_entry().unwrap())
        .filter_map(|entry| match entry {
            contactd::recording::Entry::Step(step) => Some(step),
            _ => None,
        })
        .nth(33)
        .unwrap();
    let mut message = Vec::new();
    step.write(&mut message);
    let at = bytes.windows(message.len()).position(|w| w == message).unwrap();
    bytes[at + 16 + 64 + 48] ^= 1;
    std::fs::write(&file, bytes).unwrap();
    let (code, said) = run(server.runtime(), &["replay", file.to_str().unwrap()]);
    assert!(code == Some(1) && said.starts_with("step 34 differs (step ") && said.contains("safe_time"), "{said}");
    drop((early, late));
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new());
}

#[test]
fn a_server_that_is_killed_leaves_a_file_that_reads_up_to_there() {
    let mut server = ServerProcess::start("fallen", "");
    let folder = runtime_folder();
    let file = folder.path().join("run.mcap");
    let (mut child, _out) = recorder(&server, &file);
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let ids = build(&mut session, 3);
    let (mut k, mut length) = (0, 0);
    // Until something of it is in the file, which is read when it has grown.
    loop {
        play(&mut session, &ids, k..k + 20);
        k += 20;
        let now = std::fs::metadata(&file).map_or(0, |m| m.len());
        if now != length && replay(&file, |_| {}).is_ok_and(|replayed| replayed.steps > 20) {
            break;
        }
        length = now;
    }
    server.kill();
    let replayed = repeated(&file);
    assert!(replayed.is_cut && replayed.steps > 20 && replayed.steps <= k, "{replayed:?}");
    assert_eq!(child.wait().unwrap().code(), Some(2));
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert!(said.contains("the server has ended;") && said.contains("can be read up to there"), "{said}");
}

#[test]
fn a_recorder_that_is_killed_ends_its_recording_and_nothing_else() {
    let mut server = ServerProcess::start("orphan", "");
    let folder = runtime_folder();
    let file = folder.path().join("run.mcap");
    let (mut child, _out) = recorder(&server, &file);
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let ids = build(&mut session, 2);
    play(&mut session, &ids, 0..30);
    child.kill().unwrap();
    child.wait().unwrap();
    let replayed = completed(&file);
    assert_eq!((replayed.difference, replayed.steps), (None, 30), "the server completes it");
    play(&mut session, &ids, 30..35);
    drop(session);
    assert!(server.stop().success());
}

#[test]
fn settings_record_each_start_into_a_file_of_its_own() {
    let folder = runtime_folder();
    let path = folder.path().to_str().unwrap().to_owned();
    let mut server = ServerProcess::start_as("always", "", |command| _ = command.args(["--record", &path]));
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let ids = build(&mut session, 2);
    play(&mut session, &ids, 0..30);
    drop(session);
    assert!(server.stop().success());
    let files: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().path()).collect();
    let [file] = files.as_slice() else { panic!("{files:?}") };
    assert!(file.file_name().unwrap().to_str().unwrap().starts_with("always-"));
    let replayed = repeated(file);
    assert_eq!((replayed.steps, replayed.is_cut), (30, false), "a server that stops completes it");
    let (code, said) = run(folder.path(), &["serve", "--record", file.to_str().unwrap()]);
    assert!(code == Some(2) && said.contains("expected a folder for recordings"), "{said}");
}
