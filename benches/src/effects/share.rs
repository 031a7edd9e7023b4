//! The cost of an effect against the share f of the pairs that ask for it.

use super::{Context, Counted, race_scenes};
use crate::figure::{Axis, Figure, Series, Stroke};
use crate::page::Section;
use crate::race::worst;
use crate::row;
use crate::table::Table;
use contactd_proto::{EffectCounters, Rule};
use contactd_tests::lanes::{Class, EFFECT, EFFECTS, Lane, Lanes, PLAIN, rule};

/// Copies of each lane; f goes in steps of one copy.
const COPIES: usize = 8;

/// A least-squares line through points.
struct Line {
    intercept: f64,
    slope: f64,
    /// Share of the points' variance that it explains.
    r2: f64,
    /// Root mean square of what it leaves.
    rest: f64,
}

impl Line {
    fn through(points: &[[f64; 2]]) -> Self {
        let n = points.len() as f64;
        let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / n;
        let (x, y) = (mean(0), mean(1));
        let sum = |f: &dyn Fn(&[f64; 2]) -> f64| points.iter().map(f).sum::<f64>();
        let slope = sum(&|p| (p[0] - x) * (p[1] - y)) / sum(&|p| (p[0] - x).powi(2));
        let intercept = y - slope * x;
        let left = sum(&|p| (p[1] - intercept - slope * p[0]).powi(2));
        Self { intercept, slope, r2: 1.0 - left / sum(&|p| (p[1] - y).powi(2)), rest: (left / n).sqrt() }
    }
}

/// What is shared out: lanes without and with something, and the rules of their groups.
struct Case {
    name: &'static str,
    class: Class,
    lanes: [Vec<Lane>; 2],
    rules: [Rule; 2],
    counter: fn(&EffectCounters) -> u64,
}

impl Case {
    /// The scene with `on` copies that ask for the effect; `with_rule`: the effect's rule is there.
    fn scene(&self, on: usize, with_rule: bool) -> Lanes {
        let group = |copy| if copy < on { EFFECT } else { PLAIN };
        let lanes = |copy| &self.lanes[usize::from(copy < on)];
        let all: Vec<_> =
            (0..COPIES).flat_map(|copy| lanes(copy).iter().map(move |lane| (lane, group(copy)))).collect();
        Lanes::new(&all, &self.rules[..1 + usize::from(with_rule)])
    }
}

fn cases(context: &Context) -> Vec<Case> {
    let few = |class: Class| {
        let lanes = context.lanes(class);
        lanes[..lanes.len().min(if context.quick { 2 } else { 3 })].to_vec()
    };
    let of_rules = EFFECTS.iter().map(|e| Case {
        name: e.name,
        class: e.class,
        lanes: [few(e.class), few(e.class)],
        rules: e.rules(),
        counter: e.counter,
    });
    let mut all: Vec<Case> = of_rules.collect();
    let turning = few(Class::Turning);
    all.push(Case {
        name: "turning (a motion, no rule)",
        class: Class::Turning,
        lanes: [turning.iter().map(Lane::without_spin).collect(), turning],
        rules: [PLAIN, EFFECT].map(|group| rule(group, |_| ())),
        counter: |c| c.turning,
    });
    all
}

/// The section.
pub fn share(context: &Context) -> Section {
    let mut table = Table::new(&[
        "effect",
        "class",
        "f",
        "ratio",
        "line",
        "us_a_pair",
        "box_tests",
        "cells",
        "clauses",
        "newton",
        "instant_cells",
        "counter",
    ]);
    let mut summary = Table::new(&[
        "effect",
        "class",
        "us_plain",
        "ratio_at_0",
        "intercept",
        "slope",
        "r2",
        "rest",
        "counter_at_0",
        "counts_at_0",
        "counts_off_the_line",
    ]);
    let mut lines: Vec<Series> = Vec::new();
    for (i, case) in cases(context).iter().enumerate() {
        context.progress(&format!("share: {}", case.name));
        let pairs = (COPIES * case.lanes[0].len()) as f64;
        let counted: Vec<Counted> = (0..=COPIES).map(|on| Counted::of(&mut case.scene(on, true))).collect();
        let mut scenes: Vec<Lanes> = (0..=COPIES).map(|on| case.scene(on, true)).collect();
        let mut plain: Vec<Lanes> = (0..=COPIES).map(|_| case.scene(0, false)).collect();
        let laps = race_scenes(context.plan, &mut scenes, &mut plain);
        let points: Vec<[f64; 2]> =
            laps.iter().enumerate().map(|(on, lap)| [on as f64 / COPIES as f64, lap.least_ratio()]).collect();
        let line = Line::through(&points);
        let dearer = points[0][1].max(points[COPIES][1]);
        let [none, all] = [&counted[0], &counted[COPIES]];
        // Whole numbers: eight times the count is what the line through both ends says.
        let off = |on: usize| {
            let at = move |k: usize| (COPIES - on) as f64 * none.0[k].1 as f64 + on as f64 * all.0[k].1 as f64;
            counted[on].0.iter().enumerate().map(move |(k, c)| (c.1 as f64 - at(k) / COPIES as f64).abs())
        };
        let without = Counted::of(&mut plain[0]);
        let differ = none.0.iter().zip(&without.0).find(|(p, q)| p != q);
        for (on, (lap, c)) in laps.iter().zip(&counted).enumerate() {
            let f = points[on][0];
            table.push(row![
                case.name,
                case.class.name(),
                f,
                lap.least_ratio(),
                line.intercept + line.slope * f,
                1e6 * lap.least[0] / pairs,
                c.get("box_tests"),
                c.get("cells"),
                c.get("clauses"),
                c.get("newton"),
                c.get("instant_cells"),
                (case.counter)(&scenes[on].step().effect_counters),
            ]);
        }
        summary.push(row![
            case.name,
            case.class.name(),
            1e6 * laps[0].least[1] / pairs,
            points[0][1],
            line.intercept,
            line.slope,
            line.r2,
            line.rest,
            (case.counter)(&scenes[0].step().effect_counters),
            differ.map_or("as plain".to_owned(), |(p, q)| format!("{} {} for {}", p.0, p.1, q.1)),
            worst((0..=COPIES).flat_map(off)),
        ]);
        let points = points.iter().map(|p| [100.0 * p[0], 100.0 * p[1] / dearer]).collect();
        let stroke = if i < 7 { Stroke::Solid } else { Stroke::Dashed };
        lines.push(Series { name: case.name.into(), points, stroke, color: i % 7 });
    }
    let figure = Figure {
        name: "effects_share".into(),
        title: "What is paid against how many ask".into(),
        caption: "Time of a step of which a share of the pairs asks for an effect, in hundredths of its time where none does or all do, \
                  whichever is more. Straight lines: each pair pays for itself. Where a line meets the left edge is what the scene \
                  costs without the effect, and there every count is that of a scene that knows nothing of it. Lines that stay at \
                  100 are effects that cost nothing measurable."
            .into(),
        axes: [
            Axis::Linear("pairs that ask for it, per cent".into()),
            Axis::Linear("time, per cent of the dearer end".into()),
        ],
        series: lines,
    };
    Section {
        name: "effects_share",
        title: "Cost against the share of pairs that ask".into(),
        text: format!(
            "Eight copies of a few pairs, of which 0 to {COPIES} copies ask for the effect. Ratios are to a scene in which the effect's \
             rule is not there: ratio_at_0 is measured, intercept, slope, r2, rest: the least-squares line of the ratios over f, the share of their \
             variance that it explains and what it leaves; where the slope is next to nothing, r2 is of noise. \
             counts_off_the_line: largest difference of any count at any f from the straight line between f = 0 and f = 1."
        ),
        figures: vec![figure],
        table,
        summary,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_goes_through_points_on_a_line() {
        let line = Line::through(&[[0.0, 1.0], [0.5, 2.0], [1.0, 3.0]]);
        assert!((line.intercept - 1.0).abs() < 1e-12 && (line.slope - 2.0).abs() < 1e-12);
        assert!((line.r2 - 1.0).abs() < 1e-12 && line.rest < 1e-12);
        let bent = Line::through(&[[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]]);
        assert!(bent.slope.abs() < 1e-12 && bent.r2.abs() < 1e-12);
    }
}
