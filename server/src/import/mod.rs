//! File formats: models (`format` lists them; OpenSCAD's flattened ones: `csg`; what flattens them: `openscad`; meshes:
//! `mesh`), scene files (`scene`) and robots (`robot`).
//!
//! A file is read completely or refused with one sentence that names the file, the line, the column, what was expected
//! and what stands there. Real files are rough; whatever is snapped, flipped, merged or taken in another way than
//! OpenSCAD's facets would have it is a `Note`, so that `inspect` can tell. Nothing here panics, whatever the bytes, and
//! `Limits` bound what a file may ask for before memory is spent on it.
//!
//! Floor 7: imports `solid`, `math`, `proto`.

mod arrangement;
pub mod csg;
pub mod drawing;
pub mod font;
pub mod format;
pub mod gdml;
pub mod mesh;
mod names;
pub mod openmc;
pub mod openscad;
pub mod problem;
pub mod robot;
pub mod scene;
mod surface;
mod written;
mod xml;
mod zip;

pub use csg::import_csg;
pub use format::{Attachment, FORMATS, Format, ModelBytes, Named, Read, Source, files_of, read_bytes, read_model};
pub use openscad::{Access, Openscad};
pub use problem::Problem;
pub use scene::{ModelSource, Scene, SceneError, SceneObject, pose_text, read_scene};

use crate::solid::Solid;

/// A place in a text; lines and columns count from 1, columns in characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: u32,
    /// Column.
    pub column: u32,
}

impl Place {
    /// The first character.
    pub const START: Self = Self { line: 1, column: 1 };

    /// The place of byte `offset` of `text`; the last place when it is beyond the end.
    pub fn of_offset(text: &str, offset: usize) -> Self {
        let mut at = Self::START;
        for (i, c) in text.char_indices() {
            if i >= offset {
                break;
            }
            at = if c == '\n' {
                Self { line: at.line + 1, column: 1 }
            } else {
                Self { line: at.line, column: at.column + 1 }
            };
        }
        at
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}", self.line, self.column)
    }
}

/// A model with what was done to read it.
#[derive(Clone, Debug)]
pub struct Import {
    /// The solid, primitives in file order.
    pub solid: Solid,
    /// What was snapped or taken in another way than it stands there, in file order.
    pub notes: Vec<Note>,
}

/// One thing that `inspect` should tell about an import.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    /// Where.
    pub at: Place,
    /// What, as a sentence without its full stop.
    pub text: String,
    /// By how much, where that can be said; length, or relative for a matrix.
    pub amount: Option<f64>,
}

/// What stands in notes of facets before their number, and before how far off they are.
const FACETED: &str = ": faceted, ";
/// See `FACETED`.
const DEVIATION: &str = " facets, max deviation ";

impl Note {
    /// Of a shape that is taken in facets: how many, and how far off they are at most, a length.
    pub fn facets(&self) -> Option<(u64, f64)> {
        let (_, rest) = self.text.rsplit_once(FACETED)?;
        let (count, off) = rest.split_once(DEVIATION)?;
        Some((count.parse().ok()?, off.parse().ok()?))
    }

    /// True where something that a file names is not in its solid, but for what the file itself takes out by a modifier.
    pub fn is_loss(&self) -> bool {
        self.text.contains("left out") && ![" after %:", " after *:"].iter().any(|taken| self.text.contains(taken))
    }
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.at, self.text)?;
        self.amount.map_or(Ok(()), |a| write!(f, " (by {a:.1e})"))
    }
}

/// How curved primitives are taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Facets {
    /// Always exact, whatever `$fn` says.
    Exact,
    /// Exact when `$fn` is 0 or at least 9; below that the prism or polyhedron that OpenSCAD would make.
    #[default]
    Auto,
    /// Always the prism or polyhedron that OpenSCAD would make of `$fn`, `$fa` and `$fs`.
    AsWritten,
}

impl Facets {
    /// The words of the command line, in the order of the variants.
    pub const NAMES: [&'static str; 3] = ["exact", "auto", "as-written"];

    /// The one called `word`.
    pub fn of_name(word: &str) -> Option<Self> {
        let all = [Self::Exact, Self::Auto, Self::AsWritten];
        Self::NAMES.iter().position(|n| *n == word).map(|i| all[i])
    }
}

impl From<contactd_proto::control::Facets> for Facets {
    fn from(told: contactd_proto::control::Facets) -> Self {
        match told {
            contactd_proto::control::Facets::Auto => Self::Auto,
            contactd_proto::control::Facets::Exact => Self::Exact,
            contactd_proto::control::Facets::AsWritten => Self::AsWritten,
        }
    }
}

/// The most that a model file may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of the file.
    pub bytes: usize,
    /// Calls in a file.
    pub nodes: usize,
    /// Levels of nesting.
    pub depth: usize,
    /// Faces of all primitives together.
    pub faces: usize,
    /// Faces of one polyhedron that a text lists, or a curve's pieces: what looks at all of them for each of them is cheap enough.
    pub polyhedron_faces: usize,
    /// Faces of one convex hull.
    pub hull_faces: usize,
    /// Corners of one outline that is extruded, each the half-space of a side.
    pub outline_corners: usize,
    /// Triangles of one mesh that is not convex.
    pub mesh_facets: usize,
    /// Values in one list.
    pub values: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            bytes: 64 << 20,
            nodes: 1_000_000,
            // The deepest of several hundred real files has 23 levels. Trees are walked by recursion on higher floors.
            depth: 1_000,
            faces: 2_000_000,
            polyhedron_faces: 5_000,
            hull_faces: 100_000,
            outline_corners: 200_000,
            mesh_facets: 1_000_000,
            values: 1_000_000,
        }
    }
}

/// Why a model was not read.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The file cannot be read at all.
    #[error("{file}: expected a readable file, found {reason}")]
    Read {
        /// The file.
        file: String,
        /// The system's reason.
        reason: std::io::Error,
    },
    /// More bytes than the limit.
    #[error("{file}: expected at most {limit} bytes, found more")]
    Large {
        /// The file.
        file: String,
        /// How many.
        limit: usize,
    },
    /// OpenSCAD did not flatten a text.
    #[error("{file}: expected OpenSCAD to flatten it, found {found}")]
    Flatten {
        /// The file.
        file: String,
        /// What happened instead.
        found: String,
    },
    /// A format that is not read.
    #[error("{file}: expected one of the formats {expected}, found {found}")]
    Format {
        /// The file.
        file: String,
        /// The names of those that are.
        expected: String,
        /// What was stated, in quotes; or what a file is whose name ends like this one's.
        found: String,
    },
    /// Something in the file.
    #[error("{file}:{at}: {problem}")]
    Content {
        /// The file.
        file: String,
        /// Where.
        at: Place,
        /// What.
        problem: Problem,
    },
}
