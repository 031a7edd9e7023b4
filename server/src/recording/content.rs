//! A model by its content: what was sent, the files that it names, and how it is taken. It is the same model everywhere.

use crate::import::Attachment;
use crate::world::MeasuredModel;
use bincode::{Decode, Encode};
use contactd_proto::control::Facets;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

/// A content's hash (BLAKE3).
pub type Key = [u8; 32];

/// What a model was made of.
#[derive(Clone, Debug, Encode, Decode)]
pub struct Content {
    /// What errors called it when it was first loaded; no part of what it is.
    pub name: String,
    /// The name of its format.
    pub format: String,
    /// How curved primitives are taken.
    pub facets: Facets,
    /// The bytes of its file.
    pub bytes: Vec<u8>,
    /// The files that it names; `None` where it may name none.
    pub attached: Option<Vec<Attachment>>,
}

impl Content {
    /// The hash of what it is.
    pub fn key(&self) -> Key {
        let mut hasher = blake3::Hasher::new();
        let mut part = |bytes: &[u8]| {
            hasher.update(&(bytes.len() as u64).to_le_bytes());
            hasher.update(bytes);
        };
        part(self.format.as_bytes());
        part(&[self.facets as u8, u8::from(self.attached.is_some())]);
        part(&self.bytes);
        for attachment in self.attached.iter().flatten() {
            part(attachment.name.as_bytes());
            match &attachment.bytes {
                Ok(bytes) => part(bytes),
                // A file that was not read is another one than a file that says why.
                Err(why) => [b"not read", why.as_bytes()].into_iter().for_each(&mut part),
            }
        }
        *hasher.finalize().as_bytes()
    }

    fn what(&self) -> (&str, Facets, &[u8], &Option<Vec<Attachment>>) {
        (&self.format, self.facets, &self.bytes, &self.attached)
    }
}

impl PartialEq for Content {
    fn eq(&self, other: &Self) -> bool {
        self.what() == other.what()
    }
}

impl Eq for Content {}

impl Hash for Content {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.what().hash(state);
    }
}

/// A loaded model with its content.
#[derive(Clone, Debug)]
pub struct Part {
    /// What it was made of.
    pub content: Arc<Content>,
    /// What was made of it.
    pub model: Arc<MeasuredModel>,
}
