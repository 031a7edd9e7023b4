//! XML texts: within limits, with places for what is wrong.

use super::Place;
use super::problem::Problem;
use roxmltree::{Document, Error, Node, ParsingOptions};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// Elements, texts and remarks of one document.
const MOST_NODES: u32 = 4_000_000;

/// A document of a text; entities that the text itself declares are replaced, files are not read.
///
/// # Errors
/// What is no XML, and where.
pub fn parse(bytes: &[u8]) -> Result<Document<'_>> {
    let text = text(bytes)?;
    let options = ParsingOptions { allow_dtd: true, nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|e| match e {
        Error::NodesLimitReached => {
            (Place::START, Problem::Limit { what: "nodes of a document", limit: MOST_NODES as usize })
        }
        e => {
            let at = Place { line: e.pos().row, column: e.pos().col };
            // The parser's sentences end with the place.
            let sentence = e.to_string();
            let found = sentence.rsplit_once(" at ").map_or(sentence.as_str(), |(head, _)| head).replace('\n', " ");
            (at, Problem::syntax("XML", format!("no such text ({found})")))
        }
    })
}

/// Text in UTF-8, or in UTF-16 or the like, which is told.
fn text(bytes: &[u8]) -> Result<&str> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    std::str::from_utf8(bytes).map_err(|e| {
        let before = String::from_utf8_lossy(&bytes[..e.valid_up_to()]);
        let found = format!("the byte 0x{:02x}", bytes[e.valid_up_to()]);
        (Place::of_offset(&before, before.len()), Problem::syntax("text in UTF-8", found))
    })
}

/// Where a node begins.
pub fn place(node: Node<'_, '_>) -> Place {
    let at = node.document().text_pos_at(node.range().start);
    Place { line: at.row, column: at.col }
}

/// The elements inside of a node that are called `name`, whatever their name space.
pub fn inside<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |n| n.is_element() && n.tag_name().name() == name)
}

/// A number that an attribute gives.
///
/// # Errors
/// What is no finite number; `None` stands for no attribute.
pub fn number(node: Node<'_, '_>, attribute: &str) -> Result<Option<f64>> {
    let Some(word) = node.attribute(attribute) else { return Ok(None) };
    finite(node, word, attribute).map(Some)
}

/// The finite number that `word` of `node` is; `what` tells what it stands for.
///
/// # Errors
/// What is none.
pub fn finite(node: Node<'_, '_>, word: &str, what: &str) -> Result<f64> {
    let number = word.trim().parse::<f64>().ok().filter(|n| n.is_finite());
    number.ok_or_else(|| wrong(node, format!("a finite number as {what} of {}", node.tag_name().name()), Some(word)))
}

/// Something else than `expected` stands in a node.
pub fn wrong(node: Node<'_, '_>, expected: impl Into<String>, found: Option<&str>) -> (Place, Problem) {
    let found = match found {
        None => "none".to_owned(),
        Some(word) => match word.char_indices().nth(40) {
            None => format!("{word:?}"),
            Some((end, _)) => format!("{:?} …", &word[..end]),
        },
    };
    (place(node), Problem::syntax(expected, found))
}
