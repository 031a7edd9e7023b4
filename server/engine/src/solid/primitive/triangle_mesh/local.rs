//! The formula of the few facets that reach a small region.
//!
//! Pieces of facets bound a region's inside. In turn, until none are left:
//!
//! 1. A plane with all other pieces on its inner side: beyond it there is only outside, so it is and-ed with the formula of the
//!    rest. With all others on its outer side: or-ed.
//! 2. Pieces that no edge connects: each connected part bounds a region of its own. The formula of one that has all others in its
//!    inside is and-ed with theirs, with all others outside or-ed.
//! 3. Else a plane h of a facet cuts the rest in two. With L the formula below it and R the one above: (h and L) or (not h and R) or
//!    (L and R). The last says nothing new of what is inside; without it f would be 0 all over the plane.
//!
//! Each rule keeps the sign of f right in all of the region, and f negative inside, off the pieces: by induction, 1 and 2 since
//! neither bound is 0 but on pieces, 3 by its last operand. So |f| is at most the distance from the pieces.
//! In 1 and 2 each plane stands once, as in Peterson's formula of a polygon (`import/csg/polygon`).

use super::piece::{CUT, Piece};
use crate::solid::Sense;
use crate::solid::formula::value_of;
use crate::solid::local::{self, LiteralId, Token, Truth};
use glam::DVec3;
use std::collections::HashMap;

/// A formula, or what holds everywhere.
#[derive(Clone, Debug, PartialEq)]
pub enum Expr {
    /// Inside everywhere, or nowhere.
    Known(bool),
    /// A formula.
    Open(Vec<Token>),
}

impl Expr {
    /// A face's literal.
    pub fn literal(face: u32, sense: Sense) -> Self {
        Expr::Open(vec![local::literal_token(LiteralId::new(face, sense))])
    }

    /// All of some formulas (`all`), or one of them.
    pub fn join(all: bool, of: impl IntoIterator<Item = Expr>) -> Self {
        let mut out = Vec::new();
        let kind = if all { local::AND } else { local::OR };
        let truth = local::fold(kind, of.into_iter(), &mut out, |e, out| match e {
            Expr::Known(true) => Truth::True,
            Expr::Known(false) => Truth::False,
            Expr::Open(tokens) => {
                out.extend(tokens);
                Truth::Open
            }
        });
        match truth {
            Truth::True => Expr::Known(true),
            Truth::False => Expr::Known(false),
            Truth::Open => Expr::Open(out),
        }
    }

    /// Its value at a point.
    pub fn value(&self, planes: &[(DVec3, f64)], x: DVec3) -> f64 {
        match self {
            Expr::Known(true) => f64::NEG_INFINITY,
            Expr::Known(false) => f64::INFINITY,
            Expr::Open(tokens) => value_of(tokens, &mut |f| {
                let (n, d) = planes[f as usize];
                n.dot(x) - d
            }),
        }
    }

    fn len(&self) -> usize {
        match self {
            Expr::Known(_) => 0,
            Expr::Open(tokens) => tokens.len(),
        }
    }
}

/// The formula would be longer than it may be, or the pieces bound nothing.
#[derive(Debug)]
pub struct Stuck;

/// Makes formulas of pieces.
pub struct Local<'p> {
    /// Planes n·x <= d by their ids.
    pub planes: &'p [(DVec3, f64)],
    /// A point this near a plane is on it, a length.
    pub tolerance: f64,
    /// Tokens that a formula may have.
    pub most: usize,
}

impl Local<'_> {
    /// The formula of some pieces; without any, `rest`.
    pub fn formula(&self, mut pieces: Vec<Piece>, rest: bool) -> Result<Expr, Stuck> {
        if pieces.is_empty() {
            return Ok(Expr::Known(rest));
        }
        let planes = planes_of(&pieces);
        for all in [true, false] {
            let outer: Vec<u32> = planes.iter().copied().filter(|h| self.is_outer(*h, all, &pieces)).collect();
            if outer.is_empty() {
                continue;
            }
            pieces.retain(|p| !outer.iter().any(|h| self.lies_on(p, *h)));
            let rest = self.formula(pieces, all)?;
            let literals = outer.into_iter().map(|h| Expr::literal(h, Sense::Positive));
            return self.affordable(Expr::join(all, literals.chain([rest])));
        }
        match connected(&pieces) {
            Some(parts) => self.nested(parts),
            None => self.cut(&planes, pieces),
        }
    }

    fn affordable(&self, e: Expr) -> Result<Expr, Stuck> {
        if e.len() > self.most { Err(Stuck) } else { Ok(e) }
    }

    /// True where all pieces lie on the inner (`all`) or on the outer side of a plane.
    fn is_outer(&self, h: u32, all: bool, pieces: &[Piece]) -> bool {
        let (n, d) = self.planes[h as usize];
        let sign = if all { 1.0 } else { -1.0 };
        pieces.iter().all(|p| p.corners.iter().all(|c| sign * (n.dot(c.at) - d) <= self.tolerance))
    }

    fn lies_on(&self, piece: &Piece, h: u32) -> bool {
        let (lo, hi) = piece.range(self.planes[h as usize]);
        piece.plane == h || lo.abs().max(hi.abs()) <= self.tolerance
    }

    /// Parts of the surface that no edge connects.
    fn nested(&self, mut parts: Vec<Vec<Piece>>) -> Result<Expr, Stuck> {
        for i in 0..parts.len() {
            let own = self.formula(parts[i].clone(), true)?;
            let others = parts.iter().enumerate().filter(|(j, _)| *j != i);
            let values: Vec<f64> = others.map(|(_, part)| self.farthest(&own, part)).collect();
            if values.iter().any(|v| v.abs() <= 8.0 * self.tolerance) {
                return Err(Stuck);
            }
            let all = values[0] < 0.0;
            if values.iter().all(|v| (*v < 0.0) == all) {
                parts.remove(i);
                let rest = if parts.len() == 1 { self.formula(parts.remove(0), all)? } else { self.nested(parts)? };
                return self.affordable(Expr::join(all, [own, rest]));
            }
        }
        Err(Stuck)
    }

    /// The value of largest magnitude over the middles of some pieces.
    fn farthest(&self, e: &Expr, pieces: &[Piece]) -> f64 {
        let each = pieces.iter().map(|p| e.value(self.planes, p.middle()));
        each.fold(0.0, |most: f64, v| if v.abs() > most.abs() { v } else { most })
    }

    /// Cut in two by the plane that cuts few pieces and leaves as many on either side.
    fn cut(&self, planes: &[u32], pieces: Vec<Piece>) -> Result<Expr, Stuck> {
        let cost = |h: u32| {
            let (mut below, mut above, mut near) = (0usize, 0usize, 0usize);
            for p in &pieces {
                let (lo, hi) = p.range(self.planes[h as usize]);
                below += usize::from(lo < -self.tolerance);
                above += usize::from(hi > self.tolerance);
                near += usize::from(p.corners.iter().any(|c| {
                    let (n, d) = self.planes[h as usize];
                    let v = (n.dot(c.at) - d).abs();
                    v > self.tolerance && v < 1e3 * self.tolerance
                }));
            }
            (near, below.max(above), below + above)
        };
        let h = planes.iter().copied().min_by_key(|h| (cost(*h), *h)).ok_or(Stuck)?;
        let (n, d) = self.planes[h as usize];
        let under: Vec<Piece> = pieces.iter().filter_map(|p| p.below((n, d), self.tolerance)).collect();
        let over: Vec<Piece> = pieces.iter().filter_map(|p| p.below((-n, -d), self.tolerance)).collect();
        if under.is_empty() || over.is_empty() {
            return Err(Stuck);
        }
        drop(pieces);
        let low = self.formula(under, true)?;
        let high = self.formula(over, true)?;
        if low == high {
            return Ok(low);
        }
        let [side, other] = [Sense::Positive, Sense::Negative].map(|s| Expr::literal(h, s));
        let both = Expr::join(true, [low.clone(), high.clone()]);
        self.affordable(Expr::join(false, [Expr::join(true, [side, low]), Expr::join(true, [other, high]), both]))
    }
}

/// The planes of some pieces, in order.
pub fn planes_of(pieces: &[Piece]) -> Vec<u32> {
    let mut planes: Vec<u32> = pieces.iter().map(|p| p.plane).collect();
    planes.sort_unstable();
    planes.dedup();
    planes
}

/// The parts that common edges connect, in order of their first piece; `None` where there is one alone.
fn connected(pieces: &[Piece]) -> Option<Vec<Vec<Piece>>> {
    let mut leader: Vec<usize> = (0..pieces.len()).collect();
    fn find(leader: &mut [usize], mut i: usize) -> usize {
        while leader[i] != i {
            leader[i] = leader[leader[i]];
            i = leader[i];
        }
        i
    }
    let mut at: HashMap<u32, usize> = HashMap::new();
    for (i, piece) in pieces.iter().enumerate() {
        for corner in piece.corners.iter().filter(|c| c.edge != CUT) {
            let other = *at.entry(corner.edge).or_insert(i);
            let (p, q) = (find(&mut leader, i), find(&mut leader, other));
            leader[p.max(q)] = p.min(q);
        }
    }
    let leaders: Vec<usize> = (0..pieces.len()).map(|i| find(&mut leader, i)).collect();
    let mut firsts: Vec<usize> = leaders.clone();
    firsts.sort_unstable();
    firsts.dedup();
    (firsts.len() > 1).then(|| {
        let of = |f: &usize| pieces.iter().zip(&leaders).filter(|(_, l)| *l == f).map(|(p, _)| p.clone()).collect();
        firsts.iter().map(of).collect()
    })
}
