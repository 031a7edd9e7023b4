//! A session that remembers tells what one tells that never saw a step before: to the bit, whatever happens to its bodies.
//!
//! The steps are drawn by `stepped`, which knows nothing of what is remembered. 100,000 of them:
//! `CONTACTD_MEMORY_STEPS=100000 cargo test --release -p contactd-tests --test steps memory:: -- --nocapture`

use contactd::contact::{Extent, Status};
use contactd::world::{MeasuredModel, ObjectSpec, StepOptions, World};
use contactd_proto::{MotionState, Pose, PoseRecord, Report, Rule};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use contactd_tests::stepped::{Act, Play, block, plate};
use contactd_tests::sweep::sized;
use glam::DVec3;
use play::{Work, apply, differing, part, reported, run, run_play, same};
use rayon::prelude::*;
use std::sync::Arc;

mod play;

/// Steps of a random play, and of one in which bodies come to rest.
const STEPS: usize = 25;
const SETTLING: usize = 12;

/// How many certificates are missing, in words.
fn unproven(all: &[Work]) -> String {
    let [answers, apart, regions]: [usize; 3] = std::array::from_fn(|k| all.iter().map(|w| w.unproven[k]).sum());
    format!("{answers} answers, {apart} beyond a threshold and {regions} with regions")
}

/// Steps of the random plays.
fn steps() -> usize {
    sized("CONTACTD_MEMORY_STEPS", 800)
}

#[test]
fn random_steps_are_told_as_by_a_session_that_never_saw_a_step() {
    let steps = steps();
    let first: u64 = sized("CONTACTD_MEMORY_SEED", 40_000_001);
    let plays = steps.div_ceil(STEPS) as u64;
    let all: Vec<Work> = (0..plays).into_par_iter().map(|i| run(first + i, STEPS)).collect();
    let sum = |f: fn(&Work) -> usize| all.iter().map(f).sum::<usize>();
    println!(
        "{} steps: {} with a contact, {} in overlap alone, {} clear, {} of them without a search; {} with trees of more than 12 \
         primitives; {} known that a limit left open",
        sum(|w| w.steps),
        sum(|w| w.contacts),
        sum(|w| w.overlaps),
        sum(|w| w.clear),
        sum(|w| w.known),
        sum(|w| w.large),
        sum(|w| w.open)
    );
    let differences: Vec<&String> = all.iter().filter_map(|w| w.difference.as_ref()).collect();
    for d in differences.iter().take(5) {
        println!("{d}");
    }
    let proven: [usize; 8] = std::array::from_fn(|k| all.iter().map(|w| w.proven[k]).sum());
    let (unproven, unshown) = (unproven(&all), sum(|w| w.unshown));
    println!(
        "certificates that hold: {} clearances, {} by directions, {} predictions, {} answers, {} overlaps, {} left behind the first \
         contact, {} beyond a threshold, {} with regions; {unproven} without one, {unshown} that the checker's budget left open",
        proven[0], proven[1], proven[2], proven[3], proven[4], proven[5], proven[6], proven[7]
    );
    let refused: Vec<&String> = all.iter().filter_map(|w| w.refused.as_ref()).collect();
    for r in refused.iter().take(5) {
        println!("{r}");
    }
    assert!(refused.is_empty(), "{} certificates do not hold: {}", refused.len(), refused[0]);
    assert!(differences.is_empty(), "{} of {plays} plays: {}", differences.len(), differences[0]);
    let left: usize = all.iter().flat_map(|w| w.unproven).sum();
    assert!(left * 100 <= proven.iter().sum(), "{left} answers of memory have no certificate");
    assert!(unshown * 500 <= proven[2] + proven[3], "{unshown} certificates are not shown");
    let steps = sum(|w| w.steps);
    assert!(sum(|w| w.contacts) * 20 > steps && sum(|w| w.clear) * 5 > steps, "too few of a kind to say anything");
    assert!(sum(|w| w.known) * 4 > sum(|w| w.clear), "hardly anything is remembered");
}

/// Bodies that come to rest on each other, or press on: where they touch is remembered with their answer.
#[test]
fn regions_that_are_kept_are_those_of_bodies_that_rest() {
    let steps = steps().div_ceil(8);
    let plays = steps.div_ceil(SETTLING) as u64;
    let all: Vec<Work> =
        (0..plays).into_par_iter().map(|i| run_play(i, Play::settling(50_000_000 + i), SETTLING)).collect();
    let sum = |f: fn(&Work) -> usize| all.iter().map(f).sum::<usize>();
    let (regions, apart, unproven) = (sum(|w| w.proven[7]), sum(|w| w.proven[6]), unproven(&all));
    println!(
        "{} steps: {} with a contact, {} clear; {regions} certificates of regions hold, {apart} beyond a threshold, {unproven} without one",
        sum(|w| w.steps),
        sum(|w| w.contacts),
        sum(|w| w.clear)
    );
    for w in all.iter().filter_map(|w| w.difference.as_ref().or(w.refused.as_ref())).take(5) {
        println!("{w}");
    }
    assert!(all.iter().all(|w| w.difference.is_none() && w.refused.is_none()), "see above");
    assert!(regions * 8 > steps, "{regions} certificates of regions in {steps} steps");
}

/// Bodies that come down on a floor without bounds and rest on it, slide or press: a session that remembers tells what
/// a new one does.
#[test]
fn bodies_on_a_floor_without_bounds_are_told_as_by_a_new_session() {
    let steps = steps().div_ceil(5);
    let plays = steps.div_ceil(SETTLING) as u64;
    let all: Vec<Work> =
        (0..plays).into_par_iter().map(|i| run_play(i, Play::on_floor(90_000_000 + i), SETTLING)).collect();
    let sum = |f: fn(&Work) -> usize| all.iter().map(f).sum::<usize>();
    println!(
        "{} steps: {} with a contact, {} clear; certificates {:?}",
        sum(|w| w.steps),
        sum(|w| w.contacts),
        sum(|w| w.clear),
        std::array::from_fn::<usize, 8, _>(|k| all.iter().map(|w| w.proven[k]).sum())
    );
    for w in all.iter().filter_map(|w| w.difference.as_ref().or(w.refused.as_ref())).take(5) {
        println!("{w}");
    }
    assert!(all.iter().all(|w| w.difference.is_none() && w.refused.is_none()), "see above");
    assert!(sum(|w| w.contacts) * 10 > steps, "hardly anything meets");
}

/// Plays of primitives of every kind and of small trees of them: bodies that pass each other, that settle, that lie on a floor.
#[test]
fn bodies_of_all_kinds_are_told_as_by_a_session_that_never_saw_a_step() {
    let steps = sized("CONTACTD_MEMORY_STEPS", 1_200_usize).div_ceil(4);
    let first = sized("CONTACTD_MEMORY_SEED", 40_000_001);
    let ways: [(&str, fn(u64) -> Play, usize); 3] = [
        ("passing", Play::of_all_kinds, STEPS),
        ("settling", |seed| Play::of_all_kinds(seed).settled(), SETTLING),
        ("on a floor", |seed| Play::of_all_kinds(seed).settled().floored(), SETTLING),
    ];
    for (name, play, length) in ways {
        let plays = steps.div_ceil(3 * length) as u64;
        let all: Vec<Work> = (0..plays).into_par_iter().map(|i| run_play(first + i, play(first + i), length)).collect();
        let sum = |f: fn(&Work) -> usize| all.iter().map(f).sum::<usize>();
        println!(
            "{name}: {} steps: {} with a contact, {} in overlap alone, {} clear; certificates {:?}; {} without one, {} that the \
             checker's budget left open",
            sum(|w| w.steps),
            sum(|w| w.contacts),
            sum(|w| w.overlaps),
            sum(|w| w.clear),
            std::array::from_fn::<usize, 8, _>(|k| all.iter().map(|w| w.proven[k]).sum()),
            unproven(&all),
            sum(|w| w.unshown)
        );
        let wrong: Vec<&String> = all.iter().filter_map(|w| w.difference.as_ref().or(w.refused.as_ref())).collect();
        wrong.iter().take(8).for_each(|w| println!("{w}"));
        assert!(wrong.is_empty(), "{name}: {} of {plays} plays, see above", wrong.len());
        assert!(sum(|w| w.contacts) * 20 > sum(|w| w.steps), "{name}: hardly anything meets");
    }
}

/// A beam on two ridges has two regions, which are told again, both of them, while it rests.
#[test]
fn all_regions_of_bodies_that_rest_are_told_again() {
    let ridge = |x: f64| Recipe::cuboid(0.2, 1.0, 0.1).at(x, 0.0, 0.3);
    let below = part(&Recipe::cuboid(2.0, 1.0, 0.2).union(ridge(-1.0)).union(ridge(1.0)));
    let beam = part(&Recipe::cuboid(1.5, 0.3, 0.1));
    let [above, rest] = [0.7, 0.5].map(|z| Pose::at(DVec3::Z * z));
    let mut world = two([&below, &beam], [Pose::IDENTITY, above], 0.0);
    let rule = Rule { report: Report::Patch, ..Rule::new(["default".into(), "default".into()]) };
    world.set_rules(vec![rule]).expect("a rule");
    let options = StepOptions { clear: true, ..StepOptions::default() };
    // It comes to rest in the first step, and touches from the second on.
    world.step(&[PoseRecord::end(2, &rest)], &options).expect("a step");
    let mut told = Vec::new();
    for _ in 0..4 {
        let out = world.step(&[PoseRecord::end(2, &rest)], &options).expect("a step");
        let regions = out.pairs.iter().flat_map(|p| out.regions_of(p));
        told.push(regions.map(|r| format!("{r:?}")).collect::<Vec<_>>());
    }
    assert!(told.iter().all(|regions| regions.len() == 2 && *regions == told[0]), "{told:#?}");
}

/// A play in which a side leans over a floor so far that its patch ends at the margin: a corner that the patch does not tell is told
/// as the end of an edge, in every step in which it lies so.
#[test]
fn an_edge_of_a_side_that_leans_is_told_beside_its_patch() {
    let mut play = Play::on_floor(90_000_087);
    let parts: Vec<Arc<MeasuredModel>> = play.recipes.iter().map(part).collect();
    let mut world = World::new(256, 256);
    let (mut free, mut told) = (1.0, Vec::new());
    for _ in 0..SETTLING {
        let Act { changes, records, options } = play.next(free);
        changes.iter().for_each(|change| apply(&mut world, &parts, change));
        let out = world.step(&records, &options).expect("a step");
        free = out.safe_time;
        let of_pair = out.pairs.iter().filter(|p| (p.a, p.b) == (2, 3));
        told.push(of_pair.flat_map(|p| out.regions_of(p)).map(|r| r.extent).collect::<Vec<_>>());
        play.follow(&world);
    }
    assert!(told[2..].iter().all(|extents| *extents == [Extent::Patch, Extent::Line]), "{told:?}");
}

/// Plays in which a session was told otherwise than a new one, or a certificate did not hold: answers repeated under another limit,
/// directions that were remembered and prove less than a first look, discrete pairs, pairs later than the first contact, unbounded
/// bodies, multipliers that all but vanish on their way, overlaps whose depth was worked out within a limit, bodies that met before
/// and whose search a limit cuts short where a look would have shown them apart. Of 40,000,148 a predicted motion would be wrong that is
/// proven at a depth instead of a distance.
#[test]
fn plays_that_were_told_wrong_once_are_told_right() {
    let seeds = [
        40_000_197, 40_000_158, 40_000_175, 40_000_779, 40_001_917, 40_001_935, 40_002_002, 40_002_375, 40_003_306,
        40_002_817, 40_000_682, 40_000_148, 77_001_574, 260_416, 99_970_358,
    ];
    seeds.into_par_iter().for_each(|seed| {
        let work = run(seed, STEPS);
        assert_eq!((work.difference, work.refused, work.steps), (None, None, STEPS), "seed {seed}");
    });
    // Of bodies of all kinds that settle: regions of faces that pass a sharp rim deep in each other.
    let settled = 97_000_280;
    let work = run_play(settled, Play::of_all_kinds(settled).settled(), SETTLING);
    assert_eq!((work.difference, work.refused, work.steps), (None, None, SETTLING), "seed {settled}, settled");
}

/// Two objects in a world.
fn two(parts: [&Arc<MeasuredModel>; 2], poses: [Pose; 2], margin: f64) -> World {
    let mut world = World::new(2, 8);
    for (i, (part, pose)) in parts.iter().zip(poses).enumerate() {
        world.add_object(ObjectSpec::new(i as u32 + 1, part, pose)).expect("an object");
    }
    let rule = Rule { margin, ..Rule::new(["default".into(), "default".into()]) };
    world.set_rules(vec![rule]).expect("a rule");
    world
}

/// Boxes, L's and prisms fall on plates with 4 to 16 holes: the step in which they meet is told as by a fresh world. A predicted motion is a
/// search at a negative depth, whose boxes must reach as far as its level does.
#[test]
fn what_falls_on_a_plate_with_holes_is_told_in_the_step_in_which_it_meets() {
    let options = StepOptions { clear: true, cell_limit: 20_000, ..StepOptions::default() };
    let found: Vec<Option<usize>> = (0..120u64)
        .into_par_iter()
        .map(|seed| {
            let mut r = Random::new(910_000 + seed);
            let (below, above) = (part(&plate(&mut r)), part(&block(&mut r)));
            let dt = [0.02, 0.05, 0.2][r.below(3)];
            let pace = [0.0, 1.0, 3.0][r.below(3)] * dt;
            let spin = r.vector(pace);
            let velocity = (DVec3::new(r.within(-0.3, 0.3), r.within(-0.3, 0.3), -1.0)) * dt;
            let height = r.within(1.2, 2.0);
            let mut pose = Pose::new(DVec3::new(r.within(-0.5, 0.5), r.within(-0.5, 0.5), height), r.rotation());
            let mut warm = two([&below, &above], [Pose::IDENTITY, pose], 0.0);
            for step in 0..(3.0 / dt) as usize {
                let motion = contactd_proto::Motion::turning(pose, pose.position + velocity, spin);
                let end = motion.at(1.0);
                let record = [PoseRecord::end(2, &end)];
                let mut cold = two([&below, &above], [Pose::IDENTITY, pose], 0.0);
                cold.restore(&[(2, MotionState::resting(pose))]).expect("a motion_state");
                cold.step(&record, &options).expect("a step");
                warm.step(&record, &options).expect("a step");
                assert!(
                    same(&reported(&warm), &reported(&cold)),
                    "seed {seed}, step {step}: {}",
                    differing(&reported(&warm), &reported(&cold))
                );
                if warm.outcome().contact {
                    return Some(step);
                }
                pose = warm.body(2).expect("a body").motion_state.end;
            }
            None
        })
        .collect();
    let met = found.iter().flatten().count();
    let late = found.iter().flatten().filter(|step| **step >= 5).count();
    assert!(met > 80 && late > 40, "{met} of 120 meet, {late} of them after five steps");
}

/// A body that stands in the list where one without bounds stood is followed like any other: ways beyond all numbers are not
/// inherited.
#[test]
fn a_body_in_the_place_of_one_without_bounds_is_followed() {
    let half = part(&Recipe::of(contactd::solid::primitive::HalfSpace));
    let cube = part(&Recipe::cuboid(0.5, 0.5, 0.5));
    let mut world = World::new(3, 8);
    let far = Pose::at(DVec3::Z * -50.0);
    for (id, part, pose) in [(1, &half, far), (2, &cube, Pose::at(DVec3::X * 9.0)), (3, &cube, Pose::IDENTITY)] {
        world.add_object(ObjectSpec::new(id, part, pose)).expect("an object");
    }
    let options = StepOptions::default();
    let tilted = Pose::new(DVec3::Z * -50.0, glam::DQuat::from_rotation_x(0.01));
    world.step(&[PoseRecord::end(1, &tilted)], &options).expect("a step");
    world.remove_object(1).expect("an object to remove");
    let mut met = 0;
    for k in 1..=20 {
        let at = Pose::at(DVec3::X * (9.0 - 0.5 * f64::from(k)));
        met += usize::from(world.step(&[PoseRecord::end(2, &at)], &options).expect("a step").contact);
    }
    assert_eq!(met, 4, "from the step that goes on beyond 1");
}

/// A body that ends a tenth of a millionth above a plate is within any larger margin before, whatever its faces are.
#[test]
fn a_small_margin_is_entered_by_boxes_as_by_others() {
    let shapes = [
        Recipe::cuboid(0.5, 0.4, 0.3),
        Recipe::cuboid(0.5, 0.15, 0.3).union(Recipe::cuboid(0.15, 0.15, 0.4).at(0.35, 0.0, 0.3)),
        Recipe::cylinder(0.4, 0.3),
        Recipe::cuboid(0.5, 0.4, 0.3).union(Recipe::sphere(0.45)),
    ];
    let options = StepOptions { clear: true, cell_limit: 50_000, ..StepOptions::default() };
    let mut r = Random::new(77);
    for (k, shape) in shapes.iter().cycle().take(12).enumerate() {
        let (below, above) = (part(&plate(&mut r)), part(shape));
        let start = Pose::new(DVec3::new(r.within(-0.4, 0.4), r.within(-0.4, 0.4), 1.6), r.rotation());
        let fall = DVec3::new(r.within(-0.2, 0.2), r.within(-0.2, 0.2), -2.5);
        let to = |t: f64| [PoseRecord::end(2, &Pose { position: start.position + fall * t, ..start })];
        let mut world = two([&below, &above], [Pose::IDENTITY, start], 0.0);
        let out = world.step(&to(1.0), &options).expect("a step");
        if out.pairs[0].outcome.status() != Status::Contact {
            continue;
        }
        let met = out.pairs[0].outcome.time();
        for margin in [1e-6, 1e-5, 1e-4, 1e-2] {
            let mut world = two([&below, &above], [Pose::IDENTITY, start], margin);
            let o = world.step(&to(met - 4e-8), &options).expect("a step").pairs[0].outcome;
            assert_eq!(o.status(), Status::Clear, "{k}, margin {margin}");
            // No sooner than where faces moved out by half the margin on both sides meet, at sharp corners.
            let soonest = 1.0 - 20.0 * margin / 2.5;
            assert!(o.margin_time < 1.0 && o.margin_time > soonest, "{k}, margin {margin}: {}", o.margin_time);
        }
    }
}

/// Bodies with sharp edges and tips that hover where a margin begins: {f <= level} reaches out of their boxes there, so that neither
/// boxes nor directions nor ways that were gone may show apart what a new session tells as within.
#[test]
fn what_hovers_at_a_margin_by_its_sharp_edges_is_told_as_by_a_new_session() {
    let options = StepOptions { clear: true, cell_limit: 20_000, ..StepOptions::default() };
    // A needle with a hole; f of its tip is as low as the margin a long way out of it.
    let needle = |r: &mut Random, half_angle: f64| {
        let height = r.within(0.2, 0.6);
        Recipe::cone(2.0 * height * half_angle.tan(), 0.0, height).minus(Recipe::sphere(0.2 * height * half_angle))
    };
    let found: Vec<[usize; 3]> = (0..hovering())
        .into_par_iter()
        .map(|seed| {
            let mut r = Random::new(920_000 + seed);
            let half_angle = r.within(0.02, 0.2);
            let margin = r.within(0.005, 0.06);
            let far = 0.5 * margin / half_angle.sin();
            let other = match r.below(3) {
                0 => needle(&mut r, half_angle),
                1 => Recipe::platonic(4, r.within(0.1, 0.4)).minus(Recipe::sphere(0.05)),
                _ => Recipe::cuboid(0.3, 0.1, 0.2).minus(Recipe::cylinder(0.05, 1.0)),
            };
            let parts = [part(&needle(&mut r, half_angle)), part(&other)];
            let turned = r.rotation();
            let reach = parts.each_ref().map(|part| part.model.radius);
            let away = turned * DVec3::Z * (reach[0] + r.within(0.3, 1.5) * far + r.within(0.0, 1.0) * reach[1]);
            let mut poses = [Pose::new(DVec3::ZERO, turned), Pose::new(away + r.vector(0.3 * reach[1]), r.rotation())];
            let mut warm = two([&parts[0], &parts[1]], poses, margin);
            let mut seen = [0; 3];
            for step in 0..8 {
                let pace = 10f64.powf(r.within(-3.0, -0.3));
                let ends = poses.map(|pose| {
                    let to = pose.position + r.vector(0.1 * margin * pace);
                    contactd_proto::Motion::turning(pose, to, r.vector(pace)).at(1.0)
                });
                let records = [PoseRecord::end(1, &ends[0]), PoseRecord::end(2, &ends[1])];
                let mut cold = two([&parts[0], &parts[1]], poses, margin);
                cold.restore(&[1, 2].map(|id| (id, MotionState::resting(poses[id as usize - 1]))))
                    .expect("motion states");
                cold.step(&records, &options).expect("a step");
                warm.step(&records, &options).expect("a step");
                let [mine, other] = [&warm, &cold].map(reported);
                assert!(same(&mine, &other), "seed {seed}, step {step}: {}", differing(&mine, &other));
                let outcome = cold.outcome().pairs[0].outcome;
                seen[0] += usize::from(outcome.status() == Status::Clear && outcome.margin_time < 1.0);
                seen[1] += usize::from(outcome.margin_time == 1.0);
                seen[2] += usize::from(warm.outcome().searched == warm.outcome().known);
                poses = [1, 2].map(|id| warm.body(id).expect("a body").motion_state.end);
            }
            seen
        })
        .collect();
    let [within, outside, known] = [0, 1, 2].map(|k| found.iter().map(|seen| seen[k]).sum::<usize>());
    println!("{within} steps within the margin, {outside} out of it, {known} without a search");
    let steps = 8 * hovering() as usize;
    assert!(
        within * 12 > steps && outside * 10 > steps && known * 10 > steps,
        "{within}, {outside}, {known} of {steps}"
    );
}

/// Pairs that hover, in plays of 8 steps: two in five of the steps of the random plays.
fn hovering() -> u64 {
    steps() as u64 / 20
}
