//! Failures as exceptions. The classes are Python's (`contactd/errors.py`), so that they read and inherit as Python's do.

use contactd_client::Error;
use contactd_proto::ErrorCode;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

/// The function of `contactd.errors` that makes an exception from a kind, a sentence, a code and an index.
static MAKE: PyOnceLock<Py<PyAny>> = PyOnceLock::new();

fn make(py: Python<'_>, kind: &str, sentence: &str, code: Option<u32>, index: Option<u32>) -> PyErr {
    let function =
        MAKE.get_or_try_init(py, || Ok::<_, PyErr>(py.import("contactd.errors")?.getattr("_make")?.unbind()));
    match function.and_then(|f| f.bind(py).call1((kind, sentence, code, index))) {
        Ok(exception) => PyErr::from_value(exception),
        Err(e) => e,
    }
}

/// The exception of a session's failure.
pub fn of(py: Python<'_>, error: &Error) -> PyErr {
    let kind = match error {
        Error::Refused { .. } => "Refused",
        Error::NoServer(_) => "NoServer",
        Error::ServerLost => "ServerLost",
        Error::ReplyLost => "ReplyLost",
        Error::Timeout => "Timeout",
        Error::Address(_) => "BadAddress",
        Error::Version { .. } => "VersionMismatch",
        // Python's solids are checked where they are built, so this is a call that cannot be.
        Error::Build(_) | Error::Misuse(_) => "Misuse",
        Error::System(_) => "SystemFailure",
    };
    let index = match error {
        Error::Refused { index, .. } => *index,
        _ => None,
    };
    make(py, kind, &error.to_string(), error.code().map(ErrorCode::number), index)
}

/// What an engine in this process refuses.
pub fn refused(py: Python<'_>, sentence: &str, code: ErrorCode) -> PyErr {
    make(py, "Refused", sentence, Some(code.number()), None)
}

/// A call that makes no sense now.
pub fn misuse(py: Python<'_>, sentence: &str) -> PyErr {
    make(py, "Misuse", sentence, None, None)
}

/// A view was used after its step.
pub fn stale(py: Python<'_>, sentence: &str) -> PyErr {
    make(py, "Stale", sentence, None, None)
}

/// Arrays into memory that would go are still held.
pub fn exported(py: Python<'_>, sentence: &str) -> PyErr {
    make(py, "StillExported", sentence, None, None)
}

/// A rule or an option that is none, at an index.
pub fn bad_rule(py: Python<'_>, sentence: &str, index: usize) -> PyErr {
    make(py, "Refused", sentence, Some(ErrorCode::BadRule.number()), u32::try_from(index).ok())
}

/// Each stable code: its name, number and sentence.
#[pyfunction]
pub fn error_codes() -> Vec<(String, u32, &'static str)> {
    ErrorCode::ALL.iter().map(|code| (format!("{code:?}"), code.number(), code.sentence())).collect()
}
