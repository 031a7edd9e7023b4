//! What was imported and how, as text: kinds, bounds, mass, notes, tree.

mod effects;

pub use effects::effects;

use crate::import::{Note, Scene};
use crate::math::Aabb;
use crate::octree::Model;
use crate::octree::mass::mass_properties;
use crate::solid::{Node, NodeId, Op, Sense, Solid};
use crate::terminal::{Paint, clean, fold, number, sentence};
use contactd_proto::MassOptions;
use glam::DVec3;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The tree is cut off after this many lines; the counts above it are complete.
const TREE_LINES: usize = 400;

/// What a look at a model spends on its mass properties: a tenth of a second or so, a second at most whatever its boxes take.
const MASS: MassOptions = MassOptions { tolerance: 1e-4, boxes: 100_000 };

/// Significant digits of what is told of a model.
const DIGITS: i32 = 8;

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
    out += &bounds(&if solid.is_empty() { Aabb::EMPTY } else { solid.aabb() });
    out += &mass(model);
    for line in grouped(notes) {
        out += &sentence("  note: ", &line);
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
            (false, false) if o.motion.spin == DVec3::ZERO => "translating",
            _ => "turning",
        };
        let _ = writeln!(
            out,
            "  object {}: model {}, group {}, {how}",
            clean(&o.name),
            clean(&scene.models[o.model].name),
            o.group
        );
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
pub fn grouped(notes: &[Note]) -> Vec<String> {
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

/// A vector of numbers that are known to within `error`.
fn vector(v: DVec3, error: f64) -> String {
    format!("[{}]", v.to_array().map(|x| number(x, error, DIGITS)).join(", "))
}

fn bounds(b: &Aabb) -> String {
    if b.is_empty() {
        return "  bounds none: it is empty\n".into();
    }
    let size = b.max - b.min;
    // What is a billionth of its size is rounding.
    let fine = 1e-9 * size.max_element();
    let [lo, hi] = [b.min, b.max].map(|v| vector(v, fine));
    let size = size.to_array().map(|x| number(x, fine, DIGITS)).join(" x ");
    let pieces = [format!("bounds {lo} to {hi}"), format!("size {size}")];
    fold("  ", ", ", &pieces.map(|text| (None, text)), Paint::default())
}

/// Volume, centre and the inertia's diagonal of density 1, each with the bound of its error: digits beyond it are left out.
fn mass(model: &Model) -> String {
    let m = match mass_properties(model, &MASS) {
        Ok(m) => m,
        Err(e) => return sentence("  mass none: ", &e.to_string()),
    };
    let how = match m.boxes {
        0 => "closed form".into(),
        boxes if m.volume_error <= MASS.tolerance * (m.volume - m.volume_error) => format!("{boxes} boxes"),
        boxes => format!("{boxes} boxes: the limit of their work, short of ± {:.0e} of the volume", MASS.tolerance),
    };
    let (i, spread) = (m.inertia, m.inertia_error[..3].iter().copied().fold(0.0, f64::max));
    let volume = told(&[m.volume], m.volume_error);
    let (centre, inertia) = (told(&m.center.to_array(), m.center_error.max_element()), told(&i[..3], spread));
    let pieces = [
        format!("mass volume {} ± {}", volume.0, volume.1),
        format!("centre [{}] ± {}", centre.0, centre.1),
        format!("inertia [{}] ± {}", inertia.0, inertia.1),
        "at density 1".into(),
        how,
    ];
    fold("  ", ", ", &pieces.map(|text| (None, text)), Paint::default())
}

/// Numbers that are known to within `error` to the second digit of it, and how far off they are at most as they stand there: what
/// rounding adds counts, and the bound's own last digit is rounded up.
fn told(values: &[f64], error: f64) -> (String, String) {
    let quantum = if error > 0.0 { 10f64.powf(error.log10().floor() - 1.0) } else { 0.0 };
    let texts: Vec<String> = values.iter().map(|x| number(*x, quantum, 12)).collect();
    // What stands there is a number, but for one that is none: that is no nearer to anything.
    let off = |(text, x): (&String, &f64)| text.parse::<f64>().map_or(f64::INFINITY, |t| (t - x).abs());
    let bound = error + texts.iter().zip(values).map(off).fold(0.0, f64::max);
    let text = format!("{bound:.1e}");
    let up = match text.parse::<f64>() {
        Ok(t) if t < bound => format!("{:.1e}", bound + 0.05 * 10f64.powf(bound.log10().floor())),
        _ => text,
    };
    (texts.join(", "), up)
}

/// Sizes in words, their numbers without the last digits, which are rounding.
fn sizes(words: &str) -> String {
    let short = |word: &str| {
        let bare = word.trim_end_matches(',');
        match bare.parse::<f64>() {
            Ok(x) if bare.len() > DIGITS as usize + 2 => word.replace(bare, &number(x, 0.0, DIGITS)),
            _ => word.to_owned(),
        }
    };
    words.split(' ').map(short).collect::<Vec<_>>().join(" ")
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
                let words = [&p.label.name, geometry.kind(), &sizes(&geometry.dimensions())];
                let mut words: Vec<&str> = words.into_iter().filter(|w| !w.is_empty()).collect();
                words.dedup();
                writeln!(out, "{indent}{i} {} at {}:{}", words.join(" "), p.label.line, p.label.column)
            }
        };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn what_is_told_holds_all_that_is_proven() {
        // Half of a box of 312,140 is all that is known; and a plate whose volume is 19979.5991, as OpenSCAD tells it.
        for (x, error, text, bound) in [
            (156_070.0, 156_070.0, "160000", "1.6e5"),
            (19_978.45, 1.199, "19978.5", "1.3e0"),
            (13.401_923_788, 1.5e-11, "13.401923788", "1.5e-11"),
            (8.0, 0.0, "8", "0.0e0"),
            (1e-9, 2e-3, "0", "2.1e-3"),
        ] {
            assert_eq!(told(&[x], error), (text.into(), bound.into()), "{x} {error}");
        }
        let mut r = Random(11);
        for _ in 0..20_000 {
            let x = (r.unit() - 0.5) * 10f64.powf(12.0 * r.unit() - 6.0);
            let error = x.abs() * 10f64.powf(12.0 * r.unit() - 11.0);
            let (text, bound) = told(&[x], error);
            let (middle, within): (f64, f64) = (text.parse().expect("a number"), bound.parse().expect("a number"));
            // But for the rounding of these sums.
            let spare = 1e-14 * (x.abs() + within);
            assert!(
                middle - within <= x - error + spare && x + error <= middle + within + spare,
                "{text} ± {bound} of {x} ± {error}"
            );
        }
    }
}
