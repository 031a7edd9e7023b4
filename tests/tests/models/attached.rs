//! Parts that are attached, detached, moved, given frames and removed in any order stand where matrices of the test's own have them.
//!
//! `CONTACTD_ATTACHED=2000 cargo test --release -p contactd-tests --test models attached::` sets the number of random sessions (20).

use super::load::{one_joint, served};
use super::robots::{Arm, turn};
use contactd::ipc::{Embedded, ServerConfig};
use contactd::load::{LoadOptions, LoadScene};
use contactd_client::solid::{cuboid, sphere};
use contactd_client::transport::{Opened, Transport};
use contactd_client::{Error, Frame, Object, Session};
use contactd_proto::control::{Answer, Command};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::query::{PointOptions, Side};
use contactd_proto::{ContactRecord, Pose, PoseRecord, StepReply, StepRequest};
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::{DMat4, DVec3};
use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(60);

fn matrix(pose: &Pose) -> DMat4 {
    DMat4::from_rotation_translation(pose.rotation, pose.position)
}

fn pose(r: &mut Random) -> Pose {
    Pose::new(r.vector(3.0), quat_of_rotation_vector(r.vector(2.0)))
}

/// A box as the test has it.
struct Thing {
    id: u32,
    sizes: DVec3,
    /// Its model in the world, and in its own frame.
    world: DMat4,
    own: DMat4,
    /// Index of what it was attached to.
    carrier: Option<usize>,
}

/// An engine to which commands get lost now and then, before anything is done.
struct Flaky {
    inner: Embedded,
    /// Commands until the one that is lost.
    left: Rc<Cell<Option<u32>>>,
}

impl Transport for Flaky {
    fn may_lose_server(&self) -> bool {
        self.inner.may_lose_server()
    }
    fn open(&mut self) -> Result<Opened, Error> {
        self.inner.open()
    }
    fn command(&mut self, command: Command, timeout: Duration) -> Result<Answer, Error> {
        match self.left.get() {
            Some(0) => {
                self.left.set(None);
                Err(Error::System("lost".into()))
            }
            left => {
                self.left.set(left.map(|n| n - 1));
                self.inner.command(command, timeout)
            }
        }
    }
    fn loan(&mut self, records: usize) -> Result<&mut [PoseRecord], Error> {
        self.inner.loan(records)
    }
    fn loaned(&self) -> &[PoseRecord] {
        self.inner.loaned()
    }
    fn loaned_mut(&mut self) -> &mut [PoseRecord] {
        self.inner.loaned_mut()
    }
    fn send(&mut self, request: StepRequest) -> Result<(), Error> {
        self.inner.send(request)
    }
    fn receive(&mut self, timeout: Duration) -> Result<(), Error> {
        self.inner.receive(timeout)
    }
    fn reply(&self) -> Option<(&StepReply, &[ContactRecord])> {
        self.inner.reply()
    }
}

struct Play<T: Transport> {
    session: Session<T>,
    things: Vec<Thing>,
    made: usize,
}

impl<T: Transport> Play<T> {
    fn add(&mut self, r: &mut Random) {
        let sizes = DVec3::new(r.within(0.5, 2.0), r.within(0.5, 2.0), r.within(0.5, 2.0));
        let Ok(model) = self.session.load_model("box", &cuboid(sizes.x, sizes.y, sizes.z)).map(|m| m.id) else {
            return;
        };
        // Names are given again once their objects are gone.
        let name = (0..).map(|k| format!("box {k}")).nth(self.made % 9).expect("a name");
        self.made += 1;
        let (at, place) = (pose(r), if r.chance(0.5) { Pose::IDENTITY } else { pose(r) });
        let id = self.session.add_object(Object::new(&name, model).place(place).at(at));
        match id {
            Ok(id) => self.things.push(Thing {
                id,
                sizes,
                world: matrix(&at) * matrix(&place),
                own: matrix(&place),
                carrier: None,
            }),
            Err(Error::Misuse(said)) => assert!(said.contains("by names"), "{said}"),
            Err(e) => self.lost(&e),
        }
    }

    /// A command was lost on the way: what is attached is what the session says then.
    fn lost(&mut self, e: &Error) {
        assert!(matches!(e, Error::System(what) if what == "lost"), "{e}");
        for thing in &mut self.things {
            thing.carrier = thing.carrier.filter(|_| self.session.carrier(thing.id).is_some());
        }
    }

    fn chain(&self, i: usize) -> Vec<usize> {
        std::iter::successors(Some(i), |i| self.things[*i].carrier).collect()
    }

    fn root(&self, i: usize) -> usize {
        *self.chain(i).last().expect("itself")
    }

    /// Moves an object and all that hangs on it.
    fn take_along(&mut self, root: usize, by: DMat4) {
        for i in 0..self.things.len() {
            if self.chain(i).contains(&root) {
                self.things[i].world = by * self.things[i].world;
            }
        }
    }

    fn act(&mut self, r: &mut Random) {
        let [i, j] = [r.below(self.things.len()), r.below(self.things.len())];
        let (root, id) = (self.root(i), self.things[i].id);
        match r.below(6) {
            0 | 1 => match self.session.attach(id, self.things[j].id, &[]) {
                Ok(()) => {
                    assert!(!self.chain(j).contains(&i));
                    self.things[i].carrier = Some(j);
                }
                Err(Error::Misuse(said)) => {
                    assert!(self.chain(j).contains(&i) || said.contains("by names"), "{said}");
                }
                Err(e) => self.lost(&e),
            },
            2 => match self.session.detach(id) {
                Ok(()) => self.things[i].carrier = None,
                Err(e) => self.lost(&e),
            },
            3 => {
                let (to, by) = (r.vector(2.0), r.vector(1.0));
                match self.session.begin_step(1) {
                    Ok(slots) => slots[0] = PoseRecord::turn(id, to, by),
                    Err(e) => return self.lost(&e),
                }
                let done = self.session.finish(PATIENCE).map(|_| ());
                if root != i {
                    assert!(matches!(done, Err(Error::Misuse(_))), "{done:?}");
                    return;
                }
                done.unwrap_or_else(|e| panic!("{e}"));
                let frame = self.things[i].world * self.things[i].own.inverse();
                let origin = frame.transform_point3(DVec3::ZERO);
                let rotation = turn(by.normalize(), by.length());
                self.take_along(i, DMat4::from_translation(to) * rotation * DMat4::from_translation(-origin));
            }
            4 => {
                let (place, at) = (pose(r), pose(r));
                let done = self.session.reframe(&[Frame { object: id, place, pose: at }]);
                if let Err(e @ Error::System(_)) = &done {
                    return self.lost(e);
                }
                if root != i {
                    assert!(matches!(done, Err(Error::Misuse(_))), "{done:?}");
                    return;
                }
                done.unwrap_or_else(|e| panic!("{e}"));
                let world = matrix(&at) * matrix(&place);
                let by = world * self.things[i].world.inverse();
                self.take_along(i, by);
                self.things[i].own = matrix(&place);
            }
            _ if self.things.len() > 2 && r.chance(0.4) => {
                if let Err(e) = self.session.remove_object(id)
                    && self.session.points(&[[0.0; 3]], &PointOptions::default(), Some(&[id])).is_ok()
                {
                    return self.lost(&e);
                }
                self.things.remove(i);
                for thing in &mut self.things {
                    thing.carrier = thing.carrier.filter(|c| *c != i).map(|c| if c > i { c - 1 } else { c });
                }
            }
            _ => self.add(r),
        }
    }

    fn check(&mut self, k: usize) {
        for i in 0..self.things.len() {
            let root = self.root(i);
            let Thing { id, sizes, world, .. } = self.things[i];
            assert_eq!(self.session.carrier(id), (root != i).then(|| self.things[root].id), "{k}");
            is_at(&mut self.session, id, sizes, world);
        }
    }
}

fn play<T: Transport>(session: Session<T>, seed: u64, mut between: impl FnMut(&mut Session<T>, usize)) {
    let mut r = Random::new(seed);
    let mut play = Play { session, things: Vec::new(), made: 0 };
    for _ in 0..3 {
        play.add(&mut r);
    }
    for k in 0..30 {
        play.act(&mut r);
        between(&mut play.session, k);
        play.check(k);
    }
}

#[test]
fn what_hangs_on_what_stands_where_matrices_have_it() {
    for seed in 0..sized("CONTACTD_ATTACHED", 20u64) {
        play(contactd::embedded(&ServerConfig::default()).expect("an engine"), seed, |_, _| {});
    }
}

#[test]
fn what_hangs_on_what_stands_where_matrices_have_it_though_commands_are_lost() {
    for seed in 500..500 + sized("CONTACTD_ATTACHED", 30u64) {
        let left = Rc::new(Cell::new(None));
        let inner = Embedded::new(&ServerConfig::default());
        let session = Session::new(Flaky { inner, left: Rc::clone(&left) }).expect("a session");
        let mut r = Random::new(seed);
        let mut play = Play { session, things: Vec::new(), made: 0 };
        while play.things.len() < 4 {
            play.add(&mut r);
        }
        for k in 0..40 {
            left.set(r.chance(0.6).then(|| r.below(6) as u32));
            play.act(&mut r);
            left.set(None);
            play.check(k);
        }
    }
}

#[test]
fn what_hangs_on_what_is_known_to_a_successor_of_the_server() {
    let base = tempfile::Builder::new().prefix("c").tempdir_in("/dev/shm").expect("a folder");
    served(base.path(), "chain", |address| {
        for seed in 100..100 + sized("CONTACTD_ATTACHED", 20u64).div_ceil(20) {
            play(Session::connect_to(address.clone()).expect("a session"), seed, |session, k| {
                if k % 5 == 0 {
                    session.reconnect(PATIENCE).unwrap_or_else(|e| panic!("{e}"));
                }
            });
        }
    });
}

/// Corners of a box are on its surface, and its middle inside.
fn is_at<T: Transport>(session: &mut Session<T>, id: u32, sizes: DVec3, world: DMat4) {
    let corners = [DVec3::splat(0.5), DVec3::new(-0.5, 0.5, 0.5), DVec3::new(0.5, -0.5, 0.5), DVec3::ZERO];
    let points: Vec<[f64; 3]> = corners.iter().map(|c| world.transform_point3(*c * sizes).to_array()).collect();
    let told = session.points(&points, &PointOptions::default(), Some(&[id])).expect("points");
    assert!(told[..3].iter().all(|answer| answer.lower.abs().max(answer.upper.abs()) < 1e-9), "{told:?}");
    assert_eq!(told[3].side, Side::Inside);
}

#[test]
fn what_hangs_on_a_link_goes_where_its_joints_are_put() {
    let folder = tempfile::tempdir().expect("a folder");
    for seed in 0..sized("CONTACTD_ATTACHED", 40u64) {
        let mut r = Random::new(seed);
        let arm = Arm::random(&mut r);
        let path = folder.path().join(format!("arm{seed}.urdf"));
        std::fs::write(&path, arm.urdf()).expect("written");
        let mut session = contactd::embedded(&ServerConfig::default()).expect("an engine");
        let mut scene = session.load_scene(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let free = arm.joints.iter().enumerate().filter(|(_, joint)| joint.kind != "fixed");
        let mut values: std::collections::BTreeMap<String, f64> =
            free.map(|(i, _)| format!("j{i}")).map(|name| (name.clone(), arm.start(&name))).collect();
        let (sizes, at) = (DVec3::new(0.3, 0.2, 0.1), pose(&mut r));
        let model = session.load_model("box", &cuboid(sizes.x, sizes.y, sizes.z)).expect("a box").id;
        let part = session.add_object(Object::new("part", model).at(at)).expect("a part");
        let link = r.below(arm.links.len());
        session.attach(part, scene.id(&format!("l{link}")).expect("the link"), &[]).expect("attached");
        let held = arm.stands(&values)[link].inverse() * matrix(&at);
        for _ in 0..6 {
            let to = one_joint(&arm, &mut r);
            match r.below(3) {
                0 => scene.set_joints(&mut session, &to).unwrap_or_else(|e| panic!("{e}")),
                way => {
                    scene.step(&mut session, &to, PATIENCE).unwrap_or_else(|e| panic!("{e}"));
                    if way == 2 {
                        let t = r.within(0.0, 1.0);
                        scene.stop_at(&mut session, t).unwrap_or_else(|e| panic!("{e}"));
                        for (joint, end) in &to {
                            let start = values[joint];
                            values.insert(joint.clone(), start + t * (end - start));
                        }
                        is_at(&mut session, part, sizes, arm.stands(&values)[link] * held);
                        continue;
                    }
                }
            }
            values.extend(to);
            is_at(&mut session, part, sizes, arm.stands(&values)[link] * held);
        }
    }
}

#[test]
fn another_object_of_the_name_of_one_that_is_gone_is_tested() {
    let mut session = contactd::embedded(&ServerConfig::default()).expect("an engine");
    let model = session.load_model("box", &cuboid(1.0, 1.0, 1.0)).expect("a box").id;
    let add = |session: &mut Session<_>, name: &str, x: f64| {
        session.add_object(Object::new(name, model).at(Pose::at(DVec3::X * x)))
    };
    let wall = add(&mut session, "wall", 0.0).expect("a wall");
    for round in 0..3 {
        let part = add(&mut session, "part", 5.0).expect("a part");
        match round {
            0 => session.attach(part, wall, &[]).expect("attached"),
            1 => session.allow(&[[wall, part]], true).expect("allowed"),
            _ => {}
        }
        if round < 2 {
            let twin = add(&mut session, "part", 9.0);
            assert!(matches!(twin, Err(Error::Misuse(said)) if said.contains("by names")), "{twin:?}");
            session.remove_object(part).expect("removed");
            continue;
        }
        // Nothing is left of what was said of others of its name.
        session.begin_step(1).expect("a slot")[0] = PoseRecord::end(part, &Pose::IDENTITY);
        let reply = session.finish(PATIENCE).expect("a step");
        assert!((reply.records()[0].time - 0.8).abs() < 1e-9, "{:?}", reply.records());
        let twin = add(&mut session, "part", 9.0).expect("names may be shared");
        for refused in [session.attach(part, wall, &[]), session.allow(&[[twin, wall]], true)] {
            assert!(matches!(refused, Err(Error::Misuse(said)) if said.contains("by names")), "{refused:?}");
        }
        let itself = session.allow(&[[wall, wall]], true);
        assert!(matches!(itself, Err(Error::Misuse(said)) if said.contains("one object twice")), "{itself:?}");
        let refused = session.attach(part, wall, &[77]);
        assert!(matches!(refused, Err(Error::Misuse(said)) if said.contains("may touch")), "{refused:?}");
    }
}

#[test]
fn what_a_carrier_that_is_gone_held_is_tested_against_all() {
    let mut session = contactd::embedded(&ServerConfig::default()).expect("an engine");
    let model = session.load_model("box", &cuboid(1.0, 1.0, 1.0)).expect("a box").id;
    let add = |session: &mut Session<_>, name: &str, x: f64| {
        session.add_object(Object::new(name, model).at(Pose::at(DVec3::X * x))).unwrap_or_else(|e| panic!("{e}"))
    };
    let [palm, finger, part] = [("palm", 9.0), ("finger", 0.0), ("part", 5.0)].map(|(n, x)| add(&mut session, n, x));
    session.attach(part, palm, &[finger]).expect("attached");
    session.begin_step(1).expect("a slot")[0] = PoseRecord::end(part, &Pose::IDENTITY);
    let said = session.finish(PATIENCE).map(|_| ()).expect_err("a part has no record of its own").to_string();
    assert!(said.contains("attached"), "{said}");
    session.remove_object(palm).expect("removed");
    for name in ["finger", "palm"] {
        if name == "palm" {
            session.remove_object(finger).expect("removed");
            add(&mut session, "palm", 0.0);
        }
        let records = [PoseRecord::start(part, &Pose::at(DVec3::X * 5.0)), PoseRecord::end(part, &Pose::IDENTITY)];
        session.begin_step(2).expect("slots").copy_from_slice(&records);
        let reply = session.finish(PATIENCE).expect("a step");
        assert!((reply.records()[0].time - 0.8).abs() < 1e-9, "{name}: {:?}", reply.records());
    }
    // A batch that was begun before has no room for a part.
    let wall = add(&mut session, "wall", 20.0);
    session.begin_step(1).expect("a slot")[0] = PoseRecord::end(wall, &Pose::IDENTITY);
    session.attach(part, wall, &[]).expect("attached");
    let said = session.finish(PATIENCE).map(|_| ()).expect_err("no room").to_string();
    assert!(said.contains("begin it again"), "{said}");
    // What is refused of a part is told of its carrier's record.
    let far = PoseRecord::start(wall, &Pose::at(DVec3::X * f64::NAN));
    session.begin_step(1).expect("a slot")[0] = far;
    assert!(matches!(session.finish(PATIENCE), Err(Error::Refused { index: Some(0), .. })));
}

/// A session with a carrier that goes and turns over a step, parts on it and a part on a part.
fn carried(r: &mut Random) -> (Session<Embedded>, u32, Vec<(u32, DMat4)>, impl Fn(f64) -> DMat4 + use<>) {
    let mut session = contactd::embedded(&ServerConfig::default()).expect("an engine");
    let model = session.load_model("box", &cuboid(1.0, 1.0, 1.0)).expect("a box").id;
    let start = pose(r);
    let carrier = session.add_object(Object::new("carrier", model).at(start)).expect("a carrier");
    let (mut on, mut parts) = (carrier, Vec::new());
    for k in 0..3 {
        let at = pose(r);
        let part = session.add_object(Object::new(&format!("part {k}"), model).at(at)).expect("a part");
        session.attach(part, on, &[]).expect("attached");
        parts.push((part, matrix(&start).inverse() * matrix(&at)));
        on = if r.chance(0.5) { part } else { carrier };
    }
    let (to, spin) = (r.vector(3.0), r.vector(3.0));
    let slots = session.begin_step(1).expect("slots");
    slots[0] = PoseRecord::turn(carrier, to, spin);
    session.finish(PATIENCE).expect("a step");
    let stands = move |t: f64| {
        let rotation = quat_of_rotation_vector(spin * t) * start.rotation;
        matrix(&Pose::new(start.position.lerp(to, t), rotation))
    };
    (session, carrier, parts, stands)
}

#[test]
fn what_is_let_go_in_the_middle_of_a_step_is_where_its_carrier_is_then() {
    for seed in 0..sized("CONTACTD_ATTACHED", 40u64) {
        let mut r = Random::new(seed);
        let (mut session, carrier, parts, stands) = carried(&mut r);
        let t = r.within(0.0, 1.0);
        session.options.advance = t;
        match r.below(3) {
            0 => session.detach(parts[r.below(3)].0).expect("detached"),
            1 => session.remove_object(carrier).expect("removed"),
            _ => {
                session.detach(parts[0].0).expect("detached");
                session.attach(parts[0].0, carrier, &[]).expect("attached again");
            }
        }
        // At another time they would stand elsewhere than what carried them.
        session.options.advance = 0.5 * t;
        session.begin_step(0).expect("slots");
        let refused = session.finish(PATIENCE).err().map(|e| e.to_string());
        assert!(refused.is_some_and(|e| e.contains("set it before, and leave it until the step")));
        session.options.advance = t;
        session.begin_step(0).expect("slots");
        session.finish(PATIENCE).expect("a step");
        for (part, held) in parts {
            is_at(&mut session, part, DVec3::ONE, stands(t) * held);
        }
        // What is refused owes nothing, and changes nothing.
        let model = session.load_model("ball", &sphere(1.0)).expect("a ball").id;
        let part = session.add_object(Object::new("another", model)).expect("a part");
        assert!(session.attach(part, 99, &[]).is_err());
        // From there on the next step may begin anywhere.
        session.options.advance = 0.5;
        session.begin_step(0).expect("slots");
        session.finish(PATIENCE).expect("a step");
    }
}
