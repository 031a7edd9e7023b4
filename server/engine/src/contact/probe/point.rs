//! A point against a solid: its side, and bounds of its signed distance from those of its distance from the solid and the complement.
//!
//! Far away rounding hides all of a solid. So a point that is far from the ball around it, c and R, is asked for where the way to c
//! meets the ball of radius ρ around c: for each y in the solid |x − y| is no more than |x − x'| + |x' − y|, and less than that by no
//! more than R²/2(ρ − R), what y lies beside that way. With ρ = R²/E that is about half of E, what rounding may do at x.

use super::foot::Ground;
use super::near::{Enough, Known, distance};
use super::{PointAnswer, PointOptions, PosedModel, Side, Sought, faces_at, rounding, three};
use crate::contact::query::outcome::NO_FACE;
use crate::math::{Ball, scaled};
use crate::octree::Model;
use contactd_proto::pose::FARTHEST;
use glam::DVec3;

/// ρ is no less than this times R.
const NEAREST: f64 = 8.0;

/// See [`super::points`].
pub fn of_point(solid: &PosedModel, point: DVec3, options: &PointOptions) -> PointAnswer {
    let model = solid.model;
    if model.solid.is_empty() {
        return answer(solid, (f64::INFINITY, f64::INFINITY), None, (options, [0.0; 2]), 0);
    }
    let from_world = point - solid.pose.position;
    let x = solid.pose.rotation.conjugate() * from_world;
    let far = scaled::length(from_world);
    let rounding = rounding(model, far + f64::EPSILON * scaled::length(solid.pose.position));
    let ball = model.bounds.root().ball;
    if ball.radius.is_finite() && ball.radius > 0.0 {
        let least = NEAREST * ball.radius;
        let rho = (ball.radius * (ball.radius / rounding)).max(least);
        let away = scaled::length(x - ball.center);
        if away > 2.0 * rho {
            return from_afar(solid, (x, rounding), (ball, rho), options);
        }
        let found = from_near(solid, (x, rounding), options);
        // All of it is less than what rounding hides from there.
        if found.lower == f64::INFINITY && away > least {
            return from_afar(solid, (x, rounding), (ball, least), options);
        }
        return found;
    }
    // Beyond it squares are too large: of a solid without bounds nothing is told.
    if far.is_nan() || far >= FARTHEST {
        return answer(solid, (f64::NEG_INFINITY, f64::INFINITY), None, (options, [rounding; 2]), 0);
    }
    let found = from_near(solid, (x, rounding), options);
    if found.lower == f64::INFINITY && !ball.is_empty() {
        // Nothing that is deeper than rounding was found, which is not to say that there is none.
        let lower = (model.value(x) - rounding).max(0.0);
        return answer(solid, (lower, f64::INFINITY), None, (options, [rounding; 2]), found.cells);
    }
    found
}

/// Of a point outside of the ball of radius ρ.
fn from_afar(
    solid: &PosedModel,
    (x, far): (DVec3, f64),
    (ball, rho): (Ball, f64),
    options: &PointOptions,
) -> PointAnswer {
    let (model, away) = (solid.model, x - ball.center);
    let (Some(way), length) = (scaled::direction(away), scaled::length(away)) else {
        return answer(solid, (f64::NEG_INFINITY, f64::INFINITY), None, (options, [far; 2]), 0);
    };
    let y = ball.center + way * rho;
    let near = rounding(model, y.length());
    let tolerance = if options.tolerance == f64::INFINITY { 0.0 } else { options.tolerance };
    let tolerance = (tolerance - 3.0 * far).max(4.0 * far).max(8.0 * near).min(f64::MAX);
    let ground = Ground { model, sought: Sought::Solid, x: y, rounding: near, scale: scale(model, y) };
    let known = distance(ground, Enough { tolerance, threshold: f64::NAN, limit: options.limit });
    // What is left is no double where the length is none.
    let least = length.min(f64::MAX) * (1.0 - 4.0 * f64::EPSILON) - rho;
    let beside = ball.radius * (0.5 * ball.radius / (rho - ball.radius));
    let lower = least + known.lower - beside - if far.is_finite() { far } else { super::ROUNDING * f64::MAX };
    let bounds = (lower.max(0.0), length - rho + known.upper + far);
    answer(solid, bounds, known.foot, (options, [far, near]), known.cells)
}

/// What lengths are measured by.
fn scale(model: &Model, x: DVec3) -> f64 {
    if model.radius.is_finite() { model.radius } else { x.length() + model.face_reach + 1.0 }
}

/// Of a point that is not far.
fn from_near(solid: &PosedModel, (x, rounding): (DVec3, f64), options: &PointOptions) -> PointAnswer {
    let model = solid.model;
    let scale = scale(model, x);
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
            return answer(solid, (by_value, f64::INFINITY), None, (options, [rounding; 2]), 0);
        }
        let known = of(Sought::Solid, threshold);
        let bounds = (known.lower.max(by_value), known.upper);
        return answer(solid, bounds, known.foot, (options, [rounding; 2]), known.cells);
    }
    if f < -rounding {
        let by_value = -f - rounding;
        if by_value > threshold {
            return answer(solid, (f64::NEG_INFINITY, -by_value), None, (options, [rounding; 2]), 0);
        }
        let known = of(Sought::Complement, threshold);
        let bounds = (-known.upper, -known.lower.max(by_value));
        return answer(solid, bounds, known.foot, (options, [rounding; 2]), known.cells);
    }
    on_a_face(solid, [of(Sought::Solid, threshold), of(Sought::Complement, threshold)], (options, [rounding; 2]))
}

/// Of a point whose f is nothing but rounding: on the surface, or on a seam that is inside.
fn on_a_face(solid: &PosedModel, [inner, outer]: [Known; 2], options: (&PointOptions, [f64; 2])) -> PointAnswer {
    let lower = if inner.lower > 0.0 { inner.lower } else { -outer.upper };
    let upper = if outer.lower > 0.0 { -outer.lower } else { inner.upper };
    // Of the two surfaces' points the one on the side that the point is not on.
    let foot = if outer.lower > 0.0 || inner.foot.is_none() { outer.foot } else { inner.foot };
    answer(solid, (lower, upper.max(lower)), foot, options, inner.cells + outer.cells)
}

/// `[far, near]`: what rounding may do to the bounds, and to what is near the solid.
fn answer(
    solid: &PosedModel,
    (lower, upper): (f64, f64),
    foot: Option<DVec3>,
    (options, [far, near]): (&PointOptions, [f64; 2]),
    cells: u64,
) -> PointAnswer {
    let side = Side::of_bounds(lower, upper, options.surface);
    let is_near = upper - lower <= options.tolerance.max((8.0 * far).min(f64::MAX)) || lower == upper;
    let is_settled = if options.tolerance == f64::INFINITY { side != Side::Undecided } else { is_near };
    let tolerance = 1e3 * near + 1e-9 * solid.model.size();
    let faces = foot.map_or([NO_FACE; 3], |y| three(&faces_at(solid.model, y, tolerance)));
    let nearest = foot.map_or(DVec3::NAN, |y| solid.pose.point(y));
    PointAnswer { side, lower, upper, nearest, faces, is_settled, cells }
}
