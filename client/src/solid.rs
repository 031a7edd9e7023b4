//! Solids told in code: `cuboid(40.0, 40.0, 4.0) - cylinder(3.0, 9.0)`, printed as the OpenSCAD text that the server loads.
//!
//! A [`Solid`] is a tree of calls. [`Solid::text`] prints it, and that text alone is what is loaded: by a session, by
//! `contactd check` from a file, by OpenSCAD. So a solid that is loaded has the bits of its printed text; numbers are printed with as
//! many digits as tell them apart from all other doubles.
//!
//! Everything stands around the origin of its own frame: a box is centred, a cylinder's axis is z and its middle the origin.
//! Lengths are in the model's unit, angles in radians, axes right-handed. Curved primitives are exact; where something made
//! of them has no exact form (docs/openscad.md) it is cut into pieces, as many as [`Solid::with_pieces`] says.
//!
//! What makes no sense (a radius below 0, a hull of nothing) is kept as the first [`BuildError`] and told when the text is asked for, so
//! that operators need no `?`.
//!
//! ```
//! use contactd_client::solid::{cuboid, cylinder};
//! let plate = cuboid(40.0, 40.0, 4.0) - cylinder(3.0, 9.0);
//! let text = "difference() {\n\tcube(size = [40, 40, 4], center = true);\n\tcylinder(h = 9, r1 = 3, r2 = 3, center = true);\n}\n";
//! assert_eq!(plate.text().unwrap(), text);
//! ```

mod outline;
mod tree;

pub use outline::{Corners, Outline, circle, polygon, polygon_of_paths, rectangle};
pub use tree::BuildError;

use contactd_proto::Pose;
use contactd_proto::pose_record::QUATERNION_TOLERANCE;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::borrow::Cow;
use std::ops::{Add, BitAnd, Sub};
use tree::{Tree, list, number, positive};

/// A solid in the making. Cheap to clone: its parts are shared.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid(Tree);

/// A box with these lengths of its edges along x, y and z.
pub fn cuboid(x: f64, y: f64, z: f64) -> Solid {
    let sides = [("length along x", x), ("length along y", y), ("length along z", z)];
    leaf("box", &sides, || format!("cube(size = {}, center = true", list(&[x, y, z])), false)
}

/// A ball.
pub fn sphere(radius: f64) -> Solid {
    leaf("sphere", &[("radius", radius)], || format!("sphere(r = {}", number(radius)), true)
}

/// A cylinder along z, from −height/2 to height/2.
pub fn cylinder(radius: f64, height: f64) -> Solid {
    let (r, h) = (number(radius), number(height));
    let call = || format!("cylinder(h = {h}, r1 = {r}, r2 = {r}, center = true");
    leaf("cylinder", &[("radius", radius), ("height", height)], call, true)
}

/// A cone or frustum along z: of radius `bottom` at −height/2, of radius `top` at height/2; one of them may be 0.
pub fn cone(bottom: f64, top: f64, height: f64) -> Solid {
    for (what, radius) in [("bottom", bottom), ("top", top)] {
        if !(radius >= 0.0 && radius.is_finite()) {
            return Solid(BuildError::new("cone", format!("a {what} radius of 0 or more"), number(radius)).into());
        }
    }
    let call = || {
        let [h, r1, r2] = [height, bottom, top].map(number);
        format!("cylinder(h = {h}, r1 = {r1}, r2 = {r2}, center = true")
    };
    leaf("cone", &[("height", height), ("larger radius", bottom.max(top))], call, true)
}

/// All points within `minor` of the circle of radius `major` about z.
pub fn torus(major: f64, minor: f64) -> Solid {
    if major <= minor {
        let found = format!("{} and {}", number(major), number(minor));
        return Solid(BuildError::new("torus", "a major radius above the minor one".into(), found).into());
    }
    circle(minor).moved(major, 0.0).revolve()
}

/// All points within `radius` of the segment along z from −length/2 to length/2.
pub fn capsule(radius: f64, length: f64) -> Solid {
    if let Err(wrong) = positive("capsule", "length", length) {
        return Solid(wrong.into());
    }
    let end = sphere(radius);
    let far = DVec3::new(0.0, 0.0, 0.5 * length);
    hull([end.moved(-far), end.moved(far)])
}

/// A dome along z, from its rim of radius `radius` at −height/2 to its tip at height/2: all points with
/// (x² + y²)/radius² <= 1/2 − z/height above the rim. Scaled along x and y it is elliptic.
pub fn paraboloid(radius: f64, height: f64) -> Solid {
    let call = || format!("paraboloid(h = {}, r = {}, center = true", number(height), number(radius));
    leaf("paraboloid", &[("radius", radius), ("height", height)], call, false)
}

/// A hyperboloid of one sheet about z, of radius `radius` at ±height/2 and `waist`, which is smaller, at z = 0.
pub fn hyperboloid(radius: f64, waist: f64, height: f64) -> Solid {
    if waist >= radius {
        let found = format!("{} and {}", number(waist), number(radius));
        return Solid(BuildError::new("hyperboloid", "a waist below the radius".into(), found).into());
    }
    let call = || {
        let [h, r, w] = [height, radius, waist].map(number);
        format!("hyperboloid(h = {h}, r = {r}, waist = {w}, center = true")
    };
    leaf("hyperboloid", &[("radius", radius), ("waist", waist), ("height", height)], call, false)
}

/// A dome as `paraboloid`, of one sheet of a hyperboloid of two: downwards it nears a cone, whose tip is `cone` above its own.
pub fn hyperbolic_dome(radius: f64, height: f64, cone: f64) -> Solid {
    let call = || {
        let [h, r, c] = [height, radius, cone].map(number);
        format!("hyperboloid(h = {h}, r = {r}, cone = {c}, center = true")
    };
    leaf(
        "hyperbolic dome",
        &[("radius", radius), ("height", height), ("distance of the cone's tip", cone)],
        call,
        false,
    )
}

/// All points x of the box from `min` to `max` with [x, y, z, 1] M [x, y, z, 1]ᵀ <= 0, M symmetric: of any quadric, its sheets
/// and branches included. Planes alone are none.
pub fn quadric(m: &[[f64; 4]; 4], min: DVec3, max: DVec3) -> Solid {
    let refused = |expected: &str, found: String| Solid(BuildError::new("quadric", expected.into(), found).into());
    if m.iter().flatten().any(|x| !x.is_finite()) {
        return refused("a matrix of finite numbers", format!("{m:?}"));
    }
    if let Some((i, j)) = (0..4).flat_map(|i| (0..i).map(move |j| (i, j))).find(|(i, j)| m[*i][*j] != m[*j][*i]) {
        return refused("a symmetric matrix", format!("{} and {} across its diagonal", m[i][j], m[j][i]));
    }
    if !(min.cmplt(max).all() && min.is_finite() && max.is_finite()) {
        return refused("min below max in all coordinates", format!("{min} and {max}"));
    }
    let rows: Vec<String> = m.iter().map(|row| list(row)).collect();
    let [min, max] = [min, max].map(|v| list(&v.to_array()));
    Solid(Tree::leaf(format!("quadric(m = [{}], min = {min}, max = {max}", rows.join(", ")), false))
}

/// All points with (|x/a|^(2/e2) + |y/b|^(2/e2))^(e2/e1) + |z/c|^(2/e1) <= 1 for the semi-axes `radii` = (a, b, c) and the exponents
/// e1 (north to south) and e2 (east to west), each from 0.1 to 1: an ellipsoid with both 1, towards 0 a box.
pub fn superellipsoid(radii: DVec3, [north, east]: [f64; 2]) -> Solid {
    if let Some(e) = [north, east].into_iter().find(|e| !(0.1..=1.0).contains(e)) {
        return Solid(BuildError::new("superellipsoid", "exponents from 0.1 to 1".into(), number(e)).into());
    }
    let lengths = [("radius along x", radii.x), ("radius along y", radii.y), ("radius along z", radii.z)];
    let call = || format!("superellipsoid(r = {}, e = {}", list(&radii.to_array()), list(&[north, east]));
    leaf("superellipsoid", &lengths, call, false)
}

/// The solid within faces, convex or not: lists of indices of `points`, counter-clockwise as seen from outside.
pub fn polyhedron(points: &[DVec3], faces: &[impl AsRef<[u32]>]) -> Solid {
    let refused = |expected: &str, found: String| Solid(BuildError::new("polyhedron", expected.into(), found).into());
    if let Some(p) = points.iter().find(|p| !p.is_finite()) {
        return refused("finite points", p.to_string());
    }
    for (i, face) in faces.iter().enumerate() {
        let face = face.as_ref();
        if face.len() < 3 {
            return refused("faces of three corners or more", format!("{} in face {i}", face.len()));
        }
        if let Some(corner) = face.iter().find(|c| **c as usize >= points.len()) {
            return refused(&format!("indices of {} points", points.len()), format!("{corner} in face {i}"));
        }
    }
    if faces.len() < 4 {
        return refused("four faces or more", faces.len().to_string());
    }
    let points: Vec<String> = points.iter().map(|p| list(&p.to_array())).collect();
    // OpenSCAD's faces run clockwise.
    let face = |f: &[u32]| format!("[{}]", f.iter().rev().map(u32::to_string).collect::<Vec<_>>().join(", "));
    let faces: Vec<String> = faces.iter().map(|f| face(f.as_ref())).collect();
    let call = format!("polyhedron(points = [{}], faces = [{}]", points.join(", "), faces.join(", "));
    Solid(Tree::leaf(call, false))
}

/// The half-space normal·x <= offset |normal|: a floor or a wall of its own, or to be cut with something. A solid that
/// reaches to infinity has no mass properties.
pub fn half_space(normal: DVec3, offset: f64) -> Solid {
    let Some(n) = normal.try_normalize().filter(|_| offset.is_finite()) else {
        let found = format!("{normal} and {offset}");
        return Solid(BuildError::new("half-space", "a direction and a finite offset".into(), found).into());
    };
    let (x, y) = n.any_orthonormal_pair();
    let frame = DAffine3::from_mat3_translation(DMat3::from_cols(y, x, -n), n * offset);
    // All of z >= 0.
    Solid(Tree::leaf("cylinder(h = inf, r1 = inf, r2 = inf".into(), false)).transformed(&frame)
}

/// The solid between the plane z = `base` and heights above it: rows that go up in y, of the same number of heights
/// each, which go up in x, at the corners of equal cells of a rectangle of the lengths `x` and `y` about the origin.
/// Each cell is two triangles that meet along the diagonal from its corner of least x and y to that of most. OpenSCAD
/// does not have it: what is printed only loads here.
pub fn height_field(rows: &[impl AsRef<[f64]>], x: f64, y: f64, base: f64) -> Solid {
    let refused = |expected: &str, found: String| Solid(BuildError::new("height field", expected.into(), found).into());
    let columns = rows.first().map_or(0, |r| r.as_ref().len());
    if rows.len() < 2 || columns < 2 {
        return refused("two rows of two heights or more", format!("{} of {columns}", rows.len()));
    }
    let mut lowest = f64::INFINITY;
    for (i, row) in rows.iter().enumerate() {
        let row = row.as_ref();
        if row.len() != columns {
            return refused("rows of one length", format!("{columns} heights in row 0 and {} in row {i}", row.len()));
        }
        if let Some(z) = row.iter().find(|z| !z.is_finite()) {
            return refused("finite heights", format!("{z} in row {i}"));
        }
        lowest = row.iter().copied().fold(lowest, f64::min);
    }
    if !(base < lowest && base.is_finite()) {
        return refused(&format!("a base below the lowest height, {lowest}"), number(base));
    }
    let call = || {
        let rows: Vec<String> = rows.iter().map(|r| list(r.as_ref())).collect();
        format!("height_field(heights = [{}], size = {}, base = {}", rows.join(", "), list(&[x, y]), number(base))
    };
    leaf("height field", &[("length along x", x), ("length along y", y)], call, false)
}

/// All points of any of some solids.
pub fn union(of: impl IntoIterator<Item = Solid>) -> Solid {
    join("union", of)
}

/// All points that some solids have in common.
pub fn intersection(of: impl IntoIterator<Item = Solid>) -> Solid {
    join("intersection", of)
}

/// The convex hull of some solids.
pub fn hull(of: impl IntoIterator<Item = Solid>) -> Solid {
    join("hull", of)
}

/// The Minkowski sum of some solids: all sums of a point of each.
pub fn minkowski(of: impl IntoIterator<Item = Solid>) -> Solid {
    join("minkowski", of)
}

fn join(name: &'static str, of: impl IntoIterator<Item = Solid>) -> Solid {
    Solid(Tree::join(name, of.into_iter().map(|s| s.0)))
}

fn leaf(name: &'static str, lengths: &[(&str, f64)], call: impl FnOnce() -> String, curved: bool) -> Solid {
    let wrong = lengths.iter().find_map(|(what, length)| positive(name, what, *length).err());
    Solid(wrong.map_or_else(|| Tree::leaf(call(), curved), Tree::from))
}

impl Solid {
    /// OpenSCAD's text of it, in its flattened form (`.csg`).
    ///
    /// # Errors
    /// The first thing that made no sense while it was built.
    pub fn text(&self) -> Result<String, BuildError> {
        self.0.text()
    }

    /// Whether it can be printed.
    ///
    /// # Errors
    /// As `text`.
    pub fn check(&self) -> Result<(), BuildError> {
        self.0.check()
    }

    /// The same moved by a vector.
    pub fn moved(&self, by: DVec3) -> Self {
        self.transformed(&DAffine3::from_translation(by))
    }

    /// The same turned about the origin.
    pub fn turned(&self, rotation: DQuat) -> Self {
        self.transformed(&DAffine3::from_quat(rotation))
    }

    /// The same in the frame of a pose's parent. The quaternion may be off unit length by the thousandth that the wire allows.
    pub fn placed(&self, pose: &Pose) -> Self {
        let length = pose.rotation.length_squared();
        if !((length - 1.0).abs() <= QUATERNION_TOLERANCE && pose.position.is_finite()) {
            let found = format!("{} and {}", pose.position, pose.rotation);
            return Self(BuildError::new("pose", "a finite position and a unit quaternion".into(), found).into());
        }
        let pose = Pose::new(pose.position, pose.rotation.normalize());
        self.transformed(&DAffine3::from_rotation_translation(pose.rotation, pose.position))
    }

    /// Its mirror image in the plane through the origin with this normal, of any length but 0.
    pub fn mirrored(&self, normal: DVec3) -> Self {
        let Some(n) = normal.try_normalize() else {
            return Self(BuildError::new("mirror", "a normal".into(), normal.to_string()).into());
        };
        let column = |axis: DVec3| axis - n * (2.0 * n.dot(axis));
        self.transformed(&DAffine3::from_mat3(DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))))
    }

    /// The same scaled along x, y and z.
    pub fn scaled(&self, by: DVec3) -> Self {
        self.transformed(&DAffine3::from_scale(by))
    }

    /// The same under a regular affine map.
    pub fn transformed(&self, map: &DAffine3) -> Self {
        let volume = map.matrix3.determinant();
        if !(map.is_finite() && volume.is_finite() && volume != 0.0) {
            let found = format!("{map}");
            return Self(BuildError::new("transform", "a finite matrix that can be inverted".into(), found).into());
        }
        Self(self.0.transformed(map))
    }

    /// The same with its curves cut into `pieces` where something made of them has no exact form (9 or more; OpenSCAD's `$fn`). What is
    /// exact stays so.
    pub fn with_pieces(&self, pieces: u32) -> Self {
        Self(self.0.with_pieces(pieces))
    }

    /// Its outline where the plane z = 0 cuts it.
    pub fn cut(&self) -> Outline {
        Outline(Tree::around("projection(cut = true".into(), false, vec![self.0.clone()]))
    }

    /// Its shadow on the plane z = 0.
    pub fn shadow(&self) -> Outline {
        Outline(Tree::around("projection(cut = false".into(), false, vec![self.0.clone()]))
    }
}

/// What a session loads as OpenSCAD's text: the text itself, or a solid that prints it.
pub trait ModelText {
    /// The text.
    ///
    /// # Errors
    /// What makes no sense in a solid that was built.
    fn model_text(&self) -> Result<Cow<'_, str>, BuildError>;
}

impl ModelText for str {
    fn model_text(&self) -> Result<Cow<'_, str>, BuildError> {
        Ok(self.into())
    }
}

impl<T: ModelText + ?Sized> ModelText for &T {
    fn model_text(&self) -> Result<Cow<'_, str>, BuildError> {
        (**self).model_text()
    }
}

impl ModelText for String {
    fn model_text(&self) -> Result<Cow<'_, str>, BuildError> {
        Ok(self.into())
    }
}

impl ModelText for Solid {
    fn model_text(&self) -> Result<Cow<'_, str>, BuildError> {
        self.text().map(Cow::Owned)
    }
}

macro_rules! operators {
    ($of:ty) => {
        operators!($of, Add, add, "union");
        operators!($of, Sub, sub, "difference");
        operators!($of, BitAnd, bitand, "intersection");
    };
    ($of:ty, $operator:ident, $function:ident, $name:literal) => {
        impl $operator for $of {
            type Output = Self;
            fn $function(self, other: Self) -> Self {
                Self(Tree::join($name, [self.0, other.0]))
            }
        }
        impl $operator<&$of> for &$of {
            type Output = $of;
            fn $function(self, other: &$of) -> $of {
                self.clone().$function(other.clone())
            }
        }
        impl $operator<&$of> for $of {
            type Output = Self;
            fn $function(self, other: &$of) -> Self {
                self.$function(other.clone())
            }
        }
        impl $operator<$of> for &$of {
            type Output = $of;
            fn $function(self, other: $of) -> $of {
                self.clone().$function(other)
            }
        }
    };
}

operators!(Solid);
operators!(Outline);

#[cfg(test)]
mod tests;
