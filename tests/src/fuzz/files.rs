//! Files of meshes and drawings: any bytes are a solid or a drawing that can be asked, or one sentence with its place.
//!
//! An input's first byte chooses the format. Of an archive either the whole is mutated, or what is in it: then it is packed
//! again, for a checksum would refuse what is not.

use super::Target;
use super::csg::ask_all;
use crate::mesh_files::{WRITERS, archive};
use crate::meshes;
use crate::random_solids::Random;
use contactd::import::drawing::{self, Frame};
use contactd::import::{Attachment, Facets, Limits, Source};
use glam::{DAffine3, DVec2};

pub(super) const MESHES: Target =
    Target { name: "meshes", run: meshes, seeds: mesh_seeds, words: &MESH_WORDS, longest: 6000, thorough_every: 64 };

pub(super) const DRAWINGS: Target = Target {
    name: "drawings",
    run: drawings,
    seeds: drawing_seeds,
    words: &DRAWING_WORDS,
    longest: 2000,
    thorough_every: 64,
};

/// How names of files end, by an input's first byte; "in 3mf" is the model within a package.
const MESHES_OF: [&str; 11] = ["stl", "off", "obj", "ply", "3mf", "amf", "gltf", "glb", "in 3mf", "dae", "msh"];
const DRAWINGS_OF: [&str; 4] = ["svg", "dxf", "dat", "png"];

const MESH_WORDS: [&str; 24] = [
    "4294967295",
    "1e308",
    "nan",
    "-1",
    "0",
    "65536",
    "PK\x01\x02",
    "PK\x05\x06",
    "PK\x03\x04",
    "PK\x06\x06",
    "\u{1}\0\u{10}\0",
    "<component objectid=\"1\"/>",
    "<item objectid=\"99\"/>",
    "transform=\"0 0 0 0 0 0 0 0 0 0 0 0\"",
    "<!DOCTYPE a [<!ENTITY a \"&b;\">]>",
    "&a;",
    "property list uchar int vertex_indices\n",
    "element vertex 4000000000\n",
    "\"byteOffset\":18446744073709551615,",
    "\"children\":[0],",
    "\"mode\":5,",
    "\"byteStride\":4294967296,",
    "f 1 2 3\n",
    "3 0 1 2\n",
];

const DRAWING_WORDS: [&str; 24] = [
    "<g transform='scale(0)'>",
    "<g transform='matrix(1e200 0 0 1e200 0 0)'>",
    "</g>",
    "<line x1='1e300' y1='0' x2='5' y2='5'/>",
    "<polyline points='0 0 9 9' stroke-width='1e308'/>",
    "<path d='M0 0A1e-300 1 0 1 1 5 5'/>",
    "<use href='#a'/>",
    "viewBox='0 0 1e-320 1'",
    "preserveAspectRatio='xMinYMax slice'",
    "zM",
    "S1 1 2 2",
    "t5 5",
    "A5 5 0 1 0 3 3",
    "1e999",
    "-.5.5",
    "nan",
    "0\nCIRCLE\n10\n0\n20\n0\n40\n1e300\n",
    "0\nINSERT\n2\na\n41\n1e200\n",
    "0\nBLOCK\n2\na\n",
    "0\nENDBLK\n",
    "1e308 -1e308\n",
    "IHDR",
    "IDAT",
    "\n",
];

fn mesh_seeds() -> Vec<Vec<u8>> {
    let mut r = Random::new(5);
    let mesh = meshes::prism(&[1.0, 0.5, 1.0, 0.8], 0.5);
    let mut all = Vec::new();
    for writer in &WRITERS {
        let mut bodies = vec![(mesh.clone(), DAffine3::IDENTITY)];
        if !writer.single {
            bodies.push((meshes::prism(&[1.0; 3], 1.0), DAffine3::from_translation(glam::DVec3::X)));
        }
        let kind = MESHES_OF.iter().position(|k| *k == writer.ending).unwrap_or(0) as u8;
        all.push([vec![kind], (writer.write)(&bodies, &mut r)].concat());
    }
    let space = "xmlns:p=\"p\"";
    let corner = |x: i32, y: i32, z: i32| format!("<vertex x=\"{x}\" y=\"{y}\" z=\"{z}\"/>");
    let corners = [corner(0, 0, 0), corner(1, 0, 0), corner(0, 1, 0), corner(0, 0, 1)].concat();
    let triangles: String = ["0 2 1", "0 1 3", "1 2 3", "0 3 2"]
        .map(|t| {
            let v: Vec<&str> = t.split(' ').collect();
            format!("<triangle v1=\"{}\" v2=\"{}\" v3=\"{}\"/>", v[0], v[1], v[2])
        })
        .concat();
    let inside = format!(
        "<model {space}><resources><object id=\"1\"><mesh><vertices>{corners}</vertices><triangles>{triangles}</triangles></mesh></object>\
         <object id=\"2\"><components><component objectid=\"1\"/><component objectid=\"1\" transform=\"1 0 0 0 1 0 0 0 1 3 0 0\"/>\
         </components></object></resources><build><item objectid=\"2\"/></build></model>"
    );
    all.push([vec![8], inside.into_bytes()].concat());
    all
}

fn limits() -> Limits {
    Limits { bytes: 20_000, mesh_facets: 200, polyhedron_faces: 100, nodes: 500, faces: 2000, ..Limits::default() }
}

fn meshes(bytes: &[u8], thorough: bool) -> Result<String, String> {
    let Some((kind, content)) = bytes.split_first() else { return Ok("empty".into()) };
    let kind = MESHES_OF[usize::from(*kind) % MESHES_OF.len()];
    let packed;
    let (ending, content) = match kind {
        "in 3mf" => {
            packed = archive(&[("a.model", content), ("_rels/.rels", b"<r/>")]);
            ("3mf", packed.as_slice())
        }
        ending => (ending, content),
    };
    let name = format!("m.{ending}");
    let word = match Source::named(&name, content).import(Facets::Auto, &limits()) {
        Ok(import) => {
            ask_all(&import.solid, thorough)?;
            format!("loaded {} with {} notes", import.solid.primitives.len().min(4), import.notes.len().min(4))
        }
        Err(e) => sentence(&name, &e.to_string())?,
    };
    Ok(format!("{kind}: {word}"))
}

/// The kind of a sentence that has to begin with a file's name and a place.
fn sentence(name: &str, text: &str) -> Result<String, String> {
    if !text.starts_with(&format!("{name}:")) || text.lines().count() != 1 {
        return Err(format!("not one sentence with its place: {text:?}"));
    }
    Ok(super::csg::family(text.trim_start_matches(name)))
}

fn drawing_seeds() -> Vec<Vec<u8>> {
    let svg = "<svg width='100mm' height='50mm' viewBox='0 0 200 100'><g transform='rotate(20 3 4) skewX(5)'><path id='a' \
               d='M1 2l10 0c1 2 3 4 5 6s1 2 3 4q5 5 6 1t2 3a5 3 20 10 2 2H4v-3zm3 3 1 1'/><rect x='1' y='2' width='9' height='8' \
               rx='2'/><ellipse cx='4' cy='5' rx='3' ry='2'/></g><polyline points='1,2 3,4 5,0' stroke-width='2' \
               stroke-linecap='round'/><polygon points='0 0 9 0 9 9'/><line x1='1' y1='1' x2='5' y2='9'/></svg>";
    let dxf = "0\nSECTION\n2\nENTITIES\n0\nLWPOLYLINE\n8\n0\n70\n1\n10\n0\n20\n0\n10\n4\n20\n0\n10\n4\n20\n2\n0\nCIRCLE\n10\n1\n20\n1\n\
               40\n0.5\n0\nENDSEC\n0\nEOF\n";
    let picture = [
        0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0, 0, 0, 13, 0x49, 0x48, 0x44, 0x52, 0, 0, 0, 2, 0, 0, 0, 2, 8,
        0, 0, 0, 0, 0x57, 0xdd, 0x52, 0xf8, 0, 0, 0, 14, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x10, 0x61, 0x60,
        0xd0, 0x65, 0, 0, 0x01, 0x22, 0, 0x6b, 0, 0, 0, 0, 0, 0, 0, 0, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82,
    ];
    let of = |kind: u8, content: &[u8]| [&[kind], content].concat();
    vec![of(0, svg.as_bytes()), of(1, dxf.as_bytes()), of(2, b"# a\n1 2 3\n4 5\n\n-1 0 1\n"), of(3, &picture)]
}

fn drawings(bytes: &[u8], thorough: bool) -> Result<String, String> {
    let Some((kind, content)) = bytes.split_first() else { return Ok("empty".into()) };
    let kind = DRAWINGS_OF[usize::from(*kind) % DRAWINGS_OF.len()];
    let name = format!("d.{kind}");
    if ["svg", "dxf"].contains(&kind) {
        let (origin, pieces) = (DVec2::ZERO, |_| 8);
        let frame = Frame { layer: "", id: "", dpi: 72.0, center: false, origin, scale: 1.0, pieces: &pieces };
        if let Some(Ok(drawing)) = drawing::of_file(&name, content, &frame)
            && (drawing.off.is_nan() || drawing.shapes.iter().flatten().any(Vec::is_empty))
        {
            return Err(format!("{} off, {:?}", drawing.off, drawing.shapes));
        }
    }
    let text = match kind {
        "svg" | "dxf" => format!("linear_extrude(height = 1) {{ import(file = \"{name}\"); }}"),
        _ => format!("surface(file = \"{name}\");"),
    };
    let attached = [Attachment { name, bytes: Ok(content.to_vec()) }];
    let source = Source { attached: Some(&attached), ..Source::named("m.csg", text.as_bytes()) };
    let word = match source.import(Facets::Auto, &limits()) {
        Ok(import) => {
            ask_all(&import.solid, thorough)?;
            format!("loaded {} with {} notes", import.solid.primitives.len().min(4), import.notes.len().min(4))
        }
        Err(e) => sentence("m.csg", &e.to_string())?,
    };
    Ok(format!("{kind}: {word}"))
}
