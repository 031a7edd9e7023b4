//! A server as a service: what its manager is told, and how it ends. The manager is the test's own socket.

use super::super::harness::scene::{Bits, bits, build, fill};
use super::super::harness::{PATIENCE, ServerProcess};
use super::{connect, contactd, printed, refused};
use contactd_client::proto::{Pose, PoseRecord};
use contactd_client::{Error, Object, Session, Transport};
use glam::DVec3;
use rustix::process::{Signal, kill_process};
use std::io::ErrorKind;
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::time::Duration;

/// Waits for a word of the server's.
fn told(manager: &UnixDatagram) -> String {
    let mut bytes = [0; 256];
    let n = manager.recv(&mut bytes).expect("a word of the server's");
    String::from_utf8_lossy(&bytes[..n]).into_owned()
}

/// A server with a service manager that wants to hear of it within so many microseconds.
fn service(name: &str, within: &str) -> (ServerProcess, UnixDatagram, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("notify");
    let manager = UnixDatagram::bind(&socket).unwrap();
    manager.set_read_timeout(Some(PATIENCE)).unwrap();
    let server = ServerProcess::start_as(name, "", |command| {
        command.env("NOTIFY_SOCKET", &socket).env("WATCHDOG_USEC", within).env_remove("WATCHDOG_PID");
    });
    (server, manager, folder)
}

#[test]
fn a_service_manager_hears_that_the_server_is_ready_goes_on_and_stops() {
    let (mut server, manager, _folder) = service("service", "200000");
    assert_eq!(told(&manager), "READY=1\n");
    let mut session = connect(&server);
    for _ in 0..3 {
        assert_eq!(told(&manager), "WATCHDOG=1\n");
    }
    let ids = build(&mut session, 2);
    fill(session.begin_step(ids.len()).unwrap(), &ids, 1, 5);
    session.finish(PATIENCE).unwrap();
    // A hangup is no end.
    kill_process(server.pid(), Signal::HUP).unwrap();
    assert_eq!(told(&manager), "WATCHDOG=1\n");
    assert!(server.stop().success());
    let last = std::iter::from_fn(|| Some(told(&manager))).find(|word| word != "WATCHDOG=1\n");
    assert_eq!(last.as_deref(), Some("STOPPING=1\n"));
    assert_eq!(server.remains(), Vec::<String>::new());
}

#[test]
fn a_manager_that_does_not_want_to_hear_of_the_loop_hears_nothing_of_it() {
    let (mut server, manager, _folder) = service("quiet", "");
    assert_eq!(told(&manager), "READY=1\n");
    manager.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
    let silence = manager.recv(&mut [0; 64]).unwrap_err();
    assert!(matches!(silence.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut), "{silence}");
    assert!(server.stop().success());
}

/// A manager whose socket is full, or that is gone, keeps neither the server from serving nor from ending.
#[test]
fn a_manager_that_does_not_listen_holds_up_nobody() {
    let (mut server, manager, _folder) = service("unheard", "40000");
    let mut session = connect(&server);
    let ids = build(&mut session, 2);
    let step = |session: &mut Session<_>, k| {
        fill(session.begin_step(ids.len()).unwrap(), &ids, k, 5);
        session.finish(PATIENCE).unwrap();
    };
    // A datagram socket has room for a few words only, at ten milliseconds each.
    std::thread::sleep(Duration::from_millis(600));
    (0..20).for_each(|k| step(&mut session, k));
    drop(manager);
    (20..40).for_each(|k| step(&mut session, k));
    assert!(server.stop().success());
    assert_eq!(server.remains(), Vec::<String>::new());
}

/// The step of a scene of many balls at one point in which the first one moves.
fn crowded<T: Transport>(session: &mut Session<T>, ids: &[u32], k: u32) {
    session.begin_step(1).unwrap()[0] = PoseRecord::end(ids[0], &Pose::at(DVec3::X * (0.01 * f64::from(k))));
}

fn crowd<T: Transport>(session: &mut Session<T>) -> Vec<u32> {
    let model = session.load_model("ball.csg", "sphere(r = 1);").unwrap().id;
    (0..400).map(|i| session.add_object(Object::new(&format!("o{i}"), model)).unwrap()).collect()
}

/// Whatever is asked for before SIGTERM is answered, with the bits that it has without: a step that runs on a thread of its own, and
/// one that has arrived and was not looked at.
#[test]
fn a_step_that_was_asked_for_before_the_end_is_answered() {
    let mut own = contactd::embedded(&contactd::ipc::ServerConfig::default()).unwrap();
    let ids = crowd(&mut own);
    let expected: Vec<Bits> = (1..3)
        .map(|k| {
            crowded(&mut own, &ids, k);
            own.finish(PATIENCE).map(|reply| bits(&reply)).unwrap()
        })
        .collect();
    for waits in [false, true] {
        let mut server = ServerProcess::start("drains", "");
        let mut session = connect(&server);
        assert_eq!(crowd(&mut session), ids);
        crowded(&mut session, &ids, 1);
        assert!(session.finish(PATIENCE).map(|reply| bits(&reply)).unwrap() == expected[0]);
        crowded(&mut session, &ids, 2);
        if waits {
            server.freeze();
            session.send().unwrap();
        } else {
            session.send().unwrap();
            server.wait_for(|status| status.steps == 2);
        }
        kill_process(server.pid(), Signal::TERM).unwrap();
        kill_process(server.pid(), Signal::CONT).unwrap();
        assert!(session.finish(PATIENCE).map(|reply| bits(&reply)).unwrap() == expected[1], "it waits: {waits}");
        assert!(server.stop().success());
        assert_eq!(session.remove_object(ids[0]).map(|_| ()).unwrap_err(), Error::ServerLost);
        assert_eq!(server.remains(), Vec::<String>::new());
    }
}

#[test]
fn a_client_that_goes_on_asking_keeps_no_server_from_ending() {
    let mut server = ServerProcess::start("asked", "");
    let address = server.address.clone();
    let asking = std::thread::spawn(move || {
        let mut session = Session::connect_to(address).unwrap();
        let ids = build(&mut session, 2);
        for k in 0.. {
            match session.begin_step(ids.len()) {
                Ok(records) => fill(records, &ids, k, 5),
                Err(e) => return e,
            }
            if let Err(e) = session.finish(PATIENCE) {
                return e;
            }
        }
        unreachable!("the numbers end never")
    });
    server.wait_for(|status| status.steps > 20);
    assert!(server.stop().success());
    // Its last request lies with a server that takes no more, or that has gone.
    let last = asking.join().unwrap();
    assert!([Error::ServerLost, Error::ReplyLost].contains(&last), "{last}");
    assert_eq!(server.remains(), Vec::<String>::new());
}

/// Every command has a page, which names its options; the scripts are each shell's own.
#[test]
fn pages_and_completions_tell_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("man/of");
    let files = printed(folder.path(), &["man", to.to_str().unwrap()]);
    let names: Vec<&str> = files.lines().map(|line| Path::new(line).file_name().unwrap().to_str().unwrap()).collect();
    for command in ["check", "serve", "status", "sessions", "sessions-end", "demo", "inspect", "completions", "man"] {
        let name = format!("contactd-{command}.1");
        assert!(names.contains(&name.as_str()), "{name} in {names:?}");
        let words = command.replace('-', " ");
        let help = printed_help(folder.path(), &words.split(' ').collect::<Vec<_>>());
        let page = std::fs::read_to_string(to.join(&name)).unwrap().replace("\\-", "-");
        let options = help.split_whitespace().filter(|word| word.starts_with("--"));
        let options: Vec<&str> = options.map(|word| word.trim_end_matches([',', '.', ':', ';', ')', ']'])).collect();
        assert!(options.len() > 1, "{command}: {options:?}");
        for option in options {
            assert!(page.contains(option), "{name} lacks {option}");
        }
    }
    let page = std::fs::read_to_string(to.join("contactd.1")).unwrap();
    assert!(page.starts_with(".ie") && page.contains(".TH contactd 1"), "{page}");
    for (shell, begins) in [("bash", "_contactd()"), ("zsh", "#compdef contactd"), ("fish", "# Print an optspec")] {
        let script = contactd(folder.path(), &["completions", shell]);
        let script = String::from_utf8(script.stdout).unwrap();
        assert!(script.starts_with(begins) && script.contains("certificate"), "{shell}: {script}");
    }
    std::fs::write(folder.path().join("file"), "").unwrap();
    let sentence = refused(folder.path(), &["man", folder.path().join("file").to_str().unwrap()]);
    assert!(sentence.contains("file: expected to write, found"), "{sentence}");
}

fn printed_help(runtime: &Path, command: &[&str]) -> String {
    let out = contactd(runtime, &[command, &["--help"]].concat());
    assert_eq!(out.status.code(), Some(0));
    String::from_utf8(out.stdout).unwrap()
}
