//! What a run did, as a table.

use super::Run;
use super::scenes::Scene;

/// The table of one scene.
pub fn print(scene: &Scene, run: &Run) {
    let t = &run.total;
    let c = &t.counters;
    println!("{}: {}", scene.name, scene.about);
    let [before, after] = run.energy.map(|e| e.total());
    let scale = run.energy.iter().map(|e| e.kinetic.abs() + e.potential.abs()).fold(1e-300, f64::max);
    println!(
        "  {:>7} frames {:>7} sub-steps {:>7} looks {:>7} proposals {:>7} poses sent   left over {:.1e} s",
        t.frames, t.substeps, t.looks, t.proposals, t.sent, t.left_over
    );
    println!(
        "  {:>7} points {:>7} sweeps {:>10} impacts {:>6} lifts {:>10} added points  residual {:.1e}, {} unconverged",
        t.points, t.iterations, t.impacts, t.lifts, t.added, t.residual, t.unconverged
    );
    println!(
        "  energy {before:.6} -> {after:.6} ({:+.1e} of the larger), {} of {} bodies asleep, {:.1} ms, {:.3} ms a frame",
        (after - before) / scale,
        run.bodies[1],
        run.bodies[0],
        run.took.as_secs_f64() * 1e3,
        run.took.as_secs_f64() * 1e3 / t.frames as f64
    );
    println!(
        "  operations: gravity {} restitution {} friction {} damping {} rest {} sleep {} penalty {}",
        c.gravity, c.restitution, c.friction, c.damping, c.rest, c.sleep, c.penalty
    );
}

/// Everything on beside only what the scene calls for.
pub fn compare(all: &Run, needed: &Run) {
    println!("  the same cell          everything on   what it calls for     ratio");
    let ms = |r: &Run| r.took.as_secs_f64() * 1e3;
    line("time, ms", ms(all), ms(needed));
    type Figure = (&'static str, fn(&Run) -> u64);
    let figures: [Figure; 12] = [
        ("looks", |r| r.total.looks),
        ("proposals", |r| r.total.proposals),
        ("poses sent", |r| r.total.sent),
        ("points solved", |r| r.total.points),
        ("sweeps", |r| r.total.iterations),
        ("gravity", |r| r.total.counters.gravity),
        ("restitution", |r| r.total.counters.restitution),
        ("friction", |r| r.total.counters.friction),
        ("damping", |r| r.total.counters.damping),
        ("rest", |r| r.total.counters.rest),
        ("sleep", |r| r.total.counters.sleep),
        ("sensed", |r| r.total.sensed),
    ];
    for (name, of) in figures {
        line(name, of(all) as f64, of(needed) as f64);
    }
}

fn line(name: &str, all: f64, needed: f64) {
    let ratio = if needed == 0.0 { "-".into() } else { format!("{:.2}", all / needed) };
    println!("  {name:<20} {all:>15.1} {needed:>19.1} {ratio:>9}");
}
