//! What the benchmarks share: options, races of contestants in interleaved blocks, tables with CSV, the peers' shapes.
//!
//! `cargo run --release -p contactd-benches --bin NAME [-- --quick] [--csv DIR]`. Each prints a table and writes it as CSV,
//! counts beside times; `accuracy` and `effects` make reports of figures, tables and a page. Every time stands beside that of a peer
//! measured in the same run, in blocks that alternate with its own; what is compared is the ratio. Nothing depends on a time
//! but what is printed.
//!
//! Peers: parry and rapier in double precision (`parry3d-f64`, `rapier3d-f64`), built as this crate is, their shapes built
//! outside the timer.
#![deny(unsafe_code)]

pub mod callgrind;
pub mod effects;
pub mod facets;
pub mod figure;
pub mod measure;
pub mod memory;
pub mod options;
pub mod page;
pub mod peer;
pub mod queries;
pub mod race;
pub mod raw;
pub mod report;
pub mod resting;
pub mod socket;
pub mod stepped;
pub mod table;
pub mod workload;
