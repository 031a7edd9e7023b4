//! Shared memory of a few megabytes, as in a container: what has no room is an error on either side, and nobody is killed.

use super::harness::ServerProcess;
use super::{PATIENCE, Process};
use contactd_client::proto::{Pose, PoseRecord};
use contactd_client::{Error, Object, Session};

/// Set in the process that has the small memory.
const INSIDE: &str = "CONTACTD_TEST_SMALL_MEMORY";

/// In a mount namespace of its own `/dev/shm` has four megabytes. A system that gives users no namespaces leaves this out, and so does
/// one that builds its programs in `/dev/shm`.
#[test]
fn a_reply_and_a_batch_without_room_are_errors_and_the_server_goes_on() {
    if std::env::var_os(INSIDE).is_some() {
        return inside();
    }
    let mount = "mount -t tmpfs -o size=4m none /dev/shm";
    let namespace = |script: String| {
        let mut process = Process::new("unshare");
        process.args(["--user", "--map-root-user", "--mount", "sh", "-c", &script]).env(INSIDE, "1");
        process
    };
    let program = std::env::current_exe().unwrap();
    let script = format!("{mount} && test -x '{}'", program.display());
    if !namespace(script).output().is_ok_and(|output| output.status.success()) {
        eprintln!("left out: this system gives no mount namespace in which its programs are");
        return;
    }
    let mut process = namespace(format!("{mount} && exec \"$0\" \"$@\""));
    let test = "memory::a_reply_and_a_batch_without_room_are_errors_and_the_server_goes_on";
    process.arg(program).args(["--exact", test, "--nocapture", "--test-threads=1"]);
    let output = process.output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && text.contains("1 passed"), "{text}");
}

fn inside() {
    let mut server = ServerProcess::start("small", "");
    let mut session = Session::connect_to(server.address.clone()).unwrap();
    let ball = session.load_model("ball", "sphere(r = 1);").unwrap().id;
    let apart = |i: i32| Object::new(&format!("ball {i}"), ball).at(Pose::at(glam::DVec3::X * f64::from(3 * i)));
    let ids: Vec<u32> = (0..300).map(|i| session.add_object(apart(i)).unwrap()).collect();
    let mut lost = None;
    for n in [10, 30, 100, 300] {
        // All in one place: each pair is a record of 128 bytes.
        for (slot, id) in session.begin_step(n).unwrap().iter_mut().zip(&ids) {
            *slot = PoseRecord::end(*id, &Pose::IDENTITY);
        }
        match session.finish(PATIENCE).map(|reply| reply.records().len()) {
            Ok(records) => assert_eq!(records, n * (n - 1) / 2),
            Err(error) => {
                assert_eq!(error, Error::ReplyLost, "of {n}");
                lost = Some(n);
                break;
            }
        }
    }
    assert_eq!(lost, Some(300), "5.7 MB of records were told in 4 MB");
    session.reconnect(PATIENCE).unwrap();
    let error = session.begin_step(100_000).map(|_| ()).unwrap_err().to_string();
    assert!(error.starts_with("shared memory is full: /dev/shm has no room for"), "{error}");
    for (slot, id) in session.begin_step(10).unwrap().iter_mut().zip(&ids) {
        *slot = PoseRecord::end(*id, &Pose::IDENTITY);
    }
    assert_eq!(
        session.finish(PATIENCE).unwrap().records().len(),
        100 * 99 / 2,
        "the state is that of before the lost step"
    );
    drop(session);
    assert!(server.stop().success());
}
