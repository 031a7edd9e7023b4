//! Regions of convex polytopes of four to hundreds of faces: random ones, brought together any way or face to face, against what their own
//! corners and planes say.
//!
//! The judge knows neither boxes nor programs: a told point is on both surfaces, so the bodies are no farther apart than
//! told; along the told normal their corners leave a gap, so they are no nearer. Where both agree the distance is proven. Each
//! corner that is over the other body within the threshold must lie within the hull of what is told.

use contactd::contact::region::{Regions, regions, threshold};
use contactd::contact::{
    Extent, PairQuery, PlacedModel, QueryOptions, Scratch, Status, Strategies, default_resolution, earliest_contact,
};
use contactd::math::Aabb;
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::primitive::{HalfSpace, Polyhedron};
use contactd_proto::{Motion, Pose};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec2, DVec3, dvec3};
use std::f64::consts::TAU;

/// A polytope as the judge knows it, in the world: planes n·x <= d and corners.
struct Body {
    planes: Vec<(DVec3, f64)>,
    corners: Vec<DVec3>,
}

impl Body {
    fn new(own: &Polytope, pose: &Pose) -> Self {
        let plane = |&(n, d): &(DVec3, f64)| {
            let n = pose.rotation * n;
            (n, d + n.dot(pose.position))
        };
        Self {
            planes: own.planes.iter().map(plane).collect(),
            corners: own.corners.iter().map(|v| pose.point(*v)).collect(),
        }
    }

    /// How far a point is beyond its farthest plane.
    fn value(&self, x: DVec3) -> f64 {
        self.planes.iter().map(|(n, d)| n.dot(x) - d).fold(f64::NEG_INFINITY, f64::max)
    }

    /// How far its corners are off the planes that meet there, at most: a billionth.
    fn off(&self) -> f64 {
        let off = self.corners.iter().flat_map(|v| self.planes.iter().map(|(n, d)| (n.dot(*v) - d).abs()));
        off.filter(|d| *d <= 1e-9).fold(0.0, f64::max)
    }

    /// Largest n·x.
    fn reach(&self, n: DVec3) -> f64 {
        match &self.planes[..] {
            [(m, d)] if (*m - n).length() < 1e-12 => *d,
            [_] => f64::INFINITY,
            _ => self.corners.iter().map(|v| n.dot(*v)).fold(f64::NEG_INFINITY, f64::max),
        }
    }

    /// How far a line from x along n runs until it is inside, and the normal there; `None` where it never is.
    fn along(&self, x: DVec3, n: DVec3) -> Option<(f64, DVec3)> {
        let (mut from, mut to) = ((f64::NEG_INFINITY, n), f64::INFINITY);
        for (m, d) in &self.planes {
            let (rise, beyond) = (m.dot(n), m.dot(x) - d);
            if rise.abs() < 1e-14 {
                if beyond > 0.0 {
                    return None;
                }
            } else if rise < 0.0 {
                let met = -beyond / rise;
                from = if met > from.0 { (met, *m) } else { from };
            } else {
                to = to.min(-beyond / rise);
            }
        }
        (from.0 <= to).then_some(from)
    }
}

/// The same in its own frame.
struct Polytope {
    planes: Vec<(DVec3, f64)>,
    corners: Vec<DVec3>,
    /// Its planes along which another body is laid.
    flat: Vec<usize>,
}

impl Polytope {
    fn random(r: &mut Random) -> Self {
        loop {
            let mut planes: Vec<(DVec3, f64)> = Vec::new();
            let mut flat = Vec::new();
            let sides = |n: usize, radius: f64, planes: &mut Vec<(DVec3, f64)>| {
                planes.extend((0..n).map(|i| {
                    let (y, x) = (i as f64 * TAU / n as f64).sin_cos();
                    (dvec3(x, y, 0.0), radius)
                }));
            };
            match r.below(8) {
                // Planes that touch an ellipsoid.
                0 => {
                    let semi = dvec3(r.within(0.3, 1.0), r.within(0.3, 1.0), r.within(0.3, 1.0));
                    for _ in 0..40 + r.below(200) {
                        let n = r.direction();
                        planes.push((n, (n * semi).length()));
                    }
                }
                // Prisms, some with an edge that is broken.
                1 => {
                    let n = 8 + r.below(120);
                    sides(n, 0.7, &mut planes);
                    flat = vec![0, n, n + 1];
                    planes.extend([(DVec3::Z, 0.4), (-DVec3::Z, 0.4)]);
                    if r.chance(0.5) {
                        let broken = 10f64.powf(r.within(-4.0, -1.5));
                        for i in 0..n {
                            let m = (planes[i].0 + DVec3::Z).normalize();
                            planes.push((m, m.dot(planes[i].0 * 0.7 + DVec3::Z * 0.4) - broken));
                        }
                    }
                }
                // A bottom that bows, in planes that touch a paraboloid.
                2 => {
                    let bow = 10f64.powf(r.within(-9.0, -1.5));
                    for _ in 0..30 + r.below(100) {
                        let (rho, phi) = (r.within(0.0, 1.0).sqrt(), r.within(0.0, TAU));
                        let (x, y) = (rho * phi.cos(), rho * phi.sin());
                        let n = dvec3(2.0 * bow * x, 2.0 * bow * y, -1.0).normalize();
                        planes.push((n, n.dot(dvec3(x, y, bow * rho * rho))));
                    }
                    flat = vec![r.below(planes.len())];
                    sides(7, 0.9, &mut planes);
                    planes.push((DVec3::Z, 0.6));
                }
                // A box cut a few times.
                3 => {
                    for k in 0..3 {
                        planes.extend([1.0, -1.0].map(|s| (DVec3::AXES[k] * s, 0.6)));
                    }
                    flat = (0..6).collect();
                    for _ in 0..r.below(12) {
                        planes.push((r.direction(), r.within(0.62, 1.0)));
                    }
                }
                // A few planes, often a tetrahedron.
                4 => planes.extend((0..4 + r.below(4)).map(|_| (r.direction(), r.within(0.1, 0.7)))),
                // Boxes, plates, rods.
                5 | 6 => {
                    for axis in DVec3::AXES {
                        let half = r.within(0.02, 1.0);
                        planes.extend([1.0, -1.0].map(|s| (axis * s, half)));
                    }
                    flat = (0..6).collect();
                }
                _ => return Self { planes: vec![(DVec3::Z, 0.0)], corners: Vec::new(), flat: vec![0] },
            }
            let around = Aabb::around(DVec3::ZERO, DVec3::splat(3.0));
            let Some(found) = Polyhedron::from_planes(&planes, &around) else { continue };
            let flat: Vec<usize> =
                flat.iter().filter_map(|i| found.planes.iter().position(|p| *p == planes[*i])).collect();
            let flat = if flat.is_empty() { vec![r.below(found.planes.len())] } else { flat };
            return Self { planes: found.planes, corners: found.vertices.to_vec(), flat };
        }
    }

    fn recipe(&self) -> Recipe {
        match self.planes.len() {
            1 => Recipe::of(HalfSpace),
            _ => Recipe::of(Polyhedron { vertices: self.corners.clone().into(), planes: self.planes.clone() }),
        }
    }
}

/// How far a point is outside of the convex hull of some others, seen along n: no less than along any of many directions.
fn outside(told: &[DVec3], x: DVec3, n: DVec3) -> f64 {
    let (u, v) = n.any_orthonormal_pair();
    let flat = |x: DVec3| DVec2::new(u.dot(x), v.dot(x));
    let x = flat(x);
    let told: Vec<DVec2> = told.iter().map(|p| flat(*p)).collect();
    let beyond = |way: DVec2| way.dot(x) - told.iter().map(|p| way.dot(*p)).fold(f64::NEG_INFINITY, f64::max);
    let even = (0..64).map(|k| DVec2::from_angle(f64::from(k) * TAU / 64.0));
    let sides = told.iter().flat_map(|p| told.iter().map(move |q| (*q - *p).perp().normalize_or_zero()));
    even.chain(sides).map(beyond).fold(f64::NEG_INFINITY, f64::max)
}

/// What was seen of the answers.
#[derive(Debug, Default)]
struct Seen {
    patches: usize,
    lines: usize,
    points: usize,
    nearest_within: usize,
    covered: usize,
}

fn judge(found: &Regions, [a, b]: [&Body; 2], tau: f64, lean: f64, place: &str, seen: &mut Seen) {
    assert!(found.complete && !found.regions.is_empty(), "{place}: {found:?}");
    assert!(found.cells < 2_000, "{place}: {} cells", found.cells);
    for region in &found.regions {
        let n = region.normal;
        assert!((n.length() - 1.0).abs() < 1e-12, "{place}: {n}");
        for p in &region.points {
            assert!(p.separation <= tau * (1.0 + 1e-6) && p.separation > -1e-9, "{place}: {p:?}");
            let feet = [p.point - n * (0.5 * p.separation), p.point + n * (0.5 * p.separation)];
            let off = [a.value(feet[0]).abs(), b.value(feet[1]).abs()];
            // Nearer than that they touch, at a place that is as sharp.
            let slack = if p.separation < 4e-9 { 1e-8 } else { 1e-9 + 1e-3 * tau };
            assert!(off.iter().all(|f| *f <= slack), "{place}: {off:?} off the surfaces at {p:?} of {region:?}");
        }
        assert!([region.faces_a[0], region.faces_b[0]].iter().all(|f| *f != u32::MAX), "{place}: no face: {region:?}");
        match region.extent {
            Extent::Patch => seen.patches += 1,
            Extent::Line => seen.lines += 1,
            Extent::Point => seen.points += 1,
        }
        let distinct = region
            .points
            .iter()
            .enumerate()
            .all(|(i, p)| region.points[..i].iter().all(|q| (p.point - q.point).length() > 1e-10));
        assert!(distinct, "{place}: a point twice: {region:?}");
    }
    let nearest = found.regions.iter().min_by(|p, q| p.separation().total_cmp(&q.separation())).expect("some");
    let n = nearest.normal;
    let gap = -b.reach(-n) - a.reach(n);
    seen.nearest_within += usize::from(found.regions.len() > 1 && nearest.extent == Extent::Point);
    // Where they touch faces that nearly lie on each other leave the normal so many digits.
    let told = nearest.separation();
    let digits = if told < 4e-9 {
        5e-8
    } else if told < 1e-6 {
        1e-9
    } else {
        1e-10
    };
    let slack = digits + a.off() + b.off();
    assert!((told - gap).abs() <= slack, "{place}: {told:e} told, {gap:e} along {n}: {found:?}");
    // Corners over the other body.
    let patch = found.regions.iter().find(|r| r.extent == Extent::Patch);
    let told: Vec<DVec3> = match patch {
        Some(patch) => patch.points.iter().map(|p| p.point).collect(),
        None => found.regions.iter().flat_map(|r| r.points.iter().map(|p| p.point)).collect(),
    };
    for (body, other, out) in [(a, b, n), (b, a, -n)] {
        let leans = |m: DVec3, n: DVec3| (m - n).length() <= 0.9 * lean;
        let is_along = |v: DVec3| body.planes.iter().any(|(m, d)| leans(*m, out) && (m.dot(v) - d).abs() < 1e-12);
        for v in &body.corners {
            let Some((gap, met)) = other.along(*v, out).filter(|(gap, _)| *gap < tau * (1.0 - 1e-6)) else { continue };
            if patch.is_some() && !(is_along(*v) && leans(met, -out)) || out.dot(*v) < body.reach(out) - tau {
                continue;
            }
            // Of an area of corners those are told that are farthest along eight directions: between two of them others lie in a
            // triangle whose tip has 135 degrees. Along walls that lean a patch is cut at one height.
            let across = told.iter().flat_map(|p| told.iter().map(move |q| p.distance(*q))).fold(0.0, f64::max);
            let cut = if found.regions[0].extent == Extent::Point { 0.5 * across * (TAU / 16.0).tan() } else { 0.0 };
            let part = cut + 1e-6 + 0.01 * tau;
            let off = outside(&told, *v, n);
            assert!(off <= part, "{place}: {v}, {gap:e} from the other body, is {off:e} outside of {found:?}");
            seen.covered += 1;
        }
    }
}

/// Two polytopes, the first one bounded, and the generator that drew them.
fn drawn(seed: u64) -> Option<(Random, Polytope, Polytope)> {
    let mut r = Random::new(seed);
    let (a, b) = (Polytope::random(&mut r), Polytope::random(&mut r));
    (a.planes.len() > 1).then_some((r, a, b))
}

/// Seeds of pairs whose programs lose their way: forty planes that all but meet in one point, and some of which the simplex method goes
/// in a circle.
const LOST: [u64; 2] = [9_104_926, 9_303_011];

#[test]
fn hulls_touch_where_their_corners_and_planes_say() {
    let first = sized("CONTACTD_HULLS_SEED", 0x6875_6c6c_u64);
    let mut seen = Seen::default();
    let count = sized("CONTACTD_HULLS", 80);
    for i in (0..count).chain(LOST.map(|seed| seed.wrapping_sub(first))) {
        let Some((mut r, of_a, of_b)) = drawn(first.wrapping_add(i)) else { continue };
        let turn = r.rotation();
        let pose_b = Pose::new(r.vector(0.3), r.rotation());
        // Face to face, or not quite, or any way.
        let face = |r: &mut Random, p: &Polytope| p.planes[p.flat[r.below(p.flat.len())]].0;
        let (f, g) = (face(&mut r, &of_a), face(&mut r, &of_b));
        let to = pose_b.rotation * g;
        let turn = if r.chance(0.7) {
            let laid = DQuat::from_rotation_arc(f, -to) * DQuat::from_axis_angle(f, r.within(0.0, TAU));
            let tilt = if r.chance(0.4) { 0.0 } else { 10f64.powf(r.within(-10.0, -1.0)) };
            DQuat::from_scaled_axis(r.direction() * tilt) * laid
        } else {
            turn
        };
        let along = if of_b.planes.len() == 1 || r.chance(0.7) { to } else { r.direction() };
        let aside = along.any_orthonormal_vector() * r.within(-0.5, 0.5);
        // B's own middle, or its plane's point.
        let start = pose_b.position + aside + along * 4.0;
        let [a, b] = [&of_a, &of_b].map(|p| Model::new(p.recipe().build()));
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        let at = |position: DVec3, velocity: DVec3| PairQuery {
            a: PlacedModel {
                model: &a,
                placed: placed(Motion { start: Pose::new(position, turn), velocity, spin: DVec3::ZERO }),
            },
            b: PlacedModel { model: &b, placed: placed(Motion::resting(pose_b)) },
            resolution: default_resolution(&a, &b),
            cell_limit: 100_000,
            strategies: Strategies::default(),
            query_options: QueryOptions::DEPTH,
        };
        let o = earliest_contact(&at(start, along * -5.0), &mut Scratch::default());
        if o.status() != Status::Contact {
            continue;
        }
        let met = o.contact().expect("a contact").time;
        let tau = threshold(default_resolution(&a, &b), 10f64.powf(r.within(-6.0, -2.0)));
        let gap = if r.chance(0.2) { 0.0 } else { tau * r.within(0.0, 0.9) };
        let position = start + along * (gap - 5.0 * met);
        let query = at(position, DVec3::ZERO);
        let found = regions(&query, 0.0, tau);
        let bodies = [Body::new(&of_a, &Pose::new(position, turn)), Body::new(&of_b, &pose_b)];
        let size = 2.0 * a.radius.min(b.radius);
        let lean = 4.0 * tau.min(0.01 * size) / size;
        let place = format!("{i}: {} and {} faces, tau {tau:e}", of_a.planes.len(), of_b.planes.len());
        judge(&found, [&bodies[0], &bodies[1]], tau, lean, &place, &mut seen);
    }
    println!("{seen:?}");
    let enough = count / 20;
    let counts = [seen.patches, seen.lines, seen.points, seen.nearest_within];
    assert!(counts.iter().all(|n| *n as u64 >= enough) && seen.covered > 0, "{seen:?}");
}

/// F is convex, so a point below which none lies near is the lowest of all. A thousandth is promised; what the program
/// leaves is less.
#[test]
fn the_deepest_point_of_hulls_has_none_deeper_near_it() {
    let first = sized("CONTACTD_HULLS_SEED", 0x6465_6570_u64);
    let (mut deep, mut cells) = (0, 0);
    let count = sized("CONTACTD_HULLS", 80);
    for i in 0..count {
        let Some((mut r, of_a, of_b)) = drawn(first + i) else { continue };
        let poses = [Pose::new(r.vector(0.8), r.rotation()), Pose::new(r.vector(0.8), r.rotation())];
        let [a, b] = [&of_a, &of_b].map(|p| Model::new(p.recipe().build()));
        let [p, q] = poses.map(|pose| Placed { place: Pose::IDENTITY, motion: Motion::resting(pose) });
        let query = PairQuery {
            a: PlacedModel { model: &a, placed: p },
            b: PlacedModel { model: &b, placed: q },
            resolution: default_resolution(&a, &b),
            cell_limit: 100_000,
            strategies: Strategies::default(),
            query_options: QueryOptions::DEPTH,
        };
        let o = earliest_contact(&query, &mut Scratch::default());
        let Some(found) = o.penetration() else { continue };
        let bodies = [Body::new(&of_a, &poses[0]), Body::new(&of_b, &poses[1])];
        let f = |x: DVec3| bodies.iter().map(|body| body.value(x)).fold(f64::NEG_INFINITY, f64::max);
        let lowest = f(found.point);
        let place = format!("{i}: {} and {} faces, {found:?}", of_a.planes.len(), of_b.planes.len());
        assert!((2.0 * lowest + found.depth).abs() <= 1e-12, "{place}: F {lowest:e}");
        for k in 0..400 {
            let x = found.point + r.direction() * 10f64.powf(-1.0 - f64::from(k % 8));
            assert!(f(x) >= lowest * (1.0 + 1e-5), "{place}: {:e} at {x}", f(x));
        }
        // Along the direction told the bodies overlap by more than a ball of that size does.
        let along = bodies[0].reach(found.direction) + bodies[1].reach(-found.direction);
        assert!(along >= found.depth - 1e-12, "{place}: {along:e} along it");
        deep += 1;
        cells += o.counters.instant_cells;
    }
    println!("{deep} pairs, {cells} cells");
    assert!(deep >= count / 3 && cells <= 20 * deep, "{deep} pairs, {cells} cells");
}
