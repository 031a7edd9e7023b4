//! contactd: earliest contact of moving CSG solids.
#![forbid(unsafe_code)]

pub mod bound;
pub mod check;
pub mod contact;
pub mod demo;
pub mod eco;
pub mod import;
pub mod inspect;
pub mod ipc;
pub mod math;
pub mod motion;
pub mod picture;
pub mod report;
pub mod solid;
pub mod world;

pub use ipc::embedded;
