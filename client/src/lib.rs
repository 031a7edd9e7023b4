//! Client of contactd: one [`Session`] over shared memory, or over an engine in the caller's own process.
//!
//! A session owns its objects. A step loans slots for poses, which the caller fills in place; the answer's records are
//! read in place. A server that dies is noticed within a second; the session then finds its successor and tells it all
//! it knew (see [`Session::reconnect`]).
//!
//! ```no_run
//! // With `contactd serve` running: a ball falls on a plate with a hole.
//! use contactd_client::glam::DVec3;
//! use contactd_client::proto::{Pose, PoseRecord};
//! use contactd_client::solid::{cuboid, cylinder};
//! use contactd_client::{Error, Object, Session};
//! use std::time::Duration;
//!
//! fn main() -> Result<(), Error> {
//!     let mut session = Session::connect("default")?;
//!     let plate = session.load_model("plate", &(cuboid(40.0, 40.0, 4.0) - cylinder(3.0, 9.0)))?;
//!     let ball = session.load_model("ball.csg", "sphere(r = 5);")?; // OpenSCAD's text, as a file has it
//!     session.add_object(Object::new("plate", plate.id).fixed())?;
//!     let ball = session.add_object(Object::new("ball", ball.id).at(Pose::at(DVec3::new(1.0, 0.0, 20.0))))?;
//!
//!     session.begin_step(1)?[0] = PoseRecord::end(ball, &Pose::at(DVec3::X)); // in place, in shared memory
//!     let reply = session.finish(Duration::from_secs(5))?;
//!     for c in reply.records() {
//!         println!("proven free until {:.9}, contact at {:.9}: {:?}, normal {:?}", c.time_lower, c.time, c.point, c.normal);
//!     }
//!     session.close()
//! }
//! ```
//!
//! `main` ends with a sentence where something is wrong: [`Error`] prints it either way. The same session on an engine in the
//! caller's own process is `contactd::embedded` of the package `contactd`. Vectors and quaternions are [`glam`]'s, in `f64`.
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
pub use glam;
pub use object::{ModelInfo, Object};
pub use reply::Reply;
pub use session::{Frame, Session, StepOptions};
pub use shm::SharedMemory;
pub use solid::Solid;
pub use transport::Transport;
