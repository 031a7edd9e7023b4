//! rapier with contactd's contacts: what rests stays, and what has a hole is fallen through.
#![allow(missing_docs)]

use contactd::ipc::Embedded;
use contactd_rapier::{Coupling, Settings};
use rapier3d_f64::prelude::*;

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
        self.world.insert(body.can_sleep(false), collider).0
    }

    fn step(&mut self) {
        self.coupling.step(&mut self.world).unwrap();
    }

    fn pose(&self, body: RigidBodyHandle) -> Pose {
        *self.world.bodies[body].position()
    }
}

fn at(x: f64, y: f64, z: f64) -> RigidBodyBuilder {
    RigidBodyBuilder::dynamic().translation(Vector::new(x, y, z))
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
    println!(
        "gap {gap:e}, drift {drift:e}, turn {turn:e} in 9 s; points {first:?}, {} second requests",
        s.coupling.retracted()
    );
    assert_eq!(first.len(), 4);
    assert!(gap > 5e-4 && gap < 1.1e-3, "{gap}");
    assert!(drift < 1e-6 && turn < 1e-6, "{drift:e}, {turn:e}");
    // The solver finds its impulses of the step before: they hold the weight, in steps of 1/60 s.
    let mass = s.world.bodies[body].mass();
    assert!((mass - 1.125).abs() < 1e-9);
    let pair = s.world.narrow_phase.contact_pairs().next().unwrap();
    let points = pair.manifolds().iter().flat_map(|m| m.points.iter());
    let held: f64 = points.map(|p| p.data.warmstart_impulse).sum();
    assert!(held > 0.0, "nothing to start from");
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
    println!("{last:?}, drift {drift:e} in 1 s, {} second requests", s.coupling.retracted());
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
    for _ in 0..180 {
        s.step();
    }
    let pose = s.pose(body);
    println!("{pose:?} after {} second requests", s.coupling.retracted());
    assert!(s.coupling.retracted() > 0);
    assert!((pose.translation.z - 0.25).abs() < 2e-3 && pose.rotation.angle_between(Pose::IDENTITY.rotation) < 1e-3);
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
