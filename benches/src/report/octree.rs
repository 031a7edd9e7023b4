//! The depth of the octrees: what it costs at load, what it saves in a question.

use super::{Context, series, times};
use crate::figure::{Axis, Figure, Stroke};
use crate::measure::{Setting, measure};
use crate::page::Section;
use crate::race::{median, quantile};
use crate::row;
use crate::table::Table;
use contactd::octree::{Limits, Model};
use std::cell::Cell;

/// Loads of a model, the fastest of which counts: single ones are short and noisy.
const LOADS: usize = 5;
/// Nodes that an octree may have here: a quarter of a gigabyte or so.
const MOST_NODES: usize = 300_000;

/// The section.
pub fn octree(context: &Context) -> Section {
    let mut table = Table::new(&[
        "class",
        "depth",
        "built",
        "nodes",
        "build_ms",
        "cases",
        "p50_us",
        "p99_us",
        "max_us",
        "ratio_p50",
        "ratio_p99",
        "ratio_max",
        "node_pairs_p50",
        "cells_p50",
        "cells_p99",
        "cells_max",
        "undecided",
    ]);
    let depths: Vec<u8> = context.pick((0..=8).collect(), vec![0, 4]);
    let setting = Setting::search_alone();
    let mut summary = Table::new(&[
        "class",
        "us_at_0",
        "us_at_2",
        "us_at_4",
        "us_at_6",
        "us_at_8",
        "cells_at_0",
        "cells_at_6",
        "load_ms_at_0",
        "load_ms_at_4",
        "load_ms_at_6",
        "load_ms_at_8",
    ]);
    // Ratios to the default, of all questions: at depth 0 and at the deepest.
    let mut pooled = [Vec::new(), Vec::new()];
    let mut curves = Vec::new();
    let mut builds = Vec::new();
    // What a level costs over the one above.
    let mut growth = Vec::new();
    for (color, (class, known)) in context.of("parts").enumerate() {
        let (mut p50, mut loads, mut mid_cells) = (Vec::new(), Vec::new(), Vec::new());
        for depth in &depths {
            context.progress(&format!("octree depth {depth}, {}", class.name));
            let (nodes, built, seconds) = (Cell::new(0), Cell::new(0), Cell::new(0.0));
            let remake = |m: &Model| {
                let limits = Limits { nodes: MOST_NODES, ..Limits::to_depth(*depth) };
                let load = || {
                    let from = std::time::Instant::now();
                    let made = Model::with_limits(m.solid.clone(), limits);
                    (from.elapsed().as_secs_f64(), made)
                };
                let (mut least, made) = load();
                for _ in 1..LOADS {
                    least = load().0.min(least);
                }
                seconds.set(seconds.get() + least);
                nodes.set(nodes.get() + made.octree.census().nodes());
                built.set(built.get().max(usize::from(made.octree.depth())));
                made
            };
            let own = class.remade(remake);
            let m = measure((&own, &setting), (class, &setting), known, context.plan);
            let us = |q: f64| 1e6 * quantile(m.laps.iter().map(|l| l.least[0]), q);
            let ratio = |q: f64| quantile(m.laps.iter().map(|l| l.least_ratio()), q);
            let cells = |q: f64| quantile(m.answers.iter().map(|o| o.counters.cells as f64), q);
            table.push(row![
                class.name.clone(),
                usize::from(*depth),
                built.get(),
                nodes.get(),
                1e3 * seconds.get(),
                own.cases.len(),
                us(0.5),
                us(0.99),
                us(1.0),
                ratio(0.5),
                ratio(0.99),
                ratio(1.0),
                median(m.answers.iter().map(|o| o.counters.node_pairs as f64)),
                cells(0.5),
                cells(0.99),
                cells(1.0),
                m.undecided,
            ]);
            for (end, ratios) in [depths[0], depths[depths.len() - 1]].into_iter().zip(&mut pooled) {
                if *depth == end {
                    ratios.extend(m.laps.iter().map(|l| l.least_ratio()));
                }
            }
            mid_cells.push([f64::from(*depth), cells(0.5)]);
            p50.push([f64::from(*depth), us(0.5)]);
            loads.push([f64::from(*depth), 1e3 * seconds.get()]);
        }
        let levels = loads.windows(2).filter(|w| w[0][0] >= 2.0 && w[1][0] == w[0][0] + 1.0);
        growth.extend(levels.map(|w| w[1][1] / w[0][1]));
        let at = |line: &[[f64; 2]], depth: f64| line.iter().find(|p| p[0] == depth).map_or(f64::NAN, |p| p[1]);
        summary.push(row![
            class.name.clone(),
            at(&p50, 0.0),
            at(&p50, 2.0),
            at(&p50, 4.0),
            at(&p50, 6.0),
            at(&p50, 8.0),
            at(&mid_cells, 0.0),
            at(&mid_cells, 6.0),
            at(&loads, 0.0),
            at(&loads, 4.0),
            at(&loads, 6.0),
            at(&loads, 8.0),
        ]);
        let stroke = if color < 6 { Stroke::Solid } else { Stroke::Dashed };
        curves.push(series(class.name.clone(), p50, stroke, color % 6));
        builds.push(series(class.name.clone(), loads, stroke, color % 6));
    }
    let levels = if growth.is_empty() {
        String::new()
    } else {
        let of = |q: f64| times(quantile(growth.iter().copied(), q));
        let (middle, low, high) = (of(0.5), of(0.1), of(0.9));
        format!(
            " From the third on a level takes {middle} times the one above in the median, eight in ten {low} to {high}."
        )
    };
    let reported = |k: usize, q: f64| times(quantile(pooled[k].iter().copied(), q));
    let axes = |label: &str| [Axis::Linear("levels below the root".into()), Axis::Log(label.into())];
    Section {
        name: "accuracy_octree",
        title: "Depth of the octrees".into(),
        text: format!(
            "Octrees of both models built to a depth, against the default (up to 6 levels, within 400,000 evaluated primitives and \
             32,768 nodes); search alone. A level that would take more than {MOST_NODES} nodes is left out: column built."
        ),
        figures: vec![
            Figure {
                name: "accuracy_octree".into(),
                title: "What the octrees' depth is worth in a question".into(),
                caption: format!(
                    "Median time of a question, search alone. The answer and its accuracy do not depend on the depth, and the \
                     time hardly: over all questions an undivided octree takes {} times the default's time in the median ({} at the \
                     1st percentile, {} at the 99th, {} at most), the deepest {} times. On parts like these stage 1 and the alternatives \
                     of the tree have reported apart most of what an octree could.",
                    reported(0, 0.5),
                    reported(0, 0.01),
                    reported(0, 0.99),
                    reported(0, 1.0),
                    reported(1, 0.5),
                ),
                axes: axes("microseconds a question"),
                series: curves,
            },
            Figure {
                name: "accuracy_octree_load".into(),
                title: "What the octrees' depth costs at load".into(),
                caption: format!(
                    "Time to preprocess the models of a class, once for each model, the fastest of {LOADS}.{levels} The default stops \
                     at six, within limits on work and memory."
                ),
                axes: axes("milliseconds to load"),
                series: builds,
            },
        ],
        summary,
        table,
    }
}
