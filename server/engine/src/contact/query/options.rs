//! What is worked out for a pair beside whether it meets: how much is told of a contact, and what becomes of an overlap.
//!
//! A search looks at this where it has found something, never while it looks: what is not asked for costs nothing, and
//! asking for less changes no bit of what remains. But for what runs out of work: a hit may be told where its time stays
//! undecided.

use contactd_proto::Report;

/// What is asked of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QueryOptions {
    /// How much of a contact: whether there is one, its time, its point with normal, kind and faces (`Patch` is `Contact`
    /// here: regions are asked of `region`). Of a mere hit neither the time is worked out nor what came before it; its
    /// `time_lower` is what was proven by the way, its `time_upper` when both bodies are known to be in each other.
    pub report: Report,
    /// Of an overlap at the start the deepest point is looked for; otherwise the first common point found is told.
    pub penetration: bool,
    /// The search goes on past an overlap at the start, for its depth and delta more.
    pub past_overlap: bool,
}

impl QueryOptions {
    /// The contact, and no more of an overlap than that there is one.
    pub const CONTACT: Self = Self { report: Report::Contact, penetration: false, past_overlap: false };

    /// The contact, and how deep an overlap is.
    pub const DEPTH: Self = Self { penetration: true, ..Self::CONTACT };

    /// The time of a contact is told.
    pub(in crate::contact) fn time(&self) -> bool {
        self.report >= Report::Time
    }

    /// Its point is told.
    pub(in crate::contact) fn point(&self) -> bool {
        self.report >= Report::Contact
    }
}
