//! `golden`: one hash for all answers of a family, to be kept by every change that means to move no bit.
//!
//! Families: the cases under `tests/cases` (each scene whole and with its first contact only), the pairs of primitives, 10,000
//! random pairs of each class of `tests/src/scenes.rs`, 300 stepped scenes, and the demo's records. Hashed (BLAKE3) is every
//! bit of what a caller is told, -0 and 0 told apart; counters of work are not. Each run is a process of its own, one with
//! one thread and one with two, side by side; a family whose hashes differ between them is an error.
//!
//! Before a change: `golden --csv BEFORE`; after it: `golden --against BEFORE/golden.csv`, which tells the families that moved and
//! ends with status 1 if any did. A change that moves one says why.

use clap::Parser;
use contactd::check::Check;
use contactd::contact::{
    Contact, ContactPoint, Counters, Outcome, Overlap, Penetration, QueryOptions, Region, Scratch, Status, Verdict,
    earliest_contact,
};
use contactd::import::{Facets, Limits, read_scene};
use contactd::ipc::ServerConfig;
use contactd::octree::Model;
use contactd::world::{MeasuredModel, ObjectSpec, PairOutcome, StepOptions, StepOutcome, World};
use contactd_benches::options::Options;
use contactd_benches::row;
use contactd_benches::table::Table;
use contactd_proto::{Detect, InitialOverlap, PoseRecord, Report, Rule};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::{self, Recipe, Scene};
use contactd_tests::{engine, judge, primitive_pairs};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::sync::Arc;

/// What this tool asks for beside the common options.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    options: Options,
    /// An earlier run's `golden.csv`: families whose hash is another one are told, and the status is 1.
    #[arg(long, value_name = "FILE")]
    against: Option<PathBuf>,
    /// This family alone.
    #[arg(long, value_name = "NAME")]
    family: Option<String>,
    /// Writes the answers about random pairs, those of the stepped scenes and the demo's records to a file, a line each, and nothing else:
    /// of two builds `diff` tells which have moved.
    #[arg(long, value_name = "FILE")]
    answers: Option<PathBuf>,
    /// One run in this process, on the threads that RAYON_NUM_THREADS says, for the process that compares.
    #[arg(long, hide = true)]
    alone: bool,
}

/// Random pairs of a class, and its scenes.
type Class = (&'static str, fn(&mut Random) -> Scene);
/// The classes of `tests/src/scenes.rs`.
const CLASSES: [Class; 6] = [
    ("trees", scenes::trees),
    ("primitives", scenes::primitives),
    ("drilled", scenes::drilled),
    ("cavity", scenes::cavity),
    ("peg", scenes::peg),
    ("socket", scenes::socket),
];
/// Pairs of each class, and in the short form.
const PAIRS: [u64; 2] = [10_000, 150];
/// Stepped scenes, and in the short form; steps of each.
const STEPPED: [u64; 2] = [300, 12];
const STEPS: usize = 40;
/// Scenes of so many bodies each, in the order of their seeds: couples and heaps …
const BODIES: [usize; 4] = [2, 3, 3, 9];
/// … and, one in so many scenes, a crowd that is stepped by all threads.
const CROWD: (u64, usize) = (50, 64);

/// A hash over what is told; each value goes in as its bits.
#[derive(Default)]
struct Told {
    hash: blake3::Hasher,
    /// Answers by status: contact, clear, overlap, undecided.
    statuses: [u64; 4],
    /// The same as text, where it is asked for.
    lines: Option<String>,
}

/// A family's hash and what it is of.
#[derive(Clone, Debug, PartialEq)]
struct Golden {
    answers: u64,
    statuses: [u64; 4],
    hash: String,
}

impl Told {
    fn number(&mut self, x: f64) {
        self.word(x.to_bits());
    }

    fn word(&mut self, x: u64) {
        self.hash.update(&x.to_le_bytes());
    }

    fn vector(&mut self, v: DVec3) {
        v.to_array().into_iter().for_each(|x| self.number(x));
    }

    fn faces(&mut self, faces: [u32; 3]) {
        faces.into_iter().for_each(|f| self.word(f.into()));
    }

    /// Every field of an answer but its work, `apart`, a bound for the engine's own use, and the witness, which proves and tells nothing. A new field does not compile until
    /// it is decided which it is.
    fn outcome(&mut self, o: &Outcome) {
        let Outcome { verdict, touching, apart: _, resolution, depth, margin_time, past, counters: _ } = *o;
        let ([time_lower, time, time_upper], not_continued, point, penetration) = match verdict {
            Verdict::Clear { until, rest } => ([until, 1.0, 1.0], false, rest, None),
            Verdict::Contact(Contact { time_lower, time, time_upper, not_continued, witness: _, point }) => {
                ([time_lower, time, time_upper], not_continued, point, None)
            }
            Verdict::Overlap(Overlap { time, point, penetration }) => ([time; 3], false, point, penetration),
            Verdict::Undecided { time_lower } => ([time_lower, 1.0, 1.0], false, None, None),
        };
        let ContactPoint { point, normal, averaged_normal, separation, normal_speed, kind, extent, faces_a, faces_b } =
            point.unwrap_or_default();
        let Penetration { depth: penetration, point: deepest, direction } =
            penetration.unwrap_or(Penetration { depth: 0.0, point: DVec3::ZERO, direction: DVec3::ZERO });
        let status = verdict.status();
        self.statuses[status as usize] += 1;
        let flags = [touching, not_continued, averaged_normal, past];
        let words = [status as u64, kind as u64, extent as u64].into_iter().chain(flags.map(u64::from));
        words.for_each(|w| self.word(w));
        for x in [time_lower, time, time_upper, separation, normal_speed, resolution, depth, penetration, margin_time] {
            self.number(x);
        }
        [point, normal, deepest, direction].into_iter().for_each(|v| self.vector(v));
        self.faces(faces_a);
        self.faces(faces_b);
    }

    fn region(&mut self, r: &Region) {
        self.word(r.kind as u64);
        self.word(r.extent as u64);
        self.vector(r.normal);
        self.faces(r.faces_a);
        self.faces(r.faces_b);
        self.number(r.separation());
        self.word(r.points.len() as u64);
        for p in &r.points {
            self.vector(p.point);
            self.number(p.separation);
        }
    }

    /// A step's answer, without its work.
    fn step(&mut self, out: &StepOutcome) {
        self.number(out.safe_time);
        let flags = [out.truncated, out.undecided, out.contact].map(u64::from);
        flags.into_iter().chain([out.may_have_passed, out.pairs.len() as u64]).for_each(|w| self.word(w));
        for p in &out.pairs {
            let PairOutcome { a, b, outcome, regions_complete, .. } = p;
            [u64::from(*a), u64::from(*b), u64::from(*regions_complete)].into_iter().for_each(|w| self.word(w));
            self.outcome(outcome);
            let regions = out.regions_of(p);
            regions.iter().for_each(|r| self.region(r));
            if let Some(lines) = &mut self.lines {
                let outcome = Outcome { counters: Counters::default(), apart: 0.0, ..*outcome };
                *lines += &format!("{a} {b}: {outcome:?}, complete: {regions_complete}, {regions:?}\n");
            }
        }
    }

    /// Hash and statuses, to be put together with others in an order that does not depend on who was ready first.
    fn end(self) -> ([u8; 32], [u64; 4]) {
        (*self.hash.finalize().as_bytes(), self.statuses)
    }
}

/// The hash of a family from those of its parts in their order.
fn together(parts: Vec<([u8; 32], [u64; 4])>) -> Golden {
    let (mut all, mut statuses) = (blake3::Hasher::new(), [0; 4]);
    for (hash, of_part) in &parts {
        all.update(hash);
        statuses.iter_mut().zip(of_part).for_each(|(s, n)| *s += n);
    }
    Golden { answers: statuses.iter().sum(), statuses, hash: all.finalize().to_hex()[..32].to_string() }
}

/// Everything that can be asked about two models.
fn outcome(scene: &Scene) -> Outcome {
    let models = [&scene.a, &scene.b].map(|recipe| Model::new(recipe.build()));
    let query = engine::question_of(scene, [&models[0], &models[1]], QueryOptions::DEPTH);
    earliest_contact(&query, &mut Scratch::default())
}

/// One answer about two models.
fn pair(scene: &Scene) -> ([u8; 32], [u64; 4]) {
    let mut reported = Told::default();
    reported.outcome(&outcome(scene));
    reported.end()
}

/// `count` random pairs of a class.
fn pairs(class: fn(&mut Random) -> Scene, count: u64) -> Golden {
    together((0..count).into_par_iter().map(|seed| pair(&class(&mut Random::new(seed)))).collect())
}

/// The scenes of `tests/cases`.
fn cases() -> Result<Golden, Box<dyn Error>> {
    let mut folders: Vec<PathBuf> =
        std::fs::read_dir(judge::folder())?.map(|e| Ok(e?.path())).collect::<Result<_, std::io::Error>>()?;
    folders.retain(|f| f.join("scene.toml").is_file());
    folders.sort();
    let each = folders.par_iter().map(|f| case(f).map_err(|e| format!("{}: {e}", f.display())));
    Ok(together(each.collect::<Result<_, String>>()?))
}

fn case(folder: &Path) -> Result<([u8; 32], [u64; 4]), Box<dyn Error>> {
    let scene = read_scene(&folder.join("scene.toml"))?;
    let models = scene.load_models(Facets::Auto, &Limits::default())?;
    let models: Vec<Arc<Model>> = models.into_iter().map(|m| Arc::new(Model::new(m.solid))).collect();
    let mut reported = Told::default();
    for first in [false, true] {
        reported.step(Check::new(&scene, &models, None)?.step(first)?);
    }
    Ok(reported.end())
}

/// The rows of the 18 families of pairs of primitives.
fn known_pairs() -> Golden {
    let scenes: Vec<Scene> =
        primitive_pairs::FAMILIES.iter().flat_map(|f| primitive_pairs::rows(f)).map(|r| r.0).collect();
    together(scenes.par_iter().map(pair).collect())
}

/// A random scene, stepped by a world that remembers: bodies on their ways, disturbed, set back, taken out, at rest.
fn stepped(seed: u64, mut reported: Told) -> Result<Told, Box<dyn Error>> {
    let mut r = Random::new(seed ^ 0x5eed_0000);
    let (every, many) = CROWD;
    let count = if seed % every == every - 1 { many } else { BODIES[seed as usize % BODIES.len()] };
    let crowd = count > 3;
    // Bodies of a heap share few models, as those of real scenes do.
    let drawn: Vec<Scene> = (0..if crowd { 3 } else { 2 }).map(|_| scenes::any(&mut r)).collect();
    let recipes: Vec<&Recipe> = drawn.iter().flat_map(|s| [&s.a, &s.b]).collect();
    let parts: Vec<Arc<MeasuredModel>> =
        recipes.iter().map(|c| Arc::new(MeasuredModel::new(Arc::new(Model::new(c.build()))))).collect();
    let mut world = World::new(count, 2 * count);
    let side = (count as f64).cbrt().ceil();
    let mut ways = Vec::new();
    for i in 0..count {
        // A third body comes along as the second one of its own scene does.
        let which = if i == 2 && !crowd { 3 } else { i % parts.len() };
        let scene = &drawn[which / 2];
        let mut motion = if which % 2 == 0 { scene.motion_a } else { scene.motion_b };
        if crowd {
            // On a grid so narrow that neighbours meet on their ways.
            let cell = DVec3::new(i as f64 % side, (i as f64 / side).floor() % side, (i as f64 / side / side).floor());
            motion.start.position = 2.4 * cell + r.vector(0.2);
            motion.velocity = r.vector(2.5);
            motion.spin *= 0.5;
        }
        let group = ["default", "other"][i % 2].into();
        let spec = ObjectSpec::new(i as u32, &parts[which], motion.start);
        world.add_object(ObjectSpec { group, is_static: crowd && i % 7 == 3, ..spec })?;
        ways.push(motion);
    }
    world.set_rules(rules(&mut r))?;
    let options = StepOptions {
        clear: r.chance(0.3),
        first: r.chance(0.2),
        max_records: if r.chance(0.2) { 2 } else { 0 },
        cell_limit: if r.chance(0.2) { 50 } else { 500 },
        ..StepOptions::default()
    };
    let (stops, jitter) = (r.chance(0.3), if r.chance(0.5) { 0.0 } else { 10f64.powf(r.within(-9.0, -2.0)) });
    let mut advance = 1.0;
    for k in 1..=STEPS {
        let mut records = Vec::new();
        for (i, way) in ways.iter().enumerate().filter(|(i, _)| !(crowd && i % 7 == 3)) {
            if r.chance(0.08) {
                continue;
            }
            if r.chance(0.01) {
                records.push(PoseRecord::start(i as u32, &way.start));
                continue;
            }
            let mut pose = way.at(k as f64 / STEPS as f64);
            pose.position += r.vector(1.0) * jitter;
            records.push(PoseRecord::end(i as u32, &pose));
        }
        let out = world.step(&records, &StepOptions { advance, ..options })?;
        reported.step(out);
        advance = if stops { out.safe_time.clamp(0.0, 1.0) } else { 1.0 };
    }
    Ok(reported)
}

/// No rules, or those of two groups.
fn rules(r: &mut Random) -> Vec<Rule> {
    if r.chance(0.4) {
        return Vec::new();
    }
    let groups = [["default", "default"], ["default", "other"], ["other", "other"]];
    let each = groups.map(|g| {
        let detects = [Detect::Continuous, Detect::Continuous, Detect::Continuous, Detect::Discrete];
        let reports = [Report::Hit, Report::Time, Report::Contact, Report::Patch, Report::Patch];
        let overlaps = [InitialOverlap::Report, InitialOverlap::Report, InitialOverlap::IgnoreIfSeparating];
        Rule {
            detect: detects[r.below(4)],
            report: reports[r.below(5)],
            penetration: r.chance(0.3),
            margin: if r.chance(0.3) { 10f64.powf(r.within(-3.0, -0.7)) } else { 0.0 },
            initial_overlap: overlaps[r.below(3)],
            sensor: r.chance(0.1),
            ..Rule::new(g.map(String::from))
        }
    });
    each.into()
}

/// The records of the demo's acts, played on an engine in this process.
fn demo() -> Result<Golden, Box<dyn Error>> {
    let mut session = contactd::embedded(&ServerConfig::default())?;
    let run = contactd::demo::play(&mut session, |_, _| {})?;
    let mut reported = Told::default();
    [run.steps, run.steps_with_contact, run.undecided].into_iter().for_each(|n| reported.word(n as u64));
    for row in &run.rows {
        reported.word(row.step as u64);
        let overlap = row.record.status == contactd_proto::contact_record::OVERLAP;
        reported.statuses[if overlap { Status::Overlap } else { Status::Contact } as usize] += 1;
        reported.hash.update(bytemuck::bytes_of(&row.record));
    }
    Ok(together(vec![reported.end()]))
}

/// Writes the answers about the random pairs of the classes asked for, of the stepped scenes and of the demo, work left out, a line
/// each.
fn write_answers(arguments: &Arguments, file: &Path) -> Result<(), Box<dyn Error>> {
    let [count, scenes] = [PAIRS, STEPPED].map(|counts| counts[usize::from(arguments.options.quick)]);
    let wanted = |name: &str| arguments.family.as_deref().is_none_or(|only| only == name);
    let mut text = String::new();
    for (name, class) in CLASSES.into_iter().filter(|(name, _)| wanted(name)) {
        let line = |seed: u64| {
            let outcome = Outcome { counters: Counters::default(), ..outcome(&class(&mut Random::new(seed))) };
            format!("{name} {seed}: {outcome:?}\n")
        };
        text.extend((0..count).into_par_iter().map(line).collect::<Vec<_>>());
    }
    for seed in (0..scenes).filter(|_| wanted("stepped")) {
        let reported = stepped(seed, Told { lines: Some(String::new()), ..Told::default() })?;
        text.extend(reported.lines.unwrap_or_default().lines().map(|line| format!("stepped {seed}, {line}\n")));
    }
    if wanted("demo") {
        let run = contactd::demo::play(&mut contactd::embedded(&ServerConfig::default())?, |_, _| {})?;
        text.extend(run.rows.iter().map(|row| format!("demo {}: {:?} {:?}\n", row.step, row.names, row.record)));
    }
    std::fs::write(file, text).map_err(|e| format!("{}: {e}", file.display()).into())
}

/// The run of this process, a line for each family.
fn alone(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let pick = |[full, quick]: [u64; 2]| if arguments.options.quick { quick } else { full };
    let report = |name: &str, work: &dyn Fn() -> Result<Golden, Box<dyn Error>>| -> Result<(), Box<dyn Error>> {
        if arguments.family.as_deref().is_some_and(|only| only != name) {
            return Ok(());
        }
        let Golden { answers, statuses: [contact, clear, overlap, undecided], hash } = work()?;
        println!("{name},{answers},{contact},{clear},{overlap},{undecided},{hash}");
        Ok(())
    };
    report("cases", &cases)?;
    report("primitive_pairs", &|| Ok(known_pairs()))?;
    for (name, class) in CLASSES {
        report(name, &|| Ok(pairs(class, pick(PAIRS))))?;
    }
    report("stepped", &|| {
        let each = (0..pick(STEPPED)).into_par_iter().map(|s| match stepped(s, Told::default()) {
            Ok(reported) => Ok(reported.end()),
            Err(e) => Err(format!("stepped {s}: {e}")),
        });
        Ok(together(each.collect::<Result<_, String>>()?))
    })?;
    report("demo", &demo)
}

/// A family of a run, or of an earlier one's file.
fn read(text: &str) -> Result<BTreeMap<String, Golden>, String> {
    let mut found = BTreeMap::new();
    for line in text.lines().filter(|l| !l.starts_with("family,")) {
        let cells: Vec<&str> = line.split(',').collect();
        let [name, numbers @ .., hash] = &cells[..] else { return Err(format!("expected a family, found {line:?}")) };
        let numbers: Vec<u64> =
            numbers.iter().map(|n| n.parse().map_err(|e| format!("{line:?}: {e}"))).collect::<Result<_, _>>()?;
        let [answers, statuses @ ..] = &numbers[..] else { return Err(format!("expected counts, found {line:?}")) };
        let statuses = statuses.try_into().map_err(|_| format!("expected five counts, found {line:?}"))?;
        found.insert((*name).to_owned(), Golden { answers: *answers, statuses, hash: (*hash).to_owned() });
    }
    Ok(found)
}

fn compare(arguments: &Arguments) -> Result<bool, Box<dyn Error>> {
    let start = |threads: &str| {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("--alone").env("RAYON_NUM_THREADS", threads).stdout(Stdio::piped());
        command.args(arguments.options.quick.then_some("--quick"));
        command.args(arguments.family.iter().flat_map(|f| ["--family", f.as_str()]));
        command.spawn()
    };
    let runs = [start("1")?, start("2")?];
    let mut reported = Vec::new();
    for run in runs {
        let out = run.wait_with_output()?;
        if !out.status.success() {
            return Err(format!("a run ended with {}", out.status).into());
        }
        reported.push(String::from_utf8(out.stdout)?);
    }
    let [one, two] = [read(&reported[0])?, read(&reported[1])?];
    let before = match &arguments.against {
        None => None,
        Some(path) => Some(read(&std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?)?),
    };
    let mut table = Table::new(&["family", "answers", "contact", "clear", "overlap", "undecided", "hash"]);
    let mut moved = Vec::new();
    for line in reported[0].lines() {
        let name = line.split(',').next().unwrap_or_default();
        let g = &one[name];
        let [contact, clear, overlap, undecided] = g.statuses;
        table.push(row![name, g.answers, contact, clear, overlap, undecided, g.hash.as_str()]);
        if two.get(name) != Some(g) {
            return Err(format!("{name}: another hash on two threads: {:?}", two.get(name).map(|g| &g.hash)).into());
        }
        if before.as_ref().is_some_and(|b| b.get(name) != Some(g)) {
            moved.push(name);
        }
    }
    table.publish("golden", &arguments.options.folder())?;
    println!("the same on one thread and on two");
    if before.is_some() {
        println!(
            "{}",
            if moved.is_empty() { "no hash has moved".into() } else { format!("moved: {}", moved.join(", ")) }
        );
    }
    Ok(moved.is_empty())
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let done = match &arguments.answers {
        Some(file) => write_answers(&arguments, file).map(|()| true),
        None if arguments.alone => alone(&arguments).map(|()| true),
        None => compare(&arguments),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(e) => {
            eprintln!("golden: {e}");
            ExitCode::from(2)
        }
    }
}
