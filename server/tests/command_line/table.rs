//! The table of `check`, on the project's scenes and on names that nobody chose: it fits 80 columns, says what the JSON says, and
//! tells no noise.

use super::{BALL, folder, run, text};
use proptest::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Columns of a terminal.
const COLUMNS: usize = 80;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The project's own scenes: of the cases every fifth, or all where `CONTACTD_TABLES` is set.
fn scenes() -> Vec<PathBuf> {
    let apart = if std::env::var_os("CONTACTD_TABLES").is_some() { 1 } else { 5 };
    let list = |folder: &str| std::fs::read_dir(root().join(folder)).expect("a folder").flatten().map(|e| e.path());
    let models = list("server/models").filter(|p| p.extension().is_some_and(|e| e == "toml"));
    let mut cases: Vec<PathBuf> = list("tests/cases").map(|p| p.join("scene.toml")).filter(|p| p.is_file()).collect();
    cases.sort();
    assert!(cases.len() > 90, "{} cases", cases.len());
    let mut scenes: Vec<PathBuf> = models.chain(cases.into_iter().step_by(apart)).collect();
    scenes.sort();
    scenes
}

/// What `check` prints of a scene.
fn check(scene: &Path, arguments: &[&str]) -> String {
    let file = scene.to_str().expect("a path in UTF-8");
    let out = run(&root(), &[&["check", file], arguments].concat());
    assert!([Some(0), Some(3)].contains(&out.status.code()), "{file}: {}", text(&out.stderr));
    text(&out.stdout).to_owned()
}

fn json(scene: &Path) -> Value {
    serde_json::from_str(&check(scene, &["--json"])).expect("JSON")
}

fn fits(table: &str) {
    for line in table.lines() {
        assert!(line.chars().count() <= COLUMNS, "{} columns: {line}", line.chars().count());
        assert!(!line.contains('\u{1b}'), "colour in a pipe: {line:?}");
    }
}

/// The number in front of a word of the summary; 0 where it is not told.
fn count(summary: &str, word: &str) -> usize {
    let words: Vec<&str> = summary.split([' ', ',', ':']).filter(|w| !w.is_empty()).collect();
    let at = words.iter().skip(1).position(|w| w.trim_end_matches('s') == word);
    at.and_then(|k| words[k].parse().ok()).unwrap_or(0)
}

/// The sentence in front of the table, in one line.
fn summary(table: &str) -> String {
    table.lines().take_while(|l| !l.is_empty()).map(str::trim).collect::<Vec<_>>().join(" ")
}

fn says_what_the_json_says(table: &str, answer: &Value) {
    let pairs = answer["pairs"].as_array().expect("pairs");
    let summary = summary(table);
    assert_eq!(count(&summary, "pair"), pairs.len(), "{summary}");
    for status in ["contact", "overlap", "undecided", "clear"] {
        let n = pairs.iter().filter(|p| p["status"] == status).count();
        assert_eq!(count(&summary, status), n, "{status}: {summary}");
    }
}

/// Faces as the table tells them: (file, line, words).
fn faces(table: &str) -> Vec<(String, usize, String)> {
    let mut joined = String::new();
    for line in table.lines() {
        match line.strip_prefix("    a  ").or_else(|| line.strip_prefix("    b  ")) {
            Some(rest) => joined += &format!("\n{rest}"),
            None if line.starts_with("       ") => joined += &format!(" {}", line.trim()),
            None => {}
        }
    }
    let face = |text: &str| {
        let (place, words) = text.trim().split_once(' ').expect("a place and words");
        let (file, line) = place.rsplit_once(':').expect("file:line");
        (file.to_owned(), line.parse().expect("a line"), words.to_owned())
    };
    joined.lines().filter(|l| !l.is_empty()).flat_map(|l| l.split(';').map(face).collect::<Vec<_>>()).collect()
}

/// Each face of the JSON is there in its order, by a line of its file that names its primitive.
fn names_the_faces(table: &str, answer: &Value, folder: &Path) {
    let pairs = answer["pairs"].as_array().expect("pairs");
    let features =
        pairs.iter().filter(|p| p["features"].is_object()).flat_map(|p| [&p["features"]["a"], &p["features"]["b"]]);
    let expected: Vec<&Value> = features.flat_map(|side| side.as_array().expect("faces")).collect();
    let told = faces(table);
    assert_eq!(told.len(), expected.len(), "{table}");
    for ((file, line, words), feature) in told.iter().zip(expected) {
        let word = |key: &str| feature[key].as_str().expect("a word").to_owned();
        let cut = if feature["sense"] == "negative" { " (subtracted)" } else { "" };
        assert_eq!(*words, format!("{}, {}{cut}", word("name"), word("face")));
        let source = std::fs::read_to_string(folder.join(file)).expect("the model's file");
        let there = source.lines().nth(line - 1).expect("a line of the file");
        assert!(there.contains(&word("name")), "{file}:{line}: {there}");
    }
}

/// No number is a negative zero, and none smaller than what the answer knows.
fn has_no_noise(table: &str, answer: &Value) {
    let resolution = |p: &Value| p["resolution"].as_f64().expect("a resolution");
    let finest = answer["pairs"].as_array().expect("pairs").iter().map(resolution).fold(1e-6, f64::min);
    for word in table.split([' ', ',', '(', ')', '\n']).filter(|w| !w.is_empty()) {
        let Ok(x) = word.parse::<f64>() else { continue };
        assert!(!(x == 0.0 && word.starts_with('-')), "{word} in {table}");
        assert!((x == 0.0 || x.abs() >= finest || !word.contains('e')), "{word} in {table}");
        let digits = word.trim_start_matches("-").chars().filter(char::is_ascii_digit).count();
        assert!(digits <= 11, "{word} in {table}");
    }
}

#[test]
fn the_project_s_scenes_fit_80_columns_and_say_what_the_json_says() {
    let scenes = scenes();
    let (all, mut contacts, mut undecided) = (scenes.len(), 0, 0);
    for scene in scenes {
        let answer = json(&scene);
        let [table, all] = [&[][..], &["--all"]].map(|arguments| check(&scene, arguments));
        for table in [&table, &all] {
            fits(table);
            says_what_the_json_says(table, &answer);
            names_the_faces(table, &answer, scene.parent().expect("its folder"));
            has_no_noise(table, &answer);
        }
        contacts += count(&summary(&table), "contact");
        undecided += count(&summary(&table), "undecided");
        // Every pair has a row in --all, and what the other table leaves out is clear.
        let rows = |table: &str, status: &str| {
            table.lines().filter(|l| !l.starts_with(' ') && l.split_whitespace().nth(1) == Some(status)).count()
        };
        for (status, is_listed) in [("contact", true), ("overlap", true), ("undecided", true), ("clear", false)] {
            let n = count(&summary(&all), status);
            assert_eq!(rows(&all, status), n, "{all}");
            assert!(rows(&table, status) == n || !is_listed, "{table}");
        }
        fits(&check(&scene, &["--explain"]));
    }
    assert!(2 * contacts > all, "{contacts} contacts and {undecided} undecided of {all} scenes");
}

#[test]
fn the_wide_table_has_nine_digits_and_no_noise_either() {
    let scene = root().join("server/models/assembly.toml");
    let (answer, wide) = (json(&scene), check(&scene, &["--wide", "--all"]));
    says_what_the_json_says(&wide, &answer);
    assert!(!wide.contains("-0.000000000") && !wide.contains("e-1"), "{wide}");
    let digits = |x: &Value| format!("{:.9}", x.as_f64().expect("a number"));
    for pair in answer["pairs"].as_array().expect("pairs").iter().filter(|p| p["status"] == "contact") {
        let line = |l: &&str| l.contains(pair["a"].as_str().unwrap()) && l.contains(pair["b"].as_str().unwrap());
        let row = wide.lines().find(line).expect("a row");
        for told in [&pair["time"], &pair["normal_speed"], &pair["point"][0], &pair["normal"][1]] {
            assert!(row.contains(digits(told).trim_start_matches('-')), "{told} in {row}");
        }
    }
}

#[test]
fn colour_is_for_terminals_and_for_who_asks() {
    let scene = super::scene(4.0);
    let folder = folder(&[("ball.csg", BALL), ("s.toml", &scene)]);
    let printed = |arguments: &[&str], no_color: Option<&str>| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_contactd"));
        command.current_dir(folder.path()).args(["check", "s.toml"]).args(arguments).env_remove("NO_COLOR");
        let out = command.envs(no_color.map(|value| ("NO_COLOR", value))).output().expect("the binary runs");
        assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
        text(&out.stdout).to_owned()
    };
    let plain = printed(&[], None);
    assert!(!plain.contains('\u{1b}') && plain.contains("contact"));
    let coloured = printed(&["--color", "always"], Some("1"));
    assert!(coloured.contains("\u{1b}["), "{coloured:?}");
    // Colour is all that it adds.
    let mut bare = String::new();
    for (k, part) in coloured.split('\u{1b}').enumerate() {
        bare += if k == 0 { part } else { part.split_once('m').expect("an escape").1 };
    }
    assert_eq!(bare, plain);
    assert_eq!(printed(&["--color", "never"], None), plain);
    assert!(!printed(&["--json", "--color", "always"], None).contains('\u{1b}'));
    let out = run(folder.path(), &["check", "s.toml", "--color", "sometimes"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("[possible values: auto, always, never]"), "{}", text(&out.stderr));
}

#[test]
fn what_touches_is_listed_though_it_is_clear() {
    let cube = |z: f64| format!("multmatrix([[1,0,0,0],[0,1,0,0],[0,0,1,{z}],[0,0,0,1]]) {{ cube(size = 1); }}\n");
    let folder = folder(&[("box.csg", &cube(0.0)), ("lid.csg", &cube(1.0)), ("far.csg", &cube(9.0))]);
    let out = run(folder.path(), &["check", "box.csg", "lid.csg", "far.csg"]);
    let table = text(&out.stdout);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    assert!(table.starts_with("3 pairs: 3 clear (1 touching), proven clear for the whole step\n"), "{table}");
    assert!(table.contains("touching, at (") && table.contains("a  box.csg:1 cube, +z"), "{table}");
    assert!(table.ends_with("\n2 clear pairs are not listed (--all)\n"), "{table}");
    fits(table);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Names are whatever a text may hold, files whatever a folder may.
    #[test]
    fn names_of_any_length_and_script_fit_and_are_whole_in_the_json(
        names in proptest::collection::hash_set(".{1,120}", 3),
        file in "[a-zà-þ一-十 _-]{1,60}",
        travel in 1.0..4.0f64,
    ) {
        let names: Vec<String> = names.into_iter().collect();
        let quoted = |name: &str| toml::Value::String(name.into()).to_string();
        let file = format!("{file}.csg");
        let mut scene = format!("[[model]]\nname = \"ball\"\nfile = {}\n", quoted(&file));
        for (k, name) in names.iter().enumerate() {
            scene += &format!("[[object]]\nname = {}\nmodel = \"ball\"\nstart = {{ position = [{}, 0, 0] }}\n", quoted(name), 4 * k);
            scene += &format!("end = {{ position = [{}, 0, 0] }}\n", 4.0 * k as f64 - travel * k as f64);
        }
        let folder = folder(&[(&file, BALL), ("s.toml", &scene)]);
        let scene = folder.path().join("s.toml");
        let answer = json(&scene);
        let told: Vec<&str> = answer["pairs"].as_array().unwrap().iter().flat_map(|p| [&p["a"], &p["b"]]).map(|n| n.as_str().unwrap()).collect();
        prop_assert!(names.iter().all(|name| told.contains(&name.as_str())), "{told:?}");
        let table = check(&scene, &["--all"]);
        for line in table.split('\n') {
            prop_assert!(line.chars().count() <= COLUMNS, "{} columns: {line}", line.chars().count());
            prop_assert!(!line.contains(char::is_control), "{line:?}");
        }
        says_what_the_json_says(&table, &answer);
        // The ends of a long name stay.
        let is_plain = |name: &&String| name.chars().all(|c| c.is_alphanumeric());
        for name in names.iter().filter(is_plain) {
            let head: String = name.chars().take(5).collect();
            prop_assert!(table.contains(&head), "{head} in {table}");
        }
    }
}
