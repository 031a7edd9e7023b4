//! glTF files of shows, read by code that shares nothing with what wrote them: chunks, accessors, surfaces, motions, contacts.
//!
//! `CONTACTD_SHOWS=200 cargo test --release -p contactd-tests --test models gltf::` sets the number of random shows (3 by default).

use contactd::import::Scene;
use contactd::octree::Model;
use contactd::solid::SolidBuilder;
use contactd::solid::primitive::{HalfSpace, Sphere};
use contactd::view::buffers::Shown;
use contactd::view::gltf::glb;
use contactd::view::show::{Act, Show};
use contactd_proto::{Motion, Pose};
use contactd_tests::random_solids::{Random, shape_or_torus, solid_of};
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3};
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;

/// A file that was taken apart.
struct Read {
    json: Value,
    bin: Vec<u8>,
}

impl Read {
    fn new(bytes: &[u8]) -> Self {
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
        let text = word(12);
        assert_eq!((&bytes[16..20], text % 4), (&b"JSON"[..], 0));
        let json: Value = serde_json::from_slice(&bytes[20..20 + text]).expect("JSON");
        let at = 20 + text;
        assert_eq!((&bytes[at + 4..at + 8], at + 8 + word(at)), (&b"BIN\0"[..], bytes.len()));
        let bin = bytes[at + 8..].to_vec();
        assert_eq!(json["buffers"][0]["byteLength"], bin.len());
        Self { json, bin }
    }

    /// The rows of an accessor; its bounds hold them.
    fn rows(&self, accessor: &Value) -> Vec<Vec<f64>> {
        let accessor = &self.json["accessors"][accessor.as_u64().unwrap() as usize];
        let view = &self.json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let (from, length) =
            (view["byteOffset"].as_u64().unwrap() as usize, view["byteLength"].as_u64().unwrap() as usize);
        let columns = match accessor["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            other => panic!("{other}"),
        };
        assert!(accessor["componentType"] == 5126 && from % 4 == 0);
        assert_eq!(accessor["count"].as_u64().unwrap() as usize * columns * 4, length);
        let numbers =
            self.bin[from..from + length].chunks(4).map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap())));
        let numbers: Vec<f64> = numbers.collect();
        let rows: Vec<Vec<f64>> = numbers.chunks(columns).map(<[f64]>::to_vec).collect();
        if let (Some(min), Some(max)) = (accessor["min"].as_array(), accessor["max"].as_array()) {
            for k in 0..columns {
                let column = || rows.iter().map(|r| r[k]);
                assert_eq!(min[k].as_f64().unwrap() as f32, column().fold(f64::INFINITY, f64::min) as f32);
                assert_eq!(max[k].as_f64().unwrap() as f32, column().fold(f64::NEG_INFINITY, f64::max) as f32);
            }
        }
        rows
    }

    fn node(&self, i: &Value) -> &Value {
        &self.json["nodes"][i.as_u64().unwrap() as usize]
    }

    /// A property of a node at a time of an animation: by its channel, else as the node has it.
    fn at(&self, act: usize, node: &Value, path: &str, t: f64) -> Vec<f64> {
        let animations = self.json["animations"].as_array().cloned().unwrap_or_default();
        let title = &self.json["scenes"][act]["name"];
        let animation = animations.iter().find(|a| a["name"] == *title);
        let channels = animation.map(|a| a["channels"].as_array().unwrap().clone()).unwrap_or_default();
        let found = channels.iter().find(|c| c["target"]["node"] == *node && c["target"]["path"] == path);
        let Some(channel) = found else {
            let own = self.node(node)[path].as_array().unwrap();
            return own.iter().map(|x| x.as_f64().unwrap()).collect();
        };
        let sampler = &animation.unwrap()["samplers"][channel["sampler"].as_u64().unwrap() as usize];
        let times: Vec<f64> = self.rows(&sampler["input"]).into_iter().map(|r| r[0]).collect();
        let values = self.rows(&sampler["output"]);
        assert!(times.len() == values.len() && times[0] >= 0.0 && times.windows(2).all(|w| w[0] < w[1]), "{times:?}");
        let next = times.iter().position(|k| *k > t).unwrap_or(times.len());
        if next == 0 || next == times.len() || sampler["interpolation"] == "STEP" {
            return values[next.max(1) - 1].clone();
        }
        let part = (t - times[next - 1]) / (times[next] - times[next - 1]);
        let (a, b) = (&values[next - 1], &values[next]);
        if path == "rotation" {
            let q = |r: &[f64]| DQuat::from_slice(r).normalize();
            return q(a).slerp(q(b), part).to_array().to_vec();
        }
        a.iter().zip(b).map(|(a, b)| a + (b - a) * part).collect()
    }
}

/// A scene of objects with motions; models are named by their numbers.
fn scene(objects: &[(usize, Motion)], models: usize, unit: &str) -> Scene {
    let mut text = format!("unit = \"{unit}\"\n");
    for m in 0..models {
        text += &format!("[[model]]\nname = \"{m}\"\nfile = \"{m}.csg\"\n");
    }
    for (i, (model, motion)) in objects.iter().enumerate() {
        let (p, q) = (motion.start.position.to_array(), motion.start.rotation.to_array());
        let (v, w) = ((motion.start.position + motion.velocity).to_array(), motion.spin.to_array());
        text += &format!("[[object]]\nname = \"object {i}\"\nmodel = \"{model}\"\n");
        text += &format!("start = {{ position = {p:?}, rotation = {q:?} }}\n");
        if motion.velocity != DVec3::ZERO || motion.spin != DVec3::ZERO {
            text += &format!("end = {{ position = {v:?} }}\nrotation_vector = {w:?}\n");
        }
    }
    Scene::parse("random.toml", &text, Path::new("")).expect("a scene")
}

#[test]
fn objects_of_random_shows_are_where_the_engine_has_them_at_all_times() {
    let mut r = Random::new(91);
    for i in 0..sized("CONTACTD_SHOWS", 3usize) {
        let models: Vec<Shown> = (0..1 + r.below(2))
            .map(|m| {
                let model = Arc::new(Model::new(solid_of(&mut r, 1, shape_or_torus)));
                Shown { name: m.to_string(), file: "random".into(), model }
            })
            .collect();
        let mut known: Vec<Vec<Vec<(usize, Motion)>>> = Vec::new();
        for _ in 0..1 + r.below(2) {
            let count = 1 + r.below(3);
            let ids: Vec<usize> = (0..count).map(|_| r.below(models.len())).collect();
            let mut at: Vec<Pose> = (0..count).map(|_| Pose::new(r.vector(8.0), r.rotation())).collect();
            let mut steps = Vec::new();
            for _ in 0..1 + r.below(3) {
                let mut objects = Vec::new();
                for (k, id) in ids.iter().enumerate() {
                    if r.chance(0.2) {
                        at[k] = Pose::new(r.vector(8.0), r.rotation());
                    }
                    let still = r.chance(0.2);
                    let spin = if still { DVec3::ZERO } else { r.direction() * r.within(0.0, 9.0) };
                    let velocity = if still { DVec3::ZERO } else { r.vector(3.0) };
                    let motion = Motion { start: at[k], velocity, spin };
                    at[k] = motion.at(1.0);
                    objects.push((*id, motion));
                }
                steps.push(objects);
            }
            known.push(steps);
        }
        let count = models.len();
        let acts = known.iter().enumerate().map(|(a, steps)| {
            let scenes: Vec<Scene> = steps.iter().map(|objects| scene(objects, count, "")).collect();
            Act {
                title: format!("act {a}"),
                steps: steps.len(),
                models: (0..count).collect(),
                scene: Box::new(move |step| Ok(scenes[step].clone())),
            }
        });
        let show = Show::new("random".into(), models, acts.collect()).expect("a show");
        let read = Read::new(&glb(&show).expect("a file"));
        assert_eq!(read.json["scenes"].as_array().unwrap().len(), known.len());
        for (act, steps) in known.iter().enumerate() {
            let root = &read.json["scenes"][act]["nodes"][0];
            for (k, _) in steps[0].iter().enumerate() {
                let nodes = read.node(root)["children"].as_array().unwrap();
                let node = nodes.iter().find(|n| read.node(n)["name"] == format!("object {k}")).expect("the object");
                for _ in 0..40 {
                    let (step, t) = (r.below(steps.len()), r.within(0.0, 0.995));
                    let now = step as f64 + t;
                    let expected = steps[step][k].1.at(t);
                    let position = DVec3::from_slice(&read.at(act, node, "translation", now));
                    let rotation = DQuat::from_slice(&read.at(act, node, "rotation", now)).normalize();
                    let (off, turned) =
                        ((position - expected.position).length(), rotation.dot(expected.rotation).abs());
                    assert!(off < 1e-5, "show {i}, act {act}, object {k} at {now}: {off} off");
                    assert!(turned > 1.0 - 1e-11, "show {i}, act {act}, object {k} at {now}: {turned}");
                }
            }
        }
    }
}

#[test]
fn a_contact_has_a_mark_from_its_time_on_and_solids_lie_on_what_they_are() {
    let mut b = SolidBuilder::new();
    let label = || contactd::solid::Label { name: "part".into(), line: 1, column: 1, mirrored: false };
    let root = b.primitive(Sphere { radius: 5.0 }, Pose::IDENTITY, label());
    let ball = Arc::new(Model::new(b.finish(root)));
    let mut b = SolidBuilder::new();
    let root = b.primitive(HalfSpace, Pose::IDENTITY, label());
    let ground = Arc::new(Model::new(b.finish(root)));
    let still = Motion::resting(Pose::IDENTITY);
    let fall =
        |from: f64, to: f64| Motion { velocity: DVec3::Z * (to - from), ..Motion::resting(Pose::at(DVec3::Z * from)) };
    // It comes to the ground in the second step, after 3 of 4.
    let steps =
        [[(0, fall(12.0, 8.0)), (1, still)], [(0, fall(8.0, 4.0)), (1, still)], [(0, fall(9.0, 9.0)), (1, still)]];
    let scenes = steps.map(|objects| scene(&objects, 2, "mm"));
    let act = Act {
        title: "fall".into(),
        steps: 3,
        models: vec![0, 1],
        scene: Box::new(move |step| Ok(scenes[step].clone())),
    };
    let shown = |name: &str, model| Shown { name: name.into(), file: "part".into(), model };
    let show = Show::new("fall".into(), vec![shown("ball", ball), shown("ground", ground)], vec![act]).expect("a show");
    let read = Read::new(&glb(&show).expect("a file"));
    let root = &read.json["scenes"][0]["nodes"][0];
    // Millimetres, z up.
    assert_eq!(read.node(root)["scale"], serde_json::json!([1e-3, 1e-3, 1e-3]));
    let turn = read.node(root)["rotation"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect::<Vec<_>>();
    assert!((DQuat::from_slice(&turn) * DVec3::Z - DVec3::Y).length() < 1e-12);
    let nodes = read.node(root)["children"].as_array().unwrap();
    let marks: Vec<&Value> =
        nodes.iter().filter(|n| read.node(n)["name"].as_str().unwrap().contains("meets")).collect();
    assert_eq!(marks.len(), 1);
    assert!(read.node(marks[0])["name"].as_str().unwrap().starts_with("object 0 first meets object 1 at t = 0.75"));
    for (t, stands) in [(0.0, false), (1.7499, false), (1.7501, true), (1.9999, true), (2.0001, false), (3.0, false)] {
        let scale = read.at(0, marks[0], "scale", t);
        assert_eq!(scale[0] > 0.0, stands, "at {t}: {scale:?}");
    }
    let place = DVec3::from_slice(&read.at(0, marks[0], "translation", 1.8));
    assert!(place.length() < 1e-6, "{place}");
    let meshes = read.json["meshes"].as_array().unwrap();
    let corners = |name: &str| {
        let mesh = meshes.iter().find(|m| m["name"] == name).expect("a mesh");
        let attributes = &mesh["primitives"][0]["attributes"];
        let vectors = |rows: Vec<Vec<f64>>| rows.iter().map(|r| DVec3::from_slice(r)).collect::<Vec<_>>();
        (vectors(read.rows(&attributes["POSITION"])), vectors(read.rows(&attributes["NORMAL"])))
    };
    let (points, normals) = corners("ball");
    assert!(points.len() > 1000 && points.len() == normals.len());
    for (x, n) in points.iter().zip(&normals) {
        assert!((x.length() - 5.0).abs() < 0.01 && (*n - x.normalize()).length() < 1e-5, "{x} {n}");
    }
    // What is endless is cut off around the scene, and is flat there.
    let (points, normals) = corners("ground");
    let reach = points.iter().map(|x| x.abs().max_element()).fold(0.0, f64::max);
    assert!(points.len() > 10 && reach > 10.0 && reach < 1000.0, "{reach}");
    assert!(points.iter().zip(&normals).all(|(x, n)| x.z.abs() < 1e-3 && (*n - DVec3::Z).length() < 1e-6));
}
