//! Stage 2 inside the queue: both octrees walked under their relative motion into candidates for stage 3.
//!
//! An item is a pair of octree nodes; its cell is A's voxel, its expression B's voxel as six guards. The queue moves it
//! through time until the voxels may meet; then table 4 decides: skip, decompose the larger node, or hand the primitives
//! of both to stage 3 as cells. A grey pair is handed over early when so few literals are left in it that further
//! decomposition would only multiply cells; a mixed one is refined beyond the octree's built depth on demand.
//! Stage 3 has no other source of primitives: `knows` tells which were handed over.

use super::literal::Side;
use super::newton::Constraint;
use super::roots;
use super::search::{Cell, NO_PAIR, Range, Search, Task};
use crate::bound::pair::Pruned;
use crate::eco::{Kind, Meet, Model, Node, meet};
use crate::math::Aabb;
use crate::solid::local::{self, LiteralId, Token, Truth};
use crate::solid::{Face, NodeId, Sense, Solid};
use glam::DVec3;
use std::collections::{HashMap, HashSet};

/// A pair with no more literals than this goes to stage 3 as it is.
const FEW_LITERALS: usize = 40;
/// Positive alternatives that one pair of nodes may be split into.
const MOST_ALTERNATIVES: usize = 64;

/// What the walk has done so far.
#[derive(Debug, Default)]
pub struct Stage2<'a> {
    pairs: Vec<(&'a Node, &'a Node)>,
    /// Guards of B's voxels, by node.
    guards: HashMap<usize, Vec<Token>>,
    handed: [HashSet<u32>; 2],
    candidates: HashSet<(u32, u32)>,
}

impl Stage2<'_> {
    /// True when nothing can happen in a pair any more: after the start, first contacts lie on both surfaces.
    pub fn is_idle(&self, pair: u32, start: bool) -> bool {
        let (a, b) = self.pairs[pair as usize];
        !start && (a.kind() == Kind::Full || b.kind() == Kind::Full)
    }

    /// True when the constraint's primitive was handed to stage 3.
    pub fn knows(&self, task: &Task, c: &Constraint) -> bool {
        let (Constraint::Literal(side, id) | Constraint::Apex(side, id, _)) = *c;
        let solid = if side == Side::A { task.a } else { task.b };
        self.handed[side as usize].contains(&solid.face_owner[id.face() as usize])
    }
}

impl<'a> Search<'a, '_> {
    /// Queues the root of the search.
    pub fn start(&mut self) {
        let (model_a, model_b) = (self.task.model_a, self.task.model_b);
        let delta = self.task.delta;
        // Octree and bounds keep f only up to their margin; a coarser resolution works on whole trees.
        let fine = delta <= model_a.margin() && delta <= model_b.margin();
        let (root_a, root_b) = (model_a.eco.root(), model_b.eco.root());
        if self.task.ideas.walk && fine && root_a.half.is_finite() && root_b.half.is_finite() {
            self.push_pair(0.0, root_a, root_b);
            return;
        }
        let region = self.task.region.map_or_else(|| model_a.bounds.root().aabb, |r| r.a.aabb);
        let (mut a, mut b) = (Vec::new(), Vec::new());
        if self.whole(Side::A, &mut a) != Truth::Open || self.whole(Side::B, &mut b) != Truth::Open {
            return;
        }
        self.hand_over(0.0, &region, &a, &b, &[]);
    }

    /// What stage 1 left of a body's whole tree.
    fn whole(&self, side: Side, out: &mut Vec<Token>) -> Truth {
        let solid = if side == Side::A { self.task.a } else { self.task.b };
        match self.task.region {
            Some(r) => write_pruned(solid, if side == Side::A { &r.a } else { &r.b }, solid.root, Sense::Positive, out),
            None => local::write_tree(solid, out),
        }
    }

    /// The part of A's voxel in the collision region; empty when outside.
    fn box_of(&self, node: &Node) -> Aabb {
        let region = self.task.region.map_or(Aabb::ALL, |r| r.a.aabb);
        node.aabb().intersection(&region).intersection(&self.task.model_a.bounds.root().aabb)
    }

    fn push_pair(&mut self, t: f64, a: &'a Node, b: &'a Node) {
        if meet(a.kind(), b.kind()) == Meet::Skip {
            return;
        }
        let region_b = self.task.region.map_or(Aabb::ALL, |r| r.b.aabb);
        let cell = self.box_of(a);
        if cell.is_empty() || b.aabb().intersection(&region_b).is_empty() {
            return;
        }
        self.stage2.pairs.push((a, b));
        let index = self.stage2.pairs.len() as u32 - 1;
        let guards = self.guards_of(b);
        let range = self.store_and(&[], &guards);
        self.push(Cell::new(t, cell.center(), cell.half(), (0, 0), range, index));
    }

    /// The planes of B's voxel as literals.
    fn guards_of(&mut self, node: &Node) -> Vec<Token> {
        let key = std::ptr::from_ref(node) as usize;
        if let Some(tokens) = self.stage2.guards.get(&key) {
            return tokens.clone();
        }
        let region = self.task.region.map_or(Aabb::ALL, |r| r.b.aabb);
        let voxel = node.aabb().intersection(&region);
        let mut tokens = Vec::new();
        for k in 0..3 {
            for (sign, offset) in [(1.0, voxel.max[k]), (-1.0, -voxel.min[k])] {
                let mut normal = DVec3::ZERO;
                normal[k] = sign;
                let id = (self.task.b.faces.len() + self.scratch.guards_b.len()) as u32;
                self.scratch.guards_b.push(Face::Plane { normal, offset });
                tokens.push(local::literal_token(LiteralId::new(id, Sense::Positive)));
            }
        }
        self.stage2.guards.insert(key, tokens.clone());
        tokens
    }

    /// Stores the conjunction of an expression and some guards.
    fn store_and(&mut self, tokens: &[Token], guards: &[Token]) -> Range {
        let mut joined = Vec::new();
        let parts = (!tokens.is_empty()).then_some(tokens).into_iter().chain(guards.chunks(1));
        local::write_and(parts, &mut joined);
        self.store(&joined)
    }

    /// Decides a pair whose voxels may meet at its cell's time.
    pub(super) fn open(&mut self, cell: &Cell) {
        self.counters.node_pairs += 1;
        let (a, b) = self.stage2.pairs[cell.pair as usize];
        let (model_a, model_b) = (self.task.model_a, self.task.model_b);
        let (mut in_a, mut in_b) = (Vec::new(), Vec::new());
        let is_root = a.depth() == 0 && b.depth() == 0;
        let (truth_a, truth_b) = if is_root {
            (self.whole(Side::A, &mut in_a), self.whole(Side::B, &mut in_b))
        } else {
            (self.literals(model_a, a, &mut in_a), self.literals(model_b, b, &mut in_b))
        };
        if truth_a == Truth::False || truth_b == Truth::False {
            return;
        }
        if cell.t > 0.0 && (truth_a == Truth::True || truth_b == Truth::True) {
            return;
        }
        let count = local::literals(&in_a).count() + local::literals(&in_b).count();
        let grey = meet(a.kind(), b.kind()) == Meet::Branches;
        let (first, second) = if a.half >= b.half { (Side::A, Side::B) } else { (Side::B, Side::A) };
        if count > FEW_LITERALS {
            for side in [first, second] {
                // Table 4 decomposes grey; beyond it a mixed leaf is refined on demand, other leaves never.
                let (model, node) = if side == Side::A { (model_a, a) } else { (model_b, b) };
                let divisible = matches!(node.kind(), Kind::Grey | Kind::Mixed);
                let Some(children) = model.expand(node).filter(|_| divisible && (grey || node.kind() == Kind::Mixed))
                else {
                    continue;
                };
                for child in children {
                    match side {
                        Side::A => self.push_pair(cell.t, child, b),
                        Side::B => self.push_pair(cell.t, a, child),
                    }
                }
                return;
            }
        }
        let guards = if is_root && self.task.region.is_none() { Vec::new() } else { self.guards_of(b) };
        let region = self.box_of(a);
        self.hand_over(cell.t, &region, &in_a, &in_b, &guards);
    }

    fn literals(&self, model: &Model, node: &Node, out: &mut Vec<Token>) -> Truth {
        model.literals(node, self.task.delta, out)
    }

    /// Hands what is left of both trees in `region` to stage 3, a cell for each positive alternative of A.
    fn hand_over(&mut self, t: f64, region: &Aabb, a: &[Token], b: &[Token], guards: &[Token]) {
        self.note(a, b);
        let b = self.store_and(b, guards);
        if a.is_empty() {
            // A is full here: only at the start.
            self.push(Cell::new(t, region.center(), region.half(), (0, 0), b, NO_PAIR));
            return;
        }
        let (faces, delta) = (&self.task.a.faces, self.task.delta);
        for root in roots::alternatives(self.task.a, a, region, MOST_ALTERNATIVES) {
            let mut tokens = Vec::new();
            match local::prune_to_box(&root.tokens, faces, &root.region, delta, &mut tokens) {
                Truth::False => continue,
                Truth::True | Truth::Open => {}
            }
            let range = if tokens.is_empty() { (0, 0) } else { self.store(&tokens) };
            self.push(Cell::new(t, root.region.center(), root.region.half(), range, b, NO_PAIR));
        }
    }

    /// Counts each pair of primitives once and remembers what was handed over.
    fn note(&mut self, a: &[Token], b: &[Token]) {
        let owners = |tokens: &[Token], solid: &Solid| {
            let mut list: Vec<u32> = local::literals(tokens).map(|id| solid.face_owner[id.face() as usize]).collect();
            list.sort_unstable();
            list.dedup();
            list
        };
        let (a, b) = (owners(a, self.task.a), owners(b, self.task.b));
        for p in &a {
            for q in &b {
                if self.stage2.candidates.insert((*p, *q)) {
                    self.counters.candidates += 1;
                }
            }
        }
        self.stage2.handed[0].extend(a);
        self.stage2.handed[1].extend(b);
    }
}

/// The tree as literals with the nodes that stage 1 removed left out.
fn write_pruned(solid: &Solid, pruned: &Pruned, node: NodeId, sense: Sense, out: &mut Vec<Token>) -> Truth {
    local::write_node(solid, node, sense, &|n| pruned.node_alive(n), out)
}
