//! Round trips of a step as the client sees them: a batch of objects far apart, waiting by polling or as the server says.
//! `cargo run --release -p contactd-client --example latency -- [objects] [steps]`, with a server running.

use contactd_client::proto::{Pose, PoseRecord};
use contactd_client::{Object, Session};
use glam::DVec3;
use std::time::{Duration, Instant};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut numbers = std::env::args().skip(1).map(|a| a.parse::<usize>());
    let objects = numbers.next().transpose()?.unwrap_or(16);
    let steps = numbers.next().transpose()?.unwrap_or(2000);
    let mut session = Session::connect("default")?;
    let ball = session.load_model("ball.csg", "sphere(r = 1);")?.id;
    let at = |i: usize, k: usize| Pose::at(DVec3::new(10.0 * i as f64, (k % 2) as f64, 0.0));
    let mut ids = Vec::new();
    for i in 0..objects {
        ids.push(session.add_object(Object::new("ball", ball).at(at(i, 0)))?);
    }
    for polling in [true, false] {
        session.options.polling = polling;
        let mut times = Vec::with_capacity(steps);
        for k in 0..steps {
            let start = Instant::now();
            for (i, slot) in session.begin_step(objects)?.iter_mut().enumerate() {
                *slot = PoseRecord::end(ids[i], &at(i, k));
            }
            session.finish(Duration::from_secs(10))?;
            times.push(start.elapsed());
        }
        times.sort_unstable();
        let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
        let way = if polling { "polled" } else { "woken" };
        println!("{objects} objects, {way}: p50 {:?}, p99 {:?}, max {:?}", at(0.5), at(0.99), at(1.0));
    }
    Ok(())
}
