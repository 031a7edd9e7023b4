//! Solids of revolution: a spin about the own axis moves nothing of them.

use crate::solid::{Face, Solid};
use glam::DVec3;

/// An axis: a point of it and its unit direction, model frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// A point of the axis.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}

/// Directions this close are one: a few units in the last place of a unit vector.
const SAME: f64 = 8.0 * f64::EPSILON;

impl Axis {
    /// True when the axis passes through `point`, to a few units in the last place of `extent` (a length).
    pub fn passes(&self, point: DVec3, extent: f64) -> bool {
        (point - self.origin).cross(self.direction).length() <= SAME * extent
    }

    /// True when `v` (any length) is parallel to the axis.
    pub fn is_along(&self, v: DVec3) -> bool {
        v.cross(self.direction).length() <= SAME * v.length()
    }
}

impl Solid {
    /// The axis about which every face of the solid is symmetric, where there is one. `extent` is the solid's size. A
    /// solid of spheres alone about one centre has any axis through it: `along` chooses.
    pub fn axis_of_revolution(&self, along: DVec3, extent: f64) -> Option<Axis> {
        let mut axis = None;
        let mut center = None;
        for face in &self.faces {
            match *face {
                Face::Cylinder { origin, axis: direction, .. } | Face::Cone { apex: origin, axis: direction, .. } => {
                    axis = Some(Axis { origin, direction });
                    break;
                }
                Face::Sphere { center: c, .. } => center = Some(c),
                Face::Plane { .. } => {}
            }
        }
        let axis = axis.or_else(|| Some(Axis { origin: center?, direction: along.try_normalize()? }))?;
        let symmetric = self.faces.iter().all(|f| match *f {
            Face::Plane { normal, .. } => axis.is_along(normal),
            Face::Sphere { center, .. } => axis.passes(center, extent),
            Face::Cylinder { origin, axis: d, .. } | Face::Cone { apex: origin, axis: d, .. } => {
                axis.is_along(d) && axis.passes(origin, extent)
            }
        });
        symmetric.then_some(axis)
    }
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
        let axis = build(0.0).axis_of_revolution(DVec3::X, 3.0).expect("all about z");
        assert!(axis.is_along(DVec3::Z * 7.0) && axis.passes(DVec3::Z * 4.0, 3.0));
        assert_eq!(build(0.5).axis_of_revolution(DVec3::Z, 3.0), None);
        let mut b = SolidBuilder::new();
        let cube = b.primitive(Cuboid { half: DVec3::ONE }, Pose::IDENTITY, Label::default());
        assert_eq!(b.finish(cube).axis_of_revolution(DVec3::Z, 2.0), None);
    }
}
