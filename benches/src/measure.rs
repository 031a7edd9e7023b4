//! A class of questions under a setting, raced against the same questions under another one.
//!
//! Errors are lengths: what a time is off, times the closing speed, in the pair's size. A machine's speed changes while a
//! report is made; so each setting runs in blocks that alternate with its base, and what settings are compared by is the ratio
//! of the fastest blocks.

use crate::race::{Lap, Plan, median, quantile, race, worst};
use crate::row;
use crate::table::Cell;
use crate::workload::{Case, Class, Truth};
use contactd::contact::exclusion::rounding;
use contactd::contact::{
    DEFAULT_CELL_LIMIT, Outcome, PairQuery, PlacedModel, QueryOptions, Scratch, Status, Strategies, earliest_contact,
};
use contactd::motion::{Placed, Relative};
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::reference::{self, Effort, Moving, Verdict};

/// The default resolution, in sizes.
pub const DEFAULT: f64 = 1e-9;

/// How a question is asked.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Resolution, in sizes.
    pub resolution: f64,
    /// What is switched on.
    pub strategies: Strategies,
    /// Cells that a question may take.
    pub limit: u64,
}

impl Default for Setting {
    fn default() -> Self {
        Self { resolution: DEFAULT, strategies: Strategies::default(), limit: DEFAULT_CELL_LIMIT / 10 }
    }
}

impl Setting {
    /// The default one at a resolution, in sizes.
    pub fn at(resolution: f64) -> Self {
        Self { resolution, ..Self::default() }
    }

    /// The search alone: nothing is answered in front of it.
    pub fn search_alone() -> Self {
        Self {
            strategies: Strategies {
                convex: false,
                cavities: false,
                facets: false,
                balls: false,
                ..Strategies::default()
            },
            ..Self::default()
        }
    }

    /// False where the world would refuse the resolution: a primitive is hardly larger.
    pub fn is_allowed(&self, case: &Case) -> bool {
        case.smallest_dimension() > 4.0 * self.resolution * case.size()
    }
}

/// A case's two bodies over the step.
pub fn placed(case: &Case) -> [Placed; 2] {
    let motions = [case.motion_a, case.motion_b];
    std::array::from_fn(|k| Placed { place: case.places[k], motion: motions[k] })
}

/// Asks once.
pub fn ask(case: &Case, setting: &Setting, scratch: &mut Scratch) -> Outcome {
    let [a, b] = placed(case);
    let query = PairQuery {
        a: PlacedModel { model: &case.a, placed: a },
        b: PlacedModel { model: &case.b, placed: b },
        resolution: setting.resolution * case.size(),
        cell_limit: setting.limit,
        strategies: setting.strategies,
        query_options: QueryOptions::CONTACT,
    };
    earliest_contact(&query, scratch)
}

/// What rounding may do to one bound of a case, in sizes: E of docs/accuracy.md.
pub fn budget(case: &Case) -> f64 {
    let [a, b] = placed(case);
    rounding::of_literals(&case.a, &case.b, &Relative::new(a, b)) / case.size()
}

/// Trees of no more primitives than this are held against the tests' slow reference.
const REFERENCE: usize = 8;

/// Residual of the tables of pairs, in sizes: above it they are asked of the reference.
const TABLED: f64 = 1e-10;

/// What is true of a class, and who says so.
pub struct Known {
    /// Of each case.
    pub truths: Vec<Truth>,
    /// Who says so.
    pub by: &'static str,
}

impl Known {
    /// A table or a closed form, the slow reference, or the engine's own answer at its finest.
    pub fn of(class: &Class) -> Self {
        let small = |c: &Case| c.a.solid.primitives.len() + c.b.solid.primitives.len() <= REFERENCE;
        let by = match class.cases.first() {
            Some(c) if c.truth != Truth::Unknown && class.group == "pairs" => "table (1e-10)",
            Some(c) if c.truth != Truth::Unknown => "closed form",
            Some(c) if small(c) => "reference",
            _ => "own finest",
        };
        let mut scratch = Scratch::default();
        let truths = class.cases.iter().map(|c| match by {
            "closed form" => c.truth,
            "table (1e-10)" => tabled(c, &mut scratch),
            "reference" => by_reference(c),
            _ => {
                let o = ask(c, &Setting::at(1e-13), &mut scratch);
                match o.status() {
                    Status::Contact => Truth::Meets(o.time()),
                    Status::Clear => Truth::Clear,
                    Status::Overlap | Status::Undecided => Truth::Unknown,
                }
            }
        });
        Self { truths: truths.collect(), by }
    }
}

/// What a table says; where that is off by more than its own residual, what the reference does.
fn tabled(case: &Case, scratch: &mut Scratch) -> Truth {
    let Truth::Meets(time) = case.truth else { return case.truth };
    let o = ask(case, &Setting::default(), scratch);
    let off = (o.time() - time).abs() * o.at().normal_speed.abs() / case.size();
    if o.status() == Status::Contact && off <= TABLED { case.truth } else { by_reference(case) }
}

/// What the tests' slow reference says, which shares no code with the search; what it has not proven is unknown.
fn by_reference(case: &Case) -> Truth {
    let a = Moving { solid: &case.a.solid, place: case.places[0], motion: case.motion_a };
    let b = Moving { solid: &case.b.solid, place: case.places[1], motion: case.motion_b };
    let delta = DEFAULT * case.size();
    let t = reference::earliest_contact(a, b, delta, Effort::QUICK);
    match t.verdict {
        Verdict::Contact if t.regular => Truth::Meets(t.time),
        Verdict::Clear => Truth::Clear,
        _ => Truth::Unknown,
    }
}

/// What a class said under a setting.
#[derive(Default)]
pub struct Measured {
    /// Each question's seconds, and the base's.
    pub laps: Vec<Lap>,
    /// The answers.
    pub answers: Vec<Outcome>,
    /// What the time is off: lengths, in sizes.
    pub errors: Vec<f64>,
    /// How wide the bracket is: lengths, in sizes; and in steps.
    pub brackets: Vec<[f64; 2]>,
    /// E as a share of the resolution that was used.
    pub budgets: Vec<f64>,
    /// Questions that the world would refuse.
    pub refused: usize,
    /// Answers that say the contrary of what is true.
    pub wrong: usize,
    /// Clear where there is a contact, though not as deep as the resolution.
    pub shallow: usize,
    /// The limit of cells ran out.
    pub undecided: usize,
    /// The resolution was raised, as rounding demands.
    pub raised: usize,
}

/// Asks the cases of a class under a setting, raced against `base` of the same cases (perhaps of other models) under its.
pub fn measure(
    (class, setting): (&Class, &Setting),
    (base_class, base): (&Class, &Setting),
    known: &Known,
    plan: Plan,
) -> Measured {
    let mut scratch = Scratch::default();
    let allowed: Vec<usize> = (0..class.cases.len()).filter(|i| setting.is_allowed(&class.cases[*i])).collect();
    let answers: Vec<Outcome> = allowed.iter().map(|i| ask(&class.cases[*i], setting, &mut scratch)).collect();
    let mut other = Scratch::default();
    let laps = race(
        plan,
        allowed.len(),
        |k| ask(&class.cases[allowed[k]], setting, &mut scratch).time(),
        |k| ask(&base_class.cases[allowed[k]], base, &mut other).time(),
    );
    let mut m = Measured { laps, refused: class.cases.len() - allowed.len(), ..Measured::default() };
    for (i, o) in allowed.iter().zip(&answers) {
        let case = &class.cases[*i];
        let size = case.size();
        let length = |dt: f64| dt.abs() * o.at().normal_speed.abs() / size;
        m.budgets.push(budget(case) * size / o.resolution);
        m.raised += usize::from(o.resolution > setting.resolution * size * (1.0 + 1e-9));
        match (o.status(), known.truths[*i]) {
            (Status::Undecided, _) => m.undecided += 1,
            (Status::Contact, truth) => {
                m.brackets.push([length(o.time_upper() - o.time_lower()), o.time_upper() - o.time_lower()]);
                match truth {
                    Truth::Meets(t) => m.errors.push(length(o.time() - t)),
                    Truth::Clear => m.wrong += 1,
                    Truth::Unknown => {}
                }
            }
            (Status::Clear, Truth::Meets(_)) => m.shallow += 1,
            (Status::Overlap, Truth::Meets(_) | Truth::Clear) => m.wrong += 1,
            _ => {}
        }
    }
    m.answers = answers;
    m
}

/// The columns of `row_of`.
pub const COLUMNS: [&str; 27] = [
    "class",
    "group",
    "setting",
    "value",
    "cases",
    "p50_us",
    "p99_us",
    "max_us",
    "ratio_p50",
    "ratio_p99",
    "ratio_max",
    "cells_p50",
    "cells_p99",
    "cells_max",
    "clauses_p50",
    "newton_p50",
    "forms_p50",
    "truth",
    "error_p50",
    "error_max",
    "bracket_max",
    "bracket_time_max",
    "budget_max",
    "wrong",
    "too_shallow",
    "undecided_percent",
    "raised_percent",
];

/// One row of a table with `COLUMNS`.
pub fn row_of(class: &Class, setting: &str, value: f64, known: &Known, m: &Measured) -> Vec<Cell> {
    let us = |q: f64| 1e6 * quantile(m.laps.iter().map(|l| l.least[0]), q);
    let ratio = |q: f64| quantile(m.laps.iter().map(|l| l.least_ratio()), q);
    let count = |of: fn(&Outcome) -> u64, q: f64| quantile(m.answers.iter().map(|o| of(o) as f64), q);
    let percent = |n: usize| 100.0 * n as f64 / (m.answers.len().max(1)) as f64;
    row![
        class.name.clone(),
        class.group,
        setting,
        value,
        m.answers.len(),
        us(0.5),
        us(0.99),
        us(1.0),
        ratio(0.5),
        ratio(0.99),
        ratio(1.0),
        count(|o| o.counters.cells, 0.5),
        count(|o| o.counters.cells, 0.99),
        count(|o| o.counters.cells, 1.0),
        count(|o| o.counters.clauses, 0.5),
        count(|o| o.counters.newton, 0.5),
        count(|o| o.counters.closed_forms, 0.5),
        known.by,
        median(m.errors.iter().copied()),
        worst(m.errors.iter().copied()),
        worst(m.brackets.iter().map(|b| b[0])),
        worst(m.brackets.iter().map(|b| b[1])),
        worst(m.budgets.iter().copied()),
        m.wrong,
        m.shallow,
        percent(m.undecided),
        percent(m.raised),
    ]
}
