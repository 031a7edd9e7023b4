//! STL, both kinds: triangles with their corners; normals are not read, the order of corners tells the outside.

use super::{Bodies, Line, MeshFormat, Polygons, Result};
use crate::import::problem::Problem;
use crate::import::{Limits, Place};
use crate::math::mix::Mixed;
use glam::DVec3;
use std::collections::hash_map::Entry;

/// The row of `mesh::FORMATS`.
pub const FORMAT: MeshFormat =
    MeshFormat { name: "stl", endings: &["stl"], read: |bytes, limits| Ok(Bodies::of(read(bytes, limits)?, "STL")) };

/// Bytes before the triangles of a binary file: a remark, then their count.
const HEAD: usize = 84;
/// Bytes of one triangle: a normal, three corners, two bytes without meaning.
const TRIANGLE: usize = 50;

/// Reads a mesh.
///
/// # Errors
/// What is wrong, with its place; of a binary file it is the number of the triangle.
pub fn read(bytes: &[u8], limits: &Limits) -> Result<Polygons> {
    let counted = bytes.get(80..HEAD).map(|c| u32::from_le_bytes([c[0], c[1], c[2], c[3]]) as usize);
    let fits = counted.is_some_and(|n| bytes.len() == HEAD.saturating_add(n.saturating_mul(TRIANGLE)));
    match counted {
        Some(count) if fits => binary(&bytes[HEAD..], count, limits),
        _ if is_text(bytes) => ascii(super::text(bytes)?, limits),
        Some(count) => {
            let expected = format!(
                "{count} triangles of {TRIANGLE} bytes after {HEAD} bytes, or a text that begins with \"solid\""
            );
            Err((Place::START, Problem::syntax(expected, format!("{} bytes", bytes.len()))))
        }
        None => Err((Place::START, Problem::syntax("an STL file", format!("{} bytes", bytes.len())))),
    }
}

/// Binary files, too, may begin with that word.
fn is_text(bytes: &[u8]) -> bool {
    let begins = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    begins && std::str::from_utf8(bytes).is_ok()
}

fn binary(bytes: &[u8], count: usize, limits: &Limits) -> Result<Polygons> {
    let (mut mesh, mut triangles) = (Polygons::default(), 0);
    if count > limits.mesh_facets {
        return Err((Place::START, Problem::Limit { what: "triangles of a mesh", limit: limits.mesh_facets }));
    }
    // Each corner is there as often as it has triangles: equal ones are kept once.
    let mut known: Mixed<[u32; 3], u32> = Mixed::with_capacity_and_hasher(count / 2, Default::default());
    for (i, triangle) in bytes.chunks_exact(TRIANGLE).enumerate() {
        let number = |k: usize| {
            let b = &triangle[12 + 4 * k..16 + 4 * k];
            f32::from_le_bytes([b[0], b[1], b[2], b[3]])
        };
        let mut corners = [0; 3];
        for (k, corner) in corners.iter_mut().enumerate() {
            let at = [number(3 * k), number(3 * k + 1), number(3 * k + 2)];
            // Adding 0 turns -0 into 0.
            *corner = match known.entry(at.map(|x| (x + 0.0).to_bits())) {
                Entry::Occupied(known) => *known.get(),
                Entry::Vacant(free) => {
                    let point = DVec3::from_array(at.map(f64::from));
                    if !point.is_finite() {
                        let found = format!("{point} in triangle {i}");
                        return Err((Place::START, Problem::syntax("finite numbers", found)));
                    }
                    mesh.points.push(point);
                    *free.insert(mesh.points.len() as u32 - 1)
                }
            };
        }
        mesh.push(&corners, Place::START, &mut triangles, limits)?;
    }
    Ok(mesh)
}

fn ascii(text: &str, limits: &Limits) -> Result<Polygons> {
    let (mut mesh, mut triangles) = (Polygons::default(), 0);
    let mut facet: Option<Vec<u32>> = None;
    let mut lines = Line::all(text).peekable();
    let mut closed = true;
    while let Some(line) = lines.next() {
        let mut words = line.words();
        let word = words.next();
        match (word.unwrap_or_default().to_ascii_lowercase().as_str(), &mut facet) {
            ("solid", None) if closed => closed = false,
            ("endsolid", None) if !closed => closed = true,
            ("facet", None) if !closed => facet = Some(Vec::with_capacity(3)),
            ("outer", Some(_)) | ("endloop", Some(_)) => {}
            ("vertex", Some(corners)) if corners.len() < 3 => {
                let point = line.point(&mut words)?;
                corners.push(mesh.points.len() as u32);
                mesh.points.push(point);
            }
            ("endfacet", Some(corners)) if corners.len() == 3 => {
                let corners = std::mem::take(corners);
                mesh.push(&corners, line.at(word), &mut triangles, limits)?;
                facet = None;
            }
            (_, Some(corners)) if corners.len() < 3 => return line.wrong("a vertex", word),
            (_, Some(_)) => return line.wrong("endfacet", word),
            (_, None) if closed => return line.wrong("solid", word),
            (_, None) => return line.wrong("facet or endsolid", word),
        }
        if lines.peek().is_none() && !closed {
            return line.wrong("endsolid", None);
        }
    }
    Ok(mesh)
}
