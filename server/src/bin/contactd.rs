//! The command `contactd`: the library's `command_line`.
#![forbid(unsafe_code)]

use contactd::demo::Program;
use std::process::ExitCode;

fn main() -> ExitCode {
    // A program that cannot be found cannot be started again, which says so where it is to be.
    let path = std::env::current_exe().unwrap_or_else(|_| "contactd".into());
    contactd::command_line::run(std::env::args_os(), &Program { path, arguments: Vec::new() }).into()
}
