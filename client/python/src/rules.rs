//! Rules as Python gives them: any object with the fields of `contactd.Rule`.

use crate::errors;
use contactd_proto::{Detect, InitialOverlap, Report, Rule};
use pyo3::prelude::*;

/// The fields of `contactd.Rule`.
#[derive(FromPyObject)]
pub struct RuleFields {
    between: [String; 2],
    except_: Vec<[String; 2]>,
    detect: String,
    report: String,
    penetration: bool,
    margin: f64,
    initial_overlap: String,
    sensor: bool,
}

impl RuleFields {
    /// The rule.
    ///
    /// # Errors
    /// `Refused` at `index`, naming a word that is not in its table.
    pub fn rule(self, py: Python<'_>, index: usize) -> PyResult<Rule> {
        let unknown = |field: &str, word: &str, words: Vec<&str>| {
            let words = words.join(", ");
            errors::bad_rule(py, &format!("rule {index}: {field} = {word:?} is none of {words}"), index)
        };
        let names = || Detect::ALL.iter().map(|w| w.name()).collect();
        let detect = Detect::of_name(&self.detect).ok_or_else(|| unknown("detect", &self.detect, names()))?;
        let names = || Report::ALL.iter().map(|w| w.name()).collect();
        let report = Report::of_name(&self.report).ok_or_else(|| unknown("report", &self.report, names()))?;
        let names = || InitialOverlap::ALL.iter().map(|w| w.name()).collect();
        let word = &self.initial_overlap;
        let initial_overlap = InitialOverlap::of_name(word).ok_or_else(|| unknown("initial_overlap", word, names()))?;
        Ok(Rule {
            between: self.between,
            except: self.except_,
            detect,
            report,
            penetration: self.penetration,
            margin: self.margin,
            initial_overlap,
            sensor: self.sensor,
        })
    }
}
