//! The bounding volumes of stage 1: balls, boxes, both, boxes along other axes. The comparison that the paper of 1993 names as
//! future work.

use super::{Context, series, times};
use crate::figure::{Axis, Figure, Stroke};
use crate::measure::{Setting, ask, measure};
use crate::page::Section;
use crate::race::{median, quantile, worst};
use crate::row;
use crate::table::{Cell, Table};
use contactd::bound::Volumes;
use contactd::contact::{Clock, Outcome, Scratch, Stage, Status};
use contactd::octree::{Limits, Model};

const ALL: [(Volumes, &str); 4] = [
    (Volumes::Balls, "balls"),
    (Volumes::Boxes, "boxes"),
    (Volumes::Both, "both (default)"),
    (Volumes::Oriented, "both and oriented"),
];

/// The section.
pub fn volumes(context: &Context) -> Section {
    let columns = [
        "class",
        "volumes",
        "cases",
        "p50_us",
        "p99_us",
        "max_us",
        "ratio_p50",
        "ratio_p99",
        "ratio_max",
        "stage_1_p50_us",
        "stage_1_p99_us",
        "stage_1_max_us",
        "left_percent",
        "reported_by_stage_1_percent",
        "cells_p50",
        "cells_p99",
        "cells_max",
        "build_ms",
        "undecided",
    ];
    let mut table = Table::new(&columns);
    let mut summary = Table::new(&[
        "class",
        "balls",
        "balls_max",
        "boxes",
        "boxes_max",
        "both",
        "both_max",
        "oriented",
        "oriented_max",
        "left_balls",
        "left_boxes",
        "left_both",
        "left_oriented",
        "stage_1_us_balls",
        "stage_1_us_boxes",
        "stage_1_us_both",
        "stage_1_us_oriented",
    ]);
    let mut names = Vec::new();
    let mut stage_1: Vec<Vec<[f64; 2]>> = vec![Vec::new(); ALL.len()];
    let mut whole: Vec<Vec<[f64; 2]>> = vec![Vec::new(); ALL.len()];
    let mut pooled: Vec<[Vec<f64>; 2]> = vec![Default::default(); ALL.len()];
    // In front of the search no bounds are asked.
    let setting = Setting::search_alone();
    for (class, known) in context.of("parts") {
        context.progress(&format!("bounding volumes, {}", class.name));
        let (mut ratios, mut lefts, mut ones) = (Vec::new(), Vec::new(), Vec::new());
        for (k, (volumes, name)) in ALL.iter().enumerate() {
            let from = std::time::Instant::now();
            let own = class.remade(|m: &Model| Model::with_volumes(m.solid.clone(), Limits::default(), *volumes));
            let build = from.elapsed().as_secs_f64();
            let m = measure((&own, &setting), (class, &setting), known, context.plan);
            let mut scratch = Scratch::timed();
            let timed: Vec<(Outcome, Clock)> = own
                .cases
                .iter()
                .map(|c| {
                    let once = |scratch: &mut Scratch| {
                        let o = ask(c, &setting, scratch);
                        (o, scratch.take_clock().unwrap_or_default())
                    };
                    let runs = [once(&mut scratch), once(&mut scratch), once(&mut scratch)];
                    runs.into_iter().min_by_key(|(_, clock)| clock.of(Stage::Region)).expect("three runs")
                })
                .collect();
            let spent = |q: f64| 1e6 * quantile(timed.iter().map(|(_, c)| c.of(Stage::Region).as_secs_f64()), q);
            let sum = |of: fn(&Outcome) -> u64| timed.iter().map(|(o, _)| of(o) as f64).sum::<f64>();
            let left = 100.0 * sum(|o| o.counters.after_stage1) / sum(|o| o.counters.primitives);
            let reported =
                timed.iter().filter(|(o, c)| o.status() == Status::Clear && c.last() == Stage::Region).count();
            let us = |q: f64| 1e6 * quantile(m.laps.iter().map(|l| l.least[0]), q);
            let ratio = |q: f64| quantile(m.laps.iter().map(|l| l.least_ratio()), q);
            let cells = |q: f64| quantile(m.answers.iter().map(|o| o.counters.cells as f64), q);
            table.push(row![
                class.name.clone(),
                *name,
                own.cases.len(),
                us(0.5),
                us(0.99),
                us(1.0),
                ratio(0.5),
                ratio(0.99),
                ratio(1.0),
                spent(0.5),
                spent(0.99),
                spent(1.0),
                left,
                100.0 * reported as f64 / own.cases.len().max(1) as f64,
                cells(0.5),
                cells(0.99),
                cells(1.0),
                1e3 * build,
                m.undecided,
            ]);
            ratios.extend([ratio(0.5), ratio(1.0)]);
            lefts.push(left);
            ones.push(spent(0.5));
            let row = names.len() as f64;
            stage_1[k].extend([[spent(0.5), row], [spent(1.0), row]]);
            whole[k].extend([[ratio(0.5), row], [ratio(1.0), row]]);
            pooled[k][0].extend(m.laps.iter().map(|l| l.least_ratio()));
            pooled[k][1].extend(timed.iter().map(|(_, c)| c.of(Stage::Region).as_secs_f64()));
        }
        let numbers = ratios.into_iter().chain(lefts).chain(ones).map(Cell::from);
        summary.push(std::iter::once(Cell::from(class.name.clone())).chain(numbers).collect());
        names.push(class.name.clone());
    }
    let mid = |k: usize| times(median(pooled[k][0].iter().copied()));
    let tail = |k: usize| times(worst(pooled[k][0].iter().copied()));
    let dearer = times(median(pooled[3][1].iter().copied()) / median(pooled[2][1].iter().copied()));
    let caption = format!(
        "Time of a whole question, search alone, over its time with balls and boxes together: median (dot) to worst (ring) of a \
         class. Over all classes balls alone take {} times as long in the median and up to {} times, boxes alone {} and {}, boxes \
         along other axes on top {} and {}. The answers are the same; what differs is how much of both trees is left for the octrees and \
         the cells.",
        mid(0),
        tail(0),
        mid(1),
        tail(1),
        mid(3),
        tail(3),
    );
    let figure = |name: &str, title: &str, caption: String, label: &str, of: &[Vec<[f64; 2]>]| Figure {
        name: name.into(),
        title: title.into(),
        caption,
        axes: [Axis::Log(label.into()), Axis::Rows(names.clone())],
        series: ALL
            .iter()
            .enumerate()
            .map(|(k, (_, name))| series(*name, of[k].clone(), Stroke::Whiskers, k))
            .collect(),
    };
    let figures = vec![
        figure("accuracy_volumes", "Bounding volumes: a whole question", caption, "time / time with both", &whole),
        figure(
            "accuracy_volumes_stage_1",
            "Bounding volumes: stage 1 alone",
            format!(
                "Time that a question spends in stage 1. Boxes along other axes make it {dearer} times as dear in the median; they pay \
                 where what they save behind it is more than that."
            ),
            "microseconds in stage 1",
            &stage_1,
        ),
    ];
    Section {
        name: "accuracy_volumes",
        title: "Bounding volumes".into(),
        text: "Every node of both trees is bounded by balls alone, by boxes alone, by both (each tightened by the other), or \
               by both with a box along each primitive's own axes and one along the other body's axes around where it moves. In the table: time \
               of a question over that with both (a control stands beside: both raced against itself), median and worst; percent \
               of the primitives that are left after stage 1; median microseconds in stage 1."
            .into(),
        figures,
        summary,
        table,
    }
}
