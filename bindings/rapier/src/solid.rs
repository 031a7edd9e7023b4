//! A contactd object as a shape of parry: bounds and mass; its contacts come from the session.

use contactd_client::MassProperties as Mass;
use glam::DVec3;
use parry3d_f64::bounding_volume::{Aabb, BoundingSphere};
use parry3d_f64::mass_properties::MassProperties;
use parry3d_f64::math::{Matrix, Real, Vector};
use parry3d_f64::query::{PointProjection, PointQuery, Ray, RayCast, RayIntersection};
use parry3d_f64::shape::{FeatureId, Shape, ShapeType, TypedShape};

/// A vector in rapier's version of glam.
pub(crate) fn vector(v: DVec3) -> Vector {
    Vector::from_array(v.to_array())
}

/// The shape of a collider that is an object of a session. Made by [`crate::Coupling`].
///
/// It meets other solids of the same coupling. Rays miss it, and points project to its box: rapier's own queries are not
/// served, nor are contacts with rapier's other shapes.
#[derive(Clone, Debug)]
pub struct Solid {
    pub(crate) object: u32,
    pub(crate) is_fixed: bool,
    pub(crate) bounds: Aabb,
    pub(crate) mass: Mass,
}

impl Solid {
    /// The object's id in the session.
    pub fn object(&self) -> u32 {
        self.object
    }
}

impl Shape for Solid {
    fn compute_local_aabb(&self) -> Aabb {
        self.bounds
    }

    fn compute_local_bounding_sphere(&self) -> BoundingSphere {
        self.bounds.bounding_sphere()
    }

    fn clone_dyn(&self) -> Box<dyn Shape> {
        Box::new(self.clone())
    }

    fn scale_dyn(&self, _: Vector, _: u32) -> Option<Box<dyn Shape>> {
        None
    }

    fn mass_properties(&self, density: Real) -> MassProperties {
        if self.mass.volume <= 0.0 || density <= 0.0 {
            return MassProperties::default();
        }
        let mass = self.mass.with_density(density);
        let inertia = Matrix::from_cols_array(&mass.inertia_matrix().to_cols_array());
        MassProperties::with_inertia_matrix(vector(mass.center), mass.mass(), inertia)
    }

    fn shape_type(&self) -> ShapeType {
        ShapeType::Custom
    }

    fn as_typed_shape(&self) -> TypedShape<'_> {
        TypedShape::Custom(self)
    }

    fn ccd_thickness(&self) -> Real {
        self.bounds.half_extents().min_element()
    }

    fn ccd_angular_thickness(&self) -> Real {
        std::f64::consts::FRAC_PI_4
    }
}

impl RayCast for Solid {
    fn cast_local_ray_and_get_normal(&self, _: &Ray, _: Real, _: bool) -> Option<RayIntersection> {
        None
    }
}

impl PointQuery for Solid {
    fn project_local_point(&self, point: Vector, solid: bool) -> PointProjection {
        self.bounds.project_local_point(point, solid)
    }

    fn project_local_point_and_get_feature(&self, point: Vector) -> (PointProjection, FeatureId) {
        (self.project_local_point(point, false), FeatureId::Unknown)
    }
}
