use super::soups::*;
use super::*;
use crate::math::random::Random;
use crate::solid::primitive::Geometry as _;
use crate::solid::{Label, Solid, SolidBuilder};
use contactd_proto::Pose;
use std::f64::consts::{PI, TAU};

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

/// Meshes of a kind: `few` in the command. The long form: `CONTACTD_WOUND=1000 cargo test -p contactd --lib arrangement`.
fn rounds(few: u64) -> u64 {
    std::env::var("CONTACTD_WOUND").ok().and_then(|n| n.parse().ok()).unwrap_or(few)
}

#[test]
fn random_meshes_that_cross_themselves_are_what_they_wind_around() {
    let rounds = rounds(2);
    let mut counts = [[0; 4]; 7];
    for seed in 0..rounds {
        let mut r = Random(1 + seed * 77);
        for (kind, counts) in counts.iter_mut().enumerate() {
            let soup = match kind {
                0 => heap(&mut r, false),
                1 => heap(&mut r, true),
                2 => star(&mut r, 3 + (seed % 4) as u32),
                3 => helix(&mut r, 6 + (seed % 8) as u32),
                4 => shells(&mut r, false),
                5 => shells(&mut r, true),
                // Whose turns lie on each other but for roundings.
                _ => helix(&mut r, 5).with(&heap(&mut r, seed % 2 == 0)),
            };
            counts[judged(&soup, &mut r, &format!("seed {seed}, kind {kind}")) as usize] += 1;
        }
    }
    for (kind, [_, wound, refused, failed]) in counts.into_iter().enumerate() {
        assert!(wound as u64 * 3 > rounds, "{kind}: {counts:?}");
        assert!([0, 1, 4, 5].contains(&kind) || refused == 0, "{counts:?}");
        assert!(failed == 0 || [4, 6].contains(&kind) && failed as u64 * 25 <= rounds, "{counts:?}");
    }
}

/// Boxes with corners on whole numbers, some inside out: volume by counting unit cubes.
#[test]
fn boxes_on_a_grid_have_the_volume_of_the_cubes_that_they_wind_around() {
    let mut wound = 0;
    let count = rounds(24);
    for seed in 0..count {
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
        wound += usize::from(done.crossing.is_some());
        let (volume, cubes) = (mesh.moments().map_or(0.0, |m| m.volume()), cubes.iter().filter(|c| **c != 0).count());
        assert!((volume - cubes as f64).abs() < 1e-9, "seed {seed}: {volume}, not {cubes}");
    }
    assert!(5 * wound as u64 > 2 * count, "{wound} of {count}");
}

#[test]
fn what_comes_out_is_closed_to_the_bit_and_what_does_not_cross_is_left_alone() {
    for seed in 0..rounds(14) {
        let mut r = Random(900 + seed);
        let soup = if seed % 2 == 0 { heap(&mut r, seed % 4 == 0) } else { helix(&mut r, 5 + (seed % 7) as u32) };
        let fan = |f: &Vec<u32>| (1..f.len() - 1).map(|i| [f[0], f[i], f[i + 1]]).collect::<Vec<_>>();
        let triangles: Vec<[u32; 3]> = soup.faces.iter().flat_map(fan).collect();
        for (digits, steps) in TRIES {
            let Some(found) = Resolved::of(&soup.points, &triangles, digits) else { continue };
            for reach in steps {
                let (_, faces) = outcome::rounded(&found.facets, &found.pieces, &found.kept.faces, *reach);
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

#[test]
fn parts_either_way_round_are_solid_apart_and_cavities_within() {
    let ball = |r: f64| cuboid(DVec3::splat(-r), DVec3::splat(r));
    let aside = |r: f64| ball(r).mapped(|p| p + DVec3::X * 8.0);
    let column = |n: u32| prism(n, 1.0, 2.0).mapped(|p| p - DVec3::Z);
    let volume = |m: &TriangleMesh| m.moments().map_or(0.0, |m| m.volume());
    let whole = |soup: &Soup| mesh(closed(soup).expect("closed"));
    // What is told: facets turned and left out. A part inside out beside another one, larger or smaller or as large; of few facets and of many; along an edge of it.
    let beside = ball(1.0).mapped(|p| p + DVec3::new(3.0, 3.0, 0.0));
    let few = [
        (ball(2.0).with(&aside(1.0).reversed()), 72.0, [12, 0]),
        (ball(2.0).reversed().with(&aside(1.0)), 72.0, [12, 0]),
        (ball(1.0).with(&aside(1.0).reversed()), 16.0, [12, 0]),
        (ball(2.0).with(&beside.mapped(|p| p.with_z(2.0 * p.z)).reversed()), 80.0, [12, 0]),
        // Within one that runs the same way, twice, then a cavity in it.
        (ball(2.0).with(&ball(1.0)), 64.0, [0, 12]),
        (ball(3.0).with(&ball(2.0)).with(&ball(1.0)), 216.0, [0, 24]),
        (ball(3.0).with(&ball(2.0).reversed()).with(&ball(1.0).reversed()), 160.0, [12, 0]),
    ];
    for (k, (soup, expected, [turned, left_out])) in few.into_iter().enumerate() {
        let (mesh, done) = whole(&soup).unwrap_or_else(|e| panic!("{k}: {e}"));
        assert!((volume(&mesh) - expected).abs() < 1e-9, "{k}: {}", volume(&mesh));
        let told = done.notes("a mesh");
        let counted = format!("({turned} facets were turned, {left_out} left out): taken as what it winds around");
        assert!(told.len() == 1 && told[0].0.ends_with(&counted), "{k}: {told:?}");
    }
    let column = column(300);
    let (mesh, done) = whole(&column.clone().with(&aside(1.0).reversed())).expect("a column and a box");
    assert!((volume(&mesh) - 300.0 * libm::sin(TAU / 300.0) - 8.0).abs() < 1e-9 && done.crossing.is_some());
    // A tip that goes into a box where the middle of no facet is.
    let tip = tetrahedron([[1.5, 0.9, 1.9], [4.0, 2.0, 6.0], [3.0, 4.0, 6.0], [2.0, 2.0, 7.0]].map(DVec3::from));
    let (_, done) = whole(&ball(2.0).with(&tip)).expect("a box and a tetrahedron");
    assert!(done.crossing.is_some_and(|c| c.pairs > 0 && c.cut > 0));
    // As much one way round as the other, and no solid at all.
    assert!(matches!(whole(&ball(1.0).with(&ball(1.0).reversed())), Err(MeshFault::Flat)));
}

/// A wedge of a sweep about an axis, of six digits on one side of it, and with what sines leave of 0 on the other, so that the
/// facets there are in one plane but for roundings: exactly so they are on a grid of 30 digits alone.
#[test]
fn facets_in_one_plane_but_for_roundings_are_so_on_a_coarse_grid() {
    let points = [
        [0.0, 0.0, 17.0833],
        [0.0, 0.0, 27.0833],
        [1.423504, -5.312592, 27.0833],
        [1.319977, -4.926222, 26.5833],
        [0.95763, -3.573926, 25.5833],
        [1.035276, -3.863703, 23.7833],
        [1.061158, -3.960296, 21.7833],
        [1.552914, -5.795555, 20.5833],
        [0.698811, -2.608, 18.9833],
        [0.776457, -2.897778, 17.4833],
        [0.905866, -3.38074, 17.4833],
        [0.0, 0.0, 17.5],
        [0.0, 0.0, 27.5],
        [-2.5e-15, -5.5, 27.5],
        [-6.5e-15, -5.1, 27.0],
        [1.7e-15, -3.7, 26.0],
        [-4.9e-15, -4.0, 24.2],
        [-4.9e-15, -4.1, 22.2],
        [4.5e-16, -6.0, 21.0],
        [-1.2e-15, -2.7, 19.4],
        [5.7e-16, -3.0, 17.9],
        [3.8e-16, -3.5, 17.9],
    ];
    let faces = [
        [0, 12, 1],
        [0, 11, 12],
        [1, 13, 2],
        [1, 12, 13],
        [2, 14, 3],
        [2, 13, 14],
        [3, 15, 4],
        [3, 14, 15],
        [4, 16, 5],
        [4, 15, 16],
        [5, 17, 6],
        [5, 16, 17],
        [6, 18, 7],
        [6, 17, 18],
        [7, 19, 8],
        [7, 18, 19],
        [8, 20, 9],
        [8, 19, 20],
        [9, 21, 10],
        [9, 20, 21],
        [10, 11, 0],
        [10, 21, 11],
        [1, 2, 3],
        [1, 3, 4],
        [0, 1, 4],
        [0, 4, 5],
        [0, 5, 6],
        [6, 7, 8],
        [0, 6, 8],
        [0, 8, 9],
        [0, 9, 10],
        [12, 14, 13],
        [12, 15, 14],
        [11, 15, 12],
        [11, 16, 15],
        [11, 17, 16],
        [17, 19, 18],
        [11, 19, 17],
        [11, 20, 19],
        [11, 21, 20],
    ];
    let soup = Soup { points: points.map(DVec3::from).to_vec(), faces: faces.map(|f: [u32; 3]| f.to_vec()).to_vec() };
    assert_eq!(judged(&soup, &mut Random(3), "a wedge"), Came::Wound);
    let reversed = soup.reversed();
    assert_eq!(judged(&reversed, &mut Random(4), "a wedge inside out"), Came::Wound);
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
