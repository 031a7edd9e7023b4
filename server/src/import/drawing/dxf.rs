//! DXF drawings, in text, as OpenSCAD 2021.01 reads them (DxfData): LINE, LWPOLYLINE, CIRCLE, ARC, ELLIPSE and INSERT of blocks.
//!
//! Points are moved to a grid of 1/1024, as OpenSCAD does, so that ends that nearly meet do. Lines that meet are one path; a path that
//! is open is closed. All paths together are filled by the even-odd rule: a line that is drawn twice is none. Bulges of polylines and other entities are left out, which is told.

use super::{Drawing, Frame};
use crate::import::Place;
use crate::import::problem::Problem;
use glam::DVec2;
use std::collections::{BTreeMap, HashMap};

type Result<T> = std::result::Result<T, (Place, Problem)>;
type Line = [DVec2; 2];

/// OpenSCAD's coarse grid.
const GRID: f64 = 1.0 / 1024.0;
/// Lines of one drawing.
const MOST_LINES: usize = 200_000;

/// Reads a drawing.
///
/// # Errors
/// What is no pair of a group code and a value; too many lines.
pub fn read(bytes: &[u8], frame: &Frame<'_>) -> Result<Drawing> {
    let text = String::from_utf8_lossy(bytes);
    let mut reader =
        Reader { frame, lines: Vec::new(), blocks: HashMap::new(), block: None, off: 0.0, left: BTreeMap::new() };
    let mut entity = Entity::default();
    let (mut section, mut at) = (Section::Other, 0);
    let mut lines = text.lines();
    while let (Some(code), Some(value)) = (lines.next(), lines.next()) {
        at += 2;
        let place = Place { line: at - 1, column: 1 };
        let Ok(code) = code.trim().parse::<i32>() else {
            return Err((place, Problem::syntax("a group code", format!("{:?}", code.trim()))));
        };
        let value = value.trim();
        if code != 0 {
            entity.set(code, value);
            continue;
        }
        if entity.kind == "SECTION" {
            section = match entity.name.as_str() {
                "ENTITIES" => Section::Entities,
                "BLOCKS" => Section::Blocks,
                _ => Section::Other,
            };
        } else {
            reader.add(&entity, section);
        }
        if reader.lines.len() > MOST_LINES {
            return Err((place, Problem::Limit { what: "lines of a drawing", limit: MOST_LINES }));
        }
        entity = Entity { kind: value.to_owned(), ..Entity::default() };
    }
    let Reader { lines, off, left, .. } = reader;
    let mut shapes = vec![joined(&lines)];
    if frame.center {
        let corners = || shapes.iter().flatten().flatten();
        let low = corners().fold(DVec2::INFINITY, |m, p| m.min(*p));
        let high = corners().fold(DVec2::NEG_INFINITY, |m, p| m.max(*p));
        shapes.iter_mut().flatten().flatten().for_each(|p| *p -= (low + high) * 0.5);
    }
    Ok(Drawing { shapes, off, left_out: left.into_iter().collect(), zeros: None })
}

/// Where in a file an entity stands.
#[derive(Clone, Copy, PartialEq)]
enum Section {
    Entities,
    Blocks,
    Other,
}

/// The values of an entity by their group codes.
#[derive(Default)]
struct Entity {
    kind: String,
    name: String,
    layer: String,
    x: Vec<f64>,
    y: Vec<f64>,
    /// Codes 40 to 51, where they are numbers.
    numbers: HashMap<i32, f64>,
    flags: i32,
    bulges: bool,
}

impl Entity {
    fn set(&mut self, code: i32, value: &str) {
        let number = || value.parse::<f64>().ok().filter(|n| n.is_finite());
        match code {
            2 => self.name = value.to_owned(),
            8 => self.layer = value.to_owned(),
            10 | 11 => self.x.extend(number()),
            20 | 21 => self.y.extend(number()),
            70 => self.flags = value.parse().unwrap_or(0),
            40..=51 => {
                self.bulges |= code == 42 && number().is_some_and(|n| n != 0.0);
                self.numbers.extend(number().map(|n| (code, n)));
            }
            _ => {}
        }
    }

    fn points(&self) -> Vec<DVec2> {
        self.x.iter().zip(&self.y).map(|(x, y)| DVec2::new(*x, *y)).collect()
    }

    fn number(&self, code: i32, default: f64) -> f64 {
        self.numbers.get(&code).copied().unwrap_or(default)
    }
}

/// What was read.
struct Reader<'f> {
    frame: &'f Frame<'f>,
    lines: Vec<Line>,
    blocks: HashMap<String, Vec<Line>>,
    /// The block that is being read.
    block: Option<String>,
    off: f64,
    /// What was left out, and how often.
    left: BTreeMap<String, usize>,
}

impl Reader<'_> {
    fn add(&mut self, entity: &Entity, section: Section) {
        match entity.kind.as_str() {
            "BLOCK" => self.block = Some(entity.name.clone()),
            "ENDBLK" => self.block = None,
            "" | "ENDSEC" | "EOF" | "SECTION" | "DIMENSION" | "SEQEND" => {}
            _ if section == Section::Other => {}
            _ => {
                let of_layer = self.frame.layer.is_empty() || self.frame.layer == entity.layer;
                if section == Section::Entities && !of_layer {
                    return;
                }
                let Some(lines) = self.lines_of(entity, section) else {
                    *self.left.entry(entity.kind.clone()).or_default() += 1;
                    return;
                };
                if entity.kind == "LWPOLYLINE" && entity.bulges {
                    *self.left.entry("bulges of LWPOLYLINE".into()).or_default() += 1;
                }
                match (section, &self.block) {
                    (Section::Entities, _) => self.lines.extend(lines),
                    (Section::Blocks, Some(name)) => self.blocks.entry(name.clone()).or_default().extend(lines),
                    (Section::Blocks, None) | (Section::Other, _) => {}
                }
            }
        }
    }

    /// The lines of an entity; `None` for one that is not read, or without what it needs.
    fn lines_of(&mut self, entity: &Entity, section: Section) -> Option<Vec<Line>> {
        // Blocks are in coordinates of their own.
        let (origin, scale) =
            if section == Section::Blocks { (DVec2::ZERO, 1.0) } else { (self.frame.origin, self.frame.scale) };
        let raw = entity.points();
        let points: Vec<DVec2> = raw.iter().map(|p| (*p - origin) * scale).collect();
        let chain = |path: Vec<DVec2>| path.windows(2).map(|w| [w[0], w[1]]).collect::<Vec<Line>>();
        match entity.kind.as_str() {
            "LINE" => Some(vec![[*points.first()?, *points.get(1)?]]),
            "LWPOLYLINE" => {
                let mut path = points;
                if entity.flags & 1 == 1 {
                    path.push(*path.first()?);
                }
                Some(chain(path))
            }
            "CIRCLE" | "ARC" => {
                let (center, radius) = (*points.first()?, entity.number(40, 0.0) * scale);
                let (from, to) =
                    if entity.kind == "ARC" { (entity.number(50, 0.0), entity.number(51, 0.0)) } else { (0.0, 360.0) };
                let sweep = if from > to { (to - from).rem_euclid(360.0) } else { to - from };
                let at = |t: f64| {
                    let (sin, cos) = libm::sincos(t.to_radians());
                    center + DVec2::new(cos, sin) * radius
                };
                Some(chain(self.curve(radius, sweep / 360.0, |s| at(from + sweep * s))))
            }
            "ELLIPSE" => {
                // The end of the longer half axis from the centre; OpenSCAD moves it by the origin as it does any point.
                let (center, long) = (*points.first()?, *points.get(1)?);
                let (from, to) = (entity.number(41, 0.0), entity.number(42, 0.0));
                let turn = std::f64::consts::TAU;
                let sweep = if from > to { (to - from).rem_euclid(turn) } else { to - from };
                let short = long.perp() * entity.number(40, 0.0) * if section == Section::Blocks { 1.0 } else { scale };
                let at = |s: f64| {
                    let (sin, cos) = libm::sincos(from + sweep * s);
                    center + long * cos + short * sin
                };
                Some(chain(self.curve(long.length(), sweep / turn, at)))
            }
            "INSERT" => {
                let lines = self.blocks.get(&entity.name).cloned().unwrap_or_default();
                let at = *points.first()?;
                let size = DVec2::new(entity.number(41, 1.0), entity.number(42, 1.0));
                let (sin, cos) = libm::sincos(entity.number(50, 0.0).to_radians());
                let put = |p: DVec2| DVec2::new(cos, sin).rotate(p * size) * self.frame.scale + at;
                Some(lines.into_iter().map(|line| line.map(put)).collect())
            }
            _ => None,
        }
    }

    /// The corners of a part of a turn in OpenSCAD's pieces; how far these lie off is kept.
    fn curve(&mut self, radius: f64, part: f64, at: impl Fn(f64) -> DVec2) -> Vec<DVec2> {
        let whole = (self.frame.pieces)(radius.abs());
        let count = (f64::from(whole) * part).ceil().clamp(1.0, 1e5);
        let angle = std::f64::consts::PI * part / count;
        self.off = self.off.max(radius.abs() * (1.0 - libm::cos(angle)));
        (0..=count as u32).map(|i| at(f64::from(i) / count)).collect()
    }
}

/// Lines that meet, as paths: those with ends first, then the others.
fn joined(lines: &[Line]) -> Vec<Vec<DVec2>> {
    let mut known: HashMap<[i64; 2], usize> = HashMap::new();
    let mut points: Vec<DVec2> = Vec::new();
    let mut number = |p: DVec2| {
        let cell = (p / GRID).round().to_array().map(|v| v as i64);
        let near = |k: [i64; 2]| (k[0] - cell[0]).abs() + (k[1] - cell[1]).abs();
        let around = (-1..=1).flat_map(|i| (-1..=1).map(move |j| [cell[0] + i, cell[1] + j]));
        let found = around.filter(|k| known.contains_key(k)).min_by_key(|k| near(*k)).unwrap_or(cell);
        *known.entry(found).or_insert_with(|| {
            points.push(DVec2::new(found[0] as f64, found[1] as f64) * GRID);
            points.len() - 1
        })
    };
    let mut edges: Vec<[usize; 2]> = lines.iter().map(|line| line.map(&mut number)).collect();
    let undirected = |e: &[usize; 2]| [e[0].min(e[1]), e[0].max(e[1])];
    let mut odd: HashMap<[usize; 2], bool> = HashMap::with_capacity(edges.len());
    edges.iter().for_each(|e| *odd.entry(undirected(e)).or_default() ^= true);
    // By the even-odd rule two of a line are none, and three are one.
    edges.retain(|e| e[0] != e[1] && odd.insert(undirected(e), false) == Some(true));
    let mut at: Vec<Vec<usize>> = vec![Vec::new(); points.len()];
    for (e, ends) in edges.iter().enumerate() {
        ends.iter().for_each(|p| at[*p].push(e));
    }
    let mut used = vec![false; edges.len()];
    let mut paths = Vec::new();
    let walk = |start: usize, used: &mut Vec<bool>, paths: &mut Vec<Vec<DVec2>>| {
        let (mut path, mut here) = (vec![start], start);
        while let Some(&e) = at[here].iter().find(|e| !used[**e]) {
            used[e] = true;
            here = if edges[e][0] == here { edges[e][1] } else { edges[e][0] };
            if here == start {
                break;
            }
            path.push(here);
        }
        if path.len() >= 3 {
            paths.push(path.into_iter().map(|i| points[i]).collect());
        }
    };
    for p in (0..points.len()).filter(|p| at[*p].len() == 1) {
        if at[p].iter().any(|e| !used[*e]) {
            walk(p, &mut used, &mut paths);
        }
    }
    for e in 0..edges.len() {
        if !used[e] {
            walk(edges[e][0], &mut used, &mut paths);
        }
    }
    paths
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str, layer: &str) -> Drawing {
        let frame = Frame { layer, id: "", dpi: 72.0, center: false, origin: DVec2::ZERO, scale: 1.0, pieces: &|_| 64 };
        read(text.as_bytes(), &frame).expect("a drawing")
    }

    fn entities(list: &[&str]) -> String {
        format!("0\nSECTION\n2\nENTITIES\n{}0\nENDSEC\n0\nEOF\n", list.concat())
    }

    fn line(a: [f64; 2], b: [f64; 2], layer: &str) -> String {
        format!("0\nLINE\n8\n{layer}\n10\n{}\n20\n{}\n11\n{}\n21\n{}\n", a[0], a[1], b[0], b[1])
    }

    fn area(paths: &[Vec<DVec2>]) -> f64 {
        paths.iter().map(|p| (0..p.len()).map(|i| 0.5 * p[i].perp_dot(p[(i + 1) % p.len()])).sum::<f64>().abs()).sum()
    }

    #[test]
    fn lines_that_nearly_meet_in_any_order_are_paths() {
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
        let mut list: Vec<String> = (0..4)
            .map(|i| line(square[i], square[(i + 1) % 4].map(|v| v + 2e-4), if i < 9 { "a" } else { "" }))
            .collect();
        list.swap(0, 2);
        list.push(line([9.0, 9.0], [10.0, 9.0], "b"));
        list.push(line([10.0, 9.0], [9.0, 10.0], "b"));
        let text = entities(&list.iter().map(String::as_str).collect::<Vec<_>>());
        let drawing = read_text(&text, "");
        assert_eq!(drawing.shapes[0].len(), 2);
        // The second path is open and closed by a line.
        assert!((area(&drawing.shapes[0]) - 12.5).abs() < 0.02, "{:?}", drawing.shapes);
        assert!((area(&read_text(&text, "a").shapes[0]) - 12.0).abs() < 0.02);
        assert!(read_text(&text, "none").shapes[0].is_empty());
    }

    /// The expected areas are those of OpenSCAD 2021.01.
    #[test]
    fn corners_lie_on_the_grid_of_openscad_and_lines_that_are_drawn_twice_are_none() {
        let outline = |corners: &[[f64; 2]]| -> Vec<String> {
            let n = corners.len();
            (0..n).map(|i| line(corners[i], corners[(i + 1) % n], "0")).collect()
        };
        let filled = |lines: &[Vec<String>]| {
            let text = entities(&lines.concat().iter().map(String::as_str).collect::<Vec<_>>());
            area(&read_text(&text, "").shapes[0])
        };
        let triangle = outline(&[[0.5, 0.0], [10.5, 0.0], [0.5, 10.0]]);
        assert_eq!(filled(std::slice::from_ref(&triangle)), 50.0);
        assert_eq!(filled(&[triangle.clone(), triangle.clone()]), 0.0);
        assert_eq!(filled(&[triangle.clone(), triangle.clone(), triangle]), 50.0);
        // What two squares share is within one outline; of a side that is drawn twice the other sides are closed by a line.
        let left = outline(&[[0.0, 0.0], [8.0, 0.0], [8.0, 8.0], [0.0, 8.0]]);
        let right = outline(&[[8.0, 0.0], [16.0, 0.0], [16.0, 8.0], [8.0, 8.0]]);
        assert_eq!(filled(&[left.clone(), right]), 128.0);
        let side = vec![left[1].clone()];
        assert_eq!(filled(&[left, side]), 64.0);
    }

    #[test]
    fn curves_blocks_and_what_is_left_out() {
        let circle = "0\nCIRCLE\n8\n0\n10\n1\n20\n2\n40\n3\n";
        let drawing = read_text(&entities(&[circle]), "");
        assert!((area(&drawing.shapes[0]) - std::f64::consts::PI * 9.0).abs() < 0.1 && drawing.off > 1e-3);
        let half = "0\nARC\n8\n0\n10\n0\n20\n0\n40\n2\n50\n270\n51\n90\n";
        assert!((area(&read_text(&entities(&[half]), "").shapes[0]) - 2.0 * std::f64::consts::PI).abs() < 0.05);
        let ellipse = "0\nELLIPSE\n8\n0\n10\n0\n20\n0\n11\n0\n21\n4\n40\n0.5\n41\n0\n42\n6.283185307179586\n";
        assert!((area(&read_text(&entities(&[ellipse]), "").shapes[0]) - 8.0 * std::f64::consts::PI).abs() < 0.1);
        let poly = "0\nLWPOLYLINE\n8\n0\n70\n1\n10\n0\n20\n0\n10\n2\n20\n0\n42\n1\n10\n2\n20\n2\n";
        let drawing = read_text(&entities(&[poly, "0\nSPLINE\n8\n0\n"]), "");
        assert!((area(&drawing.shapes[0]) - 2.0).abs() < 0.01);
        assert_eq!(drawing.left_out, [("SPLINE".to_owned(), 1), ("bulges of LWPOLYLINE".to_owned(), 1)]);
        let block = "0\nSECTION\n2\nBLOCKS\n0\nBLOCK\n2\nB\n0\nLWPOLYLINE\n70\n1\n10\n0\n20\n0\n10\n1\n20\n0\n10\n0\n20\n1\n0\nENDBLK\n0\nENDSEC\n";
        let insert = "0\nINSERT\n2\nB\n10\n5\n20\n5\n41\n2\n42\n3\n50\n90\n";
        let drawing = read_text(&format!("{block}{}", entities(&[insert])), "");
        assert!((area(&drawing.shapes[0]) - 3.0).abs() < 0.02);
        assert!(drawing.shapes[0][0].iter().any(|p| p.distance(DVec2::new(2.0, 5.0)) < 2e-3), "{:?}", drawing.shapes);
        let frame =
            Frame { layer: "", id: "", dpi: 72.0, center: false, origin: DVec2::ZERO, scale: 1.0, pieces: &|_| 8 };
        let (at, problem) = read(b"0\nSECTION\nnonsense\n1\n", &frame).map(|_| ()).expect_err("no group code");
        assert_eq!((at.line, problem.to_string()), (3, "expected a group code, found \"nonsense\"".to_owned()));
    }
}
