//! The demo as a user runs it: two processes, a thousand steps, and every row of its table solved again by `check`.

use contactd::cache::prepare_scene;
use contactd::check::Check;
use contactd::contact::Outcome;
use contactd::demo::{chosen, play, scene};
use contactd::import::{Facets, Limits, read_scene};
use contactd::ipc::{ServerConfig, embedded};
use std::collections::HashMap;
use std::path::Path;
use std::process::Command;

/// The answer of `check` for a pair of a scene file.
fn checked(scene_file: &Path, a: &str, b: &str) -> Outcome {
    let scene = read_scene(scene_file).unwrap_or_else(|e| panic!("{e}"));
    let models = prepare_scene(None, &scene, Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
    let models: Vec<_> = models.into_iter().map(|p| p.model).collect();
    let mut check = Check::new(&scene, &models, None).unwrap_or_else(|e| panic!("{e}"));
    let outcome = check.step(false).unwrap_or_else(|e| panic!("{e}")).clone();
    let id = |name: &str| scene.objects.iter().position(|o| o.name == name).expect("an object of the scene") as u32;
    let pair = outcome.pairs.iter().find(|p| (p.a, p.b) == (id(a), id(b))).expect("the pair was searched");
    pair.outcome
}

/// Each row has faces of both bodies, by a line of the model's file that names the primitive.
fn faces_stand_in_their_files(text: &str, rows: usize) {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
    let mut faces = 0;
    let words = text.split_whitespace().collect::<Vec<_>>();
    for pair in words.windows(2).filter(|pair| pair[0].contains(".csg:")) {
        let (file, line) = pair[0].split_once(':').expect("file:line");
        let source = std::fs::read_to_string(models.join(file)).expect("a model of the project");
        let line = source.lines().nth(line.parse::<usize>().expect("a line") - 1).expect("a line of the file");
        assert!(line.contains(pair[1].trim_end_matches(',')), "{pair:?}: {line}");
        faces += 1;
    }
    assert!(faces >= 2 * rows, "{faces} faces of {rows} rows");
}

#[test]
fn every_row_of_the_table_is_what_check_says_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let csv = folder.path().join("demo.csv");
    let runtime = folder.path().join("run");
    std::fs::create_dir(&runtime).expect("a runtime folder");
    let output = Command::new(env!("CARGO_BIN_EXE_contactd"))
        .args(["demo", "--csv"])
        .arg(&csv)
        .env("XDG_RUNTIME_DIR", &runtime)
        .output()
        .expect("the demo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("p99.9"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    assert!(!text.contains('\u{1b}'), "colour in a pipe");
    // What does not depend on the machine is what the front page says.
    let readme = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md")).expect("a README");
    let counts: Vec<&str> = text.lines().take(3).collect();
    assert!(readme.contains(&format!("```text\n{}\n", counts.join("\n"))), "{counts:?}");

    // The records as they came through shared memory, exact.
    let file = std::fs::read_to_string(&csv).expect("the contacts");
    let mut sent: HashMap<(String, String, String), Vec<String>> = HashMap::new();
    for line in file.lines().skip(1) {
        let f: Vec<String> = line.split(',').map(String::from).collect();
        sent.insert((f[0].clone(), f[1].clone(), f[2].clone()), f);
    }
    // The same script in this process: the same contacts, and the rows of the table.
    let mut session = embedded(&ServerConfig::default()).expect("an embedded session");
    let run = play(&mut session, |_, _| {}).unwrap_or_else(|e| panic!("{e}"));
    assert!(
        run.steps >= 1000 && 3 * run.steps_with_contact >= run.steps,
        "{} of {}",
        run.steps_with_contact,
        run.steps
    );
    let subtracted = run.rows.iter().filter(|r| r.subtracted).count();
    assert!(2 * subtracted >= run.rows.len(), "{subtracted} of {} on subtracted surfaces", run.rows.len());
    assert_eq!(run.undecided, 0);
    assert_eq!(contactd::demo::csv(&run), file, "shared memory and the embedded session differ");

    let undecided = format!("{} undecided", run.undecided);
    let counted = [format!("{} steps", run.steps), format!("{} with a contact", run.steps_with_contact), undecided];
    assert!(counted.iter().all(|words| counts[0].contains(words)), "{counts:?}");
    assert!(counts[1].starts_with(&format!("{} contacts, {subtracted} of them", run.rows.len())), "{counts:?}");
    let rows = chosen(&run);
    assert!(rows.len() >= 20);
    faces_stand_in_their_files(&text, rows.len());
    for row in rows {
        let [a, b] = &row.names;
        let line = &sent[&(row.step.to_string(), a.clone(), b.clone())];
        assert!(text.contains(&format!("{:.9}", row.record.time)), "step {} is not in the table", row.step);
        let path = scene::write(row.step, folder.path()).unwrap_or_else(|e| panic!("{e}"));
        let o = checked(&path, a, b);
        let bits = |x: f64| format!("{x:?}");
        assert_eq!(line[4..6], [bits(o.time()), bits(o.time_lower())], "step {}", row.step);
        assert_eq!(line[6..8], [o.point().unwrap().kind.name(), o.point().unwrap().extent.name()], "step {}", row.step);
        let vectors: Vec<String> = o
            .point()
            .unwrap()
            .point
            .to_array()
            .into_iter()
            .chain(o.point().unwrap().normal.to_array())
            .map(bits)
            .collect();
        assert_eq!(line[9..15], vectors[..], "step {}", row.step);
    }
}
