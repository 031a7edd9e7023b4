//! The documents: lines that fit a page, links and paths that lead somewhere, commands and tests that exist.

use super::{root, rust_files};
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

const WIDTH: usize = 120;
/// Every type that it names is one of the sources.
const GLOSSARY: &str = "glossary.md";
/// A changelog speaks of what was: its paths need not be there any more.
const HISTORY: &str = "CHANGELOG.md";

fn markdown_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            markdown_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "md") {
            found.push(path);
        }
    }
}

fn documents() -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = ["README.md", HISTORY, "bindings/python/README.md"].map(|f| root().join(f)).into();
    all.extend(super::packages::published().iter().map(|(folder, _)| folder.join("README.md")));
    markdown_files(&root().join("docs"), &mut all);
    all
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Lines outside of fenced code.
fn prose(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut fenced = false;
    (1..).zip(text.lines()).filter(move |(_, line)| {
        let fence = line.trim_start().starts_with("```");
        fenced ^= fence;
        !fenced && !fence
    })
}

/// Files that a guide has its reader write: the names behind the languages of its blocks.
fn written(text: &str) -> BTreeSet<&str> {
    text.lines().filter_map(|line| line.strip_prefix("```")?.split_once(' ')).map(|(_, name)| name).collect()
}

/// What stands between two marks on a line, pair by pair.
fn between<'a>(line: &'a str, open: &str, close: &str) -> Vec<&'a str> {
    let mut found = Vec::new();
    let mut rest = line;
    while let Some((_, after)) = rest.split_once(open)
        && let Some((inner, more)) = after.split_once(close)
    {
        found.push(inner);
        rest = more;
    }
    found
}

/// The name by which a heading is linked to.
fn anchor(heading: &str) -> String {
    let text = heading.trim_start_matches('#').trim().to_lowercase();
    text.chars()
        .filter_map(|c| if c == ' ' { Some('-') } else { (c.is_alphanumeric() || "-_".contains(c)).then_some(c) })
        .collect()
}

/// Lines that are too long.
fn too_long(text: &str) -> Vec<String> {
    let long = (1..).zip(text.lines()).map(|(n, line)| (n, line.chars().count())).filter(|(_, count)| *count > WIDTH);
    long.map(|(n, count)| format!("line {n} has {count} columns, {WIDTH} at most")).collect()
}

/// Links of a document at `path` that lead nowhere.
fn broken_links(path: &Path, text: &str) -> Vec<String> {
    let mut wrong = Vec::new();
    for (n, line) in prose(text) {
        for link in between(line, "](", ")") {
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let to = if file.is_empty() { path.to_owned() } else { path.parent().unwrap().join(file) };
            if link.contains("://") {
            } else if !to.exists() {
                wrong.push(format!("line {n} links to {link}, which is not there"));
            } else if !heading.is_empty() && !prose(&read(&to)).any(|(_, l)| l.starts_with('#') && anchor(l) == heading)
            {
                wrong.push(format!("line {n} links to {link}, and no heading there is called so"));
            }
        }
    }
    wrong
}

/// What the repository has, as far as documents name it.
#[derive(Default)]
struct Known {
    /// Paths of all files and folders, from the root, by their last names.
    paths: BTreeMap<OsString, Vec<PathBuf>>,
    /// Programs, examples and test binaries.
    programs: BTreeSet<String>,
    /// All Rust sources, one after the other.
    sources: String,
    /// Their words, and those that a type is declared by.
    words: BTreeSet<String>,
    types: BTreeSet<String>,
    /// The types that each source declares.
    declared: BTreeMap<PathBuf, BTreeSet<String>>,
}

/// Paths of all files and folders below a folder, from the root, by their last names.
fn paths(folder: &Path, found: &mut BTreeMap<OsString, Vec<PathBuf>>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap();
        if name.to_str().unwrap().starts_with('.') || name == "target" || name == "build" {
            continue;
        }
        found.entry(name.to_owned()).or_default().push(path.strip_prefix(root()).unwrap().to_owned());
        if path.is_dir() {
            paths(&path, found);
        }
    }
}

/// The words of a source.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
}

/// The types that a source declares.
fn types(text: &str) -> BTreeSet<String> {
    let declares = |word| ["struct", "enum", "trait", "type"].contains(&word);
    words(text)
        .zip(words(text).skip(1))
        .filter(|(before, _)| declares(*before))
        .map(|(_, name)| name.to_owned())
        .collect()
}

/// True for a word that is a type's name, or that of something of a type.
fn is_type(word: &str) -> bool {
    let name = word.split("::").next().unwrap_or_default();
    name.starts_with(|c: char| c.is_ascii_uppercase())
        && name.contains(|c: char| c.is_ascii_lowercase())
        && word.chars().all(|c| c.is_ascii_alphanumeric() || c == ':' || c == '_')
}

impl Known {
    /// What this repository has, read once.
    fn of_this() -> &'static Self {
        static KNOWN: LazyLock<Known> = LazyLock::new(Known::read);
        &KNOWN
    }

    fn read() -> Self {
        let mut known = Self::default();
        paths(&root(), &mut known.paths);
        let mut sources = Vec::new();
        for folder in ["proto", "client", "server", "bindings", "tests", "benches"] {
            rust_files(&root().join(folder), &mut sources);
        }
        for path in sources {
            let text = read(&path);
            known.sources += &text;
            known.declared.insert(path.strip_prefix(root()).unwrap().to_owned(), types(&text));
            let folder = path.parent().unwrap().file_name().unwrap().to_str().unwrap();
            if ["bin", "tests", "examples"].contains(&folder) {
                known.programs.insert(path.file_stem().unwrap().to_str().unwrap().to_owned());
            } else if path.ends_with("main.rs") {
                known.programs.insert(folder.to_owned());
            }
        }
        let words = words(&known.sources).collect::<HashSet<&str>>();
        known.words = words.into_iter().map(str::to_owned).collect();
        known.types = known.declared.values().flatten().cloned().collect();
        known
    }

    /// True for the end of a path.
    fn is_path(&self, end: &str) -> bool {
        let alike = Path::new(end).file_name().and_then(|name| self.paths.get(name));
        alike.is_some_and(|paths| paths.iter().any(|path| path.ends_with(end)))
    }

    /// Whether a word that stands in a document as code names nothing that is there; `None` for what is no path and no test.
    fn lacks(&self, at: &Path, word: &str) -> Option<bool> {
        let plain = |c: char| c.is_ascii_alphanumeric() || "_./-".contains(c);
        if !word.chars().all(|c| plain(c) || c == '…') || word.starts_with('/') {
            return None;
        }
        let kind = Path::new(word).extension().and_then(|e| e.to_str()).unwrap_or("");
        let is_file = ["rs", "md", "py", "c", "h", "patch", "csv", "png"].contains(&kind);
        let [engine, server] = super::sources();
        let bases = [root(), engine, server, at.parent().unwrap().to_owned()];
        // A path may leave out where it begins, and a module its ending.
        let first = word.split('/').next().unwrap_or_default();
        let is_path = word.contains('/') && bases.iter().any(|base| base.join(first).is_dir());
        if first != "target" && (is_file || is_path) {
            let module = format!("{}.rs", word.trim_end_matches('/'));
            return Some(!self.is_path(word) && !self.is_path(&module));
        }
        // A test is told from a field by its length; its name may end in an ellipsis.
        let start = word.trim_end_matches('…');
        let is_test = start.matches('_').count() >= 3 && start.chars().all(|c| plain(c) && c != '.' && c != '-');
        is_test.then(|| !self.words.range(start.to_owned()..).next().is_some_and(|found| found.starts_with(start)))
    }

    /// Whether a word names a type, or something of a type, that is declared nowhere; `None` for other words.
    fn lacks_type(&self, word: &str) -> Option<bool> {
        let (name, item) = word.split_once("::").unwrap_or((word, ""));
        is_type(word).then(|| !self.types.contains(name) || !item.split("::").all(|part| self.words.contains(part)))
    }

    /// Types that a table of the glossary names beside files that do not declare them. A table speaks of the folders that the heading or
    /// the line "In `folder`" above it names.
    fn misplaced(&self, text: &str) -> Vec<String> {
        let mut wrong = Vec::new();
        let mut folders: Vec<&str> = Vec::new();
        for (n, line) in prose(text) {
            if line.starts_with("##") || line.starts_with("In `") {
                folders = between(line, "`", "`");
            }
            let cells: Vec<&str> = line.split(" | ").collect();
            let [first, _, last] = cells.as_slice() else { continue };
            let is_in = |path: &Path, end: &str| {
                let within =
                    |folder: &&str| format!("{}/", path.parent().unwrap().display()).contains(&format!("/{folder}/"));
                folders.iter().any(within) && (path.ends_with(end) || path.parent().is_some_and(|p| p.ends_with(end)))
            };
            let files = between(last, "`", "`");
            for name in between(first, "`", "`").into_iter().filter(|word| is_type(word)) {
                let mut there = self.declared.iter().filter(|(path, _)| files.iter().any(|end| is_in(path, end)));
                if !folders.is_empty() && !there.any(|(_, types)| types.contains(name)) {
                    wrong.push(format!("line {n} names {name}, which {} does not declare", files.join(", ")));
                }
            }
        }
        wrong
    }

    /// Paths, tests and programs that a document at `at` names and that are not there; of the glossary, types too.
    fn missing(&self, at: &Path, text: &str) -> Vec<String> {
        let mut wrong = Vec::new();
        let own = written(text);
        if at.ends_with(GLOSSARY) {
            wrong.extend(self.misplaced(text));
        }
        for (n, line) in prose(text) {
            for word in between(line, "`", "`").into_iter().filter(|word| !own.contains(word)) {
                let is_lost = at.ends_with(GLOSSARY) && self.lacks_type(word) == Some(true);
                if is_lost || self.lacks(at, word) == Some(true) {
                    wrong.push(format!("line {n} names `{word}`, which is not there"));
                }
            }
        }
        for (n, line) in (1..).zip(text.lines()) {
            let words: Vec<&str> = line.split(|c: char| c.is_whitespace() || "`()".contains(c)).collect();
            for three in words.windows(3) {
                if let (["--test", program], Some((file, _))) = (&three[..2], three[2].split_once("::"))
                    && !self.is_path(&format!("tests/{program}/{file}.rs"))
                {
                    wrong.push(format!("line {n} names --test {program} {file}::, which is not there"));
                }
            }
            for pair in words.windows(2) {
                let name = pair[1].trim_end_matches([',', '.', ';', ':']);
                let is_name = !name.is_empty() && name.chars().all(|c| c.is_ascii_lowercase() || c == '_');
                if ["--bin", "--test", "--example"].contains(&pair[0]) && is_name && !self.programs.contains(name) {
                    wrong.push(format!("line {n} names {} {name}, which is not there", pair[0]));
                }
            }
        }
        wrong
    }
}

#[test]
fn documents_fit_a_page_and_what_they_name_is_there() {
    let known = Known::of_this();
    let mut wrong = Vec::new();
    for path in documents() {
        let text = read(&path);
        let mut of_this = too_long(&text);
        of_this.extend(broken_links(&path, &text));
        if !path.ends_with(HISTORY) {
            of_this.extend(known.missing(&path, &text));
        }
        wrong.extend(of_this.into_iter().map(|w| format!("{}: {w}", path.strip_prefix(root()).unwrap().display())));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// What is wrong with the test that a deliberate fault names: `-p PACKAGE --test PROGRAM -- FILE::NAME` or `--lib -- PATH::NAME`.
fn lost_test(known: &Known, patch: &str) -> Option<String> {
    let Some(line) = patch.lines().find_map(|line| line.strip_prefix("Test: ")) else {
        return Some("names no test".to_owned());
    };
    let words: Vec<&str> = line.split(' ').filter(|word| *word != "--exact").collect();
    let name = words.last()?.rsplit("::").next()?;
    // A macro's tests stand there without `fn`.
    let is_in = |text: &str| {
        let mut rest = text.match_indices(name).map(|(at, _)| text[at + name.len()..].trim_start());
        // A name alone: a file's tests as a whole are no one test.
        !name.is_empty() && rest.any(|rest| rest.starts_with(['(', ',', ')', ']', ';', '=']))
    };
    let found = match words.as_slice() {
        ["-p", "contactd-tests", "--test", program, "--", path] => {
            let file = path.rsplit_once("::").map_or(String::new(), |(file, _)| format!("{file}.rs"));
            let text = std::fs::read_to_string(root().join("tests/tests").join(program).join(file));
            text.is_ok_and(|text| is_in(&text))
        }
        ["-p", _, "--test", program, "--", _] => known.programs.contains(*program) && is_in(&known.sources),
        ["-p", _, "--lib", "--", _] => is_in(&known.sources),
        _ => false,
    };
    (!found).then(|| format!("names {line}, which is not there"))
}

/// Where a deliberate fault does not apply: a hunk whose lines do not stand in their file, one after the other.
fn lost_place(patch: &str) -> Option<String> {
    let mut file = String::new();
    let mut wanted: Option<(String, String)> = None;
    let is_there = |wanted: &Option<(String, String)>, file: &str| {
        wanted
            .as_ref()
            .filter(|(_, lines)| !file.contains(lines.as_str()))
            .map(|(at, _)| format!("finds no place: {at}"))
    };
    for line in patch.lines() {
        if let Some(path) = line.strip_prefix("+++ b/") {
            if let Some(lost) = is_there(&wanted.take(), &file) {
                return Some(lost);
            }
            file = std::fs::read_to_string(root().join(path)).unwrap_or_default();
        } else if line.starts_with("--- a/") {
            // The next file's name follows.
        } else if line.starts_with("@@ ") {
            if let Some(lost) = is_there(&wanted.replace((line.to_owned(), String::new())), &file) {
                return Some(lost);
            }
        } else if let Some((_, lines)) = &mut wanted
            && let Some(old) = line.strip_prefix([' ', '-']).or(line.is_empty().then_some(""))
        {
            lines.push_str(old);
            lines.push('\n');
        }
    }
    let Some((_, lines)) = &mut wanted else { return Some("changes nothing".to_owned()) };
    // Blank lines at a patch's end may be its own.
    lines.truncate(lines.trim_end_matches('\n').len());
    is_there(&wanted, &file)
}

#[test]
fn every_deliberate_fault_has_its_place_and_names_a_test_that_is_there() {
    let (known, folder) = (Known::of_this(), root().join("tests/mutants"));
    let mut wrong = Vec::new();
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "patch") {
            count += 1;
            let patch = read(&path);
            let lost = lost_test(known, &patch).into_iter().chain(lost_place(&patch));
            wrong.extend(lost.map(|what| format!("{}: {what}", path.file_name().unwrap().display())));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(count > 100, "only {count} faults were found");
    let of = |test: &str| lost_test(known, &format!("Test: -p contactd-tests --test {test}\n"));
    assert_eq!(of("answers -- cases::every_case_is_answered_to_eight_digits"), None);
    assert!(of("answers -- laws::every_case_is_answered_to_eight_digits").is_some());
    assert!(of("answers -- cases::").is_some());
    assert!(of("cases -- every_case_is_answered_to_eight_digits").is_some());
    let patch = |old: &str| format!("--- a/rustfmt.toml\n+++ b/rustfmt.toml\n@@ -1 +1 @@\n-{old}\n+gone\n");
    let first = read(&root().join("rustfmt.toml"));
    let first = first.lines().next().expect("a line");
    assert_eq!(lost_place(&patch(first)), None);
    assert!(lost_place(&patch("no such line")).is_some() && lost_place("Fault: none").is_some());
}

#[test]
fn a_long_line_a_dead_link_and_a_lost_path_are_seen() {
    let at = root().join("docs/adding.md");
    assert_eq!(too_long(&format!("{}\n{}\n", "é".repeat(120), "x".repeat(121))).len(), 1);
    let links =
        "# A face, or two\n[a](gone.md) [b](adding.md#nowhere) [c](#a-solid) [d](../README.md) [e](https://a.b)\n";
    assert_eq!(broken_links(&at, links).len(), 2);
    assert_eq!(anchor("## In front: two convex, `turning`"), "in-front-two-convex-turning");
    let known = Known::of_this();
    let good = "`server/src/lib.rs` `world/step.rs` `floors.rs` `contact/convex` `time_lower` `target/x/y.rs` `BASE/S/lock`\n\
                ```\nserver/src/gone.rs\n```\n`no_files_import_…` `cargo run --bin kernels -- --quick` --test floors\n\
                --test answers laws::\n";
    assert_eq!(known.missing(&at, good), Vec::<String>::new());
    let words = "`F64x2` `Kind::Empty` `Gone` `Kind::Gone_for_good` `E` `time_lower`"
        .replace("Gone", "NoSuch")
        .replace("_for_good", "Thing");
    assert_eq!(known.missing(&at.with_file_name(GLOSSARY), &words).len(), 2);
    let table = "### `contact`\n\n| `Task` | what | `task.rs` |\n| `Task`, `Search` | what | `queue/search.rs` |\n";
    assert_eq!(known.misplaced(table).len(), 1);
    let bad = "`server/src/gone.rs` `gone.rs` `contact/gone` `a_test_that_is_gone_for_good`\n--bin gone, --test gone.\n--test steps laws::\n";
    assert_eq!(known.missing(&at, bad.replace("a_test_that", "a_test_which").as_str()).len(), 7);
}
