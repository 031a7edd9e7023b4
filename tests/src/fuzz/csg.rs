//! The parser of `.csg` models: any text is a solid that can be asked, or one sentence with its place.

use super::Target;
use contactd::contact::probe::{PointOptions, PosedModel, Ray, RayOptions, RayOutcome, points, rays};
use contactd::import::{Facets, Limits, import_csg};
use contactd::octree::Model;
use contactd::octree::mass::mass_properties;
use contactd::solid::{Node, Solid};
use contactd_proto::{MassOptions, Pose};
use glam::DVec3;

pub(super) const TARGET: Target = Target { name: "csg", run, seeds, words: &WORDS, longest: 2000, thorough_every: 64 };

const WORDS: [&str; 56] = [
    "union() {",
    "difference() {",
    "intersection() {",
    "group();",
    "}",
    "{",
    "(",
    ")",
    "[",
    "]",
    ",",
    ";",
    "=",
    "-",
    "!",
    "%",
    "*",
    "#",
    "sphere(r = 1);",
    "cube(size = [1, 2, 3], center = true);",
    "cylinder(h = 3, r1 = 1, r2 = 0.5, center = false);",
    "multmatrix([[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) {",
    "linear_extrude(height = 3, center = true) {",
    "circle(r = 1);",
    "square(size = [1, 1], center = false);",
    "polygon(points = [[0, 0], [2, 0], [0, 2]], paths = undef);",
    "color([1, 0, 0, 1]) {",
    "linear_extrude(height = 3, twist = 90, scale = [1, 2], slices = 4) {",
    "text(text = \"aB\", size = 3);",
    "projection(cut = true) {",
    "projection() {",
    "resize([1, 0, 2], auto = true) {",
    "hull() {",
    "minkowski() {",
    "rotate_extrude(angle = 90) {",
    "render() {",
    "$fn = 5",
    "$fa = 12",
    "0",
    "1",
    "-1",
    "0.5",
    "1e-9",
    "1e308",
    "1e-320",
    "inf",
    "nan",
    "undef",
    "true",
    "false",
    "\"",
    "//",
    "/*",
    "*/",
    "\n",
    "\u{e9}",
];

fn seeds() -> Vec<Vec<u8>> {
    [
        "difference() { cube(size = [1, 2, 3], center = true); multmatrix([[0, -1, 0, 1e-5], [1, 0, 0, 2], [0, 0, 1, 3], \
         [0, 0, 0, 1]]) { cylinder($fn = 6, $fa = 12, $fs = 2, h = 3, r1 = 1, r2 = 0.5, center = false); } }",
        "intersection() { sphere(r = 2, $fn = 5); cube(size = [inf, inf, 1], center = true); %group(); #sphere(1); }",
        "linear_extrude(height = 3, center = true, scale = [1, 1]) { difference() { polygon(points = [[0, 0], [2, 0], \
         [0, 2]], paths = [[0, 1, 2]]); circle(r = 0.2, $fn = 4); } }",
        "color([1, 0, 0, 1]) { polyhedron(points = [[1,0,0],[-1,0,0],[0,1,0],[0,-1,0],[0,0,1],[0,0,-1]], faces = \
         [[0,4,2],[0,2,5],[0,3,4],[0,5,3],[1,2,4],[1,5,2],[1,4,3],[1,3,5]], convexity = 1); } // end",
        "hull() { difference() { cube(2); sphere(1); } linear_extrude(height = 1, twist = 40) { square(1); } }",
        // What is taken from itself.
        "difference() { cube(1); cube(1); } union() { difference() { sphere(2); sphere(2); cube(1); } sphere(1); }",
        "difference() { cylinder(h = 3, r1 = 1, r2 = 0.5, center = true); cylinder(h = 3, r1 = 1, r2 = 0.5, center = true); }",
        "minkowski() { difference() { cube(2); cube(1); } cube(0.1); } resize([1, 2, 0]) { sphere(1, $fn = 5); }",
        "linear_extrude(height = 1) { projection() { difference() { cube(1); sphere(0.4); } } text(text = \"a\"); }",
    ]
    .map(|text| text.as_bytes().to_vec())
    .into()
}

fn run(bytes: &[u8], thorough: bool) -> Result<String, String> {
    let text = String::from_utf8_lossy(bytes);
    let limits = Limits { polyhedron_faces: 100, nodes: 500, faces: 2000, ..Limits::default() };
    let mut word = String::new();
    for facets in [Facets::Auto, Facets::Exact, Facets::AsWritten] {
        word += &match import_csg("m.csg", &text, facets, &limits) {
            Ok(import) => {
                ask_all(&import.solid, thorough)?;
                let kinds: Vec<_> = import.notes.iter().map(|n| family(&n.text)).collect();
                format!("loaded {} {kinds:?} ", import.solid.primitives.len().min(4))
            }
            Err(e) => {
                let sentence = e.to_string();
                if !sentence.starts_with("m.csg:") || sentence.lines().count() != 1 {
                    return Err(format!("not one sentence with its place: {sentence:?}"));
                }
                format!("{} ", family(sentence.trim_start_matches("m.csg")))
            }
        };
    }
    Ok(word)
}

/// What a solid that was loaded must be able to answer.
pub(super) fn ask_all(solid: &Solid, thorough: bool) -> Result<(), String> {
    for x in [DVec3::ZERO, DVec3::new(0.1, 0.2, 0.3), DVec3::new(-1e3, 7.0, 1e-9)] {
        if solid.value(x).is_nan() {
            return Err(format!("f is NaN at {x}"));
        }
    }
    let leaves = solid.nodes.iter().filter(|n| matches!(n, Node::Primitive(_))).count();
    if leaves != solid.primitives.len() {
        return Err(format!("{} primitives at {leaves} leaves", solid.primitives.len()));
    }
    let aabb = solid.aabb();
    if aabb.min.is_nan() || aabb.max.is_nan() {
        return Err(format!("a box of {aabb:?}"));
    }
    if thorough {
        let model = Model::new(solid.clone());
        if model.radius.is_nan() || model.margin().is_nan() {
            return Err(format!("radius {}, margin {}", model.radius, model.margin()));
        }
        // What `inspect` and the probes ask.
        if let Ok(m) = mass_properties(&model, &MassOptions { tolerance: 0.1, boxes: 200 })
            && !(m.volume >= -m.volume_error && m.volume_error >= 0.0)
        {
            return Err(format!("a volume of {} ± {}", m.volume, m.volume_error));
        }
        let posed = PosedModel { model: &model, pose: Pose::IDENTITY };
        let options = PointOptions { surface: 1e-9, tolerance: 1e-3, limit: 200 };
        let told = &points(&posed, &[DVec3::new(0.1, 0.2, 0.3)], &options)[0];
        if told.lower > told.upper || told.lower.is_nan() || told.upper.is_nan() {
            return Err(format!("a distance from {} to {}", told.lower, told.upper));
        }
        let ray = Ray { origin: DVec3::new(0.1, 0.2, -9.0), direction: DVec3::Z, length: 20.0 };
        if let RayOutcome::Hit(hit) = rays(&posed, &[ray], &RayOptions { depth: 0.0, limit: 200 })[0].outcome
            && !(hit.lower <= hit.t && hit.t <= hit.upper)
        {
            return Err(format!("a hit at {} between {} and {}", hit.t, hit.lower, hit.upper));
        }
    }
    Ok(())
}

/// A sentence without its numbers and quotations: its kind.
pub(super) fn family(sentence: &str) -> String {
    let head = sentence.split(", found").next().unwrap_or(sentence);
    let head: String = head.chars().filter(|c| c.is_ascii_alphabetic() || *c == ' ').collect();
    head.split_whitespace().take(12).collect::<Vec<_>>().join(" ")
}
