//! In front of the search: convex primitives against solids with cavities, answered by a proven advance.
//!
//! Idea: a body P meets K − H only where it meets K, and there only where it leaves H. While P cut by the faces of K lies
//! inside H, nothing is met, whatever else P does above and below. How far the cut body reaches in a direction across the
//! cavity is told by its support and one multiplier (`body`); a sector of directions over a span of time is excluded by its
//! four corners (`proof`). So: (1) from the start, the lines along which the clearance falls say when and in which
//! direction it is used up first; (2) the faces that hold the body there are solved for a contact, as the search does
//! it, and both trees confirm it or it is none; (3) the time up to it is proven; what the proof meets instead is
//! solved in turn. No contact by the end: clear.
//!
//! Both solids may be unions; cavities are cylinders or have flat faces; of several cavities of one body the nearest one is asked.
//! P's own cavities are left out, which only makes more of it. What starts nearer than a few resolutions is proven to come no deeper or
//! left to the search, as is what overlaps or does not settle; nothing is guessed.
//! Source: conservative advancement (B. Mirtich, PhD thesis, Berkeley 1996) on a bound by duality; derivation in `proof`.

mod body;
mod pierced;
mod proof;

use crate::bound::pair::{Side as Operand, locate};
use crate::contact::exclusion::literal::Side;
use crate::contact::witness::contacts::Contacts;
use crate::contact::witness::found::Ending;
use crate::math::Aabb;
use crate::motion::{Relative, Sweep};
use crate::solid::Solid;
use crate::solid::parts::{Parts, PiercedPart};
use glam::DVec3;
use pierced::{CavityPair, First, Guess, Wall};
use proof::ProofEnd;
use smallvec::SmallVec;

/// Pairs of parts beyond which the search does better.
const MOST_PAIRS: usize = 256;
/// As many of them within a collision region, those apart by their boxes left out; and most primitives of a region that is looked at.
const MOST_NEAR: usize = 48;
const MOST_LEFT: usize = 96;
/// Cavities of one part that are tried for one body.
const MOST_TRIED: usize = 3;
/// Contacts that are solved for before a pair is left to the contacts.
const MOST_CONTACTS: usize = 6;

/// The answer for two unions of convex primitives, of which one or both have cavities; `None` leaves them to the contacts. What
/// is no such union, or one of too many, may be one in the collision region, beyond which nothing is met.
pub(super) fn answer(contacts: &mut Contacts) -> Option<Ending> {
    let task = contacts.task;
    if let (Some(of_a), Some(of_b)) = (&task.model_a.parts, &task.model_b.parts)
        && of_a.all().len() * of_b.all().len() <= MOST_PAIRS
    {
        if !of_a.are_pierced() && !of_b.are_pierced() {
            return None;
        }
        let pairs: SmallVec<[_; 4]> = of_a.all().iter().flat_map(|a| of_b.all().iter().map(|b| (*a, *b))).collect();
        return of_pairs(contacts, [of_a, of_b], &pairs, 1);
    }
    // At a negative depth a point lies beyond the boxes of its primitives.
    if task.delta <= 0.0 || !task.strategies.region {
        return None;
    }
    let (placed_a, placed_b) = task.relative.placed();
    let [a, b] = [(task.model_a, placed_a), (task.model_b, placed_b)].map(|(model, placed)| Operand {
        solid: &model.solid,
        bounds: model.bounds_for(task.delta),
        placed,
    });
    let region = locate(&a, &b, 0.0, 1.0, task.delta)?;
    if region.a.primitives + region.b.primitives > MOST_LEFT {
        return None;
    }
    let of_a = Parts::within(task.a, &|n| region.a.node_alive(n))?;
    let of_b = Parts::within(task.b, &|n| region.b.node_alive(n))?;
    let sweep = Sweep::new(placed_b, placed_a);
    let of =
        |solid: &Solid, part: &PiercedPart, left: &Aabb| solid.primitives[part.main as usize].aabb.intersection(left);
    let boxes_a: Vec<Aabb> = of_a.all().iter().map(|a| of(task.a, a, &region.a.aabb)).collect();
    let mut pairs = Vec::new();
    for b in of_b.all() {
        let swept = sweep.of_box(&of(task.b, b, &region.b.aabb), 0.0, 1.0);
        pairs.extend(of_a.all().iter().zip(&boxes_a).filter(|(_, own)| own.meets(&swept)).map(|(a, _)| (*a, *b)));
        if pairs.len() > MOST_NEAR {
            return None;
        }
    }
    if !of_a.are_pierced() && !of_b.are_pierced() {
        return None;
    }
    of_pairs(contacts, [&of_a, &of_b], &pairs, MOST_TRIED)
}

/// The answer for pairs of parts, of which some are pierced, beside which nothing can meet; up to `most` cavities of a part are tried for each body.
fn of_pairs(
    contacts: &mut Contacts,
    [of_a, of_b]: [&Parts; 2],
    parts: &[(PiercedPart, PiercedPart)],
    most: usize,
) -> Option<Ending> {
    let task = contacts.task;
    let (placed_a, placed_b) = task.relative.placed();
    let seen_from_a = Relative::new(placed_b, placed_a);
    // A body and a cavity of either side, the cavities first that the body is in half way of the step, deepest first.
    let cavities = |(a, b): (PiercedPart, PiercedPart)| -> SmallVec<[CavityPair; 2]> {
        let (main_a, main_b) = (&task.a.primitives[a.main as usize], &task.b.primitives[b.main as usize]);
        let center = task.relative.at(0.5).b_point(main_a.ball.center);
        let of_b = of_b.holes_at(task.b, b, center, most).into_iter();
        let of_b = of_b.filter_map(|hole| CavityPair::new(&task, main_a, (main_b, hole), Side::B, &task.relative));
        let center = seen_from_a.at(0.5).b_point(main_b.ball.center);
        let of_a = of_a.holes_at(task.a, a, center, most).into_iter();
        let of_a = of_a.filter_map(|hole| CavityPair::new(&task, main_b, (main_a, hole), Side::A, &seen_from_a));
        of_b.chain(of_a).take(if most == 1 { 1 } else { 2 * most }).collect()
    };
    let mut pairs: SmallVec<[(CavityPair, usize, Option<DVec3>); 1]> = SmallVec::new();
    let mut guess: Option<(usize, Guess)> = None;
    let mut until: f64 = 1.0;
    'parts: for (i, both) in parts.iter().enumerate() {
        for pair in cavities(*both) {
            // Later ones than what is known are not looked for to their end.
            match pair.first(until, &mut contacts.counters.closed_forms) {
                // What starts as near as it may be is told where it comes no deeper.
                First::Near => {
                    let (verdict, looks) = pair.prove(1.0, None);
                    contacts.counters.closed_forms += looks;
                    if verdict != ProofEnd::Proven {
                        continue;
                    }
                }
                First::Never => pairs.push((pair, i, None)),
                First::Guess(g) => {
                    let toward = if let Wall::Round(u) = g.wall { Some(u) } else { None };
                    if most == 1 {
                        until = until.min(g.t);
                        if guess.as_ref().is_none_or(|(_, other)| g.t < other.t) {
                            guess = Some((pairs.len(), g));
                        }
                    } else if pair.solve(contacts, &g) {
                        // Where parts end in others, not every edge that one of them has is met: what is not does not hide a later
                        // contact.
                        until = until.min(contacts.goal());
                    }
                    pairs.push((pair, i, toward));
                }
            }
            continue 'parts;
        }
        return None;
    }
    let mut solved = 0;
    if let Some((i, g)) = &guess {
        solved += 1;
        // Where there is none, as when a body that spins swings back, the proof says so, or where it is.
        pairs[*i].0.solve(contacts, g);
    }
    for (pair, i, toward) in &pairs {
        loop {
            let end = contacts.goal().min(1.0);
            let (verdict, looks) = pair.prove(end, *toward);
            contacts.counters.closed_forms += looks;
            let ProofEnd::Proven = verdict else {
                if let ProofEnd::Met(t, wall) = verdict
                    && solved < MOST_CONTACTS
                {
                    solved += 1;
                    let goal = contacts.goal();
                    let guess = pair.settle(t, wall, 0.0, &mut contacts.counters.closed_forms);
                    if pair.solve(contacts, &guess) && contacts.goal() < goal {
                        continue;
                    }
                }
                // What one cavity does not show another one may, or the same parts the other way round.
                if most > 1 && cavities(parts[*i]).iter().any(|other| other.prove(end, None).0 == ProofEnd::Proven) {
                    break;
                }
                return None;
            };
            break;
        }
    }
    Some(contacts.end())
}

#[cfg(test)]
mod tests;
