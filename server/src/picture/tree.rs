//! A solid's CSG tree with its S-bounds, drawn.
//!
//! Above: the solid in an exact view, the boxes of its nodes drawn in. Below: one row per node, children under their
//! parents. Beside each row three bars show the extents along x, y, z within the model's box: pale what the primitive or
//! the operation gives by itself (the upward rule alone), dark the S-bound after both rules. Pruned nodes, which
//! contribute nothing, have no dark bar and say so.

use super::drawing::{Anchor, Color, Drawing, GREY, INK, Size, text_width};
use super::ray::Traced;
use super::view::{Camera, Thing, View};
use crate::bound::{Bound, SBounds, Volumes};
use crate::math::Aabb;
use crate::solid::{Node, NodeId, Op, Sense, Solid};
use contactd_proto::Pose;
use glam::DVec3;

/// Positive volume.
pub const POSITIVE: Color = Color::hex(0x1f6fb2);
/// Subtracted volume.
pub const NEGATIVE: Color = Color::hex(0xc8452f);
/// Operations.
const OPERATION: Color = Color::hex(0x52606d);

/// Rows beyond this are left out, and counted in a last line.
const MAX_ROWS: usize = 160;
const ROW: f64 = 18.0;
const BAR: f64 = 130.0;

struct Row {
    node: NodeId,
    depth: usize,
    sense: Sense,
    /// Last child of its parent, for each level from the root.
    last: Vec<bool>,
}

/// The picture of `solid` and its bounds, titled `name`.
pub fn tree(name: &str, solid: &Solid, bounds: &SBounds) -> Drawing {
    let mut rows = Vec::new();
    collect(solid, solid.root, 0, Sense::Positive, vec![], &mut rows);
    let plain = upward_only(solid, bounds.margin());
    let hidden = rows.len().saturating_sub(MAX_ROWS);
    rows.truncate(MAX_ROWS);
    let text = |r: &Row| label(solid, r.node);
    let indent = |r: &Row| 40.0 + 16.0 * r.depth as f64;
    let widest = rows.iter().map(|r| indent(r) + text_width(&text(r), Size::Small)).fold(300.0, f64::max);
    let bars = widest + 80.0;
    let width = (bars + 3.0 * (BAR + 16.0) + 150.0).max(1352.0);
    let (view_height, head) = (520.0, 56.0);
    let top = head + view_height + 60.0;
    let height = top + ROW * (rows.len() as f64 + 1.0) + if hidden > 0 { 60.0 } else { 40.0 };
    let mut d = Drawing::new(width as usize, height as usize);
    let pruned = solid.primitives.len() - bounds.primitives_left(solid);
    let title = format!("{name}: {} primitives, {} nodes", solid.primitives.len(), solid.nodes.len());
    d.bold([24.0, 30.0], &title, Size::Large, Anchor::Left, INK);
    let settled = format!("stable after {} rounds, {pruned} primitives pruned", bounds.rounds());
    d.text([width - 24.0, 30.0], &settled, Size::Small, Anchor::Right, GREY);
    if !solid.is_empty() && bounds.root().is_finite() && !bounds.root().is_empty() {
        view_with_boxes(&mut d, solid, bounds, &rows, [0.0, head], (width as usize, view_height as usize));
    }
    legend(&mut d, top - 34.0, bars);
    let frame = plain[solid.root as usize].aabb;
    for (i, row) in rows.iter().enumerate() {
        let y = top + ROW * (i as f64 + 0.5);
        draw_row(&mut d, solid, row, y, indent(row));
        let (before, after) = (&plain[row.node as usize], bounds.node(row.node));
        let color = if row.sense == Sense::Positive { POSITIVE } else { NEGATIVE };
        for k in 0..3 {
            bar(&mut d, [bars + k as f64 * (BAR + 16.0), y], &frame, k, before, after, color);
        }
        let share = share_text(before, after);
        let quiet = if after.is_empty() { NEGATIVE } else { GREY };
        d.text([width - 24.0, y], &share, Size::Small, Anchor::Right, quiet);
    }
    if hidden > 0 {
        let y = top + ROW * (rows.len() as f64 + 0.8);
        d.text([40.0, y], &format!("... and {hidden} more nodes"), Size::Small, Anchor::Left, GREY);
    }
    d
}

fn collect(solid: &Solid, node: NodeId, depth: usize, sense: Sense, last: Vec<bool>, rows: &mut Vec<Row>) {
    rows.push(Row { node, depth, sense, last: last.clone() });
    if let Node::Op(op, children) = &solid.nodes[node as usize] {
        for (i, c) in children.iter().enumerate() {
            let sense = if *op == Op::Difference && i > 0 { sense.flipped() } else { sense };
            let mut last = last.clone();
            last.push(i + 1 == children.len());
            collect(solid, *c, depth + 1, sense, last, rows);
        }
    }
}

/// What the upward rule alone gives.
fn upward_only(solid: &Solid, margin: f64) -> Vec<Bound> {
    let mut bounds: Vec<Bound> = Vec::with_capacity(solid.nodes.len());
    for node in &solid.nodes {
        bounds.push(match node {
            Node::Empty => Bound::EMPTY,
            Node::Primitive(p) => Bound::of_primitive(&solid.primitives[*p as usize], margin, Volumes::Both),
            Node::Op(op, children) => Bound::upward(*op, children.iter().map(|c| bounds[*c as usize]), Volumes::Both),
        });
    }
    bounds
}

fn label(solid: &Solid, node: NodeId) -> String {
    match &solid.nodes[node as usize] {
        Node::Empty => "empty".into(),
        Node::Primitive(p) => {
            let primitive = &solid.primitives[*p as usize];
            let name = if primitive.label.name.is_empty() { "primitive" } else { &primitive.label.name };
            let line =
                if primitive.label.line > 0 { format!("  line {}", primitive.label.line) } else { String::new() };
            format!("{p} {name}{line}")
        }
        Node::Op(op, children) => {
            let word = match op {
                Op::Union => "union",
                Op::Intersection => "intersection",
                Op::Difference => "difference",
            };
            format!("{word} of {}", children.len())
        }
    }
}

fn draw_row(d: &mut Drawing, solid: &Solid, row: &Row, y: f64, x: f64) {
    let rule = GREY.alpha(0.45);
    for (level, last) in row.last.iter().enumerate() {
        let at = 40.0 + 16.0 * level as f64;
        let own = level + 1 == row.last.len();
        if own || !last {
            let bottom = if own && *last { y } else { y + 0.5 * ROW };
            d.line([at, y - 0.5 * ROW], [at, bottom], rule, 1.0);
        }
        if own {
            d.line([at, y], [at + 10.0, y], rule, 1.0);
        }
    }
    let color = match (&solid.nodes[row.node as usize], row.sense) {
        (Node::Op(..) | Node::Empty, _) => OPERATION,
        (_, Sense::Positive) => POSITIVE,
        (_, Sense::Negative) => NEGATIVE,
    };
    let text = label(solid, row.node);
    if matches!(solid.nodes[row.node as usize], Node::Op(..)) {
        d.bold([x, y], &text, Size::Small, Anchor::Left, color);
    } else {
        d.text([x, y], &text, Size::Small, Anchor::Left, color);
    }
}

/// Extents along axis `k`, before (pale) and after (dark), within those of the model.
fn bar(d: &mut Drawing, at: [f64; 2], frame: &Aabb, k: usize, before: &Bound, after: &Bound, color: Color) {
    let [x, y] = at;
    d.line([x, y], [x + BAR, y], GREY.alpha(0.25), 1.0);
    let span = (frame.max[k] - frame.min[k]).max(f64::MIN_POSITIVE);
    let place = |v: f64| x + BAR * ((v - frame.min[k]) / span).clamp(-0.04, 1.04);
    let mut draw = |b: &Bound, height: f64, color: Color| {
        if !b.is_empty() {
            let (from, to) = (place(b.aabb.min[k]), place(b.aabb.max[k]));
            d.rectangle([from, y - 0.5 * height], [(to - from).max(1.5), height], Some(color), None);
        }
    };
    draw(before, 10.0, color.alpha(0.22));
    draw(after, 5.0, color);
}

/// Volume of the S-bound's box against the plain one.
fn share_text(before: &Bound, after: &Bound) -> String {
    if after.is_empty() {
        return "pruned".into();
    }
    let volume = |b: &Bound| {
        let h = b.aabb.half();
        h.x * h.y * h.z
    };
    let share = 100.0 * volume(after) / volume(before);
    if share.is_finite() { format!("{share:.0}%") } else { String::new() }
}

fn legend(d: &mut Drawing, y: f64, bars: f64) {
    let mut x = 40.0;
    for (color, text) in [(POSITIVE, "adds volume"), (NEGATIVE, "takes volume away")] {
        d.rectangle([x, y - 6.0], [12.0, 12.0], Some(color), None);
        d.text([x + 20.0, y], text, Size::Small, Anchor::Left, INK);
        x += 40.0 + text_width(text, Size::Small);
    }
    for (k, axis) in ["x", "y", "z"].iter().enumerate() {
        let x = bars + k as f64 * (BAR + 16.0);
        let text = format!("extent in {axis}");
        d.text([x + 0.5 * BAR, y], &text, Size::Small, Anchor::Middle, GREY);
    }
    d.text([d.width as f64 - 24.0, y], "box left", Size::Small, Anchor::Right, GREY);
}

fn view_with_boxes(d: &mut Drawing, solid: &Solid, bounds: &SBounds, rows: &[Row], at: [f64; 2], size: (usize, usize)) {
    let traced = Traced::new(solid);
    let camera = Camera::framing(&[bounds.root().aabb], DVec3::new(0.55, -1.0, 0.7), size);
    let thing = Thing { traced: &traced, pose: Pose::IDENTITY, color: [0.55, 0.58, 0.62], cut: None };
    let view = View { things: vec![thing], camera, ground: None, samples: 3 };
    d.image(at, size.0, view.render());
    for row in rows.iter().rev() {
        let bound = bounds.node(row.node);
        if bound.is_empty() || !bound.is_finite() {
            continue;
        }
        let leaf = matches!(solid.nodes[row.node as usize], Node::Primitive(_));
        let color = if row.sense == Sense::Positive { POSITIVE } else { NEGATIVE };
        let (color, width) = match (row.depth, leaf) {
            (0, _) => (INK, 2.0),
            (_, true) => (color.alpha(0.6), 1.0),
            _ => (OPERATION.alpha(0.5), 1.2),
        };
        let c = bound.aabb.corners().map(|p| {
            let p = view.camera.pixel(p);
            [p.x + at[0], p.y + at[1]]
        });
        for i in 0..8usize {
            for bit in [1, 2, 4] {
                if i & bit == 0 {
                    d.line(c[i], c[i | bit], color, width);
                }
            }
        }
    }
}
