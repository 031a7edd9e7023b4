//! Memory of a search, kept from one to the next.

use super::cell::Cell;
use super::clock::{Clock, Stage};
use crate::contact::exclusion::clause;
use crate::contact::exclusion::literal::Side;
use crate::solid::Face;
use crate::solid::local::{LiteralId, Token};
use std::collections::BinaryHeap;

/// Memory of a search, kept from one to the next.
#[derive(Default, Debug)]
pub struct Scratch {
    pub(super) heap: BinaryHeap<Cell>,
    pub(super) pool: Vec<Token>,
    pub(super) clip_planes_b: Vec<Face>,
    pub(super) clause: clause::Scratch,
    /// Guesses that were followed: of which literals, from how small a cell, and whether to their ends.
    pub(super) tried: Vec<(Vec<(Side, LiteralId)>, i32, bool)>,
    clock: Option<Clock>,
}

impl Scratch {
    /// With a clock: `take_clock` tells afterwards where the time went.
    pub fn timed() -> Self {
        Self { clock: Some(Clock::default()), ..Self::default() }
    }

    /// What the clock says, which starts anew.
    pub fn take_clock(&mut self) -> Option<Clock> {
        self.clock.as_mut().map(std::mem::take)
    }

    /// What follows is work of a stage.
    pub(in crate::contact) fn enter(&mut self, stage: impl Into<Option<Stage>>) {
        if let Some(clock) = &mut self.clock {
            clock.enter(stage.into());
        }
    }

    /// Empty, for a search to begin with.
    pub(super) fn cleared(mut self) -> Self {
        self.heap.clear();
        self.pool.clear();
        self.clip_planes_b.clear();
        self.tried.clear();
        (self.clause.clauses, self.clause.evaluations) = (0, 0);
        self
    }
}
