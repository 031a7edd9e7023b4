//! The floors of the engine and the server: each folder imports only from floors below it, as the table in docs/architecture.md
//! says; and no files import each other in a circle, in any package. `floors/docs.rs` holds the documents to what is there.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use syn::visit::{self, Visit};

#[path = "floors/docs.rs"]
mod docs;
#[path = "floors/packages.rs"]
mod packages;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Where the floors stand: those of the engine, and above them those of the server.
fn sources() -> [PathBuf; 2] {
    [root().join("server/engine/src"), root().join("server/src")]
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
    let mut edges = 0;
    for (source, file) in sources().iter().flat_map(|source| {
        let mut files = Vec::new();
        rust_files(source, &mut files);
        files.into_iter().map(move |file| (source, file))
    }) {
        let relative = file.strip_prefix(source).unwrap();
        let module = relative.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs").to_owned();
        if module == "lib" {
            continue;
        }
        let Some(floor) = floors.get(&module) else { panic!("docs/architecture.md has no floor for {module}") };
        for import in imports(&std::fs::read_to_string(&file).unwrap()) {
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
        let exists = sources().iter().any(|s| s.join(&module).is_dir() || s.join(format!("{module}.rs")).is_file());
        assert!(exists, "docs/architecture.md names {module}, which is neither in the engine nor in the server");
    }
}

#[test]
fn imports_are_read_from_lists_and_paths() {
    let text = "use crate::math::Aabb;\nuse crate::{solid::{Face, Node}, octree};\n// crate::world\nlet x = crate::bound::f();\n#[cfg(test)]\nuse crate::ipc::Y;";
    let found: Vec<String> = imports(text).into_iter().collect();
    assert_eq!(found, ["bound", "math", "octree", "solid"]);
}

#[test]
fn only_the_transports_name_iceoryx2_and_no_crate_allows_unsafe() {
    for folder in ["proto", "server/engine", "server", "client", "bindings/rapier"] {
        let text = std::fs::read_to_string(root().join(folder).join("src/lib.rs")).unwrap();
        assert!(text.contains("#![forbid(unsafe_code)]"), "{folder}");
    }
    let mut files = Vec::new();
    sources().iter().for_each(|source| rust_files(source, &mut files));
    for file in files {
        let relative = file.strip_prefix(root().join("server/src")).unwrap_or(&file);
        if !relative.starts_with("ipc") {
            let text = std::fs::read_to_string(&file).unwrap();
            assert!(!text.contains("use iceoryx2"), "{} names iceoryx2", file.display());
        }
    }
}

/// A module's path from the root of its crate.
type Module = Vec<String>;

/// What a file names: paths, of imports and in place. What it hands on it does not use.
#[derive(Default)]
struct Names {
    used: Vec<Module>,
}

impl Names {
    fn import(&mut self, tree: &syn::UseTree, path: &mut Module) {
        match tree {
            syn::UseTree::Path(p) => {
                path.push(p.ident.to_string());
                self.import(&p.tree, path);
                path.pop();
            }
            syn::UseTree::Group(g) => g.items.iter().for_each(|tree| self.import(tree, path)),
            syn::UseTree::Name(syn::UseName { ident }) | syn::UseTree::Rename(syn::UseRename { ident, .. }) => {
                let name = (ident != "self").then(|| ident.to_string());
                self.used.push(path.iter().cloned().chain(name).collect());
            }
            syn::UseTree::Glob(_) => self.used.push(path.clone()),
        }
    }
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes
        .iter()
        .any(|a| a.path().is_ident("cfg") && a.meta.require_list().is_ok_and(|l| l.tokens.to_string() == "test"))
}

impl<'a> Visit<'a> for Names {
    fn visit_item_use(&mut self, item: &'a syn::ItemUse) {
        if !is_test(&item.attrs) && matches!(item.vis, syn::Visibility::Inherited) {
            self.import(&item.tree, &mut Vec::new());
        }
    }
    fn visit_item_mod(&mut self, item: &'a syn::ItemMod) {
        if !is_test(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }
    /// Who may see an item is no import.
    fn visit_visibility(&mut self, _: &'a syn::Visibility) {}
    fn visit_path(&mut self, path: &'a syn::Path) {
        if path.segments.len() > 1 {
            self.used.push(path.segments.iter().map(|s| s.ident.to_string()).collect());
        }
        visit::visit_path(self, path);
    }
}

/// The modules of a crate that stand in files of their own, with what each names.
fn modules(source: &Path) -> BTreeMap<Module, Names> {
    let mut files = Vec::new();
    rust_files(source, &mut files);
    let mut all = BTreeMap::new();
    for file in files {
        let mut path: Module = file
            .strip_prefix(source)
            .unwrap()
            .with_extension("")
            .iter()
            .map(|s| s.to_str().unwrap().to_owned())
            .collect();
        path.pop_if(|last| last == "mod" || last == "lib");
        // A program of its own, and what stands in for tests.
        if path.last().is_some_and(|last| ["main", "tests", "testing", "random"].contains(&last.as_str())) {
            continue;
        }
        let mut names = Names::default();
        names.visit_file(&syn::parse_file(&shipped(&std::fs::read_to_string(&file).unwrap())).unwrap());
        all.insert(path, names);
    }
    all
}

/// A file's text without its comments and the tests at its end: nothing of them is an import, and they are most of what there is
/// to parse.
fn shipped(text: &str) -> String {
    let mut kept = String::new();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        if line == "#[cfg(test)]" && lines.peek().is_some_and(|next| next.starts_with("mod ") && next.ends_with('{')) {
            // Up to the brace in the first column that ends them.
            lines.by_ref().find(|line| *line == "}").expect("an end of the tests");
        } else if !line.trim_start().starts_with("//") {
            kept.push_str(line);
            kept.push('\n');
        }
    }
    kept
}

/// Those of the engine and of the server: both tests that read them parse them once.
static MODULES: LazyLock<[BTreeMap<Module, Names>; 2]> = LazyLock::new(|| sources().map(|source| modules(&source)));

/// The module in whose file that stands which `at` names by a path; `None` for what is no module of the crate.
fn place_of(all: &BTreeMap<Module, Names>, at: &Module, path: &[String]) -> Option<Module> {
    let (mut here, mut rest) = (at.clone(), path);
    match rest.first()?.as_str() {
        "crate" => (here, rest) = (Module::new(), &rest[1..]),
        "self" => rest = &rest[1..],
        "super" => {}
        child => {
            let inner: Module = at.iter().cloned().chain([child.to_owned()]).collect();
            if !all.contains_key(&inner) {
                return None;
            }
        }
    }
    while let [first, more @ ..] = rest {
        if first == "super" {
            here.pop();
        } else {
            let inner: Module = here.iter().cloned().chain([first.clone()]).collect();
            if !all.contains_key(&inner) {
                // An item, of this file or one that a folder's face hands on from its files.
                return Some(here);
            }
            here = inner;
        }
        rest = more;
    }
    Some(here)
}

/// A circle of files that import each other, if there is one, and how many imports were read.
fn circle(all: &BTreeMap<Module, Names>) -> (Option<Vec<Module>>, usize) {
    let mut to: BTreeMap<&Module, BTreeSet<Module>> = BTreeMap::new();
    for (at, names) in all {
        let places = names.used.iter().filter_map(|path| place_of(all, at, path));
        // A folder's face (`mod.rs`) belongs to all of its files.
        to.insert(at, places.filter(|place| !at.starts_with(place) && all.contains_key(place)).collect());
    }
    let count = to.values().map(BTreeSet::len).sum();
    (circle_among(to), count)
}

/// Files that import each other, one after the other; of each file those that it imports.
fn circle_among(mut to: BTreeMap<&Module, BTreeSet<Module>>) -> Option<Vec<Module>> {
    // What imports nothing that is left goes; what stays is on a circle or above one.
    loop {
        let ends: Vec<Module> = to.iter().filter(|(_, b)| b.is_empty()).map(|(a, _)| (*a).clone()).collect();
        if ends.is_empty() {
            break;
        }
        to.retain(|a, _| !ends.contains(a));
        to.values_mut().for_each(|b| b.retain(|place| !ends.contains(place)));
    }
    let mut at = *to.first_key_value()?.0;
    let mut way: Vec<Module> = Vec::new();
    while !way.contains(at) {
        way.push(at.clone());
        at = to.keys().find(|place| to[at].contains(**place)).unwrap();
    }
    let begin = way.iter().position(|place| *place == *at).unwrap();
    Some(way.split_off(begin))
}

/// Floors of the folders within a folder, from the table rows `| 6.1 | contact/exclusion | … |`, by the whole path.
fn inner_floors() -> BTreeMap<Module, (u32, u32)> {
    let text = std::fs::read_to_string(root().join("docs/architecture.md")).unwrap();
    let mut table = BTreeMap::new();
    for line in text.lines() {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        if let [_, floor, folder, ..] = cells.as_slice()
            && let Some((whole, part)) = floor.split_once('.')
            && let (Ok(whole), Ok(part)) = (whole.parse(), part.parse())
        {
            let path = folder.trim_matches('`').split('/').map(str::to_owned).collect();
            table.insert(path, (whole, part));
        }
    }
    table
}

/// The imports of a divided folder that go up or sideways between its parts, or through the folder's face; and how many go down.
fn uphill(all: &BTreeMap<Module, Names>, floors: &BTreeMap<Module, (u32, u32)>) -> (Vec<String>, usize) {
    let divided: BTreeSet<&[String]> = floors.keys().map(|path| &path[..1]).collect();
    let part_of = |path: &Module| floors.iter().find(|(part, _)| path.starts_with(part));
    let (mut found, mut down) = (Vec::new(), 0);
    for (at, names) in all.iter().filter(|(at, _)| at.len() > 1 && divided.contains(&at[..1])) {
        let Some((own, floor)) = part_of(at) else {
            found.push(format!("{at:?} stands on no floor"));
            continue;
        };
        for place in names.used.iter().filter_map(|path| place_of(all, at, path)) {
            match part_of(&place) {
                Some((other, below)) if other == own || below < floor => down += usize::from(other != own),
                Some(_) => found.push(format!("{at:?} imports {place:?}")),
                None if place.len() == 1 && place[0] == at[0] => {
                    found.push(format!("{at:?} imports by the face of {place:?}"))
                }
                None => {}
            }
        }
    }
    (found, down)
}

#[test]
fn the_folders_within_a_folder_import_only_from_floors_below() {
    let floors = inner_floors();
    assert!(floors.len() > 8, "docs/architecture.md has no floors within folders");
    let outer = self::floors();
    for (path, (whole, _)) in &floors {
        let exists = sources().iter().any(|source| {
            let folder = source.join(path.join("/"));
            folder.is_dir() || folder.with_extension("rs").is_file()
        });
        assert!(exists, "{path:?} is neither in the engine nor in the server");
        assert_eq!(outer.get(&path[0]), Some(whole), "{path:?}");
    }
    let (mut found, mut down) = (Vec::new(), 0);
    for all in MODULES.iter() {
        let (more, count) = uphill(all, &floors);
        found.extend(more);
        down += count;
    }
    println!("{down} imports go down");
    assert!(found.is_empty(), "{found:#?}");
    assert!(down > 60, "only {down} imports were found: the reader of sources is broken");
}

#[test]
fn an_import_that_goes_up_within_a_folder_is_seen() {
    let read = |text: &str| {
        let mut names = Names::default();
        names.visit_file(&syn::parse_file(text).unwrap());
        names
    };
    let path = |p: &str| -> Module { p.split('/').map(str::to_owned).collect() };
    let floors = BTreeMap::from([(path("f/low"), (6, 1)), (path("f/high"), (6, 2))]);
    let of = |low: &str, high: &str| {
        let texts = [("f", "pub mod low; pub mod high; pub use low::X;"), ("f/low", low), ("f/high", high)];
        uphill(&texts.iter().map(|(p, text)| (path(p), read(text))).collect(), &floors)
    };
    assert_eq!(of("pub struct X;", "use crate::f::low::X; fn f(_: super::low::X) {}"), (vec![], 2));
    assert_eq!(of("use crate::f::high::Y;", "pub struct Y;").0.len(), 1);
    assert_eq!(of("pub struct X;", "use crate::f::X;").0.len(), 1);
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let [engine, server] = &*MODULES;
    let others = ["proto", "client", "bindings/capi", "bindings/rapier", "bindings/python"]
        .map(|package| modules(&root().join(package).join("src")));
    let [proto, client, capi, rapier, python] = &others;
    for (package, all, least) in [
        ("proto", proto, 4),
        ("client", client, 20),
        ("server/engine", engine, 200),
        ("server", server, 100),
        ("bindings/capi", capi, 10),
        ("bindings/rapier", rapier, 1),
        ("bindings/python", python, 10),
    ] {
        let (found, count) = circle(all);
        println!("{package}: {count} imports");
        assert!(found.is_none(), "{package}: {:?} import each other", found.unwrap());
        assert!(count >= least, "{package}: only {count} imports were found: the reader of sources is broken");
    }
}

/// The files of a Python package that one of them imports, for types alone, too.
fn python_imports(text: &str, files: &BTreeSet<Module>) -> BTreeSet<Module> {
    let one = |name: &str| vec![name.trim().split(' ').next().unwrap_or_default().to_owned()];
    let of_line = |line: &str| -> Vec<Module> {
        let Some((from, names)) = line.trim().strip_prefix("from .").and_then(|rest| rest.split_once(" import "))
        else {
            return Vec::new();
        };
        if from.is_empty() { names.split(',').map(one).collect() } else { vec![one(from)] }
    };
    text.lines().flat_map(of_line).filter(|module| files.contains(module)).collect()
}

#[test]
fn no_python_files_import_each_other_in_a_circle() {
    let folder = root().join("bindings/python/contactd");
    let texts: BTreeMap<Module, String> = std::fs::read_dir(&folder)
        .expect("the package")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "py") && path.file_stem().is_some_and(|s| s != "__init__"))
        .map(|path| {
            (vec![path.file_stem().unwrap().to_str().unwrap().to_owned()], std::fs::read_to_string(&path).unwrap())
        })
        .collect();
    let found = |texts: &BTreeMap<Module, String>| {
        let files = texts.keys().cloned().collect();
        let to: BTreeMap<_, _> = texts.iter().map(|(at, text)| (at, python_imports(text, &files))).collect();
        (to.values().map(BTreeSet::len).sum::<usize>(), circle_among(to))
    };
    let (count, circle) = found(&texts);
    assert!(count > 20 && circle.is_none(), "{count} imports, {circle:?} import each other");
    let mut texts = texts;
    texts
        .get_mut(&vec!["reply".to_owned()])
        .expect("replies")
        .push_str("\nif TYPE_CHECKING:\n    from . import session as s\n");
    texts.get_mut(&vec!["scene".to_owned()]).expect("scenes").push_str("\nfrom .reply import Reply\n");
    assert!(found(&texts).1.is_some(), "a circle is seen");
}

#[test]
fn a_circle_of_files_is_seen() {
    let read = |files: &[(&str, &str)]| {
        let names = |text: &str| {
            let mut names = Names::default();
            names.visit_file(&syn::parse_file(text).unwrap());
            names
        };
        let path = |p: &str| p.split('/').filter(|s| !s.is_empty()).map(str::to_owned).collect();
        circle(&files.iter().map(|(p, text)| (path(p), names(text))).collect())
    };
    let up = ("", "pub mod a; mod b; pub use b::Y;");
    let (none, count) =
        read(&[up, ("a", "use super::b::Y; pub struct X;"), ("b", "pub struct Y; #[cfg(test)] use crate::a::X;")]);
    assert_eq!((none, count), (None, 1));
    let (some, _) =
        read(&[up, ("a", "use super::b::Y; pub struct X;"), ("b", "pub struct Y; fn f(_: crate::a::X) {}")]);
    assert_eq!(some, Some(vec![vec!["a".to_owned()], vec!["b".to_owned()]]));
}
