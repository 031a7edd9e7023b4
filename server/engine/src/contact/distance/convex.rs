//! Two whole convex primitives: how far apart they are along a direction, and the direction in which that is most.
//!
//! With h their supports, −h_B(−u) − h_A(u) bounds the distance from below for every unit u, and is the distance where u leads from the
//! nearest point of A to that of B (the separation of convex sets by their supports; S. Boyd, L. Vandenberghe, Convex Optimization, 8.1).
//! So where the nearest points are found by whatever means, one direction proves it: at an instant GJK finds them, and where a body is
//! curved Newton's method makes them exact (`polish`). f of a convex primitive is convex. So a point at its surface is moved inside by the
//! right part of the way to a point that is deep.

use super::active_set::Clause;
use super::polish::{FEATURE, Held, Pair, Polish, Side, Steps};
use super::{Distance, LEAST, NearPoint, common, slack};
use crate::contact::query::outcome::NO_FACE;
use crate::math::gjk::{Cores, GOOD, of_supports};
use crate::motion::{Instant, Relative};
use crate::octree::Model;
use crate::solid::local::LiteralId;
use crate::solid::primitive::{Convex, Primitive};
use crate::solid::{Face, Sense};
use glam::{DMat3, DVec3};

/// Relative gap to which the nearest points of bodies with corners are found, and those that Newton's method does not prove.
const EXACT: f64 = 1e-15;
/// From what GJK leaves to steps whose square is rounding: the bounds tell whether they came to the nearest points.
pub const STEPS: Steps = Steps { met: 16.0 * GOOD, last: 1e-8, most: 12, longest: 0.02 };
/// A point this near to an apex is the apex, in the pair's size: GJK finds it at once where it is nearest, and Newton's method never.
const TIP: f64 = 1e-9;
/// Bounds this near to each other, in rounding's lengths, are of the nearest points: those are moved inwards by a few.
const PROVEN: f64 = 32.0;
/// The last of the directions from which GJK starts.
const LAST: usize = 3;
/// Faces this near to a point, in the pair's size, are those among which it is moved.
pub const NEAR: f64 = 0.05;

/// Two bodies that are one convex primitive each.
#[derive(Clone, Copy, Debug)]
pub struct ConvexPair<'a>([&'a Primitive; 2]);

/// A convex primitive in A's frame.
pub struct Body<'a> {
    primitive: &'a Primitive,
    shape: Convex<'a>,
    axes: DMat3,
    origin: DVec3,
}

/// Both at an instant.
pub struct Placed<'a>([Body<'a>; 2]);

/// Points of two convex bodies, A's frame.
enum Found {
    /// As near to each other as they were found, and the way from the first one to the other.
    Apart { points: [DVec3; 2], way: DVec3 },
    /// Of both, as far as rounding goes.
    Common(DVec3),
}

impl<'a> ConvexPair<'a> {
    /// Of two models; `None` where one is not a convex primitive alone. One of them may be a half-space.
    pub fn of(models: [&'a Model; 2]) -> Option<Self> {
        let [a, b] = models.map(|model| model.solid.whole());
        let pair = [a?, b?];
        let known = pair.map(|p| p.shape.convex().is_known());
        let is_told = |k: usize| known[k] || known[1 - k] && pair[k].shape.convex().is_half_space();
        (is_told(0) && is_told(1)).then_some(Self(pair))
    }

    /// True for a half-space.
    pub fn is_half_space(&self, k: usize) -> bool {
        self.0[k].shape.convex().is_half_space()
    }

    /// True where the nearest points are found in finitely many steps: both cores have corners alone, or a plane faces what is known.
    pub fn is_finite(&self) -> bool {
        let shapes = self.0.map(|p| p.shape.convex());
        shapes.iter().all(|s| s.has_corners_alone()) || shapes.iter().any(|s| !s.is_known())
    }

    /// Both where they stand at an instant.
    pub fn at(&self, at: &Instant) -> Placed<'a> {
        let [a, b] = self.0;
        let turn = at.b_from_a.transpose() * b.frame.matrix();
        let place = |p: &'a Primitive, axes, origin| Body { primitive: p, shape: p.shape.convex(), axes, origin };
        Placed([place(a, a.frame.matrix(), a.frame.position), place(b, turn, at.a_point(b.frame.position))])
    }
}

impl<'a> Body<'a> {
    /// One where it stands in its own model.
    pub fn of(primitive: &'a Primitive) -> Self {
        let (axes, origin) = (primitive.frame.matrix(), primitive.frame.position);
        Self { primitive, shape: primitive.shape.convex(), axes, origin }
    }
}

impl Body<'_> {
    /// Largest u·x; u is a unit vector.
    fn reach(&self, u: DVec3) -> f64 {
        u.dot(self.origin) + self.shape.reach(&self.axes, u)
    }

    fn support(&self, u: DVec3) -> DVec3 {
        self.shape.support(&self.axes, self.origin, u)
    }

    /// True where GJK finds nearest points in finitely many steps.
    pub fn has_corners_alone(&self) -> bool {
        self.shape.has_corners_alone()
    }

    /// A point inside a bounded one.
    pub fn middle(&self) -> DVec3 {
        self.origin + self.axes * self.shape.middle()
    }
}

impl Placed<'_> {
    /// What lies between the bodies along a unit direction from A to B: no more than their distance, but for rounding. Off a half-space that
    /// direction is the plane's.
    pub fn along(&self, u: DVec3) -> f64 {
        let [a, b] = &self.0;
        let above = |plane: &Body, other: &Body| -other.reach(-plane.axes.z_axis) - plane.axes.z_axis.dot(plane.origin);
        match (a.shape.is_half_space(), b.shape.is_half_space()) {
            (false, false) => -b.reach(-u) - a.reach(u),
            (true, _) => above(a, b),
            (false, true) => above(b, a),
        }
    }

    /// The nearest points, to a relative gap of `good` between their distance and a bound of it from below, looked for from a direction or
    /// from that between the middles; `None` where none are found.
    fn nearest(&self, good: f64, start: Option<DVec3>) -> Option<Found> {
        let [a, b] = &self.0;
        let margins = [a, b].map(|body| body.shape.margin());
        let plane = |plane: &Body, other: &Body| {
            let low = other.support(-plane.axes.z_axis);
            let height = |x: DVec3| plane.axes.z_axis.dot(x - plane.origin);
            // Below the plane and inside: half as far towards the middle as would lift it above.
            let (depth, middle) = (-height(low), other.middle());
            let part = (0.5 * depth / (depth + height(middle)).max(depth)).min(1.0);
            (low, plane.axes.z_axis, height(low), low + (middle - low) * part)
        };
        let (from, v) = match (a.shape.is_known(), b.shape.is_known()) {
            (true, true) => {
                let start = start.unwrap_or(b.middle() - a.middle());
                let start = if start == DVec3::ZERO { DVec3::X } else { start };
                match of_supports(|v| a.support(v), |v| b.support(v), start, good) {
                    Cores::Apart { v, a, .. } => (a, v),
                    Cores::Common(x) => return Some(Found::Common(x)),
                    Cores::Open => return None,
                }
            }
            // A plane and the point that is lowest above it.
            (false, _) => match plane(a, b) {
                (low, up, height, _) if height > 0.0 => (low - up * height, up * height),
                (.., inside) => return Some(Found::Common(inside)),
            },
            (true, false) => match plane(b, a) {
                (low, up, height, _) if height > 0.0 => (low, -up * height),
                (.., inside) => return Some(Found::Common(inside)),
            },
        };
        let length = v.length();
        let way = v / length;
        if !way.is_finite() {
            return None;
        }
        let points = [from + way * margins[0], from + v - way * margins[1]];
        let apart = length - margins[0] - margins[1];
        Some(if apart > 0.0 { Found::Apart { points, way } } else { Found::Common(0.5 * (points[0] + points[1])) })
    }
}

/// Points of two convex bodies that are nearest, as far as was found.
pub struct NearestPair {
    /// The points, proven inside.
    pub pair: Pair,
    /// A bound of the distance from below, but for rounding.
    pub lower: f64,
    /// The direction along which it holds, A's frame, from A to B; zero where they share a point.
    pub way: DVec3,
}

impl ConvexPair<'_> {
    /// The nearest points at an instant; `None` where none are found that are proven inside.
    pub fn nearest(&self, models: [&Model; 2], at: &Instant, scale: f64, rounding: f64) -> Option<NearestPair> {
        let placed = self.at(at);
        let is_finite = self.is_finite();
        let mut best: Option<NearestPair> = None;
        // GJK may end early, by rounding: from elsewhere it goes another way.
        let mut start = None;
        for round in usize::from(is_finite)..=LAST {
            let good = if round == 0 { GOOD } else { EXACT };
            let (points, way) = match placed.nearest(good, start)? {
                Found::Apart { points, way } => (points, way),
                Found::Common(x) => {
                    let y = at.b_point(x);
                    let f = placed.0[0].value(x).max(placed.0[1].value(y));
                    let shared = (f <= -rounding).then_some(Pair { x, y, distance: 0.0 });
                    let shared = shared.or_else(|| common::from_point(models, at, x, rounding, 4.0 * rounding));
                    if shared.is_none() && f > PROVEN * rounding && round < LAST {
                        // GJK ended in a simplex that rounding made flat.
                        start = Some(start.unwrap_or(DVec3::X).any_orthonormal_vector());
                        continue;
                    }
                    // Of bodies that touch and no more: a point of each beside the touch.
                    let beside = || {
                        let [x, y] = [
                            placed.0[0].inside(x, DVec3::ZERO, rounding)?,
                            placed.0[1].inside(y, DVec3::ZERO, rounding)?,
                        ];
                        Some(Pair { x, y, distance: (x - at.a_point(y)).length() + 2.0 * rounding })
                    };
                    let shared = shared.or_else(beside);
                    return shared.map(|pair| NearestPair { pair, lower: 0.0, way: DVec3::ZERO });
                }
            };
            start = match round {
                0 | 1 => Some(way),
                _ => Some(way.any_orthonormal_vector()),
            };
            let (x, y) = (points[0], at.b_point(points[1]));
            let led = (!is_finite).then(|| placed.led_on(models, at, (x, y), scale, rounding)).flatten();
            for (x, y, is_settled) in led.into_iter().chain([(x, y, is_finite || led.is_none())]) {
                let to_b = at.b_from_a * way;
                let inside = [placed.0[0].inside(x, -way, rounding), placed.0[1].inside(y, to_b, rounding)];
                let [Some(u), Some(v)] = inside else { continue };
                let pair = Pair { x: u, y: v, distance: (u - at.a_point(v)).length() + 2.0 * rounding };
                let way = (at.a_point(y) - x).try_normalize().unwrap_or(way);
                let found = NearestPair { pair, lower: placed.along(way).max(0.0), way };
                // By what f is moved inwards, and by supports' own rounding.
                let is_proven = is_settled && found.pair.distance - found.lower <= PROVEN * rounding;
                if is_proven || best.as_ref().is_none_or(|b| found.pair.distance < b.pair.distance) {
                    best = Some(found);
                }
                if is_proven {
                    return best;
                }
            }
        }
        best
    }
}

/// The distance of two whole convex primitives at an instant, settled; `None` where that is left to the search.
pub fn at_instant(
    models: [&Model; 2],
    relative: &Relative,
    rounding: f64,
    tolerance: f64,
    time: f64,
) -> Option<Distance> {
    let convex = ConvexPair::of(models)?;
    let at = relative.at(time);
    let slack = slack(models, relative, rounding);
    let tolerance = tolerance.max(LEAST * slack);
    let scale = models[0].size().max(models[1].size());
    let NearestPair { pair, lower, .. } = convex.nearest(models, &at, scale, rounding)?;
    let lower = (lower - slack).max(0.0);
    if pair.distance - lower > tolerance {
        return None;
    }
    let bodies = convex.at(&at).0;
    let near = |k: usize, seen: DVec3, own: DVec3| NearPoint {
        point: relative.world_point(&at, seen),
        faces: bodies[k].faces(own, scale, rounding),
    };
    let (a, b) = (near(0, pair.x, pair.x), near(1, at.a_point(pair.y), pair.y));
    Some(Distance { lower, upper: pair.distance, time, a, b, is_settled: true, rounding: slack, cells: 1 })
}

impl Placed<'_> {
    /// The points, each in its body's frame, to which Newton's method leads, and whether it has come to an end; `None` where it has nothing
    /// to lead, or leads to none.
    fn led_on(
        &self,
        models: [&Model; 2],
        at: &Instant,
        start: (DVec3, DVec3),
        scale: f64,
        rounding: f64,
    ) -> Option<(DVec3, DVec3, bool)> {
        let sides = models.map(|model| Side { model, tokens: &model.solid.normal_form });
        let near = NEAR * scale;
        let clauses = [self.0[0].clause(start.0, near), self.0[1].clause(start.1, near)];
        let is_tip = |k: usize, x: DVec3| {
            let faces = clauses[k].iter().map(|id| &models[k].solid.faces[id.face() as usize]);
            faces.filter_map(Face::apex).any(|apex| apex.point.distance(x) <= TIP * scale)
        };
        let held = match [is_tip(0, start.0), is_tip(1, start.1)] {
            [true, true] => return None,
            [true, false] => Some(Held::still(0)),
            [false, true] => Some(Held::still(1)),
            [false, false] => None,
        };
        let led = Polish { sides, at, scale, rounding, steps: STEPS }.solve(&clauses, start, held);
        (led.0.is_finite() && led.1.is_finite()).then_some(led)
    }
}

impl Body<'_> {
    /// f at a point of the model's frame.
    pub fn value(&self, x: DVec3) -> f64 {
        self.primitive.highest(x).1
    }

    /// The literals near a point of the model's frame: of few faces all.
    pub fn clause(&self, x: DVec3, near: f64) -> Clause {
        let first = self.primitive.first_face;
        let literal = |face: u32| LiteralId::new(first + face, Sense::Positive);
        match self.primitive.not_below(x, -near) {
            Some(faces) => faces.into_iter().map(literal).collect(),
            None => (0..self.primitive.faces.len() as u32).map(literal).collect(),
        }
    }

    /// A point next to one at the surface, of the model's frame, proven inside; `inwards` is a unit vector that may lead there.
    pub fn inside(&self, x: DVec3, inwards: DVec3, rounding: f64) -> Option<DVec3> {
        let is_inside = |x: &DVec3| self.value(*x) <= -rounding;
        let near = x + inwards * (2.0 * rounding);
        if is_inside(&near) {
            return Some(near);
        }
        // f falls on the way to a deep point as on a straight line, or sooner.
        let f = self.value(x);
        if self.shape.is_half_space() {
            let below = x - self.primitive.frame.vector(DVec3::Z) * (f + 2.0 * rounding);
            return Some(below).filter(is_inside);
        }
        let deep = self.primitive.frame.point(self.shape.middle());
        let part = (f + 2.0 * rounding) / (f - self.value(deep));
        let moved = x + (deep - x) * part;
        Some(moved).filter(|moved| (0.0..1.0).contains(&part) && is_inside(moved))
    }

    /// The faces at a point of the model's frame, at most three, by face id; `NO_FACE` fills.
    pub fn faces(&self, x: DVec3, scale: f64, rounding: f64) -> [u32; 3] {
        let reach = FEATURE * scale + 1e3 * rounding;
        let mut nearest = [(reach, NO_FACE); 3];
        let mut take = |face: u32| {
            let id = self.primitive.first_face + face;
            let off = self.primitive.faces[face as usize].value(x).abs();
            if let Some(i) = nearest.iter().position(|n| off < n.0 || n.1 == NO_FACE && off <= n.0) {
                nearest[i..].rotate_right(1);
                nearest[i] = (off, id);
            }
        };
        match self.primitive.not_below(x, -reach) {
            Some(faces) => faces.into_iter().for_each(&mut take),
            None => (0..self.primitive.faces.len() as u32).for_each(&mut take),
        }
        let mut faces = nearest.map(|n| n.1);
        faces.sort_unstable();
        faces
    }
}
