//! The effect `clearance`: bounds of the least distance over a step, against closed forms of unions of balls and rods and of boxes, on
//! their way by a motion of the test's own; of every pair that asks, wherever it is, whatever is remembered, and without a change of
//! any other bit. `CONTACTD_CLEARANCES=300` sets the number of random worlds (6 by default), of some steps each.

use contactd::octree::Model;
use contactd::world::{MeasuredModel, ObjectSpec, StepOptions, World, record};
use contactd_proto::contact_record::{CLEARANCE_POINTS, CLEARANCE_SETTLED, ClearanceSlot};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{ContactRecord, DetailSlot, Detect, EffectCounters, Pose, PoseRecord, Report, Rule};
use contactd_tests::least_distance::{Shape, Way, distance, least};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use contactd_tests::sweep::sized;
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A body, how the engine builds it, and its group.
struct Made {
    shape: Shape,
    recipe: Recipe,
    group: &'static str,
}

fn made(r: &mut Random) -> Made {
    if r.chance(0.25) {
        let half = r.vector(0.5).abs() + 0.1;
        return Made { shape: Shape::Box(half), recipe: Recipe::cuboid(half.x, half.y, half.z), group: "boxes" };
    }
    let is_rods = r.chance(0.4);
    let count = 1 + r.below(3);
    let mut rods = Vec::new();
    let mut recipe: Option<Recipe> = None;
    for _ in 0..count {
        let (pose, radius) = (Pose::new(r.vector(0.5), r.rotation()), r.within(0.1, 0.4));
        let half = if is_rods { r.within(0.1, 0.7) } else { 0.0 };
        rods.push(([-half, half].map(|z| pose.point(DVec3::Z * z)), radius));
        let leaf = if is_rods { Recipe::capsule(half, radius) } else { Recipe::sphere(radius) }.moved(&pose);
        recipe = Some(match recipe {
            None => leaf,
            Some(rest) => rest.union(leaf),
        });
    }
    let group = if is_rods { "rods" } else { "balls" };
    Made { shape: Shape::Rods(rods), recipe: recipe.expect("a leaf at least"), group }
}

/// The pairs of groups whose clearance is asked for.
const ASKED: [[&str; 2]; 4] = [["balls", "balls"], ["balls", "rods"], ["rods", "rods"], ["balls", "boxes"]];

fn rules(clearance: f64, detect: Detect) -> Vec<Rule> {
    let rule = |[a, b]: [&str; 2], clearance| {
        let report = if a == b { Report::Patch } else { Report::Contact };
        Rule { clearance, report, detect, ..Rule::new([a.into(), b.into()]) }
    };
    let mut rules: Vec<Rule> = ASKED.iter().map(|pair| rule(*pair, clearance)).collect();
    rules.push(rule(["rods", "boxes"], 0.0));
    rules
}

fn world(parts: &[Arc<MeasuredModel>], bodies: &[Made], starts: &[Pose], rules: Vec<Rule>) -> World {
    let mut world = World::new(64, 128);
    for (i, (part, pose)) in parts.iter().zip(starts).enumerate() {
        let spec = ObjectSpec::new(i as u32, part, *pose);
        let is_static = i % 4 == 3;
        world.add_object(ObjectSpec { group: bodies[i].group.into(), is_static, ..spec }).expect("an object");
    }
    world.set_rules(rules).expect("rules");
    world
}

/// What a step tells of each pair: its record and its further slots, without counts of work and places in the reply.
type Told = BTreeMap<(u32, u32), (ContactRecord, Vec<ContactRecord>)>;

fn told(world: &World) -> Told {
    let out = world.outcome();
    let slots: Vec<ContactRecord> =
        (0..record::slots_of(out, true)).map(|i| record::slot(world, out, true, i)).collect();
    let bare = |slot: &ContactRecord| match (slot.as_detail(), slot.as_clearance()) {
        (Some(detail), _) => DetailSlot { cells: 0, ..*detail }.into(),
        (_, Some(clearance)) => ClearanceSlot { cells: 0, ..*clearance }.into(),
        (None, None) => *slot,
    };
    let each = slots[..out.pairs.len()].iter().map(|record| {
        let own = &slots[record.slot as usize..][..record.slots as usize];
        ((record.a, record.b), (ContactRecord { slot: 0, slots: 0, ..*record }, own.iter().map(bare).collect()))
    });
    each.collect()
}

/// Numbers of one slot are not numbers of another kind: bytes are compared.
fn bits(told: &(ContactRecord, Vec<ContactRecord>)) -> Vec<u8> {
    [bytemuck::bytes_of(&told.0), bytemuck::cast_slice(&told.1)].concat()
}

fn clearance_of(told: &(ContactRecord, Vec<ContactRecord>)) -> Option<ClearanceSlot> {
    told.1.iter().find_map(|slot| slot.as_clearance().copied())
}

/// Bounds that hold: never more than the judge finds, and not less by more than was asked.
fn check(slot: &ClearanceSlot, a: &Way, b: &Way, discrete: bool, tolerance: f64) -> Option<String> {
    let expected = if discrete { distance(a, b, 1.0) } else { least(a, b) };
    // Within rounding of poses that the judge works out in its own way.
    let slack = 1e-9;
    let is_bracketed = slot.lower <= expected + slack && slot.upper >= expected - slack - 1e-7;
    let is_near = slot.upper - slot.lower <= tolerance + slack;
    if !(is_bracketed && is_near && slot.flags == CLEARANCE_SETTLED | CLEARANCE_POINTS && slot.tolerance == tolerance) {
        return Some(format!("{expected:e}: {slot:?}"));
    }
    // Its points are as far apart, and each on its body.
    let [x, y] = slot.points.map(DVec3::from_array);
    let point = |x: DVec3| Way {
        shape: Shape::Rods(vec![([x; 2], 0.0)]),
        start: (DMat3::IDENTITY, DVec3::ZERO),
        velocity: DVec3::ZERO,
        spin: DVec3::ZERO,
    };
    let t = if discrete { 1.0 } else { slot.time };
    let of = |body: &Way, x: DVec3| {
        let still = Way { start: body.at(t), velocity: DVec3::ZERO, spin: DVec3::ZERO, ..body.clone() };
        distance(&still, &point(x), 0.0)
    };
    let off = of(a, x).max(of(b, y)).max((x - y).length() - slot.upper);
    (off > 1e-9).then(|| format!("its points are {off:e} off: {slot:?}"))
}

#[test]
fn every_pair_that_asks_is_told_its_least_distance_and_nothing_else_changes() {
    let (mut pairs, mut far, mut met, mut plain, mut known) = (0, 0, 0, 0, 0);
    let mut failures = Vec::new();
    for k in 0..sized("CONTACTD_CLEARANCES", 6u64) {
        let mut r = Random::new(903 + k);
        let bodies: Vec<Made> = (0..4 + r.below(4)).map(|_| made(&mut r)).collect();
        let model = |made: &Made| Arc::new(MeasuredModel::new(Arc::new(Model::new(made.recipe.clone().build()))));
        let parts: Vec<_> = bodies.iter().map(model).collect();
        let wide = if r.chance(0.3) { 8.0 } else { 1.5 };
        let mut poses: Vec<Pose> = bodies.iter().map(|_| Pose::new(r.vector(wide), r.rotation())).collect();
        let (tolerance, discrete) = ([1e-3, 1e-6][r.below(2)], r.chance(0.2));
        let detect = if discrete { Detect::Discrete } else { Detect::Continuous };
        let new = |clearance| world(&parts, &bodies, &poses, rules(clearance, detect));
        // One that remembers, one that forgets before each step, one that is not asked.
        let (mut own, mut forgetful, mut without) = (new(tolerance), new(tolerance), new(0.0));
        let options = StepOptions::default();
        for _ in 0..4 {
            let mut records = Vec::new();
            let mut ways = Vec::new();
            for (i, made) in bodies.iter().enumerate() {
                if i % 4 != 3 && r.chance(0.5) {
                    // Put elsewhere, so that they do not all fly apart.
                    poses[i] = Pose::new(r.vector(wide), r.rotation());
                    records.push(PoseRecord::start(i as u32, &poses[i]));
                }
                let start = poses[i];
                let rests = i % 4 == 3 || r.chance(0.3);
                let velocity = if rests { DVec3::ZERO } else { r.vector(1.5) };
                let spin = if rests || r.chance(0.3) { DVec3::ZERO } else { r.vector(1.5) };
                let (shape, at) = (made.shape.clone(), (DMat3::from_quat(start.rotation), start.position));
                ways.push(Way { shape, start: at, velocity, spin });
                if !rests {
                    let end = start.position + velocity;
                    records.push(PoseRecord::turn(i as u32, end, spin));
                    poses[i] = Pose::new(end, quat_of_rotation_vector(spin) * start.rotation);
                }
            }
            own.step(&records, &options).expect("a step");
            forgetful.forget();
            forgetful.step(&records, &options).expect("a step");
            without.step(&records, &options).expect("a step");
            let (told_own, told_without) = (told(&own), told(&without));
            let told_forgetful = told(&forgetful);
            let differs = told_own.iter().find(|(key, own)| told_forgetful.get(key).map(bits) != Some(bits(own)));
            assert!(
                differs.is_none() && told_own.len() == told_forgetful.len(),
                "world {k}: what is remembered changes an answer: {differs:#?}"
            );
            let mut expected = 0;
            for (i, a) in ways.iter().enumerate() {
                for (j, b) in ways.iter().enumerate().skip(i + 1) {
                    let groups = [bodies[i].group, bodies[j].group];
                    let is_asked = ASKED.iter().any(|[p, q]| groups == [*p, *q] || groups == [*q, *p])
                        && !(i % 4 == 3 && j % 4 == 3);
                    let key = (i as u32, j as u32);
                    let slot = told_own.get(&key).and_then(clearance_of);
                    assert_eq!(slot.is_some(), is_asked, "world {k}: {key:?} of {groups:?}");
                    let Some(slot) = slot else { continue };
                    expected += 1;
                    far += usize::from(slot.lower > 3.0);
                    met += usize::from(slot.upper == 0.0);
                    failures.extend(
                        check(&slot, a, b, discrete, tolerance).map(|text| format!("world {k}, {key:?}: {text}")),
                    );
                    // The rest of it is told as if nobody had asked.
                    let mut rest = told_own[&key].clone();
                    rest.1.retain(|slot| slot.as_clearance().is_none());
                    match told_without.get(&key) {
                        Some(other) => assert!(bits(&rest) == bits(other), "world {k}: {key:?}"),
                        None => assert_eq!((rest.0.status, rest.0.flags), (2, 0), "world {k}: {key:?}"),
                    }
                }
            }
            plain += told_own.len() - expected;
            assert!(told_without.keys().all(|key| told_own.contains_key(key)), "world {k}");
            let counters = |world: &World| world.outcome().effect_counters;
            // What rests as it did is known; nothing else.
            assert_eq!(counters(&forgetful).clearances, expected as u64, "world {k}");
            known += expected as u64 - counters(&own).clearances;
            if !discrete {
                let rests = |way: &Way| way.velocity == DVec3::ZERO && way.spin == DVec3::ZERO;
                let resting = ways.iter().filter(|way| rests(way)).count() as u64;
                assert!(expected as u64 - counters(&own).clearances <= resting * resting, "world {k}");
            }
            assert_eq!(counters(&without).clearances, 0);
            if !discrete {
                assert_eq!(own.outcome().safe_time.to_bits(), without.outcome().safe_time.to_bits());
            }
            // A pair that is told in any case is searched where boxes meet, another one where no direction keeps it apart either.
            let others = |world: &World| EffectCounters {
                clearances: 0,
                continuous: 0,
                discrete: 0,
                turning: 0,
                ..counters(world)
            };
            assert_eq!(others(&own).bits() & !others(&without).bits(), 0, "world {k}: another effect ran");
            pairs += expected;
        }
    }
    println!("{pairs} clearances, {far} far apart, {met} of 0, {known} known, {plain} pairs beside");
    assert!(known > 3, "{known}");
    assert!(failures.is_empty(), "{} wrong, such as {:#?}", failures.len(), &failures[..failures.len().min(4)]);
    assert!(pairs > 100 && far > 5 && met > 5, "{pairs} {far} {met}");
}

/// Where a rule asks for clearances of groups that have no objects a step counts what it counts without the rule, every count of it.
#[test]
fn a_clearance_that_no_pair_asks_for_costs_nothing() {
    let mut counted = 0;
    for k in 0..12 {
        let mut r = Random::new(77 + k);
        let bodies: Vec<Made> = (0..8).map(|_| made(&mut r)).collect();
        let model = |made: &Made| Arc::new(MeasuredModel::new(Arc::new(Model::new(made.recipe.clone().build()))));
        let parts: Vec<_> = bodies.iter().map(model).collect();
        let poses: Vec<Pose> = bodies.iter().map(|_| Pose::new(r.vector(1.5), r.rotation())).collect();
        let plain = rules(0.0, Detect::Continuous);
        let asked = Rule { clearance: 1e-6, ..Rule::new(["nobody".into(), "balls".into()]) };
        let [mut with, mut without] =
            [[plain.clone(), vec![asked]].concat(), plain].map(|rules| world(&parts, &bodies, &poses, rules));
        for _ in 0..3 {
            let moved = (0..bodies.len()).filter(|i| i % 4 != 3);
            let records: Vec<PoseRecord> =
                moved.map(|i| PoseRecord::turn(i as u32, r.vector(1.5), r.vector(1.0))).collect();
            for world in [&mut with, &mut without] {
                world.step(&records, &StepOptions::default()).expect("a step");
            }
            let [told, expected] = [&with, &without].map(|world| record::reply(world.outcome(), true));
            assert_eq!(told, expected);
            counted += expected.counters.box_tests + expected.counters.primitives;
        }
    }
    assert!(counted > 500, "{counted}");
}
