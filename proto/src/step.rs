//! Headers of the step service: what a client asks of a step, and what the server says of it beside the records.

use crate::EffectCounters;
use iceoryx2::prelude::ZeroCopySend;

/// `asked`: only the pairs whose bracket meets the scene's earliest contact.
pub const ASK_FIRST: u32 = 1;
/// `asked`: a detail slot for each record.
pub const ASK_DETAILS: u32 = 2;
/// `asked`: a record for clear pairs too.
pub const ASK_CLEAR: u32 = 4;
/// `asked`: the client polls for its reply, so the server need not wake it.
pub const ASK_POLLING: u32 = 8;
/// All bits of `asked` that this version knows.
pub const ASK_ALL: u32 = 15;

/// Header of a step's request.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct StepRequest {
    /// Protocol version.
    pub version: u32,
    /// `ASK_…` bits.
    pub asked: u32,
    /// Session id.
    pub session: u64,
    /// Epoch of the server that opened the session.
    pub epoch: u64,
    /// The client's step number, echoed.
    pub step: u64,
    /// Fraction 0..1 of its previous step at which every object stands before this one.
    pub advance: f64,
    /// Duration of the step in seconds, for objects with a declared largest speed; 0: unknown.
    pub dt: f64,
    /// Most cells' worth of work of one pair's search (docs/protocol.md); 0: the server's default.
    pub cell_limit: u32,
    /// The same of all searches of the step together; what may meet earliest comes first, the rest stays
    /// undecided. 0: the server's default.
    pub batch_limit: u32,
    /// Most contact records of the reply, the earliest first; 0: no cap.
    pub max_records: u32,
    /// Records of the slice that count.
    pub records: u32,
}

/// Outcome of a step's search over all its pairs: nothing met.
pub const STEP_CLEAR: u32 = 1;
/// Some pair meets or overlaps.
pub const STEP_CONTACT: u32 = 2;
/// A pair was left undecided before the earliest contact.
pub const STEP_UNDECIDED: u32 = 3;
/// The batch was refused and changed nothing; see `error` and `index`.
pub const STEP_REFUSED: u32 = 4;

/// "No record in particular" in `index`.
pub const NO_INDEX: u32 = u32::MAX;

/// Header of a step's reply.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct StepReply {
    /// The request's step number.
    pub step: u64,
    /// Epoch of the server.
    pub epoch: u64,
    /// `STEP_…`.
    pub status: u32,
    /// Number of an error code, 0 for none.
    pub error: u32,
    /// Index of the offending record, or [`NO_INDEX`].
    pub index: u32,
    /// Contact records at the head of the slice.
    pub records: u32,
    /// Further slots behind them.
    pub slots: u32,
    /// 1 when `max_records` left records out.
    pub truncated: u32,
    /// Bits of the effects that ran (`effects::EFFECT_…`).
    pub effects: u32,
    /// Pairs whose plan was continuous or discrete and which the broad phase let through.
    pub pairs: u32,
    /// Smallest time_lower over all pairs: safe to advance to.
    pub safe_time: f64,
    /// Work: what was done, never part of the answer's bits.
    pub counters: WorkCounters,
    /// How often each effect was worked out; no part of the answer's bits either.
    pub effect_counters: EffectCounters,
}

/// Counted work of a step. Never part of the bits that must agree between two ways to the same answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct WorkCounters {
    /// Pairs of boxes that the broad phase compared.
    pub box_tests: u64,
    /// Primitives of both trees before stage 1, summed over the pairs.
    pub primitives: u64,
    /// Primitives left after stage 1.
    pub after_stage1: u64,
    /// Pairs of octree nodes visited.
    pub node_pairs: u64,
    /// Candidate primitive pairs handed to stage 3.
    pub candidates: u64,
    /// Cells refined.
    pub cells: u64,
    /// Clauses bounded.
    pub clauses: u64,
    /// Newton attempts.
    pub newton: u64,
    /// Closed forms used.
    pub closed_forms: u64,
    /// Discrete tests of pairs that moved far enough to have passed through each other.
    pub may_have_passed: u64,
    /// Cells' worth of work on one instant of a pair: whether it touches, its contact regions, its deepest point.
    pub instant_cells: u64,
}

impl WorkCounters {
    /// Each counter with its name, in the order of the fields.
    pub fn each(&self) -> [(&'static str, u64); size_of::<Self>() / size_of::<u64>()] {
        [
            ("box_tests", self.box_tests),
            ("primitives", self.primitives),
            ("after_stage1", self.after_stage1),
            ("node_pairs", self.node_pairs),
            ("candidates", self.candidates),
            ("cells", self.cells),
            ("clauses", self.clauses),
            ("newton", self.newton),
            ("closed_forms", self.closed_forms),
            ("may_have_passed", self.may_have_passed),
            ("instant_cells", self.instant_cells),
        ]
    }
}

const _: () = {
    assert!(size_of::<StepRequest>() == 64);
    assert!(size_of::<StepReply>() == 144 + size_of::<EffectCounters>() && size_of::<WorkCounters>() == 88);
    assert!(std::mem::offset_of!(StepReply, status) == 16);
    assert!(std::mem::offset_of!(StepReply, safe_time) == 48);
    assert!(std::mem::offset_of!(StepReply, effect_counters) == 144);
};
