//! Instructions of a run of this program, counted by callgrind (valgrind's), which runs it anew with other arguments.

use std::error::Error;
use std::process::Command;

/// True when there is one on the PATH.
pub fn is_there() -> bool {
    Command::new("valgrind").arg("--version").output().is_ok_and(|o| o.status.success())
}

/// Instructions that this program retires when it is run with `arguments`.
///
/// # Errors
/// Callgrind or the program fails: with what callgrind said.
pub fn instructions(arguments: &[&str]) -> Result<u64, Box<dyn Error>> {
    let mut command = Command::new("valgrind");
    command.args(["--tool=callgrind", "--callgrind-out-file=/dev/null"]).arg(std::env::current_exe()?).args(arguments);
    let output = command.output()?;
    let text = String::from_utf8_lossy(&output.stderr);
    let collected = text.lines().find_map(|line| line.split("Collected :").nth(1)?.trim().parse().ok());
    collected.filter(|_| output.status.success()).ok_or_else(|| format!("callgrind said: {text}").into())
}
