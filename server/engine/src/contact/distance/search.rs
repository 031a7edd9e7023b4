//! The branch and bound; see the module's face for the idea and docs/algorithm/clearance.md for the bounds.

use super::part::{Cut, Part, Parts, literal_at};
use super::polish::{Pair, Polish, Side};
use super::polytope::support;
use super::span::{Span, Stray};
use super::{Distance, DistanceQuery, NearPoint};
use crate::math::gjk::{Cores, of_supports};
use crate::math::{Aabb, BoundQueue};
use crate::motion::{Instant, Relative, Sweep};
use crate::octree::Model;
use crate::solid::Sense;
use crate::solid::local::LiteralId;
use glam::DVec3;

/// Rounds in which a pair of parts takes tangents where its hulls come nearest.
const ROUNDS: usize = 6;
/// Alternatives up to which a part is taken apart into them at any size.
const FEW: usize = 8;
/// Parts below this, relative to the pair's size, are taken apart into however many alternatives they have.
const SMALL: f64 = 1e-3;
/// Relative gap to which the hulls' distance is found.
const EXACT: f64 = 1e-15;
/// Every so many looks the nearest points are looked for, once a few were.
const EVERY: u64 = 8;
/// Steps of one length on the way to a common point, and the next length.
const STEPS: usize = 32;
const SHORTER: f64 = 0.25;
/// Looks at first that each look for the nearest points.
const FIRST: u64 = 24;

/// A pair of parts over a span of time.
#[derive(Clone, Copy, Debug)]
struct Cell {
    a: u32,
    b: u32,
    span: u32,
    /// A lower bound of their distance over the span.
    bound: f64,
    /// Points of the hulls in the middle of the span where these are nearest: A's frame, B's frame.
    x: DVec3,
    y: DVec3,
    /// What of the hulls' distance is lost to time.
    lost: f64,
}

/// Points that hold a part within a radius of their hull.
#[derive(Clone, Copy)]
struct Thick<'p> {
    points: &'p [DVec3],
    radius: f64,
}

/// The search for the distance of one pair.
pub struct Search<'a> {
    models: [&'a Model; 2],
    parts: Vec<Parts<'a>>,
    /// A's points seen from B, and the reverse.
    relative: [Relative; 2],
    spans: Vec<Span>,
    tolerance: f64,
    rounding: f64,
    /// What rounding may take from a bound: of hulls, supports and poses.
    slack: f64,
    scale: f64,
    limit: u64,
    queue: BoundQueue<Cell>,
    /// The least bound of what is done with.
    done: f64,
    best: Option<(Pair, f64)>,
    upper: f64,
    cells: u64,
}

/// What became of a pair of parts.
enum Look {
    /// Nothing of it is nearer than what is known, or nothing is in it.
    Done,
    Open(Cell),
}

impl<'a> Search<'a> {
    /// A search for the distance of two bodies that have points.
    pub fn new(query: &DistanceQuery<'a>, relative: [Relative; 2], rounding: f64) -> Self {
        let models = [query.a.model, query.b.model];
        let scale = models[0].size().max(models[1].size());
        let extent = relative[0].apart()
            + models.iter().map(|m| m.extents[0]).filter(|e| e.is_finite()).fold(scale, |s, e| s + 2.0 * e);
        let slack = 4.0 * rounding + 256.0 * f64::EPSILON * extent;
        Self {
            models,
            parts: Vec::new(),
            relative,
            spans: Vec::new(),
            tolerance: query.tolerance.max(4.0 * slack),
            rounding,
            slack,
            scale,
            limit: query.limit,
            queue: BoundQueue::new(),
            done: f64::INFINITY,
            best: None,
            upper: f64::INFINITY,
            cells: 0,
        }
    }

    /// The least distance between two times.
    pub fn run(mut self, from: f64, to: f64) -> Distance {
        if let Some(boxes) = self.boxes(from, to) {
            for k in 0..2 {
                match Parts::new(&self.models[k].solid, &boxes[k], self.rounding) {
                    Some(parts) => self.parts.push(parts),
                    None => return self.answer(f64::INFINITY, from),
                }
            }
            self.spans.push(Span::new(&self.relative[0], from, to));
            self.first_points(from, to);
            self.push(0, 0, 0, 0.0);
            self.search();
            let lower = self.queue.lowest().min(self.done);
            if lower <= 0.0 {
                self.share();
            }
            let lower = lower.min(self.upper);
            return self.answer(lower, from);
        }
        self.answer(0.0, from)
    }

    /// Finite boxes that hold of both bodies what matters for their distance; `None` where none are known.
    fn boxes(&mut self, from: f64, to: f64) -> Option<[Aabb; 2]> {
        let own = self.models.map(|m| m.bounds.root().aabb);
        let pad = |b: Aabb| b.grown(8.0 * self.rounding);
        let (unbounded, other) = match own.map(|b| b.is_finite()) {
            [true, true] => return Some(own.map(pad)),
            [false, true] => (0, 1),
            [true, false] => (1, 0),
            [false, false] => return None,
        };
        // Seen from the unbounded body: where the other one is, and a point of each.
        let (mover, observer) = self.relative[other].placed();
        let swept = Sweep::new(mover, observer).of_box(&own[other], from, to);
        let reach = self.reach(unbounded, &own[other], from)?;
        let mut boxes = own.map(pad);
        boxes[unbounded] = pad(swept.grown(reach).intersection(&own[unbounded]));
        boxes[unbounded].is_finite().then_some(boxes)
    }

    /// An upper bound of the distance of an unbounded body from points in the other one's box.
    fn reach(&self, unbounded: usize, aabb: &Aabb, from: f64) -> Option<f64> {
        let at = self.relative[0].at(from);
        let other = self.models[1 - unbounded];
        let inside = other.solid.primitives.iter().map(|p| p.frame.point(p.shape.geometry().interior_point()));
        let y = inside.into_iter().find(|x| other.value(*x) <= 0.0).unwrap_or_else(|| aabb.center());
        let model = self.models[unbounded];
        let start = if unbounded == 0 { at.a_point(y) } else { at.b_point(y) };
        let mut x = start;
        for _ in 0..64 {
            let (f, id) = model.deciding(x);
            if f <= 0.0 {
                return Some((x - start).length() + 2.0 * aabb.half().length() + self.scale);
            }
            let (_, g) = literal_at(&model.solid.faces[id.face() as usize], id.sense(), x);
            x -= g * (f + 1e-6 * self.scale);
        }
        None
    }

    /// The answer with a lower bound.
    fn answer(self, lower: f64, from: f64) -> Distance {
        let lower = lower.max(0.0);
        let is_settled = self.upper - lower <= self.tolerance || lower == self.upper;
        let rounding = self.slack;
        let Some((pair, time)) = self.best.filter(|_| self.parts.len() == 2) else {
            let upper = if lower == f64::INFINITY { lower } else { self.upper };
            let (a, b, cells) = (NearPoint::NONE, NearPoint::NONE, self.cells);
            return Distance { lower, upper, time: from, a, b, is_settled: lower == upper, rounding, cells };
        };
        let at = self.relative[0].at(time);
        let polish = self.polish([0, 0], &at);
        let near = |side, x: DVec3, own: DVec3| NearPoint {
            point: self.relative[0].world_point(&at, x),
            faces: polish.faces(side, own),
        };
        let (a, b) = (near(0, pair.x, pair.x), near(1, at.a_point(pair.y), pair.y));
        Distance { lower, upper: self.upper, time, a, b, is_settled, rounding, cells: self.cells }
    }

    fn polish<'s>(&'s self, parts: [u32; 2], at: &'s Instant) -> Polish<'s, 'a> {
        let sides = [0, 1].map(|k| Side {
            parts: &self.parts[k],
            model: self.models[k],
            tokens: &self.parts[k][parts[k]].tokens,
        });
        Polish { sides, at, scale: self.scale, rounding: self.rounding }
    }

    /// Looks for near points where the whole boxes come nearest, at both ends and in the middle.
    fn first_points(&mut self, from: f64, to: f64) {
        let mut times = vec![from, 0.5 * (from + to), to];
        times.dedup();
        for t in times {
            let at = self.relative[0].at(t);
            let (x, y) = self.nearest_of_hulls([0, 0], &at).0;
            self.improve([0, 0], &at, x, at.b_point(y));
        }
        self.refine_time(to - from);
    }

    /// The nearest points of two parts' hulls at an instant, A's frame, and the vector between them, zero where they overlap.
    fn nearest_of_hulls(&self, [a, b]: [u32; 2], at: &Instant) -> ((DVec3, DVec3), DVec3) {
        let (hull_a, hull_b) = (&self.parts[0][a].hull, &self.parts[1][b].hull);
        let middle = at.a_point(self.parts[1][b].aabb.center()) - self.parts[0][a].aabb.center();
        let start = if middle == DVec3::ZERO { DVec3::X } else { middle };
        let seen = |v: DVec3| at.a_point(hull_b.support(at.b_from_a * v));
        match of_supports(|v| hull_a.support(v), seen, start, EXACT) {
            Cores::Apart { v, a } => ((a, a + v), v),
            // A flat simplex may tell any point.
            Cores::Common(x) if hull_a.aabb().contains(x) => ((x, x), DVec3::ZERO),
            Cores::Common(_) | Cores::Open => {
                let x = self.parts[0][a].aabb.center();
                ((x, x), DVec3::ZERO)
            }
        }
    }

    /// Makes two points nearest and keeps them where they are nearer than those that are known.
    fn improve(&mut self, parts: [u32; 2], at: &Instant, x: DVec3, y: DVec3) -> Option<Pair> {
        // A point of both.
        for p in [x, at.a_point(y)] {
            let q = at.b_point(p);
            if self.models[0].value(p) <= -self.rounding && self.models[1].value(q) <= -self.rounding {
                let pair = Pair { x: p, y: q, distance: 0.0 };
                (self.best, self.upper) = (Some((pair, at.t)), 0.0);
                return Some(pair);
            }
        }
        let pair = self.polish(parts, at).run(x, y)?;
        if pair.distance < self.upper {
            (self.best, self.upper) = (Some((pair, at.t)), pair.distance);
        }
        Some(pair)
    }

    /// Looks for a point of both bodies beside points of them that are as near as was asked: of bodies that lie in each other the search
    /// may come to where their surfaces meet.
    ///
    /// It steps against the gradient of the higher f, by ever shorter steps: where both are convex the way to any point of both becomes
    /// shorter by a step that is shorter than that point is deep (N. Z. Shor, Minimization Methods for Non-Differentiable Functions,
    /// Springer 1985, section 2.1).
    fn share(&mut self) {
        let Some((pair, t)) = self.best.filter(|_| self.upper > 0.0 && self.upper <= self.tolerance) else { return };
        let at = self.relative[0].at(t);
        let higher = |x: DVec3| {
            let y = at.b_point(x);
            let [(f, f_id), (g, g_id)] = [self.models[0].deciding(x), self.models[1].deciding(y)];
            let gradient = |k: usize, id: LiteralId, x: DVec3| {
                literal_at(&self.models[k].solid.faces[id.face() as usize], id.sense(), x).1
            };
            if f >= g { (f, gradient(0, f_id, x)) } else { (g, at.a_vector(gradient(1, g_id, y))) }
        };
        let (mut best, mut step) = ((f64::INFINITY, pair.x), self.models[0].size().min(self.models[1].size()));
        while step > self.slack {
            step *= SHORTER;
            let mut x = best.1;
            for _ in 0..STEPS {
                let (f, gradient) = higher(x);
                if f <= -self.rounding {
                    let pair = Pair { x, y: at.b_point(x), distance: 0.0 };
                    (self.best, self.upper) = (Some((pair, t)), 0.0);
                    return;
                }
                if f < best.0 {
                    best = (f, x);
                }
                x -= gradient * step;
            }
        }
    }

    /// Moves the nearest points that are known to the time at which they are nearest: where the distance neither grows nor shrinks, by
    /// bisection and false position on its rate.
    fn refine_time(&mut self, first_step: f64) {
        let (from, to) = (self.spans[0].from, self.spans[0].to);
        let Some((pair, t)) = self.best.filter(|_| from < to && self.upper > 0.0) else { return };
        let rate = |search: &Self, pair: &Pair, t: f64| {
            let at = search.relative[0].at(t);
            let w = at.a_point(pair.y);
            (pair.x - w).normalize_or_zero().dot(at.velocity(w))
        };
        let (mut low, mut pair, mut slope) = (t, pair, rate(self, &pair, t));
        let (mut step, way) = (first_step.max(1e-6), if slope > 0.0 { -1.0 } else { 1.0 });
        // Out, until the rate changes its sign.
        let mut bracket = None;
        for _ in 0..24 {
            let end = if way > 0.0 { to } else { from };
            if low == end || slope * way >= 0.0 || self.upper == 0.0 {
                return;
            }
            let t = (low + way * step).clamp(from, to);
            let at = self.relative[0].at(t);
            let Some(next) = self.improve([0, 0], &at, pair.x, pair.y) else {
                step *= 0.25;
                continue;
            };
            let s = rate(self, &next, t);
            if s * way >= 0.0 || next.distance > pair.distance {
                bracket = Some(((low, slope), (t, s)));
                break;
            }
            (low, pair, slope, step) = (t, next, s, 2.0 * step);
        }
        let Some(((mut p, mut at_p), (mut q, mut at_q))) = bracket else { return };
        for i in 0..48 {
            let secant = p - at_p * (q - p) / (at_q - at_p);
            let middle = 0.5 * (p + q);
            let inner = (secant - p) * (secant - q) < 0.0;
            let t = if i % 3 != 2 && inner && at_q * way > 0.0 { secant } else { middle };
            if (q - p).abs() * at_p.abs().max(at_q.abs()) <= 1e-3 * self.tolerance || t == p || t == q {
                return;
            }
            let at = self.relative[0].at(t);
            let Some(next) = self.improve([0, 0], &at, pair.x, pair.y) else { return };
            pair = next;
            let s = rate(self, &pair, t);
            if s * way < 0.0 { (p, at_p) = (t, s) } else { (q, at_q) = (t, s) }
        }
    }

    /// A bound above which nothing is looked at.
    fn goal(&self) -> f64 {
        self.upper - self.tolerance
    }

    fn is_enough(&self) -> bool {
        self.queue.lowest() >= self.goal() || self.upper == 0.0 || self.cells >= self.limit
    }

    fn search(&mut self) {
        let mut looks = 0u64;
        while !self.is_enough() {
            let Some((_, cell)) = self.queue.pop() else { return };
            looks += 1;
            if looks <= FIRST || looks.is_multiple_of(EVERY) {
                let at = self.spans[cell.span as usize].middle;
                let before = self.upper;
                self.improve([cell.a, cell.b], &at, cell.x, cell.y);
                if self.upper < before {
                    let span = &self.spans[cell.span as usize];
                    self.refine_time(0.25 * span.length());
                }
            }
            if cell.bound < self.goal() {
                self.branch(&cell);
            } else {
                self.done = self.done.min(cell.bound);
            }
        }
    }

    /// Looks at a pair of parts and puts it to the others if it is open.
    fn push(&mut self, a: u32, b: u32, span: u32, least: f64) {
        self.cells += 1;
        if let Look::Open(cell) = self.look([a, b], span, least) {
            self.queue.push(cell.bound, cell);
        }
    }

    /// Bounds a pair of parts over a span.
    fn look(&mut self, parts: [u32; 2], span: u32, least: f64) -> Look {
        let strays = [0, 1].map(|k| {
            let aabb = self.parts[k][parts[k]].aabb;
            self.spans[span as usize].stray(&self.relative[k], &aabb)
        });
        let mut bound = least.max(self.by_boxes(parts, span, &strays));
        if bound >= self.goal() {
            self.done = self.done.min(bound);
            return Look::Done;
        }
        // Tangents that other pairs have asked for may have left nothing of it.
        if (0..2).any(|k| self.parts[k][parts[k]].hull.is_empty()) {
            return Look::Done;
        }
        bound = bound.max(self.by_round(parts, span, &strays));
        let (mut near, mut lost) = ((DVec3::ZERO, DVec3::ZERO), 0.0);
        for _ in 0..ROUNDS {
            if bound >= self.goal() {
                self.done = self.done.min(bound);
                return Look::Done;
            }
            if (0..2).any(|k| self.parts[k][parts[k]].hull.is_empty()) {
                return Look::Done;
            }
            let at = self.spans[span as usize].middle;
            let (points, v) = self.nearest_of_hulls(parts, &at);
            near = points;
            if v == DVec3::ZERO {
                lost = 0.5 * (strays[0].middle + strays[1].middle);
            } else {
                let [a, b] = [0, 1].map(|k| Thick { points: &self.parts[k][parts[k]].hull.corners, radius: 0.0 });
                let along = self.along(v.normalize(), [a, b], span, &strays[1]);
                lost = (v.length() - along - self.slack).max(0.0);
                bound = bound.max(along);
            }
            if !self.tighten(parts, [near.0, at.b_point(near.1)]) {
                break;
            }
        }
        if bound >= self.goal() {
            self.done = self.done.min(bound);
            return Look::Done;
        }
        let at = self.spans[span as usize].middle;
        let [a, b] = parts;
        Look::Open(Cell { a, b, span, bound, x: near.0, y: at.b_point(near.1), lost })
    }

    /// Takes the tangents of convex faces at the points where two hulls are nearest. False where nothing changes.
    fn tighten(&mut self, parts: [u32; 2], points: [DVec3; 2]) -> bool {
        let mut changed = false;
        let least = (0.02 * self.tolerance).max(4.0 * self.rounding);
        for k in 0..2 {
            let own = &self.parts[k];
            let part = &own[parts[k]];
            let outside = |id: &&LiteralId| {
                let face = &own.solid.faces[id.face() as usize];
                id.sense() == Sense::Positive && face.is_convex() && face.value(points[k]) > least
            };
            let ids: Vec<LiteralId> = part.literals.iter().filter(outside).copied().collect();
            for id in ids {
                changed |= self.parts[k].refine(parts[k], id, points[k]);
            }
        }
        changed
    }

    /// By the balls around two parts' boxes.
    fn by_boxes(&self, [a, b]: [u32; 2], span: u32, strays: &[Stray; 2]) -> f64 {
        let (box_a, box_b) = (&self.parts[0][a].aabb, &self.parts[1][b].aabb);
        let between = self.spans[span as usize].middle.a_point(box_b.center()) - box_a.center();
        between.length() - box_a.half().length() - box_b.half().length() - strays[1].middle - self.slack
    }

    /// A lower bound of the distance along a unit direction of A's frame from A to B, over a span: what lies between the points that are
    /// farthest along it. Along it every point of B is above the chord of its places at the ends less what it strays from that.
    fn along(&self, u: DVec3, [a, b]: [Thick; 2], span: u32, stray: &Stray) -> f64 {
        let reach = u.dot(support(a.points, u));
        let lowest = |at: &Instant| u.dot(at.a_point(support(b.points, at.b_from_a * -u)));
        let low = self.spans[span as usize].ends.iter().map(lowest).fold(f64::INFINITY, f64::min);
        low - reach - a.radius - b.radius - stray.chord - self.slack
    }

    /// The best bound that round faces give.
    fn by_round(&self, [a, b]: [u32; 2], span: u32, strays: &[Stray; 2]) -> f64 {
        let (part_a, part_b) = (&self.parts[0][a], &self.parts[1][b]);
        let mut best = f64::NEG_INFINITY;
        let at = &self.spans[span as usize].middle;
        for (i, p) in thick(part_a).enumerate() {
            for (j, q) in thick(part_b).enumerate() {
                if i + j == 0 {
                    continue;
                }
                let middle = at.a_point(q.points[0]) - p.points[0];
                let start = if middle == DVec3::ZERO { DVec3::X } else { middle };
                let seen = |v: DVec3| at.a_point(support(q.points, at.b_from_a * v));
                if let Cores::Apart { v, .. } = of_supports(|v| support(p.points, v), seen, start, EXACT)
                    && let Some(u) = v.try_normalize()
                {
                    best = best.max(self.along(u, [p, q], span, &strays[1]));
                }
            }
        }
        for k in 0..2 {
            let (own, other) = if k == 0 { (part_a, part_b) } else { (part_b, part_a) };
            for (i, p) in thick(own).enumerate() {
                for id in &other.literals {
                    best = best.max(self.off_face(k, p, i > 0, *id, span, &strays[k]));
                }
            }
        }
        best
    }

    /// A lower bound of the distance by one literal of the other body, which is nowhere farther than the distance from what satisfies it:
    /// what it is at least at the points that hold a part of body k, less their radius.
    fn off_face(&self, k: usize, p: Thick, is_spine: bool, id: LiteralId, span: u32, stray: &Stray) -> f64 {
        let face = &self.parts[1 - k].solid.faces[id.face() as usize];
        let span = &self.spans[span as usize];
        let seen = |at: &Instant, x: DVec3| if k == 0 { at.b_point(x) } else { at.a_point(x) };
        let is_concave = id.sense() == Sense::Negative && face.is_convex();
        let low = if is_concave {
            let each = span.ends.iter().flat_map(|at| p.points.iter().map(move |x| -face.value(seen(at, *x))));
            each.fold(f64::INFINITY, f64::min) - stray.chord
        } else if !is_spine {
            // Of hulls the directions tell as much.
            return f64::NEG_INFINITY;
        } else if face.is_convex() {
            let each = p.points.iter().map(|x| seen(&span.middle, *x)).map(|x| (face.value(x), x));
            let Some((_, x)) = each.min_by(|p, q| p.0.total_cmp(&q.0)) else { return f64::NEG_INFINITY };
            let (value, g) = literal_at(face, id.sense(), x);
            let tangent =
                |at: &Instant| p.points.iter().map(|y| value + g.dot(seen(at, *y) - x)).fold(f64::INFINITY, f64::min);
            span.ends.iter().map(tangent).fold(f64::INFINITY, f64::min) - stray.chord
        } else {
            let middle = Aabb::of_points(p.points.iter().copied()).center();
            let far = p.points.iter().map(|x| (*x - middle).length()).fold(0.0, f64::max);
            literal_at(face, id.sense(), seen(&span.middle, middle)).0 - far - stray.middle
        };
        low - p.radius - self.slack
    }

    /// Takes a pair of parts apart where that gains most: a part that does not hold the nearest point of its hull, or the span.
    fn branch(&mut self, cell: &Cell) {
        let (points, parts) = ([cell.x, cell.y], [cell.a, cell.b]);
        let worst = [0, 1].map(|k| self.worst(k, parts[k], points[k]));
        let k = usize::from(worst[1].0 > worst[0].0);
        let (violation, cut) = worst[k];
        let span = &self.spans[cell.span as usize];
        let (from, to) = (span.from, span.to);
        let middle = 0.5 * (from + to);
        if cell.lost >= violation.min(self.largest(k, parts[k])) && from < middle && middle < to {
            for (from, to) in [(from, middle), (middle, to)] {
                self.spans.push(Span::new(&self.relative[0], from, to));
                self.push(cell.a, cell.b, self.spans.len() as u32 - 1, cell.bound);
            }
            return;
        }
        let (k, cut) = if violation > 0.0 { (k, cut) } else { self.larger(parts) };
        if self.parts[k][parts[k]].aabb.half().max_element() <= 4.0 * f64::EPSILON * self.scale {
            self.done = self.done.min(cell.bound);
            return;
        }
        for child in self.parts[k].cut(parts[k], cut) {
            let [a, b] = if k == 0 { [child, cell.b] } else { [cell.a, child] };
            self.push(a, b, cell.span, cell.bound);
        }
    }

    fn largest(&self, k: usize, part: u32) -> f64 {
        self.parts[k][part].aabb.half().max_element()
    }

    /// The larger of two parts, to be halved.
    fn larger(&self, parts: [u32; 2]) -> (usize, Cut) {
        let k = usize::from(self.largest(1, parts[1]) > self.largest(0, parts[0]));
        (k, Cut::Halves(self.parts[k][parts[k]].aabb.half().max_position()))
    }

    /// What of a part is violated most at a point, by how much (a length; 0 for nothing), and how to take it apart for that.
    fn worst(&self, k: usize, part: u32, x: DVec3) -> (f64, Cut) {
        let (own, part) = (&self.parts[k], &self.parts[k][part]);
        let half = part.aabb.half();
        let mut worst = (0.0, Cut::Halves(half.max_position()));
        for id in &part.literals {
            let face = &own.solid.faces[id.face() as usize];
            let (value, _) = literal_at(face, id.sense(), x);
            if value > worst.0 {
                // A tangent cuts a hull only so often.
                let axis = face.developable().unwrap_or(DVec3::ZERO);
                let across = (DVec3::ONE - axis * axis).max(DVec3::ZERO) * half * half;
                worst = (value, Cut::Halves(across.max_position()));
            }
        }
        for group in 0..part.groups.len() {
            let value = own.group_value(part, group, x).unwrap_or(f64::INFINITY);
            if value > worst.0 {
                let few = own.alternatives(part, group).is_some_and(|n| n <= FEW)
                    || half.max_element() < SMALL * self.scale && own.alternatives(part, group).is_some();
                let cut = if few { Cut::Alternatives(group) } else { Cut::Halves(half.max_position()) };
                worst = (value, cut);
            }
        }
        worst
    }
}

/// What holds a part: its hull, then its spines.
fn thick(part: &Part) -> impl Iterator<Item = Thick<'_>> {
    let spines = part.spines.iter().map(|s| Thick { points: &s.points, radius: s.radius });
    std::iter::once(Thick { points: &part.hull.corners, radius: 0.0 }).chain(spines)
}
