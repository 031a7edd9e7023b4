//! A scene's answer, as `contactd check` makes it, and a scene as a folder.

use super::{Effort, Fault, Scene, judge};
use crate::record_judge::{Lie, lies};
use crate::reference::Moving;
use contactd::check::Check;
use contactd::contact::{Status, default_resolution};
use contactd::import::{self, Facets, Limits, import_csg};
use contactd::octree::Model;
use contactd::world::{PairOutcome, StepOptions, StepOutcome};
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// What was answered.
#[derive(Debug)]
pub struct Answer {
    /// The pair of the two bodies, a first.
    pub pair: PairOutcome,
    /// The world before the step.
    pub check: Check,
    /// The resolution that was asked for.
    pub own_resolution: f64,
    /// Seconds that the step took, reading and preprocessing not counted.
    pub seconds: f64,
}

impl Answer {
    /// What the judge of records finds in it.
    pub fn lies(&self) -> Vec<(Lie, String)> {
        let moving = |id: u32| {
            let body = self.check.world.body(id).expect("a body of the pair");
            (body.part.model.clone(), body.place, body.motion_state.motion)
        };
        let ((a, place_a, motion_a), (b, place_b, motion_b)) = (moving(self.pair.a), moving(self.pair.b));
        lies(
            &Moving { solid: &a.solid, place: place_a, motion: motion_a },
            &Moving { solid: &b.solid, place: place_b, motion: motion_b },
            &self.pair.outcome,
        )
    }

    /// The witness that the answer's certificate names: a point of a's frame or of b's, its time, itself.
    pub fn witness(&self) -> Option<(bool, f64, DVec3)> {
        let step = StepOutcome { pairs: vec![self.pair], ..StepOutcome::default() };
        let (text, _) = self.check.certificates(&step);
        let line = |name: &str| text.lines().find(|l| l.starts_with(name)).map(|l| l.split(' ').collect::<Vec<_>>());
        let reference = line("pair ")?.get(4)?.parse::<usize>().ok()?;
        let numbers: Vec<f64> = line("witness ")?.iter().skip(1).filter_map(|w| w.parse().ok()).collect();
        let [t, x, y, z] = numbers[..] else { return None };
        Some((reference == 0, t, DVec3::new(x, y, z)))
    }
}

/// Asks a scene with at most so many cells; 0 is the engine's own limit.
///
/// # Errors
/// What was refused, as a sentence.
pub fn ask(scene: &Scene, cells: u64) -> Result<Answer, String> {
    let parsed = import::Scene::parse("scene.toml", &scene.text(), Path::new("")).map_err(|e| e.to_string())?;
    let limits = Limits::default();
    let model = |name: &str, text: &str| {
        let import = import_csg(name, text, Facets::Auto, &limits).map_err(|e| e.to_string())?;
        Ok::<_, String>(Arc::new(Model::new(import.solid)))
    };
    let models = [model("a.csg", &scene.a.text())?, model("b.csg", &scene.b.text())?];
    let own = models.iter().map(|m| default_resolution(m, m)).fold(0.0, f64::max);
    let own_resolution = parsed.resolution.unwrap_or(own);
    let mut check = Check::new(&parsed, &models, None).map_err(|e| e.to_string())?;
    let options = StepOptions { clear: true, cell_limit: cells, batch_limit: cells, ..StepOptions::default() };
    let started = Instant::now();
    let step = check.world.step(&check.records, &options).map_err(|e| e.to_string())?;
    let seconds = started.elapsed().as_secs_f64();
    let [pair] = step.pairs.as_slice() else { return Err(format!("{} pairs reported", step.pairs.len())) };
    let pair = *pair;
    Ok(Answer { pair, check, own_resolution, seconds })
}

/// Writes a scene as a folder that `contactd check FOLDER/scene.toml` reads, with a note beside it.
///
/// # Errors
/// What the file system says.
pub fn write(scene: &Scene, folder: &Path, note: &str) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    std::fs::write(folder.join("scene.toml"), scene.text())?;
    std::fs::write(folder.join("a.csg"), scene.a.text())?;
    std::fs::write(folder.join("b.csg"), scene.b.text())?;
    std::fs::write(folder.join("note.md"), note)
}

/// What became of a scene.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// What was answered; `None` where nothing was.
    pub status: Option<Status>,
    /// A contact whose time is that of its witness.
    pub not_continued: bool,
    /// Cells refined.
    pub cells: u64,
    /// Seconds that the step took.
    pub seconds: f64,
    /// What the judge found.
    pub faults: Vec<Fault>,
}

impl Verdict {
    /// True where the answer is neither wrong nor missing.
    pub fn is_right(&self) -> bool {
        self.faults.is_empty() && self.status.is_some_and(|s| s != Status::Undecided)
    }
}

/// Asks a scene and judges the answer. A panic and a refusal are faults.
pub fn examine(scene: &Scene, cells: u64, effort: Effort) -> Verdict {
    let mut verdict = Verdict { status: None, not_continued: false, cells: 0, seconds: 0.0, faults: Vec::new() };
    let fault = |kind: &str, text| Fault { kind: kind.into(), text };
    match std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| ask(scene, cells))) {
        Err(_) => verdict.faults.push(fault("panic", "the step panicked".into())),
        Ok(Err(refusal)) => verdict.faults.push(fault("refused", refusal)),
        Ok(Ok(answer)) => {
            let o = &answer.pair.outcome;
            verdict.status = Some(o.status());
            verdict.not_continued = o.not_continued();
            verdict.cells = o.counters.cells;
            verdict.seconds = answer.seconds;
            verdict.faults = judge(scene, o, effort, || answer.witness());
            let lies = answer.lies().into_iter();
            verdict.faults.extend(lies.map(|(lie, text)| Fault { kind: format!("record: {lie:?}"), text }));
        }
    }
    verdict
}
