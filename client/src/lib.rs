//! Client of contactd: one [`Session`] over shared memory, or over an engine in the caller's own process.
//!
//! A session owns its objects. A step loans slots for poses, which the caller fills in place; the answer's records are
//! read in place. A server that dies is noticed within a second; the session then finds its successor and tells it all
//! it knew (see [`Session::reconnect`]).
//!
//! What lies in shared memory can be written by any process of the same user: contactd keeps users apart, not the
//! processes of one user.
#![forbid(unsafe_code)]

pub mod convention;
pub mod dynamics;
pub mod error;
mod journal;
pub mod manifold;
mod object;
mod reply;
pub mod session;
pub mod shm;
pub mod solid;
pub mod transport;

pub use contactd_proto as proto;
pub use contactd_proto::{MassOptions, MassProperties};
pub use error::Error;
pub use object::{ModelInfo, Object};
pub use reply::Reply;
pub use session::{Session, StepOptions};
pub use shm::SharedMemory;
pub use solid::Solid;
pub use transport::Transport;
