//! The paper's four decision tables, as data.
//!
//! M. Zeiller 1993, tables 1 to 3: the kind of a voxel under a set operation from the kinds of its operands there;
//! table 4: what two voxels that may meet call for. Letters: G grey, F full, E empty, P p-surface, N n-surface, M mixed,
//! X cannot occur (mixed exists at the lowest level only, where nothing is grey).
//!
//! The tables treat grey and mixed alike but for the name: a grey result at the lowest level is mixed. So an octree may
//! be deepened later, and its mixed leaves turned grey, with the same result as if it had been built that deep at once.

use crate::solid::Op;

/// What an octree node is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum NodeKind {
    /// Inner node with eight children.
    Grey,
    /// Inside the solid.
    Full,
    /// Outside the solid.
    Empty,
    /// Partly inside; the full part lies in one primitive, the rest is empty.
    PSurface,
    /// Partly inside; the boundary is the surface of a subtracted primitive.
    NSurface,
    /// At the lowest level: more than one primitive contributes.
    Mixed,
}

impl NodeKind {
    /// All kinds in the tables' order.
    pub const ALL: [NodeKind; 6] =
        [NodeKind::Grey, NodeKind::Full, NodeKind::Empty, NodeKind::PSurface, NodeKind::NSurface, NodeKind::Mixed];

    /// The paper's word for it.
    pub fn name(self) -> &'static str {
        ["grey", "full", "empty", "p-surface", "n-surface", "mixed"][self as usize]
    }
}

/// What two voxels that may meet call for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meet {
    /// Nothing: one of them is empty.
    Skip,
    /// Their primitives are candidates.
    Pairs,
    /// Decompose: the larger node, or the one that can be.
    Branches,
}

type Cells<T> = [[T; 6]; 6];

const G: Option<NodeKind> = Some(NodeKind::Grey);
const F: Option<NodeKind> = Some(NodeKind::Full);
const E: Option<NodeKind> = Some(NodeKind::Empty);
const P: Option<NodeKind> = Some(NodeKind::PSurface);
const N: Option<NodeKind> = Some(NodeKind::NSurface);
const M: Option<NodeKind> = Some(NodeKind::Mixed);
const X: Option<NodeKind> = None;

/// Table 1, A ∪ B.
#[rustfmt::skip]
pub const UNION: Cells<Option<NodeKind>> = [
    // grey full empty p  n  mixed
    [  G,   F,   G,   G, G, X ], // grey
    [  F,   F,   F,   F, F, F ], // full
    [  G,   F,   E,   P, N, M ], // empty
    [  G,   F,   P,   G, G, M ], // p
    [  G,   F,   N,   G, G, M ], // n
    [  X,   F,   M,   M, M, M ], // mixed
];

/// Table 2, A ∩ B.
#[rustfmt::skip]
pub const INTERSECTION: Cells<Option<NodeKind>> = [
    // grey full empty p  n  mixed
    [  G,   G,   E,   G, G, X ], // grey
    [  G,   F,   E,   P, N, M ], // full
    [  E,   E,   E,   E, E, E ], // empty
    [  G,   P,   E,   G, G, M ], // p
    [  G,   N,   E,   G, G, M ], // n
    [  X,   M,   E,   M, M, M ], // mixed
];

/// Table 3, A − B: row B, column A.
#[rustfmt::skip]
pub const DIFFERENCE: Cells<Option<NodeKind>> = [
    // A: grey full empty p  n  mixed
    [  G,   G,   E,   G, G, X ], // B grey
    [  E,   E,   E,   E, E, E ], // B full
    [  G,   F,   E,   P, N, M ], // B empty
    [  G,   N,   E,   G, G, M ], // B p
    [  G,   P,   E,   G, G, M ], // B n
    [  X,   M,   E,   M, M, M ], // B mixed
];

const S: Meet = Meet::Skip;
const A: Meet = Meet::Pairs;
const B: Meet = Meet::Branches;

/// Table 4, A × B. The paper's "cannot occur" for mixed × grey assumes one common lowest level; octrees of their own
/// frames and depths do meet there, and the grey side is decomposed.
#[rustfmt::skip]
pub const COLLISION: Cells<Meet> = [
    // grey full empty p  n  mixed
    [  B,   B,   S,   B, B, B ], // grey
    [  B,   A,   S,   A, A, A ], // full
    [  S,   S,   S,   S, S, S ], // empty
    [  B,   A,   S,   A, A, A ], // p
    [  B,   A,   S,   A, A, A ], // n
    [  B,   A,   S,   A, A, A ], // mixed
];

/// The kind of `a op b`; `None` where the paper says it cannot occur.
pub fn combine(op: Op, a: NodeKind, b: NodeKind) -> Option<NodeKind> {
    match op {
        Op::Union => UNION[a as usize][b as usize],
        Op::Intersection => INTERSECTION[a as usize][b as usize],
        Op::Difference => DIFFERENCE[b as usize][a as usize],
    }
}

/// What two voxels of these kinds call for when they may meet.
pub fn meet(a: NodeKind, b: NodeKind) -> Meet {
    COLLISION[a as usize][b as usize]
}
