//! The report of what accuracy costs: one section for each knob, and one for what a user would do today.

mod octree;
mod resolution;
mod strategies;
mod today;
mod volumes;

pub use octree::octree;
pub use resolution::resolution;
pub use strategies::strategies;
pub use today::today;
pub use volumes::volumes;

use crate::figure::{Series, Stroke};
use crate::measure::Known;
use crate::race::Plan;
use crate::workload::Class;

/// The groups of classes, in the order of their colours.
pub const GROUPS: [&str; 3] = ["pairs", "hard", "parts"];

/// What all sections work on.
pub struct Context {
    /// The work.
    pub classes: Vec<Class>,
    /// What is true of it.
    pub known: Vec<Known>,
    /// How long a race is.
    pub plan: Plan,
    /// The short form.
    pub quick: bool,
}

impl Context {
    /// The classes of a group with what is known of them.
    pub fn of<'a>(&'a self, group: &'a str) -> impl Iterator<Item = (&'a Class, &'a Known)> {
        self.classes.iter().zip(&self.known).filter(move |(c, _)| c.group == group)
    }

    /// `full`, or `quick` in the short form.
    pub fn pick<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    /// Says on standard error what is being measured: the full form takes minutes.
    pub fn progress(&self, what: &str) {
        eprintln!("accuracy: {what}");
    }
}

/// A class with its first cases, and what is known of them.
fn first_of((class, known): (&Class, &Known), count: usize) -> (Class, Known) {
    let cases = class.cases.iter().take(count).cloned().collect();
    (
        Class { cases, ..class.clone() },
        Known { truths: known.truths.iter().take(count).copied().collect(), by: known.by },
    )
}

fn series(name: impl Into<String>, points: Vec<[f64; 2]>, stroke: Stroke, color: usize) -> Series {
    Series { name: name.into(), points, stroke, color }
}

/// A ratio in words.
fn times(x: f64) -> String {
    if x >= 100.0 {
        format!("{x:.0}")
    } else if x >= 10.0 {
        format!("{x:.1}")
    } else {
        format!("{x:.2}")
    }
}
