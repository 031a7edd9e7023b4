//! Answers as users read them: the JSON object of `check --json`, the table, the work behind each answer.
//!
//! Numbers in JSON are the shortest decimals that read back to the same bits; the table shows nine digits. A field
//! without meaning for a status is null: a clear pair has no point. Features name the primitive by its index in file
//! order and the format's name, its face, and its sense in the solid.

use crate::contact::{Clock, Counters, Outcome, Region, Stage, Status};
use crate::solid::{Sense, Solid};
use contactd_proto::{EffectCounters, Report};
use glam::DVec3;
use serde::Serialize;
use std::fmt::Write as _;
use std::time::Duration;

/// One answer with what it takes to name its features.
#[derive(Clone, Copy, Debug)]
pub struct PairReport<'a> {
    /// Names of the two objects.
    pub names: [&'a str; 2],
    /// Their solids.
    pub solids: [&'a Solid; 2],
    /// The answer.
    pub outcome: &'a Outcome,
    /// How much of it is told.
    pub report: Report,
    /// Its contact regions, where its rule asks for them.
    pub regions: &'a [Region],
    /// False when there may be more of them.
    pub regions_complete: bool,
}

/// The object that `check --json` prints.
#[derive(Debug, Serialize)]
pub struct Answer {
    /// The smallest `time_lower` of all pairs searched; 1 without pairs.
    pub safe_time: f64,
    /// One per pair.
    pub pairs: Vec<PairAnswer>,
}

/// One pair of `Answer`; the fields are those of the file format, in its order.
#[derive(Debug, Serialize)]
#[allow(missing_docs)]
pub struct PairAnswer {
    pub a: String,
    pub b: String,
    pub status: &'static str,
    pub time: Option<f64>,
    pub time_lower: Option<f64>,
    pub time_upper: Option<f64>,
    pub touching: bool,
    /// Told where it holds: `time` could not be continued back from its witness and equals `time_upper`.
    #[serde(skip_serializing_if = "is_false")]
    pub not_continued: bool,
    pub point: Option<[f64; 3]>,
    pub normal: Option<[f64; 3]>,
    pub separation: Option<f64>,
    pub normal_speed: Option<f64>,
    pub kind: Option<&'static str>,
    pub extent: Option<&'static str>,
    pub resolution: f64,
    pub features: Option<Features>,
    pub cells: u64,
    /// Told of an overlap whose rule asks for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub penetration: Option<Penetration>,
    /// Told of a clear pair that comes within its margin: until when it is proven farther apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin_time: Option<f64>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub regions: Vec<RegionAnswer>,
    /// Told when the work limit cut the search for regions.
    #[serde(skip_serializing_if = "is_true")]
    pub regions_complete: bool,
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_false(b: &bool) -> bool {
    !*b
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_true(b: &bool) -> bool {
    *b
}

/// How deep an overlap is: along a direction from a to b, at its deepest point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct Penetration {
    pub depth: f64,
    pub direction: [f64; 3],
    pub point: [f64; 3],
}

/// A region in which a pair touches: points with the separation at each, and the faces that meet.
#[derive(Debug, Serialize)]
#[allow(missing_docs)]
pub struct RegionAnswer {
    pub kind: &'static str,
    pub extent: &'static str,
    pub normal: [f64; 3],
    pub points: Vec<[f64; 3]>,
    pub separations: Vec<f64>,
    pub features: Features,
}

/// The faces that meet, on each side.
#[derive(Debug, Serialize)]
pub struct Features {
    /// Faces of a.
    pub a: Vec<Feature>,
    /// Faces of b.
    pub b: Vec<Feature>,
}

/// One face of a primitive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Feature {
    /// Index of the primitive in file order.
    pub primitive: u32,
    /// The file format's name of it.
    pub name: String,
    /// Name of the face, in the primitive's frame.
    pub face: String,
    /// "positive", or "negative" where the primitive is subtracted.
    pub sense: &'static str,
}

impl Feature {
    /// The feature behind a face id of `solid`; `None` for an id that it does not have.
    pub fn of_face(solid: &Solid, face: u32) -> Option<Self> {
        let primitive = *solid.face_owner.get(face as usize)?;
        let p = &solid.primitives[primitive as usize];
        let sense = match solid.senses[primitive as usize] {
            Sense::Positive => "positive",
            Sense::Negative => "negative",
        };
        let face = p.face_name((face - p.first_face) as usize);
        Some(Self { primitive, name: p.label.name.clone(), face, sense })
    }
}

impl Answer {
    /// The answer made of some pairs; `safe_time` covers exactly these.
    pub fn of_pairs(pairs: &[PairReport<'_>]) -> Self {
        let safe_time = pairs.iter().fold(1.0, |t: f64, p| t.min(p.outcome.time_lower()));
        Self { safe_time, pairs: pairs.iter().map(PairAnswer::of_pair).collect() }
    }

    /// One line of JSON.
    pub fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string(self)
    }

    /// The table for people: nine digits, one line per pair, features below those that have some.
    pub fn table(&self) -> String {
        let header = ["a", "b", "status", "time", "separation", "normal speed", "kind", "extent", "point", "normal"];
        let mut rows = vec![header.map(String::from)];
        for p in &self.pairs {
            let mut status = String::from(p.status);
            if p.touching {
                status += " (touching)";
            }
            if p.not_continued {
                status += " (not continued)";
            }
            rows.push([
                p.a.clone(),
                p.b.clone(),
                status,
                p.time.map_or_else(String::new, digits),
                p.separation.map_or_else(String::new, digits),
                p.normal_speed.map_or_else(String::new, digits),
                p.kind.unwrap_or_default().into(),
                p.extent.unwrap_or_default().into(),
                p.point.map_or_else(String::new, vector),
                p.normal.map_or_else(String::new, vector),
            ]);
        }
        let mut out = aligned(&rows);
        for p in &self.pairs {
            if let Some(x) = &p.penetration {
                let _ = writeln!(out, "{} deep along {} at {}", digits(x.depth), vector(x.direction), vector(x.point));
            }
            if let Some(t) = p.margin_time {
                let _ = writeln!(out, "{} and {} farther apart than their margin until {}", p.a, p.b, digits(t));
            }
            if let Some(f) = &p.features {
                let side = |f: &[Feature]| f.iter().map(Feature::to_string).collect::<Vec<_>>().join(", ");
                let _ = writeln!(out, "{} on {}, {} on {}", side(&f.a), p.a, side(&f.b), p.b);
            }
        }
        let _ = writeln!(out, "safe time {}", digits(self.safe_time));
        out
    }
}

impl std::fmt::Display for Feature {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sense = if self.sense == "negative" { "subtracted " } else { "" };
        write!(f, "{} of {sense}{} {}", self.face, self.name, self.primitive)
    }
}

impl PairAnswer {
    fn of_pair(pair: &PairReport<'_>) -> Self {
        let o = pair.outcome;
        let reported = |least| pair.report >= least;
        // A clear pair that touches has the fields of its nearest region.
        let rests = o.status() == Status::Clear && !pair.regions.is_empty();
        let point = o.point().filter(|_| rests || o.meets() && reported(Report::Contact));
        // Bodies that overlap meet in no one way.
        let met = point.filter(|_| o.status() != Status::Overlap);
        let features = |solid: &Solid, faces: &[u32; 3]| {
            faces.iter().filter_map(|f| Feature::of_face(solid, *f)).collect::<Vec<_>>()
        };
        Self {
            a: pair.names[0].to_owned(),
            b: pair.names[1].to_owned(),
            status: o.status().name(),
            time: reported(Report::Time).then_some(o.time()),
            time_lower: reported(Report::Time).then_some(o.time_lower()),
            time_upper: reported(Report::Time).then_some(o.time_upper()),
            touching: o.touching,
            not_continued: o.not_continued() && reported(Report::Time),
            point: point.map(|p| p.point.to_array()),
            normal: point.map(|p| p.normal.to_array()),
            separation: point.map(|p| p.separation),
            normal_speed: point.map(|p| p.normal_speed),
            kind: met.map(|p| p.kind.name()),
            extent: met.map(|p| p.extent.name()),
            resolution: o.resolution,
            features: point
                .map(|p| Features { a: features(pair.solids[0], &p.faces_a), b: features(pair.solids[1], &p.faces_b) }),
            cells: o.counters.cells,
            penetration: o.penetration().map(|p| Penetration {
                depth: p.depth,
                direction: p.direction.to_array(),
                point: p.point.to_array(),
            }),
            margin_time: (o.margin_time < 1.0).then_some(o.margin_time),
            regions: pair
                .regions
                .iter()
                .map(|r| RegionAnswer {
                    kind: r.kind.name(),
                    extent: r.extent.name(),
                    normal: r.normal.to_array(),
                    points: r.points.iter().map(|p| p.point.to_array()).collect(),
                    separations: r.points.iter().map(|p| p.separation).collect(),
                    features: Features {
                        a: features(pair.solids[0], &r.faces_a),
                        b: features(pair.solids[1], &r.faces_b),
                    },
                })
                .collect(),
            regions_complete: pair.regions_complete,
        }
    }
}

/// What each answer cost: the stage that told it, primitives before and after stage 1, octree nodes, candidates, cells,
/// clauses, attempts, whole-primitive answers, and the time of each stage by a clock for each pair; `None`: no search was
/// needed.
pub fn work_table(pairs: &[PairReport<'_>], clocks: &[Option<Clock>]) -> String {
    let header = [
        "a",
        "b",
        "reported by",
        "primitives",
        "after stage 1",
        "node pairs",
        "candidates",
        "cells",
        "clauses",
        "newton",
        "closed forms",
        "instant cells",
        "in front",
        "stage 1",
        "stage 2",
        "stage 3",
        "in all",
    ];
    let mut rows = vec![header.map(String::from)];
    let mut sums = [Duration::ZERO; Stage::ALL.len()];
    for (p, clock) in pairs.iter().zip(clocks) {
        let Counters {
            after_stage1, node_pairs, candidates, cells, clauses, newton, closed_forms, instant_cells, ..
        } = p.outcome.counters;
        let primitives: usize = p.solids.iter().map(|s| s.primitives.len()).sum();
        let reported = clock.as_ref().map_or("boxes", |c| c.last().name());
        let searched = clock.as_ref().is_some_and(|c| c.last() != Stage::Front);
        // What is answered in front never comes to stage 1.
        let left = if searched { after_stage1.to_string() } else { String::new() };
        let [a, b] = p.names.map(String::from);
        let counts =
            [node_pairs, candidates, cells, clauses, newton, closed_forms, instant_cells].map(|n| n.to_string());
        let [c0, c1, c2, c3, c4, c5, c6] = counts;
        let times = Stage::ALL.map(|s| clock.as_ref().map_or_else(String::new, |c| micros(c.of(s))));
        let [t0, t1, t2, t3] = times;
        let total = clock.as_ref().map_or_else(String::new, |c| micros(c.total()));
        for (sum, s) in sums.iter_mut().zip(Stage::ALL) {
            *sum += clock.as_ref().map_or(Duration::ZERO, |c| c.of(s));
        }
        let primitives = primitives.to_string();
        rows.push([a, b, reported.into(), primitives, left, c0, c1, c2, c3, c4, c5, c6, t0, t1, t2, t3, total]);
    }
    let mut out = aligned(&rows);
    let total: Duration = sums.iter().sum();
    let share = |d: &Duration| 100.0 * d.as_secs_f64() / total.as_secs_f64().max(1e-9);
    let shares = sums.iter().zip(Stage::ALL).map(|(d, s)| format!("{} {:.0} %", s.name(), share(d)));
    let _ = writeln!(
        out,
        "in all {} us: {} (one thread, nothing remembered; the least of some runs of each pair)",
        micros(total),
        shares.collect::<Vec<_>>().join(", ")
    );
    out
}

/// What the step worked out beside whether its pairs meet: each effect that ran, and how often.
pub fn effects_line(effects: &EffectCounters) -> String {
    let ran: Vec<String> =
        effects.each().filter(|(_, count)| *count > 0).map(|(name, count)| format!("{name} {count}")).collect();
    if ran.is_empty() { "effects: none\n".into() } else { format!("effects: {}\n", ran.join(", ")) }
}

/// Microseconds, to three digits.
fn micros(d: Duration) -> String {
    let us = 1e6 * d.as_secs_f64();
    match us {
        0.0 => "0".into(),
        _ if us < 10.0 => format!("{us:.2}"),
        _ if us < 100.0 => format!("{us:.1}"),
        _ => format!("{us:.0}"),
    }
}

/// Columns as wide as their widest entry.
fn aligned<const N: usize>(rows: &[[String; N]]) -> String {
    let width = |k: usize| rows.iter().map(|r| r[k].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(width);
    let mut out = String::new();
    for row in rows {
        let cells = row.iter().zip(widths).map(|(c, w)| format!("{c:<w$}"));
        out.push_str(cells.collect::<Vec<_>>().join("  ").trim_end());
        out.push('\n');
    }
    out
}

/// Nine significant digits where the number is near 1, scientific where it is tiny.
fn digits(x: f64) -> String {
    if x != 0.0 && !(1e-4..1e6).contains(&x.abs()) { format!("{x:.8e}") } else { format!("{x:.9}") }
}

fn vector(v: [f64; 3]) -> String {
    let v = DVec3::from_array(v);
    format!("({}, {}, {})", digits(v.x), digits(v.y), digits(v.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{Contact, ContactKind, ContactPoint, Extent, Verdict};
    use crate::import::{Facets, Limits, import_csg};

    fn plate() -> Solid {
        let text =
            "difference() { cube(size = [4, 4, 1], center = true);\n cylinder(h = 2, r1 = 1, r2 = 1, center = true); }";
        import_csg("plate.csg", text, Facets::Auto, &Limits::default()).expect("a plate").solid
    }

    fn contact() -> Outcome {
        let point = ContactPoint {
            point: DVec3::new(1.0, 0.0, 0.0),
            normal: DVec3::X,
            kind: ContactKind::EdgeFace,
            extent: Extent::Line,
            faces_a: [6, u32::MAX, u32::MAX],
            faces_b: [0, 4, u32::MAX],
            ..ContactPoint::default()
        };
        let contact = Contact {
            time_lower: 0.1,
            time: 0.1 + 0.2,
            time_upper: 1.0,
            not_continued: false,
            witness: None,
            point: Some(point),
        };
        Outcome { verdict: Verdict::Contact(contact), ..Outcome::clear(1e-9) }
    }

    /// What is reported of the solid and itself, without regions.
    fn report<'a>(solid: &'a Solid, outcome: &'a Outcome) -> PairReport<'a> {
        PairReport {
            names: ["a", "b"],
            solids: [solid, solid],
            outcome,
            report: Report::Contact,
            regions: &[],
            regions_complete: true,
        }
    }

    #[test]
    fn json_is_exact_and_names_features() {
        let solid = plate();
        let outcome = contact();
        let pair = report(&solid, &outcome);
        let json = Answer::of_pairs(&[pair]).json().expect("finite numbers");
        let expected = concat!(
            r#"{"safe_time":0.1,"pairs":[{"a":"a","b":"b","status":"contact","time":0.30000000000000004,"#,
            r#""time_lower":0.1,"time_upper":1.0,"touching":false,"point":[1.0,0.0,0.0],"normal":[1.0,0.0,0.0],"#,
            r#""separation":0.0,"normal_speed":0.0,"kind":"edge-face","extent":"line","resolution":1e-9,"#,
            r#""features":{"a":[{"primitive":1,"name":"cylinder","face":"side","sense":"negative"}],"#,
            r#""b":[{"primitive":0,"name":"cube","face":"+x","sense":"positive"},"#,
            r#"{"primitive":0,"name":"cube","face":"+z","sense":"positive"}]},"cells":0}]}"#
        );
        assert_eq!(json, expected);
    }

    #[test]
    fn a_time_that_was_not_continued_is_told_so() {
        let solid = plate();
        let mut outcome = contact();
        if let Verdict::Contact(contact) = &mut outcome.verdict {
            contact.not_continued = true;
        }
        let answer = Answer::of_pairs(&[report(&solid, &outcome)]);
        assert!(answer.json().expect("json").contains(r#""touching":false,"not_continued":true,"point""#));
        assert!(answer.table().contains("contact (not continued)"), "{}", answer.table());
        let hit = PairReport { report: Report::Hit, ..report(&solid, &outcome) };
        assert!(!Answer::of_pairs(&[hit]).json().expect("json").contains("not_continued"), "a hit has no time");
    }

    #[test]
    fn fields_without_meaning_are_null() {
        let solid = plate();
        let clear = Outcome::clear(1e-9);
        let pair = report(&solid, &clear);
        let answer = Answer::of_pairs(&[pair]);
        let p = &answer.pairs[0];
        assert!(p.point.is_none() && p.normal.is_none() && p.kind.is_none() && p.extent.is_none());
        assert!(p.separation.is_none() && p.normal_speed.is_none() && p.features.is_none());
        assert_eq!(answer.safe_time, 1.0);
        assert_eq!(Answer::of_pairs(&[]).json().expect("json"), r#"{"safe_time":1.0,"pairs":[]}"#);
    }

    #[test]
    fn work_names_the_primitives_of_a_pair_that_no_search_was_needed_for() {
        let solid = plate();
        let clear = Outcome::clear(1e-9);
        let searched = Outcome {
            counters: Counters { primitives: 4, after_stage1: 3, cells: 7, clauses: 20, ..Counters::default() },
            ..contact()
        };
        let pairs = [report(&solid, &clear), report(&solid, &searched)];
        let text = work_table(&pairs, &[None, Some(Clock::default())]);
        let words: Vec<Vec<&str>> = text.lines().map(|l| l.split_whitespace().collect()).collect();
        assert_eq!(words[1][..4], ["a", "b", "boxes", "4"], "{text}");
        assert_eq!(words[2][..5], ["a", "b", "in", "front", "4"], "{text}");
        assert!(words[2].contains(&"7") && words[2].contains(&"20"), "{text}");
    }

    #[test]
    fn the_table_has_nine_digits() {
        let solid = plate();
        let outcome = contact();
        let pair = PairReport {
            names: ["peg", "plate"],
            solids: [&solid, &solid],
            outcome: &outcome,
            report: Report::Contact,
            regions: &[],
            regions_complete: true,
        };
        let table = Answer::of_pairs(&[pair]).table();
        assert!(table.contains("0.300000000"), "{table}");
        assert!(table.contains("side of subtracted cylinder 1 on peg"), "{table}");
    }
}
