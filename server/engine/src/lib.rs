//! The engine of contactd: certified earliest contact of moving solids modelled by constructive solid geometry.
//!
//! It knows trees of exact faces and how they move; it knows no file format, no transport and no process but its own. The
//! package `contactd` adds those, hands on every module of this one, and has the page that shows the three stages, the queue
//! and the floors (`server/src/lib.rs`).
//!
//! | module | |
//! |---|---|
//! | [`math`] | boxes, balls, every tolerance with its reason |
//! | [`motion`] | a step's motion, one body seen from the other |
//! | [`solid`] | faces, primitives, trees, what is left of a tree in a small box |
//! | [`bound`] | stage 1: S-bounds of two trees |
//! | [`octree`] | stage 2: extended CSG octrees and their walk |
//! | [`contact`] | stage 3 and the queue: the answer for a pair ([`contact::earliest_contact`]) |
//! | [`world`] | a session's objects and rules: the answers of a step ([`world::World::step`]) |
#![forbid(unsafe_code)]

pub mod bound;
pub mod contact;
pub mod math;
pub mod motion;
pub mod octree;
pub mod solid;
pub mod world;
