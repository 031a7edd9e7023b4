//! A primitive that is no intersection of its faces: an and/or formula over them, the same tokens as a tree's (`local`).
//!
//! Literals name the primitive's own faces, from 0. The operands of an operator stand so that the cheap ones that settle it come
//! first: a bound that needs nothing of what stands behind them skips it, so a look at a small box costs what is in that box.

use super::Sense;
use super::local::{self, Expression, LiteralId, Span, Token, Truth};

/// A formula over the faces of one primitive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Formula(Vec<Token>);

impl Formula {
    /// Of tokens as `local` has them, at least one.
    pub(crate) fn new(tokens: Vec<Token>) -> Self {
        debug_assert!(!tokens.is_empty());
        Self(tokens)
    }

    /// Its tokens; face ids count from the primitive's first.
    pub fn tokens(&self) -> &[Token] {
        &self.0
    }

    /// Appends it to `out` (complemented where `sense` is negative) with what `truth` says of each literal, ids counted from
    /// `first_face`.
    pub(super) fn write(
        &self,
        (first_face, sense): (u32, Sense),
        out: &mut Vec<Token>,
        truth: &mut impl FnMut(LiteralId) -> Truth,
    ) -> Truth {
        write(local::first(&self.0).0, first_face, sense, out, truth)
    }

    /// Its value at a point, from the faces' values there.
    pub fn value(&self, psi: &mut impl FnMut(u32) -> f64) -> f64 {
        value(local::first(&self.0).0, psi, (f64::NEG_INFINITY, f64::INFINITY))
    }

    /// Bounds of its value over a region, from the faces'.
    pub fn span(&self, psi: &mut impl FnMut(u32) -> Span) -> Span {
        span(local::first(&self.0).0, psi, (f64::NEG_INFINITY, f64::INFINITY))
    }
}

fn write(
    e: Expression,
    first_face: u32,
    sense: Sense,
    out: &mut Vec<Token>,
    truth: &mut impl FnMut(LiteralId) -> Truth,
) -> Truth {
    let (body, all) = match e {
        Expression::Literal(id) => {
            let own = if sense == Sense::Positive { id.sense() } else { id.sense().flipped() };
            let id = LiteralId::new(first_face + id.face(), own);
            let known = truth(id);
            if known == Truth::Open {
                out.push(local::literal_token(id));
            }
            return known;
        }
        Expression::And(body) => (body, sense == Sense::Positive),
        Expression::Or(body) => (body, sense == Sense::Negative),
    };
    let kind = if all { local::AND } else { local::OR };
    let head = out.len();
    let neutral = if all { Truth::True } else { Truth::False };
    local::fold(kind, local::operands(body), out, |operand, out| {
        let at = out.len();
        let known = write(operand, first_face, sense, out, truth);
        // Where two cells overlap both say the same of what is left there.
        if known == Truth::Open
            && (out[head + 1..at] == out[at..] || starts_with(out[at], kind, &out[head + 1..at], &out[at + 1..]))
        {
            out.truncate(at);
            return neutral;
        }
        known
    })
}

/// True where an operator of this kind has these operands.
fn starts_with(token: Token, kind: u32, before: &[Token], body: &[Token]) -> bool {
    token & local::KIND == kind && before == body
}

/// The value, exact within the window; beyond it a bound on the same side.
fn value(e: Expression, psi: &mut impl FnMut(u32) -> f64, (low, high): (f64, f64)) -> f64 {
    match e {
        Expression::Literal(id) => {
            let v = psi(id.face());
            if id.sense() == Sense::Positive { v } else { -v }
        }
        Expression::And(body) => {
            let mut most = f64::NEG_INFINITY;
            for operand in local::operands(body) {
                most = most.max(value(operand, psi, (low.max(most), high)));
                if most >= high {
                    break;
                }
            }
            most
        }
        Expression::Or(body) => {
            let mut least = f64::INFINITY;
            for operand in local::operands(body) {
                least = least.min(value(operand, psi, (low, high.min(least))));
                if least <= low {
                    break;
                }
            }
            least
        }
    }
}

/// Bounds, exact where they lie in the window: what lies wholly above or below it changes nothing around it.
fn span(e: Expression, psi: &mut impl FnMut(u32) -> Span, (floor, ceiling): (f64, f64)) -> Span {
    match e {
        Expression::Literal(id) => {
            let (lo, hi) = psi(id.face());
            if id.sense() == Sense::Positive { (lo, hi) } else { (-hi, -lo) }
        }
        Expression::And(body) => {
            let (mut lo, mut hi) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
            for operand in local::operands(body) {
                let (l, h) = span(operand, psi, (floor.max(lo), ceiling));
                (lo, hi) = (lo.max(l), hi.max(h));
                if lo >= ceiling {
                    return (lo, f64::INFINITY);
                }
            }
            (lo, hi)
        }
        Expression::Or(body) => {
            let (mut lo, mut hi) = (f64::INFINITY, f64::INFINITY);
            for operand in local::operands(body) {
                let (l, h) = span(operand, psi, (floor, ceiling.min(hi)));
                (lo, hi) = (lo.min(l), hi.min(h));
                if hi <= floor {
                    return (f64::NEG_INFINITY, hi);
                }
            }
            (lo, hi)
        }
    }
}
