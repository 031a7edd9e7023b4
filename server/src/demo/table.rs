//! What the demo prints: a table of earliest contacts, what was met, and how long a step took.

use super::play::{Row, Run};
use super::script::{Act, DemoModel, PARTS, acts};
use crate::import::{Facets, Limits, import_csg};
use crate::report::{self, Feature, TableStyle};
use crate::solid::Solid;
use crate::terminal::{Paint, Piece, Role, WIDTH, cut, fold, time, width};
use contactd_proto::contact_record::{EXTENT_NAMES, KIND_NAMES, STATUS_NAMES};
use hdrhistogram::Histogram;
use std::collections::HashMap;
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

/// The table of earliest contacts: two lines or three for each, or one with its point and normal, however long.
pub fn contacts(run: &Run, style: &TableStyle) -> String {
    let acts = acts();
    let texts = Texts::read();
    let mut out = String::new();
    let mut act = usize::MAX;
    for row in chosen(run) {
        if row.act != act {
            act = row.act;
            let title = style.paint.mark(Role::Heading, acts[act].title);
            let head =
                if style.wide { wide_head() } else { line(["step", "time", "a", "b", "kind"].map(String::from)) };
            let _ = writeln!(out, "\n{title}\n{}", head.trim_end());
        }
        if style.wide {
            out += &wide(row);
            continue;
        }
        let r = &row.record;
        let names = row.names.each_ref().map(|name| cut(name, NAME));
        let [a, b] = names;
        let _ = writeln!(out, "{}", line([row.step.to_string(), time(r.time), a, b, kind(row)]).trim_end());
        let sides: [Vec<Piece>; 2] = std::array::from_fn(|k| {
            let part = part_of(&acts[act], &row.names[k]);
            report::faces(&texts.faces(part, [&r.faces_a, &r.faces_b][k]))
        });
        out += &meeting(&sides, style.paint);
    }
    let more = "--wide: with points and normals; --csv FILE: every contact, every digit";
    let _ = writeln!(out, "\n{}", style.paint.mark(Role::Faint, more));
    out
}

/// The faces that meet: on one line where they fit, else on a line or more for each side.
fn meeting(sides: &[Vec<Piece>; 2], paint: Paint) -> String {
    let [a, b] = sides.each_ref().map(|side| side.iter().map(|(_, text)| text.as_str()).collect::<Vec<_>>().join("; "));
    let both = format!("{a} | {b}");
    if width(&both) <= WIDTH - STEP {
        return format!("{:STEP$}{}\n", "", paint.mark(Role::Faint, &both));
    }
    let lines =
        sides.iter().zip(["a", "b"]).map(|(side, name)| fold(&format!("{:STEP$}{name}  ", ""), "; ", side, paint));
    lines.collect()
}

/// Columns of a step's number with the gap behind, and of a name.
const STEP: usize = 7;
const NAME: usize = 12;

fn line([step, time, a, b, kind]: [String; 5]) -> String {
    format!("{step:>5}  {time:<13}{a:<NAME$}  {b:<NAME$}  {kind}")
}

fn kind(row: &Row) -> String {
    let r = &row.record;
    match EXTENT_NAMES[r.extent as usize] {
        "" => STATUS_NAMES[r.status as usize].into(),
        extent => format!("{} ({extent})", KIND_NAMES[r.kind as usize]),
    }
}

/// The model of an object.
fn part_of(act: &Act, object: &str) -> &'static str {
    act.bodies.iter().find(|body| body.name == object).map_or("", |body| body.part.name)
}

/// The models' trees, which know the lines that their faces come from.
struct Texts(HashMap<&'static str, (String, Solid)>);

impl Texts {
    fn read() -> Self {
        let read = |part: &DemoModel| {
            let file = format!("{}.csg", part.name);
            let imported = import_csg(&file, part.text, Facets::Auto, &Limits::default()).ok()?;
            Some((part.name, (file, imported.solid)))
        };
        Self(PARTS.iter().filter_map(read).collect())
    }

    fn faces(&self, part: &str, ids: &[u32; 3]) -> Vec<Feature> {
        let Some((file, solid)) = self.0.get(part) else { return Vec::new() };
        ids.iter().filter_map(|id| Feature::of_face(file, solid, *id)).collect()
    }
}

/// A contact in one line.
fn wide(row: &Row) -> String {
    let r = &row.record;
    // What would print as -0 is 0.
    let [x, y, z] = r.point.map(|c| if c.abs() < 5e-5 { 0.0 } else { c });
    let [u, v, w] = r.normal.map(|c| if c.abs() < 5e-6 { 0.0 } else { c });
    let kind = if r.kind == 0 { STATUS_NAMES[r.status as usize] } else { KIND_NAMES[r.kind as usize] };
    format!(
        "{:>6}  {:<10} {:<10} {:>11.9}  {:<17} {:<7} {:<10}  {x:>9.4} {y:>9.4} {z:>9.4}   {u:>8.5} {v:>8.5} {w:>8.5}\n",
        row.step,
        row.names[0],
        row.names[1],
        r.time,
        kind,
        EXTENT_NAMES[r.extent as usize],
        if row.subtracted { "subtracted" } else { "added" },
    )
}

fn wide_head() -> String {
    format!(
        "{:>6}  {:<10} {:<10} {:>11}  {:<17} {:<7} {:<10}  {:>29}   {:>26}",
        "step", "a", "b", "time", "kind", "extent", "surface", "point", "normal"
    )
}

/// Counts, and the percentiles of a step's time as the client saw it.
pub fn summary(run: &Run, way: &str, paint: Paint) -> String {
    let subtracted = run.rows.iter().filter(|r| r.subtracted).count();
    let share = |n: usize, of: usize| 100.0 * n as f64 / of.max(1) as f64;
    let mut undecided = format!("{} undecided", run.undecided);
    if run.undecided > 0 {
        undecided = paint.mark(Role::Undecided, &undecided);
    }
    let met = format!("{} with a contact ({:.0} %)", run.steps_with_contact, share(run.steps_with_contact, run.steps));
    let mut out = format!("{} steps, {}, {undecided}\n", run.steps, paint.mark(Role::Contact, &met));
    let _ = writeln!(
        out,
        "{} contacts, {subtracted} of them on a subtracted surface ({:.0} %)",
        run.rows.len(),
        share(subtracted, run.rows.len()),
    );
    let mut histogram = Histogram::<u64>::new_with_bounds(1, 3_600_000_000_000, 3).expect("bounds are in order");
    for time in &run.latency {
        histogram.saturating_record(time.as_nanos() as u64);
    }
    let ms = |q: f64| histogram.value_at_quantile(q) as f64 / 1e6;
    let total: f64 = run.latency.iter().map(|d| d.as_secs_f64()).sum();
    let slowest = (0..run.latency.len()).max_by_key(|i| run.latency[*i]).unwrap_or(0);
    let _ = writeln!(out, "a step, {way}, the search included:");
    let _ = writeln!(
        out,
        "  p50 {:.3} ms, p99 {:.3} ms, p99.9 {:.3} ms, largest {:.3} ms (step {slowest})",
        ms(0.5),
        ms(0.99),
        ms(0.999),
        histogram.max() as f64 / 1e6,
    );
    let _ = writeln!(out, "  {total:.2} s in all");
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
