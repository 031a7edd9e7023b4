//! What is queued: slices and cells, and the expressions that they are made of.

use super::cell::{Cell, Range};
use super::scratch::Scratch;
use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::Task;
use crate::contact::witness::known::Handed;
use crate::solid::Solid;
use crate::solid::local::{LiteralId, Token, Truth};

/// The items of a queue.
pub(super) struct Items {
    pub(super) scratch: Scratch,
    pub(super) handed: Handed,
    serial: u64,
}

impl Items {
    /// None, in some memory.
    pub(super) fn new(scratch: Scratch) -> Self {
        Self { scratch: scratch.cleared(), handed: Handed::default(), serial: 0 }
    }

    pub(super) fn store(&mut self, tokens: &[Token]) -> Range {
        let start = self.scratch.pool.len() as u32;
        self.scratch.pool.extend_from_slice(tokens);
        (start, self.scratch.pool.len() as u32)
    }

    pub(super) fn push(&mut self, mut cell: Cell) {
        cell.serial = self.serial;
        self.serial += 1;
        self.scratch.heap.push(cell);
    }

    /// Takes the earliest item off the queue.
    #[cfg(test)]
    pub(super) fn pop(&mut self) -> Option<Cell> {
        self.scratch.heap.pop()
    }

    /// Time before which nothing can happen in what is queued; infinite when nothing is.
    pub(super) fn earliest(&self) -> f64 {
        self.scratch.heap.peek().map_or(f64::INFINITY, |c| c.t)
    }

    /// True unless B is proven out of a cell's reach for the whole of its slice.
    pub(super) fn may_meet(&self, task: &Task, cell: &Cell) -> bool {
        let at = task.relative.at(cell.t);
        let x_max = (cell.center - at.center_a).length() + cell.half.length();
        let motion = task.relative.bounds(cell.t, cell.until - cell.t, x_max);
        let view = task.view((cell.center, cell.half), &at, motion, &self.scratch.clip_planes_b);
        let tokens = &self.scratch.pool[cell.b.0 as usize..cell.b.1 as usize];
        tokens.is_empty() || task.b.prune(tokens, &mut Vec::new(), &mut |id| view.truth(Side::B, id)) != Truth::False
    }
}

/// Prunes an expression of the pool, the result behind everything else in it.
pub(super) fn prune_in_pool(
    solid: &Solid,
    pool: &mut Vec<Token>,
    source: Range,
    classify: &mut impl FnMut(LiteralId) -> Truth,
) -> (Truth, Range) {
    if source.0 == source.1 {
        return (Truth::True, (0, 0));
    }
    // The source stays put while the result grows behind it: copy it out of the way of the borrow.
    let tokens: smallvec::SmallVec<[Token; 64]> = pool[source.0 as usize..source.1 as usize].into();
    let start = pool.len() as u32;
    let truth = solid.prune(&tokens, pool, classify);
    let end = pool.len() as u32;
    if truth == Truth::Open && end - start == source.1 - source.0 {
        // Nothing folded: keep the old one.
        pool.truncate(start as usize);
        return (Truth::Open, source);
    }
    (truth, (start, end))
}
