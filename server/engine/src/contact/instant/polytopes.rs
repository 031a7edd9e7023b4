//! Two convex polytopes of many faces at an instant, hulls of meshes mostly: what one linear program tells of them.
//!
//! Of a polytope f is the largest of its planes, so F = max(f_A, f_B) is lowest where one program has its optimum: the
//! deepest common point, or of bodies that are apart the nearest to both. The program's multipliers prove it, whatever
//! rounding left of them: no point of the box has F below their combination of the planes. Boxes would come to the same place
//! with all faces of both bodies in each of them.

use super::work::Work;
use crate::contact::exclusion::literal::Side;
use crate::contact::exclusion::lp;
use crate::contact::query::task::Task;
use crate::math::Aabb;
use crate::motion::Instant;
use crate::solid::local::LiteralId;
use crate::solid::{Face, Sense, Solid};
use glam::DVec3;
use smallvec::SmallVec;

/// Faces of both bodies together from which on they are taken as a whole; boxes have few faces of bodies with fewer.
const MANY: usize = 64;
/// Corners between which the nearest edge of a polytope is looked for.
const OUTERMOST: usize = 4;
/// Planes whose heights are compared as fast as one face is looked at.
const PLANES_PER_LOOK: usize = 8;
/// A bound is trusted up to so many roundings.
pub(super) const ROUNDINGS: f64 = 64.0;

/// A plane of a polytope along A's axes: the body is where n·x <= offset.
#[derive(Clone, Copy, Debug)]
pub(in crate::contact) struct Plane {
    pub face: u32,
    pub normal: DVec3,
    pub offset: f64,
}

/// A polytope along A's axes.
#[derive(Clone, Debug)]
pub(in crate::contact) struct Polytope {
    /// Its faces in order.
    pub planes: Vec<Plane>,
    /// Its corners in order; none of a half-space.
    pub corners: Vec<DVec3>,
}

/// Two polytopes of many faces along A's axes.
#[derive(Clone, Debug)]
pub(in crate::contact) struct Polytopes {
    pub a: Polytope,
    pub b: Polytope,
}

/// Where F is lowest, and by what.
pub(in crate::contact) struct Lowest {
    pub x: DVec3,
    /// No point of what both bodies' boxes have in common has a lower F.
    pub bound: f64,
    /// The planes that hold it, with their weights.
    pub support: Vec<(Side, LiteralId, f64)>,
}

impl Polytope {
    /// A whole solid as a polytope, its points and directions carried along; `None` for another one.
    fn of(solid: &Solid, point: impl Fn(DVec3) -> DVec3, vector: impl Fn(DVec3) -> DVec3) -> Option<Self> {
        let whole = solid.whole()?;
        let faces = whole.faces.listed();
        if faces.len() != solid.faces.len() || !faces.iter().all(Face::is_flat) {
            return None;
        }
        let planes = faces.iter().enumerate().map(|(i, face)| {
            let at = face.moved(&point, &vector).at(DVec3::ZERO);
            Plane { face: i as u32, normal: at.normal, offset: -at.value }
        });
        let corners = match whole.shape.convex().discs() {
            Some(points) => points.iter().map(|(v, _)| point(whole.frame.point(*v))).collect(),
            // One plane bounds a half-space; more would leave corners.
            None if faces.len() == 1 => Vec::new(),
            None => return None,
        };
        Some(Self { planes: planes.collect(), corners })
    }

    /// True for a half-space.
    pub fn is_unbounded(&self) -> bool {
        self.corners.is_empty()
    }

    /// f of a point: how far it is beyond the outermost of the planes.
    pub fn value(&self, x: DVec3) -> f64 {
        self.planes.iter().map(|p| p.normal.dot(x) - p.offset).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Its farthest corner along n.
    pub fn support(&self, n: DVec3) -> DVec3 {
        let first = (f64::NEG_INFINITY, DVec3::ZERO);
        let farther = |best: (f64, DVec3), v: &DVec3| {
            let reach = n.dot(*v);
            if reach > best.0 { (reach, *v) } else { best }
        };
        self.corners.iter().fold(first, farther).1
    }
}

impl Polytope {
    /// Its corners that are farthest along n, the farthest first: as many as bound a face or an edge.
    pub fn outermost(&self, n: DVec3) -> SmallVec<[DVec3; OUTERMOST]> {
        let mut found: SmallVec<[(f64, DVec3); OUTERMOST]> = SmallVec::new();
        for v in &self.corners {
            let reach = n.dot(*v);
            let at = found.iter().position(|f| f.0 < reach).unwrap_or(found.len());
            if at < OUTERMOST {
                found.truncate(OUTERMOST - 1);
                found.insert(at, (reach, *v));
            }
        }
        found.into_iter().map(|f| f.1).collect()
    }
}

impl Polytopes {
    /// Both bodies of a pair at an instant; `None` where one is no polytope, or they have few faces.
    pub fn of(task: &Task, at: &Instant) -> Option<Self> {
        if task.a.faces.len() + task.b.faces.len() <= MANY {
            return None;
        }
        let a = Polytope::of(task.a, |x| x, |v| v)?;
        let b = Polytope::of(task.b, |x| at.a_point(x), |v| at.a_vector(v))?;
        Some(Self { a, b })
    }

    /// Where F is lowest in a finite box.
    pub fn lowest(&self, within: &Aabb, work: &Work) -> Lowest {
        let (center, half) = (within.center(), within.half());
        let all = || self.a.planes.iter().chain(&self.b.planes);
        let heights: Vec<(DVec3, f64)> = all().map(|p| (p.normal, p.normal.dot(center) - p.offset)).collect();
        let mut planes = lp::Planes::default();
        planes.set(heights.iter().copied());
        let mut warm = lp::Warm::default();
        let found = lp::min_max(&mut planes, half, &mut warm);
        work.look(heights.len() * (1 + warm.pivots as usize).div_ceil(PLANES_PER_LOOK));
        // The bound is that of the multipliers as they are, not what the program takes it for.
        let support = &found.support[..found.count];
        let sum: f64 = support.iter().map(|s| s.1).sum();
        let of = |s: &(u32, f64)| (heights[s.0 as usize], s.1 / sum);
        let height: f64 = support.iter().map(of).map(|((_, b), weight)| b * weight).sum();
        let slope: DVec3 = support.iter().map(of).map(|((n, _), weight)| n * weight).sum();
        let bound = if sum > 0.0 { height - slope.abs().dot(half) } else { f64::NEG_INFINITY };
        let literal = |i: u32| match (i as usize).checked_sub(self.a.planes.len()) {
            None => (Side::A, LiteralId::new(i, Sense::Positive)),
            Some(j) => (Side::B, LiteralId::new(j as u32, Sense::Positive)),
        };
        let support = support.iter().map(|s| {
            let (side, id) = literal(s.0);
            (side, id, s.1)
        });
        Lowest { x: center + found.y, bound, support: support.collect() }
    }
}
