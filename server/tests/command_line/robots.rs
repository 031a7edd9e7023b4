//! What is said of joints, of files that robots name, and of worlds, as users say it.

use super::{folder, run, text};

/// A hinge and a slide, whose names have what names may have; a slide that follows the other one.
const ROBOT: &str = "<robot name=\"r\"><link name=\"base\"><collision><geometry><sphere radius=\"0.1\"/></geometry></collision></link>\n\
    <link name=\"arm\"/><link name=\"t&#10;ip\"><collision><origin xyz=\"2 0 0\"/><geometry><sphere radius=\"0.1\"/></geometry></collision></link>\n\
    <link name=\"f\"/><joint name=\"a, b\" type=\"continuous\"><parent link=\"base\"/><child link=\"arm\"/></joint>\
    <joint name=\"s&#10;lide\" type=\"prismatic\"><parent link=\"arm\"/><child link=\"t&#10;ip\"/><limit lower=\"-1\" upper=\"1\"/></joint>\
    <joint name=\"finger\" type=\"prismatic\"><parent link=\"base\"/><child link=\"f\"/><limit lower=\"-1\" upper=\"1\"/>\
    <mimic joint=\"s&#10;lide\" multiplier=\"2\"/></joint></robot>";

#[test]
fn values_have_units_that_their_joints_take() {
    let folder = folder(&[("r.urdf", ROBOT)]);
    let check = |joints: &str| {
        let out = run(folder.path(), &["check", "r.urdf", "--joints", joints]);
        (out.status.code(), text(&out.stderr).to_owned())
    };
    for joints in ["a, b=0.25turns", "a, b=3deg,s\nlide=5mm", "s\nlide=0.1,a, b=1rad", "a, b=1", "s\nlide=2cm"] {
        assert_eq!(check(joints), (Some(0), String::new()), "{joints}");
    }
    for (joints, words) in [
        ("a, b=3mm", "r.urdf: expected an angle (rad, deg, turns) for a, b, which turns, found a length in mm"),
        ("s\nlide=3deg", "which slides, found an angle in deg"),
        ("s\nlide=3", "expected -1 to 1 as s\\nlide, found 3"),
        ("s\nlide=0.8", "expected -1 to 1 as finger, which follows s\\nlide, found 1.6"),
        ("finger=0", "expected a value of s\\nlide, which finger follows"),
        ("c=0", "expected one of the joints a, b, s\\nlide, found \"c\""),
        ("a, b", "expected JOINT=VALUE"),
        ("a, b=1,", "expected JOINT=VALUE"),
    ] {
        let (status, said) = check(joints);
        assert_eq!(status, Some(2), "{joints}: {said}");
        assert!(said.contains(words), "{joints}: {said}");
    }
    let clearance = |range: &str| {
        let out = run(folder.path(), &["clearance", "r.urdf", "--range", range]);
        (out.status.code(), text(&out.stderr).to_owned())
    };
    assert_eq!(clearance("a, b=0..1turns"), (Some(0), String::new()));
    for (range, words) in [
        ("s\nlide=0..1deg", "r.urdf: expected a length (m, cm, mm) for"),
        ("a, b=0mm..1", "r.urdf: expected an angle"),
        ("q=0..1", "r.urdf: expected a range of one of the joints"),
        ("s\nlide=0..2", "r.urdf: expected a range within -1 to 1"),
        ("s\nlide=0..0.8", "which follows it, within -1 to 1, found 0 to 1.6"),
    ] {
        let (status, said) = clearance(range);
        assert!(status == Some(2) && said.contains(words), "{range}: {said}");
    }
}

/// As MuJoCo 4.0 compiles it: `jnt_limited` is false of such a joint.
#[test]
fn joints_without_a_limit_have_none_and_are_told() {
    let bare = ROBOT.replace("<limit lower=\"-1\" upper=\"1\"/>", "");
    let folder = folder(&[("r.urdf", &bare)]);
    let out = run(folder.path(), &["inspect", "r.urdf", "--joints", "s\nlide=30"]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    let told = text(&out.stderr);
    let notes = told.lines().filter(|l| l.ends_with("has no limit: it is taken without limits")).count();
    assert!(notes == 2 && told.contains("r.urdf:3:"), "{told}");
}

#[test]
fn names_break_no_line() {
    let folder = folder(&[("r.urdf", ROBOT)]);
    let out = run(folder.path(), &["inspect", "r.urdf"]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    let said = text(&out.stdout);
    assert!(said.contains("s\u{fffd}lide") && said.contains("t\u{fffd}ip"), "{said}");
    assert!(!said.lines().any(|l| l.trim_start().starts_with("lide") || l.trim_start().starts_with("ip")), "{said}");
    let floating = ROBOT.replace("continuous", "floating").replace("a, b", "a&#10;b");
    std::fs::write(folder.path().join("f.urdf"), floating).expect("written");
    let out = run(folder.path(), &["check", "f.urdf"]);
    assert_eq!(text(&out.stderr).lines().count(), 1, "{}", text(&out.stderr));
}

#[test]
fn what_a_setup_leaves_out_is_told() {
    let volumes = "<volume name=\"v\"><solidref ref=\"s\"/></volume><volume name=\"w\"><solidref ref=\"b\"/><physvol name=\"p\"><volumeref ref=\"v\"/>\
                   </physvol></volume><volume name=\"other\"><solidref ref=\"s\"/><physvol name=\"q\"><volumeref ref=\"w\"/></physvol></volume>";
    let whole = format!(
        "<gdml><solids><orb name=\"s\" r=\"1\"/><box name=\"b\" x=\"3\" y=\"3\" z=\"3\"/></solids><structure>{volumes}</structure>\n\
         <setup name=\"Second\"><world ref=\"other\"/></setup>\n<setup name=\"Default\"><world ref=\"w\"/></setup></gdml>"
    );
    let folder = folder(&[("g.gdml", &whole), ("o.gdml", &whole.replace("\"Default\"", "\"Third\""))]);
    let out = run(folder.path(), &["overlaps", "g.gdml"]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stdout));
    let said = text(&out.stderr);
    assert!(said.contains("g.gdml:2:1: the setup \"Second\" is left out"), "{said}");
    assert!(
        said.contains("\"other\" is left out: it is not in the world \"w\"") && said.lines().count() == 2,
        "{said}"
    );
    // Without one called Default the first one counts: the box of 3 sticks out of the ball.
    let out = run(folder.path(), &["overlaps", "o.gdml"]);
    assert_eq!(out.status.code(), Some(1), "{}", text(&out.stdout));
}

/// What is noted of a text that stands for a solid is told of the solid, where the file has it.
#[test]
fn solids_in_facets_and_what_is_left_out_are_told_by_the_names_of_the_file() {
    let of = |name: &str, more: &str| format!("<volume name=\"{name}\"><solidref ref=\"{name}s\"/>{more}</volume>");
    let placed = |name: &str, x: f64| {
        format!("<physvol name=\"p{name}\"><volumeref ref=\"{name}\"/><position x=\"{x}\" y=\"0\" z=\"0\"/></physvol>")
    };
    let points: String = ["0 0", "9 0", "0 9", "9 9"]
        .iter()
        .enumerate()
        .map(|(k, xy)| {
            let (x, y) = xy.split_once(' ').expect("two");
            format!("<position name=\"p{k}\" x=\"{x}\" y=\"{y}\" z=\"0\"/>")
        })
        .collect();
    let solids = "<torus name=\"ring\" rmin=\"0\" rmax=\"20\" rtor=\"100\" deltaphi=\"360\" aunit=\"deg\"/>\n\
                  <scaledSolid name=\"As\"><solidref ref=\"ring\"/><scale name=\"q\" x=\"1\" y=\"1\" z=\"2\"/></scaledSolid>\n\
                  <tet name=\"flat\" vertex1=\"p0\" vertex2=\"p1\" vertex3=\"p2\" vertex4=\"p3\"/>\n\
                  <box name=\"cube\" x=\"9\" y=\"9\" z=\"9\"/><union name=\"Bs\"><first ref=\"cube\"/><second ref=\"flat\"/></union>\n\
                  <box name=\"Ws\" x=\"900\" y=\"900\" z=\"900\"/>";
    let structure = of("A", "") + &of("B", "") + &of("W", &(placed("A", 0.0) + &placed("B", 124.4)));
    let text_of = format!(
        "<gdml><define>{points}</define>\n<solids>{solids}</solids>\n<structure>{structure}</structure></gdml>"
    );
    let folder = folder(&[("g.gdml", &text_of)]);
    let out = run(folder.path(), &["overlaps", "g.gdml"]);
    let said = text(&out.stderr);
    assert_eq!(said, "contactd: g.gdml:4:1: the tet \"flat\" without volume: left out\n", "{said}");
    let said = text(&out.stdout).split_whitespace().collect::<Vec<_>>().join(" ");
    // 20 mm · (1 − cos 1°) · 2, rounded up.
    let words = "the torus ring of A is taken in 180 facets, at most 0.0061 mm off: all here allows for that";
    assert!(out.status.code() == Some(1) && said.contains(words), "{said}");
    let out = run(folder.path(), &["overlaps", "g.gdml", "--json"]);
    let answer: serde_json::Value = serde_json::from_str(text(&out.stdout)).expect("JSON");
    let wanted = serde_json::json!([
        { "volume": "A", "kind": "torus", "solid": "ring", "facets": 180, "deviation": 0.0061 }
    ]);
    assert_eq!(answer["faceted"], wanted);
    let off = 20.0 * (1.0 - 1f64.to_radians().cos()) * 2.0;
    assert!(off < 0.0061 && off > 0.0060, "{off}");
}

#[test]
fn a_geometry_is_no_scene_and_the_sentence_says_what_takes_it() {
    let geometry = "<gdml><solids><orb name=\"s\" r=\"1\"/></solids><structure><volume name=\"v\"><solidref ref=\"s\"/></volume></structure>\
                    <setup name=\"Default\"><world ref=\"v\"/></setup></gdml>";
    let folder = folder(&[("g.gdml", geometry), ("r.urdf", ROBOT)]);
    for arguments in
        [vec!["inspect", "g.gdml"], vec!["check", "g.gdml"], vec!["view", "g.gdml"], vec!["check", "r.urdf", "g.gdml"]]
    {
        let out = run(folder.path(), &arguments);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}");
        let said = text(&out.stderr);
        let words =
            "g.gdml: expected a scene, a robot or a model, found a GDML geometry, which contactd overlaps takes";
        assert!(said.contains(words) && said.lines().count() == 1, "{arguments:?}: {said}");
    }
    assert_eq!(run(folder.path(), &["overlaps", "g.gdml"]).status.code(), Some(0));
}

/// Empty or not: what is no model by its name is none, and a sentence begins with a file's name or none.
#[test]
fn what_is_no_model_is_refused_by_name() {
    let folder = folder(&[("run.mcap", ""), ("part.step", ""), ("a.csg", "cube(1);")]);
    std::fs::write(folder.path().join("full.mcap"), b"\x89MCAP0\r\n").unwrap();
    for (arguments, words) in [
        (vec!["check", "full.mcap", "a.csg"], "full.mcap: expected one of the formats csg, stl, "),
        (vec!["check", "run.mcap", "a.csg"], "found a recording (contactd replay repeats it)"),
        (vec!["inspect", "run.mcap"], "found a recording (contactd replay repeats it)"),
        (vec!["overlaps", "a.csg", "part.step"], "part.step: expected one of the formats csg, stl, "),
        (vec!["inspect", "part.step"], "found a CAD file (export a mesh, such as STL or 3MF, or OpenSCAD's CSG)"),
        (vec!["check", "a.csg", "a.csg", "--resolution", "1e300"], "a.csg: the resolution is not a positive length"),
    ] {
        let out = run(folder.path(), &arguments);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}");
        let said = text(&out.stderr);
        assert!(said.contains(words) && said.lines().count() == 1 && !said.contains(":1:1"), "{arguments:?}: {said}");
    }
}

#[test]
fn cells_of_openmc_that_overlap_and_gaps_are_told() {
    let fuel = include_str!("../../models/fuel.xml");
    // The rod is as wide as its tube, and a pin's water begins too far out.
    let wide = fuel.replace("0 0 0.433", "0 0 0.5625");
    let far = fuel.replace("material=\"3\" region=\"3\"", "material=\"3\" region=\"3 6\"");
    let folder = folder(&[("fuel.xml", fuel), ("wide.xml", &wide), ("far.xml", &far)]);
    let of = |file: &str, more: &[&str]| {
        let out = run(folder.path(), &[&["overlaps", file, "--tolerance", "1e-6"], more].concat());
        (out.status.code(), text(&out.stdout).to_owned(), text(&out.stderr).to_owned())
    };
    let (status, said, wrong) = of("fuel.xml", &[]);
    assert_eq!((status, wrong.as_str()), (Some(0), ""), "{said}");
    assert!(said.starts_with("0 overlaps, 0 not proven, 12 pairs proven separate"), "{said}");
    let (status, said, _) = of("wide.xml", &[]);
    let words = "cell 5 \"rod\" and cell 7 \"tube\", in universe 2: at least 0.00075 cm deep at (";
    assert!(status == Some(1) && said.split_whitespace().collect::<Vec<_>>().join(" ").contains(words), "{said}");
    let (status, said, _) = of("far.xml", &["--json"]);
    let answer: serde_json::Value = serde_json::from_str(&said).expect("JSON");
    let pair = &answer["pairs"][0];
    assert_eq!(
        (status, &pair["kind"], &pair["a"], &pair["b"]),
        (Some(1), &"gap".into(), &"universe 1".into(), &().into())
    );
    // Between 0.475 and 0.602.
    assert!((pair["depth"].as_f64().expect("a depth") - 0.0635).abs() < 1e-3, "{said}");
    for word in ["inspect", "check", "view"] {
        let out = run(folder.path(), &[word, "fuel.xml"]);
        let said = text(&out.stderr);
        let words = "found an OpenMC geometry, which contactd overlaps takes";
        assert!(out.status.code() == Some(2) && said.contains(words) && said.lines().count() == 1, "{word}: {said}");
    }
}

#[test]
fn a_step_begins_at_a_keyframe() {
    let model = "<mujoco><worldbody><geom size=\"0.5\"/><body name=\"a\" pos=\"3 0 0\"><joint name=\"p\" type=\"slide\" axis=\"1 0 0\" \
                 range=\"-3 3\"/><geom size=\"0.5\"/></body></worldbody><keyframe><key name=\"near\" qpos=\"-1.5\"/><key name=\"far\" \
                 qpos=\"4\"/></keyframe></mujoco>";
    let folder = folder(&[("m.xml", model), ("r.urdf", ROBOT)]);
    let check = |file: &str, joints: &str, to: &str| {
        let out = run(folder.path(), &["check", file, "--json", "--joints", joints, "--to", to]);
        (out.status.code(), text(&out.stdout).to_owned(), text(&out.stderr).to_owned())
    };
    // From 1.5 apart, with 1 of it the balls' radii, to 0.5: they touch in the middle.
    let (status, said, wrong) = check("m.xml", "key:near", "p=-2.5");
    assert_eq!(status, Some(0), "{wrong}");
    let answer: serde_json::Value = serde_json::from_str(&said).expect("JSON");
    assert!((answer["pairs"][0]["time"].as_f64().expect("a time") - 0.5).abs() < 1e-12, "{said}");
    // A value that is told counts more than the keyframe's.
    let (_, said, _) = check("m.xml", "key:near,p=-1", "p=-3");
    let answer: serde_json::Value = serde_json::from_str(&said).expect("JSON");
    assert!((answer["pairs"][0]["time"].as_f64().expect("a time") - 0.5).abs() < 1e-12, "{said}");
    for (file, joints, to, words) in [
        ("m.xml", "key:none", "p=0", "m.xml:1:1: expected one of the keyframes near, far, found key:none"),
        ("m.xml", "key:far", "p=0", "expected -3 to 3 as p of the keyframe, found \"4\""),
        ("m.xml", "key:near,key:far", "p=0", "expected one keyframe in --joints, found two"),
        ("m.xml", "p=0", "key:near", "expected a keyframe in --joints, where the step begins, found one in --to"),
        ("r.urdf", "key:near", "a, b=0", "r.urdf:1:1: expected MJCF, which has keyframes, found key:near"),
    ] {
        let (status, _, said) = check(file, joints, to);
        assert!(status == Some(2) && said.contains(words), "{joints}: {said}");
    }
}

/// Two balls of 0.1 m whose middles are 0.05 m apart, but for what a joint, a file or a rule says of them.
#[test]
fn overlaps_are_asked_of_the_pairs_that_are_tested() {
    let ball = "<collision><geometry><sphere radius=\"0.1\"/></geometry></collision>";
    let robot = format!(
        "<robot name=\"r\"><link name=\"a\">{ball}</link><link name=\"hub\"/><link name=\"b\">{ball}</link>\
         <joint name=\"f\" type=\"fixed\"><parent link=\"a\"/><child link=\"hub\"/></joint>\
         <joint name=\"s\" type=\"prismatic\"><parent link=\"hub\"/><child link=\"b\"/><axis xyz=\"1 0 0\"/>\
         <limit lower=\"0\" upper=\"1\"/></joint></robot>"
    );
    let srdf = "<robot name=\"r\"><disable_collisions link1=\"a\" link2=\"b\" reason=\"Never\"/></robot>";
    let scene = |rule: &str| {
        let object = |name: &str, x: f64| {
            format!(
                "[[object]]\nname = \"{name}\"\nmodel = \"ball\"\ngroup = \"g\"\nstart = {{ position = [{x}, 0.0, 0.0] }}\n"
            )
        };
        format!(
            "unit = \"m\"\n[[model]]\nname = \"ball\"\nfile = \"ball.csg\"\n{}{}[[rule]]\nbetween = [\"g\", \"g\"]\n{rule}\n",
            object("a", 0.0),
            object("b", 0.05)
        )
    };
    let (off, except) = ("detect = \"off\"", "except = [[\"a\", \"b\"]]");
    let (off, except, on) = (scene(off), scene(except), scene("report = \"contact\""));
    let ball = "sphere($fn = 0, $fa = 12, $fs = 2, r = 0.1);";
    let files = [("r.urdf", &*robot), ("r.srdf", srdf), ("ball.csg", ball)];
    let folder = folder(&[&files[..], &[("off.toml", &*off), ("except.toml", &*except), ("on.toml", &*on)]].concat());
    for (words, status, said) in [
        (&["r.urdf", "--joints", "s=0.05"][..], 1, "a and b: at least 0.075 m deep"),
        (&["r.urdf", "--joints", "s=0.3"], 0, "1 pairs proven separate"),
        (&["r.urdf", "--joints", "s=0.05", "--srdf", "r.srdf"], 0, "1 pair left out by rules"),
        (&["r.urdf", "--joints", "s=0.05", "--ignore-touching"], 0, "1 pair left out by rules"),
        (&["on.toml"], 1, "a and b: at least 0.075 m deep"),
        (&["off.toml"], 0, "1 pair left out by rules"),
        (&["except.toml"], 0, "1 pair left out by rules"),
        (&["r.urdf", "--to", "s=0.05"], 2, "expected --joints in place of --to"),
    ] {
        let out = run(folder.path(), &[&["overlaps"], words].concat());
        let told = format!("{}{}", text(&out.stdout), text(&out.stderr));
        assert!(out.status.code() == Some(status) && told.contains(said), "{words:?}: {told}");
    }
}

/// Beside what is far larger a body is thinner than what rounding leaves untold: it is not proven apart; and static objects that are in
/// each other are nothing that `check` looks at.
#[test]
fn what_is_not_looked_at_is_not_told_apart() {
    let scene = "[[model]]\nname=\"m\"\nfile=\"ball.csg\"\n[[object]]\nname=\"a\"\nmodel=\"m\"\nmotion=\"static\"\n\
                 [[object]]\nname=\"b\"\nmodel=\"m\"\nmotion=\"static\"\n";
    let files = [
        ("world.csg", "sphere($fn = 0, r = 1e10);"),
        ("ball.csg", "sphere($fn = 0, r = 1);"),
        ("tiny.csg", "sphere($fn = 0, r = 1e-320);"),
        ("both.toml", scene),
    ];
    let folder = folder(&files);
    for pair in [["world.csg", "ball.csg"], ["ball.csg", "tiny.csg"]] {
        let out = run(folder.path(), &[&["overlaps"], &pair[..]].concat());
        let said = text(&out.stdout);
        assert!(said.starts_with("0 overlaps, 1 not proven") && out.status.code() == Some(3), "{pair:?}: {said}");
    }
    let out = run(folder.path(), &["overlaps", "ball.csg", "ball.csg"]);
    assert_eq!(out.status.code(), Some(1), "{}", text(&out.stdout));
    let said = run(folder.path(), &["check", "both.toml"]);
    assert!(
        text(&said.stdout).contains("static objects are not asked about with each other"),
        "{}",
        text(&said.stdout)
    );
    assert_eq!(run(folder.path(), &["overlaps", "both.toml"]).status.code(), Some(1));
}
