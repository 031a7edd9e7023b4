//! What `contactd demo` plays.
pub mod scene;
pub mod script;
