//! The packages as they are published: each is whole in its own folder, and says what it is and what it needs.

use super::{root, rust_files};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What cargo knows of the workspace and of what it depends on here: what other systems need was never downloaded on a machine
/// that has but built the workspace.
fn metadata() -> Value {
    let version = Command::new(env!("CARGO")).args(["version", "--verbose"]).output().expect("cargo").stdout;
    let version = String::from_utf8(version).expect("text");
    let host = version.lines().find_map(|line| line.strip_prefix("host: ")).expect("cargo's host");
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["metadata", "--format-version", "1", "--offline", "--filter-platform", host]).current_dir(root());
    let output = cargo.output().expect("cargo");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("cargo's metadata")
}

fn packages(metadata: &Value) -> Vec<&Value> {
    metadata["packages"].as_array().expect("packages").iter().collect()
}

/// The workspace's packages that are published: folder and manifest.
pub fn published() -> Vec<(PathBuf, toml::Value)> {
    ["proto", "client", "server/engine", "server", "bindings/capi", "bindings/rapier"]
        .map(|folder| {
            let folder = root().join(folder);
            let text = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap();
            (folder, toml::from_str(&text).unwrap())
        })
        .into()
}

/// Paths that a source includes, or has modules at, as they stand there.
fn included(text: &str) -> Vec<&str> {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    let marks = ["include_str!(", "include_bytes!(", "include!(", "#[path = "];
    let behind = |line: &str| marks.iter().find_map(|mark| line.find(mark).map(|at| at + mark.len()));
    code.filter_map(|line| behind(line).and_then(|at| line[at..].split('"').nth(1))).collect()
}

#[test]
fn every_published_package_is_whole_in_its_folder() {
    let known = metadata();
    let all = packages(&known);
    let open: Vec<&str> = all
        .iter()
        .filter(|p| p["source"].is_null() && p["publish"].is_null())
        .filter_map(|p| p["name"].as_str())
        .collect();
    assert_eq!(open.len(), published().len(), "{open:?}: a package is published, or says `publish = false`");
    let mut read = 0;
    for (folder, manifest) in published() {
        let package = &manifest["package"];
        let name = package["name"].as_str().unwrap();
        assert!(open.contains(&name), "{name}");
        for key in ["description", "keywords", "categories", "readme", "license", "rust-version"] {
            assert!(package.get(key).is_some(), "{name} has no {key}");
        }
        assert!((1..=5).contains(&package["keywords"].as_array().unwrap().len()), "{name}: five keywords at most");
        for file in [package["readme"].as_str().unwrap(), "LICENSE-MIT", "LICENSE-APACHE"] {
            let text = std::fs::read_to_string(folder.join(file)).unwrap_or_else(|e| panic!("{name}: {file}: {e}"));
            assert!(text.len() > 100, "{name}: {file}");
        }
        // What it depends on in here has a version too; what only its tests depend on is left out where it has none.
        let own = all.iter().find(|p| p["name"] == name).expect("cargo knows it");
        for dependency in own["dependencies"].as_array().unwrap().iter().filter(|d| d["path"].is_string()) {
            let version = dependency["req"].as_str().unwrap();
            let expected =
                if dependency["kind"] == "dev" { "*".into() } else { format!("={}", own["version"].as_str().unwrap()) };
            assert_eq!(version, expected, "{name} depends on {}", dependency["name"]);
        }
        let mut files = Vec::new();
        rust_files(&folder.join("src"), &mut files);
        for file in files {
            for path in included(&std::fs::read_to_string(&file).unwrap()) {
                read += 1;
                let at = normal(&file.parent().unwrap().join(path));
                assert!(at.starts_with(normal(&folder)), "{}: {path} is not in {name}'s folder", file.display());
            }
        }
    }
    assert!(read > 0, "no file is included: the reader of sources is broken");
    assert_eq!(
        included("// include_str!(\"no\")\n  (\"/\", include_str!(\"../../yes\")),\n#[path = \"x.rs\"]\n"),
        ["../../yes", "x.rs"]
    );
}

/// The table of packages in docs/architecture.md is read: each depends on some of those above it, examples and all but for what
/// tests alone depend on.
#[test]
fn packages_depend_on_those_above_them_in_the_table() {
    let text = std::fs::read_to_string(root().join("docs/architecture.md")).unwrap();
    let table =
        text.split("\n| package |").nth(1).and_then(|rest| rest.split("\n\n").next()).expect("a table of packages");
    let links = table.split("](../").skip(1).filter_map(|rest| rest.split(')').next());
    let folder = |link: &str| normal(&root().join(link.strip_suffix("/src").filter(|f| *f != "tests").unwrap_or(link)));
    let rows: Vec<PathBuf> = links.map(folder).collect();
    let known = metadata();
    let mut read = 0;
    for package in packages(&known).iter().filter(|p| p["source"].is_null()) {
        let at = |folder: &Path| rows.iter().position(|row| row == folder);
        let own = normal(Path::new(package["manifest_path"].as_str().unwrap()).parent().unwrap());
        // What stands in for a crate of others is none of the packages.
        let Some(row) = at(&own) else {
            assert!(own.starts_with(normal(&root().join("vendor"))), "{} is not in the table", own.display());
            continue;
        };
        for dependency in package["dependencies"].as_array().unwrap() {
            let Some(path) = dependency["path"].as_str().filter(|_| dependency["kind"] != "dev") else { continue };
            read += 1;
            let below = at(&normal(Path::new(path))).expect("a package of the table");
            assert!(below < row, "{} depends on {path}, which stands below it in the table", own.display());
        }
    }
    assert!(read > 15, "only {read} dependencies were found");
}

/// A path without `.` and `..`.
fn normal(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            std::path::Component::ParentDir => {
                out.pop();
            }
            std::path::Component::CurDir => {}
            part => out.push(part),
        }
    }
    out
}

/// A version's numbers; what is left out is 0.
fn numbers(version: &str) -> [u32; 3] {
    let mut parts = version.split('.').map(|part| part.parse().unwrap_or(0));
    [(); 3].map(|()| parts.next().unwrap_or(0))
}

/// That the sources themselves ask for no newer one is what clippy looks at (`incompatible_msrv`).
#[test]
fn what_is_depended_on_asks_for_no_newer_rust() {
    let known = metadata();
    let all = packages(&known);
    let own = |p: &Value| p["source"].is_null();
    let ours = all.iter().filter(|p| own(p)).find_map(|p| p["rust_version"].as_str()).expect("a rust-version");
    let mut told = 0;
    for p in all.iter().filter(|p| !own(p)) {
        let Some(theirs) = p["rust_version"].as_str() else { continue };
        told += 1;
        assert!(numbers(theirs) <= numbers(ours), "{} {} needs Rust {theirs}", p["name"], p["version"]);
    }
    assert!(told > 50, "only {told} packages say which Rust they need");
    assert!(numbers("1.89") > numbers("1.9.1") && numbers("1.89") == numbers("1.89.0"));
}
