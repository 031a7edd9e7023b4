//! The server's two doors: shared memory for other processes, and an embedded session for the caller's own.
//!
//! Both lead to the same `scene`: commands and steps on one session's world. The loop (`lead`) takes steps as they come
//! and waits by spinning first and blocking then; long steps (`relay`), imports and mass properties (`jobs`) run beside it,
//! and so do recordings (`recordings`). Where requests come from is behind `port`, which
//! `services` has over shared memory. `root` makes sure that
//! one server of a name runs, that a killed predecessor is no obstacle, and that nothing stays behind.
//!
//! Invariant: what lies in shared memory is copied before it is branched on. It is no security boundary between
//! processes of one user: any of them can write to the segments.
//!
//! Floor 10: imports `world`, `import`, `recording` and everything below.

pub mod config;
mod embedded;
mod jobs;
mod lead;
mod log;
mod manager;
mod models;
mod port;
mod queries;
mod recordings;
mod relay;
mod root;
mod scene;
mod serve;
mod services;
mod session;
mod tally;
mod task;

pub use config::{CacheFolder, ServerConfig};
pub use embedded::{Embedded, embedded};
pub use log::Level;
pub use serve::{ServeError, Server, ready_threads, serve};
