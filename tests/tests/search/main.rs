//! What the search is made of: bounds, octrees and their walk, fits, fronts, what rounding takes, certificates.
//! One program for all of them links once; `--test search NAME::` runs those of one file.
#![allow(missing_docs)]

mod ball_feet;
mod bounds;
mod cavities;
mod certificate;
mod fits;
mod fronts;
mod octree;
mod round_faces;
mod rounding;
mod stages;
mod stepped;
mod tighten;
mod unions;
mod walk;
