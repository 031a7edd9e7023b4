//! Stands in for bindgen where contactd is built from its own workspace.
//!
//! Build scripts of iceoryx2 0.10 (`iceoryx2-pal-posix`, `iceoryx2-pal-os-api`) name bindgen, and use it on QNX alone
//! (`#[cfg(target_os = "nto")]`). Cargo knows no such condition for them and builds it, clang-sys, regex and a dozen
//! others everywhere: a tenth of all that a first build compiles. contactd runs on Linux, where this is never called. An
//! iceoryx2 whose scripts do call it no longer compiles against this: then the `[patch]` goes.
