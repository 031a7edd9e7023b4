//! Rules as Python gives them: any object with the fields of `contactd.Rule`, which is made of the same table
//! (`contactd_proto::rule`).

use crate::errors;
use contactd_proto::rule::{Field, Setting, Values};
use contactd_proto::{Effects, Rule};
use pyo3::prelude::*;

/// The rule that stands at `index` of a list.
///
/// # Errors
/// `AttributeError` for a field that is missing, `TypeError` for one of another type; `Refused` at `index`, naming a word that
/// is not in its table.
pub fn rule(rule: &Bound<'_, PyAny>, index: usize) -> PyResult<Rule> {
    let mut effects = Effects::DEFAULT;
    for field in Effects::FIELDS {
        let setting = setting(field, &rule.getattr(field.name)?, index)?;
        let is_set = field.set(&mut effects, setting);
        debug_assert!(is_set, "a setting of the field's own type");
    }
    let except = rule.getattr("except_")?.extract()?;
    Ok(Rule { except, ..Rule::asking(rule.getattr("between")?.extract()?, effects) })
}

/// What a field is set to.
fn setting(field: &Field, value: &Bound<'_, PyAny>, index: usize) -> PyResult<Setting> {
    match field.values {
        Values::Flag(_) => Ok(Setting::Flag(value.extract()?)),
        Values::Length => Ok(Setting::Length(value.extract()?)),
        Values::Words(..) => {
            let word: String = value.extract()?;
            field.word(&word).ok_or_else(|| {
                let (name, words) = (field.name, field.words().collect::<Vec<_>>().join(", "));
                errors::bad_rule(value.py(), &format!("rule {index}: {name} = {word:?} is none of {words}"), index)
            })
        }
    }
}
