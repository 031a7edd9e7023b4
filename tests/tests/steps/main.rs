//! Steps of a session: what is remembered, effects, stops, points that stay, a physics loop.
//! One program for all of them links once; `--test steps NAME::` runs those of one file.
#![allow(missing_docs)]

mod bodies;
mod by_hand;
mod clearances;
mod coherence;
mod contact_cache;
mod deadlines;
mod dynamics;
mod effect_costs;
mod effects;
mod manifold;
mod memory;
mod stopping;
