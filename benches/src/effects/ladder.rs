//! The ladder hit, time, contact, patch, penetration: what each rung costs more than the one below it.

use super::{Context, Counted, race_scenes};
use crate::figure::{Axis, Figure, Series, Stroke};
use crate::page::Section;
use crate::row;
use crate::table::Table;
use contactd_proto::{Report, Rule};
use contactd_tests::lanes::Lanes;

/// The rungs: a word, the report, and whether an overlap is measured.
const RUNGS: [(&str, Report, bool); 5] = [
    ("hit", Report::Hit, false),
    ("time", Report::Time, false),
    ("contact", Report::Contact, false),
    ("patch", Report::Patch, false),
    ("penetration", Report::Patch, true),
];
/// The default rule's.
const PLAIN: usize = 2;

/// The section.
pub fn ladder(context: &Context) -> Section {
    let mut table = Table::new(&[
        "class",
        "rung",
        "pairs",
        "us_a_pair",
        "ratio_below",
        "ratio_contact",
        "cells",
        "clauses",
        "instant_cells",
        "time",
        "contact",
        "patch",
        "penetration",
    ]);
    let change = |rung: usize| move |r: &mut Rule| (r.report, r.penetration) = (RUNGS[rung].1, RUNGS[rung].2);
    let scenes = |rung: usize| context.kinds.iter().map(|k| Lanes::all(&k.lanes, change(rung))).collect::<Vec<_>>();
    let mut series: Vec<Series> = Vec::new();
    let mut rows = vec![Vec::new(); context.kinds.len()];
    // One time of the default rule for all of a class' bars: they stand as their ratios do.
    let us: Vec<f64> = race_scenes(context.plan, &mut scenes(PLAIN), &mut scenes(PLAIN))
        .iter()
        .zip(&context.kinds)
        .map(|(lap, kind)| 1e6 * lap.least[0].min(lap.least[1]) / kind.lanes.len() as f64)
        .collect();
    for (i, (name, ..)) in RUNGS.iter().enumerate() {
        context.progress(&format!("ladder: {name}"));
        let mut own = scenes(i);
        let below = (i > 0).then(|| race_scenes(context.plan, &mut own, &mut scenes(i - 1)));
        let plain = race_scenes(context.plan, &mut own, &mut scenes(PLAIN));
        let mut points = Vec::new();
        for (k, kind) in context.kinds.iter().enumerate() {
            let c = Counted::of(&mut own[k]);
            let ratio = if i == PLAIN { 1.0 } else { plain[k].least_ratio() };
            points.push([us[k] * ratio, k as f64]);
            rows[k].push(row![
                kind.name.clone(),
                *name,
                kind.lanes.len(),
                us[k] * ratio,
                below.as_ref().map_or(f64::NAN, |laps| laps[k].least_ratio()),
                ratio,
                c.get("cells"),
                c.get("clauses"),
                c.get("instant_cells"),
                c.get("time"),
                c.get("contact"),
                c.get("patch"),
                c.get("penetration"),
            ]);
        }
        series.push(Series { name: (*name).into(), points, stroke: Stroke::Bars, color: i });
    }
    rows.into_iter().flatten().for_each(|row| table.push(row));
    let figure = Figure {
        name: "effects_ladder".into(),
        title: "What each rung of the report costs".into(),
        caption: "Time of a pair in a step that is made anew, by what is asked of it; each rung reports what the one above it in the \
                  legend reports, and more. Where two bars end together the upper rung has nothing to do there: no regions are \
                  looked for of pairs that do not meet, and no depth where nothing overlaps at the start. The scale is \
                  logarithmic: lengths of bars report ratios to its left end only, their ends report times."
            .into(),
        axes: [
            Axis::Log("microseconds a pair".into()),
            Axis::Rows(context.kinds.iter().map(|k| k.name.clone()).collect()),
        ],
        series,
    };
    Section {
        name: "effects_ladder",
        title: "The ladder".into(),
        text: "The same pairs under five rules. ratio_below: time over that of the rung before, ratio_contact: over that of the \
               default rule, each of the fastest of blocks that alternate. Counts are of the whole step; time, contact, patch and \
               penetration are the reply's effect counters."
            .into(),
        figures: vec![figure],
        summary: table.clone(),
        table,
    }
}
