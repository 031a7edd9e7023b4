//! Files that are one mesh: `stl`, `off`, `obj`.
//!
//! A mesh that is exactly convex becomes a polyhedron, any other one a mesh. None of these files says what its unit is or which way
//! is up: numbers are taken as they stand, and a note says so.

pub mod obj;
pub mod off;
pub mod stl;

use super::problem::Problem;
use super::{Import, ImportError, Limits, Note, Place};
use crate::solid::primitive::{MeshFault, Polyhedron, Shape, TriangleMesh};
use crate::solid::{Label, SolidBuilder};
use contactd_proto::Pose;
use glam::DVec3;

/// Something wrong at a place of a file.
pub type Result<T> = std::result::Result<T, (Place, Problem)>;

/// Points, and faces as lists of their indices, counter-clockwise from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polygons {
    /// The points.
    pub points: Vec<DVec3>,
    /// The faces, one after another.
    corners: Vec<u32>,
    /// Where each of them ends.
    ends: Vec<u32>,
}

impl Polygons {
    /// Triangles that its faces are cut into.
    pub fn triangles(&self) -> usize {
        self.faces().map(|f| f.len().saturating_sub(2)).sum()
    }

    /// The faces.
    pub fn faces(&self) -> impl Iterator<Item = &[u32]> {
        let from = std::iter::once(0).chain(self.ends.iter().copied());
        from.zip(&self.ends).map(|(from, to)| &self.corners[from as usize..*to as usize])
    }

    /// Adds a face, within the limit of triangles.
    fn push(&mut self, face: &[u32], at: Place, count: &mut usize, limits: &Limits) -> Result<()> {
        *count += face.len().saturating_sub(2);
        if *count > limits.mesh_facets {
            return Err((at, Problem::Limit { what: "triangles of a mesh", limit: limits.mesh_facets }));
        }
        self.corners.extend_from_slice(face);
        self.ends.push(self.corners.len() as u32);
        Ok(())
    }
}

/// The mesh of a file whose name ends as one of these formats' do; `None` for another one.
pub fn of_file(name: &str, bytes: &[u8], limits: &Limits) -> Option<Result<Polygons>> {
    let ending = std::path::Path::new(name).extension()?.to_str()?.to_ascii_lowercase();
    match ending.as_str() {
        "stl" => Some(stl::read(bytes, limits)),
        "off" => Some(off::read(bytes, limits)),
        "obj" => Some(obj::read(bytes, limits)),
        _ => None,
    }
}

/// A model that is one mesh, of a file in the format `format`.
fn import(
    file: &str,
    format: &str,
    read: Result<Polygons>,
    limits: &Limits,
) -> std::result::Result<Import, ImportError> {
    let of = |(at, problem)| ImportError::Content { file: file.to_owned(), at, problem };
    let polygons = read.map_err(of)?;
    let at = Place::START;
    let text = format!("lengths and axes as they stand: {format} says neither its unit nor which way is up");
    let mut notes = vec![Note { at, text, amount: None }];
    let (shape, repaired) = solid(&polygons, limits).map_err(|fault| of((at, fault.into())))?;
    notes.extend(repaired.into_iter().map(|(text, amount)| Note { at, text, amount }));
    let mut b = SolidBuilder::new();
    let root = b.primitive(shape, Pose::IDENTITY, Label { name: "mesh".into(), line: 1, column: 1, mirrored: false });
    Ok(Import { solid: b.finish(root), notes })
}

/// The solid within a mesh, and what was repaired.
fn solid(polygons: &Polygons, limits: &Limits) -> std::result::Result<(Shape, Vec<(String, Option<f64>)>), MeshFault> {
    let points = &polygons.points;
    if polygons.ends.len() <= limits.polyhedron_faces {
        let clockwise: Vec<Vec<u32>> = polygons.faces().map(|f| f.iter().rev().copied().collect()).collect();
        if let Ok((polyhedron, fit)) = Polyhedron::from_faces(points, &clockwise)
            && fit.moved == 0.0
        {
            let flipped = fit.flipped.then(|| ("a mesh with all faces reversed: flipped".to_owned(), None));
            return Ok((polyhedron.into(), flipped.into_iter().collect()));
        }
    }
    let (mesh, repair) = TriangleMesh::of_polygons(points, polygons.faces())?;
    Ok((mesh.into(), repair.notes("a mesh")))
}

/// Text of a file.
fn text(bytes: &[u8]) -> Result<&str> {
    std::str::from_utf8(bytes).map_err(|e| {
        let before = String::from_utf8_lossy(&bytes[..e.valid_up_to()]);
        let found = format!("the byte 0x{:02x}", bytes[e.valid_up_to()]);
        (Place::of_offset(&before, before.len()), Problem::syntax("text in UTF-8", found))
    })
}

/// A line of a text, its words and where they stand.
struct Line<'t> {
    number: u32,
    text: &'t str,
}

impl<'t> Line<'t> {
    /// The lines of a text that hold anything but a remark.
    fn all(text: &'t str) -> impl Iterator<Item = Line<'t>> {
        let lines = text.lines().enumerate().map(|(i, line)| {
            let text = line.split('#').next().unwrap_or_default();
            Line { number: i as u32 + 1, text }
        });
        lines.filter(|l| !l.text.trim().is_empty())
    }

    fn words(&self) -> impl Iterator<Item = &'t str> + use<'t> {
        self.text.split_whitespace()
    }

    /// The place of a word of it; its end for none.
    fn at(&self, word: Option<&str>) -> Place {
        let offset = match word {
            Some(w) => w.as_ptr() as usize - self.text.as_ptr() as usize,
            None => self.text.trim_end().len(),
        };
        let column = self.text[..offset].chars().count() as u32 + 1;
        Place { line: self.number, column }
    }

    fn wrong<T>(&self, expected: impl Into<String>, word: Option<&str>) -> Result<T> {
        let found = word.map_or_else(|| "the end of the line".to_owned(), |w| format!("{w:?}"));
        Err((self.at(word), Problem::syntax(expected, found)))
    }

    /// A finite number.
    fn number(&self, word: Option<&str>) -> Result<f64> {
        match word.and_then(|w| w.parse::<f64>().ok()).filter(|n| n.is_finite()) {
            Some(n) => Ok(n),
            None => self.wrong("a finite number", word),
        }
    }

    /// Three of them.
    fn point(&self, words: &mut impl Iterator<Item = &'t str>) -> Result<DVec3> {
        Ok(DVec3::new(self.number(words.next())?, self.number(words.next())?, self.number(words.next())?))
    }
}

#[cfg(test)]
mod tests;
