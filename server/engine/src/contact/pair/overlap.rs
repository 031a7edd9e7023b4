//! Where bodies that overlap come apart: the regions in which they touch once they have been moved out of each other.
//!
//! The surfaces of bodies in overlap cut each other, which is no place in which they touch; what resists is the face that the one came
//! through. So the second body is moved along the overlap's direction until it is out, about half of the threshold, and the regions
//! there are told, carried back. The depth of an overlap is that of a ball within both. For faces it is the way out; for an edge or a
//! corner that sticks in it is less, in proportion to how far that sticks in, so it falls evenly on the way: a pair that overlaps still
//! is moved on as far as the fall so far lets expect, and farther each time. One that has gone too far comes back to its first contact.

use super::search::earliest_contact;
use crate::contact::query::options::QueryOptions;
use crate::contact::query::outcome::{Outcome, Penetration, Status};
use crate::contact::query::question::PairQuery;
use crate::contact::queue::scratch::Scratch;
use crate::contact::region::{self, Regions};
use contactd_proto::{Motion, Pose, Report};
use glam::DVec3;

/// Places in overlap that are tried at most.
const MOST_PLACES: usize = 12;
/// How much of a way the depth falls by, at least, where it is followed to its end: of a needle's point it is less.
const LEAST_FALL: f64 = 0.05;
/// From how many places on each step is twice as long as the one before would be.
const PATIENT: usize = 3;

/// The regions of two bodies that overlap so at the start of a question's motion. Their points are half way between the two surfaces,
/// whose separation is negative, along the region's normal. Incomplete, and without regions, where the bodies did not come apart.
pub fn regions(query: &PairQuery, penetration: &Penetration, threshold: f64, scratch: &mut Scratch) -> Regions {
    let mut out = Regions::default();
    let (mut last, mut depth, mut longer) = (DVec3::ZERO, penetration.depth, 1.0);
    // No shorter way than the depth takes the bodies apart: after it they are not farther than half of the threshold.
    let mut way = penetration.direction * (0.5 * threshold + depth);
    for place in 1..=MOST_PLACES {
        if !way.is_finite() {
            // Two half-spaces.
            break;
        }
        let outcome = ask(&moved(query, way, DVec3::ZERO), &mut out, scratch);
        if outcome.status() == Status::Clear {
            at(query, way, threshold, &mut out);
            if out.regions.is_empty() {
                let back = last - way;
                let Some(met) = ask(&moved(query, way, back), &mut out, scratch).contact().map(|met| met.time) else {
                    break;
                };
                way += back * (met - 0.5 * threshold / back.length()).max(0.0);
                at(query, way, threshold, &mut out);
            }
            return out;
        }
        let Some(deepest) = outcome.penetration().filter(|deepest| deepest.depth > 0.0) else { break };
        let falls = (depth - deepest.depth) / way.distance(last);
        (last, depth) = (way, deepest.depth);
        if place >= PATIENT {
            longer *= 2.0;
        }
        let rest = if falls > LEAST_FALL { (depth / falls).max(depth) } else { depth };
        way += deepest.direction * (0.5 * threshold + longer * rest);
    }
    out
}

/// The answer to a question within what is left of its limit.
fn ask(query: &PairQuery, spent: &mut Regions, scratch: &mut Scratch) -> Outcome {
    let cell_limit = query.cell_limit.saturating_sub(spent.cells);
    let outcome = earliest_contact(&PairQuery { cell_limit, ..*query }, scratch);
    spent.cells += outcome.counters.cells + outcome.counters.instant_cells;
    outcome
}

/// Looks for the regions of the bodies with the second one moved.
fn at(query: &PairQuery, way: DVec3, threshold: f64, out: &mut Regions) {
    let cell_limit = query.cell_limit.saturating_sub(out.cells);
    let found = region::regions(&PairQuery { cell_limit, ..moved(query, way, DVec3::ZERO) }, 0.0, threshold);
    out.cells += found.cells;
    (out.regions, out.complete) = (found.regions, found.complete);
    for region in &mut out.regions {
        for p in &mut region.points {
            p.point -= 0.5 * way;
            p.separation -= way.dot(region.normal);
        }
    }
}

/// The question of the same bodies where the motion begins, the second one moved by `way` and going on by `velocity` (world axes).
fn moved<'a>(query: &PairQuery<'a>, way: DVec3, velocity: DVec3) -> PairQuery<'a> {
    let mut apart = *query;
    let [a, b] = [&mut apart.a, &mut apart.b].map(|body| &mut body.placed.motion);
    *a = Motion::resting(a.start);
    *b = Motion { velocity, ..Motion::resting(Pose { position: b.start.position + way, ..b.start }) };
    let report = if velocity == DVec3::ZERO { Report::Hit } else { Report::Time };
    apart.query_options = QueryOptions { report, penetration: true, past_overlap: false };
    apart
}
