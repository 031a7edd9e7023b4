//! A contact that was found, what stands beside it, and how a search ends.

use super::features::Seen;
use super::newton::Solution;
use glam::DVec3;

/// Witnesses this close in time are of one contact; touches this close are at the same time.
pub(in crate::contact) const SAME_TIME: f64 = 1e-12;

/// Witnesses this close, in scales of the pair, are one point.
pub(in crate::contact) const SAME_POINT: f64 = 1e-6;

/// A confirmed contact.
#[derive(Clone, Debug)]
pub struct Found {
    /// The witness of depth delta.
    pub deep: Solution,
    /// The same contact where the surfaces meet, when it could be continued back.
    pub touch: Option<Solution>,
    /// Time until which everything must be proven free.
    pub goal: f64,
    /// Earliest time of a witness of depth delta, this contact's or a rival's.
    pub upper: f64,
    /// That witness, in A's frame.
    pub witness: DVec3,
    /// The faces of the touch, where they were asked for on the way to it.
    pub seen: Option<Seen>,
}

impl Found {
    /// Latest time at which a contact that touches earlier than this one may reach delta and still be preferred to it: its
    /// witness comes later by no more than this one's own lag behind its touch.
    pub(in crate::contact) fn latest_rival(&self) -> f64 {
        self.touch.as_ref().map_or(self.goal, |touch| 2.0 * self.deep.t - touch.t.max(0.0))
    }

    /// The contact to report of two: of those that reach delta at about the same time the one that touches first.
    pub(in crate::contact) fn or(self, other: Self) -> Self {
        let goal = self.goal.min(other.goal);
        let (upper, witness) = self.earlier_witness(&other);
        let (first, second) = if other.goal < self.goal { (other, self) } else { (self, other) };
        let earlier = match (&first.touch, &second.touch) {
            (Some(a), Some(b)) => b.t < a.t - SAME_TIME && second.deep.t <= first.latest_rival(),
            _ => false,
        };
        Self { goal, upper, witness, ..if earlier { second } else { first } }
    }

    /// The earlier of two witnesses.
    pub(in crate::contact) fn earlier_witness(&self, other: &Self) -> (f64, DVec3) {
        if other.upper < self.upper { (other.upper, other.witness) } else { (self.upper, self.witness) }
    }
}

/// How a search ended.
// The contact is kept in place: one a query, and nothing allocated.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug)]
pub enum Ending {
    /// No contact within the step.
    Clear,
    /// The earliest contact.
    Contact(Found),
    /// A point of this depth exists at t = 0 (A's frame).
    Deep(DVec3),
    /// Free before this time; then, to within rounding, as deep as delta: neither excluded nor a contact.
    Rounding(f64),
    /// The work limit ran out; free before this time.
    Limit(f64),
    /// The search took long enough for another resolution to be tried (`Search::patience`); free before this time. The contact that is
    /// known, if any, comes much later.
    Long(f64, Option<Found>),
}

impl Ending {
    /// Nothing is met before, fraction of the step.
    pub(in crate::contact) fn proven(&self) -> f64 {
        match self {
            Ending::Clear => 1.0,
            Ending::Contact(found) => found.goal.clamp(0.0, 1.0),
            Ending::Deep(_) => 0.0,
            Ending::Rounding(t) | Ending::Limit(t) | Ending::Long(t, _) => *t,
        }
    }
}
