//! Solids of revolution: a spin about the own axis moves nothing of them.

use crate::solid::Solid;
use crate::solid::surface::{Axis, Symmetry};
use glam::DVec3;

/// About what a solid may be symmetric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Revolution {
    /// Every face is symmetric about this axis.
    Axis(Axis),
    /// A sphere's centre: of a solid without another curved face any axis through it is left, as far as the other faces
    /// have it.
    Center(DVec3),
}

impl Revolution {
    /// About what a solid of the size `extent` may be symmetric; `None` when no axis can be one.
    pub fn of(solid: &Solid, extent: f64) -> Option<Self> {
        // The many planes of a large mesh have no axis in common.
        if solid.has_parts {
            return None;
        }
        let mut center = None;
        for face in solid.faces.listed() {
            match face.symmetry() {
                Symmetry::Axis(axis) => return is_symmetric(solid, &axis, extent).then_some(Self::Axis(axis)),
                Symmetry::Center(c) => center = Some(c),
                Symmetry::Normal(_) => {}
                Symmetry::None => return None,
            }
        }
        center.map(Self::Center)
    }

    /// The axis about which every face is symmetric; where any is, the one along `along` (any length).
    pub fn axis(&self, solid: &Solid, along: DVec3, extent: f64) -> Option<Axis> {
        match *self {
            Self::Axis(axis) => Some(axis),
            Self::Center(origin) => {
                let axis = Axis { origin, direction: along.try_normalize()? };
                is_symmetric(solid, &axis, extent).then_some(axis)
            }
        }
    }
}

/// True when every face of a solid of the size `extent` is symmetric about an axis.
fn is_symmetric(solid: &Solid, axis: &Axis, extent: f64) -> bool {
    solid.faces.listed().iter().all(|f| match f.symmetry() {
        Symmetry::Normal(normal) => axis.is_along(normal),
        Symmetry::Center(center) => axis.passes(center, extent),
        Symmetry::Axis(own) => axis.is_along(own.direction) && axis.passes(own.origin, extent),
        Symmetry::None => false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::{Label, Op, SolidBuilder, primitive::*};
    use contactd_proto::Pose;

    #[test]
    fn a_ring_has_an_axis_and_a_ring_with_a_hole_aside_has_none() {
        let build = |aside: f64| {
            let mut b = SolidBuilder::new();
            let ring = b.primitive(Cylinder { radius: 2.0, half_height: 1.0 }, Pose::IDENTITY, Label::default());
            let ball = b.primitive(Sphere { radius: 1.2 }, Pose::at(DVec3::Z), Label::default());
            let hole =
                b.primitive(Cylinder { radius: 0.2, half_height: 2.0 }, Pose::at(DVec3::X * aside), Label::default());
            let root = b.operation(Op::Difference, &[ring, ball, hole]);
            b.finish(root)
        };
        let axis_of = |s: &Solid, along: DVec3| Revolution::of(s, 3.0).and_then(|r| r.axis(s, along, 3.0));
        let axis = axis_of(&build(0.0), DVec3::X).expect("all about z");
        assert!(axis.is_along(DVec3::Z * 7.0) && axis.passes(DVec3::Z * 4.0, 3.0));
        assert_eq!(Revolution::of(&build(0.5), 3.0), None);
        let mut b = SolidBuilder::new();
        let cube = b.primitive(Cuboid { half: DVec3::ONE }, Pose::IDENTITY, Label::default());
        assert_eq!(Revolution::of(&b.finish(cube), 2.0), None);
        let mut b = SolidBuilder::new();
        let ball = b.primitive(Sphere { radius: 1.0 }, Pose::IDENTITY, Label::default());
        let floor = b.primitive(HalfSpace, Pose::IDENTITY, Label::default());
        let root = b.operation(Op::Intersection, &[ball, floor]);
        let dome = b.finish(root);
        assert!(axis_of(&dome, DVec3::Z * 2.0).is_some_and(|axis| axis.is_along(DVec3::Z)));
        assert_eq!(axis_of(&dome, DVec3::X), None);
    }
}
