//! The engine of contactd: certified earliest contact of moving solids modelled by constructive solid geometry.
//!
//! It knows trees of exact faces and how they move; it knows no file format, no transport and no process but its own.
//! The package `contactd` adds those, hands on every module of this one, and has the page that shows the three stages
//! and the queue (`server/src/lib.rs`). docs/architecture.md has the floors: each module imports from smaller ones
//! only.
//!
//! | floor | module | |
//! |---|---|---|
//! | 0 | [`math`] | boxes, balls, every tolerance with its reason |
//! | 1 | [`motion`] | a step's motion, one body seen from the other |
//! | 2 | [`solid`] | faces, primitives, trees, what is left of a tree in a small box |
//! | 3 | [`bound`] | stage 1: S-bounds of two trees |
//! | 4 | [`octree`] | stage 2: extended CSG octrees and their walk |
//! | 5 | [`contact`] | stage 3 and the queue: the answer for a pair ([`contact::earliest_contact`]) |
//! | 6 | [`world`] | a session's objects and rules: the answers of a step ([`world::World::step`]) |
//!
//! ```
//! use contactd_engine::contact::{PairQuery, PlacedModel, QueryOptions, Scratch, Strategies, default_resolution, earliest_contact};
//! use contactd_engine::glam::DVec3;
//! use contactd_engine::motion::Placed;
//! use contactd_engine::octree::Model;
//! use contactd_engine::solid::primitive::{Cuboid, Cylinder, Sphere};
//! use contactd_engine::solid::{Label, Op, SolidBuilder};
//! use contactd_proto::{Motion, Pose};
//!
//! // A plate with a hole, and a ball above it.
//! let mut plate = SolidBuilder::new();
//! let block = plate.primitive(Cuboid { half: DVec3::new(20.0, 20.0, 2.0) }, Pose::IDENTITY, Label::default());
//! let hole = plate.primitive(Cylinder { radius: 3.0, half_height: 5.0 }, Pose::IDENTITY, Label::default());
//! let root = plate.operation(Op::Difference, &[block, hole]);
//! let plate = Model::new(plate.finish(root));
//! let mut ball = SolidBuilder::new();
//! let root = ball.primitive(Sphere { radius: 5.0 }, Pose::IDENTITY, Label::default());
//! let ball = Model::new(ball.finish(root));
//!
//! let falls = Motion::between(Pose::at(DVec3::new(0.0, 0.0, 20.0)), Pose::IDENTITY);
//! let placed = |motion| Placed { place: Pose::IDENTITY, motion };
//! let query = PairQuery {
//!     a: PlacedModel { model: &plate, placed: placed(Motion::resting(Pose::IDENTITY)) },
//!     b: PlacedModel { model: &ball, placed: placed(falls) },
//!     resolution: default_resolution(&plate, &ball),
//!     cell_limit: 1_000_000,
//!     strategies: Strategies::default(),
//!     query_options: QueryOptions::DEPTH,
//! };
//! let outcome = earliest_contact(&query, &mut Scratch::default());
//! // On the rim, radius 3 at height 2: the ball's centre is then √(5² − 3²) = 4 above it, at 6 of 20.
//! assert!(outcome.meets() && (outcome.time() - 0.7).abs() < 1e-9);
//! // Proven: there was nothing before.
//! assert!(outcome.time_lower() <= outcome.time() && outcome.time() - outcome.time_lower() < 1e-6);
//! ```
#![forbid(unsafe_code)]

pub mod bound;
pub mod contact;
pub mod math;
pub mod motion;
pub mod octree;
pub mod solid;
pub mod world;

pub use glam;
