//! Two octrees walked together under their relative motion: table 4, and the candidates that it leaves.
//!
//! M. Zeiller 1993. A pair of nodes that can meet within the step (`approach`), inside the collision region of stage 1,
//! is skipped, decomposed or turned into candidates as table 4 says: *branches* decompose the larger node, or the one
//! that can be; *pairs* name primitives. Each pair of surfaces is named once, an n-surface together with the positive
//! primitive of its volume: p-pairs (two positive surfaces), n-pairs (one complemented), nn-pairs (two). The search goes
//! down with a queue of its own (`root`, `next`, `timed`) and makes cells of what it ends at (`contact/queue/slices`); the pairs are
//! the paper's list, for tests.
//!
//! Mixed leaves are decomposed further down to `Detail::finest`: an octree becomes finer where contacts happen. The walk
//! stops decomposing after `Detail::node_pairs` pairs; a grey node that is left then names, like a mixed one, the
//! primitives partly in it. So a limit costs sharpness, never a candidate.
//!
//! Invariant: where a point of both surfaces' neighbourhood (|f| up to the margin in both) exists at a time of the step,
//! the primitives that decide f_A and f_B there are a candidate pair.

use super::Model;
use super::approach::Approach;
use super::nodes::Node;
use super::tables::{Meet, NodeKind, meet};
use crate::bound::{CollisionRegion, Pruned};
use crate::math::halt;
use crate::motion::{Instant, Placed};
use crate::solid::{Sense, Solid};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

/// A surface that takes part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Element {
    /// Primitive of the surface.
    pub surface: u32,
    /// True when its complement takes part.
    pub complemented: bool,
    /// For a complemented surface: the positive primitive that gives the volume, where one does.
    pub volume: Option<u32>,
}

/// A pair of surfaces, one of A and one of B.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SurfacePair {
    /// Of A.
    pub a: Element,
    /// Of B.
    pub b: Element,
}

/// The paper's three kinds of pairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PairKind {
    /// Two positive surfaces.
    P,
    /// One complemented surface.
    N,
    /// Two complemented surfaces.
    Nn,
}

impl SurfacePair {
    /// p-, n- or nn-pair.
    pub fn kind(&self) -> PairKind {
        match (self.a.complemented, self.b.complemented) {
            (false, false) => PairKind::P,
            (true, true) => PairKind::Nn,
            _ => PairKind::N,
        }
    }
}

/// How finely to walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detail {
    /// Mixed leaves with a half side above this length are decomposed further; infinite: none is.
    pub finest: f64,
    /// Pairs of nodes to look at before decomposing stops.
    pub node_pairs: usize,
}

impl Default for Detail {
    fn default() -> Self {
        Self { finest: f64::INFINITY, node_pairs: 20_000 }
    }
}

/// What a walk found.
#[derive(Clone, Debug, Default)]
pub struct Candidates {
    /// Pairs in order, each once.
    pub pairs: Vec<SurfacePair>,
    /// Pairs of nodes looked at.
    pub node_pairs: usize,
}

impl Candidates {
    /// Numbers of p-, n- and nn-pairs.
    pub fn count(&self) -> [usize; 3] {
        let mut n = [0; 3];
        self.pairs.iter().for_each(|p| n[p.kind() as usize] += 1);
        n
    }
}

/// A pair of nodes, and a time before which they cannot meet: what a queue of stage 2 holds.
#[derive(Clone, Copy, Debug)]
pub struct NodePair<'m> {
    /// Node of A's octree.
    pub a: &'m Node,
    /// Node of B's octree.
    pub b: &'m Node,
    /// They don't meet before.
    pub time: f64,
}

/// What becomes of a pair of nodes.
#[derive(Clone, Copy, Debug)]
pub enum Next<'m> {
    /// Nothing can happen in it.
    Skip,
    /// Its primitives are candidates.
    Pairs,
    /// A's node is replaced by these.
    SplitA(&'m [Node; 8]),
    /// B's node is replaced by these.
    SplitB(&'m [Node; 8]),
}

/// A walk of two models' octrees over a step.
#[derive(Clone, Debug)]
pub struct Walk<'m> {
    a: &'m Model,
    b: &'m Model,
    approach: Approach,
    region: Option<Arc<CollisionRegion>>,
    margin: f64,
    detail: Detail,
}

impl<'m> Walk<'m> {
    /// A walk over the whole step: contacts of a depth or distance up to `margin` (a length, at most either model's
    /// margin) are not missed. Without `region` stage 1 is off.
    pub fn new(
        (a, pa): (&'m Model, Placed),
        (b, pb): (&'m Model, Placed),
        region: Option<Arc<CollisionRegion>>,
        margin: f64,
        detail: Detail,
    ) -> Self {
        let approach = Approach::new(pa, pb, margin);
        Self { a, b, approach, region, margin, detail }
    }

    /// The pair of roots, if they can meet in [start, end].
    pub fn root(&self, start: f64, end: f64) -> Option<NodePair<'m>> {
        let pair = NodePair { a: self.a.octree.root(), b: self.b.octree.root(), time: start };
        self.timed(pair, &self.at(start), end)
    }

    /// The instant at a time: what all children of a pair begin with.
    pub fn at(&self, time: f64) -> Instant {
        self.approach.relative().at(time)
    }

    /// The pair with its time, that of `at`, moved up to the earliest at which the two can meet; `None` when they cannot until
    /// `end`.
    pub fn timed(&self, pair: NodePair<'m>, at: &Instant, end: f64) -> Option<NodePair<'m>> {
        halt::work(16);
        let (a, b) = (pair.a, pair.b);
        let outside = |p: &Pruned, n: &Node| !p.aabb.meets(&n.aabb().grown(self.margin));
        if a.kind() == NodeKind::Empty || b.kind() == NodeKind::Empty {
            return None;
        }
        if self.region.as_ref().is_some_and(|r| outside(&r.a, a) || outside(&r.b, b)) {
            return None;
        }
        let time = self.approach.earliest_from((a.center, a.half), (b.center, b.half), at, end)?;
        Some(NodePair { time, ..pair })
    }

    /// What table 4 makes of a pair of nodes: the larger one of those that can be decomposed is.
    pub fn next(&self, pair: &NodePair<'m>) -> Next<'m> {
        let (a, b) = (pair.a, pair.b);
        let splits = |n: &Node| match n.kind() {
            NodeKind::Grey => true,
            NodeKind::Mixed => n.half > self.detail.finest,
            _ => false,
        };
        let split_a = splits(a).then(|| self.a.expand(a)).flatten();
        let split_b = splits(b).then(|| self.b.expand(b)).flatten();
        // A mixed leaf that may be finer counts as the grey node it is about to become.
        let kind = |n: &Node, split: bool| if split { NodeKind::Grey } else { n.kind() };
        match meet(kind(a, split_a.is_some()), kind(b, split_b.is_some())) {
            Meet::Skip => Next::Skip,
            Meet::Pairs => Next::Pairs,
            Meet::Branches => match (split_a, split_b) {
                (Some(children), None) => Next::SplitA(children),
                (None, Some(children)) => Next::SplitB(children),
                (Some(of_a), Some(of_b)) => {
                    if a.half >= b.half {
                        Next::SplitA(of_a)
                    } else {
                        Next::SplitB(of_b)
                    }
                }
                (None, None) => unreachable!("table 4 decomposes only beside a grey node, and those have children"),
            },
        }
    }

    /// All pairs of nodes at which the walk ends, in a fixed order, and the number of pairs looked at. Level by level, so
    /// that the limit on pairs cuts all branches at about the same depth.
    pub fn ends(&self) -> (Vec<NodePair<'m>>, usize) {
        let mut ends = vec![];
        let mut queue: VecDeque<NodePair> = self.root(0.0, 1.0).into_iter().collect();
        let mut count = 1;
        while let Some(pair) = queue.pop_front() {
            // Beyond the limit nothing is decomposed any more.
            let next = if count >= self.detail.node_pairs { Next::Pairs } else { self.next(&pair) };
            match next {
                Next::Skip => {}
                Next::Pairs => ends.push(pair),
                Next::SplitA(children) => {
                    count += children.len();
                    let at = self.at(pair.time);
                    queue.extend(children.iter().filter_map(|a| self.timed(NodePair { a, ..pair }, &at, 1.0)));
                }
                Next::SplitB(children) => {
                    count += children.len();
                    let at = self.at(pair.time);
                    queue.extend(children.iter().filter_map(|b| self.timed(NodePair { b, ..pair }, &at, 1.0)));
                }
            }
        }
        (ends, count)
    }

    /// The candidate pairs of primitives, each once.
    pub fn candidates(&self) -> Candidates {
        let (ends, node_pairs) = self.ends();
        let mut found: BTreeSet<SurfacePair> = BTreeSet::new();
        for end in &ends {
            for a in self.elements(&self.a.solid, end.a, self.region.as_ref().map(|r| &r.a)) {
                for b in self.elements(&self.b.solid, end.b, self.region.as_ref().map(|r| &r.b)) {
                    found.insert(SurfacePair { a, b });
                }
            }
        }
        // A pair of surfaces named with its volumes need not be named without.
        let named = |p: &SurfacePair| {
            let known = |e: Element| !e.complemented || e.volume.is_some();
            usize::from(known(p.a)) + usize::from(known(p.b))
        };
        let mut best: BTreeMap<(u32, u32), usize> = BTreeMap::new();
        for p in &found {
            let n = best.entry((p.a.surface, p.b.surface)).or_default();
            *n = (*n).max(named(p));
        }
        let pairs = found.into_iter().filter(|p| named(p) == best[&(p.a.surface, p.b.surface)]).collect();
        Candidates { pairs, node_pairs }
    }

    /// The surfaces of a node, without those that stage 1 has pruned.
    fn elements(&self, solid: &Solid, node: &Node, alive: Option<&Pruned>) -> Vec<Element> {
        let living = |p: &u32| alive.is_none_or(|a| a.primitive_alive(*p));
        if node.kind() == NodeKind::NSurface {
            let (volume, surface) = (node.refs()[0], node.refs()[1]);
            let element = Element { surface, complemented: true, volume: Some(volume) };
            return if living(&volume) && living(&surface) { vec![element] } else { vec![] };
        }
        let element =
            |p: &u32| Element { surface: *p, complemented: solid.senses[*p as usize] == Sense::Negative, volume: None };
        node.refs().iter().filter(|p| living(p)).map(element).collect()
    }
}
