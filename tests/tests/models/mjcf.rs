//! MJCF: random trees of bodies with copies, classes of defaults, constraints of joints and keyframes, cut into files that include each
//! other, against matrices and filters of the test's own.
//!
//! `CONTACTD_MJCF=3000 cargo test --release -p contactd-tests --test models mjcf::` sets the number of random models (30 by default).

use super::robots::{Maker, frame, models, read, turn, words};
use contactd::import::robot::{Ask, Values, read_robot, scene_of};
use contactd::import::{Facets, Limits};
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::{DMat4, DVec3, DVec4};
use std::collections::BTreeMap;

struct Joint {
    name: String,
    is_slide: bool,
    pos: DVec3,
    axis: DVec3,
    zero: f64,
}

struct Body {
    name: String,
    at: DMat4,
    joints: Vec<Joint>,
    half: DVec3,
    is_mocap: bool,
    inside: Vec<Item>,
}

enum Item {
    Body(Body),
    /// Each turned by its number times angles, and moved along what the one before was turned to.
    Copies {
        count: usize,
        offset: DVec3,
        angles: DVec3,
        sep: &'static str,
        inside: Vec<Item>,
    },
}

/// A body as it stands in the end.
struct Truth {
    name: String,
    at: DMat4,
    half: DVec3,
    parent: Option<usize>,
    moves: bool,
    /// It does not move against its parent.
    is_welded: bool,
}

impl Maker<'_> {
    /// Elements of a section, some of them in a file of their own, which may include another one.
    fn cut(&mut self, mut elements: Vec<String>) -> String {
        if !elements.is_empty() && self.r.chance(0.3) {
            let from = self.r.below(elements.len());
            let to = from + 1 + self.r.below(elements.len() - from);
            let name = self.file("xml");
            let inner: Vec<String> = elements.drain(from..to).collect();
            let inner = self.cut(inner);
            std::fs::write(self.folder.join(&name), format!("<mujocoinclude>\n{inner}\n</mujocoinclude>"))
                .expect("written");
            elements.insert(from, format!("<include file=\"{name}\"/>"));
        }
        elements.join("\n")
    }

    fn placed(&mut self, key: &str) -> (String, DMat4) {
        let (xyz, rpy) = (self.r.vector(1.0), self.r.vector(3.0));
        (format!("{key}=\"{}\" euler=\"{}\"", words(xyz), words(rpy)), frame(xyz, rpy))
    }

    fn body(&mut self, depth: usize, sizes: &BTreeMap<&str, Vec<f64>>) -> (Body, String) {
        let name = self.name("b");
        let (place, at) = self.placed("pos");
        let is_mocap = depth == 0 && self.r.chance(0.2);
        let count = if is_mocap { 0 } else { [0, 1, 1, 2][self.r.below(4)] };
        let (mut joints, mut elements) = (vec![], vec![]);
        for _ in 0..count {
            let name = self.name("j");
            let (pos, axis, is_slide) = (self.r.vector(0.5), self.r.direction(), self.r.chance(0.4));
            let zero = if self.r.chance(0.3) { self.r.within(-1.0, 1.0) } else { 0.0 };
            let kind = if is_slide { "slide" } else { "hinge" };
            elements.push(format!(
                "<joint name=\"{name}\" type=\"{kind}\" pos=\"{}\" axis=\"{}\" ref=\"{zero:?}\"/>",
                words(pos),
                words(2.0 * axis)
            ));
            joints.push(Joint { name, is_slide, pos, axis, zero });
        }
        // The first sizes may be told; the others are the class's.
        let class = ["main", "c", "d"][self.r.below(3)];
        let mut half = sizes[class].clone();
        let told: Vec<f64> = (0..self.r.below(4)).map(|_| self.r.within(0.1, 0.5)).collect();
        half[..told.len()].copy_from_slice(&told);
        let word = |all: &[f64]| all.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" ");
        let size = if told.is_empty() { String::new() } else { format!("size=\"{}\"", word(&told)) };
        elements.push(format!("<geom class=\"{class}\" {size}/>"));
        let (inside, texts) = self.items(depth + 1, sizes);
        elements.extend(texts);
        let mocap = if is_mocap { " mocap=\"true\"" } else { "" };
        let text = format!("<body name=\"{name}\"{mocap} {place}>\n{}\n</body>", self.cut(elements));
        let half = DVec3::from_slice(&half);
        (Body { name, at, joints, half, is_mocap, inside }, text)
    }

    fn items(&mut self, depth: usize, sizes: &BTreeMap<&str, Vec<f64>>) -> (Vec<Item>, Vec<String>) {
        let (mut all, mut texts) = (vec![], vec![]);
        let count = if depth == 0 { 2 + self.r.below(2) } else { self.r.below(3) };
        for _ in 0..if depth > 3 { 0 } else { count } {
            let (body, text) = self.body(depth, sizes);
            if self.r.chance(0.25) && !body.is_mocap {
                let (offset, angles) = (self.r.vector(1.0), self.r.vector(3.0));
                let place = format!("offset=\"{}\" euler=\"{}\"", words(offset), words(angles));
                let (count, sep) = (1 + self.r.below(3), ["", "-"][self.r.below(2)]);
                texts.push(format!(
                    "<replicate count=\"{count}\" sep=\"{sep}\" {place}>{}</replicate>",
                    self.cut(vec![text])
                ));
                all.push(Item::Copies { count, offset, angles, sep, inside: vec![Item::Body(body)] });
            } else {
                texts.push(text);
                all.push(Item::Body(body));
            }
        }
        (all, texts)
    }
}

/// What stands where: bodies, and the joints in their order.
#[derive(Default)]
struct World {
    bodies: Vec<Truth>,
    /// Names, and values where the file has them.
    joints: Vec<(String, f64)>,
}

impl World {
    fn add(
        &mut self,
        items: &[Item],
        (at, parent, suffix): (DMat4, Option<usize>, &str),
        value: &dyn Fn(&str) -> Option<f64>,
    ) {
        for item in items {
            match item {
                Item::Copies { count, offset, angles, sep, inside } => {
                    let mut position = DVec3::ZERO;
                    for k in 0..*count {
                        let own = frame(position, *angles * k as f64);
                        self.add(inside, (at * own, parent, &format!("{sep}{k}{suffix}")), value);
                        position = own.transform_point3(*offset);
                    }
                }
                Item::Body(body) => {
                    let mut stand = at * body.at;
                    for j in &body.joints {
                        let name = format!("{}{suffix}", j.name);
                        let by = value(&name).map_or(0.0, |value| value - j.zero);
                        let to = DMat4::from_translation;
                        stand *= if j.is_slide { to(j.axis * by) } else { to(j.pos) * turn(j.axis, by) * to(-j.pos) };
                        self.joints.push((name, j.zero));
                    }
                    let moves = !body.joints.is_empty() || parent.is_some_and(|p| self.bodies[p].moves);
                    self.bodies.push(Truth {
                        name: format!("{}{suffix}", body.name),
                        at: stand,
                        half: body.half,
                        parent,
                        moves,
                        is_welded: body.joints.is_empty() && !body.is_mocap,
                    });
                    let own = self.bodies.len() - 1;
                    self.add(&body.inside, (stand, Some(own), suffix), value);
                }
            }
        }
    }

    /// The body nearest to the world that a body does not move against; `None`: the world.
    fn weld(&self, body: Option<usize>) -> Option<usize> {
        body.and_then(|b| if self.bodies[b].is_welded { self.weld(self.bodies[b].parent) } else { Some(b) })
    }

    /// MuJoCo's filters of bodies. Source: its documentation, Computation, Collision detection.
    fn is_tested(&self, i: usize, j: usize) -> bool {
        let [a, b] = [i, j].map(|k| self.weld(Some(k)));
        let above = |w: Option<usize>| w.map(|w| self.weld(self.bodies[w].parent));
        let is_child = |a: Option<usize>, b: Option<usize>| a.is_some() && b.is_some() && above(a) == Some(b);
        a != b && !is_child(a, b) && !is_child(b, a) && (self.bodies[i].moves || self.bodies[j].moves)
    }
}

/// Constraints by follower: factors, and the leader.
type Couplings = BTreeMap<String, ([f64; 2], Option<String>)>;

/// The value of a joint: told, or by what it follows, or by the keyframe.
fn value(name: &str, told: &Values, couplings: &Couplings, zeros: &BTreeMap<String, f64>) -> f64 {
    match couplings.get(name) {
        Some(([a, _], None)) => zeros[name] + a,
        Some(([a, b], Some(of))) => zeros[name] + a + b * (value(of, told, couplings, zeros) - zeros[of]),
        None => told.get(name).copied().unwrap_or(zeros[name]),
    }
}

#[test]
fn bodies_are_where_matrices_have_them_and_pairs_are_filtered() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(31);
    let (mut bodies, mut pairs, mut coupled, mut worst) = (0, 0, 0, 0.0_f64);
    for k in 0..sized("CONTACTD_MJCF", 30usize) {
        let mut maker = Maker::new(&mut r, folder.path());
        let numbers = |r: &mut Random, n: usize| (0..n).map(|_| r.within(0.1, 0.5)).collect::<Vec<f64>>();
        let main = numbers(maker.r, 3);
        // A class begins with its parent's sizes, and tells some of its own.
        let (own, inner) = (1 + maker.r.below(2), 1 + maker.r.below(3));
        let (c, d) = (numbers(maker.r, own), numbers(maker.r, inner));
        let over = |below: &[f64], own: &[f64]| [own, &below[own.len()..]].concat();
        let of_c = over(&main, &c);
        let sizes = BTreeMap::from([("main", main.clone()), ("d", over(&of_c, &d)), ("c", of_c)]);
        let word = |all: &[f64]| all.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" ");
        let inner = maker.cut(vec![format!("<geom size=\"{}\"/>", word(&d))]);
        let middle = maker
            .cut(vec![format!("<geom size=\"{}\"/>", word(&c)), format!("<default class=\"d\">{inner}</default>")]);
        let defaults = maker.cut(vec![
            format!("<geom type=\"box\" size=\"{}\"/>", word(&main)),
            format!("<default class=\"c\">{middle}</default>"),
        ]);
        let (items, texts) = maker.items(0, &sizes);
        let mut rest = World::default();
        rest.add(&items, (DMat4::IDENTITY, None, ""), &|_| None);
        let zeros: BTreeMap<String, f64> = rest.joints.iter().cloned().collect();
        let mut couplings = Couplings::new();
        let mut equalities = vec![];
        for (i, (name, _)) in rest.joints.iter().enumerate() {
            if !maker.r.chance(0.25) {
                continue;
            }
            let factors = [maker.r.within(-1.0, 1.0), maker.r.within(-2.0, 2.0)];
            let leader = (i > 0 && maker.r.chance(0.8)).then(|| rest.joints[maker.r.below(i)].0.clone());
            let joint2 = leader.as_ref().map(|of| format!(" joint2=\"{of}\"")).unwrap_or_default();
            let is_active = maker.r.chance(0.8);
            let active = if is_active { "" } else { " active=\"false\"" };
            equalities.push(format!("<joint joint1=\"{name}\"{joint2} polycoef=\"{} 0 0\"{active}/>", word(&factors)));
            if is_active {
                couplings.insert(name.clone(), (factors, leader));
            }
        }
        let key: Values = rest.joints.iter().map(|(name, _)| (name.clone(), maker.r.within(-2.0, 2.0))).collect();
        let qpos: Vec<f64> = rest.joints.iter().map(|(name, _)| key[name]).collect();
        let is_keyed = maker.r.chance(0.5);
        let mut told = if is_keyed { key } else { Values::new() };
        let free = rest.joints.iter().filter(|(name, _)| !couplings.contains_key(name));
        let mut from = Values::new();
        for (name, _) in free {
            if maker.r.chance(0.5) {
                from.insert(name.clone(), maker.r.within(-2.0, 2.0));
            }
        }
        told.extend(from.clone());
        let keyframe = format!("<key name=\"other\"/><key name=\"home\" qpos=\"{}\"/>", word(&qpos));
        let sections = vec![
            "<compiler angle=\"radian\" eulerseq=\"XYZ\"/>".to_owned(),
            format!("<default>{defaults}</default>"),
            format!("<worldbody>{}</worldbody>", maker.cut(texts)),
            format!("<equality>{}</equality>", maker.cut(equalities)),
            format!("<keyframe>{}</keyframe>", maker.cut(vec![keyframe])),
        ];
        let text = format!("<mujoco>{}</mujoco>", maker.cut(sections));
        let mut world = World::default();
        world.add(&items, (DMat4::IDENTITY, None, ""), &|name| Some(value(name, &told, &couplings, &zeros)));
        let ask = Ask { from, key: is_keyed.then(|| "home".to_owned()), ..Ask::default() };
        let (robot, scene) = read(folder.path(), "m.xml", &text, &ask);
        let solids = models(&scene);
        assert_eq!(scene.objects.len(), world.bodies.len(), "{k}\n{text}");
        for body in &world.bodies {
            let object = scene.objects.iter().find(|o| o.name == body.name);
            let object = object.unwrap_or_else(|| panic!("{k}: no {}\n{text}", body.name));
            let pose = object.motion.at(0.0).compose(&object.place);
            for _ in 0..8 {
                let x = r.vector(1.5) * body.half;
                worst = worst.max(pose.point(x).distance(body.at.transform_point3(x)));
                let (f, q) = (solids[object.model].solid.value(x), (x.abs() - body.half).max_element());
                assert!((f < 0.0) == (q < 0.0), "{k}: {} {f} {q}\n{text}", body.name);
            }
            assert!(worst < 1e-10, "{k}: {} is {worst:e} off\n{text}", body.name);
        }
        let place = |b: &Truth| robot.links.iter().position(|l| l.name == b.name).expect("a link");
        for (i, a) in world.bodies.iter().enumerate() {
            for (j, b) in world.bodies.iter().enumerate().skip(i + 1) {
                let tested = !robot.is_excepted(place(a), place(b));
                pairs += usize::from(tested);
                assert_eq!(tested, world.is_tested(i, j), "{k}: {} {}\n{text}", a.name, b.name);
            }
        }
        bodies += world.bodies.len();
        coupled += couplings.len();
    }
    println!("{bodies} bodies, {pairs} pairs tested, {coupled} joints coupled, at most {worst:.1e} off");
    assert!(bodies > 300 && coupled > 20, "{bodies} {coupled}");
}

#[test]
fn what_is_not_kept_is_told_and_what_is_wrong_is_one_sentence_of_its_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::create_dir_all(folder.join("sub/meshes")).expect("folders");
    let mesh = "OFF 4 4 0\n0 0 0\n4 0 0\n0 4 0\n0 0 4\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";
    std::fs::write(folder.join("sub/meshes/t.off"), mesh).expect("written");
    let bodies = "<body name=\"a\"><joint name=\"p\"/><geom size=\"1\"/><body name=\"b\"><joint name=\"q\"/><geom size=\"1\"/></body></body>";
    let write = |text: &str| {
        std::fs::write(folder.join("in.xml"), format!("<mujocoinclude>\n{text}</mujocoinclude>")).expect("written")
    };
    let read = |rest: &str, ask: &Ask| {
        let path = folder.join("m.xml");
        std::fs::write(&path, format!("<mujoco>\n<worldbody>{bodies}</worldbody>\n{rest}</mujoco>")).expect("written");
        let robot = read_robot(&path, ask)?;
        let scene = scene_of(&path, &robot, ask)?;
        scene.load_models(Facets::Auto, &Limits::default()).map(|_| robot)
    };
    let none = Ask::default();
    let stripped = "<compiler strippath=\"true\" meshdir=\"sub/meshes\"/><asset><mesh name=\"m\" file=\"C:/far/t.off\"/></asset>\
                    <worldbody><geom type=\"mesh\" mesh=\"m\"/></worldbody>";
    assert!(read(stripped, &none).is_ok(), "{:?}", read(stripped, &none).err());
    for (inner, words) in [
        ("<equality><weld body1=\"a\" body2=\"b\"/></equality>", "in.xml:2:11: the constraint weld is not kept"),
        ("<equality><joint joint1=\"q\" joint2=\"p\" polycoef=\"0 1 1\"/></equality>", "q does not follow p on a line"),
        (
            "<equality><joint joint1=\"q\" joint2=\"p\"/><joint joint1=\"p\" joint2=\"q\"/></equality>",
            "in.xml:2:41: p and q follow each other",
        ),
        ("<equality><joint joint1=\"q\"/><joint joint1=\"q\"/></equality>", "a second constraint of the joint q"),
    ] {
        write(inner);
        let robot = read("<include file=\"in.xml\"/>", &none).unwrap_or_else(|e| panic!("{e}"));
        let note = robot.notes.iter().find(|n| n.text.contains(words));
        assert!(note.is_some_and(|n| n.at.line == 3), "{inner}: {:?}", robot.notes);
    }
    for (inner, words) in [
        (
            "<worldbody><body name=\"c\">\n<geom type=\"box\" size=\"1\"/></body></worldbody>",
            "m.xml:3:1: FOLDER/in.xml:3:1: expected 2 sizes of the geom",
        ),
        ("<default><default><geom/></default></default>", "in.xml:2:10: expected class of the default"),
        ("<compiler angle=\"turns\"/>", "in.xml:2:1: expected radian or degree"),
        (
            "<equality><joint joint1=\"z\"/></equality>",
            "in.xml:2:11: expected the name of a hinge or a slide, found \"z\"",
        ),
        ("<worldbody><replicate count=\"0\"/></worldbody>", "in.xml:2:12: expected a whole number of copies"),
        (
            "<keyframe><key name=\"k\" qpos=\"1 2 3\"/></keyframe>",
            "in.xml:2:11: expected 2 numbers as qpos, found \"3\"",
        ),
        (
            "<contact><exclude body1=\"a\" body2=\"z\"/></contact>",
            "in.xml:2:10: expected the name of a body, found \"z\"",
        ),
        ("<include file=\"in.xml\"/>", "a file that is included twice"),
    ] {
        write(inner);
        let ask = Ask { key: inner.contains("keyframe").then(|| "k".to_owned()), ..Ask::default() };
        let told = read("<include file=\"in.xml\"/>", &ask).expect_err(inner).to_string();
        let words = words.replace("FOLDER", &folder.display().to_string());
        assert!(told.contains(&words) && told.lines().count() == 1, "{inner}: {told}");
    }
    let ask = Ask { key: Some("k".into()), ..Ask::default() };
    let told = read("", &ask).expect_err("no key").to_string();
    assert!(told.contains("expected a model that has keyframes, found key:k"), "{told}");
}

/// Ways in which an element may say how it is turned.
const TURNS: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];

/// A random turn in one of the ways, as an attribute, with its matrix.
fn turned(r: &mut Random, way: &str) -> (String, DMat4) {
    let word = |all: &[f64]| all.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" ");
    let columns =
        |x: DVec3, y: DVec3, z: DVec3| DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), DVec4::W);
    let (numbers, matrix) = match way {
        "quat" => {
            let q: Vec<f64> = (0..4).map(|_| r.within(-1.0, 1.0)).collect();
            // Each axis as Hamilton's product q e q* has it, divided by the square of q's length.
            let (w, v) = (q[0], DVec3::new(q[1], q[2], q[3]));
            let of =
                |e: DVec3| ((w * w - v.dot(v)) * e + 2.0 * v.dot(e) * v + 2.0 * w * v.cross(e)) / (w * w + v.dot(v));
            (q, columns(of(DVec3::X), of(DVec3::Y), of(DVec3::Z)))
        }
        "axisangle" => {
            let (axis, angle) = (r.direction(), r.within(-3.0, 3.0));
            ((2.0 * axis).extend(angle).to_array().to_vec(), turn(axis, angle))
        }
        "euler" => {
            let angles = r.vector(3.0);
            let [x, y, z] = [turn(DVec3::X, angles.x), turn(DVec3::Y, angles.y), turn(DVec3::Z, angles.z)];
            (angles.to_array().to_vec(), x * y * z)
        }
        "xyaxes" => {
            let (x, z) = (r.direction(), r.direction());
            let y = z.cross(x) / z.cross(x).length();
            // What y has along x does not count.
            let told = [3.0 * x, 2.0 * y + 0.7 * x];
            (told.iter().flat_map(|v| v.to_array()).collect(), columns(x, y, x.cross(y)))
        }
        _ => {
            let z = r.direction();
            let axis = DVec3::Z.cross(z);
            ((2.0 * z).to_array().to_vec(), turn(axis / axis.length(), z.z.acos()))
        }
    };
    (format!("{way}=\"{}\"", word(&numbers)), matrix)
}

/// Classes within classes that are turned in two ways, all twenty pairs of them: a geom is turned as the innermost class that is turned
/// at all, or as itself says.
#[test]
fn a_geom_is_turned_as_the_innermost_class_that_is_turned() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(47);
    for outer in TURNS {
        for inner in TURNS.into_iter().filter(|way| *way != outer) {
            let [(first, _), (second, matrix), (third, own)] = [outer, inner, outer].map(|way| turned(&mut r, way));
            let half = DVec3::new(0.3, 0.6, 0.9);
            let text = format!(
                "<mujoco><compiler angle=\"radian\"/><default><geom type=\"box\" size=\"{}\"/>\
                 <default class=\"p\"><default class=\"c\"><default class=\"d\"><geom mass=\"1\"/></default><geom {second}/></default>\
                 <geom {first}/></default></default><worldbody><body name=\"c\"><geom class=\"c\"/></body>\
                 <body name=\"d\" childclass=\"d\"><geom/></body><body name=\"own\"><geom class=\"c\" {third}/></body>\
                 <body name=\"over\"><geom class=\"p\" {second}/></body></worldbody></mujoco>",
                words(half)
            );
            let (_, scene) = read(folder.path(), "m.xml", &text, &Ask::default());
            let solids = models(&scene);
            for (name, matrix) in [("c", matrix), ("d", matrix), ("own", own), ("over", matrix)] {
                let object = scene.objects.iter().find(|o| o.name == name).expect("an object");
                let back = matrix.inverse();
                for _ in 0..200 {
                    let x = r.vector(1.0);
                    let q = (back.transform_vector3(x).abs() - half).max_element();
                    let f = solids[object.model].solid.value(x);
                    assert!((f < 0.0) == (q < 0.0), "{name}: {f} {q}\n{text}");
                }
            }
        }
    }
}

/// Flags of MuJoCo are words as they stand.
#[test]
fn flags_that_are_none_are_one_sentence() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("m.xml");
    let read = |compiler: &str, body: &str, joint: &str, rest: &str| {
        let text = format!(
            "<mujoco>\n<compiler {compiler}/>\n<worldbody><body {body}><joint name=\"j\" range=\"0 1\" {joint}/></body></worldbody>\n\
             {rest}</mujoco>"
        );
        std::fs::write(&path, text).expect("written");
        read_robot(&path, &Ask::default()).map_err(|e| e.to_string())
    };
    for word in ["True", "1", " true", "yes", "", "true", "false"] {
        let flag = |name: &str| format!("{name}=\"{word}\"");
        let active = format!("<equality><joint joint1=\"j\" {}/></equality>", flag("active"));
        let default = format!("<default><equality {}/></default>", flag("active"));
        for (told, place) in [
            (read(&flag("autolimits"), "", "", ""), "2:1: expected true or false as autolimits"),
            (read(&flag("strippath"), "", "", ""), "2:1: expected true or false as strippath"),
            (read("", &flag("mocap"), "", ""), "3:12: expected true or false as mocap"),
            (read("", "", &flag("limited"), ""), "3:19: expected true or false as limited"),
            (read("", "", "", &active), "4:11: expected true or false as active"),
            (read("", "", "", &default), "4:10: expected true or false as active"),
        ] {
            let wanted = format!("m.xml:{place}, found {word:?}");
            match told {
                Ok(_) => assert!(["true", "false"].contains(&word), "{wanted}"),
                Err(told) => assert!(told.ends_with(&wanted) && !["true", "false"].contains(&word), "{told}"),
            }
        }
    }
    for (word, is_read) in [("enable", true), ("disable", true), ("Disable", false), ("true", false)] {
        let told = read("", "", "", &format!("<option><flag filterparent=\"{word}\"/></option>"));
        let wanted = format!("m.xml:4:9: expected enable or disable as filterparent, found {word:?}");
        assert_eq!(told.err().is_none_or(|e| !e.ends_with(&wanted)), is_read, "{wanted}");
    }
    let is_endless = |joint: &str| {
        let robot = read("autolimits=\"false\"", "", joint, "").expect("a robot");
        robot.links[1].dofs[0].range[1] == f64::INFINITY
    };
    assert!(is_endless("") && is_endless("limited=\"auto\"") && is_endless("limited=\"false\""));
    assert!(!is_endless("limited=\"true\""));
}
