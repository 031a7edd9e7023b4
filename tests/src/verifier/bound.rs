//! Is Σ λ_i ℓ_i positive over a box and a span of time? ℓ_i = ±psi_i + delta, which a contact needs to be <= 0.
//!
//! A convex literal is replaced by its tangent plane at the recorded point, which lies below it whatever the point is; a
//! concave one is taken as it is. The sum is bounded by its mean-value form of second order (value and gradient at the
//! middle, Hessian over the box) and by its gradient over the box; where that does not suffice the box or the span is
//! halved, up to a budget. A budget that runs out is a refusal.

use super::form::{along, halves, image, parts_of_saddle, rows_of_bowl, walled};
use super::interval::{
    Interval, Jet, Vector, ZERO, across, dot, hull, length, linear, minus, offsets, place, point, square_length, times,
    unit, vector,
};
use super::motion::{Motions, in_a};
use super::norm;
use super::tangent::{part_of, tangent};
use contactd::solid::{Face, Solid, surface};
use glam::DVec3;

/// A face of a body with its sense.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Literal {
    /// Of the body that does not carry the cells.
    pub on_b: bool,
    /// Face id in its solid.
    pub face: u32,
    /// −psi.
    pub negative: bool,
}

/// A literal with its multiplier, or the fit of two.
#[derive(Clone, Copy, Debug)]
pub struct Term {
    /// The literal; the positive one of a fit.
    pub literal: Literal,
    /// The negative one of a fit.
    pub other: Option<Literal>,
    /// Multiplier at the start and the end of the span; linear between.
    pub lambda: [f64; 2],
    /// Point of contact of the tangent, frame of the literal's body; of a fit's convex part in the reference body's frame.
    pub point: DVec3,
}

/// What is bounded.
pub struct Bounder<'a> {
    /// The reference body.
    pub a: &'a Solid,
    /// The other body.
    pub b: &'a Solid,
    /// How they move.
    pub motions: Motions,
    /// Depth.
    pub depth: f64,
    /// Evaluations so far.
    pub evaluations: u64,
    /// Boxes that a combination may take.
    pub budget: u64,
    /// A budget ran out: what was not shown may hold.
    pub exhausted: bool,
}

/// A box of A and a span of time.
#[derive(Clone, Copy, Debug)]
pub struct Region(pub [(f64, f64); 4]);

/// Evaluations that one combination may cost.
pub const BUDGET: u64 = 40_000;

impl Bounder<'_> {
    fn face(&self, l: &Literal) -> Option<&Face> {
        (if l.on_b { self.b } else { self.a }).faces.get(l.face as usize)
    }

    /// True when it is certain that the literals of `terms` never hold together in the region.
    pub fn excludes(&mut self, terms: &[Term], region: Region) -> bool {
        let known = |l: &Literal| self.face(l).is_some();
        let fine = terms.iter().all(|t| {
            t.lambda.iter().all(|l| *l >= 0.0 && l.is_finite())
                && known(&t.literal)
                && t.other.as_ref().is_none_or(known)
        });
        let some = |k: usize| terms.iter().any(|t| t.lambda[k] > 0.0);
        let span = region.0[3];
        fine && some(0)
            && some(1)
            && self.positive(region, &|s: &Self, x, t| s.sum(terms, span, x, t), &|s, r| s.at_corners(terms, span, r))
    }

    /// True when it is certain that the literal holds with room everywhere in the region.
    pub fn holds(&mut self, l: &Literal, region: Region) -> bool {
        self.face(l).is_some()
            && self.positive(
                region,
                &|s: &Self, x, t| {
                    let jet = s.psi(s.face(l)?, &s.coordinates(l.on_b, x, t));
                    // −(±psi) − depth > 0.
                    Some(jet.scaled(point(if l.negative { 1.0 } else { -1.0 })).plus(point(-s.depth)))
                },
                &|_, _| f64::NEG_INFINITY,
            )
    }

    /// `at_corners` is another lower bound, asked for where second derivatives are not known.
    fn positive(
        &mut self,
        region: Region,
        f: &dyn Fn(&Self, Vector, Interval) -> Option<Jet>,
        at_corners: &dyn Fn(&Self, Region) -> f64,
    ) -> bool {
        let mut stack = vec![region];
        let mut left = self.budget;
        while let Some(r) = stack.pop() {
            if left == 0 {
                self.exhausted = true;
                return false;
            }
            left -= 1;
            self.evaluations += 1;
            let of = |k: usize| Interval::new(r.0[k].0, r.0[k].1);
            let mid: [f64; 4] = std::array::from_fn(|k| {
                let m = 0.5 * (r.0[k].0 + r.0[k].1);
                m.clamp(r.0[k].0, r.0[k].1)
            });
            let Some(center) = f(self, vector([mid[0], mid[1], mid[2]]), point(mid[3])) else { return false };
            if center.v.hi <= 0.0 || center.v.lo.is_nan() {
                return false;
            }
            let Some(whole) = f(self, [of(0), of(1), of(2)], of(3)) else { return false };
            let y: [Interval; 4] = std::array::from_fn(|k| of(k) - point(mid[k]));
            let (mut second, mut first) = (center.v, center.v);
            let mut cost = [0.0; 4];
            for k in 0..4 {
                second = second + center.g[k] * y[k];
                first = first + whole.g[k] * y[k];
                for j in k..4 {
                    let h = whole.h[place(k, j)];
                    let q = if j == k { point(0.5) * h * y[k].square() } else { h * (y[k] * y[j]) };
                    second = second + q;
                    let c = if q.lo.is_finite() { -q.lo } else { y[k].mag() * y[j].mag() };
                    // Halving the time makes the coefficient of a mixed term tighter, too.
                    cost[if j == 3 { 3 } else { k }] += c.max(0.0);
                    cost[j] += c.max(0.0);
                }
                cost[k] += (whole.g[k].hi - whole.g[k].lo).min(1e3) * y[k].mag() * 1e-9;
            }
            let best = [whole.v.lo, second.lo, first.lo].into_iter().fold(f64::NEG_INFINITY, f64::max);
            let is_singular = !second.lo.is_finite();
            if best > 0.0 || is_singular && at_corners(self, r) > 0.0 {
                continue;
            }
            let k = (0..4).max_by(|a, b| cost[*a].total_cmp(&cost[*b])).unwrap_or(0);
            // What holds at the corners at one time fails for the span alone.
            let mut instant = r;
            instant.0[3] = (mid[3], mid[3]);
            let k = if is_singular && at_corners(self, instant) > 0.0 { 3 } else { k };
            let k = if r.0[k].0 < mid[k] && mid[k] < r.0[k].1 {
                k
            } else {
                let Some(k) = (0..4).find(|k| r.0[*k].0 < mid[*k] && mid[*k] < r.0[*k].1) else { return false };
                k
            };
            for half in [(mid[k], r.0[k].1), (r.0[k].0, mid[k])] {
                let mut part = r;
                part.0[k] = half;
                stack.push(part);
            }
        }
        true
    }

    /// A lower bound of the sum over a region near the axes of its faces, where nothing is known of curvatures. −psi (of a torus
    /// −`above`) and what `tangent` gives are concave or linear in space, and both change by no more than a point's way: with the literals as they are in the
    /// middle of the time t_m
    ///
    /// ```text
    /// Σ λ_i(t) ℓ_i(x, t) >= Σ λ_i(t) [ℓ_i(x, t_m) − max |ẏ_i| ½(t_1 − t_0)],
    /// ```
    ///
    /// which is least at a corner of the box, at one end of the time.
    fn at_corners(&self, terms: &[Term], span: (f64, f64), r: Region) -> f64 {
        if terms.iter().any(|t| t.other.is_some()) {
            return f64::NEG_INFINITY;
        }
        let (t0, t1) = r.0[3];
        let middle = (0.5 * (t0 + t1)).clamp(t0, t1);
        let all: Vector = std::array::from_fn(|k| Interval::new(r.0[k].0, r.0[k].1));
        let moving = self.motions.in_b(all, Interval::new(t0, t1));
        let speed = length(std::array::from_fn(|i| moving[i].g[3])).hi;
        let part = |t: f64| {
            let whole = point(span.1) - point(span.0);
            if span.1 > span.0 { (point(t) - point(span.0)) * whole.recip() } else { point(0.0) }
        };
        let center: Vector = std::array::from_fn(|k| point((0.5 * (r.0[k].0 + r.0[k].1)).clamp(r.0[k].0, r.0[k].1)));
        let centers = [in_a(center), self.motions.in_b(center, point(middle))];
        let beside = centers.map(|c| DVec3::from_array(c.map(|x| 0.5 * (x.v.lo + x.v.hi))));
        let away = (point(middle) - point(t0)).mag().max((point(t1) - point(middle)).mag());
        let mut least = f64::INFINITY;
        for corner in 0..8u32 {
            let x: Vector = std::array::from_fn(|k| point(if corner >> k & 1 == 0 { r.0[k].0 } else { r.0[k].1 }));
            let at_corner = self.through_time(terms, span, x, (t0, middle, t1), beside);
            if at_corner.is_some_and(|v| v > 0.0) {
                least = least.min(at_corner.unwrap_or(f64::NEG_INFINITY));
                continue;
            }
            let (a, b) = (in_a(x), self.motions.in_b(x, point(middle)));
            for t in [t0, t1] {
                let s = part(t);
                let mut sum = point(0.0);
                for term in terms {
                    let Some(face) = self.face(&term.literal) else { return f64::NEG_INFINITY };
                    let y = if term.literal.on_b { &b } else { &a };
                    let value = match term.literal.negative {
                        true => point(0.0) - self.above(face, beside[usize::from(term.literal.on_b)], y).v,
                        false => tangent(face, term.point, y).v,
                    };
                    let lambda = point(term.lambda[0]) + s * (point(term.lambda[1]) - point(term.lambda[0]));
                    let lambda = Interval::new(lambda.lo.max(0.0), lambda.hi.max(0.0));
                    let way = if term.literal.on_b { point(speed) * point(away) } else { point(0.0) };
                    sum = sum + lambda * (value + point(self.depth) - way);
                }
                least = least.min(sum.lo);
            }
        }
        least
    }

    /// The same sum at one point of A through a span of time, to second order in it: being concave in space at each time, over a box
    /// the sum is least at a corner at each time.
    fn through_time(
        &self,
        terms: &[Term],
        span: (f64, f64),
        x: Vector,
        (t0, middle, t1): (f64, f64, f64),
        beside: [DVec3; 2],
    ) -> Option<f64> {
        let sum = |t: Interval| {
            let (a, b) = (in_a(x), self.motions.in_b(x, t));
            let mut sum = Jet::constant(ZERO);
            for term in terms {
                let y = if term.literal.on_b { &b } else { &a };
                let face = self.face(&term.literal)?;
                let value = match term.literal.negative {
                    true => self.above(face, beside[usize::from(term.literal.on_b)], y).scaled(point(-1.0)),
                    false => tangent(face, term.point, y),
                };
                sum = sum + weighted(&value.plus(point(self.depth)), term.lambda, span, t);
            }
            Some(sum)
        };
        let (at, whole) = (sum(point(middle))?, sum(Interval::new(t0, t1))?);
        let dt = Interval::new(t0, t1) - point(middle);
        let second = at.v + at.g[3] * dt + point(0.5) * whole.h[place(3, 3)] * dt.square();
        Some(whole.v.lo.max(second.lo))
    }

    fn coordinates(&self, on_b: bool, x: Vector, t: Interval) -> [Jet; 3] {
        if on_b { self.motions.in_b(x, t) } else { in_a(x) }
    }

    /// A point fixed in A, in the coordinates of one of the bodies: it depends on time alone.
    fn fixed(&self, on_b: bool, x: Vector, t: Interval) -> [Jet; 3] {
        if !on_b {
            return x.map(Jet::constant);
        }
        let mut y = self.motions.in_b(x, t);
        for jet in &mut y {
            for k in 0..3 {
                jet.g[k] = ZERO;
                for j in k..4 {
                    jet.h[place(k, j)] = ZERO;
                }
            }
        }
        y
    }

    /// Σ λ_i(t) ℓ_i, the multipliers linear over the span.
    fn sum(&self, terms: &[Term], span: (f64, f64), x: Vector, t: Interval) -> Option<Jet> {
        let is_on_b = |term: &Term| term.literal.on_b || term.other.is_some();
        let a = in_a(x);
        let b = if terms.iter().any(is_on_b) { self.motions.in_b(x, t) } else { a };
        let mut sum = Jet::constant(ZERO);
        for term in terms {
            let y = if term.literal.on_b { &b } else { &a };
            let face = self.face(&term.literal)?;
            let jet = if let Some(other) = &term.other {
                self.fit((&term.literal, face), (other, self.face(other)?), (&a, &b), (x, t), term.point)?
            } else if term.literal.negative {
                self.psi(face, y).scaled(point(-1.0)).plus(point(self.depth))
            } else {
                tangent(face, term.point, y).plus(point(self.depth))
            };
            sum = sum + weighted(&jet, term.lambda, span, t);
        }
        Some(sum)
    }

    fn psi(&self, face: &Face, y: &[Jet; 3]) -> Jet {
        match *face {
            Face::Plane(surface::Plane { normal, offset }) => linear(vector(normal.to_array()), y).plus(point(-offset)),
            Face::Sphere(surface::Sphere { center, radius }) => {
                square_length(&offsets(y, center)).sqrt().plus(point(-radius))
            }
            Face::Cylinder(surface::Cylinder { origin, axis, radius }) => {
                square_length(&across(&offsets(y, origin), unit(vector(axis.to_array())))).sqrt().plus(point(-radius))
            }
            Face::Cone(surface::Cone { apex, axis, sin, cos }) => {
                let (o, axis) = (offsets(y, apex), unit(vector(axis.to_array())));
                let rho = square_length(&across(&o, axis)).sqrt();
                rho.scaled(point(cos)) - linear(axis, &o).scaled(point(sin))
            }
            Face::Bowl(ref bowl) => {
                let (rows, fall, radius) = rows_of_bowl(bowl);
                let y = offsets(y, bowl.origin);
                let v = rows.map(|row| linear(row, &y));
                square_length(&v).sqrt() - linear(fall, &y).plus(radius)
            }
            Face::Saddle(ref saddle) => {
                let [p, n] = halves(saddle, y);
                (p[0].square() + p[1].square()).sqrt() - (n[0].square() + n[1].square()).sqrt()
            }
            Face::Superellipsoid(ref face) => norm::psi(face, y),
            Face::Torus(surface::Torus { origin, axis, major, minor }) => {
                let (o, axis) = (offsets(y, origin), unit(vector(axis.to_array())));
                let off = square_length(&across(&o, axis)).sqrt().plus(point(-major));
                (off.square() + linear(axis, &o).square()).sqrt().plus(point(-minor))
            }
            // Beside its segment a cylinder's, beyond an end a ball's; where that is open, between both, derivatives too: the gradient
            // does not jump.
            Face::Capsule(surface::Capsule { origin, axis, half, radius }) => {
                let (o, a) = (offsets(y, origin), unit(vector(axis.to_array())));
                let along = linear(a, &o);
                let end = |half: f64| {
                    let from: [Jet; 3] = std::array::from_fn(|i| o[i].plus(-(point(half) * a[i])));
                    (along.v - point(half), square_length(&from).sqrt())
                };
                let ((above, top), (below, bottom)) = (end(half), end(-half));
                let pieces = [
                    (above.hi > 0.0).then_some(top),
                    (below.lo < 0.0).then_some(bottom),
                    (above.lo <= 0.0 && below.hi >= 0.0).then(|| square_length(&across(&o, a)).sqrt()),
                ];
                let all = pieces.into_iter().flatten().reduce(|p, q| hull(&p, &q));
                all.unwrap_or_else(|| Jet::constant(Interval::new(0.0, f64::INFINITY))).plus(point(-radius))
            }
            Face::Elliptic(ref e) => {
                let (rows, fall, radius) = image(e);
                let o = offsets(y, e.origin);
                square_length(&rows.map(|row| linear(row, &o))).sqrt() - linear(fall, &o).plus(radius)
            }
        }
    }

    /// What a psi is nowhere above, convex: of a torus the ball of its tube around the point of its circle on the side of `beside`; of a
    /// saddle |P| − n·N with any |n| <= 1, as it points there.
    fn above(&self, face: &Face, beside: DVec3, y: &[Jet; 3]) -> Jet {
        if let Face::Saddle(ref saddle) = *face {
            let ([p, n], along) = (halves(saddle, y), along(saddle, beside, 1));
            return (p[0].square() + p[1].square()).sqrt() - n[0].scaled(along[0]) - n[1].scaled(along[1]);
        }
        let Face::Torus(surface::Torus { origin, axis, major, minor }) = *face else { return self.psi(face, y) };
        let a = unit(vector(axis.to_array()));
        let out = (beside - origin) - axis * (beside - origin).dot(axis);
        let out = out.try_normalize().unwrap_or(axis.any_orthonormal_vector());
        let out = vector(out.to_array());
        let out = unit(minus(out, times(dot(out, a), a)));
        let o = offsets(y, origin);
        let from: [Jet; 3] = std::array::from_fn(|i| o[i].plus(-(point(major) * out[i])));
        square_length(&from).sqrt().plus(point(-minor))
    }

    /// ½(psi_p − psi_q) + delta for two cones, from below: with one axis a and one angle it is at least
    /// ½[sin α Δ·a − cos α |Δ − (Δ·a)a|] + delta, Δ = o_p − o_q, at every x. Giving B's cone the axis and angle of A's
    /// changes its psi at x by at most |x − o|(|a' − a|(sin α + cos α) + |α' − α|). Only the value's lower end is known,
    /// which the jet says by unbounded derivatives.
    fn cones(&self, p: (&Literal, &Face), q: (&Literal, &Face), x: Vector, t: Interval) -> Option<Jet> {
        let (on_a, on_b) = if p.0.on_b { (q.1, p.1) } else { (p.1, q.1) };
        let (
            Face::Cone(surface::Cone { apex: o_a, axis: a, sin, cos }),
            Face::Cone(surface::Cone { apex: o_b, axis: a_b, sin: sin_b, cos: cos_b }),
        ) = (*on_a, *on_b)
        else {
            return None;
        };
        let a = unit(vector(a.to_array()));
        let a_b = self.motions.b_direction(unit(vector(a_b.to_array())), t);
        let o_b = self.motions.b_point(vector(o_b.to_array()), t);
        let (sin, cos) = (point(sin), point(cos));
        // |α' − α| <= π/2·|sin(α' − α)|, both between 0 and π/2.
        let angle = (sin * point(cos_b) - cos * point(sin_b)).mag() * 1.58;
        let lean = length(minus(a_b, a));
        let far = length(minus(x, o_b));
        let delta = minus(o_b, vector(o_a.to_array()));
        let delta = if p.0.on_b { delta } else { times(point(-1.0), delta) };
        let along = dot(delta, a);
        let across = length(minus(delta, times(along, a)));
        let least = sin * along - cos * across - far * (lean * (sin + cos) + point(angle));
        let any = Interval::new(f64::NEG_INFINITY, f64::INFINITY);
        let value = point(0.5) * least + point(self.depth);
        Some(Jet { v: Interval::new(value.lo, f64::INFINITY), g: [any; 4], h: [any; 10] })
    }

    /// ½(psi_p − psi_q) + delta for two faces of one body, from below; y is the point in its frame. With centres, points of the
    /// axes or apexes o and Δ = o_p − o_q, at every x: of spheres psi_p − psi_q >= R_q − R_p − |Δ|; of cylinders
    /// >= R_q − R_p − |Δ − (Δ·a)a| − |a_p ∓ a_q| |x − o_q|; of cones as above. It does not move, and only its lower end is known.
    fn wall(&self, p: &Face, q: &Face, y: &[Jet; 3]) -> Option<Jet> {
        let place = |v: DVec3| vector(v.to_array());
        let far = |o: DVec3| length(std::array::from_fn(|i| y[i].v - point(o[i])));
        let least = match (*p, *q) {
            (
                Face::Sphere(surface::Sphere { center: o, radius: r }),
                Face::Sphere(surface::Sphere { center: u, radius: s }),
            ) => point(s) - point(r) - length(minus(place(o), place(u))),
            (
                Face::Cylinder(surface::Cylinder { origin: o, axis: a, radius: r }),
                Face::Cylinder(surface::Cylinder { origin: u, axis: b, radius: s }),
            ) => {
                let (turned, own) = (if a.dot(b) < 0.0 { -b } else { b }, unit(place(a)));
                let lean = length(minus(own, unit(place(turned))));
                let delta = minus(place(o), place(u));
                let across = length(minus(delta, times(dot(delta, own), own)));
                point(s) - point(r) - across - lean * far(u)
            }
            (
                Face::Cone(surface::Cone { apex: o, axis: a, sin, cos }),
                Face::Cone(surface::Cone { apex: u, axis: b, sin: sin_q, cos: cos_q }),
            ) => {
                let own = unit(place(a));
                let (sin, cos) = (point(sin), point(cos));
                let angle = (sin * point(cos_q) - cos * point(sin_q)).mag() * 1.58;
                let lean = length(minus(own, unit(place(b))));
                let delta = minus(place(o), place(u));
                let along = dot(delta, own);
                let across = length(minus(delta, times(along, own)));
                sin * along - cos * across - far(u) * (lean * (sin + cos) + point(angle))
            }
            // The circles are no farther from each other than their centres, their radii and their planes.
            (
                Face::Torus(surface::Torus { origin: o, axis: a, major, minor }),
                Face::Torus(surface::Torus { origin: u, axis: b, major: major_q, minor: minor_q }),
            ) => {
                let turned = if a.dot(b) < 0.0 { -b } else { b };
                let lean = length(minus(unit(place(a)), unit(place(turned))));
                let wider = point((point(major) - point(major_q)).mag());
                point(minor_q) - point(minor) - length(minus(place(o), place(u))) - wider - lean * point(major_q)
            }
            // The segments are no farther from each other than their middles, their halves and their directions.
            (
                Face::Capsule(surface::Capsule { origin: o, axis: a, half, radius }),
                Face::Capsule(surface::Capsule { origin: u, axis: b, half: half_q, radius: radius_q }),
            ) => {
                let turned = if a.dot(b) < 0.0 { -b } else { b };
                let lean = length(minus(unit(place(a)), unit(place(turned))));
                let longer = point((point(half) - point(half_q)).mag());
                point(radius_q) - point(radius) - length(minus(place(o), place(u))) - longer - lean * point(half_q)
            }
            // Of one pair of exponents their difference is no larger than that of the ellipsoids of these rows.
            (Face::Superellipsoid(ref one), Face::Superellipsoid(ref other)) if one.exponents == other.exponents => {
                walled((norm::rows(one), one.origin), (norm::rows(other), other.origin), far(other.origin))
            }
            (Face::Bowl(ref one), Face::Bowl(ref other)) => {
                walled((rows_of_bowl(one), one.origin), (rows_of_bowl(other), other.origin), far(other.origin))
            }
            // −|P_p − P_q| − |N_p − N_q|, part by part, turned alike.
            (Face::Saddle(ref one), Face::Saddle(ref other)) => {
                let (p, q) = (parts_of_saddle(one), parts_of_saddle(other));
                let mut off = ZERO;
                for (a, b) in p.iter().flatten().zip(q.iter().flatten()) {
                    let sign = point(if dot(a.0, b.0).hi < 0.0 { -1.0 } else { 1.0 });
                    let of = |(row, at): &(Vector, Interval), o: DVec3| {
                        let way: Vector = std::array::from_fn(|i| y[i].v - point(o[i]));
                        dot(*row, way) + *at
                    };
                    let apart = of(a, one.origin) - sign * of(b, other.origin);
                    off = off + point(apart.mag());
                }
                point(0.0) - off
            }
            // psi_p − psi_q >= R_q − R_p + w_p·Δ − |B_p Δ| − |x − o_q| (|B_p − B_q| + |w_p − w_q|), rows turned alike.
            (Face::Elliptic(ref one), Face::Elliptic(ref other)) => {
                walled((image(one), one.origin), (image(other), other.origin), far(other.origin))
            }
            _ => return None,
        };
        let any = Interval::new(f64::NEG_INFINITY, f64::INFINITY);
        let value = point(0.5) * least + point(self.depth);
        if value.lo > 0.0 {
            // A number below it holds all over the region.
            return Some(Jet::constant(point(value.lo)));
        }
        Some(Jet { v: Interval::new(value.lo, f64::INFINITY), g: [any; 4], h: [any; 10] })
    }

    /// With |u_p| <= R_p − delta and |u_q| >= R_q + delta at a contact:
    /// [ |u_p|² − |u_q|² + (R_q + delta)² − (R_p − delta)² ] / (2(R_p + R_q)) <= 0, for spheres and cylinders.
    fn fit(
        &self,
        p: (&Literal, &Face),
        q: (&Literal, &Face),
        (a, b): (&[Jet; 3], &[Jet; 3]),
        (x, t): (Vector, Interval),
        touched: DVec3,
    ) -> Option<Jet> {
        if p.0.negative || !q.0.negative {
            return None;
        }
        if p.0.on_b == q.0.on_b {
            let wall = self.wall(p.1, q.1, if p.0.on_b { b } else { a })?;
            if wall.v.lo > 0.0
                || matches!(
                    p.1,
                    Face::Cone(_)
                        | Face::Elliptic(_)
                        | Face::Capsule(_)
                        | Face::Bowl(_)
                        | Face::Saddle(_)
                        | Face::Superellipsoid(_)
                )
            {
                return Some(wall);
            }
        }
        if let (Face::Cone(_), Face::Cone(_)) = (p.1, q.1) {
            return self.cones(p, q, x, t);
        }
        // Of a capsule the cylinder or the ball that it is all over the region; where it is both, only smaller regions tell.
        let of = |l: &Literal, face: &Face| part_of(face, if l.on_b { b } else { a });
        let (Some(part_p), Some(part_q)) = (of(p.0, p.1), of(q.0, q.1)) else {
            let any = Interval::new(f64::NEG_INFINITY, f64::INFINITY);
            return Some(Jet { v: any, g: [any; 4], h: [any; 10] });
        };
        let (p, q) = ((p.0, &part_p), (q.0, &part_q));
        let round = |face: &Face| match *face {
            Face::Sphere(surface::Sphere { center, radius }) => Some((center, None, radius)),
            Face::Cylinder(surface::Cylinder { origin, axis, radius }) => {
                Some((origin, Some(unit(vector(axis.to_array()))), radius))
            }
            _ => None,
        };
        let square = |l: &Literal, face: &Face| {
            let (o, axis, r) = round(face)?;
            let y = offsets(if l.on_b { b } else { a }, o);
            let mut s = square_length(&axis.map_or(y, |axis| across(&y, axis)));
            // A rotation keeps lengths: along A's axes the spatial Hessian is 2(I − aaᵀ), a the axis as A sees it.
            let axis = axis.map(|axis| if l.on_b { self.motions.b_direction(axis, t) } else { axis });
            for i in 0..3 {
                for j in i..3 {
                    let own = point(if i == j { 2.0 } else { 0.0 });
                    s.h[place(i, j)] =
                        axis.map_or(own, |a| own - point(2.0) * if i == j { a[i].square() } else { a[i] * a[j] });
                }
            }
            Some((s, r))
        };
        // A sphere in a cylinder leaves the square of the way along the axis: taken from the touched point, it is not
        // negative and can go, and what is left is linear in space.
        let along = match (p.1, q.1) {
            (Face::Sphere(_), Face::Cylinder(surface::Cylinder { axis, .. })) => {
                let from = self.fixed(q.0.on_b, vector(touched.to_array()), t);
                let y = if q.0.on_b { b } else { a };
                Some(linear(unit(vector(axis.to_array())), &std::array::from_fn(|i| y[i] - from[i])).square())
            }
            _ => None,
        };
        let (p_name, q_name) = (p, q);
        let ((p, r_p), (q, r_q)) = (square(p.0, p.1)?, square(q.0, q.1)?);
        if r_p <= self.depth {
            return None;
        }
        // At a negative depth the subtracted face has shrunk.
        if r_q + self.depth <= 0.0 {
            return None;
        }
        let (r_p, r_q, depth) = (point(r_p), point(r_q), point(self.depth));
        let room = (r_q + depth).square() - (r_p - depth).square();
        let mut difference = p - q;
        if let Some(along) = along {
            difference = difference - along;
            for i in 0..3 {
                for j in i..3 {
                    difference.h[place(i, j)] = ZERO;
                }
            }
        }
        let mut fit = difference.plus(room).scaled((point(2.0) * (r_p + r_q)).recip());
        // The curvatures cancel and so do the gradients' widths, but not in intervals: from the middle of the box they are
        // known as exactly as the Hessian is.
        let middle = x.map(|x| point((0.5 * (x.lo + x.hi)).clamp(x.lo, x.hi)));
        if x != middle {
            let (a, b) = (in_a(middle), self.motions.in_b(middle, t));
            let at = self.fit(p_name, q_name, (&a, &b), (middle, t), touched)?;
            let away = minus(x, middle);
            for k in 0..3 {
                fit.g[k] = (0..3).fold(at.g[k], |g, j| g + fit.h[place(k, j)] * away[j]);
            }
        }
        Some(fit)
    }
}

/// λ(t)·f, where λ goes linearly from one value at the start of the span to another at its end.
fn weighted(f: &Jet, [from, to]: [f64; 2], (start, end): (f64, f64), t: Interval) -> Jet {
    if from == to || start >= end {
        return f.scaled(point(from));
    }
    let slope = (point(to) - point(from)) * (point(end) - point(start)).recip();
    let value = point(from) + slope * (t - point(start));
    // Between two values that are not negative it is not negative: only its interval may be.
    let mut j = f.scaled(Interval::new(value.lo.max(0.0), value.hi.max(0.0)));
    j.g[3] = j.g[3] + slope * f.v;
    for k in 0..4 {
        let twice = if k == 3 { point(2.0) } else { point(1.0) };
        j.h[place(k, 3)] = j.h[place(k, 3)] + twice * slope * f.g[k];
    }
    j
}
