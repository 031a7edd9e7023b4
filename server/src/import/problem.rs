//! What is wrong with the content of a model's file.

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
    /// One of several meshes that is not the surface of a solid.
    #[error("expected closed meshes, found body {number} of {count} to be {fault}")]
    Body {
        /// Which one, from 1.
        number: usize,
        /// How many there are.
        count: usize,
        /// What it is.
        fault: String,
    },
    /// Something in another file that the text names.
    #[error("{file}:{at}: {problem}")]
    Named {
        /// That file.
        file: String,
        /// Where in it.
        at: super::Place,
        /// What.
        problem: Box<Problem>,
    },
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

    /// Is it a mesh that is no surface of a solid?
    pub(super) fn is_of_a_mesh(&self) -> bool {
        match self {
            Self::Mesh(_) | Self::Surface(_) | Self::Body { .. } => true,
            Self::Named { problem, .. } => problem.is_of_a_mesh(),
            Self::Syntax { .. } | Self::Unsupported { .. } | Self::Limit { .. } => false,
        }
    }

    pub(super) fn unsupported(construct: impl Into<String>) -> Self {
        Self::Unsupported { construct: construct.into(), hint: "" }
    }
}
