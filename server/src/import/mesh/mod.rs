//! Files that are meshes: `stl`, `off`, `obj`, `msh`, `ply`, which are one each; `threemf`, `amf`, `gltf`, `dae`, which may be some.
//!
//! A mesh that is exactly convex becomes a polyhedron, any other one a mesh; several bodies are their union. Numbers are taken as they
//! stand, those of Collada in metres with +z up; a note says what the file says of its unit and of which way is up.

pub mod amf;
pub mod dae;
pub mod gltf;
pub mod msh;
pub mod obj;
pub mod off;
pub mod ply;
pub mod stl;
pub mod threemf;

use super::arrangement;
use super::problem::Problem;
use super::{Import, ImportError, Limits, Note, Place};
use crate::solid::primitive::{MeshFault, Polyhedron, Shape, TriangleMesh};
use crate::solid::{Label, Op, SolidBuilder};
use contactd_proto::Pose;
use glam::{DAffine3, DVec3};
use std::collections::HashMap;

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
        self.add(face, || at, count, limits)
    }

    /// Adds a face that stands where `at` tells, within the limit of triangles.
    fn add(&mut self, face: &[u32], at: impl FnOnce() -> Place, count: &mut usize, limits: &Limits) -> Result<()> {
        *count += face.len().saturating_sub(2);
        if *count > limits.mesh_facets {
            return Err((at(), Problem::Limit { what: "triangles of a mesh", limit: limits.mesh_facets }));
        }
        self.append(face);
        Ok(())
    }

    /// Adds a face.
    pub fn append(&mut self, face: &[u32]) {
        self.corners.extend_from_slice(face);
        self.ends.push(self.corners.len() as u32);
    }

    /// How many faces it has.
    pub fn count(&self) -> usize {
        self.ends.len()
    }

    /// True where it has no face.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The same where a transform puts it; one that mirrors turns its faces.
    pub fn placed(mut self, place: &DAffine3) -> Self {
        if *place == DAffine3::IDENTITY {
            return self;
        }
        self.points.iter_mut().for_each(|p| *p = place.transform_point3(*p));
        if place.matrix3.determinant() < 0.0 {
            let mut from = 0;
            for to in self.ends.iter().map(|end| *end as usize) {
                self.corners[from..to].reverse();
                from = to;
            }
        }
        self
    }

    /// The same without points that no face has.
    fn used(self) -> Self {
        let mut place = vec![u32::MAX; self.points.len()];
        let mut out = Self::default();
        let mut of = |i: u32| {
            let new = &mut place[i as usize];
            if *new == u32::MAX {
                *new = out.points.len() as u32;
                out.points.push(self.points[i as usize]);
            }
            *new
        };
        let corners = self.corners.iter().map(|i| of(*i)).collect();
        Self { corners, ends: self.ends, ..out }
    }
}

/// Faces of which neighbours agree about what is outside, and how many were turned for that: of what hangs together the fewer ones.
/// `None` where none has to be, and where an edge has not two faces or no way round suits all.
pub fn oriented(faces: &[Vec<u32>]) -> Option<(Vec<Vec<u32>>, usize)> {
    // The faces at each edge, and whether they run from its lower corner to its higher.
    let mut edges: HashMap<[u32; 2], Vec<(usize, bool)>> = HashMap::new();
    for (i, face) in faces.iter().enumerate() {
        for (a, b) in face.iter().zip(face.iter().cycle().skip(1)) {
            edges.entry([*a.min(b), *a.max(b)]).or_default().push((i, a < b));
        }
    }
    if edges.values().any(|e| e.len() != 2) {
        return None;
    }
    let mut turned: Vec<Option<bool>> = vec![None; faces.len()];
    let mut count = 0;
    for first in 0..faces.len() {
        if turned[first].is_some() {
            continue;
        }
        turned[first] = Some(false);
        let (mut shell, mut next) = (vec![first], 0);
        while let Some(&i) = shell.get(next) {
            next += 1;
            let here = turned[i]?;
            for (a, b) in faces[i].iter().zip(faces[i].iter().cycle().skip(1)) {
                let pair = &edges[&[*a.min(b), *a.max(b)]];
                let other = if pair[0].0 == i { pair[1].0 } else { pair[0].0 };
                let wanted = here ^ (pair[0].1 == pair[1].1);
                match turned[other] {
                    None => {
                        turned[other] = Some(wanted);
                        shell.push(other);
                    }
                    Some(is) if is != wanted => return None,
                    Some(_) => {}
                }
            }
        }
        let others = shell.iter().filter(|i| turned[**i] == Some(true)).count();
        if 2 * others > shell.len() {
            shell.iter().for_each(|i| turned[*i] = turned[*i].map(|t| !t));
        }
        count += others.min(shell.len() - others);
    }
    let turn = |(face, turned): (&Vec<u32>, &Option<bool>)| {
        let mut face = face.clone();
        if *turned == Some(true) {
            face.reverse();
        }
        face
    };
    (count > 0).then(|| (faces.iter().zip(&turned).map(turn).collect(), count))
}

/// What a file has in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Bodies {
    /// Bodies, each closed by itself; the solid is their union.
    pub all: Vec<Polygons>,
    /// What is said of lengths and axes.
    pub frame: String,
    /// What was left out.
    pub left_out: Vec<String>,
}

impl Bodies {
    /// None yet.
    fn new(frame: String) -> Self {
        Self { all: Vec::new(), frame, left_out: Vec::new() }
    }

    /// One, of a format that says nothing of lengths and axes.
    fn of(polygons: Polygons, format: &str) -> Self {
        let frame = format!("lengths and axes as they stand: {format} says neither its unit nor which way is up");
        Self { all: vec![polygons], ..Self::new(frame) }
    }

    fn leave(&mut self, what: &str) {
        if !self.left_out.iter().any(|w| w == what) {
            self.left_out.push(what.to_owned());
        }
    }
}

/// A format of meshes.
#[derive(Clone, Copy, Debug)]
pub struct MeshFormat {
    /// What it is called, in lower case.
    pub name: &'static str,
    /// How names of its files end, without the dot, in lower case.
    pub endings: &'static [&'static str],
    /// Reads the meshes of a file.
    pub read: fn(&[u8], &Limits) -> Result<Bodies>,
}

/// Every format of meshes that is read.
pub const FORMATS: [MeshFormat; 9] = [
    stl::FORMAT,
    off::FORMAT,
    obj::FORMAT,
    threemf::FORMAT,
    amf::FORMAT,
    ply::FORMAT,
    gltf::FORMAT,
    dae::FORMAT,
    msh::FORMAT,
];

/// The meshes of a file whose name ends as one of these formats' do; `None` for another one.
pub fn of_file(name: &str, bytes: &[u8], limits: &Limits) -> Option<Result<Bodies>> {
    let ending = std::path::Path::new(name).extension()?.to_str()?.to_ascii_lowercase();
    let format = FORMATS.iter().find(|f| f.endings.contains(&ending.as_str()))?;
    Some((format.read)(bytes, limits))
}

/// A model that is the meshes of a file.
pub(super) fn import(file: &str, read: Result<Bodies>, limits: &Limits) -> std::result::Result<Import, ImportError> {
    let of = |(at, problem)| ImportError::Content { file: file.to_owned(), at, problem };
    let Bodies { all, frame, left_out } = read.map_err(of)?;
    let at = Place::START;
    let mut notes = vec![Note { at, text: frame, amount: None }];
    notes.extend(left_out.into_iter().map(|what| Note { at, text: format!("{what}: left out"), amount: None }));
    let mut b = SolidBuilder::new();
    let count = all.len();
    let mut made = Vec::with_capacity(count);
    for (i, polygons) in all.into_iter().enumerate() {
        let (shape, repaired) = solid(polygons, limits).map_err(|fault| match count {
            1 => of((at, fault.into())),
            _ => of((at, Problem::Body { number: i + 1, count, fault: fault.to_string() })),
        })?;
        notes.extend(repaired.into_iter().map(|(text, amount)| Note { at, text, amount }));
        let label = Label { name: "mesh".into(), line: 1, column: 1, mirrored: false };
        made.push(b.primitive(shape, Pose::IDENTITY, label));
    }
    let root = match made.as_slice() {
        [one] => *one,
        _ => b.operation(Op::Union, &made),
    };
    Ok(Import { solid: b.finish(root), notes })
}

/// The solid within a mesh, and what was repaired.
fn solid(polygons: Polygons, limits: &Limits) -> std::result::Result<(Shape, Vec<(String, Option<f64>)>), MeshFault> {
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
    let closed = match TriangleMesh::closed(points, polygons.faces()) {
        Err(fault @ MeshFault::Mixed(..)) => {
            let faces: Vec<Vec<u32>> = polygons.faces().map(<[u32]>::to_vec).collect();
            let Some((turned, count)) = oriented(&faces) else { return Err(fault) };
            let mut polygons = Polygons { points: polygons.points, ..Polygons::default() };
            turned.iter().for_each(|face| polygons.append(face));
            let (shape, mut repaired) = solid(polygons, limits)?;
            let text = format!("a mesh with {count} faces that run the other way round than their neighbours: turned");
            repaired.insert(0, (text, None));
            return Ok((shape, repaired));
        }
        closed => closed?,
    };
    // Of many triangles they take as much as all the rest.
    drop(polygons);
    let (mesh, done) = arrangement::mesh(closed)?;
    Ok((mesh.into(), done.notes("a mesh")))
}

/// Text of a file, without the mark of UTF-8 that some programs begin it with.
fn text(bytes: &[u8]) -> Result<&str> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    std::str::from_utf8(bytes).map_err(|e| {
        let before = String::from_utf8_lossy(&bytes[..e.valid_up_to()]);
        let found = format!("the byte 0x{:02x}", bytes[e.valid_up_to()]);
        (Place::of_offset(&before, before.len()), Problem::syntax("text in UTF-8", found))
    })
}

/// The lines of some bytes that hold anything but a remark.
///
/// # Errors
/// What is no text.
pub(super) fn lines(bytes: &[u8]) -> Result<impl Iterator<Item = Line<'_>>> {
    Ok(Line::all(text(bytes)?))
}

/// A line of a text, its words and where they stand.
pub(super) struct Line<'t> {
    number: u32,
    text: &'t str,
}

impl<'t> Line<'t> {
    /// The lines of a text that hold anything but a remark.
    pub(super) fn all(text: &'t str) -> impl Iterator<Item = Line<'t>> {
        let lines = text.lines().enumerate().map(|(i, line)| {
            let text = line.split('#').next().unwrap_or_default();
            Line { number: i as u32 + 1, text }
        });
        lines.filter(|l| !l.text.trim().is_empty())
    }

    pub(super) fn words(&self) -> impl Iterator<Item = &'t str> + use<'t> {
        self.text.split_whitespace()
    }

    /// The place of a word of it; its end for none.
    pub(super) fn at(&self, word: Option<&str>) -> Place {
        let offset = match word {
            Some(w) => w.as_ptr() as usize - self.text.as_ptr() as usize,
            None => self.text.trim_end().len(),
        };
        let column = self.text[..offset].chars().count() as u32 + 1;
        Place { line: self.number, column }
    }

    pub(super) fn wrong<T>(&self, expected: impl Into<String>, word: Option<&str>) -> Result<T> {
        let found = word.map_or_else(|| "the end of the line".to_owned(), |w| format!("{w:?}"));
        Err((self.at(word), Problem::syntax(expected, found)))
    }

    /// A finite number.
    pub(super) fn number(&self, word: Option<&str>) -> Result<f64> {
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
