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

use crate::contact::exclusion::literal::Side;
use crate::contact::witness::contacts::Contacts;
use crate::contact::witness::found::Ending;
use crate::motion::Relative;
use glam::DVec3;
use pierced::{CavityPair, First, Guess, Wall};
use proof::ProofEnd;
use smallvec::SmallVec;

/// Pairs of parts beyond which the search does better.
const MOST_PAIRS: usize = 256;
/// Contacts that are solved for before a pair is left to the contacts.
const MOST_CONTACTS: usize = 6;

/// The answer for two unions of convex primitives, of which one or both have cavities; `None` leaves them to the contacts.
pub(super) fn answer(contacts: &mut Contacts) -> Option<Ending> {
    let task = contacts.task;
    let (of_a, of_b) = (task.model_a.parts.as_ref()?, task.model_b.parts.as_ref()?);
    let pierced = of_a.are_pierced() || of_b.are_pierced();
    if !pierced || of_a.all().len() * of_b.all().len() > MOST_PAIRS {
        return None;
    }
    let (placed_a, placed_b) = task.relative.placed();
    let seen_from_a = Relative::new(placed_b, placed_a);
    let mut pairs: SmallVec<[(CavityPair, Option<DVec3>); 1]> = SmallVec::new();
    let mut guess: Option<(usize, Guess)> = None;
    for a in of_a.all() {
        for b in of_b.all() {
            let (main_a, main_b) = (&task.a.primitives[a.main as usize], &task.b.primitives[b.main as usize]);
            let of_b = || CavityPair::new(&task, main_a, *b, Side::B, &task.relative);
            let of_a = || CavityPair::new(&task, main_b, *a, Side::A, &seen_from_a);
            let pair = if b.is_pierced() { of_b().or_else(of_a) } else { of_a() }?;
            // Later ones than what is known are not looked for to their end.
            let until = guess.as_ref().map_or(1.0, |(_, g)| g.t);
            match pair.first(until, &mut contacts.counters.closed_forms) {
                // What starts as near as it may be is told where it comes no deeper.
                First::Near => {
                    let (verdict, looks) = pair.prove(1.0, None);
                    contacts.counters.closed_forms += looks;
                    if verdict != ProofEnd::Proven {
                        return None;
                    }
                }
                First::Never => pairs.push((pair, None)),
                First::Guess(g) => {
                    pairs.push((pair, if let Wall::Round(u) = g.wall { Some(u) } else { None }));
                    if guess.as_ref().is_none_or(|(_, other)| g.t < other.t) {
                        guess = Some((pairs.len() - 1, g));
                    }
                }
            }
        }
    }
    let mut solved = 0;
    if let Some((i, g)) = &guess {
        solved += 1;
        // Where there is none, as when a body that spins swings back, the proof says so, or where it is.
        pairs[*i].0.solve(contacts, g);
    }
    for (pair, toward) in &pairs {
        loop {
            let end = contacts.goal().min(1.0);
            let (verdict, looks) = pair.prove(end, *toward);
            contacts.counters.closed_forms += looks;
            match verdict {
                ProofEnd::Proven => break,
                ProofEnd::Open => return None,
                ProofEnd::Met(t, wall) => {
                    solved += 1;
                    let goal = contacts.goal();
                    let guess = pair.settle(t, wall, 0.0, &mut contacts.counters.closed_forms);
                    let found = solved <= MOST_CONTACTS && pair.solve(contacts, &guess);
                    if !(found && contacts.goal() < goal) {
                        return None;
                    }
                }
            }
        }
    }
    Some(contacts.end())
}

#[cfg(test)]
mod tests;
