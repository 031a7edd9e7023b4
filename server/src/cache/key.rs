//! What a kept model is known by: a hash of everything from outside the program that decides what an import makes of it.

use crate::import::{Attachment, Facets, Format, Limits};

/// A BLAKE3 hash of 256 bits: no two files are taken for each other, not even two that were made for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key(pub(super) [u8; 32]);

impl Key {
    /// The key of a file's content and of how it is read. The limits count: what would be refused is not to be had from the cache.
    pub fn of(format: &Format, bytes: &[u8], facets: Facets, limits: &Limits) -> Self {
        let mut hasher = blake3::Hasher::new_derive_key("contactd 2026 key of a preprocessed model");
        let Limits {
            bytes: most,
            nodes,
            depth,
            faces,
            polyhedron_faces,
            hull_faces,
            outline_corners,
            mesh_facets,
            values,
        } = *limits;
        let shapes = [faces, polyhedron_faces, hull_faces, outline_corners, mesh_facets];
        for number in [facets as usize, most, nodes, depth].into_iter().chain(shapes).chain([values]) {
            hasher.update(&(number as u64).to_le_bytes());
        }
        hasher.update(&(format.name.len() as u64).to_le_bytes());
        hasher.update(format.name.as_bytes());
        // Last, for its length is not told.
        hasher.update(bytes);
        Self(*hasher.finalize().as_bytes())
    }

    /// The key of a file that names others, from its own.
    pub fn with(self, attached: &[Attachment]) -> Self {
        if attached.is_empty() {
            return self;
        }
        let mut hasher = blake3::Hasher::new_derive_key("contactd 2026 key of a preprocessed model of several files");
        hasher.update(&self.0);
        for file in attached {
            let bytes = file.bytes.as_deref().unwrap_or_default();
            hasher.update(&[u8::from(file.bytes.is_ok())]);
            for part in [file.name.as_bytes(), bytes] {
                hasher.update(&(part.len() as u64).to_le_bytes());
                hasher.update(part);
            }
        }
        Self(*hasher.finalize().as_bytes())
    }
}

impl std::fmt::Display for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|b| write!(f, "{b:02x}"))
    }
}
