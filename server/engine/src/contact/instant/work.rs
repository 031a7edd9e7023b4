//! Work beside the search, in the search's own currency.
//!
//! What is done with one instant of a pair (whether it touches, its regions, its deepest point) is counted as the search
//! is: in cells. A box that is bounded is a cell; a look at one face is a part of one. When the cells run out the work
//! ends, and what was found until then is told as incomplete. So it is when the time of the step is up.

use crate::math::halt;
use std::cell::Cell;

/// Looks at a face that cost as much as bounding one cell.
const LOOKS_PER_CELL: u64 = 64;

/// A limit of work, and how much of it was done.
#[derive(Debug)]
pub struct Work {
    limit: u64,
    looks: Cell<u64>,
}

impl Work {
    /// Work of at most `cells`.
    pub fn new(cells: u64) -> Self {
        Self { limit: cells.saturating_mul(LOOKS_PER_CELL), looks: Cell::new(0) }
    }

    /// Counts looks at faces.
    pub fn look(&self, faces: usize) {
        halt::work(faces);
        self.looks.set(self.looks.get() + faces as u64);
    }

    /// Counts a box that is bounded.
    pub fn bound(&self) {
        self.look(LOOKS_PER_CELL as usize);
    }

    /// True when no more may be done.
    pub fn is_spent(&self) -> bool {
        self.looks.get() >= self.limit || halt::is_up()
    }

    /// Cells' worth of work done.
    pub fn cells(&self) -> u64 {
        self.looks.get().div_ceil(LOOKS_PER_CELL)
    }
}
