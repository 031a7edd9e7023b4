//! Frames of SDFormat: random graphs of them, in worlds, models, models within models and included files, against matrices that were
//! drawn beside the text.
//!
//! `CONTACTD_FRAMES=5000 cargo test --release -p contactd-tests --test models frames::` sets the number of random worlds (30 by default).

use super::robots::{Maker, frame, models, read, turn, words};
use contactd::import::robot::{Ask, DofKind, Robot, Values, read_robot, scene_of};
use contactd::import::{Facets, Limits};
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::{DMat4, DVec3};
use std::path::Path;

/// A link: its name from the scope on, its collision box and that one's frame, in the scope.
struct Link {
    name: String,
    at: DMat4,
    shape: DMat4,
    half: DVec3,
}

/// A joint: its name, the links of it by name (no parent: the world), a point and a direction of its axis in the scope.
struct Joint {
    name: String,
    parent: Option<String>,
    child: String,
    kind: &'static str,
    point: DVec3,
    axis: DVec3,
    /// The joint that it follows, with factor, reference and offset.
    mimic: Option<(String, [f64; 3])>,
}

/// A scope: its text, and what is true of it.
struct Made {
    text: Vec<String>,
    /// Frames by name, with the link that they go with.
    frames: Vec<(String, DMat4, Option<String>)>,
    links: Vec<Link>,
    joints: Vec<Joint>,
    /// The link that its own frame goes with.
    canonical: Option<String>,
}

impl Maker<'_> {
    /// A pose as text, relative to one of some frames or to what it is by default, and its matrix.
    fn pose(&mut self, frames: &[(String, DMat4, Option<String>)], default: DMat4) -> (String, DMat4) {
        let (xyz, rpy) = (self.r.vector(1.0), self.r.vector(3.0));
        let own = frame(xyz, rpy);
        let told = frames.get(self.r.below(frames.len() + 1));
        let of = told.map(|f| format!(" relative_to=\"{}\"", f.0)).unwrap_or_default();
        let text = match self.r.below(3) {
            0 => format!(
                "<pose{of} degrees=\"true\">{} {}</pose>",
                words(xyz),
                words(rpy * (180.0 / std::f64::consts::PI))
            ),
            _ => format!("<pose{of}>{} {}</pose>", words(xyz), words(rpy)),
        };
        (text, told.map_or(default, |f| f.1) * own)
    }

    /// A world (`depth` 0) or a model.
    fn scope(&mut self, depth: usize) -> Made {
        let is_world = depth == 0;
        let (mut text, mut frames, mut links, mut joints) = (vec![], vec![], vec![], vec![]);
        let mut canonical = None;
        let own = if is_world { "world" } else { "__model__" };
        let count = if is_world { 0 } else { 2 + self.r.below(2) };
        // Links' own texts are written last: what collides may be relative to any frame.
        let mut heads = vec![];
        let mut nested = if depth < 3 { self.r.below(3) + usize::from(is_world) } else { 0 };
        let mut plain = self.r.below(4);
        while links_left(&heads, count) || nested > 0 || plain > 0 {
            match self.r.below(3) {
                0 if links_left(&heads, count) => {
                    let (pose, at) = self.pose(&frames, DMat4::IDENTITY);
                    let name = self.name("l");
                    frames.push((name.clone(), at, Some(name.clone())));
                    heads.push((name, pose, at));
                }
                1 if nested > 0 => {
                    nested -= 1;
                    self.model(depth, (&mut text, &mut frames), (&mut links, &mut joints));
                }
                2 if plain > 0 && !frames.is_empty() => {
                    plain -= 1;
                    let name = self.name("f");
                    let to = self.r.below(frames.len() + 1);
                    let (attached, default, link) = match frames.get(to) {
                        Some(f) => (format!(" attached_to=\"{}\"", f.0), f.1, f.2.clone()),
                        // The scope's own, whose link is known in the end.
                        None => (String::new(), DMat4::IDENTITY, Some("?".to_owned()).filter(|_| !is_world)),
                    };
                    let (pose, at) = self.pose(&frames, default);
                    text.push(format!("<frame name=\"{name}\"{attached}>{pose}</frame>"));
                    frames.push((name, at, link));
                }
                _ if frames.is_empty() => plain = 0,
                _ => {}
            }
        }
        if let Some(chosen) = heads.first() {
            canonical = Some(chosen.0.clone());
        }
        for f in frames.iter_mut().filter(|f| f.2.as_deref() == Some("?")) {
            f.2.clone_from(&canonical);
        }
        let within = frames.clone();
        for (name, pose, at) in heads {
            let half = self.r.vector(0.3).abs() + 0.1;
            let (place, shape) = self.pose(&within, at);
            text.push(format!(
                "<link name=\"{name}\">{pose}<collision name=\"c\">{place}<geometry><box><size>{}</size></box></geometry></collision></link>",
                words(2.0 * half)
            ));
            links.push(Link { name, at, shape, half });
        }
        // The first link is the canonical one, and stays where it is.
        let rest = text.len() - count;
        let head = text.split_off(rest);
        shuffle(self.r, &mut text);
        text.splice(0..0, head);
        let all = frames.clone();
        for _ in 0..self.r.below(4) {
            self.joint(own, &all, (&mut text, &mut frames), (&links, &mut joints));
        }
        Made { text, frames, links, joints, canonical }
    }

    /// A model within, in place or of another file.
    fn model(
        &mut self,
        depth: usize,
        (text, frames): (&mut Vec<String>, &mut Vec<(String, DMat4, Option<String>)>),
        (links, joints): (&mut Vec<Link>, &mut Vec<Joint>),
    ) {
        let made = self.scope(depth + 1);
        let name = self.name("m");
        let (pose, at) = self.pose(frames, DMat4::IDENTITY);
        let chosen = (self.r.chance(0.4)).then(|| self.r.below(made.frames.len()));
        let at = chosen.map_or(at, |k| at * made.frames[k].1.inverse());
        let is_merged = depth > 0 && self.r.chance(0.3);
        let body = made.text.join("\n");
        if is_merged || self.r.chance(0.4) {
            let file = self.file("sdf");
            let placed = chosen.map(|k| format!("<placement_frame>{}</placement_frame>", made.frames[k].0));
            // What the file says of the model's own place is not asked for.
            let whole =
                format!("<sdf version=\"1.10\"><model name=\"own\"><pose>1 2 3 0 0 1</pose>\n{body}\n</model></sdf>");
            std::fs::write(self.folder.join(&file), whole).expect("written");
            let merge = if is_merged { " merge=\"true\"" } else { "" };
            text.push(format!(
                "<include{merge}><uri>{file}</uri><name>{name}</name>{pose}{}</include>",
                placed.unwrap_or_default()
            ));
        } else {
            let placed = chosen.map(|k| format!(" placement_frame=\"{}\"", made.frames[k].0)).unwrap_or_default();
            text.push(format!("<model name=\"{name}\"{placed}>{pose}\n{body}\n</model>"));
        }
        let own = |inner: &str| if is_merged { inner.to_owned() } else { format!("{name}::{inner}") };
        if !is_merged {
            frames.push((name.clone(), at, made.canonical.as_deref().map(own)));
        }
        frames.extend(made.frames.iter().map(|(f, m, l)| (own(f), at * *m, l.as_deref().map(own))));
        links.extend(made.links.into_iter().map(|l| Link {
            name: own(&l.name),
            at: at * l.at,
            shape: at * l.shape,
            ..l
        }));
        joints.extend(made.joints.into_iter().map(|j| Joint {
            name: own(&j.name),
            parent: j.parent.as_deref().map(own),
            child: own(&j.child),
            point: at.transform_point3(j.point),
            axis: at.transform_vector3(j.axis),
            mimic: j.mimic.map(|(leader, numbers)| (own(&leader), numbers)),
            ..j
        }));
    }

    fn joint(
        &mut self,
        own: &str,
        all: &[(String, DMat4, Option<String>)],
        (text, frames): (&mut Vec<String>, &mut Vec<(String, DMat4, Option<String>)>),
        (links, joints): (&[Link], &mut Vec<Joint>),
    ) {
        let with_link: Vec<_> = all.iter().filter(|f| f.2.is_some()).collect();
        if with_link.len() < 2 {
            return;
        }
        let (parent, child) = (with_link[self.r.below(with_link.len())], with_link[self.r.below(with_link.len())]);
        let link = child.2.clone().expect("a link");
        let above = (!self.r.chance(0.2)).then(|| parent.2.clone().expect("a link"));
        // One joint above each link, and no circle.
        let mut at = above.clone();
        while let Some(name) = at {
            if name == link {
                return;
            }
            at = joints.iter().find(|j| j.child == name).and_then(|j| j.parent.clone());
        }
        if joints.iter().any(|j| j.child == link) || !links.iter().any(|l| l.name == link) {
            return;
        }
        let name = self.name("j");
        let (pose, stand) = self.pose(all, child.1);
        let axis = self.r.direction();
        let told = all.get(self.r.below(all.len() + 2));
        let (expressed, way) = match (told, self.r.chance(0.2)) {
            (_, true) => (format!(" expressed_in=\"{own}\""), axis),
            (Some(f), _) => (format!(" expressed_in=\"{}\"", f.0), f.1.transform_vector3(axis)),
            (None, _) => (String::new(), stand.transform_vector3(axis)),
        };
        let kind = ["revolute", "prismatic", "continuous", "fixed"][self.r.below(4)];
        let leaders: Vec<&str> = joints.iter().filter(|j| j.kind != "fixed").map(|j| j.name.as_str()).collect();
        let numbers = [self.r.within(-2.0, 2.0), self.r.within(-1.0, 1.0), self.r.within(-1.0, 1.0)];
        let mimic = (kind != "fixed" && !leaders.is_empty() && self.r.chance(0.4))
            .then(|| (leaders[self.r.below(leaders.len())].to_owned(), numbers));
        let follows = mimic.as_ref().map(|(leader, [factor, reference, offset])| {
            format!(
                "<mimic joint=\"{leader}\" axis=\"axis\"><multiplier>{factor:?}</multiplier><reference>{reference:?}</reference>\
                 <offset>{offset:?}</offset></mimic>"
            )
        });
        text.push(format!(
            "<joint name=\"{name}\" type=\"{kind}\"><parent>{}</parent><child>{}</child>{pose}\
             <axis><xyz{expressed}>{}</xyz>{}</axis></joint>",
            above.as_ref().map_or("world", |_| parent.0.as_str()),
            child.0,
            words(axis),
            follows.unwrap_or_default()
        ));
        frames.push((name.clone(), stand, Some(link.clone())));
        let point = stand.transform_point3(DVec3::ZERO);
        joints.push(Joint { name, parent: above, child: link, kind, point, axis: way, mimic });
    }
}

fn links_left<T>(heads: &[T], count: usize) -> bool {
    heads.len() < count
}

fn shuffle(r: &mut Random, all: &mut [String]) {
    for i in (1..all.len()).rev() {
        all.swap(i, r.below(i + 1));
    }
}

impl Made {
    /// The value of a joint.
    fn value(&self, name: &str, values: &Values) -> f64 {
        let joint = self.joints.iter().find(|j| j.name == name).expect("a joint");
        match &joint.mimic {
            Some((leader, [factor, reference, offset])) => factor * (self.value(leader, values) - reference) + offset,
            None => values.get(name).copied().unwrap_or(0.0),
        }
    }

    /// By how much a link has moved in the world.
    fn moved(&self, link: &str, values: &Values) -> DMat4 {
        let Some(joint) = self.joints.iter().find(|j| j.child == link) else { return DMat4::IDENTITY };
        let by = if joint.kind == "fixed" { 0.0 } else { self.value(&joint.name, values) };
        let own = match joint.kind {
            "prismatic" => DMat4::from_translation(joint.axis * by),
            _ => DMat4::from_translation(joint.point) * turn(joint.axis, by) * DMat4::from_translation(-joint.point),
        };
        joint.parent.as_deref().map_or(DMat4::IDENTITY, |parent| self.moved(parent, values)) * own
    }
}

#[test]
fn frames_are_where_matrices_have_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(77);
    let (mut links, mut moved, mut followed, mut worst) = (0, 0, 0, 0.0_f64);
    for k in 0..sized("CONTACTD_FRAMES", 30usize) {
        let mut maker = Maker::new(&mut r, folder.path());
        let made = maker.scope(0);
        let text = format!("<sdf version=\"1.11\"><world name=\"w\">\n{}\n</world></sdf>", made.text.join("\n"));
        let is_one = made.links.iter().all(|l| l.name.split("::").next() == made.links[0].name.split("::").next());
        // Joints of a file that has one model are called by their own names.
        let short = |name: &str| match name.split_once("::") {
            Some((_, own)) if is_one && !own.contains("::") => own.to_owned(),
            _ => name.to_owned(),
        };
        let free = made.joints.iter().filter(|j| j.kind != "fixed" && j.mimic.is_none());
        let values: Values = free.map(|j| (j.name.clone(), r.within(-2.0, 2.0))).collect();
        let told = values.iter().map(|(name, value)| (short(name), *value)).collect();
        let ask = Ask { from: told, ..Ask::default() };
        let (_, scene) = read(folder.path(), "w.sdf", &text, &ask);
        let solids = models(&scene);
        assert_eq!(scene.objects.len(), made.links.len(), "{k}\n{text}");
        for link in &made.links {
            let object = scene.objects.iter().find(|o| o.name == link.name);
            let object = object.unwrap_or_else(|| panic!("{k}: no {}\n{text}", link.name));
            let by = made.moved(&link.name, &values);
            let pose = object.motion.at(0.0).compose(&object.place);
            for _ in 0..8 {
                let x = r.vector(1.0);
                let stands = (by * link.at).transform_point3(x);
                worst = worst.max(pose.point(x).distance(stands));
                // The box, from its own frame.
                let p = r.vector(1.5) * link.half;
                let q = (p.abs() - link.half).max_element();
                let f = solids[object.model].solid.value(pose.inverse().point((by * link.shape).transform_point3(p)));
                assert!((f < 0.0) == (q < 0.0) || f.abs() < 1e-9, "{k}: {} {f} {q}\n{text}", link.name);
            }
            assert!(worst < 1e-10, "{k}: {} is {worst:e} off\n{text}", link.name);
            links += 1;
            moved += usize::from(by != DMat4::IDENTITY);
        }
        followed += made.joints.iter().filter(|j| j.mimic.is_some()).count();
    }
    println!("{links} links, {moved} of them moved, {followed} joints that follow, at most {worst:.1e} off");
    assert!(links > 100 && moved > 30 && followed > 3, "{links} {moved} {followed}");
}

/// What is wrong with a world, or "".
fn sentence(folder: &Path, text: &str) -> String {
    let path = folder.join("w.sdf");
    std::fs::write(&path, text).expect("written");
    let scene = read_robot(&path, &Ask::default()).and_then(|robot| scene_of(&path, &robot, &Ask::default()));
    let read = scene.and_then(|scene| scene.load_models(Facets::Auto, &Limits::default()).map(|_| ()));
    read.map_or_else(|e| e.to_string(), |()| String::new())
}

#[test]
fn included_files_have_their_own_meshes_names_and_sentences() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::create_dir_all(folder.join("hand/meshes")).expect("folders");
    let mesh = "OFF 4 4 0\n0 0 0\n4 0 0\n0 4 0\n0 0 4\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";
    std::fs::write(folder.join("hand/meshes/t.off"), mesh).expect("written");
    let collision = "<collision name=\"c\"><geometry><mesh><uri>meshes/t.off</uri></mesh></geometry></collision>";
    let hand = format!(
        "<sdf version=\"1.9\"><model name=\"hand\">\n<link name=\"palm\">{collision}</link><link name=\"tip\">{collision}</link>\n\
         <joint name=\"bend\" type=\"revolute\"><parent>palm</parent><child>tip</child><axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"
    );
    let config = "<model><sdf version=\"1.4\">old.sdf</sdf><sdf version=\"1.10\">new.sdf</sdf></model>";
    std::fs::write(folder.join("hand/model.config"), config).expect("written");
    std::fs::write(folder.join("hand/new.sdf"), &hand).expect("written");
    let world = "<sdf version=\"1.9\"><world name=\"w\">\n<include><uri>hand</uri><name>a</name></include><include><uri>model://hand</uri>\
                 <name>b</name><pose>9 0 0 0 0 0</pose></include>\n\
                 <joint name=\"both\" type=\"prismatic\"><parent>a::palm</parent><child>b</child><axis><xyz>1 0 0</xyz></axis></joint></world></sdf>";
    assert_eq!(sentence(folder, world), "");
    let (robot, scene) = read(folder, "w.sdf", world, &Ask::default());
    let mut joints: Vec<&str> = robot.free().map(|d| d.name.as_str()).collect();
    joints.sort_unstable();
    assert_eq!(joints, ["a::bend", "b::bend", "both"]);
    let mut names: Vec<&str> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    names.sort_unstable();
    assert_eq!(names, ["a::palm", "a::tip", "b::palm", "b::tip"]);
    // The joint of the world takes all of b along.
    let ask = Ask { from: Values::from([("both".to_owned(), 2.0)]), ..Ask::default() };
    let (_, scene) = read(folder, "w.sdf", world, &ask);
    let tip = scene.objects.iter().find(|o| o.name == "b::tip").expect("a link");
    assert!(tip.motion.at(0.0).position.distance(DVec3::X * 11.0) < 1e-12);
    // Before 1.7 two models may have one name.
    let old = "<sdf version=\"1.6\"><world name=\"w\"><include><uri>hand</uri></include><include><uri>hand</uri></include></world></sdf>";
    let (robot, _) = read(folder, "w.sdf", old, &Ask::default());
    let joints: Vec<&str> = robot.free().map(|d| d.name.as_str()).collect();
    assert_eq!(joints, ["hand::bend", "hand_1::bend"]);
    assert!(robot.notes.iter().any(|n| n.text.contains("a second \"hand\" is called hand_1")), "{:?}", robot.notes);
    assert!(sentence(folder, &old.replace("1.6", "1.7")).contains("a name that nothing else beside it has"));
    // What is wrong in it is told of it, with its own lines.
    std::fs::write(folder.join("hand/new.sdf"), hand.replace("<child>tip", "<child>top")).expect("written");
    let told = sentence(folder, world);
    assert!(told.contains("w.sdf:2:1: ") && told.contains("hand/new.sdf:3:1: expected the name of a link"), "{told}");
    assert!(told.ends_with("as child, found \"top\", which is no frame of the scope"), "{told}");
    std::fs::write(folder.join("hand/new.sdf"), hand.replace("revolute", "screw")).expect("written");
    let (robot, _) = read(folder, "w.sdf", world, &Ask::default());
    let note = robot.notes.iter().find(|n| n.text.contains("bend")).expect("a note");
    assert!(note.text.contains("hand/new.sdf:3:1: the joint bend (screw)") && note.at.line == 2, "{note:?}");
}

#[test]
fn a_mesh_that_is_open_is_told_with_what_takes_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    // A tetrahedron without one of its sides: it has a hull, and no inside.
    let open = "OFF 4 3 0\n0 0 0\n4 0 0\n0 4 0\n0 0 4\n3 0 2 1\n3 0 1 3\n3 1 2 3\n";
    std::fs::write(folder.join("t.off"), open).expect("written");
    let mesh = "<collision name=\"c\"><geometry><mesh><uri>t.off</uri></mesh></geometry></collision>";
    let text = format!("<sdf version=\"1.7\"><model name=\"m\">\n<link name=\"l\">{mesh}</link></model></sdf>");
    let told = sentence(folder, &text);
    assert!(told.contains("w.sdf:2:1: the geometry of \"m\": ") && told.contains("expected a closed "), "{told}");
    assert!(told.ends_with("; its convex hull needs no closed mesh (--hulls)"), "{told}");
    let (_, scene) = read(folder, "w.sdf", &text, &Ask { hulls: true, ..Ask::default() });
    let hull = scene.load_models(Facets::Auto, &Limits::default()).expect("a hull");
    assert_eq!(hull.len(), 1);
    // What has no hull either is told without.
    std::fs::write(folder.join("t.off"), "OFF 4 2 0\n0 0 0\n4 0 0\n0 4 0\n4 4 0\n3 0 2 1\n3 1 2 3\n").expect("written");
    let path = folder.join("w.sdf");
    let ask = Ask { hulls: true, ..Ask::default() };
    let robot = read_robot(&path, &ask).expect("a robot");
    let flat = scene_of(&path, &robot, &ask).expect("a scene").load_models(Facets::Auto, &Limits::default());
    let told = flat.map_or_else(|e| e.to_string(), |_| String::new());
    assert!(!told.contains("--hulls"), "{told}");
}

/// What sdformat.org/spec lets a file that is included hold: a model, a light or an actor. Gazebo's `model://sun` is the light of nearly
/// every world.
#[test]
fn included_lights_have_no_geometry_and_actors_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    for (name, inner) in [
        ("sun", "<light type=\"directional\" name=\"sun\"><pose>0 0 10 0 0 0</pose></light>"),
        ("walker", "<actor name=\"walker\"><pose>0 0 1 0 0 0</pose></actor>"),
        ("nothing", ""),
        (
            "ball",
            "<model name=\"ball\"><link name=\"l\"><collision name=\"c\"><geometry><sphere><radius>1</radius></sphere></geometry>\
             </collision></link></model>",
        ),
    ] {
        std::fs::create_dir_all(folder.join(name)).expect("folders");
        std::fs::write(folder.join(name).join("model.sdf"), format!("<sdf version=\"1.5\">{inner}</sdf>"))
            .expect("written");
    }
    let world = |uris: &[&str]| {
        let includes: String = uris.iter().map(|uri| format!("\n<include><uri>{uri}</uri></include>")).collect();
        format!("<sdf version=\"1.5\"><world name=\"w\">{includes}</world></sdf>")
    };
    let (robot, scene) =
        read(folder, "w.sdf", &world(&["model://sun", "model://ball", "model://walker"]), &Ask::default());
    let names: Vec<&str> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["ball"]);
    let notes: Vec<String> = robot.notes.iter().map(ToString::to_string).collect();
    assert!(notes.len() == 1 && notes[0].contains("the actor model://walker is left out"), "{notes:?}");
    assert!(sentence(folder, &world(&["model://nothing"])).ends_with("found no model in it"));
    // What is not there is told with what to do about it.
    let told = sentence(folder, &world(&["model://moon"]));
    assert!(told.contains("w.sdf:2:1: expected the model model://moon beside the file,"), "{told}");
    assert!(told.ends_with("or in one of packages (--packages DIR), found none"), "{told}");
    let told = sentence(folder, &world(&["https://fuel.example.org/models/Ground Plane"]));
    assert!(told.contains("w.sdf:2:1: expected a model of this machine (download it, and say model://NAME"), "{told}");
    assert!(told.ends_with("found https://fuel.example.org/models/Ground Plane"), "{told}");
}

#[test]
fn frames_that_lead_nowhere_are_one_sentence() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = |inner: &str| {
        let text = format!(
            "<sdf version=\"1.11\"><model name=\"m\"><link name=\"a\"/><link name=\"b\"/>\n{inner}</model></sdf>"
        );
        sentence(folder.path(), &text)
    };
    let joint = |inner: &str| {
        format!("<joint name=\"j\" type=\"revolute\"><parent>a</parent><child>b</child><axis>{inner}</axis></joint>")
    };
    for (inner, words) in [
        (
            "<frame name=\"p\"><pose relative_to=\"q\"/></frame><frame name=\"q\"><pose relative_to=\"p\"/></frame><link name=\"c\"><pose relative_to=\"p\"/></link>".to_owned(),
            "w.sdf:2:95: expected frames that are there and lead to the scope's own, found \"c\", frames that are relative to each other in a circle",
        ),
        (
            "<frame name=\"p\" attached_to=\"q\"/><frame name=\"q\" attached_to=\"p\"/><joint name=\"j\" type=\"fixed\"><parent>a</parent><child>q</child></joint>".into(),
            "as child, found \"q\", frames that are attached to each other in a circle",
        ),
        ("<frame name=\"a\"/>".into(), "2:1: expected a name that nothing else beside it has, found \"a\""),
        ("<link name=\"c\"><pose relative_to=\"world\"/></link>".into(), "found \"world\", which is no frame of the scope"),
        (joint("<xyz expressed_in=\"n\">1 0 0</xyz>"), "found \"n\", which is no frame of the scope"),
        (joint("<mimic joint=\"k\" axis=\"axis\"><multiplier>1</multiplier></mimic>"), "expected a joint that moves and can be followed, found \"k\""),
        (joint("<mimic joint=\"j\"><multiplier>1</multiplier></mimic>"), "joints that follow each other in a circle, \"j\" among them"),
        (joint("<mimic joint=\"j\"/>"), "expected a multiplier of the mimic, found none"),
    ] {
        let told = of(&inner);
        assert!(told.contains(words) && told.lines().count() == 1, "{inner}: {told}");
    }
}

/// Flags of SDFormat in capital letters and small ones, as numbers and within spaces, and words that are none.
#[test]
fn flags_are_read_in_any_letters_and_others_are_one_sentence() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let links = "<link name=\"a\"/><link name=\"b\"/>";
    std::fs::write(folder.join("in.sdf"), "<sdf version=\"1.9\"><model name=\"k\"><link name=\"c\"/></model></sdf>")
        .expect("written");
    let robot = |text: &str| {
        let path = folder.join("w.sdf");
        std::fs::write(&path, text).expect("written");
        read_robot(&path, &Ask::default()).map_err(|e| e.to_string())
    };
    let model = |inner: &str| robot(&format!("<sdf version=\"1.9\"><model name=\"m\">\n{inner}</model></sdf>"));
    let world = |inner: &str| robot(&format!("<sdf version=\"1.9\"><world name=\"w\">\n{inner}</world></sdf>"));
    let joint = |word: &str| {
        let axis = format!("<axis><xyz>1 0 0</xyz><use_parent_model_frame>{word}</use_parent_model_frame></axis>");
        let ends = "<parent>a</parent><child>b</child>";
        let turned = "<link name=\"a\"/><link name=\"b\"><pose>0 0 0 0 0 1</pose></link>";
        model(&format!("{turned}\n<joint name=\"j\" type=\"revolute\">{ends}{axis}</joint>"))
    };
    let is = |robot: Robot, flag: &str| match flag {
        // 90 degrees, or 90 radians.
        "degrees" => robot.links[0].origin.vector(DVec3::X).distance(DVec3::Y) < 1e-12,
        "static" => robot.links[0].is_static,
        "self_collide" => !robot.excepted.contains(&[0, 1]),
        "merge" => robot.links.iter().any(|l| l.name == "m::c"),
        // The link is turned by 1: the model's x is not its own.
        _ => {
            let dof = robot.free().next().expect("a joint").kind;
            matches!(dof, DofKind::Hinge { axis, .. } if axis.y < -0.5)
        }
    };
    let mut words: Vec<(&str, Option<bool>)> =
        vec![("", Some(false)), ("\u{b5}", None), ("0.0", None), ("truee", None)];
    words.extend(["true", "True", "TRUE", "tRuE", "1", " true\t", " 1"].map(|word| (word, Some(true))));
    words.extend(["false", "False", "FALSE", "0", " fAlse "].map(|word| (word, Some(false))));
    words.extend(["yes", "on", "abc", "2", "01", "t", "-1", "true true"].map(|word| (word, None)));
    for (word, value) in words {
        let both = format!("<self_collide>{word}</self_collide>");
        for (flag, place, read) in [
            (
                "degrees",
                "2:16",
                model(&format!("<link name=\"a\"><pose degrees=\"{word}\">0 0 0 0 0 90</pose></link>")),
            ),
            ("static", "2:1", model(&format!("<static>{word}</static>{links}"))),
            (
                "static",
                "2:29",
                world(&format!("<include><uri>in.sdf</uri>\u{20}\u{20}<static>{word}</static></include>")),
            ),
            ("self_collide", "2:1", model(&format!("{both}{links}"))),
            ("self_collide", "2:16", model(&links.replace("/>", &format!(">{both}</link>")))),
            ("merge", "2:1", model(&format!("<include merge=\"{word}\"><uri>in.sdf</uri></include>{links}"))),
            ("use_parent_model_frame", "3:89", joint(word)),
        ] {
            match (value, read) {
                (Some(value), Ok(robot)) => assert_eq!(is(robot, flag), value, "{flag} {word:?}"),
                (None, Err(told)) => {
                    let wanted = format!("w.sdf:{place}: expected true or false as {flag}, found {word:?}");
                    assert!(told.ends_with(&wanted), "{told}: {wanted}");
                }
                (_, read) => panic!("{flag} {word:?}: {:?}", read.err()),
            }
        }
    }
    // What is wrong in an included file is told with that one's place.
    let text = "<sdf version=\"1.9\"><model name=\"k\">\n\n<static>maybe</static><link name=\"c\"/></model></sdf>";
    std::fs::write(folder.join("in.sdf"), text).expect("written");
    let told = world("<include><uri>in.sdf</uri></include>").expect_err("no flag");
    assert!(
        told.contains("w.sdf:2:1: ") && told.ends_with("in.sdf:3:1: expected true or false as static, found \"maybe\""),
        "{told}"
    );
}

/// Remarks in front of what an element says change nothing.
#[test]
fn remarks_within_elements_change_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = |remark: &str| {
        format!(
            "<sdf version=\"1.9\"><model name=\"m\"><static>{remark}true</static><link name=\"a\"><pose>{remark}1 2 3 0 0 1</pose>\
             <collision name=\"c\"><geometry><sphere><radius>{remark}0.3</radius></sphere></geometry></collision></link>\
             <link name=\"b\"/><joint name=\"j\" type=\"revolute\"><parent>{remark}a</parent><child>{remark}b</child>\
             <axis><xyz>{remark}1 0 0</xyz></axis></joint></model></sdf>"
        )
    };
    let told = |remark: &str| {
        let (robot, scene) = read(folder.path(), "w.sdf", &text(remark), &Ask::default());
        let texts: Vec<_> = scene.models.iter().map(|m| m.text.clone()).collect();
        let links: Vec<_> =
            robot.links.iter().map(|l| (l.name.clone(), l.origin, l.is_static, l.dofs.clone())).collect();
        format!("{links:?} {texts:?} {:?}", robot.notes.iter().map(|n| &n.text).collect::<Vec<_>>())
    };
    let plain = told("");
    assert!(plain.contains("r = 0.3"), "{plain}");
    for remark in ["<!-- metres -->", "<!-- one --><!-- two -->", "<!---->", "\n  <!-- metres -->"] {
        assert_eq!(told(remark), plain, "{remark}");
    }
}
