//! `effects`: what each effect costs when it is on, and that it costs nothing when it is off, as a report of figures, tables
//! and a page.
//!
//! The page (`index.html`, each figure as SVG and PNG, each table as CSV) goes into the folder of `--csv DIR`, by default
//! `benches/effects` in cargo's target folder. The full form takes some minutes; without `--csv` it also writes the tables between
//! the marks of `docs/effects.md`, and beside that text the figures that it shows and all numbers as CSV.
//!
//! `effects probe` is what callgrind is given to run: one scene, stepped.

use clap::Parser;
use contactd_benches::callgrind;
use contactd_benches::effects::{Context, Probe, instructions, ladder, share, single};
use contactd_benches::page::{Place, made_by, publish};
use contactd_benches::race::Plan;
use std::error::Error;
use std::path::Path;
use std::time::{Duration, Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let callgrind::Arguments { options, task } = callgrind::Arguments::<Probe>::parse();
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    if let Some(callgrind::Task::Probe(probe)) = task {
        probe.run();
        return Ok(());
    }
    let from = Instant::now();
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let in_repository = !options.quick && options.csv.is_none();
    let plan = Plan { blocks: options.pick(9, 2), least: Duration::from_millis(options.pick(5, 1)) };
    let context = Context::new(options.pick(6, 3), plan, options.quick)?;
    let mut sections = vec![ladder(&context), single(&context), share(&context)];
    sections.extend(instructions(&context)?);
    let text = format!(
        "{} Times are of one thread of one machine, of steps that are made anew; what carries over are ratios, measured in blocks \
         that alternate, and counts, which are the same everywhere.",
        made_by("effects", options.quick)
    );
    let (words, beside) = (docs.join("effects.md"), docs.join("effects"));
    let page = options.folder().join("effects");
    let place = Place { page: &page, words: in_repository.then_some((&words, &beside)) };
    publish(("contactd: what effects cost", &text), &sections, &place)?;
    eprintln!("effects: {:.0} s", from.elapsed().as_secs_f64());
    Ok(())
}
