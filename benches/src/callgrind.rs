//! Instructions of a run of this program, counted by callgrind (valgrind's), which runs it anew with other arguments.

use crate::options::Options;
use clap::{Args, Parser, Subcommand};
use std::error::Error;
use std::process::Command;

/// The command line of a benchmark that counts itself; `P` is what it steps for callgrind.
#[derive(Debug, Parser)]
pub struct Arguments<P: Args> {
    /// Those of all benchmarks.
    #[command(flatten)]
    pub options: Options,
    /// What callgrind is given to run; none: the benchmark.
    #[command(subcommand)]
    pub task: Option<Task<P>>,
}

/// What callgrind is given to run.
#[derive(Debug, Subcommand)]
pub enum Task<P: Args> {
    /// Steps one scene: what instructions are counted of.
    Probe(P),
}

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

/// Instructions of one step: what a run of the larger number of steps takes more, so that set-up cancels; `run` tells the
/// arguments of a run of so many steps.
///
/// # Errors
/// As `instructions`.
pub fn of_a_step(steps: [usize; 2], run: impl Fn(usize) -> Vec<String>) -> Result<f64, Box<dyn Error>> {
    let count = |n: usize| instructions(&run(n).iter().map(String::as_str).collect::<Vec<_>>());
    let [few, many] = [count(steps[0])?, count(steps[1])?];
    Ok(many.saturating_sub(few) as f64 / (steps[1] - steps[0]) as f64)
}
