//! The faces that hold a point of a primitive along a direction.

use super::newton::Constraint;
use crate::contact::exclusion::literal::Side;
use crate::solid::local::LiteralId;
use crate::solid::{Primitive, Sense};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// Determinant of three faces' normals from which on they are independent.
const INDEPENDENT: f64 = 1e-9;

/// By how much a set of one more face must be nearer to n: more than rounding.
const NEARER: f64 = 1e-7;

/// The same where it is known that a smaller set does not hold the point.
const HARDLY_NEARER: f64 = 1e-11;

/// Faces with the weights with which their normals make a direction.
type Weighted = SmallVec<[(Constraint, f64); 8]>;

/// The faces of a primitive that pass within `tol` of its point x, and the weights with which their normals make n.
pub fn faces_at(side: Side, p: &Primitive, x: DVec3, n: DVec3, tol: f64, out: &mut Weighted) {
    least_set(side, p, x, n, (tol, NEARER), out);
}

/// The same with every face that takes part, by however little: where n is nearly that of an edge, a corner's third face.
pub fn all_faces_at(side: Side, p: &Primitive, x: DVec3, n: DVec3, tol: f64, out: &mut Weighted) {
    least_set(side, p, x, n, (tol, HARDLY_NEARER), out);
}

fn least_set(side: Side, p: &Primitive, x: DVec3, n: DVec3, (tol, nearer): (f64, f64), out: &mut Weighted) {
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
    for_sets(near.len(), |set| {
        let Some(weights) = weights(set, |i| near[i].1, n, INDEPENDENT) else { return };
        let sum: DVec3 = set.iter().zip(&weights).map(|(i, w)| near[*i].1 * *w).sum();
        // A larger set must be better by more than rounding.
        let off = (sum - n).length() + nearer * set.len() as f64;
        if off < 0.5 * best.0 || (off < best.0 && set.len() == best.1.len()) {
            best = (off, set.iter().copied().zip(weights).collect());
        }
    });
    out.extend(best.1.iter().map(|(i, w)| (Constraint::Literal(side, near[*i].0), *w)));
}

/// Calls `offer` with all sets of one, then of two, then of three of `count` indices.
pub fn for_sets(count: usize, mut offer: impl FnMut(&[usize])) {
    for i in 0..count {
        offer(&[i]);
    }
    for i in 0..count {
        for j in i + 1..count {
            offer(&[i, j]);
        }
    }
    for i in 0..count {
        for j in i + 1..count {
            for k in j + 1..count {
                offer(&[i, j, k]);
            }
        }
    }
}

/// Least-squares weights of the unit vectors `of` a set for n; `None` if one is not positive, or if they are dependent: three of
/// which the determinant is below `least`.
pub fn weights(set: &[usize], of: impl Fn(usize) -> DVec3, n: DVec3, least: f64) -> Option<SmallVec<[f64; 3]>> {
    let g = |i: usize| of(set[i]);
    let w: SmallVec<[f64; 3]> = match set.len() {
        1 => SmallVec::from_slice(&[g(0).dot(n)]),
        2 => {
            let c = g(0).dot(g(1));
            let det = 1.0 - c * c;
            let (p, q) = (g(0).dot(n), g(1).dot(n));
            SmallVec::from_slice(&[(p - c * q) / det, (q - c * p) / det])
        }
        _ => {
            let m = DMat3::from_cols(g(0), g(1), g(2));
            if m.determinant().abs() < least {
                return None;
            }
            SmallVec::from_slice(&(m.inverse() * n).to_array())
        }
    };
    w.iter().all(|w| w.is_finite() && *w > 0.0).then_some(w)
}
