//! The content of a kept model's file, behind its checksum: any bytes are a model that can be asked and that is written and
//! read again as the same bytes, or are refused.

use super::Target;
use contactd::cache::{Flaw, decode, encode};
use contactd::import::{self, Facets, import_csg};
use contactd::octree::{Limits, Model, Node};
use glam::DVec3;

pub(super) const TARGET: Target = Target { name: "cache", run, seeds, words: &[], longest: 4000, thorough_every: 64 };

fn seeds() -> Vec<Vec<u8>> {
    [
        "sphere(r = 1);",
        "difference() { cube(size = [4, 4, 1], center = true); sphere(r = 1); cylinder($fn = 6, h = 9, r1 = 0.3, r2 = 0.2); }",
        "intersection() { sphere(r = 2); cube(size = [inf, inf, 1], center = true); }",
        "group();",
    ]
    .map(|text| {
        let import = import_csg("m.csg", text, Facets::Auto, &import::Limits::default()).expect("a valid text");
        // Few levels: short inputs are tried more often.
        encode(&Model::with_limits(import.solid, Limits::to_depth(1)), &import.notes).expect("a shallow tree")
    })
    .into()
}

fn run(bytes: &[u8], _: bool) -> Result<String, String> {
    let (model, notes) = match decode(bytes) {
        Ok(kept) => kept,
        Err(Flaw::Content(expected)) => return Ok(format!("refused {expected}")),
        Err(other) => return Err(format!("refused as {other}")),
    };
    let again = encode(&model, &notes).ok_or("a model that is not written")?;
    let (back, back_notes) = decode(&again).map_err(|e| format!("a model that does not come back: {e}"))?;
    if encode(&back, &back_notes).as_ref() != Some(&again) {
        return Err("another model came back".into());
    }
    asked(&model, model.octree.root());
    for x in [DVec3::ZERO, DVec3::new(0.1, 0.2, 0.3)] {
        model.solid.value(x);
        model.octree.locate(x);
    }
    let kinds: Vec<usize> = contactd::octree::NodeKind::ALL.map(|k| model.octree.census().of(k).min(2)).into();
    Ok(format!("read {} {kinds:?} {}", model.solid.primitives.len().min(4), notes.len().min(2)))
}

/// Follows all that a node points to.
fn asked(model: &Model, node: &Node) {
    model.literals(node, 0.0, &mut vec![]);
    for p in node.refs() {
        let _ = model.solid.primitives[*p as usize].value(DVec3::ONE);
    }
    node.children().into_iter().flatten().for_each(|c| asked(model, c));
}
