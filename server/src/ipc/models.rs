//! Models by content: two sessions that load the same file share one model.
//!
//! The content itself is the key, so no two files are ever taken for each other. An entry lives as long as a session uses it.
//! With a disk cache, models are kept beyond that, and between runs.

use super::config::ServerConfig;
use crate::cache::{self, Cache, Prepared};
use crate::import::{self, ImportError, Problem, Source};
use crate::math::halt;
use crate::recording::{Content, Part};
use crate::solid::Sense;
use crate::world::{MeasuredModel, Refusal};
use contactd_proto::ErrorCode;
use contactd_proto::control::{FaceName, Facets, ModelFile};
use std::collections::HashMap;
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// A model as sessions use it.
#[derive(Debug)]
pub struct Loaded {
    /// The model and its measures.
    pub part: Arc<MeasuredModel>,
    /// What it was made of.
    pub content: Arc<Content>,
    /// Its faces by id.
    pub faces: Vec<FaceName>,
    /// What the import had to say.
    pub warnings: Vec<String>,
}

impl Loaded {
    /// As recordings have it.
    pub fn part(&self) -> Part {
        Part { content: self.content.clone(), model: self.part.clone() }
    }
}

/// The models in use.
#[derive(Debug)]
pub struct Models {
    limits: import::Limits,
    cache: Option<Cache>,
    /// Where texts may import files from.
    root: Option<PathBuf>,
    loaded: Mutex<HashMap<Arc<Content>, Weak<Loaded>>>,
}

impl Models {
    /// None yet. A disk cache that cannot be used is a warning on standard error.
    pub fn new(config: &ServerConfig) -> Self {
        let cache = config.cache.folder().map(|folder| Cache::open(folder, config.cache_mb << 20));
        let cache = cache.and_then(|opened| opened.map_err(|e| warn(&e)).ok());
        let (limits, root) = (config.import_limits(), config.import_root.clone());
        Self { limits, cache, root, loaded: Mutex::new(HashMap::new()) }
    }

    /// The model of a file, imported if it is not in use already. May take seconds for a large one.
    ///
    /// # Errors
    /// `Model` or a limit, with line and column in the sentence.
    pub fn load(&self, file: &ModelFile, facets: Facets) -> Result<Arc<Loaded>, Refusal> {
        let ModelFile { name, format, bytes, attached } = file;
        let source = Source { name, format, bytes, attached: None };
        let format = source.format().map_err(|e| Refusal::new(ErrorCode::Model, e.to_string()))?;
        let of_root = || self.root.as_ref().map(|root| import::files_of(&source, root, &self.limits));
        let attached = attached.clone().or_else(of_root);
        let (name, format) = (name.clone(), format.name.to_owned());
        self.of_content(Arc::new(Content { name, format, facets, bytes: bytes.clone(), attached }))
    }

    /// The model of a content, imported if it is not in use already.
    ///
    /// # Errors
    /// As `load`.
    pub fn of_content(&self, content: Arc<Content>) -> Result<Arc<Loaded>, Refusal> {
        let known = self.loaded.lock().unwrap_or_else(PoisonError::into_inner).get(&content).and_then(Weak::upgrade);
        if let Some(known) = known {
            return Ok(known);
        }
        let failed = || Refusal::new(ErrorCode::Internal, format!("{}: import failed", content.name));
        let loaded = Arc::new(halt::catch(|| self.make(&content)).unwrap_or_else(|_| Err(failed()))?);
        let mut map = self.loaded.lock().unwrap_or_else(PoisonError::into_inner);
        map.retain(|_, model| model.strong_count() > 0);
        map.insert(content, Arc::downgrade(&loaded));
        Ok(loaded)
    }

    /// Models in use.
    pub fn count(&self) -> usize {
        let map = self.loaded.lock().unwrap_or_else(PoisonError::into_inner);
        map.values().filter(|model| model.strong_count() > 0).count()
    }

    fn make(&self, content: &Arc<Content>) -> Result<Loaded, Refusal> {
        let Content { name, format, facets, bytes, attached } = &**content;
        let source = &Source { name, format, bytes, attached: attached.as_deref() };
        let facets = import::Facets::from(*facets);
        if source.bytes.len() > self.limits.bytes {
            return Err(Refusal::new(ErrorCode::LimitText, format!("{}: {} bytes", source.name, source.bytes.len())));
        }
        for file in attached.iter().flatten() {
            if let Some(bytes) = file.bytes.as_ref().ok().filter(|bytes| bytes.len() > self.limits.bytes) {
                let detail = format!("{name}: {} of {} bytes", file.name, bytes.len());
                return Err(Refusal::new(ErrorCode::LimitText, detail));
            }
        }
        let prepared = cache::prepare(self.cache.as_ref(), source, facets, &self.limits);
        let prepared = prepared.map_err(|e| Refusal::new(code_of(&e), e.to_string()))?;
        if let Some(trouble) = &prepared.trouble {
            warn(trouble);
        }
        Ok(loaded(prepared, content.clone()))
    }
}

/// A line on standard error, if anybody reads it: a terminal that is gone is no reason to end.
pub fn warn(sentence: &str) {
    let _ = writeln!(std::io::stderr(), "contactd: {sentence}");
}

fn loaded(Prepared { model, notes, .. }: Prepared, content: Arc<Content>) -> Loaded {
    let solid = &model.solid;
    let faces = (0..solid.faces.len()).map(|id| {
        let primitive = solid.face_owner[id];
        let p = &solid.primitives[primitive as usize];
        FaceName {
            primitive,
            name: p.label.name.clone(),
            face: p.face_name(id - p.first_face as usize),
            subtracted: solid.senses[primitive as usize] == Sense::Negative,
        }
    });
    let faces = faces.collect();
    Loaded {
        faces,
        warnings: notes.iter().map(ToString::to_string).collect(),
        part: Arc::new(MeasuredModel::new(model)),
        content,
    }
}

fn code_of(error: &ImportError) -> ErrorCode {
    match error {
        ImportError::Content { problem: Problem::Limit { what, .. }, .. } => match *what {
            "bytes of text" => ErrorCode::LimitText,
            what if what.contains("level") => ErrorCode::LimitDepth,
            what if what.contains("face") => ErrorCode::LimitFaces,
            _ => ErrorCode::LimitNodes,
        },
        ImportError::Large { .. } => ErrorCode::LimitText,
        _ => ErrorCode::Model,
    }
}

#[cfg(test)]
mod tests {
    use super::super::CacheFolder;
    use super::*;

    const PART: &str = "difference() { cube(size = [4, 4, 1], center = true); sphere(r = 1); }";

    #[test]
    fn a_text_that_is_sent_imports_files_of_the_root_that_the_server_has_and_no_others() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("root")).unwrap();
        let cube = |side: &str| format!("solid\n{}endsolid\n", TETRAHEDRON.replace('9', side));
        for name in ["root/part.stl", "other.stl"] {
            std::fs::write(folder.path().join(name), cube("9")).unwrap();
        }
        let root = folder.path().join("root");
        let models = Models::new(&ServerConfig { import_root: Some(root.clone()), ..ServerConfig::default() });
        let load = |models: &Models, name: &str| {
            let bytes = format!("import(file = \"{name}\");").into_bytes();
            models.load(&ModelFile::new("sent", "", bytes), Facets::Auto)
        };
        let first = load(&models, "part.stl").unwrap_or_else(|e| panic!("{}", e.detail));
        assert_eq!(first.part.model.solid.primitives.len(), 1);
        assert!(Arc::ptr_eq(&first, &load(&models, "part.stl").expect("the same")));
        std::fs::write(root.join("part.stl"), cube("8")).unwrap();
        assert!(!Arc::ptr_eq(&first, &load(&models, "part.stl").expect("another file by now")));
        let outside = load(&models, "../other.stl").expect_err("outside").detail;
        assert!(outside.starts_with("sent:1:1: expected a readable file, found \"../other.stl\", which is not in"));
        let closed = load(&Models::new(&ServerConfig::default()), "part.stl").expect_err("no root").detail;
        assert!(
            closed.ends_with("(a text that is sent names no files: send the mesh itself, by its format)"),
            "{closed}"
        );
    }

    /// The facets of a tetrahedron.
    const TETRAHEDRON: &str = "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 9 0\nvertex 9 0 0\nendloop\nendfacet\n\
         facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 9 0 0\nvertex 0 0 9\nendloop\nendfacet\n\
         facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 9\nvertex 0 9 0\nendloop\nendfacet\n\
         facet normal 0 0 0\nouter loop\nvertex 9 0 0\nvertex 0 9 0\nvertex 0 0 9\nendloop\nendfacet\n";

    #[test]
    fn whoever_loads_a_text_shares_one_model_while_it_is_in_use() {
        let folder = tempfile::tempdir().unwrap();
        let cache = CacheFolder::from(folder.path().to_path_buf());
        for config in [ServerConfig::default(), ServerConfig { cache, ..ServerConfig::default() }] {
            let models = Models::new(&config);
            let load = |name: &str, facets| {
                let file = ModelFile::new(name, "", PART);
                models.load(&file, facets).expect("a valid text")
            };
            let (first, second) = (load("one", Facets::Auto), load("another", Facets::Auto));
            assert!(Arc::ptr_eq(&first, &second));
            assert!(!Arc::ptr_eq(&first, &load("exact", Facets::Exact)));
            let all = format!("{:?}", first.part.model);
            let gone = Arc::downgrade(&first.part.model);
            drop((first, second));
            assert!(gone.upgrade().is_none(), "nobody uses it");
            assert!(format!("{:?}", load("again", Facets::Auto).part.model) == all);
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "auto and exact");
    }
}
