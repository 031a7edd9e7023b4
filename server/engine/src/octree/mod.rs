//! Stage 2: extended CSG octrees, where a solid is full, empty, or bounded by which primitives.
//!
//! M. Zeiller 1993. `tables` holds the paper's four decision tables as data, `local` classifies a voxel, `octree` builds
//! and refines, `approach` bounds when two moving voxels can meet, `walk` finds the pairs of primitives that two moving
//! octrees hand to stage 3, `snapshot` writes a model down and reads it back, `mass` integrates over a solid. A `Model` holds
//! a solid with all that is worked out once for it, and tells f at a point by its octree.
//!
//! Floor 4: imports `bound`, `motion`, `solid`, `math`.

pub mod approach;
pub mod local;
pub mod mass;
pub mod nodes;
pub mod snapshot;
pub mod span;
pub mod tables;
#[cfg(test)]
pub(crate) mod testing;
pub mod walk;

pub use approach::Approach;
pub use nodes::{Census, Eco, Limits, Node};
pub use snapshot::{Snapshot, SnapshotView};
pub use tables::{Meet, NodeKind, meet};
pub use walk::{Candidates, Detail, Element, PairKind, SurfacePair, Walk};

use crate::bound::{SBounds, Volumes};
use crate::math::halt;
use crate::math::tolerance::{MODEL_MARGIN, UNBOUNDED_MARGIN, WIDE_MARGIN};
use crate::solid;
use crate::solid::local::{LiteralId, Token, Truth};
use crate::solid::revolution::Revolution;
use crate::solid::surface::Axis;
use crate::solid::{Face, Parts, Sense, Solid};
use glam::DVec3;
use std::sync::OnceLock;

/// Trees of no more primitives are evaluated as they are: to find the voxel of a point would cost more.
const FEW_PRIMITIVES: usize = 8;
/// A voxel with more terms is decomposed where f is asked for in it: that is done once, and every later point there is
/// cheaper …
const MANY_TERMS: usize = 64;
/// … unless the last decomposition left it more than this part of its parent's terms: where many faces meet, smaller voxels
/// would have as many.
const WORTHWHILE: f64 = 0.75;

/// A solid with what was preprocessed for it. Shared by all objects that use it.
#[derive(Debug)]
pub struct Model {
    /// The solid.
    pub solid: Solid,
    /// Its S-bounds, with a margin of `MODEL_MARGIN` times the radius, or of how far faces lie from the origin where
    /// there is none.
    pub bounds: SBounds,
    /// Its extended CSG octree.
    pub octree: Eco,
    /// Bounding radius: that of the ball around the solid. 0 for an empty solid, infinite for an unbounded one.
    pub radius: f64,
    /// Farthest point of its box from the model's origin, and the radius of the box; 0 for an empty solid.
    pub extents: [f64; 2],
    /// Largest `Face::reach` of its faces: a cone's apex may lie far outside.
    pub face_reach: f64,
    /// Of a solid that is one ball about its origin and nothing else: the radius and the face.
    pub ball: Option<(f64, u32)>,
    /// True when something is subtracted anywhere in it.
    pub hollow: bool,
    /// Smallest radius of a sphere or cylinder that is subtracted; infinite where none is.
    pub narrowest: f64,
    /// Its parts, where it is a union of convex primitives less others.
    pub parts: Option<Parts>,
    /// About what it may be symmetric.
    revolution: Option<Revolution>,
    /// S-bounds for clearances, with a margin of `WIDE_MARGIN` times the radius, or `UNBOUNDED_MARGIN`; taken when
    /// first asked for.
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
        // Without a radius by where the faces are.
        let size = if radius.is_finite() { radius } else { solid.faces.reach() };
        let margin = MODEL_MARGIN * size;
        let bounds = SBounds::shared(&solid, margin, volumes);
        let octree = Eco::new(&solid, &bounds, limits);
        Self::of_parts(solid, bounds, octree, radius)
    }

    /// A model of its parts; the rest follows from them.
    fn of_parts(solid: Solid, bounds: SBounds, octree: Eco, radius: f64) -> Self {
        let face_reach = solid.faces.reach();
        let aabb = bounds.root().aabb;
        let extents = if aabb.is_empty() {
            [0.0; 2]
        } else {
            [aabb.min.abs().max(aabb.max.abs()), aabb.half()].map(DVec3::length)
        };
        let ball = match solid.whole() {
            Some(p) if p.frame.position == DVec3::ZERO => p.shape.convex().ball().map(|radius| (radius, p.first_face)),
            _ => None,
        };
        let hollow = solid.senses.contains(&Sense::Negative);
        let radius_of = |(i, face): (usize, &Face)| {
            let subtracted = solid.senses[solid.face_owner[i] as usize] == Sense::Negative;
            face.radius().filter(|_| subtracted).unwrap_or(f64::INFINITY)
        };
        let narrowest = solid.faces.kept().map(radius_of).fold(f64::INFINITY, f64::min);
        let parts = Parts::of(&solid);
        let revolution = Revolution::of(&solid, radius);
        let wide = OnceLock::new();
        Self { solid, bounds, octree, radius, extents, face_reach, ball, hollow, narrowest, parts, revolution, wide }
    }

    /// What lengths of a pair are measured by: the bounding radius, 0 of an unbounded solid, whose partner has one.
    pub fn size(&self) -> f64 {
        if self.radius.is_finite() { self.radius } else { 0.0 }
    }

    /// S-bounds that tell the truth about f up to a depth or distance of `level` (a length), the closest there are; those
    /// with the widest margin where even that is less.
    pub fn bounds_for(&self, level: f64) -> &SBounds {
        if level <= self.margin() {
            return &self.bounds;
        }
        // On this thread alone: other searches may wait for them.
        let volumes = self.bounds.volumes();
        let margin = if self.radius.is_finite() { WIDE_MARGIN * self.radius } else { UNBOUNDED_MARGIN };
        self.wide.get_or_init(|| halt::to_the_end(|| SBounds::with_volumes(&self.solid, margin, volumes)))
    }

    /// Depths and distances (lengths) up to which bounds and octree tell the truth about f.
    pub fn margin(&self) -> f64 {
        self.bounds.margin()
    }

    /// Children of a grey or mixed node of this model's octree; see [`Eco::expand`].
    pub fn expand<'n>(&self, node: &'n Node) -> Option<&'n [Node; 8]> {
        self.octree.expand(&self.solid, &self.bounds, node)
    }

    /// The axis about which every face of the solid is symmetric, where there is one. A solid of spheres alone about one
    /// centre has any axis through it: `along` chooses.
    pub fn axis_of_revolution(&self, along: DVec3) -> Option<Axis> {
        self.revolution?.axis(&self.solid, along, self.radius)
    }

    /// f at `x` (model frame), to be compared with `level` (a length of either sign) or with −`level`: where |f| is larger,
    /// only that it is, and its sign, are sure to be right. So of a large tree no more is evaluated than the octree has left of
    /// it in the voxel at `x`, however much there is elsewhere. The comparison ends as with the whole tree's f, whatever was
    /// decomposed before.
    pub fn value_within(&self, x: DVec3, level: f64) -> f64 {
        if !self.keeps(level) {
            return self.solid.value(x);
        }
        match self.voxel(x) {
            Some(node) if node.kind() == NodeKind::Full => f64::NEG_INFINITY,
            Some(node) => local::value(&self.solid, node.terms(), x),
            None => f64::INFINITY,
        }
    }

    /// f at `x` (model frame) as the whole tree has it. Near the surface the octree tells it.
    pub fn value(&self, x: DVec3) -> f64 {
        if self.keeps(0.0) {
            let near = self.value_within(x, 0.0);
            if self.keeps(near) {
                return near;
            }
        }
        self.solid.value(x)
    }

    /// Appends the literals (`solid::local`) that pass within `tolerance` (a length) of `x` (model frame) and that the solid
    /// depends on there. True deeper inside than that, false farther outside.
    pub fn literals_at(&self, x: DVec3, tolerance: f64, out: &mut Vec<Token>) -> Truth {
        if !self.keeps(tolerance) {
            let mut truth = |id: LiteralId| local::truth_at(&self.solid, id, x, tolerance);
            return self.solid.prune(&self.solid.normal_form, out, &mut truth);
        }
        match self.voxel(x) {
            Some(node) if node.kind() == NodeKind::Full => Truth::True,
            Some(node) if self.solid.simplified => {
                let mut near = Vec::new();
                match local::write_literals_at(&self.solid, node.terms(), x, tolerance, &mut near) {
                    Truth::Open => self.solid.alike.simplified(&near, out),
                    truth => truth,
                }
            }
            Some(node) => local::write_literals_at(&self.solid, node.terms(), x, tolerance, out),
            None => Truth::False,
        }
    }

    /// f at `x` (model frame) and the literal that decides it, the first of equals.
    pub fn deciding(&self, x: DVec3) -> (f64, LiteralId) {
        let mut psi = |face: u32| self.solid.faces[face as usize].value(x);
        let (mut near, tolerance) = (Vec::new(), 0.25 * self.margin());
        if self.keeps(tolerance)
            && self.literals_at(x, tolerance, &mut near) == Truth::Open
            && let Some(found) = solid::local::decided(&near, &mut psi)
        {
            return found;
        }
        self.solid.deciding(x)
    }

    /// True when the octree is asked for f up to `level` (a length of either sign). Half the margin is left to rounding.
    fn keeps(&self, level: f64) -> bool {
        2.0 * level.abs() < self.margin() && self.solid.primitives.len() > FEW_PRIMITIVES
    }

    /// The octree's voxel at `x`, decomposed where many terms are left in it; `None` outside.
    fn voxel(&self, x: DVec3) -> Option<&Node> {
        let mut node = self.octree.root();
        if !node.aabb().contains(x) {
            return None;
        }
        let mut most = usize::MAX;
        loop {
            let terms = node.terms().len();
            halt::work(2);
            let children = match node.children() {
                None if terms > MANY_TERMS && terms <= most => self.expand(node),
                children => children,
            };
            let Some(children) = children else { return Some(node) };
            most = (WORTHWHILE * terms as f64) as usize;
            node = &children[node.child_at(x)];
        }
    }

    /// Appends the literals (`solid::local`) that are open at depth `delta` over a node of this model's octree: what a
    /// contact of that depth in its cube depends on. True for a full node, false for an empty one. `delta` is a length of
    /// at most `margin()`.
    pub fn literals(&self, node: &Node, delta: f64, out: &mut Vec<Token>) -> Truth {
        debug_assert!(delta <= self.margin() || self.radius.is_infinite());
        match node.kind() {
            NodeKind::Full => Truth::True,
            NodeKind::Empty => Truth::False,
            _ if node.half.is_finite() => local::write_literals(&self.solid, node.terms(), &node.aabb(), delta, out),
            _ => solid::write_tree(&self.solid, out),
        }
    }
}
