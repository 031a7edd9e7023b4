//! Answers for pairs, against truths of their own: closed forms, laws, a reference, judges, scenes that once were hard.
//! One program for all of them links once; `--test answers NAME::` runs those of one file.
#![allow(missing_docs)]

mod accuracy;
mod by_hand;
mod capsules;
mod cases;
mod closed_forms;
mod coincident;
mod contact_regions;
mod convex_pairs;
mod elliptics;
mod families;
mod hard_cases;
mod hull_regions;
mod judges;
mod kinds;
mod laws;
mod layers;
mod meshes;
mod overlap;
mod planes;
mod primitive_pairs;
mod quadrics;
mod records;
mod reference;
mod region_ways;
mod separations;
mod superellipsoids;
mod table;
mod tight;
mod tori;
mod unbounded;
