//! The C interface of contactd: `include/contactd.h`, which is made of this crate and of the wire records of `proto`.
//!
//! One opaque handle for a session over shared memory and for one embedded in the caller's process. Every function that can
//! fail answers with a code: [`OK`](error::OK), the number of the server's refusal, or one of the client's own beyond 1000;
//! `contactd_error_message` says in one sentence what was wrong. Poses are written and records are read in place. No panic
//! crosses the boundary: a session in which one happened answers `CONTACTD_ERROR_PANIC` from then on.
//!
//! # What the caller promises
//! What can be checked is checked and answered with a code: NULL, misaligned pointers, text that is not UTF-8, numbers out of
//! range, calls out of order, from another thread, or from within a call. What cannot be seen from here is promised by the
//! caller, and every `unsafe` below rests on it:
//! 1. a pointer is NULL or points to as many valid elements of its type as the function says; nobody else writes to them
//!    during the call, and no two out parameters are the same variable;
//! 2. strings end with a zero byte;
//! 3. a session's handle came from `contactd_connect` or `contactd_embedded` and was not closed since (closing sets the
//!    caller's variable to NULL; copies of it are the caller's business);
//! 4. slots of poses are not used after `contactd_send` or `contactd_finish`, records not after the next
//!    `contactd_begin_step`, `contactd_reconnect`, `contactd_resend` or `contactd_close`;
//! 5. manifolds came from `contactd_manifolds_new`, were not freed since (freeing sets the caller's variable to NULL), and are in one
//!    call at a time;
//! 6. solids and outlines came from functions of `contactd_solid_…` and `contactd_outline_…`, were not freed since (freeing sets the
//!    caller's variable to NULL), and are in one call at a time;
//! 7. scenes came from `contactd_load_scene`, were not freed since (freeing sets the caller's variable to NULL), are in one call at a
//!    time, and are passed with the session that they were loaded into.

pub mod abi;
pub mod convention;
pub mod error;
pub mod handle;
pub mod loaded;
pub mod manifold;
pub mod model;
pub mod query;
pub mod recording;
pub mod scene;
pub mod session;
pub mod solid;
pub mod step;

mod models;
mod raw;

pub use handle::{Session, hand_over};
