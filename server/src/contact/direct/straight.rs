//! Two convex bodies that only move along: the time of contact is a maximum over directions.
//!
//! With w the velocity of A against B, c the way from A's centre to B's and h the supports, a direction n keeps the bodies
//! apart while n·c − h_A(n) − h_B(−n) − t n·w > 0. So
//!
//! ```text
//! t = max over n·w > 0 of φ(n) / n·w,    φ(n) = n·c − h_A(n) − h_B(−n)
//! ```
//!
//! and every n is the proof of a lower bound: no time is cut. φ is concave, and linear along rays. Two parts find the maximum:
//!
//! 1. Cutting planes. φ is the least n·d over the points d of the difference B − A; of these three are kept whose triangle
//!    the ray t w pierces, as a simplex step of the linear programme would (J. E. Kelley 1960; seen from the points it is
//!    portal refinement, G. Snethen, Game Programming Gems 7, 2.5). Its normal is the next direction. A direction that is
//!    free until the end of the step is the answer "clear".
//! 2. Newton. Near the maximum the features that meet are known: a body that shows an edge or a side along n holds n to
//!    a circle of directions, two circles hold it altogether, else φ is smooth on what is left. Steps on the unit sphere
//!    converge quadratically; with H the second derivative of φ, along a circle n·a = lean with multiplier μ it is H + μ lean.
//!
//! The point follows from the features, the witness of depth delta from one linear step, and both trees confirm it. What
//! does not settle, starts near or leaves a patch open is left to the advance.

use super::super::literal::Side;
use super::super::newton::{Actives, Constraint, Solution, Weights};
use super::super::search::{Found, Task};
use super::support::Body;
use super::{APART, Advance};
use crate::math::any_perpendicular;
use crate::motion::Instant;
use crate::solid::local::LiteralId;
use crate::solid::{Face, Primitive, Sense, Shape};
use glam::{DMat3, DVec2, DVec3};
use smallvec::SmallVec;

/// Cutting planes at most.
const CUTS: usize = 32;
/// Gap between the bounds of the time, in lengths of the pair's size, from which features are asked, and how near to a
/// circle of directions one is held by it.
const TRIES: [(f64, f64); 4] = [(3e-2, 0.1), (1e-3, 0.03), (1e-5, 3e-3), (1e-8, 1e-4)];
/// Newton steps of one try.
const STEPS: usize = 10;
/// A step this small (radians) leaves an error of its square.
const SETTLED: f64 = 1e-8;

/// Gap that the proof may leave at the time of contact, in sizes of the pair.
const CLOSED: f64 = 1e-14;
/// A flat face lies this flat on another (radians).
const FLAT: f64 = 1e-9;

/// Extent of the artificial triangle to start from, in sizes of the pair, and its height in extents: the larger, the nearer a
/// miss is told.
const START: [f64; 2] = [4.0, 1e4];

/// What a body shows along a direction.
#[derive(Clone, Copy)]
struct Shown {
    /// Farthest point, and the other end of the segment where it is held by one circle of directions.
    ends: [DVec3; 2],
    /// Circles n·axis = lean of directions along which the body stays what it is, by the index of the axis.
    held: u8,
    /// A flat face, held to the one direction.
    flat: bool,
    /// Second derivative of the support: this much along `tangent` …
    bend: f64,
    tangent: DVec3,
    /// … and this much in every direction.
    round: f64,
}

/// A shape's numbers.
#[derive(Clone, Copy)]
enum Core {
    Ball(f64),
    Cuboid(DVec3),
    /// Cylinder, cone, frustum: the radii, half the height, the component along z of the outward normals of the side.
    Round {
        radii: [f64; 2],
        half: f64,
        lean: f64,
    },
}

/// A primitive in A's model axes, seen from its own centre.
struct Part<'a> {
    primitive: &'a Primitive,
    axes: DMat3,
    core: Core,
}

impl<'a> Part<'a> {
    fn new(primitive: &'a Primitive, axes: DMat3) -> Option<Self> {
        let round = |bottom: f64, top: f64, half: f64| {
            let drop = bottom - top;
            let lean = if drop == 0.0 { 0.0 } else { drop / (drop * drop + 4.0 * half * half).sqrt() };
            Core::Round { radii: [bottom, top], half, lean }
        };
        let core = match &primitive.shape {
            Shape::Sphere(s) => Core::Ball(s.radius),
            Shape::Cuboid(c) => Core::Cuboid(c.half),
            Shape::Cylinder(c) => round(c.radius, c.radius, c.half_height),
            Shape::Cone(c) => round(c.bottom, c.top, c.half_height),
            Shape::Polyhedron(_) | Shape::HalfSpace(_) => return None,
        };
        Some(Self { primitive, axes, core })
    }

    /// What holds the unit outward direction m, nearer than `tol`: circles, and whether a flat face does.
    fn held(&self, m: DVec3, tol: f64) -> (u8, bool) {
        let l = self.axes.transpose() * m;
        match self.core {
            Core::Ball(_) => (0, false),
            Core::Cuboid(_) => {
                let held = (0..3).fold(0, |held, k| held | u8::from(l[k].abs() <= tol) << k);
                (held, held.count_ones() == 2)
            }
            Core::Round { radii, lean, .. } => {
                let flat = l.x * l.x + l.y * l.y <= tol * tol && radii[usize::from(l.z >= 0.0)] > 0.0;
                (u8::from(!flat && (l.z - lean).abs() <= tol) << 2, flat)
            }
        }
    }

    /// Circles by their axes and leans.
    fn circles(&self, held: u8) -> impl Iterator<Item = (DVec3, f64)> {
        let lean = if let Core::Round { lean, .. } = self.core { lean } else { 0.0 };
        (0..3).filter(move |k| held >> k & 1 == 1).map(move |k| (self.axes.col(k), lean))
    }

    /// What is shown along the unit outward direction m, held as told.
    fn shown(&self, m: DVec3, (held, flat): (u8, bool)) -> Shown {
        let mut shown = Shown { ends: [m; 2], held, flat, bend: 0.0, tangent: DVec3::ZERO, round: 0.0 };
        match self.core {
            Core::Ball(r) => {
                shown.ends = [m * r; 2];
                shown.round = r;
            }
            Core::Cuboid(half) => {
                let corner = half.copysign(self.axes.transpose() * m);
                let other =
                    DVec3::from_array(std::array::from_fn(|k| if held >> k & 1 == 1 { -corner[k] } else { corner[k] }));
                shown.ends = [self.axes * corner, self.axes * other];
            }
            Core::Round { radii, half, lean } => {
                let l = self.axes.transpose() * m;
                let rho = (l.x * l.x + l.y * l.y).sqrt();
                let u = if rho > 0.0 { DVec3::new(l.x / rho, l.y / rho, 0.0) } else { DVec3::X };
                let upper = usize::from(l.z >= lean);
                let rim = |k: usize| self.axes * (u * radii[k] + DVec3::Z * half.copysign(k as f64 - 0.5));
                shown.ends = [rim(upper), if held == 0 { DVec3::ZERO } else { rim(1 - upper) }];
                shown.bend = if rho > 0.0 { radii[upper] / rho } else { 0.0 };
                shown.tangent = self.axes * DVec3::new(-u.y, u.x, 0.0);
            }
        }
        shown
    }

    /// The faces that meet in what is shown along the unit outward direction m, with the weights of their normals; `own`
    /// is m along the axes of the primitive's model.
    fn faces(&self, side: Side, m: DVec3, own: DVec3, shown: &Shown, out: &mut SmallVec<[(Constraint, f64); 8]>) {
        let id = |k: u32| LiteralId::new(self.primitive.first_face + k, Sense::Positive);
        let literal = |k: u32| Constraint::Literal(side, id(k));
        let l = self.axes.transpose() * m;
        match self.core {
            Core::Ball(_) => out.push((literal(0), 1.0)),
            Core::Cuboid(_) => {
                for k in 0..3 {
                    if shown.held >> k & 1 == 0 {
                        out.push((literal(2 * k as u32 + u32::from(l[k] < 0.0)), l[k].abs()));
                    }
                }
            }
            Core::Round { radii, lean, .. } => {
                let upper = usize::from(if shown.flat { l.z >= 0.0 } else { l.z >= lean });
                // The disc above comes before the one below.
                let disc = literal(1 + u32::from(upper == 0 && radii[1] > 0.0));
                if shown.flat {
                    out.push((disc, 1.0));
                } else if shown.held != 0 {
                    out.push((literal(0), 1.0));
                } else if radii[upper] > 0.0 {
                    let on_side = ((l.x * l.x + l.y * l.y) / (1.0 - lean * lean)).sqrt();
                    out.push((literal(0), on_side));
                    out.push((disc, (l.z - on_side * lean).abs()));
                } else if let Face::Cone { axis, .. } = self.primitive.faces[0] {
                    let u = any_perpendicular(axis);
                    let along = [axis, u, axis.cross(u)];
                    out.extend((0..3).map(|k| (Constraint::Apex(side, id(0), k), along[usize::from(k)].dot(own))));
                }
            }
        }
    }
}

/// A point of the difference of the bodies: across the motion, and along it.
#[derive(Clone, Copy)]
struct Cut {
    across: DVec2,
    along: f64,
}

/// The pair in A's model axes.
pub struct Straight<'a> {
    task: &'a Task<'a>,
    /// Both at the start.
    at: Instant,
    parts: [Part<'a>; 2],
    bodies: [Body<'a>; 2],
    centers: [DVec3; 2],
    /// Velocity of A against B.
    w: DVec3,
}

impl<'a> Straight<'a> {
    /// The pair of a task, where it is one for this.
    pub fn new(task: &'a Task<'a>, a: &'a Primitive, b: &'a Primitive) -> Option<Self> {
        if task.relative.turns() {
            return None;
        }
        let at = task.relative.at(0.0);
        let axes_a = a.frame.matrix();
        let axes_b = at.b_from_a.transpose() * b.frame.matrix();
        let centers = [a.frame.position, at.a_point(b.frame.position)];
        let bodies = [Body::new(&a.shape, axes_a, centers[0])?, Body::new(&b.shape, axes_b, centers[1])?];
        let parts = [Part::new(a, axes_a)?, Part::new(b, axes_b)?];
        Some(Self { task, at, parts, bodies, centers, w: at.v0 })
    }

    /// The earliest contact, `Some(None)` if there is none in this step; `None` leaves the pair to others. `level` is the
    /// depth of a witness; tries are counted.
    pub fn meet(&self, level: f64, tries: &mut u64) -> Option<Option<Found>> {
        let c = self.centers[1] - self.centers[0];
        let least = Advance::least(self.task);
        let [a, b] = &self.bodies;
        let phi = |n: DVec3| -b.reach(-n) - a.reach(n);
        let speed = self.w.length();
        // Along the centres: most pairs that stay apart are told at once.
        let first = phi(c);
        let rate = c.dot(self.w);
        let long = c.length();
        if first.min(first - rate) > least.max(0.0) * long {
            return Some(None);
        }
        if speed <= f64::MIN_POSITIVE {
            return None;
        }
        let size = self.size();
        let way = self.w / speed;
        let e = any_perpendicular(way);
        let f = way.cross(e);
        let margin = a.margin + b.margin;
        let far = START[0] * size;
        let corner = |x: f64, y: f64| Cut { across: DVec2::new(x, y) * far, along: far * START[1] };
        let mut cuts = [corner(1.0, 0.0), corner(-0.5, 0.75), corner(-0.5, -0.75)];
        let mut next = 0;
        for _ in 0..CUTS {
            let [p, q, r] = cuts;
            let (pq, pr) = (q.across - p.across, r.across - p.across);
            let area = pq.perp_dot(pr);
            let (hq, hr) = (q.along - p.along, r.along - p.along);
            // along + slope·across is the same at the three.
            let slope = DVec2::new(hr * pq.y - hq * pr.y, hq * pr.x - hr * pq.x) / area;
            if !slope.is_finite() {
                return None;
            }
            let above = p.along + slope.dot(p.across);
            let n = way + e * slope.x + f * slope.y;
            let length = n.length();
            let d = b.support(-n) - a.support(n) - n * (margin / length);
            let below = n.dot(d);
            // Free from the start to the end.
            if below.min(below - speed) > least.max(0.0) * length {
                return Some(None);
            }
            if next < TRIES.len() && above - below <= TRIES[next].0 * size {
                while next < TRIES.len() && above - below <= TRIES[next].0 * size {
                    next += 1;
                }
                *tries += 1;
                if let Some(n) = self.settle(n / length, TRIES[next - 1].1)
                    && let Some(found) = self.contact(n, level, least)
                {
                    return Some(found);
                }
                if next == TRIES.len() {
                    return None;
                }
            }
            let cut = Cut { across: DVec2::new(d.dot(e), d.dot(f)), along: d.dot(way) };
            // Weights of the three that make 0, and of those that make the new point: the first one to vanish leaves.
            let weights = |y: DVec2| {
                let u = (y - p.across).perp_dot(pr) / area;
                let v = pq.perp_dot(y - p.across) / area;
                [1.0 - u - v, u, v]
            };
            let (have, want) = (weights(DVec2::ZERO), weights(cut.across));
            let mut leaving = (f64::INFINITY, 3);
            for k in 0..3 {
                if want[k] > 1e-14 && have[k].max(0.0) < leaving.0 * want[k] {
                    leaving = (have[k].max(0.0) / want[k], k);
                }
            }
            if leaving.1 == 3 {
                return None;
            }
            cuts[leaving.1] = cut;
        }
        None
    }

    /// The direction of the maximum near n, with the features that meet; a unit vector.
    fn settle(&self, mut n: DVec3, tol: f64) -> Option<(DVec3, [Shown; 2])> {
        let c = self.centers[1] - self.centers[0];
        // Which circles hold it is told once.
        let mut held = [self.parts[0].held(n, tol), self.parts[1].held(-n, tol)];
        if held[0].1 || held[1].1 {
            let k = usize::from(!held[0].1);
            let sign = if k == 0 { 1.0 } else { -1.0 };
            let l = self.parts[k].axes.transpose() * (n * sign);
            let axis = l.abs().max_position();
            n = (self.parts[k].axes.col(axis) * (l[axis].signum() * sign)).normalize();
            held[1 - k] = self.parts[1 - k].held(-n * sign, FLAT);
            return Some((n, [self.parts[0].shown(n, held[0]), self.parts[1].shown(-n, held[1])]));
        }
        let mut shown = [self.parts[0].shown(n, held[0]), self.parts[1].shown(-n, held[1])];
        for _ in 0..STEPS {
            let d = c + shown[1].ends[0] - shown[0].ends[0];
            let s = n.dot(self.w);
            if s <= 0.0 {
                return None;
            }
            let g = d - self.w * (n.dot(d) / s);
            let e = any_perpendicular(n);
            let f = n.cross(e);
            let flat = |v: DVec3| DVec2::new(v.dot(e), v.dot(f));
            let g = flat(g);
            let (mut xx, mut xy, mut yy) = (-(shown[0].round + shown[1].round), 0.0, 0.0);
            yy += xx;
            for part in &shown {
                let t = flat(part.tangent);
                xx -= part.bend * t.x * t.x;
                xy -= part.bend * t.x * t.y;
                yy -= part.bend * t.y * t.y;
            }
            // Circles of both bodies; of two that are one the second says nothing.
            let mut circles: SmallVec<[(DVec2, f64, f64); 4]> = SmallVec::new();
            for (k, sign) in [1.0, -1.0].into_iter().enumerate() {
                for (a, lean) in self.parts[k].circles(held[k].0) {
                    let way = flat(a * sign);
                    let off = n.dot(a) * sign - lean;
                    let same = circles.iter().any(|h| h.0.perp_dot(way).abs() <= 1e-6 * h.0.length() * way.length());
                    if !same && circles.len() < 2 {
                        circles.push((way, off, lean));
                    }
                }
            }
            let step = match circles.as_slice() {
                [] => {
                    let det = xx * yy - xy * xy;
                    if det <= 1e-6 * xx * yy || xx >= 0.0 {
                        return None;
                    }
                    DVec2::new(xy * g.y - yy * g.x, xy * g.x - xx * g.y) / det
                }
                [(way, off, lean)] => {
                    let square = way.length_squared();
                    let mu = g.dot(*way) / square;
                    let across = *way * (-off / square);
                    let along = way.perp() / square.sqrt();
                    let h = DVec2::new(xx * along.x + xy * along.y, xy * along.x + yy * along.y);
                    let bend = h.dot(along) + mu * lean;
                    if bend >= 0.0 {
                        return None;
                    }
                    across - along * ((g.dot(along) + h.dot(across)) / bend)
                }
                [(p, off_p, _), (q, off_q, _), ..] => {
                    let det = p.perp_dot(*q);
                    DVec2::new(off_q * p.y - off_p * q.y, off_p * q.x - off_q * p.x) / det
                }
            };
            let long = step.length();
            if !long.is_finite() {
                return None;
            }
            let step = if long > 0.5 { step * (0.5 / long) } else { step };
            n = (n + e * step.x + f * step.y).normalize();
            shown = [self.parts[0].shown(n, held[0]), self.parts[1].shown(-n, held[1])];
            if long <= SETTLED {
                return Some((n, shown));
            }
        }
        None
    }

    /// The contact along n, confirmed by both trees; `Some(None)` when it comes after the step.
    fn contact(&self, (n, shown): (DVec3, [Shown; 2]), level: f64, least: f64) -> Option<Option<Found>> {
        let [a, b] = &self.bodies;
        let phi = -b.reach(-n) - a.reach(n);
        let speed = n.dot(self.w);
        if phi <= APART * self.task.delta || speed <= 0.0 {
            return None;
        }
        let t = phi / speed;
        if phi - speed > least.max(0.0) {
            return Some(None);
        }
        let x = self.point(n, t, &shown)?;
        let mut active: SmallVec<[(Constraint, f64); 8]> = SmallVec::new();
        self.parts[0].faces(Side::A, n, n, &shown[0], &mut active);
        self.parts[1].faces(Side::B, -n, -(self.at.b_from_a * n), &shown[1], &mut active);
        if active.len() > super::super::newton::MAX_ACTIVE {
            return None;
        }
        let literal = |c: &Constraint| matches!(c, Constraint::Literal(..));
        let sum: f64 = active.iter().filter(|c| literal(&c.0)).map(|c| c.1).sum();
        let sum = if sum > 0.0 { sum } else { 1.0 };
        let (x, t) = self.sink(&active, x, t, 0.0)?;
        let (deep_x, deep_t) = self.sink(&active, x, t, level)?;
        let (task, moved) = (self.task, |t: f64| self.at_time(t));
        let tol = 16.0 * task.rounding;
        let touches = task.a.value(x).abs() <= tol && task.b.value(moved(t).b_point(x)).abs() <= tol;
        let bottom = -task.delta - task.rounding;
        let is_deep = task.a.value(deep_x) <= bottom && task.b.value(moved(deep_t).b_point(deep_x)) <= bottom;
        let ordered = 0.0 <= t && t <= deep_t && deep_t <= 1.0;
        // The proof and the point are of one time.
        let left = phi - t * speed;
        if !(touches && is_deep && ordered && left > least && left.abs() <= CLOSED * self.size()) {
            return None;
        }
        let solution = |x, t| Solution {
            x,
            t,
            active: active.iter().map(|c| c.0).collect::<Actives>(),
            lambda: active.iter().map(|c| c.1 / sum).collect::<Weights>(),
            stationarity: 0.0,
        };
        let (deep, touch) = (solution(deep_x, deep_t), solution(x, t));
        Some(Some(Found { goal: 0.5 * (t + deep_t), upper: deep_t, deep, touch: Some(touch) }))
    }

    fn size(&self) -> f64 {
        self.parts[0].primitive.ball.radius + self.parts[1].primitive.ball.radius
    }

    fn at_time(&self, t: f64) -> Instant {
        self.task.relative.at(t)
    }

    /// A point of both bodies at the time of contact.
    fn point(&self, n: DVec3, t: f64, shown: &[Shown; 2]) -> Option<DVec3> {
        let of_a = shown[0].ends.map(|p| self.centers[0] + p);
        let of_b = shown[1].ends.map(|p| self.centers[1] + p - self.w * t);
        let free = |s: &Shown| !s.flat && s.held == 0;
        if free(&shown[0]) {
            return Some(of_a[0]);
        }
        if free(&shown[1]) {
            return Some(of_b[0]);
        }
        if shown[0].flat || shown[1].flat {
            return self.on_flat(n, t, shown);
        }
        let (p, q) = (of_a[1] - of_a[0], of_b[1] - of_b[0]);
        let (start, det) = (of_b[0] - of_a[0], n.dot(p.cross(q)));
        let square = p.length_squared();
        if det.abs() > 1e-9 * square.sqrt() * q.length() {
            return Some(of_a[0] + p * (n.dot(start.cross(q)) / det));
        }
        // Along each other: the middle of what they have in common.
        let (s, r) = (start.dot(p) / square, (start + q).dot(p) / square);
        let (from, to) = (s.min(r).max(0.0), s.max(r).min(1.0));
        (from < to).then(|| of_a[0] + p * (0.5 * (from + to)))
    }

    /// The middle of what two discs have in common, or a disc and a segment.
    fn on_flat(&self, n: DVec3, t: f64, shown: &[Shown; 2]) -> Option<DVec3> {
        let centers = [self.centers[0], self.centers[1] - self.w * t];
        let disc = |k: usize| {
            let Core::Round { radii, half, .. } = self.parts[k].core else { return None };
            let outward = if k == 0 { n } else { -n };
            let upper = usize::from(outward.dot(self.parts[k].axes.z_axis) >= 0.0);
            Some((centers[k] + outward * half, radii[upper]))
        };
        let across = |v: DVec3| v - n * v.dot(n);
        match (shown[0].flat, shown[1].flat) {
            (true, true) => {
                let ((p, r), (q, s)) = (disc(0)?, disc(1)?);
                let way = across(q - p);
                let far = way.length();
                let (from, to) = (-r.min(s - far), r.min(s + far));
                let unit = if far > 0.0 { way / far } else { DVec3::ZERO };
                (from < to).then(|| p + unit * (0.5 * (from + to)))
            }
            (of_a, _) => {
                let k = usize::from(!of_a);
                let (p, r) = disc(k)?;
                let [from, to] = shown[1 - k].ends.map(|e| centers[1 - k] + e);
                // Where the segment enters and leaves the disc.
                let (o, way) = (across(from - p), across(to - from));
                let (square, along) = (way.length_squared(), o.dot(way));
                let root = along * along - square * (o.length_squared() - r * r);
                let (enter, leave) = ((-along - root.sqrt()) / square, (-along + root.sqrt()) / square);
                let (enter, leave) = (enter.max(0.0), leave.min(1.0));
                (enter < leave).then(|| from + (to - from) * (0.5 * (enter + leave)))
            }
        }
    }

    /// The least step from (x, t) to where every active constraint is met at a depth, to first order.
    fn sink(&self, active: &[(Constraint, f64)], x: DVec3, t: f64, level: f64) -> Option<(DVec3, f64)> {
        let at = self.at_time(t);
        let y = at.b_point(x);
        let time = (self.task.scale / self.w.length()).min(1.0);
        let m = active.len();
        let (mut rows, mut rhs) = ([[0.0; 4]; 6], [0.0; 6]);
        for (k, (constraint, _)) in active.iter().enumerate() {
            let (Constraint::Literal(side, id) | Constraint::Apex(side, id, _)) = *constraint;
            let (part, own) = if side == Side::A { (&self.parts[0], x) } else { (&self.parts[1], y) };
            let face = &part.primitive.faces[(id.face() - part.primitive.first_face) as usize];
            let (value, normal) = match *constraint {
                Constraint::Literal(..) => {
                    let f = face.at(own);
                    (f.value + level, f.normal)
                }
                Constraint::Apex(_, _, i) => {
                    let Face::Cone { apex, axis, sin, .. } = *face else { return None };
                    let u = any_perpendicular(axis);
                    let n = [axis, u, axis.cross(u)][i as usize];
                    (n.dot(own - apex) - if i == 0 { level / sin } else { 0.0 }, n)
                }
            };
            let (normal, rate) = if side == Side::A {
                (normal, 0.0)
            } else {
                let n = at.a_vector(normal);
                (n, n.dot(self.w) * time)
            };
            rows[k] = [normal.x, normal.y, normal.z, rate / self.task.scale];
            rhs[k] = -value / self.task.scale;
        }
        // Gram matrix of the rows, a trace of damping for redundant ones; Cholesky in place.
        let mut gram = [[0.0; 6]; 6];
        for i in 0..m {
            for j in 0..=i {
                gram[i][j] = (0..4).map(|k| rows[i][k] * rows[j][k]).sum();
            }
            gram[i][i] += 1e-13;
        }
        for j in 0..m {
            for k in 0..j {
                let l = gram[j][k];
                for i in j..m {
                    gram[i][j] -= gram[i][k] * l;
                }
            }
            if gram[j][j].is_nan() || gram[j][j] <= 0.0 {
                return None;
            }
            let r = 1.0 / gram[j][j].sqrt();
            for i in j..m {
                gram[i][j] *= r;
            }
        }
        for i in 0..m {
            for k in 0..i {
                rhs[i] -= gram[i][k] * rhs[k];
            }
            rhs[i] /= gram[i][i];
        }
        for i in (0..m).rev() {
            for k in i + 1..m {
                rhs[i] -= gram[k][i] * rhs[k];
            }
            rhs[i] /= gram[i][i];
        }
        let step: [f64; 4] = std::array::from_fn(|k| (0..m).map(|i| rows[i][k] * rhs[i]).sum());
        let x = x + DVec3::new(step[0], step[1], step[2]) * self.task.scale;
        let t = t + step[3] * time;
        (x.is_finite() && t.is_finite()).then_some((x, t))
    }
}
