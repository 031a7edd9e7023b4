//! Patches: where faces of two bodies lie on each other over an area.
//!
//! A patch is told by its corners: points of the common surface in which two more faces, of either body, cut it, and in
//! which the patch really ends. Round boundaries have none, or few: eight directions that are fixed in a body mark points
//! of them. Corners are roots of three equations; boxes in which the three faces cannot all pass are dropped, Newton's
//! method starts in those that stay.

use super::local::{Bodies, Lit};
use super::surface::{FacePair, Standing, axis_of_curve, same_surface, standing};
use crate::contact::exclusion::literal::Side;
use crate::contact::instant::separation::Place;
use crate::solid::{local, surface::Plane};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;
use std::collections::BTreeMap;

/// Newton's method starts in boxes of at most this radius, in sizes of the smaller body, where curved faces are involved …
const START: f64 = 1.0 / 48.0;
/// … but no box is halved more often than this.
const HALVINGS: u32 = 4;

/// A surface that cuts a patch's.
#[derive(Clone, Copy, Debug)]
pub enum Cut {
    Face(Lit),
    /// A plane n·x = d.
    Plane(DVec3, f64),
}

/// A point that bounds a region: where, how far apart the bodies are there, and the faces that made it.
#[derive(Clone, Debug)]
pub struct Corner {
    pub x: DVec3,
    pub gap: f64,
    /// Orders the points the same way from step to step.
    pub key: [u64; 3],
}

/// A name for a face that does not depend on where it is.
pub fn key_of((side, id): Lit) -> u64 {
    2 * u64::from(id.face()) + if side == Side::A { 0 } else { 1 }
}

impl Cut {
    fn span(&self, bodies: &Bodies, center: DVec3, half: DVec3) -> local::Span {
        match *self {
            Cut::Face(lit) => bodies.span(bodies.face(lit), center, half),
            Cut::Plane(normal, offset) => bodies.span(&Plane { normal, offset }.into(), center, half),
        }
    }

    fn is_flat(&self, bodies: &Bodies) -> bool {
        match self {
            Cut::Face(lit) => bodies.face(*lit).is_flat(),
            Cut::Plane(..) => true,
        }
    }
}

/// The points of a pair's surface within some boxes that two cuts pass through.
fn meet(bodies: &Bodies, pair: &FacePair, cuts: [&Cut; 2], places: &[&Place]) -> Vec<(DVec3, u64)> {
    let slack = bodies.tau + bodies.eps;
    if bodies.face(pair.alpha).is_flat() && cuts.iter().all(|c| c.is_flat(bodies)) {
        // Three planes have one point in common, wherever it is looked for.
        let found = newton(bodies, pair, cuts, places[0].center);
        return found.filter(|f| places.iter().any(|p| p.holds(f.0, bodies.eps))).into_iter().collect();
    }
    let mut found: Vec<(DVec3, u64)> = Vec::new();
    let misses = |span: local::Span| span.0 > slack || span.1 < -slack;
    let alpha = Cut::Face(pair.alpha);
    for place in places {
        let mut stack = vec![(place.center, place.half, HALVINGS)];
        while let Some((center, half, left)) = stack.pop() {
            if bodies.work.is_spent() {
                return found;
            }
            if [&alpha, cuts[0], cuts[1]].iter().any(|c| misses(c.span(bodies, center, half))) {
                continue;
            }
            if left > 0 && half.length() > START * bodies.size {
                for k in (0..8).rev() {
                    let sign = DVec3::from_array(std::array::from_fn(|i| if k >> i & 1 == 0 { -0.5 } else { 0.5 }));
                    stack.push((center + half * sign, half * 0.5, left - 1));
                }
                continue;
            }
            if let Some((x, turn)) = newton(bodies, pair, cuts, center)
                && place.holds(x, bodies.eps)
                && !found.iter().any(|y| (y.0 - x).length() <= 1e-9 * bodies.size)
            {
                found.push((x, turn));
            }
        }
    }
    found
}

/// Newton's method for a point of a pair's surface on two cuts, and in which sense the three faces turn there: of two
/// points that a straight and a round one have in common each has its own.
pub fn newton(bodies: &Bodies, pair: &FacePair, cuts: [&Cut; 2], mut x: DVec3) -> Option<(DVec3, u64)> {
    let mut turn = 0;
    for _ in 0..40 {
        let (m, n) = pair.middle(bodies, x);
        let mut rows = [n; 3];
        let mut values = [m; 3];
        for (k, cut) in cuts.iter().enumerate() {
            (values[k + 1], rows[k + 1]) = match **cut {
                Cut::Plane(normal, offset) => (normal.dot(x) - offset, normal),
                Cut::Face(lit) => {
                    // Each face is read on its own body's side of the gap.
                    let own = if lit.0 == Side::A { pair.alpha } else { pair.beta };
                    let (value, normal) = bodies.slant_out(lit, bodies.foot(own, x));
                    (value, normal - n * normal.dot(n))
                }
            };
        }
        let jacobian = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose();
        let determinant = jacobian.determinant();
        if determinant.abs() < 1e-7 {
            return None;
        }
        turn = u64::from(determinant > 0.0);
        let mut step = -(jacobian.inverse() * DVec3::from_array(values));
        if !step.is_finite() {
            return None;
        }
        step = step.clamp_length_max(bodies.size);
        x += step;
        if step.length() <= 1e-15 * bodies.size {
            break;
        }
    }
    let on = |cut: &Cut| match *cut {
        Cut::Plane(normal, offset) => (normal.dot(x) - offset).abs() <= bodies.eps,
        Cut::Face(lit) => {
            let own = if lit.0 == Side::A { pair.alpha } else { pair.beta };
            bodies.value(lit, bodies.foot(own, x)).abs() <= 0.5 * bodies.eps
        }
    };
    cuts.iter().all(|c| on(c)).then_some((x, turn))
}

/// Eight directions about the axis of a round boundary, as half as many planes n·x = d.
pub fn marks(bodies: &Bodies, p: Lit, q: Lit) -> SmallVec<[(DVec3, f64); 4]> {
    let Some((origin, axis, u)) = axis_of_curve(bodies, p, q) else { return SmallVec::new() };
    let v = axis.cross(u);
    let r = std::f64::consts::FRAC_1_SQRT_2;
    [u, (u + v) * r, v, (v - u) * r].into_iter().map(|n| (n, n.dot(origin))).collect()
}

/// Names of the planes through marks, behind those of all faces.
pub const MARK: u64 = u64::MAX - 4;

/// The pairs of cuts that come together in some box, each once with the boxes, the smaller name first: the sense in which
/// they turn must not depend on a box's list.
fn crossings<'p>(bodies: &Bodies, pair: &FacePair, places: &[&'p Place]) -> Vec<([(u64, Cut); 2], Vec<&'p Place>)> {
    let mut found: BTreeMap<[u64; 2], ([(u64, Cut); 2], Vec<&'p Place>)> = BTreeMap::new();
    let mut add = |p: (u64, Cut), q: (u64, Cut), place: &'p Place| {
        let entry = found.entry([p.0, q.0]).or_insert_with(|| ([p, q], Vec::new()));
        entry.1.push(place);
    };
    for place in places {
        let mut cuts: Vec<(u64, Cut)> = Vec::new();
        for side in [Side::A, Side::B] {
            let own = if side == Side::A { pair.alpha } else { pair.beta };
            let others = place.lits(side).iter().copied().filter(|lit| !same_surface(bodies, *lit, own));
            cuts.extend(others.map(|lit| (key_of(lit) + 1, Cut::Face(lit))));
        }
        cuts.extend(pair.limit.map(|(normal, offset)| (0, Cut::Plane(normal, offset))));
        cuts.sort_by_key(|c| c.0);
        for (i, p) in cuts.iter().enumerate() {
            cuts[i + 1..].iter().for_each(|q| add(*p, *q, place));
            if let Cut::Face(lit) = p.1 {
                for (k, (n, d)) in marks(bodies, lit, pair.alpha).into_iter().enumerate() {
                    add(*p, (MARK + k as u64, Cut::Plane(n, d)), place);
                }
            }
        }
    }
    found.into_values().collect()
}

/// Points that bound a patch, each once.
pub struct Corners<'b, 't, 'a> {
    bodies: &'b Bodies<'t, 'a>,
    pair: &'b FacePair,
    found: Vec<Corner>,
}

impl<'b, 't, 'a> Corners<'b, 't, 'a> {
    pub fn of(bodies: &'b Bodies<'t, 'a>, pair: &'b FacePair) -> Self {
        Self { bodies, pair, found: Vec::new() }
    }

    /// A point of the surface in which two cuts meet, if the patch ends there: in a corner, or at a mark of its boundary.
    pub fn add(&mut self, x: DVec3, key: [u64; 3]) {
        let stands = standing(self.bodies, self.pair, x);
        if stands == Standing::Corner || (key[1] >= MARK && stands == Standing::Boundary) {
            let merge = 1e-9 * self.bodies.size;
            match self.found.iter_mut().find(|c| (c.x - x).length() <= merge) {
                Some(c) => c.key = c.key.min(key),
                None => self.found.push(Corner { x, gap: self.pair.gap(self.bodies, x), key }),
            }
        }
    }

    /// True where a point is known that is nearer to `x` than a distance.
    pub fn has_within(&self, x: DVec3, distance: f64) -> bool {
        self.found.iter().any(|c| (c.x - x).length() < distance)
    }

    pub fn ordered(mut self) -> Vec<Corner> {
        order(self.bodies, self.pair, &mut self.found);
        self.found
    }
}

/// The points that bound the part of a pair's patch that lies in some boxes.
pub fn corners(bodies: &Bodies, pair: &FacePair, places: &[&Place]) -> Vec<Corner> {
    let mut corners = Corners::of(bodies, pair);
    for (cuts, of) in crossings(bodies, pair, places) {
        let [(first, p), (second, q)] = &cuts;
        for (x, turn) in meet(bodies, pair, [p, q], &of) {
            corners.add(x, [*first, *second, turn]);
        }
    }
    let found = &mut corners.found;
    if found.is_empty()
        && let Some((center, radius)) = bodies.face(pair.alpha).ball()
    {
        // A whole sphere has no boundary: its points along three axes fixed in A.
        for (k, d) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
            for (sign, more) in [(1.0, 0), (-1.0, 1)] {
                let x = center + d * (sign * radius);
                if standing(bodies, pair, x) == Standing::Inside {
                    found.push(Corner { x, gap: pair.gap(bodies, x), key: [u64::MAX, k as u64, more] });
                }
            }
        }
    }
    corners.ordered()
}

/// Points seen from the middle under a smaller angle than this are not told apart by it.
const LEAST_ANGLE: f64 = 1e-3;

/// Flat patches run round their middle, starting at the point with the smallest key; others go by keys alone.
pub fn order(bodies: &Bodies, pair: &FacePair, points: &mut [Corner]) {
    let n = bodies.slant_out(pair.alpha, points.first().map_or(DVec3::ZERO, |c| c.x)).1;
    let u = bodies.material(Side::A, n);
    let v = n.cross(u);
    // Of two roots of the same faces the farther one along a direction that is fixed in A.
    let rank = |c: &Corner| (c.key, -(c.x.dot(u) + 0.618 * c.x.dot(v)));
    let first = |p: &Corner, q: &Corner| {
        let (p, q) = (rank(p), rank(q));
        p.0.cmp(&q.0).then(p.1.total_cmp(&q.1))
    };
    points.sort_by(first);
    if !bodies.face(pair.alpha).is_flat() || points.len() < 3 {
        return;
    }
    // Rings within rings have no order round the middle.
    let start = points[0].x;
    let middle = points.iter().map(|c| c.x).sum::<DVec3>() / points.len() as f64;
    let angle = |x: DVec3| {
        let (d, s) = (x - middle, start - middle);
        let turn = n.dot(s.cross(d)).atan2(s.dot(d));
        if turn < -1e-9 { turn + std::f64::consts::TAU } else { turn.max(0.0) }
    };
    let mut round = points.to_vec();
    round[1..].sort_by(|p, q| angle(p.x).total_cmp(&angle(q.x)));
    let distinct = round.windows(2).skip(1).all(|w| angle(w[1].x) - angle(w[0].x) > LEAST_ANGLE);
    if distinct && angle(round[1].x) > LEAST_ANGLE {
        points.clone_from_slice(&round);
    }
}
