//! What a user would do today, on the same questions: tessellate and cast (parry's `Compound` and `TriMesh`), or halve a
//! discrete test, as a simulator without continuous detection does.

use super::{Context, series, times};
use crate::figure::{Axis, Figure, Stroke};
use crate::measure::{Known, Setting, ask, measure};
use crate::page::Section;
use crate::peer::{self, Body};
use crate::race::{Lap, Plan, quantile, race, worst};
use crate::row;
use crate::table::{Cell, Table, shown};
use crate::workload::{Case, Class, Peer, Truth};
use contactd::contact::Scratch;
use contactd_tests::engine::ReportedPoint as _;
use parry3d_f64::query;
use parry3d_f64::shape::SharedShape;
use std::time::Instant;

/// Substeps at which a discrete test looks before it halves.
const SUBSTEPS: usize = 16;
/// Smallest length that a figure tells from none.
const FLOOR: f64 = 1e-17;

/// One way to an answer, and what it gave.
struct Way {
    laps: Vec<Lap>,
    times: Vec<Option<f64>>,
}

/// Errors (lengths, in sizes) and how many answers are wrong: a contact where none is, or none where one is.
fn judged(class: &Class, known: &Known, speeds: &[f64], times: &[Option<f64>]) -> (Vec<f64>, usize) {
    let (mut errors, mut wrong) = (Vec::new(), 0);
    for ((i, reported), truth) in times.iter().enumerate().zip(&known.truths) {
        match (reported, truth) {
            (Some(t), Truth::Meets(u)) => errors.push((t - u).abs() * speeds[i] / class.cases[i].size()),
            (None, Truth::Clear) | (_, Truth::Unknown) => {}
            _ => wrong += 1,
        }
    }
    (errors, wrong)
}

fn question(case: &Case, peer: &Peer, drilled: &SharedShape) -> peer::Question {
    peer::Question::new(Body::new(drilled.clone()), &case.motion_a, peer.other.clone(), &case.motion_b)
}

/// Rows that a text shows: some of each way.
fn is_reported(row: &[Cell]) -> bool {
    let (Cell::Text(knob), Cell::Number(value)) = (&row[2], &row[3]) else { return false };
    let of: &[f64] = match knob.as_str() {
        "N" => &[16.0, 64.0, 256.0, 1024.0],
        "resolution" => &[1e-3, 1e-6, 1e-9, 1e-12],
        _ => &[1e-4, 1e-8, 1e-12],
    };
    of.iter().any(|v| (value / v - 1.0).abs() < 1e-6)
}

/// First time at which a discrete test hits, to a tolerance: looked for at substeps, then halved. May pass through.
fn halved(case: &Case, peer: &Peer, drilled: &SharedShape, tolerance: f64) -> Option<f64> {
    let body = Body::new(drilled.clone());
    let hits = |t: f64| {
        let [a, b] = [body.pose_at(&case.motion_a, t), peer.other.pose_at(&case.motion_b, t)];
        query::intersection_test(&a, &*body.shape, &b, &*peer.other.shape)
            .expect("the pair of shapes is supported")
            .intersecting
    };
    let at = |i: usize| i as f64 / SUBSTEPS as f64;
    let hit = (0..=SUBSTEPS).find(|i| hits(at(*i)))?;
    if hit == 0 {
        return Some(0.0);
    }
    let (mut free, mut met) = (at(hit - 1), at(hit));
    while met - free > tolerance {
        let middle = 0.5 * (free + met);
        if middle <= free || middle >= met {
            break;
        }
        if hits(middle) { met = middle } else { free = middle }
    }
    Some(met)
}

/// Races a way against the engine at its default; fewer cases where it would take too long.
fn run(class: &Class, plan: Plan, budget: f64, ask_peer: impl Fn(&Case) -> Option<f64>) -> Way {
    let from = Instant::now();
    ask_peer(&class.cases[0]);
    let each = from.elapsed().as_secs_f64();
    let count = ((budget / (each * (plan.blocks + 2) as f64)) as usize).clamp(1, class.cases.len());
    let times = class.cases[..count].iter().map(&ask_peer).collect();
    let mut scratch = Scratch::default();
    let laps = race(
        plan,
        count,
        |i| ask_peer(&class.cases[i]),
        |i| ask(&class.cases[i], &Setting::default(), &mut scratch).time(),
    );
    Way { laps, times }
}

/// The section.
pub fn today(context: &Context) -> Section {
    let mut table = Table::new(&[
        "class",
        "way",
        "knob",
        "value",
        "pieces",
        "build_ms",
        "cases",
        "p50_us",
        "p99_us",
        "max_us",
        "to_ours_p50",
        "to_ours_p99",
        "error_p50",
        "error_max",
        "bracket_max",
        "wrong",
    ]);
    let mut figures = Vec::new();
    let budget = context.pick(1.5, 0.1);
    let facets: Vec<usize> = context.pick(vec![16, 32, 64, 128, 256, 512, 1024], vec![16, 64]);
    let halvings: [usize; 2] = context.pick([64, 1024], [16, 64]);
    let tolerances: Vec<i32> = context.pick((1..=6).map(|k| 2 * k).collect(), vec![3, 9]);
    let exponents: Vec<i32> = context.pick((2..=12).collect(), vec![3, 9]);
    for (class, known) in context.of("parts") {
        let Some(peer) = &class.peer else { continue };
        context.progress(&format!("today's ways, {}", class.name));
        let mut scratch = Scratch::default();
        // Closing speed at the contact, of the certified answer: errors in time become lengths.
        let speeds: Vec<f64> =
            class.cases.iter().map(|c| ask(c, &Setting::default(), &mut scratch).at().normal_speed.abs()).collect();
        let us = |laps: &[Lap], q: f64| 1e6 * quantile(laps.iter().map(|l| l.least[0]), q);
        let mut lines = Vec::new();
        let (mut own, mut wide) = (Vec::new(), Vec::new());
        for e in &exponents {
            let setting = Setting::at(10f64.powi(-e));
            let m = measure((class, &setting), (class, &Setting::default()), known, context.plan);
            let (p50, off) = (us(&m.laps, 0.5), worst(m.errors.iter().copied()));
            let bracket = worst(m.brackets.iter().map(|b| b[0]));
            own.push([p50, off.max(FLOOR)]);
            wide.push([p50, bracket]);
            table.push(row![
                class.name.clone(),
                "contactd",
                "resolution",
                setting.resolution,
                1usize,
                f64::NAN,
                m.answers.len(),
                p50,
                us(&m.laps, 0.99),
                us(&m.laps, 1.0),
                quantile(m.laps.iter().map(|l| l.least_ratio()), 0.5),
                quantile(m.laps.iter().map(|l| l.least_ratio()), 0.99),
                quantile(m.errors.iter().copied(), 0.5),
                off,
                bracket,
                m.wrong + m.shallow,
            ]);
        }
        lines.push(series("contactd, error", own, Stroke::Solid, 0));
        lines.push(series("contactd, bracket", wide, Stroke::Dashed, 0));
        let mut best = (f64::INFINITY, f64::NAN);
        for (k, kind) in ["Compound", "TriMesh"].into_iter().enumerate() {
            let mut line = Vec::new();
            for n in &facets {
                let from = Instant::now();
                let shape = (peer.drilled)(*n)[k].clone();
                let build = 1e3 * from.elapsed().as_secs_f64();
                let pieces = match (shape.as_compound(), shape.as_trimesh()) {
                    (Some(c), _) => c.shapes().len(),
                    (_, Some(m)) => m.indices().len(),
                    _ => 1,
                };
                let way = run(class, context.plan, budget, |c| question(c, peer, &shape).time());
                let (errors, wrong) = judged(class, known, &speeds, &way.times);
                let off = worst(errors.iter().copied());
                let ratio = quantile(way.laps.iter().map(|l| l.least_ratio()), 0.5);
                // Of two that come equally near the faster one.
                if off < 0.99 * best.0 || (off < 1.01 * best.0 && ratio < best.1) {
                    best = (off, ratio);
                }
                line.push([us(&way.laps, 0.5), off.max(FLOOR)]);
                table.push(row![
                    class.name.clone(),
                    format!("cast, {kind}"),
                    "N",
                    *n,
                    pieces,
                    build,
                    way.times.len(),
                    us(&way.laps, 0.5),
                    us(&way.laps, 0.99),
                    us(&way.laps, 1.0),
                    quantile(way.laps.iter().map(|l| l.least_ratio()), 0.5),
                    quantile(way.laps.iter().map(|l| l.least_ratio()), 0.99),
                    quantile(errors.iter().copied(), 0.5),
                    off,
                    f64::NAN,
                    wrong,
                ]);
            }
            lines.push(series(format!("cast, {kind}"), line, Stroke::Solid, k + 1));
        }
        for (k, n) in halvings.into_iter().enumerate() {
            let shape = (peer.drilled)(n)[0].clone();
            let mut line = Vec::new();
            for e in &tolerances {
                let tolerance = 10f64.powi(-e);
                let way = run(class, context.plan, budget, |c| halved(c, peer, &shape, tolerance));
                let (errors, wrong) = judged(class, known, &speeds, &way.times);
                let off = worst(errors.iter().copied());
                line.push([us(&way.laps, 0.5), off.max(FLOOR)]);
                table.push(row![
                    class.name.clone(),
                    format!("halving, Compound of {n}"),
                    "time tolerance",
                    tolerance,
                    shape.as_compound().map_or(1, |c| c.shapes().len()),
                    f64::NAN,
                    way.times.len(),
                    us(&way.laps, 0.5),
                    us(&way.laps, 0.99),
                    us(&way.laps, 1.0),
                    quantile(way.laps.iter().map(|l| l.least_ratio()), 0.5),
                    quantile(way.laps.iter().map(|l| l.least_ratio()), 0.99),
                    quantile(errors.iter().copied(), 0.5),
                    off,
                    f64::NAN,
                    wrong,
                ]);
            }
            lines.push(series(format!("halving, Compound of {n}"), line, Stroke::Solid, k + 3));
        }
        let fine = lines[0].points.iter().zip(&exponents).filter(|(_, e)| **e >= 6);
        let own_error = worst(fine.map(|(p, _)| p[1]));
        figures.push(Figure {
            name: format!("accuracy_today_{}", class.name.split(|c: char| !c.is_alphanumeric()).collect::<Vec<_>>().join("_")),
            title: format!("Error against time: {}", class.name),
            caption: format!(
                "Worst error of the time of contact, as a length in sizes of the pair, against the median time of a question; \
                 further down and left is better. Blue: exact faces at resolutions 1e-2 to 1e-12; from 1e-6 down the error is at most {}. \
                 Casting against facets (N = {} to {}) buys digits at a steep price: the best reaches {} and takes {} \
                 times as long as the exact answer at its default. Halving a discrete test gets no nearer than its facets \
                 however fine its tolerance, and sees nothing between its {SUBSTEPS} substeps.",
                shown(own_error),
                facets[0],
                facets[facets.len() - 1],
                shown(best.0),
                times(best.1),
            ),
            axes: [
                Axis::Log("microseconds a question, median".into()),
                Axis::Log("worst error, in sizes of the pair".into()),
            ],
            series: lines,
        });
    }
    Section {
        name: "accuracy_today",
        title: "Beside what a user would do today".into(),
        text: "The drilled part as N facets a circle (OpenSCAD's way: corners on the circle), the other body exact for \
               parry. Cast: parry's cast_shapes, cast_shapes_nonlinear where something turns. Halving: parry's \
               intersection_test at 16 substeps, then bisection to the tolerance. wrong: met where nothing does, or passed through. \
               Ratios are to this engine at its default resolution, measured in the same blocks."
            .into(),
        figures,
        summary: table.chosen(is_reported),
        table,
    }
}

/// The harness puts both sides' bodies in the same place.
#[cfg(test)]
mod tests {
    use super::*;
    use crate::workload::parts;

    #[test]
    fn halving_comes_as_near_as_its_facets_and_its_tolerance() {
        let class = parts(3).into_iter().find(|c| c.name == "ball in pipe").expect("a pipe");
        let peer = class.peer.as_ref().expect("a peer");
        let shape = (peer.drilled)(256)[0].clone();
        for case in &class.cases {
            let Truth::Meets(time) = case.truth else { panic!("a ball pushed outwards meets the wall") };
            let found = halved(case, peer, &shape, 1e-9).expect("it meets");
            // The facets are nearer by up to 7.6e-5 of the radius.
            assert!((found - time).abs() * case.motion_b.velocity.length() < 1e-4, "{found} {time}");
        }
    }
}
