//! Pairs of trees of a given number of primitives, with what makes parts dear: holes, fits and thin walls.

use super::Scene;
use super::aim::{ALL, Aim, aimed, tree};
use super::draw::Draw;
use super::make::fit;
use super::tree::{Node, Shape, placed};
use glam::{DMat3, DVec3};

/// Number of the stream from which these are drawn, behind those of the families.
const STREAM: u64 = 100;

/// The pair with this index of two trees of `primitives` each, at least 5: four in ten as they are drawn, three drilled, one and a
/// half hollow with thin walls, one and a half a fit with trees at both bodies.
pub fn of_size(seed: u64, primitives: usize, index: u64) -> Scene {
    assert!(primitives >= 5, "trees of {primitives} primitives have no room for a hole, a wall and a fit");
    let mut draw = Draw::new(seed, STREAM + primitives as u64, index);
    let d = &mut draw;
    let kind = d.unit();
    if kind < 0.85 {
        let body = |d: &mut Draw| {
            if kind < 0.4 {
                tree(d, primitives, ALL)
            } else if kind < 0.7 {
                drilled(d, primitives)
            } else {
                hollow(d, primitives)
            }
        };
        let (a, b) = (body(d), body(d));
        return aimed(d, a, b, Aim::default());
    }
    let screw = d.chance(0.3);
    let scene = fit(d, screw);
    let [a, b] = [scene.a, scene.b].map(|node| beside(d, node, primitives));
    Scene { a, b, ..scene }
}

/// A tree with holes drilled through it, a third of its primitives.
fn drilled(d: &mut Draw, primitives: usize) -> Node {
    let holes = (primitives / 3).max(1);
    let mut node = tree(d, primitives - holes, ALL);
    let (center, radius) = node.ball();
    for _ in 0..holes {
        let r = radius * d.power(-1.5, -0.6);
        let hole = Node::Leaf(Shape::Round { h: 3.0 * radius, bottom: r, top: r });
        let turn = DMat3::from_quat(d.rotation());
        node = node.less(hole.moved(placed(turn, center + d.in_ball() * 0.7 * radius)));
    }
    node
}

/// A tree less itself, shrunk by a part of 1e-3 to 1e-1 about the middle of its ball, and opened by one more primitive.
fn hollow(d: &mut Draw, primitives: usize) -> Node {
    let outer = tree(d, (primitives - 1) / 2, ALL);
    let (center, radius) = outer.ball();
    let inner = outer.clone().at(-center).scaled(1.0 - d.power(-3.0, -1.0)).at(center);
    let mouth = tree(d, 1, ALL).scaled(0.5 * radius).at(center + d.direction() * radius);
    outer.less(inner).less(mouth)
}

/// A part of a fit, of two primitives or so, with a tree at its side.
fn beside(d: &mut Draw, node: Node, primitives: usize) -> Node {
    let (center, radius) = node.ball();
    let other = tree(d, primitives - 2, ALL);
    let (middle, size) = other.ball();
    let scale = radius / size * d.within(0.3, 1.0);
    let angle = d.within(0.0, std::f64::consts::TAU);
    let side = DVec3::new(angle.cos(), angle.sin(), d.within(-0.3, 0.3));
    node.or(other.at(-middle).scaled(scale).at(center + side * radius * d.within(0.8, 1.2)))
}
