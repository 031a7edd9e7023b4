//! The primitives, one file each: shape in its own frame, faces, bounds, moments, names, bytes.
//!
//! Adding a primitive: a file here, and one row in the `shapes!` table below, which writes the enum and its dispatch. Nobody
//! outside of this folder asks of what kind a primitive is: [`Convex`] tells what a convex one is to those who compute with it.

use crate::math::{Aabb, Ball, Moments};
use crate::solid::faces::{Faces, Planes};
use crate::solid::formula::{self, Formula};
use crate::solid::local::{self, LiteralId, Token, Truth};
use crate::solid::{Face, Label, Sense};
use contactd_proto::Pose;
use glam::DVec3;
use smallvec::SmallVec;
use std::sync::Arc;

mod capsule;
mod cone;
mod convex;
mod cuboid;
mod cylinder;
mod ellipsoid;
mod elliptic_frustum;
mod half_space;
mod polyhedron;
pub mod quadric;
mod sphere;
mod superellipsoid;
mod torus;
mod triangle_mesh;

pub use capsule::Capsule;
pub use cone::Cone;
pub use convex::{Convex, Discs, Farthest, Features, Foremost, Hold, Shown, Slope};
pub use cuboid::Cuboid;
pub use cylinder::Cylinder;
pub use ellipsoid::Ellipsoid;
pub use elliptic_frustum::EllipticFrustum;
pub use half_space::HalfSpace;
pub use polyhedron::{Corners, Fit, MeshError, Polyhedron};
pub use quadric::Quadric;
pub use sphere::Sphere;
pub use superellipsoid::Superellipsoid;
pub use torus::Torus;
pub use triangle_mesh::{Below, Closed, Crossed, FacetTree, MeshFault, Repair, TriangleMesh, WELD};

/// What every primitive answers about itself, in its own frame.
pub trait Geometry {
    /// The faces psi <= 0 whose intersection it is, or those that its formula names, in a fixed order.
    fn faces(&self) -> Vec<Face>;
    /// How many faces it counts as where they are limited.
    fn face_count(&self) -> usize {
        self.faces().len()
    }
    /// The same faces where they are too many to be listed: planes.
    fn many_faces(&self) -> Option<Arc<dyn Planes>> {
        None
    }
    /// The planes of its faces in their order, where they lie in a row: outward unit normals and offsets.
    fn planes(&self) -> Option<&[(DVec3, f64)]> {
        None
    }
    /// What it is of its faces, where it is not their intersection.
    fn formula(&self) -> Option<&Formula> {
        None
    }
    /// Of what has a formula, or a face that is not convex beside others: a box in its frame such that psi is at most a margin only in
    /// the box grown by that margin times `spread`, for the planes around it that it is and-ed with.
    fn domain(&self) -> Option<Aabb> {
        None
    }
    /// By how much more than such planes that box grows: 1 of planes along the axes.
    fn spread(&self) -> f64 {
        1.0
    }
    /// Of what has a formula: its surface as triangles, which rays of pictures meet.
    fn facets(&self) -> Option<Facets<'_>> {
        None
    }
    /// Of what has facets: boxes over them, made when somebody first asks; `None` where there are none, or none can be made.
    fn facet_tree(&self) -> Option<&FacetTree> {
        None
    }
    /// How far the planes of facets may lie off their corners, a length.
    fn facet_tolerance(&self) -> f64 {
        0.0
    }
    /// Name of face `index` of `faces`, in the field's words: "side", "top", "+x", "face 3".
    fn face_name(&self, index: usize) -> String;
    /// Tight axis-aligned box after the placement `frame`.
    fn aabb(&self, frame: &Pose) -> Aabb;
    /// Enclosing ball, in the primitive's frame.
    fn ball(&self) -> Ball;
    /// Smallest dimension (diameter, thickness): the resolution must stay well below it.
    fn smallest_dimension(&self) -> f64;
    /// A point in its interior, in its frame.
    fn interior_point(&self) -> DVec3;
    /// What it is to those who compute with convex bodies, in its frame.
    fn convex(&self) -> Convex<'_>;
    /// What of it is farthest along the unit direction m of its frame, as `Convex::farthest` has it; of what is not
    /// convex with its hull.
    fn farthest(&self, m: DVec3, flat: f64) -> Option<Farthest> {
        self.convex().farthest(m, flat)
    }
    /// Its moments in its frame, by a formula (`octree::mass::closed` has them all); `None` where there is none.
    fn moments(&self) -> Option<Moments>;
    /// What they leave open of its volume beside the rounding of a few formulas.
    fn moments_doubt(&self) -> f64 {
        0.0
    }
    /// A primitive of its kind and in its frame that holds all points at which f of it is at most `margin` (a length);
    /// `None` where edges or corners reach out farther than that.
    fn grown(&self, margin: f64) -> Option<Shape>;
    /// Where the source finds the face `index` of a primitive that it mirrors along x.
    fn mirrored_face(&self, index: usize) -> usize {
        index
    }
    /// The field's word for it.
    fn kind(&self) -> &'static str;
    /// Its sizes in words, lengths as in the source; empty where it has none.
    fn dimensions(&self) -> String;
    /// Writes what tells it from others of its kind.
    fn write(&self, out: &mut dyn Sink);
    /// Reads what `write` has written.
    ///
    /// # Errors
    /// What was expected of the bytes.
    fn read(from: &mut dyn Source) -> Checked<Self>
    where
        Self: Sized;
}

/// A closed surface of triangles.
#[derive(Clone, Copy, Debug)]
pub struct Facets<'a> {
    /// Its corners, in the primitive's frame.
    pub vertices: &'a [DVec3],
    /// Indices of corners, counter-clockwise from outside.
    pub triangles: &'a [[u32; 3]],
    /// Of each triangle its face, `u32::MAX` where it is too thin to have one.
    faces: &'a [u32],
}

impl Facets<'_> {
    /// The corners of a triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.triangles[triangle as usize].map(|v| self.vertices[v as usize])
    }

    /// The number of a triangle's face among those of the primitive; `None` of one that is too thin to have a plane.
    pub fn face_of(&self, triangle: u32) -> Option<u32> {
        Some(self.faces[triangle as usize]).filter(|face| *face != u32::MAX)
    }
}

/// What should have been in some bytes.
pub type Checked<T> = Result<T, &'static str>;

/// Where a primitive is written to.
pub trait Sink {
    /// Writes a count.
    fn word(&mut self, word: usize);
    /// Writes a number.
    fn number(&mut self, number: f64);
}

/// Where a primitive is read from. Its numbers are finite.
pub trait Source {
    /// The next count.
    ///
    /// # Errors
    /// There is none.
    fn word(&mut self) -> Checked<u32>;
    /// The next number.
    ///
    /// # Errors
    /// There is none, or it is not finite.
    fn finite(&mut self) -> Checked<f64>;
    /// Numbers that are left.
    fn left(&self) -> usize;
}

fn write_vector(out: &mut dyn Sink, v: DVec3) {
    v.to_array().into_iter().for_each(|x| out.number(x));
}

fn read_vector(from: &mut dyn Source) -> Checked<DVec3> {
    Ok(DVec3::new(from.finite()?, from.finite()?, from.finite()?))
}

macro_rules! shapes {
    ($($variant:ident = $tag:literal),+ $(,)?) => {
        /// The kinds of primitives, each in its own frame.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Shape { $(#[doc = concat!("See [`", stringify!($variant), "`].")] $variant($variant)),+ }

        impl Shape {
            /// The kind's own answers.
            pub fn geometry(&self) -> &dyn Geometry {
                match self { $(Shape::$variant(s) => s),+ }
            }

            /// What it is to those who compute with convex bodies, in its frame.
            #[inline]
            pub fn convex(&self) -> Convex<'_> {
                match self { $(Shape::$variant(s) => s.convex()),+ }
            }

            /// What it is of its faces, where it is not their intersection.
            #[inline]
            pub fn formula(&self) -> Option<&Formula> {
                match self { $(Shape::$variant(s) => s.formula()),+ }
            }

            /// The byte that tells its kind in a kept model.
            pub fn tag(&self) -> u8 {
                match self { $(Shape::$variant(_) => $tag),+ }
            }

            /// Reads a primitive of the kind `tag`.
            ///
            /// # Errors
            /// What was expected of the bytes.
            pub fn read(tag: u8, from: &mut dyn Source) -> Checked<Self> {
                // Two kinds of one tag do not compile.
                #[deny(unreachable_patterns)]
                match tag {
                    $($tag => Ok($variant::read(from)?.into()),)+
                    _ => Err("a kind of primitive"),
                }
            }
        }

        $(impl From<$variant> for Shape {
            fn from(s: $variant) -> Self { Shape::$variant(s) }
        })+
    };
}

shapes!(
    Sphere = 0,
    Cylinder = 1,
    Cone = 2,
    Cuboid = 3,
    Polyhedron = 4,
    HalfSpace = 5,
    Torus = 6,
    TriangleMesh = 7,
    Ellipsoid = 8,
    EllipticFrustum = 9,
    Capsule = 10,
    Quadric = 11,
    Superellipsoid = 12,
);

/// A primitive placed in a model.
#[derive(Clone, Debug)]
pub struct Primitive {
    /// Shape in its own frame.
    pub shape: Shape,
    /// The primitive's frame in the model.
    pub frame: Pose,
    /// Where it came from.
    pub label: Label,
    /// Faces in the model's frame; face `i` has the id `first_face + i` within the model.
    pub faces: Faces,
    /// Id of its first face within the model.
    pub first_face: u32,
    /// Tight box in the model's frame.
    pub aabb: Aabb,
    /// Enclosing ball in the model's frame.
    pub ball: Ball,
}

/// Planes up to which all faces are looked at.
const FEW_PLANES: usize = 16;
/// What placing a plane changes of its value at most, over the sizes that are in it: some tens of roundings.
const PLACED: f64 = 1e-14;

/// Planes and a point in their frame.
struct PlanesAt<'a> {
    planes: &'a [(DVec3, f64)],
    own: DVec3,
    /// What placing them may change of a value, but for what the value itself adds.
    slack: f64,
}

impl PlanesAt<'_> {
    fn values(&self) -> impl Iterator<Item = (usize, f64)> {
        self.planes.iter().map(|(normal, offset)| normal.dot(self.own) - offset).enumerate()
    }
}

impl Primitive {
    /// Places `shape` in a model; `first_face` is the number of faces of the primitives before it.
    pub fn new(shape: Shape, frame: Pose, label: Label, first_face: u32) -> Self {
        let g = shape.geometry();
        if let Convex::Corners(corners) = g.convex() {
            corners.prepare();
        }
        let faces = match g.many_faces() {
            Some(planes) => Faces::made(planes, frame),
            None => g.faces().iter().map(|f| f.placed(&frame)).collect::<Vec<Face>>().into(),
        };
        let aabb = g.aabb(&frame);
        let mut ball = g.ball();
        ball.center = frame.point(ball.center);
        Self { faces, aabb, ball, shape, frame, label, first_face }
    }

    /// Name of face `index` of its faces, in the words of its source: of a box that is mirrored there ±x are exchanged against
    /// its frame.
    pub fn face_name(&self, index: usize) -> String {
        let geometry = self.shape.geometry();
        geometry.face_name(if self.label.mirrored { geometry.mirrored_face(index) } else { index })
    }

    /// True where it is the intersection of convex faces; another one has a formula, or a first face that is not convex: alone, its psi
    /// the exact distance, or with planes around it (`Geometry::domain`).
    pub fn is_convex(&self) -> bool {
        self.shape.formula().is_none() && self.faces[0].is_convex()
    }

    /// psi of the whole primitive: the largest of its faces' values, or what its formula makes of them. 1-Lipschitz, negative
    /// inside.
    pub fn value(&self, x: DVec3) -> f64 {
        match self.shape.formula() {
            Some(formula) => formula.value(&mut |f| self.faces[f as usize].value(x)),
            None => self.highest(x).1,
        }
    }

    /// Of its faces the one with the largest psi, the first of equals, and that: of an intersection of faces its f. Of many planes those
    /// are looked at that may be it as they stand in the primitive's own frame, where they lie in a row.
    pub fn highest(&self, x: DVec3) -> (usize, f64) {
        let faces = self.faces.listed();
        let none = (0, f64::NEG_INFINITY);
        let higher = |best: (usize, f64), (i, f): (usize, f64)| if f > best.1 { (i, f) } else { best };
        let Some(own) = self.planes_at(x) else {
            return faces.iter().map(|face| face.value(x)).enumerate().fold(none, higher);
        };
        let (mut least, mut some) = (f64::NEG_INFINITY, SmallVec::<[(usize, f64); 16]>::new());
        for (i, value) in own.values() {
            if value >= least {
                some.push((i, value));
                least = least.max(value - own.slack - PLACED * value.abs());
            }
        }
        some.iter().filter(|(_, v)| *v >= least).map(|(i, _)| (*i, faces[*i].value(x))).fold(none, higher)
    }

    /// Of a solid of many planes the numbers of faces whose psi may be `least` or more; `None` for another one.
    pub fn not_below(&self, x: DVec3, least: f64) -> Option<SmallVec<[u32; 16]>> {
        let own = self.planes_at(x)?;
        let least = least - own.slack - PLACED * least.abs();
        Some(own.values().filter(|(_, value)| *value >= least).map(|(i, _)| i as u32).collect())
    }

    /// Its planes and a point in its own frame, if they are many.
    fn planes_at(&self, x: DVec3) -> Option<PlanesAt<'_>> {
        let planes = self.shape.geometry().planes().filter(|planes| planes.len() > FEW_PLANES)?;
        let own = self.frame.rotation.conjugate() * (x - self.frame.position);
        Some(PlanesAt { planes, own, slack: PLACED * (x.length() + self.frame.position.length()) })
    }

    /// Appends it as and/or of its literals (`local`), complemented where `sense` is negative, with what `truth` says of each: the
    /// third of a solid's contracts. Of a large mesh it has parts (`Solid::prune`).
    pub fn expression(&self, sense: Sense, out: &mut Vec<Token>, truth: &mut impl FnMut(LiteralId) -> Truth) -> Truth {
        if let Some(formula) = self.shape.formula() {
            return formula.write((self.first_face, sense), out, truth);
        }
        let kind = if sense == Sense::Positive { local::AND } else { local::OR };
        local::fold(kind, 0..self.faces.len() as u32, out, |i, out| {
            let id = LiteralId::new(self.first_face + i, sense);
            let known = truth(id);
            if known == Truth::Open {
                out.push(local::literal_token(id));
            }
            known
        })
    }

    /// Appends what a part of its expression says, as `expression` does.
    pub(super) fn open(
        &self,
        part: LiteralId,
        out: &mut Vec<Token>,
        truth: &mut impl FnMut(LiteralId) -> Truth,
    ) -> Truth {
        self.shape.formula().map_or(Truth::Open, |formula| formula.open(part, self.first_face, out, truth))
    }

    /// Its expression with few parts written out, as `Solid::prune` does.
    pub fn pruned(&self, sense: Sense, out: &mut Vec<Token>, truth: &mut impl FnMut(LiteralId) -> Truth) -> Truth {
        let start = out.len();
        match self.expression(sense, out, truth) {
            Truth::Open => formula::open_few(start, out, &mut |part, out| self.open(part, out, truth)),
            known => known,
        }
    }

    /// What is left of such an expression, few parts written out.
    pub fn prune(&self, tokens: &[Token], out: &mut Vec<Token>, truth: &mut impl FnMut(LiteralId) -> Truth) -> Truth {
        let start = out.len();
        match local::prune(tokens, out, truth) {
            Truth::Open => formula::open_few(start, out, &mut |part, out| self.open(part, out, truth)),
            known => known,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use glam::DQuat;

    /// Of hulls in any place, at points anywhere, on faces, edges and corners: the face with the largest psi is the one that a look at all
    /// of them finds, to the bit, and none that is not below a value is left out.
    #[test]
    fn the_highest_of_many_planes_is_the_highest_face() {
        let mut r = Random(7);
        let mut ties = 0;
        for k in 0..40 {
            let points: Vec<DVec3> = (0..20).map(|_| r.vector(1.0).normalize()).collect();
            let Some(hull) = Polyhedron::hull(points) else { continue };
            let corners = hull.vertices.to_vec();
            let turn = DQuat::from_scaled_axis(r.vector(3.0));
            let frame = Pose::new(r.vector(if k % 2 == 0 { 1.0 } else { 100.0 }), turn);
            let label = Label { name: "hull".into(), line: 1, column: 1, mirrored: false };
            let placed = Primitive::new(hull.into(), frame, label, 0);
            let faces = placed.faces.listed();
            assert!(faces.len() > FEW_PLANES, "{}", faces.len());
            for n in 0..300 {
                let own = match n % 4 {
                    0 => r.vector(2.0),
                    1 => corners[n % corners.len()],
                    2 => 0.5 * (corners[n % corners.len()] + corners[(n + 1) % corners.len()]),
                    _ => r.vector(1e-3),
                };
                let x = frame.point(own);
                let values: Vec<f64> = faces.iter().map(|face| face.value(x)).collect();
                let highest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let first = values.iter().position(|v| *v == highest).expect("one");
                assert_eq!(placed.highest(x), (first, highest), "{k} {n}");
                assert_eq!(placed.value(x), highest, "{k} {n}");
                let least = highest - 1e-13;
                let some = placed.not_below(x, least).expect("many planes");
                let above = (0_u32..).zip(&values).filter(|(_, v)| **v >= least).map(|(i, _)| i);
                ties += some.len().saturating_sub(1);
                assert!(above.into_iter().all(|i| some.contains(&i)), "{k} {n}: {some:?}");
            }
        }
        assert!(ties > 1000, "{ties}");
    }
}
