//! `import` of meshes and drawings: files beside the text, which whoever read it has read too.

use super::arguments::{Arguments, finite};
use super::flat::{Flat, Outline};
use super::parts::{Part, PartId};
use super::shapes::Shapes;
use super::slices::Curve;
use super::syntax::{Call, Value, ValueKind};
use super::{Place, Problem};
use crate::import::{Attachment, drawing, mesh, surface};
use crate::solid::Op;
use glam::{DAffine3, DVec2};
use std::sync::LazyLock;

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// What OpenSCAD writes beside the file; of a mesh `center` alone changes anything.
const PARAMETERS: [&str; 9] = ["file", "layer", "convexity", "origin", "scale", "center", "dpi", "id", "timestamp"];

/// The formats that are read of other files, for sentences.
static READ: LazyLock<String> = LazyLock::new(|| {
    let endings: Vec<&str> = mesh::FORMATS.iter().flat_map(|f| f.endings).chain(&["dxf"]).copied().collect();
    format!(" (of other files {} and svg are read)", endings.join(", "))
});

/// The same of extrusions that name a drawing, with what they have of their own.
const OF_EXTRUSIONS: [&str; 13] = [
    "file",
    "layer",
    "origin",
    "scale",
    "timestamp",
    "height",
    "center",
    "twist",
    "slices",
    "segments",
    "v",
    "angle",
    "start",
];

/// The file that a call names, where it does: `import`, `surface`, or an extrusion without anything inside.
pub fn file_of(call: &Call) -> Option<String> {
    let value = call.arguments.iter().find(|a| a.name.as_deref() == Some("file"))?;
    match &value.value.kind {
        ValueKind::Text(name)
            if ["import", "surface"].contains(&call.name.as_str()) || call.children.is_empty() && !name.is_empty() =>
        {
            Some(name.clone())
        }
        _ => None,
    }
}

/// The angle that stands where a `rotate_extrude` of OpenSCAD 2021.01 has a file's name; later versions have it there.
fn angle_as_name(call: &Call) -> Option<String> {
    file_of(call).filter(|name| call.name == "rotate_extrude" && name.parse::<f64>().is_ok_and(f64::is_finite))
}

/// True for a call with an empty name, where files can be named at all.
fn names_none(call: &Call, attached: Option<&[Attachment]>) -> bool {
    let is_empty = |v: &ValueKind| matches!(v, ValueKind::Text(name) if name.is_empty());
    attached.is_some() && call.arguments.iter().any(|a| a.name.as_deref() == Some("file") && is_empty(&a.value.kind))
}

/// The bytes of a file that a call names, and its name.
fn bytes_of<'b>(call: &Call, attached: Option<&'b [Attachment]>) -> Result<(String, &'b [u8])> {
    let found = |attached: &'b [Attachment]| {
        let name = file_of(call)?;
        attached.iter().find(|a| a.name == name).and_then(|a| a.bytes.as_deref().ok())
    };
    if let Some(angle) = angle_as_name(call).filter(|_| attached.and_then(found).is_none()) {
        let taken = format!("{angle:?} as the name of a file (which OpenSCAD 2021.01 takes a first argument for)");
        return Err((call.at, Problem::syntax(format!("rotate_extrude(angle = {angle})"), taken)));
    }
    let Some(attached) = attached else {
        let hint = " (a text that is sent names no files: send the mesh itself, by its format)";
        return Err((call.at, Problem::Unsupported { construct: call.short(), hint }));
    };
    let Some(name) = file_of(call) else {
        return Err((call.at, Problem::syntax(format!("a file's name as file of {}", call.name), "none")));
    };
    match attached.iter().find(|a| a.name == name).map(|a| &a.bytes) {
        Some(Ok(bytes)) => Ok((name, bytes)),
        Some(Err(why)) => Err((call.at, Problem::syntax("a readable file", why.clone()))),
        None => Err((call.at, Problem::syntax("a file that was read", format!("{name:?}")))),
    }
}

/// The solid that a call imports.
///
/// # Errors
/// What is wrong with the call or with the file, and where.
pub fn import(
    shapes: &mut Shapes<'_>,
    call: &Call,
    (outer, hull): (&DAffine3, bool),
    attached: Option<&[Attachment]>,
) -> Result<PartId> {
    if names_none(call, attached) {
        return Ok(shapes.nothing(call, "of no file"));
    }
    let refused = |construct: String, hint| (call.at, Problem::Unsupported { construct, hint });
    let (name, bytes) = bytes_of(call, attached)?;
    if Arguments::new(call, &PARAMETERS)?.bool_or("center", false)? {
        return Err(refused(format!("import of {name:?} with center = true"), " (move it instead)"));
    }
    let Some(read) = mesh::of_file(&name, bytes, shapes.limits) else {
        return Err(refused(format!("import of {name:?}"), READ.as_str()));
    };
    let bodies = read.map_err(|e| named(call, &name, e))?;
    for what in &bodies.left_out {
        shapes.parts.note(call.at, format!("{what} of {name:?}: left out"), None);
    }
    let mut made = Vec::with_capacity(bodies.all.len());
    for body in bodies.all {
        made.push(of_polygons(shapes, call, (outer, hull), body)?);
    }
    Ok(match made.as_slice() {
        [one] => *one,
        _ => shapes.parts.op(Op::Union, call.at, made),
    })
}

/// Something in a file that a call names.
fn named(call: &Call, name: &str, (at, problem): (Place, Problem)) -> (Place, Problem) {
    (call.at, Problem::Named { file: name.to_owned(), at, problem: problem.into() })
}

fn of_polygons(
    shapes: &mut Shapes<'_>,
    call: &Call,
    (outer, hull): (&DAffine3, bool),
    polygons: mesh::Polygons,
) -> Result<PartId> {
    if !hull && polygons.count() > shapes.limits.polyhedron_faces {
        return shapes.of_polygons(call, outer, polygons);
    }
    let clockwise: Vec<Vec<u32>> = polygons.faces().map(|f| f.iter().rev().copied().collect()).collect();
    shapes.of_faces(call, outer, hull, (polygons.points, clockwise))
}

/// The solid under the heights that a `surface` names.
///
/// # Errors
/// What is wrong with the call or with the file, and where.
pub fn surface(
    shapes: &mut Shapes<'_>,
    call: &Call,
    (outer, hull): (&DAffine3, bool),
    attached: Option<&[Attachment]>,
) -> Result<PartId> {
    if names_none(call, attached) {
        return Ok(shapes.nothing(call, "of no file"));
    }
    let (name, bytes) = bytes_of(call, attached)?;
    let arguments = Arguments::new(call, &["file", "center", "convexity", "invert", "timestamp"])?;
    let how = (arguments.bool_or("center", false)?, arguments.bool_or("invert", false)?);
    let polygons = surface::read(bytes, how, shapes.limits).map_err(|e| named(call, &name, e))?;
    if polygons.is_empty() {
        return Ok(shapes.nothing(call, &format!("of {name:?}, which has no two rows of two heights")));
    }
    of_polygons(shapes, call, (outer, hull), polygons)
}

/// The solid under a grid of heights, which OpenSCAD does not have: `height_field(heights = [[z, ...], ...], size = [x,
/// y], base = z)`.
///
/// # Errors
/// What is wrong with the call, and where.
pub fn height_field(shapes: &mut Shapes<'_>, call: &Call, (outer, hull): (&DAffine3, bool)) -> Result<PartId> {
    let arguments = Arguments::new(call, &["heights", "size", "base"])?;
    let listed = arguments.required("heights", "rows of heights")?;
    let wrong = |v: &Value, what: &str| Err((v.at, Problem::syntax(what, v.found())));
    let ValueKind::List(rows) = &listed.kind else { return wrong(listed, "rows of heights") };
    if rows.len() < 2 {
        return wrong(listed, "two rows of heights or more");
    }
    let (mut heights, mut columns) = (Vec::new(), 0);
    for row in rows {
        let ValueKind::List(of_row) = &row.kind else { return wrong(row, "a row of heights") };
        if columns == 0 && of_row.len() >= 2 {
            columns = of_row.len();
            heights.reserve(columns.saturating_mul(rows.len()).min(shapes.limits.values));
        }
        if of_row.len() != columns {
            let expected = if columns == 0 { "a row of two heights or more" } else { "rows of one length" };
            return Err((row.at, Problem::syntax(expected, format!("one of {}", of_row.len()))));
        }
        for z in of_row {
            heights.push(finite(z)?);
        }
    }
    let squares = DVec2::new((columns - 1) as f64, (rows.len() - 1) as f64);
    let Some(size) = (if arguments.get("size").is_some() { arguments.sizes_2d("size")? } else { Some(squares) }) else {
        return Ok(shapes.nothing(call, "of no size"));
    };
    if !size.is_finite() {
        return Err((call.at, Problem::syntax("a finite size of height_field", format!("{size}"))));
    }
    let lowest = heights.iter().copied().fold(f64::INFINITY, f64::min);
    let base = arguments.number_or("base", lowest - 1.0)?;
    if !(base < lowest && base.is_finite()) {
        let expected = format!("a base below the lowest height, {lowest}");
        return Err((call.at, Problem::syntax(expected, format!("base = {base}"))));
    }
    of_polygons(shapes, call, (outer, hull), surface::grid(&heights, columns, size, base))
}

/// What an `import` is, before it is read: a drawing, or a solid.
pub fn is_flat(call: &Call) -> bool {
    file_of(call).is_some_and(|name| drawing::is_drawing(&name))
}

/// The flat shape that a call imports, of `import` itself or of an extrusion that names a drawing.
///
/// # Errors
/// What is wrong with the call or with the file, and where.
pub fn flat(
    shapes: &mut Shapes<'_>,
    call: &Call,
    (inner, overshoot): (DAffine3, u32),
    attached: Option<&[Attachment]>,
) -> Result<PartId> {
    let at = call.at;
    if names_none(call, attached) {
        return Ok(shapes.nothing(call, "of no file"));
    }
    let (name, bytes) = bytes_of(call, attached)?;
    let arguments = Arguments::new(call, if call.name == "import" { &PARAMETERS } else { &OF_EXTRUSIONS })?;
    let word = |name: &str| match arguments.get(name).map(|v| (&v.kind, v)) {
        None => Ok(String::new()),
        Some((ValueKind::Text(word), _)) => Ok(word.clone()),
        Some((_, v)) => Err((v.at, Problem::syntax(format!("a string as {name} of import"), v.found()))),
    };
    let of_import = call.name == "import";
    let (layer, id) = (word("layer")?, if of_import { word("id")? } else { String::new() });
    let origin = arguments.pair_or("origin", DVec2::ZERO)?;
    // An extrusion's own scale scales its drawing, too, as it does in OpenSCAD.
    let scale = arguments.pair_or("scale", DVec2::ONE)?.x;
    let center = of_import && arguments.bool_or("center", false)?;
    // OpenSCAD's own where none is given, or one that makes no sense.
    let dpi = if of_import { arguments.number_or("dpi", 72.0)? } else { 72.0 };
    let dpi = if (0.001..1e9).contains(&dpi) { dpi } else { 72.0 };
    Curve::of(&arguments)?;
    let pieces = |radius: f64| shapes.pieces(&arguments, radius).unwrap_or(3);
    let frame = drawing::Frame { layer: &layer, id: &id, dpi, center, origin, scale, pieces: &pieces };
    let Some(read) = drawing::of_file(&name, bytes, &frame) else {
        return Err((
            at,
            Problem::Unsupported { construct: format!("{} of {name:?}", call.name), hint: READ.as_str() },
        ));
    };
    let drawing = read.map_err(|e| named(call, &name, e))?;
    for (what, count) in &drawing.left_out {
        shapes.parts.note(at, format!("{count} {what} of {name:?}: left out, as OpenSCAD does"), None);
    }
    if let Some((first, count)) = &drawing.zeros {
        let text = format!(
            "{count} lengths of {name:?} that are no plain numbers count as 0, as for OpenSCAD: first {first} (write them without \
             units; width and height of the page may have some)"
        );
        shapes.parts.note(at, text, None);
    }
    let mut drawn: Vec<Vec<Vec<DVec2>>> = drawing.shapes;
    drawn.retain(|paths| !paths.is_empty());
    if drawn.is_empty() {
        return Ok(shapes.nothing(call, &format!("of {name:?}, without a closed path")));
    }
    let corners = drawn.iter().flatten().map(Vec::len).sum();
    shapes.parts.meshable(at, corners)?;
    if drawing.off > 0.0 {
        shapes.parts.faceted(at, &format!("curves of {name:?}"), corners, drawing.off);
    }
    let mut made = Vec::with_capacity(drawn.len());
    for paths in drawn {
        let flat = Flat { outline: Outline::Paths(paths), inner, overshoot, name: call.name.clone(), at, pieces: 0 };
        made.push(shapes.parts.push(Part::Flat(Box::new(flat))));
    }
    Ok(match made.as_slice() {
        [one] => *one,
        _ => shapes.parts.op(Op::Union, at, made),
    })
}

#[cfg(test)]
mod tests {
    use crate::import::{Access, Facets, Limits, ModelBytes, import_csg, read_model};
    use glam::DVec3;
    use std::fs;

    const TETRAHEDRON: &str = "OFF 4 4 0\n0 0 0\n4 0 0\n0 4 0\n0 0 4\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";

    #[test]
    fn a_mesh_beside_the_text_is_an_operand_and_no_other_file_is_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("text/parts")).expect("folders");
        for name in ["text/parts/t.off", "t.off", "text/t.dat", "beyond.off"] {
            fs::write(at(name), TETRAHEDRON).expect("written");
        }
        fs::write(at("text/broken.off"), TETRAHEDRON.replace("3 0 3 2", "3 0 3 9")).expect("written");
        std::os::unix::fs::symlink(at("t.off"), at("text/link.off")).expect("a link");
        let read = |text: &str| {
            fs::write(at("text/m.csg"), text).expect("written");
            read_model(&at("text/m.csg"), Facets::Auto, &Limits::default()).map_err(|e| e.to_string())
        };
        let of = |name: &str| {
            format!("import(file = \"{name}\", layer = \"\", origin = [0, 0], scale = 1, convexity = 1, $fn = 0);")
        };
        let drilled = "difference() { NAME cylinder(h = 9, r1 = 0.5, r2 = 0.5, center = true); }";
        let import = read(&drilled.replace("NAME", &of("parts/t.off"))).expect("a drilled tetrahedron");
        assert_eq!(import.solid.primitives.len(), 2);
        let value = |x: f64, y: f64, z: f64| import.solid.value(DVec3::new(x, y, z));
        assert!(value(1.0, 1.0, 1.0) < -0.1 && value(0.1, 0.1, 1.0) > 0.0 && value(2.0, 2.0, 1.0) > 0.0);
        let outside = "which is not in the folder of the text that names it";
        for (name, sentence) in [
            ("../t.off", outside),
            ("link.off", outside),
            (at("t.off").to_str().expect("a name"), outside),
            ("none.stl", "expected a readable file, found \"none.stl\": No such file"),
            ("parts", "which is no plain file"),
            ("t.dat", "found import of \"t.dat\", which is not supported (of other files stl, off, "),
            ("broken.off", "m.csg:1:1: broken.off:9:7: expected a point's number below 4, found \"9\""),
        ] {
            let error = read(&of(name)).expect_err(name);
            assert!(error.contains(sentence), "{error}\nnot {sentence}");
        }
        // From a root that is given, and from no other place.
        let root = Access { root: Some(folder.path().join("text/parts")), ..Access::default() };
        let wide = Access { root: Some(folder.path().to_path_buf()), ..Access::default() };
        let of_root = |name: &str, access: &Access| {
            fs::write(at("text/m.csg"), of(name)).expect("written");
            let read = ModelBytes::read(&at("text/m.csg"), access, &Limits::default()).expect("a text");
            read.source().import(Facets::Auto, &Limits::default()).map_err(|e| e.to_string())
        };
        assert!(of_root("../t.off", &wide).is_ok() && of_root("link.off", &wide).is_ok());
        assert!(of_root("parts/t.off", &root).is_ok());
        let error = of_root("../t.off", &root).expect_err("outside");
        assert!(error.contains("m.csg:1:1: expected a readable file, found \"../t.off\", which is not in the import"));
        let none = Access { root: Some(at("none")), ..Access::default() };
        assert!(of_root("parts/t.off", &none).expect_err("no root").contains("whose import root "));
        let sent =
            import_csg("m.csg", &of("parts/t.off"), Facets::Auto, &Limits::default()).expect_err("sent").to_string();
        assert!(sent.starts_with("m.csg:1:1: expected a supported construct, found import"), "{sent}");
        assert!(sent.ends_with("(a text that is sent names no files: send the mesh itself, by its format)"), "{sent}");
    }

    #[test]
    fn a_drawing_beside_the_text_is_a_flat_shape_and_a_missing_one_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let dxf = "0\nSECTION\n2\nENTITIES\n0\nLWPOLYLINE\n8\nrim\n70\n1\n10\n0\n20\n0\n10\n4\n20\n0\n10\n4\n20\n2\n10\n0\n20\n2\n\
                   0\nCIRCLE\n8\nbore\n10\n1\n20\n1\n40\n0.5\n0\nENDSEC\n0\nEOF\n";
        fs::write(folder.path().join("plate.dxf"), dxf).expect("written");
        let read = |text: &str| {
            let path = folder.path().join("m.csg");
            fs::write(&path, text).expect("written");
            read_model(&path, Facets::Auto, &Limits::default()).map_err(|e| e.to_string())
        };
        let of = "file = \"plate.dxf\", layer = \"LAYER\", origin = [0, 0], scale = 1, convexity = 1, $fn = 64";
        let inside = |text: &str, x: f64, y: f64, z: f64| {
            read(text).unwrap_or_else(|e| panic!("{text}: {e}")).solid.value(DVec3::new(x, y, z)) < 0.0
        };
        for plate in [
            format!("linear_extrude(height = 2) {{ import({}); }}", of.replace("LAYER", "")),
            "linear_extrude(file = \"plate.dxf\", layer = \"\", origin = [0, 0], timestamp = 1, height = 2, center = false, \
             convexity = 1, scale = [1, 1], $fn = 64, $fa = 12, $fs = 2);"
                .to_owned(),
        ] {
            assert!(inside(&plate, 3.9, 1.9, 1.9) && inside(&plate, 1.0, 0.4, 1.0));
            assert!(!inside(&plate, 1.0, 1.0, 1.0) && !inside(&plate, 1.0, 0.6, 1.0) && !inside(&plate, 4.1, 1.0, 1.0));
        }
        let rim = format!("linear_extrude(height = 2) {{ import({}); }}", of.replace("LAYER", "rim"));
        assert!(inside(&rim, 1.0, 1.0, 1.0));
        let turned = "rotate_extrude(file = \"plate.dxf\", layer = \"rim\", origin = [0, 0], scale = 2, angle = 360);";
        assert!(inside(turned, 5.0, 5.0, 3.0) && !inside(turned, 1.0, 1.0, 5.0));
        let none =
            read("cube(1); import(file = \"\"); linear_extrude(height = 1) { import(file = \"\"); }").expect("a cube");
        assert!(none.notes.iter().filter(|n| n.text.starts_with("import of no file: left out")).count() == 2);
        let stray = format!("cube(1); import({});", of.replace("LAYER", ""));
        assert_eq!(read(&stray).expect("a cube").solid.primitives.len(), 1);
        for (text, sentence) in [
            (
                "\nlinear_extrude(file = \"x.dxf\", height = 3);",
                "m.csg:2:1: expected a readable file, found \"x.dxf\": No such",
            ),
            ("linear_extrude(height = 3) { import(\"x.dxf\"); }", "m.csg:1:30: expected"),
            (
                "rotate_extrude(file = \"360\", angle = 360);",
                "m.csg:1:1: expected rotate_extrude(angle = 360), found \"360\" as the name of a file (",
            ),
            ("linear_extrude(height = 1) { import(file = \"m.csg\"); }", "which is not supported (of other files"),
        ] {
            let error = read(text).expect_err(text);
            assert!(error.contains(sentence), "{error}\nnot {sentence}");
        }
    }
}
