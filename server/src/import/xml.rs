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

/// A text in which what XML forbids, and the programs that robots' files are written for (TinyXML) read all the same, is put right:
/// two dashes within a remark, prefixes of name spaces that nothing declares, what says that it is XML behind a remark, zero bytes at the
/// end. Lines stay as they are.
pub fn mended(mut bytes: Vec<u8>) -> Vec<u8> {
    /// Prefixes of one file.
    const MOST: usize = 32;
    while bytes.last() == Some(&0) {
        bytes.pop();
    }
    remarks(&mut bytes);
    if let Some(at) = find(&bytes, b"<?xml ", 1)
        && root_name(&bytes).is_some_and(|root| at < root)
        && let Some(end) = find(&bytes, b"?>", at)
    {
        bytes[at..end + 2].iter_mut().filter(|b| !b.is_ascii_whitespace()).for_each(|b| *b = b' ');
    }
    for _ in 0..MOST {
        let options = ParsingOptions { allow_dtd: true, nodes_limit: MOST_NODES, ..ParsingOptions::default() };
        let parsed = text(&bytes).ok().map(|text| Document::parse_with_options(text, options));
        let (Some(Err(Error::UnknownNamespace(prefix, _))), Some(at)) = (parsed, root_name(&bytes)) else { break };
        let declared = format!(" xmlns:{prefix}=\"{prefix}\"");
        bytes.splice(at..at, declared.into_bytes());
    }
    bytes
}

/// Where a piece of some bytes begins, not before `from`.
fn find(bytes: &[u8], piece: &[u8], from: usize) -> Option<usize> {
    let rest = bytes.get(from..)?;
    rest.windows(piece.len()).position(|w| w == piece).map(|at| from + at)
}

/// Replaces the dashes of remarks that hold two in a row.
fn remarks(bytes: &mut [u8]) {
    let mut from = 0;
    while let Some(at) = find(bytes, b"<!", from) {
        if bytes[at..].starts_with(b"<![CDATA[") {
            let Some(end) = find(bytes, b"]]>", at) else { return };
            from = end;
        } else if bytes[at..].starts_with(b"<!--") {
            let Some(end) = find(bytes, b"-->", at + 4) else { return };
            let inner = &mut bytes[at + 4..end];
            if inner.ends_with(b"-") || inner.windows(2).any(|w| w == b"--") {
                inner.iter_mut().filter(|b| **b == b'-').for_each(|b| *b = b'.');
            }
            from = end;
        } else {
            from = at + 2;
        }
    }
}

/// Where the name of the root element ends.
fn root_name(bytes: &[u8]) -> Option<usize> {
    let mut from = 0;
    loop {
        let at = find(bytes, b"<", from)?;
        from = match bytes.get(at + 1)? {
            b'?' => find(bytes, b"?>", at)?,
            b'!' if bytes[at..].starts_with(b"<!--") => find(bytes, b"-->", at + 4)?,
            // A document type, with what it declares in brackets.
            b'!' => match (find(bytes, b"[", at), find(bytes, b">", at)?) {
                (Some(inner), end) if inner < end => find(bytes, b"]", inner)?,
                (_, end) => end,
            },
            _ => {
                let name = bytes[at + 1..].iter().position(|b| b.is_ascii_whitespace() || b"/>".contains(b))?;
                return Some(at + 1 + name);
            }
        };
    }
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

/// Whether `word` of `node` is the first of two words or the second; `what` tells what it stands for.
///
/// # Errors
/// What is neither, letter by letter.
pub fn either(node: Node<'_, '_>, word: &str, what: &str, [yes, no]: [&str; 2]) -> Result<bool> {
    let is_yes = word == yes;
    if is_yes || word == no { Ok(is_yes) } else { Err(wrong(node, format!("{yes} or {no} as {what}"), Some(word))) }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    /// Random documents of plain elements with remarks, prefixes and texts that XML forbids here and there: of each the elements,
    /// their names, lines and texts are those of the same document without what is forbidden.
    #[test]
    fn what_is_mended_is_read_as_if_it_had_been_written_well() {
        let mut r = Random(3);
        let mut mended_some = 0;
        for _ in 0..500 {
            let (mut bad, mut good) = (String::new(), String::new());
            let mut both = |b: &str, g: &str| {
                bad += b;
                good += g;
            };
            if r.unit() < 0.5 {
                both("<?xml version='1.0'?>\n", "<?xml version='1.0'?>\n");
            }
            if r.unit() < 0.3 {
                both("<!-- <gz:robot> -- \n->-->", "<!-- \n -->");
                both("<?xml version='1.0'\n?>", "\n");
            }
            if r.unit() < 0.3 {
                both("<!DOCTYPE sdf [<!ENTITY a \"b\">]>", "<!DOCTYPE sdf [<!ENTITY a \"b\">]>");
            }
            both("<sdf", "<sdf");
            both(" version='1.9'>", " version='1.9'>");
            for k in 0..(r.unit() * 6.0) as u32 {
                let (b, g) = match (r.unit() * 6.0) as u32 {
                    0 => (format!("<gz:a{k}>1</gz:a{k}>"), format!("<a{k}>1</a{k}>")),
                    1 => (format!("<b{k} my:c='2'/>\n"), format!("<b{k}/>\n")),
                    2 => ("<!-- one -- two ---->\n".into(), "<!-- one -->\n".into()),
                    3 => ("<!---->".into(), String::new()),
                    4 => {
                        (format!("<t{k}><![CDATA[<!-- a--b -->]]></t{k}>"), format!("<t{k}>&lt;!-- a--b --&gt;</t{k}>"))
                    }
                    _ => (format!("<other:d{k}\n/>"), format!("<d{k}\n/>")),
                };
                both(&b, &g);
            }
            both("</sdf>", "</sdf>");
            if r.unit() < 0.2 {
                both("\0\0", "");
            }
            let bytes = mended(bad.clone().into_bytes());
            mended_some += usize::from(bytes != bad.as_bytes());
            let (read, wanted) = (parse(&bytes), parse(good.as_bytes()).unwrap_or_else(|e| panic!("{good}: {e:?}")));
            let read = read.unwrap_or_else(|e| panic!("{bad}: {e:?}"));
            let told = |d: &Document<'_>| -> Vec<(String, u32, Option<String>)> {
                let all = d.descendants().filter(Node::is_element);
                all.map(|n| (n.tag_name().name().to_owned(), place(n).line, n.text().map(str::to_owned))).collect()
            };
            assert_eq!(told(&read), told(&wanted), "{bad}");
        }
        assert!(mended_some > 300, "{mended_some}");
        // What is wrong in another way stays as it is, and is told.
        for text in ["<a><b></a>", "<a", "", "<!-- a", "<![CDATA["] {
            assert_eq!(mended(text.as_bytes().to_vec()), text.as_bytes());
            assert!(parse(text.as_bytes()).is_err());
        }
    }
}
