//! How a primitive stands in its tree.

/// How a primitive enters a solid: its volume (positive), or the complement of its volume (negative, subtracted).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// The primitive's own volume.
    Positive,
    /// The complement of its volume.
    Negative,
}

impl Sense {
    /// The other one.
    pub fn flipped(self) -> Self {
        match self {
            Sense::Positive => Sense::Negative,
            Sense::Negative => Sense::Positive,
        }
    }
}
