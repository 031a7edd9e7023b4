//! The foot of a point on a solid: a guess made nearest by Newton's steps, then proven to be in what is sought. A bound from above.
//!
//! Least ½|y − x|² under the literals that are met, by Newton's method on the conditions of Karush, Kuhn and Tucker with an active set of
//! them (`contact/distance/active_set`). As two points of two bodies are made nearest (`contact/distance/polish`), with one of them fixed.

use super::{Sought, literal_at};
use crate::contact::distance::active_set::{ActiveSet, Clause, MOST_MET, REGULAR, clause};
use crate::contact::witness::newton::hessian;
use crate::math::gjk::least_of;
use crate::math::linear::eliminated;
use crate::octree::Model;
use crate::solid::Sense;
use crate::solid::local::{LiteralId, Token};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// Unknowns: a point and the weights.
const MOST: usize = 3 + MOST_MET;
/// Steps at most.
const STEPS: usize = 40;
/// Rounds in which the alternatives are chosen anew.
const CHOICES: usize = 3;
/// Literals this near to 0, relative to the size, count as met at first.
const MET: f64 = 1e-7;
/// Steps of the first descent along f.
const DESCENT: usize = 64;

/// What a foot is looked for in.
#[derive(Clone, Copy, Debug)]
pub struct Ground<'a> {
    /// The model.
    pub model: &'a Model,
    /// The solid or its complement.
    pub sought: Sought,
    /// The point, the model's frame.
    pub x: DVec3,
    /// What rounding may do to f, a length.
    pub rounding: f64,
    /// The size at hand, a length.
    pub scale: f64,
}

impl Ground<'_> {
    /// f as it is negative in what is sought.
    pub fn value(&self, y: DVec3) -> f64 {
        self.sought.value(self.model, y)
    }

    fn is_in(&self, y: DVec3) -> bool {
        self.value(y) <= -self.rounding
    }

    fn at(&self, id: LiteralId, y: DVec3) -> (f64, DVec3) {
        literal_at(self.model, id, y)
    }

    /// Down along f from the point: somewhere in what is sought, if that leads there.
    pub fn descended(&self) -> Option<DVec3> {
        let mut y = self.x;
        for _ in 0..DESCENT {
            if self.is_in(y) {
                return Some(y);
            }
            let (_, id) = self.model.deciding(y);
            let (value, g) = self.at(self.sought.literal(id), y);
            let square = g.length_squared();
            if square.is_nan() || square <= 1e-6 {
                return None;
            }
            y -= g * ((value.max(0.0) + 4.0 * self.rounding) / square);
        }
        None
    }

    /// The nearest point, proven, to which y leads; of an expression that holds around it.
    pub fn foot(&self, tokens: &[Token], mut y: DVec3) -> Option<DVec3> {
        let mut best: Option<DVec3> = None;
        let mut keep = |found: Option<DVec3>| {
            let away = |p: DVec3| (p - self.x).length_squared();
            if let Some(found) = found
                && best.is_none_or(|b| away(found) < away(b))
            {
                best = Some(found);
            }
            found.is_some()
        };
        keep(self.inside(&self.clause(tokens, y)?, y));
        for tip in self.tips(&self.clause(tokens, y)?) {
            keep(self.inside(&self.clause(tokens, tip)?, tip));
        }
        for _ in 0..CHOICES {
            y = self.solve(&self.clause(tokens, y)?, y);
            if !y.is_finite() || keep(self.inside(&self.clause(tokens, y)?, y)) {
                break;
            }
        }
        best
    }

    fn clause(&self, tokens: &[Token], y: DVec3) -> Option<Clause> {
        clause(tokens, &mut |f| self.model.solid.faces[f as usize].value(y))
    }

    /// The apexes of cones of a clause.
    fn tips(&self, clause: &Clause) -> SmallVec<[DVec3; 2]> {
        let positive = clause.iter().filter(|id| id.sense() == Sense::Positive);
        let apexes = positive.filter_map(|id| self.model.solid.faces[id.face() as usize].apex());
        apexes.map(|apex| apex.point).filter(|tip| self.value(*tip) <= 2.0 * self.rounding).collect()
    }

    /// A point next to y that is proven to be in what is sought.
    fn inside(&self, clause: &Clause, y: DVec3) -> Option<DVec3> {
        if self.is_in(y) {
            return Some(y);
        }
        for id in clause {
            let apex = self.model.solid.faces[id.face() as usize].apex();
            if let Some(apex) = apex.filter(|a| (a.point - y).length() <= MET * self.scale) {
                let into = apex.axis / apex.sin;
                let each = [4.0, 16.0, 64.0].into_iter().map(|k| apex.point + into * (k * self.rounding));
                if let Some(found) = each.into_iter().find(|y| self.is_in(*y)) {
                    return Some(found);
                }
            }
        }
        let near = |id: &LiteralId| Some(self.at(*id, y)).filter(|at| at.0 > -1e3 * self.rounding);
        let outward: SmallVec<[DVec3; 8]> = clause.iter().filter_map(near).map(|at| at.1).collect();
        let m = least_of(&outward)?;
        let inwards = -m / m.length_squared();
        [2.0, 8.0, 64.0].into_iter().map(|k| y + inwards * (k * self.rounding)).find(|y| self.is_in(*y))
    }

    fn solve(&self, clause: &Clause, mut y: DVec3) -> DVec3 {
        let mut met = ActiveSet::new(clause, MET * self.scale, |id| self.at(id, y).0);
        for _ in 0..STEPS {
            met.weigh(self.x - y, |id| self.at(id, y).1);
            let Some(step) = self.step(&met, y) else { break };
            let (length, most) = (step.length(), 0.25 * self.scale);
            y += step * if length > most { most / length } else { 1.0 };
            let enters = met.enter(clause, 4.0 * self.rounding, |id| self.at(id, y).0);
            if !enters && length <= 1e-14 * self.scale {
                break;
            }
        }
        y
    }

    fn step(&self, met: &ActiveSet, y: DVec3) -> Option<DVec3> {
        let n = 3 + met.len();
        let (mut a, mut f) = ([[0.0; MOST]; MOST], [0.0; MOST]);
        let mut block = DMat3::IDENTITY * (1.0 + REGULAR);
        for (i, (id, weight)) in met.iter().enumerate() {
            let face = &self.model.solid.faces[id.face() as usize];
            let (value, g) = self.at(id, y);
            let sign = if id.sense() == Sense::Positive { 1.0 } else { -1.0 };
            block += hessian(face, y) * (sign * weight);
            let k = 3 + i;
            for j in 0..3 {
                (a[j][k], a[k][j]) = (g[j], g[j]);
            }
            a[k][k] = -REGULAR;
            f[k] = -value - REGULAR * weight;
        }
        let way = self.x - y;
        for i in 0..3 {
            for j in 0..3 {
                a[i][j] = block.col(j)[i];
            }
            f[i] = way[i];
        }
        eliminated(&mut a, f, n).map(|step| DVec3::from_slice(&step[..3]))
    }
}
