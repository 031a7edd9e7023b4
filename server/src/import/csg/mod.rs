//! OpenSCAD's flattened tree (`openscad -o model.csg model.scad`): `lexer` and `syntax` read it, `lower` makes a solid.
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
//! What has no size, no area or no volume is left out, as OpenSCAD does, and a note names its line.

mod arguments;
#[cfg(test)]
mod constructs;
mod convex;
#[cfg(test)]
mod dialect;
mod extrude;
mod facets;
mod flat;
mod hull;
mod lexer;
mod lower;
mod offset;
mod outlines;
mod parts;
mod place;
mod polygon;
mod revolve;
mod shapes;
mod syntax;
#[cfg(test)]
mod tests;

use super::{Facets, Format, Import, ImportError, Limits, Place};
use crate::solid::primitive::{MeshError, MeshFault};

/// What is wrong with a model's text.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// Something else stands where the format wants something.
    #[error("expected {expected}, found {found}")]
    Syntax {
        /// What could stand there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// A construct of the language that has no exact solid here.
    #[error("expected a supported construct, found {construct}, which is not supported{hint}")]
    Unsupported {
        /// The construct.
        construct: String,
        /// What to do about it, as a parenthesis; may be empty.
        hint: &'static str,
    },
    /// A mesh that is no polyhedron.
    #[error("expected a closed polyhedron, found {0}")]
    Mesh(#[from] MeshError),
    /// A mesh that is not the surface of a solid.
    #[error("expected a closed mesh, found {0}")]
    Surface(#[from] MeshFault),
    /// A limit was reached.
    #[error("expected at most {limit} {what}, found more")]
    Limit {
        /// Of what.
        what: &'static str,
        /// How many.
        limit: usize,
    },
}

impl Problem {
    pub(super) fn syntax(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self::Syntax { expected: expected.into(), found: found.into() }
    }

    pub(super) fn unsupported(construct: impl Into<String>) -> Self {
        Self::Unsupported { construct: construct.into(), hint: "" }
    }
}

/// Reads a model from the text of a flattened file; `file` is what errors call it.
pub fn import_csg(file: &str, text: &str, facets: Facets, limits: &Limits) -> Result<Import, ImportError> {
    syntax::parse(text, limits)
        .and_then(|tree| lower::lower(&tree, facets, limits))
        .map_err(|(at, problem)| ImportError::Content { file: file.to_owned(), at, problem })
}

/// The row of `format::FORMATS`.
pub const FORMAT: Format = Format { name: "csg", endings: &["csg"], read: import_bytes };

fn import_bytes(file: &str, bytes: &[u8], facets: Facets, limits: &Limits) -> Result<Import, ImportError> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let before = String::from_utf8_lossy(&bytes[..e.valid_up_to()]);
        let at = Place::of_offset(&before, before.len());
        let found = format!("the byte 0x{:02x}", bytes[e.valid_up_to()]);
        ImportError::Content { file: file.to_owned(), at, problem: Problem::syntax("text in UTF-8", found) }
    })?;
    import_csg(file, text, facets, limits)
}
