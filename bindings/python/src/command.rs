//! The command `contactd`, in the process of a Python that was started for it.

use contactd::demo::Program;
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;

/// Runs the command; gives its exit status. `arguments` begin with the program's name; `again` is how this program is started again.
#[pyfunction]
#[pyo3(name = "_command_line")]
pub fn command_line(py: Python<'_>, arguments: Vec<OsString>, again: Vec<OsString>) -> u8 {
    let mut again = again.into_iter();
    let program = Program { path: again.next().map(PathBuf::from).unwrap_or_default(), arguments: again.collect() };
    py.detach(|| contactd::command_line::run(arguments, &program))
}
