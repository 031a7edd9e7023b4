//! Contacts that are kept while bodies rest: true where the bodies stand, by closed forms of balls, boxes and cylinders over a plane.
//!
//! Long form: `CONTACTD_CACHE_SCENES=2000 cargo test -p contactd-tests --test steps contact_cache::`

use contactd::ipc::Embedded;
use contactd_client::manifold::cache::ContactCache;
use contactd_client::manifold::{Manifold, Point};
use contactd_client::{Object, Session};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Pose, Report, Rule};
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::{DVec3, dvec3};
use std::f64::consts::FRAC_PI_4;
use std::time::Duration;

/// Pairs are told within this of each other; bodies are about 1 in size.
const MARGIN: f64 = 4e-3;
/// Of the length of a group, how much nearer than all chosen points another one may be.
const CHOICE: f64 = 1e-3;

/// How far bodies lean. Of a face that leans by about the margin over its size the engine may tell an edge of the place within the margin
/// and not the corner that is nearest: what is told then is not judged here.
const LEANS: [f64; 4] = [0.0, 1e-6, 3e-5, 0.7];

/// A body's shape, centred at its origin.
#[derive(Clone, Copy, Debug)]
enum Shape {
    Ball(f64),
    Cuboid(DVec3),
    Cylinder(f64, f64),
}

impl Shape {
    fn random(r: &mut Random) -> Self {
        match r.below(3) {
            0 => Shape::Ball(r.within(0.3, 0.8)),
            1 => Shape::Cuboid(dvec3(r.within(0.2, 0.6), r.within(0.2, 0.6), r.within(0.2, 0.6))),
            _ => Shape::Cylinder(r.within(0.2, 0.6), r.within(0.2, 0.6)),
        }
    }

    fn text(&self) -> String {
        match self {
            Shape::Ball(radius) => format!("sphere(r = {radius});"),
            Shape::Cuboid(half) => {
                format!("cube(size = [{}, {}, {}], center = true);", 2.0 * half.x, 2.0 * half.y, 2.0 * half.z)
            }
            Shape::Cylinder(radius, half) => {
                format!("cylinder(h = {}, r1 = {radius}, r2 = {radius}, center = true);", 2.0 * half)
            }
        }
    }

    /// How far its farthest point is from its origin.
    fn reach(&self) -> f64 {
        match self {
            Shape::Ball(radius) => *radius,
            Shape::Cuboid(half) => half.length(),
            Shape::Cylinder(radius, half) => radius.hypot(*half),
        }
    }

    /// How far it reaches from its origin along a direction of its own frame.
    fn support(&self, along: DVec3) -> f64 {
        match self {
            Shape::Ball(radius) => *radius,
            Shape::Cuboid(half) => half.dot(along.abs()),
            Shape::Cylinder(radius, half) => radius * along.x.hypot(along.y) + half * along.z.abs(),
        }
    }

    /// How far a point is from its surface, near it.
    fn off(&self, x: DVec3) -> f64 {
        match self {
            Shape::Ball(radius) => x.length() - radius,
            Shape::Cuboid(half) => (x.abs() - half).max_element(),
            Shape::Cylinder(radius, half) => (x.x.hypot(x.y) - radius).max(x.z.abs() - half),
        }
    }
}

/// Bodies over a slab whose upper face is a plane, everything turned somewhere.
struct Scene {
    session: Session<Embedded>,
    cache: ContactCache,
    floor: Pose,
    slab: u32,
    bodies: Vec<(u32, Shape)>,
}

/// Every pair is told with all of its regions.
fn ask_for_patches(session: &mut Session<Embedded>) {
    let mut rule = Rule::new(["default".into(), "default".into()]);
    (rule.report, rule.margin, rule.penetration) = (Report::Patch, MARGIN, true);
    session.set_rules(&[rule]).unwrap();
    session.options.details = true;
}

/// One step.
fn ask(session: &mut Session<Embedded>, cache: &mut ContactCache, poses: &[Pose]) {
    let records = cache.begin(poses);
    if !records.is_empty() {
        session.begin_step(records.len()).unwrap().copy_from_slice(records);
        cache.answer(&session.finish(Duration::from_secs(60)).unwrap());
    }
}

impl Scene {
    fn new(r: &mut Random, slack: f64) -> Self {
        let mut session = contactd::embedded(&contactd::ipc::ServerConfig::default()).unwrap();
        let turn = quat_of_rotation_vector(r.direction() * r.within(0.0, 3.0));
        let floor = Pose::new(r.vector(5.0), turn);
        let slab =
            "multmatrix([[1,0,0,0],[0,1,0,0],[0,0,1,-1],[0,0,0,1]]) { cube(size = [60, 60, 2], center = true); }";
        let slab = session.load_model("slab.csg", slab).unwrap().id;
        let slab = session.add_object(Object::new("slab", slab).fixed().at(floor)).unwrap();
        let mut cache = ContactCache::new(slack);
        cache.add_fixed(slab, floor);
        let mut bodies = Vec::new();
        for i in 0..3 {
            let shape = Shape::random(r);
            let model = session.load_model(&format!("body {i}.csg"), shape.text().as_str()).unwrap().id;
            let object = session.add_object(Object::new(&format!("body {i}"), model)).unwrap();
            cache.add_moving(object, shape.reach());
            bodies.push((object, shape));
        }
        ask_for_patches(&mut session);
        Self { session, cache, floor, slab, bodies }
    }

    /// One step; how many requests it took.
    fn step(&mut self, poses: &[Pose]) -> u64 {
        let before = self.cache.asked().requests;
        ask(&mut self.session, &mut self.cache, poses);
        self.cache.asked().requests - before
    }

    /// The pose of body `i` at which it is `gap` over the floor, leaning by `lean`.
    fn over(&self, i: usize, gap: f64, lean: DVec3) -> Pose {
        let rotation = self.floor.rotation * quat_of_rotation_vector(lean);
        let down = rotation.inverse() * (self.floor.rotation * DVec3::NEG_Z);
        let height = gap + self.bodies[i].1.support(down);
        Pose::new(self.floor.point(dvec3(4.0 * i as f64 - 4.0, 0.0, height)), rotation)
    }

    /// How far body `i` is over the floor.
    fn gap(&self, i: usize, pose: &Pose) -> f64 {
        let down = pose.rotation.inverse() * (self.floor.rotation * DVec3::NEG_Z);
        self.height(pose.position) - self.bodies[i].1.support(down)
    }

    fn height(&self, x: DVec3) -> f64 {
        (x - self.floor.position).dot(self.floor.rotation * DVec3::Z)
    }

    /// Holds what is told of body `i` against what is true where it stands.
    fn judge(&self, i: usize, pose: &Pose, slack: f64, what: &str, points: &mut usize) {
        let (object, shape) = self.bodies[i];
        let told: Vec<(Manifold, Point)> = self.cache.contacts().filter(|(m, _)| m.b == object).collect();
        let gap = self.gap(i, pose);
        if gap > MARGIN + 2.0 * slack + 1e-9 {
            assert!(told.is_empty(), "{what}: {gap} over the floor: {told:?}");
            return;
        }
        if gap > MARGIN - 2.0 * slack - 1e-9 {
            return;
        }
        // The normal may be that of a body's face that leans a little: what slides along the floor then counts by that much.
        let tilts = told.iter().map(|(_, p)| p.normal.distance(self.floor.rotation * DVec3::Z));
        let tilt = tilts.fold(0.0, f64::max);
        assert!(tilt < 0.03, "{what}: {told:?}");
        let room = 1e-8 + 4.0 * slack * slack / shape.reach() + 4.0 * slack * tilt + tilt * tilt * MARGIN;
        // Of what is deep in the floor its depth is found to a part of it.
        let room = room + 0.02 * gap.min(0.0).abs();
        let lowest = told.iter().map(|(_, p)| p.separation).fold(f64::INFINITY, f64::min);
        let chosen = CHOICE * 2.0 * shape.reach();
        assert!(lowest >= gap - room && lowest < f64::INFINITY, "{what}: {lowest} told of {gap}: {told:?}");
        assert!(lowest <= gap + room + chosen, "{what}: {lowest} told of {gap}: {told:?}");
        for (m, p) in &told {
            assert_eq!(m.a, self.slab);
            // Its places are on both surfaces, and as far apart as it is told where the bodies stand.
            let (a, b) = (self.floor.point(p.on_a), pose.point(p.on_b));
            let errors = [self.height(a), shape.off(p.on_b), self.height(b) - self.height(a) - p.separation];
            let off = errors.iter().fold(0.0f64, |most, e| most.max(e.abs()));
            assert!(off <= room, "{what}: {errors:?} off: {p:?}");
            assert!(p.position.distance(0.5 * (a + b)) < 1e-12, "{what}: not in the middle: {p:?}");
        }
        *points += told.len();
    }
}

/// How far any of a body's points goes, at most.
fn way(from: &Pose, to: &Pose, reach: f64) -> f64 {
    let turn = to.rotation * from.rotation.conjugate();
    from.position.distance(to.position) + 2.0 * turn.xyz().length() * reach
}

#[test]
fn contacts_are_true_where_the_bodies_stand() {
    let scenes = sized("CONTACTD_CACHE_SCENES", 40);
    let (mut points, mut resting, mut asked) = (0, 0, 0);
    for seed in 0..scenes {
        let mut r = Random::new(seed);
        let slack = MARGIN * 10f64.powf(r.within(-4.0, -2.0));
        let mut scene = Scene::new(&mut r, slack);
        let lean = |r: &mut Random| r.direction() * LEANS[r.below(4)];
        let mut poses: Vec<Pose> = (0..3).map(|i| scene.over(i, MARGIN * r.within(-0.5, 1.3), lean(&mut r))).collect();
        for step in 0..12 {
            let still = poses.clone();
            // All at rest, one thrown somewhere, all creeping, all turning in place; what creeps leaves the slack sooner or later.
            let kind = r.below(4);
            for (i, pose) in poses.iter_mut().enumerate() {
                if kind == 1 && i == step % 3 {
                    *pose = scene.over(i, MARGIN * r.within(-0.5, 1.3), lean(&mut r));
                } else if kind >= 2 {
                    let by = slack * 10f64.powf(r.within(-3.0, 0.3));
                    let (way, turn) = if kind == 2 { (by, by) } else { (0.0, 4.0 * by) };
                    let turn = quat_of_rotation_vector(r.direction() * turn);
                    *pose = Pose::new(pose.position + r.direction() * way, (turn * pose.rotation).normalize());
                }
            }
            let requests = scene.step(&poses);
            let what = format!("scene {seed}, step {step}, slack {slack}");
            let ways = |k: usize| way(&still[k], &poses[k], scene.bodies[k].1.reach());
            let farthest = (0..3).map(ways).fold(0.0, f64::max);
            // From wherever a body was told last, it was no farther than the slack.
            let expected = step == 0 || farthest > 2.0 * slack * (1.0 + 1e-9);
            assert!(!expected || requests > 0, "{what}: nothing was asked, {farthest} gone");
            if step > 0 && farthest == 0.0 {
                assert_eq!(requests, 0, "{what}: asked though nothing has moved");
                resting += 1;
            }
            asked += u64::from(requests > 0);
            for (i, pose) in poses.iter().enumerate() {
                scene.judge(i, pose, slack, &format!("{what}, {:?}", scene.bodies[i].1), &mut points);
            }
        }
    }
    println!("{scenes} scenes: {points} points, {asked} steps that asked, {resting} at rest");
    assert!(points > 20 * scenes as usize && resting > scenes / 4 && asked > scenes);
}

#[test]
fn what_has_crept_by_less_than_the_slack_is_not_asked_about_and_carried_along() {
    let mut points = 0;
    for seed in 0..40 {
        let mut r = Random::new(seed);
        let slack = 1e-3 * MARGIN;
        let mut scene = Scene::new(&mut r, slack);
        let home: Vec<Pose> = (0..3).map(|i| scene.over(i, MARGIN * r.within(-0.4, 0.9), DVec3::ZERO)).collect();
        assert!(scene.step(&home) > 0);
        for step in 0..20 {
            let mut near = |i: usize| {
                // A ball's point does not go along with it.
                if let Shape::Ball(_) = scene.bodies[i].1 {
                    return home[i];
                }
                let (reach, by) = (scene.bodies[i].1.reach(), slack * r.within(0.0, 0.45));
                let turn = quat_of_rotation_vector(r.direction() * (by / reach));
                Pose::new(home[i].position + r.direction() * by, (turn * home[i].rotation).normalize())
            };
            let poses: Vec<Pose> = (0..3).map(&mut near).collect();
            assert_eq!(scene.step(&poses), 0, "scene {seed}, step {step}");
            for (i, pose) in poses.iter().enumerate() {
                scene.judge(
                    i,
                    pose,
                    slack,
                    &format!("scene {seed}, step {step}, {:?}", scene.bodies[i].1),
                    &mut points,
                );
            }
        }
        scene.cache.forget();
        assert!(scene.step(&home) > 0, "what is unknown is told");
        // One that rolls is told as soon as it does.
        for i in 0..3 {
            if !matches!(scene.bodies[i].1, Shape::Ball(_)) {
                continue;
            }
            let mut poses = home.clone();
            poses[i].position += scene.floor.rotation * DVec3::X * (1e-3 * slack);
            assert!(scene.step(&poses) > 0, "scene {seed}, ball {i}");
            scene.judge(i, &poses[i], 0.0, &format!("scene {seed}, ball {i}"), &mut points);
            scene.step(&home);
        }
    }
    assert!(points > 800, "{points} points");
}

/// A box that lies in the floor is told by where it would touch it, and is where it is for a ball that comes down on it.
#[test]
fn what_overlaps_stands_where_it_stands_for_others() {
    let slack = 1e-3 * MARGIN;
    let mut points = 0;
    for seed in 0..20 {
        let mut r = Random::new(seed);
        let mut scene = Scene::new(&mut r, slack);
        let deep = MARGIN * r.within(-0.8, -0.1);
        let mut poses: Vec<Pose> = (0..3).map(|i| scene.over(i, deep, DVec3::ZERO)).collect();
        let top = 2.0 * scene.bodies[0].1.support(DVec3::Z) + deep;
        let above = MARGIN * r.within(0.2, 0.8);
        poses[1] = scene.over(1, top + 1.0, DVec3::ZERO);
        assert_eq!(scene.step(&poses), 1);
        // Over the middle of the first body.
        let over = scene.over(1, top + above, DVec3::ZERO);
        poses[1] = Pose { position: over.position - scene.floor.rotation * (4.0 * DVec3::X), ..over };
        assert_eq!(scene.step(&poses), 1, "the first body lies where it lay");
        let (low, high) = (scene.bodies[0].0, scene.bodies[1].0);
        let told: Vec<Point> = scene.cache.contacts().filter(|(m, _)| (m.a, m.b) == (low, high)).map(|c| c.1).collect();
        let lowest = told.iter().map(|p| p.separation).fold(f64::INFINITY, f64::min);
        assert!((lowest - above).abs() < 1e-8, "scene {seed}: {lowest} told of {above}: {told:?}");
        scene.judge(0, &poses[0], slack, &format!("scene {seed}, {:?}", scene.bodies[0].1), &mut points);
    }
    assert!(points > 20);
}

const BLOCK: &str = "cube(size = [1, 1, 1], center = true);";

/// Bodies of one text at places, those of `fixed` fixed, in an order of their own; the contacts of one step, by their numbers.
fn told_once(text: &str, places: &[Pose], fixed: &[usize], order: &[usize]) -> Vec<([usize; 2], f64)> {
    let mut session = contactd::embedded(&contactd::ipc::ServerConfig::default()).unwrap();
    let model = session.load_model("body.csg", text).unwrap().id;
    let mut cache = ContactCache::new(0.0);
    let (mut objects, mut poses) = (vec![0; places.len()], Vec::new());
    for &i in order {
        let pose = places[i];
        let object = Object::new(&format!("body {i}"), model).at(pose);
        objects[i] = session.add_object(if fixed.contains(&i) { object.fixed() } else { object }).unwrap();
        if fixed.contains(&i) {
            cache.add_fixed(objects[i], pose);
        } else {
            cache.add_moving(objects[i], 1.0);
            poses.push(pose);
        }
    }
    ask_for_patches(&mut session);
    ask(&mut session, &mut cache, &poses);
    let place = |object: u32| objects.iter().position(|o| *o == object).expect("one of them");
    let told = cache.contacts().map(|(m, p)| {
        let [a, b] = [place(m.a), place(m.b)];
        ([a.min(b), a.max(b)], p.separation)
    });
    assert_eq!(cache.asked().requests, 1);
    told.collect()
}

/// The same of blocks of side 1 over each other at heights.
fn pile(heights: &[f64], fixed: &[usize], order: &[usize]) -> Vec<([usize; 2], f64)> {
    // Each is turned by a little about the axis, so that no corner lies over another one.
    let turn = |i: usize| quat_of_rotation_vector(DVec3::Z * 0.1 * i as f64);
    let places: Vec<Pose> = heights.iter().enumerate().map(|(i, z)| Pose::new(DVec3::Z * *z, turn(i))).collect();
    told_once(BLOCK, &places, fixed, order)
}

/// Balls in overlap with each other, in chains and in rings: each pair is told as if it were alone.
#[test]
fn balls_in_overlap_are_told_as_each_pair_by_itself() {
    for seed in 0..sized("CONTACTD_CACHE_SCENES", 12u64) {
        let mut r = Random::new(5_000 + seed);
        let mut deep = || 1.0 - MARGIN * r.within(0.05, 1.0);
        // A triangle, whose third side closes it, and a chain from there.
        let (p, q, s) = (deep(), deep(), deep());
        let x = (p * p + q * q - s * s) / (2.0 * p);
        let mut centers = vec![DVec3::ZERO, dvec3(p, 0.0, 0.0), dvec3(x, (q * q - x * x).sqrt(), 0.0)];
        centers.push(centers[2] + dvec3(0.3, 0.8, 0.4).normalize() * deep());
        centers.push(centers[3] + dvec3(-0.5, 0.7, -0.4).normalize() * deep());
        let places: Vec<Pose> = centers.iter().map(|c| Pose::at(*c)).collect();
        let told = told_once("sphere(r = 0.5);", &places, &[], &[0, 1, 2, 3, 4]);
        assert_eq!(told.len(), 5, "seed {seed}: {told:?}");
        for ([a, b], separation) in told {
            let truth = centers[a].distance(centers[b]) - 1.0;
            assert!((separation - truth).abs() < 1e-8, "seed {seed}, {a} and {b}: {separation}, {truth}");
        }
    }
}

/// Four points for each two neighbours, as deep as they are.
fn expect_faces(told: &[([usize; 2], f64)], heights: &[f64], what: &str) {
    for i in 1..heights.len() {
        let deep = heights[i] - heights[i - 1] - 1.0;
        let own: Vec<f64> = told.iter().filter(|t| t.0 == [i - 1, i]).map(|t| t.1).collect();
        assert!(own.len() == 4 && own.iter().all(|s| (s - deep).abs() < 1e-8), "{what}, pair {i}: {own:?}, {deep}");
    }
    assert_eq!(told.len(), 4 * (heights.len() - 1), "{what}: {told:?}");
}

/// In a pile that has sunk into itself every two neighbours are told by their faces, whatever order the bodies were added in, and
/// whether it stands on something fixed or on nothing.
#[test]
fn a_pile_in_overlap_is_told_by_the_faces_between() {
    for seed in 0..sized("CONTACTD_CACHE_SCENES", 12u64) {
        let mut r = Random::new(4_000 + seed);
        let mut heights = vec![0.0];
        for _ in 0..2 + r.below(6) {
            heights.push(heights[heights.len() - 1] + 1.0 - MARGIN * r.within(0.01, 0.9));
        }
        let mut order: Vec<usize> = (0..heights.len()).collect();
        for k in (1..order.len()).rev() {
            order.swap(k, r.below(k + 1));
        }
        let fixed: &[usize] = if r.chance(0.7) { &[0] } else { &[] };
        expect_faces(&pile(&heights, fixed, &order), &heights, &format!("seed {seed}, {order:?}"));
    }
}

/// A body between two that are fixed, and in both: no place is free of both.
#[test]
fn a_body_that_is_held_from_both_sides_is_told_by_both_faces() {
    for order in [[0, 1, 2], [1, 0, 2], [2, 1, 0]] {
        let heights = [0.0, 1.0 - 0.5 * MARGIN, 2.0 - 1.2 * MARGIN];
        expect_faces(&pile(&heights, &[0, 2], &order), &heights, &format!("{order:?}"));
    }
}

/// An edge or a corner deeper in a floor than the ball within it: told as deep as it is, by all points that are.
#[test]
fn edges_and_corners_are_told_as_deep_as_they_are() {
    for (lean, points) in [(DVec3::X * FRAC_PI_4, 2), (DVec3::Y * 0.2, 2), (dvec3(0.3, 0.5, 0.0), 1)] {
        for deep in [0.1, 1.0, 10.0, 30.0] {
            let mut r = Random::new(77);
            let mut scene = Scene::new(&mut r, 0.0);
            while !matches!(scene.bodies[0].1, Shape::Cuboid(_)) {
                scene = Scene::new(&mut r, 0.0);
            }
            let poses: Vec<Pose> = (0..3)
                .map(|i| if i == 0 { scene.over(0, -deep * MARGIN, lean) } else { scene.over(i, 9.0, lean) })
                .collect();
            scene.step(&poses);
            let told: Vec<f64> = scene.cache.contacts().map(|c| c.1.separation).collect();
            let least = told.iter().copied().fold(f64::INFINITY, f64::min);
            let what = format!("{deep} margins, {lean}: {told:?}");
            assert!((least + deep * MARGIN).abs() < 1e-8 && told.len() == points, "{what}");
        }
    }
}
