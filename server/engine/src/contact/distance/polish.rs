//! Two near points of two bodies made nearest: a bound from above.
//!
//! Least ½|x − y|² under the literals that both trees are around the points is found by Newton's method on the conditions of Karush,
//! Kuhn and Tucker with an active set of literals (`active_set`). What comes out is a guess; both points are then moved inwards by as much
//! as rounding may hide, and both trees are asked whether they are inside.

use super::active_set::{ActiveSet, Clause, MOST_MET, REGULAR, clause};
use super::part::literal_at;
use crate::contact::query::outcome::NO_FACE;
use crate::contact::witness::newton::hessian;
use crate::math::Aabb;
use crate::math::gjk::least_of;
use crate::math::linear::eliminated;
use crate::motion::Instant;
use crate::octree::Model;
use crate::solid::local::{LiteralId, Token, Truth};
use crate::solid::{Face, Sense};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// Rounds in which the alternatives are chosen anew.
const CHOICES: usize = 3;
/// Literals this near to 0, relative to the size, count as met at first.
const MET: f64 = 1e-7;
/// What of a large mesh matters to a point that is looked for lies within this many times its f.
const AROUND: f64 = 2.0;
/// Steps down along f at most, how much farther than to the face that decides they lead, and places from where they begin.
const DESCENT: usize = 64;
const BEYOND: f64 = 1.5;
const STARTS: usize = 8;
/// Faces of a body that are looked through for others at a point.
const MOST_FACES: usize = 256;
/// Literals this near to 0, relative to the size, are told as the features of a point.
pub const FEATURE: f64 = 1e-9;

/// A point of each body.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// Of A, A's model frame.
    pub x: DVec3,
    /// Of B, B's model frame.
    pub y: DVec3,
    /// Their distance, rounding added: no less than the bodies' distance. A length.
    pub distance: f64,
}

/// What a body is to the polishing.
#[derive(Clone, Copy)]
pub struct Side<'s, 'a> {
    /// Its model.
    pub model: &'a Model,
    /// What of its tree is looked at.
    pub tokens: &'s [Token],
}

/// Two bodies at an instant.
pub struct Polish<'s, 'a> {
    /// The bodies.
    pub sides: [Side<'s, 'a>; 2],
    /// The instant.
    pub at: &'s Instant,
    /// The pair's size, a length.
    pub scale: f64,
    /// What rounding may do to f, a length.
    pub rounding: f64,
    /// How near its steps begin, and end.
    pub steps: Steps,
}

/// Where Newton's steps begin and end.
#[derive(Clone, Copy, Debug)]
pub struct Steps {
    /// Literals this near to 0 count as met at first, in the pair's size.
    pub met: f64,
    /// A step of this length is the last one, in the pair's size.
    pub last: f64,
    /// Steps at most.
    pub most: usize,
    /// The longest step, in the pair's size.
    pub longest: f64,
}

/// What of a point is fixed while the other one moves: it goes along some directions alone, A's axes, or nowhere.
#[derive(Clone, Copy, Debug)]
pub struct Held<'s> {
    /// Whose point.
    pub side: usize,
    /// Where it may go: unit vectors, square to each other.
    pub along: &'s [DVec3],
}

impl Held<'_> {
    /// A point that stays.
    pub fn still(side: usize) -> Self {
        Self { side, along: &[] }
    }
}

impl Steps {
    /// From where hulls of parts come nearest to what is hardly more than rounding.
    pub const ALL: Self = Self { met: MET, last: 1e-14, most: 40, longest: 0.25 };
}

impl Polish<'_, '_> {
    /// The *and* of literals that a body is around a point. Where a mesh's part stands in the way, of what of it matters near the point: in
    /// a box that holds some of its surface, or of its inside, if its f tells how far that is.
    fn clause(&self, side: usize, x: DVec3) -> Option<Clause> {
        let Side { model, tokens } = self.sides[side];
        let mut psi = |f: u32| model.solid.faces[f as usize].value(x);
        if let Some(known) = clause(tokens, &mut psi) {
            return Some(known);
        }
        let reach = DVec3::splat(AROUND * (model.value(x).abs() + MET * self.scale));
        let (region, mut near) = (Aabb { min: x - reach, max: x + reach }, Vec::new());
        match model.solid.prune_to_box(tokens, &region, (0.0, self.rounding), &mut near) {
            Truth::Open => clause(&near, &mut psi),
            Truth::True => Some(Clause::new()),
            Truth::False => None,
        }
    }

    fn at(&self, side: usize, id: LiteralId, x: DVec3) -> (f64, DVec3) {
        literal_at(&self.sides[side].model.solid.faces[id.face() as usize], id.sense(), x)
    }

    /// The points of both bodies, verified, to which x (A's frame) and y (B's) lead; `None` where they lead to none. What of a large mesh
    /// is around a point that is far from its surface is too much to be looked at: then from where f leads down to.
    pub fn run(&self, x: DVec3, y: DVec3) -> Option<Pair> {
        let below = || {
            let has_parts = self.sides.iter().any(|side| side.model.solid.has_parts);
            has_parts.then(|| Some((self.descended(0, x)?, self.descended(1, y)?))).flatten()
        };
        self.run_from(x, y).or_else(|| below().and_then(|(x, y)| self.run_from(x, y)))
    }

    /// Down along f from a point, or else from what is inside of a primitive: somewhere in the body, if that leads there.
    fn descended(&self, side: usize, x: DVec3) -> Option<DVec3> {
        let model = self.sides[side].model;
        let inside = model.solid.primitives.iter().map(|p| p.frame.point(p.shape.geometry().interior_point()));
        std::iter::once(x).chain(inside).take(STARTS).find_map(|mut x| {
            for _ in 0..DESCENT {
                let (f, id) = model.deciding(x);
                if f <= -self.rounding {
                    return Some(x);
                }
                x -= self.at(side, id, x).1 * (BEYOND * f.max(0.0) + 4.0 * self.rounding);
            }
            None
        })
    }

    fn run_from(&self, mut x: DVec3, mut y: DVec3) -> Option<Pair> {
        let mut best = self.verified(x, y);
        let mut keep = |found: Option<Pair>| {
            if let Some(found) = found
                && best.is_none_or(|b: Pair| found.distance < b.distance)
            {
                best = Some(found);
            }
            found.is_some()
        };
        let tips = [self.tips(0, x), self.tips(1, y)];
        for (p, q) in tips[0].iter().flat_map(|p| tips[1].iter().map(move |q| (p, q))) {
            keep(self.verified(*p, *q));
        }
        for held in [0, 1] {
            for tip in &tips[held] {
                let start = if held == 0 { (*tip, y) } else { (x, *tip) };
                let (Some(a), Some(b)) = (self.clause(0, start.0), self.clause(1, start.1)) else { continue };
                let clauses = [a, b];
                let (p, q, _) = self.solve(&clauses, start, Some(Held::still(held)));
                keep(self.verified(p, q));
            }
        }
        for _ in 0..CHOICES {
            let (Some(a), Some(b)) = (self.clause(0, x), self.clause(1, y)) else { break };
            let clauses = [a, b];
            (x, y, _) = self.solve(&clauses, (x, y), None);
            if !(x.is_finite() && y.is_finite()) || keep(self.verified(x, y)) {
                break;
            }
        }
        best
    }

    /// Points beside one of a body, in its frame, at a length along its faces there towards `way`: where a part ends on another one, that
    /// goes on beneath. None where the part that decides there has all faces.
    pub fn beside(&self, side: usize, x: DVec3, way: DVec3, length: f64) -> SmallVec<[DVec3; 4]> {
        let faces = &self.sides[side].model.solid.faces;
        let clause = if faces.len() <= MOST_FACES { self.clause(side, x) } else { None };
        let Some(clause) = clause else { return SmallVec::new() };
        let reach = FEATURE * self.scale + 1e3 * self.rounding;
        let met = |id: &&LiteralId| self.at(side, **id, x).0.abs() <= reach;
        let is_other = |f: usize| !clause.iter().any(|id| id.face() as usize == f) && faces[f].value(x).abs() <= reach;
        if clause.iter().filter(met).count() < 2 || !(0..faces.len()).any(is_other) {
            return SmallVec::new();
        }
        let along = |id: &LiteralId| {
            let normal = self.at(side, *id, x).1.normalize_or_zero();
            (way - normal * normal.dot(way)).try_normalize()
        };
        clause.iter().filter(met).filter_map(along).map(|s| x + s * length).collect()
    }

    /// The apexes of a body's cones that hold around a point, those that are its own.
    fn tips(&self, side: usize, x: DVec3) -> SmallVec<[DVec3; 2]> {
        let model = self.sides[side].model;
        let clause = self.clause(side, x).unwrap_or_default();
        let positive = clause.iter().filter(|id| id.sense() == Sense::Positive);
        let apexes = positive.filter_map(|id| model.solid.faces[id.face() as usize].apex());
        apexes.map(|apex| apex.point).filter(|tip| model.value(*tip) <= 2.0 * self.rounding).collect()
    }

    /// The same two points, moved inwards by hardly anything, where they are inside then.
    fn verified(&self, x: DVec3, y: DVec3) -> Option<Pair> {
        let (u, v) = (self.inside(0, x)?, self.inside(1, y)?);
        Some(Pair { x: u, y: v, distance: (u - self.at.a_point(v)).length() + 2.0 * self.rounding })
    }

    /// A point of the body next to x, proven inside.
    fn inside(&self, side: usize, x: DVec3) -> Option<DVec3> {
        let model = self.sides[side].model;
        let is_inside = |x: DVec3| model.value(x) <= -self.rounding;
        if is_inside(x) {
            return Some(x);
        }
        let clause = self.clause(side, x)?;
        let faces = clause.iter().map(|id| &self.sides[side].model.solid.faces[id.face() as usize]);
        let apexes = faces.filter_map(Face::apex).filter(|a| (a.point - x).length() <= MET * self.scale);
        for apex in apexes {
            let into = apex.axis / apex.sin;
            let found =
                [4.0, 16.0, 64.0].into_iter().map(|k| apex.point + into * (k * self.rounding)).find(|x| is_inside(*x));
            if found.is_some() {
                return found;
            }
        }
        let near = |id: &LiteralId| Some(self.at(side, *id, x)).filter(|at| at.0 > -1e3 * self.rounding);
        let outward: SmallVec<[DVec3; 8]> = clause.iter().filter_map(near).map(|at| at.1).collect();
        let m = least_of(&outward)?;
        let inwards = -m / m.length_squared();
        [2.0, 8.0, 64.0].into_iter().map(|k| x + inwards * (k * self.rounding)).find(|x| is_inside(*x))
    }

    /// Newton's steps of both points, each in its body's frame, among the literals of each body that is not held; and whether they have
    /// come to an end.
    pub fn solve(
        &self,
        clauses: &[Clause; 2],
        (mut x, mut y): (DVec3, DVec3),
        held: Option<Held>,
    ) -> (DVec3, DVec3, bool) {
        let free = |side: usize| held.is_none_or(|held| held.side != side);
        let mut met: [ActiveSet; 2] = Default::default();
        let (near, tiny) = (self.steps.met * self.scale, 4.0 * self.rounding);
        for (side, p) in [(0, x), (1, y)].into_iter().filter(|(side, _)| free(*side)) {
            met[side] = ActiveSet::new(&clauses[side], near, |id| self.at(side, id, p).0);
        }
        for _ in 0..self.steps.most {
            let way = self.at.a_point(y) - x;
            // Towards the other point, in the side's frame.
            met[0].weigh(way, |id| self.at(0, id, x).1);
            met[1].weigh(-(self.at.b_from_a * way), |id| self.at(1, id, y).1);
            let Some((p, q)) = self.step(&met, (x, y), held) else { break };
            let length = p.length().max(q.length());
            let most = self.steps.longest * self.scale;
            let damp = if length > most { most / length } else { 1.0 };
            (x, y) = (x + p * damp, y + q * damp);
            let mut changed = false;
            for (side, at) in [(0, x), (1, y)].into_iter().filter(|(side, _)| free(*side)) {
                changed |= met[side].enter(&clauses[side], tiny, |id| self.at(side, id, at).0);
            }
            if !changed && length <= self.steps.last * self.scale {
                return (x, y, true);
            }
        }
        (x, y, false)
    }

    /// One step of both points, each in its frame: of the distance and what the weighted literals bend, among the ways that leave the
    /// literals met (the null-space method; J. Nocedal, S. Wright, Numerical Optimization, 2nd ed., 16.2).
    fn step(&self, met: &[ActiveSet; 2], (x, y): (DVec3, DVec3), held: Option<Held>) -> Option<(DVec3, DVec3)> {
        let mut bent = [DMat3::IDENTITY * (1.0 + REGULAR); 2];
        let mut ways: [Ways; 2] = Default::default();
        for side in [0, 1] {
            let p = if side == 0 { x } else { y };
            let mut literals: SmallVec<[(DVec3, f64); MOST_MET]> = SmallVec::new();
            let mut bend = DMat3::ZERO;
            for (id, weight) in met[side].iter() {
                let face = &self.sides[side].model.solid.faces[id.face() as usize];
                let (value, g) = literal_at(face, id.sense(), p);
                let sign = if id.sense() == Sense::Positive { 1.0 } else { -1.0 };
                bend += hessian(face, p) * (sign * weight);
                literals.push((g, -value));
            }
            if side == 1 {
                // Along A's axes.
                let turn = self.at.b_from_a;
                bend = turn.transpose() * bend * turn;
                literals.iter_mut().for_each(|l| l.0 = self.at.a_vector(l.0));
            }
            bent[side] += bend;
            ways[side] = match held {
                Some(held) if held.side == side => Ways { first: DVec3::ZERO, along: held.along.into() },
                _ => Ways::of(&literals),
            };
        }
        let apart = x - self.at.a_point(y);
        let [a, b] = &ways;
        let pull = [-apart - bent[0] * a.first + b.first, apart + a.first - bent[1] * b.first];
        let (m, n) = (a.along.len(), a.along.len() + b.along.len());
        let mut matrix = [[0.0; 6]; 6];
        let mut f = [0.0; 6];
        for (i, u) in a.along.iter().enumerate() {
            f[i] = u.dot(pull[0]);
            let own = bent[0] * *u;
            a.along.iter().enumerate().for_each(|(j, v)| matrix[i][j] = own.dot(*v));
            b.along.iter().enumerate().for_each(|(j, v)| {
                matrix[i][m + j] = -u.dot(*v);
                matrix[m + j][i] = matrix[i][m + j];
            });
        }
        for (i, u) in b.along.iter().enumerate() {
            f[m + i] = u.dot(pull[1]);
            let own = bent[1] * *u;
            b.along.iter().enumerate().for_each(|(j, v)| matrix[m + i][m + j] = own.dot(*v));
        }
        let step = eliminated(&mut matrix, f, n)?;
        let moved =
            |ways: &Ways, from: usize| ways.along.iter().zip(&step[from..]).fold(ways.first, |p, (u, s)| p + *u * *s);
        Some((moved(a, 0), self.at.b_from_a * moved(b, m)))
    }

    /// The faces at a point of one body: those of the literals that are nearly 0 there.
    pub fn faces(&self, side: usize, x: DVec3) -> [u32; 3] {
        let mut faces = [NO_FACE; 3];
        let Some(clause) = self.clause(side, x) else { return faces };
        let mut all: SmallVec<[(f64, u32); 16]> =
            clause.iter().map(|id| (self.at(side, *id, x).0.abs(), id.face())).collect();
        all.sort_by(|p, q| p.0.total_cmp(&q.0));
        let reach = FEATURE * self.scale + 1e3 * self.rounding;
        let near = all.iter().filter(|v| v.0 <= reach).map(|v| v.1);
        faces.iter_mut().zip(near).for_each(|(to, face)| *to = face);
        faces.sort_unstable();
        faces
    }
}

/// The ways from a point to where some literals are met, to first order: one of them, and what else leaves them met.
#[derive(Default)]
struct Ways {
    first: DVec3,
    along: SmallVec<[DVec3; 3]>,
}

impl Ways {
    /// Of literals by their gradients and by how much each has to rise, the ones before the others: what those before have told is not told
    /// again (orthogonalisation by Gram and Schmidt; G. Golub, C. Van Loan, Matrix Computations, 4th ed., 5.2.7).
    fn of(literals: &[(DVec3, f64)]) -> Self {
        let (mut first, mut told) = (DVec3::ZERO, SmallVec::<[DVec3; 3]>::new());
        for (g, rise) in literals {
            let rest = told.iter().fold(*g, |rest, e| rest - *e * e.dot(rest));
            let square = rest.length_squared();
            if told.len() < 3 && square > ALIKE * g.length_squared() {
                first += rest * ((rise - g.dot(first)) / square);
                told.push(rest / square.sqrt());
            }
        }
        let along = match told[..] {
            [] => SmallVec::from(DVec3::AXES),
            [e] => {
                let (u, v) = e.any_orthonormal_pair();
                SmallVec::from_slice(&[u, v])
            }
            [e, f] => SmallVec::from_slice(&[e.cross(f)]),
            _ => SmallVec::new(),
        };
        Self { first, along }
    }
}

/// The square of a sine below which two gradients are taken for one.
const ALIKE: f64 = 1e-10;
