//! Stage 2: extended CSG octrees, where a solid is full, empty, or bounded by which primitives.
//!
//! M. Zeiller 1993. `tables` holds the paper's four decision tables as data, `local` classifies a voxel, `octree` builds
//! and refines, `approach` bounds when two moving voxels can meet, `walk` finds the pairs of primitives that two moving
//! octrees hand to stage 3, `snapshot` writes a model down and reads it back, `mass` integrates over a solid.
//!
//! Floor 5: imports `bound`, `motion`, `solid`, `math`.

pub mod approach;
pub mod local;
pub mod mass;
pub mod octree;
pub mod snapshot;
pub mod span;
pub mod tables;
#[cfg(test)]
pub(crate) mod testing;
pub mod walk;

pub use approach::Approach;
pub use octree::{Census, Eco, Limits, Node};
pub use snapshot::{Snapshot, SnapshotView};
pub use tables::{Kind, Meet, meet};
pub use walk::{Candidates, Detail, Element, Pair, PairKind, Walk};

use crate::bound::{SBounds, Volumes};
use crate::math::tolerance::{MODEL_MARGIN, WIDE_MARGIN};
use crate::solid::local::{Token, Truth};
use crate::solid::{Face, Primitive, Shape, Solid};
use glam::DVec3;
use std::sync::OnceLock;

/// A solid with what was preprocessed for it. Shared by all objects that use it.
#[derive(Debug)]
pub struct Model {
    /// The solid.
    pub solid: Solid,
    /// Its S-bounds, with a margin of `MODEL_MARGIN` times the radius.
    pub bounds: SBounds,
    /// Its extended CSG octree.
    pub eco: Eco,
    /// Bounding radius: that of the ball around the solid. 0 for an empty solid, infinite for an unbounded one.
    pub radius: f64,
    /// Farthest point of its box from the model's origin, and the radius of the box; 0 for an empty solid.
    pub extents: [f64; 2],
    /// Largest `Face::reach` of its faces: a cone's apex may lie far outside.
    pub face_reach: f64,
    /// Of a solid that is one ball about its origin and nothing else: the radius and the face.
    pub ball: Option<(f64, u32)>,
    /// S-bounds for clearances, with a margin of `WIDE_MARGIN` times the radius; taken when first asked for.
    wide: OnceLock<SBounds>,
}

impl Model {
    /// Preprocesses a solid.
    pub fn new(solid: Solid) -> Self {
        Self::with_limits(solid, Limits::default())
    }

    /// Preprocesses a solid; its octree is built to the given limits.
    pub fn with_limits(solid: Solid, limits: Limits) -> Self {
        Self::with_volumes(solid, limits, Volumes::default())
    }

    /// Preprocesses a solid with other bounding volumes for stage 1: for comparison, the answers are as good with any.
    pub fn with_volumes(solid: Solid, limits: Limits, volumes: Volumes) -> Self {
        let radius = SBounds::shared(&solid, 0.0, Volumes::default()).root().ball.radius.max(0.0);
        let margin = if radius.is_finite() { MODEL_MARGIN * radius } else { 0.0 };
        let bounds = SBounds::shared(&solid, margin, volumes);
        let eco = Eco::new(&solid, &bounds, limits);
        Self::of_parts(solid, bounds, eco, radius)
    }

    /// A model of its parts; the rest follows from them.
    fn of_parts(solid: Solid, bounds: SBounds, eco: Eco, radius: f64) -> Self {
        let face_reach = solid.faces.iter().map(Face::reach).fold(0.0, f64::max);
        let aabb = bounds.root().aabb;
        let extents = if aabb.is_empty() {
            [0.0; 2]
        } else {
            [aabb.min.abs().max(aabb.max.abs()), aabb.half()].map(DVec3::length)
        };
        let ball = match solid.whole() {
            Some(Primitive { shape: Shape::Sphere(ball), frame, first_face, .. }) if frame.position == DVec3::ZERO => {
                Some((ball.radius, *first_face))
            }
            _ => None,
        };
        Self { solid, bounds, eco, radius, extents, face_reach, ball, wide: OnceLock::new() }
    }

    /// S-bounds that tell the truth about f up to a depth or distance of `level` (a length), the closest there are; those
    /// with the widest margin where even that is less.
    pub fn bounds_for(&self, level: f64) -> &SBounds {
        if level <= self.margin() || self.radius.is_infinite() {
            return &self.bounds;
        }
        // On this thread alone: other searches may wait for them.
        let volumes = self.bounds.volumes();
        self.wide.get_or_init(|| SBounds::with_volumes(&self.solid, WIDE_MARGIN * self.radius, volumes))
    }

    /// Depths and distances (lengths) up to which bounds and octree tell the truth about f.
    pub fn margin(&self) -> f64 {
        self.bounds.margin()
    }

    /// Children of a grey or mixed node of this model's octree; see [`Eco::expand`].
    pub fn expand<'n>(&self, node: &'n Node) -> Option<&'n [Node; 8]> {
        self.eco.expand(&self.solid, &self.bounds, node)
    }

    /// Appends the literals (`solid::local`) that are open at depth `delta` over a node of this model's octree: what a
    /// contact of that depth in its cube depends on. True for a full node, false for an empty one. `delta` is a length of
    /// at most `margin()`.
    pub fn literals(&self, node: &Node, delta: f64, out: &mut Vec<Token>) -> Truth {
        debug_assert!(delta <= self.margin() || self.radius.is_infinite());
        match node.kind() {
            Kind::Full => Truth::True,
            Kind::Empty => Truth::False,
            _ if node.half.is_finite() => local::write_literals(&self.solid, node.terms(), &node.aabb(), delta, out),
            _ => crate::solid::local::write_tree(&self.solid, out),
        }
    }
}
