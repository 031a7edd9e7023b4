//! The points in which a ball touches any solid, without boxes: the feet of its centre; and the circle about an axis that it stands on.
//!
//! What touches the ball lies on the solid's surface within r + τ of the centre c, and the way from there to c is a combination of the
//! outward normals of the faces through it (weights >= 0), of three of them at most. So it is a foot of c on a face, on the curve of two
//! faces or in the corner of three, where the way is square to that; where a fourth one passes boxes decide. A literal that is farther from c than r + τ holds or fails for all of them, since ψ changes no
//! faster than the distance. Those that are left are looked at if they are planes, spheres, cylinders and cones: all feet on them have
//! closed forms, and so have those on two planes' line and on the circle of two faces about one axis. Of another curve, or another
//! corner than that of three planes, it must be seen that it is farther away: beside a plane whose foot is p at the distance d, what
//! meets the face ψ is √(d² + ψ(p)²) away at least, by Pythagoras; along a line from its foot as well; and of a circle of radius ρ about
//! an axis from which c is e away, with the nearest point q at the distance d, what is within R of c is within √((R² − d²) ρ/e) of q.
//!
//! On an axis of a face, or of the circle of two, a ball has no feet there but a ring: where that is all, it is followed as boxes follow
//! the lines that they find (`line`).
//!
//! Each foot is what it is by a margin, or the boxes decide: no other face is near it, none of its weights is near zero, it is on the
//! solid whichever side the other faces are on, and not near the threshold.

use super::local::{Bodies, Lit, holds};
use super::{Region, line, line_region, point, point_region, rank};
use crate::contact::exclusion::literal::Side;
use crate::math::any_perpendicular;
use crate::solid::Solid;
use crate::solid::local::{LiteralId, Token, Truth, literals};
use crate::solid::surface::Quadric;
use glam::{DMat3, DVec3};
use smallvec::{SmallVec, smallvec};
use std::f64::consts::TAU;

/// Tokens of a solid beyond which it is left to boxes.
const MOST_TOKENS: usize = 400;
/// The same of faces near a ball.
const MOST_FACES: usize = 10;
/// Diameters of the smaller body within which a foot is too near another face or an axis to be told without it, and thresholds.
const BESIDE: f64 = 1e-6;
const BESIDE_TAU: f64 = 2.0;
/// Part of the threshold within which a gap may be either.
const EITHER: f64 = 1e-3;
/// Sine of the angle from which on planes meet in a line, and of that within which two axes are one.
const MEET: f64 = 1e-5;
const COAXIAL: f64 = 1e-12;
/// Part of the way to the centre below which a weight may be none, and by which the weights may miss it.
const WEIGHT: f64 = 1e-6;
/// How much more than the threshold the gap grows within a part of the ball's radius from a foot in a hollow, or all round.
const POINTED: f64 = 3.0;
const ASIDE: f64 = 0.25;
/// Thresholds from an axis within which a ball is on it.
const CENTERED: f64 = 0.02;

/// A face near the ball.
struct Near {
    lit: Lit,
    /// 1 where the solid is inside of the face, −1 where it is outside.
    sign: f64,
    shape: Shape,
}

/// What a face is, along A's axes.
#[derive(Clone, Copy)]
enum Shape {
    /// Unit normal and offset.
    Plane(DVec3, f64),
    Round(Quadric),
}

/// Where the way from a face, or from the curve of two, to the centre is square to it.
enum Feet {
    Points(SmallVec<[DVec3; 2]>),
    /// All round an axis.
    Ring,
}

/// Where two faces meet, within reach.
enum Curve {
    /// The foot, on two planes.
    Line(DVec3),
    /// Centre, unit axis, radius.
    Circle(DVec3, DVec3, f64),
}

/// A ball and what of the other body is near it.
struct Around<'b, 't, 'a> {
    bodies: &'b Bodies<'t, 'a>,
    side: Side,
    other: Side,
    center: DVec3,
    radius: f64,
    /// No point farther from the centre touches.
    reach: f64,
    /// Lengths within which a gap is at the threshold, and a point at a face.
    slack: f64,
    beside: f64,
    tokens: Vec<Token>,
    near: SmallVec<[Near; MOST_FACES]>,
    ball: Lit,
    regions: Vec<Region>,
    /// The faces of the ring that it stands on, perhaps.
    ring: Option<SmallVec<[usize; 2]>>,
}

/// The regions of a ball and another body: points, or one circle; `None` for other bodies, and where they are not proven to be all.
pub(super) fn regions(bodies: &Bodies) -> Option<Vec<Region>> {
    let of = |solid: &Solid, side| solid.as_ball().map(|(center, radius, face)| (center, radius, (side, face)));
    let (center, radius, ball) = of(bodies.task.a, Side::A).or_else(|| of(bodies.task.b, Side::B))?;
    let side = ball.0;
    let (other, solid, center) = match side {
        Side::A => (Side::B, bodies.task.b, center),
        Side::B => (Side::A, bodies.task.a, bodies.at.a_point(center)),
    };
    if solid.has_parts || solid.normal_form.len() > MOST_TOKENS {
        return None;
    }
    let slack = EITHER * bodies.tau + 4.0 * bodies.eps;
    let reach = radius + bodies.tau + 2.0 * slack;
    let beside = (BESIDE * bodies.size).max(BESIDE_TAU * bodies.tau + 8.0 * bodies.eps);
    let mut tokens = Vec::new();
    let mut truth = |id: LiteralId| match bodies.value((other, id), center) {
        value if value > reach => Truth::False,
        value if value < -reach => Truth::True,
        _ => Truth::Open,
    };
    if solid.prune(&solid.normal_form, &mut tokens, &mut truth) != Truth::Open {
        return None;
    }
    let mut ids: SmallVec<[LiteralId; MOST_FACES]> = literals(&tokens).collect();
    ids.sort_unstable();
    ids.dedup();
    if ids.len() > MOST_FACES {
        return None;
    }
    let near = ids.into_iter().map(|id| Near::of(bodies, (other, id))).collect::<Option<_>>()?;
    let (regions, ring) = (Vec::new(), None);
    let mut around =
        Around { bodies, side, other, center, radius, reach, slack, beside, tokens, near, ball, regions, ring };
    around.faces()?;
    around.curves()?;
    around.corners()?;
    if let Some(ring) = &around.ring {
        let told = around.regions.is_empty().then(|| around.circle(ring))??;
        around.regions.push(told);
    }
    let mut regions = around.regions;
    regions.sort_by_key(rank);
    (!regions.is_empty() && !bodies.work.is_spent()).then_some(regions)
}

impl Near {
    fn of(bodies: &Bodies, lit: Lit) -> Option<Self> {
        let face = bodies.face(lit);
        let shape = match face.flat() {
            Some((normal, offset)) => Shape::Plane(normal, offset),
            None => Shape::Round(face.quadric(0.0)?),
        };
        Some(Self { lit, sign: super::local::sign(lit), shape })
    }
}

/// A point seen from an axis: along it, away from it, and the unit direction away from it.
fn seen(x: DVec3, origin: DVec3, axis: DVec3) -> (f64, f64, DVec3) {
    let z = (x - origin).dot(axis);
    let off = (x - origin) - axis * z;
    let e = off.length();
    (z, e, if e > 0.0 { off / e } else { any_perpendicular(axis) })
}

impl Around<'_, '_, '_> {
    /// The feet on each face.
    fn faces(&mut self) -> Option<()> {
        for i in 0..self.near.len() {
            match self.feet(i)? {
                Feet::Points(feet) => feet.into_iter().try_for_each(|x| self.consider(x, &[i]))?,
                Feet::Ring => self.stands_on(&[i])?,
            }
        }
        Some(())
    }

    /// Takes note of a ring; `None` where there are two.
    fn stands_on(&mut self, of: &[usize]) -> Option<()> {
        self.ring.is_none().then(|| self.ring = Some(of.into()))
    }

    /// What is at a distance all round an axis: nothing where that is beyond the threshold.
    fn ring_at(&self, far: f64) -> Feet {
        let is_beyond = (far - self.radius).abs() > self.bodies.tau + self.slack + self.beside;
        if is_beyond { Feet::Points(SmallVec::new()) } else { Feet::Ring }
    }

    /// The points of a face within reach at which the way to the centre is square to it.
    fn feet(&self, i: usize) -> Option<Feet> {
        let Near { sign, shape, .. } = self.near[i];
        let c = self.center;
        let quadric = match shape {
            Shape::Plane(n, d) => return Some(Feet::Points(smallvec![c - n * (n.dot(c) - d)])),
            Shape::Round(quadric) => quadric,
        };
        let mut feet = SmallVec::new();
        let mut add = |x: DVec3, bend: f64| {
            let far = x.distance(c);
            if far <= self.reach {
                // In a hollow a ball that nearly fits touches along a line or an area.
                let w = ASIDE * self.radius;
                let grows = 0.5 * w * w * (1.0 / far - 1.0 / bend).abs();
                if sign < 0.0 && grows <= POINTED * self.bodies.tau {
                    return None;
                }
                feet.push(x);
            }
            Some(())
        };
        let Some(axis) = quadric.axis else {
            let (d, r) = ((c - quadric.origin).length(), quadric.radius);
            if d < self.beside {
                return None;
            }
            for side in [1.0, -1.0] {
                add(quadric.origin + (c - quadric.origin) * (side * r / d), r)?;
            }
            return Some(Feet::Points(feet));
        };
        let (z, e, away) = seen(c, quadric.origin, axis);
        let (r, m) = (quadric.radius, quadric.slope);
        let norm = m.mul_add(m, 1.0);
        if m != 0.0 && (quadric.origin - axis * (r / m)).distance(c) <= self.reach {
            return None;
        }
        if e < self.beside {
            return (e <= CENTERED * self.bodies.tau).then(|| self.ring_at((r + m * z).abs() / norm.sqrt()));
        }
        // In the plane through the axis the face is a straight line on either side of it.
        for side in [1.0, -1.0] {
            let height = (z + m * (side * e - r)) / norm;
            let rho = r + m * height;
            if rho > 0.0 {
                add(quadric.origin + axis * height + away * (side * rho), rho * norm.sqrt())?;
            }
        }
        Some(Feet::Points(feet))
    }

    /// The feet on the curves of two faces.
    fn curves(&mut self) -> Option<()> {
        for i in 0..self.near.len() {
            for j in i + 1..self.near.len() {
                match self.feet_on(i, j)? {
                    Feet::Points(feet) => feet.into_iter().try_for_each(|x| self.consider(x, &[i, j]))?,
                    Feet::Ring => self.stands_on(&[i, j])?,
                }
            }
        }
        Some(())
    }

    fn feet_on(&self, i: usize, j: usize) -> Option<Feet> {
        let c = self.center;
        let (nearest, feet, reaches): (DVec3, SmallVec<[DVec3; 2]>, f64) = match self.curve(i, j)? {
            None => return Some(Feet::Points(SmallVec::new())),
            Some(Curve::Line(foot)) => {
                let left = self.reach * self.reach - foot.distance_squared(c);
                (foot, smallvec![foot], left)
            }
            Some(Curve::Circle(q, axis, rho)) => {
                let (z, e, away) = seen(c, q, axis);
                let (near, far) = (q + away * rho, z.hypot(e - rho));
                let left = self.reach * self.reach - far * far;
                // On the axis no way away from it has a direction.
                if left >= 0.0 && e <= CENTERED * self.bodies.tau {
                    return Some(self.ring_at(far));
                }
                // All round within reach, or nearly as near.
                let grows = 0.5 * (ASIDE * self.radius).powi(2) * e / (rho * far);
                if left >= 0.0 && (e < self.beside || grows <= POINTED * self.bodies.tau) {
                    return None;
                }
                (near, smallvec![near, q - away * rho], left * rho / e)
            }
        };
        if reaches < 0.0 {
            return Some(Feet::Points(SmallVec::new()));
        }
        // Another face that the curve meets within reach makes a corner: of three planes it is looked at, of others it is not.
        let along = reaches.sqrt();
        let are_flat = |k: usize| [i, j, k].iter().all(|f| matches!(self.near[*f].shape, Shape::Plane(..)));
        for k in (0..self.near.len()).filter(|k| *k != i && *k != j) {
            if !are_flat(k) && self.bodies.value(self.near[k].lit, nearest).abs() <= along + self.slack {
                return None;
            }
        }
        let is_near = |x: &DVec3| x.distance(c) <= self.reach;
        Some(Feet::Points(feet.into_iter().filter(is_near).collect()))
    }

    /// The curve of two faces: `Some(None)` where it is none within reach, `None` where it has no closed form here.
    fn curve(&self, i: usize, j: usize) -> Option<Option<Curve>> {
        let (one, two) = (&self.near[i], &self.near[j]);
        match (one.shape, two.shape) {
            (Shape::Plane(n, d), Shape::Plane(m, b)) => self.line((n, d), (m, b)),
            (Shape::Plane(n, d), Shape::Round(q)) => self.section((n, d), (two, q)),
            (Shape::Round(q), Shape::Plane(n, d)) => self.section((n, d), (one, q)),
            (Shape::Round(p), Shape::Round(q)) => self.round(p, q),
        }
    }

    /// Two planes.
    fn line(&self, (n, d): (DVec3, f64), (m, b): (DVec3, f64)) -> Option<Option<Curve>> {
        let c = self.center;
        let cos = n.dot(m);
        let (p, q) = (n.dot(c) - d, m.dot(c) - b);
        if n.cross(m).length() < MEET {
            // Parallel for all that is within reach, unless they are nearly one.
            return ((p - cos.signum() * q).abs() > self.beside + 2.0 * MEET * self.reach).then_some(None);
        }
        // From the one plane's foot along it to the other: that holds its digits however flat the edge is.
        let along = (m - n * cos).normalize();
        let on = c - n * p;
        let foot = on - along * ((m.dot(on) - b) / m.dot(along));
        Some(Some(Curve::Line(foot - n * (n.dot(foot) - d))))
    }

    /// A plane and a round face.
    fn section(&self, (n, d): (DVec3, f64), (face, round): (&Near, Quadric)) -> Option<Option<Curve>> {
        let c = self.center;
        let Some(axis) = round.axis else {
            let h = n.dot(round.origin) - d;
            return match round.radius - h.abs() {
                less if less.abs() <= self.beside => None,
                less if less < 0.0 => Some(None),
                _ => Some(Some(Curve::Circle(round.origin - n * h, n, (round.radius * round.radius - h * h).sqrt()))),
            };
        };
        if n.cross(axis).length() < COAXIAL {
            let z = (d - n.dot(round.origin)) / n.dot(axis);
            return Some(circle(&round, axis, z));
        }
        let far = n.dot(c) - d;
        let beside = self.bodies.value(face.lit, c - n * far);
        (far.hypot(beside) > self.reach).then_some(None)
    }

    /// Two round faces about one axis.
    fn round(&self, p: Quadric, q: Quadric) -> Option<Option<Curve>> {
        let (u, v) = (p.axis?, q.axis?);
        let (z, e, _) = seen(q.origin, p.origin, u);
        if u.cross(v).length() > COAXIAL || e > COAXIAL * (self.reach + z.abs()) {
            return None;
        }
        // Along the first one's axis the second one's radius is r + m (height − z).
        let m = q.slope * u.dot(v).signum();
        if (p.slope - m).abs() < MEET {
            // At the height of the centre they are apart by more than they come together within reach.
            let height = (self.center - p.origin).dot(u);
            let apart = (p.radius + p.slope * height) - (q.radius + m * (height - z));
            return (apart.abs() > self.beside + 2.0 * MEET * self.reach).then_some(None);
        }
        let height = (q.radius - m * z - p.radius) / (p.slope - m);
        Some(circle(&p, u, height))
    }

    /// The corners of three planes.
    fn corners(&mut self) -> Option<()> {
        let planes: SmallVec<[(usize, DVec3, f64); MOST_FACES]> = (0..self.near.len())
            .filter_map(|i| match self.near[i].shape {
                Shape::Plane(n, d) => Some((i, n, d)),
                Shape::Round(_) => None,
            })
            .collect();
        for (a, &(i, n, d)) in planes.iter().enumerate() {
            for (b, &(j, m, e)) in planes.iter().enumerate().skip(a + 1) {
                for &(k, l, f) in &planes[b + 1..] {
                    let rows = DMat3::from_cols(n, m, l).transpose();
                    if rows.determinant().abs() < MEET {
                        // Three planes nearly along one direction: near the line of two of them the third one must not be.
                        let Some(Some(Curve::Line(foot))) = self.curve(i, j) else { continue };
                        let left = self.reach * self.reach - foot.distance_squared(self.center);
                        // Along the line the third one rises by the determinant over the sine of the first two.
                        let off = (l.dot(foot) - f).abs();
                        let rise = rows.determinant().abs() / n.cross(m).length();
                        if left >= 0.0 && off <= self.beside + 2.0 * rise * left.sqrt() {
                            return None;
                        }
                        continue;
                    }
                    let (inverse, offsets) = (rows.inverse(), DVec3::new(d, e, f));
                    let x = inverse * offsets;
                    // Of a flat corner the first solution is off its faces by more than rounding.
                    let x = x - inverse * (rows * x - offsets);
                    if x.distance(self.center) <= self.reach {
                        self.consider(x, &[i, j, k])?;
                    }
                }
            }
        }
        Some(())
    }

    /// The circle on which the ball stands, where its ring is one that touches all round.
    fn circle(&self, ring: &[usize]) -> Option<Region> {
        let bodies = self.bodies;
        let own: SmallVec<[Lit; 2]> = ring.iter().map(|i| self.near[*i].lit).collect();
        let sides: [&[Lit]; 2] = if self.side == Side::A { [&[self.ball], &own] } else { [&own, &[self.ball]] };
        let mut runs: SmallVec<[line::Run; 2]> = SmallVec::new();
        for candidate in line::candidates_among(bodies, sides) {
            let line::Curve::Circle { .. } = candidate.curve else { continue };
            let all = self.near.iter().map(|near| near.lit).chain([self.ball]);
            let others: SmallVec<[Lit; 8]> = all.filter(|lit| !candidate.faces.contains(lit)).collect();
            runs.extend(line::runs_within(bodies, &candidate, (0.0, TAU), &others, &|_| false));
        }
        let first = runs.pop()?;
        runs.is_empty().then(|| line_region(bodies, &first))
    }

    /// Takes a foot on one to three faces, where it is one of the solid and within the threshold. `None` where that is not sure.
    fn consider(&mut self, x: DVec3, of: &[usize]) -> Option<()> {
        let (bodies, way) = (self.bodies, self.center - x);
        let far = way.length();
        let gap = far - self.radius;
        if gap > bodies.tau + self.slack {
            return Some(());
        }
        let mut solid: SmallVec<[bool; MOST_FACES]> = SmallVec::new();
        for (i, near) in self.near.iter().enumerate() {
            let value = if of.contains(&i) { f64::NEG_INFINITY } else { bodies.value(near.lit, x) };
            if value.abs() <= self.beside {
                return None;
            }
            solid.push(value < 0.0);
        }
        let is_solid = |without: Option<usize>| {
            let at = |id: LiteralId| self.near.iter().position(|near| near.lit.1 == id);
            holds(&self.tokens, &mut |id| at(id).is_some_and(|i| solid[i] && without != Some(i)))
        };
        if !is_solid(None) {
            return Some(());
        }
        let weights = self.weights(way, x, of)?;
        if weights.iter().any(|w| w.abs() <= WEIGHT * far) {
            return None;
        }
        if weights.iter().any(|w| *w < 0.0) {
            return Some(());
        }
        // Where the solid does not end at each of them it is no foot of its own: within it, on a seam, in a notch.
        let ends = of.iter().filter(|i| !is_solid(Some(**i))).count();
        if ends < of.len() {
            return (of.len() == 1).then_some(());
        }
        if gap.abs() > bodies.tau - self.slack || bodies.f(self.other, x).abs() > bodies.eps {
            return None;
        }
        let (normal, on_ball) = (-way / far, self.center - way * (self.radius / far));
        let meeting = match self.side {
            Side::A => point::met(bodies, [on_ball, x], normal),
            Side::B => point::met(bodies, [x, on_ball], -normal),
        };
        self.regions.push(point_region(bodies, &meeting));
        Some(())
    }

    /// How the way from a foot to the centre is combined of the outward normals of its faces; `None` where it is not.
    fn weights(&self, way: DVec3, x: DVec3, of: &[usize]) -> Option<SmallVec<[f64; 3]>> {
        let normal = |i: usize| self.bodies.slant_out(self.near[i].lit, x).1;
        let (weights, made): (SmallVec<[f64; 3]>, DVec3) = match *of {
            [i] => {
                let w = normal(i).dot(way);
                (smallvec![w], normal(i) * w)
            }
            [i, j] => {
                let (n, m) = (normal(i), normal(j));
                let (cos, p, q) = (n.dot(m), n.dot(way), m.dot(way));
                let whole = n.cross(m).length_squared();
                let (v, w) = ((p - cos * q) / whole, (q - cos * p) / whole);
                (smallvec![v, w], n * v + m * w)
            }
            [i, j, k] => {
                let normals = DMat3::from_cols(normal(i), normal(j), normal(k));
                let w = normals.inverse() * way;
                (SmallVec::from_slice(&w.to_array()), normals * w)
            }
            _ => return None,
        };
        (made.distance(way) <= WEIGHT * way.length()).then_some(weights)
    }
}

/// The circle of a face of revolution at a height along its axis; none at or beyond an apex.
fn circle(round: &Quadric, axis: DVec3, height: f64) -> Option<Curve> {
    let rho = round.radius + round.slope * height;
    (rho > 0.0).then(|| Curve::Circle(round.origin + axis * height, axis, rho))
}
