//! What was imported and how, as text: kinds, bounds, mass, notes, tree.

mod effects;

pub use effects::effects;

use crate::import::{Note, Scene};
use crate::math::Aabb;
use crate::octree::Model;
use crate::octree::mass::mass_properties;
use crate::solid::{Node, NodeId, Op, Sense, Solid};
use contactd_proto::MassOptions;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The tree is cut off after this many lines; the counts above it are complete.
const TREE_LINES: usize = 400;

/// What a look at a model spends on its mass properties: a tenth of a second or so, a second at most whatever its boxes take.
const MASS: MassOptions = MassOptions { tolerance: 1e-4, boxes: 100_000 };

/// All about one model and what its import had to say; `file` is its heading.
pub fn model(file: &str, model: &Model, notes: &[Note]) -> String {
    let solid = &model.solid;
    let mut out = String::new();
    let mut kinds: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for (p, sense) in solid.primitives.iter().zip(&solid.senses) {
        let count = kinds.entry(p.shape.geometry().kind()).or_default();
        match sense {
            Sense::Positive => count.0 += 1,
            Sense::Negative => count.1 += 1,
        }
    }
    let _ = writeln!(out, "{file}");
    let _ = writeln!(
        out,
        "  {} primitives, {} faces, {} nodes, {} levels",
        solid.primitives.len(),
        solid.faces.len(),
        solid.nodes.len(),
        levels(solid)
    );
    for (kind, (positive, negative)) in kinds {
        let _ = writeln!(out, "    {:>6} {kind} ({negative} subtracted)", positive + negative);
    }
    let _ = writeln!(out, "  bounds {}", bounds(&solid.aabb()));
    let _ = writeln!(out, "  mass {}", mass(model));
    for line in grouped(notes) {
        let _ = writeln!(out, "  note: {line}");
    }
    out.push_str(&tree(solid));
    out
}

/// A scene's objects and rules; its models follow one by one.
pub fn scene(scene: &Scene) -> String {
    let mut out = String::new();
    let unit = if scene.unit.is_empty() { "no unit" } else { &scene.unit };
    let resolution = scene.resolution.map_or_else(|| "default".into(), |r| format!("{r:e}"));
    let _ = writeln!(out, "{}\n  unit {unit}, resolution {resolution}", scene.file);
    for o in &scene.objects {
        let how = match (o.is_static, o.motion.is_rest()) {
            (true, _) => "static",
            (false, true) => "at rest",
            (false, false) if o.motion.spin == glam::DVec3::ZERO => "translating",
            _ => "turning",
        };
        let _ = writeln!(out, "  object {}: model {}, group {}, {how}", o.name, scene.models[o.model].name, o.group);
    }
    for r in &scene.rules {
        let _ = writeln!(out, "  rule {} - {}: {}", r.between[0], r.between[1], r.effects());
        for group in &r.between {
            if !scene.objects.iter().any(|o| o.group == *group) {
                let _ = writeln!(out, "    warning: no object is of group {group}");
            }
        }
    }
    out
}

/// Equal notes as one line with their number, the first place and the largest amount.
fn grouped(notes: &[Note]) -> Vec<String> {
    let mut order: Vec<&Note> = Vec::new();
    let mut groups: BTreeMap<&str, (usize, Option<f64>)> = BTreeMap::new();
    for n in notes {
        let (count, amount) = groups.entry(&n.text).or_insert_with(|| {
            order.push(n);
            (0, None)
        });
        *count += 1;
        *amount = n.amount.map_or(*amount, |a| Some(amount.map_or(a, |b: f64| b.max(a))));
    }
    let line = |n: &&Note| {
        let (count, amount) = groups[n.text.as_str()];
        let times = if count > 1 { format!(" ({count} times, first here)") } else { String::new() };
        format!("{}{times}", Note { amount, ..(*n).clone() })
    };
    order.iter().map(line).collect()
}

fn bounds(b: &Aabb) -> String {
    if b.is_empty() {
        return "none: it is empty".into();
    }
    let (lo, hi, size) = (b.min, b.max, b.max - b.min);
    format!(
        "[{:.6}, {:.6}, {:.6}] to [{:.6}, {:.6}, {:.6}], size {:.6} x {:.6} x {:.6}",
        lo.x, lo.y, lo.z, hi.x, hi.y, hi.z, size.x, size.y, size.z
    )
}

/// Volume, centre and the inertia's diagonal of density 1, each with the bound of its error.
fn mass(model: &Model) -> String {
    let m = match mass_properties(model, &MASS) {
        Ok(m) => m,
        Err(e) => return format!("none: {e}"),
    };
    let how = match m.boxes {
        0 => "closed form".into(),
        boxes if m.volume_error <= MASS.tolerance * (m.volume - m.volume_error) => format!("{boxes} boxes"),
        boxes => format!("{boxes} boxes: the limit of their work, short of ± {:.0e} of the volume", MASS.tolerance),
    };
    let (c, i) = (m.center, m.inertia);
    format!(
        "volume {:.6} ± {:.1e}, centre [{:.6}, {:.6}, {:.6}] ± {:.1e}, inertia [{:.6}, {:.6}, {:.6}] ± {:.1e} at density 1, {how}",
        m.volume,
        m.volume_error,
        c.x,
        c.y,
        c.z,
        m.center_error.max_element(),
        i[0],
        i[1],
        i[2],
        m.inertia_error[..3].iter().copied().fold(0.0, f64::max)
    )
}

fn levels(solid: &Solid) -> usize {
    // Children come before their parents.
    let mut height = vec![1usize; solid.nodes.len()];
    for (i, node) in solid.nodes.iter().enumerate() {
        if let Node::Op(_, children) = node {
            height[i] = 1 + children.iter().map(|c| height[*c as usize]).max().unwrap_or(0);
        }
    }
    height[solid.root as usize]
}

/// The tree, one node a line, indented by its depth.
fn tree(solid: &Solid) -> String {
    let mut out = String::from("  tree\n");
    let mut stack: Vec<(NodeId, usize)> = vec![(solid.root, 2)];
    let mut lines = 0;
    while let Some((id, depth)) = stack.pop() {
        if lines == TREE_LINES {
            let _ = writeln!(out, "    … and more");
            break;
        }
        lines += 1;
        let indent = "  ".repeat(depth.min(40));
        let _ = match &solid.nodes[id as usize] {
            Node::Empty => writeln!(out, "{indent}nothing"),
            Node::Op(op, children) => {
                stack.extend(children.iter().rev().map(|c| (*c, depth + 1)));
                let name = match op {
                    Op::Union => "union",
                    Op::Intersection => "intersection",
                    Op::Difference => "difference",
                };
                writeln!(out, "{indent}{name}")
            }
            Node::Primitive(i) => {
                let p = &solid.primitives[*i as usize];
                let geometry = p.shape.geometry();
                let words = [&p.label.name, geometry.kind(), &geometry.dimensions()];
                let mut words: Vec<&str> = words.into_iter().filter(|w| !w.is_empty()).collect();
                words.dedup();
                writeln!(out, "{indent}{i} {} at {}:{}", words.join(" "), p.label.line, p.label.column)
            }
        };
    }
    out
}
