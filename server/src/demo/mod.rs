//! `contactd demo`: a server process and a client process on real parts.
//!
//! Floor 9, beside main: may import everything.

pub mod script;
