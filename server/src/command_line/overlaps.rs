//! `contactd overlaps`: what is in each other of a GDML or OpenMC geometry or a scene.

use super::joints::{JointArguments, without_touching};
use super::{
    AccessArguments, CacheArguments, Done, models_of, prepare_parts, prepare_scene, print, scene_of, tell_empty, warn,
};
use crate::cache::Prepared;
use crate::import::{Facets, Limits, Note, Scene, gdml, openmc, read_bytes};
use crate::octree::Model;
use crate::overlaps::{self, Beside, Faceted, Found, Pair, Verdict};
use crate::terminal::{clean, number, sentence};
use serde_json::{Value, json};
use std::collections::HashSet;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Lines about what a geometry has lost.
const MOST_LOSSES: usize = 10;
/// Lines about solids in facets.
const MOST_FACETED: usize = 10;

#[derive(clap::Args)]
pub(super) struct OverlapsArguments {
    /// A GDML geometry (.gdml), an OpenMC geometry (.xml), a scene (.toml), a robot; or models, which are taken as they stand.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// How deep two may be in each other, in the file's unit (millimetres of GDML, centimetres of OpenMC); else 2e-9 of the larger one's radius.
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
            (of_gdml(file, arguments)?, "mm".to_owned())
        }
        [file] if is_openmc(file) => {
            arguments.joints.none(file)?;
            (of_openmc(file, arguments)?, "cm".to_owned())
        }
        files => {
            if let Some(file) = files.iter().find(|f| is_gdml(f)) {
                return Err(format!("expected one GDML file alone, found {} among others", file.display()).into());
            }
            arguments.joints.no_step()?;
            let scene = scene_of(files, &arguments.access, &arguments.joints)?;
            let models = models_of(&prepare_scene(&scene, Facets::Auto, &arguments.cache)?);
            let scene = without_touching(scene, &models, &arguments.joints)?;
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

fn of_gdml(file: &Path, arguments: &OverlapsArguments) -> Result<Found, Box<dyn Error>> {
    let mut volumes = gdml::read_gdml(file)?;
    let tell = |n: &Note| warn(&format!("{}:{}", file.display(), clean(&n.to_string())));
    volumes.notes.iter().for_each(tell);
    let scene = overlaps::scene_of(file, &volumes);
    let prepared = prepare_parts(&scene, Facets::Auto, &arguments.cache)?;
    tell_empty(&scene, &prepared);
    volumes.deviate(prepared.iter().map(|p| p.notes.as_slice()));
    let faceted = of_solids(file, &scene, &prepared, tell);
    let models = overlaps::spread(&volumes, &models_of(&prepared));
    let (outside, of) = overlaps::around(file, &volumes, &models);
    // What is told of these has been told of the volumes.
    let outsides = models_of(&prepare_parts(&outside, Facets::Auto, &arguments.cache)?);
    let found = overlaps::of_volumes(&volumes, &models, (&outsides, &of), arguments.tolerance);
    Ok(Found { faceted, ..found })
}

/// Tells what the volumes of a GDML file have lost, of its solids by name; those in facets are handed on.
fn of_solids(file: &Path, scene: &Scene, prepared: &[Prepared], tell: impl Fn(&Note)) -> Vec<Faceted> {
    let all = || scene.models.iter().zip(prepared).flat_map(|(source, p)| p.notes.iter().map(|n| (&source.name, n)));
    let told = || all().filter(|(_, n)| n.is_loss() || n.facets().is_some());
    // The file is read again where there is something to tell.
    let origins = told().next().map(|_| gdml::Origins::read(file));
    let (mut faceted, mut lines) = (Vec::new(), HashSet::new());
    for (volume, note) in told() {
        let found = origins.as_ref().and_then(|o| o.told(volume, note));
        let (note, [kind, solid]) = found.unwrap_or_else(|| (note.clone(), ["solid", volume]));
        match note.facets() {
            Some((facets, deviation)) => {
                let (volume, kind, solid) = (volume.clone(), kind.to_owned(), solid.to_owned());
                let one = Faceted { volume, kind, solid, facets, deviation };
                if !faceted.contains(&one) {
                    faceted.push(one);
                }
            }
            None if lines.insert(note.to_string()) && lines.len() <= MOST_LOSSES => tell(&note),
            None => {}
        }
    }
    if lines.len() > MOST_LOSSES {
        warn(&format!("{}: {} more like these", file.display(), lines.len() - MOST_LOSSES));
    }
    faceted
}

/// Is it an OpenMC geometry? Robots' files (MJCF) end in the same way.
pub(super) fn is_openmc(file: &Path) -> bool {
    let is_xml = file.extension().is_some_and(|e| e.eq_ignore_ascii_case("xml"));
    is_xml && read_bytes(file, &Limits::default()).is_ok_and(|bytes| openmc::is_openmc(&bytes))
}

fn of_openmc(file: &Path, arguments: &OverlapsArguments) -> Result<Found, Box<dyn Error>> {
    let universes = openmc::read_openmc(file)?;
    universes.notes.iter().for_each(|n| warn(&format!("{}:{}", file.display(), clean(&n.to_string()))));
    let models = |scene: &Scene| -> Result<Vec<Arc<Model>>, Box<dyn Error>> {
        Ok(models_of(&prepare_parts(scene, Facets::Auto, &arguments.cache)?))
    };
    let whole = models(&overlaps::scene_of_cells(file, &universes))?;
    let (found, suspects) = overlaps::of_cells(&universes, &whole, arguments.tolerance);
    let cut = models(&overlaps::scene_of_uses(file, &universes, &suspects))?;
    Ok(overlaps::decide(&universes, (&whole, &cut), (found, suspects), arguments.tolerance))
}

fn text(found: &Found, unit: &str) -> String {
    let [overlaps, open] = found.counts();
    let [by_boxes, searched, by_surfaces] = found.separate;
    let surfaces = if by_surfaces > 0 { format!(", {by_surfaces} by their surfaces alone") } else { String::new() };
    let many = |n: usize, one: &str| format!("{n} {one}{}", if n == 1 { "" } else { "s" });
    let left_out = if found.left_out > 0 {
        format!(", {} left out by rules", many(found.left_out as usize, "pair"))
    } else {
        String::new()
    };
    let mut out = format!(
        "{}, {open} not proven, {} pairs proven separate ({by_boxes} by their boxes{surfaces}){left_out}\n",
        many(overlaps, "overlap"),
        by_boxes + searched + by_surfaces
    );
    for one in found.faceted.iter().take(MOST_FACETED) {
        let [kind, solid, volume] = [&one.kind, &one.solid, &one.volume].map(|name| clean(name));
        let what = format!(
            "the {kind} {solid} of {volume} is taken in {} facets, at most {} {unit} off: all here allows for that",
            one.facets,
            number(one.deviation, 0.0, 3)
        );
        out.push_str(&sentence("  ", &what));
    }
    if found.faceted.len() > MOST_FACETED {
        out.push_str(&sentence("  ", &format!("{} more are taken in facets", found.faceted.len() - MOST_FACETED)));
    }
    for pair in &found.pairs {
        let (a, mother) = (clean(&pair.a), clean(&pair.within));
        let two = match &pair.b {
            Beside::Other(b) => format!("{a} and {}", clean(b)),
            Beside::Around => format!("{a} sticks out of {mother}"),
            Beside::Nothing => format!("{a} has a gap, where no cell is"),
        };
        let is_told = !mother.is_empty() && matches!(pair.b, Beside::Other(_));
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
        let (other, kind) = match &p.b {
            Beside::Other(name) => (Some(name), "overlap"),
            Beside::Around => (None, "sticks out"),
            Beside::Nothing => (None, "gap"),
        };
        json!({ "kind": kind, "within": p.within, "a": p.a, "b": other, "status": status, "point": point, "depth": depth })
    };
    let faceted = |f: &Faceted| -> Value {
        json!({ "volume": f.volume, "kind": f.kind, "solid": f.solid, "facets": f.facets, "deviation": f.deviation })
    };
    let [overlaps, open] = found.counts();
    json!({
        "overlaps": overlaps, "not_proven": open, "separate": found.separate.iter().sum::<u64>(),
        "separate_by_boxes": found.separate[0], "separate_by_surfaces": found.separate[2],
        "left_out": found.left_out,
        "faceted": found.faceted.iter().map(faceted).collect::<Vec<_>>(),
        "pairs": found.pairs.iter().map(pair).collect::<Vec<_>>(),
    })
    .to_string()
        + "\n"
}
