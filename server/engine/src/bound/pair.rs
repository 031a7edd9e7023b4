//! Stage 1 for a pair: the collision region, by the rules of S-bounds on the tree A ∩ B over the motion of a step.
//!
//! The root of A ∩ B hands each of its two operands the bound of the other one, swept over the motion and seen in its own
//! model frame; below that the downward and the upward rule run as in a single tree, until the root settles. If it comes
//! out empty the two cannot meet; otherwise both trees are taken apart again and hold only what can take part.
//!
//! One descent does both rules: it hands a node the box that matters (downward), returns the box of what is left of it
//! (upward), and an intersection's or difference's operands see what is left of the others at once. Subtrees inside the
//! box need no rule and cost nothing. Nodes whose bound misses the box die.
//!
//! Invariant: at every point of `Pruned::aabb`, f with dead nodes at +infinity equals f clamped to ±margin; outside the
//! two boxes (each in its own frame) no time of the span brings max(f_A, f_B) to the margin or below.
//! Not promised: time within the span; a long span is best cut by the caller.

use super::{SBounds, Volumes};
use crate::math::{Aabb, Ball, Oriented, halt, tolerance::BOUND_PROGRESS};
use crate::motion::{Placed, Sweep};
use crate::solid::{Node, NodeId, Op, Solid};
use glam::DVec3;
use std::cell::OnceCell;

/// Cap on how often the two sides clip each other. Each round costs two sweeps; the third rarely gains 1%.
const MAX_ROUNDS: usize = 4;

/// One side of a pair: a model's tree, its bounds, and its motion.
#[derive(Clone, Copy, Debug)]
pub struct Side<'a> {
    /// The tree.
    pub solid: &'a Solid,
    /// Its S-bounds.
    pub bounds: &'a SBounds,
    /// Where the model stands and how it moves.
    pub placed: Placed,
}

/// What of a tree can take part in a collision.
#[derive(Clone, Debug)]
pub struct Pruned {
    /// Box of it, own model frame.
    pub aabb: Aabb,
    /// A bit per node of the tree.
    alive: Vec<u64>,
    /// A bit per primitive.
    alive_primitives: Vec<u64>,
    /// Number of primitives that are left.
    pub primitives: usize,
    /// Number of primitives of the whole tree.
    pub primitives_before: usize,
}

/// The collision region of a pair.
#[derive(Clone, Debug)]
pub struct CollisionRegion {
    /// What of A can take part.
    pub a: Pruned,
    /// What of B can take part.
    pub b: Pruned,
}

/// Locates the collision region of a pair over [t0, t1] of its step; `None` when they cannot come closer than `margin`
/// to a common point (max(f_A, f_B) > margin everywhere). `margin` (a length) may not exceed the margin of either
/// side's bounds, otherwise those are taken anew for it.
pub fn locate(a: &Side, b: &Side, t0: f64, t1: f64, margin: f64) -> Option<CollisionRegion> {
    let wide =
        |s: &Side| (margin > s.bounds.margin()).then(|| SBounds::with_volumes(s.solid, margin, s.bounds.volumes()));
    let (wide_a, wide_b) = (wide(a), wide(b));
    let bounds_a = wide_a.as_ref().unwrap_or(a.bounds);
    let bounds_b = wide_b.as_ref().unwrap_or(b.bounds);
    let sides = [(a.solid, bounds_a), (b.solid, bounds_b)];
    // Each mover as the other one sees it.
    let sweeps = [Sweep::new(b.placed, a.placed), Sweep::new(a.placed, b.placed)];
    let boxes = [bounds_a.root().aabb, bounds_b.root().aabb];
    // The ball as a whole and what is left of the box: both hold the mover, each is the better one at times.
    let balls: [OnceCell<Aabb>; 2] = Default::default();
    let clipped = |k: usize, own: &Aabb, other: &Aabb| {
        let whole = balls[k].get_or_init(|| sweeps[k].of_ball(&sides[1 - k].1.root().ball, t0, t1));
        own.intersection(&sweeps[k].of_box(other, t0, t1).intersection(whole))
    };
    let [box_a, box_b] = match (bounds_a.volumes(), bounds_b.volumes()) {
        (Volumes::Balls, Volumes::Balls) => {
            let clip = |k: usize, own: &Ball, other: &Ball| own.intersection(&sweeps[k].around_ball(other, t0, t1));
            settled(&sides, [bounds_a.root().ball, bounds_b.root().ball], clip)?.map(|ball| ball.aabb())
        }
        (Volumes::Oriented, Volumes::Oriented) if boxes.iter().all(Aabb::is_finite) => {
            let clip = |k: usize, own: &Tight, other: &Tight| Tight {
                aabb: clipped(k, &own.aabb, &other.aabb),
                partner: sweeps[k].along_mover(&other.aabb, t0, t1),
            };
            settled(&sides, boxes.map(|aabb| Tight { aabb, partner: Oriented::of_box(&aabb) }), clip)?.map(|t| t.aabb)
        }
        _ => settled(&sides, boxes, clipped)?,
    };
    Some(CollisionRegion { a: Pruned::within(a.solid, bounds_a, box_a)?, b: Pruned::within(b.solid, bounds_b, box_b)? })
}

/// What is left of both trees once each has clipped the other, in turn, until neither shrinks; `None` when nothing is.
fn settled<C: Clip>(
    sides: &[(&Solid, &SBounds); 2],
    mut left: [C; 2],
    clip: impl Fn(usize, &C, &C) -> C,
) -> Option<[C; 2]> {
    for _ in 0..MAX_ROUNDS {
        let was = left;
        for k in 0..2 {
            if left.iter().any(C::is_empty) {
                return None;
            }
            halt::work(4 * sides[k].0.nodes.len());
            left[k] = left_in(sides[k].0, sides[k].1, &clip(k, &left[k], &left[1 - k]));
        }
        if left.iter().any(C::is_empty) {
            return None;
        }
        if !(0..2).any(|k| shrank(&left[k].aabb(), &was[k].aabb())) {
            break;
        }
    }
    Some(left)
}

/// What a tree is clipped by: a box, a ball, or a box with what another box along other axes leaves of it.
trait Clip: Copy + PartialEq {
    /// Nothing, of the same kind.
    fn nothing(&self) -> Self;
    fn is_empty(&self) -> bool;
    /// What of a node's bound lies in it.
    fn part_of(&self, bounds: &SBounds, n: NodeId) -> Self;
    /// True when it is a node's whole bound: no rule below it gains anything.
    fn is_whole(&self, bounds: &SBounds, n: NodeId) -> bool;
    fn union(&self, other: &Self) -> Self;
    fn aabb(&self) -> Aabb;
}

impl Clip for Aabb {
    fn nothing(&self) -> Self {
        Self::EMPTY
    }
    fn is_empty(&self) -> bool {
        Aabb::is_empty(self)
    }
    fn part_of(&self, bounds: &SBounds, n: NodeId) -> Self {
        let bound = bounds.node(n);
        if bound.is_empty() || bound.ball.misses(self) {
            return Self::EMPTY;
        }
        let part = bound.aabb.intersection(self);
        match bounds.oriented(n) {
            Some(own) if part.is_finite() && own.misses(&Oriented::of_box(&part)) => Self::EMPTY,
            _ => part,
        }
    }
    fn is_whole(&self, bounds: &SBounds, n: NodeId) -> bool {
        *self == bounds.node(n).aabb
    }
    fn union(&self, other: &Self) -> Self {
        Aabb::union(self, other)
    }
    fn aabb(&self) -> Aabb {
        *self
    }
}

impl Clip for Ball {
    fn nothing(&self) -> Self {
        Self::EMPTY
    }
    fn is_empty(&self) -> bool {
        Ball::is_empty(self)
    }
    fn part_of(&self, bounds: &SBounds, n: NodeId) -> Self {
        self.intersection(&bounds.node(n).ball)
    }
    fn is_whole(&self, bounds: &SBounds, n: NodeId) -> bool {
        *self == bounds.node(n).ball
    }
    fn union(&self, other: &Self) -> Self {
        Ball::union(self, other)
    }
    fn aabb(&self) -> Aabb {
        Ball::aabb(self)
    }
}

/// A box of which only what meets the partner's box along its own axes counts. What is left is handed on as a box: f of
/// the pruned tree must be right in all of it.
#[derive(Clone, Copy, Debug)]
struct Tight {
    aabb: Aabb,
    partner: Oriented,
}

impl PartialEq for Tight {
    fn eq(&self, other: &Self) -> bool {
        self.aabb == other.aabb
    }
}

impl Clip for Tight {
    fn nothing(&self) -> Self {
        Self { aabb: Aabb::EMPTY, ..*self }
    }
    fn is_empty(&self) -> bool {
        self.aabb.is_empty()
    }
    fn part_of(&self, bounds: &SBounds, n: NodeId) -> Self {
        let part = self.aabb.part_of(bounds, n);
        let missed = part.is_empty()
            || self.partner.misses(&Oriented::of_box(&part))
            || bounds.oriented(n).is_some_and(|own| self.partner.misses(own));
        Self { aabb: if missed { Aabb::EMPTY } else { part }, ..*self }
    }
    fn is_whole(&self, _: &SBounds, _: NodeId) -> bool {
        // The partner may miss some of what is below.
        false
    }
    fn union(&self, other: &Self) -> Self {
        Self { aabb: self.aabb.union(&other.aabb), ..*self }
    }
    fn aabb(&self) -> Aabb {
        self.aabb
    }
}

impl Pruned {
    /// What of a tree lies in `region` (own model frame); `None` when nothing does.
    pub fn within(solid: &Solid, bounds: &SBounds, region: Aabb) -> Option<Self> {
        let mut alive = Alive {
            nodes: vec![0; solid.nodes.len().div_ceil(64)],
            primitives: vec![0; solid.primitives.len().div_ceil(64)],
        };
        let aabb = left_in(solid, bounds, &region);
        if aabb.is_empty() {
            return None;
        }
        mark(solid, bounds, solid.root, &aabb, &mut alive);
        let primitives = alive.primitives.iter().map(|w| w.count_ones() as usize).sum();
        let (alive, alive_primitives) = (alive.nodes, alive.primitives);
        Some(Self { aabb, alive, alive_primitives, primitives, primitives_before: solid.primitives.len() })
    }

    /// Everything that the bounds leave of the tree, without a partner: stage 1 switched off.
    pub fn whole(solid: &Solid, bounds: &SBounds) -> Option<Self> {
        Self::within(solid, bounds, bounds.root().aabb)
    }

    /// False when the node contributes nothing in the region.
    pub fn node_alive(&self, n: NodeId) -> bool {
        bit(&self.alive, n)
    }

    /// False when the primitive contributes nothing in the region.
    pub fn primitive_alive(&self, p: u32) -> bool {
        bit(&self.alive_primitives, p)
    }

    /// f of the pruned tree at `x` (model frame): dead nodes are +infinity.
    pub fn value(&self, solid: &Solid, x: DVec3) -> f64 {
        self.value_of(solid, solid.root, x)
    }

    fn value_of(&self, solid: &Solid, n: NodeId, x: DVec3) -> f64 {
        if !self.node_alive(n) {
            return f64::INFINITY;
        }
        match &solid.nodes[n as usize] {
            Node::Empty => f64::INFINITY,
            Node::Primitive(p) => solid.primitives[*p as usize].value(x),
            Node::Op(op, children) => op.value(children.iter().map(|c| self.value_of(solid, *c, x))),
        }
    }
}

/// Marks of what is left.
struct Alive {
    nodes: Vec<u64>,
    primitives: Vec<u64>,
}

fn bit(words: &[u64], i: u32) -> bool {
    words[i as usize / 64] >> (i % 64) & 1 == 1
}

fn set(words: &mut [u64], i: u32) {
    words[i as usize / 64] |= 1 << (i % 64);
}

fn shrank(now: &Aabb, was: &Aabb) -> bool {
    let (e, f) = (now.max - now.min, was.max - was.min);
    (0..3).any(|k| e[k] < f[k] * (1.0 - BOUND_PROGRESS))
}

/// What is left of the whole tree inside `clip`.
fn left_in<C: Clip>(solid: &Solid, bounds: &SBounds, clip: &C) -> C {
    if clip.is_empty() { *clip } else { left_of(solid, bounds, solid.root, clip) }
}

/// What is left of node `n` inside `clip`: both rules below `n`, without marks.
fn left_of<C: Clip>(solid: &Solid, bounds: &SBounds, n: NodeId, clip: &C) -> C {
    let b = clip.part_of(bounds, n);
    if b.is_empty() || b.is_whole(bounds, n) {
        return b;
    }
    match &solid.nodes[n as usize] {
        Node::Empty => b.nothing(),
        Node::Primitive(_) => b,
        Node::Op(Op::Union, children) => {
            let mut hull = b.nothing();
            for c in children {
                if hull == b {
                    break;
                }
                hull = hull.union(&left_of(solid, bounds, *c, &b));
            }
            hull
        }
        Node::Op(Op::Intersection, children) => {
            // Each operand clips the next one; once more round when the last ones clipped the first ones.
            let mut left = b;
            for _ in 0..2 {
                let before = left;
                for c in children {
                    left = left_of(solid, bounds, *c, &left);
                    if left.is_empty() {
                        return left;
                    }
                }
                if left == before {
                    break;
                }
            }
            left
        }
        Node::Op(Op::Difference, children) => left_of(solid, bounds, children[0], &b),
    }
}

/// Marks what counts of node `n` inside `clip`, which holds something of it.
fn mark(solid: &Solid, bounds: &SBounds, n: NodeId, clip: &Aabb, marks: &mut Alive) {
    set(&mut marks.nodes, n);
    match &solid.nodes[n as usize] {
        Node::Empty => {}
        Node::Primitive(p) => set(&mut marks.primitives, *p),
        Node::Op(op, children) => {
            for (i, c) in children.iter().enumerate() {
                let left = left_of(solid, bounds, *c, clip);
                if !left.is_empty() {
                    // Operands of an intersection, and the first of a difference, count in the whole of it.
                    let all = *op == Op::Intersection || (*op == Op::Difference && i == 0);
                    mark(solid, bounds, *c, if all { clip } else { &left }, marks);
                }
            }
        }
    }
}
