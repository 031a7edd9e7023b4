//! What is asked of a step.

/// What is asked of the steps to come. Stays as it is set, but for `advance`, which each accepted step puts back to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepOptions {
    /// Fraction 0..1 of its previous step at which every object stands before the next one.
    pub advance: f64,
    /// Duration of a step in seconds, for objects with a declared largest speed; 0: unknown.
    pub dt: f64,
    /// Only the pairs whose bracket meets the scene's earliest contact.
    pub first: bool,
    /// A detail slot with each record: upper end of the bracket, point in a's frame, penetration.
    pub details: bool,
    /// Records of clear pairs too.
    pub clear: bool,
    /// This client polls while it waits; the server then need not wake it.
    pub polling: bool,
    /// Most records, the earliest first; 0: all.
    pub max_records: u32,
    /// Most cells' worth of work of one pair's search; 0: the server's default.
    pub cell_limit: u32,
    /// The same of all searches of a step together; 0: the server's default. Pairs that would need more stay
    /// undecided, the latest first.
    pub batch_limit: u32,
}

impl Default for StepOptions {
    fn default() -> Self {
        Self {
            advance: 1.0,
            dt: 0.0,
            first: false,
            details: false,
            clear: false,
            polling: false,
            max_records: 0,
            cell_limit: 0,
            batch_limit: 0,
        }
    }
}
