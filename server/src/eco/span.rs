//! Proven bounds of a primitive's psi over a box.
//!
//! The paper classifies a voxel by point tests of its corners; those miss a primitive that pokes through a face or lies
//! inside. Instead (face over the box c ± e):
//!
//! | face | lower bound | upper bound |
//! |---|---|---|
//! | plane | v − Σ e_k\|n_k\|, exact | v + Σ e_k\|n_k\|, exact |
//! | sphere | distance of box and centre − r, exact | largest corner value, exact |
//! | cylinder, cone | the larger of tangent v − Σ e_k\|n_k\| and axis (rho >= 0) | largest corner value, exact |
//!
//! v is psi(c) and n its gradient: psi is convex, so it lies above its tangents and is largest at a corner. The maximum
//! over a primitive's faces is exact from above and a lower bound from below. Both are moved outwards by the rounding.

use crate::math::tolerance::OUTWARD;
use crate::solid::{Face, Primitive};
use glam::DVec3;

/// (lower, upper) bound of psi of the primitive over the box center ± half.
pub fn primitive_span(p: &Primitive, center: DVec3, half: DVec3) -> (f64, f64) {
    p.faces.iter().fold((f64::NEG_INFINITY, f64::NEG_INFINITY), |(lo, hi), f| {
        let (l, h) = face_span(f, center, half);
        (lo.max(l), hi.max(h))
    })
}

/// (lower, upper) bound of a face's psi over the box center ± half.
pub fn face_span(face: &Face, center: DVec3, half: DVec3) -> (f64, f64) {
    let (lo, hi) = match *face {
        Face::Plane { normal, .. } => {
            let (v, tilt) = (face.value(center), normal.abs().dot(half));
            (v - tilt, v + tilt)
        }
        Face::Sphere { center: o, radius } => {
            let gap = ((center - o).abs() - half).max(DVec3::ZERO);
            (gap.length() - radius, largest_corner(face, center, half))
        }
        Face::Cylinder { radius, .. } => (tangent(face, center, half).max(-radius), largest_corner(face, center, half)),
        Face::Cone { apex, axis, sin, .. } => {
            // rho cos − z sin >= −z sin, and z is largest at a corner.
            let z = (center - apex).dot(axis) + axis.abs().dot(half);
            (tangent(face, center, half).max(-z * sin), largest_corner(face, center, half))
        }
    };
    let pad = rounding(face, center, half);
    (lo - pad, hi + pad)
}

/// What rounding may do to psi, its gradient times an offset and its bounds over the box center ± half, a length.
pub fn rounding(face: &Face, center: DVec3, half: DVec3) -> f64 {
    let reach = center.abs().max_element() + half.max_element();
    let scale = match *face {
        Face::Plane { offset, .. } => offset.abs(),
        Face::Sphere { center: o, radius } | Face::Cylinder { origin: o, radius, .. } => o.abs().max_element() + radius,
        Face::Cone { apex, .. } => apex.abs().max_element(),
    };
    (reach + scale) * OUTWARD
}

fn tangent(face: &Face, center: DVec3, half: DVec3) -> f64 {
    let at = face.at(center);
    at.value - at.normal.abs().dot(half)
}

fn largest_corner(face: &Face, c: DVec3, e: DVec3) -> f64 {
    let signs = [-1.0, 1.0];
    let mut hi = f64::NEG_INFINITY;
    for x in signs {
        for y in signs {
            for z in signs {
                hi = hi.max(face.value(c + e * DVec3::new(x, y, z)));
            }
        }
    }
    hi
}
