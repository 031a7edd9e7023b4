//! Flat shapes, to be extruded or revolved into solids.

use super::Solid;
use super::tree::{BuildError, Tree, list, number, positive};
use glam::{DAffine3, DMat3, DVec2, DVec3};

/// A flat shape in the making, in the plane of x and y. Cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline(pub(super) Tree);

/// How corners are joined where an offset opens them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Corners {
    /// By a circle around the corner.
    Round,
    /// By prolonging the sides until they meet.
    Sharp,
    /// By a straight cut at the offset's distance.
    Cut,
}

/// A disc.
pub fn circle(radius: f64) -> Outline {
    if let Err(wrong) = positive("circle", "radius", radius) {
        return Outline(wrong.into());
    }
    Outline(Tree::leaf(format!("circle(r = {}", number(radius)), true))
}

/// A rectangle with these lengths of its sides along x and y, centred.
pub fn rectangle(x: f64, y: f64) -> Outline {
    for (what, length) in [("length along x", x), ("length along y", y)] {
        if let Err(wrong) = positive("rectangle", what, length) {
            return Outline(wrong.into());
        }
    }
    Outline(Tree::leaf(format!("square(size = {}, center = true", list(&[x, y])), false))
}

/// A polygon, convex or not, by its corners in order, either way round.
pub fn polygon(points: &[DVec2]) -> Outline {
    polygon_of_paths(&[points])
}

/// What is within an odd number of closed paths: an outline with holes, or several.
pub fn polygon_of_paths(paths: &[impl AsRef<[DVec2]>]) -> Outline {
    let refused = |expected: &str, found: String| Outline(BuildError::new("polygon", expected.into(), found).into());
    if paths.is_empty() {
        return refused("one path or more", "none".into());
    }
    for (i, path) in paths.iter().enumerate() {
        let path = path.as_ref();
        if path.len() < 3 {
            return refused("paths of three corners or more", format!("{} in path {i}", path.len()));
        }
        if let Some(p) = path.iter().find(|p| !p.is_finite()) {
            return refused("finite corners", format!("{p} in path {i}"));
        }
    }
    let points: Vec<String> = paths.iter().flat_map(|p| p.as_ref()).map(|p: &DVec2| list(&p.to_array())).collect();
    let mut from = 0;
    let mut indices = |path: &[DVec2]| {
        let own = from..from + path.len();
        from = own.end;
        format!("[{}]", own.map(|i| i.to_string()).collect::<Vec<_>>().join(", "))
    };
    let paths = match paths {
        [_] => "undef".into(),
        several => format!("[{}]", several.iter().map(|p| indices(p.as_ref())).collect::<Vec<_>>().join(", ")),
    };
    Outline(Tree::leaf(format!("polygon(points = [{}], paths = {paths}", points.join(", ")), false))
}

impl Outline {
    /// All points of any of some outlines.
    pub fn union(of: impl IntoIterator<Item = Self>) -> Self {
        Self::join("union", of)
    }

    /// All points that some outlines have in common.
    pub fn intersection(of: impl IntoIterator<Item = Self>) -> Self {
        Self::join("intersection", of)
    }

    /// The convex hull of some outlines.
    pub fn hull(of: impl IntoIterator<Item = Self>) -> Self {
        Self::join("hull", of)
    }

    fn join(name: &'static str, of: impl IntoIterator<Item = Self>) -> Self {
        Self(Tree::join(name, of.into_iter().map(|o| o.0)))
    }

    /// Whether what it is made of makes sense.
    ///
    /// # Errors
    /// The first thing that does not.
    pub fn check(&self) -> Result<(), BuildError> {
        self.0.check()
    }

    /// The same moved.
    pub fn moved(&self, x: f64, y: f64) -> Self {
        self.mapped(DAffine3::from_translation(DVec3::new(x, y, 0.0)))
    }

    /// The same turned about the origin, radians, counter-clockwise.
    pub fn turned(&self, angle: f64) -> Self {
        self.mapped(DAffine3::from_rotation_z(angle))
    }

    /// Its mirror image in the line through the origin with this normal, of any length but 0.
    pub fn mirrored(&self, normal: DVec2) -> Self {
        let Some(n) = normal.try_normalize() else {
            return Self(BuildError::new("mirror", "a normal".into(), normal.to_string()).into());
        };
        let n = n.extend(0.0);
        let column = |axis: DVec3| axis - n * (2.0 * n.dot(axis));
        self.mapped(DAffine3::from_mat3(DMat3::from_cols(column(DVec3::X), column(DVec3::Y), DVec3::Z)))
    }

    /// The same scaled along x and y.
    pub fn scaled(&self, x: f64, y: f64) -> Self {
        self.mapped(DAffine3::from_scale(DVec3::new(x, y, 1.0)))
    }

    /// The same under a regular affine map: where (1, 0) and (0, 1) go, and the origin.
    pub fn transformed(&self, [x, y]: [DVec2; 2], origin: DVec2) -> Self {
        let linear = DMat3::from_cols(x.extend(0.0), y.extend(0.0), DVec3::Z);
        self.mapped(DAffine3::from_mat3_translation(linear, origin.extend(0.0)))
    }

    fn mapped(&self, map: DAffine3) -> Self {
        let area = map.matrix3.determinant();
        if !(map.is_finite() && area.is_finite() && area != 0.0) {
            let found = format!("{map}");
            return Self(BuildError::new("transform", "a finite matrix that can be inverted".into(), found).into());
        }
        Self(self.0.transformed(&map))
    }

    /// Everything within a distance of it, or, below 0, what is farther than that inside of its sides.
    pub fn offset(&self, by: f64, corners: Corners) -> Self {
        if !by.is_finite() {
            return Self(BuildError::new("offset", "a finite distance".into(), number(by)).into());
        }
        let by = number(by);
        let call = match corners {
            Corners::Round => format!("offset(r = {by}"),
            Corners::Sharp => format!("offset(delta = {by}, chamfer = false"),
            Corners::Cut => format!("offset(delta = {by}, chamfer = true"),
        };
        Self(Tree::around(call, corners == Corners::Round, vec![self.0.clone()]))
    }

    /// The same with its curves cut into `pieces` where they must be ([`Solid::with_pieces`]).
    pub fn with_pieces(&self, pieces: u32) -> Self {
        Self(self.0.with_pieces(pieces))
    }

    /// The solid between z = −height/2 and height/2 over it.
    pub fn extrude(&self, height: f64) -> Solid {
        self.linear(height, "", false)
    }

    /// The same, scaled along x and y towards its upper end, by 0 or more.
    pub fn extrude_tapered(&self, height: f64, scale: DVec2) -> Solid {
        if !(scale.is_finite() && scale.min_element() >= 0.0) {
            let found = scale.to_string();
            return Solid(BuildError::new("extrusion", "a finite scale of 0 or more".into(), found).into());
        }
        self.linear(height, &format!(", scale = {}", list(&scale.to_array())), true)
    }

    /// The same, turned about z towards its upper end by `angle` (radians, counter-clockwise) in `slices` steps.
    pub fn extrude_twisted(&self, height: f64, angle: f64, slices: u32) -> Solid {
        if !angle.is_finite() || slices == 0 {
            let found = format!("{} in {slices} slices", number(angle));
            return Solid(BuildError::new("extrusion", "a finite angle in one slice or more".into(), found).into());
        }
        let twist = number(-angle.to_degrees());
        self.linear(height, &format!(", twist = {twist}, slices = {slices}"), true)
    }

    fn linear(&self, height: f64, more: &str, curved: bool) -> Solid {
        if let Err(wrong) = positive("extrusion", "height", height) {
            return Solid(wrong.into());
        }
        let call = format!("linear_extrude(height = {}, center = true{more}", number(height));
        Solid(Tree::around(call, curved, vec![self.0.clone()]))
    }

    /// The solid that it makes about an axis: its x becomes the distance from z, its y becomes z. It must lie on one side of x = 0.
    pub fn revolve(&self) -> Solid {
        self.revolve_part(std::f64::consts::TAU)
    }

    /// The same over a part of the turn from +x counter-clockwise: `angle` radians, more than 0, at most 2π.
    pub fn revolve_part(&self, angle: f64) -> Solid {
        if !(angle > 0.0 && angle <= std::f64::consts::TAU) {
            let found = number(angle);
            return Solid(BuildError::new("revolution", "an angle above 0, at most 2π".into(), found).into());
        }
        let call = format!("rotate_extrude(angle = {}", number(angle.to_degrees()));
        Solid(Tree::around(call, true, vec![self.0.clone()]))
    }
}
