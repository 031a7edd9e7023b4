//! OpenSCAD's flattened tree (`openscad -o model.csg model.scad`): `lexer` and `syntax` read it, `lower` makes a solid.
//!
//! Supported: group, union, difference, intersection, color, render, multmatrix; sphere, cylinder, cube, polyhedron;
//! linear_extrude over circle, square, convex polygon and set operations of them; the modifiers `%`, `*` (left out),
//! `#` (kept), `!` (root). A cylinder with infinite radius and height, or a cube with infinite sides, is a half-space or
//! an intersection of some. Everything else is refused by name.
//!
//! Nothing is dropped in silence. Read without effect is only what changes no shape: the arguments of color, convexity, the
//! `$`-variables that cut curves into pieces (`arguments::HARMLESS`; where they say that a curve is a prism they are read),
//! `slices` and `segments` of an extrusion without twist, and what a matrix says of z in 2D, which OpenSCAD ignores too (a
//! note tells of it). What a modifier leaves out, an extrusion of nothing, and what is subtracted from or cut with nothing
//! are notes. A test goes through all kinds of nodes with all their arguments.
//!
//! OpenSCAD drops primitives of size zero in silence; here they are refused, for an object that vanishes in silence is
//! never what a collision query should answer for.

mod arguments;
#[cfg(test)]
mod dialect;
mod extrude;
mod lexer;
mod lower;
mod place;
mod syntax;
#[cfg(test)]
mod tests;

use super::{Facets, Import, ImportError, Limits, Place};
use crate::solid::primitive::MeshError;
use std::path::Path;

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
    /// A mesh that is not a convex polyhedron.
    #[error("expected a closed convex polyhedron, found {0}")]
    Mesh(#[from] MeshError),
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

/// Reads a model from a flattened file.
pub fn read_csg(path: &Path, facets: Facets, limits: &Limits) -> Result<Import, ImportError> {
    import_csg(&path.display().to_string(), &read_text(path, limits)?, facets, limits)
}

/// Reads the text of a flattened file.
pub fn read_text(path: &Path, limits: &Limits) -> Result<String, ImportError> {
    let file = path.display().to_string();
    let read = |reason| ImportError::Read { file: file.clone(), reason };
    if std::fs::metadata(path).map_err(read)?.len() > limits.text as u64 {
        let problem = Problem::Limit { what: "bytes of text", limit: limits.text };
        return Err(ImportError::Content { file, at: Place::START, problem });
    }
    let bytes = std::fs::read(path).map_err(read)?;
    String::from_utf8(bytes).map_err(|e| {
        let (valid, bytes) = (e.utf8_error().valid_up_to(), e.as_bytes());
        let before = String::from_utf8_lossy(&bytes[..valid]);
        let at = Place::of_offset(&before, before.len());
        let found = format!("the byte 0x{:02x}", bytes[valid]);
        ImportError::Content { file, at, problem: Problem::syntax("text in UTF-8", found) }
    })
}
