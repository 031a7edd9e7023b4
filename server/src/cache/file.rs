//! A kept model's file: a header that says what it is, a checksum over all of it, the content.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `contactd` |
//! | 4 | number of the format, little-endian |
//! | 32 | BLAKE3 of everything after it |
//! | 64 | the preprocessing that made it, as `build.rs` names it |
//! | 32 | the key |
//! | rest | the content, bincode |

use super::Key;
use crate::import::{Note, Place};
use crate::octree::{Model, Snapshot, SnapshotView};
use bincode::{BorrowDecode, Encode, config};
use std::io;

const MAGIC: &[u8; 8] = b"contactd";

/// Number of the format: of the header, of the content's layout, and of what its numbers mean.
pub(super) const FORMAT: u32 = 1;

/// The preprocessing that this program does: a hash of its sources.
pub(super) const PROGRAM: &[u8; 64] = match env!("CONTACTD_PREPROCESSING").as_bytes().first_chunk() {
    Some(hash) => hash,
    None => panic!("a hash has 64 digits"),
};

/// Bytes of a file at most.
pub(super) const LARGEST: u64 = LIMIT as u64;
const LIMIT: usize = 1 << 30;

/// Why a file is not used.
#[derive(Debug, thiserror::Error)]
pub enum Flaw {
    /// It cannot be read; most often, there is none.
    #[error("{0}")]
    Unread(#[from] io::Error),
    /// No file of a cache.
    #[error("a file of another kind")]
    Foreign,
    /// Of another version of the format.
    #[error("format {0}")]
    Format(u32),
    /// Cut off, or not what was written.
    #[error("damage")]
    Damaged,
    /// Made by a program that preprocesses in another way, or whose sources differ.
    #[error("a model of another version of the program")]
    Program,
    /// Of another text, or read in another way.
    #[error("the model of another text")]
    Key,
    /// As it was written, but no model.
    #[error("no model: expected {0}")]
    Content(&'static str),
}

impl Flaw {
    /// True for what does not happen in the normal course: neither an absent file nor one of an older program.
    pub fn is_trouble(&self) -> bool {
        match self {
            Self::Unread(e) => e.kind() != io::ErrorKind::NotFound,
            Self::Format(_) | Self::Program => false,
            Self::Foreign | Self::Damaged | Self::Key | Self::Content(_) => true,
        }
    }
}

/// A file of a content.
pub(super) fn seal(key: &Key, content: &[u8]) -> Vec<u8> {
    sealed(FORMAT, PROGRAM, key, content)
}

/// A file as another version might write it.
pub(super) fn sealed(format: u32, program: &[u8; 64], key: &Key, content: &[u8]) -> Vec<u8> {
    let mut hasher = blake3::Hasher::new();
    hasher.update(program).update(&key.0).update(content);
    [MAGIC.as_slice(), &format.to_le_bytes(), hasher.finalize().as_bytes(), program, &key.0, content].concat()
}

/// The content of a file, if it is for `key` and of this program.
pub(super) fn unseal<'f>(bytes: &'f [u8], key: &Key) -> Result<&'f [u8], Flaw> {
    let rest = bytes.strip_prefix(MAGIC).ok_or(Flaw::Foreign)?;
    let (format, rest) = rest.split_first_chunk().ok_or(Flaw::Damaged)?;
    if *format != FORMAT.to_le_bytes() {
        return Err(Flaw::Format(u32::from_le_bytes(*format)));
    }
    let (checksum, body) = rest.split_first_chunk::<32>().ok_or(Flaw::Damaged)?;
    if blake3::hash(body) != *checksum {
        return Err(Flaw::Damaged);
    }
    let (program, rest) = body.split_first_chunk().ok_or(Flaw::Damaged)?;
    let (of, content) = rest.split_first_chunk().ok_or(Flaw::Damaged)?;
    if program != PROGRAM {
        return Err(Flaw::Program);
    }
    if *of != key.0 {
        return Err(Flaw::Key);
    }
    Ok(content)
}

#[derive(Encode)]
struct Content {
    notes: Vec<(u32, u32, String, Option<f64>)>,
    model: Snapshot,
}

#[derive(BorrowDecode)]
struct ContentView<'a> {
    notes: Vec<(u32, u32, &'a str, Option<f64>)>,
    model: SnapshotView<'a>,
}

/// The content for a model and the notes of its import; `None` when it is one that could not be read again.
pub fn encode(model: &Model, notes: &[Note]) -> Option<Vec<u8>> {
    let notes = notes.iter().map(|n| (n.at.line, n.at.column, n.text.clone(), n.amount)).collect();
    let content = Content { notes, model: Snapshot::of(model)? };
    bincode::encode_to_vec(&content, config::standard()).ok()
}

/// The model and the notes of a content.
///
/// # Errors
/// `Content` for bytes that are none; never a panic, whatever they are.
pub fn decode(content: &[u8]) -> Result<(Model, Vec<Note>), Flaw> {
    let limited = config::standard().with_limit::<LIMIT>();
    let view: ContentView<'_> = match bincode::borrow_decode_from_slice(content, limited) {
        Ok((view, used)) if used == content.len() => view,
        _ => return Err(Flaw::Content("a model's fields and nothing else")),
    };
    let model = view.model.restore().map_err(Flaw::Content)?;
    let notes = view.notes.into_iter();
    let notes =
        notes.map(|(line, column, text, amount)| Note { at: Place { line, column }, text: text.into(), amount });
    Ok((model, notes.collect()))
}
