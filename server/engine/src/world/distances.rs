//! The least distances that the last step has told of pairs that rested: a question that is asked again to the bit has the answer that it
//! had, and costs nothing.
//!
//! Only such: bounds that began from those of a motion before would be as right and have other bits, and what a session remembers must
//! change none (docs/algorithm/coherence.md).

use crate::contact::PlacedModel;
use crate::contact::distance::{Distance, DistanceQuery};
use contactd_proto::Pose;
use std::collections::HashMap;

/// Pairs that are kept at most, some 450 bytes each.
const MOST: usize = 16_384;

/// The ids of two bodies.
type Pair = (u32, u32);

/// A question, by what may change of it from step to step, and its answer.
#[derive(Debug)]
struct Asked {
    /// Places in their objects, poses of these, and the tolerance, as bits.
    bits: [u64; 29],
    told: Distance,
}

/// What was told of pairs that rested, in the last step and in this one.
#[derive(Debug, Default)]
pub struct Distances {
    last: HashMap<Pair, Asked>,
    next: HashMap<Pair, Asked>,
}

impl Distances {
    /// The answer to a question of two bodies, whose models never change, if the last step asked it and no limit would have ended it.
    pub fn recall(&self, pair: Pair, query: &DistanceQuery) -> Option<Distance> {
        let asked = self.last.get(&pair)?;
        let is_same = bits(query).is_some_and(|bits| bits == asked.bits);
        (is_same && asked.told.is_settled && asked.told.cells < query.limit).then_some(asked.told)
    }

    /// Keeps an answer of this step for the next one, where both bodies rest.
    pub fn keep(&mut self, pair: Pair, query: &DistanceQuery, told: &Distance) {
        if let Some(bits) = bits(query).filter(|_| self.next.len() < MOST) {
            self.next.insert(pair, Asked { bits, told: *told });
        }
    }

    /// This step is the last one from now on.
    pub fn turn(&mut self) {
        std::mem::swap(&mut self.last, &mut self.next);
        self.next.clear();
    }
}

/// A question's bits; `None` where a body moves.
fn bits(query: &DistanceQuery) -> Option<[u64; 29]> {
    let mut all = [query.tolerance.to_bits(); 29];
    for (body, to) in [&query.a, &query.b].into_iter().zip(all.chunks_exact_mut(14)) {
        let PlacedModel { placed, .. } = body;
        if placed.motion.velocity != glam::DVec3::ZERO || placed.motion.spin != glam::DVec3::ZERO {
            return None;
        }
        let numbers = |pose: &Pose| pose.position.to_array().into_iter().chain(pose.rotation.to_array());
        to.iter_mut()
            .zip(numbers(&placed.place).chain(numbers(&placed.motion.start)))
            .for_each(|(to, number)| *to = number.to_bits());
    }
    Some(all)
}
