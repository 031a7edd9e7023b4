//! `kernels`: the 18 families of primitive pairs against parry's two casts.
//!
//! parry answers a translating pair by `cast_shapes`, a turning one by `cast_shapes_nonlinear`, on its exact spheres,
//! cylinders, cones and boxes. Errors are |time − known time| over the contacts that both found; the known times come from
//! 128-bit arithmetic and leave up to 5e-10 themselves. `--without direct` leaves the search alone to answer.

use clap::Parser;
use contactd::contact::{Outcome, Scratch, Status};
use contactd::eco::Model;
use contactd_benches::options::Options;
use contactd_benches::race::{Lap, Plan, median, quantile, race, worst};
use contactd_benches::table::Table;
use contactd_benches::{peer, queries, row};
use contactd_tests::primitive_pairs::{FAMILIES, rows};
use contactd_tests::scenes::Scene;
use std::time::Duration;

fn main() -> std::io::Result<()> {
    let options = Options::parse();
    let ideas = options.ideas();
    let plan = Plan { blocks: options.pick(9, 3), least: Duration::from_micros(options.pick(20, 10)) };
    let mut table = Table::new(&[
        "family",
        "cases",
        "own_us",
        "parry_us",
        "ratio",
        "ratio_p90",
        "ratio_worst",
        "cells",
        "cells_worst",
        "newton",
        "evaluations",
        "evaluations_worst",
        "wrong",
        "parry_wrong",
        "error_worst",
        "parry_error_worst",
    ]);
    for family in FAMILIES {
        let cases: Vec<(Scene, f64)> = rows(family).into_iter().step_by(options.pick(1, 10)).collect();
        let models: Vec<[Model; 2]> =
            cases.iter().map(|(s, _)| [Model::new(s.a.build()), Model::new(s.b.build())]).collect();
        let own: Vec<queries::Question> = cases
            .iter()
            .zip(&models)
            .map(|((s, _), [a, b])| queries::Question::new((a, s.motion_a), (b, s.motion_b), ideas))
            .collect();
        let other: Vec<peer::Question> = cases.iter().map(|(s, _)| peer::Question::of_scene(s)).collect();

        let mut scratch = Scratch::default();
        let answers: Vec<Outcome> = own.iter().map(|q| q.ask(&mut scratch)).collect();
        let theirs: Vec<Option<f64>> = other.iter().map(peer::Question::time).collect();
        let met = |k: usize| cases[k].1 >= 0.0;
        let wrong = (0..cases.len()).filter(|k| met(*k) != (answers[*k].status == Status::Contact)).count();
        let peer_wrong = (0..cases.len()).filter(|k| met(*k) != theirs[*k].is_some()).count();
        let both = || (0..cases.len()).filter(|k| met(*k) && answers[*k].status == Status::Contact);
        let errors = both().map(|k| (answers[k].time - cases[k].1).abs());
        let peer_errors = both().filter_map(|k| theirs[k].map(|t| (t - cases[k].1).abs()));

        let laps: Vec<Lap> = race(plan, cases.len(), |i| own[i].ask(&mut scratch), |i| other[i].ask());
        let micros = |of: fn(&Lap) -> f64| 1e6 * median(laps.iter().map(of));
        let count = |of: fn(&Outcome) -> u64| answers.iter().map(move |o| of(o) as f64);
        table.push(row![
            family,
            cases.len(),
            micros(|l| l.own),
            micros(|l| l.peer),
            median(laps.iter().map(|l| l.ratio)),
            quantile(laps.iter().map(|l| l.ratio), 0.9),
            worst(laps.iter().map(|l| l.ratio)),
            median(count(|o| o.counters.cells)),
            worst(count(|o| o.counters.cells)),
            median(count(|o| o.counters.newton)),
            median(count(|o| o.counters.closed_forms)),
            worst(count(|o| o.counters.closed_forms)),
            wrong,
            peer_wrong,
            worst(errors),
            worst(peer_errors),
        ]);
    }
    println!("kernels: time a query, ours (certified, resolution 1e-9 of the size) / parry's; median over the cases");
    if !options.without.is_empty() {
        println!("switched off: {:?}", options.without);
    }
    table.publish("kernels", &options.folder())?;
    println!(
        "harness check: parry's sphere-sphere to box-box is 1 : {:.1} (about 1 : 17 is right)",
        peer::sphere_to_box()
    );
    Ok(())
}
