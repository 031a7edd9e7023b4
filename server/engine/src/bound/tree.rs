//! S-bounds of a whole tree: the upward rule, the downward rule, both until stable.
//!
//! Upward, a node's bound follows from its operands' by its operation. Downward, an operand's bound is clipped by its
//! parent's — a subtracted operand's too: what of it lies outside the parent's bound cuts nothing that counts. Each rule
//! makes the other sharper; they are repeated until no bound shrinks by `BOUND_PROGRESS` or after `MAX_ROUNDS` rounds.
//! Boxes alone settle after finitely many rounds, balls may creep; stopping early costs tightness, never truth.
//!
//! Nodes of one height do not depend on each other, in either direction: large levels may be shared between threads, and
//! each node's bound comes from the same operations in the same order however many there are.
//!
//! Invariant: replace f of every node N by +infinity wherever x lies outside N's bound. The root's f stays what it was
//! once clamped to ±margin. (By induction over the rules: leaves are bounds of {psi <= margin}; min, max and negation
//! commute with that clamp; the upward rule replaces f where all that could make it small is replaced already, the
//! downward rule where the parent's f is.) So a node with an empty bound contributes nothing, and is pruned.
//! Not promised: that a bound is the smallest one, or that it holds all of a node's own solid: only what counts of it.

use super::rules::oriented;
use super::{Bound, Volumes};
use crate::math::{Oriented, halt, tolerance::BOUND_PROGRESS};
use crate::solid::{Node, NodeId, Solid};
use rayon::prelude::*;

/// Cap on the rounds of both rules. Random trees: median 2, 95% within 4, a rare pair of balls creeps to the cap.
const MAX_ROUNDS: usize = 12;

/// The bounds of a solid's nodes.
#[derive(Clone, Debug)]
pub struct SBounds {
    bounds: Vec<Bound>,
    /// Of the primitives' nodes, a box along the primitive's own axes; empty unless such boxes are asked for.
    oriented: Vec<Option<Oriented>>,
    volumes: Volumes,
    root: NodeId,
    margin: f64,
    rounds: usize,
}

impl SBounds {
    /// Bounds that keep f of `solid` clamped to ±`margin` (a length, at least 0), taken on the calling thread alone.
    pub fn new(solid: &Solid, margin: f64) -> Self {
        Self::with_volumes(solid, margin, Volumes::default())
    }

    /// The same from other volumes than a ball and a box at every node.
    pub fn with_volumes(solid: &Solid, margin: f64, volumes: Volumes) -> Self {
        Self::on_threads(solid, margin, volumes, usize::MAX)
    }

    /// The same, large levels shared between threads: not within a lock that searches wait for, for a thread that waits
    /// for others may take up one of them.
    pub fn shared(solid: &Solid, margin: f64, volumes: Volumes) -> Self {
        Self::on_threads(solid, margin, volumes, SHARED)
    }

    /// Levels of so many nodes are shared.
    fn on_threads(solid: &Solid, margin: f64, volumes: Volumes, share: usize) -> Self {
        let levels = Levels::new(solid);
        let bounds = vec![Bound::EMPTY; solid.nodes.len()];
        let own = |node: &Node| match node {
            Node::Primitive(p) => oriented(&solid.primitives[*p as usize], margin),
            _ => None,
        };
        let along_own_axes = volumes == Volumes::Oriented;
        let oriented = if along_own_axes { solid.nodes.iter().map(own).collect() } else { Vec::new() };
        let mut this = Self { bounds, oriented, volumes, root: solid.root, margin, rounds: 0 };
        for level in &levels.by_height {
            this.replace(level, share, |n, bounds| match &solid.nodes[n as usize] {
                Node::Empty => Bound::EMPTY,
                Node::Primitive(p) => Bound::of_primitive(&solid.primitives[*p as usize], margin, volumes),
                Node::Op(op, children) => Bound::upward(*op, children.iter().map(|c| bounds[*c as usize]), volumes),
            });
        }
        while this.rounds < MAX_ROUNDS && this.round(solid, &levels, share) {}
        this
    }

    /// Bounds as they came out before, of the default volumes, one for each node of a solid.
    pub(crate) fn of_parts(bounds: Vec<Bound>, root: NodeId, margin: f64, rounds: usize) -> Self {
        Self { bounds, oriented: Vec::new(), volumes: Volumes::default(), root, margin, rounds }
    }

    /// One round, downward then upward; true when a bound shrank noticeably.
    fn round(&mut self, solid: &Solid, levels: &Levels, share: usize) -> bool {
        self.rounds += 1;
        let volumes = self.volumes;
        let mut moved = false;
        for level in levels.by_height.iter().rev() {
            moved |= self.replace(level, share, |n, bounds| match levels.parent[n as usize] {
                NO_PARENT => bounds[n as usize],
                parent => {
                    let clipped = bounds[parent as usize].intersection(&bounds[n as usize], volumes);
                    tighter(&bounds[n as usize], clipped, volumes)
                }
            });
        }
        for level in &levels.by_height {
            moved |= self.replace(level, share, |n, bounds| match &solid.nodes[n as usize] {
                Node::Op(op, children) => {
                    let joined = Bound::upward(*op, children.iter().map(|c| bounds[*c as usize]), volumes);
                    let before = bounds[n as usize];
                    tighter(&before, before.smaller(&joined, volumes), volumes)
                }
                _ => bounds[n as usize],
            });
        }
        moved
    }

    /// Gives each node of a level the bound that `next` has for it; true when one shrank noticeably.
    fn replace(&mut self, level: &[NodeId], share: usize, next: impl Fn(NodeId, &[Bound]) -> Bound + Sync) -> bool {
        halt::point();
        let mut moved = false;
        let mut take = |bounds: &mut Vec<Bound>, n: NodeId, bound: Bound| {
            moved |= bound.shrank_from(&bounds[n as usize], BOUND_PROGRESS);
            bounds[n as usize] = bound;
        };
        if level.len() < share {
            for n in level {
                let bound = next(*n, &self.bounds);
                take(&mut self.bounds, *n, bound);
            }
        } else {
            let known = &self.bounds;
            let found: Vec<Bound> = level.par_iter().with_min_len(SHARED / 4).map(|n| next(*n, known)).collect();
            for (n, bound) in level.iter().zip(found) {
                take(&mut self.bounds, *n, bound);
            }
        }
        moved
    }

    /// The bound of a node, model frame; empty when the node contributes nothing.
    pub fn node(&self, n: NodeId) -> &Bound {
        &self.bounds[n as usize]
    }

    /// A box along the own axes of a primitive's node, where such boxes were asked for.
    pub(super) fn oriented(&self, n: NodeId) -> Option<&Oriented> {
        self.oriented.get(n as usize)?.as_ref()
    }

    /// What the bounds are made of.
    pub fn volumes(&self) -> Volumes {
        self.volumes
    }

    /// The bound of the solid.
    pub fn root(&self) -> &Bound {
        self.node(self.root)
    }

    /// The bounds keep f exactly up to this depth and distance.
    pub fn margin(&self) -> f64 {
        self.margin
    }

    /// Rounds it took to settle.
    pub fn rounds(&self) -> usize {
        self.rounds
    }

    /// Number of primitives that contribute.
    pub fn primitives_left(&self, solid: &Solid) -> usize {
        let counts = |(n, node): (usize, &Node)| matches!(node, Node::Primitive(_)) && !self.bounds[n].is_empty();
        solid.nodes.iter().enumerate().filter(|x| counts(*x)).count()
    }
}

/// `next` for a bound that was `before` where it is the smaller one; both hold what counts of the node.
fn tighter(before: &Bound, next: Bound, volumes: Volumes) -> Bound {
    let next = if next.is_empty() { Bound::EMPTY } else { before.smaller(&next, volumes) };
    if next.is_empty() { Bound::EMPTY } else { next }
}

/// Levels with fewer nodes than this are not worth sharing: a bound takes a tenth of a microsecond.
const SHARED: usize = 1024;

/// In place of the root's parent.
const NO_PARENT: NodeId = NodeId::MAX;

/// The nodes under the root by their height above the leaves, and each one's parent.
struct Levels {
    by_height: Vec<Vec<NodeId>>,
    parent: Vec<NodeId>,
}

impl Levels {
    fn new(solid: &Solid) -> Self {
        let count = solid.nodes.len();
        let (mut parent, mut seen, mut height) = (vec![NO_PARENT; count], vec![false; count], vec![0; count]);
        seen[solid.root as usize] = true;
        // Children stand before their parents in the list, so one pass from the top reaches all.
        for n in (0..count).rev() {
            if let (true, Node::Op(_, children)) = (seen[n], &solid.nodes[n]) {
                for c in children {
                    seen[*c as usize] = true;
                    parent[*c as usize] = n as NodeId;
                }
            }
        }
        let mut by_height: Vec<Vec<NodeId>> = vec![];
        for n in (0..count).filter(|n| seen[*n]) {
            let h: usize = height[n];
            if by_height.len() <= h {
                by_height.resize_with(h + 1, Vec::new);
            }
            by_height[h].push(n as NodeId);
            if parent[n] != NO_PARENT {
                let above = &mut height[parent[n] as usize];
                *above = (*above).max(h + 1);
            }
        }
        Self { by_height, parent }
    }
}
