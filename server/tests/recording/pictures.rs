//! What viewers draw: held against what their schemas require, by a table of its own.

use super::{MODELS, PATIENCE, runtime_folder};
use contactd::ipc::{Embedded, ServerConfig};
use contactd_client::proto::{Pose, PoseRecord};
use contactd_client::{Frame, Object, Session};
use glam::DVec3;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// What a value must be.
enum Shape {
    Number,
    Text,
    Flag,
    List(&'static str),
    Of(&'static str),
}

use Shape::{Flag, List, Number, Of, Text};

/// The required properties of the foxglove messages that are written, after their published JSON schemas.
fn required(message: &str) -> Vec<(&'static str, Shape)> {
    match message {
        "SceneUpdate" => vec![("deletions", List("SceneEntityDeletion")), ("entities", List("SceneEntity"))],
        "SceneEntityDeletion" => vec![("timestamp", Of("time")), ("type", Number), ("id", Text)],
        "SceneEntity" => vec![
            ("timestamp", Of("time")),
            ("frame_id", Text),
            ("id", Text),
            ("lifetime", Of("time")),
            ("frame_locked", Flag),
            ("metadata", List("KeyValuePair")),
            ("arrows", List("ArrowPrimitive")),
            ("cubes", List("none")),
            ("spheres", List("SpherePrimitive")),
            ("cylinders", List("none")),
            ("lines", List("none")),
            ("triangles", List("TriangleListPrimitive")),
            ("texts", List("none")),
            ("models", List("none")),
        ],
        "KeyValuePair" => vec![("key", Text), ("value", Text)],
        "ArrowPrimitive" => vec![
            ("pose", Of("Pose")),
            ("shaft_length", Number),
            ("shaft_diameter", Number),
            ("head_length", Number),
            ("head_diameter", Number),
            ("color", Of("Color")),
        ],
        "SpherePrimitive" => vec![("pose", Of("Pose")), ("size", Of("Vector3")), ("color", Of("Color"))],
        "TriangleListPrimitive" => vec![
            ("pose", Of("Pose")),
            ("points", List("Vector3")),
            ("color", Of("Color")),
            ("colors", List("Color")),
            ("indices", List("number")),
        ],
        "FrameTransforms" => vec![("transforms", List("FrameTransform"))],
        "FrameTransform" => vec![
            ("timestamp", Of("time")),
            ("parent_frame_id", Text),
            ("child_frame_id", Text),
            ("translation", Of("Vector3")),
            ("rotation", Of("Quaternion")),
        ],
        "Pose" => vec![("position", Of("Vector3")), ("orientation", Of("Quaternion"))],
        "Vector3" => vec![("x", Number), ("y", Number), ("z", Number)],
        "Quaternion" => vec![("x", Number), ("y", Number), ("z", Number), ("w", Number)],
        "Color" => vec![("r", Number), ("g", Number), ("b", Number), ("a", Number)],
        "time" => vec![("sec", Number), ("nsec", Number)],
        other => panic!("{other} is not written"),
    }
}

fn hold(message: &str, value: &Value) {
    if message == "number" {
        assert!(value.is_number(), "{value}");
        return;
    }
    for (name, shape) in required(message) {
        let inner = value.get(name).unwrap_or_else(|| panic!("{message} without {name}: {value}"));
        match shape {
            Number => assert!(inner.is_number(), "{message}.{name}: {inner}"),
            Text => assert!(inner.is_string(), "{message}.{name}: {inner}"),
            Flag => assert!(inner.is_boolean(), "{message}.{name}: {inner}"),
            Of(other) => hold(other, inner),
            List(other) => inner
                .as_array()
                .unwrap_or_else(|| panic!("{message}.{name}: {inner}"))
                .iter()
                .for_each(|v| hold(other, v)),
        }
    }
}

#[test]
fn pictures_have_all_that_their_schemas_require() {
    let folder = runtime_folder();
    let path = folder.path().join("seen.mcap");
    let mut session = contactd::embedded(&ServerConfig::default()).unwrap();
    let mut ids = Vec::new();
    for (k, (name, text)) in
        MODELS.iter().filter(|(name, text)| name.ends_with(".csg") && !text.contains("import")).enumerate()
    {
        let model = session.load_model(name, *text).unwrap();
        let at = Pose::at(DVec3::new(5.0 * k as f64, 0.0, 0.0));
        ids.push(session.add_object(Object::new(name, model.id).at(at)).unwrap());
    }
    session.record(&path).unwrap();
    let mut contacts = 0;
    for k in 0..6 {
        let slots = session.begin_step(1).unwrap();
        slots[0] = PoseRecord::end(ids[0], &Pose::at(DVec3::new(if k % 2 == 0 { 40.0 } else { 0.0 }, 0.0, 0.0)));
        contacts +=
            session.finish(PATIENCE).unwrap().records().iter().filter(|r| r.status != 2 && r.valid & 2 != 0).count();
        if k == 3 {
            session.remove_object(ids[1]).unwrap();
        }
    }
    session.stop_recording().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().expect("a summary");
    let schemas: BTreeMap<&str, Value> = summary
        .schemas
        .values()
        .map(|s| (s.name.as_str(), serde_json::from_slice(&s.data).expect("a JSON schema")))
        .collect();
    assert_eq!(schemas.keys().copied().collect::<Vec<_>>(), ["foxglove.FrameTransforms", "foxglove.SceneUpdate"]);
    let (mut drawn, mut framed, mut deleted, mut spheres) = (BTreeSet::new(), BTreeSet::new(), 0, 0);
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let Some(schema) = &message.channel.schema else { continue };
        assert_eq!((schema.encoding.as_str(), message.channel.message_encoding.as_str()), ("jsonschema", "json"));
        let value: Value = serde_json::from_slice(&message.data).expect("JSON");
        hold(schema.name.strip_prefix("foxglove.").unwrap(), &value);
        // The schema that stands in the file requires no less.
        for name in schemas[schema.name.as_str()]["required"].as_array().unwrap() {
            assert!(value.get(name.as_str().unwrap()).is_some());
        }
        for entity in value.get("entities").and_then(Value::as_array).into_iter().flatten() {
            for list in entity["triangles"].as_array().unwrap() {
                let points = list["points"].as_array().unwrap().len() as u64;
                let indices = list["indices"].as_array().unwrap();
                assert!(indices.len() >= 12 && indices.len() % 3 == 0, "{}: {} indices", entity["id"], indices.len());
                assert!(indices.iter().all(|i| i.as_u64().unwrap() < points));
                drawn.insert(entity["frame_id"].as_str().unwrap().to_owned());
            }
            spheres += entity["spheres"].as_array().unwrap().len();
        }
        deleted += value.get("deletions").and_then(Value::as_array).map_or(0, Vec::len);
        for frame in value.get("transforms").and_then(Value::as_array).into_iter().flatten() {
            framed.insert(frame["child_frame_id"].as_str().unwrap().to_owned());
        }
    }
    // One that was removed; in the end the others, and the contacts.
    assert_eq!((drawn.len(), deleted), (ids.len(), 1 + ids.len()));
    assert_eq!(drawn, framed, "every object stands in a frame that is told");
    assert_eq!(spheres, contacts);
    assert!(contacts > 0);
}

/// A viewer's message tells each object's own triangles: of many objects they are coarser, and told in parts.
#[test]
fn many_objects_are_drawn_in_messages_of_bounded_length() {
    let folder = runtime_folder();
    let path = folder.path().join("many.mcap");
    let mut session = contactd::embedded(&ServerConfig::default()).unwrap();
    let ball = session.load_model("ball.csg", "sphere(r = 1);").unwrap().id;
    let peg = session.load_model("peg.csg", "cylinder(h = 1, r = 1);").unwrap().id;
    let at = |k: u32| Pose::at(DVec3::new(f64::from(4 * k), 0.0, 0.0));
    for k in 0..400 {
        session.add_object(Object::new("ball", ball).at(at(k))).unwrap();
    }
    session.record(&path).unwrap();
    let step = |session: &mut Session<Embedded>| {
        session.begin_step(1).unwrap()[0] = PoseRecord::end(1, &at(500));
        session.finish(PATIENCE).unwrap();
    };
    step(&mut session);
    for k in 400..600 {
        session.add_object(Object::new("peg", peg).at(at(k))).unwrap();
    }
    step(&mut session);
    let status = session.stop_recording().unwrap();
    assert_eq!((status.steps, status.dropped, status.failure.as_str()), (2, 0, ""));
    let bytes = std::fs::read(&path).unwrap();
    let mut drawn = BTreeSet::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        assert!(message.data.len() < 3 << 20, "a message of {} bytes", message.data.len());
        if message.channel.topic != "/scene" {
            continue;
        }
        let value: Value = serde_json::from_slice(&message.data).unwrap();
        for entity in value["entities"].as_array().unwrap() {
            for list in entity["triangles"].as_array().unwrap() {
                let corners: Vec<DVec3> = list["points"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(|p| DVec3::new(p["x"].as_f64().unwrap(), p["y"].as_f64().unwrap(), p["z"].as_f64().unwrap()))
                    .collect();
                assert!(corners.iter().all(|x| x.length() < 1.6), "of the model's own size");
                assert!(corners.iter().any(|x| x.length() > 0.9));
                assert!(drawn.insert(entity["id"].as_str().unwrap().to_owned()), "{} is drawn once", entity["id"]);
            }
        }
    }
    assert_eq!(drawn.len(), 600);
    // Each as fine as one alone would be: ten times as much.
    assert!(bytes.len() < 36 << 20, "{} bytes", bytes.len());
}

/// A body whose frame is moved in it, as a robot's links are before each step, is drawn once and stands where it stands; in a browser
/// its steps are one act.
#[test]
fn a_body_that_is_driven_by_its_frame_is_drawn_once_and_stands_where_it_is() {
    let folder = runtime_folder();
    let path = folder.path().join("arm.mcap");
    let mut session = contactd::embedded(&ServerConfig::default()).unwrap();
    let bar = session.load_model("bar.csg", "cube(size = [2, 0.2, 0.2]);").unwrap().id;
    let first = Pose::at(DVec3::new(0.5, 0.0, 0.25));
    let id = session.add_object(Object::new("bar", bar).place(first).at(Pose::at(DVec3::Z))).unwrap();
    session.record(&path).unwrap();
    // Where the model's frame stands at first, and at both ends of each step.
    let mut truth = vec![Pose::at(DVec3::Z).compose(&first)];
    for k in 0..8 {
        let turn = |angle: f64| glam::DQuat::from_rotation_z(angle);
        let place = Pose::new(DVec3::new(0.1 * f64::from(k), 0.3, 0.0), turn(0.2 * f64::from(k)));
        let from = Pose::new(DVec3::new(0.0, f64::from(k), 1.0), turn(-0.3 * f64::from(k)));
        session.reframe(&[Frame { object: id, place, pose: from }]).unwrap();
        let to = Pose::new(from.position, from.rotation * turn(0.4));
        session.begin_step(1).unwrap()[0] = PoseRecord::end(id, &to);
        session.finish(PATIENCE).unwrap();
        truth.extend([from.compose(&place), to.compose(&place)]);
    }
    session.stop_recording().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let (mut drawn, mut stands) = (Vec::new(), Vec::new());
    let three = |v: &Value| DVec3::from(["x", "y", "z"].map(|name| v[name].as_f64().unwrap()));
    let four = |v: &Value| glam::DQuat::from_array(["x", "y", "z", "w"].map(|name| v[name].as_f64().unwrap()));
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        if message.channel.schema.is_none() {
            continue;
        }
        let value: Value = serde_json::from_slice(&message.data).unwrap();
        for entity in value.get("entities").and_then(Value::as_array).into_iter().flatten() {
            for list in entity["triangles"].as_array().unwrap() {
                drawn.push(Pose::new(three(&list["pose"]["position"]), four(&list["pose"]["orientation"])));
            }
        }
        for frame in value.get("transforms").and_then(Value::as_array).into_iter().flatten() {
            stands.push(Pose::new(three(&frame["translation"]), four(&frame["rotation"])));
        }
    }
    assert_eq!(drawn.len(), 1, "its surface is told once");
    let corners = [DVec3::ZERO, DVec3::new(2.0, 0.2, 0.2)];
    let are_one = |frame: &Pose, truth: &Pose| {
        corners.iter().all(|c| frame.point(drawn[0].point(*c)).distance(truth.point(*c)) < 1e-9)
    };
    // A step may begin before its predecessor is told.
    let mut at = 0;
    for frame in &stands {
        at += truth[at..].iter().position(|truth| are_one(frame, truth)).expect("it stands where it was, in order");
    }
    assert_eq!(at, truth.len() - 1, "the last step is told");
    let (runs, _) = contactd::replay::runs(&path, 100).unwrap();
    assert_eq!(runs.iter().map(|run| run.scenes.len()).collect::<Vec<_>>(), [8]);
}
