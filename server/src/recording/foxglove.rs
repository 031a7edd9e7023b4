//! The messages that viewers draw a recording from, foxglove.SceneUpdate and foxglove.FrameTransforms, and their JSON schemas.
//!
//! They are written as they are walked: a scene's surfaces as a tree of JSON values took ten times the memory of their text.

use contactd_proto::Pose;
use glam::{DQuat, DVec3};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

/// The names of the schemas.
pub const SCENE_UPDATE: &str = "foxglove.SceneUpdate";
/// See `SCENE_UPDATE`.
pub const FRAME_TRANSFORMS: &str = "foxglove.FrameTransforms";

/// A list of which nothing is ever written.
type Nothing = [(); 0];

/// `foxglove.SceneUpdate`.
#[derive(Default, Serialize)]
pub struct SceneUpdate<'a> {
    pub deletions: Vec<Deletion<'a>>,
    pub entities: Vec<Entity<'a>>,
}

/// `foxglove.SceneEntityDeletion`: of one entity.
#[derive(Serialize)]
pub struct Deletion<'a> {
    timestamp: Time,
    #[serde(rename = "type")]
    what: u8,
    id: &'a str,
}

impl<'a> Deletion<'a> {
    pub fn new(time: u64, id: &'a str) -> Self {
        Self { timestamp: time.into(), what: 0, id }
    }
}

/// `foxglove.SceneEntity`.
#[derive(Serialize)]
pub struct Entity<'a> {
    timestamp: Time,
    frame_id: &'a str,
    id: &'a str,
    lifetime: Time,
    frame_locked: bool,
    pub metadata: Vec<KeyValue<'a>>,
    pub arrows: Vec<Arrow>,
    cubes: Nothing,
    pub spheres: Vec<Sphere>,
    cylinders: Nothing,
    lines: Nothing,
    pub triangles: Vec<TriangleList<'a>>,
    texts: Nothing,
    models: Nothing,
}

impl<'a> Entity<'a> {
    /// One in which nothing is drawn yet; it moves with its frame, and stays.
    pub fn new(time: u64, frame_id: &'a str, id: &'a str) -> Self {
        Self {
            timestamp: time.into(),
            frame_id,
            id,
            lifetime: 0.into(),
            frame_locked: true,
            metadata: Vec::new(),
            arrows: Vec::new(),
            cubes: [],
            spheres: Vec::new(),
            cylinders: [],
            lines: [],
            triangles: Vec::new(),
            texts: [],
            models: [],
        }
    }
}

#[derive(Serialize)]
pub struct KeyValue<'a> {
    pub key: &'a str,
    pub value: &'a str,
}

#[derive(Serialize)]
pub struct Arrow {
    pub pose: FoxglovePose,
    pub shaft_length: f64,
    pub shaft_diameter: f64,
    pub head_length: f64,
    pub head_diameter: f64,
    pub color: Color,
}

#[derive(Serialize)]
pub struct Sphere {
    pub pose: FoxglovePose,
    pub size: Vector,
    pub color: Color,
}

#[derive(Serialize)]
pub struct TriangleList<'a> {
    pub pose: FoxglovePose,
    pub points: Points<'a>,
    pub color: Color,
    colors: Nothing,
    pub indices: &'a [u32],
}

impl<'a> TriangleList<'a> {
    pub fn new(pose: &Pose, points: &'a [DVec3], indices: &'a [[u32; 3]], color: Color) -> Self {
        Self { pose: pose.into(), points: Points(points), color, colors: [], indices: indices.as_flattened() }
    }
}

/// Points that are written in single precision: they are pictures.
pub struct Points<'a>(&'a [DVec3]);

impl Serialize for Points<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Point {
            x: f32,
            y: f32,
            z: f32,
        }
        serializer.collect_seq(self.0.iter().map(|x| {
            let [x, y, z] = x.as_vec3().to_array();
            Point { x, y, z }
        }))
    }
}

/// `foxglove.FrameTransforms`.
#[derive(Serialize)]
pub struct FrameTransforms {
    pub transforms: Vec<FrameTransform>,
}

#[derive(Serialize)]
pub struct FrameTransform {
    pub timestamp: Time,
    pub parent_frame_id: &'static str,
    pub child_frame_id: String,
    pub translation: Vector,
    pub rotation: Quaternion,
}

#[derive(Serialize)]
pub struct Time {
    sec: u64,
    nsec: u64,
}

impl From<u64> for Time {
    fn from(time: u64) -> Self {
        Self { sec: time / 1_000_000_000, nsec: time % 1_000_000_000 }
    }
}

#[derive(Serialize)]
pub struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

impl From<DVec3> for Vector {
    fn from(v: DVec3) -> Self {
        Self { x: v.x, y: v.y, z: v.z }
    }
}

#[derive(Serialize)]
pub struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

impl From<DQuat> for Quaternion {
    fn from(q: DQuat) -> Self {
        Self { x: q.x, y: q.y, z: q.z, w: q.w }
    }
}

/// `foxglove.Pose`.
#[derive(Serialize)]
pub struct FoxglovePose {
    position: Vector,
    orientation: Quaternion,
}

impl From<&Pose> for FoxglovePose {
    fn from(p: &Pose) -> Self {
        Self { position: p.position.into(), orientation: p.rotation.into() }
    }
}

#[derive(Serialize)]
pub struct Color {
    r: f64,
    g: f64,
    b: f64,
    a: f64,
}

impl Color {
    pub fn new([r, g, b]: [f64; 3], a: f64) -> Self {
        Self { r, g, b, a }
    }
}

/// A message's text.
pub fn text(message: &impl Serialize) -> Vec<u8> {
    // What these types hold always has a text: no key is anything but a word.
    serde_json::to_vec(message).unwrap_or_default()
}

/// A schema: an object that has all of some properties.
fn object(title: &str, properties: Value) -> Value {
    let required: Vec<&String> = properties.as_object().map(|all| all.keys().collect()).unwrap_or_default();
    json!({ "title": title, "type": "object", "required": required, "properties": properties })
}

/// A schema: a list.
fn list(items: Value) -> Value {
    json!({ "type": "array", "items": items })
}

/// A schema: numbers by name.
fn numbers(title: &str, names: &[&str]) -> Value {
    object(title, names.iter().map(|name| ((*name).to_owned(), json!({ "type": "number" }))).collect())
}

/// The JSON schemas of both kinds of messages, as far as they are used: by name.
pub fn schemas() -> [(&'static str, String); 2] {
    let word = || json!({ "type": "string" });
    let number = || json!({ "type": "number" });
    let whole = || json!({ "type": "integer" });
    let time = |title| object(title, json!({ "sec": whole(), "nsec": whole() }));
    let xyz = || numbers("foxglove.Vector3", &["x", "y", "z"]);
    let turn = || numbers("foxglove.Quaternion", &["x", "y", "z", "w"]);
    let color = || numbers("foxglove.Color", &["r", "g", "b", "a"]);
    let pose = || object("foxglove.Pose", json!({ "position": xyz(), "orientation": turn() }));
    let solid = |title| object(title, json!({ "pose": pose(), "size": xyz(), "color": color() }));
    let any = |title: &str| list(json!({ "title": title, "type": "object" }));
    let arrow = json!({
        "pose": pose(), "shaft_length": number(), "shaft_diameter": number(),
        "head_length": number(), "head_diameter": number(), "color": color(),
    });
    let triangles = json!({
        "pose": pose(), "points": list(numbers("foxglove.Point3", &["x", "y", "z"])), "color": color(),
        "colors": list(color()), "indices": list(whole()),
    });
    let entity = json!({
        "timestamp": time("time"), "frame_id": word(), "id": word(), "lifetime": time("duration"),
        "frame_locked": json!({ "type": "boolean" }),
        "metadata": list(object("foxglove.KeyValuePair", json!({ "key": word(), "value": word() }))),
        "arrows": list(object("foxglove.ArrowPrimitive", arrow)),
        "cubes": list(solid("foxglove.CubePrimitive")),
        "spheres": list(solid("foxglove.SpherePrimitive")),
        "cylinders": any("foxglove.CylinderPrimitive"),
        "lines": any("foxglove.LinePrimitive"),
        "triangles": list(object("foxglove.TriangleListPrimitive", triangles)),
        "texts": any("foxglove.TextPrimitive"),
        "models": any("foxglove.ModelPrimitive"),
    });
    let deletion = json!({ "timestamp": time("time"), "type": whole(), "id": word() });
    let update = json!({
        "deletions": list(object("foxglove.SceneEntityDeletion", deletion)),
        "entities": list(object("foxglove.SceneEntity", entity)),
    });
    let frame = json!({
        "timestamp": time("time"), "parent_frame_id": word(), "child_frame_id": word(),
        "translation": xyz(), "rotation": turn(),
    });
    let frames = json!({ "transforms": list(object("foxglove.FrameTransform", frame)) });
    [
        (SCENE_UPDATE, object(SCENE_UPDATE, update).to_string()),
        (FRAME_TRANSFORMS, object(FRAME_TRANSFORMS, frames).to_string()),
    ]
}
