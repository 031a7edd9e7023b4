//! What the demo prints: a table of earliest contacts, what was met, and how long a step took.

use super::play::{Row, Run};
use super::script::acts;
use contactd_proto::contact_record::{EXTENT_NAMES, KIND_NAMES, STATUS_NAMES};
use hdrhistogram::Histogram;
use std::fmt::Write as _;

/// Rows of the table for each act.
const ROWS: usize = 5;

/// The rows of the table: of each act the earliest contact of steps spread evenly over those that had one.
pub fn chosen(run: &Run) -> Vec<&Row> {
    let mut table = Vec::new();
    for act in 0..acts().len() {
        // Records of a step come in order of time, so the first one of each step is its earliest.
        let mut first: Vec<&Row> = run.rows.iter().filter(|r| r.act == act).collect();
        first.dedup_by_key(|r| r.step);
        let n = ROWS.min(first.len());
        table.extend((0..n).map(|k| first[(2 * k + 1) * first.len() / (2 * n)]));
    }
    table
}

/// The table of earliest contacts.
pub fn contacts(run: &Run) -> String {
    let acts = acts();
    let mut out = String::new();
    let mut act = usize::MAX;
    for row in chosen(run) {
        if row.act != act {
            act = row.act;
            let _ = writeln!(out, "\n{}", acts[act].title);
            let _ = writeln!(
                out,
                "{:>6}  {:<10} {:<10} {:>11}  {:<17} {:<7} {:<10}  {:>30}  {:>26}",
                "step", "a", "b", "time", "kind", "extent", "surface", "point", "normal"
            );
        }
        let r = &row.record;
        let kind = if r.kind == 0 { STATUS_NAMES[r.status as usize] } else { KIND_NAMES[r.kind as usize] };
        // What would print as -0 is 0.
        let [x, y, z] = r.point.map(|c| if c.abs() < 5e-5 { 0.0 } else { c });
        let [u, v, w] = r.normal.map(|c| if c.abs() < 5e-6 { 0.0 } else { c });
        let _ = writeln!(
            out,
            "{:>6}  {:<10} {:<10} {:>11.9}  {:<17} {:<7} {:<10}  {x:>9.4} {y:>9.4} {z:>9.4}   {u:>8.5} {v:>8.5} {w:>8.5}",
            row.step,
            row.names[0],
            row.names[1],
            r.time,
            kind,
            EXTENT_NAMES[r.extent as usize],
            if row.subtracted { "subtracted" } else { "added" },
        );
    }
    out
}

/// Counts, and the percentiles of a step's time as the client saw it.
pub fn summary(run: &Run, way: &str) -> String {
    let mut out = String::new();
    let subtracted = run.rows.iter().filter(|r| r.subtracted).count();
    let share = |n: usize, of: usize| 100.0 * n as f64 / of.max(1) as f64;
    let _ = writeln!(
        out,
        "\n{} steps, {} with a contact ({:.0} %); {} contacts, {} of them on a subtracted surface ({:.0} %); {} undecided",
        run.steps,
        run.steps_with_contact,
        share(run.steps_with_contact, run.steps),
        run.rows.len(),
        subtracted,
        share(subtracted, run.rows.len()),
        run.undecided,
    );
    let mut histogram = Histogram::<u64>::new_with_bounds(1, 3_600_000_000_000, 3).expect("bounds are in order");
    for time in &run.latency {
        histogram.saturating_record(time.as_nanos() as u64);
    }
    let ms = |q: f64| histogram.value_at_quantile(q) as f64 / 1e6;
    let total: f64 = run.latency.iter().map(|d| d.as_secs_f64()).sum();
    let slowest = (0..run.latency.len()).max_by_key(|i| run.latency[*i]).unwrap_or(0);
    let _ = writeln!(
        out,
        "time of a step, {way}, the search included: p50 {:.3} ms, p99 {:.3} ms, p99.9 {:.3} ms, largest {:.3} ms (step {slowest}); \
         {total:.2} s in all",
        ms(0.5),
        ms(0.99),
        ms(0.999),
        histogram.max() as f64 / 1e6,
    );
    out
}

/// Every contact, numbers exact.
pub fn csv(run: &Run) -> String {
    let mut out = String::from(
        "step,a,b,status,time,time_lower,kind,extent,subtracted,px,py,pz,nx,ny,nz,separation,normal_speed\n",
    );
    for row in &run.rows {
        let r = &row.record;
        let _ = write!(
            out,
            "{},{},{},{},{:?},{:?},{},{},{}",
            row.step,
            row.names[0],
            row.names[1],
            STATUS_NAMES[r.status as usize],
            r.time,
            r.time_lower,
            KIND_NAMES[r.kind as usize],
            EXTENT_NAMES[r.extent as usize],
            row.subtracted,
        );
        for v in r.point.iter().chain(&r.normal).chain([&r.separation, &r.normal_speed]) {
            let _ = write!(out, ",{v:?}");
        }
        out.push('\n');
    }
    out
}
