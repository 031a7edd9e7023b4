use super::*;
use crate::math::random::Random;
use crate::solid::primitive::Geometry as _;
use crate::solid::{Label, Solid, SolidBuilder};
use contactd_proto::Pose;
use glam::DQuat;
use std::f64::consts::{PI, TAU};

/// Points and faces of a closed mesh, counter-clockwise as seen from outside.
#[derive(Clone, Debug, Default)]
struct Soup {
    points: Vec<DVec3>,
    faces: Vec<Vec<u32>>,
    /// Some of its parts, and not all, are inside out.
    is_mixed: bool,
}

impl Soup {
    fn with(mut self, other: &Soup) -> Self {
        let first = self.points.len() as u32;
        self.points.extend(&other.points);
        self.is_mixed |= other.is_mixed;
        self.faces.extend(other.faces.iter().map(|f| f.iter().map(|i| i + first).collect::<Vec<u32>>()));
        self
    }

    fn reversed(mut self) -> Self {
        self.faces.iter_mut().for_each(|f| f.reverse());
        self
    }

    fn mapped(mut self, to: impl Fn(DVec3) -> DVec3) -> Self {
        self.points.iter_mut().for_each(|p| *p = to(*p));
        self
    }

    /// The triangles that its faces are fans of.
    fn triangles(&self) -> Vec<[DVec3; 3]> {
        let fan = |f: &Vec<u32>| (1..f.len() - 1).map(|i| [f[0], f[i], f[i + 1]]).collect::<Vec<_>>();
        self.faces.iter().flat_map(fan).map(|t| t.map(|i| self.points[i as usize])).collect()
    }

    /// The rings of a tube as a closed mesh of triangles.
    fn tube(rings: &[Vec<DVec3>]) -> Self {
        let n = rings[0].len() as u32;
        let mut faces = vec![(0..n).rev().collect::<Vec<u32>>()];
        for k in 0..rings.len() as u32 - 1 {
            for i in 0..n {
                let [a, b] = [k * n + i, k * n + (i + 1) % n];
                faces.extend([vec![a, b, b + n], vec![a, b + n, a + n]]);
            }
        }
        let last = (rings.len() as u32 - 1) * n;
        faces.push((last..last + n).collect());
        // Ends as triangles: those of a ring need not be flat.
        let fan = |f: Vec<u32>| (1..f.len() - 1).map(|i| vec![f[0], f[i], f[i + 1]]).collect::<Vec<_>>();
        Self { points: rings.concat(), faces: faces.into_iter().flat_map(fan).collect(), is_mixed: false }
    }
}

fn cuboid(low: DVec3, high: DVec3) -> Soup {
    let at = |x: f64, y: f64, z: f64| low + (high - low) * DVec3::new(x, y, z);
    let ring = |z: f64| vec![at(0.0, 0.0, z), at(1.0, 0.0, z), at(1.0, 1.0, z), at(0.0, 1.0, z)];
    Soup::tube(&[ring(0.0), ring(1.0)])
}

fn prism(n: u32, r: f64, h: f64) -> Soup {
    let at = |i: u32, z: f64| {
        let (y, x) = libm::sincos(TAU * f64::from(i) / f64::from(n));
        DVec3::new(r * x, r * y, z)
    };
    Soup::tube(&[0.0, h].map(|z| (0..n).map(|i| at(i, z)).collect()))
}

fn tetrahedron(corners: [DVec3; 4]) -> Soup {
    let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].map(|f| f.to_vec()).to_vec();
    let [a, b, c, d] = corners;
    let soup = Soup { points: corners.to_vec(), faces, is_mixed: false };
    if (b - a).cross(c - a).dot(d - a) < 0.0 { soup.reversed() } else { soup }
}

/// A ball's triangles with random radii, one corner of which is pushed through the other side.
fn star(r: &mut Random, rings: u32) -> Soup {
    let turn = 2 * rings;
    let at = |k: u32, i: u32, radius: f64| {
        let (z, up) = libm::sincos(PI * (f64::from(k) / f64::from(rings) - 0.5));
        let (y, x) = libm::sincos(TAU * f64::from(i) / f64::from(turn));
        DVec3::new(x * up, y * up, z) * radius
    };
    let mut points = vec![at(0, 0, 1.0)];
    for k in 1..rings {
        points.extend((0..turn).map(|i| at(k, i, r.within(0.6, 1.4))));
    }
    points.push(at(rings, 0, 1.0));
    let id = |k: u32, i: u32| if k == 0 { 0 } else { 1 + (k - 1) * turn + i % turn };
    let top = points.len() as u32 - 1;
    let mut faces = Vec::new();
    for i in 0..turn {
        faces.push(vec![0, id(1, i + 1), id(1, i)]);
        faces.push(vec![top, id(rings - 1, i), id(rings - 1, i + 1)]);
        for k in 1..rings - 1 {
            let [a, b, c, d] = [id(k, i), id(k, i + 1), id(k + 1, i + 1), id(k + 1, i)];
            faces.extend([vec![a, b, c], vec![a, c, d]]);
        }
    }
    let pushed = (r.unit() * f64::from(top)) as usize;
    points[pushed] *= -r.within(0.5, 2.0);
    Soup { points, faces, is_mixed: false }
}

/// A polygon swept along a helix whose turns overlap.
fn helix(r: &mut Random, per_turn: u32) -> Soup {
    let (sides, turns, size) = (3 + (r.unit() * 4.0) as u32, 1.2 + r.unit(), r.within(0.3, 0.5));
    let (rise, lean) = (r.within(0.2, 0.5), r.within(0.0, 1.0));
    let count = (turns * f64::from(per_turn)) as u32;
    let ring = |k: u32| {
        let around = TAU * f64::from(k) / f64::from(per_turn);
        let (s, c) = libm::sincos(around);
        let corner = |i: u32| {
            let (y, x) = libm::sincos(TAU * f64::from(i) / f64::from(sides) + lean);
            let out = 1.0 + size * x;
            DVec3::new(out * c, out * s, rise * around / TAU + size * y)
        };
        (0..sides).rev().map(corner).collect::<Vec<_>>()
    };
    Soup::tube(&(0..=count).map(ring).collect::<Vec<_>>())
}

fn turn(r: &mut Random) -> DQuat {
    DQuat::from_xyzw(r.within(-1.0, 1.0), r.within(-1.0, 1.0), r.within(-1.0, 1.0), r.within(0.1, 1.0)).normalize()
}

/// Solids in a heap as one mesh, some of them inside out: placed at random or on a grid of whole numbers.
fn heap(r: &mut Random, on_grid: bool) -> Soup {
    let mut all = Soup::default();
    for _ in 0..2 + (r.unit() * 3.0) as usize {
        let mut one = if on_grid {
            let whole = |r: &mut Random, to: f64| DVec3::from(r.vector(to).to_array().map(libm::round));
            let low = whole(r, 2.0);
            match r.unit() < 0.6 {
                true => cuboid(low, low + DVec3::ONE + whole(r, 1.0).abs()),
                false => loop {
                    let corners = [low, low + whole(r, 3.0), low + whole(r, 3.0), low + whole(r, 3.0)];
                    let [a, b, c, d] = corners;
                    if (b - a).cross(c - a).dot(d - a) != 0.0 {
                        break tetrahedron(corners);
                    }
                },
            }
        } else {
            let one = match (r.unit() * 3.0) as u32 {
                0 => cuboid(-r.vector(1.0).abs() - 0.1, r.vector(1.0).abs() + 0.1),
                1 => tetrahedron([0; 4].map(|_| r.vector(1.5))),
                _ => prism(3 + (r.unit() * 5.0) as u32, r.within(0.3, 1.0), r.within(0.3, 2.0)),
            };
            let (turn, by) = (turn(r), r.vector(0.8));
            one.mapped(|p| turn * p + by)
        };
        if r.unit() < 0.2 {
            one = one.reversed();
            all.is_mixed = true;
        }
        all = all.with(&one);
    }
    all
}

/// How often triangles wind around a point: the sum of the solid angles that they are seen under (A. van Oosterom, J. Strackee, "The
/// solid angle of a plane triangle", 1983).
fn winding(triangles: &[[DVec3; 3]], x: DVec3) -> f64 {
    let angle = |t: &[DVec3; 3]| {
        let [a, b, c] = t.map(|p| p - x);
        let [p, q, r] = [a, b, c].map(DVec3::length);
        let below = p * q * r + a.dot(b) * r + b.dot(c) * p + c.dot(a) * q;
        2.0 * libm::atan2(a.dot(b.cross(c)), below)
    };
    triangles.iter().map(angle).sum::<f64>() / (4.0 * PI)
}

fn solid(mesh: TriangleMesh) -> Solid {
    let mut builder = SolidBuilder::new();
    let label = Label { name: "mesh".into(), line: 1, column: 1, mirrored: false };
    let root = builder.primitive(crate::solid::Shape::from(mesh), Pose::IDENTITY, label);
    builder.finish(root)
}

/// What came of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Came {
    /// Loaded as it was.
    Whole,
    /// Loaded as what it winds around.
    Wound,
    /// Refused, or without volume, and nothing in it crosses.
    Refused,
    /// Refused though something crosses: in doubles too much lies on each other but for roundings.
    Failed,
}

fn closed(soup: &Soup) -> Result<Closed, MeshFault> {
    TriangleMesh::closed(&soup.points, soup.faces.iter().map(Vec::as_slice))
}

/// Loads a mesh and holds what is inside against the judge.
fn judged(soup: &Soup, r: &mut Random, what: &str) -> Came {
    let closed = match closed(soup) {
        Ok(closed) => closed,
        Err(MeshFault::Flat) => return Came::Refused,
        Err(fault) => panic!("{what}: {fault}"),
    };
    let (mesh, done) = match mesh(closed) {
        Ok(loaded) => loaded,
        Err(_) => {
            let fan = |f: &Vec<u32>| (1..f.len() - 1).map(|i| [f[0], f[i], f[i + 1]]).collect::<Vec<_>>();
            let triangles: Vec<[u32; 3]> = soup.faces.iter().flat_map(fan).collect();
            let crosses = Resolved::of(&soup.points, &triangles, DIGITS).is_some();
            return if crosses { Came::Failed } else { Came::Refused };
        }
    };
    // Where nothing crosses the mesh is not looked at here.
    if done.crossing.is_none() && soup.is_mixed {
        return Came::Whole;
    }
    let solid = solid(mesh);
    let triangles = soup.triangles();
    let size = soup.points.iter().fold(0.0, |s: f64, p| s.max(p.length()));
    let mut told = 0;
    for _ in 0..200 {
        let on = &triangles[(r.unit() * triangles.len() as f64) as usize];
        let near = on[0].lerp(on[1], r.unit()).lerp(on[2], r.unit());
        let x = if r.unit() < 0.5 { r.vector(size) } else { near + r.vector(0.1 * size) };
        let (times, value) = (winding(&triangles, x), solid.value(x));
        // Near the surface, or in a plane of it so that an angle is none.
        if value.abs() < 1e-7 * size || (times - times.round()).abs() > 1e-6 {
            continue;
        }
        told += 1;
        assert_eq!(value < 0.0, times.round() != 0.0, "{what}: at {x} wound around {times}, value {value}");
    }
    assert!(told > 100, "{what}: {told}");
    if done.crossing.is_some() { Came::Wound } else { Came::Whole }
}

/// The long form: `CONTACTD_WOUND=1000 cargo test -p contactd --lib arrangement`.
#[test]
fn random_meshes_that_cross_themselves_are_what_they_wind_around() {
    let rounds = std::env::var("CONTACTD_WOUND").ok().and_then(|n| n.parse().ok()).unwrap_or(12);
    let mut counts = [[0; 4]; 5];
    for seed in 0..rounds {
        let mut r = Random(1 + seed * 77);
        for (kind, counts) in counts.iter_mut().enumerate() {
            let soup = match kind {
                0 => heap(&mut r, false),
                1 => heap(&mut r, true),
                2 => star(&mut r, 3 + (seed % 4) as u32),
                3 => helix(&mut r, 6 + (seed % 8) as u32),
                // Whose turns lie on each other but for roundings.
                _ => helix(&mut r, 5).with(&heap(&mut r, seed % 2 == 0)),
            };
            counts[judged(&soup, &mut r, &format!("seed {seed}, kind {kind}")) as usize] += 1;
        }
    }
    for (kind, [_, wound, refused, failed]) in counts.into_iter().enumerate() {
        assert!(wound as u64 * 3 > rounds, "{counts:?}");
        assert!(kind < 2 || refused == 0, "{counts:?}");
        assert!(failed == 0 || kind == 4 && failed as u64 * 25 <= rounds, "{counts:?}");
    }
}

/// Boxes with corners on whole numbers, some inside out: volume by counting unit cubes.
#[test]
fn boxes_on_a_grid_have_the_volume_of_the_cubes_that_they_wind_around() {
    let mut wound = 0;
    for seed in 0..60 {
        let mut r = Random(5 + seed);
        let (mut soup, mut cubes) = (Soup::default(), [0i32; 512]);
        for _ in 0..2 + seed % 4 {
            let low = [0; 3].map(|_| (r.unit() * 5.0) as usize);
            let high = low.map(|x| x + 1 + (r.unit() * (8 - x - 1) as f64) as usize);
            let at = |p: [usize; 3]| DVec3::from(p.map(|x| x as f64));
            let turned = r.unit() < 0.25;
            let one = cuboid(at(low), at(high));
            soup = soup.with(&if turned { one.reversed() } else { one });
            for (i, count) in cubes.iter_mut().enumerate() {
                let cube = [i % 8, i / 8 % 8, i / 64];
                if (0..3).all(|k| (low[k]..high[k]).contains(&cube[k])) {
                    *count += if turned { -1 } else { 1 };
                }
            }
        }
        let Ok(closed) = closed(&soup) else { continue };
        let Ok((mesh, done)) = mesh(closed) else { continue };
        if done.crossing.is_none() {
            continue;
        }
        wound += 1;
        let (volume, cubes) = (mesh.moments().map_or(0.0, |m| m.volume()), cubes.iter().filter(|c| **c != 0).count());
        assert!((volume - cubes as f64).abs() < 1e-9, "seed {seed}: {volume}, not {cubes}");
    }
    assert!(wound > 25, "{wound}");
}

#[test]
fn what_comes_out_is_closed_to_the_bit_and_what_does_not_cross_is_left_alone() {
    for seed in 0..40 {
        let mut r = Random(900 + seed);
        let soup = if seed % 2 == 0 { heap(&mut r, seed % 4 == 0) } else { helix(&mut r, 5 + (seed % 7) as u32) };
        let fan = |f: &Vec<u32>| (1..f.len() - 1).map(|i| [f[0], f[i], f[i + 1]]).collect::<Vec<_>>();
        let triangles: Vec<[u32; 3]> = soup.faces.iter().flat_map(fan).collect();
        for (digits, steps) in TRIES {
            let Some(found) = Resolved::of(&soup.points, &triangles, digits) else { continue };
            for reach in steps {
                let (_, faces) = outcome::rounded(&found.facets, &found.pieces, &found.faces, *reach);
                let mut sides = std::collections::HashMap::new();
                for face in &faces {
                    for (a, b) in face.iter().zip(face.iter().cycle().skip(1)) {
                        *sides.entry([*a.min(b), *a.max(b)]).or_insert(0) += if a < b { 1 } else { -1 };
                    }
                }
                assert!(sides.values().all(|balance| *balance == 0), "seed {seed}, {digits} digits, {reach}");
            }
        }
    }
    let ball = |r: f64| cuboid(DVec3::splat(-r), DVec3::splat(r));
    let (_, done) = mesh(closed(&ball(2.0).with(&ball(1.0).reversed())).expect("closed")).expect("a cavity");
    assert_eq!(done.notes("a mesh"), []);
    let apart = ball(1.0).with(&ball(1.0).mapped(|p| p + DVec3::X * 4.0));
    let (_, done) = mesh(closed(&apart).expect("closed")).expect("two boxes");
    assert_eq!(done.notes("a mesh"), []);
    let across = ball(1.0).with(&ball(1.0).mapped(|p| p + DVec3::ONE));
    let (mesh, done) = mesh(closed(&across).expect("closed")).expect("two boxes");
    assert!((mesh.moments().expect("a volume").volume() - 15.0).abs() < 1e-12);
    let notes = done.notes("a mesh");
    assert!(notes[0].0.starts_with("a mesh that crosses itself (") && notes.len() == 1, "{notes:?}");
}

/// `cargo test --release -p contactd --lib arrangement -- --ignored --nocapture`
#[test]
#[ignore = "how long threads take"]
fn how_long_threads_take() {
    for per_turn in [12, 30, 100, 300, 1000] {
        let soup = helix(&mut Random(3), per_turn);
        let from = std::time::Instant::now();
        let done = mesh(closed(&soup).expect("closed")).map(|(mesh, done)| (mesh.triangles().len(), done));
        println!("{} triangles: {:?} in {:?}", soup.triangles().len(), done, from.elapsed());
    }
}
