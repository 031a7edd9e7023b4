//! The project's models: each `.csg` is what its `.scad` says, and the flattener that holds them together writes what
//! OpenSCAD writes.

use contactd_tests::openscad::flatten;
use std::path::{Path, PathBuf};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// `.scad` files of a folder, in order.
fn sources(name: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder(name)).unwrap().map(|f| f.unwrap().path()).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "scad"));
    files.sort();
    assert!(!files.is_empty());
    files
}

#[test]
fn the_flattener_reproduces_what_openscad_wrote() {
    let mut compared = 0;
    for scad in sources("openscad") {
        let source = read(&scad);
        let stem = scad.file_stem().unwrap().to_str().unwrap();
        for (part, name) in [(0.0, format!("{stem}.csg")), (1.0, format!("{stem}_b.csg"))] {
            let dump = scad.with_file_name(name);
            if dump.exists() {
                assert_eq!(
                    flatten(&source, &[("part", part)]).unwrap(),
                    read(&dump).trim_end_matches('\n').to_owned() + "\n",
                    "{dump:?}"
                );
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 8);
}

#[test]
fn every_model_is_the_flattened_form_of_its_source() {
    for scad in sources("../server/models") {
        let flat = flatten(&read(&scad), &[]).unwrap_or_else(|e| panic!("{}: {e}", scad.display()));
        let csg = scad.with_extension("csg");
        assert!(read(&csg) == flat, "{} is not what its .scad says: run the flatten tool on it", csg.display());
    }
}

#[test]
fn what_the_flattener_does_not_know_is_named_with_its_line() {
    for (source, sentence) in [
        ("cube(1);\nminkowski() { }", "line 2: minkowski is not supported"),
        ("cube(1;", "line 1: expected a value"),
        ("sphere(r = foo(1));", "line 1: function foo is not supported"),
        ("a = 3;\ncube([1, 2]);", "line 2: expected a number, found Vector([Number(1.0), Number(2.0)])"),
    ] {
        assert_eq!(flatten(source, &[]).unwrap_err(), sentence);
    }
}
