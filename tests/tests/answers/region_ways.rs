//! What is told without boxes of convex bodies, against what boxes tell.

use contactd::contact::distance::{DEFAULT_LIMIT, DistanceQuery, at_instant};
use contactd::contact::region::{REACH, Region, RegionPoint, Regions, Way, in_one_way, regions};
use contactd::contact::{
    ContactKind, Extent, PairQuery, PlacedModel, QueryOptions, Scratch, Strategies, Verdict, default_resolution,
    earliest_contact,
};
use contactd::math::random::Random;
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::Shape;
use contactd::solid::primitive::{Capsule, Cone, Cuboid, Cylinder, Ellipsoid, HalfSpace, Polyhedron, Sphere};
use contactd_proto::contact_record::NO_FACE;
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use contactd_tests::models::simple;
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3, dvec3};
use std::f64::consts::FRAC_PI_2;

/// Diameters of the smaller body within which two points are one.
const SAME_POINT: f64 = 1e-6;

/// Two bodies at the start of a question.
struct Bodies<'q> {
    query: &'q PairQuery<'q>,
    /// Surfaces nearer to each other than this touch.
    tau: f64,
    /// Diameter of the smaller body.
    size: f64,
}

impl<'q> Bodies<'q> {
    fn new(query: &'q PairQuery<'q>, tau: f64) -> Self {
        let size = 2.0 * query.a.model.radius.min(query.b.model.radius);
        Self { query, tau: tau.min(REACH * size), size }
    }

    /// What one way tells of them.
    fn told(&self, way: Way) -> Option<Regions> {
        in_one_way(self.query, 0.0, self.tau, way)
    }

    fn in_boxes(&self) -> Regions {
        self.told(Way::Boxes).expect("boxes answer for any bodies")
    }
}

fn shape(r: &mut Random, kind: usize) -> Shape {
    let mut length = || r.within(0.15, 0.9);
    match kind {
        0 => Sphere { radius: length() }.into(),
        1 => Ellipsoid { semi: dvec3(length(), length(), length()) }.into(),
        2 => Cylinder { radius: length(), half_height: length() }.into(),
        3 => Cone { bottom: length(), top: length(), half_height: length() }.into(),
        4 => Cone { bottom: length(), top: 0.0, half_height: length() }.into(),
        5 => Capsule { half: length(), radius: length() }.into(),
        6 => Cuboid { half: dvec3(length(), length(), length()) }.into(),
        7 => Polyhedron::platonic([4, 6, 8][(length() * 3.0) as usize], length()).expect("a platonic solid").into(),
        9 => {
            let (bottom, top, half) = (length(), length(), length());
            let ring = |w: f64, z: f64| [dvec3(w, w, z), dvec3(-w, w, z), dvec3(-w, -w, z), dvec3(w, -w, z)];
            let corners = [ring(bottom, -half), ring(top, half)].concat();
            Polyhedron::hull(corners).expect("a frustum").into()
        }
        _ => HalfSpace.into(),
    }
}

/// What was compared.
#[derive(Debug, Default)]
struct Seen {
    /// Boxes hold none.
    none: usize,
    points: usize,
    lines: usize,
    /// Boxes hold more than that.
    beside: usize,
    /// Boxes tell a place that is farther apart.
    missed: usize,
    /// Convex pairs that boxes are left with.
    left: usize,
}

/// Two bodies that were brought together along a direction until a gap is left, in any attitude, along each other or nearly so;
/// `largest`: the power of ten that the threshold is below. The judge is told the gap: their distance is no larger.
fn near(r: &mut Random, kinds: [usize; 2], largest: f64, mut judge: impl FnMut(&Bodies, f64)) {
    let models = kinds.map(|kind| simple(shape(r, kind)));
    let aligned = |r: &mut Random| {
        let quarter = |r: &mut Random| (r.unit() * 4.0).floor() * FRAC_PI_2;
        DQuat::from_rotation_x(quarter(r)) * DQuat::from_rotation_z(quarter(r))
    };
    let turns = [0, 1].map(|_| match (r.unit() * 3.0) as usize {
        0 => aligned(r),
        1 => {
            let lean = 10f64.powf(r.within(-9.0, -1.0));
            quat_of_rotation_vector(r.vector(lean)) * aligned(r)
        }
        _ => quat_of_rotation_vector(r.vector(3.0)),
    });
    let along = match (r.unit() * 3.0) as usize {
        _ if kinds[1] == 8 => turns[1] * DVec3::Z,
        0 => DVec3::Z,
        1 => turns[1] * DVec3::AXES[(r.unit() * 3.0) as usize],
        _ => r.vector(1.0).normalize_or(DVec3::Z),
    };
    let start = along * 5.0 + r.vector(0.4) * f64::from(u8::from(r.unit() < 0.7));
    let outcome = earliest_contact(&query(&models, turns, start, along * -6.0), &mut Scratch::default());
    let Verdict::Contact(contact) = &outcome.verdict else { return };
    let tau = 10f64.powf(r.within(-6.0, largest));
    let gap = if r.unit() < 0.2 { 0.0 } else { tau * r.within(0.0, 1.2) };
    let query = query(&models, turns, start + along * (gap - 6.0 * contact.time), DVec3::ZERO);
    judge(&Bodies::new(&query, tau), gap);
}

/// A question about the first model at a place, moving, and the second at the origin, at rest; both turned.
fn query<'m>(models: &'m [Model; 2], turns: [DQuat; 2], start: DVec3, velocity: DVec3) -> PairQuery<'m> {
    let placed = |motion| Placed { place: Pose::IDENTITY, motion };
    let [a, b] = models;
    PairQuery {
        a: PlacedModel { model: a, placed: placed(Motion { velocity, ..Motion::resting(Pose::new(start, turns[0])) }) },
        b: PlacedModel { model: b, placed: placed(Motion::resting(Pose::new(DVec3::ZERO, turns[1]))) },
        resolution: default_resolution(a, b),
        cell_limit: 100_000,
        strategies: Strategies::default(),
        query_options: QueryOptions::DEPTH,
    }
}

#[test]
fn one_point_is_told_where_boxes_find_one_point() {
    let mut r = Random(0x706f_696e_7473);
    let mut seen = Seen::default();
    let count = sized("CONTACTD_POINTS", 1200usize);
    for i in 0..count {
        // A half-space stands alone.
        let kinds = [(r.unit() * 8.0) as usize, (r.unit() * 9.0) as usize];
        near(&mut r, kinds, -3.0, |bodies, _| {
            let place = format!("{i}: {kinds:?}, tau {:e}", bodies.tau);
            let Some(Regions { regions: found, .. }) = bodies.told(Way::Single) else {
                seen.left += 1;
                return;
            };
            let boxes = bodies.in_boxes();
            if !boxes.complete {
                return;
            }
            let within = |r: &&Region| r.separation() <= bodies.tau * (1.0 - 1e-6);
            let (told, mut expected): (Vec<_>, Vec<_>) =
                (found.iter().filter(within).collect(), boxes.regions.iter().filter(within).collect());
            // A corner is farther from where F balances than from the other body: boxes may not hold that.
            if expected.is_empty() {
                seen.none += 1;
                return;
            }
            assert_eq!(told.len(), 1, "{place}: {boxes:#?}");
            if told[0].extent == Extent::Line {
                let ends = &told[0].points;
                let way = ends[1].point - ends[0].point;
                let aside = |p: &RegionPoint| {
                    let part = (p.point - ends[0].point).dot(way) / way.length_squared();
                    p.point.distance(ends[0].point + way * part.clamp(0.0, 1.0))
                };
                // A short one may be a point there; and a curve as near as what is foremost is wide may be a region of its own.
                let wide = 2.0 * (bodies.tau * bodies.size).sqrt() + 1e-6 * bodies.size;
                assert!(
                    expected.iter().flat_map(|r| &r.points).all(|p| aside(p) < wide),
                    "{place}: {told:#?} {boxes:#?}"
                );
                let is_line = |r: &&&Region| {
                    r.extent == Extent::Line && r.faces_a == told[0].faces_a && r.faces_b == told[0].faces_b
                };
                let Some(same) = expected.iter().find(is_line) else {
                    assert!(way.length() < 0.05, "{place}: {told:#?} {boxes:#?}");
                    seen.beside += 1;
                    return;
                };
                seen.beside += usize::from(expected.len() > 1);
                let of = |r: &Region| (r.extent, r.kind, r.faces_a, r.faces_b, r.points.len());
                assert_eq!(of(told[0]), of(same), "{place}: {told:#?} {same:#?}");
                let off = |p: &RegionPoint, q: &RegionPoint| {
                    p.point.distance(q.point).max((p.separation - q.separation).abs())
                };
                let off = told[0].points.iter().zip(&same.points).map(|(p, q)| off(p, q)).fold(0.0, f64::max);
                assert!(off <= 1e-9 * bodies.size, "{place}: {off:e} {told:#?} {expected:#?}");
                seen.lines += 1;
                return;
            }
            // Where the threshold is large, a curve beside the point may be told, too.
            seen.beside += usize::from(expected.len() > 1);
            expected.sort_by(|p, q| p.separation().total_cmp(&q.separation()));
            let told = told[0];
            // Boxes follow curves to some digits alone, and may miss where these are nearest; what is told here is proven.
            let gaps = told.separation() - expected[0].separation();
            assert!(gaps <= 1e-8, "{place}: {gaps:e}, {told:?} {expected:?}");
            if gaps < -0.01 * bodies.tau {
                seen.missed += 1;
                return;
            }
            // A rim may be told by a short chord.
            let ends = &expected[0].points;
            let long = ends.iter().map(|p| p.point.distance(ends[0].point)).fold(0.0, f64::max);
            let short = 0.05 + 16.0 * (bodies.tau * bodies.size).sqrt();
            assert!(told.extent == Extent::Point && long < short, "{place}: {told:?} {boxes:?}");
            let off = told.points[0].point.distance(expected[0].points[0].point);
            assert!(off < short, "{place}: {off:e}, {told:?} {expected:?}");
            seen.points += 1;
        });
    }
    println!("{seen:?}");
    assert!(
        100 * (seen.beside + seen.missed) <= seen.points && 2 * seen.none <= seen.points && seen.points > count / 10,
        "{seen:?}"
    );
}

#[test]
fn the_patch_of_round_flat_faces_is_the_one_that_boxes_find() {
    let mut r = Random(0x0064_6973_6373);
    let (mut patches, mut beside, mut left) = (0, 0, 0);
    let count = sized("CONTACTD_POINTS", 1500usize);
    for i in 0..count {
        let kinds = [[2, 3, 4][(r.unit() * 3.0) as usize], [2, 3, 4, 6, 7, 8, 9][(r.unit() * 7.0) as usize]];
        near(&mut r, kinds, -1.0, |bodies, gap| {
            let place = format!("{i}: {kinds:?}, tau {:e}", bodies.tau);
            let found = bodies.told(Way::Flat);
            let boxes = bodies.in_boxes();
            if !boxes.complete {
                return;
            }
            let Some(found) = found else {
                left += usize::from(boxes.regions.iter().any(|r| r.extent == Extent::Patch));
                return;
            };
            let [told] = &found.regions[..] else { panic!("{place}: {found:?}") };
            let expected: Vec<_> = boxes.regions.iter().filter(|r| r.extent == Extent::Patch).collect();
            let [expected] = expected[..] else { panic!("{place}: {told:?} {boxes:#?}") };
            assert_eq!(
                (told.faces_a, told.faces_b, told.kind),
                (expected.faces_a, expected.faces_b, expected.kind),
                "{place}"
            );
            let is_same = |p: &RegionPoint, q: &RegionPoint| {
                p.point.distance(q.point).max((p.separation - q.separation).abs()) <= 1e-9 * bodies.size
            };
            // In order; where the faces lean, the nearest point of a circle, too.
            let mut more = told.points.len() - expected.points.len().min(told.points.len());
            let mut known = expected.points.iter().peekable();
            for p in &told.points {
                if known.next_if(|q| is_same(p, q)).is_none() {
                    assert!(more > 0, "{place}: {told:#?} {expected:#?}");
                    more -= 1;
                }
            }
            assert!(more == 0 && known.next().is_none(), "{place}: {told:#?} {expected:#?}");
            let above = told.separation() - gap;
            assert!(above <= 3e-3 * bodies.tau + 1e-8, "{place}: {above:e} farther than they can be, {told:#?}");
            // Boxes tell such a rim as a line as well.
            for other in boxes.regions.iter().filter(|r| r.extent != Extent::Patch) {
                let of_patch = other.faces_a.contains(&told.faces_a[0]) || other.faces_b.contains(&told.faces_b[0]);
                assert!(of_patch && other.extent == Extent::Line, "{place}: {told:?} {other:?}");
                let below = told.separation() - other.separation();
                assert!(below <= 0.05 * bodies.tau, "{place}: {below:e}, {told:#?} {other:#?}");
                beside += 1;
            }
            patches += 1;
        });
    }
    println!("{patches} {beside} {left}");
    assert!(patches > count / 30 && 10 * (beside + left) <= patches, "{patches} {beside} {left}");
}

#[test]
fn an_oblique_side_bounds_its_face_where_it_ends() {
    // A small peg over the narrow end of a frustum: nearer than the end's edge, farther out than the side's plane at its height.
    let [bottom, top] =
        [(0.9, -0.3), (0.5, 0.3)].map(|(w, z)| [dvec3(w, w, z), dvec3(-w, w, z), dvec3(-w, -w, z), dvec3(w, -w, z)]);
    let frustum = Polyhedron::hull([bottom, top].concat()).expect("a frustum");
    let models = [simple(Cylinder { radius: 0.08, half_height: 0.5 }), simple(frustum)];
    let start = dvec3(0.415, 0.1, 0.3 + 0.06 + 0.5);
    let query = query(&models, [DQuat::IDENTITY; 2], start, DVec3::ZERO);
    let found = Bodies::new(&query, 0.07).told(Way::Flat).expect("a patch");
    let [patch] = &found.regions[..] else { panic!("{found:#?}") };
    for across in [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y] {
        let rim = (start + 0.08 * across).with_z(0.33);
        let off = patch.points.iter().map(|p| p.point.distance(rim)).fold(f64::INFINITY, f64::min);
        assert!(off < 1e-9, "{rim}: {off:e}, {patch:#?}");
    }
    assert_eq!(patch.extent, Extent::Patch);
}

#[test]
fn a_rim_that_touches_at_two_opposite_points_is_no_line() {
    // A cylinder lies across another one's cap, along the direction from which points of the rim are counted, and along others.
    let models =
        [simple(Cylinder { radius: 0.3, half_height: 2.0 }), simple(Cylinder { radius: 1.0, half_height: 0.5 })];
    for turn in [0.0, 0.25, 0.5, 0.7, 1.0] {
        let lying = DQuat::from_rotation_z(turn * FRAC_PI_2) * DQuat::from_rotation_y(FRAC_PI_2);
        let turns = [lying, DQuat::IDENTITY];
        let query = query(&models, turns, DVec3::Z * 0.8, DVec3::ZERO);
        for way in [Way::Boxes, Way::Single] {
            let found = in_one_way(&query, 0.0, 1e-6, way).expect("a line");
            let [line] = &found.regions[..] else { panic!("{turn}: {found:#?}") };
            assert_eq!((line.extent, line.points.len()), (Extent::Line, 2), "{turn}: {line:#?}");
            let length = line.points[0].point.distance(line.points[1].point);
            assert!((length - 2.0).abs() < 1e-9 && line.separation().abs() < 1e-9, "{turn}: {line:#?}");
        }
    }
}

#[test]
fn a_ball_beside_an_edge_is_nearest_to_the_edge() {
    // Next to a face's plane and, by less, beyond its end: F is lowest between the ball and the plane.
    let models = [simple(Sphere { radius: 0.5 }), simple(Cuboid { half: DVec3::ONE })];
    for (gap, beyond) in [(6.8e-4, 3.06e-4), (6.8e-4, 1e-6), (1e-3, 0.0), (1e-5, 1e-3)] {
        let start = dvec3(1.5 + gap, 1.0 + beyond, 0.1);
        let found = regions(&query(&models, [DQuat::IDENTITY; 2], start, DVec3::ZERO), 0.0, 1.1e-3).regions;
        let [point] = &found[..] else { panic!("{gap} {beyond}: {found:#?}") };
        let separation = (0.5 + gap).hypot(beyond) - 0.5;
        let off = (point.points[0].point.distance(dvec3(1.0, 1.0, 0.1)) - 0.5 * separation).abs();
        assert!((point.separation() - separation).abs() < 1e-12 && off < 1e-9, "{gap} {beyond}: {off:e} {point:#?}");
    }
}

#[test]
fn a_ball_near_edges_and_corners_is_as_far_as_its_centre_says() {
    let mut r = Random(0x6564_6765);
    for i in 0..2000 {
        let (radius, mut half) = (r.within(0.2, 0.9), || r.within(0.2, 0.9));
        let half = dvec3(half(), half(), half());
        let models = [simple(Cuboid { half }), simple(Sphere { radius })];
        let turn = quat_of_rotation_vector(if i % 2 == 0 { DVec3::ZERO } else { r.vector(3.0) });
        // Next to one face's plane, on this side or beyond the ends of it.
        let tau = 10f64.powf(r.within(-6.0, -2.5));
        let gap = tau * r.within(0.0, 0.8);
        let [beyond, other] = [0, 1].map(|_| if r.unit() < 0.6 { tau * r.within(-0.2, 1.0) } else { -0.1 });
        let center = half + dvec3(radius + gap, beyond, other);
        let separation = (center - half).max(DVec3::ZERO).length() - radius;
        let query = query(&models, [turn, DQuat::IDENTITY], turn * -center, DVec3::ZERO);
        let found = regions(&query, 0.0, tau).regions;
        let [point] = &found[..] else { panic!("{i}: {separation:e} {found:#?}") };
        let off = (point.separation() - separation).abs();
        assert!(off < 1e-12 && point.extent == Extent::Point, "{i}: {off:e}, {separation:e} {point:#?}");
    }
}

#[test]
fn what_is_far_apart_within_a_wide_threshold_is_told_by_its_least_distance() {
    let mut r = Random(61);
    let (mut told, mut most) = (0, 0);
    for i in 0..200 {
        let kind = |r: &mut Random| [0, 1, 2, 3, 4, 5, 6, 7, 9][(r.unit() * 9.0) as usize];
        let kinds = [kind(&mut r), kind(&mut r)];
        let models = kinds.map(|kind| simple(shape(&mut r, kind)));
        let turns =
            [0, 1].map(|_| if r.unit() < 0.5 { DQuat::IDENTITY } else { quat_of_rotation_vector(r.vector(3.0)) });
        let start = r.vector(1.0).normalize() * r.within(2.0, 6.0);
        let query = query(&models, turns, start, DVec3::ZERO);
        let size = Bodies::new(&query, 0.0).size;
        let (a, b) = (query.a, query.b);
        let asked = DistanceQuery { a, b, tolerance: 1e-3 * SAME_POINT * size, limit: DEFAULT_LIMIT };
        let distance = at_instant(&asked, 0.0).upper;
        if distance < 0.2 * size {
            continue;
        }
        let found = regions(&query, 0.0, distance * r.within(1.01, 3.0));
        let [region] = &found.regions[..] else { panic!("{i} {kinds:?}: {found:?}") };
        let [p] = &region.points[..] else { panic!("{i} {kinds:?}: {region:?}") };
        let slack = 2.0 * SAME_POINT * size;
        assert!((p.separation - distance).abs() <= slack, "{i} {kinds:?}: {distance} {region:?}");
        // The feet lie on both bodies.
        if region.kind != ContactKind::VertexVertex {
            for (k, sign) in [-0.5, 0.5].into_iter().enumerate() {
                let pose = [&query.a, &query.b][k].placed.motion.start;
                let foot = pose.inverse().point(p.point + region.normal * (sign * p.separation));
                assert!(models[k].value(foot).abs() <= slack, "{i} {kinds:?}: {} {region:?}", models[k].value(foot));
            }
        }
        assert!(region.faces_a[0] != NO_FACE && region.faces_b[0] != NO_FACE, "{i} {kinds:?}: {region:?}");
        told += 1;
        most = most.max(found.cells);
        assert!(regions(&query, 0.0, 0.9 * distance).regions.is_empty(), "{i} {kinds:?}");
    }
    println!("{told} told, {most} cells at most");
    assert!(told > 150, "{told}");
}
