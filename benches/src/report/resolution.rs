//! The resolution, from a hundredth of the size to 1e-12 of it: what it costs, what it gives, and in which classes.

use super::{Context, GROUPS, series, times};
use crate::figure::{Axis, Figure, Stroke};
use crate::measure::{COLUMNS, DEFAULT, Measured, Setting, budget, measure, row_of};
use crate::page::Section;
use crate::race::{median, quantile, worst};
use crate::row;
use crate::table::{Table, shown};

/// What is told of a class in pictures: nine digits and three, and the finest there are.
const TOLD: [f64; 3] = [1e-3, DEFAULT, 1e-12];

/// Smallest length, in sizes, that a figure tells from none.
const FLOOR: f64 = 1e-17;

/// Two sections: over all, and by class.
pub fn resolution(context: &Context) -> Vec<Section> {
    let exponents: Vec<i32> = context.pick((2..=12).collect(), vec![3, 6, 9, 12]);
    let mut table = Table::new(&COLUMNS);
    let mut summary = Table::new(&[
        "group",
        "resolution",
        "p50_us",
        "p99_us",
        "max_us",
        "ratio_p50",
        "ratio_p99",
        "ratio_max",
        "cells_p99",
        "cells_max",
        "error_max",
        "bracket_max",
        "wrong",
        "undecided",
    ]);
    let mut by_class = Table::new(&[
        "class",
        "truth",
        "cells_1e-3",
        "cells_1e-9",
        "cells_1e-12",
        "p50_us",
        "p99_us",
        "max_us",
        "p50_1e-3",
        "max_1e-3",
        "p50_1e-12",
        "max_1e-12",
        "error_max",
        "budget_max",
    ]);
    let (mut costs, mut errors) = (Vec::new(), Vec::new());
    let mut rows: Vec<(String, [[f64; 2]; TOLD.len()])> = Vec::new();
    // Of nine digits over three: the median and the 99th percentile of each group.
    let mut over_three: Vec<(&str, f64, f64)> = Vec::new();
    // Errors where the resolution is fine enough to pass over nothing, and at all.
    let (mut fine_error, mut coarse_error, mut table_error) = (0.0f64, 0.0f64, 0.0f64);
    let (mut wrong, mut undecided) = (0, 0);
    for (color, group) in GROUPS.into_iter().enumerate() {
        let mut lines: [Vec<[f64; 2]>; 6] = Default::default();
        let mut kept: Vec<Vec<Measured>> = Vec::new();
        for e in &exponents {
            context.progress(&format!("resolution 1e-{e}, {group}"));
            let value = 10f64.powi(-e);
            let setting = Setting::at(value);
            let of_classes: Vec<Measured> = context
                .of(group)
                .map(|(class, known)| {
                    let m = measure((class, &setting), (class, &Setting::default()), known, context.plan);
                    table.push(row_of(class, "resolution", value, known, &m));
                    m
                })
                .collect();
            let all = |of: fn(&Measured) -> Vec<f64>| of_classes.iter().flat_map(of).collect::<Vec<f64>>();
            let ratios = all(|m| m.laps.iter().map(|l| l.least_ratio()).collect());
            let seconds = all(|m| m.laps.iter().map(|l| l.least[0]).collect());
            let cells = all(|m| m.answers.iter().map(|o| o.counters.cells as f64).collect());
            let off = worst(all(|m| m.errors.clone()));
            let wide = worst(all(|m| m.brackets.iter().map(|b| b[0]).collect()));
            let count = |of: fn(&Measured) -> usize| of_classes.iter().map(of).sum::<usize>();
            for (line, q) in lines.iter_mut().zip([0.5, 0.99, 1.0]) {
                line.push([value, quantile(ratios.iter().copied(), q)]);
            }
            lines[3].push([value, off.max(FLOOR)]);
            lines[4].push([value, wide]);
            match group {
                "pairs" if *e >= 6 => table_error = table_error.max(off),
                _ if *e >= 6 => fine_error = fine_error.max(off),
                _ => coarse_error = coarse_error.max(off),
            }
            wrong += count(|m| m.wrong);
            undecided += count(|m| m.undecided);
            let at = |v: &Vec<f64>, q: f64| quantile(v.iter().copied(), q);
            if *e % 3 == 0 {
                summary.push(row![
                    group,
                    value,
                    1e6 * at(&seconds, 0.5),
                    1e6 * at(&seconds, 0.99),
                    1e6 * at(&seconds, 1.0),
                    at(&ratios, 0.5),
                    at(&ratios, 0.99),
                    at(&ratios, 1.0),
                    at(&cells, 0.99),
                    at(&cells, 1.0),
                    off,
                    wide,
                    count(|m| m.wrong),
                    count(|m| m.undecided),
                ]);
            }
            if *e == 3 {
                over_three.push((group, 1.0 / at(&ratios, 0.5), 1.0 / at(&ratios, 0.01)));
            }
            if TOLD.iter().any(|t| (t / value - 1.0).abs() < 1e-6) {
                kept.push(of_classes);
            }
        }
        let e = worst(context.of(group).flat_map(|(c, _)| c.cases.iter().map(budget)));
        lines[5] = exponents.iter().map(|k| [10f64.powi(-k), e]).collect();
        for (i, (class, known)) in context.of(group).enumerate() {
            let us = |k: usize, q: f64| {
                let m = kept.get(k).map(|of| &of[i]);
                m.map_or(f64::NAN, |m| 1e6 * quantile(m.laps.iter().map(|l| l.least[0]), q))
            };
            let cells = |k: usize| {
                let m = kept.get(k).map(|of| &of[i]);
                m.map_or(f64::NAN, |m| median(m.answers.iter().map(|o| o.counters.cells as f64)))
            };
            rows.push((class.name.clone(), std::array::from_fn(|k| [us(k, 0.5), us(k, 1.0)])));
            let at_default = &kept[1][i];
            by_class.push(row![
                class.name.clone(),
                known.by,
                cells(0),
                cells(1),
                cells(2),
                us(1, 0.5),
                us(1, 0.99),
                us(1, 1.0),
                us(0, 0.5),
                us(0, 1.0),
                us(2, 0.5),
                us(2, 1.0),
                worst(at_default.errors.iter().copied()),
                worst(at_default.budgets.iter().copied()),
            ]);
        }
        let [p50, p99, most, off, wide, rounding] = lines;
        costs.push(series(format!("{group}, median"), p50, Stroke::Solid, color));
        costs.push(series(format!("{group}, 99 %"), p99, Stroke::Dashed, color));
        costs.push(series(format!("{group}, slowest"), most, Stroke::Rings, color));
        errors.push(series(format!("{group}, worst error"), off, Stroke::Solid, color));
        errors.push(series(format!("{group}, widest bracket"), wide, Stroke::Dashed, color));
        if group == "parts" {
            errors.push(series("rounding budget, worst", rounding, Stroke::Dashed, 6));
        }
    }
    let three = over_three
        .iter()
        .map(|(group, mid, tail)| {
            format!("{group} {} times as long in the median ({} at the 99th percentile)", times(*mid), times(*tail))
        })
        .collect::<Vec<_>>()
        .join("; ");
    let sizes = |label: &str| Axis::Log(label.into());
    let time = Figure {
        name: "accuracy_time".into(),
        title: "What a finer resolution costs".into(),
        caption: format!(
            "Time of a question over the time of the same question at the default resolution, 1e-9 of the size; finer is left, \
             coarser right. Where a curve is flat, accuracy is free. Nine digits take, against three: {three}. From \
             1e-5 of the size up some parts take longer, not shorter: octrees and bounds are exact up to that depth only. Finer than \
             1e-10 the resolution nears what rounding leaves, and shortcuts give way to the search. Rings: the one question \
             that pays most."
        ),
        axes: [sizes("resolution, in sizes of the pair"), sizes("time / time at 1e-9")],
        series: costs,
    };
    let error = Figure {
        name: "accuracy_error".into(),
        title: "What a finer resolution gives".into(),
        caption: format!(
            "A contact's time is solved to the last digits whatever the resolution: from 1e-6 down it is off by at most {} of the \
             size (solid; of pairs {}, which is what their tables are good for). At coarser ones a first touch that never becomes as \
             deep as the resolution does not count, and a later contact is reported instead (up to {} later). What the resolution \
             sets is the bracket between proof and witness (dashed): twice the resolution for smooth faces, more at edges. The \
             grey line is the rounding budget, below which nothing can be proven. Errors of 0 are drawn at 1e-17.",
            shown(fine_error),
            shown(table_error),
            shown(coarse_error)
        ),
        axes: [sizes("resolution, in sizes of the pair"), sizes("length, in sizes of the pair")],
        series: errors,
    };
    let whiskers = |k: usize| {
        rows.iter().enumerate().flat_map(move |(i, (_, of))| of[k].map(|us| [us, i as f64])).collect::<Vec<_>>()
    };
    let classes = Figure {
        name: "accuracy_classes".into(),
        title: "What each class of questions takes".into(),
        caption: "Time of a question, from the median (dot) to the slowest (ring), at three resolutions. Where blue (1e-3) and \
                  orange (1e-9) stand above each other, six more digits are free; orange right of blue pays for them (a ball \
                  into a countersink: the search follows a curved fit down to the resolution); blue right of orange is \
                  slower coarse than fine, as octrees and bounds are exact up to 1e-5 of the size only. Green far to the right: \
                  1e-12 is too near to rounding for the shortcuts."
            .into(),
        axes: [sizes("microseconds a question"), Axis::Rows(rows.iter().map(|r| r.0.clone()).collect())],
        series: ["1e-3", "1e-9 (default)", "1e-12"]
            .iter()
            .enumerate()
            .map(|(k, name)| series(*name, whiskers(k), Stroke::Whiskers, [0, 1, 2][k]))
            .collect(),
    };
    let text = format!(
        "{} classes of questions ({} in all) at resolutions from 1e-2 to 1e-12 of the larger bounding radius, each raced against \
         itself at 1e-9. Told wrongly: {wrong}; undecided: {undecided}. The time tolerance follows from the resolution: the \
         bracket in time is its length over the closing speed (column bracket_time_max of the CSV).",
        context.classes.len(),
        context.classes.iter().map(|c| c.cases.len()).sum::<usize>()
    );
    vec![
        Section {
            name: "accuracy_resolution",
            title: "Resolution".into(),
            text,
            figures: vec![time, error],
            table,
            summary,
        },
        Section {
            name: "accuracy_classes",
            title: "Which questions pay".into(),
            text: "The same questions by class. Times at the default resolution in full, those at 1e-3 and 1e-12 beside. Truth: \
                   who says what is right; error_max is held against that. budget_max: rounding budget E as a share of the \
                   resolution."
                .into(),
            figures: vec![classes],
            table: by_class.clone(),
            summary: by_class,
        },
    ]
}
