//! The queue of a branch and bound that goes on where the bound is lowest.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// What is open of a branch and bound: the lowest bound comes first, of equal ones the one that was put in last. So the order follows
/// from the numbers alone, and the same search always goes the same way.
#[derive(Clone, Debug)]
pub struct BoundQueue<T> {
    heap: BinaryHeap<Entry<T>>,
    /// How many were put in.
    count: u64,
}

#[derive(Clone, Debug)]
struct Entry<T> {
    bound: f64,
    number: u64,
    item: T,
}

impl<T> PartialEq for Entry<T> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl<T> Eq for Entry<T> {}

impl<T> PartialOrd for Entry<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<T> Ord for Entry<T> {
    /// The heap's greatest is the first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.bound.total_cmp(&self.bound).then(self.number.cmp(&other.number))
    }
}

impl<T> BoundQueue<T> {
    /// A queue with nothing in it.
    pub fn new() -> Self {
        Self { heap: BinaryHeap::new(), count: 0 }
    }

    /// Puts in an item with its lower bound.
    pub fn push(&mut self, bound: f64, item: T) {
        self.count += 1;
        self.heap.push(Entry { bound, number: self.count, item });
    }

    /// The lowest bound of all; infinite where nothing is left.
    pub fn lowest(&self) -> f64 {
        self.heap.peek().map_or(f64::INFINITY, |entry| entry.bound)
    }

    /// Takes out the first with its bound.
    pub fn pop(&mut self) -> Option<(f64, T)> {
        self.heap.pop().map(|entry| (entry.bound, entry.item))
    }
}

impl<T> Default for BoundQueue<T> {
    fn default() -> Self {
        Self::new()
    }
}
