//! `meshes`: triangle meshes that move against each other, boxes, balls and capsules, beside parry's `TriMesh`.
//!
//! Twenty meshes made by formulas (`contactd_tests::shells`), up to 100,000 triangles: turned parts, gears, threads, pipes, plates
//! with holes, stones as a scanner sees them, what a mesher makes of a field. Ours is the certified answer at 1e-9 of the size;
//! parry's is `cast_shapes` where nothing turns and `cast_shapes_nonlinear` where something does.
//!
//! Who is right is told by a judge that shares nothing with either: distances of triangles (`contactd_tests::triangles`) at the
//! times that both name, and at times before ours. `own_wrong`: the judge sees the bodies apart where we say that they meet, or
//! together before that. Of the peer's answers those are `early` at whose time the bodies are more than 1e-6 of the size apart,
//! those `late` that name a time beyond one at which they meet already, by more than 1e-6 of the size of motion, and those `missed`
//! that name none.
//!
//! Two further tables: pegs in a plate that is a mesh beside the same plate as a tree, and what a load takes.
//!
//! `--files DIR` takes the meshes of files in a folder, such as scans and links of robots, in place of those made by formulas: each
//! about the origin, and by a power of two as large as these. What is refused is told, and what is convex, which is no mesh to us.
//!
//! `--export DIR` writes the meshes and the questions for `benches/coal/meshes.py`, which asks coal the same.

use clap::Parser;
use contactd::contact::{Outcome, Scratch, Status};
use contactd::import::{Facets, Limits, read_model};
use contactd::octree::Model;
use contactd::solid::Shape;
use contactd::solid::primitive::{Capsule, Cuboid, Cylinder, Sphere};
use contactd_benches::memory::{self, Counting};
use contactd_benches::options::Options;
use contactd_benches::race::{Lap, Plan, median, race, worst};
use contactd_benches::table::Table;
use contactd_benches::{peer, queries, row};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use contactd_tests::meshes::{self, Mesh};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use contactd_tests::{shells, triangles};
use glam::{DVec3, dvec3};
use parry3d_f64::shape::{SharedShape, TriMesh};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Options of this benchmark.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    options: Options,
    /// Only the meshes whose name holds this.
    #[arg(long, default_value = "")]
    only: String,
    /// Folder with files of meshes, in place of those made by formulas.
    #[arg(long, value_name = "DIR")]
    files: Option<PathBuf>,
    /// Folder for the meshes (OFF) and the questions with our answers (scenes.csv), for other programs.
    #[arg(long, value_name = "DIR")]
    export: Option<PathBuf>,
}

/// A body in the terms of all three: ours, the peer's, the judge's.
struct Body {
    name: String,
    model: Model,
    peer: peer::Body,
    judge: triangles::Body,
    mesh: Option<Mesh>,
    shape: String,
    /// Radius of the ball about the origin that holds it.
    reach: f64,
}

impl Body {
    fn of_mesh(name: &str, mesh: Mesh) -> Self {
        let (points, corners) = (mesh.0.iter().map(|p| peer::vector(*p)).collect(), mesh.1.clone());
        Self {
            name: name.into(),
            model: Model::new(Recipe::of(meshes::solid(&mesh)).build()),
            peer: peer::Body::new(SharedShape::new(TriMesh::new(points, corners).expect("a mesh has triangles"))),
            judge: triangles::Body::mesh(&mesh),
            reach: mesh.0.iter().map(|p| p.length()).fold(0.0, f64::max),
            shape: format!("{name}.off"),
            mesh: Some(mesh),
        }
    }

    fn of_shape(name: &str, shape: impl Into<Shape>, judge: triangles::Body, text: String, reach: f64) -> Self {
        let shape = shape.into();
        let peer = peer::Body::of(&shape, &Pose::IDENTITY);
        let name = name.into();
        Self { name, model: Model::new(Recipe::of(shape).build()), peer, judge, mesh: None, shape: text, reach }
    }

    fn triangles(&self) -> usize {
        self.mesh.as_ref().map_or(0, |m| m.1.len())
    }
}

/// The meshes by name; the large ones are as large only in the full form.
fn all(quick: bool) -> Vec<(&'static str, Mesh)> {
    let n = |full: u32, quick_one: u32| if quick { quick_one } else { full };
    let part = |x: DVec3| {
        // A block with two bores and a groove, blended by nothing: a mesher cuts its edges off.
        let q = x.abs() - dvec3(0.8, 0.6, 0.35);
        let block = q.max(DVec3::ZERO).length() + q.max_element().min(0.0);
        let bore = |at: DVec3, r: f64| r - dvec3(x.x - at.x, x.y - at.y, 0.0).length();
        let ring = dvec3(x.x.hypot(x.y) - 0.45, x.z - 0.35, 0.0).length();
        block.max(bore(dvec3(0.5, 0.3, 0.0), 0.2)).max(bore(dvec3(-0.4, -0.2, 0.0), 0.15)).max(0.08 - ring)
    };
    let foam = |x: DVec3| {
        let y = x * 9.0;
        let gyroid = y.x.sin() * y.y.cos() + y.y.sin() * y.z.cos() + y.z.sin() * y.x.cos();
        (gyroid.abs() / 9.0 - 0.05).max(x.length() - 0.9)
    };
    let box_of = |half: f64| (DVec3::splat(-half), DVec3::splat(half));
    vec![
        ("flange", shells::flange(n(360, 48), 8)),
        ("fillet", shells::filleted(n(1024, 64), n(48, 12))),
        ("gear", shells::gear(24, n(32, 8), n(24, 4), 0.0)),
        ("helical gear", shells::gear(18, 16, n(40, 6), 0.5)),
        ("screw", shells::screw(n(96, 24), n(400, 60), 12.0)),
        ("nut", shells::nut(n(96, 48), n(120, 24), 5.0)),
        ("cup", shells::cup(n(128, 32), n(60, 10))),
        ("spring", shells::spring(n(800, 160), n(16, 8))),
        ("knot", shells::knot(n(500, 120), n(24, 8))),
        ("chain link", shells::chain_link(n(96, 32), n(32, 12))),
        ("robot arm", shells::arm(n(80, 20), n(64, 16))),
        ("elbow", shells::elbow(n(48, 12), n(64, 24))),
        ("plate with 16 holes", shells::perforated(4, 64, 0.6, 0.06)),
        ("sieve", shells::perforated(n(26, 8), n(24, 8), 0.7, 0.03)),
        ("sheet", shells::sheet(n(100, 20), 0.01)),
        ("stone", shells::stone(n(13, 8))),
        ("stone, scanned finely", shells::stone(n(91, 20))),
        ("torus", meshes::torus((0.8, 0.3), n(256, 32), n(192, 16))),
        (
            "milled part, sampled",
            shells::sampled(part, (dvec3(-0.8, -0.6, -0.35), dvec3(0.8, 0.6, 0.35)), n(30, 90) as f64 * 1e-3),
        ),
        ("foam, sampled", shells::sampled(foam, box_of(0.9), n(35, 120) as f64 * 1e-3)),
    ]
}

/// The meshes of the files in a folder, in the order of their names.
fn read(folder: &Path) -> std::io::Result<Vec<(String, Mesh)>> {
    let mut paths = std::fs::read_dir(folder)?.map(|e| Ok(e?.path())).collect::<std::io::Result<Vec<_>>>()?;
    paths.sort();
    let mut meshes = Vec::new();
    for path in paths {
        let import = match read_model(&path, Facets::Auto, &Limits::default()) {
            Ok(import) => import,
            Err(error) => {
                eprintln!("# {error}");
                continue;
            }
        };
        let Some(Shape::TriangleMesh(mesh)) = import.solid.whole().map(|p| &p.shape) else {
            eprintln!("# {}: no single mesh, or a convex one", path.display());
            continue;
        };
        let points = mesh.vertices();
        let (low, high) = points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |b, p| (b.0.min(*p), b.1.max(*p)));
        // Numbers of single precision stay as they are but for what they are from a middle of single precision.
        let middle = (0.5 * (low + high)).as_vec3().as_dvec3();
        let scale = (0.5 * (high - low).length()).log2().ceil().exp2().recip();
        let points = points.iter().map(|p| (*p - middle) * scale).collect();
        meshes
            .push((path.file_name().unwrap_or_default().to_string_lossy().into(), (points, mesh.triangles().to_vec())));
    }
    Ok(meshes)
}

/// What each mesh meets in turn.
fn others() -> Vec<Body> {
    let half = dvec3(0.35, 0.2, 0.15);
    let (long, radius) = (0.35, 0.12);
    vec![
        Body::of_shape("ball", Sphere { radius: 0.3 }, triangles::Body::ball(0.3), "ball 0.3".into(), 0.3),
        Body::of_shape(
            "box",
            Cuboid { half },
            triangles::Body::cuboid(half),
            format!("box {} {} {}", half.x, half.y, half.z),
            half.length(),
        ),
        Body::of_shape(
            "capsule",
            Capsule { half: long, radius },
            triangles::Body::Capsule(long, radius),
            format!("capsule {long} {radius}"),
            long + radius,
        ),
    ]
}

/// Motions of both: from outside towards the middle of the other one.
fn steps(r: &mut Random, reach: f64, turning: bool, count: usize) -> Vec<[Motion; 2]> {
    let mut one = || {
        let start = r.direction() * (reach + r.within(0.05, 0.3));
        let aim = r.vector(0.7);
        let mut spin = |most: f64| if turning { r.vector(most) } else { DVec3::ZERO };
        let [p, q] = [spin(1.0), spin(1.5)];
        let a = Motion { start: Pose::new(DVec3::ZERO, r.rotation()), velocity: DVec3::ZERO, spin: p };
        let velocity = (aim - start) * r.within(0.8, 1.4);
        [a, Motion { start: Pose::new(start, r.rotation()), velocity, spin: q }]
    };
    (0..count).map(|_| one()).collect()
}

/// How fast points of two bodies move against each other at most.
fn speed([a, b]: &[Motion; 2], reach: [f64; 2]) -> f64 {
    (a.velocity - b.velocity).length() + a.spin.length() * reach[0] + b.spin.length() * reach[1]
}

/// What the judge says of some answers.
#[derive(Default)]
struct Judged {
    own_wrong: usize,
    early: usize,
    late: usize,
    missed: usize,
    errors: Vec<f64>,
}

/// Times before a contact at which the judge looks.
const LOOKS: usize = 24;
/// How far apart bodies are that are said to meet, in sizes.
const TOUCHING: f64 = 1e-8;
/// The same where the peer says so.
const PEER: f64 = 1e-6;

impl Judged {
    fn judge(&mut self, [a, b]: [&Body; 2], step: &[Motion; 2], own: &Outcome, peer: Option<Option<f64>>) {
        let size = own.resolution * 1e9;
        let apart =
            |t: f64, most: f64| triangles::distance((&a.judge, &step[0].at(t)), (&b.judge, &step[1].at(t)), most);
        let met = own.status() == Status::Contact;
        let end = if met { own.time() } else { 1.0 };
        let speed = speed(step, [a.reach, b.reach]);
        let is_free = |t: &f64| apart(*t, 1e-12) > 0.0;
        let before = (0..LOOKS).map(|k| end * k as f64 / LOOKS as f64).chain([end - 1e-7 * size / speed]);
        let too_late = !before.filter(|t| *t >= 0.0).all(|t| is_free(&t));
        let too_early = met && apart(own.time(), 2.0 * TOUCHING * size) > TOUCHING * size;
        if too_late || too_early || own.status() == Status::Overlap {
            self.own_wrong += 1;
            println!("# own answer is wrong: {} against {}, {step:?}: {own:?}", a.name, b.name);
        }
        match peer {
            None => {}
            Some(None) => self.missed += usize::from(met),
            Some(Some(t)) => {
                self.early += usize::from(apart(t, 2.0 * PEER * size) > PEER * size && t < end + PEER * size / speed);
                self.late += usize::from(met && (t - own.time()) * speed > PEER * size);
                if met {
                    self.errors.push((t - own.time()).abs());
                }
            }
        }
    }
}

/// How many triangles two meshes that turn have at most for the peer to be asked.
const MOST: usize = 30_000;

/// Writes meshes and questions for other programs.
struct Export {
    folder: PathBuf,
    lines: String,
}

impl Export {
    fn to(folder: &Path) -> std::io::Result<Self> {
        std::fs::create_dir_all(folder)?;
        let motion = |k: &str| {
            ["px", "py", "pz", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "wx", "wy", "wz"]
                .map(|c| format!("{k}_{c}"))
                .join(",")
        };
        let lines = format!("a,b,{},{},status,time,own_us\n", motion("a"), motion("b"));
        Ok(Self { folder: folder.into(), lines })
    }

    fn mesh(&self, body: &Body) -> std::io::Result<()> {
        let Some((points, corners)) = &body.mesh else { return Ok(()) };
        let mut text = format!("OFF\n{} {} 0\n", points.len(), corners.len());
        // What is in single precision has fewer digits.
        let shown = |x: f64| if f64::from(x as f32) == x { (x as f32).to_string() } else { x.to_string() };
        for p in points {
            writeln!(text, "{} {} {}", shown(p.x), shown(p.y), shown(p.z)).expect("a string takes all");
        }
        corners.iter().for_each(|t| writeln!(text, "3 {} {} {}", t[0], t[1], t[2]).expect("a string takes all"));
        std::fs::write(self.folder.join(&body.shape), text)
    }

    fn question(&mut self, [a, b]: [&Body; 2], step: &[Motion; 2], own: &Outcome, seconds: f64) {
        let mut numbers = Vec::new();
        for m in step {
            numbers.extend(m.start.position.to_array());
            numbers.extend(m.start.rotation.to_array());
            numbers.extend(m.velocity.to_array());
            numbers.extend(m.spin.to_array());
        }
        let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
        let (status, time) = (own.status(), if own.status() == Status::Contact { own.time() } else { f64::NAN });
        let own_us = 1e6 * seconds;
        let [a, b] = [a, b].map(|body| format!("\"{}\"", body.shape));
        writeln!(self.lines, "{a},{b},{},{status:?},{time},{own_us}", numbers.join(",")).expect("a string takes all");
    }
}

/// One row: a mesh against another body, turning or not.
fn class(
    [a, b]: [&Body; 2],
    (turning, seed): (bool, u64),
    options: &Options,
    export: &mut Option<Export>,
    table: &mut Table,
) -> Vec<f64> {
    let mut r = Random::new(seed);
    let steps = steps(&mut r, a.reach + b.reach, turning, options.pick(10, 3));
    let strategies = options.strategies();
    let own: Vec<queries::Question> =
        steps.iter().map(|[m, n]| queries::Question::new((&a.model, *m), (&b.model, *n), strategies)).collect();
    let mut scratch = Scratch::default();
    let from = Instant::now();
    own[0].ask(&mut scratch);
    let first = from.elapsed().as_secs_f64();
    let answers: Vec<Outcome> = own.iter().map(|q| q.ask(&mut scratch)).collect();
    let other: Vec<peer::Question> =
        steps.iter().map(|[m, n]| peer::Question::new(a.peer.clone(), m, b.peer.clone(), n)).collect();
    // A row takes the peer so long, with fewer questions if need be; none where one may take it minutes.
    let heavy = turning && a.mesh.is_some() && b.mesh.is_some() && a.triangles() + b.triangles() > MOST;
    let mut left = if heavy { 0.0 } else { options.pick(3.0, 0.5) };
    let mut theirs = Vec::new();
    while left > 0.0 && theirs.len() < own.len() {
        let from = Instant::now();
        let time = other[theirs.len()].time();
        let seconds = from.elapsed().as_secs_f64();
        left -= seconds;
        theirs.push((time, seconds));
    }
    let count = theirs.len();
    let mut judged = Judged::default();
    for (i, answer) in answers.iter().enumerate() {
        judged.judge([a, b], &steps[i], answer, theirs.get(i).map(|t| t.0));
    }
    let laps = if theirs.iter().map(|t| t.1).sum::<f64>() < options.pick(0.5, 0.05) {
        let plan = Plan { blocks: options.pick(3, 2), least: Duration::from_micros(20) };
        race(plan, count, |i| own[i].ask(&mut scratch), |i| other[i].ask())
    } else {
        // Of what takes so long one call each is told.
        let mut once = |i: usize| {
            let from = Instant::now();
            std::hint::black_box(own[i].ask(&mut scratch));
            let (own, peer) = (from.elapsed().as_secs_f64(), theirs[i].1);
            Lap { own, peer, ratio: own / peer, least: [own, peer] }
        };
        (0..count).map(&mut once).collect()
    };
    let alone = own[count..].iter().map(|q| {
        let from = Instant::now();
        std::hint::black_box(q.ask(&mut scratch));
        from.elapsed().as_secs_f64()
    });
    let seconds: Vec<f64> = laps.iter().map(|l| l.own).chain(alone).collect();
    if let Some(export) = export {
        for i in 0..own.len() {
            export.question([a, b], &steps[i], &answers[i], seconds[i]);
        }
    }
    let cells = || answers.iter().map(|o| o.counters.cells as f64);
    let ratios: Vec<f64> = laps.iter().map(|l| l.ratio).collect();
    let turns = if turning { "turning" } else { "straight" };
    eprintln!(
        "# {} - {}, {turns}: {count} questions of both, ratio {:.3}",
        a.name,
        b.name,
        median(ratios.iter().copied())
    );
    table.push(row![
        a.name.as_str(),
        a.triangles(),
        b.name.as_str(),
        turns,
        own.len(),
        count,
        answers.iter().filter(|o| o.status() == Status::Contact).count(),
        1e3 * first,
        1e6 * median(seconds),
        1e6 * median(laps.iter().map(|l| l.peer)),
        median(ratios.iter().copied()),
        worst(ratios.iter().copied()),
        median(cells()),
        worst(cells()),
        answers.iter().filter(|o| o.status() == Status::Undecided).count(),
        judged.own_wrong,
        judged.early,
        judged.late,
        judged.missed,
        worst(judged.errors),
    ]);
    ratios
}

/// Pegs that are let down, tilted, into holes of a plate: ours of the plate as a mesh beside ours of the plate as cylinders cut out of
/// a box, and parry's of the mesh.
fn pegs(options: &Options) -> std::io::Result<()> {
    const COLUMNS: [&str; 13] = [
        "triangles",
        "motion",
        "cases",
        "met",
        "mesh_us",
        "csg_us",
        "ratio",
        "ratio_worst",
        "cells",
        "cells_worst",
        "csg_cells",
        "parry_us",
        "apart",
    ];
    let mut table = Table::new(&COLUMNS);
    let plan = Plan { blocks: options.pick(3, 2), least: Duration::from_micros(20) };
    let (share, half, around) = (0.6, 0.06, 24);
    for count in options.pick(vec![3, 8, 26], vec![3]) {
        let mesh = shells::perforated(count, around, share, half);
        let side = 1.0 / f64::from(count);
        let radius = share * side;
        let middles: Vec<DVec3> = (0..count * count)
            .map(|k| {
                dvec3(f64::from(2 * (k / count) + 1) * side - 1.0, f64::from(2 * (k % count) + 1) * side - 1.0, 0.0)
            })
            .collect();
        let hole = |at: &DVec3| Recipe::cylinder(radius, 2.0 * half).at(at.x, at.y, at.z);
        let block = Recipe::cuboid(1.0, 1.0, half);
        let exact = Model::new(middles.iter().map(hole).fold(block, Recipe::minus).build());
        let plate = Body::of_mesh("plate", mesh);
        let shape = Cylinder { radius: 0.95 * radius, half_height: 3.0 * radius };
        let peg = Model::new(Recipe::of(shape.clone()).build());
        let other = peer::Body::of(&shape.into(), &Pose::IDENTITY);
        for turning in [false, true] {
            let mut r = Random::new(31);
            let mut step = || {
                let around = std::f64::consts::TAU * r.within(0.0, 1.0);
                let middle = middles[r.below(middles.len())] + 0.02 * radius * r.vector(1.0).with_z(0.0);
                let tilt = r.within(0.03, 0.12) * dvec3(around.cos(), around.sin(), 0.0);
                let start = Pose::new(middle + DVec3::Z * (4.0 * radius + half), quat_of_rotation_vector(tilt));
                let spin = if turning { r.vector(0.1) } else { DVec3::ZERO };
                [Motion::resting(Pose::IDENTITY), Motion { start, velocity: DVec3::Z * -4.0 * radius, spin }]
            };
            let steps: Vec<[Motion; 2]> = (0..options.pick(20, 4)).map(|_| step()).collect();
            let ask =
                |model, m: &[Motion; 2]| queries::Question::new((model, m[0]), (&peg, m[1]), options.strategies());
            let own: Vec<queries::Question> = steps.iter().map(|m| ask(&plate.model, m)).collect();
            let csg: Vec<queries::Question> = steps.iter().map(|m| ask(&exact, m)).collect();
            let (mut scratch, mut spare) = (Scratch::default(), Scratch::default());
            let answers: Vec<[Outcome; 2]> =
                own.iter().zip(&csg).map(|(q, p)| [q.ask(&mut scratch), p.ask(&mut scratch)]).collect();
            let laps = race(plan, own.len(), |i| own[i].ask(&mut scratch), |i| csg[i].ask(&mut spare));
            let parry = steps.iter().map(|m| {
                let question = peer::Question::new(plate.peer.clone(), &m[0], other.clone(), &m[1]);
                let from = Instant::now();
                std::hint::black_box(question.ask());
                1e6 * from.elapsed().as_secs_f64()
            });
            let met = |o: &Outcome| o.status() == Status::Contact;
            let both = || answers.iter().filter(|o| met(&o[0]) && met(&o[1]));
            table.push(row![
                plate.triangles(),
                if turning { "turning" } else { "straight" },
                steps.len(),
                answers.iter().filter(|o| met(&o[0])).count(),
                1e6 * median(laps.iter().map(|l| l.own)),
                1e6 * median(laps.iter().map(|l| l.peer)),
                median(laps.iter().map(|l| l.ratio)),
                worst(laps.iter().map(|l| l.ratio)),
                median(answers.iter().map(|o| o[0].counters.cells as f64)),
                worst(answers.iter().map(|o| o[0].counters.cells as f64)),
                worst(answers.iter().map(|o| o[1].counters.cells as f64)),
                median(parry),
                worst(both().map(|o| (o[0].time() - o[1].time()).abs())),
            ]);
        }
    }
    println!(
        "pegs: a plate as a mesh (holes of {around} sides) beside the same as cylinders cut out of a box; apart: of the"
    );
    println!("two answers' times at most, in steps, which is what the facets make of it");
    table.publish("meshes_pegs", &options.folder())
}

/// What it takes to load a stone of a binary STL file: time, memory that stays, and the most on the way.
fn loads(options: &Options) -> std::io::Result<()> {
    const COLUMNS: [&str; 6] = ["triangles", "file_MB", "load_ms", "kept_MB", "kept_a_triangle", "most_a_triangle"];
    let mut table = Table::new(&COLUMNS);
    let folder = tempfile::tempdir()?;
    for n in options.pick(vec![29, 91, 288], vec![10, 29]) {
        let (points, corners) = shells::stone(n);
        let mut bytes = vec![0; 80];
        bytes.extend((corners.len() as u32).to_le_bytes());
        for t in &corners {
            bytes.extend([0; 12]);
            let numbers = t.iter().flat_map(|v| points[*v as usize].to_array());
            numbers.for_each(|x| bytes.extend((x as f32).to_le_bytes()));
            bytes.extend([0; 2]);
        }
        let file = folder.path().join("stone.stl");
        std::fs::write(&file, &bytes)?;
        let size = bytes.len() as f64 / 1e6;
        drop((points, bytes));
        let mut laps = Vec::new();
        let (mut kept, mut most) = (0, 0);
        for _ in 0..options.pick(5, 3) {
            let before = memory::forget_most();
            let from = Instant::now();
            let import = read_model(&file, Facets::Auto, &Limits::default()).expect("a closed mesh");
            let model = Model::new(import.solid);
            laps.push(1e3 * from.elapsed().as_secs_f64());
            kept = memory::in_use() - before;
            most = memory::most() - before;
            drop(model);
        }
        let each = |bytes: isize| bytes as f64 / corners.len() as f64;
        table.push(row![corners.len(), size, median(laps), kept as f64 / 1e6, each(kept), each(most)]);
    }
    println!(
        "loads: a binary STL file until it can be asked about; bytes a triangle that stay, and the most on the way"
    );
    table.publish("meshes_loads", &options.folder())
}

fn main() -> std::io::Result<()> {
    let Arguments { options, only, files, export } = Arguments::parse();
    let mut table = Table::new(&[
        "mesh",
        "triangles",
        "other",
        "motion",
        "cases",
        "peer_cases",
        "met",
        "first_ms",
        "own_us",
        "peer_us",
        "ratio",
        "ratio_worst",
        "cells",
        "cells_worst",
        "undecided",
        "own_wrong",
        "early",
        "late",
        "missed",
        "peer_off",
    ]);
    let bodies: Vec<Body> = match &files {
        Some(folder) => read(folder)?.into_iter().map(|(name, mesh)| Body::of_mesh(&name, mesh)).collect(),
        None => all(options.quick).into_iter().map(|(name, mesh)| Body::of_mesh(name, mesh)).collect(),
    };
    let others = others();
    let mut export = export.map(|folder| Export::to(&folder)).transpose()?;
    let mut ratios = [Vec::new(), Vec::new()];
    for (i, a) in bodies.iter().enumerate().filter(|(_, a)| a.name.contains(&only)) {
        if let Some(export) = &export {
            export.mesh(a)?;
        }
        // Each against a primitive, and against the next mesh of a number that shares nothing with the kinds' order.
        for b in [&others[i % others.len()], &bodies[(i + 7) % bodies.len()]] {
            // Two meshes take the peer seconds: of these the short form has few.
            if options.quick && b.mesh.is_some() && i % 10 != 1 {
                continue;
            }
            if let Some(export) = &export {
                export.mesh(b)?;
            }
            for turning in [false, true] {
                let seed = 100 + 2 * i as u64 + u64::from(turning);
                ratios[usize::from(turning)].extend(class([a, b], (turning, seed), &options, &mut export, &mut table));
            }
        }
    }
    println!(
        "meshes: time a query, ours (certified, 1e-9 of the size) / parry's on its TriMesh; medians over the cases"
    );
    println!(
        "first_ms: our first question about these models, which makes what it sees of them; peer_off: worst, in steps"
    );
    table.publish("meshes", &options.folder())?;
    let names = ["straight (cast_shapes)", "turning (cast_shapes_nonlinear)"];
    for (name, ratios) in names.iter().zip(&ratios).filter(|(_, ratios)| !ratios.is_empty()) {
        let ahead = ratios.iter().filter(|r| **r < 1.0).count();
        let (count, median) = (ratios.len(), median(ratios.iter().copied()));
        println!("{name}: median ratio {median:.3}, ours ahead in {ahead} of {count}");
    }
    let asked = |table: &str| if only.is_empty() { files.is_none() } else { table.contains(&only) };
    if asked("pegs") {
        pegs(&options)?;
    }
    if asked("loads") {
        loads(&options)?;
    }
    if let Some(export) = export {
        std::fs::write(export.folder.join("scenes.csv"), export.lines)?;
    }
    println!(
        "harness check: parry's sphere-sphere to box-box is 1 : {:.1} (about 1 : 17 is right)",
        peer::sphere_to_box()
    );
    Ok(())
}
