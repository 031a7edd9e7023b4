//! A step whose time is up ends soon, whatever it is at, and what it has told is true. Scenes of all kinds of bodies and with all effects,
//! drawn at random; the end comes after so many looks of the step's work whether it is to. `CONTACTD_DEADLINES` sets the number of
//! scenes.
//!
//! `--ignored` prints what steps of larger scenes take beyond a deadline.

use contactd::contact::{Status, Verdict};
use contactd::math::halt::Halt;
use contactd::octree::Model;
use contactd::solid::{Shape, Solid};
use contactd::world::heed::{Crew, Heed};
use contactd::world::{MeasuredModel, ObjectSpec, StepOptions, StepOutcome, World};
use contactd_proto::{InitialOverlap, Pose, PoseRecord, Report, Rule};
use contactd_tests::random_solids::{self, Random};
use contactd_tests::scenes::{self, Recipe};
use contactd_tests::{meshes, shells};
use glam::DVec3;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

type Part = Arc<MeasuredModel>;

fn part(solid: Solid) -> Part {
    Arc::new(MeasuredModel::new(Arc::new(Model::new(solid))))
}

fn whole(shape: impl Into<Shape>) -> Part {
    part(Recipe::of(shape).build())
}

/// A block with so many holes across it.
fn drilled(r: &mut Random, holes: usize) -> Recipe {
    let hole = |r: &mut Random| {
        let at = r.vector(0.9);
        Recipe::cylinder(r.within(0.03, 0.15), 3.0).moved(&Pose::new(at, r.rotation()))
    };
    (0..holes).fold(Recipe::cuboid(1.0, 0.8, 0.6), |block, _| block.minus(hole(r)))
}

/// All that may be asked of a pair.
fn everything(r: &mut Random) -> Rule {
    let mut rule = Rule::new(["body".into(), "body".into()]);
    rule.report = Report::Patch;
    rule.penetration = true;
    rule.margin = 0.05;
    rule.clearance = if r.chance(0.7) { 1e-3 } else { 0.0 };
    if r.chance(0.5) {
        rule.initial_overlap = InitialOverlap::IgnoreIfSeparating;
    }
    rule
}

/// Bodies in a heap, and how they go on.
struct Heap {
    world: World,
    records: Vec<PoseRecord>,
}

impl Heap {
    /// So many bodies of some parts, anywhere within `reach` of the middle, that go and turn by as much in a step.
    fn new(r: &mut Random, parts: &[Part], count: usize, reach: f64, motion: [f64; 2], rules: Vec<Rule>) -> Self {
        let mut world = World::new(count, 2 * count);
        world.set_rules(rules).unwrap();
        let mut records = Vec::new();
        for i in 0..count {
            let start = if reach > 0.0 { Pose::new(r.vector(reach), r.rotation()) } else { Pose::at(DVec3::ZERO) };
            let spec = ObjectSpec { group: "body".into(), ..ObjectSpec::new(i as u32, &parts[i % parts.len()], start) };
            world.add_object(spec).unwrap();
            let to = start.position + r.direction() * motion[0];
            records.push(PoseRecord::turn(i as u32, to, r.direction() * motion[1]));
        }
        Self { world, records }
    }

    fn step(&mut self, heed: Option<&Heed>, options: &StepOptions) -> &StepOutcome {
        self.world.step_heeding(&self.records, options, heed).unwrap()
    }
}

/// A kind of body for each number.
fn some_part(r: &mut Random, kind: usize) -> Part {
    match kind % 9 {
        0 => whole(meshes::divided(&shells::gear(8, 6, 4, 0.3))),
        1 => whole(random_solids::superellipsoid(r, 1.0)),
        2 => part(drilled(r, 12).build()),
        3 => part(scenes::tree(r, 8).build()),
        4 => part(Recipe::sphere(0.6).build()),
        5 => whole(random_solids::of_kind(r, "polyhedron", 1.0)),
        6 => whole(random_solids::shape_of_any_kind(r, 1.0)),
        7 => whole(meshes::solid(&shells::stone(6))),
        _ => part(Recipe::cuboid(0.5, 0.6, 0.4).build()),
    }
}

fn some_heap(seed: u64) -> Heap {
    let mut r = Random::new(seed);
    let kinds: Vec<usize> = (0..1 + r.below(3)).map(|_| r.below(9)).collect();
    let parts: Vec<Part> = kinds.iter().map(|kind| some_part(&mut r, *kind)).collect();
    let reach = r.within(0.0, 1.6);
    let motion = [r.within(0.0, 1.0), r.within(0.0, 2.0)];
    let rules = vec![everything(&mut r)];
    Heap::new(&mut r, &parts, 4, reach, motion, rules)
}

/// What a step tells of a pair.
#[derive(Clone, Debug)]
struct Told {
    verdict: Verdict,
    times: [f64; 2],
    touching: bool,
    /// An overlap at the start was searched past.
    is_past: bool,
    margin_time: f64,
    is_complete: bool,
    regions: u32,
    distance: Option<[f64; 2]>,
}

impl Told {
    fn status(&self) -> Status {
        match self.verdict {
            Verdict::Clear { .. } => Status::Clear,
            Verdict::Contact(_) => Status::Contact,
            Verdict::Overlap(_) => Status::Overlap,
            Verdict::Undecided { .. } => Status::Undecided,
        }
    }

    /// Panics where what was told in time is not true, given what is told without an end.
    fn assert_is_true(&self, all: &Told) {
        let (own, status) = (self.status(), all.status());
        if own == Status::Overlap && all.is_past {
            // There was no time to go past it.
            return;
        }
        if status != Status::Undecided {
            assert!(own == Status::Undecided || own == status, "{own:?}");
            // Proven to be free before, or met by then.
            assert!(self.times[0] <= all.times[1] && (own == Status::Undecided || all.times[0] <= self.times[1]));
        }
        assert!(self.touching || !all.touching, "touches");
        // It is told of what stays clear.
        let is_early = own != Status::Clear || self.margin_time <= all.margin_time + 1e-9;
        assert!(is_early, "the margin is reached at {}", all.margin_time);
        let [own, all_of_it] = [self.distance, all.distance].map(|d| d.unwrap_or([0.0, f64::INFINITY]));
        assert!(own[0] <= all_of_it[1] && all_of_it[0] <= own[1], "{own:?} {all_of_it:?}");
        if own_is_whole(self, all) {
            assert_eq!(self.regions, all.regions);
        }
    }
}

/// True where all regions were told of the same answer.
fn own_is_whole(own: &Told, all: &Told) -> bool {
    own.is_complete && all.is_complete && own.status() == all.status() && own.times == all.times
}

fn told(out: &StepOutcome) -> BTreeMap<(u32, u32), Told> {
    let each = out.pairs.iter().map(|p| {
        let o = &p.outcome;
        let told = Told {
            verdict: o.verdict,
            times: [o.time_lower(), if o.meets() { o.time_upper() } else { 1.0 }],
            touching: o.touching,
            is_past: o.past,
            margin_time: o.margin_time,
            is_complete: p.regions_complete,
            regions: p.regions.1,
            distance: p.clearance.map(|i| &out.clearances[i as usize]).map(|d| [d.lower, d.upper]),
        };
        ((p.a, p.b), told)
    });
    each.collect()
}

/// All work that a step has counted.
fn work(out: &StepOutcome) -> u64 {
    let c = &out.counters;
    c.cells + c.instant_cells + c.evaluations / 64 + c.newton + c.closed_forms
}

#[test]
fn what_is_told_in_time_is_true_and_little_is_done_after() {
    let scenes = std::env::var("CONTACTD_DEADLINES").map_or(8, |n| n.parse().unwrap());
    let options = StepOptions { cell_limit: 300, ..StepOptions::default() };
    let (mut least, mut most, mut worst) = (u64::MAX, 0, 0);
    for seed in 0..scenes {
        let mut endless = some_heap(seed);
        let out = endless.step(None, &options);
        let (all, whole) = (told(out), work(out));
        for looks in [0, 1, 4, 32] {
            let mut heap = some_heap(seed);
            let heed = Heed::after(looks);
            let out = heap.step(Some(&heed), &options);
            let (cut, done) = (told(out), work(out));
            worst = worst.max(heed.overrun());
            if looks == 0 {
                (least, most) = (least.min(whole), most.max(done));
            }
            for (pair, all) in &all {
                let own = cut.get(pair).unwrap_or_else(|| panic!("scene {seed}, {looks} looks: {pair:?} is not told"));
                let judged = std::panic::catch_unwind(|| own.assert_is_true(all));
                assert!(judged.is_ok(), "scene {seed}, {looks} looks, {pair:?}: {own:?}, without an end {all:?}");
            }
            // The step after it has time, and knows nothing that is not so.
            if looks == 4 {
                let next = told(heap.step(None, &options));
                let of_other = told(endless.step(None, &options));
                assert_eq!(next.len(), of_other.len());
                for (pair, own) in &next {
                    assert_eq!(format!("{own:?}"), format!("{:?}", of_other[pair]), "scene {seed} {pair:?}");
                }
            }
        }
    }
    println!(
        "{scenes} scenes: at most {most} cells' worth in a step without time, of {least} and more; {worst} looks at faces after"
    );
    assert!(worst < 2 * Halt::GRACE, "{worst} looks at faces after the end");
}

/// Larger scenes, their steps' times by a deadline of 20 ms.
#[test]
#[ignore = "a measurement"]
fn what_steps_take_beyond_a_deadline() {
    let only = std::env::var("CONTACTD_SCENE").unwrap_or_default();
    let r = &mut Random::new(7);
    let gear = |t, f, l| whole(meshes::divided(&shells::gear(t, f, l, 0.4)));
    let every = Rule { clearance: 1e-3, initial_overlap: InitialOverlap::IgnoreIfSeparating, ..everything(r) };
    let near = Rule { clearance: 0.0, ..every.clone() };
    let plain = Rule::new(["body".into(), "body".into()]);
    let lump = || part(drilled(&mut Random::new(8), 60).build());
    let deep = (0..200).fold(Recipe::sphere(0.2), |all, _| {
        let ball = Recipe::sphere(r.within(0.05, 0.2)).moved(&Pose::at(r.vector(1.0)));
        if r.chance(0.6) { all.union(ball) } else { all.minus(ball) }
    });
    let many = |count: usize, make: &dyn Fn(&mut Random, usize) -> Part| -> Vec<Part> {
        let r = &mut Random::new(9);
        (0..count).map(|i| make(r, i)).collect()
    };
    let superellipsoids = || many(10, &|r, _| whole(random_solids::superellipsoid(r, 0.6)));
    let hulls = || many(6, &|r, _| whole(random_solids::of_kind(r, "polyhedron", 1.0)));
    let (boxes, balls) = (|| many(1, &|r, _| some_part(r, 8)), || many(1, &|r, _| some_part(r, 4)));
    let all = || many(18, &some_part);
    let stones = || vec![whole(meshes::divided(&shells::stone(40)))];
    let knots = || vec![whole(meshes::divided(&shells::knot(300, 24)))];
    let mixed = || vec![gear(24, 20, 20), lump()];
    let (small, middle, large) = (|| vec![gear(20, 12, 10)], || vec![gear(24, 20, 20)], || vec![gear(30, 30, 28)]);
    let (lumps, deeps) = (|| vec![lump()], || vec![part(deep.build())]);
    type Scene<'a> = (&'a str, &'a dyn Fn() -> Vec<Part>, usize, f64, [f64; 2], &'a Rule);
    let scenes: [Scene; 16] = [
        ("gears 5000, plain", &small, 12, 0.8, [0.3, 1.0], &plain),
        ("gears 20000", &middle, 8, 0.6, [0.3, 2.0], &every),
        ("gears 50000", &large, 6, 0.6, [0.1, 1.0], &every),
        ("gears 50000 apart", &large, 6, 2.5, [1.5, 1.0], &every),
        ("stones", &stones, 20, 1.2, [0.5, 1.0], &every),
        ("knots", &knots, 6, 1.2, [0.5, 1.0], &every),
        ("superellipsoids", &superellipsoids, 60, 1.2, [0.4, 1.0], &every),
        ("4000 boxes", &boxes, 4000, 8.0, [0.4, 0.5], &near),
        ("4000 balls", &balls, 4000, 8.0, [0.4, 0.5], &plain),
        ("4000 boxes, sparse", &boxes, 4000, 16.0, [0.1, 0.2], &near),
        ("balls at one point", &balls, 400, 0.0, [0.1, 0.0], &every),
        ("mesh and tree", &mixed, 12, 0.9, [0.3, 1.0], &every),
        ("trees", &lumps, 30, 1.2, [0.3, 1.0], &every),
        ("deep trees", &deeps, 10, 1.0, [0.3, 1.0], &every),
        ("hulls", &hulls, 60, 1.0, [0.3, 1.0], &every),
        ("all kinds", &all, 90, 2.0, [0.5, 1.0], &every),
    ];
    let crew = Arc::new(Crew::new(2));
    for (name, parts, count, reach, motion, rule) in scenes.iter().filter(|scene| scene.0.contains(only.as_str())) {
        let mut heap = Heap::new(&mut Random::new(3), &parts(), *count, *reach, *motion, vec![(*rule).clone()]);
        let mut line = String::new();
        for _ in 0..4 {
            let heed = Heed::new(Some(Instant::now() + Duration::from_millis(20)), crew.clone());
            let (begin, out) = (Instant::now(), heap.step(Some(&heed), &StepOptions::default()));
            let took = begin.elapsed();
            let undecided = out.pairs.iter().filter(|p| p.outcome.status() == Status::Undecided).count();
            line += &format!(" {:7.1} ({undecided} of {})", 1e3 * took.as_secs_f64(), out.pairs.len());
        }
        println!("{name:20}{line}");
    }
}
