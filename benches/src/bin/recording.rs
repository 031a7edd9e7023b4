//! `recording`: what a step costs that is recorded, against the same step that is not.
//!
//! Two embedded sessions take the same steps in turn, one of them recorded into a file; which one goes first changes with every
//! step. Steps are taken back to back, which is faster than the recorder's thread writes, and one a millisecond, as physics loops
//! take them. Times are medians over the steps, the ratio is that of the medians. Then instructions (callgrind's) of a step on the
//! thread that takes it: the recorder's own thread is held up at its first write, so that none of its work is counted.

use clap::{Args, Parser, ValueEnum};
use contactd::ipc::{Embedded, ServerConfig};
use contactd_benches::callgrind;
use contactd_benches::race::median;
use contactd_benches::row;
use contactd_benches::table::Table;
use contactd_client::{Object, Session};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Pose, PoseRecord};
use glam::DVec3;
use std::error::Error;
use std::time::{Duration, Instant};

#[derive(Clone, Debug, Args)]
struct Probe {
    scene: Scene,
    steps: usize,
    /// It is recorded.
    #[arg(long)]
    recorded: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Scene {
    /// Pegs over a plate with holes, some of which hit it.
    Pegs,
    /// Many balls on their ways, far from each other.
    Balls,
    /// Gears, flanges and screws of real parts.
    Parts,
}

/// Steps of the shorter and of the longer run of a probe.
const STEPS: [usize; 2] = [20, 120];

const PLATE: &str = "difference() { cube(size = [80, 40, 4], center = true);
    multmatrix([[1,0,0,8],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) { cylinder(h = 9, r1 = 3, r2 = 3, center = true); }
    multmatrix([[1,0,0,-16],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) { cylinder(h = 9, r1 = 3, r2 = 3, center = true); } }";
const PEG: &str = "union() { cylinder(h = 10, r1 = 2.5, r2 = 2.5, center = true); sphere(r = 2.6); }";
const FLANGE: &str = include_str!("../../../server/models/flange.csg");
const BOLT: &str = include_str!("../../../server/models/bolt.csg");

/// A scene in a session: ids of what moves.
struct Stage {
    session: Session<Embedded>,
    ids: Vec<u32>,
}

impl Scene {
    fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }

    /// The text of what stands, the text of what moves, and how many move.
    fn models(self) -> (&'static str, &'static str, usize) {
        match self {
            Self::Pegs => (PLATE, PEG, 6),
            Self::Balls => ("cube(size = [400, 400, 1], center = true);", "sphere(r = 1);", 512),
            Self::Parts => (FLANGE, BOLT, 4),
        }
    }

    /// Where an object is after a step.
    fn pose(self, i: usize, k: usize) -> Pose {
        let (x, t) = (i as f64, 0.37 * k as f64 + i as f64);
        match self {
            Self::Balls => Pose::at(DVec3::new(4.0 * (i % 32) as f64 + t.cos(), 4.0 * (i / 32) as f64 + t.sin(), 9.0)),
            Self::Pegs | Self::Parts => {
                let low = if k.is_multiple_of(3) { -6.0 } else { 0.0 };
                let at = DVec3::new(12.0 * x - 28.0 + t.cos(), t.sin(), 10.0 + low + t.sin());
                Pose::new(at, quat_of_rotation_vector(DVec3::new(t.cos(), t.sin(), 0.0) * 0.2))
            }
        }
    }

    fn stage(self) -> Result<Stage, Box<dyn Error>> {
        let mut session = contactd::embedded(&ServerConfig::default())?;
        let (stands, moves, count) = self.models();
        let stands = session.load_model("stands.csg", stands)?.id;
        let moves = session.load_model("moves.csg", moves)?.id;
        session.add_object(Object::new("stands", stands).fixed())?;
        let add = |i| session.add_object(Object::new("moves", moves).at(self.pose(i, 0)));
        let ids = (0..count).map(add).collect::<Result<_, _>>()?;
        Ok(Stage { session, ids })
    }
}

impl Stage {
    fn step(&mut self, scene: Scene, k: usize) -> Result<(Duration, u32), Box<dyn Error>> {
        let Self { session, ids } = self;
        let began = Instant::now();
        for (i, slot) in session.begin_step(ids.len())?.iter_mut().enumerate() {
            *slot = PoseRecord::end(ids[i], &scene.pose(i, k));
        }
        let records = session.finish(Duration::from_secs(60))?.header().records;
        Ok((began.elapsed(), records))
    }
}

/// When the next step is taken.
#[derive(Clone, Copy, Debug)]
enum Pace {
    /// At once.
    BackToBack,
    /// Once a millisecond has passed since the last one was.
    Millisecond,
}

impl Pace {
    const fn name(self) -> &'static str {
        match self {
            Self::BackToBack => "back to back",
            Self::Millisecond => "1 kHz",
        }
    }

    /// Waits for it.
    fn wait(self, last: &mut Instant) {
        if let Self::Millisecond = self {
            std::thread::sleep((*last + Duration::from_millis(1)).saturating_duration_since(Instant::now()));
        }
        *last = Instant::now();
    }
}

/// Medians of both sessions' steps in microseconds, without and with, and records a step.
fn race(scene: Scene, pace: Pace, steps: usize) -> Result<([f64; 2], f64), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let [mut off, mut on] = [scene.stage()?, scene.stage()?];
    on.session.record(folder.path().join("run.mcap"))?;
    let (mut times, mut records) = ([Vec::new(), Vec::new()], 0);
    let mut last = Instant::now();
    for k in 1..=steps {
        let mut both = [(0, &mut off), (1, &mut on)];
        if k % 2 == 0 {
            both.reverse();
        }
        for (which, stage) in both {
            pace.wait(&mut last);
            let (took, told) = stage.step(scene, k)?;
            times[which].push(1e6 * took.as_secs_f64());
            records += told;
        }
    }
    let status = on.session.stop_recording()?;
    if status.steps + status.dropped != steps as u64 || !status.failure.is_empty() {
        return Err(format!("not all steps were recorded: {status:?}").into());
    }
    Ok((times.map(median), f64::from(records) / (2 * steps) as f64))
}

/// A disk that takes nothing.
struct Stuck;

impl std::io::Write for Stuck {
    fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
        loop {
            std::thread::sleep(Duration::from_secs(3600));
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Probe {
    fn run(&self) -> Result<(), Box<dyn Error>> {
        let mut stage = self.scene.stage()?;
        if self.recorded {
            stage.session.transport_mut().record_over("nothing", Box::new(Stuck)).map_err(|e| e.to_string())?;
            // Until its thread is stuck.
            std::thread::sleep(Duration::from_millis(500));
        }
        for k in 1..=self.steps {
            stage.step(self.scene, k)?;
        }
        // What its thread is stuck in has no end.
        std::process::exit(0)
    }
}

fn instructions(scene: Scene, recorded: bool) -> Result<f64, Box<dyn Error>> {
    callgrind::of_a_step(STEPS, |steps| {
        let mut arguments = vec!["probe".into(), scene.name(), steps.to_string()];
        arguments.extend(recorded.then(|| "--recorded".into()));
        arguments
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let callgrind::Arguments { options, task } = callgrind::Arguments::<Probe>::parse();
    if let Some(callgrind::Task::Probe(probe)) = task {
        return probe.run();
    }
    let steps = options.pick(4000, 300);
    let counts = callgrind::is_there();
    let mut table =
        Table::new(&["scene", "pace", "steps", "records", "us_off", "us_on", "ratio", "instr_off", "instr_on", "more"]);
    for scene in [Scene::Pegs, Scene::Balls, Scene::Parts] {
        let counted = if counts { [instructions(scene, false)?, instructions(scene, true)?] } else { [f64::NAN; 2] };
        for pace in [Pace::BackToBack, Pace::Millisecond] {
            let ([off, on], records) = race(scene, pace, steps)?;
            table.push(row![
                scene.name(),
                pace.name(),
                steps,
                records,
                off,
                on,
                on / off,
                counted[0],
                counted[1],
                counted[1] / counted[0]
            ]);
        }
    }
    println!("recording: a step that is recorded / the same step that is not");
    if !counts {
        println!("instructions: not counted, valgrind is not on the PATH");
    }
    table.publish("recording", &options.folder())?;
    Ok(())
}
