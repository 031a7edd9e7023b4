//! Answers as users read them: the JSON object of `check --json`, the table in 80 columns, the work behind each answer.
//!
//! Numbers in JSON are the shortest decimals that read back to the same bits. The table rounds: what is below a pair's
//! resolution is 0 (`table`). A field without meaning for a status is null in JSON and left out of the table: a clear pair has
//! no point. Features name the primitive by its index in file order and the format's name (JSON), or by file and line (table),
//! its face, and its sense in the solid.
//!
//! Floor 9.

mod answer;
mod table;
mod work;

pub use answer::{Answer, ClearanceAnswer, Feature, Features, PairAnswer, PairReport, Penetration, RegionAnswer};
pub use table::{TableStyle, faces};
pub use work::{effects_line, work_table};
