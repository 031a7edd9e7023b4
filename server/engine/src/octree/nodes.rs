//! The extended CSG octree of a model: cubes of its own frame, down to a limited resolution, finer where asked.
//!
//! M. Zeiller 1993. A node is grey (eight children), full, empty, p- or n-surface, or mixed, and refers to primitives as
//! `NodeKind` says; n-surface: first the positive primitive of the volume, then the negative one of the boundary. Building is
//! depth first to a depth that a budget of evaluated primitives sets, so that a part of thousands of primitives still
//! loads at once; `expand` decomposes mixed leaves further, on demand and for good.
//!
//! The levels built at load are shared between threads, subtrees of large octrees and the eight children of large nodes.
//!
//! Invariant: everything about a node is a function of the solid and the node's cube: it does not matter who asked for it,
//! or when, or on which thread. All that is said of a node holds for every depth and distance up to the margin of the S-bounds.
//! Not promised: the smallest octree; a voxel near an edge may count a primitive as partly in that is not.

use super::local::{Classifier, Term, whole};
use super::tables::NodeKind;
use crate::bound::SBounds;
use crate::math::{Aabb, halt};
use crate::solid::Solid;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::OnceLock;

/// How far an octree is built at load. Counts, not times: the same model gives the same octree everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Levels below the root.
    pub depth: u8,
    /// Primitives evaluated; the next level is left out when it could exceed this.
    pub work: usize,
    /// Nodes, of a few hundred bytes each; the next level is left out when it would exceed this.
    pub nodes: usize,
}

impl Limits {
    /// A depth and nothing else.
    pub fn to_depth(depth: u8) -> Self {
        Self { depth, work: usize::MAX, nodes: usize::MAX }
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self { depth: 6, work: 400_000, nodes: 32_768 }
    }
}

/// Smallest voxel, as a multiple of the margin: below it nothing is told apart any more.
const FINEST: f64 = 16.0;

/// Levels below the root at most: a path fits 64 bits.
pub(super) const DEEPEST: u8 = 20;

/// A node of an octree.
#[derive(Debug)]
pub struct Node {
    /// Centre of the cube, model frame.
    pub center: DVec3,
    /// Half its side.
    pub half: f64,
    /// Proven lower bound of the solid's f over the cube, as far as it tells within ±margin.
    pub f_lo: f64,
    /// Proven upper bound of f over the cube, as far as it tells within ±margin.
    pub f_hi: f64,
    pub(super) kind: NodeKind,
    pub(super) path: u64,
    pub(super) refs: Box<[u32]>,
    pub(super) terms: Box<[Term]>,
    pub(super) children: OnceLock<Box<[Node; 8]>>,
}

impl Node {
    /// NodeKind; a mixed node stays mixed when it is expanded on demand.
    pub fn kind(&self) -> NodeKind {
        self.kind
    }
    /// Levels below the root.
    pub fn depth(&self) -> u8 {
        ((63 - self.path.leading_zeros()) / 3) as u8
    }
    /// Id within the octree: 1 for the root, 8 times the parent's plus the index among its children. Depends on nothing but
    /// the cube, so it orders nodes the same way in every run.
    pub fn path(&self) -> u64 {
        self.path
    }
    /// The primitives that the kind refers to.
    pub fn refs(&self) -> &[u32] {
        &self.refs
    }
    /// What is left of the tree in the cube; empty when the node is full or empty.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }
    /// The cube.
    pub fn aabb(&self) -> Aabb {
        Aabb::around(self.center, DVec3::splat(self.half))
    }
    /// Cube of child `i`: its centre and half its side.
    pub(super) fn cube_of_child(&self, i: usize) -> (DVec3, f64) {
        let h = 0.5 * self.half;
        let sign = |bit: usize| if i >> bit & 1 == 0 { -h } else { h };
        (self.center + DVec3::new(sign(0), sign(1), sign(2)), h)
    }
    /// The child in whose cube a point of this cube lies, by its index.
    pub(super) fn child_at(&self, x: DVec3) -> usize {
        let d = x.cmpge(self.center);
        usize::from(d.x) + 2 * usize::from(d.y) + 4 * usize::from(d.z)
    }
    /// The children that exist already, from (−,−,−) to (+,+,+), x first.
    pub fn children(&self) -> Option<&[Node; 8]> {
        self.children.get().map(|c| &**c)
    }
}

/// The octree of a solid.
#[derive(Debug)]
pub struct Eco {
    pub(super) root: Node,
    pub(super) depth: u8,
}

/// Numbers of nodes by kind and depth.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Census {
    /// `by_depth[d][kind]`: nodes at depth d.
    pub by_depth: Vec<[usize; 6]>,
}

impl Census {
    /// Nodes of a kind.
    pub fn of(&self, kind: NodeKind) -> usize {
        self.by_depth.iter().map(|d| d[kind as usize]).sum()
    }
    /// All nodes.
    pub fn nodes(&self) -> usize {
        self.by_depth.iter().flatten().sum()
    }
}

impl Eco {
    /// Builds the octree of a solid inside the smallest cube around its S-bounds' root box. An unbounded solid has a
    /// single mixed node without limits, an empty one a single empty node.
    pub fn new(solid: &Solid, bounds: &SBounds, limits: Limits) -> Self {
        let (center, half) = cube_of(bounds);
        let terms = whole(solid, bounds);
        let (mut work, mut nodes) = (0, 1);
        let root = if half.is_finite() {
            classified(solid, bounds, &terms, center, half, 1, &mut work)
        } else {
            let refs = (0..solid.primitives.len() as u32).collect();
            let (kind, children) = (NodeKind::Mixed, OnceLock::new());
            Node { center, half, f_lo: -half, f_hi: half, kind, path: 1, refs, terms: terms.into(), children }
        };
        let mut octree = Self { root, depth: 0 };
        while octree.depth < limits.depth {
            let mut frontier = Frontier::default();
            frontier.add(&octree.root);
            let (next_work, next_nodes) = (8 * frontier.leaves, 8 * frontier.mixed);
            if next_nodes == 0 || work + next_work > limits.work || nodes + next_nodes > limits.nodes {
                break;
            }
            work += deepen(solid, bounds, &mut octree.root, next_work >= SHARED_LEVEL);
            nodes += next_nodes;
            octree.depth += 1;
        }
        octree
    }

    /// The root.
    pub fn root(&self) -> &Node {
        &self.root
    }

    /// Levels below the root that were built at load.
    pub fn depth(&self) -> u8 {
        self.depth
    }

    /// Children of a grey or mixed node of this octree, made now if need be; `None` for other kinds and for the smallest
    /// voxels.
    pub fn expand<'n>(&self, solid: &Solid, bounds: &SBounds, node: &'n Node) -> Option<&'n [Node; 8]> {
        if let Some(children) = node.children() {
            return Some(children);
        }
        halt::work(EXPANSION * node.terms.len());
        can_expand(bounds, node)
            .then(|| &**node.children.get_or_init(|| halt::to_the_end(|| children_of(solid, bounds, node))))
    }

    /// The deepest node that holds `x` (model frame) among those built so far; `None` outside the root.
    pub fn locate(&self, x: DVec3) -> Option<&Node> {
        if !self.root.aabb().contains(x) {
            return None;
        }
        let mut node = &self.root;
        while let Some(children) = node.children() {
            node = &children[node.child_at(x)];
        }
        Some(node)
    }

    /// Counts the nodes built so far; nodes with children count as grey.
    pub fn census(&self) -> Census {
        fn count(node: &Node, census: &mut Census) {
            let d = node.depth() as usize;
            if census.by_depth.len() <= d {
                census.by_depth.resize(d + 1, [0; 6]);
            }
            let kind = if node.children().is_some() { NodeKind::Grey } else { node.kind };
            census.by_depth[d][kind as usize] += 1;
            for c in node.children().into_iter().flatten() {
                count(c, census);
            }
        }
        let mut census = Census::default();
        count(&self.root, &mut census);
        census
    }
}

/// The smallest cube around the root's box, as centre and half its side.
pub(super) fn cube_of(bounds: &SBounds) -> (DVec3, f64) {
    let b = bounds.root().aabb;
    match () {
        () if b.is_empty() => (DVec3::ZERO, 0.0),
        () if b.is_finite() => {
            let c = b.center();
            (c, (b.max - c).max(c - b.min).max_element())
        }
        () => (DVec3::ZERO, f64::INFINITY),
    }
}

/// What a term of a node costs when its children are made, in looks at a face.
const EXPANSION: usize = 16;

fn can_expand(bounds: &SBounds, node: &Node) -> bool {
    matches!(node.kind, NodeKind::Grey | NodeKind::Mixed)
        && node.half.is_finite()
        && node.depth() < DEEPEST
        && node.half > FINEST * bounds.margin()
}

fn classified(
    solid: &Solid,
    bounds: &SBounds,
    terms: &[Term],
    center: DVec3,
    half: f64,
    path: u64,
    work: &mut usize,
) -> Node {
    halt::point();
    let (mut out, mut refs) = (vec![], vec![]);
    let mut classifier = Classifier { solid, bounds, center, half, work: 0 };
    let local = classifier.classify(terms, &mut out, &mut refs);
    *work += classifier.work;
    let margin = bounds.margin();
    Node {
        center,
        half,
        // What lies beyond the margin is known to lie there, and no more.
        f_lo: local.lo.min(margin),
        f_hi: local.hi.max(-margin),
        kind: local.kind,
        path,
        refs: refs.into(),
        terms: out.into(),
        children: OnceLock::new(),
    }
}

/// Child `i` of a node, and the primitives evaluated for it.
fn child(solid: &Solid, bounds: &SBounds, node: &Node, i: usize) -> (Node, usize) {
    let (center, half) = node.cube_of_child(i);
    let mut work = 0;
    let child = classified(solid, bounds, &node.terms, center, half, 8 * node.path + i as u64, &mut work);
    (child, work)
}

/// The children of a node, on the calling thread alone: a search asks for them within its `OnceLock`, where a thread that
/// waited for others could take up another search that asks for the same ones.
fn children_of(solid: &Solid, bounds: &SBounds, node: &Node) -> Box<[Node; 8]> {
    Box::new(std::array::from_fn(|i| child(solid, bounds, node, i).0))
}

/// Primitives to be evaluated for a level, from which it is shared between threads.
const SHARED_LEVEL: usize = 4096;

/// Levels whose nodes' subtrees are built side by side.
const SHARED_DEPTH: u8 = 3;

/// Terms of a node from which its children are made side by side.
const SHARED_TERMS: usize = 256;

/// Decomposes every mixed leaf once; `shared` between threads where that pays. Returns the primitives evaluated.
fn deepen(solid: &Solid, bounds: &SBounds, node: &mut Node, shared: bool) -> usize {
    let depth = node.depth();
    if let Some(children) = node.children.get_mut() {
        if shared && depth < SHARED_DEPTH {
            return children.par_iter_mut().map(|c| deepen(solid, bounds, c, true)).sum();
        }
        return children.iter_mut().map(|c| deepen(solid, bounds, c, shared)).sum();
    }
    if !can_expand(bounds, node) {
        return 0;
    }
    let each = |i| child(solid, bounds, node, i);
    let made: Vec<(Node, usize)> = if shared && node.terms.len() >= SHARED_TERMS {
        (0..8).into_par_iter().map(each).collect()
    } else {
        (0..8).map(each).collect()
    };
    let work = made.iter().map(|(_, work)| work).sum();
    let children: Vec<Node> = made.into_iter().map(|(child, _)| child).collect();
    let children: Box<[Node; 8]> = children.try_into().expect("eight children");
    node.children = OnceLock::from(children);
    node.kind = NodeKind::Grey;
    work
}

/// What one more level would decompose.
#[derive(Default)]
struct Frontier {
    /// Mixed leaves of the octree.
    mixed: usize,
    /// Leaves of their local trees: each is evaluated eight times on the next level.
    leaves: usize,
}

impl Frontier {
    fn add(&mut self, node: &Node) {
        if let Some(children) = node.children() {
            children.iter().for_each(|c| self.add(c));
        } else if node.kind == NodeKind::Mixed && node.half.is_finite() {
            self.mixed += 1;
            self.leaves += node.terms.iter().filter(|t| t.len_below() == 0).count();
        }
    }
}
