//! What is asked of the session: anew after a request that failed.
#![allow(missing_docs)]

use contactd::ipc::{Embedded, ServerConfig};
use contactd_client::proto::control::{Answer, Command};
use contactd_client::proto::{ContactRecord, PoseRecord, StepReply, StepRequest};
use contactd_client::transport::{Opened, Transport};
use contactd_client::{Error, Session};
use contactd_rapier::{Coupling, Settings};
use rapier3d_f64::prelude::*;
use std::time::Duration;

const GRAVITY: Vector = Vector::new(0.0, 0.0, -9.81);
const PLATE: &str = "cube(size = [6, 6, 1], center = true);";
const BOX: &str = "cube(size = [1, 1, 1], center = true);";

/// An engine whose answers fail, one at a time, as they are told to.
struct Flaky {
    engine: Embedded,
    fails: Option<Error>,
}

impl Flaky {
    fn fails(&mut self, error: Error) {
        self.fails = Some(error);
    }
}

impl Transport for Flaky {
    fn may_lose_server(&self) -> bool {
        false
    }

    fn open(&mut self) -> Result<Opened, Error> {
        self.engine.open()
    }

    fn command(&mut self, command: Command, timeout: Duration) -> Result<Answer, Error> {
        self.engine.command(command, timeout)
    }

    fn loan(&mut self, records: usize) -> Result<&mut [PoseRecord], Error> {
        self.engine.loan(records)
    }

    fn loaned(&self) -> &[PoseRecord] {
        self.engine.loaned()
    }

    fn loaned_mut(&mut self) -> &mut [PoseRecord] {
        self.engine.loaned_mut()
    }

    fn send(&mut self, request: StepRequest) -> Result<(), Error> {
        self.engine.send(request)
    }

    fn receive(&mut self, timeout: Duration) -> Result<(), Error> {
        if let Some(error) = self.fails.take() {
            return Err(error);
        }
        self.engine.receive(timeout)
    }

    fn reply(&self) -> Option<(&StepReply, &[ContactRecord])> {
        self.engine.reply()
    }
}

struct Scene {
    coupling: Coupling<Flaky>,
    world: PhysicsWorld,
}

impl Scene {
    /// A plate with its upper face at z = 0.
    fn new() -> Self {
        let engine = Flaky { engine: Embedded::new(&ServerConfig::default()), fails: None };
        let mut coupling = Coupling::new(Session::new(engine).unwrap(), Settings::default()).unwrap();
        let mut world = coupling.world(GRAVITY);
        let plate = coupling.load("plate.csg", PLATE).unwrap();
        let plate = coupling.fixed("plate", &plate, &Pose::translation(0.0, 0.0, -0.5)).unwrap();
        world.insert_collider(plate, None);
        Self { coupling, world }
    }

    fn collider(&mut self, name: &str) -> ColliderBuilder {
        let model = self.coupling.load("box.csg", BOX).unwrap();
        self.coupling.moving(name, &model).unwrap()
    }

    fn add(&mut self, z: f64) -> (RigidBodyHandle, ColliderHandle) {
        let collider = self.collider("body");
        self.world.insert(RigidBodyBuilder::dynamic().translation(Vector::new(0.1, 0.2, z)).can_sleep(false), collider)
    }

    fn prefetch(&mut self) -> Result<(), Error> {
        self.coupling.prefetch(&self.world.bodies, &self.world.colliders)
    }

    /// Objects and ids of all points.
    fn points(&self) -> Vec<([u32; 2], u32)> {
        self.coupling.manifolds().pairs().flat_map(|m| m.points.iter().map(move |p| ([m.a, m.b], p.id))).collect()
    }
}

/// A box that was driven into the plate within a room-sized trigger: it has the points of the plate.
#[test]
fn a_trigger_takes_no_points_away() {
    let mut s = Scene::new();
    let room = s.coupling.load("room.csg", "cube(size = [10, 10, 10], center = true);").unwrap();
    let room = s.coupling.fixed("room", &room, &Pose::translation(0.0, 0.0, 4.0)).unwrap().sensor(true);
    let room = s.world.insert_collider(room, None);
    let (body, collider) = s.add(0.502);
    for _ in 0..3 {
        s.coupling.step(&mut s.world).unwrap();
    }
    assert_eq!(s.world.narrow_phase.intersection_pair(room, collider), Some(true));
    s.world.bodies[body].set_translation(Vector::new(0.1, 0.2, 0.48), true);
    s.prefetch().unwrap();
    // Of the plate, object 1, and the box, object 3.
    assert_eq!(s.points().iter().filter(|p| p.0 == [1, 3]).count(), 4);
}

/// Turned over, so that its points have ids from 4 on.
fn turned_over() -> (Scene, RigidBodyHandle) {
    let mut s = Scene::new();
    let (body, _) = s.add(0.5005);
    s.prefetch().unwrap();
    let over = Pose::from_parts(Vector::new(2.0, 0.2, 0.5005), Rotation::from_rotation_x(std::f64::consts::PI));
    s.world.bodies[body].set_position(over, true);
    s.prefetch().unwrap();
    assert_eq!(s.points().iter().map(|p| p.1).collect::<Vec<_>>(), [4, 5, 6, 7]);
    (s, body)
}

#[test]
fn a_request_that_fails_changes_nothing() {
    for error in [Error::Timeout, Error::System("it failed".into())] {
        let (mut s, body) = turned_over();
        let kept = s.points();
        for _ in 0..2 {
            s.coupling.session().transport_mut().fails(error.clone());
            let pose = *s.world.bodies[body].position();
            assert_eq!(s.coupling.step(&mut s.world), Err(error.clone()));
            assert_eq!((s.points(), *s.world.bodies[body].position()), (kept.clone(), pose), "{error}");
        }
        // What is late may be late again.
        if error == Error::Timeout {
            s.coupling.session().transport_mut().fails(error.clone());
            assert_eq!(s.coupling.step(&mut s.world), Err(error));
        }
        for _ in 0..10 {
            s.coupling.step(&mut s.world).unwrap();
            assert_eq!(s.points(), kept);
        }
    }
}
