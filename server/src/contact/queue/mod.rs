//! The general search: one queue of slices of time and cells, ordered by the earliest time at which one could hold a contact.

pub mod cell;
pub mod clock;
pub mod handed;
pub mod propose;
pub mod rescue;
pub mod roots;
pub mod search;
pub mod slices;
#[cfg(test)]
mod tests;
