//! What the search answers for a pair. Geometry does not fail: doubt is a value with its bracket.

use glam::DVec3;

/// What became of a pair over the step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The surfaces meet within the step.
    Contact,
    /// They don't.
    Clear,
    /// Deeper than 2 delta at the start already.
    Overlap,
    /// The work limit ran out; that nothing is met before some time is proven.
    Undecided,
}

/// Which features meet, the less smooth one first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum ContactKind {
    FaceFace,
    EdgeFace,
    VertexFace,
    EdgeEdge,
    VertexEdge,
    VertexVertex,
}

impl ContactKind {
    /// From the number of active surfaces on each side: 1 face, 2 edge, 3 or more vertex.
    pub fn of_active(a: usize, b: usize) -> Self {
        match (a.max(b).clamp(1, 3), a.min(b).clamp(1, 3)) {
            (1, _) => ContactKind::FaceFace,
            (2, 1) => ContactKind::EdgeFace,
            (2, _) => ContactKind::EdgeEdge,
            (_, 1) => ContactKind::VertexFace,
            (_, 2) => ContactKind::VertexEdge,
            _ => ContactKind::VertexVertex,
        }
    }

    /// The contract's word for it.
    pub fn name(self) -> &'static str {
        ["face-face", "edge-face", "vertex-face", "edge-edge", "vertex-edge", "vertex-vertex"][self as usize]
    }
}

/// Whether the first contact is one point, a line or a patch of points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Extent {
    Point,
    Line,
    Patch,
}

impl Extent {
    /// The contract's word for it.
    pub fn name(self) -> &'static str {
        ["point", "line", "patch"][self as usize]
    }
}

impl Status {
    /// The contract's word for it.
    pub fn name(self) -> &'static str {
        ["contact", "clear", "overlap", "undecided"][self as usize]
    }
}

/// Counted work of one query; sums are taken over a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Primitives of both trees before stage 1.
    pub primitives: u64,
    /// Primitives left after stage 1.
    pub after_stage1: u64,
    /// Pairs of octree nodes visited by the walk.
    pub node_pairs: u64,
    /// Candidate primitive pairs that stage 2 handed to stage 3.
    pub candidates: u64,
    /// Cells refined in stage 3.
    pub cells: u64,
    /// Clauses bounded.
    pub clauses: u64,
    /// Newton attempts.
    pub newton: u64,
    /// Whole-primitive closed forms used.
    pub closed_forms: u64,
    /// Work of stage 3 in evaluations of a literal: what cells differ in, from one to a thousand and more.
    pub evaluations: u64,
    /// Cells' worth of work on one instant: whether a pair touches, its regions, its deepest point.
    pub instant_cells: u64,
    /// Times of contact worked out.
    pub times: u64,
    /// Contact points worked out, with normal, kind and faces.
    pub contacts: u64,
    /// Deepest points of overlaps looked for.
    pub penetrations: u64,
    /// Overlaps at the start that were searched past.
    pub past_overlaps: u64,
}

/// Evaluations that count as one cell where a limit of cells is concerned; a limit below `DEFAULT_CELL_LIMIT` allows as many of
/// them as that one does, so that few cells are few cells, however dear. So no kind of cells makes a search last longer than
/// others.
pub const EVALUATIONS_PER_CELL: u64 = 64;

/// Cells' worth of evaluations that count as one cell where a search's patience is concerned.
const DEAR: u64 = 3;

/// Cells that a pair may cost by default.
pub const DEFAULT_CELL_LIMIT: u64 = 1_000_000;

impl Counters {
    /// What counts against a limit of so many cells: the cells refined, or the evaluations that they took in cells' worth of
    /// them (less what a small limit leaves of the default one), whichever is more.
    pub fn spent(&self, limit: u64) -> u64 {
        self.cells.max(self.worth(limit))
    }

    /// What counts against a search's patience: its cells, or a third of the cells' worth of evaluations that they took, whichever
    /// is more. Few cells whose clauses are dear are no sign that a search is stuck.
    pub fn effort(&self) -> u64 {
        self.cells.max(self.evaluations / (DEAR * EVALUATIONS_PER_CELL))
    }

    fn worth(&self, limit: u64) -> u64 {
        (self.evaluations / EVALUATIONS_PER_CELL).saturating_sub(DEFAULT_CELL_LIMIT.saturating_sub(limit))
    }

    /// True when a search that took this, at all its depths together, would not have been cut by a limit of so many cells.
    pub fn fits(&self, limit: u64) -> bool {
        // At each depth the larger of both counts; at none the last cell's evaluations decide. How deep an overlap is was worked out
        // within the same limit.
        self.cells + self.instant_cells + self.worth(limit) < limit
    }
}

impl std::ops::AddAssign for Counters {
    fn add_assign(&mut self, o: Self) {
        self.primitives += o.primitives;
        self.after_stage1 += o.after_stage1;
        self.node_pairs += o.node_pairs;
        self.candidates += o.candidates;
        self.cells += o.cells;
        self.clauses += o.clauses;
        self.newton += o.newton;
        self.closed_forms += o.closed_forms;
        self.evaluations += o.evaluations;
        self.instant_cells += o.instant_cells;
        self.times += o.times;
        self.contacts += o.contacts;
        self.penetrations += o.penetrations;
        self.past_overlaps += o.past_overlaps;
    }
}

/// "No face" in `faces_a`, `faces_b`.
pub const NO_FACE: u32 = u32::MAX;

/// The answer for a pair (a, b). World frame; times are fractions of the step; normal from a to b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// What became of the pair, and what is known of it.
    pub verdict: Verdict,
    /// Separation at the start lies within the touching threshold.
    pub touching: bool,
    /// A lower bound of the separation at the start, where one was found on the way to a contact, but for rounding; else negative.
    pub apart: f64,
    /// The resolution delta that was used.
    pub resolution: f64,
    /// The depth that was searched for, which the verdict's times speak of: delta; twice as much where the bodies start deeper
    /// than that; the depth of an overlap that was searched past, and delta.
    pub depth: f64,
    /// Of a clear pair with a margin: proven farther apart than that until then, 0 where it is not at the start; 1: for the
    /// whole step.
    pub margin_time: f64,
    /// An overlap at the start was searched past.
    pub past: bool,
    /// Work done.
    pub counters: Counters,
}

/// What became of a pair over the step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// The surfaces don't meet within the step. Where they rest on each other at the start, and regions are asked for: the nearest region.
    Clear {
        /// They don't before this: 1, or the latest time that a search for a scene's first contact had to prove.
        until: f64,
        /// What a record tells of that region.
        rest: Option<ContactPoint>,
    },
    /// The surfaces meet within the step.
    Contact(Contact),
    /// Deeper than 2 delta at the start already.
    Overlap(Overlap),
    /// The work limit ran out.
    Undecided {
        /// Before it no point is deeper than `Outcome::depth` in both.
        time_lower: f64,
    },
}

/// A contact with the bracket that proves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Before it no point is deeper than `Outcome::depth` in both.
    pub time_lower: f64,
    /// Where the surfaces meet.
    pub time: f64,
    /// A verified witness of that depth exists then.
    pub time_upper: f64,
    /// `time` could not be continued back from the witness and equals `time_upper`.
    pub not_continued: bool,
    /// A point that lies that deep in both bodies at `time_upper`, in the frame of a's model, which does not take part in a spin about
    /// an axis of revolution of its own (`query::without_own_spin`). Of contacts that a search has found.
    pub witness: Option<DVec3>,
    /// Where and how they meet, if that is asked for.
    pub point: Option<ContactPoint>,
}

/// Bodies that are in each other at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// When they are: 0; of a discrete pair 1, the end of the step, which alone is asked about.
    pub time: f64,
    /// A point that proves it, deeper than 2 delta in both, if it is asked for.
    pub point: Option<ContactPoint>,
    /// How deep they are, if that is asked for.
    pub penetration: Option<Penetration>,
}

/// Where two bodies meet, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPoint {
    /// Contact point, or a point that proves an overlap.
    pub point: DVec3,
    /// Unit normal from a to b.
    pub normal: DVec3,
    /// A vertex met a vertex: the normal is the average of the adjacent normals.
    pub averaged_normal: bool,
    /// Signed separation: 0 at contact, twice the point's depth where the time was not continued, at overlap minus what `point` proves
    /// of the depth; at the start for a clear pair at rest. Of an overlap that was searched past the depth at the time of contact, negative.
    pub separation: f64,
    /// Approach speed along the normal at that time, length per step, positive = approaching.
    pub normal_speed: f64,
    /// Which features meet.
    pub kind: ContactKind,
    /// How far the contact extends.
    pub extent: Extent,
    /// Active faces of a, by face id within its model; `NO_FACE` fills.
    pub faces_a: [u32; 3],
    /// Active faces of b.
    pub faces_b: [u32; 3],
}

/// How deep two bodies are in each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penetration {
    /// A proven lower bound of the depth: no shorter translation takes the bodies apart.
    pub depth: f64,
    /// The deepest point.
    pub point: DVec3,
    /// Unit direction from a to b along which the depth is measured.
    pub direction: DVec3,
}

impl Default for ContactPoint {
    /// Nothing but zeros and no faces: what a caller fills in.
    fn default() -> Self {
        Self {
            point: DVec3::ZERO,
            normal: DVec3::ZERO,
            averaged_normal: false,
            separation: 0.0,
            normal_speed: 0.0,
            kind: ContactKind::FaceFace,
            extent: Extent::Point,
            faces_a: [NO_FACE; 3],
            faces_b: [NO_FACE; 3],
        }
    }
}

impl ContactPoint {
    fn swap_sides(&mut self) {
        self.normal = -self.normal;
        std::mem::swap(&mut self.faces_a, &mut self.faces_b);
    }
}

impl Contact {
    /// A contact at `time` that is proven from both sides, of which no point is known yet.
    pub(in crate::contact) fn at(time: f64, time_upper: f64) -> Self {
        Self { time_lower: time, time, time_upper, not_continued: false, witness: None, point: None }
    }
}

impl Verdict {
    /// An overlap at the start of which nothing more is known.
    pub(in crate::contact) const OVERLAP: Self = Self::Overlap(Overlap { time: 0.0, point: None, penetration: None });

    /// What became of the pair.
    pub fn status(&self) -> Status {
        match self {
            Self::Clear { .. } => Status::Clear,
            Self::Contact(_) => Status::Contact,
            Self::Overlap(_) => Status::Overlap,
            Self::Undecided { .. } => Status::Undecided,
        }
    }
}

impl Default for Outcome {
    /// The answer "they don't meet", without work, of no resolution yet.
    fn default() -> Self {
        Self {
            verdict: Verdict::Clear { until: 1.0, rest: None },
            touching: false,
            apart: f64::NEG_INFINITY,
            resolution: 0.0,
            depth: 0.0,
            margin_time: 1.0,
            past: false,
            counters: Counters::default(),
        }
    }
}

impl Outcome {
    /// The answer "they don't meet".
    pub fn clear(resolution: f64) -> Self {
        Self { resolution, depth: resolution, ..Self::default() }
    }

    /// What became of the pair.
    pub fn status(&self) -> Status {
        self.verdict.status()
    }

    /// Before it no point is deeper than `depth` in both.
    pub fn time_lower(&self) -> f64 {
        match &self.verdict {
            Verdict::Clear { until, .. } => *until,
            Verdict::Contact(contact) => contact.time_lower,
            Verdict::Overlap(overlap) => overlap.time,
            Verdict::Undecided { time_lower } => *time_lower,
        }
    }

    /// When the surfaces meet; the end of the step where they don't, or where that is not known.
    pub fn time(&self) -> f64 {
        match &self.verdict {
            Verdict::Contact(contact) => contact.time,
            Verdict::Overlap(overlap) => overlap.time,
            Verdict::Clear { .. } | Verdict::Undecided { .. } => 1.0,
        }
    }

    /// From when on they are known to have met; the end of the step where they don't, or where that is not known.
    pub fn time_upper(&self) -> f64 {
        match &self.verdict {
            Verdict::Contact(contact) => contact.time_upper,
            _ => self.time(),
        }
    }

    /// True for a contact and for an overlap.
    pub fn meets(&self) -> bool {
        matches!(self.verdict, Verdict::Contact(_) | Verdict::Overlap(_))
    }

    /// The contact, if there is one.
    pub fn contact(&self) -> Option<&Contact> {
        match &self.verdict {
            Verdict::Contact(contact) => Some(contact),
            _ => None,
        }
    }

    /// True for a contact whose time is that of its witness: it could not be continued back from there.
    pub fn not_continued(&self) -> bool {
        self.contact().is_some_and(|contact| contact.not_continued)
    }

    /// Where the bodies meet, rest on each other or overlap, as far as it was asked for.
    pub fn point(&self) -> Option<&ContactPoint> {
        match &self.verdict {
            Verdict::Clear { rest, .. } => rest.as_ref(),
            Verdict::Contact(contact) => contact.point.as_ref(),
            Verdict::Overlap(overlap) => overlap.point.as_ref(),
            Verdict::Undecided { .. } => None,
        }
    }

    /// How deep an overlap is, where it was asked for.
    pub fn penetration(&self) -> Option<&Penetration> {
        match &self.verdict {
            Verdict::Overlap(overlap) => overlap.penetration.as_ref(),
            _ => None,
        }
    }

    /// The same answer with a and b exchanged.
    pub(in crate::contact) fn swap_sides(&mut self) {
        match &mut self.verdict {
            Verdict::Clear { rest: point, .. } => point.as_mut(),
            Verdict::Contact(contact) => contact.point.as_mut(),
            Verdict::Overlap(overlap) => {
                if let Some(penetration) = &mut overlap.penetration {
                    penetration.direction = DVec3::ZERO - penetration.direction;
                }
                overlap.point.as_mut()
            }
            Verdict::Undecided { .. } => None,
        }
        .into_iter()
        .for_each(ContactPoint::swap_sides);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A limit is one of work, too: what a million cells may evaluate ends a search of fewer, whatever its own limit is below that.
    #[test]
    fn a_limit_of_cells_counts_their_work() {
        let most = EVALUATIONS_PER_CELL * DEFAULT_CELL_LIMIT;
        for limit in [20, 30_000, DEFAULT_CELL_LIMIT, 4 * DEFAULT_CELL_LIMIT] {
            let allowed = EVALUATIONS_PER_CELL * limit.max(DEFAULT_CELL_LIMIT);
            let with = |evaluations: u64| Counters { cells: 7, evaluations, ..Counters::default() };
            assert!(with(allowed - 1).spent(limit) < limit && with(allowed).spent(limit) >= limit, "{limit}");
            assert!(!with(allowed).fits(limit) && with(most / 2).fits(limit), "{limit}");
            assert_eq!(Counters { cells: limit, ..Counters::default() }.spent(limit), limit);
            // How deep an overlap is was worked out within the same limit.
            let split = |instant_cells| Counters { cells: limit / 2, instant_cells, ..Counters::default() };
            assert!(split(limit - limit / 2 - 1).fits(limit) && !split(limit - limit / 2).fits(limit), "{limit}");
        }
    }
}
