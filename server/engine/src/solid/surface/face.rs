//! A face of any kind: the table of the kinds, and the dispatch over it. What the answers mean stands at [`Surface`], the contract.

use super::{
    Analytic, Apex, Axis, Bend, Bowl, Capsule, Cone, Curvature, Cylinder, Elliptic, FaceAt, NUMBERS, Plane, Quadric,
    Saddle, Section, Sphere, Spine, Stretch, Stretches, Superellipsoid, Surface, Symmetry, Terms, Torus, Under,
};
use contactd_proto::Pose;
use glam::DVec3;

/// Writes the enum of the kinds, and what dispatches over it: `each!`, the answer of a face's own kind, and `like!`, that of the kind of
/// two faces, `None` for faces of two kinds.
macro_rules! faces {
    ($d:tt $($kind:ident = $rank:literal: $doc:literal),+ $(,)?) => {
        /// One face of a primitive. Normals and axes are unit vectors.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Face { $(#[doc = $doc] $kind($kind)),+ }

        macro_rules! each {
            ($d face:expr, $d own:ident => $d answer:expr) => {
                match $d face { $(Face::$kind($d own) => $d answer),+ }
            };
        }

        macro_rules! like {
            ($d p:expr, $d q:expr, $d a:ident, $d b:ident => $d answer:expr) => {
                match $d p {
                    $(Face::$kind($d a) => if let Face::$kind($d b) = $d q { Some($d answer) } else { None }),+
                }
            };
        }

        // Two kinds of one rank would be sorted, and kept in models, as one.
        const _: () = {
            let (ranks, mut i) = ([$($rank as u32),+], 0);
            while i < ranks.len() {
                let mut j = 0;
                while j < i {
                    assert!(ranks[i] != ranks[j]);
                    j += 1;
                }
                i += 1;
            }
        };

        $(impl From<$kind> for Face {
            #[inline]
            fn from(face: $kind) -> Self {
                Face::$kind(face)
            }
        })+

        impl Face {
            /// The place of its kind among the kinds: what faces are sorted by first, and told by in kept models.
            #[inline]
            pub fn rank(&self) -> u32 {
                match self { $(Face::$kind(_) => $rank),+ }
            }
        }
    };
}

faces! {$
    Plane = 0: "Half-space n·x <= d.",
    Sphere = 1: "Ball around a centre.",
    Cylinder = 2: "Infinite cylinder.",
    Cone = 3: "Infinite single-napped cone.",
    Torus = 4: "All points within a radius of a circle.",
    Elliptic = 5: "The affine image of a sphere, a cylinder or a cone.",
    Capsule = 6: "All points within a radius of a segment.",
    Bowl = 7: "A convex open quadric: a paraboloid or one sheet of a hyperboloid.",
    Saddle = 8: "A quadric of two positive and two negative squares.",
    Superellipsoid = 9: "The unit ball of a norm of two exponents, scaled along three axes.",
}

impl Face {
    /// See [`Surface::reach`].
    pub fn reach(&self) -> f64 {
        each!(self, f => f.reach())
    }

    /// See [`Surface::magnitude`].
    #[inline]
    pub fn magnitude(&self) -> f64 {
        each!(self, f => f.magnitude())
    }

    /// psi at `x`.
    pub fn value(&self, x: DVec3) -> f64 {
        each!(self, f => f.value(x))
    }

    /// psi at `x` with gradient and curvature.
    pub fn at(&self, x: DVec3) -> FaceAt {
        each!(self, f => f.at(x))
    }

    /// See [`Surface::is_convex`].
    #[inline]
    pub fn is_convex(&self) -> bool {
        each!(self, f => f.is_convex())
    }

    /// The Hessian of psi at the point `x` that `at` was taken at; none on the axis and in the centre, where there is none.
    #[inline]
    pub fn curvature(&self, x: DVec3, at: &FaceAt) -> Curvature {
        if at.rho == 0.0 {
            return Curvature::NONE;
        }
        each!(self, f => f.curvature(x, at))
    }

    /// See [`Surface::stretch`].
    #[inline]
    pub fn stretch(&self) -> Option<Stretch> {
        each!(self, f => f.stretch())
    }

    /// See [`Surface::steady`].
    #[inline]
    pub fn steady(&self, x: DVec3) -> Option<DVec3> {
        each!(self, f => f.steady(x))
    }

    /// See [`Surface::split`].
    #[inline]
    pub fn split(&self, x: DVec3) -> Option<[DVec3; 3]> {
        each!(self, f => f.split(x))
    }

    /// The unit normal at `x`.
    #[inline]
    pub fn unit_normal(&self, x: DVec3) -> DVec3 {
        self.at(x).unit()
    }

    /// See [`Surface::under`].
    #[inline]
    pub fn under(&self, touched: DVec3, center: DVec3) -> Option<Under> {
        each!(self, f => f.under(touched, center))
    }

    /// See [`Surface::turn`].
    #[inline]
    pub fn turn(&self, x: DVec3, at: &FaceAt, reach: f64) -> f64 {
        each!(self, f => f.turn(x, at, reach))
    }

    /// See [`Surface::near`].
    #[inline]
    pub fn near(&self, center: DVec3, reach: f64) -> Option<Self> {
        each!(self, f => f.near(center, reach))
    }

    /// Bounds (lower, upper) of psi over the box center ± half, up to rounding.
    #[inline]
    pub fn span(&self, center: DVec3, half: DVec3) -> (f64, f64) {
        each!(self, f => f.span(center, half))
    }

    /// See [`Surface::bend`].
    #[inline]
    pub fn bend(&self, x: DVec3, at: &FaceAt) -> Bend {
        each!(self, f => f.bend(x, at))
    }

    /// The same face seen from the parent of `frame`.
    pub fn placed(&self, frame: &Pose) -> Self {
        each!(self, f => f.placed(frame).into())
    }

    /// See [`Surface::moved`].
    #[inline]
    pub fn moved(&self, point: impl Fn(DVec3) -> DVec3, vector: impl Fn(DVec3) -> DVec3) -> Self {
        each!(self, f => f.moved(point, vector).into())
    }

    /// About what the face is symmetric.
    #[inline]
    pub fn symmetry(&self) -> Symmetry {
        each!(self, f => f.symmetry())
    }

    /// The axis of a surface of revolution that has one alone: not of a sphere nor of a plane.
    #[inline]
    pub fn axis(&self) -> Option<Axis> {
        match self.symmetry() {
            Symmetry::Axis(axis) => Some(axis),
            Symmetry::Center(_) | Symmetry::Normal(_) | Symmetry::None => None,
        }
    }

    /// Unit normal and offset of a flat face: psi = n·x − d everywhere.
    #[inline]
    pub fn flat(&self) -> Option<(DVec3, f64)> {
        each!(self, f => f.flat())
    }

    /// True for a flat face.
    #[inline]
    pub fn is_flat(&self) -> bool {
        self.flat().is_some()
    }

    /// See [`Surface::ball`].
    #[inline]
    pub fn ball(&self) -> Option<(DVec3, f64)> {
        each!(self, f => f.ball())
    }

    /// See [`Surface::radius`].
    #[inline]
    pub fn radius(&self) -> Option<f64> {
        each!(self, f => f.radius())
    }

    /// See [`Surface::developable`].
    #[inline]
    pub fn developable(&self) -> Option<DVec3> {
        each!(self, f => f.developable())
    }

    /// See [`Surface::straight_at`].
    #[inline]
    pub fn straight_at(&self, x: DVec3) -> Option<DVec3> {
        each!(self, f => f.straight_at(x))
    }

    /// See [`Surface::spine`].
    pub fn spine(&self, hull: &[DVec3]) -> Option<Spine> {
        each!(self, f => f.spine(hull))
    }

    /// See [`Surface::apex`].
    #[inline]
    pub fn apex(&self) -> Option<Apex> {
        each!(self, f => f.apex())
    }

    /// See [`Surface::skewer`].
    pub fn skewer(&self, normal: DVec3) -> Option<Axis> {
        each!(self, f => f.skewer(normal))
    }

    /// See [`Surface::ends`].
    pub fn ends(&self) -> [Option<DVec3>; 2] {
        each!(self, f => f.ends())
    }

    /// See [`Surface::slides_along`].
    #[inline]
    pub fn slides_along(&self, d: DVec3, tolerance: f64) -> bool {
        each!(self, f => f.slides_along(d, tolerance))
    }

    /// See [`Surface::quadric`].
    #[inline]
    pub fn quadric(&self, inset: f64) -> Option<Quadric> {
        each!(self, f => f.quadric(inset))
    }

    /// See [`Surface::section`].
    #[inline]
    pub fn section(&self, y: DVec3) -> Option<Section> {
        each!(self, f => f.section(y))
    }

    /// See [`Surface::foot`].
    #[inline]
    pub fn foot(&self, point: DVec3, normal: DVec3, size: f64) -> DVec3 {
        each!(self, f => f.foot(point, normal, size))
    }

    /// See [`Surface::above`]; `None` for faces of two kinds.
    #[inline]
    pub fn above(&self, q: &Self, c: DVec3, r: f64) -> Option<(f64, f64)> {
        like!(self, q, a, b => a.above(b, c, r))
    }

    /// See [`Surface::deviation`]; `None` for faces of two kinds.
    #[inline]
    pub fn deviation(&self, other: &Self, size: f64) -> Option<f64> {
        like!(self, other, a, b => a.deviation(b, size))
    }

    /// See [`Surface::difference`]; `None` for faces of two kinds.
    #[inline]
    pub fn difference(&self, other: &Self, size: f64) -> Option<f64> {
        like!(self, other, a, b => a.difference(b, size))
    }

    /// See [`Surface::key`]; to be compared among faces of one `rank`.
    #[inline]
    pub fn key(&self, c: DVec3, r: f64) -> f64 {
        each!(self, f => f.key(c, r))
    }

    /// See [`Surface::numbers`]; to be compared among faces of one `rank`.
    #[inline]
    pub fn numbers(&self) -> [f64; NUMBERS] {
        each!(self, f => f.numbers())
    }

    /// See [`Surface::analytic`].
    #[inline]
    pub fn analytic(&self) -> Option<Analytic> {
        each!(self, f => f.analytic())
    }

    /// See [`Surface::quadric_name`].
    pub fn quadric_name(&self) -> &'static str {
        each!(self, f => f.quadric_name())
    }

    /// See [`Surface::terms`].
    pub fn terms(&self) -> Option<Terms> {
        each!(self, f => f.terms())
    }

    /// See [`Surface::inside`].
    #[inline]
    pub fn inside(&self, origin: DVec3, direction: DVec3) -> Stretches {
        each!(self, f => f.inside(origin, direction))
    }
}
