//! Wavefront OBJ: points, faces by their points' numbers from 1, or from the last one backwards. All groups are one mesh.
//!
//! Normals, texture coordinates, groups, materials, smoothing, lines and single points change no shape and are not read. A line that
//! ends in a backslash goes on in the next one.

use super::{Bodies, Line, MeshFormat, Polygons, Result};
use crate::import::Limits;
use std::borrow::Cow;

/// The row of `mesh::FORMATS`.
pub const FORMAT: MeshFormat =
    MeshFormat { name: "obj", endings: &["obj"], read: |bytes, limits| Ok(Bodies::of(read(bytes, limits)?, "OBJ")) };

/// What changes no shape.
const HARMLESS: [&str; 10] = ["vn", "vt", "vp", "o", "g", "s", "usemtl", "mtllib", "l", "p"];

/// Reads a mesh.
///
/// # Errors
/// What is wrong, with its place.
pub fn read(bytes: &[u8], limits: &Limits) -> Result<Polygons> {
    let (mut mesh, mut triangles) = (Polygons::default(), 0);
    for line in Line::all(&joined(super::text(bytes)?)) {
        let mut words = line.words();
        let word = words.next();
        match word.unwrap_or_default() {
            "v" => mesh.points.push(line.point(&mut words)?),
            "f" => {
                let mut face = Vec::new();
                for corner in words {
                    face.push(index(&line, corner, mesh.points.len())?);
                }
                if face.len() < 3 {
                    return line.wrong("three corners or more", None);
                }
                mesh.push(&face, line.at(word), &mut triangles, limits)?;
            }
            other if HARMLESS.contains(&other) => {}
            _ => return line.wrong("v, f, or what changes no shape (vn, vt, g, o, s, usemtl, mtllib)", word),
        }
    }
    Ok(mesh)
}

/// The text with lines that go on in one, each followed by as many empty ones: the lines behind keep their numbers.
fn joined(text: &str) -> Cow<'_, str> {
    if !text.contains('\\') {
        return Cow::Borrowed(text);
    }
    let (mut all, mut taken) = (String::with_capacity(text.len()), 0);
    for line in text.lines() {
        if let Some(start) = line.strip_suffix('\\') {
            all.push_str(start);
            all.push(' ');
            taken += 1;
        } else {
            all.push_str(line);
            (0..=taken).for_each(|_| all.push('\n'));
            taken = 0;
        }
    }
    Cow::Owned(all)
}

/// The place in the list of `count` points that a corner such as 3/1/2 or -1 names.
fn index(line: &Line<'_>, corner: &str, count: usize) -> Result<u32> {
    let number = corner.split('/').next().and_then(|w| w.parse::<i64>().ok());
    let place = match number {
        Some(n) if n > 0 => n - 1,
        Some(n) if n < 0 => count as i64 + n,
        Some(_) | None => -1,
    };
    if (0..count as i64).contains(&place) {
        Ok(place as u32)
    } else {
        line.wrong(format!("a point's number up to {count}"), Some(corner))
    }
}
