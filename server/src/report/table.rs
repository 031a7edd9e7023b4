//! The table for people: a summary, then a block for each pair, in 80 columns; or one line for each pair, as wide as it gets.
//!
//! Positions are rounded to a millionth of the larger bounding radius, directions to a millionth; lengths and speeds have six
//! digits. Nothing is told finer than the pair's resolution: what is smaller is 0. Times have nine decimals.

use super::answer::{Answer, ClearanceAnswer, Feature, PairAnswer};
use crate::terminal::{Paint, Piece, Role, WIDTH, aligned, clean, cut, fold, number, time, width};
use std::fmt::Write as _;

/// How a table is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TableStyle {
    /// Clear pairs of which nothing else is to be told have a row, too.
    pub all: bool,
    /// One line for each pair, however long, and numbers of nine digits.
    pub wide: bool,
    /// Its colours.
    pub paint: Paint,
}

/// Of a file's name so much is told in front of a line's number.
const FILE: usize = 24;
/// Columns in front of what is told of a pair.
const INDENT: &str = "    ";
/// Columns of a time and of the longest status, each with the gap behind.
const TIME: usize = 11 + 2;
const STATUS: usize = 9 + 2;
/// What positions are rounded to, in larger bounding radii; and directions.
const FINE: f64 = 1e-6;

/// The pairs of each status.
#[derive(Clone, Copy, Default)]
struct Counts {
    contact: usize,
    overlap: usize,
    undecided: usize,
    clear: usize,
    touching: usize,
    hidden: usize,
}

impl Answer {
    /// The answers as text: what is clear and has no more to tell is counted alone, unless `style` has all.
    pub fn table(&self, style: &TableStyle) -> String {
        let (mut out, counts) = self.summary(style);
        let shown: Vec<&PairAnswer> = self.pairs.iter().filter(|p| style.all || !is_plain(p)).collect();
        if !shown.is_empty() {
            out.push('\n');
            out += &if style.wide { wide(&shown) } else { narrow(&shown, style.paint) };
        }
        if counts.hidden > 0 {
            let pairs = if counts.hidden == 1 { "clear pair is" } else { "clear pairs are" };
            let line = format!("{} {pairs} not listed (--all)", counts.hidden);
            let _ = writeln!(out, "\n{}", style.paint.mark(Role::Faint, &line));
        }
        out
    }

    /// How many pairs there are of each status, and until when all are clear.
    fn summary(&self, style: &TableStyle) -> (String, Counts) {
        let mut n = Counts::default();
        for p in &self.pairs {
            match p.status {
                "contact" => n.contact += 1,
                "overlap" => n.overlap += 1,
                "undecided" => n.undecided += 1,
                _ => {
                    n.clear += 1;
                    n.touching += usize::from(p.touching);
                    n.hidden += usize::from(!style.all && is_plain(p));
                }
            }
        }
        let many = |n: usize, one: &str| format!("{n} {one}{}", if n == 1 { "" } else { "s" });
        let touching = if n.touching > 0 { format!(" ({} touching)", n.touching) } else { String::new() };
        let mut pieces: Vec<Piece> = [
            (n.contact, Role::Contact, many(n.contact, "contact")),
            (n.overlap, Role::Overlap, many(n.overlap, "overlap")),
            (n.undecided, Role::Undecided, format!("{} undecided", n.undecided)),
            (n.clear, Role::Clear, format!("{} clear{touching}", n.clear)),
        ]
        .into_iter()
        .filter(|(n, ..)| *n > 0)
        .map(|(_, role, text)| (Some(role), text))
        .collect();
        pieces.push(match self.safe_time {
            1.0 if self.pairs.iter().all(|p| p.discrete) && !self.pairs.is_empty() => {
                (None, "looked at where the step ends alone".into())
            }
            1.0 if self.pairs.iter().any(|p| p.discrete) => {
                (None, "proven clear for the whole step, discrete pairs where it ends".into())
            }
            1.0 => (None, "proven clear for the whole step".into()),
            t if t <= 0.0 => (None, "no part of the step proven clear".into()),
            t if self.pairs.iter().any(|p| p.discrete) => {
                (None, format!("proven clear until t = {}, discrete pairs where the step ends", time(t)))
            }
            t => (None, format!("proven clear until t = {}", time(t))),
        });
        let pairs = many(self.pairs.len(), "pair");
        (fold(&format!("{pairs}: "), ", ", &pieces, style.paint), n)
    }
}

/// Clear, and nothing else to be told.
fn is_plain(p: &PairAnswer) -> bool {
    p.status == "clear" && !p.touching && p.margin_time.is_none() && p.clearance.is_none()
}

fn role(status: &str) -> Role {
    match status {
        "contact" => Role::Contact,
        "overlap" => Role::Overlap,
        "clear" => Role::Clear,
        _ => Role::Undecided,
    }
}

/// A block for each pair.
fn narrow(pairs: &[&PairAnswer], paint: Paint) -> String {
    let names: Vec<[String; 2]> = pairs.iter().map(|p| [clean(&p.a), clean(&p.b)]).collect();
    let room = WIDTH - TIME - STATUS - 2;
    let widest = |side: usize| names.iter().map(|n| width(&n[side])).max().unwrap_or(0).max(1);
    // What one of them leaves the other one may take.
    let of_a = widest(0).min((room / 2).max(room.saturating_sub(widest(1))));
    let head = format!("{:<13}{:<11}{:<of_a$}  b", "time", "status", "a");
    let mut out = format!("{}\n", paint.mark(Role::Heading, &head));
    for (p, [a, b]) in pairs.iter().zip(&names) {
        let when = if ["contact", "overlap"].contains(&p.status) { p.time.map(time) } else { None };
        let status = paint.mark(role(p.status), p.status);
        let gap = " ".repeat(STATUS - p.status.len());
        let (a, b) = (cut(a, of_a), cut(b, room - of_a));
        let _ = writeln!(out, "{:<13}{status}{gap}{a:<of_a$}  {b}", when.as_deref().unwrap_or("-"));
        let details = details(p);
        if !details.is_empty() {
            out += &fold(INDENT, ", ", &details, paint);
        }
        for (side, features) in p.features.iter().flat_map(|f| [("a", &f.a), ("b", &f.b)]) {
            if !features.is_empty() {
                out += &fold(&format!("{INDENT}{side}  "), "; ", &faces(features), paint);
            }
        }
    }
    out
}

/// What is told of a pair beside its names.
fn details(p: &PairAnswer) -> Vec<Piece> {
    // No bounding radius: the resolution alone.
    let fine = p.resolution.max(FINE * p.size);
    let place = |v: [f64; 3]| format!("({})", v.map(|x| number(x, fine, 10)).join(", "));
    let direction = |v: [f64; 3]| format!("({})", v.map(|x| number(x, FINE, 6)).join(", "));
    let length = |x: f64| number(x, p.resolution, 6);
    let mut told = Vec::new();
    match (p.kind, p.extent) {
        (Some(kind), Some(extent)) => told.push(format!("{kind} ({extent})")),
        (kind, extent) => told.extend(kind.or(extent).map(String::from)),
    }
    if p.touching {
        told.push("touching".into());
    }
    if p.not_continued {
        told.push("not continued".into());
    }
    let lower = p.time_lower.filter(|t| p.status != "clear" && p.time.is_none_or(|u| time(u) != time(*t)));
    told.extend(lower.map(|t| format!("proven clear until {}", time(t))));
    told.extend(p.point.map(|x| format!("at {}", place(x))));
    told.extend(p.normal.map(|x| format!("normal {}", direction(x))));
    told.extend(p.separation.map(length).filter(|s| s != "0").map(|s| format!("separation {s}")));
    told.extend(p.normal_speed.map(|x| format!("normal speed {}", length(x))));
    if let Some(x) = &p.penetration {
        let (depth, along, at) = (length(x.depth), direction(x.direction), place(x.point));
        told.push(format!("{depth} deep"));
        told.push(format!("along {along}"));
        told.push(format!("deepest at {at}"));
    }
    told.extend(p.margin_time.map(|t| format!("farther apart than its margin until {}", time(t))));
    if let Some(c) = &p.clearance {
        told.push(apart(c, |x| number(x, FINE * p.size, 9)));
    }
    match (p.regions.len(), p.regions_complete) {
        (0 | 1, true) => {}
        (n, true) => told.push(format!("{n} regions (--json)")),
        (n, false) => told.push(format!("{n} regions (--json) and maybe more")),
    }
    told.into_iter().map(|text| (None, text)).collect()
}

/// A least distance in words.
fn apart(c: &ClearanceAnswer, length: impl Fn(f64) -> String) -> String {
    let bound = |x: Option<f64>| x.map_or_else(|| "infinity".to_owned(), &length);
    match (bound(c.lower), bound(c.upper)) {
        (lower, upper) if lower == upper => format!("least distance {upper}, at {}", time(c.time)),
        (lower, upper) => format!("least distance {lower} to {upper}, at {}", time(c.time)),
    }
}

/// Faces as "bolt.csg:41 cylinder, side".
pub fn faces(features: &[Feature]) -> Vec<Piece> {
    let face = |f: &Feature| {
        let (file, line) = &f.at;
        let file = cut(&clean(file.rsplit('/').next().unwrap_or_default()), FILE);
        let line = if *line > 0 { format!(":{line}") } else { String::new() };
        (Some(Role::Faint), format!("{file}{line} {}", named(f)))
    };
    features.iter().map(face).collect()
}

fn named(f: &Feature) -> String {
    format!("{}, {}{}", f.name, f.face, if f.sense == "negative" { " (subtracted)" } else { "" })
}

/// One line for each pair, features below those that have some.
fn wide(pairs: &[&PairAnswer]) -> String {
    let header = ["a", "b", "status", "time", "separation", "normal speed", "kind", "extent", "point", "normal"];
    let mut rows = vec![header.map(String::from)];
    for p in pairs {
        let mut status = String::from(p.status);
        if p.touching {
            status += " (touching)";
        }
        if p.not_continued {
            status += " (not continued)";
        }
        rows.push([
            clean(&p.a),
            clean(&p.b),
            status,
            p.time.map_or_else(String::new, time),
            p.separation.map_or_else(String::new, |x| digits(x, p.resolution)),
            p.normal_speed.map_or_else(String::new, |x| digits(x, p.resolution)),
            p.kind.unwrap_or_default().into(),
            p.extent.unwrap_or_default().into(),
            p.point.map_or_else(String::new, |v| vector(v, p.resolution)),
            p.normal.map_or_else(String::new, |v| vector(v, UNIT)),
        ]);
    }
    let mut out = aligned(&rows);
    for p in pairs {
        let (a, b) = (clean(&p.a), clean(&p.b));
        if let Some(x) = &p.penetration {
            let (depth, along) = (digits(x.depth, p.resolution), vector(x.direction, UNIT));
            let _ = writeln!(out, "{a} and {b} {depth} deep along {along} at {}", vector(x.point, p.resolution));
        }
        if let Some(t) = p.margin_time {
            let _ = writeln!(out, "{a} and {b} farther apart than their margin until {}", time(t));
        }
        if let Some(c) = &p.clearance {
            let _ = writeln!(out, "{a} and {b} {}", apart(c, |x| digits(x, FINE * p.size)));
        }
        if let Some(f) = &p.features {
            let side = |f: &[Feature]| {
                let face = |f: &Feature| format!("{}:{} {} {}", clean(&f.at.0), f.at.1, f.primitive, named(f));
                f.iter().map(face).collect::<Vec<_>>().join("; ")
            };
            let _ = writeln!(out, "{a}: {}; {b}: {}", side(&f.a), side(&f.b));
        }
    }
    out
}

/// What a unit vector's components are rounded to in the wide table.
const UNIT: f64 = 1e-9;

/// Nine decimals where the number is near 1, scientific where it is tiny or huge; what is below `quantum` is 0.
fn digits(x: f64, quantum: f64) -> String {
    let x = if x.abs() < quantum { 0.0 } else { x };
    if x != 0.0 && !(1e-4..1e6).contains(&x.abs()) { format!("{x:.8e}") } else { format!("{x:.9}") }
}

fn vector(v: [f64; 3], quantum: f64) -> String {
    format!("({})", v.map(|x| digits(x, quantum)).join(", "))
}
