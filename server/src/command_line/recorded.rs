//! A recording as a show: its steps as they were, solved anew when somebody looks at them.

use super::warn;
use crate::cache::{self, Cache};
use crate::import::{Limits, Scene, Source};
use crate::recording::Content;
use crate::replay::{self, Run};
use crate::view::buffers::Shown;
use crate::view::show::{Act, Show};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Steps that are shown at most.
const MOST: usize = 20_000;

/// True for the name of a recording.
pub(super) fn is_recording(file: &Path) -> bool {
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap"))
}

/// The show of all steps: an act for each run of steps with the same objects.
///
/// # Errors
/// One sentence.
pub(super) fn show(file: &Path, cache: Option<&Cache>) -> Result<Show, String> {
    let (runs, are_more) = replay::runs(file, MOST).map_err(|e| e.to_string())?;
    if are_more {
        warn(&format!("{}: the first {MOST} steps are shown", file.display()));
    }
    if runs.is_empty() {
        return Err(format!("{}: expected a step that was taken, found none", file.display()));
    }
    let mut models: Vec<Shown> = Vec::new();
    let mut known: HashMap<Arc<Content>, usize> = HashMap::new();
    let mut acts = Vec::new();
    for run in runs {
        let mut of = Vec::new();
        for content in &run.contents {
            let at = match known.get(content) {
                Some(at) => *at,
                None => {
                    models.push(model(content, cache)?);
                    known.insert(content.clone(), models.len() - 1);
                    models.len() - 1
                }
            };
            of.push(at);
        }
        acts.push(act(run, of));
    }
    Show::new(file.file_name().unwrap_or_default().to_string_lossy().into_owned(), models, acts)
}

pub(super) fn model(content: &Content, cache: Option<&Cache>) -> Result<Shown, String> {
    let source = Source {
        name: &content.name,
        format: &content.format,
        bytes: &content.bytes,
        attached: content.attached.as_deref(),
    };
    let made = cache::prepare(cache, &source, content.facets.into(), &Limits::default()).map_err(|e| e.to_string())?;
    Ok(Shown { name: content.name.clone(), file: content.name.clone(), model: made.model })
}

fn act(run: Run, models: Vec<usize>) -> Act {
    let (first, last) = (run.first, run.first + run.scenes.len() as u64 - 1);
    let title = match last - first {
        0 => format!("session {}, step {first}", run.session),
        more => format!("session {}, {} steps from {first} on", run.session, more + 1),
    };
    let scenes = run.scenes;
    let steps = scenes.len();
    let name = title.clone();
    let scene = move |i: usize| Scene::parse(&name, &scenes[i], Path::new("")).map_err(|e| e.to_string());
    Act { title, steps, models, scene: Box::new(scene) }
}
