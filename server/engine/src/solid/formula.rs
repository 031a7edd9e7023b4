//! A primitive that is no intersection of its faces: an and/or formula over them, the same tokens as a tree's (`local`).
//!
//! Literals name the primitive's own faces, from 0. The operands of an operator stand so that the cheap ones that settle it come
//! first: a bound that needs nothing of what stands behind them skips it, so a look at a small box costs what is in that box.
//!
//! The formula of a large mesh is not written out: it is a division of space (`Division`) whose parts are, each when it is looked at.

use super::Sense;
use super::local::{self, Expression, LiteralId, Span, Token, Truth};
use crate::math::halt;
use glam::DVec3;
use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

/// A formula over the faces of one primitive.
#[derive(Clone, Debug)]
pub enum Formula {
    /// Written out.
    Written(Vec<Token>),
    /// Of a large mesh.
    Divided(Arc<dyn Division>),
}

/// Half of a division: what holds in it, with the plane (a face's number) on whose inner side it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// Inside everywhere, or nowhere.
    Known(bool),
    /// A part, by the number of its face.
    Part(u32),
    /// Divided again, by its number.
    Divided(u32),
}

/// A part that is written out.
#[derive(Clone, Debug, PartialEq)]
pub enum Part {
    /// Inside everywhere, or nowhere.
    Known(bool),
    /// A formula of faces of the primitive.
    Open(Box<[Token]>),
    /// Without a formula that passed its check: solid whatever the sense, so that nothing meets too late there.
    Unclear,
}

/// A formula that divides space: all of `around` and what it is within them, which is (x beyond no plane p and L) or (x beyond no
/// plane q and R), and so on. Numbers and formulas depend on nothing but the mesh.
pub trait Division: fmt::Debug + Send + Sync {
    /// The faces whose planes cut all of it off.
    fn around(&self) -> [u32; 6];
    /// What it is within these.
    fn whole(&self) -> Place;
    /// Two halves, each with the face of the plane in front of it.
    fn halves(&self, divided: u32) -> [(u32, Place); 2];
    /// A part, written out now if need be.
    fn part(&self, part: u32) -> &Part;
    /// Bounds of the value over a box in the primitive's frame, the faces being known to `rounding` (a length): what is not known at
    /// little cost is infinite.
    fn span(&self, center: DVec3, half: DVec3, rounding: f64) -> Span;
}

/// A value of +infinity or −infinity for what is known.
fn known(inside: bool) -> f64 {
    if inside { f64::NEG_INFINITY } else { f64::INFINITY }
}

impl Formula {
    /// Of tokens as `local` has them, at least one.
    pub(crate) fn new(tokens: Vec<Token>) -> Self {
        debug_assert!(!tokens.is_empty());
        Self::Written(tokens)
    }

    /// Its tokens; face ids count from the primitive's first. Of a large mesh all of them are written out for that.
    pub fn tokens(&self) -> Cow<'_, [Token]> {
        match self {
            Formula::Written(tokens) => Cow::Borrowed(tokens),
            Formula::Divided(division) => {
                let (mut coarse, mut out) = (Vec::new(), Vec::new());
                let mut open = |_: LiteralId| Truth::Open;
                write_division(division.as_ref(), 0, Sense::Positive, &mut coarse, &mut open);
                open_parts(&coarse, &mut out, &mut |id, out| self.open(id, 0, out, &mut |_| Truth::Open));
                Cow::Owned(out)
            }
        }
    }

    /// True where it is not written out.
    pub fn is_divided(&self) -> bool {
        matches!(self, Formula::Divided(_))
    }

    /// Appends it to `out` (complemented where `sense` is negative) with what `truth` says of each literal, ids counted from
    /// `first_face`. Parts are not written out.
    pub(super) fn write(
        &self,
        (first_face, sense): (u32, Sense),
        out: &mut Vec<Token>,
        truth: &mut impl FnMut(LiteralId) -> Truth,
    ) -> Truth {
        match self {
            Formula::Written(tokens) => write(local::first(tokens).0, first_face, sense, out, truth),
            Formula::Divided(division) => write_division(division.as_ref(), first_face, sense, out, truth),
        }
    }

    /// Appends what a part says, as `write` does.
    pub(super) fn open(
        &self,
        part: LiteralId,
        first_face: u32,
        out: &mut Vec<Token>,
        truth: &mut impl FnMut(LiteralId) -> Truth,
    ) -> Truth {
        let Formula::Divided(division) = self else { return Truth::Open };
        match division.part(part.face() - first_face) {
            Part::Known(inside) if *inside == (part.sense() == Sense::Positive) => Truth::True,
            Part::Known(_) => Truth::False,
            Part::Unclear => Truth::True,
            Part::Open(tokens) => write(local::first(tokens).0, first_face, part.sense(), out, truth),
        }
    }

    /// Its value at a point, from the faces' values there.
    pub fn value(&self, psi: &mut impl FnMut(u32) -> f64) -> f64 {
        match self {
            Formula::Written(tokens) => value(local::first(tokens).0, psi, (f64::NEG_INFINITY, f64::INFINITY)),
            Formula::Divided(division) => {
                let outer = division.around().into_iter().map(&mut *psi).fold(f64::NEG_INFINITY, f64::max);
                outer.max(value_in(division.as_ref(), division.whole(), psi, (outer, f64::INFINITY)))
            }
        }
    }

    /// Bounds of its value over the box center ± half in the primitive's frame, from the faces' or, of a large mesh, with these
    /// known to `rounding` (a length).
    pub fn span(&self, (center, half, rounding): (DVec3, DVec3, f64), psi: &mut impl FnMut(u32) -> Span) -> Span {
        match self {
            Formula::Written(tokens) => span(local::first(tokens).0, psi, (f64::NEG_INFINITY, f64::INFINITY)),
            Formula::Divided(division) => division.span(center, half, rounding),
        }
    }
}

/// The value of some tokens at a point, from the faces' values there.
pub fn value_of(tokens: &[Token], psi: &mut impl FnMut(u32) -> f64) -> f64 {
    value(local::first(tokens).0, psi, (f64::NEG_INFINITY, f64::INFINITY))
}

/// Bounds of the value of some tokens over a region, from the faces'.
pub fn span_of(tokens: &[Token], psi: &mut impl FnMut(u32) -> Span) -> Span {
    span(local::first(tokens).0, psi, (f64::NEG_INFINITY, f64::INFINITY))
}

/// Appends a division: see `Formula::write`.
fn write_division(
    division: &dyn Division,
    first_face: u32,
    sense: Sense,
    out: &mut Vec<Token>,
    truth: &mut impl FnMut(LiteralId) -> Truth,
) -> Truth {
    let (all, any) = if sense == Sense::Positive { (local::AND, local::OR) } else { (local::OR, local::AND) };
    let around = division.around();
    local::fold(all, 0..7, out, |i, out| {
        if i < 6 {
            literal(first_face + around[i], sense, out, truth)
        } else {
            write_place(division, division.whole(), (first_face, sense), (all, any), out, truth)
        }
    })
}

fn literal(face: u32, sense: Sense, out: &mut Vec<Token>, truth: &mut impl FnMut(LiteralId) -> Truth) -> Truth {
    halt::work(2);
    let id = LiteralId::new(face, sense);
    let known = truth(id);
    if known == Truth::Open {
        out.push(local::literal_token(id));
    }
    known
}

fn write_place(
    division: &dyn Division,
    place: Place,
    (first_face, sense): (u32, Sense),
    (all, any): (u32, u32),
    out: &mut Vec<Token>,
    truth: &mut impl FnMut(LiteralId) -> Truth,
) -> Truth {
    match place {
        Place::Known(inside) if inside == (sense == Sense::Positive) => Truth::True,
        Place::Known(_) => Truth::False,
        Place::Part(part) => {
            out.push(local::part_token(LiteralId::new(first_face + part, sense)));
            Truth::Open
        }
        Place::Divided(n) => {
            let halves = division.halves(n);
            local::fold(any, halves.into_iter(), out, |(face, place), out| {
                local::fold(all, 0..2, out, |i, out| {
                    if i == 0 {
                        literal(first_face + face, sense, out, truth)
                    } else {
                        write_place(division, place, (first_face, sense), (all, any), out, truth)
                    }
                })
            })
        }
    }
}

/// The value in a place, exact within the window; beyond it a bound on the same side. The nearer half comes first.
fn value_in(division: &dyn Division, place: Place, psi: &mut impl FnMut(u32) -> f64, (low, high): (f64, f64)) -> f64 {
    halt::work(2);
    match place {
        Place::Known(inside) => known(inside),
        Place::Part(part) => match division.part(part) {
            Part::Known(inside) => known(*inside),
            Part::Unclear => known(true),
            Part::Open(tokens) => {
                halt::work(tokens.len() / 2);
                value(local::first(tokens).0, psi, (low, high))
            }
        },
        Place::Divided(n) => {
            let mut halves = division.halves(n).map(|(face, place)| (psi(face), place));
            if halves[1].0 < halves[0].0 {
                halves.swap(0, 1);
            }
            let mut least = f64::INFINITY;
            for (plane, place) in halves {
                let high = high.min(least);
                if plane >= high {
                    least = least.min(plane);
                    continue;
                }
                least = least.min(plane.max(value_in(division, place, psi, (low.max(plane), high))));
                if least <= low {
                    break;
                }
            }
            least
        }
    }
}

/// Parts up to which what is left of an expression is written out.
const FEW_PARTS: usize = 32;

/// How many parts an expression has.
pub(super) fn parts(tokens: &[Token]) -> usize {
    tokens.iter().filter(|t| local::is_part(**t)).count()
}

/// True for so many parts as are written out.
pub(super) fn are_few(parts: usize) -> bool {
    (1..=FEW_PARTS).contains(&parts)
}

/// Writes out the parts of what stands behind `start` by `open`, where they are few.
pub(super) fn open_few(
    start: usize,
    out: &mut Vec<Token>,
    open: &mut impl FnMut(LiteralId, &mut Vec<Token>) -> Truth,
) -> Truth {
    if !are_few(parts(&out[start..])) {
        return Truth::Open;
    }
    let left = out.split_off(start);
    open_parts(&left, out, open)
}

/// Appends an expression with its parts written out by `open`; of two operands that say the same one stays, since where two cells
/// overlap both do.
pub(super) fn open_parts(
    tokens: &[Token],
    out: &mut Vec<Token>,
    open: &mut impl FnMut(LiteralId, &mut Vec<Token>) -> Truth,
) -> Truth {
    halt::work(1);
    let (kind, body) = match local::first(tokens).0 {
        Expression::Literal(id) => {
            out.push(local::literal_token(id));
            return Truth::Open;
        }
        Expression::Part(id) => return open(id, out),
        Expression::And(body) => (local::AND, body),
        Expression::Or(body) => (local::OR, body),
    };
    let neutral = if kind == local::AND { Truth::True } else { Truth::False };
    let mut rest = body;
    let items = std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let (item, tail) = rest.split_at(local::first(rest).1);
        rest = tail;
        Some(item)
    });
    let head = out.len();
    local::fold(kind, items, out, |item, out| {
        let at = out.len();
        let known = open_parts(item, out, open);
        if known == Truth::Open
            && (out[head + 1..at] == out[at..] || starts_with(out[at], kind, &out[head + 1..at], &out[at + 1..]))
        {
            out.truncate(at);
            return neutral;
        }
        known
    })
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
        Expression::Part(_) => return Truth::Open,
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
        // A formula that is written out has none.
        Expression::Part(_) => f64::NAN,
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
        Expression::Part(_) => (f64::NEG_INFINITY, f64::INFINITY),
    }
}
