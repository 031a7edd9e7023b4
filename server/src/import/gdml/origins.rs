//! Which solid of a file a part of a volume's text stands for: what is noted of a text is told of the solid.
//!
//! Texts are kept without marks, so that solids of one shape are one model. Where a note is to be told, the file is read again with them.

use super::read_with;
use crate::import::{Limits, Note, Place, read_bytes};
use std::collections::HashMap;
use std::path::Path;

/// Before a solid's number.
const BEGIN: char = '\u{1}';
/// Behind it.
const NUMBERED: char = '\u{2}';
/// Behind the solid.
const END: char = '\u{3}';

/// A solid of a file.
#[derive(Clone, Debug)]
struct Origin {
    kind: String,
    name: String,
    at: Place,
}

/// Solids in the order in which they were written.
#[derive(Clone, Debug, Default)]
pub(super) struct Marks(Vec<Origin>);

impl Marks {
    /// The text of a solid with marks around it.
    pub(super) fn mark(&mut self, kind: &str, name: &str, at: Place, text: &str) -> String {
        self.0.push(Origin { kind: kind.to_owned(), name: name.to_owned(), at });
        format!("{BEGIN}{}{NUMBERED}{text}{END}", self.0.len() - 1)
    }
}

/// Where a solid stands in a text: from a column on, up to another one.
struct Span {
    from: u32,
    to: u32,
    origin: usize,
}

/// The solids of a file, and where each stands in the texts of its volumes.
pub struct Origins {
    solids: Vec<Origin>,
    spans: HashMap<String, Vec<Span>>,
}

impl Origins {
    /// Of a file that has been read before; none where it cannot be read any more.
    pub fn read(path: &Path) -> Self {
        let bytes = read_bytes(path, &Limits::default()).ok();
        let read = bytes.and_then(|bytes| read_with(&bytes, Some(Marks::default())).ok());
        let Some((volumes, Some(Marks(solids)))) = read else {
            return Self { solids: Vec::new(), spans: HashMap::new() };
        };
        let spans = volumes.volumes.into_iter().map(|v| (v.name, spans(&v.text))).collect();
        Self { solids, spans }
    }

    /// What is noted of a volume's text as a note of the file, and the innermost solid that it is of: kind and name.
    pub fn told(&self, volume: &str, note: &Note) -> Option<(Note, [&str; 2])> {
        let here = |s: &&Span| s.from <= note.at.column && note.at.column < s.to;
        let span = self.spans.get(volume)?.iter().filter(here).min_by_key(|s| s.to - s.from)?;
        let Origin { kind, name, at } = self.solids.get(span.origin)?;
        let mut what = note.text.as_str();
        // A solid is written as what OpenSCAD calls otherwise, and is not OpenSCAD's.
        for end in [", as OpenSCAD does", ", as OpenSCAD has it", ", as in OpenSCAD"] {
            what = what.strip_suffix(end).unwrap_or(what);
        }
        let own = what.strip_prefix("a ").unwrap_or(what).strip_prefix("polyhedron ");
        let text = match own {
            Some(rest) => format!("the {kind} {name:?} {rest}"),
            None => format!("the {kind} {name:?}: {what}"),
        };
        Some((Note { at: *at, text, amount: note.amount }, [kind, name]))
    }
}

/// The spans of a marked text, by the columns that the text has without marks.
fn spans(marked: &str) -> Vec<Span> {
    let (mut spans, mut open, mut column) = (Vec::new(), Vec::new(), 1);
    let mut rest = marked.chars();
    while let Some(c) = rest.next() {
        match c {
            BEGIN => {
                let number = rest.by_ref().take_while(|c| *c != NUMBERED).collect::<String>();
                open.push((column, number.parse().unwrap_or(usize::MAX)));
            }
            END => {
                let Some((from, origin)) = open.pop() else { continue };
                spans.push(Span { from, to: column, origin });
            }
            _ => column += 1,
        }
    }
    spans
}
