//! OFF: counts, points, faces by their points' numbers from 0; colours are not read.

use super::{Bodies, Line, MeshFormat, Polygons, Result};
use crate::import::problem::Problem;
use crate::import::{Limits, Place};

/// The row of `mesh::FORMATS`.
pub const FORMAT: MeshFormat =
    MeshFormat { name: "off", endings: &["off"], read: |bytes, limits| Ok(Bodies::of(read(bytes, limits)?, "OFF")) };

/// Reads a mesh.
///
/// # Errors
/// What is wrong, with its place.
pub fn read(bytes: &[u8], limits: &Limits) -> Result<Polygons> {
    let text = super::text(bytes)?;
    let end = || Place::of_offset(text, text.len());
    let mut lines = Line::all(text);
    let ended = |what: &str| (end(), Problem::syntax(what, "the end of the file"));
    let mut line = lines.next().ok_or_else(|| ended("OFF"))?;
    let mut words = line.words().peekable();
    // Colours stand behind a point's coordinates, and are left where they are.
    match words.next() {
        Some("OFF" | "COFF") => {}
        word => return line.wrong("OFF", word),
    }
    if words.peek().is_none() {
        line = lines.next().ok_or_else(|| ended("the number of points"))?;
        words = line.words().peekable();
    }
    let mut count = |what: &str, most: usize| {
        let word = words.next();
        match word.and_then(|w| w.parse::<usize>().ok()) {
            Some(n) if n <= most => Ok(n),
            Some(_) => Err((line.at(word), Problem::Limit { what: "points or faces of a mesh", limit: most })),
            None => line.wrong(what, word),
        }
    };
    let points = count("the number of points", limits.mesh_facets.saturating_mul(3))?;
    let faces = count("the number of faces", limits.mesh_facets)?;
    let (mut mesh, mut triangles) = (Polygons::default(), 0);
    for _ in 0..points {
        let line = lines.next().ok_or_else(|| ended("a point"))?;
        mesh.points.push(line.point(&mut line.words())?);
    }
    for _ in 0..faces {
        let line = lines.next().ok_or_else(|| ended("a face"))?;
        let mut words = line.words();
        let word = words.next();
        let Some(corners) = word.and_then(|w| w.parse::<usize>().ok()).filter(|n| *n >= 3) else {
            return line.wrong("a number of corners from 3", word);
        };
        let mut face = Vec::new();
        for _ in 0..corners {
            let word = words.next();
            match word.and_then(|w| w.parse::<u32>().ok()).filter(|i| (*i as usize) < points) {
                Some(i) => face.push(i),
                None => return line.wrong(format!("a point's number below {points}"), word),
            }
        }
        mesh.push(&face, line.at(word), &mut triangles, limits)?;
    }
    match lines.next() {
        Some(line) => line.wrong("the end of the file", line.words().next()),
        None => Ok(mesh),
    }
}
