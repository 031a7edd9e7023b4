//! A point against a solid: its side, and bounds of its signed distance from those of its distance from the solid and the complement.

use super::foot::Ground;
use super::near::{Enough, Known, distance};
use super::{PointAnswer, PointOptions, PosedModel, Side, Sought, faces_at, rounding, three};
use crate::contact::query::outcome::NO_FACE;
use glam::DVec3;

/// See [`super::points`].
pub fn of_point(solid: &PosedModel, point: DVec3, options: &PointOptions) -> PointAnswer {
    let model = solid.model;
    if model.solid.is_empty() {
        return answer(solid, (f64::INFINITY, f64::INFINITY), None, (options, 0.0), 0);
    }
    let from_world = point - solid.pose.position;
    let x = solid.pose.rotation.conjugate() * from_world;
    let rounding = rounding(model, from_world.length() + f64::EPSILON * solid.pose.position.length());
    let scale = if model.radius.is_finite() { model.radius } else { x.length() + model.face_reach + 1.0 };
    // Below four of it nothing is told apart: points are moved inwards by as much, at a corner by more.
    let is_for_side = options.tolerance == f64::INFINITY;
    let tolerance = if is_for_side { 0.0 } else { options.tolerance }.max(8.0 * rounding);
    let f = model.value(x);
    let of = |sought: Sought, threshold: f64| {
        let ground = Ground { model, sought, x, rounding, scale };
        distance(ground, Enough { tolerance, threshold, limit: options.limit })
    };
    let threshold = if is_for_side { options.surface } else { f64::NAN };
    if f > rounding {
        let by_value = f - rounding;
        if by_value > threshold {
            return answer(solid, (by_value, f64::INFINITY), None, (options, rounding), 0);
        }
        let known = of(Sought::Solid, threshold);
        let bounds = (known.lower.max(by_value), known.upper);
        return answer(solid, bounds, known.foot, (options, rounding), known.cells);
    }
    if f < -rounding {
        let by_value = -f - rounding;
        if by_value > threshold {
            return answer(solid, (f64::NEG_INFINITY, -by_value), None, (options, rounding), 0);
        }
        let known = of(Sought::Complement, threshold);
        let bounds = (-known.upper, -known.lower.max(by_value));
        return answer(solid, bounds, known.foot, (options, rounding), known.cells);
    }
    on_a_face(solid, [of(Sought::Solid, threshold), of(Sought::Complement, threshold)], (options, rounding))
}

/// Of a point whose f is nothing but rounding: on the surface, or on a seam that is inside.
fn on_a_face(solid: &PosedModel, [inner, outer]: [Known; 2], options: (&PointOptions, f64)) -> PointAnswer {
    let lower = if inner.lower > 0.0 { inner.lower } else { -outer.upper };
    let upper = if outer.lower > 0.0 { -outer.lower } else { inner.upper };
    // Of the two surfaces' points the one on the side that the point is not on.
    let foot = if outer.lower > 0.0 || inner.foot.is_none() { outer.foot } else { inner.foot };
    answer(solid, (lower, upper.max(lower)), foot, options, inner.cells + outer.cells)
}

fn answer(
    solid: &PosedModel,
    (lower, upper): (f64, f64),
    foot: Option<DVec3>,
    (options, rounding): (&PointOptions, f64),
    cells: u64,
) -> PointAnswer {
    let side = Side::of_bounds(lower, upper, options.surface);
    let is_near = upper - lower <= options.tolerance.max(8.0 * rounding) || lower == upper;
    let is_settled = if options.tolerance == f64::INFINITY { side != Side::Undecided } else { is_near };
    let tolerance = 1e3 * rounding + 1e-9 * solid.model.size();
    let faces = foot.map_or([NO_FACE; 3], |y| three(&faces_at(solid.model, y, tolerance)));
    let nearest = foot.map_or(DVec3::NAN, |y| solid.pose.point(y));
    PointAnswer { side, lower, upper, nearest, faces, is_settled, cells }
}
