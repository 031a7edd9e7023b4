//! The branch and bound over pairs of places and spans of time; see the module's face.

use super::body::{ALL, Body, Cover, Place, Seen, both_seen};
use super::curved::{self, Sizes};
use super::inside;
use super::near::{Near, between, gap, nearest, only};
use super::triangles;
use crate::contact::distance::polish::Pair;
use crate::contact::distance::span::{Pace, Span, least_above_chord};
use crate::contact::distance::{Distance, DistanceQuery, LEAST, NearPoint, slack};
use crate::math::BoundQueue;
use crate::math::halt::Halt;
use crate::motion::{Instant, Relative};
use glam::DVec3;

/// What of the tolerance the search leaves; the rest is for points that are moved inwards.
const LEFT: f64 = 0.5;
/// Pairs that are looked at for a point of both once points are as near as was asked.
const FOR_SHARED: u32 = 64;
/// Points, the best first, that are tried to be proven inside.
const TRIED: usize = 16;
/// How exact nearest points are found: what of the tolerance, and how many of rounding's lengths.
const EXACT: f64 = 0.01;
const ROUNDED: f64 = 4.0;
/// How far outside of a body a point of both may be, in rounding's lengths, and how often one is looked for again.
const PROVEN: f64 = 32.0;
const AGAIN: usize = 3;
/// Steps in which the time of the least distance of two facets is found.
const TIMES: usize = 40;

/// A span of time with both bodies at its ends and in its middle.
struct Times {
    span: Span,
    middle: [Seen; 2],
    ends: Vec<[Seen; 2]>,
    halves: Option<[u32; 2]>,
}

/// A pair of places over a span of time.
#[derive(Clone, Copy)]
struct Cell {
    places: [Place; 2],
    span: u32,
    /// A lower bound of their distance over the span.
    bound: f64,
    /// A direction along which they were apart, in the middle of a span, A's axes.
    way: DVec3,
    /// What of their distance is lost to time.
    lost: f64,
}

/// Points of both surfaces, A's frame, at an instant, and where they were found.
#[derive(Clone, Copy)]
struct Found {
    points: [DVec3; 2],
    places: [Place; 2],
    distance: f64,
    t: f64,
}

/// How two bodies stand whose surfaces do not meet.
enum Standing {
    Apart,
    /// One within the other: a point of both.
    Within(Pair),
    Open,
}

/// The search for the distance of one pair.
pub struct Search<'a> {
    bodies: [Body<'a>; 2],
    relative: [Relative; 2],
    spans: Vec<Times>,
    tolerance: f64,
    rounding: f64,
    /// What rounding may take from a bound, a length: of poses, supports and facets.
    slack: f64,
    scale: f64,
    limit: u64,
    halt: Option<&'a Halt>,
    queue: BoundQueue<Cell>,
    /// The least bound of what is done with.
    done: f64,
    /// What was found, each nearer than the one before.
    found: Vec<Found>,
    shared: Option<(Pair, f64)>,
    cells: u64,
    /// No points of the bodies are nearer to each other: a length, as far as a run has come.
    lower: f64,
}

impl<'a> Search<'a> {
    /// A search for the distance of two bodies, of which one is a mesh and the other a mesh or convex; `None` for other pairs. `relative`
    /// has each seen from the other one.
    pub fn new(
        query: &DistanceQuery<'a>,
        relative: &[Relative; 2],
        rounding: f64,
        halt: Option<&'a Halt>,
    ) -> Option<Self> {
        let models = [query.a.model, query.b.model];
        let bodies = Body::both(models, relative)?;
        let slack = slack(models, &relative[0], rounding) + bodies[0].tolerance + bodies[1].tolerance;
        Some(Self {
            bodies,
            relative: *relative,
            spans: Vec::new(),
            tolerance: query.tolerance.max(LEAST * slack),
            rounding,
            slack,
            scale: models[0].size().max(models[1].size()),
            limit: query.limit,
            halt,
            queue: BoundQueue::new(),
            done: f64::INFINITY,
            found: Vec::new(),
            shared: None,
            cells: 0,
            lower: 0.0,
        })
    }

    /// What a run that has told nothing has looked at, and proven of the distance from below.
    pub fn left(&self) -> (u64, f64) {
        (self.cells, self.lower)
    }

    /// The least distance between two times; `None` where it is left to the search by parts.
    pub fn run(&mut self, from: f64, to: f64) -> Option<Distance> {
        self.add_span(from, to);
        let covers = self.covers([ALL; 2]);
        let start = self.relative[0].at(from);
        let seen = both_seen(&self.bodies, &start);
        // What a direction keeps apart is not within the other.
        let is_clear = gap(&seen, &covers, between(&seen, &covers)) > self.slack;
        let standing = if is_clear { Standing::Apart } else { self.standing(&start) };
        if let Standing::Within(pair) = standing {
            self.shared = Some((pair, from));
            return self.answer(0.0);
        }
        self.push([ALL; 2], 0, between(&seen, &covers), f64::NEG_INFINITY);
        self.search();
        let lower = self.queue.lowest().min(self.done);
        if lower > 0.0 && matches!(standing, Standing::Open) {
            return None;
        }
        self.lower = lower.max(0.0);
        self.answer(lower.max(0.0))
    }

    fn covers(&self, places: [Place; 2]) -> [Cover<'a>; 2] {
        [0, 1].map(|k| self.bodies[k].cover(places[k]))
    }

    fn add_span(&mut self, from: f64, to: f64) -> u32 {
        let span = Span::new(&self.relative[0], from, to);
        let seen = |at: &Instant| both_seen(&self.bodies, at);
        let times =
            Times { middle: seen(&span.middle), ends: span.ends.iter().map(seen).collect(), span, halves: None };
        self.spans.push(times);
        self.spans.len() as u32 - 1
    }

    /// The halves of a span; `None` of one that has none.
    fn halves(&mut self, span: u32) -> Option<[u32; 2]> {
        let Times { span: own, halves, .. } = &self.spans[span as usize];
        let (from, to, middle) = (own.from, own.to, own.middle.t);
        if halves.is_some() || !(from < middle && middle < to) {
            return *halves;
        }
        let halves = Some([self.add_span(from, middle), self.add_span(middle, to)]);
        self.spans[span as usize].halves = halves;
        halves
    }

    /// How bodies stand at an instant at which their surfaces do not meet: where all corners, one of each connected part of a surface, lie
    /// outside of the other body, no surface is in the other body, and so none of its inside. Of a convex body any point tells; a mesh in
    /// it meets it.
    fn standing(&mut self, at: &Instant) -> Standing {
        for k in 0..2 {
            let (body, other) = (&self.bodies[k], &self.bodies[1 - k]);
            let middle = body.convex().filter(|_| !body.is_half_space()).map(|c| c.middle());
            let frame = &body.primitive.frame;
            let shells = body.mesh().map_or(&[][..], |(tree, _)| tree.shells());
            if body.mesh().is_some() && other.mesh().is_none() {
                continue;
            }
            for x in shells.iter().map(|y| frame.point(*y)).chain(middle) {
                let seen = |x| if k == 0 { at.b_point(x) } else { at.a_point(x) };
                // A mesh may have thousands of shells.
                self.cells += 1;
                if self.cells >= self.limit || self.halt.is_some_and(Halt::is_over) {
                    return Standing::Open;
                }
                let f = other.model.value(seen(x));
                if f > self.rounding {
                    continue;
                }
                let own = inside::inside(body, x, None, DVec3::ZERO, self.rounding);
                let own = own.filter(|x| other.model.value(seen(*x)) <= -self.rounding);
                if let Some(x) = own {
                    let [x, y] = if k == 0 { [x, at.b_point(x)] } else { [at.a_point(x), x] };
                    return Standing::Within(Pair { x, y, distance: 0.0 });
                }
                return Standing::Open;
            }
        }
        Standing::Apart
    }

    fn best(&self) -> f64 {
        self.found.last().map_or(f64::INFINITY, |f| f.distance)
    }

    /// A bound above which nothing is looked at.
    fn goal(&self) -> f64 {
        self.best() - LEFT * self.tolerance
    }

    fn is_spent(&self) -> bool {
        self.cells >= self.limit || self.halt.is_some_and(Halt::is_over)
    }

    fn search(&mut self) {
        let mut near = 0;
        while self.queue.lowest() < self.goal() && self.shared.is_none() && !self.is_spent() {
            if self.goal() <= 0.0 {
                near += 1;
                if near > FOR_SHARED {
                    break;
                }
            }
            let Some((_, cell)) = self.queue.pop() else { break };
            self.branch(&cell);
        }
    }

    /// Looks at a pair of places over a span and puts it to the others if it is open.
    fn push(&mut self, places: [Place; 2], span: u32, way: DVec3, least: f64) {
        self.cells += 1;
        let covers = self.covers(places);
        let paces = self.paces(&covers, span);
        let mut bound = least.max(self.along(&covers, span, way, &paces));
        if bound >= self.goal() {
            self.done = self.done.min(bound);
            return;
        }
        let Times { span: own, middle, .. } = &self.spans[span as usize];
        let near = self.nearest(&own.middle, middle, &covers, way);
        let way = near.way.unwrap_or(way);
        let along = self.along(&covers, span, way, &paces);
        bound = bound.max(along);
        let is_leaf = (0..2).all(|k| self.bodies[k].is_leaf(places[k]));
        if is_leaf {
            self.offer(places, &covers, span, &near);
            if bound < self.goal() && near.way.is_some() && near.gap > 0.0 {
                bound = bound.max(self.along_turning(&covers, span, &near, &paces));
            }
        }
        if bound >= self.goal() {
            self.done = self.done.min(bound);
            return;
        }
        let lost = gap(&self.spans[span as usize].middle, &covers, way) - self.slack - along;
        self.queue.push(bound, Cell { places, span, bound, way, lost });
    }

    /// The nearest points of two covers at an instant, looked for from a direction.
    fn nearest(&self, at: &Instant, seen: &[Seen; 2], covers: &[Cover; 2], start: DVec3) -> Near {
        let mut near = nearest(seen, covers, start, self.rounding);
        let mut start = start;
        for _ in 0..AGAIN {
            if near.way.is_some() || !self.is_beside(at, covers, &near) {
                break;
            }
            // GJK ended in a simplex that rounding made flat.
            near.distance = f64::INFINITY;
            start = start.any_orthonormal_vector();
            let again = nearest(seen, covers, start, self.rounding);
            if again.way.is_some() || !self.is_beside(at, covers, &again) {
                near = again;
            }
        }
        let enough = (EXACT * self.tolerance).max(ROUNDED * self.rounding);
        curved::exact(&self.bodies, at, covers, near, &Sizes { scale: self.scale, rounding: self.rounding, enough })
    }

    /// True where a point that was found to be of a facet and of a convex body is not of the body.
    fn is_beside(&self, at: &Instant, covers: &[Cover; 2], near: &Near) -> bool {
        let k = match covers {
            [Cover::Facet(_), Cover::Whole(_)] => 1,
            [Cover::Whole(_), Cover::Facet(_)] => 0,
            [_, _] => return false,
        };
        let x = if k == 0 { near.points[0] } else { at.b_point(near.points[1]) };
        !self.bodies[k].convex().is_some_and(|convex| convex.value(x) <= PROVEN * self.rounding)
    }

    /// How the points of both covers move, each seen from the other body.
    fn paces(&self, covers: &[Cover; 2], span: u32) -> [Pace; 2] {
        let span = &self.spans[span as usize].span;
        if span.length() <= 0.0 {
            return [Pace { way: 0.0, bend: 0.0 }; 2];
        }
        [0, 1].map(|k| match covers[k] {
            // Nothing is fixed in the frame of what is seen of another one.
            Cover::Below => Pace { way: f64::INFINITY, bend: f64::INFINITY },
            Cover::Box(..) | Cover::Facet(_) | Cover::Whole(_) => {
                span.pace(&self.relative[k], self.bodies[k].far(&covers[k]))
            }
        })
    }

    /// A lower bound of the distance of two covers over a span, along a direction (A's axes in its middle) that stands in A's frame, or in
    /// B's.
    fn along(&self, covers: &[Cover; 2], span: u32, way: DVec3, [of_a, of_b]: &[Pace; 2]) -> f64 {
        let Times { span, middle, ends, .. } = &self.spans[span as usize];
        let way = only(middle, covers).unwrap_or(way);
        let [from, to] = &ends[..] else { return gap(middle, covers, way) - self.slack };
        // Between two times no place goes farther than the speed lets it.
        let over = |[p, q]: [f64; 2], pace: &Pace| least_above_chord([p, q], pace.bend).max(0.5 * (p + q - pace.way));
        let in_a = || over([gap(from, covers, way), gap(to, covers, way)], of_b);
        let in_b = || {
            let own = span.middle.b_from_a * way;
            let [n, m] = [0, 1].map(|k| span.ends[k].a_vector(own));
            over([gap(from, covers, n), gap(to, covers, m)], of_a)
        };
        self.slack.mul_add(
            -1.0,
            match covers {
                [Cover::Below, _] => in_a(),
                [_, Cover::Below] => in_b(),
                [_, _] => in_a().max(in_b()),
            },
        )
    }

    /// The same along a direction that turns from that in which the covers are nearest at the begin of the span to that at its end, in A's
    /// frame and in B's.
    fn along_turning(&self, covers: &[Cover; 2], span: u32, near: &Near, [of_a, of_b]: &[Pace; 2]) -> f64 {
        let Times { span, ends, .. } = &self.spans[span as usize];
        let ([from, to], Some(way), None) = (&ends[..], near.way, only(&self.spans[0].middle, covers)) else {
            return f64::NEG_INFINITY;
        };
        let [p, q] = [(0, from), (1, to)].map(|(k, seen)| self.nearest(&span.ends[k], seen, covers, way));
        let (Some(n), Some(m)) = (p.way, q.way) else { return f64::NEG_INFINITY };
        let turned = |n: DVec3, m: DVec3, pace: &Pace| 2.0 * (n - m).length() * pace.way + pace.bend;
        let in_a = turned(n, m, of_b);
        let in_b = turned(span.ends[0].b_from_a * n, span.ends[1].b_from_a * m, of_a);
        least_above_chord([p.gap, q.gap], in_a.min(in_b) * (1.0 + 1e-12)) - self.slack
    }

    /// Keeps the points of two covers that are not divided if they are nearer than those that are known, and looks for the time at which
    /// they are nearest.
    fn offer(&mut self, places: [Place; 2], covers: &[Cover; 2], span: u32, near: &Near) {
        let Near { points, distance, .. } = *near;
        if !(distance < self.best() || distance == 0.0) {
            return;
        }
        let at = self.spans[span as usize].span.middle;
        let found = Found { points, places, distance, t: at.t };
        if distance == 0.0 {
            self.share(&found, covers, &at, span);
        }
        let is_much = distance < self.goal();
        if distance < self.best() {
            self.found.push(found);
        }
        if is_much && distance > 0.0 && self.spans[span as usize].span.length() > 0.0 {
            self.slide(&found, covers, near, span);
        }
    }

    /// Looks for a point of both bodies where their surfaces meet.
    fn share(&mut self, found: &Found, covers: &[Cover; 2], at: &Instant, span: u32) {
        let seen = &self.spans[span as usize].middle;
        let normal = |k: usize| match &covers[k] {
            Cover::Facet(t) => triangles::normal(&seen[k].triangle(t)).try_normalize(),
            Cover::Below => Some(seen[k].up()),
            Cover::Box(..) | Cover::Whole(_) => (found.points[k] - seen[k].middle(&covers[k])).try_normalize(),
        };
        let outward: Vec<DVec3> = (0..2).filter_map(normal).collect();
        let size = self.bodies.iter().map(|b| b.model.size()).fold(f64::INFINITY, f64::min);
        let pair = inside::shared(&self.bodies, at, found.points[0], &outward, 0.25 * size, self.rounding);
        self.shared = pair.map(|pair| (pair, at.t)).or(self.shared);
    }

    /// Follows two covers from the middle of a span to the time at which they are nearest: where their distance neither grows nor shrinks,
    /// by steps of twice the length and then by bisection and false position on its rate.
    fn slide(&mut self, found: &Found, covers: &[Cover; 2], near: &Near, span: u32) {
        let (begin, end) = (self.spans[0].span.from, self.spans[0].span.to);
        let mut step = 0.5 * self.spans[span as usize].span.length();
        let rate = |at: &Instant, near: &Near| -near.way.unwrap_or(DVec3::ZERO).dot(at.velocity(near.points[1]));
        let here = rate(&self.spans[span as usize].span.middle, near);
        let way = if here > 0.0 { -1.0 } else { 1.0 };
        let mut last = (found.t, here * way, near.way.unwrap_or(DVec3::X));
        let mut beyond: Option<(f64, f64)> = None;
        let mut is_slow = false;
        for _ in 0..TIMES {
            let t = match beyond {
                None => (last.0 + way * step).clamp(begin, end),
                Some((q, r)) => {
                    let (secant, middle) = (last.0 - last.1 * (q - last.0) / (r - last.1), 0.5 * (last.0 + q));
                    if !is_slow && (secant - last.0) * (secant - q) < 0.0 { secant } else { middle }
                }
            };
            let width = beyond.map(|(q, _)| (q - last.0).abs());
            if t == last.0 || width.is_some_and(|w| w * last.1.abs() <= 1e-3 * self.tolerance || w <= f64::EPSILON) {
                return;
            }
            let at = self.relative[0].at(t);
            let there = self.nearest(&at, &both_seen(&self.bodies, &at), covers, last.2);
            if there.distance < self.best() {
                self.found.push(Found { points: there.points, places: found.places, distance: there.distance, t });
            }
            let Some(n) = there.way.filter(|_| there.distance > 0.0) else { return };
            let slope = rate(&at, &there) * way;
            if slope < 0.0 {
                last = (t, slope, n);
            } else {
                beyond = Some((t, slope));
            }
            match (beyond, width) {
                (None, _) => step *= 2.0,
                (Some((q, _)), Some(width)) => is_slow = (q - last.0).abs() > 0.5 * width,
                (Some(_), None) => {}
            }
        }
    }

    /// Takes a pair of places apart where that gains most: the larger box, or the span where more is lost to time.
    fn branch(&mut self, cell: &Cell) {
        let sizes = [0, 1].map(|k| {
            let place = cell.places[k];
            if self.bodies[k].is_leaf(place) { 0.0 } else { self.bodies[k].cover(place).size() }
        });
        let k = usize::from(sizes[1] > sizes[0]);
        let is_leaf = (0..2).all(|k| self.bodies[k].is_leaf(cell.places[k]));
        if (is_leaf || cell.lost > sizes[k])
            && let Some(halves) = self.halves(cell.span)
        {
            for half in halves {
                self.push(cell.places, half, cell.way, cell.bound);
            }
            return;
        }
        if is_leaf {
            self.done = self.done.min(cell.bound);
            return;
        }
        let k = if self.bodies[k].is_leaf(cell.places[k]) { 1 - k } else { k };
        for place in self.bodies[k].below(cell.places[k]) {
            let mut places = cell.places;
            places[k] = place;
            self.push(places, cell.span, cell.way, cell.bound);
        }
    }

    /// The points that were found, moved inside and proven there, the nearest that can be.
    fn proven(&self) -> Option<(Pair, f64)> {
        let each = self.found.iter().rev().take(TRIED);
        each.filter_map(|found| {
            let at = self.relative[0].at(found.t);
            let [x, y] = found.points;
            let covers = self.covers(found.places);
            let facet = |k: usize| match &covers[k] {
                Cover::Facet(t) => Some(t.map(|p| self.bodies[k].primitive.frame.point(p))),
                Cover::Box(..) | Cover::Whole(_) | Cover::Below => None,
            };
            let way = (y - x).normalize_or_zero();
            let (own, inwards) = ([x, at.b_point(y)], [-way, at.b_from_a * way]);
            let [u, v] =
                [0, 1].map(|k| inside::inside(&self.bodies[k], own[k], facet(k).as_ref(), inwards[k], self.rounding));
            let (x, y) = (u?, v?);
            let distance = (x - at.a_point(y)).length() + 2.0 * self.rounding;
            Some((Pair { x, y, distance }, found.t))
        })
        .next()
    }

    /// The answer with a lower bound.
    fn answer(&mut self, lower: f64) -> Option<Distance> {
        let best = self.shared.or_else(|| self.proven());
        let (mut pair, t) = best?;
        let at = self.relative[0].at(t);
        if pair.distance > 0.0 && lower <= 0.0 && pair.distance <= self.tolerance {
            let x = 0.5 * (pair.x + at.a_point(pair.y));
            if let Some(shared) = inside::shared_near(&self.bodies, &at, x, self.rounding, self.slack) {
                self.shared = Some((shared, t));
                pair = shared;
            }
        }
        // Where the bodies are nearest they are bounded by their distance: above what is known no bound of all holds.
        let (upper, lower) = (pair.distance, lower.min(pair.distance));
        let is_settled = upper - lower <= self.tolerance;
        let near = |k: usize, x: DVec3, own: DVec3| NearPoint {
            point: self.relative[0].world_point(&at, x),
            faces: inside::faces(&self.bodies[k], own, self.scale, self.rounding),
        };
        let (a, b) = (near(0, pair.x, pair.x), near(1, at.a_point(pair.y), pair.y));
        Some(Distance { lower, upper, time: t, a, b, is_settled, rounding: self.slack, cells: self.cells })
    }
}
