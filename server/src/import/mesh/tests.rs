//! Files of meshes: the same solid from every format, and sentences for what is wrong.

use crate::import::{Facets, Limits, Source};
use crate::solid::primitive::Shape;
use glam::DVec3;

/// An L, 2 by 2 by 1, its inner edge at (1, 1): points, and polygons counter-clockwise from outside.
fn corner() -> (Vec<[i32; 3]>, Vec<Vec<usize>>) {
    let outline = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]];
    let points = (0..2).flat_map(|z| outline.iter().map(move |[x, y]| [*x, *y, z])).collect();
    let mut faces: Vec<Vec<usize>> = vec![vec![5, 4, 3, 2, 1, 0], vec![6, 7, 8, 9, 10, 11]];
    faces.extend((0..6).map(|i| vec![i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6]));
    (points, faces)
}

/// The L's triangles: its lids as two rectangles each, meeting in whole edges.
fn triangles() -> Vec<[[i32; 3]; 3]> {
    let lid = [[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5]];
    let (points, faces) = corner();
    let mut out: Vec<[usize; 3]> = lid.iter().flat_map(|[a, b, c]| [[*c, *b, *a], [a + 6, b + 6, c + 6]]).collect();
    out.extend(faces[2..].iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]));
    out.into_iter().map(|t| t.map(|i| points[i])).collect()
}

fn ascii_stl() -> String {
    let vertex = |[x, y, z]: &[i32; 3]| format!("      vertex {x} {y}.0 {z}e0\n");
    let facet = |t: &[[i32; 3]; 3]| {
        let corners: String = t.iter().map(vertex).collect();
        format!("  facet normal 0 0 0\n    outer loop\n{corners}    endloop\n  endfacet\n")
    };
    format!("solid an L\n{}endsolid\n", triangles().iter().map(facet).collect::<String>())
}

fn binary_stl() -> Vec<u8> {
    // A remark that begins like a text.
    let mut out = b"solid".to_vec();
    out.resize(80, b' ');
    out.extend((triangles().len() as u32).to_le_bytes());
    for t in triangles() {
        out.extend([0; 12]);
        t.iter().flatten().for_each(|v| out.extend((*v as f32).to_le_bytes()));
        out.extend([7, 7]);
    }
    out
}

fn off() -> String {
    let (points, faces) = corner();
    let points: String = points.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
    let face = |f: &Vec<usize>| {
        format!("{} {} 255 0 0\n", f.len(), f.iter().map(usize::to_string).collect::<Vec<_>>().join(" "))
    };
    format!("OFF # an L\n\n12 8 0\n{points}{}", faces.iter().map(face).collect::<String>())
}

fn obj() -> String {
    let (points, faces) = corner();
    let points: String = points.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    let face = |(i, f): (usize, &Vec<usize>)| {
        let each = f.iter().map(|c| if i % 2 == 0 { format!(" {}//3", c + 1) } else { format!(" {}", *c as i64 - 12) });
        format!("f{}\n", each.collect::<String>())
    };
    format!("# an L\no part\n{points}vn 0 0 1\ns off\n{}", faces.iter().enumerate().map(face).collect::<String>())
}

fn read(name: &str, bytes: &[u8]) -> Result<crate::import::Import, String> {
    Source::named(name, bytes).import(Facets::Auto, &Limits::default()).map_err(|e| e.to_string())
}

#[test]
fn every_format_tells_the_same_solid() {
    let files = [
        ("l.stl", ascii_stl().into_bytes()),
        ("l.stl", ascii_stl().to_uppercase().into_bytes()),
        ("l.STL", binary_stl()),
        ("l.off", off().into_bytes()),
        ("l.obj", obj().into_bytes()),
        ("l.obj", format!("\u{feff}{}p 1 2\n", obj().replacen("f ", "f \\\n ", 2)).into_bytes()),
    ];
    for (name, bytes) in files {
        let import = read(name, &bytes).unwrap_or_else(|e| panic!("{e}"));
        let shape = &import.solid.primitives[0].shape;
        assert!(matches!(shape, Shape::TriangleMesh(m) if m.bounding_faces() == 8), "{name}: {shape:?}");
        assert!(import.notes.len() == 1 && import.notes[0].text.contains("unit"), "{:?}", import.notes);
        for (x, y, inside) in
            [(0.5, 0.5, true), (1.9, 0.9, true), (0.1, 1.9, true), (1.01, 1.01, false), (1.9, 1.9, false)]
        {
            assert_eq!(import.solid.value(DVec3::new(x, y, 0.5)) < 0.0, inside, "{name}: {x} {y}");
        }
        let volume = shape.geometry().moments().expect("closed").volume();
        assert!((volume - 3.0).abs() < 1e-14, "{name}: {volume}");
    }
    let cube = "OFF 8 6 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n\
                4 3 2 1 0\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n";
    let solid = read("cube.off", cube.as_bytes()).expect("a cube").solid;
    assert!(
        matches!(solid.primitives[0].shape, Shape::Polyhedron(_)),
        "what is convex has the kernels of what is convex"
    );
}

#[test]
fn a_mesh_that_crosses_itself_is_what_it_winds_around() {
    // Cubes of side 2 and 3 that have a cube of side 1 in common, as one body; the second one either way round.
    let corners = |at: i32, side: i32| {
        let corner = |i: i32| [i & 1, i >> 1 & 1, i >> 2].map(|k| (at + side * k).to_string()).join(" ") + "\n";
        (0..8).map(corner).collect::<String>()
    };
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    for (reversed, volume) in [(false, 34.0), (true, 33.0)] {
        let second = sides.map(|s| {
            let s = s.map(|i| i + 8);
            if reversed { [s[3], s[2], s[1], s[0]] } else { s }
        });
        let face = |s: &[i32; 4]| format!("4 {} {} {} {}\n", s[0], s[1], s[2], s[3]);
        let faces: String = sides.iter().chain(&second).map(face).collect();
        let text = format!("OFF 16 12 0\n{}{}{faces}", corners(0, 2), corners(1, 3));
        let import = read("two.off", text.as_bytes()).expect("two cubes");
        let last = &import.notes.last().expect("a note").text;
        assert!(last.starts_with("a mesh that crosses itself ("), "{last}");
        let measured = import.solid.primitives[0].shape.geometry().moments().expect("closed").volume();
        assert!((measured - volume).abs() < 1e-12, "{measured}");
    }
}

#[test]
fn what_is_wrong_with_a_file_is_told_with_its_place() {
    let (stl, off, obj) = (ascii_stl(), off(), obj());
    let mut short = binary_stl();
    short.pop();
    let mut holed = binary_stl();
    holed[80] -= 1;
    holed.truncate(holed.len() - 50);
    let mut endless = binary_stl();
    endless[84 + 12..84 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
    let text = |s: String| s.into_bytes();
    for (name, bytes, sentence) in [
        ("a.stl", text(stl.replacen("vertex", "corner", 1)), "a.stl:4:7: expected a vertex, found \"corner\""),
        ("a.stl", text(stl.replace("endsolid\n", "")), "a.stl:141:11: expected endsolid, found the end of the line"),
        ("a.stl", text(stl.replacen("vertex 0", "vertex inf", 1)), "expected a finite number, found \"inf\""),
        ("a.stl", b"nothing".to_vec(), "a.stl:1:1: expected an STL file, found 7 bytes"),
        ("a.stl", endless, "a.stl:1:1: expected finite numbers, found [NaN, "),
        ("a.stl", holed, "a.stl:1:1: expected a closed mesh, found an open one: the edge from ["),
        ("a.off", text(off.replacen("OFF", "OOF", 1)), "a.off:1:1: expected OFF, found \"OOF\""),
        ("a.off", text(off.replacen("12 8 0", "12 9 0", 1)), "expected a face, found the end of the file"),
        ("a.off", text(off.replacen("12 8 0", "12 7 0", 1)), "expected the end of the file, found \"4\""),
        (
            "a.off",
            text(off.replacen("6 5 4", "6 5 12", 1)),
            "a.off:16:5: expected a point's number below 12, found \"12\"",
        ),
        ("a.obj", text(obj.replacen("v 0 0 0", "w 0 0 0", 1)), "a.obj:3:1: expected v, f, or what changes no shape"),
        (
            "a.obj",
            text(obj.replacen("v 0 0 0", "v 0 0", 1)),
            "a.obj:3:6: expected a finite number, found the end of the line",
        ),
        ("a.obj", text(obj.replacen("f 6//3", "f 13//3", 1)), "expected a point's number up to 12, found \"13//3\""),
        ("a.obj", text("v 0 0 0\nv 1 \\\n0 0\nw\n".into()), "a.obj:4:1: expected v, f, or what changes no shape"),
        ("a.obj", text("f 1 2\n".into()), "expected a point's number up to 0, found \"1\""),
        ("a.obj", Vec::new(), "a.obj:1:1: expected a closed mesh, found a mesh without volume"),
    ] {
        let error = read(name, &bytes).err().unwrap_or_else(|| panic!("{name}: was read, not {sentence}"));
        assert!(error.contains(sentence), "{error}\nnot {sentence}");
    }
    let error = read("a.stl", &short).expect_err("a byte is missing");
    assert!(error.starts_with("a.stl:1:1: expected "), "{error}");
    let few = Limits { mesh_facets: 10, ..Limits::default() };
    for (name, bytes) in [("a.stl", binary_stl()), ("a.stl", text(stl)), ("a.off", text(off)), ("a.obj", text(obj))] {
        let error = Source::named(name, &bytes).import(Facets::Auto, &few).expect_err("too many").to_string();
        assert!(error.ends_with("expected at most 10 triangles of a mesh, found more"), "{error}");
    }
}
