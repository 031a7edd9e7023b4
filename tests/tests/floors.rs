//! The floors of the server: each folder imports only from floors below it, as the table in docs/architecture.md says.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Floor numbers by module, from the table rows `| 3 | import | … |`.
fn floors() -> BTreeMap<String, u32> {
    let text = std::fs::read_to_string(root().join("docs/architecture.md")).unwrap();
    let mut table = BTreeMap::new();
    for line in text.lines() {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        if let [_, floor, modules, ..] = cells.as_slice()
            && let Ok(floor) = floor.parse()
        {
            for module in modules.split(',') {
                table.insert(module.trim().trim_matches('`').to_owned(), floor);
            }
        }
    }
    table
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// Modules of the crate that a text names after `crate::` or `contactd::`, tests and comments left out.
fn imports(text: &str) -> BTreeSet<String> {
    let code: Vec<&str> =
        text.lines().take_while(|l| l.trim() != "#[cfg(test)]").filter(|l| !l.trim_start().starts_with("//")).collect();
    let code = code.join("\n");
    let mut named = BTreeSet::new();
    for prefix in ["crate::", "contactd::"] {
        for (at, _) in code.match_indices(prefix) {
            let rest = &code[at + prefix.len()..];
            let names: Vec<&str> = match rest.strip_prefix('{') {
                // `use crate::{a::X, b}`: the first word of each item at the outer level.
                Some(list) => {
                    let mut depth = 0;
                    let end = list
                        .find(|c| {
                            depth += (c == '{') as i32 - (c == '}') as i32;
                            depth < 0
                        })
                        .unwrap_or(list.len());
                    let mut items = vec![];
                    let (mut depth, mut start) = (0, 0);
                    for (i, c) in list[..end].char_indices() {
                        depth += (c == '{') as i32 - (c == '}') as i32;
                        if c == ',' && depth == 0 {
                            items.push(&list[start..i]);
                            start = i + 1;
                        }
                    }
                    items.push(&list[start..end]);
                    items
                }
                None => vec![rest],
            };
            for name in names {
                let name = name.trim();
                let end = name.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(name.len());
                named.insert(name[..end].to_owned());
            }
        }
    }
    named
}

#[test]
fn every_folder_imports_only_from_floors_below() {
    let floors = floors();
    let source = root().join("server/src");
    let mut files = Vec::new();
    rust_files(&source, &mut files);
    let mut edges = 0;
    for file in &files {
        let relative = file.strip_prefix(&source).unwrap();
        let module = relative.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs").to_owned();
        if module == "lib" {
            continue;
        }
        let Some(floor) = floors.get(&module) else { panic!("docs/architecture.md has no floor for {module}") };
        for import in imports(&std::fs::read_to_string(file).unwrap()) {
            let Some(below) = floors.get(&import) else { continue };
            edges += (import != module) as usize;
            assert!(
                import == module || below < floor,
                "{}: {module} (floor {floor}) imports {import} (floor {below})",
                file.display()
            );
        }
    }
    assert!(edges > 20, "only {edges} imports were found: the reader of sources is broken");
    for (module, _) in floors {
        let exists = source.join(&module).is_dir() || source.join(format!("{module}.rs")).is_file();
        assert!(exists, "docs/architecture.md names {module}, which is not in server/src");
    }
}

#[test]
fn imports_are_read_from_lists_and_paths() {
    let text = "use crate::math::Aabb;\nuse crate::{solid::{Face, Node}, eco};\n// crate::world\nlet x = crate::bound::f();\n#[cfg(test)]\nuse crate::ipc::Y;";
    let found: Vec<String> = imports(text).into_iter().collect();
    assert_eq!(found, ["bound", "eco", "math", "solid"]);
}

#[test]
fn only_the_transports_name_iceoryx2_and_no_crate_allows_unsafe() {
    for (folder, head) in [("proto", "lib.rs"), ("server", "lib.rs"), ("client", "lib.rs"), ("client/rapier", "lib.rs")]
    {
        let text = std::fs::read_to_string(root().join(folder).join("src").join(head)).unwrap();
        assert!(text.contains("#![forbid(unsafe_code)]"), "{folder}");
    }
    let mut files = Vec::new();
    rust_files(&root().join("server/src"), &mut files);
    for file in files {
        let relative = file.strip_prefix(root().join("server/src")).unwrap();
        if !relative.starts_with("ipc") && !relative.starts_with("main.rs") {
            let text = std::fs::read_to_string(&file).unwrap();
            assert!(!text.contains("use iceoryx2"), "{} names iceoryx2", file.display());
        }
    }
}
