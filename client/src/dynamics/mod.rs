//! A reference physics loop: rigid bodies stepped from contact to contact on contactd's records.
//!
//! One frame is a few rounds of look, solve, propose. *Look*: the engine tells all points in which bodies touch where they
//! stand. *Solve*: impulses at all these points together, never pair by pair; first those of impacts, then those that
//! hold what rests, slides or rolls. *Propose*: the engine searches the motions that follow for their first contact; the
//! world goes there and the rest of the frame begins anew. So bodies meet exactly and never pass through each other.
//!
//! Every effect is a switch ([`Effects`]): one that is off is not computed, and its counter stays 0. The loop uses any
//! [`Session`](crate::Session), over shared memory or embedded, and nothing of it but its public calls. The scheme with
//! its formulas, sources and limits: `docs/dynamics.md`.

mod arc;
mod body;
mod contacts;
mod effects;
mod impact;
mod inertia;
mod islands;
mod plan;
mod report;
mod row;
mod solver;
mod spin;
mod step;
mod world;

pub use body::{Body, State};
pub use contacts::{Overlap, Point};
pub use effects::{Counters, Damping, Effects, Penalty, Rest, Restitution, Sleep};
pub use inertia::Inertia;
pub use report::{Energy, Frame};
pub use world::{Settings, World};
