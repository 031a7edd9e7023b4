//! Expressions of GDML: numbers, names, + − * / ^, parentheses, functions.
//!
//! Source: GDML User's Guide 2.8, section 3.1; the names are those of CLHEP's evaluator. Lengths are millimetres, angles radians.

use std::collections::HashMap;
use std::f64::consts::{E, PI};

/// What names stand for.
#[derive(Clone, Debug, Default)]
pub(super) struct Names {
    values: HashMap<String, f64>,
    /// Those of them that are always known: nothing else may be called so.
    known: Vec<&'static str>,
    /// Matrices: columns, and the values row by row.
    matrices: HashMap<String, (usize, Vec<f64>)>,
}

/// Parentheses within parentheses, signs before signs, powers of powers.
const DEEPEST: usize = 100;

/// Units of length and angle.
const UNITS: [(&str, f64); 17] = [
    ("mm", 1.0),
    ("millimeter", 1.0),
    ("cm", 10.0),
    ("centimeter", 10.0),
    ("m", 1e3),
    ("meter", 1e3),
    ("km", 1e6),
    ("um", 1e-3),
    ("micrometer", 1e-3),
    ("nm", 1e-6),
    ("in", 25.4),
    ("rad", 1.0),
    ("radian", 1.0),
    ("mrad", 1e-3),
    ("milliradian", 1e-3),
    ("deg", PI / 180.0),
    ("degree", PI / 180.0),
];

/// A unit of length in millimetres, or of angle in radians.
pub(super) fn unit(word: &str) -> Option<f64> {
    UNITS.iter().find(|(name, _)| *name == word).map(|(_, unit)| *unit)
}

impl Names {
    /// The names that are always known.
    pub fn new() -> Self {
        let numbers = [("pi", PI), ("twopi", 2.0 * PI), ("halfpi", 0.5 * PI), ("e", E)];
        let known = numbers.into_iter().chain(UNITS);
        let values = known.clone().map(|(name, value)| (name.to_owned(), value)).collect();
        Self { values, known: known.map(|(name, _)| name).collect(), matrices: HashMap::new() }
    }

    /// Says what a name stands for; false for one that has a meaning of its own.
    #[must_use]
    pub fn set(&mut self, name: &str, value: f64) -> bool {
        let is_free = !self.known.contains(&name);
        if is_free {
            self.values.insert(name.to_owned(), value);
        }
        is_free
    }

    pub fn set_matrix(&mut self, name: &str, columns: usize, values: Vec<f64>) {
        self.matrices.insert(name.to_owned(), (columns, values));
    }

    /// The value of an expression.
    ///
    /// # Errors
    /// What was expected, and what stands there.
    pub fn value(&self, text: &str) -> Result<f64, (String, String)> {
        let mut reader = Reader { names: self, rest: text, depth: 0 };
        let value = reader.sum()?;
        reader.space();
        if !reader.rest.is_empty() {
            return Err(("the end of the expression".into(), reader.found()));
        }
        if !value.is_finite() {
            return Err(("an expression with a finite value".into(), format!("{text:?}, which is {value}")));
        }
        Ok(value)
    }
}

struct Reader<'a> {
    names: &'a Names,
    rest: &'a str,
    depth: usize,
}

type Value = Result<f64, (String, String)>;

impl Reader<'_> {
    fn space(&mut self) {
        self.rest = self.rest.trim_start();
    }

    fn found(&self) -> String {
        if self.rest.is_empty() {
            "its end".into()
        } else {
            format!("{:?}", self.rest.chars().take(20).collect::<String>())
        }
    }

    fn is(&mut self, mark: &str) -> bool {
        self.space();
        let rest = self.rest.strip_prefix(mark);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn sum(&mut self) -> Value {
        let mut value = self.product()?;
        loop {
            if self.is("+") {
                value += self.product()?;
            } else if self.is("-") {
                value -= self.product()?;
            } else {
                return Ok(value);
            }
        }
    }

    fn product(&mut self) -> Value {
        let mut value = self.signed()?;
        loop {
            self.space();
            if !self.rest.starts_with("**") && self.is("*") {
                value *= self.signed()?;
            } else if self.is("/") {
                value /= self.signed()?;
            } else {
                return Ok(value);
            }
        }
    }

    /// One step further in.
    fn deeper(&mut self) -> Result<(), (String, String)> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err((format!("at most {DEEPEST} parentheses and signs within each other"), "more".into()));
        }
        Ok(())
    }

    fn signed(&mut self) -> Value {
        let is_minus = self.is("-");
        if is_minus || self.is("+") {
            self.deeper()?;
            let value = self.signed()?;
            self.depth -= 1;
            return Ok(if is_minus { -value } else { value });
        }
        self.power()
    }

    /// From the left, as CLHEP has it.
    fn power(&mut self) -> Value {
        let mut value = self.atom()?;
        while self.is("^") || self.is("**") {
            let is_minus = self.is("-");
            let exponent = self.atom()?;
            value = value.powf(if is_minus { -exponent } else { exponent });
        }
        Ok(value)
    }

    fn arguments(&mut self) -> Result<Vec<f64>, (String, String)> {
        self.deeper()?;
        let mut all = vec![self.sum()?];
        while self.is(",") {
            all.push(self.sum()?);
        }
        self.depth -= 1;
        Ok(all)
    }

    fn atom(&mut self) -> Value {
        self.space();
        if self.is("(") {
            let all = self.arguments()?;
            return match (all.as_slice(), self.is(")")) {
                ([one], true) => Ok(*one),
                _ => Err(("a closing parenthesis".into(), self.found())),
            };
        }
        let is_name = |c: char| c.is_alphabetic() || c == '_';
        if self.rest.starts_with(is_name) {
            let end =
                self.rest.find(|c: char| !is_name(c) && !c.is_ascii_digit() && c != '.').unwrap_or(self.rest.len());
            let (name, rest) = self.rest.split_at(end);
            self.rest = rest;
            return self.named(name);
        }
        self.number()
    }

    fn number(&mut self) -> Value {
        let bytes = self.rest.as_bytes();
        let mut end = 0;
        while end < bytes.len() {
            let c = bytes[end];
            let is_sign = (c == b'+' || c == b'-') && end > 0 && matches!(bytes[end - 1], b'e' | b'E');
            let is_exponent = matches!(c, b'e' | b'E') && end > 0;
            if !(c.is_ascii_digit() || c == b'.' || is_sign || is_exponent) {
                break;
            }
            end += 1;
        }
        let (word, rest) = self.rest.split_at(end);
        let value = word.parse::<f64>().map_err(|_| ("a number, a name or a parenthesis".into(), self.found()))?;
        self.rest = rest;
        Ok(value)
    }

    fn named(&mut self, name: &str) -> Value {
        if self.is("[") {
            let index = self.arguments()?;
            if !self.is("]") {
                return Err(("a closing bracket".into(), self.found()));
            }
            let Some((columns, values)) = self.names.matrices.get(name) else {
                return Err(("the name of a matrix".into(), format!("{name:?}")));
            };
            let at = |x: f64| (x >= 1.0 && x.fract() == 0.0).then_some(x as usize - 1);
            let place = match index.as_slice() {
                [i] => at(*i),
                [i, j] => at(*i).zip(at(*j)).filter(|(_, j)| j < columns).map(|(i, j)| i * columns + j),
                _ => None,
            };
            let found = place.and_then(|place| values.get(place).copied());
            return found.ok_or_else(|| (format!("indices within the matrix {name}"), format!("{index:?}")));
        }
        if self.is("(") {
            let all = self.arguments()?;
            if !self.is(")") {
                return Err(("a closing parenthesis".into(), self.found()));
            }
            return match (name, all.as_slice()) {
                ("sin", [x]) => Ok(x.sin()),
                ("cos", [x]) => Ok(x.cos()),
                ("tan", [x]) => Ok(x.tan()),
                ("asin", [x]) => Ok(x.asin()),
                ("acos", [x]) => Ok(x.acos()),
                ("atan", [x]) => Ok(x.atan()),
                ("atan2", [y, x]) => Ok(y.atan2(*x)),
                ("sinh", [x]) => Ok(x.sinh()),
                ("cosh", [x]) => Ok(x.cosh()),
                ("tanh", [x]) => Ok(x.tanh()),
                ("exp", [x]) => Ok(x.exp()),
                ("log", [x]) => Ok(x.ln()),
                ("log10", [x]) => Ok(x.log10()),
                ("sqrt", [x]) => Ok(x.sqrt()),
                ("abs", [x]) => Ok(x.abs()),
                ("pow", [x, y]) => Ok(x.powf(*y)),
                ("min", [x, y]) => Ok(x.min(*y)),
                ("max", [x, y]) => Ok(x.max(*y)),
                _ => Err(("a function that is known".into(), format!("{name:?} of {} numbers", all.len()))),
            };
        }
        self.names
            .values
            .get(name)
            .copied()
            .ok_or_else(|| ("a name that is defined before it is used".into(), format!("{name:?}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expressions_have_the_values_of_arithmetic() {
        let mut names = Names::new();
        assert!(names.set("a", 3.0) && names.set("b_1", -2.0) && !names.set("rad", 5.0));
        names.set_matrix("m", 2, vec![1.0, 2.0, 3.0, 4.0]);
        for (text, value) in [
            ("1+2*3", 7.0),
            ("-(1+2)*3", -9.0),
            ("2^3^2", 64.0),
            ("2^-1", 0.5),
            ("-2^2", -4.0),
            ("2**3", 8.0),
            ("10./4 - .5", 2.0),
            ("1e-3*a", 3e-3),
            ("1.5E+2", 150.0),
            ("a*b_1", -6.0),
            ("m[2,1] + m[2]", 5.0),
            ("sqrt(16)/cos(0)", 4.0),
            ("2*cm", 20.0),
            ("90*deg", PI / 2.0),
            (" a - - 1 ", 4.0),
            ("pow(2, 10)", 1024.0),
        ] {
            let found = names.value(text).unwrap_or_else(|e| panic!("{text}: {e:?}"));
            assert!((found - value).abs() < 1e-12, "{text}: {found}");
        }
        for (text, word) in [
            ("", "a number"),
            ("1+", "a number"),
            ("(1", "closing"),
            ("1 2", "the end"),
            ("x", "defined"),
            ("f(1)", "a function"),
            ("1/0", "finite"),
            ("m[3,1]", "indices"),
            ("m[1,3]", "indices"),
            ("n[1]", "the name of a matrix"),
            (&"(".repeat(1000), "at most"),
            (&("-".repeat(100_000) + "1"), "at most"),
            (&"1^".repeat(100_000), "a number"),
        ] {
            let (expected, _) = names.value(text).expect_err(text);
            assert!(expected.contains(word), "{text}: {expected}");
        }
    }
}
