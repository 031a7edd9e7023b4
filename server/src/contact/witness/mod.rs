//! Contacts that are solved for: Newton on the faces that hold one, what was found, and its features.

pub mod extent;
pub mod features;
pub mod found;
pub mod newton;
