//! A scene as a strip: its moments side by side, each with its time.

use super::Run;
use super::scenes::Scene;
use contactd::import::{Facets, Limits, import_csg};
use contactd::math::Aabb;
use contactd::picture::drawing::{Anchor, Drawing, GREY, INK, Size};
use contactd::picture::ray::Traced;
use contactd::picture::scene::COLORS;
use contactd::picture::view::{Camera, Thing, View};
use glam::DVec3;
use std::path::{Path, PathBuf};

/// Space between two of them.
const GAP: usize = 12;
/// Space above for the title, below for the times.
const HEAD: usize = 52;
const FOOT: usize = 40;

/// Writes the strip as SVG and PNG; their paths.
pub fn write(scene: &Scene, run: &Run, folder: &Path) -> Result<Vec<PathBuf>, Box<dyn std::error::Error>> {
    let mut solids = Vec::new();
    for text in &scene.texts {
        solids.push(import_csg(scene.name, text, Facets::Auto, &Limits::default()).map_err(|e| e.to_string())?.solid);
    }
    let traced: Vec<Traced> = solids.iter().map(Traced::new).collect();
    let (n, panel) = (run.moments.len(), scene.panel);
    let mut d = Drawing::new(n * (panel.0 + GAP) + GAP, HEAD + panel.1 + FOOT);
    d.bold([GAP as f64 + 4.0, 28.0], scene.about, Size::Normal, Anchor::Left, INK);
    let camera = Camera::framing(&[Aabb { min: scene.window[0], max: scene.window[1] }], scene.from, panel);
    for (k, (time, poses)) in run.moments.iter().enumerate() {
        let things = scene.actors.iter().zip(poses).filter(|(a, _)| a.drawn).map(|(a, pose)| Thing {
            traced: &traced[a.text],
            pose: pose.compose(&a.place),
            color: COLORS[a.text % COLORS.len()],
            cut: a.cut.map(|y| vec![(DVec3::NEG_Y, -y)]),
        });
        let view = View { things: things.collect(), camera, ground: None, samples: 3 };
        let left = (GAP + k * (panel.0 + GAP)) as f64;
        d.image([left, HEAD as f64], panel.0, view.render());
        d.rectangle([left, HEAD as f64], [panel.0 as f64, panel.1 as f64], None, Some((GREY, 1.0)));
        let middle = left + 0.5 * panel.0 as f64;
        let y = (HEAD + panel.1) as f64 + 20.0;
        d.text([middle, y], &format!("t = {time:.3} s"), Size::Normal, Anchor::Middle, INK);
    }
    let mut paths = Vec::new();
    for ending in ["svg", "png"] {
        let path = folder.join(format!("{}.{ending}", scene.name));
        std::fs::write(&path, d.encode_for(&path)?)?;
        paths.push(path);
    }
    Ok(paths)
}
