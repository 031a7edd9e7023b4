//! The tree as seen from a small region: a flat list of tokens that shrinks as the region does.
//!
//! A solid is inside at depth delta where a monotone and/or-tree of literals holds: a positive primitive is the *and* of
//! its face literals (psi <= −delta), a subtracted one the *or* of its negated face literals (−psi <= −delta), union is or,
//! intersection is and, complements are pushed to the leaves by De Morgan's laws. In prefix order, one `u32` a token:
//! a literal (face id, negated?), an operator with the number of tokens below it, or a part of a large mesh that is written
//! out when somebody looks at a small region (`Solid::prune`). Where a literal's truth is known over
//! the whole region it folds away (`prune`); what stays is what the region's contacts depend on.
//!
//! Invariant: no operator stands directly below one of its own kind, and none has fewer than two operands.

use crate::math::halt;
use crate::solid::surface::Under;
use crate::solid::{Face, Sense};
use glam::DVec3;

/// One token; see the module's head.
pub type Token = u32;

pub(crate) const AND: u32 = 1 << 30;
pub(crate) const OR: u32 = 2 << 30;
pub(crate) const PART: u32 = 3 << 30;
pub(crate) const KIND: u32 = 3 << 30;
const NEGATED: u32 = 1 << 29;

/// A face with the sense in which it takes part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct LiteralId(pub(crate) u32);

impl LiteralId {
    /// A literal of face `face` (id within its model).
    pub fn new(face: u32, sense: Sense) -> Self {
        debug_assert!(face < NEGATED);
        Self(face | if sense == Sense::Negative { NEGATED } else { 0 })
    }
    /// Face id within the model.
    pub fn face(self) -> u32 {
        self.0 & !NEGATED
    }
    /// Positive: +psi; negative: −psi of a subtracted primitive.
    pub fn sense(self) -> Sense {
        if self.0 & NEGATED == 0 { Sense::Positive } else { Sense::Negative }
    }
}

/// What is known of an expression over a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Truth {
    /// Holds everywhere in the region.
    True,
    /// Holds nowhere in the region.
    False,
    /// Neither is proven.
    Open,
}

/// An expression taken apart by one level.
#[derive(Clone, Copy, Debug)]
pub enum Expression<'a> {
    /// One literal.
    Literal(LiteralId),
    /// All operands must hold.
    And(&'a [Token]),
    /// One operand must hold.
    Or(&'a [Token]),
    /// A part of a large mesh, which is not written out: its id among the faces of its model, and its sense.
    Part(LiteralId),
}

/// The first expression of `tokens` and the number of tokens it takes.
pub fn first(tokens: &[Token]) -> (Expression<'_>, usize) {
    let head = tokens[0];
    let len = (head & !KIND) as usize;
    match head & KIND {
        AND => (Expression::And(&tokens[1..1 + len]), 1 + len),
        OR => (Expression::Or(&tokens[1..1 + len]), 1 + len),
        PART => (Expression::Part(LiteralId(head & !KIND)), 1),
        _ => (Expression::Literal(LiteralId(head)), 1),
    }
}

/// The operands in the body of an operator.
pub fn operands(mut body: &[Token]) -> impl Iterator<Item = Expression<'_>> {
    std::iter::from_fn(move || {
        if body.is_empty() {
            return None;
        }
        let (e, n) = first(body);
        body = &body[n..];
        Some(e)
    })
}

/// The complement of an expression, by De Morgan's laws.
pub fn complement(tokens: &[Token]) -> Vec<Token> {
    // The bits of "and" and "or" are each other's.
    let flip = |t: &Token| if matches!(t & KIND, AND | OR) { t ^ (AND | OR) } else { t ^ NEGATED };
    tokens.iter().map(flip).collect()
}

/// All literals of an expression, in order; what its parts hold is not among them.
pub fn literals(tokens: &[Token]) -> impl Iterator<Item = LiteralId> + '_ {
    tokens.iter().filter(|t| **t & KIND == 0).map(|t| LiteralId(*t))
}

/// The literals of an expression and the parts that it has beside them, in order.
pub fn named(tokens: &[Token]) -> impl Iterator<Item = LiteralId> + '_ {
    let named = |t: &&Token| matches!(**t & KIND, 0 | PART);
    tokens.iter().filter(named).map(|t| LiteralId(*t & !KIND))
}

/// Writes an operator over operands that `each` appends one by one, folding constants, single operands and operands of
/// the same kind.
pub(crate) fn fold<I>(
    kind: u32,
    items: impl Iterator<Item = I>,
    out: &mut Vec<Token>,
    mut each: impl FnMut(I, &mut Vec<Token>) -> Truth,
) -> Truth {
    let (absorbing, neutral) = if kind == AND { (Truth::False, Truth::True) } else { (Truth::True, Truth::False) };
    let head = out.len();
    out.push(kind);
    let mut count = 0;
    for item in items {
        let at = out.len();
        let truth = each(item, out);
        if truth == absorbing {
            out.truncate(head);
            return absorbing;
        }
        if truth == neutral {
            debug_assert_eq!(out.len(), at);
            continue;
        }
        if out[at] & KIND == kind {
            // Same kind: its operands become ours.
            out.remove(at);
            count += 2;
        } else {
            count += 1;
        }
    }
    match count {
        0 => {
            out.truncate(head);
            neutral
        }
        1 => {
            out.remove(head);
            Truth::Open
        }
        _ => {
            let len = (out.len() - head - 1) as u32;
            out[head] = kind | len;
            Truth::Open
        }
    }
}

/// Appends to `out` what is left of the expression at the head of `tokens` once every literal is replaced by what
/// `classify` knows of it. Appends nothing unless the result is `Open`.
pub fn prune(tokens: &[Token], out: &mut Vec<Token>, classify: &mut impl FnMut(LiteralId) -> Truth) -> Truth {
    match first(tokens).0 {
        Expression::Literal(id) => {
            halt::work(2);
            let truth = classify(id);
            if truth == Truth::Open {
                out.push(id.0);
            }
            truth
        }
        Expression::And(body) => prune_operator(AND, body, out, classify),
        Expression::Or(body) => prune_operator(OR, body, out, classify),
        Expression::Part(id) => {
            out.push(part_token(id));
            Truth::Open
        }
    }
}

fn prune_operator(
    kind: u32,
    body: &[Token],
    out: &mut Vec<Token>,
    classify: &mut impl FnMut(LiteralId) -> Truth,
) -> Truth {
    let mut rest = body;
    let items = std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let (item, tail) = rest.split_at(first(rest).1);
        rest = tail;
        Some(item)
    });
    fold(kind, items, out, |item, out| prune(item, out, classify))
}

/// f of an expression at a point given the faces' values there: and = max, or = min, negated = −psi. Of what stands beside them
/// if there are parts.
pub fn value(tokens: &[Token], psi: &mut impl FnMut(u32) -> f64) -> f64 {
    value_of_literals(tokens, &mut |id| {
        let v = psi(id.face());
        if id.sense() == Sense::Positive { v } else { -v }
    })
}

/// What an expression makes of a number for each literal, as it does of their signed values: the largest in a conjunction, the least
/// in a disjunction. Not for expressions with parts.
pub fn value_of_literals(tokens: &[Token], of: &mut impl FnMut(LiteralId) -> f64) -> f64 {
    let (mut body, start, join): (_, _, fn(f64, f64) -> f64) = match first(tokens).0 {
        Expression::Literal(id) => return of(id),
        Expression::And(body) => (body, f64::NEG_INFINITY, f64::max),
        Expression::Or(body) => (body, f64::INFINITY, f64::min),
        Expression::Part(_) => return f64::NAN,
    };
    let mut v = start;
    while !body.is_empty() {
        let n = first(body).1;
        v = join(v, value_of_literals(&body[..n], of));
        body = &body[n..];
    }
    v
}

/// f of an expression with the literal that decides it (the first of equals); `None` where there are parts alone.
pub fn decided(tokens: &[Token], psi: &mut impl FnMut(u32) -> f64) -> Option<(f64, LiteralId)> {
    let (e, _) = first(tokens);
    let (mut body, larger) = match e {
        Expression::Literal(id) => {
            let v = psi(id.face());
            return Some((if id.sense() == Sense::Positive { v } else { -v }, id));
        }
        Expression::And(body) => (body, true),
        Expression::Or(body) => (body, false),
        Expression::Part(_) => return None,
    };
    let mut found: Option<(f64, LiteralId)> = None;
    while !body.is_empty() {
        let n = first(body).1;
        if let Some(one) = decided(&body[..n], psi)
            && found.is_none_or(|f| if larger { one.0 > f.0 } else { one.0 < f.0 })
        {
            found = Some(one);
        }
        body = &body[n..];
    }
    found
}

/// The same of an expression without parts.
pub fn deciding(tokens: &[Token], psi: &mut impl FnMut(u32) -> f64) -> (f64, LiteralId) {
    decided(tokens, psi).expect("an operator has operands")
}

/// Appends the conjunction of some open expressions.
pub fn write_and<'a>(parts: impl IntoIterator<Item = &'a [Token]>, out: &mut Vec<Token>) {
    let truth = fold(AND, parts.into_iter(), out, |part, out| {
        out.extend_from_slice(part);
        Truth::Open
    });
    debug_assert_eq!(truth, Truth::Open);
}

/// The token of a single literal.
pub fn literal_token(id: LiteralId) -> Token {
    id.0
}

/// The token of a part.
pub(crate) fn part_token(id: LiteralId) -> Token {
    PART | id.0
}

/// True for the token of a part.
pub(crate) fn is_part(token: Token) -> bool {
    token & KIND == PART
}

/// Bounds of psi over a region: (lower, upper).
pub type Span = (f64, f64);

/// Proven bounds of a face's psi over the box of half extents `half` around `center`, up to rounding.
/// Lower: the tangent at the centre (psi is convex, or falls below it by its `dip`) and the Lipschitz bound; upper: a convex function is largest at a
/// corner, which for a plane is v + Σ e|n|, for curved faces bounded by Lipschitz and by tangent plus curvature k·r²/(2ρ).
pub fn face_span(face: &Face, center: DVec3, half: DVec3) -> Span {
    let at = face.at(center);
    let tilt = at.normal.abs().dot(half);
    if at.k == 0.0 {
        return (at.value - tilt, at.value + tilt);
    }
    let r = half.length();
    let bulge = if at.rho > 0.0 { at.k * r * r / (2.0 * at.rho) } else { f64::INFINITY };
    let dip = if face.is_convex() { None } else { face.under(center, center).map(|u| Under::dip(u.k, u.rho, r)) };
    (at.value - (tilt + dip.unwrap_or(0.0)).min(r), at.value + (tilt + bulge).min(r))
}

/// Truth of a literal at depth `delta` from the bounds of its psi, each of them known to `rounding` (a length).
pub fn truth_of(sense: Sense, (lo, hi): Span, delta: f64, rounding: f64) -> Truth {
    let (lo, hi) = if sense == Sense::Positive { (lo, hi) } else { (-hi, -lo) };
    if hi <= -delta - rounding {
        Truth::True
    } else if lo > -delta + rounding {
        Truth::False
    } else {
        Truth::Open
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Aabb;
    use crate::solid::{Label, Op, Solid, SolidBuilder, primitive::*, write_tree};
    use contactd_proto::Pose;

    fn ring() -> Solid {
        let mut b = SolidBuilder::new();
        let outer = b.primitive(Cylinder { radius: 1.0, half_height: 0.5 }, Pose::IDENTITY, Label::default());
        let inner = b.primitive(Cylinder { radius: 0.6, half_height: 0.6 }, Pose::IDENTITY, Label::default());
        let cube = b.primitive(Cuboid { half: DVec3::splat(0.2) }, Pose::at(DVec3::X), Label::default());
        let cut = b.operation(Op::Union, &[inner, cube]);
        let root = b.operation(Op::Difference, &[outer, cut]);
        b.finish(root)
    }

    #[test]
    fn tokens_have_the_value_of_the_tree_and_so_has_what_a_box_leaves() {
        let s = ring();
        let mut tokens = vec![];
        assert_eq!(write_tree(&s, &mut tokens), Truth::Open);
        let mut open = 0;
        for i in 0..4000u32 {
            let r = |k: u32| f64::from((i * 7919 + k * 104729) % 1009) / 1009.0 * 2.6 - 1.3;
            let c = DVec3::new(r(1), r(2), 0.5 * r(3));
            let f = s.value(c);
            assert_eq!(value(&tokens, &mut |face| s.faces[face as usize].value(c)), f);
            let region = Aabb::around(c, DVec3::splat(0.07));
            let mut out = vec![];
            let truth = s.prune_to_box(&tokens, &region, (1e-9, 1e-15), &mut out);
            for x in region.corners().into_iter().chain([c]) {
                let f = s.value(x);
                match truth {
                    Truth::True => assert!(f <= 0.0),
                    Truth::False => assert!(f >= -1e-9),
                    Truth::Open => {
                        let g = value(&out, &mut |face| s.faces[face as usize].value(x));
                        assert!(g == f || (g <= 0.0) == (f <= 0.0), "{g} {f}");
                    }
                }
            }
            open += usize::from(truth == Truth::Open);
        }
        assert!(open > 400 && open < 3600, "{open}");
    }
}
