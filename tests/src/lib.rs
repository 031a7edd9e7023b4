//! Independent truth and harnesses shared by the integration tests.
#![forbid(unsafe_code)]

pub mod certified;
pub mod closed;
pub mod engine;
pub mod families;
pub mod formula;
pub mod fuzz;
pub mod judge;
pub mod lanes;
pub mod least_distance;
pub mod mesh_files;
pub mod meshes;
pub mod models;
pub mod openscad;
pub mod primitive_pairs;
pub mod quadrics;
pub mod random_solids;
pub mod rays;
pub mod record_judge;
pub mod record_scenes;
pub mod reference;
pub mod scenes;
pub mod shells;
pub mod stepped;
pub mod sweep;
pub mod triangles;
pub mod verifier;
