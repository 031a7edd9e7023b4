//! The general search: one queue of slices of time and cells, ordered by the earliest time at which one could hold a contact.

mod cell;
pub mod clock;
mod items;
mod propose;
mod roots;
pub mod scratch;
pub mod search;
mod slices;
#[cfg(test)]
mod tests;
