//! The committed Python file of rules and effects is the one that their tables make.
//!
//! `CONTACTD_WRITE_PYTHON=1 cargo test -p contactd-proto --test python` writes it anew after a change of a table.

use contactd_proto::effects;
use contactd_proto::rule::{Effects, Values};
use std::fmt::Write as _;
use std::path::Path;

const HEAD: &str = "\
\"\"\"Rules of pairs, and the effects that ran in a step.

Not to be edited: made of the tables in proto/src/rule.rs and proto/src/effects.rs by proto/tests/python.rs.
\"\"\"

from __future__ import annotations

import enum
from dataclasses import KW_ONLY, dataclass
from typing import Sequence


@dataclass
class Rule:
    \"\"\"What happens between two groups of objects. The first rule that names a pair decides; see docs/effects.md.\"\"\"

    #: The two groups; both may be the same.
    between: Sequence[str]
    #: Single pairs, by object name, that this rule leaves out.
    except_: Sequence[Sequence[str]] = ()
    _: KW_ONLY
";

/// Lines of a comment that stands above what it describes.
fn comment(doc: &[&str]) -> String {
    doc.iter().fold(String::new(), |text, line| text + "    #:" + line + "\n")
}

fn made() -> String {
    let mut text = String::from(HEAD);
    for field in Effects::FIELDS {
        text += &comment(field.doc);
        let name = field.name;
        let _ = match field.values {
            Values::Words(_, words) => {
                let all: Vec<String> = words.iter().map(|word| format!("\"{}\"", word.word)).collect();
                let (last, others) = all.split_last().expect("words");
                let initial = field.get(&Effects::DEFAULT);
                let initial = words.iter().find(|word| field.word(word.word) == Some(initial)).expect("one of them");
                let _ = writeln!(text, "    #: One of {} or {last}.", others.join(", "));
                writeln!(text, "    {name}: str = \"{}\"", initial.word)
            }
            Values::Flag(_) => writeln!(text, "    {name}: bool = False"),
            Values::Length => writeln!(text, "    {name}: float = 0.0"),
        };
    }
    text += "\n\nclass Effect(enum.IntFlag):\n    \"\"\"Effects that ran in a step.\"\"\"\n\n";
    for effect in effects::ALL {
        text += &comment(effect.doc);
        let _ = writeln!(text, "    {} = {}", effect.bit.trim_start_matches("EFFECT_"), effect.value);
    }
    text
}

#[test]
fn the_committed_rules_of_python_are_those_that_the_tables_make() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bindings/python/contactd/rules.py");
    let made = made();
    if std::env::var_os("CONTACTD_WRITE_PYTHON").is_some() {
        std::fs::write(&file, &made).expect("a file that can be written");
    }
    let committed = std::fs::read_to_string(&file).expect("bindings/python/contactd/rules.py");
    let differs = made.lines().zip(committed.lines()).position(|(a, b)| a != b);
    assert!(
        made == committed,
        "bindings/python/contactd/rules.py is not what the tables make, from line {}: write it anew with \
         CONTACTD_WRITE_PYTHON=1 cargo test -p contactd-proto --test python",
        differs.unwrap_or(made.lines().count().min(committed.lines().count())) + 1
    );
}
