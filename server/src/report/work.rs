//! What the answers cost: by which stage each was told, counts of work, the time of each stage.

use super::answer::PairReport;
use super::table::TableStyle;
use crate::contact::{Clock, Counters, Stage};
use crate::terminal::{Paint, Piece, Role, aligned, clean, cut, fold};
use contactd_proto::EffectCounters;
use std::fmt::Write as _;
use std::time::Duration;

/// Columns of a name.
const NAME: usize = 24;

/// What each answer cost: the stage that told it, primitives before and after stage 1, octree nodes, candidates, cells,
/// clauses, attempts, whole-primitive answers, and the time of each stage by a clock for each pair; `None`: no search was
/// needed.
pub fn work_table(pairs: &[PairReport<'_>], clocks: &[Option<Clock>], style: &TableStyle) -> String {
    let mut out = if style.wide { wide(pairs, clocks) } else { narrow(pairs, clocks, style) };
    let mut sums = [Duration::ZERO; Stage::ALL.len()];
    for clock in clocks.iter().flatten() {
        sums.iter_mut().zip(Stage::ALL).for_each(|(sum, s)| *sum += clock.of(s));
    }
    let total: Duration = sums.iter().sum();
    let share = |d: &Duration| 100.0 * d.as_secs_f64() / total.as_secs_f64().max(1e-9);
    let shares = sums.iter().zip(Stage::ALL).map(|(d, s)| format!("{} {:.0} %", s.name(), share(d)));
    let _ = writeln!(out, "in all {} us: {}", micros(total), shares.collect::<Vec<_>>().join(", "));
    out += "(one thread, nothing remembered; the least of some runs of each pair)\n";
    out
}

/// A block for each pair that was searched; pairs that were told apart in front of any search are counted, or all listed.
fn narrow(pairs: &[PairReport<'_>], clocks: &[Option<Clock>], style: &TableStyle) -> String {
    let (mut out, mut apart) = (String::from("\n"), 0);
    for (p, clock) in pairs.iter().zip(clocks) {
        let [a, b] = p.names.map(|name| cut(&clean(name), NAME));
        let primitives: usize = p.solids.iter().map(|s| s.primitives.len()).sum();
        let Some(clock) = clock else {
            apart += 1;
            if style.all {
                let _ = writeln!(out, "{a} and {b}: boxes, {primitives} primitives");
            }
            continue;
        };
        let told = style.paint.mark(Role::Heading, clock.last().name());
        let _ = writeln!(out, "{a} and {b}: {told}, {} us", micros(clock.total()));
        let Counters {
            after_stage1, node_pairs, candidates, cells, clauses, newton, closed_forms, instant_cells, ..
        } = p.outcome.counters;
        let left = (clock.last() != Stage::Front).then_some((after_stage1, "after stage 1"));
        let counts = [
            (node_pairs, "node pairs"),
            (candidates, "candidates"),
            (cells, "cells"),
            (clauses, "clauses"),
            (newton, "newton"),
            (closed_forms, "closed forms"),
            (instant_cells, "instant cells"),
        ];
        let counts = counts.into_iter().filter(|(n, what)| *n > 0 || *what == "cells");
        let all = [(primitives as u64, "primitives")].into_iter().chain(left).chain(counts);
        let counts: Vec<Piece> = all.map(|(n, what)| (None, format!("{n} {what}"))).collect();
        out += &fold("    ", ", ", &counts, Paint::default());
        let times = Stage::ALL.map(|s| (None, format!("{} {}", s.name(), micros(clock.of(s)))));
        out += &fold("    us: ", ", ", &times, Paint::default());
    }
    if apart > 0 && !style.all {
        let pairs = if apart == 1 { "pair was" } else { "pairs were" };
        let _ = writeln!(out, "{apart} {pairs} told apart by boxes or one direction, without a search");
    }
    out
}

/// One line for each pair.
fn wide(pairs: &[PairReport<'_>], clocks: &[Option<Clock>]) -> String {
    let header = [
        "a",
        "b",
        "reported by",
        "primitives",
        "after stage 1",
        "node pairs",
        "candidates",
        "cells",
        "clauses",
        "newton",
        "closed forms",
        "instant cells",
        "in front",
        "stage 1",
        "stage 2",
        "stage 3",
        "in all",
    ];
    let mut rows = vec![header.map(String::from)];
    for (p, clock) in pairs.iter().zip(clocks) {
        let Counters {
            after_stage1, node_pairs, candidates, cells, clauses, newton, closed_forms, instant_cells, ..
        } = p.outcome.counters;
        let primitives: usize = p.solids.iter().map(|s| s.primitives.len()).sum();
        let reported = clock.as_ref().map_or("boxes", |c| c.last().name());
        let searched = clock.as_ref().is_some_and(|c| c.last() != Stage::Front);
        // What is answered in front never comes to stage 1.
        let left = if searched { after_stage1.to_string() } else { String::new() };
        let [a, b] = p.names.map(clean);
        let counts =
            [node_pairs, candidates, cells, clauses, newton, closed_forms, instant_cells].map(|n| n.to_string());
        let [c0, c1, c2, c3, c4, c5, c6] = counts;
        let times = Stage::ALL.map(|s| clock.as_ref().map_or_else(String::new, |c| micros(c.of(s))));
        let [t0, t1, t2, t3] = times;
        let total = clock.as_ref().map_or_else(String::new, |c| micros(c.total()));
        let primitives = primitives.to_string();
        rows.push([a, b, reported.into(), primitives, left, c0, c1, c2, c3, c4, c5, c6, t0, t1, t2, t3, total]);
    }
    aligned(&rows)
}

/// What the step worked out beside whether its pairs meet: each effect that ran, and how often.
pub fn effects_line(effects: &EffectCounters) -> String {
    let ran: Vec<Piece> =
        effects.each().filter(|(_, n)| *n > 0).map(|(name, n)| (None, format!("{name} {n}"))).collect();
    if ran.is_empty() { "effects: none\n".into() } else { fold("effects: ", ", ", &ran, Paint::default()) }
}

/// Microseconds, to three digits.
fn micros(d: Duration) -> String {
    let us = 1e6 * d.as_secs_f64();
    match us {
        0.0 => "0".into(),
        _ if us < 10.0 => format!("{us:.2}"),
        _ if us < 100.0 => format!("{us:.1}"),
        _ => format!("{us:.0}"),
    }
}
