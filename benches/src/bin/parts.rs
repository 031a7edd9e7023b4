//! `parts`: solids with holes against parry's two ways to have them, `Compound` (convex wedges) and `TriMesh`.
//!
//! N: facets a circle; what is convex (peg, ball) stays exact for parry. The part of 40 − 40 primitives has no wedges: it is
//! sampled on a grid that gives a circle of radius 1/4 N corners (`facets::sampled`), up to N = 64. Our answer is the
//! certified one at 1e-9 of the size, the same for every N; the peer's error is its distance from that in time, where both
//! meet. Cases are drawn from a fixed seed.

use clap::Parser;
use contactd::contact::{Outcome, Scratch, Status};
use contactd::import::{Facets, Limits, read_model};
use contactd::octree::Model;
use contactd::solid::primitive::{Cylinder, Sphere};
use contactd_benches::facets::{Drilled, Outline, compound, mesh, sampled};
use contactd_benches::options::Options;
use contactd_benches::race::{Plan, median, race, worst};
use contactd_benches::table::Table;
use contactd_benches::{peer, queries, row};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use glam::{DVec2, DVec3, dvec3};
use parry3d_f64::shape::SharedShape;
use std::path::Path;
use std::time::{Duration, Instant};

/// Facets a circle of the full form.
const FACETS: [usize; 7] = [16, 32, 64, 128, 256, 512, 1024];

/// Options of this benchmark.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    options: Options,
    /// Only the classes whose name holds this.
    #[arg(long, default_value = "")]
    only: String,
}

/// A class of questions: b moves against a.
struct Class {
    name: &'static str,
    a: Model,
    b: Model,
    /// Motions of both.
    steps: Vec<[Motion; 2]>,
    /// The peer's bodies for a number of facets; `None`: not to be had.
    peers: Box<dyn Fn(usize) -> Option<[Faceted; 2]>>,
}

/// The peer's bodies, `Compound` or `TriMesh`.
struct Faceted {
    kind: &'static str,
    a: peer::Body,
    b: peer::Body,
    /// Pieces or triangles of a.
    pieces: usize,
    /// Seconds that a took to build.
    build: f64,
}

impl Faceted {
    fn new(build: impl FnOnce() -> SharedShape, b: &peer::Body) -> Self {
        let from = Instant::now();
        let shape = build();
        let (kind, pieces) = match (shape.as_compound(), shape.as_trimesh()) {
            (Some(c), _) => ("Compound", c.shapes().len()),
            (_, Some(m)) => ("TriMesh", m.indices().len()),
            _ => unreachable!("a faceted body is one of the two"),
        };
        Self { kind, a: peer::Body::new(shape), b: b.clone(), pieces, build: from.elapsed().as_secs_f64() }
    }
}

fn model(file: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/models").join(file).with_extension("csg");
    Model::new(read_model(&path, Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}")).solid)
}

/// Peers of a drilled solid and a convex one.
fn drilled(parts: Vec<Drilled>, other: peer::Body) -> Box<dyn Fn(usize) -> Option<[Faceted; 2]>> {
    Box::new(move |n| Some([Faceted::new(|| compound(&parts, n), &other), Faceted::new(|| mesh(&parts, n), &other)]))
}

fn rest() -> Motion {
    Motion::resting(Pose::IDENTITY)
}

/// From `at`, tilted, over a displacement and a turn.
fn moving(at: DVec3, tilt: DVec3, by: DVec3, spin: DVec3) -> Motion {
    Motion::turning(Pose::new(at, quat_of_rotation_vector(tilt)), at + by, spin)
}

fn sideways(r: &mut Random) -> DVec3 {
    let u = DVec2::from_angle(r.within(0.0, std::f64::consts::TAU));
    dvec3(u.x, u.y, 0.0)
}

fn peg_classes(cases: usize) -> Vec<Class> {
    let plate = || Model::new(Recipe::cuboid(0.5, 0.5, 0.1).minus(Recipe::cylinder(0.25, 0.5)).build());
    let peg = || Model::new(Recipe::cylinder(0.24, 0.5).build());
    let block =
        Drilled { center: DVec3::ZERO, outline: Outline::Rectangle(DVec2::splat(0.5)), hole: 0.25, half_height: 0.1 };
    let shaft = peer::Body::of(&Cylinder { radius: 0.24, half_height: 0.5 }.into(), &Pose::IDENTITY);
    let down = |r: &mut Random| dvec3(0.0, 0.0, -r.within(0.8, 1.0));
    type Draw = fn(&mut Random, DVec3) -> Motion;
    let draws: [(&'static str, Draw); 5] = [
        ("peg on rim", |r, v| moving(sideways(r) * r.within(0.02, 0.3) + DVec3::Z, DVec3::ZERO, v, DVec3::ZERO)),
        ("peg tilted", |r, v| {
            moving(sideways(r) * 0.005 + DVec3::Z, sideways(r) * r.within(0.03, 0.12), v, DVec3::ZERO)
        }),
        ("peg tilted, turning", |r, v| {
            moving(sideways(r) * 0.005 + DVec3::Z, sideways(r) * r.within(0.03, 0.12), v, r.vector(0.1))
        }),
        ("peg sideways", |r, _| {
            moving(sideways(r) * 0.003, DVec3::ZERO, sideways(r) * r.within(0.05, 0.1), DVec3::ZERO)
        }),
        ("peg sideways, turning", |r, _| {
            moving(sideways(r) * 0.003, DVec3::ZERO, sideways(r) * r.within(0.02, 0.1), r.vector(0.05))
        }),
    ];
    let mut classes: Vec<Class> = draws
        .into_iter()
        .map(|(name, draw)| {
            let mut r = Random::new(7);
            let steps = (0..cases).map(|_| {
                let v = down(&mut r);
                [rest(), draw(&mut r, v)]
            });
            Class { name, a: plate(), b: peg(), steps: steps.collect(), peers: drilled(vec![block], shaft.clone()) }
        })
        .collect();
    let mut r = Random::new(8);
    let pipe = Drilled { center: DVec3::ZERO, outline: Outline::Circle(0.35), hole: 0.25, half_height: 1.0 };
    classes.push(Class {
        name: "ball in pipe",
        a: Model::new(Recipe::cylinder(0.35, 1.0).minus(Recipe::cylinder(0.25, 1.5)).build()),
        b: Model::new(Recipe::sphere(0.2).build()),
        steps: (0..cases)
            .map(|_| {
                let at = sideways(&mut r) * r.within(0.0, 0.03) + DVec3::Z * r.within(-0.4, 0.4);
                let by = sideways(&mut r) * r.within(0.1, 0.2) + DVec3::Z * r.within(-0.3, 0.3);
                [rest(), moving(at, DVec3::ZERO, by, DVec3::ZERO)]
            })
            .collect(),
        peers: drilled(vec![pipe], peer::Body::of(&Sphere { radius: 0.2 }.into(), &Pose::IDENTITY)),
    });
    classes
}

/// 100 pegs of radius .24 over 100 holes of radius .25.
fn comb(cases: usize) -> Class {
    let mut r = Random::new(9);
    let steps = (0..cases).map(|_| {
        let at = sideways(&mut r) * r.within(0.0, 0.008) + DVec3::Z;
        // From nearly straight, where many pegs come close together, to where the plate's edge is met.
        let tilt = r.direction() * 10f64.powf(r.within(-3.0, -1.0));
        [rest(), moving(at + DVec3::Z * 5.5 * tilt.length(), tilt, DVec3::Z * -0.7, DVec3::ZERO)]
    });
    let steps = steps.collect();
    let b = model("comb_100");
    let pegs = b.solid.primitives.iter().map(|p| {
        let body = peer::Body::of(&p.shape, &p.frame);
        (body.frame, body.shape)
    });
    let pegs = peer::Body::new(SharedShape::compound(pegs.collect()));
    // Each hole's square reaches half way to its neighbours, the outermost ones to the plate's edge.
    let grid: Vec<f64> = (0..10).map(|i| i as f64 - 4.5).collect();
    let cells = grid.iter().flat_map(|x| grid.iter().map(move |y| dvec3(*x, *y, 0.0)));
    let parts: Vec<Drilled> = cells
        .map(|center| Drilled { center, outline: Outline::Rectangle(DVec2::splat(0.5)), hole: 0.25, half_height: 0.2 })
        .collect();
    let frame =
        [(5.125, 0.0, 0.125, 5.25), (-5.125, 0.0, 0.125, 5.25), (0.0, 5.125, 5.0, 0.125), (0.0, -5.125, 5.0, 0.125)];
    let peers = move |n: usize| {
        let wedges = || {
            let mut wedges = Vec::new();
            parts.iter().for_each(|p| p.wedges(n, &mut wedges));
            for (x, y, hx, hy) in frame {
                let at = peer::pose(&Pose::at(dvec3(x, y, 0.0)));
                wedges.push((at, SharedShape::cuboid(hx, hy, 0.2)));
            }
            SharedShape::compound(wedges)
        };
        // The mesh ends a quarter before the plate does: its outer walls are out of every peg's reach.
        Some([Faceted::new(wedges, &pegs), Faceted::new(|| mesh(&parts, n), &pegs)])
    };
    Class { name: "comb of 100 pegs", a: model("plate_100"), b, steps, peers: Box::new(peers) }
}

/// A part of 40 primitives minus 40 against its copy.
fn part(cases: usize, turning: bool) -> Class {
    let mut r = Random::new(10);
    let steps = (0..cases).map(|_| {
        let way = r.direction();
        let [p, q] = [r.rotation(), r.rotation()];
        let spin = |r: &mut Random| if turning { r.vector(0.5) } else { DVec3::ZERO };
        let by = -1.5 * way + r.vector(0.3);
        let a = Motion::turning(Pose::new(DVec3::ZERO, p), DVec3::ZERO, spin(&mut r));
        [a, Motion::turning(Pose::new(3.0 * way, q), 3.0 * way + by, spin(&mut r))]
    });
    let own = || model("part_40_40");
    let sampled_part = own();
    let peers = move |n: usize| {
        (n <= 64).then(|| {
            let from = Instant::now();
            let shapes = sampled(&sampled_part, std::f64::consts::TAU * 0.25 / n as f64);
            let build = from.elapsed().as_secs_f64();
            [shapes.0, shapes.1].map(|s| Faceted { build, ..Faceted::new(|| s.clone(), &peer::Body::new(s.clone())) })
        })
    };
    let name = if turning { "40-40 and copy, turning" } else { "40-40 and copy" };
    Class { name, a: own(), b: own(), steps: steps.collect(), peers: Box::new(peers) }
}

fn main() -> std::io::Result<()> {
    let Arguments { options, only } = Arguments::parse();
    let strategies = options.strategies();
    let plan = Plan { blocks: options.pick(5, 3), least: Duration::from_micros(20) };
    let cases = options.pick(50, 6);
    let mut classes = peg_classes(cases);
    classes.push(comb(options.pick(30, 3)));
    classes.push(part(options.pick(30, 3), false));
    if !options.quick {
        classes.push(part(30, true));
    }
    classes.retain(|class| class.name.contains(&only));
    let mut table = Table::new(&[
        "class",
        "peer",
        "N",
        "pieces",
        "build_ms",
        "cases",
        "met",
        "own_us",
        "peer_us",
        "ratio",
        "ratio_worst",
        "cells",
        "cells_worst",
        "peer_error",
        "peer_error_worst",
        "peer_wrong",
        "undecided",
    ]);
    // A row may take so long, with fewer cases if need be; a peer whose one answer takes longer gets no more facets.
    let budget = options.pick(2.0, 0.3);
    for class in &classes {
        let own: Vec<queries::Question> = class
            .steps
            .iter()
            .map(|[m, n]| queries::Question::new((&class.a, *m), (&class.b, *n), strategies))
            .collect();
        let mut scratch = Scratch::default();
        let answers: Vec<Outcome> = own.iter().map(|q| q.ask(&mut scratch)).collect();
        let cells = || answers.iter().map(|o| o.counters.cells as f64);
        let met = |o: &Outcome| o.status() == Status::Contact;
        let mut too_slow = [false; 2];
        for n in FACETS {
            if (options.quick && n > 16) || too_slow == [true; 2] {
                break;
            }
            let Some(peers) = (class.peers)(n) else { break };
            for (k, faceted) in peers.into_iter().enumerate() {
                if too_slow[k] {
                    continue;
                }
                let ask = |i: usize| {
                    let [m, n] = &class.steps[i];
                    peer::Question::new(faceted.a.clone(), m, faceted.b.clone(), n)
                };
                let from = Instant::now();
                ask(0).ask();
                let each = from.elapsed().as_secs_f64();
                let fit = (budget / (each * (plan.blocks + 2) as f64)) as usize;
                let count = fit.clamp(1, own.len());
                too_slow[k] = each > budget;
                let other: Vec<peer::Question> = (0..count).map(ask).collect();
                let theirs: Vec<Option<f64>> = other.iter().map(peer::Question::time).collect();
                let decided = || answers.iter().zip(&theirs).filter(|(o, _)| o.status() != Status::Undecided);
                let wrong = decided().filter(|(o, t)| met(o) != t.is_some()).count();
                let errors = || decided().filter(|(o, _)| met(o)).filter_map(|(o, t)| t.map(|t| (t - o.time()).abs()));
                let plan = Plan { blocks: if too_slow[k] { 1 } else { plan.blocks }, ..plan };
                let laps = race(plan, count, |i| own[i].ask(&mut scratch), |i| other[i].ask());
                table.push(row![
                    class.name,
                    faceted.kind,
                    n,
                    faceted.pieces,
                    1e3 * faceted.build,
                    count,
                    answers[..count].iter().filter(|o| met(o)).count(),
                    1e6 * median(laps.iter().map(|l| l.own)),
                    1e6 * median(laps.iter().map(|l| l.peer)),
                    median(laps.iter().map(|l| l.ratio)),
                    worst(laps.iter().map(|l| l.ratio)),
                    median(cells()),
                    worst(cells()),
                    median(errors()),
                    worst(errors()),
                    wrong,
                    answers.iter().filter(|o| o.status() == Status::Undecided).count(),
                ]);
            }
        }
    }
    println!(
        "parts: time a query, ours (certified, 1e-9 of the size) / parry's with N facets a circle; medians over the cases"
    );
    println!("peer_error: |parry's time - ours| in steps; peer_wrong: it meets where nothing does, or passes through");
    table.publish("parts", &options.folder())?;
    println!(
        "harness check: parry's sphere-sphere to box-box is 1 : {:.1} (about 1 : 17 is right)",
        peer::sphere_to_box()
    );
    Ok(())
}
