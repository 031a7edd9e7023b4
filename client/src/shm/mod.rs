//! The transport over shared memory: iceoryx2 request-response for steps and commands, events for waking.
//!
//! Waiting spins for as long as the server advised, then blocks on the session's own wake service in slices; between two
//! slices it looks whether the server still lives, since iceoryx2 never announces a killed peer.

mod control;
pub mod link;
pub mod operator;
pub mod pages;
mod steps;
pub mod watch;

pub use steps::SharedMemory;
