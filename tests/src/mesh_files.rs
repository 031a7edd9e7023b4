//! Writers of the formats of meshes, as plain as the formats allow: what they write is read back and held against the mesh itself.

use crate::meshes::Mesh;
use crate::random_solids::Random;
use glam::{DAffine3, DVec3};
use std::fmt::Write as _;

/// A body: a mesh in its own coordinates, and where it stands.
pub type Body = (Mesh, DAffine3);

/// A format that is written: what its files end in, whether it holds several bodies with transforms, and what writes it.
pub struct Writer {
    /// How names of its files end.
    pub ending: &'static str,
    /// One mesh alone, as it stands.
    pub single: bool,
    /// Writes bodies.
    pub write: fn(&[Body], &mut Random) -> Vec<u8>,
}

/// All of them.
pub const WRITERS: [Writer; 14] = [
    Writer { ending: "stl", single: true, write: |b, _| ascii_stl(&b[0].0) },
    Writer { ending: "stl", single: true, write: |b, _| binary_stl(&b[0].0) },
    Writer { ending: "off", single: true, write: |b, _| off(&b[0].0) },
    Writer { ending: "obj", single: true, write: |b, _| obj(&b[0].0) },
    Writer { ending: "ply", single: true, write: |b, _| ply(&b[0].0, "ascii") },
    Writer { ending: "ply", single: true, write: |b, _| ply(&b[0].0, "binary_little_endian") },
    Writer { ending: "ply", single: true, write: |b, _| ply(&b[0].0, "binary_big_endian") },
    Writer { ending: "msh", single: true, write: |b, r| msh(&b[0].0, r) },
    Writer { ending: "3mf", single: false, write: threemf },
    Writer { ending: "amf", single: false, write: |b, _| amf(b).into_bytes() },
    Writer { ending: "amf", single: false, write: |b, _| archive(&[("part.amf", amf(b).as_bytes())]) },
    Writer { ending: "gltf", single: false, write: |b, r| gltf(b, false, r) },
    Writer { ending: "glb", single: false, write: |b, r| gltf(b, true, r) },
    Writer { ending: "dae", single: false, write: dae },
];

/// With normals and texture coordinates that mean nothing, or without.
fn msh((points, triangles): &Mesh, r: &mut Random) -> Vec<u8> {
    let (normals, textures) = (r.below(2) * points.len(), r.below(2) * points.len());
    let mut out = Vec::new();
    [points.len(), normals, textures, triangles.len()].iter().for_each(|n| out.extend((*n as u32).to_le_bytes()));
    points.iter().flat_map(|p| p.to_array()).for_each(|v| out.extend((v as f32).to_le_bytes()));
    (0..3 * normals + 2 * textures).for_each(|k| out.extend((k as f32).to_le_bytes()));
    triangles.iter().flatten().for_each(|i| out.extend(i.to_le_bytes()));
    out
}

fn ascii_stl((points, triangles): &Mesh) -> Vec<u8> {
    let mut out = String::from("solid part\n");
    for t in triangles {
        out += "facet normal 0 0 0\nouter loop\n";
        for i in t {
            let p = points[*i as usize];
            let _ = writeln!(out, "vertex {} {} {}", p.x, p.y, p.z);
        }
        out += "endloop\nendfacet\n";
    }
    (out + "endsolid part\n").into_bytes()
}

fn binary_stl((points, triangles): &Mesh) -> Vec<u8> {
    let mut out = vec![b' '; 80];
    out.extend((triangles.len() as u32).to_le_bytes());
    for t in triangles {
        out.extend([0; 12]);
        t.iter().flat_map(|i| points[*i as usize].to_array()).for_each(|v| out.extend((v as f32).to_le_bytes()));
        out.extend([0; 2]);
    }
    out
}

fn off((points, triangles): &Mesh) -> Vec<u8> {
    let mut out = format!("OFF\n{} {} 0\n", points.len(), triangles.len());
    points.iter().for_each(|p| out += &format!("{} {} {}\n", p.x, p.y, p.z));
    triangles.iter().for_each(|[a, b, c]| out += &format!("3 {a} {b} {c}\n"));
    out.into_bytes()
}

fn obj((points, triangles): &Mesh) -> Vec<u8> {
    let mut out: String = points.iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z)).collect();
    triangles.iter().for_each(|[a, b, c]| out += &format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    out.into_bytes()
}

fn ply((points, triangles): &Mesh, format: &str) -> Vec<u8> {
    let head = format!(
        "ply\nformat {format} 1.0\ncomment of a test\nelement note 1\nproperty list uchar short values\nelement vertex {}\n\
         property double x\nproperty uchar red\nproperty double y\nproperty double z\nelement face {}\n\
         property list uchar uint vertex_indices\nproperty int flags\nend_header\n",
        points.len(),
        triangles.len()
    );
    let mut out = head.into_bytes();
    if format == "ascii" {
        out.extend(b"2 -5 6\n");
        points.iter().for_each(|p| out.extend(format!("{} 255 {} {}\n", p.x, p.y, p.z).bytes()));
        triangles.iter().for_each(|[a, b, c]| out.extend(format!("3 {a} {b} {c} -1\n").bytes()));
        return out;
    }
    let big = format == "binary_big_endian";
    let mut put = |mut bytes: Vec<u8>| {
        if big {
            bytes.reverse();
        }
        out.extend(bytes);
    };
    put(vec![2]);
    put((-5i16).to_le_bytes().into());
    put(6i16.to_le_bytes().into());
    for p in points {
        put(p.x.to_le_bytes().into());
        put(vec![255]);
        put(p.y.to_le_bytes().into());
        put(p.z.to_le_bytes().into());
    }
    for t in triangles {
        put(vec![3]);
        t.iter().for_each(|i| put(i.to_le_bytes().into()));
        put((-1i32).to_le_bytes().into());
    }
    out
}

/// A package whose bodies are items, or components of another object in a part of its own.
fn threemf(bodies: &[Body], r: &mut Random) -> Vec<u8> {
    let space = "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" \
                 xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\"";
    let mut objects = String::new();
    for (i, ((points, triangles), _)) in bodies.iter().enumerate() {
        let points: String =
            points.iter().map(|p| format!("<vertex x=\"{}\" y=\"{}\" z=\"{}\"/>\n", p.x, p.y, p.z)).collect();
        let triangles: String =
            triangles.iter().map(|[a, b, c]| format!("<triangle v1=\"{a}\" v2=\"{b}\" v3=\"{c}\"/>\n")).collect();
        objects += &format!(
            "<object id=\"{}\" type=\"model\"><mesh><vertices>{points}</vertices><triangles>{triangles}</triangles></mesh></object>",
            i + 1
        );
    }
    let split = r.chance(0.5);
    let path = if split { " p:path=\"/3D/Objects/bodies.model\"" } else { "" };
    let (mut components, mut items) = (String::new(), String::new());
    let shift = DVec3::new(1.0, -2.0, 3.0);
    for (i, (_, place)) in bodies.iter().enumerate() {
        let by_component = i % 2 == 0;
        let place = if by_component { DAffine3::from_translation(-shift) * *place } else { *place };
        let numbers: Vec<String> = place.to_cols_array().iter().map(f64::to_string).collect();
        let transform = format!("objectid=\"{}\"{path} transform=\"{}\"", i + 1, numbers.join(" "));
        if by_component {
            components += &format!("<component {transform}/>");
        } else {
            items += &format!("<item {transform}/>");
        }
    }
    let group = format!("<object id=\"99\"><components>{components}</components></object>");
    items += "<item objectid=\"99\" transform=\"1 0 0 0 1 0 0 0 1 1 -2 3\"/>";
    let model = |resources: &str, build: &str| {
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model unit=\"inch\" {space}><resources>{resources}</resources>\
             <build>{build}</build></model>"
        )
    };
    let relations = "<Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\"><Relationship \
                     Target=\"/3D/3dmodel.model\" Id=\"r\" Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/>\
                     </Relationships>";
    if split {
        return archive(&[
            ("_rels/.rels", relations.as_bytes()),
            ("3D/3dmodel.model", model(&group, &items).as_bytes()),
            ("3D/Objects/bodies.model", model(&objects, "").as_bytes()),
        ]);
    }
    archive(&[
        ("3D/3dmodel.model", model(&(objects + &group), &items).as_bytes()),
        ("_rels/.rels", relations.as_bytes()),
    ])
}

fn amf(bodies: &[Body]) -> String {
    let (mut objects, mut instances) = (String::new(), String::new());
    for (i, ((points, triangles), place)) in bodies.iter().enumerate() {
        let points: String = points
            .iter()
            .map(|p| {
                format!("<vertex><coordinates><x>{}</x><y>{}</y>\n<z>{}</z></coordinates></vertex>", p.x, p.y, p.z)
            })
            .collect();
        let triangles: String = triangles
            .iter()
            .map(|[a, b, c]| format!("<triangle><v1>{a}</v1><v2>{b}</v2><v3>{c}</v3></triangle>\n"))
            .collect();
        objects += &format!(
            "<object id=\"{i}\"><metadata type=\"name\">part</metadata><mesh><vertices>{points}</vertices>\
             <volume>{triangles}</volume></mesh></object>"
        );
        // Turned about x, then y, then z.
        let (z, y, x) = glam::DQuat::from_affine3(place).to_euler(glam::EulerRot::ZYX);
        let [x, y, z] = [x, y, z].map(f64::to_degrees);
        let t = place.translation;
        instances += &format!(
            "<instance objectid=\"{i}\"><deltax>{}</deltax><deltay>{}</deltay><deltaz>{}</deltaz><rx>{x}</rx><ry>{y}</ry><rz>{z}</rz>\
             </instance>",
            t.x, t.y, t.z
        );
    }
    format!(
        "<?xml version=\"1.0\"?>\n<amf unit=\"millimeter\">{objects}<constellation id=\"c\">{instances}</constellation></amf>"
    )
}

/// Bodies as nodes below others, points in single precision; mirrored ones where a transform mirrors.
fn gltf(bodies: &[Body], binary: bool, r: &mut Random) -> Vec<u8> {
    let (mut buffer, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    let (mut meshes, mut nodes) = (Vec::new(), Vec::new());
    for (i, ((points, triangles), place)) in bodies.iter().enumerate() {
        let begin = buffer.len();
        points.iter().for_each(|p| {
            p.to_array().iter().for_each(|v| buffer.extend((*v as f32).to_le_bytes()));
            buffer.extend([7; 4]);
        });
        views.push(format!(
            "{{\"buffer\":0,\"byteOffset\":{begin},\"byteLength\":{},\"byteStride\":16}}",
            16 * points.len()
        ));
        accessors.push(format!(
            "{{\"bufferView\":{},\"componentType\":5126,\"count\":{},\"type\":\"VEC3\"}}",
            views.len() - 1,
            points.len()
        ));
        let position = accessors.len() - 1;
        // Two primitives of one mesh, each open by itself.
        let mut primitives = Vec::new();
        let half = triangles.len() / 2;
        for (part, short) in [(&triangles[..half], false), (&triangles[half..], true)] {
            let begin = buffer.len();
            for i in part.iter().flatten() {
                if short { buffer.extend((*i as u16).to_le_bytes()) } else { buffer.extend(i.to_le_bytes()) }
            }
            views.push(format!("{{\"buffer\":0,\"byteOffset\":{begin},\"byteLength\":{}}}", buffer.len() - begin));
            buffer.resize(buffer.len().next_multiple_of(4), 0);
            accessors.push(format!(
                "{{\"bufferView\":{},\"componentType\":{},\"count\":{},\"type\":\"SCALAR\"}}",
                views.len() - 1,
                if short { 5123 } else { 5125 },
                3 * part.len()
            ));
            primitives.push(format!(
                "{{\"attributes\":{{\"POSITION\":{position}}},\"indices\":{},\"material\":0}}",
                accessors.len() - 1
            ));
        }
        meshes.push(format!("{{\"primitives\":[{}]}}", primitives.join(",")));
        let numbers = |v: &[f64]| v.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        if r.chance(0.5) {
            let m = glam::DMat4::from(*place).to_cols_array();
            nodes.push(format!("{{\"mesh\":{i},\"matrix\":[{}]}}", numbers(&m)));
        } else {
            let (scale, turn, shift) = place.to_scale_rotation_translation();
            nodes.push(format!(
                "{{\"mesh\":{i},\"scale\":[{}],\"rotation\":[{}],\"translation\":[{}]}}",
                numbers(&scale.to_array()),
                numbers(&turn.to_array()),
                numbers(&shift.to_array())
            ));
        }
    }
    let children: Vec<String> = (0..bodies.len()).map(|i| i.to_string()).collect();
    nodes.push(format!("{{\"children\":[{}],\"name\":\"all\"}}", children.join(",")));
    let uri = if binary {
        String::new()
    } else {
        format!(",\"uri\":\"data:application/octet-stream;base64,{}\"", base64(&buffer))
    };
    let mut text = format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},\"scene\":0,\"scenes\":[{{\"nodes\":[{}]}}],\"nodes\":[{}],\"meshes\":[{}],\
         \"accessors\":[{}],\"bufferViews\":[{}],\"buffers\":[{{\"byteLength\":{}{uri}}}]}}",
        bodies.len(),
        nodes.join(","),
        meshes.join(","),
        accessors.join(","),
        views.join(","),
        buffer.len()
    )
    .into_bytes();
    if !binary {
        return text;
    }
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend(((28 + text.len() + buffer.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &buffer)] {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(chunk);
    }
    out
}

/// Bodies as nodes within each other's transforms, in metres with +z up; the second half of a mesh's triangles in a primitive of its own.
fn dae(bodies: &[Body], r: &mut Random) -> Vec<u8> {
    let (mut geometries, mut nodes) = (String::new(), String::new());
    for (i, ((points, triangles), place)) in bodies.iter().enumerate() {
        let numbers: String = points.iter().map(|p| format!("{} {} {}\n", p.x, p.y, p.z)).collect();
        let (half, uneven) = (triangles.len() / 2, r.chance(0.5));
        let list =
            |part: &[[u32; 3]], gap: &str| -> String { part.iter().flatten().map(|i| format!("{gap}{i} ")).collect() };
        let input = |at: u32| format!("<input semantic=\"VERTEX\" source=\"#v{i}\" offset=\"{at}\"/>");
        let (first, rest) = triangles.split_at(half);
        let counts = "3 ".repeat(rest.len());
        let (at, gap) = if uneven { (1, "0 ") } else { (0, "") };
        let _ = write!(
            geometries,
            "<geometry id=\"g{i}\"><mesh><source id=\"s{i}\"><float_array id=\"f{i}\" count=\"{}\">{numbers}</float_array>\
             <technique_common><accessor source=\"#f{i}\" count=\"{}\" stride=\"3\"/></technique_common></source>\
             <vertices id=\"v{i}\"><input semantic=\"POSITION\" source=\"#s{i}\"/></vertices>\
             <triangles count=\"{half}\">{}<p>{}</p></triangles>\
             <polylist count=\"{}\">{}<vcount>{counts}</vcount><p>{}</p></polylist></mesh></geometry>",
            3 * points.len(),
            points.len(),
            input(0),
            list(first, ""),
            rest.len(),
            input(at),
            list(rest, gap),
        );
        let m = glam::DMat4::from(*place).transpose().to_cols_array();
        let matrix: Vec<String> = m.iter().map(f64::to_string).collect();
        let _ = write!(
            nodes,
            "<node><matrix>{}</matrix><node><instance_geometry url=\"#g{i}\"/></node></node>",
            matrix.join(" ")
        );
    }
    format!(
        "<?xml version=\"1.0\"?>\n<COLLADA version=\"1.4.1\"><asset><unit meter=\"1\"/><up_axis>Z_UP</up_axis></asset>\
         <library_geometries>{geometries}</library_geometries><library_visual_scenes><visual_scene id=\"all\">{nodes}\
         </visual_scene></library_visual_scenes><scene><instance_visual_scene url=\"#all\"/></scene></COLLADA>"
    )
    .into_bytes()
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::new();
    for chunk in bytes.chunks(3) {
        let n = chunk.iter().fold(0u32, |n, b| n << 8 | u32::from(*b)) << (8 * (3 - chunk.len()));
        for k in 0..4 {
            out.push(if k <= chunk.len() { char::from(DIGITS[(n >> (18 - 6 * k)) as usize & 63]) } else { '=' });
        }
    }
    out
}

/// An archive of files: the first one stored, the others in blocks of "deflate" that hold them as they are.
pub fn archive(files: &[(&str, &[u8])]) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for (i, (name, content)) in files.iter().enumerate() {
        let packed = if i == 0 { content.to_vec() } else { blocks(content) };
        let method = if i == 0 { 0u16 } else { 8 };
        let mut fields = Vec::new();
        fields.extend(method.to_le_bytes());
        fields.extend([0; 4]);
        for n in [checksum(content), packed.len() as u32, content.len() as u32] {
            fields.extend(n.to_le_bytes());
        }
        fields.extend((name.len() as u16).to_le_bytes());
        fields.extend([0; 2]);
        directory.extend(b"PK\x01\x02\x14\0\x14\0\0\0");
        directory.extend(&fields);
        directory.extend([0; 10]);
        directory.extend((out.len() as u32).to_le_bytes());
        directory.extend(name.bytes());
        out.extend(b"PK\x03\x04\x14\0\0\0");
        out.extend(&fields);
        out.extend(name.bytes());
        out.extend(packed);
    }
    let begin = out.len() as u32;
    let count = files.len() as u16;
    out.extend(&directory);
    out.extend(b"PK\x05\x06\0\0\0\0");
    out.extend(count.to_le_bytes());
    out.extend(count.to_le_bytes());
    out.extend((directory.len() as u32).to_le_bytes());
    out.extend(begin.to_le_bytes());
    out.extend([0; 2]);
    out
}

fn blocks(content: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let chunks: Vec<&[u8]> = content.chunks(50_000).collect();
    for (i, chunk) in chunks.iter().enumerate() {
        let length = chunk.len() as u16;
        out.push(u8::from(i + 1 == chunks.len()));
        out.extend(length.to_le_bytes());
        out.extend((!length).to_le_bytes());
        out.extend(*chunk);
    }
    out
}

/// CRC-32 of bytes, bit by bit.
fn checksum(bytes: &[u8]) -> u32 {
    let step = |crc: u32| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, b| (0..8).fold(crc ^ u32::from(*b), |c, _| step(c)))
}
