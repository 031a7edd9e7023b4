//! What is asked of the session: a second time for the pairs that rapier solves alone, and anew after a request that failed.
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
    /// Answers that come before.
    first: usize,
}

impl Flaky {
    fn fails(&mut self, error: Error, first: usize) {
        (self.fails, self.first) = (Some(error), first);
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
        if self.first > 0 {
            self.first -= 1;
        } else if let Some(error) = self.fails.take() {
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
        let engine = Flaky { engine: Embedded::new(&ServerConfig::default()), fails: None, first: 0 };
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

/// Two boxes that overlap by 10 cm, high over the plate, made what `make` makes of the second one's collider.
fn overlapping(make: impl FnOnce(&mut Scene, ColliderHandle, ColliderHandle)) -> Scene {
    let mut s = Scene::new();
    let (_, first) = s.add(5.0);
    let (_, second) = s.add(5.9);
    make(&mut s, first, second);
    s.prefetch().unwrap();
    assert!(!s.points().is_empty(), "the overlap is reported");
    s
}

#[test]
fn pairs_that_rapier_solves_alone_are_asked_about_again() {
    assert_eq!(overlapping(|_, _, _| ()).coupling.retracted(), 1);
    let alone = InteractionGroups::none();
    type Make<'m> = (&'m str, &'m dyn Fn(&mut Scene, ColliderHandle, ColliderHandle));
    let kinds: [Make<'_>; 8] = [
        ("a sensor", &|s, _, second| s.world.colliders[second].set_sensor(true)),
        ("disabled", &|s, first, _| s.world.colliders[first].set_enabled(false)),
        ("collision groups", &|s, first, _| s.world.colliders[first].set_collision_groups(alone)),
        ("solver groups", &|s, _, second| s.world.colliders[second].set_solver_groups(alone)),
        ("removed", &|s, _, second| {
            // Asked for while it was there; the session still has it.
            s.prefetch().unwrap();
            assert_eq!(s.coupling.retracted(), 1);
            s.world.remove_collider(second);
        }),
        ("not inserted yet", &|s, first, second| {
            for handle in [first, second] {
                s.world.remove_collider(handle);
            }
            // Both are made where nothing has moved them yet: at the origin, in the plate and in each other.
            let (one, _) = (s.collider("one"), s.collider("two"));
            let body = RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 0.0, 9.0));
            s.world.insert(body, one);
        }),
        ("of one body", &|s, first, second| {
            let body = s.world.colliders[first].parent();
            let colliders = &mut s.world.colliders;
            colliders.set_parent(second, body, &mut s.world.bodies);
            colliders[second].set_position_wrt_parent(Pose::translation(0.0, 0.0, 0.9));
        }),
        ("both kinematic", &|s, first, second| {
            for handle in [first, second] {
                let body = s.world.colliders[handle].parent().unwrap();
                s.world.bodies[body].set_body_type(RigidBodyType::KinematicPositionBased, true);
            }
        }),
    ];
    for (kind, make) in kinds {
        let before = u64::from(kind == "removed");
        assert_eq!(overlapping(make).coupling.retracted(), before, "{kind}");
    }
}

/// A box that was driven into the plate within a room-sized trigger: it is moved out of the plate, not out of the trigger.
#[test]
fn a_trigger_takes_no_points_away() {
    let mut s = Scene::new();
    let room = s.coupling.load("room.csg", "cube(size = [10, 10, 10], center = true);").unwrap();
    let room = s.coupling.fixed("room", &room, &Pose::translation(0.0, 0.0, 4.0)).unwrap().sensor(true);
    let room = s.world.insert_collider(room, None);
    let (body, collider) = s.add(0.502);
    for step in 0..3 {
        s.coupling.step(&mut s.world).unwrap();
        assert_eq!(s.coupling.retracted(), 0, "step {step}");
    }
    assert_eq!(s.world.narrow_phase.intersection_pair(room, collider), Some(true));
    s.world.bodies[body].set_translation(Vector::new(0.1, 0.2, 0.48), true);
    s.prefetch().unwrap();
    assert_eq!(s.coupling.retracted(), 1);
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
            s.coupling.session().transport_mut().fails(error.clone(), 0);
            let pose = *s.world.bodies[body].position();
            assert_eq!(s.coupling.step(&mut s.world), Err(error.clone()));
            assert_eq!((s.points(), *s.world.bodies[body].position()), (kept.clone(), pose), "{error}");
        }
        // What is late may be late again.
        if error == Error::Timeout {
            s.coupling.session().transport_mut().fails(error.clone(), 0);
            assert_eq!(s.coupling.step(&mut s.world), Err(error));
        }
        for _ in 0..10 {
            s.coupling.step(&mut s.world).unwrap();
            assert_eq!(s.points(), kept);
        }
    }
}

#[test]
fn a_second_request_that_fails_leaves_the_depth() {
    for error in [Error::Timeout, Error::System("it failed".into())] {
        let (mut s, body) = turned_over();
        let kept = s.points();
        s.world.bodies[body].set_translation(Vector::new(2.0, 0.2, 0.48), true);
        s.coupling.session().transport_mut().fails(error.clone(), 1);
        assert_eq!(s.prefetch(), Err(error));
        assert_eq!(s.points().len(), 1);
        // Where it was moved to for the second request is not where it is.
        s.prefetch().unwrap();
        assert_eq!(s.points().len(), kept.len());
        let pair = s.coupling.manifolds().pairs().next().unwrap();
        assert!(pair.points.iter().all(|p| (p.separation - 5e-4).abs() < 1e-4), "half a gap out: {pair:?}");
        assert_eq!(s.world.narrow_phase.contact_pairs().count(), 0, "rapier was not asked yet");
        s.coupling.step(&mut s.world).unwrap();
        let pair = s.world.narrow_phase.contact_pairs().next().unwrap();
        let found: Vec<f64> = pair.manifolds().iter().flat_map(|m| m.points.iter().map(|p| p.dist)).collect();
        assert!(found.len() == 4 && found.iter().all(|dist| (dist + 0.02).abs() < 1e-3), "{found:?}");
    }
}
