//! What a kept model is known by: a hash of everything from outside the program that decides what an import makes of it.

use crate::import::{Facets, Limits};

/// A BLAKE3 hash of 256 bits: no two texts are taken for each other, not even two that were made for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key(pub(super) [u8; 32]);

impl Key {
    /// The key of a text and of how it is read. The limits count: a text is not to be had from the cache where it would
    /// be refused.
    pub fn of(text: &str, facets: Facets, limits: &Limits) -> Self {
        let mut hasher = blake3::Hasher::new_derive_key("contactd 2026 key of a preprocessed model");
        let Limits { text: bytes, nodes, depth, faces, polyhedron_faces, values } = *limits;
        for number in [facets as usize, bytes, nodes, depth, faces, polyhedron_faces, values] {
            hasher.update(&(number as u64).to_le_bytes());
        }
        // Last, for its length is not told.
        hasher.update(text.as_bytes());
        Self(*hasher.finalize().as_bytes())
    }
}

impl std::fmt::Display for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|b| write!(f, "{b:02x}"))
    }
}
