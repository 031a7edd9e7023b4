//! Complemented primitives: a body inside a cavity (n-pair), two cavities (nn-pair).
//!
//! Idea: the clearance of a body A inside a convex cavity B is the smallest of −(signed distance to B) over A. That
//! distance is convex inside B, so the smallest clearance lies at an extreme point of A: a corner, a point of a rim; for
//! a ball at its centre, less the radius.
//! Configurations: ball in any cavity; polyhedron in any cavity; cylinder or cone in a ball, in a cylinder or cone with a
//! parallel axis, in a polyhedron (support along each facet's normal). Others answer `None` and fall to the search.
//! Two spherical cavities: only the tangencies of their surfaces are events.
//! Source: Zeiller 1993, stage 3, complemented surfaces; the maximum principle for convex functions.

use super::{Ball, Convex, Round};
use crate::math::{any_perpendicular, tolerance::PARALLEL};
use glam::DVec3;

/// A body in a cavity.
#[derive(Clone, Copy, Debug)]
pub struct Clearance {
    /// Distance from the body to the wall, negative where it sticks out.
    pub value: f64,
    /// The point of the body nearest to the wall, or farthest beyond it.
    pub point: DVec3,
    /// Outward unit normal of the cavity there: from the body into the wall.
    pub normal: DVec3,
}

/// Clearance of `a` inside the cavity `b`; exact while `a` is inside. `None`: no closed form for this configuration.
pub fn clearance(a: &Convex, b: &Convex) -> Option<Clearance> {
    match (a, b) {
        (Convex::Ball(p), _) => {
            let (d, normal) = b.distance(p.center);
            Some(Clearance { value: -d - p.radius, point: p.center + normal * p.radius, normal })
        }
        (Convex::Poly(p), _) => nearest(b, p.vertices.iter().copied()),
        (Convex::Cylinder(p) | Convex::Cone(p), Convex::Poly(q)) => q
            .planes
            .iter()
            .map(|&(normal, offset)| {
                let point = p.support(normal);
                Clearance { value: offset - normal.dot(point), point, normal }
            })
            .min_by(|x, y| x.value.total_cmp(&y.value)),
        (Convex::Cylinder(p) | Convex::Cone(p), Convex::Ball(q)) => in_ball(p, q),
        (Convex::Cylinder(p) | Convex::Cone(p), Convex::Cylinder(q) | Convex::Cone(q)) => {
            (p.axis.cross(q.axis).length() <= PARALLEL).then(|| parallel(p, q, b))?
        }
    }
}

fn nearest(b: &Convex, points: impl Iterator<Item = DVec3>) -> Option<Clearance> {
    points
        .map(|point| {
            let (d, normal) = b.distance(point);
            Clearance { value: -d, point, normal }
        })
        .min_by(|x, y| x.value.total_cmp(&y.value))
}

/// The rims' points farthest from the ball's centre: opposite to its offset from the axis.
fn in_ball(p: &Round, q: &Ball) -> Option<Clearance> {
    nearest(&Convex::Ball(q.clone()), outermost(p, q.center, p.axis))
}

/// Parallel axes: the rims' points farthest from the cavity's axis.
fn parallel(p: &Round, q: &Round, b: &Convex) -> Option<Clearance> {
    nearest(b, outermost(p, q.centers[0], q.axis))
}

/// The point of each rim of `p` farthest from the line through `from` along `axis`.
fn outermost(p: &Round, from: DVec3, axis: DVec3) -> impl Iterator<Item = DVec3> {
    let o = p.centers[0] - from;
    let u = (o - axis * o.dot(axis)).try_normalize().unwrap_or_else(|| any_perpendicular(axis));
    let (centers, radii) = (p.centers, p.radii);
    (0..2).map(move |i| centers[i] + u * radii[i])
}

/// Two spherical cavities: signed gaps of their surfaces to outer tangency (distance of the centres − sum of the radii)
/// and to inner tangency (difference of the radii − distance). An event is a root of either.
pub fn tangency_of_cavities(a: &Ball, b: &Ball) -> [f64; 2] {
    let d = (b.center - a.center).length();
    [d - a.radius - b.radius, (a.radius - b.radius).abs() - d]
}
