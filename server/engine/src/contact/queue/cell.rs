//! A cell of the search: a box over a span of time.

use crate::contact::exclusion::tighten;
use crate::math::Aabb;
use glam::DVec3;
use std::cmp::Ordering;

/// An expression in the token pool; `start == end` means true everywhere.
pub(super) type Range = (u32, u32);

/// What an item of the queue is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// A cell of stage 3.
    Cell,
    /// A slice of time for stages 1 and 2.
    Slice,
}

/// An item: a box fixed in A with what is left there of both trees, or what such boxes come from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    /// Proven free of contact before this time.
    pub t: f64,
    /// End of the slice of time that it stands for.
    pub until: f64,
    /// Order of creation: ties in time are popped in this order.
    pub serial: u64,
    pub center: DVec3,
    pub half: DVec3,
    pub a: Range,
    /// B's expression at all times.
    pub b_always: Range,
    /// B's expression until `b_until`.
    pub b: Range,
    pub b_until: f64,
    /// Length of a look ahead in units of radius / speed.
    pub reach: f64,
    /// What it is; only cells have a box and expressions.
    pub source: Source,
}

impl Cell {
    pub(super) fn new((t, until): (f64, f64), region: &Aabb, a: Range, b: Range) -> Self {
        let (center, half) = (region.center(), region.half());
        Self {
            t,
            until,
            serial: 0,
            center,
            // Centre and half are rounded; the box they make must hold the region.
            half: half + (center.abs() + half) * f64::EPSILON,
            a,
            b_always: b,
            b,
            b_until: f64::INFINITY,
            reach: 2.0,
            source: Source::Cell,
        }
    }

    /// Leaves of the box what lies in `left`, offsets from its centre, rounded outwards.
    pub(super) fn shrink(&mut self, left: &Aabb) {
        tighten::shrink(&mut self.center, &mut self.half, left);
    }

    pub(super) fn source(t: f64, until: f64, source: Source) -> Self {
        Self { source, ..Self::new((t, until), &Aabb::around(DVec3::ZERO, DVec3::ZERO), (0, 0), (0, 0)) }
    }
}

impl PartialEq for Cell {
    fn eq(&self, o: &Self) -> bool {
        self.cmp(o) == Ordering::Equal
    }
}
impl Eq for Cell {}
impl PartialOrd for Cell {
    fn partial_cmp(&self, o: &Self) -> Option<Ordering> {
        Some(self.cmp(o))
    }
}
impl Ord for Cell {
    // The heap's greatest is the earliest.
    fn cmp(&self, o: &Self) -> Ordering {
        o.t.total_cmp(&self.t).then(o.serial.cmp(&self.serial))
    }
}
