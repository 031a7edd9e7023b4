//! contactd: certified earliest contact of moving solids modelled by constructive solid geometry (CSG).
//!
//! Two trees of exact faces move over a step t = 0..1. When do they first meet, where, and what proves that they did not
//! before? Three stages, after M. Zeiller, "Collision detection for objects modelled by CSG" (1993); he tests discrete
//! moments, here the whole motion is searched. [`contact::earliest_contact`] is the way in.
//!
//! # The stages and the queue
//!
//! One queue for each pair of objects ([`contact::queue`]), ordered by the earliest time at which an item could hold a
//! contact. The earliest item is popped and replaced by items that can hold one no sooner:
//!
//! ```text
//!             +---------------------- queue: earliest first <-----------------------+
//!             |                                                                     |
//!    slice of time [t0, t1]                                                         |
//!      stage 1  S-bounds of A ∩ B: where can they meet at all?   bound::pair        |
//!        nowhere -> gone;   a long way through a large region -> two halves --------+
//!      stage 2  both octrees, walked together in that region     octree::walk,      |
//!               by table 4: which primitives, where, when        contact::queue     |
//!        nothing -> gone;   else a cell per alternative of the reference body ------+
//!             |                                                                     |
//!    cell: a box that rides with the reference body, what is left there of both     |
//!      stage 3  cut it down to what the clauses of their         contact::exclusion |
//!               literals leave (`tighten`), then bound each                         |
//!               clause over what is left: free until t + dt                         |
//!        the whole slice -> gone;   a good while -> the cell at t + dt -------------+
//!               else solve for the contact that the bound points contact::witness   |
//!               to; it counts if both whole trees confirm it                        |
//!        and the cell's two halves -------------------------------------------------+
//! ```
//!
//! In front of the queue stand three proofs that need no cells: two convex primitives (`contact::convex`), convex bodies at
//! solids with holes (`contact::cavity`), meshes (`contact::facets`). What they do not settle is queued.
//!
//! It ends when the earliest item lies beyond the confirmed contact: then all that is still queued is the proof that
//! nothing came before (`contact`). An empty queue is `clear`; a spent work limit is `undecided`, with the time up to
//! which the proof reached. Inside both bodies at the start is `overlap`. No stage knows the next one's answer, so each can
//! be switched off ([`contact::Strategies`]) without changing what is promised, only what it costs.
//!
//! # The floors
//!
//! Each module imports from smaller floors only; a test reads the table in `docs/architecture.md` and holds them to it. Floors
//! 0 to 6 are the engine, a package of its own (`contactd-engine`, in `server/engine`) that is handed on here.
//!
//! | floor | module | |
//! |---|---|---|
//! | 0 | [`math`] | boxes, balls, every tolerance with its reason |
//! | 1 | [`motion`] | a step's motion, one body seen from the other, bounds on speed and acceleration |
//! | 2 | [`solid`] | faces ψ <= 0, primitives, trees, f at a point, what is left of a tree in a small box |
//! | 3 | [`bound`] | stage 1 |
//! | 4 | [`octree`] | stage 2: extended CSG octrees and their walk |
//! | 5 | [`contact`] | stage 3 and the queue: the answer for a pair |
//! | 6 | [`world`] | a session's objects, rules, broad phase: the answers of a step |
//! | 7 | [`import`] | OpenSCAD's trees, scene files and robots; the only floor that knows file formats |
//! | 8 | [`cache`], [`terminal`] | preprocessed models kept on disk; text of 80 columns |
//! | 8 | [`tessellation`] | triangles of solids, for viewers |
//! | 8 | [`http`] | a small HTTP server for this machine alone |
//! | 9 | [`inspect`], [`report`], [`picture`] | models and answers as text, JSON and drawings |
//! | 9 | [`recording`] | steps in MCAP files, with all that it takes to repeat them |
//! | 9 | [`metrics`] | what a server counts, as OpenMetrics |
//! | 10 | [`check`], [`ipc`] | a scene file's step in this process; sessions over shared memory or embedded |
//! | 10 | [`clearance`] | the least clearance of a robot over ranges of its joints |
//! | 10 | [`load`] | scenes and robots from files into a session |
//! | 10 | [`overlaps`] | what is in each other of volumes or of a scene |
//! | 10 | [`operator`] | servers and their sessions, as an operator sees them |
//! | 11 | [`batch`] | many steps of one scene that know nothing of each other |
//! | 11 | [`replay`] | a recording, repeated and compared |
//! | 11 | [`view`] | a scene in a browser |
//! | 12 | [`demo`] | the show |
//! | 13 | [`command_line`] | the command `contactd` |
//!
//! # In one's own process
//!
//! [`embedded`] gives a session without a server: the same calls, the same bits. Vectors and quaternions are [`glam`]'s, in `f64`.
//! With the packages `contactd` and `contactd-client`:
//!
//! ```
//! use contactd::glam::DVec3;
//! use contactd_client::Object;
//! use contactd_client::proto::{Pose, PoseRecord};
//!
//! let mut session = contactd::embedded(&contactd::ipc::ServerConfig::default())?;
//! let plate = "difference() { cube(size = [40, 40, 4], center = true); cylinder(h = 9, r1 = 3, r2 = 3, center = true); }";
//! let plate = session.load_model("plate.csg", plate)?;
//! let ball = session.load_model("ball.csg", "sphere(r = 5);")?;
//! session.add_object(Object::new("plate", plate.id).fixed())?;
//! let ball = session.add_object(Object::new("ball", ball.id).at(Pose::at(DVec3::new(1.0, 0.0, 20.0))))?;
//!
//! session.begin_step(1)?[0] = PoseRecord::end(ball, &Pose::at(DVec3::X));
//! let reply = session.finish(std::time::Duration::from_secs(5))?;
//! // The hole's rim (radius 3, at height 2) comes within 2 of the ball's line of fall: a ball of radius 5 stops √21 above.
//! let contact = &reply.records()[0];
//! assert!((contact.time - (18.0 - 21f64.sqrt()) / 20.0).abs() < 1e-9);
//! # Ok::<(), contactd_client::Error>(())
//! ```
//!
//! The algorithm with its figures, formulas and sources: `docs/algorithm.md`.
#![forbid(unsafe_code)]

pub mod batch;
pub mod cache;
pub mod check;
pub mod clearance;
pub mod command_line;
pub mod demo;
pub mod http;
pub mod import;
pub mod inspect;
pub mod ipc;
pub mod load;
pub mod metrics;
pub mod operator;
pub mod overlaps;
pub mod picture;
pub mod recording;
pub mod replay;
pub mod report;
pub mod terminal;
pub mod tessellation;
pub mod view;

pub use contactd_engine::{bound, contact, math, motion, octree, solid, world};
pub use glam;
pub use ipc::embedded;
