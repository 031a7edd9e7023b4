//! Models by content: two sessions that load the same text share one model.
//!
//! The text itself is the key, so no two texts are ever taken for each other. An entry lives as long as a session uses it.

use crate::eco::Model;
use crate::import::{self, ImportError, Problem};
use crate::solid::Sense;
use crate::world::{Part, Refusal};
use contactd_proto::ErrorCode;
use contactd_proto::control::{FaceName, Facets};
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// A model as sessions use it.
#[derive(Debug)]
pub struct Loaded {
    /// The model and its measures.
    pub part: Arc<Part>,
    /// Its faces by id.
    pub faces: Vec<FaceName>,
    /// What the import had to say.
    pub warnings: Vec<String>,
}

/// The models in use.
#[derive(Debug)]
pub struct Models {
    limits: import::Limits,
    loaded: Mutex<HashMap<(Facets, Arc<str>), Weak<Loaded>>>,
}

impl Models {
    /// None yet.
    pub fn new(limits: import::Limits) -> Self {
        Self { limits, loaded: Mutex::new(HashMap::new()) }
    }

    /// The model of a text, imported if it is not in use already. May take seconds for a large one.
    ///
    /// # Errors
    /// `Model` or a limit, with line and column in the sentence.
    pub fn load(&self, name: &str, text: &str, facets: Facets) -> Result<Arc<Loaded>, Refusal> {
        let key = (facets, Arc::<str>::from(text));
        let known = self.loaded.lock().unwrap_or_else(PoisonError::into_inner).get(&key).and_then(Weak::upgrade);
        if let Some(known) = known {
            return Ok(known);
        }
        let made = catch_unwind(AssertUnwindSafe(|| make(name, text, facets, &self.limits)));
        let loaded =
            made.unwrap_or_else(|_| Err(Refusal::new(ErrorCode::Internal, format!("{name}: import failed"))))?;
        let loaded = Arc::new(loaded);
        let mut map = self.loaded.lock().unwrap_or_else(PoisonError::into_inner);
        map.retain(|_, model| model.strong_count() > 0);
        map.insert(key, Arc::downgrade(&loaded));
        Ok(loaded)
    }
}

fn make(name: &str, text: &str, facets: Facets, limits: &import::Limits) -> Result<Loaded, Refusal> {
    let facets = match facets {
        Facets::Auto => import::Facets::Auto,
        Facets::Exact => import::Facets::Exact,
        Facets::AsWritten => import::Facets::AsWritten,
    };
    if text.len() > limits.text {
        return Err(Refusal::new(ErrorCode::LimitText, format!("{name}: {} bytes", text.len())));
    }
    let import =
        import::import_csg(name, text, facets, limits).map_err(|e| Refusal::new(code_of(&e), e.to_string()))?;
    let model = Arc::new(Model::new(import.solid));
    let solid = &model.solid;
    let faces = (0..solid.faces.len()).map(|id| {
        let primitive = solid.face_owner[id];
        let p = &solid.primitives[primitive as usize];
        FaceName {
            primitive,
            name: p.label.name.clone(),
            face: p.shape.geometry().face_name(id - p.first_face as usize),
            subtracted: solid.senses[primitive as usize] == Sense::Negative,
        }
    });
    let faces = faces.collect();
    Ok(Loaded {
        faces,
        warnings: import.notes.iter().map(ToString::to_string).collect(),
        part: Arc::new(Part::new(model)),
    })
}

fn code_of(error: &ImportError) -> ErrorCode {
    match error {
        ImportError::Content { problem: Problem::Limit { what, .. }, .. } => match *what {
            "bytes of text" => ErrorCode::LimitText,
            what if what.contains("level") => ErrorCode::LimitDepth,
            what if what.contains("face") => ErrorCode::LimitFaces,
            _ => ErrorCode::LimitNodes,
        },
        _ => ErrorCode::Model,
    }
}
