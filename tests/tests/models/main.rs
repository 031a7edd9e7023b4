//! Models: imports, files of every format, the corpus of inputs, the cache on disk, mass properties.
//! One program for all of them links once; `--test models NAME::` runs those of one file.
#![allow(missing_docs)]

mod attached;
mod batch;
mod builder;
mod cache;
mod clearance;
mod corpus;
mod files;
mod frames;
mod gdml;
mod gdml_contacts;
mod gltf;
mod heights;
mod import_models;
mod load;
mod mass;
mod mjcf;
mod models;
mod openmc;
mod outline_masses;
mod real_files;
mod robot_files;
mod robots;
mod view;
