//! The file formats of models, one row each: what a format is called, how its files end, what reads it.
//!
//! A new format is a row of `FORMATS` and a folder beside `csg`; one of meshes is a file in `mesh` and a row of `mesh::FORMATS`.
//! Nothing else names one: the wire, the cache, the journal and the clients carry a format's name and a file's bytes.

use super::font::{Pattern, machine};
use super::openscad::{self, Access};
use super::{Facets, Import, ImportError, Limits, csg, mesh};
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

pub use contactd_proto::control::Attachment;

/// A file format.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    /// What it is called, in lower case.
    pub name: &'static str,
    /// How names of its files end, without the dot, in lower case.
    pub endings: &'static [&'static str],
    /// Reads it.
    pub read: Read,
    /// What such a file names beside itself.
    pub names: fn(&[u8], &Limits) -> Vec<Named>,
}

/// What reads a file of a format.
#[derive(Clone, Copy, Debug)]
pub enum Read {
    /// A model.
    Model(fn(&Source, Facets, &Limits) -> Result<Import, ImportError>),
    /// Meshes, of which a model is made.
    Meshes(fn(&[u8], &Limits) -> mesh::Result<mesh::Bodies>),
}

/// What a file names beside itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Named {
    /// Another file, as it names it.
    File(String),
    /// A font.
    Font(Pattern),
}

/// Files that are no models, by how their names end: an empty one would else be taken for an empty model, and of another one its
/// first byte would be told.
const OTHERS: [(&[&str], &str); 6] = [
    (
        &[
            "step", "stp", "iges", "igs", "brep", "brp", "sat", "x_t", "x_b", "jt", "fcstd", "sldprt", "ipt", "f3d",
            "3dm",
        ],
        "a CAD file (export a mesh, such as STL or 3MF, or OpenSCAD's CSG)",
    ),
    (
        &["fbx", "blend", "usd", "usda", "usdc", "usdz", "wrl", "x3d", "ctm"],
        "a mesh of a format that is not read (export STL, OBJ or glTF)",
    ),
    (
        &["svg", "dxf", "png", "jpg", "jpeg", "pdf", "ttf", "otf"],
        "a drawing, a picture or a font (import, surface and text of a CSG text read SVG, DXF, PNG and fonts)",
    ),
    (&["mcap"], "a recording (contactd replay repeats it)"),
    (&["toml", "urdf", "sdf", "srdf", "xacro", "xml", "gdml"], "a scene, a robot or a geometry, which is no model"),
    (&["zip", "gz", "xz", "7z", "tar"], "an archive (unpack it)"),
];

/// Every format that is read. A file whose name ends in none of these ways, nor in one of another format, is taken for one of the
/// first.
pub static FORMATS: LazyLock<Vec<Format>> = LazyLock::new(|| {
    let of_meshes = |f: mesh::MeshFormat| Format {
        name: f.name,
        endings: f.endings,
        read: Read::Meshes(f.read),
        names: |_, _| Vec::new(),
    };
    [csg::FORMAT].into_iter().chain(mesh::FORMATS.map(of_meshes)).collect()
});

/// A file that is in memory.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// What errors call it.
    pub name: &'a str,
    /// The name of its format; empty: as its name ends.
    pub format: &'a str,
    /// What it has in it.
    pub bytes: &'a [u8],
    /// The files that it names; `None` where it was sent, and names none.
    pub attached: Option<&'a [Attachment]>,
}

impl<'a> Source<'a> {
    /// A file whose name says what it is.
    pub fn named(name: &'a str, bytes: &'a [u8]) -> Self {
        Self { name, format: "", bytes, attached: None }
    }

    /// Its format.
    ///
    /// # Errors
    /// `Format` when one is stated that is not read, or none is and the name ends as files of another one do.
    pub fn format(&self) -> Result<&'static Format, ImportError> {
        let refused = |found: String| ImportError::Format {
            file: self.name.to_owned(),
            expected: FORMATS.iter().map(|f| f.name).collect::<Vec<_>>().join(", "),
            found,
        };
        if !self.format.is_empty() {
            let stated = self.format.to_ascii_lowercase();
            return FORMATS.iter().find(|f| f.name == stated).ok_or_else(|| refused(format!("{:?}", self.format)));
        }
        let ending = Path::new(self.name).extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        if let Some((_, what)) = OTHERS.iter().find(|(endings, _)| endings.contains(&ending.as_str())) {
            return Err(refused((*what).to_owned()));
        }
        Ok(FORMATS.iter().find(|f| f.endings.contains(&ending.as_str())).unwrap_or(&FORMATS[0]))
    }

    /// Reads it.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn import(&self, facets: Facets, limits: &Limits) -> Result<Import, ImportError> {
        match self.format()?.read {
            Read::Model(read) => read(self, facets, limits),
            Read::Meshes(read) => mesh::import(self.name, read(self.bytes, limits), limits),
        }
    }
}

/// Reads the bytes of a file.
///
/// # Errors
/// `Read`, and `Large` when there are more than the limit says.
pub fn read_bytes(path: &Path, limits: &Limits) -> Result<Vec<u8>, ImportError> {
    let file = path.display().to_string();
    let read = |reason| ImportError::Read { file: file.clone(), reason };
    let large = || ImportError::Large { file: file.clone(), limit: limits.bytes };
    let length = std::fs::metadata(path).map_err(read)?.len();
    if length > limits.bytes as u64 {
        return Err(large());
    }
    // A device or a pipe has no length, and perhaps no end.
    let mut bytes = Vec::with_capacity(length as usize);
    let opened = std::fs::File::open(path).map_err(read)?;
    opened.take(limits.bytes as u64 + 1).read_to_end(&mut bytes).map_err(read)?;
    if bytes.len() > limits.bytes { Err(large()) } else { Ok(bytes) }
}

/// A file and those that it names.
#[derive(Clone, Debug)]
pub struct ModelBytes {
    name: String,
    format: &'static str,
    bytes: Vec<u8>,
    attached: Vec<Attachment>,
}

impl ModelBytes {
    /// Reads a file whose name says what it is, and those that it names: from its own folder and below, or from the root that
    /// `access` names, nowhere else; and the machine's fonts that it names. OpenSCAD's own texts are flattened first.
    ///
    /// # Errors
    /// `Read`, `Large` when there are more bytes than the limit says, and `Flatten`; what is wrong with a file that it names is
    /// kept for who asks for that.
    pub fn read(path: &Path, access: &Access, limits: &Limits) -> Result<Self, ImportError> {
        let (mut name, mut warnings) = (path.display().to_string(), Vec::new());
        let (bytes, format) = if openscad::is_source(path) {
            let flattened = access.openscad.flatten(path, limits)?;
            name += ", flattened";
            warnings = flattened.warnings;
            (flattened.bytes, csg::FORMAT.name)
        } else {
            (read_bytes(path, limits)?, "")
        };
        let mut attached = attached(&Source { format, ..Source::named(&name, &bytes) }, path, access, limits)?;
        if !warnings.is_empty() {
            let bytes = Ok(warnings.join("\n").into_bytes());
            attached.push(Attachment { name: Attachment::WARNINGS.to_owned(), bytes });
        }
        Ok(Self { name, format, bytes, attached })
    }

    /// A flattened OpenSCAD text that another file gave rise to, and the files that it names, relative to the folder of `path`.
    pub fn of_text(name: String, text: &str, path: &Path, access: &Access, limits: &Limits) -> Self {
        let bytes = text.as_bytes().to_vec();
        let source = Source { format: csg::FORMAT.name, ..Source::named(&name, &bytes) };
        let attached = attached(&source, path, access, limits).unwrap_or_default();
        Self { name, format: csg::FORMAT.name, bytes, attached }
    }

    /// What is read of it.
    pub fn source(&self) -> Source<'_> {
        Source { format: self.format, attached: Some(&self.attached), ..Source::named(&self.name, &self.bytes) }
    }

    /// Reads it. The bytes of a mesh are given back before the solid is made of what was in them.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn import(self, facets: Facets, limits: &Limits) -> Result<Import, ImportError> {
        let Read::Meshes(read) = self.source().format()?.read else { return self.source().import(facets, limits) };
        let Self { name, bytes, .. } = self;
        let bodies = read(&bytes, limits);
        drop(bytes);
        mesh::import(&name, bodies, limits)
    }
}

/// The files that a text at `path` names: from its own folder and below, or from the root that `access` names.
fn attached(source: &Source, path: &Path, access: &Access, limits: &Limits) -> Result<Vec<Attachment>, ImportError> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let roots = (access.root.as_deref(), access.packages.as_slice());
    let attach = |named| match named {
        Named::File(name) => Attachment { bytes: beside(folder, roots, &name, limits), name },
        Named::Font(pattern) => Attachment { bytes: machine::find(&pattern), name: pattern.attachment() },
    };
    Ok((source.format()?.names)(source.bytes, limits).into_iter().map(attach).collect())
}

/// The files that a text which was sent names, in a folder and below. Fonts are those that a text that is sent has anyway.
pub fn files_of(source: &Source, root: &Path, limits: &Limits) -> Vec<Attachment> {
    let names = source.format().map(|format| (format.names)(source.bytes, limits)).unwrap_or_default();
    let files = names.into_iter().filter_map(|named| match named {
        Named::File(name) => Some(Attachment { bytes: beside(root, (Some(root), &[]), &name, limits), name }),
        Named::Font(_) => None,
    });
    files.collect()
}

/// The bytes of a file that a text in `folder` names; it is in `root` or below, which is `folder` unless another one is given, or in
/// one of some packages. Links count as what they lead to.
fn beside(
    folder: &Path,
    (root, packages): (Option<&Path>, &[PathBuf]),
    name: &str,
    limits: &Limits,
) -> Result<Vec<u8>, String> {
    let of = |path: &Path| path.canonicalize().map_err(|e| format!("{name:?}: {e}"));
    let top = match root {
        None => of(folder)?,
        Some(root) => {
            root.canonicalize().map_err(|e| format!("{name:?}, whose import root {}: {e}", root.display()))?
        }
    };
    let path = of(&folder.join(name))?;
    let is_of_package = || packages.iter().any(|p| p.canonicalize().is_ok_and(|p| path.starts_with(p)));
    if !path.starts_with(&top) && !is_of_package() {
        return Err(match root {
            None => {
                format!("{name:?}, which is not in the folder of the text that names it (--import-root gives another)")
            }
            Some(root) => format!("{name:?}, which is not in the import root {}", root.display()),
        });
    }
    if !path.is_file() {
        return Err(format!("{name:?}, which is no plain file"));
    }
    read_bytes(&path, limits).map_err(|e| e.to_string())
}

/// Reads a model from a file whose name says what it is.
///
/// # Errors
/// What is wrong with the file.
pub fn read_model(path: &Path, facets: Facets, limits: &Limits) -> Result<Import, ImportError> {
    ModelBytes::read(path, &Access::default(), limits)?.import(facets, limits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_format_is_what_is_stated_else_what_the_name_says() {
        let of = |name: &'static str, format: &'static str| {
            Source { name, format, bytes: b"", attached: None }.format().map(|f| f.name)
        };
        for (name, format) in [("a.csg", ""), ("a", ""), ("a.b/c", ""), ("a.CSG", ""), ("a.txt", "csg"), ("a", "CSG")] {
            assert_eq!(of(name, format).unwrap(), "csg", "{name} {format}");
        }
        let sentence = of("part.csg", "step").unwrap_err().to_string();
        assert!(sentence.starts_with("part.csg: expected one of the formats csg, stl, off, "), "{sentence}");
        assert!(sentence.ends_with(", found \"step\""), "{sentence}");
        assert_eq!(of("part.step", "csg").unwrap(), "csg");
        // Empty or not: what is no model by its name is none.
        for (name, found) in [
            ("run.mcap", "a recording (contactd replay repeats it)"),
            ("part.STEP", "a CAD file (export a mesh, such as STL or 3MF, or OpenSCAD's CSG)"),
            ("s.toml", "a scene, a robot or a geometry, which is no model"),
        ] {
            let sentence = of(name, "").unwrap_err().to_string();
            assert!(
                sentence.starts_with(&format!("{name}: expected one of the formats csg, stl, off, ")),
                "{sentence}"
            );
            assert!(sentence.ends_with(&format!(", found {found}")), "{sentence}");
        }
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
        let others = OTHERS.iter().flat_map(|(endings, _)| endings.iter());
        all(FORMATS.iter().flat_map(|f| f.endings.iter()).chain(others).copied().collect());
    }

    #[test]
    fn bytes_that_are_no_text_are_refused_with_their_place() {
        let sentence = Source::named("a.csg", b"cube();\n  \xff").import(Facets::Auto, &Limits::default()).unwrap_err();
        assert_eq!(sentence.to_string(), "a.csg:2:3: expected text in UTF-8, found the byte 0xff");
    }
}
