//! `warm`: what a step costs when earlier steps have proven much of it, against the same step with all of it forgotten.
//!
//! Three scenes, stepped side by side in two worlds (`stepped`). Times are medians over the steps, `asked` and `cells` means
//! a step. Then a peg's way into its hole, which takes 100 steps: what the median step costs against the whole way as one
//! question to a world that remembers nothing. Then the instructions (callgrind's) that a pair costs a step while its bodies are within their clearance: couples of
//! balls and couples of drilled blocks far from all others, stepped with the pair and with a rule that drops it.

use clap::{Args, Parser, ValueEnum};
use contactd_benches::callgrind;
use contactd_benches::race::{median, worst};
use contactd_benches::row;
use contactd_benches::stepped::{approach, approaches, scenes, walk};
use contactd_benches::table::Table;
use contactd_client::Object;
use contactd_proto::{Detect, Pose, PoseRecord, Rule};
use glam::DVec3;
use std::error::Error;
use std::time::Duration;

#[derive(Clone, Debug, Args)]
struct Probe {
    kind: Kind,
    steps: usize,
    /// A rule drops the pairs.
    #[arg(long)]
    dropped: bool,
}

/// What couples consist of.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    /// Balls.
    Primitives,
    /// Drilled blocks.
    Parts,
}

/// Steps of a peg's way into its hole.
const WAY: usize = 100;
/// Couples in a scene.
const COUPLES: usize = 200;
/// Steps of the shorter and of the longer run, after which the couples are still within their clearance.
const STEPS: [usize; 2] = [20, 120];

impl Kind {
    fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }

    fn text(self) -> &'static str {
        match self {
            Self::Primitives => "sphere(r = 1);",
            Self::Parts => {
                "difference() { cube(size = [2, 2, 2], center = true); cylinder(h = 3, r1 = 0.5, r2 = 0.5, center = true); }"
            }
        }
    }
}

impl Probe {
    /// Bodies of size 2, .03 apart, that move on by .0001 a step: near enough to be in the list of neighbours.
    fn run(&self) -> Result<(), Box<dyn Error>> {
        let mut session = contactd::embedded(&contactd::ipc::ServerConfig::default())?;
        let mut rule = Rule::new(["near".into(), "far".into()]);
        if self.dropped {
            rule.detect = Detect::Off;
        }
        session.set_rules(&[rule])?;
        let model = session.load_model("couple.csg", self.kind.text())?.id;
        let at =
            |i: usize, k: usize| DVec3::new(40.0 * (i / 2) as f64 + 2.03 * (i % 2) as f64 + 1e-4 * k as f64, 0.0, 0.0);
        let mut ids = Vec::new();
        for i in 0..2 * COUPLES {
            let group = if i % 2 == 0 { "near" } else { "far" };
            ids.push(session.add_object(Object::new("body", model).group(group).at(Pose::at(at(i, 0))))?);
        }
        let mut asked = 0;
        for k in 1..=self.steps {
            for (i, slot) in session.begin_step(ids.len())?.iter_mut().enumerate() {
                *slot = PoseRecord::end(ids[i], &Pose::at(at(i, k)));
            }
            let reply = session.finish(Duration::from_secs(60))?;
            if k > STEPS[0] {
                asked += reply.header().pairs;
            }
        }
        if asked > 0 {
            return Err(format!("{asked} pairs were asked about: they are not within their clearance").into());
        }
        Ok(())
    }
}

/// Instructions of a step.
fn instructions(kind: Kind, dropped: bool) -> Result<f64, Box<dyn Error>> {
    callgrind::of_a_step(STEPS, |steps| {
        let mut arguments = vec!["probe".into(), kind.name(), steps.to_string()];
        arguments.extend(dropped.then(|| "--dropped".into()));
        arguments
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let callgrind::Arguments { options, task } = callgrind::Arguments::<Probe>::parse();
    if let Some(callgrind::Task::Probe(probe)) = task {
        return probe.run();
    }
    let steps = options.pick(400, 100);
    let mut table = Table::new(&[
        "scene",
        "objects",
        "steps",
        "reported",
        "asked",
        "known",
        "cells",
        "cells_cold",
        "us",
        "us_cold",
        "ratio",
    ]);
    for scene in scenes() {
        let walked = walk(&scene, steps)?;
        let n = steps as f64;
        let ratios = walked.times[0].iter().zip(&walked.times[1]).map(|(warm, cold)| warm / cold);
        table.push(row![
            scene.name,
            scene.recipes.len(),
            steps,
            walked.reported as f64 / n,
            f64::from(walked.asked) / n,
            f64::from(walked.known) / n,
            walked.cells[0] as f64 / n,
            walked.cells[1] as f64 / n,
            1e6 * median(walked.times[0].iter().copied()),
            1e6 * median(walked.times[1].iter().copied()),
            median(ratios),
        ]);
    }
    println!("warm: a step that remembers / the same step with all forgotten before it");
    table.publish("warm", &options.folder())?;
    let mut table =
        Table::new(&["approach", "met", "steps", "cells", "cells_worst", "query_cells", "us", "query_us", "ratio"]);
    for way in approaches() {
        let reported = approach(&way, WAY, options.pick(101, 21))?;
        let [cost, query] = [&reported.steps, &reported.query].map(|costs| {
            let (times, cells): (Vec<f64>, Vec<f64>) = costs.iter().copied().unzip();
            (1e6 * median(times), median(cells.clone()), worst(cells))
        });
        let steps = reported.steps.len() / reported.query.len();
        let met = if reported.met { "yes" } else { "no" };
        table.push(row![way.name, met, steps, cost.1, cost.2, query.1, cost.0, query.0, cost.0 / query.0]);
    }
    println!("a peg's way into its hole: the median step of {WAY} / all of it as one question");
    table.publish("warm_approach", &options.folder())?;
    if !callgrind::is_there() {
        println!("instructions: not counted, valgrind is not on the PATH");
        return Ok(());
    }
    let mut table = Table::new(&["couples", "bodies", "instructions_a_body", "instructions_a_pair"]);
    for kind in [Kind::Primitives, Kind::Parts] {
        let [kept, dropped] = [instructions(kind, false)?, instructions(kind, true)?];
        let (bodies, pairs) = (2.0 * COUPLES as f64, COUPLES as f64);
        table.push(row![kind.name(), 2 * COUPLES, dropped / bodies, (kept - dropped) / pairs]);
    }
    println!("a step of bodies that move, and what a pair within its clearance adds");
    table.publish("warm_pairs", &options.folder())?;
    Ok(())
}
