//! Robots of three formats: random arms, written as URDF, MJCF and SDFormat, stand and move where matrices of the test's own have them.
//!
//! `CONTACTD_ROBOTS=2000 cargo test --release -p contactd-tests --test models robots::` sets the number of random arms (20 by default).

use contactd::check::Check;
use contactd::contact::Status;
use contactd::import::robot::{Ask, Robot, Values, read_robot, scene_of};
use contactd::import::{Facets, Limits, Scene};
use contactd::octree::Model;
use contactd::world::StepOptions;
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::{DMat4, DVec3, DVec4};
use std::path::Path;
use std::sync::Arc;

/// A joint of an arm, in the frame of the link before it.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    pub xyz: DVec3,
    pub rpy: DVec3,
    pub axis: DVec3,
    pub kind: &'static str,
    pub range: [f64; 2],
}

/// What a link is, about a frame of its own within it.
#[derive(Clone, Debug)]
pub(super) struct Geometry {
    pub xyz: DVec3,
    pub rpy: DVec3,
    pub kind: &'static str,
    pub size: DVec3,
}

/// Links one after the other, each on the one before.
#[derive(Clone, Debug)]
pub(super) struct Arm {
    pub joints: Vec<Joint>,
    pub links: Vec<Geometry>,
}

/// Draws a robot's text: with names that no two things have, and cut into files of a folder.
pub(super) struct Maker<'a> {
    pub r: &'a mut Random,
    pub folder: &'a Path,
    files: usize,
    names: usize,
}

impl<'a> Maker<'a> {
    pub fn new(r: &'a mut Random, folder: &'a Path) -> Self {
        Self { r, folder, files: 0, names: 0 }
    }

    /// A name that stays its own where a copy of what bears it has a number after it.
    pub fn name(&mut self, letter: &str) -> String {
        self.names += 1;
        format!("{letter}{}x", self.names)
    }

    /// The name of one more file.
    pub fn file(&mut self, ending: &str) -> String {
        self.files += 1;
        format!("part{}.{ending}", self.files)
    }
}

pub(super) fn turn(axis: DVec3, angle: f64) -> DMat4 {
    // Rodrigues' formula, entry by entry.
    let (s, c) = angle.sin_cos();
    let (x, y, z) = (axis.x, axis.y, axis.z);
    let t = 1.0 - c;
    DMat4::from_cols(
        DVec4::new(t * x * x + c, t * x * y + s * z, t * x * z - s * y, 0.0),
        DVec4::new(t * x * y - s * z, t * y * y + c, t * y * z + s * x, 0.0),
        DVec4::new(t * x * z + s * y, t * y * z - s * x, t * z * z + c, 0.0),
        DVec4::W,
    )
}

pub(super) fn shift(v: DVec3) -> DMat4 {
    DMat4::from_translation(v)
}

pub(super) fn frame(xyz: DVec3, rpy: DVec3) -> DMat4 {
    shift(xyz) * turn(DVec3::Z, rpy.z) * turn(DVec3::Y, rpy.y) * turn(DVec3::X, rpy.x)
}

impl Arm {
    pub fn random(r: &mut Random) -> Self {
        let count = 2 + r.below(4);
        let joint = |r: &mut Random| {
            let kind = ["revolute", "revolute", "continuous", "prismatic", "fixed"][r.below(5)];
            let axis = if r.chance(0.3) { DVec3::AXES[r.below(3)] } else { r.direction() };
            let low = r.within(-2.0, 0.5);
            Joint { xyz: r.vector(1.0), rpy: r.vector(3.0), axis, kind, range: [low, low + r.within(0.0, 3.0)] }
        };
        let geometry = |r: &mut Random| {
            let kind = ["box", "sphere", "cylinder", "capsule"][r.below(4)];
            let size = r.vector(0.4).abs() + 0.05;
            Geometry { xyz: r.vector(0.3), rpy: r.vector(3.0), kind, size }
        };
        Self { joints: (1..count).map(|_| joint(r)).collect(), links: (0..count).map(|_| geometry(r)).collect() }
    }

    /// Random values of its joints, by the names that all formats give them.
    fn values(&self, r: &mut Random) -> Values {
        let mut values = Values::new();
        for (i, joint) in self.joints.iter().enumerate().filter(|(_, j)| j.kind != "fixed") {
            let [low, high] = if joint.kind == "continuous" { [-4.0, 4.0] } else { joint.range };
            values.insert(format!("j{i}"), r.within(low, high));
        }
        values
    }

    /// The value of a joint that nobody has told: 0, or the nearest within its limits.
    pub fn start(&self, joint: &str) -> f64 {
        let i: usize = joint[1..].parse().expect("the joint's number");
        let own = &self.joints[i];
        if own.kind == "continuous" { 0.0 } else { 0.0_f64.clamp(own.range[0], own.range[1]) }
    }

    /// Where its links stand.
    pub fn stands(&self, values: &Values) -> Vec<DMat4> {
        let mut at = DMat4::IDENTITY;
        let mut all = vec![at];
        for (i, joint) in self.joints.iter().enumerate() {
            let value = values.get(&format!("j{i}")).copied().unwrap_or(0.0);
            at *= frame(joint.xyz, joint.rpy);
            at *= match joint.kind {
                "fixed" => DMat4::IDENTITY,
                "prismatic" => shift(joint.axis * value),
                _ => turn(joint.axis, value),
            };
            all.push(at);
        }
        all
    }

    pub fn urdf(&self) -> String {
        let mut out = "<robot name=\"arm\">\n".to_owned();
        for (i, g) in self.links.iter().enumerate() {
            let shape = match g.kind {
                "box" => format!("<box size=\"{}\"/>", words(2.0 * g.size)),
                "sphere" => format!("<sphere radius=\"{:?}\"/>", g.size.x),
                kind => format!("<{kind} radius=\"{:?}\" length=\"{:?}\"/>", g.size.x, 2.0 * g.size.y),
            };
            out += &format!(
                "<link name=\"l{i}\"><collision><origin xyz=\"{}\" rpy=\"{}\"/><geometry>{shape}</geometry></collision></link>\n",
                words(g.xyz),
                words(g.rpy)
            );
        }
        for (i, j) in self.joints.iter().enumerate() {
            out += &format!(
                "<joint name=\"j{i}\" type=\"{}\"><parent link=\"l{i}\"/><child link=\"l{}\"/><origin xyz=\"{}\" rpy=\"{}\"/>\
                 <axis xyz=\"{}\"/><limit lower=\"{:?}\" upper=\"{:?}\"/></joint>\n",
                j.kind,
                i + 1,
                words(j.xyz),
                words(j.rpy),
                words(3.0 * j.axis),
                j.range[0],
                j.range[1]
            );
        }
        out + "</robot>\n"
    }

    fn mjcf(&self, degrees: bool) -> String {
        let angle = |v: f64| if degrees { v.to_degrees() } else { v };
        // Roll, pitch, yaw about fixed axes, which capital letters are.
        let mut out = format!(
            "<mujoco><compiler angle=\"{}\" eulerseq=\"XYZ\"/><default><geom rgba=\"1 0 0 1\"/></default><worldbody>\n",
            if degrees { "degree" } else { "radian" }
        );
        for (i, g) in self.links.iter().enumerate() {
            let place = match i.checked_sub(1).map(|k| &self.joints[k]) {
                None => String::new(),
                Some(j) => format!("pos=\"{}\" euler=\"{}\"", words(j.xyz), words(j.rpy.to_array().map(angle).into())),
            };
            out += &format!("<body name=\"l{i}\" {place}>");
            if let Some(k) = i.checked_sub(1).filter(|k| self.joints[*k].kind != "fixed") {
                let j = &self.joints[k];
                let is_slide = j.kind == "prismatic";
                let range = j.range.map(|x| if is_slide { x } else { angle(x) });
                let limits = match j.kind {
                    "continuous" => String::new(),
                    _ => format!("range=\"{:?} {:?}\"", range[0], range[1]),
                };
                let kind = if is_slide { "slide" } else { "hinge" };
                out += &format!("<joint name=\"j{k}\" type=\"{kind}\" axis=\"{}\" {limits}/>", words(j.axis));
            }
            let size = match g.kind {
                "sphere" => format!("{:?}", g.size.x),
                "box" => words(g.size),
                _ => format!("{:?} {:?}", g.size.x, g.size.y),
            };
            let euler = words(g.rpy.to_array().map(angle).into());
            out += &format!("<geom type=\"{}\" size=\"{size}\" pos=\"{}\" euler=\"{euler}\"/>\n", g.kind, words(g.xyz));
        }
        out + &"</body>".repeat(self.links.len()) + "</worldbody></mujoco>\n"
    }

    fn sdf(&self) -> String {
        let mut out = "<sdf version=\"1.9\"><model name=\"arm\">\n".to_owned();
        for (i, g) in self.links.iter().enumerate() {
            let place = match i.checked_sub(1).map(|k| &self.joints[k]) {
                None => String::new(),
                Some(j) => format!("<pose relative_to=\"l{}\">{} {}</pose>", i - 1, words(j.xyz), words(j.rpy)),
            };
            let shape = match g.kind {
                "box" => format!("<box><size>{}</size></box>", words(2.0 * g.size)),
                "sphere" => format!("<sphere><radius>{:?}</radius></sphere>", g.size.x),
                kind => {
                    format!("<{kind}><radius>{:?}</radius><length>{:?}</length></{kind}>", g.size.x, 2.0 * g.size.y)
                }
            };
            out += &format!(
                "<link name=\"l{i}\">{place}<collision name=\"c\"><pose>{} {}</pose><geometry>{shape}</geometry></collision></link>\n",
                words(g.xyz),
                words(g.rpy)
            );
        }
        for (i, j) in self.joints.iter().enumerate() {
            let limit = format!("<limit><lower>{:?}</lower><upper>{:?}</upper></limit>", j.range[0], j.range[1]);
            let limit = if j.kind == "continuous" { "" } else { &limit };
            out += &format!(
                "<joint name=\"j{i}\" type=\"{}\"><parent>l{i}</parent><child>l{}</child><axis><xyz>{}</xyz>{limit}</axis></joint>\n",
                j.kind,
                i + 1,
                words(j.axis)
            );
        }
        // The base stands; as a model of its own it could be anywhere.
        out + "<joint name=\"base\" type=\"fixed\"><parent>world</parent><child>l0</child></joint></model></sdf>\n"
    }
}

pub(super) fn words(v: DVec3) -> String {
    format!("{:?} {:?} {:?}", v.x, v.y, v.z)
}

impl Geometry {
    /// A point within or beside it, in the link's frame.
    pub fn point(&self, r: &mut Random) -> DVec3 {
        frame(self.xyz, self.rpy).transform_point3(r.vector(0.6))
    }

    /// The signed distance of a point of the link. Source: textbooks.
    pub fn value(&self, x: DVec3) -> f64 {
        let x = frame(self.xyz, self.rpy).inverse().transform_point3(x);
        let (r, half) = (self.size.x, self.size.y);
        match self.kind {
            "box" => {
                let q = x.abs() - self.size;
                q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
            }
            "sphere" => x.length() - r,
            "capsule" => (x - DVec3::Z * x.z.clamp(-half, half)).length() - r,
            _ => {
                let (across, up) = (x.truncate().length() - r, x.z.abs() - half);
                across.max(0.0).hypot(up.max(0.0)) + across.max(up).min(0.0)
            }
        }
    }
}

pub(super) fn read(folder: &Path, name: &str, text: &str, ask: &Ask) -> (Robot, Scene) {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("written");
    let robot = read_robot(&path, ask).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let scene = scene_of(&path, &robot, ask).unwrap_or_else(|e| panic!("{e}\n{text}"));
    (robot, scene)
}

pub(super) fn models(scene: &Scene) -> Vec<Arc<Model>> {
    let imports = scene.load_models(Facets::Auto, &Limits::default()).expect("models");
    imports.into_iter().map(|import| Arc::new(Model::new(import.solid))).collect()
}

#[test]
fn arms_of_three_formats_stand_and_move_where_matrices_have_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(12);
    let (mut moved, mut worst) = (0, 0.0_f64);
    for k in 0..sized("CONTACTD_ROBOTS", 20usize) {
        let arm = Arm::random(&mut r);
        let from = arm.values(&mut r);
        let mut to = Values::new();
        if !from.is_empty() {
            let joint = from.keys().nth(r.below(from.len())).expect("a joint").clone();
            to.insert(joint.clone(), arm.values(&mut r)[&joint]);
        }
        let ask = Ask { from: from.clone(), to: to.clone(), ..Ask::default() };
        let formats = [("arm.urdf", arm.urdf()), ("arm.xml", arm.mjcf(r.chance(0.5))), ("arm.sdf", arm.sdf())];
        for (name, text) in &formats {
            let (robot, scene) = read(folder.path(), name, text, &ask);
            assert_eq!(scene.objects.len(), arm.links.len(), "{name} {k}");
            let models = models(&scene);
            for t in [0.0, 0.37, 1.0] {
                let mut values = from.clone();
                for (joint, end) in &to {
                    let start = from[joint];
                    values.insert(joint.clone(), start + t * (end - start));
                }
                let stands = arm.stands(&values);
                for (i, object) in scene.objects.iter().enumerate() {
                    let pose = object.motion.at(t).compose(&object.place);
                    let solid = &models[object.model].solid;
                    for _ in 0..12 {
                        let x = r.vector(0.8);
                        let expected = stands[i].transform_point3(x);
                        worst = worst.max((pose.point(x) - expected).length());
                        let off = (solid.value(x) - arm.links[i].value(x)).abs();
                        let is_same = (solid.value(x) < 0.0) == (arm.links[i].value(x) < 0.0) || off < 1e-12;
                        assert!(is_same, "{name} {k}: {x} of link {i}: {} {}", solid.value(x), arm.links[i].value(x));
                    }
                    assert!(worst < 1e-12 * 20.0, "{name} {k}: link {i} at {t} is {worst:e} off\n{text}");
                    moved += usize::from(!object.motion.spin.eq(&DVec3::ZERO));
                }
            }
            for (i, joint) in arm.joints.iter().enumerate().filter(|(_, j)| j.kind != "fixed" && j.kind != "continuous")
            {
                let dof = robot.free().find(|d| d.name == format!("j{i}")).expect("the joint");
                let off = (dof.range[0] - joint.range[0]).abs().max((dof.range[1] - joint.range[1]).abs());
                assert!(off < 1e-14, "{name} {k}: {:?} {:?}", dof.range, joint.range);
            }
            // Neighbours are not tested, nor what does not move against each other.
            let except = &scene.rules[0].except;
            let is_excepted = |i: usize, j: usize| {
                let (a, b) = (&scene.objects[i].name, &scene.objects[j].name);
                except.iter().any(|[p, q]| (p == a && q == b) || (p == b && q == a))
            };
            for i in 0..arm.links.len() {
                for j in i + 1..arm.links.len() {
                    let welded = arm.joints[i..j].iter().all(|joint| joint.kind == "fixed");
                    // Links of one model of SDFormat are tested where it says so; MuJoCo takes what is welded for one.
                    if j == i + 1 || welded || *name == "arm.sdf" {
                        let of_world =
                            *name == "arm.xml" && !welded && arm.joints[..i].iter().all(|j| j.kind == "fixed");
                        assert!(is_excepted(i, j) || of_world, "{name} {k}: {i} {j}\n{text}");
                    } else if *name == "arm.urdf" {
                        assert!(!is_excepted(i, j), "{name} {k}: {i} {j}\n{text}");
                    }
                }
            }
        }
    }
    println!("links are at most {worst:.1e} off where matrices have them");
    assert!(moved > 100, "{moved} turned");
}

/// A rod on a hinge swings into a ball: it meets it at the angle at which its side has come there.
#[test]
fn a_link_that_swings_meets_what_is_in_its_way_on_its_arc() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(7);
    for k in 0..20 {
        let (long, thick, ball, d) = (2.0, r.within(0.02, 0.1), r.within(0.05, 0.2), r.within(0.5, 1.5));
        let whole = r.within(1.0, 3.0);
        let lag = ((thick + ball) / d).asin();
        let angle = lag + (whole - lag) * r.within(0.1, 0.9);
        let at = DVec3::new(d * angle.cos(), d * angle.sin(), 0.0);
        let half_pi = std::f64::consts::FRAC_PI_2;
        let text = format!(
            "<robot name=\"r\"><link name=\"base\"><collision><origin xyz=\"{}\"/><geometry><sphere radius=\"{ball:?}\"/></geometry></collision></link>\
             <link name=\"hub\"/><link name=\"rod\"><collision><origin xyz=\"{:?} 0 0\" rpy=\"0 {half_pi:?} 0\"/><geometry>\
             <cylinder radius=\"{thick:?}\" length=\"{long:?}\"/></geometry></collision></link>\
             <joint name=\"lift\" type=\"prismatic\"><parent link=\"base\"/><child link=\"hub\"/><axis xyz=\"0 0 1\"/><limit lower=\"0\" upper=\"1\"/></joint>\
             <joint name=\"swing\" type=\"continuous\"><parent link=\"hub\"/><child link=\"rod\"/><axis xyz=\"0 0 1\"/></joint></robot>",
            words(at),
            0.5 * long
        );
        let ask = Ask { to: Values::from([("swing".to_owned(), whole)]), ..Ask::default() };
        let (_, scene) = read(folder.path(), "swing.urdf", &text, &ask);
        let mut check = Check::new(&scene, &models(&scene), None).expect("a world");
        let outcome = check.step_with(&StepOptions::default()).expect("a step");
        let pair = &outcome.pairs[0].outcome;
        let expected = (angle - lag) / whole;
        assert_eq!((outcome.pairs.len(), pair.status()), (1, Status::Contact), "{k}");
        assert!((pair.time() - expected).abs() < 1e-11, "{k}: {} {expected}", pair.time());
    }
}

/// A geometry has one shape: what else is in it is told, and does not count.
#[test]
fn a_second_shape_of_a_geometry_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("two.urdf");
    let shapes = "<sphere radius=\"1\"/>\n<box size=\"4 4 4\"/>";
    let text = format!("<robot><link name=\"a\"><collision><geometry>{shapes}</geometry></collision></link></robot>");
    std::fs::write(&path, text).expect("written");
    let robot = read_robot(&path, &Ask::default()).unwrap_or_else(|e| panic!("{e}"));
    let [note] = &robot.notes[..] else { panic!("{:?}", robot.notes) };
    assert!(note.at.line == 2 && note.text == "a collision of a has a shape already: its box is left out", "{note:?}");
}

#[test]
fn what_is_wrong_is_one_sentence_with_its_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = |name: &str, text: &str, ask: &Ask| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("written");
        let scene = read_robot(&path, ask).and_then(|robot| scene_of(&path, &robot, ask));
        let sentence = scene.and_then(|scene| scene.load_models(Facets::Auto, &Limits::default()).map(|_| ()));
        sentence.map_or_else(|e| e.to_string(), |()| String::new())
    };
    let two = "<robot><link name=\"a\"/><link name=\"b\"/><joint name=\"j\" type=\"revolute\"><parent link=\"a\"/><child link=\"b\"/>\
               <limit lower=\"-1\" upper=\"1\"/></joint></robot>";
    let some = |name: &str, value: f64| Values::from([(name.to_owned(), value)]);
    let chain = "<robot><link name=\"a\"/><link name=\"b\"/><link name=\"c\"><collision><geometry><sphere radius=\"1\"/></geometry></collision></link>\
                 <joint name=\"p\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/></joint><joint name=\"q\" type=\"continuous\">\
                 <parent link=\"b\"/><child link=\"c\"/><axis xyz=\"0 0 1\"/></joint></robot>";
    let both = Values::from([("p".to_owned(), 1.0), ("q".to_owned(), 1.0)]);
    let none = Ask::default();
    let from = |values| Ask { from: values, ..Ask::default() };
    for (name, text, ask, words) in [
        ("a.urdf", "<robot><link/></robot>", &none, "a.urdf:1:8: expected name of the link, found none"),
        (
            "a.urdf",
            "<robot><link name=\"a\"/><link name=\"a\"/></robot>",
            &none,
            "expected a name that no other link has",
        ),
        (
            "a.urdf",
            "<thing/>",
            &none,
            "expected a robot (URDF), an sdf or a mujoco as the root element, found \"thing\"",
        ),
        ("a.urdf", two, &from(some("k", 0.0)), "expected one of the joints j, found \"k\""),
        ("a.urdf", two, &from(some("j", 2.0)), "expected -1 to 1 as j, found 2"),
        (
            "a.urdf",
            &two.replace("\"b\"/>\n", "\"z\"/>").replace("child link=\"b\"", "child link=\"z\""),
            &none,
            "expected the name of a link, found \"z\"",
        ),
        ("a.urdf", chain, &Ask { to: both, ..Ask::default() }, "found p and q moving at once"),
        (
            "a.urdf",
            "<robot><link name=\"a\">\n<collision><geometry><mesh filename=\"package://p/no.stl\"/></geometry></collision></link></robot>",
            &none,
            "no.stl",
        ),
        (
            "a.urdf",
            "<robot><link name=\"a\"><collision><geometry><sphere radius=\"-1\"/></geometry></collision></link></robot>",
            &none,
            "not negative, found \"-1\"",
        ),
        (
            "a.xml",
            "<mujoco><contact><pair/></contact></mujoco>",
            &none,
            "a.xml:1:18: expected geom1 of the pair, found none",
        ),
        ("a.urdf", "<robot xmlns:x=\"http://ros.org/wiki/xacro\"><x:arm/></robot>", &none, "run xacro first"),
        ("a.urdf", "<robot/>", &none, "expected links of the robot"),
        ("a.urdf", "<robot><link name=\"a\"/><link name=\"b\"/></robot>", &none, "found a second one, \"b\""),
        (
            "a.sdf",
            "<sdf version=\"1.9\"><model name=\"m\"><pose relative_to=\"f\">1 0 0 0 0 0</pose></model></sdf>",
            &none,
            "a.sdf:1:20: expected frames that are there and lead to the scope's own, found \"f\", which is no frame of the scope",
        ),
        (
            "a.xml",
            "<mujoco><worldbody><geom type=\"sdf\"/></worldbody></mujoco>",
            &none,
            "a geom of type sdf, which is not supported",
        ),
        (
            "a.xml",
            "<mujoco><worldbody><geom class=\"x\" size=\"1\"/></worldbody></mujoco>",
            &none,
            "expected the name of a default class, found \"x\"",
        ),
        (
            "a.xml",
            "<mujoco><worldbody><geom type=\"box\" size=\"1 1\"/></worldbody></mujoco>",
            &none,
            "expected 3 sizes of the geom",
        ),
        (
            "a.xml",
            "<mujoco><worldbody><geom type=\"box\" size=\"1 1 1 1\"/></worldbody></mujoco>",
            &none,
            "expected three sizes of the geom at most, found \"1 1 1 1\"",
        ),
        (
            "a.xml",
            "<mujoco><asset><mesh name=\"m\" file=\"a.stl\"/><mesh name=\"m\" file=\"b.stl\"/></asset></mujoco>",
            &none,
            "a.xml:1:45: expected a name that no other mesh has, found \"m\"",
        ),
        (
            "a.urdf",
            &two.replace("<limit", "<axis xyz=\"0 0 0\"/><limit"),
            &none,
            "expected an axis of j that is not 0, found \"[0, 0, 0]\"",
        ),
        (
            "a.sdf",
            "<sdf version=\"1.7\"><model name=\"m\"><link name=\"a\"><pose>1 2</pose></link></model></sdf>",
            &none,
            "expected x y z roll pitch yaw as the pose, found \"1 2\"",
        ),
        (
            "a.sdf",
            "<sdf version=\"1.7\"><world name=\"w\"><include><uri>model://x</uri></include></world></sdf>",
            &none,
            "expected the model model://x",
        ),
    ] {
        let sentence = of(name, text, ask);
        assert!(sentence.contains(words) && sentence.lines().count() == 1, "{text}: {sentence}");
    }
}

/// Whatever becomes of a text, reading it ends with a scene or a sentence.
#[test]
fn texts_that_were_damaged_are_read_or_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(99);
    let (mut scenes, mut refused) = (0, 0);
    for k in 0..sized("CONTACTD_ROBOTS", 20usize) * 10 {
        let arm = Arm::random(&mut r);
        let (name, text) = match k % 3 {
            0 => ("d.urdf", arm.urdf()),
            1 => ("d.xml", arm.mjcf(true)),
            _ => ("d.sdf", arm.sdf()),
        };
        let mut words: Vec<&str> = text.split_inclusive(['<', '"', ' ', '/']).collect();
        for _ in 0..1 + r.below(3) {
            let (i, j) = (r.below(words.len()), r.below(words.len()));
            match r.below(4) {
                0 => _ = words.remove(i),
                1 => words.swap(i, j),
                2 => words[i] = words[j],
                _ => words.insert(i, ["nan", "1e400", "-3", "l0", "\"", "world"][r.below(6)]),
            }
        }
        let path = folder.path().join(name);
        std::fs::write(&path, words.concat()).expect("written");
        let to = if r.chance(0.5) { Values::new() } else { Values::from([("j0".to_owned(), r.within(-1.0, 1.0))]) };
        let ask = Ask { to, ..Ask::default() };
        match read_robot(&path, &ask).and_then(|robot| scene_of(&path, &robot, &ask)) {
            Ok(_) => scenes += 1,
            Err(e) => {
                assert_eq!(e.to_string().lines().count(), 1, "{e}");
                refused += 1;
            }
        }
    }
    println!("{scenes} were read, {refused} refused");
    assert!(scenes > 0 && refused > 20, "{scenes} {refused}");
}
