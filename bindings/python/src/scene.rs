//! Scenes from files in a session: the native half of `contactd.scene`.

use crate::errors;
use crate::queries;
use crate::session::Session;
use contactd::load::{self, LoadError, LoadOptions, LoadScene};
use contactd_client::Error;
use contactd_proto::ErrorCode;
use contactd_proto::rule::{Effects, Setting, Values};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A joint: name, whether it turns, its limits, where it stands.
type Joint = (String, bool, [f64; 2], f64);

/// Hulls, packages, SRDF, keyframe, import root, whether the session's rules stay.
type Options = (bool, Vec<PathBuf>, Option<PathBuf>, Option<String>, Option<PathBuf>, bool);

/// A scene that was loaded.
#[pyclass(module = "contactd")]
pub struct LoadedScene {
    of: load::LoadedScene,
}

fn error(py: Python<'_>, error: &LoadError) -> PyErr {
    let sentence = error.to_string();
    match error {
        LoadError::Session(error) => errors::of(py, error),
        LoadError::Refused { error: Error::Refused { code, .. }, .. } => errors::refused(py, &sentence, *code),
        LoadError::Refused { error, .. } => errors::of(py, error),
        LoadError::Scene(_) | LoadError::Kind { .. } => errors::refused(py, &sentence, ErrorCode::Model),
    }
}

#[pymethods]
impl LoadedScene {
    /// Its objects in the order of the file: name, id, id of the model.
    fn objects(&self) -> Vec<(String, u32, u32)> {
        self.of.objects.iter().map(|o| (o.name.clone(), o.id, o.model)).collect()
    }

    fn joints(&self) -> Vec<Joint> {
        self.of.joints().into_iter().map(|j| (j.name, j.turns, j.range, j.value)).collect()
    }

    /// Unit, notes, duration of the file's step.
    fn about(&self) -> (String, Vec<String>, Option<f64>) {
        (self.of.unit.clone(), self.of.notes.clone(), self.of.dt)
    }

    /// Its rules: groups, exceptions, settings by name.
    fn rules<'py>(&self, py: Python<'py>) -> PyResult<Vec<([String; 2], Vec<[String; 2]>, Bound<'py, PyDict>)>> {
        let rule = |rule: &contactd_proto::Rule| {
            let (effects, settings) = (rule.effects(), PyDict::new(py));
            for field in Effects::FIELDS {
                match (field.values, field.get(&effects)) {
                    (Values::Words(_, words), Setting::Word(code)) => {
                        settings.set_item(field.name, words[code as usize].word)?;
                    }
                    (_, Setting::Flag(on)) => settings.set_item(field.name, on)?,
                    (_, Setting::Length(length)) => settings.set_item(field.name, length)?,
                    (_, Setting::Word(code)) => settings.set_item(field.name, code)?,
                }
            }
            Ok((rule.between.clone(), rule.except.clone(), settings))
        };
        self.of.rules.iter().map(rule).collect()
    }

    fn set_joints(&mut self, session: &Bound<'_, Session>, values: BTreeMap<String, f64>) -> PyResult<()> {
        let (py, of) = (session.py(), &mut self.of);
        let done = Session::whole(session, |s| of.set_joints(s, &values))?;
        done.map_err(|e| error(py, &e))
    }

    fn stop_at(&mut self, session: &Bound<'_, Session>, time: f64) -> PyResult<()> {
        let (py, of) = (session.py(), &mut self.of);
        let done = Session::whole(session, |s| of.stop_at(s, time))?;
        done.map_err(|e| error(py, &e))
    }

    /// Records of dtype ``POSE``.
    fn records<'py>(
        &mut self,
        session: &Bound<'py, Session>,
        to: BTreeMap<String, f64>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let (py, of) = (session.py(), &mut self.of);
        let records = Session::whole(session, |s| of.records(s, &to))?.map_err(|e| error(py, &e))?;
        Ok(PyBytes::new(py, queries::bytes(&records)))
    }

    /// The step of the last records was refused.
    fn refused(&mut self) {
        self.of.refused();
    }
}

/// Loads a scene into a session.
#[pyfunction]
#[pyo3(name = "_load_scene")]
pub fn load_scene(
    session: &Bound<'_, Session>,
    path: PathBuf,
    joints: BTreeMap<String, f64>,
    options: Options,
) -> PyResult<LoadedScene> {
    let (hulls, packages, srdf, key, import_root, keeps_rules) = options;
    let options = LoadOptions { joints, key, hulls, packages, srdf, import_root, keeps_rules };
    let loaded = Session::whole(session, |s| s.load_scene(&path, &options))?;
    Ok(LoadedScene { of: loaded.map_err(|e| error(session.py(), &e))? })
}
