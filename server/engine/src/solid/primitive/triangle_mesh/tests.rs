//! Meshes against judges of their own: solid angles for what is inside, distances from triangles for |f|.

use super::*;
use crate::math::random::Random;
use std::f64::consts::{PI, TAU};

type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);

/// How often a mesh winds around a point: its solid angle there over 4π (A. van Oosterom, J. Strackee 1983).
fn winding(m: &TriangleMesh, x: DVec3) -> f64 {
    let angle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| m.vertices()[v as usize] - x);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let under = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * a.dot(b.cross(c)).atan2(under)
    };
    m.triangles().iter().map(angle).sum::<f64>() / (4.0 * PI)
}

/// Distance of a point from a triangle, by its regions.
fn distance(x: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
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

fn off(m: &TriangleMesh, x: DVec3) -> f64 {
    let each = m.triangles().iter().map(|t| distance(x, t.map(|v| m.vertices()[v as usize])));
    each.fold(f64::INFINITY, f64::min)
}

/// Triangles of a grid that is closed both ways.
fn closed_grid(n: u32, m: u32, at: impl Fn(f64, f64) -> DVec3) -> Mesh {
    let points = (0..n * m).map(|i| at(f64::from(i / m) / f64::from(n) * TAU, f64::from(i % m) / f64::from(m) * TAU));
    let id = |i: u32, j: u32| i % n * m + j % m;
    let quads = (0..n).flat_map(|i| (0..m).map(move |j| (i, j)));
    let triangles = quads
        .flat_map(|(i, j)| [[id(i, j), id(i + 1, j), id(i + 1, j + 1)], [id(i, j), id(i + 1, j + 1), id(i, j + 1)]]);
    (points.collect(), triangles.collect())
}

fn torus(n: u32, m: u32) -> Mesh {
    closed_grid(n, m, |u, v| {
        let r = 1.0 + 0.4 * v.cos();
        DVec3::new(r * u.cos(), r * u.sin(), 0.4 * v.sin())
    })
}

/// A ball with random bumps: no vertex is like another, and many are saddles.
fn bumps(r: &mut Random, n: u32, m: u32, rough: f64) -> Mesh {
    let mut points = vec![DVec3::Z, -DVec3::Z];
    for i in 1..n {
        for j in 0..m {
            let (u, v) = (f64::from(i) / f64::from(n) * PI, f64::from(j) / f64::from(m) * TAU);
            let d = DVec3::new(u.sin() * v.cos(), u.sin() * v.sin(), u.cos());
            points.push(d * r.within(1.0 - rough, 1.0 + rough));
        }
    }
    let id = |i: u32, j: u32| {
        if i == 0 {
            0
        } else if i == n {
            1
        } else {
            2 + (i - 1) * m + j % m
        }
    };
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            triangles
                .extend([[a, b, c], [a, c, d]].into_iter().filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]));
        }
    }
    (points, triangles)
}

/// A prism over a polygon that is star-shaped about the origin; its lids are fans from a corner or from the middle.
fn star(radii: &[f64], height: f64) -> Mesh {
    let n = radii.len() as u32;
    let ring = |z: f64| {
        let each = radii.iter().enumerate().map(move |(i, r)| (i as f64 / radii.len() as f64 * TAU, r));
        each.map(move |(u, r)| DVec3::new(r * u.cos(), r * u.sin(), z)).collect::<Vec<_>>()
    };
    let mut points = [ring(0.0), ring(height)].concat();
    points.extend([DVec3::ZERO, DVec3::Z * height]);
    let mut triangles = Vec::new();
    for i in 0..n {
        let j = (i + 1) % n;
        triangles.extend([[i, j, n + j], [i, n + j, n + i], [2 * n, j, i], [2 * n + 1, n + i, n + j]]);
    }
    (points, triangles)
}

fn turned((points, triangles): Mesh, r: &mut Random, single: bool) -> Mesh {
    let q = contactd_proto::motion::quat_of_rotation_vector(r.vector(2.0));
    let shift = r.vector(1.0);
    let round = |p: DVec3| if single { p.as_vec3().as_dvec3() } else { p };
    (points.into_iter().map(|p| round(q * p + shift)).collect(), triangles)
}

/// Signs against the winding number, and |f| against the distance.
fn judge(name: &str, (points, triangles): &Mesh, r: &mut Random, count: usize) {
    let start = std::time::Instant::now();
    let (m, repair) = TriangleMesh::new(points, triangles).unwrap_or_else(|e| panic!("{name}: {e}"));
    let took = start.elapsed();
    assert_eq!(repair, Repair::default(), "{name}");
    let around = Aabb::of_points(points.iter().copied());
    let size = around.half().length();
    let (mut inside, mut least) = (0, f64::INFINITY);
    for i in 0..count {
        let x = if i % 2 == 0 {
            around.center() + around.half() * r.vector(1.2)
        } else {
            // Near a corner, where formulas are hardest.
            points[(r.unit() * points.len() as f64) as usize] + r.vector(1.0) * size * 10f64.powf(r.within(-6.0, -0.5))
        };
        let (f, d, w) = (m.value(x), off(&m, x), winding(&m, x));
        if d > 1e-9 * size {
            assert!((w - w.round()).abs() < 1e-3, "{name}: {w}");
            assert_eq!(f < 0.0, w.round() == 1.0, "{name}: f {f} at {x}, winds {w}, {d} off");
            least = least.min(f.abs() / d.min(size));
            inside += usize::from(f < 0.0);
        }
        assert!(f < 0.0 && -f <= d + 1e-12 * size || f >= 0.0 && f <= d + 1e-12 * size, "{name}: f {f}, {d} off");
    }
    let tokens = m.formula.tokens().len();
    println!(
        "{name}: {} triangles, {} faces, {} cuts, {tokens} tokens in {took:?}; {inside} of {count} inside; |f| >= {least:.1e} of the distance",
        triangles.len(),
        m.bounding_faces(),
        m.faces().len() - m.bounding_faces(),
    );
    assert!(inside > 0 && least > 1e-4, "{name}: {least}");
}

#[test]
fn f_has_the_sign_of_the_winding_number_and_at_most_the_distance() {
    let mut r = Random(9);
    // Points a mesh; long: CONTACTD_POINTS=2000.
    let points = std::env::var("CONTACTD_POINTS").ok().and_then(|n| n.parse().ok()).unwrap_or(200);
    for n in [3, 5, 8, 16, 32] {
        judge(&format!("torus {n}"), &torus(n, n.max(4)), &mut r, points);
    }
    for (n, rough) in [(3, 0.3), (4, 0.5), (6, 0.3), (12, 0.2), (24, 0.1), (24, 1e-9)] {
        judge(&format!("bumps {n} {rough}"), &bumps(&mut r, n, 2 * n, rough), &mut r, points);
    }
    for n in [5, 6, 12, 40] {
        let radii: Vec<f64> = (0..n).map(|_| r.within(0.5, 1.5)).collect();
        let mesh = star(&radii, 0.7);
        judge(&format!("star {n}"), &mesh, &mut r, points);
        for single in [false, true] {
            let mesh = turned(star(&radii, 0.7), &mut r, single);
            judge(&format!("star {n}, turned, single {single}"), &mesh, &mut r, points);
        }
    }
    for single in [false, true] {
        let mesh = turned(torus(24, 12), &mut r, single);
        judge(&format!("torus, turned, single {single}"), &mesh, &mut r, points);
        let mesh = turned(star(&[1.0; 64], 0.7), &mut r, single);
        judge(&format!("cylinder, turned, single {single}"), &mesh, &mut r, points);
    }
}

/// Rings about z, a point on the axis before the first and behind the last: fans of slivers at both ends.
fn spindle(profile: &[[f64; 2]], sides: u32) -> Mesh {
    let [first, .., last] = profile else { panic!("a profile has two ends") };
    let rings = &profile[1..profile.len() - 1];
    let mut points = vec![DVec3::Z * first[1], DVec3::Z * last[1]];
    for ([radius, z], k) in rings.iter().flat_map(|ring| (0..sides).map(move |k| (ring, k))) {
        let u = f64::from(k) / f64::from(sides) * TAU;
        points.push(DVec3::new(radius * u.cos(), radius * u.sin(), *z));
    }
    let id = |ring: u32, k: u32| 2 + ring * sides + k % sides;
    let mut triangles = Vec::new();
    for k in 0..sides {
        triangles.extend([
            [0, id(0, k + 1), id(0, k)],
            [1, id(rings.len() as u32 - 1, k), id(rings.len() as u32 - 1, k + 1)],
        ]);
        for ring in 1..rings.len() as u32 {
            let [a, b, c, d] = [id(ring - 1, k), id(ring - 1, k + 1), id(ring, k + 1), id(ring, k)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    (points, triangles)
}

/// Fans take as many small parts as the square of their slivers: these would not fit, larger ones do.
#[test]
fn fans_of_many_slivers_are_told_by_larger_parts() {
    let mut r = Random(23);
    // Points a mesh; long, with more meshes: CONTACTD_POINTS=200.
    let long = std::env::var("CONTACTD_POINTS").ok().and_then(|n| n.parse().ok());
    let points = long.unwrap_or(60);
    for i in 0..if long.is_some() { 12 } else { 2 } {
        let sides = r.within(502.0, 1400.0) as u32;
        let (radius, high, low) = (r.within(0.4, 2.0), r.within(0.3, 2.0), r.within(-0.25, 1.0));
        let ring = [radius, 0.0];
        let second = [radius * r.within(0.3, 1.5), 0.2];
        // Cones with a flat base, a dent below (low < 0) or a second tip; in one of two a waist or a collar.
        let below = [0.0, if i % 3 == 0 { 0.0 } else { -low }];
        let top = [0.0, 0.2 + high];
        let mesh =
            if i % 2 == 0 { spindle(&[below, ring, top], sides) } else { spindle(&[below, ring, second, top], sides) };
        let single = r.unit() < 0.3;
        judge(&format!("fan {i} of {sides}, single {single}"), &turned(mesh, &mut r, single), &mut r, points);
    }
}

/// Cut across their height, walls are in all cells above each other; cut around the prism, in one.
#[test]
fn tall_walls_are_divided_around_the_prism_alone() {
    let mut r = Random(29);
    // Long: CONTACTD_POINTS=200.
    for _ in 0..if std::env::var_os("CONTACTD_POINTS").is_some() { 12 } else { 1 } {
        let radii: Vec<f64> = (0..500).map(|_| r.within(0.98, 1.02)).collect();
        let [low, tall] = [0.05, 40.0].map(|height| {
            let mesh = star(&radii, height);
            let m = TriangleMesh::new(&mesh.0, &mesh.1).expect("a closed mesh").0;
            judge(&format!("a prism {height} high"), &mesh, &mut r, 60);
            m.formula.tokens().len()
        });
        assert!(tall < 4 * low, "{tall} tokens, {low} of a low one");
    }
}

#[test]
#[ignore = "how long large meshes take"]
fn large() {
    let mut r = Random(9);
    for n in [64, 128, 224] {
        judge(&format!("torus {n}"), &torus(n, n), &mut r, 100);
        judge(&format!("bumps {n}"), &bumps(&mut r, n, n, 0.02), &mut r, 100);
    }
}

#[test]
fn boxes_hold_what_is_in_them_and_every_facet_is_in_one() {
    let (points, triangles) = closed_grid(40, 30, |u, v| {
        let r = 3.0 + (1.0 + 0.2 * (9.0 * u).sin()) * v.cos();
        DVec3::new(100.0 + r * u.cos(), r * u.sin(), v.sin())
    });
    let (mesh, _) = TriangleMesh::new(&points, &triangles).expect("a closed mesh");
    let (tree, facets) = (mesh.facet_tree().expect("boxes"), mesh.facets().expect("facets"));
    let mut seen = vec![0; mesh.triangles().len()];
    let mut stack = vec![(FacetTree::ROOT, (DVec3::ZERO, DVec3::INFINITY))];
    while let Some((place, outer)) = stack.pop() {
        let (center, half) = tree.around(place);
        assert!(((center - outer.0).abs() + half).cmple(outer.1 + DVec3::splat(1e-12)).all(), "{place}");
        match tree.below(place) {
            Below::Halves(halves) => stack.extend(halves.map(|h| (h, (center, half)))),
            Below::Facets(list) => {
                for f in list {
                    seen[*f as usize] += 1;
                    let within = |x: DVec3| (x - center).abs().cmple(half + DVec3::splat(1e-13)).all();
                    assert!(facets.corners(*f).into_iter().all(within), "{f}");
                }
            }
        }
    }
    assert!(seen.iter().all(|count| *count == 1));
    assert_eq!(tree.shells().len(), 1);
    let mut near = Vec::new();
    let x = mesh.vertices()[7];
    tree.near(x, 1e-9, |f| near.push(f));
    let meets = |i: u32| facets.corners(i).contains(&x);
    assert!((0..mesh.triangles().len() as u32).all(|i| !meets(i) || near.contains(&i)));
    assert!(near.iter().any(|f| meets(*f)));
}

/// Whether an edge of one triangle goes through the other: volumes of tetrahedra, in doubles.
fn goes_through(one: [DVec3; 3], other: [DVec3; 3]) -> bool {
    let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
    let [a, b, c] = other;
    (0..3).any(|k| {
        let (p, q) = (one[k], one[(k + 1) % 3]);
        let around = [volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)];
        let passes = around.iter().all(|v| *v >= 0.0) || around.iter().all(|v| *v <= 0.0);
        volume(a, b, c, p) * volume(a, b, c, q) < 0.0 && passes
    })
}

#[test]
fn two_facets_that_cross_are_told_with_where_they_do() {
    let mut r = Random(31);
    for round in 0..40 {
        let (mut points, mut triangles) = bumps(&mut r, 6, 8, 0.1);
        let (more, others) = bumps(&mut r, 5 + round % 4, 7, 0.1);
        let aside = r.vector(1.0).normalize() * r.within(0.7, 1.5);
        let first = points.len() as u32;
        points.extend(more.into_iter().map(|p| p + aside));
        triangles.extend(others.into_iter().map(|t| t.map(|v| v + first)));
        for few in [0, usize::MAX] {
            match TriangleMesh::divided_from(few, &points, &triangles) {
                Err(MeshFault::Through { near, facets }) => {
                    let [one, other] = *facets;
                    assert!(goes_through(one, other) || goes_through(other, one), "round {round}: {one:?} {other:?}");
                    for facet in [one, other] {
                        assert!(Aabb::of_points(facet).grown(1e-9).contains(near), "round {round}: {near} {facet:?}");
                        let is_own = |t: &[u32; 3]| t.map(|v| points[v as usize]) == facet;
                        assert_eq!(triangles.iter().filter(|t| is_own(t)).count(), 1, "round {round}: {facet:?}");
                    }
                }
                told => panic!("round {round}, few {few}: {told:?}"),
            }
        }
    }
}

/// Two stars, in the order and the ways round that `turned` says, the second one moved and scaled.
fn two(r: &mut Random, turned: [bool; 2], (scale, by): (f64, DVec3)) -> Mesh {
    let (mut points, mut triangles) = (Vec::new(), Vec::<[u32; 3]>::new());
    for (is_turned, (scale, by)) in turned.into_iter().zip([(1.0, DVec3::ZERO), (scale, by)]) {
        let radii: Vec<f64> = (0..5 + (r.unit() * 12.0) as usize).map(|_| r.within(0.8, 1.2)).collect();
        let (corners, faces) = star(&radii, 1.0);
        let first = points.len() as u32;
        points.extend(corners.into_iter().map(|p| (p - DVec3::Z * 0.5) * scale + by));
        triangles.extend(faces.into_iter().map(|[a, b, c]| {
            let t = [a, b, c].map(|v| v + first);
            if is_turned { [t[0], t[2], t[1]] } else { t }
        }));
    }
    (points, triangles)
}

#[test]
fn parts_that_run_round_otherwise_than_those_of_a_solid_are_refused() {
    let mut r = Random(37);
    for round in 0..60 {
        let turned = [round % 2 == 1, round / 2 % 2 == 1];
        let apart = (r.within(0.3, 2.0), DVec3::X * r.within(4.0, 6.0));
        let within = (r.within(0.1, 0.4), r.vector(0.1));
        for (stands, is_solid) in [(apart, turned[0] == turned[1]), (within, turned[0] != turned[1])] {
            let (points, triangles) = two(&mut r, turned, stands);
            for few in [0, usize::MAX] {
                let made = TriangleMesh::divided_from(few, &points, &triangles);
                assert_eq!(made.is_ok(), is_solid, "round {round}, few {few}: {made:?}");
                assert!(is_solid || matches!(made, Err(MeshFault::Crossing(_))), "round {round}, few {few}: {made:?}");
            }
        }
    }
}

/// An edge that two solids share tells nothing of one by the other.
#[test]
fn parts_that_share_an_edge_are_looked_at_one_by_one() {
    let (mut points, mut triangles) = star(&[1.0; 4], 1.0);
    let count = points.len() as u32;
    let (more, others) = (points.clone(), triangles.clone());
    points.extend(more.into_iter().map(|p| p + DVec3::X * 2.0));
    for is_turned in [false, true] {
        triangles.truncate(others.len());
        triangles.extend(others.iter().map(|t| {
            let [a, b, c] = t.map(|v| v + count);
            if is_turned { [a, c, b] } else { [a, b, c] }
        }));
        // A third one, for as much one way round as the other is refused before it is looked at.
        let mut all = triangles.clone();
        let tip = points.len() as u32;
        let at = DVec3::new(-3.0, 0.0, 0.0);
        let corners = [at, at + DVec3::X, at + DVec3::Y, at + DVec3::Z];
        all.extend([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].map(|t: [u32; 3]| t.map(|v| v + tip)));
        let all_points: Vec<DVec3> = points.iter().copied().chain(corners).collect();
        for few in [0, usize::MAX] {
            let made = TriangleMesh::divided_from(few, &all_points, &all);
            assert_eq!(made.is_ok(), !is_turned, "few {few}: {made:?}");
        }
    }
}
