//! Contact manifolds: few points that span their region, true at each step, and the same ones from step to step.

use contactd::ipc::Embedded;
use contactd_client::manifold::span::{KEPT, Span};
use contactd_client::manifold::{Manifolds, Point};
use contactd_client::{Object, Session};
use contactd_proto::contact_record::{CLEAR, OVERLAP};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Pose, PoseRecord, Report, Rule};
use glam::{DQuat, DVec2, DVec3, dvec2, dvec3};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, SQRT_2, TAU};
use std::time::Duration;

/// Pairs are told within this of each other; bodies are 1 in size.
const MARGIN: f64 = 4e-3;
/// A plate of 8 x 8 with its upper face at z = 0.
const PLATE: &str = "cube(size = [8, 8, 2], center = true);";
/// The same with a hole of radius .25.
const DRILLED: &str =
    "difference() { cube(size = [8, 8, 2], center = true); cylinder(h = 4, r1 = 0.25, r2 = 0.25, center = true); }";
const CUBE: &str = "cube(size = [1, 1, 1], center = true);";
const CYLINDER: &str = "cylinder(h = 2, r1 = 0.5, r2 = 0.5, center = true);";

/// A body that is put somewhere over a fixed plate, step by step.
struct Scene {
    session: Session<Embedded>,
    plate: u32,
    body: u32,
    manifolds: Manifolds,
    pose: Pose,
}

impl Scene {
    fn new(plate: &str, body: &str) -> Self {
        let mut session = contactd::embedded(&contactd::ipc::ServerConfig::default()).unwrap();
        let plate = session.load_model("plate.csg", plate).unwrap().id;
        let body = session.load_model("body.csg", body).unwrap().id;
        let plate = session.add_object(Object::new("plate", plate).fixed().at(Pose::at(DVec3::NEG_Z))).unwrap();
        let body = session.add_object(Object::new("body", body).at(Pose::at(DVec3::Z * 9.0))).unwrap();
        let mut rule = Rule::new(["default".into(), "default".into()]);
        (rule.report, rule.margin, rule.penetration) = (Report::Patch, MARGIN, true);
        session.set_rules(&[rule]).unwrap();
        session.options.details = true;
        Self { session, plate, body, manifolds: Manifolds::default(), pose: Pose::IDENTITY }
    }

    /// The body's points where it stands; each is a point of a region as it is now, or the one of an overlap.
    fn at(&mut self, pose: Pose) -> Vec<Point> {
        self.pose = pose;
        self.session.begin_step(1).unwrap()[0] = PoseRecord::start(self.body, &pose);
        let reply = self.session.finish(Duration::from_secs(60)).unwrap();
        let (plate, body) = (self.plate, self.body);
        self.manifolds.update(&reply, |object, _| if object == body { pose } else { Pose::at(DVec3::NEG_Z) });
        let Some(found) = self.manifolds.pair(plate, body) else { return Vec::new() };
        assert!(found.is_complete);
        assert_eq!(self.manifolds.pairs().len(), 1);
        let record = &reply.records()[0];
        let reported: Vec<DVec3> = reply
            .regions(record)
            .flat_map(|(_, slots)| slots.flat_map(|s| s.points[..s.count as usize].iter()))
            .map(|p| DVec3::from_array(*p))
            .collect();
        for p in found.points {
            assert!(found.status == OVERLAP || reported.contains(&p.position), "{p:?} is not reported: {reported:?}");
            // Its two surface points are where the bodies' frames say.
            let on = [Pose::at(DVec3::NEG_Z).point(p.on_a), pose.point(p.on_b)];
            assert!((on[1] - on[0]).distance(p.normal * p.separation) < 1e-12);
            assert!(((on[0] + on[1]) / 2.0).distance(p.position) < 1e-12);
        }
        found.points.to_vec()
    }
}

/// Numbers in −1..1 (xorshift).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        dvec3(self.next(), self.next(), self.next())
    }

    /// A pose moved and turned by up to `by`.
    fn jiggled(&mut self, pose: &Pose, by: f64) -> Pose {
        let turn = quat_of_rotation_vector(self.vector() * by);
        Pose::new(pose.position + self.vector() * by, (turn * pose.rotation).normalize())
    }
}

fn ids(points: &[Point]) -> Vec<u32> {
    points.iter().map(|p| p.id).collect()
}

/// How far a body of size 1 has moved at most: a bound for any of its points.
fn moved(from: &Pose, to: &Pose) -> f64 {
    let cos = from.rotation.dot(to.rotation).abs().min(1.0);
    let sin = (to.rotation * from.rotation.conjugate()).xyz().length();
    from.position.distance(to.position) + 2.0 * sin.atan2(cos) * 1.2
}

/// 600 steps of jiggle, its size from 1e-9 to 1e-4: the same `count` points under the same ids, none of which moves by more
/// than `factor` times what the body does. (Slack: what Newton's method leaves of a point.) Returns the points at rest.
fn rests(scene: &mut Scene, pose: &Pose, count: usize, factor: f64) -> Vec<Point> {
    rests_for(600, scene, pose, count, factor)
}

fn rests_for(steps: u32, scene: &mut Scene, pose: &Pose, count: usize, factor: f64) -> Vec<Point> {
    let mut noise = Noise(0x9e37_79b9_7f4a_7c15);
    let first = scene.at(*pose);
    assert_eq!(first.len(), count, "{first:#?}");
    let (mut before, mut pose_before) = (first.clone(), *pose);
    let mut worst = 0.0f64;
    for step in 0..steps {
        let by = 10f64.powf(-9.0 + 5.0 * f64::from(step % 120) / 119.0);
        let pose = noise.jiggled(pose, by);
        let points = scene.at(pose);
        assert_eq!(ids(&points), ids(&first), "step {step}, jiggle {by:e}: {points:#?}");
        for (p, q) in points.iter().zip(&before) {
            worst = worst.max((p.position.distance(q.position) - 3e-9) / moved(&pose_before, &pose));
        }
        assert!(
            worst <= factor,
            "step {step}, jiggle {by:e}: {worst} times as far as the body: {points:#?} {before:#?}"
        );
        (before, pose_before) = (points, pose);
    }
    println!("points move at most {worst:.3} times as far as the body");
    first
}

fn turned(axis: DVec3, angle: f64) -> DQuat {
    quat_of_rotation_vector(axis * angle)
}

/// Area of the hull of points in the plane z = const.
fn area(points: &[DVec3]) -> f64 {
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    let mut round: Vec<DVec3> = points.iter().map(|p| *p - middle).collect();
    round.sort_by(|p, q| p.y.atan2(p.x).total_cmp(&q.y.atan2(q.x)));
    (0..round.len()).map(|i| 0.5 * round[i].cross(round[(i + 1) % round.len()]).z).sum()
}

fn positions(points: &[Point]) -> Vec<DVec3> {
    points.iter().map(|p| p.position).collect()
}

#[test]
fn a_box_at_rest_keeps_its_corners() {
    let mut s = Scene::new(PLATE, CUBE);
    let pose = Pose::new(dvec3(0.3, -0.2, 0.5 + 1e-3), turned(DVec3::Z, 0.4));
    let points = rests(&mut s, &pose, 4, 1.0);
    assert!((area(&positions(&points)) - 1.0).abs() < 1e-8);
    assert!(points.iter().all(|p| p.normal.distance(DVec3::Z) < 1e-9 && (p.separation - 1e-3).abs() < 1e-9));
}

#[test]
fn a_standing_cylinder_keeps_four_marks_of_its_rim() {
    let mut s = Scene::new(PLATE, CYLINDER);
    let points = rests(&mut s, &Pose::at(dvec3(0.2, 0.1, 1.0 + 1e-3)), 4, 1.0);
    assert!((area(&positions(&points)) - 0.5).abs() < 1e-8, "the square of radius .5");
    // Turning about its axis it takes them along, also by most of the way from mark to mark in a step.
    for k in 1..=200 {
        let turn = turned(DVec3::Z, 0.01 * f64::from(k) + 0.6 * f64::from(k / 10));
        let now = s.at(Pose::new(dvec3(0.2, 0.1, 1.0 + 1e-3), turn));
        assert_eq!(ids(&now), ids(&points), "step {k}");
        for (p, q) in now.iter().zip(&points) {
            assert!(p.on_b.distance(q.on_b) < 1e-8, "step {k}: {p:?}, before {q:?}");
        }
    }
}

#[test]
fn a_lying_cylinder_keeps_both_ends_of_its_line() {
    let mut s = Scene::new(PLATE, CYLINDER);
    let lying = turned(DVec3::Y, FRAC_PI_2);
    let points = rests(&mut s, &Pose::new(dvec3(0.2, 0.1, 0.5 + 1e-3), lying), 2, 1.0);
    assert!((points[0].position.distance(points[1].position) - 2.0).abs() < 1e-8);
    // Rolling, the line leaves both bodies' points behind and stays the same line.
    for k in 1..=300 {
        let way = 0.01 * f64::from(k);
        let pose = Pose::new(dvec3(0.2, 0.1 + way, 0.5 + 1e-3), turned(DVec3::X, -way / 0.5) * lying);
        let now = s.at(pose);
        assert_eq!(ids(&now), ids(&points), "step {k}: {now:#?}");
        for (p, q) in now.iter().zip(&points) {
            assert!((p.position - q.position).distance(DVec3::Y * way) < 1e-7, "step {k}: {p:?}, before {q:?}");
        }
    }
}

#[test]
fn a_wheel_keeps_both_ends_however_fast_it_rolls() {
    let mut s = Scene::new(PLATE, "cylinder(h = 0.2, r1 = 0.5, r2 = 0.5, center = true);");
    let lying = turned(DVec3::Y, FRAC_PI_2);
    let mut first = Vec::new();
    for k in 0..30 {
        // Half its own width in a step.
        let way = 0.1 * f64::from(k) - 1.5;
        let now = s.at(Pose::new(dvec3(0.0, way, 0.5 + 1e-3), turned(DVec3::X, -way / 0.5) * lying));
        if k == 0 {
            first = now.clone();
        }
        assert_eq!((now.len(), ids(&now)), (2, ids(&first)), "step {k}: {now:#?}");
        for (p, q) in now.iter().zip(&first) {
            assert!((p.position - q.position).distance(DVec3::Y * (way + 1.5)) < 1e-7, "step {k}: {p:?}, before {q:?}");
        }
    }
}

#[test]
fn a_cylinder_leaning_on_its_rim_keeps_its_point() {
    let mut s = Scene::new(PLATE, CYLINDER);
    let tilt = turned(DVec3::Y, 0.3);
    let low = tilt * dvec3(0.5, 0.0, -1.0);
    // The lowest point of a rim that leans by .3 moves along it by 1/sin .3 of what the axis turns about the slope.
    let points = rests(&mut s, &Pose::new(DVec3::Z * (1e-3 - low.z), tilt), 1, 1.0 / 0.3f64.sin());
    assert!(points[0].position.distance(dvec3(low.x, 0.0, 5e-4)) < 1e-8);
}

#[test]
fn a_box_over_a_hole_is_held_by_its_corners() {
    let mut s = Scene::new(DRILLED, CUBE);
    let points = rests(&mut s, &Pose::at(DVec3::Z * (0.5 + 1e-3)), 4, 1.0);
    assert!((area(&positions(&points)) - 1.0).abs() < 1e-8, "not the rim of the hole: {points:#?}");
}

#[test]
fn each_of_two_regions_has_its_points() {
    // A bridge on two feet: one normal, and the outer corners of both.
    let bridge = "difference() { cube(size = [1, 0.5, 0.5], center = true);
        multmatrix([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -0.25], [0, 0, 0, 1]]) { cube(size = [0.4, 2, 0.4], center = true); } }";
    let mut s = Scene::new(PLATE, bridge);
    let points = rests_for(240, &mut s, &Pose::new(dvec3(0.1, 0.2, 0.25 + 1e-3), turned(DVec3::Z, 1.0)), 4, 1.0);
    assert!((area(&positions(&points)) - 0.5).abs() < 1e-8, "{points:?}");
    // A box in a corner touches floor and wall. (The corner is relieved, as real ones are: its edge meets nothing.)
    let corner = "difference() { cube(size = [8, 8, 2], center = true);
        multmatrix([[1, 0, 0, 4], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]]) { cube(size = [8, 9, 0.4], center = true); }
        multmatrix([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.8], [0, 0, 0, 1]]) { cube(size = [0.1, 9, 0.1], center = true); } }";
    let mut s = Scene::new(corner, CUBE);
    let points = rests_for(240, &mut s, &Pose::at(dvec3(0.5 + 1e-3, 0.0, 0.3 + 1e-3)), 8, 1.0);
    let of = |n: DVec3| points.iter().filter(|p| p.normal.distance(n) < 1e-9).count();
    assert_eq!((of(DVec3::Z), of(DVec3::X)), (4, 4), "{points:#?}");
}

#[test]
fn a_rolling_ball_keeps_its_one_point() {
    let mut s = Scene::new(PLATE, "sphere(r = 0.5);");
    rests(&mut s, &Pose::at(dvec3(0.1, 0.1, 0.5 + 1e-3)), 1, 1.0);
    // A tenth of its radius a step: the point leaves its place on both bodies.
    let mut before: Option<Point> = None;
    for k in 0..120 {
        let way = 0.05 * f64::from(k);
        let pose = Pose::new(dvec3(-3.0 + way, 0.1, 0.5 + 1e-3), turned(DVec3::Y, way / 0.5));
        let [p] = s.at(pose)[..] else { panic!("step {k}") };
        assert!(p.position.distance(dvec3(-3.0 + way, 0.1, 5e-4)) < 1e-8);
        if let Some(q) = before {
            assert!(p.id == q.id && (k < 2 || p.on_b.distance(q.on_b) > 0.04), "step {k}: {p:?}, before {q:?}");
        }
        before = Some(p);
    }
}

#[test]
fn corners_stay_who_they_are_on_a_box_that_slides_over_an_edge() {
    let mut s = Scene::new(PLATE, CUBE);
    let at = |x: f64| Pose::at(dvec3(x, 0.1, 0.5 + 1e-3));
    let first = s.at(at(3.0));
    let mut last = first.clone();
    for k in 0..=100 {
        let points = s.at(at(3.0 + 0.01 * f64::from(k)));
        assert_eq!(points.len(), 4);
        for p in &points {
            // The corners still on the plate move with the box; those of the edge are where the plate ends.
            let edge = points.iter().filter(|q| (q.position.x - 4.0).abs() < 1e-9).count();
            assert!(edge == if k < 50 { 0 } else { 2 }, "step {k}: {points:#?}");
            if p.position.x < 4.0 - 1e-9 {
                let was = last.iter().find(|q| q.id == p.id).unwrap_or_else(|| panic!("step {k}: {p:?} is new"));
                assert!(was.on_b.distance(p.on_b) < 1e-9);
            }
        }
        last = points;
    }
    let back = |p: &&Point| first.iter().any(|q| q.id == p.id && q.on_b.distance(p.on_b) < 1e-9);
    assert_eq!(last.iter().filter(back).count(), 2, "{last:#?}");
}

#[test]
fn an_overlap_has_its_deepest_point_and_ids_end_with_the_touch() {
    let mut s = Scene::new(PLATE, "sphere(r = 0.5);");
    let near = s.at(Pose::at(DVec3::Z * 0.501));
    let [deep] = s.at(Pose::at(DVec3::Z * 0.46))[..] else { panic!("one point") };
    assert!(deep.normal.distance(DVec3::Z) < 1e-6 && (deep.separation + 0.04).abs() < 1e-4, "{deep:?}");
    assert!(deep.position.distance(DVec3::Z * -0.02) < 1e-3, "{deep:?}");
    assert_eq!(deep.id, near[0].id, "the ball is pressed in where it touched");
    assert_eq!(s.at(Pose::at(DVec3::Z * 0.6)), []);
    assert_eq!(s.manifolds.pairs().len(), 0);
    // Elsewhere it is another touch; ids begin anew with a pair.
    assert_eq!(s.at(Pose::at(DVec3::Z * 0.501))[0].id, 0);
    // A ball that turns in its place keeps its point on the plate; one that jumps while the pair lasts has another.
    assert_eq!(s.at(Pose::new(dvec3(0.0, 0.0, 0.501), turned(DVec3::X, 3.0)))[0].id, 0);
    assert_eq!(s.at(Pose::new(dvec3(2.0, 0.0, 0.501), turned(DVec3::Y, 2.0)))[0].id, 1);
}

#[test]
fn a_box_that_tips_keeps_the_edge_it_tips_over() {
    let mut s = Scene::new(PLATE, CUBE);
    let flat = s.at(Pose::at(DVec3::Z * (0.5 + 1e-3)));
    // About the edge x = .5.
    let mut last = flat.clone();
    for k in 1..=200 {
        let tilt = turned(DVec3::Y, 1e-3 * f64::from(k));
        let pivot = dvec3(0.5, 0.0, -0.5);
        let points = s.at(Pose::new(dvec3(0.5, 0.0, 1e-3) - tilt * pivot, tilt));
        let edge: Vec<&Point> = points.iter().filter(|p| p.on_b.x > 0.5 - 1e-6).collect();
        assert_eq!(edge.len(), 2, "step {k}: {points:#?}");
        for p in edge {
            assert!(flat.iter().any(|q| q.id == p.id && q.on_b.distance(p.on_b) < 1e-6), "step {k}: {p:?} {last:#?}");
        }
        last = points;
    }
    assert_eq!(last.len(), 2);
}

#[test]
fn the_same_sequence_makes_the_same_points() {
    let run = || {
        let mut s = Scene::new(DRILLED, CYLINDER);
        let mut noise = Noise(7);
        let mut all = Vec::new();
        let mut pose = Pose::at(dvec3(0.1, 0.0, 1.0 + 1e-3));
        for _ in 0..100 {
            all.push(s.at(pose));
            pose = noise.jiggled(&pose, 3e-4);
            pose.position.z = 1.0 + 1e-3;
        }
        all
    };
    assert_eq!(run(), run());
}

/// Ids of a pair and where they were last: none comes back.
#[test]
fn an_id_that_ended_does_not_come_back() {
    let mut s = Scene::new(DRILLED, CYLINDER);
    let mut last_seen: BTreeMap<u32, i32> = BTreeMap::new();
    let mut most = 0;
    for k in 0..300 {
        // Round the hole, half over it at times, turning.
        let angle = 0.05 * f64::from(k);
        let at = dvec3(0.6 * angle.cos(), 0.6 * angle.sin(), 1.0 + 1e-3);
        for p in s.at(Pose::new(at, turned(DVec3::Z, 0.3 * angle))) {
            let before = last_seen.insert(p.id, k);
            assert!(before.map_or(p.id >= most, |b| b == k - 1), "step {k}: id {} was last seen at {before:?}", p.id);
            most = most.max(p.id + 1);
        }
    }
    println!("{most} ids in 300 steps");
    assert!(most >= 4);
}

#[test]
fn only_a_better_span_by_a_tenth_changes_the_choice() {
    let ring =
        |turn: f64| -> Vec<DVec2> { (0..8).map(|k| DVec2::from_angle(turn + TAU / 8.0 * f64::from(k))).collect() };
    let mut span = Span::default();
    span.set(DVec3::Z, ring(0.0).into_iter().map(|p| (p.extend(0.0), 0.0)));
    let best = span.best(|_| true);
    assert!((span.area(&best) - 2.0).abs() < 1e-12);
    let mut kept = span.best(|i| [0, 1, 4, 5].contains(&i));
    assert!((span.area(&kept) - SQRT_2).abs() < 1e-12);
    assert!(span.suffices(&kept, &best, 0.7) && !span.suffices(&kept, &best, 0.72));
    kept = span.best(|i| i < 2);
    span.fill(&mut kept);
    assert!(kept.indices().len() == KEPT && span.area(&kept) > 1.4);
    // One that hangs lower than the rest by more than a thousandth is always among them.
    for low in 0..8 {
        let of = |k: usize| if k == low { -0.01 } else { 0.0 };
        span.set(DVec3::Z, ring(0.3).into_iter().enumerate().map(|(k, p)| (p.extend(0.0), of(k))));
        let best = span.best(|_| true);
        assert!(best.indices().contains(&low) && best.indices().len() == 4 && span.area(&best) > 1.2);
    }
    // Points in a line and in one place.
    span.set(DVec3::Z, (0..9).map(|k| (dvec3(0.1, f64::from((k * 4) % 9), 0.0), 0.0)));
    let mut ends = span.best(|_| true).indices().to_vec();
    ends.sort_unstable();
    assert_eq!(ends, [0, 2], "y = 0 and y = 8");
    span.set(DVec3::Z, (0..6).map(|k| (DVec3::ONE, f64::from((k + 3) % 6))));
    assert_eq!(span.best(|_| true).indices(), [3]);
}

/// Hull of points in the plane by the definition: edges with no point on their right; area by the shoelace formula.
fn hull_area(points: &[DVec2]) -> f64 {
    let mut twice = 0.0;
    for (i, p) in points.iter().enumerate() {
        for (j, q) in points.iter().enumerate() {
            if i != j && points.iter().enumerate().all(|(k, r)| k == i || k == j || (*q - *p).perp_dot(*r - *p) > 0.0) {
                twice += p.perp_dot(*q);
            }
        }
    }
    0.5 * twice
}

/// The largest area of the hull of four points, by trying all.
fn largest(points: &[DVec2]) -> f64 {
    let n = points.len();
    let mut most = 0.0f64;
    for i in 0..n {
        for j in i + 1..n {
            for k in j + 1..n {
                for l in k + 1..n {
                    most = most.max(hull_area(&[points[i], points[j], points[k], points[l]]));
                }
            }
        }
    }
    most
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// The choice is the best there is, and so at least 2/π of the region, from any side, long or round.
    #[test]
    fn four_points_span_at_least_two_parts_of_pi(
        raw in proptest::collection::vec((0.0f64..1.0, 0.0f64..TAU), 5..14),
        squeeze in 1e-3f64..1.0,
        axis in (-1.0f64..1.0, -1.0f64..1.0, -1.0f64..1.0),
    ) {
        let points: Vec<DVec2> = raw.iter().map(|(r, t)| r.sqrt() * dvec2(t.cos(), squeeze * t.sin())).collect();
        let turn = quat_of_rotation_vector(dvec3(axis.0, axis.1, axis.2) * 3.0);
        let mut span = Span::default();
        span.set(turn * DVec3::Z, points.iter().map(|p| (turn * p.extend(0.7), 0.0)));
        let best = span.best(|_| true);
        let (hull, found) = (hull_area(&points), span.area(&best));
        prop_assert!(found >= 2.0 / std::f64::consts::PI * hull, "{found} of {hull}");
        prop_assert!((found - largest(&points)).abs() <= 1e-6 * found, "{found}, the best is {}", largest(&points));
        let mut filled = span.best(|i| i < 2);
        span.fill(&mut filled);
        prop_assert!(span.area(&filled) > 0.0 && span.area(&filled) <= found * (1.0 + 1e-6));
    }
}

#[test]
fn regions_are_told_of_pairs_that_only_come_near() {
    let mut s = Scene::new(PLATE, CUBE);
    s.at(Pose::at(DVec3::Z * (0.5 + 1e-3)));
    let found = s.manifolds.pair(s.plate, s.body).unwrap();
    assert_eq!((found.status, found.points.len()), (CLEAR, 4));
    assert!(s.manifolds.pair(s.body, s.plate).is_none() && s.manifolds.pair(s.plate, 99).is_none());
}
