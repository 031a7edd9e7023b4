//! The pages of docs/reference, made of what the program itself goes by: the types that files are read into with what is said of their
//! fields, the command line's own tree, the table of codes, the table by which the dialect is tested.
//!
//! `CONTACTD_WRITE_REFERENCE=1 cargo test -p contactd --lib reference` writes them anew after a change of one of these.

use super::Arguments;
use crate::import::csg::dialect::{Fate, KINDS};
use crate::ipc::ServerConfig;
use clap::{Arg, CommandFactory as _};
use contactd_proto::ErrorCode;
use contactd_proto::rule::{Effects, Setting, Values};
use std::fmt::Write as _;
use std::path::Path;

const SCENE: &str = include_str!("../import/scene/raw.rs");
const RULES: &str = include_str!("../import/scene/rules.rs");
const SETTINGS: &str = include_str!("../ipc/config.rs");
const WIDTH: usize = 120;

/// A field as a source declares it.
#[derive(Debug, PartialEq)]
struct Declared {
    name: String,
    kind: String,
    doc: String,
    has_default: bool,
}

/// The fields of a struct, with what is said of them.
fn fields(source: &str, of: &str) -> Vec<Declared> {
    let head = format!("struct {of} {{\n");
    let (_, body) = source.split_once(&head).unwrap_or_else(|| panic!("no struct {of}"));
    let body = body.split_once("\n}").expect("an end").0;
    let (mut found, mut doc, mut has_default) = (Vec::new(), String::new(), false);
    for line in body.lines().map(str::trim) {
        if let Some(more) = line.strip_prefix("///") {
            doc = format!("{doc}{}{}", if doc.is_empty() { "" } else { " " }, more.trim());
        } else if line.starts_with("#[") {
            has_default |= line.contains("default");
        } else if let Some((name, kind)) = line.trim_end_matches(',').split_once(": ") {
            let name = name.rsplit(' ').next().unwrap_or(name).to_owned();
            assert!(!doc.is_empty(), "nothing is said of {name} in {of}");
            found.push(Declared { name, kind: kind.to_owned(), doc: std::mem::take(&mut doc), has_default });
            has_default = false;
        }
    }
    found
}

/// What stands in a file for a type, and whether it may be left out.
fn in_a_file(field: &Declared) -> (&'static str, bool) {
    let bare = field.kind.replace("Option<", "").replace("Spanned<", "");
    let word = match bare.trim_end_matches('>') {
        "String" | "PathBuf" => "string",
        "CacheFolder" => "string",
        "Level" => "string",
        "f64" => "number",
        "bool" => "true, false",
        "usize" | "u64" | "u16" => "whole number",
        "[f64; 3]" => "3 numbers",
        "[f64; 4]" => "4 numbers",
        "Vec<RawModel" | "Vec<RawObject" | "Vec<RawRule" => "tables",
        "RawPose" => "a pose",
        "[String>; 2]" => "2 strings",
        "Vec<[String>; 2]" => "pairs of strings",
        other => panic!("no word for the type {other} of {}", field.name),
    };
    (word, field.has_default || field.kind.starts_with("Option") || field.kind.starts_with("Vec"))
}

/// Text of a doc comment as a cell of a table.
fn cell(text: &str) -> String {
    text.replace("[`crate::metrics`]", "docs/commands.md").replace('|', "\\|").trim_end_matches('.').to_owned()
}

/// Documents that are named become links.
fn linked(text: &str) -> String {
    text.split_whitespace()
        .map(|word| {
            let name = word.trim_start_matches('(').strip_prefix("docs/").and_then(|rest| rest.split_once(".md"));
            match name {
                Some((name, rest)) => {
                    let open = if word.starts_with('(') { "(" } else { "" };
                    format!("{open}[{name}](../{name}.md){rest}")
                }
                None => word.to_owned(),
            }
        })
        .collect::<Vec<_>>()
        .join(" ")
}

/// A page: what it is made of, its parts.
fn page(title: &str, about: &str, parts: &[String]) -> String {
    let made = "Not to be edited: made by `server/src/command_line/reference.rs`, which says how.";
    let text = format!("# {title}\n\n{}\n\n{made}\n\n{}", filled(about), parts.join("\n"));
    text.trim_end().to_owned() + "\n"
}

/// Prose in lines that fit a page.
fn filled(text: &str) -> String {
    hanging(text, "")
}

/// The same, lines after the first begin with `indent`.
fn hanging(text: &str, indent: &str) -> String {
    let (mut lines, mut line) = (String::new(), String::new());
    for word in linked(text).split(' ') {
        if line.chars().count() + 1 + word.chars().count() > WIDTH - 2 && !line.trim().is_empty() {
            lines += &format!("{line}\n");
            line = indent.to_owned() + word;
        } else {
            let gap = if line.trim().is_empty() { "" } else { " " };
            line += &format!("{gap}{word}");
        }
    }
    lines + &line
}

/// A list of keys, each with its type and what is said of it.
fn keys(heading: &str, fields: &[Declared]) -> String {
    let mut text = format!("## {heading}\n\n");
    for field in fields {
        let (word, optional) = in_a_file(field);
        let need = if optional { "" } else { ", needed" };
        text += &hanging(&format!("- `{}` ({word}{need}): {}.", field.name, cell(&field.doc)), "  ");
        text.push('\n');
    }
    text
}

fn scene() -> String {
    let of = |name: &str| fields(SCENE, name);
    let mut rule = keys("A rule: `[[rule]]`", &fields(RULES, "RawRule")[..2]);
    for field in Effects::FIELDS {
        let doc = field.doc.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ");
        let kind = match field.values {
            Values::Words(_, words) => {
                let initial = words.iter().position(|w| field.word(w.word) == Some(field.initial)).unwrap_or(0);
                let each = words.iter().enumerate().map(|(i, w)| {
                    let said = w.doc.join(" ");
                    let said = said.trim().trim_end_matches('.');
                    format!("`\"{}\"`{}: {said}", w.word, if i == initial { " (default)" } else { "" })
                });
                rule += &hanging(&format!("- `{}` (string): {doc}", field.name), "  ");
                rule.push('\n');
                each.for_each(|line| rule += &format!("  {}\n", hanging(&format!("- {line}."), "    ")));
                continue;
            }
            Values::Flag(_) => "true, false",
            Values::Length => "number",
        };
        let initial = match field.initial {
            Setting::Flag(flag) => flag.to_string(),
            Setting::Length(length) => length.to_string(),
            Setting::Word(_) => String::new(),
        };
        rule += &(hanging(&format!("- `{}` ({kind}, default {initial}): {doc}", field.name), "  ") + "\n");
    }
    let about = "A scene is a TOML file: models, objects with their motions over one step, rules. Every key is known or refused \
                 with its place. What may be left out is not marked. An example is `server/models/assembly.toml`; \
                 what rules cost is in docs/effects.md.";
    let parts = [
        keys("The file", &of("RawScene")),
        keys("A model: `[[model]]`", &of("RawModel")),
        keys("An object: `[[object]]`", &of("RawObject")),
        keys("A pose: `{ position = …, rotation = … }`", &of("RawPose")),
        "The first rule that names a pair decides. A pair that no rule names is off once there are rules.\n".to_owned(),
        rule,
    ];
    page("Scene files", about, &parts)
}

/// The value of a setting where nothing is said.
fn initial(name: &str) -> String {
    let all = format!("{:?}", ServerConfig::default());
    let (_, rest) = all.split_once(&format!(" {name}: ")).unwrap_or_else(|| panic!("no default of {name}"));
    let value = rest.split([',', ' ']).next().unwrap_or_default();
    match value {
        "None" => "none".into(),
        "CacheFolder(None)" => "`\"off\"`".into(),
        number if number.parse::<u64>().is_ok() => number.into(),
        word => format!("`\"{}\"`", word.to_lowercase()),
    }
}

fn settings() -> String {
    let bounded = ServerConfig::default().bounded();
    let mut rows = String::from("## Keys\n\n");
    for field in fields(SETTINGS, "ServerConfig") {
        let (word, _) = in_a_file(&field);
        let bounds = bounded.iter().find(|(name, ..)| *name == field.name);
        let bounds = bounds.map_or(String::new(), |(_, _, least, most)| format!(", {least} to {most}"));
        let line =
            format!("- `{}` ({word}{bounds}; default {}): {}.", field.name, initial(&field.name), cell(&field.doc));
        rows += &(hanging(&line, "  ") + "\n");
    }
    let about = "A server's settings are a TOML file: `contactd serve --config FILE`. Options of the command line count for more. \
                 The same keys are the settings of an embedded engine, but for those that only a server has a use for: clients, waiting, \
                 files and ports. Every key is known or refused with its place.";
    page("Server settings", about, &[rows])
}

/// An argument's line.
fn argument(arg: &Arg) -> String {
    let values: Vec<String> = arg.get_value_names().unwrap_or_default().iter().map(ToString::to_string).collect();
    let takes = arg.get_action().takes_values();
    let mut name = match (arg.get_short(), arg.get_long()) {
        (Some(short), Some(long)) => format!("-{short}, --{long}"),
        (None, Some(long)) => format!("--{long}"),
        (Some(short), None) => format!("-{short}"),
        (None, None) => String::new(),
    };
    if takes {
        let value = if values.is_empty() { arg.get_id().as_str().to_uppercase() } else { values.join(" ") };
        name += &format!("{}{value}", if name.is_empty() { "" } else { " " });
    }
    let said = arg.get_help().map(ToString::to_string).unwrap_or_default();
    let defaults: Vec<String> =
        arg.get_default_values().iter().map(|v| v.to_string_lossy().into_owned()).filter(|_| takes).collect();
    let default = if defaults.is_empty() { String::new() } else { format!(" Default: `{}`.", defaults.join(" ")) };
    hanging(&format!("- `{name}`: {}.{default}", said.trim_end_matches('.')), "  ") + "\n"
}

fn commands() -> String {
    let mut root = Arguments::command().disable_help_subcommand(true).disable_version_flag(true);
    root.build();
    let (mut parts, mut left) = (Vec::new(), vec![(root, String::new())]);
    while let Some((command, above)) = left.pop() {
        let path = format!("{above}{}{}", if above.is_empty() { "" } else { " " }, command.get_name());
        let inner: Vec<_> = command.get_subcommands().cloned().collect();
        left.extend(inner.into_iter().rev().map(|inner| (inner, path.clone())));
        let about = command.get_about().map(ToString::to_string).unwrap_or_default();
        let mut text = format!("## `{path}`\n\n{}.\n\n", filled(about.trim_end_matches('.')));
        let own = |a: &&Arg| a.get_id() != "help" && (above.is_empty() || !a.is_global_set());
        command.get_arguments().filter(own).for_each(|a| text += &argument(a));
        parts.push(text.trim_end().to_owned() + "\n");
    }
    let about = "What each command takes; `contactd COMMAND --help` says the same. What they do, with examples: docs/commands.md. \
                 The options of `contactd` itself may stand behind every command.";
    page("Command line", about, &parts)
}

fn errors() -> String {
    let mut rows = String::from("## Refusals\n\n| code | name | sentence |\n|---|---|---|\n");
    for code in ErrorCode::ALL {
        let _ = writeln!(rows, "| {} | `{code:?}` | {} |", code.number(), cell(code.sentence()));
    }
    let about = "Why a server or an embedded engine refuses a request. Numbers never change; new ones are appended. In Rust they are \
                 `ErrorCode`, in Python `contactd.ErrorCode` (`Refused.code`), in C the values that a call returns. Errors of the \
                 client itself have numbers above 1000 in C: its header says each. A refusal's sentence names the object, record or \
                 place as well.";
    let exits = "## Exit status of `contactd`\n\n| status | when |\n|---|---|\n| 0 | done |\n| 1 | a recording was repeated with \
                 another answer, or something is in each other |\n| 2 | bad input |\n| 3 | undecided |\n";
    page("Error codes", about, &[rows, exits.to_owned()])
}

fn dialect() -> String {
    let names = |of: &[(&str, Fate)], which: fn(&Fate) -> bool| {
        let found: Vec<String> = of.iter().filter(|(_, f)| which(f)).map(|(name, _)| format!("`{name}`")).collect();
        found.join(", ")
    };
    let mut rows = String::from(
        "## Calls\n\n| call | read | without effect beside these | refused beside these |\n|---|---|---|---|\n",
    );
    for kind in &KINDS {
        let read = names(kind.fates, |f| matches!(f, Fate::Read(..)));
        let harmless = names(kind.fates, |f| matches!(f, Fate::Harmless));
        let refused = names(kind.fates, |f| matches!(f, Fate::Refused));
        let _ = writeln!(rows, "| `{}` | {read} | {harmless} | {refused} |", kind.name);
    }
    let about = "Calls of a flattened OpenSCAD text (`.csg`) with their arguments: those that shape the solid, those whose value changes \
                 nothing, and those that are refused with their place. A test tries each of them beside those that are read \
                 (`server/src/import/csg/dialect.rs`); where two words say one thing (`r` and `d`, `r` and `delta`), the other \
                 one is read alone. \
                 `convexity` is without effect everywhere; `$fn`, `$fa` and `$fs` count where a curve is taken in pieces. A name that \
                 no call knows is refused. What becomes of each call, transformations by name, calls that name a file, and this \
                 program's own words are in docs/openscad.md.";
    page("The .csg dialect", about, &[rows])
}

#[test]
fn the_reference_is_what_the_types_make() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reference");
    let pages = [
        ("scene.md", scene()),
        ("server.md", settings()),
        ("commands.md", commands()),
        ("errors.md", errors()),
        ("csg.md", dialect()),
    ];
    for (name, made) in &pages {
        if std::env::var_os("CONTACTD_WRITE_REFERENCE").is_some() {
            std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(folder.join(name), made)).expect("a page");
        }
        let stands = std::fs::read_to_string(folder.join(name)).unwrap_or_default();
        let lines = || stands.lines().zip(made.lines());
        let at = lines().position(|(a, b)| a != b).unwrap_or_else(|| lines().count());
        assert!(
            stands == *made,
            "docs/reference/{name} is stale at line {}: write it anew with CONTACTD_WRITE_REFERENCE=1 cargo test -p contactd --lib \
             reference",
            at + 1
        );
    }
    let there = std::fs::read_dir(&folder).expect("a folder").count();
    assert_eq!(there, pages.len(), "a page of docs/reference that nothing makes");
}

/// What is said to be a key is one, and nothing else is: the readers themselves are asked.
#[test]
fn every_key_that_is_told_is_read_and_no_other() {
    let sentence = |text: &str| match crate::import::Scene::parse("s.toml", text, Path::new("")) {
        Ok(_) => String::new(),
        Err(e) => e.to_string(),
    };
    for (table, of) in [("", "RawScene"), ("[[model]]\n", "RawModel"), ("[[object]]\n", "RawObject")] {
        let refused = sentence(&format!("{table}nonsense = 1"));
        let (_, known) = refused.split_once("expected ").unwrap_or_else(|| panic!("{refused}"));
        let mut known: Vec<&str> = known.split('`').skip(1).step_by(2).collect();
        let told = fields(SCENE, of);
        let mut told: Vec<&str> = told.iter().map(|f| f.name.as_str()).collect();
        known.sort_unstable();
        told.sort_unstable();
        assert_eq!(known, told, "{refused}");
    }
    for field in fields(SETTINGS, "ServerConfig") {
        let refused = ServerConfig::parse("c.toml", &format!("{} = [[]]", field.name)).expect_err("no such value");
        assert!(!refused.contains("unknown field"), "{refused}");
    }
    for (name, value, least, most) in ServerConfig::default().bounded() {
        assert!((least..=most).contains(&value), "the default of {name} is out of its bounds");
        let beyond = ServerConfig::parse("c.toml", &format!("{name} = {}", most + 1)).expect_err("beyond its bound");
        assert!(beyond.contains(&format!("{name} = {}: expected {least} to {most}", most + 1)), "{beyond}");
    }
}
