//! Constructs, refusals and properties of the importer, as tables.

use crate::import::{Facets, Import, Limits, import_csg};
use crate::solid::{Node, NodeId, Op, Sense, Shape, Solid};
use glam::DVec3;
use proptest::prelude::*;

fn import_as(text: &str, facets: Facets) -> Result<Import, String> {
    import_csg("m.csg", text, facets, &Limits::default()).map_err(|e| e.to_string())
}

fn import(text: &str) -> Import {
    import_as(text, Facets::Auto).unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn refused(text: &str) -> String {
    import_as(text, Facets::Auto).err().unwrap_or_else(|| panic!("{text}: was read"))
}

/// A solid in short: `(A & B)`, `(A | B)`, `(A - B)`, `0` for nothing, `name#index` for primitives.
fn short(solid: &Solid, node: NodeId) -> String {
    match &solid.nodes[node as usize] {
        Node::Empty => "0".into(),
        Node::Primitive(p) => format!("{}#{p}", solid.primitives[*p as usize].label.name),
        Node::Op(op, children) => {
            let sign = match op {
                Op::Union => " | ",
                Op::Intersection => " & ",
                Op::Difference => " - ",
            };
            let parts: Vec<String> = children.iter().map(|c| short(solid, *c)).collect();
            format!("({})", parts.join(sign))
        }
    }
}

fn tree(text: &str) -> String {
    let solid = import(text).solid;
    short(&solid, solid.root)
}

#[test]
fn trees_keep_their_shape() {
    let s = "sphere(r = 1);";
    let c = "cube(size = [1, 1, 1], center = false);";
    for (text, expected) in [
        (format!("{s}{c}"), "(sphere#0 | cube#1)"),
        (format!("group() {{ {s} }}"), "sphere#0"),
        (format!("difference() {{ {s} union() {{ {c} {c} }} }}"), "(sphere#0 - (cube#1 | cube#2))"),
        (format!("intersection() {{ {s} {c} }}"), "(sphere#0 & cube#1)"),
        (format!("color([1, 0, 0, 1]) {{ render(convexity = 2) {{ {s} {c} }} }}"), "(sphere#0 | cube#1)"),
        (format!("// one\n/* two */ union() {{ ; {s} }} ;"), "sphere#0"),
        (format!("difference() {{ group(); {c} }} {s}"), "sphere#0"),
        (format!("intersection() {{ group(); {c} }}"), "0"),
        (format!("difference() {{ {s} group(); }}"), "sphere#0"),
        ("difference(); group(); linear_extrude(height = 100);".into(), "0"),
        (format!("%{s} *{c} #{c}"), "cube#0"),
        (format!("difference() {{ %{s} {c} {s} }}"), "(cube#0 - sphere#1)"),
        (format!("{s} multmatrix([[1,0,0,5],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) {{ !{c} {s} }}"), "cube#0"),
        (format!("%#{s} {c} * projection() {{ {s} }}"), "cube#0"),
        (String::new(), "0"),
    ] {
        assert_eq!(tree(&text), expected, "{text}");
    }
    let root = import("multmatrix([[1,0,0,5],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) { !sphere(r = 1); }");
    assert_eq!(root.solid.primitives[0].frame.position, DVec3::ZERO, "a root leaves its surroundings");
}

#[test]
fn primitives_are_what_was_written() {
    let one = |text: &str| import(text).solid.primitives[0].clone();
    assert!(matches!(one("sphere(r = 2.5, $fn = 0, $fa = 12);").shape, Shape::Sphere(s) if s.radius == 2.5));
    let p = one("cylinder($fn = 0, h = 3, r1 = 2, r2 = 2, center = false);");
    assert!(matches!(p.shape, Shape::Cylinder(c) if c.radius == 2.0 && c.half_height == 1.5));
    assert_eq!(p.frame.position, DVec3::new(0.0, 0.0, 1.5));
    let p = one("cylinder(h = 4, r1 = 0, r2 = 1, center = true);");
    assert!(matches!(p.shape, Shape::Cone(c) if (c.bottom, c.top, c.half_height) == (0.0, 1.0, 2.0)));
    let p = one("cube(size = [1, 2, 3], center = false);");
    assert_eq!(p.aabb.min, DVec3::ZERO);
    assert_eq!(p.aabb.max, DVec3::new(1.0, 2.0, 3.0));
    assert_eq!((p.label.line, p.label.column), (1, 1));
    let p = one("cube(2);");
    assert_eq!(p.aabb.max, DVec3::splat(2.0));
    let octahedron = "polyhedron(points = [[1,0,0],[-1,0,0],[0,1,0],[0,-1,0],[0,0,1],[0,0,-1]], faces = \
        [[0,4,2],[0,2,5],[0,3,4],[0,5,3],[1,2,4],[1,5,2],[1,4,3],[1,3,5]], convexity = 1);";
    assert!(matches!(&one(octahedron).shape, Shape::Polyhedron(p) if p.planes.len() == 8 && p.vertices.len() == 6));
}

#[test]
fn a_polyhedron_that_is_not_convex_is_the_solid_within_its_faces() {
    // An L of three unit cubes, 1 high, its lids polygons of six corners; whatever the transform, its volume is 3 |det|.
    let outline = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]];
    let points: Vec<String> =
        (0..2).flat_map(|z| outline.iter().map(move |[x, y]| format!("[{x}, {y}, {z}]"))).collect();
    let sides: Vec<String> =
        (0..6).map(|i| format!("[{}, {}, {}, {i}]", i + 6, (i + 1) % 6 + 6, (i + 1) % 6)).collect();
    let faces = format!("[0, 1, 2, 3, 4, 5], [11, 10, 9, 8, 7, 6], {}", sides.join(", "));
    let text = format!("polyhedron(points = [{}], faces = [{faces}]);", points.join(", "));
    for rows in [
        "[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]",
        "[-2, 0.3, 0, 5], [0.1, 1, 0, 7], [0, 0.5, 1, 9]",
        "[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]",
    ] {
        let import = import(&under(rows, &text));
        let primitive = &import.solid.primitives[0];
        assert!(matches!(&primitive.shape, Shape::TriangleMesh(m) if m.bounding_faces() == 8), "{:?}", primitive.shape);
        assert_eq!(import.notes, vec![], "{rows}");
        let m: Vec<f64> = rows.replace(['[', ']'], "").split(", ").map(|n| n.parse().expect("a number")).collect();
        let at = |x: f64, y: f64, z: f64| {
            let row = |k: usize| m[4 * k] * x + m[4 * k + 1] * y + m[4 * k + 2] * z + m[4 * k + 3];
            import.solid.value(DVec3::new(row(0), row(1), row(2)))
        };
        for (x, y, z, inside) in
            [(0.5, 0.5, 0.5, true), (1.9, 0.9, 0.1, true), (0.9, 1.9, 0.9, true), (1.01, 1.01, 0.5, false)]
        {
            assert_eq!(at(x, y, z) < 0.0, inside, "{rows}: {x} {y} {z}");
        }
        // On the edge that is bent inwards, and beyond its planes.
        assert!(at(1.0, 1.0, 0.5).abs() < 1e-14 && at(1.0, 0.5, 0.5) < -0.1 && at(0.5, 1.0, 0.5) < -0.1, "{rows}");
        let det = if rows.starts_with("[-2") { 2.03 } else { 1.0 };
        let volume = primitive.shape.geometry().moments().expect("closed").volume();
        assert!((volume - 3.0 * det).abs() < 1e-12, "{rows}: {volume}");
    }
    let back = |face: &str| face.trim_matches(['[', ']']).rsplit(", ").collect::<Vec<_>>().join(", ");
    let inward: Vec<String> = faces.split("], [").map(|face| format!("[{}]", back(face))).collect();
    let reversed = import(&format!("polyhedron(points = [{}], faces = [{}]);", points.join(", "), inward.join(", ")));
    assert_eq!(reversed.notes[0].text, "a polyhedron with all faces reversed: flipped");
    assert_eq!(reversed.solid.value(DVec3::splat(0.5)), import(&text).solid.value(DVec3::splat(0.5)));
}

#[test]
fn low_fn_gives_openscads_own_prisms() {
    let hexagon = "cylinder($fn = 6, $fa = 12, $fs = 2, h = 2, r1 = 1, r2 = 1, center = true);";
    let p = &import(hexagon).solid.primitives[0];
    // The first corner lies on +x, so the flat sides face ±y.
    assert!((p.value(DVec3::new(0.99, 0.0, 0.0))) < 0.0);
    assert!((p.value(DVec3::new(0.0, 0.87, 0.0))) > 0.0);
    assert_eq!(p.faces.len(), 8);
    let faces = |text: &str, facets| {
        let solid = import_as(text, facets).expect("readable").solid;
        (solid.primitives[0].faces.len(), matches!(solid.primitives[0].shape, Shape::Polyhedron(_)))
    };
    // Rings of a sphere: (5 + 1)/2 = 3 rings of 5, two caps.
    let sphere = |fn_: f64| format!("sphere(r = 5, $fn = {fn_}, $fa = 12, $fs = 2);");
    assert_eq!(faces(&sphere(5.0), Facets::Auto), (12, true));
    assert_eq!(faces(&sphere(0.1), Facets::Auto), (5, true), "at least 3 sides");
    assert_eq!(faces(&sphere(8.9), Facets::Auto), (8 * 3 + 2, true));
    assert_eq!(faces(&sphere(9.0), Facets::Auto), (1, false));
    assert_eq!(faces(&sphere(5.0), Facets::Exact), (1, false));
    // $fn = 0: min(360/12, 2π·5/2) = 15.7 → 16 sides, 8 rings.
    assert_eq!(faces(&sphere(0.0), Facets::AsWritten), (16 * 7 + 2, true));
    let cone = "cylinder(h = 1, r1 = 1, r2 = 0, center = false, $fn = 4);";
    assert_eq!(faces(cone, Facets::Auto), (5, true));
    let exact = import("sphere(r = 1, $fn = 30);");
    assert_eq!(exact.notes[0].to_string(), "1:1: sphere with $fn = 30: taken as exact");
    let low = import(hexagon);
    assert_eq!(low.notes[0].to_string(), "1:1: cylinder taken as OpenSCAD's polyhedron of 6 sides");
}

fn kind_of(shape: &Shape) -> &'static str {
    match shape {
        Shape::Sphere(_) => "sphere",
        Shape::Cylinder(_) => "cylinder",
        Shape::Cone(_) => "cone",
        Shape::Cuboid(_) => "box",
        Shape::Polyhedron(_) => "polyhedron",
        Shape::HalfSpace(_) => "half-space",
        Shape::Torus(_) => "torus",
        Shape::TriangleMesh(_) => "mesh",
        Shape::Ellipsoid(_) => "ellipsoid",
        Shape::Capsule(_) => "capsule",
        Shape::Quadric(_) => "quadric",
        Shape::EllipticFrustum(_) => "elliptic frustum",
        Shape::Superellipsoid(_) => "superellipsoid",
    }
}

/// `inner` under a matrix given by its upper rows.
fn under(rows: &str, inner: &str) -> String {
    format!("multmatrix([{rows}, [0, 0, 0, 1]]) {{ {inner} }}")
}

#[test]
fn transforms_keep_kinds_where_they_can() {
    let kind = |text: &str| {
        let solid = import(text).solid;
        let p = &solid.primitives[0];
        (kind_of(&p.shape), p.aabb.max - p.aabb.min)
    };
    let scaled = |x: f64, y: f64, z: f64| format!("[{x}, 0, 0, 0], [0, {y}, 0, 0], [0, 0, {z}, 0]");
    let cases = [
        (scaled(3.0, 3.0, 3.0), "sphere(r = 1);", "sphere", DVec3::splat(6.0)),
        (scaled(-2.0, 2.0, 2.0), "cylinder(h = 1, r1 = 1, r2 = 0);", "cone", DVec3::new(4.0, 4.0, 2.0)),
        (scaled(2.0, 2.0, 5.0), "cylinder(h = 1, r1 = 1, r2 = 1);", "cylinder", DVec3::new(4.0, 4.0, 5.0)),
        (scaled(1.0, 2.0, 3.0), "cube(size = [1, 1, 1]);", "box", DVec3::new(1.0, 2.0, 3.0)),
        (scaled(1.0, -2.0, 3.0), "cylinder(h = 1, r1 = 1, r2 = 1, $fn = 4);", "polyhedron", DVec3::new(2.0, 4.0, 3.0)),
        ("[1, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]".into(), "cube(2);", "polyhedron", DVec3::new(3.0, 2.0, 2.0)),
    ];
    for (rows, inner, expected, size) in cases {
        let (kind, extent) = kind(&under(&rows, inner));
        assert_eq!(kind, expected, "{inner} under {rows}");
        assert!((extent - size).length() < 1e-12, "{inner} under {rows}: {extent}");
    }
    // A non-uniform scale that a later one undoes is none.
    let undone = under(&scaled(2.0, 1.0, 1.0), &under(&scaled(0.5, 1.0, 1.0), "sphere(r = 1);"));
    assert_eq!(kind(&undone).0, "sphere");
    // A mirrored cone keeps its apex on top, a cone upside down does not.
    let apex = |rows: String| {
        let solid = import(&under(&rows, "cylinder(h = 1, r1 = 1, r2 = 0);")).solid;
        let inside = |z: f64| solid.value(DVec3::new(0.9, 0.0, z)) < 0.0;
        (inside(0.05), inside(-0.05))
    };
    assert_eq!(apex(scaled(-1.0, 1.0, 1.0)), (true, false));
    assert_eq!(apex(scaled(1.0, 1.0, -1.0)), (false, true));
}

#[test]
fn six_digit_rotations_become_exact_ones() {
    let rows = "[0.866025, -0.5, 0, 1], [0.5, 0.866025, 0, 2], [0, 0, 1, 3]";
    let import = import(&under(rows, "cube(2, center = true);"));
    let p = &import.solid.primitives[0];
    assert!(matches!(&p.shape, Shape::Cuboid(c) if c.half == DVec3::ONE), "scale 1, not 0.99999973: {:?}", p.shape);
    assert!((p.frame.rotation.to_axis_angle().1 - std::f64::consts::FRAC_PI_6).abs() < 1e-6);
    let note = import.notes[0].to_string();
    assert!(note.starts_with("1:12: a rough matrix: replaced by the nearest rotation times scale (by "), "{note}");
    let exact = super::import_csg(
        "m.csg",
        &under("[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]", "cube(2);"),
        Facets::Auto,
        &Limits::default(),
    );
    assert_eq!(exact.expect("a quarter turn").notes, vec![]);
}

#[test]
fn extrusions_are_prisms_and_their_set_operations() {
    let extrude = |arguments: &str, inner: &str| format!("linear_extrude({arguments}) {{ {inner} }}");
    let plate = extrude("height = 2", "difference() { square(size = [4, 4], center = true); circle(r = 1); }");
    assert_eq!(tree(&plate), "(square#0 - circle#1)");
    let solid = import(&plate).solid;
    assert_eq!(solid.senses, vec![Sense::Positive, Sense::Negative]);
    // The hole goes beyond both caps: no skin is left where they would have coincided.
    assert!(solid.value(DVec3::new(0.0, 0.0, 2.0)) > 0.9);
    assert_eq!(solid.aabb().max, DVec3::new(2.0, 2.0, 2.0));

    let inside = |text: &str, p: [f64; 3]| import(text).solid.value(DVec3::from_array(p)) < 0.0;
    let centred = extrude("height = 2, center = true", "polygon(points = [[0, 0], [0, 2], [2, 0]], paths = undef);");
    assert!(inside(&centred, [0.5, 0.5, -0.9]) && !inside(&centred, [1.5, 1.5, 0.0]));
    let pyramid = extrude("height = 2, scale = 0", "square(size = [2, 2], center = true);");
    assert!(
        inside(&pyramid, [0.0, 0.0, 1.9]) && !inside(&pyramid, [0.6, 0.0, 1.0]) && inside(&pyramid, [0.4, 0.0, 1.0])
    );
    let frustum = extrude("height = 2, scale = [2, 2]", "circle(r = 1);");
    assert!(matches!(import(&frustum).solid.primitives[0].shape, Shape::Cone(_)));
    let leaning = extrude("height = 2, v = [1, 0, 1]", "square(size = [1, 1]);");
    let top = 2f64.sqrt();
    assert!(inside(&leaning, [0.5 + 0.9 * top, 0.5, 0.9 * top]) && !inside(&leaning, [0.5, 0.5, 0.9 * top]));
    let moved = extrude(
        "height = 1",
        &under("[0, -2, 0, 5], [2, 0, 0, 0], [0, 0, 1, 0]", "intersection() { circle(r = 1); square(size = [1, 1]); }"),
    );
    assert!(inside(&moved, [3.7, 1.2, 0.5]) && !inside(&moved, [5.3, 0.5, 0.5]) && !inside(&moved, [3.2, 1.8, 0.5]));
    let hexagon = extrude("height = 1", "circle(r = 1, $fn = 6);");
    assert_eq!(import(&hexagon).solid.primitives[0].faces.len(), 8);
    let path = extrude("height = 1", "polygon(points = [[0, 0], [9, 9], [2, 0], [0, 2]], paths = [[0, 2, 3]]);");
    assert_eq!(import(&path).solid.aabb().max, DVec3::new(2.0, 2.0, 1.0));
}

/// As OpenSCAD 2021.01 cuts them (`openscad -o x.stl`): solids have their faces, and so have what is taken away.
#[test]
fn a_section_has_the_faces_in_its_plane() {
    let cube = |x: f64, y: f64, z: f64, size: [f64; 3]| {
        format!("translate([{x}, {y}, {z}]) cube(size = [{}, {}, {}]);", size[0], size[1], size[2])
    };
    let (around, below) = (cube(0.0, 0.0, -5.0, [10.0; 3]), cube(0.0, 0.0, -5.0, [5.0; 3]));
    let (over, under) = (cube(2.0, 2.0, 0.0, [3.0, 3.0, 9.0]), cube(2.0, 2.0, -9.0, [3.0, 3.0, 9.0]));
    let mesh = |z: f64| {
        format!(
            "translate([0, 0, {z}]) minkowski() {{ cube(size = [4, 4, 2]); cylinder($fn = 6, $fa = 12, $fs = 2, h = 1, r1 = 1, r2 = 1); }}"
        )
    };
    let (middle, corner) = ([3.5, 3.5], [1.0, 1.0]);
    for (text, inside, outside) in [
        (format!("difference() {{ {around} {over} }}"), vec![corner], vec![middle]),
        (format!("difference() {{ {around} {under} }}"), vec![corner], vec![middle]),
        (format!("intersection() {{ {below} {over} }}"), vec![middle], vec![corner]),
        (format!("intersection() {{ {around} {under} }}"), vec![middle], vec![corner]),
        (format!("{below} {}", cube(8.0, 0.0, 0.0, [1.0; 3])), vec![corner, [8.5, 0.5]], vec![[6.0, 0.5]]),
        (mesh(-3.0), vec![corner], vec![[7.0, 1.0]]),
        (mesh(0.0), vec![corner], vec![[7.0, 1.0]]),
        (
            "translate([0, 0, -2]) cylinder($fn = 0, $fa = 12, $fs = 2, h = 2, r1 = 4, r2 = 3);".into(),
            vec![corner, [2.9, 0.0]],
            vec![[3.1, 0.0]],
        ),
        (cube(0.0, 0.0, -5.0, [5.0, 5.0, 4.999]), vec![], vec![corner]),
    ] {
        let solid = import(&format!("linear_extrude(height = 1) {{ projection(cut = true) {{ {text} }} }}")).solid;
        let value = |[x, y]: [f64; 2]| solid.value(DVec3::new(x, y, 0.5));
        assert!(inside.iter().all(|x| value(*x) < 0.0), "{text}");
        assert!(outside.iter().all(|x| value(*x) > 0.0), "{text}");
    }
}

#[test]
fn infinite_primitives_are_half_spaces() {
    let half = "cylinder(h = inf, r1 = inf, r2 = inf, center = false);";
    let solid = import(&format!("intersection() {{ sphere(r = 1); {half} }}")).solid;
    assert!(solid.value(DVec3::new(0.0, 0.0, 0.5)) < 0.0 && solid.value(DVec3::new(0.0, 0.0, -0.5)) > 0.0);
    assert!(matches!(solid.primitives[1].shape, Shape::HalfSpace(_)));
    let slab = "intersection() { sphere(r = 2); cube(size = [inf, inf, 1], center = true); }";
    assert_eq!(tree(slab), "(sphere#0 & (cube#1 & cube#2))");
    let cut = import(&format!(
        "difference() {{ cube(4, center = true); {} }}",
        under("[1, 0, 0, 1], [0, 0, 1, 0], [0, -1, 0, 0]", half)
    ));
    assert!(cut.solid.value(DVec3::new(0.0, -1.0, 0.0)) < 0.0 && cut.solid.value(DVec3::new(0.0, 1.0, 0.0)) > 0.0);
    let floor = import(&format!("union() {{ sphere(r = 1); {half} }}"));
    assert!((floor.solid.value(DVec3::new(1e6, 0.0, 1.0)) + 1.0).abs() < 1e-9);
    assert!((floor.solid.value(DVec3::NEG_Z * 2.0) - 1.0).abs() < 1e-15);
    let told: Vec<String> = floor.notes.iter().map(|n| format!("{}: {}", n.at, n.text)).collect();
    assert_eq!(
        told,
        [
            "1:26: an infinite cylinder: 1 half-space(s)",
            "1:26: the model reaches to infinity by this half-space: a floor or a wall, without mass properties"
        ]
    );
    assert_eq!(
        refused("cube(size = inf, center = true);"),
        "m.csg:1:1: expected a primitive with at least one face, found all of space"
    );
}

#[test]
fn every_refusal_is_a_sentence_with_its_place() {
    let cube_faces = "[[2,6,4,0],[5,7,3,1],[4,5,1,0],[3,7,6,2],[1,3,2,0],[6,7,5,4]]";
    let cube_points = "[[0,0,0],[1,0,0],[0,1,0],[1,1,0],[0,0,1],[1,0,1],[0,1,1],[1,1,1]]";
    let table: Vec<(String, &str)> = vec![
        (
            "union() {\n  roof() { }\n}".into(),
            "2:3: expected a supported construct, found roof, which is not supported",
        ),
        (
            "rotate_extrude() { square([4, 1], center = true); }".into(),
            "1:1: expected an outline on one side of the axis of rotate_extrude, found one on both",
        ),
        (
            "for(i = [1, 2, 3]) { }".into(),
            "1:1: expected a supported construct, found for, which is not supported (this is .scad: load the file by that \
             ending, or flatten it first: openscad -o model.csg model.scad)",
        ),
        ("sphere(r = \"1\");".into(), "1:12: expected a positive number as r of sphere, found the string \"1\""),
        ("sphere(r = undef);".into(), "1:1: expected a positive number as r of sphere, found undef"),
        ("sphere(1, r = 2);".into(), "1:11: expected each argument of sphere once, found a second r"),
        ("sphere(1, 2);".into(), "1:11: expected at most 1 unnamed arguments of sphere, found another"),
        ("cube(size = [1, 2]);".into(), "1:13: expected three positive numbers as size of cube, found a list of 2"),
        (
            "cube(1, center = true);cube(1, center = \"a\");".into(),
            "1:41: expected true or false as center of cube, found the string \"a\"",
        ),
        ("cube(1) { sphere(1); }".into(), "1:1: expected nothing inside of cube, found calls"),
        ("cube(1)".into(), "1:8: expected \";\", \"{\" or a call, found the end of the file"),
        ("cube(1;".into(), "1:7: expected \",\" or \")\", found \";\""),
        ("cube(size 1);".into(), "1:11: expected \"=\" after size, found the number 1"),
        ("cube(size = );".into(), "1:13: expected a value, found \")\""),
        ("cube(size = [1 2]);".into(), "1:16: expected \",\" or \"]\", found the number 2"),
        ("cube(size = -x);".into(), "1:14: expected a number, found \"x\""),
        (
            "x = 3;".into(),
            "1:3: expected a supported construct, found the variable x, which is not supported (this is .scad:",
        ),
        ("}".into(), "1:1: expected a call such as union() or cube(…), found \"}\""),
        ("%".into(), "1:2: expected a call such as union() or cube(…), found the end of the file"),
        ("union() {\n\nsphere(1);".into(), "3:11: expected \"}\" closing line 1, found the end of the file"),
        (
            "linear_extrude(height = inf) { circle(1); }".into(),
            "1:25: expected a finite number as height of linear_extrude, found inf",
        ),
        (
            "linear_extrude(height = 1, twist = inf) { circle(1); }".into(),
            "1:1: expected a finite number as twist of linear_extrude, found inf",
        ),
        (
            "linear_extrude(height = 1, twist = 36000000) { circle(1); }".into(),
            "1:1: expected at most 1000000 triangles of a mesh, found more",
        ),
        (under("[1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]", ""), "1:13: expected a row of 4 numbers, found a list of 3"),
        (
            under("[1, 0, 0, \"a\"], [0, 1, 0, 0], [0, 0, 1, 0]", ""),
            "1:23: expected a finite number, found the string \"a\"",
        ),
        ("multmatrix() { }".into(), "1:1: expected a 4×4 matrix as m of multmatrix, found none"),
        (
            format!("polyhedron(points = {cube_points}, faces = {});", cube_faces.replace("[3,7,6,2],", "")),
            "1:1: expected a closed polyhedron, found an open mesh: the edge between points 2 and 6 belongs to one \
             face only",
        ),
        (
            under("[1e99, 0, 0, 0], [0, 1e99, 0, 0], [0, 0, 1e99, 0]", "cube(1e250);"),
            "1:81: expected coordinates that a double can hold, found an overflow",
        ),
        ("cube(1e300);sphere(1e999);".into(), "1:20: expected a number that a double can hold, found \"1e999\""),
    ];
    for (text, sentence) in table {
        let error = refused(&text);
        let expected = format!("m.csg:{sentence}");
        assert!(error.starts_with(&expected), "{text}\n  said    {error}\n  not     {expected}");
        assert!(!error.contains('\n'), "{error}");
    }
}

#[test]
fn a_polyhedron_that_crosses_itself_is_what_it_winds_around() {
    // A cube one corner of which is pulled through the opposite one: along their line it winds around what is between them alone,
    // and the other way round. A box with walls that cross each other below its lid.
    let cube = "[0,0,0],[1,0,0],[0,1,0],[1,1,0],[0,0,1],[1,0,1],[0,1,1],[-0.5,-0.5,-0.5]";
    let triangles = "[2,6,4],[2,4,0],[5,7,3],[5,3,1],[4,5,1],[4,1,0],[3,7,6],[3,6,2],[1,3,2],[1,2,0],[6,7,5],[6,5,4]";
    let box_of = |z: &str| format!("[0,0,0],[4,0,0],[4,4,0],[0,4,0],{z},[0,0,4],[4,0,4.5],[4,4,4.5],[0,4,4]");
    let lid = "[0,1,2,3],[11,10,9,8],[0,4,5],[0,5,1],[1,5,6],[1,6,2],[2,6,7],[2,7,3],[3,7,4],[3,4,0],[4,8,9],[4,9,5],\
               [5,9,10],[5,10,6],[6,10,11],[6,11,7],[7,11,8],[7,8,4]";
    let texts = [
        (cube.to_owned(), triangles, None, [-0.25, 0.1]),
        (box_of("[0,0,3],[4,0,5],[4,4,5],[0,4,3]"), lid, Some(68.0), [0.9, 5.0]),
    ];
    for (points, faces, volume, [inside, outside]) in texts {
        let import = import(&format!("\n  polyhedron(points = [{points}], faces = [{faces}]);"));
        let [note] = import.notes.as_slice() else { panic!("{:?}", import.notes) };
        assert!(note.text.starts_with("a polyhedron that crosses itself (") && note.at.line == 2, "{note:?}");
        let primitive = &import.solid.primitives[0];
        let measured = primitive.shape.geometry().moments().expect("closed").volume();
        assert!(volume.is_none_or(|v: f64| (measured - v).abs() < 1e-12), "{measured}");
        let value = |x: f64| import.solid.value(DVec3::splat(x));
        assert!(value(inside) < 0.0 && value(outside) > 0.0);
    }
}

#[test]
fn parts_of_a_polyhedron_are_solid_whichever_way_round_they_run() {
    // A box and two tetrahedra that run the other way round.
    let text = "polyhedron(points = [[0,-1,2],[0,1,4],[-1,-2,3],[-1,-4,0],[1,2,1],[2,2,1],[2,4,1],[1,4,1],[1,2,3],[2,2,3],\
                [2,4,3],[1,4,3],[0,0,-1],[3,1,-2],[0,-2,2],[-1,-2,0]],faces = [[0,2,1],[0,1,3],[1,2,3],[2,0,3],[7,6,5],\
                [7,5,4],[4,5,9],[4,9,8],[5,6,10],[5,10,9],[6,7,11],[6,11,10],[7,4,8],[7,8,11],[8,9,10],[8,10,11],\
                [13,14,12],[15,13,12],[15,14,13],[15,12,14]]);";
    let import = import(text);
    let [note] = import.notes.as_slice() else { panic!("{:?}", import.notes) };
    assert!(note.text.starts_with("a polyhedron with parts inside out, or within others"), "{note:?}");
    let value = |x: f64, y: f64, z: f64| import.solid.value(DVec3::new(x, y, z));
    assert!(value(1.5, 3.0, 2.0) < 0.0 && value(-0.5, -1.5, 2.25) < 0.0);
    // Beside the box, and between all of them.
    assert!(value(0.5, 3.0, 2.0) > 0.0 && value(2.5, 3.0, 2.0) > 0.0 && value(1.0, 1.5, 2.0) > 0.0);
}

#[test]
fn limits_are_named() {
    let limits = Limits {
        bytes: 1000,
        nodes: 5,
        depth: 3,
        faces: 20,
        polyhedron_faces: 6,
        hull_faces: 8,
        outline_corners: 6,
        mesh_facets: 9,
        values: 8,
    };
    let table = [
        (" ".repeat(1001), "m.csg:1:1: expected at most 1000 bytes of text, found more"),
        ("group();".repeat(6), "m.csg:1:41: expected at most 5 nodes, found more"),
        ("group() {".repeat(4), "m.csg:1:36: expected at most 3 levels of nesting, found more"),
        ("cube(1);".repeat(4), "m.csg:1:25: expected at most 20 faces, found more"),
        ("sphere(1, $fn = 7);".into(), "m.csg:1:1: expected at most 6 faces of a primitive, found more"),
        ("cube([1,2,3,4,5,6,7,8,9]);".into(), "m.csg:1:6: expected at most 8 values in a list, found more"),
        (
            "cube([[[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]]]);".into(),
            "m.csg:1:22: expected at most 16 nested brackets, found more",
        ),
    ];
    for (text, sentence) in table {
        let facets = if text.contains("$fn") { Facets::AsWritten } else { Facets::Auto };
        match import_csg("m.csg", &text, facets, &limits) {
            Err(e) => assert_eq!(e.to_string(), sentence),
            Ok(_) => panic!("{text} was read"),
        }
    }
}

#[test]
fn depth_costs_no_stack() {
    let deep = 200_000;
    let text = format!("{}sphere(1);{}", "union() {".repeat(deep), "}".repeat(deep));
    let limits = Limits { depth: deep, ..Limits::default() };
    let small_stack = std::thread::Builder::new().stack_size(256 << 10);
    let thread =
        small_stack.spawn(move || import_csg("m.csg", &text, Facets::Auto, &limits).map(|i| i.solid.nodes.len()));
    let nodes = thread.expect("a thread").join().expect("no overflow").expect("readable");
    assert_eq!(nodes, 1);
}

/// Texts to mutate: all constructs.
const SEEDS: [&str; 4] = [
    "difference() { cube(size = [1, 2, 3], center = true); multmatrix([[0, -1, 0, 1e-5], [1, 0, 0, 2], [0, 0, 1, 3], \
     [0, 0, 0, 1]]) { cylinder($fn = 6, $fa = 12, $fs = 2, h = 3, r1 = 1, r2 = 0.5, center = false); } }",
    "intersection() { sphere(r = 2, $fn = 5); cube(size = [inf, inf, 1], center = true); %group(); #sphere(1); }",
    "linear_extrude(height = 3, center = true, scale = [2, 2]) { difference() { polygon(points = [[0, 0], [2, 0], [0, 2]], \
     paths = [[0, 1, 2]]); circle(r = 0.2, $fn = 4); } }",
    "color([1, 0, 0, 1]) { polyhedron(points = [[1,0,0],[-1,0,0],[0,1,0],[0,-1,0],[0,0,1],[0,0,-1]], faces = \
     [[0,4,2],[0,2,5],[0,3,4],[0,5,3],[1,2,4],[1,5,2],[1,4,3],[1,3,5]], convexity = 1); } // end",
];

/// Reads a text in every way; what loads must be a solid that can be asked.
fn survives(text: &str) -> bool {
    let limits = Limits { polyhedron_faces: 500, ..Limits::default() };
    let mut loaded = false;
    for facets in [Facets::Exact, Facets::Auto, Facets::AsWritten] {
        if let Ok(import) = import_csg("m.csg", text, facets, &limits) {
            assert!(!import.solid.value(DVec3::new(0.1, 0.2, 0.3)).is_nan(), "{text}");
            let leaves = import.solid.nodes.iter().filter(|n| matches!(n, Node::Primitive(_))).count();
            assert_eq!(leaves, import.solid.primitives.len(), "every primitive stands at one leaf: {text}");
            loaded = true;
        }
    }
    loaded
}

#[test]
fn seeds_load() {
    assert!(SEEDS.iter().all(|s| survives(s)));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_text_is_read_or_refused(text in "\\PC{0,200}") {
        survives(&text);
    }

    #[test]
    fn any_tokens_are_read_or_refused(tokens in prop::collection::vec(0usize..24, 0..60)) {
        const TOKENS: [&str; 24] = [
            "union", "(", ")", "{", "}", ";", "[", "]", ",", "=", "-", "1", "0.5", "inf", "nan", "undef", "true", "sphere",
            "cube", "!", "%", "linear_extrude", "height", "\"",
        ];
        survives(&tokens.iter().map(|t| TOKENS[*t]).collect::<Vec<_>>().join(" "));
    }

    #[test]
    fn mutated_files_are_read_or_refused(
        seed in 0..SEEDS.len(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), 0usize..5, 0usize..16), 1..6),
    ) {
        const INSERTS: [&str; 16] =
            ["0", "9", "-", "e", ".", "[", "]", "(", ")", "{", "}", ",", ";", "1e308", "inf", "nan"];
        let mut text = SEEDS[seed].to_owned();
        for (place, edit, insert) in edits {
            let at = place.index(text.len() + 1);
            match edit {
                0 if at < text.len() => { text.remove(at); }
                1 => text.truncate(at),
                _ => text.insert_str(at, INSERTS[insert]),
            }
        }
        survives(&text);
    }
}

/// Of two sheets within a box both are taken; one of which only rounding is in it is left out with a note; one that stays
/// clear of it is nothing, without one.
#[test]
fn a_sheet_of_a_quadric_is_never_left_out_in_silence() {
    let sheets = |top: &str| {
        let m = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]";
        let text = format!("quadric(m = {m}, min = [-2, -2, -3], max = [2, 2, {top}]);");
        let import = import(&text);
        let notes: Vec<String> = import.notes.iter().map(ToString::to_string).collect();
        (import.solid.primitives.len(), notes)
    };
    assert_eq!(sheets("3"), (2, vec![]));
    assert_eq!(sheets("0"), (1, vec![]));
    let left = "1:1: a piece of a quadric that is thin or not in its box: left out";
    assert_eq!(sheets("1.0000000000001"), (1, vec![left.to_string()]));
}

/// A waist that is too thin to be told from two cones' common tip is refused, however thin; a wider one is what was asked for.
#[test]
fn a_hyperboloid_has_its_waist_or_is_refused() {
    for size in [1e-6, 1.0, 1e6] {
        for power in 3..=15 {
            let waist = size * 10f64.powi(-power);
            let text = format!("hyperboloid(h = {size:e}, r = {size:e}, waist = {waist:e}, center = true);");
            if power > 6 {
                let told = refused(&text);
                assert!(told.contains("expected a hyperboloid with a waist that is no less than"), "{text}: {told}");
                continue;
            }
            let solid = import(&text).solid;
            let at = |rho: f64, z: f64| solid.value(DVec3::new(rho, 0.0, z));
            assert!(at(0.99 * waist, 0.0) < 0.0 && at(1.01 * waist, 0.0) > 0.0, "{text}");
            assert!(at(0.99 * size, 0.4999 * size) < 0.0 && at(0.5 * size, 0.51 * size) > 0.0, "{text}");
        }
    }
    // A cylinder to rounding ends where it was told to.
    let solid = import("hyperboloid(h = 1, r = 1, waist = 0.99999999999999, center = true);").solid;
    assert!(solid.value(DVec3::Z * 0.49) < 0.0 && solid.value(DVec3::Z * 0.51) > 0.0);
    assert!(solid.value(DVec3::Z * 1e3) > 0.0);
}

/// A quadric that lies beyond its box, however far, is refused, and so it is at every scale of its matrix.
#[test]
fn a_quadric_beyond_its_box_is_refused() {
    for scale in [1e-100, 1e-3, 1.0, 1e100] {
        for power in 1..=15 {
            let constant = scale * 10f64.powi(power);
            let m = format!("[[{scale:e},0,0,0],[0,-{scale:e},0,0],[0,0,{scale:e},0],[0,0,0,{constant:e}]]");
            let told = refused(&format!("quadric(m = {m}, min = [-1, -1, -1], max = [1, 1, 1]);"));
            let is_told = told.contains("an inside within its box") || told.contains("none of planes");
            assert!(is_told, "{constant:e} of {scale:e}: {told}");
        }
    }
}
