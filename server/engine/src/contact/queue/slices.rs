//! Stages 1 and 2 inside the queue: a slice of time becomes a collision region, the region the cells of stage 3.
//!
//! A slice [t0, t1] of the step is located by S-bounds (`bound::pair`): empty, it is done; while the bodies move far
//! across what is left and much is left, it is halved, so that the region of the half in which they first meet is small.
//! In the region both octrees are walked by table 4 (`octree::walk`), the larger node of a pair decomposed, until few
//! terms are left in a pair or a number of pairs is reached. The pairs of voxels at which the walk ends say which positive
//! alternatives of A can meet anything, where, and when at the earliest; each becomes one cell of stage 3, with B cut
//! down to the voxels it may meet (their hull's six planes keep the cell to it: clip planes).
//! Stage 3 has no other source of primitives: `Known` tells which were handed over.

use super::cell::{Cell, Range, Source};
use super::clock::Stage;
use super::items::Items;
use super::roots;
use super::roots::Root;
use crate::bound::CollisionRegion;
use crate::bound::pair::Pruned;
use crate::contact::exclusion::literal::Side;
use crate::contact::query::outcome::Counters;
use crate::contact::query::task::Task;
use crate::math::Aabb;
use crate::octree::span::primitive_span;
use crate::octree::walk::{Detail, Next, NodePair, Walk};
use crate::octree::{Node, NodeKind};
use crate::solid;
use crate::solid::local::{self, LiteralId, Token, Truth};
use crate::solid::surface::Plane;
use crate::solid::{NodeId, Sense, Solid};
use glam::DVec3;
use std::collections::VecDeque;
use std::sync::Arc;

/// Positive alternatives that a body may be split into. Those of nested trees multiply, and a cell tells them apart as well.
const MOST_ALTERNATIVES: usize = 128;
/// A pair of nodes with no more terms than this is not decomposed: cells tell apart what is in it for less.
const FEW_TERMS: usize = 24;
/// Pairs of nodes that a walk looks at before it stops decomposing. Many more leave the cells of trees (`tail`) what they are but for
/// a few in a hundred, and the walk takes a third of what the median pair costs.
const MOST_NODE_PAIRS: usize = 32;
/// A slice is halved while the bodies move further in it than this part of the region's smaller diagonal …
const SLICE_TRAVEL: f64 = 0.25;
/// … down to this part of the step.
const SLICE_LEAST: f64 = 1.0 / 64.0;

/// What makes cells of slices.
pub(super) struct Slices<'s, 'a> {
    pub(super) task: &'s Task<'a>,
    pub(super) items: &'s mut Items,
    pub(super) counters: &'s mut Counters,
}

impl<'a> Slices<'_, 'a> {
    /// Halves a slice of time, or hands what `region`, which stage 1 has left of both bodies in it, holds to stage 3; all of them
    /// without one.
    pub(super) fn decompose(&mut self, cell: &Cell, region: Option<Arc<CollisionRegion>>) {
        let (t0, t1) = (cell.t, cell.until);
        let (placed_a, placed_b) = self.task.relative.placed();
        let (model_a, model_b) = (self.task.model_a, self.task.model_b);
        let level = self.task.level();
        if let Some(found) = &region {
            let left = found.a.primitives + found.b.primitives;
            let span = found.a.aabb.half().length().min(found.b.aabb.half().length());
            let bounds = self.task.relative.bounds(t0, t1 - t0, self.task.scale);
            let far = bounds.speed * (t1 - t0) > SLICE_TRAVEL * 2.0 * span;
            if left > FEW_PRIMITIVES && far && t1 - t0 > SLICE_LEAST {
                let middle = 0.5 * (t0 + t1);
                self.items.push(Cell::source(t0, middle, Source::Slice));
                self.items.push(Cell::source(middle, t1, Source::Slice));
                return;
            }
            self.counters.after_stage1 = self.counters.after_stage1.max(left as u64);
        }
        self.items.scratch.enter(Stage::Walk);
        let (mut a, mut b) = (Vec::new(), Vec::new());
        if self.whole(Side::A, region.as_ref(), &mut a) != Truth::Open
            || self.whole(Side::B, region.as_ref(), &mut b) != Truth::Open
        {
            return;
        }
        let box_a =
            region.as_ref().map_or(Aabb::ALL, |r| r.a.aabb).intersection(&model_a.bounds_for(level).root().aabb);
        let box_b =
            region.as_ref().map_or(Aabb::ALL, |r| r.b.aabb).intersection(&model_b.bounds_for(level).root().aabb);
        // Octree and bounds keep f only up to their margin; a coarser resolution works on whole trees.
        let fine = level <= model_a.margin() && level <= model_b.margin();
        let finite = model_a.octree.root().half.is_finite() && model_b.octree.root().half.is_finite();
        if !(self.task.strategies.walk && fine && finite) {
            // Without stage 2 the region as a whole is all that stage 3 knows.
            self.hand_over((t0, t1), &box_a, &box_b, &a, &b);
            return;
        }
        let roots = roots::alternatives(self.task.a, &a, &box_a, self.task.highest(), MOST_ALTERNATIVES);
        let detail = Detail { finest: f64::INFINITY, ..Detail::default() };
        let walk = Walk::new((model_a, placed_a), (model_b, placed_b), region, level, detail);
        let ends = self.ends(&walk, t0, t1);
        for root in &roots {
            if let Some((time, in_a, in_b)) = self.met(root, &ends) {
                let (in_a, in_b) = (in_a.intersection(&root.region), in_b.intersection(&box_b));
                self.hand_over((time, t1), &in_a, &in_b, &root.tokens, &b);
            }
        }
    }

    /// The pairs of nodes at which the walk of both octrees ends within [t0, t1].
    fn ends(&mut self, walk: &Walk<'a>, t0: f64, t1: f64) -> Vec<NodePair<'a>> {
        let mut ends = Vec::new();
        let mut queue: VecDeque<NodePair<'a>> = walk.root(t0, t1).into_iter().collect();
        let mut count = queue.len();
        let full = |n: &Node| n.kind() == NodeKind::Full;
        while let Some(pair) = queue.pop_front() {
            self.counters.node_pairs += 1;
            // After the start first contacts lie on both surfaces {f = −delta}; in a full voxel f is below −margin.
            if t0 > 0.0 && (full(pair.a) || full(pair.b)) {
                continue;
            }
            let few = pair.a.terms().len() + pair.b.terms().len() <= FEW_TERMS;
            let next = if few || count >= MOST_NODE_PAIRS { Next::Pairs } else { walk.next(&pair) };
            match next {
                Next::Skip => {}
                Next::Pairs => ends.push(pair),
                Next::SplitA(children) => {
                    count += children.len();
                    let at = walk.at(pair.time);
                    queue.extend(children.iter().filter_map(|a| walk.timed(NodePair { a, ..pair }, &at, t1)));
                }
                Next::SplitB(children) => {
                    count += children.len();
                    let at = walk.at(pair.time);
                    queue.extend(children.iter().filter_map(|b| walk.timed(NodePair { b, ..pair }, &at, t1)));
                }
            }
        }
        ends
    }

    /// Earliest time at which an alternative of A may meet B, and the hulls of A's and B's voxels in which it may.
    fn met(&self, root: &Root, ends: &[NodePair<'a>]) -> Option<(f64, Aabb, Aabb)> {
        // The alternative holds only inside each of its positive primitives, or as near as is searched: one of them is tested.
        let positive = local::literals(&root.tokens).find(|id| id.sense() == Sense::Positive);
        let primitive = positive.map(|id| &self.task.a.primitives[self.task.a.face_owner[id.face() as usize] as usize]);
        let mut found: Option<(f64, Aabb, Aabb)> = None;
        for pair in ends {
            let voxel = pair.a.aabb();
            if !voxel.meets(&root.region)
                || primitive.is_some_and(|p| primitive_span(p, voxel.center(), voxel.half()).0 > self.task.highest())
            {
                continue;
            }
            let (time, in_a, in_b) = found.unwrap_or((f64::INFINITY, Aabb::EMPTY, Aabb::EMPTY));
            found = Some((time.min(pair.time), in_a.union(&voxel), in_b.union(&pair.b.aabb())));
        }
        found
    }

    /// What stage 1 left of a body's whole tree.
    fn whole(&self, side: Side, region: Option<&Arc<CollisionRegion>>, out: &mut Vec<Token>) -> Truth {
        let solid = if side == Side::A { self.task.a } else { self.task.b };
        match region {
            Some(r) => write_pruned(solid, if side == Side::A { &r.a } else { &r.b }, out),
            None => {
                out.extend_from_slice(&solid.normal_form);
                if solid.is_empty() { Truth::False } else { Truth::Open }
            }
        }
    }

    /// Hands an alternative of A within the box `in_a` to stage 3, with what of B lies in `in_b`.
    pub(super) fn hand_over(&mut self, (t, until): (f64, f64), in_a: &Aabb, in_b: &Aabb, a: &[Token], b: &[Token]) {
        // The bounds of region and body, made one from the other by different ways, may have no point in common.
        if in_a.is_empty() || in_b.is_empty() {
            return;
        }
        let depth = (self.task.delta, self.task.rounding);
        let (mut of_a, mut of_b) = (Vec::new(), Vec::new());
        let truth_a = self.task.a.prune_to_box(a, in_a, depth, &mut of_a);
        let truth_b = self.task.b.prune_to_box(b, in_b, depth, &mut of_b);
        if truth_a == Truth::False || truth_b == Truth::False {
            return;
        }
        // After the start first contacts lie on both surfaces, f_A = f_B = −delta: {f <= −delta} moves with its body like any solid,
        // so what holds for solids holds for it, whatever the sign of delta is. A box throughout which f stays below −delta by a
        // rounding holds none of them, provided that the box was not cut from a larger set for another depth: `in_a` and `in_b`
        // hold all of {f <= −delta} that may meet (S-bounds, octree and roots are all asked for that level).
        if t > 0.0 && (truth_a == Truth::True || truth_b == Truth::True) {
            return;
        }
        let clip_planes = self.clip_planes(in_b);
        let range_a = self.store_and(&of_a, &[]);
        let range_b = self.store_and(&of_b, &clip_planes);
        let cell = Cell::new((t, until), in_a, range_a, range_b);
        if self.items.may_meet(self.task, &cell) {
            self.note(&of_a, &of_b);
            self.items.push(cell);
        }
    }

    /// The planes that keep B's points to a box of its frame.
    fn clip_planes(&mut self, region: &Aabb) -> Vec<Token> {
        let mut tokens = Vec::new();
        for k in 0..3 {
            for (sign, offset) in [(1.0, region.max[k]), (-1.0, -region.min[k])] {
                if offset == f64::INFINITY {
                    continue;
                }
                let mut normal = DVec3::ZERO;
                normal[k] = sign;
                let id = (self.task.b.faces.len() + self.items.scratch.clip_planes_b.len()) as u32;
                self.items.scratch.clip_planes_b.push(Plane { normal, offset }.into());
                tokens.push(local::literal_token(LiteralId::new(id, Sense::Positive)));
            }
        }
        tokens
    }

    /// Stores the conjunction of an expression and some clip planes.
    fn store_and(&mut self, tokens: &[Token], clip_planes: &[Token]) -> Range {
        if tokens.is_empty() && clip_planes.is_empty() {
            return (0, 0);
        }
        let mut joined = Vec::new();
        let parts = (!tokens.is_empty()).then_some(tokens).into_iter().chain(clip_planes.chunks(1));
        local::write_and(parts, &mut joined);
        self.items.store(&joined)
    }

    /// Counts each pair of primitives once and remembers what was handed over.
    fn note(&mut self, a: &[Token], b: &[Token]) {
        let owners = |tokens: &[Token], solid: &Solid| {
            let mut list: Vec<u32> = local::named(tokens).map(|id| solid.face_owner[id.face() as usize]).collect();
            list.sort_unstable();
            list.dedup();
            list
        };
        let (a, b) = (owners(a, self.task.a), owners(b, self.task.b));
        for p in &a {
            for q in &b {
                if self.items.handed.candidates.insert((*p, *q)) {
                    self.counters.candidates += 1;
                }
            }
        }
        self.items.handed.primitives[0].extend(a);
        self.items.handed.primitives[1].extend(b);
    }
}

/// With no more primitives than this, cells do better than slices of time.
const FEW_PRIMITIVES: usize = 6;

/// The tree as literals with the nodes that stage 1 removed left out.
fn write_pruned(solid: &Solid, pruned: &Pruned, out: &mut Vec<Token>) -> Truth {
    if solid.simplified {
        // What the whole tree says twice is said once: of its normal form the literals of the primitives left.
        let mut left = vec![false; solid.primitives.len()];
        let mut stack = vec![solid.root];
        while let Some(n) = stack.pop() {
            match &solid.nodes[n as usize] {
                _ if !pruned.node_alive(n) => {}
                solid::Node::Empty => {}
                solid::Node::Primitive(p) => left[*p as usize] = true,
                solid::Node::Op(_, children) => stack.extend(children),
            }
        }
        return local::prune(&solid.normal_form, out, &mut |id| match id.sense() {
            _ if left[solid.face_owner[id.face() as usize] as usize] => Truth::Open,
            Sense::Positive => Truth::False,
            Sense::Negative => Truth::True,
        });
    }
    solid::write_node(solid, solid.root, Sense::Positive, &|n: NodeId| pruned.node_alive(n), out)
}
