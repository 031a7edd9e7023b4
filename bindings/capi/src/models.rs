//! What a session's handle keeps of its models.

use crate::error::Failure;
use contactd_client::ModelInfo;
use contactd_proto::error::ErrorCode;
use std::collections::HashMap;
use std::ffi::{CString, c_char};

/// The models of a session, and the strings that were given out of them.
#[derive(Default)]
pub(crate) struct Models {
    infos: HashMap<u32, ModelInfo>,
    strings: HashMap<String, CString>,
}

impl Models {
    /// Adds a model that was loaded.
    pub(crate) fn add(&mut self, info: ModelInfo) {
        self.infos.insert(info.id, info);
    }

    /// One of them.
    ///
    /// # Errors
    /// There is none of this id.
    pub(crate) fn of(&self, model: u32) -> Result<&ModelInfo, Failure> {
        self.infos.get(&model).ok_or_else(|| ErrorCode::UnknownModel.into())
    }

    /// A string that stays where it is as long as the models do.
    pub(crate) fn string(&mut self, text: &str) -> *const c_char {
        if !self.strings.contains_key(text) {
            // Names and warnings have no zero bytes; one that had would end there.
            let bytes = text.split('\0').next().unwrap_or_default();
            self.strings.insert(text.into(), CString::new(bytes).unwrap_or_default());
        }
        self.strings[text].as_ptr()
    }
}
