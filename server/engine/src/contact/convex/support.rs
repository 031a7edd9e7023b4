//! A convex primitive where it stands: how far it reaches along a direction, and with which point.
//!
//! Static dispatch on the shape, nothing allocated: this is the innermost loop of the advance.
//! A ball is its centre and a margin, a capsule a segment and a margin: then the distance of two balls is that of two points, found
//! at once.

use crate::solid::Shape;
use crate::solid::primitive::{Convex, Slope};
use glam::{DMat3, DVec3};

/// A bounded convex primitive in a frame.
#[derive(Clone, Copy, Debug)]
pub struct ConvexBody<'s> {
    shape: Convex<'s>,
    axes: DMat3,
    origin: DVec3,
    /// What the primitive is thicker than its core, as `Convex::margin` has it.
    pub margin: f64,
}

impl<'s> ConvexBody<'s> {
    /// A primitive's shape with its own frame; `None` for one without bounds.
    pub fn new(shape: &'s Shape, axes: DMat3, origin: DVec3) -> Option<Self> {
        let shape = shape.convex();
        shape.is_known().then(|| Self { shape, axes, origin, margin: shape.margin() })
    }

    /// The same body in a frame that sees its own by `axes` and `origin`.
    pub fn seen(&self, axes: &DMat3, origin: DVec3) -> Self {
        Self { axes: *axes * self.axes, origin: *axes * self.origin + origin, ..*self }
    }

    /// The same body in the frame of its primitive.
    pub fn unplaced(&self) -> Self {
        Self { axes: DMat3::IDENTITY, origin: DVec3::ZERO, ..*self }
    }

    /// Normals of its sides, as `Convex::sides` has them.
    pub fn sides(&self, way: DVec3) -> [DVec3; 3] {
        self.shape.sides([self.axes.x_axis, self.axes.y_axis, self.axes.z_axis], way)
    }

    /// A point inside, mostly the centre of its frame.
    pub fn center(&self) -> DVec3 {
        self.origin + self.axes * self.shape.middle()
    }

    /// The core's farthest point along n, which may have any length.
    #[inline]
    pub fn support(&self, n: DVec3) -> DVec3 {
        self.shape.support(&self.axes, self.origin, n)
    }

    /// Largest n·x over the body.
    #[inline]
    pub fn reach(&self, n: DVec3) -> f64 {
        n.dot(self.origin) + self.shape.reach_along(&self.axes, n)
    }

    /// How deep a point is in the body, as `Convex::slope` has it.
    #[inline]
    pub fn slope(&self, x: DVec3) -> Option<Slope> {
        self.shape.slope(&self.axes, x - self.origin)
    }

    /// How many faces it takes to hold what a polyhedron shows along the unit direction n, as `Convex::corner` has it.
    pub fn corner(&self, n: DVec3) -> usize {
        self.shape.corner(&self.axes, n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use crate::solid::primitive::{Capsule, Cone, Cuboid, Cylinder, Sphere};
    use crate::solid::{Label, Primitive};
    use contactd_proto::Pose;
    use contactd_proto::motion::quat_of_rotation_vector;

    #[test]
    fn the_value_of_a_body_is_the_largest_of_its_faces() {
        let shapes: [Shape; 7] = [
            Capsule { half: 0.6, radius: 0.3 }.into(),
            Sphere { radius: 0.7 }.into(),
            Cuboid { half: DVec3::new(0.5, 0.9, 0.2) }.into(),
            Cylinder { radius: 0.4, half_height: 0.8 }.into(),
            Cone { bottom: 0.6, top: 0.0, half_height: 0.5 }.into(),
            Cone { bottom: 0.0, top: 0.3, half_height: 0.9 }.into(),
            Cone { bottom: 0.2, top: 0.8, half_height: 0.3 }.into(),
        ];
        let mut numbers = Random(11);
        let mut v = |size: f64| {
            let mut n = || numbers.within(-size, size);
            DVec3::new(n(), n(), n())
        };
        for shape in &shapes {
            let frame = Pose::new(v(2.0), quat_of_rotation_vector(v(3.0)));
            let primitive = Primitive::new(shape.clone(), frame, Label::default(), 0);
            let body = ConvexBody::new(shape, frame.matrix(), frame.position).expect("bounded");
            let mut inside = 0;
            for _ in 0..20_000 {
                let x = frame.position + v(1.2);
                let (faces, own) = (primitive.value(x), body.slope(x).expect("no polyhedron").f);
                assert!((faces - own).abs() <= 1e-14, "{shape:?} at {x}: {faces}, {own}");
                // The plane of its face lies below f everywhere.
                let Slope { normal, face, .. } = body.slope(x).expect("no polyhedron");
                assert!(
                    (primitive.faces[face as usize].value(x) - own).abs() <= 1e-14,
                    "{shape:?} at {x}: face {face}"
                );
                let other = frame.position + v(1.2);
                let plane = own + normal.dot(other - x);
                let f = body.slope(other).expect("no polyhedron").f;
                assert!((normal.length() - 1.0).abs() < 1e-15 && plane <= f + 1e-14, "{shape:?} at {x}, {other}");
                inside += u32::from(own < 0.0);
            }
            assert!(inside > 200, "{shape:?}: {inside}");
        }
    }
}
