//! A slow, independent answer to "when do two moving CSG solids first touch?"
//!
//! Idea: time is halved, space is cut into boxes carried by a. A box is dropped for a span of time when a's or b's f at
//! its centre exceeds what the box's radius and the fastest relative motion allow (f is 1-Lipschitz). The earliest span
//! in which boxes of the smallest size survive is where the contact equations are solved, for every small subset of the
//! literals that can decide f there. Nothing is linearised, cached or pruned by bounds of the tree; f itself is
//! evaluated by code of its own (`field`), from the tree and the faces alone.
//!
//! Promise: nothing deeper than 0 exists before `lower` (up to rounding); at `time` the surfaces meet and shortly after
//! a point of depth `resolution` exists in both. Between `lower` and `time` it is as good as its local solves, which
//! start in every surviving box. It is no server: a query takes milliseconds to seconds.

pub mod field;
pub mod linear;
pub mod solve;

use contactd::solid::Solid;
use contactd_proto::{Motion, Pose};
use field::Field;
use glam::DVec3;
use solve::{Frame, Pair, Root, Row, Unknown};
use std::collections::HashMap;

/// A solid under way: `place` puts the model in the object's frame, `motion` moves that frame.
#[derive(Clone, Copy)]
pub struct Moving<'a> {
    /// The solid, in the model's frame.
    pub solid: &'a Solid,
    /// The model in the object's frame.
    pub place: Pose,
    /// The object's frame over the step.
    pub motion: Motion,
}

/// What became of the pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// They meet.
    Contact,
    /// They don't get deeper than the resolution.
    Clear,
    /// Deeper than twice the resolution at the start.
    Overlap,
}

/// The reference's answer; world frame, normal from a to b.
#[derive(Clone, Debug)]
pub struct Truth {
    /// What became of the pair.
    pub verdict: Verdict,
    /// First touch (contact), 0 (overlap), 1 (clear).
    pub time: f64,
    /// Proven: no common point before it, however shallow.
    pub lower: f64,
    /// The point of depth `resolution` exists then.
    pub upper: f64,
    /// Contact point, or the deepest found (overlap).
    pub point: DVec3,
    /// Unit normal from a to b.
    pub normal: DVec3,
    /// Active surfaces on a and on b: 1 face, 2 edge, 3 or more vertex.
    pub active: (usize, usize),
    /// max(f_A, f_B) at `point` at `time`: 0 at a contact, negative in overlap.
    pub value: f64,
    /// An active surface belongs to a subtracted primitive.
    pub on_subtracted: bool,
    /// time and upper differ as the speed says: no grazing.
    pub regular: bool,
    /// Boxes examined.
    pub boxes: u64,
}

/// How hard to look.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Smallest box radius, as a fraction of the smaller solid's radius.
    pub finest: f64,
    /// Boxes that may survive in a span before it is not cut further.
    pub crowd: usize,
    /// Boxes examined in all before the proof stops getting finer.
    pub budget: u64,
}

impl Effort {
    /// Brackets of 1e-4 sizes; up to seconds.
    pub const THOROUGH: Self = Self { finest: 1e-4, crowd: 60_000, budget: 20_000_000 };
    /// Brackets of 1e-2 sizes, for properties over many scenes; milliseconds.
    pub const QUICK: Self = Self { finest: 4e-3, crowd: 10_000, budget: 2_000_000 };
}

#[derive(Clone, Copy)]
struct Cell {
    center: DVec3,
    half: f64,
}

impl Cell {
    fn radius(&self) -> f64 {
        self.half * 3f64.sqrt()
    }
    fn children(&self) -> [Cell; 8] {
        let h = self.half / 2.0;
        std::array::from_fn(|i| {
            let s = |bit: usize| if i >> bit & 1 == 0 { -h } else { h };
            Cell { center: self.center + DVec3::new(s(0), s(1), s(2)), half: h }
        })
    }
}

/// The earliest contact of `a` and `b`; `resolution` is the depth below which nothing counts.
pub fn earliest_contact(a: Moving, b: Moving, resolution: f64, effort: Effort) -> Truth {
    let (fa, fb) = (Field::new(a.solid, &a.place), Field::new(b.solid, &b.place));
    let size = fa.radius.min(fb.radius);
    // The boxes are carried by the smaller solid.
    let swapped = fa.radius > fb.radius;
    let pair = if swapped {
        Pair { a: fb, b: fa, motions: [b.motion, a.motion] }
    } else {
        Pair { a: fa, b: fb, motions: [a.motion, b.motion] }
    };
    let mut search = Search {
        pair: &pair,
        size,
        finest: effort.finest * size,
        crowd: effort.crowd,
        budget: effort.budget,
        delta: resolution,
        boxes: 0,
        first_doubt: 1.0,
        best: None,
        starts: 0,
        tried: HashMap::new(),
    };
    let mut truth = if size > 0.0 { search.run() } else { search.truth() };
    if swapped {
        truth.normal = -truth.normal;
        truth.active = (truth.active.1, truth.active.0);
    }
    truth
}

/// The deepest common point at time `t`: (its world position, max(f_A, f_B) there). Positive when they are apart: then
/// it is half a lower bound of the distance. Found by best-first subdivision and a local solve.
pub fn deepest(a: Moving, b: Moving, t: f64) -> (DVec3, f64) {
    let pair =
        Pair { a: Field::new(a.solid, &a.place), b: Field::new(b.solid, &b.place), motions: [a.motion, b.motion] };
    let f = pair.at(t);
    let (x, value) = deepest_point(&pair, &f);
    (f.turn_a * x + pair.motions[0].start.position + pair.motions[0].velocity * t, value)
}

struct Candidate {
    root: Root,
    upper: f64,
    rows: Vec<Row>,
}

struct Search<'a> {
    pair: &'a Pair,
    size: f64,
    finest: f64,
    crowd: usize,
    budget: u64,
    delta: f64,
    boxes: u64,
    first_doubt: f64,
    best: Option<Candidate>,
    starts: u64,
    tried: HashMap<(Vec<Row>, [i64; 4]), u8>,
}

impl Search<'_> {
    fn run(&mut self) -> Truth {
        let root = Cell { center: self.pair.a.center, half: self.pair.a.radius };
        let f = self.pair.at(0.0);
        let near_at_start = self.survivors(&[root], &f, 0.0, self.finest.max(1e-3 * self.size));
        if !near_at_start.is_empty() {
            let (x, value) = deepest_point(self.pair, &f);
            if value < -2.0 * self.delta {
                return self.overlap(&f, x, value);
            }
            if value <= -self.delta {
                self.delta *= 2.0;
            }
        }
        self.march(0.0, 1.0, &[root]);
        self.truth()
    }

    /// Halves time, earlier half first, and keeps the boxes that may hold a common point in the span.
    fn march(&mut self, t0: f64, t1: f64, cells: &[Cell]) {
        if self.best.as_ref().is_some_and(|b| t0 >= b.root.t) {
            return;
        }
        let (tm, h) = (0.5 * (t0 + t1), 0.5 * (t1 - t0));
        let f = self.pair.at(tm);
        let kept = self.survivors(cells, &f, h, self.finest);
        if kept.is_empty() {
            return;
        }
        let slowest_fine = kept.iter().all(|c| self.pair.speed(&f, c.center, c.radius(), h) * h <= 1.01 * self.finest);
        if slowest_fine || kept.len() > self.crowd || self.boxes > self.budget {
            self.first_doubt = self.first_doubt.min(t0);
            self.solve_around(&f, h, &kept);
            return;
        }
        self.march(t0, tm, &kept);
        self.march(tm, t1, &kept);
    }

    /// Boxes that may meet both solids while |t − f.t| <= h, cut down to about the length moved in that time.
    fn survivors(&mut self, cells: &[Cell], f: &Frame, h: f64, finest: f64) -> Vec<Cell> {
        let mut stack = cells.to_vec();
        let mut kept = vec![];
        while let Some(c) = stack.pop() {
            self.boxes += 1;
            let r = c.radius();
            if self.pair.a.value(c.center) > r {
                continue;
            }
            let travel = self.pair.speed(f, c.center, r, h) * h;
            if self.pair.b.value(f.to_b(c.center)) > r + travel {
                continue;
            }
            if r > travel.max(finest) && stack.len() + kept.len() < 2 * self.crowd {
                stack.extend(c.children());
            } else {
                kept.push(c);
            }
        }
        kept
    }

    /// Solves the contact equations around the surviving boxes, the deepest first.
    fn solve_around(&mut self, f: &Frame, h: f64, cells: &[Cell]) {
        let mut order: Vec<(f64, Cell)> =
            cells.iter().map(|c| (self.pair.value(f, c.center) - c.radius(), *c)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        // The deepest, and a spread of the others; fewer once a long trough has had its share.
        let (deepest, others) = if self.starts < 2000 { (50, 150) } else { (6, 12) };
        let stride = (order.len() / others).max(1);
        let starts = order.iter().take(deepest).chain(order.iter().skip(deepest).step_by(stride));
        for (_, cell) in starts {
            self.starts += 1;
            let r = cell.radius();
            let v = self.pair.speed(f, cell.center, r, h);
            if r + v * h > 0.1 * self.size {
                // Out of budget with boxes too large to say which literals count: `lower` tells.
                continue;
            }
            self.solve_from(f, cell.center, (r + v * h).max(8e-3 * self.size), v);
        }
    }

    fn solve_from(&mut self, f: &Frame, x: DVec3, reach: f64, speed: f64) {
        if speed <= 0.0 {
            return;
        }
        // Starts this close together in space and time lead to the same solution: two of them will do.
        let bucket = (x / (0.05 * self.size)).extend(f.t * 64.0).to_array().map(|v| v.floor() as i64);
        for rows in candidate_rows(self.pair, f, x, reach) {
            let attempts = self.tried.entry((rows.clone(), bucket)).or_insert(0);
            if *attempts >= 2 {
                continue;
            }
            *attempts += 1;
            if let Some(candidate) = self.verified(&rows, x, f.t, speed, reach) {
                self.tried.insert((rows, bucket), 2);
                if self.best.as_ref().is_none_or(|b| candidate.root.t < b.root.t) {
                    self.best = Some(candidate);
                }
            }
        }
    }

    /// A contact of these rows that the whole of both trees confirms, at touch and at depth delta.
    /// It may lie some hundredths of the size away: along a shallow trough the equations lead far.
    fn verified(&self, rows: &[Row], x: DVec3, t: f64, speed: f64, reach: f64) -> Option<Candidate> {
        let extent = self.pair.a.radius + self.pair.b.radius;
        let slack = 1e-10 * self.size + 1e-13 * extent;
        let scales = |near: f64| solve::Scales { size: self.size, speed, near };
        let touch = solve::solve(self.pair, rows, (x, t), Unknown::Time { level: 0.0 }, scales(reach))?;
        if !(-1e-3..=1.0).contains(&touch.t) || self.pair.value(&self.pair.at(touch.t), touch.x) > slack {
            return None;
        }
        let deep = Unknown::Time { level: -self.delta };
        let deep = solve::solve(self.pair, rows, (touch.x, touch.t), deep, scales(self.size))?;
        let confirmed =
            self.pair.value(&self.pair.at(deep.t), deep.x) <= -self.delta + 1e-3 * self.delta + 1e-14 * extent;
        // A body on its way out reaches depth before touch.
        let entering = deep.t >= touch.t - 1e-14;
        (confirmed && entering && (0.0..=1.0).contains(&deep.t)).then(|| Candidate {
            upper: deep.t,
            root: touch,
            rows: rows.to_vec(),
        })
    }

    fn truth(&self) -> Truth {
        let Some(best) = &self.best else {
            return Truth {
                verdict: Verdict::Clear,
                time: 1.0,
                lower: self.first_doubt,
                upper: 1.0,
                point: DVec3::ZERO,
                normal: DVec3::ZERO,
                active: (0, 0),
                value: f64::INFINITY,
                on_subtracted: false,
                regular: true,
                boxes: self.boxes,
            };
        };
        let root = &best.root;
        let f = self.pair.at(root.t.max(0.0));
        let literals = best.rows.iter().zip(&root.lambda).filter(|(r, l)| match r {
            Row::A(_) | Row::B(_) => **l > 1e-8,
            _ => true,
        });
        let (mut active, mut on_subtracted) = ((0, 0), false);
        for (row, _) in literals {
            let (count, field) = if row.of_a() { (&mut active.0, &self.pair.a) } else { (&mut active.1, &self.pair.b) };
            match *row {
                Row::A(i) | Row::B(i) => {
                    *count += 1;
                    on_subtracted |= field.literals[i as usize].sign < 0.0;
                }
                _ => *count = 3,
            }
        }
        let speed = self.pair.speed(&f, root.x, 0.0, 0.0);
        Truth {
            verdict: Verdict::Contact,
            time: root.t.max(0.0),
            lower: self.first_doubt.min(root.t.max(0.0)),
            upper: best.upper,
            point: world(self.pair, &f, root.x),
            normal: (f.turn_a * root.push).normalize_or_zero(),
            active,
            value: self.pair.value(&f, root.x),
            on_subtracted,
            regular: (best.upper - root.t) * speed < 1e3 * self.delta,
            boxes: self.boxes,
        }
    }

    fn overlap(&self, f: &Frame, x: DVec3, value: f64) -> Truth {
        Truth {
            verdict: Verdict::Overlap,
            time: 0.0,
            lower: 0.0,
            upper: 0.0,
            point: world(self.pair, f, x),
            normal: DVec3::ZERO,
            active: (0, 0),
            value,
            on_subtracted: false,
            regular: true,
            boxes: self.boxes,
        }
    }
}

fn world(pair: &Pair, f: &Frame, x: DVec3) -> DVec3 {
    let m = &pair.motions[0];
    f.turn_a * x + m.start.position + m.velocity * f.t
}

/// Most rows of two clauses that are combined (a smaller reach leaves fewer).
const ROWS: usize = 10;

/// Every set of two to four rows, with some of each solid, that the clauses near `x` allow; apexes within reach too.
fn candidate_rows(pair: &Pair, f: &Frame, x: DVec3, reach: f64) -> Vec<Vec<Row>> {
    let y = f.to_b(x);
    let mut all: Vec<Vec<Row>> = vec![];
    let clauses_a = pair.a.clauses(x, reach, 24);
    let clauses_b = pair.b.clauses(y, reach, 24);
    for ca in &clauses_a {
        for cb in &clauses_b {
            let rows: Vec<Row> =
                ca.iter().map(|i| Row::A(*i)).chain(cb.iter().map(|i| Row::B(*i))).take(ROWS).collect();
            let n = rows.len();
            for mask in 1u32..1 << n {
                if !(2..=4).contains(&mask.count_ones()) {
                    continue;
                }
                let set: Vec<Row> = (0..n).filter(|i| mask >> i & 1 == 1).map(|i| rows[i]).collect();
                if set.iter().any(|r| r.of_a()) && set.iter().any(|r| !r.of_a()) {
                    all.push(set);
                }
            }
            // An apex against one face.
            for r in &rows {
                let (field, p, i) = match *r {
                    Row::A(i) => (&pair.a, x, i),
                    Row::B(i) => (&pair.b, y, i),
                    _ => continue,
                };
                let Some((apex, ..)) = field.literals[i as usize].apex() else { continue };
                if apex.distance(p) <= 4.0 * reach {
                    let apex = if r.of_a() { Row::ApexA(i) } else { Row::ApexB(i) };
                    all.extend(rows.iter().filter(|o| o.of_a() != r.of_a()).map(|o| vec![apex, *o]));
                }
            }
        }
    }
    all.sort_by(|a, b| a.len().cmp(&b.len()).then(a.cmp(b)));
    all.dedup();
    all
}

/// min over x of max(f_A, f_B) at one time: best-first subdivision, then the deepest point's equations.
fn deepest_point(pair: &Pair, f: &Frame) -> (DVec3, f64) {
    let size = pair.a.radius.min(pair.b.radius);
    let mut open = vec![Cell { center: pair.a.center, half: pair.a.radius }];
    let mut best = (pair.a.center, pair.value(f, pair.a.center));
    // Breadth first with a beam: each level keeps what may still beat the best value.
    while !open.is_empty() && open[0].radius() > 1e-3 * size {
        let mut next: Vec<(f64, Cell)> = vec![];
        for child in open.iter().flat_map(Cell::children) {
            let v = pair.value(f, child.center);
            if v < best.1 {
                best = (child.center, v);
            }
            next.push((v - child.radius(), child));
        }
        next.retain(|(bound, _)| *bound < best.1);
        next.sort_by(|a, b| a.0.total_cmp(&b.0));
        next.truncate(20_000);
        open = next.into_iter().map(|(_, c)| c).collect();
    }
    let mut starts: Vec<(f64, DVec3)> = open.iter().map(|c| (pair.value(f, c.center), c.center)).collect();
    starts.push((best.1, best.0));
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let scales = solve::Scales { size, speed: size, near: size };
    let mut tried: HashMap<Vec<Row>, u32> = HashMap::new();
    for (_, x) in starts.iter().take(40) {
        for rows in candidate_rows(pair, f, *x, 4e-3 * size) {
            let attempts = tried.entry(rows.clone()).or_insert(0);
            *attempts += 1;
            if *attempts > 3 {
                continue;
            }
            if let Some(root) = solve::solve(pair, &rows, (*x, f.t), Unknown::Level { t: f.t }, scales) {
                let v = pair.value(f, root.x);
                if v < best.1 {
                    best = (root.x, v);
                }
            }
        }
    }
    best
}
