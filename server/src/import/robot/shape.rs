//! Collision geometry as flattened OpenSCAD texts.

use super::kinematics::Part;
use crate::import::written::placed;
use contactd_proto::Pose;
use glam::{DVec2, DVec3};
use std::fmt::Write as _;

/// A geometry about its own origin, lengths in metres.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shape {
    /// A box of these sides.
    Box(DVec3),
    /// A ball of this radius.
    Sphere(f64),
    /// A cylinder about z: radius, length.
    Cylinder(f64, f64),
    /// A cone about z whose apex is up: radius at the bottom, length.
    Cone(f64, f64),
    /// A capsule about z: radius, length between the centres of its ends.
    Capsule(f64, f64),
    /// An ellipsoid of these semi-axes.
    Ellipsoid(DVec3),
    /// All z <= 0.
    Plane,
    /// What stands on z = 0 above some closed lines, those within others its holes: the lines, the height.
    Extrusion(Vec<Vec<DVec2>>, f64),
    /// The solid under a grid of heights about the origin: rows that go up in y, its size, the height of its floor.
    Heights(Vec<Vec<f64>>, DVec2, f64),
    /// A mesh's file, scaled; as it is or its convex hull.
    Mesh(String, DVec3, bool),
}

impl Shape {
    /// True where it has no inside: a size that is 0.
    pub fn is_nothing(&self) -> bool {
        match self {
            Self::Box(v) | Self::Ellipsoid(v) | Self::Mesh(_, v, _) => v.abs().min_element() == 0.0,
            Self::Sphere(r) => *r == 0.0,
            Self::Cylinder(r, l) | Self::Cone(r, l) => *r == 0.0 || *l == 0.0,
            Self::Capsule(r, _) => *r == 0.0,
            Self::Extrusion(_, height) => *height == 0.0,
            Self::Plane | Self::Heights(..) => false,
        }
    }

    /// A length that cannot be one: negative.
    pub fn negative(&self) -> Option<f64> {
        let lengths = match self {
            Self::Box(v) | Self::Ellipsoid(v) => v.to_array(),
            Self::Sphere(r) => [*r; 3],
            Self::Cylinder(r, l) | Self::Cone(r, l) | Self::Capsule(r, l) => [*r, *l, 0.0],
            Self::Extrusion(_, height) => [*height, 0.0, 0.0],
            Self::Plane | Self::Heights(..) | Self::Mesh(..) => [0.0; 3],
        };
        lengths.into_iter().find(|l| *l < 0.0)
    }

    fn text(&self) -> String {
        match self {
            Self::Box(v) => format!("cube(size = {:?}, center = true);", v.to_array()),
            Self::Sphere(r) => format!("sphere($fn = 0, r = {r:?});"),
            Self::Cylinder(r, l) => format!("cylinder($fn = 0, h = {l:?}, r1 = {r:?}, r2 = {r:?}, center = true);"),
            Self::Cone(r, l) => format!("cylinder($fn = 0, h = {l:?}, r1 = {r:?}, r2 = 0, center = true);"),
            Self::Capsule(r, 0.0) => Self::Sphere(*r).text(),
            Self::Capsule(r, l) => {
                let end = |z: f64| placed(&Pose::at(DVec3::Z * z), &Self::Sphere(*r).text());
                format!("hull() {{ {} {} }}", end(0.5 * l), end(-0.5 * l))
            }
            Self::Ellipsoid(v) => scaled(*v, &Self::Sphere(1.0).text()),
            Self::Extrusion(lines, height) => {
                let points: Vec<[f64; 2]> = lines.iter().flatten().map(|p| p.to_array()).collect();
                let mut first = 0;
                let mut path = |line: &Vec<DVec2>| {
                    first += line.len();
                    (first - line.len()..first).collect::<Vec<usize>>()
                };
                let paths: Vec<Vec<usize>> = lines.iter().map(&mut path).collect();
                format!("linear_extrude(height = {height:?}) {{ polygon(points = {points:?}, paths = {paths:?}); }}")
            }
            Self::Heights(rows, size, base) => {
                format!("height_field(heights = {rows:?}, size = {:?}, base = {base:?});", size.to_array())
            }
            Self::Plane => "half_space(normal = [0, 0, 1], offset = 0);".into(),
            Self::Mesh(file, scale, is_hull) => {
                let file = file.replace('\\', "\\\\").replace('"', "\\\"");
                let import = scaled(*scale, &format!("import(file = \"{file}\");"));
                if *is_hull { format!("hull() {{ {import} }}") } else { import }
            }
        }
    }

    /// Where it stands in its link.
    pub fn at(&self, pose: &Pose) -> String {
        placed(pose, &self.text())
    }
}

fn scaled(by: DVec3, text: &str) -> String {
    if by == DVec3::ONE {
        return text.to_owned();
    }
    let [x, y, z] = by.to_array();
    format!("multmatrix([[{x:?}, 0, 0, 0], [0, {y:?}, 0, 0], [0, 0, {z:?}, 0], [0, 0, 0, 1]]) {{ {text} }}")
}

/// The collisions of a link in formats without masks: together one part of it, but each plane, which has no bounds, by itself.
#[derive(Default)]
pub(super) struct Collisions {
    texts: Vec<String>,
    planes: Vec<Part>,
}

impl Collisions {
    /// Adds a shape at its place in the link's frame; `name` is the collision's, if it has one.
    pub(super) fn add(&mut self, shape: &Shape, at: &Pose, name: Option<&str>) {
        let text = shape.at(at);
        if *shape == Shape::Plane {
            self.planes.push(Part { name: name.unwrap_or("plane").to_owned(), text, masks: [1, 1] });
        } else {
            self.texts.push(text);
        }
    }

    /// The parts, the planes last.
    pub(super) fn parts(self) -> Vec<Part> {
        let all = (!self.texts.is_empty()).then(|| union(&self.texts));
        let one = all.map(|text| Part { name: String::new(), text, masks: [1, 1] });
        one.into_iter().chain(self.planes).collect()
    }
}

/// Several texts as one solid.
pub(super) fn union(texts: &[String]) -> String {
    match texts {
        [one] => format!("{one}\n"),
        many => {
            let mut out = "union() {\n".to_owned();
            many.iter().for_each(|text| _ = writeln!(out, "    {text}"));
            out + "}\n"
        }
    }
}
