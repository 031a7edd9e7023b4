//! The answer of a step.

use super::plan::PairPlan;
use crate::contact::distance::Distance;
use crate::contact::{Counters, Outcome, Region};
use contactd_proto::EffectCounters;

/// The answer for one pair of a step, a < b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairOutcome {
    /// Smaller object id.
    pub a: u32,
    /// Larger object id.
    pub b: u32,
    /// How it was searched.
    pub plan: PairPlan,
    /// What was found.
    pub outcome: Outcome,
    /// It speaks of a resolution coarser than the pair's own.
    pub coarser: bool,
    /// Index of its job.
    pub(super) job: u32,
    /// False when the work limit cut the search for its regions: there may be more, and whether it touches may be open.
    pub regions_complete: bool,
    /// Where its regions stand in `StepOutcome::regions`: the first one, and how many; none unless asked for.
    pub regions: (u32, u32),
    /// Further slots that regions and clearances of the pairs before it take, and its own.
    pub patch_slots: (u32, u32),
    /// Where its least distance over the step stands in `StepOutcome::clearances`; `None` unless asked for.
    pub clearance: Option<u32>,
}

/// The answer of a step. Valid until the next one.
#[derive(Clone, Debug, Default)]
pub struct StepOutcome {
    /// Told pairs in the order (time, a, b).
    pub pairs: Vec<PairOutcome>,
    /// The contact regions of told pairs, pair by pair.
    pub regions: Vec<Region>,
    /// The least distances over the step of told pairs, in their order.
    pub clearances: Vec<Distance>,
    /// More pairs would have been told without `max_records`.
    pub truncated: bool,
    /// Smallest time_lower over all pairs, told or not.
    pub safe_time: f64,
    /// Some pair was left undecided before the earliest contact.
    pub undecided: bool,
    /// Some pair meets or overlaps.
    pub contact: bool,
    /// Pairs that were searched, or answered by what was known of them.
    pub searched: u32,
    /// Those of them that what was known has answered. Pairs that their path lengths prove apart are not even counted.
    pub known: u32,
    /// How often each effect was worked out.
    pub effect_counters: EffectCounters,
    /// Work of all searches.
    pub counters: Counters,
    /// Cells that one thread refined at most, of those that were shared out: how even the work was.
    pub busiest_cells: u64,
    /// Pairs of boxes compared.
    pub box_tests: u64,
    /// Discrete pairs that moved far enough to have passed through each other.
    pub may_have_passed: u64,
}

impl StepOutcome {
    /// Makes room for another step's answer: nothing is told, and nothing stands in the way of the whole step. Lists keep their
    /// memory.
    pub(super) fn clear(&mut self) {
        let Self { pairs, regions, clearances, .. } = self;
        pairs.clear();
        regions.clear();
        clearances.clear();
        let (pairs, regions, clearances) = (std::mem::take(pairs), std::mem::take(regions), std::mem::take(clearances));
        *self = Self { pairs, regions, clearances, safe_time: 1.0, ..Self::default() };
    }

    /// The least distance of a told pair over the step, where its rule asks for it.
    pub fn clearance_of(&self, pair: &PairOutcome) -> Option<&Distance> {
        self.clearances.get(pair.clearance? as usize)
    }

    /// The contact regions of a told pair.
    pub fn regions_of(&self, pair: &PairOutcome) -> &[Region] {
        &self.regions[pair.regions.0 as usize..][..pair.regions.1 as usize]
    }
}
