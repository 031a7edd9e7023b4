//! `bulk`: what a body costs a step of an embedded engine that moves very many of them far from each other.
//!
//! Spheres on a grid, 20 radii apart: no pair is ever near, and what is measured is what a body costs by itself. In turn
//! each: `moved` goes along and does not turn; `turned` goes and turns; `spun` goes and turns by a rotation vector; `placed`
//! goes from a start that is given too, two records a body; `halved` goes from the middle of its step before; `hurried` goes
//! farther than its neighbours are looked up for, so that every step looks them up anew; `kept` is sent where it stands;
//! `unnamed` is in no record, and rests. Two steps there and back alternate, so that bodies stay where they are.
//!
//! Times are medians over steps, of the step without the writing of its records, which are copied once. Instructions are counted by
//! callgrind, which runs this program anew with the subcommand `probe`: a scene stepped few and many times, the difference is
//! of steps alone; the copy of the records is in it.

use clap::{Args, Parser, ValueEnum};
use contactd::ipc::{Embedded, ServerConfig};
use contactd_benches::callgrind;
use contactd_benches::race::{median, quantile};
use contactd_benches::row;
use contactd_benches::table::Table;
use contactd_client::{Object, Session};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Pose, PoseRecord};
use glam::DVec3;
use std::error::Error;
use std::time::{Duration, Instant};

/// A step that takes longer has hung.
const PATIENCE: Duration = Duration::from_secs(60);
/// Steps before any counts: memory is there, and neighbours are known.
const WARM: usize = 10;

#[derive(Clone, Debug, Args)]
struct Probe {
    kind: Kind,
    bodies: usize,
    steps: usize,
}

/// What the bodies of a scene do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Kind {
    Moved,
    Turned,
    Spun,
    Placed,
    Halved,
    Hurried,
    Kept,
    Unnamed,
}

impl Kind {
    fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }

    /// Where body `i` of `n` stands after steps of parity `k`.
    fn pose(self, n: usize, i: usize, k: usize) -> Pose {
        let side = (n as f64).cbrt().ceil().max(1.0) as usize;
        let cell = DVec3::new((i % side) as f64, (i / side % side) as f64, (i / side / side) as f64);
        let way = match self {
            Self::Kept | Self::Unnamed => 0.0,
            Self::Hurried => 2.0,
            _ => 0.1,
        };
        let turn = match self {
            Self::Turned | Self::Placed => DVec3::new(0.3, -0.2 + 0.1 * k as f64, 1e-3 * (i % 100) as f64),
            _ => DVec3::ZERO,
        };
        Pose::new(10.0 * cell + way * k as f64 * DVec3::X, quat_of_rotation_vector(turn))
    }

    /// The records of a step to poses of parity `k`.
    fn batch(self, ids: &[u32], k: usize) -> Vec<PoseRecord> {
        let n = ids.len();
        let each = ids.iter().enumerate().map(|(i, id)| (i, *id, self.pose(n, i, k)));
        match self {
            Self::Unnamed => Vec::new(),
            Self::Spun => {
                let turn = |i: usize| DVec3::new(0.2, 0.1, 1e-3 * (i % 100) as f64) * (1.0 - 2.0 * k as f64);
                each.map(|(i, id, pose)| PoseRecord::turn(id, pose.position, turn(i))).collect()
            }
            Self::Placed => each
                .flat_map(|(i, id, pose)| [PoseRecord::start(id, &self.pose(n, i, 1 - k)), PoseRecord::end(id, &pose)])
                .collect(),
            _ => each.map(|(_, id, pose)| PoseRecord::end(id, &pose)).collect(),
        }
    }

    fn advance(self) -> f64 {
        if self == Self::Halved { 0.5 } else { 1.0 }
    }
}

/// A scene, and the batches that it is stepped by in turn.
struct Scene {
    session: Session<Embedded>,
    batches: [Vec<PoseRecord>; 2],
    advance: f64,
    step: usize,
}

impl Scene {
    fn new(kind: Kind, bodies: usize) -> Result<Self, Box<dyn Error>> {
        let mut session = contactd::embedded(&ServerConfig::default())?;
        let ball = session.load_model("ball.csg", "sphere(r = 0.5);")?.id;
        let add = |i| session.add_object(Object::new("ball", ball).at(kind.pose(bodies, i, 0)));
        let ids = (0..bodies).map(add).collect::<Result<Vec<_>, _>>()?;
        let batches = [kind.batch(&ids, 1), kind.batch(&ids, 0)];
        Ok(Self { session, batches, advance: kind.advance(), step: 0 })
    }

    /// One step; tells how long it took, its records once written, in seconds.
    fn step(&mut self) -> Result<f64, Box<dyn Error>> {
        let batch = &self.batches[self.step % 2];
        self.session.options.advance = self.advance;
        self.session.begin_step(batch.len())?.copy_from_slice(batch);
        let from = Instant::now();
        let reply = self.session.finish(PATIENCE)?;
        let took = from.elapsed().as_secs_f64();
        assert!(reply.records().is_empty(), "the bodies are far apart");
        self.step += 1;
        Ok(took)
    }

    fn steps(&mut self, n: usize) -> Result<Vec<f64>, Box<dyn Error>> {
        (0..n).map(|_| self.step()).collect()
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let callgrind::Arguments { options, task } = callgrind::Arguments::<Probe>::parse();
    if let Some(callgrind::Task::Probe(probe)) = task {
        Scene::new(probe.kind, probe.bodies)?.steps(probe.steps)?;
        return Ok(());
    }
    let counted = callgrind::is_there();
    if !counted {
        println!("instructions: not counted, valgrind is not on the PATH");
    }
    let mut table = Table::new(&["bodies", "kind", "steps", "ns_p10", "ns_a_body", "ns_p90", "instructions_a_body"]);
    let sizes: &[usize] = options.pick(&[4_096, 65_536], &[4_096]);
    for &bodies in sizes {
        for kind in Kind::value_variants() {
            let steps = options.pick(4_000_000, 400_000) / bodies;
            let mut scene = Scene::new(*kind, bodies)?;
            scene.steps(WARM)?;
            let times: Vec<f64> = scene.steps(steps)?.iter().map(|t| 1e9 * t / bodies as f64).collect();
            let run = |steps: usize| vec!["probe".into(), kind.name(), bodies.to_string(), steps.to_string()];
            // Of a scene of the smaller size: a body's own are the same in the larger one.
            let instructions = match counted && bodies == sizes[0] {
                true => callgrind::of_a_step([WARM, WARM + 20], run)? / bodies as f64,
                false => f64::NAN,
            };
            let of = |q: f64| quantile(times.iter().copied(), q);
            table.push(row![bodies, kind.name(), steps, of(0.1), median(times.iter().copied()), of(0.9), instructions]);
        }
    }
    println!("bulk: what a body far from all others costs a step");
    table.publish("bulk", &options.folder())?;
    Ok(())
}
