//! What viewers draw of a recording: foxglove.SceneUpdate and foxglove.FrameTransforms in JSON.
//!
//! Each object has a frame of its own, in which its surface is told once; a step tells where the frames of those are that moved, and
//! the contacts. Objects stand where the step ends.

use super::content::Part;
use super::message::{Opening, StepMessage};
use crate::math::Aabb;
use crate::octree::Model;
use crate::tessellation::{self, Triangles};
use contactd_proto::contact_record::{CONTACT, OVERLAP, VALID_NORMAL, VALID_POINT};
use contactd_proto::control::{Command, ObjectSpec};
use contactd_proto::step::STEP_REFUSED;
use contactd_proto::{ContactRecord, MotionState, Pose, Tracks};
use glam::{DQuat, DVec3};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The names of the schemas.
pub const SCENE_UPDATE: &str = "foxglove.SceneUpdate";
/// See `SCENE_UPDATE`.
pub const FRAME_TRANSFORMS: &str = "foxglove.FrameTransforms";

/// Contacts of a step that are drawn, the earliest.
const CONTACTS: usize = 200;
/// The frame that all others stand in.
const WORLD: &str = "world";

/// Of a solid that is no mesh: 2 to this power cells along each side.
const LEVELS: u32 = 5;
/// Facets of a mesh that is told as it is, at most.
const FACETS: usize = 20_000;

/// The surface of a model; what reaches to infinity is cut off at `reach`.
fn surface(model: &Model, reach: f64) -> Triangles {
    if let Some(own) = tessellation::of_mesh(&model.solid).filter(|own| own.indices.len() <= FACETS) {
        return own;
    }
    let own = model.solid.aabb();
    let near = Aabb::around(DVec3::ZERO, DVec3::splat(reach));
    let around = if own.is_finite() { own } else { own.intersection(&near) };
    if model.solid.is_empty() || around.is_empty() {
        return Triangles::default();
    }
    tessellation::of_solid(&model.solid, &around, LEVELS)
}

/// A session's objects as they are drawn.
pub struct Stage {
    session: u64,
    models: BTreeMap<u32, Arc<Triangles>>,
    /// Radius of each model; 0 of one that reaches to infinity.
    radii: BTreeMap<u32, f64>,
    objects: BTreeMap<u32, ObjectSpec>,
    tracks: Tracks,
    /// Objects whose frames were not told since they moved.
    moved: Vec<u32>,
    /// Contacts are drawn.
    has_contacts: bool,
}

impl Stage {
    /// A session at its opening, what is drawn of it, and where it stands; `stale` are entities that were drawn of it before.
    pub fn open(
        (session, time): (u64, u64),
        opening: &Opening,
        parts: Vec<(u32, Part)>,
        stale: &[String],
    ) -> (Self, Vec<u8>, Vec<u8>) {
        let mut stage = Self {
            session,
            models: BTreeMap::new(),
            radii: BTreeMap::new(),
            objects: opening.objects.iter().map(|o| (o.id, o.clone())).collect(),
            tracks: Tracks::default(),
            moved: Vec::new(),
            has_contacts: false,
        };
        // Bounded ones first: they say how far the others reach.
        let (bounded, others): (Vec<_>, Vec<_>) = parts.into_iter().partition(|(_, part)| part.model.aabb.is_finite());
        bounded.into_iter().chain(others).for_each(|(id, part)| stage.model(id, part));
        for track in &opening.tracks {
            if let Ok(motion_state) = track.checked() {
                stage.tracks.put(track.object, motion_state);
            }
        }
        stage.moved = stage.objects.keys().copied().collect();
        let entities: Vec<Value> = stage.objects.values().map(|o| stage.entity(time, o)).collect();
        let ids = stage.entities();
        let gone: Vec<Value> = stale.iter().filter(|id| !ids.contains(id)).map(|id| deletion(time, id)).collect();
        let transforms = stage.transforms(time).unwrap_or_else(|| bytes(&json!({ "transforms": [] })));
        (stage, update(gone, entities), transforms)
    }

    /// Ids of all entities of the session.
    pub fn entities(&self) -> Vec<String> {
        self.objects.values().map(|o| self.name(o)).chain([self.contacts_name()]).collect()
    }

    /// Nothing is drawn of it any more.
    pub fn strike(&self, time: u64) -> Vec<u8> {
        update(self.entities().iter().map(|id| deletion(time, id)).collect(), vec![])
    }

    /// A model that was loaded.
    pub fn model(&mut self, id: u32, part: Part) {
        let radius = if part.model.aabb.is_finite() { part.model.aabb.half().length() } else { 0.0 };
        let reach = 8.0 * self.radii.values().copied().fold(if radius > 0.0 { radius } else { 1.0 }, f64::max);
        self.radii.insert(id, radius);
        self.models.insert(id, Arc::new(surface(&part.model.model, reach)));
    }

    /// What a command changes of what is drawn.
    pub fn command(&mut self, time: u64, command: &Command) -> Option<Vec<u8>> {
        match command {
            Command::AddObject(spec) => {
                self.objects.insert(spec.id, spec.clone());
                if let Ok(pose) = spec.pose.checked() {
                    self.tracks.put(spec.id, MotionState::resting(pose));
                }
                self.moved.push(spec.id);
                Some(update(vec![], vec![self.entity(time, spec)]))
            }
            Command::RemoveObject(id) => {
                let spec = self.objects.remove(id)?;
                self.tracks.removed(*id);
                Some(update(vec![deletion(time, &self.name(&spec))], vec![]))
            }
            Command::Restore(tracks) => {
                for track in tracks {
                    if let Ok(motion_state) = track.checked() {
                        self.tracks.put(track.object, motion_state);
                        self.moved.push(track.object);
                    }
                }
                None
            }
            Command::Reframe(frames) => {
                let mut drawn = Vec::with_capacity(frames.len());
                for frame in frames {
                    let Some((spec, Ok((place, pose)))) =
                        self.objects.get_mut(&frame.object).zip(Some(frame.checked()))
                    else {
                        continue;
                    };
                    spec.place = place.into();
                    let spec = spec.clone();
                    self.tracks.put(spec.id, MotionState::resting(pose));
                    self.moved.push(spec.id);
                    drawn.push(self.entity(time, &spec));
                }
                Some(update(vec![], drawn))
            }
            Command::Open { .. }
            | Command::Close
            | Command::LoadModel { .. }
            | Command::SetRules(_)
            | Command::SetResolution(_)
            | Command::MassProperties { .. }
            | Command::Status
            | Command::EndSession(_)
            | Command::Record(_)
            | Command::Recording { .. }
            | Command::SaveStep(_)
            | Command::Carry { .. }
            | Command::Ask(_) => None,
        }
    }

    /// Takes a step.
    pub fn take(&mut self, step: &StepMessage) {
        if step.reply.status == STEP_REFUSED {
            return;
        }
        self.tracks.take(&step.records, step.request.advance);
        self.moved.extend(step.records.iter().map(|r| r.object));
        if step.request.advance != 1.0 {
            // What is not named stands elsewhere, too.
            self.moved.extend(self.objects.keys());
        }
    }

    /// Where the frames are of what has moved, if anything has.
    pub fn transforms(&mut self, time: u64) -> Option<Vec<u8>> {
        let mut moved = std::mem::take(&mut self.moved);
        moved.sort_unstable();
        moved.dedup();
        let frames: Vec<Value> = moved
            .iter()
            .filter_map(|id| {
                let (object, track) = (self.objects.get(id)?, self.tracks.get(*id)?);
                Some(json!({
                    "timestamp": stamp(time),
                    "parent_frame_id": WORLD,
                    "child_frame_id": self.name(object),
                    "translation": vector(track.end.position),
                    "rotation": quaternion(track.end.rotation),
                }))
            })
            .collect();
        moved.clear();
        self.moved = moved;
        (!frames.is_empty()).then(|| bytes(&json!({ "transforms": frames })))
    }

    /// The contacts of a step; `None` where there are none, as before.
    pub fn contacts(&mut self, step: &StepMessage) -> Option<Vec<u8>> {
        let records = step.slots.iter().take(step.reply.records as usize);
        let met = |r: &&ContactRecord| matches!(r.status, CONTACT | OVERLAP) && r.valid & VALID_POINT != 0;
        let met: Vec<&ContactRecord> = records.filter(met).take(CONTACTS).collect();
        if met.is_empty() && !self.has_contacts {
            return None;
        }
        self.has_contacts = !met.is_empty();
        let spheres: Vec<Value> = met
            .iter()
            .map(|r| {
                let size = 0.06 * self.size(r);
                json!({
                    "pose": pose(&Pose::at(r.point.into())),
                    "size": vector(DVec3::splat(size)),
                    "color": color([0.9, 0.1, 0.1], 1.0),
                })
            })
            .collect();
        let arrows: Vec<Value> = met.iter().filter(|r| r.valid & VALID_NORMAL != 0).map(|r| self.arrow(r)).collect();
        let mut entity = bare(step.time, WORLD, &self.contacts_name());
        (entity["spheres"], entity["arrows"]) = (spheres.into(), arrows.into());
        Some(update(vec![], vec![entity]))
    }

    /// The normal of a contact.
    fn arrow(&self, r: &ContactRecord) -> Value {
        let size = self.size(r);
        let turned = DQuat::from_rotation_arc(DVec3::X, DVec3::from(r.normal).normalize_or(DVec3::X));
        json!({
            "pose": pose(&Pose::new(r.point.into(), turned)),
            "shaft_length": 0.3 * size,
            "shaft_diameter": 0.02 * size,
            "head_length": 0.08 * size,
            "head_diameter": 0.05 * size,
            "color": color([0.9, 0.5, 0.1], 1.0),
        })
    }

    /// Radius of the smaller one of a pair.
    fn size(&self, r: &ContactRecord) -> f64 {
        let radius = |id| self.objects.get(&id).and_then(|o| self.radii.get(&o.model)).copied().filter(|r| *r > 0.0);
        let smaller = [r.a, r.b].into_iter().filter_map(radius).fold(f64::INFINITY, f64::min);
        if smaller.is_finite() { smaller } else { 1.0 }
    }

    /// An object's frame, and its entity.
    fn name(&self, object: &ObjectSpec) -> String {
        format!("{}/{} {}", self.session, object.id, object.name)
    }

    fn contacts_name(&self) -> String {
        format!("{}/contacts", self.session)
    }

    fn entity(&self, time: u64, object: &ObjectSpec) -> Value {
        let name = self.name(object);
        let mut entity = bare(time, &name, &name);
        entity["metadata"] =
            json!([{ "key": "object", "value": object.name }, { "key": "group", "value": object.group }]);
        let (Some(surface), Ok(place)) = (self.models.get(&object.model), object.place.checked()) else {
            return entity;
        };
        let points: Vec<Value> = surface.points.iter().map(|x| vector(x.as_vec3().as_dvec3())).collect();
        let hue = f64::from(object.id).mul_add(0.381_966, 0.1).fract();
        let shade = |offset: f64| 0.55 + 0.35 * ((hue + offset) * std::f64::consts::TAU).cos();
        entity["triangles"] = json!([{
            "pose": pose(&place),
            "points": points,
            "color": color([shade(0.0), shade(1.0 / 3.0), shade(2.0 / 3.0)], if object.is_static { 0.6 } else { 1.0 }),
            "colors": [],
            "indices": surface.indices.as_flattened(),
        }]);
        entity
    }
}

/// An entity in which nothing is drawn.
fn bare(time: u64, frame: &str, id: &str) -> Value {
    json!({
        "timestamp": stamp(time),
        "frame_id": frame,
        "id": id,
        "lifetime": { "sec": 0, "nsec": 0 },
        "frame_locked": true,
        "metadata": [],
        "arrows": [],
        "cubes": [],
        "spheres": [],
        "cylinders": [],
        "lines": [],
        "triangles": [],
        "texts": [],
        "models": [],
    })
}

fn update(deletions: Vec<Value>, entities: Vec<Value>) -> Vec<u8> {
    bytes(&json!({ "deletions": deletions, "entities": entities }))
}

fn deletion(time: u64, id: &str) -> Value {
    json!({ "timestamp": stamp(time), "type": 0, "id": id })
}

fn bytes(value: &Value) -> Vec<u8> {
    value.to_string().into_bytes()
}

fn stamp(time: u64) -> Value {
    json!({ "sec": time / 1_000_000_000, "nsec": time % 1_000_000_000 })
}

fn vector(v: DVec3) -> Value {
    json!({ "x": v.x, "y": v.y, "z": v.z })
}

fn quaternion(q: DQuat) -> Value {
    json!({ "x": q.x, "y": q.y, "z": q.z, "w": q.w })
}

fn pose(p: &Pose) -> Value {
    json!({ "position": vector(p.position), "orientation": quaternion(p.rotation) })
}

fn color([r, g, b]: [f64; 3], a: f64) -> Value {
    json!({ "r": r, "g": g, "b": b, "a": a })
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
