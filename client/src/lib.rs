//! Client sessions of contactd.
#![forbid(unsafe_code)]
