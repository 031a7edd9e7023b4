//! `tail`: what the dearest of random pairs cost. Trees of 5, 20 and 60 primitives, drilled, hollow or in a fit
//! (`contactd_tests::families::of_size`), each asked once, cold, as `contactd check` asks.
//!
//! Times are of the step alone, without reading and preprocessing, on as many threads at once as rayon would use
//! (RAYON_NUM_THREADS): compare them within one run. Counts are the same in each. The ten dearest of each size, by evaluations of
//! literals, are named; `--write DIR` keeps them as folders for `contactd check`.

use clap::Parser;
use contactd::contact::{Counters, Status};
use contactd_benches::options::Options;
use contactd_benches::race::{quantile, spread, worst};
use contactd_benches::row;
use contactd_benches::table::Table;
use contactd_tests::families::{ask, of_size, write};
use std::error::Error;
use std::path::PathBuf;

/// How many of the dearest are named.
const DEAREST: usize = 10;

/// What this benchmark asks for beside the common options.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    options: Options,
    /// Pairs of each size; 10,000, and 60 in the short form.
    #[arg(long, value_name = "N")]
    pairs: Option<u64>,
    /// Primitives of a tree, one or more sizes, each of 5 or more.
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_values_t = [5, 20, 60])]
    primitives: Vec<usize>,
    /// Other pairs for another one.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Folder for the dearest pairs.
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
}

/// What a pair cost.
struct Cost {
    index: u64,
    status: Status,
    seconds: f64,
    counters: Counters,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let pairs = arguments.pairs.unwrap_or(arguments.options.pick(10_000, 60));
    let mut table = Table::new(&["primitives", "pairs", "undecided", "quantity", "p50", "p99", "p99_9", "largest"]);
    let mut dearest = Vec::new();
    for primitives in arguments.primitives.iter().copied() {
        let asked = spread(pairs, |index| {
            let answer = ask(&of_size(arguments.seed, primitives, index), 0)?;
            let o = &answer.pair.outcome;
            Ok::<_, String>(Cost { index, status: o.status(), seconds: answer.seconds, counters: o.counters })
        });
        let mut costs = Vec::with_capacity(asked.len());
        for (index, cost) in asked.into_iter().enumerate() {
            costs.push(cost.map_err(|e| format!("{primitives} primitives, pair {index}: {e}"))?);
        }
        let undecided = costs.iter().filter(|c| c.status == Status::Undecided).count();
        let quantities: [(&str, fn(&Cost) -> f64); 4] = [
            ("us", |c| 1e6 * c.seconds),
            ("cells", |c| c.counters.cells as f64),
            ("clauses", |c| c.counters.clauses as f64),
            ("evaluations", |c| c.counters.evaluations as f64),
        ];
        for (name, of) in quantities {
            let values = || costs.iter().map(of);
            let [p50, p99, p99_9] = [0.5, 0.99, 0.999].map(|q| quantile(values(), q));
            table.push(row![primitives, costs.len(), undecided, name, p50, p99, p99_9, worst(values())]);
        }
        costs.sort_by_key(|c| std::cmp::Reverse((c.counters.evaluations, c.index)));
        for cost in costs.iter().take(DEAREST) {
            let Cost { index, seconds, counters: c, .. } = cost;
            let what = format!(
                "{} primitives, pair {index}: {:.3} ms, {} cells, {} clauses, {} evaluations, {}",
                primitives,
                1e3 * seconds,
                c.cells,
                c.clauses,
                c.evaluations,
                cost.status.name()
            );
            if let Some(folder) = &arguments.write {
                let note = format!("seed {}, {what}\n", arguments.seed);
                let scene = of_size(arguments.seed, primitives, *index);
                write(&scene, &folder.join(format!("tree{primitives}_{index}")), &note)?;
            }
            dearest.push(what);
        }
    }
    println!("tail: random pairs of trees, seed {}", arguments.seed);
    table.publish("tail", &arguments.options.folder())?;
    dearest.iter().for_each(|line| println!("{line}"));
    Ok(())
}
