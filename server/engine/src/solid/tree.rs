//! The CSG tree, in file order and in any arity, and its normal form without complements.

use crate::math::{Aabb, Moments};
use crate::solid::alike::Alike;
use crate::solid::faces::{Faces, Owners};
use crate::solid::formula;
use crate::solid::local::{self, LiteralId, Token, Truth};
use crate::solid::sense::Sense;
use crate::solid::{Primitive, Shape};
use contactd_proto::Pose;
use glam::DVec3;

/// Index of a node in `Solid::nodes`; children come before their parents.
pub type NodeId = u32;

/// A set operation. Regularised: what has no volume is not part of the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Op {
    /// Points of any child.
    Union,
    /// Points of every child.
    Intersection,
    /// Points of the first child and of none of the others.
    Difference,
}

/// A node of the tree.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Node {
    /// Nothing at all (an empty group).
    Empty,
    /// A primitive, by its index in file order.
    Primitive(u32),
    /// An operation on its children, in order.
    Op(Op, Vec<NodeId>),
}

/// Where a primitive stands in its source.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Label {
    /// The format's name of it: "sphere", "cylinder", "cube", "polyhedron" …
    pub name: String,
    /// 1-based line in the source; 0 when there is none.
    pub line: u32,
    /// 1-based column.
    pub column: u32,
    /// The source mirrors the primitive, and the mirror went into x of its frame: what its own axes call +x stands where
    /// the frame has −x.
    pub mirrored: bool,
}

/// What the maker of a solid knows of a node: its moments in closed form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// A point of the model's frame …
    pub about: DVec3,
    /// … about which the node has these moments,
    pub moments: Moments,
    /// and a bound of the volume that is in the node or in what was integrated and not in both: rounding of its faces, too.
    pub doubt: f64,
}

/// A solid: primitives in file order, and the tree over them. Immutable once built.
#[derive(Clone, Debug)]
pub struct Solid {
    /// Primitives in file order.
    pub primitives: Vec<Primitive>,
    /// Nodes, children before parents.
    pub nodes: Vec<Node>,
    /// Root node.
    pub root: NodeId,
    /// All faces, by id: those of primitive 0 first, in order.
    pub faces: Faces,
    /// The primitive that owns each face.
    pub face_owner: Owners,
    /// Sense of each primitive in this solid (every primitive stands at one leaf).
    pub senses: Vec<Sense>,
    /// The tree as and/or of literals (`local`), simplified where faces lie on each other (`alike`); empty when the solid is
    /// empty. Large meshes stand in it as divisions with parts (`prune`).
    pub normal_form: Vec<Token>,
    /// Faces that lie on or near each other.
    pub alike: Alike,
    /// True where the normal form is less than the tree says.
    pub simplified: bool,
    /// True where nothing with a volume is left of a tree that is not empty.
    vanishes: bool,
    /// True where the normal form has parts.
    pub(crate) has_parts: bool,
    /// Nodes of which the maker knows the moments, in order.
    pub(crate) measured: Vec<(NodeId, Measured)>,
}

/// Tokens up to which an expression with parts is simplified: all of it is looked at.
const MOST_SIMPLIFIED: usize = 100_000;

impl Solid {
    /// `local::prune` of an expression of this solid. Where few parts of large meshes are left they are written out, for `classify`
    /// to look at: so a small region has none.
    pub fn prune(
        &self,
        tokens: &[Token],
        out: &mut Vec<Token>,
        classify: &mut impl FnMut(LiteralId) -> Truth,
    ) -> Truth {
        let start = out.len();
        let truth = local::prune(tokens, out, classify);
        if !self.has_parts || truth != Truth::Open {
            return truth;
        }
        formula::open_few(start, out, &mut |part, out| self.open(part, out, classify))
    }

    /// True where parts are left of an expression, few enough to be written out.
    pub(crate) fn has_few_parts(&self, tokens: &[Token]) -> bool {
        self.has_parts && formula::are_few(formula::parts(tokens))
    }

    /// Appends an expression with all its parts written out.
    pub(crate) fn written_out(&self, tokens: &[Token], out: &mut Vec<Token>) -> Truth {
        formula::open_parts(tokens, out, &mut |part, out| self.open(part, out, &mut |_| Truth::Open))
    }

    /// Appends what a part says.
    fn open(&self, part: LiteralId, out: &mut Vec<Token>, classify: &mut impl FnMut(LiteralId) -> Truth) -> Truth {
        self.primitives[self.face_owner[part.face() as usize] as usize].open(part, out, classify)
    }

    /// Prunes an expression over the box `region` of the solid's own frame at depth `delta`, psi over the box being known to
    /// `rounding`.
    pub fn prune_to_box(
        &self,
        tokens: &[Token],
        region: &Aabb,
        (delta, rounding): (f64, f64),
        out: &mut Vec<Token>,
    ) -> Truth {
        let (c, e) = (region.center(), region.half());
        let faces = &self.faces;
        let truth = |id: LiteralId| {
            local::truth_of(id.sense(), local::face_span(&faces[id.face() as usize], c, e), delta, rounding)
        };
        self.prune(tokens, out, &mut { truth })
    }

    /// f at `x` (model frame) and the literal that decides it, the first of equals.
    pub fn deciding(&self, x: DVec3) -> (f64, LiteralId) {
        let mut psi = |face: u32| self.faces[face as usize].value(x);
        if !self.has_parts {
            return local::deciding(&self.normal_form, &mut psi);
        }
        // Literals below f hold there and those above do not, so what is left decides; how many parts are does not matter.
        let (f, mut coarse, mut left) = (self.value(x), Vec::new(), Vec::new());
        let mut at_f = |id: LiteralId| {
            let v = self.faces[id.face() as usize].value(x);
            local::truth_of(id.sense(), (v, v), -f, 4.0 * f64::EPSILON * (f.abs() + x.length()))
        };
        local::prune(&self.normal_form, &mut coarse, &mut at_f);
        if !coarse.is_empty() {
            formula::open_parts(&coarse, &mut left, &mut |part, out| self.open(part, out, &mut at_f));
        }
        let decided = if left.is_empty() { None } else { local::decided(&left, &mut psi) };
        decided.or_else(|| local::decided(&self.normal_form, &mut psi)).unwrap_or((f, LiteralId(0)))
    }

    /// What the maker knows of a node.
    pub fn measured(&self, node: NodeId) -> Option<&Measured> {
        let place = self.measured.binary_search_by_key(&node, |m| m.0).ok()?;
        Some(&self.measured[place].1)
    }

    /// The one primitive of a solid that is nothing else.
    pub fn whole(&self) -> Option<&Primitive> {
        match self.nodes[self.root as usize] {
            Node::Primitive(p) if self.senses[p as usize] == Sense::Positive => Some(&self.primitives[p as usize]),
            _ => None,
        }
    }

    /// The centre and the radius of a solid that is a ball, in its own frame, and its face.
    pub fn as_ball(&self) -> Option<(DVec3, f64, LiteralId)> {
        // Its number is not 0 where the tree once had more than is left of it.
        let whole = self.whole()?;
        let [face] = whole.faces.listed() else { return None };
        let (center, radius) = face.ball()?;
        Some((center, radius, LiteralId::new(whole.first_face, Sense::Positive)))
    }

    /// A solid of primitives in file order and of nodes, children before their parents; each primitive stands at one leaf and
    /// each node below one other. The rest follows from them.
    pub(crate) fn of_parts(primitives: Vec<Primitive>, nodes: Vec<Node>, root: NodeId) -> Self {
        let mut senses = vec![Sense::Positive; primitives.len()];
        let mut stack = vec![(root, Sense::Positive)];
        while let Some((n, sense)) = stack.pop() {
            match &nodes[n as usize] {
                Node::Empty => {}
                Node::Primitive(p) => senses[*p as usize] = sense,
                Node::Op(op, children) => {
                    for (i, c) in children.iter().enumerate() {
                        let flip = *op == Op::Difference && i > 0;
                        stack.push((*c, if flip { sense.flipped() } else { sense }));
                    }
                }
            }
        }
        let (mut faces, mut face_owner) = (Faces::default(), Owners::default());
        for (i, p) in primitives.iter().enumerate() {
            faces.extend(&p.faces);
            face_owner.extend(i as u32, &p.faces);
        }
        let has_parts = primitives.iter().any(|p| p.shape.formula().is_some_and(formula::Formula::is_divided));
        let (normal_form, alike) = (Vec::new(), Alike::default());
        let (simplified, vanishes) = (false, false);
        let mut solid = Self {
            primitives,
            nodes,
            root,
            faces,
            face_owner,
            senses,
            normal_form,
            alike,
            simplified,
            vanishes,
            has_parts,
            measured: Vec::new(),
        };
        let mut whole = Vec::new();
        write_tree(&solid, &mut whole);
        let sense = |f: u32| solid.senses[solid.face_owner[f as usize] as usize];
        solid.alike = Alike::of(&solid.faces, sense, &solid.aabb());
        if solid.alike.any_same() && !whole.is_empty() && (!solid.has_parts || whole.len() <= MOST_SIMPLIFIED) {
            let mut left = Vec::new();
            solid.vanishes = solid.alike.simplified(&whole, &mut left) == Truth::False;
            solid.simplified = left.len() < whole.len();
            if solid.simplified {
                whole = left;
            }
        }
        if !solid.simplified {
            solid.alike.slack = 0.0;
        }
        solid.normal_form = whole;
        solid
    }

    /// The same with what is known of some nodes, in their order.
    pub(crate) fn with_measured(self, measured: Vec<(NodeId, Measured)>) -> Self {
        Self { measured, ..self }
    }

    /// The smallest dimension of its primitives; infinite without any, and of such as have none.
    pub fn thinnest(&self) -> f64 {
        self.primitives.iter().map(|p| p.shape.geometry().smallest_dimension()).fold(f64::INFINITY, f64::min)
    }

    /// The box of the solid by the plain upward rule (no pruning); the bound floor does better.
    pub fn aabb(&self) -> Aabb {
        let mut boxes: Vec<Aabb> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            boxes.push(match node {
                Node::Empty => Aabb::EMPTY,
                Node::Primitive(p) => self.primitives[*p as usize].aabb,
                Node::Op(op, children) => {
                    let mut each = children.iter().map(|c| boxes[*c as usize]);
                    match op {
                        Op::Union => each.fold(Aabb::EMPTY, |a, b| a.union(&b)),
                        Op::Intersection => each.fold(Aabb::ALL, |a, b| a.intersection(&b)),
                        Op::Difference => each.next().unwrap_or(Aabb::EMPTY),
                    }
                }
            });
        }
        boxes[self.root as usize]
    }

    /// True when nothing is left of it: the root is an empty node, or all that the tree says has no volume (A − A).
    pub fn is_empty(&self) -> bool {
        self.vanishes || self.is_void()
    }

    /// True when the tree says nothing at all: the root is an empty node.
    pub fn is_void(&self) -> bool {
        self.nodes[self.root as usize] == Node::Empty
    }

    /// The tree as it stands, as and/or of literals (`local`); nothing for a void one. What `normal_form` says of depths, at
    /// greater length.
    pub fn literal_form(&self) -> Vec<Token> {
        let mut out = self.normal_form.clone();
        if self.simplified {
            out.clear();
            write_tree(self, &mut out);
        }
        out
    }
}

/// Builds a solid bottom-up, primitives in file order.
#[derive(Default, Debug)]
pub struct SolidBuilder {
    primitives: Vec<Primitive>,
    nodes: Vec<Node>,
    faces: u32,
    measured: Vec<(NodeId, Measured)>,
}

impl SolidBuilder {
    /// An empty builder.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds the next primitive in file order; returns its leaf.
    pub fn primitive(&mut self, shape: impl Into<Shape>, frame: Pose, label: Label) -> NodeId {
        let p = Primitive::new(shape.into(), frame, label, self.faces);
        self.faces += p.faces.len() as u32;
        self.primitives.push(p);
        self.push(Node::Primitive(self.primitives.len() as u32 - 1))
    }

    /// Adds a node without points.
    pub fn empty(&mut self) -> NodeId {
        self.push(Node::Empty)
    }

    /// Adds an operation on existing nodes, each of which may be used once. Empty children and single operands are
    /// folded away: ∅ ∪ A = A, ∅ ∩ A = ∅, A − ∅ = A, ∅ − A = ∅.
    pub fn operation(&mut self, op: Op, children: &[NodeId]) -> NodeId {
        let is_empty = |b: &Self, n: NodeId| b.nodes[n as usize] == Node::Empty;
        let kept: Vec<NodeId> = match op {
            Op::Union => children.iter().copied().filter(|c| !is_empty(self, *c)).collect(),
            Op::Intersection if children.iter().any(|c| is_empty(self, *c)) => vec![],
            Op::Intersection => children.to_vec(),
            Op::Difference => match children.first() {
                Some(first) if !is_empty(self, *first) => {
                    let rest = children[1..].iter().copied().filter(|c| !is_empty(self, *c));
                    std::iter::once(*first).chain(rest).collect()
                }
                _ => vec![],
            },
        };
        match kept.as_slice() {
            [] => self.empty(),
            [one] => *one,
            _ => self.push(Node::Op(op, kept)),
        }
    }

    /// Says what moments a node has, where that is known without a look at its faces.
    pub fn measured(&mut self, node: NodeId, measured: Measured) {
        self.measured.push((node, measured));
    }

    /// Finishes the solid with `root` on top.
    pub fn finish(mut self, root: NodeId) -> Solid {
        self.measured.sort_by_key(|m| m.0);
        self.measured.dedup_by_key(|m| m.0);
        Solid::of_parts(self.primitives, self.nodes, root).with_measured(self.measured)
    }

    fn push(&mut self, node: Node) -> NodeId {
        self.nodes.push(node);
        self.nodes.len() as NodeId - 1
    }
}

/// Appends the whole tree of `solid` to `out`; `False` (and nothing appended) for an empty solid.
pub fn write_tree(solid: &Solid, out: &mut Vec<Token>) -> Truth {
    write_node(solid, solid.root, Sense::Positive, &|_| true, out)
}

/// Appends the tree below `node`, complemented where `sense` is negative; nodes that are not alive count as empty.
pub fn write_node(
    solid: &Solid,
    node: NodeId,
    sense: Sense,
    alive: &impl Fn(NodeId) -> bool,
    out: &mut Vec<Token>,
) -> Truth {
    let kept = if alive(node) { &solid.nodes[node as usize] } else { &Node::Empty };
    match kept {
        Node::Empty if sense == Sense::Positive => Truth::False,
        Node::Empty => Truth::True,
        Node::Primitive(p) => solid.primitives[*p as usize].expression(sense, out, &mut |_| Truth::Open),
        Node::Op(op, children) => {
            let kind = match (op, sense) {
                (Op::Union, Sense::Positive) | (Op::Intersection | Op::Difference, Sense::Negative) => local::OR,
                _ => local::AND,
            };
            local::fold(kind, children.iter().enumerate(), out, |(i, child), out| {
                let s = if *op == Op::Difference && i > 0 { sense.flipped() } else { sense };
                write_node(solid, *child, s, alive, out)
            })
        }
    }
}
