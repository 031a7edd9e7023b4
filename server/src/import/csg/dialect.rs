//! OpenSCAD's kinds of nodes with all their arguments, one by one: each is read, changes no shape whatever its value, or
//! is refused with its place. Nothing is dropped in silence.

use crate::import::{Facets, Import, Limits, import_csg};
use crate::math::random::Random;

/// What becomes of an argument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fate {
    /// It shapes the solid: two values make two solids, and a value of the wrong type is refused.
    Read(&'static str, &'static str),
    /// Whatever its value, the solid is the same.
    Harmless,
    /// Refused at its own place.
    Refused,
}
pub(crate) use Fate::{Harmless, Read, Refused};

/// A kind of node that is supported: its name, arguments that make something of it, what is inside of it, and every argument
/// that OpenSCAD writes or reads for it (the node's `toString` and its module's parameters, 2015.03 to the snapshots of 2026).
pub(crate) struct Construct {
    pub(crate) name: &'static str,
    arguments: &'static [(&'static str, &'static str)],
    inside: &'static str,
    pub(crate) fates: &'static [(&'static str, Fate)],
}

const CURVES: [(&str, Fate); 4] = [("$fn", Read("3", "4")), ("$fa", Harmless), ("$fs", Harmless), ("$fe", Harmless)];
/// Of texts an eighth of the pieces counts.
const TEXT: [(&str, Fate); 4] =
    [("$fn", Read("8", "80")), ("$fa", Read("10", "60")), ("$fs", Read("1", "20")), ("$fe", Harmless)];
const ARCS: [(&str, Fate); 4] = [("$fn", Read("4", "7")), ("$fa", Harmless), ("$fs", Harmless), ("$fe", Harmless)];
const FLAT: [(&str, Fate); 4] = [("$fn", Harmless), ("$fa", Harmless), ("$fs", Harmless), ("$fe", Harmless)];
const BALL: &str = "{ sphere(r = 1); cube(size = [1, 1, 1]); }";
const SQUARE: &str = "{ square(size = [1, 2]); }";
const FILE: [(&str, Fate); 4] = [("file", Refused), ("layer", Refused), ("origin", Refused), ("timestamp", Refused)];
/// Written for drawings of other files by rotate_extrude, and without one by old versions of OpenSCAD.
const WITHOUT_FILE: [&str; 3] = ["layer", "origin", "timestamp"];

pub(crate) const KINDS: [Construct; 23] = [
    Construct { name: "group", arguments: &[], inside: BALL, fates: &[] },
    Construct { name: "union", arguments: &[], inside: BALL, fates: &[] },
    Construct { name: "difference", arguments: &[], inside: BALL, fates: &[] },
    Construct { name: "intersection", arguments: &[], inside: BALL, fates: &[] },
    Construct { name: "render", arguments: &[], inside: BALL, fates: &[] },
    Construct { name: "color", arguments: &[], inside: BALL, fates: &[("c", Harmless), ("alpha", Harmless)] },
    Construct {
        name: "multmatrix",
        arguments: &[("m", "[[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]")],
        inside: BALL,
        fates: &[(
            "m",
            Read(
                "[[1, 0, 0, 3], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]",
                "[[1, 0, 0, 3], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 2]]",
            ),
        )],
    },
    Construct {
        name: "linear_extrude",
        arguments: &[("height", "2")],
        inside: SQUARE,
        fates: &[
            ("height", Read("3", "4")),
            ("center", Read("true", "false")),
            ("scale", Read("2", "[3, 3]")),
            ("v", Read("[1, 0, 1]", "[0, 1, 1]")),
            ("twist", Read("4", "5")),
            ("slices", Harmless),
            ("segments", Harmless),
            ("h", Refused),
        ],
    },
    Construct {
        name: "rotate_extrude",
        arguments: &[],
        inside: SQUARE,
        fates: &[
            ("angle", Read("90", "91")),
            ("start", Harmless),
            ("origin", Harmless),
            ("scale", Harmless),
            ("layer", Harmless),
            ("timestamp", Harmless),
            ("h", Refused),
        ],
    },
    Construct { name: "hull", arguments: &[], inside: BALL, fates: &[] },
    Construct { name: "minkowski", arguments: &[], inside: BALL, fates: &[] },
    Construct {
        name: "offset",
        arguments: &[("r", "1")],
        inside: SQUARE,
        fates: &[("r", Read("2", "3")), ("delta", Harmless)],
    },
    Construct {
        name: "sphere",
        arguments: &[("r", "1")],
        inside: ";",
        fates: &[("r", Read("1", "2")), ("d", Refused)],
    },
    Construct {
        name: "cylinder",
        arguments: &[("h", "1"), ("r1", "1"), ("r2", "1")],
        inside: ";",
        fates: &[
            ("h", Read("1", "2")),
            ("r1", Read("1", "2")),
            ("r2", Read("1", "2")),
            ("center", Read("true", "false")),
            ("r", Refused),
            ("d", Refused),
            ("d1", Refused),
            ("d2", Refused),
        ],
    },
    Construct {
        name: "cube",
        arguments: &[("size", "[1, 2, 3]")],
        inside: ";",
        fates: &[("size", Read("1", "[1, 1, 2]")), ("center", Read("true", "false"))],
    },
    Construct {
        name: "polyhedron",
        arguments: &[
            ("points", "[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]"),
            ("faces", "[[0, 1, 2], [0, 3, 1], [1, 3, 2], [0, 2, 3]]"),
        ],
        inside: ";",
        fates: &[
            (
                "points",
                Read("[[0, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 1]]", "[[0, 0, 0], [3, 0, 0], [0, 1, 0], [0, 0, 1]]"),
            ),
            ("faces", Read("[[0, 1, 2], [0, 3, 1], [1, 3, 2], [0, 2, 3]]", "[[0, 1, 2]]")),
            ("triangles", Refused),
        ],
    },
    Construct {
        name: "circle",
        arguments: &[("r", "1")],
        inside: ";",
        fates: &[("r", Read("1", "2")), ("d", Refused)],
    },
    Construct {
        name: "square",
        arguments: &[("size", "[1, 2]")],
        inside: ";",
        fates: &[("size", Read("1", "[1, 3]")), ("center", Read("true", "false"))],
    },
    Construct {
        name: "polygon",
        arguments: &[("points", "[[0, 0], [1, 0], [0, 1], [5, 5]]"), ("paths", "[[0, 1, 2]]")],
        inside: ";",
        fates: &[
            ("points", Read("[[0, 0], [1, 0], [0, 1], [5, 5]]", "[[0, 0], [2, 0], [0, 1], [5, 5]]")),
            ("paths", Read("[[0, 1, 2]]", "[[0, 1, 3]]")),
        ],
    },
    Construct {
        name: "text",
        arguments: &[("text", "\"aV\"")],
        inside: ";",
        fates: &[
            ("text", Read("\"a\"", "\"b\"")),
            ("size", Read("9", "11")),
            ("spacing", Read("1", "2")),
            ("font", Read("\"Hack\"", "\"Arial\"")),
            ("halign", Read("\"right\"", "\"center\"")),
            ("valign", Read("\"top\"", "\"center\"")),
            ("direction", Read("\"ttb\"", "\"ltr\"")),
            ("language", Harmless),
            ("script", Harmless),
            ("em", Refused),
        ],
    },
    Construct {
        name: "projection",
        arguments: &[],
        inside: "{ sphere(r = 1); multmatrix([[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]]) { cube(1); } }",
        fates: &[("cut", Read("true", "false"))],
    },
    Construct { name: "fill", arguments: &[], inside: "{ difference() { square(3); circle(r = 1); } }", fates: &[] },
    Construct {
        name: "resize",
        arguments: &[("newsize", "[1, 2, 0]")],
        inside: "{ cube(size = [1, 1, 1]); }",
        fates: &[("newsize", Read("[2, 3, 4]", "[3, 3, 4]")), ("auto", Read("true", "[0, 0, 0]"))],
    },
];

/// Kinds of nodes and modules of OpenSCAD that make or change shapes in ways that are not imported.
const REFUSED: [&str; 20] = [
    "roof",
    "import",
    "surface",
    "import_stl",
    "import_off",
    "import_dxf",
    "dxf_linear_extrude",
    "dxf_rotate_extrude",
    "cgaladv",
    "subdiv",
    "glide",
    "for",
    "intersection_for",
    "if",
    "let",
    "assign",
    "echo",
    "assert",
    "children",
    "child",
];

/// Values of every type.
const ANY: [&str; 10] = ["0", "7", "-1", "0.5", "inf", "nan", "true", "undef", "\"a\"", "[1, [2]]"];

/// The text of a call in its place, on line 2.
fn text(kind: &Construct, changed: Option<(&str, &str)>) -> String {
    let mut arguments: Vec<(&str, &str)> = kind.arguments.to_vec();
    if let Some((name, value)) = changed {
        arguments.retain(|a| a.0 != name);
        arguments.push((name, value));
    }
    let arguments: Vec<String> = arguments.iter().map(|(n, v)| format!("{n} = {v}")).collect();
    let call = format!("{}({}) {}", kind.name, arguments.join(", "), kind.inside);
    match kind.name {
        "circle" | "square" | "polygon" | "offset" | "text" | "projection" | "fill" => {
            format!("linear_extrude(height = 1) {{\n{call}\n}}")
        }
        _ => format!("\n{call}"),
    }
}

fn read(text: &str) -> Result<Import, String> {
    import_csg("m.csg", text, Facets::Auto, &Limits::default()).map_err(|e| e.to_string())
}

/// The solid with the places of its primitives left out, for these change with the text.
fn solid(text: &str) -> Result<String, String> {
    let mut solid = read(text)?.solid;
    solid.primitives.iter_mut().for_each(|p| p.label.column = 0);
    Ok(format!("{solid:?}"))
}

/// Line 2, and the column of `word` there.
fn place(text: &str, word: &str) -> String {
    let line = text.lines().nth(1).unwrap_or_default();
    format!("m.csg:2:{}: ", line.find(word).map_or(0, |i| i + 1))
}

#[test]
fn every_argument_is_read_without_effect_or_refused() {
    for kind in &KINDS {
        let plain = solid(&text(kind, None)).unwrap_or_else(|e| panic!("{}: {e}", kind.name));
        let curved = matches!(kind.name, "sphere" | "cylinder" | "circle" | "rotate_extrude");
        let everywhere = if kind.name == "text" {
            TEXT
        } else if curved {
            CURVES
        } else if kind.name == "offset" {
            ARCS
        } else {
            FLAT
        };
        let old = |f: &&(&str, Fate)| !(kind.name == "rotate_extrude" && WITHOUT_FILE.contains(&f.0));
        let fates =
            kind.fates.iter().chain(&everywhere).chain(FILE.iter().filter(old)).chain(&[("convexity", Harmless)]);
        for (name, fate) in fates.chain(&[("$fx", Refused), ("colour", Refused), ("chamfer", Refused)]) {
            if kind.name == "offset" && *name == "chamfer" {
                continue;
            }
            match fate {
                Read(one, two) => {
                    let [a, b] = [one, two].map(|v| solid(&text(kind, Some((name, v)))));
                    assert_ne!(a, b, "{name} of {}", kind.name);
                    let wrong = if one.starts_with('"') { "[1]" } else { "\"a\"" };
                    let words = text(kind, Some((name, wrong)));
                    let error = read(&words).err().unwrap_or_else(|| panic!("{words}: was read"));
                    assert!(error.starts_with("m.csg:2:"), "{words}: {error}");
                }
                Harmless => {
                    for value in ANY {
                        let words = text(kind, Some((name, value)));
                        assert_eq!(solid(&words).as_ref(), Ok(&plain), "{words}");
                    }
                }
                Refused => {
                    for value in ANY {
                        let words = text(kind, Some((name, value)));
                        let error = read(&words).err().unwrap_or_else(|| panic!("{words}: was read"));
                        assert!(error.starts_with(&place(&words, &format!("{name} = "))), "{words}: {error}");
                    }
                }
            }
        }
    }
}

#[test]
fn every_other_kind_is_refused_with_its_place_and_what_to_do() {
    for name in REFUSED {
        for call in ["()", "(file = \"x.dxf\");", "(1, [2], a = 3)", "(convexity = 1) { sphere(r = 1); }"] {
            let end = if call.ends_with(')') { ";" } else { "" };
            for around in [["union() {\n", "}"], ["linear_extrude(height = 1) {\n", "}"], ["\n", ""]] {
                let words = format!("{}{name}{call}{end}{}", around[0], around[1]);
                let error = read(&words).err().unwrap_or_else(|| panic!("{words}: was read"));
                let expected = format!("m.csg:2:1: expected a supported construct, found {name}");
                assert!(error.starts_with(&expected), "{words}: {error}");
                let reported = error.contains("not supported (");
                assert!(
                    reported || ["cgaladv", "subdiv", "glide"].contains(&name) || name.starts_with("dxf"),
                    "{error}"
                );
            }
        }
    }
    assert_eq!(
        read("union() {\n  linear_extrude(file = \"part.dxf\", layer = \"0\", height = 3);\n}").unwrap_err(),
        "m.csg:2:3: expected a supported construct, found linear_extrude, which is not supported (a text that is \
         sent names no files: send the mesh itself, by its format)"
    );
}

#[test]
fn the_experimental_curve_setting_counts_where_curves_are_cut() {
    let ball = |facets| import_csg("m.csg", "sphere(r = 5, $fe = 0.1);", facets, &Limits::default());
    assert!(ball(Facets::Exact).is_ok() && ball(Facets::Auto).is_ok());
    assert!(ball(Facets::AsWritten).unwrap_err().to_string().starts_with("m.csg:1:1: "));
}

#[test]
fn what_is_left_out_is_reported() {
    for (text, note) in [
        ("%sphere(r = 1);cube(1);", "1:2: sphere after %: left out, as OpenSCAD does"),
        ("cube(1);\n*hull() { sphere(r = 1); }", "2:2: hull after *: left out, as OpenSCAD does"),
        ("cube(1); group() { !sphere(r = 1); }", "1:21: sphere after !: the model is this call alone"),
        (
            "group() { !sphere(r = 1); } group() { !cube(1); }",
            "1:40: a second !: without effect, the first one counts, as in OpenSCAD",
        ),
        ("cube(1); linear_extrude(height = 1);", "1:10: linear_extrude without a shape inside: nothing is there"),
        ("cube(1); rotate_extrude();", "1:10: rotate_extrude without a shape inside: nothing is there"),
        ("cube(1); sphere(r = 0);", "1:10: sphere of no size: left out, as OpenSCAD does"),
        ("cube(1); cylinder(h = 1, r1 = -1, r2 = 1);", "1:10: cylinder of no size: left out, as OpenSCAD does"),
        ("cube(1); cube([1, 0, 1]);", "1:10: cube of no size: left out, as OpenSCAD does"),
        (
            "cube(1); polyhedron(points = [], faces = []);",
            "1:10: polyhedron without volume: left out, as OpenSCAD does",
        ),
        ("cube(1); linear_extrude(height = 0) { circle(1); }", "1:10: linear_extrude of no height: left out"),
        ("cube(1); linear_extrude(height = 1) { circle(0); }", "1:39: circle of no size: left out, as OpenSCAD does"),
        ("cube(1); linear_extrude(height = 1) { polygon([]); }", "1:39: polygon without area: left out"),
        (
            "cube(1); intersection() { cube(2); circle(1); }",
            "1:10: an intersection of solids with a 2D shape: nothing is left, as OpenSCAD has it",
        ),
        ("cube(1); sphere(r = -nan);", "1:10: sphere of no size: left out, as OpenSCAD does"),
        ("cube(1); sphere(r = inf);", "1:10: sphere of infinite size: left out, as OpenSCAD does"),
        ("cube(1); cube([nan, 1, 1]);", "1:10: cube of no size: left out, as OpenSCAD does"),
        ("cube(1); cylinder(h = inf, r1 = 1, r2 = 1);", "1:10: cylinder of infinite size: left out"),
        ("cube(1); cylinder(h = 1, r1 = -inf, r2 = 0);", "1:10: cylinder of no size: left out"),
        ("cube(1); linear_extrude(height = 1) { square([1, inf]); }", "1:39: square of infinite size: left out"),
        (
            "cube(1); linear_extrude(height = 1) { offset(r = -nan) { square(1); } }",
            "1:39: offset by no finite distance",
        ),
        ("cube(1); linear_extrude(height = 1) { text(text = \"a\", size = -nan); }", "1:39: text of no finite size"),
        (
            "cube(1); multmatrix([[1,0,0,nan],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) { cube(2); }",
            "1:10: multmatrix that holds no finite numbers: left out, as OpenSCAD does",
        ),
        (
            "cube(1); multmatrix([[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,0]]) { cube(2); }",
            "1:10: multmatrix with a 0 as its last number: left out, as OpenSCAD does",
        ),
        (
            "multmatrix([[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,-0.02,1]]) { cube(1); }",
            "1:12: the last row of a matrix begins with other numbers than 0: ignored, as OpenSCAD does (by 2.0e-2)",
        ),
        ("cube(1); polyhedron(points = undef, faces = undef);", "1:10: polyhedron without points: left out"),
        (
            "cube(1); polyhedron([[0,0,0],[0,1,0],[1,0,0],[0,0,nan]], [[0,2,1],[0,1,3],[1,2,3],[2,0,3]]);",
            "1:10: polyhedron whose point 3 is a list that holds nan: left out, as OpenSCAD does",
        ),
        (
            "cube(1); linear_extrude(height = 1) { polygon([undef, [0,0], [2,0], [0,2]]); }",
            "1:39: polygon whose point 0 is undef: left out, as OpenSCAD does",
        ),
        (
            "linear_extrude(height = 1) { polygon([[0,0],[2,0],[0,2]], [[0,1.5,undef,2]]); }",
            "1:30: a polygon whose paths name 2 points by no whole number: cut off, as OpenSCAD does",
        ),
        (
            "cube(1); linear_extrude(height = 1) { polygon([[0, 0], [2, 0], [1, 0]]); }",
            "1:39: a polygon without area: left out, as OpenSCAD does",
        ),
        ("cube(1); linear_extrude(height = 1) { cube(2); }", "1:39: cube inside of a 2D shape: left out"),
        ("group() { square(1); }", "1:11: square outside of linear_extrude: a 2D shape, without volume (OpenSCAD: "),
        (
            "polyhedron([[0,0,0],[0,1,0],[1,1,0],[1,0,0],[0.5,0.5,0.5]], [[0,1,2],[0,2,3],[0,1,4],[1,2,4],[2,3,4],[3,0,4]]);",
            "1:1: a polyhedron with 2 faces that run the other way round than their neighbours: turned",
        ),
        (
            "polyhedron([[0,0,0],[0,1,0],[1,0,0],[0,0,1]], [[0,2,1],[0,1,3,4],[1,2,3],[2,0,3],[4,4]]);",
            "1:1: a polyhedron whose faces name 3 points that it has not: left out, as OpenSCAD does",
        ),
        (
            "linear_extrude(height = 1) { polygon(points = [[0,0],[2,0],[0,2]], paths = [[0,1,2,3]]); }",
            "1:30: a polygon whose paths name 1 points that it has not: left out, as OpenSCAD does",
        ),
        ("cube(1); group() { cube(2); square(1); }", "1:29: square among solids: a 2D shape, left out"),
        (
            "cube(1); group() { hull() { circle(1); } cube(2); }",
            "1:29: circle among solids, as the first: all solids beside it left out",
        ),
        (
            "cube(1); multmatrix([[1,0,0,0],[0,1,0,0],[0,0,0,0],[0,0,0,1]]) { cube(1); }",
            "1:10: multmatrix that flattens what is inside of it: left out, as OpenSCAD does",
        ),
        (
            "linear_extrude(height = 1) { polygon([[0, 0], [2, 2], [2, 0], [0, 2]]); }",
            "1:30: a polygon whose sides cross: filled by the even-odd rule, as OpenSCAD does",
        ),
        ("hull() { cylinder(1, 1, 1); cube(3); }", "1:1: hull: faceted, "),
        (
            "multmatrix([[1,0,0,0],[0,2,0,0],[0,0,1,0],[0,0,0,1]]) { sphere(1); }",
            "1:57: non-uniform scale on a sphere: an ellipsoid, exact",
        ),
        ("cube(1); hull() { linear_extrude(height = 1) { hull() { } } }", "1:48: a hull without area: left out"),
        (
            "cube(1); intersection() { cube(1); group(); }",
            "1:10: an intersection with nothing: left out with all that is inside",
        ),
        (
            "cube(1); difference() { group(); cube(1); }",
            "1:10: a difference from nothing: left out with all that is inside",
        ),
        (
            "linear_extrude(height = 1) { multmatrix([[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]]) { circle(r = 1); } }",
            "1:41: a matrix inside of linear_extrude that moves along z: ignored, as OpenSCAD does (by 3.0e0)",
        ),
        (
            "linear_extrude(height = 1) { polygon(points = [[0, 0], [1, 0.000001], [2, 0], [2, 2], [0, 2]]); }",
            "1:30: a polygon that is not quite convex: taken as the hull of its sides",
        ),
        (
            "multmatrix([[1,0.000001,0,0],[0,2,0,0],[0,0,3,0],[0,0,0,1]]) { cube(1); }",
            "1:64: a transform that would bend a box a little: taken as one that does not",
        ),
        (
            "multmatrix([[1,0,0,0],[0,1.000001,0,0],[0,0,3,0],[0,0,0,1]]) { cylinder(1, 1, 1); }",
            "1:64: a transform that would bend a cylinder a little: taken as one that does not",
        ),
        (
            "multmatrix([[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) { multmatrix([[0.5,0,0,0],[0,1.000001,0,0],[0,0,1,0],\
             [0,0,0,1]]) { sphere(1); } }",
            "1:122: a transform that would bend a sphere a little: taken as one that does not",
        ),
    ] {
        let notes: Vec<String> = read(text).expect(text).notes.iter().map(ToString::to_string).collect();
        assert!(notes.iter().any(|n| n.starts_with(note)), "{text}: {notes:?}");
    }
    // And where nothing is, nothing is told.
    for text in [
        "cube(1); group(); union() { } difference() { } intersection() { } #sphere(r = 1);",
        "difference() { cube(1); group(); }",
    ] {
        assert_eq!(read(text).expect(text).notes, vec![], "{text}");
    }
}

/// Anything that a list may hold and that is no point and no index.
fn junk(r: &mut Random) -> &'static str {
    ["undef", "\"a\"", "true", "[]", "[1]", "nan", "[1, nan, 2]", "[1, 2, 3, 4]", "-inf", "[\"x\", 1, 2]"]
        [(r.unit() * 10.0) as usize]
}

#[test]
fn whatever_openscad_writes_of_a_polyhedron_is_read_as_it_reads_it() {
    let mut r = Random(20);
    for round in 0..200 {
        // A pyramid over a ring, its points in a random order among others that no face names.
        let n = 3 + (r.unit() * 5.0) as usize;
        let mut corners: Vec<[f64; 3]> = (0..n)
            .map(|i| {
                let (s, c) = libm::sincos(std::f64::consts::TAU * (i as f64 + r.within(0.0, 0.4)) / n as f64);
                [c * 2.0, s * 2.0, 0.0]
            })
            .collect();
        corners.push([0.0, 0.0, 3.0]);
        let mut faces: Vec<Vec<usize>> = (0..n).map(|i| vec![(i + 1) % n, i, n]).collect();
        faces.push((0..n).collect());
        let plain = format!("polyhedron(points = {corners:?}, faces = {faces:?});");

        let (mut points, mut place): (Vec<String>, Vec<usize>) = (Vec::new(), Vec::new());
        for c in &corners {
            while r.unit() < 0.3 {
                points.push(junk(&mut r).into());
            }
            place.push(points.len());
            // A point without z is one at z = 0.
            points.push(if c[2] == 0.0 && r.unit() < 0.3 {
                format!("[{:?}, {:?}]", c[0], c[1])
            } else {
                format!("{c:?}")
            });
        }
        let mut lists: Vec<String> = Vec::new();
        for face in &faces {
            if r.unit() < 0.3 {
                lists.push(["undef", "5", "[]", "[0]", "[0, 0]", "\"a\""][(r.unit() * 6.0) as usize].into());
            }
            let mut list: Vec<String> = face.iter().map(|i| place[*i].to_string()).collect();
            for i in 0..list.len() {
                if r.unit() < 0.2 {
                    list[i] = format!("{}.{}", list[i], 1 + (r.unit() * 8.0) as usize);
                }
            }
            if r.unit() < 0.3 {
                let beyond = ["-1", "-7.5", "1000", "nan", "inf"][(r.unit() * 5.0) as usize];
                list.insert((r.unit() * list.len() as f64) as usize, beyond.into());
            }
            lists.push(format!("[{}]", list.join(", ")));
        }
        let text = |points: &[String]| {
            format!("polyhedron(points = [{}], faces = [{}]);", points.join(", "), lists.join(", "))
        };
        let written = text(&points);
        assert_eq!(solid(&written).unwrap_or_else(|e| panic!("{written}: {e}")), solid(&plain).expect("a pyramid"));
        // One that is named must be a point.
        points[place[round % corners.len()]] = junk(&mut r).into();
        let import = read(&text(&points)).expect("nothing");
        assert!(import.solid.is_empty(), "{}", text(&points));
        let which = format!("polyhedron whose point {} is", place[round % corners.len()]);
        assert!(import.notes.iter().any(|n| n.text.starts_with(&which)), "{which}: {:?}", import.notes);
    }
}

#[test]
fn a_text_is_read_as_openscad_writes_it_without_escapes() {
    let mut r = Random(21);
    let mut quoted = 0;
    for _ in 0..60 {
        let mut raw = String::new();
        for _ in 0..1 + (r.unit() * 7.0) as usize {
            // A backslash before anything but what an escape may be.
            raw.push_str(["a", "3", "\"", ", ", "\\a", ")", "+", "b"][(r.unit() * 8.0) as usize]);
        }
        quoted += usize::from(raw.contains('"'));
        let escaped = raw.replace('\\', "\\\\").replace('"', "\\\"");
        let call = |text: &str| {
            let font = "size = 10, spacing = 1, font = \"\", direction = \"ltr\", language = \"en\", script = \"Latn\"";
            format!("linear_extrude(height = 1) {{ text(text = \"{text}\", {font}, halign = \"left\", $fn = 8); }}")
        };
        let (as_written, as_meant) = (solid(&call(&raw)), solid(&call(&escaped)));
        assert_eq!(as_written.unwrap_or_else(|e| panic!("{raw}: {e}")), as_meant.expect("escaped"), "{raw}");
    }
    assert!(quoted > 15, "{quoted}");
}

#[test]
fn a_spike_of_slivers_is_part_of_the_solid() {
    // A cube of side 2 whose top carries a needle 3 high, its walls so thin that no normal can be taken of them.
    let points = "[[-1,-1,-1],[1,-1,-1],[1,1,-1],[-1,1,-1],[-1,-1,1],[1,-1,1],[1,1,1],[-1,1,1],[0,0,1],[1e-7,0,1],[0,1e-7,1],\
                  [0,0,4]]";
    let faces = "[[0,1,2,3],[0,4,5,1],[1,5,6,2],[2,6,7,3],[3,7,4,0],[4,8,9,5],[5,9,6],[6,9,10,7],[7,10,8,4],[8,11,9],[9,11,10],\
                 [10,11,8]]";
    let text = format!("polyhedron(points = {points}, faces = {faces});");
    let solid = read(&text).expect("a needle on a cube").solid;
    let inside = |x: f64, y: f64, z: f64| solid.value(glam::DVec3::new(x, y, z)) < 0.0;
    assert!(inside(0.1, 0.1, 0.5) && inside(2e-8, 2e-8, 2.0) && inside(1e-8, 1e-8, 3.0));
    assert!(
        !inside(1e-6, 1e-6, 2.0) && !inside(-1e-8, 2e-8, 2.0) && !inside(2e-8, 2e-8, 4.1) && !inside(0.1, 0.1, 1.1)
    );
}

#[test]
fn a_foil_is_part_of_the_solid_whatever_it_is_made_by() {
    // 2 x 2 and a millionth thick: as thin as what six digits of its size may be off, but told exactly.
    let points = "[[-1,-1,0],[1,-1,0],[1,1,0],[-1,1,0],[-1,-1,1e-6],[1,-1,1e-6],[1,1,1e-6],[-1,1,1e-6]]";
    let faces = "[[0,1,2,3],[7,6,5,4],[0,4,5,1],[1,5,6,2],[2,6,7,3],[3,7,4,0]]";
    let foil = format!("polyhedron(points = {points}, faces = {faces});");
    let upright = "multmatrix([[1,0,0,-1],[0,0,-1,1],[0,1,0,0],[0,0,0,1]])";
    let sliver = "linear_extrude(height = 2) polygon(points = [[0,0],[2,0],[2,1e-6],[0,1e-6]]);";
    for text in [
        foil.clone(),
        format!("hull() {{ {foil} }}"),
        "minkowski() { cube([1,1,1e-6], center = true); multmatrix([[1,0,0,0],[0,1,0,0],[0,0,1,5e-7],[0,0,0,1]]) \
         cube([1,1,1e-9], center = true); }"
            .to_owned(),
        format!("{upright} {sliver}"),
    ] {
        let whole = format!("union() {{ {text} translate([3,0,0]) cube(1); }}");
        let import = read(&whole).unwrap_or_else(|e| panic!("{text}: {e}"));
        assert!(!import.notes.iter().any(|n| n.is_loss()), "{text}: {:?}", import.notes);
        let inside = |z: f64| import.solid.value(glam::DVec3::new(0.2, 0.3, z)) < 0.0;
        assert!(inside(5e-7) && !inside(2e-6) && !inside(-1e-6), "{text}");
    }
}
