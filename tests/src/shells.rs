//! Meshes as people have them, made by formulas: turned parts, gears, threads, bent pipes, plates with holes, stones as a scanner
//! sees them, and what a mesher makes of a field. All are closed, of about the size 1, and the same on every machine but for what
//! sines and cosines differ.

use crate::meshes::Mesh;
use glam::{DVec2, DVec3, dvec3};
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// Rings of as many points each, neighbours joined by triangles: closed by fans about two points, or the last with the first.
pub fn tube(rings: &[Vec<DVec3>], ends: Option<[DVec3; 2]>) -> Mesh {
    let (n, m) = (rings.len() as u32, rings[0].len() as u32);
    let mut points = rings.concat();
    let id = |i: u32, j: u32| i % n * m + j % m;
    let mut triangles = Vec::new();
    for (i, j) in (0..n - u32::from(ends.is_some())).flat_map(|i| (0..m).map(move |j| (i, j))) {
        let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    if let Some(ends) = ends {
        points.extend(ends);
        let (first, last) = (n * m, n * m + 1);
        triangles
            .extend((0..m).flat_map(|j| [[first, id(0, j), id(0, j + 1)], [last, id(n - 1, j + 1), id(n - 1, j)]]));
    }
    (points, triangles)
}

fn ring(m: u32, at: impl Fn(f64) -> DVec3) -> Vec<DVec3> {
    (0..m).map(|j| at(TAU * f64::from(j) / f64::from(m))).collect()
}

/// Of a function on the unit interval its values at `n` + 1 places.
fn steps(n: u32) -> impl Iterator<Item = f64> {
    (0..=n).map(move |i| f64::from(i) / f64::from(n))
}

/// A profile (distance from the axis, height) revolved about z in `m` pieces: from axis to axis, or closed beside it.
pub fn lathe(profile: &[DVec2], m: u32, closed: bool) -> Mesh {
    let turned = |p: &DVec2| ring(m, |u| dvec3(p.x * u.cos(), p.x * u.sin(), p.y));
    if closed {
        return tube(&profile.iter().map(turned).collect::<Vec<_>>(), None);
    }
    let [first, .., last] = profile else { panic!("a profile has two ends") };
    let rings: Vec<_> = profile[1..profile.len() - 1].iter().map(turned).collect();
    tube(&rings, Some([first, last].map(|p| DVec3::Z * p.y)))
}

/// An arc about a centre, by `n` steps.
fn arc(center: (f64, f64), radius: f64, (from, to): (f64, f64), n: u32) -> Vec<DVec2> {
    let at = |s: f64| DVec2::from(center) + radius * DVec2::from_angle(from + s * (to - from));
    steps(n).map(at).collect()
}

/// A hub on a plate, the corner between them filled by a part of a torus.
pub fn filleted(m: u32, arcs: u32) -> Mesh {
    let mut profile = vec![DVec2::new(0.25, -0.3), DVec2::new(1.0, -0.3), DVec2::new(1.0, -0.1)];
    profile.extend(arc((0.7, 0.1), 0.2, (-PI / 2.0, -PI), arcs));
    profile.extend([DVec2::new(0.5, 0.5), DVec2::new(0.25, 0.5)]);
    lathe(&profile, m, true)
}

/// A disc with a hub, a bore and rounded rims.
pub fn flange(m: u32, arcs: u32) -> Mesh {
    let mut profile = arc((0.95, -0.05), 0.05, (-PI / 2.0, PI / 2.0), 2 * arcs);
    profile.extend(arc((0.6, 0.15), 0.15, (-PI / 2.0, -PI), arcs));
    profile.extend(arc((0.4, 0.65), 0.05, (0.0, PI / 2.0), arcs));
    profile.extend(arc((0.35, 0.65), 0.05, (PI / 2.0, PI), arcs));
    profile.extend(arc((0.35, -0.05), 0.05, (PI, 1.5 * PI), arcs));
    lathe(&profile, m, true)
}

/// A vessel with thin walls, open above.
pub fn cup(m: u32, n: u32) -> Mesh {
    let outer = |s: f64| DVec2::new(0.35 + 0.4 * s * s, 1.6 * s - 0.8);
    let mut profile = vec![DVec2::new(0.0, -0.8)];
    profile.extend(steps(n).map(outer));
    profile.extend(steps(n).map(|s| outer(1.0 - 0.97 * s) - DVec2::X * 0.03));
    profile.push(DVec2::new(0.0, outer(0.03).y));
    lathe(&profile, m, false)
}

/// A gear of `teeth` teeth, `flank` points each, twisted by some angle over its height, its rims chamfered.
pub fn gear(teeth: u32, flank: u32, layers: u32, twist: f64) -> Mesh {
    let outline = |u: f64| 0.85 + 0.12 * (2.5 * (f64::from(teeth) * u).sin()).tanh();
    let level = |(s, inset): (f64, f64)| {
        let (z, turn) = (0.5 * s - 0.25, twist * s);
        ring(teeth * flank, |u| {
            let r = outline(u) - inset;
            dvec3(r * (u + turn).cos(), r * (u + turn).sin(), z)
        })
    };
    let mut rings = vec![level((0.0, 0.02))];
    rings.extend(steps(layers).map(|s| level((0.04 + 0.92 * s, 0.0))));
    rings.push(level((1.0, 0.02)));
    tube(&rings, Some([DVec3::Z * -0.25, DVec3::Z * 0.25]))
}

/// The height of a thread's ridge, 0 to 1, at an angle and a number of turns along the axis.
fn thread(u: f64, turns: f64) -> f64 {
    let phase = (turns - u / TAU).rem_euclid(1.0);
    (2.0 - 4.0 * (phase - 0.5).abs()).clamp(0.2, 0.8)
}

/// A screw: a head and a threaded shank.
pub fn screw(m: u32, n: u32, turns: f64) -> Mesh {
    let mut rings = Vec::new();
    for (r, z) in [(0.5, 0.9), (0.5, 0.6)] {
        rings.push(ring(m, |u| dvec3(r * u.cos(), r * u.sin(), z)));
    }
    rings.extend(steps(n).map(|s| {
        ring(m, |u| {
            let taper = (8.0 * (1.0 - s)).min(1.0);
            let r = 0.2 + 0.1 * taper * thread(u, turns * s);
            dvec3(r * u.cos(), r * u.sin(), 0.59 - 1.5 * s)
        })
    }));
    tube(&rings, Some([DVec3::Z * 0.9, DVec3::Z * -0.91]))
}

/// A nut: six sides outside, a thread inside.
pub fn nut(m: u32, n: u32, turns: f64) -> Mesh {
    let hexagon = |u: f64| 0.7 / ((u + PI / 6.0).rem_euclid(PI / 3.0) - PI / 6.0).cos();
    let at = |u: f64, r: f64, z: f64| dvec3(r * u.cos(), r * u.sin(), z);
    let mut rings = vec![ring(m, |u| at(u, hexagon(u), -0.3)), ring(m, |u| at(u, hexagon(u), 0.3))];
    rings.extend(steps(n).map(|s| ring(m, |u| at(u, 0.35 - 0.08 * thread(u, turns * s), 0.3 - 0.6 * s))));
    tube(&rings, None)
}

/// A round wire along a curve, of so many pieces along and around: closed in itself, or with two ends.
pub fn wire(along: u32, around: u32, radius: f64, closed: bool, at: impl Fn(f64) -> DVec3) -> Mesh {
    let place = |s: f64| at(s);
    let ends = (!closed).then(|| [place(0.0), place(1.0)]);
    let count = if closed { along } else { along + 1 };
    let h = 1e-5;
    let rings: Vec<Vec<DVec3>> = (0..count)
        .map(|i| {
            let s = f64::from(i) / f64::from(along);
            let forward = (place(s + h) - place(s - h)).normalize();
            // No curve here runs along this direction.
            let side = forward.cross(dvec3(0.13, 0.07, 1.0)).normalize();
            let up = side.cross(forward);
            ring(around, |v| place(s) + radius * (side * v.cos() + up * v.sin()))
        })
        .collect();
    tube(&rings, ends)
}

/// A coil spring.
pub fn spring(along: u32, around: u32) -> Mesh {
    wire(along, around, 0.07, false, |s| {
        let u = 5.0 * TAU * s;
        dvec3(0.6 * u.cos(), 0.6 * u.sin(), 1.4 * s - 0.7)
    })
}

/// A trefoil knot.
pub fn knot(along: u32, around: u32) -> Mesh {
    wire(along, around, 0.12, true, |s| {
        let u = TAU * s;
        0.3 * dvec3(u.sin() + 2.0 * (2.0 * u).sin(), u.cos() - 2.0 * (2.0 * u).cos(), -(3.0 * u).sin())
    })
}

/// The link of a chain: an oval of wire.
pub fn chain_link(along: u32, around: u32) -> Mesh {
    wire(along, around, 0.18, true, |s| {
        let u = TAU * s;
        dvec3(0.5 * u.cos(), 0.8 * u.sin(), 0.0)
    })
}

/// A link of a robot's arm: thick at both joints, thin and bent between them, in single precision as most meshes are.
pub fn arm(along: u32, around: u32) -> Mesh {
    let center = |s: f64| dvec3(0.25 * (PI * s).sin(), 0.0, 1.6 * s - 0.8);
    let radius = |s: f64| {
        let end = (4.0 * (s - 0.5) * (s - 0.5)).powi(2);
        (0.14 + 0.16 * end) * (1.0 - (2.0 * s - 1.0).powi(16)).max(0.0).sqrt().max(0.05)
    };
    let rings: Vec<Vec<DVec3>> =
        steps(along).map(|s| ring(around, |v| center(s) + radius(s) * dvec3(v.cos(), 1.3 * v.sin(), 0.0))).collect();
    let (points, triangles) = tube(&rings, Some([center(0.0) - DVec3::Z * 0.01, center(1.0) + DVec3::Z * 0.01]));
    (points.into_iter().map(|p| p.as_vec3().as_dvec3()).collect(), triangles)
}

/// A pipe's elbow, hollow, open at both ends.
pub fn elbow(along: u32, around: u32) -> Mesh {
    let at = |s: f64, r: f64| {
        let u = 0.5 * PI * s;
        ring(around, |v| {
            let off = 0.9 + r * v.cos();
            dvec3(off * u.cos() - 0.6, off * u.sin() - 0.6, r * v.sin())
        })
    };
    let outer = steps(along).map(|s| at(s, 0.35));
    let inner = steps(along).map(|s| at(1.0 - s, 0.28));
    tube(&outer.chain(inner).collect::<Vec<_>>(), None)
}

/// Waves of several lengths over directions: what a stone has, and what a scanner adds.
fn roughness(d: DVec3) -> f64 {
    let wave = |k: f64, a: DVec3, b: f64| (k * d.dot(a) + b).sin();
    let coarse = wave(3.1, dvec3(0.6, 0.5, -0.6), 0.4) + wave(4.3, dvec3(-0.7, 0.2, 0.7), 1.3);
    let middle = wave(9.7, dvec3(0.1, -0.9, 0.4), 2.1) * wave(11.3, dvec3(0.8, 0.3, 0.5), 0.2);
    let fine = wave(47.0, dvec3(0.4, -0.5, 0.8), 0.9) * wave(53.0, dvec3(-0.6, 0.7, 0.4), 1.7);
    0.09 * coarse + 0.04 * middle + 0.004 * fine
}

/// A stone as a scanner sees it, of 12 `n`² triangles, in single precision: a cube's sides, blown up.
pub fn stone(n: u32) -> Mesh {
    let along = |k: u32| ((2.0 * f64::from(k) / f64::from(n) - 1.0) * PI / 4.0).tan();
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let mut known: HashMap<[u32; 3], u32> = HashMap::new();
    let mut id = |at: [u32; 3]| {
        *known.entry(at).or_insert_with(|| {
            let d = dvec3(along(at[0]), along(at[1]), along(at[2])).normalize();
            points.push((d * dvec3(0.9, 0.75, 0.6) * (1.0 + roughness(d))).as_vec3().as_dvec3());
            points.len() as u32 - 1
        })
    };
    for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, n)]) {
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let mut corner = |i: u32, j: u32| {
                let mut at = [side; 3];
                (at[(axis + 1) % 3], at[(axis + 2) % 3]) = (i, j);
                id(at)
            };
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            triangles.extend(if side == n { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
        }
    }
    (points, triangles)
}

/// A plate of `count` by `count` square fields of side 2 / `count`, each with a round hole of `around` corners (a multiple of 8) whose
/// radius is `share` of half a field.
pub fn perforated(count: u32, around: u32, share: f64, half: f64) -> Mesh {
    let mut points: Vec<DVec3> = Vec::new();
    let mut known: HashMap<[u64; 3], u32> = HashMap::new();
    let mut triangles = Vec::new();
    let side = 1.0 / f64::from(count);
    for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
        let middle = DVec2::new(f64::from(2 * i + 1), f64::from(2 * j + 1)) * side - 1.0;
        // The square's corners are integers in units of its rim's steps, so that neighbours have the same ones to the bit.
        let rim = |k: u32| {
            let (quarter, step) = (around / 4, k % (around / 4));
            let (edge, along) = (k / quarter, |n: u32| f64::from(n) / f64::from(quarter));
            let (a, b) =
                [((1, -1), (1, 1)), ((1, 1), (-1, 1)), ((-1, 1), (-1, -1)), ((-1, -1), (1, -1))][edge as usize];
            let corner = |(x, y): (i32, i32)| {
                DVec2::new(f64::from(2 * i as i32 + 1 + x), f64::from(2 * j as i32 + 1 + y)) * side - 1.0
            };
            // The same from either end.
            if (a.0 + a.1 * 2) < (b.0 + b.1 * 2) {
                corner(a) + (corner(b) - corner(a)) * along(step)
            } else {
                corner(b) + (corner(a) - corner(b)) * along(quarter - step)
            }
        };
        let hole = |k: u32| {
            let u = TAU * f64::from(k) / f64::from(around) - PI / 4.0;
            middle + share * side * DVec2::new(u.cos(), u.sin())
        };
        let mut id = |p: DVec2, z: f64| {
            let p = p.extend(z) + DVec3::ZERO;
            *known.entry(p.to_array().map(f64::to_bits)).or_insert_with(|| {
                points.push(p);
                points.len() as u32 - 1
            })
        };
        for k in 0..around {
            let l = (k + 1) % around;
            let [a, b, c, d] = [hole(k), rim(k), rim(l), hole(l)];
            let mut quad = |corners: [(DVec2, f64); 4]| {
                let [p, q, r, s] = corners.map(|(x, z)| id(x, z));
                triangles.extend([[p, q, r], [p, r, s]]);
            };
            quad([(a, half), (b, half), (c, half), (d, half)]);
            quad([(d, -half), (c, -half), (b, -half), (a, -half)]);
            quad([(a, -half), (a, half), (d, half), (d, -half)]);
            let edge = k / (around / 4);
            if [i == count - 1, j == count - 1, i == 0, j == 0][edge as usize] {
                quad([(b, half), (b, -half), (c, -half), (c, half)]);
            }
        }
    }
    (points, triangles)
}

/// A thin sheet with waves, `n` by `n` squares on either side.
pub fn sheet(n: u32, half: f64) -> Mesh {
    let at = |i: u32, j: u32, z: f64| {
        let (x, y) = (2.0 * f64::from(i) / f64::from(n) - 1.0, 2.0 * f64::from(j) / f64::from(n) - 1.0);
        dvec3(x, y, 0.12 * (3.0 * x).sin() * (2.3 * y).cos() + 0.02 * (17.0 * x + 9.0 * y).sin() + z)
    };
    let all = |z: f64| (0..=n).flat_map(move |i| (0..=n).map(move |j| at(i, j, z)));
    let points: Vec<DVec3> = all(half).chain(all(-half)).collect();
    let (row, layer) = (n + 1, (n + 1) * (n + 1));
    let mut triangles = Vec::new();
    let mut quad = |[a, b, c, d]: [u32; 4]| triangles.extend([[a, b, c], [a, c, d]]);
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let a = i * row + j;
        quad([a, a + row, a + row + 1, a + 1]);
        quad([layer + a, layer + a + 1, layer + a + row + 1, layer + a + row]);
    }
    for k in 0..n {
        let rim = |a: u32, b: u32| [a, b, layer + b, layer + a];
        quad(rim(k, k + 1));
        quad(rim(n * row + k + 1, n * row + k));
        quad(rim((k + 1) * row, k * row));
        quad(rim(k * row + n, (k + 1) * row + n));
    }
    (points, triangles)
}

/// What a mesher makes of a field: tetrahedra of a grid of cells of size `step` over `low..high`, cut where the field along their
/// edges vanishes. Smooth faces are off by step²/(8r), sharp edges are cut off by up to a cell.
pub fn sampled(field: impl Fn(DVec3) -> f64, (low, high): (DVec3, DVec3), step: f64) -> Mesh {
    // Off the round numbers that models are made of, so that no corner of the grid lies on a face.
    let origin = low - step * dvec3(0.513, 0.557, 0.531);
    let cells = ((high - origin) / step).ceil() + 1.0;
    let [nx, ny, nz] = cells.to_array().map(|n| n as usize + 1);
    let index = |i: usize, j: usize, k: usize| (i * ny + j) * nz + k;
    let corner = |id: usize| origin + step * dvec3((id / (ny * nz)) as f64, (id / nz % ny) as f64, (id % nz) as f64);
    let values: Vec<f64> = (0..nx * ny * nz).map(|id| field(corner(id))).collect();
    // The six tetrahedra around a cell's diagonal fit those of its neighbours; every second one is mirrored.
    const PATHS: [[usize; 4]; 6] = [[0, 1, 3, 7], [0, 5, 1, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 6, 4, 7]];
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let mut roots: HashMap<(usize, usize), u32> = HashMap::new();
    for (i, j, k) in (0..nx - 1).flat_map(|i| (0..ny - 1).flat_map(move |j| (0..nz - 1).map(move |k| (i, j, k)))) {
        let id = |c: usize| index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1));
        for path in PATHS {
            let four = path.map(id);
            let within: Vec<usize> = (0..4).filter(|c| values[four[*c]] < 0.0).collect();
            if within.is_empty() || within.len() == 4 {
                continue;
            }
            let mut root = |a: usize, b: usize| {
                let (a, b) = (four[a].min(four[b]), four[a].max(four[b]));
                *roots.entry((a, b)).or_insert_with(|| {
                    points.push(crossing(&field, corner(a), corner(b)));
                    points.len() as u32 - 1
                })
            };
            let cut: Vec<u32> = match within.as_slice() {
                &[a, b] => {
                    let [c, d] = [0, 1, 2, 3].into_iter().filter(|e| *e != a && *e != b).collect::<Vec<_>>()[..] else {
                        unreachable!("four less two")
                    };
                    vec![root(a, c), root(a, d), root(b, d), root(b, c)]
                }
                few => {
                    let alone = if few.len() == 1 { few[0] } else { (0..4).find(|c| !few.contains(c)).unwrap_or(0) };
                    (0..4).filter(|c| *c != alone).map(|c| root(alone, c)).collect()
                }
            };
            // Outwards from what is inside.
            let [p, q, r] = [0, 1, 2].map(|c| points[cut[c] as usize]);
            let outward = (q - p).cross(r - p).dot(p - corner(four[within[0]])) > 0.0;
            for c in 1..cut.len() - 1 {
                triangles.push(if outward { [cut[0], cut[c], cut[c + 1]] } else { [cut[0], cut[c + 1], cut[c]] });
            }
        }
    }
    (points, triangles)
}

/// Where the field vanishes between two points, one inside and one outside, by bisection.
fn crossing(field: impl Fn(DVec3) -> f64, a: DVec3, b: DVec3) -> DVec3 {
    let (mut inside, mut outside) = if field(a) < 0.0 { (a, b) } else { (b, a) };
    for _ in 0..50 {
        let middle = 0.5 * (inside + outside);
        if field(middle) < 0.0 {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}
