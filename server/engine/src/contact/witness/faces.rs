//! The faces that hold a point of a primitive along a direction.

use super::newton::Constraint;
use crate::contact::exclusion::literal::Side;
use crate::solid::local::LiteralId;
use crate::solid::{Primitive, Sense};
use glam::DVec3;
use smallvec::SmallVec;

/// The faces of a primitive that pass within `tol` of its point x, and the weights with which their normals make n.
pub fn faces_at(side: Side, p: &Primitive, x: DVec3, n: DVec3, tol: f64, out: &mut SmallVec<[(Constraint, f64); 8]>) {
    let mut near: SmallVec<[(LiteralId, DVec3); 8]> = SmallVec::new();
    for (i, face) in p.faces.listed().iter().enumerate() {
        let id = LiteralId::new(p.first_face + i as u32, Sense::Positive);
        if let Some(apex) = face.apex()
            && (x - apex.point).length() <= tol
        {
            // An apex holds every direction of its normal cone.
            let along = apex.directions();
            out.extend((0..3).map(|k| (Constraint::Apex(side, id, k), n.dot(along[usize::from(k)]))));
            return;
        }
        let f = face.at(x);
        if f.value.abs() <= tol && f.unit().dot(n) > -0.99 {
            near.push((id, f.unit()));
        }
    }
    // The least set of them whose normals hold n between them: one, two, then three.
    let mut best: (f64, SmallVec<[(usize, f64); 3]>) = (f64::INFINITY, SmallVec::new());
    let mut offer = |set: &[usize]| {
        let Some(weights) = weights(set, &near, n) else { return };
        let sum: DVec3 = set.iter().zip(&weights).map(|(i, w)| near[*i].1 * *w).sum();
        // A larger set must be better by more than rounding.
        let off = (sum - n).length() + 1e-7 * set.len() as f64;
        if off < 0.5 * best.0 || (off < best.0 && set.len() == best.1.len()) {
            best = (off, set.iter().copied().zip(weights).collect());
        }
    };
    for i in 0..near.len() {
        offer(&[i]);
    }
    for i in 0..near.len() {
        for j in i + 1..near.len() {
            offer(&[i, j]);
        }
    }
    for i in 0..near.len() {
        for j in i + 1..near.len() {
            for k in j + 1..near.len() {
                offer(&[i, j, k]);
            }
        }
    }
    out.extend(best.1.iter().map(|(i, w)| (Constraint::Literal(side, near[*i].0), *w)));
}

/// Least-squares weights of some unit vectors for n; `None` if one is negative or they are dependent.
fn weights(set: &[usize], near: &[(LiteralId, DVec3)], n: DVec3) -> Option<SmallVec<[f64; 3]>> {
    let g = |i: usize| near[set[i]].1;
    let w: SmallVec<[f64; 3]> = match set.len() {
        1 => SmallVec::from_slice(&[g(0).dot(n)]),
        2 => {
            let c = g(0).dot(g(1));
            let det = 1.0 - c * c;
            let (p, q) = (g(0).dot(n), g(1).dot(n));
            SmallVec::from_slice(&[(p - c * q) / det, (q - c * p) / det])
        }
        _ => {
            let m = glam::DMat3::from_cols(g(0), g(1), g(2));
            let det = m.determinant();
            if det.abs() < 1e-9 {
                return None;
            }
            SmallVec::from_slice(&(m.inverse() * n).to_array())
        }
    };
    w.iter().all(|w| w.is_finite() && *w > 0.0).then_some(w)
}
