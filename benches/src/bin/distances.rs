//! `distances`: the distance of two convex bodies at an instant, against parry's.
//!
//! Pairs of seven kinds of primitives stand at random, apart by a thousandth to the whole of their size. Ours is a pair of proven bounds
//! no farther apart than `--tolerance` (in the pair's size), parry's a number. `unsettled` counts the answers whose bounds are farther
//! apart than that, `width_worst` is the largest difference of the bounds, `cells` the median of pairs of parts that were looked at,
//! `step_us` and `step_cells` are of the least distance over a step in which both move and turn, about as far as they are large;
//! `peer_below` and `peer_above` how far parry's number lies outside of our bounds at most; all lengths are in the pair's size.
//! `--export DIR` writes the questions and our answers for `benches/coal/distances.cpp`, which asks coal the same.

use clap::Parser;
use contactd::contact::PlacedModel;
use contactd::contact::distance::{DEFAULT_LIMIT, Distance, DistanceQuery, at_instant, over_step};
use contactd::math::random::Random;
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::Shape;
use contactd::solid::primitive::{Capsule, Cone, Cuboid, Cylinder, Ellipsoid, Polyhedron, Sphere};
use contactd_benches::options::Options;
use contactd_benches::peer::Body;
use contactd_benches::race::{Lap, Plan, median, quantile, race, worst};
use contactd_benches::row;
use contactd_benches::table::Table;
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use contactd_tests::scenes::Recipe;
use parry3d_f64::query;
use std::fmt::Write as _;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What this benchmark asks for beside the common options.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    options: Options,
    /// How far apart the bounds may be, in the pair's size.
    #[arg(long, value_name = "X", default_value_t = 1e-9)]
    tolerance: f64,
    /// This pair alone, as the table names it.
    #[arg(long, value_name = "NAME")]
    pair: Option<String>,
    /// Ours alone, for a profiler: so many times each case.
    #[arg(long, value_name = "TIMES")]
    alone: Option<usize>,
    /// Folder for the questions, for other libraries.
    #[arg(long, value_name = "DIR")]
    export: Option<PathBuf>,
}

const KINDS: [&str; 7] = ["ball", "box", "capsule", "cylinder", "cone", "ellipsoid", "hull"];
/// Corners that a random hull is of.
const CORNERS: usize = 24;

/// One question.
struct Case {
    shapes: [Shape; 2],
    models: [Model; 2],
    poses: [Pose; 2],
    motions: [Motion; 2],
    size: f64,
}

impl Case {
    fn new(kinds: [usize; 2], r: &mut Random) -> Self {
        let shapes = kinds.map(|k| shape(k, r));
        let models = [0, 1].map(|k| Model::new(Recipe::Leaf(shapes[k].clone(), Pose::IDENTITY).build()));
        let turn = |r: &mut Random| quat_of_rotation_vector(r.vector(2.0));
        let way = r.vector(1.0).normalize_or_zero() * (models[0].radius + models[1].radius) * r.within(0.4, 1.6);
        let place = r.vector(1.0);
        let poses = [Pose::new(place, turn(r)), Pose::new(place + way, turn(r))];
        let size = models[0].radius.max(models[1].radius);
        let motions = poses.map(|start| Motion { start, velocity: r.vector(size), spin: r.vector(1.0) });
        Self { shapes, models, poses, motions, size }
    }

    fn query(&self, tolerance: f64, motions: [Motion; 2]) -> DistanceQuery<'_> {
        let body = |k: usize| PlacedModel {
            model: &self.models[k],
            placed: Placed { place: Pose::IDENTITY, motion: motions[k] },
        };
        DistanceQuery { a: body(0), b: body(1), tolerance: tolerance * self.size, limit: DEFAULT_LIMIT }
    }

    fn ask(&self, tolerance: f64) -> Distance {
        at_instant(&self.query(tolerance, self.poses.map(Motion::resting)), 0.0)
    }

    fn ask_moving(&self, tolerance: f64) -> Distance {
        over_step(&self.query(tolerance, self.motions))
    }
}

fn shape(kind: usize, r: &mut Random) -> Shape {
    let mut length = || r.within(0.2, 1.0);
    match KINDS[kind] {
        "ball" => Sphere { radius: length() }.into(),
        "box" => Cuboid { half: glam::dvec3(length(), length(), length()) }.into(),
        "capsule" => Capsule { half: length(), radius: length() }.into(),
        "cylinder" => Cylinder { radius: length(), half_height: length() }.into(),
        "cone" => Cone { bottom: length(), top: 0.0, half_height: length() }.into(),
        "ellipsoid" => Ellipsoid { semi: glam::dvec3(length(), length(), length()) }.into(),
        _ => {
            let semi = glam::dvec3(length(), length(), length());
            let points = (0..CORNERS).map(|_| r.vector(1.0).normalize_or_zero() * semi).collect();
            Polyhedron::hull(points).expect("points in all directions").into()
        }
    }
}

fn main() -> std::io::Result<()> {
    let Arguments { options, tolerance, pair: only_pair, alone, export } = Arguments::parse();
    let plan = Plan { blocks: options.pick(9, 3), least: Duration::from_micros(options.pick(20, 10)) };
    let mut table = Table::new(&[
        "pair",
        "cases",
        "own_us",
        "own_p99",
        "parry_us",
        "ratio",
        "cells",
        "cells_worst",
        "step_us",
        "step_cells",
        "step_worst",
        "unsettled",
        "width_worst",
        "peer_below",
        "peer_above",
    ]);
    let mut r = Random(20);
    let mut written = String::from("a,b,pose_a,pose_b,size,lower,upper,own_us\n");
    for (i, j) in (0..KINDS.len()).flat_map(|i| (i..KINDS.len()).map(move |j| (i, j))) {
        let name = format!("{}-{}", KINDS[i], KINDS[j]);
        if only_pair.as_ref().is_some_and(|only| *only != name) {
            continue;
        }
        let mut cases: Vec<(Case, Distance)> = Vec::new();
        while cases.len() < options.pick(200, 20) {
            let case = Case::new([i, j], &mut r);
            let answer = case.ask(tolerance);
            if answer.lower > 1e-3 * case.size {
                cases.push((case, answer));
            }
        }
        if let Some(times) = alone {
            (0..times).flat_map(|_| &cases).for_each(|(case, _)| {
                black_box(case.ask(tolerance));
            });
            println!("{name}: {} questions", times * cases.len());
            continue;
        }
        // An ellipsoid is no shape of parry's.
        let has_peer = [i, j].iter().all(|k| KINDS[*k] != "ellipsoid");
        let theirs: Vec<Option<[Body; 2]>> = cases
            .iter()
            .map(|(case, _)| has_peer.then(|| [0, 1].map(|k| Body::of(&case.shapes[k], &Pose::IDENTITY))))
            .collect();
        let peer = |k: usize| {
            let (case, bodies) = (&cases[k].0, theirs[k].as_ref()?);
            let at = |i: usize| contactd_benches::peer::pose(&case.poses[i]) * bodies[i].frame;
            let told = query::distance(&at(0), &*bodies[0].shape, &at(1), &*bodies[1].shape);
            Some(told.expect("a supported pair").distance)
        };
        let laps: Vec<Lap> = race(plan, cases.len(), |k| cases[k].0.ask(tolerance), peer);
        let brief = Plan { blocks: 3, least: Duration::from_micros(10) };
        let moving: Vec<Lap> = race(brief, cases.len(), |k| cases[k].0.ask_moving(tolerance), |_| ());
        let off = |of: fn(&Distance, f64) -> f64| {
            let each = cases.iter().enumerate().filter_map(|(k, (case, own))| Some(of(own, peer(k)?) / case.size));
            if has_peer { worst(each).max(0.0) } else { f64::NAN }
        };
        let only = |x: f64| if has_peer { x } else { f64::NAN };
        table.push(row![
            name,
            cases.len(),
            1e6 * median(laps.iter().map(|l| l.own)),
            1e6 * quantile(laps.iter().map(|l| l.own), 0.99),
            only(1e6 * median(laps.iter().map(|l| l.peer))),
            only(median(laps.iter().map(|l| l.ratio))),
            median(cases.iter().map(|c| c.1.cells as f64)),
            worst(cases.iter().map(|c| c.1.cells as f64)),
            1e6 * median(moving.iter().map(|l| l.own)),
            median(cases.iter().map(|c| c.0.ask_moving(tolerance).cells as f64)),
            worst(cases.iter().map(|c| c.0.ask_moving(tolerance).cells as f64)),
            cases.iter().filter(|c| !c.1.is_settled).count(),
            worst(cases.iter().map(|(case, own)| (own.upper - own.lower) / case.size)),
            off(|own, peer| own.lower - peer),
            off(|own, peer| peer - own.upper),
        ]);
        for ((case, own), lap) in cases.iter().zip(&laps) {
            let [a, b] = [0, 1].map(|k| words(&case.shapes[k]));
            let [p, q] = case.poses.map(|pose| {
                let numbers = pose.position.to_array().into_iter().chain(pose.rotation.to_array());
                numbers.map(|x| x.to_string()).collect::<Vec<_>>().join(" ")
            });
            let (size, us) = (case.size, 1e6 * lap.own);
            writeln!(written, "{a},{b},{p},{q},{size},{},{},{us}", own.lower, own.upper).expect("text");
        }
    }
    if alone.is_some() {
        return Ok(());
    }
    println!("distances: two convex bodies at an instant, bounds to {tolerance:e} of their size, against parry");
    table.publish("distances", &options.folder())?;
    export.map_or(Ok(()), |folder| write(&folder, &written))
}

fn write(folder: &Path, text: &str) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    std::fs::write(folder.join("distances.csv"), text)
}

/// A shape in words: its kind, then its lengths; of a hull its corners.
fn words(shape: &Shape) -> String {
    let numbers =
        |kind: &str, numbers: &[f64]| numbers.iter().fold(kind.to_owned(), |text, x| text + " " + &x.to_string());
    match shape {
        Shape::Sphere(s) => numbers("ball", &[s.radius]),
        Shape::Cuboid(c) => numbers("box", &c.half.to_array()),
        Shape::Capsule(c) => numbers("capsule", &[c.half, c.radius]),
        Shape::Cylinder(c) => numbers("cylinder", &[c.half_height, c.radius]),
        Shape::Cone(c) => numbers("cone", &[c.half_height, c.bottom]),
        Shape::Ellipsoid(e) => numbers("ellipsoid", &e.semi.to_array()),
        Shape::Polyhedron(p) => {
            let corners: Vec<f64> = p.vertices.iter().flat_map(|c| c.to_array()).collect();
            numbers("hull", &corners)
        }
        other => unreachable!("{other:?} is not asked"),
    }
}
