//! The primitives, one file each: shape in its own frame, faces, bounds, names.
//!
//! Adding a primitive: a file here, and one row in the `shapes!` table below, which writes the enum and its dispatch.

use crate::math::{Aabb, Ball};
use crate::solid::{Face, Label};
use contactd_proto::Pose;
use glam::DVec3;

mod cone;
mod cuboid;
mod cylinder;
mod half_space;
mod polyhedron;
mod sphere;

pub use cone::Cone;
pub use cuboid::Cuboid;
pub use cylinder::Cylinder;
pub use half_space::HalfSpace;
pub use polyhedron::{Fit, MeshError, Polyhedron};
pub use sphere::Sphere;

/// What every primitive answers about itself, in its own frame.
pub trait Geometry {
    /// The faces psi <= 0 whose intersection it is, in a fixed order.
    fn faces(&self) -> Vec<Face>;
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
}

macro_rules! shapes {
    ($($variant:ident),+ $(,)?) => {
        /// The kinds of primitives, each in its own frame.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Shape { $(#[doc = concat!("See [`", stringify!($variant), "`].")] $variant($variant)),+ }

        impl Shape {
            /// The kind's own answers.
            pub fn geometry(&self) -> &dyn Geometry {
                match self { $(Shape::$variant(s) => s),+ }
            }
        }

        $(impl From<$variant> for Shape {
            fn from(s: $variant) -> Self { Shape::$variant(s) }
        })+
    };
}

shapes!(Sphere, Cylinder, Cone, Cuboid, Polyhedron, HalfSpace);

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
    pub faces: Vec<Face>,
    /// Id of its first face within the model.
    pub first_face: u32,
    /// Tight box in the model's frame.
    pub aabb: Aabb,
    /// Enclosing ball in the model's frame.
    pub ball: Ball,
}

impl Primitive {
    /// Places `shape` in a model; `first_face` is the number of faces of the primitives before it.
    pub fn new(shape: Shape, frame: Pose, label: Label, first_face: u32) -> Self {
        let g = shape.geometry();
        let faces = g.faces().iter().map(|f| f.placed(&frame)).collect();
        let aabb = g.aabb(&frame);
        let mut ball = g.ball();
        ball.center = frame.point(ball.center);
        Self { faces, aabb, ball, shape, frame, label, first_face }
    }

    /// Name of face `index` of its faces, in the words of its source: of a box that is mirrored there ±x are exchanged against
    /// its frame.
    pub fn face_name(&self, index: usize) -> String {
        let is_box = matches!(self.shape, Shape::Cuboid(_));
        let index = if self.label.mirrored && is_box && index < 2 { 1 - index } else { index };
        self.shape.geometry().face_name(index)
    }

    /// psi of the whole primitive: the largest of its faces' values. 1-Lipschitz, negative inside.
    pub fn value(&self, x: DVec3) -> f64 {
        self.faces.iter().fold(f64::NEG_INFINITY, |m, f| m.max(f.value(x)))
    }
}
