//! A primitive by what it shows along a direction, as the equations of a contact name it.

use crate::contact::exclusion::literal::Side;
use crate::contact::witness::newton::Constraint;
use crate::solid::local::LiteralId;
use crate::solid::primitive::{Features, Hold, Shown};
use crate::solid::{Primitive, Sense};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// Faces that meet in a feature, with the weights of their normals.
pub type Active = SmallVec<[(Constraint, f64); 8]>;

/// A primitive along the world's axes, seen from its own centre.
#[derive(Clone, Copy)]
pub struct ConvexPart<'a> {
    /// The primitive.
    pub primitive: &'a Primitive,
    pub axes: DMat3,
    pub features: Features,
}

impl<'a> ConvexPart<'a> {
    /// `None` for a primitive whose features are not known.
    pub fn new(primitive: &'a Primitive, axes: DMat3) -> Option<Self> {
        Some(Self { primitive, axes, features: Features::new(primitive.shape.convex())? })
    }

    /// A primitive of which nothing is asked but its faces.
    pub fn plain(primitive: &'a Primitive, axes: DMat3) -> Self {
        Self { primitive, axes, features: Features::none() }
    }

    /// What holds the unit outward direction m, as `Features::held` has it.
    pub fn held(&self, m: DVec3, tol: f64) -> (u8, bool) {
        self.features.held(&self.axes, m, tol)
    }

    /// Circles by their axes and leans.
    pub fn circles(&self, held: u8) -> impl Iterator<Item = (DVec3, f64)> {
        self.features.circles(&self.axes, held)
    }

    /// What is shown along the unit outward direction m, held as told.
    pub fn shown(&self, m: DVec3, held: (u8, bool)) -> Shown {
        self.features.shown(&self.axes, m, held)
    }

    /// The faces that meet in what is shown along the unit outward direction m, with the weights of their normals; `own`
    /// is m along the axes of the primitive's model.
    pub fn faces(&self, side: Side, m: DVec3, own: DVec3, shown: &Shown, out: &mut Active) {
        let id = |k: u32| LiteralId::new(self.primitive.first_face + k, Sense::Positive);
        self.features.holds(&self.axes, m, shown, |hold| match hold {
            Hold::Face(k, weight) => out.push((Constraint::Literal(side, id(k)), weight)),
            Hold::Apex => {
                if let Some(apex) = self.primitive.faces[0].apex() {
                    let along = apex.directions();
                    out.extend((0..3).map(|k| (Constraint::Apex(side, id(0), k), along[usize::from(k)].dot(own))));
                }
            }
        });
    }
}
