//! Lines: curves along which two bodies touch without an area.
//!
//! Candidates are the straight and the circular edges of either body, and the curves along which round faces touch: the
//! ruling of a cylinder or cone on a plane, of two parallel cylinders, the circle of a ball in a cylinder or cone. On a
//! candidate the places where any other face passes are found exactly (every face is 1-Lipschitz, so a piece whose
//! middle is farther from it than half its length is free of it), and between two of them the bodies touch everywhere or
//! nowhere: one point decides, confirmed by both whole trees. Runs of pieces that touch are the lines.

use super::local::{ANGLE, Bodies, Lit};
use super::patch::{Corner, key_of};
use super::surface::{FacePair, Standing, is_convex, standing};
use crate::contact::exclusion::literal::Side;
use crate::contact::instant::separation::Place;
use crate::solid::Sense;
use crate::solid::surface::curve::{self, Nearness, Outward};
use glam::DVec3;
use smallvec::SmallVec;
use std::f64::consts::{FRAC_PI_4, TAU};

/// Parts of a run within which its end counts as next to where it ceases to touch, and halvings by which that is found.
const NEXT_TO: f64 = 1e-6;
const HALVINGS: usize = 40;

/// A straight or circular curve, its parameter a length or an angle.
#[derive(Clone, Copy, Debug)]
pub enum Curve {
    Line { origin: DVec3, along: DVec3 },
    Circle { center: DVec3, axis: DVec3, zero: DVec3, radius: f64 },
}

/// A curve on which the bodies may touch, and the faces that make it.
#[derive(Clone, Debug)]
pub struct Candidate {
    pub curve: Curve,
    /// The faces whose common points it consists of; they do not cut it.
    pub faces: [Lit; 2],
}

/// A piece of a curve on which the bodies touch.
#[derive(Clone, Debug)]
pub struct Run {
    pub curve: Curve,
    pub from: f64,
    pub to: f64,
    /// A point of it that is no end.
    pub middle: DVec3,
    /// Feet of that point on A and B.
    pub feet: [DVec3; 2],
    pub ends: Vec<Corner>,
}

impl Curve {
    /// A curve of faces, its zero fixed in the body on `side`.
    fn of(bodies: &Bodies, side: Side, curve: curve::Curve) -> Self {
        match curve {
            curve::Curve::Line { origin, along } => Curve::Line { origin, along },
            curve::Curve::Circle { center, axis, radius } => {
                Curve::Circle { center, axis, zero: bodies.material(side, axis), radius }
            }
        }
    }

    pub fn point(&self, s: f64) -> DVec3 {
        match *self {
            Curve::Line { origin, along } => origin + along * s,
            Curve::Circle { center, axis, zero, radius } => {
                let (sin, cos) = libm::sincos(s);
                center + (zero * cos + axis.cross(zero) * sin) * radius
            }
        }
    }

    fn speed(&self) -> f64 {
        match *self {
            Curve::Line { .. } => 1.0,
            Curve::Circle { radius, .. } => radius,
        }
    }

    /// Parameter of the point next to `x`, and how far off it is.
    pub fn nearest(&self, x: DVec3) -> (f64, f64) {
        let s = match *self {
            Curve::Line { origin, along } => (x - origin).dot(along),
            Curve::Circle { center, axis, zero, .. } => {
                let d = x - center;
                d.dot(axis.cross(zero)).atan2(d.dot(zero)).rem_euclid(TAU)
            }
        };
        (s, (self.point(s) - x).length())
    }

    /// Where it goes through the plane through a point with the unit normal `axis`; a line that does not, next to the point.
    fn crossings(&self, end: DVec3, axis: DVec3, out: &mut Vec<f64>) {
        match *self {
            Curve::Line { origin, along } => {
                let closing = along.dot(axis);
                let s = (end - origin).dot(axis) / closing;
                out.push(if closing.abs() > ANGLE { s } else { self.nearest(end).0 });
            }
            Curve::Circle { center, axis: own, zero, radius } => {
                // radius (x cos s + y sin s) = z.
                let (x, y) = (zero.dot(axis), own.cross(zero).dot(axis));
                let (far, z) = (x.hypot(y) * radius, (end - center).dot(axis));
                if z.abs() < far {
                    let (middle, half) = (y.atan2(x), (z / far).acos());
                    out.extend([middle - half, middle + half].map(|s| s.rem_euclid(TAU)));
                }
            }
        }
    }

    /// The part of it that may lie in a box.
    fn range(&self, place: &Place) -> (f64, f64) {
        match *self {
            Curve::Line { origin, along } => {
                let (s, e) = ((place.center - origin).dot(along), place.half.length());
                (s - e, s + e)
            }
            Curve::Circle { .. } => (0.0, TAU),
        }
    }
}

/// The edges of one body among some of its faces.
fn edges(bodies: &Bodies, lits: &[Lit], out: &mut Vec<Candidate>) {
    for (i, p) in lits.iter().enumerate() {
        for q in &lits[i + 1..] {
            edge(bodies, *p, *q, &mut |curve| out.push(Candidate { curve, faces: [*p, *q] }));
        }
    }
}

/// Straight and circular curves that two faces have in common.
fn edge(bodies: &Bodies, p: Lit, q: Lit, found: &mut impl FnMut(Curve)) {
    let mut carried = |curve| found(Curve::of(bodies, p.0, curve));
    curve::common(bodies.face(p), bodies.face(q), bodies.size, bodies.eps, &mut carried);
}

/// The curve along which a face of one body touches one of the other without lying on it.
fn tangent(bodies: &Bodies, p: Lit, q: Lit) -> Option<Curve> {
    let [out_p, out_q] = [p, q].map(|l| Outward { face: bodies.face(l), is_convex: is_convex(l) });
    let within = Nearness { near: bodies.tau, lie: bodies.lie, size: bodies.size };
    let found = curve::tangent(out_p, out_q, |x| bodies.slant_out(q, x).1, &within);
    found.map(|curve| Curve::of(bodies, q.0, curve))
}

/// The candidates among the faces of a box.
pub fn candidates(bodies: &Bodies, place: &Place) -> Vec<Candidate> {
    candidates_among(bodies, [Side::A, Side::B].map(|s| place.lits(s)))
}

/// The candidates among some faces of A and of B.
pub fn candidates_among(bodies: &Bodies, [a, b]: [&[Lit]; 2]) -> Vec<Candidate> {
    let mut out = Vec::new();
    edges(bodies, a, &mut out);
    edges(bodies, b, &mut out);
    for p in a {
        for q in b {
            let curve = tangent(bodies, *p, *q).or_else(|| tangent(bodies, *q, *p));
            out.extend(curve.map(|curve| Candidate { curve, faces: [*p, *q] }));
        }
    }
    out
}

/// True when a box holds a curve along which the bodies touch: it need not be halved to tell points apart.
pub fn has_line(bodies: &Bodies, place: &Place) -> bool {
    candidates(bodies, place).iter().any(|c| {
        let on = |side: Side| {
            let own = c.faces.iter().any(|l| l.0 == side);
            let range = c.curve.range(place);
            own || place.lits(side).iter().any(|lit| lies_in(bodies, &c.curve, range, *lit))
        };
        on(Side::A) && on(Side::B)
    })
}

/// The point of a curve at `s`; of a straight one along a capsule the point from which its side looks as its prolongation does from
/// there. What a line does along the side it would do if both went on.
fn beside(bodies: &Bodies, curve: &Curve, lit: Lit, s: f64) -> DVec3 {
    let (x, face) = (curve.point(s), bodies.face(lit));
    let (Curve::Line { along, .. }, [Some(a), Some(b)], Some(axis)) = (*curve, face.ends(), face.axis()) else {
        return x;
    };
    let d = axis.direction;
    if along.dot(d).abs() < 0.5 {
        return x;
    }
    let (z, a, b) = (x.dot(d), a.dot(d), b.dot(d));
    x - d * (z - z.clamp(a.min(b), a.max(b)))
}

/// True when a piece of a curve lies in a face, or runs along it within the threshold, and would if it went on: more points
/// than a conic and a quadric can have in common, some of them so far beyond its ends that a curve which only bends close
/// has left.
fn lies_in(bodies: &Bodies, curve: &Curve, (from, to): (f64, f64), lit: Lit) -> bool {
    let pad = (3.0 * (bodies.lie * bodies.size).sqrt() / curve.speed()).max(to - from);
    let pad = match curve {
        // Once around: further on the same points would come again.
        Curve::Circle { .. } => pad.min(0.5 * (TAU - (to - from)).max(0.0)),
        Curve::Line { .. } => pad,
    };
    let slack = 4.0 * bodies.lie + bodies.eps;
    let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
    (0..7).all(|k| {
        let v =
            bodies.value(lit, beside(bodies, curve, lit, from - pad + (to - from + 2.0 * pad) * f64::from(k) / 6.0));
        (lo, hi) = (lo.min(v), hi.max(v));
        hi - lo <= 2.0 * slack && v.abs() <= (bodies.tau + bodies.eps).max(slack)
    })
}

/// True when no piece of a straight candidate lies in any face of a side that does not make it, all of them flat: it rises from each
/// faster than `lies_in` allows for the shortest piece.
fn leaves(bodies: &Bodies, c: &Candidate, others: &[Lit]) -> bool {
    let Curve::Line { along, .. } = c.curve else { return false };
    let least = 6.0 * (bodies.lie * bodies.size).sqrt();
    let most = 2.0 * (4.0 * bodies.lie + bodies.eps);
    let rises = |lit: &Lit| {
        bodies.work.look(1);
        // A tenth more: rounding is far less.
        bodies.face(*lit).flat().is_some_and(|(normal, _)| normal.dot(along).abs() * least > 1.1 * most)
    };
    let without = |side: Side| c.faces.iter().all(|l| l.0 != side) && others.iter().filter(|l| l.0 == side).all(rises);
    without(Side::A) || without(Side::B)
}

/// True when the straight way between two points of a pair's flat patch leaves it nowhere.
pub fn sees(bodies: &Bodies, pair: &FacePair, lits: &[Lit], x: DVec3, y: DVec3) -> bool {
    let Some(along) = (y - x).try_normalize() else { return true };
    let (curve, length) = (Curve::Line { origin: x, along }, (y - x).length());
    let mut stops = vec![0.0, length];
    for lit in lits {
        crossings(bodies, &curve, *lit, (0.0, length), &mut stops);
    }
    stops.sort_by(f64::total_cmp);
    stops
        .windows(2)
        .filter(|w| w[1] - w[0] > 1e-6 * length)
        .all(|w| standing(bodies, pair, curve.point(0.5 * (w[0] + w[1]))) != Standing::Outside)
}

/// A literal along a curve, less a level. Of a flat one along a line what is farther from zero than rounding is known without a look.
struct Along<'b, 't, 'a> {
    bodies: &'b Bodies<'t, 'a>,
    curve: &'b Curve,
    lit: Lit,
    level: f64,
    /// Value at parameter 0, what it gains a unit of length, and by how much rounding may move either way of working it out.
    law: Option<[f64; 3]>,
}

impl<'b, 't, 'a> Along<'b, 't, 'a> {
    fn new(bodies: &'b Bodies<'t, 'a>, curve: &'b Curve, lit: Lit, level: f64, (from, to): (f64, f64)) -> Self {
        let law = match (*curve, bodies.face(lit).flat()) {
            (Curve::Line { origin, along }, Some((normal, offset))) => {
                let sign = if lit.1.sense() == Sense::Positive { 1.0 } else { -1.0 };
                let far = origin.length() + from.abs().max(to.abs()) + offset.abs() + level;
                Some([
                    sign * (normal.dot(origin) - offset) - level,
                    sign * normal.dot(along),
                    SURE * f64::EPSILON * far,
                ])
            }
            _ => None,
        };
        Self { bodies, curve, lit, level, law }
    }

    fn value(&self, s: f64) -> f64 {
        self.bodies.value(self.lit, self.curve.point(s)) - self.level
    }

    /// The sign of `value(s) − level` where that is beyond doubt.
    fn side(&self, s: f64, level: f64) -> Option<bool> {
        let [at, gain, doubt] = self.law?;
        let v = at + gain * s - level;
        (v.abs() > doubt).then_some(v < 0.0)
    }

    fn is_negative(&self, s: f64) -> bool {
        self.side(s, 0.0).unwrap_or_else(|| self.value(s) < 0.0)
    }

    /// True when the value's amount is more than `reach`.
    fn is_beyond(&self, s: f64, reach: f64) -> bool {
        match (self.side(s, reach), self.side(s, -reach)) {
            (Some(false), _) | (_, Some(true)) => true,
            (Some(true), Some(false)) => false,
            _ => self.value(s).abs() > reach,
        }
    }

    /// Roots in [from, to]: a value changes along the curve by as much as its points move, at most.
    fn roots(&self, (from, to): (f64, f64), out: &mut Vec<f64>) {
        let (speed, least) = (self.curve.speed(), 1e-4 * self.bodies.size);
        if let [Some(first), Some(last)] = [from, to].map(|s| self.side(s, 0.0))
            && first == last
        {
            // Linear: nor does it pass zero between them.
            return;
        }
        if self.is_steep(least) {
            // All but one of the pieces below end on one side of zero.
            let below = self.is_negative(from);
            if below != self.is_negative(to) {
                out.push(self.root((from, to), below, least));
            }
            return;
        }
        let mut stack = vec![(from, to)];
        while let Some((s, e)) = stack.pop() {
            let m = 0.5 * (s + e);
            if self.is_beyond(m, 0.5 * (e - s) * speed) || self.bodies.work.is_spent() {
                continue;
            }
            if (e - s) * speed > least {
                stack.extend([(m, e), (s, m)]);
                continue;
            }
            let below = self.is_negative(s);
            if below != self.is_negative(e) {
                out.push(self.root((s, e), below, least));
            }
        }
    }

    /// True when the value passes zero once and no piece of a curve as long as `least` is within rounding of it.
    fn is_steep(&self, least: f64) -> bool {
        self.law.is_some_and(|[_, gain, doubt]| gain.abs() * least > 8.0 * doubt)
    }

    /// The root between two parameters of which one is below zero: the first one or the last one. Halved until the numbers are
    /// neighbours, at most 80 times below `least`.
    fn root(&self, (mut lo, mut hi): (f64, f64), below: bool, least: f64) -> f64 {
        let mut left = 80;
        loop {
            let m = 0.5 * (lo + hi);
            if (hi - lo) * self.curve.speed() <= least {
                // Neighbours: it stays so.
                if left == 0 || m == lo || m == hi {
                    return m;
                }
                left -= 1;
            }
            if self.is_negative(m) == below { lo = m } else { hi = m }
        }
    }
}

/// Roundings, of the numbers that a flat literal's value along a line is made of, beyond which its sign is known: some ten are made.
const SURE: f64 = 64.0;

/// Parameters in [from, to] at which a face passes through the curve.
fn crossings(bodies: &Bodies, curve: &Curve, lit: Lit, (from, to): (f64, f64), out: &mut Vec<f64>) {
    let along = Along::new(bodies, curve, lit, 0.0, (from, to));
    // A curve that lies in a face (more common points than a conic and a quadric can have) has no crossing with it.
    let near = bodies.lie + bodies.eps;
    if (0..6).all(|k| !along.is_beyond(from + (to - from) * (0.07 + 0.15 * f64::from(k)), near)) {
        return;
    }
    // Nor has one that lies in a capsule's side, but where that ends.
    let aside =
        |k: u32| bodies.value(lit, beside(bodies, curve, lit, from + (to - from) * (0.07 + 0.15 * f64::from(k))));
    if bodies.face(lit).ends()[0].is_some() && (0..6).all(|k| aside(k).abs() <= near) {
        return;
    }
    along.roots((from, to), out);
}

/// The feet of a point of a candidate on both bodies where they touch there: on faces of each, within the threshold,
/// confirmed by the whole trees.
fn touches(bodies: &Bodies, faces: &[Lit; 2], others: &[Lit], x: DVec3) -> Option<[DVec3; 2]> {
    // An edge lies on its own body, and beyond its ends it is none; a tangent curve lies on the face it was taken from.
    let foot_on = |side: Side| {
        if bodies.f(side, x).abs() <= bodies.eps {
            return Some(x);
        }
        // Over the brim of a face that makes it the curve runs along that face no more, though the brim is near.
        let from = if faces.iter().any(|l| l.0 == side) { faces } else { others };
        from.iter()
            .filter(|l| l.0 == side && bodies.value(**l, x).abs() <= bodies.tau + bodies.eps)
            .map(|l| bodies.foot(*l, x))
            .find(|y| bodies.f(side, *y).abs() <= bodies.eps)
    };
    let feet = [foot_on(Side::A)?, foot_on(Side::B)?];
    let near = (feet[1] - feet[0]).length() <= bodies.tau + bodies.eps;
    (near && bodies.is_bodily(Side::A, feet[0]) && bodies.is_bodily(Side::B, feet[1])).then_some(feet)
}

/// True when a face is as far from a point as the feet that the point has on both bodies are from each other: it holds one of them.
fn is_as_far(bodies: &Bodies, x: DVec3, feet: [DVec3; 2], lit: Lit) -> bool {
    (bodies.value(lit, x).abs() - (feet[1] - feet[0]).length()).abs() <= bodies.eps
}

/// True where a straight candidate has left the face along which it runs: a capsule's side ends where its balls begin, which are no
/// part of the line though they are within the threshold for a while.
fn is_past_ends(bodies: &Bodies, c: &Candidate, others: &[Lit], x: DVec3, feet: [DVec3; 2]) -> bool {
    let Curve::Line { .. } = c.curve else { return false };
    let is_past = |lit: &Lit| {
        let face = bodies.face(*lit);
        let ([Some(a), Some(b)], Some(axis)) = (face.ends(), face.axis()) else { return false };
        (x - a).dot(axis.direction) * (x - b).dot(axis.direction) > 0.0
    };
    let holds = |lit: &Lit| is_as_far(bodies, x, feet, *lit);
    c.faces.iter().any(is_past) || others.iter().any(|lit| is_past(lit) && holds(lit))
}

/// The runs of a candidate on which the bodies touch and no patch holds them already.
pub fn runs(bodies: &Bodies, c: &Candidate, places: &[&Place], in_patch: &dyn Fn(DVec3) -> bool) -> Vec<Run> {
    let mut others: SmallVec<[Lit; 16]> = places
        .iter()
        .flat_map(|p| [Side::A, Side::B].into_iter().flat_map(|s| p.lits(s)))
        .filter(|l| !c.faces.contains(l))
        .copied()
        .collect();
    others.sort_unstable();
    others.dedup();
    let range = places.iter().map(|p| c.curve.range(p)).reduce(|r, s| (r.0.min(s.0), r.1.max(s.1)));
    range.map_or(Vec::new(), |range| runs_within(bodies, c, range, &others, in_patch))
}

/// The same between two parameters; `others`: the faces that do not make the candidate.
pub fn runs_within(
    bodies: &Bodies,
    c: &Candidate,
    range: (f64, f64),
    others: &[Lit],
    in_patch: &dyn Fn(DVec3) -> bool,
) -> Vec<Run> {
    if leaves(bodies, c, others) { Vec::new() } else { runs_among(bodies, c, range, others, in_patch) }
}

/// The same, whether it leaves all others or not.
fn runs_among(
    bodies: &Bodies,
    c: &Candidate,
    range: (f64, f64),
    others: &[Lit],
    in_patch: &dyn Fn(DVec3) -> bool,
) -> Vec<Run> {
    let Some(stops) = stops(bodies, c, others, range) else { return Vec::new() };
    let round = matches!(c.curve, Curve::Circle { .. });
    let whole = |s: f64| {
        let x = c.curve.point(s);
        touches(bodies, &c.faces, others, x).filter(|feet| !is_past_ends(bodies, c, others, x, *feet))
    };
    let mut pieces = Vec::new();
    for w in stops.windows(2) {
        let middle = 0.5 * (w[0] + w[1]);
        if in_patch(c.curve.point(middle)) {
            pieces.push(Piece { from: w[0], to: w[1], feet: None });
            continue;
        }
        let feet = whole(middle);
        let mut bounds = departures(bodies, c, others, (w[0], w[1]), feet, &whole);
        if bounds.is_empty() {
            pieces.push(Piece { from: w[0], to: w[1], feet });
            continue;
        }
        bounds.insert(0, w[0]);
        bounds.push(w[1]);
        let part = |w: &[f64]| Piece { from: w[0], to: w[1], feet: whole(0.5 * (w[0] + w[1])) };
        pieces.extend(bounds.windows(2).map(part));
    }
    let mut out = joined(&c.curve, pieces);
    // A curve that only bends close to a face is no line: it would leave it if it went on. One that lies in it stays.
    out.retain(|run| {
        let on = |side: Side| {
            // The faces that make it hold it by construction.
            let own = c.faces.iter().any(|l| l.0 == side);
            // The face that holds the feet of the middle: another one that the run lies in may end before.
            let is_held = |l: &Lit| l.0 == side && is_as_far(bodies, run.middle, run.feet, *l);
            own || others.iter().any(|l| is_held(l) && lies_in(bodies, &c.curve, (run.from, run.to), *l))
        };
        on(Side::A) && on(Side::B)
    });
    let key = [key_of(c.faces[0]), key_of(c.faces[1]), 0];
    for run in &mut out {
        let corner = |(i, s): (usize, f64)| {
            let x = c.curve.point(s);
            // An end over the brim of the other body has no foot on it: its gap is that from the face that holds the middle's. Where there
            // is no such face (an apex), that of the middle.
            let beyond = || {
                let gap = (run.feet[1] - run.feet[0]).length();
                let held = others.iter().find(|l| is_as_far(bodies, run.middle, run.feet, **l));
                let foot = held.map(|l| bodies.foot(*l, x));
                foot.map_or((x, gap), |y| ((x + y) * 0.5, (y - x).length()))
            };
            let feet = touches(bodies, &c.faces, others, x).or_else(|| brim(&c.curve, (run.middle, s), &whole));
            let (x, gap) = feet.map_or_else(beyond, |f| ((f[0] + f[1]) * 0.5, (f[1] - f[0]).length()));
            Corner { x, gap, key: [key[0], key[1], i as u64] }
        };
        run.ends = ends(run, round).into_iter().enumerate().map(corner).collect();
    }
    out
}

/// The feet where a straight run that has none at its end ceases to touch, on the way to that end from a point of it: at the brim of a
/// part of which what lies beyond is no part of the body, so that no other face passes there. `None` where that is next to the end.
fn brim(curve: &Curve, (from, end): (DVec3, f64), touches: &dyn Fn(f64) -> Option<[DVec3; 2]>) -> Option<[DVec3; 2]> {
    let Curve::Line { .. } = curve else { return None };
    let (mut within, mut beyond) = (curve.nearest(from).0, end);
    if touches(end + (within - end) * NEXT_TO).is_some() {
        return None;
    }
    let mut feet = touches(within)?;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (within + beyond);
        match touches(middle) {
            Some(found) => (within, feet) = (middle, found),
            None => beyond = middle,
        }
    }
    Some(feet)
}

/// Where between two stops a candidate's curve leaves the threshold, in order: it may lean against the face along which it runs.
/// `inner`: the feet of its middle where the bodies touch there.
fn departures(
    bodies: &Bodies,
    c: &Candidate,
    others: &[Lit],
    (from, to): (f64, f64),
    inner: Option<[DVec3; 2]>,
    touches: &dyn Fn(f64) -> Option<[DVec3; 2]>,
) -> Vec<f64> {
    // Beyond the end of an edge there is no surface: no gap has been left there.
    let x = c.curve.point(0.5 * (from + to));
    if inner.is_none() && [Side::A, Side::B].iter().all(|side| bodies.f(*side, x).abs() > bodies.eps) {
        return Vec::new();
    }
    let ends = [from, to].map(|s| (s, touches(s)));
    if ends.iter().all(|(_, feet)| feet.is_some() == inner.is_some()) {
        return Vec::new();
    }
    let near = inner.map(|feet| (0.5 * (from + to), feet));
    let Some((s, feet)) = near.or_else(|| ends.into_iter().find_map(|(s, feet)| Some((s, feet?)))) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    for lit in c.faces.iter().chain(others) {
        // Of the face that it is near to and runs along: another one it only passes.
        if is_as_far(bodies, c.curve.point(s), feet, *lit) && lies_in(bodies, &c.curve, (from, to), *lit) {
            Along::new(bodies, &c.curve, *lit, bodies.tau, (from, to)).roots((from, to), &mut found);
        }
    }
    found.sort_by(f64::total_cmp);
    found
}

/// Where a candidate's curve may begin or cease to touch, in order; of a circle once around. `None` where the work is spent.
fn stops(bodies: &Bodies, c: &Candidate, others: &[Lit], range: (f64, f64)) -> Option<Vec<f64>> {
    let mut stops = Vec::new();
    for lit in others {
        if bodies.work.is_spent() {
            return None;
        }
        crossings(bodies, &c.curve, *lit, range, &mut stops);
    }
    for lit in &c.faces {
        // A ruling ends at its apex.
        if let (Some(apex), Curve::Line { .. }) = (bodies.face(*lit).apex(), c.curve) {
            stops.push(c.curve.nearest(apex.point).0);
        }
    }
    for lit in c.faces.iter().chain(others) {
        let face = bodies.face(*lit);
        for end in face.ends().into_iter().flatten() {
            c.curve.crossings(end, face.axis().map_or(DVec3::ZERO, |a| a.direction), &mut stops);
        }
    }
    stops.sort_by(f64::total_cmp);
    let merge = 1e-9 * bodies.size / c.curve.speed();
    stops.dedup_by(|b, a| *b - *a <= merge);
    if let Curve::Circle { .. } = c.curve {
        // Once around, starting at the first stop.
        let first = stops.first().copied().unwrap_or(0.0);
        if stops.is_empty() {
            stops.push(first);
        }
        stops.push(first + TAU);
    }
    Some(stops)
}

/// A curve between two stops, and the feet of its middle where the bodies touch there.
struct Piece {
    from: f64,
    to: f64,
    feet: Option<[DVec3; 2]>,
}

/// Runs of pieces that follow each other and touch; without their ends.
fn joined(curve: &Curve, mut pieces: Vec<Piece>) -> Vec<Run> {
    // A circle starts behind a piece that does not touch, so that no run is cut at its first stop.
    if let Curve::Circle { .. } = curve
        && let Some(i) = pieces.iter().position(|p| p.feet.is_none())
    {
        pieces.rotate_left(i);
        for k in 1..pieces.len() {
            while pieces[k].from < pieces[k - 1].from {
                pieces[k].from += TAU;
                pieces[k].to += TAU;
            }
        }
    }
    let mut out: Vec<Run> = Vec::new();
    let mut open = false;
    for Piece { from, to, feet } in pieces {
        let Some(feet) = feet else {
            open = false;
            continue;
        };
        match out.last_mut().filter(|_| open) {
            Some(run) => run.to = to,
            None => {
                let middle = curve.point(0.5 * (from + to));
                out.push(Run { curve: *curve, from, to, middle, feet, ends: Vec::new() });
            }
        }
        open = true;
    }
    out
}

/// Parameters of the points by which a run is told: its ends, of arcs also points in eight directions that are fixed in a body.
fn ends(run: &Run, round: bool) -> Vec<f64> {
    if round && run.to - run.from >= TAU - 1e-9 {
        return (0..8).map(|k| f64::from(k) * FRAC_PI_4).collect();
    }
    let mut ends = vec![run.from, run.to];
    if round {
        let marks = (0..16).map(|k| f64::from(k) * FRAC_PI_4);
        ends.extend(marks.filter(|s| *s > run.from + 1e-6 && *s < run.to - 1e-6));
    }
    ends
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::instant::separation::Cover;
    use crate::contact::instant::work::Work;
    use crate::contact::query::options::QueryOptions;
    use crate::contact::query::question::{PairQuery, PlacedModel, Strategies, default_resolution};
    use crate::contact::query::task::Task;
    use crate::math::random::Random;
    use crate::motion::Placed;
    use crate::octree::testing::simple;
    use crate::solid::primitive::Cuboid;
    use contactd_proto::motion::quat_of_rotation_vector;
    use contactd_proto::{Motion, Pose};
    use glam::dvec3;

    /// Shows two random boxes that lie on each other, one of them tilted a little, as bodies with a cover of what is near.
    fn each_pair(seed: u64, count: usize, mut seen: impl FnMut(&Bodies, &[Place], &mut Random)) {
        let mut r = Random(seed);
        for i in 0..count {
            let mut half = || dvec3(r.within(0.2, 1.0), r.within(0.2, 1.0), r.within(0.2, 1.0));
            let (own, other) = (half(), half());
            let (slab, block) = (simple(Cuboid { half: own }), simple(Cuboid { half: other }));
            let tilt = [0.0, 1e-5, 1e-3, 0.03, 0.1, 0.5][i % 6];
            let turn = quat_of_rotation_vector(
                r.vector(1.0) * DVec3::Z + dvec3(r.within(-tilt, tilt), r.within(-tilt, tilt), 0.0),
            );
            let lowest =
                [-1.0, 1.0].into_iter().flat_map(|x| [-1.0, 1.0].map(|y| (turn * (other * dvec3(x, y, -1.0))).z));
            let up = own.z - lowest.fold(f64::INFINITY, f64::min) + r.within(-2e-4, 8e-4);
            let frame = Pose::new(r.vector(3.0), quat_of_rotation_vector(r.vector(2.0)));
            let placed = |pose| Placed { place: Pose::IDENTITY, motion: Motion::resting(pose) };
            let on_it = Pose::new(dvec3(r.within(-0.3, 0.3), r.within(-0.3, 0.3), up), turn);
            let query = PairQuery {
                a: PlacedModel { model: &slab, placed: placed(frame) },
                b: PlacedModel { model: &block, placed: placed(frame.compose(&on_it)) },
                resolution: default_resolution(&slab, &block),
                cell_limit: 1000,
                strategies: Strategies::default(),
                query_options: QueryOptions::DEPTH,
            };
            let (task, _) = Task::of(&query);
            let (instant, work) = (task.relative.at(0.0), Work::new(1_000_000));
            let bodies = Bodies::new(&task, &instant, 1e-3, &work);
            let mut cover = Cover::new(&task, &instant, bodies.tau, bodies.tau, &work);
            let places: Vec<Place> = std::iter::from_fn(|| cover.next(0.5 * bodies.tau)).collect();
            seen(&bodies, &places, &mut r);
        }
    }

    #[test]
    fn what_is_known_of_a_plane_along_a_line_is_what_a_look_says() {
        let mut counts = [0; 4];
        each_pair(0x0061_6c6f_6e67, 120, |bodies, places, r| {
            for place in places {
                for c in candidates(bodies, place) {
                    let range = c.curve.range(place);
                    for lit in
                        [Side::A, Side::B].iter().flat_map(|s| place.lits(*s)).copied().filter(|l| !c.faces.contains(l))
                    {
                        let along = Along::new(bodies, &c.curve, lit, 0.0, range);
                        let Some([at, gain, _]) = along.law else { panic!("a plane along a line has a law") };
                        for _ in 0..40 {
                            // Anywhere, and next to where the value is the level: from far roundings to none.
                            let reach = if r.unit() < 0.5 { 0.0 } else { r.within(0.0, 1e-3) };
                            let level = if r.unit() < 0.5 { reach } else { -reach };
                            let near = (level - at) / gain + r.within(-1.0, 1.0) * 10f64.powf(r.within(-17.0, -1.0));
                            let s = if near.abs() < 3.0 { near } else { r.within(range.0, range.1) };
                            let v = along.value(s);
                            assert_eq!(along.is_negative(s), v < 0.0, "{s} of {:?}: {v}", along.law);
                            assert_eq!(
                                along.is_beyond(s, reach),
                                v.abs() > reach,
                                "{s}, {reach} of {:?}: {v}",
                                along.law
                            );
                            counts[usize::from(along.side(s, 0.0).is_some())] += 1;
                            counts[2 + usize::from(v < 0.0)] += 1;
                        }
                    }
                }
            }
        });
        assert!(counts.iter().all(|n| *n > 1000), "looked at, known, outside, inside: {counts:?}");
    }

    #[test]
    fn a_candidate_that_leaves_all_faces_has_no_run() {
        let (mut left, mut stayed, mut ran) = (0, 0, 0);
        each_pair(0x6c65_6176_6573, 360, |bodies, places, _| {
            for place in places {
                let lits = [Side::A, Side::B].map(|s| place.lits(s)).concat();
                for c in candidates(bodies, place) {
                    let others: Vec<Lit> = lits.iter().filter(|l| !c.faces.contains(l)).copied().collect();
                    let runs = runs_among(bodies, &c, c.curve.range(place), &others, &|_| false);
                    let leaves = leaves(bodies, &c, &others);
                    assert!(!leaves || runs.is_empty(), "{c:?} is said to leave, and runs {runs:?}");
                    left += usize::from(leaves);
                    stayed += usize::from(!leaves);
                    ran += usize::from(!runs.is_empty());
                }
            }
        });
        assert!(left > 150 && stayed > 500 && ran > 300, "{left} leave, {stayed} stay, {ran} of these touch");
    }
}
