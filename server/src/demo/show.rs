//! The demo's acts for the page of `contactd view`: every step as the scene that `demo --scene-of` writes.

use super::scene::text;
use super::script::{PARTS, acts};
use crate::cache::{self, Cache};
use crate::import::{Facets, Limits, Scene, Source};
use crate::view::buffers::Shown;
use crate::view::show::{Act, Show};
use std::path::Path;
use std::sync::Arc;

/// The show of all acts; its models are kept in `cache`.
///
/// # Errors
/// One sentence.
pub fn show(cache: Option<&Cache>) -> Result<Show, String> {
    let model = |part: &super::script::DemoModel| {
        let file = format!("{}.csg", part.name);
        let source = Source::named(&file, part.text.as_bytes());
        let made = cache::prepare(cache, &source, Facets::Auto, &Limits::default()).map_err(|e| e.to_string())?;
        Ok(Shown { name: part.name.into(), file, model: made.model })
    };
    let models = PARTS.iter().map(model).collect::<Result<Vec<_>, String>>()?;
    let act = |act: super::script::Act| {
        let mut named: Vec<&str> = Vec::new();
        for body in &act.bodies {
            if !named.contains(&body.part.name) {
                named.push(body.part.name);
            }
        }
        let place = |name: &&str| PARTS.iter().position(|p| p.name == *name).unwrap_or(0);
        let (models, act) = (named.iter().map(place).collect(), Arc::new(act));
        let (title, steps) = (act.title.to_owned(), act.steps);
        let scene = move |i: usize| Scene::parse(act.title, &text(&act, i), Path::new("")).map_err(|e| e.to_string());
        Act { title, steps, models, scene: Box::new(scene) }
    };
    Show::new("contactd demo".into(), models, acts().into_iter().map(act).collect())
}
