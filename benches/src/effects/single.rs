//! Single effects against the plain rule: turning against not, continuous against discrete, margins, overlaps searched past.

use super::{Context, Counted, race_scenes};
use crate::page::Section;
use crate::row;
use crate::table::Table;
use contactd_proto::{Detect, InitialOverlap, Rule};
use contactd_tests::lanes::{Class, Lane, Lanes, NARROW, WIDE};

/// A rule's change.
type Change = fn(&mut Rule);

/// The section.
pub fn single(context: &Context) -> Section {
    let mut table = Table::new(&[
        "effect",
        "against",
        "class",
        "ratio",
        "us_on",
        "us_off",
        "cells_on",
        "cells_off",
        "instant_on",
        "instant_off",
        "counter",
        "count",
    ]);
    let mut add = |[name, against, counter]: [&str; 3], class: &str, mut on: Lanes, mut off: Lanes, pairs: usize| {
        context.progress(&format!("{name} against {against}, {class}"));
        let (with, without) = (Counted::of(&mut on), Counted::of(&mut off));
        let mut scenes = [vec![on], vec![off]];
        let [own, peer] = &mut scenes;
        let lap = race_scenes(context.plan, own, peer)[0];
        let us = |k: usize| 1e6 * lap.least[k] / pairs as f64;
        table.push(row![
            name,
            against,
            class,
            lap.least_ratio(),
            us(0),
            us(1),
            with.get("cells"),
            without.get("cells"),
            with.get("instant_cells"),
            without.get("instant_cells"),
            counter,
            with.get(counter),
        ]);
    };
    for kind in &context.kinds {
        let straight: Vec<Lane> = kind.lanes.iter().map(Lane::without_spin).collect();
        let plain: Change = |_| ();
        let n = kind.lanes.len();
        if kind.lanes.iter().zip(&straight).any(|(p, q)| p.motions != q.motions) {
            let words = ["turning", "the same pairs with spin 0", "turning"];
            add(words, &kind.name, Lanes::all(&kind.lanes, plain), Lanes::all(&straight, plain), n);
        }
        let discrete: Change = |r| r.detect = Detect::Discrete;
        let words = ["continuous", "discrete", "continuous"];
        add(words, &kind.name, Lanes::all(&kind.lanes, plain), Lanes::all(&kind.lanes, discrete), n);
    }
    let rules: [([&str; 3], &[Class], Change); 6] = [
        (["margin, narrow", "none", "margin"], &[Class::Short, Class::Trees, Class::Resting], |r| r.margin = NARROW),
        (["margin, wide", "none", "margin"], &[Class::Short, Class::Trees, Class::Resting], |r| r.margin = WIDE),
        (
            ["ignore_if_separating", "report", "ignore_if_separating"],
            &[Class::Overlapping, Class::Translating, Class::Trees],
            |r| r.initial_overlap = InitialOverlap::IgnoreIfSeparating,
        ),
        (["penetration", "none", "penetration"], &[Class::Overlapping, Class::Translating, Class::Trees], |r| {
            r.penetration = true;
        }),
        (["sensor", "none", "sensor"], &[Class::Translating, Class::Trees], |r| r.sensor = true),
        (["the plain rule", "itself", "contact"], &[Class::Translating, Class::Trees], |_| ()),
    ];
    for (words, classes, change) in rules {
        for class in &classes[..if context.quick { 1 } else { classes.len() }] {
            let lanes = context.lanes(*class);
            add(words, class.name(), Lanes::all(lanes, change), Lanes::all(lanes, |_| ()), lanes.len());
        }
    }
    let lanes = context.lanes(Class::Translating);
    let declared: Vec<Lane> = lanes.iter().map(|lane| Lane { rotates: false, ..lane.clone() }).collect();
    let words = ["rotates = false", "not declared", "continuous"];
    let (on, off) = (Lanes::all(&declared, |_| ()), Lanes::all(lanes, |_| ()));
    add(words, Class::Translating.name(), on, off, lanes.len());
    Section {
        name: "effects_single",
        title: "One effect at a time".into(),
        text: format!(
            "Every pair has the effect against no pair has it, in blocks that alternate. Margins: {NARROW} and {WIDE}, of bodies of \
             size 1. The rows \"the plain rule\" against itself report what the ratios are good for."
        ),
        figures: vec![],
        summary: table.clone(),
        table,
    }
}
