//! Contacts that are solved for: Newton on the faces that hold one, what was found, and its features.

pub mod climb;
pub mod contacts;
mod dependence;
pub mod extent;
pub mod faces;
pub mod features;
pub mod found;
pub mod known;
pub mod newton;
pub mod retreat;
mod sides;
pub mod touch;
