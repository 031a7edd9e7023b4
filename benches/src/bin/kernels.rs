//! `kernels`: the 18 families of primitive pairs against parry's two casts.
//!
//! parry answers a translating pair by `cast_shapes`, a turning one by `cast_shapes_nonlinear`, on its exact spheres,
//! cylinders, cones and boxes. Errors are |time − known time| over the contacts that both found. The known times come from
//! 128-bit arithmetic, but not all are as good as that: where ours differs by more than 1e-10 the reference of the tests, which
//! shares no code with the engine, decides, and `known_off` tells the largest correction. `--without convex` leaves the search
//! alone to answer.
//! `ratio_hits` and `ratio_misses` are medians over the cases that meet and over those that do not. Tails of ratios are
//! of each case's fastest blocks; with 200 cases the p99.9 is the worst case.

use clap::{Parser, ValueEnum};
use contactd::contact::{Outcome, Scratch, Status};
use contactd::octree::Model;
use contactd_benches::options::Options;
use contactd_benches::race::{Lap, Plan, median, quantile, race, worst};
use contactd_benches::table::Table;
use contactd_benches::{peer, queries, row};
use contactd_tests::primitive_pairs::{FAMILIES, rows};
use contactd_tests::reference::Effort;
use contactd_tests::scenes::Scene;
use std::hint::black_box;
use std::time::Duration;

/// Which cases of a family are asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Which {
    All,
    Hits,
    Misses,
}

/// What this benchmark asks for beside the common options.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    options: Options,
    /// This family alone.
    #[arg(long, value_name = "NAME")]
    family: Option<String>,
    /// Ours alone, for a profiler: so many times each case.
    #[arg(long, value_name = "TIMES")]
    alone: Option<usize>,
    /// Cases that are asked.
    #[arg(long, value_enum, default_value_t = Which::All)]
    which: Which,
}

/// A difference from a known time beyond which the reference is asked.
const DOUBTFUL: f64 = 1e-10;

fn main() -> std::io::Result<()> {
    let Arguments { options, family: only, alone, which } = Arguments::parse();
    let strategies = options.strategies();
    let plan = Plan { blocks: options.pick(9, 3), least: Duration::from_micros(options.pick(20, 10)) };
    let mut table = Table::new(&[
        "family",
        "cases",
        "own_us",
        "parry_us",
        "ratio",
        "ratio_hits",
        "ratio_misses",
        "ratio_p90",
        "ratio_p999",
        "ratio_worst",
        "own_p999",
        "own_worst",
        "cells",
        "cells_p999",
        "cells_worst",
        "newton",
        "evaluations",
        "evaluations_worst",
        "wrong",
        "parry_wrong",
        "error_worst",
        "known_off",
        "parry_error_worst",
    ]);
    for family in FAMILIES.into_iter().filter(|f| only.as_deref().is_none_or(|only| *f == only)) {
        let asked = |time: f64| which == Which::All || (time >= 0.0) == (which == Which::Hits);
        let cases = rows(family).into_iter().filter(|(_, time)| asked(*time)).step_by(options.pick(1, 10));
        let cases: Vec<(Scene, f64)> = cases.collect();
        let models: Vec<[Model; 2]> =
            cases.iter().map(|(s, _)| [Model::new(s.a.build()), Model::new(s.b.build())]).collect();
        let own: Vec<queries::Question> = cases
            .iter()
            .zip(&models)
            .map(|((s, _), [a, b])| queries::Question::new((a, s.motion_a), (b, s.motion_b), strategies))
            .collect();
        let other: Vec<peer::Question> = cases.iter().map(|(s, _)| peer::Question::of_scene(s)).collect();

        let mut scratch = Scratch::default();
        if let Some(times) = alone {
            for _ in 0..times {
                own.iter().for_each(|q| {
                    black_box(q.ask(&mut scratch));
                });
            }
            println!("{family}: {} queries", times * own.len());
            continue;
        }
        let answers: Vec<Outcome> = own.iter().map(|q| q.ask(&mut scratch)).collect();
        let theirs: Vec<Option<f64>> = other.iter().map(peer::Question::time).collect();
        let met = |k: usize| cases[k].1 >= 0.0;
        let wrong = (0..cases.len()).filter(|k| met(*k) != (answers[*k].status() == Status::Contact)).count();
        let peer_wrong = (0..cases.len()).filter(|k| met(*k) != theirs[*k].is_some()).count();
        let both = || (0..cases.len()).filter(|k| met(*k) && answers[*k].status() == Status::Contact);
        let known: Vec<f64> = (0..cases.len())
            .map(|k| {
                let ((scene, time), own) = (&cases[k], &answers[k]);
                let doubtful = met(k) && own.status() == Status::Contact && (own.time() - time).abs() > DOUBTFUL;
                if doubtful { scene.truth(Effort::QUICK).time } else { *time }
            })
            .collect();
        let errors = both().map(|k| (answers[k].time() - known[k]).abs());
        let peer_errors = both().filter_map(|k| theirs[k].map(|t| (t - known[k]).abs()));
        let known_off = (0..cases.len()).map(|k| (known[k] - cases[k].1).abs());

        let laps: Vec<Lap> = race(plan, cases.len(), |i| own[i].ask(&mut scratch), |i| other[i].ask());
        let micros = |of: fn(&Lap) -> f64| 1e6 * median(laps.iter().map(of));
        let least = |q: f64| 1e6 * quantile(laps.iter().map(|l| l.least[0]), q);
        let ratio = |hit: bool| median(laps.iter().enumerate().filter(|(k, _)| met(*k) == hit).map(|(_, l)| l.ratio));
        let count = |of: fn(&Outcome) -> u64| answers.iter().map(move |o| of(o) as f64);
        table.push(row![
            family,
            cases.len(),
            micros(|l| l.own),
            micros(|l| l.peer),
            median(laps.iter().map(|l| l.ratio)),
            ratio(true),
            ratio(false),
            quantile(laps.iter().map(|l| l.ratio), 0.9),
            quantile(laps.iter().map(Lap::least_ratio), 0.999),
            worst(laps.iter().map(Lap::least_ratio)),
            least(0.999),
            least(1.0),
            median(count(|o| o.counters.cells)),
            quantile(count(|o| o.counters.cells), 0.999),
            worst(count(|o| o.counters.cells)),
            median(count(|o| o.counters.newton)),
            median(count(|o| o.counters.closed_forms)),
            worst(count(|o| o.counters.closed_forms)),
            wrong,
            peer_wrong,
            worst(errors),
            worst(known_off),
            worst(peer_errors),
        ]);
    }
    if alone.is_some() {
        return Ok(());
    }
    println!("kernels: time a query, ours (certified, resolution 1e-9 of the size) / parry's; median over the cases");
    if !options.without.is_empty() {
        println!("switched off: {:?}", options.without);
    }
    table.publish("kernels", &options.folder())?;
    println!(
        "harness check: parry's sphere-sphere to box-box is 1 : {:.1} (about 1 : 17 is right)",
        peer::sphere_to_box()
    );
    Ok(())
}
