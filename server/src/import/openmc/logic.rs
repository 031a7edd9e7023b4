//! What follows from the sides of surfaces alone: that regions have no point in common, whatever the surfaces are.
//!
//! Each surface is a proposition, a point is on the one side of it or on the other (one that is on it counts for neither, and is no
//! inside of anything), and a region is a formula. Regions whose formulas cannot hold together have no inside in common: found by splitting
//! and by what follows at once (M. Davis, G. Logemann, D. Loveland, A machine program for theorem-proving, CACM 5(7), 1962).

use super::region::Region;
use super::surface::Surface;

/// Splits at most; what takes more is left to a search.
const MOST_SPLITS: usize = 2_000;

/// True when it is shown that no point is within all of some regions.
pub(super) fn have_nothing_in_common(regions: &[&Region], surfaces: &[Surface]) -> bool {
    let mut named = Vec::new();
    regions.iter().for_each(|region| region.surfaces(&mut named));
    named.sort_unstable();
    named.dedup();
    let mut open = vec![vec![None; named.len()]];
    let mut proof = Proof { surfaces, named, sides: Vec::new(), splits: 0 };
    // Depth first: each case is one in which the sides of some surfaces are chosen.
    while let Some(sides) = open.pop() {
        proof.sides = sides;
        match proof.follow(regions) {
            Case::Impossible => {}
            Case::Possible => return false,
            Case::Open(surface) => {
                proof.splits += 1;
                if proof.splits > MOST_SPLITS {
                    return false;
                }
                for outside in [false, true] {
                    let mut sides = proof.sides.clone();
                    sides[proof.place(surface)] = Some(outside);
                    open.push(sides);
                }
            }
        }
    }
    true
}

/// A case of a proof.
struct Proof<'a> {
    surfaces: &'a [Surface],
    /// The surfaces that the regions name, in order.
    named: Vec<usize>,
    /// Whether a point is outside of each of them, where that is chosen.
    sides: Vec<Option<bool>>,
    splits: usize,
}

/// What becomes of a case.
enum Case {
    /// A region does not hold.
    Impossible,
    /// All of them hold.
    Possible,
    /// It depends on this surface, among others.
    Open(usize),
}

impl Proof<'_> {
    /// Where a surface stands among those that are named.
    fn place(&self, surface: usize) -> usize {
        self.named.partition_point(|named| *named < surface)
    }

    /// The side of a surface, where it is chosen.
    fn side(&self, surface: usize) -> Option<bool> {
        self.sides[self.place(surface)]
    }

    /// What a region is in this case.
    fn value(&self, region: &Region) -> Option<bool> {
        match region {
            Region::Side { surface, outside } => self.side(*surface).map(|side| side == *outside),
            Region::All(parts) => self.of(parts, false),
            Region::Any(parts) => self.of(parts, true),
        }
    }

    /// Of parts of which one that is `decisive` decides.
    fn of(&self, parts: &[Region], decisive: bool) -> Option<bool> {
        let mut all = Some(!decisive);
        for part in parts {
            match self.value(part) {
                Some(value) if value == decisive => return Some(decisive),
                Some(_) => {}
                None => all = None,
            }
        }
        all
    }

    /// Chooses what follows at once, until nothing does.
    fn follow(&mut self, regions: &[&Region]) -> Case {
        loop {
            let mut is_new = false;
            let mut open = None;
            for region in regions {
                match self.value(region) {
                    Some(false) => return Case::Impossible,
                    Some(true) => continue,
                    None => {}
                }
                let Some(changed) = self.hold(region) else { return Case::Impossible };
                is_new |= changed;
                open = open.or_else(|| self.first_open(region));
            }
            if !is_new {
                return open.map_or(Case::Possible, Case::Open);
            }
        }
    }

    /// Chooses what a region that holds asks for; whether anything was chosen, `None` where it cannot hold.
    fn hold(&mut self, region: &Region) -> Option<bool> {
        match region {
            Region::Side { surface, outside } => match self.side(*surface) {
                Some(side) => (side == *outside).then_some(false),
                None => self.choose(*surface, *outside).then_some(true),
            },
            Region::All(parts) => {
                let mut is_new = false;
                for part in parts {
                    is_new |= self.hold(part)?;
                }
                Some(is_new)
            }
            Region::Any(parts) => {
                if self.value(region) == Some(true) {
                    return Some(false);
                }
                let mut left = parts.iter().filter(|part| self.value(part).is_none());
                match (left.next(), left.next()) {
                    (None, _) => None,
                    (Some(only), None) => self.hold(only),
                    _ => Some(false),
                }
            }
        }
    }

    /// Chooses a side of a surface; false where one that is chosen has nothing in common with it.
    fn choose(&mut self, surface: usize, outside: bool) -> bool {
        let own = &self.surfaces[surface];
        let chosen = self.sides.iter().zip(&self.named).filter_map(|(side, of)| side.map(|side| (*of, side)));
        let is_possible =
            !chosen.into_iter().any(|(other, side)| own.parts_from(outside, (&self.surfaces[other], side)));
        let place = self.place(surface);
        self.sides[place] = Some(outside);
        is_possible
    }

    /// A surface that a region depends on.
    fn first_open(&self, region: &Region) -> Option<usize> {
        match region {
            Region::Side { surface, .. } => self.side(*surface).is_none().then_some(*surface),
            Region::All(parts) | Region::Any(parts) => {
                let open = parts.iter().filter(|part| self.value(part).is_none());
                open.into_iter().find_map(|part| self.first_open(part))
            }
        }
    }
}
