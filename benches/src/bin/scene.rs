//! `scene`: whole steps of many moving objects against rapier's collision pipeline.
//!
//! Objects stand jittered on a cubic grid whose density gives about three near pairs an object, none overlapping at
//! first; each circles around its place, 1 % of the grid's spacing a step, and spins. Nothing stops them, so later some
//! overlap: the table tells how many. Our step answers every pair continuously, with certified times;
//! rapier's looks at the end poses, with a prediction distance of what a body moves in a step. Both move every object
//! inside the timer, steps alternate, and each figure is the median over the steps (the worst beside). Both run on one
//! thread. `asked` counts our pairs that were searched or asked about; of all others earlier steps have proven that
//! they stay apart. Pairs of rapier's are those that its broad phase let through, with and without contacts.

use clap::{Parser, ValueEnum};
use contactd::import::{Facets, ImportError, Limits, import_csg};
use contactd::ipc::Embedded;
use contactd::octree::Model;
use contactd::solid::Shape;
use contactd::solid::primitive::{Cone, Cuboid, Cylinder, Sphere};
use contactd::world::{MeasuredModel, ObjectSpec, StepOptions, World};
use contactd_benches::facets::{Drilled, Outline};
use contactd_benches::options::Options;
use contactd_benches::race::{median, worst};
use contactd_benches::table::Table;
use contactd_benches::{peer, row};
use contactd_client::{Error, Object, Session};
use contactd_proto::contact_record::{CONTACT, OVERLAP, UNDECIDED};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Pose, PoseRecord, StepReply};
use contactd_tests::random_solids::Random;
use glam::{DVec2, DVec3};
use parry3d_f64::query::intersection_test;
use rapier3d_f64::prelude::{
    ActiveCollisionTypes, BroadPhaseBvh, ColliderBuilder, ColliderHandle, ColliderSet, CollisionPipeline,
    IslandManager, NarrowPhase, RigidBodySet, SharedShape,
};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Distance of neighbouring places.
const SPACING: f64 = 0.705;
/// Distance that an object goes in a step.
const STRIDE: f64 = 0.01 * SPACING;
/// Facets a circle of rapier's holes.
const FACETS: usize = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// Spheres, boxes, cylinders, cones.
    Primitives,
    /// Rings, drilled blocks, pins with heads.
    Parts,
}

/// A body for both sides: OpenSCAD's text and rapier's shape in the object's frame.
type Twin = (String, peer::Body);

fn primitive(text: &str, shape: impl Into<Shape>) -> Twin {
    (text.into(), peer::Body::of(&shape.into(), &Pose::IDENTITY))
}

fn drilled(text: &str, outline: Outline, hole: f64, half_height: f64) -> Twin {
    let part = Drilled { center: DVec3::ZERO, outline, hole, half_height };
    (text.into(), peer::Body::new(contactd_benches::facets::compound(&[part], FACETS)))
}

impl Kind {
    fn twins(self) -> Vec<Twin> {
        match self {
            Kind::Primitives => vec![
                primitive("sphere(r = 0.3);", Sphere { radius: 0.3 }),
                primitive("cube(size = [0.5, 0.4, 0.6], center = true);", Cuboid { half: DVec3::new(0.25, 0.2, 0.3) }),
                primitive("cube(size = [0.2, 0.2, 0.8], center = true);", Cuboid { half: DVec3::new(0.1, 0.1, 0.4) }),
                primitive(
                    "cylinder(h = 0.6, r1 = 0.25, r2 = 0.25, center = true);",
                    Cylinder { radius: 0.25, half_height: 0.3 },
                ),
                primitive(
                    "cylinder(h = 0.6, r1 = 0.3, r2 = 0, center = true);",
                    Cone { bottom: 0.3, top: 0.0, half_height: 0.3 },
                ),
            ],
            Kind::Parts => {
                let pin = [(0.12, 0.4), (0.25, 0.05)].map(|(radius, half_height)| {
                    let body = peer::Body::of(&Cylinder { radius, half_height }.into(), &Pose::IDENTITY);
                    (body.frame, body.shape)
                });
                vec![
                    drilled(
                        "difference() { cylinder(h = 0.3, r1 = 0.35, r2 = 0.35, center = true);
                         cylinder(h = 0.4, r1 = 0.2, r2 = 0.2, center = true); }",
                        Outline::Circle(0.35),
                        0.2,
                        0.15,
                    ),
                    drilled(
                        "difference() { cube(size = [0.6, 0.5, 0.4], center = true);
                         cylinder(h = 0.5, r1 = 0.15, r2 = 0.15, center = true); }",
                        Outline::Rectangle(DVec2::new(0.3, 0.25)),
                        0.15,
                        0.2,
                    ),
                    (
                        "union() { cylinder(h = 0.8, r1 = 0.12, r2 = 0.12, center = true);
                         cylinder(h = 0.1, r1 = 0.25, r2 = 0.25, center = true); }"
                            .into(),
                        peer::Body::new(SharedShape::compound(pin.to_vec())),
                    ),
                ]
            }
        }
    }
}

/// An object's path: around its place, turning.
struct Path {
    place: DVec3,
    arm: DVec3,
    swing: DVec3,
    turn: glam::DQuat,
    spin: DVec3,
}

impl Path {
    fn draw(r: &mut Random, place: DVec3) -> Self {
        let arm = r.direction() * 0.1 * SPACING;
        let swing = arm.cross(r.direction()).normalize_or(DVec3::X) * 0.1 * SPACING;
        let jitter = r.vector(0.15 * SPACING);
        Self { place: place + jitter, arm, swing, turn: r.rotation(), spin: r.vector(0.03) }
    }

    /// Where it stands after step `k`.
    fn at(&self, k: usize) -> Pose {
        let (s, c) = (0.1 * k as f64).sin_cos();
        let turned = (quat_of_rotation_vector(self.spin * k as f64) * self.turn).normalize();
        Pose::new(self.place + self.arm * c + self.swing * s, turned)
    }
}

/// Paths of `n` objects on the grid, drawn again where one would overlap its neighbours at the start.
fn paths(twins: &[Twin], n: usize) -> Vec<Path> {
    let mut r = Random::new(n as u64);
    let side = (n as f64).cbrt().ceil() as usize;
    let stands = |i: usize, path: &Path| {
        let body = &twins[i % twins.len()].1;
        (peer::pose(&path.at(0)) * body.frame, body.shape.clone())
    };
    let mut paths: Vec<Path> = Vec::with_capacity(n);
    for i in 0..n {
        let cell = |i: usize| [i % side, i / side % side, i / side / side];
        let here = cell(i);
        let is_near = |j: usize| cell(j).iter().zip(here).all(|(a, b)| a.abs_diff(b) <= 1);
        let near: Vec<usize> = (i.saturating_sub(side * side + side + 1)..i).filter(|j| is_near(*j)).collect();
        let place = SPACING * DVec3::from(here.map(|c| c as f64));
        let mut path = Path::draw(&mut r, place);
        for _ in 0..50 {
            let (at, shape) = stands(i, &path);
            let overlaps = |j: &usize| {
                let (other_at, other) = stands(*j, &paths[*j]);
                intersection_test(&at, &*shape, &other_at, &*other)
                    .expect("the pair of shapes is supported")
                    .intersecting
            };
            if !near.iter().any(overlaps) {
                break;
            }
            path = Path::draw(&mut r, place);
        }
        paths.push(path);
    }
    paths
}

/// rapier's side.
struct Rapier {
    pipeline: CollisionPipeline,
    islands: IslandManager,
    broad: BroadPhaseBvh,
    narrow: NarrowPhase,
    bodies: RigidBodySet,
    colliders: ColliderSet,
    objects: Vec<(ColliderHandle, rapier3d_f64::math::Pose)>,
}

impl Rapier {
    fn new(twins: &[Twin], paths: &[Path]) -> Self {
        let mut colliders = ColliderSet::new();
        let objects = paths.iter().enumerate().map(|(i, path)| {
            let body = &twins[i % twins.len()].1;
            let collider = ColliderBuilder::new(body.shape.clone())
                // Colliders without a body count as fixed; all are to be tested against each other.
                .active_collision_types(ActiveCollisionTypes::all())
                .position(peer::pose(&path.at(0)) * body.frame);
            (colliders.insert(collider), body.frame)
        });
        let objects = objects.collect();
        Self {
            pipeline: CollisionPipeline::new(),
            islands: IslandManager::new(),
            broad: BroadPhaseBvh::new(),
            narrow: NarrowPhase::new(),
            bodies: RigidBodySet::new(),
            colliders,
            objects,
        }
    }

    fn step(&mut self, poses: &[Pose]) {
        for ((handle, frame), pose) in self.objects.iter().zip(poses) {
            if let Some(collider) = self.colliders.get_mut(*handle) {
                collider.set_position(peer::pose(pose) * *frame);
            }
        }
        self.pipeline.step(
            STRIDE,
            &mut self.islands,
            &mut self.broad,
            &mut self.narrow,
            &mut self.bodies,
            &mut self.colliders,
            &(),
            &(),
        );
    }
}

/// Our side: a session with all objects in it, and their ids.
fn session(twins: &[Twin], paths: &[Path]) -> Result<(Session<Embedded>, Vec<u32>), Error> {
    let mut session = contactd::embedded(&contactd::ipc::ServerConfig::default())?;
    let mut models = Vec::new();
    for (k, (text, _)) in twins.iter().enumerate() {
        models.push(session.load_model(&format!("{k}.csg"), text)?.id);
    }
    let mut ids = Vec::with_capacity(paths.len());
    for (i, path) in paths.iter().enumerate() {
        ids.push(session.add_object(Object::new("object", models[i % models.len()]).at(path.at(0)))?);
    }
    Ok((session, ids))
}

/// What a scene of `n` objects cost, step by step.
#[derive(Default)]
struct Run {
    own: Vec<f64>,
    peer: Vec<f64>,
    pairs: Vec<f64>,
    peer_pairs: Vec<f64>,
    touching: Vec<f64>,
    cells: Vec<f64>,
    contacts: usize,
    overlaps: usize,
    undecided: usize,
}

fn run(kind: Kind, n: usize, steps: usize) -> Result<Run, Error> {
    let twins = kind.twins();
    let paths = paths(&twins, n);
    let mut rapier = Rapier::new(&twins, &paths);
    let (mut session, ids) = session(&twins, &paths)?;
    let mut run = Run::default();
    // Enough to ask about an undecided pair alone.
    let pair_of = |i: usize, k: usize| {
        let [from, to] = [k - 1, k].map(|k| paths[i].at(k));
        format!(
            "{} from {:?} {:?} to {:?} {:?}",
            twins[i % twins.len()].0,
            from.position,
            from.rotation,
            to.position,
            to.rotation
        )
    };
    // The first step is the warm-up of both: their broad phases are built, their buffers grown.
    for k in 1..=steps + 1 {
        let poses: Vec<Pose> = paths.iter().map(|p| p.at(k)).collect();
        let mut header = StepReply::default();
        let mut found = [0; 3];
        let mut own = || -> Result<f64, Error> {
            let from = Instant::now();
            for ((slot, id), pose) in session.begin_step(n)?.iter_mut().zip(&ids).zip(&poses) {
                *slot = PoseRecord::end(*id, pose);
            }
            let reply = session.finish(Duration::from_secs(3600))?;
            let took = from.elapsed().as_secs_f64();
            header = *reply.header();
            for c in reply.records().iter().filter(|c| c.status == UNDECIDED) {
                let [i, j] = [c.a, c.b].map(|id| ids.iter().position(|i| *i == id).unwrap_or(0));
                eprintln!("undecided in step {k}: {} | {}", pair_of(i, k), pair_of(j, k));
            }
            found = [CONTACT, OVERLAP, UNDECIDED].map(|s| reply.records().iter().filter(|c| c.status == s).count());
            Ok(took)
        };
        let mut peer = || {
            let from = Instant::now();
            rapier.step(&poses);
            from.elapsed().as_secs_f64()
        };
        let (own, peer) = if k % 2 == 0 {
            (own()?, peer())
        } else {
            let peer = peer();
            (own()?, peer)
        };
        if k == 1 {
            continue;
        }
        run.own.push(own);
        run.peer.push(peer);
        run.pairs.push(f64::from(header.pairs));
        run.peer_pairs.push(rapier.narrow.contact_pairs().count() as f64);
        run.touching.push(rapier.narrow.contact_pairs().filter(|p| p.has_any_active_contact()).count() as f64);
        run.cells.push(header.counters.cells as f64);
        run.contacts += found[0];
        run.overlaps += found[1];
        run.undecided += found[2];
    }
    Ok(run)
}

/// Steps ours alone, and tells what was asked and what it cost in each tenth of the steps.
fn profile(kind: Kind, n: usize, steps: usize) -> Result<(), Error> {
    let twins = kind.twins();
    let paths = paths(&twins, n);
    let (mut session, ids) = session(&twins, &paths)?;
    let (mut times, mut count) = (Vec::new(), [0usize; 4]);
    for k in 1..=steps {
        let poses: Vec<Pose> = paths.iter().map(|p| p.at(k)).collect();
        let from = Instant::now();
        for ((slot, id), pose) in session.begin_step(n)?.iter_mut().zip(&ids).zip(&poses) {
            *slot = PoseRecord::end(*id, pose);
        }
        let reply = session.finish(Duration::from_secs(3600))?;
        times.push(1e3 * from.elapsed().as_secs_f64());
        let of = |s: u8| reply.records().iter().filter(|c| c.status == s).count();
        let now = [reply.header().pairs as usize, of(CONTACT), of(OVERLAP), reply.header().counters.cells as usize];
        count.iter_mut().zip(now).for_each(|(sum, n)| *sum += n);
        if k % (steps / 10).max(1) == 0 {
            println!("to step {k}: {:.3} ms; asked, contacts, overlaps, cells: {count:?}", median(times.drain(..)));
            count = [0; 4];
        }
    }
    Ok(())
}

/// The cells of whole steps of `n` parts, the busiest thread's share of them, and the seconds they took, on so many threads.
fn shared(n: usize, steps: usize, threads: usize) -> Result<[f64; 3], Box<dyn std::error::Error>> {
    let twins = Kind::Parts.twins();
    let paths = paths(&twins, n);
    let parts = twins.iter().map(|(text, _)| {
        let imported = import_csg("part.csg", text, Facets::default(), &Limits::default())?;
        Ok(Arc::new(MeasuredModel::new(Arc::new(Model::new(imported.solid)))))
    });
    let parts = parts.collect::<Result<Vec<_>, ImportError>>()?;
    let mut world = World::new(n, n);
    for (i, path) in paths.iter().enumerate() {
        world.add_object(ObjectSpec::new(i as u32 + 1, &parts[i % parts.len()], path.at(0))).map_err(|e| e.detail)?;
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let mut sum = [0.0; 3];
    for k in 1..=steps + 1 {
        let poses = paths.iter().zip(1..).map(|(path, id)| PoseRecord::end(id, &path.at(k)));
        let poses: Vec<PoseRecord> = poses.collect();
        let from = Instant::now();
        let out =
            pool.install(|| world.step(&poses, &StepOptions::default()).cloned()).map_err(|e| format!("{e:?}"))?;
        // The first step is the warm-up.
        if k > 1 {
            let took = from.elapsed().as_secs_f64();
            let step = [out.counters.cells as f64, out.busiest_cells as f64, took];
            sum.iter_mut().zip(step).for_each(|(sum, x)| *sum += x);
        }
    }
    Ok([sum[0], sum[1] / sum[0], sum[2]])
}

/// Options of its own beside those of all benchmarks.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    options: Options,
    /// Only primitives, and this many of them, on one thread.
    #[arg(long, value_name = "NUMBER")]
    objects: Option<usize>,
    /// Steps of a scene.
    #[arg(long, value_name = "NUMBER")]
    steps: Option<usize>,
    /// Ours alone, for a profiler.
    #[arg(long, value_name = "KIND")]
    alone: Option<Kind>,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let Arguments { options, objects, steps, alone } = Arguments::parse();
    // Rapier's collision step runs on one thread here: so does ours.
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    if let Some(kind) = alone {
        return Ok(profile(kind, objects.unwrap_or(1_000), steps.unwrap_or(30))?);
    }
    let mut table = Table::new(&[
        "scene",
        "objects",
        "steps",
        "asked",
        "contacts",
        "overlaps",
        "undecided",
        "cells",
        "own_ms",
        "own_us_an_object",
        "rapier_pairs",
        "rapier_touching",
        "rapier_ms",
        "rapier_us_a_pair",
        "ratio_step",
        "ratio_step_worst",
    ]);
    let full: [&[usize]; 2] = [&[100, 1_000, 10_000, 100_000], &[100, 1_000, 10_000]];
    let quick: [&[usize]; 2] = [&[100, 1_000], &[100]];
    let only = objects.as_slice();
    let sizes = if only.is_empty() { options.pick(full, quick) } else { [only, &[]] };
    for (kind, sizes) in [Kind::Primitives, Kind::Parts].into_iter().zip(sizes) {
        for n in sizes {
            let steps = steps.unwrap_or(options.pick((30_000 / n).clamp(2, 30), 3));
            eprintln!("{kind:?}: {n} objects, {steps} steps");
            let run = run(kind, *n, steps)?;
            let over = |x: &[f64], y: &[f64]| -> Vec<f64> { x.iter().zip(y).map(|(x, y)| x / y).collect() };
            let of = |v: &[f64]| median(v.iter().copied());
            let peer_a_pair = over(&run.peer, &run.peer_pairs);
            table.push(row![
                format!("{kind:?}").to_lowercase(),
                *n,
                steps,
                of(&run.pairs),
                run.contacts as f64 / steps as f64,
                run.overlaps as f64 / steps as f64,
                run.undecided,
                of(&run.cells),
                1e3 * of(&run.own),
                1e6 * of(&run.own) / *n as f64,
                of(&run.peer_pairs),
                of(&run.touching),
                1e3 * of(&run.peer),
                1e6 * of(&peer_a_pair),
                of(&over(&run.own, &run.peer)),
                worst(over(&run.own, &run.peer)),
            ]);
        }
    }
    println!(
        "scene: a step, ours (continuous, certified) / rapier's collision pipeline (discrete); medians over the steps"
    );
    println!("contacts, overlaps: a step; parts are {FACETS} wedges a circle for rapier");
    table.publish("scene", &options.folder())?;
    if objects.is_none() {
        let (n, steps) = (options.pick(1_000, 100), steps.unwrap_or(options.pick(10, 3)));
        let (one, two) = (shared(n, steps, 1)?, shared(n, steps, 2)?);
        let mut table = Table::new(&["objects", "steps", "cells", "cells_two_threads", "busiest_share", "speed_up"]);
        table.push(row![n, steps, one[0], two[0], two[1], one[2] / two[2]]);
        println!("two threads share the pairs of {n} parts");
        table.publish("scene_threads", &options.folder())?;
    }
    println!(
        "harness check: parry's sphere-sphere to box-box is 1 : {:.1} (about 1 : 17 is right)",
        peer::sphere_to_box()
    );
    Ok(())
}
