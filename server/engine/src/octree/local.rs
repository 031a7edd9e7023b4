//! The tree as a voxel sees it: what is left of it there, and of which kind the voxel is.
//!
//! A local tree is a list of terms in prefix order, a term being a node of the solid's tree with the number of terms
//! below it. `classify` evaluates it over a voxel — leaves by distance bounds and S-bounds, operations by tables 1 to 3 —
//! and writes down what is left for the voxel's own children: operands that are empty or full there are gone, an
//! operation with one operand left is that operand. So the cost of classification falls with the size of the voxel.
//!
//! Invariant: over the voxel, f of what is left, clamped to ±margin, is the solid's f so clamped. Full and empty are
//! decided beyond ±margin, hence hold at every depth within it.

use super::span::{face_span, primitive_span};
use super::tables::{NodeKind, combine};
use crate::bound::SBounds;
use crate::math::Aabb;
use crate::solid::local::{AND, LiteralId, OR, Token, Truth, fold, truth_of};
use crate::solid::{Node, NodeId, Op, Sense, Solid};
use glam::DVec3;

/// A node of the solid's tree in a local tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Term {
    node: u32,
    len: u32,
}

/// Marks a primitive that is known to contain the voxel: it stands for the first operand of a difference.
const FULL: u32 = 1 << 31;

impl Term {
    /// Node of the solid's tree.
    pub fn node(self) -> NodeId {
        self.node & !FULL
    }
    /// True when it is a primitive known to contain the voxel.
    pub fn is_full(self) -> bool {
        self.node & FULL != 0
    }
    /// Number of terms below it, directly after it.
    pub fn len_below(self) -> usize {
        self.len as usize
    }
    /// The term as plain words.
    pub(super) fn words(self) -> [u32; 2] {
        [self.node, self.len]
    }
    /// The term of such words.
    pub(super) fn of_words([node, len]: [u32; 2]) -> Self {
        Self { node, len }
    }
}

/// The whole tree of a solid as a local tree; empty for an empty solid.
pub fn whole(solid: &Solid, bounds: &SBounds) -> Vec<Term> {
    fn write(solid: &Solid, bounds: &SBounds, n: NodeId, out: &mut Vec<Term>) {
        if bounds.node(n).is_empty() {
            return;
        }
        let head = out.len();
        out.push(Term { node: n, len: 0 });
        if let Node::Op(_, children) = &solid.nodes[n as usize] {
            for c in children {
                write(solid, bounds, *c, out);
            }
        }
        out[head].len = (out.len() - head - 1) as u32;
    }
    let mut out = vec![];
    write(solid, bounds, solid.root, &mut out);
    out
}

/// What `classify` knows of a local tree over a voxel.
#[derive(Clone, Copy, Debug)]
pub struct Local {
    /// At the lowest level: never grey.
    pub kind: NodeKind,
    /// Lower bound of f, meaningful up to the margin.
    pub lo: f64,
    /// Upper bound of f, meaningful down to −margin.
    pub hi: f64,
}

/// Classifies voxels of one solid.
pub struct Classifier<'a> {
    /// The solid.
    pub solid: &'a Solid,
    /// Its S-bounds; their margin is the classifier's.
    pub bounds: &'a SBounds,
    /// Centre of the voxel.
    pub center: DVec3,
    /// Half its side.
    pub half: f64,
    /// Leaves evaluated so far.
    pub work: usize,
}

const EMPTY: Local = Local { kind: NodeKind::Empty, lo: f64::INFINITY, hi: f64::INFINITY };

impl Classifier<'_> {
    /// Kind of the voxel for the tree at the head of `terms`. Appends to `out` what is left of it unless it is full or
    /// empty, and to `refs` the primitives the kind refers to.
    pub fn classify(&mut self, terms: &[Term], out: &mut Vec<Term>, refs: &mut Vec<u32>) -> Local {
        let Some(head) = terms.first() else { return EMPTY };
        let node = &self.solid.nodes[head.node() as usize];
        if head.is_full() {
            if let Node::Primitive(p) = node {
                refs.push(*p);
            }
            return Local { kind: NodeKind::Full, lo: f64::NEG_INFINITY, hi: f64::NEG_INFINITY };
        }
        let e = DVec3::splat(self.half);
        let bound = self.bounds.node(head.node());
        let voxel = Aabb::around(self.center, e);
        if !bound.aabb.meets(&voxel) || bound.ball.misses(&voxel) {
            return EMPTY;
        }
        match node {
            Node::Empty => EMPTY,
            Node::Primitive(p) => {
                self.work += 1;
                let (lo, hi) = primitive_span(&self.solid.primitives[*p as usize], self.center, e);
                let margin = self.bounds.margin();
                if lo > margin {
                    return EMPTY;
                }
                refs.push(*p);
                if hi < -margin {
                    return Local { kind: NodeKind::Full, lo, hi };
                }
                out.push(*head);
                Local { kind: NodeKind::PSurface, lo, hi }
            }
            Node::Op(op, _) => self.operation(*op, *head, &terms[1..1 + head.len_below()], out, refs),
        }
    }

    fn operation(&mut self, op: Op, head: Term, mut body: &[Term], out: &mut Vec<Term>, refs: &mut Vec<u32>) -> Local {
        let (out_start, refs_start) = (out.len(), refs.len());
        out.push(head);
        // acc: the operands so far; an operation's neutral element is not needed, the first operand starts it.
        let mut acc: Option<Local> = None;
        let mut kept = 0;
        while !body.is_empty() {
            let (operand, rest) = body.split_at(1 + body[0].len_below());
            body = rest;
            let (out_mark, refs_mark) = (out.len(), refs.len());
            let x = self.classify(operand, out, refs);
            let Some(a) = acc else {
                if x.kind == NodeKind::Empty && op == Op::Union {
                    continue;
                }
                acc = Some(x);
                kept = usize::from(out.len() > out_mark);
                if decides(op, x.kind, true) {
                    break;
                }
                if x.kind == NodeKind::Full && op == Op::Difference {
                    self.stand_in(operand, refs[refs_mark], out);
                    kept = 1;
                }
                continue;
            };
            // Mixed stands for grey at the lowest level, which is what every voxel is until it is decomposed.
            let kind = match combine(op, a.kind, x.kind) {
                Some(NodeKind::Grey) | None => NodeKind::Mixed,
                Some(kind) => kind,
            };
            merge_refs(op, a.kind, x.kind, kind, refs, refs_start, refs_mark);
            let (lo, hi) = match op {
                Op::Union => (a.lo.min(x.lo), a.hi.min(x.hi)),
                Op::Intersection => (a.lo.max(x.lo), a.hi.max(x.hi)),
                Op::Difference => (a.lo.max(-x.hi), a.hi.max(-x.lo)),
            };
            kept += usize::from(out.len() > out_mark);
            acc = Some(Local { kind, lo, hi });
            if decides(op, x.kind, false) {
                break;
            }
        }
        let result = acc.unwrap_or(EMPTY);
        if matches!(result.kind, NodeKind::Full | NodeKind::Empty) {
            out.truncate(out_start);
            if result.kind == NodeKind::Empty {
                refs.truncate(refs_start);
                return EMPTY;
            }
        } else if kept == 1 {
            out.remove(out_start);
        } else {
            out[out_start].len = (out.len() - out_start - 1) as u32;
        }
        result
    }

    /// A full first operand of a difference: one primitive that contains the voxel stands for it.
    fn stand_in(&self, operand: &[Term], primitive: u32, out: &mut Vec<Term>) {
        let leaf = operand.iter().find(|t| self.solid.nodes[t.node() as usize] == Node::Primitive(primitive));
        let node = leaf.map_or(operand[0].node, |t| t.node) | FULL;
        out.push(Term { node, len: 0 });
    }
}

/// True when an operand of this kind makes the rest irrelevant.
fn decides(op: Op, kind: NodeKind, first: bool) -> bool {
    match op {
        Op::Union => kind == NodeKind::Full,
        Op::Intersection => kind == NodeKind::Empty,
        Op::Difference => kind == if first { NodeKind::Empty } else { NodeKind::Full },
    }
}

/// References of `a op b` of kind `kind`, from those of a in `refs[start..mark]` and those of b in `refs[mark..]`.
fn merge_refs(op: Op, a: NodeKind, b: NodeKind, kind: NodeKind, refs: &mut Vec<u32>, start: usize, mark: usize) {
    match kind {
        NodeKind::Empty => refs.truncate(start),
        NodeKind::Full => match (a, b) {
            (NodeKind::Full, NodeKind::Full) => {}
            (NodeKind::Full, _) => refs.truncate(mark),
            _ => drop(refs.drain(start..mark)),
        },
        NodeKind::NSurface if op == Op::Difference && b == NodeKind::PSurface => {
            // Full − p: the volume of the one, the boundary of the other.
            refs.drain(start + 1..mark);
        }
        NodeKind::PSurface if op == Op::Difference && b == NodeKind::NSurface => {
            // Full − n: what the inner difference cut away from the subtracted volume comes back.
            let boundary = refs[mark + 1];
            refs.truncate(start);
            refs.push(boundary);
        }
        NodeKind::PSurface | NodeKind::NSurface => {
            if a == kind && b != kind {
                refs.truncate(mark);
            } else {
                refs.drain(start..mark);
            }
        }
        NodeKind::Mixed | NodeKind::Grey => {
            // The primitives partly in it: a full operand has none, an n-surface only its boundary.
            let partly = |kind: NodeKind, range: std::ops::Range<usize>| match kind {
                NodeKind::Full | NodeKind::Empty => range.end..range.end,
                NodeKind::NSurface => range.start + 1..range.end,
                _ => range,
            };
            let (ra, rb) = (partly(a, start..mark), partly(b, mark..refs.len()));
            refs.copy_within(rb.clone(), mark);
            refs.truncate(mark + rb.len());
            refs.drain(start..ra.start);
        }
    }
}

/// Appends to `out` the literals (`solid::local`) that are open at depth `delta` over the box `region`, for the local tree
/// at the head of `terms`; the box lies in the voxel of the local tree, and `delta` (a length) within its margin.
pub fn write_literals(solid: &Solid, terms: &[Term], region: &Aabb, delta: f64, out: &mut Vec<Token>) -> Truth {
    let (c, e) = (region.center(), region.half());
    opened(solid, terms, out, &mut |id| {
        // Those bounds lie outward of their rounding.
        truth_of(id.sense(), face_span(&solid.faces[id.face() as usize], c, e), delta, 0.0)
    })
}

/// Appends the literals (`solid::local`) that are open at depth 0 at the point `x`, faces within `tolerance` (a length) of it
/// being open, for the local tree at the head of `terms`; the point lies in the voxel of the local tree, and the tolerance
/// within its margin.
pub fn write_literals_at(solid: &Solid, terms: &[Term], x: DVec3, tolerance: f64, out: &mut Vec<Token>) -> Truth {
    opened(solid, terms, out, &mut |id| truth_at(solid, id, x, tolerance))
}

/// The expression of a local tree, few parts of large meshes written out (`Solid::prune`).
fn opened(solid: &Solid, terms: &[Term], out: &mut Vec<Token>, truth: &mut impl FnMut(LiteralId) -> Truth) -> Truth {
    if !solid.has_parts {
        return write(solid, terms, Sense::Positive, out, truth);
    }
    let mut left = Vec::new();
    match write(solid, terms, Sense::Positive, &mut left, truth) {
        Truth::Open => solid.prune(&left, out, truth),
        known => known,
    }
}

/// Truth of a literal at depth 0 at a point, its value there known to `tolerance`.
pub fn truth_at(solid: &Solid, id: LiteralId, x: DVec3, tolerance: f64) -> Truth {
    let value = solid.faces[id.face() as usize].value(x);
    truth_of(id.sense(), (value, value), 0.0, tolerance)
}

/// f at the point `x` of the local tree at the head of `terms`; infinite where the voxel is known to lie in or out of all
/// that decides there.
pub fn value(solid: &Solid, terms: &[Term], x: DVec3) -> f64 {
    let Some(head) = terms.first() else { return f64::INFINITY };
    if head.is_full() {
        return f64::NEG_INFINITY;
    }
    match &solid.nodes[head.node() as usize] {
        Node::Empty => f64::INFINITY,
        Node::Primitive(p) => solid.primitives[*p as usize].value(x),
        Node::Op(op, _) => op.value(operands(&terms[1..1 + head.len_below()]).map(|t| value(solid, t, x))),
    }
}

/// The operands in the body of an operation, each with what stands below it.
fn operands(mut body: &[Term]) -> impl Iterator<Item = &[Term]> {
    std::iter::from_fn(move || {
        let (operand, rest) = body.split_at(1 + body.first()?.len_below());
        body = rest;
        Some(operand)
    })
}

fn write(
    solid: &Solid,
    terms: &[Term],
    sense: Sense,
    out: &mut Vec<Token>,
    truth: &mut impl FnMut(LiteralId) -> Truth,
) -> Truth {
    let never = if sense == Sense::Positive { Truth::False } else { Truth::True };
    let Some(head) = terms.first() else { return never };
    if head.is_full() {
        return if sense == Sense::Positive { Truth::True } else { Truth::False };
    }
    match &solid.nodes[head.node() as usize] {
        Node::Empty => never,
        Node::Primitive(p) => solid.primitives[*p as usize].expression(sense, out, truth),
        Node::Op(op, _) => {
            let kind = match (op, sense) {
                (Op::Union, Sense::Positive) | (Op::Intersection | Op::Difference, Sense::Negative) => OR,
                _ => AND,
            };
            fold(kind, operands(&terms[1..1 + head.len_below()]).enumerate(), out, |(i, operand), out| {
                let s = if *op == Op::Difference && i > 0 { sense.flipped() } else { sense };
                write(solid, operand, s, out, truth)
            })
        }
    }
}
