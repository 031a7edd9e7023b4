//! Which faces hold a contact, and whether they leave a point, a line or a patch.

use crate::contact::query::outcome::{Extent, NO_FACE};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// A multiplier above this holds its face in the contact.
pub(in crate::contact) const ACTIVE: f64 = 1e-8;

/// Adds a face to those of a contact, once, where there is room.
pub(in crate::contact) fn note(list: &mut [u32; 3], face: u32) {
    if let Some(slot) = list.iter().position(|f| *f == NO_FACE)
        && !list.contains(&face)
    {
        list[slot] = face;
    }
}

/// How many faces are told.
pub(in crate::contact) fn noted(list: &[u32; 3]) -> usize {
    list.iter().filter(|f| **f != NO_FACE).count()
}

/// A face within this many roundings of a contact point passes through it.
pub(in crate::contact) const INCIDENT: f64 = 16.0;

/// How many tangent planes some unit normals make: at least one.
pub(in crate::contact) fn rank_of(normals: &[DVec3]) -> usize {
    match normals {
        [] | [_] => 1,
        _ => span_of(normals).len(),
    }
}

/// Orthonormal basis of the span of some unit vectors (Gram-Schmidt).
fn span_of(vectors: &[DVec3]) -> SmallVec<[DVec3; 3]> {
    let mut span: SmallVec<[DVec3; 3]> = SmallVec::new();
    for g in vectors {
        let r = span.iter().fold(*g, |r, e| r - *e * e.dot(r));
        if r.length() > 1e-6 && span.len() < 3 {
            span.push(r.normalize());
        }
    }
    span
}

/// Nullity of the Lagrangian's Hessian on the contact's tangent space: point, line or patch.
pub(in crate::contact) fn extent(gradients: &[DVec3], curvature: DMat3, scale: f64) -> Extent {
    let span = span_of(gradients);
    let flat = |v: f64| v.abs() * scale < 1e-6;
    match span.len() {
        1 => {
            let u = crate::math::any_perpendicular(span[0]);
            let v = span[0].cross(u);
            let (a, b, c) = (u.dot(curvature * u), u.dot(curvature * v), v.dot(curvature * v));
            let (mean, spread) = (0.5 * (a + c), (0.25 * (a - c) * (a - c) + b * b).sqrt());
            match (flat(mean - spread), flat(mean + spread)) {
                (true, true) => Extent::Patch,
                (false, false) => Extent::Point,
                _ => Extent::Line,
            }
        }
        2 => {
            let u = span[0].cross(span[1]).normalize();
            if flat(u.dot(curvature * u)) { Extent::Line } else { Extent::Point }
        }
        _ => Extent::Point,
    }
}
