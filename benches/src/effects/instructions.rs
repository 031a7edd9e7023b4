//! Instructions retired by a step in which no pair asks for an effect, against a scene whose only rule is the plain one.
//!
//! Counted by callgrind (valgrind's), which runs this program anew with the subcommand `probe`. Each scene is stepped few
//! and many times; the difference is of steps alone, without what set-up took.

use super::Context;
use crate::callgrind;
use crate::page::Section;
use crate::row;
use crate::table::Table;
use clap::{Args, ValueEnum};
use contactd_proto::Rule;
use contactd_tests::lanes::{Class, EFFECTS, Lanes, PLAIN, rule};
use std::error::Error;

/// What rules there are beside the plain one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Declared {
    /// None.
    Nothing,
    /// All effects, for groups that do not occur.
    Absent,
    /// All effects, for groups of bodies that are near nothing.
    Bystanders,
}

/// A scene, stepped a number of times.
#[derive(Clone, Debug, Args)]
pub struct Probe {
    /// Index of its class.
    class: usize,
    /// What is declared in it.
    declared: Declared,
    /// How often it is stepped.
    steps: usize,
    /// Steps do not forget what earlier ones have proven.
    #[arg(long)]
    warm: bool,
}

/// Lanes of a scene.
const LANES: usize = 9;
/// Steps of the shorter and of the longer run.
const STEPS: [usize; 2] = [2, 10];
/// The classes.
const CLASSES: [Class; 3] = [Class::Translating, Class::Turning, Class::Landing];

impl Probe {
    /// Steps the scene.
    pub fn run(&self) {
        let lanes = CLASSES[self.class].lanes(LANES);
        let mut rules: Vec<Rule> = vec![rule(PLAIN, |_| ())];
        for effect in &EFFECTS {
            match self.declared {
                Declared::Nothing => {}
                Declared::Absent => rules.push(rule(&format!("no {}", effect.name), effect.on)),
                Declared::Bystanders => rules.push(rule(effect.name, effect.on)),
            }
        }
        let mut scene = Lanes::shared(&lanes, (0, 4), &rules);
        EFFECTS.iter().for_each(|effect| scene.add_bystander(&lanes[0].parts[0], effect.name));
        for _ in 0..self.steps {
            if self.warm {
                scene.step_on()
            } else {
                scene.step()
            };
        }
    }
}

/// Instructions of a step.
fn of_a_step(class: usize, declared: Declared, warm: bool) -> Result<f64, Box<dyn Error>> {
    let declared = declared.to_possible_value().expect("a word");
    callgrind::of_a_step(STEPS, |steps| {
        let mut arguments = vec!["probe".into(), class.to_string(), declared.get_name().into(), steps.to_string()];
        arguments.extend(warm.then(|| "--warm".into()));
        arguments
    })
}

/// The section; `None` in the short form, and where there is no callgrind.
///
/// # Errors
/// Callgrind is there and fails.
pub fn instructions(context: &Context) -> Result<Option<Section>, Box<dyn Error>> {
    if context.quick || !callgrind::is_there() {
        let why = if context.quick { "the short form leaves them out" } else { "valgrind is not on the PATH" };
        println!("instructions of a step: not measured, {why}");
        return Ok(None);
    }
    let mut table = Table::new(&[
        "class",
        "steps",
        "instructions_a_pair",
        "absent_groups",
        "absent_percent",
        "bystanders",
        "bystanders_percent",
    ]);
    for (i, class) in CLASSES.iter().enumerate() {
        for warm in [false, true] {
            let steps = if warm { "that remember" } else { "made anew" };
            context.progress(&format!("instructions: {}, steps {steps}", class.name()));
            let pairs = (4 * LANES) as f64;
            let plain = of_a_step(i, Declared::Nothing, warm)?;
            let absent = of_a_step(i, Declared::Absent, warm)?;
            let bystanders = of_a_step(i, Declared::Bystanders, warm)?;
            let more = |n: f64| 100.0 * (n / plain - 1.0);
            table.push(row![
                class.name(),
                steps,
                (plain / pairs).round(),
                (absent / pairs).round(),
                more(absent),
                (bystanders / pairs).round(),
                more(bystanders),
            ]);
        }
    }
    Ok(Some(Section {
        name: "effects_instructions",
        title: "Instructions where no pair asks".into(),
        text: format!(
            "Instructions of a step (callgrind; {} steps less {}, so that set-up cancels) of {} pairs under the plain rule, a pair: \
             with that rule alone, with all {} effects declared for groups that do not occur, and for groups of bodies that are \
             near nothing.",
            STEPS[1],
            STEPS[0],
            4 * LANES,
            EFFECTS.len()
        ),
        figures: vec![],
        summary: table.clone(),
        table,
    }))
}
