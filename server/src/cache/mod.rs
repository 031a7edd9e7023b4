//! Preprocessed models kept on disk between runs: a model whose text was imported before is read instead.
//!
//! A cache is a folder with a file for each text, named by its key: a hash of the text and of whatever else decides what an
//! import makes of it (`key`). A file is used only when its format, its checksum, the program that wrote it and its key
//! are right and its content is consistent (`file`, `octree::snapshot`); any other is built anew and replaced. So a kept model has
//! the bits of a fresh one, and what lies in the folder decides nothing but the time that loading takes.
//!
//! Files are written beside their place and renamed into it: several processes may share a folder, and readers see a whole
//! file or none. They are not forced to the disk; what a power failure leaves is found by the checksum. Nothing here
//! fails: a folder that cannot be used is a sentence to be told, and models are imported as without one.
//!
//! Floor 8: imports `octree`, `import`, `math`.

mod file;
mod key;
#[cfg(test)]
mod tests;

pub use file::{Flaw, decode, encode};
pub use key::Key;

use crate::import::{Attachment, Facets, ImportError, Limits, Note, Scene, SceneError, Source};
use crate::octree::Model;
use std::collections::HashMap;
use std::fs::{self, DirBuilder, File};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::{DirBuilderExt as _, PermissionsExt as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime};

/// Bytes of a cache's files together, unless told otherwise.
pub const DEFAULT_BYTES: u64 = 4 << 30;

/// Ending of the files' names.
const SUFFIX: &str = ".model";
/// Beginning and ending of files that are being written.
const UNFINISHED: [&str; 2] = [".contactd-", ".tmp"];
/// Older unfinished files were left by a process that was killed.
const ABANDONED: Duration = Duration::from_secs(3600);

/// A folder of preprocessed models.
#[derive(Debug)]
pub struct Cache {
    folder: PathBuf,
    bytes: u64,
    /// It was told already that nothing can be written.
    reported: AtomicBool,
}

/// A model, ready to be used.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The model.
    pub model: Arc<Model>,
    /// What its import had to say.
    pub notes: Vec<Note>,
    /// Where it came from.
    pub origin: Origin,
    /// What is wrong with the cache, as one sentence.
    pub trouble: Option<String>,
}

/// Where a model came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Imported and preprocessed.
    Built,
    /// Read from the cache.
    Kept,
}

impl Cache {
    /// The cache in `folder`, which is created for its user alone when it is not there; its files together take at most
    /// `bytes`, those used longest ago go first.
    ///
    /// # Errors
    /// One sentence why it cannot be used: no such folder can be made, or all users may write to it.
    pub fn open(folder: &Path, bytes: u64) -> Result<Self, String> {
        let unusable = |found: String| {
            format!("{}: expected a folder for preprocessed models, found {found}; none are kept", folder.display())
        };
        DirBuilder::new().recursive(true).mode(0o700).create(folder).map_err(|e| unusable(e.to_string()))?;
        let mode = fs::metadata(folder).map_err(|e| unusable(e.to_string()))?.permissions().mode();
        if mode & 0o002 != 0 {
            return Err(unusable("one that all users may write to".into()));
        }
        let this = Self { folder: folder.into(), bytes, reported: AtomicBool::new(false) };
        this.sweep();
        Ok(this)
    }

    /// The file for a key, whether there is one or not.
    pub fn path(&self, key: &Key) -> PathBuf {
        self.folder.join(format!("{key}{SUFFIX}"))
    }

    /// What is kept for a key.
    ///
    /// # Errors
    /// Why nothing can be used.
    pub fn read(&self, key: &Key) -> Result<(Model, Vec<Note>), Flaw> {
        let path = self.path(key);
        let about = fs::metadata(&path)?;
        // Neither a pipe, which would never end, nor what can't have been written here.
        if !about.is_file() || about.len() > file::LARGEST {
            return Err(Flaw::Foreign);
        }
        let mut bytes = Vec::with_capacity(about.len() as usize);
        let mut file = File::open(&path)?;
        file.read_to_end(&mut bytes)?;
        let kept = decode(file::unseal(&bytes, key)?)?;
        // When it was last used; of no consequence where that can't be noted.
        let _ = file.set_modified(SystemTime::now());
        Ok(kept)
    }

    /// Keeps a model under a key; what is not worth keeping, or too large, is left out.
    ///
    /// # Errors
    /// The system's.
    pub fn write(&self, key: &Key, model: &Model, notes: &[Note]) -> io::Result<()> {
        let Some(content) = encode(model, notes) else { return Ok(()) };
        let sealed = file::seal(key, &content);
        if sealed.len() as u64 > self.bytes.min(file::LARGEST) {
            return Ok(());
        }
        // Gone again by itself, unless it gets its name.
        let mut file =
            tempfile::Builder::new().prefix(UNFINISHED[0]).suffix(UNFINISHED[1]).tempfile_in(&self.folder)?;
        file.write_all(&sealed)?;
        file.persist(self.path(key)).map_err(|e| e.error)?;
        self.trim();
        Ok(())
    }

    /// Removes files, those used longest ago first, until the rest keeps within the cache's size.
    fn trim(&self) {
        let mut files: Vec<(SystemTime, u64, PathBuf)> = self
            .files()
            .filter(|(path, _)| path.as_os_str().to_string_lossy().ends_with(SUFFIX))
            .filter_map(|(path, about)| Some((about.modified().ok()?, about.len(), path)))
            .collect();
        files.sort();
        let mut total: u64 = files.iter().map(|(_, len, _)| len).sum();
        for (_, len, path) in files {
            if total <= self.bytes {
                break;
            }
            // Another process may have been first.
            let _ = fs::remove_file(path);
            total -= len;
        }
    }

    /// Removes what killed processes have left half written.
    fn sweep(&self) {
        for (path, about) in self.files() {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let age = about.modified().ok().and_then(|m| m.elapsed().ok());
            if name.starts_with(UNFINISHED[0]) && name.ends_with(UNFINISHED[1]) && age.is_some_and(|a| a > ABANDONED) {
                let _ = fs::remove_file(&path);
            }
        }
    }

    /// The plain files in the folder.
    fn files(&self) -> impl Iterator<Item = (PathBuf, fs::Metadata)> {
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        entries.filter_map(|e| Some((e.path(), e.metadata().ok()?))).filter(|(_, about)| about.is_file())
    }
}

/// A model of a file, kept or imported; with a cache, what was imported is kept.
///
/// # Errors
/// What is wrong with the file.
pub fn prepare(
    cache: Option<&Cache>,
    source: &Source,
    facets: Facets,
    limits: &Limits,
) -> Result<Prepared, ImportError> {
    let build = || source.import(facets, limits).map(|i| (Model::new(i.solid), i.notes));
    let prepared = |(model, notes), origin, trouble| Prepared { model: Arc::new(model), notes, origin, trouble };
    let Some(cache) = cache else { return Ok(prepared(build()?, Origin::Built, None)) };
    let key = Key::of(source.format()?, source.bytes, facets, limits).with(source.attached.unwrap_or_default());
    let flaw = match cache.read(&key) {
        Ok(kept) => return Ok(prepared(kept, Origin::Kept, None)),
        Err(flaw) => flaw,
    };
    let mut trouble = flaw.is_trouble().then(|| {
        format!("{}: expected a kept model, found {flaw}; the model is imported anew", cache.path(&key).display())
    });
    let (model, notes) = build()?;
    if let Err(e) = cache.write(&key, &model, &notes)
        && !cache.reported.swap(true, Ordering::Relaxed)
    {
        trouble = Some(format!("{}: expected to keep a model, found {e}", cache.folder.display()));
    }
    Ok(prepared((model, notes), Origin::Built, trouble))
}

/// The models of a scene, in the scene's order; those of the same content are one.
///
/// # Errors
/// What is wrong with one of them.
pub fn prepare_scene(
    cache: Option<&Cache>,
    scene: &Scene,
    facets: Facets,
    limits: &Limits,
) -> Result<Vec<Prepared>, SceneError> {
    let mut known: HashMap<(&str, Vec<u8>, Vec<Attachment>), Prepared> = HashMap::new();
    scene.each_model(limits, |source| {
        let attached = source.attached.unwrap_or_default().to_vec();
        let key = (source.format()?.name, source.bytes.to_vec(), attached);
        if let Some(same) = known.get(&key) {
            return Ok(Prepared { trouble: None, ..same.clone() });
        }
        let prepared = prepare(cache, source, facets, limits)?;
        known.insert(key, prepared.clone());
        Ok(prepared)
    })
}
