//! Two convex polytopes at an instant, along A's axes: their planes and corners.

use crate::contact::query::task::Task;
use crate::motion::Instant;
use crate::solid::primitive::{Convex, Corners};
use crate::solid::{Face, Solid};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// Corners between which the nearest edge of a polytope is looked for.
const OUTERMOST: usize = 4;

/// A plane of a polytope along A's axes: the body is where n·x <= offset.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    pub face: u32,
    pub normal: DVec3,
    pub offset: f64,
}

/// A polytope along A's axes.
#[derive(Clone, Debug)]
pub struct Polytope<'a> {
    /// Its faces in order.
    pub planes: Vec<Plane>,
    /// Its corners in order; none of a half-space.
    pub corners: Vec<DVec3>,
    /// The same in its own frame where they are a hull's, and that frame's axes.
    own: Option<(&'a Corners, DMat3)>,
}

/// Two polytopes along A's axes.
#[derive(Clone, Debug)]
pub struct Polytopes<'a> {
    pub a: Polytope<'a>,
    pub b: Polytope<'a>,
}

impl<'a> Polytope<'a> {
    /// A whole solid as a polytope, its points and directions carried along; `None` for another one.
    fn of(solid: &'a Solid, point: impl Fn(DVec3) -> DVec3, vector: impl Fn(DVec3) -> DVec3) -> Option<Self> {
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
        let own = match whole.shape.convex() {
            Convex::Corners(own) => {
                let axes = whole.frame.matrix();
                Some((own, DMat3::from_cols(vector(axes.x_axis), vector(axes.y_axis), vector(axes.z_axis))))
            }
            _ => None,
        };
        Some(Self { planes: planes.collect(), corners, own })
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
        match self.own.and_then(|(own, axes)| own.foremost(axes.transpose() * n)) {
            Some(some) => some.iter().map(|i| &self.corners[*i as usize]).fold(first, farther).1,
            None => self.corners.iter().fold(first, farther).1,
        }
    }

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

impl<'a> Polytopes<'a> {
    /// Both bodies of a pair at an instant; `None` where one is no polytope.
    pub fn of(task: &Task<'a>, at: &Instant) -> Option<Self> {
        let a = Polytope::of(task.a, |x| x, |v| v)?;
        let b = Polytope::of(task.b, |x| at.a_point(x), |v| at.a_vector(v))?;
        Some(Self { a, b })
    }

    /// The gap between the bodies along a unit direction from A to B; negative where they overlap along it.
    pub fn apart(&self, n: DVec3) -> f64 {
        n.dot(self.b.support(-n)) - n.dot(self.a.support(n))
    }
}
