//! In front of the search: unions of convex parts, and convex bodies in cavities, answered by proven advances.
//!
//! Idea: a body P meets K − H only where it meets K, and there only where it leaves H. So two unions are free while each pair of their
//! parts is, cavities filled (`convex::ConvexParts`); and while P cut by the faces of K lies inside H, nothing is met, whatever else P
//! does above and below. How far the cut body reaches in a direction across the cavity is told by its support and one multiplier
//! (`body`); a sector of directions over a span of time is excluded by its four corners (`proof`). A body that several cavities hold
//! together is cut by the planes in which they end, too, and each piece lies inside of its own (`layers`). So: (1)
//! from the start, the lines along which the clearance falls say when and in which direction it is used up first; (2) the faces that
//! hold the body there are solved for a contact, as the search does it, and both trees confirm it or it is none; (3) the time up to it
//! is proven; what the proof meets instead is solved in turn. No contact by the end: clear.
//!
//! Both solids may be unions; cavities are cylinders, cones or have flat faces; of several cavities of one body the nearest one is
//! asked. P's own cavities are left out, which only makes more of it. What starts nearer than a few resolutions is proven to come no
//! deeper or left to the search, as is what overlaps or does not settle; nothing is guessed.
//! Source: conservative advancement (B. Mirtich, PhD thesis, Berkeley 1996) on a bound by duality; derivation in `proof`.

mod body;
mod layers;
mod pierced;
mod proof;

use crate::bound::CollisionRegion;
use crate::contact::convex::{AtStart, ConvexParts, Sight};
use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::Task;
use crate::contact::witness::contacts::Contacts;
use crate::contact::witness::found::Ending;
use crate::math::Aabb;
use crate::motion::{Relative, Sweep};
use crate::solid::parts::{Parts, PiercedPart};
use crate::solid::{Primitive, Solid};
use glam::DVec3;
use pierced::{CavityPair, First, Guess};
use proof::ProofEnd;
use smallvec::SmallVec;
use std::cell::OnceCell;

/// Pairs of parts beyond which the search does better.
const MOST_PAIRS: usize = 256;
/// As many of them within a collision region, those apart by their boxes left out; and most primitives of a region that is looked at.
const MOST_NEAR: usize = 128;
const MOST_LEFT: usize = 96;
/// Cavities of one part that are tried for one body within a region.
const MOST_TRIED: usize = 3;
/// What seems to be met within this time, in steps, may be met at once: parts that share a rim both meet what either does.
const AT_ONCE: f64 = 1e-3;
/// Directions across which layers are looked for, and how nearly equal, by their cosine, two are taken for one.
const MOST_AXES: usize = 4;
const ALONG: f64 = 1.0 - 1e-9;
/// Contacts that are solved for before a pair is left to the contacts.
const MOST_CONTACTS: usize = 6;

/// The answer for two unions of convex primitives, less others; `None` leaves them to the contacts. What is no such union, or one of
/// too many, may be one in the collision region, beyond which nothing is met.
pub(super) fn answer(contacts: &mut Contacts) -> Option<Ending> {
    let task = contacts.task;
    if let (Some(of_a), Some(of_b)) = (&task.model_a.parts, &task.model_b.parts)
        && of_a.all().len() * of_b.all().len() <= MOST_PAIRS
        && (of_a.are_pierced() || of_b.are_pierced())
    {
        let pairs = of_a.all().iter().flat_map(|a| of_b.all().iter().map(|b| (*a, *b))).collect();
        return Unions::new(&task, [of_a, of_b], pairs, false).answer(contacts);
    }
    // At a negative depth a point lies beyond the boxes of its primitives. Two convex primitives have had their turn.
    if task.delta <= 0.0 || !task.strategies.region || task.a.whole().is_some() && task.b.whole().is_some() {
        return None;
    }
    let region = contacts.region(0.0, 1.0)?;
    if region.a.primitives + region.b.primitives > MOST_LEFT {
        return None;
    }
    let of_a = Parts::within(task.a, &|n| region.a.node_alive(n))?;
    let of_b = Parts::within(task.b, &|n| region.b.node_alive(n))?;
    let pairs = near(&task, &region, &of_a, &of_b, 0.0)?;
    Unions::new(&task, [&of_a, &of_b], pairs, true).answer(contacts)
}

/// True where no two points of the bodies are within `way` (a length) of each other over the whole step of a task, as far as the
/// kernel can tell by parts and their cavities. It takes next to nothing where the bodies are of another kind.
///
/// Of two such points x of a and y of b each has f up to `way` in the other body, so both lie in the region of that level, and in
/// parts of it. What a direction proves for them, w·(y − x) >= φ, is more than |w|·`way`: the proof for a depth of 0 with as much
/// taken off beside rounding.
pub(super) fn keeps_apart(task: &Task, way: f64) -> bool {
    if !task.strategies.region || !way.is_finite() {
        return false;
    }
    let Some(region) = (Task { delta: -way, ..*task }).region(0.0, 1.0) else { return true };
    if region.a.primitives + region.b.primitives > MOST_LEFT {
        return false;
    }
    let of_a = Parts::within(task.a, &|n| region.a.node_alive(n));
    let of_b = Parts::within(task.b, &|n| region.b.node_alive(n));
    let (Some(of_a), Some(of_b)) = (of_a, of_b) else { return false };
    let Some(pairs) = near(task, &region, &of_a, &of_b, way) else { return false };
    let least = way + 8.0 * task.rounding;
    let of_cavities = Task { delta: 0.0, rounding: task.rounding + 0.5 * way, ..*task };
    let unions = Unions::new(&of_cavities, [&of_a, &of_b], pairs, true);
    (0..unions.pairs.len()).all(|index| {
        unions.convex(index).is_some_and(|parts| parts.stay_apart(least))
            || unions.cavities(index).any(|pair| pair.prove(1.0, None).0 == ProofEnd::Proven)
    })
}

/// Parts of both bodies by pairs.
type Pairs = SmallVec<[(PiercedPart, PiercedPart); 4]>;

/// The pairs of parts that may come within `way` of each other in a collision region: their boxes do, those of b swept. `None` where
/// there are many.
fn near(task: &Task, region: &CollisionRegion, of_a: &Parts, of_b: &Parts, way: f64) -> Option<Pairs> {
    let (placed_a, placed_b) = task.relative.placed();
    let sweep = Sweep::new(placed_b, placed_a);
    let left =
        |solid: &Solid, part: &PiercedPart, left: &Aabb| solid.primitives[part.main as usize].aabb.intersection(left);
    let boxes_a: Vec<Aabb> = of_a.all().iter().map(|a| left(task.a, a, &region.a.aabb).grown(way)).collect();
    let mut pairs = Pairs::new();
    for b in of_b.all() {
        let swept = sweep.of_box(&left(task.b, b, &region.b.aabb), 0.0, 1.0);
        pairs.extend(of_a.all().iter().zip(&boxes_a).filter(|(_, own)| own.meets(&swept)).map(|(a, _)| (*a, *b)));
        if pairs.len() > MOST_NEAR {
            return None;
        }
    }
    Some(pairs)
}

/// Two unions of parts, some of them pierced, and the pairs of parts beside which nothing can meet.
struct Unions<'s, 'a> {
    task: &'s Task<'a>,
    of_a: &'s Parts,
    of_b: &'s Parts,
    pairs: Pairs,
    /// The motion with the bodies exchanged, made when a cavity of a is first asked for.
    seen_from_a: OnceCell<Relative>,
    /// The parts are those of a collision region. There a part is often one end of others, so that not every edge that it has is met,
    /// and lies in several cavities: contacts are solved for at once, and more than one cavity is tried.
    in_region: bool,
}

/// Bodies with cavities that they may be in. They are large, and stay where they are made.
type Cavities<'u> = SmallVec<[CavityPair<'u>; 2]>;

/// What is to be proven of a pair of parts: which of the cavities shows it, the pair's index, and the direction of a round wall to
/// be looked at first.
struct Claim {
    cavity: usize,
    index: usize,
    toward: Option<DVec3>,
}

/// All of it, for each pair of parts.
type Claims = SmallVec<[Claim; 1]>;

/// Where walls of cavities seem to be met, by their indices: the later ones where the first one is not.
type Guesses = SmallVec<[(usize, Guess); 1]>;

/// About when something seems to be met.
struct Event {
    t: f64,
    what: Met,
}

/// What seems to be met: a cavity's wall, or one part by another, by the pair's index and how they are seen at the start.
enum Met {
    Walls(Guesses),
    Parts(usize, AtStart),
}

impl<'s, 'a> Unions<'s, 'a> {
    fn new(task: &'s Task<'a>, [of_a, of_b]: [&'s Parts; 2], pairs: Pairs, in_region: bool) -> Self {
        Self { task, of_a, of_b, pairs, seen_from_a: OnceCell::new(), in_region }
    }

    fn answer(&self, contacts: &mut Contacts) -> Option<Ending> {
        // Large as they are, they are not moved again.
        let mut cavities = Cavities::with_capacity(self.pairs.len());
        let claims = self.look(contacts, &mut cavities)?;
        let mut solved = 0;
        for claim in &claims {
            self.prove(contacts, &cavities[claim.cavity], claim, &mut solved)?;
        }
        Some(contacts.end())
    }

    /// The body of one part with a cavity of the other, those first that it is in half way of the step, and the one before that it is
    /// deepest in; then the other way round, where more are asked for. Each is made when it is asked for.
    fn cavities(&self, index: usize) -> impl Iterator<Item = CavityPair<'_>> {
        let (a, b) = self.pairs[index];
        let Self { task, of_a, of_b, .. } = self;
        let (main_a, main_b) = (&task.a.primitives[a.main as usize], &task.b.primitives[b.main as usize]);
        let (most, of_both) = if self.in_region { (MOST_TRIED, 2 * MOST_TRIED) } else { (1, 1) };
        let center = task.relative.at(0.5).b_point(main_a.ball.center);
        let of_b = of_b.holes_at(task.b, b, center, most).into_iter();
        let of_b = of_b.filter_map(move |hole| CavityPair::new(task, main_a, (main_b, hole), Side::B, &task.relative));
        let of_a = std::iter::once(()).flat_map(move |()| {
            let seen_from_a = self.seen_from_a();
            let center = seen_from_a.at(0.5).b_point(main_b.ball.center);
            let of_a = of_a.holes_at(task.a, a, center, most).into_iter();
            of_a.filter_map(move |hole| CavityPair::new(task, main_b, (main_a, hole), Side::A, seen_from_a))
        });
        of_b.chain(of_a).take(of_both)
    }

    /// Both parts, their cavities filled: what keeps apart so does all the more without what is in them.
    fn convex(&self, index: usize) -> Option<ConvexParts<'_>> {
        let (a, b) = self.pairs[index];
        if !self.task.strategies.convex {
            return None;
        }
        ConvexParts::new(*self.task, &self.task.a.primitives[a.main as usize], &self.task.b.primitives[b.main as usize])
    }

    fn seen_from_a(&self) -> &Relative {
        self.seen_from_a.get_or_init(|| {
            let (placed_a, placed_b) = self.task.relative.placed();
            Relative::new(placed_b, placed_a)
        })
    }

    /// Looks for the first contact of each pair, and solves for it; what is left to be proven. `None` where a pair may touch at the
    /// start, or is not of the kind.
    ///
    /// Those that seem to meet first are solved for first: what is met later need not be.
    fn look<'u>(&'u self, contacts: &mut Contacts, cavities: &mut Cavities<'u>) -> Option<Claims> {
        let mut claims = Claims::new();
        let mut events: SmallVec<[Event; 2]> = SmallVec::new();
        // Later ones than what seems to come first are not looked for to their end.
        let mut until: f64 = 1.0;
        for index in 0..self.pairs.len() {
            let sight = if self.in_region { self.convex(index).map(|parts| parts.sight()) } else { None };
            match sight {
                Some(Sight::Free) => {}
                Some(Sight::Apart(at_start)) => events.push(Event { t: at_start.t, what: Met::Parts(index, at_start) }),
                Some(Sight::Common) | None => {
                    let guesses = self.claim(contacts, index, until, cavities, &mut claims)?;
                    if let Some((_, Guess { t, .. })) = guesses.first() {
                        if !self.in_region {
                            until = until.min(t + AT_ONCE);
                        }
                        events.push(Event { t: *t, what: Met::Walls(guesses) });
                    }
                }
            }
        }
        events.sort_by(|e, f| e.t.total_cmp(&f.t));
        for Event { what, .. } in events {
            match what {
                // Where there is none, as when a body that spins swings back, the proof says so, or where it is.
                Met::Walls(guesses) => solve(contacts, cavities, &guesses),
                Met::Parts(index, at_start) => {
                    let (a, b) = self.pairs[index];
                    let is_filled = a.is_pierced() || b.is_pierced();
                    if !self.convex(index)?.meet(contacts, &at_start, is_filled) {
                        let until = contacts.goal().min(1.0);
                        let guesses = self.claim(contacts, index, until, cavities, &mut claims)?;
                        solve(contacts, cavities, &guesses);
                    }
                }
            }
        }
        Some(claims)
    }

    /// Adds what is to be proven of a pair of parts, and tells what of it seems to be met before `until`; `None` where no cavity shows
    /// it. Nothing is left to be proven of what starts as near as it may be and comes no deeper.
    fn claim<'u>(
        &'u self,
        contacts: &mut Contacts,
        index: usize,
        until: f64,
        cavities: &mut Cavities<'u>,
        claims: &mut Claims,
    ) -> Option<Guesses> {
        // Each shows that nothing is met before its guess: the one with the latest says most.
        let mut latest: Option<(CavityPair<'u>, Option<Guess>)> = None;
        for pair in self.cavities(index) {
            let guess = match seen(contacts, &pair, until) {
                None => None,
                Some(Seen::Kept) => return Some(Guesses::new()),
                Some(Seen::Never) => {
                    claims.push(Claim { cavity: cavities.len(), index, toward: None });
                    cavities.push(pair);
                    return Some(Guesses::new());
                }
                Some(Seen::Guess(guess)) => Some(guess),
            };
            let when = |guess: &Option<Guess>| guess.as_ref().map_or(f64::NEG_INFINITY, |guess| guess.t);
            if latest.as_ref().is_none_or(|(_, other)| when(&guess) > when(other)) {
                latest = Some((pair, guess));
            }
        }
        let (pair, guess) = latest?;
        // What seems to be met may lie in another cavity, or not, as where a head lands on the floor of its counterbore.
        let layered = self.claim_layers(contacts, (index, &pair, guess.as_ref()), until, cavities, claims);
        let mut guesses = Guesses::new();
        match (layered, &guess) {
            (Some(found), _) => guesses.extend(found),
            (None, None) => return None,
            (None, Some(guess)) => {
                claims.push(Claim { cavity: cavities.len(), index, toward: guess.wall.direction() });
            }
        }
        if let Some(guess) = guess {
            guesses.push((cavities.len(), guess));
            cavities.push(pair);
        }
        Some(guesses)
    }

    /// The same for a body that seems to meet the wall of a cavity, by pieces where others hold the body together with that one; `None`
    /// where they do not.
    fn claim_layers<'u>(
        &'u self,
        contacts: &mut Contacts,
        (index, pair, guess): (usize, &CavityPair<'u>, Option<&Guess>),
        until: f64,
        cavities: &mut Cavities<'u>,
        claims: &mut Claims,
    ) -> Option<Option<(usize, Guess)>> {
        let (a, b) = self.pairs[index];
        let (placed_a, placed_b) = self.task.relative.placed();
        let (solid, parts, part, mover, observer) = match pair.side {
            Side::A => (self.task.a, self.of_a, a, placed_b, placed_a),
            Side::B => (self.task.b, self.of_b, b, placed_a, placed_b),
        };
        let main = &solid.primitives[part.main as usize];
        let swept = Sweep::new(mover, observer).of_box(&pair.primitive.aabb, 0.0, 1.0);
        let common = swept.intersection(&main.aabb);
        if common.is_empty() {
            return None;
        }
        let mut holes = parts.holes_within(solid, part, &common, layers::MOST_CAVITIES)?;
        if !holes.iter().any(|hole| std::ptr::eq(*hole, pair.cavity)) {
            holes.push(pair.cavity);
        }
        if holes.len() < 2 {
            return None;
        }
        let of =
            |hole: &&'u Primitive| CavityPair::new(self.task, pair.primitive, (main, hole), pair.side, pair.relative);
        let all: SmallVec<[CavityPair<'u>; 4]> = holes.iter().filter_map(of).collect();
        let middle = |t| pair.relative.at(t).b_point(pair.primitive.ball.center).clamp(common.min, common.max);
        let [center, then] = [0.0, guess.map_or(0.0, |guess| guess.t)].map(middle);
        let mut axes: SmallVec<[DVec3; 4]> = SmallVec::new();
        for pair in std::iter::once(pair).chain(&all) {
            let own = pair.round.map(|round| round.axis).into_iter().chain(pair.flats.iter().map(|flat| flat.normal));
            for axis in own {
                if axes.len() < MOST_AXES && axes.iter().all(|other| other.dot(axis).abs() < ALONG) {
                    axes.push(axis);
                }
            }
        }
        axes.into_iter().find_map(|axis| {
            let pieces = layers::layers(&all, axis, &common, center, then)?;
            if pieces.len() == 1 && std::ptr::eq(pieces[0].cavity, pair.cavity) {
                return None;
            }
            let mut first: Option<(usize, Guess)> = None;
            let mut found: SmallVec<[Claim; 4]> = SmallVec::new();
            let mut kept = Cavities::new();
            for piece in pieces {
                let toward = match seen(contacts, &piece, until)? {
                    Seen::Kept => continue,
                    Seen::Never => None,
                    Seen::Guess(guess) => {
                        let toward = guess.wall.direction();
                        if first.as_ref().is_none_or(|(_, other)| guess.t < other.t) {
                            first = Some((cavities.len() + kept.len(), guess));
                        }
                        toward
                    }
                };
                found.push(Claim { cavity: cavities.len() + kept.len(), index, toward });
                kept.push(piece);
            }
            claims.extend(found);
            cavities.extend(kept);
            Some(first)
        })
    }

    /// Proves that a pair does not meet before the first contact, which is found first where the proof meets it; `None` if it cannot.
    fn prove(&self, contacts: &mut Contacts, pair: &CavityPair, claim: &Claim, solved: &mut usize) -> Option<()> {
        loop {
            let goal = contacts.goal();
            match proves(contacts, pair, goal.min(1.0), claim.toward) {
                ProofEnd::Proven => return Some(()),
                ProofEnd::Met(t, wall) if *solved < MOST_CONTACTS => {
                    *solved += 1;
                    let guess = pair.settle(t, wall, 0.0, &mut contacts.counters.closed_forms);
                    if pair.solve(contacts, &guess) && contacts.goal() < goal {
                        continue;
                    }
                }
                ProofEnd::Met(..) | ProofEnd::Open => {}
            }
            // What one cavity does not show another one may, or the same parts the other way round.
            let end = contacts.goal().min(1.0);
            let mut others = self.cavities(claim.index).take(if self.in_region { usize::MAX } else { 0 });
            let shown = others.any(|other| proves(contacts, &other, end, None) == ProofEnd::Proven);
            return shown.then_some(());
        }
    }
}

/// Solves for the contact that the first of some guesses points to that both trees confirm.
fn solve(contacts: &mut Contacts, cavities: &Cavities, guesses: &Guesses) {
    for (cavity, guess) in guesses {
        if guess.t >= contacts.goal() + AT_ONCE || cavities[*cavity].solve(contacts, guess) {
            break;
        }
    }
}

/// What a first look at a body in a cavity shows.
enum Seen {
    /// It starts as near as it may be, and comes no deeper.
    Kept,
    /// It meets nothing within the time that was asked for.
    Never,
    Guess(Guess),
}

/// A first look, as far as `until`; `None` where the body may touch at the start and more.
fn seen(contacts: &mut Contacts, pair: &CavityPair, until: f64) -> Option<Seen> {
    Some(match pair.first(until, &mut contacts.counters.closed_forms) {
        First::Near if proves(contacts, pair, 1.0, None) == ProofEnd::Proven => Seen::Kept,
        First::Near => return None,
        First::Never => Seen::Never,
        First::Guess(guess) => Seen::Guess(guess),
    })
}

/// `CavityPair::prove`, counted.
fn proves(contacts: &mut Contacts, pair: &CavityPair, end: f64, toward: Option<DVec3>) -> ProofEnd {
    let (end, looks) = pair.prove(end, toward);
    contacts.counters.closed_forms += looks;
    end
}

#[cfg(test)]
mod tests;
