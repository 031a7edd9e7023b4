//! What viewers draw of a recording: foxglove.SceneUpdate and foxglove.FrameTransforms in JSON.
//!
//! Each object has a frame of its own, in which its surface is told once; a step tells where the frames of those are that moved, and
//! the contacts. Objects stand where the step ends.

use super::content::Part;
use super::foxglove::{
    Arrow, Color, Deletion, Entity, FrameTransform, FrameTransforms, KeyValue, SceneUpdate, Sphere, TriangleList, text,
};
use super::message::{Opening, StepMessage};
use crate::math::Aabb;
use crate::octree::Model;
use crate::tessellation::{self, Triangles};
use contactd_proto::contact_record::{CONTACT, OVERLAP, VALID_NORMAL, VALID_POINT};
use contactd_proto::control::{Command, ObjectSpec};
use contactd_proto::step::STEP_REFUSED;
use contactd_proto::{ContactRecord, MotionState, Pose, Tracks};
use glam::{DQuat, DVec3};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Contacts of a step that are drawn, the earliest.
const CONTACTS: usize = 200;
/// The frame that all others stand in.
const WORLD: &str = "world";

/// Facets of a mesh that is told as it is, at most.
const FACETS: usize = 20_000;
/// The same of all objects that are such a mesh.
const ALL_FACETS: usize = 16 * FACETS;
/// Bytes of an update of the scene, about, and of a point and a triangle in it.
const UPDATE: usize = 1 << 20;
const POINT: usize = 50;
const TRIANGLE: usize = 16;

/// How fine a model is drawn that so many objects have: 2 to this power cells along each side of its box. Each object tells its
/// own triangles, for so the viewers' messages are.
const fn levels(objects: usize) -> u32 {
    match objects {
        0..=16 => 5,
        17..=128 => 4,
        _ => 3,
    }
}

/// The surface of a model that so many `objects` have; what reaches to infinity is cut off at `reach`.
fn surface(model: &Model, objects: usize, reach: f64) -> Triangles {
    let few = |own: &Triangles| own.indices.len() <= FACETS && own.indices.len() * objects <= ALL_FACETS;
    if let Some(own) = tessellation::of_mesh(&model.solid).filter(few) {
        return own;
    }
    let own = model.solid.aabb();
    let near = Aabb::around(DVec3::ZERO, DVec3::splat(reach));
    let around = if own.is_finite() { own } else { own.intersection(&near) };
    if model.solid.is_empty() || around.is_empty() {
        return Triangles::default();
    }
    tessellation::of_solid(&model.solid, &around, levels(objects))
}

/// A model as it is drawn.
struct Drawn {
    part: Part,
    /// Radius; 0 where it reaches to infinity.
    radius: f64,
    /// How far it is drawn where it reaches to infinity.
    reach: f64,
    /// Objects that have it.
    objects: usize,
    /// As it is drawn of so many objects.
    surface: Option<(usize, Arc<Triangles>)>,
}

impl Drawn {
    fn surface(&mut self) -> Arc<Triangles> {
        if let Some((objects, surface)) = &self.surface
            && levels(*objects) == levels(self.objects)
        {
            return surface.clone();
        }
        let surface = Arc::new(surface(&self.part.model.model, self.objects, self.reach));
        self.surface = Some((self.objects, surface.clone()));
        surface
    }
}

/// A session's objects as they are drawn.
pub struct Stage {
    session: u64,
    models: BTreeMap<u32, Drawn>,
    objects: BTreeMap<u32, ObjectSpec>,
    tracks: Tracks,
    /// Objects whose frame was moved in them since: the model in the object's frame now. They stay drawn as they were, and move.
    reframed: BTreeMap<u32, Pose>,
    /// Objects that are not drawn as they are.
    undrawn: BTreeSet<u32>,
    /// What is drawn and is no more.
    gone: Vec<String>,
    /// Objects whose frames were not told since they moved.
    moved: Vec<u32>,
    /// Contacts are drawn.
    has_contacts: bool,
}

impl Stage {
    /// A session at its opening: nothing is drawn of it yet but what was drawn `before` and is the same now.
    pub fn open(session: u64, opening: &Opening, parts: Vec<(u32, Part)>, before: Option<Self>) -> Self {
        let mut stage = Self {
            session,
            models: BTreeMap::new(),
            objects: BTreeMap::new(),
            tracks: Tracks::default(),
            reframed: BTreeMap::new(),
            undrawn: BTreeSet::new(),
            gone: Vec::new(),
            moved: Vec::new(),
            has_contacts: false,
        };
        // Bounded ones first: they say how far the others reach.
        let (bounded, others): (Vec<_>, Vec<_>) = parts.into_iter().partition(|(_, part)| part.model.aabb.is_finite());
        bounded.into_iter().chain(others).for_each(|(id, part)| stage.model(id, part));
        opening.objects.iter().for_each(|o| stage.insert(o.clone()));
        for track in &opening.tracks {
            if let Ok(motion_state) = track.checked() {
                stage.tracks.put(track.object, motion_state);
            }
        }
        stage.moved = stage.objects.keys().copied().collect();
        if let Some(before) = before {
            stage.follow(before);
        }
        stage
    }

    /// Takes over what was drawn before.
    fn follow(&mut self, before: Self) {
        let stays = |o: &&ObjectSpec| self.objects.get(&o.id).is_some_and(|now| now.name == o.name);
        let gone = before.objects.values().filter(|o| !stays(o)).map(|o| before.name(o));
        self.gone = before.gone.iter().cloned().chain(gone).collect();
        self.has_contacts = before.has_contacts;
        for (id, old) in before.models {
            let Some(model) = self.models.get_mut(&id) else { continue };
            if !Arc::ptr_eq(&old.part.content, &model.part.content) || old.reach.to_bits() != model.reach.to_bits() {
                continue;
            }
            model.surface = old.surface;
            let as_before =
                |o: &&ObjectSpec| o.model == id && self.objects.get(&o.id).is_some_and(|now| drawn_alike(now, o));
            for object in before.objects.values().filter(as_before).filter(|o| !before.undrawn.contains(&o.id)) {
                self.undrawn.remove(&object.id);
            }
        }
    }

    /// Nothing is drawn of it any more.
    pub fn strike(&self, time: u64) -> Vec<u8> {
        let all = self.objects.values().map(|o| self.name(o)).chain([self.contacts_name()]);
        let all: Vec<String> = self.gone.iter().cloned().chain(all).collect();
        text(&SceneUpdate { deletions: deletions(time, &all), entities: vec![] })
    }

    /// A model that was loaded.
    pub fn model(&mut self, id: u32, part: Part) {
        let radius = if part.model.aabb.is_finite() { part.model.aabb.half().length() } else { 0.0 };
        let known = self.models.values().map(|drawn| drawn.radius);
        let reach = 8.0 * known.fold(if radius > 0.0 { radius } else { 1.0 }, f64::max);
        self.models.insert(id, Drawn { part, radius, reach, objects: 0, surface: None });
    }

    fn insert(&mut self, object: ObjectSpec) {
        if let Some(drawn) = self.models.get_mut(&object.model) {
            drawn.objects += 1;
        }
        self.undrawn.insert(object.id);
        self.reframed.remove(&object.id);
        self.objects.insert(object.id, object);
    }

    /// Objects that are not drawn as they are, some of them, as a message; `None` once all are.
    pub fn draw(&mut self, time: u64) -> Option<Vec<u8>> {
        let gone = std::mem::take(&mut self.gone);
        let mut next = Vec::new();
        let mut bytes = 0;
        while bytes < UPDATE
            && let Some(id) = self.undrawn.pop_first()
        {
            let Some(object) = self.objects.get(&id) else { continue };
            let surface = self.models.get_mut(&object.model).map(Drawn::surface);
            bytes += surface.as_ref().map_or(0, |s| POINT * s.points.len() + TRIANGLE * s.indices.len());
            next.push((self.name(object), object, surface));
        }
        let entities: Vec<Entity> =
            next.iter().map(|(name, object, surface)| entity(time, name, object, surface.as_deref())).collect();
        let deletions = deletions(time, &gone);
        (!entities.is_empty() || !deletions.is_empty()).then(|| text(&SceneUpdate { deletions, entities }))
    }

    /// Takes a command.
    pub fn command(&mut self, command: &Command) {
        match command {
            Command::AddObject(spec) => {
                self.insert(spec.clone());
                if let Ok(pose) = spec.pose.checked() {
                    self.tracks.put(spec.id, MotionState::resting(pose));
                }
                self.moved.push(spec.id);
            }
            Command::RemoveObject(id) => {
                let Some(spec) = self.objects.remove(id) else { return };
                if let Some(drawn) = self.models.get_mut(&spec.model) {
                    drawn.objects -= 1;
                }
                // What was never drawn cannot be taken away.
                if !self.undrawn.remove(id) {
                    self.gone.push(self.name(&spec));
                }
                self.tracks.removed(*id);
                self.reframed.remove(id);
            }
            Command::Restore(tracks) => {
                for track in tracks {
                    if let Ok(motion_state) = track.checked() {
                        self.tracks.put(track.object, motion_state);
                        self.moved.push(track.object);
                    }
                }
            }
            Command::Reframe(frames) => {
                for frame in frames {
                    let Ok((place, pose)) = frame.checked() else { continue };
                    if self.objects.contains_key(&frame.object) {
                        self.reframed.insert(frame.object, place);
                        self.tracks.put(frame.object, MotionState::resting(pose));
                        self.moved.push(frame.object);
                    }
                }
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
            | Command::Ask(_) => {}
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
        let transforms: Vec<FrameTransform> = moved
            .iter()
            .filter_map(|id| {
                let (object, track) = (self.objects.get(id)?, self.tracks.get(*id)?);
                let end = match (self.reframed.get(id), object.place.checked()) {
                    (Some(place), Ok(drawn)) => track.end.compose(place).compose(&drawn.inverse()),
                    _ => track.end,
                };
                Some(FrameTransform {
                    timestamp: time.into(),
                    parent_frame_id: WORLD,
                    child_frame_id: self.name(object),
                    translation: end.position.into(),
                    rotation: end.rotation.into(),
                })
            })
            .collect();
        moved.clear();
        self.moved = moved;
        (!transforms.is_empty()).then(|| text(&FrameTransforms { transforms }))
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
        let name = self.contacts_name();
        let mut entity = Entity::new(step.time, WORLD, &name);
        for r in met {
            let size = self.size(r);
            entity.spheres.push(Sphere {
                pose: (&Pose::at(r.point.into())).into(),
                size: DVec3::splat(0.06 * size).into(),
                color: Color::new([0.9, 0.1, 0.1], 1.0),
            });
            if r.valid & VALID_NORMAL != 0 {
                entity.arrows.push(arrow(r, size));
            }
        }
        Some(text(&SceneUpdate { entities: vec![entity], deletions: vec![] }))
    }

    /// Radius of the smaller one of a pair.
    fn size(&self, r: &ContactRecord) -> f64 {
        let radius = |id| self.models.get(&self.objects.get(&id)?.model).map(|drawn| drawn.radius).filter(|r| *r > 0.0);
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
}

/// True when nothing that is drawn of an object differs.
fn drawn_alike(a: &ObjectSpec, b: &ObjectSpec) -> bool {
    let of = |o: &ObjectSpec| (o.id, o.model, o.name.clone(), o.group.clone(), o.is_static);
    of(a) == of(b) && a.place == b.place
}

/// An object in its frame.
fn entity<'a>(time: u64, name: &'a str, object: &'a ObjectSpec, surface: Option<&'a Triangles>) -> Entity<'a> {
    let mut entity = Entity::new(time, name, name);
    entity.metadata =
        vec![KeyValue { key: "object", value: &object.name }, KeyValue { key: "group", value: &object.group }];
    if let (Some(surface), Ok(place)) = (surface, object.place.checked()) {
        let hue = f64::from(object.id).mul_add(0.381_966, 0.1).fract();
        let shade = |offset: f64| 0.55 + 0.35 * ((hue + offset) * std::f64::consts::TAU).cos();
        let color = Color::new([0.0, 1.0 / 3.0, 2.0 / 3.0].map(shade), if object.is_static { 0.6 } else { 1.0 });
        entity.triangles.push(TriangleList::new(&place, &surface.points, &surface.indices, color));
    }
    entity
}

/// The normal of a contact of bodies of this size.
fn arrow(r: &ContactRecord, size: f64) -> Arrow {
    let turned = DQuat::from_rotation_arc(DVec3::X, DVec3::from(r.normal).normalize_or(DVec3::X));
    Arrow {
        pose: (&Pose::new(r.point.into(), turned)).into(),
        shaft_length: 0.3 * size,
        shaft_diameter: 0.02 * size,
        head_length: 0.08 * size,
        head_diameter: 0.05 * size,
        color: Color::new([0.9, 0.5, 0.1], 1.0),
    }
}

fn deletions(time: u64, ids: &[String]) -> Vec<Deletion<'_>> {
    ids.iter().map(|id| Deletion::new(time, id)).collect()
}
