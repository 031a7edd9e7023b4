//! What the advance sees of a body: a convex one as a whole, a mesh as boxes over its facets and then as facets.

use crate::contact::convex::{ConvexBody, SupportMapping, body_of};
use crate::contact::query::task::Task;
use crate::math::Aabb;
use crate::motion::{Instant, Relative};
use crate::solid::Primitive;
use crate::solid::primitive::{Below, FacetTree, Facets};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// A place in a body: of a mesh a box of its tree or, with this bit, a facet; of a convex body the body.
pub(super) type Place = u32;
const FACET: u32 = 1 << 31;

/// Where a body begins: all of it.
pub(super) const ALL: Place = FacetTree::ROOT;

/// What covers a place: a convex set, in the frame of its primitive.
#[derive(Clone, Copy)]
pub(super) enum Cover<'a> {
    /// A box along the axes, by its centre and half extents.
    Box(DVec3, DVec3),
    /// A facet.
    Triangle([DVec3; 3]),
    /// A whole convex primitive.
    Whole(&'a ConvexBody<'a>),
}

impl Cover<'_> {
    /// Largest m·y over it.
    #[inline]
    pub fn reach(&self, m: DVec3) -> f64 {
        match self {
            Cover::Box(center, half) => m.dot(*center) + m.abs().dot(*half),
            Cover::Triangle([a, b, c]) => m.dot(*a).max(m.dot(*b)).max(m.dot(*c)),
            Cover::Whole(body) => body.reach(m),
        }
    }

    /// The farthest point of its core.
    #[inline]
    fn support(&self, m: DVec3) -> DVec3 {
        match self {
            Cover::Box(center, half) => {
                *center + DVec3::new(half.x.copysign(m.x), half.y.copysign(m.y), half.z.copysign(m.z))
            }
            Cover::Triangle([a, b, c]) => {
                let (p, q, r) = (m.dot(*a), m.dot(*b), m.dot(*c));
                if p >= q && p >= r {
                    *a
                } else if q >= r {
                    *b
                } else {
                    *c
                }
            }
            Cover::Whole(body) => body.support(m),
        }
    }

    fn margin(&self) -> f64 {
        if let Cover::Whole(body) = self { body.margin } else { 0.0 }
    }

    /// A point in it.
    #[inline]
    pub fn middle(&self) -> DVec3 {
        match self {
            Cover::Box(center, _) => *center,
            Cover::Triangle([a, b, c]) => (*a + *b + *c) / 3.0,
            Cover::Whole(body) => body.center(),
        }
    }

    /// A box around it, by its centre and half extents; of a convex primitive about its middle.
    fn extent(&self) -> (DVec3, DVec3) {
        match self {
            Cover::Box(center, half) => (*center, *half),
            Cover::Triangle(corners) => {
                let around = Aabb::of_points(*corners);
                (around.center(), around.half())
            }
            Cover::Whole(body) => {
                let [low, high] = [-1.0, 1.0].map(|s| DVec3::from_array(DVec3::AXES.map(|axis| body.reach(axis * s))));
                (0.5 * (high - low), 0.5 * (high + low))
            }
        }
    }

    /// How far its farthest point is from another one, at most.
    #[inline]
    pub fn far(&self, from: DVec3) -> f64 {
        let (center, half) = self.extent();
        ((center - from).abs() + half).length()
    }

    /// How large it is.
    pub fn size(&self) -> f64 {
        self.extent().1.max_element()
    }

    /// Directions of its own frame in which its sides lie towards what lies along `way`.
    pub fn sides(&self, way: DVec3) -> [DVec3; 3] {
        match self {
            Cover::Box(..) => DVec3::AXES,
            Cover::Triangle([a, b, c]) => [(*b - *a).cross(*c - *a).normalize_or_zero(), DVec3::ZERO, DVec3::ZERO],
            Cover::Whole(body) => body.sides(way),
        }
    }
}

/// What a body is made of.
enum Kind<'a> {
    /// One convex primitive, in its own frame.
    Convex(ConvexBody<'a>),
    /// A mesh.
    Mesh(&'a FacetTree, Facets<'a>),
}

/// A body that is one primitive.
pub(super) struct Body<'a> {
    pub primitive: &'a Primitive,
    kind: Kind<'a>,
    /// Model from primitive.
    axes: DMat3,
    /// Its centre of rotation in the primitive's frame.
    center: DVec3,
    /// Its spin, radians a step.
    spin: f64,
    /// How far its farthest point is from the centre of rotation, at most.
    far: f64,
    /// How far facets may lie off what the primitive's formula says, a length.
    pub tolerance: f64,
}

impl<'a> Body<'a> {
    /// `None` for what is neither convex and bounded nor a mesh.
    fn new(primitive: &'a Primitive, center: DVec3, spin: f64) -> Option<Self> {
        let geometry = primitive.shape.geometry();
        let kind = match geometry.facets() {
            Some(facets) => Kind::Mesh(geometry.facet_tree()?, facets),
            None => Kind::Convex(body_of(primitive)?.unplaced()),
        };
        let center = primitive.frame.inverse().point(center);
        let (axes, tolerance) = (primitive.frame.matrix(), geometry.facet_tolerance());
        let mut this = Self { primitive, kind, axes, center, spin, far: 0.0, tolerance };
        this.far = this.cover(ALL).far(center);
        Some(this)
    }

    /// Both bodies of a task, of which one is a mesh at least.
    pub fn both(task: &'a Task) -> Option<[Self; 2]> {
        let (placed_a, placed_b) = task.relative.placed();
        let (a, b) = (task.a.whole()?, task.b.whole()?);
        if !is_mesh(a) && !is_mesh(b) {
            return None;
        }
        let center_b = placed_b.place.inverse().position;
        let spin = [placed_a.motion.spin.length(), placed_b.motion.spin.length()];
        Some([Self::new(a, task.relative.center_a(), spin[0])?, Self::new(b, center_b, spin[1])?])
    }

    /// The mesh that it is.
    pub fn mesh(&self) -> Option<(&'a FacetTree, &Facets<'a>)> {
        match &self.kind {
            Kind::Mesh(tree, facets) => Some((tree, facets)),
            Kind::Convex(_) => None,
        }
    }

    /// The convex body that it is, in the frame of its primitive.
    pub fn convex(&self) -> Option<&ConvexBody<'a>> {
        match &self.kind {
            Kind::Convex(body) => Some(body),
            Kind::Mesh(..) => None,
        }
    }

    /// What is in a place.
    #[inline]
    pub fn cover(&self, place: Place) -> Cover<'_> {
        match &self.kind {
            Kind::Convex(body) => Cover::Whole(body),
            Kind::Mesh(_, facets) if place & FACET != 0 => Cover::Triangle(facets.corners(place & !FACET)),
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

    /// ω²ρ of a cover: how fast its points are pulled to the centre of rotation at most.
    #[inline]
    pub fn pull(&self, cover: &Cover) -> f64 {
        match cover {
            _ if self.spin == 0.0 => 0.0,
            Cover::Whole(_) => self.spin * self.spin * self.far,
            Cover::Box(..) | Cover::Triangle(_) => self.spin * self.spin * cover.far(self.center),
        }
    }

    /// A point of its primitive's frame in its model.
    pub fn in_model(&self, y: DVec3) -> DVec3 {
        self.primitive.frame.point(y)
    }
}

fn is_mesh(p: &Primitive) -> bool {
    p.shape.geometry().facets().is_some()
}

/// True for a pair that is asked of here.
pub(super) fn are_asked(task: &Task) -> bool {
    let known = |p: &Primitive| is_mesh(p) || p.shape.convex().is_known();
    let (Some(a), Some(b)) = (task.a.whole(), task.b.whole()) else { return false };
    (is_mesh(a) || is_mesh(b)) && known(a) && known(b)
}

/// Both bodies at an instant.
pub(super) struct Moment {
    pub at: Instant,
    /// A's model axes from the primitives'.
    axes: [DMat3; 2],
    /// Origins of the primitives' frames along A's model axes.
    origins: [DVec3; 2],
    /// The primitives' axes from the world's.
    own_from_world: [DMat3; 2],
    /// From A's origin to B's, world axes.
    between: DVec3,
}

impl Moment {
    pub fn new(relative: &Relative, bodies: &[Body; 2], t: f64) -> Self {
        let at = relative.at(t);
        let axes = [bodies[0].axes, at.b_from_a.transpose() * bodies[1].axes];
        let [frame_a, frame_b] = [0, 1].map(|k| bodies[k].primitive.frame.position);
        let origins = [frame_a, at.a_point(frame_b)];
        let own_from_world = axes.map(|axes| (at.world_from_a * axes).transpose());
        Self { axes, origins, own_from_world, between: at.world_from_a * (origins[1] - origins[0]), at }
    }

    /// A direction of the world along the axes of a body's primitive.
    #[inline]
    pub fn own(&self, k: usize, n: DVec3) -> DVec3 {
        self.own_from_world[k] * n
    }

    /// A direction along the axes of a body's primitive in the world.
    #[inline]
    pub fn world(&self, k: usize, m: DVec3) -> DVec3 {
        self.own_from_world[k].transpose() * m
    }

    /// From a point of A's primitive to one of B's, world axes.
    #[inline]
    pub fn way(&self, [a, b]: [DVec3; 2]) -> DVec3 {
        self.between + self.world(1, b) - self.world(0, a)
    }

    /// The gap between two covers along a direction of the world, from A's to B's.
    #[inline]
    pub fn gap(&self, covers: &[Cover; 2], n: DVec3) -> f64 {
        n.dot(self.between) - covers[1].reach(-self.own(1, n)) - covers[0].reach(self.own(0, n))
    }

    /// A cover of body k as it stands, along A's model axes.
    pub fn seen<'m>(&'m self, k: usize, cover: &'m Cover<'m>) -> Seen<'m> {
        Seen { cover, axes: &self.axes[k], origin: self.origins[k] }
    }
}

/// A cover where it stands.
pub(super) struct Seen<'m> {
    cover: &'m Cover<'m>,
    axes: &'m DMat3,
    origin: DVec3,
}

impl SupportMapping for Seen<'_> {
    #[inline]
    fn support(&self, n: DVec3) -> DVec3 {
        *self.axes * self.cover.support(self.axes.transpose() * n) + self.origin
    }

    fn margin(&self) -> f64 {
        self.cover.margin()
    }
}
