//! A model as plain data, and back: what the disk cache keeps of it.
//!
//! Three streams of plain values — tags (bytes), words (u32), numbers (f64, every bit of them), all little-endian — hold the
//! shapes and frames, the tree, the S-bounds and the octree in a fixed order. What follows from these by exact rules is
//! left out and made again by the same code that made it first: faces, boxes and balls of primitives, senses, normal form,
//! cubes and paths of nodes. So a model that comes back has the bits of the one that went, and can't contradict itself there.
//!
//! Only what is built at load is written: what searches decomposed since is left out, whatever was asked of the model
//! before. The octree goes on refining on demand as it does after a fresh build.
//!
//! Reading checks whatever would be followed as an index, a length or a level, and refuses NaN. It never panics, and takes
//! memory in proportion to the bytes that are there. That bounds and octree are those of the solid is not checked here: a
//! file's checksum and its key stand for that.

use super::local::Term;
use super::nodes::{DEEPEST, Node, cube_of};
use super::tables::NodeKind;
use super::{Eco, Model};
use crate::bound::{Bound, SBounds, Volumes};
use crate::math::{Aabb, Ball, Moments};
use crate::solid::primitive::{Checked, Sink, Source};
use crate::solid::{self, Label, Measured, Op, Primitive, Shape, Solid};
use bincode::{BorrowDecode, Encode};
use contactd_proto::Pose;
use glam::{DQuat, DVec3};
use smallvec::SmallVec;
use std::collections::HashMap;
use std::sync::OnceLock;

/// Levels of a tree at most: trees are walked by recursion. Twice what an import allows by default.
const LEVELS: usize = 2_000;

/// A rotation's length may be off by so much: what a normalised quaternion never is.
const ROTATION: f64 = 1e-6;

/// The bytes of a model.
#[derive(Clone, Debug, Default, PartialEq, Eq, Encode)]
pub struct Snapshot {
    names: Vec<String>,
    tags: Vec<u8>,
    words: Vec<u8>,
    numbers: Vec<u8>,
}

/// The bytes of a model where they lie in a file.
#[derive(Clone, Debug, BorrowDecode)]
pub struct SnapshotView<'a> {
    names: Vec<&'a str>,
    tags: &'a [u8],
    words: &'a [u8],
    numbers: &'a [u8],
}

impl Snapshot {
    /// The bytes of a model; `None` for a tree of so many levels that it would not be read again, and for bounds of other
    /// volumes than the default.
    pub fn of(model: &Model) -> Option<Self> {
        let solid = &model.solid;
        if levels(&solid.nodes) > LEVELS || model.bounds.volumes() != Volumes::default() {
            return None;
        }
        let mut out = Self::default();
        let mut names = HashMap::new();
        out.word(solid.primitives.len());
        for p in &solid.primitives {
            let name = *names.entry(p.label.name.as_str()).or_insert_with(|| {
                out.names.push(p.label.name.clone());
                out.names.len() - 1
            });
            out.word(name);
            out.word(p.label.line as usize);
            out.word(p.label.column as usize);
            out.word(p.label.mirrored.into());
            out.shape(&p.shape);
            out.numbers(p.frame.position.to_array());
            out.numbers(p.frame.rotation.to_array());
        }
        out.word(solid.nodes.len());
        for n in &solid.nodes {
            out.tree_node(n);
        }
        out.word(solid.root as usize);
        out.word(solid.measured.len());
        for (node, known) in &solid.measured {
            out.word(*node as usize);
            out.numbers(known.about.to_array());
            out.numbers(known.moments.0);
            out.number(known.doubt);
        }
        out.number(model.radius);
        out.number(model.bounds.margin());
        out.word(model.bounds.rounds());
        for n in 0..solid.nodes.len() {
            let Bound { aabb, ball } = model.bounds.node(n as u32);
            out.numbers(aabb.min.to_array());
            out.numbers(aabb.max.to_array());
            out.numbers(ball.center.to_array());
            out.number(ball.radius);
        }
        out.tags.push(model.octree.depth);
        out.octree_node(&model.octree.root);
        Some(out)
    }

    fn word(&mut self, word: usize) {
        // Counts and indices of a model are u32 throughout.
        self.words.extend_from_slice(&(word as u32).to_le_bytes());
    }

    fn number(&mut self, number: f64) {
        self.numbers.extend_from_slice(&number.to_le_bytes());
    }

    fn numbers<const N: usize>(&mut self, numbers: [f64; N]) {
        numbers.into_iter().for_each(|x| self.number(x));
    }

    fn shape(&mut self, shape: &Shape) {
        shape.geometry().write(self);
        self.tags.push(shape.tag());
    }

    fn tree_node(&mut self, node: &solid::Node) {
        match node {
            solid::Node::Empty => self.tags.push(NOTHING),
            solid::Node::Primitive(p) => {
                self.tags.push(PRIMITIVE);
                self.word(*p as usize);
            }
            solid::Node::Op(op, children) => {
                self.tags.push(match op {
                    Op::Union => UNION,
                    Op::Intersection => INTERSECTION,
                    Op::Difference => DIFFERENCE,
                });
                self.word(children.len());
                children.iter().for_each(|c| self.word(*c as usize));
            }
        }
    }

    /// A node and what was built of its subtree at load: there, and only there, a decomposed node is grey.
    fn octree_node(&mut self, node: &Node) {
        self.tags.push(node.kind as u8);
        self.numbers([node.f_lo, node.f_hi]);
        self.word(node.refs.len());
        self.word(node.terms.len());
        node.refs.iter().for_each(|r| self.word(*r as usize));
        for t in &node.terms {
            let [node, len] = t.words();
            self.word(node as usize);
            self.word(len as usize);
        }
        if node.kind == NodeKind::Grey {
            node.children().into_iter().flatten().for_each(|c| self.octree_node(c));
        }
    }
}

const NOTHING: u8 = 0;
const PRIMITIVE: u8 = 1;
const UNION: u8 = 2;
const INTERSECTION: u8 = 3;
const DIFFERENCE: u8 = 4;

impl SnapshotView<'_> {
    /// The model.
    ///
    /// # Errors
    /// What was expected of the bytes.
    pub fn restore(&self) -> Checked<Model> {
        let mut from = Streams { tags: self.tags, words: self.words, numbers: self.numbers };
        let solid = self.solid(&mut from)?;
        let radius = from.number()?;
        let margin = from.number()?;
        if !(margin >= 0.0 && margin.is_finite() && radius >= 0.0) {
            return Err("a radius and a margin");
        }
        let rounds = from.word()? as usize;
        let mut bounds = Vec::with_capacity(solid.nodes.len());
        for _ in &solid.nodes {
            let aabb = Aabb { min: from.vector()?, max: from.vector()? };
            bounds.push(Bound { aabb, ball: Ball { center: from.vector()?, radius: from.number()? } });
        }
        let bounds = SBounds::of_parts(bounds, solid.root, margin, rounds);
        let depth = from.tag()?;
        let (center, half) = cube_of(&bounds);
        let root = from.octree_node(&solid, center, half, 1)?;
        if !(from.tags.is_empty() && from.words.is_empty() && from.numbers.is_empty()) {
            return Err("nothing after the octree");
        }
        Ok(Model::of_parts(solid, bounds, Eco { root, depth }, radius))
    }

    fn solid(&self, from: &mut Streams<'_>) -> Checked<Solid> {
        let count = from.word()? as usize;
        let mut primitives = Vec::with_capacity(count.min(from.tags.len()));
        let mut faces = 0;
        for _ in 0..count {
            let name = *self.names.get(from.word()? as usize).ok_or("the name of a primitive")?;
            let (line, column) = (from.word()?, from.word()?);
            let mirrored = match from.word()? {
                0 => false,
                1 => true,
                _ => return Err("whether a primitive is mirrored"),
            };
            let label = Label { name: name.to_owned(), line, column, mirrored };
            let shape = from.shape()?;
            let frame = from.pose()?;
            let primitive = Primitive::new(shape, frame, label, faces);
            faces += primitive.faces.len() as u32;
            primitives.push(primitive);
        }
        let count = from.word()? as usize;
        let mut nodes = Vec::with_capacity(count.min(from.tags.len()));
        let (mut below, mut placed) = (vec![false; count.min(from.tags.len())], vec![false; primitives.len()]);
        for n in 0..count {
            let node = from.tree_node()?;
            match &node {
                solid::Node::Empty => {}
                solid::Node::Primitive(p) => take(&mut placed, *p, "each primitive at one leaf")?,
                solid::Node::Op(_, children) => {
                    for c in children {
                        take(&mut below[..n], *c, "each node below one other")?;
                    }
                }
            }
            nodes.push(node);
        }
        if placed.contains(&false) {
            return Err("a leaf for each primitive");
        }
        let root = from.word()?;
        if root as usize >= nodes.len() {
            return Err("a root among the nodes");
        }
        if levels(&nodes) > LEVELS {
            return Err("a tree of fewer levels");
        }
        let measured = from.measured(nodes.len())?;
        Ok(Solid::of_parts(primitives, nodes, root).with_measured(measured))
    }
}

/// Marks `i` as used; it must exist and not have been used before.
fn take(used: &mut [bool], i: u32, expected: &'static str) -> Checked<()> {
    match used.get_mut(i as usize) {
        Some(used) if !*used => {
            *used = true;
            Ok(())
        }
        _ => Err(expected),
    }
}

/// Levels of the deepest of these trees.
fn levels(nodes: &[solid::Node]) -> usize {
    let mut height = Vec::with_capacity(nodes.len());
    for node in nodes {
        height.push(match node {
            solid::Node::Op(_, children) => 1 + children.iter().map(|c| height[*c as usize]).max().unwrap_or(0),
            _ => 1,
        });
    }
    height.into_iter().max().unwrap_or(0)
}

impl Sink for Snapshot {
    fn word(&mut self, word: usize) {
        self.word(word);
    }

    fn number(&mut self, number: f64) {
        self.number(number);
    }
}

impl Source for Streams<'_> {
    fn word(&mut self) -> Checked<u32> {
        self.word()
    }

    fn finite(&mut self) -> Checked<f64> {
        self.finite()
    }

    fn left(&self) -> usize {
        self.numbers.len() / size_of::<f64>()
    }
}

/// What is still to be read.
struct Streams<'a> {
    tags: &'a [u8],
    words: &'a [u8],
    numbers: &'a [u8],
}

impl<'a> Streams<'a> {
    fn tag(&mut self) -> Checked<u8> {
        let (tag, rest) = self.tags.split_first().ok_or("more tags")?;
        self.tags = rest;
        Ok(*tag)
    }

    fn word(&mut self) -> Checked<u32> {
        let (word, rest) = self.words.split_first_chunk().ok_or("more words")?;
        self.words = rest;
        Ok(u32::from_le_bytes(*word))
    }

    /// The next `count` groups of N words.
    fn groups<const N: usize>(&mut self, count: usize) -> Checked<impl ExactSizeIterator<Item = [u32; N]> + 'a> {
        let bytes = count.checked_mul(4 * N).ok_or("more words")?;
        let (words, rest) = self.words.split_at_checked(bytes).ok_or("more words")?;
        self.words = rest;
        let word = |group: &[u8], i: usize| u32::from_le_bytes(std::array::from_fn(|k| group[4 * i + k]));
        Ok(words.chunks_exact(4 * N).map(move |group| std::array::from_fn(|i| word(group, i))))
    }

    /// The next `count` words.
    fn words(&mut self, count: usize) -> Checked<impl ExactSizeIterator<Item = u32> + 'a> {
        Ok(self.groups(count)?.map(|[word]| word))
    }

    /// A number that is one.
    fn number(&mut self) -> Checked<f64> {
        let (number, rest) = self.numbers.split_first_chunk().ok_or("more numbers")?;
        self.numbers = rest;
        let number = f64::from_le_bytes(*number);
        if number.is_nan() { Err("a number") } else { Ok(number) }
    }

    fn finite(&mut self) -> Checked<f64> {
        let number = self.number()?;
        if number.is_finite() { Ok(number) } else { Err("a finite number") }
    }

    fn vector(&mut self) -> Checked<DVec3> {
        Ok(DVec3::new(self.number()?, self.number()?, self.number()?))
    }

    fn finite_vector(&mut self) -> Checked<DVec3> {
        Ok(DVec3::new(self.finite()?, self.finite()?, self.finite()?))
    }

    fn pose(&mut self) -> Checked<Pose> {
        let position = self.finite_vector()?;
        let rotation = DQuat::from_xyzw(self.finite()?, self.finite()?, self.finite()?, self.finite()?);
        if (rotation.length() - 1.0).abs() > ROTATION {
            return Err("a rotation");
        }
        Ok(Pose { position, rotation })
    }

    fn shape(&mut self) -> Checked<Shape> {
        Shape::read(self.tag()?, self)
    }

    fn tree_node(&mut self) -> Checked<solid::Node> {
        let op = match self.tag()? {
            NOTHING => return Ok(solid::Node::Empty),
            PRIMITIVE => return Ok(solid::Node::Primitive(self.word()?)),
            UNION => Op::Union,
            INTERSECTION => Op::Intersection,
            DIFFERENCE => Op::Difference,
            _ => return Err("a kind of node"),
        };
        let operands = self.word()? as usize;
        if operands < 2 {
            return Err("two operands or more");
        }
        Ok(solid::Node::Op(op, self.words(operands)?.collect()))
    }

    /// What is known of the moments of some of as many nodes, in their order.
    fn measured(&mut self, nodes: usize) -> Checked<Vec<(u32, Measured)>> {
        let count = self.word()? as usize;
        let mut all: Vec<(u32, Measured)> = Vec::with_capacity(count.min(nodes));
        for _ in 0..count {
            let node = self.word()?;
            if node as usize >= nodes || all.last().is_some_and(|before| before.0 >= node) {
                return Err("measured nodes in order");
            }
            let about = self.vector()?;
            let mut moments = Moments::default();
            for x in &mut moments.0 {
                *x = self.finite()?;
            }
            let doubt = self.finite()?;
            if doubt < 0.0 {
                return Err("a doubt that is not negative");
            }
            all.push((node, Measured { about, moments, doubt }));
        }
        Ok(all)
    }

    fn octree_node(&mut self, solid: &Solid, center: DVec3, half: f64, path: u64) -> Checked<Node> {
        let kind = *NodeKind::ALL.get(self.tag()? as usize).ok_or("a kind of voxel")?;
        let (f_lo, f_hi) = (self.number()?, self.number()?);
        let (refs, terms) = (self.word()? as usize, self.word()? as usize);
        let least = match kind {
            NodeKind::PSurface | NodeKind::Full => 1,
            NodeKind::NSurface => 2,
            _ => 0,
        };
        let refs: Box<[u32]> = self.words(refs)?.collect();
        if refs.len() < least || refs.iter().any(|p| *p as usize >= solid.primitives.len()) {
            return Err("primitives of a voxel");
        }
        let terms: Box<[Term]> = self.groups(terms)?.map(Term::of_words).collect();
        if terms.is_empty() != matches!(kind, NodeKind::Full | NodeKind::Empty) {
            return Err("a tree in a voxel of the surface, and nowhere else");
        }
        well_nested(solid, &terms)?;
        let node = Node { center, half, f_lo, f_hi, kind, path, refs, terms, children: OnceLock::new() };
        if kind != NodeKind::Grey {
            return Ok(node);
        }
        if node.depth() >= DEEPEST || !half.is_finite() {
            return Err("fewer levels of the octree");
        }
        let mut children = Vec::with_capacity(8);
        for i in 0..8 {
            let (center, half) = node.cube_of_child(i);
            children.push(self.octree_node(solid, center, half, 8 * path + i as u64)?);
        }
        let children: Result<Box<[Node; 8]>, _> = children.try_into();
        Ok(Node { children: children.map_err(|_| "eight children")?.into(), ..node })
    }
}

/// The terms of a voxel are one tree in prefix order: each has its own below it and no others, leaves have none, and nodes
/// stand below later ones, as in the solid.
fn well_nested(solid: &Solid, terms: &[Term]) -> Checked<()> {
    const EXPECTED: &str = "the tree in a voxel";
    // Node and end of each term that is still open.
    let mut open: SmallVec<[(u32, usize); 16]> = SmallVec::new();
    for (i, t) in terms.iter().enumerate() {
        while open.last().is_some_and(|(_, end)| *end == i) {
            open.pop();
        }
        let end = i + 1 + t.len_below();
        let within = match open.last() {
            Some((above, outer)) => end <= *outer && t.node() < *above,
            None => i == 0 && end == terms.len(),
        };
        let node = solid.nodes.get(t.node() as usize).ok_or(EXPECTED)?;
        let fits = match node {
            solid::Node::Op(..) => !t.is_full(),
            solid::Node::Primitive(_) => t.len_below() == 0,
            solid::Node::Empty => false,
        };
        if !(within && fits) || open.len() > LEVELS {
            return Err(EXPECTED);
        }
        open.push((t.node(), end));
    }
    Ok(())
}
