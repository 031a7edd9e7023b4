//! The binary as users call it: output, sentences, exit status. `command_line/table.rs` looks at the table, `robots.rs` at joints, `demo.rs`
//! at the demo.
#![allow(missing_docs)]

#[path = "command_line/demo.rs"]
mod demo;
#[path = "command_line/robots.rs"]
mod robots;
#[path = "command_line/table.rs"]
mod table;

use std::path::Path;
use std::process::{Command, Output};

const BALL: &str = "sphere($fn = 0, $fa = 12, $fs = 2, r = 1);\n";

/// Two unit balls four apart; b moves by `travel` towards a.
fn scene(travel: f64) -> String {
    format!(
        "[[model]]\nname = \"ball\"\nfile = \"ball.csg\"\n[[object]]\nname = \"a\"\nmodel = \"ball\"\nmotion = \"static\"\n\
         [[object]]\nname = \"b\"\nmodel = \"ball\"\nstart = {{ position = [4, 0, 0] }}\nend = {{ position = [{}, 0, 0] }}\n",
        4.0 - travel
    )
}

fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).expect("a file");
    }
    folder
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_contactd")).current_dir(folder).args(arguments).output().expect("the binary runs")
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("UTF-8")
}

#[test]
fn check_answers_in_json_and_in_a_table() {
    let folder = folder(&[("ball.csg", BALL), ("s.toml", &scene(4.0))]);
    let out = run(folder.path(), &["check", "s.toml", "--json"]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    assert_eq!(text(&out.stdout).lines().count(), 1);
    let answer: serde_json::Value = serde_json::from_slice(&out.stdout).expect("JSON");
    let pair = &answer["pairs"][0];
    assert_eq!(answer["pairs"].as_array().map(Vec::len), Some(1));
    assert_eq!((&pair["a"], &pair["b"], &pair["status"]), (&"a".into(), &"b".into(), &"contact".into()));
    assert!((pair["time"].as_f64().expect("a time") - 0.5).abs() < 1e-12);
    assert_eq!(pair["features"]["a"][0]["name"], "sphere");
    assert_eq!(answer["safe_time"], pair["time_lower"]);
    let out = run(folder.path(), &["check", "s.toml", "--explain"]);
    assert_eq!(out.status.code(), Some(0));
    for word in ["0.500000000", "contact", "a  ball.csg:1 sphere, surface", "proven clear until t = 0.5", "cells"] {
        assert!(text(&out.stdout).contains(word), "{word} in {}", text(&out.stdout));
    }
}

#[test]
fn a_clear_pair_has_nulls_and_first_leaves_it_out_beside_a_contact() {
    let apart = scene(1.0);
    let three = format!(
        "{}[[object]]\nname = \"c\"\nmodel = \"ball\"\nstart = {{ position = [0, 9, 0] }}\nend = {{ position = [0, 8, 0] }}\n",
        scene(4.0)
    );
    let folder = folder(&[("ball.csg", BALL), ("apart.toml", &apart), ("three.toml", &three)]);
    let answer = |arguments: &[&str]| -> serde_json::Value {
        serde_json::from_slice(&run(folder.path(), arguments).stdout).expect("JSON")
    };
    let clear = &answer(&["check", "apart.toml", "--json"])["pairs"][0];
    assert_eq!(clear["status"], "clear");
    for field in ["point", "normal", "separation", "normal_speed", "kind", "extent", "features"] {
        assert!(clear[field].is_null(), "{field}");
    }
    assert_eq!(answer(&["check", "three.toml", "--json"])["pairs"].as_array().map(Vec::len), Some(3));
    let first = answer(&["check", "three.toml", "--json", "--first"]);
    assert_eq!(first["pairs"].as_array().map(Vec::len), Some(1));
    assert_eq!(first["pairs"][0]["b"], "b");
}

#[test]
fn what_has_no_effect_is_a_line_on_standard_error() {
    let rule = "[[rule]]\nbetween = [\"cell\", \"default\"]\n";
    let empty =
        "[[model]]\nname = \"nothing\"\nfile = \"nothing.csg\"\n[[object]]\nname = \"n\"\nmodel = \"nothing\"\n";
    let text_of = format!("{}{empty}{rule}", scene(4.0));
    let folder = folder(&[("ball.csg", BALL), ("nothing.csg", "group();\n"), ("s.toml", &text_of)]);
    for command in ["check", "inspect"] {
        let out = run(folder.path(), &[command, "s.toml"]);
        assert_eq!(out.status.code(), Some(0));
        assert_eq!(
            text(&out.stderr),
            "contactd: s.toml:20:12: the rule decides for no pair: no object is of the group \"cell\"\n\
             contactd: s.toml:15:8: the model \"nothing\" is empty: nothing can touch it\n",
            "{command}"
        );
    }
}

#[test]
fn what_a_model_of_a_scene_has_lost_is_a_line_on_standard_error() {
    let flat = "polyhedron(points = [[0,0,0],[1,0,0],[0,1,0],[1,1,0]], faces = [[0,1,2],[1,3,2],[2,1,0],[2,3,1]]);\n";
    // What the file itself takes out is no loss.
    let model = format!("{flat}%sphere(r = 9);\n{BALL}{}", "sphere(r = 0);\ncube(0);\ncylinder(h = 0, r = 1);\n");
    let folder = folder(&[("ball.csg", &model), ("s.toml", &scene(4.0))]);
    let out = run(folder.path(), &["check", "s.toml"]);
    assert_eq!(out.status.code(), Some(0));
    let lines: Vec<&str> = text(&out.stderr).lines().collect();
    assert_eq!(lines.len(), 4, "{lines:?}");
    assert!(lines[0].starts_with("contactd: ball.csg:1:1: polyhedron without volume: left out"), "{lines:?}");
    assert!(lines[1].starts_with("contactd: ball.csg:4:1: sphere of no size: left out"), "{lines:?}");
    assert_eq!(lines[3], "contactd: ball.csg: 1 more like these: `contactd inspect` tells all");
}

#[test]
fn what_a_step_refuses_is_told_with_its_place() {
    let fast = format!("dt = 1.0\n{}max_speed = 1.0\n", scene(4.0));
    let coarse = format!("resolution = 1.0\n{}", scene(4.0));
    let folder = folder(&[("ball.csg", BALL), ("fast.toml", &fast), ("coarse.toml", &coarse), ("s.toml", &scene(4.0))]);
    for (arguments, sentence) in [
        (&["check", "fast.toml"][..], "fast.toml:10:8: object \"b\": the motion breaks what was declared"),
        (&["check", "coarse.toml"], "coarse.toml:6:8: the resolution is not a positive length well below"),
        (&["check", "s.toml", "--resolution", "1"], "s.toml:5:8: the resolution is not a positive length well below"),
    ] {
        let out = run(folder.path(), arguments);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}");
        assert!(text(&out.stderr).starts_with(sentence), "{arguments:?}: {}", text(&out.stderr));
        assert_eq!(text(&out.stderr).lines().count(), 1);
    }
}

#[test]
fn arguments_that_would_have_no_effect_are_refused() {
    let folder = folder(&[]);
    for arguments in [
        &["demo", "--scene-of", "3", "--embedded"][..],
        &["demo", "--scene-of", "3", "--csv", "x.csv"],
        &["demo", "--scene-of", "3", "--cache", "off"],
        &["demo", "--scene-of", "3", "--wide"],
        &["demo", "--into", "."],
    ] {
        let out = run(folder.path(), arguments);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}");
        assert!(text(&out.stderr).starts_with("error: "), "{arguments:?}: {}", text(&out.stderr));
    }
    assert!(std::fs::read_dir(folder.path()).expect("a folder").next().is_none(), "nothing was written");
}

#[test]
fn bad_input_is_one_line_and_status_2() {
    let unknown = scene(4.0).replace("model = \"ball\"\nmotion", "model = \"bat\"\nmotion");
    let folder = folder(&[
        ("ball.csg", BALL),
        ("good.toml", &scene(4.0)),
        ("unknown.toml", &unknown),
        ("flat.csg", "union() {\n  roof();\n}\n"),
        ("flat.toml", &scene(4.0).replace("ball.csg", "flat.csg")),
        ("lost.toml", &scene(4.0).replace("ball.csg", "lost.csg")),
    ]);
    std::fs::write(folder.path().join("bytes.csg"), b"cube(\xff1);").expect("a file");
    let table: [(&[&str], &str); 7] = [
        (&["check", "unknown.toml"], "unknown.toml:6:9: expected the name of a model, found \"bat\""),
        (&["check", "flat.toml"], "flat.csg:2:3: expected a supported construct, found roof, which"),
        (&["inspect", "flat.csg"], "flat.csg:2:3: expected a supported construct, found roof, which"),
        (&["inspect", "bytes.csg"], "bytes.csg:1:6: expected text in UTF-8, found the byte 0xff"),
        (&["check", "lost.toml"], "lost.toml:3:8: expected a model file, found lost.csg: "),
        (&["check", "none.toml"], "none.toml: expected a readable file, found "),
        (&["check", "good.toml", "--resolution", "0.6"], "good.toml:5:8: the resolution is not a positive length"),
    ];
    for (arguments, sentence) in table {
        let out = run(folder.path(), arguments);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}");
        assert!(text(&out.stderr).starts_with(sentence), "{arguments:?}: {}", text(&out.stderr));
        assert_eq!(text(&out.stderr).lines().count(), 1, "{}", text(&out.stderr));
        assert!(out.stdout.is_empty());
    }
    assert_eq!(run(folder.path(), &["check", "good.toml", "--resolution", "-1"]).status.code(), Some(2));
    assert_eq!(run(folder.path(), &["inspect", "ball.csg", "--facets", "some"]).status.code(), Some(2));
}

#[test]
fn a_cache_changes_nothing_that_is_reported() {
    let folder = folder(&[("ball.csg", BALL), ("s.toml", &scene(4.0))]);
    let kept = || {
        let files = std::fs::read_dir(folder.path().join("kept")).into_iter().flatten().flatten();
        files.map(|f| f.path()).collect::<Vec<_>>()
    };
    let plain = run(folder.path(), &["check", "s.toml", "--json"]);
    run(folder.path(), &["check", "s.toml", "--json", "--cache", "off"]);
    assert!(kept().is_empty() && !folder.path().join("off").exists());
    for arguments in [&["check", "s.toml", "--json", "--cache", "kept"][..]; 2] {
        let out = run(folder.path(), arguments);
        assert_eq!((out.status.code(), out.stderr.len()), (Some(0), 0), "{}", text(&out.stderr));
        assert_eq!(text(&out.stdout), text(&plain.stdout));
        assert_eq!(kept().len(), 1);
    }
    let inspected = run(folder.path(), &["inspect", "ball.csg", "--cache", "kept"]).stdout;
    assert_eq!(inspected, run(folder.path(), &["inspect", "ball.csg"]).stdout);
    assert_eq!(kept().len(), 1, "one text, one file, whoever asks");
    // A file that is no longer what it was is told, and replaced.
    let good = std::fs::read(&kept()[0]).expect("the kept model");
    std::fs::write(&kept()[0], &good[..good.len() - 1]).expect("a damaged file");
    let out = run(folder.path(), &["check", "s.toml", "--json", "--cache", "kept"]);
    assert_eq!((out.status.code(), text(&out.stdout)), (Some(0), text(&plain.stdout)));
    assert!(text(&out.stderr).starts_with("contactd: kept/"), "{}", text(&out.stderr));
    assert!(text(&out.stderr).ends_with("expected a kept model, found damage; the model is imported anew\n"));
    assert!(std::fs::read(&kept()[0]).expect("the kept model") == good);
    // A folder that can't be one is told, too; both with the answers as they are.
    let out = run(folder.path(), &["check", "s.toml", "--json", "--cache", "ball.csg/kept"]);
    assert_eq!((out.status.code(), text(&out.stdout)), (Some(0), text(&plain.stdout)));
    assert!(text(&out.stderr).contains("expected a folder for preprocessed models"), "{}", text(&out.stderr));
    assert_eq!(text(&out.stderr).lines().count(), 1);
}

#[test]
fn inspect_tells_what_was_imported_and_how() {
    let model = "difference() {\n  cube(size = [4, 4, 1], center = true);\n  cylinder($fn = 6, h = 2, r1 = 1, r2 = 1, center = true);\n}\n";
    let folder = folder(&[("m.csg", model), ("ball.csg", BALL), ("s.toml", &scene(4.0))]);
    let out = run(folder.path(), &["inspect", "m.csg"]);
    assert_eq!(out.status.code(), Some(0));
    for line in [
        "m.csg",
        "  2 primitives, 14 faces, 3 nodes, 2 levels",
        "         1 polyhedron (1 subtracted)",
        "  note: 3:3: cylinder taken as OpenSCAD's polyhedron of 6 sides",
        "    difference",
        "      0 cube box 4 x 4 x 1 at 2:3",
        "      1 cylinder polyhedron 8 faces at 3:3",
    ] {
        assert!(text(&out.stdout).lines().any(|l| l == line), "{line:?} in\n{}", text(&out.stdout));
    }
    // 16 less a hexagonal prism of circumradius 1; planes alone, so the bound is rounding.
    let mass = |out: &[u8]| {
        let lines: Vec<&str> = text(out).lines().skip_while(|l| !l.starts_with("  mass ")).collect();
        let end = lines.iter().position(|l| l.starts_with("  tree")).expect("the tree is last");
        lines[..end].join("\n")
    };
    let line = mass(&out.stdout);
    assert!(line.starts_with("  mass volume 13.4019237886") && line.contains("centre [0, 0, 0]"), "{line}");
    assert!(line.contains("inertia [") && text(&out.stdout).lines().all(|l| l.chars().count() <= 80), "{line}");
    let ball = mass(&run(folder.path(), &["inspect", "ball.csg"]).stdout);
    assert!(ball.contains("at density 1,") && ball.ends_with("closed form"), "{ball}");
    let exact = run(folder.path(), &["inspect", "m.csg", "--facets", "exact"]);
    assert!(text(&exact.stdout).contains("1 cylinder r 1, h 2 at 3:3"), "{}", text(&exact.stdout));
    let scene = run(folder.path(), &["inspect", "s.toml"]);
    assert!(text(&scene.stdout).contains("  object b: model ball, group default, translating"));
}

/// What cannot be written is no success, whichever page it is; and what a name would do to a terminal it does not do in an error either.
#[test]
fn output_that_is_lost_is_told_and_names_in_errors_are_clean() {
    let folder = folder(&[("ball.csg", BALL), ("s.toml", &scene(4.0))]);
    for arguments in [&["--help"] as &[&str], &["--version"], &["check", "s.toml"], &["completions", "bash"]] {
        let full = std::fs::File::options().write(true).open("/dev/full").expect("a device that is full");
        let mut command = Command::new(env!("CARGO_BIN_EXE_contactd"));
        let out = command.current_dir(folder.path()).args(arguments).stdout(full).output().expect("the binary runs");
        assert_eq!(out.status.code(), Some(2), "{arguments:?}");
        let said = text(&out.stderr);
        assert!(said.starts_with("standard output: expected to write, found: No space left on device"), "{said}");
    }
    let out = run(folder.path(), &["inspect", "\u{1b}[31mred.csg"]);
    let said = text(&out.stderr);
    assert!(out.status.code() == Some(2) && said.starts_with("\u{fffd}[31mred.csg: "), "{said:?}");
    let out = run(folder.path(), &["serve", "--deadline", "99999999999"]);
    let said = text(&out.stderr);
    assert!(out.status.code() == Some(2) && said.contains("2147483648"), "{said:?}");
}
