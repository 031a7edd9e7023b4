//! Every function of the C interface, called as C would: what it does, and what it says to misuse.
#![allow(clippy::undocumented_unsafe_blocks)] // Each is a call of the interface with pointers to the test's own variables.

mod convention;
mod manifold;
mod misuse;
mod scene;
mod solid;
mod stub;
#[path = "../support/mod.rs"]
mod support;
mod works;
