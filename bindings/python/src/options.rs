//! What is asked of the steps to come.

use contactd_client::StepOptions;
use pyo3::prelude::*;

/// What is asked of the steps to come. Stays as it is set, but for `advance`, which each accepted step puts back to 1.
#[pyclass(get_all, set_all, module = "contactd")]
#[derive(Clone, Debug)]
pub struct Options {
    /// Fraction 0..1 of its previous step at which every object stands before the next one.
    pub advance: f64,
    /// Duration of a step in seconds, for objects with a declared largest speed; 0: unknown.
    pub dt: f64,
    /// Only the pairs whose bracket meets the scene's earliest contact.
    pub first: bool,
    /// A detail slot with each record.
    pub details: bool,
    /// Records of clear pairs too.
    pub clear: bool,
    /// Poll while waiting; the server then need not wake this client.
    pub polling: bool,
    /// Most records, the earliest first; 0: all.
    pub max_records: u32,
    /// Most cells that one pair's search may refine; 0: the server's default.
    pub cell_limit: u32,
    /// Most cells that all searches of a step may refine together; 0: the server's default.
    pub batch_limit: u32,
}

impl Default for Options {
    fn default() -> Self {
        let StepOptions { advance, dt, first, details, clear, polling, max_records, cell_limit, batch_limit } =
            StepOptions::default();
        Self { advance, dt, first, details, clear, polling, max_records, cell_limit, batch_limit }
    }
}

impl From<&Options> for StepOptions {
    fn from(o: &Options) -> Self {
        let Options { advance, dt, first, details, clear, polling, max_records, cell_limit, batch_limit } = *o;
        Self { advance, dt, first, details, clear, polling, max_records, cell_limit, batch_limit }
    }
}

#[pymethods]
impl Options {
    fn __repr__(&self) -> String {
        let word = |b: bool| if b { "True" } else { "False" };
        format!(
            "Options(advance={}, dt={}, first={}, details={}, clear={}, polling={}, max_records={}, cell_limit={}, \
             batch_limit={})",
            self.advance,
            self.dt,
            word(self.first),
            word(self.details),
            word(self.clear),
            word(self.polling),
            self.max_records,
            self.cell_limit,
            self.batch_limit
        )
    }
}
