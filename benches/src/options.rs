//! The command line that all benchmarks share.

use clap::{Parser, ValueEnum};
use contactd::contact::Strategies;
use std::path::PathBuf;

/// A strategy of the search that can be switched off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Strategy {
    /// Stage 1: the collision region by S-bounds.
    Region,
    /// Stage 2: candidates from the walk of both octrees.
    Walk,
    /// Multipliers: several faces bound a cell together.
    Multipliers,
    /// Same-shape fits.
    Fits,
    /// Curved faces touched where a contact was found.
    Hints,
    /// Cells made smaller by what all their clauses share.
    Tighten,
    /// Whole convex primitives answered in front of the search.
    Convex,
    /// Convex primitives against solids with holes answered in front of the search.
    Cavities,
    /// Meshes answered in front of the search.
    Facets,
    /// Balls against other solids answered in front of the search.
    Balls,
    /// A coarser resolution where a search takes too long.
    Coarser,
}

/// Options of a benchmark.
#[derive(Clone, Debug, Parser)]
pub struct Options {
    /// The short form: fewer cases and blocks, below 20 seconds.
    #[arg(long)]
    pub quick: bool,
    /// Folder for the CSV file; by default `benches` in cargo's target folder.
    #[arg(long, value_name = "DIR")]
    pub csv: Option<PathBuf>,
    /// A strategy of the search to switch off; may be given several times.
    #[arg(long, value_name = "STRATEGY")]
    pub without: Vec<Strategy>,
}

impl Options {
    /// The strategies that are left on.
    pub fn strategies(&self) -> Strategies {
        let mut strategies = Strategies::default();
        for strategy in &self.without {
            match strategy {
                Strategy::Region => strategies.region = false,
                Strategy::Walk => strategies.walk = false,
                Strategy::Multipliers => strategies.multipliers = false,
                Strategy::Fits => strategies.fits = false,
                Strategy::Hints => strategies.hints = false,
                Strategy::Tighten => strategies.tighten = false,
                Strategy::Convex => strategies.convex = false,
                Strategy::Cavities => strategies.cavities = false,
                Strategy::Facets => strategies.facets = false,
                Strategy::Balls => strategies.balls = false,
                Strategy::Coarser => strategies.coarser = false,
            }
        }
        strategies
    }

    /// `full`, or `quick` in the short form.
    pub fn pick<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    /// The folder for CSV files.
    pub fn folder(&self) -> PathBuf {
        self.csv.clone().unwrap_or_else(|| {
            // The program lies in TARGET/release.
            let program = std::env::current_exe().unwrap_or_default();
            program.parent().and_then(|p| p.parent()).map_or_else(|| "target".into(), PathBuf::from).join("benches")
        })
    }
}
