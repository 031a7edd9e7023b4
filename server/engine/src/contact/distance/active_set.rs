//! The active set of a nearest point: which literals are taken as met there, and how hard each holds.
//!
//! Around a point a tree is the *and* of some literals, of each group of alternatives the one that holds best there ([`choose`]). Where a
//! point of them is nearest to something, the conditions of Karush, Kuhn and Tucker name the literals that are met and a weight for each.
//! A set of them that changes is the usual method (J. Nocedal, S. Wright, Numerical Optimization, 2nd ed., 18.1): weights by least
//! squares, one that pulls the wrong way leaves the set, one that is violated enters it.

use crate::math::linear::eliminated;
use crate::solid::local::{self, Expression, LiteralId, Token};
use glam::DVec3;
use smallvec::SmallVec;

/// Literals met at a time.
pub const MOST_MET: usize = 4;

/// What is added to the curvature of the distance and taken from the conditions, so that neither what slides freely nor a condition
/// too many makes the system singular.
pub const REGULAR: f64 = 1e-10;

/// Literals that hold at a point.
pub type Clause = SmallVec<[LiteralId; 16]>;

/// Appends an *and* of literals at x: of alternatives the one that is least there. False where a mesh's part stands in the way.
pub fn choose(tokens: &[Token], psi: &mut impl FnMut(u32) -> f64, out: &mut Clause) -> bool {
    match local::first(tokens).0 {
        Expression::Literal(id) => out.push(id),
        Expression::And(mut body) => {
            while !body.is_empty() {
                let n = local::first(body).1;
                if !choose(&body[..n], psi, out) {
                    return false;
                }
                body = &body[n..];
            }
        }
        Expression::Or(mut body) => {
            let mut best: Option<(f64, &[Token])> = None;
            while !body.is_empty() {
                let n = local::first(body).1;
                let v = local::value(&body[..n], psi);
                if best.is_none_or(|b| v < b.0) {
                    best = Some((v, &body[..n]));
                }
                body = &body[n..];
            }
            return best.is_some_and(|b| choose(b.1, psi, out));
        }
        Expression::Part(_) => return false,
    }
    true
}

/// The *and* of literals that a tree is around a point, by the faces' ψ there; `None` where a mesh's part stands in the way.
pub fn clause(tokens: &[Token], psi: &mut impl FnMut(u32) -> f64) -> Option<Clause> {
    let mut clause = Clause::new();
    (tokens.is_empty() || choose(tokens, psi, &mut clause)).then_some(clause)
}

/// The literals that are taken as met, with their weights.
#[derive(Clone, Debug, Default)]
pub struct ActiveSet(SmallVec<[(LiteralId, f64); MOST_MET]>);

impl ActiveSet {
    /// The highest literals of a clause among those above −`near`, a length; without weights yet.
    pub fn new(clause: &Clause, near: f64, value: impl Fn(LiteralId) -> f64) -> Self {
        let mut all: SmallVec<[(f64, LiteralId); 16]> =
            clause.iter().map(|id| (value(*id), *id)).filter(|v| v.0 > -near).collect();
        all.sort_by(|p, q| q.0.total_cmp(&p.0));
        Self(all.iter().take(MOST_MET).map(|v| (v.1, 0.0)).collect())
    }

    /// The literals and their weights.
    pub fn iter(&self) -> impl Iterator<Item = (LiteralId, f64)> {
        self.0.iter().copied()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Gives the literals the weights with which their gradients pull most nearly along `way`, those that would pull back leaving: least
    /// squares without negative weights.
    pub fn weigh(&mut self, way: DVec3, gradient: impl Fn(LiteralId) -> DVec3) {
        loop {
            let gradients: SmallVec<[DVec3; MOST_MET]> = self.0.iter().map(|m| gradient(m.0)).collect();
            let n = gradients.len();
            let (mut a, mut f) = ([[0.0; MOST_MET]; MOST_MET], [0.0; MOST_MET]);
            for i in 0..n {
                for j in 0..n {
                    a[i][j] = gradients[i].dot(gradients[j]);
                }
                a[i][i] += REGULAR;
                f[i] = gradients[i].dot(way);
            }
            let Some(weights) = eliminated(&mut a, f, n) else { return };
            self.0.iter_mut().zip(weights).for_each(|(m, weight)| m.1 = weight);
            let back = (0..n).min_by(|i, j| weights[*i].total_cmp(&weights[*j]));
            match back.filter(|i| weights[*i] < -1e-9 * way.length()) {
                Some(i) => self.0.remove(i),
                None => return,
            };
        }
    }

    /// Takes in the literal of a clause that is violated most, if by more than `tiny`, a length, and if there is room. True where one was
    /// taken in.
    pub fn enter(&mut self, clause: &Clause, tiny: f64, value: impl Fn(LiteralId) -> f64) -> bool {
        let out = clause.iter().filter(|id| !self.0.iter().any(|m| m.0 == **id));
        let worst = out.map(|id| (value(*id), *id)).max_by(|a, b| a.0.total_cmp(&b.0));
        let enters = worst.filter(|w| w.0 > tiny && self.0.len() < MOST_MET);
        self.0.extend(enters.map(|w| (w.1, 0.0)));
        enters.is_some()
    }
}
