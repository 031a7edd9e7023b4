//! Through C on a server: the bits of an embedded Rust session over many steps, a server that goes and a successor.

mod support;

use contactd::ipc::{Server, ServerConfig};
use contactd_capi::error::{ERROR_NO_SERVER, ERROR_REPLY_LOST};
use contactd_capi::session::{contactd_connect, contactd_get_opened, contactd_reconnect};
use contactd_capi::step::{contactd_begin_step, contactd_finish, contactd_get_options, contactd_set_options};
use contactd_client::proto::names::Address;
use contactd_client::{Object, Session, Transport};
use contactd_proto::{ContactRecord, Pose, PoseRecord};
use glam::DVec3;
use std::ffi::CString;
use std::path::Path;
use std::ptr::null_mut;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use support::{BALL, Open, PLATE, done, end, out, records, refused, sentence, slots};

/// A server on a thread of this process.
struct Serving {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Serving {
    fn start(base: &Path, name: &str) -> Self {
        let address = Address::under(base, name).expect("an address");
        let stop = Arc::new(AtomicBool::new(false));
        let (ready, started) = std::sync::mpsc::channel();
        let end = stop.clone();
        let thread = std::thread::spawn(move || {
            let mut server = Server::start(&address, ServerConfig::default()).expect("a server");
            ready.send(()).expect("a test that waits");
            server.run(&end);
        });
        started.recv().expect("a server that starts");
        Self { stop, thread: Some(thread) }
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let thread = self.thread.take().expect("a thread");
        assert!(thread.join().is_ok(), "the server panicked");
    }
}

/// The same scene in Rust.
fn scene_of_rust<T: Transport>(session: &mut Session<T>) {
    let plate = session.load_model("plate.csg", PLATE.to_str().expect("text")).expect("a plate").id;
    let ball = session.load_model("ball.csg", BALL.to_str().expect("text")).expect("a ball").id;
    session.add_object(Object::new("plate", plate).fixed()).expect("an object");
    let at = Pose::at(DVec3::new(1.0, 0.0, 20.0));
    session.add_object(Object::new("ball", ball).at(at)).expect("an object");
}

/// The ball's pose at the end of step `k`: over the plate, beside it, through its hole's rim; every third turns it.
fn pose(ball: u32, k: u32) -> PoseRecord {
    let t = f64::from(k);
    let at = [9.0 * (0.7 * t).sin(), 7.0 * (1.1 * t).cos(), 9.0 + 6.0 * (2.3 * t).sin()];
    if k.is_multiple_of(3) { PoseRecord::turn(ball, at.into(), DVec3::new(0.1 * t, 0.2, 0.0)) } else { end(ball, at) }
}

/// Everything of a reply that must agree: all slots, but for the count of cells in details.
fn bits(slots: &[ContactRecord]) -> Vec<u8> {
    let cleared = slots.iter().map(|slot| match slot.as_detail() {
        Some(detail) if slot.b == 0 => contactd_proto::DetailSlot { cells: 0, ..*detail }.into(),
        _ => *slot,
    });
    cleared.flat_map(|slot: ContactRecord| bytemuck::bytes_of(&slot).to_vec()).collect()
}

/// Steps `session` and a Rust session of its own, and compares.
fn compare<T: Transport>(session: &Open, own: &mut Session<T>, ball: u32, steps: std::ops::Range<u32>) -> usize {
    // SAFETY: an open session and a variable.
    let mut options = out(|o| unsafe { contactd_get_options(session.0, o) });
    let mut contacts = 0;
    for k in steps {
        (options.advance, options.details) = (if k % 5 == 4 { 0.25 } else { 1.0 }, k % 2);
        // SAFETY: an open session and a structure.
        done(unsafe { contactd_set_options(session.0, &options) });
        (own.options.advance, own.options.details) = (options.advance, k % 2 == 1);
        let reply = session.step(&[pose(ball, k)]);
        own.begin_step(1).expect("a slot")[0] = pose(ball, k);
        let expected = own.finish(Duration::from_secs(60)).expect("a reply");
        assert_eq!(reply.header.safe_time.to_bits(), expected.safe_time().to_bits(), "step {k}");
        assert_eq!(reply.header.status, expected.header().status, "step {k}");
        assert_eq!(bits(slots(&reply)), bits(expected.slots()), "step {k}");
        contacts += records(&reply).len();
    }
    contacts
}

// One test alone in its process: it sets an environment variable.
#[test]
fn a_server_answers_c_with_the_bits_of_an_embedded_rust_session() {
    // In memory, as a user's runtime folder is, where that can be had.
    let folder = |place| tempfile::Builder::new().prefix("ctd").tempdir_in(place);
    let runtime = folder("/dev/shm").or_else(|_| folder("/tmp")).expect("a temporary folder");
    let base = runtime.path().join("contactd");
    // SAFETY: no other thread of this process looks at the environment.
    unsafe { std::env::set_var("XDG_RUNTIME_DIR", runtime.path()) };
    let name = CString::new("c").expect("a name");
    let mut session = Open(null_mut());
    // SAFETY: a string and a variable.
    refused(unsafe { contactd_connect(name.as_ptr(), &mut session.0) }, ERROR_NO_SERVER, "contactd serve --name c");
    assert!(session.0.is_null());

    let serving = Serving::start(&base, "c");
    // SAFETY: a string and a variable.
    done(unsafe { contactd_connect(name.as_ptr(), &mut session.0) });
    // SAFETY: an open session and a variable.
    let opened = || out(|o| unsafe { contactd_get_opened(session.0, o) });
    let first = opened();
    assert_ne!(first.epoch, 0);
    let (_, ball) = session.scene();
    let mut own = contactd::embedded(&ServerConfig::default()).expect("a session");
    scene_of_rust(&mut own);
    let embedded = Open::embedded();
    embedded.scene();
    let contacts = compare(&session, &mut own, ball, 0..60);
    assert!(contacts > 20, "{contacts}");

    // The server goes; a successor is told all, and the steps go on bit for bit.
    drop(serving);
    let _next = Serving::start(&base, "c");
    let mut poses = null_mut();
    // SAFETY: an open session and variables.
    let code = unsafe { contactd_begin_step(session.0, 0, &mut poses) };
    let mut reply = std::mem::MaybeUninit::uninit();
    // SAFETY: an open session and variables.
    let code = if code == 0 { unsafe { contactd_finish(session.0, 60.0, reply.as_mut_ptr()) } } else { code };
    // Its process is this one and lives on: what is seen is that nobody answers.
    assert_eq!(code, ERROR_REPLY_LOST, "{}", sentence());
    // SAFETY: an open session.
    done(unsafe { contactd_reconnect(session.0, 60.0) });
    assert_ne!(opened().epoch, first.epoch);
    compare(&session, &mut own, ball, 60..90);

    // Embedded through C: the same bits from the start.
    let mut own = contactd::embedded(&ServerConfig::default()).expect("a session");
    scene_of_rust(&mut own);
    compare(&embedded, &mut own, ball, 0..60);
}
