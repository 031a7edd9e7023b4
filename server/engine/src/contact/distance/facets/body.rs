//! What is seen of a body: a convex one as a whole, a mesh as boxes over its facets and then as facets.

use super::triangles::Triangle;
use crate::contact::distance::convex;
use crate::motion::{Instant, Relative};
use crate::octree::Model;
use crate::solid::Primitive;
use crate::solid::primitive::{Below, Convex, FacetTree, Facets};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// A place in a body: of a mesh a box of its tree or, with this bit, a facet; of a convex body the body.
pub type Place = u32;
const FACET: u32 = 1 << 31;

/// Where a body begins: all of it.
pub const ALL: Place = FacetTree::ROOT;

/// What covers a place: a convex set, in the frame of its primitive.
#[derive(Clone, Copy)]
pub enum Cover<'a> {
    /// A box along the axes, by its centre and half extents.
    Box(DVec3, DVec3),
    /// A facet.
    Facet(Triangle),
    /// A whole convex primitive that is bounded.
    Whole(Convex<'a>),
    /// All below a plane: told along its normal alone.
    Below,
}

enum Kind<'a> {
    Mesh(&'a FacetTree, Facets<'a>),
    Convex(Convex<'a>),
}

/// A body of the pair.
pub struct Body<'a> {
    /// Its model.
    pub model: &'a Model,
    /// The primitive that it is.
    pub primitive: &'a Primitive,
    kind: Kind<'a>,
    /// Model from primitive.
    axes: DMat3,
    /// Its centre of rotation in the primitive's frame.
    center: DVec3,
    /// How far facets may lie off what the primitive's formula says, a length.
    pub tolerance: f64,
}

impl<'a> Body<'a> {
    /// `None` for what is neither a mesh nor convex; `center`: its centre of rotation in the model's frame.
    fn new(model: &'a Model, center: DVec3) -> Option<Self> {
        let primitive = model.solid.whole()?;
        let geometry = primitive.shape.geometry();
        let kind = match geometry.facets() {
            Some(facets) => Kind::Mesh(geometry.facet_tree()?, facets),
            None => Kind::Convex(Some(primitive.shape.convex()).filter(|c| c.is_known() || c.is_half_space())?),
        };
        let center = primitive.frame.inverse().point(center);
        let (axes, tolerance) = (primitive.frame.matrix(), geometry.facet_tolerance());
        Some(Self { model, primitive, kind, axes, center, tolerance })
    }

    /// Both bodies of a pair of which one is a mesh at least; `None` for another pair. `relative` has each seen from the other one.
    pub fn both(models: [&'a Model; 2], relative: &[Relative; 2]) -> Option<[Self; 2]> {
        let is_mesh = |m: &Model| m.solid.whole().is_some_and(|p| p.shape.geometry().facets().is_some());
        if !models.iter().any(|m| is_mesh(m)) {
            return None;
        }
        Some([Self::new(models[0], relative[0].center_a())?, Self::new(models[1], relative[1].center_a())?])
    }

    /// The mesh that it is.
    pub fn mesh(&self) -> Option<(&'a FacetTree, &Facets<'a>)> {
        match &self.kind {
            Kind::Mesh(tree, facets) => Some((tree, facets)),
            Kind::Convex(_) => None,
        }
    }

    /// The convex primitive that it is.
    pub fn convex(&self) -> Option<convex::Body<'a>> {
        match &self.kind {
            Kind::Mesh(..) => None,
            Kind::Convex(_) => Some(convex::Body::of(self.primitive)),
        }
    }

    /// True for a half-space.
    pub fn is_half_space(&self) -> bool {
        matches!(&self.kind, Kind::Convex(c) if c.is_half_space())
    }

    /// What is in a place.
    #[inline]
    pub fn cover(&self, place: Place) -> Cover<'a> {
        match &self.kind {
            Kind::Convex(Convex::HalfSpace) => Cover::Below,
            Kind::Convex(convex) => Cover::Whole(*convex),
            Kind::Mesh(_, facets) if place & FACET != 0 => Cover::Facet(facets.corners(place & !FACET)),
            Kind::Mesh(tree, _) => {
                let (center, half) = tree.around(place);
                Cover::Box(center, half)
            }
        }
    }

    /// True where a place is not divided.
    #[inline]
    pub fn is_leaf(&self, place: Place) -> bool {
        place & FACET != 0 || matches!(self.kind, Kind::Convex(_))
    }

    /// The places that a box of a mesh is divided into.
    pub fn below(&self, place: Place) -> SmallVec<[Place; 8]> {
        match &self.kind {
            Kind::Mesh(tree, _) if place & FACET == 0 => match tree.below(place) {
                Below::Halves(halves) => SmallVec::from_slice(&halves),
                Below::Facets(facets) => facets.iter().map(|f| f | FACET).collect(),
            },
            Kind::Mesh(..) | Kind::Convex(_) => SmallVec::new(),
        }
    }

    /// How far the farthest point of a cover is from the centre of rotation, at most.
    pub fn far(&self, cover: &Cover) -> f64 {
        match cover {
            Cover::Box(center, half) => ((*center - self.center).abs() + *half).length(),
            Cover::Facet(t) => t.iter().map(|x| (*x - self.center).length()).fold(0.0, f64::max),
            Cover::Whole(_) => {
                let (aabb, center) = (&self.primitive.aabb, self.primitive.frame.point(self.center));
                ((aabb.center() - center).abs() + aabb.half()).length()
            }
            Cover::Below => f64::INFINITY,
        }
    }

    /// Where the body stands in its own model.
    pub fn seen(&self) -> Seen {
        Seen { axes: self.axes, origin: self.primitive.frame.position }
    }
}

impl Cover<'_> {
    /// Half its size, of a box.
    pub fn size(&self) -> f64 {
        match self {
            Cover::Box(_, half) => half.length(),
            Cover::Facet(_) | Cover::Whole(_) | Cover::Below => 0.0,
        }
    }

    /// What it is thicker than its core.
    pub fn margin(&self) -> f64 {
        match self {
            Cover::Whole(convex) => convex.margin(),
            Cover::Box(..) | Cover::Facet(_) | Cover::Below => 0.0,
        }
    }

    fn middle(&self) -> DVec3 {
        match self {
            Cover::Box(center, _) => *center,
            Cover::Facet([a, b, c]) => (*a + *b + *c) / 3.0,
            Cover::Whole(convex) => convex.middle(),
            Cover::Below => DVec3::ZERO,
        }
    }
}

/// Where the frame of a primitive stands along A's model axes.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    axes: DMat3,
    origin: DVec3,
}

impl Seen {
    /// Largest n·x over a cover; n is a unit vector.
    #[inline]
    pub fn reach(&self, cover: &Cover, n: DVec3) -> f64 {
        let own = |n: DVec3| self.axes.transpose() * n;
        n.dot(self.origin)
            + match cover {
                Cover::Box(center, half) => {
                    let m = own(n);
                    m.dot(*center) + m.abs().dot(*half)
                }
                Cover::Facet([a, b, c]) => {
                    let m = own(n);
                    m.dot(*a).max(m.dot(*b)).max(m.dot(*c))
                }
                Cover::Whole(convex) => convex.reach(&self.axes, n),
                Cover::Below => 0.0,
            }
    }

    /// The farthest point of a cover's core along n.
    #[inline]
    pub fn support(&self, cover: &Cover, n: DVec3) -> DVec3 {
        let own = |n: DVec3| self.axes.transpose() * n;
        let local = match cover {
            Cover::Box(center, half) => {
                let m = own(n);
                *center + DVec3::new(half.x.copysign(m.x), half.y.copysign(m.y), half.z.copysign(m.z))
            }
            Cover::Facet([a, b, c]) => {
                let m = own(n);
                let (p, q, r) = (m.dot(*a), m.dot(*b), m.dot(*c));
                if p >= q && p >= r {
                    *a
                } else if q >= r {
                    *b
                } else {
                    *c
                }
            }
            Cover::Whole(convex) => return convex.support(&self.axes, self.origin, n),
            Cover::Below => DVec3::ZERO,
        };
        self.origin + self.axes * local
    }

    /// The middle of a cover.
    pub fn middle(&self, cover: &Cover) -> DVec3 {
        self.point(cover.middle())
    }

    /// A point of the primitive's frame.
    pub fn point(&self, y: DVec3) -> DVec3 {
        self.origin + self.axes * y
    }

    /// The normal of a half-space, outwards.
    pub fn up(&self) -> DVec3 {
        self.axes.z_axis
    }

    /// The corners of a facet.
    pub fn triangle(&self, t: &Triangle) -> Triangle {
        t.map(|x| self.point(x))
    }
}

/// Both bodies where they stand at an instant, along A's model axes.
pub fn both_seen(bodies: &[Body; 2], at: &Instant) -> [Seen; 2] {
    let [a, b] = bodies;
    let b = Seen { axes: at.b_from_a.transpose() * b.axes, origin: at.a_point(b.primitive.frame.position) };
    [a.seen(), b]
}
