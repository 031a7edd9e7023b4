//! glTF 2.0, as text with embedded buffers or as one binary file (.glb): the triangles of the scene's meshes, each where its nodes'
//! transforms put it.
//!
//! Materials, textures, normals, animations, skins and morph targets are not read. A mesh's primitives are one body: they
//! differ in material, and are closed together. glTF's lengths are metres, +y is up; numbers are taken as they stand.

use super::{Bodies, MeshFormat, Place, Polygons, Result};
use crate::import::Limits;
use crate::import::problem::Problem;
use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde::Deserialize;

/// The row of `mesh::FORMATS`.
pub const FORMAT: MeshFormat = MeshFormat { name: "gltf", endings: &["glb", "gltf"], read };

/// Nodes within nodes.
const DEEPEST: usize = 256;
/// Visits of nodes.
const MOST_VISITS: usize = 100_000;
/// Extensions that change nothing of what is read here, or that are read: whole numbers as coordinates.
const KNOWN: [&str; 9] = [
    "KHR_mesh_quantization",
    "KHR_materials_unlit",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_materials_emissive_strength",
    "KHR_texture_transform",
    "KHR_lights_punctual",
];

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
#[derive(Default)]
struct Document {
    scene: Option<usize>,
    scenes: Vec<Scene>,
    nodes: Vec<Node>,
    meshes: Vec<Mesh>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<View>,
    buffers: Vec<Buffer>,
    extensions_required: Vec<String>,
}

#[derive(Deserialize)]
struct Scene {
    #[serde(default)]
    nodes: Vec<usize>,
}

#[derive(Deserialize)]
struct Node {
    #[serde(default)]
    children: Vec<usize>,
    mesh: Option<usize>,
    skin: Option<usize>,
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

#[derive(Deserialize)]
struct Mesh {
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
struct Primitive {
    attributes: Attributes,
    indices: Option<usize>,
    mode: Option<u32>,
}

#[derive(Deserialize)]
struct Attributes {
    #[serde(rename = "POSITION")]
    position: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: usize,
    #[serde(rename = "type")]
    kind: String,
    sparse: Option<serde::de::IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

#[derive(Deserialize)]
struct Buffer {
    uri: Option<String>,
}

/// Something else than expected, told with where in the document's lists it stands.
fn wrong(expected: impl Into<String>, found: impl Into<String>) -> (Place, Problem) {
    (Place::START, Problem::syntax(expected, found))
}

/// Reads a file.
///
/// # Errors
/// What is wrong with it.
pub fn read(bytes: &[u8], limits: &Limits) -> Result<Bodies> {
    let (text, binary) = if bytes.starts_with(b"glTF") { chunks(bytes)? } else { (bytes, None) };
    let document: Document = serde_json::from_slice(text).map_err(|e| {
        let at = Place { line: e.line().max(1) as u32, column: e.column().max(1) as u32 };
        let sentence = e.to_string();
        (at, Problem::syntax("glTF", sentence.split(" at line ").next().unwrap_or_default()))
    })?;
    if let Some(name) = document.extensions_required.iter().find(|n| !KNOWN.contains(&n.as_str())) {
        return Err(wrong("a file without extensions that change its meshes", format!("{name:?} required")));
    }
    let mut buffers = Vec::with_capacity(document.buffers.len());
    for (i, buffer) in document.buffers.iter().enumerate() {
        buffers.push(match (&buffer.uri, binary) {
            (None, Some(binary)) if i == 0 => binary.to_vec(),
            (None, _) => return Err(wrong(format!("data of buffers[{i}]"), "none")),
            (Some(uri), _) => embedded(uri)
                .ok_or_else(|| wrong(format!("data within the file as buffers[{i}]"), format!("{:.60?}", uri)))?,
        });
    }
    let bodies = Bodies::new("lengths in metres, +y is up, as glTF says; numbers as they stand".into());
    let mut reader = Reader { document: &document, buffers, limits, triangles: 0, corners: 0, visits: 0, bodies };
    let scene = document.scene.unwrap_or(0);
    match document.scenes.get(scene) {
        Some(scene) => {
            for &node in &scene.nodes {
                reader.node(node, DAffine3::IDENTITY, 0)?;
            }
        }
        None if document.scenes.is_empty() && document.scene.is_none() => {
            for mesh in 0..document.meshes.len() {
                reader.mesh(mesh, &DAffine3::IDENTITY)?;
            }
        }
        None => return Err(wrong(format!("a scene below {}", document.scenes.len()), scene.to_string())),
    }
    if reader.bodies.all.is_empty() {
        return Err(wrong("a mesh of triangles in the scene", "none"));
    }
    Ok(reader.bodies)
}

/// The text of a binary file, and its buffer.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>)> {
    let number = |at: usize| {
        let field = bytes.get(at..at + 4)?;
        Some(u32::from_le_bytes([field[0], field[1], field[2], field[3]]))
    };
    if number(4) != Some(2) {
        return Err(wrong("glTF of version 2", format!("version {:?}", number(4).unwrap_or_default())));
    }
    let (mut at, mut text, mut binary) = (12, None, None);
    while let (Some(length), Some(kind)) = (number(at), number(at + 4)) {
        let end = (at + 8).checked_add(length as usize);
        let Some(chunk) = end.and_then(|end| bytes.get(at + 8..end)) else {
            return Err(wrong(format!("{length} bytes of a chunk"), format!("{}", bytes.len() - at - 8)));
        };
        match kind {
            0x4e4f_534a => text = text.or(Some(chunk)),
            0x004e_4942 => binary = binary.or(Some(chunk)),
            _ => {}
        }
        at += 8 + length as usize;
    }
    text.map(|text| (text, binary)).ok_or_else(|| wrong("a chunk of JSON", "none"))
}

/// What a data URI holds.
fn embedded(uri: &str) -> Option<Vec<u8>> {
    let (head, data) = uri.strip_prefix("data:")?.split_once(',')?;
    head.ends_with(";base64").then_some(())?;
    let (mut out, mut bits, mut count) = (Vec::with_capacity(data.len() / 4 * 3), 0u32, 0);
    for byte in data.bytes().filter(|b| *b != b'=') {
        let six = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(six);
        count += 6;
        if count >= 8 {
            count -= 8;
            out.push((bits >> count) as u8);
            bits &= (1 << count) - 1;
        }
    }
    Some(out)
}

struct Reader<'d> {
    document: &'d Document,
    buffers: Vec<Vec<u8>>,
    limits: &'d Limits,
    triangles: usize,
    /// Corners read of all instances.
    corners: usize,
    visits: usize,
    bodies: Bodies,
}

impl Reader<'_> {
    fn node(&mut self, index: usize, outer: DAffine3, depth: usize) -> Result<()> {
        self.visits += 1;
        if depth > DEEPEST || self.visits > MOST_VISITS {
            let (what, limit) = match depth > DEEPEST {
                true => ("nodes within each other", DEEPEST),
                false => ("nodes of a scene", MOST_VISITS),
            };
            return Err((Place::START, Problem::Limit { what, limit }));
        }
        let Some(node) = self.document.nodes.get(index) else {
            return Err(wrong(format!("a node below {}", self.document.nodes.len()), index.to_string()));
        };
        let local = match node.matrix {
            Some(m) => DAffine3::from_mat4(DMat4::from_cols_array(&m)),
            None => {
                let turn = DQuat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
                let length = turn.length();
                if !(0.99..1.01).contains(&length) {
                    return Err(wrong(format!("a unit quaternion as rotation of nodes[{index}]"), format!("{turn}")));
                }
                let scale = DVec3::from_array(node.scale.unwrap_or([1.0; 3]));
                let shift = DVec3::from_array(node.translation.unwrap_or([0.0; 3]));
                DAffine3::from_scale_rotation_translation(scale, turn * (1.0 / length), shift)
            }
        };
        let inner = outer * local;
        if !inner.is_finite() {
            return Err(wrong(format!("finite numbers as transform of nodes[{index}]"), "others"));
        }
        if let Some(mesh) = node.mesh {
            if node.skin.is_some() {
                self.bodies.leave(&format!("skin of nodes[{index}]"));
            }
            self.mesh(mesh, &inner)?;
        }
        for &child in &node.children {
            self.node(child, inner, depth + 1)?;
        }
        Ok(())
    }

    fn mesh(&mut self, index: usize, place: &DAffine3) -> Result<()> {
        let Some(mesh) = self.document.meshes.get(index) else {
            return Err(wrong(format!("a mesh below {}", self.document.meshes.len()), index.to_string()));
        };
        let mut body = Polygons::default();
        for primitive in &mesh.primitives {
            let mode = primitive.mode.unwrap_or(4);
            let (Some(position), 4..=6) = (primitive.attributes.position, mode) else {
                self.bodies.leave(&format!("primitive without triangles of meshes[{index}]"));
                continue;
            };
            let first = body.points.len() as u32;
            let coordinates = self.numbers(position, 3, "VEC3")?;
            body.points.extend(coordinates.chunks_exact(3).map(DVec3::from_slice));
            if let Some(p) = body.points.iter().find(|p| !p.is_finite()) {
                return Err(wrong(format!("finite numbers as POSITION of meshes[{index}]"), p.to_string()));
            }
            let count = body.points.len() as u32 - first;
            let corners: Vec<u32> = match primitive.indices {
                None => (0..count).collect(),
                Some(indices) => {
                    let numbers = self.numbers(indices, 1, "SCALAR")?;
                    if let Some(n) =
                        numbers.iter().find(|n| !(n.fract() == 0.0 && (0.0..f64::from(count)).contains(*n)))
                    {
                        return Err(wrong(
                            format!("a corner's number below {count} in meshes[{index}]"),
                            n.to_string(),
                        ));
                    }
                    numbers.into_iter().map(|n| n as u32).collect()
                }
            };
            let triangles: Vec<[u32; 3]> = match mode {
                4 => corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
                // Every other triangle of a strip runs the other way round.
                5 => {
                    let windows = corners.windows(3).enumerate();
                    windows.map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] }).collect()
                }
                _ => corners.get(1..).unwrap_or_default().windows(2).map(|w| [w[0], w[1], corners[0]]).collect(),
            };
            for t in triangles {
                let face = t.map(|i| i + first);
                body.add(&face, || Place::START, &mut self.triangles, self.limits)?;
            }
        }
        if !body.is_empty() {
            self.bodies.all.push(body.placed(place));
        }
        Ok(())
    }

    /// The numbers of an accessor, `width` of each element.
    fn numbers(&mut self, index: usize, width: usize, kind: &str) -> Result<Vec<f64>> {
        let Self { document, buffers, limits, .. } = self;
        let name = format!("accessors[{index}]");
        let accessor = document.accessors.get(index).ok_or_else(|| wrong("an accessor", format!("none for {name}")))?;
        if accessor.kind != kind || accessor.sparse.is_some() {
            let found = if accessor.sparse.is_some() { "a sparse one" } else { &accessor.kind };
            return Err(wrong(format!("{kind}, not sparse, as {name}"), found));
        }
        let bytes = match accessor.component_type {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            5125 | 5126 => 4,
            other => return Err(wrong(format!("a kind of number of {name}"), other.to_string())),
        };
        self.corners = self.corners.saturating_add(accessor.count);
        let most = limits.mesh_facets.saturating_mul(6);
        if self.corners > most {
            return Err((Place::START, Problem::Limit { what: "corners of a mesh", limit: most }));
        }
        let missing = |what: &str| wrong(format!("{what} of {name}"), "none that is so long");
        let view = accessor.buffer_view.and_then(|v| document.buffer_views.get(v));
        let view = view.ok_or_else(|| missing("a buffer view"))?;
        let end = view.byte_offset.checked_add(view.byte_length);
        let data = buffers.get(view.buffer).zip(end).and_then(|(b, end)| b.get(view.byte_offset..end));
        let data = data.and_then(|d| d.get(accessor.byte_offset..)).ok_or_else(|| missing("data"))?;
        let stride = view.byte_stride.unwrap_or(bytes * width).max(bytes * width);
        let mut numbers = Vec::with_capacity(accessor.count * width);
        for i in 0..accessor.count {
            let at = i.checked_mul(stride);
            let element = at.and_then(|at| data.get(at..)).and_then(|d| d.get(..bytes * width));
            for c in element.ok_or_else(|| missing("data"))?.chunks_exact(bytes) {
                let (value, largest) = match accessor.component_type {
                    5120 => (f64::from(c[0] as i8), 127.0),
                    5121 => (f64::from(c[0]), 255.0),
                    5122 => (f64::from(i16::from_le_bytes([c[0], c[1]])), 32767.0),
                    5123 => (f64::from(u16::from_le_bytes([c[0], c[1]])), 65535.0),
                    5125 => (f64::from(u32::from_le_bytes([c[0], c[1], c[2], c[3]])), 1.0),
                    _ => (f64::from(f32::from_le_bytes([c[0], c[1], c[2], c[3]])), 1.0),
                };
                numbers.push(if accessor.normalized { (value / largest).max(-1.0) } else { value });
            }
        }
        Ok(numbers)
    }
}
