//! Meshes against each other and against convex primitives, judged by all pairs of triangles: at an instant, and at times of a step.
//!
//! The judge has its own triangles, winding numbers and poses, and works about the first body. What is told must hold its distance
//! between its bounds, these no farther apart than was asked, with points of both bodies that far from each other.
//! `CONTACTD_MESH_DISTANCES=2000 cargo test --release -p contactd-tests --test distances meshes:: -- --nocapture` sets the number of
//! pairs at an instant (60 by default; a fifth as many over a step), and prints cells and times.

use contactd::contact::PlacedModel;
use contactd::contact::distance::{DEFAULT_LIMIT, Distance, DistanceQuery, at_instant, over_step};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::Shape;
use contactd::solid::primitive::{Capsule, Cuboid, Cylinder, HalfSpace, Polyhedron, Sphere};
use contactd_proto::{Motion, Pose};
use contactd_tests::meshes::{self, Mesh};
use contactd_tests::models::simple;
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3, dvec3};

/// How far apart bounds may be, in sizes of the smaller body.
const TOLERANCE: f64 = 1e-8;

/// Distance of a point from a segment.
fn of_segment(x: DVec3, [p, q]: [DVec3; 2]) -> f64 {
    let along = q - p;
    let t = ((x - p).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    x.distance(p + along * if t.is_nan() { 0.0 } else { t })
}

fn of_triangle(x: DVec3, t: &[DVec3; 3]) -> f64 {
    let n = (t[1] - t[0]).cross(t[2] - t[0]);
    let sides = [0, 1, 2].map(|k| (t[(k + 1) % 3] - t[k]).cross(x - t[k]).dot(n));
    if n != DVec3::ZERO && sides.iter().all(|s| *s >= 0.0) {
        return ((x - t[0]).dot(n) / n.length()).abs();
    }
    (0..3).map(|k| of_segment(x, [t[k], t[(k + 1) % 3]])).fold(f64::INFINITY, f64::min)
}

/// Distance of two segments: at an end of one, or where both are met squarely.
fn of_segments(a: [DVec3; 2], b: [DVec3; 2]) -> f64 {
    let ends = of_segment(a[0], b).min(of_segment(a[1], b)).min(of_segment(b[0], a)).min(of_segment(b[1], a));
    let (u, v, w) = (a[1] - a[0], b[1] - b[0], b[0] - a[0]);
    let n = u.cross(v);
    let square = n.length_squared();
    let (s, t) = (w.cross(v).dot(n) / square, w.cross(u).dot(n) / square);
    if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
        return ends.min((w.dot(n) / square.sqrt()).abs());
    }
    ends
}

fn volume(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    (b - a).cross(c - a).dot(d - a)
}

/// True where a segment runs through a triangle.
fn pierces([p, q]: [DVec3; 2], [a, b, c]: &[DVec3; 3]) -> bool {
    let (above, below) = (volume(*a, *b, *c, p), volume(*a, *b, *c, q));
    let around = [volume(p, q, *a, *b), volume(p, q, *b, *c), volume(p, q, *c, *a)];
    above * below < 0.0 && (around.iter().all(|v| *v > 0.0) || around.iter().all(|v| *v < 0.0))
}

fn of_triangles(p: &[DVec3; 3], q: &[DVec3; 3]) -> f64 {
    let side = |t: &[DVec3; 3], k: usize| [t[k], t[(k + 1) % 3]];
    if (0..3).any(|k| pierces(side(p, k), q) || pierces(side(q, k), p)) {
        return 0.0;
    }
    let corners = (0..3).map(|k| of_triangle(p[k], q).min(of_triangle(q[k], p)));
    let sides = (0..9).map(|k| of_segments(side(p, k / 3), side(q, k % 3)));
    corners.chain(sides).fold(f64::INFINITY, f64::min)
}

/// A body as the judge knows it, in its own frame.
enum Own {
    Mesh(Mesh),
    /// A mesh that is a convex primitive.
    Flat(Mesh),
    Ball(f64),
    /// Half the length of a segment along z, and the radius.
    Capsule(f64, f64),
    Cylinder(f64, f64),
    Below,
}

struct Body {
    own: Own,
    model: Model,
    size: f64,
}

/// Triangles where they stand, with balls around them.
struct Stood(Vec<([DVec3; 3], DVec3, f64)>);

impl Stood {
    fn new((points, triangles): &Mesh, at: &Pose) -> Self {
        let points: Vec<DVec3> = points.iter().map(|p| at.point(*p)).collect();
        let each = triangles.iter().map(|t| {
            let t = t.map(|i| points[i as usize]);
            let middle = (t[0] + t[1] + t[2]) / 3.0;
            (t, middle, t.iter().map(|p| p.distance(middle)).fold(0.0, f64::max))
        });
        Self(each.collect())
    }

    fn distance(&self, other: &Stood) -> f64 {
        let mut best = f64::INFINITY;
        for (p, m, r) in &self.0 {
            for (q, n, s) in &other.0 {
                if m.distance(*n) - r - s < best {
                    best = best.min(of_triangles(p, q));
                }
            }
        }
        best
    }
}

impl Own {
    fn mesh(&self) -> Option<&Mesh> {
        if let Own::Mesh(m) | Own::Flat(m) = self { Some(m) } else { None }
    }

    /// A point inside, or at the surface, of a bounded body.
    fn some(&self) -> Option<DVec3> {
        match self {
            Own::Mesh(m) | Own::Flat(m) => Some(m.0[0]),
            Own::Ball(_) | Own::Capsule(..) | Own::Cylinder(..) => Some(DVec3::ZERO),
            Own::Below => None,
        }
    }

    /// The point of it that is nearest to x, of what is no mesh.
    fn nearest(&self, x: DVec3) -> DVec3 {
        match self {
            Own::Mesh(_) | Own::Flat(_) => unreachable!("a mesh"),
            Own::Ball(r) => x.clamp_length_max(*r),
            Own::Capsule(half, r) => {
                let on = DVec3::Z * x.z.clamp(-half, *half);
                on + (x - on).clamp_length_max(*r)
            }
            Own::Cylinder(half, r) => x.truncate().clamp_length_max(*r).extend(x.z.clamp(-half, *half)),
            Own::Below => dvec3(x.x, x.y, x.z.min(0.0)),
        }
    }

    /// How far a point is outside.
    fn beyond(&self, x: DVec3) -> f64 {
        match self.mesh() {
            Some(m) if meshes::winding(m, x).abs() > 0.5 => 0.0,
            Some(m) => meshes::distance(m, x),
            None => self.nearest(x).distance(x),
        }
    }
}

/// The distance of two bodies, the first of which is a mesh; of what is no mesh no less than that.
fn distance([a, b]: [&Own; 2], at: &[Pose; 2]) -> f64 {
    let Own::Mesh(mesh) = a else { unreachable!("a mesh") };
    let own = at[1].inverse();
    let is_within = |own: &Own, x: DVec3| match own.mesh() {
        Some(m) => meshes::winding(m, x).abs() > 0.5,
        None => own.nearest(x) == x,
    };
    if is_within(b, own.point(at[0].point(mesh.0[0]))) {
        return 0.0;
    }
    if b.some().is_some_and(|y| is_within(a, at[0].inverse().point(at[1].point(y)))) {
        return 0.0;
    }
    // In b's frame.
    let stood = Stood::new(mesh, &Pose::new(own.point(at[0].position), own.rotation * at[0].rotation));
    let each = || stood.0.iter().map(|t| &t.0);
    match b {
        Own::Mesh(m) | Own::Flat(m) => stood.distance(&Stood::new(m, &Pose::IDENTITY)),
        Own::Ball(r) => each().map(|t| of_triangle(DVec3::ZERO, t) - r).fold(f64::INFINITY, f64::min).max(0.0),
        Own::Capsule(half, r) => {
            let core = [DVec3::Z * -half, DVec3::Z * *half, DVec3::Z * *half];
            each().map(|t| of_triangles(t, &core) - r).fold(f64::INFINITY, f64::min).max(0.0)
        }
        Own::Below => each().flatten().map(|x| x.z).fold(f64::INFINITY, f64::min).max(0.0),
        // Points of both moved nearer by turns.
        Own::Cylinder(..) => {
            let from = |t: &[DVec3; 3]| {
                let mut x = (t[0] + t[1] + t[2]) / 3.0;
                for _ in 0..60 {
                    let y = b.nearest(x);
                    // The nearest point of the triangle, by the nearest of its plane and of its sides.
                    let n = (t[1] - t[0]).cross(t[2] - t[0]).normalize();
                    let flat = y - n * n.dot(y - t[0]);
                    let within = (0..3).all(|k| (t[(k + 1) % 3] - t[k]).cross(flat - t[k]).dot(n) >= 0.0);
                    let sides = (0..3).map(|k| {
                        let (p, q) = (t[k], t[(k + 1) % 3]);
                        p + (q - p) * ((y - p).dot(q - p) / (q - p).length_squared()).clamp(0.0, 1.0)
                    });
                    let beside = sides.min_by(|p, q| p.distance(y).total_cmp(&q.distance(y)));
                    x = if within { flat } else { beside.expect("three") };
                }
                x.distance(b.nearest(x))
            };
            each().map(from).fold(f64::INFINITY, f64::min)
        }
    }
}

fn mesh(r: &mut Random, scale: f64) -> Mesh {
    let (points, triangles) = match r.below(5) {
        0 => meshes::prism(&(0..20 + r.below(60)).map(|_| r.within(0.5, 1.0)).collect::<Vec<_>>(), r.within(0.2, 0.8)),
        1 => meshes::torus((0.7, r.within(0.1, 0.3)), 8 + r.below(10) as u32, 6 + r.below(6) as u32),
        2 => meshes::bumps(r, (8, 14), (0.9, 1.0)),
        3 => contactd_tests::shells::gear(6 + r.below(6) as u32, 5, 1, r.within(0.0, 0.5)),
        _ => meshes::bumps(r, (6, 9), (0.5, 1.0)),
    };
    (points.into_iter().map(|p| p * scale).collect(), triangles)
}

impl Body {
    fn mesh(r: &mut Random, scale: f64) -> Self {
        let mesh = mesh(r, scale);
        let solid = if r.chance(0.5) { meshes::divided(&mesh) } else { meshes::solid(&mesh) };
        Self { own: Own::Mesh(mesh), model: simple(solid), size: scale }
    }

    fn convex(r: &mut Random, scale: f64) -> Self {
        let mut length = || scale * r.within(0.2, 1.0);
        let (p, q, s) = (length(), length(), length());
        let (own, shape): (Own, Shape) = match r.below(6) {
            0 => {
                let corners = (0..8).map(|i| dvec3(p, q, s) * dvec3(signed(i), signed(i / 2), signed(i / 4)));
                let hull = Polyhedron::hull(corners.collect()).expect("a box");
                (Own::Flat(faces(&hull)), Cuboid { half: dvec3(p, q, s) }.into())
            }
            1 => (Own::Ball(p), Sphere { radius: p }.into()),
            2 => (Own::Capsule(p, q), Capsule { half: p, radius: q }.into()),
            3 => (Own::Cylinder(p, q), Cylinder { radius: q, half_height: p }.into()),
            4 => {
                let hull = Polyhedron::hull((0..14).map(|_| r.direction() * dvec3(p, q, s)).collect()).expect("a hull");
                (Own::Flat(faces(&hull)), hull.into())
            }
            _ => (Own::Below, HalfSpace.into()),
        };
        Self { own, model: simple(shape), size: scale }
    }
}

fn signed(i: usize) -> f64 {
    if i.is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// The surface of a convex polyhedron: of each plane the corners on it, as a fan.
fn faces(hull: &Polyhedron) -> Mesh {
    let mut triangles = Vec::new();
    for (n, d) in &hull.planes {
        let mut on: Vec<u32> = (0..hull.vertices.len() as u32)
            .filter(|i| (n.dot(hull.vertices[*i as usize]) - d).abs() < 1e-9 * d.abs().max(1e-9))
            .collect();
        let middle = on.iter().map(|i| hull.vertices[*i as usize]).sum::<DVec3>() / on.len() as f64;
        let (u, v) = n.any_orthonormal_pair();
        let angle = |i: &u32| {
            let x = hull.vertices[*i as usize] - middle;
            x.dot(v).atan2(x.dot(u))
        };
        on.sort_by(|i, j| angle(i).total_cmp(&angle(j)));
        let turns_left = u.cross(v).dot(*n) > 0.0;
        triangles.extend(
            (1..on.len() - 1).map(|k| if turns_left { [on[0], on[k], on[k + 1]] } else { [on[0], on[k + 1], on[k]] }),
        );
    }
    (hull.vertices.to_vec(), triangles)
}

struct Pair {
    bodies: [Body; 2],
    motions: [Motion; 2],
    tolerance: f64,
}

/// The corner of a mesh that is farthest along a direction.
fn farthest(own: &Own, n: DVec3) -> Option<DVec3> {
    own.mesh()?.0.iter().copied().max_by(|p, q| p.dot(n).total_cmp(&q.dot(n)))
}

impl Pair {
    fn new(r: &mut Random, convex: bool) -> Self {
        let mut scale = || [1.0, 1.0, 1.0, 1e-3, 1e3][r.below(5)];
        let scales = [scale(), scale()];
        let a = Body::mesh(r, scales[0]);
        let b = if convex { Body::convex(r, scales[1]) } else { Body::mesh(r, scales[1]) };
        let (size, small) = (scales[0].max(scales[1]), scales[0].min(scales[1]));
        let (turn_a, mut turn_b) = (r.rotation(), r.rotation());
        let u = r.direction();
        let gap = match r.below(6) {
            0 => 0.0,
            1 => -small * r.within(0.0, 0.5),
            2 => small * 10f64.powf(r.within(-7.0, -1.0)),
            _ => size * r.within(0.0, 2.0),
        };
        let at_a = Pose::new(DVec3::ZERO, turn_a);
        let corner = at_a.point(farthest(&a.own, turn_a.inverse() * u).expect("a mesh"));
        let place = match r.below(5) {
            // Within the box of the first one.
            0 => r.vector(scales[0] * 0.7),
            // With their axes along each other, one above the other.
            1 => {
                turn_b = turn_a * DQuat::from_rotation_z(r.within(0.0, 6.0));
                turn_a * (DVec3::Z * (scales[0] + scales[1]) * r.within(0.0, 1.0))
            }
            // Corner to corner.
            2 if b.own.mesh().is_some() => {
                let other = farthest(&b.own, turn_b.inverse() * -u).expect("a mesh");
                corner + u * gap - turn_b * other
            }
            // As near along the line of the nearest points, from a farther place.
            _ => {
                let far = u * (2.0 * scales[0] + 2.0 * scales[1]);
                let d = distance([&a.own, &b.own], &[at_a, Pose::new(far, turn_b)]);
                far - u * (d - gap)
            }
        };
        let away = if r.chance(0.2) { r.vector(1e5 * size) } else { DVec3::ZERO };
        let speed = size * 10f64.powf(r.within(-2.0, 0.3));
        let mut motion = |place, turn| Motion {
            start: Pose::new(away + place, turn),
            velocity: r.vector(speed),
            spin: if r.chance(0.3) { DVec3::ZERO } else { r.vector(2.0) },
        };
        let motions = [motion(DVec3::ZERO, turn_a), motion(place, turn_b)];
        let tolerance = TOLERANCE * a.size.min(b.size);
        Self { bodies: [a, b], motions, tolerance }
    }

    fn ask(&self, motions: [Motion; 2], limit: u64, of: fn(&DistanceQuery) -> Distance) -> Distance {
        let placed = |k: usize| PlacedModel {
            model: &self.bodies[k].model,
            placed: Placed { place: Pose::IDENTITY, motion: motions[k] },
        };
        of(&DistanceQuery { a: placed(0), b: placed(1), tolerance: self.tolerance, limit })
    }

    fn poses(&self, t: f64) -> [Pose; 2] {
        self.motions.map(|m| m.at(t))
    }

    /// The distance at a time, about the first body.
    fn truth(&self, t: f64) -> f64 {
        let poses = self.poses(t);
        let about = |p: Pose| Pose::new(p.position - poses[0].position, p.rotation);
        distance([&self.bodies[0].own, &self.bodies[1].own], &poses.map(about))
    }

    /// What is wrong with what is told of a time, or of a step at the time of its least distance.
    fn judged(&self, d: &Distance, t: f64, truth: f64) -> Option<String> {
        let (poses, points) = (self.poses(t), [d.a.point, d.b.point]);
        let off = [0, 1].map(|k| self.bodies[k].own.beyond(poses[k].inverse().point(points[k])));
        let reach = poses.iter().map(|p| p.position.length()).fold(0.0, f64::max) + self.bodies[0].size;
        let blur = 4.0 * d.rounding + 8.0 * f64::EPSILON * reach;
        let apart = points[0].distance(points[1]);
        let wrong = |what: &str| Some(format!("{what}: truth {truth:e}, apart {apart:e}, off {off:?}, {d:?}"));
        match () {
            () if d.lower > truth + blur => wrong("points are nearer"),
            () if d.upper < truth - blur && !matches!(self.bodies[1].own, Own::Cylinder(..)) => {
                wrong("no points are as near")
            }
            () if !d.is_settled => wrong("not settled"),
            () if d.upper - d.lower > self.tolerance.max(8.0 * d.rounding) => wrong("bounds too far apart"),
            () if off[0].max(off[1]) > blur => wrong("a point outside"),
            () if apart > d.upper + blur => wrong("points too far apart"),
            () => None,
        }
    }
}

fn at_start(query: &DistanceQuery) -> Distance {
    at_instant(query, 0.0)
}

#[test]
fn distances_of_meshes_are_those_of_their_triangles() {
    let count = sized("CONTACTD_MESH_DISTANCES", 60u64);
    let (mut failures, mut cells, mut shared, mut most) = (Vec::new(), 0, 0, 0);
    let mut spent = std::time::Duration::ZERO;
    for n in 0..count {
        let mut r = Random::new(0x3e5 << 32 | n);
        let pair = Pair::new(&mut r, n % 2 == 1);
        let t = r.within(0.0, 1.0);
        let resting = pair.poses(t).map(Motion::resting);
        pair.ask(resting, 1, at_start);
        let clock = std::time::Instant::now();
        let d = pair.ask(resting, DEFAULT_LIMIT, at_start);
        spent += clock.elapsed();
        let truth = pair.truth(t);
        (cells, most) = (cells + d.cells, most.max(d.cells));
        shared += u32::from(d.upper == 0.0);
        failures.extend(pair.judged(&d, t, truth).map(|e| format!("{n}: {e}")));
        // What is left at a limit holds as well.
        let some = pair.ask(resting, 40, at_start);
        if some.lower > truth + 4.0 * some.rounding || some.upper < d.lower {
            failures.push(format!("{n}: at a limit {some:?}, truth {truth:e}"));
        }
    }
    println!(
        "{count} pairs, {shared} in each other, {} cells, {most} at most, {:?}",
        cells / count,
        spent / count as u32
    );
    assert!(failures.is_empty(), "{} wrong: {:#?}", failures.len(), &failures[..failures.len().min(9)]);
    assert!(8 * u64::from(shared) > count && 2 * u64::from(shared) < count);
}

#[test]
fn least_distances_of_moving_meshes_hold_at_all_times() {
    let count = sized("CONTACTD_MESH_DISTANCES", 60u64).div_ceil(5);
    let (mut failures, mut cells, mut inside, mut most) = (Vec::new(), 0, 0, 0);
    let mut spent = std::time::Duration::ZERO;
    for n in 0..count {
        let mut r = Random::new(0x3e6 << 32 | n);
        let pair = Pair::new(&mut r, n % 2 == 1);
        let clock = std::time::Instant::now();
        let d = pair.ask(pair.motions, DEFAULT_LIMIT, over_step);
        spent += clock.elapsed();
        let some = [5, 100].map(|limit| pair.ask(pair.motions, limit, over_step));
        (cells, most) = (cells + d.cells, most.max(d.cells));
        inside += u32::from(0.0 < d.time && d.time < 1.0 && d.lower > 0.0);
        // The distance at its time is what is told, and at no other time are they nearer.
        failures.extend(pair.judged(&d, d.time, pair.truth(d.time)).map(|e| format!("{n}: at its time {e}")));
        for k in 0..16 {
            let beside = d.time + r.within(-1.0, 1.0) * 10f64.powf(r.within(-5.0, -1.0));
            let t = if k % 2 == 0 { r.within(0.0, 1.0) } else { beside.clamp(0.0, 1.0) };
            let truth = pair.truth(t);
            for told in some.iter().chain([&d]).filter(|told| truth < told.lower - 4.0 * told.rounding) {
                failures.push(format!("{n}: {truth:e} apart at {t}, {told:?}"));
            }
        }
    }
    println!(
        "{count} pairs, {inside} nearest on the way, {} cells, {most} at most, {:?}",
        cells / count,
        spent / count as u32
    );
    assert!(failures.is_empty(), "{} wrong: {:#?}", failures.len(), &failures[..failures.len().min(9)]);
    assert!(8 * u64::from(inside) > count);
}

/// Large meshes, as people have them.
fn large(r: &mut Random, kind: usize, finer: u32) -> Mesh {
    match kind {
        0 => meshes::bumps(r, (10 * finer, 20 * finer), (0.98, 1.0)),
        1 => contactd_tests::shells::gear(12, 4 * finer, 2 * finer, 0.4),
        2 => meshes::torus((0.7, 0.3), 20 * finer, 10 * finer),
        _ => contactd_tests::shells::screw(10 * finer, 20 * finer, 6.0),
    }
}

#[test]
fn large_meshes_cost_what_is_near() {
    let count = sized("CONTACTD_MESH_DISTANCES", 60u64).div_ceil(20);
    let (mut failures, mut most) = (Vec::new(), [0, 0]);
    for n in 0..count {
        let mut r = Random::new(0x3e7 << 32 | n);
        let finer = 2 + r.below(if count > 3 { 5 } else { 2 }) as u32;
        let of = |r: &mut Random, kind: usize| {
            let mesh = large(r, kind, finer);
            Body { model: simple(meshes::solid(&mesh)), own: Own::Mesh(mesh), size: 1.0 }
        };
        let a = of(&mut r, n as usize % 4);
        let b = if n % 3 == 2 { Body::convex(&mut r, 1.0) } else { of(&mut r, n as usize / 4 % 4) };
        let count = [&a, &b].map(|b| b.own.mesh().map_or(0, |m| m.1.len()));
        let (turns, u) = ([r.rotation(), r.rotation()], r.direction());
        let poses = |way| [Pose::new(DVec3::ZERO, turns[0]), Pose::new(u * way, turns[1])];
        let far = distance([&a.own, &b.own], &poses(4.0));
        for gap in [1.0, 0.1, 1e-3] {
            let starts = poses(4.0 - far + gap);
            let motions = [0, 1].map(|k| Motion { start: starts[k], velocity: r.vector(0.5), spin: r.vector(1.0) });
            let truth = distance([&a.own, &b.own], &starts);
            let placed = |motion| Placed { place: Pose::IDENTITY, motion };
            let ask = |motions: [Motion; 2], of: fn(&DistanceQuery) -> Distance| {
                let [pa, pb] = [(&a, motions[0]), (&b, motions[1])]
                    .map(|(b, m)| PlacedModel { model: &b.model, placed: placed(m) });
                let clock = std::time::Instant::now();
                let d = of(&DistanceQuery { a: pa, b: pb, tolerance: 1e-6, limit: DEFAULT_LIMIT });
                (d, clock.elapsed())
            };
            ask(starts.map(Motion::resting), at_start);
            let told = [ask(starts.map(Motion::resting), at_start), ask(motions, over_step)];
            for (k, (d, spent)) in told.iter().enumerate() {
                println!(
                    "{n}: {count:?} triangles, {gap}, {}: {:e} to {:e}, {} cells, {}, {spent:?}",
                    ["instant", "step"][k],
                    d.lower,
                    d.upper,
                    d.cells,
                    d.is_settled
                );
                most[k] = most[k].max(d.cells);
                if !d.is_settled || d.upper - d.lower > 1e-6 {
                    failures.push(format!("{n}, {gap}: not settled {d:?}"));
                }
            }
            let d = told[0].0;
            let is_told = !matches!(b.own, Own::Cylinder(..));
            if d.lower > truth + d.rounding || is_told && d.upper < truth - d.rounding {
                failures.push(format!("{n}, {gap}: truth {truth:e}, {d:?}"));
            }
        }
    }
    println!("at most {most:?} cells");
    assert!(most[0] < 20_000 && most[1] < 60_000, "{most:?} cells");
    assert!(failures.is_empty(), "{} wrong: {:#?}", failures.len(), &failures[..failures.len().min(9)]);
}

/// A mesh as an operand: what is told holds the distance between its bounds, and has points.
#[test]
fn trees_of_large_meshes_have_points() {
    let mut failures = Vec::new();
    for n in 0..6u64 {
        let mut r = Random::new(0x3e8 << 32 | n);
        let mesh = large(&mut r, n as usize % 3, 2);
        let leaf = Recipe::of(meshes::solid(&mesh));
        let tree = leaf.minus(Recipe::cylinder(0.3, 2.0).moved(&Pose::new(r.vector(0.5), r.rotation())));
        let model = Model::new(tree.build());
        let body = Body::convex(&mut r, 0.5);
        let at = Pose::new(r.direction() * r.within(2.5, 4.0), r.rotation());
        // Farther than without the hole, nearer than its middle is from points of it.
        let least = distance([&Own::Mesh(mesh), &body.own], &[Pose::IDENTITY, at]);
        let placed = |model, motion| PlacedModel { model, placed: Placed { place: Pose::IDENTITY, motion } };
        let d = at_start(&DistanceQuery {
            a: placed(&model, Motion::resting(Pose::IDENTITY)),
            b: placed(&body.model, Motion::resting(at)),
            tolerance: 1e-3,
            limit: 5_000,
        });
        println!("{n}: {least} at least, {:e} to {:e}, {} cells, {}", d.lower, d.upper, d.cells, d.is_settled);
        let off = [model.value(d.a.point), body.own.beyond(at.inverse().point(d.b.point))];
        let apart = d.a.point.distance(d.b.point);
        if !(d.upper >= least - 1e-9 && d.upper <= least + 1.0 && apart <= d.upper + 1e-9) || off[0].max(off[1]) > 1e-9
        {
            failures.push(format!("{n}: {off:?}, {d:?}"));
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}
