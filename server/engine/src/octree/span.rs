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
//! | torus | the larger of the tangent less what it dips and that of ρ and z | largest corner value of the ball at c, or ρ and z |
//!
//! v is psi(c) and n its gradient: psi is convex (but for a torus and a saddle), so it lies above its tangents and is
//! largest at a corner. The maximum over a primitive's faces is exact from above and a lower bound from below; a
//! formula's minima and maxima are bounds of both kinds. Both are moved outwards by the rounding.

use crate::math::tolerance::OUTWARD;
use crate::solid::{Face, Primitive};
use glam::DVec3;

/// (lower, upper) bound of psi of the primitive over the box center ± half.
pub fn primitive_span(p: &Primitive, center: DVec3, half: DVec3) -> (f64, f64) {
    if let Some(formula) = p.shape.formula() {
        // Of a large mesh the division is asked, in its own frame.
        let own = if formula.is_divided() { own_box(p, center, half) } else { (center, half, 0.0) };
        return formula.span(own, &mut |f| face_span(&p.faces[f as usize], center, half));
    }
    p.faces.listed().iter().fold((f64::NEG_INFINITY, f64::NEG_INFINITY), |(lo, hi), f| {
        let (l, h) = face_span(f, center, half);
        (lo.max(l), hi.max(h))
    })
}

/// A box in the frame of a primitive around the box center ± half, and what the rounding of faces may be there, a length.
fn own_box(p: &Primitive, center: DVec3, half: DVec3) -> (DVec3, DVec3, f64) {
    let turn = p.frame.matrix().transpose();
    let own = turn * (center - p.frame.position);
    let reach = center.abs().max_element() + half.max_element() + p.frame.position.abs().max_element();
    let abs = |v: DVec3| DVec3::new(turn.row(0).abs().dot(v), turn.row(1).abs().dot(v), turn.row(2).abs().dot(v));
    (own, abs(half), (reach + p.faces.reach()) * (4.0 * OUTWARD))
}

/// (lower, upper) bound of a face's psi over the box center ± half.
pub fn face_span(face: &Face, center: DVec3, half: DVec3) -> (f64, f64) {
    let (lo, hi) = face.span(center, half);
    let pad = rounding(face, center, half);
    (lo - pad, hi + pad)
}

/// What rounding may do to psi, its gradient times an offset and its bounds over the box center ± half, a length.
pub fn rounding(face: &Face, center: DVec3, half: DVec3) -> f64 {
    let reach = center.abs().max_element() + half.max_element();
    (reach + face.magnitude()) * OUTWARD
}
