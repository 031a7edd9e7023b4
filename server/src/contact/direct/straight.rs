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
//! The point follows from the features, the witness of depth delta from one linear step or a few, and both trees confirm it. What
//! does not settle, starts near, or meets in more than its faces tell is left to the advance.

use super::super::asked::Asked;
use super::super::literal::Side;
use super::super::newton::{Constraint, MAX_ACTIVE, cholesky_solve};
use super::super::outcome::{Extent, Kind, NO_FACE, Outcome, Status};
use super::super::pair::{self, INCIDENT};
use super::support::Body;
use super::{APART, Pair, excluded};
use crate::math::any_perpendicular;
use crate::solid::local::LiteralId;
use crate::solid::{Face, Primitive, Sense, Shape};
use glam::{DMat3, DQuat, DVec2, DVec3};
use smallvec::SmallVec;

/// Cutting planes at most.
const CUTS: usize = 32;
/// Gap between the bounds of the time, in lengths of the pair's size, from which features are asked, and how near to a
/// circle of directions one is held by it.
const TRIES: [(f64, f64); 4] = [(3e-2, 0.1), (1e-3, 0.03), (1e-5, 3e-3), (1e-8, 1e-4)];
/// Newton steps of one try.
const STEPS: usize = 10;
/// Further steps to where every active constraint is met at a depth.
const SINKS: usize = 4;
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

/// An active constraint where it is met; world axes.
#[derive(Clone, Copy, Default)]
struct Row {
    value: f64,
    normal: DVec3,
    /// How much its value has to fall for a depth of 1.
    sinks: f64,
    /// Curvature: across the axis, or in every direction along the surface.
    bend: f64,
    axis: DVec3,
    all: bool,
}

impl Row {
    fn hessian(&self) -> DMat3 {
        let outer = |u: DVec3| DMat3::from_cols(u * u.x, u * u.y, u * u.z) * self.bend;
        if self.bend == 0.0 {
            DMat3::ZERO
        } else if self.all {
            DMat3::from_diagonal(DVec3::splat(self.bend)) - outer(self.normal)
        } else {
            outer(self.axis.cross(self.normal).normalize_or_zero())
        }
    }
}

/// A point of the difference of the bodies: across the motion, and along it.
#[derive(Clone, Copy)]
struct Cut {
    across: DVec2,
    along: f64,
}

/// The pair along the world's axes, seen from A's centre.
pub struct Straight<'a> {
    pair: &'a Pair<'a>,
    /// World from model.
    axes: [DMat3; 2],
    parts: [Part<'a>; 2],
    bodies: [Body<'a>; 2],
}

impl<'a> Straight<'a> {
    /// The pair, where it is one for this.
    #[inline]
    pub fn new(pair: &'a Pair<'a>) -> Option<Self> {
        let [a, b] = pair.primitives;
        let axes = [pair.axes(0), pair.axes(1)];
        let place = |k: usize, p: &Primitive| {
            let frame = p.frame.rotation;
            if frame == DQuat::IDENTITY { axes[k] } else { axes[k] * DMat3::from_quat(frame) }
        };
        let (axes_a, axes_b) = (place(0, a), place(1, b));
        Some(Self {
            pair,
            axes,
            parts: [Part::new(a, axes_a)?, Part::new(b, axes_b)?],
            bodies: [Body::new(&a.shape, axes_a, DVec3::ZERO)?, Body::new(&b.shape, axes_b, pair.way)?],
        })
    }

    /// A point seen from A's centre in a body's own model.
    fn own(&self, k: usize, x: DVec3, t: f64) -> DVec3 {
        let x = if k == 0 { x } else { x - self.pair.at(t) };
        self.axes[k].transpose() * x + self.parts[k].primitive.frame.position
    }

    /// psi of a body at a point seen from A's centre.
    fn value(&self, k: usize, x: DVec3, t: f64) -> f64 {
        self.parts[k].primitive.value(self.own(k, x, t))
    }

    /// How many faces of a body pass within `tol` of a point.
    fn passing(&self, k: usize, x: DVec3, t: f64, tol: f64) -> usize {
        let own = self.own(k, x, t);
        self.parts[k].primitive.faces.iter().filter(|f| f.value(own).abs() <= tol).count()
    }

    /// Fills in the earliest contact, or leaves `out` clear; `None` leaves the pair to others. Tries are counted.
    pub fn meet(&self, asked: Asked, out: &mut Outcome) -> Option<()> {
        let (c, w) = (self.pair.way, self.pair.velocity);
        let free = excluded(self.pair.delta, self.pair.rounding).max(0.0);
        let [a, b] = &self.bodies;
        let phi = |n: DVec3| -b.reach(-n) - a.reach(n);
        let speed = w.length();
        // Along the centres: most pairs that stay apart are told at once.
        let first = phi(c);
        let rate = c.dot(w);
        let long = c.length();
        if first.min(first - rate) > free * long {
            return Some(());
        }
        if speed <= f64::MIN_POSITIVE {
            return None;
        }
        let size = self.size();
        let way = w / speed;
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
            if below.min(below - speed) > free * length {
                return Some(());
            }
            if next < TRIES.len() && above - below <= TRIES[next].0 * size {
                while next < TRIES.len() && above - below <= TRIES[next].0 * size {
                    next += 1;
                }
                out.counters.closed_forms += 1;
                if let Some((n, shown)) = self.settle(n / length, TRIES[next - 1].1)
                    && self.contact(n, &shown, asked, out).is_some()
                {
                    return Some(());
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
        let (c, w) = (self.pair.way, self.pair.velocity);
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
            let s = n.dot(w);
            if s <= 0.0 {
                return None;
            }
            let g = d - w * (n.dot(d) / s);
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
            let (mut circles, mut count) = ([(DVec2::ZERO, 0.0, 0.0); 2], 0);
            for (k, sign) in [1.0, -1.0].into_iter().enumerate() {
                for (a, lean) in self.parts[k].circles(held[k].0) {
                    let way = flat(a * sign);
                    let off = n.dot(a) * sign - lean;
                    let same =
                        circles[..count].iter().any(|h| h.0.perp_dot(way).abs() <= 1e-6 * h.0.length() * way.length());
                    if !same && count < 2 {
                        circles[count] = (way, off, lean);
                        count += 1;
                    }
                }
            }
            let step = match &circles[..count] {
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

    /// Tells the contact along n if both trees confirm it, or leaves `out` clear if it comes after the step.
    fn contact(&self, n: DVec3, shown: &[Shown; 2], asked: Asked, out: &mut Outcome) -> Option<()> {
        let pair = self.pair;
        let [a, b] = &self.bodies;
        let phi = -b.reach(-n) - a.reach(n);
        let speed = n.dot(pair.velocity);
        let least = excluded(pair.delta, pair.rounding);
        if phi <= APART * pair.delta || speed <= 0.0 {
            return None;
        }
        if phi - speed > least.max(0.0) {
            return Some(());
        }
        let t = phi / speed;
        let x = self.point(n, t, shown)?;
        let mut active: SmallVec<[(Constraint, f64); 8]> = SmallVec::new();
        self.parts[0].faces(Side::A, n, self.axes[0].transpose() * n, &shown[0], &mut active);
        let of_a = active.len();
        self.parts[1].faces(Side::B, -n, self.axes[1].transpose() * -n, &shown[1], &mut active);
        if active.len() > MAX_ACTIVE {
            return None;
        }
        let mut rows = self.rows(&active, x, t);
        let (mut x, mut t) = (x, t);
        let meets = |x: DVec3, t: f64| [self.value(0, x, t), self.value(1, x, t)];
        let tol = INCIDENT * pair.rounding;
        let touches = |x: DVec3, t: f64| meets(x, t).iter().all(|v| v.abs() <= tol);
        if !touches(x, t) {
            (x, t) = self.sink(&rows, &active, x, t, 0.0)?;
            rows = self.rows(&active, x, t);
            if !touches(x, t) {
                return None;
            }
        }
        // Round faces bend away from the first order: the deeper, the farther.
        let is_deep = |(x, t): (DVec3, f64)| meets(x, t).iter().all(|v| *v <= -pair.delta - pair.rounding);
        let mut deep = self.sink(&rows, &active, x, t, pair.witness_level())?;
        for _ in 0..SINKS {
            if is_deep(deep) {
                break;
            }
            let rows = self.rows(&active, deep.0, deep.1);
            deep = self.sink(&rows, &active, deep.0, deep.1, pair.witness_level())?;
        }
        let deep_t = deep.1;
        let is_deep = is_deep(deep);
        let ordered = 0.0 <= t && t <= deep_t && deep_t <= 1.0;
        // The proof and the point are of one time.
        let left = phi - t * speed;
        if !(is_deep && ordered && left > least && left.abs() <= CLOSED * self.size()) {
            return None;
        }

        let literal = |c: &Constraint| matches!(c, Constraint::Literal(..));
        let sum: f64 = active.iter().filter(|c| literal(&c.0)).map(|c| c.1).sum();
        let sum = if sum > 0.0 { sum } else { 1.0 };
        let mut gradients: SmallVec<[DVec3; 8]> = SmallVec::new();
        let (mut curvature, mut count) = (DMat3::ZERO, [0; 2]);
        for (k, ((c, weight), row)) in active.iter().zip(&rows).enumerate() {
            let side = usize::from(k >= of_a);
            let (Constraint::Literal(_, id) | Constraint::Apex(_, id, _)) = c;
            curvature += row.hessian() * (weight / sum);
            if !literal(c) || weight / sum > pair::ACTIVE {
                gradients.push(row.normal);
                count[side] += 1;
                let list = if side == 0 { &mut out.faces_a } else { &mut out.faces_b };
                pair::note(list, id.face());
            }
        }
        out.extent = pair::extent(&gradients, curvature, pair.scale);
        out.kind = Kind::of_active(count[0], count[1]);
        // Faces that pass through the point and hold nothing are the search's to tell.
        let faces = [&out.faces_a, &out.faces_b].map(pair::noted);
        let passing = [0, 1].map(|k| self.passing(k, x, t, tol));
        if out.kind == Kind::VertexVertex || (out.extent == Extent::Point && passing != faces) {
            (out.faces_a, out.faces_b) = ([NO_FACE; 3], [NO_FACE; 3]);
            return None;
        }
        out.status = Status::Contact;
        (out.time_lower, out.time, out.time_upper) = (t, t, deep_t);
        out.counters.times += u64::from(asked.time());
        if !asked.point() {
            // The faces were needed to trust the time.
            (out.faces_a, out.faces_b) = ([NO_FACE; 3], [NO_FACE; 3]);
            (out.kind, out.extent) = (Kind::FaceFace, Extent::Point);
            return Some(());
        }
        out.counters.contacts += 1;
        out.point = pair.point(x, t);
        out.normal = n;
        out.normal_speed = speed;
        Some(())
    }

    fn size(&self) -> f64 {
        self.parts[0].primitive.ball.radius + self.parts[1].primitive.ball.radius
    }

    /// A point of both bodies at the time of contact.
    fn point(&self, n: DVec3, t: f64, shown: &[Shown; 2]) -> Option<DVec3> {
        let of_a = shown[0].ends;
        let of_b = shown[1].ends.map(|p| self.pair.at(t) + p);
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
        let centers = [DVec3::ZERO, self.pair.at(t)];
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

    /// The active constraints at (x, t).
    fn rows(&self, active: &[(Constraint, f64)], x: DVec3, t: f64) -> [Row; MAX_ACTIVE] {
        let own = [self.own(0, x, t), self.own(1, x, t)];
        let mut rows = [Row::default(); MAX_ACTIVE];
        for (row, (constraint, _)) in rows.iter_mut().zip(active) {
            let (Constraint::Literal(side, id) | Constraint::Apex(side, id, _)) = *constraint;
            let (primitive, own) = (self.parts[side as usize].primitive, own[side as usize]);
            let face = &primitive.faces[(id.face() - primitive.first_face) as usize];
            let axes = &self.axes[side as usize];
            match (*constraint, face) {
                (Constraint::Apex(_, _, i), Face::Cone { apex, axis, sin, .. }) => {
                    let u = any_perpendicular(*axis);
                    let n = [*axis, u, axis.cross(u)][i as usize];
                    (row.value, row.normal) = (n.dot(own - *apex), *axes * n);
                    row.sinks = if i == 0 { -1.0 / sin } else { 0.0 };
                }
                _ => {
                    let f = face.at(own);
                    (row.value, row.normal, row.sinks) = (f.value, *axes * f.normal, 1.0);
                    row.bend = if f.rho > 0.0 { f.k / f.rho } else { 0.0 };
                    (row.axis, row.all) = match face {
                        Face::Cylinder { axis, .. } | Face::Cone { axis, .. } => (*axes * *axis, false),
                        _ => (DVec3::ZERO, true),
                    };
                }
            }
        }
        rows
    }

    /// The least step from (x, t) to where every active constraint is met at a depth, to first order.
    fn sink(&self, rows: &[Row], active: &[(Constraint, f64)], x: DVec3, t: f64, level: f64) -> Option<(DVec3, f64)> {
        let (scale, w) = (self.pair.scale, self.pair.velocity);
        let time = (scale / w.length()).min(1.0);
        let m = active.len();
        let (mut lines, mut rhs) = ([[0.0; 4]; 6], [0.0; 6]);
        for (k, (row, (constraint, _))) in rows.iter().zip(active).enumerate() {
            let (Constraint::Literal(side, _) | Constraint::Apex(side, _, _)) = *constraint;
            let n = row.normal;
            let rate = if side == Side::A { 0.0 } else { n.dot(w) * time / scale };
            lines[k] = [n.x, n.y, n.z, rate];
            rhs[k] = -(row.value + row.sinks * level) / scale;
        }
        // Gram matrix of the rows, a trace of damping for redundant ones.
        let mut gram = [[0.0; 6]; 6];
        for i in 0..m {
            for j in 0..=i {
                gram[i][j] = (0..4).map(|k| lines[i][k] * lines[j][k]).sum();
            }
            gram[i][i] += 1e-13;
        }
        let rhs = cholesky_solve(&mut gram, rhs, m)?;
        let step: [f64; 4] = std::array::from_fn(|k| (0..m).map(|i| lines[i][k] * rhs[i]).sum());
        let x = x + DVec3::new(step[0], step[1], step[2]) * scale;
        let t = t + step[3] * time;
        (x.is_finite() && t.is_finite()).then_some((x, t))
    }
}
