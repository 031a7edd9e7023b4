//! `rest`: what bodies that lie on each other cost a step, in a world that remembers and in one that forgets.
//!
//! The scenes are those of `resting`: `still` ones send every object where it lies, `held` ones put it back there in every step
//! as a solver does, to 1e-7, and let it fall by 1e-5. Every step tells the touching pairs with their regions, within a margin of
//! 1e-3. Both worlds answer the same, which is checked. Times are of the step alone; `ratio` is the median over the steps of the
//! one that remembers over the one that forgets.

use clap::Parser;
use contactd_benches::options::Options;
use contactd_benches::race::{median, quantile, worst};
use contactd_benches::resting::scenes;
use contactd_benches::row;
use contactd_benches::stepped::walk;
use contactd_benches::table::Table;
use std::error::Error;

/// What this benchmark asks for beside the common options.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    options: Options,
    /// Scenes alone whose names contain this.
    #[arg(long, value_name = "TEXT", default_value = "")]
    only: String,
}

fn main() -> Result<(), Box<dyn Error>> {
    let Arguments { options, only } = Arguments::parse();
    let steps = options.pick(1000, 60);
    let mut table =
        Table::new(&["scene", "reported", "cells", "cells_cold", "us_p50", "us_p99", "us_largest", "us_cold", "ratio"]);
    for scene in scenes().into_iter().filter(|scene| scene.name.contains(&only)) {
        let walked = walk(&scene, steps)?;
        let n = steps as f64;
        let micros = |k: usize| walked.times[k].iter().map(|t| 1e6 * t);
        table.push(row![
            scene.name,
            walked.reported as f64 / n,
            walked.cells[0] as f64 / n,
            walked.cells[1] as f64 / n,
            median(micros(0)),
            quantile(micros(0), 0.99),
            worst(micros(0)),
            median(micros(1)),
            median(walked.times[0].iter().zip(&walked.times[1]).map(|(warm, cold)| warm / cold)),
        ]);
    }
    println!("rest: a step of bodies that lie on each other, {steps} steps a scene");
    table.publish("rest", &options.folder())?;
    Ok(())
}
