//! `model`: what a model costs as it grows, from 1 to 10,000 primitives: time to load, memory, cells a query.
//!
//! A plate with one hole less than it has primitives, one a unit square: the local density is the same at every size. A
//! query lowers a peg, slightly tilted, into one of the holes. The peer is parry's `Compound` of the same plate at 16 wedges
//! a hole: loading is told against its construction, a query against its `cast_shapes`. Memory is what the allocator holds
//! more afterwards.
//!
//! A second table has the ways to load the same text: on one thread, on all, and from the disk cache, its file in the
//! system's memory. The ways take turns; ratios are of one turn, their median is told.

use clap::Parser;
use contactd::cache::{self, Cache, Key, Origin, Prepared};
use contactd::contact::{Outcome, Scratch, Status};
use contactd::import::{FORMATS, Facets, Limits, Source, import_csg};
use contactd::octree::Model;
use contactd::solid::primitive::Cylinder;
use contactd_benches::facets::{Drilled, Outline};
use contactd_benches::memory::{self, Counting};
use contactd_benches::options::Options;
use contactd_benches::race::{Plan, median, race, worst};
use contactd_benches::table::Table;
use contactd_benches::{facets, peer, queries, row};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use glam::{DVec2, DVec3, dvec3};
use std::fmt::Write as _;
use std::time::{Duration, Instant};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What something took to make.
struct Made<T> {
    value: T,
    seconds: f64,
    megabytes: f64,
}

/// Makes something `times` times; its median time, and the memory that the last one holds.
fn made<T>(times: usize, make: impl Fn() -> T) -> Made<T> {
    let mut seconds = Vec::new();
    loop {
        let before = memory::in_use();
        let from = Instant::now();
        let value = make();
        seconds.push(from.elapsed().as_secs_f64());
        let megabytes = (memory::in_use() - before) as f64 / 1e6;
        if seconds.len() == times {
            return Made { value, seconds: median(seconds), megabytes };
        }
    }
}

/// The plate's holes, row by row.
fn holes(count: usize) -> Vec<DVec3> {
    let side = (count as f64).sqrt().ceil() as usize;
    (0..count).map(|i| dvec3((i % side) as f64 + 0.5, (i / side) as f64 + 0.5, 0.0)).collect()
}

fn text(holes: &[DVec3]) -> String {
    let side = (holes.len() as f64).sqrt().ceil().max(1.0);
    let mut text = String::from("difference() {\n");
    let _ = writeln!(
        text,
        "\tmultmatrix([[1, 0, 0, {0}], [0, 1, 0, {0}], [0, 0, 1, 0], [0, 0, 0, 1]]) {{\n\t\tcube(size = [{1}, {1}, 0.4], center = true);\n\t}}",
        side / 2.0,
        side
    );
    for h in holes {
        let _ = writeln!(
            text,
            "\tmultmatrix([[1, 0, 0, {}], [0, 1, 0, {}], [0, 0, 1, 0], [0, 0, 0, 1]]) {{\n\t\tcylinder($fn = 0, $fa = 12, $fs = 2, h = 1, r1 = 0.25, r2 = 0.25, center = true);\n\t}}",
            h.x, h.y
        );
    }
    text + "}\n"
}

/// The peer's plate: a hole's unit square after the other; without holes, one square block.
fn wedges(holes: &[DVec3]) -> peer::Body {
    let block = |center: DVec3| Drilled {
        center,
        outline: Outline::Rectangle(DVec2::splat(0.5)),
        hole: 0.25,
        half_height: 0.2,
    };
    peer::Body::new(facets::compound(&holes.iter().map(|h| block(*h)).collect::<Vec<_>>(), 16))
}

/// How the same text is loaded in several ways, and that it makes the same model.
fn loading(options: &Options) -> std::io::Result<()> {
    let limits = Limits::default();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let (one, all) = (pool(1), pool(cores));
    let folder = tempfile::tempdir()?;
    let kept = Cache::open(folder.path(), cache::DEFAULT_BYTES).expect("a folder");
    let mut table = Table::new(&[
        "primitives",
        "nodes",
        "threads",
        "import_ms",
        "cold_ms",
        "parallel_ms",
        "first_ms",
        "cache_ms",
        "file_kB",
        "ratio_parallel",
        "ratio_preprocessing",
        "ratio_cache",
    ]);
    let sizes: &[usize] = options.pick(&[1, 10, 100, 1_000, 8_259, 30_000], &[10, 1_000, 8_259]);
    for &primitives in sizes {
        let text = text(&holes(primitives - 1));
        let prepare = |cache| {
            cache::prepare(cache, &Source::named("plate.csg", text.as_bytes()), Facets::Auto, &limits)
                .expect("a valid text")
        };
        let key = Key::of(&FORMATS[0], text.as_bytes(), Facets::Auto, &limits);
        let bytes = |p: &Prepared| cache::encode(&p.model, &p.notes).expect("a tree of few levels");
        let mut laps = Vec::new();
        let mut nodes = 0;
        for _ in 0..options.pick(15, 5) {
            let import = made(1, || import_csg("plate.csg", &text, Facets::Auto, &limits).expect("a valid text").solid);
            let [alone, shared] =
                [&one, &all].map(|pool| pool.install(|| made(1, || Model::new(import.value.clone()))));
            drop((alone.value, shared.value));
            let [cold, parallel] = [&one, &all].map(|pool| pool.install(|| made(1, || prepare(None))));
            let _ = std::fs::remove_file(kept.path(&key));
            let first = all.install(|| made(1, || prepare(Some(&kept))));
            let cached = one.install(|| made(1, || prepare(Some(&kept))));
            assert_eq!((first.value.origin, cached.value.origin), (Origin::Built, Origin::Kept));
            let expected = bytes(&cold.value);
            assert!([&parallel, &first, &cached].iter().all(|m| bytes(&m.value) == expected), "the same model");
            nodes = cached.value.model.octree.census().nodes();
            let [import, cold, parallel] = [import.seconds, cold.seconds, parallel.seconds];
            laps.push([import, cold, parallel, first.seconds, cached.seconds, shared.seconds / alone.seconds]);
        }
        let of = |value: fn(&[f64; 6]) -> f64| median(laps.iter().map(value));
        table.push(row![
            primitives,
            nodes,
            cores,
            of(|l| 1e3 * l[0]),
            of(|l| 1e3 * l[1]),
            of(|l| 1e3 * l[2]),
            of(|l| 1e3 * l[3]),
            of(|l| 1e3 * l[4]),
            std::fs::metadata(kept.path(&key))?.len() as f64 / 1e3,
            of(|l| l[2] / l[1]),
            of(|l| l[5]),
            of(|l| l[4] / l[1]),
        ]);
    }
    println!(
        "loading: text -> model on one thread (cold), on all (parallel), the same and kept (first), from the disk cache"
    );
    table.publish("model_loading", &options.folder())
}

fn main() -> std::io::Result<()> {
    let options = Options::parse();
    loading(&options)?;
    let strategies = options.strategies();
    let plan = Plan { blocks: options.pick(7, 3), least: Duration::from_micros(20) };
    let peg = Model::new(Recipe::cylinder(0.24, 0.5).build());
    let shaft = peer::Body::of(&Cylinder { radius: 0.24, half_height: 0.5 }.into(), &Pose::IDENTITY);
    let mut table = Table::new(&[
        "primitives",
        "text_kB",
        "load_ms",
        "load_us_a_primitive",
        "model_MB",
        "compound_ms",
        "compound_MB",
        "ratio_load",
        "ratio_memory",
        "queries",
        "met",
        "own_us",
        "parry_us",
        "ratio",
        "ratio_worst",
        "cells",
        "cells_worst",
        "node_pairs",
        "clauses",
    ]);
    let sizes: &[usize] = options.pick(&[2, 10, 100, 1_000, 3_000, 10_000], &[2, 10, 100, 1_000]);
    for &primitives in sizes {
        let holes = holes(primitives - 1);
        let text = text(&holes);
        let times = if primitives < 1_000 { 5 } else { 1 };
        let limits = Limits::default();
        let load = || Model::new(import_csg("plate.csg", &text, Facets::Auto, &limits).expect("a valid text").solid);
        let model = made(times, load);
        let compound = made(times, || wedges(&holes));
        let mut r = Random::new(11);
        let steps: Vec<Motion> = (0..options.pick(60, 8))
            .map(|_| {
                let over = holes[r.below(holes.len())] + DVec3::Z;
                let tilt = r.direction().with_z(0.0).normalize_or(DVec3::X) * r.within(0.03, 0.12);
                let start = Pose::new(over, quat_of_rotation_vector(tilt));
                Motion::turning(start, over - DVec3::Z * r.within(0.8, 1.0), DVec3::ZERO)
            })
            .collect();
        let rest = Motion::resting(Pose::IDENTITY);
        let own: Vec<queries::Question> =
            steps.iter().map(|m| queries::Question::new((&model.value, rest), (&peg, *m), strategies)).collect();
        let other: Vec<peer::Question> =
            steps.iter().map(|m| peer::Question::new(compound.value.clone(), &rest, shaft.clone(), m)).collect();
        let mut scratch = Scratch::default();
        let answers: Vec<Outcome> = own.iter().map(|q| q.ask(&mut scratch)).collect();
        let count = |of: fn(&Outcome) -> u64| answers.iter().map(move |o| of(o) as f64);
        let laps = race(plan, own.len(), |i| own[i].ask(&mut scratch), |i| other[i].ask());
        table.push(row![
            primitives,
            text.len() as f64 / 1e3,
            1e3 * model.seconds,
            1e6 * model.seconds / primitives as f64,
            model.megabytes,
            1e3 * compound.seconds,
            compound.megabytes,
            model.seconds / compound.seconds,
            model.megabytes / compound.megabytes,
            own.len(),
            answers.iter().filter(|o| o.status() == Status::Contact).count(),
            1e6 * median(laps.iter().map(|l| l.own)),
            1e6 * median(laps.iter().map(|l| l.peer)),
            median(laps.iter().map(|l| l.ratio)),
            worst(laps.iter().map(|l| l.ratio)),
            median(count(|o| o.counters.cells)),
            worst(count(|o| o.counters.cells)),
            median(count(|o| o.counters.node_pairs)),
            median(count(|o| o.counters.clauses)),
        ]);
    }
    println!(
        "model: a drilled plate as text -> model / parry's Compound at 16 wedges a hole; a tilted peg lowered into a hole"
    );
    table.publish("model", &options.folder())?;
    println!(
        "harness check: parry's sphere-sphere to box-box is 1 : {:.1} (about 1 : 17 is right)",
        peer::sphere_to_box()
    );
    Ok(())
}
