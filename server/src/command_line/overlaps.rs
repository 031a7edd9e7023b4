//! `contactd overlaps`: what is in each other of a GDML geometry or a scene.

use super::joints::JointArguments;
use super::{AccessArguments, CacheArguments, Done, models_of, prepare_scene, print, scene_of, warn};
use crate::import::{Facets, gdml};
use crate::overlaps::{self, Found, Pair, Verdict};
use crate::terminal::{clean, number, sentence};
use serde_json::{Value, json};
use std::error::Error;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(super) struct OverlapsArguments {
    /// A GDML geometry (.gdml), a scene (.toml), a robot; or models, which are taken as they stand.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// How deep two may be in each other, in the file's unit (millimetres of GDML); else 2e-9 of the larger one's radius.
    #[arg(long, value_name = "LENGTH", value_parser = super::length)]
    tolerance: Option<f64>,
    /// One JSON object instead of text.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    joints: JointArguments,
    #[command(flatten)]
    access: AccessArguments,
    #[command(flatten)]
    cache: CacheArguments,
}

/// Is it a GDML geometry, by its name?
pub(super) fn is_gdml(file: &Path) -> bool {
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case("gdml"))
}

/// Asks of all pairs.
pub(super) fn overlaps(arguments: &OverlapsArguments) -> Result<Done, Box<dyn Error>> {
    let (found, unit) = match arguments.files.as_slice() {
        [file] if is_gdml(file) => {
            arguments.joints.none(file)?;
            let volumes = gdml::read_gdml(file)?;
            volumes.notes.iter().for_each(|n| warn(&format!("{}:{}", file.display(), clean(&n.to_string()))));
            let prepared = prepare_scene(&overlaps::scene_of(file, &volumes), Facets::Auto, &arguments.cache)?;
            let models = overlaps::spread(&volumes, &models_of(&prepared));
            let (outside, of) = overlaps::around(file, &volumes, &models);
            let outsides = models_of(&prepare_scene(&outside, Facets::Auto, &arguments.cache)?);
            (overlaps::of_volumes(&volumes, &models, (&outsides, &of), arguments.tolerance), "mm".to_owned())
        }
        files => {
            if let Some(file) = files.iter().find(|f| is_gdml(f)) {
                return Err(format!("expected one GDML file alone, found {} among others", file.display()).into());
            }
            let scene = scene_of(files, &arguments.access, &arguments.joints)?;
            let models = models_of(&prepare_scene(&scene, Facets::Auto, &arguments.cache)?);
            (overlaps::of_scene(&scene, &models, arguments.tolerance), scene.unit)
        }
    };
    print(&if arguments.json { as_json(&found) } else { text(&found, &unit) })?;
    Ok(match found.counts() {
        [0, 0] => Done::Well,
        [0, _] => Done::Undecided,
        _ => Done::Clashes,
    })
}

fn text(found: &Found, unit: &str) -> String {
    let [overlaps, open] = found.counts();
    let [by_boxes, searched] = found.separate;
    let many = |n: usize, one: &str| format!("{n} {one}{}", if n == 1 { "" } else { "s" });
    let mut out = format!(
        "{}, {open} not proven, {} pairs proven separate ({by_boxes} by their boxes)\n",
        many(overlaps, "overlap"),
        by_boxes + searched
    );
    for pair in &found.pairs {
        let (a, mother) = (clean(&pair.a), clean(&pair.within));
        let two = match &pair.b {
            Some(b) => format!("{a} and {}", clean(b)),
            None => format!("{a} sticks out of {mother}"),
        };
        let is_told = !mother.is_empty() && pair.b.is_some();
        let within = if is_told { format!(", in {mother}") } else { String::new() };
        let what = match pair.verdict {
            Verdict::Overlap(x, depth) => {
                let at = x.to_array().map(|c| number(c, 0.01 * depth, 9)).join(", ");
                let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
                format!("{two}{within}: at least {}{unit} deep at ({at})", number(depth, 0.0, 3))
            }
            Verdict::NotProven(Some(bound)) => {
                format!("{two}{within}: not proven; no point is deeper than {}", number(bound, 0.0, 3))
            }
            Verdict::NotProven(None) | Verdict::Separate(_) => format!("{two}{within}: not proven"),
        };
        out.push_str(&sentence("  ", &what));
    }
    out
}

fn as_json(found: &Found) -> String {
    let pair = |p: &Pair| -> Value {
        let (status, point, depth) = match p.verdict {
            Verdict::Overlap(x, depth) => ("overlap", Some(x.to_array()), Some(depth)),
            Verdict::NotProven(bound) => ("not proven", None, bound),
            Verdict::Separate(depth) => ("separate", None, Some(depth)),
        };
        json!({ "within": p.within, "a": p.a, "b": p.b, "status": status, "point": point, "depth": depth })
    };
    let [overlaps, open] = found.counts();
    json!({
        "overlaps": overlaps, "not_proven": open, "separate": found.separate[0] + found.separate[1],
        "separate_by_boxes": found.separate[0], "pairs": found.pairs.iter().map(pair).collect::<Vec<_>>(),
    })
    .to_string()
        + "\n"
}
