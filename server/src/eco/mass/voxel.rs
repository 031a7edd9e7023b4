//! Moments of what of a solid lies in one box, and how far they may be off.
//!
//! Literals that the box settles fold away. What is left is an and/or of faces, monotone in each of them: with every face
//! replaced by the half-space that holds all of it, or by one that it holds (`slab`), the box is cut into convex cells over
//! which the expression is constant. That gives an outer and an inner polyhedral body, S⁻ ⊂ S ⊂ S⁺, without an error of
//! their own; the answer is the mean of both. Planar faces have S⁻ = S⁺ up to rounding, edges and corners included.
//!
//! With g = V⁺ − V⁻ the error of the volume is at most g/2, and that of ∫ φ at most |φ(c)| g/2 + osc φ · g/2: over S⁺ − S⁻
//! the mean counts every point half, the truth 0 or 1.

use super::cell::{Cell, Plane};
use super::moments::Moments;
use super::slab::Slab;
use crate::eco::span::face_span;
use crate::math::Aabb;
use crate::solid::Face;
use crate::solid::local::{LiteralId, Token, Truth, literals, prune, truth_of};
use glam::DVec3;
use smallvec::SmallVec;

/// Cuts for one of a box' bodies at most. Beyond, halving the box is cheaper.
const MOST_CUTS: usize = 24;

/// Rounding of the moments of a cell, as a fraction of its box' volume (times the extents, for the others): the signed
/// tetrahedra of a few dozen triangles, each of a volume below that of the box and right to 8 ε.
const CELL_ROUNDING: f64 = 512.0 * f64::EPSILON;

/// A box of the subdivision. Its corners are exact: neighbours share them.
#[derive(Clone, Debug)]
pub struct Voxel {
    /// The box.
    pub region: Aabb,
    /// What is left of the solid there, in prefix order (`solid::local`).
    pub tokens: SmallVec<[Token; 8]>,
    /// Moments of the solid in the box about the box' centre.
    pub moments: Moments,
    /// Bound of the volume's error.
    pub error: f64,
    /// Axis across which to halve it; `None` when that brings nothing.
    pub axis: Option<usize>,
}

/// Evaluates boxes of one solid; keeps its memory.
pub struct Evaluator<'a> {
    faces: &'a [Face],
    slabs: Vec<(u32, Slab)>,
    cells: Vec<Cell>,
    expressions: Vec<Vec<Token>>,
    cuts: usize,
    most_cuts: usize,
}

impl<'a> Evaluator<'a> {
    /// For a solid of these faces.
    pub fn new(faces: &'a [Face]) -> Self {
        Self { faces, slabs: vec![], cells: vec![], expressions: vec![], cuts: 0, most_cuts: MOST_CUTS }
    }

    /// The same without a limit of cuts: for a solid that shall be one box.
    pub fn unlimited(faces: &'a [Face]) -> Self {
        Self { most_cuts: usize::MAX, ..Self::new(faces) }
    }

    /// A box where `tokens` are left of the solid, or of a box around it.
    pub fn voxel(&mut self, region: Aabb, tokens: &[Token]) -> Voxel {
        let (center, half) = (region.center(), region.half());
        let faces = self.faces;
        let mut kept = self.expressions.pop().unwrap_or_default();
        kept.clear();
        let truth = prune(tokens, &mut kept, &mut |id| {
            truth_of(id.sense(), face_span(&faces[id.face() as usize], center, half), 0.0, 0.0)
        });
        let mut voxel = Voxel { region, tokens: SmallVec::new(), moments: Moments::default(), error: 0.0, axis: None };
        if truth != Truth::False {
            let whole = Moments::of_box(half);
            voxel.error = CELL_ROUNDING * whole.volume();
            if truth == Truth::True {
                voxel.moments = whole;
            } else {
                self.cut_up(&mut voxel, &kept, center, half);
            }
        }
        self.expressions.push(kept);
        voxel
    }

    fn cut_up(&mut self, voxel: &mut Voxel, kept: &[Token], center: DVec3, half: DVec3) {
        self.slabs.clear();
        for id in literals(kept) {
            if self.slabs.iter().all(|(face, _)| *face != id.face()) {
                self.slabs.push((id.face(), Slab::new(&self.faces[id.face() as usize], center, half)));
            }
        }
        let bodies = [true, false].map(|all| self.body(kept, all));
        if let [Some(outer), Some(inner)] = bodies {
            voxel.moments = outer.mean(&inner, 0.5).stretched(half);
            let gap = (outer.volume() - inner.volume()).max(0.0);
            voxel.error += 0.5 * gap * half.x * half.y * half.z;
            let curved = self.slabs.iter().map(|(_, slab)| slab.bend).reduce(DVec3::max).unwrap_or(DVec3::ZERO);
            if self.slabs.iter().any(|(_, slab)| slab.is_rough()) {
                voxel.axis = Some(half.max_position());
            } else if self.slabs.iter().any(|(_, slab)| !slab.is_flat()) {
                voxel.axis = Some(curved.max_position());
            }
        } else {
            // Too many faces for this box: half of it, give or take a half.
            let all = Moments::of_box(half);
            voxel.moments = all.mean(&Moments::default(), 0.5);
            voxel.error += 0.5 * all.volume();
            voxel.axis = Some(half.max_position());
        }
        // Below this the corners of its halves are rounding.
        let finest = 64.0 * f64::EPSILON * (center.abs() + half);
        voxel.axis = voxel.axis.filter(|k| half[*k] > finest[*k]);
        voxel.tokens = kept.into();
    }

    /// Moments of the outer (`all`) or the inner body in the coordinates of the cube; `None` when that takes too many cuts.
    fn body(&mut self, tokens: &[Token], all: bool) -> Option<Moments> {
        self.cuts = 0;
        let mut sum = Moments::default();
        self.measure(tokens, &Cell::cube(), all, &mut sum).then_some(sum)
    }

    fn plane(&self, id: LiteralId, all: bool) -> Option<Plane> {
        let (_, slab) = self.slabs.iter().find(|(face, _)| *face == id.face()).expect("every literal has its slab");
        slab.plane(id.sense(), all)
    }

    /// Adds the moments of what of the cell the expression holds. False when that takes too many cuts.
    fn measure(&mut self, tokens: &[Token], cell: &Cell, all: bool, sum: &mut Moments) -> bool {
        let mut kept = self.expressions.pop().unwrap_or_default();
        kept.clear();
        let truth = prune(tokens, &mut kept, &mut |id| match self.plane(id, all) {
            None if all => Truth::True,
            None => Truth::False,
            Some(plane) => match cell.range(&plane) {
                (_, hi) if hi <= 0.0 => Truth::True,
                (lo, _) if lo >= 0.0 => Truth::False,
                _ => Truth::Open,
            },
        });
        let done = match truth {
            Truth::False => true,
            Truth::True => {
                sum.add(&cell.moments());
                true
            }
            Truth::Open => self.split(&kept, cell, all, sum),
        };
        self.expressions.push(kept);
        done
    }

    /// The same for an expression whose literals all pass through the cell: cut by one of them, each side by itself.
    fn split(&mut self, tokens: &[Token], cell: &Cell, all: bool, sum: &mut Moments) -> bool {
        let Some(chosen) = literals(tokens).next() else { return true };
        let Some(plane) = self.plane(chosen, all) else { return true };
        let (mut rest, mut part) = (self.expressions.pop().unwrap_or_default(), self.cells.pop().unwrap_or_default());
        let mut done = true;
        for (side, plane) in [(Truth::True, plane), (Truth::False, plane.flipped())] {
            rest.clear();
            let truth = prune(tokens, &mut rest, &mut |id| if id == chosen { side } else { Truth::Open });
            if truth == Truth::False {
                continue;
            }
            self.cuts += 1;
            done &= self.cuts <= self.most_cuts;
            if !done {
                break;
            }
            cell.cut(&plane, &mut part);
            if part.is_empty() {
                continue;
            }
            if truth == Truth::True {
                sum.add(&part.moments());
            } else {
                done = self.measure(&rest, &part, all, sum);
            }
        }
        self.expressions.push(rest);
        self.cells.push(part);
        done
    }
}
