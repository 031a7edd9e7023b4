//! The rounding budget of stage 3: one bound E on what rounding does to a literal's plane over a cell, and to the sum that
//! excludes a clause. A clause is excluded when its bound is above E.
//!
//! For a plane a + n·(x − c) computed at the cell's centre c, x anywhere in the cell, and multipliers λ with sum 1:
//!
//! * psi at a point, and how far its computed tangent may lie above psi: `FACE` half units of the numbers that went in;
//! * for a face of B: the centre in B's frame (`motion::Rounding::point`), the normal taken to A's axes, times the cell's
//!   radius (`motion::Rounding::matrix`);
//! * Σ λ b − Σ_k e_k |Σ λ n|_k, four terms at most: included in `FACE` and `CELL`.
//!
//! docs/accuracy.md counts the constants. A tangent taken far outside the cell, and a same-shape fit, subtract what they
//! have beyond E from their own bounds.

use crate::motion::{Relative, Rounding};
use crate::octree::Model;

/// Half a unit in the last place, with the room that products of errors need.
const U: f64 = 0.5 * f64::EPSILON * (1.0 + 1e-6);

/// Half units of |x| + `Face::reach`: 13 for psi, 16 for the tangent on an axis, 7 for the sums.
const FACE: f64 = 36.0;
/// Half units of the cell's radius: the normal's own rounding, the sums over the cell's half extents.
const CELL: f64 = 30.0;
/// Half units of the distance between the cell's centre and the point of a tangent plane.
const FAR: f64 = 48.0;

/// E for a pair, a length: `a` carries the cells.
pub fn of_literals(a: &Model, b: &Model, relative: &Relative) -> f64 {
    let (placed_a, placed_b) = relative.placed();
    let offsets = [placed_a.place.position.length(), placed_b.place.position.length()];
    of_motion(a, b, offsets, relative.apart(), &relative.rounding())
}

/// The larger one of either body carrying the cells; `relative` is that of a against b.
pub fn of_both(a: &Model, b: &Model, relative: &Relative) -> f64 {
    let (placed_a, placed_b) = relative.placed();
    let [of_a, of_b] = [placed_a, placed_b].map(|p| p.place.position.length());
    let (apart, motion) = (relative.apart(), relative.rounding());
    of_motion(a, b, [of_a, of_b], apart, &motion).max(of_motion(b, a, [of_b, of_a], apart, &motion))
}

/// The same from the distances of the centres of rotation from the models' origins, how far these centres come apart, and
/// what rounding does to the motion.
pub fn of_motion(a: &Model, b: &Model, [offset_a, offset_b]: [f64; 2], apart: f64, rounding: &Rounding) -> f64 {
    let ([mut reach, mut radius], [reach_b, radius_b]) = (a.extents, b.extents);
    if !reach.is_finite() {
        // An unbounded reference body has cells only where the other body can be.
        reach = offset_a + apart + offset_b + reach_b;
        radius = reach + radius_b;
    }
    let arm = reach + offset_a + radius;
    let on_a = FACE * (reach + a.face_reach) * U;
    let seen_from_b = arm + apart + offset_b;
    let on_b = FACE * (seen_from_b + b.face_reach) * U + rounding.point(arm) + rounding.matrix * radius;
    // Faces that are taken for one.
    let same = a.solid.alike.slack.max(b.solid.alike.slack);
    on_a.max(on_b) + CELL * radius * U + same
}

/// What the plane of a tangent has beyond E (a length), touched at this distance from the cell's centre.
pub fn of_distance(distance: f64) -> f64 {
    FAR * distance * U
}
