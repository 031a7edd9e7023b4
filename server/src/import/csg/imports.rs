//! `import` of meshes: files beside the text, which whoever read it has read too.

use super::arguments::Arguments;
use super::parts::PartId;
use super::shapes::Shapes;
use super::syntax::{Call, ValueKind};
use super::{Place, Problem};
use crate::import::{Attachment, mesh};
use glam::DAffine3;

/// What OpenSCAD writes beside the file; of a mesh `center` alone changes anything.
const PARAMETERS: [&str; 9] = ["file", "layer", "convexity", "origin", "scale", "center", "dpi", "id", "timestamp"];

/// The file that a call names, where it does.
pub fn file_of(call: &Call) -> Option<String> {
    let arguments = Arguments::new(call, &PARAMETERS).ok()?;
    match &arguments.get("file")?.kind {
        ValueKind::Text(name) => Some(name.clone()),
        _ => None,
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
) -> Result<PartId, (Place, Problem)> {
    let refused = |construct: String, hint| (call.at, Problem::Unsupported { construct, hint });
    let Some(attached) = attached else {
        return Err(refused(
            call.short(),
            " (a text that is sent names no files: send the mesh itself, by its format)",
        ));
    };
    let arguments = Arguments::new(call, &PARAMETERS)?;
    let centred = arguments.bool_or("center", false)?;
    let Some(name) = file_of(call) else {
        return Err((call.at, Problem::syntax("a file's name as file of import", "none")));
    };
    if centred {
        return Err(refused(format!("import of {name:?} with center = true"), " (move it instead)"));
    }
    let found = attached.iter().find(|a| a.name == name).map(|a| &a.bytes);
    let bytes = match found {
        Some(Ok(bytes)) => bytes,
        Some(Err(why)) => return Err((call.at, Problem::syntax("a readable file", why.clone()))),
        None => return Err((call.at, Problem::syntax("a file that was read", format!("{name:?}")))),
    };
    let Some(read) = mesh::of_file(&name, bytes, shapes.limits) else {
        return Err(refused(format!("import of {name:?}"), " (of other files stl, off and obj are read)"));
    };
    let polygons =
        read.map_err(|(at, problem)| (call.at, Problem::Named { file: name, at, problem: problem.into() }))?;
    let clockwise: Vec<Vec<u32>> = polygons.faces.iter().map(|f| f.iter().rev().copied().collect()).collect();
    shapes.of_faces(call, outer, hull, (polygons.points, clockwise))
}

#[cfg(test)]
mod tests {
    use crate::import::{Facets, Limits, import_csg, read_model};
    use glam::DVec3;
    use std::fs;

    const TETRAHEDRON: &str = "OFF 4 4 0\n0 0 0\n4 0 0\n0 4 0\n0 0 4\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";

    #[test]
    fn a_mesh_beside_the_text_is_an_operand_and_no_other_file_is_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("text/parts")).expect("folders");
        for name in ["text/parts/t.off", "t.off", "text/t.dxf"] {
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
            ("t.dxf", "found import of \"t.dxf\", which is not supported (of other files stl, off and obj are read)"),
            ("broken.off", "m.csg:1:1: broken.off:9:7: expected a point's number below 4, found \"9\""),
        ] {
            let error = read(&of(name)).expect_err(name);
            assert!(error.contains(sentence), "{error}\nnot {sentence}");
        }
        let sent =
            import_csg("m.csg", &of("parts/t.off"), Facets::Auto, &Limits::default()).expect_err("sent").to_string();
        assert!(sent.starts_with("m.csg:1:1: expected a supported construct, found import"), "{sent}");
        assert!(sent.ends_with("(a text that is sent names no files: send the mesh itself, by its format)"), "{sent}");
    }
}
