//! Solids told in code: `contactd_client::solid` as Python classes (`contactd/solid.py`).

use crate::pose::PoseFields;
use contactd_client::solid::{self, BuildError, Corners};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// What makes no sense is told by the call that asks for it.
fn sound<T>(built: T, check: impl FnOnce(&T) -> Result<(), BuildError>) -> PyResult<T> {
    check(&built).map_err(|e| PyValueError::new_err(e.to_string()))?;
    Ok(built)
}

/// A solid in the making.
#[pyclass(frozen, module = "contactd.solid", eq)]
#[derive(Clone, PartialEq)]
pub struct Solid(solid::Solid);

/// A flat shape in the making.
#[pyclass(frozen, module = "contactd.solid", eq)]
#[derive(Clone, PartialEq)]
pub struct Outline(solid::Outline);

fn solid(built: solid::Solid) -> PyResult<Solid> {
    sound(built, solid::Solid::check).map(Solid)
}

fn outline(built: solid::Outline) -> PyResult<Outline> {
    sound(built, solid::Outline::check).map(Outline)
}

#[pymethods]
impl Solid {
    #[getter]
    fn text(&self) -> PyResult<String> {
        self.0.text().map_err(|e| PyValueError::new_err(e.to_string()))
    }

    fn __repr__(&self) -> PyResult<String> {
        self.text()
    }

    fn __add__(&self, other: &Self) -> PyResult<Self> {
        solid(&self.0 + &other.0)
    }

    fn __sub__(&self, other: &Self) -> PyResult<Self> {
        solid(&self.0 - &other.0)
    }

    fn __and__(&self, other: &Self) -> PyResult<Self> {
        solid(&self.0 & &other.0)
    }

    fn moved(&self, x: f64, y: f64, z: f64) -> PyResult<Self> {
        solid(self.0.moved(DVec3::new(x, y, z)))
    }

    fn mirrored(&self, normal: [f64; 3]) -> PyResult<Self> {
        solid(self.0.mirrored(normal.into()))
    }

    fn scaled(&self, x: f64, y: f64, z: f64) -> PyResult<Self> {
        solid(self.0.scaled(DVec3::new(x, y, z)))
    }

    fn placed(&self, pose: &Bound<'_, PyAny>) -> PyResult<Self> {
        // What a pose may be written as is Python's to say.
        let fields: PoseFields = pose.py().import("contactd.pose")?.getattr("pose")?.call1((pose,))?.extract()?;
        solid(self.0.placed(&crate::pose::pose(fields.0, fields.1)))
    }

    fn transformed(&self, rows: [[f64; 4]; 3]) -> PyResult<Self> {
        let column = |k: usize| DVec3::new(rows[0][k], rows[1][k], rows[2][k]);
        let linear = DMat3::from_cols(column(0), column(1), column(2));
        solid(self.0.transformed(&DAffine3 { matrix3: linear, translation: column(3) }))
    }

    fn with_pieces(&self, pieces: u32) -> PyResult<Self> {
        solid(self.0.with_pieces(pieces))
    }

    fn cut(&self) -> PyResult<Outline> {
        outline(self.0.cut())
    }

    fn shadow(&self) -> PyResult<Outline> {
        outline(self.0.shadow())
    }
}

#[pymethods]
impl Outline {
    fn __add__(&self, other: &Self) -> PyResult<Self> {
        outline(&self.0 + &other.0)
    }

    fn __sub__(&self, other: &Self) -> PyResult<Self> {
        outline(&self.0 - &other.0)
    }

    fn __and__(&self, other: &Self) -> PyResult<Self> {
        outline(&self.0 & &other.0)
    }

    fn moved(&self, x: f64, y: f64) -> PyResult<Self> {
        outline(self.0.moved(x, y))
    }

    fn turned(&self, angle: f64) -> PyResult<Self> {
        outline(self.0.turned(angle))
    }

    fn mirrored(&self, normal: [f64; 2]) -> PyResult<Self> {
        outline(self.0.mirrored(normal.into()))
    }

    fn scaled(&self, x: f64, y: f64) -> PyResult<Self> {
        outline(self.0.scaled(x, y))
    }

    #[pyo3(signature = (by, corners = "round"))]
    fn offset(&self, by: f64, corners: &str) -> PyResult<Self> {
        let corners = match corners {
            "round" => Corners::Round,
            "sharp" => Corners::Sharp,
            "cut" => Corners::Cut,
            other => {
                return Err(PyValueError::new_err(format!("corners = {other:?} is none of round, sharp, cut")));
            }
        };
        outline(self.0.offset(by, corners))
    }

    fn with_pieces(&self, pieces: u32) -> PyResult<Self> {
        outline(self.0.with_pieces(pieces))
    }

    #[pyo3(signature = (height, scale = (1.0, 1.0)))]
    fn extrude(&self, height: f64, scale: (f64, f64)) -> PyResult<Solid> {
        let straight = scale == (1.0, 1.0);
        let tapered = || self.0.extrude_tapered(height, DVec2::new(scale.0, scale.1));
        solid(if straight { self.0.extrude(height) } else { tapered() })
    }

    fn twist(&self, height: f64, angle: f64, slices: u32) -> PyResult<Solid> {
        solid(self.0.extrude_twisted(height, angle, slices))
    }

    #[pyo3(signature = (angle = std::f64::consts::TAU))]
    fn revolve(&self, angle: f64) -> PyResult<Solid> {
        solid(self.0.revolve_part(angle))
    }
}

/// A primitive by its name and numbers.
#[pyfunction(name = "_primitive")]
pub fn primitive(name: &str, numbers: Vec<f64>) -> PyResult<Solid> {
    solid(match (name, numbers.as_slice()) {
        ("box", &[x, y, z]) => solid::cuboid(x, y, z),
        ("sphere", &[r]) => solid::sphere(r),
        ("cylinder", &[r, h]) => solid::cylinder(r, h),
        ("cone", &[bottom, top, h]) => solid::cone(bottom, top, h),
        ("torus", &[major, minor]) => solid::torus(major, minor),
        ("capsule", &[r, length]) => solid::capsule(r, length),
        ("paraboloid", &[r, h]) => solid::paraboloid(r, h),
        ("hyperboloid", &[r, waist, h]) => solid::hyperboloid(r, waist, h),
        ("hyperbolic_dome", &[r, h, cone]) => solid::hyperbolic_dome(r, h, cone),
        // A matrix, and two corners.
        ("quadric", all) if all.len() == 22 => {
            let m: [[f64; 4]; 4] = std::array::from_fn(|i| std::array::from_fn(|j| all[4 * i + j]));
            solid::quadric(&m, DVec3::from_slice(&all[16..]), DVec3::from_slice(&all[19..]))
        }
        ("superellipsoid", &[a, b, c, north, east]) => solid::superellipsoid(DVec3::new(a, b, c), [north, east]),
        ("half_space", &[x, y, z, offset]) => solid::half_space(DVec3::new(x, y, z), offset),
        _ => return Err(PyValueError::new_err(format!("{name} of {} numbers", numbers.len()))),
    })
}

/// A flat primitive by its name and numbers.
#[pyfunction(name = "_outline")]
pub fn flat(name: &str, numbers: Vec<f64>) -> PyResult<Outline> {
    outline(match (name, numbers.as_slice()) {
        ("circle", &[r]) => solid::circle(r),
        ("rectangle", &[x, y]) => solid::rectangle(x, y),
        _ => return Err(PyValueError::new_err(format!("{name} of {} numbers", numbers.len()))),
    })
}

/// The polygon within an odd number of paths.
#[pyfunction(name = "_polygon")]
pub fn polygon(paths: Vec<Vec<[f64; 2]>>) -> PyResult<Outline> {
    let paths: Vec<Vec<DVec2>> = paths.into_iter().map(|p| p.into_iter().map(DVec2::from).collect()).collect();
    outline(solid::polygon_of_paths(&paths))
}

/// The solid within faces, counter-clockwise as seen from outside.
#[pyfunction(name = "_polyhedron")]
pub fn polyhedron(points: Vec<[f64; 3]>, faces: Vec<Vec<u32>>) -> PyResult<Solid> {
    let points: Vec<DVec3> = points.into_iter().map(DVec3::from).collect();
    solid(solid::polyhedron(&points, &faces))
}

/// The solid under rows of heights.
#[pyfunction(name = "_height_field")]
pub fn height_field(rows: Vec<Vec<f64>>, x: f64, y: f64, base: f64) -> PyResult<Solid> {
    solid(solid::height_field(&rows, x, y, base))
}

/// Union, intersection, hull or Minkowski sum of solids.
#[pyfunction(name = "_join")]
pub fn join(name: &str, of: Vec<PyRef<'_, Solid>>) -> PyResult<Solid> {
    let all = of.iter().map(|s| s.0.clone());
    solid(match name {
        "union" => solid::union(all),
        "intersection" => solid::intersection(all),
        "hull" => solid::hull(all),
        "minkowski" => solid::minkowski(all),
        other => return Err(PyValueError::new_err(format!("{other} is no operation"))),
    })
}

/// Union, intersection or hull of outlines.
#[pyfunction(name = "_join_outlines")]
pub fn join_outlines(name: &str, of: Vec<PyRef<'_, Outline>>) -> PyResult<Outline> {
    let all = of.iter().map(|s| s.0.clone());
    outline(match name {
        "union" => solid::Outline::union(all),
        "intersection" => solid::Outline::intersection(all),
        "hull" => solid::Outline::hull(all),
        other => return Err(PyValueError::new_err(format!("{other} is no operation"))),
    })
}
