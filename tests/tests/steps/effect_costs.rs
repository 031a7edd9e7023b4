//! What an effect costs is paid by the pairs that ask for it, and by no other: counts of steps over lanes of pairs, a share
//! of which asks for the effect. Counts only; the times beside them are in docs/effects.md.

use contactd::contact::within::Within;
use contactd::contact::{Counters, DEFAULT_CELL_LIMIT, PairQuery, Scratch, Status};
use contactd::contact::{earliest_contact, margin, region};
use contactd::motion::Placed;
use contactd::world::{self, PairPlan};
use contactd_proto::{Detect, EffectCounters, Effects, Report, Rule};
use contactd_tests::engine::question;
use contactd_tests::lanes::{Class, EFFECTS, Lane, Lanes, NARROW, PLAIN, WIDE, counts, rule};
use contactd_tests::scenes::{Recipe, Scene};
use contactd_tests::sweep::sized;
use glam::DVec3;

/// Lanes of each class.
const LANES: usize = 9;

/// Lanes of each class where each effect has its own scenes: `CONTACTD_LANES=9` is the long form.
fn few() -> usize {
    sized("CONTACTD_LANES", 3)
}

/// Copies of each lane, of which a share asks: quarters of them, eighths in the long form.
fn copies() -> usize {
    if std::env::var_os("CONTACTD_LANES").is_some() { 8 } else { 4 }
}

fn value(counts: &[(&'static str, u64)], name: &str) -> u64 {
    counts.iter().find(|(n, _)| *n == name).expect("a count").1
}

/// With no pair that asks for it, a scene in which an effect is declared counts what a scene counts that knows nothing of
/// it, every count of it; and the effect's own counter is 0.
#[test]
fn an_effect_that_no_pair_asks_for_costs_nothing() {
    for effect in &EFFECTS {
        let lanes = effect.class.lanes(few());
        let none = counts(effect.lanes(&lanes, (0, copies())).step());
        let out = Lanes::shared(&lanes, (0, copies()), &[rule(PLAIN, effect.plain)]).step().clone();
        assert_eq!(none, counts(&out), "{}: declared, and not known of", effect.name);
        assert_eq!((effect.counter)(&out.effect_counters), 0, "{}", effect.name);
        let counted = (effect.counter)(&effect.lanes(&lanes, (0, copies())).step().effect_counters);
        assert_eq!(counted, 0, "{}", effect.name);
    }
}

/// Every count of a step is straight in the share of the pairs that ask for the effect, to the last one.
#[test]
fn the_cost_of_an_effect_is_straight_in_the_pairs_that_ask_for_it() {
    let copies = copies();
    for effect in &EFFECTS {
        let lanes = effect.class.lanes(few());
        let at = |k: usize| counts(effect.lanes(&lanes, (k, copies)).step());
        let (none, all) = (at(0), at(copies));
        assert!(none != all, "{}: the effect does something", effect.name);
        for k in 1..copies {
            for (i, (name, count)) in at(k).into_iter().enumerate() {
                let line = (copies - k) as u64 * none[i].1 + k as u64 * all[i].1;
                assert_eq!(copies as u64 * count, line, "{}: {name} with {k} of {copies}", effect.name);
            }
        }
    }
}

/// With every pair asking for it a scene counts what one counts that knows no other rule: rules that no pair uses cost
/// nothing, whichever they are.
#[test]
fn an_effect_that_all_pairs_ask_for_costs_the_effect_alone() {
    for effect in &EFFECTS {
        let lanes = effect.class.lanes(few());
        let all = counts(effect.lanes(&lanes, (copies(), copies())).step());
        let alone = counts(Lanes::shared(&lanes, (0, copies()), &[rule(PLAIN, effect.on)]).step());
        assert_eq!(all, alone, "{}", effect.name);
        assert!((effect.counter)(&effect.lanes(&lanes, (1, 1)).step().effect_counters) > 0, "{}", effect.name);
    }
}

/// All effects at once for groups that occur, but far from everything: the counts of the pairs that ask for none of them
/// are those of a scene without the rules. Boxes of the bystanders grow by their margins, and nothing else's.
#[test]
fn effects_of_bystanders_cost_the_others_nothing() {
    for class in Class::ALL {
        let lanes = class.lanes(few());
        let with = |rules: &[Rule]| {
            let mut scene = Lanes::shared(&lanes, (0, 1), rules);
            for effect in &EFFECTS {
                scene.add_bystander(&lanes[0].parts[0], effect.name);
            }
            counts(scene.step())
        };
        let plain = rule(PLAIN, |_| ());
        let mut all = vec![plain.clone()];
        all.extend(EFFECTS.iter().map(|effect| rule(effect.name, effect.on)));
        assert_eq!(with(&all), with(&[plain]), "{}", class.name());
    }
}

/// What a plan's own functions count for a pair of bodies when nothing else is there to be asked: the search, and for a
/// contact whose time is told whether the pair touches at the start.
fn alone(bodies: &[world::body::Body], plan: &PairPlan) -> Counters {
    let side = |k: usize| {
        let placed = Placed { place: bodies[k].place, motion: bodies[k].motion_state.motion };
        (&*bodies[k].part.model, placed)
    };
    let query = PairQuery { cell_limit: DEFAULT_CELL_LIMIT, ..question(side(0), side(1), plan.query_options()) };
    let mut outcome = earliest_contact(&query, &mut Scratch::default());
    let flagged = outcome.status() == Status::Contact && plan.report >= Report::Time || plan.margin > 0.0;
    if flagged && !outcome.touching && (outcome.status() != Status::Contact || outcome.time() > 0.0) {
        let threshold = region::threshold(outcome.resolution, plan.margin);
        let (within, cells) = margin::touching(&query, threshold, &mut Scratch::default());
        outcome.counters.instant_cells += cells;
        if plan.margin > 0.0 && within == Within::Apart && outcome.status() == Status::Clear {
            let query = PairQuery { cell_limit: region::MOST_CELLS, ..query };
            let (.., work) = margin::apart_until(&query, threshold, &mut Scratch::default());
            outcome.counters.instant_cells += work.cells + work.instant_cells;
        }
    }
    outcome.counters
}

/// A step counts what its plan's own functions count when they are called by themselves, pair by pair: the world adds no
/// work that was not asked for, not even uncounted by an effect's counter.
#[test]
fn a_step_costs_what_its_searches_cost() {
    for class in [Class::Translating, Class::Turning, Class::Trees, Class::Landing, Class::Overlapping] {
        let lanes = class.lanes(LANES);
        for report in [Report::Hit, Report::Time, Report::Contact] {
            for penetration in [false, true] {
                let plan = PairPlan(Effects { report, penetration, ..Effects::DEFAULT });
                let mut scene = Lanes::all(&lanes, |r| (r.report, r.penetration) = (report, penetration));
                let counted = scene.step().counters;
                let mut expected = Counters::default();
                scene.world().bodies().chunks(2).for_each(|pair| expected += alone(pair, &plan));
                assert_eq!(counted, expected, "{}, {}, penetration {penetration}", class.name(), report.name());
            }
        }
    }
}

/// So it does with margins: near ones are searched for, far ones looked at instant by instant.
#[test]
fn a_margin_costs_what_its_tests_cost() {
    let (plate, block) = (Recipe::cuboid(0.8, 0.8, 0.2), Recipe::cuboid(0.5, 0.4, 0.2));
    let drilled = |r: Recipe| r.minus(Recipe::cylinder(0.15, 1.0));
    let fall =
        |from: f64| Scene::falling(drilled(plate.clone()), drilled(block.clone()), DVec3::Z * from, -2.0 * DVec3::Z);
    // From a gap two lengths wider: within the margin at the end, and never near it.
    for (margin, gap) in [(NARROW, 0.5 * NARROW), (WIDE, 0.1), (3.0, 2.1)] {
        let mut lanes = Class::Short.lanes(LANES);
        lanes.push(Lane::of(&fall(2.4 + gap)));
        // Of mere times no regions are told: those of pairs within a margin have counters of their own.
        let plan = PairPlan(Effects { report: Report::Time, margin, ..Effects::DEFAULT });
        let mut scene = Lanes::all(&lanes, |r| (r.report, r.margin) = (Report::Time, margin));
        let out = scene.step();
        let (counted, tested) = (out.counters.instant_cells, out.effect_counters.margins);
        let pairs = scene.world().bodies().chunks(2);
        let expected: u64 = pairs.map(|pair| alone(pair, &plan).instant_cells).sum();
        assert_eq!(counted, expected, "margin {margin}");
        assert!(tested > 0 && counted > 0, "margin {margin}: {tested} tests, {counted} cells");
    }
}

/// The ladder in counts: every rung has the work of the one below it, and what it adds is counted where it belongs.
#[test]
fn each_rung_adds_its_own_work_and_takes_none_away() {
    for class in Class::ALL {
        let lanes = class.lanes(few());
        let at = |report, penetration| {
            let mut scene = Lanes::all(&lanes, |r| (r.report, r.penetration) = (report, penetration));
            let out = scene.step();
            (counts(out), out.effect_counters)
        };
        let rungs = [
            (Report::Hit, false),
            (Report::Time, false),
            (Report::Contact, false),
            (Report::Patch, false),
            (Report::Patch, true),
        ];
        let all = rungs.map(|(report, penetration)| at(report, penetration));
        for (below, above) in all.iter().zip(&all[1..]) {
            for name in ["cells", "clauses", "newton", "instant_cells"] {
                assert!(value(&below.0, name) <= value(&above.0, name), "{}: {name}", class.name());
            }
        }
        let [hit, time, contact, patch, depth] = all;
        // Beside its search a mere hit asks about no instant, and what it asks of an overlap is that there is one.
        assert_eq!(value(&hit.0, "instant_cells"), 0, "{}", class.name());
        let counters = |c: &EffectCounters| (c.times, c.contacts, c.patches, c.penetrations);
        assert_eq!(counters(&hit.1), (0, 0, 0, 0), "{}", class.name());
        assert_eq!((time.1.contacts, contact.1.patches, patch.1.penetrations), (0, 0, 0), "{}", class.name());
        // From the contact on no rung searches more: it asks about instants.
        for name in ["cells", "clauses", "newton", "closed_forms"] {
            assert_eq!(value(&contact.0, name), value(&depth.0, name), "{}: {name}", class.name());
        }
        let deeper = depth.1.penetrations > 0;
        assert_eq!(deeper, class == Class::Overlapping, "{}", class.name());
        assert_eq!(deeper, value(&depth.0, "instant_cells") > value(&patch.0, "instant_cells"), "{}", class.name());
    }
}

/// A pair that does not turn has the bounds of one that never does, whether it is declared or not; and the wider of two
/// margins is paid by its own pairs.
#[test]
fn what_the_motion_rules_out_needs_no_declaration() {
    let turning = Class::Turning.lanes(LANES);
    let straight: Vec<Lane> = turning.iter().map(Lane::without_spin).collect();
    let mut both: Vec<Lane> = straight.clone();
    both.extend(turning.iter().cloned());
    let of = |lanes: &[Lane]| counts(Lanes::all(lanes, |_| ()).step());
    let (p, q, sum) = (of(&straight), of(&turning), of(&both));
    let declared: Vec<Lane> = straight.iter().map(|lane| Lane { rotates: false, ..lane.clone() }).collect();
    assert_eq!(of(&declared), p);
    assert_eq!((value(&p, "turning"), value(&q, "turning")), (0, LANES as u64));
    for name in ["searched", "cells", "clauses", "newton", "closed_forms", "instant_cells", "turning", "contact"] {
        assert_eq!(value(&p, name) + value(&q, name), value(&sum, name), "{name}");
    }
    let wide = |r: &mut Rule| r.margin = WIDE;
    let margin = counts(Lanes::shared(&straight, (1, 2), &[rule(PLAIN, |_| ()), rule("effect", wide)]).step());
    let off = counts(Lanes::shared(&straight, (0, 2), &[rule(PLAIN, |r| r.detect = Detect::Off)]).step());
    assert_eq!(value(&margin, "margin"), LANES as u64);
    assert!(off.iter().all(|(name, n)| *n == 0 || *name == "box_tests"), "{off:?}");
}
