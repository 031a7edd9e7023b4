//! Fuzzing on the stable toolchain: plain functions from bytes to "what happened", a seeded mutator, a corpus.
//!
//! A target reads bytes as a text, a message, a sequence of steps or a scene, and returns a short word for what became of
//! them, or a sentence for what is wrong. Without coverage at hand the words stand for it: an input whose word is new
//! is interesting, is kept, and is mutated further. `tests/corpus` holds such inputs; they are replayed by the tests.
//!
//! Every target promises: no panic, no NaN, no bracket out of order, no answer refuted by the slow reference (scenes).
//! Nothing is promised about the share of the code that is reached.

mod cache;
mod control;
mod csg;
mod drive;
mod files;
mod reader;
mod scenes;
mod steps;

pub use drive::{Campaign, Finding, checked};
pub use reader::Reader;

use crate::engine::ReportedPoint as _;
use contactd::contact::Outcome;
use std::path::Path;

/// A way to read bytes.
#[derive(Clone, Copy)]
pub struct Target {
    /// Its name, and its folder in the corpus.
    pub name: &'static str,
    /// Runs one input: a word for what happened, or what is wrong. `thorough` asks for the slow checks, too.
    pub run: fn(bytes: &[u8], thorough: bool) -> Result<String, String>,
    /// Inputs to begin with.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Pieces that mutations insert.
    pub words: &'static [&'static str],
    /// Most bytes of an input worth trying.
    pub longest: usize,
    /// One in so many inputs of a campaign is run with the slow checks.
    pub thorough_every: u64,
}

/// All targets.
pub const TARGETS: [Target; 7] =
    [csg::TARGET, control::TARGET, steps::TARGET, scenes::TARGET, cache::TARGET, files::MESHES, files::DRAWINGS];

/// What must hold of any outcome, whatever was asked.
fn sound(o: &Outcome) -> Result<(), String> {
    let times = [o.time_lower(), o.time(), o.time_upper()];
    if times.iter().any(|t| !(0.0..=1.0).contains(t)) || o.time_lower() > o.time() || o.time() > o.time_upper() {
        return Err(format!("bracket out of order: {times:?}"));
    }
    let numbers = [o.at().separation, o.at().normal_speed, o.resolution, o.at().point.length(), o.at().normal.length()];
    if numbers.iter().any(|n| n.is_nan()) || !o.at().point.is_finite() {
        return Err(format!("a NaN in {o:?}"));
    }
    let reported = matches!(o.status(), contactd::contact::Status::Contact | contactd::contact::Status::Overlap);
    if reported && (o.at().normal.length() - 1.0).abs() > 1e-9 {
        return Err(format!("a normal of length {}", o.at().normal.length()));
    }
    Ok(())
}

/// The inputs of a target's corpus, by name of their files.
pub fn corpus(target: &Target) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../corpus").join(target.name);
    let mut files: Vec<_> = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()).collect();
    files.sort();
    files.iter().map(|f| std::fs::read(f).expect("a file of the corpus")).collect()
}

/// A name for an input (FNV-1a).
pub fn digest(input: &[u8]) -> u64 {
    input.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3))
}
