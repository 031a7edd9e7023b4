//! Files of every format, written from random solids by writers that know nothing of the readers, and read back: points are inside where
//! the solids themselves say so.

use contactd::import::drawing::{Frame, svg};
use contactd::import::{Facets, Limits, Source};
use contactd_tests::mesh_files::{Body, WRITERS, Writer};
use contactd_tests::meshes::{self, distance, winding};
use contactd_tests::random_solids::Random;
use glam::{DAffine2, DAffine3, DVec2, DVec3};

/// Random bodies that a writer can write.
fn bodies(r: &mut Random, writer: &Writer) -> Vec<Body> {
    let count = if writer.single { 1 } else { 1 + r.below(3) };
    let body = |r: &mut Random| {
        let (points, triangles) = meshes::random(r, 1.0);
        // As much as any of the formats can say.
        let mesh = (points.into_iter().map(|p| p.as_vec3().as_dvec3()).collect(), triangles);
        let place = if writer.single {
            DAffine3::IDENTITY
        } else {
            DAffine3::from_rotation_translation(r.rotation(), r.vector(2.0))
        };
        // AMF has no sizes.
        let size = if writer.single || writer.ending == "amf" {
            DVec3::ONE
        } else {
            DVec3::new(r.within(0.5, 2.0), r.within(0.5, 2.0), if r.chance(0.5) { 1.0 } else { -1.0 })
        };
        (mesh, place * DAffine3::from_scale(size))
    };
    (0..count).map(|_| body(r)).collect()
}

#[test]
fn a_point_is_inside_of_what_is_read_where_a_written_mesh_winds_around_it() {
    let mut r = Random::new(77);
    for round in 0..3 {
        for writer in &WRITERS {
            let bodies = bodies(&mut r, writer);
            let bytes = (writer.write)(&bodies, &mut r);
            let name = format!("part.{}", writer.ending);
            let import = Source::named(&name, &bytes)
                .import(Facets::Auto, &Limits::default())
                .unwrap_or_else(|e| panic!("round {round}: {e}"));
            assert_eq!(import.solid.primitives.len(), bodies.len(), "{name}");
            let said = if writer.single { "says neither its unit" } else { " is up, as " };
            assert!(import.notes[0].text.contains(said), "{name}: {:?}", import.notes);
            let around = import.solid.aabb();
            let (mut full, mut seen) = (0, 0);
            for _ in 0..120 {
                let x = r.point_in(&around);
                let of = |(mesh, place): &Body| {
                    let local = place.inverse().transform_point3(x);
                    (distance(mesh, local), winding(mesh, local).round().abs() == 1.0)
                };
                let each: Vec<(f64, bool)> = bodies.iter().map(of).collect();
                if each.iter().any(|(off, _)| *off < 1e-5) {
                    continue;
                }
                let inside = each.iter().any(|(_, inside)| *inside);
                let f = import.solid.value(x);
                assert_eq!(f < 0.0, inside, "round {round}, {name} at {x}: {f}");
                (full, seen) = (full + usize::from(inside), seen + 1);
            }
            assert!(full > 0 && full < seen, "{name}: {full} of {seen}");
        }
    }
}

/// An element, and what is inside of it in the coordinates of its own.
type Element = (String, Box<dyn Fn(DVec2) -> bool>);

fn to_segment(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    p.distance(a.lerp(b, t))
}

/// A random element of every kind that has an area of its own.
fn element(r: &mut Random, kind: usize) -> Element {
    let mut at = || DVec2::new(r.within(10.0, 40.0), r.within(10.0, 40.0));
    let (a, b, c) = (at(), at(), at());
    let size = DVec2::new(r.within(4.0, 15.0), r.within(4.0, 15.0));
    match kind {
        0 => (format!("<circle cx='{}' cy='{}' r='{}'", a.x, a.y, size.x), Box::new(move |p| p.distance(a) < size.x)),
        1 => (
            format!("<ellipse cx='{}' cy='{}' rx='{}' ry='{}'", a.x, a.y, size.x, size.y),
            Box::new(move |p| ((p - a) / size).length() < 1.0),
        ),
        2 => (
            format!("<rect x='{}' y='{}' width='{}' height='{}'", a.x, a.y, size.x, size.y),
            Box::new(move |p| (p - a).min_element() > 0.0 && (a + size - p).min_element() > 0.0),
        ),
        3 => {
            let round = DVec2::new(size.x * 0.2, size.y * 0.4);
            (
                format!(
                    "<rect x='{}' y='{}' width='{}' height='{}' rx='{}' ry='{}'",
                    a.x, a.y, size.x, size.y, round.x, round.y
                ),
                Box::new(move |p| {
                    let q = ((p - a - size * 0.5).abs() - size * 0.5 + round).max(DVec2::ZERO) / round;
                    q.length() < 1.0
                }),
            )
        }
        4 | 5 => {
            let (from, to) = (a, b + DVec2::splat(0.5));
            let cap = ["butt", "round"][kind - 4];
            (
                format!(
                    "<line x1='{}' y1='{}' x2='{}' y2='{}' style='stroke-width:{}; stroke-linecap:{cap}'",
                    from.x, from.y, to.x, to.y, size.x
                ),
                Box::new(move |p| {
                    let along = (p - from).dot(to - from) / (to - from).length_squared();
                    to_segment(p, from, to) < size.x * 0.5 && (kind == 5 || (0.0..1.0).contains(&along))
                }),
            )
        }
        // An ellipse of two arcs whose axes are turned; in one in two the flags stand without blanks.
        6 => {
            let turn = r.within(-80.0, 80.0);
            let along = DVec2::from_angle(f64::to_radians(turn)) * size.x;
            let flags = if r.chance(0.5) { "1 0 " } else { "10" };
            let (from, to) = (a - along, along * 2.0);
            let arc = format!("{} {} {turn} {flags}", size.x, size.y);
            (
                format!("<path d='M{},{}a{arc}{} {} {arc}{} {}Z'", from.x, from.y, to.x, to.y, -to.x, -to.y),
                Box::new(move |p| {
                    let q = DVec2::from_angle(-f64::to_radians(turn)).rotate(p - a) / size;
                    q.length() < 1.0
                }),
            )
        }
        // Between a parabola and its chord, as one curve of three points or of four.
        7 | 8 => {
            let data = if kind == 7 {
                format!("M{} {}Q{} {} {} {}z", a.x, a.y, b.x, b.y, c.x, c.y)
            } else {
                let (d, e) = (a.lerp(b, 2.0 / 3.0) - a, c.lerp(b, 2.0 / 3.0) - a);
                let f = c - a;
                format!("m{} {}c{} {} {} {} {} {}z", a.x, a.y, d.x, d.y, e.x, e.y, f.x, f.y)
            };
            let frame = glam::DMat2::from_cols(b - a, c - a);
            let inverse = frame.inverse();
            (
                format!("<path d='{data}'"),
                Box::new(move |p| {
                    let q = inverse * (p - a);
                    let (u, v) = (0.5 * q.x + q.y, q.y);
                    u * u < v && v < u
                }),
            )
        }
        // A frame: the inner path takes away.
        _ => (
            format!(
                "<path d='M{} {} h{} v{} h{} zM{} {} h{} v{} h{} z'",
                a.x,
                a.y,
                size.x,
                size.y,
                -size.x,
                a.x + 1.0,
                a.y + 1.0,
                size.x - 2.0,
                size.y - 2.0,
                2.0 - size.x
            ),
            Box::new(move |p| {
                let q = (p - a - size * 0.5).abs() - size * 0.5;
                q.max_element() < 0.0 && q.max_element() > -1.0
            }),
        ),
    }
}

/// A random transform, as text and as what it does.
fn transform(r: &mut Random) -> (String, DAffine2) {
    let (x, y, angle) = (r.within(-5.0, 5.0), r.within(-5.0, 5.0), r.within(-90.0, 90.0));
    let turn = DAffine2::from_angle(f64::to_radians(angle));
    let shift = DAffine2::from_translation(DVec2::new(x, y));
    match r.below(6) {
        0 => (String::new(), DAffine2::IDENTITY),
        1 => (format!(" transform='translate({x},{y}) rotate({angle})'"), shift * turn),
        2 => (format!(" transform='rotate({angle} {x},{y})'"), shift * turn * shift.inverse()),
        3 => (" transform='scale(1.5, -.75)'".into(), DAffine2::from_scale(DVec2::new(1.5, -0.75))),
        4 => {
            let m = [1.0, 0.5, -0.25, 0.75, x, y];
            (format!(" transform='matrix({} {} {} {} {x} {y})'", m[0], m[1], m[2], m[3]), DAffine2::from_cols_array(&m))
        }
        _ => {
            let tangent = f64::to_radians(20.0).tan();
            let skew = DAffine2::from_cols_array(&[1.0, 0.0, tangent, 1.0, 0.0, 0.0]);
            ("\n transform=' skewX(20) translate(4)'".into(), skew * DAffine2::from_translation(DVec2::new(4.0, 0.0)))
        }
    }
}

fn winds_oddly(paths: &[Vec<DVec2>], p: DVec2) -> bool {
    let edges = paths.iter().flat_map(|path| (0..path.len()).map(move |i| (path[i], path[(i + 1) % path.len()])));
    let crosses =
        |(a, b): &(DVec2, DVec2)| (a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y);
    edges.filter(crosses).count() % 2 == 1
}

#[test]
fn a_point_is_inside_of_a_drawing_where_an_element_says_so() {
    let mut r = Random::new(31);
    for round in 0..60 {
        let mut text = String::from(
            "<?xml version='1.0'?>\n<!DOCTYPE svg PUBLIC '-//W3C//DTD SVG 1.1//EN' 'http://www.w3.org/'>\n\
             <svg xmlns='http://www.w3.org/2000/svg' width='100mm' height='50mm' viewBox='0 0 200 100'><title>a</title>",
        );
        let mut elements: Vec<(DAffine2, Box<dyn Fn(DVec2) -> bool>)> = Vec::new();
        for k in 0..2 {
            let (words, outer) = transform(&mut r);
            text += &format!("<g id='g{k}'{words}><defs><circle r='99'/></defs>");
            for kind in [(round + 3 * k) % 10, r.below(10)] {
                let ((words, inner), (head, inside)) = (transform(&mut r), element(&mut r, kind));
                text += &format!("{head}{words}/>");
                elements.push((outer * inner, inside));
            }
            text += "</g>";
        }
        text += "</svg>";
        for (id, chosen) in [("", 0..4), ("g1", 2..4)] {
            let (origin, pieces) = (DVec2::ZERO, |_| 8);
            let frame = Frame { layer: "", id, dpi: 72.0, center: false, origin, scale: 1.0, pieces: &pieces };
            let drawing = svg::read(text.as_bytes(), &frame).unwrap_or_else(|(at, e)| panic!("{at}: {e}\n{text}"));
            let truth = |p: DVec2| {
                let p = DVec2::new(p.x, 50.0 - p.y) * 2.0;
                elements[chosen.clone()].iter().any(|(place, inside)| inside(place.inverse().transform_point2(p)))
            };
            let off = drawing.off + 1e-3;
            let mut seen = [0, 0];
            for _ in 0..200 {
                let p = DVec2::new(r.within(-5.0, 40.0), r.within(15.0, 55.0));
                let here = truth(p);
                if (0..24).any(|k| truth(p + DVec2::from_angle(f64::from(k) * 0.2618) * off) != here) {
                    continue;
                }
                let held = drawing.shapes.iter().any(|shape| winds_oddly(shape, p));
                assert_eq!(held, here, "round {round} at {p}, off {off}: {text}");
                seen[usize::from(here)] += 1;
            }
            assert!(seen[0] > 20, "{seen:?}");
        }
    }
}

/// Boxes that OpenSCAD 2021.01 exports (`openscad -o x.off`, six digits; strokes on a grid): nothing where it makes nothing.
#[test]
fn lengths_with_units_are_what_they_are_to_openscad() {
    let read = |text: &str| {
        let pieces = |_| 8;
        let frame =
            Frame { layer: "", id: "", dpi: 72.0, center: false, origin: DVec2::ZERO, scale: 1.0, pieces: &pieces };
        svg::read(text.as_bytes(), &frame).unwrap_or_else(|(at, e)| panic!("{at}: {e}\n{text}"))
    };
    let bounds = |text: &str| {
        let drawing = read(text);
        let all = || drawing.shapes.iter().flatten().flatten().copied();
        let (low, high) = (all().fold(DVec2::INFINITY, DVec2::min), all().fold(DVec2::NEG_INFINITY, DVec2::max));
        ((high - low).min_element() > 0.0).then_some([low.x, low.y, high.x, high.y])
    };
    let is = |text: &str, expected: Option<[f64; 4]>| match (bounds(text), expected) {
        (Some(found), Some(expected)) => {
            let near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 3e-5 * b.abs().max(1.0));
            assert!(near, "{text}: {found:?}, not {expected:?}");
        }
        (found, expected) => assert_eq!(found, expected, "{text}"),
    };
    // Of the page, which the view box is put on.
    for (unit, expected) in [
        ("", [1.76389, 12.3472, 7.05554, 15.875]),
        ("mm", [5.0, 35.0, 20.0, 45.0]),
        (" mm", [5.0, 35.0, 20.0, 45.0]),
        ("cm", [50.0, 350.0, 200.0, 450.0]),
        ("in", [127.0, 889.0, 508.0, 1143.0]),
        ("pt", [1.76389, 12.3472, 7.05554, 15.875]),
        ("px", [1.32291, 9.26041, 5.29166, 11.9062]),
        ("pc", [21.1667, 148.167, 84.6667, 190.5]),
        ("%", [10.0, 70.0, 40.0, 90.0]),
        ("em", [10.0, 70.0, 40.0, 90.0]),
        ("Q", [3.52777, 24.6944, 14.1111, 31.75]),
    ] {
        let page = format!("width='100{unit}' height='50{unit}' viewBox='0 0 200 100'");
        is(&format!("<svg {page}><rect x='10' y='10' width='30' height='20'/></svg>"), Some(expected));
    }
    // Of what is drawn: they are 0.
    for (element, expected) in [
        ("<rect x='1mm' y='2' width='20' height='10'/>", Some([0.0, 5.63889, 20.0, 15.6389])),
        ("<rect x='abc' y='2' width='20' height='10'/>", Some([0.0, 5.63889, 20.0, 15.6389])),
        ("<rect x='1' y='2' width='20 ' height='10'/>", None),
        ("<rect x='1' y='2' width='30mm' height='20mm'/>", None),
        ("<rect x='1' y='2' width='20' height='10' rx='2mm'/>", Some([1.0, 5.63889, 21.0, 15.6389])),
        ("<circle cx='10' cy='20' r='5%'/>", None),
        ("<ellipse cx='1mm' cy='2' rx='20' ry='10'/>", Some([-20.0, 5.63889, 20.0, 25.6389])),
        ("<ellipse cx='1' cy='2' rx='20mm' ry='10'/>", None),
        ("<line x1='1' y1='2' x2='30mm' y2='5' stroke-width='2px'/>", Some([-0.632492, 12.0064, 1.63249, 16.2714])),
        ("<line x1='1' y1='2' x2='30' y2='5' style='stroke-width:3mm'/>", Some([0.451187, 12.0901, 30.5488, 16.1877])),
        ("<line x1='1' y1='2' x2='30' y2='5' style='stroke-width:3'/>", Some([-0.646393, 10.9925, 31.6464, 17.2853])),
    ] {
        is(&format!("<svg width='100' height='50'>{element}</svg>"), expected);
    }
    // Shapes count wherever they are, but for those that are only defined: elements that OpenSCAD does not know are as if they
    // were not there, with their transforms.
    let rect = "<rect x='1' y='1' width='3' height='5'/>";
    let as_it_is = Some([0.352768, 33.1611, 1.4111, 34.925]);
    for (text, expected) in [
        (rect.to_owned(), as_it_is),
        (format!("<switch><g>{rect}</g></switch>"), as_it_is),
        (format!("<a transform='scale(2)'>{rect}</a>"), as_it_is),
        (format!("<symbol id='s'>{rect}</symbol><use href='#s' x='20'/>"), as_it_is),
        (format!("<clipPath id='c'>{rect}</clipPath>"), as_it_is),
        (format!("<text><tspan>{rect}</tspan></text>"), as_it_is),
        (
            format!(
                "<g transform='scale(2)'><a transform='scale(3)'><g transform='translate(1, 0)'>{rect}</g></a></g>"
            ),
            Some([1.4111, 31.0444, 3.52777, 34.5722]),
        ),
        (
            format!("<rect x='30' y='30' width='1' height='1' transform='scale(2)'>{rect}</rect>"),
            Some([0.352768, 13.4055, 21.8722, 34.925]),
        ),
        (format!("<defs>{rect}</defs>"), None),
        (format!("<defs><symbol id='s'>{rect}</symbol></defs><use href='#s' x='20'/>"), None),
        (format!("<g><defs><g>{rect}</g></defs></g>"), None),
        // OpenSCAD leaves what is only defined at the first end of one.
        (format!("<defs><defs><circle r='9'/></defs>{rect}</defs>"), as_it_is),
        (format!("<defs>{rect}<defs><circle r='9'/></defs></defs>"), None),
    ] {
        is(&format!("<svg width='100' height='100' viewBox='0 0 100 100'>{text}</svg>"), expected);
    }
    // Of several pages the last one counts for all shapes, and where it stands does not.
    for (inner, expected) in [
        ("x='5' y='5' width='50' height='50' viewBox='0 0 100 100'", [1.76389, 3.52777, 12.3472, 15.875]),
        ("", [10.0, -80.0, 70.0, -10.0]),
        ("width='100mm' height='100mm' viewBox='0 0 100 100'", [10.0, 20.0, 70.0, 90.0]),
    ] {
        let shapes = format!(
            "<rect x='10' y='10' width='20' height='20'/><svg {inner}><rect x='50' y='50' width='20' height='30'/></svg>"
        );
        is(&format!("<svg width='100mm' height='100mm' viewBox='0 0 100 100'>{shapes}</svg>"), Some(expected));
    }
    // At random: as if 0 stood there, and counted.
    let mut r = Random::new(41);
    for _ in 0..200 {
        let (mut text, mut plain, mut count) = (String::new(), String::new(), 0);
        for _ in 0..4 {
            let kinds: [(&str, &[&str]); 4] = [
                ("rect", &["x", "y", "width", "height", "rx"]),
                ("circle", &["cx", "cy", "r"]),
                ("ellipse", &["cx", "cy", "rx", "ry"]),
                ("line", &["x1", "y1", "x2", "y2"]),
            ];
            let (kind, names) = kinds[r.below(4)];
            (text, plain) = (format!("{text}<{kind}"), format!("{plain}<{kind}"));
            for name in names {
                let number = r.within(-20.0, 40.0);
                let unit = ["", "", "", "mm", "in", "%", " "][r.below(7)];
                count += usize::from(!unit.is_empty());
                text += &format!(" {name}='{number}{unit}'");
                plain += &format!(" {name}='{}'", if unit.is_empty() { number } else { 0.0 });
            }
            (text, plain) = (text + "/>", plain + "/>");
        }
        let [with, without] = [&text, &plain].map(|t| read(&format!("<svg width='100' height='50'>{t}</svg>")));
        assert_eq!(with.shapes, without.shapes, "{text}");
        assert_eq!(with.zeros.map_or(0, |z| z.1), count, "{text}");
        assert!(without.zeros.is_none(), "{plain}");
    }
}

#[test]
fn what_is_wrong_with_a_file_is_told_with_its_place() {
    let read = |name: &str, bytes: &[u8]| {
        let import = Source::named(name, bytes).import(Facets::Auto, &Limits::default());
        import.err().unwrap_or_else(|| panic!("{name} was read: {:?}", String::from_utf8_lossy(bytes))).to_string()
    };
    let mesh = meshes::prism(&[1.0; 4], 1.0);
    let mut r = Random::new(1);
    // By the first of an ending's writers.
    let written = |ending: &str, r: &mut Random| {
        let writer = WRITERS.iter().find(|w| w.ending == ending).expect("a writer");
        (writer.write)(&[(mesh.clone(), DAffine3::IDENTITY)], r)
    };
    let text = |ending: &str, r: &mut Random| String::from_utf8_lossy(&written(ending, r)).into_owned();
    let (ply, amf, gltf) = (text("ply", &mut r), text("amf", &mut r), text("gltf", &mut r));
    let (threemf, glb) = (written("3mf", &mut r), written("glb", &mut r));
    for (name, bytes, sentence) in [
        ("a.ply", ply.replacen("ply", "plx", 1), "a.ply:1:1: expected ply, found \"plx\""),
        (
            "a.ply",
            ply.replacen("ascii", "utf8", 1),
            "a.ply:2:8: expected ascii, binary_little_endian or binary_big_endian",
        ),
        ("a.ply", ply.replacen("double x", "half x", 1), "a.ply:7:10: expected a kind of number, found \"half\""),
        ("a.ply", ply.replacen("double x", "double u", 1), "a.ply:1:1: expected properties x, y and z of vertex"),
        ("a.ply", ply.replacen("3 0", "3 77", 1), "expected a point's number below 10, found 77 in face "),
        ("a.ply", ply.replacen("3 0", "9e9 0", 1), "expected a list's length from 3 that the file has room for"),
        ("a.ply", ply.replacen("vertex 10", "vertex 900000000", 1), "expected at most 3000000 elements of a mesh"),
        ("a.amf", amf.replace("amf", "fma"), "a.amf:2:1: expected an element amf, found \"fma\""),
        ("a.amf", amf.replacen("<v1>0", "<v1>77", 1), ": expected a vertex's number below 10 as v1, found \"77\""),
        ("a.amf", amf.replacen("<x>", "<x>n", 1), ": expected a finite number as x of coordinates, found \"n"),
        ("a.amf", amf.replacen("objectid=\"0\"", "objectid=\"7\"", 1), ": expected the id of an object, found \"7\""),
        ("a.gltf", gltf.replacen("VEC3", "VEC2", 1), "expected VEC3, not sparse, as accessors[0], found VEC2"),
        ("a.gltf", gltf.replacen("\"mesh\":0", "\"mesh\":7", 1), "a.gltf:1:1: expected a mesh below 1, found 7"),
        ("a.gltf", gltf.replacen("data:", "file:", 1), "a.gltf:1:1: expected data within the file as buffers[0]"),
        ("a.gltf", gltf.replacen("\"scene\":0", "\"scene\":[", 1), "a.gltf:1:"),
        ("a.gltf", gltf.replacen("\"name\":\"all\"", "\"children\":[1]", 1), "expected glTF, found duplicate field"),
        ("a.gltf", gltf.replacen("[0]", "[1]", 1), "expected at most 256 nodes within each other, found more"),
        ("a.3mf", "PK".into(), "a.3mf:1:1: expected a 3MF package, found fewer bytes than an archive has"),
    ] {
        let error = read(name, bytes.as_bytes());
        assert!(error.contains(sentence), "{error}\nnot {sentence}");
    }
    assert!(read("a.3mf", &threemf[..threemf.len() - 30]).contains("expected a 3MF package, found no archive's end"));
    assert!(read("a.glb", &glb[..glb.len() - 30]).contains("bytes of a chunk, found "));
    let few = Limits { mesh_facets: 8, ..Limits::default() };
    for ending in ["ply", "3mf", "amf", "gltf", "glb", "msh", "dae"] {
        let name = format!("a.{ending}");
        let error = Source::named(&name, &written(ending, &mut r))
            .import(Facets::Auto, &few)
            .expect_err("too many")
            .to_string();
        assert!(error.contains("expected at most "), "{error}");
    }
}
