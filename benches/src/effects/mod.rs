//! The report of what effects cost: a ladder of what is told of a contact, single effects against the plain rule, the cost
//! against the share of pairs that ask for one, and instructions where none does.
//!
//! Scenes are lanes of pairs (`contactd_tests::lanes`): a step costs the sum of what its pairs cost, and every step is made
//! anew. What is asserted of counts is in `--test steps effect_costs::`; here they stand beside times.

mod instructions;
mod ladder;
mod share;
mod single;

pub use instructions::{Probe, instructions};
pub use ladder::ladder;
pub use share::share;
pub use single::single;

use crate::race::{Lap, Plan, race};
use crate::workload::{self, Case};
use contactd_tests::lanes::{Class, Lane, Lanes, counts};
use std::error::Error;

/// A class of lanes.
pub struct Kind {
    /// In words.
    pub name: String,
    /// Its lanes.
    pub lanes: Vec<Lane>,
}

/// What all sections work on.
pub struct Context {
    /// The classes, those of `Class` first.
    pub kinds: Vec<Kind>,
    /// How long a race is.
    pub plan: Plan,
    /// The short form.
    pub quick: bool,
}

impl Context {
    /// The classes with up to `count` lanes each; parts from files in the full form only.
    ///
    /// # Errors
    /// A model cannot be read.
    pub fn new(count: usize, plan: Plan, quick: bool) -> Result<Self, Box<dyn Error>> {
        let own = Class::ALL.iter().map(|c| Kind { name: c.name().into(), lanes: c.lanes(count) });
        let mut kinds: Vec<Kind> = own.collect();
        let parts = workload::parts(count.div_ceil(5));
        kinds.push(Kind {
            name: "pegs, pipes and rods".into(),
            lanes: parts.iter().flat_map(|c| c.cases.iter().map(lane)).collect(),
        });
        if !quick {
            let files = workload::models(1)?;
            let files = files.iter().filter(|c| c.name != "demo");
            kinds.push(Kind {
                name: "parts from files".into(),
                lanes: files.flat_map(|c| c.cases.iter().map(lane)).collect(),
            });
        }
        Ok(Self { kinds, plan, quick })
    }

    /// The lanes of a class.
    pub fn lanes(&self, class: Class) -> &[Lane] {
        self.kinds.iter().find(|k| k.name == class.name()).map_or(&[], |k| &k.lanes)
    }

    /// Says on standard error what is being measured.
    pub fn progress(&self, what: &str) {
        eprintln!("effects: {what}");
    }
}

fn lane(case: &Case) -> Lane {
    Lane::new([case.a.clone(), case.b.clone()], [case.motion_a, case.motion_b], case.places)
}

/// What a step of a scene counts.
struct Counted(Vec<(&'static str, u64)>);

impl Counted {
    fn of(scene: &mut Lanes) -> Self {
        Self(counts(scene.step()))
    }

    fn get(&self, name: &str) -> u64 {
        self.0.iter().find(|(n, _)| *n == name).map_or(0, |(_, count)| *count)
    }
}

/// Scenes raced against each other, one by one, a step a call.
fn race_scenes(plan: Plan, own: &mut [Lanes], peer: &mut [Lanes]) -> Vec<Lap> {
    race(plan, own.len(), |i| own[i].step().contact, |i| peer[i].step().contact)
}
