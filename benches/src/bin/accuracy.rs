//! `accuracy`: what accuracy costs in time, as a report of figures, tables and a page.
//!
//! The page (`index.html`, each figure as SVG and PNG, each table as CSV) goes into the folder of `--csv DIR`, by default
//! `benches/accuracy` in cargo's target folder. The full form takes some minutes; without `--csv` it also writes the tables between
//! the marks of `docs/accuracy.md`, and beside that text the figures that it shows and all numbers as CSV.

use clap::Parser;
use contactd_benches::measure::Known;
use contactd_benches::options::Options;
use contactd_benches::page::{Place, made_by, publish};
use contactd_benches::race::Plan;
use contactd_benches::report::{Context, octree, resolution, strategies, today, volumes};
use contactd_benches::workload::classes;
use std::error::Error;
use std::path::Path;
use std::time::{Duration, Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let options = Options::parse();
    let from = Instant::now();
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let in_repository = !options.quick && options.csv.is_none();
    let plan = Plan { blocks: options.pick(3, 1), least: Duration::from_micros(options.pick(20, 5)) };
    let classes = classes(options.pick(40, 2))?;
    eprintln!("accuracy: what is true of {} classes", classes.len());
    let known = classes.iter().map(Known::of).collect();
    let context = Context { classes, known, plan, quick: options.quick };
    let mut sections = resolution(&context);
    sections.push(today(&context));
    sections.push(strategies(&context)?);
    sections.push(volumes(&context));
    sections.push(octree(&context));
    let text = format!(
        "{} Times are of one thread of one machine; what \
         carries over are ratios, measured in blocks that alternate. Medians stand beside the 99th percentile and the slowest: a \
         mean over easy questions hides the one that takes a second.",
        made_by("accuracy", options.quick)
    );
    let (words, beside) = (docs.join("accuracy.md"), docs.join("accuracy"));
    let page = options.folder().join("accuracy");
    let place = Place { page: &page, words: in_repository.then_some((&words, &beside)) };
    publish(("contactd: what accuracy costs", &text), &sections, &place)?;
    eprintln!("accuracy: {:.0} s", from.elapsed().as_secs_f64());
    Ok(())
}
