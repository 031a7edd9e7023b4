//! A show as one binary glTF 2.0 file, for programs that draw and animate: Blender, three.js and the like.
//!
//! Each act is a scene with an animation of its own, in which a second is a step. Objects move as they do over the step: frames
//! go straight and turn at a constant rate, which keys at most an eighth of a turn apart tell without loss (linear in position,
//! spherically linear in rotation). A contact is a mark that stands from its time to the end of its step.
//!
//! Solids are triangles here ([`crate::tessellation`]): what is round is so to a part of a cell. glTF's lengths are metres and its +y is
//! up: the scene's root turns z up to y up, and scales lengths of a known unit.
//!
//! Source: Khronos Group, "glTF 2.0 specification" (2021), sections 3 and 4.

use super::show::{Moved, Show, Step};
use crate::math::Aabb;
use crate::picture::scene::COLORS;
use crate::solid::Solid;
use crate::tessellation::{self, Triangles};
use contactd_proto::{Motion, Pose};
use glam::{DQuat, DVec3};
use rayon::prelude::*;
use serde_json::{Value, json};

/// Cells along each side of a solid that is no mesh: 2 to this power.
const LEVELS: u32 = 6;
/// A key of a rotation is no farther from the next one, radians.
const TURN: f64 = std::f64::consts::FRAC_PI_4;
/// The same of an object whose frame was moved in it: between two keys what is drawn goes straight on, not on an arc.
const ARC: f64 = TURN / 16.0;
/// An object that a step begins with elsewhere than the one before has left it goes there in so many seconds before.
const JUMP: f64 = 1e-3;
/// Sides of a mark, and its size of the scene's.
const SIDES: u32 = 12;
const MARK: f64 = 0.012;

/// The file's bytes.
///
/// # Errors
/// A step that cannot be read or solved, and what is too large for the format's 32 bits.
pub fn glb(show: &Show) -> Result<Vec<u8>, String> {
    let mut file = File::default();
    let solids: Vec<(&Solid, Aabb)> =
        show.models.iter().zip(&show.extents).map(|(m, x)| (&m.model.solid, *x)).collect();
    let surfaces: Vec<Surface> = solids.par_iter().map(|(solid, extent)| Surface::new(solid, extent)).collect();
    let names = show.models.iter().map(|m| m.name.as_str());
    let meshes: Vec<Option<usize>> =
        names.zip(&surfaces).enumerate().map(|(i, (name, s))| file.surface(name, s, i % COLORS.len())).collect();
    let mark = file.surface("contact", &Surface::arrow(), COLORS.len());
    for act in 0..show.acts.len() {
        act_of(&mut file, show, act, (&meshes, mark))?;
    }
    file.bytes(&show.title)
}

/// Adds an act: a scene, and its animation.
fn act_of(file: &mut File, show: &Show, act: usize, meshes: (&[Option<usize>], Option<usize>)) -> Result<(), String> {
    let (title, count) = (&show.acts[act].title, show.acts[act].steps);
    let steps: Vec<Step> = (0..count).map(|step| show.moved(act, step)).collect::<Result<_, _>>()?;
    let Some(first) = steps.first() else { return Ok(()) };
    let mut animation = Animation::default();
    let mut nodes = Vec::new();
    for (i, object) in first.objects.iter().enumerate() {
        let motions: Vec<Driven> = steps.iter().map(|step| Driven::new(&step.objects[i], object)).collect();
        let mut body = placed(&object.place);
        if let Some(mesh) = meshes.0[object.model] {
            body["mesh"] = mesh.into();
        }
        let body = file.node(body);
        let mut frame = placed(&motions[0].motion.start);
        frame["name"] = object.name.as_str().into();
        frame["children"] = json!([body]);
        let frame = file.node(frame);
        animation.object(file, frame, &motions);
        nodes.push(frame);
    }
    let size = MARK * show.size(first).max(f64::MIN_POSITIVE);
    for (i, step) in steps.iter().enumerate() {
        for met in &step.contacts {
            let turn = DQuat::from_rotation_arc(DVec3::Z, met.normal.normalize_or(DVec3::Z));
            let mut mark = placed(&Pose::new(met.point, turn));
            mark["name"] = met.sentence.as_str().into();
            mark["scale"] = json!([0.0, 0.0, 0.0]);
            if let Some(mesh) = meshes.1 {
                mark["mesh"] = mesh.into();
            }
            let node = file.node(mark);
            let (from, until) = (i as f64 + met.time, (i + 1) as f64);
            animation.mark(file, node, (from, until, count as f64), size);
            nodes.push(node);
        }
    }
    let scale = metres(&first.unit).unwrap_or(1.0);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let root = file.node(json!({
        "name": title, "children": nodes, "scale": [scale, scale, scale], "rotation": [-half, 0.0, 0.0, half],
    }));
    file.scenes.push(json!({ "name": title, "nodes": [root], "extras": { "unit": first.unit, "steps": count } }));
    file.animations.extend(animation.told(title));
    Ok(())
}

/// An object over a step, in the frame that it is drawn in.
struct Driven {
    motion: Motion,
    /// The frame that it is drawn in, in the object's frame; `None` where they are the same.
    moved: Option<Pose>,
}

impl Driven {
    /// Over a step; it is drawn as of the first one.
    fn new(now: &Moved, first: &Moved) -> Self {
        let moved = (now.place != first.place).then(|| now.place.compose(&first.place.inverse()));
        Self { motion: now.motion, moved }
    }

    fn at(&self, t: f64) -> Pose {
        self.moved.map_or_else(|| self.motion.at(t), |moved| self.motion.at(t).compose(&moved))
    }

    /// Steps between keys.
    fn keys(&self) -> usize {
        let turn = if self.moved.is_some() { ARC } else { TURN };
        (self.motion.spin.length() / turn).ceil().max(1.0) as usize
    }
}

/// Metres in a unit that a scene may name.
fn metres(unit: &str) -> Option<f64> {
    let known = [("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("um", 1e-6), ("µm", 1e-6), ("in", 0.0254), ("ft", 0.3048)];
    known.into_iter().find(|(name, _)| *name == unit).map(|(_, metres)| metres)
}

/// A node that stands somewhere.
fn placed(pose: &Pose) -> Value {
    json!({ "translation": pose.position.to_array(), "rotation": pose.rotation.to_array() })
}

/// Corners with normals, three a triangle.
struct Surface {
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
}

impl Surface {
    /// A solid's, cut off at `extent` where it is endless.
    fn new(solid: &Solid, extent: &Aabb) -> Self {
        let around = if solid.aabb().is_finite() { solid.aabb() } else { solid.aabb().intersection(extent) };
        let triangles = match tessellation::of_mesh(solid) {
            Some(own) => own,
            None if solid.is_empty() || around.is_empty() => Triangles::default(),
            None => tessellation::of_solid(solid, &around, LEVELS),
        };
        let mut surface = Self { points: Vec::new(), normals: Vec::new() };
        for (corners, face) in triangles.corners().zip(&triangles.faces) {
            let [a, b, c] = corners;
            let Some(flat) = (b - a).cross(c - a).try_normalize() else { continue };
            let curved = |x: DVec3| {
                let face = solid.faces.get(*face as usize).filter(|_| triangles.off > 0.0)?;
                let n = face.unit_normal(x);
                // A triangle across an edge has corners where its own face's normal leads elsewhere.
                (n.dot(flat).abs() > 0.5).then(|| n * n.dot(flat).signum())
            };
            surface.points.extend(corners);
            surface.normals.extend(corners.map(|x| curved(x).unwrap_or(flat)));
        }
        surface
    }

    /// An arrow along z from the origin, of length 1 to its shoulders.
    fn arrow() -> Self {
        let outline = [(0.0, 0.0), (0.25, 0.25), (0.25, 4.0), (0.7, 4.0), (0.0, 6.0)];
        let mut surface = Self { points: Vec::new(), normals: Vec::new() };
        let at = |(r, z): (f64, f64), k: u32| {
            let (s, c) = (f64::from(k) / f64::from(SIDES) * std::f64::consts::TAU).sin_cos();
            DVec3::new(r * c, r * s, z)
        };
        for pair in outline.windows(2) {
            for k in 0..SIDES {
                let [a, b, c, d] = [at(pair[0], k), at(pair[0], k + 1), at(pair[1], k + 1), at(pair[1], k)];
                for [p, q, r] in [[a, b, c], [a, c, d]] {
                    if let Some(n) = (q - p).cross(r - p).try_normalize() {
                        surface.points.extend([p, q, r]);
                        surface.normals.extend([n; 3]);
                    }
                }
            }
        }
        surface
    }
}

/// The file as it grows.
#[derive(Default)]
struct File {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    scenes: Vec<Value>,
    animations: Vec<Value>,
}

/// glTF's numbers for single precision, and for what is told of vertices.
const FLOAT: u32 = 5126;
const VERTICES: u32 = 34962;

impl File {
    /// Adds numbers, and says how they are called: `kind` and so many columns a row; `bounds` are told where the format asks for them.
    fn numbers(&mut self, kind: &str, columns: usize, numbers: &[f32], bounds: bool) -> usize {
        let from = self.bin.len();
        self.bin.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        self.views.push(json!({ "buffer": 0, "byteOffset": from, "byteLength": self.bin.len() - from }));
        let mut accessor = json!({
            "bufferView": self.views.len() - 1, "componentType": FLOAT, "count": numbers.len() / columns, "type": kind,
        });
        if bounds {
            let most = |k: usize, of: fn(f32, f32) -> f32, start: f32| {
                numbers[k..].iter().step_by(columns).copied().fold(start, of)
            };
            let column = |of, start| (0..columns).map(|k| most(k, of, start)).collect::<Vec<f32>>();
            accessor["min"] = column(f32::min, f32::INFINITY).into();
            accessor["max"] = column(f32::max, f32::NEG_INFINITY).into();
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Adds a mesh; `None` for one without triangles.
    fn surface(&mut self, name: &str, surface: &Surface, material: usize) -> Option<usize> {
        if surface.points.is_empty() {
            return None;
        }
        let flat = |all: &[DVec3]| all.iter().flat_map(|x| x.as_vec3().to_array()).collect::<Vec<f32>>();
        let from = self.views.len();
        let position = self.numbers("VEC3", 3, &flat(&surface.points), true);
        self.views[from]["target"] = VERTICES.into();
        let normal = self.numbers("VEC3", 3, &flat(&surface.normals), false);
        self.views[from + 1]["target"] = VERTICES.into();
        let attributes = json!({ "POSITION": position, "NORMAL": normal });
        self.meshes.push(json!({ "name": name, "primitives": [{ "attributes": attributes, "material": material }] }));
        Some(self.meshes.len() - 1)
    }

    fn node(&mut self, node: Value) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// The whole file: a header, the JSON chunk and the binary one.
    fn bytes(mut self, title: &str) -> Result<Vec<u8>, String> {
        let paint = |color: [f64; 4], rough: f64| json!({ "pbrMetallicRoughness": { "baseColorFactor": color, "metallicFactor": 0.0, "roughnessFactor": rough } });
        let mut materials: Vec<Value> = COLORS.iter().map(|[r, g, b]| paint([*r, *g, *b, 1.0], 0.6)).collect();
        materials.push(paint([0.67, 0.02, 0.01, 1.0], 1.0));
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let mut document = json!({
            "asset": { "version": "2.0", "generator": concat!("contactd ", env!("CARGO_PKG_VERSION")), "extras": { "title": title } },
            "scene": 0, "scenes": self.scenes, "nodes": self.nodes, "materials": materials,
        });
        // Lists that are there hold something, says the format.
        let lists = [
            ("meshes", self.meshes),
            ("accessors", self.accessors),
            ("bufferViews", self.views),
            ("animations", self.animations),
        ];
        for (name, list) in lists.into_iter().filter(|(_, list)| !list.is_empty()) {
            document[name] = list.into();
        }
        if !self.bin.is_empty() {
            document["buffers"] = json!([{ "byteLength": self.bin.len() }]);
        }
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let whole = 12 + 8 + text.len() + 8 + self.bin.len();
        let word = |n: usize| u32::try_from(n).map(u32::to_le_bytes);
        let too_large =
            |_| format!("{title}: expected fewer triangles and steps than 4 GB of glTF, found {whole} bytes");
        let mut out = Vec::with_capacity(whole);
        out.extend(*b"glTF");
        out.extend(2u32.to_le_bytes());
        out.extend(word(whole).map_err(too_large)?);
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.bin)] {
            out.extend(word(chunk.len()).map_err(too_large)?);
            out.extend(kind);
            out.extend(chunk);
        }
        Ok(out)
    }
}

/// Channels of an animation.
#[derive(Default)]
struct Animation {
    samplers: Vec<Value>,
    channels: Vec<Value>,
}

impl Animation {
    fn channel(&mut self, (node, path): (usize, &str), input: usize, output: usize, way: &str) {
        self.samplers.push(json!({ "input": input, "output": output, "interpolation": way }));
        let target = json!({ "node": node, "path": path });
        self.channels.push(json!({ "sampler": self.samplers.len() - 1, "target": target }));
    }

    /// An object's frame over all steps; nothing of one that rests.
    fn object(&mut self, file: &mut File, node: usize, motions: &[Driven]) {
        let (mut times, mut poses): (Vec<f64>, Vec<Pose>) = (Vec::new(), Vec::new());
        for (i, motion) in motions.iter().enumerate() {
            let keys = motion.keys();
            for key in 0..=keys {
                let t = key as f64 / keys as f64;
                let (at, pose) = (i as f64 + t, motion.at(t));
                match poses.last() {
                    Some(last) if key == 0 && *last == pose => continue,
                    // It was set elsewhere between two steps.
                    Some(_) if key == 0 => {
                        times.pop();
                        poses.pop();
                        times.push(at - JUMP);
                        poses.push(motions[i - 1].at(1.0 - JUMP));
                    }
                    _ => {}
                }
                times.push(at);
                poses.push(pose);
            }
        }
        if poses.iter().all(|p| *p == poses[0]) {
            return;
        }
        let input = file.numbers("SCALAR", 1, &singles(&times), true);
        let places: Vec<f64> = poses.iter().flat_map(|p| p.position.to_array()).collect();
        let output = file.numbers("VEC3", 3, &singles(&places), false);
        self.channel((node, "translation"), input, output, "LINEAR");
        let mut last = poses[0].rotation;
        // q and −q are the same rotation: of two keys the nearer ones are told.
        let rotations = poses.iter().flat_map(|p| {
            last = if p.rotation.dot(last) < 0.0 { -p.rotation } else { p.rotation };
            last.to_array()
        });
        let rotations: Vec<f64> = rotations.collect();
        let output = file.numbers("VEC4", 4, &singles(&rotations), false);
        self.channel((node, "rotation"), input, output, "LINEAR");
    }

    /// A mark that stands between two times of so many seconds.
    fn mark(&mut self, file: &mut File, node: usize, (from, until, whole): (f64, f64, f64), size: f64) {
        let mut keys: Vec<(f64, f64)> = Vec::new();
        if from > 0.0 {
            keys.push((0.0, 0.0));
        }
        keys.push((from, size));
        if until < whole && until > from {
            keys.push((until, 0.0));
        }
        let times: Vec<f64> = keys.iter().map(|key| key.0).collect();
        let sizes: Vec<f64> = keys.iter().flat_map(|key| [key.1; 3]).collect();
        let input = file.numbers("SCALAR", 1, &singles(&times), true);
        let output = file.numbers("VEC3", 3, &singles(&sizes), false);
        self.channel((node, "scale"), input, output, "STEP");
    }

    /// `None` where nothing moves and nothing meets.
    fn told(self, name: &str) -> Option<Value> {
        let has_any = !self.channels.is_empty();
        has_any.then(|| json!({ "name": name, "samplers": self.samplers, "channels": self.channels }))
    }
}

/// Numbers as the file keeps them.
fn singles(all: &[f64]) -> Vec<f32> {
    all.iter().map(|x| *x as f32).collect()
}
