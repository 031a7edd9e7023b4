//! The 94 cases with a known answer: the reference finds each by itself, and the engine's answers hold against them.

use contactd::motion::Placed;
use contactd::solid::Solid;
use contactd_tests::engine::ask_solids;
use contactd_tests::judge::cases;
use contactd_tests::reference::{Effort, Moving, Verdict, earliest_contact};

fn moving((solid, placed): &(Solid, Placed)) -> Moving<'_> {
    Moving { solid, place: placed.place, motion: placed.motion }
}

/// Cases that take the reference three quarters of what it takes for all: seconds each.
const DEAR: [&str; 3] = ["hard_mjThin15um", "hard_fcl388_box", "hard_coal604"];

/// Every third in the command, but for the dear ones; all where `CONTACTD_LAW_SCENES` asks the reference for more.
#[test]
fn the_reference_reproduces_every_known_answer() {
    let all = std::env::var_os("CONTACTD_LAW_SCENES").is_some();
    let is_asked = |name: &str| all || !DEAR.contains(&name);
    for case in cases().into_iter().filter(|c| is_asked(&c.name)).step_by(if all { 1 } else { 3 }) {
        let radius = |b: contactd::math::Aabb| b.half().length();
        let delta = 1e-9 * radius(case.a.0.aabb()).max(radius(case.b.0.aabb()));
        let truth = earliest_contact(moving(&case.a), moving(&case.b), delta, Effort::QUICK);
        let Some(time) = case.known.time else {
            assert_eq!(truth.verdict, Verdict::Clear, "{}", case.name);
            assert_eq!(truth.lower, 1.0, "{}: clear, but not proven", case.name);
            continue;
        };
        assert_eq!(truth.verdict, Verdict::Contact, "{}", case.name);
        let off = (truth.time - time).abs();
        assert!(off <= 1e-12 + case.known.margin, "{}: {} is off by {off:e}", case.name, truth.time);
        if let Some((normal, point, active)) = case.known.features {
            assert!(truth.normal.distance(normal) < 1e-10, "{}: normal {}", case.name, truth.normal);
            assert!(truth.point.distance(point) < 1e-10, "{}: point {}", case.name, truth.point);
            let same = |x: usize, y: usize| x.min(3) == y.min(3);
            assert!(same(truth.active.0, active.0) && same(truth.active.1, active.1), "{}: {truth:?}", case.name);
        }
    }
}

fn engine_against_known_answers(tolerance: f64) {
    let all = cases();
    assert_eq!(all.len(), 94);
    let mut wrong = vec![];
    for case in all {
        let outcome = ask_solids(case.a, case.b, case.resolution);
        if let Err(what) = case.known.judge(&outcome, tolerance) {
            wrong.push(format!("{}: {what} ({} cells)", case.name, outcome.counters.cells));
        }
    }
    assert!(wrong.is_empty(), "{} of 94 wrong:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn every_case_is_answered_to_eight_digits() {
    engine_against_known_answers(1e-8);
}
