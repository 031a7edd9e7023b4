//! rapier with contactd's contacts: what rests stays, and what has a hole is fallen through.
#![allow(missing_docs)]

use contactd::ipc::Embedded;
use contactd_rapier::{Coupling, Settings};
use parry3d_f64::query::{ContactManifold as Manifold, PersistentQueryDispatcher, QueryDispatcher};
use rapier3d_f64::prelude::*;
use std::sync::Mutex;

const GRAVITY: Vector = Vector::new(0.0, 0.0, -9.81);
/// A plate with its upper face at z = 0, a hole in its middle.
const DRILLED: &str =
    "difference() { cube(size = [6, 6, 1], center = true); cylinder(h = 3, r1 = 0.55, r2 = 0.55, center = true); }";

struct Scene {
    coupling: Coupling<Embedded>,
    world: PhysicsWorld,
}

impl Scene {
    fn new(plate: &str) -> Self {
        let session = contactd::embedded(&contactd::ipc::ServerConfig::default()).unwrap();
        let mut coupling = Coupling::new(session, Settings::default()).unwrap();
        let mut world = coupling.world(GRAVITY);
        let plate = coupling.load("plate.csg", plate).unwrap();
        let plate = coupling.fixed("plate", &plate, &Pose::translation(0.0, 0.0, -0.5)).unwrap();
        world.insert_collider(plate.friction(0.6), None);
        Self { coupling, world }
    }

    fn add(&mut self, text: &str, body: RigidBodyBuilder) -> RigidBodyHandle {
        let model = self.coupling.load("body.csg", text).unwrap();
        let collider = self.coupling.moving("body", &model).unwrap().friction(0.6);
        self.world.insert(body, collider).0
    }

    fn step(&mut self) {
        self.coupling.step(&mut self.world).unwrap();
    }

    fn pose(&self, body: RigidBodyHandle) -> Pose {
        *self.world.bodies[body].position()
    }
}

fn at(x: f64, y: f64, z: f64) -> RigidBodyBuilder {
    RigidBodyBuilder::dynamic().translation(Vector::new(x, y, z)).can_sleep(false)
}

#[test]
fn a_box_on_a_plate_rests_for_ten_seconds() {
    let mut s = Scene::new(DRILLED);
    let body = s.add("cube(size = [1.5, 1.5, 0.5], center = true);", at(0.1, 0.2, 0.255));
    let ids = |s: &Scene| -> Vec<u32> {
        s.coupling.manifolds().pairs().flat_map(|p| p.points.iter().map(|q| q.id)).collect()
    };
    for _ in 0..60 {
        s.step();
    }
    let (rest, first) = (s.pose(body), ids(&s));
    let mut drift = 0.0f64;
    let mut turn = 0.0f64;
    for step in 60..600 {
        s.step();
        let pose = s.pose(body);
        drift = drift.max((pose.translation - rest.translation).length());
        turn = turn.max(pose.rotation.angle_between(rest.rotation));
        assert_eq!(ids(&s), first, "step {step}");
    }
    let gap = rest.translation.z - 0.25;
    println!("gap {gap:e}, drift {drift:e}, turn {turn:e} in 9 s; points {first:?}");
    assert_eq!(first.len(), 4);
    assert!(gap > 5e-4 && gap < 1.1e-3, "{gap}");
    assert!(drift < 1e-6 && turn < 1e-6, "{drift:e}, {turn:e}");
    // Before the solver writes new ones, the points have the impulses of the step before: those of its last sub-step, which hold the weight.
    let mass = s.world.bodies[body].mass();
    assert!((mass - 1.125).abs() < 1e-9);
    for (_, collider) in s.world.colliders.iter_mut() {
        collider.set_active_hooks(ActiveHooks::MODIFY_SOLVER_CONTACTS);
    }
    let started = Started::default();
    s.coupling.prefetch(&s.world.bodies, &s.world.colliders).unwrap();
    s.world.step_with_events(&started, &());
    let found = started.0.into_inner().unwrap();
    let p = s.world.integration_parameters;
    let weight = mass * 9.81 * p.dt / p.num_solver_iterations as f64;
    println!("started from {found:?}, the weight is {weight}");
    assert_eq!(found.len(), 4);
    assert!((found.iter().sum::<f64>() - weight).abs() < 1e-3 * weight, "{found:?}, the weight is {weight}");
}

/// What the solver starts from: each point's impulse as it comes out of the narrow phase.
#[derive(Default)]
struct Started(Mutex<Vec<f64>>);

impl PhysicsHooks for Started {
    fn modify_solver_contacts(&self, context: &mut ContactModificationContext) {
        if let ModifiableContacts::Rigid(found) = &context.contacts {
            self.0.lock().unwrap().extend(found.manifold.points.iter().map(|p| p.data.warmstart_impulse));
        }
    }
}

#[test]
fn a_ball_falls_through_the_hole_that_is_there() {
    let mut s = Scene::new(DRILLED);
    let rolling = |b: RigidBodyBuilder| b.linvel(Vector::new(1.0, 0.0, 0.0)).angvel(Vector::new(0.0, 2.5, 0.0));
    let ball = s.add("sphere(r = 0.4);", rolling(at(-1.5, 0.0, 0.401)));
    // The same in rapier's own shapes: the convex hull of the plate.
    let mut stock = PhysicsWorld { gravity: GRAVITY, ..PhysicsWorld::default() };
    stock.insert_collider(ColliderBuilder::cuboid(3.0, 3.0, 0.5).translation(Vector::new(0.0, 0.0, -0.5)), None);
    let (other, _) = stock.insert(rolling(at(-1.5, 0.0, 0.401)), ColliderBuilder::ball(0.4));
    let mut ids = Vec::new();
    for _ in 0..150 {
        s.step();
        stock.step();
        if s.pose(ball).translation.x < -0.6 {
            ids.extend(s.coupling.manifolds().pairs().flat_map(|p| p.points.iter().map(|q| q.id)));
        }
    }
    let (through, over) = (s.pose(ball).translation, stock.bodies[other].translation());
    println!("through: {through}, over: {over}");
    assert!(through.z < -2.0, "{through}");
    assert!(over.z > 0.35 && over.x > 0.7, "{over}");
    assert!(ids.len() > 40 && ids.iter().all(|id| *id == ids[0]), "one point rolls: {ids:?}");
}

#[test]
fn a_pin_goes_into_its_hole_and_rests_on_its_shoulder() {
    let mut s = Scene::new(DRILLED);
    let pin = "union() { cylinder(h = 2, r1 = 0.5, r2 = 0.5, center = true);
        multmatrix([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]]) { cylinder(h = 0.4, r1 = 1, r2 = 1); } }";
    let body = s.add(pin, at(0.01, 0.005, 1.2));
    for _ in 0..240 {
        s.step();
    }
    let first = s.pose(body);
    for _ in 0..60 {
        s.step();
    }
    let last = s.pose(body);
    let drift = (last.translation - first.translation).length();
    println!("{last:?}, drift {drift:e} in 1 s");
    // The shoulder is at the height 1 of the pin, the plate's face at 0.
    let gap = last.translation.z + 1.0;
    assert!(gap > 5e-4 && gap < 1.1e-3, "{last:?}");
    assert!(drift < 1e-5 && last.rotation.angle_between(Pose::IDENTITY.rotation) < 1e-3, "{drift:e} {last:?}");
}

#[test]
fn an_impact_that_goes_deep_is_taken_back_to_its_face() {
    let mut s = Scene::new(DRILLED);
    // 12 m/s: .2 in a step, more than the prediction.
    let body =
        s.add("cube(size = [1.5, 1.5, 0.5], center = true);", at(0.1, 0.2, 0.4).linvel(Vector::new(0.0, 0.0, -12.0)));
    let mut deepest = 0.0f64;
    for _ in 0..180 {
        s.step();
        let all = s.coupling.manifolds().pairs().flat_map(|m| m.points.iter().map(|p| p.separation));
        deepest = all.fold(deepest, f64::min);
    }
    let pose = s.pose(body);
    println!("{pose:?}, {deepest} deep");
    assert!(deepest < -0.02);
    assert!((pose.translation.z - 0.25).abs() < 2e-3 && pose.rotation.angle_between(Pose::IDENTITY.rotation) < 1e-3);
}

/// A table is asked for its pairs in either order, and by whoever moves its bodies on.
#[test]
fn either_order_of_a_pair_is_the_same_contact() {
    let mut s = Scene::new(DRILLED);
    let body = s.add("cube(size = [1.5, 1.5, 0.5], center = true);", at(0.1, 0.15, 0.252));
    s.coupling.prefetch(&s.world.bodies, &s.world.colliders).unwrap();
    let dispatcher = s.coupling.dispatcher();
    let shapes: Vec<SharedShape> = s.world.colliders.iter().map(|(_, c)| c.shared_shape().clone()).collect();
    let [plate, cube] = &shapes[..] else { panic!("two colliders") };
    let pos12 = Pose::translation(0.0, 0.0, -0.5).inv_mul(&s.pose(body));
    // Moved on by 1e-4: the distances are those of now.
    let pos12 = Pose::translation(0.0, 0.0, -1e-4) * pos12;
    let ask = |pos: &Pose, g1: &SharedShape, g2: &SharedShape, found: &mut Vec<Manifold<(), u32>>| {
        dispatcher.contact_manifolds(pos, &**g1, &**g2, 0.1, found, &mut None).unwrap();
    };
    let (mut there, mut back) = (Vec::new(), Vec::new());
    ask(&pos12, plate, cube, &mut there);
    ask(&pos12.inverse(), cube, plate, &mut back);
    assert_eq!((there.len(), back.len(), there[0].points.len()), (1, 1, 4));
    let near = |p: Vector, q: Vector| (p - q).length() < 1e-12;
    assert!(near(there[0].local_n1, Vector::Z) && near(there[0].local_n2, -Vector::Z));
    assert!(near(there[0].local_n1, back[0].local_n2) && near(there[0].local_n2, back[0].local_n1));
    for (p, q) in there[0].points.iter().zip(&back[0].points) {
        assert!(near(p.local_p1, q.local_p2) && near(p.local_p2, q.local_p1) && p.fid1 == q.fid1);
        assert!((p.dist - 1.9e-3).abs() < 1e-9 && (q.dist - p.dist).abs() < 1e-12, "{} {}", p.dist, q.dist);
    }
    // What a point holds goes on with its id, even from another manifold.
    for (k, p) in there[0].points.iter_mut().enumerate() {
        p.data = 7 + k as u32;
    }
    there.insert(0, Manifold::new());
    ask(&pos12, plate, cube, &mut there);
    assert_eq!(there.len(), 2);
    assert_eq!(there[0].points.iter().map(|p| p.data).collect::<Vec<_>>(), [7, 8, 9, 10]);
    assert!(there[1].points.is_empty());
    // Out of reach, sensors, and what is not served.
    dispatcher.contact_manifolds(&pos12, &**plate, &**cube, 1e-3, &mut there, &mut None).unwrap();
    assert!(there.iter().all(|m| m.points.is_empty()));
    let meets = |pos: &Pose| dispatcher.intersection_test(pos, &**plate, &**cube).unwrap().intersecting;
    assert!(!meets(&pos12) && meets(&(Pose::translation(0.0, 0.0, -3e-3) * pos12)));
    assert!(dispatcher.distance(&pos12, &**plate, &**cube).is_err());
    assert!(dispatcher.intersection_test(&pos12, &**plate, &Ball::new(1.0)).is_err());
}

/// rapier's contacts yield under load, here by more than the gap: boxes of its own and solids do so alike, apart and in overlap, until
/// all sleep.
#[test]
fn a_stack_stands_as_rapiers_own_does_and_then_asks_nothing() {
    let mut s = Scene::new(DRILLED);
    let mut stock = PhysicsWorld { gravity: GRAVITY, ..PhysicsWorld::default() };
    stock.integration_parameters = s.world.integration_parameters;
    let skin = 0.5 * Settings::default().gap;
    let cuboid = |x: f64, y: f64, z: f64| ColliderBuilder::cuboid(x, y, z).contact_skin(skin).friction(0.6);
    stock.insert_collider(cuboid(3.0, 3.0, 0.5).translation(Vector::new(0.0, 0.0, -0.5)), None);
    let heights = [0, 1, 2].map(|k| 0.251 + 0.501 * f64::from(k));
    let own = heights.map(|z| stock.insert(at(0.1, 0.15, z), cuboid(0.75, 0.75, 0.25)).0);
    let text = "cube(size = [1.5, 1.5, 0.5], center = true);";
    let bodies = heights.map(|z| s.add(text, at(0.1, 0.15, z).can_sleep(true)));
    let may_sleep_after = |s: &mut Scene, seconds: f64| {
        for body in bodies {
            s.world.bodies[body].activation_mut().time_until_sleep = seconds;
        }
    };
    may_sleep_after(&mut s, f64::INFINITY);
    let under = |z: [f64; 3]| [z[0] - 0.25, z[1] - z[0] - 0.5, z[2] - z[1] - 0.5];
    let mut worst = [0.0f64; 3];
    for step in 0..260 {
        s.step();
        stock.step();
        let found = under(bodies.map(|b| s.pose(b).translation.z));
        let theirs = under(own.map(|b| stock.bodies[b].translation().z));
        // They fall, a ten thousandth aslant, and settle; then they stand.
        if step >= 40 {
            for ((worst, p), q) in worst.iter_mut().zip(found).zip(theirs) {
                *worst = worst.max((p - q).abs());
            }
        }
        if step % 100 == 99 {
            println!("step {step}: gaps {found:?}, rapier's own {theirs:?}");
        }
    }
    println!("differ by {worst:?} at most from step 40 on");
    assert!(worst.iter().all(|w| *w < 3e-5), "{worst:?}");
    may_sleep_after(&mut s, 0.5);
    for _ in 0..60 {
        s.step();
    }
    assert!(bodies.iter().all(|b| s.world.bodies[*b].is_sleeping()));
    let asked = s.coupling.requests();
    for _ in 0..10 {
        s.step();
    }
    assert_eq!(s.coupling.requests(), asked, "all sleep");
}

#[test]
fn shapes_of_rapiers_own_meet_as_ever() {
    let mut s = Scene::new(DRILLED);
    s.world.insert_collider(ColliderBuilder::cuboid(1.0, 1.0, 0.5).translation(Vector::new(20.0, 0.0, -0.5)), None);
    let (ball, _) = s.world.insert(at(20.0, 0.0, 0.6), ColliderBuilder::ball(0.5));
    for _ in 0..120 {
        s.step();
    }
    assert!((s.world.bodies[ball].translation().z - 0.5).abs() < 6e-3);
}

#[test]
fn bad_lengths_and_models_are_refused() {
    let session = || contactd::embedded(&contactd::ipc::ServerConfig::default()).unwrap();
    for settings in
        [Settings { gap: 0.0, ..Settings::default() }, Settings { prediction: f64::NAN, ..Settings::default() }]
    {
        assert!(Coupling::new(session(), settings).is_err());
    }
    let mut coupling = Coupling::new(session(), Settings::default()).unwrap();
    let error = coupling.load("bad.csg", "sphere(r = ;").unwrap_err().to_string();
    assert!(error.contains("bad.csg"), "{error}");
}
