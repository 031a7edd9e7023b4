//! Closed meshes to test with, and judges of them that share nothing with the engine: solid angles, distances from triangles.

use crate::random_solids::Random;
use contactd::solid::primitive::TriangleMesh;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Points, and triangles of them that run counter-clockwise as seen from outside.
pub type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);

/// The solid within a mesh.
///
/// # Panics
/// Where it is none.
pub fn solid((points, triangles): &Mesh) -> TriangleMesh {
    TriangleMesh::new(points, triangles).expect("a closed mesh").0
}

/// The same with a formula that is divided, as that of a large mesh is: written out where somebody looks.
///
/// # Panics
/// Where it is none.
pub fn divided((points, triangles): &Mesh) -> TriangleMesh {
    TriangleMesh::divided_from(0, points, triangles).expect("a closed mesh").0
}

/// A torus about z in `n` times `m` quadrangles, its corners on the exact one.
pub fn torus((major, minor): (f64, f64), n: u32, m: u32) -> Mesh {
    let at = |i: u32| {
        let (u, v) = (f64::from(i / m) / f64::from(n) * TAU, f64::from(i % m) / f64::from(m) * TAU);
        let r = major + minor * v.cos();
        DVec3::new(r * u.cos(), r * u.sin(), minor * v.sin())
    };
    let id = |i: u32, j: u32| i % n * m + j % m;
    let quads = (0..n).flat_map(|i| (0..m).map(move |j| (i, j)));
    let triangles = quads
        .flat_map(|(i, j)| [[id(i, j), id(i + 1, j), id(i + 1, j + 1)], [id(i, j), id(i + 1, j + 1), id(i, j + 1)]]);
    ((0..n * m).map(at).collect(), triangles.collect())
}

/// A ball with random bumps, of `n` rings of `m`.
pub fn bumps(r: &mut Random, (n, m): (u32, u32), (least, most): (f64, f64)) -> Mesh {
    let mut points = vec![DVec3::Z * most, -DVec3::Z * most];
    for i in 1..n {
        for j in 0..m {
            let (u, v) = (f64::from(i) / f64::from(n) * PI, f64::from(j) / f64::from(m) * TAU);
            points.push(DVec3::new(u.sin() * v.cos(), u.sin() * v.sin(), u.cos()) * r.within(least, most));
        }
    }
    let id = |i: u32, j: u32| match i {
        0 => 0,
        _ if i == n => 1,
        _ => 2 + (i - 1) * m + j % m,
    };
    let mut triangles = Vec::new();
    for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
        let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
        triangles.extend([[a, b, c], [a, c, d]].into_iter().filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]));
    }
    (points, triangles)
}

/// A prism about z over a polygon that is star-shaped about the origin, from −`half` to `half`, its lids fans about the middle.
pub fn prism(radii: &[f64], half: f64) -> Mesh {
    let n = radii.len() as u32;
    let ring = |z: f64| {
        let each = radii.iter().enumerate().map(move |(i, r)| (f64::from(i as u32) / f64::from(n) * TAU, r));
        each.map(move |(u, r)| DVec3::new(r * u.cos(), r * u.sin(), z)).collect::<Vec<_>>()
    };
    let mut points = [ring(-half), ring(half)].concat();
    points.extend([DVec3::Z * -half, DVec3::Z * half]);
    let each = (0..n).flat_map(|i| {
        let j = (i + 1) % n;
        [[i, j, n + j], [i, n + j, n + i], [2 * n, j, i], [2 * n + 1, n + i, n + j]]
    });
    (points, each.collect())
}

/// A random mesh of size about `size`: a star, a tessellated torus or a ball with bumps, one in two in single precision.
pub fn random(r: &mut Random, size: f64) -> Mesh {
    let (points, triangles) = match r.below(3) {
        0 => {
            let radii: Vec<f64> = (0..4 + r.below(5)).map(|_| size * r.within(0.3, 1.0)).collect();
            prism(&radii, size * r.within(0.2, 0.8))
        }
        1 => {
            let minor = size * r.within(0.15, 0.35);
            torus((minor + size * r.within(0.1, 0.5), minor), 3 + r.below(5) as u32, 3 + r.below(4) as u32)
        }
        _ => {
            let rings = (3 + r.below(3) as u32, 4 + r.below(4) as u32);
            bumps(r, rings, (0.4 * size, size))
        }
    };
    let single = r.chance(0.5);
    (points.into_iter().map(|p| if single { p.as_vec3().as_dvec3() } else { p }).collect(), triangles)
}

/// How often a mesh winds around a point: its solid angle there over 4π (A. van Oosterom, J. Strackee 1983).
pub fn winding((points, triangles): &Mesh, x: DVec3) -> f64 {
    let angle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| points[v as usize] - x);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        2.0 * a.dot(b.cross(c)).atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
    };
    triangles.iter().map(angle).sum::<f64>() / (4.0 * PI)
}

/// Distance of a point from a mesh.
pub fn distance((points, triangles): &Mesh, x: DVec3) -> f64 {
    let each = triangles.iter().map(|t| from_triangle(x, t.map(|v| points[v as usize])));
    each.fold(f64::INFINITY, f64::min)
}

fn from_triangle(x: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let n = (b - a).cross(c - a);
    let beyond = |p: DVec3, q: DVec3| (q - p).cross(x - p).dot(n) < 0.0;
    if !beyond(a, b) && !beyond(b, c) && !beyond(c, a) {
        return ((x - a).dot(n) / n.length()).abs();
    }
    let segment = |p: DVec3, q: DVec3| {
        let t = ((x - p).dot(q - p) / (q - p).length_squared()).clamp(0.0, 1.0);
        x.distance(p + (q - p) * t)
    };
    segment(a, b).min(segment(b, c)).min(segment(c, a))
}
