//! Slices of an extended CSG octree, cells coloured by leaf kind over the exact section of the solid.
//!
//! The section comes from exact rays, the cells from the octree, refined on demand where grey or mixed cells are still
//! large in the picture: the same refinement that a search asks for near a contact.

use super::drawing::{Anchor, Color, Drawing, GREY, INK, Size, text_width};
use super::ray::{Ray, Traced};
use crate::octree::{Model, Node, NodeKind};
use glam::DVec3;

/// Side of a panel, pixels.
const PANEL: usize = 640;
/// Cells are refined down to this size, pixels.
const FINEST: f64 = 4.0;

/// What is drawn for each kind of leaf, in the order of the legend.
const KINDS: [(NodeKind, &str, Color); 5] = [
    (NodeKind::Full, "full: inside", Color::hex(0x3e4c59)),
    (NodeKind::Empty, "empty: outside", Color::hex(0xf5f7fa)),
    (NodeKind::PSurface, "p: one added surface", Color::hex(0x2f80c3)),
    (NodeKind::NSurface, "n: one subtracted surface", Color::hex(0xe0632f)),
    (NodeKind::Mixed, "mixed: several", Color::hex(0x8c4fb0)),
];

/// Two slices through the middle of `model`: one upright (y constant), one level, low enough to cut
/// what is sunk into the upper side of most parts (z constant).
pub fn slice(name: &str, model: &Model) -> Drawing {
    let root = model.octree.root();
    let (head, foot, gap) = (56.0, 96.0, 24.0);
    let width = 3 * gap as usize + 2 * PANEL;
    let mut d = Drawing::new(width, (head + PANEL as f64 + foot) as usize);
    let census = model.octree.census();
    let title = format!("{name}: octree of {} levels, {} nodes", model.octree.depth(), census.nodes());
    d.bold([gap, 30.0], &title, Size::Large, Anchor::Left, INK);
    if root.half.is_finite() && root.half > 0.0 {
        for (i, (axis, at)) in [(1, 0.503), (2, 0.27)].into_iter().enumerate() {
            let left = gap + i as f64 * (PANEL as f64 + gap);
            panel(&mut d, model, [left, head], axis, at);
        }
    }
    let mut x = gap;
    for (kind, text, color) in KINDS {
        let y = head + PANEL as f64 + 62.0;
        d.rectangle([x, y - 8.0], [16.0, 16.0], Some(color.alpha(ALPHA)), Some((GREY, 1.0)));
        let text = format!("{text}, {}", census.of(kind));
        d.text([x + 24.0, y], &text, Size::Small, Anchor::Left, INK);
        x += text_width(&text, Size::Small) + 52.0;
    }
    d
}

const ALPHA: f64 = 0.72;

fn panel(d: &mut Drawing, model: &Model, at: [f64; 2], axis: usize, fraction: f64) {
    let root = model.octree.root();
    // Through the solid's own box, a little off the middle where the middle is a seam of cells.
    let b = model.bounds.root().aabb;
    let level = b.min[axis] + fraction * (b.max[axis] - b.min[axis]);
    let (u, v) = if axis == 1 { (0, 2) } else { (0, 1) };
    let low = root.center - DVec3::splat(root.half);
    let scale = PANEL as f64 / (2.0 * root.half);
    d.image(at, PANEL, section(model, [u, v, axis], level, scale));
    let mut cells = Vec::new();
    collect(model, root, axis, level, scale, &mut cells);
    for node in cells {
        let side = 2.0 * node.half * scale;
        let x = at[0] + (node.center[u] - node.half - low[u]) * scale;
        let y = at[1] + PANEL as f64 - (node.center[v] - node.half - low[v]) * scale - side;
        let color = KINDS.iter().find(|(k, ..)| *k == node.kind()).map_or(GREY, |(_, _, c)| *c);
        d.rectangle([x, y], [side, side], Some(color.alpha(ALPHA)), Some((INK.alpha(0.35), 0.6)));
    }
    let name = ["x", "y", "z"];
    let text = format!("{} over {} at {} = {level:.3}", name[v], name[u], name[axis]);
    d.text([at[0], at[1] + PANEL as f64 + 22.0], &text, Size::Small, Anchor::Left, GREY);
}

/// The leaves that the plane cuts, refined to the picture's resolution.
fn collect<'a>(model: &'a Model, node: &'a Node, axis: usize, level: f64, scale: f64, cells: &mut Vec<&'a Node>) {
    // Half open, so that a plane on a seam cuts one side only.
    if level < node.center[axis] - node.half || level >= node.center[axis] + node.half {
        return;
    }
    let finer = node.half * scale >= FINEST;
    match (node.kind(), finer) {
        (NodeKind::Grey | NodeKind::Mixed, true) => match model.expand(node) {
            Some(children) => children.iter().for_each(|c| collect(model, c, axis, level, scale, cells)),
            None => cells.push(node),
        },
        _ => match node.children() {
            Some(children) if node.kind() == NodeKind::Grey => {
                children.iter().for_each(|c| collect(model, c, axis, level, scale, cells));
            }
            _ => cells.push(node),
        },
    }
}

/// The exact section: ink at its outline, a tint inside.
fn section(model: &Model, [u, v, axis]: [usize; 3], level: f64, scale: f64) -> Vec<[u8; 3]> {
    let root = model.octree.root();
    let traced = Traced::new(&model.solid);
    let low = root.center - DVec3::splat(root.half);
    let mut inside = vec![false; PANEL * PANEL];
    for row in 0..PANEL {
        let mut origin = DVec3::ZERO;
        origin[axis] = level;
        origin[v] = low[v] + (PANEL as f64 - row as f64 - 0.5) / scale;
        origin[u] = low[u] - root.half;
        let mut direction = DVec3::ZERO;
        direction[u] = 1.0;
        for (enter, leave) in traced.spans(&Ray { origin, direction }) {
            let column = |at: f64| ((at - root.half) * scale).round().clamp(0.0, PANEL as f64) as usize;
            inside[row * PANEL + column(enter.at)..row * PANEL + column(leave.at)].fill(true);
        }
    }
    (0..PANEL * PANEL)
        .map(|k| {
            let (x, y) = (k % PANEL, k / PANEL);
            let other = |dx: usize, dy: usize| {
                let (x, y) = ((x + dx).min(PANEL - 1), (y + dy).min(PANEL - 1));
                inside[y * PANEL + x] != inside[k]
            };
            match () {
                () if other(1, 0) || other(0, 1) || other(1, 1) => [10, 14, 20],
                () if inside[k] => [150, 158, 168],
                () => [255; 3],
            }
        })
        .collect()
}
