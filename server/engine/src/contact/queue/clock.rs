//! Where the time of a search goes: by stage, for `check --explain` and benchmarks. A search without a clock pays a branch
//! a slice of time; no answer depends on one.

use std::time::{Duration, Instant};

/// A part of the work on a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// In front of the search: closed forms and advances of whole primitives, convex bodies in holes.
    Front,
    /// Stage 1: the collision region of a slice of time.
    Region,
    /// Stage 2: the walk of both octrees, and what it hands over.
    Walk,
    /// Stage 3: cells, clauses, Newton attempts.
    Cells,
}

impl Stage {
    /// All, in order.
    pub const ALL: [Self; 4] = [Self::Front, Self::Region, Self::Walk, Self::Cells];

    /// A word or two for tables.
    pub fn name(self) -> &'static str {
        ["in front", "stage 1", "stage 2", "stage 3"][self as usize]
    }
}

/// Time spent in each stage.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock {
    spent: [Duration; Stage::ALL.len()],
    running: Option<(Stage, Instant)>,
}

impl Clock {
    /// Time spent in a stage.
    pub fn of(&self, stage: Stage) -> Duration {
        self.spent[stage as usize]
    }

    /// Time spent in all.
    pub fn total(&self) -> Duration {
        self.spent.iter().sum()
    }

    /// The last stage that was reached.
    pub fn last(&self) -> Stage {
        let worked = |s: &&Stage| !self.of(**s).is_zero();
        Stage::ALL.iter().rev().find(worked).copied().unwrap_or(Stage::Front)
    }

    /// What follows is work of a stage; `None`: of none.
    pub(super) fn enter(&mut self, stage: Option<Stage>) {
        let now = Instant::now();
        if let Some((before, since)) = self.running {
            self.spent[before as usize] += now - since;
        }
        self.running = stage.map(|s| (s, now));
    }
}
