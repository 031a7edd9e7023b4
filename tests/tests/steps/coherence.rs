//! What the server remembers from step to step saves work and changes nothing: the same bits with everything forgotten
//! before every step.
//!
//! For a long run:
//! `CONTACTD_COHERENT_SCENES=5000 cargo test --release -p contactd-tests --test steps coherence:: -- --nocapture`

use contactd::contact::{Counters, Outcome, Region, Status};
use contactd::octree::Model;
use contactd::world::{MeasuredModel, ObjectSpec, PairOutcome, StepOptions, StepOutcome, World};
use contactd_proto::{Motion, Pose, PoseRecord, Report, Rule};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::{self, Recipe};
use contactd_tests::sweep::sized;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;

const STEPS: usize = 40;

fn part(recipe: &Recipe) -> Arc<MeasuredModel> {
    Arc::new(MeasuredModel::new(Arc::new(Model::new(recipe.build()))))
}

/// What a caller sees of an answer; work may differ.
type Told = (Vec<(u32, u32, bool, Outcome)>, Vec<Region>, [u64; 2], [bool; 3]);

fn reported(out: &StepOutcome) -> Told {
    let without_work =
        |p: &PairOutcome| (p.a, p.b, p.regions_complete, Outcome { counters: Counters::default(), ..p.outcome });
    let pairs = out.pairs.iter().map(without_work).collect();
    let flags = [out.contact, out.undecided, out.truncated];
    (pairs, out.regions.clone(), [out.safe_time.to_bits(), out.may_have_passed], flags)
}

/// A body's way through the steps: along a motion, with some disturbance.
struct Way {
    motion: Motion,
    /// Displacement that grows with the square of time, as a fall's does.
    pull: DVec3,
    jitter: f64,
}

impl Way {
    fn draw(r: &mut Random, motion: Motion) -> Self {
        let pull = if r.chance(0.3) { r.vector(0.3) } else { DVec3::ZERO };
        let jitter = if r.chance(0.6) { 0.0 } else { 10f64.powf(r.within(-9.0, -2.0)) };
        Self { motion, pull, jitter }
    }

    fn at(&self, t: f64, r: &mut Random) -> Pose {
        let mut pose = self.motion.at(t);
        pose.position += self.pull * (t * t) + r.vector(1.0) * self.jitter;
        pose
    }
}

#[derive(Default)]
struct Work {
    differences: Vec<String>,
    steps: usize,
    contacts: usize,
    /// Steps without any contact, and those of them that nothing was searched for.
    clear: usize,
    known: usize,
    /// Evaluations of literals in all steps, with memory and without.
    warm: u64,
    cold: u64,
}

/// The same steps in two worlds, one of which forgets.
fn run(seed: u64) -> Work {
    let mut r = Random::new(seed);
    let scene = if r.chance(0.3) { scenes::primitives(&mut r) } else { scenes::any(&mut r) };
    let other = scenes::any(&mut r);
    let recipes = [&scene.a, &scene.b, &other.b];
    let ways = [scene.motion_a, scene.motion_b, other.motion_b].map(|m| Way::draw(&mut r, m));
    let mut worlds = [World::new(8, 8), World::new(8, 8)];
    for (i, (recipe, way)) in recipes.iter().zip(&ways).enumerate() {
        let part = part(recipe);
        for world in &mut worlds {
            world.add_object(ObjectSpec::new(i as u32 + 1, &part, way.motion.start)).expect("an object");
        }
    }
    let options = StepOptions {
        clear: r.chance(0.3),
        first: r.chance(0.2),
        // Few pairs need more; what is undecided must be so with memory and without.
        cell_limit: if r.chance(0.2) { 100 } else { 2_000 },
        ..StepOptions::default()
    };
    let stops = r.chance(0.3);
    if r.chance(0.3) {
        let margin = if r.chance(0.5) { 0.0 } else { 10f64.powf(r.within(-3.0, -0.7)) };
        let rule = Rule { report: Report::Patch, margin, ..Rule::new(["default".into(), "default".into()]) };
        for world in &mut worlds {
            world.set_rules(vec![rule.clone()]).expect("a rule");
        }
    }
    let [warm, cold] = &mut worlds;
    let mut work = Work::default();
    let mut advance = 1.0;
    for k in 1..=STEPS {
        let t = k as f64 / STEPS as f64;
        let mut records: Vec<PoseRecord> = Vec::new();
        for (i, way) in ways.iter().enumerate() {
            // Sometimes one is not named: it rests.
            if !r.chance(0.05) {
                records.push(PoseRecord::end(i as u32 + 1, &way.at(t, &mut r)));
            }
        }
        let options = StepOptions { advance, ..options };
        cold.forget();
        let expected = cold.step(&records, &options).expect("a step").clone();
        let answer = warm.step(&records, &options).expect("a step");
        if reported(answer) != reported(&expected) {
            let text = format!(
                "seed {seed}, step {k}, {}: {:?}\nforgetting: {:?}",
                scene.class,
                reported(answer),
                reported(&expected)
            );
            work.differences.push(text);
            break;
        }
        work.steps += 1;
        work.contacts += usize::from(answer.contact);
        if !answer.contact && !answer.undecided {
            work.clear += 1;
            work.known += usize::from(answer.known == answer.searched);
        }
        work.warm += answer.counters.evaluations;
        work.cold += expected.counters.evaluations;
        // Bodies that stop where they meet rest there: a physics loop.
        advance = if stops { expected.safe_time } else { 1.0 };
        if expected.pairs.iter().any(|p| p.outcome.status() == Status::Overlap) && k > STEPS / 2 {
            break;
        }
    }
    work
}

#[test]
fn what_is_remembered_changes_no_bit_of_an_answer() {
    let count = sized("CONTACTD_COHERENT_SCENES", 30);
    let all: Vec<Work> = (0..count).into_par_iter().map(|i| run(7_000_001 + i)).collect();
    let sum = |f: fn(&Work) -> usize| all.iter().map(f).sum::<usize>();
    let (steps, contacts, clear, known) = (sum(|w| w.steps), sum(|w| w.contacts), sum(|w| w.clear), sum(|w| w.known));
    let (warm, cold) = (all.iter().map(|w| w.warm).sum::<u64>(), all.iter().map(|w| w.cold).sum::<u64>());
    println!(
        "{steps} steps: {contacts} with a contact; {clear} clear, {known} of them without a search; \
         evaluations {warm}, forgetting {cold}"
    );
    let differences: Vec<&String> = all.iter().flat_map(|w| &w.differences).collect();
    assert!(differences.is_empty(), "{} of {count} scenes: {}", differences.len(), differences[0]);
    assert!(contacts * 10 > steps && clear * 10 > steps, "too few of a kind to say anything");
    assert!(known * 2 > clear, "hardly anything is remembered");
    // What the searches of clear steps are saved, and what looks ahead cost those with a contact.
    assert!(10 * warm <= 11 * cold, "what is remembered costs more than a tenth");
}

/// What a peg of radius .24 costs on its way to a place in each of 100 steps, with memory and without; its hole of radius .25 is in the
/// middle of a plate.
fn peg_and_hole(start: DVec3, at: impl Fn(i32) -> DVec3) -> [Vec<Counters>; 2] {
    let plate = part(&Recipe::cuboid(0.8, 0.8, 0.2).minus(Recipe::cylinder(0.25, 1.0)));
    let peg = part(&Recipe::cylinder(0.24, 0.5));
    let mut worlds = [World::new(2, 2), World::new(2, 2)];
    for world in &mut worlds {
        let start = Pose::at(start);
        world
            .add_object(ObjectSpec { is_static: true, ..ObjectSpec::new(1, &plate, Pose::IDENTITY) })
            .expect("a plate");
        world.add_object(ObjectSpec::new(2, &peg, start)).expect("a peg");
    }
    let (mut warm, mut cold) = (vec![], vec![]);
    for k in 1..=100 {
        let records = [PoseRecord::end(2, &Pose::at(at(k)))];
        let counted = |world: &mut World| {
            let out = world.step(&records, &StepOptions::default()).expect("a step");
            assert!(!out.contact && !out.undecided);
            out.counters
        };
        worlds[1].forget();
        let [w, c] = &mut worlds;
        warm.push(counted(w));
        cold.push(counted(c));
    }
    [warm, cold]
}

#[test]
fn an_approaching_peg_costs_next_to_nothing_a_step() {
    for jitter in [0.0, 1e-6, 1e-4] {
        // At an even pace, down on its hole and into it.
        let mut r = Random::new(5);
        let off: Vec<DVec3> = (0..100).map(|_| r.vector(jitter)).collect();
        let at = |k: i32| DVec3::new(0.001, 0.002, 2.0 - 0.02 * f64::from(k));
        // A look of a shortcut in front of the search counts as a cell.
        let [warm, cold] = peg_and_hole(at(0), |k| at(k) + off[k as usize - 1]).map(|all| {
            let mut cells: Vec<u64> = all.iter().map(|c| c.cells + c.closed_forms).collect();
            cells.sort_unstable();
            cells
        });
        let sum = |cells: &[u64]| cells.iter().sum::<u64>();
        println!(
            "jitter {jitter:e}: cells a step, median {}, all {}; forgetting: median {}, all {}",
            warm[50],
            sum(&warm),
            cold[50],
            sum(&cold)
        );
        assert!(warm[50] <= 8 && 2 * sum(&warm) < sum(&cold));
    }
}

#[test]
fn a_peg_that_never_goes_on_as_it_went_is_not_followed_in_vain() {
    let mut r = Random::new(6);
    let places: Vec<DVec3> = (0..=100).map(|_| DVec3::new(0.0, 0.0, 0.3) + r.vector(0.004)).collect();
    let [warm, cold] = peg_and_hole(places[0], |k| places[k as usize]);
    let evaluations = |all: &[Counters]| all.iter().map(|c| c.evaluations).sum::<u64>();
    let looks = |all: &[Counters]| all.iter().map(|c| c.closed_forms).sum::<u64>();
    println!("{} looks and {} evaluations, forgetting {}", looks(&warm), evaluations(&warm), looks(&cold));
    // The cavity tells of each step by a few looks. What looks ahead costs thousands of evaluations, each time in vain.
    assert!(looks(&cold) >= 100 && looks(&warm) <= looks(&cold) && evaluations(&cold) == 0);
    assert!(evaluations(&warm) < 12_000);
}

/// Two worlds of the same objects and rules, one of which forgets before every step: what each of them tells.
struct Twins([World; 2]);

impl Twins {
    fn new(parts: [&Recipe; 2], at: [Pose; 2], rule: Option<Rule>) -> Self {
        let parts = parts.map(part);
        Self([0, 1].map(|_| {
            let mut world = World::new(2, 8);
            for (id, (part, pose)) in (1..).zip(parts.iter().zip(at)) {
                world.add_object(ObjectSpec::new(id, part, pose)).expect("an object");
            }
            world.set_rules(rule.clone().into_iter().collect()).expect("a rule");
            world
        }))
    }

    /// The records of a step, the same in both.
    fn step(&mut self, records: &[PoseRecord], options: &StepOptions) -> Vec<PairOutcome> {
        let [warm, cold] = &mut self.0;
        cold.forget();
        let expected = cold.step(records, options).expect("a step");
        let answer = warm.step(records, options).expect("a step");
        assert_eq!(reported(answer), reported(expected), "what is remembered, and forgetting");
        answer.pairs.clone()
    }
}

fn to(id: u32, at: DVec3) -> PoseRecord {
    PoseRecord::end(id, &Pose::at(at))
}

fn put(id: u32, at: DVec3) -> PoseRecord {
    PoseRecord::start(id, &Pose::at(at))
}

/// A cube of side 1 with a thin hole through its middle: no primitive.
fn drilled() -> Recipe {
    Recipe::cuboid(0.5, 0.5, 0.5).minus(Recipe::cylinder(0.05, 2.0))
}

/// Where it has stood, a body that is parked as far away as may be and comes back is asked about as before.
#[test]
fn a_body_comes_back_from_as_far_as_may_be() {
    let cube = Recipe::cuboid(0.5, 0.5, 0.5);
    let mut twins = Twins::new([&cube, &cube], [0.0, 3.0].map(|x| Pose::at(DVec3::X * x)), None);
    let options = StepOptions::default();
    for far in [1e150, 1e100, 1e20] {
        assert!(twins.step(&[put(2, DVec3::X * far)], &options).is_empty());
        assert!(twins.step(&[put(2, DVec3::Y * -far)], &options).is_empty());
        let back = twins.step(&[put(2, DVec3::X * 0.9)], &options);
        assert_eq!(back.iter().map(|p| p.outcome.status()).collect::<Vec<_>>(), [Status::Overlap], "from {far:e}");
    }
}

/// A step of which .64 is taken moves a body by one unit in the last place of its coordinate, every time: more than the
/// motion says.
#[test]
fn what_rounding_does_to_a_step_that_is_taken_in_part_is_counted() {
    let cube = Recipe::cuboid(0.5, 0.5, 0.5);
    let x = 1e7;
    let ulp = f64::EPSILON * 2f64.powi(23);
    let start = x + 1.0 + 2000.0 * ulp;
    let mut twins = Twins::new([&cube, &cube], [x, start].map(|x| Pose::at(DVec3::X * x)), None);
    let options = StepOptions { advance: 0.64, ..StepOptions::default() };
    let mut met = 0;
    for k in 1..=2400 {
        let at = start - f64::from(k) * ulp;
        met += u32::from(!twins.step(&[to(2, DVec3::X * at)], &options).is_empty());
        assert!((twins.0[0].body(2).expect("a body").motion_state.end.position.x - at).abs() < 0.1 * ulp);
    }
    assert!(met > 300, "{met}: they meet, and sink in");
}

/// Trees are near each other by f, side by side: cubes that pass corner to corner are within their margin before their
/// distance is.
#[test]
fn what_is_told_of_a_margin_does_not_depend_on_what_is_remembered() {
    let rule = || Some(Rule { margin: 0.1, ..Rule::new(["default".into(), "default".into()]) });
    let options = StepOptions::default();
    let along = |d: f64| DVec3::new(d, d, 0.0);
    let mut twins = Twins::new([&drilled(), &drilled()], [DVec3::ZERO, along(1.105)].map(Pose::at), rule());
    assert!(twins.step(&[], &options).is_empty());
    assert_eq!(twins.step(&[to(2, along(1.095))], &options).len(), 1, "it comes within its margin");
    for d in [1.095, 1.097, 1.05, 1.2, 1.099, 1.1001, 1.09] {
        twins.step(&[to(2, along(d))], &options);
    }
    // Edge to edge, after a contact and without one before.
    let turned = Pose::new(DVec3::ZERO, glam::DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4));
    let edge = |d: f64| Pose { position: DVec3::X * (2f64.sqrt() + d), ..turned };
    let mut twins = Twins::new([&drilled(), &drilled()], [turned, edge(0.3)], rule());
    let met = twins.step(&[PoseRecord::end(2, &edge(-0.01))], &options);
    assert_eq!(met[0].outcome.status(), Status::Contact);
    for d in [0.12, 0.11, 0.1, 0.09, 0.07, 0.12, 0.2, 0.13] {
        twins.step(&[PoseRecord::start(2, &edge(d))], &options);
        twins.step(&[PoseRecord::end(2, &edge(d - 0.01))], &options);
    }
}

/// A question that is repeated with less work allowed is answered as one that was never asked.
#[test]
fn an_answer_that_took_more_work_than_is_allowed_is_not_repeated() {
    let at = [Pose::IDENTITY, Pose::at(DVec3::new(0.1, 0.2, 1.5))];
    let mut twins = Twins::new([&drilled(), &drilled()], at, None);
    let [warm, _] = &mut twins.0;
    let down = [PoseRecord::turn(2, DVec3::new(0.1, 0.2, 0.9), DVec3::new(0.3, 0.2, 0.1))];
    let cells = warm.step(&down, &StepOptions::default()).expect("a step").counters.cells;
    assert!(cells > 1, "{cells}: a search");
    for cell_limit in [cells, cells / 2, 1] {
        let again = StepOptions { advance: 0.0, cell_limit, ..StepOptions::default() };
        let [warm, _] = &mut twins.0;
        warm.step(&down, &StepOptions { advance: 0.0, ..StepOptions::default() }).expect("a step");
        let answer = reported(warm.step(&down, &again).expect("a step"));
        warm.forget();
        assert_eq!(answer, reported(warm.step(&down, &again).expect("a step")), "{cell_limit} of {cells} cells");
    }
}
