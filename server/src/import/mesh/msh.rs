//! MuJoCo's own binary meshes (.msh): counts of points, normals, texture coordinates and triangles, then each of them.
//!
//! Source: mujoco.readthedocs.io, XMLreference, asset/mesh: four integers of 32 bits, then numbers in single precision and indices, all
//! little endian. Normals and texture coordinates are not read.

use super::{Bodies, MeshFormat, Place, Polygons, Result};
use crate::import::Limits;
use crate::import::problem::Problem;
use glam::DVec3;

/// The row of `mesh::FORMATS`.
pub const FORMAT: MeshFormat =
    MeshFormat { name: "msh", endings: &["msh"], read: |bytes, limits| Ok(Bodies::of(read(bytes, limits)?, "MSH")) };

/// Reads a file.
///
/// # Errors
/// Counts that its length does not fit to, numbers that are not finite, points that are not there.
pub fn read(bytes: &[u8], limits: &Limits) -> Result<Polygons> {
    let wrong = |expected: String, found: String| (Place::START, Problem::syntax(expected, found));
    let (words, rest) = bytes.as_chunks::<4>();
    let counts = words.first_chunk::<4>().map(|head| head.map(|w| i64::from(i32::from_le_bytes(w))));
    let Some([points, normals, textures, triangles]) = counts.filter(|c| c.iter().all(|n| *n >= 0)) else {
        return Err(wrong("four counts that are not negative at the file's beginning".into(), "others".into()));
    };
    // No sum of four numbers of 31 bits overflows.
    let length = 4 + 3 * (points + normals + triangles) + 2 * textures;
    if length != words.len() as i64 || !rest.is_empty() {
        return Err(wrong(format!("{} bytes, as the counts say", 4 * length), bytes.len().to_string()));
    }
    let (points, triangles) = (points as usize, triangles as usize);
    if triangles == 0 {
        return Err(wrong("a triangle".into(), "points alone".into()));
    }
    let mut mesh = Polygons::default();
    for (i, p) in words[4..4 + 3 * points].chunks_exact(3).enumerate() {
        let p = DVec3::from_slice(&[p[0], p[1], p[2]].map(|w| f64::from(f32::from_le_bytes(w))));
        if !p.is_finite() {
            return Err(wrong(format!("finite numbers as point {i}"), p.to_string()));
        }
        mesh.points.push(p);
    }
    let mut count = 0;
    for (i, t) in words[words.len() - 3 * triangles..].chunks_exact(3).enumerate() {
        let face = [t[0], t[1], t[2]].map(u32::from_le_bytes);
        if let Some(bad) = face.iter().find(|c| **c as usize >= points) {
            return Err(wrong(format!("a point's number below {points} in triangle {i}"), bad.to_string()));
        }
        mesh.push(&face, Place::START, &mut count, limits)?;
    }
    Ok(mesh)
}
