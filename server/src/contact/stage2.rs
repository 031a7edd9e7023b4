//! Stages 1 and 2 inside the queue: a slice of time becomes a collision region, the region pairs of octree nodes, those
//! the cells of stage 3.
//!
//! A slice [t0, t1] of the step is located by S-bounds (`bound::pair`): empty, it is done; while the bodies move far
//! across what is left and much is left, it is halved, so that the region of the half in which they first meet is small.
//! A pair of nodes is queued at the earliest time at which its voxels may meet (`eco::walk`). When its turn comes,
//! table 4 decides: skip, decompose the larger node, or hand the primitives of both to stage 3. A grey pair is handed
//! over early when so few literals are left in it that decomposing would only multiply cells; a mixed leaf is refined
//! beyond the octree's built depth on demand. Cells keep to B's voxel by its six planes (guards), since B's literals are
//! those of that voxel alone.
//! Stage 3 has no other source of primitives: `knows` tells which were handed over.

use super::literal::Side;
use super::newton::Constraint;
use super::roots;
use super::search::{Cell, Range, Search, Source, Task};
use crate::bound::Region;
use crate::bound::pair::{Pruned, Side as Operand, locate};
use crate::eco::walk::{Detail, Next, NodePair, Walk};
use crate::eco::{Kind, Node};
use crate::math::Aabb;
use crate::solid::local::{self, LiteralId, Token, Truth};
use crate::solid::{Face, NodeId, Sense, Solid};
use glam::DVec3;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// A pair with no more literals than this goes to stage 3 as it is.
const FEW_LITERALS: usize = 40;
/// Positive alternatives that one pair of nodes may be split into.
const MOST_ALTERNATIVES: usize = 64;
/// A slice is halved while the bodies move further in it than this part of the region's smaller diagonal …
const SLICE_TRAVEL: f64 = 0.25;
/// … down to this part of the step.
const SLICE_LEAST: f64 = 1.0 / 64.0;

/// A slice of time with its collision region and its walk.
#[derive(Debug)]
struct Slice<'a> {
    end: f64,
    region: Option<Arc<Region>>,
    walk: Option<Walk<'a>>,
}

/// What the first two stages have done so far.
#[derive(Debug, Default)]
pub struct Stage2<'a> {
    slices: Vec<Slice<'a>>,
    pairs: Vec<(NodePair<'a>, u32)>,
    /// Guards of B's voxels, by node and slice.
    guards: HashMap<(usize, u32), Vec<Token>>,
    handed: [HashSet<u32>; 2],
    candidates: HashSet<(u32, u32)>,
}

impl Stage2<'_> {
    /// True when the constraint's primitive was handed to stage 3.
    pub fn knows(&self, task: &Task, c: &Constraint) -> bool {
        let (Constraint::Literal(side, id) | Constraint::Apex(side, id, _)) = *c;
        let solid = if side == Side::A { task.a } else { task.b };
        self.handed[side as usize].contains(&solid.face_owner[id.face() as usize])
    }
}

impl<'a> Search<'a> {
    /// Queues the whole step.
    pub fn start(&mut self) {
        self.push(Cell::source(0.0, if self.task.still { 0.0 } else { 1.0 }, Source::Slice));
    }

    /// Stage 1 on a slice of time.
    pub(super) fn locate(&mut self, cell: &Cell) {
        let (t0, t1) = (cell.t, cell.until);
        let (placed_a, placed_b) = self.task.relative.placed();
        let (model_a, model_b) = (self.task.model_a, self.task.model_b);
        let mut region = None;
        if self.task.ideas.region {
            let a = Operand { solid: self.task.a, bounds: &model_a.bounds, placed: placed_a };
            let b = Operand { solid: self.task.b, bounds: &model_b.bounds, placed: placed_b };
            let Some(found) = locate(&a, &b, t0, t1, self.task.delta) else { return };
            let left = found.a.primitives + found.b.primitives;
            let span = found.a.aabb.half().length().min(found.b.aabb.half().length());
            let bounds = self.task.relative.bounds(t0, t1 - t0, self.task.scale);
            let far = bounds.speed * (t1 - t0) > SLICE_TRAVEL * 2.0 * span;
            if left > FEW_PRIMITIVES && far && t1 - t0 > SLICE_LEAST {
                let middle = 0.5 * (t0 + t1);
                self.push(Cell::source(t0, middle, Source::Slice));
                self.push(Cell::source(middle, t1, Source::Slice));
                return;
            }
            self.counters.after_stage1 = self.counters.after_stage1.max(left as u64);
            region = Some(Arc::new(found));
        }
        // Octree and bounds keep f only up to their margin; a coarser resolution works on whole trees.
        let delta = self.task.delta;
        let fine = delta <= model_a.margin() && delta <= model_b.margin();
        let finite = model_a.eco.root().half.is_finite() && model_b.eco.root().half.is_finite();
        let walk = (self.task.ideas.walk && fine && finite).then(|| {
            let detail = Detail { finest: 0.0, ..Detail::default() };
            Walk::new((model_a, placed_a), (model_b, placed_b), region.clone(), delta, detail)
        });
        let index = self.stage2.slices.len() as u32;
        let root = walk.as_ref().map(|w| w.root(t0, t1));
        self.stage2.slices.push(Slice { end: t1, region, walk });
        match root {
            Some(Some(pair)) => self.queue(pair, index),
            Some(None) => {}
            None => {
                let (mut a, mut b) = (Vec::new(), Vec::new());
                if self.whole(Side::A, index, &mut a) == Truth::Open
                    && self.whole(Side::B, index, &mut b) == Truth::Open
                {
                    let region = self.region_a(index).intersection(&model_a.bounds.root().aabb);
                    let guards = self.guards_of(None, index);
                    self.hand_over((t0, t1), &region, &a, &b, &guards);
                }
            }
        }
    }

    /// What stage 1 left of a body's whole tree.
    fn whole(&self, side: Side, slice: u32, out: &mut Vec<Token>) -> Truth {
        let solid = if side == Side::A { self.task.a } else { self.task.b };
        match &self.stage2.slices[slice as usize].region {
            Some(r) => write_pruned(solid, if side == Side::A { &r.a } else { &r.b }, out),
            None => local::write_tree(solid, out),
        }
    }

    /// The collision region in A's frame.
    fn region_a(&self, slice: u32) -> Aabb {
        self.stage2.slices[slice as usize].region.as_ref().map_or(Aabb::ALL, |r| r.a.aabb)
    }

    /// The part of A's voxel in the collision region; empty when outside.
    fn box_of(&self, node: &Node, slice: u32) -> Aabb {
        node.aabb().intersection(&self.region_a(slice)).intersection(&self.task.model_a.bounds.root().aabb)
    }

    fn queue(&mut self, pair: NodePair<'a>, slice: u32) {
        let full = |n: &Node| n.kind() == Kind::Full;
        // After the start first contacts lie on both surfaces.
        let idle = pair.time > 0.0 && (full(pair.a) || full(pair.b));
        if idle || self.box_of(pair.a, slice).is_empty() {
            return;
        }
        self.stage2.pairs.push((pair, slice));
        let index = self.stage2.pairs.len() as u32 - 1;
        let end = self.stage2.slices[slice as usize].end;
        self.push(Cell::source(pair.time, end, Source::Pair(index)));
    }

    /// The planes that keep B's points to a voxel (to the whole of B) and to the collision region.
    fn guards_of(&mut self, node: Option<&Node>, slice: u32) -> Vec<Token> {
        let key = (node.map_or(0, |n| std::ptr::from_ref(n) as usize), slice);
        if let Some(tokens) = self.stage2.guards.get(&key) {
            return tokens.clone();
        }
        let region = self.stage2.slices[slice as usize].region.as_ref().map_or(Aabb::ALL, |r| r.b.aabb);
        let voxel = node.map_or(Aabb::ALL, Node::aabb).intersection(&region);
        let mut tokens = Vec::new();
        for k in 0..3 {
            for (sign, offset) in [(1.0, voxel.max[k]), (-1.0, -voxel.min[k])] {
                if offset == f64::INFINITY {
                    continue;
                }
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
        if tokens.is_empty() && guards.is_empty() {
            return (0, 0);
        }
        let mut joined = Vec::new();
        let parts = (!tokens.is_empty()).then_some(tokens).into_iter().chain(guards.chunks(1));
        local::write_and(parts, &mut joined);
        self.store(&joined)
    }

    /// Stage 2 on a pair of nodes whose voxels may meet at its cell's time.
    pub(super) fn open(&mut self, cell: &Cell, index: u32) {
        self.counters.node_pairs += 1;
        let (pair, slice) = self.stage2.pairs[index as usize];
        let (a, b) = (pair.a, pair.b);
        let (mut in_a, mut in_b) = (Vec::new(), Vec::new());
        let is_root = a.depth() == 0 && b.depth() == 0;
        let (truth_a, truth_b) = if is_root {
            (self.whole(Side::A, slice, &mut in_a), self.whole(Side::B, slice, &mut in_b))
        } else {
            let delta = self.task.delta;
            (self.task.model_a.literals(a, delta, &mut in_a), self.task.model_b.literals(b, delta, &mut in_b))
        };
        if truth_a == Truth::False || truth_b == Truth::False {
            return;
        }
        if cell.t > 0.0 && (truth_a == Truth::True || truth_b == Truth::True) {
            return;
        }
        let count = local::literals(&in_a).count() + local::literals(&in_b).count();
        if count > FEW_LITERALS {
            let stage = &self.stage2.slices[slice as usize];
            let walk = stage.walk.clone().expect("pairs come from a walk");
            let end = stage.end;
            let mut queue = |next: NodePair<'a>| {
                if let Some(timed) = walk.timed(next, end) {
                    self.queue(timed, slice);
                }
            };
            match walk.next(&pair) {
                Next::Skip => return,
                Next::SplitA(children) => return children.iter().for_each(|a| queue(NodePair { a, ..pair })),
                Next::SplitB(children) => return children.iter().for_each(|b| queue(NodePair { b, ..pair })),
                Next::Pairs => {}
            }
        }
        let guards = self.guards_of((!is_root).then_some(b), slice);
        let region = self.box_of(a, slice);
        self.hand_over((cell.t, cell.until), &region, &in_a, &in_b, &guards);
    }

    /// Hands what is left of both trees in `region` to stage 3, a cell for each positive alternative of A.
    fn hand_over(&mut self, (t, until): (f64, f64), region: &Aabb, a: &[Token], b: &[Token], guards: &[Token]) {
        self.note(a, b);
        let b = self.store_and(b, guards);
        if a.is_empty() {
            // A is full here: only at the start.
            self.push(Cell::new((t, until), region, (0, 0), b));
            return;
        }
        let (faces, delta) = (&self.task.a.faces, self.task.delta);
        for root in roots::alternatives(self.task.a, a, region, MOST_ALTERNATIVES) {
            let mut tokens = Vec::new();
            if local::prune_to_box(&root.tokens, faces, &root.region, delta, &mut tokens) == Truth::False {
                continue;
            }
            let range = if tokens.is_empty() { (0, 0) } else { self.store(&tokens) };
            self.push(Cell::new((t, until), &root.region, range, b));
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

/// With no more primitives than this, cells do better than slices of time.
const FEW_PRIMITIVES: usize = 6;

/// The tree as literals with the nodes that stage 1 removed left out.
fn write_pruned(solid: &Solid, pruned: &Pruned, out: &mut Vec<Token>) -> Truth {
    local::write_node(solid, solid.root, Sense::Positive, &|n: NodeId| pruned.node_alive(n), out)
}
