//! Every record tells the contact that it tells of: an independent judge (`record_judge`) finds nothing wrong with what
//! is told of random scenes, and notices each kind of lie. And what is asked twice is told twice, to the bit: whichever
//! way a pose came in, and whatever was asked before.
//!
//! For a long run:
//! `CONTACTD_RECORDS=20000 cargo test --release -p contactd-tests --test answers records:: -- --nocapture`, and
//! `CONTACTD_RECORD_SCENES=FILE:FILE…` judges scene files.

use contactd::check::Check;
use contactd::contact::{ContactKind, ContactPoint, Extent, Outcome, Overlap, Penetration, Status, Verdict};
use contactd::import::{Facets, Limits, import_csg, read_scene};
use contactd::ipc::ServerConfig;
use contactd::octree::Model;
use contactd::solid::{Face, Sense, Solid, surface};
use contactd::world::{MeasuredModel, ObjectSpec, StepOptions, World};
use contactd_client::Object;
use contactd_proto::control::WireTrack;
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose, PoseRecord, Report, Rule};
use contactd_tests::engine::{self, ReportedPoint as _, contact_mut, point_mut};
use contactd_tests::random_solids::Random;
use contactd_tests::record_judge::{Lie, holds, lies};
use contactd_tests::record_scenes::FAMILIES;
use contactd_tests::reference::Moving;
use contactd_tests::scenes::{self, Recipe, Scene};
use contactd_tests::sweep::sized;
use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Duration;

fn moving(solid: &Solid, motion: Motion) -> Moving<'_> {
    Moving { solid, place: Pose::IDENTITY, motion }
}

/// What is told of a scene, and what is wrong with it.
fn judged(scene: &Scene) -> (Outcome, Vec<(Lie, String)>) {
    let (a, b) = (scene.a.build(), scene.b.build());
    let o = engine::ask(scene);
    let found = lies(&moving(&a, scene.motion_a), &moving(&b, scene.motion_b), &o);
    (o, found)
}

/// Scenes of each family: a few in the command, `CONTACTD_RECORDS` in the long form.
fn rounds(few: u64) -> u64 {
    sized("CONTACTD_RECORDS", few)
}

/// Judges scenes of a family: (contacts, records wrong, not continued).
fn judge_family(name: &str, few: u64, draw: impl Fn(&mut Random) -> Scene + Sync) -> [usize; 3] {
    let each = (0..rounds(few)).into_par_iter().map(|seed| {
        let (o, found) = judged(&draw(&mut Random::new(seed)));
        for (lie, what) in &found {
            println!("{name} {seed}: {lie:?}: {what}");
        }
        [o.status() == Status::Contact, !found.is_empty(), o.not_continued()].map(usize::from)
    });
    let sum = each.reduce(|| [0; 3], |p, q| [0, 1, 2].map(|k| p[k] + q[k]));
    println!("{name}: {} scenes, {} contacts, {} records wrong, {} not continued", rounds(few), sum[0], sum[1], sum[2]);
    sum
}

#[test]
fn records_of_random_scenes_are_true() {
    let [contacts, wrong, late] = judge_family("any", 75, scenes::any);
    assert!(2 * contacts as u64 > rounds(75), "too few contacts to mean anything");
    assert_eq!((wrong, late), (0, 0));
}

#[test]
fn records_at_coincident_faces_small_features_and_unequal_sizes_are_true() {
    let mut late = 0;
    for (name, draw) in FAMILIES {
        let [contacts, wrong, not_continued] = judge_family(name, 30, draw);
        assert!(contacts >= 5, "{name}: too few contacts to mean anything");
        assert_eq!(wrong, 0, "{name}");
        late += not_continued;
    }
    assert_eq!(late, 0, "times that were not continued back to their touch");
}

/// The same scene from a moment around its contact on: bodies that touch at the start and press on.
fn from_touch(rng: &mut Random, draw: fn(&mut Random) -> Scene) -> Scene {
    let scene = draw(rng);
    let o = engine::ask(&scene);
    let t = if o.status() == Status::Contact { [o.time(), o.time_lower(), o.time_upper()][rng.below(3)] } else { 0.0 };
    let on = |m: Motion| Motion { start: m.at(t), ..m };
    Scene { motion_a: on(scene.motion_a), motion_b: on(scene.motion_b), ..scene }
}

#[test]
fn records_of_bodies_that_touch_at_the_start_are_true() {
    let (mut contacts, mut wrong) = (0, 0);
    for (name, draw) in FAMILIES.into_iter().chain([("any", scenes::any as fn(&mut Random) -> Scene)]) {
        let [met, lies, _] = judge_family(&format!("{name} from touch"), 20, |rng| from_touch(rng, draw));
        (contacts, wrong) = (contacts + met, wrong + lies);
    }
    assert!(contacts >= 30, "too few contacts to mean anything: {contacts}");
    assert_eq!(wrong, 0);
}

/// Judges every pair of the scene files named in `CONTACTD_RECORD_SCENES`, separated by colons.
#[test]
fn records_of_scene_files_are_true() {
    let Ok(files) = std::env::var("CONTACTD_RECORD_SCENES") else { return };
    let mut wrong = 0;
    for file in files.split(':') {
        let scene = read_scene(file.as_ref()).unwrap_or_else(|e| panic!("{e}"));
        let imports = scene.load_models(Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
        let models: Vec<_> = imports.into_iter().map(|i| Arc::new(Model::new(i.solid))).collect();
        let mut check = Check::new(&scene, &models, None).unwrap_or_else(|e| panic!("{e}"));
        let pairs = check.step(false).unwrap_or_else(|e| panic!("{e}")).pairs.clone();
        for p in pairs {
            let side = |id: u32| {
                let object = &scene.objects[id as usize];
                Moving { solid: &models[object.model].solid, place: object.place, motion: object.motion }
            };
            let o = &p.outcome;
            println!(
                "{file}: {} at {} {:?} {:?} touching {} not continued {}",
                o.status().name(),
                o.time(),
                o.at().kind,
                o.at().extent,
                o.touching,
                o.not_continued()
            );
            wrong += usize::from(!holds(file, &side(p.a), &side(p.b), o));
        }
    }
    assert_eq!(wrong, 0);
}

/// A plate with a cube taken out of a far corner, whose face plane y = 0 goes through the plate's middle as well.
fn plate() -> Recipe {
    let plate = Recipe::cuboid(1.0, 1.0, 0.25);
    plate.minus(Recipe::cuboid(0.25, 0.25, 0.5).at(0.75, 0.25, 0.0))
}

#[test]
fn the_judge_notices_every_kind_of_lie() {
    let falls = |b: Recipe, from: DVec3| Scene::falling(plate(), b, from, DVec3::new(0.1, 0.0, -2.0));
    let ball = falls(Recipe::sphere(0.25), DVec3::new(-0.5, 0.0, 1.25));
    let turned =
        Recipe::cuboid(0.25, 0.25, 0.25).moved(&Pose::new(DVec3::ZERO, quat_of_rotation_vector(DVec3::X * 0.4)));
    let edge = falls(turned, DVec3::new(-0.5, 0.0, 1.25));
    let reported = |scene: &Scene| {
        let (o, found) = judged(scene);
        assert!(o.status() == Status::Contact && found.is_empty(), "{found:?}");
        o
    };
    let is_noticed = |scene: &Scene, lie: Lie, change: &dyn Fn(&mut Outcome, &mut Solid)| {
        let (mut a, b) = (scene.a.build(), scene.b.build());
        let mut o = reported(scene);
        change(&mut o, &mut a);
        let found = lies(&moving(&a, scene.motion_a), &moving(&b, scene.motion_b), &o);
        assert!(found.iter().any(|(l, _)| *l == lie), "{lie:?} is not noticed: {found:?}");
    };
    // Face ids of the plate: +x −x +y −y +z −z, then those of the cube that is taken out.
    let (top, bottom, phantom) = (4, 5, 6 + 3);
    assert_eq!(reported(&ball).at().faces_a[0], top);
    is_noticed(&ball, Lie::Bracket, &|o, _| contact_mut(o).time_lower = o.time_upper());
    is_noticed(&ball, Lie::Bracket, &|o, _| contact_mut(o).time_upper = 1.5);
    is_noticed(&ball, Lie::Point, &|o, _| point_mut(o).point.z += 1e-7);
    is_noticed(&ball, Lie::Point, &|o, _| {
        let contact = contact_mut(o);
        (contact.time_lower, contact.time) = (0.0, contact.time - 1e-7);
    });
    is_noticed(&ball, Lie::FaceElsewhere, &|o, _| point_mut(o).faces_a[0] = bottom);
    is_noticed(&ball, Lie::FaceElsewhere, &|o, _| point_mut(o).faces_a[1] = 99);
    // The plane of the cube's −y face goes through the contact, and the cube is .25 away.
    is_noticed(&ball, Lie::FaceInactive, &|o, _| point_mut(o).faces_a[1] = phantom);
    is_noticed(&ball, Lie::FaceInactive, &|o, _| point_mut(o).faces_a = [u32::MAX; 3]);
    is_noticed(&edge, Lie::FaceInactive, &|o, _| point_mut(o).faces_b[1] = u32::MAX);
    is_noticed(&ball, Lie::Normal, &|o, _| point_mut(o).normal = (o.at().normal + DVec3::Y * 1e-5).normalize());
    is_noticed(&ball, Lie::Normal, &|o, _| point_mut(o).normal = -o.at().normal);
    is_noticed(&ball, Lie::Normal, &|o, _| point_mut(o).normal *= 1.001);
    is_noticed(&edge, Lie::Normal, &|o, _| point_mut(o).normal = (o.at().normal + DVec3::Y * 1e-5).normalize());
    is_noticed(&ball, Lie::Kind, &|o, _| point_mut(o).kind = ContactKind::EdgeFace);
    is_noticed(&edge, Lie::Kind, &|o, _| {
        *point_mut(o) = ContactPoint { kind: ContactKind::FaceFace, extent: Extent::Point, ..o.at() }
    });
    is_noticed(&edge, Lie::Kind, &|o, _| {
        *point_mut(o) = ContactPoint { kind: ContactKind::VertexFace, extent: Extent::Line, ..o.at() }
    });
    is_noticed(&ball, Lie::Sense, &|_, a| a.senses[0] = Sense::Negative);
    is_noticed(&ball, Lie::Separation, &|o, _| point_mut(o).separation = 1e-6);
    is_noticed(&ball, Lie::NormalSpeed, &|o, _| point_mut(o).normal_speed *= 1.0 + 1e-6);
    is_noticed(&ball, Lie::NotContinued, &|o, _| contact_mut(o).time = o.time_upper());
    // Of an overlap the point and its depth.
    let inside = Scene::falling(plate(), Recipe::sphere(0.25), DVec3::new(-0.5, 0.0, 0.375), DVec3::X * 0.1);
    let (a, b) = (inside.a.build(), inside.b.build());
    let (o, found) = judged(&inside);
    assert!(o.status() == Status::Overlap && found.is_empty(), "{found:?}");
    let sides = (moving(&a, inside.motion_a), moving(&b, inside.motion_b));
    let Verdict::Overlap(overlap) = o.verdict else { panic!("{o:?}") };
    let deep = overlap.penetration.map_or(0.0, |p| p.depth);
    let is_noticed = |lie: Lie, wrong: Overlap| {
        let o = Outcome { verdict: Verdict::Overlap(wrong), ..o };
        assert!(lies(&sides.0, &sides.1, &o).iter().any(|l| l.0 == lie), "{lie:?}");
    };
    let at = o.at();
    is_noticed(Lie::Point, Overlap { point: Some(ContactPoint { point: at.point + DVec3::Z, ..at }), ..overlap });
    let separation = at.separation - 0.3;
    is_noticed(Lie::Separation, Overlap { point: Some(ContactPoint { separation, ..at }), ..overlap });
    let penetration = Some(Penetration { depth: deep + 0.3, point: at.point, direction: at.normal });
    is_noticed(Lie::Separation, Overlap { penetration, ..overlap });
}

#[test]
fn a_plane_that_passes_by_is_no_face_of_the_contact() {
    // The plane of a subtracted cube's face goes through the rim that meets the ball, and the cube is far away.
    let a = plate().union(Recipe::sphere(0.5).at(-0.25, 0.0, 0.25));
    let b = Recipe::cylinder(0.25, 0.5).moved(&Pose::new(DVec3::ZERO, quat_of_rotation_vector(DVec3::Y * 0.6)));
    let scene = Scene::falling(a, b, DVec3::new(-0.125, 0.0, 2.0), DVec3::NEG_Z * 2.0);
    let (o, found) = judged(&scene);
    assert_eq!((o.status(), found), (Status::Contact, vec![]));
    // Many bottoms in one plane land at once: the point is told with a face that is there.
    let feet =
        |k: f64| Recipe::cylinder(0.2, 0.25).at(k, 0.1 * k, 0.0).union(Recipe::cuboid(0.1, 0.3, 0.25).at(k, 0.8, 0.0));
    let many = feet(-0.6).union(feet(0.0)).union(feet(0.55));
    for turn in [0.0, 0.3, -1.1, 2.0] {
        let start = Pose::at(DVec3::new(0.1, -0.1, 2.0));
        let motion = Motion::turning(start, start.position - DVec3::Z * 3.0, DVec3::Z * turn);
        let scene = Scene::new("feet", plate(), Motion::resting(Pose::IDENTITY), many.clone(), motion);
        let (o, found) = judged(&scene);
        assert_eq!((o.status(), o.at().extent, found), (Status::Contact, Extent::Patch, vec![]), "turned by {turn}");
    }
}

/// Outward normals of the faces of a model's only primitive, with their names.
fn named_faces(text: &str) -> Vec<(String, DVec3)> {
    let solid =
        import_csg("a.csg", text, Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{text}: {e}")).solid;
    let p = &solid.primitives[0];
    let each = p.faces.iter().enumerate().filter_map(|(k, face)| match *face {
        Face::Plane(surface::Plane { normal, .. }) => Some((p.face_name(k), normal)),
        _ => None,
    });
    each.collect()
}

#[test]
fn faces_keep_their_names_under_any_mirror() {
    let shapes = [
        "cube(size = [2, 3, 4], center = true);",
        "cube(size = [1, 2, 3]);",
        "cylinder(h = 2, r1 = 1, r2 = 1, center = true);",
        "cylinder(h = 2, r1 = 1, r2 = .5);",
        "cylinder(h = 2, r1 = .5, r2 = 1);",
        "cylinder(h = 2, r1 = 1, r2 = 0);",
        "cylinder($fn = 3, h = 2, r1 = 1, r2 = 1);",
        "cylinder($fn = 6, h = 2, r1 = 1, r2 = .7);",
        "polyhedron(points = [[0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 4]], faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]);",
        "linear_extrude(height = 3) { square(size = [1, 2]); }",
        "linear_extrude(height = 3) { polygon(points = [[0, 0], [2, 0], [0, 1]]); }",
        "linear_extrude(height = 3) { circle(r = 1); }",
    ];
    let mut rng = Random::new(7);
    let mut mirrored = 0;
    for shape in shapes {
        let own = named_faces(shape);
        for round in 0..24 {
            let turn = if round < 8 { DMat3::IDENTITY } else { DMat3::from_quat(rng.rotation()) };
            let sign = |k: u32| if round >> k & 1 == 1 { -1.0 } else { 1.0 };
            let scale = [1.0, 2.5][round / 16];
            let m = turn * DMat3::from_diagonal(DVec3::new(sign(0), sign(1), sign(2)) * scale);
            mirrored += usize::from(m.determinant() < 0.0);
            let row = |k: usize| format!("[{}, {}, {}, {k}]", m.row(k).x, m.row(k).y, m.row(k).z);
            let placed = format!("multmatrix([{}, {}, {}, [0, 0, 0, 1]]) {{ {shape} }}", row(0), row(1), row(2));
            let faces = named_faces(&placed);
            assert_eq!(faces.len(), own.len(), "{placed}");
            for (name, normal) in &own {
                let expected = (m.inverse().transpose() * *normal).normalize();
                let found = faces.iter().find(|f| f.0 == *name).unwrap_or_else(|| panic!("{placed}: no {name}"));
                assert!(found.1.distance(expected) < 1e-9, "{placed}: {name} looks to {}, not {expected}", found.1);
            }
        }
    }
    assert!(mirrored > 100);
}

#[test]
fn a_contact_beside_a_far_larger_body_is_continued() {
    // A frustum's rim on a block that is 30,000 times as large, far from its origin.
    let block = Recipe::cuboid(1.1e5, 0.9e5, 1e5).at(3e3, -2e3, 1e3);
    let rim = Recipe::cone(3.6, 0.0, 2.0).minus(Recipe::cylinder(0.4, 1.0).at(0.2, 0.4, 1.0));
    let mut rng = Random::new(3);
    for k in 0..8 {
        let start = Pose::new(DVec3::new(100.0 * k as f64, -40.0, 1.01e5 + 12.0), rng.rotation());
        let motion = Motion::turning(start, start.position - DVec3::Z * 14.0, rng.vector(0.9));
        let still = Motion::turning(Pose::IDENTITY, DVec3::ZERO, DVec3::splat(4e-6));
        let (o, found) = judged(&Scene::new("block", block.clone(), still, rim.clone(), motion));
        assert_eq!((o.status(), o.not_continued(), found), (Status::Contact, false, vec![]), "{k}");
    }
}

/// What a step of two cubes with a common face says of touching, asked in different ways.
#[test]
fn touching_is_told_of_clear_pairs_without_being_asked_for() {
    let cube = Arc::new(MeasuredModel::new(Arc::new(Model::new(Recipe::cuboid(0.5, 0.5, 0.5).build()))));
    let tree = Recipe::cuboid(0.5, 0.5, 0.5).minus(Recipe::sphere(0.2)).build();
    let tree = Arc::new(MeasuredModel::new(Arc::new(Model::new(tree))));
    let rules = [Report::Time, Report::Contact, Report::Patch].map(|report| {
        let mut rule = Rule::new(["default".into(), "default".into()]);
        rule.report = report;
        Some(rule)
    });
    for part in [&cube, &tree] {
        let delta = part.resolution;
        let gaps = [(0.0, true), (2.5 * delta, false), (0.01, false), (-delta, true)];
        for (gap, expected) in gaps {
            for rule in rules.iter().chain([&None]) {
                for warm in [false, true] {
                    let mut world = World::new(2, 2);
                    world.set_rules(rule.iter().cloned().collect()).unwrap();
                    world.add_object(ObjectSpec::new(1, part, Pose::at(DVec3::splat(0.5)))).unwrap();
                    let at = Pose::at(DVec3::new(1.5 + gap, 0.5, 0.5));
                    world.add_object(ObjectSpec::new(2, part, at)).unwrap();
                    let options = StepOptions { clear: true, ..StepOptions::default() };
                    if warm {
                        world.step(&[], &options).unwrap();
                    }
                    let out = world.step(&[], &options).unwrap();
                    let [pair] = out.pairs.as_slice() else { panic!("one pair") };
                    let o = &pair.outcome;
                    assert_eq!((o.status(), o.touching), (Status::Clear, expected), "gap {gap:e}, {rule:?}, {warm}");
                }
            }
        }
    }
}

const PART: &str =
    "difference() { cube(size = [1, .7, .5], center = true); cylinder(h = 1, r1 = .1, r2 = .1, center = true); }";

fn session() -> contactd_client::Session<contactd::ipc::Embedded> {
    contactd::embedded(&ServerConfig::default()).unwrap()
}

/// The bits of a reply's slots, work left out.
fn bits(session: &mut contactd_client::Session<contactd::ipc::Embedded>, records: &[PoseRecord]) -> Vec<u8> {
    session.begin_step(records.len()).unwrap().copy_from_slice(records);
    let reply = session.finish(Duration::from_secs(10)).unwrap();
    let mut out = vec![];
    for r in reply.records() {
        out.extend(bytemuck_bytes(r));
    }
    out
}

/// All fields of a record as bytes; zeros of either sign are told apart.
fn bytemuck_bytes(r: &contactd_proto::ContactRecord) -> Vec<u8> {
    let numbers = [r.time, r.time_lower, r.separation, r.normal_speed];
    let numbers = numbers.into_iter().chain(r.point).chain(r.normal).map(f64::to_bits);
    let words = [r.a, r.b, r.valid, r.status.into(), r.kind.into(), r.extent.into(), r.flags.into()];
    let words = words.into_iter().chain(r.faces_a).chain(r.faces_b);
    numbers.flat_map(u64::to_le_bytes).chain(words.flat_map(u32::to_le_bytes)).collect()
}

/// A unit quaternion as a client computes it.
fn unit(rng: &mut Random) -> DQuat {
    let mut part = || rng.within(-1.0, 1.0);
    DQuat::from_xyzw(part(), part(), part(), part()).normalize()
}

#[test]
fn a_pose_is_one_to_the_bit_whichever_way_it_comes_in() {
    let mut rng = Random::new(1);
    let mut reported = 0;
    for round in 0..rounds(100) {
        let (q, mut r, p) = (unit(&mut rng), unit(&mut rng), rng.vector(0.3));
        if round % 4 == 3 {
            // What the wire has to normalise.
            r *= 1.0 + rng.within(-4e-4, 4e-4);
        }
        let pose = Pose::new(p, r);
        let elsewhere = Pose::at(DVec3::splat(3.0));
        let ask = |at: Pose, batches: &[Vec<PoseRecord>]| {
            let mut s = session();
            let model = s.load_model("part", PART).unwrap().id;
            s.add_object(Object::new("a", model).at(Pose::new(DVec3::ZERO, q))).unwrap();
            s.add_object(Object::new("b", model).at(at)).unwrap();
            batches.iter().map(|records| bits(&mut s, records)).last().unwrap()
        };
        let added = ask(pose, &[vec![]]);
        reported += usize::from(!added.is_empty());
        let b = 2;
        assert_eq!(ask(elsewhere, &[vec![PoseRecord::start(b, &pose)]]), added, "START, {round}");
        assert_eq!(
            ask(elsewhere, &[vec![PoseRecord::end(b, &pose)], vec![]]),
            added,
            "END and a step at rest, {round}"
        );
        let twice = vec![PoseRecord::start(b, &pose), PoseRecord::end(b, &pose)];
        assert_eq!(ask(elsewhere, &[twice, vec![]]), added, "START and END, {round}");
    }
    assert!(reported > 30, "{reported} steps reported something");
}

#[test]
fn an_end_that_differs_by_its_last_bit_is_where_the_next_step_starts() {
    let mut rng = Random::new(2);
    let part = Arc::new(MeasuredModel::new(Arc::new(Model::new(plate().build()))));
    for round in 0..200 {
        let (q, p) = (unit(&mut rng), rng.vector(2.0));
        let mut turned = q.to_array();
        let k = rng.below(4);
        turned[k] = f64::from_bits(turned[k].to_bits() ^ 1);
        let end = Pose::new(p, DQuat::from_array(turned));
        let mut world = World::new(2, 2);
        world.add_object(ObjectSpec::new(1, &part, Pose::new(p, q))).unwrap();
        world.step(&[PoseRecord::end(1, &end)], &StepOptions::default()).unwrap();
        let same = |pose: &Pose| pose.rotation.to_array().map(f64::to_bits) == turned.map(f64::to_bits);
        assert!(same(&world.bodies()[0].motion_state.end));
        // Not named any more: it rests where it was told to go. A part of the step that is taken changes nothing of that.
        for advance in [1.0, 0.5, 0.0] {
            world.step(&[], &StepOptions { advance, ..StepOptions::default() }).unwrap();
            let motion_state = world.bodies()[0].motion_state;
            assert!(
                same(&motion_state.end) && same(&motion_state.motion.start) && motion_state.is_rest(),
                "round {round}: {motion_state:?}"
            );
        }
    }
}

#[test]
fn a_world_that_is_restored_goes_on_with_the_same_bits() {
    let mut rng = Random::new(5);
    let part = Arc::new(MeasuredModel::new(Arc::new(Model::new(plate().scaled(0.5).build()))));
    let mut reported = 0;
    for round in 0..rounds(40) {
        let mut first = World::new(3, 6);
        let mut poses = vec![];
        for id in 1..=3 {
            let rough = if id == 2 { 1.0 + 3e-4 } else { 1.0 };
            let pose = Pose::new(rng.vector(0.8), unit(&mut rng) * rough);
            first.add_object(ObjectSpec::new(id, &part, pose)).unwrap();
            poses.push(pose);
        }
        let mut second = World::new(3, 6);
        for (id, pose) in (1..=3).zip(&poses) {
            second.add_object(ObjectSpec::new(id, &part, *pose)).unwrap();
        }
        for step in 0..6 {
            let mut records = vec![];
            for id in 1..=3u32 {
                let pose = &mut poses[id as usize - 1];
                match rng.below(5) {
                    0 => {}
                    1 => {
                        // The last bit alone.
                        let mut q = pose.rotation.to_array();
                        q[step % 4] = f64::from_bits(q[step % 4].to_bits() ^ 1);
                        pose.rotation = DQuat::from_array(q);
                        records.push(PoseRecord::end(id, pose));
                    }
                    2 => {
                        *pose = Pose::new(rng.vector(0.8), unit(&mut rng));
                        records.push(PoseRecord::start(id, pose));
                    }
                    3 => records.push(PoseRecord::turn(id, rng.vector(0.8), rng.vector(1.0))),
                    _ => {
                        *pose = Pose::new(rng.vector(0.8), unit(&mut rng) * (1.0 + rng.within(-4e-4, 4e-4)));
                        records.push(PoseRecord::end(id, pose));
                    }
                }
            }
            let advance = [1.0, 0.5, 0.25][rng.below(3)];
            first.step(&records, &StepOptions { advance, ..StepOptions::default() }).unwrap();
        }
        // As a client tells a successor of the server: every track in bytes.
        let motion_states: Vec<_> = first
            .bodies()
            .iter()
            .map(|body| {
                (body.id, WireTrack::of(body.id, &body.motion_state).checked().expect("an accepted motion_state"))
            })
            .collect();
        for (body, (_, motion_state)) in first.bodies().iter().zip(&motion_states) {
            let bits = |p: &Pose| (p.position.to_array().map(f64::to_bits), p.rotation.to_array().map(f64::to_bits));
            assert_eq!(bits(&body.motion_state.end), bits(&motion_state.end), "round {round}");
            assert_eq!(bits(&body.motion_state.motion.start), bits(&motion_state.motion.start), "round {round}");
        }
        second.restore(&motion_states).unwrap();
        for advance in [0.5, 1.0, 0.75] {
            let records = [PoseRecord::turn(1, rng.vector(0.8), rng.vector(1.0))];
            let options = StepOptions { advance, clear: true, ..StepOptions::default() };
            let seen = |world: &mut World| {
                let out = world.step(&records, &options).unwrap();
                out.pairs.iter().map(|p| (p.a, p.b, outcome_bits(&p.outcome))).collect::<Vec<_>>()
            };
            let (one, other) = (seen(&mut first), seen(&mut second));
            reported += one.len();
            assert_eq!(one, other, "round {round}");
        }
    }
    assert!(reported > 200);
}

/// What is told of a pair, to the bit.
fn outcome_bits(o: &Outcome) -> (Vec<u64>, [u32; 6], [bool; 4], [usize; 3]) {
    let numbers = [
        o.time(),
        o.time_lower(),
        o.time_upper(),
        o.at().separation,
        o.at().normal_speed,
        o.resolution,
        o.penetration().map_or(0.0, |p| p.depth),
    ];
    let deepest = o.penetration().map_or([DVec3::ZERO; 2], |p| [p.point, p.direction]);
    let vectors = [o.at().point, o.at().normal, deepest[0], deepest[1]];
    let numbers = numbers.into_iter().chain(vectors.iter().flat_map(DVec3::to_array)).map(f64::to_bits).collect();
    let faces: Vec<u32> = o.at().faces_a.into_iter().chain(o.at().faces_b).collect();
    let flags = [o.touching, o.not_continued(), o.at().averaged_normal, o.past];
    (numbers, faces.try_into().unwrap(), flags, [o.status() as usize, o.at().kind as usize, o.at().extent as usize])
}
