//! Steps of small worlds whose answers can be worked out by hand.

use contactd::contact::{Counters, Status};
use contactd::octree::Model;
use contactd::solid::primitive::{Cuboid, Cylinder, Sphere};
use contactd::solid::{Label, Op, SolidBuilder};
use contactd::world::{
    MeasuredModel, ObjectSpec, PairOutcome, Refusal, StepError, StepOptions, StepOutcome, World, record,
};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::pose_record::{END, START};
use contactd_proto::{Detect, ErrorCode, Pose, PoseRecord, Report, Rule};
use contactd_tests::models::{pierced, simple};
use glam::{DQuat, DVec3};
use std::sync::Arc;

fn part(model: Model) -> Arc<MeasuredModel> {
    Arc::new(MeasuredModel::new(Arc::new(model)))
}

fn ball(radius: f64) -> Arc<MeasuredModel> {
    part(simple(Sphere { radius }))
}

fn slab(half: DVec3) -> Arc<MeasuredModel> {
    part(simple(Cuboid { half }))
}

fn object(id: u32, part: &Arc<MeasuredModel>, at: DVec3) -> ObjectSpec {
    ObjectSpec::new(id, part, Pose::at(at))
}

/// A slab with a drilled hole far aside: what meets it is answered by the search, not in front of it.
fn drilled(half: DVec3) -> Arc<MeasuredModel> {
    let aside = Pose::at(DVec3::new(-0.5 * half.x, 0.0, 0.0));
    let drill = Cylinder { radius: 0.1 * half.x, half_height: 2.0 * half.z };
    part(pierced(Cuboid { half }, vec![(drill.into(), aside)]))
}

/// A floor (1, static, top at z = 0) and balls of radius 1 (2, 3, …) at z = 3, four apart.
fn balls(n: u32) -> World {
    balls_over(slab(DVec3::new(1e3, 1e3, 1.0)), n)
}

fn balls_over(floor: Arc<MeasuredModel>, n: u32) -> World {
    let mut world = World::new(2000, 4096);
    world.add_object(ObjectSpec { is_static: true, group: "floor".into(), ..object(1, &floor, -DVec3::Z) }).unwrap();
    let part = ball(1.0);
    for i in 0..n {
        world.add_object(object(2 + i, &part, DVec3::new(4.0 * f64::from(i), 0.0, 3.0))).unwrap();
    }
    world
}

fn to(id: u32, x: f64, z: f64) -> PoseRecord {
    PoseRecord::end(id, &Pose::at(DVec3::new(x, 0.0, z)))
}

fn keys(out: &StepOutcome) -> Vec<(u32, u32, Status)> {
    out.pairs.iter().map(|p| (p.a, p.b, p.outcome.status())).collect()
}

#[test]
fn contacts_come_by_time_whatever_the_order_of_the_batch() {
    let records = [to(2, 0.0, 0.0), to(3, 4.0, -1.0), to(4, 8.0, 2.5)];
    // Ball 2 sinks by 3 and touches after 2, ball 3 sinks by 4 and touches after 2.
    let expected = [(1, 3, 0.5), (1, 2, 2.0 / 3.0)];
    let mut answers = Vec::new();
    for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
        let mut world = balls(3);
        let batch = order.map(|i| records[i]);
        let out = world.step(&batch, &StepOptions::default()).unwrap();
        assert!(out.contact && !out.undecided && !out.truncated);
        for (p, (a, b, time)) in out.pairs.iter().zip(expected) {
            assert_eq!((p.a, p.b, p.outcome.status()), (a, b, Status::Contact));
            assert!((p.outcome.time() - time).abs() < 1e-9, "{}", p.outcome.time());
            assert!(
                (p.outcome.point().unwrap().normal - DVec3::Z).length() < 1e-9,
                "from the floor, the smaller id, to the ball"
            );
        }
        assert_eq!(out.pairs.len(), 2);
        assert_eq!(out.safe_time, out.pairs[0].outcome.time_lower());
        answers.push(out.pairs.iter().map(|p| p.outcome).collect::<Vec<_>>());
    }
    assert_eq!(answers[0], answers[1]);
    assert_eq!(answers[0], answers[2]);
}

#[test]
fn first_and_max_records_keep_the_earliest() {
    let balls = || balls_over(drilled(DVec3::new(1e3, 1e3, 1.0)), 3);
    let records = [to(2, 0.0, 0.0), to(3, 4.0, -1.0), to(4, 8.0, -1.0)];
    let first = StepOptions { first: true, ..StepOptions::default() };
    assert_eq!(
        keys(balls().step(&records, &first).unwrap()),
        [(1, 3, Status::Contact), (1, 4, Status::Contact)],
        "two contacts at the same time are both first"
    );
    let all = balls().step(&records, &StepOptions::default()).unwrap().clone();
    let mut world = balls();
    let out = world.step(&records, &first).unwrap();
    let same = |p: &PairOutcome| all.pairs.iter().any(|q| (q.a, q.b, &q.outcome) == (p.a, p.b, &p.outcome));
    assert!(out.pairs.iter().all(same), "asking for less changes no bit of what remains");
    assert!(out.counters.cells <= all.counters.cells && out.safe_time == all.safe_time);
    let capped = StepOptions { max_records: 1, ..StepOptions::default() };
    let mut world = balls();
    let out = world.step(&records, &capped).unwrap();
    assert_eq!(keys(out), [(1, 3, Status::Contact)]);
    assert!(out.truncated);
}

#[test]
fn a_refused_batch_changes_nothing() {
    let good = to(2, 0.0, 2.0);
    let q = |rotation| PoseRecord { rotation, ..to(3, 4.0, 2.0) };
    let table = [
        (vec![good, PoseRecord { position: [f64::NAN, 0.0, 0.0], ..to(3, 0.0, 0.0) }], ErrorCode::NotFinite, Some(1)),
        (vec![good, PoseRecord { position: [f64::INFINITY; 3], ..to(3, 0.0, 0.0) }], ErrorCode::NotFinite, Some(1)),
        (vec![good, q([f64::NAN; 4])], ErrorCode::NotFinite, Some(1)),
        (vec![good, q([0.0; 4])], ErrorCode::BadQuaternion, Some(1)),
        (vec![good, to(99, 0.0, 0.0)], ErrorCode::UnknownObject, Some(1)),
        (vec![good, to(1, 0.0, 0.0)], ErrorCode::StaticObject, Some(1)),
        (vec![good, to(3, 4.0, 2.0), good], ErrorCode::DuplicateObject, Some(2)),
        (vec![good, PoseRecord { flags: 3, ..to(3, 4.0, 2.0) }], ErrorCode::BadCount, Some(1)),
        (vec![to(2, 0.0, 1e200)], ErrorCode::NotFinite, Some(0)),
        (vec![good; 5000], ErrorCode::TooMany, None),
    ];
    for (batch, code, index) in table {
        let mut world = balls(2);
        let before: Vec<_> = world.bodies().iter().map(|b| b.motion_state).collect();
        let error = world.step(&batch, &StepOptions::default()).unwrap_err();
        assert_eq!(error, StepError { code, index });
        assert!(error.to_string().len() > 20, "{error}");
        assert_eq!(before, world.bodies().iter().map(|b| b.motion_state).collect::<Vec<_>>(), "{code:?}");
        // And the next good batch is answered as if the bad one had never been.
        let after = world.step(&[good], &StepOptions::default()).unwrap().clone();
        assert_eq!(after.pairs, balls(2).step(&[good], &StepOptions::default()).unwrap().pairs);
    }
    for (advance, dt) in [(f64::NAN, 0.0), (1.5, 0.0), (-0.1, 0.0), (1.0, f64::NAN), (1.0, -1.0)] {
        let options = StepOptions { advance, dt, ..StepOptions::default() };
        let error = balls(1).step(&[good], &options).unwrap_err();
        assert_eq!(error, StepError { code: ErrorCode::BadNumber, index: None });
    }
}

#[test]
fn bodies_that_swing_about_their_places_are_not_paired_anew() {
    // Three balls, 4 apart: the first and the last swing, the one between rests; in all much farther than their boxes are grown for.
    let mut world = balls(3);
    let mut tests = 0;
    for step in 1..=400 {
        let x = if step % 2 == 0 { 0.0 } else { 0.2 };
        let out = world.step(&[to(2, x, 3.0), to(4, 8.0 - x, 3.0)], &StepOptions::default()).unwrap();
        assert!(!out.contact);
        tests += if step > 2 { out.box_tests } else { 0 };
    }
    assert_eq!(tests, 0);
    // Who goes on leaves its box all the same, by small steps, and meets the one between them: centres 2 apart at x = 2.
    for k in 1..10 {
        let out = world.step(&[to(2, 0.2 * f64::from(k), 3.0)], &StepOptions::default()).unwrap();
        assert!(!out.contact);
    }
    let out = world.step(&[to(2, 2.1, 3.0)], &StepOptions::default()).unwrap();
    assert_eq!(keys(out), [(2, 3, Status::Contact)]);
    assert!((out.pairs[0].outcome.time() - 0.2 / 0.3).abs() < 1e-9);
}

#[test]
fn steps_continue_where_the_last_one_ended_or_was_stopped() {
    let mut world = balls(1);
    world.step(&[to(2, 8.0, 3.0)], &StepOptions::default()).unwrap();
    // Stopped half-way: the ball stands at x = 4 and falls from there.
    let half = StepOptions { advance: 0.5, ..StepOptions::default() };
    world.step(&[to(2, 4.0, 0.0)], &half).unwrap();
    assert_eq!(world.body(2).unwrap().motion_state.motion.start.position, DVec3::new(4.0, 0.0, 3.0));
    // Not named: it stays where the stopped step left it.
    let out = world.step(&[], &StepOptions { advance: 1.0 / 3.0, ..StepOptions::default() }).unwrap();
    assert!(!out.contact && out.safe_time == 1.0);
    let body = world.body(2).unwrap();
    assert!(
        body.motion_state.is_rest() && (body.motion_state.end.position - DVec3::new(4.0, 0.0, 2.0)).length() < 1e-15
    );
    // Put elsewhere and moved in the same batch, in whichever order.
    let start = PoseRecord { flags: START, ..to(2, 100.0, 5.0) };
    world.step(&[to(2, 100.0, 1.5), start], &StepOptions::default()).unwrap();
    assert_eq!(world.body(2).unwrap().motion_state.motion.start.position.x, 100.0);
    assert_eq!(world.body(2).unwrap().motion_state.end.position, DVec3::new(100.0, 0.0, 1.5));
}

#[test]
fn from_where_a_restored_track_has_led_beyond_all_numbers_no_way_is_taken() {
    let mut world = World::new(1, 1);
    world.add_object(object(1, &ball(1.0), DVec3::ZERO)).unwrap();
    let velocity = DVec3::X * 1e200;
    let motion = contactd_proto::Motion { velocity, ..contactd_proto::Motion::resting(Pose::IDENTITY) };
    world.restore(&[(1, contactd_proto::MotionState { motion, end: Pose::IDENTITY })]).unwrap();
    let half = StepOptions { advance: 0.5, ..StepOptions::default() };
    let error = world.step(&[to(1, 0.0, 0.0)], &half).unwrap_err();
    assert_eq!(error, StepError { code: ErrorCode::NotFinite, index: Some(0) });
    // Taken whole it ends where it was said to.
    world.step(&[to(1, 1.0, 0.0)], &StepOptions::default()).unwrap();
    assert_eq!(world.body(1).unwrap().motion_state.end.position, DVec3::X);
}

#[test]
fn a_turn_is_kept_whole() {
    let mut world = World::new(10, 10);
    let bar = slab(DVec3::new(3.0, 0.1, 0.1));
    world.add_object(object(1, &bar, DVec3::ZERO)).unwrap();
    world.add_object(object(2, &ball(0.5), DVec3::new(0.0, 2.0, 0.0))).unwrap();
    // A whole turn ends where it began: only the rotation vector tells that the bar sweeps over the ball.
    let still = PoseRecord { object: 1, flags: END, position: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };
    assert!(!world.step(&[still], &StepOptions::default()).unwrap().contact);
    let turn = PoseRecord::turn(1, DVec3::ZERO, DVec3::Z * std::f64::consts::TAU);
    let out = world.step(&[turn], &StepOptions::default()).unwrap();
    assert!(out.contact && out.pairs[0].outcome.time() < 0.25, "{out:?}");
}

#[test]
fn rules_and_static_bodies_leave_pairs_out() {
    let records = [to(2, 0.0, 0.0), to(3, 4.0, 0.0)];
    let mut world = balls(2);
    let mut rule = Rule::new(["floor".into(), "default".into()]);
    rule.except = vec![["object 3".into(), "object 1".into()]];
    rule.report = Report::Time;
    world.set_rules(vec![rule]).unwrap();
    assert_eq!(keys(world.step(&records, &StepOptions::default()).unwrap()), [(1, 2, Status::Contact)]);
    assert!(world.plan_of(1, 2).is_some() && world.plan_of(1, 3).is_none() && world.plan_of(2, 3).is_none());
    world.set_rules(vec![]).unwrap();
    assert!(world.plan_of(2, 3).is_some());
    let bad = Rule { margin: f64::NAN, ..Rule::new(["a".into(), "b".into()]) };
    let refusal = world.set_rules(vec![Rule::new(["a".into(), "b".into()]), bad]).unwrap_err();
    assert_eq!((refusal.code, refusal.index), (ErrorCode::BadRule, Some(1)));

    let mut still = balls(0);
    let floor = slab(DVec3::ONE);
    still.add_object(ObjectSpec { is_static: true, ..object(2, &floor, DVec3::ZERO) }).unwrap();
    let out = still.step(&[], &StepOptions::default()).unwrap();
    assert_eq!((out.searched, out.box_tests), (0, 0), "two static bodies in overlap are no pair");
}

#[test]
fn a_discrete_pair_is_tested_at_its_end() {
    let rule = Rule { detect: Detect::Discrete, ..Rule::new(["floor".into(), "default".into()]) };
    let mut world = balls(1);
    world.set_rules(vec![rule]).unwrap();
    let through = world.step(&[to(2, 0.0, -9.0)], &StepOptions::default()).unwrap();
    assert_eq!((through.pairs.len(), through.may_have_passed), (0, 1), "passed through, and said so");
    let into = world.step(&[to(2, 0.0, 0.5)], &StepOptions::default()).unwrap();
    assert_eq!(into.pairs[0].outcome.status(), Status::Overlap);
    assert_eq!((into.pairs[0].outcome.time(), into.safe_time), (1.0, 1.0));
}

#[test]
fn declarations_are_held() {
    let mut world = World::new(10, 10);
    let part = ball(1.0);
    world.add_object(ObjectSpec { rotates: false, ..object(1, &part, DVec3::ZERO) }).unwrap();
    world.add_object(ObjectSpec { max_speed: 10.0, ..object(2, &part, DVec3::X * 9.0) }).unwrap();
    let turned = Pose::new(DVec3::ZERO, quat_of_rotation_vector(DVec3::Z * 1e-3));
    let dt = |dt| StepOptions { dt, ..StepOptions::default() };
    let broken = |e: Result<&StepOutcome, StepError>| e.err().map(|e| (e.code, e.index));
    let declaration = Some((ErrorCode::Declaration, Some(0)));
    assert_eq!(broken(world.step(&[PoseRecord::end(1, &turned)], &dt(1.0))), declaration);
    let far = PoseRecord::end(2, &Pose::at(DVec3::X * 9.0 + DVec3::Y * 2.0));
    assert_eq!(broken(world.step(&[far], &dt(0.1))), declaration, "20 per second");
    assert_eq!(broken(world.step(&[far], &dt(0.0))), declaration, "a speed needs a duration");
    assert_eq!(broken(world.step(&[far], &dt(0.25))), None);
    let spin = PoseRecord::turn(2, DVec3::X * 9.0 + DVec3::Y * 2.0, DVec3::Z * 20.0);
    assert_eq!(broken(world.step(&[spin], &dt(1.0))), declaration, "its rim is faster than its centre");
}

#[test]
fn every_pair_is_told_when_asked_and_far_ones_cost_nothing() {
    let clear = StepOptions { clear: true, ..StepOptions::default() };
    let mut world = balls(4);
    let out = world.step(&[to(2, 0.0, 2.5)], &clear).unwrap();
    assert_eq!(out.pairs.len(), 10, "4 balls and the floor");
    assert!(out.pairs.iter().all(|p| p.outcome.status() == Status::Clear && p.outcome.time() == 1.0));
    assert_eq!((out.searched, out.counters.cells), (0, 0));
}

#[test]
fn objects_come_and_go_by_ids_that_are_never_used_again() {
    let mut world = balls(2);
    let part = ball(1.0);
    let code = |r: Result<(), Refusal>| r.map_err(|e| e.code);
    assert_eq!(code(world.add_object(object(3, &part, DVec3::ZERO))), Err(ErrorCode::DuplicateObject));
    world.remove_object(2).unwrap();
    assert_eq!(code(world.remove_object(2)), Err(ErrorCode::UnknownObject));
    assert_eq!(code(world.add_object(object(2, &part, DVec3::ZERO))), Err(ErrorCode::DuplicateObject));
    assert_eq!(keys(world.step(&[to(3, 4.0, 0.0)], &StepOptions::default()).unwrap()), [(1, 3, Status::Contact)]);
    let crooked = ObjectSpec {
        place: Pose::new(DVec3::ZERO, DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
        ..object(9, &part, DVec3::ZERO)
    };
    assert_eq!(code(world.add_object(crooked)), Err(ErrorCode::BadQuaternion));
    let mut small = World::new(1, 1);
    small.add_object(object(1, &part, DVec3::ZERO)).unwrap();
    assert_eq!(code(small.add_object(object(2, &part, DVec3::ZERO))), Err(ErrorCode::LimitObjects));
    for (resolution, fits) in [(1e-6, true), (0.4, true), (0.5, false), (0.0, false), (f64::NAN, false)] {
        assert_eq!(small.set_resolution(Some(resolution)).is_ok(), fits, "{resolution} in a ball of diameter 2");
    }
}

#[test]
fn a_contact_says_whether_the_pair_touched_at_the_start() {
    // A corner: a floor and a wall in one body. What slides along the floor into the wall touches all the while.
    let mut b = SolidBuilder::new();
    let floor = b.primitive(Cuboid { half: DVec3::new(9.0, 9.0, 1.0) }, Pose::at(-DVec3::Z), Label::default());
    let wall = Cuboid { half: DVec3::new(1.0, 9.0, 9.0) };
    let wall = b.primitive(wall, Pose::at(DVec3::new(5.0, 0.0, 0.0)), Label::default());
    let root = b.operation(Op::Union, &[floor, wall]);
    let corner = Arc::new(MeasuredModel::new(Arc::new(Model::new(b.finish(root)))));
    for (height, x, down, expected) in [
        (1.0, 6.0, 0.0, (true, 0.5)),
        (1.0, 6.0, -1.0, (true, 0.0)),
        (1.5, 6.0, 0.0, (false, 0.5)),
        (1.5, 0.0, -1.0, (false, 0.5)),
    ] {
        let mut world = World::new(10, 10);
        world.add_object(ObjectSpec { is_static: true, ..object(1, &corner, DVec3::ZERO) }).unwrap();
        world.add_object(object(2, &slab(DVec3::ONE), DVec3::new(0.0, 0.0, height))).unwrap();
        let out = world.step(&[to(2, x, height + down)], &StepOptions::default()).unwrap();
        let o = out.pairs[0].outcome;
        assert_eq!((o.touching, o.status()), (expected.0, Status::Contact), "{height} {x} {down}");
        assert!((o.time() - expected.1).abs() < 1e-15, "{height} {x} {down}: {}", o.time());
    }
}

#[test]
fn resting_pairs_are_told_with_their_regions_and_cost_nothing_unasked() {
    use contactd_proto::contact_record as wire;
    let resting = |rule: Option<Rule>| {
        let mut world = World::new(10, 10);
        let (floor, cube) = (slab(DVec3::new(9.0, 9.0, 1.0)), slab(DVec3::ONE));
        world
            .add_object(ObjectSpec { is_static: true, group: "floor".into(), ..object(1, &floor, -DVec3::Z) })
            .unwrap();
        for (id, x) in [(2, 0.0), (3, 3.0)] {
            world.add_object(object(id, &cube, DVec3::new(x, 0.0, 1.0))).unwrap();
        }
        world.set_rules(rule.into_iter().collect()).unwrap();
        world
    };
    // Nobody asks: no record, no work.
    let mut world = resting(None);
    let out = world.step(&[], &StepOptions::default()).unwrap();
    assert_eq!((out.pairs.len(), out.regions.len(), out.counters.instant_cells), (0, 0, 0));
    // Asked for by patches, or by a margin; with detail slots between and without.
    let rule = |report: Report, margin: f64| Rule { report, margin, ..Rule::new(["floor".into(), "default".into()]) };
    for (rule, details) in
        [(rule(Report::Patch, 0.0), false), (rule(Report::Patch, 0.0), true), (rule(Report::Contact, 1e-3), true)]
    {
        let near = if rule.margin > 0.0 { wire::WITHIN_MARGIN } else { 0 };
        let mut world = resting(Some(rule));
        world.step(&[], &StepOptions::default()).unwrap();
        let out = world.outcome();
        assert_eq!(keys(out), [(1, 2, Status::Clear), (1, 3, Status::Clear)]);
        assert!(out.pairs.iter().all(|p| p.outcome.touching && out.regions_of(p).len() == 1));
        assert!(out.pairs.iter().all(|p| p.regions_complete && p.outcome.counters.instant_cells > 0));
        let total = record::slots_of(out, details);
        assert_eq!(total, 2 * if details { 4 } else { 3 });
        let slots: Vec<_> = (0..total).map(|i| record::slot(&world, out, details, i)).collect();
        for (r, x) in slots[..2].iter().zip([0.0, 3.0]) {
            assert_eq!((r.status, r.flags), (wire::CLEAR, wire::TOUCHING | near));
            assert_eq!((r.separation, r.normal_speed), (0.0, 0.0));
            assert_eq!(r.normal, [0.0, 0.0, 1.0]);
            assert!(r.valid & wire::VALID_POINT != 0 && r.valid & wire::VALID_KIND != 0);
            let own = &slots[r.slot as usize..][..r.slots as usize];
            assert_eq!(own.iter().filter(|s| s.as_detail().is_some()).count(), usize::from(details));
            let region = own.iter().find_map(|s| s.as_region()).expect("a region");
            assert_eq!((region.kind, region.extent, region.points, region.normal), (1, 3, 4, [0.0, 0.0, 1.0]));
            let patch = own.iter().find_map(|s| s.as_patch()).expect("its points");
            assert_eq!((patch.count, patch.region, patch.separations), (4, [0, 0], [0.0; 4]));
            assert!(patch.points.iter().all(|p| (p[0] - x).abs() == 1.0 && p[1].abs() == 1.0 && p[2] == 0.0));
        }
    }
    // At rest, and put at its own place again: the same bits from step to step.
    let mut world = resting(Some(rule(Report::Patch, 0.0)));
    let mut reported = |records: &[PoseRecord]| {
        let out = world.step(records, &StepOptions::default()).unwrap();
        // What they cost may differ: it is remembered that nothing has changed.
        let free = |p: &PairOutcome| {
            let mut told = *p;
            told.outcome.counters = Counters::default();
            told
        };
        (out.pairs.iter().map(free).collect::<Vec<_>>(), out.regions.clone())
    };
    let first = reported(&[]);
    for k in 0..4 {
        let again = [to(2, 0.0, 1.0), to(3, 3.0, 1.0)];
        assert_eq!(reported(&again[..k % 3]), first, "step {k}");
    }
    assert_eq!(world.outcome().counters, Counters::default(), "nothing has changed, nothing is looked for");
    // No room for all of them: the earliest pairs keep theirs, and the header says that some are missing.
    let mut world = resting(Some(rule(Report::Patch, 0.0)));
    world.step(&[], &StepOptions { max_patch_slots: 3, ..StepOptions::default() }).unwrap();
    let out = world.outcome();
    assert!(out.truncated && record::slots_of(out, false) == 4);
}
