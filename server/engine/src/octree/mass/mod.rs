//! Mass properties: volume, centre of mass and inertia of a solid, with proven bounds of their errors.
//!
//! Primitives, and trees of such that keep clear of each other, have closed forms (`closed`). Anything else is halved
//! into boxes, the one with the largest error first. A box that the solid fills or avoids is exact; so is one in which
//! nothing but planes is left, corners and edges included; in the others every curved face lies between two parallel planes
//! (`slab`), and the solid is told by them (`voxel`) from polyhedral cells, which are integrated exactly (`cell`). A box is
//! halved across the direction along which its faces curve most: along a drill's axis nothing has to be halved at all.
//!
//! The distance of the planes is of the second order in the size of a box. Where a single curved face passes, its curvature
//! tells what of the gap between them is inside, and the error is of the third order, with N boxes N^−3/2; N⁻³ where the face
//! is developable. Edges between curved faces are of the second, but they are few.
//!
//! *The bounds.* Let c be the centre of mass that is answered, x_b the centre of box b, h_b its half extents, d_b = |x_b − c|, and
//! e_b <= s_b the bounds of its volume and of what is misplaced in it (`voxel`). Then
//! - volume: δV = Σ e_b;
//! - ∫ (x − c)ᵢ: Σ e_b d_bᵢ + s_b h_bᵢ, hence the centre by that over V − δV, and never off by more than the solid's box;
//! - ∫ (x − c)ᵢ(x − c)ⱼ: Σ e_b d_bᵢ d_bⱼ + s_b (d_bᵢ h_bⱼ + h_bᵢ d_bⱼ + h_bᵢ h_bⱼ), and for the true centre, δ away from c, another
//!   (V + δV) δᵢ δⱼ.
//!
//! Rounding is part of e_b (`voxel`, `closed`); sums are compensated, what they lose is below the last digit of the bounds,
//! which are rounded up. Places of boxes are right to a few ε of the largest coordinate.
//!
//! The order of the boxes, hence every bit of the answer, depends on nothing but solid and options: boxes are halved in
//! batches, a batch shared between threads.

mod cell;
mod closed;
mod slab;
#[cfg(test)]
mod tests;
mod voxel;

use super::Model;
use crate::math::Aabb;
use crate::math::moments::{MomentSums, Moments, PAIRS, Sum};
use contactd_proto::{ErrorCode, MassOptions, MassProperties};
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use voxel::{Evaluator, Voxel};

/// Work (`Voxel::work`) that a box may take; a limit of boxes is one of so much work for each of them, too. Most take less.
const WORK_PER_BOX: u64 = 1024;

/// Boxes of a batch at most …
const BATCH: usize = 256;
/// … and their errors, as a fraction of the largest: a batch stays close to the order by error.
const ALIKE: f64 = 0.5;

/// Relative rounding of a box' place and of what is integrated about it, against the largest coordinate.
const PLACE_ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Bounds are sums of products of positive numbers; rounded up by this they are bounds still.
const UPWARD: f64 = 1.0 + 1e-12;

/// Why there are no mass properties.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MassError {
    /// The solid has no end.
    #[error("expected a solid of finite size, found one that reaches to infinity")]
    Unbounded,
    /// An option out of its range.
    #[error("{0}")]
    Options(String),
}

impl MassError {
    /// Its code on the wire.
    pub fn code(&self) -> ErrorCode {
        match self {
            MassError::Unbounded => ErrorCode::Unbounded,
            MassError::Options(_) => ErrorCode::BadNumber,
        }
    }
}

/// Mass properties of a model in its own frame, density 1.
///
/// # Errors
/// An unbounded solid; options out of their range.
pub fn mass_properties(model: &Model, options: &MassOptions) -> Result<MassProperties, MassError> {
    let options = options.checked().map_err(MassError::Options)?;
    let solid = &model.solid;
    let around = model.bounds.root().aabb;
    if around.is_empty() || solid.is_empty() {
        return Ok(MassProperties::NOTHING);
    }
    if !around.is_finite() {
        return Err(MassError::Unbounded);
    }
    let mut found = Found::new(around);
    match closed::moments(solid, solid.root, around.center()) {
        Some((moments, error)) => found.settle(&moments, error, 0.0),
        None => found.subdivide(model, &options),
    }
    Ok(found.answer())
}

/// A box by its error; equal ones by age.
#[derive(PartialEq)]
struct Rank {
    error: f64,
    at: usize,
}

impl Eq for Rank {}

impl Ord for Rank {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error).then(other.at.cmp(&self.at))
    }
}

impl PartialOrd for Rank {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// What has been integrated so far, about the centre of the solid's box.
struct Found {
    around: Aabb,
    origin: DVec3,
    settled: MomentSums,
    settled_error: Sum,
    settled_spread: Sum,
    /// Boxes that could be halved further; nothing in the places of those that were.
    open: Vec<Option<Voxel>>,
    boxes: u64,
    /// What they took (`Voxel::work`).
    work: u64,
}

impl Found {
    fn new(around: Aabb) -> Self {
        let (settled, settled_error, settled_spread) = Default::default();
        Self {
            around,
            origin: around.center(),
            settled,
            settled_error,
            settled_spread,
            open: vec![],
            boxes: 0,
            work: 0,
        }
    }

    fn settle(&mut self, moments: &Moments, error: f64, spread: f64) {
        self.settled.add(moments);
        self.settled_error.add(error);
        self.settled_spread.add(spread);
    }

    /// Moments of a box about the origin.
    fn moved(&self, voxel: &Voxel) -> Moments {
        voxel.moments.moved(voxel.region.center() - self.origin)
    }

    fn subdivide(&mut self, model: &Model, options: &MassOptions) {
        let solid = &model.solid;
        let mut queue = BinaryHeap::new();
        let (mut volume, mut error) = (Sum::default(), Sum::default());
        let mut fresh = vec![Evaluator::new(solid).voxel(self.around, &solid.normal_form)];
        let mut batch: Vec<Voxel> = vec![];
        // Places in `open` of boxes that were halved, to be used again.
        let mut free: Vec<usize> = vec![];
        loop {
            self.boxes += fresh.len() as u64;
            self.work += fresh.iter().map(|voxel| voxel.work).sum::<u64>();
            for voxel in fresh {
                volume.add(voxel.moments.volume());
                error.add(voxel.error);
                if voxel.axis.is_none() {
                    self.settle(&self.moved(&voxel), voxel.error, voxel.spread);
                    continue;
                }
                let at = free.pop().unwrap_or(self.open.len());
                queue.push(Rank { error: voxel.error, at });
                if at == self.open.len() {
                    self.open.push(None);
                }
                self.open[at] = Some(voxel);
            }
            if error.value() <= options.tolerance * (volume.value() - error.value()) {
                break;
            }
            let left = (options.boxes.saturating_sub(self.boxes) / 2) as usize;
            // A half takes about what the whole box did.
            let mut left_work = options.boxes.saturating_mul(WORK_PER_BOX).saturating_sub(self.work);
            let least = queue.peek().map_or(0.0, |rank: &Rank| ALIKE * rank.error);
            batch.clear();
            while batch.len() < left.min(BATCH) && queue.peek().is_some_and(|rank: &Rank| rank.error >= least) {
                let cost = queue.peek().and_then(|rank| self.open[rank.at].as_ref()).map_or(0, |voxel| 2 * voxel.work);
                if cost > left_work {
                    break;
                }
                left_work -= cost;
                let at = queue.pop().map_or(0, |rank| rank.at);
                let Some(voxel) = self.open[at].take() else { continue };
                volume.add(-voxel.moments.volume());
                error.add(-voxel.error);
                free.push(at);
                batch.push(voxel);
            }
            if batch.is_empty() {
                break;
            }
            fresh = batch.par_iter().map_init(|| Evaluator::new(solid), halves).flatten_iter().collect();
        }
    }

    /// The answer of all that was integrated.
    fn answer(self) -> MassProperties {
        let mut sums = self.settled;
        let mut error = self.settled_error;
        for voxel in self.open.iter().flatten() {
            sums.add(&self.moved(voxel));
            error.add(voxel.error);
        }
        let total = sums.value();
        let (volume, volume_error) = (total.volume().max(0.0), error.value() * UPWARD);
        let half = self.around.half();
        // Out of reach of all points, and coarser than their rounding.
        let farthest = (self.around.min.abs().max(self.around.max.abs())) * PLACE_ROUNDING;
        let least = volume - volume_error;
        let offset = if volume > 0.0 { (total.first() / volume).clamp(-half, half) } else { DVec3::ZERO };
        let center = self.origin + offset;

        // Bounds about the centre: far from it what is uncertain counts more.
        let (mut first, mut second) = ([Sum::default(); 3], [Sum::default(); 6]);
        let mut count = |error: f64, spread: f64, d: DVec3, h: DVec3| {
            (0..3).for_each(|i| first[i].add(error * d[i] + spread * h[i]));
            for (sum, (i, j)) in second.iter_mut().zip(PAIRS) {
                sum.add(error * d[i] * d[j] + spread * (d[i] * h[j] + h[i] * d[j] + h[i] * h[j]));
            }
        };
        for voxel in self.open.iter().flatten() {
            count(voxel.error, voxel.spread, (voxel.region.center() - center).abs(), voxel.region.half());
        }
        let reach = half + offset.abs() + farthest;
        count(self.settled_error.value(), self.settled_spread.value(), reach, half);
        let first = DVec3::from_array(first.map(|sum| sum.value())) + farthest * volume;
        let center_error = if least > 0.0 { first / least * UPWARD } else { DVec3::INFINITY };
        // Both centres lie in the solid's box.
        let center_error = center_error.min(half + offset.abs()) + farthest;

        let about = total.moved(-offset);
        let most = volume + volume_error;
        let spread: [f64; 6] = std::array::from_fn(|k| {
            let (i, j) = PAIRS[k];
            let shifted = most * center_error[i] * center_error[j];
            // Rounding of places, and of the shift to the centre.
            let places =
                most * (reach[i] * farthest[j] + reach[j] * farthest[i]) + shift_rounding(&total, offset, i, j);
            (second[k].value() + shifted + places) * UPWARD
        });
        let s = &about.0[4..];
        MassProperties {
            volume,
            volume_error,
            center,
            center_error,
            density: 1.0,
            inertia: [s[1] + s[2], s[0] + s[2], s[0] + s[1], -s[3], -s[4], -s[5]],
            inertia_error: [
                spread[1] + spread[2],
                spread[0] + spread[2],
                spread[0] + spread[1],
                spread[3],
                spread[4],
                spread[5],
            ],
            boxes: self.boxes,
        }
    }
}

/// Rounding of ∫ xᵢxⱼ when it is moved by −`offset`.
fn shift_rounding(total: &Moments, offset: DVec3, i: usize, j: usize) -> f64 {
    let k = PAIRS.iter().position(|pair| *pair == (i, j)).unwrap_or(0);
    PLACE_ROUNDING * (total.0[4 + k].abs() + 3.0 * total.volume().abs() * (offset[i] * offset[j]).abs())
}

/// The two halves of a box.
fn halves(evaluator: &mut Evaluator<'_>, voxel: &Voxel) -> [Voxel; 2] {
    let axis = voxel.axis.unwrap_or(0);
    let (mut low, mut high) = (voxel.region, voxel.region);
    let middle = voxel.region.center()[axis];
    (low.max[axis], high.min[axis]) = (middle, middle);
    [low, high].map(|region| evaluator.voxel(region, &voxel.tokens))
}
