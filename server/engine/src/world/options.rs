//! What is asked of a step, and why a batch is refused.

use contactd_proto::ErrorCode;
use std::fmt;

/// Why a batch was refused. The world is as it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepError {
    /// The code.
    pub code: ErrorCode,
    /// Index of the offending record; `None` when it is the batch or an option.
    pub index: Option<u32>,
}

impl fmt::Display for StepError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.index {
            Some(index) => write!(f, "record {index}: {}", self.code),
            None => write!(f, "{}", self.code),
        }
    }
}

impl std::error::Error for StepError {}

/// What is asked of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepOptions {
    /// Fraction of the previous step that is taken before this one, 0..1.
    pub advance: f64,
    /// Duration in seconds, for declared speeds; 0 when unknown.
    pub dt: f64,
    /// Only the pairs whose bracket meets the scene's earliest contact.
    pub first: bool,
    /// Tell clear pairs too, those that the broad phase excluded among them.
    pub clear: bool,
    /// Most pairs told, the earliest first; 0: all.
    pub max_records: u32,
    /// Most further slots for contact regions, those of the earliest pairs; 0: all.
    pub max_patch_slots: u32,
    /// Most cells' worth of work (`Counters::spent`) of one pair's search; 0: the default.
    pub cell_limit: u64,
    /// The same of the searches of the whole step, the pairs that may meet earliest first; 0: the default.
    pub batch_limit: u64,
}

impl Default for StepOptions {
    fn default() -> Self {
        Self {
            advance: 1.0,
            dt: 0.0,
            first: false,
            clear: false,
            max_records: 0,
            max_patch_slots: 0,
            cell_limit: 0,
            batch_limit: 0,
        }
    }
}
