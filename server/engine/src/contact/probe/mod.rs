//! A point or a ray against one solid: on which side the point is, certified bounds of its signed distance, the ray's first hit.
//!
//! Nothing is sampled. A ray is cut into stretches; over each the tree is reduced by bounds of its literals along the ray (`along`,
//! `ray`), as cells are in the search. The distance of a point is a branch and bound over parts of the solid, or of its complement
//! (`near`), as the distance of two bodies is (`contact/distance`). docs/queries.md has the promises and the formulas.
//!
//! Each answer depends on the model, the pose, the point or ray and the options alone: batches are shared between threads, in order.

mod along;
mod foot;
mod near;
mod point;
mod ray;

use crate::contact::query::outcome::NO_FACE;
use crate::octree::Model;
use crate::solid::Sense;
use crate::solid::local::{self, LiteralId, Truth};
use contactd_proto::Pose;
use glam::DVec3;
use rayon::prelude::*;
use smallvec::SmallVec;

/// A model where it stands.
#[derive(Clone, Copy, Debug)]
pub struct PosedModel<'a> {
    /// The model.
    pub model: &'a Model,
    /// The model's frame in the world.
    pub pose: Pose,
}

pub use contactd_proto::query::{DEFAULT_QUERY_LIMIT as DEFAULT_LIMIT, PointOptions, RayOptions, Side};

/// A ray: origin + t·direction for 0 <= t <= length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it begins, world frame.
    pub origin: DVec3,
    /// Where it goes: a unit vector, world axes.
    pub direction: DVec3,
    /// How far it goes: a length >= 0; infinite only against solids with bounds.
    pub length: f64,
}

impl Ray {
    /// The point at a parameter.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }
}

/// A point against a solid. The signed distance is that to the surface, negative inside; it is infinite for an empty solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointAnswer {
    /// On which side it is.
    pub side: Side,
    /// Proven: the signed distance is no less, what is nowhere deeper than rounding left out (docs/queries.md). A length.
    pub lower: f64,
    /// Proven: the signed distance is no more. A length.
    pub upper: f64,
    /// The point of the surface that was found nearest, world frame: no farther off than the bound of the larger size tells. NaN where
    /// none was found.
    pub nearest: DVec3,
    /// Faces of the solid there, by face id within its model; `NO_FACE` fills.
    pub faces: [u32; 3],
    /// True when the bounds are as near to each other as was asked, or as rounding lets them be.
    pub is_settled: bool,
    /// Parts of the solid that were looked at.
    pub cells: u64,
}

/// Where a ray first crosses a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Proven: nothing of the ray before this parameter is deeper in the solid than `RayOptions::depth`, or, of a ray that leaves,
    /// deeper out of it. A length along the ray.
    pub lower: f64,
    /// Where the ray meets the surface, to rounding: `lower` <= `t` <= `upper`.
    pub t: f64,
    /// Proven: at this parameter the ray is in the solid, or, of a ray that leaves, out of it.
    pub upper: f64,
    /// The point at `t`, world frame.
    pub point: DVec3,
    /// Unit normal of the surface there, out of the solid, world axes.
    pub normal: DVec3,
    /// The face that is crossed, by its id within the model.
    pub face: u32,
    /// The primitive that owns it, by its index in the model.
    pub primitive: u32,
    /// All faces that meet there, three at most; `NO_FACE` fills.
    pub faces: [u32; 3],
    /// True when the ray begins in the solid and leaves it here.
    pub is_leaving: bool,
}

/// What becomes of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RayOutcome {
    /// It crosses the surface.
    Hit(RayHit),
    /// Proven: it goes through no surface, all of it being outside, or inside where `is_inside`.
    Miss {
        /// True when it begins in the solid and does not leave it.
        is_inside: bool,
    },
    /// The limit of work was met, or the ray comes from so far away that rounding hides whether it meets the solid.
    Undecided {
        /// Proven: up to this parameter it crosses no surface. A length along the ray.
        until: f64,
    },
}

/// A ray against a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayAnswer {
    /// What becomes of it.
    pub outcome: RayOutcome,
    /// Stretches that were looked at.
    pub cells: u64,
}

/// Points against a solid, in order.
pub fn points(solid: &PosedModel, points: &[DVec3], options: &PointOptions) -> Vec<PointAnswer> {
    shared(points, |x| point::of_point(solid, *x, options))
}

/// Rays against a solid, in order.
pub fn rays(solid: &PosedModel, rays: &[Ray], options: &RayOptions) -> Vec<RayAnswer> {
    shared(rays, |x| ray::of_ray(solid, x, options))
}

/// Questions below which no threads are asked.
const FEW: usize = 32;

/// Answers in the order of their questions.
fn shared<Q: Sync, A: Send>(questions: &[Q], answer: impl Fn(&Q) -> A + Send + Sync) -> Vec<A> {
    if questions.len() < FEW {
        return questions.iter().map(answer).collect();
    }
    questions.par_iter().with_min_len(FEW / 4).map(answer).collect()
}

/// Units in the last place that rounding may cost psi, a tangent, a support or a point that was carried into the model's frame, of the
/// size of the numbers at hand: docs/accuracy.md counts at most 100 for each.
const ROUNDING: f64 = 300.0 * f64::EPSILON;

/// What rounding may do to a bound, a length, from the size of the coordinates at hand.
fn rounding(model: &Model, size: f64) -> f64 {
    let own = if model.extents[0].is_finite() { model.extents[0] } else { 0.0 };
    ROUNDING * (size + own + model.face_reach) + model.solid.alike.slack
}

/// A literal's value and gradient as if it were psi <= 0.
fn literal_at(model: &Model, id: LiteralId, x: DVec3) -> (f64, DVec3) {
    crate::contact::distance::part::literal_at(&model.solid.faces[id.face() as usize], id.sense(), x)
}

/// Faces within a tolerance of a point of the surface, the deciding one first, then by id.
fn faces_at(model: &Model, x: DVec3, tolerance: f64) -> SmallVec<[LiteralId; 8]> {
    let mut near = Vec::new();
    let mut found: SmallVec<[LiteralId; 8]> = SmallVec::new();
    found.push(model.deciding(x).1);
    if model.literals_at(x, tolerance, &mut near) == Truth::Open {
        let mut others: Vec<LiteralId> = local::literals(&near).filter(|id| *id != found[0]).collect();
        others.sort_unstable();
        others.dedup();
        found.extend(others);
    }
    found
}

/// Three ids of faces at most, ascending.
fn three(found: &[LiteralId]) -> [u32; 3] {
    let mut faces = [NO_FACE; 3];
    let mut ids: SmallVec<[u32; 8]> = SmallVec::new();
    for id in found {
        if !ids.contains(&id.face()) {
            ids.push(id.face());
        }
    }
    ids.truncate(3);
    ids.sort_unstable();
    faces.iter_mut().zip(ids).for_each(|(to, id)| *to = id);
    faces
}

/// The part of a solid or of its complement that a search is after.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sought {
    /// Points of the solid.
    Solid,
    /// Points outside of it.
    Complement,
}

impl Sought {
    /// f as it is negative in what is sought.
    fn value(self, model: &Model, x: DVec3) -> f64 {
        match self {
            Sought::Solid => model.value(x),
            Sought::Complement => -model.value(x),
        }
    }

    /// An expression of the solid as one of what is sought.
    fn expression(self, tokens: Vec<local::Token>) -> Vec<local::Token> {
        match self {
            Sought::Solid => tokens,
            Sought::Complement => local::complement(&tokens),
        }
    }

    /// What is known of the solid as what is known of what is sought.
    fn truth(self, truth: Truth) -> Truth {
        match (self, truth) {
            (Sought::Solid, truth) | (_, truth @ Truth::Open) => truth,
            (Sought::Complement, Truth::True) => Truth::False,
            (Sought::Complement, Truth::False) => Truth::True,
        }
    }

    /// A depth in what is sought as a depth in the solid.
    fn depth(self, depth: f64) -> f64 {
        match self {
            Sought::Solid => depth,
            Sought::Complement => -depth,
        }
    }

    /// A literal of the solid as one of what is sought.
    fn literal(self, id: LiteralId) -> LiteralId {
        let flipped: Sense = id.sense().flipped();
        match self {
            Sought::Solid => id,
            Sought::Complement => LiteralId::new(id.face(), flipped),
        }
    }
}

/// Appends what a voxel of the octree has of what is sought at a depth, faces that lie on each other being one.
fn open_voxel(model: &Model, node: &crate::octree::Node, sought: Sought, depth: f64, out: &mut Vec<u32>) -> Truth {
    let mut tokens = Vec::new();
    let mut truth = model.literals(node, sought.depth(depth), &mut tokens);
    if truth == Truth::Open && model.solid.simplified {
        let mut left = Vec::new();
        truth = model.solid.alike.simplified(&tokens, &mut left);
        tokens = left;
    }
    if truth == Truth::Open {
        out.extend(sought.expression(tokens));
    }
    sought.truth(truth)
}

/// Primitives up to which a solid's tree is taken whole.
const FEW_PRIMITIVES: usize = 8;

/// Terms in a voxel from which it is decomposed, for good: later questions there are cheaper …
const MANY_TERMS: usize = 64;

/// … unless the last decomposition left more than this part of its parent's terms.
const WORTHWHILE: f64 = 0.75;

/// True where a model's octree tells what of its tree is where.
fn has_octree(model: &Model) -> bool {
    model.solid.primitives.len() > FEW_PRIMITIVES && model.octree.root().half.is_finite()
}

/// A voxel's children, made where many terms are left in it; `most` is how many are worth that.
fn children<'m>(model: &'m Model, node: &'m crate::octree::Node, most: usize) -> Option<&'m [crate::octree::Node; 8]> {
    let terms = node.terms().len();
    match node.children() {
        None if terms > MANY_TERMS && terms <= most => model.expand(node),
        children => children,
    }
}

/// How many terms are worth a decomposition below a voxel.
fn worthwhile(node: &crate::octree::Node) -> usize {
    (WORTHWHILE * node.terms().len() as f64) as usize
}
