//! How far a solid is from a point at least: f, and beside edges at right angles the distance itself.
//!
//! A plane's literal speaks of the coordinate along its normal n alone. Another literal that slides along n (a plane at a right
//! angle to it, a cylinder along n, any outline that was extruded along n) speaks of the coordinates across n alone. Where a is how
//! far a point is from what the one allows, and b from what the other does, it is √(a² + b²) at least from what both allow: that
//! is Pythagoras. So it is with three planes at right angles at a corner, and with a literal that slides along the normals of two.
//! f says max(a, b), which beside an edge is less by up to a factor √2, at a corner √3.
//!
//! A plane whose literal contradicts another's, as the end of a through hole does the face that it ends beyond, allows nothing together
//! with it: no part of the solid lies there.

use crate::math::tolerance::RIGHT_ANGLE;
use crate::octree::Model;
use crate::solid::local::{self, Expression, LiteralId, Token};
use crate::solid::{Sense, Solid};
use glam::DVec3;
use smallvec::SmallVec;

/// Literals of one edge or corner.
pub(super) const MOST: usize = 3;

/// What is asked of each literal, and of those of an edge together.
pub(super) trait Measure {
    /// What is known of one literal.
    type Looked: Copy;
    /// What is told of literals that hold together.
    type Told: Copy;

    /// Looks at a literal.
    fn look(&self, id: LiteralId) -> Self::Looked;
    /// True where the point is on the outer side of what the literal allows.
    fn is_ahead(&self, looked: &Self::Looked) -> bool;
    /// Of one to `MOST` literals that speak of coordinates at right angles.
    fn together(&self, looked: &[Self::Looked]) -> Self::Told;
    /// Of an expression without operands: −∞ for what always holds, ∞ for what never does.
    fn constant(value: f64) -> Self::Told;
    /// What of two told the larger one is: that of a conjunction; of a disjunction it is the smaller.
    fn number(told: &Self::Told) -> f64;
}

/// By how much planes must miss each other to contradict, relative to how far the solid reaches: parallel ones are so up to rounding.
const CONTRADICTS: f64 = 1e-12;

/// A plane that holds a conjunction.
struct Held<L> {
    id: LiteralId,
    /// Out of what it allows, and how far along it that reaches.
    plane: (DVec3, f64),
    looked: L,
}

/// The solid, what is asked, and the planes that hold the expression that is looked at.
struct Walk<'w, M: Measure> {
    solid: &'w Solid,
    measure: &'w M,
    /// Planes contradict each other that miss each other by more.
    least: f64,
    held: SmallVec<[Held<M::Looked>; MOST]>,
}

/// What a measure makes of a solid without parts.
pub(super) fn of_solid<M: Measure>(model: &Model, measure: &M) -> M::Told {
    let (solid, ball) = (&model.solid, model.bounds.root().ball);
    let least = CONTRADICTS * (ball.center.length() + ball.radius);
    Walk { solid, measure, least, held: SmallVec::new() }.expression(&solid.normal_form)
}

impl<M: Measure> Walk<'_, M> {
    fn expression(&mut self, tokens: &[Token]) -> M::Told {
        let before = self.held.len();
        let (mut body, is_and) = match local::first(tokens).0 {
            Expression::Literal(id) | Expression::Part(id) => return self.literal(id),
            Expression::And(body) => (body, true),
            Expression::Or(body) => (body, false),
        };
        if is_and {
            for operand in local::operands(body) {
                if let Expression::Literal(id) = operand {
                    self.hold(id);
                }
            }
        }
        let mut told: Option<M::Told> = None;
        while !body.is_empty() {
            let n = local::first(body).1;
            let one = self.expression(&body[..n]);
            if told.as_ref().is_none_or(|best| (M::number(&one) > M::number(best)) == is_and) {
                told = Some(one);
            }
            body = &body[n..];
        }
        self.held.truncate(before);
        told.unwrap_or_else(|| M::constant(if is_and { f64::NEG_INFINITY } else { f64::INFINITY }))
    }

    /// The plane of a literal: out of what it allows.
    fn plane(&self, id: LiteralId) -> Option<(DVec3, f64)> {
        let (normal, offset) = self.solid.faces[id.face() as usize].flat()?;
        Some(if id.sense() == Sense::Positive { (normal, offset) } else { (-normal, -offset) })
    }

    /// Adds a plane that the point is ahead of, at right angles to those that hold already.
    fn hold(&mut self, id: LiteralId) {
        let Some(plane) = self.plane(id).filter(|_| self.held.len() < MOST) else { return };
        if self.held.iter().all(|other| plane.0.dot(other.plane.0).abs() < RIGHT_ANGLE) {
            let looked = self.measure.look(id);
            if self.measure.is_ahead(&looked) {
                self.held.push(Held { id, plane, looked });
            }
        }
    }

    fn literal(&self, id: LiteralId) -> M::Told {
        if let Some((normal, offset)) = self.plane(id)
            && self.held.iter().any(|other| {
                let is_opposite = normal.dot(other.plane.0) < 0.0 && normal.cross(other.plane.0).length() < RIGHT_ANGLE;
                is_opposite && -offset - other.plane.1 > self.least
            })
        {
            return M::constant(f64::INFINITY);
        }
        let mut edge: SmallVec<[M::Looked; MOST]> = SmallVec::new();
        edge.push(self.measure.look(id));
        let face = &self.solid.faces[id.face() as usize];
        let is_beside = |other: &&Held<_>| other.id != id && face.slides_along(other.plane.0, RIGHT_ANGLE);
        edge.extend(self.held.iter().filter(is_beside).map(|other| other.looked).take(MOST - 1));
        self.measure.together(&edge)
    }
}
