//! Each idea off in turn: what it is worth, and where.

use super::{Context, GROUPS, first_of, series, times};
use crate::figure::{Axis, Figure, Stroke};
use crate::measure::{COLUMNS, Known, Setting, ask, measure, row_of};
use crate::page::Section;
use crate::race::{Plan, median, quantile, worst};
use crate::row;
use crate::stepped::{scenes, walk};
use crate::table::Table;
use crate::workload::Class;
use contactd::contact::{Scratch, Strategies};
use std::error::Error;

/// What is switched off, against what.
struct Off {
    name: &'static str,
    own: Setting,
    base: Setting,
}

fn offs() -> Vec<Off> {
    // What is in front of the search hides what the search's own ideas are worth.
    let of_search = |name, change: fn(&mut Strategies)| {
        let base = Setting::search_alone();
        let mut own = base;
        change(&mut own.strategies);
        Off { name, own, base }
    };
    let in_front = |name, change: fn(&mut Strategies)| {
        let base = Setting::default();
        let mut own = base;
        change(&mut own.strategies);
        Off { name, own, base }
    };
    vec![
        in_front("convex pairs in front", |i| i.convex = false),
        in_front("bodies in holes in front", |i| i.cavities = false),
        of_search("stage 1 (region)", |i| i.region = false),
        of_search("stage 2 (octrees)", |i| i.walk = false),
        of_search("multipliers", |i| i.multipliers = false),
        of_search("same-shape fits", |i| i.fits = false),
        of_search("smaller cells", |i| i.tighten = false),
        of_search("incumbent cuts", |i| i.hints = false),
    ]
}

/// Cells that a question without an idea may take: enough to tell, few enough to finish. More where its base needs many.
fn limit(class: &Class, base: &Setting) -> u64 {
    let mut scratch = Scratch::default();
    let most = class.cases.iter().map(|c| ask(c, base, &mut scratch).counters.cells).max().unwrap_or(0);
    let primitives = |c: &crate::workload::Case| c.a.solid.primitives.len() + c.b.solid.primitives.len();
    let large = class.cases.iter().any(|c| primitives(c) > 20);
    (4 * most).max(if large { 200 } else { 2000 })
}

/// The section.
///
/// # Errors
/// A scene of steps answers otherwise when it forgets.
pub fn strategies(context: &Context) -> Result<Section, Box<dyn Error>> {
    let mut table = Table::new(&COLUMNS);
    let mut summary = Table::new(&[
        "off",
        "group",
        "ratio_p50",
        "ratio_p99",
        "ratio_max",
        "cells_p50",
        "cells_p50_on",
        "cells_max",
        "cells_max_on",
        "undecided_percent",
        "wrong",
    ]);
    let all = offs();
    let mut names: Vec<String> = all.iter().map(|o| o.name.into()).collect();
    names.push("coherence over steps".into());
    let mut whiskers: Vec<Vec<[f64; 2]>> = vec![Vec::new(); GROUPS.len() + 1];
    let plan = Plan { blocks: context.plan.blocks.min(2), ..context.plan };
    for (color, group) in GROUPS.into_iter().enumerate() {
        let few: Vec<(Class, Known)> = context.of(group).map(|c| first_of(c, context.pick(8, 2))).collect();
        for (k, off) in all.iter().enumerate() {
            context.progress(&format!("without {}, {group}", off.name));
            let (mut ratios, mut cells, mut cells_on) = (Vec::new(), Vec::new(), Vec::new());
            let (mut undecided, mut wrong, mut asked) = (0, 0, 0);
            for (class, known) in &few {
                let own = Setting { limit: limit(class, &off.base), ..off.own };
                let m = measure((class, &own), (class, &off.base), known, plan);
                table.push(row_of(class, &format!("without {}", off.name), f64::NAN, known, &m));
                ratios.extend(m.laps.iter().map(|l| l.least_ratio()));
                cells.extend(m.answers.iter().map(|o| o.counters.cells as f64));
                let mut scratch = Scratch::default();
                cells_on.extend(class.cases.iter().map(|c| ask(c, &off.base, &mut scratch).counters.cells as f64));
                undecided += m.undecided;
                wrong += m.wrong;
                asked += m.answers.len();
            }
            let at = |q: f64| quantile(ratios.iter().copied(), q);
            whiskers[color].extend([[at(0.5), k as f64], [at(1.0), k as f64]]);
            summary.push(row![
                off.name,
                group,
                at(0.5),
                at(0.99),
                at(1.0),
                median(cells.iter().copied()),
                median(cells_on.iter().copied()),
                worst(cells.iter().copied()),
                worst(cells_on.iter().copied()),
                100.0 * f64::from(undecided as u32) / asked.max(1) as f64,
                wrong,
            ]);
        }
    }
    for scene in scenes() {
        context.progress(&format!("coherence, scene {}", scene.name));
        let walked = walk(&scene, context.pick(200, 20))?;
        let ratios: Vec<f64> = walked.times[0].iter().zip(&walked.times[1]).map(|(warm, cold)| cold / warm).collect();
        let at = |q: f64| quantile(ratios.iter().copied(), q);
        whiskers[GROUPS.len()].extend([[at(0.5), all.len() as f64], [at(1.0), all.len() as f64]]);
        let steps = ratios.len() as f64;
        summary.push(row![
            "coherence over steps",
            format!("steps: {}", scene.name),
            at(0.5),
            at(0.99),
            at(1.0),
            walked.cells[1] as f64 / steps,
            walked.cells[0] as f64 / steps,
            f64::NAN,
            f64::NAN,
            0.0,
            0usize,
        ]);
    }
    let dearest = |name: &str| {
        let at = names.iter().position(|n| n == name).unwrap_or(0) as f64;
        let of = whiskers.iter().flat_map(|w| w.chunks(2)).filter(|p| p[0][1] == at);
        times(of.map(|p| p[1][0]).fold(0.0, f64::max))
    };
    let figure = Figure {
        name: "accuracy_ideas".into(),
        title: "What a question costs with one idea switched off".into(),
        caption: format!(
            "Time without the idea over the time with it, median (dot) to worst (ring) over the questions of a group; right of 1 \
             the idea earns its keep, left of 1 it costs more than it brings there. Without multipliers a bound rests on one face \
             alone, and most searches end undecided at their limit of cells: the ratio (up to {}) is then only a lower bound. \
             The upper two rows are against the whole engine, the next five against the search alone, the last is \
             a step that forgets against one that remembers.",
            dearest("multipliers")
        ),
        axes: [Axis::Log("time without / time with".into()), Axis::Rows(names.clone())],
        series: GROUPS
            .iter()
            .chain(&["steps"])
            .enumerate()
            .map(|(k, name)| series(*name, whiskers[k].clone(), Stroke::Whiskers, k))
            .collect(),
    };
    Ok(Section {
        name: "accuracy_ideas",
        title: "Each idea off in turn".into(),
        text: "No idea changes what an answer promises; each changes the work. Questions without an idea may take at least 2,000 \
               cells (200 where more than twenty primitives meet) and four times what the dearest takes with it; those that need \
               more are undecided."
            .into(),
        figures: vec![figure],
        table,
        summary,
    })
}
