//! Solids of the random families: trees as they are drawn up, their text, and f at a point by code of its own.
//!
//! Nothing here is shared with the engine: the text goes through its reader, the tree through `Field`.

use super::draw::Draw;
use glam::{DAffine3, DMat3, DVec3, dvec3};
use std::fmt::Write as _;

/// How the parts of a group are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Join {
    Union,
    Intersection,
    /// The first one less all others.
    Difference,
}

/// A primitive in its own frame, centred at the origin.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Shape {
    Ball {
        r: f64,
    },
    Box {
        size: DVec3,
    },
    /// Cylinder, frustum or cone along z.
    Round {
        h: f64,
        bottom: f64,
        top: f64,
    },
    /// A regular prism along z with 3 to 8 sides; `r` is the radius of its corners.
    Prism {
        n: u32,
        r: f64,
        h: f64,
    },
    /// A convex polyhedron: faces clockwise from outside.
    Hull {
        points: Vec<DVec3>,
        faces: Vec<Vec<usize>>,
    },
}

/// A tree as it stands in a file.
#[derive(Clone, Debug, PartialEq)]
pub enum Node {
    /// A primitive.
    Leaf(Shape),
    /// Parts joined.
    Group(Join, Vec<Node>),
    /// A similarity, mirrors among them.
    Moved(DAffine3, Box<Node>),
}

impl Node {
    /// Moved by a similarity.
    pub fn moved(self, by: DAffine3) -> Node {
        Node::Moved(by, Box::new(self))
    }

    /// Moved along `by`.
    pub fn at(self, by: DVec3) -> Node {
        self.moved(DAffine3::from_translation(by))
    }

    /// Scaled about the origin.
    pub fn scaled(self, by: f64) -> Node {
        self.moved(DAffine3::from_scale(DVec3::splat(by)))
    }

    /// All of them.
    pub fn union(parts: Vec<Node>) -> Node {
        Node::Group(Join::Union, parts)
    }

    /// What is common to both.
    pub fn and(self, other: Node) -> Node {
        Node::Group(Join::Intersection, vec![self, other])
    }

    /// Less another one.
    pub fn less(self, other: Node) -> Node {
        Node::Group(Join::Difference, vec![self, other])
    }

    /// Both.
    pub fn or(self, other: Node) -> Node {
        Node::Group(Join::Union, vec![self, other])
    }

    /// The tree's text, as a flattened file.
    pub fn text(&self) -> String {
        let mut out = String::new();
        self.write(&mut out);
        out
    }

    fn write(&self, out: &mut String) {
        match self {
            Node::Leaf(shape) => shape.write(out),
            Node::Group(join, parts) => {
                out.push_str(match join {
                    Join::Union => "union() {\n",
                    Join::Intersection => "intersection() {\n",
                    Join::Difference => "difference() {\n",
                });
                parts.iter().for_each(|p| p.write(out));
                out.push_str("}\n");
            }
            Node::Moved(by, node) => {
                let (m, t) = (by.matrix3, by.translation);
                let row = |k: usize| format!("[{:?}, {:?}, {:?}, {:?}]", m.x_axis[k], m.y_axis[k], m.z_axis[k], t[k]);
                let _ = writeln!(out, "multmatrix([{}, {}, {}, [0, 0, 0, 1]]) {{", row(0), row(1), row(2));
                node.write(out);
                out.push_str("}\n");
            }
        }
    }

    /// A ball around it, not a tight one.
    pub fn ball(&self) -> (DVec3, f64) {
        match self {
            Node::Leaf(shape) => (DVec3::ZERO, shape.radius()),
            Node::Moved(by, node) => {
                let (c, r) = node.ball();
                (by.transform_point3(c), r * size_of(by))
            }
            Node::Group(Join::Difference, parts) => parts[0].ball(),
            Node::Group(Join::Intersection, parts) => {
                parts.iter().map(Node::ball).min_by(|x, y| x.1.total_cmp(&y.1)).expect("parts")
            }
            Node::Group(Join::Union, parts) => {
                let balls: Vec<_> = parts.iter().map(Node::ball).collect();
                let low = balls.iter().fold(DVec3::INFINITY, |m, (c, r)| m.min(*c - DVec3::splat(*r)));
                let high = balls.iter().fold(DVec3::NEG_INFINITY, |m, (c, r)| m.max(*c + DVec3::splat(*r)));
                let center = (low + high) / 2.0;
                (center, balls.iter().fold(0.0, |m: f64, (c, r)| m.max(c.distance(center) + r)))
            }
        }
    }

    /// About the smallest thickness of its primitives.
    pub fn smallest(&self) -> f64 {
        match self {
            Node::Leaf(shape) => shape.thickness(),
            Node::Moved(by, node) => node.smallest() * size_of(by),
            Node::Group(_, parts) => parts.iter().map(Node::smallest).fold(f64::INFINITY, f64::min),
        }
    }

    /// f of it.
    pub fn field(&self) -> Field {
        let mut field = Field { root: Part::Leaf(Vec::new()), features: Vec::new(), size: 0.0 };
        field.root = field.compile(self, &DAffine3::IDENTITY);
        let (center, radius) = self.ball();
        field.size = center.length() + radius;
        field
    }
}

/// The factor of a similarity.
fn size_of(by: &DAffine3) -> f64 {
    by.matrix3.determinant().abs().cbrt()
}

impl Shape {
    fn write(&self, out: &mut String) {
        let exact = "$fn = 0, $fa = 12, $fs = 2";
        let _ = match self {
            Shape::Ball { r } => writeln!(out, "sphere({exact}, r = {r:?});"),
            Shape::Box { size: s } => writeln!(out, "cube(size = [{:?}, {:?}, {:?}], center = true);", s.x, s.y, s.z),
            Shape::Round { h, bottom, top } => {
                writeln!(out, "cylinder({exact}, h = {h:?}, r1 = {bottom:?}, r2 = {top:?}, center = true);")
            }
            Shape::Prism { n, r, h } => {
                writeln!(
                    out,
                    "cylinder($fn = {n}, $fa = 12, $fs = 2, h = {h:?}, r1 = {r:?}, r2 = {r:?}, center = true);"
                )
            }
            Shape::Hull { points, faces } => {
                let points: Vec<_> = points.iter().map(|p| format!("[{:?}, {:?}, {:?}]", p.x, p.y, p.z)).collect();
                writeln!(out, "polyhedron(points = [{}], faces = {faces:?}, convexity = 1);", points.join(", "))
            }
        };
    }

    fn radius(&self) -> f64 {
        match self {
            Shape::Ball { r } => *r,
            Shape::Box { size } => size.length() / 2.0,
            Shape::Round { h, bottom, top } => (h / 2.0).hypot(bottom.max(*top)),
            Shape::Prism { r, h, .. } => (h / 2.0).hypot(*r),
            Shape::Hull { points, .. } => points.iter().fold(0.0, |m, p| m.max(p.length())),
        }
    }

    fn thickness(&self) -> f64 {
        match self {
            Shape::Ball { r } => 2.0 * r,
            Shape::Box { size } => size.min_element(),
            Shape::Round { h, bottom, top } => h.min(2.0 * bottom.max(*top)),
            Shape::Prism { r, h, .. } => h.min(*r),
            Shape::Hull { points, faces } => {
                let width = |f: &Vec<usize>| {
                    let n = outward(points, f);
                    points.iter().map(|p| n.dot(points[f[0]] - *p)).fold(0.0, f64::max)
                };
                faces.iter().map(width).fold(f64::INFINITY, f64::min)
            }
        }
    }

    /// Corners and, of round ones, points of rims and surface; in its own frame.
    fn marks(&self) -> Vec<DVec3> {
        let ring = |n: u32, r: f64, z: f64, phase: f64| {
            (0..n).map(move |i| {
                let (s, c) = (std::f64::consts::TAU * (f64::from(i) + phase) / f64::from(n)).sin_cos();
                dvec3(r * c, r * s, z)
            })
        };
        let mut out = Vec::new();
        match self {
            Shape::Ball { r } => {
                // A spiral from pole to pole.
                for i in 0..14 {
                    let z = (f64::from(i) + 0.5) / 7.0 - 1.0;
                    let (s, c) = (f64::from(i) * 2.399_963).sin_cos();
                    let rho = (1.0 - z * z).sqrt();
                    out.push(dvec3(rho * c, rho * s, z) * *r);
                }
                out.extend([DVec3::X, DVec3::Y, DVec3::Z].iter().flat_map(|e| [*e * *r, -*e * *r]));
            }
            Shape::Box { size } => {
                let h = *size / 2.0;
                for x in [-1.0, 0.0, 1.0] {
                    for y in [-1.0, 0.0, 1.0] {
                        for z in [-1.0, 0.0, 1.0] {
                            out.push(dvec3(x, y, z) * h);
                        }
                    }
                }
            }
            Shape::Round { h, bottom, top } => {
                for (r, z) in [(*bottom, -h / 2.0), (*top, h / 2.0), ((bottom + top) / 2.0, 0.0)] {
                    if r == 0.0 {
                        out.push(dvec3(0.0, 0.0, z));
                    } else {
                        out.extend(ring(8, r, z, 0.25));
                        out.push(dvec3(0.0, 0.0, z));
                    }
                }
            }
            Shape::Prism { n, r, h } => {
                for z in [-h / 2.0, h / 2.0] {
                    out.extend(ring(*n, *r, z, 0.0));
                    out.push(dvec3(0.0, 0.0, z));
                }
                out.extend(ring(*n, *r, 0.0, 0.0));
            }
            Shape::Hull { points, faces } => {
                out.extend(points.iter().copied());
                for f in faces {
                    out.push(f.iter().map(|i| points[*i]).sum::<DVec3>() / f.len() as f64);
                    out.extend((0..f.len()).map(|i| (points[f[i]] + points[f[(i + 1) % f.len()]]) / 2.0));
                }
            }
        }
        out
    }
}

/// A face of a primitive in the model's frame: psi <= 0 inside.
#[derive(Clone, Copy, Debug)]
enum Surface {
    Plane { n: DVec3, d: f64 },
    Ball { o: DVec3, r: f64 },
    Tube { o: DVec3, a: DVec3, r: f64 },
    Cone { apex: DVec3, a: DVec3, sin: f64, cos: f64 },
}

impl Surface {
    fn value(&self, x: DVec3) -> f64 {
        match *self {
            Surface::Plane { n, d } => n.dot(x) - d,
            Surface::Ball { o, r } => (x - o).length() - r,
            Surface::Tube { o, a, r } => {
                let p = x - o;
                (p - a * a.dot(p)).length() - r
            }
            Surface::Cone { apex, a, sin, cos } => {
                let p = x - apex;
                let z = a.dot(p);
                (p - a * z).length() * cos - z * sin
            }
        }
    }
}

#[derive(Clone, Debug)]
enum Part {
    Leaf(Vec<Surface>),
    Group(Join, Vec<Part>),
}

impl Part {
    fn value(&self, x: DVec3) -> f64 {
        match self {
            Part::Leaf(faces) => faces.iter().fold(f64::NEG_INFINITY, |m, f| m.max(f.value(x))),
            Part::Group(Join::Union, parts) => parts.iter().fold(f64::INFINITY, |m, p| m.min(p.value(x))),
            Part::Group(Join::Intersection, parts) => parts.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p.value(x))),
            Part::Group(Join::Difference, parts) => {
                parts[1..].iter().fold(parts[0].value(x), |m, p| m.max(-p.value(x)))
            }
        }
    }
}

/// f of a tree: negative inside, 1-Lipschitz; and points that stick out of it.
#[derive(Clone, Debug)]
pub struct Field {
    root: Part,
    /// Corners, apexes, points of rims and surfaces of all its primitives, on the solid's surface or not.
    pub features: Vec<DVec3>,
    /// Largest distance of a point from the frame's origin, from above.
    pub size: f64,
}

impl Field {
    /// f at a point of the model's frame.
    pub fn value(&self, x: DVec3) -> f64 {
        self.root.value(x)
    }

    /// Gradient of f by differences over `h`; a unit vector, or zero where there is none.
    pub fn gradient(&self, x: DVec3, h: f64) -> DVec3 {
        let d = |e: DVec3| self.value(x + e * h) - self.value(x - e * h);
        dvec3(d(DVec3::X), d(DVec3::Y), d(DVec3::Z)).normalize_or_zero()
    }

    /// Where a ray from outside meets it first.
    pub fn met_by(&self, from: DVec3, along: DVec3, length: f64) -> Option<DVec3> {
        let (mut s, least) = (0.0, 1e-12 * self.size);
        for _ in 0..400 {
            let v = self.value(from + along * s);
            if v <= least {
                return (s > 0.0).then_some(from + along * s);
            }
            s += v;
            if s > length {
                return None;
            }
        }
        None
    }

    /// The features that lie on the surface, at most `most` of them drawn by lot, and as many points met by rays.
    pub fn surface_points(&self, most: usize, draw: &mut Draw) -> Vec<DVec3> {
        let near = 1e-9 * self.size;
        let mut on: Vec<DVec3> = self.features.iter().copied().filter(|x| self.value(*x).abs() <= near).collect();
        while on.len() > most {
            let i = draw.below(on.len());
            on.swap_remove(i);
        }
        if let Some(center) = self.features.first().copied() {
            for _ in 0..most / 3 {
                let u = draw.direction();
                let target = self.features.get(draw.below(self.features.len())).copied().unwrap_or(center);
                on.extend(self.met_by(target + u * 3.0 * self.size, -u, 6.0 * self.size));
            }
        }
        on
    }

    fn compile(&mut self, node: &Node, outer: &DAffine3) -> Part {
        match node {
            Node::Group(join, parts) => Part::Group(*join, parts.iter().map(|p| self.compile(p, outer)).collect()),
            Node::Moved(by, node) => self.compile(node, &(*outer * *by)),
            Node::Leaf(shape) => {
                self.features.extend(shape.marks().into_iter().map(|p| outer.transform_point3(p)));
                Part::Leaf(surfaces(shape, outer))
            }
        }
    }
}

/// The faces of a primitive under a similarity.
fn surfaces(shape: &Shape, m: &DAffine3) -> Vec<Surface> {
    let s = size_of(m);
    let turned = |n: DVec3| (m.matrix3 * n).normalize();
    // The half-space n·x <= d of the primitive's frame.
    let plane = |n: DVec3, d: f64| {
        let normal = turned(n);
        Surface::Plane { n: normal, d: d * s + normal.dot(m.translation) }
    };
    let ends = |h: f64| [plane(DVec3::Z, h / 2.0), plane(-DVec3::Z, h / 2.0)];
    match shape {
        Shape::Ball { r } => vec![Surface::Ball { o: m.translation, r: r * s }],
        Shape::Box { size } => {
            let h = *size / 2.0;
            [(DVec3::X, h.x), (DVec3::Y, h.y), (DVec3::Z, h.z)]
                .into_iter()
                .flat_map(|(e, d)| [plane(e, d), plane(-e, d)])
                .collect()
        }
        Shape::Round { h, bottom, top } if bottom == top => {
            let mut out = vec![Surface::Tube { o: m.translation, a: turned(DVec3::Z), r: bottom * s }];
            out.extend(ends(*h));
            out
        }
        Shape::Round { h, bottom, top } => {
            let drop = (bottom - top).abs();
            let slant = h.hypot(drop);
            // From the middle to the apex, along +z where the top is the smaller end.
            let way = h * bottom.max(*top) / drop - h / 2.0;
            let up = if bottom > top { DVec3::Z } else { -DVec3::Z };
            let apex = m.transform_point3(up * way);
            let mut out = vec![Surface::Cone { apex, a: turned(-up), sin: drop / slant, cos: h / slant }];
            if *top > 0.0 {
                out.push(plane(DVec3::Z, h / 2.0));
            }
            if *bottom > 0.0 {
                out.push(plane(-DVec3::Z, h / 2.0));
            }
            out
        }
        Shape::Prism { n, r, h } => {
            let step = std::f64::consts::PI / f64::from(*n);
            let mut out: Vec<_> = (0..*n)
                .map(|i| {
                    let (s, c) = (step * f64::from(2 * i + 1)).sin_cos();
                    plane(dvec3(c, s, 0.0), r * step.cos())
                })
                .collect();
            out.extend(ends(*h));
            out
        }
        Shape::Hull { points, faces } => faces
            .iter()
            .map(|f| {
                let n = outward(points, f);
                plane(n, f.iter().map(|i| n.dot(points[*i])).fold(f64::NEG_INFINITY, f64::max))
            })
            .collect(),
    }
}

/// Outward unit normal of a face whose corners go clockwise seen from outside (Newell's sum).
fn outward(points: &[DVec3], face: &[usize]) -> DVec3 {
    let o = points[face[0]];
    let turns = (1..face.len() - 1).map(|i| (points[face[i + 1]] - o).cross(points[face[i]] - o));
    turns.sum::<DVec3>().normalize()
}

/// The convex hull of points in general position, by trying all triples: for a dozen points.
pub fn hull_of(points: Vec<DVec3>) -> Option<Shape> {
    let size = points.iter().fold(0.0, |m: f64, p| m.max(p.length()));
    let mut faces = Vec::new();
    for i in 0..points.len() {
        for j in i + 1..points.len() {
            for k in j + 1..points.len() {
                let n = (points[j] - points[i]).cross(points[k] - points[i]);
                if n.length() < 1e-6 * size * size {
                    continue;
                }
                let n = n.normalize();
                let side = |m: usize| n.dot(points[m] - points[i]);
                let others = || (0..points.len()).filter(|m| ![i, j, k].contains(m)).map(side);
                if others().any(|d| d.abs() < 1e-4 * size) && others().all(|d| d < 1e-4 * size) {
                    return None;
                }
                if others().all(|d| d < 0.0) {
                    faces.push(vec![i, k, j]);
                } else if others().all(|d| d > 0.0) {
                    faces.push(vec![i, j, k]);
                }
            }
        }
    }
    // Points within the hull are left out of the file's list.
    let mut used: Vec<usize> = faces.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let index = |old: usize| used.iter().position(|u| *u == old).expect("a used point");
    let faces: Vec<Vec<usize>> = faces.iter().map(|f| f.iter().map(|i| index(*i)).collect()).collect();
    (faces.len() >= 4).then(|| Shape::Hull { points: used.iter().map(|i| points[*i]).collect(), faces })
}

/// A prism over a convex polygon in the plane z = 0 (counterclockwise), from `low` to `high`; the top moved by `shift`.
pub fn prism_over(outline: &[(f64, f64)], low: f64, high: f64, shift: (f64, f64)) -> Shape {
    let n = outline.len();
    let mut points: Vec<DVec3> = outline.iter().map(|(x, y)| dvec3(*x, *y, low)).collect();
    points.extend(outline.iter().map(|(x, y)| dvec3(x + shift.0, y + shift.1, high)));
    // Clockwise from outside: the bottom is seen from below, where counterclockwise from above is clockwise.
    let mut faces = vec![(0..n).collect::<Vec<_>>(), (n..2 * n).rev().collect()];
    for i in 0..n {
        let j = (i + 1) % n;
        faces.push(vec![i, i + n, j + n, j]);
    }
    Shape::Hull { points, faces }
}

/// A rotation and a place.
pub fn placed(rotation: DMat3, position: DVec3) -> DAffine3 {
    DAffine3 { matrix3: rotation, translation: position }
}
