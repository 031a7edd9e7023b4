//! A scene pays for what it asks: each effect's counter is exactly 0 when it is off and the number worked out by hand when
//! it is on, and asking for less changes no bit of what remains. Over embedded sessions, so that what is compared is what a
//! client reads. `CONTACTD_MARGINS` sets the number of random pairs with a margin (`CONTACTD_MARGINS=60`).

use contactd::contact::distance::{DistanceQuery, over_step, over_step_heeding};
use contactd::contact::margin::{MARGIN_SLACK, apart_until};
use contactd::contact::{QueryOptions, Scratch, Status, Verdict, earliest_contact};
use contactd::ipc::{Embedded, ServerConfig};
use contactd::math::halt::{Halt, heeding};
use contactd::octree::Model;
use contactd_client::{Error, Object, Session};
use contactd_proto::contact_record::{
    CLEAR, CONTACT, OVERLAP, SENSOR, TOUCHING, VALID_NORMAL, VALID_POINT, VALID_TIME, WITHIN_MARGIN,
};
use contactd_proto::{
    ContactRecord, DetailSlot, Detect, EffectCounters, ErrorCode, InitialOverlap, Motion, Pose, PoseRecord, Report,
    Rule, StepReply,
};
use contactd_tests::engine::question_of;
use contactd_tests::random_solids::Random;
use contactd_tests::reference::{Moving, deepest};
use contactd_tests::scenes::{self, Recipe};
use contactd_tests::sweep::sized;
use glam::DVec3;
use std::sync::Arc;
use std::time::Duration;

/// A plate whose top is at z = 0, with a hole far from everything: what meets it takes a search.
const FLOOR: &str = "difference() {
    multmatrix([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -1], [0, 0, 0, 1]]) { cube(size = [100, 100, 2], center = true); }
    multmatrix([[1, 0, 0, -40], [0, 1, 0, -40], [0, 0, 1, 0], [0, 0, 0, 1]]) {
        cylinder(h = 9, r1 = 1, r2 = 1, center = true);
    }
}";
const BALL: &str = "sphere(r = 1);";
const BOX: &str = "cube(size = [2, 2, 2], center = true);";

/// What a client reads of a step.
#[derive(Clone, Debug, PartialEq)]
struct Answer {
    header: StepReply,
    records: Vec<ContactRecord>,
    details: Vec<Option<DetailSlot>>,
    regions: usize,
}

impl Answer {
    fn effects(&self) -> EffectCounters {
        self.header.effect_counters
    }

    fn statuses(&self) -> Vec<(u32, u32, u8)> {
        self.records.iter().map(|r| (r.a, r.b, r.status)).collect()
    }
}

/// A floor (object 1, group "floor") and bodies (2, 3, …; group "body", or "other" where said) above it.
struct Cell {
    session: Session<Embedded>,
}

fn rule(change: impl FnOnce(&mut Rule)) -> Rule {
    let mut rule = Rule::new(["floor".into(), "body".into()]);
    change(&mut rule);
    rule
}

impl Cell {
    fn new(bodies: &[(&str, &str, DVec3)], rules: &[Rule]) -> Self {
        let mut session = contactd::embedded(&ServerConfig::default()).unwrap();
        let floor = session.load_model("floor.csg", FLOOR).unwrap().id;
        session.add_object(Object::new("floor", floor).group("floor").fixed()).unwrap();
        for (i, (text, group, at)) in bodies.iter().enumerate() {
            let model = session.load_model("body.csg", text).unwrap().id;
            let object = Object::new(&format!("body {i}"), model).group(group).at(Pose::at(*at));
            session.add_object(object).unwrap();
        }
        session.set_rules(rules).unwrap();
        session.options.details = true;
        Self { session }
    }

    /// `n` balls of radius 1 at z = `height`, four apart.
    fn balls(n: usize, height: f64, rules: &[Rule]) -> Self {
        let bodies: Vec<_> = (0..n).map(|i| (BALL, "body", DVec3::new(4.0 * i as f64, 0.0, height))).collect();
        Self::new(&bodies, rules)
    }

    fn step(&mut self, records: &[PoseRecord]) -> Answer {
        self.try_step(records).unwrap()
    }

    fn try_step(&mut self, records: &[PoseRecord]) -> Result<Answer, Error> {
        self.session.begin_step(records.len())?.copy_from_slice(records);
        let reply = self.session.finish(Duration::from_secs(60))?;
        Ok(Answer {
            header: *reply.header(),
            records: reply.records().to_vec(),
            details: reply.records().iter().map(|r| reply.detail(r).copied()).collect(),
            regions: reply.records().iter().map(|r| reply.regions(r).count()).sum(),
        })
    }
}

fn down(i: usize, x: f64, z: f64) -> PoseRecord {
    PoseRecord::end(2 + i as u32, &Pose::at(DVec3::new(x, 0.0, z)))
}

fn only(change: impl FnOnce(&mut EffectCounters)) -> EffectCounters {
    let mut counters = EffectCounters::default();
    change(&mut counters);
    counters
}

/// Five balls fall through the floor, of seven: the ladder's counters, and the fields that each rung sets.
#[test]
fn each_rung_of_the_report_costs_its_own_and_no_more() {
    let drop = |report| {
        let mut cell = Cell::balls(7, 3.0, &[rule(|r| r.report = report)]);
        let records: Vec<_> = (0..5).map(|i| down(i, 4.0 * i as f64, -1.0)).collect();
        cell.step(&records)
    };
    let [hit, time, contact, patch] = [Report::Hit, Report::Time, Report::Contact, Report::Patch].map(drop);
    assert_eq!(hit.effects(), only(|c| c.continuous = 5));
    assert_eq!(time.effects(), only(|c| (c.continuous, c.times) = (5, 5)));
    assert_eq!(contact.effects(), only(|c| (c.continuous, c.times, c.contacts) = (5, 5, 5)));
    assert_eq!(patch.effects(), only(|c| (c.continuous, c.times, c.contacts, c.patches) = (5, 5, 5, 5)));
    for answer in [&hit, &time, &contact, &patch] {
        assert_eq!(answer.header.effects, answer.effects().bits());
        assert_eq!(answer.statuses(), (2..7).map(|i| (1, i, CONTACT)).collect::<Vec<_>>());
    }
    // What remains has the same bits, what is off is zero with its valid bit clear.
    for i in 0..5 {
        let (h, t, c, p) = (&hit.records[i], &time.records[i], &contact.records[i], &patch.records[i]);
        assert_eq!(*h, ContactRecord { a: 1, b: 2 + i as u32, status: CONTACT, slot: h.slot, slots: 1, ..blank() });
        let timed = ContactRecord { valid: VALID_TIME, time: c.time, time_lower: c.time_lower, ..*h };
        assert_eq!(*t, ContactRecord { flags: c.flags, slot: t.slot, ..timed });
        assert!((c.time - 0.5).abs() < 1e-9 && c.valid & VALID_POINT != 0);
        assert_eq!(*p, ContactRecord { slot: p.slot, slots: p.slots, ..*c });
    }
    assert_eq!([hit.regions, time.regions, contact.regions, patch.regions], [0, 0, 0, 5]);
    assert!(hit.header.safe_time <= contact.header.safe_time && time.header.safe_time == contact.header.safe_time);
}

fn blank() -> ContactRecord {
    ContactRecord::default()
}

/// Three boxes start a fifth deep in the floor.
#[test]
fn penetration_is_measured_where_it_is_asked_for() {
    let run = |penetration| {
        let bodies = [0.0, 4.0, 8.0].map(|x| (BOX, "body", DVec3::new(x, 0.0, 0.8)));
        let mut cell = Cell::new(&bodies, &[rule(|r| r.penetration = penetration)]);
        cell.step(&[down(0, 0.0, 0.5), down(1, 4.0, 2.0), down(2, 8.0, 0.8)])
    };
    let (plain, measured) = (run(false), run(true));
    assert_eq!(plain.effects(), only(|c| (c.continuous, c.contacts) = (2, 3)));
    assert_eq!(measured.effects(), only(|c| (c.continuous, c.contacts, c.penetrations) = (2, 3, 3)));
    assert_eq!(plain.records, measured.records, "the records are the same to the bit");
    for (off, on) in plain.details.iter().zip(&measured.details) {
        let (off, on) = (off.unwrap(), on.unwrap());
        assert_eq!((off.penetration, off.direction), (0.0, [0.0; 3]));
        assert!((on.penetration - 0.2).abs() < 1e-9, "{on:?}");
        assert!((DVec3::from_array(on.direction) - DVec3::Z).length() < 1e-9, "{on:?}");
    }
    assert!(plain.records.iter().all(|r| r.status == OVERLAP && r.valid & VALID_NORMAL != 0));
}

/// Balls sink to a height of 1.5 (a gap of .5), 1.1 and 2.5; one meets the floor.
#[test]
fn a_margin_tells_what_comes_within_it_and_never_late() {
    let run = |margin: f64| {
        let mut cell = Cell::balls(4, 3.0, &[rule(|r| r.margin = margin)]);
        cell.step(&[down(0, 0.0, 1.5), down(1, 4.0, 1.1), down(2, 8.0, 2.5), down(3, 12.0, -1.0)])
    };
    let (without, with) = (run(0.0), run(0.75));
    assert_eq!(without.statuses(), [(1, 5, CONTACT)]);
    assert_eq!(without.effects().margins, 0);
    // The third ball's box stays farther than the margin: nothing is tested. The contact's flag is, as all of them are.
    assert_eq!(with.effects().margins, 3);
    assert_eq!(with.statuses(), [(1, 5, CONTACT), (1, 2, CLEAR), (1, 3, CLEAR)]);
    let same = |r: &ContactRecord| ContactRecord { slot: 0, slots: 0, ..*r };
    assert_eq!(same(&with.records[0]), same(&without.records[0]), "the contact's bits are as without a margin");
    // From a gap of 2 to .5 and to .1: within .75 after 1.25 of 1.5 and of 1.9.
    for (i, expected) in [(1, 1.25 / 1.5), (2, 1.25 / 1.9)] {
        let (r, d) = (&with.records[i], with.details[i].unwrap());
        assert_eq!((r.flags, r.time), (WITHIN_MARGIN, 1.0));
        assert!(d.margin_time <= expected && d.margin_time > expected - 1e-4, "{} of {expected}", d.margin_time);
    }
    assert_eq!(without.header.safe_time, with.header.safe_time);
}

/// A wide margin of one rule makes nothing of what other rules are about.
#[test]
fn a_margin_inflates_no_other_pair() {
    let other = Rule::new(["floor".into(), "other".into()]);
    let bodies = [(BALL, "body", DVec3::new(0.0, 0.0, 30.0)), (BALL, "other", DVec3::new(9.0, 0.0, 3.0))];
    let run = |margin: f64| {
        let mut cell = Cell::new(&bodies, &[rule(|r| r.margin = margin), other.clone()]);
        cell.step(&[down(1, 9.0, 2.0)])
    };
    let (mut plain, mut wide) = (run(0.0), run(10.0));
    // The pair of the margin is looked at twice more: by its boxes, and by what encloses them.
    let looks = |answer: &mut Answer| {
        let header = &mut answer.header;
        std::mem::take(&mut header.pairs) as u64 + std::mem::take(&mut header.counters.box_tests)
    };
    let (of_plain, of_wide) = (looks(&mut plain), looks(&mut wide));
    assert!(of_wide <= of_plain + 2, "{of_wide} looks, {of_plain} without the margin");
    assert_eq!(plain, wide);
}

/// Balls start a tenth inside the floor: one leaves, one sinks, one stays.
#[test]
fn an_overlap_that_separates_can_be_ignored() {
    let run = |initial_overlap| {
        let bodies = [0.0, 4.0, 8.0].map(|x| (BALL, "body", DVec3::new(x, 0.0, 0.9)));
        let mut cell = Cell::new(&bodies, &[rule(|r| r.initial_overlap = initial_overlap)]);
        cell.step(&[down(0, 0.0, 3.0), down(1, 4.0, 0.4)])
    };
    let (reported, ignored) = (run(InitialOverlap::Report), run(InitialOverlap::IgnoreIfSeparating));
    assert_eq!(reported.statuses(), [(1, 2, OVERLAP), (1, 3, OVERLAP), (1, 4, OVERLAP)]);
    assert_eq!(reported.effects().past_overlaps, 0);
    assert_eq!(ignored.effects().past_overlaps, 3);
    // What sinks is deeper than it started at once: by 1e-6 of a depth of .05 and a few resolutions, at half a length a step.
    assert_eq!(ignored.statuses(), [(1, 3, CONTACT)]);
    let r = &ignored.records[0];
    assert!(r.time > 0.0 && r.time < 1e-5 && r.flags & TOUCHING != 0, "{r:?}");
    assert!((r.separation + 0.1).abs() < 1e-5 && r.normal_speed > 0.49, "{r:?}");
}

/// A bar with one end a little inside the floor swings up there and down at its other end: that contact is found.
#[test]
fn past_an_overlap_the_next_contact_counts() {
    let bar = "cube(size = [8, 0.5, 0.5], center = true);";
    let tilt: f64 = 0.1;
    let (half, rise) = (4.0 * tilt.sin() + 0.25 * tilt.cos(), 0.05);
    let ignoring = rule(|r| r.initial_overlap = InitialOverlap::IgnoreIfSeparating);
    let mut cell = Cell::new(&[(bar, "body", DVec3::ZERO)], &[ignoring]);
    let start = Pose::new(DVec3::new(0.0, 0.0, half - rise), glam::DQuat::from_rotation_y(tilt));
    let put = PoseRecord::start(2, &start);
    let turn = PoseRecord::turn(2, start.position, DVec3::new(0.0, -2.2 * tilt, 0.0));
    let answer = cell.step(&[put, turn]);
    assert_eq!(answer.statuses(), [(1, 2, CONTACT)], "{answer:?}");
    // The other end is as deep when the bar is tilted as much the other way.
    let r = &answer.records[0];
    assert!((r.time - 2.0 / 2.2).abs() < 1e-5 && r.separation < -0.9 * rise && r.separation > -rise, "{r:?}");
    assert_eq!(
        answer.effects(),
        only(|c| {
            (c.continuous, c.turning, c.times, c.contacts, c.past_overlaps) = (1, 1, 1, 1, 1);
        })
    );
}

#[test]
fn sensors_are_told_and_stop_nothing() {
    let run = |sensor| {
        let other = Rule::new(["floor".into(), "other".into()]);
        let bodies = [(BALL, "body", DVec3::new(0.0, 0.0, 3.0)), (BALL, "other", DVec3::new(9.0, 0.0, 3.0))];
        let mut cell = Cell::new(&bodies, &[rule(|r| r.sensor = sensor), other]);
        cell.session.options.first = true;
        cell.step(&[down(0, 0.0, -1.0), down(1, 9.0, 0.5)])
    };
    let (plain, sensed) = (run(false), run(true));
    assert_eq!(plain.statuses(), [(1, 2, CONTACT)]);
    assert_eq!(plain.effects().sensors, 0);
    assert_eq!(sensed.statuses(), [(1, 2, CONTACT), (1, 3, CONTACT)]);
    assert_eq!(sensed.effects().sensors, 1);
    assert_eq!(sensed.records[0], ContactRecord { flags: SENSOR, slot: sensed.records[0].slot, ..plain.records[0] });
}

#[test]
fn discrete_pairs_are_tested_at_their_end_and_say_when_that_may_not_do() {
    let of_rule =
        |rule: Rule| Cell::balls(3, 3.0, &[rule]).step(&[down(0, 0.0, 0.5), down(1, 4.0, -9.0), down(2, 8.0, 2.9)]);
    let run = |detect| of_rule(rule(|r| r.detect = detect));
    let (continuous, discrete) = (run(Detect::Continuous), run(Detect::Discrete));
    assert_eq!(continuous.statuses(), [(1, 3, CONTACT), (1, 2, CONTACT)]);
    assert_eq!((continuous.effects().discrete, continuous.header.counters.may_have_passed), (0, 0));
    // The second ball is through the floor: not told, but counted. The third's box stays above the floor.
    assert_eq!(discrete.statuses(), [(1, 2, OVERLAP)]);
    assert_eq!(discrete.records[0].time, 1.0);
    assert_eq!(discrete.effects(), only(|c| (c.discrete, c.contacts) = (2, 1)));
    assert_eq!(discrete.header.counters.may_have_passed, 1);
    // What they are at the end is no overlap that they start in.
    let past =
        of_rule(rule(|r| (r.detect, r.initial_overlap) = (Detect::Discrete, InitialOverlap::IgnoreIfSeparating)));
    assert_eq!((past.statuses(), past.effects()), (discrete.statuses(), discrete.effects()));
}

/// What the motion itself rules out is not worked out, whatever the rules ask for.
#[test]
fn the_motion_itself_rules_effects_out() {
    // The first slides over the floor, the second spins above it, the third rests: near, and none of them meets it.
    let bodies = [0.0, 6.0, 12.0].map(|x| (BOX, "body", DVec3::new(x, 0.0, 1.01)));
    let mut cell = Cell::new(&bodies, &[rule(|_| ())]);
    let spin = PoseRecord::turn(3, DVec3::new(6.0, 0.0, 1.01), DVec3::new(0.0, 0.0, 0.5));
    let answer = cell.step(&[down(0, 0.5, 1.01), spin]);
    assert_eq!(answer.statuses(), []);
    assert_eq!(answer.effects(), only(|c| (c.continuous, c.turning) = (1, 1)), "{:?}", answer.header);
    let resting = [(BOX, "body", DVec3::new(0.0, 0.0, 1.0))];
    let answer = Cell::new(&resting, &[rule(|_| ())]).step(&[]);
    assert_eq!((answer.effects(), answer.records.len()), (EffectCounters::default(), 0));
    let still = Cell::new(&resting, &[rule(|r| r.report = Report::Patch)]).step(&[]);
    assert_eq!(still.effects(), only(|c| c.patches = 1), "resting bodies are asked about their start alone");
    assert_eq!((still.statuses(), still.regions), (vec![(1, 2, CLEAR)], 1));
}

/// A pair that rules leave out is off on every path: swept into each other, resting in overlap, as a sensor, with patches,
/// with a margin, at the end of a step.
#[test]
fn a_filtered_pair_is_off_on_every_path() {
    let ways: [&dyn Fn(&mut Rule); 6] = [
        &|_| (),
        &|r| r.sensor = true,
        &|r| r.report = Report::Patch,
        &|r| r.margin = 5.0,
        &|r| r.detect = Detect::Discrete,
        &|r| (r.penetration, r.initial_overlap) = (true, InitialOverlap::IgnoreIfSeparating),
    ];
    for way in ways {
        for off in 0..3 {
            let mut rules = vec![rule(|r| {
                way(r);
                match off {
                    0 => r.detect = Detect::Off,
                    1 => r.except = vec![["body 0".into(), "floor".into()], ["floor".into(), "body 1".into()]],
                    _ => r.between = ["floor".into(), "nobody".into()],
                }
            })];
            if off == 0 {
                // The first rule that names a pair decides.
                rules.push(rule(|_| ()));
            }
            let bodies = [(BALL, "body", DVec3::new(0.0, 0.0, 3.0)), (BALL, "body", DVec3::new(4.0, 0.0, 0.5))];
            let mut cell = Cell::new(&bodies, &rules);
            for clear in [false, true] {
                cell.session.options.clear = clear;
                let answer = cell.step(&[down(0, 0.0, if clear { 3.0 } else { -3.0 })]);
                assert_eq!(answer.records, []);
                assert_eq!((answer.effects(), answer.header.pairs), (EffectCounters::default(), 0));
                assert_eq!((answer.header.safe_time, answer.header.counters.cells), (1.0, 0));
            }
        }
    }
}

#[test]
fn breaking_a_declaration_is_a_named_error_and_changes_nothing() {
    let mut session = contactd::embedded(&ServerConfig::default()).unwrap();
    let ball = session.load_model("ball.csg", BALL).unwrap().id;
    session.add_object(Object::new("straight", ball).without_rotation()).unwrap();
    session.add_object(Object::new("slow", ball).max_speed(2.0).at(Pose::at(DVec3::X * 9.0))).unwrap();
    let mut cell = Cell { session };
    let refused = |answer: Result<Answer, Error>, index| match answer {
        Err(Error::Refused { code: ErrorCode::Declaration, index: i, .. }) => assert_eq!(i, Some(index)),
        other => panic!("{other:?}"),
    };
    let fine = PoseRecord::end(1, &Pose::at(DVec3::Y));
    let fast = PoseRecord::end(2, &Pose::at(DVec3::new(9.0, 0.21, 0.0)));
    refused(cell.try_step(&[PoseRecord::turn(1, DVec3::ZERO, DVec3::Z)]), 0);
    cell.session.options.dt = 0.1;
    refused(cell.try_step(&[fine, fast]), 1);
    // Without a duration a speed says nothing.
    cell.session.options.dt = 0.0;
    refused(cell.try_step(&[fine, fast]), 1);
    cell.session.options.dt = 0.106;
    cell.step(&[fine, fast]);
}

/// Random pairs of trees, of whole primitives and of bodies in holes: whatever is asked, status and times are the same bits.
#[test]
fn asking_for_less_changes_no_bit_of_what_remains() {
    let mut r = Random::new(515);
    let (mut contacts, mut overlaps, mut clear) = (0, 0, 0);
    let count = 5 * sized("CONTACTD_MARGINS", 20);
    for i in 0..count {
        let mut scene = match i % 4 {
            0 => scenes::primitives(&mut r),
            1 => scenes::trees(&mut r),
            2 => scenes::peg(&mut r),
            _ => scenes::any(&mut r),
        };
        // Most of these meet: some go less far, some start where they would have come to.
        for motion in [&mut scene.motion_a, &mut scene.motion_b] {
            match i % 5 {
                0 | 1 => motion.velocity *= 0.3,
                2 => motion.start = motion.at(0.8),
                _ => {}
            }
        }
        let (a, b) = (Model::new(scene.a.build()), Model::new(scene.b.build()));
        let ask = |query_options| {
            let query = question_of(&scene, [&a, &b], query_options);
            earliest_contact(&query, &mut Scratch::default())
        };
        let full = ask(QueryOptions::DEPTH);
        let plain = ask(QueryOptions::CONTACT);
        let time = ask(QueryOptions { report: Report::Time, ..QueryOptions::CONTACT });
        let hit = ask(QueryOptions { report: Report::Hit, ..QueryOptions::CONTACT });
        match full.status() {
            Status::Contact => contacts += 1,
            Status::Overlap => overlaps += 1,
            Status::Clear => clear += 1,
            Status::Undecided => continue,
        }
        assert_eq!([full.status(), plain.status(), time.status()], [hit.status(); 3], "{i}");
        let fields = |o: &contactd::contact::Outcome| {
            (o.time().to_bits(), o.time_lower().to_bits(), o.time_upper().to_bits(), o.touching, o.not_continued())
        };
        assert_eq!(fields(&full), fields(&plain), "{i}");
        assert_eq!(fields(&plain), fields(&time), "{i}");
        let reported = contactd::contact::Outcome { counters: full.counters, ..plain };
        let mut less = full;
        if let Verdict::Overlap(overlap) = &mut less.verdict {
            overlap.penetration = None;
        }
        assert_eq!(reported, less, "{i}");
        assert!(hit.time_lower() <= full.time_upper() && hit.touching == full.touching, "{i}: {hit:?} and {full:?}");
        assert!(hit.counters.cells <= full.counters.cells, "{i}: a hit takes no more than its time");
        assert_eq!((hit.counters.times, hit.counters.contacts, time.counters.contacts), (0, 0, 0), "{i}");
        assert!(plain.counters.penetrations == 0 && full.counters.past_overlaps == 0, "{i}");
    }
    assert!(
        4 * contacts > count && 48 * overlaps > count && 6 * clear > count,
        "{contacts} contacts, {overlaps} overlaps, {clear} clear"
    );
    println!("{contacts} contacts, {overlaps} overlaps, {clear} clear");
}

/// Bodies on many feet, one of which starts inside the slab that the others are about to meet: the search may come upon a
/// contact of those first, but what starts in overlap is told so, whatever is asked.
#[test]
fn a_hit_is_told_only_once_the_start_is_free() {
    let mut r = Random::new(517);
    for i in 0..24 {
        let inside = r.below(9);
        let foot = |k: usize| {
            let height = if k == inside { -r.within(1e-6, 1e-3) } else { r.within(1e-4, 2e-3) };
            Recipe::sphere(0.7).at(2.0 * k as f64 - 8.0, r.within(-1.0, 1.0), 0.7 + height)
        };
        let feet = (0..9).map(foot).reduce(Recipe::union).expect("nine feet");
        let slab = Recipe::cuboid(12.0, 3.0, 2.0).at(0.0, 0.0, -2.0);
        let down = Motion { start: Pose::IDENTITY, velocity: DVec3::new(0.0, 0.0, -0.5), spin: DVec3::ZERO };
        let scene = scenes::Scene::new("feet", slab, Motion::resting(Pose::IDENTITY), feet, down);
        let (a, b) = (Model::new(scene.a.build()), Model::new(scene.b.build()));
        for report in [Report::Hit, Report::Time] {
            let query = question_of(&scene, [&a, &b], QueryOptions { report, ..QueryOptions::CONTACT });
            let o = earliest_contact(&query, &mut Scratch::default());
            assert_eq!(o.status(), Status::Overlap, "{i}, {report:?}: {o:?}");
        }
    }
}

/// What comes after the end of a step's time takes no more work, and says no more than is proven.
#[test]
fn margins_and_distances_end_with_the_time_of_a_step() {
    let ended = || {
        let halt = Arc::new(Halt::default());
        halt.set();
        halt
    };
    let mut r = Random::new(517);
    let (mut whole, mut cut) = ([0; 2], [0; 2]);
    for _ in 0..8 {
        let scene = scenes::trees(&mut r);
        let (a, b) = (Model::new(scene.a.build()), Model::new(scene.b.build()));
        let query = question_of(&scene, [&a, &b], QueryOptions::CONTACT);
        // Nearer than the octrees know, and farther.
        for part in [1e-3, 2.0] {
            let margin = part * a.radius.min(b.radius);
            let cells = || {
                let (until, _, work) = apart_until(&query, margin, &mut Scratch::default());
                (until, work.cells + work.instant_cells)
            };
            let (until, all) = cells();
            let (early, few) = heeding(Some(&ended()), cells).expect("its own end");
            assert!(early <= until, "{early} and {until}");
            (whole[0], cut[0]) = (whole[0] + all, cut[0] + few);
        }
        let mut asked = DistanceQuery { a: query.a, b: query.b, tolerance: 1e-6, limit: 20_000 };
        asked.b.placed.motion.start.position += r.direction() * (2.0 * (a.radius + b.radius));
        let (all, few) = (over_step(&asked), over_step_heeding(&asked, &ended()));
        assert!(few.lower <= all.upper && all.lower <= few.upper, "{few:?} and {all:?}");
        (whole[1], cut[1]) = (whole[1] + all.cells, cut[1] + few.cells);
    }
    println!("cells of margins and distances: {whole:?}, {cut:?} after the end");
    assert!((0..2).all(|k| whole[k] > 500 && 20 * cut[k] < whole[k]), "{whole:?} {cut:?}");
}

/// Random pairs that pass each other: before the margin's time the slow reference finds them farther apart than the margin,
/// at it they are within it, for margins far below and far above the bodies' size.
#[test]
fn a_margins_time_is_never_late_and_hardly_early() {
    let mut r = Random::new(516);
    let (mut entered, mut never, mut short) = (0, 0, 0);
    let count = sized("CONTACTD_MARGINS", 12);
    let all_times = std::env::var_os("CONTACTD_MARGINS").is_some();
    for i in 0..count {
        let primitives = i / 4 % 2 == 0;
        let mut scene = if primitives { scenes::primitives(&mut r) } else { scenes::trees(&mut r) };
        for motion in [&mut scene.motion_a, &mut scene.motion_b] {
            motion.velocity *= 0.5;
        }
        let (solid_a, solid_b) = (scene.a.build(), scene.b.build());
        let (a, b) = (Model::new(solid_a.clone()), Model::new(solid_b.clone()));
        let moving = |solid, motion| Moving { solid, place: Pose::IDENTITY, motion };
        let lowest = |t: f64| deepest(moving(&solid_a, scene.motion_a), moving(&solid_b, scene.motion_b), t).1;
        let margin = a.radius.min(b.radius) * [1e-4, 3e-3, 0.05, 0.4][i % 4];
        if lowest(0.0) <= 0.6 * margin {
            continue;
        }
        let query = question_of(&scene, [&a, &b], QueryOptions::CONTACT);
        let (until, known, _) = apart_until(&query, margin, &mut Scratch::default());
        // Of two convex primitives the distance tells when, and beside an edge f is far below half of it: nothing is looked for
        // close to the end. The judge of trees is slow: all times in the long form alone.
        let looked_at =
            |k: &i32| if primitives { [0, 2, 4, 6].contains(k) } else { all_times || [3, 6, 8].contains(k) };
        for k in (0..=8).filter(looked_at) {
            let t = until * f64::from(k) / 8.0;
            let at_t = lowest(t);
            let least = 0.5 * margin * if k < 8 { 1.0 - 1e-9 } else { 1.0 - MARGIN_SLACK };
            assert!(
                at_t > least,
                "{i}: {at_t} at {t}, reported as not within the margin before {until}, margin {margin}"
            );
        }
        match lowest(until) {
            _ if until == 1.0 => never += 1,
            at if known && at <= 0.5 * margin * (1.0 + MARGIN_SLACK) => entered += 1,
            _ => short += 1,
        }
    }
    println!("{entered} entered their margin, {never} never, {short} reported too early");
    assert!(
        3 * entered > count && 3 * never >= count && 20 * short <= entered,
        "{entered} entered, {never} never, {short} too early"
    );
}
