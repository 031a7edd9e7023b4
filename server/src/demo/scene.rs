//! A step of the demo as a scene file, so that `contactd check` can solve it on its own.

use super::script::{Act, acts};
use crate::import::pose_text;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// The act and its own step number for step `step` of the whole demo; `None` beyond its end.
pub fn locate(acts: &[Act], step: usize) -> Option<(&Act, usize)> {
    let mut left = step;
    for act in acts {
        if left < act.steps {
            return Some((act, left));
        }
        left -= act.steps;
    }
    None
}

/// The text of the scene file of a step; its models lie beside it.
pub fn text(act: &Act, i: usize) -> String {
    let mut out = format!("# Step {i} of \"{}\".\nunit = \"mm\"\n", act.title);
    let mut named: Vec<&str> = Vec::new();
    for body in &act.bodies {
        if !named.contains(&body.part.name) {
            named.push(body.part.name);
            let _ = write!(out, "\n[[model]]\nname = \"{0}\"\nfile = \"{0}.csg\"\n", body.part.name);
        }
    }
    for (body, leg) in act.bodies.iter().zip(act.step(i)) {
        let _ = write!(out, "\n[[object]]\nname = \"{}\"\nmodel = \"{}\"\n", body.name, body.part.name);
        if body.fixed {
            out.push_str("motion = \"static\"\n");
        }
        let _ = writeln!(out, "start = {}", pose_text(&leg.start));
        if leg.end != leg.start {
            let _ = writeln!(out, "end = {}", pose_text(&leg.end));
        }
    }
    out
}

/// Writes the scene of a step, and the models that it names, into `folder`; returns the scene's path.
///
/// # Errors
/// A step beyond the demo's end, a folder that cannot be written.
pub fn write(step: usize, folder: &Path) -> Result<PathBuf, String> {
    let acts = acts();
    let total: usize = acts.iter().map(|a| a.steps).sum();
    let (act, i) = locate(&acts, step).ok_or_else(|| format!("expected a step below {total}, found {step}"))?;
    let failed = |path: &Path, e: std::io::Error| format!("{}: expected to write, found {e}", path.display());
    std::fs::create_dir_all(folder).map_err(|e| failed(folder, e))?;
    for body in &act.bodies {
        let path = folder.join(body.part.name).with_extension("csg");
        std::fs::write(&path, body.part.text).map_err(|e| failed(&path, e))?;
    }
    let path = folder.join(format!("step-{step}.toml"));
    std::fs::write(&path, text(act, i)).map_err(|e| failed(&path, e))?;
    Ok(path)
}
