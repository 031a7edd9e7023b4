//! `families`: thirteen families of random scenes, how many are undecided or answered wrongly, and what they cost.
//!
//! The scenes and the judge are those of `contactd_tests::families`: text through the reader, one step of a world as
//! `contactd check` takes it, then f of both trees by other code along the motion. Every answer is judged with some
//! thousand evaluations of f, one in `--thorough` with a hundred thousand. `wrong` counts answers that a point contradicts, refusals
//! and panics; `not_continued` counts contacts that tell their witness's time. Times are of the step alone, without reading and
//! preprocessing, on as many threads at once as rayon would use (RAYON_NUM_THREADS): compare them within one run.
//!
//! Exit status 1 when a scene is undecided or answered wrongly. `--write DIR` keeps each of these as a folder
//! FAMILY_INDEX for `contactd check`.

use clap::Parser;
use contactd::contact::Status;
use contactd_benches::options::Options;
use contactd_benches::race::{quantile, spread, worst};
use contactd_benches::row;
use contactd_benches::table::Table;
use contactd_tests::families::{Effort, NAMES, Verdict, examine, scene, write};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

/// What this benchmark asks for beside the common options.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    options: Options,
    /// Scenes of each family; 1,000, and 40 in the short form.
    #[arg(long, value_name = "N")]
    scenes: Option<u64>,
    /// This family alone, 1 to 13.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u64).range(1..=13))]
    family: Option<u64>,
    /// Index of the first scene.
    #[arg(long, value_name = "I", default_value_t = 0)]
    first: u64,
    /// Other scenes for another one.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Most cells of a search; 0: the engine's own limit, a million.
    #[arg(long, value_name = "N", default_value_t = 0)]
    cells: u64,
    /// One answer in so many is judged thoroughly; 0: none.
    #[arg(long, value_name = "N", default_value_t = 50)]
    thorough: u64,
    /// Folder for the scenes that are undecided or answered wrongly.
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
    /// Tell the scenes that took the most time, so many of each family.
    #[arg(long, value_name = "N", default_value_t = 0)]
    slowest: usize,
}

fn main() -> std::io::Result<ExitCode> {
    let arguments = Arguments::parse();
    let scenes = arguments.scenes.unwrap_or(arguments.options.pick(1000, 40));
    let mut table = Table::new(&[
        "family",
        "scenes",
        "contact",
        "clear",
        "overlap",
        "undecided",
        "cells_p50",
        "cells_p99",
        "cells_largest",
        "us_p50",
        "us_p99",
        "us_largest",
        "not_continued",
        "wrong",
    ]);
    let mut bad: Vec<String> = Vec::new();
    let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
    let mut slow: Vec<String> = Vec::new();
    for family in (0..NAMES.len()).filter(|k| arguments.family.is_none_or(|f| f as usize == k + 1)) {
        let verdicts = judged(&arguments, family, scenes);
        let of = |status: Status| verdicts.iter().filter(|(_, v)| v.status == Some(status)).count();
        let cells = || verdicts.iter().map(|(_, v)| v.cells as f64);
        let micros = || verdicts.iter().map(|(_, v)| v.seconds * 1e6);
        table.push(row![
            format!("{} {}", family + 1, NAMES[family]),
            verdicts.len(),
            of(Status::Contact),
            of(Status::Clear),
            of(Status::Overlap),
            of(Status::Undecided),
            quantile(cells(), 0.5),
            quantile(cells(), 0.99),
            worst(cells()),
            quantile(micros(), 0.5),
            quantile(micros(), 0.99),
            worst(micros()),
            verdicts.iter().filter(|(_, v)| v.not_continued).count(),
            verdicts.iter().filter(|(_, v)| !v.faults.is_empty()).count(),
        ]);
        for (index, v) in verdicts.iter().filter(|(_, v)| !v.is_right()) {
            let undecided = (v.status == Some(Status::Undecided)).then(|| format!("undecided after {} cells", v.cells));
            let faults = v.faults.iter().map(|f| format!("{}: {}", f.kind, f.text));
            let what = undecided.into_iter().chain(faults).collect::<Vec<_>>().join("; ");
            let names = v.faults.iter().map(|f| f.kind.as_str());
            for kind in names.chain((v.status == Some(Status::Undecided)).then_some("undecided")) {
                *kinds.entry(kind.to_owned()).or_default() += 1;
            }
            if let Some(folder) = &arguments.write {
                let note = format!("family {} ({}), index {index}: {what}\n", family + 1, NAMES[family]);
                write(&scene(arguments.seed, family, *index), &folder.join(format!("{}_{index}", family + 1)), &note)?;
            }
            bad.push(format!("{}_{index}: {what}", family + 1));
        }
        let mut order: Vec<_> = verdicts.iter().collect();
        order.sort_by(|x, y| y.1.seconds.total_cmp(&x.1.seconds));
        for (index, v) in order.into_iter().take(arguments.slowest) {
            slow.push(format!("{}_{index}: {:.3} ms, {} cells", family + 1, v.seconds * 1e3, v.cells));
        }
    }
    println!("families: random scenes of two bodies, seed {}, from index {}", arguments.seed, arguments.first);
    table.publish("families", &arguments.options.folder())?;
    bad.iter().chain(&slow).for_each(|line| println!("{line}"));
    for (kind, count) in &kinds {
        println!("{kind}: {count}");
    }
    Ok(if bad.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The verdicts on the scenes of a family, in order.
fn judged(arguments: &Arguments, family: usize, scenes: u64) -> Vec<(u64, Verdict)> {
    spread(scenes, |i| {
        let index = arguments.first + i;
        let thorough = arguments.thorough > 0 && index.is_multiple_of(arguments.thorough);
        let effort = if thorough { Effort::Thorough } else { Effort::Quick };
        (index, examine(&scene(arguments.seed, family, index), arguments.cells, effort))
    })
}
