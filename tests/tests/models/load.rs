//! Scenes and robots that are loaded into sessions: what `contactd check` says of their steps, to the bit, embedded and served; links
//! stand where matrices of the test's own have them; parts that are attached go along, as one solid with what carries them.
//!
//! `CONTACTD_LOADED=300 cargo test --release -p contactd-tests --test models load::` sets the number of random arms and grippers (6).

use super::robots::{Arm, read};
use bytemuck::bytes_of;
use contactd::check::Check;
use contactd::import::robot::{Ask, Values};
use contactd::import::{Facets, Limits, read_scene};
use contactd::ipc::{Embedded, Level, Server, ServerConfig};
use contactd::load::{LoadOptions, LoadScene, LoadedScene};
use contactd::octree::Model;
use contactd::world::{StepOptions, record};
use contactd_client::solid::{cuboid, cylinder, sphere};
use contactd_client::{Error, Frame, Object, Reply, Session, SharedMemory, Solid, Transport};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::names::Address;
use contactd_proto::query::{PointOptions, Side};
use contactd_proto::{ContactRecord, Pose, PoseRecord, Rule};
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::{DMat4, DVec3};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(60);

/// A server in a thread of this program, for as long as `work` lasts.
pub(super) fn served<R>(base: &Path, name: &str, work: impl FnOnce(&Address) -> R) -> R {
    let address = Address::under(&base.join("r"), name).expect("an address");
    let mut server = Server::start(&address, ServerConfig { log: Level::Warn, ..ServerConfig::default() })
        .unwrap_or_else(|e| panic!("{e}"));
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let serves = scope.spawn(|| server.run(&stop));
        let out = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| work(&address)));
        stop.store(true, Ordering::Relaxed);
        serves.join().expect("a server that ends");
        out.unwrap_or_else(|e| std::panic::resume_unwind(e))
    })
}

/// All bits of an answer that stand in its slots, without what counts work; objects by their order.
fn bits_of(slots: &[ContactRecord], records: usize, first: u32) -> Vec<Vec<u8>> {
    let each = slots.iter().enumerate().map(|(i, slot)| {
        let mut slot = *slot;
        if i < records {
            (slot.a, slot.b) = (slot.a - first, slot.b - first);
            return bytes_of(&slot).to_vec();
        }
        match slot.as_detail() {
            Some(detail) => {
                let mut detail = *detail;
                detail.cells = 0;
                bytes_of(&detail).to_vec()
            }
            None => bytes_of(&slot).to_vec(),
        }
    });
    each.collect()
}

fn of_reply(reply: &Reply<'_>, first: u32) -> Vec<Vec<u8>> {
    bits_of(reply.slots(), reply.records().len(), first)
}

/// What the path of `contactd check` says of a step.
fn checked(scene: &contactd::import::Scene) -> Vec<Vec<u8>> {
    let imports = scene.load_models(Facets::Auto, &Limits::default()).expect("models");
    let models: Vec<Arc<Model>> = imports.into_iter().map(|i| Arc::new(Model::new(i.solid))).collect();
    let mut check = Check::new(scene, &models, None).expect("a world");
    let options = StepOptions { clear: true, ..StepOptions::default() };
    check.step_with(&options).unwrap_or_else(|e| panic!("{e}"));
    let out = check.world.outcome();
    let slots: Vec<ContactRecord> =
        (0..record::slots_of(out, true)).map(|i| record::slot(&check.world, out, true, i)).collect();
    bits_of(&slots, out.pairs.len(), 0)
}

fn asks_all<T: Transport>(session: &mut Session<T>) {
    (session.options.clear, session.options.details) = (true, true);
}

/// A mesh of a box, as STL text.
fn box_mesh(half: DVec3) -> String {
    let corner = |i: usize| {
        let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        DVec3::new(sign(0), sign(1), sign(2)) * half
    };
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut out = "solid s\n".to_owned();
    for [a, b, c, d] in quads {
        for triangle in [[a, b, c], [a, c, d]] {
            out += "facet normal 0 0 0\nouter loop\n";
            for i in triangle {
                let v = corner(i);
                out += &format!("vertex {:?} {:?} {:?}\n", v.x, v.y, v.z);
            }
            out += "endloop\nendfacet\n";
        }
    }
    out + "endsolid s\n"
}

/// Values within limits, of one joint: those of other ones stay.
pub(super) fn one_joint(arm: &Arm, r: &mut Random) -> Values {
    let free: Vec<usize> = (0..arm.joints.len()).filter(|i| arm.joints[*i].kind != "fixed").collect();
    if free.is_empty() {
        return Values::new();
    }
    let i = free[r.below(free.len())];
    let [low, high] = if arm.joints[i].kind == "continuous" { [-4.0, 4.0] } else { arm.joints[i].range };
    Values::from([(format!("j{i}"), r.within(low, high))])
}

/// Links are where matrices have them: points beside their surfaces are on the side that the test's own distance says.
fn stands<T: Transport>(session: &mut Session<T>, scene: &LoadedScene, arm: &Arm, values: &Values, r: &mut Random) {
    let stands = arm.stands(values);
    for (i, link) in arm.links.iter().enumerate() {
        let id = scene.id(&format!("l{i}")).expect("the link");
        let points: Vec<DVec3> = (0..8).map(|_| link.point(r)).collect();
        let world: Vec<[f64; 3]> = points.iter().map(|x| stands[i].transform_point3(*x).to_array()).collect();
        let told = session.points(&world, &PointOptions::default(), Some(&[id])).expect("points");
        for (x, told) in points.iter().zip(&told) {
            let expected = link.value(*x);
            let side = if expected > 0.0 { Side::Outside } else { Side::Inside };
            assert!(expected.abs() < 1e-6 || told.side == side, "link {i} at {x}: {expected:e}, {told:?}");
        }
    }
}

/// Three steps of an arm from random values, one joint each, by a session and by the path of `check`.
fn drive<T: Transport>(session: &mut Session<T>, path: &Path, arm: &Arm, seed: u64) -> Vec<Vec<Vec<u8>>> {
    let mut r = Random::new(seed);
    asks_all(session);
    let joints = one_joint(arm, &mut r);
    let options = LoadOptions { joints: joints.clone(), ..LoadOptions::default() };
    // What is not told stands where the file has it.
    let free = arm.joints.iter().enumerate().filter(|(_, joint)| joint.kind != "fixed");
    let mut values: Values = free.map(|(i, _)| format!("j{i}")).map(|name| (name.clone(), arm.start(&name))).collect();
    values.extend(joints);
    let mut scene = session.load_scene(path, &options).unwrap_or_else(|e| panic!("{e}"));
    let first = scene.objects[0].id;
    let mut all = Vec::new();
    for _ in 0..3 {
        let to = one_joint(arm, &mut r);
        let told = of_reply(&scene.step(session, &to, PATIENCE).unwrap_or_else(|e| panic!("{e}")), first);
        let ask = Ask { from: values.clone(), to: to.clone(), ..Ask::default() };
        let text = std::fs::read_to_string(path).expect("the robot");
        let expected = checked(&read(path.parent().expect("a folder"), "again.urdf", &text, &ask).1);
        assert_eq!(told.len(), expected.len(), "{path:?} {values:?} {to:?}");
        assert!(told == expected, "{path:?} {values:?} {to:?}");
        values.extend(to);
        stands(session, &scene, arm, &values, &mut r);
        all.push(told);
    }
    // Put elsewhere without a step, and stopped on the way.
    for _ in 0..3 {
        let to = one_joint(arm, &mut r);
        scene.set_joints(session, &to).unwrap_or_else(|e| panic!("{e}"));
        values.extend(to);
        stands(session, &scene, arm, &values, &mut r);
    }
    let (from, to) = (values.clone(), one_joint(arm, &mut r));
    scene.step(session, &to, PATIENCE).unwrap_or_else(|e| panic!("{e}"));
    let t = r.within(0.0, 1.0);
    scene.stop_at(session, t).unwrap_or_else(|e| panic!("{e}"));
    for (joint, end) in &to {
        let start = from[joint];
        values.insert(joint.clone(), start + t * (end - start));
    }
    stands(session, &scene, arm, &values, &mut r);
    for joint in scene.joints() {
        assert_eq!(joint.value, values[&joint.name], "{}", joint.name);
    }
    all
}

#[test]
fn an_arm_in_a_session_answers_as_check_does_and_stands_where_matrices_have_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(31);
    std::fs::write(folder.path().join("tool.stl"), box_mesh(DVec3::new(0.2, 0.1, 0.3))).expect("written");
    let base = tempfile::Builder::new().prefix("c").tempdir_in("/dev/shm").expect("a folder");
    let (mut moved, mut slots) = (0, 0);
    served(base.path(), "loads", |address| {
        for k in 0..sized("CONTACTD_LOADED", 6u64) {
            let arm = Arm::random(&mut r);
            let mut text = arm.urdf();
            if r.chance(0.4) {
                // What hangs on it has its solid from a file, which the client sends along.
                let last = arm.links.len() - 1;
                let tool = format!(
                    "<link name=\"tool\"><collision><geometry><mesh filename=\"tool.stl\"/></geometry></collision></link>\
                     <joint name=\"hold\" type=\"fixed\"><parent link=\"l{last}\"/><child link=\"tool\"/></joint></robot>"
                );
                text = text.replace("</robot>", &tool);
            }
            let path = folder.path().join(format!("arm{k}.urdf"));
            std::fs::write(&path, text).expect("written");
            let mut embedded = contactd::embedded(&ServerConfig::default()).expect("an engine");
            let own = drive(&mut embedded, &path, &arm, k);
            let mut session = Session::connect_to(address.clone()).expect("a session");
            assert!(own == drive(&mut session, &path, &arm, k), "served and embedded differ: {k}");
            session.close().expect("closed");
            slots += own.iter().map(Vec::len).sum::<usize>();
            moved += usize::from(arm.joints.iter().any(|j| j.kind != "fixed"));
        }
    });
    println!("{slots} slots are equal");
    assert!(moved > 3 && slots > 20, "{moved} {slots}");
}

#[test]
fn a_scene_file_in_a_session_answers_as_check_does_and_its_recording_repeats() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../server/models/assembly.toml");
    let expected = checked(&read_scene(&scene).expect("a scene"));
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = contactd::embedded(&ServerConfig::default()).expect("an engine");
    asks_all(&mut session);
    let file = folder.path().join("steps.mcap");
    session.record(&file).expect("recorded");
    let mut loaded = session.load_scene(&scene, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let first = loaded.objects[0].id;
    for _ in 0..2 {
        // Again from its beginning.
        let reply = loaded.step(&mut session, &Values::new(), PATIENCE).unwrap_or_else(|e| panic!("{e}"));
        assert!(of_reply(&reply, first) == expected);
    }
    session.stop_recording().expect("complete");
    let replayed = contactd::replay::replay(&file, |_| {}).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((replayed.steps, replayed.difference), (2, None));
}

#[test]
fn what_is_wrong_with_a_scene_is_one_sentence_and_leaves_the_session_as_it_was() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("written");
        path
    };
    let good = "<robot name=\"r\"><link name=\"a\"><collision><geometry><sphere radius=\"1\"/></geometry></collision></link>\
        <link name=\"b\"><collision><geometry><sphere radius=\"1\"/></geometry></collision></link>\
        <joint name=\"j\" type=\"revolute\"><parent link=\"a\"/><child link=\"b\"/><limit lower=\"-1\" upper=\"1\"/></joint></robot>";
    let path = write("good.urdf", good);
    let mut session = contactd::embedded(&ServerConfig::default()).expect("an engine");
    let model = session.load_model("ball", &sphere(1.0)).expect("a ball").id;
    let before = session.add_object(Object::new("mine", model)).expect("an object");
    let bad_mesh = good.replace("<sphere radius=\"1\"/>", "<mesh filename=\"none.stl\"/>");
    let part = "[[model]]\nname = \"m\"\nfile = \"m.csg\"\n[[object]]\nname = \"o\"\nmodel = \"m\"\n";
    write("m.csg", "sphere(r = 0.1);");
    let cases = [
        (write("bad.urdf", "<robot"), "bad.urdf:1:"),
        (write("mesh.urdf", &bad_mesh), "none.stl"),
        (write("a.stl", "solid"), "a.stl: expected a scene (.toml) or a robot"),
        (folder.path().join("none.urdf"), "none.urdf: expected a readable file"),
        (write("big.toml", &format!("resolution = 0.1\n{part}")), "big.toml:1:14: resolution: "),
        (
            write("rule.toml", &format!("{part}[[rule]]\nbetween = [\"default\", \"default\"]\nmargin = -1.0\n")),
            "rule.toml:",
        ),
    ];
    for (path, words) in cases {
        let said = session.load_scene(&path, &LoadOptions::default()).expect_err(words).to_string();
        assert!(said.contains(words) && said.lines().count() == 1, "{said}\nnot {words}");
    }
    session.set_resolution(None).expect("as it was");
    // Nothing but what was there.
    let told = session.points(&[[5.0, 0.0, 0.0]], &PointOptions::default(), None).expect("a point");
    assert_eq!((told.len(), told[0].object), (1, Some(before)));
    let mut scene = session.load_scene(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    for (values, words) in [
        (Values::from([("j".to_owned(), 2.0)]), "expected -1 to 1 as j, found 2"),
        (Values::from([("k".to_owned(), 0.0)]), "expected one of the joints j, found \"k\""),
    ] {
        let said = scene.set_joints(&mut session, &values).expect_err(words).to_string();
        assert!(said.starts_with(&format!("{}:", path.display())) && said.contains(words), "{said}");
        let said = scene.records(&mut session, &values).expect_err(words).to_string();
        assert!(said.contains(words), "{said}");
    }
    let said = scene.stop_at(&mut session, 1.5).expect_err("no time").to_string();
    assert!(said.contains("expected a time within the step, 0 to 1, found 1.5"), "{said}");
    let joints = LoadOptions { joints: Values::from([("j".to_owned(), 0.0)]), ..LoadOptions::default() };
    let toml = write("plain.toml", part);
    let said = session.load_scene(&toml, &joints).expect_err("no robot").to_string();
    assert!(said.contains("plain.toml: expected a robot (URDF, SDFormat, MJCF) beside joints"), "{said}");
    let mut plain = session.load_scene(&toml, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let said = plain.set_joints(&mut session, &Values::new()).expect_err("no robot").to_string();
    assert!(said.contains("plain.toml: expected a robot"), "{said}");
}

/// A gripper, what it holds, and what both may run into; where they stand and how the gripper goes.
struct Grip {
    solids: [Solid; 3],
    /// The grip of the part in the gripper's frame.
    grip: Pose,
    start: Pose,
    wall: Pose,
    ways: Vec<(DVec3, DVec3)>,
}

fn pose(r: &mut Random, far: f64) -> Pose {
    Pose::new(r.vector(far), quat_of_rotation_vector(r.vector(2.0)))
}

fn solid(r: &mut Random) -> Solid {
    match r.below(3) {
        0 => cuboid(r.within(0.5, 2.0), r.within(0.5, 2.0), r.within(0.5, 2.0)),
        1 => cylinder(r.within(0.3, 1.0), r.within(0.5, 2.0)),
        _ => sphere(r.within(0.3, 1.0)),
    }
}

impl Grip {
    fn random(r: &mut Random) -> Self {
        let ways = (0..4).map(|_| (r.vector(3.0), r.vector(1.5))).collect();
        let solids = [solid(r), solid(r), solid(r)];
        Self { solids, grip: pose(r, 1.0), start: pose(r, 2.0), wall: pose(r, 3.0), ways }
    }
}

/// Times at which the gripper and its part, or both as one, meet the wall in each of the steps; the earliest of them.
fn meets<T: Transport>(
    session: &mut Session<T>,
    grip: &Grip,
    is_one: bool,
    mut between: impl FnMut(&mut Session<T>, usize),
) -> Vec<Option<f64>> {
    let [gripper, part, wall] = &grip.solids;
    let placed = part.placed(&grip.grip);
    let models = if is_one { vec![gripper.clone() + placed] } else { vec![gripper.clone(), part.clone()] };
    let ids: Vec<u32> =
        models.iter().map(|solid| session.load_model("m", solid).unwrap_or_else(|e| panic!("{e}")).id).collect();
    let wall = session.load_model("wall", wall).expect("a wall").id;
    let wall = session.add_object(Object::new("wall", wall).at(grip.wall)).expect("the wall");
    let carrier = session.add_object(Object::new("gripper", ids[0]).at(grip.start)).expect("the gripper");
    if !is_one {
        let at = grip.start.compose(&grip.grip);
        let part = session.add_object(Object::new("part", ids[1]).at(at)).expect("the part");
        session.attach(part, carrier, &[]).unwrap_or_else(|e| panic!("{e}"));
    }
    let mut out = Vec::new();
    for (i, (to, turn)) in grip.ways.iter().enumerate() {
        between(session, i);
        session.begin_step(1).expect("a slot")[0] = PoseRecord::turn(carrier, *to, *turn);
        let reply = session.finish(PATIENCE).unwrap_or_else(|e| panic!("{e}"));
        assert!(reply.records().iter().all(|record| record.a == wall), "the part is tested against its gripper");
        let time = |record: &ContactRecord| if record.status == 3 { 0.0 } else { record.time };
        out.push(reply.records().iter().map(time).min_by(f64::total_cmp));
    }
    out
}

#[test]
fn what_is_attached_goes_along_as_one_solid_with_its_gripper() {
    let mut r = Random::new(5);
    let base = tempfile::Builder::new().prefix("c").tempdir_in("/dev/shm").expect("a folder");
    let (mut met, mut worst) = (0, 0.0_f64);
    for k in 0..sized("CONTACTD_LOADED", 6u64) {
        let grip = Grip::random(&mut r);
        let new = || contactd::embedded(&ServerConfig::default()).expect("an engine");
        let one = meets(&mut new(), &grip, true, |_, _| {});
        let two = meets(&mut new(), &grip, false, |_, _| {});
        for (one, two) in one.iter().zip(&two) {
            assert_eq!(one.is_some(), two.is_some(), "{k}: {one:?} {two:?}");
            if let (Some(one), Some(two)) = (one, two) {
                met += 1;
                worst = worst.max((one - two).abs());
            }
        }
        if k % 5 == 0 {
            // Over shared memory, with a server that is lost between two steps: the successor knows what is attached.
            let mut session =
                served(base.path(), "first", |address| Session::connect_to(address.clone()).expect("a session"));
            let again = std::cell::Cell::new(false);
            let told = served(base.path(), "first", |_| {
                session.reconnect(PATIENCE).unwrap_or_else(|e| panic!("{e}"));
                meets(&mut session, &grip, false, |session: &mut Session<SharedMemory>, i| {
                    if i == 2 {
                        session.reconnect(PATIENCE).unwrap_or_else(|e| panic!("{e}"));
                        again.set(true);
                    }
                })
            });
            assert!(again.get() && told == two, "{k}: {told:?} {two:?}");
        }
    }
    println!("{met} contacts, times at most {worst:.1e} apart");
    assert!(met > 6 && worst < 1e-9, "{met} {worst:e}");
}

#[test]
fn pairs_that_are_allowed_or_attached_are_not_tested_and_all_others_are() {
    let mut r = Random::new(77);
    for _ in 0..sized("CONTACTD_LOADED", 6u64) {
        let mut session = contactd::embedded(&ServerConfig::default()).expect("an engine");
        let model = session.load_model("ball", &sphere(1.0)).expect("a ball").id;
        let n = 3 + r.below(4);
        let has_rules = r.chance(0.5);
        let mut ids = Vec::new();
        let mut allowed = std::collections::BTreeSet::new();
        // What each part was attached to.
        let mut carried: std::collections::BTreeMap<u32, u32> = std::collections::BTreeMap::new();
        let group = |i: usize| ["one", "two", "three"][i % 3];
        if has_rules {
            let pairs = [["one", "one"], ["one", "two"], ["two", "three"]];
            let rules: Vec<Rule> = pairs.iter().map(|[a, b]| Rule::new([(*a).into(), (*b).into()])).collect();
            session.set_rules(&rules).expect("rules");
        }
        for i in 0..n {
            // All of them overlap: whichever pair is tested is told.
            let at = Pose::at(r.vector(0.1));
            ids.push(
                session.add_object(Object::new(&format!("o{i}"), model).group(group(i)).at(at)).expect("an object"),
            );
            let pick = |r: &mut Random| [ids[r.below(ids.len())], ids[r.below(ids.len())]];
            for _ in 0..3 {
                let [a, b] = pick(&mut r);
                if a == b {
                    continue;
                }
                let key = [a.min(b), a.max(b)];
                match r.below(4) {
                    0 => {
                        session.allow(&[[a, b]], true).expect("allowed");
                        allowed.insert(key);
                    }
                    1 => {
                        session.allow(&[[a, b]], false).expect("no longer");
                        allowed.remove(&key);
                    }
                    2 => {
                        let mut chain = std::iter::successors(Some(b), |id| carried.get(id).copied());
                        let is_circle = chain.any(|id| id == a);
                        match session.attach(a, b, &[]) {
                            Ok(()) => _ = carried.insert(a, b),
                            Err(Error::Misuse(_)) => assert!(is_circle, "a circle alone is refused"),
                            Err(e) => panic!("{e}"),
                        }
                    }
                    _ => {
                        session.detach(a).expect("detached");
                        carried.remove(&a);
                    }
                }
            }
            let root = |id: u32| std::iter::successors(Some(id), |id| carried.get(id).copied()).last();
            assert!(ids.iter().all(|id| session.carrier(*id) == root(*id).filter(|root| root != id)));
        }
        session.begin_step(0).expect("no slots");
        let reply = session.finish(PATIENCE).expect("a step");
        let mut told: Vec<[u32; 2]> = reply.records().iter().map(|record| [record.a, record.b]).collect();
        told.sort_unstable();
        let touches =
            |p: &[u32; 2]| allowed.contains(p) || carried.iter().any(|(part, to)| [*part.min(to), *part.max(to)] == *p);
        let named = |p: &[u32; 2]| {
            let [a, b] = p.map(|id| ids.iter().position(|own| *own == id).expect("an id") % 3);
            !has_rules || matches!((a.min(b), a.max(b)), (0, 0 | 1) | (1, 2))
        };
        let mut expected = Vec::new();
        for (i, a) in ids.iter().enumerate() {
            expected.extend(ids[i + 1..].iter().map(|b| [*a, *b]).filter(|p| named(p) && !touches(p)));
        }
        assert_eq!(told, expected);
    }
}

/// Frames change nothing of where things are, and a motion is one of the frame.
#[test]
fn an_object_in_another_frame_is_where_it_was_and_turns_about_its_origin() {
    let mut r = Random::new(9);
    for _ in 0..40 {
        let mut session = contactd::embedded(&ServerConfig::default()).expect("an engine");
        let sizes = DVec3::new(r.within(0.5, 2.0), r.within(0.5, 2.0), r.within(0.5, 2.0));
        let model = session.load_model("box", &cuboid(sizes.x, sizes.y, sizes.z)).expect("a box").id;
        let at = pose(&mut r, 3.0);
        let id = session.add_object(Object::new("box", model).at(at)).expect("an object");
        let frame = pose(&mut r, 3.0);
        let place = frame.inverse().compose(&at);
        session.reframe(&[Frame { object: id, place, pose: frame }]).expect("a frame");
        let (to, turn) = (r.vector(2.0), r.vector(2.0));
        session.begin_step(1).expect("a slot")[0] = PoseRecord::turn(id, to, turn);
        session.finish(PATIENCE).expect("a step");
        // The box, by matrices: turned about the frame's origin and taken along with it.
        let matrix = |p: &Pose| DMat4::from_rotation_translation(p.rotation, p.position);
        let axis = turn.normalize();
        let moved = DMat4::from_translation(to)
            * super::robots::turn(axis, turn.length())
            * DMat4::from_translation(-frame.position)
            * matrix(&at);
        for _ in 0..20 {
            let x = r.vector(1.5);
            let world = moved.transform_point3(x).to_array();
            let told = session.points(&[world], &PointOptions::default(), None).expect("a point")[0];
            let out = (x.abs() - 0.5 * sizes).max_element();
            assert!(out.abs() < 1e-6 || (out > 0.0) == (told.side == Side::Outside), "{x} {out:e} {told:?}");
        }
    }
    let mut session = Session::new(Embedded::new(&ServerConfig::default())).expect("an engine");
    let model = session.load_model("ball", &sphere(1.0)).expect("a ball").id;
    let fixed = session.add_object(Object::new("fixed", model).fixed()).expect("an object");
    let frame = |object| Frame { object, place: Pose::IDENTITY, pose: Pose::IDENTITY };
    for (object, code) in [(fixed, "static"), (9, "9")] {
        let said = session.reframe(&[frame(object)]).expect_err(code).to_string();
        assert!(said.starts_with("index 0: "), "{said}");
    }
    let far = Frame { pose: Pose::at(DVec3::splat(f64::NAN)), ..frame(fixed) };
    assert!(session.reframe(&[far]).is_err());
}
