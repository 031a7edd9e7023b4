//! `warm`: what a step costs when earlier steps have proven much of it, against the same step with all of it forgotten.
//!
//! Three scenes, stepped side by side in two worlds (`stepped`). Times are medians over the steps, `asked` and `cells` means
//! a step.

use clap::Parser;
use contactd_benches::options::Options;
use contactd_benches::race::median;
use contactd_benches::row;
use contactd_benches::stepped::{scenes, walk};
use contactd_benches::table::Table;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let options = Options::parse();
    let steps = options.pick(400, 100);
    let mut table = Table::new(&[
        "scene",
        "objects",
        "steps",
        "told",
        "asked",
        "known",
        "cells",
        "cells_cold",
        "us",
        "us_cold",
        "ratio",
    ]);
    for scene in scenes() {
        let walked = walk(&scene, steps)?;
        let n = steps as f64;
        let ratios = walked.times[0].iter().zip(&walked.times[1]).map(|(warm, cold)| warm / cold);
        table.push(row![
            scene.name,
            scene.recipes.len(),
            steps,
            walked.told as f64 / n,
            f64::from(walked.asked) / n,
            f64::from(walked.known) / n,
            walked.cells[0] as f64 / n,
            walked.cells[1] as f64 / n,
            1e6 * median(walked.times[0].iter().copied()),
            1e6 * median(walked.times[1].iter().copied()),
            median(ratios),
        ]);
    }
    println!("warm: a step that remembers / the same step with all forgotten before it");
    table.publish("warm", &options.folder())?;
    Ok(())
}
