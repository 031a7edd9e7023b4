//! The command line: arguments in, text out, exit status 0 done, 2 bad input, 3 some pair undecided.
#![forbid(unsafe_code)]

use clap::{Parser, Subcommand};
use contactd::import::{self, Facets, Limits};
use contactd::inspect;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Certified earliest contact of solids modelled by constructive solid geometry.
#[derive(Parser)]
#[command(version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// What is in a model or scene file, and how it was imported.
    Inspect {
        /// A .csg or .toml file.
        file: PathBuf,
        /// How curved primitives are taken: exact, auto (prisms below $fn = 9) or as-written.
        #[arg(long, default_value = "auto", value_parser = facets)]
        facets: Facets,
    },
}

/// What the process ends with.
enum Done {
    /// Everything answered.
    Well,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let done = match arguments.command {
        Command::Inspect { file, facets } => inspect_file(&file, facets),
    };
    match done {
        Ok(Done::Well) => ExitCode::SUCCESS,
        Err(sentence) => {
            eprintln!("{sentence}");
            ExitCode::from(2)
        }
    }
}

fn facets(word: &str) -> Result<Facets, String> {
    Facets::of_name(word).ok_or_else(|| format!("expected {}", Facets::NAMES.join(", ")))
}

fn inspect_file(file: &Path, facets: Facets) -> Result<Done, String> {
    let limits = Limits::default();
    let text = if file.extension().is_some_and(|e| e == "toml") {
        let scene = import::read_scene(file).map_err(|e| e.to_string())?;
        let models = scene.load_models(facets, &limits).map_err(|e| e.to_string())?;
        let mut text = inspect::scene(&scene);
        for (source, import) in scene.models.iter().zip(&models) {
            text.push_str(&inspect::model(&source.path.display().to_string(), import));
        }
        text
    } else {
        let import = import::read_csg(file, facets, &limits).map_err(|e| e.to_string())?;
        inspect::model(&file.display().to_string(), &import)
    };
    print(&text)
}

/// Writes to standard output; a reader that has gone away is no error.
fn print(text: &str) -> Result<Done, String> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(format!("expected to write, found {e}")),
        _ => Ok(Done::Well),
    }
}
