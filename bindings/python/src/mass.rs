//! Mass properties, with the arithmetic of their bounds left to Rust.

use crate::pose::pose;
use contactd_proto::MassProperties as Mass;
use pyo3::prelude::*;

/// Volume, centre of mass and inertia of a solid of even density. Every true value lies within its error of the one given.
#[pyclass(frozen, module = "contactd")]
#[derive(Debug)]
pub struct MassProperties(pub Mass);

#[pymethods]
impl MassProperties {
    /// Volume, length³.
    #[getter]
    fn volume(&self) -> f64 {
        self.0.volume
    }

    /// Bound of its error.
    #[getter]
    fn volume_error(&self) -> f64 {
        self.0.volume_error
    }

    /// Centre of mass x, y, z.
    #[getter]
    fn center(&self) -> (f64, f64, f64) {
        self.0.center.into()
    }

    /// Bounds of its error along each axis.
    #[getter]
    fn center_error(&self) -> (f64, f64, f64) {
        self.0.center_error.into()
    }

    /// Mass per volume.
    #[getter]
    fn density(&self) -> f64 {
        self.0.density
    }

    /// Density times volume.
    #[getter]
    fn mass(&self) -> f64 {
        self.0.mass()
    }

    /// Bound of the mass' error.
    #[getter]
    fn mass_error(&self) -> f64 {
        self.0.mass_error()
    }

    /// Inertia tensor about the centre of mass: xx, yy, zz, xy, xz, yz.
    #[getter]
    fn inertia(&self) -> (f64, f64, f64, f64, f64, f64) {
        self.0.inertia.into()
    }

    /// Bounds of its error, in the same order.
    #[getter]
    fn inertia_error(&self) -> (f64, f64, f64, f64, f64, f64) {
        self.0.inertia_error.into()
    }

    /// Boxes that were looked at; 0 where a closed formula answers.
    #[getter]
    fn boxes(&self) -> u64 {
        self.0.boxes
    }

    /// The same solid of another density, which is taken as exact.
    fn with_density(&self, density: f64) -> Self {
        Self(self.0.with_density(density))
    }

    /// The same solid seen from the parent of a pose.
    #[pyo3(signature = (position, rotation = [0.0, 0.0, 0.0, 1.0]))]
    fn placed(&self, position: [f64; 3], rotation: [f64; 4]) -> Self {
        Self(self.0.placed(&pose(position, rotation)))
    }

    fn __repr__(&self) -> String {
        let Mass { volume, volume_error, center, density, .. } = self.0;
        format!(
            "MassProperties(volume={volume} ± {volume_error:.1e}, center={:?}, density={density})",
            center.to_array()
        )
    }
}
