//! The branch and bound; see the module's face for the idea and docs/algorithm/clearance.md for the bounds.

use super::convex::{ConvexPair, NearestPair};
use super::part::{Cut, Part, Parts, literal_at};
use super::polish::{Pair, Polish, Side, Steps};
use super::polytope::support;
use super::span::{Span, Stray, least_above_chord};
use super::{Distance, DistanceQuery, LEAST, NearPoint, common, slack};
use crate::math::gjk::{Cores, of_supports};
use crate::math::halt::Halt;
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
    /// Both, where each is one convex primitive: then no part is taken apart, but the time.
    convex: Option<ConvexPair<'a>>,
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
    halt: Option<&'a Halt>,
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
    pub fn new(query: &DistanceQuery<'a>, relative: [Relative; 2], rounding: f64, halt: Option<&'a Halt>) -> Self {
        let models = [query.a.model, query.b.model];
        let scale = models[0].size().max(models[1].size());
        let slack = slack(models, &relative[0], rounding);
        Self {
            models,
            convex: ConvexPair::of(models),
            parts: Vec::new(),
            relative,
            spans: Vec::new(),
            tolerance: query.tolerance.max(LEAST * slack),
            rounding,
            slack,
            scale,
            limit: query.limit,
            halt,
            queue: BoundQueue::new(),
            done: f64::INFINITY,
            best: None,
            upper: f64::INFINITY,
            cells: 0,
        }
    }

    /// The least distance between two times.
    pub fn run(mut self, from: f64, to: f64) -> Distance {
        // At an instant their own proof has not settled it: parts are taken apart.
        self.convex = self.convex.filter(|_| from < to);
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
            // The pair of parts with the nearest points is bounded by their distance: above what is known no bound of all holds.
            debug_assert!(lower <= self.upper, "{lower:e} is no bound of {:e}", self.upper);
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
        let sides = [0, 1].map(|k| Side { model: self.models[k], tokens: &self.parts[k][parts[k]].tokens });
        Polish { sides, at, scale: self.scale, rounding: self.rounding, steps: Steps::ALL }
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
            Cores::Apart { v, a, .. } => ((a, a + v), v),
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
        if let Some(convex) = &self.convex {
            let pair = convex.nearest(self.models, at, self.scale, self.rounding)?.pair;
            if pair.distance < self.upper {
                (self.best, self.upper) = (Some((pair, at.t)), pair.distance);
            }
            return Some(pair);
        }
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
    fn share(&mut self) {
        let Some((pair, t)) = self.best.filter(|_| self.upper > 0.0 && self.upper <= self.tolerance) else { return };
        let at = self.relative[0].at(t);
        if let Some(pair) = common::from_point(self.models, &at, pair.x, self.rounding, self.slack) {
            (self.best, self.upper) = (Some((pair, t)), 0.0);
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
        // Where a corner takes over from a face the rate jumps: false position then hardly moves one end.
        let mut is_slow = false;
        for _ in 0..96 {
            let secant = p - at_p * (q - p) / (at_q - at_p);
            let middle = 0.5 * (p + q);
            let inner = (secant - p) * (secant - q) < 0.0;
            let t = if !is_slow && inner && at_q * way > 0.0 { secant } else { middle };
            let width = (q - p).abs();
            if width * at_p.abs().max(at_q.abs()) <= 1e-3 * self.tolerance || t == p || t == q {
                return;
            }
            let at = self.relative[0].at(t);
            let Some(next) = self.improve([0, 0], &at, pair.x, pair.y) else { return };
            pair = next;
            let s = rate(self, &pair, t);
            if s * way < 0.0 {
                (p, at_p) = (t, s)
            } else {
                (q, at_q) = (t, s)
            }
            is_slow = (q - p).abs() > 0.5 * width;
        }
    }

    /// A bound above which nothing is looked at.
    fn goal(&self) -> f64 {
        self.upper - self.tolerance
    }

    fn is_enough(&self) -> bool {
        self.queue.lowest() >= self.goal() || self.upper == 0.0 || self.is_spent()
    }

    fn is_spent(&self) -> bool {
        self.cells >= self.limit || self.halt.is_some_and(Halt::is_over)
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
        if let Some(pair) = self.convex {
            return self.look_at_convex(&pair, parts, span, bound, &strays);
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
                let along = self.along(v.normalize(), [a, b], span, &strays);
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

    /// Bounds two whole convex primitives over a span: along the direction in which they are nearest in its middle, seen from A, every point
    /// of B is above the chord of its places at the ends less what it strays from that; and the same with both in turn.
    fn look_at_convex(
        &mut self,
        pair: &ConvexPair,
        [a, b]: [u32; 2],
        span: u32,
        least: f64,
        strays: &[Stray; 2],
    ) -> Look {
        let over = &self.spans[span as usize];
        let middle = &over.middle;
        let (points, bound, lost) = match pair.nearest(self.models, middle, self.scale, self.rounding) {
            Some(NearestPair { pair: found, way, .. }) if way != DVec3::ZERO => {
                let seen = middle.b_from_a * way;
                let (mut in_a, mut in_b) = (f64::INFINITY, f64::INFINITY);
                for end in &over.ends {
                    let placed = pair.at(end);
                    in_a = in_a.min(placed.along(way));
                    in_b = in_b.min(placed.along(end.a_vector(seen)));
                }
                // The plane's own direction is fixed in its own frame alone.
                let [of_a, of_b] = [in_a - strays[1].chord, in_b - strays[0].chord];
                let bound = match [0, 1].map(|k| pair.is_half_space(k)) {
                    [true, _] => of_a,
                    [_, true] => of_b,
                    [false, false] => of_a.max(of_b),
                } - self.slack;
                ((found.x, found.y), bound, (found.distance - bound).max(0.0))
            }
            Some(NearestPair { pair: found, .. }) => ((found.x, found.y), 0.0, 0.0),
            None => ((self.parts[0][a].aabb.center(), self.parts[1][b].aabb.center()), 0.0, 0.0),
        };
        let (x, y) = points;
        let mut bound = bound.max(least);
        if 0.0 < bound && bound < self.goal() && over.length() > 0.0 {
            bound = bound.max(self.along_turning(pair, over));
        }
        if bound >= self.goal() {
            self.done = self.done.min(bound);
            return Look::Done;
        }
        Look::Open(Cell { a, b, span, bound, x, y, lost })
    }

    /// Bounds two whole convex primitives over a span by a direction n that turns from that in which they are nearest at its begin to that at
    /// its end. Of any two of their points the way along n has a second derivative of at most
    /// Q = 2|ν|(|v| + ω_A ρ_A + ω_B ρ_B) + ω_A² ρ_A + ω_B² ρ_B, with ν the rate of n and ρ the farthest point of a core from where it turns
    /// about; so what lies between the bodies along n is above the chord between the ends less Q s(1 − s) h²/2, and |n| <= 1. Edges that
    /// cross need it: no fixed direction stays across both.
    fn along_turning(&self, pair: &ConvexPair, over: &Span) -> f64 {
        let nearest = |at: &Instant| pair.nearest(self.models, at, self.scale, self.rounding);
        let [from, to] = &over.ends[..] else { return 0.0 };
        let (Some(p), Some(q)) = (nearest(from), nearest(to)) else { return 0.0 };
        let rate = (to.world_from_a * q.way - from.world_from_a * p.way).length();
        let reaches = [0, 1].map(|k| {
            let (aabb, center) = (&self.parts[k][0].aabb, self.relative[k].center_a());
            ((aabb.center() - center).abs() + aabb.half()).length()
        });
        let h = over.length();
        let (a, b) = self.relative[0].placed();
        let spins = [a, b].map(|placed| placed.motion.spin.length());
        let moved = (a.motion.velocity - b.motion.velocity).length() + spins[0] * reaches[0] + spins[1] * reaches[1];
        let pull = spins[0] * spins[0] * reaches[0] + spins[1] * spins[1] * reaches[1];
        let dip = (2.0 * rate * h * moved + pull * h * h) * (1.0 + 1e-12);
        least_above_chord([p.lower, q.lower], dip) - self.slack
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

    /// A lower bound of the distance along a unit direction from A to B, over a span: what lies between the points that are farthest along
    /// it. Fixed in A's frame, every point of B is above the chord of its places at the ends less what it strays from that; fixed in B's
    /// (both are as `u` of A's frame in the middle of the span), every point of A below. What moves straight on in one of them may stray
    /// in the other.
    fn along(&self, u: DVec3, [a, b]: [Thick; 2], span: u32, strays: &[Stray; 2]) -> f64 {
        let span = &self.spans[span as usize];
        let ends = || span.ends.iter();
        let reach = u.dot(support(a.points, u));
        let lowest = |at: &Instant| u.dot(at.a_point(support(b.points, at.b_from_a * -u)));
        let in_a = ends().map(lowest).fold(f64::INFINITY, f64::min) - reach - strays[1].chord;
        let in_b = if strays[0].chord < strays[1].chord {
            let w = span.middle.b_from_a * u;
            let highest = |at: &Instant| w.dot(at.b_point(support(a.points, at.a_vector(w))));
            w.dot(support(b.points, -w)) - ends().map(highest).fold(f64::NEG_INFINITY, f64::max) - strays[0].chord
        } else {
            f64::NEG_INFINITY
        };
        in_a.max(in_b) - a.radius - b.radius - self.slack
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
                    best = best.max(self.along(u, [p, q], span, strays));
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
        let span = &self.spans[cell.span as usize];
        let (from, to) = (span.from, span.to);
        let middle = 0.5 * (from + to);
        let halves = (from < middle && middle < to).then_some([(from, middle), (middle, to)]);
        let (points, parts) = ([cell.x, cell.y], [cell.a, cell.b]);
        let worst = if self.convex.is_some() {
            [(0.0, Cut::Halves(0)); 2]
        } else {
            [0, 1].map(|k| self.worst(k, parts[k], points[k]))
        };
        let k = usize::from(worst[1].0 > worst[0].0);
        let (violation, cut) = worst[k];
        if let Some(halves) = halves
            && (self.convex.is_some() || cell.lost >= violation.min(self.largest(k, parts[k])))
        {
            for (from, to) in halves {
                self.spans.push(Span::new(&self.relative[0], from, to));
                self.push(cell.a, cell.b, self.spans.len() as u32 - 1, cell.bound);
            }
            return;
        }
        if self.convex.is_some() {
            self.done = self.done.min(cell.bound);
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
