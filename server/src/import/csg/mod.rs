//! OpenSCAD's flattened tree (`openscad -o model.csg model.scad`), or the like written by hand: `lexer` and `syntax` read it,
//! `written` makes it flat where it is not, `lower` makes a solid.
//!
//! docs/openscad.md lists what loads and what it becomes. A cylinder with infinite radius and height, or a cube with infinite
//! sides, is a half-space or an intersection of some. What is not listed is refused by name.
//!
//! Nothing is dropped in silence. Read without effect is only what changes no shape: the arguments of color, convexity, the
//! `$`-variables that cut curves into pieces (`arguments::HARMLESS`; where they say that a curve is a prism they are read),
//! `slices` and `segments` of an extrusion without twist, and what a matrix says of z in 2D, which OpenSCAD ignores too (a
//! note tells of it). What a modifier leaves out, an extrusion of nothing, and what is subtracted from or cut with nothing
//! are notes. A test goes through all kinds of nodes with all their arguments.
//!
//! What has no size, no area or no volume is left out, as OpenSCAD does, and a note names its line; below a hull or a sum points
//! of what is flat count, where they do in OpenSCAD.

mod arguments;
mod combined;
#[cfg(test)]
mod constructs;
mod convex;
#[cfg(test)]
pub(crate) mod dialect;
mod element;
mod extrude;
mod facets;
mod flat;
mod hull;
mod imports;
mod lexer;
mod lower;
mod measured;
mod meshed;
mod offset;
mod outlines;
mod parts;
mod place;
mod polygon;
mod quadrics;
mod resize;
mod revolve;
mod shadow;
mod shapes;
mod slices;
mod straight;
mod superellipsoid;
mod swept;
mod syntax;
#[cfg(test)]
mod tests;
mod text;
mod twist;
#[cfg(test)]
mod whole;
mod written;

use super::problem::Problem;
use super::{Attachment, Facets, Format, Import, ImportError, Limits, Named, Note, Place, Read, Source};

/// Reads a model from the text of a flattened file; `file` is what errors call it.
pub fn import_csg(file: &str, text: &str, facets: Facets, limits: &Limits) -> Result<Import, ImportError> {
    import_with(file, text, (facets, None), limits)
}

fn import_with(
    file: &str,
    text: &str,
    (facets, attached): (Facets, Option<&[Attachment]>),
    limits: &Limits,
) -> Result<Import, ImportError> {
    syntax::parse(text, limits)
        .and_then(|mut tree| {
            written::flatten(&mut tree)?;
            lower::lower(&tree, (facets, attached), limits)
        })
        .map_err(|(at, problem)| (at, if is_stl(text) { Problem::syntax(CSG, STL) } else { problem }))
        .map_err(|(at, problem)| ImportError::Content { file: file.to_owned(), at, problem })
}

const CSG: &str = "OpenSCAD's CSG text";
const STL: &str = "an STL file (load it as such: by a name that ends in .stl, or with the format \"stl\")";

/// Whether a text that is no CSG begins as an STL file does.
fn is_stl(text: &str) -> bool {
    let mut words = text.split_whitespace();
    words.next() == Some("solid") && text.contains("facet") && !text.trim_start().starts_with("solid(")
}

/// The row of `format::FORMATS`.
pub const FORMAT: Format = Format { name: "csg", endings: &["csg"], read: Read::Model(import_bytes), names: named };

/// The files that the text imports and the fonts that it is set in, each once.
fn named(bytes: &[u8], limits: &Limits) -> Vec<Named> {
    // All names are told by these two words: a text without them, which may be long, is not read twice.
    let may_name = |text: &&str| ["file", "text"].iter().any(|word| text.contains(word));
    let text = std::str::from_utf8(bytes).ok().filter(may_name);
    let tree = text.and_then(|text| syntax::parse(text, limits).ok());
    let Some(tree) = tree else { return Vec::new() };
    let mut all: Vec<Named> = Vec::new();
    for call in &tree.calls {
        let named = match call.name.as_str() {
            "import" | "surface" | "linear_extrude" | "rotate_extrude" => imports::file_of(call).map(Named::File),
            "text" => text::font_of(call).map(Named::Font),
            _ => None,
        };
        all.extend(named.filter(|n| !all.contains(n)));
    }
    all
}

fn import_bytes(source: &Source, facets: Facets, limits: &Limits) -> Result<Import, ImportError> {
    let (file, bytes) = (source.name, source.bytes);
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let before = String::from_utf8_lossy(&bytes[..e.valid_up_to()]);
        let at = Place::of_offset(&before, before.len());
        let found = format!("the byte 0x{:02x}", bytes[e.valid_up_to()]);
        ImportError::Content { file: file.to_owned(), at, problem: Problem::syntax("text in UTF-8", found) }
    })?;
    let mut import = import_with(file, text, (facets, source.attached), limits)?;
    let warnings = source.attached.unwrap_or_default().iter().filter(|a| a.name == Attachment::WARNINGS);
    let warnings = warnings.filter_map(|a| std::str::from_utf8(a.bytes.as_ref().ok()?).ok()).flat_map(str::lines);
    let note = |line: &str| Note { at: Place::START, text: format!("openscad: {line}"), amount: None };
    import.notes.splice(..0, warnings.map(note));
    Ok(import)
}
