//! A convex primitive standing in a common frame: support, projection, distance of a point.
//!
//! Idea: all closed forms need three questions of a body: how far does it reach along n (support), which of its points
//! is nearest to a point (projection), and which features are there (rims, sides, caps; vertices, edges, facets).
//! Cylinder, cone and frustum are one record, `Round`: two coaxial discs and the side between them. A cylinder is the
//! one whose side normals stand square to the axis.
//! Source: elementary; Ericson, Real-Time Collision Detection, 5.1 for the projections.
//! Invariant: normals and axes are unit vectors. A half-space is no bounded body and has no record here.

use super::directions::{Rim, Ruled};
use contactd::math::{any_perpendicular, tolerance::CARRIED};
use contactd::solid::primitive;
use contactd::solid::{Face, Shape};
use glam::{DMat3, DVec3};

/// Slack in the test whether a direction is a normal of an edge: a superfluous candidate does no harm, a missing one does.
const NORMAL_SLACK: f64 = 1e-9;

/// Where a primitive stands: its frame seen from the common frame.
#[derive(Clone, Copy, Debug)]
pub struct Stand {
    /// Origin of the primitive's frame.
    pub origin: DVec3,
    /// Its axes, an orthonormal matrix.
    pub axes: DMat3,
}

impl Stand {
    fn point(&self, p: DVec3) -> DVec3 {
        self.origin + self.axes * p
    }
}

/// A ball.
#[derive(Clone, Debug)]
pub struct Ball {
    /// Centre.
    pub center: DVec3,
    /// Radius.
    pub radius: f64,
}

/// A cylinder, cone or frustum: the hull of two coaxial discs.
#[derive(Clone, Debug)]
pub struct Round {
    /// Centres of the discs, bottom and top.
    pub centers: [DVec3; 2],
    /// Their radii; 0 is an apex.
    pub radii: [f64; 2],
    /// Unit axis from bottom to top.
    pub axis: DVec3,
    /// Component of the side's outward normal along the axis: 0 for a cylinder.
    pub lean: f64,
}

/// An edge of a polyhedron.
#[derive(Clone, Debug)]
pub struct Edge {
    /// Its ends.
    pub ends: [DVec3; 2],
    /// Unit direction.
    pub way: DVec3,
    /// Directions from the edge into its two facets, square to the edge.
    pub inward: [DVec3; 2],
}

/// A convex polyhedron.
#[derive(Clone, Debug)]
pub struct Poly {
    /// Corners.
    pub vertices: Vec<DVec3>,
    /// Outward unit normal and offset of each facet.
    pub planes: Vec<(DVec3, f64)>,
    /// Edges.
    pub edges: Vec<Edge>,
}

/// A bounded convex primitive in the common frame.
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub enum Convex {
    Ball(Ball),
    Cylinder(Round),
    Cone(Round),
    Poly(Poly),
}

/// Kind of feature that holds a witness point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Feature {
    Face,
    Edge,
    Vertex,
}

impl Round {
    fn placed(&self, s: &Stand) -> Self {
        Self { centers: self.centers.map(|c| s.point(c)), axis: s.axes * self.axis, ..*self }
    }

    /// The side between the rims.
    pub fn side(&self) -> Ruled {
        let cos = (1.0 - self.lean * self.lean).sqrt();
        // Support of the bottom rim along a side normal: c·n + r cos.
        Ruled { point: self.centers[0], axis: self.axis, lean: self.lean, radius: self.radii[0] * cos }
    }

    /// Rims that are no apex.
    pub fn rims(&self) -> impl Iterator<Item = Rim> + '_ {
        self.ends().filter(|r| r.radius > 0.0)
    }

    /// The apex of a full cone.
    pub fn apex(&self) -> Option<DVec3> {
        self.ends().find(|r| r.radius == 0.0).map(|r| r.center)
    }

    fn ends(&self) -> impl Iterator<Item = Rim> + '_ {
        (0..2).map(|i| Rim { center: self.centers[i], axis: self.axis, radius: self.radii[i] })
    }

    /// Farthest point along n.
    pub fn support(&self, n: DVec3) -> DVec3 {
        let axial = n.dot(self.axis);
        let radial = n - self.axis * axial;
        let len = radial.length();
        let u = self.square(radial, len);
        let at = |i: usize| self.centers[i].dot(n) + self.radii[i] * len;
        let i = usize::from(at(1) >= at(0));
        self.centers[i] + u * self.radii[i]
    }

    /// (distance from the axis, height over the mid-plane, radial direction) of a point.
    fn meridian(&self, x: DVec3) -> (f64, f64, DVec3) {
        let o = x - 0.5 * (self.centers[0] + self.centers[1]);
        let z = o.dot(self.axis);
        let p = o - self.axis * z;
        let rho = p.length();
        (rho, z, self.square(p, rho))
    }

    /// The unit vector of `p`, of length `len`, made square to the axis once more: a short p is rounding mostly.
    fn square(&self, p: DVec3, len: f64) -> DVec3 {
        let u = if len > 0.0 { p / len } else { DVec3::ZERO };
        (u - self.axis * u.dot(self.axis)).try_normalize().unwrap_or_else(|| any_perpendicular(self.axis))
    }

    /// Half the height.
    pub fn half(&self) -> f64 {
        0.5 * (self.centers[1] - self.centers[0]).dot(self.axis)
    }

    /// Signed distance of a point and the gradient of that distance; the meridian plane makes it a planar question on
    /// a trapezium.
    pub fn distance(&self, x: DVec3) -> (f64, DVec3) {
        let (rho, z, u) = self.meridian(x);
        let (h, [r0, r1]) = (self.half(), self.radii);
        // Side: unit normal (cos, lean) in (rho, z).
        let cos = (1.0 - self.lean * self.lean).sqrt();
        let side = (rho - r0) * cos + (z + h) * self.lean;
        let along = -(rho - r0) * self.lean + (z + h) * cos;
        let slant = (r1 - r0).hypot(2.0 * h);
        let values = [(side, cos, self.lean), (z - h, 0.0, 1.0), (-z - h, 0.0, -1.0)];
        let make = |d: f64, nr: f64, nz: f64| (d, u * nr + self.axis * nz);
        if values.iter().all(|v| v.0 <= 0.0) {
            let v = values.iter().fold(values[0], |m, v| if v.0 > m.0 { *v } else { m });
            return make(v.0, v.1, v.2);
        }
        if side >= 0.0 && (0.0..=slant).contains(&along) {
            return make(side, cos, self.lean);
        }
        if z >= h && rho <= r1 {
            return make(z - h, 0.0, 1.0);
        }
        if z <= -h && rho <= r0 {
            return make(-z - h, 0.0, -1.0);
        }
        let corner = |r: f64, c: f64| {
            let (dr, dz) = (rho - r, z - c);
            let d = dr.hypot(dz);
            if d > 0.0 { (d, dr / d, dz / d) } else { (0.0, cos, self.lean) }
        };
        let (a, b) = (corner(r0, -h), corner(r1, h));
        let c = if a.0 <= b.0 { a } else { b };
        make(c.0, c.1, c.2)
    }
}

impl Edge {
    /// The edge as a ruled feature.
    pub fn ruled(&self) -> Ruled {
        Ruled { point: self.ends[0], axis: self.way, lean: 0.0, radius: 0.0 }
    }

    /// Whether n (outward) belongs to the edge's normals, with a little slack.
    pub fn shows(&self, n: DVec3) -> bool {
        self.inward.iter().all(|m| m.dot(n) <= NORMAL_SLACK)
    }
}

impl Poly {
    fn new(vertices: Vec<DVec3>, planes: Vec<(DVec3, f64)>) -> Self {
        let size = vertices.iter().fold(0.0f64, |m, v| m.max((*v - vertices[0]).length()));
        // Two corners on two common facets bound an edge; three on a line cannot occur in a polyhedron of corners.
        let on: Vec<Vec<usize>> = vertices
            .iter()
            .map(|v| (0..planes.len()).filter(|&k| (planes[k].0.dot(*v) - planes[k].1).abs() <= 1e-9 * size).collect())
            .collect();
        let center = vertices.iter().copied().sum::<DVec3>() / vertices.len() as f64;
        let mut edges = Vec::new();
        for i in 0..vertices.len() {
            for j in i + 1..vertices.len() {
                let common: Vec<usize> = on[i].iter().copied().filter(|k| on[j].contains(k)).collect();
                let [f, g, ..] = common[..] else { continue };
                let way = (vertices[j] - vertices[i]).normalize();
                let inward = [f, g].map(|k| {
                    let m = planes[k].0.cross(way).normalize();
                    let mid: DVec3 = center - vertices[i];
                    // The facet's own corners tell its inner side; the centre's may be ambiguous for flat bodies.
                    let side = (0..vertices.len())
                        .filter(|&v| on[v].contains(&k))
                        .map(|v| m.dot(vertices[v] - vertices[i]))
                        .fold(0.0f64, |a, b| if b.abs() > a.abs() { b } else { a });
                    if side < 0.0 || (side == 0.0 && m.dot(mid) < 0.0) { -m } else { m }
                });
                edges.push(Edge { ends: [vertices[i], vertices[j]], way, inward });
            }
        }
        Self { vertices, planes, edges }
    }

    fn placed(&self, s: &Stand) -> Self {
        Self {
            vertices: self.vertices.iter().map(|v| s.point(*v)).collect(),
            planes: self
                .planes
                .iter()
                .map(|(n, d)| {
                    let n = s.axes * *n;
                    (n, d + n.dot(s.origin))
                })
                .collect(),
            edges: self
                .edges
                .iter()
                .map(|e| Edge {
                    ends: e.ends.map(|p| s.point(p)),
                    way: s.axes * e.way,
                    inward: e.inward.map(|m| s.axes * m),
                })
                .collect(),
        }
    }

    /// Farthest corner along n.
    pub fn support(&self, n: DVec3) -> DVec3 {
        let mut best = (f64::NEG_INFINITY, DVec3::ZERO);
        for v in &self.vertices {
            let d = n.dot(*v);
            if d > best.0 {
                best = (d, *v);
            }
        }
        best.1
    }

    /// Signed distance of a point and its gradient: vertices, edges, faces, the nearest of all; inside, the largest
    /// plane value.
    pub fn distance(&self, x: DVec3) -> (f64, DVec3) {
        let deepest = self
            .planes
            .iter()
            .map(|(n, d)| (n.dot(x) - d, *n))
            .fold((f64::NEG_INFINITY, DVec3::X), |m, v| if v.0 > m.0 { v } else { m });
        if deepest.0 <= 0.0 {
            return deepest;
        }
        let mut best = (f64::INFINITY, DVec3::X);
        let mut take = |foot: DVec3| {
            let o = x - foot;
            let d = o.length();
            if d < best.0 {
                best = (d, if d > 0.0 { o / d } else { deepest.1 });
            }
        };
        self.vertices.iter().for_each(|v| take(*v));
        for e in &self.edges {
            let s = (x - e.ends[0]).dot(e.way);
            if s > 0.0 && s < (e.ends[1] - e.ends[0]).dot(e.way) {
                take(e.ends[0] + e.way * s);
            }
        }
        // Rounding of a plane's value at a foot: a few operations on numbers of the size of x against the body.
        let slack = CARRIED * (x - self.vertices[0]).length();
        for (k, (n, d)) in self.planes.iter().enumerate() {
            let v = n.dot(x) - d;
            let foot = x - *n * v;
            let over = |(j, (m, e)): (usize, &(DVec3, f64))| j != k && m.dot(foot) - e > slack;
            if v > 0.0 && v < best.0 && !self.planes.iter().enumerate().any(over) {
                best = (v, *n);
            }
        }
        best
    }
}

impl Convex {
    /// The primitive in its own frame; `None` for what has no closed form here: a half-space, a capsule and what is not convex.
    pub fn of(shape: &Shape) -> Option<Self> {
        let round = |r0: f64, r1: f64, h: f64| Round {
            centers: [DVec3::Z * -h, DVec3::Z * h],
            radii: [r0, r1],
            axis: DVec3::Z,
            lean: (r0 - r1) / (r0 - r1).hypot(2.0 * h),
        };
        let planes = || shape.geometry().faces().iter().filter_map(Face::flat).collect();
        Some(match shape.convex() {
            primitive::Convex::Ball(radius) => Convex::Ball(Ball { center: DVec3::ZERO, radius }),
            primitive::Convex::Round { bottom, top, half } if bottom == top => {
                Convex::Cylinder(round(bottom, top, half))
            }
            primitive::Convex::Round { bottom, top, half } => Convex::Cone(round(bottom, top, half)),
            primitive::Convex::Corners(corners) => Convex::Poly(Poly::new(corners.to_vec(), planes())),
            primitive::Convex::Cuboid(half) => {
                let corners = contactd::math::Aabb::around(DVec3::ZERO, half).corners();
                Convex::Poly(Poly::new(corners.to_vec(), planes()))
            }
            primitive::Convex::Capsule { .. }
            | primitive::Convex::Ellipsoid(_)
            | primitive::Convex::Elliptic(_)
            | primitive::Convex::Superellipsoid(_)
            | primitive::Convex::HalfSpace
            | primitive::Convex::Other => return None,
        })
    }

    /// The same body where `s` puts it.
    pub fn placed(&self, s: &Stand) -> Self {
        match self {
            Convex::Ball(b) => Convex::Ball(Ball { center: s.point(b.center), radius: b.radius }),
            Convex::Cylinder(r) => Convex::Cylinder(r.placed(s)),
            Convex::Cone(r) => Convex::Cone(r.placed(s)),
            Convex::Poly(p) => Convex::Poly(p.placed(s)),
        }
    }

    /// Farthest point along n (any length).
    pub fn support(&self, n: DVec3) -> DVec3 {
        match self {
            Convex::Ball(b) => b.center + n.normalize_or_zero() * b.radius,
            Convex::Cylinder(r) | Convex::Cone(r) => r.support(n),
            Convex::Poly(p) => p.support(n),
        }
    }

    /// Largest n·x over the body.
    pub fn reach(&self, n: DVec3) -> f64 {
        match self {
            Convex::Ball(b) => b.center.dot(n) + b.radius * n.length(),
            Convex::Cylinder(r) | Convex::Cone(r) => {
                let len = (n - r.axis * n.dot(r.axis)).length();
                (r.centers[0].dot(n) + r.radii[0] * len).max(r.centers[1].dot(n) + r.radii[1] * len)
            }
            Convex::Poly(p) => p.vertices.iter().fold(f64::NEG_INFINITY, |m, v| m.max(n.dot(*v))),
        }
    }

    /// Signed distance of a point (negative inside) and its gradient.
    pub fn distance(&self, x: DVec3) -> (f64, DVec3) {
        match self {
            Convex::Ball(b) => {
                let d = (x - b.center).length();
                (d - b.radius, (x - b.center).try_normalize().unwrap_or(DVec3::X))
            }
            Convex::Cylinder(r) | Convex::Cone(r) => r.distance(x),
            Convex::Poly(p) => p.distance(x),
        }
    }

    /// The point of the body nearest to x; x itself inside.
    pub fn project(&self, x: DVec3) -> DVec3 {
        let (d, n) = self.distance(x);
        if d > 0.0 { x - n * d } else { x }
    }

    /// A point in the middle and a radius that holds the body around it.
    pub fn ball(&self) -> (DVec3, f64) {
        match self {
            Convex::Ball(b) => (b.center, b.radius),
            Convex::Cylinder(r) | Convex::Cone(r) => {
                (0.5 * (r.centers[0] + r.centers[1]), r.half().hypot(r.radii[0].max(r.radii[1])))
            }
            Convex::Poly(p) => {
                let c = p.vertices.iter().copied().sum::<DVec3>() / p.vertices.len() as f64;
                (c, p.vertices.iter().fold(0.0, |m: f64, v| m.max((*v - c).length())))
            }
        }
    }

    /// The kind of feature on which a boundary point lies, to within `tol`.
    pub fn feature(&self, x: DVec3, tol: f64) -> Feature {
        let of_count = |n: usize| [Feature::Face, Feature::Face, Feature::Edge, Feature::Vertex][n.min(3)];
        match self {
            Convex::Ball(_) => Feature::Face,
            Convex::Cylinder(r) | Convex::Cone(r) => {
                let (rho, z, _) = r.meridian(x);
                let near = |i: usize, c: f64| (rho - r.radii[i]).hypot(z - c) <= tol;
                match [near(0, -r.half()), near(1, r.half())].iter().position(|b| *b) {
                    Some(i) if r.radii[i] == 0.0 => Feature::Vertex,
                    Some(_) => Feature::Edge,
                    None => Feature::Face,
                }
            }
            Convex::Poly(p) => of_count(p.planes.iter().filter(|(n, d)| (n.dot(x) - d).abs() <= tol).count()),
        }
    }
}
