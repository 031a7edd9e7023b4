//! Native module of the Python package `contactd`: one session type over shared memory or an engine in this process, and the
//! command `contactd`.
//!
//! It holds what needs Rust, and what every step does: the session, the memory of its poses and replies, the records' layouts.
//! Views, rules, poses and exceptions are Python (`contactd/*.py`), which is what users see.
//!
//! `unsafe` occurs where Python's buffers meet a session's memory (`lease.rs`, `slots.rs`, `reply.rs`, `bench.rs`), where contacts
//! meet MuJoCo's (`mujoco.rs`), and where the interpreter's lock is released
//! around a session that belongs to one thread (`confined.rs`).

mod batch;
mod bench;
mod command;
mod confined;
mod errors;
mod layout;
mod lease;
mod manifold;
mod mass;
mod mujoco;
mod options;
mod pose;
mod queries;
mod reply;
mod rules;
mod scene;
mod session;
mod slots;
mod solid;

use pyo3::prelude::*;

/// The native part of `contactd`.
// References are counted to see what nobody else has (`session.rs`); without the interpreter's lock their number is no proof.
#[pymodule(gil_used = true)]
mod _native {
    #[pymodule_export]
    use crate::batch::{Batch, batch_key};
    #[pymodule_export]
    use crate::bench::{fields_in_rust, whole_in_rust};
    #[pymodule_export]
    use crate::command::command_line;
    #[pymodule_export]
    use crate::errors::error_codes;
    #[pymodule_export]
    use crate::layout::{constants, layouts, words};
    #[pymodule_export]
    use crate::lease::{Export, Lease};
    #[pymodule_export]
    use crate::manifold::Manifolds;
    #[pymodule_export]
    use crate::mass::MassProperties;
    #[pymodule_export]
    use crate::mujoco::Coupled;
    #[pymodule_export]
    use crate::options::Options;
    #[pymodule_export]
    use crate::reply::Reply;
    #[pymodule_export]
    use crate::scene::{LoadedScene, load_scene};
    #[pymodule_export]
    use crate::session::Session;
    #[pymodule_export]
    use crate::slots::Slots;
    #[pymodule_export]
    use crate::solid::{Outline, Solid, flat, height_field, join, join_outlines, polygon, polyhedron, primitive};

    /// Version of the package.
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");

    /// Version of the protocol.
    #[pymodule_export]
    const PROTOCOL_VERSION: u32 = contactd_proto::names::PROTOCOL_VERSION;
}
