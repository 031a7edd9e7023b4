//! The file formats of models, one row each: what a format is called, how its files end, what reads it.
//!
//! A new format is a folder beside `csg` and a row of `FORMATS`. Nothing else names one: the wire, the cache, the journal and the
//! clients carry a format's name and a file's bytes.

use super::{Facets, Import, ImportError, Limits, csg};
use std::path::Path;

/// A file format.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    /// What it is called, in lower case.
    pub name: &'static str,
    /// How names of its files end, without the dot, in lower case.
    pub endings: &'static [&'static str],
    /// Reads a model; the first argument is what errors call the file.
    pub read: fn(&str, &[u8], Facets, &Limits) -> Result<Import, ImportError>,
}

/// Every format that is read. A file whose name ends in none of these ways is taken for one of the first.
pub const FORMATS: &[Format] = &[csg::FORMAT];

/// A file that is in memory.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// What errors call it.
    pub name: &'a str,
    /// The name of its format; empty: as its name ends.
    pub format: &'a str,
    /// What it has in it.
    pub bytes: &'a [u8],
}

impl<'a> Source<'a> {
    /// A file whose name says what it is.
    pub fn named(name: &'a str, bytes: &'a [u8]) -> Self {
        Self { name, format: "", bytes }
    }

    /// Its format.
    ///
    /// # Errors
    /// `Format` when one is stated that is not read.
    pub fn format(&self) -> Result<&'static Format, ImportError> {
        if !self.format.is_empty() {
            let stated = self.format.to_ascii_lowercase();
            return FORMATS.iter().find(|f| f.name == stated).ok_or_else(|| ImportError::Format {
                file: self.name.to_owned(),
                expected: FORMATS.iter().map(|f| f.name).collect::<Vec<_>>().join(", "),
                found: self.format.to_owned(),
            });
        }
        let ending = Path::new(self.name).extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        Ok(FORMATS.iter().find(|f| f.endings.contains(&ending.as_str())).unwrap_or(&FORMATS[0]))
    }

    /// Reads it.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn import(&self, facets: Facets, limits: &Limits) -> Result<Import, ImportError> {
        (self.format()?.read)(self.name, self.bytes, facets, limits)
    }
}

/// Reads the bytes of a file.
///
/// # Errors
/// `Read`, and `Large` when there are more than the limit says.
pub fn read_bytes(path: &Path, limits: &Limits) -> Result<Vec<u8>, ImportError> {
    let file = path.display().to_string();
    let read = |reason| ImportError::Read { file: file.clone(), reason };
    if std::fs::metadata(path).map_err(read)?.len() > limits.bytes as u64 {
        return Err(ImportError::Large { file, limit: limits.bytes });
    }
    std::fs::read(path).map_err(read)
}

/// Reads a model from a file whose name says what it is.
///
/// # Errors
/// What is wrong with the file.
pub fn read_model(path: &Path, facets: Facets, limits: &Limits) -> Result<Import, ImportError> {
    Source::named(&path.display().to_string(), &read_bytes(path, limits)?).import(facets, limits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_format_is_what_is_stated_else_what_the_name_says() {
        let of =
            |name: &'static str, format: &'static str| Source { name, format, bytes: b"" }.format().map(|f| f.name);
        for (name, format) in [("a.csg", ""), ("a", ""), ("a.b/c", ""), ("a.CSG", ""), ("a.txt", "csg"), ("a", "CSG")] {
            assert_eq!(of(name, format).unwrap(), "csg", "{name} {format}");
        }
        let sentence = of("part.csg", "step").unwrap_err().to_string();
        assert_eq!(sentence, "part.csg: expected one of the formats csg, found \"step\"");
    }

    #[test]
    fn every_row_is_one_format() {
        let all = |names: Vec<&str>| {
            let mut sorted = names.clone();
            sorted.sort_unstable();
            sorted.dedup();
            assert_eq!(sorted.len(), names.len(), "{names:?}");
            assert!(names.iter().all(|n| !n.is_empty() && n.to_ascii_lowercase() == *n));
        };
        all(FORMATS.iter().map(|f| f.name).collect());
        all(FORMATS.iter().flat_map(|f| f.endings.iter().copied()).collect());
    }

    #[test]
    fn bytes_that_are_no_text_are_refused_with_their_place() {
        let sentence = Source::named("a.csg", b"cube();\n  \xff").import(Facets::Auto, &Limits::default()).unwrap_err();
        assert_eq!(sentence.to_string(), "a.csg:2:3: expected text in UTF-8, found the byte 0xff");
    }
}
