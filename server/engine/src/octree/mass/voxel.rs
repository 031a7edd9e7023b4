//! Moments of what of a solid lies in one box, and how far they may be off.
//!
//! Literals that the box settles fold away. What is left is an and/or of faces, monotone in each of them. The box is cut
//! along its planes, one after the other, into convex cells in which curved faces alone are left, or none: corners and
//! edges of planar faces cost nothing but rounding. In such a cell:
//!
//! *One curved face.* It lies between two planes (`slab`); what is before both counts, and of the cell U between them the share
//! w. On a line along the face's normal that crosses all of U, a length H, the face cuts off σ = ½ κ τ², so w = 1 − ½ κ m/H, m
//! the mean of τ² over U, an integral of the second order that is known. Off are the lines that end in a wall of the cell,
//! over a shadow of area A: those by H/4 at most each (s(1 − s) H with s = σ/H), and κ, known to ½ (κ⁺ − κ⁻):
//!
//! e = ¼ H A + ¼ (κ⁺ − κ⁻)(m |U|/H + A T²)
//!
//! A is the projection of the walls' parts between the planes, of first order in H; a wall along the normal casts none. So e is
//! of one order more than that of half of U, |U|/2; the smaller of both counts.
//!
//! *Several.* Every face replaced by the half-space that holds all of it, or by one that it holds, gives an outer and an inner
//! polyhedral body, S⁻ ⊂ S ⊂ S⁺. The mean of both is off by e = g/2 at most, g = V⁺ − V⁻.
//!
//! *Moments.* ∫ φ is off by |φ(c)| e + osc φ · s, where s bounds ∫ |1_S − w| over U: 2 w (1 − w) |U| + e, for the mean g/2.

use super::cell::Cell;
use super::slab::{Curve, Slab};
use crate::math::moments::Moments;
use crate::math::{Aabb, halt};
use crate::octree::span::face_span;
use crate::solid::local::{LiteralId, Token, Truth, is_part, literals, prune, truth_of};
use crate::solid::{Faces, Sense, Solid};
use glam::DVec3;
use smallvec::SmallVec;

/// Cuts of one box at most. Beyond, halving the box is cheaper.
const MOST_CUTS: usize = 32;
/// What a cut of a cell and the moments of its pieces cost, in literals compared with a cell; and how many spans of a face
/// over the box cost as much as one.
const CUT: u64 = 16;
const SPANS: u64 = 2;
/// Slabs among which one is looked up that cost as much.
const LOOKUPS: u64 = 16;

/// Literals of a box beyond which it is halved without a look at their slabs: far more than it may have cuts.
const MOST_LITERALS: usize = 4096;

/// A face without a slab in the box at hand.
const NO_SLAB: u32 = u32::MAX;

/// Rounding of the moments of a cell, as a fraction of its box' volume (times the extents, for the others): the signed
/// tetrahedra of a few dozen triangles, each of a volume below that of the box and right to 8 ε.
const CELL_ROUNDING: f64 = 512.0 * f64::EPSILON;

/// Volume of the cube [−1, 1]³.
const CUBE: f64 = 8.0;

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
    /// Bound of the volume that is misplaced: times the oscillation of what is integrated.
    pub spread: f64,
    /// Axis across which to halve it; `None` when that brings nothing.
    pub axis: Option<usize>,
    /// What it took, in literals compared with a cell.
    pub work: u64,
}

/// What is known of a box in the coordinates of the cube.
#[derive(Default)]
struct VoxelPart {
    moments: Moments,
    error: f64,
    spread: f64,
    /// The largest error of a cell, and the axis that would make it smaller.
    worst: Option<(f64, usize)>,
}

impl VoxelPart {
    fn add(&mut self, moments: &Moments, error: f64, spread: f64, axis: usize) {
        self.moments.add(moments);
        self.error += error;
        self.spread += spread;
        if self.worst.is_none_or(|(largest, _)| error > largest) {
            self.worst = Some((error, axis));
        }
    }
}

/// What is measured of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum VoxelBody {
    /// The solid, as well as may be.
    Solid,
    /// A polyhedral body that holds it, or one that it holds; no planes are left.
    Outer,
    Inner,
}

/// Evaluates boxes of one solid; keeps its memory.
pub struct Evaluator<'a> {
    solid: &'a Solid,
    faces: &'a Faces,
    /// The slabs of the box at hand with their faces, and those of the cell at hand.
    slabs: Vec<(u32, Slab)>,
    /// Where the slab of a face is in `slabs`, for each face of the solid.
    places: Vec<u32>,
    closer: Vec<(u32, Slab)>,
    half: DVec3,
    cube: Cell,
    cells: Vec<Cell>,
    expressions: Vec<Vec<Token>>,
    cuts: usize,
    most_cuts: usize,
    /// Work of the box at hand.
    work: u64,
}

impl<'a> Evaluator<'a> {
    /// For a solid.
    pub fn new(solid: &'a Solid) -> Self {
        let faces = &solid.faces;
        let (slabs, closer, cells, expressions) = Default::default();
        let (half, cube) = (DVec3::ZERO, Cell::cube());
        let places = vec![NO_SLAB; faces.len()];
        Self {
            solid,
            faces,
            slabs,
            places,
            closer,
            half,
            cube,
            cells,
            expressions,
            cuts: 0,
            most_cuts: MOST_CUTS,
            work: 0,
        }
    }

    /// The same without a limit of cuts: for a solid that shall be one box.
    pub fn unlimited(solid: &'a Solid) -> Self {
        Self { most_cuts: usize::MAX, ..Self::new(solid) }
    }

    /// A box where `tokens` are left of the solid, or of a box around it.
    pub fn voxel(&mut self, region: Aabb, tokens: &[Token]) -> Voxel {
        halt::point();
        let (center, half) = (region.center(), region.half());
        let faces = self.faces;
        self.work = tokens.len() as u64 / SPANS;
        let mut kept = self.expressions.pop().unwrap_or_default();
        kept.clear();
        let truth = self.solid.prune(tokens, &mut kept, &mut |id| {
            truth_of(id.sense(), face_span(&faces[id.face() as usize], center, half), 0.0, 0.0)
        });
        let (tokens, moments) = Default::default();
        let mut voxel = Voxel { region, tokens, moments, error: 0.0, spread: 0.0, axis: None, work: 0 };
        if truth != Truth::False {
            let whole = Moments::of_box(half);
            (voxel.error, voxel.spread) = (CELL_ROUNDING * whole.volume(), CELL_ROUNDING * whole.volume());
            if truth == Truth::True {
                voxel.moments = whole;
            } else {
                self.cut_up(&mut voxel, &kept, center, half);
            }
        }
        self.expressions.push(kept);
        voxel.work = self.work;
        voxel
    }

    fn cut_up(&mut self, voxel: &mut Voxel, kept: &[Token], center: DVec3, half: DVec3) {
        let cube = std::mem::take(&mut self.cube);
        (self.cuts, self.half) = (0, half);
        for (face, _) in self.slabs.drain(..) {
            self.places[face as usize] = NO_SLAB;
        }
        let few = literals(kept).nth(MOST_LITERALS).is_none() || self.most_cuts > MOST_LITERALS;
        for id in literals(kept).take_while(|_| few) {
            let place = &mut self.places[id.face() as usize];
            if *place == NO_SLAB {
                *place = self.slabs.len() as u32;
                self.slabs.push((id.face(), Slab::new(&self.faces[id.face() as usize], center, half)));
            }
        }
        let count = self.slabs.len() as u64;
        self.work += count * (1 + count / LOOKUPS);
        let mut part = VoxelPart::default();
        let unit = half.x * half.y * half.z;
        // Parts that are not written out are too many faces, too.
        let whole = few && kept.iter().all(|t| !is_part(*t));
        if whole && self.measure(kept, &cube, VoxelBody::Solid, &mut part) {
            // Planes are known to their rounding, a sheet of the box; and so is each of the cells.
            let sheets: f64 = self.slabs.iter().map(|(_, slab)| slab.sheet(CUBE)).sum();
            let rounding = sheets + CUBE * CELL_ROUNDING * self.cuts as f64;
            voxel.moments = part.moments.stretched(half);
            voxel.error += (part.error + rounding) * unit;
            voxel.spread += (part.spread + rounding) * unit;
            voxel.axis = part.worst.map(|(_, axis)| axis);
        } else {
            // Too many faces for this box: half of it, give or take a half.
            let all = Moments::of_box(half);
            voxel.moments = all.mean(&Moments::default(), 0.5);
            voxel.error += 0.5 * all.volume();
            voxel.spread += 0.5 * all.volume();
            voxel.axis = Some(half.max_position());
        }
        // Below this the corners of its halves are rounding.
        let finest = 64.0 * f64::EPSILON * (center.abs() + half);
        voxel.axis = voxel.axis.filter(|k| half[*k] > finest[*k]);
        voxel.tokens = kept.into();
        self.cube = cube;
    }

    fn slab(&self, id: LiteralId, body: VoxelBody) -> &Slab {
        if body == VoxelBody::Solid {
            return &self.slabs[self.places[id.face() as usize] as usize].1;
        }
        let found = self.closer.iter().find(|(face, _)| *face == id.face());
        &found.expect("every curved literal of the cell has its slab").1
    }

    /// What a literal is over a cell of the body.
    fn truth(&self, id: LiteralId, cell: &Cell, body: VoxelBody) -> Truth {
        let slab = self.slab(id, body);
        let holds = |all: bool| slab.plane(id.sense(), all).map(|plane| cell.range(&plane));
        let (most, least) = match body {
            VoxelBody::Solid if slab.is_flat() => {
                let range = cell.range(&slab.middle(id.sense()));
                (Some(range), Some(range))
            }
            VoxelBody::Solid => (holds(true), holds(false)),
            VoxelBody::Outer | VoxelBody::Inner => {
                let all = body == VoxelBody::Outer;
                match holds(all) {
                    None if all => return Truth::True,
                    None => return Truth::False,
                    both => (both, both),
                }
            }
        };
        match (most, least) {
            (_, Some((_, hi))) if hi <= 0.0 => Truth::True,
            (Some((lo, _)), _) if lo >= 0.0 => Truth::False,
            _ => Truth::Open,
        }
    }

    /// Adds what the expression holds of a cell. False when that takes too many cuts.
    fn measure(&mut self, tokens: &[Token], cell: &Cell, body: VoxelBody, part: &mut VoxelPart) -> bool {
        let mut kept = self.expressions.pop().unwrap_or_default();
        kept.clear();
        // Each literal's slab is looked up among all.
        self.work += tokens.len() as u64 * (1 + self.slabs.len() as u64 / LOOKUPS);
        let truth = prune(tokens, &mut kept, &mut |id| self.truth(id, cell, body));
        let done = match truth {
            Truth::False => true,
            Truth::True => {
                part.moments.add(&cell.moments());
                true
            }
            Truth::Open => {
                let along = literals(&kept).find(|id| body != VoxelBody::Solid || self.slab(*id, body).is_flat());
                match along {
                    Some(id) => self.split(&kept, id, cell, body, part),
                    None => self.curved(&kept, cell, part),
                }
            }
        };
        self.expressions.push(kept);
        done
    }

    /// The same for an expression whose literals all pass through the cell: cut by one of them, each side by itself.
    fn split(
        &mut self,
        tokens: &[Token],
        along: LiteralId,
        cell: &Cell,
        body: VoxelBody,
        part: &mut VoxelPart,
    ) -> bool {
        let slab = self.slab(along, body);
        let plane = match body {
            VoxelBody::Solid => slab.middle(along.sense()),
            _ => match slab.plane(along.sense(), body == VoxelBody::Outer) {
                Some(plane) => plane,
                // Settled before.
                None => return true,
            },
        };
        let (mut rest, mut piece) = (self.expressions.pop().unwrap_or_default(), self.cells.pop().unwrap_or_default());
        let mut done = true;
        for (side, plane) in [(Truth::True, plane), (Truth::False, plane.flipped())] {
            rest.clear();
            let truth = prune(tokens, &mut rest, &mut |id| if id == along { side } else { Truth::Open });
            if truth == Truth::False {
                continue;
            }
            self.cuts += 1;
            self.work += CUT;
            done &= self.cuts <= self.most_cuts;
            if !done {
                break;
            }
            cell.cut(&plane, true, &mut piece);
            if piece.is_empty() {
                continue;
            }
            if truth == Truth::True {
                part.moments.add(&piece.moments());
            } else {
                done = self.measure(&rest, &piece, body, part);
            }
        }
        self.expressions.push(rest);
        self.cells.push(piece);
        done
    }

    /// The same for an expression of curved faces alone.
    fn curved(&mut self, tokens: &[Token], cell: &Cell, part: &mut VoxelPart) -> bool {
        self.closer.clear();
        for id in literals(tokens) {
            if self.closer.iter().all(|(face, _)| *face != id.face()) {
                let slab = *self.slab(id, VoxelBody::Solid);
                let slab = self.tightened(slab, cell);
                self.closer.push((id.face(), slab));
            }
        }
        if let [_] = tokens
            && let Some(id) = literals(tokens).next()
            && let slab = *self.slab(id, VoxelBody::Inner)
            && let Some(curve) = slab.curve
        {
            self.single(id, &slab, curve, cell, part);
            return true;
        }
        let (mut outer, mut inner) = (VoxelPart::default(), VoxelPart::default());
        if !self.measure(tokens, cell, VoxelBody::Outer, &mut outer)
            || !self.measure(tokens, cell, VoxelBody::Inner, &mut inner)
        {
            return false;
        }
        let error = 0.5 * (outer.moments.volume() - inner.moments.volume()).max(0.0);
        let rough = self.closer.iter().any(|(_, slab)| slab.curve.is_none());
        let bend = self.closer.iter().map(|(_, slab)| slab.bend()).fold(DVec3::ZERO, DVec3::max);
        let axis = if rough { self.half.max_position() } else { bend.max_position() };
        part.add(&outer.moments.mean(&inner.moments, 0.5), error, error, axis);
        true
    }

    /// The slab with its planes moved closer, by what of the cell lies between them.
    fn tightened(&mut self, slab: Slab, cell: &Cell) -> Slab {
        if slab.curve.is_none() {
            return slab;
        }
        self.work += 2 * CUT;
        let [mut outer, mut between] = [(); 2].map(|()| self.cells.pop().unwrap_or_default());
        slab.between(cell, &mut outer, &mut between);
        let closer = if between.is_empty() { slab } else { slab.tightened(&between) };
        self.cells.extend([outer, between]);
        closer
    }

    /// The same for one face of known curvature.
    fn single(&mut self, id: LiteralId, slab: &Slab, curve: Curve, cell: &Cell, part: &mut VoxelPart) {
        self.work += 3 * CUT;
        let [mut outer, mut between, mut inner] = [(); 3].map(|()| self.cells.pop().unwrap_or_default());
        slab.between(cell, &mut outer, &mut between);
        slab.inside(&outer, &mut inner);
        let (core, gap, shadow) = (inner.moments(), between.moments(), between.shadow(slab.toward(self.half)));
        self.cells.extend([outer, between, inner]);

        let ([low, high], t) = (curve.range, curve.reach);
        let dent = slab.dent().unwrap_or(0.0);
        let thick = slab.bulge().unwrap_or(0.0) + dent + 2.0 * slab.pad;
        let volume = gap.volume().max(0.0);
        let mean = if volume > 0.0 { (gap.square_along(&slab.tangents) / volume).clamp(0.0, t * t) } else { 0.0 };
        let ends = 0.25 * thick * shadow;
        let bending = 0.25 * (high - low) * (mean * volume / thick + shadow * t * t);
        // The face itself is known to a pad, the mean to the rounding of a cell.
        let rounding = 2.0 * slab.pad * (volume / thick + shadow) + CUBE * CELL_ROUNDING;
        let (mut share, mut error) =
            ((1.0 - (0.25 * (low + high) * mean + dent + slab.pad) / thick).clamp(0.0, 1.0), ends + bending + rounding);
        let mut spread = 2.0 * share * (1.0 - share) * volume + error;
        if error >= 0.5 * volume {
            (share, error, spread) = (0.5, 0.5 * volume, 0.5 * volume);
        }
        let mut moments = core;
        moments.add(&gap.mean(&Moments::default(), share));
        if id.sense() == Sense::Negative {
            // What the face leaves of the cell.
            moments = cell.moments().less(&moments);
        }
        let axis = if bending > ends && slab.along != DVec3::ZERO { slab.along.abs() } else { slab.bend() };
        part.add(&moments, error, spread, axis.max_position());
    }
}
