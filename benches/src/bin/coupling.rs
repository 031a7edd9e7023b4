//! `coupling`: what a step costs through another language's interface, against Rust: the same embedded engine, the same poses.
//!
//! Spheres far apart: what is measured is the step's way, not its geometry. Instructions are counted by callgrind, which runs this
//! program anew with the subcommand `probe`: scenes stepped few and many times, the difference is of steps alone. Times are of
//! blocks that alternate. The run fails where C takes more than 2 % more instructions than Rust.

use clap::{Args, Parser, ValueEnum};
use contactd::ipc::ServerConfig;
use contactd_benches::callgrind;
use contactd_benches::race::{Plan, race};
use contactd_benches::row;
use contactd_benches::table::Table;
use contactd_client::Object;
use contactd_proto::{Pose, PoseRecord};
use glam::DVec3;
use std::error::Error;
use std::time::Duration;

/// More than this through C is a failure.
const MOST_PERCENT: f64 = 2.0;
/// A step that takes longer has hung.
const PATIENCE: f64 = 60.0;

#[derive(Clone, Debug, Args)]
struct Probe {
    way: Way,
    poses: usize,
    steps: usize,
}

/// Through which interface a scene is stepped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Way {
    Rust,
    C,
}

impl Way {
    fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }

    /// A scene of `n` spheres far apart; each call is a step that moves all of them, and tells its records.
    fn scene(self, n: usize) -> Box<dyn FnMut() -> usize> {
        match self {
            Self::Rust => Box::new(through_rust(n)),
            Self::C => Box::new(through_c::scene(n)),
        }
    }
}

fn through_rust(n: usize) -> impl FnMut() -> usize {
    let mut session = contactd::embedded(&ServerConfig::default()).expect("a session");
    let ball = session.load_model("ball.csg", "sphere(r = 1);").expect("a ball").id;
    let ids: Vec<u32> =
        (0..n).map(|i| session.add_object(Object::new("ball", ball).at(at(i, 0))).expect("an object")).collect();
    let mut k = 0;
    move || {
        k += 1;
        fill(session.begin_step(n).expect("slots"), &ids, k);
        session.finish(Duration::from_secs_f64(PATIENCE)).expect("a reply").records().len()
    }
}

/// The calls of a C program, through the functions that it calls.
mod through_c {
    use super::{PATIENCE, at, fill};
    use contactd_capi::Session;
    use contactd_capi::abi::Pose;
    use contactd_capi::error::{OK, contactd_error_message};
    use contactd_capi::model::contactd_load_model;
    use contactd_capi::scene::{contactd_add_object, contactd_object_new};
    use contactd_capi::session::{contactd_close, contactd_embedded};
    use contactd_capi::step::{contactd_begin_step, contactd_finish};
    use std::ffi::CStr;
    use std::mem::MaybeUninit;
    use std::ptr::{null, null_mut};

    struct Handle(*mut Session);

    impl Handle {
        /// The session; a closure that asks for it keeps the whole handle, and with it the session open.
        fn session(&self) -> *mut Session {
            self.0
        }
    }

    impl Drop for Handle {
        fn drop(&mut self) {
            // SAFETY: a session that is open.
            unsafe { contactd_close(&mut self.0) };
        }
    }

    pub fn scene(n: usize) -> impl FnMut() -> usize {
        let mut handle = Handle(null_mut());
        let mut ball = 0;
        // SAFETY: variables of this function, strings, and the session that the first call opened.
        unsafe {
            check(contactd_embedded(null(), &mut handle.0));
            check(contactd_load_model(
                handle.session(),
                c"ball.csg".as_ptr(),
                c"sphere(r = 1);".as_ptr(),
                0,
                &mut ball,
            ));
        }
        let add = |i| {
            let mut object = contactd_object_new(c"ball".as_ptr(), ball);
            let (pose, mut id) = (at(i, 0), 0);
            object.pose = Pose { position: pose.position.to_array(), rotation: pose.rotation.to_array() };
            // SAFETY: an open session, a structure and a variable.
            check(unsafe { contactd_add_object(handle.session(), &object, &mut id) });
            id
        };
        let ids: Vec<u32> = (0..n).map(add).collect();
        let mut k = 0;
        move || {
            k += 1;
            let (mut poses, mut reply) = (null_mut(), MaybeUninit::uninit());
            // SAFETY: an open session and a variable.
            check(unsafe { contactd_begin_step(handle.session(), n, &mut poses) });
            // SAFETY: the call gave as many slots as were asked for.
            fill(unsafe { std::slice::from_raw_parts_mut(poses, n) }, &ids, k);
            // SAFETY: an open session and a variable.
            check(unsafe { contactd_finish(handle.session(), PATIENCE, reply.as_mut_ptr()) });
            // SAFETY: the call went well, so it has written the reply.
            unsafe { reply.assume_init() }.record_count
        }
    }

    fn check(code: i32) {
        if code != OK {
            // SAFETY: a string of the library.
            panic!("{}", unsafe { CStr::from_ptr(contactd_error_message()) }.to_string_lossy());
        }
    }
}

fn at(i: usize, k: usize) -> Pose {
    Pose::at(DVec3::new(10.0 * i as f64, (k % 2) as f64, 0.0))
}

fn fill(slots: &mut [PoseRecord], ids: &[u32], k: usize) {
    for (i, slot) in slots.iter_mut().enumerate() {
        *slot = PoseRecord::end(ids[i], &at(i, k));
    }
}

impl Probe {
    fn run(&self) {
        let mut step = self.way.scene(self.poses);
        let records: usize = (0..self.steps).map(|_| step()).sum();
        assert_eq!(records, 0, "spheres far apart");
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let callgrind::Arguments { options, task } = callgrind::Arguments::<Probe>::parse();
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    if let Some(callgrind::Task::Probe(probe)) = task {
        probe.run();
        return Ok(());
    }
    let counted = callgrind::is_there();
    if !counted {
        println!("instructions: not counted, valgrind is not on the PATH");
    }
    let plan = Plan { blocks: options.pick(31, 5), least: Duration::from_millis(options.pick(20, 5)) };
    let mut table =
        Table::new(&["way", "poses", "instructions_a_step", "more_percent", "us_a_step", "more_us", "time_ratio"]);
    let mut most = f64::NEG_INFINITY;
    // Small steps many times: what a hash table happens to do in one of them must not show.
    for (poses, steps) in [(16, [50, 1050]), (4096, options.pick([10, 50], [4, 12]))] {
        let count = |way: Way| {
            let run = |n: usize| vec!["probe".into(), way.name(), poses.to_string(), n.to_string()];
            if counted { callgrind::of_a_step(steps, run) } else { Ok(f64::NAN) }
        };
        let [of_rust, of_c] = [count(Way::Rust)?, count(Way::C)?];
        let (mut c, mut rust) = (Way::C.scene(poses), Way::Rust.scene(poses));
        let lap = race(plan, 1, |_| c(), |_| rust())[0];
        let percent = 100.0 * (of_c / of_rust - 1.0);
        most = most.max(percent);
        table.push(row!["rust", poses, of_rust, 0.0, 1e6 * lap.peer, 0.0, 1.0]);
        table.push(row!["c", poses, of_c, percent, 1e6 * lap.own, 1e6 * (lap.own - lap.peer), lap.ratio]);
    }
    println!("a step through each interface, embedded engine, spheres far apart");
    table.publish("coupling", &options.folder())?;
    if most > MOST_PERCENT {
        return Err(format!("C takes {most:.2} % more instructions than Rust; {MOST_PERCENT} % is the most").into());
    }
    Ok(())
}
