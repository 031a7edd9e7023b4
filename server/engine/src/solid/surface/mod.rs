//! Surfaces of faces: the 1-Lipschitz functions psi whose common negative part is a primitive, one file each. All are convex
//! but a torus' and a saddle's, which say how far they fall below their tangents ([`Surface::under`]).
//!
//! | face | psi |
//! |---|---|
//! | plane | n·x − d |
//! | sphere | \|x − o\| − r |
//! | cylinder | ρ − r, ρ the distance from the axis |
//! | cone | ρ cos α − z sin α, z along the axis from the apex into the cone, α the half angle |
//! | torus | hypot(ρ − R, z) − r, R the radius of its circle, r that of the tube |
//! | capsule | \|x − q\| − r, q the point of a segment next to x |
//! | elliptic: the image of a sphere, cylinder or cone | \|B(x − o)\| − w·(x − o) − r |
//! | bowl: another convex quadric, o its focus | the same |
//! | saddle: a quadric that is not convex | \|P(x)\| − \|N(x)\|, P and N affine |
//! | superellipsoid | s (N(x) − 1), N a norm, s its ball's inscribed radius |
//!
//! [`Surface`] is the contract: what every kind tells of itself. [`Face`] (`face.rs`) is any of them and dispatches without a
//! table of functions. Nobody outside of this folder asks of what kind a face is, only what it can tell: whether it is flat, about what
//! it is symmetric, whether it has an apex. A capability that a kind does not have is `None`, and whoever asks then takes
//! the way that is right for every face.
//!
//! Adding a kind: a file here, a row of `faces!` in `face.rs`. What is missing does not compile. docs/adding.md.
//!
//! On an axis the radial direction is undefined: closer than `ON_AXIS` any exact perpendicular stands in, elsewhere the
//! direction is re-orthogonalised against the axis. Where it stands in, the tangent plane lies above the face by up to the
//! distance from the axis, so `ON_AXIS` is rounding and no more.

mod bend;
mod bowl;
mod capsule;
mod cone;
pub mod curve;
mod cylinder;
pub mod elliptic;
mod face;
mod plane;
mod roots;
mod saddle;
mod sphere;
pub mod superellipsoid;
mod symmetry;
mod terms;
#[cfg(test)]
mod tests;
mod torus;
mod tube;

pub use bend::{Bend, Law};
pub use bowl::Bowl;
pub use capsule::Capsule;
pub use cone::{Apex, Cone};
pub use curve::{Analytic, Curve};
pub use cylinder::Cylinder;
pub use elliptic::{Elliptic, Stretch};
pub use face::Face;
pub use plane::Plane;
pub use saddle::{Row, Saddle, Sides};
pub use sphere::Sphere;
pub use superellipsoid::Superellipsoid;
pub use symmetry::{Axis, Symmetry};
pub use terms::Terms;
pub use torus::Torus;

use crate::math::{any_perpendicular, tolerance::ON_AXIS};
use contactd_proto::Pose;
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// A face at a point: psi, its gradient, and how it curves there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceAt {
    /// psi(x): signed distance-like value, length.
    pub value: f64,
    /// Gradient of psi, 1 long at most: shorter where psi grows slower than the distance (elliptic faces, bowls,
    /// saddles, superellipsoids). What bounds psi goes by this; what looks for a direction goes by `unit`.
    pub normal: DVec3,
    /// Its length: 1 at most, and just that of all but these.
    pub slope: f64,
    /// Curvature factor k: 0 plane, cos α cone, max(p, q) − 1 superellipsoid, 1 any other. psi rises above its tangent
    /// by k D²/(2ρ) at most.
    pub k: f64,
    /// Distance ρ from the centre, the axis or the circle (infinite for a plane, where k is 0); of an elliptic face or a bowl
    /// |B(x − o)|, of a saddle |P(x)|, of a superellipsoid sN.
    pub rho: f64,
}

impl FaceAt {
    /// The unit normal: the gradient made as long as 1; any where it is zero, as on a bowl's axis beyond its focus.
    #[inline]
    pub fn unit(&self) -> DVec3 {
        if self.slope == 1.0 {
            self.normal
        } else if self.slope > 0.0 {
            self.normal / self.slope
        } else {
            DVec3::Z
        }
    }
}

/// The Hessian of psi of a face at a point, `each`·I + `factor`·`along`⊗`along` + `other`·`beside`⊗`beside`, in the face's own
/// frame: a form that turns by turning two vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curvature {
    /// Curvature in all directions, per length.
    pub each: f64,
    /// What is added to that along `along`, per length.
    pub factor: f64,
    /// A unit vector, or zero.
    pub along: DVec3,
    /// What is added along `beside`, per length.
    pub other: f64,
    /// A unit vector, or zero.
    pub beside: DVec3,
}

impl Curvature {
    /// Of what is straight.
    pub const NONE: Self = Self { each: 0.0, factor: 0.0, along: DVec3::ZERO, other: 0.0, beside: DVec3::ZERO };

    /// The form as a matrix, per length.
    pub fn matrix(&self) -> DMat3 {
        let one = outer(self.along, self.along * self.factor) + DMat3::from_diagonal(DVec3::splat(self.each));
        if self.other == 0.0 { one } else { one + outer(self.beside, self.beside * self.other) }
    }

    /// The form's product with a vector.
    #[inline]
    pub fn times(&self, v: DVec3) -> DVec3 {
        let one = v * self.each + self.along * (self.factor * self.along.dot(v));
        if self.other == 0.0 { one } else { one + self.beside * (self.other * self.beside.dot(v)) }
    }

    /// The form of −psi.
    pub fn negated(self) -> Self {
        Self { each: -self.each, factor: -self.factor, other: -self.other, ..self }
    }
}

/// u vᵀ.
fn outer(u: DVec3, v: DVec3) -> DMat3 {
    DMat3::from_cols(u * v.x, u * v.y, u * v.z)
}

/// A lower bound of a psi that is not convex: with p(y) = ρ + out·(y − c) and T the offset of y across `axis` and `out`,
///
/// psi(y) >= value + normal·(y − c) − k (√(p² + T²) − p),
///
/// what bends away as a subtracted cone does; k T²/(2ρ) at most for |y − c| <= T. In the face's own frame. Of a saddle `out` is no unit
/// vector, and T what is along `beside`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Under {
    /// At c, a length.
    pub value: f64,
    /// Gradient of the plane, a unit vector.
    pub normal: DVec3,
    /// That gradient without its part along `out`: what is left of it where the direction away from the axis means nothing.
    pub far: DVec3,
    /// How steep it falls, 0 to 1.
    pub k: f64,
    /// Distance of c from the axis, a length.
    pub rho: f64,
    /// Unit axis.
    pub axis: DVec3,
    /// Unit direction from the axis to c.
    pub out: DVec3,
    /// What T is along, of a saddle alone: 1 long at most, as `out`.
    pub beside: Option<DVec3>,
}

impl Under {
    /// How far it falls below its plane within `reach` of c at most: k·reach²/(2ρ), and no more than k·2·reach. A length.
    #[inline]
    pub fn dip(k: f64, rho: f64, reach: f64) -> f64 {
        k * reach * if reach < 4.0 * rho { reach / (2.0 * rho) } else { 2.0 }
    }
}

/// The stretches of a line where psi <= 0, ascending.
pub type Stretches = SmallVec<[(f64, f64); 2]>;

/// A face that is a quadric of revolution: Q = |u|² − ρ² with s = x − origin, z = s·axis, u = s − z axis (a sphere has no
/// axis: u = s) and ρ = radius + slope·z; psi <= 0 where Q <= 0 (and ρ >= 0).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quadric {
    /// Centre, a point of the axis, or the apex; the face's own frame.
    pub origin: DVec3,
    /// Unit axis; `None` for a sphere.
    pub axis: Option<DVec3>,
    /// R, a length; 0 for a cone.
    pub radius: f64,
    /// tan α; 0 unless a cone.
    pub slope: f64,
}

/// The cross-section of a round face at the height of a point: a circle square to the axis, or any great circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Centre of a sphere, any point of an axis; the face's own frame.
    pub origin: DVec3,
    /// Unit axis; `None` for a sphere.
    pub axis: Option<DVec3>,
    /// Radius there, a length.
    pub radius: f64,
}

/// What a round face lies about: points whose hull, thickened by the radius, holds all of a part of psi <= 0. Model frame, lengths.
#[derive(Clone, Debug, PartialEq)]
pub struct Spine {
    /// The points.
    pub points: SmallVec<[DVec3; 4]>,
    /// The radius.
    pub radius: f64,
}

/// What every kind of face tells of itself. Points and directions are in the face's own frame, lengths in that of the model.
pub trait Surface: Copy {
    /// Size of the numbers that psi is computed from, beside those of the point: |d|, |o| + r, |apex|. A length.
    fn reach(&self) -> f64;

    /// The same by the largest coordinate of a point: with it, what rounding may do to psi is told (`octree::span`). A length.
    fn magnitude(&self) -> f64;

    /// psi at `x`.
    fn value(&self, x: DVec3) -> f64;

    /// psi at `x` with gradient and curvature.
    fn at(&self, x: DVec3) -> FaceAt;

    /// True where psi is convex; otherwise `under` bounds it from below.
    #[inline]
    fn is_convex(&self) -> bool {
        true
    }

    /// B of psi = |B(x − o)| − … where the face is the affine image of another: psi bends as |B(x − o)| does. `None` where B only
    /// leaves out an axis.
    #[inline]
    fn stretch(&self) -> Option<Stretch> {
        None
    }

    /// The gradient at `x` of what of psi is not k·ρ, of a face where that is not zero; `apex` tells a round cone's.
    #[inline]
    fn steady(&self, _x: DVec3) -> Option<DVec3> {
        None
    }

    /// Gradient of the length by which psi bends at `x`, 1 long at most, and what that bends along: psi is no more than
    /// k (√((ρ + a)² + τ²) − ρ − a) above its tangent, a what an offset has along the first, τ along the others. One
    /// alone of these, of a length |P| where P has two rows, is 1 long at most, and the length no more than what an
    /// offset has along both.
    #[inline]
    fn split(&self, _x: DVec3) -> Option<[DVec3; 3]> {
        None
    }

    /// The Hessian of psi at `x`, where `at` was taken, off the axis and the centre.
    fn curvature(&self, x: DVec3, at: &FaceAt) -> Curvature;

    /// What bounds psi from below as seen from `center`, with the gradient that it has at `touched` (any two points). `None` where
    /// its tangent at `touched` does: everywhere where psi is convex.
    #[inline]
    fn under(&self, _touched: DVec3, _center: DVec3) -> Option<Under> {
        None
    }

    /// How far the gradient turns within `reach` (a length) of `x`, where `at` was taken: a bound of the length of its change.
    #[inline]
    fn turn(&self, _x: DVec3, at: &FaceAt, reach: f64) -> f64 {
        if at.k == 0.0 {
            0.0
        } else if at.rho > reach {
            at.k * reach / (at.rho - reach)
        } else {
            2.0
        }
    }

    /// A simpler face whose psi is the same within `reach` (a length) of `center`, where there is one.
    #[inline]
    fn near(&self, _center: DVec3, _reach: f64) -> Option<Face> {
        None
    }

    /// Bounds (lower, upper) of psi over the box center ± half, up to rounding.
    fn span(&self, center: DVec3, half: DVec3) -> (f64, f64);

    /// How it bends away from its tangent plane at `x`, where `at` was taken.
    fn bend(&self, x: DVec3, at: &FaceAt) -> Bend;

    /// The face moved by a rigid motion that is given by what it does to points and to vectors.
    fn moved(&self, point: impl Fn(DVec3) -> DVec3, vector: impl Fn(DVec3) -> DVec3) -> Self;

    /// The same face seen from the parent of `frame`.
    #[inline]
    fn placed(&self, frame: &Pose) -> Self {
        self.moved(|x| frame.point(x), |v| frame.vector(v))
    }

    /// About what it is symmetric.
    fn symmetry(&self) -> Symmetry;

    /// Unit normal and offset of a flat face: psi = n·x − d everywhere.
    #[inline]
    fn flat(&self) -> Option<(DVec3, f64)> {
        None
    }

    /// Centre and radius of a ball that the face bounds by itself: a closed surface.
    #[inline]
    fn ball(&self) -> Option<(DVec3, f64)> {
        None
    }

    /// The radius of a round face that has the same one everywhere, a length.
    #[inline]
    fn radius(&self) -> Option<f64> {
        None
    }

    /// Axis of a face that is developable and round, which is to say straight along one tangent at each point: it curves along
    /// axis × normal alone. A unit vector.
    #[inline]
    fn developable(&self) -> Option<DVec3> {
        None
    }

    /// The same of the face around the point `x` alone.
    #[inline]
    fn straight_at(&self, _x: DVec3) -> Option<DVec3> {
        self.developable()
    }

    /// A spine of what of psi <= 0 lies in the hull of some points, exact but for rounding where it is one point or lies along a line;
    /// `None` of faces that are not so thick everywhere.
    #[inline]
    fn spine(&self, _hull: &[DVec3]) -> Option<Spine> {
        None
    }

    /// The apex of a cone: the point at which every direction around is a normal.
    #[inline]
    fn apex(&self) -> Option<Apex> {
        None
    }

    /// A line through the inside of every closed curve that planes with this unit normal cut, where the axis is none.
    #[inline]
    fn skewer(&self, _normal: DVec3) -> Option<Axis> {
        None
    }

    /// Between which points of its axis it is straight, where that ends.
    #[inline]
    fn ends(&self) -> [Option<DVec3>; 2] {
        [None; 2]
    }

    /// True where the face is the same when it is moved along the unit vector `d`, to within `tolerance` (a sine).
    #[inline]
    fn slides_along(&self, _d: DVec3, _tolerance: f64) -> bool {
        false
    }

    /// The quadric of the face offset inwards by `inset` (a length, negative for outwards): its points of depth `inset`.
    /// `None` for what is none, or loses too many digits as one.
    #[inline]
    fn quadric(&self, _inset: f64) -> Option<Quadric> {
        None
    }

    /// The cross-section at the height of the point `y`; `None` for what is not round.
    fn section(&self, y: DVec3) -> Option<Section>;

    /// The foot of a tangent plane: a point of the surface at which it has the unit normal `normal` that `at(point)` gave, next to
    /// `point`. `size` (a length) is how far along an apex' ruling it is at least.
    fn foot(&self, point: DVec3, normal: DVec3, size: f64) -> DVec3;

    /// Lower bound of psi of this less that of `q` over the ball of radius `r` around `c`, and the size of the numbers at hand
    /// beside those of the ball; both lengths (`alike::above`).
    fn above(&self, q: &Self, c: DVec3, r: f64) -> (f64, f64);

    /// How far the surface lies off `other` over a body of the diameter `size`, a length; infinite where they look opposite ways.
    fn deviation(&self, other: &Self, size: f64) -> f64;

    /// The same for faces of one body, which are all the closer alike: an axis is off by the chord between unit vectors where
    /// its direction counts.
    #[inline]
    fn difference(&self, other: &Self, size: f64) -> f64 {
        self.deviation(other, size)
    }

    /// A number that differs by at most a few times what the psi of two faces of this kind differ over the ball of radius `r` around `c`.
    fn key(&self, c: DVec3, r: f64) -> f64;

    /// All that tells it from others of its kind, the rest 0.
    fn numbers(&self) -> [f64; NUMBERS];

    /// What it is to those who look for lines and circles that two faces have in common; `None` where none is looked for.
    #[inline]
    fn analytic(&self) -> Option<Analytic> {
        None
    }

    /// What a primitive of this face cut by planes is called.
    #[inline]
    fn quadric_name(&self) -> &'static str {
        "quadric"
    }

    /// Where psi <= 0 along the ray origin + t·direction (a unit vector), ends infinite where it never ends.
    fn inside(&self, origin: DVec3, direction: DVec3) -> Stretches;

    /// What psi is a sum of, for whoever computes it without knowing the kind; `None` where there is no such sum.
    #[inline]
    fn terms(&self) -> Option<Terms> {
        None
    }
}

/// Most numbers that tell a face.
pub const NUMBERS: usize = 11;

/// Any direction that no design has: what faces are sorted along.
const SKEW: DVec3 = DVec3::new(0.481_726_53, 0.663_114_9, 0.572_917_13);

/// Radial part of `x − origin` against `axis`: (distance from the axis, unit radial direction).
fn radial(offset: DVec3, axis: DVec3) -> (f64, DVec3) {
    let z = offset.dot(axis);
    let p = offset - axis * z;
    let rho = p.length();
    if rho <= ON_AXIS * offset.length() || rho == 0.0 {
        let u = any_perpendicular(axis);
        // Of its two signs the one towards the point: half as far off.
        return (rho, if u.dot(p) < 0.0 { -u } else { u });
    }
    let u = p / rho;
    let u = u - axis * u.dot(axis);
    (rho, u.normalize())
}

/// The heights along `axis` over `origin` between which some points stand.
fn heights(hull: &[DVec3], origin: DVec3, axis: DVec3) -> (f64, f64) {
    let each = hull.iter().map(|x| (*x - origin).dot(axis));
    each.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), z| (lo.min(z), hi.max(z)))
}

/// The curvature of a face of revolution about `axis` that is straight along its rulings.
#[inline]
fn around(axis: DVec3, at: &FaceAt) -> Curvature {
    // The tangent across the axis is the same for the cone's normal and its radial direction.
    Curvature { factor: at.k / at.rho, along: axis.cross(at.normal).normalize_or_zero(), ..Curvature::NONE }
}

/// The lowest value of the tangent plane at the centre of a box over it: psi is convex and lies above.
#[inline]
fn tangent(face: &impl Surface, center: DVec3, half: DVec3) -> f64 {
    let at = face.at(center);
    at.value - at.normal.abs().dot(half)
}

/// The largest value at a corner of a box c ± e: psi is convex and largest there.
#[inline]
fn largest_corner(face: &impl Surface, c: DVec3, e: DVec3) -> f64 {
    let signs = [-1.0, 1.0];
    let mut hi = f64::NEG_INFINITY;
    for x in signs {
        for y in signs {
            for z in signs {
                hi = hi.max(face.value(c + e * DVec3::new(x, y, z)));
            }
        }
    }
    hi
}
