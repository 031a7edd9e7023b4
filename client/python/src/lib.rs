//! Native module of the Python package `contactd`: one session type over shared memory or an engine in this process.
//!
//! It holds what needs Rust: the session, the memory of its poses and replies, the records' layouts. Views, rules, poses and
//! exceptions are Python (`contactd/*.py`), which is what users see.
//!
//! `unsafe` occurs where Python's buffers meet a session's memory (`lease.rs`) and where the interpreter's lock is released
//! around a session that belongs to one thread (`confined.rs`).

mod confined;
mod errors;
mod layout;
mod lease;
mod mass;
mod options;
mod rules;
mod session;

use pyo3::prelude::*;

/// The native part of `contactd`.
#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::errors::error_codes;
    #[pymodule_export]
    use crate::layout::{constants, layouts, words};
    #[pymodule_export]
    use crate::lease::{Export, Lease};
    #[pymodule_export]
    use crate::mass::MassProperties;
    #[pymodule_export]
    use crate::options::Options;
    #[pymodule_export]
    use crate::session::{Reply, Session, connect, embedded};

    /// Version of the package.
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");

    /// Version of the protocol.
    #[pymodule_export]
    const PROTOCOL_VERSION: u32 = contactd_proto::names::PROTOCOL_VERSION;
}
