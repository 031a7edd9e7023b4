//! Distances: their bounds against closed forms and against brute force, at an instant and over a step.

mod brute;
mod by_hand;
mod closed;
mod convex;
mod forms;
mod meshes;
mod moving;
