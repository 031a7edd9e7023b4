//! The formula of a whole mesh: cells that overlap, each with the formula of the few facets that reach it (`local`).
//!
//! A cell with too many facets is divided across its longest side, the plane's two sides overlapping by a slab:
//! (x <= s + w and L) or (x >= s − w and R). L is right where x <= s + w, R where x >= s − w; each holds at w from its own plane what
//! the other one ends with, so f is negative inside throughout. The planes x = s ± w are faces of the primitive that bound
//! nothing, its cuts. They keep clear of all corners, so no rounding decides what reaches a cell.
//!
//! A cell that no facet reaches is inside or outside as a whole: what the other half says of the slab between them.
//!
//! Checked, not assumed: over each piece of a facet f is 0 and rises outwards. A mesh that crosses itself or lies on itself fails
//! that.

use super::MeshFault;
use super::local::{Expr, Local, planes_of};
use super::piece::Piece;
use crate::math::Aabb;
use crate::solid::Sense;
use glam::DVec3;

/// Planes from which on a cell is divided.
const FEW_PLANES: usize = 12;
/// Tokens of a cell's formula for each of its planes, beyond which it is rather divided.
const TOKENS: usize = 6;
/// Divisions in a row that leave as many planes in a cell: they all meet in one corner then.
const STALLED: u32 = 9;
/// Tokens of the formula of such a corner.
const MOST_TOKENS: usize = 20_000;
/// Tokens of the whole for each facet.
const TOKENS_PER_FACET: usize = 400;
/// Half the overlap of two cells, as a fraction of the one that they were.
const OVERLAP: f64 = 1.0 / 32.0;
/// Places that are tried for a division: what keeps clear of the corners best is taken.
const PLACES: usize = 9;
/// How far outside of the mesh's box it is cut off, as a fraction of its size.
const MARGIN: f64 = 1.0 / (1 << 20) as f64;

/// The box that a mesh is cut off at, from its own.
pub fn domain(around: &Aabb) -> Aabb {
    around.grown(MARGIN * around.half().length())
}

/// A formula in the making.
pub struct Cells {
    /// Planes of facets, then cuts.
    planes: Vec<(DVec3, f64)>,
    tolerance: f64,
    tokens: usize,
    most: usize,
}

impl Cells {
    /// The formula of the pieces of a mesh within `around`, and all planes: those of facets, then cuts.
    pub fn formula(
        planes: Vec<(DVec3, f64)>,
        pieces: Vec<Piece>,
        around: Aabb,
        tolerance: f64,
    ) -> Result<(Expr, Vec<(DVec3, f64)>), MeshFault> {
        let most = TOKENS_PER_FACET * pieces.len().max(16);
        let mut cells = Self { planes, tolerance, tokens: 0, most };
        let domain = domain(&around);
        let mut all = Vec::with_capacity(7);
        for k in 0..3 {
            all.push(cells.cut(DVec3::AXES[k], domain.max[k]));
            all.push(cells.cut(-DVec3::AXES[k], -domain.min[k]));
        }
        let count = planes_of(&pieces).len();
        all.push(cells.cell(pieces, domain, (count, 0))?);
        Ok((Expr::join(true, all), cells.planes))
    }

    /// A new plane that bounds nothing.
    fn cut(&mut self, n: DVec3, d: f64) -> Expr {
        self.planes.push((n, d));
        Expr::literal(self.planes.len() as u32 - 1, Sense::Positive)
    }

    /// The formula of a cell that some pieces reach; `last`: the planes of the one before, and for how long it has been so.
    fn cell(&mut self, pieces: Vec<Piece>, domain: Aabb, last: (usize, u32)) -> Result<Expr, MeshFault> {
        let count = planes_of(&pieces).len();
        let stalled = if count < last.0 { 0 } else { last.1 + 1 };
        if count <= FEW_PLANES || stalled > STALLED {
            let most = if stalled > STALLED { MOST_TOKENS } else { TOKENS * count + 8 };
            let local = Local { planes: &self.planes, tolerance: self.tolerance, most };
            match local.formula(pieces.clone(), true) {
                Ok(e) => {
                    if let Expr::Open(tokens) = &e {
                        self.tokens += tokens.len();
                    }
                    if self.tokens > self.most {
                        return Err(MeshFault::Intricate(pieces[0].middle()));
                    }
                    return checked(&self.planes, self.tolerance, &pieces, e, &domain);
                }
                Err(_) if stalled > STALLED => return Err(MeshFault::Intricate(pieces[0].middle())),
                Err(_) => {}
            }
        }
        self.divided(pieces, domain, (count, stalled))
    }

    fn divided(&mut self, pieces: Vec<Piece>, domain: Aabb, last: (usize, u32)) -> Result<Expr, MeshFault> {
        let size = domain.max - domain.min;
        let k = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let (axis, w) = (DVec3::AXES[k], OVERLAP * size[k]);
        if w <= 1e3 * self.tolerance {
            return Err(MeshFault::Intricate(pieces[0].middle()));
        }
        let s = self.place(&pieces, &domain, k, w);
        let [low, high] = [(axis, s + w), (-axis, w - s)];
        let take = |plane| pieces.iter().filter_map(|p| p.below(plane, self.tolerance)).collect::<Vec<Piece>>();
        let (under, over) = (take(low), take(high));
        drop(pieces);
        let (mut below, mut above) = (domain, domain);
        (below.max[k], above.min[k]) = (s + w, s - w);
        let half = |cells: &mut Self, pieces: Vec<Piece>, domain| {
            if pieces.is_empty() { Ok(None) } else { cells.cell(pieces, domain, last).map(Some) }
        };
        let (left, right) = (half(self, under, below)?, half(self, over, above)?);
        let slab = below.intersection(&above);
        let (left, right) = match (left, right) {
            (Some(l), Some(r)) => (l, r),
            (Some(l), None) => {
                let r = self.known(&l, &slab)?;
                (l, r)
            }
            (None, Some(r)) => (self.known(&r, &slab)?, r),
            (None, None) => return Err(MeshFault::Intricate(domain.center())),
        };
        if left == right {
            return Ok(left);
        }
        let (low, high) = (self.cut(low.0, low.1), self.cut(high.0, high.1));
        Ok(Expr::join(false, [Expr::join(true, [low, left]), Expr::join(true, [high, right])]))
    }

    /// What holds in a cell that no facet reaches: what its neighbour says of the slab between them.
    fn known(&self, neighbour: &Expr, slab: &Aabb) -> Result<Expr, MeshFault> {
        let value = neighbour.value(&self.planes, slab.center());
        if value.abs() <= 8.0 * self.tolerance {
            return Err(MeshFault::Crossing(slab.center()));
        }
        Ok(Expr::Known(value < 0.0))
    }

    /// Where a cell is divided: near the middle of its facets, with both planes clear of all corners.
    fn place(&self, pieces: &[Piece], domain: &Aabb, k: usize, w: f64) -> f64 {
        let (from, size) = (domain.min[k], domain.max[k] - domain.min[k]);
        let mut middles: Vec<f64> = pieces.iter().map(|p| p.middle()[k]).collect();
        let half = middles.len() / 2;
        let median = *middles.select_nth_unstable_by(half, f64::total_cmp).1;
        let middle = median.clamp(from + 0.25 * size, from + 0.75 * size);
        let mut best = (f64::NEG_INFINITY, middle);
        for i in 0..PLACES {
            // Odd fractions, so that models on a grid do not have corners there.
            let s = middle + size * (0.0137 + 0.0171 * (i as f64 - 4.0));
            let clear = pieces.iter().flat_map(|p| &p.corners).fold(f64::INFINITY, |least: f64, c| {
                let v = c.at[k] - s;
                least.min((v - w).abs()).min((v + w).abs())
            });
            // Far enough from all is as good as farther.
            let clear = clear.min(1e6 * self.tolerance);
            if clear > best.0 {
                best = (clear, s);
            }
        }
        best.1
    }
}

/// A cell's formula where it is 0 on all pieces and rises outwards through them.
pub fn checked(
    planes: &[(DVec3, f64)],
    tolerance: f64,
    pieces: &[Piece],
    e: Expr,
    domain: &Aabb,
) -> Result<Expr, MeshFault> {
    let step = 1e2 * tolerance;
    let off = |x: DVec3| e.value(planes, x);
    for piece in pieces {
        let middle = piece.middle();
        let (n, _) = planes[piece.plane as usize];
        let each = piece.corners.iter().map(|c| 0.5 * (c.at + middle));
        if each.chain([middle]).any(|x| off(x).abs() > 8.0 * tolerance) {
            return Err(MeshFault::Crossing(middle));
        }
        let inner = (middle - domain.min).min(domain.max - middle).min_element() > 2.0 * step;
        if inner && is_roomy(n, piece, tolerance) && !(off(middle - n * step) < 0.0 && off(middle + n * step) > 0.0) {
            return Err(MeshFault::Crossing(middle));
        }
    }
    Ok(e)
}

/// True where the middle of a piece with the normal n is farther from its sides than other facets can be seen there.
fn is_roomy(n: DVec3, piece: &Piece, tolerance: f64) -> bool {
    let middle = piece.middle();
    let count = piece.corners.len();
    (0..count).all(|i| {
        let (a, b) = (piece.corners[i].at, piece.corners[(i + 1) % count].at);
        let inward = n.cross(b - a).normalize_or_zero();
        inward.dot(middle - a) > 1e5 * tolerance
    })
}
