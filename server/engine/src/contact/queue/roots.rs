//! Where the search starts: one box per positive alternative of a body.
//!
//! A contact point lies in some positive primitive of A, so A's expression is split at its bounded alternatives: an *or*
//! into its operands, an *and* along its bounded *or*. Each root carries only its own alternative, and its box is what the
//! positive primitives of that alternative have in common.
//!
//! At a negative depth −g it is {f <= g} that is split, and a point of it lies in {psi <= g} of a positive primitive: beyond
//! the primitive's own box, and at a corner beyond that box grown by g. A box that held the primitive alone would lie
//! inside {f <= g} and be taken for its interior, where no first contact is.

use crate::bound::{Bound, Volumes};
use crate::math::{Aabb, halt};
use crate::solid::local::{self, Expression, Token};
use crate::solid::{Sense, Solid};
use std::cell::Cell;

/// One alternative and the box that holds it (the solid's frame).
#[derive(Clone, Debug)]
pub struct Root {
    /// The box; never empty.
    pub region: Aabb,
    /// The expression within it.
    pub tokens: Vec<Token>,
}

/// Alternatives of an expression that is asked for within `region`, for points with f <= `level` (a length, not negative). At
/// most about `most` of them.
pub fn alternatives(solid: &Solid, tokens: &[Token], region: &Aabb, level: f64, most: usize) -> Vec<Root> {
    let mut out = Vec::new();
    split(&Grown { solid, level, most, last: Cell::new(None) }, tokens, region, &mut out);
    out
}

/// A solid whose primitives are asked for up to a level of f.
struct Grown<'s> {
    solid: &'s Solid,
    level: f64,
    most: usize,
    /// The primitive that was asked for last, and its box: most literals of a large mesh stand beside each other.
    last: Cell<Option<(u32, Aabb)>>,
}

impl Grown<'_> {
    fn box_of(&self, primitive: u32) -> Aabb {
        if let Some((_, aabb)) = self.last.get().filter(|last| last.0 == primitive) {
            return aabb;
        }
        let p = &self.solid.primitives[primitive as usize];
        let aabb = if self.level > 0.0 { Bound::of_primitive(p, self.level, Volumes::Both).aabb } else { p.aabb };
        self.last.set(Some((primitive, aabb)));
        aabb
    }
}

fn split(of: &Grown, tokens: &[Token], region: &Aabb, out: &mut Vec<Root>) {
    let region = bound(of, tokens).intersection(region);
    if region.is_empty() {
        return;
    }
    if out.len() >= of.most {
        out.push(Root { region, tokens: tokens.to_vec() });
        return;
    }
    match local::first(tokens).0 {
        Expression::Or(body) => each(body, |operand| split(of, operand, &region, out)),
        Expression::And(body) => {
            // The bounded operand with alternatives whose boxes together are smallest; the rest rides along.
            let mut pick: Option<(usize, &[Token])> = None;
            let mut at = 0;
            each(body, |operand| {
                if matches!(local::first(operand).0, Expression::Or(_))
                    && bound(of, operand).is_finite()
                    && pick.is_none()
                {
                    pick = Some((at, operand));
                }
                at += operand.len();
            });
            let Some((at, operand)) = pick else {
                out.push(Root { region, tokens: tokens.to_vec() });
                return;
            };
            let Expression::Or(inner) = local::first(operand).0 else { unreachable!("picked an or") };
            let mut rest: Vec<&[Token]> = Vec::new();
            let mut here = 0;
            each(body, |o| {
                if here != at {
                    rest.push(o);
                }
                here += o.len();
            });
            each(inner, |alternative| {
                let mut joined = Vec::new();
                local::write_and(std::iter::once(alternative).chain(rest.iter().copied()), &mut joined);
                split(of, &joined, &region, out);
            });
        }
        Expression::Literal(_) | Expression::Part(_) => out.push(Root { region, tokens: tokens.to_vec() }),
    }
}

/// Calls `f` with each operand of a body, operator included.
fn each<'t>(mut body: &'t [Token], mut f: impl FnMut(&'t [Token])) {
    while !body.is_empty() {
        let (operand, rest) = body.split_at(local::first(body).1);
        f(operand);
        body = rest;
    }
}

/// A box that holds an expression's points with f <= level: a positive literal lies in its whole primitive, whose other faces
/// stand beside it or hold throughout the region.
fn bound(of: &Grown, tokens: &[Token]) -> Aabb {
    halt::work(4);
    match local::first(tokens).0 {
        Expression::Literal(id) | Expression::Part(id) if id.sense() == Sense::Positive => {
            of.solid.face_owner.get(id.face() as usize).map_or(Aabb::ALL, |p| of.box_of(*p))
        }
        Expression::Literal(_) | Expression::Part(_) => Aabb::ALL,
        Expression::And(body) => {
            let mut b = Aabb::ALL;
            each(body, |o| b = b.intersection(&bound(of, o)));
            b
        }
        Expression::Or(body) => {
            let mut b = Aabb::EMPTY;
            each(body, |o| b = b.union(&bound(of, o)));
            b
        }
    }
}
