//! Mass and inertia of a body about its centre of mass, in the body's own frame.

use contactd_proto::{MassProperties, Pose};
use glam::{DMat3, DVec3};

/// Mass properties. The body's origin is its centre of mass: where the model's is elsewhere, `Object::place` moves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// Mass, > 0.
    pub mass: f64,
    /// Tensor about the centre of mass, mass × length², symmetric and positive definite.
    pub tensor: DMat3,
}

impl Inertia {
    /// Mass and principal moments about the frame's axes.
    pub fn principal(mass: f64, moments: DVec3) -> Self {
        Self { mass, tensor: DMat3::from_diagonal(moments) }
    }

    /// A solid ball: 2/5 m r².
    pub fn sphere(mass: f64, radius: f64) -> Self {
        Self::principal(mass, DVec3::splat(0.4 * mass * radius * radius))
    }

    /// A solid box by its full edge lengths: m (y² + z²) / 12 about x, and so on.
    pub fn cuboid(mass: f64, size: DVec3) -> Self {
        let q = size * size;
        Self::principal(mass, DVec3::new(q.y + q.z, q.z + q.x, q.x + q.y) * (mass / 12.0))
    }

    /// A solid cylinder about z: m r² / 2 about its axis, m (3 r² + h²) / 12 across.
    pub fn cylinder(mass: f64, radius: f64, height: f64) -> Self {
        let across = mass * (3.0 * radius * radius + height * height) / 12.0;
        Self::principal(mass, DVec3::new(across, across, 0.5 * mass * radius * radius))
    }

    /// A body of what a model's mass properties say, and where the model sits in its frame (`Object::place`): the centre of
    /// mass in the origin, axes alike. `properties` are in the model's frame, of the body's density.
    pub fn of_model(properties: &MassProperties) -> (Self, Pose) {
        let body = Self { mass: properties.mass(), tensor: properties.inertia_matrix() };
        (body, Pose::at(-properties.center))
    }

    /// The same body seen from a frame turned and moved: its centre of mass stays its own. Steiner's theorem is used by
    /// [`Inertia::and`], which joins parts.
    pub fn turned(&self, rotation: DMat3) -> Self {
        Self { mass: self.mass, tensor: rotation * self.tensor * rotation.transpose() }
    }

    /// Two rigidly joined parts, each with its centre of mass in a common frame (axes alike): the whole and its centre.
    pub fn and(&self, own: DVec3, other: &Self, others: DVec3) -> (Self, DVec3) {
        let mass = self.mass + other.mass;
        let centre = (own * self.mass + others * other.mass) / mass;
        let tensor = self.about(own - centre) + other.about(others - centre);
        (Self { mass, tensor }, centre)
    }

    /// Tensor about a point that lies at -d from the centre of mass (Steiner).
    fn about(&self, d: DVec3) -> DMat3 {
        let outer = DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        self.tensor + (DMat3::from_diagonal(DVec3::splat(d.length_squared())) - outer) * self.mass
    }

    /// Why the numbers cannot be a body's; `None` when they can.
    pub(super) fn fault(&self) -> Option<&'static str> {
        let t = &self.tensor;
        let minor = t.x_axis.x * t.y_axis.y - t.x_axis.y * t.y_axis.x;
        let definite = t.x_axis.x > 0.0 && minor > 0.0 && t.determinant() > 0.0;
        let skew = (*t - t.transpose()).to_cols_array().iter().fold(0.0f64, |m, c| m.max(c.abs()));
        if !(self.mass > 0.0 && self.mass.is_finite() && t.is_finite()) {
            Some("mass and inertia must be positive and finite")
        } else if !definite || skew > 1e-12 * t.x_axis.x {
            Some("the inertia tensor must be symmetric and positive definite")
        } else {
            None
        }
    }

    /// Radius of gyration: turns speeds of rotation into speeds of points.
    pub(super) fn radius(&self) -> f64 {
        let trace = self.tensor.x_axis.x + self.tensor.y_axis.y + self.tensor.z_axis.z;
        (0.5 * trace / self.mass).sqrt()
    }

    /// True when every axis is a principal one: such a body spins without wobble.
    pub(super) fn is_round(&self) -> bool {
        let m = self.tensor.x_axis.x;
        self.tensor == DMat3::from_diagonal(DVec3::splat(m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_half_boxes_are_a_box() {
        let half = Inertia::cuboid(1.5, DVec3::new(1.0, 2.0, 1.5));
        let (whole, centre) = half.and(DVec3::new(0.0, 0.0, 0.75), &half, DVec3::new(0.0, 0.0, 2.25));
        let expected = Inertia::cuboid(3.0, DVec3::new(1.0, 2.0, 3.0));
        assert!((centre - DVec3::new(0.0, 0.0, 1.5)).length() < 1e-15);
        assert!(
            whole.mass == expected.mass
                && (whole.tensor - expected.tensor).to_cols_array().iter().all(|c| c.abs() < 1e-14)
        );
    }

    #[test]
    fn numbers_that_are_no_body_are_named() {
        assert_eq!(Inertia::sphere(1.0, 0.5).fault(), None);
        assert!(Inertia::sphere(0.0, 0.5).fault().is_some());
        assert!(Inertia::principal(1.0, DVec3::new(1.0, -1.0, 1.0)).fault().is_some());
        assert!(
            Inertia { mass: 1.0, tensor: DMat3::from_cols(DVec3::X, DVec3::new(0.5, 1.0, 0.0), DVec3::Z) }
                .fault()
                .is_some()
        );
    }

    #[test]
    fn a_turned_cylinder_has_its_axis_along_x() {
        let c = Inertia::cylinder(2.0, 0.5, 3.0);
        let turned = c.turned(DMat3::from_cols(DVec3::NEG_Z, DVec3::Y, DVec3::X));
        assert!((turned.tensor.x_axis.x - c.tensor.z_axis.z).abs() < 1e-15);
        assert!((turned.tensor.z_axis.z - c.tensor.x_axis.x).abs() < 1e-15);
    }
}
