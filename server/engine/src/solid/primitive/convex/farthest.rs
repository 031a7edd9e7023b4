//! The points of a primitive that are farthest along a direction: what a plane that comes from there meets first.

use super::Convex;
use glam::{DMat3, DVec3};

/// What is farthest along a unit direction m, in a primitive's own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Farthest {
    /// Largest m·x.
    pub reach: f64,
    /// A point in the middle of those that reach so far: of a face, an edge or a side the middle of it, on the surface.
    pub middle: DVec3,
}

impl Convex<'_> {
    /// What is farthest along m, a unit vector; what lies as flat as `flat` (radians) across it does so as a whole.
    /// `None` for what has no bounds, or of which only others know.
    pub fn farthest(&self, m: DVec3, flat: f64) -> Option<Farthest> {
        let across = (m.x * m.x + m.y * m.y).sqrt();
        let middle = match *self {
            Convex::Ball(radius) => m * radius,
            Convex::Cuboid(half) => {
                DVec3::from_array([0, 1, 2].map(|k| if m[k].abs() <= flat { 0.0 } else { half[k].copysign(m[k]) }))
            }
            Convex::Capsule { half, radius } => {
                let end = if m.z.abs() <= flat { 0.0 } else { half.copysign(m.z) };
                DVec3::Z * end + m * radius
            }
            Convex::Round { bottom, top, half } => {
                let rim = |radius: f64, z: f64| {
                    let k = if across <= flat { 0.0 } else { radius / across };
                    DVec3::new(k * m.x, k * m.y, z)
                };
                let (above, below) = (rim(top, half), rim(bottom, -half));
                // The side, as far as both ends go, has its normals on one circle.
                let off = across * (top - bottom) + 2.0 * half * m.z;
                if off.abs() <= flat * (2.0 * half).hypot(top - bottom) {
                    0.5 * (above + below)
                } else if off > 0.0 {
                    above
                } else {
                    below
                }
            }
            Convex::Ellipsoid(_) => self.support(&DMat3::IDENTITY, DVec3::ZERO, m),
            Convex::Elliptic(f) => f.farthest(m, flat),
            Convex::Superellipsoid(s) => s.middle(m, flat),
            Convex::Corners(corners) => {
                let reach = self.extent([m.x, m.y, m.z]);
                let slack = flat * corners.iter().fold(0.0, |far: f64, v| far.max(v.distance(corners[0])));
                let held = corners.iter().filter(|v| m.dot(**v) >= reach - slack);
                let (sum, count) = held.fold((DVec3::ZERO, 0.0), |(sum, count), v| (sum + *v, count + 1.0));
                sum / count
            }
            Convex::HalfSpace | Convex::Other => return None,
        };
        Some(Farthest { reach: self.extent([m.x, m.y, m.z]), middle })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use crate::solid::primitive::{
        Capsule, Cone, Cuboid, Cylinder, Ellipsoid, EllipticFrustum, Polyhedron, Sphere, Superellipsoid, Torus,
    };
    use crate::solid::{Label, Primitive, Shape};
    use contactd_proto::Pose;
    use glam::DVec2;

    /// The point lies on the surface and reaches as far as is told, and no point of the solid reaches farther.
    #[test]
    fn nothing_reaches_farther_than_the_farthest_point() {
        let elliptic = |bottom, top, lean| {
            EllipticFrustum { semi: DVec2::new(0.7, 0.3), bottom, top, half_height: 0.4, lean }.into()
        };
        let superellipsoid =
            |e: f64, f: f64| Superellipsoid { semi: DVec3::new(0.3, 0.8, 0.5), exponents: DVec2::new(e, f) }.into();
        let shapes: [Shape; 15] = [
            Sphere { radius: 0.7 }.into(),
            Cuboid { half: DVec3::new(0.3, 0.5, 0.8) }.into(),
            Cylinder { radius: 0.4, half_height: 0.8 }.into(),
            Cone { bottom: 0.6, top: 0.0, half_height: 0.5 }.into(),
            Cone { bottom: 0.2, top: 0.8, half_height: 0.3 }.into(),
            Capsule { half: 0.5, radius: 0.3 }.into(),
            Torus { major: 0.6, minor: 0.2 }.into(),
            Ellipsoid { semi: DVec3::new(0.3, 0.8, 0.5) }.into(),
            superellipsoid(0.6, 0.3),
            superellipsoid(0.1, 0.1),
            superellipsoid(1.0, 0.2),
            elliptic(1.0, 1.0, DVec2::new(0.3, -0.2)),
            elliptic(1.0, 0.4, DVec2::new(0.0, 0.2)),
            elliptic(0.0, 1.0, DVec2::ZERO),
            Polyhedron::hull(vec![DVec3::ZERO, DVec3::X, DVec3::Y * 2.0, DVec3::Z]).expect("a tetrahedron").into(),
        ];
        let mut numbers = Random(5);
        for shape in &shapes {
            let primitive = Primitive::new(shape.clone(), Pose::IDENTITY, Label::default(), 0);
            let inside: Vec<DVec3> =
                (0..20_000).map(|_| numbers.vector(2.0)).filter(|x| primitive.value(*x) <= 0.0).collect();
            assert!(inside.len() > 50, "{shape:?}");
            let axes = DVec3::AXES.into_iter().flat_map(|a| [a, -a]);
            let drawn: Vec<DVec3> = (0..200).map(|_| numbers.vector(1.0).normalize()).collect();
            for m in axes.chain(drawn) {
                let Farthest { reach, middle } = shape.geometry().farthest(m, 1e-13).expect("bounded");
                let value = primitive.value(middle);
                assert!(value.abs() <= 4e-15 && (m.dot(middle) - reach).abs() <= 1e-15, "{shape:?}, {m}: {value}");
                let most = inside.iter().fold(f64::NEG_INFINITY, |far, x| far.max(m.dot(*x)));
                assert!(most <= reach && most > reach - 0.4, "{shape:?}, {m}: {most} of {reach}");
            }
        }
    }
}
